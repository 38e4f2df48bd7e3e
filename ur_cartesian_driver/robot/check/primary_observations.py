# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Observe the primary interface: model, limits, calibration, and whether it accepts scripts."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Callable, Mapping
import contextlib
from math import degrees
from typing import Any

from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.kinematics.robot_models import DhTable, robot_model
from ur_cartesian_driver.motion.geometry.pose import Pose
from ur_cartesian_driver.program.render import has_feature
from ur_cartesian_driver.protocol.client_interfaces.primary_state import ConfigurationData
from ur_cartesian_driver.protocol.rtde.rtde_packages import ControllerVersion
from ur_cartesian_driver.robot.check.finding import (
    Finding,
    note,
    ok,
    problem,
    RobotAddress,
    skipped,
)
from ur_cartesian_driver.robot.connection_status import motion_version_text
from ur_cartesian_driver.robot.link import model_names
from ur_cartesian_driver.robot.primary_client import PrimaryCallbacks, PrimaryClient
from ur_cartesian_driver.robot.services.dashboard_connection import POLYSCOPE_X

#: A line for the log, and a secondary program that only writes this line.
RIGHTS_MARK = 'ur-cartesian check-robot'
RIGHTS_PROGRAM = f'sec ur_check_rights():\n  textmsg("{RIGHTS_MARK}")\nend\n'.encode()
#: A text, and a secondary program that logs it, followed by the motion version.
MOTION_VERSION_MARK = f'{RIGHTS_MARK}: motion version '
MOTION_VERSION_PROGRAM = (
    'sec ur_check_motion_version():\n'
    f'  textmsg("{MOTION_VERSION_MARK}", motion_version_get())\nend\n'
).encode()
#: Error code of a request that the robot refuses because it is in local control.
LOCAL_CONTROL = 'C210'
#: RTDE outputs for comparing the reported pose with the calibrated kinematics.
_POSE_FIELDS = ('actual_q', 'actual_TCP_pose', 'tcp_offset')
#: Longest waits for the configuration, the kinematics after it, and a line that was asked for [s].
CONFIGURATION_TIMEOUT, GEOMETRY_TIMEOUT, RIGHTS_TIMEOUT = 6.0, 2.0, 3.0


class PrimaryProbe:
    """A connection to the primary interface, with all messages received on it."""

    def __init__(self) -> None:
        """Prepare; :meth:`open` connects."""
        self.configuration: ConfigurationData | None = None
        self.geometry: DhTable | None = None
        #: Texts and errors of the robot, oldest first.
        self.lines: list[str] = []
        #: Why connections failed or were lost, oldest first.
        self.failures: list[str] = []
        self._news = asyncio.Event()
        self._client = PrimaryClient(
            PrimaryCallbacks(
                configuration=lambda found: self._learn(configuration=found),
                geometry=lambda found: self._learn(geometry=found),
                error=lambda text: self._learn(lines=[*self.lines, text]),
                text=lambda text: self._learn(lines=[*self.lines, text]),
                connection_error=lambda text: self._learn(failures=[*self.failures, text]),
            )
        )
        self._task: asyncio.Task[Any] | None = None

    async def open(self, address: RobotAddress) -> None:
        """
        Connect and wait for the configuration.

        :raises OSError: the robot does not answer, or does not report its configuration.
        """
        self._task = asyncio.create_task(
            self._client.stay_connected(address.host, address.primary_port)
        )
        await self._wait(lambda: bool(self.configuration or self.failures), CONFIGURATION_TIMEOUT)
        if self.configuration is None:
            reason = (
                f'primary interface: {address.host} port {address.primary_port}: no '
                'configuration is reported (the usual port is 30001)'
            )
            raise OSError(next(iter(self.failures), reason))

    async def close(self) -> None:
        """Disconnect."""
        if self._task is not None:
            self._task.cancel()
            await asyncio.gather(self._task, return_exceptions=True)

    def send(self, program: bytes) -> bool:
        """
        Send a program or a command; return False if the connection is gone.

        If the connection is read-only, the client reconnects and sends the request once more
        before it reports a refusal.
        """
        return self._client.send(program, lambda: True)

    async def find_geometry(self) -> DhTable | None:
        """Wait for the calibrated geometry; return None if the robot does not report it."""
        await self._wait(lambda: self.geometry is not None, GEOMETRY_TIMEOUT)
        return self.geometry

    async def find_line(self, *parts: str, time: float = RIGHTS_TIMEOUT) -> str:
        """Wait up to ``time`` [s] for a line that contains one of the parts; return it, or ''."""

        def found() -> str:
            return next((line for line in self.lines if any(p in line for p in parts)), '')

        await self._wait(lambda: bool(found()), time)
        return found()

    def _learn(self, **found: Any) -> None:
        for name, value in found.items():
            setattr(self, name, value)
        self._news.set()

    async def _wait(self, is_there: Callable[[], bool], time: float) -> None:
        with contextlib.suppress(TimeoutError):
            async with asyncio.timeout(time):
                while not is_there():
                    self._news.clear()
                    await self._news.wait()


async def observe_primary(
    address: RobotAddress, version: ControllerVersion | None, state: Mapping[str, Any]
) -> AsyncIterator[Finding]:
    """
    Yield the findings of the primary interface.

    :param version: software of the robot; None = unknown.
    :param state: newest RTDE outputs by name; empty = none.
    """
    probe = PrimaryProbe()
    try:
        await probe.open(address)
    except OSError as error:
        yield problem(
            'primary', f'{error}; switch the primary client interface on, in the same place'
        )
    else:
        configuration = probe.configuration
        assert configuration is not None
        if version is not None:
            models = model_names(configuration.robot_type, version.major)
            yield _model(models, configuration.robot_type)
            yield _limits(configuration)
            if models:
                yield _calibration(models[0], await probe.find_geometry(), state)
        rights = await _rights(probe)
        yield rights
        if version is not None:
            yield await _motion_version(probe, version, takes_scripts=rights.data['accepted'])
    finally:
        await probe.close()


def _model(models: list[str], robot_type: int) -> Finding:
    if not models:
        return problem(
            'model', f'It reports the type {robot_type}, which this driver does not know'
        )
    return ok('model', f'It is a {" or ".join(models)}: set ur_type to that.', models=list(models))


def _limits(configuration: ConfigurationData) -> Finding:
    speeds = [round(degrees(speed)) for speed, _ in configuration.motion_limits]
    return ok(
        'joint_limits',
        f'Largest joint speeds {speeds} degrees/s; moves without v and a use '
        f'{configuration.v_tool_default:g} m/s and {configuration.a_tool_default:g} m/s^2, '
        f'{configuration.v_joint_default:.3f} rad/s and {configuration.a_joint_default:.3f} '
        'rad/s^2.',
        position=[list(pair) for pair in configuration.position_limits],
        speed_and_acceleration=[list(pair) for pair in configuration.motion_limits],
        defaults={
            'v_joint': configuration.v_joint_default,
            'a_joint': configuration.a_joint_default,
            'v_tool': configuration.v_tool_default,
            'a_tool': configuration.a_tool_default,
            'eq_radius': configuration.eq_radius,
        },
    )


def _calibration(model: str, geometry: DhTable | None, state: Mapping[str, Any]) -> Finding:
    """Compare the reported TCP pose with the computed one, as the driver does before goals."""
    if geometry is None:
        return skipped('calibration', 'The robot did not report its calibration')
    if missing := [name for name in _POSE_FIELDS if name not in state]:
        return skipped('calibration', f'RTDE does not report {", ".join(missing)}')
    arm = Arm(robot_model(model), geometry)
    T_flange_tcp = Pose.from_rotation_vector(state['tcp_offset'])
    reported = Pose.from_rotation_vector(state['actual_TCP_pose'])
    pose_error = 1e3 * (arm.forward(state['actual_q']) @ T_flange_tcp).distance_to(reported)
    difference = 1e3 * arm.max_flange_distance(Arm(robot_model(model)))
    text = (
        f'The calibration moves the flange by up to {difference:.2f} mm, and the reported pose is '
        f'{pose_error:.3f} mm from that of the calibrated kinematics.'
    )
    data = {'difference_mm': round(difference, 3), 'pose_error_mm': round(pose_error, 4)}
    return (ok if pose_error < 0.5 else note)('calibration', text, **data)


async def _rights(probe: PrimaryProbe) -> Finding:
    """Send a program that only writes a line, and find out whether the robot accepts it."""
    loop = asyncio.get_running_loop()
    begin = loop.time()
    probe.send(RIGHTS_PROGRAM)
    line = await probe.find_line(RIGHTS_MARK, LOCAL_CONTROL)
    passed = loop.time() - begin
    if RIGHTS_MARK in line:
        return ok(
            'scripts',
            f'The robot takes scripts from the network, and answers after {1e3 * passed:.0f} ms.',
            accepted=True,
            seconds=round(passed, 4),
        )
    why = (
        f'it is in local control ({LOCAL_CONTROL})'
        if line
        else f'nothing came back in {RIGHTS_TIMEOUT:g} s'
    )
    return note(
        'scripts',
        f'The robot takes no scripts from the network: {why}. headless_mode and recover need '
        'remote control.',
        accepted=False,
    )


async def _motion_version(
    probe: PrimaryProbe, version: ControllerVersion, *, takes_scripts: bool
) -> Finding:
    """Ask for the motion version of movej and movel where the software has several."""
    check = 'motion_version'
    known = has_feature(check, version.release)
    if not known and version.major < POLYSCOPE_X:
        return ok(check, 'The software has motion version 1 only.', motion_version=1)
    if not (known and takes_scripts):
        return note(check, motion_version_text(0), motion_version=0)
    probe.send(MOTION_VERSION_PROGRAM)
    line = await probe.find_line(MOTION_VERSION_MARK)
    number = line.removeprefix(MOTION_VERSION_MARK).strip()
    found = int(number) if number.isdecimal() else 0
    return (ok if found == 1 else note)(check, motion_version_text(found), motion_version=found)
