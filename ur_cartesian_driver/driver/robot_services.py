# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The service calls of a driver as methods: dashboard, TCP, payload, outputs, recovery."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from concurrent.futures import Future

from ur_cartesian_driver.motion.geometry.pose import Pose
from ur_cartesian_driver.motion.geometry.vectors import Vector3
from ur_cartesian_driver.motion.goal.goal import OutputKind
from ur_cartesian_driver.motion.state.io_signals import AnalogDomain
from ur_cartesian_driver.robot.services import service_calls as calls
from ur_cartesian_driver.robot.services.service_calls import ServiceAnswer, ServiceCall


class RobotServices(ABC):
    """
    Service calls to the robot.

    Methods wait for the answer: at most 40 s, :meth:`recover` 120 s, :meth:`run_script` 40 s more
    than its ``timeout``; :meth:`dashboard` 220 s for a flight report, 640 s for a support file.
    :meth:`call` and :meth:`watch_contact` return a future at once. A refusal is an answer, too. A
    value that cannot be sent raises
    :class:`~ur_cartesian_driver.motion.errors.LocalProtocolError`.
    """

    @abstractmethod
    def call(self, call: ServiceCall) -> Future[ServiceAnswer]:
        """Start a call and return at once; the answer always comes."""

    def dashboard(self, command: str, argument: str = '') -> ServiceAnswer:
        """Give a command to the dashboard, for example ``power on``, or ``load`` with a file."""
        return self.call(calls.DashboardCall(command=command, argument=argument)).result()

    def dashboard_line(self, line: str) -> ServiceAnswer:
        """Send any line to the dashboard, and return its answer."""
        return self.call(calls.DashboardLineCall(line=line)).result()

    def list_programs(self) -> ServiceAnswer:
        """Return the names of the robot's programs, one on each line; PolyScope X only."""
        return self.call(calls.ListProgramsCall()).result()

    def upload_program(self, program: str, *, replaces: bool = False) -> ServiceAnswer:
        """
        Send a program to the robot, and return its name there; PolyScope X only.

        :param program: the content of a ``.urpx`` file; the program's name is inside it.
        :param replaces: whether to replace the robot's program of that name.
        """
        return self.call(calls.UploadProgramCall(program=program, replaces=replaces)).result()

    def download_program(self, program_name: str) -> ServiceAnswer:
        """Return a program of the robot, the content of a ``.urpx`` file; PolyScope X only."""
        return self.call(calls.DownloadProgramCall(program_name=program_name)).result()

    def set_tcp(self, T_flange_tcp: Pose) -> ServiceAnswer:
        """Set the active TCP."""
        return self.call(calls.SetTcpCall(T_flange_tcp=T_flange_tcp)).result()

    def set_payload(
        self,
        mass: float,
        cog: Vector3 = (0.0, 0.0, 0.0),
        *,
        inertia: Sequence[float] = (),
        transition_time: float = 0.0,
    ) -> ServiceAnswer:
        """
        Set mass [kg] and centre of gravity [m] (in the flange frame) of the load.

        :param inertia: xx, yy, zz, xy, xz, yz about that point, along the axes of the flange
            [kg m^2]; empty = a point mass.
        :param transition_time: time over which the controller changes to this load [s].
        """
        call = calls.SetPayloadCall(
            mass=mass, cog=cog, inertia=tuple(inertia), transition_time=transition_time
        )
        return self.call(call).result()

    def set_gravity(self, gravity: Vector3) -> ServiceAnswer:
        """Set the acceleration that opposes gravity, in base axes [m/s^2]."""
        return self.call(calls.SetGravityCall(gravity=gravity)).result()

    def zero_ftsensor(self) -> ServiceAnswer:
        """Zero the force-torque sensor at its present reading."""
        return self.call(calls.ZeroFtSensorCall()).result()

    def watch_contact(self) -> Future[ServiceAnswer]:
        """
        Stop the current or any later motion as soon as the tool touches something.

        The arm then retracts until the tool is free, and the answer comes. The motion ends with
        ``EXECUTION_FAILED``, unless its own goal was to end at contact. The watch fails if
        :meth:`end_contact_watch` is called or the robot program ends.
        """
        return self.call(calls.WatchContactCall())

    def end_contact_watch(self) -> ServiceAnswer:
        """End the contact watch, so that its call fails; do nothing if there is no watch."""
        return self.call(calls.EndContactWatchCall()).result()

    def hand_back_control(self) -> ServiceAnswer:
        """Make the pendant's program continue after its External Control node."""
        return self.call(calls.HandBackCall()).result()

    def run_script(self, script: str, timeout: float = calls.SCRIPT_TIMEOUT) -> ServiceAnswer:
        """
        Run a script without any of the driver's checks; needs ``allow_scripts``.

        :param script: a secondary program (``sec``), or in headless mode a primary one (``def``),
            after which the driver's own program is sent again.
        :param timeout: longest duration of a primary program [s].
        """
        return self.call(calls.RunScriptCall(script=script, timeout=timeout)).result()

    def set_digital_output(self, kind: OutputKind, pin: int, high: bool) -> ServiceAnswer:
        """Set a digital output."""
        return self.call(calls.SetOutputCall(kind=kind, pin=pin, value=float(high))).result()

    def set_analog_output(self, pin: int, fraction: float, domain: AnalogDomain) -> ServiceAnswer:
        """Set an analog output to a fraction of its range: 4-20 mA or 0-10 V."""
        return self.call(
            calls.SetOutputCall(
                kind=OutputKind.STANDARD_ANALOG, pin=pin, value=fraction, domain=domain
            )
        ).result()

    def set_speed_slider(self, fraction: float) -> ServiceAnswer:
        """Move the speed slider, 0 (the arm stands still) to 1."""
        return self.call(calls.SetSpeedSliderCall(fraction=fraction)).result()

    def recover(self, *, unlock_protective_stop: bool = False) -> ServiceAnswer:
        """
        Bring a stopped robot back to READY, as far as software is allowed to.

        :param unlock_protective_stop: whether a person has looked at the cause of a protective
            stop and removed it; if False, unlocking the stop is left to a person.
        """
        return self.call(calls.RecoverCall(unlock_protective_stop=unlock_protective_stop)).result()
