# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The units of columns, in the spellings that programs use in headers."""

from __future__ import annotations

from collections.abc import Mapping
from enum import Enum
from math import radians
import unicodedata

from ur_cartesian_driver.importing.import_options import LENGTH_UNITS


class Quantity(Enum):
    """A kind of number; the value of each member is an example of its unit."""

    LENGTH = 'mm'
    ANGLE = 'deg'
    TIME = 's'
    SPEED = 'mm/s'
    #: A number without a unit.
    PURE = '-'


_NAMES = {
    'um': 'μm micron microns micrometer micrometers micrometre micrometres',
    'mm': 'millimeter millimeters millimetre millimetres',
    'cm': 'centimeter centimeters centimetre centimetres',
    'm': 'meter meters metre metres',
    'in': '" inch inches',
    'ft': 'foot feet',
    'deg': '° degree degrees',
    'rad': 'radian radians',
    's': 'sec secs second seconds',
    'ms': 'msec millisecond milliseconds',
    'us': 'μs usec microsecond microseconds',
    'ns': 'nsec nanosecond nanoseconds',
    'min': 'minute minutes',
    '-': '1',
}
_SYNONYMS = {synonym: name for name, synonyms in _NAMES.items() for synonym in synonyms.split()}
_TIMES = {'s': 1.0, 'ms': 1e-3, 'us': 1e-6, 'ns': 1e-9, 'min': 60.0}
#: The factor to SI of each unit.
UNITS: Mapping[Quantity, Mapping[str, float]] = {
    Quantity.LENGTH: LENGTH_UNITS,
    Quantity.ANGLE: {'rad': 1.0, 'deg': radians(1.0)},
    Quantity.TIME: _TIMES,
    Quantity.SPEED: {
        f'{length}/{time}': factor / _TIMES[time]
        for length, factor in LENGTH_UNITS.items()
        for time in ('s', 'min')
    },
    Quantity.PURE: {'-': 1.0},
}


def plain_unit(text: str) -> str:
    """Return the name of a unit in :data:`UNITS`; for an unknown unit, its text in lower case."""
    # NFKC turns the micro sign into the Greek letter, and superscripts into digits.
    text = unicodedata.normalize('NFKC', text).strip().lower()
    parts = text.replace('_per_', '/').replace(' per ', '/').replace('_', '/').split('/')
    return '/'.join(_SYNONYMS.get(part.strip(), part.strip()) for part in parts)


def is_unit(text: str) -> bool:
    """Return whether a text is a unit of some quantity."""
    return any(plain_unit(text) in units for units in UNITS.values())
