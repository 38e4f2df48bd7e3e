# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
In which joint configuration the arm goes along, and arrives.

The robot is told poses; which of up to eight configurations it takes follows from where it comes
from. So the configuration is predicted segment by segment: along a straight line or an arc by
following the inverse kinematics in small steps, for a joint move by choosing the solution that is
then sent along as ``q_near``.
"""

from __future__ import annotations

from math import ceil, degrees, dist, pi, sin
from typing import TypeAlias

from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.kinematics.inverse import (
    nearest,
    nearest_in,
    solutions,
    why_unreachable,
)
from ur_cartesian_driver.kinematics.robots import JOINT_NAMES
from ur_cartesian_driver.motion.errors import (
    GoalRefused,
    JointLimitExceeded,
    NearSingularity,
    Unreachable,
)
from ur_cartesian_driver.motion.goal import Posture
from ur_cartesian_driver.motion.pose import Pose
from ur_cartesian_driver.motion.primitive import Joints
from ur_cartesian_driver.planning.path import Path

#: The named joints have to arrive this near to the chosen solution, turns included [rad].
ARRIVAL = 0.01
#: Longest steps along a path to begin with [m], [rad].
_FIRST_LENGTH = 0.02
_FIRST_ANGLE = 0.2
#: A step along a path is halved until no joint turns more than this in it [rad] ...
_STEP = 0.2
#: ... or it is this short [m], [rad]: a joint that still turns more than _JUMP jumps.
_LEAST_LENGTH = 0.0001
_LEAST_ANGLE = 0.05 * pi / 180.0
_JUMP = 0.5

#: Places on the way: the path's ``u`` and the joint positions there.
Trace: TypeAlias = list[tuple[float, Joints]]


class Reach:
    """
    One arm with one tool: the inverse kinematics of the TCP, with refusals that name the place.

    :param arm: the kinematics.
    :param T_flange_tcp: the active TCP.
    """

    def __init__(self, arm: Arm, T_flange_tcp: Pose) -> None:
        """Prepare the way from the TCP back to the flange."""
        self.arm = arm
        self.T_flange_tcp = T_flange_tcp
        self._T_tcp_flange = T_flange_tcp.inverse()

    def flange(self, T_base_tcp: Pose) -> Pose:
        """Return where the flange is when the TCP is there."""
        return T_base_tcp @ self._T_tcp_flange

    def nearest(self, T_base_tcp: Pose, q_near: Joints, place: str) -> Joints:
        """
        Return the solution nearest to a configuration.

        :param place: what the text of a refusal begins with, ``trajectory.points[2].pose``.
        :raises Unreachable: there is none.
        :raises JointLimitExceeded: each of them is outside the range of a joint.
        """
        q = nearest(self.arm, self.flange(T_base_tcp), q_near)
        if q is None:
            raise self._no_solution(T_base_tcp, place)
        return q

    def chosen(self, T_base_tcp: Pose, named: dict[int, float], q_before: Joints,
               place: str) -> Joints:
        """
        Return the solution that a posture means.

        Of all solutions those nearest in the named joints, of them the one nearest to the
        configuration before. Raises as :meth:`nearest`.
        """
        q = nearest_in(self.arm, self.flange(T_base_tcp), named, q_before)
        if q is None:
            raise self._no_solution(T_base_tcp, place)
        return q

    def follow(self, path: Path, q_start: Joints, place: str) -> Trace:
        """
        Return configurations along a straight line or an arc, the last one at its end.

        Steps are halved where the joints turn fast, so a short segment costs one inverse
        kinematics, and a difficult one as many as it needs.

        :raises Unreachable: the path leaves the reach.
        :raises JointLimitExceeded: a joint comes to the end of its range.
        :raises NearSingularity: a joint would have to turn at once.
        """
        trace: Trace = []
        u, q = 0.0, q_start
        least = _least_step(path)
        pieces = _pieces(path)
        # Piece by piece: a path to the moon has no end that could be listed.
        begun, ends = 0, list[float]()
        while ends or begun < pieces:
            if not ends:
                begun += 1
                ends.append(begun / pieces)
            end = ends[-1]
            where = place if end == 1.0 else f'{place}, {100.0 * end:.1f} % of the way to it,'
            pose = path.end if end == 1.0 else path.pose(end)
            q_next = self.nearest(pose, q, where)
            turn = max(abs(b - a) for a, b in zip(q, q_next, strict=True))
            if (turn > _STEP or _changes_branch(q, q_next)) and end - u > least:
                ends.append(0.5 * (u + end))
                continue
            if turn > _JUMP:
                raise self._jump(pose, q, q_next, where)
            u, q = end, q_next
            trace.append((u, q))
            ends.pop()
        return trace

    def _no_solution(self, T_base_tcp: Pose, place: str) -> GoalRefused:
        T_base_flange = self.flange(T_base_tcp)
        why = why_unreachable(self.arm, T_base_flange)
        if solutions(self.arm, T_base_flange):
            return JointLimitExceeded(f'{place} cannot be reached: {why}.')
        return Unreachable(f'{place} cannot be reached: {why}.')

    def _jump(self, T_base_tcp: Pose, q: Joints, q_next: Joints, place: str) -> GoalRefused:
        """Tell why the configuration cannot be continued: end of a range, or a singularity."""
        goes_on = self._continued(T_base_tcp, q)
        limits = self.arm.model.position_limits
        for k, (low, high) in enumerate(limits):
            if max(abs(b - a) for a, b in zip(q, goes_on, strict=True)) <= _JUMP and not (
                    low <= goes_on[k] <= high):
                return JointLimitExceeded(
                    f'{place} needs {JOINT_NAMES[k]} at {goes_on[k]:.3f} rad, outside its range '
                    f'of {low:.3f} to {high:.3f} rad; start with this joint turned back, or go '
                    'there with a JOINT segment.')
        joint = max(range(6), key=lambda k: abs(q_next[k] - q[k]))
        return NearSingularity(
            f'{place} lies behind a singularity: {JOINT_NAMES[joint]} would have to turn '
            f'by {degrees(abs(q_next[joint] - q[joint])):.0f} degrees at once; keep away from '
            'it, or use a JOINT segment.')

    def _continued(self, T_base_tcp: Pose, q: Joints) -> Joints:
        """Return the solution nearest to a configuration, the limits of the joints aside."""
        def around(found: Joints) -> Joints:
            a, b, c, d, e, f = (x + 2.0 * pi * round((y - x) / (2.0 * pi))
                                for x, y in zip(found, q, strict=True))
            return (a, b, c, d, e, f)
        every = (around(found) for found in solutions(self.arm, self.flange(T_base_tcp), q))
        return min(every, key=lambda found: dist(found, q))


def named_joints(posture: Posture, tf_prefix: str) -> dict[int, float]:
    """Return the values [rad] of a checked posture by joint number."""
    return {JOINT_NAMES.index(name.removeprefix(tf_prefix)): value
            for name, value in zip(posture.names, posture.values, strict=True)}


def full(named: dict[int, float]) -> Joints | None:
    """Return the configuration of a posture that names every joint, else None."""
    if len(named) < 6:
        return None
    return (named[0], named[1], named[2], named[3], named[4], named[5])


def missed(q: Joints, chosen: Joints, named: dict[int, float]) -> str:
    """
    Return the clause that says which named joint does not arrive, empty if all do.

    :param q: where the motion arrives.
    :param chosen: the solution that the posture means.
    """
    for k in sorted(named):
        if abs(q[k] - chosen[k]) > ARRIVAL:
            return (f'{JOINT_NAMES[k]} arrives at {q[k]:.3f} rad, and the solution for the '
                    f'posture has it at {chosen[k]:.3f} rad')
    return ''


def _changes_branch(q: Joints, q_next: Joints) -> bool:
    """
    Tell whether elbow or wrist 2 change sides.

    Beside a singularity the other branch is the nearer one after a long step, while the arm that
    goes there in small steps swings round and stays on its own.
    """
    return sin(q[2]) * sin(q_next[2]) < 0.0 or sin(q[4]) * sin(q_next[4]) < 0.0


def _pieces(path: Path) -> int:
    """Return the number of steps to begin with, so that nothing is stepped over."""
    return max(1, ceil(path.length / _FIRST_LENGTH), ceil(path.angle / _FIRST_ANGLE))


def _least_step(path: Path) -> float:
    """Return the shortest step in ``u``."""
    least = 1.0
    if path.length > 0.0:
        least = min(least, _LEAST_LENGTH / path.length)
    if path.angle > 0.0:
        least = min(least, _LEAST_ANGLE / path.angle)
    return least
