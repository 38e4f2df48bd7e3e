# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
All functions that a program can call, each treated as the table of terms says.

Honoured functions that neither move the arm nor switch outputs run in the simulated controller,
which computes their values. Functions that are left out also run there, so that wrong arguments
are found, unless they take time; socket functions run there even if they take time.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
import functools
import inspect
from typing import Any

from ur_cartesian_driver.importing.import_format import Term, Treatment
from ur_cartesian_driver.importing.script.collected_events import CollectedEvents, Steps
from ur_cartesian_driver.importing.script.move_functions import MoveFunctions
from ur_cartesian_driver.importing.script.output_functions import OutputFunctions
from ur_cartesian_driver.importing.script.running_script import MAIN, RunningScript
from ur_cartesian_driver.importing.script.script_layout import END_OF_ROUND, PAUSE, WAIT
from ur_cartesian_driver.importing.script.script_terms import FUNCTIONS, TERMS
from ur_cartesian_driver.motion.geometry.pose import IDENTITY, Pose
from ur_cartesian_driver.sim.builtins import controller_builtins
from ur_cartesian_driver.sim.builtins.arguments import script_pose, six
from ur_cartesian_driver.sim.controller import Controller
from ur_cartesian_driver.sim.sockets.script_sockets import SocketState
from ur_cartesian_driver.urscript import (
    Builtin,
    RemoteObject,
    RuntimeException,
    ScriptPose,
    ThreadHandle,
    to_text,
    Value,
)

#: After this many cycles without an event, no more events are expected from other threads.
QUIET_CYCLES = 500
#: The functions that return the pose of the TCP, and of the flange.
_TCP_POSES = (
    'get_actual_tcp_pose',
    'get_target_tcp_pose',
    'get_target_tcp_pose_along_path',
    'get_target_waypoint',
    'tool_pose',
)
_FLANGE_POSE = 'get_actual_tool_flange_pose'
#: The functions that also read the joints.
_OF_JOINTS = (
    *('get_actual_joint_positions', 'get_target_joint_positions', 'get_joint_positions'),
    *('get_forward_kin', 'get_inverse_kin', 'get_inverse_kin_has_solution'),
    *('is_within_safety_limits', 'get_jacobian', 'get_jacobian_time_derivative'),
)
_READERS = (*_TCP_POSES, _FLANGE_POSE, *_OF_JOINTS)


class NoPeer:
    """Sockets whose peer accepts all data, and hangs up when the program reads."""

    def __init__(self) -> None:
        """Begin without sockets."""
        self._open: set[str] = set()

    def open(self, name: str, address: str, port: int) -> None:
        """Open a socket that looks connected to the program."""
        self._open.add(name)

    def state(self, name: str) -> SocketState:
        """Return OPEN until the program reads from the socket, then CLOSED."""
        return SocketState.OPEN if name in self._open else SocketState.CLOSED

    def received(self, name: str) -> bytearray:
        """Return no data and close the socket, so that the read ends at once."""
        self._open.discard(name)
        return bytearray()

    def send(self, name: str, data: bytes) -> bool:
        """Accept all data."""
        return True

    def close(self, name: str) -> None:
        """Close a socket."""
        self._open.discard(name)

    close_all = poll = lambda self: None


class _NoServer(RemoteObject):
    """A server whose procedures return nothing."""

    def __init__(self, run: RunningScript) -> None:
        self._run = run

    def call(self, method: str, arguments: Sequence[Value]) -> Value:
        """Return nothing, and remark that the call is left out."""
        self._run.leave_out(f'{method}()', TERMS['rpc_factory'].reason)
        return None


class ProgramFunctions:
    """The functions of one program."""

    def __init__(self, events: CollectedEvents, controller: Controller) -> None:
        """Collect points, outputs and waits into ``events``."""
        self._events, self._controller = events, controller
        self._run, self._place = events.run, events.place

    def by_name(self) -> Mapping[str, Builtin]:
        """Return all functions by name."""
        own: dict[str, Any] = {
            **dict.fromkeys(_TCP_POSES, self._tcp_pose),
            _FLANGE_POSE: self._flange_pose,
            'set_tcp': self._set_tcp,
            **dict.fromkeys(
                ('rpc_factory', 'eip_reader_factory', 'eip_writer_factory'), self._server
            ),
        }
        computed = controller_builtins(self._controller)
        outputs = OutputFunctions(self._events, self._controller)
        groups = MoveFunctions(self._events), outputs
        found: dict[str, Any] = {
            END_OF_ROUND: self._end_of_round,
            WAIT: outputs.wait_for_input,
            PAUSE: functools.partial(self._leave_out, TERMS['pause']),
        }
        for name, term in FUNCTIONS.items():
            collected = (getattr(group, name) for group in groups if hasattr(group, name))
            does = next(collected, None) or own.get(name) or computed.get(name) or _nothing
            found[name] = self._treated(term, does)
        return found

    def _treated(self, term: Term, does: Any) -> Any:
        if term.treatment is Treatment.HONOURED:
            return self._reader(term.name, does) if term.name in _READERS else does

        @functools.wraps(does)
        def plain(*values: Value, **named: Value) -> Any:
            if term.treatment is Treatment.REFUSED:
                raise RuntimeException(f'{term.name}(): {term.reason}')
            self._leave_out(term)
            return does(*values, **named)

        @functools.wraps(does)
        def timed(*values: Value, **named: Value) -> Any:
            plain(*values, **named)
            yield
            return None

        @functools.wraps(does)
        def answered(*values: Value, **named: Value) -> Any:
            return (yield from plain(*values, **named))

        if not inspect.isgeneratorfunction(does):
            return plain
        return answered if term.name.startswith('socket_') else timed

    def _leave_out(self, term: Term) -> None:
        name = f'{term.name}()' if term.name in FUNCTIONS else term.name
        self._run.leave_out(name, term.reason)

    def _server(self, *_: Value) -> RemoteObject:
        return _NoServer(self._run)

    # ---- the arm -------------------------------------------------------------------------------

    def _reader(self, name: str, does: Any) -> Any:
        """Wrap a function so that it first reports an assumed position of the arm."""
        place, of_joints, signature = self._place, name in _OF_JOINTS, inspect.signature(does)

        @functools.wraps(does)
        def read(*values: Value, **named: Value) -> Any:
            given = signature.bind(*values, **named).arguments
            if not given.keys() & {'q', 'qnear', 'qNear'}:
                place.assumption(lambda why: self._run.say(f'{name}()', why), of_joints=of_joints)
                if of_joints:
                    place.joints()
            elif name == 'get_forward_kin':
                self._run.say('joint positions', place.of_arm(place.tcp))
            try:
                value = does(*values, **named)
            except RuntimeException as error:
                if 'cannot reach' not in error.text:
                    raise
                pose = to_text(given['x'])
                raise RuntimeException(f'{name}(): {place.unreachable(pose)}') from None
            if name == 'get_inverse_kin':
                place.solutions.add(tuple(value))
            return value

        return read

    def _tcp_pose(self) -> ScriptPose:
        return script_pose(self._place.pose)

    def _flange_pose(self) -> ScriptPose:
        return script_pose(self._place.pose @ self._place.tcp.inverse())

    def _set_tcp(self, pose: Value, tcp_name: Value = '') -> None:
        """Change the TCP, and keep the line for a remark: the robot must have the same TCP."""
        offset = (
            Pose.from_rotation_vector(six(pose, 'pose')) if any(six(pose, 'pose')) else IDENTITY
        )
        if offset != self._place.tcp:
            self._place.set_tcps[offset] = self._run.line, to_text(pose)
        self._controller.motion.T_flange_tcp = offset

    # ---- loops without an end ------------------------------------------------------------------

    def _end_of_round(self) -> Steps:
        """End the program, or the thread that moved last, after one round of an endless loop."""
        run, events = self._run, self._events
        interpreter = run.interpreter
        assert interpreter is not None
        if run.thread == MAIN or events.is_mover:
            run.say('while', 'only the first round of this endless loop is taken')
        if run.thread == MAIN:
            count, quiet = len(events), 0
            while interpreter.threads > 1 and quiet < QUIET_CYCLES:
                yield
                count, quiet = len(events), quiet + 1 if len(events) == count else 0
            interpreter.stop()
            yield
        elif events.is_mover:
            interpreter.kill(ThreadHandle(run.thread))


def _nothing(*values: Value, **named: Value) -> Value:
    """Do nothing, in place of a function that the simulated controller does not have."""
    return None
