# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
One client of the dashboard, and the effect of each command.

A command that this version of the robot's software lacks is answered like an unknown command.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Generator, Mapping
import logging
from pathlib import PurePosixPath

from ur_cartesian_driver.motion.state.rtde_state import RuntimeState
from ur_cartesian_driver.protocol.dashboard import (
    BANNER,
    DashboardRequest,
    DashboardServerCodec,
    encode_line,
    not_understood,
    success,
)
from ur_cartesian_driver.sim.controller import Controller
from ur_cartesian_driver.sim.interfaces.tcp_server import ClientSession, HangUp
from ur_cartesian_driver.sim.state.controller_state import Popup
from ur_cartesian_driver.sim.state.power_and_safety import SafetyEvent

_log = logging.getLogger(__name__)

#: The states of a program in the words of the dashboard and the Robot API.
RUNTIME_WORDS = {
    RuntimeState.STOPPING: 'STOPPED',
    RuntimeState.STOPPED: 'STOPPED',
    RuntimeState.PLAYING: 'PLAYING',
    RuntimeState.RESUMING: 'PLAYING',
    RuntimeState.PAUSING: 'PAUSED',
    RuntimeState.PAUSED: 'PAUSED',
}
#: Commands that control the arm, its power or its programs. They are refused in local control, and
#: to a client that connected in local control until it reconnects.
_REMOTE_ONLY = frozenset(
    {
        'load',
        'load installation',
        'play',
        'pause',
        'stop',
        'shutdown',
        'power on',
        'power off',
        'brake release',
        'unlock protective stop',
        'restart safety',
    }
)
#: The refusal in the words of real robots.
_LOCAL_CONTROL = (
    'Command is not allowed due to safety reasons, please switch robot to Remote Control mode and '
    'reconnect to port 29999'
)
_QUIT = DashboardRequest(name='quit')
_ROLES = ('PROGRAMMER', 'OPERATOR', 'NONE', 'LOCKED', 'RESTRICTED')


class DashboardHandlers:
    """
    The effects of the commands on a controller and its pendant.

    A method that carries out a command returns None for success, otherwise the reply. If the
    command has to wait for the robot, the method is a generator whose result is this value.
    """

    def __init__(self, controller: Controller) -> None:
        """Serve the dashboard of a controller."""
        self.controller = controller
        self.programs = controller.programs
        self.pendant = controller.pendant
        config = controller.config
        self.version = '.'.join(map(str, config.version))
        #: The model as the robot reports it: upper case, without the e of the e-Series.
        self.robot_model = config.model.upper().removesuffix('E')
        self.serial_number = config.serial_number

    # Values in replies

    @property
    def loaded(self) -> str:
        """The name of the loaded program; '<unnamed>' until one is loaded."""
        return self.programs.loaded or '<unnamed>'

    @property
    def program_state(self) -> str:
        """The state of the program."""
        return RUNTIME_WORDS[self.programs.state]

    @property
    def running(self) -> str:
        """Whether a program runs."""
        return str(self.programs.running).lower()

    @property
    def remote_control(self) -> str:
        """Whether the robot is in remote control."""
        return str(self.controller.remote_control).lower()

    # Effects of commands

    def load(self, name: str) -> Generator[None, None, str | None]:
        """Load a program; quotation marks, which some clients put around the name, are removed."""
        name = name.strip('"')
        refusals: list[str] = []
        self.controller.load_program_aside(name, refusals.append)
        while not refusals:
            yield
        refusal = refusals[0]
        if not refusal or refusal.startswith('File not found'):
            return refusal or None
        # A real robot's reply gives no reason; only its pendant does.
        self.controller.messages.note(f'Program {name} was not loaded: {refusal}.')
        _log.warning('Program %s was not loaded: %s.', name, refusal)
        return f'Error while loading program: {name}'

    def load_installation(self, name: str) -> str | None:
        """Load an installation: only the default one exists."""
        known = PurePosixPath(name).name == 'default.installation'
        return None if known else f'File not found: {name}'

    def unlock(self, _: str) -> str | None:
        """Unlock a protective stop that has lasted for the unlock delay."""
        refusal = self.controller.safety_event(SafetyEvent.UNLOCK)
        if 'cannot be unlocked' in refusal:
            return (
                'Cannot unlock protective stop until 5s after occurrence. Always inspect '
                'cause of protective stop before unlocking'
            )
        return None

    def restart_safety(self, _: str) -> None:
        """Clear a fault or violation; without one, only cut the power of the arm."""
        if self.controller.safety_event(SafetyEvent.RESTART):
            self.controller.power_off()

    def popup(self, text: str) -> None:
        """Show a window."""
        self.controller.show_popup(Popup(text=text))

    def add_to_log(self, text: str) -> str | None:
        """Write to the log."""
        if not text:
            return 'No log message to add'
        self.controller.messages.note(text)
        return None

    def set_role(self, role: str) -> str | None:
        """Change the user role."""
        word = role.upper()
        if word not in _ROLES:
            return f'Failed setting user role: {role}'
        self.pendant.user_role = word
        return None

    def set_operational_mode(self, mode: str) -> str | None:
        """Set the operational mode, and take control of it."""
        word = mode.upper()
        if word not in ('MANUAL', 'AUTOMATIC'):
            return f'could not understand: "set operational mode {mode}"'
        self.controller.set_operational_mode(word)
        return None

    def clear_operational_mode(self, _: str) -> None:
        """Give back control of the operational mode."""
        self.controller.set_operational_mode('NONE')


#: Command -> function that carries it out; the command fails if the function returns a reason.
_CONTROL: Mapping[str, Callable[[Controller], object]] = {
    'play': lambda controller: controller.programs.play(),
    'pause': lambda controller: controller.programs.pause(),
    'stop': lambda controller: controller.programs.stop(),
    'power on': Controller.power_on,
    'power off': Controller.power_off,
    'brake release': Controller.release_brakes,
    # Switches off only the arm: without a controller, nothing could be tested afterwards.
    'shutdown': Controller.power_off,
    'close popup': Controller.close_popups,
}
#: Command -> state that the program must have left before the command is answered. The
#: manufacturer's page for CB3 says that these commands return when stopping or pausing is
#: completed; assumed for e-Series.
_AWAITED = {'stop': RuntimeState.STOPPING, 'pause': RuntimeState.PAUSING}
#: Handlers of commands that need more than a call of the controller.
_HANDLERS: Mapping[
    str, Callable[[DashboardHandlers, str], str | Generator[None, None, str | None] | None]
] = {
    'load': DashboardHandlers.load,
    'load installation': DashboardHandlers.load_installation,
    'unlock protective stop': DashboardHandlers.unlock,
    'restart safety': DashboardHandlers.restart_safety,
    'popup': DashboardHandlers.popup,
    'addToLog': DashboardHandlers.add_to_log,
    'setUserRole': DashboardHandlers.set_role,
    'set operational mode': DashboardHandlers.set_operational_mode,
    'clear operational mode': DashboardHandlers.clear_operational_mode,
}
#: Format of the value in a reply, by default {1}; {0} = the handlers, {1} = the argument.
_VALUES: Mapping[str, str] = {
    'running': '{0.running}',
    'robotmode': '{0.controller.power.mode.name}',
    'safetymode': '{0.controller.safety.mode.name}',
    'safetystatus': '{0.controller.safety.mode.name}',
    'get loaded program': '/programs/{0.loaded}',
    'programState': '{0.program_state} {0.loaded}',
    'isProgramSaved': 'true {0.loaded}',
    'PolyscopeVersion': '{0.version} (Jan 01 2026)',
    'version': '{0.version}',
    'getUserRole': '{0.pendant.user_role}',
    'set operational mode': '"{1}" is set',
    'get operational mode': '{0.pendant.operational_mode}',
    # URSim's words, including the full stop.
    'clear operational mode': "Current operational mode: 'NONE'.",
    'is in remote control': '{0.remote_control}',
    'get serial number': '{0.serial_number}',
    'get robot model': '{0.robot_model}',
    # The next two commands only reply; no file is written.
    'generate flight report': '0',
    'generate support file': '{1}/ur_{0.serial_number}_2026-01-01_00-00-00.zip',
}


class DashboardSession(ClientSession):
    """Answers commands in order; some are answered only when the robot has carried them out."""

    def __init__(self, controller: Controller) -> None:
        """Note whether the client may control the robot; this is decided when it connects."""
        self._controller = controller
        self._may_control = controller.takes_scripts
        self._handlers = DashboardHandlers(controller)
        self._server = DashboardServerCodec(controller.config.version[:2])
        self._requests: deque[DashboardRequest | str] = deque()
        #: The generator of the answer to the first request; None = the request has not begun.
        self._answering: Generator[None, None, bytes] | None = None

    @property
    def is_busy(self) -> bool:
        """Whether commands wait; published programs send two and hang up before the answers."""
        return bool(self._requests)

    def open(self) -> bytes:
        """Return the greeting."""
        return encode_line(BANNER)

    def feed(self, data: bytes) -> bytes:
        """Take bytes of commands; return the answers that are available, one line per command."""
        if data:
            self._requests += self._server.feed(data)
        answers = b''
        while self._requests:
            if self._answering is None:
                self._answering = self._answer(self._requests[0])
            try:
                next(self._answering)
            except StopIteration as answer:
                answers += answer.value
            else:
                break
            self._answering = None
            if self._requests.popleft() == _QUIT:
                raise HangUp(answers)
        return answers

    def _answer(self, request: DashboardRequest | str) -> Generator[None, None, bytes]:
        """Carry out a request, and return the answer."""
        if isinstance(request, str):
            return not_understood(request)
        name, argument = request.name, request.argument
        may_control = self._may_control and self._controller.takes_scripts
        if name in _REMOTE_ONLY and not may_control:
            return encode_line(_LOCAL_CONTROL)
        if (control := _CONTROL.get(name)) and control(self._handlers.controller):
            return encode_line(f'Failed to execute: {name}')
        while name in _AWAITED and self._handlers.programs.state is _AWAITED[name]:
            yield
        if handler := _HANDLERS.get(name):
            refusal = handler(self._handlers, argument)
            if isinstance(refusal, Generator):
                refusal = yield from refusal
            if refusal:
                return encode_line(refusal)
        return success(request, _VALUES.get(name, '{1}').format(self._handlers, argument))
