# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The syntax tree: data only.

Every node is frozen and carries the 1-based line and column of the token that a reader would
point at. The parser makes these nodes; the static check and the compiler read them.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, fields
from typing import Literal as OneOf


@dataclass(frozen=True, slots=True, kw_only=True)
class Node:
    """Anything that stands at a place in the text."""

    line: int
    column: int


class Expression(Node):
    """A node that has a value."""

    __slots__ = ()


class Statement(Node):
    """A node that does something."""

    __slots__ = ()


Block = tuple[Statement, ...]


# Expressions


@dataclass(frozen=True, slots=True, kw_only=True)
class Constant(Expression):
    """A number, a string, True, False or None."""

    value: int | float | str | bool | None


@dataclass(frozen=True, slots=True, kw_only=True)
class Name(Expression):
    """A variable that is read, or assigned to when it is a target."""

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
class Unary(Expression):
    """`-a`, `+a`, `not a`."""

    operator: str
    operand: Expression


@dataclass(frozen=True, slots=True, kw_only=True)
class Binary(Expression):
    """Arithmetic or a comparison; both operands are always evaluated."""

    operator: str
    left: Expression
    right: Expression


@dataclass(frozen=True, slots=True, kw_only=True)
class Logical(Expression):
    """`and`, `or`, `xor`: the first two evaluate the right side only where it matters."""

    operator: str
    left: Expression
    right: Expression


@dataclass(frozen=True, slots=True, kw_only=True)
class Argument(Node):
    """One argument of a call; `name` is None for a positional one."""

    name: str | None
    value: Expression


@dataclass(frozen=True, slots=True, kw_only=True)
class Call(Expression):
    """`name(arguments)`: a function of the program or a builtin."""

    function: str
    arguments: tuple[Argument, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class MethodCall(Expression):
    """`target.method(arguments)`, as remote procedure handles have it."""

    target: Expression
    method: str
    arguments: tuple[Argument, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Run(Expression):
    """`run name()`: starts a thread; its value is the handle."""

    thread: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Index(Expression):
    """`l[i]` or `m[row, column]`."""

    target: Expression
    indices: tuple[Expression, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Field(Expression):
    """`s.name`."""

    target: Expression
    name: str


# Statements


@dataclass(frozen=True, slots=True, kw_only=True)
class Assign(Statement):
    """`target = value`; the target is a name, or a place inside a named variable."""

    target: Name | Index | Field
    value: Expression
    qualifier: OneOf['', 'global', 'local']


@dataclass(frozen=True, slots=True, kw_only=True)
class CallStatement(Statement):
    """A call (or `run`) whose value is dropped."""

    call: Expression


@dataclass(frozen=True, slots=True, kw_only=True)
class Branch(Node):
    """A condition (of `if`, `elif`) or a value (of `case`) and what it guards."""

    condition: Expression
    body: Block


@dataclass(frozen=True, slots=True, kw_only=True)
class If(Statement):
    """`if`, any number of `elif`, and `else` (empty when there is none)."""

    branches: tuple[Branch, ...]
    otherwise: Block


@dataclass(frozen=True, slots=True, kw_only=True)
class Switch(Statement):
    """`switch`: the first case that equals the subject runs, without falling through."""

    subject: Expression
    cases: tuple[Branch, ...]
    otherwise: Block


@dataclass(frozen=True, slots=True, kw_only=True)
class While(Statement):
    """A loop."""

    condition: Expression
    body: Block


@dataclass(frozen=True, slots=True, kw_only=True)
class Break(Statement):
    """Leave the innermost loop."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Continue(Statement):
    """Go on with the next turn of the innermost loop."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Return(Statement):
    """Leave the function; without a value it returns None."""

    value: Expression | None


@dataclass(frozen=True, slots=True, kw_only=True)
class Halt(Statement):
    """End the whole program."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Pause(Statement):
    """Pause the whole program until someone resumes it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Join(Statement):
    """Wait until a thread has ended."""

    handle: Expression


@dataclass(frozen=True, slots=True, kw_only=True)
class Kill(Statement):
    """End a thread and its children."""

    handle: Expression


@dataclass(frozen=True, slots=True, kw_only=True)
class Critical(Statement):
    """`enter_critical` or `exit_critical`."""

    enter: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class Label(Statement):
    """`$ 12 "text"`: where a PolyScope program stands; no effect."""

    number: int
    text: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Parameter(Node):
    """A parameter of a function, with its default if it has one."""

    name: str
    default: Expression | None


@dataclass(frozen=True, slots=True, kw_only=True)
class Function(Statement):
    """A `def` or a `thread`."""

    name: str
    kind: OneOf['def', 'thread']
    parameters: tuple[Parameter, ...]
    body: Block


@dataclass(frozen=True, slots=True, kw_only=True)
class Program(Node):
    """What is sent to a controller: `def` (primary) or `sec` (secondary), with its name."""

    name: str
    kind: OneOf['def', 'sec']
    body: Block


def children(node: Node) -> Iterator[Node]:
    """Yield the nodes directly below `node`, in the order of the text."""
    for field in fields(node):
        value = getattr(node, field.name)
        if isinstance(value, Node):
            yield value
        elif isinstance(value, tuple):
            yield from value
