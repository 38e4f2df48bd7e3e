# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
One client of the dashboard: a line in, a line out.

:data:`COMMANDS` has them all, longest first where one is the beginning of another, with the
software in which each appeared. A command that this software does not have yet is answered like
one that does not exist.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import PurePosixPath

from ur_cartesian_driver.motion.state import RuntimeState
from ur_cartesian_driver.protocol.framing import LineBuffer
from ur_cartesian_driver.sim.controller import Controller
from ur_cartesian_driver.sim.interfaces.tcp_server import HangUp
from ur_cartesian_driver.sim.state.controller_state import Popup
from ur_cartesian_driver.sim.state.power_and_safety import SafetyEvent

BANNER = 'Connected: Universal Robots Dashboard Server'
_MAX_LINE_LENGTH = 4096

_RUNTIME_WORDS = {
    RuntimeState.STOPPING: 'STOPPED',
    RuntimeState.STOPPED: 'STOPPED',
    RuntimeState.PLAYING: 'PLAYING',
    RuntimeState.RESUMING: 'PLAYING',
    RuntimeState.PAUSING: 'PAUSED',
    RuntimeState.PAUSED: 'PAUSED',
}
_ROLES = ('PROGRAMMER', 'OPERATOR', 'NONE', 'LOCKED', 'RESTRICTED')

CommandHandler = Callable[['DashboardHandlers', str], str]


class DashboardHandlers:
    """What the commands work on: a controller, and what only the pendant knows."""

    def __init__(self, controller: Controller) -> None:
        """Begin as after the start of the pendant."""
        self.controller = controller
        self.role = 'PROGRAMMER'
        self.operational_mode = 'NONE'
        self.closing = False

    def load(self, name: str) -> str:
        """Load a program by its file name; directories do not matter here."""
        file = PurePosixPath(name).name
        text = self.controller.config.programs.get(file)
        if text is None:
            return f'File not found: {name}'
        reason = self.controller.programs.load(file, text)
        return f'Error while loading program: {name}' if reason else f'Loading program: {name}'

    def play(self, _: str) -> str:
        """Start or resume."""
        return 'Failed to execute: play' if self.controller.programs.play() else 'Starting program'

    def pause(self, _: str) -> str:
        """Pause."""
        refusal = self.controller.programs.pause()
        return 'Failed to execute: pause' if refusal else 'Pausing program'

    def stop(self, _: str) -> str:
        """Stop; nothing running is fine."""
        self.controller.programs.stop()
        return 'Stopped'

    def quit(self, _: str) -> str:
        """Hang up."""
        self.closing = True
        return 'Disconnected'

    def shutdown(self, _: str) -> str:
        """Cut the power; the controller itself stays, or nothing could be tested afterwards."""
        self.controller.power_off()
        return 'Shutting down'

    def power_on(self, _: str) -> str:
        """Power up."""
        return 'Failed to execute: power on' if self.controller.power_on() else 'Powering on'

    def power_off(self, _: str) -> str:
        """Cut the power."""
        self.controller.power_off()
        return 'Powering off'

    def brake_release(self, _: str) -> str:
        """Power up to running."""
        refusal = self.controller.release_brakes()
        return 'Failed to execute: brake release' if refusal else 'Brake releasing'

    def unlock(self, _: str) -> str:
        """Unlock a protective stop, if it has lasted long enough."""
        refusal = self.controller.safety_event(SafetyEvent.UNLOCK)
        if 'cannot be unlocked' in refusal:
            return (
                'Cannot unlock protective stop until 5s after occurrence. Always inspect '
                'cause of protective stop before unlocking'
            )
        return 'Protective stop releasing'

    def restart_safety(self, _: str) -> str:
        """Leave a fault or violation; the arm is without power then."""
        if self.controller.safety_event(SafetyEvent.RESTART):
            self.controller.power_off()
        return 'Restarting safety'

    def close_popup(self, _: str) -> str:
        """Close all windows."""
        self.controller.close_popups()
        return 'closing popup'

    def close_safety_popup(self, _: str) -> str:
        """Close a window that is not shown here."""
        return 'closing safety popup'

    def popup(self, text: str) -> str:
        """Show a window."""
        self.controller.show_popup(Popup(text=text))
        return 'showing popup'

    def add_to_log(self, text: str) -> str:
        """Write to the log."""
        self.controller.messages.note(text)
        return 'Added log message'

    def running(self, _: str) -> str:
        """Tell whether a program runs."""
        return f'Program running: {str(self.controller.programs.running).lower()}'

    def robot_mode(self, _: str) -> str:
        """Tell the robot mode."""
        return f'Robotmode: {self.controller.power.mode.name}'

    def safety_mode(self, _: str) -> str:
        """Tell the safety mode."""
        return f'Safetymode: {self.controller.safety.mode.name}'

    def safety_status(self, _: str) -> str:
        """Tell the safety status."""
        return f'Safetystatus: {self.controller.safety.mode.name}'

    def program_state(self, _: str) -> str:
        """Tell the state and the name of the loaded program."""
        programs = self.controller.programs
        return f'{_RUNTIME_WORDS[programs.state]} {programs.loaded or "<unnamed>"}'

    def loaded_program(self, _: str) -> str:
        """Tell the name of the loaded program."""
        loaded = self.controller.programs.loaded
        return f'Loaded program: /programs/{loaded}' if loaded else 'No program loaded'

    def is_saved(self, _: str) -> str:
        """Tell that the program is saved: nobody can edit it."""
        return f'true {self.controller.programs.loaded or "<unnamed>"}'

    def polyscope_version(self, _: str) -> str:
        """Tell the version of the software."""
        return f'URSoftware {self._version(4)} (Jan 01 2026)'

    def version(self, _: str) -> str:
        """Tell the version of the software, numbers only."""
        return self._version(4)

    def _version(self, count: int) -> str:
        return '.'.join(str(part) for part in self.controller.config.version[:count])

    def set_role(self, role: str) -> str:
        """Change the user role."""
        word = role.upper()
        if word not in _ROLES:
            return f'Failed setting user role: {role}'
        self.role = word
        return f'Setting user role: {role}'

    def get_role(self, _: str) -> str:
        """Tell the user role."""
        return self.role

    def set_operational_mode(self, mode: str) -> str:
        """Take control of the operational mode."""
        word = mode.upper()
        if word not in ('MANUAL', 'AUTOMATIC'):
            return f'could not understand: "set operational mode {mode}"'
        self.operational_mode = word
        return f'Operational mode "{mode}" is set'

    def get_operational_mode(self, _: str) -> str:
        """Tell the operational mode."""
        return self.operational_mode

    def clear_operational_mode(self, _: str) -> str:
        """Give the operational mode back."""
        self.operational_mode = 'NONE'
        return 'No longer controlling the operational mode. Current operational mode: NONE'

    def load_installation(self, name: str) -> str:
        """Load an installation: only the default one exists."""
        if PurePosixPath(name).name != 'default.installation':
            return f'File not found: {name}'
        return f'Loading installation: {name}'

    def remote(self, _: str) -> str:
        """Tell whether clients may control the robot."""
        return str(self.controller.remote_control).lower()

    def serial_number(self, _: str) -> str:
        """Tell a number that belongs to no arm."""
        return '20000000000'

    def robot_model(self, _: str) -> str:
        """Tell the model without the mark of its generation, as the robot does."""
        return self.controller.config.model.upper().removesuffix('E')

    def flight_report(self, _: str) -> str:
        """Say that a report was written; there is nothing to write."""
        return 'Flight Report generated with id: 0'

    def support_file(self, directory: str) -> str:
        """Say that a file was written; there is nothing to write."""
        return f'Completed successfully: {directory}/ursupport.zip'

    def save_log(self, _: str) -> str:
        """Say that the log was written; there is nothing to write."""
        return 'Log saved to disk'


@dataclass(frozen=True, slots=True)
class DashboardCommand:
    """A command with the software versions of CB3 and e-Series from which on it exists."""

    words: str
    action: CommandHandler
    cb3: tuple[int, int] | None
    e: tuple[int, int] | None
    argument: bool = False

    def argument_in(self, line: str) -> str | None:
        """Return the argument if the line is this command, None if it is another one."""
        if not self.argument:
            return '' if line == self.words else None
        return line[len(self.words) + 1 :].strip() if line.startswith(self.words + ' ') else None


COMMANDS = (
    DashboardCommand(
        'load installation', DashboardHandlers.load_installation, (3, 2), (5, 0), argument=True
    ),
    DashboardCommand('load', DashboardHandlers.load, (1, 4), (5, 0), argument=True),
    DashboardCommand('play', DashboardHandlers.play, (1, 4), (5, 0)),
    DashboardCommand('pause', DashboardHandlers.pause, (1, 4), (5, 0)),
    DashboardCommand('stop', DashboardHandlers.stop, (1, 4), (5, 0)),
    DashboardCommand('quit', DashboardHandlers.quit, (1, 4), (5, 0)),
    DashboardCommand('shutdown', DashboardHandlers.shutdown, (1, 4), (5, 0)),
    DashboardCommand('power on', DashboardHandlers.power_on, (3, 0), (5, 0)),
    DashboardCommand('power off', DashboardHandlers.power_off, (3, 0), (5, 0)),
    DashboardCommand('brake release', DashboardHandlers.brake_release, (3, 0), (5, 0)),
    DashboardCommand('unlock protective stop', DashboardHandlers.unlock, (3, 1), (5, 0)),
    DashboardCommand('close popup', DashboardHandlers.close_popup, (1, 6), (5, 0)),
    DashboardCommand('close safety popup', DashboardHandlers.close_safety_popup, (3, 1), (5, 0)),
    DashboardCommand('restart safety', DashboardHandlers.restart_safety, (3, 7), (5, 1)),
    DashboardCommand('running', DashboardHandlers.running, (1, 6), (5, 0)),
    DashboardCommand('robotmode', DashboardHandlers.robot_mode, (1, 6), (5, 0)),
    DashboardCommand('safetymode', DashboardHandlers.safety_mode, (3, 0), (5, 0)),
    DashboardCommand('safetystatus', DashboardHandlers.safety_status, None, (5, 4)),
    DashboardCommand('get loaded program', DashboardHandlers.loaded_program, (1, 6), (5, 0)),
    DashboardCommand('programState', DashboardHandlers.program_state, (1, 8), (5, 0)),
    DashboardCommand('isProgramSaved', DashboardHandlers.is_saved, (1, 8), (5, 0)),
    DashboardCommand('popup', DashboardHandlers.popup, (1, 6), (5, 0), argument=True),
    DashboardCommand('addToLog', DashboardHandlers.add_to_log, (1, 8), (5, 0), argument=True),
    DashboardCommand('PolyscopeVersion', DashboardHandlers.polyscope_version, (1, 8), (5, 0)),
    DashboardCommand('version', DashboardHandlers.version, None, (5, 0)),
    DashboardCommand('setUserRole', DashboardHandlers.set_role, (3, 1), None, argument=True),
    DashboardCommand('getUserRole', DashboardHandlers.get_role, (3, 1), None),
    DashboardCommand(
        'set operational mode', DashboardHandlers.set_operational_mode, None, (5, 0), argument=True
    ),
    DashboardCommand('get operational mode', DashboardHandlers.get_operational_mode, None, (5, 6)),
    DashboardCommand(
        'clear operational mode', DashboardHandlers.clear_operational_mode, None, (5, 0)
    ),
    DashboardCommand('is in remote control', DashboardHandlers.remote, None, (5, 6)),
    DashboardCommand('get serial number', DashboardHandlers.serial_number, (3, 12), (5, 6)),
    DashboardCommand('get robot model', DashboardHandlers.robot_model, (3, 12), (5, 6)),
    DashboardCommand(
        'generate flight report', DashboardHandlers.flight_report, (3, 13), (5, 8), argument=True
    ),
    DashboardCommand(
        'generate support file', DashboardHandlers.support_file, (3, 13), (5, 8), argument=True
    ),
    DashboardCommand('saveLog', DashboardHandlers.save_log, (3, 13), (5, 8)),
)


class DashboardSession:
    """A :class:`~.server.Session`."""

    def __init__(self, controller: Controller) -> None:
        """Wait for commands."""
        self._handlers = DashboardHandlers(controller)
        self._lines = LineBuffer(_MAX_LINE_LENGTH)
        version = controller.config.version[:2]
        cb3 = version[0] < 5
        self._commands = [
            command
            for command in COMMANDS
            if (min_version := command.cb3 if cb3 else command.e) is not None
            and min_version <= version
        ]

    def open(self) -> bytes:
        """Greet."""
        return f'{BANNER}\n'.encode()

    def close(self) -> None:
        """Hold nothing."""

    def feed(self, data: bytes) -> bytes:
        """Answer each line by one line."""
        answers = ''
        for line in self._lines.feed(data):
            answers += self._answer(line.strip()) + '\n'
            if self._handlers.closing:
                raise HangUp(answers.encode())
        return answers.encode()

    def _answer(self, line: str) -> str:
        for command in self._commands:
            argument = command.argument_in(line)
            if argument is not None:
                return command.action(self._handlers, argument)
        return f'could not understand: "{line}"'
