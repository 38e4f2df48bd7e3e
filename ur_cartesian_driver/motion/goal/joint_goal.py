# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
A goal in joint space as the client sent it: the content of control_msgs/FollowJointTrajectory.

A joint goal may be wrong: ``planning.request.joint_goal_rules`` checks it.
"""

from __future__ import annotations

from dataclasses import dataclass

from ur_cartesian_driver.motion.geometry.vectors import Vector6, ZERO6


@dataclass(frozen=True, slots=True, kw_only=True)
class JointPoint:
    """The joints at one time, in the order of the goal's ``joint_names``."""

    #: When to reach the point, from the start of the motion [s].
    time: float
    #: [rad]
    positions: tuple[float, ...]
    #: [rad/s]; empty = the driver chooses them.
    velocities: tuple[float, ...] = ()
    #: [rad/s^2]; empty = cubic polynomials, which need none.
    accelerations: tuple[float, ...] = ()
    #: [Nm]; has to be empty.
    effort: tuple[float, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class JointTolerance:
    """Largest allowed deviations of one joint; 0 or negative = no limit."""

    name: str
    #: [rad]
    position: float = 0.0
    #: [rad/s]
    velocity: float = 0.0
    #: [rad/s^2]; has to be 0 or negative, because robots do not report joint accelerations.
    acceleration: float = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class JointGoal:
    """A joint trajectory with its tolerances."""

    #: All six joints, in any order, with the ``tf_prefix`` of the driver.
    joint_names: tuple[str, ...]
    points: tuple[JointPoint, ...]
    #: Age of the goal's stamp on receipt [s]; None = no stamp.
    age: float | None = None
    path_tolerance: tuple[JointTolerance, ...] = ()
    goal_tolerance: tuple[JointTolerance, ...] = ()
    #: How much later than planned the goal may end [s]: 0 = the default, negative = any time.
    goal_time_tolerance: float = 0.0
    #: Whether the goal ends, with success, where the tool touches something on its way.
    until_contact: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class JointErrorBounds:
    """Largest allowed deviations of the six joints; 0 or negative = no limit."""

    #: [rad]
    position: Vector6 = ZERO6
    #: [rad/s]
    velocity: Vector6 = ZERO6

    def __bool__(self) -> bool:
        """Return whether there is any limit."""
        return max(*self.position, *self.velocity) > 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class JointTolerances:
    """The tolerances of a joint goal that passed its checks."""

    path: JointErrorBounds = JointErrorBounds()
    goal: JointErrorBounds = JointErrorBounds()
    #: Joint positions at the last point of the goal [rad].
    end: Vector6
