# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
from math import sqrt

import pytest

from ur_cartesian_driver.motion.errors import InvalidGoal, RobotNotReady
from ur_cartesian_driver.motion.geometry.pose import (
    IDENTITY,
    Pose,
    quaternion_from_rotation_vector,
)
from ur_cartesian_driver.motion.goal.goal import Goal, Waypoint
from ur_cartesian_driver.motion.goal.known_frames import (
    ArmSnapshot,
    Frames,
    StaticFrame,
    T_TOOL0_FLANGE,
)
from ur_cartesian_driver.motion.state.rtde_state import RobotState

T_BASE_FLANGE = Pose((0.4, 0.1, 0.5), quaternion_from_rotation_vector((1.0, 2.0, 0.5)))
T_FLANGE_TCP = Pose((0.0, 0.02, 0.1), quaternion_from_rotation_vector((0.0, 0.3, 0.0)))
SNAPSHOT = ArmSnapshot(T_BASE_FLANGE, T_FLANGE_TCP)
TOOLS = [
    StaticFrame.parse('tip nozzle 0 0 0.02 0 0 0 1'),
    StaticFrame.parse('nozzle flange 0.1 0 0 0 0 0 1'),
    StaticFrame.parse('drop tool0_controller 0 0 0.005 0 0 0 1'),
    StaticFrame.parse('table base_link 1 0 0 0 0 0 1'),
]
GOAL = Goal(waypoints=(Waypoint(pose=IDENTITY),))
T_FLANGE_TIP = T_TOOL0_FLANGE @ Pose((0.1, 0.0, 0.02))


def assert_same(a, b):
    assert a.distance_to(b) < 1e-12
    assert a.angle_to(b) < 1e-9


@pytest.mark.parametrize('prefix', ['', 'left_'])
@pytest.mark.parametrize('name', ['', 'base'])
def test_base_is_the_base(prefix, name):
    assert Frames(prefix).T_base_frame(name and prefix + name) == IDENTITY


@pytest.mark.parametrize('prefix', ['', 'left_'])
def test_base_link_is_the_base_turned_by_pi_about_z(prefix):
    T_base_base_link = Frames(prefix).T_base_frame(f'{prefix}base_link')
    assert T_base_base_link.apply((1.0, 2.0, 3.0)) == pytest.approx((-1.0, -2.0, 3.0))


def test_static_frames_chain_in_any_order():
    frames = Frames(
        '',
        [
            StaticFrame.parse('part table 0 0 0.5 0 0 0 1'),
            StaticFrame.parse('table base_link 1 0 0 0 0 0 1'),
        ],
    )
    assert frames.T_base_frame('part').position == pytest.approx((-1.0, 0.0, 0.5))


def test_a_static_frame_may_be_turned():
    frames = Frames('', [StaticFrame.parse(f'wall base 0 0 0 {sqrt(0.5)} 0 0 {sqrt(0.5)}')])
    assert frames.T_base_frame('wall').apply((0.0, 1.0, 0.0)) == pytest.approx((0.0, 0.0, 1.0))


def test_an_unknown_frame_is_refused_by_its_name():
    with pytest.raises(InvalidGoal, match=r'header\.frame_id is "world".*base, base_link'):
        Frames().T_base_frame('world')


def test_a_frame_without_the_prefix_is_unknown():
    with pytest.raises(InvalidGoal, match=r'left_base'):
        Frames('left_').T_base_frame('base')


@pytest.mark.parametrize(
    ('texts', 'sentence'),
    [
        (['table base 1 2 3'], 'has 5 words instead of 9'),
        (['table base 1 2 three 0 0 0 1'], 'three'),
        (['table base 1 2 nan 0 0 0 1'], 'not finite'),
        (['table base 1 2 3 0 0 0 2'], r'has length 2 instead of 1'),
        (['table world 1 2 3 0 0 0 1'], 'the parent "world" of "table" does not lead to base'),
        (['a b 0 0 0 0 0 0 1', 'b a 0 0 0 0 0 0 1'], 'does not lead to base'),
        (['base base_link 0 0 0 0 0 0 1'], 'the name "base" is taken'),
        (['a base 0 0 0 0 0 0 1', 'a base 0 0 1 0 0 0 1'], 'the name "a" is taken'),
    ],
)
def test_malformed_static_frames_say_what_is_wrong(texts, sentence):
    with pytest.raises(ValueError, match=sentence):
        Frames('', [StaticFrame.parse(text) for text in texts])


@pytest.mark.parametrize(
    ('name', 'expected'),
    [
        ('tool0', T_BASE_FLANGE),
        ('flange', T_BASE_FLANGE @ T_TOOL0_FLANGE),
        ('tool0_controller', T_BASE_FLANGE @ T_FLANGE_TCP),
        ('tip', T_BASE_FLANGE @ T_FLANGE_TIP),
        ('drop', T_BASE_FLANGE @ T_FLANGE_TCP @ Pose((0.0, 0.0, 0.005))),
    ],
)
def test_frames_on_the_arm_are_where_it_stands(name, expected):
    assert_same(Frames('', TOOLS).T_base_frame(name, SNAPSHOT), expected)


@pytest.mark.parametrize('name', ['tool0', 'flange', 'tool0_controller', 'tip', 'drop'])
def test_frames_on_an_arm_that_nobody_knows_are_waited_for(name):
    with pytest.raises(RobotNotReady, match=rf'frame_id is "{name}", which moves with the arm'):
        Frames('', TOOLS).T_base_frame(name)


def test_the_stand_is_the_robot_s_own_report():
    state = RobotState(
        timestamp=0.0,
        actual_q=(0.0,) * 6,
        T_flange_tcp=T_FLANGE_TCP,
        actual_tcp_pose=T_BASE_FLANGE @ T_FLANGE_TCP,
    )
    assert_same(ArmSnapshot.of(state).T_base_flange, T_BASE_FLANGE)


@pytest.mark.parametrize(
    ('prefix', 'name'), [('', ''), ('', 'tool0_controller'), ('left_', 'left_tool0_controller')]
)
def test_the_active_tcp_is_a_controlled_frame_whatever_it_is(prefix, name):
    assert Frames(prefix).T_flange_frame(name) is None


@pytest.mark.parametrize(
    ('name', 'expected'),
    [
        ('tool0', IDENTITY),
        ('flange', T_TOOL0_FLANGE),
        ('tip', T_FLANGE_TIP),
        ('drop', T_FLANGE_TCP @ Pose((0.0, 0.0, 0.005))),
    ],
)
def test_what_is_fixed_behind_the_flange_can_be_controlled(name, expected):
    T = Frames('', TOOLS).T_flange_frame(name, SNAPSHOT)
    assert T is not None
    assert_same(T, expected)


def test_what_is_behind_a_tcp_that_nobody_knows_is_waited_for():
    with pytest.raises(RobotNotReady, match='controlled_frame is "drop"'):
        Frames('', TOOLS).T_flange_frame('drop')


@pytest.mark.parametrize(
    ('name', 'sentence'),
    [
        (
            'nozle',
            r'controlled_frame is "nozle", which is not a known frame; .*tool0_controller, '
            r'tool0, flange, nozzle, tip, drop;.*static_frames',
        ),
        ('table', r'is "table", which does not move with the arm.*tool0'),
        ('base', r'is "base", which does not move with the arm'),
    ],
)
def test_what_is_not_behind_the_flange_is_refused_with_the_known_frames(name, sentence):
    with pytest.raises(InvalidGoal, match=sentence):
        Frames('', TOOLS).T_flange_frame(name, SNAPSHOT)


def test_flange_has_the_axes_of_rep_103():
    # x of flange is z of tool0, the direction that the tool points in; z of flange is its y.
    assert T_TOOL0_FLANGE.apply((1.0, 0.0, 0.0)) == pytest.approx((0.0, 0.0, 1.0))
    assert T_TOOL0_FLANGE.apply((0.0, 0.0, 1.0)) == pytest.approx((0.0, 1.0, 0.0))


@pytest.mark.parametrize(
    ('frame', 'T_flange_frame'),
    [('tip', T_FLANGE_TIP), ('tool0', IDENTITY), ('drop', T_FLANGE_TCP @ Pose((0.0, 0.0, 0.005)))],
)
def test_a_frame_in_the_hand_before_a_tool_in_the_cell_moves(frame, T_flange_frame):
    goal = Frames('', TOOLS).resolve(GOAL, frame, 'table', SNAPSHOT)
    assert_same(goal.moving_frame.T_flange_frame, T_flange_frame)
    assert_same(goal.moving_frame.T_base_tool, Pose((-1.0, 0.0, 0.0), (0.0, 0.0, 1.0, 0.0)))
    assert goal.T_base_frame == IDENTITY
    assert goal.T_flange_controlled is None
    assert goal.controlled_frame == 'table'
    # What was so before is so again.
    fixed = Frames('', TOOLS).resolve(goal, 'table', 'tip', SNAPSHOT)
    assert fixed.moving_frame is None
    assert_same(fixed.T_flange_controlled, T_FLANGE_TIP)
    taken_once = Frames('', TOOLS).resolve(goal, 'tip', '', SNAPSHOT)
    assert taken_once.moving_frame is None
    assert_same(taken_once.T_base_frame, T_BASE_FLANGE @ T_FLANGE_TIP)


def test_a_part_behind_a_tcp_that_nobody_knows_is_waited_for():
    with pytest.raises(RobotNotReady, match='frame_id is "drop"'):
        Frames('', TOOLS).resolve(GOAL, 'drop', 'table')


@pytest.mark.parametrize('frame', ['', 'base', 'table'])
def test_a_tool_and_a_frame_that_both_stand_are_refused(frame):
    text = (
        r'controlled_frame is "table", which does not move with the arm, and neither does '
        rf'trajectory.header.frame_id "{frame or "base"}"; for a part in the hand, name its frame '
        r'in trajectory.header.frame_id \(nozzle, tip\); for a tool in the hand, leave '
        r'controlled_frame empty'
    )
    with pytest.raises(InvalidGoal, match=text):
        Frames('', TOOLS).resolve(GOAL, frame, 'table', SNAPSHOT)


def test_the_base_is_no_tool():
    with pytest.raises(InvalidGoal, match='is "base", which does not move with the arm'):
        Frames('', TOOLS).resolve(GOAL, 'tip', 'base', SNAPSHOT)
