# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Compiles syntax trees to Python closures, once per program, so that a cycle costs little.

Work is counted in nodes of the tree. Entering a block of statements pays for all its nodes.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any, NoReturn

from ur_cartesian_driver.urscript import script_values as values
from ur_cartesian_driver.urscript.compiling.closures import (
    BREAK,
    choose_runner,
    CompiledFunction,
    CompiledNode,
    CONTINUE,
    ProgramHalted,
    RETURN,
    Runtime,
    ScriptSteps,
    sequence,
    StackFrame,
    SWITCH,
    UNSET,
)
from ur_cartesian_driver.urscript.compiling.expression_compiler import ExpressionCompiler
from ur_cartesian_driver.urscript.compiling.scopes import Builtin, FIRST_LOCAL, Scope
from ur_cartesian_driver.urscript.parsing import syntax_tree as tree
from ur_cartesian_driver.urscript.script_values import Value


def compile_program(
    root: Scope,
    builtins: Mapping[str, Builtin],
    runtime: Runtime,
    procedures: dict[int, CompiledFunction],
    *,
    lazily: bool = False,
) -> CompiledFunction:
    """
    Compile a checked program and return the body of its main thread.

    :param procedures: the functions that exist already, by the id of their scopes; the functions
        of the program are added to them.
    :param lazily: compile each function when it is called for the first time.
    """
    procedures |= {id(scope): _procedure(scope, runtime.interleaves) for scope in root.walk()}
    for scope in root.walk():
        compiler = _Compiler(scope, builtins, runtime, procedures)
        compiler.fill(procedures[id(scope)], lazily=lazily)
    return procedures.pop(id(root))


def _procedure(scope: Scope, interleaves: bool) -> CompiledFunction:
    """Return a function without its body; bodies come later, because functions call each other."""
    return CompiledFunction(
        name=scope.definition.name if scope.definition else '',
        suspends=scope.suspends or interleaves,
        template=[None] + [UNSET] * len(scope.locals),
    )


class _Compiler(ExpressionCompiler):
    """Compiles the body of one function."""

    def fill(self, procedure: CompiledFunction, *, lazily: bool) -> None:
        """Compile body and defaults into a procedure."""
        procedure.body = self._body_of_first_call(procedure) if lazily else self._body()
        parameters = self._scope.definition.parameters if self._scope.definition else ()
        for slot, parameter in enumerate(parameters, FIRST_LOCAL):
            if parameter.default is not None:
                procedure.defaults[slot] = self.copied_expression(parameter.default)

    def _body(self) -> CompiledNode:
        return self._block(self._scope.body, self._scope.owner)

    def _body_of_first_call(self, procedure: CompiledFunction) -> CompiledNode:
        """Return code that, when first run, replaces itself by the compiled body and runs that."""

        def plain(frame: StackFrame) -> Any:
            procedure.body = self._body()
            return procedure.body.run(frame)

        def steps(frame: StackFrame) -> ScriptSteps:
            body = procedure.body = self._body()
            return (yield from body.run(frame)) if body.suspends else body.run(frame)

        return CompiledNode(steps if procedure.suspends else plain, procedure.suspends)

    def _block(self, statements: tree.StatementBlock, owner: tree.SyntaxNode) -> CompiledNode:
        """Compile consecutive statements; all their nodes are paid for at the beginning."""
        first = statements[0] if statements else owner
        call_location = (first.line, first.column)
        codes = [code for statement in statements for code in self._statement(statement)]
        weight = 1 + sum(code.weight for code in codes)
        runs = [code.run for code in codes]
        pairs = [(code.run, code.suspends) for code in codes]
        runtime = self._runtime

        def plain(frame: StackFrame) -> str | None:
            runtime.fuel -= weight
            if runtime.fuel < 0:
                runtime.raise_budget_exceeded(*call_location)
            for run in runs:
                signal: str | None = run(frame)
                if signal is not None:
                    return signal
            return None

        def steps(frame: StackFrame) -> ScriptSteps:
            runtime.fuel -= weight
            if runtime.fuel < 0:
                runtime.raise_budget_exceeded(*call_location)
            for run, suspends in pairs:
                signal = (yield from run(frame)) if suspends else run(frame)
                if signal is not None:
                    return signal
            return None

        def interleaved_steps(frame: StackFrame) -> ScriptSteps:
            runtime.fuel -= weight
            if runtime.fuel < 0:
                runtime.raise_budget_exceeded(*call_location)
            for run, suspends in pairs:
                if runtime.switches_now():
                    yield SWITCH
                signal = (yield from run(frame)) if suspends else run(frame)
                if signal is not None:
                    return signal
            return None

        if runtime.interleaves:
            return CompiledNode(interleaved_steps, True, 0)
        suspends = any(code.suspends for code in codes)
        return CompiledNode(steps if suspends else plain, suspends, 0)

    def _statement(self, node: tree.Statement) -> Iterator[CompiledNode]:
        """Yield the code of a statement; labels and definitions have none."""
        match node:
            case tree.AssignStatement():
                yield self._assign(node)
            case tree.CallStatement():
                yield self._call_statement(node)
            case tree.IfStatement():
                yield self._if(node)
            case tree.SwitchStatement():
                yield self._switch(node)
            case tree.WhileStatement():
                yield self._while(node)
            case tree.BreakStatement():
                yield CompiledNode(lambda frame: BREAK)
            case tree.ContinueStatement():
                yield CompiledNode(lambda frame: CONTINUE)
            case tree.ReturnStatement():
                yield self._return(node)
            case tree.HaltStatement():
                yield CompiledNode(_halt)
            case tree.PauseStatement():
                yield self._pause()
            case tree.JoinStatement():
                yield self._join(node)
            case tree.KillStatement():
                kill = self._runtime.kill
                yield sequence([self.expression(node.handle)], lambda frame, found: kill(*found))
            case tree.CriticalStatement():
                yield self._critical(node)
            case tree.LabelStatement() | tree.FunctionDefinition():
                return

    def _critical(self, node: tree.CriticalStatement) -> CompiledNode:
        """Compile the entry or exit of a critical section, which stops random thread switches."""
        runtime, enter = self._runtime, node.enter

        def plain(frame: StackFrame) -> None:
            runtime.thread.in_critical_section = enter

        return CompiledNode(plain)

    def _call_statement(self, node: tree.CallStatement) -> CompiledNode:
        call = self.expression(node.call)
        run = call.run

        def plain(frame: StackFrame) -> None:
            run(frame)

        def steps(frame: StackFrame) -> ScriptSteps:
            yield from run(frame)
            return None

        return choose_runner(plain, steps, [call])

    def _assign(self, node: tree.AssignStatement) -> CompiledNode:
        if not isinstance(node.target, tree.NameExpression):
            return self._assign_part(node)
        slot, is_local = self._slot(node.target.identifier, node.qualifier)
        value = self.copied_expression(node.value)
        run, runtime, shared = value.run, self._runtime, self._runtime.globals

        def plain_local(frame: StackFrame) -> None:
            frame[slot] = run(frame)

        def plain_global(frame: StackFrame) -> None:
            shared[slot] = run(frame)

        def steps(frame: StackFrame) -> ScriptSteps:
            found = yield from run(frame)
            (frame if is_local else shared)[slot] = found
            return None

        def interleaved_steps(frame: StackFrame) -> ScriptSteps:
            found = (yield from run(frame)) if value.suspends else run(frame)
            if runtime.switches_now():
                yield SWITCH
            shared[slot] = found
            return None

        if runtime.interleaves and not is_local:
            return CompiledNode(interleaved_steps, True, 1 + value.weight)
        return choose_runner(plain_local if is_local else plain_global, steps, [value])

    def _assign_part(self, node: tree.AssignStatement) -> CompiledNode:
        """Compile an assignment to a part of a variable, such as `a.b[i] = value`."""
        base, keys, indices = self._path(node.target)
        read = self._name(base).run
        slot, is_local = self._slot(base.identifier)
        shared = self._runtime.globals

        def finish(frame: StackFrame, found: list[Value]) -> None:
            rest = iter(found[1:])
            path = [
                key if isinstance(key, str) else tuple(next(rest) for _ in range(key))
                for key in keys
            ]
            container = values.set_part(read(frame), path, found[0])
            (frame if is_local else shared)[slot] = container

        return self._positioned(node, [self.copied_expression(node.value), *indices], finish)

    def _path(
        self, target: tree.Expression
    ) -> tuple[tree.NameExpression, list[str | int], list[CompiledNode]]:
        """Return the variable, the keys (field name or count of indices), and code of indices."""
        if isinstance(target, tree.FieldExpression):
            base, keys, indices = self._path(target.target)
            return base, [*keys, target.name], indices
        if isinstance(target, tree.IndexExpression):
            base, keys, indices = self._path(target.target)
            own = [self.expression(index) for index in target.indices]
            return base, [*keys, len(own)], indices + own
        assert isinstance(target, tree.NameExpression)
        return target, [], []

    def _if(self, node: tree.IfStatement) -> CompiledNode:
        truth = values.truth
        conditions = [self.expression(branch.condition) for branch in node.branches]
        bodies = [self._block(branch.body, branch) for branch in node.branches]
        otherwise = self._block(node.otherwise, node)
        pairs = list(zip(conditions, bodies, strict=True))
        runs = [(condition.run, body.run) for condition, body in pairs]
        run_otherwise = otherwise.run

        def plain(frame: StackFrame) -> Any:
            for condition, body in runs:
                value = condition(frame)
                if value is True or (value is not False and truth(value)):
                    return body(frame)
            return run_otherwise(frame)

        def steps(frame: StackFrame) -> ScriptSteps:
            for condition, body in pairs:
                run = condition.run
                if truth((yield from run(frame)) if condition.suspends else run(frame)):
                    return (yield from body.run(frame)) if body.suspends else body.run(frame)
            run = run_otherwise
            return (yield from run(frame)) if otherwise.suspends else run(frame)

        return choose_runner(plain, steps, [*conditions, *bodies, otherwise])

    def _switch(self, node: tree.SwitchStatement) -> CompiledNode:
        subject = self.expression(node.subject)
        cases = [
            (self.expression(case.condition), self._block(case.body, case)) for case in node.cases
        ]
        otherwise = self._block(node.otherwise, node)
        parts = [subject, otherwise, *(code for case in cases for code in case)]

        def steps(frame: StackFrame) -> ScriptSteps:
            wanted = (yield from subject.run(frame)) if subject.suspends else subject.run(frame)
            for value, body in cases:
                run = value.run
                found = (yield from run(frame)) if value.suspends else run(frame)
                if wanted == found:
                    return (yield from body.run(frame)) if body.suspends else body.run(frame)
            run = otherwise.run
            return (yield from run(frame)) if otherwise.suspends else run(frame)

        return choose_runner(lambda frame: _finish(steps(frame)), steps, parts)

    def _while(self, node: tree.WhileStatement) -> CompiledNode:
        truth, runtime = values.truth, self._runtime
        condition = self.expression(node.condition)
        body = self._block(node.body, node)
        run_condition, run_body, weight = condition.run, body.run, condition.weight

        def plain(frame: StackFrame) -> str | None:
            while truth(run_condition(frame)):
                runtime.fuel -= weight
                signal: str | None = run_body(frame)
                if signal is BREAK:
                    break
                if signal is RETURN:
                    return signal
            return None

        def steps(frame: StackFrame) -> ScriptSteps:
            while truth(
                (yield from run_condition(frame)) if condition.suspends else run_condition(frame)
            ):
                runtime.fuel -= weight
                signal = (yield from run_body(frame)) if body.suspends else run_body(frame)
                if signal is BREAK:
                    break
                if signal is RETURN:
                    return signal
            return None

        return choose_runner(plain, steps, [condition, body])

    def _return(self, node: tree.ReturnStatement) -> CompiledNode:
        value = self._constant(None) if node.value is None else self.copied_expression(node.value)

        def finish(frame: StackFrame, found: list[Value]) -> str:
            frame[0] = found[0]
            return RETURN

        return sequence([value], finish)

    def _pause(self) -> CompiledNode:
        runtime = self._runtime

        def steps(frame: StackFrame) -> ScriptSteps:
            runtime.paused = True
            yield

        return CompiledNode(steps, True)

    def _join(self, node: tree.JoinStatement) -> CompiledNode:
        handle = self.expression(node.handle)
        alive = self._runtime.alive

        def steps(frame: StackFrame) -> ScriptSteps:
            run = handle.run
            thread = (yield from run(frame)) if handle.suspends else run(frame)
            while alive(thread):
                yield

        return CompiledNode(steps, True, 1 + handle.weight)


def _halt(frame: StackFrame) -> NoReturn:
    raise ProgramHalted


def _finish(steps: ScriptSteps) -> Value:
    """Run steps that cannot take time."""
    try:
        next(steps)
    except StopIteration as end:
        return end.value
    raise AssertionError('code took time where none was expected')
