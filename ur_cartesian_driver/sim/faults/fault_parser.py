# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Faults in words, for the command line and the markers of tests.

::

    KIND [ARGUMENTS] [at 2 s | at 0.35 m | at z = 0.3 m] [for 1 s]

    protective_stop at 0.35 m            drop rtde at 5 s for 2 s
    offset pose x 0.002 at 1 s           delay dashboard 0.2 s
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
import re
from types import MappingProxyType
from typing import Any, get_args

from ur_cartesian_driver.sim.faults.fault_values import (
    AfterDistance,
    AfterTime,
    DelayFault,
    DEVIATION_AXES,
    DEVIATION_QUANTITIES,
    DeviationFault,
    DeviationShape,
    DropFault,
    EventFault,
    Fault,
    FaultEvent,
    FaultTrigger,
    ForeignMotionFault,
    GarbageFault,
    HalfOpenFault,
    PlaneCrossing,
    SilenceFault,
    SpeedSliderFault,
    ThrottleFault,
)

# A number with its unit written close to it, such as 2s, are two words.
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
        """Take a word if it is the next one."""
        if self.peek() != word:
            return False
        self.take()
        return True

    def wrong(self, expected: str, word: str | None = None) -> ValueError:
        """Return the error of the next word, or of one that was taken."""
        word = self.peek() if word is None else word
        return ValueError(
            f'The fault {self._text!r} is not understood at {word!r}; expected {expected}.'
        )

    def one_of(self, choices: tuple[str, ...]) -> Any:
        if self.peek() not in choices:
            raise self.wrong(f'one of {", ".join(choices)}')
        return self.take()

    def name(self) -> str:
        if not self.peek().isidentifier():
            raise self.wrong('the name of an interface, such as rtde')
        return self.take()

    def number(self, meaning: str) -> float:
        try:
            value = float(self.peek())
        except ValueError:
            raise self.wrong(meaning) from None
        self.take()
        return value


def _event_reader(action: FaultEvent) -> Callable[[_WordReader], dict[str, Any]]:
    return lambda _words: {'action': action}


def _read_deviation(shape: DeviationShape) -> Callable[[_WordReader], dict[str, Any]]:
    def read(words: _WordReader) -> dict[str, Any]:
        return {
            'shape': shape,
            'quantity': words.one_of(DEVIATION_QUANTITIES),
            'axis': words.one_of(DEVIATION_AXES),
            'amount': words.number('an amount'),
        }

    return read


def _read_interface(words: _WordReader) -> dict[str, Any]:
    return {'interface': words.name()}


def _read_delay(words: _WordReader) -> dict[str, Any]:
    found = {'interface': words.name(), 'seconds': words.number('a time in seconds')}
    words.skip('s')
    return found


def _read_throttle(words: _WordReader) -> dict[str, Any]:
    return {'interface': words.name(), 'rate': words.number('a rate in bytes per second')}


def _read_garbage(words: _WordReader) -> dict[str, Any]:
    found: dict[str, Any] = {'interface': words.name()}
    if words.peek() not in ('at', _END):
        found['size'] = int(words.number('a number of bytes'))
    return found


def _read_slider(words: _WordReader) -> dict[str, Any]:
    return {'fraction': words.number('where the slider stands, 0 to 1')}


def _read_motion(words: _WordReader) -> dict[str, Any]:
    return {'axis': words.one_of(DEVIATION_AXES), 'distance': words.number('a distance')}


_Kind = tuple[Callable[..., Fault], Callable[[_WordReader], dict[str, Any]], bool]

#: What begins a fault: what it makes, how its arguments are read, whether it can last.
_KINDS: Mapping[str, _Kind] = MappingProxyType(
    {
        **{action.value: (EventFault, _event_reader(action), False) for action in FaultEvent},
        'slider': (SpeedSliderFault, _read_slider, False),
        'foreign_motion': (ForeignMotionFault, _read_motion, False),
        **{
            shape: (DeviationFault, _read_deviation(shape), True)
            for shape in get_args(DeviationShape)
        },
        'drop': (DropFault, _read_interface, True),
        'half_open': (HalfOpenFault, _read_interface, False),
        'silence': (SilenceFault, _read_interface, True),
        'delay': (DelayFault, _read_delay, True),
        'throttle': (ThrottleFault, _read_throttle, True),
        'garbage': (GarbageFault, _read_garbage, False),
    }
)


def parse_fault(text: str) -> Fault:
    """
    Return the fault that a text describes.

    :raises ValueError: a word is not understood; the text names it.
    """
    words = _WordReader(text)
    if words.peek() not in _KINDS:
        raise words.wrong(f'one of {", ".join(_KINDS)}')
    make, read, has_duration = _KINDS[words.take()]
    fields = read(words)
    if words.skip('at'):
        fields['trigger'] = _read_trigger(words)
    if has_duration and words.skip('for'):
        fields['duration'] = words.number('a time in seconds')
        if not words.skip('s'):
            raise words.wrong("'s'")
    if words.peek() != _END:
        raise words.wrong("'at', 'for' or the end" if has_duration else "'at' or the end")
    return make(**fields)


def _read_trigger(words: _WordReader) -> FaultTrigger:
    if words.peek() in ('x', 'y', 'z'):
        axis = words.one_of(('x', 'y', 'z'))
        if not words.skip('='):
            raise words.wrong("'='")
        plane = PlaneCrossing(axis, words.number('a coordinate in metres'))
        words.skip('m')
        return plane
    value = words.number('a time such as 2 s, a way such as 0.35 m, or a plane such as z = 0.3 m')
    if value < 0.0:
        raise words.wrong('no negative number', f'{value:g}')
    return AfterTime(value) if words.one_of(('s', 'm')) == 's' else AfterDistance(value)
