# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The syntax tree: data only.

Every node is frozen and has the 1-based line and column of its most characteristic token. The
parser makes the nodes; name resolution (`scopes`) and the compiler read them.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, fields
import re
from typing import Literal as OneOf


@dataclass(frozen=True, slots=True, kw_only=True)
class SyntaxNode:
    """Anything with a position in the text."""

    line: int
    column: int


class Expression(SyntaxNode):
    """A node that has a value."""

    __slots__ = ()


class Statement(SyntaxNode):
    """A node that does something."""

    __slots__ = ()


StatementBlock = tuple[Statement, ...]


# Expressions


@dataclass(frozen=True, slots=True, kw_only=True)
class ConstantExpression(Expression):
    """A number, a string, True, False or None."""

    value: int | float | str | bool | None
    #: The type of the value, so that the nodes of 1, 1.0 and True are not equal, as the values
    #: are.
    kind: str = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, 'kind', type(self.value).__name__)


@dataclass(frozen=True, slots=True, kw_only=True)
class NameExpression(Expression):
    """A variable: the target of an assignment, or else read."""

    identifier: str


@dataclass(frozen=True, slots=True, kw_only=True)
class ListLiteral(Expression):
    """`[a, b]`; a list of lists is a matrix."""

    items: tuple[Expression, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class PoseLiteral(Expression):
    """`p[x, y, z, rx, ry, rz]`."""

    items: tuple[Expression, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class UnaryExpression(Expression):
    """`-a`, `+a`, `not a`."""

    operator: str
    operand: Expression


@dataclass(frozen=True, slots=True, kw_only=True)
class BinaryExpression(Expression):
    """An arithmetic operation or a comparison; both operands are always evaluated."""

    operator: str
    left: Expression
    right: Expression


@dataclass(frozen=True, slots=True, kw_only=True)
class LogicalExpression(Expression):
    """`and`, `or`, `xor`; `and` and `or` evaluate the right side only if it decides the result."""

    operator: str
    left: Expression
    right: Expression


@dataclass(frozen=True, slots=True, kw_only=True)
class CallArgument(SyntaxNode):
    """One argument of a call; `name` is None for a positional one."""

    name: str | None
    value: Expression


@dataclass(frozen=True, slots=True, kw_only=True)
class CallExpression(Expression):
    """`name(arguments)`: a function of the program or a builtin."""

    function: str
    arguments: tuple[CallArgument, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class MethodCallExpression(Expression):
    """`target.method(arguments)`: a method of a container or of a remote procedure handle."""

    target: Expression
    method: str
    arguments: tuple[CallArgument, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class RunExpression(Expression):
    """`run name()`: starts a thread; its value is the handle."""

    thread: str


@dataclass(frozen=True, slots=True, kw_only=True)
class IndexExpression(Expression):
    """`l[i]` or `m[row, column]`."""

    target: Expression
    indices: tuple[Expression, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class FieldExpression(Expression):
    """`s.name`."""

    target: Expression
    name: str


# Statements


@dataclass(frozen=True, slots=True, kw_only=True)
class AssignStatement(Statement):
    """`target = value`; the target is a variable or a part of one."""

    target: NameExpression | IndexExpression | FieldExpression
    value: Expression
    qualifier: OneOf['', 'global', 'local']


@dataclass(frozen=True, slots=True, kw_only=True)
class CallStatement(Statement):
    """A call (or `run`) whose value is ignored."""

    call: Expression


@dataclass(frozen=True, slots=True, kw_only=True)
class ConditionalBlock(SyntaxNode):
    """A condition of `if` or `elif`, or a value of `case`, with its block."""

    condition: Expression
    body: StatementBlock


@dataclass(frozen=True, slots=True, kw_only=True)
class IfStatement(Statement):
    """`if`, any number of `elif`, and `else`, whose block is empty if it is missing."""

    branches: tuple[ConditionalBlock, ...]
    otherwise: StatementBlock


@dataclass(frozen=True, slots=True, kw_only=True)
class SwitchStatement(Statement):
    """`switch`: the first case that equals the subject runs, without falling through."""

    subject: Expression
    cases: tuple[ConditionalBlock, ...]
    otherwise: StatementBlock


@dataclass(frozen=True, slots=True, kw_only=True)
class WhileStatement(Statement):
    """A loop."""

    condition: Expression
    body: StatementBlock


@dataclass(frozen=True, slots=True, kw_only=True)
class BreakStatement(Statement):
    """Leave the innermost loop."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ContinueStatement(Statement):
    """Continue with the next iteration of the innermost loop."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ReturnStatement(Statement):
    """Leave the function; without a value it returns None."""

    value: Expression | None


@dataclass(frozen=True, slots=True, kw_only=True)
class HaltStatement(Statement):
    """End the whole program."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PauseStatement(Statement):
    """Pause the whole program until someone resumes it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class JoinStatement(Statement):
    """Wait until a thread has ended."""

    handle: Expression


@dataclass(frozen=True, slots=True, kw_only=True)
class KillStatement(Statement):
    """End a thread and all threads that it started."""

    handle: Expression


@dataclass(frozen=True, slots=True, kw_only=True)
class CriticalStatement(Statement):
    """`enter_critical` or `exit_critical`."""

    enter: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class LabelStatement(Statement):
    """`$ 12 "text"`: a position in a PolyScope program; no effect."""

    number: int
    text: str


@dataclass(frozen=True, slots=True, kw_only=True)
class FunctionParameter(SyntaxNode):
    """A parameter of a function, with its default if it has one."""

    name: str
    default: Expression | None


@dataclass(frozen=True, slots=True, kw_only=True)
class FunctionDefinition(Statement):
    """A `def` or a `thread`."""

    name: str
    kind: OneOf['def', 'thread']
    parameters: tuple[FunctionParameter, ...]
    body: StatementBlock


@dataclass(frozen=True, slots=True, kw_only=True)
class ScriptProgram(SyntaxNode):
    """A program for a controller: `def` (primary) or `sec` (secondary), with its name."""

    name: str
    kind: OneOf['def', 'sec']
    body: StatementBlock


def children(node: SyntaxNode) -> Iterator[SyntaxNode]:
    """Yield the nodes directly below `node`, in the order of the text."""
    kind = type(node)
    if kind not in _FIELDS:
        _FIELDS[kind] = tuple(f.name for f in fields(node) if not _IS_PLAIN(str(f.type)))
    for name in _FIELDS[kind]:
        value = getattr(node, name)
        if isinstance(value, SyntaxNode):
            yield value
        elif isinstance(value, tuple):
            yield from value


#: The fields that hold other nodes, by kind of node; cached because every walk needs them.
_FIELDS: dict[type[SyntaxNode], tuple[str, ...]] = {}
#: Types of fields that hold no nodes.
_IS_PLAIN = re.compile(r'(?:int|float|str|bool|None|OneOf\[.*\]|[ |])+').fullmatch
