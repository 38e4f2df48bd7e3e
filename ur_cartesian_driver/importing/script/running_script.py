# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The running program: its line and thread, and the remarks about it."""

from __future__ import annotations

from ur_cartesian_driver.importing.imported_path import ImportNotes
from ur_cartesian_driver.importing.script.script_terms import ASSUMED
from ur_cartesian_driver.urscript import ScriptInterpreter, ThreadHandle

#: The main thread of a program.
MAIN = 0


class RunningScript:
    """The running program, as seen by the functions that it calls: line, thread and remarks."""

    def __init__(self) -> None:
        """Begin before the program is compiled."""
        self.interpreter: ScriptInterpreter | None = None
        #: A clause that names the last call with an assumed value; '' = none.
        self._assumed = ''
        #: The remarks by reason: the names to which the reason applies, and the lines.
        self._said: dict[str, tuple[dict[str, None], set[int]]] = {}

    @property
    def line(self) -> int:
        """The line of the running call; 0 = none."""
        return 0 if self.interpreter is None else self.interpreter.location[0]

    @property
    def thread(self) -> int:
        """The number of the running thread."""
        number = None if self.interpreter is None else self.interpreter.current_thread
        return number if isinstance(number, int) else MAIN

    def lives(self, thread: int) -> bool:
        """Return whether a thread is alive."""
        return self.interpreter is not None and self.interpreter.alive(ThreadHandle(thread))

    def say(self, what: str, why: str) -> None:
        """Add a remark on the running line; remarks with the same reason are merged."""
        names, lines = self._said.setdefault(why, ({}, set()))
        names[what] = None
        lines.add(self.line)

    def leave_out(self, what: str, why: str) -> None:
        """Remark that a function lacks the effect or the value that it has on a robot."""
        if why in ASSUMED:
            self._assumed = (
                f'the value of {what} of line {self.line} is assumed, because no robot answers '
                'during an import'
            )
        self.say(what, why)

    def suspicion(self, before: str) -> str:
        """Return `before` and a possible cause of a failure or endless loop; '' = none."""
        return f'{before}{self._assumed}' if self._assumed else ''

    def tell(self, remarks: ImportNotes) -> None:
        """Add all remarks to the remarks of the import."""
        for why, (names, lines) in self._said.items():
            for line in lines:
                remarks.add(line, ', '.join(names), why)
