# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The report of a plan: a line of text for each segment, and remarks on stops and blends."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import degrees

from ur_cartesian_driver.motion.geometry.pose import Pose
from ur_cartesian_driver.motion.goal.goal import DEFAULT_GOAL_TIME_TOLERANCE, Goal, SegmentType
from ur_cartesian_driver.motion.plan.plan import LateLines
from ur_cartesian_driver.motion.plan.primitive import MoveC, MoveJ, OptimoveJ, Primitive
from ur_cartesian_driver.planning.geometry.blended_path import CurveRows
from ur_cartesian_driver.planning.moves.segment_geometries import SegmentGeometries
from ur_cartesian_driver.planning.moves.segment_timing import SegmentTimings
from ur_cartesian_driver.planning.options import PlanningOptions
from ur_cartesian_driver.planning.request.blend_limits import (
    BLEND_LAWS,
    blend_time_uncertainty,
    blends_are_measured,
    measured_on,
)
from ur_cartesian_driver.planning.request.goal_fields import IS_OPTIMIZED
from ur_cartesian_driver.planning.request.ignored_fields import add_remark


def segment_lines(
    geometries: SegmentGeometries,
    timings: SegmentTimings,
    primitives: Sequence[Primitive],
    reasons: Mapping[int, Sequence[str]],
) -> LateLines:
    """
    Return the report lines of all segments.

    :param reasons: for each point, the reasons for the choice of its primitive.
    """

    def make(rows: range) -> list[str]:
        lines, path = [], geometries.path
        part = slice(rows.start, rows.stop)
        columns = zip(
            rows,
            geometries.segments.types[part].tolist(),
            primitives[part],
            path.radius[part].tolist(),
            geometries.tightest_margins[part],
            strict=True,
        )
        for row, asked, primitive, radius, margin in columns:
            why = reasons.get(geometries.begin + row)
            parts = [
                f'point {geometries.begin + row}: {SegmentType(asked).name} -> {_name(primitive)}'
                + (f' because {" and ".join(why)}' if why else ''),
                f'{_extent(path.curves, row)} in {_duration(geometries, timings, row)}',
            ]
            if radius:
                parts.append(f'blend {1e3 * radius:g} mm')
            parts.append(timings.requests.source(row))
            lines.append(f'{", ".join(parts)}; margin {margin}')
        return lines

    return LateLines(range(len(geometries)), make)


def stop_remarks(geometries: SegmentGeometries) -> list[str]:
    """Return the remarks on inner points at which the arm stops."""
    lines: list[str] = []
    add_remark(
        lines,
        geometries.begin,
        geometries.path.radius[:-1] == 0.0,
        'the arm stops there, because there is no blend (blend_radius)',
    )
    return lines


def twin_remarks(options: PlanningOptions, timings: SegmentTimings) -> list[str]:
    """Return the remarks on the measured laws that the plan follows, or does not follow."""
    twin, used = options.twin, options.used_twin
    if twin is None:
        return []
    lines = []
    if options.twin_problem:
        other = f'the twin of {twin.date} was measured on another robot: {options.twin_problem}'
        lines.append(
            f'{other}; the plan follows it, because allow_other_twin is true'
            if used
            else f'{other}; the plan does not follow it (allow_other_twin: true makes it follow)'
        )
    times = timings.chain.times
    laws = [
        *['turn_ratio'] * bool(timings.requests.turn_leads_line.any()),
        *['idle_between_moves'] * bool(timings.requests.rests_between.any()),
        *BLEND_LAWS[: 3 * bool((timings.requests.blends_by_law & (times.begin_rate > 0.0)).any())],
    ]
    if options.laws.blend_shape == 'unknown':
        laws = [name for name in laws if name not in BLEND_LAWS]
    if used and (measured := used.measured(*laws)):
        lines.append(f'planned as {measured_on(options)}: {measured}')
    return lines


def blend_remarks(
    goal: Goal, geometries: SegmentGeometries, timings: SegmentTimings, options: PlanningOptions
) -> list[str]:
    """Return the remark on the possible error of the planned end time; [] without blends."""
    if not geometries.path.has_blend_after.any() or geometries.is_optimized.any():
        return []
    planned, (least, greatest) = timings.durations.sum(), timings.bounds()
    off = max(planned - least.sum(), greatest.sum() - planned)
    is_measured = blends_are_measured(options) and bool(timings.requests.blends_by_law.any())
    law = measured_on(options) if is_measured else 'assumed for motion version 1'
    why = f'because how the robot passes them is not published; planned as {law}'
    if is_measured:
        off = min(
            off, blend_time_uncertainty(options) * float(timings.chain.times.blend_time.sum())
        )
        why = f'by the intervals of the laws {law}'
    clause = ''
    tolerance = goal.goal_time_tolerance or DEFAULT_GOAL_TIME_TOLERANCE
    if 0.0 <= tolerance < off and geometries.times[-1] > 0.0:
        clause = f', more than goal_time_tolerance ({tolerance:g} s)'
    return [f'blends: the end may be up to {off:.3f} s off{clause}, {why}']


def motion_version_remarks(options: PlanningOptions) -> list[str]:
    """Return the remark on a motion version above 1, which plans do not follow; else []."""
    motion_version = options.robot_motion_version
    if motion_version <= 1:
        return []
    but = ' but for those of the twin' if options.used_twin else ''
    return [
        f'the robot moves by motion version {motion_version}, but the plan follows the laws of '
        f'version 1{but}: times will differ a little, and blends may be smaller (motion_version: '
        '1 sets version 1)'
    ]


def _name(primitive: Primitive) -> str:
    """Return the motion type of the primitive, with the kinds of its targets."""
    name = type(primitive).__name__.upper()
    if isinstance(primitive, MoveC):
        kinds = [
            'JOINT' if isinstance(x, tuple) else 'POSE' for x in (primitive.target, primitive.via)
        ]
        return name if kinds == ['POSE', 'POSE'] else f'{name}_{"_".join(dict.fromkeys(kinds))}'
    if isinstance(primitive, MoveJ | OptimoveJ) and isinstance(primitive.target, Pose):
        return f'{name}_POSE'
    return name


def _extent(curves: CurveRows, row: int) -> str:
    turn = degrees(curves.angle[row])
    return f'{curves.length[row]:.3f} m' + (f' and {turn:.1f} degrees' if turn >= 0.05 else '')


def _duration(geometries: SegmentGeometries, timings: SegmentTimings, row: int) -> str:
    if IS_OPTIMIZED[geometries.kinds[row]]:
        return 'a time that the controller chooses and that is not predicted'
    curves, duration = geometries.path.curves, timings.durations[row]
    amount, unit = curves.angle[row], 'rad/s mean'
    if curves.length[row] > 1e-6:
        amount, unit = curves.length[row], 'm/s mean'
    elif curves.is_joint_line[row]:  # another posture of the same pose
        amount, unit = curves.joint_travel[row], 'rad/s mean of the leading joint'
    return f'{duration:.3f} s ({amount / max(duration, 1e-9):.3f} {unit})'
