# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The topics that command the robot: scripts, and freedrive."""

from __future__ import annotations

from concurrent.futures import Future
from dataclasses import dataclass
from typing import Any

from rclpy.clock import Clock
from rclpy.clock_type import ClockType
from std_srvs.srv import SetBool

from ur_cartesian_driver.robot.services.service_calls import ServiceAnswer
from ur_cartesian_driver.ros.message_fields import Message
from ur_cartesian_driver.ros.topics import STATE_QOS
from ur_cartesian_driver.ros.ur_driver_names.driver_node import DriverNode
from ur_cartesian_driver.ros.ur_driver_names.names_settings import NamesSettings
from ur_cartesian_driver.ros.ur_driver_names.offered_name import UrName
from ur_cartesian_driver.srv import RunScript


@dataclass(frozen=True, slots=True, kw_only=True)
class ScriptTopic(UrName):
    """Scripts for the robot, which the driver runs where ``allow_scripts`` lets it."""

    kind: str = 'subscribed topic'
    name: str = 'urscript_interface/script_command'
    type: str = 'std_msgs/msg/String'

    @property
    def served_by(self) -> str:
        """The driver's service."""
        return '`~/run_script`'

    def offer(self, driver: DriverNode, settings: NamesSettings, kind: Any) -> object:
        """Run each script that comes; what goes wrong is logged."""
        driver.client(RunScript, 'run_script')

        def report(done: Future[ServiceAnswer]) -> None:
            if not done.result().ok:
                driver.warn(f'{self.name}: {done.result().text}')

        def run(message: Message) -> None:
            request = RunScript.Request(script=message.data)
            driver.call(RunScript, 'run_script', request).add_done_callback(report)

        return driver.node.create_subscription(kind, self.name, run, STATE_QOS)


@dataclass(frozen=True, slots=True, kw_only=True)
class FreedriveTopic(UrName):
    """Freedrive, as long as messages ask for it."""

    kind: str = 'subscribed topic'
    name: str = 'freedrive_mode_controller/enable_freedrive_mode'
    type: str = 'std_msgs/msg/Bool'

    @property
    def served_by(self) -> str:
        """The driver's service."""
        return '`~/freedrive_mode`'

    def offer(self, driver: DriverNode, settings: NamesSettings, kind: Any) -> object:
        """Listen to the requests."""
        driver.client(SetBool, 'freedrive_mode')
        switch = _FreedriveSwitch(self.name, driver, settings.freedrive_timeout)
        return driver.node.create_subscription(kind, self.name, switch.take, STATE_QOS)


class _FreedriveSwitch:
    """
    Switches freedrive with the messages, and off when they stop.

    One call at a time: while it still switches off, the driver would answer 'on' with success.
    'Off' is repeated until the driver confirms it.
    """

    def __init__(self, name: str, driver: DriverNode, timeout: float) -> None:
        self._name, self._driver = name, driver
        self._is_wanted = self._is_calling = False
        #: What the driver has confirmed; None = unknown.
        self._confirmed: bool | None = False
        self._watchdog = driver.node.create_timer(
            timeout, self._late, clock=Clock(clock_type=ClockType.STEADY_TIME)
        )
        self._watchdog.cancel()
        driver.on_close(self._end)

    def take(self, message: Message) -> None:
        """Take a request."""
        if message.data:
            self._watchdog.reset()
            self._confirmed = None  # a stop of the program ends freedrive
        else:
            self._watchdog.cancel()
        self._is_wanted = message.data
        self._follow()

    def _end(self) -> None:
        """Switch freedrive off, because nobody is left who could."""
        if self._is_wanted or self._confirmed is not False:
            self._driver.call(SetBool, 'freedrive_mode', SetBool.Request(data=False))

    def _late(self) -> None:
        self._watchdog.cancel()
        if self._is_wanted:
            self._driver.warn(f'{self._name}: no message for too long, freedrive ends.')
        self._is_wanted = False
        self._follow()

    def _follow(self) -> None:
        """Make the driver do what is wanted, unless a request is pending."""
        on = self._is_wanted
        if self._is_calling or on == self._confirmed:
            return
        self._is_calling = True
        answer = self._driver.call(SetBool, 'freedrive_mode', SetBool.Request(data=on))
        answer.add_done_callback(lambda done: self._switched(on, done.result()))

    def _switched(self, on: bool, answer: ServiceAnswer) -> None:
        self._is_calling = False
        self._confirmed = on if answer.ok else None
        if not answer.ok:
            self._driver.warn(f'{self._name}: {answer.text}')
            if not self._is_wanted and not on:
                self._watchdog.reset()  # it tries again
        if self._is_wanted is not on:
            self._follow()


COMMAND_TOPICS: tuple[UrName, ...] = (ScriptTopic(), FreedriveTopic())
