# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The fields of ``FollowCartesianTrajectory.Goal``, without the generated messages.

A test compares them with the messages. A dict stands for a message, a list for a sequence of its
only element, and every other value is the default of its field.
"""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any, TypeAlias

#: A message, or an object with its fields.
Message: TypeAlias = Any


@dataclass(frozen=True, slots=True)
class Whole:
    """A field that is a whole number; its default is 0."""

    low: int
    high: int


UINT8, UINT32 = Whole(0, 2**8 - 1), Whole(0, 2**32 - 1)
TIME = {'sec': Whole(-(2**31), 2**31 - 1), 'nanosec': UINT32}
VECTOR = {'x': 0.0, 'y': 0.0, 'z': 0.0}
POSE = {'position': VECTOR, 'orientation': {**VECTOR, 'w': 1.0}}
RATES = {'linear': VECTOR, 'angular': VECTOR}
POSTURE = {'posture_joint_names': [''], 'posture_joint_values': [0.0]}
TOLERANCE = {
    'position_error': VECTOR,
    'orientation_error': VECTOR,
    'twist_error': RATES,
    'acceleration_error': RATES,
}
POINT = {
    'time_from_start': TIME,
    'pose': POSE,
    'twist': RATES,
    'acceleration': RATES,
    'jerk': RATES,
    'posture': POSTURE,
}
SEGMENT = {
    'type': UINT8,
    'blend_radius': 0.0,
    'dwell': 0.0,
    'velocity': 0.0,
    'acceleration': 0.0,
    'via': POSE,
    'via_posture': POSTURE,
    'arc_mode': UINT8,
    'free_axis': UINT8,
    'free_min': 0.0,
    'free_max': 0.0,
}
OUTPUT = {'output': UINT8, 'pin': UINT8, 'value': 0.0, 'analog_domain': UINT8}
PACKED = {
    'poses': [0.0],
    'times': [0.0],
    'twists': [0.0],
    'accelerations': [0.0],
    'posture_joint_names': [''],
    'postures': [0.0],
    'types': [UINT8],
    'arc_modes': [UINT8],
    'blend_radii': [0.0],
    'dwells': [0.0],
    'velocities': [0.0],
    'segment_accelerations': [0.0],
    'vias': [0.0],
    'via_postures': [0.0],
    'free_axes': [UINT8],
    'free_minima': [0.0],
    'free_maxima': [0.0],
}
GOAL: Mapping[str, Any] = {
    'trajectory': {
        'header': {'stamp': TIME, 'frame_id': ''},
        'points': [POINT],
        'controlled_frame': '',
    },
    'path_tolerance': TOLERANCE,
    'goal_tolerance': TOLERANCE,
    'goal_time_tolerance': TIME,
    'segments': [SEGMENT],
    'io_commands': [{'point_index': UINT32, 'offset': TIME, **OUTPUT}],
    'input_waits': [
        {
            'point_index': UINT32,
            'input': UINT8,
            'pin': UINT8,
            'value': 0.0,
            'below': False,
            'timeout': 0.0,
            'go_on': False,
        }
    ],
    'script_calls': [{'point_index': UINT32, 'function': '', 'arguments': [0.0], 'timeout': 10.0}],
    'payload_changes': [{'point_index': UINT32, 'mass': 0.0, 'center_of_gravity': VECTOR}],
    'proportional_outputs': [
        {
            'first_point': UINT32,
            'last_point': UINT32,
            'begin_lead': 0.0,
            'end_lead': 0.0,
            'pin': UINT8,
            'analog_domain': UINT8,
            'gain': 0.0,
            'offset': 0.0,
            'minimum': 0.0,
            'maximum': 1.0,
            'filter_time': 0.0,
            'idle': 0.0,
        }
    ],
    'presses': [
        {
            'first_point': UINT32,
            'last_point': UINT32,
            'frame': UINT8,
            'axes': [''],
            'forces': [0.0],
            'speed_limits': [0.0],
            'max_deviation': 0.0,
            'max_deviation_angle': 0.0,
            'max_yield': 0.0,
            'max_yield_angle': 0.0,
            'damping': 0.005,
            'gain_scaling': 1.0,
            'zero_sensor': False,
            'contact': UINT8,
        }
    ],
    'execution': UINT8,
    'validate_only': False,
    'keep_open': False,
    'replace_horizon': 0.0,
    'safe_outputs': [{**OUTPUT, 'restore': False}],
    'packed': PACKED,
    'min_speed_fraction': 0.0,
    'on_path_tolerance': UINT8,
    'stall_timeout': TIME,
    'path_offset': {
        'limits': VECTOR,
        'speed': 0.0,
        'acceleration': 0.0,
        'timeout': 0.0,
        'on_stale': UINT8,
    },
}


class FieldError(ValueError):
    """A value does not fit its field; the sentence names the key."""


def with_defaults(values: object, schema: Any = GOAL, key: str = '') -> Message:
    """
    Return plain data (as YAML reads it) as an object with all fields of the message.

    :raises FieldError: a key is unknown, or a value is not of its type.
    """
    if isinstance(schema, dict):
        return _fields(values, schema, key)
    if isinstance(schema, list):
        if not isinstance(values, list):
            raise FieldError(f'{key} is {values!r}, but must be a list.')
        return [with_defaults(item, schema[0], f'{key}[{i}]') for i, item in enumerate(values)]
    if isinstance(schema, str):
        if not isinstance(values, str):
            raise FieldError(f'{key} is {values!r}, but must be a text; put it in quotes.')
        return values
    if isinstance(schema, bool):
        if not isinstance(values, bool):
            raise FieldError(f'{key} is {values!r}, but must be true or false.')
        return values
    return _whole(values, schema, key) if isinstance(schema, Whole) else _number(values, key)


def _fields(values: object, schema: Mapping[str, Any], key: str) -> SimpleNamespace:
    if not isinstance(values, dict):
        raise FieldError(f'{key or "the goal"} is {values!r}, but must be a mapping of fields.')
    for name in values:
        if name not in schema:
            path = f'{key}.{name}' if key else name
            raise FieldError(f'{path} is not a field; {key or "a goal"} has {", ".join(schema)}.')
    return SimpleNamespace(
        **{
            name: with_defaults(values[name], kind, f'{key}.{name}' if key else name)
            if name in values
            else default(kind)
            for name, kind in schema.items()
        }
    )


def default(schema: Any) -> Any:
    """Return the default of a field."""
    if isinstance(schema, dict):
        return SimpleNamespace(**{name: default(kind) for name, kind in schema.items()})
    if isinstance(schema, list):
        return []
    return 0 if isinstance(schema, Whole) else schema


def _number(value: object, key: str) -> float:
    # YAML reads 1e-3 as a text; its own form is 1.0e-3.
    with suppress(ValueError):
        if isinstance(value, (int, float, str)) and not isinstance(value, bool):
            return float(value)
    raise FieldError(f'{key} is {value!r}, but must be a number.')


def _whole(value: object, kind: Whole, key: str) -> int:
    if not isinstance(value, int) or isinstance(value, bool) or not kind.low <= value <= kind.high:
        raise FieldError(
            f'{key} is {value!r}, but must be a whole number from {kind.low} to {kind.high}.'
        )
    return value
