# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Python code generated from a program, and the positions in the program's text that it keeps.

Each function and thread of a program becomes a Python function; if it can take time, a generator
function. The instructions have the lines and columns of the program's text, so an error or a call
has the position of its instruction.
"""

from __future__ import annotations

from collections.abc import Generator, Iterator, Sequence
from dataclasses import dataclass
import dis
from itertools import islice
import re
from types import CodeType, FrameType, GeneratorType
from typing import Any

from ur_cartesian_driver.urscript.compiling.scopes import Scope
from ur_cartesian_driver.urscript.script_errors import RuntimeException
from ur_cartesian_driver.urscript.script_values import Value

#: The file of all generated code.
FILE_NAME = '<URScript>'
#: Deepest nesting of calls of the program's functions.
MAX_CALL_DEPTH = 100

#: A thread yields SWITCH to let another thread run in the same controller cycle; it yields None to
#: wait for the next cycle.
SWITCH = object()

#: The steps of a thread. Each step ends when the thread takes time or lets another thread run.
ScriptSteps = Generator[Any, None, Value]
#: Line and column in the program's text, from 1; 0, 0 = unknown.
Place = tuple[int, int]


class ProgramHalted(BaseException):
    """Raised in the running thread to end it, because the program ends; not an error."""


@dataclass(frozen=True, slots=True)
class GeneratedFunction:
    """The name of a generated function, and whether it can take time."""

    name: str
    suspends: bool


@dataclass(frozen=True, slots=True)
class FunctionCode:
    """The code of a function and of its parts."""

    #: Executing a unit defines a Python function: the function itself, or a part of it.
    units: Sequence[CodeType]
    #: Immutable values that the code looks up by name.
    constants: dict[str, Value]


@dataclass(frozen=True, slots=True, kw_only=True)
class GeneratedCode:
    """The code of a program or line. It holds no state, so many interpreters can run it."""

    scope: Scope
    main: GeneratedFunction
    #: The functions and threads, by the identity of their scopes.
    functions: dict[int, GeneratedFunction]
    code: Sequence[FunctionCode]


def builtin_name(function: str) -> str:
    """Return the name of a builtin in generated code."""
    return f'b_{function}'


def global_name(variable: str) -> str:
    """Return the name of a global variable in generated code."""
    return f'g_{variable}'


def local_name(variable: str) -> str:
    """Return the name of a local variable or parameter in generated code."""
    return f'v_{variable}'


def place_of_call(frame: FrameType | None) -> Place:
    """Return the position of the innermost generated code among a frame and its callers."""
    while frame is not None and frame.f_code.co_filename != FILE_NAME:
        frame = frame.f_back
    return (0, 0) if frame is None else _place(frame.f_code, frame.f_lasti)


def place_of_steps(steps: ScriptSteps) -> Place:
    """Return the position at which a thread waits; 0, 0 = it does not wait."""
    place = (0, 0)
    inner: Iterator[Any] | None = steps
    while isinstance(inner, GeneratorType):
        if inner.gi_frame is not None and inner.gi_code.co_filename == FILE_NAME:
            place = _place(inner.gi_code, inner.gi_frame.f_lasti)
        inner = inner.gi_yieldfrom
    return place


def runtime_exception(error: Exception) -> RuntimeException:
    """Return the runtime exception, with its position, for an error of generated code."""
    traceback, innermost = error.__traceback__, None
    while traceback is not None:
        if traceback.tb_frame.f_code.co_filename == FILE_NAME:
            innermost = traceback
        traceback = traceback.tb_next
    error.__traceback__ = None  # a builtin may raise the same object again
    if innermost is None:
        return RuntimeException(str(error))
    code = innermost.tb_frame.f_code
    place = _place(code, innermost.tb_lasti)
    if isinstance(error, RuntimeException):
        return error.at(*place)
    if isinstance(error, RecursionError):
        return recursion_error(*place)
    variable = re.search(r"'[gv]_(\w+)'", str(error))
    if isinstance(error, NameError) and innermost.tb_next is None and variable:
        text = f'The variable {variable[1]!r} is read before a value is assigned to it.'
    else:
        text = f'{_called(code, place)}: {str(error) or type(error).__name__}'
    return RuntimeException(text, *place)


def recursion_error(line: int, column: int) -> RuntimeException:
    """Return the error for an endless recursion."""
    return RuntimeException('Function calls are nested too deeply.', line, column)


def _place(code: CodeType, instruction: int) -> Place:
    line, _, column, _ = next(islice(code.co_positions(), instruction // 2, None))
    return line or 0, column or 0


def _called(code: CodeType, place: Place) -> str:
    """Return the name of the builtin or method that is called at a position."""
    for instruction in dis.get_instructions(code):
        positions, name = instruction.positions, instruction.argval
        if positions and (positions.lineno, positions.col_offset) == place:
            if instruction.opname == 'LOAD_GLOBAL' and name.startswith(builtin_name('')):
                return str(name.removeprefix(builtin_name('')))
            if instruction.opname == 'LOAD_CONST' and isinstance(name, str):
                return name
    return code.co_name
