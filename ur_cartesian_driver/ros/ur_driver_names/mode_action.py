# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The action ``ur_robot_state_helper/set_mode``: power, brakes and program, in one goal.

Each goal has a thread, which waits for the driver's answers; the executor stays free.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
import threading
import traceback
from typing import Any

from rcl_interfaces.srv import GetParameters
from rclpy.action.server import CancelResponse, GoalResponse
from rclpy.callback_groups import ReentrantCallbackGroup
from std_srvs.srv import Trigger

from ur_cartesian_driver.motion.state.rtde_state import MOVABLE_SAFETY_MODES, RobotMode, SafetyMode
from ur_cartesian_driver.msg import DriverStatus
from ur_cartesian_driver.ros.goals.deferred_action_server import DeferredActionServer, end_goal
from ur_cartesian_driver.ros.message_fields import Message
from ur_cartesian_driver.ros.ur_driver_names.driver_node import DriverNode, DriverSilent
from ur_cartesian_driver.ros.ur_driver_names.names_settings import NamesSettings
from ur_cartesian_driver.ros.ur_driver_names.offered_name import Served, UrName

#: How long the arm may take to reach the target mode after the last command [s].
MODE_TIMEOUT = 30.0
#: The modes that a goal may have.
TARGETS = (RobotMode.POWER_OFF, RobotMode.IDLE, RobotMode.RUNNING)
#: The dashboard's commands from one mode to another. The brakes cannot be engaged directly, so
#: the way from RUNNING to IDLE leads through POWER_OFF.
COMMANDS: dict[tuple[RobotMode, RobotMode], tuple[str, ...]] = {
    (RobotMode.POWER_OFF, RobotMode.IDLE): ('power_on',),
    (RobotMode.POWER_OFF, RobotMode.RUNNING): ('brake_release',),
    (RobotMode.IDLE, RobotMode.POWER_OFF): ('power_off',),
    (RobotMode.IDLE, RobotMode.RUNNING): ('brake_release',),
    (RobotMode.RUNNING, RobotMode.POWER_OFF): ('power_off',),
    (RobotMode.RUNNING, RobotMode.IDLE): ('power_off', 'power_on'),
}


class _Ended(Exception):
    """A goal ends without success; the text says why."""


class _ModeServer:
    """Serves one goal at a time."""

    def __init__(
        self, row: UrName, driver: DriverNode, settings: NamesSettings, action: Any
    ) -> None:
        self._name, self._driver, self._settings, self._action = row.name, driver, settings, action
        self._run: ModeRun | None = None
        self._reported: tuple[int, int] | None = None
        self._server = DeferredActionServer(  # type: ignore[no-untyped-call]  # rclpy's
            driver.node,
            action,
            row.name,
            self._begin,
            callback_group=ReentrantCallbackGroup(),
            goal_callback=self._judge,
            cancel_callback=self._cancel,
        )
        driver.on_status(self._take)

    def close(self) -> None:
        """End the goal that runs, and stop serving."""
        if self._run is not None:
            self._run.stop()
            self._run.thread.join()
        self._server.destroy()

    def _judge(self, goal: Message) -> GoalResponse:
        if not self._driver.is_reporting:
            reason = 'the mode of the robot is not known; connect the driver to the robot'
        elif self._run is not None:
            reason = 'another goal changes the mode'
        else:
            return GoalResponse.ACCEPT
        self._driver.warn(f'{self._name}: goal rejected: {reason}.')
        return GoalResponse.REJECT

    def _begin(self, handle: Any) -> None:
        finish = partial(self._finish, handle)
        self._run, self._reported = ModeRun(handle, self._driver, self._settings, finish), None
        self._run.thread.start()

    def _cancel(self, handle: Any) -> CancelResponse:
        if self._run is not None:
            self._run.stop()
        return CancelResponse.ACCEPT

    def _finish(self, handle: Any, success: bool, text: str) -> None:
        """Hand the outcome to the executor; called in the thread of the run."""

        def end(handle: Any) -> Message:
            self._run = None
            succeeded = success and not handle.is_cancel_requested
            end_goal(handle, succeeded=succeeded)
            return self._action.Result(success=succeeded, message=text)

        self._server.finish(handle, end)

    def _take(self, status: DriverStatus) -> None:
        """Tell the run that there is a new status, and its client if a mode has changed."""
        run, modes = self._run, (status.robot_mode, status.safety_mode)
        if run is None:
            return
        run.look()
        if modes != self._reported:
            self._reported = modes
            robot, safety = modes
            run.handle.publish_feedback(
                self._action.Feedback(current_robot_mode=robot, current_safety_mode=safety)
            )


class ModeRun:
    """The run of one goal, in a thread of its own."""

    def __init__(
        self,
        handle: Any,
        driver: DriverNode,
        settings: NamesSettings,
        finish: Callable[[bool, str], None],
    ) -> None:
        self.handle, self._driver, self._settings, self._finish = handle, driver, settings, finish
        self._changed = threading.Condition()
        self._is_stopped = False
        self.thread = threading.Thread(target=self._execute, name='set_mode', daemon=True)

    def stop(self) -> None:
        """End the run before its next step."""
        with self._changed:
            self._is_stopped = True
            self._changed.notify_all()

    def look(self) -> None:
        """Wake the thread of the run, to look at a new status or answer."""
        with self._changed:
            self._changed.notify_all()

    def _execute(self) -> None:
        try:
            self._finish(True, self._go())
        except (_Ended, DriverSilent) as error:
            self._finish(False, str(error))
        except Exception as error:  # a goal without a result would block all later ones
            self._driver.warn(traceback.format_exc())
            self._finish(False, f'A defect of set_mode: {type(error).__name__}: {error}.')

    def _go(self) -> str:
        """
        Bring the robot to the target mode.

        :raises _Ended: the mode cannot be reached.
        """
        goal = self.handle.request
        target = _target(goal.target_robot_mode)
        if goal.stop_program and self._status.program_running:
            self._do('dashboard/stop')
            self._wait(lambda: not self._status.program_running, 'The program has not ended')
        if self._mode is not target or self._safety not in MOVABLE_SAFETY_MODES:
            self._recover()
            self._change_mode(target)
        if target is RobotMode.RUNNING and goal.play_program:
            self._play()
        return f'The robot is {target.name}.'

    @property
    def _status(self) -> DriverStatus:
        status = self._driver.status
        if status is None or not self._driver.is_reporting:
            raise _Ended('The driver does not report the mode of the robot any more.')
        return status

    @property
    def _mode(self) -> RobotMode:
        return RobotMode(self._status.robot_mode)

    @property
    def _safety(self) -> SafetyMode:
        return SafetyMode(self._status.safety_mode)

    def _recover(self) -> None:
        """Leave a stop of the safety system, as far as software may."""
        safety = self._safety
        if safety in MOVABLE_SAFETY_MODES:
            return
        if safety in (SafetyMode.VIOLATION, SafetyMode.FAULT):
            self._do('dashboard/restart_safety')
        elif safety is not SafetyMode.PROTECTIVE_STOP:
            raise _Ended(
                f'The safety system is in mode {safety.name}: a person has to release it.'
            )
        elif not self._settings.unlock_protective_stop:
            raise _Ended(
                'The robot is in a protective stop, which a person has to look at. Unlock it on '
                'the pendant or by dashboard_client/unlock_protective_stop; set_mode does so only '
                'if unlock_protective_stop is true.'
            )
        else:
            self._do('dashboard/unlock_protective_stop')
        self._wait(
            lambda: self._safety in MOVABLE_SAFETY_MODES, 'The safety system is not released'
        )

    def _change_mode(self, target: RobotMode) -> None:
        mode = self._mode
        if mode is target:
            return
        commands = COMMANDS.get((mode, target))
        if commands is None:
            raise _Ended(
                f'The robot is in mode {mode.name}, which set_mode cannot leave; '
                'wait, or look at the pendant.'
            )
        for command in commands:
            self._do(f'dashboard/{command}')
        self._wait(lambda: self._mode is target, f'The robot is not {target.name}')

    def _play(self) -> None:
        """Start the robot program: in headless mode ours, else the loaded one."""
        if self._status.program_running:
            return
        request = GetParameters.Request(names=['headless_mode'])
        values = self._driver.request(GetParameters, 'get_parameters', request).result().values
        headless = bool(values and values[0].bool_value)
        self._do('resend_robot_program' if headless else 'dashboard/play')

    def _do(self, service: str) -> None:
        """
        Call a service of the driver, and wait for its answer.

        :raises _Ended: the service failed, or the goal was cancelled.
        """
        self._check()
        answer = self._driver.call(Trigger, service, Trigger.Request())
        answer.add_done_callback(lambda done: self.look())
        with self._changed:
            self._changed.wait_for(lambda: self._is_stopped or answer.done())
        self._check()
        if not answer.result().ok:
            raise _Ended(answer.result().text)

    def _wait(self, is_reached: Callable[[], bool], problem: str) -> None:
        with self._changed:
            reached = self._changed.wait_for(
                lambda: self._is_stopped or is_reached(), MODE_TIMEOUT
            )
        self._check()
        if not reached:
            raise _Ended(f'{problem} after {MODE_TIMEOUT:g} s.')

    def _check(self) -> None:
        if self._is_stopped:
            raise _Ended('The goal was cancelled.')


def _target(number: int) -> RobotMode:
    for mode in TARGETS:
        if mode == number:
            return mode
    allowed = ', '.join(f'{mode.name} ({mode})' for mode in TARGETS)
    raise _Ended(f'target_robot_mode is {number}, but must be one of {allowed}.')


MODE_ACTION = Served(
    kind='action',
    name='ur_robot_state_helper/set_mode',
    type='ur_dashboard_msgs/action/SetMode',
    source='dashboard/*, resend_robot_program',
    server=_ModeServer,
)
