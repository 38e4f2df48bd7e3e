# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""From a goal to the fields of its message, those that are not the default."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, TypeAlias

from ur_cartesian_driver.goal_files.goal_packing import packed_fields
from ur_cartesian_driver.goal_files.goal_reading import PRESS_SETTINGS, PROPORTIONAL_NUMBERS
from ur_cartesian_driver.motion.geometry.pose_rows import Floats
from ur_cartesian_driver.motion.goal.goal import Goal, IOCommand, Posture, SafeOutput, Tolerance
from ur_cartesian_driver.motion.goal.goal_table import goal_table, SegmentRows, WaypointRows

#: The fields of a message, by name.
Fields: TypeAlias = dict[str, Any]

_NANOSECONDS = 1_000_000_000


def fields_of_goal(goal: Goal, *, packed: bool = False) -> Fields:
    """
    Return the fields of a goal, as YAML has them and messages are made from.

    Frames are written by their names; a stamp is not written.

    :param packed: write points and segments in flat arrays, if these can hold them.
    """
    table = goal_table(goal)
    if packed and (arrays := packed_fields(table.waypoints, table.segments)) is not None:
        rest = replace(table, waypoints=WaypointRows.of(()), segments=SegmentRows.of(()))
        columns = {name: list(column) for name, column in arrays.items()}
        return fields_of_goal(rest) | {'packed': _given(columns)}
    trajectory = _given(
        {
            'header': _given({'frame_id': table.frame_id}),
            'points': _points(table.waypoints),
            'controlled_frame': table.controlled_frame,
        }
    )
    return _given(
        {
            'trajectory': trajectory,
            'path_tolerance': _tolerance(table.path_tolerance),
            'goal_tolerance': _tolerance(table.goal_tolerance),
            'goal_time_tolerance': _duration(table.goal_time_tolerance),
            'segments': _segments(table.segments),
            'io_commands': [_io_command(command) for command in table.io_commands],
            'script_calls': [
                {
                    'point_index': call.waypoint,
                    'function': call.function,
                    **_given({'arguments': list(call.arguments)}),
                    'timeout': call.timeout,
                }
                for call in table.script_calls
            ],
            'input_waits': [
                {
                    'point_index': wait.waypoint,
                    'input': int(wait.input),
                    'pin': wait.pin,
                    'value': wait.value,
                    'timeout': wait.timeout,
                    **_given({'below': wait.below, 'go_on': wait.go_on}),
                }
                for wait in table.input_waits
            ],
            'proportional_outputs': [
                {
                    'first_point': output.first_waypoint,
                    'last_point': output.last_waypoint,
                    **_given({'analog_domain': int(output.domain)}),
                    **_given({name: getattr(output, name) for name in PROPORTIONAL_NUMBERS}),
                    'maximum': output.maximum,
                }
                for output in table.proportional_outputs
            ],
            'presses': [
                {
                    'first_point': press.first_waypoint,
                    'last_point': press.last_waypoint,
                    **_given(
                        {
                            'frame': int(press.frame),
                            'axes': list(press.axes),
                            'forces': list(press.forces),
                            'speed_limits': list(press.speed_limits),
                            'contact': int(press.contact),
                        }
                    ),
                    **{name: getattr(press, name) for name in PRESS_SETTINGS},
                }
                for press in table.presses
            ],
            'payload_changes': [
                {
                    'point_index': change.waypoint,
                    'mass': change.mass,
                    'center_of_gravity': _vector(change.center_of_gravity),
                }
                for change in table.payload_changes
            ],
            'execution': int(table.execution),
            'keep_open': table.keep_open,
            'replace_horizon': table.replace_horizon,
            'safe_outputs': [
                {**_output(output), **_given({'restore': output.restore})}
                for output in table.safe_outputs
            ],
            'min_speed_fraction': table.min_speed_fraction,
            'on_path_tolerance': int(table.on_path_tolerance),
            'stall_timeout': _duration(table.stall_timeout),
            'path_offset': _given(
                {
                    'limits': _vector(table.path_offset.limits) if table.path_offset else None,
                    'speed': table.path_offset.speed,
                    'acceleration': table.path_offset.acceleration,
                    'timeout': table.path_offset.timeout,
                    'on_stale': int(table.path_offset.on_stale),
                }
            ),
        }
    )


def _given(fields: Mapping[str, Any]) -> Fields:
    """Return the fields that are not empty, zero or false; NaN is none of these."""
    return {name: value for name, value in fields.items() if value}


def _points(points: WaypointRows) -> list[Fields]:
    times = [_duration(time) for time in points.times.tolist()]
    columns = [_rates(rows) for rows in (points.twists, points.accelerations, points.jerks)]
    return [
        _given(
            {
                'time_from_start': time,
                'pose': _pose(pose),
                'twist': twist,
                'acceleration': acceleration,
                'jerk': jerk,
                'posture': _posture(points.postures.get(i)),
            }
        )
        for i, (time, pose, twist, acceleration, jerk) in enumerate(
            zip(times, points.poses.tolist(), *columns, strict=True)
        )
    ]


def _segments(segments: SegmentRows) -> list[Fields]:
    return [
        _given(
            {
                'type': int(segment.type),
                'blend_radius': segment.blend_radius,
                'dwell': segment.dwell,
                'velocity': segment.velocity,
                'acceleration': segment.acceleration,
                'via': None if segment.via is None else _pose(segment.via.row()),
                'via_posture': _posture(segment.via_posture),
                'arc_mode': int(segment.arc_mode),
                'free_axis': int(segment.free_axis),
                'free_min': segment.free_min,
                'free_max': segment.free_max,
            }
        )
        for segment in segments
    ]


def _pose(row: Sequence[float]) -> Fields:
    return {'position': _vector(row[:3]), 'orientation': dict(zip('xyzw', row[3:], strict=True))}


def _vector(values: Sequence[float]) -> Fields:
    return dict(zip('xyz', values, strict=True))


def _six(values: Sequence[float], linear: str, angular: str) -> Fields:
    parts = {linear: values[:3], angular: values[3:]}
    return {name: _vector(part) for name, part in parts.items() if any(part)}


def _rates(rows: Floats) -> list[Fields]:
    return [_six(row, 'linear', 'angular') for row in rows.tolist()]


def _duration(time: float) -> Fields:
    """Return seconds to the nearest nanosecond."""
    sec, nanosec = divmod(round(time * _NANOSECONDS), _NANOSECONDS)
    return _given({'sec': sec, 'nanosec': nanosec})


def _posture(posture: Posture | None) -> Fields:
    if not posture:
        return {}
    return {
        'posture_joint_names': list(posture.names),
        'posture_joint_values': list(posture.values),
    }


def _tolerance(tolerance: Tolerance) -> Fields:
    fields = _six((*tolerance.position, *tolerance.orientation), 'position', 'orientation')
    for name in ('twist', 'acceleration'):
        fields[name] = _six(getattr(tolerance, name), 'linear', 'angular')
    return {f'{name}_error': value for name, value in fields.items() if value}


def _io_command(command: IOCommand) -> Fields:
    return {
        'point_index': command.waypoint,
        **_output(command),
        **_given({'offset': _duration(command.offset)}),
    }


def _output(output: IOCommand | SafeOutput) -> Fields:
    return {
        'output': int(output.output),
        'pin': output.pin,
        'value': output.value,
        **_given({'analog_domain': int(output.domain)}),
    }
