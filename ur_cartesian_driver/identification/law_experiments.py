# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The motions by which an arm shows its laws, and the bounds within which they may run.

Each begins and ends at the present pose of the tool: wrist 3 turns, or the tool moves against its
z axis or turns about it, there and back, or round a triangle. The slow ones come first, those that
stop or pause the program last.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum
from math import degrees, hypot, radians

import numpy as np

from ur_cartesian_driver.motion.geometry.pose import Pose
from ur_cartesian_driver.motion.geometry.vectors import Vector3
from ur_cartesian_driver.motion.state.rtde_state import RobotState
from ur_cartesian_driver.motion.twin.laws import ASSUMED_LAWS

#: Tolerance of box and speed, for the robot's rounding [m, m/s].
_OVER = 1e-3
#: Places on the path that are compared with the box.
_PLACES = 25


class Interruption(Enum):
    """What happens to the program while the arm moves there."""

    NONE = ''
    STOP = 'stop'
    PAUSE = 'pause'


@dataclass(frozen=True, slots=True, kw_only=True)
class MotionBounds:
    """
    Where the tool may be, and its largest speed.

    :param low: least coordinates of the TCP in the robot's base [m]; ``high``: greatest ones.
    :param max_speed: of the TCP [m/s].
    :raises ValueError: the box is empty, or the speed is not above 0.
    """

    low: Vector3
    high: Vector3
    max_speed: float

    def __post_init__(self) -> None:
        """Refuse bounds that allow nothing."""
        if not all(a < b for a, b in zip(self.low, self.high, strict=True)):
            raise ValueError(
                f'the box reaches from {self.low} to {self.high}; give its least coordinates '
                'first, then its greatest'
            )
        if not self.max_speed > 0.0:
            raise ValueError(f'max_speed is {self.max_speed:g} m/s; it must be more than 0')

    def outside(self, position: Sequence[float]) -> str:
        """Return where a position [m] is outside the box, as a clause; '' = it is inside."""
        for axis, x, low, high in zip('xyz', position, self.low, self.high, strict=True):
            if not low - _OVER <= x <= high + _OVER:
                return f'{axis} = {x:.3f} m is outside {low:g} to {high:g} m'
        return ''

    def too_fast(self, speed: float) -> str:
        """Return that a speed [m/s] is too large, as a clause; '' = it is not."""
        if speed <= self.max_speed + _OVER:
            return ''
        return f'{speed:.3g} m/s is faster than {self.max_speed:g} m/s'


@dataclass(frozen=True, slots=True, kw_only=True)
class LawExperiment:
    """
    One motion there and back.

    :param name: of its recording.
    :param shows: the laws that it shows, for people.
    :param wrist: angle by which wrist 3 turns in a ``movej`` [rad]; 0 = the tool moves instead.
    :param retract: way of the tool against its z axis in a ``movel`` [m]; ``turn``: its angle
        about that axis [rad].
    :param speed: fastest the arm gets [rad/s] for ``wrist`` and ``turn``, [m/s] for ``retract``.
    :param there: arguments of the call that moves there; ``back``: of the one that moves back.
    :param rest: time between the two [s].
    :param after: time from the start of the motion to the interruption [s].
    """

    name: str
    shows: str
    wrist: float = 0.0
    retract: float = 0.0
    turn: float = 0.0
    speed: float
    there: str
    back: str
    rest: float = 0.0
    interruption: Interruption = Interruption.NONE
    after: float = 0.0

    @property
    def question(self) -> str:
        """The sentence about what moves, how far and how fast."""
        if self.wrist:
            what = f'Wrist 3 turns by {degrees(self.wrist):.0f} degrees'
        elif self.turn:
            what = f'The tool turns by {degrees(self.turn):.0f} degrees about its z axis'
        else:
            what = f'The tool moves {1e3 * self.retract:.0f} mm against its z axis'
        fast = (
            f'{1e3 * self.speed:.0f} mm/s'
            if self.retract
            else f'{degrees(self.speed):.0f} degrees/s'
        )
        happens = {
            Interruption.NONE: 'and back',
            Interruption.STOP: 'at most; its program is stopped on the way, and it moves back',
            Interruption.PAUSE: 'and back; its program is paused on the way, and resumed',
        }[self.interruption]
        return f'{what} {happens}, at up to {fast}. It shows {self.shows}.'

    @property
    def is_plain(self) -> bool:
        """Whether it is a move that nothing interrupts: one that may run without a question."""
        return self.interruption is Interruption.NONE

    @property
    def least_turn(self) -> float:
        """The angle by which wrist 3 turns at least, if nothing ends the program [rad]."""
        return self.wrist

    def calls(self, state: RobotState) -> tuple[str, ...]:
        """
        Return the calls behind each recorded move; the way back from a stop is not recorded.

        :param state: in which the motion begins.
        """
        there, back = self._call('there', self.there), self._call('back', self.back)
        return (there,) if self.interruption is Interruption.STOP else (there, back)

    def _call(self, target: str, arguments: str) -> str:
        function = 'movej' if self.wrist else 'movel'
        return f'{function}({target}, {arguments})' if arguments else f'{function}({target})'

    def script(self, state: RobotState) -> str:
        """Return the body of the program for the place of the arm."""
        if self.wrist:
            angle = self._wrist_angle(state)
            lines = [
                'back = get_target_joint_positions()',
                f'there = [back[0], back[1], back[2], back[3], back[4], back[5] + {angle:.9g}]',
            ]
        else:
            offset = f'p[0, 0, {-self.retract:.9g}, 0, 0, {self.turn:.9g}]'
            lines = [
                'back = get_target_tcp_pose()',
                f'there = pose_trans(back, {offset})',
            ]
        rest = [f'sleep({self.rest:g})'] if self.rest else []
        moves = [self._call('there', self.there), *rest, self._call('back', self.back)]
        return '\n'.join([*lines, *moves])

    def refusal(self, state: RobotState, bounds: MotionBounds) -> str:
        """Return why the motion leaves the bounds, as a clause; '' = it does not."""
        places = self.places(state)
        outside = next((clause for place in places if (clause := bounds.outside(place))), '')
        return (outside and f'it would leave the box: {outside}') or bounds.too_fast(
            self.tool_speed(state)
        )

    def tool_speed(self, state: RobotState) -> float:
        """Return the largest speed of the TCP [m/s]."""
        if self.turn:
            return 0.0
        radius = hypot(*state.T_flange_tcp.position[:2]) if self.wrist else 1.0
        return radius * self.speed

    def places(self, state: RobotState) -> list[Vector3]:
        """Return positions of the TCP on the way [m]; the last one is where it turns back."""
        start, tool = state.actual_tcp_pose, state.T_flange_tcp
        found = []
        for u in np.linspace(0.0, 1.0, _PLACES).tolist():
            if self.wrist:
                turned = Pose.from_rotation_vector((0, 0, 0, 0, 0, u * self._wrist_angle(state)))
                found.append((start @ tool.inverse() @ turned @ tool).position)
            else:
                moved = (0, 0, -u * self.retract, 0, 0, u * self.turn)
                found.append((start @ Pose.from_rotation_vector(moved)).position)
        return found

    def _wrist_angle(self, state: RobotState) -> float:
        """Return the angle, towards the middle of the joint's range."""
        return -self.wrist if state.actual_q[5] > 0.0 else self.wrist


@dataclass(frozen=True, slots=True, kw_only=True)
class ServoExperiment(LawExperiment):
    """
    Wrist 3 turns there and back by calls of ``servoj``; ``there`` has the arguments of all.

    Each call moves the set-point by little, so the arm does not jump even if the set-point does.
    In the first ones the arm rests, because the first motion of a program may set out slowly.
    """

    back: str = ''
    #: The t of each call [s]: whole cycles at 125 and 500 Hz. Times at rest [s].
    call_time: float = 0.04
    rest_before: float = 0.4

    def calls(self, state: RobotState) -> tuple[str, ...]:
        """Return the calls of servoj, with the numbers of the place, and of the move behind."""
        numbers = [f'{each!r}' for each in state.target_q[:5]]
        lines = [
            self._line([*numbers, f'{state.target_q[5] + turned!r}'])
            for turned in self._turned(state)
        ]
        end, *moves = self._behind
        return ('\n'.join([*lines, end]), *moves)

    def script(self, state: RobotState) -> str:
        """Return the body of the program: the same calls, beginning where the arm is by then."""
        numbers = [f'back[{i}]' for i in range(5)]
        lines = [self._line([*numbers, f'back[5] + {turned!r}']) for turned in self._turned(state)]
        return '\n'.join(['back = get_target_joint_positions()', *lines, *self._behind])

    @property
    def _behind(self) -> tuple[str, ...]:
        """What ends the calls of servoj, and the moves behind."""
        return ('stopj(2)',)

    def _line(self, joints: Sequence[str]) -> str:
        return f'servoj([{", ".join(joints)}], t={self.call_time:g}, {self.there})'

    def _turned(self, state: RobotState) -> list[float]:
        """Return the angle of wrist 3 at the end of each call, from where it began [rad]."""
        angle, held = self._wrist_angle(state), round(self.rest / self.call_time)
        there = self._turned_there(angle)
        back = [angle - turned for turned in there]
        return [*self._at_rest, *there, *[angle] * held, *back, *[0.0] * held]

    def _turned_there(self, angle: float) -> list[float]:
        count = round(self.wrist / self.speed / self.call_time)
        return [angle * i / count for i in range(1, count + 1)]

    @property
    def _at_rest(self) -> list[float]:
        return [0.0] * round(self.rest_before / self.call_time)


@dataclass(frozen=True, slots=True, kw_only=True)
class LeftServoExperiment(ServoExperiment):
    """Wrist 3 turns by calls of ``servoj`` until none follows; ``movej`` turns it back."""

    @property
    def question(self) -> str:
        """The sentence about what moves, how far and how fast."""
        return (
            f'Wrist 3 turns by up to {degrees(self.wrist):.0f} degrees, at '
            f'{degrees(self.speed):.0f} degrees/s, until set-points of servoj stay away; how hard '
            f'it brakes then is up to the robot. It turns back. It shows {self.shows}.'
        )

    @property
    def is_plain(self) -> bool:
        """Whether it may run without a question; not as long as its braking is not known."""
        return False

    @property
    def least_turn(self) -> float:
        """The angle by which wrist 3 turns at least [rad]; it lags behind its set-point."""
        return 0.5 * self.wrist

    @property
    def _behind(self) -> tuple[str, ...]:
        return (f'sleep({self.rest:g})', f'movej(back, {self.back})')

    def _turned(self, state: RobotState) -> list[float]:
        return [*self._at_rest, *self._turned_there(self._wrist_angle(state))]


@dataclass(frozen=True, slots=True, kw_only=True)
class BlendExperiment(LawExperiment):
    """
    The tool moves round a right-angled triangle, with blends at two of its corners.

    :param aside: way along the tool's x axis, between ``retract`` and the way back [m].
    :param radius: of the blends [m].
    """

    aside: float
    radius: float

    @property
    def question(self) -> str:
        """The sentence about what moves, how far and how fast."""
        return (
            f'The tool moves {1e3 * self.retract:.0f} mm against its z axis, '
            f'{1e3 * self.aside:.0f} mm along its x axis and straight back, at up to '
            f'{1e3 * self.speed:.0f} mm/s, with blends of {1e3 * self.radius:.0f} mm, in which '
            f'its speed is up to the robot. It shows {self.shows}.'
        )

    @property
    def is_plain(self) -> bool:
        """Whether it may run without a question; not as long as its speed is not known."""
        return False

    def calls(self, state: RobotState) -> tuple[str, ...]:
        """Return the calls of the one motion."""
        blended = f'{self.there}, r={self.radius:g}'
        lines = (
            f'movel(there, {blended})',
            f'movel(beside, {blended})',
            f'movel(back, {self.back})',
        )
        return ('\n'.join(lines),)

    def script(self, state: RobotState) -> str:
        """Return the body of the program for the place of the arm."""
        lines = [
            'back = get_target_tcp_pose()',
            f'there = pose_trans(back, p[0, 0, {-self.retract:.9g}, 0, 0, 0])',
            f'beside = pose_trans(there, p[{self.aside:.9g}, 0, 0, 0, 0, 0])',
        ]
        return '\n'.join([*lines, *self.calls(state)])

    def places(self, state: RobotState) -> list[Vector3]:
        """
        Return where the TCP may be [m], and at last the middle of the line between both blends.

        As the curve of a blend is not known, its corner counts as further out by the radius.
        """
        out = -self.retract - self.radius
        corners = [(-self.radius, out), (self.aside + self.radius, out)]
        return [
            (state.actual_tcp_pose @ Pose((x, 0.0, z))).position
            for x, z in (*corners, (0.5 * self.aside, -self.retract))
        ]


_TIMED_SPEED = ASSUMED_LAWS.timed_joint_speed
LAW_EXPERIMENTS = (
    LawExperiment(
        name='wrist_slow',
        shows='the start of a program, lag and friction',
        wrist=radians(10.0),
        speed=0.1,
        there='a=0.5, v=0.1',
        back='a=0.5, v=0.1',
        rest=1.0,
    ),
    LawExperiment(
        name='turn',
        shows='how fast a movel turns the tool',
        turn=radians(15.0),
        speed=0.03 * ASSUMED_LAWS.turn_ratio,
        there='a=0.3, v=0.03',
        back='a=0.3, v=0.03',
    ),
    LawExperiment(
        name='line',
        shows='the time between two moves',
        retract=0.04,
        speed=0.04,
        there='a=0.4, v=0.04',
        back='a=0.4, v=0.04',
    ),
    ServoExperiment(
        name='servoj',
        shows='the filter of servoj',
        wrist=radians(10.0),
        speed=0.1,
        there='lookahead_time=0.1, gain=300',
        rest=0.8,
    ),
    LawExperiment(
        name='wrist_fast',
        shows='lag, friction and ringing',
        wrist=radians(40.0),
        speed=0.6,
        there='a=2, v=0.6',
        back='a=2, v=0.6',
        rest=1.0,
    ),
    LawExperiment(
        name='movej_without_speed',
        shows='speed and acceleration of a movej without a and v',
        wrist=radians(60.0),
        speed=_TIMED_SPEED,
        there='',
        back='',
        rest=1.0,
    ),
    LawExperiment(
        name='movel_without_speed',
        shows='speed and acceleration of a movel without a and v',
        retract=0.1,
        speed=ASSUMED_LAWS.timed_linear_speed,
        there='',
        back='',
    ),
    BlendExperiment(
        name='blend',
        shows='where blends begin, their curve and their speed',
        retract=0.04,
        aside=0.04,
        radius=0.01,
        speed=0.04,
        there='a=0.4, v=0.04',
        back='a=0.4, v=0.04',
    ),
    LeftServoExperiment(
        name='servoj_left',
        shows='how the arm brakes then',
        wrist=radians(40.0),
        speed=0.5,
        there='lookahead_time=0.1, gain=300',
        back='a=0.5, v=0.2',
        rest=0.5,
    ),
    LawExperiment(
        name='pause',
        shows='the ramp of a pause',
        retract=0.06,
        speed=0.04,
        there='a=0.4, v=0.04',
        back='a=0.4, v=0.04',
        interruption=Interruption.PAUSE,
        after=0.7,
    ),
    LawExperiment(
        name='stop',
        shows='the ramp of a stopped program',
        retract=0.06,
        speed=0.04,
        there='a=0.4, v=0.04',
        back='a=0.4, v=0.04',
        interruption=Interruption.STOP,
        after=0.7,
    ),
)
