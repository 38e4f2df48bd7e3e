# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Random goals of all kinds keep the promises about speed, time and place.

The goals run in virtual time through the robot loop of the driver and its robot program. RTDE
records the joints, and a judge with kinematics and geometry of its own finds the faults.

``RANDOM_GOALS`` is the number of goals, ``RANDOM_GOALS_SEED`` repeats a draw, and
``RANDOM_GOALS_ONLY=ROBOT.GOAL`` runs one of its goals. ``RANDOM_TCP_GOALS`` run through processes
and TCP.
"""

from collections import Counter
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from itertools import pairwise
import os
import re
import subprocess
import time

from goal_feasibility import is_right, Refused, remedied
from goal_geometry import Kinematics
from goal_judge import judge, KNOWN, promise_of, Run
from mixed_goals import mixed_case, random_robot
import numpy as np
from plain_clients import PlainRtde, RtdeRecorder
import pytest
from random_goals import Case
from robot_cell import RTDE, run_cell
from virtual_network import HOST

from ur_cartesian_driver.cli.demo import process
from ur_cartesian_driver.driver import Driver, DriverConfig
from ur_cartesian_driver.motion.errors import GoalRefused, TooFast
from ur_cartesian_driver.motion.geometry.pose import Pose
from ur_cartesian_driver.motion.goal.execution_modes import ExecutionMode
from ur_cartesian_driver.motion.goal.goal import Goal, Segment, SegmentType, Waypoint
from ur_cartesian_driver.motion.plan.primitive import MoveC, MoveP
from ur_cartesian_driver.planning import plan, PlanningOptions

pytestmark = [pytest.mark.acceptance, pytest.mark.slow]

GOALS = int(os.environ.get('RANDOM_GOALS', '30'))
#: Each run draws another of these. Their findings are new: a change caused them. Seeds left out
#: find known faults (21: a time refused 10 % above the least; 26: a flip where the wrist may
#: pass); other seeds find faults that nobody has seen yet.
SEEDS = [seed for seed in range(1, 41) if seed not in (21, 26)]
SEED = int(os.environ.get('RANDOM_GOALS_SEED', str(SEEDS[int(time.time()) % len(SEEDS)])))
ONLY = os.environ.get('RANDOM_GOALS_ONLY', '')
#: So many goals run one after the other on the same robot.
GOALS_OF_A_ROBOT = 20
#: Plans of longer motions are not run [s].
MAX_DURATION = 8.0
#: The first paths of a program set out slowly: for so long, with some margin [s].
START_TIME = 0.4
TCP_GOALS, GOALS_OF_A_DRIVER = int(os.environ.get('RANDOM_TCP_GOALS', '5')), 5
#: Their robots are others; time is real there [s].
FIRST_OF_TCP, MAX_TCP_DURATION = 1000, 2.5
#: A simulator that a busy computer gives no time leaves out cycles: such a run is not judged [s].
MAX_GAP = 0.05


class Session:
    """One robot, on which goals run from anywhere."""

    def __init__(self, cell, robot):
        self.cell, self.robot, self.arm = cell, robot, robot.arm
        self.options = PlanningOptions(**robot.options)
        self.recorder = RtdeRecorder()
        #: How many programs have connected, and how long the last one has moved on paths [s].
        self.programs, self.path_time = 0, 0.0

    async def start(self):
        cycle = self.cell.robot.config.cycle
        connection, _ = await self.cell.loop.create_connection(lambda: self.recorder, HOST, RTDE)
        connection.write(self.recorder.codec.requests(1.0 / cycle))
        await self.cell.until(lambda: self.recorder.rows)

    async def place(self, q, T_flange_tcp):
        """Place the arm somewhere; return the state that the driver sees."""
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
        await self.cell.sleep(0.8 if self.robot.imperfect else 0.05)  # it may ring
        return self.cell.memory.read()

    async def run(self, case, made):
        """Run a plan, and return the record."""
        cell = self.cell
        self.recorder.rows.clear()
        programs = cell.count_connected_programs()
        if programs != self.programs:
            self.programs, self.path_time = programs, 0.0
        is_path = made.execution is ExecutionMode.PRIMITIVES
        is_first = is_path and self.path_time < START_TIME
        self.path_time += made.duration if is_path else 0.0
        sent = cell.robot.controller.time
        motion = cell.owner.start(made)
        await cell.until(lambda: motion.outcome is not None, 3.0 * made.duration + 60.0)
        await cell.sleep(0.5 if self.robot.imperfect else 0.05)  # it may ring
        return run_of(
            self.robot,
            case,
            made,
            list(self.recorder.rows),
            motion.outcome,
            cycle=cell.robot.config.cycle,
            sent=sent,
            is_first=is_first,
        )


def leaves_blends_out(made, cycle):
    """Tell whether a robot of such a cycle leaves blends out that its model does not."""
    return any(
        isinstance(move := segment.primitive, MoveP | MoveC)
        and 0.0 < move.blend_radius < move.velocity * cycle
        for segment in made.segments
    )


def refused_goal(cell, robot, case, state, text):
    model = robot.arm.model
    T_flange_tool = case.goal.T_flange_controlled or case.T_flange_tcp
    return Refused(
        goal=case.goal,
        q=state.target_q,
        arm=Kinematics(robot.arm.geometry, model.position_limits, T_flange_tool),
        joint_speeds=model.max_joint_speed,
        cycle=cell.robot.config.cycle,
        options=PlanningOptions(**robot.options),
        text=text,
    )


def run_of(robot, case, made, rows, outcome, **more):
    model = robot.arm.model
    T_flange_tool = case.goal.T_flange_controlled or case.T_flange_tcp
    return Run(
        goal=case.goal,
        promise=promise_of(made),
        arm=Kinematics(robot.arm.geometry, model.position_limits, T_flange_tool),
        joint_speeds=model.max_joint_speed,
        max_tool_speed=robot.options['max_tool_speed'],
        q=case.q,
        rows=rows,
        succeeded=outcome.succeeded,
        outcome=f'{outcome.code.name}: {outcome.text}',
        **more,
    )


def remedy_error(refused, state, arm):
    """Describe how a goal that gets the time that its refusal asks for is refused again."""
    goal = remedied(refused.goal, refused.index, refused.text)
    try:
        if goal is not None:
            plan(goal, state, arm, refused.options)
    except TooFast as refusal:
        if replace(refused, text=str(refusal)).index == refused.index:
            return f'with that time: {refusal}'
    except GoalRefused:
        pass  # for another reason, which comes later
    return ''


async def warm_up(session):
    """Let the program do its first path, which sets out slowly."""
    q = (0.0, -1.5, 1.5, -1.5, -1.5, 0.0)
    state = await session.place(q, Pose())
    there = session.arm.forward((0.02, *q[1:]))
    goal = Goal(
        waypoints=(Waypoint(pose=there),),
        segments=(Segment(type=SegmentType.JOINT, velocity=0.02),),
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
            refused = refused_goal(cell, robot, case, state, str(refusal))
            kind, why = is_right(refused)
            why = why or remedy_error(refused, state, robot.arm)
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
        if leaves_blends_out(made, cell.robot.config.cycle):
            counts['blends within a cycle'] += 1
            continue
        await cell.sleep(0.02)
        try:  # what has passed passes again, by another packet of the robot
            made = plan(case.goal, cell.memory.read(), robot.arm, session.options)
        except GoalRefused as refusal:
            counts['refused later'] += 1
            wrong.append(f'{name} ({case.family}; {robot}) refused later: {refusal}')
            continue
        run = await session.run(case, made)
        counts['run'] += 1
        if ONLY and os.environ.get('RANDOM_GOALS_SHOW'):
            print(
                case.goal,
                *made.report,
                run.outcome,
                list(cell.robot.controller.messages.log),
                cell.owner.log,
                sep='\n',
            )
        count(run, f'{name} ({case.family}; {robot})', counts, wrong)
        if not run.succeeded:
            return left[left.index(k) + 1 :]
    return []


def count(run, name, counts, wrong):
    """Judge a run, and count its faults."""
    counts[f'run: {run.promise.execution.name}'] += 1
    for kind, text in judge(run):
        counts[f'wrong: {kind}'] += 1
        if kind not in KNOWN:
            wrong.append(f'{name} {kind}: {text}')
        elif os.environ.get('RANDOM_GOALS_SHOW'):
            print(name, kind, text)


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
    report('random_goals', f'RANDOM_GOALS={GOALS}', counts, wrong, record_property)


def report(name, variable, counts, wrong, record_property):
    """Print the counts and the command that repeats them; fail where something is wrong."""
    line = ', '.join(f'{count} {kind}' for kind, count in sorted(counts.items()))
    command = (
        f'{variable} RANDOM_GOALS_SEED={SEED} make test '
        "PYTEST_ARGS='test/acceptance/test_random_promises.py -rP'"
    )
    print(f'{command}: {line}')
    record_property(name, line)
    assert not wrong, '\n'.join([command, line, *wrong])


# -- through processes and TCP --------------------------------------------------------------------


@contextmanager
def robot_and_driver(robot, number):
    """Start a simulated robot and the process of a driver; yield driver, RTDE and its cycle."""
    rng, model = np.random.default_rng([SEED, number]), robot.arm.model
    q = [*rng.uniform(-2.0, -0.8, 2), rng.uniform(0.8, 2.0), *rng.uniform(-2.0, -0.8, 3)]
    arguments = [f'--{name}-port=0' for name in ('rtde', 'primary', 'dashboard')]
    if robot.calibration_seed is not None:
        arguments.append(f'--calibration-seed={robot.calibration_seed}')
    if robot.imperfect:
        arguments.append(f'--imperfect={robot.imperfect}')
    joints = ','.join(map(str, q))
    with process(
        *('sim', f'--model={model.name}', f'--joints={joints}', *arguments),
        environment={**os.environ, 'PYTHONUNBUFFERED': '1'},
        stdout=subprocess.PIPE,
    ) as simulator:
        line = simulator.stdout.readline()
        ports = {name: int(port) for name, port in re.findall(r'(\w+) (\d+)', line)}
        config = DriverConfig(
            robot_ip=HOST,
            ur_type=model.name,
            headless_mode=True,
            rtde_port=ports['RTDE'],
            primary_port=ports['primary'],
            dashboard_port=ports['dashboard'],
            reverse_port=0,
            script_sender_port=0,
            trajectory_port=0,
            script_command_port=0,
            # Two cores are shared with other tests.
            robot_receive_timeout=1.0,
            max_state_age=1.0,
        )
        cycle = model.control_cycle
        with (
            Driver(config, PlanningOptions(**robot.options)) as driver,
            PlainRtde(HOST, ports['RTDE'], 1.0 / cycle) as rtde,
        ):
            driver.wait_ready(30.0)
            yield driver, rtde, cycle


def run_over_tcp(driver, rtde, cycle, robot, number, counts, wrong):
    """Run goals one after the other, each from where the last one has ended."""
    path_time, done = 0.0, 0
    for k in range(10 * GOALS_OF_A_DRIVER):
        state = driver.state
        start = state.target_q, state.T_flange_tcp
        case = mixed_case(robot, SEED, number, k, start)
        try:
            made = driver.plan(case.goal)
        except GoalRefused:
            counts['refused'] += 1
            continue
        if made.duration > MAX_TCP_DURATION:
            counts['long'] += 1
            continue
        first_row = max(len(rtde.rows) - 1, 0)
        outcome = driver.start(made).result(60.0)
        rtde.wait(0.5 if robot.imperfect else 0.05)
        is_path = made.execution is ExecutionMode.PRIMITIVES
        rows = rtde.rows[first_row:]
        if max(b.time - a.time for a, b in pairwise(rows)) > MAX_GAP:
            counts['starved'] += 1
            continue
        run = run_of(
            robot,
            case,
            made,
            rows,
            outcome,
            cycle=cycle,
            sent=rows[0].time,
            is_first=is_path and path_time < START_TIME,
            late=0.1,
        )
        path_time += made.duration if is_path else 0.0
        counts['run'] += 1
        count(run, f'{number}.{k} ({case.family}; {robot})', counts, wrong)
        done += 1
        if done == GOALS_OF_A_DRIVER or not run.succeeded:
            return done
    return done


@pytest.mark.exhaustive
@pytest.mark.timeout(7200)
def test_promises_hold_through_processes_and_tcp(record_property):
    counts, wrong, number = Counter(), [], FIRST_OF_TCP
    while counts['run'] < TCP_GOALS:
        robot = random_robot(SEED, number)
        with robot_and_driver(robot, number) as (driver, rtde, cycle):
            run_over_tcp(driver, rtde, cycle, robot, number, counts, wrong)
        number += 1
    report('random_tcp_goals', f'RANDOM_TCP_GOALS={TCP_GOALS}', counts, wrong, record_property)
