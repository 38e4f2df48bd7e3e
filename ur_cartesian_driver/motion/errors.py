# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
What can go wrong, one class for each situation in which a caller can act.

::

    DriverError
    |-- GoalRefused              nothing has moved
    |   |-- InvalidGoal              the goal contradicts itself or the rules
    |   |   |-- NotAvailable             asks for something this version does not do
    |   |   `-- TooFast                  needs more speed than the limits allow
    |   |-- InvalidJoints            posture names or values do not fit the robot
    |   |-- OldHeaderTimestamp       header.stamp lies too far in the past
    |   |-- InvalidPosture           the motion cannot arrive in the posture asked for
    |   |-- Unreachable              no joint solution for a pose
    |   |-- NearSingularity          the path comes too close to a singularity
    |   |-- JointLimitExceeded       the path leaves the joint range
    |   |-- CollisionPredicted       the arm would hit itself or a workspace plane
    |   `-- RobotNotReady            not connected, not powered, program not running, busy
    |-- ExecutionEnded           a running goal ended before its end
    |   |-- PathToleranceViolated, GoalToleranceViolated
    |   |-- ProtectiveStop, EmergencyStop, ProgramStopped, ConnectionLost
    |   |-- Preempted, Cancelled
    |   `-- ExecutionFailed          the robot program reported a failure
    `-- ProtocolError
        |-- LocalProtocolError       we tried to send something illegal; nothing was sent
        `-- RemoteProtocolError      the robot sent nonsense; its bytes are in the text

Each class of the first two branches has exactly one code of the action, in :data:`CODES`.
"""

from __future__ import annotations

from collections.abc import Mapping
from enum import IntEnum
from types import MappingProxyType


class ErrorCode(IntEnum):
    """The ``error_code`` of the action's result; FZI's numbers down to -6, ours below."""

    SUCCESSFUL = 0
    INVALID_GOAL = -1
    INVALID_JOINTS = -2
    OLD_HEADER_TIMESTAMP = -3
    PATH_TOLERANCE_VIOLATED = -4
    GOAL_TOLERANCE_VIOLATED = -5
    INVALID_POSTURE = -6
    UNREACHABLE = -7
    SINGULARITY = -8
    JOINT_LIMIT = -9
    COLLISION = -10
    PROTECTIVE_STOP = -11
    EMERGENCY_STOP = -12
    PROGRAM_STOPPED = -13
    CONNECTION_LOST = -14
    PREEMPTED = -15
    CANCELLED = -16
    EXECUTION_FAILED = -17
    ROBOT_NOT_READY = -18


class DriverError(Exception):
    """The root of all errors of this package; its text is one sentence for a person."""

    def __reduce__(self) -> tuple[object, ...]:
        """Pickle and copy by the finished sentence, because constructors take facts."""
        return _restore, (type(self), str(self)), self.__dict__


class GoalRefused(DriverError):
    """A goal was refused before anything moved."""


class InvalidGoal(GoalRefused):
    """The goal contradicts itself or the rules; the text names point and field."""

    def __init__(self, field: str, problem: str, remedy: str = '') -> None:
        """
        Build the sentence.

        :param field: where, for example ``trajectory.points[2].pose.orientation``.
        :param problem: what is wrong there, with value and bound.
        :param remedy: what to do.
        """
        super().__init__(f'{field} {problem}' + (f'; {remedy}.' if remedy else '.'))
        self.field = field


class NotAvailable(InvalidGoal):
    """The goal asks for something that this version of the driver does not do."""


class TooFast(InvalidGoal):
    """A segment needs more speed than the limits allow."""


class InvalidJoints(GoalRefused):
    """Posture names are unknown or doubled, or their number differs from the values'."""


class OldHeaderTimestamp(GoalRefused):
    """``header.stamp`` lies farther in the past than ``stamp_tolerance``."""


class InvalidPosture(GoalRefused):
    """The motion cannot arrive in the joint configuration asked for."""


class Unreachable(GoalRefused):
    """There is no joint solution for a pose."""


class NearSingularity(GoalRefused):
    """The path comes too close to a singularity."""


class JointLimitExceeded(GoalRefused):
    """The path leaves the range of a joint."""


class CollisionPredicted(GoalRefused):
    """The arm would hit itself or a workspace plane."""


class RobotNotReady(GoalRefused):
    """The robot cannot take a goal now; the text says what is needed."""


class ExecutionEnded(DriverError):
    """A running goal ended before its end."""


class PathToleranceViolated(ExecutionEnded):
    """The arm left the path by more than ``path_tolerance``."""


class GoalToleranceViolated(ExecutionEnded):
    """The arm stands, or arrived, outside ``goal_tolerance`` or too late."""


class ProtectiveStop(ExecutionEnded):
    """The robot's safety system stopped the arm; unlock it when the cause is gone."""


class EmergencyStop(ExecutionEnded):
    """An emergency stop cut the power of the arm."""


class ProgramStopped(ExecutionEnded):
    """The robot program ended or was paused by somebody else."""


class ConnectionLost(ExecutionEnded):
    """A connection to the robot broke."""


class Preempted(ExecutionEnded):
    """A newer goal took over."""


class Cancelled(ExecutionEnded):
    """The client cancelled the goal."""


class ExecutionFailed(ExecutionEnded):
    """The robot program reported a failure, or the robot did something else than planned."""


class ProtocolError(DriverError):
    """One side broke the rules of a wire protocol."""


class LocalProtocolError(ProtocolError):
    """We tried to send something illegal. Nothing was sent."""


class RemoteProtocolError(ProtocolError):
    """
    The robot sent bytes that make no sense.

    The stream cannot be trusted after that: close the connection.
    """


#: The one table from error classes to the codes of the action.
CODES: Mapping[type[DriverError], ErrorCode] = MappingProxyType(
    {
        InvalidGoal: ErrorCode.INVALID_GOAL,
        NotAvailable: ErrorCode.INVALID_GOAL,
        TooFast: ErrorCode.INVALID_GOAL,
        InvalidJoints: ErrorCode.INVALID_JOINTS,
        OldHeaderTimestamp: ErrorCode.OLD_HEADER_TIMESTAMP,
        PathToleranceViolated: ErrorCode.PATH_TOLERANCE_VIOLATED,
        GoalToleranceViolated: ErrorCode.GOAL_TOLERANCE_VIOLATED,
        InvalidPosture: ErrorCode.INVALID_POSTURE,
        Unreachable: ErrorCode.UNREACHABLE,
        NearSingularity: ErrorCode.SINGULARITY,
        JointLimitExceeded: ErrorCode.JOINT_LIMIT,
        CollisionPredicted: ErrorCode.COLLISION,
        ProtectiveStop: ErrorCode.PROTECTIVE_STOP,
        EmergencyStop: ErrorCode.EMERGENCY_STOP,
        ProgramStopped: ErrorCode.PROGRAM_STOPPED,
        ConnectionLost: ErrorCode.CONNECTION_LOST,
        Preempted: ErrorCode.PREEMPTED,
        Cancelled: ErrorCode.CANCELLED,
        ExecutionFailed: ErrorCode.EXECUTION_FAILED,
        RobotNotReady: ErrorCode.ROBOT_NOT_READY,
    }
)


def code_of(error: DriverError) -> ErrorCode:
    """Return the action's code of an error; a broken protocol counts as a lost connection."""
    if isinstance(error, ProtocolError):
        return ErrorCode.CONNECTION_LOST
    return CODES[type(error)]


def _restore(cls: type[DriverError], sentence: str) -> DriverError:
    error = cls.__new__(cls)
    Exception.__init__(error, sentence)
    return error
