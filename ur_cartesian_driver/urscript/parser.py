# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Tokens to syntax tree: recursive descent, one method per rule.

Programs and statements are read here, expressions in
:mod:`~ur_cartesian_driver.urscript.expression_parser`.

The language is free of lines: a statement ends where its expression cannot go on, so
`a = 1 b = 2` are two statements and an operator at the end of a line continues it. Lines matter
in two places only: the value of `return` stands on its line, and so do the texts of a label.

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
    unary       = ( "-" | "+" ) unary | "run" NAME "(" ")" | postfix
    postfix     = primary { "(" arguments ")" | "[" expression [ "," expression ] "]" | "." NAME }
    arguments   = [ argument { "," argument } ]
    argument    = [ NAME "=" ] expression
    primary     = NUMBER | STRING | "True" | "False" | "None" | NAME | "(" expression ")"
                | "[" [ expression { "," expression } ] "]"
                | "p" "[" expression { "," expression } "]"
"""

from __future__ import annotations

from typing import Literal

from ur_cartesian_driver.urscript import syntax as tree
from ur_cartesian_driver.urscript.expression_parser import CONSTANTS, ExpressionParser
from ur_cartesian_driver.urscript.scanner import Kind, Token
from ur_cartesian_driver.urscript.token_reader import place


def parse(text: str) -> tree.Program:
    """
    Parse one program, with any blank lines and comments around it.

    :raises CompileError: at the first token that fits no rule.
    """
    parser = Parser(text)
    try:
        return parser.program()
    except RecursionError:
        raise parser.error('the program is nested too deeply') from None


def parse_line(text: str) -> tree.Program:
    """
    Parse statements that belong to a program that runs already, as if they were one.

    :raises CompileError: at the first token that fits no rule.
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

    # Programs, functions and blocks

    def program(self) -> tree.Program:
        """Read ("def" | "sec") NAME "(" ")" ":" block "end"."""
        start = self._token
        kind: Literal['def', 'sec']
        if self._match('def'):
            kind = 'def'
        elif start.kind is Kind.NAME and start.text == 'sec':
            self._advance()
            kind = 'sec'
        else:
            raise self.error("a program begins with 'def' or 'sec'")
        name = self._expect_kind(Kind.NAME).text
        for symbol in '():':
            self._expect(symbol)
        body = self._block('end')
        self._expect('end')
        if self._token.kind is not Kind.END:
            raise self.error('there is text after the end of the program')
        return tree.Program(name=name, kind=kind, body=body, **place(start))

    def line(self) -> tree.Program:
        """Read { statement }, up to the end of the text."""
        start = self._token
        statements: list[tree.Statement] = []
        while self._token.kind is not Kind.END:
            statements.append(self._statement())
        return tree.Program(name='line', kind='def', body=tuple(statements), **place(start))

    def _block(self, *closing: str) -> tree.Block:
        """Read { statement }, up to one of the keywords that close it."""
        statements: list[tree.Statement] = []
        with self._nested():
            while not self._at(*closing):
                if self._token.kind is Kind.END:
                    raise self.error("an 'end' is missing")
                statements.append(self._statement())
        return tuple(statements)

    def _function(self) -> tree.Function:
        """Read ("def" | "thread") NAME "(" [ parameter { "," parameter } ] ")" ":" block "end"."""
        kind: Literal['def', 'thread'] = 'def' if self._advance().text == 'def' else 'thread'
        name = self._expect_kind(Kind.NAME)
        self._expect('(')
        parameters = self._list(self._parameter, ')')
        if len({parameter.name for parameter in parameters}) < len(parameters):
            raise self.error('two parameters have the same name', name)
        if kind == 'thread' and parameters:
            raise self.error('a thread takes no parameters', name)
        self._expect(':')
        loops, self._loops = self._loops, 0
        body = self._block('end')
        self._loops = loops
        self._expect('end')
        return tree.Function(
            name=name.text, kind=kind, parameters=parameters, body=body, **place(name)
        )

    def _parameter(self) -> tree.Parameter:
        """Read NAME [ "=" expression ]."""
        name = self._expect_kind(Kind.NAME)
        default = self._expression() if self._match('=') else None
        return tree.Parameter(name=name.text, default=default, **place(name))

    # Statements

    def _statement(self) -> tree.Statement:
        """Read the statement that the first token announces."""
        token = self._token
        rule = {
            'def': self._function, 'thread': self._function, 'if': self._if,
            'switch': self._switch, 'while': self._while, 'return': self._return,
            'break': self._jump, 'continue': self._jump, 'halt': self._word,
            'pause': self._word, 'enter_critical': self._word, 'exit_critical': self._word,
            'join': self._thread_control, 'kill': self._thread_control, '$': self._label,
        }.get(token.text)  # fmt: skip
        if rule and token.kind in (Kind.KEYWORD, Kind.SYMBOL):
            return rule()
        return self._assignment_or_call()

    def _if(self) -> tree.If:
        """Read "if" expression ":" block { "elif" ... } [ "else" ":" block ] "end"."""
        start = self._token
        branches: list[tree.Branch] = []
        while keyword := self._match('if') if not branches else self._match('elif'):
            condition = self._expression()
            self._expect(':')
            body = self._block('elif', 'else', 'end')
            branches.append(tree.Branch(condition=condition, body=body, **place(keyword)))
        otherwise = self._else('else') if self._at('else') else ()
        self._expect('end')
        return tree.If(branches=tuple(branches), otherwise=otherwise, **place(start))

    def _else(self, keyword: str) -> tree.Block:
        """Read ("else" | "default") ":" block."""
        self._expect(keyword)
        self._expect(':')
        return self._block('end')

    def _switch(self) -> tree.Switch:
        """Read "switch" expression ":" { "case" ... } [ "default" ... ] "end"."""
        start = self._advance()
        subject = self._expression()
        self._expect(':')
        cases: list[tree.Branch] = []
        ends: bool | None = None
        while keyword := self._match('case'):
            value = self._expression()
            self._expect(':')
            body = self._block('case', 'default', 'end')
            cases.append(tree.Branch(condition=value, body=body, **place(keyword)))
            ends = self._case_has_end(start) if ends is None else ends
            if ends:
                self._expect('end')
        otherwise: tree.Block = ()
        if self._at('default'):
            otherwise = self._else('default')
            if self._case_has_end(start) if ends is None else ends:
                self._expect('end')
        self._expect('end')
        return tree.Switch(
            subject=subject, cases=tuple(cases), otherwise=otherwise, **place(start)
        )

    def _case_has_end(self, switch: Token) -> bool:
        """
        Tell from the end of the first case whether cases have an `end` of their own.

        Both styles occur. An `end` before another `end` could be either; then it belongs to the
        switch if it stands in the column of the switch.
        """
        if not self._at('end'):
            return False
        following = self._tokens[self._next + 1]
        if following.kind is not Kind.KEYWORD or following.text not in ('case', 'default', 'end'):
            return False
        return following.text != 'end' or self._token.column != switch.column

    def _while(self) -> tree.While:
        """Read "while" expression ":" block "end"."""
        start = self._advance()
        condition = self._expression()
        self._expect(':')
        self._loops += 1
        body = self._block('end')
        self._loops -= 1
        self._expect('end')
        return tree.While(condition=condition, body=body, **place(start))

    def _return(self) -> tree.Return:
        """Read "return" [ expression ]; a value stands on the line of the keyword."""
        start = self._advance()
        value = self._expression() if self._same_line() and self._starts_expression() else None
        return tree.Return(value=value, **place(start))

    def _starts_expression(self) -> bool:
        if self._token.kind in (Kind.KEYWORD, Kind.SYMBOL):
            return self._at('(', '[', '-', '+', 'not', 'run', *CONSTANTS)
        return self._token.kind is not Kind.END

    def _jump(self) -> tree.Statement:
        """Read "break" | "continue", inside a loop."""
        token = self._advance()
        if not self._loops:
            raise self.error(f'{token.text!r} stands outside a loop', token)
        return (tree.Break if token.text == 'break' else tree.Continue)(**place(token))

    def _word(self) -> tree.Statement:
        """Read "halt" | "pause" | "enter_critical" | "exit_critical"."""
        token = self._advance()
        if token.text == 'halt':
            return tree.Halt(**place(token))
        if token.text == 'pause':
            return tree.Pause(**place(token))
        return tree.Critical(enter=token.text == 'enter_critical', **place(token))

    def _thread_control(self) -> tree.Statement:
        """Read ("join" | "kill") unary."""
        token = self._advance()
        handle = self._unary()
        return (tree.Join if token.text == 'join' else tree.Kill)(handle=handle, **place(token))

    def _label(self) -> tree.Label:
        """Read "$" NUMBER STRING { STRING }, on one line."""
        start = self._advance()
        number = self._expect_kind(Kind.NUMBER)
        text = self._expect_kind(Kind.STRING).text
        while self._token.kind is Kind.STRING and self._same_line():
            self._advance()
        return tree.Label(number=int(number.number), text=text, **place(start))

    def _assignment_or_call(self) -> tree.Statement:
        """Read [ "global" | "local" ] target "=" expression | call."""
        start = self._token
        qualifier: Literal['', 'global', 'local'] = ''
        if self._match('global'):
            qualifier = 'global'
        elif self._match('local'):
            qualifier = 'local'
        target = self._unary()
        if qualifier and not isinstance(target, tree.Name):
            raise self.error(f'{qualifier!r} is followed by a name and a value', start)
        if self._at('='):
            return self._assignment(target, qualifier, start)
        if qualifier:
            raise self.error(f"'=' is missing before {self._found()}")
        if not isinstance(target, tree.Call | tree.MethodCall | tree.Run):
            at = self._token if self._same_line() else start
            raise self.error('a statement is an assignment or a call', at)
        return tree.CallStatement(call=target, **place(start))

    def _assignment(
        self, target: tree.Expression, qualifier: Literal['', 'global', 'local'], start: Token
    ) -> tree.Assign:
        """Read the value; what stands before "=" must be a name or a place inside one."""
        base: tree.Expression = target
        while isinstance(base, tree.Index | tree.Field):
            base = base.target
        if not isinstance(base, tree.Name):
            raise self.error('only a variable or a part of one can be assigned to', start)
        self._expect('=')
        value = self._expression()
        assert isinstance(target, tree.Name | tree.Index | tree.Field)
        return tree.Assign(target=target, value=value, qualifier=qualifier, **place(start))
