# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""servoj, speedj, speedl and the stops: their laws, their returns, and what follows."""

from math import pi, radians

from hypothesis import given, settings
from hypothesis import strategies as st
import numpy as np
import pytest

HOME = (0.0, -pi / 2, pi / 2, -pi / 2, -pi / 2, 0.0)
CYCLE = 0.002
STILL = (0.0,) * 6
few = settings(max_examples=15, deadline=None)
speeds = st.tuples(*[st.floats(-1.0, 1.0)] * 6).filter(lambda qd: max(map(abs, qd)) > 0.05)


def at_speed(recorder, qd):
    r = recorder()
    r.run(r.generator.speedj(qd, 40.0))
    return type(r)(r.generator)


@few
@given(speeds, st.floats(0.5, 20.0))
def test_stopj_brakes_the_leading_axis_and_all_joints_stop_together(recorder, qd, a):
    r = at_speed(recorder, qd)
    before = np.array(r.generator.q)
    count = r.run(r.generator.stopj(a))
    lead = max(map(abs, qd))
    assert abs(count * CYCLE - lead / a) <= CYCLE * (1.0 + 1e-9)
    # A straight line in joint space, as long as v^2 / 2a.
    assert r.q[-1] - before == pytest.approx(np.array(qd) * lead / (2.0 * a), abs=1e-9)
    steps = np.diff(r.q, axis=0)
    assert np.abs(steps - np.outer(steps @ qd / np.dot(qd, qd), qd)).max() < 1e-12
    assert np.abs(np.diff(r.speeds(), axis=0)).max() <= a * CYCLE * (1.0 + 1e-6)
    r.step()
    assert not r.generator.moving
    assert r.generator.qd == STILL


def test_stop_at_rest_takes_a_cycle_and_leaves_the_arm_steady(recorder):
    # So a program may write: while (not is_steady()): stopj(50) end
    r = recorder()
    assert r.run(r.generator.stopj(2.0)) == 1
    assert r.run(r.generator.stopl(2.0)) == 1
    assert not r.generator.moving
    assert r.generator.steady
    assert r.generator.q == HOME


def test_stopj_ends_even_when_the_speed_is_scaled_to_nothing(recorder):
    r = at_speed(recorder, (0.5, 0.0, 0.0, 0.0, 0.0, 0.0))
    assert r.run(r.generator.stopj(2.0), lambda i: 0.0) == pytest.approx(0.25 / CYCLE, abs=1)


def test_stopj_of_a_slowed_move_starts_from_the_real_speed(recorder):
    r = recorder()
    r.generator.movej((1.5, *HOME[1:]))
    r.step(0.25, times=2000)
    assert r.generator.qd[0] == pytest.approx(0.25 * radians(60), rel=1e-3)
    count = r.run(r.generator.stopj(2.0), lambda i: 0.25)
    assert abs(count * CYCLE - 0.25 * radians(60) / 2.0) <= CYCLE * (1.0 + 1e-9)


def test_stopj_aborts_the_move_that_ran(recorder):
    r = recorder()
    move = r.generator.movej((1.5, *HOME[1:]))
    r.step(times=100)
    r.run(r.generator.stopj(2.0))
    assert move.returned
    assert r.generator.q[0] < 0.2


def test_stopl_brakes_along_the_tangent(recorder, shifted):
    r = recorder()
    start = r.generator.T_base_tcp
    r.generator.movel(shifted(start, x=0.2), v=0.2)
    r.step(times=200)
    here = r.positions[-1]
    r.run(r.generator.stopl(1.0))
    assert np.abs(r.positions[:, 1:] - np.array(start.position)[1:]).max() < 1e-9
    assert r.positions[-1][0] - here[0] == pytest.approx(0.2**2 / 2.0, abs=1e-6)


@pytest.mark.slow
@few
@given(speeds, st.floats(0.5, 20.0))
def test_speedj_without_a_time_returns_at_speed(recorder, qd, a):
    r = recorder()
    count = r.run(r.generator.speedj(qd, a))
    lead = max(map(abs, qd))
    assert abs(count * CYCLE - lead / a) <= CYCLE * (1.0 + 1e-9)
    # All joints reach theirs together.
    for row in r.speeds():
        assert row == pytest.approx(np.array(qd) * np.abs(row).max() / lead, abs=1e-9)
    assert np.abs(np.diff(r.speeds(), axis=0)).max() <= a * CYCLE * (1.0 + 1e-6)


def test_speedj_returns_after_its_time_and_goes_on_with_the_next_call(recorder):
    r = recorder()
    for _ in range(100):
        assert r.run(r.generator.speedj((0.4, 0.0, 0.0, 0.0, 0.0, 0.0), 1.0, 0.002)) == 1
    assert r.generator.qd[0] == pytest.approx(0.2, abs=0.002)
    assert r.q[-1][0] == pytest.approx(0.5 * 1.0 * 0.2**2, abs=1e-6)


def test_arm_brakes_when_speedj_is_not_called_again(recorder):
    r = recorder()
    r.run(r.generator.speedj((0.4, 0.0, 0.0, 0.0, 0.0, 0.0), 1.0, 0.5))
    assert r.generator.qd[0] == pytest.approx(0.4)
    before = len(r.joints)
    r.rest()
    assert (len(r.joints) - before) * CYCLE == pytest.approx(0.4, abs=2 * CYCLE)


def test_speedj_with_no_time_returns_without_a_cycle(recorder):
    r = recorder()
    assert r.generator.speedj((0.4, 0.0, 0.0, 0.0, 0.0, 0.0), 1.0, 0.0).returned


def test_speed_scaling_slows_speedj_and_lengthens_its_time(recorder):
    r = recorder()
    assert (
        r.run(r.generator.speedj((0.4, 0.0, 0.0, 0.0, 0.0, 0.0), 4.0, 0.4), lambda i: 0.5) == 400
    )
    assert r.generator.qd[0] == pytest.approx(0.2)
    full = recorder()
    full.run(full.generator.speedj((0.4, 0.0, 0.0, 0.0, 0.0, 0.0), 4.0, 0.4))
    assert r.generator.q == pytest.approx(full.generator.q, abs=1e-9)


@pytest.mark.parametrize('function', ['speedj', 'speedl'])
def test_the_same_speed_asked_for_again_and_again_is_kept(recorder, function):
    r = recorder()
    target = (0.05, 0.0, 0.0, 0.0, 0.0, 0.0)
    r.run(getattr(r.generator, function)(target, 0.5))
    for _ in range(5):
        assert r.run(getattr(r.generator, function)(target, 0.5)) == 1
        speed = r.generator.qd if function == 'speedj' else r.generator.tcp_twist
        assert speed == pytest.approx(target, abs=1e-9)


def test_speedl_moves_the_tool_straight_and_turns_it(recorder):
    r = recorder()
    start = r.generator.T_base_tcp
    r.run(r.generator.speedl((0.1, 0.0, 0.0, 0.0, 0.0, 0.2), 0.5, 1.0, a_rot=1.0))
    assert r.generator.tcp_twist == pytest.approx((0.1, 0.0, 0.0, 0.0, 0.0, 0.2), abs=1e-9)
    assert r.positions[-1] - start.position == pytest.approx(
        (0.1 * 1.0 - 0.1**2 / (2 * 0.5), 0.0, 0.0), abs=1e-9
    )
    assert start.angle_to(r.poses[-1]) == pytest.approx(0.2 - 0.2**2 / 2.0)
    r.rest()
    assert np.abs(r.positions[:, 1:] - np.array(start.position)[1:]).max() < 1e-9


@pytest.mark.parametrize(('turn', 'a_rot', 'leads'), [(0.05, 0.2, 0.5), (0.2, 0.1, 2.0)])
def test_speedl_and_stopl_change_speed_and_turn_together(recorder, turn, a_rot, leads):
    r = recorder()
    target = (0.1, 0.0, 0.0, 0.0, 0.0, turn)
    assert r.run(r.generator.speedl(target, 0.2, a_rot=a_rot)) == pytest.approx(
        leads / CYCLE, abs=1
    )
    twists = np.array(r.twists)
    assert twists[:, 5] == pytest.approx(twists[:, 0] * turn / 0.1, abs=1e-9)
    r.run(r.generator.stopl(1.0))
    twists = np.array(r.twists)
    assert twists[:, 5] == pytest.approx(twists[:, 0] * turn / 0.1, abs=1e-9)


@pytest.mark.parametrize(('lookahead', 'gain'), [(0.03, 2000.0), (0.1, 300.0), (0.06, 1000.0)])
def test_servoj_lags_behind_a_ramp_by_its_lookahead(recorder, lookahead, gain):
    r = recorder()
    speed = 0.3
    for i in range(1000):
        target = (speed * (i + 1) * CYCLE, *HOME[1:])
        assert r.run(r.generator.servoj(target, CYCLE, lookahead, gain)) == 1
    # Seen when the call is made, which is a cycle before its end.
    assert target[0] - r.q[-2, 0] == pytest.approx(speed * lookahead, abs=1e-5)


@pytest.mark.parametrize(
    ('scale', 't', 'cycles'),
    [(1.0, 0.002, 1), (1.0, 0.008, 4), (0.5, 0.002, 2), (0.25, 0.008, 16)],
)
def test_servoj_lasts_its_time_divided_by_the_scaling(recorder, scale, t, cycles):
    r = recorder()
    assert r.run(r.generator.servoj(HOME, t), lambda i: scale) == cycles


@pytest.mark.slow
@few
@given(st.floats(0.03, 0.2), st.floats(100.0, 2000.0))
def test_servoj_settles_on_its_target_for_all_legal_gains(recorder, lookahead, gain):
    r = recorder()
    target = (0.05, *HOME[1:])
    r.run(r.generator.servoj(target, 5.0, lookahead, gain))
    assert r.generator.q == pytest.approx(target, abs=2e-3)


def test_servoj_to_a_far_target_keeps_the_joint_speed_limit(recorder):
    r = recorder()
    r.run(r.generator.servoj((3.0, *HOME[1:]), 2.0, 0.03, 2000.0))
    assert np.abs(r.speeds()).max() <= pi * (1.0 + 1e-5)


def test_arm_brakes_when_the_set_points_stay_away(recorder):
    r = recorder()
    for i in range(300):
        r.run(r.generator.servoj((0.6 * (i + 1) * CYCLE, *HOME[1:]), CYCLE, 0.03, 2000.0))
    r.rest()
    assert np.abs(np.diff(r.speeds(), axis=0)).max() <= 40.0 * CYCLE * (1.0 + 1e-9)
    assert r.generator.q[0] < 0.36 + 0.6**2


def test_move_called_while_the_arm_moves_brakes_first(recorder):
    r = at_speed(recorder, (0.5, 0.0, 0.0, 0.0, 0.0, 0.0))
    target = (0.3, *HOME[1:])
    r.run(r.generator.movej(target))
    assert r.generator.q == target
    assert np.abs(np.diff(r.speeds(), axis=0)).max() <= 15.0 * CYCLE * (1.0 + 1e-6)


def test_power_cut_keeps_the_target_where_it_is(recorder):
    r = recorder()
    move = r.generator.movej((1.5, *HOME[1:]))
    r.step(times=300)
    q = r.generator.q
    r.generator.stop_at_once()
    assert r.generator.q == q
    assert r.generator.qd == STILL
    assert move.returned
    r.step(times=10)
    assert r.generator.q == q
    assert not r.generator.moving
