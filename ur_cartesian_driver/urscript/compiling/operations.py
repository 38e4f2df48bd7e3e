# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Operations for generated code, where Python's own operations differ from the language.

Each operation pays for the items of long values: it takes them from the thread's `fuel`, because
they take longer than one node of the tree.
"""

from __future__ import annotations

from collections.abc import Callable
import sys
from types import GeneratorType
from typing import Any, NoReturn, Protocol

from ur_cartesian_driver.urscript import script_values as values
from ur_cartesian_driver.urscript.compiling.generated_code import (
    place_of_call,
    ProgramHalted,
    recursion_error,
    SWITCH,
)
from ur_cartesian_driver.urscript.container_methods import call_method
from ur_cartesian_driver.urscript.script_values import (
    FLOATS,
    NUMBERS,
    SIZED,
    ThreadHandle,
    Value,
)

#: Names of the operators in generated code.
OPERATORS = {
    '+': 'add', '-': 'subtract', '*': 'multiply', '/': 'divide', '%': 'remainder',
    '==': 'equal', '!=': 'differ', '<': 'less', '<=': 'at_most', '>': 'more', '>=': 'at_least',
}  # fmt: skip
#: The value of a parameter that a call leaves out.
UNSET = object()


class Runtime(Protocol):
    """The interpreter that runs generated code."""

    #: Nodes that the running thread may still evaluate in this frame.
    fuel: int
    paused: bool
    #: Whether the running thread is in a critical section.
    in_critical_section: bool

    def exceed_budget(self) -> NoReturn:
        """Raise the error of a thread that used up its fuel without yielding."""

    def switches_now(self) -> bool:
        """Return whether another thread runs before the next statement."""

    def spawn(self, function: Callable[[int], Any]) -> ThreadHandle:
        """Start a thread."""

    def alive(self, handle: Value) -> bool:
        """Return whether a value is the handle of a live thread."""

    def kill(self, handle: Value) -> None:
        """End a thread; ignore values that are not handles."""


def operations(runtime: Runtime) -> dict[str, Any]:
    """Return the operations, and other values that generated code uses, by global name."""

    def pay(items: int) -> None:
        runtime.fuel -= items
        if runtime.fuel < 0:
            runtime.exceed_budget()

    def paid(value: Value) -> Value:
        """Return the result of a builtin; pay for its items."""
        if type(value) in SIZED:
            pay(values.size_of(value))
        return value

    def copied(value: Value) -> Value:
        """Return a copy of a value, to store it or pass it on; pay for its items."""
        if type(value) is list and FLOATS.issuperset(map(type, value)):
            pay(len(value))
            return value[:]
        if type(value) in SIZED:
            pay(values.size_of(value))
            return values.copy(value)
        return value

    def make_list(items: list[Value]) -> Value:
        if items and type(items[0]) in SIZED:
            pay(sum(map(values.size_of, items)))
        return values.make_list(items)

    def get_item(container: Value, *key: Value) -> Value:
        """Return the item of a container, with a fast path for a valid index of a list."""
        if type(container) is list and len(key) == 1:
            (index,) = key
            if type(index) is int and 0 <= index < len(container):
                return container[index]
        return values.get_part(container, key)

    def call(target: Value, method: str, arguments: list[Value]) -> Value:
        """Call a method; if the result is a generator, the call takes time."""
        if isinstance(target, values.RemoteObject):
            return target.call(method, arguments)
        # Shifting the items of a list is quicker than copying them: 16 items cost one node.
        pay(values.size_of(target) // 16)
        return call_method(target, method, arguments)

    def operator(symbol: str) -> Callable[[Value, Value], Value]:
        operate, compute = values.BINARY[symbol], values.COMPUTE.get(symbol)

        def binary(a: Value, b: Value) -> Value:
            kind_a, kind_b = type(a), type(b)
            if compute is not None and (kind_a is list or kind_b is list):
                # Nearly all lists contain only floats; their results need no check.
                if kind_b in NUMBERS:
                    if FLOATS.issuperset(map(type, a)):
                        pay(len(a) + 1)
                        return [compute(item, b) for item in a]
                elif kind_a in NUMBERS:
                    if FLOATS.issuperset(map(type, b)):
                        pay(len(b) + 1)
                        return [compute(a, item) for item in b]
                elif kind_a is kind_b and len(a) == len(b):
                    if FLOATS.issuperset(map(type, a)) and FLOATS.issuperset(map(type, b)):
                        pay(2 * len(a))
                        return list(map(compute, a, b))
            if kind_a in SIZED or kind_b in SIZED:
                pay(values.work_on(a, b))
            return operate(a, b)

        return binary

    def unary(operate: Callable[[Value], Value]) -> Callable[[Value], Value]:
        return lambda value: operate(copied(value))

    return {
        'runtime': runtime,
        'SWITCH': SWITCH,
        'UNSET': UNSET,
        'NUMBERS': values.NUMBERS,
        'Generator': GeneratorType,
        'alive': runtime.alive,
        'call': call,
        'copied': copied,
        'exceed_budget': runtime.exceed_budget,
        'get_item': get_item,
        'get_part': values.get_part,
        'halt': _halt,
        'kill': runtime.kill,
        'make_list': make_list,
        'make_pose': values.make_pose,
        'minus': unary(values.negate),
        'paid': paid,
        'plus': unary(values.identity),
        'set_part': values.set_part,
        'spawn': runtime.spawn,
        'switches': runtime.switches_now,
        'too_deep': _refuse_depth,
        'truth': values.truth,
        **{name: operator(symbol) for symbol, name in OPERATORS.items()},
    }


def _halt() -> NoReturn:
    raise ProgramHalted


def _refuse_depth() -> NoReturn:
    """Raise the error for calls nested too deeply, with the position of the call."""
    raise recursion_error(*place_of_call(sys._getframe(2)))
