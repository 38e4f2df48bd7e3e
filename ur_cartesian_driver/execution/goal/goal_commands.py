# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Commands of a goal machine (the logic of one running goal) to the owner of the sockets."""

from __future__ import annotations

from dataclasses import dataclass

from ur_cartesian_driver.motion.events import Outcome, Progress, Pulse
from ur_cartesian_driver.motion.geometry.pose import Pose
from ur_cartesian_driver.motion.goal.goal import SafeOutput
from ur_cartesian_driver.motion.state.servo_report import ServoReport
from ur_cartesian_driver.protocol.program.reverse import TrajectoryAction
from ur_cartesian_driver.protocol.program.script_command import SafeOutputsAction


class GoalCommand:
    """A command of a goal machine."""

    __slots__ = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class SendControl(GoalCommand):
    """Send a trajectory action, such as START, on the reverse socket to the robot program."""

    action: TrajectoryAction
    #: Number of points, for the actions that need it (:func:`~.reverse.trajectory`).
    count: int = 0
    #: For START: whether the robot program displaces the path by offsets from its RTDE registers.
    takes_offsets: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class SetFeedTarget(GoalCommand):
    """Have the robot program change its speed, until the next such command or the goal's end."""

    #: Fraction of the planned speed, 0 to 1.
    fraction: float
    #: Rate at which the feed changes [1/s].
    rate: float


@dataclass(frozen=True, slots=True, kw_only=True)
class SendPoints(GoalCommand):
    """
    Send encoded motions and outputs of the goal on the trajectory socket.

    The records ``first`` up to, not including, ``end`` are sent; a record is one motion or output.
    """

    first: int
    end: int


@dataclass(frozen=True, slots=True, kw_only=True)
class SetTemporaryTcp(GoalCommand):
    """Set the robot's TCP for the duration of a goal."""

    T_flange_tcp: Pose


@dataclass(frozen=True, slots=True, kw_only=True)
class RestoreTcp(GoalCommand):
    """Restore the TCP that the robot had before :class:`SetTemporaryTcp`."""

    T_flange_tcp: Pose


@dataclass(frozen=True, slots=True, kw_only=True)
class SendSafeOutputs(GoalCommand):
    """Have the robot program store, set or forget safe values of outputs, or restore outputs."""

    action: SafeOutputsAction
    #: The robot program reports this number once it has carried out the command.
    token: int
    outputs: tuple[SafeOutput, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class SecureOutputs(GoalCommand):
    """Write the safe values of outputs to the robot, because its program is paused or gone."""

    outputs: tuple[SafeOutput, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class RestoreOutputs(GoalCommand):
    """Stop writing safe values of outputs, because the robot program restores the outputs."""


@dataclass(frozen=True, slots=True, kw_only=True)
class StopProgram(GoalCommand):
    """End the robot program, whatever it is doing, so that the arm does not go on by itself."""

    reason: str


@dataclass(frozen=True, slots=True, kw_only=True)
class ReportProgress(GoalCommand):
    """Report the progress of the motion."""

    progress: Progress


@dataclass(frozen=True, slots=True, kw_only=True)
class ReportPulses(GoalCommand):
    """Report pulses that the robot program has given."""

    pulses: tuple[Pulse, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class AnswerAppend(GoalCommand):
    """Answer a request to append points: all points are accepted, or none."""

    #: Number of the request.
    number: int
    #: Why the points are refused, as a sentence; '' = they are accepted.
    refusal: str = ''
    #: Whether the points would be accepted if they were planned from rest, because the motion that
    #: brings the arm to rest has been sent.
    replan_from_rest: bool = False
    #: If the points replace the old ones from too early a time: the earliest accepted time [s].
    earliest_cut: float | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class OpenServo(GoalCommand):
    """Claim the RTDE inputs for streamed set-points, and request the RTDE outputs that answer."""


@dataclass(frozen=True, slots=True, kw_only=True)
class OpenOffsets(GoalCommand):
    """Claim the RTDE inputs for path offsets, and request the RTDE outputs that answer."""


@dataclass(frozen=True, slots=True, kw_only=True)
class CloseOffsets(GoalCommand):
    """Release the RTDE inputs for path offsets."""


@dataclass(frozen=True, slots=True, kw_only=True)
class EnterServo(GoalCommand):
    """Have the robot program follow the set-points in its RTDE inputs."""


@dataclass(frozen=True, slots=True, kw_only=True)
class WriteInputs(GoalCommand):
    """Write the claimed RTDE inputs, in the order of their recipe (module ``registers``)."""

    values: tuple[float, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class LeaveServo(GoalCommand):
    """Have the robot program brake the arm and stop reading its RTDE inputs; release them."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ReportServo(GoalCommand):
    """Report how the robot program follows the streamed set-points."""

    report: ServoReport


@dataclass(frozen=True, slots=True, kw_only=True)
class LogWarning(GoalCommand):
    """Write a warning into the log."""

    text: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Finish(GoalCommand):
    """The goal has ended."""

    outcome: Outcome
