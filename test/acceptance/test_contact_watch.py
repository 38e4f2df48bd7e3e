# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The watch for contact beside whatever moves the arm: its stop, its answer, and its ends.

The arm's place comes by RTDE, the surface is a plane of the simulator; contact follows the
simulator's own law: the tests prove the wiring, not the robot. All in virtual time.
"""

from itertools import pairwise
import re

import pytest
from robot_cell import CellMotion, CYCLE, run_cell

from ur_cartesian_driver.driver.appender import encode_part
from ur_cartesian_driver.driver.ipc.channel import ArmSetup, SetLiveTarget, StartMotion
from ur_cartesian_driver.driver.live_session import live_setup, stationary_job, stationary_plan
from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.kinematics.robot_models import JOINT_NAMES, robot_model
from ur_cartesian_driver.motion.errors import ErrorCode
from ur_cartesian_driver.motion.geometry.pose import Pose
from ur_cartesian_driver.motion.goal.execution_modes import ExecutionMode
from ur_cartesian_driver.motion.goal.goal import Goal, Segment, Tolerance, Waypoint
from ur_cartesian_driver.motion.goal.joint_goal import JointGoal, JointPoint
from ur_cartesian_driver.motion.state.rtde_state import RuntimeState
from ur_cartesian_driver.planning import plan, plan_joint_goal, PlanningOptions
from ur_cartesian_driver.planning.append.append_planner import plan_first_part
from ur_cartesian_driver.robot.services.service_calls import EndContactWatchCall, WatchContactCall
from ur_cartesian_driver.sim.motion.contact.contact_bodies import ContactBody
from ur_cartesian_driver.sim.motion.motion_ownership import FreedriveState

pytestmark = [pytest.mark.acceptance, pytest.mark.slow]

ARM, OPTIONS = Arm(robot_model('ur5e')), PlanningOptions()
#: How far beside the tool the surface is [m], and how near to it the arm stops [m].
DISTANCE, ACCURACY = 0.03, 1e-3
#: How deep a tool is pressed in [m], far beyond the force that is a contact [N].
PRESSED, TOUCHING = 0.004, 5.0
#: How far a wall pushes the tool [m]: 20 N, less what the arm gives way.
PUSHED = 0.001
STOPPED = 'while detect_tool_contact watched, which stops every motion'


def put_wall(cell, distance=DISTANCE, friction=0.2):
    """Put a plane across y; return its y in base."""
    x, y, z = cell.memory.read().actual_tcp_pose.position
    body = ContactBody('plane', (x, y + distance, z), (0.0, -1.0, 0.0), friction=friction)
    cell.robot.controller.contact.bodies = (body,)
    return y + distance


def move_wall(cell, wall, by):
    (body,) = cell.robot.controller.contact.bodies
    x, _, z = body.place
    moved = ContactBody('plane', (x, wall + by, z), (0.0, -1.0, 0.0))
    cell.robot.controller.contact.bodies = (moved,)


def place(cell):
    return cell.memory.read().actual_tcp_pose.position[1]


def line(cell, *ways, mode=ExecutionMode.PRIMITIVES, speed=0.04, **fields):
    """Return a plan of lines along y, by default through the wall, at about a speed [m/s]."""
    state = cell.memory.read()
    (x, y, z), turned = state.actual_tcp_pose.position, state.actual_tcp_pose.quaternion
    ways = ways or (0.02, 0.06)
    waypoints, time = [], 0.0
    for before, way in pairwise((0.0, *ways)):
        time += abs(way - before) / speed + 0.2
        waypoints.append(Waypoint(pose=Pose((x, y + way, z), turned), time=time))
    goal = Goal(
        waypoints=tuple(waypoints),
        segments=(Segment(),) * len(ways),
        execution=mode,
        **fields,
    )
    return plan(goal, state, ARM, OPTIONS)


def swing(cell, *points, **fields):
    """Return a plan of joint points (time, turn of the base)."""
    state = cell.memory.read()
    pan, *rest = state.actual_q
    goal = JointGoal(
        joint_names=JOINT_NAMES,
        points=tuple(JointPoint(time=t, positions=(pan + turn, *rest)) for t, turn in points),
        **fields,
    )
    return plan_joint_goal(goal, state, ARM, OPTIONS)


async def watch(cell):
    """Begin to watch; return a function that returns the answer, None = none yet."""
    number = cell.owner.call(WatchContactCall())
    await cell.sleep(0.1)
    assert number not in cell.owner.call_answers, cell.owner.call_answers
    return lambda: cell.owner.call_answers.get(number)


async def touched(cell, answer, wall):
    """Wait for the contact; check the answer, and that the arm rests at the wall."""
    await cell.until(answer, 10.0)
    assert answer().ok, answer().text
    said = re.fullmatch(r'The tool touched at x .*, y (.*), z .* m in base\.', answer().text)
    assert float(said[1]) == pytest.approx(place(cell), abs=2e-4)
    assert cell.at_rest()
    assert place(cell) == pytest.approx(wall, abs=ACCURACY)
    assert abs(cell.robot.controller.tcp_wrench[1]) < TOUCHING


@pytest.mark.parametrize('mode', [mode for mode in ExecutionMode if mode])
def test_contact_stops_a_cartesian_goal_of_any_mode(mode):
    async def scenario(cell):
        wall, answer = put_wall(cell), await watch(cell)
        motion = cell.owner.start(line(cell, mode=mode))
        await cell.until(lambda: motion.outcome, 10.0)
        assert motion.outcome.code is ErrorCode.EXECUTION_FAILED, motion.outcome.text
        assert STOPPED in motion.outcome.text
        assert not motion.outcome.touched
        await touched(cell, answer, wall)
        # The watch is over, and the arm takes the next goal, away from the wall.
        motion = cell.owner.start(line(cell, -0.02, mode=mode))
        await cell.until(lambda: motion.outcome, 10.0)
        assert motion.outcome.succeeded, motion.outcome.text

    run_cell(scenario)


@pytest.mark.parametrize('begins_later', [False, True])
def test_a_tool_may_go_back_farther_than_max_plan_deviation(begins_later):
    async def scenario(cell):
        wall = put_wall(cell, 0.1)
        answer = None if begins_later else await watch(cell)
        tolerance = Tolerance(position=(0.001, 0.006, 0.001))
        motion = cell.owner.start(line(cell, 0.16, speed=0.16, path_tolerance=tolerance))
        if begins_later:
            await cell.until(lambda: place(cell) > wall - 0.08, 5.0)
            answer = await watch(cell)
        places = []

        def has_ended():
            places.append(place(cell))
            return motion.outcome

        await cell.until(has_ended, 10.0)
        assert STOPPED in motion.outcome.text
        await cell.until(answer)
        assert answer().ok
        assert max(places) - place(cell) > 0.002
        assert place(cell) == pytest.approx(wall, abs=4e-3)  # three cycles at this speed

    run_cell(scenario)


@pytest.mark.parametrize('delay', [1, 3, 10, 20])
def test_a_cancel_on_the_way_back_leaves_the_arm_there_and_the_watch_succeeds(delay):
    async def scenario(cell):
        # With friction, the simulated arm trembles where it is pressed on.
        put_wall(cell, 0.1, friction=0.0)
        answer = await watch(cell)
        tolerance = Tolerance(position=(0.001, 0.006, 0.001))
        motion = cell.owner.start(line(cell, 0.16, speed=0.16, path_tolerance=tolerance))
        await cell.until(lambda: abs(cell.robot.controller.tcp_wrench[1]) > TOUCHING, 5.0)
        await cell.sleep(delay * CYCLE)
        cell.owner.cancel()
        await cell.until(lambda: motion.outcome)
        assert motion.outcome.code is ErrorCode.CANCELLED, motion.outcome.text
        await cell.until(answer)
        assert answer().ok, answer().text
        assert cell.at_rest()
        await cell.until(cell.is_ready)

    run_cell(scenario)


@pytest.mark.parametrize(
    ('points', 'until'),
    [
        (((4.0, -0.15),), False),
        (((0.0, 0.0), (2.0, -0.02), (5.0, -0.15)), False),
        (((4.0, -0.15),), True),
    ],
    ids=['move', 'spline', 'until contact'],
)
def test_contact_stops_a_joint_trajectory(points, until):
    async def scenario(cell):
        wall, answer = put_wall(cell), await watch(cell)
        motion = cell.owner.start(swing(cell, *points, until_contact=until))
        await cell.until(lambda: motion.outcome, 10.0)
        assert motion.outcome.touched is until
        assert motion.outcome.succeeded is until, motion.outcome.text
        assert until or STOPPED in motion.outcome.text
        await touched(cell, answer, wall)

    run_cell(scenario)


def test_a_watch_may_begin_while_the_arm_moves():
    async def scenario(cell):
        wall = put_wall(cell)
        motion = cell.owner.start(line(cell))
        await cell.until(lambda: place(cell) > wall - DISTANCE + 0.005, 5.0)
        answer = await watch(cell)
        await touched(cell, answer, wall)
        await cell.until(lambda: motion.outcome)
        assert STOPPED in motion.outcome.text

    run_cell(scenario)


@pytest.mark.parametrize('threads', ['', 'seed 7'])
def test_a_goal_that_begins_beside_a_contact_moves_nothing_after_its_end(threads):
    async def scenario(cell):
        ended = set()
        for half_cycles in range(24):
            wall, answer = put_wall(cell), await watch(cell)
            goal = line(cell, -0.003)
            move_wall(cell, wall, -DISTANCE - PUSHED)
            await cell.sleep(half_cycles * 0.5 * CYCLE)
            motion = cell.owner.start(goal)
            await cell.until(lambda motion=motion: motion.outcome, 5.0)
            await cell.until(answer, 2.0)
            assert answer().ok, answer().text
            assert motion.outcome.succeeded or STOPPED in motion.outcome.text
            ended.add(motion.outcome.code)
            cell.robot.controller.contact.bodies = ()
            before = place(cell)
            await cell.sleep(0.3)
            assert place(cell) == pytest.approx(before, abs=5e-4), half_cycles
        assert ended == {ErrorCode.SUCCESSFUL, ErrorCode.EXECUTION_FAILED}

    run_cell(scenario, threads=threads)


def test_contact_at_rest_is_found_and_moves_the_arm_by_no_more_than_it_was_pushed():
    async def scenario(cell):
        wall, before, answer = put_wall(cell), place(cell), await watch(cell)
        await cell.sleep(0.5)
        assert answer() is None
        move_wall(cell, wall, -DISTANCE - PUSHED)
        await cell.until(answer, 5.0)
        assert answer().ok, answer().text
        assert place(cell) == pytest.approx(before, abs=1e-3)
        await cell.until(cell.is_ready)

    run_cell(scenario)


def test_a_tool_may_leave_what_it_touches():
    async def scenario(cell):
        put_wall(cell)
        motion = cell.owner.start(line(cell, DISTANCE + PRESSED))
        await cell.until(lambda: motion.outcome, 10.0)
        assert motion.outcome.succeeded, motion.outcome.text
        motion = cell.owner.start(line(cell, -0.02))
        await cell.until(lambda: not cell.at_rest())
        answer = await watch(cell)
        assert abs(cell.robot.controller.tcp_wrench[1]) > TOUCHING
        await cell.until(lambda: motion.outcome, 10.0)
        assert motion.outcome.succeeded, motion.outcome.text
        assert answer() is None

    run_cell(scenario)


def test_a_watch_lasts_over_goals_and_their_ends_until_it_is_ended():
    async def scenario(cell):
        wall, answer = put_wall(cell), await watch(cell)
        for way in (0.01, -0.01):
            motion = cell.owner.start(line(cell, way))
            await cell.until(lambda motion=motion: motion.outcome, 10.0)
            assert motion.outcome.succeeded, motion.outcome.text
        motion = cell.owner.start(line(cell, 0.02, 0.025))
        await cell.sleep(0.2)
        cell.owner.cancel()
        await cell.until(lambda: motion.outcome, 2.0)
        assert motion.outcome.code is ErrorCode.CANCELLED
        second = cell.owner.call(WatchContactCall())
        await cell.until(lambda: second in cell.owner.call_answers)
        assert 'watches for contact already' in cell.owner.call_answers[second].text
        assert answer() is None
        cell.owner.call(EndContactWatchCall())
        await cell.until(answer, 0.2)
        assert (answer().ok, answer().text) == (
            False,
            'The watch was ended before the tool touched.',
        )
        # Nothing watches any more: the wall takes the push, until the goal's end.
        motion = cell.owner.start(line(cell, wall - place(cell) + 0.001))
        await cell.until(lambda: motion.outcome, 10.0)
        assert motion.outcome.succeeded, motion.outcome.text

    run_cell(scenario)


def test_a_watch_is_ended_before_the_program_has_identified_itself():
    async def scenario(cell):
        cell.resend()
        await cell.until(lambda: not cell.status.program_is_own)
        await cell.until(cell.is_ready)
        assert not cell.status.program_is_own
        number = cell.owner.call(WatchContactCall())
        cell.owner.call(EndContactWatchCall())
        await cell.until(lambda: number in cell.owner.call_answers)
        text = cell.owner.call_answers[number].text
        assert text == 'The watch was ended before the tool touched.'

    run_cell(scenario)


@pytest.mark.parametrize('end', ['stop', 'drop sockets', 'driver'])
def test_a_watch_ends_with_the_program_and_another_one_may_begin(end):
    async def scenario(cell):
        answer = await watch(cell)
        if end == 'driver':
            await cell.end_driver()
            await cell.start_driver(2)
        else:
            cell.robot.inject(end)
            await cell.until(answer, 2.0)
            assert not answer().ok
            assert answer().text.startswith('The watch for contact ended with the robot program: ')
            cell.resend()
        await cell.until(lambda: cell.is_ready() and cell.status.program_is_own, 5.0)
        wall = put_wall(cell)
        motion = cell.owner.start(line(cell, 0.01))
        await cell.until(lambda: motion.outcome, 5.0)
        assert motion.outcome.succeeded, motion.outcome.text
        answer = await watch(cell)
        cell.owner.start(line(cell))
        await touched(cell, answer, wall)

    run_cell(scenario)


def test_a_paused_program_ends_the_watch_when_it_goes_on():
    async def scenario(cell):
        answer = await watch(cell)
        cell.robot.inject('pause')
        await cell.sleep(0.1)
        cell.owner.call(EndContactWatchCall())
        await cell.until(answer, 2.0)
        assert answer().text == 'The watch was ended before the tool touched.'
        again = cell.owner.call(WatchContactCall())
        await cell.until(lambda: again in cell.owner.call_answers)
        assert 'PAUSED' in cell.owner.call_answers[again].text
        cell.robot.inject('play')
        await cell.until(lambda: cell.memory.read().runtime_state is RuntimeState.PLAYING)
        wall, answer = put_wall(cell), await watch(cell)
        cell.owner.start(line(cell))
        await touched(cell, answer, wall)

    run_cell(scenario)


def test_contact_ends_a_live_session():
    async def scenario(cell):
        wall, answer = put_wall(cell), await watch(cell)
        state = cell.memory.read()
        motion = cell.owner.motions[1] = CellMotion()
        cell.owner.send(
            StartMotion(
                motion=1,
                points=b'',
                job=stationary_job(stationary_plan(state)),
                arm=ArmSetup.of(ARM),
                live=live_setup(ARM, state.target_q, OPTIONS),
            )
        )
        (x, y, z), turned = state.target_tcp_pose.position, state.target_tcp_pose.quaternion
        for i in range(2000):
            if motion.outcome is not None:
                break
            ahead = Pose((x, y + min(0.06, 0.0004 * i), z), turned)
            cell.owner.send(SetLiveTarget(motion=1, T_base_tcp=ahead, age=0.0))
            await cell.sleep(CYCLE)
        assert STOPPED in motion.outcome.text
        await touched(cell, answer, wall)
        await cell.until(cell.is_ready)

    run_cell(scenario)


def test_contact_ends_freedrive():
    async def scenario(cell):
        wall, answer = put_wall(cell), await watch(cell)
        motion = cell.owner.motions[1] = CellMotion()
        plan = stationary_plan(cell.memory.read())
        cell.owner.send(
            StartMotion(motion=1, points=b'', job=stationary_job(plan), freedrive=True)
        )
        await cell.until(lambda: motion.progress)
        move_wall(cell, wall, -DISTANCE - PUSHED)
        await cell.until(lambda: motion.outcome, 2.0)
        assert STOPPED in motion.outcome.text
        await cell.until(answer)
        assert answer().ok
        assert cell.robot.controller.freedrive is not FreedriveState.TEACH

    run_cell(scenario, allow_freedrive=True)


def test_contact_ends_an_open_goal_that_waits_for_points():
    async def scenario(cell):
        wall, answer = put_wall(cell), await watch(cell)
        plan = line(cell, 0.01, keep_open=True)
        part = plan_first_part(plan, ARM, OPTIONS)
        points, job = encode_part(part)
        motion = cell.owner.run(points, job)
        await cell.until(lambda: any(each.awaiting_points for each in motion.progress), 5.0)
        move_wall(cell, wall, 0.01 - DISTANCE - PUSHED)
        await cell.until(lambda: motion.outcome, 2.0)
        assert motion.outcome.code is ErrorCode.EXECUTION_FAILED
        assert STOPPED in motion.outcome.text
        await cell.until(answer)
        assert answer().ok

    run_cell(scenario)


def test_a_cb3_robot_has_no_watch():
    async def scenario(cell):
        number = cell.owner.call(WatchContactCall())
        await cell.until(lambda: number in cell.owner.call_answers)
        answer = cell.owner.call_answers[number]
        assert not answer.ok
        assert answer.text.startswith('A CB3 robot (software 3.')

    run_cell(scenario, robot={'model': 'ur5'})
