# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Compiles URScript expressions to Python expressions.

Numbers are nearly always floats, so the code checks for two floats and then uses Python's own
operation; for all other values it calls one of the `operations`. Lists are values in URScript: a
list that is stored, passed or returned is copied if it may also be stored elsewhere.
"""

from __future__ import annotations

import ast
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
import inspect

from ur_cartesian_driver.urscript import script_values as values
from ur_cartesian_driver.urscript.compiling.generated_code import (
    builtin_name,
    GeneratedFunction,
    global_name,
    local_name,
)
from ur_cartesian_driver.urscript.compiling.operations import OPERATORS
from ur_cartesian_driver.urscript.compiling.python_writer import PythonWriter
from ur_cartesian_driver.urscript.compiling.scopes import bind, Builtin, Scope
from ur_cartesian_driver.urscript.parsing import syntax_tree as tree
from ur_cartesian_driver.urscript.script_values import Value

#: Python's operators for floats.
_ARITHMETIC: dict[str, ast.operator] = {
    '+': ast.Add(), '-': ast.Sub(), '*': ast.Mult(), '/': ast.Div(),
}  # fmt: skip
_COMPARISONS: dict[str, ast.cmpop] = {
    '==': ast.Eq(), '!=': ast.NotEq(), '<': ast.Lt(), '<=': ast.LtE(),
    '>': ast.Gt(), '>=': ast.GtE(),
}  # fmt: skip
#: Name of the parameter of generated functions that counts the nesting of calls.
DEPTH = 'depth'


@dataclass(frozen=True, slots=True)
class CompiledExpression:
    """The code of an expression, and its cost in nodes of the tree."""

    python: ast.expr
    weight: int = 1
    #: Whether the value is a bool.
    is_truth: bool = False
    #: Whether a second evaluation is cheap and has no effect.
    is_simple: bool = False


@dataclass(slots=True)
class Shared:
    """The data that all functions of a program share."""

    builtins: Mapping[str, Builtin]
    interleaves: bool
    #: Functions by the identity of their scopes.
    functions: dict[int, GeneratedFunction]


class ExpressionCompiler(PythonWriter):
    """Compiles the expressions of one function."""

    def __init__(self, scope: Scope, shared: Shared) -> None:
        super().__init__()
        self._scope = scope
        self._shared = shared
        self._temporaries = 0
        #: Immutable values that the code looks up by name.
        self._constants: dict[str, Value] = {}

    def temporary(self) -> str:
        """Return the name of a new variable for intermediate values."""
        self._temporaries += 1
        return f't{self._temporaries}'

    def expression(self, node: tree.Expression) -> CompiledExpression:
        match node:
            case tree.ConstantExpression():
                self.at(node)
                is_truth = isinstance(node.value, bool)
                return CompiledExpression(
                    self.constant(node.value), is_truth=is_truth, is_simple=True
                )
            case tree.NameExpression():
                self.at(node)
                return CompiledExpression(
                    self.name(self.variable(node.identifier)), is_simple=True
                )
            case tree.UnaryExpression():
                return self._unary(node)
            case tree.BinaryExpression():
                return self._binary(node)
            case tree.LogicalExpression():
                return self._logical(node)
            case tree.ListLiteral() | tree.PoseLiteral():
                return self._literal(node)
            case tree.IndexExpression():
                return self._index(node)
            case tree.FieldExpression():
                target = self.expression(node.target)
                self.at(node)
                part = self.call('get_part', target.python, self.constant(node.name))
                return CompiledExpression(part, 1 + target.weight)
            case tree.CallExpression():
                callee = self._scope.function(node.function)
                return self._builtin(node) if callee is None else self._call(node, callee)
            case tree.MethodCallExpression():
                return self._method(node)
            case tree.RunExpression():
                callee = self._scope.function(node.thread)
                assert callee is not None
                self.at(node)
                function = self._shared.functions[id(callee)].name
                return CompiledExpression(self.call('spawn', self.name(function)))
        raise AssertionError(node)

    def condition(self, node: tree.Expression) -> CompiledExpression:
        """Compile an expression as a condition, whose value is a bool."""
        return self._truth(self.expression(node))

    def _truth(self, code: CompiledExpression) -> CompiledExpression:
        if code.is_truth:
            return code
        return CompiledExpression(self.call('truth', code.python), code.weight, is_truth=True)

    def copied(self, node: tree.Expression) -> CompiledExpression:
        """Compile an expression whose value will be stored or passed on: a list is copied."""
        if isinstance(node, tree.CallExpression) and self._scope.function(node.function) is None:
            call = self._builtin_call(node)
            self.at(node)
            return replace(call, python=self.call('copied', call.python))
        code = self.expression(node)
        if code.is_truth or not self._may_be_stored(node, code):
            return code
        self.at(node)
        first, again = self._kept(code)
        python = self.choose(self.has_type(first, 'float'), again, self.call('copied', again))
        return replace(code, python=python, is_simple=False)

    @staticmethod
    def _may_be_stored(node: tree.Expression, code: CompiledExpression) -> bool:
        """Return whether the value of an expression may be stored elsewhere, too."""
        stored = (
            tree.NameExpression
            | tree.IndexExpression
            | tree.FieldExpression
            | tree.UnaryExpression
            | tree.MethodCallExpression
        )
        return isinstance(node, stored) and not isinstance(code.python, ast.Constant)

    def _kept(self, code: CompiledExpression) -> tuple[ast.expr, ast.expr]:
        """Return code that evaluates an expression, and code that reads its value again."""
        if code.is_simple:
            return code.python, code.python
        name = self.temporary()
        return self.keep(name, code.python), self.name(name)

    def variable(self, name: str, qualifier: str = '') -> str:
        """Return the name of a URScript variable in the generated code."""
        if name in self._scope.locals and qualifier != 'global':
            return local_name(name)
        return global_name(name)

    def _literal(self, node: tree.ListLiteral | tree.PoseLiteral) -> CompiledExpression:
        is_list = isinstance(node, tree.ListLiteral)
        codes = [self.expression(item) for item in node.items]
        self.at(node)
        weight = 1 + sum(code.weight for code in codes)
        numbers = [_number(code.python) for code in codes]
        items = self.items([code.python for code in codes])
        if None in numbers:
            return CompiledExpression(
                self.call('make_list' if is_list else 'make_pose', items), weight
            )
        if is_list:
            return CompiledExpression(items, weight)
        function = self._shared.functions[id(self._scope)].name
        name = f'{function}_pose{len(self._constants)}'
        self._constants[name] = values.make_pose(numbers)
        return CompiledExpression(self.name(name), weight)

    def _unary(self, node: tree.UnaryExpression) -> CompiledExpression:
        if node.operator == 'not':
            code = self.condition(node.operand)
            self.at(node)
            return CompiledExpression(
                self.node(ast.UnaryOp, ast.Not(), code.python), 1 + code.weight, is_truth=True
            )
        code = self.expression(node.operand)
        self.at(node)
        number = _number(code.python)
        if number is not None:
            signed = -number if node.operator == '-' else number
            return CompiledExpression(self.constant(signed), 1 + code.weight, is_simple=True)
        if node.operator == '+':
            return CompiledExpression(self.call('plus', code.python), 1 + code.weight)
        first, again = self._kept(code)
        negative = self.node(ast.UnaryOp, ast.USub(), again)
        python = self.choose(self.has_type(first, 'float'), negative, self.call('minus', again))
        return CompiledExpression(python, 1 + code.weight)

    def _binary(self, node: tree.BinaryExpression) -> CompiledExpression:
        symbol = node.operator
        left, right = self.expression(node.left), self.expression(node.right)
        self.at(node)
        weight = 1 + left.weight + right.weight
        is_truth = symbol in _COMPARISONS
        constants = [isinstance(code.python, ast.Constant) for code in (left, right)]
        if symbol in ('==', '!=') and any(constants):
            python = self.compare(left.python, _COMPARISONS[symbol], right.python)
            return CompiledExpression(python, weight, is_truth)
        if symbol == '%' or not all(
            _number(code.python) is not None
            for code, is_constant in zip((left, right), constants, strict=True)
            if is_constant
        ):
            return CompiledExpression(
                self.call(OPERATORS[symbol], left.python, right.python), weight, is_truth
            )
        if not right.is_simple and not self._is_fixed(left):
            left = replace(left, is_simple=False)  # the right side may change its value
        (first_a, a), (first_b, b) = self._kept(left), self._kept(right)
        is_quick = self._quick_condition(symbol, constants, first_a, first_b, right.is_simple)
        if is_quick is None:  # two constants
            return CompiledExpression(self.call(OPERATORS[symbol], a, b), weight, is_truth)
        if symbol == '/':
            is_quick = self.both([is_quick, b])
        quick = (
            self.compare(a, _COMPARISONS[symbol], b)
            if is_truth
            else self.node(ast.BinOp, a, _ARITHMETIC[symbol], b)
        )
        slow = self.call(OPERATORS[symbol], a, b)
        return CompiledExpression(self.choose(is_quick, quick, slow), weight, is_truth)

    def _is_fixed(self, code: CompiledExpression) -> bool:
        """Return whether the code is a constant or a local: no other function can change it."""
        return isinstance(code.python, ast.Constant) or (
            isinstance(code.python, ast.Name) and not code.python.id.startswith('g_')
        )

    def _quick_condition(
        self,
        symbol: str,
        constants: Sequence[bool],
        left: ast.expr,
        right: ast.expr,
        right_is_simple: bool,
    ) -> ast.expr | None:
        """
        Return the condition under which Python's own operation applies; None = two constants.

        The condition also evaluates both operands.
        """
        check = self.is_number if symbol in _COMPARISONS else lambda x: self.has_type(x, 'float')
        checks = [
            check(operand)
            for operand, is_constant in zip((left, right), constants, strict=True)
            if not is_constant
        ]
        if len(checks) < 2 or right_is_simple:
            return self.both(checks) if checks else None
        # `and` would skip the right operand if the check of the left one fails.
        return self.node(ast.BinOp, checks[0], ast.BitAnd(), checks[1])

    def _logical(self, node: tree.LogicalExpression) -> CompiledExpression:
        left, right = self.condition(node.left), self.condition(node.right)
        self.at(node)
        weight = 1 + left.weight + right.weight
        if node.operator == 'xor':
            return CompiledExpression(
                self.compare(left.python, ast.NotEq(), right.python), weight, is_truth=True
            )
        operator = ast.Or() if node.operator == 'or' else ast.And()
        both = self.node(ast.BoolOp, operator, [left.python, right.python])
        return CompiledExpression(both, weight, is_truth=True)

    def _index(self, node: tree.IndexExpression) -> CompiledExpression:
        target = self.expression(node.target)
        indices = [self.expression(index) for index in node.indices]
        self.at(node)
        weight = 1 + target.weight + sum(index.weight for index in indices)
        key = [index.python for index in indices]
        index = indices[0].python
        if not (
            len(indices) == 1
            and isinstance(index, ast.Constant)
            and type(index.value) is int
            and index.value >= 0
        ):
            return CompiledExpression(self.call('get_item', target.python, *key), weight)
        first, again = self._kept(target)
        fits = self.compare(self.call('len', again), ast.Gt(), index)
        item = self.item(again, index)
        is_quick = self.both([self.has_type(first, 'list'), fits])
        return CompiledExpression(
            self.choose(is_quick, item, self.call('get_item', again, index)), weight
        )

    # Calls

    def _call(self, node: tree.CallExpression, callee: Scope) -> CompiledExpression:
        assert callee.definition is not None
        positional: list[ast.expr] = []
        named: dict[str, ast.expr] = {}
        weight = 1
        for name, argument in bind(callee.definition, node).items():
            code = self.copied(argument.value)
            weight += code.weight
            if argument.name is None and not named:
                positional.append(code.python)
            else:
                named[local_name(name)] = code.python
        self.at(node)
        depth = self.node(ast.BinOp, self.name(DEPTH), ast.Add(), self.constant(1))
        function = self._shared.functions[id(callee)]
        call: ast.expr = self.call(function.name, depth, *positional, **named)
        return CompiledExpression(self.steps(call) if function.suspends else call, weight)

    def _builtin(self, node: tree.CallExpression) -> CompiledExpression:
        call = self._builtin_call(node)
        if isinstance(call.python, ast.YieldFrom):
            return call
        return replace(call, python=self.call('paid', call.python))

    def _builtin_call(self, node: tree.CallExpression) -> CompiledExpression:
        codes = [self.copied(argument.value) for argument in node.arguments]
        self.at(node)
        positional = [
            code.python
            for code, argument in zip(codes, node.arguments, strict=True)
            if argument.name is None
        ]
        named = {
            argument.name: code.python
            for code, argument in zip(codes, node.arguments, strict=True)
            if argument.name is not None
        }
        call: ast.expr = self.call(builtin_name(node.function), *positional, **named)
        if inspect.isgeneratorfunction(self._shared.builtins[node.function]):
            call = self.steps(call)
        return CompiledExpression(call, 1 + sum(code.weight for code in codes))

    def _method(self, node: tree.MethodCallExpression) -> CompiledExpression:
        target = self.expression(node.target)
        codes = [self.copied(argument.value) for argument in node.arguments]
        self.at(node)
        arguments = self.items([code.python for code in codes])
        call = self.call('call', target.python, self.constant(node.method), arguments)
        result = self.temporary()
        takes_time = self.has_type(self.keep(result, call), 'Generator')
        python = self.choose(takes_time, self.steps(self.name(result)), self.name(result))
        return CompiledExpression(python, 1 + target.weight + sum(code.weight for code in codes))


def _number(python: ast.expr) -> int | float | None:
    """Return the signed value of a numeric constant; None = other code."""
    if isinstance(python, ast.Constant) and values.is_number(python.value):
        number: int | float = python.value
        return number
    return None
