# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Service calls: requests to the robot other than motions, and their answers.

A call checks its values when it is made, so every existing call can be sent.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import hypot
from typing import TypeAlias

from ur_cartesian_driver.motion.errors import LocalProtocolError
from ur_cartesian_driver.motion.geometry.pose import Pose
from ur_cartesian_driver.motion.geometry.vectors import Vector3
from ur_cartesian_driver.motion.goal.declared_types import declare_types, WrongType
from ur_cartesian_driver.motion.goal.goal import OutputKind
from ur_cartesian_driver.motion.goal.inertia import inertia_problem, MAX_TRANSITION_TIME
from ur_cartesian_driver.motion.goal.output_names import OUTPUTS
from ur_cartesian_driver.motion.state.io_signals import AnalogDomain
from ur_cartesian_driver.protocol.dashboard import DashboardRequest

#: Default and largest timeout of a script [s].
SCRIPT_TIMEOUT, MAX_SCRIPT_TIMEOUT = 30.0, 600.0
#: Longest accepted script [characters]; a longer one must be a mistake.
MAX_SCRIPT_LENGTH = 200_000
#: Longest accepted program [characters].
MAX_PROGRAM_LENGTH = 2_000_000
#: Longest text for the dashboard [characters]; in UTF-8, it fits into a line of the server.
MAX_TEXT_LENGTH = 1000
#: Upper bounds: of coordinates of a TCP or centre of gravity [m], of the payload's mass [kg].
MAX_TOOL_OFFSET, MAX_PAYLOAD_MASS = 5.0, 100.0
#: Upper bound of gravity [m/s^2], about twice its value on earth.
MAX_GRAVITY = 20.0
#: Largest difference of a quaternion's length from 1.
UNIT_TOLERANCE = 1e-3


@dataclass(frozen=True, slots=True, kw_only=True)
class ServiceAnswer:
    """
    The outcome of a call.

    :param ok: whether the call was carried out, and the robot has reported the effect if it can.
    :param text: a sentence, or the requested value.
    """

    ok: bool
    text: str


@dataclass(frozen=True, slots=True, kw_only=True)
class _CheckedCall:
    """A call whose fields get their declared types and are checked."""

    def __post_init__(self) -> None:
        """Check all fields."""
        try:
            declare_types(self)
        except WrongType as error:
            raise LocalProtocolError(f'{type(self).__name__}.{error}') from None
        self._check()

    def _check(self) -> None:
        """Refuse values that cannot be sent."""


@dataclass(frozen=True, slots=True, kw_only=True)
class DashboardCall(_CheckedCall):
    """Send a command to the dashboard, and wait until the robot has carried it out."""

    command: str
    argument: str = ''

    def _check(self) -> None:
        """Check that the command exists and fits into a line."""
        DashboardRequest(name=self.command, argument=self.argument)
        _check_length(self.argument)


@dataclass(frozen=True, slots=True, kw_only=True)
class DashboardLineCall(_CheckedCall):
    """Send any line to the dashboard, and return its answer."""

    line: str

    def _check(self) -> None:
        """Check that the text is one line."""
        if not self.line.strip() or '\n' in self.line or '\r' in self.line:
            raise LocalProtocolError(
                f'A request to the dashboard is one line of text, not {self.line!r:.100}.'
            )
        _check_length(self.line)


@dataclass(frozen=True, slots=True, kw_only=True)
class ListProgramsCall:
    """Ask for the names of the robot's programs, one on each line; PolyScope X only."""


@dataclass(frozen=True, slots=True, kw_only=True)
class UploadProgramCall(_CheckedCall):
    """
    Send a program to the robot; PolyScope X only.

    :param program: the content of a `.urpx` file, which also names the program.
    :param replaces: whether the program replaces one on the robot; if not, it is a new one.
    """

    program: str
    replaces: bool = False

    def _check(self) -> None:
        """Check the length of the program."""
        if not self.program.strip():
            raise LocalProtocolError('The program is empty; give the content of a .urpx file.')
        if len(self.program) > MAX_PROGRAM_LENGTH:
            raise LocalProtocolError(
                f'The program has {len(self.program)} characters, more than '
                f'{MAX_PROGRAM_LENGTH}; upload it on the pendant.'
            )


@dataclass(frozen=True, slots=True, kw_only=True)
class DownloadProgramCall(_CheckedCall):
    """Ask for a program on the robot, as the content of a `.urpx` file; PolyScope X only."""

    program_name: str

    def _check(self) -> None:
        """Check that there is a name."""
        if not self.program_name.strip():
            raise LocalProtocolError('program_name is empty; ask for the list of programs.')
        _check_length(self.program_name)


@dataclass(frozen=True, slots=True, kw_only=True)
class SetTcpCall(_CheckedCall):
    """Set the active TCP, given in the flange frame."""

    T_flange_tcp: Pose

    def _check(self) -> None:
        """Check that the TCP is a pose, in metres."""
        position, quaternion = self.T_flange_tcp.position, self.T_flange_tcp.quaternion
        if not all(abs(value) <= MAX_TOOL_OFFSET for value in position):  # NaN fails, too
            raise LocalProtocolError(
                f'The TCP is at {position} m in the flange, farther than {MAX_TOOL_OFFSET:g} m; '
                'give its position in metres.'
            )
        if not abs(hypot(*quaternion) - 1.0) <= UNIT_TOLERANCE:
            raise LocalProtocolError(
                f'The orientation of the TCP is {quaternion}, which is no unit quaternion (x, y, '
                'z, w).'
            )


@dataclass(frozen=True, slots=True, kw_only=True)
class SetPayloadCall(_CheckedCall):
    """
    Set the payload.

    :param mass: [kg].
    :param cog: centre of gravity in the flange frame [m].
    :param inertia: xx, yy, zz, xy, xz, yz about ``cog``, along the axes of the flange
        [kg m^2]; empty = a point mass.
    :param transition_time: time over which the controller changes to this payload [s].
    """

    mass: float
    cog: Vector3 = (0.0, 0.0, 0.0)
    inertia: tuple[float, ...] = ()
    transition_time: float = 0.0

    def _check(self) -> None:
        """Check all values."""
        if not 0.0 <= self.mass <= MAX_PAYLOAD_MASS or not all(
            abs(value) <= MAX_TOOL_OFFSET for value in self.cog
        ):  # NaN fails, too
            raise LocalProtocolError(
                f'The payload is {self.mass} kg at {self.cog} m; the mass has to be 0 to '
                f'{MAX_PAYLOAD_MASS:g} kg, and each coordinate at most {MAX_TOOL_OFFSET:g} m.'
            )
        if problem := inertia_problem(self.inertia):
            raise LocalProtocolError(
                f'inertia {problem}; give it about the centre of gravity, or leave it empty.'
            )
        if not 0.0 <= self.transition_time <= MAX_TRANSITION_TIME:  # NaN fails, too
            raise LocalProtocolError(
                f'transition_time is {self.transition_time:g} s, it has to be 0 to '
                f'{MAX_TRANSITION_TIME:g} s.'
            )

    @property
    def is_point_mass(self) -> bool:
        """Whether the payload has no inertia, and applies at once."""
        return not any(self.inertia) and self.transition_time == 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class SetGravityCall(_CheckedCall):
    """Set the acceleration that opposes gravity, in base axes [m/s^2]."""

    gravity: Vector3

    def _check(self) -> None:
        """Check the length."""
        if not 0.0 < hypot(*self.gravity) <= MAX_GRAVITY:  # NaN fails, too
            raise LocalProtocolError(
                f'gravity is {self.gravity} m/s^2; its length has to be more than 0 and at most '
                f'{MAX_GRAVITY:g} m/s^2, for example (0, 0, 9.82) for an arm on a table.'
            )


@dataclass(frozen=True, slots=True, kw_only=True)
class ZeroFtSensorCall:
    """Define the present force and torque as zero."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SetOutputCall(_CheckedCall):
    """
    Set an output.

    :param value: 0 or 1 for a digital output, a fraction of the range for an analog output.
    :param domain: current or voltage for an analog output; ignored for a digital output.
    """

    kind: OutputKind
    pin: int
    value: float
    domain: AnalogDomain = AnalogDomain.CURRENT

    def _check(self) -> None:
        """Check pin and value."""
        if self.kind not in OUTPUTS:
            raise LocalProtocolError(f'kind is {self.kind}, which is no OutputKind.')
        _, pins = OUTPUTS[self.kind]
        if not 0 <= self.pin < pins:
            raise LocalProtocolError(
                f'pin is {self.pin}, but {self.kind.name} has the pins 0 to {pins - 1}.'
            )
        if self.is_analog and not 0.0 <= self.value <= 1.0:
            raise LocalProtocolError(
                f'value is {self.value}, but an analog output takes a fraction of its range, 0 '
                'to 1.'
            )
        if not self.is_analog and self.value not in (0.0, 1.0):
            raise LocalProtocolError(f'value is {self.value}, but a digital output takes 0 or 1.')

    @property
    def is_analog(self) -> bool:
        """Return whether the output is analog."""
        return self.kind is OutputKind.STANDARD_ANALOG


@dataclass(frozen=True, slots=True, kw_only=True)
class SetSpeedSliderCall(_CheckedCall):
    """Move the speed slider to a fraction, 0 to 1."""

    fraction: float

    def _check(self) -> None:
        """Check the range."""
        if not 0.0 <= self.fraction <= 1.0:
            raise LocalProtocolError(
                f'speed_slider_fraction is {self.fraction}, but the slider takes 0 (the arm '
                'stands) to 1 (full speed).'
            )


@dataclass(frozen=True, slots=True, kw_only=True)
class WatchContactCall:
    """Stop every motion where the tool touches; answered at contact, or when the watch ends."""


@dataclass(frozen=True, slots=True, kw_only=True)
class EndContactWatchCall:
    """End the watch for contact."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SendProgramCall:
    """Upload the robot program (again), and wait until it has connected."""


@dataclass(frozen=True, slots=True, kw_only=True)
class HandBackCall:
    """End the robot program; the pendant's program continues after its External Control node."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RunScriptCall(_CheckedCall):
    """
    Run a script: a secondary program, or a primary one.

    A secondary program runs beside the robot program. A primary program replaces it, and needs
    headless mode.

    :param timeout: longest duration of a primary program [s].
    """

    script: str
    timeout: float = SCRIPT_TIMEOUT

    def _check(self) -> None:
        """Check the length of the script, and the time."""
        if not self.script.strip():
            raise LocalProtocolError('The script is empty; give a def or sec of URScript.')
        if len(self.script) > MAX_SCRIPT_LENGTH:
            raise LocalProtocolError(
                f'The script has {len(self.script)} characters, more than {MAX_SCRIPT_LENGTH}; '
                'shorten it, or load it on the pendant.'
            )
        if not 0.0 < self.timeout <= MAX_SCRIPT_TIMEOUT:  # NaN fails, too
            raise LocalProtocolError(
                f'timeout is {self.timeout:g} s, it has to be more than 0 and at most '
                f'{MAX_SCRIPT_TIMEOUT:g} s.'
            )


@dataclass(frozen=True, slots=True, kw_only=True)
class RecoverCall(_CheckedCall):
    """Bring a stopped robot back to READY, as far as software is allowed to."""

    #: A person has looked for the cause of a protective stop, and allows unlocking it.
    unlock_protective_stop: bool = False


#: The calls that change settings on which the plan of a goal relies.
SettingCall: TypeAlias = SetTcpCall | SetPayloadCall | SetGravityCall


def succeeded(text: str) -> ServiceAnswer:
    """Return the answer of a call that succeeded."""
    return ServiceAnswer(ok=True, text=text)


def failed(text: str) -> ServiceAnswer:
    """Return the answer of a call that failed, with the reason."""
    return ServiceAnswer(ok=False, text=text)


def _check_length(text: str) -> None:
    if len(text) > MAX_TEXT_LENGTH:
        raise LocalProtocolError(
            f'A text for the dashboard has at most {MAX_TEXT_LENGTH} characters, not {len(text)}.'
        )


ServiceCall: TypeAlias = (
    DashboardCall
    | DashboardLineCall
    | ListProgramsCall
    | UploadProgramCall
    | DownloadProgramCall
    | SettingCall
    | ZeroFtSensorCall
    | SetOutputCall
    | SetSpeedSliderCall
    | WatchContactCall
    | EndContactWatchCall
    | SendProgramCall
    | HandBackCall
    | RunScriptCall
    | RecoverCall
)
