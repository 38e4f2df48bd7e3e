# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Runs one program, a controller cycle (frame) at a time.

In each frame all live threads run, in the order in which they were started. Each thread runs until
it ends or takes time: in a builtin that yields, in `join`, or in `pause`. A new thread runs in the
same frame, after the threads that were started before it. Nothing else switches threads. A thread
that evaluates more nodes of the syntax tree in one frame than its budget allows ends the program
with an error.

The manual does not guarantee this order. For tests of programs that must not depend on it, two
settings change the order. With `thread_delay` a new thread begins some frames later. With
`interleaving` threads take turns at random: in a random order, between any two statements, and
before an assignment stores its value in a global variable, except in a critical section. A
critical section is not a lock; it only stops these switches. If a thread takes time in one, the
other threads run and can enter critical sections, too. A thread that is killed in one blocks no
other thread.

The program ends when its main thread ends, and all other threads end with it. When a thread ends
by itself, the threads that it started continue; when it is killed, they are killed, too.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterable, Iterator, Mapping
from dataclasses import dataclass
import inspect
from random import Random
import sys
from typing import Any, NoReturn

from ur_cartesian_driver.urscript.compiling.compiler import compile_program
from ur_cartesian_driver.urscript.compiling.generated_code import (
    builtin_name,
    GeneratedCode,
    global_name,
    place_of_call,
    place_of_steps,
    ProgramHalted,
    runtime_exception,
    ScriptSteps,
    SWITCH,
)
from ur_cartesian_driver.urscript.compiling.operations import operations
from ur_cartesian_driver.urscript.compiling.scopes import Builtin, resolve
from ur_cartesian_driver.urscript.parsing import syntax_tree as tree
from ur_cartesian_driver.urscript.running.line_compiler import LineCompiler
from ur_cartesian_driver.urscript.script_errors import CompileError, RuntimeException
from ur_cartesian_driver.urscript.script_values import ThreadHandle, Value

BUDGET_EXCEEDED = (
    'The program used too much time without instructing the robot what to do. '
    'Consider using a Wait or sync() in the loop.'
)
#: Largest number of threads of a program. The manual gives no limit; without one, threads that
#: start threads would soon use all time and memory.
MAX_THREADS = 256
#: Probability of a thread switch at each place where one is possible.
SWITCH_PROBABILITY = 0.1


#: Generated code of a function; its argument is the depth of the call.
ThreadFunction = Callable[[int], Any]


class _ThreadKilled(BaseException):
    """Raised in a thread that has killed itself or one of its ancestors, to end it."""


@dataclass(slots=True, eq=False)
class _Thread:
    """A thread of the program; number 0 is the main thread."""

    number: int
    steps: ScriptSteps
    parent: _Thread | None
    alive: bool = True
    in_critical_section: bool = False
    #: Frames until the thread begins.
    delay: int = 0
    #: Number of nodes of the syntax tree that the thread may still evaluate in this frame.
    fuel: int = 0
    #: Whether the thread took time in this frame.
    took_time: bool = False

    def descends_from(self, other: _Thread) -> bool:
        """Return whether the other thread is this one, or started it directly or indirectly."""
        thread: _Thread | None = self
        while thread is not None and thread is not other:
            thread = thread.parent
        return thread is other


class ScriptInterpreter:
    """
    Runs one program; the controller calls `step` once per frame.

    :param program: the syntax tree that `parse` returned.
    :param builtins: the functions that the program can call. A plain function takes no time. In a
        generator function each bare `yield` gives up the rest of the frame, and the return value
        is the value of the call. Arguments are passed by position and name as in Python.
    :param instruction_budget: nodes of the tree that a thread may evaluate in one frame.
    :param total_budget: nodes that all threads together may evaluate in the life of the program.
    :param thread_delay: frames after which a new thread begins.
    :param interleaving: the random numbers that decide when threads are switched; None = threads
        are switched only when one takes time.
    :param code: the `code` of an earlier interpreter of the same program and interleaving, whose
        builtins have the same names and signatures; None = compile the program.
    :raises CompileError: the program cannot run; nothing of it has run.
    """

    def __init__(
        self,
        program: tree.ScriptProgram,
        builtins: Mapping[str, Builtin],
        *,
        instruction_budget: int = 100_000,
        total_budget: int | None = None,
        thread_delay: int = 0,
        interleaving: Random | None = None,
        code: GeneratedCode | None = None,
    ) -> None:
        #: This function is called with the number of each thread that ends, for any reason.
        self.on_thread_end: Callable[[Hashable], None] | None = None
        #: Set by `pause`; a step does nothing until `resume`.
        self.paused = False
        #: The runtime exception that ended the program; None = no exception.
        self.error: RuntimeException | None = None
        #: Number of nodes that the running thread may still evaluate in this frame.
        self.fuel = 0
        self.interleaves = interleaving is not None
        self._random = interleaving
        self._thread_delay = thread_delay
        self._budget = instruction_budget
        #: The nodes left of the total budget; None = there is no total budget.
        self.fuel_left = total_budget
        self._is_secondary = program.kind == 'sec'
        self._current: _Thread | None = None
        self._halted = False
        if code is None:
            code = _compile(program, builtins, self.interleaves)
        #: The compiled program; it never changes.
        self.code = code
        #: The global variables, functions, constants and operations of the code, by name.
        self._names: dict[str, Any] = operations(self) | {
            builtin_name(name): function for name, function in builtins.items()
        }
        self._main = _Thread(0, self.begin(code), None)
        self._threads = [self._main]
        #: Number of threads started so far; the next one gets this number.
        self.threads_started = 1
        #: Compiles lines for the running program.
        self.lines = LineCompiler(code, builtins, self)

    @property
    def running(self) -> bool:
        """Whether the program has not ended yet; True even before its first step."""
        return bool(self._threads)

    @property
    def _running_thread(self) -> _Thread:
        assert self._current is not None
        return self._current

    @property
    def current_thread(self) -> Hashable:
        """The number of the running thread; None between steps."""
        return None if self._current is None else self._current.number

    @property
    def threads(self) -> int:
        """Number of living threads, including the main one."""
        return sum(thread.alive for thread in self._threads)

    @property
    def location(self) -> tuple[int, int]:
        """Line and column of the running call, for use in the called builtin."""
        return place_of_call(sys._getframe())

    @property
    def main_location(self) -> tuple[int, int]:
        """Line and column at which the main thread waits; 0, 0 = it does not."""
        return place_of_steps(self._main.steps)

    @property
    def variables(self) -> dict[str, Value]:
        """The global variables that have a value."""
        names = self._names
        return {
            name: names[global_name(name)]
            for name in sorted(self.code.scope.globals)
            if global_name(name) in names
        }

    def begin(self, code: GeneratedCode) -> ScriptSteps:
        """Add code of the program or of one of its ``lines``; return a generator that runs it."""
        for function in code.code:
            self._names |= function.constants
            for unit in function.units:
                exec(unit, self._names)
        return _steps(self._names.pop(code.main.name))

    def forget(self, variables: Iterable[str]) -> None:
        """Remove the global variables of these names."""
        self.drop(map(global_name, variables))

    def drop(self, constants: Iterable[str]) -> None:
        """Remove constants that no code uses any more."""
        for name in constants:
            self._names.pop(name, None)

    def step(self) -> None:
        """Run one frame: every live thread until it takes time or ends."""
        if self.paused:
            return
        for thread in self._threads:
            thread.fuel, thread.took_time = self._budget, False
            thread.delay -= 1
        for thread in self._runnable_threads():
            self._resume(thread)
            if self._halted:
                self.stop()
                return
        self._threads = [thread for thread in self._threads if thread.alive]

    def _runnable_threads(self) -> Iterator[_Thread]:
        """Yield the next thread to run, until all threads have taken time in this frame."""
        if self._random is None:
            for thread in self._threads:  # grows while threads are started
                if thread.alive and thread.delay <= 0:
                    yield thread
            return
        waiting: list[_Thread] = []
        known = 0
        while True:
            waiting += self._threads[known:]
            known = len(self._threads)
            waiting = [
                thread
                for thread in waiting
                if thread.alive and thread.delay <= 0 and not thread.took_time
            ]
            if not waiting:
                return
            yield self._random.choice(waiting)

    def resume(self) -> None:
        """Continue after `pause`."""
        self.paused = False

    def stop(self) -> None:
        """
        End the program at once; the generators of waiting builtins are closed.

        If a builtin calls this, the program ends as soon as the builtin yields or returns, because
        Python cannot close a generator while it runs.
        """
        if self._current is not None:
            self._halted = True
            return
        threads, self._threads = self._threads, []
        for thread in threads:
            if thread.alive:
                self._end(thread)

    def _resume(self, thread: _Thread) -> None:
        """Run one thread up to its next yield."""
        self.fuel = thread.fuel
        if self.fuel_left is not None:
            self.fuel = min(self.fuel, self.fuel_left)
        available = self.fuel
        self._current = thread
        ended = True
        try:
            thread.took_time = next(thread.steps) is not SWITCH
            ended = False
        except StopIteration:
            self._halted = self._halted or thread.parent is None
        except ProgramHalted:
            self._halted = True
        except _ThreadKilled:
            ended = thread.alive
        except Exception as error:  # of a builtin, too
            self.error, self._halted = runtime_exception(error), True
        finally:
            self._current = None
            thread.fuel -= available - self.fuel
            if self.fuel_left is not None:
                self.fuel_left -= available - self.fuel
        if ended:
            self._end(thread)

    def _end(self, thread: _Thread) -> None:
        """End a thread; it is the current thread while its builtins clean up."""
        thread.alive = False
        previous, self._current = self._current, thread
        try:
            thread.steps.close()
        except Exception as error:  # a builtin failed to clean up
            self.error = self.error or runtime_exception(error)
        finally:
            self._current = previous
        if self.on_thread_end is not None:
            self.on_thread_end(thread.number)

    # Called by compiled code

    @property
    def in_critical_section(self) -> bool:
        """Whether the running thread is in a critical section."""
        return self._running_thread.in_critical_section

    @in_critical_section.setter
    def in_critical_section(self, value: bool) -> None:
        self._running_thread.in_critical_section = value

    def exceed_budget(self) -> NoReturn:
        """Raise the error of a thread that used up its budget without yielding."""
        raise RuntimeException(BUDGET_EXCEEDED)

    def switches_now(self) -> bool:
        """Decide at random whether another thread runs before the next statement."""
        return (
            self._random is not None
            and not self.in_critical_section
            and self._random.random() < SWITCH_PROBABILITY
        )

    def spawn(self, function: ThreadFunction) -> ThreadHandle:
        """
        Start a thread; without a delay it can run in this frame.

        :raises RuntimeException: the program is secondary, or has too many threads.
        """
        if self._is_secondary:
            raise RuntimeException('A secondary program cannot start threads.')
        if len(self._threads) >= MAX_THREADS:
            raise RuntimeException(f'More than {MAX_THREADS} threads run at once.')
        thread = _Thread(
            self.threads_started,
            _steps(function),
            self._running_thread,
            delay=self._thread_delay,
            fuel=self._budget,
        )
        self.threads_started += 1
        self._threads.append(thread)
        return ThreadHandle(thread.number)

    def alive(self, handle: Value) -> bool:
        """Return whether a value is the handle of a live thread."""
        return self._find(handle) is not None

    def kill(self, handle: Value) -> None:
        """End a thread and all threads that it started; ignore values that are not handles."""
        target = self._find(handle)
        if target is None:
            return
        threads_to_kill = [thread for thread in self._threads if thread.descends_from(target)]
        for thread in threads_to_kill:
            if thread.alive and thread is not self._current:
                self._end(thread)
        if self._current in threads_to_kill:
            raise _ThreadKilled

    def kill_since(self, number: int) -> None:
        """End the current thread's children from ``number`` on, and their descendants."""
        for thread in tuple(self._threads):
            if thread.parent is self._current and thread.number >= number:
                self.kill(ThreadHandle(thread.number))

    def _find(self, handle: Value) -> _Thread | None:
        if type(handle) is not ThreadHandle:
            return None
        alive = (thread for thread in self._threads if thread.alive)
        return next((thread for thread in alive if thread.number == handle.number), None)


def _compile(
    program: tree.ScriptProgram, builtins: Mapping[str, Builtin], interleaves: bool
) -> GeneratedCode:
    try:
        return compile_program(resolve(program, builtins), builtins, {}, interleaves=interleaves)
    except RecursionError:
        text = f'syntax_error_on_line:{program.line}:{program.name}:'
        reason = 'the program is nested too deeply'
        raise CompileError(program.line, program.column, text, reason) from None


def _steps(function: ThreadFunction) -> ScriptSteps:
    """Return a generator that runs a thread, even if its function is a plain function."""
    if inspect.isgeneratorfunction(function):
        steps: ScriptSteps = function(0)
        return steps
    return _only_step(function)


def _only_step(function: ThreadFunction) -> ScriptSteps:
    function(0)
    return
    yield
