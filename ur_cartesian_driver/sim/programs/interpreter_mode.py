# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Interpreter mode: a program executes the statements that clients send, in order.

A statement is compiled and numbered when it arrives, answered with `ack: <number>: <statement>` or
`discard: <reason>: <statement>`, and executed after the previous statements. While no program is
in interpreter mode, statements wait without an answer. After a call of clear_interpreter or
end_interpreter, the next statements also wait until the call has taken effect, because they could
name a variable that is about to be deleted. The interface's own commands (`abort`, `skipbuffer`,
`state...`) are executed at once, before waiting statements.

Assumed, because not documented: statements that arrive while no program runs at all are discarded,
and `abort` and `skipbuffer` are always acknowledged with the number of the last statement.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Mapping

from ur_cartesian_driver.sim.motion.motion_ownership import MotionOwnership, Steps
from ur_cartesian_driver.sim.programs.program_runner import ProgramRunner
from ur_cartesian_driver.urscript import (
    CompiledLine,
    CompileError,
    RuntimeException,
    ScriptInterpreter,
)

#: Bound on statements that wait to be compiled or executed; a robot accepts about as many.
MAX_QUEUED_STATEMENTS = 500
#: Barrier functions: a line that calls one of them in an outermost statement is executed before
#: the next line is compiled.
_BARRIERS = frozenset({'clear_interpreter', 'end_interpreter'})

AnswerCallback = Callable[[str], None]


class InterpreterMode:
    """The statements of all clients, and their compilation and execution."""

    def __init__(self, programs: ProgramRunner, ownership: MotionOwnership) -> None:
        """
        Begin with no statements.

        :param programs: the runner whose interpreter compiles and runs the statements.
        :param ownership: the ownership of the motion; `abort` stops the motion.
        """
        self._programs = programs
        self._ownership = ownership
        self._commands: Mapping[str, Callable[[], str]] = {
            'abort': self._abort,
            'skipbuffer': self._skip,
            'statelastexecuted': lambda: f'state: {self._executed}',
            'statelastinterpreted': lambda: f'state: {self._interpreted}',
            'statelastcleared': lambda: f'state: {self._cleared}',
            'stateunexecuted': lambda: f'state: {len(self._queue)}',
        }
        self._queue: deque[tuple[int, CompiledLine]] = deque()
        self._uncompiled: deque[tuple[str, AnswerCallback]] = deque()
        self.end_of_program()

    def end_of_program(self) -> None:
        """Discard all statements, and number the next ones from 1 again."""
        self._interpreter: ScriptInterpreter | None = None
        self._interpreted = self._executed = self._cleared = 0
        self._closing = self._clear_wanted = self._end_wanted = False
        #: Whether the statement that is being executed clears or ends interpreter mode.
        self._is_running_barrier = False
        self._queue.clear()
        self._discard_waiting('the program has ended')

    # Called for clients

    def receive(self, statement: str, answer: AnswerCallback) -> None:
        """
        Execute a command, or queue a line of statements.

        :param answer: called with the answer, now or when the line is compiled.
        """
        command = self._commands.get(statement.strip())
        if command is not None:
            answer(f'{command()}: {statement.strip()}')
        elif not self._programs.running:
            answer(f'discard: no program is running: {statement}')
        elif len(self._queue) + len(self._uncompiled) >= MAX_QUEUED_STATEMENTS:
            answer(
                f'discard: more than {MAX_QUEUED_STATEMENTS} statements are waiting: {statement}'
            )
        elif statement.strip():
            self._uncompiled.append((statement, answer))
            self._compile_waiting()

    def _abort(self) -> str:
        self._ownership.abort()
        return f'ack: {self._interpreted}'

    def _skip(self) -> str:
        self._queue.clear()
        self._closing = self._is_running_barrier
        self._compile_waiting()
        return f'ack: {self._interpreted}'

    def _compile_waiting(self) -> None:
        """Compile and answer waiting statements, up to the first that calls a barrier function."""
        while self._interpreter is not None and self._uncompiled and not self._closing:
            statement, answer = self._uncompiled.popleft()
            try:
                line = self._interpreter.lines.compile(statement)
            except CompileError as error:
                answer(f'discard: {error.text.rstrip(":")}: {statement}')
                continue
            self._interpreted += 1
            self._queue.append((self._interpreted, line))
            self._closing = bool(line.calls & _BARRIERS)
            answer(f'ack: {self._interpreted}: {statement}')

    def _discard_waiting(self, reason: str) -> None:
        while self._uncompiled:
            statement, answer = self._uncompiled.popleft()
            answer(f'discard: {reason}: {statement}')

    # Called for programs

    def run(self, clear_queue: bool, clear_on_end: bool) -> Steps:
        """
        Execute statements until a statement, or another thread, calls `end_interpreter`.

        :param clear_queue: whether to discard the statements that have been waiting.
        :param clear_on_end: whether to delete the statements' definitions at the end.
        :raises RuntimeException: the call is not in the main thread, or is in interpreter mode.
        """
        interpreter = self._programs.interpreter
        if interpreter is None or interpreter.current_thread != 0 or self._interpreter is not None:
            raise RuntimeException(
                'interpreter_mode is only possible in the main thread, and not from within itself.'
            )
        if clear_queue:
            self._discard_waiting('the queue was cleared')
        self._interpreter = interpreter
        self._end_wanted = self._clear_wanted = self._closing = False
        first_thread = interpreter.threads_started
        self._compile_waiting()
        while not self._end_wanted:
            if self._queue:
                self._executed, line = self._queue.popleft()
                self._is_running_barrier = bool(line.calls & _BARRIERS)
                yield from line.steps
                self._is_running_barrier = False
            else:
                yield
            if self._clear_wanted:
                self._forget(interpreter, first_thread)
        self._queue.clear()
        if clear_on_end:
            self._forget(interpreter, first_thread)
        self._interpreter = None

    def end(self) -> None:
        """End interpreter mode when the current statement has ended."""
        self._end_wanted = True

    def clear(self) -> None:
        """Delete the definitions of all statements when the current statement has ended."""
        self._clear_wanted = True

    def _forget(self, interpreter: ScriptInterpreter, first_thread: int) -> None:
        """Delete the definitions of all statements, and end the threads that they have started."""
        interpreter.kill_since(first_thread)
        interpreter.lines.forget()
        self._queue.clear()
        self._cleared = self._interpreted
        self._closing = self._clear_wanted = False
        if not self._end_wanted:
            self._compile_waiting()
