# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Points of the goal, records on the wire, motions that the program counts: three numbers."""

from dataclasses import replace

import numpy as np
import pytest

from ur_cartesian_driver.execution.goal.goal_commands import Finish, ReportProgress
from ur_cartesian_driver.execution.goal.motion_job import job_from_plan, MotionJob
from ur_cartesian_driver.execution.goal.wire_records import WireRecords
from ur_cartesian_driver.motion.goal.goal import Goal, OutputKind, Segment, Waypoint
from ur_cartesian_driver.motion.plan.plan import ReferencePath
from ur_cartesian_driver.motion.plan.primitive import SwitchOutput
from ur_cartesian_driver.motion.state.rtde_state import RobotState
from ur_cartesian_driver.planning import plan, PlanningOptions

VALVE = SwitchOutput(output=OutputKind.STANDARD_DIGITAL, pin=1, value=1.0)


def job(waypoint, is_motion, **fields):
    poses = np.array([[0.1 * i, 0.0, 0.2, 0.0, 0.0, 0.0, 1.0] for i in range(4)])
    return MotionJob(
        points=len(waypoint),
        duration=3.0,
        waypoint=np.array(waypoint, dtype=np.int32),
        is_motion=np.array(is_motion, dtype=bool),
        reference=ReferencePath(
            poses=poses, point=np.array([0, 0, 1, 2], dtype=np.int32), time=np.arange(4.0)
        ),
        **fields,
    )


#: Two pieces to point 0, an output behind the second, one piece to point 1, two to point 2.
MIXED = ([0, 0, 0, 1, 2, 2], [1, 1, 0, 1, 1, 1])


@pytest.mark.parametrize(
    ('motions', 'begun', 'running'),
    [
        (0, 0, None),
        (1, 1, (0, -1)),
        (2, 2, (0, 0)),
        (3, 4, (1, 0)),
        (4, 5, (2, 1)),
        (5, 6, (2, 2)),
        (9, 6, (2, 2)),
    ],
)
def test_motions_that_the_program_counts_become_records_and_points(motions, begun, running):
    records = WireRecords(job(*MIXED))
    assert records.begun_records(motions) == begun
    assert records.running_waypoints(motions) == running


def test_a_point_has_the_records_before_it_behind_it():
    records = WireRecords(job(*MIXED))
    assert [records.count_before_waypoint(point) for point in range(4)] == [0, 3, 4, 6]
    assert (records.total, records.points) == (6, 3)


def test_a_job_without_records_has_one_motion_for_each_point():
    records = WireRecords(MotionJob(points=3, duration=3.0, reference=job(*MIXED).reference))
    assert [records.running_waypoints(k) for k in (1, 2, 3)] == [(0, -1), (1, 0), (2, 1)]
    assert [records.end_time(k) for k in range(4)] == [0.0, 1.0, 2.0, 3.0]


def test_an_output_belongs_to_the_motion_before_it(cell):
    made = cell.plan(
        [cell.pose(x=0.05), cell.pose(x=0.05, y=0.05)], [Segment(blend_radius=0.01), Segment()]
    )
    first, second = made.segments
    made = replace(made, segments=(replace(first, outputs=(VALVE,)), second))
    told = job_from_plan(made)
    assert told.points == 3
    assert told.is_motion.tolist() == [True, False, True]
    assert told.waypoint.tolist() == [0, 0, 1]
    assert told.end_times == pytest.approx(
        [first.duration, first.duration, first.duration + second.duration]
    )
    assert told.request_times[2] == told.end_times[2]
    assert told.request_times[0] == pytest.approx(0.8 * first.duration), (
        'its blend is a fifth of it'
    )


def test_a_goal_whose_first_point_is_where_the_arm_stands_is_followed(cell):
    """Nothing is sent for a point at time 0, so the first motion leads to point 1."""
    goal = Goal(
        waypoints=tuple(
            Waypoint(pose=pose, time=time)
            for pose, time in (
                (cell.home, 0.0),
                (cell.pose(x=0.05), 0.8),
                (cell.pose(x=0.05, y=0.05), 1.6),
            )
        )
    )
    made = plan(
        goal,
        RobotState(
            timestamp=0.0,
            actual_q=(0.3, -np.pi / 2, np.pi / 2, -np.pi / 2, -np.pi / 2, 0.0),
            actual_tcp_pose=cell.home,
            T_flange_tcp=cell.T_flange_tcp,
        ),
        cell.arm,
        PlanningOptions(max_tool_speed=1.0),
    )
    assert [segment.waypoint for segment in made.segments] == [1, 2]
    _, answers = cell.run(made)
    said = [command for commands in answers for command in commands]
    (end,) = [command.outcome for command in said if isinstance(command, Finish)]
    assert end.succeeded, end.text
    assert end.text.startswith('All 3 points were')
    progress = [command.progress for command in said if isinstance(command, ReportProgress)]
    assert [p.waypoint for p in progress] == sorted(p.waypoint for p in progress)
    assert {p.waypoint for p in progress} == {1, 2}
    assert {p.points_received for p in progress} == {3}
