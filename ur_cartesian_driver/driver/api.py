# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The Python API: plan, execute and stop motions of one robot, with no ROS running.

A :class:`Driver` plans in the process of its owner. A robot loop, a process or thread of its own,
holds all sockets to the robot; the driver sends it requests and gets notifications back
(:mod:`~.ipc.channel`).
"""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Future
import contextlib
from dataclasses import replace
import itertools
import threading

from ur_cartesian_driver.driver.appender import Appender, encode_plan
from ur_cartesian_driver.driver.callbacks import LOG, run_callback
from ur_cartesian_driver.driver.ipc.channel import (
    AppendAnswered,
    ArmSetup,
    CallAnswered,
    CallRobot,
    Configure,
    GeometryReceived,
    LimitsReceived,
    LiveSetup,
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
    SignalsChanged,
    StartMotion,
    StatusChanged,
    TemporaryTcpRestored,
    TemporaryTcpSet,
)
from ur_cartesian_driver.driver.ipc.driver_config import DriverConfig
from ur_cartesian_driver.driver.live_session import (
    check_target,
    InteractiveMotions,
    plain_target,
    stationary_job,
)
from ur_cartesian_driver.driver.loop_connection import LoopConnection
from ur_cartesian_driver.driver.motion_handle import ActiveMotion, MotionHandle, OnProgress
from ur_cartesian_driver.driver.recordings.recorder import plan_metadata
from ur_cartesian_driver.driver.robot_services import RobotServices
from ur_cartesian_driver.execution.goal.goal_commands import AnswerAppend
from ur_cartesian_driver.execution.goal.motion_job import job_from_plan, MotionJob
from ur_cartesian_driver.execution.goal.temporary_tcp import same_tcp
from ur_cartesian_driver.execution.goal.timeouts import STOP_TIMEOUT
from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.kinematics.robot_models import (
    DhTable,
    JOINT_NAMES,
    JointLimits,
    robot_model,
)
from ur_cartesian_driver.motion.errors import (
    ErrorCode,
    GoalRefused,
    InvalidGoal,
    LocalProtocolError,
    RobotNotReady,
)
from ur_cartesian_driver.motion.events import Outcome
from ur_cartesian_driver.motion.geometry.pose import Pose
from ur_cartesian_driver.motion.geometry.workspace import parse_planes
from ur_cartesian_driver.motion.goal.goal import Goal
from ur_cartesian_driver.motion.goal.joint_goal import JointGoal
from ur_cartesian_driver.motion.goal.known_frames import ArmSnapshot, Frames
from ur_cartesian_driver.motion.plan.plan import Plan
from ur_cartesian_driver.motion.state.io_signals import Signals
from ur_cartesian_driver.motion.state.rigid_body import shift_reference_point
from ur_cartesian_driver.motion.state.robot_state import RobotState
from ur_cartesian_driver.motion.state.servo_report import ServoReport
from ur_cartesian_driver.path import Path
from ur_cartesian_driver.planning import plan, plan_joint_goal, PlanningOptions
from ur_cartesian_driver.planning.append.append_planner import AppendPlan, plan_first_part
from ur_cartesian_driver.planning.preflight.clearance import self_collision_remark
from ur_cartesian_driver.planning.stop_prediction import predict_stop
from ur_cartesian_driver.preview import ArmPlan
from ur_cartesian_driver.program.render import has_feature
from ur_cartesian_driver.protocol.program.trajectory_points import encode_rows
from ur_cartesian_driver.robot.connection_status import (
    ConnectionStatus,
    is_paused,
    is_stopped,
    LinkGaps,
    timestamped,
)
from ur_cartesian_driver.robot.lifecycle import ConnectionState
from ur_cartesian_driver.robot.services.service_calls import ServiceAnswer, ServiceCall

NO_STATE = 'The robot does not report its state.'
LOOP_LOST = 'The robot loop ended unexpectedly, or hangs; the robot program stops the arm.'

#: How long a cancelled motion may need to its outcome [s], whatever the robot does.
CANCEL_TIMEOUT = 2.0 * STOP_TIMEOUT + 1.0


class Driver(RobotServices, InteractiveMotions):
    """
    One robot. Thread-safe; open it, or use it as a context manager.

    ::

        with Driver(DriverConfig(robot_ip='192.168.56.101', ur_type='ur5e')) as driver:
            driver.wait_ready(timeout=10.0)
            plan = driver.plan(goal)  # or a Path; raises GoalRefused; nothing moves
            motion = driver.start(plan)  # returns at once
            outcome = motion.result()

    :meth:`execute` does the last three in one call. Callbacks run on the driver's own reader
    thread: keep them short.
    """

    def __init__(
        self,
        config: DriverConfig,
        options: PlanningOptions | None = None,
        *,
        frames: Frames | None = None,
        auto_heartbeat: bool = True,
    ) -> None:
        """
        Prepare a driver; nothing is connected before :meth:`open`.

        :param frames: the frames that paths may name; None = those of every robot.
        :param auto_heartbeat: send heartbeats from a thread; an owner that can hang (a ROS
            executor) calls :meth:`heartbeat` itself.
        :raises ValueError: ``ur_type`` is unknown.
        """
        self.config = config
        self.options = options if options is not None else PlanningOptions()
        self.frames = frames if frames is not None else Frames(self.options.tf_prefix)
        self._has_warned_of_cell = False
        self._arm = Arm(robot_model(config.ur_type))
        self._loop = LoopConnection(
            config,
            auto_heartbeat=auto_heartbeat,
            on_notification=self._handle,
            on_lost=self._on_loop_lost,
            reconfigure=self._reconfigure,
        )
        #: Guards the motions and calls that run, as well as sending.
        self._lock = self._loop.lock
        self._send = self._loop.send
        #: Numbers of motions and calls.
        self._numbers = itertools.count(1)
        self._active_motions: dict[int, ActiveMotion] = {}
        self._calls: dict[int, Future[ServiceAnswer]] = {}
        self._status = ConnectionStatus()
        self._ready = threading.Event()
        self._signals: Signals | None = None
        self._gaps = LinkGaps()
        self._status_listeners: list[Callable[[ConnectionStatus], None]] = []
        self._servo_listeners: list[Callable[[ServoReport], None]] = []
        #: The TCP that a goal has set, until the one before is restored.
        self._temporary_tcp: TemporaryTcpSet | None = None
        #: Whether a loop that replaces another one may upload the robot program.
        self._may_upload = True

    def __enter__(self) -> Driver:
        """Open."""
        self.open()
        return self

    def __exit__(self, *_: object) -> None:
        """Close."""
        self.close()

    # ---- connection ---------------------------------------------------------------------------

    def open(self) -> None:
        """Start the robot loop and return; it connects and reconnects by itself."""
        if remark := self_collision_remark(self.config.ur_type, self.options):
            LOG.warning('%s', remark)
        if functions := self.config.prelude.functions:
            LOG.info(
                'The robot program has functions of %s, outside all checks of the driver: %s.',
                self.config.prelude.file,
                ', '.join(function.name for function in functions),
            )
        self._loop.open()

    def close(self) -> None:
        """Stop a running motion and end the robot loop and all threads. May be called twice."""
        if not self._loop.close():
            return
        # The status first: it refuses new motions, which would never end.
        self._set_status(ConnectionStatus(message='The driver is closed; open it.'))
        self._abort_all('The driver was closed.')

    def heartbeat(self) -> None:
        """Tell the robot loop that the owner is alive; needed within every ``node_timeout``."""
        self._send(OwnerHeartbeat())

    # ---- state and status ---------------------------------------------------------------------

    @property
    def status(self) -> ConnectionStatus:
        """How far the connection is."""
        return self._status

    @property
    def state(self) -> RobotState | None:
        """The newest robot state; None before the first and when the robot is lost."""
        return self._loop.state

    @property
    def rest_state(self) -> RobotState | None:
        """
        The state from which the next motion starts; None as for :attr:`state`.

        While a motion runs: the predicted state after a stop that begins now, with the TCP from
        before that motion.
        """
        state = self.state
        if state is None:
            return None
        temporary_tcp = self._current_temporary_tcp()
        state = predict_stop(state, self._arm, self.config.stop_deceleration)
        if temporary_tcp is None or not same_tcp(
            state.T_flange_tcp, temporary_tcp.T_flange_temporary
        ):
            return state
        T_flange_original = temporary_tcp.T_flange_original
        T_temporary_original = state.T_flange_tcp.inverse() @ T_flange_original
        return replace(
            shift_reference_point(state, T_temporary_original), T_flange_tcp=T_flange_original
        )

    @property
    def signals(self) -> Signals | None:
        """Inputs, outputs and tool; None before the first report and when the robot is lost."""
        return self._signals

    @property
    def gaps(self) -> LinkGaps:
        """The longest recent pauses of the connection."""
        return self._gaps

    @property
    def arm(self) -> Arm:
        """The arm's kinematics: calibrated once the robot has reported them, else nominal."""
        return self._arm

    def add_status_listener(self, callback: Callable[[ConnectionStatus], None]) -> None:
        """Call back with each new status, and at once with the present one."""
        self._status_listeners.append(callback)
        callback(self._status)

    def add_servo_listener(self, callback: Callable[[ServoReport], None]) -> None:
        """Call back with each report of the servo."""
        self._servo_listeners.append(callback)

    def wait_ready(self, timeout: float) -> None:
        """
        Wait until a goal can run; the driver connects, and reconnects, by itself.

        :raises RobotNotReady: not within ``timeout`` [s]; the text says what is needed.
        """
        if not self._ready.wait(timeout):
            raise RobotNotReady(self._status.not_ready())

    # ---- motion -------------------------------------------------------------------------------

    def plan(self, goal: Goal | Path | JointGoal) -> ArmPlan:
        """
        Check a goal and choose its primitives, starting from :attr:`rest_state`; nothing moves.

        ``plan(goal).show()`` opens a page with the arm on its path.

        :param goal: or a path: its frames are resolved now, and the arm has to stand at its start
            unless its first motion is a joint motion; or a goal in joint space.
        :raises GoalRefused: the text says why; :exc:`RobotNotReady` without a robot state.
        """
        state = self._require(self.rest_state)
        if isinstance(goal, Path):
            goal = self._goal_of(goal, state)
        arm, options = self.arm, self._options_for(state)
        planned = (
            plan_joint_goal(goal, state, arm, options)
            if isinstance(goal, JointGoal)
            else plan(goal, state, arm, options)
        )
        return ArmPlan.of(planned, arm, parse_planes(self.options.workspace_planes))

    def start(self, plan: Plan, on_progress: OnProgress | None = None) -> MotionHandle:
        """
        Execute a plan and return at once.

        :raises RobotNotReady: the robot program is not connected, or a motion is running.
        :raises LocalProtocolError: a value of the plan does not fit into a message.
        """
        if plan.goal.keep_open:
            options = self._options_for(self._require(self.state))
            part = plan_first_part(plan, self.arm, options)
            points, job = encode_plan(part, self.config.dialect)
            return self._start_motion(plan, points, job, on_progress, part=part)
        points = encode_rows(plan.rows, self.config.dialect)
        return self._start_motion(
            plan, points, job_from_plan(plan, self.config.dialect), on_progress
        )

    def execute(
        self,
        goal: Goal | Path | JointGoal,
        on_progress: OnProgress | None = None,
        timeout: float | None = None,
        *,
        preempt: bool = False,
    ) -> Outcome:
        """
        Plan and run a goal or path, and wait for its outcome; a refusal is an outcome too.

        :param preempt: stop a running motion for this goal, once the goal has passed all checks
            from where the arm would come to rest; False = refuse the goal while a motion runs.
        :raises TimeoutError: no outcome within ``timeout`` [s]; the motion was cancelled, and the
            arm is at rest.
        """
        try:
            planned = self.plan(goal)
            if preempt and self.preempt_motion():
                planned = self.plan(goal)
            motion = self.start(planned, on_progress)
        except GoalRefused as refusal:
            return Outcome(code=refusal.code, text=str(refusal))
        try:
            return motion.result(timeout)
        except BaseException:  # also Ctrl-C: nobody waits for this motion any more
            motion.cancel()
            with contextlib.suppress(TimeoutError):
                motion.result(CANCEL_TIMEOUT)  # so that the next goal finds the arm free
            raise

    def preempt_motion(self, by: str = 'a newer motion') -> bool:
        """
        Stop the running motion for another one, and wait until it ends as PREEMPTED.

        :param by: the other motion, as part of the sentence of the outcome.
        :returns: whether a motion ran; then plans made before its end have to be made again.
        :raises RobotNotReady: it cannot be preempted now and goes on, or it did not end.
        """
        with self._lock:
            motions = [active.motion for active in self._active_motions.values()]
        if motions:
            self.check_can_preempt()
        for motion in motions:
            motion.preempt(by)
            try:
                motion.result(CANCEL_TIMEOUT)
            except TimeoutError:
                raise RobotNotReady('The previous motion did not end.') from None
        return bool(motions)

    def check_can_preempt(self) -> None:
        """
        Check that a running motion can be preempted.

        :raises RobotNotReady: a person guides the arm; or the robot program is paused or stopped
            and would read neither the stop nor the next motion.
        """
        state = self._require(self.state)
        if self.is_freedrive_active:
            raise RobotNotReady('A person guides the arm by hand; end freedrive first.')
        if is_paused(state) or is_stopped(state):
            raise RobotNotReady(
                'A motion is running that is paused or stopped, so no other motion can preempt '
                'it; resume or cancel it.'
            )

    def stop(self) -> None:
        """Cancel the running motion and return at once; nothing happens if none runs."""
        for active in list(self._active_motions.values()):
            active.motion.cancel()

    # ---- services -----------------------------------------------------------------------------

    def resend_robot_program(self) -> None:
        """Upload the robot program again, for instance after a person stopped it."""
        self._send(ResendProgram())

    def call(self, call: ServiceCall) -> Future[ServiceAnswer]:
        """
        Start a call and return at once; the future always gets an answer, never an error.

        :raises LocalProtocolError: it is no call.
        """
        if not isinstance(call, ServiceCall):
            raise LocalProtocolError(f'{call!r:.60} is no service call.')
        future: Future[ServiceAnswer] = Future()
        future.set_running_or_notify_cancel()
        number = next(self._numbers)
        data = pack(CallRobot(number=number, call=call))
        with self._lock:
            if self._loop.is_open:
                self._calls[number] = future
                self._loop.send_packed(data)
                return future
        future.set_result(ServiceAnswer(ok=False, text='The driver is closed; open it.'))
        return future

    # ---- starting motions ---------------------------------------------------------------------

    def _require(self, state: RobotState | None) -> RobotState:
        if state is None:
            raise RobotNotReady(self._status.message or NO_STATE)
        return state

    def _goal_of(self, path: Path, state: RobotState) -> Goal:
        """
        Return the goal of a path for the robot in a state.

        :raises InvalidGoal: a frame is not known, or the arm does not stand at the start.
        """
        snapshot = ArmSnapshot.of(state)
        goal = path.goal(self.frames, snapshot)
        if path.start is None or path.starts_with_joint_motion:
            return goal
        T_flange_tool = goal.T_flange_controlled or snapshot.T_flange_tcp
        tool = snapshot.T_base_flange @ T_flange_tool
        start = goal.T_base_frame @ path.start
        distance, angle = tool.distance_to(start), tool.angle_to(start)
        options = self.options
        if distance > options.start_tolerance_position or angle > options.start_tolerance_angle:
            raise InvalidGoal(
                'the start of the path',
                f'is {1e3 * distance:.1f} mm and {angle:.3f} rad away from the tool (allowed are '
                f'{1e3 * options.start_tolerance_position:g} mm and '
                f'{options.start_tolerance_angle:g} rad)',
                'begin the path with a joint motion to there, or where the tool stands',
            )
        return goal

    def _options_for(self, state: RobotState) -> PlanningOptions:
        """Return the planning options, with what the connected robot supports."""
        status = self._status
        return replace(
            self.options,
            calibration_known=status.calibration_known,
            dialect=self.config.dialect,
            prelude=self.config.prelude,
            # A foreign program may skip the command, and would then move the wrong TCP.
            allow_tcp_change=self.options.allow_tcp_change
            and self.config.dialect.supports_tcp_change,
            optimove_known=has_feature('optimove', status.software()),
            path_offset_known=has_feature('path_offset', status.software()),
            acceleration_known=state.actual_tcp_acceleration is not None
            and state.target_tcp_acceleration is not None,
        )

    def _start_motion(
        self,
        plan: Plan,
        points: bytes,
        job: MotionJob,
        on_progress: OnProgress | None,
        live: LiveSetup | None = None,
        freedrive: bool = False,
        part: AppendPlan | None = None,
    ) -> MotionHandle:
        """
        Have the robot loop start a motion.

        :raises RobotNotReady: the robot is not ready, or another motion runs.
        :raises LocalProtocolError: something of the motion cannot be sent to another process.
        """
        number = next(self._numbers)
        request = StartMotion(
            motion=number,
            points=points,
            job=job,
            live=live,
            arm=None if live is None and job.offset_band is None else ArmSetup.of(self.arm),
            freedrive=freedrive,
            plan_metadata=plan_metadata(plan, self.options)
            if self.config.record_directory
            else '',
        )
        data = pack(request)
        with self._lock:
            if self._active_motions:
                raise RobotNotReady('A motion is running; wait for its end or cancel it.')
            if reason := self._status.not_ready():
                raise RobotNotReady(reason)
            active = ActiveMotion(number, plan, on_progress, self._send)
            motion = active.motion
            if part is not None:
                motion.appender = self._make_appender(motion, part)
            self._active_motions[number] = active
            # Sent under the lock: another thread may find the motion and cancel it, and the
            # cancel has to arrive after the start.
            self._loop.send_packed(data)
        return motion

    def _make_appender(self, motion: MotionHandle, part: AppendPlan) -> Appender:
        """Return what plans and offers the points that are appended to a goal."""

        def planning_inputs() -> tuple[Arm, PlanningOptions]:
            return self.arm, self._options_for(self._require(self.state))

        return Appender(
            motion.number,
            part,
            dialect=self.config.dialect,
            send=self._send,
            planning_inputs=planning_inputs,
            progress=lambda: motion.progress,
        )

    def _start_stationary(
        self,
        plan: Plan,
        on_progress: OnProgress | None,
        *,
        live: LiveSetup | None = None,
        freedrive: bool = False,
    ) -> MotionHandle:
        return self._start_motion(
            plan, b'', stationary_job(plan), on_progress, live=live, freedrive=freedrive
        )

    def _send_target(self, number: int, T_base_tcp: Pose, age: float) -> None:
        state = self.state
        if state is not None and number in self._active_motions:
            T_base_tcp, age = plain_target(T_base_tcp, age)
            check_target(T_base_tcp, state, self.options)
            self._send(SetLiveTarget(motion=number, T_base_tcp=T_base_tcp, age=age))

    def _current_temporary_tcp(self) -> TemporaryTcpSet | None:
        """Return the TCP of the running motion, or one that is not restored yet."""
        with self._lock:
            active = next(iter(self._active_motions.values()), None)
            return self._temporary_tcp if active is None else active.temporary_tcp

    # ---- from the robot loop ------------------------------------------------------------------

    def _on_loop_lost(self) -> None:
        # A program that somebody stopped stays stopped.
        self._may_upload = self._status.program_running
        self._set_status(ConnectionStatus(message=LOOP_LOST, last_error=timestamped(LOOP_LOST)))
        self._abort_all(LOOP_LOST)

    def _reconfigure(self) -> Configure:
        self._abort_calls(LOOP_LOST)  # calls made since the loop was lost
        return Configure(
            config=self.config, may_upload=self._may_upload, temporary_tcp=self._temporary_tcp
        )

    def _handle(self, notification: Notification | Request) -> None:
        match notification:
            case MotionProgress(motion=number, progress=progress):
                if number in self._active_motions:
                    self._active_motions[number].report(progress)
            case AppendAnswered(motion=number, answer=answer):
                self._handle_append_answer(number, answer)
            case MotionEnded(motion=number, outcome=outcome):
                with self._lock:
                    active = self._active_motions.pop(number, None)
                if active is not None:
                    active.end(outcome)
            case CallAnswered(number=number, answer=answer):
                with self._lock:
                    call = self._calls.pop(number, None)
                if call is not None:
                    call.set_result(answer)
            case ServoProgress(report=report):
                for listener in list(self._servo_listeners):
                    run_callback(listener, report)
            case StatusChanged(status=status):
                self._set_status(status)
            case SignalsChanged(signals=signals):
                self._signals = signals
            case LoopHeartbeat(gaps=gaps):
                self._gaps = gaps
            case GeometryReceived(geometry=geometry):
                self._update_geometry(geometry)
            case LimitsReceived(limits=limits):
                self._update_limits(limits)
            case TemporaryTcpSet():
                self._temporary_tcp = notification
            case TemporaryTcpRestored():
                self._temporary_tcp = None
            case LogMessage(level=level, text=text):
                LOG.log(level, text)

    def _handle_append_answer(self, number: int, answer: AnswerAppend) -> None:
        active = self._active_motions.get(number)
        if active is not None and active.motion.appender is not None:
            active.motion.appender.answer(answer)

    def _update_limits(self, limits: JointLimits) -> None:
        """Plan within the limits that the robot reports, where they are tighter, from now on."""
        model = robot_model(self.config.ur_type).limited_to(limits)
        self._arm = Arm(model, self._arm.geometry)
        for k in sorted(model.reported_ranges):
            LOG.info('%s turns within %s', JOINT_NAMES[k], model.range_text(k))
        for k in sorted(model.reported_speeds):
            speed, source = model.max_joint_speed[k], model.speed_source(k)
            LOG.info('%s turns at up to %.3f rad/s%s', JOINT_NAMES[k], speed, source)

    def _update_geometry(self, geometry: DhTable) -> None:
        """Plan with the robot's calibrated kinematics from now on; warn if it is far off."""
        model = self._arm.model
        self._arm = Arm(model, geometry)
        deviation = self._arm.max_flange_distance(Arm(model))
        limit = self.config.max_calibration_difference
        if 0.0 < limit < deviation:
            LOG.warning(
                'the calibration of the robot moves the flange by up to %.1f mm from where the '
                'model %s has it; max_calibration_difference is %.1f mm: check ur_type, and '
                'whether the arm was repaired and calibrated again',
                1e3 * deviation,
                model.name,
                1e3 * limit,
            )

    def _set_status(self, status: ConnectionStatus) -> None:
        self._status = status
        if status.state is ConnectionState.DISCONNECTED:
            self._signals, self._gaps = None, LinkGaps()
        if status.state is ConnectionState.READY:
            self._warn_of_unchecked_cell()
            self._ready.set()
        else:
            self._ready.clear()
        for listener in list(self._status_listeners):
            run_callback(listener, status)

    def _warn_of_unchecked_cell(self) -> None:
        """Say once what of the cell the pre-flight cannot know."""
        unknown = [
            text
            for text, is_unknown in (
                (
                    'workspace_planes is empty, so no table, wall or ceiling is checked',
                    not self.options.workspace_planes,
                ),
                (
                    'tool_radius is 0, so the tool is not checked',
                    self.options.tool_radius == 0.0,
                ),
            )
            if is_unknown
        ]
        if unknown and not self._has_warned_of_cell:
            LOG.warning('%s; goals may lead the arm into what is there', ', and '.join(unknown))
        self._has_warned_of_cell = True

    def _abort_all(self, text: str) -> None:
        """End all motions and calls of a robot loop that is gone."""
        self._abort_calls(text)
        with self._lock:
            active_motions, self._active_motions = self._active_motions, {}
        for active in active_motions.values():
            active.end(Outcome(code=ErrorCode.CONNECTION_LOST, text=text))

    def _abort_calls(self, text: str) -> None:
        with self._lock:
            calls, self._calls = self._calls, {}
        for call in calls.values():
            call.set_result(ServiceAnswer(ok=False, text=text))
