# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The checks of a joint goal that need no robot.

Refusals name fields as control_msgs/FollowJointTrajectory does.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ur_cartesian_driver.kinematics.robot_models import JOINT_NAMES, MAX_JOINT_VALUE
from ur_cartesian_driver.motion.errors import InvalidGoal, InvalidJoints, NotAvailable
from ur_cartesian_driver.motion.geometry.arrays import Floats
from ur_cartesian_driver.motion.geometry.polynomials import MotionRows
from ur_cartesian_driver.motion.geometry.vectors import vector6
from ur_cartesian_driver.motion.goal.declared_types import with_declared_types, WrongType
from ur_cartesian_driver.motion.goal.joint_goal import (
    JointErrorBounds,
    JointGoal,
    JointPoint,
    JointTolerance,
    JointTolerances,
)
from ur_cartesian_driver.motion.plan.joint_spline import SAME_TIME
from ur_cartesian_driver.planning.options import PlanningOptions
from ur_cartesian_driver.planning.request.field_rules import check_finite
from ur_cartesian_driver.planning.request.goal_fields import (
    check_plausible,
    late_point_error,
    long_segment_error,
    point_field,
    short_segment_error,
)
from ur_cartesian_driver.planning.request.program_features import check_joint_spline
from ur_cartesian_driver.planning.request.spline_rules import (
    MAX_ACCELERATION,
    MAX_TWIST,
    MIN_SPLINE_TIME,
)
from ur_cartesian_driver.planning.request.validate import (
    check_joint_name,
    check_list_lengths,
    check_stamp,
)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class CheckedJointGoal:
    """A checked joint goal as rows, with the joints in the order of the arm."""

    #: (n,) times of the points [s], increasing.
    times: Floats
    #: Positions [rad], velocities [rad/s] and accelerations [rad/s^2], each (n, 6); NaN where the
    #: goal gives none.
    joints: MotionRows
    tolerances: JointTolerances
    goal_time_tolerance: float


def check_joint_goal(goal: JointGoal, options: PlanningOptions) -> CheckedJointGoal:
    """
    Refuse a joint goal that is wrong for every robot; otherwise return it as rows.

    :raises GoalRefused: the goal is wrong; the text names point, field, value and bound.
    """
    try:
        goal = with_declared_types(goal, JointGoal, 'JointGoal')
    except WrongType as error:
        raise InvalidGoal(error.field, error.problem) from None
    check_stamp(goal.age, options)
    check_finite('goal_time_tolerance', (goal.goal_time_tolerance,))
    order = _order(goal.joint_names, options.tf_prefix)
    check_list_lengths(
        'trajectory.points',
        len(goal.points),
        0,
        options,
        if_empty='give at least one point',
        if_too_many='split the goal or raise the parameter',
    )
    if not options.calibration_known:
        raise NotAvailable(
            'trajectory',
            'has joint positions, but the calibration of this robot is unknown',
            'send poses with FollowCartesianTrajectory',
        )
    check_joint_spline(options)
    times = [point.time for point in goal.points]
    for i, point in enumerate(goal.points):
        _check_point(i, point, len(order))
        _check_time(i, times, options)
    if times[-1] == 0.0:
        raise InvalidGoal(
            point_field(len(goal.points) - 1, 'time_from_start'),
            'is 0, so there is no time to move',
            'give it a time greater than 0',
        )
    last = goal.points[-1]
    if any(last.velocities):
        raise InvalidGoal(
            point_field(len(goal.points) - 1, 'velocities'),
            'are not zero, but the motion ends at rest there',
            'set them to 0',
        )
    q, qd, qdd = (
        np.array([list(row) or [np.nan] * 6 for row in rows], dtype=np.float64)[:, order]
        for rows in zip(
            *((p.positions, p.velocities, p.accelerations) for p in goal.points), strict=True
        )
    )
    return CheckedJointGoal(
        times=np.array(times),
        joints=MotionRows(q, qd, qdd),
        tolerances=JointTolerances(
            path=_bounds('path_tolerance', goal.path_tolerance, options.tf_prefix),
            goal=_bounds('goal_tolerance', goal.goal_tolerance, options.tf_prefix),
            end=vector6(q[-1].tolist()),
        ),
        goal_time_tolerance=goal.goal_time_tolerance,
    )


def _order(names: Sequence[str], tf_prefix: str) -> list[int]:
    """Return, for each joint of the arm, its index in the goal."""
    for k, name in enumerate(names):
        check_joint_name(f'trajectory.joint_names[{k}]', name, names[:k], tf_prefix)
    known = [tf_prefix + name for name in JOINT_NAMES]
    if missing := [name for name in known if name not in names]:
        raise InvalidJoints(
            f'trajectory.joint_names lacks {", ".join(missing)}; name all six joints.'
        )
    return [names.index(name) for name in known]


def _check_point(index: int, point: JointPoint, joints: int) -> None:
    if not point.positions:
        raise InvalidGoal(point_field(index, 'positions'), 'are empty', 'give one for each joint')
    for field, values, bound in (
        ('positions', point.positions, MAX_JOINT_VALUE),
        ('velocities', point.velocities, MAX_TWIST),
        ('accelerations', point.accelerations, MAX_ACCELERATION),
    ):
        where = point_field(index, field)
        if len(values) not in (0, joints):
            raise InvalidGoal(
                where, f'has {len(values)} values for {joints} joints', 'give one for each joint'
            )
        check_finite(where, values)
        check_plausible(where, values, bound, 'rad, s')
    if point.accelerations and not point.velocities:
        raise InvalidGoal(
            point_field(index, 'velocities'),
            'are empty, but there are accelerations',
            'give both, or leave out the accelerations',
        )
    if point.effort:
        raise InvalidGoal(
            point_field(index, 'effort'), 'is given, but robots take none', 'leave it empty'
        )


def _check_time(index: int, times: Sequence[float], options: PlanningOptions) -> None:
    time, before = times[index], times[index - 1] if index > 0 else 0.0
    check_finite(point_field(index, 'time_from_start'), (time,))
    if time < 0.0 or (index > 0 and time <= before):
        raise late_point_error(index, times)
    if time > 0.0 and time - before < MIN_SPLINE_TIME - SAME_TIME:
        raise short_segment_error(index, time - before, MIN_SPLINE_TIME)
    if time - before > options.max_segment_time:
        raise long_segment_error(index, time - before, options.max_segment_time)


def _bounds(field: str, entries: Sequence[JointTolerance], tf_prefix: str) -> JointErrorBounds:
    """Return the tolerances of all joints; joints that are not named have no limits."""
    names = [entry.name for entry in entries]
    for k, entry in enumerate(entries):
        check_joint_name(f'{field}[{k}].name', entry.name, names[:k], tf_prefix)
        for name in ('position', 'velocity', 'acceleration'):
            check_finite(f'{field}[{k}].{name}', (getattr(entry, name),))
        if entry.acceleration > 0.0:
            raise InvalidGoal(
                f'{field}[{k}].acceleration',
                f'is {entry.acceleration:g}, but robots do not report the accelerations of their '
                'joints',
                'set it to 0',
            )
    by_name = dict(zip(names, entries, strict=True))
    none = JointTolerance(name='')
    found = [by_name.get(tf_prefix + name, none) for name in JOINT_NAMES]
    return JointErrorBounds(
        position=vector6(each.position for each in found),
        velocity=vector6(each.velocity for each in found),
    )
