# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Compiles expressions to closures.

Lists are values in this language: a list that is stored, passed or returned is copied if it may
also be stored elsewhere. An error gets the position of its operator, index or call.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
import inspect

from ur_cartesian_driver.urscript import script_values as values
from ur_cartesian_driver.urscript.compiling.closures import (
    choose_runner,
    CompiledFunction,
    CompiledNode,
    MAX_CALL_DEPTH,
    recursion_error,
    Runtime,
    ScriptSteps,
    sequence,
    StackFrame,
    Thread,
    UNSET,
)
from ur_cartesian_driver.urscript.compiling.scopes import bind, Builtin, Scope
from ur_cartesian_driver.urscript.container_methods import call_method
from ur_cartesian_driver.urscript.parsing import syntax_tree as tree
from ur_cartesian_driver.urscript.script_errors import RuntimeException
from ur_cartesian_driver.urscript.script_values import Value


class ExpressionCompiler:
    """Compiles the expressions of one function."""

    def __init__(
        self,
        scope: Scope,
        builtins: Mapping[str, Builtin],
        runtime: Runtime,
        procedures: Mapping[int, CompiledFunction],
    ) -> None:
        self._scope = scope
        self._builtins = builtins
        self._runtime = runtime
        #: Functions by the id of their scope; their bodies may not be compiled yet.
        self._procedures = procedures

    def expression(self, node: tree.Expression) -> CompiledNode:
        match node:
            case tree.ConstantExpression():
                return self._constant(node.value)
            case tree.NameExpression():
                return self._name(node)
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
                key = node.name
                target = [self.expression(node.target)]
                return self._positioned(
                    node, target, lambda frame, found: values.get_part(found[0], key)
                )
            case tree.CallExpression():
                return self._call(node)
            case tree.MethodCallExpression():
                return self._method_call(node)
            case tree.RunExpression():
                return self._run(node)
        raise AssertionError(node)

    def _literal(self, node: tree.ListLiteral | tree.PoseLiteral) -> CompiledNode:
        is_list = isinstance(node, tree.ListLiteral)
        make = values.make_list if is_list else values.make_pose
        numbers = [_number(item) for item in node.items]
        if None in numbers:
            items = [self.expression(item) for item in node.items]
            runtime, sized = self._runtime, values.SIZED

            def made(frame: StackFrame, found: list[Value]) -> Value:
                if found and type(found[0]) in sized:
                    runtime.pay_for(sum(map(values.size_of, found)), node.line, node.column)
                return make(found)

            return self._positioned(node, items, made)
        value = make(numbers)  # cannot fail
        signs = sum(isinstance(item, tree.UnaryExpression) for item in node.items)
        run = (lambda frame: value[:]) if is_list else (lambda frame: value)
        return CompiledNode(run, False, 1 + len(numbers) + signs)

    def copied_expression(self, node: tree.Expression) -> CompiledNode:
        """Compile an expression whose value will be stored or passed on."""
        code = self.expression(node)
        if self._is_temporary(node):
            return code
        run, runtime, sized = code.run, self._runtime, values.SIZED
        place = node.line, node.column

        def copied(value: Value) -> Value:
            runtime.pay_for(values.size_of(value), *place)
            return values.copy(value)

        def plain(frame: StackFrame) -> Value:
            value = run(frame)
            return copied(value) if type(value) in sized else value

        def steps(frame: StackFrame) -> ScriptSteps:
            value = yield from run(frame)
            return copied(value) if type(value) in sized else value

        return CompiledNode(steps if code.suspends else plain, code.suspends, code.weight)

    def _is_temporary(self, node: tree.Expression) -> bool:
        """Return whether an expression's value is stored nowhere else, so it needs no copy."""
        if isinstance(node, tree.CallExpression):
            return self._scope.function(node.function) is not None
        stored = (
            tree.NameExpression
            | tree.IndexExpression
            | tree.FieldExpression
            | tree.UnaryExpression
            | tree.MethodCallExpression
        )
        return not isinstance(node, stored)

    @staticmethod
    def _positioned(
        node: tree.SyntaxNode,
        parts: Sequence[CompiledNode],
        finish: Callable[[StackFrame, list[Value]], Value],
    ) -> CompiledNode:
        """Evaluate parts in sequence; errors in `finish` get the position of this node."""

        def positioned(frame: StackFrame, found: list[Value]) -> Value:
            try:
                return finish(frame, found)
            except RuntimeException as error:
                raise error.at(node.line, node.column) from None

        return sequence(parts, positioned)

    @staticmethod
    def _constant(value: Value) -> CompiledNode:
        return CompiledNode(lambda frame: value)

    def _name(self, node: tree.NameExpression) -> CompiledNode:
        name = node.identifier
        slot, is_local = self._slot(name)
        shared = self._runtime.globals

        def read_local(frame: StackFrame) -> Value:
            value = frame[slot]
            if value is UNSET:
                raise _unset(node)
            return value

        def read_global(frame: StackFrame) -> Value:
            value = shared[slot]
            if value is UNSET:
                raise _unset(node)
            return value

        return CompiledNode(read_local if is_local else read_global)

    def _slot(self, name: str, qualifier: str = '') -> tuple[int, bool]:
        """Return the slot of a variable and whether it is in the frame."""
        if name in self._scope.locals and qualifier != 'global':
            return self._scope.locals[name], True
        return self._scope.globals[name], False

    def _unary(self, node: tree.UnaryExpression) -> CompiledNode:
        operate = values.UNARY[node.operator]
        return self._positioned(
            node, [self.copied_expression(node.operand)], lambda frame, found: operate(found[0])
        )

    def _binary(self, node: tree.BinaryExpression) -> CompiledNode:
        on_values = values.BINARY[node.operator]
        on_floats = values.ON_FLOATS.get(node.operator, on_values)
        left, right = self.expression(node.left), self.expression(node.right)
        run_left, run_right = left.run, right.run
        runtime, sized = self._runtime, values.SIZED

        def operate(a: Value, b: Value) -> Value:
            if type(a) in sized or type(b) in sized:
                runtime.pay_for(values.work_on(a, b), node.line, node.column)
            return on_values(a, b)

        if left.suspends or right.suspends:
            return self._positioned(node, [left, right], lambda frame, found: operate(*found))

        def run(frame: StackFrame) -> Value:
            a, b = run_left(frame), run_right(frame)
            try:
                if type(a) is float and type(b) is float:
                    return on_floats(a, b)
                if type(a) in sized or type(b) in sized:
                    return operate(a, b)
                return on_values(a, b)
            except RuntimeException as error:
                raise error.at(node.line, node.column) from None

        return CompiledNode(run, False, 1 + left.weight + right.weight)

    def _logical(self, node: tree.LogicalExpression) -> CompiledNode:
        left, right = self.expression(node.left), self.expression(node.right)
        truth = values.truth
        if node.operator == 'xor':
            return sequence([left, right], lambda frame, both: truth(both[0]) != truth(both[1]))
        decisive = node.operator == 'or'
        run_left, run_right = left.run, right.run

        def plain(frame: StackFrame) -> bool:
            return decisive if truth(run_left(frame)) is decisive else truth(run_right(frame))

        def steps(frame: StackFrame) -> ScriptSteps:
            value = (yield from run_left(frame)) if left.suspends else run_left(frame)
            if truth(value) is decisive:
                return decisive
            return truth((yield from run_right(frame)) if right.suspends else run_right(frame))

        return choose_runner(plain, steps, [left, right])

    def _index(self, node: tree.IndexExpression) -> CompiledNode:
        parts = [self.expression(node.target), *map(self.expression, node.indices)]
        if len(parts) == 2 and not any(part.suspends for part in parts):
            return self._item(node, *parts)
        return self._positioned(
            node, parts, lambda frame, found: values.get_part(found[0], tuple(found[1:]))
        )

    @staticmethod
    def _item(
        node: tree.IndexExpression, target: CompiledNode, index: CompiledNode
    ) -> CompiledNode:
        """Compile the common case `list[int]`, with a fast path for a valid index."""
        run_target, run_index = target.run, index.run

        def run(frame: StackFrame) -> Value:
            container, position = run_target(frame), run_index(frame)
            if (
                type(container) is list
                and type(position) is int
                and 0 <= position < len(container)
            ):
                return container[position]
            try:
                return values.get_part(container, (position,))
            except RuntimeException as error:
                raise error.at(node.line, node.column) from None

        return CompiledNode(run, False, 1 + target.weight + index.weight)

    # Calls

    def _call(self, node: tree.CallExpression) -> CompiledNode:
        callee = self._scope.function(node.function)
        if callee is not None:
            return self._call_function(node, callee)
        return self._call_builtin(node, self._builtins[node.function])

    def _call_function(self, node: tree.CallExpression, callee: Scope) -> CompiledNode:
        """Bind arguments to slots of a new frame and run the body in it."""
        procedure = self._procedures[id(callee)]
        make_frame = self._make_frame(node, callee)
        make = make_frame.run
        enter = self._enter(node)

        def plain(frame: StackFrame) -> Value:
            new = make(frame)
            thread = enter()
            try:
                for slot, default in procedure.defaults.items():
                    if new[slot] is UNSET:
                        new[slot] = default.run(new)
                procedure.body.run(new)
            finally:
                thread.depth -= 1
            return new[0]

        def steps(frame: StackFrame) -> ScriptSteps:
            new = (yield from make(frame)) if make_frame.suspends else make(frame)
            thread = enter()
            try:
                for slot, default in procedure.defaults.items():
                    if new[slot] is UNSET:
                        run = default.run
                        new[slot] = (yield from run(new)) if default.suspends else run(new)
                run = procedure.body.run
                (yield from run(new)) if procedure.body.suspends else run(new)
            finally:
                thread.depth -= 1
            return new[0]

        suspends = procedure.suspends or make_frame.suspends
        return CompiledNode(steps if suspends else plain, suspends, make_frame.weight)

    def _make_frame(self, node: tree.CallExpression, callee: Scope) -> CompiledNode:
        """Compile the arguments of a call into a new frame of the callee."""
        assert callee.definition is not None
        bound = bind(callee.definition, node)
        slots = [callee.locals[name] for name in bound]
        arguments = [self.copied_expression(argument.value) for argument in bound.values()]
        template = self._procedures[id(callee)].template

        def new_frame(frame: StackFrame, found: list[Value]) -> StackFrame:
            new = template.copy()
            for slot, value in zip(slots, found, strict=True):
                new[slot] = value
            return new

        return sequence(arguments, new_frame)

    def _enter(self, node: tree.CallExpression) -> Callable[[], Thread]:
        """Return a function that adds a call to the depth of its thread, up to a limit."""
        runtime = self._runtime
        call_location = (node.line, node.column)

        def enter() -> Thread:
            thread = runtime.thread
            if thread.depth >= MAX_CALL_DEPTH:
                raise recursion_error(*call_location)
            thread.depth += 1
            thread.location = call_location
            return thread

        return enter

    def _call_builtin(self, node: tree.CallExpression, builtin: Builtin) -> CompiledNode:
        arguments = [self.copied_expression(argument.value) for argument in node.arguments]
        names = [argument.name for argument in node.arguments if argument.name is not None]
        split = len(arguments) - len(names)
        runtime, sized = self._runtime, values.SIZED
        call_location = (node.line, node.column)

        def finish(frame: StackFrame, found: list[Value]) -> Value:
            runtime.thread.location = call_location
            try:
                if names:
                    named = dict(zip(names, found[split:], strict=True))
                    value = builtin(*found[:split], **named)
                else:
                    value = builtin(*found)
            except Exception as error:
                raise _from_builtin(node, error) from error
            if type(value) in sized:
                runtime.pay_for(values.size_of(value), *call_location)
            return value

        call = sequence(arguments, finish)
        if inspect.isgeneratorfunction(builtin):
            return self._suspending(node, call)
        return call

    def _suspending(
        self, node: tree.CallExpression | tree.MethodCallExpression, call: CompiledNode
    ) -> CompiledNode:
        """Compile a call that may return a generator, which then runs cycle by cycle."""
        name = node.function if isinstance(node, tree.CallExpression) else node.method

        def steps(frame: StackFrame) -> ScriptSteps:
            result = (yield from call.run(frame)) if call.suspends else call.run(frame)
            if not inspect.isgenerator(result):
                return result
            try:
                return (yield from result)
            except Exception as error:
                raise _from_builtin(node, error, name) from error

        return CompiledNode(steps, True, call.weight)

    def _method_call(self, node: tree.MethodCallExpression) -> CompiledNode:
        parts = [self.expression(node.target)]
        parts += [self.copied_expression(argument.value) for argument in node.arguments]
        runtime = self._runtime
        call_location = (node.line, node.column)

        def finish(frame: StackFrame, found: list[Value]) -> Value:
            runtime.thread.location = call_location
            target, arguments = found[0], found[1:]
            try:
                if isinstance(target, values.RemoteObject):
                    return target.call(node.method, arguments)
                # Shifting the items of a list is quicker than copying them.
                runtime.pay_for(values.size_of(target) // 16, *call_location)
                return call_method(target, node.method, arguments)
            except Exception as error:
                raise _from_builtin(node, error, node.method) from error

        return self._suspending(node, sequence(parts, finish))

    def _run(self, node: tree.RunExpression) -> CompiledNode:
        callee = self._scope.function(node.thread)
        assert callee is not None
        procedure = self._procedures[id(callee)]
        runtime = self._runtime

        def run(frame: StackFrame) -> Value:
            try:
                return runtime.spawn(procedure)
            except RuntimeException as error:
                raise error.at(node.line, node.column) from None

        return CompiledNode(run)


def _unset(node: tree.NameExpression) -> RuntimeException:
    text = f'The variable {node.identifier!r} is read before a value is assigned to it.'
    return RuntimeException(text, node.line, node.column)


def _from_builtin(
    node: tree.CallExpression | tree.MethodCallExpression, error: Exception, name: str = ''
) -> RuntimeException | RecursionError:
    """Turn an error of a builtin, except RecursionError, into a runtime exception at its call."""
    if isinstance(error, RecursionError):
        return error
    if isinstance(error, RuntimeException):
        return error.at(node.line, node.column)
    name = node.function if isinstance(node, tree.CallExpression) else name
    text = f'{name}: {error}' if str(error) else f'{name}: {type(error).__name__}'
    return RuntimeException(text, node.line, node.column)


def _number(node: tree.Expression) -> int | float | None:
    """Return the value of a literal number, with its sign; None = the node is something else."""
    if isinstance(node, tree.UnaryExpression) and node.operator == '-':
        number = (
            _number(node.operand) if isinstance(node.operand, tree.ConstantExpression) else None
        )
        return None if number is None else -number
    if isinstance(node, tree.ConstantExpression) and values.is_number(node.value):
        return node.value
    return None
