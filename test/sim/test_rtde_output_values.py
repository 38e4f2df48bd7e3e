# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The meaning of RTDE outputs: laws between them, and the state behind them."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
from plain_clients import state_fields
import pytest

from ur_cartesian_driver.protocol.rtde.rtde_fields import DataType
from ur_cartesian_driver.sim.interfaces.primary_stream import PrimaryStream
from ur_cartesian_driver.sim.motion.imperfect_arm import Imperfections
from ur_cartesian_driver.sim.rtde_output_values import output_getter
from ur_cartesian_driver.sim.state.power_and_safety import SafetyEvent

#: All names with their types, from the manufacturer's client library.
NAMES = json.loads((Path(__file__).parent / 'golden' / 'rtde_outputs.json').read_text())


def read(bench, name):
    value = output_getter(name, DataType[NAMES[name]].zero)(bench.controller)
    return np.array(value) if isinstance(value, tuple) else value


@pytest.fixture
def moving(bench):
    """An arm with a tool and a load in the middle of a movement of all joints."""
    bench.start("""set_tcp(p[0.02, -0.03, 0.1, 0.1, 0.2, 0.3])
set_payload(3.0, [0.01, 0.02, 0.08])
movej([0.5, -1.0, 1.2, -0.8, -1.2, 0.6], a=2.0, v=1.0)""")
    bench.wait(0.4)
    return bench


@pytest.mark.parametrize(
    ('rate', 'of'),
    [
        ('elbow_velocity', lambda b: read(b, 'elbow_position')),
        ('target_TCP_speed', lambda b: read(b, 'target_TCP_pose')[:3]),
        ('actual_TCP_acceleration', lambda b: read(b, 'actual_TCP_speed')),
        ('target_TCP_acceleration', lambda b: read(b, 'target_TCP_speed')),
    ],
)
def test_a_rate_is_the_difference_of_what_it_is_the_rate_of(moving, rate, of):
    cycle = moving.controller.cycle
    before = of(moving)
    moving.step()
    middle, rate_then = of(moving), read(moving, rate)[: len(before)]
    moving.step()
    # The speeds are those over the cycle before, so the middle of two differences fits them best.
    assert rate_then == pytest.approx((middle - before) / cycle, abs=0.02)
    assert np.linalg.norm(rate_then) > 0.05


def test_moments_do_the_work_that_the_load_takes(moving):
    """Power at the joints = change of kinetic and potential energy of a point mass."""
    mass, cog, cycle = 3.0, np.array([0.01, 0.02, 0.08]), moving.controller.cycle

    def centre():
        flange = moving.controller.arm.forward(moving.controller.motion.q).matrix()
        return flange[:3, :3] @ cog + flange[:3, 3]

    places = [centre()]
    for _ in range(2):
        moving.step()
        places.append(centre())
    power = float(read(moving, 'target_moment') @ read(moving, 'target_qd'))
    speeds = np.diff(places, axis=0) / cycle
    acceleration = (speeds[1] - speeds[0]) / cycle
    assert power == pytest.approx(
        mass * (acceleration + np.array((0.0, 0.0, 9.82))) @ speeds[1], rel=0.02, abs=0.02
    )
    assert abs(power) > 1.0


def test_an_arm_at_rest_carries_the_weight_of_its_load(bench):
    bench.run('set_payload(2.0)')
    q = bench.controller.motion.q
    jacobian = bench.controller.arm.jacobian(q)
    assert read(bench, 'target_moment') == pytest.approx(
        jacobian[:3].T @ [0.0, 0.0, 2.0 * 9.82], abs=1e-9
    )
    bench.run('powerdown()')
    assert read(bench, 'target_moment') == pytest.approx(np.zeros(6))


@pytest.mark.parametrize(
    'q', [(0.0, -1.5, 1.5, -1.5, -1.5, 0.0), (1.0, -1.0, 0.5, 0.3, 0.7, -2.0)]
)
def test_the_accelerometer_of_an_arm_at_rest_feels_the_weight_in_the_axes_of_the_flange(
    make_bench, q
):
    bench = make_bench(q=q)
    rotation = bench.controller.arm.forward(q).matrix()[:3, :3]
    assert read(bench, 'actual_tool_accelerometer') == pytest.approx(
        rotation.T @ [0.0, 0.0, 9.82], abs=1e-9
    )


@pytest.mark.parametrize(
    ('command', 'joints', 'tool', 'volts'),
    [
        (lambda c: None, 239, 239, 0.0),
        (lambda c: c.power_on(), 255, 253, 48.0),
        (lambda c: c.release_brakes(), 253, 253, 48.0),
        (
            lambda c: (c.release_brakes(), c.safety_event(SafetyEvent.EMERGENCY_STOP)),
            239,
            239,
            0.0,
        ),
    ],
)
def test_modes_and_voltages_follow_the_power(make_bench, command, joints, tool, volts):
    bench = make_bench(power='off')
    command(bench.controller)
    bench.wait(2.0)
    assert set(read(bench, 'joint_mode')) == {joints}
    assert read(bench, 'tool_mode') == tool
    assert set(read(bench, 'actual_joint_voltage')) == {volts}
    assert read(bench, 'actual_robot_voltage') == volts


def test_a_new_robot_has_inputs_in_volts_and_outputs_at_4_milliamperes(bench):
    # As in the state of a UR5e of URSim 5.8 that the manufacturer's library has recorded.
    assert read(bench, 'analog_io_types') == read(bench, 'tool_analog_input_types') == 0b11
    assert read(bench, 'standard_analog_output1') == 0.004


@pytest.mark.parametrize(
    'command', [lambda c: None, lambda c: c.power_on(), lambda c: c.release_brakes()]
)
def test_the_primary_interface_reports_the_joints_as_rtde_does(make_bench, command):
    bench = make_bench(power='off', imperfections=Imperfections())
    command(bench.controller)
    bench.wait(2.0)
    primary = state_fields(PrimaryStream(bench.controller).state()[5:])
    for field, output in {
        'q': 'actual_q',
        'amperes': 'actual_current',
        'volts': 'actual_joint_voltage',
        'celsius': 'joint_temperatures',
        'joint_modes': 'joint_mode',
    }.items():
        assert primary[field] == pytest.approx(read(bench, output)), field


def test_what_programs_and_people_set_is_reported(bench):
    bench.run("""set_payload(1.5, [0.1, 0.2, 0.3])
set_tcp(p[0, 0, 0.2, 0, 0, 0])
set_gravity([0, 9.82, 0])
set_standard_digital_out(3, True)
set_configurable_digital_out(1, True)
set_tool_digital_out(1, True)
set_standard_analog_out(0, 0.25)
set_analog_outputdomain(1, 1)
set_standard_analog_out(1, 0.25)
set_tool_voltage(24)
write_output_float_register(7, 0.5)
write_output_boolean_register(33, True)""")
    bench.controller.set_slider(0.3)
    bench.step()
    for name, value in {
        'payload': 1.5,
        'payload_cog': [0.1, 0.2, 0.3],
        'tcp_offset': [0, 0, 0.2, 0, 0, 0],
        'target_gravity': [0, 9.82, 0],
        'actual_digital_output_bits': 1 << 3 | 1 << 9 | 1 << 17,
        'actual_configurable_digital_output_bits': 0b10,
        'standard_analog_output0': 0.008,
        'standard_analog_output1': 2.5,
        'analog_io_types': 0b1011,
        'tool_output_voltage': 24,
        'output_double_register_7': 0.5,
        'output_bit_registers32_to_63': 0b10,
        'target_speed_fraction': 0.3,
        'speed_scaling': 0.0,
    }.items():
        assert read(bench, name) == pytest.approx(value), name
