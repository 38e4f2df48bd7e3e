# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The grammar rules of expressions; one method reads all binary operators, by their precedence.

The docstring of :mod:`~ur_cartesian_driver.urscript.parsing.parser` describes the grammar.
"""

from __future__ import annotations

from ur_cartesian_driver.urscript.parsing import syntax_tree as tree
from ur_cartesian_driver.urscript.parsing.scanner import TokenKind
from ur_cartesian_driver.urscript.parsing.token_reader import (
    FIXED,
    MAX_CHAIN,
    source_position,
    SourcePosition,
    TokenReader,
)

#: Precedence of operators with two operands; `not` binds more loosely than a comparison.
_PRECEDENCE = {
    'or': 1, 'xor': 1, 'and': 2, '==': 4, '!=': 4, '<': 4, '<=': 4, '>': 4, '>=': 4,
    '+': 5, '-': 5, '*': 6, '/': 6, '%': 6,
}  # fmt: skip
_NOT = 3
#: Symbols that continue a value if they follow it.
_POSTFIXES = frozenset({'.', '(', '['})

CONSTANTS = {'True': True, 'true': True, 'False': False, 'false': False, 'None': None}


class ExpressionParser(TokenReader):
    """Reads expressions."""

    def _expression(self, lowest: int = 1) -> tree.Expression:
        """
        Read operand { operator operand }; operators of one precedence associate to the left.

        :param lowest: operators of lower precedence end the expression.
        """
        at_not = lowest <= _NOT and self._at('not')
        left = self._inversion() if at_not else self._unary()
        row, before = 0, 0
        while True:
            token = self._token
            precedence = _PRECEDENCE.get(token.text, 0)
            if precedence < lowest or token.kind not in FIXED:
                return left
            row, before = row + 1 if precedence == before else 1, precedence
            if row > MAX_CHAIN:
                raise self.error(f'more than {MAX_CHAIN} operators in a row')
            self._advance()
            node = tree.LogicalExpression if precedence < _NOT else tree.BinaryExpression
            left = node(
                operator=token.text,
                left=left,
                right=self._expression(precedence + 1),
                line=token.line,
                column=token.column,
            )

    def _inversion(self) -> tree.Expression:
        """Read "not" ( inversion | comparison )."""
        token = self._advance()
        with self._nested():
            operand = self._expression(_NOT)
        return tree.UnaryExpression(operator='not', operand=operand, **source_position(token))

    def _unary(self) -> tree.Expression:
        """Read ("-" | "+" | "!") unary | "run" NAME "(" ")" | postfix."""
        if not self._at('-', '+', '!', 'run'):
            return self._postfix()
        if token := self._match('-', '+', '!'):
            with self._nested():
                operand = self._unary()
            operator = 'not' if token.text == '!' else token.text
            return tree.UnaryExpression(
                operator=operator, operand=operand, **source_position(token)
            )
        self._expect('run')
        name = self._expect_kind(TokenKind.NAME)
        self._expect('(')
        self._expect(')')
        return tree.RunExpression(thread=name.text, **source_position(name))

    def _postfix(self) -> tree.Expression:
        """Read primary { "(" arguments ")" | "[" indices "]" | "." NAME }."""
        value = self._primary()
        for count in range(MAX_CHAIN + 1):
            if self._token.text not in _POSTFIXES:  # the usual case
                return value
            if count == MAX_CHAIN:
                break
            if self._at('.'):
                value = self._field(value)
            elif self._at('(') and isinstance(value, tree.NameExpression | tree.FieldExpression):
                value = self._call(value)
            elif self._at('['):
                value = self._index(value)
            else:
                return value
        raise self.error(f'more than {MAX_CHAIN} calls, indices or fields in a row')

    def _field(self, target: tree.Expression) -> tree.FieldExpression:
        """Read "." NAME; a keyword is accepted as a name."""
        self._advance()
        name = self._token
        if name.kind not in (TokenKind.NAME, TokenKind.KEYWORD):
            raise self.error(f'a name is missing before {self._found()}')
        self._advance()
        return tree.FieldExpression(target=target, name=name.text, **source_position(name))

    def _call(
        self, callee: tree.NameExpression | tree.FieldExpression
    ) -> tree.CallExpression | tree.MethodCallExpression:
        """Read "(" [ argument { "," argument } ] ")", positional arguments first."""
        position = SourcePosition(line=callee.line, column=callee.column)
        self._advance()
        arguments = self._list(self._argument, ')')
        named = [argument for argument in arguments if argument.name is not None]
        if any(argument.name is None for argument in arguments[len(arguments) - len(named) :]):
            raise self.error('a positional argument stands after a named one', self._previous)
        if isinstance(callee, tree.NameExpression):
            return tree.CallExpression(function=callee.identifier, arguments=arguments, **position)
        return tree.MethodCallExpression(
            target=callee.target, method=callee.name, arguments=arguments, **position
        )

    def _argument(self) -> tree.CallArgument:
        """Read [ NAME "=" ] expression."""
        start = self._token
        following = self._tokens[min(self._next + 1, len(self._tokens) - 1)]
        name = None
        if (
            start.kind is TokenKind.NAME
            and following.kind is TokenKind.SYMBOL
            and following.text == '='
        ):
            name = start.text
            self._advance()
            self._advance()
        return tree.CallArgument(
            name=name, value=self._expression(), line=start.line, column=start.column
        )

    def _index(self, target: tree.Expression) -> tree.Expression:
        """Read "[" expression [ "," expression ] "]"; six expressions after p are a pose."""
        start = self._advance()
        items = self._list(self._expression, ']')
        if (
            isinstance(target, tree.NameExpression)
            and target.identifier == 'p'
            and len(items) == 6
        ):
            return tree.PoseLiteral(items=items, line=target.line, column=target.column)
        if len(items) not in (1, 2):
            raise self.error('an index has one or two parts, a pose p[...] has six', start)
        return tree.IndexExpression(target=target, indices=items, **source_position(start))

    def _primary(self) -> tree.Expression:
        """Read NUMBER | STRING | constant | NAME | "(" expression ")" | "[" items "]"."""
        token = self._token
        if token.kind is TokenKind.NUMBER:
            self._advance()
            return tree.ConstantExpression(
                value=token.number, line=token.line, column=token.column
            )
        if token.kind is TokenKind.STRING:
            return tree.ConstantExpression(value=self._advance().text, **source_position(token))
        if token.kind is TokenKind.NAME:
            self._advance()
            return tree.NameExpression(identifier=token.text, line=token.line, column=token.column)
        if self._at(*CONSTANTS):
            return tree.ConstantExpression(
                value=CONSTANTS[self._advance().text], **source_position(token)
            )
        if self._match('['):
            return tree.ListLiteral(
                items=self._list(self._expression, ']'), **source_position(token)
            )
        if self._match('('):
            items = self._list(self._expression, ')')
            if len(items) != 1:
                raise self.error('brackets hold one expression', token)
            return items[0]
        raise self.error(f'a value is missing before {self._found()}')
