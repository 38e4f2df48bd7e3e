# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The Python API: plan, execute and stop motions of one robot, with no ROS running.

A :class:`Driver` plans in the process of its owner, which is the code that creates it. The *robot
loop*, in its own process or thread, holds all sockets to the robot; the driver sends requests to
it and receives notifications from it (:mod:`~.ipc.channel`).
"""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Future
import contextlib
from dataclasses import replace
import logging
import threading
from typing import Any

from ur_cartesian_driver.driver.appender import Appender, encode_part
from ur_cartesian_driver.driver.callbacks import LOG
from ur_cartesian_driver.driver.changeable_cell import ChangeableCell
from ur_cartesian_driver.driver.ipc.channel import (
    ArmSetup,
    Configure,
    LiveSetup,
    Notification,
    OwnerHeartbeat,
    pack_parts,
    Request,
    ResendProgram,
    SetLiveTarget,
    StartMotion,
)
from ur_cartesian_driver.driver.ipc.driver_config import DriverConfig
from ur_cartesian_driver.driver.live_session import (
    check_target,
    InteractiveMotions,
    plain_target,
    stationary_job,
)
from ur_cartesian_driver.driver.loop_connection import LoopConnection
from ur_cartesian_driver.driver.motion_handle import (
    ActiveMotion,
    HAS_FEED_INPUT,
    MotionHandle,
    OnProgress,
)
from ur_cartesian_driver.driver.recordings.recorder import plan_metadata
from ur_cartesian_driver.driver.reported_robot import ReportedRobot
from ur_cartesian_driver.driver.robot_services import RobotServices
from ur_cartesian_driver.driver.running_motions import RunningMotions
from ur_cartesian_driver.driver.running_path import RunningPath
from ur_cartesian_driver.execution.goal.motion_job import job_from_plan, MotionJob
from ur_cartesian_driver.execution.goal.temporary_tcp import same_tcp
from ur_cartesian_driver.execution.goal.timeouts import STOP_TIMEOUT
from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.motion.errors import (
    GoalRefused,
    InvalidGoal,
    LocalProtocolError,
    RobotNotReady,
)
from ur_cartesian_driver.motion.events import Outcome, Progress, Pulse
from ur_cartesian_driver.motion.geometry.pose import Pose
from ur_cartesian_driver.motion.goal.goal import Goal
from ur_cartesian_driver.motion.goal.joint_goal import JointGoal
from ur_cartesian_driver.motion.goal.known_frames import ArmSnapshot, Frames
from ur_cartesian_driver.motion.plan.plan import Plan
from ur_cartesian_driver.motion.state.io_signals import Signals
from ur_cartesian_driver.motion.state.rigid_body import shift_reference_point
from ur_cartesian_driver.motion.state.rtde_state import RobotState
from ur_cartesian_driver.motion.state.servo_report import ServoReport
from ur_cartesian_driver.motion.twin.twin import ArmIdentity
from ur_cartesian_driver.path import AirTravel, Path
from ur_cartesian_driver.planning import plan, plan_joint_goal, PlanningOptions
from ur_cartesian_driver.planning.append.append_planner import AppendPlan, plan_first_part
from ur_cartesian_driver.planning.preflight.clearance import self_collision_remark
from ur_cartesian_driver.planning.preflight.tcp_kinematics import max_joint_change
from ur_cartesian_driver.planning.stop_prediction import at_set_point, predict_stop
from ur_cartesian_driver.preview import ArmPlan
from ur_cartesian_driver.program.render import has_feature
from ur_cartesian_driver.protocol.program.trajectory_points import encode_plan
from ur_cartesian_driver.robot.connection_status import (
    ConnectionStatus,
    is_paused,
    is_stopped,
    LinkGaps,
    timestamped,
)
from ur_cartesian_driver.robot.services.service_calls import ServiceAnswer, ServiceCall

NO_STATE = 'The robot does not report its state.'
LOOP_LOST = 'The robot loop ended unexpectedly, or hangs; the robot program stops the arm.'

#: Longest wait for the outcome of a cancelled motion [s]: the robot loop gives an outcome within
#: this time, whatever the robot does.
CANCEL_TIMEOUT = 2.0 * STOP_TIMEOUT + 1.0
# The arm counts as unmoved if no joint has changed by more than this [rad], a mm at the tool.
_SAME_JOINTS = 1e-3


class Driver(RobotServices, InteractiveMotions, ChangeableCell):
    """
    The driver of one robot; thread-safe. Open it, or use it as a context manager.

    ::

        with Driver(DriverConfig(robot_ip='192.168.56.101', ur_type='ur5e')) as driver:
            driver.wait_ready(timeout=10.0)
            plan = driver.plan(goal)  # or a Path; raises GoalRefused; nothing moves
            motion = driver.start(plan)  # returns at once
            outcome = motion.result()

    :meth:`execute` does the last three steps in one call. Callbacks run on the thread that reads
    the notifications of the robot loop: keep them short.
    """

    def __init__(
        self,
        config: DriverConfig,
        options: PlanningOptions | None = None,
        *,
        frames: Frames | None = None,
        auto_heartbeat: bool = True,
        logger: logging.Logger = LOG,
    ) -> None:
        """
        Keep the settings; nothing is connected before :meth:`open`.

        :param frames: the frames that paths can name; None = the standard frames.
        :param auto_heartbeat: whether a thread of the driver sends the heartbeats. An owner that
            can hang (a ROS executor) sets False and calls :meth:`heartbeat` itself, so that the
            arm stops if the owner hangs.
        :param logger: receives the driver's messages; each of several drivers may have its own.
        :raises ValueError: ``ur_type`` is unknown.
        """
        self.config = config
        self.options = options if options is not None else PlanningOptions()
        self.frames = frames if frames is not None else Frames(self.options.tf_prefix)
        self._log = logger
        self._robot = ReportedRobot(config, self.options, logger)
        self._loop = LoopConnection(
            config,
            auto_heartbeat=auto_heartbeat,
            on_notification=self._handle,
            on_lost=self._on_loop_lost,
            reconfigure=self._reconfigure,
            logger=logger,
        )
        self._send = self._loop.send
        self._running = RunningMotions(self._loop)
        self._cell_lock, self._cell_listeners = threading.Lock(), []
        #: Whether a loop that replaces a lost one may upload the robot program.
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
        """Start the robot loop and return; the loop connects, and reconnects, by itself."""
        if remark := self_collision_remark(self.config.ur_type, self.options):
            self._log.warning('%s', remark)
        if functions := self.config.prelude.functions:
            self._log.info(
                'The robot program has functions of %s, which the driver does not check: %s.',
                self.config.prelude.file,
                ', '.join(function.name for function in functions),
            )
        self._loop.open()

    def close(self) -> None:
        """Stop a running motion and end the robot loop and all threads. May be called twice."""
        if not self._loop.close():
            return
        # Set the status first: it refuses new motions, which would never end without the loop.
        self._robot.set_status(ConnectionStatus(message='The driver is closed; open it.'))
        self._running.abort('The driver was closed.')

    def heartbeat(self) -> None:
        """
        Tell the robot loop that the owner is alive.

        The loop stops the arm if it gets no heartbeat for ``node_timeout``.
        """
        self._send(OwnerHeartbeat())

    # ---- state and status ---------------------------------------------------------------------

    @property
    def status(self) -> ConnectionStatus:
        """The state of the connection, and the next step to get the robot ready."""
        return self._robot.status

    @property
    def state(self) -> RobotState | None:
        """The newest robot state; None before the first and while the robot is disconnected."""
        return self._loop.state

    @property
    def rest_state(self) -> RobotState | None:
        """
        The state from which the next motion starts; None as for :attr:`state`.

        While a motion runs, this is the predicted state after a stop that begins now, with the TCP
        that the robot had before the motion.
        """
        state = self.state
        if state is None:
            return None
        temporary_tcp = self._running.temporary_tcp(self._robot.temporary_tcp)
        state = predict_stop(state, self.arm, self.config.stop_deceleration)
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
        """The robot's inputs and outputs; None before the first report and while disconnected."""
        return self._robot.signals

    @property
    def gaps(self) -> LinkGaps:
        """The longest gaps between robot states, and between keepalives to the robot program."""
        return self._robot.gaps

    @property
    def arm(self) -> Arm:
        """The kinematics of the arm: nominal until the robot has reported its calibration."""
        return self._robot.arm

    def add_status_listener(self, callback: Callable[[ConnectionStatus], None]) -> None:
        """Call ``callback`` with each new status, and at once with the present one."""
        self._robot.status_listeners.append(callback)
        callback(self.status)

    def add_servo_listener(self, callback: Callable[[ServoReport], None]) -> None:
        """Call ``callback`` with each report on set-points that the driver streams."""
        self._robot.servo_listeners.append(callback)

    def add_pulse_listener(self, callback: Callable[[Pulse], None]) -> None:
        """Call ``callback`` with each output pulse of a goal's ``pulses``, in order."""
        self._robot.pulse_listeners.append(callback)

    def wait_ready(self, timeout: float) -> None:
        """
        Wait until a goal can run; the driver connects, and reconnects, by itself.

        :raises RobotNotReady: the robot is not ready after ``timeout`` [s]; the text gives the
            next step.
        """
        if not self._robot.ready.wait(timeout):
            raise RobotNotReady(self.status.not_ready())

    # ---- motion -------------------------------------------------------------------------------

    def plan(self, goal: Goal | Path | JointGoal) -> ArmPlan:
        """
        Check a goal and choose the robot's motions for it, from :attr:`rest_state`; nothing moves.

        ``plan(goal).show()`` opens a page with the arm on its path.

        :param goal: a goal, in Cartesian or joint space, or a path. The frames of a path are
            resolved now; unless the path begins with a joint motion, the arm has to be at the
            start of the path.
        :raises GoalRefused: the goal fails a check; the text says which.
        :raises RobotNotReady: the robot does not report its state.
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
        return ArmPlan.of(planned, arm, options)

    def renewed(self, plan: Plan) -> Plan:
        """
        Return ``plan``, or a new one if the plan begins with a travel and the arm has moved since.

        A travel is a motion through the air, from the position of the arm to the first point.

        :raises GoalRefused: the goal fails a check from the present position of the arm.
        :raises RobotNotReady: the robot does not report its state.
        """
        if plan.travelled_goal is None:
            return plan
        q = at_set_point(self._require(self.rest_state), self.arm).actual_q
        if max_joint_change(plan.start, q) <= _SAME_JOINTS:
            return plan
        return self.plan(plan.travelled_goal)

    def air_travel(self, **settings: Any) -> AirTravel:
        """
        Return the arm and its present state, for :meth:`.Path.travel_to` and :func:`.join`.

        :param settings: other fields of :class:`~.traveller.AirTravel`, such as ``retract`` [m].
        :raises RobotNotReady: the robot does not report its state.
        :raises ValueError: a number is out of its range.
        """
        state = self._require(self.rest_state)
        return AirTravel(
            arm=self.arm,
            state=state,
            options=self._options_for(state),
            frames=self.frames,
            **settings,
        )

    def start(self, plan: Plan, on_progress: OnProgress | None = None) -> MotionHandle:
        """
        Execute a plan and return at once.

        A plan that begins with a travel is renewed first, see :meth:`renewed`.

        :raises RobotNotReady: the robot program is not connected, a motion is running, or the plan
            was made for a robot program other than the running one.
        :raises GoalRefused: the cell has changed since the plan was made, and the arm would touch
            it; or :meth:`renewed` refuses the goal.
        :raises LocalProtocolError: a value of the plan does not fit into a message.
        """
        if plan.older_program != self.config.dialect.older_program:
            raise RobotNotReady(
                'The plan was made for another robot program than the one that runs; make it with '
                'Driver.plan().'
            )
        plan = self.renewed(plan)
        planned_in = plan.options.cell if isinstance(plan, ArmPlan) else None
        cell = self._check_cell_of(plan, planned_in)
        if plan.goal.keep_open:
            options = self._options_for(self._require(self.state))
            part = plan_first_part(plan, self.arm, options)
            points, job = encode_part(part)
            motion = self._start_motion(plan, points, job, on_progress, part=part)
        else:
            points, job = encode_plan(plan), job_from_plan(plan)
            motion = self._start_motion(plan, points, job, on_progress)
        if self.options.cell is not cell:
            self._check_running_soon()
        return motion

    def execute(
        self,
        goal: Goal | Path | JointGoal,
        on_progress: OnProgress | None = None,
        timeout: float | None = None,
        *,
        preempt: bool = False,
    ) -> Outcome:
        """
        Plan and run a goal or path, and wait for its outcome; a refused goal has an outcome, too.

        :param preempt: whether to stop a running motion for this goal, once the goal has passed
            all checks from the position where the arm is predicted to come to rest; False =
            refuse the goal while a motion runs.
        :raises TimeoutError: no outcome came within ``timeout`` [s]; the motion was cancelled, and
            its end was awaited for at most :data:`CANCEL_TIMEOUT`.
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
        except BaseException:  # also Ctrl-C: the caller no longer waits for this motion
            motion.cancel()
            with contextlib.suppress(TimeoutError):
                motion.result(CANCEL_TIMEOUT)  # so that the next goal finds the arm free
            raise

    def preempt_motion(self, by: str = 'a newer motion') -> bool:
        """
        Stop the running motion for another one, and wait until it ends as PREEMPTED.

        :param by: the other motion, as a noun phrase for the text of the outcome.
        :returns: whether a motion ran; if so, plans made before its end have to be made again.
        :raises RobotNotReady: the running motion cannot be preempted now and goes on, or it did
            not end in time.
        """
        motions = self._running.handles
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
                'The running motion is paused or stopped, so no other motion can preempt it; '
                'resume or cancel it.'
            )

    @property
    def progress(self) -> Progress | None:
        """The newest progress report of the running motion; None = no motion or no report yet."""
        motions = self._running.handles
        return motions[0].progress if motions else None

    def stop(self) -> None:
        """Cancel the running motion and return at once; nothing happens if none runs."""
        for motion in self._running.handles:
            motion.cancel()

    # ---- services -----------------------------------------------------------------------------

    def resend_robot_program(self) -> None:
        """Upload the robot program again, for instance after a person stopped it."""
        self._send(ResendProgram())

    def call(self, call: ServiceCall) -> Future[ServiceAnswer]:
        """
        Start a service call and return at once; the future gets an answer even if the call fails.

        :raises LocalProtocolError: the argument is not a :class:`ServiceCall`.
        """
        if not isinstance(call, ServiceCall):
            raise LocalProtocolError(f'{call!r:.60} is no service call.')
        return self._running.call(call)

    # ---- starting motions ---------------------------------------------------------------------

    def _require(self, state: RobotState | None) -> RobotState:
        if state is None:
            raise RobotNotReady(self.status.message or NO_STATE)
        return state

    def _goal_of(self, path: Path, state: RobotState) -> Goal:
        """
        Return the goal of a path, with the frames resolved in a state of the robot.

        :raises InvalidGoal: a frame is unknown, or the arm is not at the start of the path.
        """
        snapshot = ArmSnapshot.of(state)
        goal = path.goal(self.frames, snapshot)
        if path.start is None or path.starts_with_joint_motion:
            return goal
        tool, start = snapshot.tool(goal), path.start
        distance, angle = tool.distance_to(start), tool.angle_to(start)
        options = self.options
        if distance > options.start_tolerance_position or angle > options.start_tolerance_angle:
            raise InvalidGoal(
                'the start of the path',
                f'is {1e3 * distance:.1f} mm and {angle:.3f} rad away from the tool (allowed are '
                f'{1e3 * options.start_tolerance_position:g} mm and '
                f'{options.start_tolerance_angle:g} rad)',
                'begin the path with a joint motion to there, or where the tool stands, or use '
                'allow_travel()',
            )
        return goal

    def _options_for(self, state: RobotState) -> PlanningOptions:
        """Return the planning options, completed with the properties of the connected robot."""
        status = self.status
        return self.options.for_program(
            self.config,
            calibration_known=status.calibration_known,
            optimove_known=has_feature('optimove', status.software()),
            path_offset_known=has_feature('path_offset', status.software()),
            target_payload_known=has_feature('target_payload', status.software()),
            robot_motion_version=status.motion_version,
            robot=ArmIdentity(
                model=status.robot_model,
                serial_number=status.serial_number,
                software=status.polyscope_version,
                motion_version=status.motion_version,
            ),
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
        :raises LocalProtocolError: a part of the motion cannot be sent to another process.
        """
        number = next(self._running.numbers)
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
        data = pack_parts(request)
        active = ActiveMotion(
            number,
            plan,
            on_progress,
            self._send,
            self._log,
            path=RunningPath(plan, job.spline, self._take_part_change) if plan.segments else None,
        )
        if job.feed_override is not None:
            active.motion.feed_problem = (
                HAS_FEED_INPUT if self.config.feed_override_input else None
            )
        if part is not None:
            active.motion.appender = self._make_appender(active, part)
        self._running.start(active, data, lambda: self.status.not_ready())
        return active.motion

    def _make_appender(self, active: ActiveMotion, part: AppendPlan) -> Appender:
        """Return the appender, which plans further points and offers them to the loop."""
        motion, cell = active.motion, self.options.cell

        def planning_inputs() -> tuple[Arm, PlanningOptions]:
            nonlocal cell
            options = self._options_for(self._require(self.state))
            cell = options.cell
            return self.arm, options

        def on_appended(appended: AppendPlan, job: MotionJob) -> None:
            if active.path is not None:
                active.path.append(appended.plan, appended.start_time, appended.spline)
            if self.options.cell is not cell:
                self._check_running_soon()

        return Appender(
            motion.number,
            part,
            send=self._send,
            planning_inputs=planning_inputs,
            progress=lambda: motion.progress,
            on_appended=on_appended,
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
        if state is not None and self._running.runs(number):
            T_base_tcp, age = plain_target(T_base_tcp, age)
            check_target(T_base_tcp, state, self.options)
            self._send(SetLiveTarget(motion=number, T_base_tcp=T_base_tcp, age=age))

    # ---- from the robot loop ------------------------------------------------------------------

    def _on_loop_lost(self) -> None:
        # If somebody has stopped the robot program, the next loop must not upload it again.
        self._may_upload = self.status.program_running
        self._robot.set_status(
            ConnectionStatus(message=LOOP_LOST, last_error=timestamped(LOOP_LOST))
        )
        self._running.abort(LOOP_LOST)

    def _reconfigure(self) -> Configure:
        self._running.abort_calls(LOOP_LOST)  # calls made since the loop was lost
        return Configure(
            config=self.config,
            may_upload=self._may_upload,
            temporary_tcp=self._robot.temporary_tcp,
        )

    def _handle(self, notification: Notification | Request) -> None:
        self._running.take(notification)
        self._robot.take(notification)
