# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Inputs, outputs, payload and slider by the UR driver's names; the simulator is the judge."""

from types import SimpleNamespace
from typing import Any

from builtin_interfaces.msg import Duration
import pytest

from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.kinematics.robot_models import robot_model
from ur_cartesian_driver.ros.ur_driver_names.io_services import IO_SERVICES
from ur_cartesian_driver.ros.ur_driver_names.offered_name import Service
from ur_cartesian_driver.sim import HOME

pytestmark = pytest.mark.slow

IO_STATES = '/io_and_status_controller/io_states', 'ur_msgs/msg/IOStates'
#: Height of the TCP of the simulated robot at its start [m].
HEIGHT = Arm(robot_model('ur5e')).forward(HOME).position[2]
#: SetIO: FUN_SET_DIGITAL_OUT, FUN_SET_FLAG, FUN_SET_ANALOG_OUT, FUN_SET_TOOL_VOLTAGE.
DIGITAL, FLAG, ANALOG, TOOL_VOLTAGE = 1, 2, 3, 4


def test_each_digital_output_is_switched_and_seen(ur):
    states = ur.listen(*IO_STATES)
    for pin in range(18):
        for level in (1.0, 0.0):
            assert ur.io('set_io', 'SetIO', fun=DIGITAL, pin=pin, state=level).success
            ur.cell.spin_until(
                lambda pin=pin, level=level: (
                    states and states[-1].digital_out_states[pin].state is bool(level)
                )
            )
            on = [channel.pin for channel in states[-1].digital_out_states if channel.state]
            assert on == ([pin] if level else [])
    assert [channel.pin for channel in states[-1].digital_in_states] == list(range(18))


def test_a_late_subscriber_gets_the_states(ur):
    ur.io('set_io', 'SetIO', fun=DIGITAL, pin=3, state=1.0)
    states = ur.listen(*IO_STATES)
    ur.cell.spin_until(lambda: states and states[-1].digital_out_states[3].state)


@pytest.mark.parametrize(('domain', 'value'), [(1, 2.5), (0, 0.008)])
def test_analog_outputs_take_a_fraction_of_their_range(ur, domain, value):
    from ur_msgs.msg import Analog

    states = ur.listen(*IO_STATES)
    for pin in (0, 1):
        data = Analog(pin=pin, domain=domain, state=0.25)
        assert ur.io('set_analog_output', 'SetAnalogOutput', data=data).success
        ur.cell.spin_until(
            lambda pin=pin: (
                states
                and states[-1].analog_out_states[pin].domain == domain
                and states[-1].analog_out_states[pin].state == pytest.approx(value)
            )
        )
        # SetIO keeps the domain, as a setting of the pendant.
        assert ur.io('set_io', 'SetIO', fun=ANALOG, pin=pin, state=0.5).success
        ur.cell.spin_until(
            lambda pin=pin: (
                states[-1].analog_out_states[pin].domain == domain
                and states[-1].analog_out_states[pin].state
                == pytest.approx(5.0 if domain else 0.012)
            )
        )


@pytest.mark.parametrize(
    'fields',
    [
        {'fun': DIGITAL, 'pin': 18, 'state': 1.0},
        {'fun': DIGITAL, 'pin': -1, 'state': 1.0},
        {'fun': ANALOG, 'pin': 2, 'state': 0.5},
        {'fun': ANALOG, 'pin': 0, 'state': 1.5},
        {'fun': FLAG, 'pin': 0, 'state': 1.0},
        {'fun': TOOL_VOLTAGE, 'state': 5.0},
        {'fun': TOOL_VOLTAGE, 'state': 12.0},  # allow_scripts is false
    ],
)
def test_what_is_not_set_is_no_success(ur, fields, capfd):
    assert not ur.io('set_io', 'SetIO', **fields).success
    assert 'io_and_status_controller/set_io: ' in capfd.readouterr().err


def test_the_voltage_of_the_tool_is_set_where_scripts_are_allowed(make_ur):
    ur = make_ur(allow_scripts=True)
    ur.cell.wait_ready()
    tool = ur.listen('/io_and_status_controller/tool_data', 'ur_msgs/msg/ToolDataMsg')
    for voltage in (24, 12, 0):
        assert ur.io('set_io', 'SetIO', fun=TOOL_VOLTAGE, state=float(voltage)).success
        ur.cell.spin_until(lambda v=voltage: tool and tool[-1].tool_output_voltage == v)


def test_the_payload_is_a_mass_and_its_centre(ur):
    from geometry_msgs.msg import Vector3

    centre = Vector3(x=0.01, y=-0.02, z=0.05)
    assert ur.io('set_payload', 'SetPayload', mass=1.25, center_of_gravity=centre).success
    payload = ur.cell.sim.call(lambda controller: controller.payload)
    assert payload.mass == pytest.approx(1.25)
    assert payload.cog == pytest.approx((0.01, -0.02, 0.05))
    assert not ur.io('set_payload', 'SetPayload', mass=-1.0, center_of_gravity=centre).success


def test_a_newer_definition_has_an_inertia_and_a_transition():
    from geometry_msgs.msg import Inertia, Vector3

    services = [row for row in IO_SERVICES if isinstance(row, Service)]
    (row,) = [row for row in services if row.name.endswith('set_payload')]
    sent = []
    driver: Any = SimpleNamespace(call=lambda kind, name, request: sent.append(request))
    load = Inertia(m=1.5, com=Vector3(z=0.04), ixx=0.1, iyy=0.2, izz=0.3, ixy=0.01)
    for time in (2.5, Duration(sec=2, nanosec=500_000_000)):
        row.call(row, driver, SimpleNamespace(payload=load, transition_time=time))
    for request in sent:
        assert (request.mass, request.center_of_gravity.z) == (1.5, 0.04)
        assert list(request.inertia) == [0.1, 0.2, 0.3, 0.01, 0.0, 0.0]
        assert request.transition_time == 2.5
    assert len(sent) == 2


@pytest.mark.parametrize(
    ('frame', 'down', 'up'),
    [
        ('base', (1.0, 2.0, -9.0), (-1.0, -2.0, 9.0)),
        ('base_link', (1.0, 2.0, -9.0), (1.0, 2.0, 9.0)),
    ],
)
def test_gravity_points_down_in_the_frame_of_the_request(ur, frame, down, up):
    from geometry_msgs.msg import Vector3, Vector3Stamped
    from std_msgs.msg import Header

    gravity = Vector3Stamped(
        header=Header(frame_id=frame), vector=Vector3(**dict(zip('xyz', down, strict=True)))
    )
    assert ur.io('set_gravity', 'SetGravity', gravity=gravity).success
    assert ur.cell.sim.call(lambda controller: controller.gravity) == pytest.approx(up)
    gravity.header.frame_id = 'table'
    answer = ur.io('set_gravity', 'SetGravity', gravity=gravity)
    assert (answer.success, "'table'" in answer.status) == (False, True)


@pytest.mark.parametrize('service', ['set_speed_slider', 'set_speed_slider_fraction'])
def test_the_speed_slider_is_a_fraction_and_never_0(ur, service):
    kind = 'SetSpeedSliderFraction'
    assert ur.io(service, kind, speed_slider_fraction=0.4).success
    assert ur.cell.sim.state().speed_slider == pytest.approx(0.4)
    for wrong in (0.0, 0.009, 1.01):
        assert not ur.io(service, kind, speed_slider_fraction=wrong).success
    assert ur.cell.sim.state().speed_slider == pytest.approx(0.4)


@pytest.mark.parametrize(
    'sim', [{'contacts': [f'plane 0 0 {HEIGHT + 0.001} 0 0 1']}], indirect=True
)
def test_the_force_sensor_is_zeroed(ur):
    def force():
        return ur.cell.sim.call(lambda controller: controller.contact.measured[2])

    assert force() == pytest.approx(10.0)
    assert ur.io('zero_ftsensor').success
    ur.cell.spin_until(lambda: abs(force()) < 0.1)


@pytest.mark.parametrize(
    ('release', 'frame'), [('jazzy', 'tool0'), ('lyrical', 'tool0_controller')]
)
def test_the_frame_of_the_wrench_is_that_of_the_release(make_ur, release, frame):
    ur = make_ur({'release': release}, tf_prefix='left_')
    ur.cell.wait_ready()
    for name in ('wrench', 'ft_data'):
        wrenches = ur.listen(
            f'/force_torque_sensor_broadcaster/{name}', 'geometry_msgs/msg/WrenchStamped'
        )
        ur.cell.spin_until(lambda wrenches=wrenches: wrenches)
        assert wrenches[-1].header.frame_id == f'left_{frame}'


def test_the_pose_of_the_tcp_is_in_the_base(ur):
    poses = ur.listen('/tcp_pose_broadcaster/pose', 'geometry_msgs/msg/PoseStamped')
    ur.cell.spin_until(lambda: poses)
    position = poses[-1].pose.position
    assert poses[-1].header.frame_id == 'base'
    assert (position.x, position.y, position.z) == pytest.approx(ur.cell.T_base_tcp.position)


def test_the_software_version_is_in_numbers(ur):
    version = ur.call(
        '/ur_configuration_controller/get_robot_software_version',
        'ur_msgs/srv/GetRobotSoftwareVersion',
    )
    assert (version.major, version.minor) == ur.cell.sim.config.version[:2]
