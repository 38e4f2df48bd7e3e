# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""A CB3 arm and one with PolyScope X: goals, settings, a stop and the recovery."""

import pytest
from waiting import wait_for

from ur_cartesian_driver.driver import ConnectionState
from ur_cartesian_driver.motion.geometry.pose import IDENTITY, Pose
from ur_cartesian_driver.motion.goal.goal import Goal, OutputKind, Waypoint
from ur_cartesian_driver.motion.state.io_signals import AnalogDomain
from ur_cartesian_driver.motion.state.rtde_state import RobotMode
from ur_cartesian_driver.sim.state.power_and_safety import SafetyEvent

pytestmark = [pytest.mark.slow, pytest.mark.acceptance, pytest.mark.exhaustive]

READY = 10.0
X_FROM_POWER_OFF = {'model': 'ur30', 'frequency': 125.0, 'power': 'off', 'unlock_delay': 0.0}
NOZZLE = Pose((0.01, -0.02, 0.08), (0.0, 0.6, 0.0, 0.8))


def there_and_back(driver, height):
    x, y, z = driver.state.actual_tcp_pose.position
    turned = driver.state.actual_tcp_pose.quaternion
    return Goal(
        waypoints=tuple(
            Waypoint(pose=Pose((x, y, z + dz), turned), time=time)
            for dz, time in ((height, 0.4), (0.0, 0.8))
        )
    )


@pytest.mark.parametrize(
    ('software', 'has_dashboard', 'has_force_sensor'),
    [
        pytest.param(
            '3.15.0.0',
            True,
            False,
            marks=pytest.mark.ur_sim(model='ur3', polyscope='3.15', unlock_delay=0.1),
        ),
        pytest.param(
            '10.8.0.0',
            False,
            True,
            marks=pytest.mark.ur_sim(
                model='ur30', polyscope='10.8', frequency=125.0, unlock_delay=0.0
            ),
        ),
    ],
)
def test_each_generation_does_all_that_it_can(
    make_driver, ur_sim, software, has_dashboard, has_force_sensor
):
    driver = make_driver()
    driver.wait_ready(READY)
    assert driver.status.polyscope_version == software
    assert driver.execute(there_and_back(driver, -0.02), timeout=READY).succeeded
    assert driver.set_tcp(NOZZLE).ok
    assert driver.execute(there_and_back(driver, 0.02), timeout=READY).succeeded
    for answer in (
        driver.set_tcp(IDENTITY),
        driver.set_payload(1.2, (0.0, 0.0, 0.03)),
        driver.set_digital_output(OutputKind.TOOL_DIGITAL, 1, True),
        driver.set_analog_output(0, 0.25, AnalogDomain.VOLTAGE),
        driver.set_speed_slider(0.8),
    ):
        assert answer.ok, answer.text
    assert driver.zero_ftsensor().ok == has_force_sensor
    assert driver.dashboard('robotmode').ok == has_dashboard
    if not has_dashboard:
        assert driver.dashboard('brake release').text == (
            'PolyScope X has no dashboard server, and its Robot API has this command from '
            f'software 10.11 on, but the robot runs {software}; call recover, or do it on the '
            'pendant.'
        )

    ur_sim.protective_stop()
    wait_for(lambda: driver.status.state is ConnectionState.STOPPED)
    answer = driver.recover(unlock_protective_stop=True)
    assert answer.ok, answer.text
    assert driver.execute(there_and_back(driver, -0.02), timeout=READY).succeeded


@pytest.mark.parametrize(
    'polyscope',
    [
        pytest.param(text, marks=pytest.mark.ur_sim(**X_FROM_POWER_OFF, polyscope=text))
        for text in ('10.11', '10.14')
    ],
)
def test_polyscope_x_works_from_power_off_to_recovery_without_a_person(
    make_driver, ur_sim, polyscope
):
    driver = make_driver()
    wait_for(lambda: driver.status.state is ConnectionState.CONNECTED)
    if polyscope == '10.14':
        wait_for(lambda: driver.status.serial_number == '20000000000')
        assert driver.dashboard('robotmode').text == 'POWER_OFF'
        assert driver.dashboard('is in remote control').text == 'true'
    answer = driver.recover(unlock_protective_stop=True)
    assert answer.ok, answer.text
    for step in 'switch the arm on', 'release the brakes', 'send the robot program':
        assert step in answer.text
    assert driver.execute(there_and_back(driver, -0.02), timeout=READY).succeeded

    ur_sim.protective_stop()
    wait_for(lambda: driver.status.state is ConnectionState.STOPPED)
    answer = driver.recover(unlock_protective_stop=True)
    assert answer.ok, answer.text
    assert 'unlock the protective stop' in answer.text
    assert driver.execute(there_and_back(driver, 0.02), timeout=READY).succeeded

    ur_sim.call(lambda controller: controller.safety_event(SafetyEvent.VIOLATION))
    wait_for(lambda: driver.status.state is ConnectionState.STOPPED)
    answer = driver.recover(unlock_protective_stop=True)
    assert answer.ok, answer.text
    assert 'restart the safety system' in answer.text
    assert driver.execute(there_and_back(driver, -0.02), timeout=READY).succeeded


@pytest.mark.ur_sim(**X_FROM_POWER_OFF, polyscope='10.12', remote_control=False)
def test_polyscope_x_in_local_control_leaves_it_to_a_person(make_driver, ur_sim):
    driver = make_driver()
    wait_for(lambda: driver.status.state is ConnectionState.CONNECTED)
    for answer in driver.dashboard('power on'), driver.recover(unlock_protective_stop=True):
        assert not answer.ok
        assert 'in local control: switch it to remote control' in answer.text
    assert ur_sim.state().robot_mode is RobotMode.POWER_OFF
