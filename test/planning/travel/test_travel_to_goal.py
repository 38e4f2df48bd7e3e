# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Goals that begin with a travel, judged by the test's own kinematics."""

from dataclasses import replace
from math import pi
import re

from forward_model import dh_forward, pose_matrix
import numpy as np
import pytest

from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.kinematics.robot_models import JOINT_NAMES, robot_model
from ur_cartesian_driver.motion.cell.cell import Cell, CellBody, PlacedShape
from ur_cartesian_driver.motion.cell.shapes import Box
from ur_cartesian_driver.motion.errors import CollisionPredicted, GoalRefused, InvalidGoal
from ur_cartesian_driver.motion.events import PathPlace
from ur_cartesian_driver.motion.geometry.pose import Pose
from ur_cartesian_driver.motion.goal.goal import (
    IOCommand,
    OutputKind,
    Posture,
)
from ur_cartesian_driver.path import digital, DOWN, mm, Path
from ur_cartesian_driver.planning import plan, PlanningOptions
from ur_cartesian_driver.planning.stop_prediction import state_at_rest
from ur_cartesian_driver.preview import sample

H = pi / 2
ARM = Arm(robot_model('ur5e'))
TOOL = Pose((0.0, 0.0, 0.1))
HOME = (0.0, -H, H, -H, -H, 0.0)
STATE = state_at_rest(ARM, HOME, TOOL)
TABLE = PlanningOptions(workspace_planes=('table 0 0 0 0 0 1',))
#: Joint motions are lines of the joints, straight ones of the tool, to within this [m].
CLOSE = 1e-5

FAR_PATH = (
    Path(frame='base')
    .at(speed=0.1, blend=mm(5))
    .line((-0.4, 0.35, 0.12), DOWN)
    .by(dx=0.2)
    .set(digital(1), True)
    .by(dy=-0.1)
)
FAR = FAR_PATH.allow_travel().goal()
#: A board across the line from home to a place beside it.
BOARD = CellBody(
    name='board',
    shapes=(PlacedShape(Box((0.6, 0.02, 0.6))),),
    T_frame_body=Pose((-0.5, 0.12, 0.3)),
)
BEHIND = Path(frame='base').at(speed=0.1).line((-0.45, 0.3, 0.35), DOWN).by(dz=-0.1)
BOARDED = replace(TABLE, tool_radius=0.02, cell=Cell(bodies=(BOARD,)))


def planned(goal, options=TABLE, state=STATE):
    return plan(goal, state, ARM, options)


def travel_lines(made):
    return [line for line in made.report if line.startswith('travel, point')]


def tcp(q):
    return dh_forward(ARM.model.geometry, np.array(q)) @ pose_matrix(TOOL)


def test_a_goal_that_begins_far_away_begins_with_a_travel_if_asked():
    with pytest.raises(InvalidGoal, match=r'max_approach_distance .* set allow_travel'):
        planned(FAR_PATH.goal())
    made = planned(FAR)
    count = len(travel_lines(made))
    assert count >= 2
    assert made.rows.waypoints.tolist() == [0] * (count + 1) + [1, 2]
    assert made.start == HOME
    assert made.travelled_goal == FAR
    assert made.reference.poses[0] == pytest.approx(np.array(STATE.actual_tcp_pose.row()))
    assert tcp(made.rows.joints[count])[:3, 3] == pytest.approx((-0.4, 0.35, 0.12), abs=CLOSE)
    # The tool approaches along its axis z, and comes from its own axis z.
    first, approach = tcp(made.rows.joints[0]), tcp(made.rows.joints[count - 1])
    assert approach[:3, 3] == pytest.approx((-0.4, 0.35, 0.17), abs=CLOSE)
    assert first[:3, 3] == pytest.approx((tcp(HOME) @ (0.0, 0.0, -0.05, 1.0))[:3], abs=CLOSE)


def test_times_and_places_of_the_joined_path_go_on():
    made = planned(FAR)
    path = made.reference
    assert (np.diff(path.time) >= 0.0).all()
    assert path.time[-1] == pytest.approx(made.duration)
    steps = np.linalg.norm(np.diff(path.poses[:, :3], axis=0), axis=1)
    assert steps.sum() == pytest.approx(made.rows.lengths.sum(), rel=0.02)
    assert (np.diff(path.point) >= 0).all()
    way = path.time < made.rows.durations[: len(travel_lines(made))].sum() - 1e-6
    assert (path.point[way] == 0).all()
    assert (path.fraction[way] == 0.0).all()


def test_the_samples_of_the_joints_follow_each_motion_of_a_travel():
    made = planned(BEHIND.allow_travel().goal(), BOARDED)
    shown = sample(made, ARM, TOOL, 0.02)
    assert np.isfinite(shown.joints).all()
    assert np.abs(np.diff(shown.joints, axis=0)).max() < 0.1
    for k, end in enumerate(np.cumsum(made.rows.durations).tolist()):
        row = int(np.argmin(np.abs(shown.time - end)))
        off = np.abs(shown.joints[row] - made.rows.joints[k]).max()
        assert off < 0.15  # blends cut the corners
    assert shown.joints[-1] == pytest.approx(made.rows.joints[-1], abs=1e-6)


def test_events_and_texts_keep_the_numbers_of_the_client():
    made = planned(FAR)
    [(row, records)] = made.rows.outputs.items()
    assert made.rows.waypoints[row] == 1
    assert len(records) == 1
    assert made.goal.io_commands == FAR.io_commands
    [remark] = [line for line in made.remarks if line.startswith('travel: ')][:1]
    assert re.search(r'by \d motions, 0\.\d+ m .* found with 0 samples', remark)
    assert 'refused: trajectory.points[0].pose.position is 0.' in remark
    deep = FAR_PATH.by(dz=-0.2).allow_travel().goal()
    with pytest.raises(CollisionPredicted, match=r'^trajectory.points\[3\].pose, at '):
        planned(deep)


def test_a_goal_whose_first_line_is_blocked_goes_round():
    goal = BEHIND.goal()
    with pytest.raises(CollisionPredicted, match='board'):
        planned(goal, BOARDED)
    asked = replace(goal, allow_travel=True)
    made = planned(asked, BOARDED)
    assert len(travel_lines(made)) >= 2
    again = planned(asked, BOARDED)
    assert np.array_equal(made.rows.joints, again.rows.joints)
    # The axis of the tool crosses the plane of the board beside the board only.
    q = sample(made, ARM, TOOL, 0.005).joints
    for along in (0.0, 0.05, 0.1):
        at = np.array([(tcp(row) @ (0.0, 0.0, -along, 1.0))[:3] for row in q])
        in_board = np.abs(at - BOARD.T_frame_body.position) < np.array((0.3, 0.01, 0.3))
        assert not in_board.all(axis=1).any()


def test_a_travel_is_never_unasked_nor_where_the_direct_way_is_free():
    near = Path(frame='base').line(STATE.actual_tcp_pose).by(dz=0.05)
    direct, asked = near.goal(), near.allow_travel().goal()
    one, other = planned(direct), planned(asked)
    assert other.travelled_goal is None
    assert one.report == other.report
    assert np.array_equal(one.reference.poses, other.reference.poses)
    # A later point that is refused is no reason to travel.
    with pytest.raises(GoalRefused, match=r'^trajectory.points\[2\]'):
        planned(near.by(dz=1.5).allow_travel().goal())


def test_the_posture_of_the_first_point_is_kept():
    posture = dict(zip(JOINT_NAMES, (1.9, -1.2, 1.5, -1.9, -H, 6.0), strict=True))
    there = Path(frame='base').joint(ARM.forward(tuple(posture.values())) @ TOOL, posture=posture)
    goal = there.by(dz=0.02).allow_travel().goal()
    options = replace(TABLE, max_approach_distance=0.1)
    made = planned(goal, options)
    row = made.rows.waypoints.tolist().count(0) - 1
    assert made.rows.joints[row] == pytest.approx(list(posture.values()), abs=1e-9)
    for elbow in (-1.0, 1.0):
        chosen = Posture(names=JOINT_NAMES[2:3], values=(elbow,))
        first = replace(FAR.waypoints[0], posture=chosen)
        made = planned(replace(FAR, waypoints=(first, *FAR.waypoints[1:])))
        assert np.sign(made.rows.joints[-1][2]) == elbow


def test_retract_and_approach_are_left_out_where_there_is_no_room():
    """The straight arm cannot follow a line along its tool."""
    straight = state_at_rest(ARM, (0.0, -H, 0.0, -H, 0.0, 0.0), TOOL)
    made = planned(FAR, state=straight)
    assert ': JOINT -> MOVEJ' in travel_lines(made)[0]


def test_a_start_of_a_path_becomes_its_first_point():
    path = Path((-0.4, 0.35, 0.12), DOWN, frame='base').by(dx=0.1).set(digital(1), True)
    goal = path.allow_travel().goal()
    assert [point.pose.position for point in goal.waypoints] == [
        (-0.4, 0.35, 0.12),
        pytest.approx((-0.3, 0.35, 0.12)),
    ]
    assert goal.io_commands == (
        IOCommand(waypoint=1, offset=0.0, output=OutputKind.STANDARD_DIGITAL, pin=1, value=1.0),
    )
    assert Path.from_goal(goal).goal() == goal
    assert Path.from_yaml(path.allow_travel().to_yaml()).goal() == goal
    planned(goal)


TIMED = tuple(replace(point, time=k + 1.0) for k, point in enumerate(FAR.waypoints))
ARC = Path(frame='base').arc((-0.4, 0.35, 0.12), DOWN, via=(-0.4, 0.3, 0.2))


@pytest.mark.parametrize(
    ('goal', 'problem'),
    [
        (
            FAR_PATH.rounded(mm(1)).allow_travel().goal(),
            'executed as SPLINE; set execution to PRI',
        ),
        (replace(FAR, keep_open=True), 'points of a goal with keep_open are planned one by one'),
        (
            FAR_PATH.path_offset(across=mm(1)).allow_travel().goal(),
            'which a travel must not; lead',
        ),
        (
            replace(FAR, waypoints=TIMED, segments=(), io_commands=()),
            'the points have times, and how long a travel',
        ),
        (ARC.allow_travel().goal(), 'the first segment is CIRCULAR, an arc from where'),
    ],
)
def test_goals_that_cannot_begin_with_a_travel_say_what_to_do(goal, problem):
    with pytest.raises(GoalRefused, match=problem) as refused:
        planned(goal)
    assert str(refused.value).startswith('allow_travel is set, but ')


@pytest.mark.parametrize(('point', 'fraction'), [(0, 0.0), (1, 0.5), (2, 0.3)])
def test_what_is_left_of_a_stopped_goal_may_begin_with_a_travel_too(point, fraction):
    left = Path.from_goal(FAR).resumed(PathPlace(point=point, fraction=fraction)).goal()
    assert left.allow_travel
    made = planned(left)
    assert len(travel_lines(made)) >= 2
    assert made.rows.waypoints[-1] == len(left.waypoints) - 1
    end = tcp(made.rows.joints[-1])[:3, 3]
    assert end == pytest.approx(FAR.waypoints[-1].pose.position, abs=CLOSE)
