# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""SetMode: power, brakes and program, from every state."""

from types import SimpleNamespace
from typing import Any

from action_msgs.msg import GoalStatus
import pytest

from ur_cartesian_driver.motion.state.rtde_state import RobotMode, SafetyMode
from ur_cartesian_driver.msg import DriverStatus
from ur_cartesian_driver.ros.ur_driver_names import mode_action
from ur_cartesian_driver.ros.ur_driver_names.mode_action import ModeRun
from ur_cartesian_driver.ros.ur_driver_names.names_settings import NamesSettings

pytestmark = pytest.mark.slow

MODES = (RobotMode.POWER_OFF, RobotMode.IDLE, RobotMode.RUNNING)
SUCCEEDED, ABORTED = GoalStatus.STATUS_SUCCEEDED, GoalStatus.STATUS_ABORTED


class Helper:
    """The action, and the modes that the topics of the UR driver report."""

    def __init__(self, ur):
        from ur_driver_client import LATCHED

        self.ur = ur
        self.client = ur.action(
            '/ur_robot_state_helper/set_mode', 'ur_dashboard_msgs/action/SetMode'
        )
        io = '/io_and_status_controller'
        self.modes = ur.listen(f'{io}/robot_mode', 'ur_dashboard_msgs/msg/RobotMode', LATCHED)
        self.safety = ur.listen(f'{io}/safety_mode', 'ur_dashboard_msgs/msg/SafetyMode', LATCHED)
        self.running = ur.listen(f'{io}/robot_program_running', 'std_msgs/msg/Bool', LATCHED)
        ur.cell.spin_until(lambda: self.modes and self.running)

    def send(self, target, feedback=None, *, stop=False, play=False):
        goal = self.client._action_type.Goal(
            target_robot_mode=int(target), stop_program=stop, play_program=play
        )
        return self.ur.send(self.client, goal, feedback)

    def set(self, target, feedback=None, **flags):
        status, result = self.ur.result(self.send(target, feedback, **flags))
        assert result.success == (status == SUCCEEDED)
        return status, result.message

    def wait(self, mode):
        self.ur.cell.spin_until(lambda: self.modes[-1].mode == mode)

    def wait_for_safety(self, mode):
        self.ur.cell.spin_until(lambda: self.safety and self.safety[-1].mode == mode)


@pytest.fixture
def helper(ur):
    return Helper(ur)


@pytest.mark.parametrize('before', MODES)
@pytest.mark.parametrize('target', MODES)
def test_each_mode_is_reached_from_each(helper, before, target):
    status, message = helper.set(before, stop=True)
    assert status == SUCCEEDED, message
    feedback = []
    status, message = helper.set(target, feedback)
    assert status == SUCCEEDED, message
    assert helper.ur.cell.sim.state().robot_mode is target
    helper.wait(target)
    if before is not target:
        assert feedback[-1].current_robot_mode == target
        assert feedback[-1].current_safety_mode == SafetyMode.NORMAL


def test_the_robot_is_made_ready_with_its_program(helper):
    # The goal in the documentation of the UR driver's helper.
    helper.set(RobotMode.POWER_OFF, stop=True)
    helper.ur.cell.spin_until(lambda: not helper.running[-1].data)
    status, message = helper.set(RobotMode.RUNNING, stop=True, play=True)
    assert status == SUCCEEDED, message
    helper.ur.cell.spin_until(lambda: helper.running[-1].data)


def test_the_loaded_program_is_played_where_the_driver_sends_none(make_ur):
    ur = make_ur(headless_mode=False)
    helper = Helper(ur)
    ur.dashboard('load_program', 'Load', filename='weld.urp')
    status, message = helper.set(RobotMode.RUNNING, play=True)
    assert status == SUCCEEDED, message
    assert ur.dashboard('program_running', 'IsProgramRunning').program_running


def test_a_protective_stop_is_left_to_a_person(helper):
    helper.ur.cell.sim.protective_stop()
    helper.wait_for_safety(SafetyMode.PROTECTIVE_STOP)
    status, message = helper.set(RobotMode.RUNNING, stop=True)
    assert status == ABORTED
    assert 'only if unlock_protective_stop is true' in message
    assert helper.ur.cell.sim.state().safety_mode is SafetyMode.PROTECTIVE_STOP


@pytest.fixture
def stopped_helper(make_ur):
    """Return a helper that may unlock the protective stop in which the robot is."""
    ur = make_ur({'unlock_protective_stop': True})
    ur.cell.wait_ready()
    helper = Helper(ur)
    ur.cell.sim.protective_stop()
    helper.wait_for_safety(SafetyMode.PROTECTIVE_STOP)
    return helper


@pytest.mark.parametrize('sim', [{'unlock_delay': 0.0}], indirect=True)
def test_a_parameter_takes_the_responsibility_for_unlocking(stopped_helper):
    sim = stopped_helper.ur.cell.sim
    status, message = stopped_helper.set(RobotMode.RUNNING, stop=True)
    assert status == SUCCEEDED, message
    assert sim.state().safety_mode is SafetyMode.NORMAL
    status, message = stopped_helper.set(RobotMode.RUNNING, play=True)
    assert status == SUCCEEDED, message


@pytest.mark.parametrize('sim', [{'unlock_delay': 1e6}], indirect=True)
def test_a_robot_that_refuses_to_be_unlocked_yet_ends_the_goal(stopped_helper):
    status, message = stopped_helper.set(RobotMode.RUNNING, stop=True)
    assert status == ABORTED
    assert 'Wait until 5 s have passed since the stop' in message
    assert stopped_helper.ur.cell.sim.state().safety_mode is SafetyMode.PROTECTIVE_STOP


@pytest.mark.parametrize('fault', ['fault', 'violation'])
def test_the_safety_system_is_restarted(helper, fault):
    helper.ur.cell.sim.inject(fault)
    helper.wait_for_safety(SafetyMode[fault.upper()])
    status, message = helper.set(RobotMode.RUNNING)
    assert status == SUCCEEDED, message


def test_an_emergency_stop_is_left_to_a_person(helper):
    helper.ur.cell.sim.emergency_stop()
    helper.wait_for_safety(SafetyMode.ROBOT_EMERGENCY_STOP)
    status, message = helper.set(RobotMode.RUNNING)
    assert status == ABORTED
    assert 'ROBOT_EMERGENCY_STOP: a person' in message


@pytest.mark.parametrize('target', [RobotMode.POWER_ON, RobotMode.BOOTING, 42])
def test_other_modes_are_no_target(helper, target):
    status, message = helper.set(target)
    assert status == ABORTED
    assert message == (
        f'target_robot_mode is {int(target)}, but must be one of POWER_OFF (3), IDLE (5), '
        'RUNNING (7).'
    )


def test_a_second_goal_is_rejected(helper):
    helper.set(RobotMode.POWER_OFF, stop=True)
    first = helper.send(RobotMode.RUNNING)
    assert not helper.send(RobotMode.IDLE).accepted
    assert helper.ur.result(first)[0] == SUCCEEDED


def test_a_goal_is_cancelled(helper):
    helper.set(RobotMode.POWER_OFF, stop=True)
    handle = helper.send(RobotMode.RUNNING)
    helper.ur.cell.await_(handle.cancel_goal_async())
    status, result = helper.ur.result(handle)
    assert (status, result.success) == (GoalStatus.STATUS_CANCELED, False)


def test_a_cancel_during_the_last_step_ends_without_success(monkeypatch):
    class Goal:
        is_cancel_requested, state = True, ''

        def canceled(self):
            # As rclpy's: no cancel is pending any more.
            self.is_cancel_requested, self.state = False, 'canceled'

    results = []
    server = SimpleNamespace(finish=lambda goal, end: results.append(end(goal)))
    monkeypatch.setattr(mode_action, 'DeferredActionServer', lambda *_, **__: server)
    driver: Any = SimpleNamespace(node=None, on_status=lambda take: None)
    row: Any = SimpleNamespace(name='set_mode')
    action = SimpleNamespace(Result=SimpleNamespace)
    served = mode_action._ModeServer(row, driver, NamesSettings(), action)
    goal = Goal()
    served._finish(goal, True, 'reached')
    (result,) = results
    assert (goal.state, result.success) == ('canceled', False)


@pytest.mark.parametrize('mode', [mode for mode in RobotMode if mode not in MODES])
def test_out_of_other_modes_only_time_or_a_person_leads(mode):
    goal = SimpleNamespace(
        target_robot_mode=int(RobotMode.RUNNING), stop_program=False, play_program=False
    )
    status = DriverStatus(robot_mode=int(mode), safety_mode=int(SafetyMode.NORMAL))
    driver: Any = SimpleNamespace(status=status, is_reporting=True)
    ends = []
    run = ModeRun(
        SimpleNamespace(request=goal), driver, NamesSettings(), lambda *end: ends.append(end)
    )
    run.thread.start()
    run.thread.join(10.0)
    ((success, text),) = ends
    assert not success
    assert text.startswith(f'The robot is in mode {mode.name}, ')
