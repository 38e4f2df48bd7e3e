# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The topics that command the robot: scripts, and freedrive."""

from __future__ import annotations

from concurrent.futures import Future
from typing import Any

from std_srvs.srv import SetBool

from ur_cartesian_driver.robot.services.service_calls import ServiceAnswer
from ur_cartesian_driver.ros.message_fields import Message
from ur_cartesian_driver.ros.node_endpoints import STATE_QOS, steady_timer
from ur_cartesian_driver.ros.ur_driver_names.driver_node import DriverNode
from ur_cartesian_driver.ros.ur_driver_names.names_settings import NamesSettings
from ur_cartesian_driver.ros.ur_driver_names.offered_name import Served, UrName
from ur_cartesian_driver.srv import RunScript


def _run_scripts(row: UrName, driver: DriverNode, settings: NamesSettings, kind: Any) -> object:
    """Run each script that comes, if the driver's ``allow_scripts`` permits it; log failures."""
    driver.client(RunScript, row.source)

    def report(done: Future[ServiceAnswer]) -> None:
        if not done.result().ok:
            driver.warn(f'{row.name}: {done.result().text}')

    def run(message: Message) -> None:
        request = RunScript.Request(script=message.data)
        driver.call(RunScript, row.source, request).add_done_callback(report)

    return driver.node.create_subscription(kind, row.name, run, STATE_QOS)


class _FreedriveSwitch:
    """
    Switches freedrive with the messages, and off when they stop.

    There is only one call at a time, because the driver would answer 'on' with success while it
    still switches off. 'Off' is repeated until the driver confirms it.
    """

    def __init__(
        self, row: UrName, driver: DriverNode, settings: NamesSettings, kind: Any
    ) -> None:
        self._row, self._driver = row, driver
        self._is_wanted = self._is_calling = False
        #: Whether freedrive may be on: the driver was asked for it, and has not confirmed its end.
        self._may_be_on = False
        self._watchdog = steady_timer(driver.node, settings.freedrive_timeout, self._late)
        self._watchdog.cancel()
        driver.on_close(self._end)
        driver.client(SetBool, row.source)  # its discovery takes time
        self._subscription = driver.node.create_subscription(kind, row.name, self._take, STATE_QOS)

    def _take(self, message: Message) -> None:
        if message.data:
            self._watchdog.reset()
        else:
            self._watchdog.cancel()
        self._is_wanted = message.data
        self._follow()

    def _end(self) -> None:
        """Switch freedrive off when the node ends, because nothing else will."""
        if self._may_be_on:
            self._driver.call(SetBool, self._row.source, SetBool.Request(data=False))

    def _late(self) -> None:
        self._watchdog.cancel()
        if self._is_wanted:
            self._driver.warn(f'{self._row.name}: no message for too long, freedrive ends.')
        self._is_wanted = False
        self._follow()

    def _follow(self) -> None:
        """
        Switch freedrive as wanted, unless a call is pending.

        'On' is repeated with each message, because a stop of the program ends freedrive.
        """
        on = self._is_wanted
        if self._is_calling or not (on or self._may_be_on):
            return
        self._is_calling = self._may_be_on = True
        answer = self._driver.call(SetBool, self._row.source, SetBool.Request(data=on))
        answer.add_done_callback(lambda done: self._switched(on, done.result()))

    def _switched(self, on: bool, answer: ServiceAnswer) -> None:
        self._is_calling = False
        self._may_be_on = on or not answer.ok
        if not answer.ok:
            self._driver.warn(f'{self._row.name}: {answer.text}')
            if not self._is_wanted and not on:
                self._watchdog.reset()  # it tries again
        if self._is_wanted is not on:
            self._follow()


COMMAND_TOPICS: tuple[UrName, ...] = (
    Served(
        kind='subscribed topic',
        name='urscript_interface/script_command',
        type='std_msgs/msg/String',
        source='run_script',
        server=_run_scripts,
    ),
    Served(
        kind='subscribed topic',
        name='freedrive_mode_controller/enable_freedrive_mode',
        type='std_msgs/msg/Bool',
        source='freedrive_mode',
        server=_FreedriveSwitch,
    ),
)
