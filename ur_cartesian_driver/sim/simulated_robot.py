# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
A simulated robot that listens on the ports of a real one.

One thread runs one event loop with the controller's cycle and the servers, so no locks are needed.
Calls from other threads are carried out between two cycles.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from concurrent.futures import Future
import contextlib
from dataclasses import dataclass
import threading
from typing import Any, TypeVar

from ur_cartesian_driver.motion.geometry.pose import Pose
from ur_cartesian_driver.motion.geometry.vectors import Vector6
from ur_cartesian_driver.motion.state.rtde_state import RobotMode, RuntimeState, SafetyMode
from ur_cartesian_driver.sim.clock import Clock, Lateness, RealClock, VirtualClock
from ur_cartesian_driver.sim.controller import Controller, POLYSCOPE_X
from ur_cartesian_driver.sim.controller_assembly import assemble
from ur_cartesian_driver.sim.faults.fault_parser import parse_fault
from ur_cartesian_driver.sim.faults.fault_values import Fault
from ur_cartesian_driver.sim.faults.impaired_sockets import ImpairedSockets
from ur_cartesian_driver.sim.interfaces.dashboard_session import DashboardSession
from ur_cartesian_driver.sim.interfaces.interpreter_session import InterpreterSession
from ur_cartesian_driver.sim.interfaces.primary_session import (
    PrimarySession,
    ReadOnlySession,
    ScriptSession,
)
from ur_cartesian_driver.sim.interfaces.primary_stream import PrimaryStream, version_frame
from ur_cartesian_driver.sim.interfaces.realtime_stream import RealtimeStream
from ur_cartesian_driver.sim.interfaces.robot_api_session import FIRST_VERSION, RobotApiSession
from ur_cartesian_driver.sim.interfaces.rtde_session import RtdeSession
from ur_cartesian_driver.sim.interfaces.tcp_server import TcpServer
from ur_cartesian_driver.sim.pendant_programs.script_requests import ScriptRequests
from ur_cartesian_driver.sim.programs.compile_thread import CompileThread
from ur_cartesian_driver.sim.programs.program_runner import compile_at_once
from ur_cartesian_driver.sim.simulator_config import SimulatorConfig
from ur_cartesian_driver.sim.sockets.script_sockets import ScriptSockets
from ur_cartesian_driver.sim.sockets.tcp_script_sockets import TcpScriptSockets
from ur_cartesian_driver.sim.state.power_and_safety import SafetyEvent

T = TypeVar('T')

# Longest wait for a call between two cycles, and for the compilation of a program [s].
_CALL_TIMEOUT = 10.0
_COMPILE_TIMEOUT = 120.0
#: Port of a read-only interface (such as 30011), minus the port of the interface that sends the
#: same data and also accepts scripts (30001).
READ_ONLY_DISTANCE = 10


@dataclass(frozen=True, slots=True, kw_only=True)
class Ports:
    """The ports on which the servers of a robot listen."""

    rtde: int
    primary: int
    #: 0 for PolyScope X, which has no dashboard.
    dashboard: int
    secondary: int
    realtime: int
    interpreter: int
    #: Port of the Robot API of PolyScope X from 10.11 on; 0 for other software.
    robot_api: int = 0


@dataclass(frozen=True, slots=True, kw_only=True)
class RobotSnapshot:
    """The state of the simulated robot after a cycle; joints and poses are target values."""

    timestamp: float
    q: Vector6
    qd: Vector6
    T_base_tcp: Pose
    T_flange_tcp: Pose
    robot_mode: RobotMode
    safety_mode: SafetyMode
    runtime_state: RuntimeState
    program: str
    speed_slider: float
    speed_scaling: float
    digital_outputs: int
    #: Texts that programs wrote (`textmsg`), and texts of errors; newest last.
    messages: tuple[str, ...]
    popups: tuple[str, ...]


class SimulatedRobot:
    """
    A simulated robot as a context manager: inside the ``with`` block, all ports listen.

    ::

        with SimulatedRobot(SimulatorConfig(rtde_port=0, primary_port=0, dashboard_port=0)) as ur:
            connect_to(ur.ports.rtde)
    """

    def __init__(
        self,
        config: SimulatorConfig | None = None,
        *,
        sockets: ScriptSockets | None = None,
        clock: Clock | None = None,
    ) -> None:
        """
        Make a robot; it runs from `start` to `close`, or during `run`.

        :param sockets: the sockets that programs can open; None = TCP sockets.
        :param clock: the clock for the cycles; None = a clock with the rate of the configuration.
        :raises UnloadableProgram: the program that the configuration names cannot be loaded.
        :raises ValueError: the text of a fault in the configuration is not understood.
        """
        self.config = config or SimulatorConfig()
        #: The error that has ended the thread; None = no error.
        self._failure: Exception | None = None
        self._loop: asyncio.AbstractEventLoop | None = None
        #: Called in the robot's thread when a socket of a program has received bytes, with the
        #: port of the peer and the bytes as arguments.
        self.on_socket_data: Callable[[int, bytes], None] | None = None
        impaired = ImpairedSockets(
            sockets or TcpScriptSockets(self._on_socket_data, self.config.host)
        )
        self.controller, self._faults = assemble(self.config, impaired)
        taken_inputs: set[str] = set()
        self._rtde = TcpServer('RTDE', lambda: RtdeSession(self.controller, taken_inputs))
        self._primary = TcpServer('primary', lambda: PrimarySession(self.controller))
        self._secondary = TcpServer('secondary', lambda: PrimarySession(self.controller))
        self._realtime = TcpServer('real-time', lambda: ScriptSession(self.controller))
        self._dashboard = TcpServer('dashboard', lambda: DashboardSession(self.controller))
        self._interpreter = TcpServer('interpreter', lambda: InterpreterSession(self.controller))
        self._robot_api = TcpServer('robot-api', lambda: RobotApiSession(self.controller))
        #: Script interface -> its read-only twin, which sends the same data.
        self._read_only: dict[TcpServer[Any], TcpServer[Any]] = {
            self._primary: self._read_only_twin('primary', version_frame),
            self._secondary: self._read_only_twin('secondary', version_frame),
            self._realtime: self._read_only_twin('real-time', lambda _: b''),
        }
        self._servers: tuple[TcpServer[Any], ...] = (
            self._rtde,
            self._primary,
            self._secondary,
            self._realtime,
            self._dashboard,
            self._interpreter,
            self._robot_api,
        )
        self._faults.interfaces = {'sockets': impaired} | {
            server.name.lower().replace('-', ''): server for server in self._servers
        }
        self.inject(*self.config.faults)
        self._clock: Clock = clock or (
            RealClock(self.config.cycle, self.config.rate, self.config.when_late)
            if self.config.rate > 0.0
            else VirtualClock()
        )
        self._thread: threading.Thread | None = None
        self._running: asyncio.Task[None] | None = None
        self._ports: Ports | None = None
        self._compiler: CompileThread | None = None
        self._script_requests = ScriptRequests(
            self.config.external_control_host,
            self.config.external_control_port,
            self.controller.external_control.limits,
            self.config.host,
        )

    def _read_only_twin(
        self, name: str, greet: Callable[[Controller], bytes]
    ) -> TcpServer[ReadOnlySession]:
        return TcpServer(f'read-only {name}', lambda: ReadOnlySession(greet(self.controller)))

    # Start and end

    def start(self) -> SimulatedRobot:
        """
        Start the thread; return when all ports listen.

        :raises OSError: a port is taken.
        """
        listening: Future[None] = Future()
        self._failure = None
        self._thread = threading.Thread(
            target=self._run_thread, args=(listening,), name='ur-sim', daemon=True
        )
        self._thread.start()
        try:
            listening.result()
        except BaseException:
            self.close()
            raise
        return self

    def close(self) -> None:
        """Disconnect all clients and end the thread; a second call does nothing."""
        thread, self._thread = self._thread, None
        if thread is None:
            return
        if self._loop is not None and self._running is not None:
            with contextlib.suppress(RuntimeError):  # the loop has just ended by itself
                self._loop.call_soon_threadsafe(self._running.cancel)
        thread.join()

    def __enter__(self) -> SimulatedRobot:
        """Start."""
        return self.start()

    def __exit__(self, *_: object) -> None:
        """Close."""
        self.close()

    def _run_thread(self, listening: Future[None]) -> None:
        try:
            asyncio.run(self._serve(listening))
        except asyncio.CancelledError:
            pass
        except Exception as error:
            if listening.done():
                self._failure = error
                raise
            listening.set_exception(error)

    async def run(self, on_listening: Callable[[], None] | None = None) -> None:
        """
        Serve on the running event loop until cancelled.

        :param on_listening: called when all ports listen.
        :raises OSError: a port is taken.
        """
        listening: Future[None] = Future()
        if on_listening is not None:
            listening.add_done_callback(lambda _: on_listening())
        await self._serve(listening)

    async def _serve(self, listening: Future[None]) -> None:
        self._loop, self._running = asyncio.get_running_loop(), asyncio.current_task()
        try:
            await self._listen()
            if isinstance(self._clock, RealClock | VirtualClock):
                self._compiler = CompileThread(self._loop)
                self.controller.programs.compile_aside = self._compiler.compile
            self.controller.external_control.request = self._script_requests.request
            listening.set_result(None)
            await self._cycles()
        finally:
            self._loop = None
            await self._script_requests.close()
            if self._compiler is not None:
                self._compiler.close()
                self.controller.programs.compile_aside = compile_at_once
            self._ports = None
            self.controller.sockets.close_all()
            for server in (*self._servers, *self._read_only.values()):
                await server.close()
            # Leave time to accept and disconnect clients that connected at the last moment.
            await asyncio.sleep(0.01)

    async def _listen(self) -> None:
        host, config = self.config.host, self.config
        await self._rtde.listen(host, config.rtde_port)
        await self._primary.listen(host, config.primary_port)
        dashboard = 0
        if config.version[0] < POLYSCOPE_X:
            await self._dashboard.listen(host, config.dashboard_port)
            dashboard = self._dashboard.port
        robot_api = 0
        if config.version[:2] >= FIRST_VERSION:
            await self._robot_api.listen(host, config.listening_robot_api_port)
            robot_api = self._robot_api.port
        await self._secondary.listen(host, config.listening_secondary_port)
        await self._realtime.listen(host, config.listening_realtime_port)
        await self._interpreter.listen(host, config.listening_interpreter_port)
        if config.has_standard_ports:
            for server, twin in self._read_only.items():
                await twin.listen(host, server.port + READ_ONLY_DISTANCE)
        self._ports = Ports(
            rtde=self._rtde.port,
            primary=self._primary.port,
            dashboard=dashboard,
            secondary=self._secondary.port,
            realtime=self._realtime.port,
            interpreter=self._interpreter.port,
            robot_api=robot_api,
        )

    async def _cycles(self) -> None:
        stream, realtime = PrimaryStream(self.controller), RealtimeStream(self.controller)
        took_scripts = self.controller.takes_scripts
        primary, secondary, packet_servers = self._read_only.items()
        state_servers = (*primary, *secondary)
        while True:
            await self._clock.next_cycle()
            if self._compiler is not None and isinstance(self._clock, VirtualClock):
                # Wait for the compiler, so that runs are repeatable: otherwise programs would
                # start in later cycles on a slow computer.
                await self._compiler.wait_until_idle()
            self.controller.skipped_time = self._clock.skipped
            self.controller.step()
            if took_scripts and not self.controller.takes_scripts:
                for server in self._read_only:
                    server.drop()
            took_scripts = self.controller.takes_scripts
            for session, connection in self._rtde.session_connections:
                for package in session.packages():
                    connection.write(package)
            for client, client_connection in self._interpreter.session_connections:
                client_connection.write(client.answers())
            for _, dashboard_client in self._dashboard.session_connections:
                dashboard_client.poll()
            for _, api_client in self._robot_api.session_connections:
                api_client.poll()
            for message in stream.messages():
                for server in primary:
                    server.broadcast(message)
            if stream.is_due() and any(server.connections for server in state_servers):
                state = stream.state()
                for server in state_servers:
                    server.broadcast_state(state)
            if any(server.connections for server in packet_servers):
                packet = realtime.packet()
                for server in packet_servers:
                    server.broadcast_state(packet)

    def _on_socket_data(self, port: int, data: bytes) -> None:
        if self.on_socket_data is not None:
            self.on_socket_data(port, data)

    # Calls from any thread

    def call(self, function: Callable[[Controller], T]) -> T:
        """
        Call a function with the controller, between two cycles; return its result.

        An exception of the function is raised here.

        While the robot does not run, the function is called at once.

        :raises TimeoutError: the robot's thread did not call the function within 10 s.
        :raises RuntimeError: the robot's thread was ended by an error.
        """
        if self._failure is not None:
            raise RuntimeError('The simulated robot was ended by an error.') from self._failure
        loop = self._loop
        if loop is None or _is_running_in(loop):
            return function(self.controller)
        future: Future[T] = Future()

        def carry_out() -> None:
            try:
                future.set_result(function(self.controller))
            except Exception as error:
                future.set_exception(error)

        loop.call_soon_threadsafe(carry_out)
        return future.result(_CALL_TIMEOUT)

    @property
    def ports(self) -> Ports:
        """
        The ports on which the servers listen.

        :raises RuntimeError: the robot has not been started.
        """
        if self._ports is None:
            raise RuntimeError('The simulated robot is not listening yet: start it first.')
        return self._ports

    def state(self) -> RobotSnapshot:
        """Return a snapshot of the robot."""
        return self.call(_snapshot)

    def inject(self, *faults: Fault | str) -> None:
        """
        Add faults, given as values or as texts; each takes effect when its trigger occurs.

        :raises ValueError: a text is not understood, or the robot has no such interface.
        """
        parsed = [parse_fault(f) if isinstance(f, str) else f for f in faults]
        self.call(lambda _: self._faults.add(*parsed))

    def clear_faults(self) -> None:
        """Remove the faults that have not taken effect yet, and end those that last."""
        self.call(lambda _: self._faults.clear())

    def set_speed_slider(self, fraction: float) -> None:
        """Move the speed slider, 0..1."""
        self.call(lambda controller: controller.set_slider(fraction))

    def protective_stop(self) -> None:
        """Trigger a protective stop, as if the arm had hit something."""
        self._safety(SafetyEvent.PROTECTIVE_STOP)

    def unlock_protective_stop(self) -> None:
        """
        Unlock the protective stop, as at the pendant.

        :raises RuntimeError: there is no protective stop, or the delay that it requires is not
            over.
        """
        self._safety(SafetyEvent.UNLOCK)

    def emergency_stop(self) -> None:
        """Press the emergency stop button."""
        self._safety(SafetyEvent.EMERGENCY_STOP)

    def release_emergency_stop(self) -> None:
        """
        Release the emergency stop button; the arm stays without power.

        :raises RuntimeError: the button is not pressed.
        """
        self._safety(SafetyEvent.RELEASE)

    def stop_program(self) -> None:
        """Stop the program, as at the pendant."""
        self.call(lambda controller: controller.programs.stop())

    def pause_program(self) -> None:
        """
        Pause the program, as at the pendant; the arm stops on its path.

        :raises RuntimeError: no program is playing.
        """
        self._checked(lambda controller: controller.programs.pause())

    def play_program(self) -> None:
        """
        Resume the paused program, or start the loaded one.

        :raises RuntimeError: there is no program, or the robot cannot run one.
        """
        self._checked(lambda controller: controller.programs.play())

    def run_script(self, text: str) -> None:
        """
        Start a program as if a client had sent it; return when it is compiled.

        In the thread of the robot's own event loop, the call returns at once.
        """
        compiled: Future[None] = Future()

        def submit(controller: Controller) -> None:
            controller.programs.submit(text)
            controller.programs.compile_aside(lambda: None, compiled.set_result)

        self.call(submit)
        if self._loop is not None and not _is_running_in(self._loop):
            compiled.result(_COMPILE_TIMEOUT)

    def close_popups(self) -> None:
        """Close all popups, as if the person at the pendant confirmed them."""
        self.call(lambda controller: controller.close_popups())

    def answer(self, *answers: object) -> None:
        """
        Type answers into the windows of the pendant that request values.

        Requests get the answers in their order; the remaining answers are for later requests.

        :param answers: the typed answers: `yes` or `no` for a boolean, a number, or a text.
        """
        self.call(lambda controller: controller.pendant.answers.extend(map(str, answers)))

    def lateness(self) -> Lateness | None:
        """Return the lateness of the cycles; None for any clock other than the real clock."""
        clock = self._clock
        return self.call(lambda _: clock.lateness() if isinstance(clock, RealClock) else None)

    def _safety(self, event: SafetyEvent) -> None:
        self._checked(lambda controller: controller.safety_event(event))

    def _checked(self, function: Callable[[Controller], str]) -> None:
        refusal = self.call(function)
        if refusal:
            raise RuntimeError(f'The simulated robot refuses: {refusal}.')

    def status_line(self) -> str:
        """Return one line for a terminal: model, modes, program, clients, slider."""
        state = self.state()
        clients = ' '.join(f'{server.name} {len(server.connections)}' for server in self._servers)
        return (
            f'{self.config.model} | {state.robot_mode.name} {state.safety_mode.name} | '
            f'{state.runtime_state.name} {state.program or "no program"} | '
            f'clients: {clients} | speed {state.speed_slider:.0%}'
        )


def _is_running_in(loop: asyncio.AbstractEventLoop) -> bool:
    try:
        return asyncio.get_running_loop() is loop
    except RuntimeError:
        return False


def _snapshot(controller: Controller) -> RobotSnapshot:
    motion, programs = controller.motion, controller.programs
    return RobotSnapshot(
        timestamp=controller.timestamp,
        q=motion.q,
        qd=motion.qd,
        T_base_tcp=motion.T_base_tcp,
        T_flange_tcp=motion.T_flange_tcp,
        robot_mode=controller.power.mode,
        safety_mode=controller.safety.mode,
        runtime_state=programs.state,
        program=programs.name,
        speed_slider=controller.speed_slider,
        speed_scaling=controller.speed_scaling,
        digital_outputs=controller.io.digital_out.packed(),
        messages=tuple(controller.messages.log),
        popups=tuple(popup.text for popup in controller.popups),
    )
