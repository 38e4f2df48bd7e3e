# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Commands of a goal machine; the owner of the sockets carries them out."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeAlias

from ur_cartesian_driver.motion.events import Outcome, Progress
from ur_cartesian_driver.motion.geometry.pose import Pose
from ur_cartesian_driver.motion.goal.goal import SafeOutput
from ur_cartesian_driver.motion.state.servo_report import ServoReport
from ur_cartesian_driver.protocol.program.reverse import TrajectoryAction
from ur_cartesian_driver.protocol.program.script_command import SafeOutputsAction


@dataclass(frozen=True, slots=True, kw_only=True)
class SendControl:
    """Send a trajectory action on the reverse socket."""

    action: TrajectoryAction
    count: int = 0
    #: START: the path gives way to offsets that come through registers.
    takes_offsets: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class SendPoints:
    """Send the records ``first`` up to, not including, ``end`` on the trajectory socket."""

    first: int
    end: int


@dataclass(frozen=True, slots=True, kw_only=True)
class SetTemporaryTcp:
    """Set the robot's TCP for the time of a goal."""

    T_flange_tcp: Pose


@dataclass(frozen=True, slots=True, kw_only=True)
class RestoreTcp:
    """Restore the TCP that the robot had before :class:`SetTemporaryTcp`."""

    T_flange_tcp: Pose


@dataclass(frozen=True, slots=True, kw_only=True)
class SendSafeOutputs:
    """Tell the robot program about outputs that have to be safe."""

    action: SafeOutputsAction
    token: int
    outputs: tuple[SafeOutput, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class SecureOutputs:
    """Write the safe values of outputs to the robot: its program is paused or gone."""

    outputs: tuple[SafeOutput, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class RestoreOutputs:
    """Write the values to the robot that its outputs had before a pause."""

    outputs: tuple[SafeOutput, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class StopProgram:
    """End the robot program, whatever it does: the arm must not go on by itself."""

    reason: str


@dataclass(frozen=True, slots=True, kw_only=True)
class ReportProgress:
    """Report the progress of the motion."""

    progress: Progress


@dataclass(frozen=True, slots=True, kw_only=True)
class AnswerAppend:
    """Answer an append: all points are taken, or none."""

    number: int
    #: Why they are not taken; empty = they are.
    refusal: str = ''
    #: They would be taken if they were planned from rest: the ending has been sent.
    replan_from_rest: bool = False
    #: A new tail would be taken if it began at this time or later [s].
    earliest_cut: float | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class OpenServo:
    """Take the RTDE inputs of the buffered servo, and report the robot's outputs for it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class OpenOffsets:
    """Take the RTDE inputs of path offsets, and report the robot's outputs for them."""


@dataclass(frozen=True, slots=True, kw_only=True)
class CloseOffsets:
    """Release these inputs."""


@dataclass(frozen=True, slots=True, kw_only=True)
class EnterServo:
    """Have the robot program read these inputs."""


@dataclass(frozen=True, slots=True, kw_only=True)
class WriteInputs:
    """Write the RTDE inputs that were taken, in the order of their recipe in ``registers``."""

    values: tuple[float, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class LeaveServo:
    """Have the robot program brake and stop reading, and release the inputs."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ReportServo:
    """Report the state of the servo."""

    report: ServoReport


@dataclass(frozen=True, slots=True, kw_only=True)
class LogWarning:
    """Write a warning into the log."""

    text: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Finish:
    """The goal has ended."""

    outcome: Outcome


GoalCommand: TypeAlias = (
    SendControl
    | SendPoints
    | SetTemporaryTcp
    | RestoreTcp
    | SendSafeOutputs
    | SecureOutputs
    | RestoreOutputs
    | StopProgram
    | ReportProgress
    | AnswerAppend
    | OpenServo
    | OpenOffsets
    | CloseOffsets
    | EnterServo
    | WriteInputs
    | LeaveServo
    | ReportServo
    | LogWarning
    | Finish
)
