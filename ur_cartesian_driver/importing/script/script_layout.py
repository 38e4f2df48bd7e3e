# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Extracts the program from a file, and marks the loops that would not end in an import.

A file contains a program, as a controller accepts it; or functions and statements, as PolyScope
inserts them into its own programs; or a program and a call of it; or only functions. A call of
:data:`END_OF_ROUND` is added to each endless loop, a call of :data:`WAIT` replaces a loop that
waits for an input, and a call of :data:`PAUSE` replaces a statement ``pause``. The names of these
functions begin with a blank, so that no program can define them.
"""

from __future__ import annotations

from dataclasses import fields, replace
import re
from typing import Any

from ur_cartesian_driver.importing.imported_path import BrokenFile
from ur_cartesian_driver.importing.script.script_terms import TERMS
from ur_cartesian_driver.urscript import CompileError, parse_line, ScriptProgram
from ur_cartesian_driver.urscript.parsing.syntax_tree import (
    AssignStatement,
    BinaryExpression,
    BreakStatement,
    CallArgument,
    CallExpression,
    CallStatement,
    children,
    ConstantExpression,
    ContinueStatement,
    Expression,
    FunctionDefinition,
    HaltStatement,
    IfStatement,
    LabelStatement,
    PauseStatement,
    ReturnStatement,
    Statement,
    SyntaxNode,
    UnaryExpression,
    WhileStatement,
)
from ur_cartesian_driver.urscript.script_values import truth

END_OF_ROUND, WAIT, PAUSE = ' end of round', ' wait', ' pause'

#: Matches a file whose first statement is a secondary program.
_SECONDARY = re.compile(r'(?:\s|#.*\n)*(sec)\s+\w+\s*\(')
#: Nodes that contain no statements.
_SIMPLE = (Expression, CallStatement, AssignStatement, LabelStatement)
#: Functions that read the inputs for which a loop can wait.
_INPUTS = (
    'get_standard_digital_in',
    'get_configurable_digital_in',
    'get_tool_digital_in',
    'get_digital_in',
)


def parsed(text: str) -> ScriptProgram:
    """
    Return the program of a file.

    :raises BrokenFile: the text is no URScript, is a secondary program, or has only functions,
        none of which is clearly the main one.
    """
    if secondary := _SECONDARY.match(text):
        line = text.count('\n', 0, secondary.start(1)) + 1
        raise BrokenFile(line, f'sec: {TERMS["sec"].reason}')
    try:
        found = parse_line(text)
    except CompileError as error:
        raise BrokenFile(max(1, error.line), f'this is no URScript: {error.reason}') from None
    return replace(found, body=tuple(map(_without_waiting, _main(found))))


def _main(program: ScriptProgram) -> tuple[Statement, ...]:
    """Return the statements of the main program."""
    functions = [
        node
        for node in program.body
        if isinstance(node, FunctionDefinition) and node.kind == 'def'
    ]
    statements = [
        node
        for node in program.body
        if not isinstance(node, FunctionDefinition | LabelStatement | AssignStatement)
    ]
    if not functions:
        return program.body
    if len(functions) == 1 and not functions[0].parameters:
        # A controller takes the only function as the program, and its variables as global.
        only = functions[0]
        if not statements or (len(statements) == 1 and _calls(statements[0]) == [only.name]):
            others = (node for node in program.body if node not in (only, *statements))
            return (*others, *only.body)
    if statements:
        return program.body
    return *program.body, _call(_only_root(functions))


def _only_root(functions: list[FunctionDefinition]) -> FunctionDefinition:
    """
    Return the only function that no function calls; it must have no parameters.

    :raises BrokenFile: the function has parameters, or there is not exactly one such function.
    """
    called = {name for function in functions for node in function.body for name in _calls(node)}
    roots = [function for function in functions if function.name not in called]
    if len(roots) == 1 and not roots[0].parameters:
        return roots[0]
    named = ', '.join(
        f'{function.name}({", ".join(parameter.name for parameter in function.parameters)})'
        for function in functions[:5]
    )
    more = f' and {len(functions) - 5} more' if len(functions) > 5 else ''
    example = (roots or functions)[0]
    values = ', with values' if example.parameters else ''
    raise BrokenFile(
        functions[0].line,
        f'the file only defines functions, {named}{more}, and calls none; add a call of '
        f'{example.name} at its end{values}',
    )


def _calls(node: SyntaxNode) -> list[str]:
    """Return the names of all functions that a statement calls."""
    own = [node.function] if isinstance(node, CallExpression) else []
    return own + [name for child in children(node) for name in _calls(child)]


def _call(node: Any, name: str = '', *arguments: Expression) -> CallStatement:
    """Return a call at a node's position, of the named function or else of the node's own."""
    place = {'line': node.line, 'column': node.column}
    given = tuple(CallArgument(name=None, value=value, **place) for value in arguments)
    return CallStatement(
        call=CallExpression(function=name or node.name, arguments=given, **place), **place
    )


def _without_waiting(node: SyntaxNode) -> Any:
    """Return a statement with the three calls that the module's docstring describes."""
    if isinstance(node, PauseStatement):
        return _call(node, PAUSE)
    if isinstance(node, WhileStatement):
        if (wait := _input_wait(node)) is not None:
            return wait
        if _is_endless(node):
            node = replace(node, body=(*node.body, _call(node, END_OF_ROUND)))
    elif isinstance(node, _SIMPLE):
        return node
    changed: dict[str, Any] = {}
    for field in fields(node):
        value = getattr(node, field.name)
        if isinstance(value, tuple) and value and isinstance(value[0], SyntaxNode):
            new = tuple(map(_without_waiting, value))
            if any(a is not b for a, b in zip(new, value, strict=True)):
                changed[field.name] = new
    return replace(node, **changed) if changed else node


def _is_endless(loop: WhileStatement) -> bool:
    """Return whether a loop's condition is always true, and no statement ends a round early."""
    return _is_true(loop.condition) and not any(_may_end(statement) for statement in loop.body)


def _is_true(condition: Expression) -> bool:
    return isinstance(condition, ConstantExpression) and truth(condition.value)


def _may_end(node: SyntaxNode, in_loop: bool = False) -> bool:
    """Return whether a statement can leave the loop around it, or begin its next round."""
    if isinstance(node, FunctionDefinition):
        return False
    if isinstance(node, HaltStatement | ReturnStatement):
        return True
    if isinstance(node, BreakStatement | ContinueStatement):
        return not in_loop
    inner = in_loop or isinstance(node, WhileStatement)
    return any(_may_end(child, inner) for child in children(node))


def _input_wait(loop: WhileStatement) -> CallStatement | None:
    """Return the call that replaces a loop if the loop only waits for a digital input."""
    rest = tuple(statement for statement in loop.body if not _only_waits(statement))
    if not rest:
        read, level = _input_level(loop.condition)
    elif len(rest) == 1 and (leaves := _break_condition(rest[0])) and _is_true(loop.condition):
        read, level = _input_level(leaves)
        level = not level
    else:
        return None
    if read is None or read.function not in _INPUTS or len(read.arguments) != 1:
        return None
    name, awaited = (
        ConstantExpression(value=value, line=loop.line, column=loop.column)
        for value in (read.function, not level)
    )
    return _call(loop, WAIT, name, read.arguments[0].value, awaited)


def _only_waits(statement: Statement) -> bool:
    """Return whether a statement does nothing but take time."""
    call = statement.call if isinstance(statement, CallStatement) else None
    waits = isinstance(call, CallExpression) and call.function in ('sync', 'sleep')
    return waits or isinstance(statement, LabelStatement)


def _break_condition(statement: Statement) -> Expression | None:
    """Return the condition of an `if` that only leaves the loop; None = it is no such `if`."""
    if not isinstance(statement, IfStatement) or len(statement.branches) > 1:
        return None
    (branch,) = statement.branches
    body = [each for each in branch.body if not isinstance(each, LabelStatement)]
    only_leaves = len(body) == 1 and isinstance(body[0], BreakStatement)
    return branch.condition if only_leaves and not statement.otherwise else None


def _input_level(condition: Expression) -> tuple[CallExpression | None, bool]:
    """Return the call in a condition, and the value of the call that makes the condition true."""
    if isinstance(condition, UnaryExpression) and condition.operator == 'not':
        read, level = _input_level(condition.operand)
        return read, not level
    if isinstance(condition, BinaryExpression) and condition.operator in ('==', '!='):
        for side, other in ((condition.left, condition.right), (condition.right, condition.left)):
            if isinstance(other, ConstantExpression) and type(other.value) is bool:
                read, level = _input_level(side)
                return read, level is (other.value is (condition.operator == '=='))
    return (condition if isinstance(condition, CallExpression) else None), True
