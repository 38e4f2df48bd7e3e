# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The life of programs: one primary one, and secondary ones beside it.

::

    STOPPED --start--> PLAYING --pause--> PAUSING --arm stands--> PAUSED
                       ^                                            |
                       +------------- RESUMING <-------play---------+
    any of these --end, halt, exception, stop, new program--> STOPPING --arm stands--> STOPPED

A program that is stopped while the arm moves makes the controller brake hard; the next program
starts when the arm stands. Programs are refused with line and column before anything of them has
run, and a refused program leaves the running one alone.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Mapping
from functools import lru_cache
import logging
from typing import Any, Protocol

from ur_cartesian_driver.motion.state import RuntimeState
from ur_cartesian_driver.sim.announcements import Announcements
from ur_cartesian_driver.sim.builtins import timeless
from ur_cartesian_driver.urscript import CompileError, Machine, parse, Program, RuntimeException

_log = logging.getLogger(__name__)

#: Clients send the same program again and again; its tree is immutable.
_parsed = lru_cache(maxsize=8)(parse)

#: What happens to the arm and to the modes around a program.
RUNNING = frozenset(
    {RuntimeState.PLAYING, RuntimeState.PAUSING, RuntimeState.PAUSED, RuntimeState.RESUMING}
)


class Arm(Protocol):
    """What the life of programs needs to know of the arm, and to make it do."""

    @property
    def standing(self) -> bool:
        """Whether the arm stands, at the end of a motion or paused on its path."""

    def brake(self) -> None:
        """Stop as hard as the controller does on its own."""

    def end_modes(self) -> None:
        """End what a program had switched on: force mode, hand guiding, watchdogs."""

    def end_of_frame(self) -> None:
        """Brake if the program left a motion alone."""

    def release(self, thread: Hashable) -> None:
        """Let a thread that has ended own the motion no longer."""

    def why_not_ready(self) -> str:
        """Return why no program can run now; empty if one can."""


class Programs:
    """The primary program, its state, and the secondary programs of this cycle."""

    def __init__(
        self, builtins: Mapping[str, Any], announcements: Announcements, arm: Arm
    ) -> None:
        """Begin with no program."""
        self._builtins = builtins
        self._secondary_builtins = timeless(builtins)
        self._announce = announcements
        self._arm = arm
        self._machine: Machine | None = None
        self._stepping: Machine | None = None
        self._waiting: tuple[str, Machine] | None = None
        self._secondaries: list[Machine] = []
        self._loaded: Program | None = None
        #: Name of the program that was loaded for `play`, empty if none was.
        self.loaded = ''
        self.state = RuntimeState.STOPPED
        #: Name of the running program, or of the last one.
        self.name = ''
        #: Called when a program has ended or before another starts: sockets are closed here.
        self.on_end: Callable[[], None] | None = None

    @property
    def current_thread(self) -> Hashable:
        """Id of the thread whose function is being executed."""
        machine = self._stepping
        return None if machine is None else (id(machine), machine.current_thread)

    @property
    def machine(self) -> Machine | None:
        """The machine of the primary program, if its functions are being executed."""
        return self._machine if self._stepping is self._machine else None

    @property
    def running(self) -> bool:
        """Whether there is a program that has not ended; it may be paused."""
        return self.state in RUNNING

    def submit(self, text: str, line_offset: int = 0) -> None:
        """
        Compile a program and start it, or run it beside the primary one if it is a `sec`.

        :param line_offset: lines that were put before the text that was sent.
        """
        try:
            program = _parsed(text)
            secondary = program.kind == 'sec'
            machine = Machine(program, self._secondary_builtins if secondary else self._builtins)
        except CompileError as error:
            self._announce.exception(error.line - line_offset, error.column, error.text)
            return
        if secondary:
            self._secondaries.append(machine)
            return
        reason = self._arm.why_not_ready()
        if reason:
            self._announce.text(f'Program {program.name} was not started: {reason}.')
            return
        self._replace(program.name, machine)

    def load(self, name: str, text: str) -> str:
        """
        Make a program the one that `play` starts; return why not, or an empty string.

        A script that a client has sent is not loaded: once stopped it is gone, as on the robot.
        """
        if self.running:
            return 'a program is running'
        try:
            self._loaded = _parsed(text)
            Machine(self._loaded, self._builtins)
        except CompileError as error:
            return str(error)
        self.loaded = name
        return ''

    def _replace(self, name: str, machine: Machine) -> None:
        if self.running:
            self.stop()
        self._waiting = (name, machine)
        self._start_waiting()

    def _start_waiting(self) -> None:
        """Start the program that waits, once the arm stands."""
        if self._waiting is None or self.state is not RuntimeState.STOPPED:
            return
        self.name, self._machine = self._waiting
        self._waiting = None
        machine = self._machine
        machine.on_thread_end = lambda number: self._arm.release((id(machine), number))
        self.state = RuntimeState.PLAYING
        # XXX is what a controller writes; the name of the program follows as the text.
        self._announce.key('PROGRAM_XXX_STARTED', self.name)

    def play(self) -> str:
        """Resume, or start the loaded program; return why not, or an empty string."""
        reason = self._arm.why_not_ready()
        if reason:
            return reason
        if self.state in (RuntimeState.PAUSED, RuntimeState.PAUSING):
            self.state = RuntimeState.RESUMING
            if self._machine is not None:
                self._machine.resume()
        elif self.state is RuntimeState.STOPPED:
            if self._loaded is None:
                return 'no program is loaded'
            self._replace(self.loaded, Machine(self._loaded, self._builtins))
        return ''

    def pause(self) -> str:
        """Pause on the path; return why not, or an empty string."""
        if self.state not in (RuntimeState.PLAYING, RuntimeState.RESUMING):
            return 'no program is playing'
        self.state = RuntimeState.PAUSING
        return ''

    def stop(self) -> None:
        """End the program; the arm brakes."""
        self._waiting = None
        if not self.running:
            return
        self.state = RuntimeState.STOPPING
        if self._stepping is not None and self._stepping is self._machine:
            self._stepping.stop()  # called by one of its own functions: it ends when that returns
        else:
            self._finish()

    def _finish(self) -> None:
        """Close the machine and clean up behind it."""
        machine, self._machine = self._machine, None
        if machine is not None:
            machine.stop()
        self._arm.end_modes()
        self._arm.brake()
        self.state = RuntimeState.STOPPING
        if self.on_end is not None:
            self.on_end()
        self._announce.key('PROGRAM_XXX_STOPPED', self.name)

    def step(self) -> None:
        """Run one frame."""
        self._change_state()
        if self.state is RuntimeState.PLAYING and self._machine is not None:
            self._run(self._machine)
            self._arm.end_of_frame()
            self._look_at(self._machine)
        for machine in self._secondaries:
            self._run_secondary(machine)
        self._secondaries.clear()

    def _change_state(self) -> None:
        if self.state is RuntimeState.STOPPING and self._arm.standing:
            self.state = RuntimeState.STOPPED
        if self.state is RuntimeState.STOPPED:
            self._start_waiting()
        elif self.state is RuntimeState.PAUSING and self._arm.standing:
            self.state = RuntimeState.PAUSED
        elif self.state is RuntimeState.RESUMING:
            self.state = RuntimeState.PLAYING

    def _run(self, machine: Machine) -> None:
        self._stepping = machine
        try:
            machine.step()
        except Exception as error:  # a defect of a function must not end the robot
            _log.exception('A function of program %s failed', self.name)
            machine.error = RuntimeException(f'Internal error of the simulator: {error!r}')
            self._stepping = None
            machine.stop()
        finally:
            self._stepping = None

    def _look_at(self, machine: Machine) -> None:
        """See what the frame did to the program."""
        if machine.error is not None:
            error = machine.error
            self._announce.exception(error.line, error.column, str(error))
        if not machine.running or self.state is RuntimeState.STOPPING:
            self._finish()
        elif machine.paused:
            self.pause()

    def _run_secondary(self, machine: Machine) -> None:
        """Run a whole secondary program; what has not ended after one frame never does."""
        self._run(machine)
        error = machine.error
        if machine.running:
            machine.stop()
            error = error or RuntimeException('Runtime is too much behind')
        if error is not None:
            self._announce.key('SECONDARY_PROGRAM_EXCEPTION_XXX', str(error))
