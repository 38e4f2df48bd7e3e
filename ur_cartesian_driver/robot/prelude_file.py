# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Read the file of the parameter ``script_prelude``: functions, threads and assignments only."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from ur_cartesian_driver.program.prelude import Prelude, PreludeFunction
from ur_cartesian_driver.program.render import MARKERS, PREFIX, PROGRAM_NAME, taken_names
from ur_cartesian_driver.urscript.parsing.parser import parse_line
from ur_cartesian_driver.urscript.parsing.syntax_tree import (
    AssignStatement,
    children,
    FunctionDefinition,
    NameExpression,
    Statement,
    SyntaxNode,
)
from ur_cartesian_driver.urscript.script_errors import CompileError

#: Size [characters] above which a file must be a mistake.
MAX_SIZE = 200_000


def read_prelude(path: str) -> Prelude:
    """
    Return the prelude in a file: its lines of code, and the functions that goals can call.

    :raises ValueError: the file cannot be read or is no prelude; the text names file and line.
    """
    file = Path(path).expanduser()
    try:
        with file.open(encoding='utf-8-sig') as stream:
            text = stream.read(MAX_SIZE + 1)
    except (OSError, UnicodeDecodeError) as error:
        reason = error.strerror if isinstance(error, OSError) else 'it is not text in UTF-8'
        raise ValueError(f'script_prelude is {path!r}, which cannot be read: {reason}.') from None
    if len(text) > MAX_SIZE:
        raise ValueError(f'script_prelude is {path!r}, which has more than {MAX_SIZE} characters.')
    return compile_prelude(text, file.name)


def compile_prelude(text: str, name: str) -> Prelude:
    """
    Return the prelude in a text: its lines of code, and the functions that goals can call.

    :param name: name of the file, for error texts.
    :raises ValueError: the text is no prelude; the error text names file and line.
    """
    try:
        statements = parse_line(text).body
    except CompileError as error:
        raise ValueError(f'script_prelude: {name}, line {error.line}: {error.reason}.') from None
    calls, local_names = taken_names()
    lines: dict[str, int] = {}
    variables: set[str] = set()
    functions: list[PreludeFunction] = []
    for statement in statements:
        defined = _defined_name(statement)
        where = f'script_prelude: {name}, line {statement.line}:'
        if defined is None:
            raise ValueError(
                f'{where} only functions (def), threads and assignments are allowed at the top '
                'level; move this line into a function.'
            )
        is_variable = isinstance(statement, AssignStatement)
        if defined in lines and not (is_variable and defined in variables):
            raise ValueError(f'{where} {defined} is defined in line {lines[defined]}, too.')
        lines[defined] = statement.line
        if is_variable:
            variables.add(defined)
        if defined in local_names:
            raise ValueError(
                f"{where} {defined} is a local name of the driver's own program, and which of "
                'the two a controller reads is not documented; choose another name.'
            )
        if isinstance(statement, FunctionDefinition):
            if defined == PROGRAM_NAME or defined in calls:
                raise ValueError(
                    f'{where} {defined} is a function of the controller that the driver uses; '
                    'choose another name.'
                )
            if statement.kind == 'def':
                functions.append(_function(statement))
        for node, word in _names(statement):
            if word.startswith(PREFIX):
                raise ValueError(
                    f'script_prelude: {name}, line {node.line}: {word} begins with {PREFIX}, as '
                    "the names of the driver's own program do; choose another name."
                )
    if not functions:
        raise ValueError(f'script_prelude: {name} defines no function (def).')
    return Prelude(file=name, lines=tuple(_code_lines(text, name)), functions=tuple(functions))


def _code_lines(text: str, name: str) -> Iterator[str]:
    """
    Yield the lines of code, without comments, because External Control's markers are comments.

    :raises ValueError: a line of code contains a marker.
    """
    for number, line in enumerate(text.split('\n'), start=1):
        if line.lstrip()[:1] in ('', '#'):
            continue
        for marker in sorted(MARKERS):
            if marker in line:
                raise ValueError(
                    f'script_prelude: {name}, line {number}: the External Control node divides '
                    f"the program at '{marker}'; remove it from this line."
                )
        yield line


def _defined_name(statement: Statement) -> str | None:
    """Return the name that a top-level statement defines; None = it defines none."""
    if isinstance(statement, FunctionDefinition):
        return statement.name
    if isinstance(statement, AssignStatement) and isinstance(statement.target, NameExpression):
        return statement.target.identifier
    return None


def _function(definition: FunctionDefinition) -> PreludeFunction:
    parameters = definition.parameters
    return PreludeFunction(
        name=definition.name,
        required=sum(parameter.default is None for parameter in parameters),
        allowed=len(parameters),
    )


def _names(node: SyntaxNode) -> Iterator[tuple[SyntaxNode, str]]:
    """Yield the names in a node and below it, each with the node that has it."""
    for field in ('identifier', 'name', 'function', 'thread'):
        if isinstance(word := getattr(node, field, None), str):
            yield node, word
    for child in children(node):
        yield from _names(child)
