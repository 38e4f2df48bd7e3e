# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Place the outputs that a goal switches during its motion as records in the plan."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from heapq import heappop, heappush
from typing import Any

from ur_cartesian_driver.motion.errors import InvalidGoal
from ur_cartesian_driver.motion.geometry.arrays import Floats
from ur_cartesian_driver.motion.goal.goal import OutputKind
from ur_cartesian_driver.motion.goal.output_names import output_name
from ur_cartesian_driver.motion.plan.plan import PlannedRows, ReferencePath
from ur_cartesian_driver.motion.plan.primitive import OutputRecord, SwitchOutput
from ur_cartesian_driver.planning.request.point_events.registry import OUTPUT_EVENTS
from ur_cartesian_driver.planning.request.point_events.timed_path import (
    PlacedOutput,
    SAME_TIME,
    TimedPath,
    ToTcp,
)
from ur_cartesian_driver.protocol.program.trajectory_points import MAX_LEADS, MAX_PENDING_OUTPUTS


def place_outputs(
    segments: PlannedRows,
    reference: ReferencePath,
    events: Mapping[str, Sequence[Any]],
    *,
    blend_halves: Floats | None = None,
    start_time: float = 0.0,
    point_times: Floats | None = None,
    control_cycle: float = 0.0,
    to_tcp: ToTcp | None = None,
) -> PlannedRows:
    """
    Return the segments with the records of outputs switched during the motion, in order of time.

    :param reference: the path of the tool along the segments, which begins at ``start_time``.
    :param events: the output events by goal field, with waypoints numbered as in ``segments``.
    :param blend_halves: duration of the first half of the blend after each segment [s]; None =
        no blends.
    :param start_time: when the first segment begins [s].
    :param point_times: (n,) time at which each point is passed, if a motion may lead through
        several points [s]; None = each point is at the end of a motion.
    :param control_cycle: cycle of the controller [s], needed for pulses only.
    :param to_tcp: see :class:`TimedPath`.
    :raises InvalidGoal: no motion leads to a point, events of one output conflict, or too many
        outputs are pending at once.
    """
    if not any(events.values()):
        return segments
    path = TimedPath(
        segments, reference, blend_halves, start_time, point_times, control_cycle, to_tcp
    )
    switches = [
        found
        for kind in OUTPUT_EVENTS
        for found in kind.place_all(events.get(kind.field, ()), path)
    ]
    # Where one stretch (on which a law drives an output) ends and the next begins, the end must
    # come first.
    switches.sort(key=lambda found: (found.time, not found.ends_stretch))
    _check_stretches(switches)
    _check_leads(switches)
    outputs: dict[int, tuple[OutputRecord, ...]] = {}
    notes = dict(segments.notes)
    for found in switches:
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


def _check_stretches(switches: Sequence[PlacedOutput]) -> None:
    """Refuse an event that switches an output while the robot program drives it by a law."""
    begins: dict[tuple[OutputKind, int], list[PlacedOutput]] = {}
    for found in switches:
        if found.stretch is not None:
            begins.setdefault(_output(found), []).append(found)
    for found in switches if begins else ():
        for begin in begins.get(_output(found), ()):
            stretch = begin.stretch
            if stretch is None or found.stretch is not None or found.field == begin.field:
                continue
            # The slower the tool moves, the later an output with a lead is switched, but it is
            # never switched after its place on the path.
            latest = found.time + found.lead
            if latest > begin.time + SAME_TIME and found.time < stretch.end - SAME_TIME:
                where = 'at its end' if found.ends_stretch else 'at its place'
                raise InvalidGoal(
                    f'{found.field}.pin',
                    f'is {_output(found)[1]}, but {where} {output_name(*_output(found))} '
                    f'{stretch.text}',
                    'use another output, or move the place',
                )


def _output(found: PlacedOutput) -> tuple[OutputKind, int]:
    """Return the kind and the pin of a placed output."""
    record = found.records[-1]
    assert isinstance(record, SwitchOutput)
    return record.output, record.pin


def _check_leads(switches: Sequence[PlacedOutput]) -> None:
    """
    Refuse too many simultaneous leads, and leads that swap two changes of one output.

    :param switches: the outputs in the order of time.
    """
    if not any(found.lead for found in switches):
        return
    running: list[float] = []
    #: By output: of the changes so far, the one whose place the tool passes last.
    latest: dict[tuple[OutputKind, int], PlacedOutput] = {}
    for found in switches:
        output, place = _output(found), found.time + found.lead
        before = latest.setdefault(output, found)
        if place < before.time + before.lead - SAME_TIME and before.time < found.time - SAME_TIME:
            raise InvalidGoal(
                before.lead_field,
                f'makes a lead of {before.lead:g} s, with which that output is switched before '
                'the change ahead of it on the path',
                'move the places apart, or reduce the lead',
            )
        if place >= before.time + before.lead:
            latest[output] = found
        if not found.lead:
            continue
        while running and running[0] <= found.time:
            heappop(running)
        heappush(running, place)
        if len(running) > MAX_LEADS:
            raise InvalidGoal(
                found.lead_field,
                f'is one of more than {MAX_LEADS} leads that run at the same time, '
                f'{found.time:.3f} s after the start',
                'shorten them, or move the places apart',
            )


def _waiting(records: Sequence[OutputRecord]) -> int:
    """Return the number of records that the robot program keeps: laws, and triggered outputs."""
    return sum(
        not isinstance(each, SwitchOutput) or each.trigger_pose is not None for each in records
    )
