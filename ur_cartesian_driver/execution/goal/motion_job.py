# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The part of a plan that the robot process needs: small, because it travels between processes."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from itertools import count
from math import inf
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ur_cartesian_driver.execution.monitoring.press_window import PressWindow
from ur_cartesian_driver.motion.geometry.arrays import Flags, Floats, Int32s
from ur_cartesian_driver.motion.geometry.pose import conjugate, IDENTITY, Pose, Quaternion
from ur_cartesian_driver.motion.geometry.vectors import vector6
from ur_cartesian_driver.motion.goal.execution_modes import ExecutionMode
from ur_cartesian_driver.motion.goal.goal import (
    ContactEnd,
    DEFAULT_FEED_MOTION,
    DEFAULT_STALL_TIMEOUT,
    DEFAULT_YIELDS,
    FeedOverride,
    Goal,
    OnPathTolerance,
    OutputKind,
    PRESS_AXES,
    PressFrame,
    SafeOutput,
    Tolerance,
)
from ur_cartesian_driver.motion.goal.joint_goal import JointTolerances
from ur_cartesian_driver.motion.goal.moving_frame import MovingFrame
from ur_cartesian_driver.motion.goal.output_names import pulse_outputs
from ur_cartesian_driver.motion.plan.joint_spline import JointSpline
from ur_cartesian_driver.motion.plan.move_rows import blend_radii, has_optimized, stops
from ur_cartesian_driver.motion.plan.offset_band import OffsetBand
from ur_cartesian_driver.motion.plan.plan import Plan, PlannedRows, ReferencePath
from ur_cartesian_driver.motion.plan.primitive import (
    AwaitInput,
    CallFunction,
    Stop,
    SwitchOutput,
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Hold:
    """A pause of the set-points, while the robot program acts at a point."""

    #: Arrival at the point [s]; continuation of the path, after all planned rests [s].
    begin: float
    end: float
    #: Number of begun motions once the robot program is done; inf = the goal ends there.
    motions: float


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class MotionJob:
    """The part of a plan that a goal machine needs."""

    #: Number of records on the wire: motions and outputs.
    points: int
    reference: ReferencePath
    #: Expected time from the start of the goal to the end of the motion, at full speed [s].
    duration: float
    #: Due time of the last point [s]; None = the goal gives no times.
    due: float | None = None
    #: Delay of the last output after the end of the motion [s]; ``due`` includes it.
    output_delay: float = 0.0
    T_base_frame: Pose = IDENTITY
    #: The motion of the goal's frame; None = the frame is fixed in the base.
    moving_frame: MovingFrame | None = None
    #: The robot's TCP at the time of planning.
    T_flange_active: Pose = IDENTITY
    #: The TCP that the plan needs; None = ``T_flange_active``.
    T_flange_tcp: Pose | None = None
    #: The controlled frame relative to the TCP that the plan needs.
    T_tcp_controlled: Pose = IDENTITY
    path_tolerance: Tolerance = field(default_factory=Tolerance)
    goal_tolerance: Tolerance = field(default_factory=Tolerance)
    #: The joint tolerances of a joint goal, in addition to the tolerances above.
    joint_tolerances: JointTolerances | None = None
    #: Allowed delay of the end [s]; 0 = the default, negative = no limit.
    goal_time_tolerance: float = 0.0
    #: Whether the robot program reports the number of motions that it has begun.
    reports_points_begun: bool = True
    #: Whether speeds are checked against the plan: not for OPTIMIZED moves, whose speeds the robot
    #: chooses, nor for open goals and set-points.
    has_speed_profile: bool = True
    execution: ExecutionMode = ExecutionMode.PRIMITIVES
    #: (records,) index of the waypoint to which each motion leads, or each output belongs; empty =
    #: record i is the motion to waypoint i.
    waypoint: Int32s = field(default_factory=lambda: np.empty(0, dtype=np.int32))
    #: (records,) mask of the records that are motions, which the robot program counts; empty = all
    #: records are motions.
    is_motion: Flags = field(default_factory=lambda: np.empty(0, dtype=np.bool_))
    #: (records,) planned end of each record [s]; an output ends with its motion. Empty = the
    #: arrival of the reference path at the waypoint of the record.
    end_times: Floats = field(default_factory=lambda: np.empty(0))
    #: (records,) time at which the robot program, running a record, asks for the next one [s]: the
    #: end of the record or, with a blend there, the beginning of the blend. Empty = ``end_times``.
    request_times: Floats = field(default_factory=lambda: np.empty(0))
    #: Whether points may be appended (keep_open).
    keep_open: bool = False
    #: Motion farther ahead of the arm than this time must remain replaceable [s]; 0 = need not.
    replace_horizon: float = 0.0
    #: Number of records at the end of an open goal that bring the arm to rest if no more follow.
    ending_records: int = 0
    #: Whether the robot program acts at some point while the arm stands still.
    has_stops: bool = False
    #: By waypoint with a wait for an input: the timeout of the wait [s], and the clause that
    #: explains a failure because the input did not come.
    input_waits: Mapping[int, tuple[float, str]] = field(default_factory=dict)
    #: By number of a record that calls a function of the prelude: the longest duration of the call
    #: [s], and a clause that names the function and the point.
    script_calls: Mapping[int, tuple[float, str]] = field(default_factory=dict)
    #: The parts of the path where the tool may give way.
    presses: tuple[PressWindow, ...] = ()
    #: The values that outputs take when the motion does not go on as planned.
    safe_outputs: tuple[SafeOutput, ...] = ()
    #: Longest wait of the motion for an arm that is off its path [s]; 0 = no wait.
    stall_timeout: float = 0.0
    #: The analog outputs that follow the speed (``proportional_outputs``), and the digital ones
    #: that give pulses, in the order in which the program counts them. After a pause the robot
    #: program writes them again, so the driver does not restore them.
    following_outputs: frozenset[tuple[OutputKind, int]] = frozenset()
    pulse_outputs: tuple[tuple[OutputKind, int], ...] = ()
    #: The band within which offsets may displace the path; None = no offsets.
    offset_band: OffsetBand | None = None
    #: The bounds of a signal that may slow the motion, with defaults filled in; None = no signal.
    feed_override: FeedOverride | None = None
    #: For SERVO: the joint positions over time, and their holds, in order.
    spline: JointSpline | None = None
    holds: tuple[Hold, ...] = ()

    def __post_init__(self) -> None:
        """Fill in the empty columns."""

        def fill(name: str, value: NDArray[Any]) -> None:
            if not len(getattr(self, name)):
                object.__setattr__(self, name, value)

        fill('waypoint', np.arange(self.points, dtype=np.int32))
        fill('is_motion', np.ones(self.points, dtype=np.bool_))
        rows = np.searchsorted(self.reference.point, self.waypoint, side='right') - 1
        fill('end_times', self.reference.time[np.maximum(rows, 0)])
        fill('request_times', self.end_times)

    @property
    def has_events(self) -> bool:
        """Whether the robot program acts along the path or at points."""
        return self.has_stops or not self.is_motion.all()

    @property
    def own_program_needs(self) -> str:
        """A feature of the job that only our own robot program has, as a noun; '' = none."""
        if self.following_outputs:
            return 'outputs that follow the speed (proportional_outputs)'
        if self.pulse_outputs:
            return 'pulses'
        if not self.is_motion.all():
            return 'outputs (io_commands)'
        if self.has_stops:
            return 'what is done at points (dwell, input_waits, script_calls and the like)'
        if self.safe_outputs:
            return 'outputs that have to be safe (safe_outputs)'
        if self.offset_band is not None and not self.execution.traits.streams_setpoints:
            return 'offsets of its path (path_offset)'
        if self.feed_override is not None and not self.execution.traits.streams_setpoints:
            return 'a signal that slows it (feed_override)'
        return '' if self.T_flange_tcp is None else 'another TCP than the robot has'


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class AppendJob:
    """Records appended to an open goal."""

    #: The number of this request; the answer carries the same number.
    number: int
    #: Number of kept records of the goal; the appended records follow them, and replace any
    #: later ones.
    records_before: int
    #: The appended records, with times since the start of the goal; the reference path continues
    #: the kept records. None = the client closes the goal, which gets no more points.
    job: MotionJob | None
    #: Time at which the new motion leaves the plan of the kept records [s]; None = at their end.
    cut_time: float | None = None


def job_from_plan(
    plan: Plan,
    *,
    start_time: float = 0.0,
    ending_records: int = 0,
    spline: JointSpline | None = None,
) -> MotionJob:
    """
    Return the job of a plan.

    :param start_time: when the plan's first segment begins, since the start of the goal [s]; not
        0 for appended points.
    :param ending_records: see :class:`MotionJob`.
    :param spline: the joint spline of a part that does not begin at rest; None = the plan's own.
    """
    goal, rows, streams = plan.goal, plan.rows, plan.execution.traits.streams_setpoints
    stalls = goal.on_path_tolerance is OnPathTolerance.STALL
    last_time, output_delay = goal.waypoints[-1].time, _longest_delay(rows, len(rows) - 1)
    duration = start_time + plan.duration
    first_records = np.cumsum(rows.records) - rows.records
    is_motion = np.zeros(int(rows.records.sum()), dtype=np.bool_)
    is_motion[first_records] = True
    end_times = start_time + np.cumsum(rows.durations)
    standing = stops(rows.primitives)
    return MotionJob(
        points=len(is_motion),
        reference=plan.reference,
        duration=duration,
        # A goal slowed with the client's consent (on_too_fast) is not late.
        due=max(last_time, duration) + output_delay if last_time > 0.0 else None,
        output_delay=output_delay,
        T_base_frame=goal.T_base_frame,
        moving_frame=goal.moving_frame,
        T_flange_active=plan.T_flange_active,
        T_flange_tcp=plan.T_flange_tcp,
        T_tcp_controlled=plan.T_tcp_controlled,
        path_tolerance=goal.path_tolerance,
        goal_tolerance=goal.goal_tolerance,
        joint_tolerances=plan.joint_tolerances,
        goal_time_tolerance=goal.goal_time_tolerance,
        reports_points_begun=not plan.older_program,
        execution=plan.execution,
        keep_open=goal.keep_open,
        replace_horizon=goal.replace_horizon,
        presses=tuple(_press_windows(plan)),
        offset_band=plan.offset_band,
        feed_override=_feed_override(goal.feed_override),
        safe_outputs=goal.safe_outputs,
        following_outputs=frozenset(
            (OutputKind.STANDARD_ANALOG, output.pin) for output in goal.proportional_outputs
        ),
        pulse_outputs=pulse_outputs(goal.pulses),
        stall_timeout=(goal.stall_timeout or DEFAULT_STALL_TIMEOUT) if stalls else 0.0,
        ending_records=ending_records,
        has_stops=bool(standing),
        input_waits=_input_waits(rows, standing),
        script_calls=_script_calls(rows, standing, first_records),
        has_speed_profile=not (goal.keep_open or streams or has_optimized(rows.primitives)),
        waypoint=np.repeat(rows.waypoints, rows.records),
        is_motion=is_motion,
        end_times=np.repeat(end_times, rows.records),
        request_times=np.repeat(end_times - _blend_lead_times(rows), rows.records),
        spline=(spline or plan.joint_spline) if streams else None,
        holds=tuple(_holds(standing, end_times)) if streams else (),
    )


def _holds(standing: Mapping[int, Stop], end_times: Floats) -> Iterator[Hold]:
    """Yield a hold for each run of consecutive stops."""
    for row in standing:
        if row - 1 in standing:
            continue
        last = next(after for after in count(row) if after + 1 not in standing)
        yield Hold(
            begin=float(end_times[row - 1]),
            end=float(end_times[last]),
            motions=last + 2 if last + 1 < len(end_times) else inf,
        )


def _input_waits(rows: PlannedRows, standing: Mapping[int, Stop]) -> dict[int, tuple[float, str]]:
    """Return ``input_waits`` of the job."""
    return {
        int(rows.waypoints[row]): (
            stop.timeout,
            f'{stop.condition} did not come within {stop.timeout:g} s at point '
            f'{rows.waypoints[row]}',
        )
        for row, stop in standing.items()
        if isinstance(stop, AwaitInput)
    }


def _script_calls(
    rows: PlannedRows, standing: Mapping[int, Stop], first_records: NDArray[np.int_]
) -> dict[int, tuple[float, str]]:
    """Return ``script_calls`` of the job."""
    return {
        int(first_records[row]): (
            # The delayed outputs of the call are part of the same motion.
            stop.timeout + _longest_delay(rows, row),
            f'in {stop.text} at point {rows.waypoints[row]}',
        )
        for row, stop in standing.items()
        if isinstance(stop, CallFunction)
    }


def _press_windows(plan: Plan) -> Iterator[PressWindow]:
    """Yield a window for each press: its times on the reference path, and its bounds."""
    reference, goal = plan.reference, plan.goal
    rows = np.searchsorted(reference.point, np.arange(len(goal.waypoints)), side='right') - 1
    times = [*reference.time[rows].tolist(), inf]
    for press in goal.presses:
        yield PressWindow(
            begin=0.0 if press.first_waypoint < 0 else times[press.first_waypoint],
            end=times[press.last_waypoint],
            release=times[press.last_waypoint + 1],
            compliant=vector6(float(axis in press.axes) for axis in PRESS_AXES),
            q_base_task={
                PressFrame.TOOL: None,
                PressFrame.GOAL: goal.T_base_frame.quaternion,
                PressFrame.BASE: _base_seen(goal, press.last_waypoint),
            }[press.frame],
            max_yields=(
                press.max_yield or DEFAULT_YIELDS[0],
                press.max_yield_angle or DEFAULT_YIELDS[1],
            ),
            ends_at_contact=press.contact != ContactEnd.NONE,
        )


def _base_seen(goal: Goal, waypoint: int) -> Quaternion:
    """Return the orientation of the base in the frame of the path, with the tool at a point."""
    if goal.moving_frame is None:
        return IDENTITY.quaternion
    return conjugate(goal.moving_frame.frame_under(goal.waypoints[waypoint].pose).quaternion)


def _feed_override(wanted: FeedOverride) -> FeedOverride | None:
    """Return the bounds of a feed override with the defaults filled in; None = no override."""
    if not wanted:
        return None
    rate, timeout = DEFAULT_FEED_MOTION
    return replace(
        wanted,
        maximum=wanted.maximum or 1.0,
        rate=wanted.rate or rate,
        timeout=wanted.timeout or timeout,
    )


def _longest_delay(rows: PlannedRows, row: int) -> float:
    """Return the delay of a motion's last output after the end of the motion [s]."""
    records = rows.outputs.get(row, ())
    return max((each.delay for each in records if isinstance(each, SwitchOutput)), default=0.0)


def _blend_lead_times(rows: PlannedRows) -> Floats:
    """Return upper bounds (n,) on the time from a motion's blend to the motion's end [s]."""
    radii = blend_radii(rows.primitives)
    # The first bound holds if the tool is not slower in the blend than on average in the
    # segment. If it brakes before the blend, the time in the blend entry is longer.
    share = radii / np.maximum(np.maximum(rows.lengths, radii), 1e-300)
    times: Floats = np.maximum(rows.durations * share, rows.blend_entries[:, -1])
    return times
