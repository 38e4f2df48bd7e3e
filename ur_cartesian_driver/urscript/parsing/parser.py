# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Turns tokens into a syntax tree, by recursive descent: one method per rule.

This module parses programs and statements; expressions are in
:mod:`~ur_cartesian_driver.urscript.parsing.expression_parser`.

Line ends do not matter: a statement ends where its expression cannot continue, so `a = 1 b = 2`
are two statements, and an operator at the end of a line continues the expression. There are two
exceptions: the value of `return` must be on the line of `return`, and all texts of a label must be
on one line.

    program     = ("def" | "sec") NAME "(" ")" ":" block "end"
    block       = { statement }
    statement   = function | if | switch | while | "break" | "continue" | return | "halt" | "pause"
                | "enter_critical" | "exit_critical" | "join" unary | "kill" unary
                | label | assignment | call
    function    = ("def" | "thread") NAME "(" [ parameter { "," parameter } ] ")" ":" block "end"
    parameter   = NAME [ "=" expression ]
    if          = "if" expression ":" block { "elif" expression ":" block }
                  [ "else" ":" block ] "end"
    switch      = "switch" expression ":" { "case" expression ":" block [ "end" ] }
                  [ "default" ":" block [ "end" ] ] "end"
    while       = "while" expression ":" block "end"
    return      = "return" [ expression ]
    label       = "$" NUMBER STRING { STRING }
    assignment  = [ "global" | "local" ] target "=" expression
    target      = NAME { "[" expression [ "," expression ] "]" | "." NAME }
    call        = postfix that ends in a call | "run" NAME "(" ")"
    expression  = conjunction { ( "or" | "xor" ) conjunction }
    conjunction = inversion { "and" inversion }
    inversion   = "not" inversion | comparison
    comparison  = sum { ( "==" | "!=" | "<" | "<=" | ">" | ">=" ) sum }
    sum         = product { ( "+" | "-" ) product }
    product     = unary { ( "*" | "/" | "%" ) unary }
    unary       = ( "-" | "+" | "!" ) unary | "run" NAME "(" ")" | postfix
    postfix     = primary { "(" arguments ")" | "[" expression [ "," expression ] "]" | "." NAME }
    arguments   = [ argument { "," argument } ]
    argument    = [ NAME "=" ] expression
    primary     = NUMBER | STRING | "True" | "False" | "None" | NAME | "(" expression ")"
                | "[" [ expression { "," expression } ] "]"
                | "p" "[" expression { "," expression } "]"
"""

from __future__ import annotations

from typing import Literal

from ur_cartesian_driver.urscript.parsing import syntax_tree as tree
from ur_cartesian_driver.urscript.parsing.expression_parser import CONSTANTS, ExpressionParser
from ur_cartesian_driver.urscript.parsing.scanner import Token, TokenKind
from ur_cartesian_driver.urscript.parsing.token_reader import source_position

#: Error texts for statements that people try because other languages have them.
_OF_OTHERS = {
    'for': "there is no 'for'; count in a 'while' loop",
    'elseif': "'elseif' is written 'elif'",
    'import': "there is no 'import'; this may be a file of Python",
    'from': "there is no 'import'; this may be a file of Python",
    **dict.fromkeys('+-*/', "there is no assignment such as '+='; write 'a = a + b'"),
}


def parse(text: str) -> tree.ScriptProgram:
    """
    Parse one program, with any blank lines and comments around it.

    :raises CompileError: a token fits no rule; the error has the position of the first such token.
    """
    parser = Parser(text)
    try:
        return parser.program()
    except RecursionError:
        raise parser.error('the program is nested too deeply') from None


def parse_line(text: str) -> tree.ScriptProgram:
    """
    Parse statements for a program that runs already; return them as the body of a program.

    :raises CompileError: a token fits no rule; the error has the position of the first such token.
    """
    parser = Parser(text)
    try:
        return parser.line()
    except RecursionError:
        raise parser.error('the statement is nested too deeply') from None


class Parser(ExpressionParser):
    """Reads programs and statements."""

    def __init__(self, text: str) -> None:
        super().__init__(text)
        self._loops = 0
        #: The first token of the first block that begins and ends in different columns.
        self._misaligned: Token | None = None

    # Programs, functions and blocks

    def program(self) -> tree.ScriptProgram:
        """Read ("def" | "sec") NAME "(" ")" ":" block "end"."""
        start = self._token
        kind: Literal['def', 'sec']
        if self._match('def'):
            kind = 'def'
        elif start.kind is TokenKind.NAME and start.text == 'sec':
            self._advance()
            kind = 'sec'
        else:
            raise self.error("a program begins with 'def' or 'sec'")
        name = self._expect_kind(TokenKind.NAME).text
        for symbol in '():':
            self._expect(symbol)
        body = self._block(start, 'end')
        self._expect('end')
        if self._token.kind is not TokenKind.END:
            raise self.error('there is text after the end of the program')
        return tree.ScriptProgram(name=name, kind=kind, body=body, **source_position(start))

    def line(self) -> tree.ScriptProgram:
        """Read { statement }, up to the end of the text."""
        start = self._token
        statements: list[tree.Statement] = []
        while self._token.kind is not TokenKind.END:
            statements.append(self._statement())
        return tree.ScriptProgram(
            name='line', kind='def', body=tuple(statements), **source_position(start)
        )

    def _block(self, start: Token, *closing: str) -> tree.StatementBlock:
        """
        Read { statement }, up to one of the keywords that close it.

        If an `end` is missing, the text does not show which block lacks it. So the error names the
        first block whose `end` is not indented like the first line of the block.

        :param start: the token that began the block.
        """
        statements: list[tree.Statement] = []
        with self._nested():
            while not self._at(*closing):
                if self._token.kind is TokenKind.END:
                    start = self._misaligned or start
                    raise self.error(f"the {start.text!r} of line {start.line} has no 'end'")
                statements.append(self._statement())
        end = self._token
        if end.text == 'end' and end.line > start.line and end.column != start.column:
            self._misaligned = self._misaligned or start
        return tuple(statements)

    def _function(self) -> tree.FunctionDefinition:
        """Read ("def" | "thread") NAME "(" [ parameter { "," parameter } ] ")" ":" block "end"."""
        start = self._advance()
        kind: Literal['def', 'thread'] = 'def' if start.text == 'def' else 'thread'
        name = self._expect_kind(TokenKind.NAME)
        self._expect('(')
        parameters = self._list(self._parameter, ')')
        if len({parameter.name for parameter in parameters}) < len(parameters):
            raise self.error('two parameters have the same name', name)
        if kind == 'thread' and parameters:
            raise self.error('a thread takes no parameters', name)
        self._expect(':')
        loops, self._loops = self._loops, 0
        body = self._block(start, 'end')
        self._loops = loops
        self._expect('end')
        return tree.FunctionDefinition(
            name=name.text, kind=kind, parameters=parameters, body=body, **source_position(name)
        )

    def _parameter(self) -> tree.FunctionParameter:
        """Read NAME [ "=" expression ]."""
        name = self._expect_kind(TokenKind.NAME)
        default = self._expression() if self._match('=') else None
        return tree.FunctionParameter(name=name.text, default=default, **source_position(name))

    # Statements

    def _statement(self) -> tree.Statement:
        """Read the statement that begins with the next token."""
        token = self._token
        rule = {
            'def': self._function, 'thread': self._function, 'if': self._if,
            'switch': self._switch, 'while': self._while, 'return': self._return,
            'break': self._jump, 'continue': self._jump, 'halt': self._word,
            'pause': self._word, 'enter_critical': self._word, 'exit_critical': self._word,
            'join': self._thread_control, 'kill': self._thread_control, '$': self._label,
        }.get(token.text)  # fmt: skip
        if rule and token.kind in (TokenKind.KEYWORD, TokenKind.SYMBOL):
            return rule()
        return self._assignment_or_call()

    def _if(self) -> tree.IfStatement:
        """Read "if" expression ":" block { "elif" ... } [ "else" ":" block ] "end"."""
        start = self._token
        branches: list[tree.ConditionalBlock] = []
        while keyword := self._match('if') if not branches else self._match('elif'):
            condition = self._expression()
            self._expect(':')
            body = self._block(start, 'elif', 'else', 'end')
            branches.append(
                tree.ConditionalBlock(condition=condition, body=body, **source_position(keyword))
            )
        otherwise = self._else('else', start) if self._at('else') else ()
        self._expect('end')
        return tree.IfStatement(
            branches=tuple(branches), otherwise=otherwise, **source_position(start)
        )

    def _else(self, keyword: str, start: Token) -> tree.StatementBlock:
        """Read ("else" | "default") ":" block."""
        self._expect(keyword)
        self._expect(':')
        return self._block(start, 'end')

    def _switch(self) -> tree.SwitchStatement:
        """Read "switch" expression ":" { "case" ... } [ "default" ... ] "end"."""
        start = self._advance()
        subject = self._expression()
        self._expect(':')
        cases: list[tree.ConditionalBlock] = []
        ends: bool | None = None
        while keyword := self._match('case'):
            value = self._expression()
            self._expect(':')
            body = self._block(keyword, 'case', 'default', 'end')
            cases.append(
                tree.ConditionalBlock(condition=value, body=body, **source_position(keyword))
            )
            ends = self._case_has_end(start) if ends is None else ends
            if ends:
                self._expect('end')
        otherwise: tree.StatementBlock = ()
        if self._at('default'):
            otherwise = self._else('default', start)
            if self._case_has_end(start) if ends is None else ends:
                self._expect('end')
        self._expect('end')
        return tree.SwitchStatement(
            subject=subject, cases=tuple(cases), otherwise=otherwise, **source_position(start)
        )

    def _case_has_end(self, switch: Token) -> bool:
        """
        Return whether each case has an `end` of its own, judged after the first case.

        Both styles occur. If two `end` follow each other, the first one belongs to the switch if
        it is in the column of the switch, and otherwise to the case.
        """
        if not self._at('end'):
            return False
        following = self._tokens[self._next + 1]
        if following.kind is not TokenKind.KEYWORD or following.text not in (
            'case',
            'default',
            'end',
        ):
            return False
        return following.text != 'end' or self._token.column != switch.column

    def _while(self) -> tree.WhileStatement:
        """Read "while" expression ":" block "end"."""
        start = self._advance()
        condition = self._expression()
        self._expect(':')
        self._loops += 1
        body = self._block(start, 'end')
        self._loops -= 1
        self._expect('end')
        return tree.WhileStatement(condition=condition, body=body, **source_position(start))

    def _return(self) -> tree.ReturnStatement:
        """Read "return" [ expression ]; the expression begins on the line of "return"."""
        start = self._advance()
        value = self._expression() if self._same_line() and self._starts_expression() else None
        return tree.ReturnStatement(value=value, **source_position(start))

    def _starts_expression(self) -> bool:
        if self._token.kind in (TokenKind.KEYWORD, TokenKind.SYMBOL):
            return self._at('(', '[', '-', '+', '!', 'not', 'run', *CONSTANTS)
        return self._token.kind is not TokenKind.END

    def _jump(self) -> tree.Statement:
        """Read "break" | "continue", inside a loop."""
        token = self._advance()
        if not self._loops:
            raise self.error(f'{token.text!r} stands outside a loop', token)
        return (tree.BreakStatement if token.text == 'break' else tree.ContinueStatement)(
            **source_position(token)
        )

    def _word(self) -> tree.Statement:
        """Read "halt" | "pause" | "enter_critical" | "exit_critical"."""
        token = self._advance()
        if token.text == 'halt':
            return tree.HaltStatement(**source_position(token))
        if token.text == 'pause':
            return tree.PauseStatement(**source_position(token))
        return tree.CriticalStatement(
            enter=token.text == 'enter_critical', **source_position(token)
        )

    def _thread_control(self) -> tree.Statement:
        """Read ("join" | "kill") unary."""
        token = self._advance()
        handle = self._unary()
        return (tree.JoinStatement if token.text == 'join' else tree.KillStatement)(
            handle=handle, **source_position(token)
        )

    def _label(self) -> tree.LabelStatement:
        """Read "$" NUMBER STRING { STRING }; the strings are on one line."""
        start = self._advance()
        number = self._expect_kind(TokenKind.NUMBER)
        if not number.text.isdecimal():
            raise self.error('the number of a label is a whole number', number)
        text = self._expect_kind(TokenKind.STRING).text
        while self._token.kind is TokenKind.STRING and self._same_line():
            self._advance()
        return tree.LabelStatement(number=int(number.number), text=text, **source_position(start))

    def _assignment_or_call(self) -> tree.Statement:
        """Read [ "global" | "local" ] target "=" expression | call."""
        start = self._token
        qualifier: Literal['', 'global', 'local'] = ''
        if self._match('global'):
            qualifier = 'global'
        elif self._match('local'):
            qualifier = 'local'
        target = self._unary()
        if qualifier and not isinstance(target, tree.NameExpression):
            raise self.error(f'{qualifier!r} is followed by a name and a value', start)
        if self._at('='):
            return self._assignment(target, qualifier, start)
        if qualifier:
            raise self.error(f"'=' is missing before {self._found()}")
        if not isinstance(
            target, tree.CallExpression | tree.MethodCallExpression | tree.RunExpression
        ):
            at = self._token if self._same_line() else start
            reason = _OF_OTHERS.get(start.text) or _OF_OTHERS.get(at.text)
            raise self.error(reason or 'a statement is an assignment or a call', at)
        return tree.CallStatement(call=target, **source_position(start))

    def _assignment(
        self, target: tree.Expression, qualifier: Literal['', 'global', 'local'], start: Token
    ) -> tree.AssignStatement:
        """Read "=" expression, after a target that must be a variable or a part of one."""
        base: tree.Expression = target
        while isinstance(base, tree.IndexExpression | tree.FieldExpression):
            base = base.target
        if not isinstance(base, tree.NameExpression):
            raise self.error('only a variable or a part of one can be assigned to', start)
        self._expect('=')
        value = self._expression()
        assert isinstance(
            target, tree.NameExpression | tree.IndexExpression | tree.FieldExpression
        )
        return tree.AssignStatement(
            target=target, value=value, qualifier=qualifier, **source_position(start)
        )
