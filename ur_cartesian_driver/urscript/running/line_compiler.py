# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Compiles lines for a running program, as in interpreter mode.

A line is any number of statements or function definitions. Each line sees the global variables and
functions of the program and of earlier lines. The variables and functions that lines define can be
forgotten, all of them at once.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from ur_cartesian_driver.urscript.compiling.closures import (
    CompiledFunction,
    Runtime,
    ScriptSteps,
    UNSET,
)
from ur_cartesian_driver.urscript.compiling.compiler import compile_program
from ur_cartesian_driver.urscript.compiling.scopes import Builtin, resolve, Scope
from ur_cartesian_driver.urscript.parsing import syntax_tree as tree
from ur_cartesian_driver.urscript.parsing.parser import parse_line
from ur_cartesian_driver.urscript.script_errors import CompileError


@dataclass(frozen=True, slots=True)
class CompiledLine:
    """A line that can run once, in a thread of the program."""

    steps: ScriptSteps
    #: Names of the functions that its outermost statements call.
    calls: frozenset[str]


class LineCompiler:
    """Compiles the lines of one program and keeps their variables and functions."""

    def __init__(
        self,
        program: Scope,
        procedures: dict[int, CompiledFunction],
        builtins: Mapping[str, Builtin],
        runtime: Runtime,
    ) -> None:
        """
        Start without lines.

        :param program: the scope of the program's body.
        :param procedures: the program's compiled functions, by the identity of their scopes.
        """
        self._program = program
        self._of_program = procedures
        self._builtins = builtins
        self._runtime = runtime
        self._slots = len(runtime.globals)
        self.forget()

    def forget(self) -> None:
        """Forget the variables and functions of all lines."""
        self._scope = Scope(
            parent=self._program, owner=self._program.owner, globals=dict(self._program.globals)
        )
        self._procedures = dict(self._of_program)
        del self._runtime.globals[self._slots :]

    def compile(self, text: str) -> CompiledLine:
        """
        Compile a line without running it; later lines know its functions from now on.

        :raises CompileError: the text is not a line, has an unknown name, or has a call with wrong
            arguments.
        """
        program = parse_line(text)
        try:
            scope = resolve(program, self._builtins, enclosing=self._scope)
            procedure = compile_program(scope, self._builtins, self._runtime, self._procedures)
        except RecursionError:
            raise CompileError(1, 1, 'syntax_error_on_line:1:', 'nested too deeply') from None
        self._scope.globals = scope.globals
        self._scope.functions.update(scope.functions)
        variables = self._runtime.globals
        variables.extend([UNSET] * (len(scope.globals) - len(variables)))
        calls = frozenset(
            node.call.function
            for node in program.body
            if isinstance(node, tree.CallStatement) and isinstance(node.call, tree.CallExpression)
        )
        return CompiledLine(procedure.steps(), calls)
