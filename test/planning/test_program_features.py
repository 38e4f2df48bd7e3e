# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Plans for robot programs of other ages: other words for the same motion, or a refusal."""

from itertools import pairwise

import pytest

from ur_cartesian_driver.driver import DriverConfig
from ur_cartesian_driver.execution.goal.motion_job import job_from_plan
from ur_cartesian_driver.kinematics.inverse import nearest
from ur_cartesian_driver.kinematics.robot_models import JOINT_NAMES
from ur_cartesian_driver.motion.errors import NotAvailable
from ur_cartesian_driver.motion.geometry.pose import Pose
from ur_cartesian_driver.motion.goal.execution_modes import ExecutionMode
from ur_cartesian_driver.motion.goal.goal import (
    FeedOverride,
    Goal,
    IOCommand,
    OutputKind,
    PathOffset,
    Posture,
    ProportionalOutput,
    PulseTrain,
    SafeOutput,
    Segment,
    SegmentType,
    Waypoint,
)
from ur_cartesian_driver.motion.plan.primitive import MoveC, MoveJ, MoveL, OptimoveJ, OptimoveL
from ur_cartesian_driver.planning import plan, PlanningOptions
from ur_cartesian_driver.planning.request.program_features import FEATURES
from ur_cartesian_driver.planning.request.validate import check
from ur_cartesian_driver.protocol.program.trajectory_points import encode_plan, encode_points
from ur_cartesian_driver.protocol.program.wire_dialects import DIALECTS

OLD = ('2.0', '2.10')


def planned(cell, name, *points, **options):
    """Return the plan of (pose, segment, time, posture from the solution?) in a dialect."""
    waypoints = []
    for pose, _, time, has_posture in points:
        q = nearest(cell.arm, pose @ cell.T_flange_tcp.inverse(), cell.state.actual_q)
        waypoints.append(
            Waypoint(
                pose=pose,
                time=time,
                posture=Posture(names=JOINT_NAMES, values=q) if has_posture else Posture(),
            )
        )
    goal = Goal(waypoints=tuple(waypoints), segments=tuple(p[1] for p in points))
    made = plan(goal, cell.state, cell.arm, PlanningOptions(dialect=DIALECTS[name], **options))
    # Whatever was planned can be said.
    encode_points((s.primitive for s in made.segments), DIALECTS[name])
    return made


JOINT = Segment(type=SegmentType.JOINT)
#: A demand for each feature, and the refusal by an older program, in the order of the table.
DEMANDS = (
    (
        {'keep_open': True},
        'keep_open is set, but a robot program of wire dialect 2.0 needs the number of points at '
        'the start; send all points at once, or use a robot program of wire dialect 2.14.',
    ),
    (
        {
            'io_commands': (
                IOCommand(
                    waypoint=0, offset=0.0, output=OutputKind.STANDARD_DIGITAL, pin=0, value=1.0
                ),
            )
        },
        'io_commands is not empty, but robot programs of wire dialect 2.0 cannot switch outputs '
        'during a motion; leave it empty, or let the driver send its own robot program.',
    ),
    (
        {
            'proportional_outputs': (
                ProportionalOutput(first_waypoint=0, last_waypoint=1, pin=0, gain=1.0),
            )
        },
        'proportional_outputs is not empty, but robot programs of wire dialect 2.0 have none; '
        'leave it empty, or let the driver send its own robot program.',
    ),
    (
        {
            'pulses': (
                PulseTrain(
                    first_waypoint=0,
                    last_waypoint=1,
                    output=OutputKind.TOOL_DIGITAL,
                    pin=0,
                    distance=0.01,
                ),
            )
        },
        'pulses is not empty, but robot programs of wire dialect 2.0 give none; leave it empty, '
        'or let the driver send its own robot program.',
    ),
    (
        {'safe_outputs': (SafeOutput(output=OutputKind.STANDARD_DIGITAL, pin=0, value=1.0),)},
        'safe_outputs is not empty, but robot programs of wire dialect 2.0 do not know it; leave '
        'it empty (the parameter too), or let the driver send its own robot program.',
    ),
    (
        {'execution': ExecutionMode.SERVO},
        'execution is SERVO, which robot programs of wire dialect 2.0 do not support; set '
        'execution to PRIMITIVES.',
    ),
    (
        {'execution': ExecutionMode.SPLINE},
        'execution is SPLINE, but robot programs of wire dialect 2.0 count in milliseconds, too '
        'coarse for splines; set execution to PRIMITIVES.',
    ),
    (
        {'segments': (Segment(dwell=0.5), Segment())},
        'segments[0].dwell is set, but robot programs of wire dialect 2.0 do nothing at points of '
        'PRIMITIVES; split the goal there, or let the driver send its own robot program.',
    ),
    (
        {'path_offset': PathOffset(limits=(0.0, 0.005, 0.0))},
        'path_offset is set, but robot programs of wire dialect 2.0 add no offsets to their '
        'motions; let the driver send its own robot program.',
    ),
    (
        {'feed_override': FeedOverride(minimum=0.3), 'execution': ExecutionMode.SPLINE},
        'feed_override is set, but robot programs of wire dialect 2.10 take no feed while they '
        'move the arm; let the driver send its own robot program.',
    ),
)


@pytest.mark.parametrize(('demand', 'sentence'), DEMANDS, ids=[next(iter(d)) for d, _ in DEMANDS])
def test_each_feature_that_an_older_program_lacks_is_refused(demand, sentence):
    points = tuple(Waypoint(pose=Pose((0.1 * i, 0.0, 0.0)), time=float(i)) for i in (1, 2))
    goal = Goal(waypoints=points, **demand)
    check(goal, PlanningOptions())
    dialect = '2.10' if 'dialect 2.10' in sentence else '2.0'
    with pytest.raises(NotAvailable) as refusal:
        check(goal, PlanningOptions(dialect=DIALECTS[dialect]))
    assert str(refusal.value) == sentence


def test_the_demands_are_those_of_the_table():
    assert len(DEMANDS) == len(FEATURES)
    with pytest.raises(NotAvailable, match='safe_outputs is not empty'):
        check(
            Goal(waypoints=(Waypoint(pose=Pose()),)),
            PlanningOptions(dialect=DIALECTS['2.12'], safe_outputs=('standard_digital 0 1',)),
        )


@pytest.mark.parametrize('name', DIALECTS)
def test_a_joint_move_arrives_in_the_same_solution(cell, name):
    made = planned(cell, name, (cell.pose(y=0.05), JOINT, 0.0, True))
    (segment,) = made.segments
    assert isinstance(segment.primitive, MoveJ)
    if name in OLD:
        assert segment.primitive.target == segment.joints
        assert segment.primitive.q_near is None
        assert '-> MOVEJ because ' in segment.report_line
        assert f'wire dialect {name} has no q_near' in segment.report_line
    else:
        assert segment.primitive.target == cell.pose(y=0.05)
        assert segment.primitive.q_near == pytest.approx(segment.joints)
        assert '-> MOVEJ_POSE, ' in segment.report_line


@pytest.mark.parametrize('name', OLD)
def test_without_calibration_a_joint_move_is_refused_and_a_line_is_not(cell, name):
    planned(cell, name, (cell.pose(y=0.05), Segment(), 0.0, False), calibration_known=False)
    with pytest.raises(NotAvailable, match=f'wire dialect {name} .*calibration'):
        planned(cell, name, (cell.pose(y=0.05), JOINT, 0.0, False), calibration_known=False)


@pytest.mark.parametrize('name', OLD)
def test_lines_and_arcs_go_as_poses_and_without_hint(cell, name):
    made = planned(
        cell,
        name,
        (cell.pose(y=0.05), Segment(), 0.0, True),
        (
            cell.pose(x=0.05, y=0.1),
            Segment(type=SegmentType.CIRCULAR, via=cell.pose(x=0.015, y=0.085)),
            0.0,
            True,
        ),
    )
    line, arc = (s.primitive for s in made.segments)
    assert isinstance(line, MoveL)
    assert line.q_near is None
    assert isinstance(arc, MoveC)
    assert isinstance(arc.target, Pose)
    assert any(f'wire dialect {name} has no arcs with joint positions' in r for r in made.remarks)


@pytest.mark.parametrize(
    ('name', 'kind', 'primitive'),
    [
        ('2.0', SegmentType.OPTIMIZED_JOINT, None),
        ('2.0', SegmentType.OPTIMIZED_LINEAR, None),
        ('2.10', SegmentType.OPTIMIZED_JOINT, OptimoveJ),
        ('2.10', SegmentType.OPTIMIZED_LINEAR, OptimoveL),
    ],
)
def test_optimized_moves_came_after_2_0(cell, name, kind, primitive):
    points = (cell.pose(y=0.05), Segment(type=kind), 0.0, True)
    if primitive is None:
        with pytest.raises(NotAvailable, match=r'segments\[0\].type .* wire dialect 2.0 .*LINEAR'):
            planned(cell, name, points)
    else:
        (segment,) = planned(cell, name, points).segments
        assert isinstance(segment.primitive, primitive)


def test_times_are_kept_by_speeds_where_programs_count_in_milliseconds(cell):
    points = [
        (cell.pose(y=0.05), Segment(), 0.7504, False),
        (cell.pose(y=0.05, z=0.05), JOINT, 1.9, False),
        (cell.pose(z=0.05, turn=(0.0, 0.0, 0.6)), Segment(), 3.7, False),
    ]
    made = planned(cell, '2.0', *points)
    assert [s.primitive.duration for s in made.segments] == [0.0] * 3
    times = [0.0, *(p[2] for p in points)]
    for segment, (before, after) in zip(made.segments, pairwise(times), strict=True):
        assert segment.duration == pytest.approx(after - before, rel=1e-6)
    assert any('sent with speeds instead of times' in remark for remark in made.remarks)
    for name in ('2.10', '2.12', '2.14'):
        newer = planned(cell, name, *points)
        assert newer.segments[0].primitive.duration == pytest.approx(0.7504)


def test_no_time_is_sent_to_such_a_program_for_a_line_that_mostly_turns(cell):
    points = (cell.pose(y=0.01, turn=(0.0, 0.0, 0.8)), Segment(), 0.0, False)
    old, new = planned(cell, '2.0', points), planned(cell, '2.14', points)
    assert new.segments[0].primitive.duration > 0.0
    assert old.segments[0].primitive.duration == 0.0
    assert old.duration == pytest.approx(new.duration)


def test_blends_are_planned_as_the_wire_carries_them(cell):
    points = [
        (cell.pose(y=0.05), Segment(blend_radius=0.0056), 0.0, False),
        (cell.pose(y=0.05, x=0.05), Segment(blend_radius=0.0004), 0.0, False),
        (cell.pose(y=0.1, x=0.05), Segment(), 0.0, False),
    ]
    made = planned(cell, '2.0', *points)
    assert [s.primitive.blend_radius for s in made.segments] == [0.005, 0.0, 0.0]
    assert [r for r in made.remarks if 'blend of 5 mm instead of 5.6 mm' in r]
    newer = planned(cell, '2.10', *points)
    assert [s.primitive.blend_radius for s in newer.segments] == [0.0056, 0.0004, 0.0]


def test_only_the_newest_is_told_to_set_a_tcp():
    allowed = {
        name: PlanningOptions().for_program(DriverConfig(wire_dialect=name)) for name in DIALECTS
    }
    assert [name for name in DIALECTS if allowed[name].allow_tcp_change] == ['2.14']
    assert [options.dialect.name for options in allowed.values()] == list(DIALECTS)
    refused = PlanningOptions(allow_tcp_change=False).for_program(DriverConfig())
    assert not refused.allow_tcp_change


def test_a_plan_is_encoded_for_the_program_for_which_it_was_made(cell):
    for name in DIALECTS:
        made = planned(cell, name, (cell.pose(y=0.05), JOINT, 0.0, True))
        assert encode_plan(made) == encode_points(made.instructions, DIALECTS[name])
        assert job_from_plan(made).reports_points_begun == (name == '2.14')
