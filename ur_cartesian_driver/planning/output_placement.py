# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Place the outputs that a goal switches during its motion as records in the plan."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

from ur_cartesian_driver.motion.errors import InvalidGoal
from ur_cartesian_driver.motion.geometry.arrays import Floats
from ur_cartesian_driver.motion.plan.plan import PlannedRows, ReferencePath
from ur_cartesian_driver.motion.plan.primitive import OutputRecord, SpeedLaw
from ur_cartesian_driver.planning.request.point_events.registry import OUTPUT_EVENTS
from ur_cartesian_driver.planning.request.point_events.timed_path import TimedPath
from ur_cartesian_driver.protocol.program.trajectory_points import MAX_PENDING_OUTPUTS


def place_outputs(
    segments: PlannedRows,
    reference: ReferencePath,
    events: Mapping[str, Sequence[Any]],
    *,
    blend_halves: Floats | None = None,
    start_time: float = 0.0,
    point_times: Floats | None = None,
) -> PlannedRows:
    """
    Return the segments with the records of outputs switched during the motion, in order of time.

    :param reference: the path of the TCP along the segments, on the clock of ``start_time``.
    :param events: the output events by goal field, with waypoints numbered as in ``segments``.
    :param blend_halves: duration of the first half of the blend after each segment [s]; None =
        no blends.
    :param start_time: when the first segment begins [s].
    :param point_times: when points are passed within a motion (n,) [s]; None = each point is at
        the end of a motion.
    :raises InvalidGoal: no motion leads to a point, or too many outputs are pending at once.
    """
    if not any(events.values()):
        return segments
    path = TimedPath(segments, reference, blend_halves, start_time, point_times)
    switches = [
        found
        for kind in OUTPUT_EVENTS
        for i, event in enumerate(events.get(kind.field, ()))
        for found in kind.place(event, f'{kind.field}[{i}]', path)
    ]
    outputs: dict[int, tuple[OutputRecord, ...]] = {}
    notes = dict(segments.notes)
    for found in sorted(switches, key=lambda found: found.time):
        row, line = found.after_index, found.report_index
        outputs[row] = (*outputs.get(row, ()), *found.records)
        notes[line] = f'{notes.get(line, "")}; {found.text}'
    for row in sorted(outputs):
        if _waiting(outputs[row]) > MAX_PENDING_OUTPUTS:
            raise InvalidGoal(
                'io_commands',
                f'switches more than {MAX_PENDING_OUTPUTS} outputs between two motions, '
                f'after point {segments.waypoints[row]}',
                'add a point in between',
            )
    return replace(segments, outputs=outputs, notes=notes)


def _waiting(records: Sequence[OutputRecord]) -> int:
    """Return the number of records that wait for a trigger pose, speed laws included."""
    return sum(isinstance(each, SpeedLaw) or each.trigger_pose is not None for each in records)
