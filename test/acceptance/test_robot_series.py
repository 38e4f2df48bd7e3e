# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""A CB3 arm and one with PolyScope X: goals, settings, a stop and the recovery."""

import pytest
from waiting import wait_for

from ur_cartesian_driver.driver import ConnectionState
from ur_cartesian_driver.motion.goal import Goal, OutputKind, Waypoint
from ur_cartesian_driver.motion.io_signals import AnalogDomain
from ur_cartesian_driver.motion.pose import IDENTITY, Pose

pytestmark = [pytest.mark.slow, pytest.mark.acceptance]

READY = 10.0
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
            'PolyScope X has no dashboard server, so this service is not available with software '
            f'{software}; call recover, or do it on the pendant.'
        )

    ur_sim.protective_stop()
    wait_for(lambda: driver.status.state is ConnectionState.STOPPED)
    answer = driver.recover()
    assert answer.ok, answer.text
    assert driver.execute(there_and_back(driver, -0.02), timeout=READY).succeeded
