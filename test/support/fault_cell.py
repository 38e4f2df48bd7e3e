# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
One cell of the fault matrix: a goal is brought to its phase, something goes wrong, people act.

Phases are found by looking, at the messages on the wire, at the points that the robot program has
begun and at where the tool is; never by the time that it should take.
"""

from functools import lru_cache

from fault_table import BEFORE, Row
import robot_cell
from robot_cell import CYCLE, RobotCell

from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.kinematics.robots import robot_model
from ur_cartesian_driver.motion.errors import ErrorCode
from ur_cartesian_driver.motion.goal import Goal, Segment, Tolerance, Waypoint
from ur_cartesian_driver.motion.pose import Pose
from ur_cartesian_driver.motion.state import RuntimeState
from ur_cartesian_driver.planning import plan, PlanningOptions
from ur_cartesian_driver.protocol.reverse import ControlMode, TrajectoryAction
from ur_cartesian_driver.robot.lifecycle import ConnectionState
from ur_cartesian_driver.sim.modes import OPERATIONAL

#: Side of the way around two corners, and size of the blends there [m].
SIDE, BLEND = 0.05, 0.015
#: What the actual pose may be off, along the path (corners included) and at its end [m]; what the
#: twist may be off [m/s]; how long the arm may take to settle [s].
PATH_TOLERANCE, GOAL_TOLERANCE, TWIST_TOLERANCE, SETTLING = 0.004, 0.001, 0.3, 1.4
#: How long the arm is watched after somebody has unlocked or played, and a goal that waits [s].
WATCHED = 0.2
#: How long the next goal may take [s].
NEXT_BOUND = 2.0

#: Of a program that can be played.
STANDSTILL = (RuntimeState.PAUSED, RuntimeState.STOPPED)

ARM = Arm(robot_model('ur5e'))
PORTS = {'reverse': robot_cell.REVERSE, 'trajectory': robot_cell.TRAJECTORY,
         'script command': robot_cell.COMMANDS}


def planned(state, offsets, velocity, acceleration, **goal):
    """Return a plan through points beside where the tool stands, with blends between them."""
    (x, y, z), turned = state.actual_tcp_pose.position, state.actual_tcp_pose.quaternion
    points = tuple(Waypoint(pose=Pose((x + dx, y + dy, z + dz), turned))
                   for dx, dy, dz in offsets)
    blends = [BLEND] * (len(points) - 1) + [0.0]
    segments = tuple(Segment(velocity=velocity, acceleration=acceleration, blend_radius=blend)
                     for blend in blends)
    return plan(Goal(waypoints=points, segments=segments, **goal), state, ARM,
                PlanningOptions(max_tool_speed=1.0))


class StartingPoint:
    """Where the arm stands: the same, whatever is left of the last way home [rad]."""

    def __init__(self, state):
        self.state = state
        self._key = tuple(round(q, 4) for q in state.actual_q)

    def __eq__(self, other):
        return self._key == other._key

    def __hash__(self):
        return hash(self._key)


@lru_cache
def around_corners(start):
    """Return the plan of the goal in trouble."""
    return planned(
        start.state, ((0.0, SIDE, 0.0), (SIDE, SIDE, 0.0), (SIDE, 0.0, 0.0)), 0.25, 2.0,
        path_tolerance=Tolerance(position=(PATH_TOLERANCE,) * 3,
                                 twist=(TWIST_TOLERANCE,) * 3 + (-1.0,) * 3),
        goal_tolerance=Tolerance(position=(GOAL_TOLERANCE,) * 3), goal_time_tolerance=SETTLING)


class GoalInTrouble:
    """The goal to which it happens: three sides of a square."""

    def __init__(self, cell: RobotCell):
        self._cell = cell
        self._start = cell.robot.controller.motion.T_base_tcp.position
        self._plan = around_corners(StartingPoint(cell.memory.read()))
        self._said_before = len(cell.control_messages())
        (end,) = cell.loop.open_ends(robot_cell.TRAJECTORY)
        self._results, self._results_before = end.peer.received, len(end.peer.received)
        self.motion = None

    def send(self):
        """Send it to the robot loop."""
        self.motion = self._cell.owner.start(self._plan)

    async def reach(self, phase):
        """Bring it to its phase; before it is sent there is nothing to do."""
        if phase in BEFORE:
            return
        if phase == 'settling':
            self._cell.robot.inject(f'offset pose z {2.0 * GOAL_TOLERANCE}')
        self.send()
        await self._cell.until(lambda: self._is_in(phase))
        if phase == 'cancelling':
            self._cell.owner.cancel()
            await self._cell.until(lambda: self._said(TrajectoryAction.CANCEL))
            assert not self._cell.at_rest()
        assert self.motion.outcome is None

    def _is_in(self, phase):
        x, y = self._moved()
        match phase:
            case 'arming':
                return self._said(TrajectoryAction.START) and self._begun() == 0
            case 'first point':
                return self._begun() == 1 and y > 0.2 * SIDE
            case 'in a blend':
                return x > 0.1 * BLEND and y < SIDE - 0.1 * BLEND
            case 'mid-segment' | 'cancelling':
                return self._begun() == 2 and x > 0.4 * SIDE
            case 'last point':
                return self._begun() == 3 and y < 0.5 * SIDE
            case 'settling':
                return len(self._results) > self._results_before
        raise AssertionError(phase)

    def _begun(self):
        return self._cell.memory.read().points_begun

    def _moved(self):
        here = self._cell.robot.controller.motion.T_base_tcp.position
        return here[0] - self._start[0], here[1] - self._start[1]

    def _said(self, action):
        return any(message.mode is ControlMode.FORWARD and message.payload[0] == action
                   for message in self._cell.control_messages(self._said_before))


async def let_happen(cell: RobotCell, cause: str):
    """Let a fault happen: one of the simulator's, or one of what is around it."""
    kind, _, what = cause.partition(' ')
    if cause == 'crash':
        await cell.crash_robot()
    elif cause == 'silent owner':
        cell.owner.silent = True
    elif cause == 'freeze all':
        for port in set(cell.loop.servers) - {robot_cell.OWNER_PORT}:
            cell.loop.freeze(port)
    elif kind == 'freeze':
        cell.loop.freeze(PORTS[what])
    elif kind == 'cut':
        cell.loop.cut(PORTS[what])
    else:
        cell.robot.inject(cause)


async def let_pass(cell: RobotCell):
    """End the faults that last."""
    cell.robot.clear_faults()
    cell.owner.silent = False
    await cell.sleep(2.0 * CYCLE)


async def do(cell: RobotCell, step: str):
    """Do what somebody has to do, as another client or at the pendant, until it has happened."""
    controller = cell.robot.controller
    match step:
        case 'unlock':
            await cell.sleep(cell.robot.config.unlock_delay + CYCLE)
            await cell.dashboard('unlock protective stop')
            await cell.until(lambda: controller.safety.mode in OPERATIONAL)
        case 'reset the safeguard':
            cell.robot.inject('reset_safeguard')
            await cell.until(lambda: controller.safety.mode in OPERATIONAL)
        case 'release the button':
            cell.robot.release_emergency_stop()
        case 'restart safety':
            await cell.dashboard('restart safety')
        case 'power on':
            await cell.dashboard('power on')
            await cell.until(lambda: controller.power.mode.name == 'IDLE')
        case 'release the brakes':
            await cell.dashboard('brake release')
            await cell.until(lambda: controller.power.mode.name == 'RUNNING')
        case 'play':
            await cell.until(lambda: controller.programs.state in STANDSTILL)
            await cell.dashboard('play')
        case 'resend':
            cell.resend()
            if cell.is_ready():
                await cell.until(lambda: not cell.is_ready())
        case 'move the slider up':
            cell.robot.set_speed_slider(1.0)
        case 'start the controller':
            await cell.reboot_robot()
            await cell.until(lambda: cell.status.state is ConnectionState.CONNECTED, 5.0)
        case 'wait until it is over':
            await let_pass(cell)
            await cell.until(lambda: cell.loop.open_ends(robot_cell.PRIMARY))
        case _:
            raise AssertionError(f'nobody knows how to {step}')


async def recover(cell: RobotCell, steps):
    """Do all steps; return how far a joint was from its place at the beginning [rad]."""
    q, farthest = cell.q, 0.0
    for step in steps:
        await do(cell, step)
        watched_until = cell.loop.time() + (WATCHED if step in ('unlock', 'play') else 0.0)
        while True:
            farthest = max(farthest, *(abs(a - b) for a, b in zip(cell.q, q, strict=True)))
            if cell.loop.time() >= watched_until:
                break
            await cell.sleep(CYCLE)
    return farthest


async def scenario(cell: RobotCell, row: Row, phase: str):
    """Run one cell of the matrix; the robot cell is ready before and afterwards."""
    here = f'{row.fault}, {phase}'
    home = cell.robot.controller.motion.T_base_tcp.position
    goal = GoalInTrouble(cell)
    await goal.reach(phase)
    for cause in row.cause:
        await let_happen(cell, cause)
    begin = cell.loop.time()
    if phase in BEFORE:
        await cell.sleep(0.1 if phase == 'idle' else CYCLE)
        goal.send()
    if row.waits:
        await wait_on(cell, goal, row, here)
    elif phase == 'settling' and row.code is ErrorCode.SUCCESSFUL:
        await let_pass(cell)  # what kept it from settling
    await cell.until(lambda: goal.motion.outcome, row.bound if not row.waits else 2.0, here)
    outcome = goal.motion.outcome
    assert outcome.code is row.code, f'{here}: {outcome}'
    assert outcome.text, here
    await cell.until(cell.at_rest, max(0.0, begin + row.rest - cell.loop.time()), here)
    if not row.waits:
        await cell.until(lambda: cell.status.state is row.then, row.then_within, here)
        assert cell.is_ready() or cell.status.message, here
        if phase == 'settling':
            await let_pass(cell)
        travel = await recover(cell, row.steps)
        assert travel <= row.travel, f'{here}: a joint has moved by {travel} rad'
    await cell.until(cell.is_ready, row.back, here)
    await go_home(cell, home, here)
    return goal.motion.ended_at - begin


async def wait_on(cell, goal, row, here):
    """See that a goal waits for somebody, and goes on when they have done their part."""
    await cell.until(cell.at_rest, row.rest, here)
    await cell.sleep(WATCHED)
    assert goal.motion.outcome is None, here
    assert cell.at_rest(), here
    cell.robot.clear_faults()
    for step in row.steps:
        await do(cell, step)


async def go_home(cell, home, here):
    """Run the next goal, back to where the arm was."""
    x, y, z = (a - b for a, b in zip(home, cell.memory.read().actual_tcp_pose.position,
                                     strict=True))
    following = cell.owner.start(planned(cell.memory.read(), (
        (x, y, z) if max(map(abs, (x, y, z))) > 1e-3 else (0.0, 0.01, 0.0),), 0.8, 8.0))
    await cell.until(lambda: following.outcome, NEXT_BOUND, here)
    assert following.outcome.code is ErrorCode.SUCCESSFUL, f'after {here}: {following.outcome}'
