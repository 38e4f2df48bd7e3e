# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Live sessions and freedrive, as methods of a driver.

Both are motions, like goals: only one motion runs at a time, each can be cancelled in the
same way, and each has one outcome. Unlike goals, they have no path planned in advance.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from math import inf, isfinite, sqrt

import numpy as np

from ur_cartesian_driver.driver.ipc.channel import LiveSetup
from ur_cartesian_driver.driver.ipc.driver_config import DriverConfig
from ur_cartesian_driver.driver.motion_handle import MotionHandle, OnProgress
from ur_cartesian_driver.execution.goal.motion_job import MotionJob
from ur_cartesian_driver.execution.live.live_targets import LiveSettings
from ur_cartesian_driver.execution.live.online_trajectory import LiveLimits
from ur_cartesian_driver.execution.live.workspace_guard import LiveWorkspace
from ur_cartesian_driver.kinematics.cell_distances import missing_coal
from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.motion.errors import InvalidGoal, NotAvailable, RobotNotReady
from ur_cartesian_driver.motion.geometry.pose import Pose, pose_rows
from ur_cartesian_driver.motion.geometry.vectors import Joints, vector6
from ur_cartesian_driver.motion.geometry.workspace import parse_planes
from ur_cartesian_driver.motion.goal.declared_types import with_declared_types, WrongType
from ur_cartesian_driver.motion.goal.execution_modes import ExecutionMode
from ur_cartesian_driver.motion.goal.goal import Goal, SafeOutput, Waypoint
from ur_cartesian_driver.motion.goal.output_names import parse_safe_outputs
from ur_cartesian_driver.motion.plan.plan import Plan, ReferencePath
from ur_cartesian_driver.motion.state.rtde_state import RobotState
from ur_cartesian_driver.planning.options import PlanningOptions

#: Largest deviation of the squared length of a quaternion from 1.
UNIT_TOLERANCE = 1e-3


class LiveSession:
    """A running live session."""

    def __init__(self, motion: MotionHandle, send: Callable[[int, Pose, float], None]) -> None:
        """Wrap a running motion; :meth:`~.api.Driver.start_live_session` makes sessions."""
        #: The session's motion, to wait for its end or to cancel it.
        self.motion = motion
        self._send = send

    def set_target(self, T_base_tcp: Pose, *, age: float = 0.0) -> None:
        """
        Go to another target from now on; no effect once the session has ended.

        :param T_base_tcp: the pose that the active TCP should reach, in the robot's base.
        :param age: how old the target is [s].
        :raises InvalidGoal: the target is malformed, or too far away; the previous target stays.
        """
        self._send(self.motion.number, T_base_tcp, age)


class InteractiveMotions(ABC):
    """Motions that are steered while they run."""

    config: DriverConfig
    options: PlanningOptions
    _live: LiveSession | None = None
    _freedrive: MotionHandle | None = None

    @property
    @abstractmethod
    def arm(self) -> Arm:
        """The arm's kinematics."""

    @property
    @abstractmethod
    def state(self) -> RobotState | None:
        """The newest robot state."""

    @abstractmethod
    def _start_stationary(
        self,
        plan: Plan,
        on_progress: OnProgress | None,
        *,
        live: LiveSetup | None = None,
        freedrive: bool = False,
    ) -> MotionHandle:
        """Start a motion without a planned path."""

    @abstractmethod
    def _send_target(self, number: int, T_base_tcp: Pose, age: float) -> None:
        """Check a target, and send it to the session with this number."""

    def start_live_session(self, T_base_tcp: Pose, *, age: float = 0.0) -> LiveSession:
        """
        Go to a target, and to further targets sent while the arm moves; return at once.

        The tool goes straight, with bounded speed and acceleration (``live_target_*`` of the
        options), to the newest target that is not too old.

        :param T_base_tcp: the pose that the active TCP should reach, in the robot's base.
        :param age: how old the target is [s].
        :raises InvalidGoal: the target is malformed, or too far away.
        :raises NotAvailable: the cell has a mesh, and pinocchio is not installed.
        :raises RobotNotReady: the robot cannot accept a motion now, or another motion runs.
        """
        state, cell = self._state_for('follow live targets'), self.options.cell
        T_base_tcp, age = plain_target(T_base_tcp, age)
        check_target(T_base_tcp, state, self.options)
        motion = self._start_stationary(
            stationary_plan(state, parse_safe_outputs(self.options.safe_outputs)),
            None,
            live=live_setup(self.arm, state.target_q, self.options),
        )
        self._live = LiveSession(motion, self._send_target)
        self._live.set_target(T_base_tcp, age=age)
        if self.options.cell is not cell:  # it changed before self._live was set
            self._end_session_for(motion, 'a session in the changed cell')
        return self._live

    def send_live_target(self, T_base_tcp: Pose, *, age: float = 0.0) -> MotionHandle:
        """
        Go to a target: the next one of the running session, or the first one of a new session.

        :returns: the session, as a motion; it ends ``live_target_timeout`` after the last target.
        :raises GoalRefused: as in :meth:`start_live_session`.
        """
        if self._live is None or self._live.motion.done():
            return self.start_live_session(T_base_tcp, age=age).motion
        self._live.set_target(T_base_tcp, age=age)
        return self._live.motion

    def _end_session_for(self, motion: MotionHandle, by: str) -> None:
        """End a motion if it is the live session: the next target begins another one."""
        if self._live is not None and self._live.motion is motion:
            motion.preempt(by)

    def start_freedrive(self, on_active: Callable[[], None] = lambda: None) -> MotionHandle:
        """
        Start freedrive: a person can guide the arm by hand until the returned motion is cancelled.

        Needs ``allow_freedrive`` in the configuration with which the robot program was started.

        :param on_active: called repeatedly while the arm can be guided.
        :raises RobotNotReady: freedrive is not allowed, or another motion runs.
        """
        state = self._state_for('enter freedrive')
        if not self.config.allow_freedrive:
            raise RobotNotReady(
                'Freedrive is not allowed: allow_freedrive is false; set it to true, '
                'and restart the driver.'
            )
        self._freedrive = self._start_stationary(
            stationary_plan(state), lambda _: on_active(), freedrive=True
        )
        return self._freedrive

    @property
    def is_freedrive_active(self) -> bool:
        """Return whether freedrive is active."""
        return self._freedrive is not None and not self._freedrive.done()

    def _state_for(self, what: str) -> RobotState:
        """
        Return the newest state.

        :raises RobotNotReady: the robot reports no state, or runs another program than ours.
        """
        if not self.config.runs_own_program:
            raise RobotNotReady(
                f'Only the robot program of this driver can {what}; {self.config.other_program}.'
            )
        state = self.state
        if state is None:
            raise RobotNotReady('The robot does not report its state.')
        return state


def check_pose(pose: Pose) -> None:
    """
    Refuse a malformed pose.

    :raises InvalidGoal: a number is not finite, or the quaternion's length is not 1.
    """
    for name, values in (('position', pose.position), ('orientation', pose.quaternion)):
        if not all(map(isfinite, values)):
            raise InvalidGoal(f'The {name} of the target', f'is {values}, which is not finite')
    squared_norm = sum(v * v for v in pose.quaternion)
    if abs(squared_norm - 1.0) > UNIT_TOLERANCE:
        raise InvalidGoal(
            'The orientation of the target',
            f'has length {sqrt(squared_norm):.6g}; a unit quaternion is needed',
            'divide it by its length',
        )


def plain_target(T_base_tcp: Pose, age: float) -> tuple[Pose, float]:
    """
    Return a target and its age [s] as plain numbers.

    :raises InvalidGoal: a value is no number, or the age is negative or not finite.
    """
    try:
        T_base_tcp = with_declared_types(T_base_tcp, Pose, 'T_base_tcp')
        age = with_declared_types(age, float, 'age')
    except WrongType as error:
        raise InvalidGoal(error.field, error.problem) from None
    if not 0.0 <= age < inf:
        raise InvalidGoal('age', f'is {age} s; it must be finite, and at least 0')
    return T_base_tcp, age


def check_target(T_base_tcp: Pose, state: RobotState, options: PlanningOptions) -> None:
    """
    Refuse a malformed or distant target.

    :raises InvalidGoal: the target is malformed, or farther than ``max_approach_distance`` (0 = no
        limit) from the tool.
    """
    check_pose(T_base_tcp)
    distance = T_base_tcp.distance_to(state.actual_tcp_pose)
    max_distance = options.max_approach_distance
    if 0.0 < max_distance < distance:
        raise InvalidGoal(
            'The target',
            f'is {distance:.4g} m away from the tool, more than max_approach_distance = '
            f'{max_distance:g} m',
            'send a goal to go there, or raise the parameter',
        )


def live_setup(arm: Arm, start: Joints, options: PlanningOptions) -> LiveSetup:
    """
    Return the settings of a live session.

    :param start: present joint positions [rad].
    :raises NotAvailable: the cell has a mesh, and pinocchio is not installed.
    """
    if problem := missing_coal(options.cell):
        raise NotAvailable('cell_file', problem)
    max_speed = options.live_target_linear_velocity
    if options.max_tool_speed > 0.0:
        max_speed = min(max_speed, options.max_tool_speed)
    limits = LiveLimits(
        linear_velocity=max_speed,
        linear_acceleration=options.live_target_linear_acceleration,
        angular_velocity=options.live_target_angular_velocity,
        angular_acceleration=options.live_target_angular_acceleration,
        joint_velocity=vector6(
            min(speed, options.live_target_joint_velocity) for speed in arm.model.max_joint_speed
        ),
        singularity_margins=(
            options.singularity_margin_wrist,
            options.singularity_margin_elbow,
            options.singularity_margin_shoulder,
        ),
        workspace=LiveWorkspace(
            planes=parse_planes(options.workspace_planes),
            # The cylinders around the links are thicker than the arm, so the arm may be clear
            # although they touch. They are checked only if goals are refused for this, too.
            min_clearance=options.min_clearance if options.self_collision == 'refuse' else None,
            tool_radius=options.tool_radius,
            cell=options.cell,
        ),
    )
    return LiveSetup(
        settings=LiveSettings(
            limits=limits,
            max_age=options.live_target_max_age,
            timeout=options.live_target_timeout,
        ),
        start=start,
    )


def stationary_plan(state: RobotState, safe_outputs: tuple[SafeOutput, ...] = ()) -> Plan:
    """Return the plan of a motion without a planned path: its one point is the present pose."""
    here = state.target_tcp_pose
    return Plan(
        goal=Goal(
            waypoints=(Waypoint(pose=here),),
            execution=ExecutionMode.SERVO,
            safe_outputs=safe_outputs,
        ),
        segments=(),
        reference=ReferencePath(
            poses=pose_rows((here, here)), point=np.zeros(2, dtype=np.int32), time=np.zeros(2)
        ),
        start=state.target_q,
        T_flange_active=state.T_flange_tcp,
        execution=ExecutionMode.SERVO,
    )


def stationary_job(plan: Plan) -> MotionJob:
    """Return the job of a motion without a planned path, which sends no wire records."""
    return MotionJob(
        points=1,
        reference=plan.reference,
        duration=0.0,
        has_speed_profile=False,
        T_flange_active=plan.T_flange_active,
        execution=plan.execution,
        safe_outputs=plan.goal.safe_outputs,
    )
