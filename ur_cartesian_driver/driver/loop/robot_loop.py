# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The robot loop: one asyncio loop that owns the sockets and the machine of the running goal.

It never imports ROS. It runs in a process of its own, where nothing that the owner does (receiving
a goal of 100,000 points holds Python's interpreter lock for seconds) can delay a message that the
robot waits for, or in a thread; either way it is joined to its owner by one pipe for messages and
by shared memory for the newest robot state, see :mod:`~ur_cartesian_driver.driver.loop.host`.

When the pipe ends or the owner falls silent the arm is stopped: our sockets close, and the robot
program brakes and ends when they do.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Coroutine
from contextlib import suppress
from dataclasses import replace
from functools import partial
import logging
from math import inf
import socket
from typing import TypeVar

from ur_cartesian_driver.driver.ipc.channel import (
    AppendAnswered,
    AppendToMotion,
    CallAnswered,
    CallRobot,
    CancelMotion,
    Configure,
    GeometryReceived,
    LENGTH,
    LogMessage,
    LoopHeartbeat,
    MotionEnded,
    MotionProgress,
    Notification,
    OwnerHeartbeat,
    pack,
    Request,
    ResendProgram,
    ServoProgress,
    SetLiveTarget,
    Shutdown,
    SignalsChanged,
    StartMotion,
    StatusChanged,
    TemporaryTcpRestored,
    TemporaryTcpSet,
    unpack,
)
from ur_cartesian_driver.driver.ipc.state_memory import StateMemory
from ur_cartesian_driver.driver.loop.machine_factory import is_slow_to_make, make_machine
from ur_cartesian_driver.driver.loop.point_buffer import PointBuffer
from ur_cartesian_driver.driver.recordings.recorder import motion_metadata, Recorder
from ur_cartesian_driver.execution import (
    AnswerAppend,
    EnterServo,
    Finish,
    GoalCommand,
    GoalMachine,
    LeaveServo,
    LogWarning,
    MotionJob,
    OpenServo,
    ReportProgress,
    ReportServo,
    RestoreTcp,
    same_tcp,
    SendControl,
    SendPoints,
    SERVO_LINK,
    SetTemporaryTcp,
    StopProgram,
    TemporaryTcp,
    WriteServo,
)
from ur_cartesian_driver.kinematics.robot_models import DhTable
from ur_cartesian_driver.motion.errors import ErrorCode
from ur_cartesian_driver.motion.events import (
    CancelRequested,
    Event,
    LinkLost,
    Outcome,
    PreemptRequested,
    ServoReceived,
    StateReceived,
    Tick,
)
from ur_cartesian_driver.motion.pose import Pose
from ur_cartesian_driver.motion.signals import Signals
from ur_cartesian_driver.motion.state import RobotState
from ur_cartesian_driver.robot.driver_status import DriverStatus, LinkGaps
from ur_cartesian_driver.robot.lifecycle import ConnectionState
from ur_cartesian_driver.robot.link import RobotLink
from ur_cartesian_driver.robot.rtde.servo_connection import ServoConnection
from ur_cartesian_driver.robot.services.service_calls import DashboardCall, ServiceAnswer
from ur_cartesian_driver.robot.services.service_dispatcher import ServiceDispatcher

#: How often time alone is looked at [s].
TICK_PERIOD = 0.02
#: How often the owner hears that we live [s].
HEARTBEAT_PERIOD = 0.5
#: What takes longer than a few milliseconds to unpack or prepare [bytes].
MIN_THREAD_SIZE = 1 << 18
#: How a goal can end that wants an explanation beyond its sentence.
CODES_WITH_CAUSE = frozenset(
    {
        ErrorCode.PROTECTIVE_STOP,
        ErrorCode.EMERGENCY_STOP,
        ErrorCode.PROGRAM_STOPPED,
        ErrorCode.CONNECTION_LOST,
        ErrorCode.EXECUTION_FAILED,
    }
)
#: Of these the robot tells the reason, on another connection, in the same cycle or the next ones;
#: so long it is waited for [s].
CODES_WITH_LATE_CAUSE = frozenset({ErrorCode.PROTECTIVE_STOP, ErrorCode.EMERGENCY_STOP})
CAUSE_TIMEOUT = 0.05
#: How long the end waits until the recording of the last motion is a file [s].
RECORD_TIMEOUT = 1.0
#: How many calls are carried out at a time.
MAX_CALLS = 32
#: What is out of date soon is left out while so much waits for an owner that does not read
#: [bytes]: it may hang for days.
DROPPABLE = (LoopHeartbeat, LogMessage, MotionProgress, ServoProgress, SignalsChanged)
MAX_UNREAD = 1 << 20
T = TypeVar('T')


class RobotLoop:
    """Joins the link to the robot, the machine of the running goal and the pipe to the owner."""

    def __init__(
        self, configure: Configure, memory: StateMemory, notify: asyncio.StreamWriter
    ) -> None:
        """Prepare; :meth:`run` does the work."""
        self._config = config = configure.config
        self._memory = memory
        self._pipe = notify
        self._machine: GoalMachine | None = None
        self._motion = 0
        self._latest: RobotState | None = None
        #: Whether it is in the shared memory.
        self._is_published = True
        self._points = PointBuffer()
        #: The inputs of a motion that is streamed as set-points.
        self._servo: ServoConnection | None = None
        #: What is offered to the machine at this moment.
        self._pending_append: AppendToMotion | None = None
        #: The TCP that an ended goal had set, until it is back.
        self._temporary_tcp: TemporaryTcp | None = None
        self._last_heartbeat = 0.0
        self._link = RobotLink(
            config,
            on_state=self._keep_state,
            on_event=self._handle_event,
            on_status=self._status_changed,
            on_geometry=self._geometry_known,
            on_signals=self._signals_changed,
            on_log=self._log,
            may_upload=configure.may_upload,
        )
        self._recorder = Recorder(
            config.record_directory,
            config.record_max_size,
            partial(_call_soon, asyncio.get_running_loop(), self._log, logging.WARNING),
        )
        self._dispatcher = ServiceDispatcher(config, config.dashboard_port, self._link)
        self._calls: set[asyncio.Task[None]] = set()
        self._connection = ConnectionState.DISCONNECTED
        self._program_running = False
        self._last_report = inf
        self._longest_gap = 0.0
        #: The newest inputs and outputs, if the owner did not read when they were to be told.
        self._withheld_signals: SignalsChanged | None = None
        #: The end of a motion, until its reason is there.
        self._pending_end: MotionEnded | None = None
        if configure.temporary_tcp is not None:
            self._restore_tcp_later(
                TemporaryTcp(
                    configure.temporary_tcp.T_flange_original,
                    configure.temporary_tcp.T_flange_temporary,
                )
            )

    async def run(self, requests: asyncio.StreamReader) -> None:
        """Serve until the owner shuts down, hangs up or falls silent."""
        self._last_heartbeat = asyncio.get_running_loop().time()
        try:
            async with asyncio.TaskGroup() as tasks:
                link = tasks.create_task(self._link.run())
                ticks = tasks.create_task(self._tick())
                await self._serve_requests(requests)
                for task in (link, ticks, *self._calls):
                    task.cancel()
        finally:
            self._end_motion('The driver was shut down.')
            self._send_pending_end()
            if (
                self._temporary_tcp is not None
                and self._latest is not None
                and self._temporary_tcp.is_restore_due(self._latest, self._now())
            ):
                # Ours does it by itself, but this may be another robot program.
                self._link.restore_tcp(self._temporary_tcp.T_flange_original)
            self._link.close()
            self._memory.clear()
            self._recorder.close(RECORD_TIMEOUT)  # the arm must not wait for a disk

    async def _serve_requests(self, requests: asyncio.StreamReader) -> None:
        """Handle requests until there are no more."""
        while True:
            try:
                (size,) = LENGTH.unpack(await requests.readexactly(LENGTH.size))
                body = await requests.readexactly(size)
            except (asyncio.IncompleteReadError, ConnectionError):
                return
            request = await _run_in_thread_if_large(size, unpack, body)
            if isinstance(request, Shutdown) or not await self._handle_request(request):
                return

    async def _handle_request(self, request: Request | Notification) -> bool:
        """Carry out a request; False for one that makes no sense here."""
        self._last_heartbeat = self._now()
        match request:
            case StartMotion():
                await self._start(request)
            case AppendToMotion():
                self._append(request)
            case SetLiveTarget(motion=motion, T_base_tcp=T_base_tcp, age=age):
                if motion == self._motion and self._machine is not None:
                    self._machine.feeder.set_target(T_base_tcp, age, self._now())
            case CancelMotion(motion=motion, preempted_by=by):
                if motion == self._motion:
                    self._recorder.add_event('cancel', by and f'preempted by {by}')
                    self._handle_event(PreemptRequested(by=by) if by else CancelRequested())
            case ResendProgram():
                self._link.upload_program()
            case CallRobot():
                self._call(request)
            case OwnerHeartbeat():
                pass
            case _:
                return False
        return True

    async def _start(self, request: StartMotion) -> None:
        """Start a motion, or refuse it with the reason."""
        machine = await _run_in_thread_if_large(
            MIN_THREAD_SIZE if is_slow_to_make(request) else len(request.points),
            make_machine,
            request,
            self._config,
        )
        reason = self._link.not_ready()
        if self._machine is not None or self._pending_end is not None:
            reason = 'Another motion is running; wait for its end or cancel it.'
        elif self._dispatcher.is_changing_settings:
            reason = 'TCP or payload are being set at this moment; send the goal again.'
        elif not reason:
            reason = self._tcp_changed(request.job)
        if reason:
            self._send(
                MotionEnded(
                    motion=request.motion,
                    outcome=Outcome(code=ErrorCode.ROBOT_NOT_READY, text=reason),
                )
            )
            return
        self._motion, self._points = request.motion, PointBuffer(request.points)
        self._machine = machine
        self._link.set_executing(True)
        assert self._latest is not None  # else the link is not ready
        self._record(request)
        self._execute_commands(machine.start(self._latest))

    def _append(self, request: AppendToMotion) -> None:
        """Offer points to the motion that runs, if it is theirs."""
        if request.motion == self._motion and self._machine is not None:
            self._pending_append = request
            self._execute_commands(self._machine.step(request.append_job, self._now()))
        else:
            self._send(
                AppendAnswered(
                    motion=request.motion,
                    answer=AnswerAppend(
                        number=request.append_job.number, refusal='The goal has ended.'
                    ),
                )
            )

    def _answer_append(self, answer: AnswerAppend) -> None:
        """Keep the points that the machine has taken, and tell their owner."""
        pending, self._pending_append = self._pending_append, None
        assert pending is not None
        if not answer.refusal and pending.points:
            self._points.put(pending.append_job.records_before, pending.points)
            if pending.append_job.job is not None and self._machine is not None:
                self._recorder.add_plan(
                    pending.append_job.job.reference,
                    self._machine.end_time_of(pending.append_job.records_before),
                )
        self._send(AppendAnswered(motion=self._motion, answer=answer))

    def _tcp_changed(self, job: MotionJob) -> str:
        """Return that the plan was made for another TCP than the robot has; empty if not."""
        state = self._latest
        if state is None or same_tcp(state.T_flange_tcp, job.T_flange_active):
            return ''
        return (
            'The TCP of the robot was changed after the goal had been planned; send the goal '
            'again.'
        )

    def _record(self, request: StartMotion) -> None:
        """Begin the recording of a motion, where motions are recorded."""
        if not self._config.record_directory or self._latest is None:
            return
        status = self._link.status
        mode = (
            'LIVE_TARGETS'
            if request.live is not None
            else 'FREEDRIVE'
            if request.freedrive
            else ''
        )
        self._recorder.start(
            request.job,
            motion_metadata(
                request.job,
                plan_metadata_json=request.plan_metadata,
                parameters=self._config,
                mode=mode,
                robot={
                    'model': status.robot_model,
                    'polyscope_version': status.polyscope_version,
                    'serial_number': status.serial_number,
                },
            ),
            self._latest,
        )

    def _signals_changed(self, signals: Signals) -> None:
        self._recorder.add_signals(signals)
        self._send(SignalsChanged(signals=signals))

    # ---- calls --------------------------------------------------------------------------------

    def _call(self, request: CallRobot) -> None:
        """Carry out a call beside everything else."""
        if len(self._calls) < MAX_CALLS:
            self._spawn(self._answer_call(request))
        else:
            self._send(
                CallAnswered(
                    number=request.number,
                    answer=ServiceAnswer(
                        ok=False, text=f'{MAX_CALLS} calls are being carried out; wait for some.'
                    ),
                )
            )

    async def _answer_call(self, request: CallRobot) -> None:
        try:
            answer = await self._dispatcher.dispatch(request.call)
        except Exception as error:  # who called waits for an answer
            text = f'The driver has a defect, {type(error).__name__}: {error}.'
            self._log(logging.ERROR, f'{text} It was asked for {request.call}.')
            answer = ServiceAnswer(ok=False, text=text)
        self._send(CallAnswered(number=request.number, answer=answer))

    async def _ask_serial_number(self) -> None:
        """Fetch the serial number; a robot without a dashboard does not tell it."""
        answer = await self._dispatcher.dispatch(DashboardCall(command='get serial number'))
        if answer.ok:
            self._link.set_serial_number(answer.text)

    def _spawn(self, work: Coroutine[None, None, None]) -> None:
        task = asyncio.create_task(work)
        self._calls.add(task)
        task.add_done_callback(self._calls.discard)

    # ---- events of the robot ------------------------------------------------------------------

    def _keep_state(self, state: RobotState) -> None:
        self._latest, self._is_published = state, False

    def _publish_state(self) -> None:
        """
        Write the newest state into the shared memory, if it is not there yet.

        That comes behind what a packet leads to, as a CANCEL must not wait for it; but before
        anything is told, so that who hears of it finds the state that belongs to it.
        """
        if not self._is_published and self._latest is not None:
            self._is_published = True
            self._memory.write(self._latest)
            if self._recorder.is_recording and self._machine is not None:
                self._recorder.add_state(self._latest, *self._machine.motion_status())
            now = self._now()
            self._longest_gap = max(self._longest_gap, now - self._last_report)
            self._last_report = now

    def _handle_event(self, event: Event) -> None:
        """Feed the machine, and do what it answers."""
        if self._machine is not None:
            self._execute_commands(self._machine.step(event, self._now()))
        elif self._temporary_tcp is not None and isinstance(event, StateReceived):
            self._restore_tcp(self._temporary_tcp, event.state)
        self._publish_state()

    def _execute_commands(self, commands: list[GoalCommand]) -> None:
        for command in commands:
            match command:
                case SendControl(action=action, count=count):
                    self._link.send_control(action, count)
                case SendPoints(first=first, end=end):
                    self._link.send_points(self._points.take(first, end))
                case SetTemporaryTcp(T_flange_tcp=T_flange_tcp):
                    self._set_temporary_tcp(T_flange_tcp)
                case RestoreTcp(T_flange_tcp=T_flange_tcp):
                    self._link.restore_tcp(T_flange_tcp)
                case StopProgram(reason=reason):
                    self._link.stop_program(reason)
                case ReportProgress(progress=progress):
                    self._send(MotionProgress(motion=self._motion, progress=progress))
                case WriteServo(values=values):
                    if self._servo is not None:
                        self._servo.write_row(values)
                case OpenServo():
                    self._open_servo()
                case EnterServo():
                    self._link.send_servo(True)
                case LeaveServo():
                    self._leave_servo()
                case ReportServo(report=report):
                    self._send(ServoProgress(motion=self._motion, report=report))
                case LogWarning(text=text):
                    self._log(logging.WARNING, text)
                case AnswerAppend():
                    self._answer_append(command)
                case Finish(outcome=outcome):
                    self._finish(outcome)

    def _open_servo(self) -> None:
        """Take the inputs of the servo for the motion that runs."""
        self._servo = ServoConnection(
            lambda feedback: self._handle_event(ServoReceived(feedback=feedback))
        )
        self._spawn(
            self._servo.run(
                self._config.robot_ip,
                self._config.rtde_port,
                lambda reason: self._handle_event(LinkLost(link=SERVO_LINK, reason=reason)),
            )
        )

    def _leave_servo(self) -> None:
        """Have the robot program listen to the inputs no more, and give them back."""
        if self._servo is not None:
            self._link.send_servo(False)
            self._servo.close()
            self._servo = None

    def _finish(self, outcome: Outcome) -> None:
        self._leave_servo()
        machine, motion = self._machine, self._motion
        self._motion, self._machine = 0, None
        self._points = PointBuffer()
        if machine is not None and machine.temporary_tcp is not None:
            if machine.temporary_tcp.is_restored:
                self._send(TemporaryTcpRestored())
            else:
                self._restore_tcp_later(machine.temporary_tcp)
        self._link.set_executing(False)
        if outcome.code in CODES_WITH_LATE_CAUSE and not self._link.robot_error():
            self._pending_end = MotionEnded(motion=motion, outcome=outcome)
            asyncio.get_running_loop().call_later(CAUSE_TIMEOUT, self._send_pending_end)
        else:
            self._send_end(MotionEnded(motion=motion, outcome=outcome))

    def _send_pending_end(self) -> None:
        """Tell the end of a motion, whose reason has come meanwhile or will not come."""
        ended, self._pending_end = self._pending_end, None
        if ended is not None:
            self._send_end(ended)

    def _send_end(self, ended: MotionEnded) -> None:
        """Tell the end of a motion, with what led to it where that is not in its sentence."""
        outcome = ended.outcome
        if outcome.code in CODES_WITH_CAUSE:
            error = self._link.robot_error()
            text = (
                f'{outcome.text} {error[:1].upper()}{error[1:].rstrip(".")}.'
                if error
                else outcome.text
            )
            outcome = replace(
                outcome,
                text=text,
                report=(*outcome.report, *(f'why: {line}' for line in self._link.event_chain())),
            )
            self._link.explain(text)
        self._recorder.end(outcome)
        self._send(replace(ended, outcome=outcome))

    def _end_motion(self, text: str) -> None:
        if self._machine is not None:
            self._finish(Outcome(code=ErrorCode.CANCELLED, text=text))

    # ---- the TCP of a goal --------------------------------------------------------------------

    def _set_temporary_tcp(self, T_flange_tcp: Pose) -> None:
        """Set the TCP for a goal; the owner hears of it and remembers it, should we die."""
        assert self._machine is not None
        assert self._machine.temporary_tcp is not None
        temporary_tcp = self._machine.temporary_tcp
        self._send(
            TemporaryTcpSet(
                T_flange_original=temporary_tcp.T_flange_original,
                T_flange_temporary=temporary_tcp.T_flange_temporary,
            )
        )
        self._link.set_temporary_tcp(T_flange_tcp)

    def _restore_tcp_later(self, temporary_tcp: TemporaryTcp) -> None:
        """See to it that the TCP of an ended goal is put back, before another one runs."""
        self._temporary_tcp = temporary_tcp
        self._link.set_tcp_restore_pending(True)

    def _restore_tcp(self, temporary_tcp: TemporaryTcp, state: RobotState) -> None:
        """Put the TCP back when that is possible, again and again, until the robot has it."""
        now = self._now()
        temporary_tcp.observe(state, now)
        if temporary_tcp.is_restored:
            self._temporary_tcp = None
            self._link.set_tcp_restore_pending(False)
            self._send(TemporaryTcpRestored())
            self._log(logging.INFO, 'the TCP that the last goal had set is not set any more')
        elif temporary_tcp.is_restore_due(state, now):
            self._link.restore_tcp(temporary_tcp.T_flange_original)

    async def _tick(self) -> None:
        """Let time pass where nothing else happens, and watch the owner."""
        last_heartbeat = self._now()
        while True:
            await asyncio.sleep(TICK_PERIOD)
            self._handle_event(Tick())
            if self._now() - last_heartbeat >= HEARTBEAT_PERIOD:
                last_heartbeat = self._now()
                if self._withheld_signals is not None:
                    self._send(self._withheld_signals)
                self._send(
                    LoopHeartbeat(
                        gaps=LinkGaps(
                            reports=self._longest_gap, keepalives=self._link.keepalive_gap()
                        )
                    )
                )
                self._longest_gap = 0.0
            if self._now() - self._last_heartbeat > self._config.node_timeout:
                self._last_heartbeat = self._now()
                if self._machine is not None:
                    reason = (
                        'the owner of the driver was silent for longer than node_timeout = '
                        f'{self._config.node_timeout:g} s'
                    )
                    self._log(logging.ERROR, f'{reason}: the arm is stopped')
                    self._handle_event(CancelRequested(reason=reason))

    # ---- the owner ----------------------------------------------------------------------------

    def _status_changed(self, status: DriverStatus) -> None:
        if status.state is ConnectionState.DISCONNECTED:
            self._memory.clear()
            self._last_report = inf
        if self._temporary_tcp is not None and status.program_running != self._program_running:
            self._temporary_tcp.retry_now()
        self._program_running = status.program_running
        before, self._connection = self._connection, status.state
        if (before, status.state) == (
            ConnectionState.CONNECTING,
            ConnectionState.CONNECTED,
        ) and not status.serial_number:
            self._spawn(self._ask_serial_number())
        self._send(StatusChanged(status=status))

    def _geometry_known(self, geometry: DhTable) -> None:
        self._send(GeometryReceived(geometry=geometry))

    def _log(self, level: int, text: str) -> None:
        self._send(LogMessage(level=level, text=text))

    def _send(self, notification: Notification) -> None:
        self._publish_state()
        if self._pipe.is_closing():
            return
        is_dropped = (
            isinstance(notification, DROPPABLE)
            and self._pipe.transport.get_write_buffer_size() > MAX_UNREAD
        )
        if isinstance(notification, SignalsChanged):
            self._withheld_signals = notification if is_dropped else None
        if not is_dropped:
            self._pipe.write(pack(notification))

    def _now(self) -> float:
        return asyncio.get_running_loop().time()


def _call_soon(
    loop: asyncio.AbstractEventLoop, function: Callable[..., None], *arguments: object
) -> None:
    """Have the loop call a function, from another thread; nothing, if the loop has ended."""
    with suppress(RuntimeError):
        loop.call_soon_threadsafe(function, *arguments)


async def _run_in_thread_if_large(size: int, function: Callable[..., T], *arguments: object) -> T:
    """
    Call a function; in a thread when it has much to do, because keepalives cannot wait.

    :param size: how much it has to do [bytes].
    """
    if size < MIN_THREAD_SIZE:
        return function(*arguments)
    return await asyncio.to_thread(function, *arguments)


async def serve(pipe: socket.socket, descriptor: int) -> None:
    """
    Run a robot loop until its owner ends it.

    :param pipe: our end of the pair of sockets; the first message on it is the configuration.
    :param descriptor: the shared memory.
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
        pass  # the owner is gone, and with it everybody who could be told
    finally:
        writer.close()
        memory.close()
        # Calls that came in at the last moment are taken, and hung up on.
        await asyncio.sleep(0.01)
