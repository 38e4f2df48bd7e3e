# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
What is promised of speed, time and place holds for random goals of all kinds.

The goals run in virtual time through the robot loop of the driver and its robot program. RTDE
records the joints, and a judge with kinematics and geometry of its own says what is wrong.

``RANDOM_GOALS`` is the number of goals, ``RANDOM_GOALS_SEED`` repeats a draw, and
``RANDOM_GOALS_ONLY=ROBOT.GOAL`` runs one of its goals.
"""

import asyncio
from collections import Counter
from functools import partial
import os
import time

from goal_feasibility import is_right, Refused
from goal_geometry import Kinematics
from goal_judge import judge, Promise, Run, UNLIKE_BLENDS
from mixed_goals import mixed_case, random_robot
from plain_clients import RtdeBytes
import pytest
from random_goals import Case
from robot_cell import RTDE, run_cell
from virtual_network import HOST

from ur_cartesian_driver.motion.errors import GoalRefused
from ur_cartesian_driver.motion.execution_modes import ExecutionMode
from ur_cartesian_driver.motion.goal import Goal, Segment, SegmentType, Waypoint
from ur_cartesian_driver.motion.pose import Pose
from ur_cartesian_driver.motion.primitive import MoveJ
from ur_cartesian_driver.planning import plan, PlanningOptions

pytestmark = [pytest.mark.acceptance, pytest.mark.slow]

GOALS = int(os.environ.get('RANDOM_GOALS', '40'))
SEED = int(os.environ.get('RANDOM_GOALS_SEED', str(int(time.time()) % 1_000_000)))
ONLY = os.environ.get('RANDOM_GOALS_ONLY', '')
#: So many goals run one after the other on the same robot.
GOALS_OF_A_ROBOT = 20
#: Plans of longer motions are not run [s].
MAX_DURATION = 8.0


class Recorder(asyncio.Protocol):
    """A client of RTDE that knows the published protocol only."""

    def __init__(self):
        self.codec, self.rows = RtdeBytes(), []

    def data_received(self, data):
        self.rows += self.codec.feed(data)


class Session:
    """One robot, on which goals run from anywhere."""

    def __init__(self, cell, robot):
        self.cell, self.robot, self.arm = cell, robot, robot.arm
        self.options = PlanningOptions(**robot.options)
        self.recorder = Recorder()
        #: How many programs had connected when the arm last moved on a path.
        self.programs = 0

    async def start(self):
        cycle = self.cell.robot.config.cycle
        connection, _ = await self.cell.loop.create_connection(lambda: self.recorder, HOST, RTDE)
        connection.write(self.recorder.codec.requests(1.0 / cycle))
        await self.cell.until(lambda: self.recorder.rows)

    async def place(self, q, T_flange_tcp):
        """Let the arm stand somewhere; return what the driver sees."""
        motion = self.cell.robot.controller.motion
        motion.T_flange_tcp = T_flange_tcp
        motion.teleport(q)

        def seen():
            state = self.cell.memory.read()
            return (
                max(abs(a - b) for a, b in zip(state.target_q, q, strict=True)) < 1e-12
                and state.T_flange_tcp.distance_to(T_flange_tcp) < 1e-9
            )

        await self.cell.until(seen)
        await self.cell.sleep(0.05)
        return self.cell.memory.read()

    async def run(self, case, made):
        """Run a plan, and return the record."""
        cell = self.cell
        self.recorder.rows.clear()
        programs = cell.count_connected_programs()
        is_first = made.execution is ExecutionMode.PRIMITIVES and programs != self.programs
        if made.execution is ExecutionMode.PRIMITIVES:
            self.programs = programs
        sent = cell.robot.controller.time
        motion = cell.owner.start(made)
        await cell.until(lambda: motion.outcome is not None, 3.0 * made.duration + 60.0)
        await cell.sleep(0.5 if self.robot.imperfect else 0.05)  # it may ring
        model = self.arm.model
        T_flange_tool = case.goal.T_flange_controlled or case.T_flange_tcp
        return Run(
            goal=case.goal,
            promise=promise_of(made),
            arm=Kinematics(self.arm.geometry, model.position_limits, T_flange_tool),
            joint_speeds=model.max_joint_speed,
            max_tool_speed=self.options.max_tool_speed,
            cycle=cell.robot.config.cycle,
            q=case.q,
            sent=sent,
            rows=list(self.recorder.rows),
            is_first=is_first,
            succeeded=motion.outcome.succeeded,
            outcome=f'{motion.outcome.code.name}: {motion.outcome.text}',
        )


def promise_of(made):
    goal, times, radii = made.goal, {}, [0.0] * len(made.goal.waypoints)
    for point, at in zip(made.reference.point.tolist(), made.reference.time.tolist(), strict=True):
        times[point] = at
    for segment in made.segments:
        radii[segment.waypoint] = getattr(segment.primitive, 'blend_radius', 0.0)
    joint_moves = frozenset(
        segment.waypoint
        for segment in made.segments
        if isinstance(segment.primitive, MoveJ)
        and goal.segments
        and goal.segments[segment.waypoint].type != SegmentType.JOINT
    )
    return Promise(
        execution=made.execution,
        duration=made.duration,
        point_times=times,
        joints=made.segments[-1].joints if made.segments else made.start,
        slowed=any('instead of' in line or 'stretched' in line for line in made.remarks),
        joint_moves=joint_moves,
        radii=tuple(radii),
    )


def refused_goal(cell, robot, case, options, text):
    model = robot.arm.model
    T_flange_tool = case.goal.T_flange_controlled or case.T_flange_tcp
    return Refused(
        goal=case.goal,
        q=case.q,
        arm=Kinematics(robot.arm.geometry, model.position_limits, T_flange_tool),
        joint_speeds=model.max_joint_speed,
        cycle=cell.robot.config.cycle,
        options=options,
        text=text,
    )


async def warm_up(session):
    """Let the program do its first path, which sets out slowly."""
    q = (0.0, -1.5, 1.5, -1.5, -1.5, 0.0)
    state = await session.place(q, Pose())
    there = session.arm.forward((0.02, *q[1:]))
    goal = Goal(
        waypoints=(Waypoint(pose=there),),
        segments=(Segment(type=SegmentType.JOINT, velocity=0.5),),
    )
    case = Case(family='warm up', q=q, T_flange_tcp=Pose(), goal=goal)
    await session.run(case, plan(goal, state, session.arm, session.options))


async def run_goals(cell, robot, number, left, counts, wrong):
    """Run goals on one robot until it fails; return those that are left."""
    session = Session(cell, robot)
    await session.start()
    if ONLY:
        await warm_up(session)
    for k in left:
        case = mixed_case(robot, SEED, number, k)
        name = f'{number}.{k}'
        state = await session.place(case.q, case.T_flange_tcp)
        counts['goals'] += 1
        try:
            made = plan(case.goal, state, robot.arm, session.options)
        except GoalRefused as refusal:
            counts['refused'] += 1
            kind, why = is_right(refused_goal(cell, robot, case, session.options, str(refusal)))
            counts[f'refused: {kind}'] += 1
            if os.environ.get('RANDOM_GOALS_SHOW'):
                print('REFUSED', name, case.family, refusal)
            if why:
                counts[f'falsely refused: {kind}'] += 1
                wrong.append(f'{name} ({case.family}; {robot}) refused: {refusal} But {why}')
            continue
        counts['accepted'] += 1
        if made.duration > MAX_DURATION:
            counts['long'] += 1
            continue
        run = await session.run(case, made)
        counts['run'] += 1
        counts[f'run: {made.execution.name}'] += 1
        if ONLY and os.environ.get('RANDOM_GOALS_SHOW'):
            print(
                case.goal,
                *made.report,
                run.outcome,
                list(cell.robot.controller.messages.log),
                cell.owner.log,
                sep='\n',
            )
        for kind, text in judge(run):
            line = f'{name} ({case.family}; {robot}) {kind}: {text}'
            counts[f'wrong: {kind}'] += 1
            if kind != UNLIKE_BLENDS:
                wrong.append(line)
            elif os.environ.get('RANDOM_GOALS_SHOW'):
                print('KNOWN', line)
        if not run.succeeded:
            return left[left.index(k) + 1 :]
    return []


def drawn():
    """Yield the numbers of robots, and the numbers of their goals."""
    if ONLY:
        number, goal = map(int, ONLY.split('.'))
        yield number, [goal]
        return
    for number in range(-(-GOALS // GOALS_OF_A_ROBOT)):
        yield number, list(range(min(GOALS_OF_A_ROBOT, GOALS - number * GOALS_OF_A_ROBOT)))


@pytest.mark.timeout(36000)
def test_promises_hold_for_random_goals(record_property):
    counts, wrong = Counter(), []
    for number, left in drawn():
        robot = random_robot(SEED, number)
        fields = {
            'model': robot.arm.model.name,
            'frequency': robot.frequency,
            'geometry': robot.arm.geometry,
        }
        while left:
            scenario = partial(
                run_goals, robot=robot, number=number, left=left, counts=counts, wrong=wrong
            )
            left = run_cell(scenario, imperfect=robot.imperfect, robot=fields)
    line = ', '.join(f'{count} {kind}' for kind, count in sorted(counts.items()))
    print(f'RANDOM_GOALS={GOALS} RANDOM_GOALS_SEED={SEED}: {line}')
    record_property('random_goals', line)
    assert not wrong, '\n'.join(
        [f'RANDOM_GOALS={GOALS} RANDOM_GOALS_SEED={SEED} make test', line, *wrong]
    )
