# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Syntax tree to Python closures, made once per program so that a frame costs little.

The code of an expression or statement is a function of the frame (the list of a function's local
values). What cannot take time is a plain function; what can (a generator builtin, `join`, a call
of a function that contains one) is a generator function, and only this is reached by
`yield from`. The code of a statement returns None to go on, or one of the signals below.

Work is counted in nodes of the tree, a block at a time: entering a block pays for all of it.
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
import inspect
from typing import Any, NoReturn, Protocol

from ur_cartesian_driver.urscript import syntax as tree
from ur_cartesian_driver.urscript import values
from ur_cartesian_driver.urscript.errors import RuntimeException
from ur_cartesian_driver.urscript.scopes import bind, Builtin, FIRST_LOCAL, Scope
from ur_cartesian_driver.urscript.values import Value

#: Calls of the program's functions inside one another.
MAX_CALL_DEPTH = 100

Frame = list[Any]
Steps = Generator[None, None, Value]
Run = Callable[[Frame], Any]

# What a statement says about how to go on.
BREAK = 'break'
CONTINUE = 'continue'
RETURN = 'return'


class _Unset:
    """The value of a variable before its first assignment."""


UNSET = _Unset()


class ProgramHalted(BaseException):
    """Unwinds the running thread because the whole program ends; not an error."""


class Thread(Protocol):
    """What compiled code needs of the thread that runs it."""

    depth: int
    location: tuple[int, int]


class Runtime(Protocol):
    """What compiled code needs of the machine that runs it."""

    fuel: int
    paused: bool
    globals: list[Any]

    @property
    def thread(self) -> Thread:
        """The thread that is running now."""

    def exhausted(self, line: int, column: int) -> NoReturn:
        """Raise, because the thread used up its frame without yielding."""

    def spawn(self, procedure: Procedure) -> values.ThreadHandle:
        """Start a thread."""

    def alive(self, handle: Value) -> bool:
        """Tell whether a value is the handle of a thread that has not ended."""

    def kill(self, handle: Value) -> None:
        """End a thread, if the value is the handle of one."""


@dataclass(frozen=True, slots=True)
class Code:
    """A compiled node: how to run it, whether that can take time, and what it costs."""

    run: Run
    suspends: bool = False
    weight: int = 1


@dataclass(slots=True, kw_only=True)
class Procedure:
    """A compiled function or thread; filled after all have been made, as they call each other."""

    name: str
    suspends: bool
    template: Frame
    defaults: dict[int, Code] = field(default_factory=dict)
    body: Code = Code(lambda frame: None)

    def steps(self) -> Steps:
        """Run as the whole of a thread."""
        frame = self.template.copy()
        if self.body.suspends:
            yield from self.body.run(frame)
        else:
            self.body.run(frame)
        return None


def compile_program(root: Scope, builtins: Mapping[str, Builtin], runtime: Runtime) -> Procedure:
    """Compile a checked program; the result is the body of its main thread."""
    compilers = {id(scope): _Compiler(scope, builtins, runtime) for scope in root.walk()}
    procedures = {key: compiler.procedure for key, compiler in compilers.items()}
    for compiler in compilers.values():
        compiler.fill(procedures)
    return procedures[id(root)]


def sequence(parts: Sequence[Code], finish: Callable[[Frame, list[Value]], Value]) -> Code:
    """Evaluate parts from left to right, then combine their values."""
    runs = [part.run for part in parts]

    def plain(frame: Frame) -> Value:
        return finish(frame, [run(frame) for run in runs])

    def plain_one(frame: Frame) -> Value:
        return finish(frame, [first(frame)])

    def plain_two(frame: Frame) -> Value:
        return finish(frame, [first(frame), second(frame)])

    def steps(frame: Frame) -> Steps:
        found = []
        for part in parts:
            value = (yield from part.run(frame)) if part.suspends else part.run(frame)
            found.append(value)
        return finish(frame, found)

    first, second = (*runs, plain, plain)[:2]
    chosen = {1: plain_one, 2: plain_two}.get(len(runs), plain)
    return _either(chosen, steps, parts)


def _either(plain: Run, steps: Run, parts: Sequence[Code]) -> Code:
    """Choose the generator if one of the parts is one."""
    suspends = any(part.suspends for part in parts)
    return Code(steps if suspends else plain, suspends, 1 + sum(part.weight for part in parts))


def _is_fresh(node: tree.Expression) -> bool:
    """Tell whether the value of an expression is stored nowhere else and needs no copy."""
    return not isinstance(node, tree.Name | tree.Index | tree.Field | tree.Unary | tree.MethodCall)


class _Compiler:
    """Compiles the body of one function."""

    def __init__(self, scope: Scope, builtins: Mapping[str, Builtin], runtime: Runtime) -> None:
        self._scope = scope
        self._builtins = builtins
        self._runtime = runtime
        self._procedures: Mapping[int, Procedure] = {}
        self.procedure = Procedure(
            name=scope.definition.name if scope.definition else '',
            suspends=scope.suspends,
            template=[None] + [UNSET] * len(scope.locals),
        )

    def fill(self, procedures: Mapping[int, Procedure]) -> None:
        """Compile the body, now that every function can be referred to."""
        self._procedures = procedures
        self.procedure.body = self._block(self._scope.body, self._scope.owner)
        parameters = self._scope.definition.parameters if self._scope.definition else ()
        for slot, parameter in enumerate(parameters, FIRST_LOCAL):
            if parameter.default is not None:
                self.procedure.defaults[slot] = self._owned(parameter.default)

    # Expressions

    def _expression(self, node: tree.Expression) -> Code:
        match node:
            case tree.Constant():
                return self._constant(node.value)
            case tree.Name():
                return self._name(node)
            case tree.Unary():
                return self._unary(node)
            case tree.Binary():
                return self._binary(node)
            case tree.Logical():
                return self._logical(node)
            case tree.ListLiteral() | tree.PoseLiteral():
                make = values.make_list if isinstance(node, tree.ListLiteral) else values.make_pose
                items = [self._expression(item) for item in node.items]
                return self._positioned(node, items, lambda frame, found: make(found))
            case tree.Index():
                return self._index(node)
            case tree.Field():
                key = node.name
                target = [self._expression(node.target)]
                return self._positioned(
                    node, target, lambda frame, found: values.get_part(found[0], key)
                )
            case tree.Call():
                return self._call(node)
            case tree.MethodCall():
                return self._method_call(node)
            case tree.Run():
                return self._run(node)
        raise AssertionError(node)

    def _owned(self, node: tree.Expression) -> Code:
        """Compile an expression whose value is about to be stored or handed over."""
        code = self._expression(node)
        if _is_fresh(node):
            return code
        run = code.run
        mutable = (list, values.Matrix, values.Struct)

        def plain(frame: Frame) -> Value:
            value = run(frame)
            return values.copy(value) if type(value) in mutable else value

        def steps(frame: Frame) -> Steps:
            return values.copy((yield from run(frame)))

        return Code(steps if code.suspends else plain, code.suspends, code.weight)

    @staticmethod
    def _positioned(
        node: tree.Node, parts: Sequence[Code], finish: Callable[[Frame, list[Value]], Value]
    ) -> Code:
        """Evaluate parts in sequence; what goes wrong in `finish` went wrong at this node."""

        def positioned(frame: Frame, found: list[Value]) -> Value:
            try:
                return finish(frame, found)
            except RuntimeException as error:
                raise error.at(node.line, node.column) from None

        return sequence(parts, positioned)

    @staticmethod
    def _constant(value: Value) -> Code:
        return Code(lambda frame: value)

    def _name(self, node: tree.Name) -> Code:
        name = node.identifier
        slot, is_local = self._slot(name)
        shared = self._runtime.globals

        def read_local(frame: Frame) -> Value:
            value = frame[slot]
            if value is UNSET:
                raise _unset(node)
            return value

        def read_global(frame: Frame) -> Value:
            value = shared[slot]
            if value is UNSET:
                raise _unset(node)
            return value

        return Code(read_local if is_local else read_global)

    def _slot(self, name: str, qualifier: str = '') -> tuple[int, bool]:
        """Return the slot of a variable and whether it is in the frame."""
        if name in self._scope.locals and qualifier != 'global':
            return self._scope.locals[name], True
        return self._scope.globals[name], False

    def _unary(self, node: tree.Unary) -> Code:
        operate = values.UNARY[node.operator]
        operand = self._expression(node.operand)
        return self._positioned(node, [operand], lambda frame, found: operate(found[0]))

    def _binary(self, node: tree.Binary) -> Code:
        operate = values.BINARY[node.operator]
        left, right = self._expression(node.left), self._expression(node.right)
        run_left, run_right = left.run, right.run
        if left.suspends or right.suspends:
            return self._positioned(node, [left, right], lambda frame, found: operate(*found))

        on_floats = values.ON_FLOATS.get(node.operator, operate)

        def run(frame: Frame) -> Value:
            a, b = run_left(frame), run_right(frame)
            try:
                if type(a) is float and type(b) is float:
                    return on_floats(a, b)
                return operate(a, b)
            except RuntimeException as error:
                raise error.at(node.line, node.column) from None

        return Code(run, False, 1 + left.weight + right.weight)

    def _logical(self, node: tree.Logical) -> Code:
        left, right = self._expression(node.left), self._expression(node.right)
        truth = values.truth
        if node.operator == 'xor':
            return sequence([left, right], lambda frame, both: truth(both[0]) != truth(both[1]))
        decisive = node.operator == 'or'
        run_left, run_right = left.run, right.run

        def plain(frame: Frame) -> bool:
            return decisive if truth(run_left(frame)) is decisive else truth(run_right(frame))

        def steps(frame: Frame) -> Steps:
            value = (yield from run_left(frame)) if left.suspends else run_left(frame)
            if truth(value) is decisive:
                return decisive
            return truth((yield from run_right(frame)) if right.suspends else run_right(frame))

        return _either(plain, steps, [left, right])

    def _index(self, node: tree.Index) -> Code:
        parts = [self._expression(node.target), *map(self._expression, node.indices)]
        if len(parts) == 2 and not any(part.suspends for part in parts):
            return self._item(node, *parts)
        return self._positioned(
            node, parts, lambda frame, found: values.get_part(found[0], tuple(found[1:]))
        )

    @staticmethod
    def _item(node: tree.Index, target: Code, index: Code) -> Code:
        """Compile the common `list[int]`, quick where nothing is wrong."""
        run_target, run_index = target.run, index.run

        def run(frame: Frame) -> Value:
            container, place = run_target(frame), run_index(frame)
            if type(container) is list and type(place) is int and 0 <= place < len(container):
                return container[place]
            try:
                return values.get_part(container, (place,))
            except RuntimeException as error:
                raise error.at(node.line, node.column) from None

        return Code(run, False, 1 + target.weight + index.weight)

    # Calls

    def _call(self, node: tree.Call) -> Code:
        callee = self._scope.function(node.function)
        if callee is not None:
            return self._call_function(node, callee)
        return self._call_builtin(node, self._builtins[node.function])

    def _call_function(self, node: tree.Call, callee: Scope) -> Code:
        """Bind arguments to slots of a new frame and run the body in it."""
        assert callee.definition is not None
        bound = bind(callee.definition, node)
        slots = [callee.locals[name] for name in bound]
        arguments = [self._owned(argument.value) for argument in bound.values()]
        procedure = self._procedures[id(callee)]
        runtime = self._runtime
        here = (node.line, node.column)

        def new_frame(frame: Frame, found: list[Value]) -> Frame:
            new = procedure.template.copy()
            for slot, value in zip(slots, found, strict=True):
                new[slot] = value
            return new

        make_frame = sequence(arguments, new_frame)
        make = make_frame.run

        def enter() -> Thread:
            thread = runtime.thread
            if thread.depth >= MAX_CALL_DEPTH:
                raise too_deep(*here)
            thread.depth += 1
            thread.location = here
            return thread

        def plain(frame: Frame) -> Value:
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

        def steps(frame: Frame) -> Steps:
            new = (yield from make(frame)) if make_frame.suspends else make(frame)
            thread = enter()
            try:
                for slot, default in procedure.defaults.items():
                    if new[slot] is UNSET:
                        run = default.run
                        new[slot] = (yield from run(new)) if default.suspends else run(new)
                if procedure.body.suspends:
                    yield from procedure.body.run(new)
                else:
                    procedure.body.run(new)
            finally:
                thread.depth -= 1
            return new[0]

        suspends = procedure.suspends or make_frame.suspends
        return Code(steps if suspends else plain, suspends, make_frame.weight)

    def _call_builtin(self, node: tree.Call, builtin: Builtin) -> Code:
        arguments = [self._owned(argument.value) for argument in node.arguments]
        names = [argument.name for argument in node.arguments if argument.name is not None]
        split = len(arguments) - len(names)
        runtime = self._runtime
        here = (node.line, node.column)

        def finish(frame: Frame, found: list[Value]) -> Value:
            runtime.thread.location = here
            try:
                if names:
                    return builtin(*found[:split], **dict(zip(names, found[split:], strict=True)))
                return builtin(*found)
            except Exception as error:
                raise _from_builtin(node, error) from error

        call = sequence(arguments, finish)
        if inspect.isgeneratorfunction(builtin):
            return self._suspending(node, call)
        return call

    def _suspending(self, node: tree.Call | tree.MethodCall, call: Code) -> Code:
        """Run the generator that a call returns, if it is one, frame by frame."""
        name = node.function if isinstance(node, tree.Call) else node.method

        def steps(frame: Frame) -> Steps:
            result = (yield from call.run(frame)) if call.suspends else call.run(frame)
            if not inspect.isgenerator(result):
                return result
            try:
                return (yield from result)
            except Exception as error:
                raise _from_builtin(node, error, name) from error

        return Code(steps, True, call.weight)

    def _method_call(self, node: tree.MethodCall) -> Code:
        parts = [self._expression(node.target)]
        parts += [self._owned(argument.value) for argument in node.arguments]
        runtime = self._runtime
        here = (node.line, node.column)

        def finish(frame: Frame, found: list[Value]) -> Value:
            runtime.thread.location = here
            if not isinstance(found[0], values.RemoteObject):
                kind = values.type_name(found[0])
                raise RuntimeException(f'Type error: {kind} has no method {node.method!r}', *here)
            try:
                return found[0].call(node.method, found[1:])
            except Exception as error:
                raise _from_builtin(node, error, node.method) from error

        return self._suspending(node, sequence(parts, finish))

    def _run(self, node: tree.Run) -> Code:
        callee = self._scope.function(node.thread)
        assert callee is not None
        procedure = self._procedures[id(callee)]
        runtime = self._runtime

        def run(frame: Frame) -> Value:
            try:
                return runtime.spawn(procedure)
            except RuntimeException as error:
                raise error.at(node.line, node.column) from None

        return Code(run)

    # Statements

    def _block(self, statements: tree.Block, owner: tree.Node) -> Code:
        """Compile statements that run one after the other, and pay for them at the beginning."""
        first = statements[0] if statements else owner
        here = (first.line, first.column)
        codes = [code for statement in statements for code in self._statement(statement)]
        weight = 1 + sum(code.weight for code in codes)
        runs = [code.run for code in codes]
        pairs = [(code.run, code.suspends) for code in codes]
        runtime = self._runtime

        def plain(frame: Frame) -> str | None:
            runtime.fuel -= weight
            if runtime.fuel < 0:
                runtime.exhausted(*here)
            for run in runs:
                signal: str | None = run(frame)
                if signal is not None:
                    return signal
            return None

        def steps(frame: Frame) -> Steps:
            runtime.fuel -= weight
            if runtime.fuel < 0:
                runtime.exhausted(*here)
            for run, suspends in pairs:
                signal = (yield from run(frame)) if suspends else run(frame)
                if signal is not None:
                    return signal
            return None

        suspends = any(code.suspends for code in codes)
        return Code(steps if suspends else plain, suspends, 0)

    def _statement(self, node: tree.Statement) -> Iterator[Code]:
        """Yield the code of a statement; labels and definitions have none."""
        match node:
            case tree.Assign():
                yield self._assign(node)
            case tree.CallStatement():
                yield self._call_statement(node)
            case tree.If():
                yield self._if(node)
            case tree.Switch():
                yield self._switch(node)
            case tree.While():
                yield self._while(node)
            case tree.Break():
                yield Code(lambda frame: BREAK)
            case tree.Continue():
                yield Code(lambda frame: CONTINUE)
            case tree.Return():
                yield self._return(node)
            case tree.Halt():
                yield Code(_halt)
            case tree.Pause():
                yield self._pause()
            case tree.Join():
                yield self._join(node)
            case tree.Kill():
                kill = self._runtime.kill
                yield sequence([self._expression(node.handle)], lambda frame, found: kill(*found))
            case tree.Critical() | tree.Label() | tree.Function():
                # Threads switch only where one takes time, so nothing can come between the
                # statements of a critical section, and a thread that takes time inside one lets
                # the others run, as on the robot.
                return

    def _call_statement(self, node: tree.CallStatement) -> Code:
        call = self._expression(node.call)
        run = call.run

        def plain(frame: Frame) -> None:
            run(frame)

        def steps(frame: Frame) -> Steps:
            yield from run(frame)
            return None

        return _either(plain, steps, [call])

    def _assign(self, node: tree.Assign) -> Code:
        if not isinstance(node.target, tree.Name):
            return self._assign_part(node)
        slot, is_local = self._slot(node.target.identifier, node.qualifier)
        value = self._owned(node.value)
        run, shared = value.run, self._runtime.globals

        def plain_local(frame: Frame) -> None:
            frame[slot] = run(frame)

        def plain_global(frame: Frame) -> None:
            shared[slot] = run(frame)

        def steps(frame: Frame) -> Steps:
            found = yield from run(frame)
            (frame if is_local else shared)[slot] = found
            return None

        return _either(plain_local if is_local else plain_global, steps, [value])

    def _assign_part(self, node: tree.Assign) -> Code:
        """Compile an assignment to a place inside a variable, as in `a.b[i] = value`."""
        base, keys, indices = self._path(node.target)
        read = self._name(base).run
        slot, is_local = self._slot(base.identifier)
        shared = self._runtime.globals

        def finish(frame: Frame, found: list[Value]) -> None:
            rest = iter(found[1:])
            path = [
                key if isinstance(key, str) else tuple(next(rest) for _ in range(key))
                for key in keys
            ]
            container = values.set_part(read(frame), path, found[0])
            (frame if is_local else shared)[slot] = container

        return self._positioned(node, [self._owned(node.value), *indices], finish)

    def _path(
        self, target: tree.Expression
    ) -> tuple[tree.Name, list[str | int], list[Code]]:
        """Return the variable, the field names and numbers of indices, and the indices' code."""
        if isinstance(target, tree.Field):
            base, keys, indices = self._path(target.target)
            return base, [*keys, target.name], indices
        if isinstance(target, tree.Index):
            base, keys, indices = self._path(target.target)
            own = [self._expression(index) for index in target.indices]
            return base, [*keys, len(own)], indices + own
        assert isinstance(target, tree.Name)
        return target, [], []

    def _if(self, node: tree.If) -> Code:
        truth = values.truth
        conditions = [self._expression(branch.condition) for branch in node.branches]
        bodies = [self._block(branch.body, branch) for branch in node.branches]
        otherwise = self._block(node.otherwise, node)
        pairs = list(zip(conditions, bodies, strict=True))
        runs = [(condition.run, body.run) for condition, body in pairs]
        run_otherwise = otherwise.run

        def plain(frame: Frame) -> Any:
            for condition, body in runs:
                value = condition(frame)
                if value is True or (value is not False and truth(value)):
                    return body(frame)
            return run_otherwise(frame)

        def steps(frame: Frame) -> Steps:
            for condition, body in pairs:
                run = condition.run
                if truth((yield from run(frame)) if condition.suspends else run(frame)):
                    return (yield from body.run(frame)) if body.suspends else body.run(frame)
            run = run_otherwise
            return (yield from run(frame)) if otherwise.suspends else run(frame)

        return _either(plain, steps, [*conditions, *bodies, otherwise])

    def _switch(self, node: tree.Switch) -> Code:
        subject = self._expression(node.subject)
        cases = [
            (self._expression(case.condition), self._block(case.body, case)) for case in node.cases
        ]
        otherwise = self._block(node.otherwise, node)
        parts = [subject, otherwise, *(code for case in cases for code in case)]

        def steps(frame: Frame) -> Steps:
            wanted = (yield from subject.run(frame)) if subject.suspends else subject.run(frame)
            for value, body in cases:
                run = value.run
                found = (yield from run(frame)) if value.suspends else run(frame)
                if wanted == found:
                    return (yield from body.run(frame)) if body.suspends else body.run(frame)
            run = otherwise.run
            return (yield from run(frame)) if otherwise.suspends else run(frame)

        return _either(lambda frame: _finish(steps(frame)), steps, parts)

    def _while(self, node: tree.While) -> Code:
        truth, runtime = values.truth, self._runtime
        condition = self._expression(node.condition)
        body = self._block(node.body, node)
        run_condition, run_body, weight = condition.run, body.run, condition.weight

        def plain(frame: Frame) -> str | None:
            while truth(run_condition(frame)):
                runtime.fuel -= weight
                signal: str | None = run_body(frame)
                if signal is BREAK:
                    break
                if signal is RETURN:
                    return signal
            return None

        def steps(frame: Frame) -> Steps:
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

        return _either(plain, steps, [condition, body])

    def _return(self, node: tree.Return) -> Code:
        value = self._constant(None) if node.value is None else self._owned(node.value)

        def finish(frame: Frame, found: list[Value]) -> str:
            frame[0] = found[0]
            return RETURN

        return sequence([value], finish)

    def _pause(self) -> Code:
        runtime = self._runtime

        def steps(frame: Frame) -> Steps:
            runtime.paused = True
            yield

        return Code(steps, True)

    def _join(self, node: tree.Join) -> Code:
        handle = self._expression(node.handle)
        alive = self._runtime.alive

        def steps(frame: Frame) -> Steps:
            run = handle.run
            thread = (yield from run(frame)) if handle.suspends else run(frame)
            while alive(thread):
                yield

        return Code(steps, True, 1 + handle.weight)


def _halt(frame: Frame) -> NoReturn:
    raise ProgramHalted


def _finish(steps: Steps) -> Value:
    """Run steps that cannot take time."""
    try:
        next(steps)
    except StopIteration as end:
        return end.value
    raise AssertionError('code that takes time where none was expected')


def _unset(node: tree.Name) -> RuntimeException:
    text = f'The variable {node.identifier!r} is read before a value is assigned to it.'
    return RuntimeException(text, node.line, node.column)


def too_deep(line: int, column: int) -> RuntimeException:
    """Return the error for a recursion without an end."""
    return RuntimeException('Function calls are nested too deeply.', line, column)


def _from_builtin(
    node: tree.Call | tree.MethodCall, error: Exception, name: str = ''
) -> RuntimeException | RecursionError:
    """Turn whatever a builtin raised into a runtime exception at its call."""
    if isinstance(error, RecursionError):
        return error
    if isinstance(error, RuntimeException):
        return error.at(node.line, node.column)
    name = node.function if isinstance(node, tree.Call) else name
    text = f'{name}: {error}' if str(error) else f'{name}: {type(error).__name__}'
    return RuntimeException(text, node.line, node.column)
