# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""What a plan says to people: a line for each segment, and what was ignored or changed."""

from __future__ import annotations

from collections.abc import Sequence
from math import degrees

from ur_cartesian_driver.motion.goal import Goal, SegmentType
from ur_cartesian_driver.motion.pose import Pose
from ur_cartesian_driver.motion.primitive import MoveC, MoveJ, OptimoveJ, Primitive
from ur_cartesian_driver.planning.geometry.curves import JointLineCurve
from ur_cartesian_driver.planning.moves.segment_geometry import SegmentGeometry, SegmentTiming
from ur_cartesian_driver.planning.request.goal_fields import is_optimized, is_timed, segment_of

#: How many points a remark lists before it counts the rest.
_MAX_LISTED = 5


def segment_note(
    geometry: SegmentGeometry, timing: SegmentTiming, primitive: Primitive, why: Sequence[str]
) -> str:
    """
    Return the line of one segment.

    :param why: reasons for the choice of the primitive, before the reason for its speed.
    """
    asked = SegmentType(geometry.segment.type).name
    parts = [
        f'point {geometry.index}: {asked} -> {_name(primitive)} '
        f'{_extent(geometry)} in {_duration(geometry, timing)}'
    ]
    if geometry.blend_after is not None:
        parts.append(f'blend {1e3 * geometry.blend_after.radius:g} mm')
    parts.append('because ' + ' and '.join([*why, timing.reason]))
    return f'{", ".join(parts)}; nearest: {geometry.tightest_margin}'


def tightest_remark(geometries: Sequence[SegmentGeometry]) -> str:
    """Return the remark about what comes nearest to its bound in the whole goal."""
    geometry = min(geometries, key=lambda geometry: geometry.tightest_margin.normalized)
    return f'nearest of all: {geometry.tightest_margin} of the way to point {geometry.index}'


def ignored_remarks(goal: Goal, first: int = 0) -> list[str]:
    """Return a remark for all that has no effect in a checked goal; points count from first."""
    remarks: list[str] = []
    timed = is_timed(goal)
    points = list(enumerate(goal.waypoints, first))
    if timed:
        add_remark(
            remarks,
            [i for i, p in points if any(p.twist)],
            'twist is ignored: UR motion commands stop or blend at a point',
        )
    else:
        add_remark(
            remarks,
            [i for i, p in points if any(p.twist) and not _takes_twist(goal, i - first)],
            'twist is ignored: the segment has a velocity of its own, or no speed of the tool',
        )
    add_remark(
        remarks,
        [i for i, p in points if any(p.acceleration)],
        'acceleration is ignored: UR motion commands cannot meet it',
    )
    add_remark(
        remarks, [i for i, p in points if any(p.jerk)], 'jerk is ignored: no robot motion takes it'
    )
    if timed:
        add_remark(
            remarks,
            [
                i
                for i, s in enumerate(goal.segments, first)
                if s.acceleration > 0.0
                and s.type in (SegmentType.AUTO, SegmentType.LINEAR, SegmentType.JOINT)
            ],
            'the acceleration of the segment is ignored: its time counts',
        )
    if goal.segments and goal.segments[-1].blend_radius > 0.0 and not goal.keep_open:
        remarks.append(
            f'point {points[-1][0]}: the blend is ignored: the last point is never blended'
        )
    return remarks


def _takes_twist(goal: Goal, index: int) -> bool:
    segment = segment_of(goal, index)
    return (
        segment.velocity == 0.0
        and segment.type != SegmentType.JOINT
        and not is_optimized(segment.type)
    )


def add_remark(remarks: list[str], points: list[int], what: str) -> None:
    """Add the remark about some points, none if there are no such points."""
    if not points:
        return
    listed = ', '.join(str(i) for i in points[:_MAX_LISTED])
    more = f' and {len(points) - _MAX_LISTED} more' if len(points) > _MAX_LISTED else ''
    word = 'point' if len(points) == 1 else 'points'
    remarks.append(f'{word} {listed}{more}: {what}')


def _name(primitive: Primitive) -> str:
    """Return the robot's name of the motion, with the kinds of its targets."""
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
    about = 'about ' if is_optimized(geometry.kind) else ''
    if geometry.curve.length > 1e-6:
        speed = f'{geometry.curve.length / max(timing.duration, 1e-9):.3f} m/s on average'
    elif isinstance(geometry.curve, JointLineCurve):  # another posture of the same pose
        speed = (
            f'{max(geometry.curve.travel) / max(timing.duration, 1e-9):.3f} rad/s of the leading '
            'joint on average'
        )
    else:
        speed = f'{geometry.curve.angle / max(timing.duration, 1e-9):.3f} rad/s on average'
    return f'{about}{timing.duration:.3f} s ({speed})'
