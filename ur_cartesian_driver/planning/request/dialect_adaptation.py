# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Adapt a primitive to an older wire dialect, or refuse it.

A robot program silently skips motion types that it does not know and goes on to the next point
from where it is. So only what the dialect has is sent.
"""

from __future__ import annotations

from dataclasses import replace

from ur_cartesian_driver.motion.errors import NotAvailable
from ur_cartesian_driver.motion.geometry.pose import Pose
from ur_cartesian_driver.motion.geometry.vectors import Joints
from ur_cartesian_driver.motion.plan.primitive import (
    MoveC,
    MoveJ,
    OptimoveJ,
    OptimoveL,
    Primitive,
    Spline,
    Stop,
)
from ur_cartesian_driver.planning.options import PlanningOptions
from ur_cartesian_driver.planning.request.goal_fields import segment_field
from ur_cartesian_driver.protocol.program.point_fields import motion_type, MotionType


def adapt_to_dialect(
    primitive: Primitive, point: int, joints: Joints, options: PlanningOptions
) -> tuple[Primitive, str]:
    """
    Return a primitive as the dialect has it, and the reason for a change; '' if there is none.

    :param joints: the joint solution at its end [rad].
    :raises NotAvailable: the dialect cannot express it.
    """
    dialect, reason = options.dialect, ''
    if dialect.supports_q_near or isinstance(primitive, MoveC | Spline | Stop):
        pass
    elif isinstance(primitive, MoveJ | OptimoveJ) and isinstance(primitive.target, Pose):
        if not options.calibration_known:
            raise NotAvailable(
                segment_field(point, 'type'),
                f'is a joint motion ({type(primitive).__name__}), which wire dialect '
                f'{dialect.name} takes as joint positions only, but the calibration of this '
                'robot is unknown',
                'use LINEAR',
            )
        primitive = replace(primitive, target=joints, q_near=None)
        reason = f'wire dialect {dialect.name} has no q_near and takes the joint solution'
    else:
        primitive = replace(primitive, q_near=None)  # the robot ignores it
    if motion_type(primitive) not in dialect.motion_types:
        raise NotAvailable(
            segment_field(point, 'type'),
            f'needs {motion_type(primitive).name}, which robot '
            f'programs of wire dialect {dialect.name} do not support',
            'use LINEAR or JOINT'
            if isinstance(primitive, OptimoveJ | OptimoveL)
            else 'use a newer program and wire_dialect',
        )
    return primitive, reason


def explain_poses_only(options: PlanningOptions) -> str:
    """Return why arcs cannot be sent as joint positions ("because ..."); '' if they can."""
    if not options.calibration_known:
        return 'the calibration of this robot is unknown'
    if MotionType.MOVEC_JOINT not in options.dialect.motion_types:
        return f'wire dialect {options.dialect.name} has no arcs with joint positions'
    return ''
