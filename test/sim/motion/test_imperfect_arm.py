# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""An imperfect arm follows its targets, rings and rests as recorded arms do."""

from dataclasses import replace

import numpy as np
import pytest

from ur_cartesian_driver.kinematics.robot_models import robot_model
from ur_cartesian_driver.protocol.rtde.rtde_client import DataReceived, RtdeClientCodec
from ur_cartesian_driver.sim import SimulatorConfig
from ur_cartesian_driver.sim.controller_assembly import assemble
from ur_cartesian_driver.sim.interfaces.rtde_session import RtdeSession
from ur_cartesian_driver.sim.motion.imperfect_arm import typical_imperfections
from ur_cartesian_driver.sim.rtde_output_values import output_getter

#: The models of the recordings, and speeds [rad/s] with the largest error at them [rad].
RECORDED_ERRORS = [
    ('ur5e', 0.5, 0.0005),
    ('ur3', 0.8, 0.001),
    ('ur3', 2.7, 0.0036),
    ('ur10', 0.3, 0.00048),
]
NOISE = 0.00017


class Trace:
    """Targets and measurements of all cycles of a program."""

    def __init__(self, body, seconds, model='ur5e', frequency=None, **changes):
        imperfections = replace(typical_imperfections(robot_model(model)), **changes)
        self.controller = assemble(
            SimulatorConfig(model=model, frequency=frequency, imperfections=imperfections)
        ).controller
        self.controller.programs.submit(f'def test():\n  {body}\nend\n')
        rows = []
        for _ in range(round(seconds / self.controller.cycle)):
            self.controller.step()
            motion, actual = self.controller.motion, self.controller.actual
            rows.append((motion.q, actual.q, motion.qd, actual.qd))
        self.target, self.actual, self.target_qd, self.actual_qd = np.array(rows).swapaxes(0, 1)

    @property
    def stop(self):
        """The first cycle in which the target rests for good."""
        return int(np.flatnonzero(np.abs(self.target_qd).max(axis=1))[-1]) + 1

    def time_above(self, speed):
        """Return how long after the stop some joint is measured faster [s]."""
        fast = np.flatnonzero(np.abs(self.actual_qd).max(axis=1) > speed)
        return max(0, int(fast[-1]) + 1 - self.stop) * self.controller.cycle


@pytest.mark.parametrize(('model', 'speed', 'largest'), RECORDED_ERRORS)
def test_the_arm_follows_as_far_behind_as_recorded(model, speed, largest):
    trace = Trace(f'speedj([{speed}, 0, 0, 0, 0, 0], 4, 2)', 1.9, model)
    cruising = np.isclose(trace.target_qd[:, 0], speed)
    errors = (trace.target - trace.actual)[np.flatnonzero(cruising)[-50:], 0]
    assert 0.0003 * speed < errors.mean() < largest
    assert np.abs(errors - errors.mean()).max() < NOISE


def test_the_error_grows_with_the_acceleration():
    means = []
    for acceleration in (2.0, 4.0):
        trace = Trace(f'speedj([2, 0, 0, 0, 0, 0], {acceleration}, 1)', 0.4, friction=0.0, lag=0.0)
        means.append((trace.target - trace.actual)[100:, 0].mean())
    assert means[1] > 1.5 * means[0] > 1e-4


@pytest.mark.parametrize('deceleration', [1.4, 4.0])
@pytest.mark.parametrize('frequency', [None, 125.0])
def test_it_rings_after_a_stop_for_as_long_as_recorded_and_then_reads_zero(
    deceleration, frequency
):
    trace = Trace(
        f'speedj([1, 0, 0, 0, 0, 0], 4, 1)\n  stopj({deceleration})', 3.5, frequency=frequency
    )
    assert 0.06 < trace.time_above(1e-3) < 0.58
    assert trace.time_above(5e-3) < 0.31
    assert not trace.actual_qd[-100:].any()


@pytest.mark.parametrize(
    ('model', 'largest'), [('ur5e', 0.0001), ('ur3', 0.0001), ('ur10', 0.0004)]
)
def test_it_rests_beside_its_target_with_noise(model, largest):
    trace = Trace('movej([0.3, -1.2, 1.2, -1.5, -1.5, 0.3])\n  sleep(9)', 6.0, model)
    errors = (trace.actual - trace.target)[-100:]
    assert (np.ptp(errors, axis=0) >= 0.00004).all()
    assert (np.ptp(errors, axis=0) <= NOISE).all()
    assert 0.5 * largest < np.abs(errors.mean(axis=0)).max() < 1.1 * largest


def test_pose_and_speed_of_the_tool_are_those_of_the_measured_joints():
    controller = Trace('speedj([0.5, 0.2, 0, 0, 0.4, 0], 4, 9)', 1.0).controller
    actual, arm = controller.actual, controller.arm
    assert actual.T_base_tcp.position == pytest.approx(arm.forward(actual.q).position, abs=1e-12)
    assert actual.tcp_twist == pytest.approx(arm.jacobian(actual.q) @ actual.qd)
    assert actual.q != controller.motion.q


def test_the_seed_decides_and_the_targets_stay():
    body = 'movej([0.3, -1.2, 1.2, -1.5, -1.5, 0.3])'
    first, again, other = (Trace(body, 1.0, seed=seed) for seed in (1, 1, 2))
    assert (first.actual == again.actual).all()
    assert (first.actual != other.actual).any()
    assert (first.target == other.target).all()


def test_slow_cycles_are_no_reason_to_swing_up():
    trace = Trace('speedj([1, 0, 0, 0, 0, 0], 40, 1)\n  stopj(40)', 9.0, frequency=20.0)
    assert np.abs(trace.actual - trace.target).max() < 0.02
    assert not trace.actual_qd[-20:].any()


def test_currents_are_those_of_an_arm_that_holds_itself():
    trace = Trace('sleep(1)', 0.5)
    measured, target = (
        output_getter(name, None)(trace.controller)
        for name in ('actual_current', 'target_current')
    )
    assert max(map(abs, target)) > 1.0
    assert measured == pytest.approx(target, abs=0.031)
    assert measured != target
    trace.controller.power_off()
    assert not any(output_getter('actual_current', None)(trace.controller))


@pytest.mark.parametrize(('model', 'cycles', 'single'), [('ur5e', 6, 0.07), ('ur10', 5, 0.0)])
def test_packets_are_left_out_as_often_as_recorded(model, cycles, single):
    controller = Trace('sleep(1)', 0.1, model).controller
    session, client = RtdeSession(controller, set()), RtdeClientCodec(['timestamp'])
    client.feed(session.feed(client.start()))
    while not (packets := _packets(session, client, controller)):
        client.feed(session.feed(client.data_to_send()))
    for _ in range(20_000):
        packets += _packets(session, client, controller)
    gaps = np.round(np.diff(packets) / controller.cycle)
    assert gaps.max() == cycles
    assert np.mean(gaps == 1.0) == pytest.approx(1.0 - single, abs=0.01)
    assert 0.0 < np.mean(gaps > 2.0) < 0.005


def _packets(session, client, controller):
    """Return the time stamps of the packets of the next cycle."""
    controller.step()
    return [
        event.values[0]
        for package in session.packages()
        for event in client.feed(package)
        if isinstance(event, DataReceived)
    ]
