# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Random transfers among balls, made backwards from a way that is known to be free.

A random joint motion over two other configurations is the known way. Balls are put where the
straight motion from its start to its end would pass, but not where the known way passes. The arm
is capsules between the origins of its DH frames, which the test places by itself.
"""

from collections import Counter
from dataclasses import dataclass
from itertools import pairwise
from math import pi

import numpy as np
import pytest
from random_cases import cases, random_of

from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.kinematics.robot_models import MODELS, RobotModel
from ur_cartesian_driver.motion.geometry.pose import Pose
from ur_cartesian_driver.planning import PlanningOptions
from ur_cartesian_driver.planning.preflight.tcp_kinematics import TcpKinematics
from ur_cartesian_driver.planning.travel.arm_space import ArmSpace
from ur_cartesian_driver.planning.travel.joint_path_search import search_joint_path

PARTS, WHOLE = 10, 300
#: Samples within which at least 99 % of the transfers are found.
SAMPLES = 500
#: Radius of the links [m]; what the arm moves at most between two rows of the search [m].
LINK, BETWEEN = 0.06, 0.03
BALLS = 12
DEGREE = pi / 180


def rows_between(a, b, step):
    count = max(1, int(np.ceil(np.abs(np.subtract(b, a)).max() / step)))
    return np.asarray(a) + np.linspace(0.0, 1.0, count + 1)[:, None] * np.subtract(b, a)


def along(waypoints, step):
    parts = pairwise(waypoints)
    return np.concatenate([rows_between(a, b, step) for a, b in parts])


def frame_origins(geometry, q):
    """The origins of the base and of all DH frames, (n, 7, 3) [m]."""
    T = np.broadcast_to(np.eye(4), (len(q), 4, 4))
    origins = [T[:, :3, 3]]
    for a, d, alpha, theta, angle in zip(
        geometry.a, geometry.d, geometry.alpha, geometry.theta, q.T, strict=True
    ):
        c, s, ca, sa = np.cos(angle + theta), np.sin(angle + theta), np.cos(alpha), np.sin(alpha)
        link = np.zeros((len(q), 4, 4))
        link[:, 0, 0], link[:, 0, 1], link[:, 0, 2], link[:, 0, 3] = c, -s * ca, s * sa, a * c
        link[:, 1, 0], link[:, 1, 1], link[:, 1, 2], link[:, 1, 3] = s, c * ca, -c * sa, a * s
        link[:, 2, 1], link[:, 2, 2], link[:, 2, 3], link[:, 3, 3] = sa, ca, d, 1.0
        T = T @ link
        origins.append(T[:, :3, 3])
    return np.stack(origins, axis=1)


@dataclass
class BallWorld:
    """An arm among balls: the joint space of the search, and its judge."""

    model: RobotModel
    centres: np.ndarray
    radii: np.ndarray

    def __post_init__(self):
        kinematics = TcpKinematics(Arm(self.model), Pose((0.0, 0.0, 0.0)))
        arm = ArmSpace(kinematics, PlanningOptions(self_collision='off'))
        self.limits, self.weights = arm.limits, arm.weights

    def distances(self, q):
        """The distance of the arm from the nearest ball in each row, (n,) [m]."""
        ends = frame_origins(self.model.geometry, q)[:, 1:]
        a, ab = ends[:, :-1, None], np.diff(ends, axis=1)[:, :, None]
        ac = self.centres - a
        square = np.maximum((ab**2).sum(axis=-1), 1e-12)
        t = np.clip((ac * ab).sum(axis=-1) / square, 0.0, 1.0)
        gaps = np.linalg.norm(ac - t[..., None] * ab, axis=-1) - self.radii - LINK
        return gaps.min(axis=(1, 2))

    def free(self, q):
        return self.distances(q) > BETWEEN

    def is_free(self, a, b):
        return True  # it has been looked at densely enough

    def seems_free(self, a, b):
        return bool(self.free(rows_between(a, b, DEGREE)).all())


def random_transfer(random):
    """Return a world, and the rows of a way that is free in it."""
    model = MODELS[random.choice(['ur3e', 'ur5e', 'ur10e', 'ur20'])]
    limits = np.clip(np.array(model.position_limits), -pi, pi)
    draw = np.random.default_rng(random.getrandbits(32))
    way = draw.uniform(limits[:, 0], limits[:, 1])[None]
    for _ in range(3):
        change = draw.uniform(-1.2, 1.2, 6)
        way = np.vstack([way, np.clip(way[-1] + change, *limits.T)])
    known = along(way, 2 * DEGREE)
    blocked = rows_between(way[0], way[-1], 2 * DEGREE)
    centres, radii = [], []
    for _ in range(400):
        row = frame_origins(model.geometry, blocked[draw.integers(len(blocked))][None])[0, 2:]
        centre = row[draw.integers(len(row))] + draw.normal(0.0, 0.1, 3)
        radius = draw.uniform(0.03, 0.15)
        one = BallWorld(model, np.array([centre]), np.array([radius]))
        if one.distances(known).min() > BETWEEN + 0.03:
            centres.append(centre)
            radii.append(radius)
        if len(centres) == BALLS:
            break
    if not centres:
        return random_transfer(random)
    return BallWorld(model, np.array(centres), np.array(radii)), way


@pytest.mark.slow
@pytest.mark.random
@pytest.mark.parametrize('part', range(PARTS))
def test_random_transfers_are_found_and_free(part):
    random = random_of('transfers', part)
    seen = Counter()
    for _ in range(cases(WHOLE // PARTS)):
        world, way = random_transfer(random)
        found = search_joint_path(world, way[0], way[-1:], max_samples=SAMPLES)
        seen['all'] += 1
        if found is None:
            seen['missed'] += 1
            continue
        assert np.array_equal(found.waypoints[[0, -1]], way[[0, -1]])
        rows = along(found.waypoints, 0.1 * DEGREE)
        assert (rows >= world.limits[0]).all()
        assert (rows <= world.limits[1]).all()
        assert world.distances(rows).min() > 0.0
    assert seen['missed'] <= 0.01 * seen['all']
