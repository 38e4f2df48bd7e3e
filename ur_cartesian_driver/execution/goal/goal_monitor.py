# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Compare each packet of the robot with the plan of a goal, to find its progress and faults.

The monitor finds faults and decides nothing: the table of :mod:`~.goal_transitions` gives the
consequence of each fault in each state.

The *target* is the pose that the controller commands at this moment, as RTDE reports it. A
*record* is one instruction for the robot program. Most records are *motions*; the program reports
how many of them it has begun. A goal that waits at rest for more points continues in a new
*trajectory*.
"""

from __future__ import annotations

from math import inf

from ur_cartesian_driver.execution.goal.feed_state import FeedState, FULL_FEED
from ur_cartesian_driver.execution.goal.motion_job import MotionJob
from ur_cartesian_driver.execution.goal.outcome_codes import Fault, GoalSignal
from ur_cartesian_driver.execution.goal.wire_records import WireRecords
from ur_cartesian_driver.execution.monitoring.joint_tolerance_check import JointToleranceCheck
from ur_cartesian_driver.execution.monitoring.path_tracker import PathTracker, tracker_speed
from ur_cartesian_driver.execution.monitoring.press_window import PressWindow
from ur_cartesian_driver.execution.monitoring.speed_check import REMEDY, SpeedCheck
from ur_cartesian_driver.execution.monitoring.standstill import Standstill
from ur_cartesian_driver.execution.monitoring.tolerance_check import ToleranceCheck
from ur_cartesian_driver.motion.events import PathPlace, Progress
from ur_cartesian_driver.motion.geometry.pose import Pose, pose_from_row
from ur_cartesian_driver.motion.geometry.vectors import add, subtract
from ur_cartesian_driver.motion.plan.offset_band import AppliedOffset, NO_OFFSET
from ur_cartesian_driver.motion.state.rigid_body import shift_reference_point
from ur_cartesian_driver.motion.state.rtde_state import RobotState, RuntimeState

#: Largest distance [m] and angle [rad] between the arm and the start of the plan, and between the
#: target and the place at which the arm has waited for points.
START_POSITION_TOLERANCE, START_ANGLE_TOLERANCE = 0.001, 0.01
#: Largest distance [m] and angle [rad] between the target and the plan.
MAX_PLAN_DEVIATION = (0.002, 0.02)


class GoalMonitor:
    """The newest packet, the position on the path, and the checks of both."""

    def __init__(
        self, job: MotionJob, max_plan_deviation: tuple[float, float] = MAX_PLAN_DEVIATION
    ) -> None:
        """
        Begin before the first packet.

        :param max_plan_deviation: the largest distance [m] and angle [rad] between the target and
            the plan; 0 = no limit.
        """
        #: The newest job, which an appended job replaces; the records of the whole goal.
        self.job, self.records = job, WireRecords(job)
        self._start = pose_from_row(job.reference.poses[0])
        self._tracker = PathTracker(job.reference)
        self._speed_check = SpeedCheck(job.reference) if job.has_speed_profile else None
        frames = job.T_base_frame, job.T_tcp_controlled
        self._path_check = ToleranceCheck(job.path_tolerance, *frames)
        self._goal_check = ToleranceCheck(job.goal_tolerance, *frames)
        self._joint_check = JointToleranceCheck(job.joint_tolerances)
        self._standstill = Standstill(job.reference, job.output_delay)
        self._max_plan_deviation = max_plan_deviation
        self._clearly_allowed = tuple(limit or inf for limit in max_plan_deviation)
        #: Whether the robot program is known to have started the trajectory: it has begun a
        #: motion, or the target has moved.
        self._has_begun = False
        #: Number of begun motions: of the goal, and of its trajectories before the running one.
        self._motions_begun = self._motions_before = 0
        #: The count of begun motions that the robot reported before the command START (None = no
        #: trajectory was started yet); whether the robot may still report that count.
        self._stale_begun: int | None = None
        self._awaits_count = False
        #: Running time of the newest motion [s]; its number.
        self._running_time, self._running = 0.0, 0
        #: The newest packet; None before the first packet.
        self.latest: RobotState | None = None
        self._applied_offset, self._feed = NO_OFFSET, FULL_FEED
        #: Whether a contact watch outside of the goal stops the arm at contact, and moves it back.
        self.contact_is_watched = False
        #: Time since the start in the time of the motion, which runs slower than real time while
        #: the motion is slowed [s]; delay that the end of the goal may have, because the motion
        #: began late, waited or was slowed [s].
        self.scaled_time = self.allowed_delay = 0.0
        #: Time by which speed slider and pauses have delayed motions between the previous and the
        #: newest packet [s]; it also counts while the arm does not move.
        self.held_time = 0.0
        #: Rate of the motion's time just before the newest packet: 0 = stopped, 1 = real time.
        self.rate = 0.0

    # ---- progress -----------------------------------------------------------------------------

    def start(self, stale_begun: int, sent: int = 0) -> None:
        """
        Note that a trajectory starts, perhaps from rest in the middle of the goal.

        :param stale_begun: the count of begun motions that the robot reports until it reads START.
            This is the count of the previous trajectory, so the count is trusted once it changes.
        :param sent: number of records of the goal that were sent before this trajectory.
        """
        self._stale_begun, self._awaits_count = stale_begun, True
        self._motions_begun = self._motions_before = self.records.motions_before(sent)
        self._standstill.restart()
        # Earlier delays no longer count, and the wait at rest does not delay the motion.
        self.scaled_time, self.allowed_delay = self._tracker.time(), 0.0

    def update(
        self,
        state: RobotState,
        begun: int | None,
        behind: int = 0,
        *,
        moving: bool,
        applied_offset: AppliedOffset = NO_OFFSET,
        feed: FeedState = FULL_FEED,
    ) -> None:
        """
        Process a packet; if ``moving``, also advance the time and the position on the path.

        :param begun: number of begun motions that the robot reports; None = it gives no count.
        :param behind: largest number of motions by which the target can lag behind that count.
        :param moving: whether the goal moves the arm.
        :param applied_offset: the path offset at the target.
        :param feed: the feed override of the motion.
        """
        before, self.latest = self.latest, state
        self._applied_offset = applied_offset
        # The goal may end later by the delay that its feed override asks for.
        self.allowed_delay += feed.delay - self._feed.delay
        self._feed = feed
        passed = 0.0 if before is None else max(0.0, state.timestamp - before.timestamp)
        playing = state.runtime_state is RuntimeState.PLAYING
        self.held_time = passed * (1.0 - state.target_speed_fraction * playing)
        self._count(begun)
        if not moving:
            return
        self._running_time += passed * playing
        if self._motions_begun != self._running:
            self._running_time, self._running = 0.0, self._motions_begun
        self._track(before, state, passed, behind)
        waits = self._has_begun and self._tracker.waits
        # Planned waits take real time, although the reported speed scaling is 0 meanwhile.
        held = state.target_speed_fraction <= 0.0 or not playing
        self.rate = state.effective_speed or float(waits and not held)
        elapsed = passed * self.rate
        self.scaled_time += elapsed
        if waits:
            self._tracker.wait(elapsed * feed.value)
        self._standstill.update(before, state, passed, feed.value)

    def _count(self, begun: int | None) -> None:
        """Accept the reported count of motions, unless it may be the previous trajectory's."""
        if begun is None or self._stale_begun is None or not self.job.reports_points_begun:
            return
        if not self._awaits_count or begun != self._stale_begun:
            self._awaits_count = False
            self._motions_begun = self._motions_before + begun

    def _track(
        self, before: RobotState | None, state: RobotState, passed: float, behind: int
    ) -> None:
        """Find the position of the controller's target on the path."""
        begun, fastest = self._motions_begun, tracker_speed(state.target_tcp_twist)
        self._has_begun = self._has_begun or begun > self._motions_before or fastest > 0.0
        if before is not None:  # the tool may have braked since the packet before
            fastest = max(fastest, tracker_speed(before.target_tcp_twist))
        running = self.records.running_waypoints(begun, behind)
        if running is not None and running[1] < running[0] and self._press() is not None:
            # A press may hold the tool off its path, so the tracker is told that the previous
            # point was passed.
            self._tracker.pass_stop(running[1])
        self._tracker.update(self._tracked(state.target_tcp_pose), 2.0 * passed * fastest, running)

    def finish(self, time: float = inf) -> None:
        """Set the position to the end of the path, or to the rest at a planned time [s]."""
        self._tracker.finish(time)

    def append(self, job: MotionJob, records_before: int) -> None:
        """Append a job, whose records follow the first ``records_before`` records of the goal."""
        self._tracker.append(job.reference, self.records.end_time(records_before))
        self.records.append(job, records_before)
        self.job = job
        self._standstill.extend(job.reference, job.output_delay)
        if self.latest is not None:
            self.records.forget(self.records_begun() - 2)

    @property
    def motions_begun(self) -> int:
        """The number of motions of the goal that the robot program has begun."""
        return self._motions_begun

    def awaits_count(self) -> bool:
        """Return whether the program has yet to report a motion of this goal after START."""
        return self._awaits_count

    def time(self) -> float:
        """Return the planned time of the arm's position on the path [s]."""
        return self._tracker.time()

    def waypoint(self) -> int:
        """Return the index of the point to which the tool moves."""
        return self._tracker.waypoint()

    def place(self) -> PathPlace | None:
        """Return the arm's place on the path of the goal; None = the motion has not begun."""
        return self._tracker.place() if self._has_begun else None

    def buffered(self, sent: int) -> float:
        """Return the planned time from the arm's place to the end of the ``sent`` records [s]."""
        return max(0.0, self.records.end_time(sent) - self._tracker.time())

    def records_begun(self) -> int:
        """Return the number of records of this goal that the robot has begun, as far as known."""
        return max(
            self.records.begun_records(self._motions_begun),
            self.records.count_before_waypoint(self.waypoint()),
        )

    def script_call(self) -> tuple[float, str]:
        """
        Return the timeout [s] of the running script call, and a clause that names its place.

        (0, '') = no function of the user's prelude is running.
        """
        if not self.job.script_calls:
            return 0.0, ''
        record = self.records.begun_records(self._motions_begun) - 1
        return self.job.script_calls.get(record, (0.0, ''))

    def _input_wait(self) -> tuple[float, str]:
        """
        Return the timeout [s] of the running wait for an input, and the clause for its failure.

        (0, '') = the program does not wait for an input.
        """
        running = None
        if self.job.input_waits:
            running = self.records.running_waypoints(self._motions_begun)
        return (0.0, '') if running is None else self.job.input_waits.get(running[0], (0.0, ''))

    # ---- reports ------------------------------------------------------------------------------

    def progress(
        self, *, buffered: float, lag: float, at_end: bool, waits: bool = False
    ) -> Progress:
        """
        Return a progress report from the newest packet.

        :param buffered: motion time that the robot has received and not yet run [s].
        :param lag: the time by which the arm lags the newest set-point [s].
        :param at_end: whether the arm should be at the end, not on its way there.
        :param waits: whether the arm rests until more points come.
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
            feed_override=self._feed.value,
            feed_is_valid=self._feed.is_valid,
        )

    def success_text(self) -> str:
        """Return the sentence for a goal that has reached its last point."""
        points = self.records.points
        subject = 'The point was' if points == 1 else f'All {points} points were'
        return f'{subject} executed in {self.scaled_time:.3f} s.'

    def location(self) -> str:
        """Return the place of the arm on the path, as a clause."""
        return self.script_call()[1] or f'on the way to point {self.waypoint()}'

    def contact_clause(self, state: RobotState) -> str:
        """Return the place of contact, as the beginning of a sentence."""
        x, y, z = state.actual_tcp_pose.position
        place = self._tracker.place()
        return (
            f'The tool touched at x {x:.4f}, y {y:.4f}, z {z:.4f} m in base, on the way to point '
            f'{place.point}, at {place.fraction:.1%} of its segment'
        )

    def missing_input(self) -> str:
        """Return a clause about the input that did not come in time; '' = unknown."""
        return self._input_wait()[1]

    # ---- faults -------------------------------------------------------------------------------

    def find_fault(self, state: RobotState, *, may_stand_still: bool = False) -> Fault | None:
        """
        Return the fault of a motion, with a clause for the outcome's text, or None.

        :param may_stand_still: whether a still arm is no fault.
        """
        if clause := self._plan_deviation(state) or self._late_call() or self._wrong_speed(state):
            return GoalSignal.DEVIATION, clause + self.law_clause()
        if self._standstill.is_long and not may_stand_still:
            longest_wait = max(self._input_wait()[0], self.script_call()[0])
            if clause := self._standstill.violation(longest_wait):
                return GoalSignal.STANDSTILL, clause
        if clause := self._path_violation(state):
            clause += self.law_clause()
            return GoalSignal.VIOLATION, f'on the way to point {self.waypoint()} {clause}'
        return None

    def law_clause(self) -> str:
        """
        Return a clause if the controller's motion version differs from the planned one, else ''.

        The version decides how the controller times movej and movel; plans assume version 1.
        """
        job, version = self.job, 0 if self.latest is None else self.latest.motion_version
        is_moves = job.reports_points_begun and not job.execution.traits.is_spline
        if not is_moves or version <= 1:
            return ''
        return (
            f'; the robot moves by motion version {version}, but the plan follows the laws of '
            'version 1 (motion_version: 1 sets version 1)'
        )

    def start_offset(self, state: RobotState) -> str | None:
        """Return a clause if the arm is away from the start of the plan, else None."""
        return _offset_clause(self._start, state.actual_tcp_pose, 'the start of the plan')

    def rest_offset(self, state: RobotState) -> str | None:
        """Return a clause if the target is away from the place where the arm waits, else None."""
        return _offset_clause(self._tracker.pose(), state.target_tcp_pose, 'where it waits')

    def missed_end(self, state: RobotState) -> str:
        """Return a clause if the controller's target is not at the end, else ''."""
        deviation = self._tracker.deviation(self._stiff(state.target_tcp_pose))
        for unit, value, limit in zip(
            ('m', 'rad'), deviation, self._max_plan_deviation, strict=True
        ):
            if 0.0 < limit < value:
                return (
                    f'the robot program reports the end {value:.4f} {unit} away from the last '
                    f'point: it skipped motions that it does not know; {REMEDY}'
                )
        return ''

    def goal_violation(self, state: RobotState) -> str | None:
        """Return a clause if the arm is outside the goal tolerance, else None."""
        desired, press = self._tracker.pose(), self._press()
        if press is not None:
            state = press.stiff_state(desired, state)
        return self._goal_check.violation(desired, state) or self._joint_check.goal_violation(
            state
        )

    def _plan_deviation(self, state: RobotState) -> str | None:
        """Return a clause if the controller's target has left the plan, else None."""
        if not self._has_begun or self._tracker.is_within(*self._clearly_allowed):
            return None
        target, here = self._stiff(state.target_tcp_pose), self._tracker.pose()
        planned = self._retracted(target, here)
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
                return (
                    f'the controller itself left the plan by {value:.6f} {unit}, {name} is '
                    f'{limit:.6f} {unit}: the arm is on another branch, or something other than '
                    'this goal moves it'
                )
        return None

    def _late_call(self) -> str | None:
        """Return a clause if a function of the user's prelude takes too long, else None."""
        timeout, where = self.script_call()
        if not timeout or self._running_time <= timeout:
            return None
        return f'the robot program has been {where} for more than its timeout of {timeout:g} s'

    def _wrong_speed(self, state: RobotState) -> str | None:
        """Return a clause if a program that reports no progress moves far too fast or slowly."""
        if self._speed_check is None or not self._awaits_count:
            return None
        return self._speed_check.violation(state.target_tcp_twist, self.scaled_time, self.time())

    def _path_violation(self, state: RobotState) -> str | None:
        """Return a clause if the arm is outside the path tolerance, else None."""
        press = self._press()
        checked = self._path_check or press or self._joint_check.has_path
        if not (checked and self._has_begun):
            return None
        clause = self._joint_check.path_violation(state)
        if clause is None and (self._path_check or press):
            desired = self._desired(state)
            if self._may_retract():
                desired = self._retracted(self._tracked(state.actual_tcp_pose), desired)
            if press is not None:
                clause = press.excess(desired, state, self._tracker.time())
                state = press.stiff_state(desired, state)
            clause = clause or self._path_check.violation(desired, state)
        return clause

    # ---- the planned pose of a tool that may give way -----------------------------------------

    def _press(self) -> PressWindow | None:
        """Return the press that includes the present path position, or None."""
        if not self.job.presses:
            return None
        time = self._tracker.time()
        return next((press for press in self.job.presses if press.contains(time)), None)

    def _desired(self, state: RobotState) -> Pose:
        """Return the planned pose nearest to the tool, displaced by the path offset."""
        planned = self._tracker.desired(
            self._tracked(state.actual_tcp_pose), state.target_tcp_twist
        )
        shift = self._applied_offset.shift
        return Pose(add(planned.position, shift), planned.quaternion) if any(shift) else planned

    def _tracked(self, pose: Pose) -> Pose:
        """
        Return a pose without the path offset, and without the tool's yield in a press.

        Yield along the path cannot be told from progress, so this share of it is kept.
        """
        pose, press = self._undisplaced(pose), self._press()
        if press is None or self._tracker.time() > press.end:
            return pose
        planned = self._tracker.pose()
        return press.without_yield(
            planned, pose, press.compliant_share(planned, self._tracker.direction())
        )

    def _stiff(self, pose: Pose) -> Pose:
        """Return a pose without the path offset, and without any yield of the tool in a press."""
        pose, press = self._undisplaced(pose), self._press()
        return pose if press is None else press.without_yield(self._tracker.pose(), pose)

    def _undisplaced(self, pose: Pose) -> Pose:
        shift = self._applied_offset.shift
        return Pose(subtract(pose.position, shift), pose.quaternion) if any(shift) else pose

    def _may_retract(self) -> bool:
        press = self._press()
        return self.contact_is_watched or (press is not None and press.ends_at_contact)

    def _retracted(self, pose: Pose, planned: Pose) -> Pose:
        """Return the planned pose, or an earlier one if it is nearer to a retracting tool."""
        if not self._may_retract():
            return planned
        behind = self._tracker.behind(pose)
        return behind if behind.distance_to(pose) < planned.distance_to(pose) else planned


def _offset_clause(planned: Pose, pose: Pose, place: str) -> str | None:
    distance, angle = planned.distance_to(pose), planned.angle_to(pose)
    if distance <= START_POSITION_TOLERANCE and angle <= START_ANGLE_TOLERANCE:
        return None
    return f'the arm is {distance:.4f} m and {angle:.4f} rad away from {place}: it moved meanwhile'
