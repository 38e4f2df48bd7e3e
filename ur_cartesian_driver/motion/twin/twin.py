# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The laws of motion that were measured on one arm."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from datetime import date
from functools import lru_cache
from math import isfinite
import re
from typing import Any

from ur_cartesian_driver.motion.twin.laws import (
    ArmFigures,
    ASSUMED_LAWS,
    LAWS,
    MotionLaws,
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Estimate:
    """
    The measured value of a law.

    :raises ValueError: the interval is not finite, or does not contain the value.
    """

    value: float | str
    #: The 95 % interval of a number; None for a name.
    interval: tuple[float, float] | None = None
    #: What the value was found from, for example ``12 starts of programs``.
    evidence: str = ''
    #: What of the recordings the law does not explain, for example ``0.4 ms``.
    left_over: str = ''

    def __post_init__(self) -> None:
        """Refuse intervals that do not belong to the value."""
        if isinstance(self.value, str):
            if self.interval is not None:
                raise ValueError(f'has an interval, but its value, {self.value}, is no number')
            return
        if self.interval is None:
            raise ValueError('has no interval; give [LOW, HIGH], its 95 % interval')
        low, high = self.interval
        if not (isfinite(low) and isfinite(high) and low <= self.value <= high):
            raise ValueError(
                f'has the interval {low:g} to {high:g}, which does not contain {self.value:g}'
            )

    def text(self, unit: str) -> str:
        """Return value and interval as people read them."""
        if isinstance(self.value, str):
            return self.value
        low, high = self.interval or (self.value, self.value)
        return f'{self.value:.4g}{f" {unit}" if unit else ""} ({low:.4g} to {high:.4g})'


@dataclass(frozen=True, slots=True, kw_only=True)
class ArmIdentity:
    """The arm on which laws were measured, or which is to move by them; '' and 0 = unknown."""

    model: str = ''
    serial_number: str = ''
    #: Version of the software, such as ``5.21.0``.
    software: str = ''
    motion_version: int = 0

    def differences(self, robot: ArmIdentity) -> str:
        """Return how a robot differs from this arm, as a clause; '' if nothing known differs."""
        different = []
        for name, text in _IDENTITY.items():
            own, other = getattr(self, name), getattr(robot, name)
            if own and other and not _same(name, own, other):
                different.append(f'{text} {own}, not {other}')
        return ' and '.join(different)


UNKNOWN_ARM = ArmIdentity()


def checked_software(text: str) -> str:
    """
    Return a version of the controller's software.

    :raises ValueError: the text is none.
    """
    if re.fullmatch(r'\d+(\.\d+){1,3}', text) is None:
        raise ValueError(f'{text} is no version; write it like 5.21 or 5.21.0')
    return text


def checked_day(text: str) -> str:
    """
    Return a date, YYYY-MM-DD.

    :raises ValueError: the text is none.
    """
    try:
        return date.fromisoformat(text).isoformat()
    except ValueError:
        raise ValueError(f'{text} is no date; write it as YYYY-MM-DD') from None


#: Field of an identity -> its name in a sentence.
_IDENTITY = {
    'model': 'model',
    'serial_number': 'serial number',
    'software': 'software',
    'motion_version': 'motion version',
}


def _same(name: str, own: str | int, other: str | int) -> bool:
    """Return whether two known values are the same; software as far as both name it."""
    if name != 'software':
        return own == other
    pairs = zip(str(own).split('.')[:3], str(other).split('.')[:3], strict=False)
    return all(a == b for a, b in pairs)


@dataclass(frozen=True, slots=True, kw_only=True)
class Twin:
    """
    The laws that were measured on one arm; all other laws are assumed.

    :raises ValueError: a law is unknown, or cannot have its value; the text names the law.
    """

    arm: ArmIdentity
    #: The day of the measurement, YYYY-MM-DD.
    date: str
    #: The recordings from which the laws were estimated.
    files: tuple[str, ...] = ()
    estimates: Mapping[str, Estimate] = field(default_factory=dict)
    #: Laws that were not identified -> the reason, and the experiment that would do it.
    not_identified: Mapping[str, str] = field(default_factory=dict)
    #: The laws of the controller: the measured ones, and the assumed for the rest.
    laws: MotionLaws = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        """Refuse unknown laws and impossible values."""
        for name in (*self.estimates, *self.not_identified):
            if name not in LAWS:
                raise ValueError(f'{name} is no law of motion; known are {", ".join(LAWS)}.')
        for name, estimate in self.estimates.items():
            if problem := LAWS[name].problem(estimate.value):
                raise ValueError(f'{name} is {estimate.value}; it {problem}.')
        if both := sorted(set(self.estimates) & set(self.not_identified)):
            raise ValueError(f'{both[0]} is estimated and not identified; remove one of them.')
        object.__setattr__(self, 'laws', MotionLaws(**self._values(MotionLaws)))

    @property
    def arm_figures(self) -> dict[str, Any]:
        """Return the measured figures of the arm, by name."""
        return self._values(ArmFigures)

    def _values(self, kind: type[MotionLaws] | type[ArmFigures]) -> dict[str, Any]:
        names = [each.name for each in fields(kind) if each.name in self.estimates]
        return {name: self.estimates[name].value for name in names}

    def half_width(self, name: str) -> float:
        """Return the larger distance of an interval's end from the value; 0 if not measured."""
        estimate = self.estimates.get(name)
        if estimate is None or estimate.interval is None or isinstance(estimate.value, str):
            return 0.0
        low, high = estimate.interval
        return max(high - estimate.value, estimate.value - low)

    def measured(self, *names: str) -> str:
        """Return the measured ones of some laws with their intervals, as a clause; '' if none."""
        return ', '.join(
            f'{name} {self.estimates[name].text(LAWS[name].unit)}'
            for name in names
            if name in self.estimates
        )


def laws_of(twin: Twin | None, turn_ratio: float) -> MotionLaws:
    """
    Return the laws of a controller: the measured ones, and the assumed for the rest.

    :param turn_ratio: the assumed turn ratio.
    """
    if twin is None:
        return _assumed_laws(turn_ratio)
    return (
        twin.laws if 'turn_ratio' in twin.estimates else replace(twin.laws, turn_ratio=turn_ratio)
    )


@lru_cache(maxsize=8)  # a plan asks for them again and again
def _assumed_laws(turn_ratio: float) -> MotionLaws:
    return replace(ASSUMED_LAWS, turn_ratio=turn_ratio)
