# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Rules about goals whose frame is on a part that the arm holds.

Splines lead the part along any path. The controller's lines and arcs are paths of the TCP in base.
They are lines and arcs of the tool on the part only if the part does not turn, because then all
points of the part move alike, and the tool moves on the part in the opposite direction.
"""

from __future__ import annotations

from math import degrees
import re

import numpy as np

from ur_cartesian_driver.motion.errors import GoalRefused, NotAvailable
from ur_cartesian_driver.motion.geometry.arrays import Floats
from ur_cartesian_driver.motion.geometry.pose import Pose
from ur_cartesian_driver.motion.geometry.pose_rows import angle_rows
from ur_cartesian_driver.motion.goal.goal import ArcMode, FreeAxis, SegmentType
from ur_cartesian_driver.motion.goal.goal_columns import GoalTable, rows_where
from ur_cartesian_driver.planning.options import PlanningOptions
from ur_cartesian_driver.planning.request.goal_fields import (
    IS_JOINT_MOVE,
    point_field,
    resolve_execution_mode,
    segment_field,
)

#: Turns of the part up to this angle [rad] on a line or an arc are neglected: on the part, the
#: tool leaves a line of length L by L angle / 4, which is 25 um for a metre.
MAX_TURN = 1e-4
# Turns of the part up to this angle [rad] are neglected by outputs that follow the motion of the
# TCP in base: if the tool touches the part 0.3 m from the TCP, the motions of both differ by 0.6
# mm in total. The measured orientation at the start deviates by less than this angle.
_NEGLECTED_TURN = 2e-3
_JOINT_ADVICE = re.compile(
    r'use (PRIMITIVES with )?a JOINT segment(, or set on_posture_change to movej)?'
)
_SPLINES = 'set execution to SPLINE or SERVO, with times or a corner_deviation'


def check_held_part(goal: GoalTable, options: PlanningOptions) -> None:
    """
    Refuse motions of a held part that the controller's moves cannot execute.

    :raises NotAvailable: a goal of PRIMITIVES has joint motions, arcs that turn the part, travels,
        or offsets.
    """
    if goal.moving_frame is None or resolve_execution_mode(goal).traits.is_spline:
        return
    segments = goal.motions
    turns = IS_JOINT_MOVE[segments.types] | (segments.arc_modes == ArcMode.FIXED)
    for i in rows_where(turns)[:1]:
        kind = SegmentType(segments.types[i]).name
        field, value = (
            ('type', kind) if IS_JOINT_MOVE[segments.types[i]] else ('arc_mode', 'FIXED')
        )
        raise NotAvailable(
            segment_field(i, field),
            f'is {value}, which turns the part that the arm holds, and the moves of the '
            'controller, which PRIMITIVES sends, lead a part only without turning it',
            f'use LINEAR, PROCESS or an UNCONSTRAINED arc, or {_SPLINES}',
        )
    if goal.allow_travel:
        raise NotAvailable(
            'allow_travel',
            'is set, but the path is on a part that the arm holds, and a travel turns it',
            'lead there by a goal of its own',
        )
    if goal.path_offset:
        raise NotAvailable(
            'path_offset',
            'is set, but the path is on a part that the arm holds, and the controller, which '
            'offsets PRIMITIVES, knows nothing of the frame on the part',
            'set execution to SERVO, with times or a corner_deviation',
        )


def with_advice_for_part(refusal: GoalRefused, goal: GoalTable) -> GoalRefused:
    """Return a refusal with advice for held parts in place of advice to use JOINT segments."""
    advice = 'let the tool turn about an axis of its own (free_axis)'
    if (goal.segments.free_axes != FreeAxis.NONE).any():
        advice = 'move the part or the tool'
    elif not resolve_execution_mode(goal).traits.is_spline:
        advice = f'{advice}, and {_SPLINES}'
    text = _JOINT_ADVICE.sub(advice, str(refusal))
    return refusal if text == str(refusal) else refusal.reworded(text)


def check_part_keeps_orientation(
    goal: GoalTable, targets: Floats, start: Pose, first: int
) -> None:
    """
    Refuse a goal of PRIMITIVES that turns the held part.

    :param targets: the poses of all points in the frame on the part (n, 7).
    :param start: pose of the tool in this frame at the start.
    :param first: the first point to which a motion leads; the arm is already at the point before.
    :raises NotAvailable: a segment turns the part.
    """
    targets = targets[first:]
    before = np.concatenate([[start.row()], targets[:-1]])
    angles = angle_rows(before[:, 3:], targets[:, 3:])
    for k in rows_where(angles > MAX_TURN)[:1]:
        i = first + k
        whence = f'points[{i - 1}]' if k else 'where the arm stands'
        least = 'keep the orientation' if k else 'bring the arm there by a goal of its own'
        presses = ', and only these give way to presses' if goal.presses else ''
        raise NotAvailable(
            point_field(i, 'pose.orientation'),
            f'turns the part that the arm holds by {degrees(angles[k]):.3g} degrees from '
            f'{whence}, but the moves of the controller, which PRIMITIVES sends, are straight in '
            f'base, and curves on a part that turns{presses}',
            least if goal.presses else f'{least}, or {_SPLINES}',
        )


def check_part_outputs(goal: GoalTable, poses: Floats) -> None:
    """
    Refuse outputs that depend on the distance or the speed of the tool on a part that turns.

    The robot program measures distance and speed of the TCP in base. If the part turns, they
    differ from the tool's distance and speed on the part.

    :param poses: the path of the tool as poses in the frame on the part (n, 7).
    :raises NotAvailable: there are such outputs, and the part turns.
    """
    fields = [name for name in ('proportional_outputs', 'pulses') if getattr(goal, name)]
    if not fields or (angle_rows(poses[:1, 3:], poses[:, 3:]) <= _NEGLECTED_TURN).all():
        return
    raise NotAvailable(
        f'{fields[0]}[0]',
        'follows the motion of the TCP in base, which is not that of the tool on a part that '
        'turns',
        'lead the part without turning it, or switch outputs at places (io_commands)',
    )
