# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The running motion of the robot loop: its state machine, points, recording and end.

The owner of the loop is the process or thread at the other end of the pipe (:mod:`~.loop_host`).
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Coroutine
from contextlib import suppress
from functools import partial
import logging
import traceback
from typing import TypeVar

from ur_cartesian_driver.driver.ipc.channel import (
    AppendAnswered,
    AppendToMotion,
    CancelMotion,
    MotionEnded,
    MotionProgress,
    PulsesGiven,
    ServoProgress,
    SetFeedOverride,
    SetLiveTarget,
    SetPathOffset,
    StartMotion,
    TemporaryTcpRestored,
    TemporaryTcpSet,
)
from ur_cartesian_driver.driver.ipc.driver_config import DriverConfig
from ur_cartesian_driver.driver.loop.end_reporter import EndReporter
from ur_cartesian_driver.driver.loop.goal_machine_factory import is_slow_to_make, make_machine
from ur_cartesian_driver.driver.loop.newest_state import NewestState
from ur_cartesian_driver.driver.loop.output_securer import OutputSecurer
from ur_cartesian_driver.driver.loop.owner_pipe import OwnerPipe
from ur_cartesian_driver.driver.loop.point_buffer import PointBuffer
from ur_cartesian_driver.driver.loop.tcp_restorer import TcpRestorer
from ur_cartesian_driver.driver.recordings.recorder import motion_metadata, Recorder
from ur_cartesian_driver.execution.goal.goal_commands import (
    AnswerAppend,
    CloseOffsets,
    EnterServo,
    Finish,
    GoalCommand,
    LeaveServo,
    LogWarning,
    OpenOffsets,
    OpenServo,
    ReportProgress,
    ReportPulses,
    ReportServo,
    RestoreOutputs,
    RestoreTcp,
    SecureOutputs,
    SendControl,
    SendPoints,
    SendSafeOutputs,
    SetFeedTarget,
    SetTemporaryTcp,
    StopProgram,
    WriteInputs,
)
from ur_cartesian_driver.execution.goal.goal_machine import GoalMachine
from ur_cartesian_driver.execution.goal.motion_job import AppendJob, MotionJob
from ur_cartesian_driver.execution.goal.temporary_tcp import same_tcp
from ur_cartesian_driver.motion.errors import ErrorCode
from ur_cartesian_driver.motion.events import (
    CancelRequested,
    CollisionFound,
    ContactWatchChanged,
    Event,
    INPUTS_LINK,
    LinkLost,
    Outcome,
    PreemptRequested,
    StateReceived,
)
from ur_cartesian_driver.motion.geometry.pose import Pose
from ur_cartesian_driver.motion.state.io_signals import Signals
from ur_cartesian_driver.motion.state.rtde_state import RobotState
from ur_cartesian_driver.protocol.program import script_command
from ur_cartesian_driver.robot.link import RobotLink
from ur_cartesian_driver.robot.program.program_tracker import NEEDS_OWN_PROGRAM
from ur_cartesian_driver.robot.rtde.register_connection import (
    offset_exchange,
    RegisterConnection,
    RegisterExchange,
    servo_exchange,
)

#: Data of this size [bytes] or more is processed in a thread, because its processing takes longer
#: than a few milliseconds.
MIN_THREAD_SIZE = 1 << 18
#: Longest wait at shutdown for the recording of the last motion [s].
RECORD_TIMEOUT = 1.0

T = TypeVar('T')


class MotionRunner:
    """Runs one motion at a time: passes events to its machine, and carries out the commands."""

    def __init__(
        self,
        config: DriverConfig,
        link: RobotLink,
        newest: NewestState,
        pipe: OwnerPipe,
        tcp_restorer: TcpRestorer,
        *,
        spawn: Callable[[Coroutine[None, None, None]], None],
        is_changing_settings: Callable[[], bool],
    ) -> None:
        """
        Begin with no motion.

        :param spawn: runs a coroutine concurrently.
        :param is_changing_settings: returns whether TCP or payload are being set.
        """
        self._config, self._link, self._newest, self._pipe = config, link, newest, pipe
        self._tcp_restorer, self._spawn = tcp_restorer, spawn
        self._is_changing_settings = is_changing_settings
        self._machine: GoalMachine | None = None
        #: Number of the running motion, which requests for it carry; 0 = no motion runs.
        self._number = 0
        self._points = PointBuffer()
        #: The connection that writes RTDE inputs for set-points or path offsets; None = not open.
        self._inputs: RegisterConnection | None = None
        #: The request whose points the machine is accepting or refusing at this moment.
        self._pending_append: AppendToMotion | None = None
        self._recorder = Recorder(
            config.record_directory,
            config.record_max_size,
            partial(_call_soon, asyncio.get_running_loop(), pipe.log, logging.WARNING),
        )
        self._outputs = OutputSecurer(config, link, spawn, lambda event: self.handle_event(event))
        self._ends = EndReporter(link, pipe, self._recorder, self._outputs)

    @property
    def is_running(self) -> bool:
        """Return whether a motion runs."""
        return self._machine is not None

    # ---- requests -----------------------------------------------------------------------------

    async def start(self, request: StartMotion) -> None:
        """Start a motion, or send its owner the reason why it cannot start."""
        machine = await run_in_thread_if_large(
            MIN_THREAD_SIZE if is_slow_to_make(request) else len(request.points),
            make_machine,
            request,
            self._config,
        )
        job = request.job
        reason = self._refusal(job)
        if not reason:
            foreign = await self._foreign_program(job)
            reason = self._refusal(job) or foreign  # checked again after the wait
        if reason:
            refusal = Outcome(code=ErrorCode.ROBOT_NOT_READY, text=reason)
            self._pipe.send(MotionEnded(motion=request.motion, outcome=refusal))
            return
        state = self._newest.latest
        assert state is not None  # without a state the link would not be ready
        points, commands = PointBuffer(request.points), machine.start(state)
        self._record(request, state)
        self._number, self._points, self._machine = request.motion, points, machine
        self._outputs.forget()
        self._ends.begin()
        self._link.set_executing(True)
        self._guarded(lambda: commands)
        if self._link.contact_watch.is_active:
            self.handle_event(ContactWatchChanged(is_active=True))

    def _refusal(self, job: MotionJob) -> str:
        """Return the reason why a motion cannot start now; '' = it can."""
        if self.is_running or self._ends.is_pending:
            return 'Another motion is running; wait for its end or cancel it.'
        if self._is_changing_settings():
            return 'TCP or payload is being set; send the goal again.'
        if reason := self._link.status.not_ready():
            return reason
        state = self._newest.latest
        if state is None or same_tcp(state.T_flange_tcp, job.T_flange_active):
            return ''
        return 'The TCP of the robot changed after the goal was planned; send the goal again.'

    async def _foreign_program(self, job: MotionJob | None) -> str:
        """Return the reason why the running program cannot run the motion; '' = it can."""
        needs = '' if job is None else job.own_program_needs
        if not needs or await self._link.control.tracker.wait_for_identity():
            return ''
        return f'The goal has {needs}, {NEEDS_OWN_PROGRAM}'

    async def append(self, request: AppendToMotion) -> None:
        """
        Offer points to the running motion.

        Points for another motion are refused. Points that only the driver's own robot program can
        execute are refused if another program runs on the robot.
        """
        foreign = await self._foreign_program(request.append_job.job)
        if request.motion != self._number or self._machine is None:
            self._refuse_append(request, 'The goal has ended.')
        elif foreign:
            self._refuse_append(request, foreign)
        else:
            self._pending_append = request
            self._step(self._machine, request.append_job)

    def _refuse_append(self, request: AppendToMotion, refusal: str) -> None:
        answer = AnswerAppend(number=request.append_job.number, refusal=refusal)
        self._pipe.send(AppendAnswered(motion=request.motion, answer=answer))

    def set_live_target(self, request: SetLiveTarget) -> None:
        """Give the running live session another target; ignore a target for another session."""
        if request.motion == self._number and self._machine is not None:
            self._machine.can.steering.set_target(request.T_base_tcp, request.age, _now())

    def set_path_offset(self, request: SetPathOffset) -> None:
        """Give the running motion another path offset; ignore an offset for another motion."""
        if request.motion == self._number and self._machine is not None:
            self._machine.can.displacing.set_offset(request.offset, request.age, _now())

    def set_feed_override(self, request: SetFeedOverride) -> None:
        """
        Give the running motion another feed.

        A feed for another motion is ignored. If ``feed_override_input`` names an input of the
        robot, that input gives the feed, and every feed from clients is ignored.
        """
        is_open = not self._config.feed_override_input
        if is_open and request.motion == self._number and self._machine is not None:
            self._machine.can.overriding.set_feed(request.fraction, request.age, _now())

    def cancel(self, request: CancelMotion) -> None:
        """Stop the requested motion, if it is running."""
        if request.motion != self._number:
            return
        by, collision = request.preempted_by, request.collision
        self._recorder.add_event('cancel', collision or (by and f'preempted by {by}'))
        if collision:
            self.handle_event(CollisionFound(reason=collision))
        else:
            self.handle_event(PreemptRequested(by=by) if by else CancelRequested())

    def close(self) -> None:
        """End the running motion at shutdown."""
        if self.is_running:
            self._finish(Outcome(code=ErrorCode.CANCELLED, text='The driver was shut down.'))
        self._ends.report_pending()

    def close_recorder(self) -> None:
        """Finish the recording of the last motion; a slow disk can delay this by some seconds."""
        self._recorder.close(RECORD_TIMEOUT)

    # ---- events and commands ------------------------------------------------------------------

    def handle_event(self, event: Event) -> None:
        """
        Pass an event to the running motion's machine, and carry out the machine's commands.

        If no motion runs, a robot state goes to the :class:`TcpRestorer`, which may still have to
        restore the TCP of an earlier motion. In both cases, the newest state is published
        afterwards.
        """
        if self._machine is not None:
            self._step(self._machine, event)
        elif isinstance(event, StateReceived):
            self._tcp_restorer.observe(event.state)
        self._newest.publish()

    def _step(self, machine: GoalMachine, event: Event | AppendJob) -> None:
        """Give an event to the machine, and carry out its commands."""
        self._guarded(lambda: machine.step(event, _now()))

    def _guarded(self, make_commands: Callable[[], list[GoalCommand]]) -> None:
        """Make and carry out commands; if that raises an error, stop the arm."""
        try:
            self._execute(make_commands())
        except Exception as error:
            if self._machine is None:
                raise
            reason = f'{type(error).__name__}: {error}'.rstrip('.')
            text = f'The motion cannot go on ({reason}).'
            self._pipe.log(logging.ERROR, f'{text} {traceback.format_exc()}')
            # Stop first: after _finish() the next goal could start in the program that must end.
            self._link.control.stop(text)
            self._finish(Outcome(code=ErrorCode.EXECUTION_FAILED, text=text))

    def _execute(self, commands: list[GoalCommand]) -> None:
        for command in commands:
            match command:
                case SendControl(action=action, count=count, takes_offsets=takes_offsets):
                    self._link.control.send_control(action, count, takes_offsets=takes_offsets)
                case SetFeedTarget(fraction=fraction, rate=rate):
                    self._link.control.set_feed(fraction, rate)
                case SendPoints(first=first, end=end):
                    self._link.program.send_points(self._points.take(first, end))
                case SetTemporaryTcp(T_flange_tcp=T_flange_tcp):
                    self._set_temporary_tcp(T_flange_tcp)
                case RestoreTcp(T_flange_tcp=T_flange_tcp):
                    self._link.control.restore_tcp(T_flange_tcp)
                case SendSafeOutputs(action=action, token=token, outputs=outputs):
                    self._link.program.send_command(
                        script_command.encode(
                            script_command.SetSafeOutputsCommand(
                                action=action, token=token, outputs=outputs
                            )
                        )
                    )
                case SecureOutputs(outputs=outputs):
                    self._outputs.secure(outputs)
                case RestoreOutputs():
                    self._outputs.give_back()
                case StopProgram(reason=reason):
                    self._link.control.stop(reason)
                case ReportProgress(progress=progress):
                    self._pipe.send(MotionProgress(motion=self._number, progress=progress))
                case ReportPulses(pulses=pulses):
                    self._pipe.send(PulsesGiven(pulses=pulses))
                case WriteInputs(values=values):
                    if self._inputs is not None:
                        self._inputs.write_row(values)
                case OpenOffsets():
                    self._open_inputs(offset_exchange(self.handle_event))
                case CloseOffsets():
                    self._close_inputs()
                case OpenServo():
                    self._open_inputs(servo_exchange(self.handle_event))
                case EnterServo():
                    self._link.control.send_servo(True)
                case LeaveServo():
                    self._leave_servo()
                case ReportServo(report=report):
                    self._pipe.send(ServoProgress(motion=self._number, report=report))
                case LogWarning(text=text):
                    self._pipe.log(logging.WARNING, text)
                case AnswerAppend():
                    self._answer_append(command)
                case Finish(outcome=outcome):
                    self._finish(outcome)

    def _answer_append(self, answer: AnswerAppend) -> None:
        """Keep the points that the machine has accepted, and send its answer to the owner."""
        pending, self._pending_append = self._pending_append, None
        assert pending is not None
        job, before = pending.append_job.job, pending.append_job.records_before
        if not answer.refusal and job is not None:
            if pending.points:
                self._points.put(before, pending.points)
            if self._machine is not None:
                self._recorder.add_plan(job.reference, self._machine.end_time_of(before))
        self._pipe.send(AppendAnswered(motion=self._number, answer=answer))

    def _open_inputs(self, exchange: RegisterExchange) -> None:
        """Open a connection that claims the RTDE inputs of the running motion."""
        self._inputs = RegisterConnection(exchange, lower_registers=self._config.lower_registers)
        self._spawn(
            self._inputs.run(
                self._config.robot_ip,
                self._config.rtde_port,
                lambda reason: self.handle_event(LinkLost(link=INPUTS_LINK, reason=reason)),
            )
        )

    def _leave_servo(self) -> None:
        """Make the robot program stop following set-points, and release the RTDE inputs."""
        if self._inputs is not None:
            self._link.control.send_servo(False)
            self._close_inputs()

    def _close_inputs(self) -> None:
        if self._inputs is not None:
            self._inputs.close()
            self._inputs = None

    def _set_temporary_tcp(self, T_flange_tcp: Pose) -> None:
        """
        Set the TCP for a goal.

        The owner is told first, so that a new loop can restore the TCP if this one dies.
        """
        assert self._machine is not None
        assert self._machine.temporary_tcp is not None
        temporary_tcp = self._machine.temporary_tcp
        self._pipe.send(
            TemporaryTcpSet(
                T_flange_original=temporary_tcp.T_flange_original,
                T_flange_temporary=temporary_tcp.T_flange_temporary,
            )
        )
        self._link.control.set_temporary_tcp(T_flange_tcp)

    def _finish(self, outcome: Outcome) -> None:
        if self._link.program.servo:
            self._leave_servo()
        self._close_inputs()
        machine, number = self._machine, self._number
        self._number, self._machine = 0, None
        self._points = PointBuffer()
        if machine is not None and machine.temporary_tcp is not None:
            if machine.temporary_tcp.is_restored:
                self._pipe.send(TemporaryTcpRestored())
            else:
                self._tcp_restorer.restore_later(machine.temporary_tcp)
        self._link.set_executing(False)
        self._ends.report(MotionEnded(motion=number, outcome=outcome))

    # ---- recording ----------------------------------------------------------------------------

    def _record(self, request: StartMotion, state: RobotState) -> None:
        """Begin the recording of a motion, if motions are recorded."""
        if not self._config.record_directory:
            return
        status = self._link.status
        mode = 'FREEDRIVE' if request.freedrive else ''
        metadata = motion_metadata(
            request.job,
            plan_metadata_json=request.plan_metadata,
            parameters=self._config,
            mode='LIVE_TARGETS' if request.live is not None else mode,
            robot={
                'model': status.robot_model,
                'polyscope_version': status.polyscope_version,
                'motion_version': status.motion_version,
                'serial_number': status.serial_number,
            },
        )
        self._recorder.start(request.job, metadata, state)

    def record_state(self, state: RobotState) -> None:
        """Add a robot state to the recording of the running motion."""
        if self._recorder.is_recording and self._machine is not None:
            self._recorder.add_state(state, *self._machine.motion_status())

    def record_signals(self, signals: Signals) -> None:
        """Keep the newest outputs for the next recorded states."""
        self._recorder.add_signals(signals)


def _now() -> float:
    return asyncio.get_running_loop().time()


def _call_soon(
    loop: asyncio.AbstractEventLoop, function: Callable[..., None], *arguments: object
) -> None:
    """Schedule a function on a loop from another thread; do nothing if the loop has ended."""
    with suppress(RuntimeError):
        loop.call_soon_threadsafe(function, *arguments)


async def run_in_thread_if_large(size: int, function: Callable[..., T], *arguments: object) -> T:
    """
    Call a function, in a thread if it handles much data: the loop must send keepalives on time.

    :param size: amount of data that the function handles [bytes].
    """
    if size < MIN_THREAD_SIZE:
        return function(*arguments)
    return await asyncio.to_thread(function, *arguments)
