# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The motion calls that a recorded program made, from the text of the program."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass
from itertools import groupby
from math import isfinite

from ur_cartesian_driver.motion.geometry.vectors import Vector6, vector6
from ur_cartesian_driver.urscript import CompileError, parse_line
from ur_cartesian_driver.urscript.parsing import syntax_tree as tree

#: The parameters of each function in their order; the first one is its target.
_PARAMETERS = {
    'movej': ('q', 'a', 'v', 't', 'r'),
    'movel': ('pose', 'a', 'v', 't', 'r'),
    'servoj': ('q', 'a', 'v', 't', 'lookahead_time', 'gain'),
}
#: Functions between two motions of servoj, which else are one.
_STOPS = ('stopj', 'stopl')
#: A target this close to the place of the arm leaves it there [rad].
_SAME_PLACE = 1e-4
#: Statements whose parts may run never, or more than once.
_BRANCHES = (tree.IfStatement, tree.SwitchStatement, tree.WhileStatement, tree.FunctionDefinition)


@dataclass(frozen=True, slots=True, kw_only=True)
class SetPoints:
    """
    The calls of ``servoj`` in a row that make one motion.

    :param targets: joint positions of each call [rad].
    :param times: its t [s].
    :param lookahead_time: of all of them [s]; ``gain``: of all of them.
    :param is_stopped: whether ``stopj`` or ``stopl`` follows.
    """

    targets: tuple[Vector6, ...]
    times: tuple[float, ...]
    lookahead_time: float = 0.1
    gain: float = 300.0
    is_stopped: bool = False

    def rest(self, q: Sequence[float]) -> float:
        """Return the time for which the first calls leave an arm at q [rad] in its place [s]."""
        passed = 0.0
        for target, time in zip(self.targets, self.times, strict=True):
            if max(abs(a - b) for a, b in zip(target, q, strict=True)) > _SAME_PLACE:
                break
            passed += time
        return passed


@dataclass(frozen=True, slots=True, kw_only=True)
class MotionCommand:
    """
    A call of ``movej`` or ``movel``, or a motion of ``servoj``.

    What was left out is None [m or rad, s].

    :param r: blend radius at its end [m].
    :param set_points: of ``servoj``, which has no a, v, t and r here.
    """

    name: str
    a: float | None = None
    v: float | None = None
    t: float | None = None
    r: float | None = None
    set_points: SetPoints | None = None


def read_commands(text: str, name: str) -> list[MotionCommand]:
    """
    Return the calls of a text in their order; other statements are skipped.

    :param text: calls, ``movel(there, a=1, v=0.2)``, or a program that makes them. Calls of
        ``servoj`` in a row are one motion.
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
    groups = [
        (function, list(calls))
        for function, calls in groupby(_calls(program.body, name), lambda call: call.function)
    ]
    commands: list[MotionCommand] = []
    for (function, calls), (after, _) in zip(groups, [*groups[1:], ('', [])], strict=False):
        if function == 'servoj':
            commands.append(_set_points(calls, name, after in _STOPS))
        elif function not in _STOPS:
            commands += [_command(call, name) for call in calls]
    if not commands:
        raise ValueError(f'{name} has no call of movej, movel or servoj; write one a line')
    return commands


def _calls(body: tree.StatementBlock, name: str) -> Iterator[tree.CallExpression]:
    """Yield the calls of a text; a function that is all of the text is the program."""
    if len(body) == 1 and isinstance(body[0], tree.FunctionDefinition):
        body = body[0].body
    yield from _calls_once(body, name)


def _calls_once(body: tree.StatementBlock, name: str) -> Iterator[tree.CallExpression]:
    for statement in body:
        for call in _calls_below(statement):
            if isinstance(statement, _BRANCHES) and call.function in _PARAMETERS:
                raise ValueError(
                    f'{name}, line {call.line}: {call.function} stands in a loop, a branch or a '
                    'function; write its calls out, in the order in which they were made'
                )
            yield call


def _calls_below(node: tree.SyntaxNode) -> Iterator[tree.CallExpression]:
    if isinstance(node, tree.CallExpression) and node.function in (*_PARAMETERS, *_STOPS):
        yield node
    for child in tree.children(node):
        yield from _calls_below(child)


def _command(call: tree.CallExpression, name: str) -> MotionCommand:
    """Return a call of movej or movel; 0 s and 0 m are as good as left out."""
    found = _numbers(call, name, may_be_0='tr')
    return MotionCommand(
        name=call.function,
        a=found.get('a'),
        v=found.get('v'),
        t=found.get('t') or None,
        r=found.get('r') or None,
    )


def _set_points(calls: list[tree.CallExpression], name: str, is_stopped: bool) -> MotionCommand:
    """Return the motion that calls of servoj in a row make; its a and v have no effect."""
    targets, numbers = [], []
    for call in calls:
        where = f'{name}, line {call.line}'
        q = _bound(call, name).get('q')
        items = q.items if isinstance(q, tree.ListLiteral) else ()
        joints = [value for item in items if (value := _number(item)) is not None]
        if len(joints) != 6 or len(items) != 6:
            raise ValueError(
                f'{where}: q of servoj is no list of six plain numbers; write the positions that '
                'it had [rad]'
            )
        found = _numbers(call, name, may_be_0=('a', 'v'))
        if 't' not in found:
            raise ValueError(
                f'{where}: servoj leaves t out; write the time that it had, 0.002 s (CB3: 0.008 s)'
            )
        targets.append(vector6(joints))
        numbers.append(found)
        if any(found.get(key) != numbers[0].get(key) for key in ('lookahead_time', 'gain')):
            raise ValueError(
                f'{where}: servoj has another lookahead_time or gain than the call before; record '
                'motions that keep both'
            )
    points = SetPoints(
        targets=tuple(targets),
        times=tuple(each['t'] for each in numbers),
        lookahead_time=numbers[0].get('lookahead_time', 0.1),
        gain=numbers[0].get('gain', 300.0),
        is_stopped=is_stopped,
    )
    return MotionCommand(name='servoj', set_points=points)


def _bound(call: tree.CallExpression, name: str) -> dict[str, tree.Expression]:
    """
    Return the arguments of a call by their parameters.

    :raises ValueError: the function has no such parameter.
    """
    parameters, found = _PARAMETERS[call.function], {}
    for place, argument in enumerate(call.arguments):
        key = argument.name or (parameters[place] if place < len(parameters) else '')
        if key not in parameters:
            raise ValueError(
                f'{name}, line {call.line}: {call.function} has no argument '
                f'{argument.name or f"number {place + 1}"}; it has {", ".join(parameters)}'
            )
        found[key] = argument.value
    return found


def _numbers(call: tree.CallExpression, name: str, may_be_0: Collection[str]) -> dict[str, float]:
    """
    Return the arguments of a call, without its target.

    :param may_be_0: parameters that may be 0; others have to be more.
    :raises ValueError: an argument is no number, or is too small.
    """
    found = {}
    for key, argument in _bound(call, name).items():
        if key == _PARAMETERS[call.function][0]:
            continue
        value = _number(argument)
        if value is None:
            raise ValueError(
                f'{name}, line {call.line}: {key} of {call.function} is no plain number; write '
                'the number that it had'
            )
        if not (isfinite(value) and (value > 0.0 or (value == 0.0 and key in may_be_0))):
            least = '0 or more' if key in may_be_0 else 'more than 0'
            raise ValueError(
                f'{name}, line {call.line}: {key} of {call.function} is {value:g}; it must be '
                f'{least}'
            )
        found[key] = value
    return found


def _number(node: tree.Expression) -> float | None:
    """Return a number with any signs; None = the text is not one."""
    if isinstance(node, tree.UnaryExpression) and node.operator in ('-', '+'):
        value = _number(node.operand)
        return -value if value is not None and node.operator == '-' else value
    if isinstance(node, tree.ConstantExpression) and node.kind in ('int', 'float'):
        assert isinstance(node.value, int | float)
        return float(node.value)
    return None
