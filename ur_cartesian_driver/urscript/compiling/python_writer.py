# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Makes nodes of Python's syntax tree with the positions of the program's nodes."""

from __future__ import annotations

import ast
from collections.abc import Sequence
from typing import Any, TypeVar

from ur_cartesian_driver.urscript.parsing import syntax_tree as tree
from ur_cartesian_driver.urscript.script_values import Value

N = TypeVar('N', bound=ast.AST)

_LOAD, _STORE = ast.Load(), ast.Store()


class PythonWriter:
    """Makes Python nodes with the position of a program's node, which `at` chooses."""

    def __init__(self) -> None:
        #: The position of the next nodes, as arguments.
        self._place: dict[str, Any] = {}

    def at(self, node: tree.SyntaxNode) -> None:
        """Make all further nodes with the position of this node."""
        line, column = node.line, node.column
        self._place = {
            'lineno': line, 'col_offset': column, 'end_lineno': line, 'end_col_offset': column,
        }  # fmt: skip

    def node(self, kind: type[N], *fields: Any) -> N:
        """Return a node of any kind."""
        return kind(*fields, **self._place)

    # Expressions

    def name(self, name: str) -> ast.expr:
        return self.node(ast.Name, name, _LOAD)

    def target(self, name: str) -> ast.Name:
        return self.node(ast.Name, name, _STORE)

    def constant(self, value: Value) -> ast.expr:
        return self.node(ast.Constant, value)

    def call(self, function: str, *arguments: ast.expr, **named: ast.expr) -> ast.Call:
        keywords = [self.node(ast.keyword, name, value) for name, value in named.items()]
        return self.node(ast.Call, self.name(function), list(arguments), keywords)

    def items(self, items: Sequence[ast.expr]) -> ast.expr:
        return self.node(ast.List, list(items), _LOAD)

    def key(self, items: Sequence[ast.expr]) -> ast.expr:
        return self.node(ast.Tuple, list(items), _LOAD)

    def item(self, container: ast.expr, index: ast.expr) -> ast.expr:
        return self.node(ast.Subscript, container, index, _LOAD)

    def compare(self, left: ast.expr, operator: ast.cmpop, right: ast.expr) -> ast.expr:
        return self.node(ast.Compare, left, [operator], [right])

    def both(self, conditions: Sequence[ast.expr]) -> ast.expr:
        if len(conditions) == 1:
            return conditions[0]
        return self.node(ast.BoolOp, ast.And(), list(conditions))

    def choose(self, condition: ast.expr, this: ast.expr, other: ast.expr) -> ast.expr:
        return self.node(ast.IfExp, condition, this, other)

    def keep(self, name: str, value: ast.expr) -> ast.expr:
        """Return an expression that also stores its value in a variable."""
        return self.node(ast.NamedExpr, self.target(name), value)

    def steps(self, generator: ast.expr) -> ast.expr:
        return self.node(ast.YieldFrom, generator)

    def has_type(self, value: ast.expr, kind: str) -> ast.expr:
        return self.compare(self.call('type', value), ast.Is(), self.name(kind))

    def is_number(self, value: ast.expr) -> ast.expr:
        return self.compare(self.call('type', value), ast.In(), self.name('NUMBERS'))

    # Statements

    def do(self, expression: ast.expr) -> ast.stmt:
        return self.node(ast.Expr, expression)

    def set(self, name: str, value: ast.expr) -> ast.stmt:
        return self.node(ast.Assign, [self.target(name)], value)

    def if_true(
        self, condition: ast.expr, then: list[ast.stmt], otherwise: Sequence[ast.stmt] = ()
    ) -> ast.stmt:
        return self.node(ast.If, condition, then, list(otherwise))

    def runtime(self, name: str, context: ast.expr_context = _LOAD) -> ast.Attribute:
        """Return an attribute of the interpreter, which is a global of the generated code."""
        return self.node(ast.Attribute, self.name('runtime'), name, context)

    def set_runtime(self, name: str, value: ast.expr) -> ast.stmt:
        return self.node(ast.Assign, [self.runtime(name, _STORE)], value)

    def pay(self, weight: int) -> ast.stmt:
        """Return code that takes ``weight`` from the thread's fuel."""
        fuel = self.runtime('fuel', _STORE)
        return self.node(ast.AugAssign, fuel, ast.Sub(), self.constant(weight))

    def wait(self, value: ast.expr | None = None) -> ast.expr:
        return self.node(ast.Yield, value)

    def switch_threads(self) -> ast.stmt:
        switch = self.do(self.wait(self.name('SWITCH')))
        return self.if_true(self.call('switches'), [switch])

    def loop(self, condition: ast.expr, body: list[ast.stmt]) -> ast.stmt:
        return self.node(ast.While, condition, body, [])

    def function(
        self, name: str, parameters: Sequence[str], defaults: int, body: list[ast.stmt]
    ) -> ast.stmt:
        """
        Return the definition of a function.

        :param defaults: number of parameters, counted from the last, with the default UNSET.
        """
        arguments = ast.arguments(
            posonlyargs=[],
            args=[self.node(ast.arg, each) for each in parameters],
            kwonlyargs=[],
            kw_defaults=[],
            defaults=[self.name('UNSET')] * defaults,
        )
        # Python 3.12 and later require type parameters.
        wanted: dict[str, Any] = (
            {'type_params': []} if 'type_params' in ast.FunctionDef._fields else {}
        )
        return ast.FunctionDef(name, arguments, body, [], **wanted, **self._place)
