# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Reads faults from text, for the command line and for tests.

::

    KIND [ARGUMENTS] [at 2 s | at 0.35 m | at z = 0.3 m] [for 1 s]

    protective_stop at 0.35 m            drop rtde at 5 s for 2 s
    offset pose x 0.002 at 1 s           delay dashboard 0.2 s
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from math import isfinite
import re
from typing import Any, TypeAlias

from ur_cartesian_driver.sim.faults.fault_values import (
    AfterDistance,
    AfterTime,
    DelayFault,
    DEVIATION_AXES,
    DEVIATION_QUANTITIES,
    DEVIATION_SHAPES,
    DeviationFault,
    DropFault,
    EventFault,
    Fault,
    FaultEvent,
    FaultTrigger,
    ForeignMotionFault,
    GARBAGE_SIZE,
    GarbageFault,
    HalfOpenFault,
    LastingInterfaceFault,
    PlaneCrossing,
    SilenceFault,
    SpeedSliderFault,
    ThrottleFault,
)

# A number and the unit directly after it, such as 2s, are two words.
_WORD = re.compile(r'[-+]?(?:\d+\.?\d*|\.\d+)(?:e[-+]?\d+)?|[A-Za-z_]\w*|=|\S+?(?=\s|$)')
_END = 'the end'


class _WordReader:
    """The words of a text, taken one by one."""

    def __init__(self, text: str) -> None:
        self._text = text
        self._words = _WORD.findall(text)

    def peek(self) -> str:
        return self._words[0] if self._words else _END

    def take(self) -> str:
        word = self.peek()
        del self._words[:1]
        return word

    def skip(self, word: str) -> bool:
        """Take the next word if it equals ``word``; return whether it was taken."""
        if self.peek() != word:
            return False
        self.take()
        return True

    def wrong(self, expected: str, word: str | None = None) -> ValueError:
        """
        Return the error for a word.

        :param word: a word that was taken already; None = the next word.
        """
        word = self.peek() if word is None else word
        return ValueError(
            f'The fault {self._text!r} is not understood at {word!r}; expected {expected}.'
        )

    def one_of(self, choices: tuple[str, ...]) -> Any:
        if self.peek() not in choices:
            raise self.wrong(f'one of {", ".join(choices)}')
        return self.take()

    def name(self) -> str:
        if not self.peek().isidentifier() or self.peek() in ('at', 'for'):
            raise self.wrong('the name of an interface, such as rtde')
        return self.take()

    def number(self, meaning: str) -> float:
        try:
            value = float(self.peek())
        except ValueError:
            raise self.wrong(meaning) from None
        if not isfinite(value):
            raise self.wrong(f'a finite number: {meaning}')
        self.take()
        return value


Reader: TypeAlias = Callable[[_WordReader], Any]


def _constant(value: object) -> Reader:
    return lambda _words: value


def _choice(choices: tuple[str, ...]) -> Reader:
    return lambda words: words.one_of(choices)


def _number(meaning: str) -> Reader:
    return lambda words: words.number(meaning)


def _read_seconds(words: _WordReader) -> float:
    seconds = words.number('a time in seconds')
    words.skip('s')
    return seconds


def _read_size(words: _WordReader) -> int:
    if words.peek() in ('at', _END):
        return GARBAGE_SIZE
    size = words.number('a number of bytes')
    if not size.is_integer():
        raise words.wrong('a whole number of bytes', f'{size:g}')
    return int(size)


_INTERFACE: dict[str, Reader] = {'interface': _WordReader.name}
_DEVIATION: dict[str, Reader] = {
    'quantity': _choice(DEVIATION_QUANTITIES),
    'axis': _choice(DEVIATION_AXES),
    'amount': _number('an amount'),
}

#: First word of a fault -> class of the fault, and field -> function that reads it from the
#: following words.
_KINDS: Mapping[str, tuple[type[Fault], Mapping[str, Reader]]] = {
    **{event.value: (EventFault, {'action': _constant(event)}) for event in FaultEvent},
    'slider': (
        SpeedSliderFault,
        {'fraction': _number('a fraction of the speed, 0 to 1')},
    ),
    'foreign_motion': (
        ForeignMotionFault,
        {'axis': _choice(DEVIATION_AXES), 'distance': _number('a distance')},
    ),
    **{
        shape: (DeviationFault, {'shape': _constant(shape), **_DEVIATION})
        for shape in DEVIATION_SHAPES
    },
    'drop': (DropFault, _INTERFACE),
    'half_open': (HalfOpenFault, _INTERFACE),
    'silence': (SilenceFault, _INTERFACE),
    'delay': (DelayFault, {**_INTERFACE, 'seconds': _read_seconds}),
    'throttle': (
        ThrottleFault,
        {**_INTERFACE, 'rate': _number('a rate in bytes per second')},
    ),
    'garbage': (GarbageFault, {**_INTERFACE, 'size': _read_size}),
}


def parse_fault(text: str) -> Fault:
    """
    Return the fault that a text describes.

    :raises ValueError: a word is not understood or a value is impossible; the message names it.
    """
    words = _WordReader(text)
    if words.peek() not in _KINDS:
        raise words.wrong(f'one of {", ".join(_KINDS)}')
    make, readers = _KINDS[words.take()]
    fields = {name: read(words) for name, read in readers.items()}
    has_duration = issubclass(make, DeviationFault | LastingInterfaceFault)
    endings: dict[str, tuple[str, Reader]] = {'at': ('trigger', _read_trigger)}
    if has_duration:
        endings['for'] = 'duration', _read_duration
    while words.peek() in endings:
        name, read = endings.pop(words.take())
        fields[name] = read(words)
    if words.peek() != _END:
        possible = ', '.join(f"'{word}'" for word in endings)
        raise words.wrong(f'{possible} or the end' if possible else 'the end')
    return make(**fields)


def _read_duration(words: _WordReader) -> float:
    seconds = words.number('a time in seconds')
    if seconds <= 0.0:
        raise words.wrong('a time greater than 0', f'{seconds:g}')
    if not words.skip('s'):
        raise words.wrong("'s'")
    return seconds


def _read_trigger(words: _WordReader) -> FaultTrigger:
    if words.peek() in ('x', 'y', 'z'):
        axis = words.one_of(('x', 'y', 'z'))
        if not words.skip('='):
            raise words.wrong("'='")
        plane = PlaneCrossing(axis, words.number('a coordinate in metres'))
        words.skip('m')
        return plane
    value = words.number(
        'a time such as 2 s, a distance such as 0.35 m, or a plane such as z = 0.3 m'
    )
    if value < 0.0:
        raise words.wrong('a number of at least 0', f'{value:g}')
    return AfterTime(value) if words.one_of(('s', 'm')) == 's' else AfterDistance(value)
