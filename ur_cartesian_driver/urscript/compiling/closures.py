# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Compiled code, and the interface of the interpreter that runs it.

The code of an expression or statement is a function of the frame (the list of a function's local
values). Code that cannot take time is a plain function. Code that can take time (a generator
builtin, `join`, a call of a function that contains one of them) is a generator function; only such
code is called by `yield from`. The code of a statement returns None to continue, or one of the
signals below.
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Sequence
from dataclasses import dataclass, field
from typing import Any, NoReturn, Protocol

from ur_cartesian_driver.urscript.script_errors import RuntimeException
from ur_cartesian_driver.urscript.script_values import ThreadHandle, Value

#: Deepest nesting of calls of the program's functions.
MAX_CALL_DEPTH = 100

StackFrame = list[Any]
ScriptSteps = Generator[Any, None, Value]
RunFunction = Callable[[StackFrame], Any]

# Signals of statements.
BREAK = 'break'
CONTINUE = 'continue'
RETURN = 'return'

#: A thread yields SWITCH to let another thread run in the same controller cycle; it yields None to
#: take time.
SWITCH = object()


class _Unset:
    """The value of a variable before its first assignment."""


UNSET = _Unset()


class ProgramHalted(BaseException):
    """Unwinds the running thread because the program ends; not an error."""


class Thread(Protocol):
    """The thread that runs compiled code."""

    depth: int
    location: tuple[int, int]
    in_critical_section: bool


class Runtime(Protocol):
    """The interpreter that runs compiled code."""

    fuel: int
    paused: bool
    globals: list[Any]
    #: Whether threads may be switched between any two statements.
    interleaves: bool

    @property
    def thread(self) -> Thread:
        """The running thread."""

    def raise_budget_exceeded(self, line: int, column: int) -> NoReturn:
        """Raise an error: the thread used up its budget without yielding."""

    def pay_for(self, items: int, line: int, column: int) -> None:
        """Spend fuel on the items of a long value: they take longer than one node."""

    def switches_now(self) -> bool:
        """Return whether another thread runs before the next statement."""

    def spawn(self, procedure: CompiledFunction) -> ThreadHandle:
        """Start a thread."""

    def alive(self, handle: Value) -> bool:
        """Return whether a value is the handle of a live thread."""

    def kill(self, handle: Value) -> None:
        """End a thread; ignore values that are not handles."""


@dataclass(frozen=True, slots=True)
class CompiledNode:
    """A compiled node: its code, whether it can take time, and its cost."""

    run: RunFunction
    suspends: bool = False
    weight: int = 1


@dataclass(slots=True, kw_only=True)
class CompiledFunction:
    """A compiled function or thread; its body is set later, because functions call each other."""

    name: str
    suspends: bool
    template: StackFrame
    defaults: dict[int, CompiledNode] = field(default_factory=dict)
    body: CompiledNode = CompiledNode(lambda frame: None)

    def steps(self) -> ScriptSteps:
        """Run as the main function of a thread."""
        frame = self.template.copy()
        if self.body.suspends:
            yield from self.body.run(frame)
        else:
            self.body.run(frame)
        return None


def sequence(
    parts: Sequence[CompiledNode], finish: Callable[[StackFrame, list[Value]], Value]
) -> CompiledNode:
    """Evaluate parts from left to right, then combine their values."""
    runs = [part.run for part in parts]

    def plain(frame: StackFrame) -> Value:
        return finish(frame, [run(frame) for run in runs])

    def plain_one(frame: StackFrame) -> Value:
        return finish(frame, [first(frame)])

    def plain_two(frame: StackFrame) -> Value:
        return finish(frame, [first(frame), second(frame)])

    def steps(frame: StackFrame) -> ScriptSteps:
        found = []
        for part in parts:
            value = (yield from part.run(frame)) if part.suspends else part.run(frame)
            found.append(value)
        return finish(frame, found)

    first, second = (*runs, plain, plain)[:2]
    chosen = {1: plain_one, 2: plain_two}.get(len(runs), plain)
    return choose_runner(chosen, steps, parts)


def choose_runner(
    plain: RunFunction, steps: RunFunction, parts: Sequence[CompiledNode]
) -> CompiledNode:
    """Return a node that runs `steps` if any part can take time, else `plain`."""
    suspends = any(part.suspends for part in parts)
    return CompiledNode(
        steps if suspends else plain, suspends, 1 + sum(part.weight for part in parts)
    )


def recursion_error(line: int, column: int) -> RuntimeException:
    """Return the error for an endless recursion."""
    return RuntimeException('Function calls are nested too deeply.', line, column)
