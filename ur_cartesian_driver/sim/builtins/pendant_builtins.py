# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Script functions that show something on the pendant, or ask the person in front of it."""

from __future__ import annotations

from collections.abc import Callable, Generator
from dataclasses import dataclass
from math import isfinite
from typing import Any

from ur_cartesian_driver.sim.builtins.arguments import text
from ur_cartesian_driver.sim.builtins.builtin_group import BuiltinGroup
from ur_cartesian_driver.sim.motion.motion_ownership import Steps
from ur_cartesian_driver.sim.state.controller_state import Popup
from ur_cartesian_driver.urscript.script_errors import RuntimeException
from ur_cartesian_driver.urscript.script_values import INT_MAX, INT_MIN, to_text, truth, Value


@dataclass(frozen=True, slots=True)
class _Requested:
    """A kind of value that a program requests from the person at the pendant."""

    name: str
    #: The number of the value's type in messages of the primary interface.
    number: int
    #: Converts the typed text, or raises ValueError.
    read: Callable[[str], Value]


def _boolean(typed: str) -> bool:
    answers = {'yes': True, 'true': True, 'no': False, 'false': False}
    if typed.lower() not in answers:
        raise ValueError
    return answers[typed.lower()]


def _integer(typed: str) -> int:
    if not INT_MIN <= (value := int(typed)) <= INT_MAX:
        raise ValueError
    return value


def _float(typed: str) -> float:
    if not isfinite(value := float(typed)):
        raise ValueError
    return value


def _request(kind: _Requested) -> Callable[[Any, Value], Generator[None, None, Value]]:
    """Return the script function that asks the person at the pendant for a value."""

    def request(group: BuiltinGroup, message: Value) -> Generator[None, None, Value]:
        controller = group._controller
        if not text(message, 'message'):
            raise RuntimeException('message is empty; ask the person at the pendant something')
        controller.messages.request(kind.number, message)
        answers = controller.pendant.answers
        yield
        while not answers:
            yield
        try:
            return kind.read(typed := answers.popleft())
        except ValueError:
            raise RuntimeException(
                f'The answer {typed!r} of the person at the pendant is no {kind.name}.'
            ) from None

    request.__doc__ = f'Return what the person at the pendant answers ({kind.name}); wait for it.'
    return request


class PendantBuiltins(BuiltinGroup):
    """
    Messages, popups, and questions to the person at the pendant.

    A question waits without a time limit. Clients cannot answer it, because it is unknown how they
    answer a real robot; `SimulatedRobot.answer` answers in the person's place. The pendant's
    button Cancel stops the program, as `SimulatedRobot.stop_program` does. The dashboard command
    `close popup` does not close the question.
    """

    request_boolean_from_primary_client = _request(_Requested('boolean', 0, _boolean))
    request_integer_from_primary_client = _request(_Requested('integer', 1, _integer))
    request_float_from_primary_client = _request(_Requested('float', 2, _float))
    request_string_from_primary_client = _request(_Requested('string', 3, str))

    def textmsg(self, s1: Value, s2: Value = '') -> None:
        """Write a text to the log and send it to all clients of the primary interface."""
        self._controller.messages.text(to_text(s1) + to_text(s2))

    def popup(
        self,
        s: Value,
        title: Value = 'Popup',
        warning: Value = False,
        error: Value = False,
        blocking: Value = False,
    ) -> Steps:
        """Show a window; if it is blocking, wait until it is closed."""
        popup = Popup(
            text=to_text(s),
            title=to_text(title),
            warning=truth(warning),
            error=truth(error),
            blocking=truth(blocking),
        )
        self._controller.show_popup(popup)
        while popup.blocking and popup.open:
            yield
