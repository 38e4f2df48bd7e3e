# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The next joint positions from the ones before, of nominal and calibrated arms."""

from hypothesis import given, settings
from hypothesis import strategies as st
import numpy as np
import pytest

from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.kinematics.inverse import nearest
from ur_cartesian_driver.kinematics.inverse_incremental import singularity_distances, track_pose
from ur_cartesian_driver.kinematics.robot_models import DhTable, robot_model
from ur_cartesian_driver.motion.geometry.pose import Pose
from ur_cartesian_driver.motion.geometry.vectors import vector6
from ur_cartesian_driver.planning.preflight.tightest_margins import singularity_distance_rows

UR5E = robot_model('ur5e')
HOME = (0.0, -1.57, 1.57, -1.57, -1.57, 0.0)


def calibrated(seed=3):
    """A UR5e as one comes from the factory: half a millimetre and a milliradian off everywhere."""
    random = np.random.default_rng(seed)
    columns = {
        name: vector6(
            float(v + random.normal(0.0, 1e-3 if name in 'alpha theta' else 5e-4)) for v in column
        )
        for name, column in UR5E.geometry.columns().items()
    }
    return Arm(UR5E, DhTable(**columns))


ARMS = pytest.mark.parametrize('arm', [Arm(UR5E), calibrated()], ids=['nominal', 'calibrated'])
SMALL = st.tuples(*[st.floats(-0.02, 0.02)] * 6)


@ARMS
@settings(max_examples=40, deadline=None, derandomize=True)
@given(change=SMALL)
def test_it_finds_the_joints_that_were_gone_to(arm, change):
    q = tuple(a + b for a, b in zip(HOME, change, strict=True))
    found = track_pose(arm, arm.forward(q), HOME)
    assert found == pytest.approx(q, abs=1e-9)


@ARMS
def test_a_long_way_step_by_step_ends_on_the_branch_where_it_began(arm):
    here = arm.forward(HOME)
    q = HOME
    for i in range(1, 201):
        x, y, z = here.position
        q = track_pose(arm, Pose((x + 0.001 * i, y, z - 0.0005 * i), here.quaternion), q)
    assert q == pytest.approx(
        nearest(arm, Pose((x + 0.2, y, z - 0.1), here.quaternion), HOME), abs=1e-8
    )


@ARMS
def test_beyond_its_reach_there_is_nothing(arm):
    x, y, z = arm.forward(HOME).position
    q = HOME
    for i in range(1, 2000):
        q_next = track_pose(arm, Pose((x - 0.001 * i, y, z), arm.forward(HOME).quaternion), q)
        if q_next is None:
            break
        assert max(abs(a - b) for a, b in zip(q, q_next, strict=True)) < 0.5
        q = q_next
    assert 0.2 < 0.001 * i < 0.6


@ARMS
@settings(max_examples=25, deadline=None, derandomize=True)
@given(q=st.tuples(*[st.floats(-3.0, 3.0)] * 6))
def test_singularities_are_as_far_as_the_planner_says(arm, q):
    assert singularity_distances(arm, q) == pytest.approx(
        tuple(singularity_distance_rows(arm, np.array([q]))[0]), abs=1e-12
    )
