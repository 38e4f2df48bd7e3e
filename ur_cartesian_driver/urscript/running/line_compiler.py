# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Compiles lines for a running program, as in interpreter mode.

A line is any number of statements or function definitions. Each line sees the global variables and
functions of the program and of earlier lines. The program can forget the variables and functions
of all lines at once.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Protocol

from ur_cartesian_driver.urscript.compiling.compiler import compile_program
from ur_cartesian_driver.urscript.compiling.generated_code import GeneratedCode, ScriptSteps
from ur_cartesian_driver.urscript.compiling.scopes import Builtin, resolve, Scope
from ur_cartesian_driver.urscript.parsing import syntax_tree as tree
from ur_cartesian_driver.urscript.parsing.parser import parse_line
from ur_cartesian_driver.urscript.script_errors import CompileError


class LineRuntime(Protocol):
    """The interpreter that runs the program, as the line compiler uses it."""

    interleaves: bool

    def begin(self, code: GeneratedCode) -> ScriptSteps:
        """Add the code of a line; return the steps of its statements."""

    def forget(self, variables: Iterable[str]) -> None:
        """Forget global variables."""

    def drop(self, constants: Iterable[str]) -> None:
        """Drop constants that no code uses any more."""


@dataclass(frozen=True, slots=True)
class CompiledLine:
    """A compiled line; its steps can run once, in a thread of the program."""

    steps: ScriptSteps
    #: Names of the functions that its outermost statements call.
    calls: frozenset[str]


class LineCompiler:
    """Compiles the lines of one program and keeps their variables and functions."""

    def __init__(
        self, program: GeneratedCode, builtins: Mapping[str, Builtin], runtime: LineRuntime
    ) -> None:
        """Start without lines."""
        self._program = program
        self._builtins = builtins
        self._runtime = runtime
        self._count = 0
        self._reset()

    def _reset(self) -> None:
        scope = self._program.scope
        self._scope = Scope(parent=scope, owner=scope.owner, globals=set(scope.globals))
        self._functions = dict(self._program.functions)

    def forget(self) -> None:
        """Forget the variables and functions of all lines."""
        self._runtime.forget(self._scope.globals - self._program.scope.globals)
        self._reset()

    def compile(self, text: str) -> CompiledLine:
        """
        Compile a line without running it; later lines know its variables and functions.

        :raises CompileError: the text is not a line, has an unknown name, or has a call with wrong
            arguments.
        """
        program = parse_line(text)
        self._count += 1
        try:
            scope = resolve(program, self._builtins, enclosing=self._scope)
            code = compile_program(
                scope,
                self._builtins,
                self._functions,
                interleaves=self._runtime.interleaves,
                prefix=f'line{self._count}_',
            )
        except RecursionError:
            raise CompileError(1, 1, 'syntax_error_on_line:1:', 'nested too deeply') from None
        self._scope.globals = scope.globals
        self._scope.functions.update(scope.functions)
        self._functions |= code.functions
        del self._functions[id(scope)]
        calls = frozenset(
            node.call.function
            for node in program.body
            if isinstance(node, tree.CallStatement) and isinstance(node.call, tree.CallExpression)
        )
        return CompiledLine(self._steps(code), calls)

    def _steps(self, code: GeneratedCode) -> ScriptSteps:
        """Return the steps of a line; its constants are dropped after the last step."""
        steps, (statements, *_) = self._runtime.begin(code), code.code
        if not statements.constants:
            return steps

        def all_steps() -> ScriptSteps:
            try:
                return (yield from steps)
            finally:
                self._runtime.drop(statements.constants)

        return all_steps()
