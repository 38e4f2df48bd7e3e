# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Resolves the meaning of each name before anything runs.

The rules: every variable that the body of the program assigns is global, even if marked local. In
a function or thread `local x = ...` makes x a local of the whole function and `global x = ...`
makes it a global of the program. There, a plain `x = ...` writes the global x if the program has
one anywhere, and otherwise makes a local. A function sees all functions of the scopes around it,
wherever the text defines them, but not the locals of the enclosing function. If a scope defines a
function twice, the later definition applies, because an exported program can include a file twice.

The same walk finds unknown names, calls with wrong arguments, and the functions that can take
time, because only these have to become Python generators.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
import inspect
from typing import Any

from ur_cartesian_driver.urscript.parsing import syntax_tree as tree
from ur_cartesian_driver.urscript.script_errors import CompileError, name_not_found

Builtin = Callable[..., Any]

#: Nodes that contain statements.
_COMPOUND = (
    tree.IfStatement,
    tree.SwitchStatement,
    tree.WhileStatement,
    tree.ConditionalBlock,
)


@dataclass(slots=True, kw_only=True)
class Scope:
    """The names of a function, of a program's body, or of a line added to a running program."""

    parent: Scope | None
    owner: tree.FunctionDefinition | tree.ScriptProgram
    globals: set[str]
    locals: set[str] = field(default_factory=set)
    functions: dict[str, Scope] = field(default_factory=dict)
    #: The scopes of the functions that are called in this scope.
    calls: list[Scope] = field(default_factory=list)
    #: Whether running this scope can take time.
    suspends: bool = False

    @property
    def definition(self) -> tree.FunctionDefinition | None:
        """The function or thread; None for the body of the program."""
        return self.owner if isinstance(self.owner, tree.FunctionDefinition) else None

    @property
    def body(self) -> tree.StatementBlock:
        """The statements of the function, or of the program's body."""
        return self.owner.body

    def function(self, name: str) -> Scope | None:
        """Return the scope of a function or thread, also of the scopes around; None = unknown."""
        scope: Scope | None = self
        while scope is not None:
            if name in scope.functions:
                return scope.functions[name]
            scope = scope.parent
        return None

    def walk(self) -> Iterator[Scope]:
        """Yield this scope and all scopes within it."""
        yield self
        for inner in self.functions.values():
            yield from inner.walk()


def resolve(
    program: tree.ScriptProgram, builtins: Mapping[str, Builtin], enclosing: Scope | None = None
) -> Scope:
    """
    Check a program and return the scope of its body.

    :param enclosing: scope of the program that this program continues; it stays unchanged.
    :raises CompileError: a name is unknown, or a call has wrong arguments.
    """
    root = Scope(
        parent=enclosing, owner=program, globals=set(enclosing.globals) if enclosing else set()
    )
    _declare(root)
    for scope in root.walk():
        _assign_locals(scope)
    _NameChecker(builtins).block(root, program.body)
    _propagate_suspension(list(root.walk()))
    return root


def _own_statements(nodes: Iterable[tree.SyntaxNode]) -> Iterator[tree.SyntaxNode]:
    """Yield statements and the statements inside them, without entering function definitions."""
    for node in nodes:
        yield node
        if isinstance(node, _COMPOUND):
            yield from _own_statements(tree.children(node))


def _declare(scope: Scope) -> None:
    """Collect the functions and globals of a scope and of all scopes within it."""
    for node in _own_statements(scope.body):
        if isinstance(node, tree.FunctionDefinition):
            inner = Scope(parent=scope, owner=node, globals=scope.globals)
            scope.functions[node.name] = inner
            _declare(inner)
        elif isinstance(node, tree.AssignStatement) and isinstance(
            node.target, tree.NameExpression
        ):
            _declare_global(scope, node, node.target.identifier)


def _declare_global(scope: Scope, node: tree.AssignStatement, name: str) -> None:
    if scope.definition is None or node.qualifier == 'global':
        scope.globals.add(name)


def _assign_locals(scope: Scope) -> None:
    """Collect the parameters and local variables of a function; a program's body has none."""
    if scope.definition is None:
        return
    scope.locals.update(parameter.name for parameter in scope.definition.parameters)
    for node in _own_statements(scope.body):
        if isinstance(node, tree.AssignStatement) and isinstance(node.target, tree.NameExpression):
            name = node.target.identifier
            if node.qualifier == 'local' or (not node.qualifier and name not in scope.globals):
                scope.locals.add(name)


def _propagate_suspension(scopes: list[Scope]) -> None:
    """Mark every function that calls a function that can take time."""
    changed = True
    while changed:
        changed = False
        for scope in scopes:
            if not scope.suspends and any(callee.suspends for callee in scope.calls):
                scope.suspends = changed = True


def _signature(function: Builtin) -> inspect.Signature | None:
    try:
        return inspect.signature(function)
    except (TypeError, ValueError):
        return None


def bind(
    definition: tree.FunctionDefinition, call: tree.CallExpression
) -> dict[str, tree.CallArgument]:
    """
    Match the arguments of a call with the parameters of a function that the program defines.

    :raises CompileError: an argument is unknown, duplicate or missing, or there are too many.
    """
    parameters = [parameter.name for parameter in definition.parameters]
    bound: dict[str, tree.CallArgument] = {}
    for number, argument in enumerate(call.arguments):
        if argument.name is None and number >= len(parameters):
            raise call_error(call, f'it takes at most {len(parameters)} arguments')
        name = argument.name or parameters[number]
        if name not in parameters:
            raise call_error(call, f'it has no parameter {name!r}')
        if name in bound:
            raise call_error(call, f'the argument {name!r} is given twice')
        bound[name] = argument
    for parameter in definition.parameters:
        if parameter.default is None and parameter.name not in bound:
            raise call_error(call, f'the argument {parameter.name!r} is missing')
    return bound


class _NameChecker:
    """Checks the names of a program in the order of the text."""

    def __init__(self, builtins: Mapping[str, Builtin]) -> None:
        self._builtins = builtins
        #: Signatures of the builtins that are called, by name.
        self._signatures: dict[str, inspect.Signature | None] = {}
        #: Correct calls of builtins: function, number of arguments, names of named arguments.
        self._fitting: set[tuple[str, int, tuple[str, ...]]] = set()

    def block(self, scope: Scope, nodes: Iterable[tree.SyntaxNode]) -> None:
        """Check nodes and everything below them."""
        for node in nodes:
            if isinstance(node, tree.FunctionDefinition):
                self._function(scope, node)
                continue
            if isinstance(node, tree.NameExpression):
                if node.identifier not in scope.locals and node.identifier not in scope.globals:
                    raise name_not_found('variable', node.identifier, node.line, node.column)
            elif isinstance(node, tree.CallExpression):
                self._call(scope, node)
            elif isinstance(node, tree.RunExpression):
                self._run(scope, node)
            elif isinstance(
                node, tree.JoinStatement | tree.PauseStatement | tree.MethodCallExpression
            ):
                scope.suspends = True
            self.block(scope, tree.children(node))

    def _function(self, scope: Scope, definition: tree.FunctionDefinition) -> None:
        inner = scope.functions[definition.name]
        if inner.definition is not definition:  # a later definition has replaced this one
            return
        self.block(inner, definition.parameters)
        self.block(inner, definition.body)

    def _call(self, scope: Scope, call: tree.CallExpression) -> None:
        callee = scope.function(call.function)
        if callee is not None and callee.definition is not None:
            if callee.definition.kind == 'thread':
                raise call_error(call, 'a thread is started by run')
            scope.calls.append(callee)
            bind(callee.definition, call)
        elif call.function in self._builtins:
            if inspect.isgeneratorfunction(self._builtins[call.function]):
                scope.suspends = True
            if call.function not in self._signatures:
                self._signatures[call.function] = _signature(self._builtins[call.function])
            names = tuple(a.name for a in call.arguments if a.name is not None)
            form = call.function, len(call.arguments), names
            if form not in self._fitting and (signature := self._signatures[call.function]):
                _check_arguments(call, signature)
                self._fitting.add(form)
        else:
            raise name_not_found('function', call.function, call.line, call.column)

    @staticmethod
    def _run(scope: Scope, run: tree.RunExpression) -> None:
        callee = scope.function(run.thread)
        if callee is None or callee.definition is None or callee.definition.kind != 'thread':
            raise name_not_found('thread', run.thread, run.line, run.column)


def _check_arguments(call: tree.CallExpression, signature: inspect.Signature) -> None:
    positional = [argument for argument in call.arguments if argument.name is None]
    named = [argument.name for argument in call.arguments if argument.name is not None]
    if len(set(named)) != len(named):
        raise call_error(call, 'an argument is named twice')
    try:
        signature.bind(*positional, **dict.fromkeys(named))
    except TypeError as error:
        raise call_error(call, str(error)) from None


def call_error(call: tree.CallExpression, reason: str) -> CompileError:
    """Return the error for a call whose arguments do not fit the function."""
    text = f'compile_error_wrong_arguments:{call.function}:'
    return CompileError(call.line, call.column, text, f'{call.function}(): {reason}')
