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

    :raises ValueError: a name has an interval; or the interval of a number is missing, is not
        finite, or does not contain the number.
    """

    value: float | str
    #: The 95 % confidence interval (low, high) of a number; None for a name.
    interval: tuple[float, float] | None = None
    #: The recorded events from which the value was estimated, such as ``12 starts of programs``.
    evidence: str = ''
    #: The residual that the law leaves in the recordings, for example ``0.4 ms``.
    left_over: str = ''

    def __post_init__(self) -> None:
        """Refuse an interval that is missing or does not suit the value."""
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
        """Return value and interval for people to read, such as ``0.158 s (0.154 to 0.162)``."""
        if isinstance(self.value, str):
            return self.value
        low, high = self.interval or (self.value, self.value)
        return f'{self.value:.4g}{f" {unit}" if unit else ""} ({low:.4g} to {high:.4g})'


@dataclass(frozen=True, slots=True, kw_only=True)
class ArmIdentity:
    """An arm on which laws were measured, or to which they are applied; '' and 0 = unknown."""

    model: str = ''
    serial_number: str = ''
    #: Version of the software, such as ``5.21.0``.
    software: str = ''
    motion_version: int = 0

    def differences(self, robot: ArmIdentity) -> str:
        """Return the known differences of a robot from this arm, for a sentence; '' if none."""
        different = []
        for name, text in _IDENTITY.items():
            own, other = getattr(self, name), getattr(robot, name)
            if own and other and not _same(name, own, other):
                different.append(f'{text} {own}, not {other}')
        return ' and '.join(different)


UNKNOWN_ARM = ArmIdentity()


def checked_software(text: str) -> str:
    """
    Return the text of a software version unchanged.

    :raises ValueError: the text is no version: two to four numbers with dots between them.
    """
    if re.fullmatch(r'\d+(\.\d+){1,3}', text) is None:
        raise ValueError(f'{text} is no version; write it like 5.21 or 5.21.0')
    return text


def checked_day(text: str) -> str:
    """
    Return a date in the form YYYY-MM-DD.

    :raises ValueError: the text is no ISO date.
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
    """Return whether two known values agree; versions need only agree in the numbers of both."""
    if name != 'software':
        return own == other
    pairs = zip(str(own).split('.')[:3], str(other).split('.')[:3], strict=False)
    return all(a == b for a, b in pairs)


@dataclass(frozen=True, slots=True, kw_only=True)
class Twin:
    """
    The laws that were measured on one arm; all other laws are assumed.

    :raises ValueError: a law is unknown, cannot have its value, or is both estimated and not
        identified; the text names the law.
    """

    arm: ArmIdentity
    #: The day of the measurement, YYYY-MM-DD.
    date: str
    #: The recordings from which the laws were estimated.
    files: tuple[str, ...] = ()
    estimates: Mapping[str, Estimate] = field(default_factory=dict)
    #: Laws that were not identified -> the reason, and the experiment that would identify them.
    not_identified: Mapping[str, str] = field(default_factory=dict)
    #: The laws of the controller, with the assumed values where none were measured.
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
        """Return the larger distance from a value to an end of its interval; 0 if it has none."""
        estimate = self.estimates.get(name)
        if estimate is None or estimate.interval is None or isinstance(estimate.value, str):
            return 0.0
        low, high = estimate.interval
        return max(high - estimate.value, estimate.value - low)

    def measured(self, *names: str) -> str:
        """Return values and intervals of the given laws that were measured; '' if none."""
        return ', '.join(
            f'{name} {self.estimates[name].text(LAWS[name].unit)}'
            for name in names
            if name in self.estimates
        )


def laws_of(twin: Twin | None, turn_ratio: float) -> MotionLaws:
    """
    Return the laws of a controller, with the assumed values where ``twin`` measured none.

    :param turn_ratio: the turn ratio [rad/m] if ``twin`` does not have it.
    """
    if twin is None:
        return _assumed_laws(turn_ratio)
    return (
        twin.laws if 'turn_ratio' in twin.estimates else replace(twin.laws, turn_ratio=turn_ratio)
    )


@lru_cache(maxsize=8)  # a plan asks for them many times
def _assumed_laws(turn_ratio: float) -> MotionLaws:
    return replace(ASSUMED_LAWS, turn_ratio=turn_ratio)
