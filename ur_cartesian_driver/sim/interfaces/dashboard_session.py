# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
One client of the dashboard: a line in, a line out.

:data:`COMMANDS` lists all commands with the software in which each appeared; where one is the
beginning of another, the longer one comes first. A command that this software does not have yet is
answered like one that does not exist.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import PurePosixPath

from ur_cartesian_driver.motion.state import RuntimeState
from ur_cartesian_driver.protocol.framing import LineBuffer
from ur_cartesian_driver.sim.controller import Controller
from ur_cartesian_driver.sim.interfaces.tcp_server import ClientSession, HangUp
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
    """What the commands read and change: a controller, and the state of the pendant."""

    def __init__(self, controller: Controller) -> None:
        """Begin like a pendant after its start."""
        self.controller = controller
        self.programs = controller.programs
        self.role = 'PROGRAMMER'
        self.operational_mode = 'NONE'
        self.closing = False
        config = controller.config
        self.version = '.'.join(map(str, config.version))
        #: Without the mark of its generation, as the robot writes it.
        self.robot_model = config.model.upper().removesuffix('E')

    # What replies name

    @property
    def loaded(self) -> str:
        """The name of the loaded program."""
        return self.programs.loaded or '<unnamed>'

    @property
    def program_state(self) -> str:
        """The state of the program."""
        return _RUNTIME_WORDS[self.programs.state]

    @property
    def running(self) -> str:
        """Whether a program runs."""
        return str(self.programs.running).lower()

    @property
    def remote_control(self) -> str:
        """Whether clients may control the robot."""
        return str(self.controller.remote_control).lower()

    # What commands do

    def load(self, name: str) -> str:
        """Load a program by its file name; directories do not matter here."""
        file = PurePosixPath(name).name
        text = self.controller.config.programs.get(file)
        if text is None:
            return f'File not found: {name}'
        if self.programs.load(file, text):
            return f'Error while loading program: {name}'
        return f'Loading program: {name}'

    def load_installation(self, name: str) -> str:
        """Load an installation: only the default one exists."""
        if PurePosixPath(name).name != 'default.installation':
            return f'File not found: {name}'
        return f'Loading installation: {name}'

    def play(self, _: str) -> str:
        """Start or resume."""
        return 'Failed to execute: play' if self.programs.play() else 'Starting program'

    def pause(self, _: str) -> str:
        """Pause."""
        return 'Failed to execute: pause' if self.programs.pause() else 'Pausing program'

    def power_on(self, _: str) -> str:
        """Power up."""
        return 'Failed to execute: power on' if self.controller.power_on() else 'Powering on'

    def brake_release(self, _: str) -> str:
        """Power up to running."""
        refusal = self.controller.release_brakes()
        return 'Failed to execute: brake release' if refusal else 'Brake releasing'

    def stop(self, _: str) -> str:
        """Stop; it is no error if no program runs."""
        self.programs.stop()
        return 'Stopped'

    def quit(self, _: str) -> str:
        """Hang up."""
        self.closing = True
        return 'Disconnected'

    def shutdown(self, _: str) -> str:
        """Cut the power; the controller stays, or nothing could be tested afterwards."""
        self.controller.power_off()
        return 'Shutting down'

    def power_off(self, _: str) -> str:
        """Cut the power."""
        self.controller.power_off()
        return 'Powering off'

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

    def popup(self, text: str) -> str:
        """Show a window."""
        self.controller.show_popup(Popup(text=text))
        return 'showing popup'

    def add_to_log(self, text: str) -> str:
        """Write to the log."""
        self.controller.messages.note(text)
        return 'Added log message'

    def loaded_program(self, _: str) -> str:
        """Return the path of the loaded program."""
        loaded = self.programs.loaded
        return f'Loaded program: /programs/{loaded}' if loaded else 'No program loaded'

    def set_role(self, role: str) -> str:
        """Change the user role."""
        word = role.upper()
        if word not in _ROLES:
            return f'Failed setting user role: {role}'
        self.role = word
        return f'Setting user role: {role}'

    def set_operational_mode(self, mode: str) -> str:
        """Take control of the operational mode."""
        word = mode.upper()
        if word not in ('MANUAL', 'AUTOMATIC'):
            return f'could not understand: "set operational mode {mode}"'
        self.operational_mode = word
        return f'Operational mode "{mode}" is set'

    def clear_operational_mode(self, _: str) -> str:
        """Give the operational mode back."""
        self.operational_mode = 'NONE'
        return 'No longer controlling the operational mode. Current operational mode: NONE'


@dataclass(frozen=True, slots=True)
class DashboardCommand:
    """A command, and the first CB3 and e-Series software that has it."""

    words: str
    cb3: tuple[int, int] | None
    e: tuple[int, int] | None
    #: What carries it out, or the reply: {0} = the handlers, {1} = the argument.
    action: CommandHandler | str
    argument: bool = False

    def reply(self, handlers: DashboardHandlers, argument: str) -> str:
        """Carry out the command, return the reply."""
        if isinstance(self.action, str):
            return self.action.format(handlers, argument)
        return self.action(handlers, argument)

    def argument_in(self, line: str) -> str | None:
        """Return the argument if the line is this command, None if it is another one."""
        if not self.argument:
            return '' if line == self.words else None
        return line[len(self.words) + 1 :].strip() if line.startswith(self.words + ' ') else None


_SUPPORT_FILE_WRITTEN = 'Completed successfully: {1}/ursupport.zip'
_Handlers, _Row = DashboardHandlers, DashboardCommand
COMMANDS = (
    _Row('load installation', (3, 2), (5, 0), _Handlers.load_installation, argument=True),
    _Row('load', (1, 4), (5, 0), _Handlers.load, argument=True),
    _Row('play', (1, 4), (5, 0), _Handlers.play),
    _Row('pause', (1, 4), (5, 0), _Handlers.pause),
    _Row('stop', (1, 4), (5, 0), _Handlers.stop),
    _Row('quit', (1, 4), (5, 0), _Handlers.quit),
    _Row('shutdown', (1, 4), (5, 0), _Handlers.shutdown),
    _Row('power on', (3, 0), (5, 0), _Handlers.power_on),
    _Row('power off', (3, 0), (5, 0), _Handlers.power_off),
    _Row('brake release', (3, 0), (5, 0), _Handlers.brake_release),
    _Row('unlock protective stop', (3, 1), (5, 0), _Handlers.unlock),
    _Row('close popup', (1, 6), (5, 0), _Handlers.close_popup),
    _Row('close safety popup', (3, 1), (5, 0), 'closing safety popup'),
    _Row('restart safety', (3, 7), (5, 1), _Handlers.restart_safety),
    _Row('running', (1, 6), (5, 0), 'Program running: {0.running}'),
    _Row('robotmode', (1, 6), (5, 0), 'Robotmode: {0.controller.power.mode.name}'),
    _Row('safetymode', (3, 0), (5, 0), 'Safetymode: {0.controller.safety.mode.name}'),
    _Row('safetystatus', None, (5, 4), 'Safetystatus: {0.controller.safety.mode.name}'),
    _Row('get loaded program', (1, 6), (5, 0), _Handlers.loaded_program),
    _Row('programState', (1, 8), (5, 0), '{0.program_state} {0.loaded}'),
    _Row('isProgramSaved', (1, 8), (5, 0), 'true {0.loaded}'),
    _Row('popup', (1, 6), (5, 0), _Handlers.popup, argument=True),
    _Row('addToLog', (1, 8), (5, 0), _Handlers.add_to_log, argument=True),
    _Row('PolyscopeVersion', (1, 8), (5, 0), 'URSoftware {0.version} (Jan 01 2026)'),
    _Row('version', None, (5, 0), '{0.version}'),
    _Row('setUserRole', (3, 1), None, _Handlers.set_role, argument=True),
    _Row('getUserRole', (3, 1), None, '{0.role}'),
    _Row('set operational mode', None, (5, 0), _Handlers.set_operational_mode, argument=True),
    _Row('get operational mode', None, (5, 6), '{0.operational_mode}'),
    _Row('clear operational mode', None, (5, 0), _Handlers.clear_operational_mode),
    _Row('is in remote control', None, (5, 6), '{0.remote_control}'),
    _Row('get serial number', (3, 12), (5, 6), '20000000000'),
    _Row('get robot model', (3, 12), (5, 6), '{0.robot_model}'),
    # Nothing is written.
    _Row('generate flight report', (3, 13), (5, 8), 'Flight Report generated with id: 0', True),
    _Row(
        'generate support file', (3, 13), (5, 8), 'Completed successfully: {1}/ursupport.zip', True
    ),
    _Row('saveLog', (3, 13), (5, 8), 'Log saved to disk'),
)


class DashboardSession(ClientSession):
    """Answers the commands that the software of this robot has."""

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
                return command.reply(self._handlers, argument)
        return f'could not understand: "{line}"'
