# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
What a robot program of an older wire dialect can be told: the same motion in other words, or no.

A program skips motion types that it does not know, in silence, and goes on with the next point
from where it is. So nothing is sent that the dialect does not have.
"""

from __future__ import annotations

from dataclasses import replace

from ur_cartesian_driver.motion.errors import NotAvailable
from ur_cartesian_driver.motion.pose import Pose
from ur_cartesian_driver.motion.primitive import (
    Joints,
    MoveC,
    MoveJ,
    OptimoveJ,
    OptimoveL,
    Primitive,
    Spline,
)
from ur_cartesian_driver.planning.options import PlanningOptions
from ur_cartesian_driver.planning.request.goal_fields import segment_field
from ur_cartesian_driver.protocol.program.point_fields import motion_type, MotionType
from ur_cartesian_driver.protocol.program.wire_dialects import Dialect


def adapt_to_dialect(
    primitive: Primitive, point: int, joints: Joints, options: PlanningOptions
) -> tuple[Primitive, str]:
    """
    Return a primitive in the words of the dialect, and why they are others; '' where they are not.

    :param joints: the solution that it arrives in [rad].
    :raises NotAvailable: the dialect has no words for it.
    """
    dialect, why = options.dialect, ''
    if dialect.supports_q_near or isinstance(primitive, MoveC | Spline):
        pass
    elif isinstance(primitive, MoveJ | OptimoveJ) and isinstance(primitive.target, Pose):
        _check_calibration(primitive, point, options)
        primitive = replace(primitive, target=joints, q_near=None)
        why = f'wire dialect {dialect.name} has no q_near, so the joint solution itself is sent'
    else:
        primitive = replace(primitive, q_near=None)  # the robot would not look at it
    if motion_type(primitive) not in dialect.motion_types:
        raise NotAvailable(
            segment_field(point, 'type'),
            f'needs {motion_type(primitive).name}, which robot '
            f'programs of wire dialect {dialect.name} do not know',
            'use LINEAR or JOINT'
            if isinstance(primitive, OptimoveJ | OptimoveL)
            else 'use a newer program and wire_dialect',
        )
    return primitive, why


def _check_calibration(primitive: Primitive, point: int, options: PlanningOptions) -> None:
    if not options.calibration_known:
        raise NotAvailable(
            segment_field(point, 'type'),
            f'is a joint motion ({type(primitive).__name__}), for '
            f'which wire dialect {options.dialect.name} takes joint positions only, and the '
            'calibration of the robot, from which they follow, is not known',
            'use LINEAR',
        )


def explain_poses_only(options: PlanningOptions) -> str:
    """Return why arcs cannot be sent as joint positions, as the end of "because ..."; '' = can."""
    if not options.calibration_known:
        return 'the calibration of the robot is not known'
    if MotionType.MOVEC_JOINT not in options.dialect.motion_types:
        return f'wire dialect {options.dialect.name} has no arcs with joint positions'
    return ''


def adapt_blend_radius(radius: float, point: int, dialect: Dialect, remarks: list[str]) -> float:
    """Return a blend radius that the wire carries [m]."""
    whole = dialect.round_down_radius(radius)
    if whole < radius - 1e-6:
        remarks.append(
            f'point {point}: blend of {1e3 * whole:g} mm instead of '
            f'{1e3 * radius:g} mm, because wire dialect {dialect.name} counts in '
            f'{1e3 / dialect.time_scale:g} mm'
        )
    return whole
