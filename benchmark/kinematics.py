# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Forward and inverse kinematics per pose, compared with pinocchio's iteration."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
import random
from typing import Any

from figures import Figure, seconds
import numpy as np
from numpy.typing import NDArray

from ur_cartesian_driver.kinematics.chain import Arm, pinocchio_model
from ur_cartesian_driver.kinematics.inverse import nearest, solutions
from ur_cartesian_driver.kinematics.robot_models import robot_model
from ur_cartesian_driver.motion.geometry.pose import Pose
from ur_cartesian_driver.motion.geometry.vectors import Vector6

#: Distance of each seed from the solution, in each joint [rad].
OFF = 0.1
#: Parameters of pinocchio's iteration: accepted error [m, rad], damping, number of steps.
ACCEPTED, DAMPING, STEPS = 1e-8, 1e-12, 100
NAME = 'kinematics, per pose'


def run(quick: bool) -> Iterator[Figure]:
    """Measure on random poses of a UR5e."""
    arm = Arm(robot_model('ur5e'))
    draw = random.Random(1)
    joints = [_drawn(draw, 2.5) for _ in range(100 if quick else 500)]
    seeds = [_moved(q, draw) for q in joints]
    poses = [arm.forward(q) for q in joints]
    reference = pinocchio_or_none(arm)

    yield _figure('forward', joints, arm.forward, reference.forward if reference else None)
    yield _figure('inverse, all branches', poses, lambda pose: solutions(arm, pose))
    yield _figure(
        'inverse, nearest to a seed 0.1 rad off',
        list(zip(poses, seeds, strict=True)),
        lambda task: nearest(arm, *task),
        (lambda task: reference.inverse(*task)) if reference else None,
        than='pinocchio, CLIK',
    )
    found = [nearest(arm, *task) for task in zip(poses, seeds, strict=True)]
    yield _agreement(
        'the solution that was meant, found',
        joints,
        found,
        [reference.inverse(*task) for task in zip(poses, seeds, strict=True)]
        if reference
        else None,
    )


def _figure(
    name: str,
    tasks: Sequence[Any],
    solve: Callable[[Any], object],
    other: Callable[[Any], object] | None = None,
    than: str = 'pinocchio',
) -> Figure:
    def each(function: Callable[[Any], object]) -> float:
        return 1e6 * seconds(lambda: [function(task) for task in tasks], repeat=3) / len(tasks)

    return Figure(
        benchmark=NAME,
        name=name,
        value=each(solve),
        unit='us',
        baseline=None if other is None else each(other),
        than=than,
        note=f'{len(tasks)} poses',
    )


def _agreement(
    name: str, joints: Sequence[Vector6], found: Sequence[Any], other: Sequence[Any] | None
) -> Figure:
    def share(answers: Sequence[Any]) -> float:
        meant = sum(
            q is not None and max(map(_difference, q, joint)) < 1e-4
            for q, joint in zip(answers, joints, strict=True)
        )
        return 100.0 * meant / len(joints)

    return Figure(
        benchmark=NAME,
        name=name,
        value=share(found),
        unit='%',
        baseline=None if other is None else share(other),
        than='pinocchio, CLIK',
    )


def _difference(a: float, b: float) -> float:
    return abs(a - b)


class Pinocchio:
    """An arm in pinocchio, with the iteration of pinocchio's example of inverse kinematics."""

    def __init__(self, library: Any, arm: Arm) -> None:
        """Build the model."""
        self._pin = library
        self._model = pinocchio_model(arm)
        self._data = self._model.createData()
        self._frame = self._model.getFrameId('tool0')

    def forward(self, q: Sequence[float] | NDArray[np.float64]) -> Any:
        """Return the pose of the flange."""
        pin = self._pin
        pin.framesForwardKinematics(self._model, self._data, np.array(q))
        return self._data.oMf[self._frame]

    def inverse(self, pose: Pose, seed: Vector6) -> Any:
        """Return the joints to which the iteration converges from the seed; None = it does not."""
        pin = self._pin
        wanted = pin.XYZQUATToSE3(np.array(pose.row()))
        q = np.array(seed)
        for _ in range(STEPS):
            error = self.forward(q).actInv(wanted)
            twist = pin.log6(error).vector
            if np.linalg.norm(twist) < ACCEPTED:
                return q
            J = pin.computeFrameJacobian(
                self._model, self._data, q, self._frame, pin.ReferenceFrame.LOCAL
            )
            J = pin.Jlog6(error.inverse()) @ J
            q = q + J.T @ np.linalg.solve(J @ J.T + DAMPING * np.eye(6), twist)
        return None


def pinocchio_or_none(arm: Arm) -> Pinocchio | None:
    try:
        import pinocchio
    except ImportError:
        return None
    return Pinocchio(pinocchio, arm)


def _drawn(draw: random.Random, bound: float) -> Vector6:
    a, b, c, d, e, f = (draw.uniform(-bound, bound) for _ in range(6))
    return (a, b, c, d, e, f)


def _moved(q: Vector6, draw: random.Random) -> Vector6:
    """Return joint positions, each shifted by OFF in a random direction."""
    a, b, c, d, e, f = (angle + draw.choice((-OFF, OFF)) for angle in q)
    return (a, b, c, d, e, f)
