# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The newest status, arm, signals and temporary TCP, as the robot loop reports them."""

from __future__ import annotations

from collections.abc import Callable
import logging
import threading

from ur_cartesian_driver.driver.callbacks import run_callback
from ur_cartesian_driver.driver.ipc.channel import (
    GeometryReceived,
    LimitsReceived,
    LogMessage,
    LoopHeartbeat,
    Notification,
    PulsesGiven,
    Request,
    ServoProgress,
    SignalsChanged,
    StatusChanged,
    TemporaryTcpRestored,
    TemporaryTcpSet,
)
from ur_cartesian_driver.driver.ipc.driver_config import DriverConfig
from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.kinematics.robot_models import (
    DhTable,
    JOINT_NAMES,
    JointLimits,
    robot_model,
)
from ur_cartesian_driver.motion.events import Pulse
from ur_cartesian_driver.motion.state.io_signals import Signals
from ur_cartesian_driver.motion.state.servo_report import ServoReport
from ur_cartesian_driver.planning import PlanningOptions
from ur_cartesian_driver.robot.connection_status import ConnectionStatus, LinkGaps
from ur_cartesian_driver.robot.lifecycle import ConnectionState


class ReportedRobot:
    """
    The newest reports of a robot loop.

    The driver's reader thread writes them, or the thread that closes the driver; all threads read.

    :raises ValueError: ``ur_type`` is unknown.
    """

    def __init__(
        self, config: DriverConfig, options: PlanningOptions, logger: logging.Logger
    ) -> None:
        """Begin disconnected, with the nominal arm."""
        self._config, self._options, self._log = config, options, logger
        #: The arm's kinematics, nominal until the robot has reported its calibration.
        self.arm = Arm(robot_model(config.ur_type))
        self.status = ConnectionStatus()
        self.ready = threading.Event()
        #: Inputs and outputs; None before the first report and while the robot is disconnected.
        self.signals: Signals | None = None
        self.gaps = LinkGaps()
        self.status_listeners: list[Callable[[ConnectionStatus], None]] = []
        self.servo_listeners: list[Callable[[ServoReport], None]] = []
        self.pulse_listeners: list[Callable[[Pulse], None]] = []
        #: The TCP that a goal has set, until the original TCP is restored.
        self.temporary_tcp: TemporaryTcpSet | None = None
        self._has_warned_of_cell = False

    def take(self, notification: Notification | Request) -> None:
        """Process a report; notifications for :class:`~.RunningMotions` are ignored."""
        match notification:
            case ServoProgress(report=report):
                for listener in list(self.servo_listeners):
                    run_callback(listener, report, self._log)
            case PulsesGiven(pulses=pulses):
                for pulse in pulses:
                    for to_pulse in list(self.pulse_listeners):
                        run_callback(to_pulse, pulse, self._log)
            case StatusChanged(status=status):
                self.set_status(status)
            case SignalsChanged(signals=signals):
                self.signals = signals
            case LoopHeartbeat(gaps=gaps):
                self.gaps = gaps
            case GeometryReceived(geometry=geometry):
                self._update_geometry(geometry)
            case LimitsReceived(limits=limits):
                self._update_limits(limits)
            case TemporaryTcpSet():
                self.temporary_tcp = notification
            case TemporaryTcpRestored():
                self.temporary_tcp = None
            case LogMessage(level=level, text=text):
                self._log.log(level, text)

    def set_status(self, status: ConnectionStatus) -> None:
        """Change the status and tell the listeners."""
        self.status = status
        if status.state is ConnectionState.DISCONNECTED:
            self.signals, self.gaps = None, LinkGaps()
        if status.state is ConnectionState.READY:
            self._warn_of_unchecked_cell()
            self.ready.set()
        else:
            self.ready.clear()
        for listener in list(self.status_listeners):
            run_callback(listener, status, self._log)

    def _update_limits(self, limits: JointLimits) -> None:
        """Tighten the joint limits for planning to the limits that the robot reports."""
        model = robot_model(self._config.ur_type).limited_to(limits)
        self.arm = Arm(model, self.arm.geometry)
        for k in sorted(model.reported_ranges):
            self._log.info('range of %s: %s', JOINT_NAMES[k], model.range_text(k))
        for k in sorted(model.reported_speeds):
            speed, source = model.max_joint_speed[k], model.speed_source(k)
            self._log.info('maximum speed of %s: %.3f rad/s%s', JOINT_NAMES[k], speed, source)

    def _update_geometry(self, geometry: DhTable) -> None:
        """Plan with the calibrated arm from now on; warn if it is far from the nominal one."""
        model = self.arm.model
        self.arm = Arm(model, geometry)
        deviation = self.arm.max_flange_distance(Arm(model))
        limit = self._config.max_calibration_difference
        if 0.0 < limit < deviation:
            self._log.warning(
                "the robot's calibration displaces the flange by up to %.1f mm from the nominal "
                '%s; max_calibration_difference is %.1f mm. Check ur_type, and whether the arm '
                'was repaired or calibrated again.',
                1e3 * deviation,
                model.name,
                1e3 * limit,
            )

    def _warn_of_unchecked_cell(self) -> None:
        """Warn once about the parts of the cell that no check covers."""
        if self._has_warned_of_cell:
            return
        self._has_warned_of_cell = True
        unchecked, bodies = [], self._options.cell.bodies
        if not self._options.workspace_planes and all(body.is_carried for body in bodies):
            unchecked.append('workspace_planes is empty, so no table, wall or ceiling is checked')
        if self._options.tool_radius == 0.0 and not any(body.is_on_tool for body in bodies):
            unchecked.append('tool_radius is 0, so the tool is not checked')
        if unchecked:
            self._log.warning('%s: goals may cause collisions', ', and '.join(unchecked))
