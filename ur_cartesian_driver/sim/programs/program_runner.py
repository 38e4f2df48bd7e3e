# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Programs from start to end: one primary program, and secondary programs in parallel with it.

::

    STOPPED --start--> PLAYING --pause--> PAUSING --arm stands--> PAUSED
                       ^                                            |
                       +------------- RESUMING <-------play---------+
    any of these --end, halt, exception, stop, new program--> STOPPING --arm stands--> STOPPED

If a program is stopped while the arm moves, the controller stops the arm on its path; the next
program starts when the arm stands still. A program that does not compile is refused with line and
column of the error, and the running program continues.

A *frame* is the part of a program that runs in one cycle of the controller.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable
from dataclasses import replace
from functools import lru_cache
import logging
from random import Random
from typing import NamedTuple, Protocol, TypeAlias, TypeVar

from ur_cartesian_driver.motion.state.rtde_state import RuntimeState
from ur_cartesian_driver.sim.programs.timed_function_guard import Builtins, refuse_timed_functions
from ur_cartesian_driver.sim.state.controller_messages import ControllerMessages
from ur_cartesian_driver.urscript import (
    CompileError,
    parse,
    parse_line,
    RuntimeException,
    ScriptInterpreter,
    ScriptProgram,
)
from ur_cartesian_driver.urscript.compiling.generated_code import GeneratedCode

_log = logging.getLogger(__name__)

T = TypeVar('T')
#: Generates the URScript of a program; calls its argument with the text, at once or later.
GenerateScript: TypeAlias = Callable[[Callable[[str], None]], None]


@lru_cache(maxsize=8)  # clients send the same program again and again; syntax trees are immutable
def _parse_cached(text: str, is_line: bool = False) -> ScriptProgram:
    """Parse a program, or a line of statements, which is a program without a name."""
    return replace(parse_line(text), name='unnamed') if is_line else parse(text)


#: Cache of compiled programs, for all controllers of this process. A key contains the `id()` of
#: its program; the value contains the program, so that no other program can get this id.
_compiled: dict[Hashable, tuple[ScriptProgram, GeneratedCode]] = {}
#: The cache is emptied before it would hold more programs than this.
MAX_COMPILED = 8

#: States in which a program is paused; in which it is paused, or resumes while the arm still
#: stands; and in which it has not ended.
PAUSED = frozenset({RuntimeState.PAUSING, RuntimeState.PAUSED})
HELD = PAUSED | {RuntimeState.RESUMING}
RUNNING = HELD | {RuntimeState.PLAYING}


class CompiledProgram(NamedTuple):
    """A program, and the interpreter that can run it."""

    program: ScriptProgram
    interpreter: ScriptInterpreter


class CompileAside(Protocol):
    """A function that does work and passes the result on, at once or later."""

    def __call__(self, work: Callable[[], T], then: Callable[[T], None]) -> None:
        """Do the work, and call ``then`` with its result."""


def compile_at_once(work: Callable[[], T], then: Callable[[T], None]) -> None:
    """Do the work at once; the controller's cycles wait for it."""
    then(work())


class ProgramArm(Protocol):
    """The arm, as the program runner sees it."""

    @property
    def at_rest(self) -> bool:
        """Whether the arm stands still, because no motion runs or because of a pause."""

    @property
    def on_path(self) -> bool:
        """Whether a path move is running or slowing down, rather than a stream of set-points."""

    def brake(self) -> None:
        """Stop the arm because the program has ended."""

    def run_preamble(self) -> None:
        """Apply the installation's settings, which precede a program started on the pendant."""

    def begin_program(self) -> None:
        """Make the first path move of a program start slowly."""

    def end_modes(self) -> None:
        """End the modes that a program has switched on, such as force mode and freedrive."""

    def end_of_frame(self) -> None:
        """Brake if a thread was killed in a motion that no other thread continues."""

    def release(self, thread: Hashable) -> None:
        """Release the motion that a thread commands, because the thread has ended."""

    def start_refusal(self) -> str:
        """Return the reason why no program can run now; empty = a program can run."""


class ProgramRunner:
    """The primary program, its state, and the secondary programs of this cycle."""

    def __init__(
        self,
        builtins: Builtins,
        messages: ControllerMessages,
        arm: ProgramArm,
        *,
        thread_delay: int = 0,
        interleaving_seed: int | None = None,
    ) -> None:
        """
        Begin with no program.

        :param thread_delay: number of cycles after which a new thread of a program begins.
        :param interleaving_seed: seed of the random switches between threads; None = no switches.
        """
        self._thread_delay = thread_delay
        self._interleaving = None if interleaving_seed is None else Random(interleaving_seed)
        self._builtins = builtins
        self._secondary_builtins = refuse_timed_functions(builtins)
        self._messages = messages
        self._arm = arm
        self._interpreter: ScriptInterpreter | None = None
        #: The interpreter that is running a frame at this moment.
        self._stepping: ScriptInterpreter | None = None
        #: Name and interpreter of the program that starts once the arm stands still.
        self._queued: tuple[str, ScriptInterpreter] | None = None
        self._secondaries: list[ScriptInterpreter] = []
        self._loaded: ScriptProgram | GenerateScript | None = None
        #: Identifies the start that waits until its program is generated; None = none waits.
        self._awaited: object | None = None
        #: The reason why the last `play` has not started a program; empty = it has.
        self.start_failure = ''
        #: Identifies the builtins in keys of the cache, because compiled code depends on them.
        self._signatures = frozenset(
            (name, getattr(function, '__code__', function)) for name, function in builtins.items()
        )
        #: Name of the program that was loaded for `play`, empty if none was.
        self.loaded = ''
        self.state = RuntimeState.STOPPED
        #: The state at the end of the previous cycle, which clients have read.
        self._reported_state = self.state
        #: Name of the running program, or of the last one.
        self.name = ''
        #: Called when a program has ended, to close its sockets.
        self.on_end: Callable[[], None] | None = None
        #: Number of stops so far, so that a program sent before a stop does not start after it.
        self._stops = 0
        #: Function that compiles: at once, or in a thread while the cycles go on.
        self.compile_aside: CompileAside = compile_at_once

    @property
    def current_thread(self) -> Hashable:
        """Id of the thread whose function is being executed."""
        interpreter = self._stepping
        return None if interpreter is None else (id(interpreter), interpreter.current_thread)

    @property
    def interpreter(self) -> ScriptInterpreter | None:
        """The interpreter of the primary program, while it is executed."""
        return self._interpreter if self._stepping is self._interpreter else None

    @property
    def running(self) -> bool:
        """Whether there is a program that has not ended; it may be paused."""
        return self.state in RUNNING

    @property
    def starting(self) -> bool:
        """Whether a start waits for the text of the program, or until the arm stands still."""
        return self._awaited is not None or self._queued is not None

    def submit(self, text: str, is_line: bool = False) -> None:
        """
        Compile a program and start it; a `sec` runs in parallel with the primary program.

        :param is_line: whether the text is a line of statements, not a whole program.
        """
        stops = self._stops

        def start(compiled: CompiledProgram | CompileError) -> None:
            if isinstance(compiled, CompileError):
                self._messages.exception(
                    compiled.line, compiled.column, compiled.text, at_start=True
                )
            elif compiled.program.kind == 'sec':
                self._secondaries.append(compiled.interpreter)
            elif stops == self._stops:
                self._start_compiled(compiled.program.name, compiled.interpreter)

        self.compile_aside(lambda: self._compile_text(text, is_line), start)

    def _compile_text(self, text: str, is_line: bool = False) -> CompiledProgram | CompileError:
        """Compile a program, possibly in another thread."""
        try:
            program = _parse_cached(text, is_line)
            if program.kind == 'sec':
                interpreter = ScriptInterpreter(program, self._secondary_builtins)
            else:
                interpreter = self._compile(program)
        except CompileError as error:
            return error
        except Exception as error:  # a defect of the simulator must not end the thread
            _log.exception('A program cannot be compiled')
            return CompileError(1, 1, 'internal_error', f'internal error: {error!r}')
        return CompiledProgram(program, interpreter)

    def _start_compiled(self, name: str, interpreter: ScriptInterpreter) -> None:
        if not self._refuses(name):
            self._queue_start(name, interpreter)

    def _refuses(self, name: str) -> bool:
        """Return whether no program can run now, and report the reason."""
        reason = self._arm.start_refusal()
        if reason:
            self._messages.text(f'Program {name} was not started: {reason}.')
            self.start_failure = reason
        return bool(reason)

    def compile_first(self, text: str, then: Callable[[str], None]) -> None:
        """
        Compile a program in parallel with the cycles, so that loading it afterwards takes no time.

        :param then: called with the mistake in the program; empty = no mistake.
        """

        def end(compiled: CompiledProgram | CompileError) -> None:
            then(str(compiled) if isinstance(compiled, CompileError) else '')

        self.compile_aside(lambda: self._compile_text(text), end)

    def load(self, name: str, text: str) -> str:
        """
        Load the program that `play` starts; return the reason for a refusal, else an empty string.

        As on the robot, a script that a client has sent is not loaded, so it cannot be played once
        it has been stopped.
        """
        if self.running:
            return 'a program is running'
        try:
            program = _parse_cached(text)
            self._compile(program)
        except CompileError as error:
            return str(error)
        self.loaded, self._loaded, self._awaited = name, program, None
        return ''

    def load_generated(self, name: str, generate: GenerateScript) -> str:
        """
        Load a program whose URScript is generated when `play` starts it.

        Mistakes in the program are found when it is played.

        :returns: the reason for a refusal, else an empty string.
        """
        if self.running:
            return 'a program is running'
        self.loaded, self._loaded, self._awaited = name, generate, None
        return ''

    def _start_generated(self, name: str, generate: GenerateScript) -> None:
        """Start a program once it is generated, unless it has been stopped or replaced by then."""
        start = self._awaited = object()

        def end_wait(compiled: CompiledProgram | CompileError) -> None:
            if self._awaited is not start:
                return
            self._awaited = None
            if isinstance(compiled, CompileError):
                self._messages.exception(
                    compiled.line, compiled.column, compiled.text, at_start=True
                )
                self.start_failure = str(compiled)
            else:
                self._start_compiled(name, compiled.interpreter)

        generate(lambda text: self.compile_aside(lambda: self._compile_text(text), end_wait))

    def _compile(self, program: ScriptProgram) -> ScriptInterpreter:
        key = id(program), self._interleaving is not None, self._signatures
        _, code = _compiled.get(key, (program, None))
        interpreter = ScriptInterpreter(
            program,
            self._builtins,
            thread_delay=self._thread_delay,
            interleaving=self._interleaving,
            code=code,
        )
        if code is None:
            if len(_compiled) >= MAX_COMPILED:
                _compiled.clear()
            _compiled[key] = program, interpreter.code
        return interpreter

    def _queue_start(self, name: str, interpreter: ScriptInterpreter) -> None:
        self._awaited = None
        if self.running:
            self._end()
        self._queued = (name, interpreter)
        self._start_waiting()

    def _start_waiting(self) -> None:
        """
        Start the waiting program, once the arm stands still.

        A program that comes during or after a stream of set-points starts at once and can continue
        the stream: some clients send each `speedj` or `speedl` of a stream as a separate program.
        """
        taken_over = self.state is RuntimeState.STOPPING and not self._arm.on_path
        if self._queued is None or not (taken_over or self.state is RuntimeState.STOPPED):
            return
        (name, interpreter), self._queued = self._queued, None
        if self._refuses(name):  # a safety stop has come while it waited
            return
        self.name = name
        self._interpreter = interpreter
        interpreter.on_thread_end = lambda number: self._arm.release((id(interpreter), number))
        self.state = RuntimeState.PLAYING
        if self.name == self.loaded:
            self.start_failure = ''
        self._arm.begin_program()
        # The key of a real controller contains XXX, too; the name is the text of the message.
        self._messages.key('PROGRAM_XXX_STARTED', self.name)

    def unpause(self) -> None:
        """Resume a paused program; never start one."""
        if self.state in PAUSED:
            self.play()

    def play(self) -> str:
        """Resume the program or start the loaded one; return the reason for a refusal, or ''."""
        reason = self._arm.start_refusal()
        if reason:
            return reason
        if self.state in PAUSED:
            self.state = RuntimeState.RESUMING
            if self._interpreter is not None:
                self._interpreter.resume()
        elif not self.running:
            if self._loaded is None:
                return 'no program is loaded'
            self._arm.run_preamble()
            self.start_failure = 'a stop or another program came first'
            if isinstance(self._loaded, ScriptProgram):
                self._queue_start(self.loaded, self._compile(self._loaded))
            elif self._awaited is None:
                self._start_generated(self.loaded, self._loaded)
        return ''

    def pause(self) -> str:
        """Pause on the path; return the reason for a refusal, else an empty string."""
        if self.state not in (RuntimeState.PLAYING, RuntimeState.RESUMING):
            return 'no program is playing'
        self.state = RuntimeState.PAUSING
        return ''

    def stop(self) -> None:
        """End the program, even if it is still being compiled; the arm brakes."""
        self._stops += 1
        self._queued = self._awaited = None
        self._end()

    def _end(self) -> None:
        """End the running program; the arm brakes."""
        if not self.running:
            return
        self.state = RuntimeState.STOPPING
        if self._stepping is not None and self._stepping is self._interpreter:
            self._stepping.stop()  # called by the program itself: it ends when the call returns
        else:
            self._finish()

    def _finish(self) -> None:
        """Stop the interpreter, end the program's modes and motion, and close its sockets."""
        interpreter, self._interpreter = self._interpreter, None
        if interpreter is not None:
            interpreter.stop()
        self._arm.end_modes()
        self._arm.brake()
        self.state = RuntimeState.STOPPING
        if self.on_end is not None:
            self.on_end()
        self._messages.key('PROGRAM_XXX_STOPPED', self.name)

    def step(self) -> None:
        """Run the programs for one frame."""
        self._change_state()
        if self.state is RuntimeState.PLAYING and self._interpreter is not None:
            self._run(self._interpreter)
            self._arm.end_of_frame()
            self._handle_end_of_frame(self._interpreter)
        for interpreter in self._secondaries:
            self._run_secondary(interpreter)
        self._secondaries.clear()
        self._reported_state = self.state

    def _change_state(self) -> None:
        if self.state is RuntimeState.STOPPING and self._arm.at_rest:
            self.state = RuntimeState.STOPPED
        if self.state is RuntimeState.STOPPED:
            self._start_waiting()
        elif self.state is RuntimeState.PAUSING and self._arm.at_rest:
            self.state = RuntimeState.PAUSED
        elif self.state is self._reported_state is RuntimeState.RESUMING:
            self.state = RuntimeState.PLAYING

    def _run(self, interpreter: ScriptInterpreter) -> None:
        self._stepping = interpreter
        try:
            interpreter.step()
        except Exception as error:  # a mistake in a script function must not end the simulator
            _log.exception('A function of program %s failed', self.name)
            interpreter.error = RuntimeException(f'Internal error of the simulator: {error!r}')
            self._stepping = None
            interpreter.stop()
        finally:
            self._stepping = None

    def _handle_end_of_frame(self, interpreter: ScriptInterpreter) -> None:
        """Report an error of the frame; end or pause the program if the frame has done so."""
        if interpreter.error is not None:
            error = interpreter.error
            self._messages.exception(error.line, error.column, str(error))
        if not interpreter.running or self.state is RuntimeState.STOPPING:
            self._finish()
        elif interpreter.paused:
            self.pause()

    def _run_secondary(self, interpreter: ScriptInterpreter) -> None:
        """Run a secondary program for one frame; stop it if it has not ended by then."""
        self._run(interpreter)
        error = interpreter.error
        if interpreter.running:
            interpreter.stop()
            error = error or RuntimeException('Runtime is too much behind')
        if error is not None:
            self._messages.key('SECONDARY_PROGRAM_EXCEPTION_XXX', str(error))
            self._messages.note(f'Secondary program: {error}')
