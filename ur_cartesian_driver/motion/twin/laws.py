# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The table of the laws of motion, with the values that are assumed for any arm.

``doc/simulation.md`` gives the evidence for each law. The fields of :class:`MotionLaws` are the
laws by which a controller moves its targets. The fields of :class:`ArmFigures` are the errors with
which an arm follows these targets; they differ between the series of arms, so their values are
not here but in ``sim.motion.imperfect_arm``. :data:`LAWS` contains both.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from enum import StrEnum
from math import inf, radians
from types import MappingProxyType
from typing import Annotated

from ur_cartesian_driver.motion.goal.declared_types import declare_types, declared_hints


class Grade(StrEnum):
    """The evidence for the assumed value of a law."""

    RECORDED = 'recorded on arms'
    SIMULATOR = "recorded in the manufacturer's simulator"
    ASSUMED = 'assumed'


@dataclass(frozen=True, slots=True)
class Law:
    """
    One law of motion: its meaning, and the values that it can have.

    :param text: the meaning of the value, as a noun phrase.
    :param unit: unit of the value; '' = none.
    :param low: least value that is allowed.
    :param high: greatest value that is allowed.
    :param choices: the allowed names if the value is a name; empty = the value is a number.
    """

    text: str
    unit: str = ''
    low: float = 0.0
    high: float = inf
    grade: Grade = Grade.ASSUMED
    choices: tuple[str, ...] = ()
    #: Name and assumed value, from the field that has this law; None = it differs between series.
    name: str = ''
    assumed: float | str | None = None

    def problem(self, value: float | str) -> str:
        """Return the rule that a value breaks, such as ``must be a or b``; '' if it is allowed."""
        if self.choices:
            return '' if value in self.choices else f'must be {" or ".join(self.choices)}'
        if not isinstance(value, str) and self.low <= value <= self.high:
            return ''
        unit = f' {self.unit}' if self.unit else ''
        return f'must be a number from {self.low:g} to {self.high:g}{unit}'


@dataclass(frozen=True, slots=True, kw_only=True)
class MotionLaws:
    """
    The laws of a controller's motions; the defaults are the values assumed for any arm.

    The fields ``blend_*`` hold for blends after ``movej``, ``movel`` and ``movec``. Two ``movep``
    are joined by an arc at constant speed, as the script manual says.

    :raises ValueError: a law cannot have its value; the text names the law.
    """

    start_time: Annotated[
        float,
        Law(
            'time within which the first path of a program gets up to speed',
            's',
            0.0,
            2.0,
            Grade.RECORDED,
        ),
    ] = 0.16
    stop_time: Annotated[
        float,
        Law(
            'time from full speed to rest when a program ends on a path',
            's',
            0.005,
            2.0,
            Grade.SIMULATOR,
        ),
    ] = 0.16
    pause_time: Annotated[
        float,
        Law('time from full speed to rest in a pause, or by the speed slider', 's', 0.005, 2.0),
    ] = 0.25
    protective_stop_time: Annotated[
        float, Law('time from full speed to rest in a protective stop', 's', 0.005, 2.0)
    ] = 0.1
    turn_ratio: Annotated[
        float,
        Law('angular speed of a movel for each m/s of its v', 'rad/m', 1.0, 16.0, Grade.SIMULATOR),
    ] = 4.0
    timed_joint_acceleration: Annotated[
        float, Law('acceleration of a movej without a', 'rad/s^2', 0.01, 40.0, Grade.RECORDED)
    ] = radians(80.0)
    timed_joint_speed: Annotated[
        float, Law('speed of a movej without v', 'rad/s', 0.01, 10.0, Grade.RECORDED)
    ] = radians(60.0)
    timed_linear_acceleration: Annotated[
        float, Law('acceleration of a movel without a', 'm/s^2', 0.001, 100.0)
    ] = 1.2
    timed_linear_speed: Annotated[
        float, Law('speed of a movel without v', 'm/s', 0.0001, 10.0)
    ] = 0.25
    idle_between_moves: Annotated[
        float, Law('time lost between two moves without a blend', 's', 0.0, 1.0, Grade.RECORDED)
    ] = 0.0
    set_point_deceleration: Annotated[
        float,
        Law(
            'deceleration of the leading joint after the last set-point of servoj',
            'rad/s^2',
            0.1,
            100.0,
        ),
    ] = 15.0
    servo_gain_factor: Annotated[
        float, Law('factor on the gain of servoj', '', 0.1, 10.0, Grade.RECORDED)
    ] = 1.0
    servo_lookahead_factor: Annotated[
        float, Law('factor on the lookahead time of servoj', '', 0.1, 10.0, Grade.RECORDED)
    ] = 1.0
    blend_begin: Annotated[
        float,
        Law(
            'share of its radius at which a blend begins and ends',
            '',
            0.05,
            1.0,
        ),
    ] = 1.0
    blend_shape: Annotated[
        str, Law('curve of a blend between lines', choices=('parabola', 'unknown'))
    ] = 'parabola'
    blend_speed_ratio: Annotated[
        float,
        Law(
            'speed half-way through a blend, as a multiple of the speed of an even change',
            '',
            0.2,
            5.0,
        ),
    ] = 1.0

    def __post_init__(self) -> None:
        """Refuse values that a law cannot have."""
        _check(self)


@dataclass(frozen=True, slots=True, kw_only=True)
class ArmFigures:
    """
    The errors of an arm against its targets, and the gaps in its packets; None = not measured.

    The fields are named as in the simulator's ``Imperfections``.

    :raises ValueError: a figure cannot have its value; the text names the figure.
    """

    lag: Annotated[
        float | None,
        Law('time by which a joint lags behind its target', 's', 0.0, 0.1, Grade.RECORDED),
    ] = None
    friction: Annotated[
        float | None,
        Law('error of a moving joint, opposite to its motion', 'rad', 0.0, 0.1, Grade.RECORDED),
    ] = None
    static_error: Annotated[
        float | None,
        Law(
            'error of a resting joint, opposite to its last motion',
            'rad',
            0.0,
            0.1,
            Grade.RECORDED,
        ),
    ] = None
    acceleration_error: Annotated[
        float | None, Law('error of a joint per acceleration', 'rad s^2/rad', 0.0, 0.01)
    ] = None
    ringing_frequency: Annotated[
        float | None,
        Law('frequency of the ringing after a change of acceleration', 'Hz', 0.5, 100.0),
    ] = None
    ringing_decay: Annotated[
        float | None, Law('decay rate of the ringing', '1/s', 0.0, 1000.0, Grade.RECORDED)
    ] = None
    position_noise: Annotated[
        float | None,
        Law('noise of measured joint positions, peak to peak', 'rad', 0.0, 0.1, Grade.RECORDED),
    ] = None
    speed_noise: Annotated[
        float | None, Law('noise of measured joint speeds, peak to peak', 'rad/s', 0.0, 1.0)
    ] = None
    single_gaps: Annotated[
        float | None,
        Law('share of RTDE packets after which one is left out', '', 0.0, 1.0, Grade.RECORDED),
    ] = None
    long_gaps: Annotated[
        float | None, Law('share of RTDE packets after which more are left out', '', 0.0, 1.0)
    ] = None

    def __post_init__(self) -> None:
        """Refuse values that a figure cannot have."""
        _check(self)


def _table(kind: type) -> dict[str, Law]:
    """Return the laws that the fields of a dataclass declare, by name."""
    hints = declared_hints(kind)
    return {
        each.name: replace(hints[each.name].__metadata__[0], name=each.name, assumed=each.default)
        for each in fields(kind)
    }


#: The laws of controller and arm, by name, in the order of ``twin.yaml``.
LAWS: Mapping[str, Law] = MappingProxyType({**_table(MotionLaws), **_table(ArmFigures)})


def _check(instance: MotionLaws | ArmFigures) -> None:
    declare_types(instance)
    for each in fields(instance):
        value = getattr(instance, each.name)
        if value is not None and (problem := LAWS[each.name].problem(value)):
            raise ValueError(f'{each.name} is {value}; it {problem}.')


#: The laws that are assumed for any arm.
ASSUMED_LAWS = MotionLaws()
