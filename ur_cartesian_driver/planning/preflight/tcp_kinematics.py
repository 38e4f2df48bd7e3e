# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Kinematics of an arm with a tool, with errors that explain why the arm cannot reach a pose.

The robot receives poses. Its previous configuration decides in which of up to eight configurations
it arrives. So configurations are predicted segment by segment: along a line or an arc by following
the inverse kinematics (:mod:`~.joint_path_solver`), for a joint move by choosing the solution that
is sent as ``q_near``.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from math import degrees, dist, hypot, pi

import numpy as np

from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.kinematics.closed_form_rows import BRANCHES
from ur_cartesian_driver.kinematics.differential_kinematics import (
    joint_rates,
    largest_joint_rates,
    tool_rates,
)
from ur_cartesian_driver.kinematics.inverse import (
    explain_unreachable,
    format_distinct,
    nearest,
    nearest_to_posture,
    solutions,
)
from ur_cartesian_driver.kinematics.inverse_rows import branch_measures
from ur_cartesian_driver.kinematics.robot_models import JOINT_NAMES
from ur_cartesian_driver.motion.errors import (
    GoalRefused,
    JointLimitExceeded,
    NearSingularity,
    Unreachable,
)
from ur_cartesian_driver.motion.geometry.arrays import Floats
from ur_cartesian_driver.motion.geometry.pose import Pose
from ur_cartesian_driver.motion.geometry.pose_rows import compose_rows
from ur_cartesian_driver.motion.geometry.vectors import Joints, vector6
from ur_cartesian_driver.motion.goal.goal import Posture
from ur_cartesian_driver.planning.geometry.curves import tcp_rows
from ur_cartesian_driver.planning.request.goal_fields import point_field
from ur_cartesian_driver.planning.request.joint_points import named_joints

#: An arm arrives in a posture if each named joint is at most this far from the solution that the
#: posture selects [rad]. A joint that is a full turn away has not arrived.
ARRIVAL_TOLERANCE = 0.01
#: A solution continues a configuration if no joint turns farther than this [rad].
_MAX_CONTINUED_STEP = 0.5
#: Configurations that are nearer to each other than this [rad] are the same.
_ROUNDING = 1e-6
# Scale of the shoulder measure [m], to compare it with the other measures, which are sines.
_ARM_LENGTH = 0.3


class TcpKinematics:
    """
    The kinematics of the tool of one arm, with errors that name the point.

    Planners use poses and rates of the tool in the frame of the path; this class converts them to
    poses of the flange and rates of the joints, and back. In this class the frame of the path is
    the robot's base, and the tool is the TCP. A subclass for paths on a part that the arm holds
    overrides all methods up to :attr:`reach`.

    :param arm: nominal or calibrated.
    :param T_flange_tcp: the active TCP.
    """

    #: Whether the frame of the path moves, so that the TCP and the tool have different speeds.
    frame_moves = False

    def __init__(self, arm: Arm, T_flange_tcp: Pose) -> None:
        """Prepare the transform from the TCP to the flange."""
        self.arm = arm
        self.T_flange_tcp = T_flange_tcp
        self._T_tcp_flange = T_flange_tcp.inverse()

    def flange(self, T_base_tcp: Pose) -> Pose:
        """Return the flange pose in base for a pose of the tool."""
        return T_base_tcp @ self._T_tcp_flange

    def flange_rows(self, poses: Floats) -> Floats:
        """Return the flange poses in base (n, 7) for poses of the tool (n, 7)."""
        return compose_rows(poses, self._T_tcp_flange)

    def tcp(self, T_base_tcp: Pose) -> Pose:
        """Return the pose of the TCP in base for a pose of the tool."""
        return T_base_tcp

    def tcp_poses(self, poses: Floats) -> Floats:
        """Return the poses of the TCP in base (n, 7) for poses of the tool (n, 7)."""
        return poses

    @property
    def of_tcp(self) -> TcpKinematics:
        """The kinematics for poses of the TCP in base, which are the poses the robot receives."""
        return self

    def pose_rows(self, q: Floats) -> Floats:
        """Return the poses of the tool (n, 7) at joint positions (n, 6) [rad]."""
        return tcp_rows(self.arm, self.T_flange_tcp, q)

    def tool_rates(self, q: Floats, qd: Floats, qdd: Floats) -> tuple[Floats, Floats]:
        """Return twist and acceleration (n, 6) of the tool, see :func:`~.tool_rates`."""
        return tool_rates(self.arm, self.T_flange_tcp, q, qd, qdd)

    def joint_rates(self, q: Floats, twist: Floats, acceleration: Floats) -> tuple[Floats, Floats]:
        """Return joint velocities and accelerations (n, 6), see :func:`~.joint_rates`."""
        return joint_rates(self.arm, self.T_flange_tcp, q, twist, acceleration)

    def largest_joint_rates(
        self, q: Floats, rates: tuple[float, float], accelerations: tuple[float, float]
    ) -> tuple[Floats, Floats]:
        """Return bounds of joint rates (n, 6), see :func:`~.largest_joint_rates`."""
        return largest_joint_rates(self.arm, self.T_flange_tcp, q, rates, accelerations)

    def carrier_speeds(self, q: Floats, qd: Floats) -> Floats | None:
        """Return the speeds of the TCP in base (n,) [m/s]; None = the same as the tool's."""
        return None

    @property
    def reach(self) -> float:
        """Upper bound of the distance of the tool from the origin of the frame of the path [m]."""
        return self.arm.model.max_reach + hypot(*self.T_flange_tcp.position)

    def solution(self, T_base_tcp: Pose, q_near: Joints) -> Joints | None:
        """Return the solution nearest to ``q_near``; None if none is within the joint limits."""
        return nearest(self.arm, self.flange(T_base_tcp), q_near)

    def nearest(self, T_base_tcp: Pose, q_near: Joints, where: str) -> Joints:
        """
        Return the solution nearest to ``q_near``.

        :param where: the name of the pose in error messages (``trajectory.points[2].pose``).
        :raises Unreachable: there is no solution.
        :raises JointLimitExceeded: each solution is outside the range of a joint.
        """
        q = self.solution(T_base_tcp, q_near)
        if q is None:
            raise self.no_solution_error(T_base_tcp, where)
        return q

    def solve_posture(
        self, T_base_tcp: Pose, named: dict[int, float], q_before: Joints, where: str
    ) -> Joints:
        """
        Return the solution that a posture selects.

        This is the solution nearest in the named joints; of several that are equally near, the one
        nearest to ``q_before``. Errors as for :meth:`nearest`.

        :param named: the values [rad] of the posture by joint number.
        """
        # An arm that is already within the tolerance keeps its configuration.
        if hypot(*(q_before[k] - value for k, value in named.items())) <= ARRIVAL_TOLERANCE:
            here = self.solution(T_base_tcp, q_before)
            if here is not None and dist(here, q_before) < _ROUNDING:
                return here
        q = nearest_to_posture(self.arm, self.flange(T_base_tcp), named, q_before)
        if q is None:
            raise self.no_solution_error(T_base_tcp, where)
        return q

    def no_solution_error(self, T_base_tcp: Pose, where: str, there: str = '') -> GoalRefused:
        """
        Return the error for a pose that has no solution in reach and within the joint limits.

        :param where: the name of the pose, at the beginning of the error message.
        :param there: a phrase before the reason, which names the pose if ``where`` does not.
        """
        T_base_flange = self.flange(T_base_tcp)
        reason = there + explain_unreachable(self.arm, T_base_flange)
        if solutions(self.arm, T_base_flange):
            return JointLimitExceeded(
                f'{where} cannot be reached: {reason}; turn the tool differently.'
            )
        return Unreachable(
            f'{where} cannot be reached: {reason}; check the frame and the TCP, or '
            'move the point or the robot.'
        )

    def discontinuity_error(
        self,
        T_base_tcp: Pose,
        q: Joints,
        q_next: Joints,
        where: str,
        poses_beyond: Iterable[Pose] = (),
    ) -> GoalRefused:
        """
        Return the error for a path that the arm cannot continue.

        It is a JointLimitExceeded if the arm could continue without the limit of a joint,
        otherwise a NearSingularity.

        :param T_base_tcp: the first pose that the arm does not reach.
        :param q: the last configuration before it [rad].
        :param q_next: the solution at the pose, to which the arm would have to jump [rad].
        :param poses_beyond: the poses of the path from ``T_base_tcp`` on, in small steps.
        """
        goes_on = self._continue_branch(T_base_tcp, q)
        for k, (low, high) in enumerate(self.arm.model.position_limits):
            if goes_on is not None and not low <= goes_on[k] <= high:
                side = 1.0 if goes_on[k] > high else -1.0
                far = side * max(
                    side * at for at in self._joint_positions_beyond(k, goes_on, poses_beyond)
                )
                value, _ = format_distinct(far, high if side > 0.0 else low)
                return JointLimitExceeded(
                    f'{where} moves {JOINT_NAMES[k]} to {value} rad, outside its range of '
                    f'{self.arm.model.range_text(k)}; start with this joint turned back, or use a '
                    'JOINT segment.'
                )
        joint = max(range(6), key=lambda k: abs(q_next[k] - q[k]))
        return NearSingularity(
            f'{where} lies behind the {self.nearest_singularity(q)} singularity: '
            f'{JOINT_NAMES[joint]} would have to jump by '
            f'{degrees(abs(q_next[joint] - q[joint])):.0f} degrees; keep away from it, or use a '
            'JOINT segment.'
        )

    def nearest_singularity(self, q: Joints) -> str:
        """Return the name of the nearest singularity: wrist, elbow or shoulder."""
        measures = branch_measures(self.arm, np.array([q]))
        distances = {
            'wrist': abs(float(measures.wrist[0])),
            'elbow': abs(float(measures.elbow[0])),
            'shoulder': abs(float(measures.shoulder[0])) / _ARM_LENGTH,
        }
        return min(distances, key=lambda name: distances[name])

    def describe_flips(self, q: Joints, q_other: Joints) -> str:
        """Return a phrase for the joints (shoulder, elbow, wrist) that flip; '' if none does."""
        first, second = branch_measures(self.arm, np.array([q, q_other])).branch
        flipped = [
            f'a flip of the {name}'
            for name, x, y in zip(
                ('shoulder', 'elbow', 'wrist'), BRANCHES[first], BRANCHES[second], strict=True
            )
            if x != y
        ]
        return ' and '.join(flipped)

    def compare_posture(
        self, T_base_tcp: Pose, posture: Posture, q: Joints, where: str, tf_prefix: str
    ) -> tuple[Joints, str]:
        """
        Return the solution that a posture selects, and a clause on how ``q`` misses it.

        The clause is '' if ``q`` is that solution. Errors as for :meth:`nearest`.
        """
        named = named_joints(posture, tf_prefix)
        chosen = self.solve_posture(T_base_tcp, named, q, where)
        return chosen, describe_miss(q, chosen, named)

    def explain_missed_posture(
        self, T_base_tcp: Pose, posture: Posture, q: Joints, index: int, tf_prefix: str
    ) -> str:
        """
        Return a clause on how a path misses the posture of a point; '' if it does not.

        Errors as for :meth:`nearest`.

        :param q: the configuration in which the path arrives [rad].
        """
        where = point_field(index, 'pose')
        chosen, clause = self.compare_posture(T_base_tcp, posture, q, where, tf_prefix)
        flips = self.describe_flips(q, chosen) if clause else ''
        return f'{clause}, which needs {flips}' if flips else clause

    def _joint_positions_beyond(
        self, k: int, q: Joints, poses_beyond: Iterable[Pose]
    ) -> Iterator[float]:
        """Yield the positions of joint ``k`` [rad] at ``q`` and at the poses that continue it."""
        yield q[k]
        for pose in poses_beyond:
            goes_on = self._continue_branch(pose, q)
            if goes_on is None:
                return
            q = goes_on
            yield q[k]

    def _continue_branch(self, T_base_tcp: Pose, q: Joints) -> Joints | None:
        """Return the solution that continues ``q``, ignoring joint limits; None if none does."""

        def around(found: Joints) -> Joints:
            return vector6(
                x + 2.0 * pi * round((y - x) / (2.0 * pi)) for x, y in zip(found, q, strict=True)
            )

        every = (around(found) for found in solutions(self.arm, self.flange(T_base_tcp), q))
        found = min(every, key=lambda found: dist(found, q), default=None)
        if found is None or max_joint_change(q, found) > _MAX_CONTINUED_STEP:
            return None
        return found


def max_joint_change(a: Joints, b: Joints) -> float:
    """Return the largest change of a joint between two configurations [rad]."""
    return max(abs(y - x) for x, y in zip(a, b, strict=True))


def describe_miss(q: Joints, chosen: Joints, named: dict[int, float]) -> str:
    """
    Return a clause about the first named joint that misses ``chosen``; '' if none does.

    :param q: the configuration in which the motion arrives [rad].
    :param chosen: the solution that the posture selects [rad].
    :param named: the joints that the posture names, by number.
    """
    for k in sorted(named):
        if abs(q[k] - chosen[k]) > ARRIVAL_TOLERANCE:
            return f'{JOINT_NAMES[k]} arrives at {q[k]:.3f} rad instead of {chosen[k]:.3f} rad'
    return ''
