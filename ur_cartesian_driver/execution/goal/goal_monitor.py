# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Compare each packet of the robot with the plan of a goal: progress, and faults.

The monitor finds faults and decides nothing: what follows from one in the present state is in the
table of :mod:`~.goal_transitions`.
"""

from __future__ import annotations

from math import inf

import numpy as np

from ur_cartesian_driver.execution.goal.motion_job import MotionJob
from ur_cartesian_driver.execution.goal.outcome_codes import Fault, GoalSignal
from ur_cartesian_driver.execution.goal.wire_records import WireRecords
from ur_cartesian_driver.execution.monitoring.joint_tolerance_check import JointToleranceCheck
from ur_cartesian_driver.execution.monitoring.path_tracker import PathTracker, tracker_speed
from ur_cartesian_driver.execution.monitoring.press_window import PressWindow
from ur_cartesian_driver.execution.monitoring.speed_check import SpeedCheck
from ur_cartesian_driver.execution.monitoring.tolerance_check import ToleranceCheck
from ur_cartesian_driver.motion.events import PathPlace, Progress
from ur_cartesian_driver.motion.geometry.pose import IDENTITY, Pose, pose_from_row
from ur_cartesian_driver.motion.geometry.vectors import add, scale, Vector3
from ur_cartesian_driver.motion.plan.offset_band import AppliedOffset, NO_OFFSET
from ur_cartesian_driver.motion.state.rigid_body import shift_reference_point
from ur_cartesian_driver.motion.state.robot_state import RobotState, RuntimeState

#: How far the arm may have moved away from the start of the plan until it is armed [m], [rad].
START_POSITION_TOLERANCE, START_ANGLE_TOLERANCE = 0.001, 0.01
#: How long the target may stand still in the middle of a goal while nothing holds it [s].
STANDSTILL_TIMEOUT = 2.0
#: How much longer than planned it may stand where the plan itself waits [s].
STANDSTILL_MARGIN = 1.0
#: Rows of a path that differ by less are the same pose, at which the plan waits [m], [rad].
SAME_POSE = 1e-9
#: How far the controller's own target may be from the plan [m], [rad].
MAX_PLAN_DEVIATION = (0.002, 0.02)


class GoalMonitor:
    """The newest packet, the position on the path, and the checks of both."""

    def __init__(
        self, job: MotionJob, max_plan_deviation: tuple[float, float] = MAX_PLAN_DEVIATION
    ) -> None:
        """
        Prepare.

        :param max_plan_deviation: how far the controller's own target may be from the plan [m],
            [rad]; 0 = any way, any angle.
        """
        #: The motion, with what was appended last, and all its records.
        self.job, self.records = job, WireRecords(job)
        self._start = pose_from_row(job.reference.poses[0])
        self._tracker = PathTracker(job.reference)
        self._speed_check = SpeedCheck(job.reference) if job.has_speed_profile else None
        self._path_check = ToleranceCheck(job.path_tolerance, job.T_base_frame)
        self._goal_check = ToleranceCheck(job.goal_tolerance, job.T_base_frame)
        self._joint_check = JointToleranceCheck(job.joint_tolerances)
        self._checks_tcp = job.T_tcp_controlled == IDENTITY
        self._max_plan_deviation = max_plan_deviation
        self._clearly_allowed = tuple(limit or inf for limit in max_plan_deviation)
        #: Whether the robot program has read START: it has begun a point, or the target moves.
        self._has_begun = False
        #: The motions that the robot reports as begun, and by how many motions its target may be
        #: behind; None = not reported.
        self._reported_begun: int | None = None
        self._behind = 0
        #: Whether that count may still be that of the goal before, and which it is.
        self._awaits_count, self._stale_begun = False, 0
        #: How many motions of the goal the robot had begun in trajectories before this one.
        self._motions_before = 0
        #: How long the target has stood still while nothing held it [s].
        self._standstill_time = 0.0
        #: The same in scaled time, and how much of that is allowed.
        self._standstill_scaled, self._standstill_timeout = 0.0, _standstill_timeout(job)
        #: How long the program has run the motion that it began last [s], and which it is.
        self._running_time, self._running = 0.0, 0
        #: The newest packet; None before the first.
        self.latest: RobotState | None = None
        self._applied_offset = NO_OFFSET
        #: Scaled time: time since the start, as the controller's clock ran [s].
        self.scaled_time = 0.0
        #: By how much the slider or a pause delayed the controller's clock in the newest packet,
        #: whether the arm moved or not [s].
        self.held_time = 0.0
        #: How fast the time of the motion ran in the newest packet, 0 to 1.
        self.rate = 0.0

    # ---- what goes on -------------------------------------------------------------------------

    def start(self, stale_begun: int, sent: int = 0) -> None:
        """
        Take note that a trajectory starts, perhaps from rest in the middle of the goal.

        :param stale_begun: how many motions the robot reports as begun until it has read START.
        :param sent: how many records of the goal were sent before.
        """
        self._awaits_count, self._stale_begun = True, stale_begun
        self._motions_before = self.records.motions_before(sent)
        self._standstill_time = self._standstill_scaled = 0.0
        self.scaled_time = self._tracker.time()  # waiting at rest is no delay of the motion

    def update(
        self,
        state: RobotState,
        begun: int | None,
        behind: int = 0,
        *,
        moving: bool,
        applied_offset: AppliedOffset = NO_OFFSET,
    ) -> None:
        """
        Take a packet; while the goal moves the arm: also time, and position on the path.

        :param begun: how many motions the robot reports as begun; None = it reports none.
        :param behind: by how many motions the controller's target may be behind that.
        :param applied_offset: how far the path has given way there.
        """
        before, self.latest = self.latest, state
        self._applied_offset = applied_offset
        self._reported_begun, self._behind = begun, behind
        passed = 0.0 if before is None else max(0.0, state.timestamp - before.timestamp)
        playing = state.runtime_state is RuntimeState.PLAYING
        self.held_time = passed * (1.0 - state.target_speed_fraction * playing)
        if not moving:
            return
        self._track(before, state, passed)
        begun = self._motions_begun()
        self._running_time += passed * playing
        if begun != self._running:
            self._running_time, self._running = 0.0, begun
        waits = self._has_begun and self._tracker.waits
        # The program waits in real time, and reports no scaling while it does not move the arm.
        held = state.target_speed_fraction <= 0.0 or not playing
        self.rate = state.effective_speed or float(waits and not held)
        elapsed = passed * self.rate
        self.scaled_time += elapsed
        if waits:
            self._tracker.wait(elapsed)
        if _stands_still(before, state):
            self._standstill_time += passed
            # At rest the scaling is 0: only the slider says how fast a wait would pass.
            self._standstill_scaled += passed * state.target_speed_fraction
        else:
            self._standstill_time = self._standstill_scaled = 0.0

    def finish(self, time: float = inf) -> None:
        """Move to the end of the path, or to rest at a time [s]: the robot program reports it."""
        self._tracker.finish(time)

    def append(self, job: MotionJob, records_before: int) -> None:
        """Take a job that follows after so many records."""
        self._tracker.append(job.reference, self.records.end_time(records_before))
        self.records.append(job, records_before)
        self.job = job
        self._standstill_timeout = max(self._standstill_timeout, _standstill_timeout(job))
        if self.latest is not None:
            self.records.forget(self.records_begun() - 2)

    def _track(self, before: RobotState | None, state: RobotState, passed: float) -> None:
        """Find the position on the path."""
        begun, fastest = self._motions_begun(), tracker_speed(state.target_tcp_twist)
        self._has_begun = self._has_begun or begun > self._motions_before or fastest > 0.0
        if before is not None:  # it may have braked since
            fastest = max(fastest, tracker_speed(before.target_tcp_twist))
        running = self.records.running_waypoints(begun, self._behind)
        if running is not None and running[1] < running[0] and self._press() is not None:
            # However far the tool gives way there, the point behind is passed.
            self._tracker.pass_stop(running[1])
        self._tracker.update(self._tracked(state.target_tcp_pose), 2.0 * passed * fastest, running)

    # ---- how far it is ------------------------------------------------------------------------

    def time(self) -> float:
        """Return the planned time of the arm's position on the path [s]."""
        return self._tracker.time()

    def waypoint(self) -> int:
        """Return the index of the next point of the goal."""
        return self._tracker.waypoint()

    def place(self) -> PathPlace | None:
        """Return how far the arm is on the path of the goal; None = it has not begun."""
        return self._tracker.place() if self._has_begun else None

    def buffered(self, sent: int) -> float:
        """Return the planned time of the records that were sent and lie ahead of the arm [s]."""
        return max(0.0, self.records.end_time(sent) - self._tracker.time())

    def records_begun(self) -> int:
        """Return how many records of this goal the robot has begun, at least."""
        return max(
            self.records.begun_records(self._motions_begun()),
            self.records.count_before_waypoint(self.waypoint()),
        )

    def _motions_begun(self) -> int:
        """
        Return how many motions of this goal the robot has begun; 0 = unknown.

        The register keeps the count of the goal before until the robot program has read START, so
        it is believed once it changes.
        """
        begun = self._reported_begun
        if begun is None or (self._awaits_count and begun == self._stale_begun):
            return self._motions_before
        self._awaits_count = False
        return self._motions_before + begun

    def awaits_count(self) -> bool:
        """Tell whether the program has not reported a point of this goal since START."""
        return self._awaits_count

    def progress(
        self, *, buffered: float, lag: float, at_end: bool, waits: bool = False
    ) -> Progress:
        """
        Return a report about the newest packet.

        :param buffered: motion time that the robot has got and not yet run [s].
        :param lag: how far the arm is behind the newest set-point [s].
        :param at_end: whether the arm should be at the end, and not on its way.
        :param waits: whether it rests until more points come.
        """
        state, job = self.latest, self.job
        assert state is not None
        seen = shift_reference_point(state, job.T_tcp_controlled)
        time = self._tracker.time()
        desired = self._tracker.pose() if at_end else self._desired(state)
        return Progress(
            waypoint=self._tracker.waypoint(),
            fraction=1.0 if job.duration <= 0.0 else min(1.0, time / job.duration),
            desired_pose=desired @ job.T_tcp_controlled,
            desired_twist=seen.target_tcp_twist,
            desired_acceleration=seen.target_tcp_acceleration,
            actual_pose=seen.actual_tcp_pose,
            actual_twist=seen.actual_tcp_twist,
            actual_acceleration=seen.actual_tcp_acceleration,
            desired_q=state.target_q,
            desired_qd=state.target_qd,
            actual_q=state.actual_q,
            actual_qd=state.actual_qd,
            time=time,
            time_remaining=max(0.0, job.duration - time),
            speed_scaling=state.effective_speed,
            points_received=self.records.points,
            buffered=buffered,
            lag=lag,
            timestamp=state.timestamp,
            awaiting_points=waits,
            path_offset=self._applied_offset.offset,
        )

    def _desired(self, state: RobotState) -> Pose:
        """Return where the tool should be, near its progress."""
        planned = self._tracker.desired(
            self._tracked(state.actual_tcp_pose), state.target_tcp_twist
        )
        return _moved(planned, self._applied_offset.shift)

    # ---- whether it is what was planned -------------------------------------------------------

    def start_offset(self, state: RobotState) -> str | None:
        """Return how far the arm is from the start of the plan, as a clause, or None."""
        return self._offset_clause(self._start, state.actual_tcp_pose)

    def rest_offset(self, state: RobotState) -> str | None:
        """Return how far the target is from where the arm waits, as a clause, or None."""
        return self._offset_clause(self._tracker.pose(), state.target_tcp_pose)

    def _offset_clause(self, start: Pose, pose: Pose) -> str | None:
        distance, angle = start.distance_to(pose), start.angle_to(pose)
        if distance <= START_POSITION_TOLERANCE and angle <= START_ANGLE_TOLERANCE:
            return None
        return (
            f'the arm is {distance:.4f} m and {angle:.4f} rad away from the start of the plan: '
            'it moved meanwhile'
        )

    def find_fault(self, state: RobotState, *, may_stand_still: bool = False) -> Fault | None:
        """
        Return the fault of a motion, with a clause for the outcome's text, or None.

        :param may_stand_still: the arm may stand still.
        """
        return (
            self._plan_deviation(state)
            or self._late_call()
            or self._speed_violation(state)
            or (None if may_stand_still else self._standstill_fault())
            or self._path_violation(state)
        )

    def missed_end(self, state: RobotState) -> str:
        """Return that the controller's target is not at the end, as a clause; empty = it is."""
        off = [
            value
            for value, limit in zip(
                self._tracker.deviation(self._stiff(state.target_tcp_pose)),
                self._max_plan_deviation,
                strict=True,
            )
            if 0.0 < limit < value
        ]
        return (
            ''
            if not off
            else (
                f'the robot program reports the end {off[0]:.4f} m or rad away from the last '
                'point: it skipped motions that it does not know; set wire_dialect to the '
                'version of that program'
            )
        )

    def missing_input(self) -> str:
        """Return for which input the program has waited in vain, as a clause; empty = unknown."""
        return self._input_wait()[1]

    def _input_wait(self) -> tuple[float, str]:
        """Return the wait at the point to which the last motion led; 0 s = there is none."""
        running = None
        if self.job.input_waits:
            running = self.records.running_waypoints(self._motions_begun())
        return (0.0, '') if running is None else self.job.input_waits.get(running[0], (0.0, ''))

    def goal_violation(self, state: RobotState) -> str | None:
        """Return how far the arm is outside the goal tolerance, as a clause, or None."""
        desired, press = self._tracker.pose(), self._press()
        if press is not None:
            state = press.stiff_state(desired, state)
        return self._violation(
            self._goal_check, desired, state
        ) or self._joint_check.goal_violation(state)

    def contact_clause(self, state: RobotState) -> str:
        """Return where the tool touched, as the beginning of a sentence."""
        x, y, z = state.actual_tcp_pose.position
        place = self._tracker.place()
        return (
            f'The tool touched at x {x:.4f}, y {y:.4f}, z {z:.4f} m in base, on the way to point '
            f'{place.point}, at {place.fraction:.1%} of its segment'
        )

    def _press(self) -> PressWindow | None:
        """Return how the tool may give way where the target is, if it may."""
        if not self.job.presses:
            return None
        time = self._tracker.time()
        return next((press for press in self.job.presses if press.contains(time)), None)

    def _tracked(self, pose: Pose) -> Pose:
        """Return the pose that tells how far the tool is on its path."""
        pose = _moved(pose, scale(self._applied_offset.shift, -1.0))
        press = self._press()
        if press is None or self._tracker.time() > press.end:
            return pose
        planned = self._tracker.pose()
        return press.without_yield(
            planned, pose, press.compliant_share(planned, self._tracker.direction())
        )

    def _stiff(self, pose: Pose) -> Pose:
        """Return a pose of the tool without what it, or its path, has given way."""
        pose = _moved(pose, scale(self._applied_offset.shift, -1.0))
        press = self._press()
        return pose if press is None else press.without_yield(self._tracker.pose(), pose)

    def _gone_back(self, pose: Pose, planned: Pose) -> Pose:
        """Return the planned pose of a tool that may have gone back to where it touched."""
        press = self._press()
        if press is None or not press.ends_at_contact:
            return planned
        behind = self._tracker.behind(pose)
        return behind if behind.distance_to(pose) < planned.distance_to(pose) else planned

    def _plan_deviation(self, state: RobotState) -> Fault | None:
        """Return that the controller's target left the plan, or None."""
        if not self._has_begun or self._tracker.is_within(*self._clearly_allowed):
            return None
        target, here = self._stiff(state.target_tcp_pose), self._tracker.pose()
        planned = self._gone_back(target, here)
        for name, unit, value, limit in zip(
            ('max_plan_deviation', 'max_plan_deviation_angle'),
            ('m', 'rad'),
            self._tracker.deviation(target)
            if planned is here
            else (planned.distance_to(target), planned.angle_to(target)),
            self._max_plan_deviation,
            strict=True,
        ):
            if 0.0 < limit < value:
                return GoalSignal.DEVIATION, (
                    f'the controller itself left the plan by {value:.6f} {unit}, {name} is '
                    f'{limit:.6f} {unit}: the arm is on another branch, or something other than '
                    'this goal moves it'
                )
        return None

    def _speed_violation(self, state: RobotState) -> Fault | None:
        """Return that a program without progress reports is much too fast or slow, or None."""
        if self._speed_check is None or not self._awaits_count:
            return None
        clause = self._speed_check.violation(
            state.target_tcp_twist, self.scaled_time, self._tracker.time()
        )
        return None if clause is None else (GoalSignal.DEVIATION, clause)

    def _late_call(self) -> Fault | None:
        """Return that a function of the prelude takes too long, or None."""
        timeout, where = self.script_call()
        if not timeout or self._running_time <= timeout:
            return None
        return GoalSignal.DEVIATION, (
            f'the robot program has been {where} for more than its timeout of {timeout:g} s'
        )

    def script_call(self) -> tuple[float, str]:
        """Return the longest time of the function that is called [s], and where; 0 s = none is."""
        if not self.job.script_calls:
            return 0.0, ''
        record = self.records.begun_records(self._motions_begun()) - 1
        return self.job.script_calls.get(record, (0.0, ''))

    def _standstill_fault(self) -> Fault | None:
        """Return that the arm stands although nothing holds it, or None."""
        if (
            self._standstill_time < STANDSTILL_TIMEOUT
            or self._standstill_scaled < self._standstill_timeout
        ):
            return None
        longest = max(self._input_wait()[0], self.script_call()[0])
        if self._standstill_time < longest + STANDSTILL_MARGIN:
            return None
        return GoalSignal.STANDSTILL, (
            f'the arm has stood still for {self._standstill_time:.3g} s, nothing holds it, and '
            'the robot program has not reported the end: a message to it or from it was lost, so '
            'it was ended'
        )

    def _path_violation(self, state: RobotState) -> Fault | None:
        press = self._press()
        checked = self._path_check or press or self._joint_check.has_path
        if not (checked and self._has_begun):
            return None
        clause = self._joint_check.path_violation(state)
        if clause is None and (self._path_check or press):
            desired = self._desired(state)
            if press is not None:
                desired = self._gone_back(self._tracked(state.actual_tcp_pose), desired)
                clause = press.excess(desired, state, self._tracker.time())
                state = press.stiff_state(desired, state)
            clause = clause or self._violation(self._path_check, desired, state)
        if clause is None:
            return None
        return GoalSignal.VIOLATION, f'on the way to point {self._tracker.waypoint()} {clause}'

    def _violation(self, check: ToleranceCheck, desired: Pose, state: RobotState) -> str | None:
        """Check the controlled frame; ``desired`` is of the TCP."""
        if self._checks_tcp:
            return check.violation(desired, state)
        T_tcp_controlled = self.job.T_tcp_controlled
        return check.violation(
            desired @ T_tcp_controlled, shift_reference_point(state, T_tcp_controlled)
        )


def _moved(pose: Pose, shift: Vector3) -> Pose:
    """Return a pose, moved along the axes of the base."""
    return pose if not any(shift) else Pose(add(pose.position, shift), pose.quaternion)


def _stands_still(before: RobotState | None, state: RobotState) -> bool:
    """Tell whether the target stands although neither slider nor pause holds it."""
    return (
        before is not None
        and state.target_q == before.target_q
        and state.target_tcp_pose == before.target_tcp_pose
        and state.target_speed_fraction > 0.0
        and state.runtime_state is RuntimeState.PLAYING
    )


def _standstill_timeout(job: MotionJob) -> float:
    """Return for how long the arm may stand in a motion, of the controller's time [s]."""
    path = job.reference
    still = (np.abs(np.diff(path.poses, axis=0)) < SAME_POSE).all(axis=1)
    # A wait may have several rows: those that follow each other count as one.
    waits = np.bincount(np.cumsum(~still), weights=np.where(still, np.diff(path.time), 0.0))
    longest = max(float(waits.max(initial=0.0)), job.output_delay)
    return longest + STANDSTILL_MARGIN if longest > 0.0 else 0.0
