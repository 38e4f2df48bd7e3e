# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Timed goals keep their times at every position of the slider, and after a pause."""

from dataclasses import replace

from fault_goals import ARM, OPTIONS
import pytest
from robot_cell import run_cell

from ur_cartesian_driver.driver.appender import encode_part
from ur_cartesian_driver.execution.goal.motion_job import AppendJob
from ur_cartesian_driver.motion.geometry.pose import Pose
from ur_cartesian_driver.motion.goal.execution_modes import ExecutionMode
from ur_cartesian_driver.motion.goal.goal import Goal, Segment, SegmentType, Tolerance, Waypoint
from ur_cartesian_driver.motion.state.rtde_state import RuntimeState
from ur_cartesian_driver.planning import plan
from ur_cartesian_driver.planning.append.append_planner import plan_append, plan_first_part
from ur_cartesian_driver.planning.append.appendable_goal import AppendedPoints

pytestmark = [
    pytest.mark.acceptance,
    pytest.mark.slow,
    pytest.mark.both_arms,
    pytest.mark.exhaustive,
]

#: Times of the points, and how much later than that the last one may be reached [s]; the arm comes
#: to rest 0.2 s after the last set-point of servoj, at its usual gain and lookahead, and a little
#: later if it is not ideal.
TIMES, TOLERANCE = (0.5, 1.0), 0.3
#: 0.2 shows what 0.1 does, and takes half as long.
SLIDERS = (1.0, 0.5, 0.2)
#: How long the program is paused [s].
PAUSE = 0.4


def timed_goal(state, execution, *segments):
    """Return a corner of 4 cm and 3 cm whose points have times."""
    (x, y, z), turned = state.actual_tcp_pose.position, state.actual_tcp_pose.quaternion
    places = (x, y + 0.04, z), (x + 0.03, y + 0.04, z)
    return Goal(
        waypoints=tuple(
            Waypoint(time=time, pose=Pose(place, turned))
            for time, place in zip(TIMES, places, strict=True)
        ),
        segments=segments,
        execution=execution,
        path_tolerance=Tolerance(position=(0.004,) * 3),
        goal_tolerance=Tolerance(position=(0.001,) * 3),
        goal_time_tolerance=TOLERANCE,
    )


def start(execution, *segments):
    def start_goal(cell):
        state = cell.memory.read()
        return cell.owner.start(plan(timed_goal(state, execution, *segments), state, ARM, OPTIONS))

    return start_goal


def start_appended(cell):
    """Start a goal with its first point, and append the other one at once."""
    state = cell.memory.read()
    whole = timed_goal(state, ExecutionMode.SPLINE)
    goal = replace(whole, waypoints=whole.waypoints[:1], keep_open=True)
    first = plan_first_part(plan(goal, state, ARM, OPTIONS), ARM, OPTIONS)
    motion = cell.owner.run(*encode_part(first))
    rest = plan_append(
        first.next_goal,
        AppendedPoints(waypoints=whole.waypoints[1:], last=True),
        ARM,
        OPTIONS,
        from_rest=False,
    )
    points, job = encode_part(rest)
    cell.owner.append(points, AppendJob(number=1, records_before=rest.records_before, job=job))
    return motion


def segments(kind):
    return Segment(type=kind, blend_radius=0.01), Segment(type=kind)


STARTS = {
    'lines with a blend': start(ExecutionMode.PRIMITIVES, *segments(SegmentType.LINEAR)),
    'joint moves with a blend': start(ExecutionMode.PRIMITIVES, *segments(SegmentType.JOINT)),
    'spline': start(ExecutionMode.SPLINE),
    'set-points': start(ExecutionMode.SERVO),
    'appended': start_appended,
}


async def is_moving(cell, motion, fraction=0.3):
    await cell.until(lambda: motion.progress and motion.progress[-1].fraction > fraction, 20.0)


async def pause(cell, meanwhile=lambda: None):
    cell.robot.inject('pause')
    await cell.until(lambda: cell.memory.read().runtime_state is RuntimeState.PAUSED)
    meanwhile()
    await cell.sleep(PAUSE)
    cell.robot.inject('play')


async def slider_before(cell, begin, slider):
    cell.robot.set_speed_slider(slider)
    return begin(cell)


async def slider_during(cell, begin, slider):
    """Slow the motion down to an end as slow as that, by way of another position."""
    motion = begin(cell)
    await is_moving(cell, motion)
    cell.robot.set_speed_slider(0.5 * (1.0 + slider))
    await is_moving(cell, motion, 0.6)
    cell.robot.set_speed_slider(slider)
    return motion


async def slider_before_a_pause(cell, begin, slider):
    motion = await slider_before(cell, begin, slider)
    await is_moving(cell, motion)
    await pause(cell)
    return motion


async def slider_during_a_pause(cell, begin, slider):
    motion = begin(cell)
    await is_moving(cell, motion)
    await pause(cell, lambda: cell.robot.set_speed_slider(slider))
    return motion


CHANGES = (slider_before, slider_during, slider_before_a_pause, slider_during_a_pause)


def run_changes(kind, slider, changes):
    """Run a timed goal by each of the changes, and see that its time is kept."""

    async def scenario(cell):
        for change in changes:
            before = cell.robot.controller.motion.q
            cell.robot.set_speed_slider(1.0)
            motion = await change(cell, STARTS[kind], slider)
            await cell.until(lambda motion=motion: motion.outcome, 20.0, f'{change.__name__}')
            assert motion.outcome.succeeded, f'{change.__name__}: {motion.outcome}'
            slowest = min(p.speed_scaling for p in motion.progress if p.fraction > 0.7)
            fastest = max(p.speed_scaling for p in motion.progress)
            assert slowest <= slider + 0.01, change.__name__
            assert slider - 0.01 <= fastest <= 1.0, change.__name__
            cell.robot.controller.motion.teleport(before)
            await cell.sleep(0.2)

    run_cell(scenario)


@pytest.mark.parametrize('slider', SLIDERS)
@pytest.mark.parametrize('kind', STARTS)
def test_a_timed_goal_keeps_its_time(kind, slider):
    """The controller's time counts; that of the wall is up to five times as long."""
    run_changes(kind, slider, CHANGES)


def test_set_points_keep_their_time_at_the_slider_of_a_first_motion():
    """Only here does the driver itself go at the pace of the slider; its time-outs do not."""
    run_changes('set-points', 0.1, (slider_before,))
