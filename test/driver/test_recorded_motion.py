# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Whole goals against the simulated controller, and whether their recordings say what happened."""

import asyncio
from dataclasses import replace

from append_goals import AppendMotion, circle
import numpy as np
import pytest
from robot_cell import CYCLE, run_cell

from ur_cartesian_driver.cli import main
from ur_cartesian_driver.driver.recordings.recording import Recording
from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.kinematics.robot_models import robot_model
from ur_cartesian_driver.motion.errors import ErrorCode
from ur_cartesian_driver.motion.geometry.pose import Pose, rotate
from ur_cartesian_driver.motion.geometry.vectors import ZERO6
from ur_cartesian_driver.motion.goal.execution_modes import ExecutionMode
from ur_cartesian_driver.motion.goal.goal import (
    Goal,
    IOCommand,
    OutputKind,
    Segment,
    Waypoint,
)
from ur_cartesian_driver.planning import plan, PlanningOptions
from ur_cartesian_driver.sim.faults.fault_values import (
    AfterDistance,
    EventFault,
    FaultEvent,
    SpeedSliderFault,
)

pytestmark = [pytest.mark.acceptance, pytest.mark.slow]


def corner(cell):
    """A goal of two lines with a blend between them, from where the arm stands."""
    home = cell.memory.read().actual_tcp_pose
    places = ((0.0, 0.05, 0.0), (0.04, 0.05, 0.0))
    return Goal(
        waypoints=tuple(
            Waypoint(
                pose=Pose(
                    tuple(a + b for a, b in zip(home.position, place, strict=True)),
                    home.quaternion,
                )
            )
            for place in places
        ),
        segments=(Segment(blend_radius=0.01), Segment()),
    )


async def executed(cell, goal, act=None):
    """Run a goal; return its plan, its outcome, and the states in shared memory meanwhile."""
    made = plan(goal, cell.memory.read(), Arm(robot_model('ur5e')), PlanningOptions())
    seen = {}

    async def watch():
        while True:
            state = cell.memory.read()
            seen[state.timestamp] = state
            await asyncio.sleep(0.5 * CYCLE)

    watching = asyncio.create_task(watch())
    motion = cell.owner.start(made)
    if act is not None:
        await act(motion)
    await cell.until(lambda: motion.outcome is not None, 20.0)
    watching.cancel()
    return made, motion.outcome, seen


def recorded(directory):
    """Return the recordings; the robot loop has ended, and with it the writing."""
    return [Recording.load(file) for file in sorted(directory.glob('*.npz'))]


def kinds(recording):
    return [kind for _, kind, _ in recording.events]


@pytest.fixture(scope='module')
def eventful(tmp_path_factory):
    """
    Record a motion with a slider that moves, an output that somebody switches, and a force.

    Return the directory, and the motion itself: plan, outcome, packets of RTDE.
    """
    directory = tmp_path_factory.mktemp('eventful')

    async def scenario(cell):
        cell.robot.controller.external_ft = True
        cell.robot.controller.io.external_force = [1.0, -2.0, 3.0, 0.1, -0.2, 0.3]
        cell.robot.inject(SpeedSliderFault(fraction=0.5, trigger=AfterDistance(0.02)))

        async def switch(motion):
            await cell.until(lambda: len(motion.progress) > 3)
            cell.robot.controller.io.digital_out.standard[3] = True

        return await executed(cell, corner(cell), switch)

    return directory, *run_cell(scenario, record_directory=str(directory))


def by_cycle(seen):
    """Return packets by the number of their cycle from the first one."""
    return {round((time - min(seen)) / CYCLE): state for time, state in seen.items()}


def test_a_recording_equals_what_happened(eventful):
    directory, made, outcome, seen = eventful
    (found,) = recorded(directory)
    states = by_cycle(seen)
    rows = np.rint(found.time / CYCLE).astype(int)
    assert len(rows) + found.metadata['rows_left_out'] == rows[-1] + 1
    assert set(states) - set(rows) <= {rows[-1] + 1}
    for i in set(states) & set(rows):
        assert tuple(found.actual_q[i]) == states[i].actual_q
        assert tuple(found.target_pose[i]) == states[i].target_tcp_pose.row()
        assert tuple(found.actual_twist[i]) == states[i].actual_tcp_twist
        assert tuple(found.wrench[i]) == states[i].actual_tcp_wrench
        assert found.speed_scaling[i] == states[i].speed_scaling
    np.testing.assert_array_equal(found.planned_pose, made.reference.poses)
    np.testing.assert_array_equal(found.planned_time, made.reference.time)
    assert found.metadata['outcome']['text'] == outcome.text
    assert found.metadata['robot']['model'] == 'ur5e'
    assert found.metadata['robot']['motion_version'] == 1  # as all software before 5.22
    assert [text for _, _, text in found.events] == [
        'PRIMITIVES, 2 points',
        'on the way to point 0',
        'standard digital output 3: on',
        'speed slider at 50 %',
        'on the way to point 1',
        f'SUCCESSFUL: {outcome.text}',
    ]
    off = found.deviation()
    assert off.position.max() < 1e-3
    assert off.planned_time[-1] == pytest.approx(made.duration, abs=1e-6)


def test_an_exported_recording_has_the_values_of_rtde(eventful, tmp_path):
    pytest.importorskip('mcap_ros2')
    from mcap_topics import pose_row, read_topics, twist_row

    directory, _, _, seen = eventful
    assert main(['export', str(directory), '-o', str(tmp_path / 'a.mcap')]) == 0
    topics, _ = read_topics(tmp_path / 'a.mcap')
    states = by_cycle(seen)
    joints, *others = (
        topics[name]
        for name in (
            '/joint_states',
            '/ur_cartesian_driver/target_joint_states',
            '/ur_cartesian_driver/tcp_pose',
            '/ur_cartesian_driver/target_tcp_pose',
            '/ur_cartesian_driver/tcp_twist',
            '/ur_cartesian_driver/wrench',
        )
    )
    compared = 0
    for i, time in enumerate(joints.times):
        state = states.get(round((time - joints.times[0]) * 1e-9 / CYCLE))
        if state is None:
            continue
        compared += 1
        target, pose, target_pose, twist, wrench = (topic.messages[i] for topic in others)
        assert all(topic.times[i] == time for topic in others)
        assert tuple(joints.messages[i].position) == state.actual_q
        assert tuple(joints.messages[i].velocity) == state.actual_qd
        assert tuple(target.position) == state.target_q
        assert pose_row(pose.pose) == state.actual_tcp_pose.row()
        assert pose_row(target_pose.pose) == state.target_tcp_pose.row()
        assert twist_row(twist.twist) == state.actual_tcp_twist
        force = wrench.wrench.force
        assert rotate(state.actual_tcp_pose.quaternion, (force.x, force.y, force.z)) == (
            pytest.approx(state.actual_tcp_wrench[:3], abs=1e-12)
        )
    assert compared > 0.9 * len(joints.times)
    assert tuple(states[50].actual_tcp_wrench) == (1.0, -2.0, 3.0, 0.1, -0.2, 0.3)


def test_each_motion_is_a_file_that_says_how_it_ended(tmp_path):
    async def scenario(cell):
        async def cancel(motion):
            await cell.until(lambda: len(motion.progress) > 5)
            cell.owner.cancel()

        async def stop(motion):
            await cell.until(lambda: len(motion.progress) > 5)
            cell.robot.inject(EventFault(action=FaultEvent.PROTECTIVE_STOP))

        ends = []
        for act in (cancel, stop):
            _, outcome, _ = await executed(cell, corner(cell), act)
            ends.append(outcome)
        return ends

    ends = run_cell(scenario, record_directory=str(tmp_path))
    cancelled, stopped = recorded(tmp_path)
    assert [found.metadata['outcome']['text'] for found in (cancelled, stopped)] == [
        end.text for end in ends
    ]
    assert cancelled.metadata['outcome']['name'] == ErrorCode.CANCELLED.name
    assert stopped.metadata['outcome']['report'] == list(ends[1].report)
    assert 'cancel' in kinds(cancelled)
    assert ('safety', 'safety mode PROTECTIVE_STOP') in [e[1:] for e in stopped.events]
    # The arm was braking when it was cancelled, and stood when that had ended.
    assert cancelled.tool_speed.max() > 0.05
    assert cancelled.tool_speed[-1] < 1e-3


def test_a_goal_does_not_care_for_a_directory_that_cannot_be_written(tmp_path):
    blocked = tmp_path / 'file'
    blocked.write_text('no directory')

    async def scenario(cell):
        _, outcome, _ = await executed(cell, corner(cell))
        await cell.sleep(0.1)
        return outcome, list(cell.owner.log)

    outcome, log = run_cell(scenario, record_directory=str(blocked))
    assert outcome.succeeded
    assert ['record_directory' in line for line in log].count(True) == 1


@pytest.mark.parametrize('late', [False, True], ids=['in time', 'late'])
def test_the_recording_of_an_open_goal_has_the_path_that_was_gone(tmp_path, late):
    """The ending that each part was planned with is in the plan only where the arm went it."""

    async def scenario(cell):
        home = cell.memory.read().actual_tcp_pose
        motion = AppendMotion(
            cell,
            Goal(
                waypoints=tuple(circle(home, 1, 4)), execution=ExecutionMode.SPLINE, keep_open=True
            ),
        )
        await motion.until(
            lambda: (
                motion.motion.progress
                and (
                    motion.progress.awaiting_points
                    if late
                    else motion.progress.time_remaining < 0.6
                )
            )
        )
        points = circle(home, 5, 4)
        points[-1] = replace(points[-1], time=points[-1].time + 0.1, twist=ZERO6)
        await motion.append(points, last=True)
        return await motion.ended()

    outcome = run_cell(scenario, record_directory=str(tmp_path))
    assert outcome.succeeded, outcome.text
    (found,) = recorded(tmp_path)
    off = found.deviation()
    assert off.target_position.max() < 3e-4
    assert off.waypoint[-1] == found.planned_point[-1] == 7
    assert np.all(np.diff(found.planned_time) >= 0.0)
    assert len(found.points) == 8
    assert ('rest' in ' '.join(outcome.report)) == late
    assert np.nanmax(found.buffered) < 1.5


def test_the_recording_of_a_stream_of_set_points_has_its_lag(tmp_path):
    async def scenario(cell):
        home = cell.memory.read().actual_tcp_pose
        points = circle(home, 1, 10)
        points[-1] = replace(points[-1], twist=ZERO6)
        return await executed(cell, Goal(waypoints=tuple(points), execution=ExecutionMode.SERVO))

    _, outcome, _ = run_cell(scenario, record_directory=str(tmp_path))
    assert outcome.succeeded, outcome.text
    (found,) = recorded(tmp_path)
    under_way = (found.waypoint >= 1) & (found.waypoint < 9)
    assert np.isfinite(found.lag[1:]).all()
    assert found.lag[under_way].min() > 0.0
    assert found.lag[under_way].max() < 0.2
    assert found.buffered[under_way].max() < 0.2
    assert found.deviation().target_position.max() < 1e-3


def test_an_output_that_the_goal_switches_is_recorded_where_it_switched(tmp_path):
    async def scenario(cell):
        goal = replace(
            corner(cell),
            io_commands=(
                IOCommand(
                    waypoint=0, offset=0.0, output=OutputKind.STANDARD_DIGITAL, pin=5, value=1.0
                ),
            ),
        )
        return await executed(cell, goal)

    _, outcome, _ = run_cell(scenario, record_directory=str(tmp_path), io_publish_rate=125.0)
    assert outcome.succeeded, outcome.text
    (found,) = recorded(tmp_path)
    ((time, text),) = [(time, text) for time, kind, text in found.events if kind == 'output']
    assert text == 'standard digital output 5: on'
    place = found.actual_pose[np.searchsorted(found.time, time), :3]
    assert np.linalg.norm(place - found.points[0, :3]) < 0.004  # within 3 cycles
