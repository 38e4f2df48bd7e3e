# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The goals of the fault matrix, and the ways to bring each of them to a phase.

A phase is recognised by messages on the wire, by the points that the robot program has begun and
by the position of the tool; never by an expected time.
"""

from dataclasses import replace
from functools import lru_cache
from math import atan2, cos, dist, hypot, pi, sin

import example_goals
from fault_table import BEFORE
import robot_cell
from robot_cell import CellMotion, CYCLE, RobotCell

from ur_cartesian_driver.driver.appender import encode_part
from ur_cartesian_driver.driver.ipc.channel import ArmSetup, SetPathOffset
from ur_cartesian_driver.driver.live_session import stationary_job, stationary_plan
from ur_cartesian_driver.execution.goal.motion_job import AppendJob
from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.kinematics.robot_models import robot_model
from ur_cartesian_driver.motion.errors import ErrorCode
from ur_cartesian_driver.motion.geometry.pose import Pose
from ur_cartesian_driver.motion.goal.execution_modes import ExecutionMode
from ur_cartesian_driver.motion.goal.goal import (
    FeedOverride,
    Goal,
    InputKind,
    InputWait,
    IOCommand,
    OnPathTolerance,
    OutputKind,
    PathOffset,
    Press,
    PressFrame,
    ProportionalOutput,
    PulseTrain,
    SafeOutput,
    ScriptCall,
    Segment,
    Tolerance,
    Waypoint,
)
from ur_cartesian_driver.motion.goal.moving_frame import MovingFrame
from ur_cartesian_driver.motion.plan.primitive import PulseLaw
from ur_cartesian_driver.motion.state.rtde_state import RuntimeState
from ur_cartesian_driver.planning import plan
from ur_cartesian_driver.planning.append.append_planner import plan_append, plan_first_part
from ur_cartesian_driver.planning.append.appendable_goal import AppendedPoints
from ur_cartesian_driver.protocol.program.registers import OutputInteger, PULSE_COUNTS
from ur_cartesian_driver.protocol.program.reverse import ControlMode, TrajectoryAction
from ur_cartesian_driver.sim.motion.contact.contact_bodies import ContactBody
from ur_cartesian_driver.sim.motion.motion_ownership import FreedriveState

#: Side of the square, and radius of the blends at its corners [m].
SIDE, BLEND = 0.05, 0.015
#: Tolerance of the position along the path (blends included) and at the goal [m], of the twist
#: [m/s], and time for settling [s].
PATH_TOLERANCE, GOAL_TOLERANCE, TWIST_TOLERANCE, SETTLING = 0.004, 0.001, 0.3, 1.4

#: The output of a process [pin], on while a goal runs and off when the goal does not go on.
PROCESS = 5
SAFE_OUTPUTS = (
    SafeOutput(output=OutputKind.STANDARD_DIGITAL, pin=PROCESS, value=0.0, restore=True),
)
#: A motion has begun when the tool is farther than this from its start [m].
BEGUN = 0.001
#: Longest time until the driver writes to a robot that was out of reach [s].
REACHED_WITHIN = 1.0
#: Longest time of a goal to a phase [s]: imperfect arms creep, and delayed threads begin late.
PHASE_WITHIN = 5.0

ARM = Arm(robot_model('ur5e'))
OPTIONS = replace(example_goals.OPTIONS, max_tool_speed=1.0)


def planned(state, offsets, velocity, acceleration, blend=BLEND, options=OPTIONS, **goal):
    """Return a plan through points at offsets from the tool, with blends between them."""
    (x, y, z), turned = state.actual_tcp_pose.position, state.actual_tcp_pose.quaternion
    points = tuple(Waypoint(pose=Pose((x + dx, y + dy, z + dz), turned)) for dx, dy, dz in offsets)
    blends = [blend] * (len(points) - 1) + [0.0]
    segments = tuple(
        Segment(velocity=velocity, acceleration=acceleration, blend_radius=radius)
        for radius in blends
    )
    return plan(Goal(waypoints=points, segments=segments, **goal), state, ARM, options)


class StartState:
    """State at the start of a goal; equal after every return home, up to 1e-4 rad."""

    def __init__(self, state):
        self.state = state
        self._key = tuple(round(q, 4) for q in state.actual_q)

    def __eq__(self, other):
        return self._key == other._key

    def __hash__(self):
        return hash(self._key)


class FaultGoal:
    """A goal that a fault hits; subclasses give it an execution mode."""

    def __init__(self, cell: RobotCell):
        self.cell = cell
        self.start = cell.robot.controller.motion.T_base_tcp.position
        self.plan = self.plan_from(StartState(cell.memory.read()))
        self._messages_before = len(cell.control_messages())
        (end,) = cell.loop.open_ends(robot_cell.TRAJECTORY)
        self._results, self._results_before = end.peer.received, len(end.peer.received)
        self.motion: CellMotion | None = None

    #: The arm, for a goal whose path can give way.
    arm: ArmSetup | None = None
    #: Whether its process has an output that has to be safe.
    has_process = True
    #: Whether the arm was in place already during a pause: the output is restored if the goal goes
    #: on after the pause, and stays off if the goal ended in the pause.
    may_end_in_pause = False

    def send(self):
        """Send the goal to the robot loop, with the output of its process switched on."""
        self.switch_process(True)
        self.send_motion()

    def send_motion(self):
        """Send the goal to the robot loop."""
        self.motion = self.cell.owner.start(self.plan, arm=self.arm)

    def switch_process(self, on):
        """Switch the output of the process, as the program of a cell would."""
        self.cell.robot.controller.io.digital_out.standard[PROCESS] = on

    def is_process_on(self):
        """Return whether the controller has switched the output of the process on."""
        return self.cell.robot.controller.io.digital_out.standard[PROCESS]

    async def check_process(self, context):
        """Check the output of the process after the end of a goal: off unless it succeeded."""
        code = self.motion.outcome.code
        if not self.has_process or code is ErrorCode.ROBOT_NOT_READY:  # no process has begun
            return
        if self.may_end_in_pause:
            return
        expected = code is ErrorCode.SUCCESSFUL
        await self.cell.until(
            lambda: self.is_process_on() is expected, REACHED_WITHIN, f'process, {context}'
        )

    def check_place(self, context):
        """Check that a failed goal reports the place of its stop, if the arm has moved."""
        tool, outcome = self.cell.robot.controller.motion.T_base_tcp.position, self.motion.outcome
        if dist(tool, self.start) > BEGUN and not outcome.succeeded:
            assert outcome.stopped, context

    def plan_from(self, start: StartState):
        """Return the plan; it is cached, because the arm begins at the same pose each time."""
        raise NotImplementedError

    def is_in(self, phase: str) -> bool:
        """Return whether the goal has reached a phase."""
        raise NotImplementedError

    async def bring_to(self, phase: str):
        """Bring the goal to a phase; phases before the sending of the goal need nothing."""
        if phase in BEFORE:
            return
        if phase == 'settling':
            self.cell.robot.inject(f'offset pose z {2.0 * GOAL_TOLERANCE}')
        self.send()
        await self.cell.until(lambda: self.is_in(phase), PHASE_WITHIN, phase)
        if phase == 'cancelling':
            await self.cancel()
        assert self.motion.outcome is None, self.motion.outcome

    async def cancel(self):
        """Cancel the goal, and return when CANCEL is on the wire."""
        self.cell.owner.cancel()
        await self.cell.until(lambda: self.was_action_sent(TrajectoryAction.CANCEL))
        assert not self.cell.at_rest()

    def paths(self):
        """Return the planned paths, in order."""
        return [self.plan.reference]

    def send_remaining_points(self, phase):
        """Send the points of the goal that come after the fault."""

    def is_over(self):
        """Return whether the robot has nothing left to do for the goal, besides coming to rest."""
        return True

    def record_end(self):
        """Record values for later checks, when the goal has ended and the arm is at rest."""

    def check_result(self, row, phase):
        """Check the effects of this execution mode, after the recovery."""

    def points_begun(self):
        """Return the number of points that the robot program has begun."""
        return self.cell.robot.controller.io.outputs.integers[OutputInteger.POINTS_BEGUN]

    def tool_offset(self):
        """Return the displacement of the tool since the start, along x and y [m]."""
        x, y, _ = self.cell.robot.controller.motion.T_base_tcp.position
        return x - self.start[0], y - self.start[1]

    def was_action_sent(self, action):
        """Return whether a trajectory action was sent for this goal."""
        return any(
            message.mode is ControlMode.FORWARD and message.payload[0] == action
            for message in self.cell.control_messages(self._messages_before)
        )

    def was_mode_sent(self, mode):
        """Return whether a control mode was requested for this goal."""
        return any(
            message.mode is mode for message in self.cell.control_messages(self._messages_before)
        )

    def has_result(self):
        """Return whether the robot program has reported the end."""
        return len(self._results) > self._results_before


def square_plan(state, **goal):
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
        safe_outputs=SAFE_OUTPUTS,
        **goal,
    )


@lru_cache
def blend_plan(start):
    """Return the plan of a goal with two blends and no outputs."""
    return square_plan(start.state)


class BlendGoal(FaultGoal):
    """Three sides of a square, as motion primitives."""

    def plan_from(self, start):
        return blend_plan(start)

    def is_in(self, phase):
        x, y = self.tool_offset()
        match phase:
            case 'arming':
                return self.was_action_sent(TrajectoryAction.START) and self.points_begun() == 0
            case 'first point':
                return self.points_begun() == 1 and y > 0.2 * SIDE
            case 'in a blend':
                return x > 0.1 * BLEND and y < SIDE - 0.1 * BLEND
            case 'mid-segment' | 'cancelling':
                return self.points_begun() == 2 and x > 0.4 * SIDE
            case 'last point':
                return self.points_begun() == 3 and y < 0.5 * SIDE
            case 'settling':
                return self.has_result()
        raise AssertionError(phase)


#: Radius [m] and duration [s] of the half circle, and the fractions of it at which points lie.
RADIUS, HALF_CIRCLE = 0.04, 1.0
POINT_FRACTIONS = (0.3, 0.5, 0.7, 1.0)


def half_circle_state(time):
    """
    Return position, velocity and acceleration (x, y) relative to the start, from rest to rest.

    The angle is pi (10 s^3 - 15 s^4 + 6 s^5); s is the elapsed fraction of the time.
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
    """Return the half circle as a goal with twist and acceleration at its points."""
    (x, y, z), turned = state.actual_tcp_pose.position, state.actual_tcp_pose.quaternion
    waypoints = []
    for time in POINT_FRACTIONS:
        (dx, dy), (vx, vy), (ax, ay) = half_circle_state(time * HALF_CIRCLE)
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
        safe_outputs=SAFE_OUTPUTS,
    )


@lru_cache
def half_circle(start, execution):
    """Return the plan of the half circle."""
    return plan(half_circle_goal(start.state, execution), start.state, ARM, OPTIONS)


class SplineGoal(FaultGoal):
    """A half circle, as splines that the robot program interpolates (SPLINE)."""

    execution = ExecutionMode.SPLINE

    def plan_from(self, start):
        return half_circle(start, self.execution)

    def fraction(self):
        """Return the fraction of the half circle that the tool has covered."""
        x, y = self.tool_offset()
        return atan2(x, RADIUS - y) / pi

    def is_in(self, phase):
        match phase:
            case 'between points' | 'cancelling':
                return 0.55 < self.fraction() < 0.8
            case 'slowing down':
                return self.fraction() > 0.985
        raise AssertionError(phase)


class ServoGoal(SplineGoal):
    """A half circle, as set-points through RTDE that the robot program buffers (SERVO)."""

    execution = ExecutionMode.SERVO

    def is_in(self, phase):
        match phase:
            case 'entering':
                return self.was_mode_sent(ControlMode.BUFFERED_SERVO) and self.cell.at_rest()
            case 'slowing down':
                return self.fraction() > 0.9
        return super().is_in(phase)

    async def cancel(self):
        self.cell.owner.cancel()
        await self.cell.sleep(2.0 * CYCLE)
        assert not self.cell.at_rest()


#: How long the arm is held off its path, for a goal that waits for the arm [s].
PUSHED = 0.85


@lru_cache
def patient_half_circle(start):
    """Return the plan of a half circle that waits for an arm that is off its path."""
    goal = replace(
        half_circle_goal(start.state, ExecutionMode.SERVO),
        on_path_tolerance=OnPathTolerance.STALL,
    )
    return plan(goal, start.state, ARM, OPTIONS)


class WaitingGoal(ServoGoal):
    """A half circle that waits for its arm."""

    _pushed_until = 0.0

    def plan_from(self, start):
        return patient_half_circle(start)

    def is_over(self):
        return self.cell.loop.time() > self._pushed_until  # the next goal begins on its path

    def is_in(self, phase):
        assert phase == 'waiting'
        if not self._pushed_until and self.fraction() > 0.4:
            self._pushed_until = self.cell.loop.time() + PUSHED + 0.05  # until it is reported
            self.cell.robot.inject(f'offset pose z {2.0 * PATH_TOLERANCE} for {PUSHED} s')
        return self._pushed_until and self.cell.at_rest()


#: Sideways distance by which the path of a goal gives way [m].
SIDEWAYS = 0.002


@lru_cache
def displaced_half_circle(start):
    """Return the plan of a half circle that may be left by 2 mm to its sides."""
    goal = replace(
        half_circle_goal(start.state, ExecutionMode.SERVO),
        path_offset=PathOffset(limits=(0.0, SIDEWAYS, 0.0), speed=0.02, acceleration=0.5),
    )
    return plan(goal, start.state, ARM, OPTIONS)


class OffsetGoal(ServoGoal):
    """A half circle; the tool moves beside it, because an offset came once."""

    arm = ArmSetup.of(ARM)

    def plan_from(self, start):
        return displaced_half_circle(start)

    def is_in(self, phase):
        assert phase == 'beside its path'
        offset = (0.0, SIDEWAYS, 0.0)
        motion = len(self.cell.owner.motions)
        self.cell.owner.send(SetPathOffset(motion=motion, offset=offset, age=0.0))
        x, y = self.tool_offset()
        return self.fraction() > 0.5 and hypot(x, y - RADIUS) < RADIUS - 0.9 * SIDEWAYS


@lru_cache
def displaced_line(start):
    """Return the plan of a line that may be left by 2 mm to its sides."""
    return planned(
        start.state,
        ((0.0, 2.0 * SIDE, 0.0),),
        0.06,
        0.5,
        path_tolerance=Tolerance(position=(PATH_TOLERANCE,) * 3),
        goal_tolerance=Tolerance(position=(GOAL_TOLERANCE,) * 3),
        goal_time_tolerance=SETTLING,
        safe_outputs=SAFE_OUTPUTS,
        path_offset=PathOffset(limits=(0.0, SIDEWAYS, 0.0), speed=0.02, acceleration=0.5),
    )


class OffsetMoveGoal(FaultGoal):
    """A line by the controller; the tool moves beside it, because an offset came once."""

    def plan_from(self, start):
        return displaced_line(start)

    def is_in(self, phase):
        assert phase == 'beside its path'
        motion = len(self.cell.owner.motions)
        self.cell.owner.send(SetPathOffset(motion=motion, offset=(0.0, SIDEWAYS, 0.0), age=0.0))
        x, y = self.tool_offset()
        return y > 0.5 * SIDE and abs(x) > 0.9 * SIDEWAYS


#: The feed of a goal whose signal has ended, and how fast it changes [1/s].
SLOW_FEED = FeedOverride(minimum=0.5, rate=2.0, timeout=0.2)


@lru_cache
def fed_half_circle(start, execution):
    """Return the plan of a half circle that a signal may slow."""
    goal = replace(half_circle_goal(start.state, execution), feed_override=SLOW_FEED)
    return plan(goal, start.state, ARM, OPTIONS)


class FedGoal(SplineGoal):
    """A half circle, slowed because its feed signal has ended."""

    def plan_from(self, start):
        return fed_half_circle(start, self.execution)

    def is_in(self, phase):
        assert phase == 'without signal'
        return 0.4 < self.fraction() < 0.8


class FedServoGoal(FedGoal, ServoGoal):
    """A half circle as set-points, slowed because its feed signal has ended."""

    execution = ExecutionMode.SERVO


#: Pins of the outputs switched at the second corner and after the end, and the delay of the
#: latter [s].
AT_CORNER, AFTER_END, DELAY = 2, 3, 0.6
#: The current of an analog output at 0 [A].
IDLE_CURRENT = 0.004
#: If a goal ends within this time, the robot program stopped at once [s].
IMMEDIATE_END = 0.3


@lru_cache
def output_plan(start, values):
    """Return the plan around the square with two outputs."""
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
    amount = ProportionalOutput(first_waypoint=0, last_waypoint=2, pin=0, gain=2.0)
    return square_plan(start.state, io_commands=commands, proportional_outputs=(amount,))


class OutputGoal(BlendGoal):
    """Three sides of a square, with outputs that switch on the path and after it."""

    def __init__(self, cell):
        self._before = self._outputs(cell)
        super().__init__(cell)

    def plan_from(self, start):
        return output_plan(start, tuple(not value for value in self._before))

    def is_in(self, phase):
        match phase:
            case 'before the trigger pose' | 'cancelling':
                return super().is_in('mid-segment')
            case 'before the time':
                return (
                    self.points_begun() == 3
                    and self.tool_offset()[1] < 1e-3  # the plan begins at a measured pose
                    and self.cell.at_rest()
                )
        raise AssertionError(phase)

    async def bring_to(self, phase):
        await super().bring_to(phase)
        self._at_fault = self._outputs(self.cell)

    def record_end(self):
        self._at_end = self._outputs(self.cell)

    async def check_process(self, context):
        await super().check_process(context)
        if not self.may_end_in_pause:
            analog = self.cell.robot.controller.io.analog_out
            await self.cell.until(
                lambda: analog[0] <= IDLE_CURRENT, REACHED_WITHIN, f'amount, {context}'
            )

    def check_result(self, row, phase):
        """
        Check that all outputs switched, or that none was switched on, and none after the end.

        A paused program switches off the outputs that wait for it as soon as it goes on.
        """
        now, here = self._outputs(self.cell), (row.fault, phase)
        if row.code is ErrorCode.SUCCESSFUL:
            assert now == [not value for value in self._before], here
        else:
            assert all(after <= at_end for after, at_end in zip(now, self._at_end, strict=True)), (
                here
            )
            assert row.result_within > IMMEDIATE_END or all(
                after <= before for after, before in zip(now, self._at_fault, strict=True)
            ), here

    @staticmethod
    def _outputs(cell):
        outputs = cell.robot.controller.io.digital_out.standard
        return [outputs[AT_CORNER], outputs[AFTER_END]]


#: The output that gives pulses while its goal runs, and one that switches ahead of its place.
PULSED, AHEAD = 4, 2


@lru_cache
def pulse_plan(start):
    """Return the plan around the square with pulses, and with a lead on the last side."""
    train = PulseTrain(
        first_waypoint=0,
        last_waypoint=2,
        output=OutputKind.STANDARD_DIGITAL,
        pin=PULSED,
        distance=0.01,
        width=0.016,
    )
    ahead = IOCommand(
        waypoint=2,
        distance=-0.01,
        offset=-0.05,
        output=OutputKind.STANDARD_DIGITAL,
        pin=AHEAD,
        value=1.0,
    )
    return square_plan(start.state, pulses=(train,), io_commands=(ahead,))


class PulseGoal(BlendGoal):
    """Three sides of a square, with pulses, and an output that switches ahead of its place."""

    def __init__(self, cell):
        self._outputs = cell.robot.controller.io.digital_out.standard
        self._outputs[AHEAD] = False
        super().__init__(cell)
        self._count_before = self._count()

    def plan_from(self, start):
        return pulse_plan(start)

    def is_in(self, phase):
        match phase:
            case 'a pulse is on':
                return super().is_in('mid-segment') and self._outputs[PULSED]
            case 'between pulses' | 'cancelling':
                return super().is_in('mid-segment') and not self._outputs[PULSED]
        raise AssertionError(phase)

    def record_end(self):
        self._count_at_end, self._ahead_at_end = self._count(), self._outputs[AHEAD]

    async def check_process(self, context):
        await super().check_process(context)
        await self.cell.until(
            lambda: not self._outputs[PULSED], REACHED_WITHIN, f'pulses, {context}'
        )

    def check_result(self, row, phase):
        """Check that all pulses came, or none after the end; check the output with the lead."""
        succeeded, here = row.code is ErrorCode.SUCCESSFUL, (row.fault, phase)
        assert self._outputs[AHEAD] == (succeeded or self._ahead_at_end), here
        assert not self._outputs[PULSED], here
        if succeeded:
            (law,) = [one for one in self.plan.instructions if isinstance(one, PulseLaw)]
            assert (self._count() - self._count_before) % PULSE_COUNTS == law.count, here
        else:  # a restarted program counts from 0
            assert self._count() in (self._count_at_end, 0), here
            assert not self._ahead_at_end or row.result_within > IMMEDIATE_END, here

    def _count(self):
        return self.cell.robot.controller.io.outputs.integers[OutputInteger.PULSES]


@lru_cache
def rounded_output_plan(start, values, execution):
    """Return the plan with two outputs around rounded corners."""
    made = output_plan(start, values).goal
    goal = Goal(
        waypoints=tuple(Waypoint(pose=point.pose) for point in made.waypoints),
        segments=(Segment(velocity=0.25, acceleration=1.0),) * len(made.waypoints),
        corner_deviation=0.004,
        execution=execution,
        io_commands=made.io_commands,
        proportional_outputs=made.proportional_outputs,
        path_tolerance=Tolerance(position=(PATH_TOLERANCE,) * 3),
        goal_tolerance=Tolerance(position=(GOAL_TOLERANCE,) * 3),
        goal_time_tolerance=SETTLING,
        safe_outputs=made.safe_outputs,
    )
    return plan(goal, start.state, ARM, OPTIONS)


class RoundedGoal(OutputGoal):
    """Three sides of a square with rounded corners and outputs."""

    execution = ExecutionMode.SPLINE

    def plan_from(self, start):
        values = tuple(not value for value in self._before)
        return rounded_output_plan(start, values, self.execution)

    def is_in(self, phase):
        x, y = self.tool_offset()
        match phase:
            case 'in a corner':
                return x > 1e-3 and y > 0.9 * SIDE
            case 'before the trigger pose' | 'cancelling':
                return x > 0.4 * SIDE
            case 'before the time':
                return x > 0.9 * SIDE and y < 1e-3 and self.cell.at_rest()
        raise AssertionError(phase)


@lru_cache
def held_part_plan(start, values):
    """Return a plan of the same flange motion, as a path on a held part before a fixed tool."""
    goal = rounded_output_plan(start, values, ExecutionMode.SPLINE).goal
    flange = start.state.actual_tcp_pose @ start.state.T_flange_tcp.inverse()
    to_flange = start.state.T_flange_tcp.inverse()
    held = MovingFrame(
        T_flange_frame=Pose((0.0, 0.0, 0.1)), T_base_tool=flange @ Pose((0.02, 0.0, 0.12))
    )
    points = (replace(point, pose=held.tool(point.pose @ to_flange)) for point in goal.waypoints)
    goal = replace(goal, waypoints=tuple(points), moving_frame=held, controlled_frame='tool')
    return plan(goal, start.state, ARM, OPTIONS)


class HeldPartGoal(RoundedGoal):
    """The motion of a rounded goal, as a path on a part in the hand."""

    def plan_from(self, start):
        return held_part_plan(start, tuple(not value for value in self._before))


class ServoOutputGoal(RoundedGoal):
    """The rounded goal by set-points."""

    execution = ExecutionMode.SERVO
    cancel = ServoGoal.cancel


#: Rest of the arm in a corner [s]; time from the fault to an input for which the arm waits in
#: another corner [s]; the number of this input.
REST, COMES_AFTER, AWAITED = 0.8, 0.4, 6


@lru_cache
def rest_plan(start):
    """Return the plan of three sides of a square with a rest and a wait between them."""
    state = start.state
    (x, y, z), turned = state.actual_tcp_pose.position, state.actual_tcp_pose.quaternion
    goal = Goal(
        waypoints=tuple(
            Waypoint(pose=Pose((x + dx, y + dy, z), turned))
            for dx, dy in ((0.0, SIDE), (SIDE, SIDE), (SIDE, 0.0))
        ),
        segments=(
            Segment(velocity=0.25, acceleration=2.0, dwell=REST),
            Segment(velocity=0.25, acceleration=2.0),
            Segment(velocity=0.25, acceleration=2.0),
        ),
        input_waits=(
            InputWait(
                waypoint=1, input=InputKind.STANDARD_DIGITAL, pin=AWAITED, value=1.0, timeout=5.0
            ),
        ),
        path_tolerance=Tolerance(position=(PATH_TOLERANCE,) * 3),
        goal_tolerance=Tolerance(position=(GOAL_TOLERANCE,) * 3),
        goal_time_tolerance=SETTLING,
        safe_outputs=SAFE_OUTPUTS,
    )
    return plan(goal, state, ARM, OPTIONS)


class RestGoal(BlendGoal):
    """Three sides of a square, with a rest and a wait for an input between them."""

    awaited = AWAITED

    def __init__(self, cell):
        self._inputs = cell.robot.controller.io.digital_in.standard
        self._inputs[self.awaited] = False
        self._comes = None
        super().__init__(cell)

    def plan_from(self, start):
        return rest_plan(start)

    def is_in(self, phase):
        begun = {'resting': 2, 'waiting for an input': 4}[phase]
        return self.points_begun() == begun and self.cell.at_rest()

    def send_remaining_points(self, phase):
        self._comes = self.cell.loop.call_later(
            COMES_AFTER, self._inputs.__setitem__, self.awaited, True
        )

    def record_end(self):
        if self._comes is not None:
            self._comes.cancel()


@lru_cache
def servo_rest_plan(start):
    """Return the plan of two sides of a square, by set-points, with a rest between them."""
    state = start.state
    (x, y, z), turned = state.actual_tcp_pose.position, state.actual_tcp_pose.quaternion
    goal = Goal(
        waypoints=tuple(
            Waypoint(pose=Pose((x + dx, y + SIDE, z), turned), time=time)
            for dx, time in ((0.0, 0.4), (SIDE, 0.8 + REST))
        ),
        segments=(Segment(dwell=REST), Segment()),
        path_tolerance=Tolerance(position=(PATH_TOLERANCE,) * 3),
        goal_tolerance=Tolerance(position=(GOAL_TOLERANCE,) * 3),
        goal_time_tolerance=SETTLING,
        safe_outputs=SAFE_OUTPUTS,
        execution=ExecutionMode.SERVO,
    )
    return plan(goal, state, ARM, OPTIONS)


@lru_cache
def servo_wait_plan(start):
    """Return the plan of two sides of a square, by set-points, with a wait between them."""
    goal = servo_rest_plan(start).goal
    wait = InputWait(
        waypoint=0, input=InputKind.STANDARD_DIGITAL, pin=AWAITED, value=1.0, timeout=5.0
    )
    return plan(replace(goal, segments=(), input_waits=(wait,)), start.state, ARM, OPTIONS)


class ServoWaitGoal(RestGoal):
    """Two sides of a square by set-points, with a wait for an input between them."""

    cancel = ServoGoal.cancel

    def plan_from(self, start):
        return servo_wait_plan(start)

    def is_in(self, phase):
        assert phase == 'waiting for an input'
        return dist(self.tool_offset(), (0.0, SIDE)) < 2e-4 and self.cell.at_rest()


class ServoRestGoal(ServoGoal):
    """Two sides of a square by set-points, with a rest between them."""

    def plan_from(self, start):
        return servo_rest_plan(start)

    def is_in(self, phase):
        assert phase == 'resting'
        return dist(self.tool_offset(), (0.0, SIDE)) < 2e-4 and self.cell.at_rest()


@lru_cache
def call_plan(start):
    """Return the plan of three sides of a square with the call of a function between them."""
    call = ScriptCall(waypoint=1, function='close_gripper', arguments=(0.6,), timeout=5.0)
    return square_plan(start.state, blend=0.0, script_calls=(call,))


class CallGoal(RestGoal):
    """Three sides of a square, with a function between them that waits for an input."""

    awaited = 2

    def plan_from(self, start):
        return call_plan(start)

    def is_in(self, phase):
        assert phase == 'in a function'
        return self.points_begun() == 3 and self.cell.at_rest()


@lru_cache
def press_plan(start):
    """Return the plan of three sides of a square, the second one with 20 N on a table."""
    return square_plan(
        start.state,
        blend=0.0,
        presses=(
            Press(
                first_waypoint=0,
                last_waypoint=1,
                frame=PressFrame.BASE,
                axes=('z',),
                forces=(-20.0,),
            ),
        ),
    )


class PressGoal(BlendGoal):
    """Three sides of a square, with a table 2 mm below, on which the tool presses."""

    def __init__(self, cell):
        self._contact = cell.robot.controller.contact
        super().__init__(cell)
        x, y, z = self.start
        self._contact.bodies = (ContactBody('plane', (x, y, z - 0.002), (0.0, 0.0, 1.0)),)

    def plan_from(self, start):
        return press_plan(start)

    def is_in(self, phase):
        assert phase == 'pressing'
        return self.points_begun() == 4 and self._contact.wrench[2] > 10.0

    def is_over(self):
        # A paused program that nobody may stop keeps the press mode; the safety system holds the
        # arm.
        paused = self.cell.robot.controller.programs.state is RuntimeState.PAUSED
        return paused or self._contact.force_mode is None

    def check_result(self, row, phase):
        assert self._contact.force_mode is None, (row.fault, phase)
        self._contact.bodies = ()


@lru_cache
def half_circle_to_append(start, execution):
    """Return the plan of the first three points of a half circle, and the last one to append."""
    whole = half_circle_goal(start.state, execution)
    goal = replace(whole, waypoints=whole.waypoints[:-1], keep_open=True)
    part = plan_first_part(plan(goal, start.state, ARM, OPTIONS), ARM, OPTIONS)
    return part, AppendedPoints(waypoints=whole.waypoints[-1:], last=True)


@lru_cache
def rest_of_half_circle(start, execution, *, from_rest):
    """Return the append plan of the last point of a half circle."""
    part, appended = half_circle_to_append(start, execution)
    return plan_append(part.next_goal, appended, ARM, OPTIONS, from_rest=from_rest)


@lru_cache
def new_tail_of_half_circle(start):
    """Return the append plan of the last two points; the first of them replaces a known one."""
    part, appended = half_circle_to_append(start, ExecutionMode.SERVO)
    known = half_circle_goal(start.state, ExecutionMode.SERVO).waypoints[2:3]
    tail = replace(appended, waypoints=(*known, *appended.waypoints), replace_from_point=2)
    return plan_append(part.next_goal, tail, ARM, OPTIONS, from_rest=False)


class AppendGoal(SplineGoal):
    """The half circle with keep_open; its last point is appended after the fault."""

    def plan_from(self, start):
        self._beginning = start
        return half_circle_to_append(start, self.execution)[0].plan

    def send_motion(self):
        part, _ = half_circle_to_append(self._beginning, self.execution)
        self.motion = self.cell.owner.run(*encode_part(part))

    def is_in(self, phase):
        match phase:
            case 'moving' | 'cancelling':
                return 0.1 < self.fraction() < 0.4
            case 'running out':
                return self.was_action_sent(TrajectoryAction.STREAM_END) and self.fraction() > 0.7
            case 'awaiting points':
                return self.motion.progress and self.motion.progress[-1].awaiting_points
        return super().is_in(phase)

    def paths(self):
        return [self.plan.reference, self._rest('moving').plan.reference]

    def _rest(self, phase):
        """Return the append plan of the points after the fault."""
        return rest_of_half_circle(
            self._beginning,
            self.execution,
            from_rest=phase in ('running out', 'awaiting points'),
        )

    def send_remaining_points(self, phase):
        part = self._rest(phase)
        points, job = encode_part(part)
        self.cell.owner.append(
            points,
            AppendJob(
                number=1, records_before=part.records_before, job=job, cut_time=part.cut_time
            ),
        )


class ReplacedTailGoal(AppendGoal, ServoGoal):
    """The same as set-points; points sent during the motion replace the last known one."""

    execution = ExecutionMode.SERVO

    def is_in(self, phase):
        if phase == 'running out':
            return self.fraction() > 0.85  # behind the third point
        return super().is_in(phase)

    def _rest(self, phase):
        if phase == 'moving':
            return new_tail_of_half_circle(self._beginning)
        return super()._rest(phase)


class FreedriveGoal(FaultGoal):
    """Freedrive until it is cancelled: no goal, but it ends through the same machine."""

    def plan_from(self, start):
        return stationary_plan(start.state)

    has_process = False

    def check_place(self, context):
        """Check nothing, because freedrive has no path."""

    def send_motion(self):
        self.motion = self.cell.owner.run(b'', stationary_job(self.plan), freedrive=True)

    def is_in(self, phase):
        return self._is_freedrive_active() and self.motion.progress

    def is_over(self):
        # A paused program cannot end freedrive; the safety system holds the arm.
        paused = self.cell.robot.controller.programs.state is RuntimeState.PAUSED
        return paused or not self._is_freedrive_active()

    def check_result(self, row, phase):
        assert not self._is_freedrive_active(), (row.fault, phase)

    def _is_freedrive_active(self):
        return self.cell.robot.controller.freedrive is FreedriveState.TEACH


#: The goals by the name of their mode in the matrix.
GOALS = {
    'SPLINE': SplineGoal,
    'SERVO': ServoGoal,
    'Waiting for the arm': WaitingGoal,
    'Path offset': OffsetGoal,
    'Path offset, PRIMITIVES': OffsetMoveGoal,
    'Feed override': FedGoal,
    'Feed override, SERVO': FedServoGoal,
    'Appendable goals': AppendGoal,
    'Replaced tails': ReplacedTailGoal,
    'Outputs': OutputGoal,
    'Pulses': PulseGoal,
    'At a point': RestGoal,
    'At a point, SERVO': ServoRestGoal,
    'Rounded corners': RoundedGoal,
    'A part in the hand': HeldPartGoal,
    'Outputs, SERVO': ServoOutputGoal,
    'Waits, SERVO': ServoWaitGoal,
    'Scripts': CallGoal,
    'Press': PressGoal,
    'Freedrive': FreedriveGoal,
}
