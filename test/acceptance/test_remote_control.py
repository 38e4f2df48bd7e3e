# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The key between local and remote control turns, and the driver goes on without a restart."""

import pytest
from waiting import wait_for

from ur_cartesian_driver.driver import ConnectionState
from ur_cartesian_driver.motion.geometry.pose import Pose
from ur_cartesian_driver.motion.goal.goal import Goal, Waypoint
from ur_cartesian_driver.motion.state.rtde_state import RuntimeState, SafetyMode
from ur_cartesian_driver.robot.services.service_calls import SendProgramCall

pytestmark = [pytest.mark.slow, pytest.mark.acceptance, pytest.mark.exhaustive]

READY = 10.0
#: How long nothing may happen by itself [s].
WATCHED = 0.5
FAST = {
    'frequency': 125.0,
    'unlock_delay': 0.3,
    'power_on_time': 0.05,
    'brake_release_time': 0.05,
}
ROBOTS = {
    'e-Series': {'model': 'ur5e'},
    'CB3': {'model': 'ur5', 'polyscope': '3.15'},
}


def on_robots(**settings):
    """Run a test with a robot of each series."""
    return pytest.mark.parametrize(
        'series',
        [
            pytest.param(name, marks=pytest.mark.ur_sim(**FAST, **robot, **settings))
            for name, robot in ROBOTS.items()
        ],
    )


def turn_key(ur_sim, *, remote):
    ur_sim.call(lambda controller: setattr(controller, 'remote_control', remote))


def stays_without_program(ur_sim):
    """Watch the robot for a while; tell whether no program was started."""
    end = ur_sim.state().timestamp + WATCHED
    wait_for(lambda: ur_sim.state().timestamp > end)
    return ur_sim.state().runtime_state is RuntimeState.STOPPED


def moves(driver, home):
    outcome = driver.execute(Goal(waypoints=(Waypoint(time=0.5, pose=home(z=0.01)),)))
    assert outcome.succeeded, outcome.text


def turn_local(driver, ur_sim):
    """Switch a robot that is READY to local control, and let an operator stop the program."""
    turn_key(ur_sim, remote=False)
    ur_sim.call(lambda controller: controller.programs.stop())
    wait_for(lambda: driver.status.state is ConnectionState.CONNECTED)


@on_robots(remote_control=False)
def test_local_remote_goal(make_driver, ur_sim, series):
    driver = make_driver()
    wait_for(lambda: 'read-only' in driver.status.last_error)
    turn_key(ur_sim, remote=True)
    assert stays_without_program(ur_sim)  # the key starts nothing
    assert driver.call(SendProgramCall()).result(READY).ok
    x, y, z = driver.state.actual_tcp_pose.position
    above = Pose((x, y, z + 0.01), driver.state.actual_tcp_pose.quaternion)
    assert driver.execute(Goal(waypoints=(Waypoint(time=0.5, pose=above),))).succeeded


@on_robots()
def test_remote_local_remote_goal(driver, ur_sim, home, series):
    moves(driver, home)
    turn_local(driver, ur_sim)
    assert not driver.call(SendProgramCall()).result(READY).ok
    turn_key(ur_sim, remote=True)
    assert stays_without_program(ur_sim)
    assert driver.call(SendProgramCall()).result(READY).ok
    moves(driver, home)


@on_robots()
def test_recovery_after_local_and_remote(driver, ur_sim, home, series):
    turn_local(driver, ur_sim)
    ur_sim.protective_stop()
    wait_for(lambda: driver.status.state is ConnectionState.STOPPED)
    turn_key(ur_sim, remote=True)
    assert stays_without_program(ur_sim)
    assert ur_sim.state().safety_mode is SafetyMode.PROTECTIVE_STOP
    answer = driver.recover(unlock_protective_stop=True)
    assert answer.ok, answer.text
    moves(driver, home)


@on_robots()
def test_the_key_is_turned_during_a_recovery(driver, ur_sim, home, series):
    ur_sim.protective_stop()
    wait_for(lambda: driver.status.state is ConnectionState.STOPPED)
    turn_key(ur_sim, remote=False)
    turn_key(ur_sim, remote=True)
    assert driver.recover(unlock_protective_stop=True).ok
    moves(driver, home)


@on_robots()
def test_a_motion_that_was_stopped_cannot_resume_where_the_connection_was_read_only(
    driver, ur_sim, home, series
):
    turn_key(ur_sim, remote=False)
    motion = driver.start(driver.plan(Goal(waypoints=(Waypoint(time=4.0, pose=home(z=0.1)),))))
    wait_for(lambda: max(map(abs, ur_sim.state().qd)) > 0.01)
    turn_key(ur_sim, remote=True)
    ur_sim.protective_stop()
    assert motion.result(5.0).code.name == 'PROTECTIVE_STOP'
    wait_for(lambda: ur_sim.state().runtime_state is RuntimeState.STOPPED)
    assert any('C210' in line for line in ur_sim.state().messages)
