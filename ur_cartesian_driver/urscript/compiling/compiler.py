# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Compiles the syntax trees of URScript programs to Python code, once, so that cycles cost little.

A thread may evaluate a limited number of syntax tree nodes in each cycle of the controller; its
`fuel` is the number that is left. At the beginning of a block of statements, the Python code
*pays* for the block: it subtracts the number of nodes in the block from the fuel.
"""

from __future__ import annotations

import ast
from collections.abc import Hashable, Iterator, Mapping, Sequence
import inspect
from types import CodeType

from ur_cartesian_driver.urscript.compiling.expression_compiler import (
    CompiledExpression,
    DEPTH,
    ExpressionCompiler,
    Shared,
)
from ur_cartesian_driver.urscript.compiling.generated_code import (
    FILE_NAME,
    FunctionCode,
    GeneratedCode,
    GeneratedFunction,
    global_name,
    local_name,
    MAX_CALL_DEPTH,
)
from ur_cartesian_driver.urscript.compiling.scopes import Builtin, Scope
from ur_cartesian_driver.urscript.parsing import syntax_tree as tree
from ur_cartesian_driver.urscript.script_errors import CompileError

#: Python holds the interpreter lock while it compiles, which delays the controller's cycles in the
#: other thread. So a long block of a program's body is compiled in parts of about this many nodes,
#: which take about 3 ms each.
MAX_NODES = 400


#: Cache of compiled functions, see :func:`_function_code`; it is emptied at MAX_FUNCTIONS.
_functions: dict[Hashable, FunctionCode] = {}
MAX_FUNCTIONS = 2000


def compile_program(
    root: Scope,
    builtins: Mapping[str, Builtin],
    known: Mapping[int, GeneratedFunction],
    *,
    interleaves: bool,
    prefix: str = '',
) -> GeneratedCode:
    """
    Compile a checked program.

    :param root: the scope of the program's body, from `resolve`.
    :param known: the functions of the running program to which this one is added, by the id() of
        their scopes; empty = this program runs on its own.
    :param interleaves: whether threads may be switched between any two statements.
    :param prefix: first part of the names of all generated functions.
    :raises CompileError: loops are nested more deeply than Python allows.
    """
    scopes = list(root.walk())
    functions = {
        id(scope): GeneratedFunction(
            f'{prefix}f{i}_{scope.definition.name}' if scope.definition else f'{prefix}main',
            scope.suspends or interleaves,
        )
        for i, scope in enumerate(scopes)
    }
    shared = Shared(builtins, interleaves, {**known, **functions})
    timed = frozenset(
        name for name, builtin in builtins.items() if inspect.isgeneratorfunction(builtin)
    )
    names = interleaves, timed, frozenset(root.globals), tuple(functions.values())
    return GeneratedCode(
        scope=root,
        main=functions[id(root)],
        functions=functions,
        code=[_function_code(scope, shared, None if known else names) for scope in scopes],
    )


def _function_code(scope: Scope, shared: Shared, names: Hashable) -> FunctionCode:
    """
    Return the code of a function, from the cache if possible.

    Many clients send programs that differ only in one or two constants, such as a port. Functions
    without these constants are then found in the cache.

    :param names: the meanings of all names in the function, as a key of the cache; None = compile
        without the cache.
    """
    key = names, shared.functions[id(scope)], scope.definition
    found = _functions.get(key) if names and scope.definition else None
    if found is None:
        found = _FunctionCompiler(scope, shared).code()
        if names and scope.definition:
            if len(_functions) >= MAX_FUNCTIONS:
                _functions.clear()
            _functions[key] = found
    return found


#: Jumps: statements that leave the current iteration, loop or function.
_BREAK, _CONTINUE, _RETURN = 'break', 'continue', 'return'


class _FunctionCompiler(ExpressionCompiler):
    """Compiles one function, thread or body of a program."""

    def __init__(self, scope: Scope, shared: Shared) -> None:
        super().__init__(scope, shared)
        self._function = shared.functions[id(scope)]
        self._parts: list[CodeType] = []
        #: Number of loops around the current statement in the current part.
        self._loops = 0
        #: The kinds of jumps out of the current part (see `_part`); None = the code is in no part.
        self._exits: set[str] | None = None
        #: Global variables that the current part assigns.
        self._assigned: set[str] = set()

    def code(self) -> FunctionCode:
        """Return the code of the function and of its parts."""
        self.at(self._scope.owner)
        body: list[ast.stmt] = []
        definition = self._scope.definition
        parameters = definition.parameters if definition else ()
        if definition is not None:
            is_too_deep = self.compare(self.name(DEPTH), ast.Gt(), self.constant(MAX_CALL_DEPTH))
            body.append(self.if_true(is_too_deep, [self.do(self.call('too_deep'))]))
        for parameter in parameters:
            if parameter.default is not None:
                name, default = local_name(parameter.name), self.copied(parameter.default)
                is_unset = self.compare(self.name(name), ast.Is(), self.name('UNSET'))
                body.append(self.if_true(is_unset, [self.set(name, default.python)]))
        body += self._block(self._scope.body, self._scope.owner)
        unit = self._unit(self._function.name, body, parameters)
        return FunctionCode((*self._parts, unit), self._constants)

    def _unit(
        self,
        name: str,
        body: list[ast.stmt],
        parameters: Sequence[tree.FunctionParameter] = (),
    ) -> CodeType:
        """Return the compiled definition of a Python function."""
        self.at(self._scope.owner)
        if self._assigned:
            body.insert(0, self.node(ast.Global, sorted(self._assigned)))
        if self._function.suspends:  # a yield that is never reached makes it a generator
            body.append(self.if_true(self.constant(False), [self.do(self.wait())]))
        # Python requires a default for each parameter after the first one with a default.
        optional = [i for i, each in enumerate(parameters) if each.default is not None]
        defaults = len(parameters) - optional[0] if optional else 0
        names = (DEPTH, *(local_name(parameter.name) for parameter in parameters))
        function = self.function(name, names, defaults, body)
        try:
            return compile(ast.Module([function], []), FILE_NAME, 'exec', dont_inherit=True)
        except SyntaxError as error:  # too many nested loops
            owner = self._scope.owner
            text = f'syntax_error_on_line:{owner.line}:'
            raise CompileError(owner.line, owner.column, text, error.msg) from None

    # Statements of the program

    def _block(self, statements: tree.StatementBlock, owner: tree.SyntaxNode) -> list[ast.stmt]:
        """Compile consecutive statements; the code pays for all their nodes at the beginning."""
        weight = 1
        body: list[ast.stmt] = []
        for run in self._runs(statements):
            python, cost = self._part(run) if len(run) > 1 else self._statement_at_switch(run[0])
            body += python
            weight += cost
        self.at(statements[0] if statements else owner)
        is_spent = self.compare(self.runtime('fuel'), ast.Lt(), self.constant(0))
        exceed = self.if_true(is_spent, [self.do(self.call('exceed_budget'))])
        return [self.pay(weight), exceed, *body]

    def _runs(self, statements: tree.StatementBlock) -> Iterator[tree.StatementBlock]:
        """Divide statements into runs; a run of several statements is compiled as a part."""
        # Parts share global variables only, so the code of a function is not divided.
        sizes = [0 if self._scope.definition else _count_nodes(each) for each in statements]
        if sum(sizes) < 2 * MAX_NODES:
            yield from ((statement,) for statement in statements)
            return
        begin, size = 0, 0
        for i, each in enumerate(sizes):
            size += each
            if size >= MAX_NODES:
                yield statements[begin : i + 1]
                begin, size = i + 1, 0
        if begin < len(statements):
            yield statements[begin:]

    def _part(self, statements: tree.StatementBlock) -> tuple[list[ast.stmt], int]:
        """
        Compile statements as a separate Python function; all their variables are global.

        Return the code that calls the function, and the cost of the statements in nodes.
        """
        around = self._loops, self._exits, self._assigned
        self._loops, exits, self._assigned = 0, set[str](), set()
        self._exits = exits
        body, weight = [], 0
        for statement in statements:
            python, cost = self._statement_at_switch(statement)
            body += python
            weight += cost
        name = f'{self._function.name}_{len(self._parts)}'
        self._parts.append(self._unit(name, body or [self.node(ast.Pass)]))
        self._loops, self._exits, self._assigned = around
        self.at(statements[0])
        call: ast.expr = self.call(name, self.name(DEPTH))
        if self._function.suspends:
            call = self.steps(call)
        if not exits:
            return [self.do(call)], weight
        found = self.temporary()
        return [
            self.set(found, call),
            *(
                self.if_true(
                    self.compare(self.name(found), ast.Eq(), self.constant(jump)),
                    [self._leave(jump)],
                )
                for jump in sorted(exits)
            ),
        ], weight

    def _leave(self, jump: str) -> ast.stmt:
        """Return the code of a jump; a part returns the jump to the code that calls the part."""
        if self._loops and jump != _RETURN:
            return self.node(ast.Break if jump == _BREAK else ast.Continue)
        if self._exits is None:
            return self.node(ast.Return, None)
        self._exits.add(jump)
        return self.node(ast.Return, self.constant(jump))

    def _statement_at_switch(self, node: tree.Statement) -> tuple[list[ast.stmt], int]:
        """
        Return the code and the cost in nodes of a statement.

        If threads may be switched anywhere, the code begins with a point where they can switch.
        """
        if isinstance(node, tree.LabelStatement | tree.FunctionDefinition):
            return [], 0
        python, weight = self._statement(node)
        if self._shared.interleaves:
            self.at(node)
            python.insert(0, self.switch_threads())
        return python, weight

    def _statement(self, node: tree.Statement) -> tuple[list[ast.stmt], int]:
        match node:
            case tree.AssignStatement():
                return self._assign(node)
            case tree.CallStatement():
                call = self.expression(node.call)
                return [self.do(call.python)], 1 + call.weight
            case tree.IfStatement():
                return self._if(node)
            case tree.SwitchStatement():
                return self._switch(node)
            case tree.WhileStatement():
                return self._while(node)
            case tree.ReturnStatement():
                return self._return(node)
            case tree.JoinStatement():
                return self._join(node)
            case tree.KillStatement():
                handle = self.expression(node.handle)
                self.at(node)
                return [self.do(self.call('kill', handle.python))], 1 + handle.weight
        self.at(node)
        match node:
            case tree.BreakStatement():
                return [self._leave(_BREAK)], 1
            case tree.ContinueStatement():
                return [self._leave(_CONTINUE)], 1
            case tree.HaltStatement():
                return [self.do(self.call('halt'))], 1
            case tree.PauseStatement():
                pause = self.set_runtime('paused', self.constant(True))
                return [pause, self.do(self.wait())], 1
            case tree.CriticalStatement():
                enter = self.constant(node.enter)
                return [self.set_runtime('in_critical_section', enter)], 1
        raise AssertionError(node)

    def _assign(self, node: tree.AssignStatement) -> tuple[list[ast.stmt], int]:
        if not isinstance(node.target, tree.NameExpression):
            return self._assign_part(node)
        value = self.copied(node.value)
        self.at(node)
        name = self._assigned_variable(node.target.identifier, node.qualifier)
        if self._shared.interleaves and name in self._assigned:
            found = self.temporary()
            return [
                self.set(found, value.python),
                self.switch_threads(),
                self.set(name, self.name(found)),
            ], 1 + value.weight
        return [self.set(name, value.python)], 1 + value.weight

    def _assigned_variable(self, name: str, qualifier: str = '') -> str:
        """Return the generated name of an assigned variable; note global ones in `_assigned`."""
        variable = self.variable(name, qualifier)
        if variable == global_name(name):
            self._assigned.add(variable)
        return variable

    def _assign_part(self, node: tree.AssignStatement) -> tuple[list[ast.stmt], int]:
        """Compile an assignment to a part of a variable, such as `a.b[i] = value`."""
        value = self.copied(node.value)
        stored, path = self.temporary(), self.temporary()
        self.at(node)
        python = [self.set(stored, value.python)]
        base, keys, weight = self._path(node.target)
        self.at(node)
        python.append(self.set(path, self.key(keys)))
        name = self._assigned_variable(base.identifier)
        changed = self.call('set_part', self.name(name), self.name(path), self.name(stored))
        return [*python, self.set(name, changed)], 1 + value.weight + weight

    def _path(self, target: tree.Expression) -> tuple[tree.NameExpression, list[ast.expr], int]:
        """Return the variable, the keys of its part (the outermost first), and their cost."""
        if isinstance(target, tree.NameExpression):
            return target, [], 0
        assert isinstance(target, tree.FieldExpression | tree.IndexExpression)
        base, keys, weight = self._path(target.target)
        if isinstance(target, tree.FieldExpression):
            self.at(target)
            return base, [*keys, self.constant(target.name)], weight
        indices = [self.expression(index) for index in target.indices]
        self.at(target)
        key = self.key([index.python for index in indices])
        return base, [*keys, key], weight + sum(index.weight for index in indices)

    def _if(self, node: tree.IfStatement) -> tuple[list[ast.stmt], int]:
        weight = 1
        conditions: list[CompiledExpression] = []
        bodies = []
        for branch in node.branches:
            conditions.append(self.condition(branch.condition))
            bodies.append(self._block(branch.body, branch))
        python = self._block(node.otherwise, node)
        for condition, body, branch in zip(
            reversed(conditions), reversed(bodies), reversed(node.branches), strict=True
        ):
            self.at(branch)
            python = [self.if_true(condition.python, body, python)]
            weight += condition.weight
        return python, weight

    def _switch(self, node: tree.SwitchStatement) -> tuple[list[ast.stmt], int]:
        subject = self.expression(node.subject)
        wanted, weight = self.temporary(), 1 + subject.weight
        self.at(node)
        begin = self.set(wanted, subject.python)
        cases = [
            (self.expression(case.condition), self._block(case.body, case)) for case in node.cases
        ]
        python = self._block(node.otherwise, node)
        for (value, body), case in zip(reversed(cases), reversed(node.cases), strict=True):
            self.at(case)
            fits = self.compare(self.name(wanted), ast.Eq(), value.python)
            python = [self.if_true(fits, body, python)]
            weight += value.weight
        return [begin, *python], weight

    def _while(self, node: tree.WhileStatement) -> tuple[list[ast.stmt], int]:
        condition = self.condition(node.condition)
        self._loops += 1
        body = self._block(node.body, node)
        self._loops -= 1
        self.at(node)
        python = [self.pay(condition.weight), *body]
        loop = self.loop(condition.python, python)
        return [loop], 1 + condition.weight

    def _return(self, node: tree.ReturnStatement) -> tuple[list[ast.stmt], int]:
        if node.value is None:
            self.at(node)
            return [self._leave(_RETURN)], 2
        value = self.copied(node.value)
        self.at(node)
        if self._exits is not None:
            return [self.do(value.python), self._leave(_RETURN)], 1 + value.weight
        return [self.node(ast.Return, value.python)], 1 + value.weight

    def _join(self, node: tree.JoinStatement) -> tuple[list[ast.stmt], int]:
        handle = self.expression(node.handle)
        self.at(node)
        joined = self.temporary()
        is_alive = self.call('alive', self.name(joined))
        wait = self.loop(is_alive, [self.do(self.wait())])
        return [self.set(joined, handle.python), wait], 1 + handle.weight


def _count_nodes(node: tree.SyntaxNode) -> int:
    """Count the nodes of a tree, without function definitions: these are compiled separately."""
    if isinstance(node, tree.FunctionDefinition):
        return 0
    return 1 + sum(map(_count_nodes, tree.children(node)))
