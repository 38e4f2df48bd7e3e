# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The pipe between the owner of a driver and the robot loop.

Each message is one of the dataclasses below, pickled, behind its length. Both ends are this
package and the pipe is a pair of sockets that nobody else can reach, which is what makes pickle
the right choice here, and it moves the arrays of a large plan as they are.
"""

from __future__ import annotations

from dataclasses import dataclass, field
import pickle
import socket
import struct
from typing import TypeAlias

from ur_cartesian_driver.driver.ipc.driver_config import DriverConfig
from ur_cartesian_driver.execution import AnswerAppend, AppendJob, MotionJob
from ur_cartesian_driver.execution.live.live_targets import LiveSettings
from ur_cartesian_driver.kinematics.robot_models import DhTable
from ur_cartesian_driver.motion.events import Outcome, Progress
from ur_cartesian_driver.motion.pose import Pose
from ur_cartesian_driver.motion.primitive import Joints
from ur_cartesian_driver.motion.servo import ServoReport
from ur_cartesian_driver.motion.signals import Signals
from ur_cartesian_driver.robot.driver_status import DriverStatus, LinkGaps
from ur_cartesian_driver.robot.services.service_calls import ServiceAnswer, ServiceCall

LENGTH = struct.Struct('>I')


@dataclass(frozen=True, slots=True, kw_only=True)
class TemporaryTcpSet:
    """The robot's TCP is set for a goal."""

    T_flange_original: Pose
    T_flange_temporary: Pose


@dataclass(frozen=True, slots=True, kw_only=True)
class TemporaryTcpRestored:
    """It is what it was before, or somebody has set another one."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Configure:
    """The first message: how to reach the robot."""

    config: DriverConfig
    #: Whether the robot program may be sent on the first connection; not where an earlier loop of
    #: the same owner has seen somebody stop it.
    may_upload: bool = True
    #: A TCP that an earlier loop of the same owner had set for a goal, and may not have put back.
    temporary_tcp: TemporaryTcpSet | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class LiveSetup:
    """What it takes to follow live targets, beside the order of a motion that stands."""

    settings: LiveSettings
    #: The arm, as the owner knows it.
    ur_type: str
    geometry: DhTable
    #: Where the arm stands [rad].
    start: Joints


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class StartMotion:
    """Run these points (84 bytes each)."""

    motion: int
    job: MotionJob
    points: bytes
    #: What the recording is to say of the plan, as JSON; empty = nothing.
    plan_metadata: str = ''
    #: A session of live targets; None = a goal.
    live: LiveSetup | None = None
    #: Whether the arm is to be guided by hand; else it is a goal, or a session.
    freedrive: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class SetLiveTarget:
    """A session of live targets has another target."""

    motion: int
    T_base_tcp: Pose
    #: How old it is [s].
    age: float


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class AppendToMotion:
    """Let records follow (84 bytes each) in a motion with an open end; answered in any case."""

    motion: int
    append_job: AppendJob
    points: bytes


@dataclass(frozen=True, slots=True, kw_only=True)
class CancelMotion:
    """Stop the motion, if it is the one that runs."""

    motion: int
    #: Who is to take its place, as part of a sentence; empty: nobody, it is cancelled.
    preempted_by: str = ''


@dataclass(frozen=True, slots=True, kw_only=True)
class ResendProgram:
    """Upload the robot program (again)."""


@dataclass(frozen=True, slots=True, kw_only=True)
class CallRobot:
    """Ask the robot for something beside motions."""

    number: int
    call: ServiceCall


@dataclass(frozen=True, slots=True, kw_only=True)
class OwnerHeartbeat:
    """The owner is alive."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Shutdown:
    """Stop the arm and end."""


@dataclass(frozen=True, slots=True, kw_only=True)
class StatusChanged:
    """The connection changed."""

    status: DriverStatus


@dataclass(frozen=True, slots=True, kw_only=True)
class GeometryReceived:
    """The robot told its calibrated geometry."""

    geometry: DhTable


@dataclass(frozen=True, slots=True, kw_only=True)
class MotionProgress:
    """Where a motion is."""

    motion: int
    progress: Progress


@dataclass(frozen=True, slots=True, kw_only=True)
class AppendAnswered:
    """Whether a motion has taken what was to follow."""

    motion: int
    answer: AnswerAppend


@dataclass(frozen=True, slots=True, kw_only=True)
class ServoProgress:
    """How the streaming of a motion's set-points is going."""

    motion: int
    report: ServoReport


@dataclass(frozen=True, slots=True, kw_only=True)
class MotionEnded:
    """How a motion ended."""

    motion: int
    outcome: Outcome


@dataclass(frozen=True, slots=True, kw_only=True)
class CallAnswered:
    """How a call ended."""

    number: int
    answer: ServiceAnswer


@dataclass(frozen=True, slots=True, kw_only=True)
class SignalsChanged:
    """Inputs, outputs or tool of the robot changed."""

    signals: Signals


@dataclass(frozen=True, slots=True, kw_only=True)
class LoopHeartbeat:
    """The robot loop is alive; how steady it was since the last time."""

    gaps: LinkGaps = field(default_factory=LinkGaps)


@dataclass(frozen=True, slots=True, kw_only=True)
class LogMessage:
    """Something worth a line in the owner's log; the levels are those of ``logging``."""

    level: int
    text: str


Request: TypeAlias = (
    Configure
    | StartMotion
    | AppendToMotion
    | SetLiveTarget
    | CancelMotion
    | ResendProgram
    | CallRobot
    | OwnerHeartbeat
    | Shutdown
)
Notification: TypeAlias = (
    LoopHeartbeat
    | StatusChanged
    | SignalsChanged
    | GeometryReceived
    | MotionProgress
    | ServoProgress
    | AppendAnswered
    | MotionEnded
    | CallAnswered
    | TemporaryTcpSet
    | TemporaryTcpRestored
    | LogMessage
)


def pack(message: Request | Notification) -> bytes:
    """Return a message as bytes, its length first."""
    body = pickle.dumps(message, protocol=pickle.HIGHEST_PROTOCOL)
    return LENGTH.pack(len(body)) + body


def unpack(body: bytes) -> Request | Notification:
    """Return the message of the bytes behind a length."""
    message: Request | Notification = pickle.loads(body)
    return message


def receive(pipe: socket.socket) -> Request | Notification | None:
    """
    Wait for the next message.

    :param pipe: a blocking socket; its timeout is the longest silence that is borne.
    :returns: None at the end of the pipe, and after a silence.
    """
    head = _read(pipe, LENGTH.size)
    if head is None:
        return None
    body = _read(pipe, LENGTH.unpack(head)[0])
    return None if body is None else unpack(body)


def _read(pipe: socket.socket, size: int) -> bytes | None:
    parts = bytearray()
    while len(parts) < size:
        try:
            part = pipe.recv(min(size - len(parts), 1 << 20))
        except OSError:
            return None
        if not part:
            return None
        parts += part
    return bytes(parts)
