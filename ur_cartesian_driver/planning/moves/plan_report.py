# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The report of a plan: a line for each segment, and the tightest margin of the goal."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import degrees

from ur_cartesian_driver.motion.goal import DEFAULT_GOAL_TIME_TOLERANCE, Goal, SegmentType
from ur_cartesian_driver.motion.plan import LateLines
from ur_cartesian_driver.motion.pose import Pose
from ur_cartesian_driver.motion.primitive import MoveC, MoveJ, OptimoveJ, Primitive
from ur_cartesian_driver.planning.geometry.curves import JointLineCurve
from ur_cartesian_driver.planning.moves.segment_data import SegmentGeometry, SegmentTiming
from ur_cartesian_driver.planning.request.goal_fields import is_optimized
from ur_cartesian_driver.planning.request.ignored_fields import add_remark


def segment_line(
    geometry: SegmentGeometry, timing: SegmentTiming, primitive: Primitive, reasons: Sequence[str]
) -> str:
    """
    Return the line of one segment.

    :param reasons: for the choice of the primitive.
    """
    asked = SegmentType(geometry.segment.type).name
    because = f' because {" and ".join(reasons)}' if reasons else ''
    parts = [
        f'point {geometry.index}: {asked} -> {_name(primitive)}{because}',
        f'{_extent(geometry)} in {_duration(geometry, timing)}',
    ]
    if geometry.blend_after is not None:
        parts.append(f'blend {1e3 * geometry.blend_after.radius:g} mm')
    parts.append(timing.source)
    return f'{", ".join(parts)}; margin {geometry.tightest_margin}'


def segment_lines(
    geometries: Sequence[SegmentGeometry],
    timings: Sequence[SegmentTiming],
    primitives: Sequence[Primitive],
    reasons: Mapping[int, Sequence[str]],
) -> LateLines:
    """
    Return the lines of all segments.

    :param reasons: by point, for the choice of the primitive.
    """
    return LateLines(
        len(geometries),
        lambda: [
            segment_line(geometry, timing, primitive, reasons.get(geometry.index, ()))
            for geometry, timing, primitive in zip(geometries, timings, primitives, strict=True)
        ],
    )


def tightest_remark(geometries: Sequence[SegmentGeometry]) -> str:
    """Return the remark about the tightest margin of the goal."""
    geometry = min(geometries, key=lambda geometry: geometry.tightest_margin.normalized)
    return f'tightest margin: {geometry.tightest_margin} of the segment to point {geometry.index}'


def stop_remarks(geometries: Sequence[SegmentGeometry]) -> list[str]:
    """Return at which inner points the arm stops."""
    lines: list[str] = []
    stops = [geometry.index for geometry in geometries[:-1] if geometry.blend_after is None]
    add_remark(lines, stops, 'the arm stops there, because there is no blend (blend_radius)')
    return lines


def blend_remarks(
    goal: Goal, geometries: Sequence[SegmentGeometry], timings: Sequence[SegmentTiming]
) -> list[str]:
    """Return by how much the end may be off its planned time, if the goal has blends."""
    if all(geometry.blend_after is None for geometry in geometries) or any(
        is_optimized(geometry.kind) for geometry in geometries
    ):
        return []
    planned = sum(timing.duration for timing in timings)
    off = max(
        planned - sum(timing.least_time for timing in timings),
        sum(timing.greatest_time for timing in timings) - planned,
    )
    clause = ''
    tolerance = goal.goal_time_tolerance or DEFAULT_GOAL_TIME_TOLERANCE
    if 0.0 <= tolerance < off and geometries[-1].time is not None:
        clause = f', more than goal_time_tolerance ({tolerance:g} s)'
    return [
        f'blends: the end may be up to {off:.3f} s off{clause}, because how the robot passes them '
        'is not published'
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


def _extent(geometry: SegmentGeometry) -> str:
    turn = degrees(geometry.curve.angle)
    return f'{geometry.curve.length:.3f} m' + (f' and {turn:.1f} degrees' if turn >= 0.05 else '')


def _duration(geometry: SegmentGeometry, timing: SegmentTiming) -> str:
    if is_optimized(geometry.kind):
        return 'a time that the controller chooses and that is not predicted'
    amount, unit = geometry.curve.angle, 'rad/s mean'
    if geometry.curve.length > 1e-6:
        amount, unit = geometry.curve.length, 'm/s mean'
    elif isinstance(geometry.curve, JointLineCurve):  # another posture of the same pose
        amount, unit = geometry.curve.joint_travel, 'rad/s mean of the leading joint'
    speed = f'{amount / max(timing.duration, 1e-9):.3f} {unit}'
    return f'{timing.duration:.3f} s ({speed})'
