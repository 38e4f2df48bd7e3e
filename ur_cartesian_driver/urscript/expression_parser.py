# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The rules of expressions, one method each, loosest binding first.

The grammar stands at the head of :mod:`~ur_cartesian_driver.urscript.parser`.
"""

from __future__ import annotations

from ur_cartesian_driver.urscript import syntax as tree
from ur_cartesian_driver.urscript.scanner import Kind
from ur_cartesian_driver.urscript.token_reader import MAX_CHAIN, Place, place, TokenReader

CONSTANTS = {'True': True, 'true': True, 'False': False, 'false': False, 'None': None}


class ExpressionParser(TokenReader):
    """Reads expressions."""

    def _expression(self) -> tree.Expression:
        """Read conjunction { ( "or" | "xor" ) conjunction }."""
        left = self._conjunction()
        for token in self._operators('or', 'xor'):
            right = self._conjunction()
            left = tree.Logical(operator=token.text, left=left, right=right, **place(token))
        return left

    def _conjunction(self) -> tree.Expression:
        """Read inversion { "and" inversion }."""
        left = self._inversion()
        for token in self._operators('and'):
            right = self._inversion()
            left = tree.Logical(operator=token.text, left=left, right=right, **place(token))
        return left

    def _inversion(self) -> tree.Expression:
        """Read "not" inversion | comparison."""
        if token := self._match('not'):
            with self._nested():
                operand = self._inversion()
            return tree.Unary(operator='not', operand=operand, **place(token))
        return self._comparison()

    def _comparison(self) -> tree.Expression:
        """Read sum { ( "==" | "!=" | "<" | "<=" | ">" | ">=" ) sum }."""
        left = self._sum()
        for token in self._operators('==', '!=', '<', '<=', '>', '>='):
            right = self._sum()
            left = tree.Binary(operator=token.text, left=left, right=right, **place(token))
        return left

    def _sum(self) -> tree.Expression:
        """Read product { ( "+" | "-" ) product }."""
        left = self._product()
        for token in self._operators('+', '-'):
            right = self._product()
            left = tree.Binary(operator=token.text, left=left, right=right, **place(token))
        return left

    def _product(self) -> tree.Expression:
        """Read unary { ( "*" | "/" | "%" ) unary }."""
        left = self._unary()
        for token in self._operators('*', '/', '%'):
            right = self._unary()
            left = tree.Binary(operator=token.text, left=left, right=right, **place(token))
        return left

    def _unary(self) -> tree.Expression:
        """Read ("-" | "+") unary | "run" NAME "(" ")" | postfix."""
        if token := self._match('-', '+'):
            with self._nested():
                operand = self._unary()
            return tree.Unary(operator=token.text, operand=operand, **place(token))
        if self._match('run'):
            name = self._expect_kind(Kind.NAME)
            self._expect('(')
            self._expect(')')
            return tree.Run(thread=name.text, **place(name))
        return self._postfix()

    def _postfix(self) -> tree.Expression:
        """Read primary { "(" arguments ")" | "[" indices "]" | "." NAME }."""
        value = self._primary()
        for _ in range(MAX_CHAIN):
            if self._at('.'):
                value = self._field(value)
            elif self._at('(') and isinstance(value, tree.Name | tree.Field):
                value = self._call(value)
            elif self._at('['):
                value = self._index(value)
            else:
                return value
        raise self.error(f'more than {MAX_CHAIN} calls, indices or fields in a row')

    def _field(self, target: tree.Expression) -> tree.Field:
        """Read "." NAME, where a keyword is a name too."""
        self._advance()
        name = self._token
        if name.kind not in (Kind.NAME, Kind.KEYWORD):
            raise self.error(f'a name is missing before {self._found()}')
        self._advance()
        return tree.Field(target=target, name=name.text, **place(name))

    def _call(self, callee: tree.Name | tree.Field) -> tree.Call | tree.MethodCall:
        """Read "(" [ argument { "," argument } ] ")", positional arguments first."""
        position = Place(line=callee.line, column=callee.column)
        self._advance()
        arguments = self._list(self._argument, ')')
        named = [argument for argument in arguments if argument.name is not None]
        if any(argument.name is None for argument in arguments[len(arguments) - len(named) :]):
            raise self.error('a positional argument stands after a named one', self._previous)
        if isinstance(callee, tree.Name):
            return tree.Call(function=callee.identifier, arguments=arguments, **position)
        return tree.MethodCall(
            target=callee.target, method=callee.name, arguments=arguments, **position
        )

    def _argument(self) -> tree.Argument:
        """Read [ NAME "=" ] expression."""
        start = self._token
        following = self._tokens[min(self._next + 1, len(self._tokens) - 1)]
        name = None
        if start.kind is Kind.NAME and following.kind is Kind.SYMBOL and following.text == '=':
            name = start.text
            self._advance()
            self._advance()
        return tree.Argument(name=name, value=self._expression(), **place(start))

    def _index(self, target: tree.Expression) -> tree.Expression:
        """Read "[" expression [ "," expression ] "]"; six after the name p are a pose."""
        start = self._advance()
        items = self._list(self._expression, ']')
        if isinstance(target, tree.Name) and target.identifier == 'p' and len(items) == 6:
            return tree.PoseLiteral(items=items, line=target.line, column=target.column)
        if len(items) not in (1, 2):
            raise self.error('an index has one or two parts, a pose p[...] has six', start)
        return tree.Index(target=target, indices=items, **place(start))

    def _primary(self) -> tree.Expression:
        """Read NUMBER | STRING | constant | NAME | "(" expression ")" | "[" items "]"."""
        token = self._token
        if token.kind is Kind.NUMBER:
            return tree.Constant(value=self._advance().number, **place(token))
        if token.kind is Kind.STRING:
            return tree.Constant(value=self._advance().text, **place(token))
        if token.kind is Kind.NAME:
            return tree.Name(identifier=self._advance().text, **place(token))
        if self._at(*CONSTANTS):
            return tree.Constant(value=CONSTANTS[self._advance().text], **place(token))
        if self._match('['):
            return tree.ListLiteral(items=self._list(self._expression, ']'), **place(token))
        if self._match('('):
            items = self._list(self._expression, ')')
            if len(items) != 1:
                raise self.error('brackets hold one expression', token)
            return items[0]
        raise self.error(f'a value is missing before {self._found()}')
