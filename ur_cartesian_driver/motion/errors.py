# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The errors of this package: a class, with the action's code, for each way a goal can fail.

::

    DriverError
    |-- GoalRefused              nothing has moved, unless the cell changed (CollisionPredicted)
    |   |-- InvalidGoal              the goal contradicts itself or the rules
    |   |   |-- NotAvailable             the goal needs something that this version does not do
    |   |   `-- TooFast                  the goal needs more speed than the limits allow
    |   |-- InvalidJoints            posture names or values do not fit the robot
    |   |-- OldHeaderTimestamp       header.stamp lies too far in the past
    |   |-- InvalidPosture           the motion cannot arrive in the required posture
    |   |-- Unreachable              no joint solution for a pose
    |   |-- NearSingularity          the path comes too close to a singularity
    |   |-- JointLimitExceeded       the path leaves the range of a joint
    |   |-- CollisionPredicted       the arm would hit itself, a plane or a body
    |   `-- RobotNotReady            not connected, not powered, program not running, busy
    |-- ExecutionEnded           an accepted goal ended without success
    |   |-- PathToleranceViolated, GoalToleranceViolated
    |   |-- ProtectiveStop, EmergencyStop, ProgramStopped, ConnectionLost
    |   |-- Preempted, Cancelled
    |   `-- ExecutionFailed          the robot program failed, or the robot left the plan
    `-- ProtocolError            a wire protocol was broken; treated as a lost connection
        |-- LocalProtocolError       we tried to send something illegal; nothing was sent
        `-- RemoteProtocolError      the robot sent nonsense; its bytes are in the text

:data:`ERRORS` maps each code to its class; ``Outcome.raise_for_error()`` uses it.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from difflib import get_close_matches
from enum import IntEnum
from typing import ClassVar, TypeVar

_Error = TypeVar('_Error', bound='DriverError')


class ErrorCode(IntEnum):
    """The ``error_code`` of the result; 0 to -6 are as in FZI's cartesian_control_msgs."""

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


#: Longest text of a user that an error quotes in full [characters].
_MAX_ECHO = 80


def shortened(text: str) -> str:
    """Shorten a user's text to 80 characters, so that an error can quote it."""
    return text if len(text) <= _MAX_ECHO else f'{text[: _MAX_ECHO - 3]}...'


def suggestion(name: str, known: Iterable[str], otherwise: str) -> str:
    """Return the advice on an unknown name: the most similar known name, else ``otherwise``."""
    near = get_close_matches(name, list(known), n=1)
    return f'did you mean {near[0]}?' if near else otherwise


class DriverError(Exception):
    """The root of all errors of this package; the text is one sentence for the user."""

    #: The action's code for this error.
    code: ClassVar[ErrorCode]
    #: The report of the failed goal if the error was made from its outcome; else empty.
    report: tuple[str, ...] = ()

    def __reduce__(self) -> tuple[object, ...]:
        """Copy and pickle by the text, because some constructors build it from other values."""
        return _restore, (type(self), str(self)), self.__dict__


class GoalRefused(DriverError):
    """
    A goal was refused before anything moved.

    If the cell (the bodies around the arm) changes during a goal, its rest can be refused, too.
    """

    def reworded(self, sentence: str) -> GoalRefused:
        """Return the same refusal with another sentence."""
        return _restore(type(self), sentence)


class InvalidGoal(GoalRefused):
    """The goal contradicts itself or the rules; the text names point and field."""

    code = ErrorCode.INVALID_GOAL
    #: The wrong field; empty if the error was made from an outcome.
    field = ''

    def __init__(self, field: str, problem: str, remedy: str = '') -> None:
        """
        Build the sentence.

        :param field: the wrong field, for example ``trajectory.points[2].pose.orientation``.
        :param problem: the fault of the field, with its value and bound.
        :param remedy: advice to the user; empty = none.
        """
        super().__init__(f'{field} {problem}' + (f'; {remedy}.' if remedy else '.'))
        self.field = field


class NotAvailable(InvalidGoal):
    """The goal needs something that this version of the driver does not do."""


class AlreadySent(InvalidGoal):
    """Points to be replaced were sent already; the text names the first replaceable one."""

    #: Index of the first point that can be replaced.
    first_point = 0
    #: Earliest ``time_from_start`` from which points can be replaced [s].
    first_time = 0.0

    def __init__(self, first_point: int, first_time: float) -> None:
        """Take the first replaceable point and the earliest ``time_from_start`` [s]."""
        DriverError.__init__(
            self,
            'The points to be replaced have been sent to the robot already; replace from point '
            f'{first_point} or from {first_time:.3f} s on, or later.',
        )
        self.first_point, self.first_time = first_point, first_time


class TooFast(InvalidGoal):
    """A segment needs more speed than the limits allow."""


class InvalidJoints(GoalRefused):
    """Posture joints are unknown or named twice, or names and values differ in number."""

    code = ErrorCode.INVALID_JOINTS


class OldHeaderTimestamp(GoalRefused):
    """``header.stamp`` is older than ``stamp_tolerance``."""

    code = ErrorCode.OLD_HEADER_TIMESTAMP


class InvalidPosture(GoalRefused):
    """The motion cannot arrive in the required posture."""

    code = ErrorCode.INVALID_POSTURE


class Unreachable(GoalRefused):
    """A pose on the path has no joint solution."""

    code = ErrorCode.UNREACHABLE


class NearSingularity(GoalRefused):
    """The path comes too close to a singularity."""

    code = ErrorCode.SINGULARITY


class JointLimitExceeded(GoalRefused):
    """The path leaves the range of a joint."""

    code = ErrorCode.JOINT_LIMIT


class CollisionPredicted(GoalRefused):
    """The arm would hit itself, a workspace plane or a body of the cell."""

    code = ErrorCode.COLLISION
    #: The joint positions at the collision [rad]; None if they are not known.
    q: tuple[float, float, float, float, float, float] | None = None
    #: The names of the two bodies that would touch (bodies of the cell or links of the arm);
    #: empty if not known.
    bodies: tuple[str, ...] = ()
    #: The :class:`~.cell.Cell` at the time of the collision, when the goal may have moved parts
    #: already; None = not known.
    cell: object = None

    def reworded(self, sentence: str) -> GoalRefused:
        """Return the same refusal, with the same joints, bodies and cell but another sentence."""
        error = super().reworded(sentence)
        error.__dict__.update(self.__dict__)
        return error


class RobotNotReady(GoalRefused):
    """The robot cannot accept a goal now; the text names the next step."""

    code = ErrorCode.ROBOT_NOT_READY


class ExecutionEnded(DriverError):
    """An accepted goal ended without success."""


class PathToleranceViolated(ExecutionEnded):
    """The arm left the path by more than ``path_tolerance``, and was stopped."""

    code = ErrorCode.PATH_TOLERANCE_VIOLATED


class GoalToleranceViolated(ExecutionEnded):
    """The arm came to rest outside ``goal_tolerance``, or arrived too late."""

    code = ErrorCode.GOAL_TOLERANCE_VIOLATED


class ProtectiveStop(ExecutionEnded):
    """The safety system stopped the arm; unlock it when the cause is gone."""

    code = ErrorCode.PROTECTIVE_STOP


class EmergencyStop(ExecutionEnded):
    """An emergency stop cut the power of the arm."""

    code = ErrorCode.EMERGENCY_STOP


class ProgramStopped(ExecutionEnded):
    """A person, another client or an error ended the robot program."""

    code = ErrorCode.PROGRAM_STOPPED


class ConnectionLost(ExecutionEnded):
    """A connection to the robot broke, or the robot's states arrived too late."""

    code = ErrorCode.CONNECTION_LOST


class Preempted(ExecutionEnded):
    """A newer goal took the place of this one."""

    code = ErrorCode.PREEMPTED


class Cancelled(ExecutionEnded):
    """The goal was cancelled; the arm is at rest."""

    code = ErrorCode.CANCELLED


class ExecutionFailed(ExecutionEnded):
    """The robot program failed, or the robot left the plan."""

    code = ErrorCode.EXECUTION_FAILED


class ProtocolError(DriverError):
    """One side broke the rules of a wire protocol."""

    code = ErrorCode.CONNECTION_LOST


class LocalProtocolError(ProtocolError):
    """We tried to send something illegal. Nothing was sent."""


class RemoteProtocolError(ProtocolError):
    """
    The robot sent bytes that make no sense.

    The stream cannot be trusted any more: close the connection.
    """


#: The error class for every code but SUCCESSFUL: the direct subclasses of :class:`GoalRefused`
#: (nothing has moved) and of :class:`ExecutionEnded` (an accepted goal has ended).
ERRORS: Mapping[ErrorCode, type[DriverError]] = {
    error.code: error
    for error in sorted(
        [*GoalRefused.__subclasses__(), *ExecutionEnded.__subclasses__()],
        key=lambda error: -error.code,
    )
}


def error_of_outcome(code: ErrorCode, text: str, report: tuple[str, ...] = ()) -> DriverError:
    """Return the error of a goal that ended with a code other than SUCCESSFUL."""
    error = _restore(ERRORS[code], text)
    error.report = report
    return error


def _restore(cls: type[_Error], sentence: str) -> _Error:
    error = cls.__new__(cls)
    Exception.__init__(error, sentence)
    return error
