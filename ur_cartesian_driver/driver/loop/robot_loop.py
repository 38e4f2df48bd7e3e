# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The robot loop: the asyncio loop that owns the sockets to the robot and runs the current goal.

Its owner is the driver that started it. The loop normally has a process of its own, and never
imports ROS: receiving a goal of 100,000 points holds the owner's interpreter lock for seconds, and
the robot must get its messages on time meanwhile. The loop can also run in a thread of the owner.
A pipe for messages and shared memory for the newest robot state connect it to the owner, see
:mod:`~ur_cartesian_driver.driver.loop.loop_host`.

When the pipe closes, the loop closes its sockets, and the robot program stops the arm and ends.
When the owner has sent nothing for ``node_timeout``, the loop cancels the running goal.
"""

from __future__ import annotations

import asyncio
from collections.abc import Coroutine
import logging
import socket

from ur_cartesian_driver.driver.ipc.channel import (
    AppendToMotion,
    CallRobot,
    CancelMotion,
    Configure,
    GeometryReceived,
    LENGTH,
    LimitsReceived,
    LoopHeartbeat,
    Notification,
    OwnerHeartbeat,
    refusal_of,
    Request,
    ResendProgram,
    SetFeedOverride,
    SetLiveTarget,
    SetPathOffset,
    Shutdown,
    SignalsChanged,
    StartMotion,
    StatusChanged,
    unpack,
    Unreadable,
)
from ur_cartesian_driver.driver.ipc.state_memory import StateMemory
from ur_cartesian_driver.driver.loop.call_runner import CallRunner
from ur_cartesian_driver.driver.loop.motion_runner import MotionRunner, run_in_thread_if_large
from ur_cartesian_driver.driver.loop.newest_state import NewestState
from ur_cartesian_driver.driver.loop.owner_pipe import OwnerPipe
from ur_cartesian_driver.driver.loop.tcp_restorer import TcpRestorer
from ur_cartesian_driver.execution.goal.temporary_tcp import TemporaryTcp
from ur_cartesian_driver.motion.events import CancelRequested, Tick
from ur_cartesian_driver.motion.state.io_signals import Signals
from ur_cartesian_driver.robot.connection_status import ConnectionStatus, LinkGaps
from ur_cartesian_driver.robot.lifecycle import ConnectionState
from ur_cartesian_driver.robot.link import LinkCallbacks, RobotLink
from ur_cartesian_driver.robot.services.dashboard_service import DashboardPorts
from ur_cartesian_driver.robot.services.service_calls import DashboardCall
from ur_cartesian_driver.robot.services.service_dispatcher import ServiceDispatcher

#: Period of the ticks, at which the machine of the running goal checks its deadlines [s].
TICK_PERIOD = 0.02
#: Period of the heartbeats to the owner [s].
HEARTBEAT_PERIOD = 0.5


class RobotLoop:
    """Connects the link to the robot, the running motion, and the pipe to the owner."""

    def __init__(
        self, configure: Configure, memory: StateMemory, notify: asyncio.StreamWriter
    ) -> None:
        """
        Create the parts of the loop; :meth:`run` connects to the robot.

        :param memory: the memory in which the owner reads the newest robot state.
        :param notify: the pipe, for notifications to the owner.
        """
        self._config = config = configure.config
        self._newest = NewestState(memory, lambda state: self._motion.record_state(state))
        self._pipe = OwnerPipe(notify, self._newest.publish)
        self._link = RobotLink(
            config,
            LinkCallbacks(
                state=self._newest.keep,
                event=lambda event: self._motion.handle_event(event),
                status=self._status_changed,
                geometry=lambda dh: self._pipe.send(GeometryReceived(geometry=dh)),
                limits=lambda limits: self._pipe.send(LimitsReceived(limits=limits)),
                signals=self._signals_changed,
                log=self._pipe.log,
            ),
            may_upload=configure.may_upload,
        )
        self._dispatcher = ServiceDispatcher(
            config,
            DashboardPorts(dashboard=config.dashboard_port, robot_api=config.robot_api_port),
            self._link,
        )
        self._tasks: set[asyncio.Task[None]] = set()
        self._calls = CallRunner(self._dispatcher, self._pipe, self._spawn)
        self._tcp_restorer = TcpRestorer(self._link, self._pipe)
        self._motion = MotionRunner(
            config,
            self._link,
            self._newest,
            self._pipe,
            self._tcp_restorer,
            spawn=self._spawn,
            is_changing_settings=lambda: self._dispatcher.is_changing_settings,
        )
        self._status = self._link.status
        self._last_heartbeat = 0.0
        if (tcp := configure.temporary_tcp) is not None:
            self._tcp_restorer.restore_later(
                TemporaryTcp(tcp.T_flange_original, tcp.T_flange_temporary)
            )

    async def run(self, requests: asyncio.StreamReader) -> None:
        """Serve until the owner sends :class:`Shutdown` or the pipe closes."""
        self._last_heartbeat = self._now()
        try:
            async with asyncio.TaskGroup() as tasks:
                link = tasks.create_task(self._link.run())
                ticks = tasks.create_task(self._tick())
                try:
                    await self._serve_requests(requests)
                finally:
                    self._motion.close()
                    # The TCP can be restored only while the link is open. Our robot program would
                    # also restore it by itself, but another program may be running.
                    self._tcp_restorer.restore_if_due(self._newest.latest)
                for task in (link, ticks, *self._tasks):
                    task.cancel()
        finally:
            self._link.close()
            self._newest.clear()
            self._motion.close_recorder()  # last: the arm must not wait for a disk

    # ---- the owner ----------------------------------------------------------------------------

    async def _serve_requests(self, requests: asyncio.StreamReader) -> None:
        """Handle requests until the owner shuts the loop down or the pipe closes."""
        while True:
            try:
                (size,) = LENGTH.unpack(await requests.readexactly(LENGTH.size))
                body = await requests.readexactly(size)
            except (asyncio.IncompleteReadError, ConnectionError):
                return
            try:
                request = await run_in_thread_if_large(size, unpack, body)
            except Unreadable as error:
                self._refuse(error.refusal, f'a request cannot be read: {error}')
                continue
            if isinstance(request, Shutdown):
                return
            try:
                await self._handle_request(request)
            except Exception as error:  # no request of the owner must end the loop
                reason = f'{type(error).__name__}: {error}'
                text = f'The request cannot be carried out ({reason.rstrip(".")}).'
                self._refuse(refusal_of(request, text), f'{type(request).__name__}: {text}')

    def _refuse(self, refusal: Notification | None, line: str) -> None:
        """Log a line; send the owner a refusal, unless it is None: then no answer is expected."""
        self._pipe.log(logging.ERROR, line)
        if refusal is not None:
            self._pipe.send(refusal)

    async def _handle_request(self, request: Request | Notification) -> None:
        """Carry out a request."""
        self._last_heartbeat = self._now()
        match request:
            case StartMotion():
                await self._motion.start(request)
            case AppendToMotion():
                await self._motion.append(request)
            case SetLiveTarget():
                self._motion.set_live_target(request)
            case SetPathOffset():
                self._motion.set_path_offset(request)
            case SetFeedOverride():
                self._motion.set_feed_override(request)
            case CancelMotion():
                self._motion.cancel(request)
            case ResendProgram():
                self._link.control.upload()
            case CallRobot():
                self._calls.start(request)
            case OwnerHeartbeat():
                pass
            case _:
                self._pipe.log(
                    logging.ERROR, f'{type(request).__name__} is no request to a robot loop'
                )

    async def _tick(self) -> None:
        """Send ticks and heartbeats; stop the arm if the owner is silent."""
        last_heartbeat = self._now()
        while True:
            await asyncio.sleep(TICK_PERIOD)
            self._motion.handle_event(Tick())
            self._link.check_age()
            if self._now() - last_heartbeat >= HEARTBEAT_PERIOD:
                last_heartbeat = self._now()
                self._send_heartbeat()
            if self._now() - self._last_heartbeat > self._config.node_timeout:
                self._last_heartbeat = self._now()
                self._stop_for_silent_owner()

    def _send_heartbeat(self) -> None:
        self._pipe.resend_signals()
        gaps = LinkGaps(
            reports=self._newest.take_gap(),
            keepalives=self._link.event_log.keepalive_gap(),
            state_age=self._newest.take_oldest(),
        )
        self._pipe.send(LoopHeartbeat(gaps=gaps))

    def _stop_for_silent_owner(self) -> None:
        if self._motion.is_running:
            reason = (
                'the owner of the driver was silent for longer than node_timeout = '
                f'{self._config.node_timeout:g} s'
            )
            self._pipe.log(logging.ERROR, f'{reason}: the arm is stopped')
            self._motion.handle_event(CancelRequested(reason=reason))

    # ---- the robot ----------------------------------------------------------------------------

    def _status_changed(self, status: ConnectionStatus) -> None:
        before, self._status = self._status, status
        if status.state is ConnectionState.DISCONNECTED:
            self._newest.clear()
        if status.program_running != before.program_running:
            self._tcp_restorer.retry_now()
        has_connected = (before.state, status.state) == (
            ConnectionState.CONNECTING,
            ConnectionState.CONNECTED,
        )
        if has_connected and not status.serial_number:
            self._spawn(self._ask_serial_number())
        self._pipe.send(StatusChanged(status=status))

    async def _ask_serial_number(self) -> None:
        """Ask the dashboard for the serial number, which not every robot reports."""
        answer = await self._dispatcher.dispatch(DashboardCall(command='get serial number'))
        if answer.ok:
            self._link.set_serial_number(answer.text)

    def _signals_changed(self, signals: Signals) -> None:
        self._motion.record_signals(signals)
        self._pipe.send(SignalsChanged(signals=signals))

    def _spawn(self, work: Coroutine[None, None, None]) -> None:
        task = asyncio.create_task(work)
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)

    def _now(self) -> float:
        return asyncio.get_running_loop().time()


async def serve(pipe: socket.socket, descriptor: int) -> None:
    """
    Run a robot loop until its owner ends it.

    :param pipe: our end of the pair of sockets; the first message on it is the configuration.
    :param descriptor: file descriptor of the memory that both ends share.
    """
    reader, writer = await asyncio.open_connection(sock=pipe)
    memory = StateMemory(descriptor)
    try:
        (size,) = LENGTH.unpack(await reader.readexactly(LENGTH.size))
        first = unpack(await reader.readexactly(size))
        if isinstance(first, Configure):
            await RobotLoop(first, memory, writer).run(reader)
        if not writer.is_closing():
            await writer.drain()
    except (asyncio.IncompleteReadError, ConnectionError):
        pass  # the owner is gone: no notification can be sent
    finally:
        writer.close()
        memory.close()
        # During this pause, connections that arrived at the last moment are accepted and closed.
        await asyncio.sleep(0.01)
