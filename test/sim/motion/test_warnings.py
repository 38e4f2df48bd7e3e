# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Moves that a controller cannot drive as asked: its warnings, and its motions instead."""

from math import pi

from hypothesis import given, Phase, settings
from hypothesis import strategies as st
import numpy as np
import pytest

from ur_cartesian_driver.protocol.client_interfaces.primary_messages import (
    ErrorCodeMessage,
    ReportLevel,
)
from ur_cartesian_driver.sim.motion.motion_values import MotionError

HOME = (0.0, -pi / 2, pi / 2, -pi / 2, -pi / 2, 0.0)
CYCLE = 0.002


def codes(r):
    return [(warning.code, warning.argument) for warning in r.generator.warnings]


def test_movep_that_the_joints_cannot_keep_up_with_is_said_to_be_too_fast_once(recorder, shifted):
    r = recorder()
    start = r.generator.T_base_tcp
    r.run(r.generator.movep(shifted(start, y=0.6), a=20.0, v=3.0))
    assert codes(r) == [(196, 0)]
    assert r.generator.fault is None
    assert np.abs(r.speeds()).max() <= pi * (1.0 + 1e-5)
    assert np.abs(r.positions[:, [0, 2]] - np.array(start.position)[[0, 2]]).max() < 1e-9


def test_movep_that_is_too_fast_for_its_blend_is_said_to_be_and_keeps_its_fillet(
    recorder, shifted
):
    r = recorder()
    waypoint = shifted(r.generator.T_base_tcp, y=0.15)
    r.run(r.generator.movep(waypoint, a=5.0, v=0.8, r=0.01))
    r.run(r.generator.movep(shifted(waypoint, x=0.15), a=5.0, v=0.8))
    assert codes(r) == [(196, 0)]
    assert 'blend' in r.generator.warnings[0].text


def test_movep_does_not_turn_back_in_a_blend(recorder, shifted):
    r = recorder()
    waypoint = shifted(r.generator.T_base_tcp, y=0.15)
    r.run(r.generator.movep(waypoint, v=0.1, r=0.01))
    with pytest.raises(MotionError, match='cannot maintain speed when reversing direction'):
        r.generator.movep(shifted(waypoint, y=-0.1), v=0.1)


@pytest.mark.parametrize('slider', [1.0, 0.3])
def test_movep_at_its_default_speed_is_not_too_fast(recorder, shifted, slider):
    r = recorder()
    waypoint = shifted(r.generator.T_base_tcp, y=0.15)
    r.run(r.generator.movep(waypoint, r=0.03), lambda i: slider)
    r.run(r.generator.movep(shifted(waypoint, x=0.15)), lambda i: slider)
    assert codes(r) == []


@pytest.mark.parametrize(
    ('call', 'argument'),
    [
        (lambda g, pose, shift: g.movep(pose, v=0.4, r=0.0005), 10),
        (
            lambda g, pose, shift: g.movec(
                shift(g.T_base_tcp, x=0.05, z=0.02), pose, v=0.4, r=0.0005
            ),
            1,
        ),
    ],
)
def test_blend_that_is_passed_within_a_cycle_is_none(recorder, shifted, call, argument):
    r = recorder()
    waypoint = shifted(r.generator.T_base_tcp, x=0.1)
    r.run(call(r.generator, waypoint, shifted))
    assert codes(r) == [(171, argument)]
    assert r.generator.T_base_tcp == waypoint
    r.step()
    assert not r.generator.moving


def test_limit_of_the_tool_speed_is_kept_on_the_same_path(recorder, shifted):
    r = recorder()
    r.generator.max_tool_speed = 0.3
    start = r.generator.T_base_tcp
    r.run(r.generator.movel(shifted(start, y=0.3), a=5.0, v=1.0))
    speeds = np.linalg.norm(r.tool_speeds(), axis=1)
    assert speeds.max() == pytest.approx(0.3, rel=1e-5)
    assert np.abs(r.positions[:, [0, 2]] - np.array(start.position)[[0, 2]]).max() < 1e-9


@pytest.mark.slow
@settings(max_examples=8, deadline=None, phases=[Phase.generate])
@given(
    st.tuples(*[st.floats(-0.5, 0.5)] * 6).filter(any),
    st.floats(0.1, 0.5),
    st.sampled_from(['movej', 'optimovej', 'servoj', 'speedj']),
)
def test_joint_motion_keeps_the_limit_of_the_tool_speed(recorder, way, limit, name):
    r = recorder()
    g = r.generator
    g.max_tool_speed = limit
    target = tuple(a + b for a, b in zip(HOME, way, strict=True))
    r.run(
        {
            'movej': lambda: g.movej(target, 20.0, 3.0),
            'optimovej': lambda: g.optimovej(target),
            'servoj': lambda: g.servoj(target, 0.5),
            'speedj': lambda: g.speedj(way, 5.0, 0.5),
        }[name]()
    )
    assert np.linalg.norm(r.tool_speeds(), axis=1).max() <= limit * (1.0 + 1e-5)
    if name.endswith('movej'):
        assert g.q == pytest.approx(target, abs=1e-9)


def test_warnings_reach_the_clients_of_the_primary_interface(bench):
    messages = bench.controller.messages.pending
    messages.clear()
    log = bench.run("""
pose = get_target_tcp_pose()
movep(pose_add(pose, p[0, 0.1, 0, 0, 0, 0]), v=0.4, r=0.0005)
movel(pose_add(pose, p[0, 0.2, 0, 0, 0, 0]), r=0.06)
movel(pose_add(pose, p[0.05, 0.2, 0, 0, 0, 0]), r=0.06)
movel(pose_add(pose, p[0.2, 0.2, 0, 0, 0, 0]))""")
    errors = [message for message in messages if isinstance(message, ErrorCodeMessage)]
    assert [message.label for message in errors] == ['C171A10', 'C171A11']
    assert {message.level for message in errors} == {ReportLevel.WARNING}
    assert [line.split(':')[0] for line in log] == ['C171A10', 'C171A11']
