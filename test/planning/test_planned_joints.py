# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The joints along a plan: on the straight joint line of a joint move, on one branch elsewhere."""

from forward_model import dh_forward, pose_matrix
import numpy as np
import pytest

from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.kinematics.robot_models import JOINT_NAMES, robot_model
from ur_cartesian_driver.motion.geometry.pose import Pose
from ur_cartesian_driver.motion.goal.goal import Goal, Posture, Segment, SegmentType, Waypoint
from ur_cartesian_driver.motion.state.rtde_state import RobotState
from ur_cartesian_driver.planning import plan, PlanningOptions
from ur_cartesian_driver.planning.preflight.path_left import PathLeft
from ur_cartesian_driver.planning.preflight.planned_joints import (
    joint_moves,
    joints_along,
    row_places,
)

ARM = Arm(robot_model('ur5e'))
TCP = Pose((0.0, 0.0, 0.1))
#: Before and behind the wrist singularity, where wrist 2 is 0.
BEFORE = (0.1, -1.5, 1.6, -1.3, 0.8, 0.2)
BEHIND = (0.5, -1.3, 1.4, -1.5, -0.7, 0.6)


@pytest.fixture(scope='module')
def through_the_singularity():
    """Return the plan of a joint move through a singularity, and a line behind it."""
    end = ARM.forward(BEHIND) @ TCP
    behind = Pose(tuple(np.add(end.position, (0.0, 0.03, 0.0)).tolist()), end.quaternion)
    posture = Posture(names=JOINT_NAMES, values=BEHIND)
    goal = Goal(
        waypoints=(Waypoint(pose=end, posture=posture), Waypoint(pose=behind)),
        segments=(
            Segment(type=SegmentType.JOINT, velocity=0.2),
            Segment(type=SegmentType.LINEAR, velocity=0.1),
        ),
    )
    state = RobotState(
        timestamp=0.0, actual_q=BEFORE, T_flange_tcp=TCP, actual_tcp_pose=ARM.forward(BEFORE) @ TCP
    )
    return plan(goal, state, ARM, PlanningOptions())


def test_joints_are_on_the_line_of_a_joint_move_and_on_the_branch_behind_it(
    through_the_singularity,
):
    made = through_the_singularity
    time = np.linspace(0.0, made.reference.time[-1], 400)
    places = np.round(row_places(made.reference, time))
    (move,) = joint_moves(made)
    rows = made.reference.poses[np.minimum(places.astype(int), len(made.reference.time) - 1)]
    flange = np.array([(Pose(tuple(r[:3]), tuple(r[3:])) @ TCP.inverse()).row() for r in rows])
    joints = joints_along(ARM, flange, places, [move], BEFORE)
    for q, row in zip(joints, rows, strict=True):
        np.testing.assert_allclose(
            dh_forward(ARM.geometry, q) @ pose_matrix(TCP),
            pose_matrix(Pose(tuple(row[:3]), tuple(row[3:]))),
            atol=1e-6,
        )
    on_the_line = places <= move.last
    change = np.subtract(BEHIND, BEFORE)
    parts = (joints[on_the_line] - BEFORE) / change
    assert np.ptp(parts, axis=1).max() < 1e-5
    assert (np.diff(parts[:, 0]) > -1e-9).all()
    assert parts[:, 0].min() < 0.1
    assert parts[:, 0].max() == pytest.approx(1.0)
    assert np.abs(joints[~on_the_line] - BEHIND).max() < 0.3


def test_what_is_left_of_a_joint_move_ends_in_its_posture(through_the_singularity):
    """Its joints are not those of the branch on which it began."""
    made = through_the_singularity
    left = PathLeft.of(made)
    for time in (0.0, 0.3 * made.segments[0].duration):
        end = left.check(ARM, PlanningOptions(), BEFORE, (), time)
        assert np.abs(np.subtract(end, made.segments[-1].joints)).max() < 1e-3
