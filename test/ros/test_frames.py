# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
from math import pi, sqrt

import pytest

from ur_cartesian_driver.motion.errors import InvalidGoal, NotAvailable
from ur_cartesian_driver.motion.pose import IDENTITY, Pose
from ur_cartesian_driver.ros.frames import Frames, StaticFrame, T_TOOL0_FLANGE


@pytest.mark.parametrize('prefix', ['', 'left_'])
@pytest.mark.parametrize('name', ['', 'base'])
def test_base_is_the_base(prefix, name):
    assert Frames(prefix).T_base_frame(name and prefix + name) == IDENTITY


@pytest.mark.parametrize('prefix', ['', 'left_'])
def test_base_link_is_the_base_turned_by_pi_about_z(prefix):
    T_base_base_link = Frames(prefix).T_base_frame(f'{prefix}base_link')
    assert T_base_base_link.apply((1.0, 2.0, 3.0)) == pytest.approx((-1.0, -2.0, 3.0))


def test_static_frames_chain_in_any_order():
    frames = Frames('', [
        StaticFrame.parse('part table 0 0 0.5 0 0 0 1'),
        StaticFrame.parse('table base_link 1 0 0 0 0 0 1'),
    ])
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


@pytest.mark.parametrize(('texts', 'sentence'), [
    (['table base 1 2 3'], 'has 5 words instead of 9'),
    (['table base 1 2 three 0 0 0 1'], 'three'),
    (['table base 1 2 nan 0 0 0 1'], 'not finite'),
    (['table base 1 2 3 0 0 0 2'], r'has length 2 instead of 1'),
    (['table world 1 2 3 0 0 0 1'], 'the parent "world" of "table" does not lead to base'),
    (['a b 0 0 0 0 0 0 1', 'b a 0 0 0 0 0 0 1'], 'does not lead to base'),
    (['base base_link 0 0 0 0 0 0 1'], '"base" is there twice'),
    (['a base 0 0 0 0 0 0 1', 'a base 0 0 1 0 0 0 1'], '"a" is there twice'),
])
def test_malformed_static_frames_say_what_is_wrong(texts, sentence):
    with pytest.raises(ValueError, match=sentence):
        Frames('', [StaticFrame.parse(text) for text in texts])


@pytest.mark.parametrize('name', ['', 'tool0_controller'])
def test_the_active_tcp_is_always_a_controlled_frame(name):
    Frames().check_controlled(name, Pose((0.0, 0.0, 0.1)))
    Frames().check_controlled(name, None)


def test_tool0_and_flange_are_controlled_frames_while_the_tcp_is_there():
    frames = Frames('left_')
    frames.check_controlled('left_tool0', IDENTITY)
    frames.check_controlled('left_flange', T_TOOL0_FLANGE)


def test_flange_has_the_axes_of_rep_103():
    # x of flange is z of tool0, the direction that the tool points in; z of flange is its y.
    assert T_TOOL0_FLANGE.apply((1.0, 0.0, 0.0)) == pytest.approx((0.0, 0.0, 1.0))
    assert T_TOOL0_FLANGE.apply((0.0, 0.0, 1.0)) == pytest.approx((0.0, 1.0, 0.0))


@pytest.mark.parametrize(('name', 'T_flange_tcp', 'sentence'), [
    ('tool0', Pose((0.0, 0.0, 0.1)), r'100\.0 mm and 0\.000 rad away'),
    ('flange', IDENTITY, rf'0\.0 mm and {2 * pi / 3:.3f} rad away'),
    ('tool0', None, 'has not said yet'),
])
def test_another_controlled_frame_is_not_available(name, T_flange_tcp, sentence):
    with pytest.raises(NotAvailable, match=sentence):
        Frames().check_controlled(name, T_flange_tcp)


def test_an_unknown_controlled_frame_is_refused_by_its_name():
    with pytest.raises(InvalidGoal, match=r'controlled_frame is "nozzle"'):
        Frames().check_controlled('nozzle', IDENTITY)
