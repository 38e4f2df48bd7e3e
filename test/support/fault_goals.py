# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The goals to which something goes wrong, and how each is brought to a phase.

Phases are found by looking, at the messages on the wire, at the points that the robot program has
begun and at where the tool is; never by the time that it should take.
"""

from dataclasses import replace
from functools import lru_cache
from math import atan2, cos, pi, sin

from fault_table import BEFORE
import robot_cell
from robot_cell import CellMotion, CYCLE, RobotCell

from ur_cartesian_driver.driver.appender import encode_plan
from ur_cartesian_driver.driver.live_session import stationary_job, stationary_plan
from ur_cartesian_driver.execution import AppendJob
from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.kinematics.robot_models import robot_model
from ur_cartesian_driver.motion.errors import ErrorCode
from ur_cartesian_driver.motion.execution_modes import ExecutionMode
from ur_cartesian_driver.motion.goal import (
    Goal,
    IOCommand,
    OutputKind,
    Segment,
    Tolerance,
    Waypoint,
)
from ur_cartesian_driver.motion.pose import Pose
from ur_cartesian_driver.motion.state import RuntimeState
from ur_cartesian_driver.planning import plan, PlanningOptions
from ur_cartesian_driver.planning.append.append_planner import plan_append, plan_first_part
from ur_cartesian_driver.planning.append.appendable_goal import AppendedPoints
from ur_cartesian_driver.protocol.program.reverse import ControlMode, TrajectoryAction
from ur_cartesian_driver.protocol.program.wire_dialects import NEWEST_DIALECT
from ur_cartesian_driver.sim.motion.motion_ownership import FreedriveState

#: Side of the way around two corners, and size of the blends there [m].
SIDE, BLEND = 0.05, 0.015
#: What the actual pose may be off, along the path (corners included) and at its end [m]; what the
#: twist may be off [m/s]; how long the arm may take to settle [s].
PATH_TOLERANCE, GOAL_TOLERANCE, TWIST_TOLERANCE, SETTLING = 0.004, 0.001, 0.3, 1.4

ARM = Arm(robot_model('ur5e'))
OPTIONS = PlanningOptions(max_tool_speed=1.0)


def planned(state, offsets, velocity, acceleration, **goal):
    """Return a plan through points beside where the tool stands, with blends between them."""
    (x, y, z), turned = state.actual_tcp_pose.position, state.actual_tcp_pose.quaternion
    points = tuple(Waypoint(pose=Pose((x + dx, y + dy, z + dz), turned)) for dx, dy, dz in offsets)
    blends = [BLEND] * (len(points) - 1) + [0.0]
    segments = tuple(
        Segment(velocity=velocity, acceleration=acceleration, blend_radius=blend)
        for blend in blends
    )
    return plan(Goal(waypoints=points, segments=segments, **goal), state, ARM, OPTIONS)


class StartingPoint:
    """Where the arm stands: the same, whatever is left of the last way home [rad]."""

    def __init__(self, state):
        self.state = state
        self._key = tuple(round(q, 4) for q in state.actual_q)

    def __eq__(self, other):
        return self._key == other._key

    def __hash__(self):
        return hash(self._key)


class FaultGoal:
    """
    A goal to which something happens, with the execution mode of a subclass.
    """

    def __init__(self, cell: RobotCell):
        self.cell = cell
        self.start = cell.robot.controller.motion.T_base_tcp.position
        self.plan = self.plan_from(StartingPoint(cell.memory.read()))
        self._messages_before = len(cell.control_messages())
        (end,) = cell.loop.open_ends(robot_cell.TRAJECTORY)
        self._results, self._results_before = end.peer.received, len(end.peer.received)
        self.motion: CellMotion | None = None

    def send(self):
        """Send it to the robot loop."""
        self.motion = self.cell.owner.start(self.plan)

    def plan_from(self, start: StartingPoint):
        """Return the plan, which is made once: the arm begins at the same pose each time."""
        raise NotImplementedError

    def is_in(self, phase: str) -> bool:
        """Tell whether the goal is in a phase that it reaches by itself."""
        raise NotImplementedError

    async def reach(self, phase: str):
        """Bring it to its phase; before it is sent there is nothing to do."""
        if phase in BEFORE:
            return
        if phase == 'settling':
            self.cell.robot.inject(f'offset pose z {2.0 * GOAL_TOLERANCE}')
        self.send()
        await self.cell.until(lambda: self.is_in(phase), purpose=phase)
        if phase == 'cancelling':
            await self.cancel()
        assert self.motion.outcome is None, self.motion.outcome

    async def cancel(self):
        """Cancel it, and return when the robot program is about to hear of it."""
        self.cell.owner.cancel()
        await self.cell.until(lambda: self.was_action_sent(TrajectoryAction.CANCEL))
        assert not self.cell.at_rest()

    def paths(self):
        """Return the planned paths, one behind the other."""
        return [self.plan.reference]

    def follow_up(self, phase):
        """Send what belongs to the goal and is still missing when the fault is there."""

    def is_over(self):
        """Tell whether the robot does nothing more of it, beside that the arm stands."""
        return True

    def note_end(self):
        """Look at what is there when the goal has ended, and the arm stands."""

    def judge(self, row, phase):
        """Look, when everything is over, at what this way of execution has to leave behind."""

    def begun(self):
        """Return how many motions the robot program has begun."""
        return self.cell.memory.read().points_begun

    def moved(self):
        """Return how far the tool has come along x and y [m]."""
        here = self.cell.robot.controller.motion.T_base_tcp.position
        return here[0] - self.start[0], here[1] - self.start[1]

    def was_action_sent(self, action):
        """Tell whether an action of this goal was sent."""
        return any(
            message.mode is ControlMode.FORWARD and message.payload[0] == action
            for message in self.cell.control_messages(self._messages_before)
        )

    def was_mode_sent(self, mode):
        """Tell whether a control mode was asked for by this goal."""
        return any(
            message.mode is mode for message in self.cell.control_messages(self._messages_before)
        )

    def has_result(self):
        """Tell whether the robot program has reported the end."""
        return len(self._results) > self._results_before


def around_square(state, **goal):
    """Return a plan around three sides of a square."""
    return planned(
        state,
        ((0.0, SIDE, 0.0), (SIDE, SIDE, 0.0), (SIDE, 0.0, 0.0)),
        0.25,
        2.0,
        path_tolerance=Tolerance(
            position=(PATH_TOLERANCE,) * 3, twist=(TWIST_TOLERANCE,) * 3 + (-1.0,) * 3
        ),
        goal_tolerance=Tolerance(position=(GOAL_TOLERANCE,) * 3),
        goal_time_tolerance=SETTLING,
        **goal,
    )


@lru_cache
def around_corners(start):
    """Return the plan of the goals without anything special."""
    return around_square(start.state)


class BlendGoal(FaultGoal):
    """Three sides of a square, as motions of the robot."""

    def plan_from(self, start):
        return around_corners(start)

    def is_in(self, phase):
        x, y = self.moved()
        match phase:
            case 'arming':
                return self.was_action_sent(TrajectoryAction.START) and self.begun() == 0
            case 'first point':
                return self.begun() == 1 and y > 0.2 * SIDE
            case 'in a blend':
                return x > 0.1 * BLEND and y < SIDE - 0.1 * BLEND
            case 'mid-segment' | 'cancelling':
                return self.begun() == 2 and x > 0.4 * SIDE
            case 'last point':
                return self.begun() == 3 and y < 0.5 * SIDE
            case 'settling':
                return self.has_result()
        raise AssertionError(phase)


#: Radius of a half circle [m], the time that it takes [s], and when its points are passed.
RADIUS, HALF_CIRCLE = 0.04, 1.0
PASSED = (0.3, 0.5, 0.7, 1.0)


def on_half_circle(time):
    """
    Return place, velocity and acceleration (x, y) beside the start: from rest to rest.

    The angle grows as pi (10 s^3 - 15 s^4 + 6 s^5), s being the part of the time that is over.
    """
    s = time / HALF_CIRCLE
    angle = pi * s**3 * (10.0 - 15.0 * s + 6.0 * s**2)
    rate = pi * 30.0 * s**2 * (1.0 - s) ** 2 / HALF_CIRCLE
    change = pi * 60.0 * s * (1.0 - s) * (1.0 - 2.0 * s) / HALF_CIRCLE**2
    along, inwards = (cos(angle), sin(angle)), (-sin(angle), cos(angle))
    place = (RADIUS * sin(angle), RADIUS * (1.0 - cos(angle)))
    velocity = tuple(RADIUS * rate * u for u in along)
    acceleration = tuple(
        RADIUS * (change * u + rate**2 * n) for u, n in zip(along, inwards, strict=True)
    )
    return place, velocity, acceleration


def half_circle_goal(state, execution):
    """Return the half circle as a goal whose points have twist and acceleration."""
    (x, y, z), turned = state.actual_tcp_pose.position, state.actual_tcp_pose.quaternion
    waypoints = []
    for time in PASSED:
        (dx, dy), (vx, vy), (ax, ay) = on_half_circle(time * HALF_CIRCLE)
        waypoints.append(
            Waypoint(
                time=time * HALF_CIRCLE,
                pose=Pose((x + dx, y + dy, z), turned),
                twist=(vx, vy, 0.0, 0.0, 0.0, 0.0),
                acceleration=(ax, ay, 0.0, 0.0, 0.0, 0.0),
            )
        )
    return Goal(
        waypoints=tuple(waypoints),
        execution=execution,
        path_tolerance=Tolerance(position=(PATH_TOLERANCE,) * 3),
        goal_tolerance=Tolerance(position=(GOAL_TOLERANCE,) * 3),
        goal_time_tolerance=SETTLING,
    )


@lru_cache
def half_circle(start, execution):
    """Return the plan of a half circle."""
    return plan(half_circle_goal(start.state, execution), start.state, ARM, OPTIONS)


class SplineGoal(FaultGoal):
    """A half circle, as splines that the robot program interpolates."""

    execution = ExecutionMode.SPLINE

    def plan_from(self, start):
        return half_circle(start, self.execution)

    def fraction(self):
        """Return which part of the half circle the tool has gone."""
        x, y = self.moved()
        return atan2(x, RADIUS - y) / pi

    def is_in(self, phase):
        match phase:
            case 'between points' | 'cancelling':
                return 0.55 < self.fraction() < 0.8
            case 'slowing down':
                return self.fraction() > 0.985
        raise AssertionError(phase)


class ServoGoal(SplineGoal):
    """The same half circle, as set-points through RTDE that the robot program buffers."""

    execution = ExecutionMode.SERVO

    def is_in(self, phase):
        if phase == 'entering':
            return self.was_mode_sent(ControlMode.BUFFERED_SERVO) and self.cell.at_rest()
        return super().is_in(phase)

    async def cancel(self):
        self.cell.owner.cancel()
        await self.cell.sleep(2.0 * CYCLE)
        assert not self.cell.at_rest()


#: The output that is switched at the second corner, and the one after the end [s].
AT_CORNER, AFTER_END, DELAY = 2, 3, 0.6
#: Where a goal ends within this time [s], the robot program was stopped at once.
AT_ONCE = 0.3


@lru_cache
def around_corners_with_outputs(start, values):
    """Return the plan around three sides of a square, with two outputs that are switched."""
    commands = tuple(
        IOCommand(
            waypoint=waypoint,
            offset=offset,
            output=OutputKind.STANDARD_DIGITAL,
            pin=pin,
            value=float(value),
        )
        for waypoint, offset, pin, value in zip(
            (1, 2), (0.0, DELAY), (AT_CORNER, AFTER_END), values, strict=True
        )
    )
    return around_square(start.state, io_commands=commands)


class OutputGoal(BlendGoal):
    """Three sides of a square, and outputs that wait to be switched."""

    def __init__(self, cell):
        self._before = self._outputs(cell)
        super().__init__(cell)

    def plan_from(self, start):
        return around_corners_with_outputs(start, tuple(not value for value in self._before))

    def is_in(self, phase):
        match phase:
            case 'before the place' | 'cancelling':
                return super().is_in('mid-segment')
            case 'before the time':
                return self.begun() == 3 and self.moved()[1] < 1e-4 and self.cell.at_rest()
        raise AssertionError(phase)

    def paths(self):
        """Return the planned paths, one behind the other."""
        return [self.plan.reference]

    def follow_up(self, phase):
        """Send what belongs to the goal and is still missing when the fault is there."""

    async def reach(self, phase):
        await super().reach(phase)
        self._at_fault = self._outputs(self.cell)

    def note_end(self):
        self._at_end = self._outputs(self.cell)

    def judge(self, row, phase):
        """See that all is switched in the end, or nothing any more when the goal has ended."""
        now, here = self._outputs(self.cell), (row.fault, phase)
        if row.code is ErrorCode.SUCCESSFUL:
            assert now == [not value for value in self._before], here
        else:
            assert now == self._at_end, here
            assert row.bound > AT_ONCE or now == self._at_fault, here

    @staticmethod
    def _outputs(cell):
        outputs = cell.robot.controller.io.digital_out.standard
        return [outputs[AT_CORNER], outputs[AFTER_END]]


@lru_cache
def half_circle_to_append(start):
    """Return the first three points of a half circle, and the last one as what is appended."""
    whole = half_circle_goal(start.state, ExecutionMode.SPLINE)
    goal = replace(whole, waypoints=whole.waypoints[:-1], keep_open=True)
    part = plan_first_part(plan(goal, start.state, ARM, OPTIONS), ARM, OPTIONS)
    return part, AppendedPoints(waypoints=whole.waypoints[-1:], last=True)


@lru_cache
def rest_of_half_circle(start, *, from_rest):
    """Return the last point of a half circle, planned behind what was sent before."""
    part, appended = half_circle_to_append(start)
    return plan_append(part.next_goal, appended, ARM, OPTIONS, from_rest=from_rest)


class AppendGoal(SplineGoal):
    """The half circle as an open goal, whose last point is appended when the fault is there."""

    def plan_from(self, start):
        self._beginning = start
        return half_circle_to_append(start)[0].plan

    def send(self):
        part, _ = half_circle_to_append(self._beginning)
        self.motion = self.cell.owner.run(*encode_plan(part, NEWEST_DIALECT))

    def is_in(self, phase):
        match phase:
            case 'moving' | 'cancelling':
                return 0.1 < self.fraction() < 0.4
            case 'closing':
                return self.was_action_sent(TrajectoryAction.STREAM_END) and self.fraction() > 0.7
            case 'waiting':
                return self.motion.progress and self.motion.progress[-1].awaiting_points
        return super().is_in(phase)

    def paths(self):
        rest = rest_of_half_circle(self._beginning, from_rest=False)
        return [self.plan.reference, rest.plan.reference]

    def follow_up(self, phase):
        part = rest_of_half_circle(self._beginning, from_rest=phase in ('closing', 'waiting'))
        points, job = encode_plan(part, NEWEST_DIALECT)
        self.cell.owner.extend(
            points, AppendJob(number=1, records_before=part.records_before, job=job)
        )


class FreedriveGoal(FaultGoal):
    """No goal but the same machinery: a person may push the arm, until that is cancelled."""

    def plan_from(self, start):
        return stationary_plan(start.state)

    def send(self):
        self.motion = self.cell.owner.run(b'', stationary_job(self.plan), freedrive=True)

    def is_in(self, phase):
        return self._is_freedrive_active() and self.motion.progress

    def is_over(self):
        # A paused program cannot end it; the safety system holds the arm.
        paused = self.cell.robot.controller.programs.state is RuntimeState.PAUSED
        return paused or not self._is_freedrive_active()

    def judge(self, row, phase):
        assert not self._is_freedrive_active(), (row.fault, phase)

    def _is_freedrive_active(self):
        return self.cell.robot.controller.freedrive is FreedriveState.TEACH


#: The goals of the ways of execution.
GOALS = {
    'SPLINE': SplineGoal,
    'SERVO': ServoGoal,
    'Open goals': AppendGoal,
    'Outputs': OutputGoal,
    'Guided by hand': FreedriveGoal,
}
