# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The motion calls that a recorded program made, from the text of the program."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from math import isfinite

from ur_cartesian_driver.urscript import CompileError, parse_line
from ur_cartesian_driver.urscript.parsing import syntax_tree as tree

#: The parameters of each function in their order, behind its target.
_PARAMETERS = {'movej': ('q', 'a', 'v', 't', 'r'), 'movel': ('pose', 'a', 'v', 't', 'r')}
#: Statements whose parts may run never, or more than once.
_BRANCHES = (tree.IfStatement, tree.SwitchStatement, tree.WhileStatement, tree.FunctionDefinition)


@dataclass(frozen=True, slots=True, kw_only=True)
class MotionCommand:
    """
    A call of ``movej`` or ``movel``; what was left out is None [m or rad, s].

    Its blend radius is checked, but not kept: blended moves are no trapezoids.
    """

    name: str
    a: float | None = None
    v: float | None = None
    t: float | None = None


def read_commands(text: str, name: str) -> list[MotionCommand]:
    """
    Return the calls of a text in their order; other statements are skipped.

    :param text: calls, ``movel(there, a=1, v=0.2)``, or a program that makes them.
    :param name: of the file, for error texts.
    :raises ValueError: the text is no URScript, an argument is no number, or a call stands where
        it may be made never or more than once.
    """
    try:
        program = parse_line(text)
    except CompileError as error:
        raise ValueError(
            f'{name}, line {error.line}: this is no call of URScript: {error.reason}'
        ) from None
    commands = [_command(call, name) for call in _calls(program.body, name)]
    if not commands:
        raise ValueError(f'{name} has no call of movej or movel; write one a line')
    return commands


def _calls(body: tree.StatementBlock, name: str) -> Iterator[tree.CallExpression]:
    """Yield the calls of a text; a function that is all of the text is the program."""
    if len(body) == 1 and isinstance(body[0], tree.FunctionDefinition):
        body = body[0].body
    yield from _calls_once(body, name)


def _calls_once(body: tree.StatementBlock, name: str) -> Iterator[tree.CallExpression]:
    for statement in body:
        for call in _calls_below(statement):
            if isinstance(statement, _BRANCHES):
                raise ValueError(
                    f'{name}, line {call.line}: {call.function} stands in a loop, a branch or a '
                    'function; write its calls out, in the order in which they were made'
                )
            yield call


def _calls_below(node: tree.SyntaxNode) -> Iterator[tree.CallExpression]:
    if isinstance(node, tree.CallExpression) and node.function in _PARAMETERS:
        yield node
    for child in tree.children(node):
        yield from _calls_below(child)


def _command(call: tree.CallExpression, name: str) -> MotionCommand:
    """Bind the arguments of a call; 0 s and 0 m are as good as left out."""
    parameters, found = _PARAMETERS[call.function], {}
    for place, argument in enumerate(call.arguments):
        key = argument.name or (parameters[place] if place < len(parameters) else '')
        if key not in parameters:
            raise ValueError(
                f'{name}, line {call.line}: {call.function} has no argument '
                f'{argument.name or f"number {place + 1}"}; it has {", ".join(parameters)}'
            )
        if key == parameters[0]:
            continue
        value = _number(argument.value)
        if value is None:
            raise ValueError(
                f'{name}, line {call.line}: {key} of {call.function} is no plain number; write '
                'the number that it had'
            )
        if not (isfinite(value) and (value > 0.0 or (value == 0.0 and key in 'tr'))):
            least = '0 or more' if key in 'tr' else 'more than 0'
            raise ValueError(
                f'{name}, line {call.line}: {key} of {call.function} is {value:g}; it must be '
                f'{least}'
            )
        if value and key != 'r':
            found[key] = value
    return MotionCommand(name=call.function, **found)


def _number(node: tree.Expression) -> float | None:
    """Return a number with any signs; None = the text is not one."""
    if isinstance(node, tree.UnaryExpression) and node.operator in ('-', '+'):
        value = _number(node.operand)
        return -value if value is not None and node.operator == '-' else value
    if isinstance(node, tree.ConstantExpression) and node.kind in ('int', 'float'):
        assert isinstance(node.value, int | float)
        return float(node.value)
    return None
