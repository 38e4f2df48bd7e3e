# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Decodes the RTDE packets of the robot state.

:class:`~ur_cartesian_driver.motion.state.rtde_state.RobotState` declares the outputs and the
fields that they become; nothing of this is repeated here. Work that is the same for every packet
is done once: 500 packets arrive in a second, and a CANCEL may have to wait while one is decoded.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from enum import IntEnum, IntFlag
from functools import lru_cache
from math import isfinite
from operator import itemgetter
from typing import Any

from ur_cartesian_driver.motion.errors import RemoteProtocolError
from ur_cartesian_driver.motion.geometry.pose import Pose
from ur_cartesian_driver.motion.state.rtde_state import (
    RobotMode,
    RobotState,
    RuntimeState,
    SafetyMode,
    STATE_TABLE,
)
from ur_cartesian_driver.protocol.rtde.rtde_fields import DataType, OUTPUT_TYPES
from ur_cartesian_driver.protocol.rtde.rtde_recipe import RtdeValues

#: The rows of STATE_TABLE whose values come from RTDE, with their RTDE outputs.
_ROWS = tuple((row, row.rtde) for row in STATE_TABLE if row.rtde is not None)
REQUIRED_FIELDS = tuple(rtde.name for _, rtde in _ROWS if not rtde.optional)
OPTIONAL_FIELDS = tuple(rtde.name for _, rtde in _ROWS if rtde.optional)
#: All names, in the order of the table.
STATE_FIELDS = tuple(rtde.name for _, rtde in _ROWS)

#: The most cautious mode of each kind, which replaces unknown modes of newer software.
_UNKNOWN_MODES: Mapping[Any, IntEnum] = {
    RobotMode: RobotMode.NO_CONTROLLER,
    SafetyMode: SafetyMode.UNDEFINED_SAFETY_MODE,
    RuntimeState: RuntimeState.STOPPED,
}


def _converter(kind: Any) -> Callable[[Any], Any] | None:
    """Return the function that turns an RTDE value into this type; None = no conversion."""
    if kind is Pose:
        return Pose.from_rotation_vector
    if kind in _UNKNOWN_MODES:
        modes, unknown = {mode.value: mode for mode in kind}, _UNKNOWN_MODES[kind]
        return lru_cache(maxsize=16)(lambda number: modes.get(number, unknown))
    if isinstance(kind, type) and issubclass(kind, IntFlag):
        known = sum(kind)
        return lru_cache(maxsize=16)(lambda bits: kind(bits & known))
    return None


def _monitored(*types: DataType) -> tuple[int, ...]:
    """Return the indices of the outputs of these types that have to be finite."""
    return tuple(
        i
        for i, (_, rtde) in enumerate(_ROWS)
        if rtde.monitored and OUTPUT_TYPES[rtde.name] in types
    )


#: For each output, the value used if the robot does not have it.
_ABSENT = {
    rtde.name: row.default.rotation_vector() if row.type is Pose else row.default
    for row, rtde in _ROWS
}


def _compile() -> Callable[..., RobotState]:
    """Return the function that makes a state from a packet's values, compiled for speed."""
    known: dict[str, Any] = {'RobotState': RobotState}
    arguments = []
    for row, _ in _ROWS:
        convert = _converter(row.type)
        known[f'convert_{row.name}'] = convert
        arguments.append(row.name if convert is None else f'convert_{row.name}({row.name})')
    names = ', '.join(row.name for row, _ in _ROWS)
    function: Callable[..., RobotState] = eval(
        f'lambda {names}: RobotState({", ".join(arguments)})', known
    )
    return function


_state = _compile()
_vectors = itemgetter(*_monitored(DataType.VECTOR6D))
_numbers = itemgetter(*_monitored(DataType.DOUBLE))


def in_recipe_order(names: Sequence[str], values: RtdeValues) -> RtdeValues | tuple[Any, ...]:
    """Return the values in the order of :data:`STATE_FIELDS`, with defaults for missing ones."""
    if names == STATE_FIELDS:
        return values
    found = dict(zip(names, values, strict=True))
    return tuple(found.get(name, absent) for name, absent in _ABSENT.items())


def robot_state_from_rtde(values: Sequence[Any]) -> RobotState:
    """
    Return the state in a packet whose values are in the order of :data:`STATE_FIELDS`.

    Fields that also depend on earlier packets have their defaults.

    :raises RemoteProtocolError: a monitored number is not finite. Comparisons with NaN are always
        false, so the monitor of a goal would find no fault.
    """
    if not isfinite(sum(map(sum, _vectors(values))) + sum(_numbers(values))):
        raise RemoteProtocolError(_not_finite(values))
    return _state(*values)


def _not_finite(values: Sequence[Any]) -> str:
    names = [
        STATE_FIELDS[i]
        for i in _monitored(DataType.VECTOR6D, DataType.DOUBLE)
        if not isfinite(sum(values[i]) if isinstance(values[i], tuple) else values[i])
    ]
    return f'The robot reports numbers that are not finite: {", ".join(names)}.'
