# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Outputs on the way: the motion before each, its place on the path, and refusals."""

from dataclasses import replace
from math import hypot, inf, nan

import numpy as np
import pytest

from ur_cartesian_driver.motion.errors import InvalidGoal, NotAvailable
from ur_cartesian_driver.motion.geometry.pose import Pose
from ur_cartesian_driver.motion.goal.execution_modes import ExecutionMode
from ur_cartesian_driver.motion.goal.goal import (
    Goal,
    IOCommand,
    OutputKind,
    ProportionalOutput,
    PulseTrain,
    Segment,
    SegmentType,
)
from ur_cartesian_driver.motion.plan.plan import ReferencePath
from ur_cartesian_driver.motion.plan.primitive import SwitchOutput
from ur_cartesian_driver.planning import plan, PlanningOptions
from ur_cartesian_driver.planning.request.point_events.path_clock import PathClock
from ur_cartesian_driver.protocol.program.trajectory_points import (
    encode_points,
    MAX_PENDING_OUTPUTS,
)
from ur_cartesian_driver.protocol.program.wire_dialects import DIALECTS

OPTIONS = PlanningOptions(max_tool_speed=1.0)
#: Three sides of a square.
CORNERS = ((0.05, 0.0), (0.05, 0.05), (0.0, 0.05))


def command(waypoint=0, offset=0.0, output=OutputKind.STANDARD_DIGITAL, pin=0, value=1.0, **rest):
    return IOCommand(waypoint=waypoint, offset=offset, output=output, pin=pin, value=value, **rest)


def square(cell, *commands, radius=0.01, kind=SegmentType.LINEAR, **changes):
    segments = tuple(
        Segment(type=kind, velocity=0.1, acceleration=1.0, blend_radius=r)
        for r in (radius, radius, 0.0)
    )
    return Goal(
        waypoints=tuple(cell.point(x, y) for x, y in CORNERS),
        segments=segments,
        io_commands=commands,
        **changes,
    )


def planned(cell, goal, options=OPTIONS):
    return plan(goal, cell.state, cell.arm, options)


def records(made):
    """The outputs, each with the waypoint of the motion that it stands behind."""
    return [(segment.waypoint, record) for segment in made.segments for record in segment.outputs]


def base_direction(record):
    """The heading in the axes of base."""
    turned = Pose((0.0, 0.0, 0.0), record.trigger_pose.quaternion)
    return np.array(turned.apply(record.trigger_direction[:3]))


def test_in_a_corner_the_place_is_that_of_the_path_nearest_to_the_point(cell):
    made = planned(cell, square(cell, command(0)))
    ((waypoint, record),) = records(made)
    assert waypoint == 0
    corner = np.array(cell.pose(*CORNERS[0]).position)
    place = np.array(record.trigger_pose.position)
    path = made.reference.poses[:, :3]
    assert np.linalg.norm(place - corner) <= np.linalg.norm(path - corner, axis=1).min() + 1e-9
    assert 0.001 < np.linalg.norm(place - corner) < 0.01
    assert base_direction(record) == pytest.approx([0.5**0.5, 0.5**0.5, 0.0], abs=1e-6)
    assert not record.starts_beyond
    assert record.delay == 0.0


def test_at_a_stop_it_is_switched_at_once(cell):
    made = planned(cell, square(cell, command(0), command(2), radius=0.0))
    assert records(made) == [
        (waypoint, SwitchOutput(output=OutputKind.STANDARD_DIGITAL, pin=0, value=1.0))
        for waypoint in (0, 2)
    ]


def test_a_time_after_a_point_is_a_place_on_the_way_behind_it(cell):
    """At 0.1 m/s: 0.2 s after the middle of the first corner, on the second side."""
    made = planned(cell, square(cell, command(0, offset=0.2)))
    ((waypoint, record),) = records(made)
    assert waypoint == 0
    x, y, _ = np.array(record.trigger_pose.position) - np.array(cell.home.position)
    assert x == pytest.approx(0.05, abs=1e-6)
    assert y == pytest.approx(0.02, abs=0.002)
    assert base_direction(record) == pytest.approx([0.0, 1.0, 0.0], abs=1e-6)


def test_a_time_in_a_later_corner_stands_behind_the_motion_that_returns_there(cell):
    made = planned(cell, square(cell, command(0, offset=0.47)))
    ((waypoint, record),) = records(made)
    assert waypoint == 1
    apart = [
        a - b
        for a, b in zip(record.trigger_pose.position, cell.pose(*CORNERS[1]).position, strict=True)
    ]
    assert hypot(*apart) < 0.01


def test_what_lies_behind_the_end_is_a_delay(cell):
    made = planned(cell, square(cell, command(2, offset=0.3), command(1, offset=1.0)))
    found = records(made)
    assert [waypoint for waypoint, _ in found] == [2, 2]
    left = made.segments[-1].duration
    assert [record.delay for _, record in found] == pytest.approx([0.3, 1.0 - left])
    assert [record.trigger_pose for _, record in found] == [None, None]


def test_outputs_stand_in_the_order_of_their_times_and_else_as_they_were_given(cell):
    made = planned(
        cell,
        square(
            cell,
            command(1, pin=4),
            command(0, pin=1),
            command(0, offset=0.1, pin=3),
            command(0, pin=2),
        ),
    )
    assert [(waypoint, record.pin) for waypoint, record in records(made)] == [
        (0, 1),
        (0, 2),
        (0, 3),
        (1, 4),
    ]


def test_the_wire_carries_them_behind_their_motions(cell):
    made = planned(cell, square(cell, command(0), command(2)))
    kinds = [isinstance(record, SwitchOutput) for record in made.instructions]
    assert kinds == [False, True, False, False, True]
    assert len(encode_points(made.instructions)) == 5 * 84


def test_the_report_tells_them_with_their_points(cell):
    made = planned(
        cell,
        square(
            cell,
            command(0),
            command(1, offset=0.1, value=0.0),
            command(2, offset=0.2, output=OutputKind.STANDARD_ANALOG, value=0.25),
        ),
    )
    first, second, third, *_ = made.report
    assert first.endswith('; switches standard digital output 0 on in the middle of its blend')
    assert second.endswith('; switches standard digital output 0 off 0.100 s after it')
    assert third.endswith(
        '; switches standard analog output 0 to 0.25 (current) 0.200 s after the end'
    )


def test_an_arc_that_begins_beyond_the_plane_of_a_place_comes_round_to_it(cell):
    """Three quarters of a circle; the place is after two thirds of it."""
    r = 0.05
    goal = Goal(
        waypoints=(cell.point(x=-0.02), cell.point(), cell.point(x=r, y=-r)),
        segments=(
            Segment(velocity=0.1),
            Segment(velocity=0.1),
            Segment(type=SegmentType.CIRCULAR, velocity=0.1, via=cell.pose(x=2 * r)),
        ),
        io_commands=(command(1, offset=0.8), command(1, offset=1.8)),
    )
    early, late = (record for _, record in records(planned(cell, goal)))
    assert not early.starts_beyond
    assert late.starts_beyond


def test_a_turn_in_place_has_a_heading_about_its_axis(cell):
    goal = Goal(
        waypoints=(cell.point(x=0.02), cell.point(x=0.02, turn=(0.0, 0.0, 1.0))),
        segments=(Segment(velocity=0.1), Segment(velocity=0.5)),
        io_commands=(command(0, offset=1.0),),
    )
    ((waypoint, record),) = records(planned(cell, goal))
    assert waypoint == 0
    assert record.trigger_direction == pytest.approx((0.0, 0.0, 0.0, 0.0, 0.0, 1.0), abs=1e-6)


@pytest.mark.parametrize('offset', [0.0, 0.25])
def test_along_a_spline_the_place_is_where_the_tool_is_at_that_time(cell, offset):
    twist = (0.04, 0.0, 0.0, 0.0, 0.0, 0.0)
    goal = Goal(
        waypoints=(
            cell.point(x=0.02, time=1.0, twist=twist),
            cell.point(x=0.06, y=0.01, time=2.0, twist=twist),
            cell.point(x=0.1, time=3.5),
        ),
        execution=ExecutionMode.SPLINE,
        io_commands=(command(1, offset=offset),),
    )
    made = planned(cell, goal)
    ((_, record),) = records(made)
    before = sum(
        segment.duration
        for segment in made.segments[
            : next(k + 1 for k, segment in enumerate(made.segments) if segment.outputs)
        ]
    )
    assert before <= 2.0 + offset + 1e-6
    times, poses = made.reference.time, made.reference.poses
    there = [np.interp(2.0 + offset, times, poses[:, axis]) for axis in range(3)]
    assert record.trigger_pose.position == pytest.approx(there, abs=2e-5)
    assert base_direction(record)[0] > 0.8


def test_where_a_spline_stops_it_is_switched_at_once(cell):
    twist = (0.04, 0.0, 0.0, 0.0, 0.0, 0.0)
    goal = Goal(
        waypoints=(
            cell.point(x=0.02, time=1.0, twist=twist),
            cell.point(x=0.06, time=2.0),
            cell.point(x=0.1, time=3.5),
        ),
        execution=ExecutionMode.SPLINE,
        io_commands=(command(1),),
    )
    ((_, record),) = records(planned(cell, goal))
    assert record.trigger_pose is None


REFUSED = [
    (command(3), r'^io_commands\[0\]\.point_index is 3, but the points are 0 to 2; '),
    (command(-1), r'\.point_index is -1'),
    (command(pin=8), r'\.pin is 8, but there are standard digital outputs 0 to 7; '),
    (command(pin=-1), r'\.pin is -1'),
    (command(output=OutputKind.TOOL_DIGITAL, pin=2), r'\.pin is 2, but there are tool digital'),
    (command(output=OutputKind.STANDARD_ANALOG, pin=2), r'\.pin is 2'),
    (command(value=0.5), r'\.value is 0\.5; a standard digital output takes 0 \(off\) or 1'),
    (command(value=nan), r'\.value is nan'),
    (command(output=OutputKind.STANDARD_ANALOG, value=1.01), r'\.value is 1\.01; .*fraction'),
    (command(output=OutputKind.STANDARD_ANALOG, value=-inf), r'\.value is -inf'),
    (command(offset=-1.001), r'\.offset is -1\.001 s, outside -1 to 60 s; '),
    (command(offset=nan), r'\.offset is nan'),
    (command(offset=60.1), r'\.offset is 60\.1 s'),
]


@pytest.mark.parametrize(('wrong', 'text'), REFUSED)
def test_what_makes_no_sense_is_refused_with_its_field(cell, wrong, text):
    with pytest.raises(InvalidGoal, match=text):
        planned(cell, square(cell, wrong))


def test_older_robot_programs_switch_nothing(cell):
    options = replace(OPTIONS, dialect=DIALECTS['2.12'])
    with pytest.raises(NotAvailable, match='io_commands is not empty, but robot programs'):
        planned(cell, square(cell, command()), options)


def test_too_many_between_two_motions_are_refused(cell):
    many = [command(0, value=float(k % 2)) for k in range(MAX_PENDING_OUTPUTS)]
    assert len(records(planned(cell, square(cell, *many)))) == MAX_PENDING_OUTPUTS
    with pytest.raises(
        InvalidGoal, match='more than 64 outputs between two motions, after point 0'
    ):
        planned(cell, square(cell, *many, command(0)))


def test_a_point_where_the_robot_stands_switches_nothing(cell):
    goal = Goal(waypoints=(cell.point(), cell.point(x=0.02, time=1.0)), io_commands=(command(0),))
    with pytest.raises(InvalidGoal, match=r'io_commands\[0\]\.point_index is 0, but no motion'):
        planned(cell, goal)


FLOW = ProportionalOutput(first_waypoint=1, last_waypoint=2, pin=1, gain=2.0)
PHOTOS = PulseTrain(
    first_waypoint=1,
    last_waypoint=2,
    output=OutputKind.STANDARD_DIGITAL,
    pin=4,
    distance=0.005,
    width=0.004,
)
FLOWING, GIVING = (
    f'{name} from point 1 to point 2; use another output, or move the place.'
    for name in (
        'standard analog output 1 follows the speed',
        'standard digital output 4 gives pulses',
    )
)
#: A square with a fourth side.
WAYS = (*CORNERS, (0.0, 0.0))


def with_stretch(cell, stretch, *commands):
    analog = isinstance(stretch, ProportionalOutput)
    output = OutputKind.STANDARD_ANALOG if analog else OutputKind.STANDARD_DIGITAL
    goal = square(cell, *(replace(each, output=output, pin=stretch.pin) for each in commands))
    segment = replace(goal.segments[0], blend_radius=0.0)
    return replace(
        goal,
        waypoints=tuple(cell.point(x, y) for x, y in WAYS),
        segments=(segment,) * len(WAYS),
        **{'proportional_outputs' if analog else 'pulses': (stretch,)},
    )


@pytest.mark.parametrize(('stretch', 'text'), [(FLOW, FLOWING), (PHOTOS, GIVING)])
@pytest.mark.parametrize(
    'inside',
    [
        command(0, distance=0.06),
        command(0, offset=0.9),
        command(3, fraction=-0.999, offset=-0.2),
        command(2, distance=-0.001),
        command(3, distance=-0.06),
    ],
)
def test_a_command_within_a_stretch_of_its_output_is_refused_by_its_place(
    cell, stretch, text, inside
):
    with pytest.raises(InvalidGoal) as refusal:
        planned(cell, with_stretch(cell, stretch, command(0), inside))
    assert str(refusal.value) == (f'io_commands[1].pin is {stretch.pin}, but at its place {text}')


@pytest.mark.parametrize('stretch', [FLOW, PHOTOS])
def test_commands_beside_a_stretch_are_placed_whatever_their_points(cell, stretch):
    beside = (
        command(0, offset=0.1),
        command(1),
        command(1, distance=-0.02),
        command(1, distance=-0.02, offset=-0.1),
        command(1, distance=0.06),
        command(2, offset=0.1),
    )
    made = planned(cell, with_stretch(cell, stretch, *beside))
    plain = [
        record
        for _, record in records(made)
        if isinstance(record, SwitchOutput) and not (record.follows_speed or record.begins_pulses)
    ]
    assert len(plain) == len(beside) + isinstance(stretch, ProportionalOutput)


def test_an_output_holds_the_value_of_a_command_where_it_follows_the_speed_no_more(cell):
    made = planned(cell, with_stretch(cell, FLOW, command(2, value=0.3)))
    _, *switches = (record for _, record in records(made))
    assert [record.value for record in switches] == [1.0, FLOW.idle, 0.3]


def test_a_lead_that_reaches_into_another_stretch_of_the_output_is_refused(cell):
    later = replace(FLOW, first_waypoint=2, last_waypoint=3, begin_lead=0.1)
    goal = with_stretch(cell, FLOW)
    with pytest.raises(
        InvalidGoal,
        match=r'proportional_outputs.0..pin is 1, but at its end .* from point 2 to point 3;',
    ):
        planned(cell, replace(goal, proportional_outputs=(FLOW, later)))
    planned(cell, replace(goal, proportional_outputs=(replace(later, begin_lead=0.0), FLOW)))


def test_a_spline_that_begins_in_motion_has_the_speeds_of_its_law():
    """Its samples are 60 ms apart, as those of slow splines are; the law is a sine."""
    times = np.linspace(0.0, 1.2, 21)
    poses = np.zeros((21, 7))
    poses[:, 0], poses[:, 6] = 0.001 * times + 0.0001 * np.sin(4.0 * times), 1.0
    reference = ReferencePath(poses=poses, point=np.zeros(21, dtype=np.int32), time=times)
    way, speeds, turns = PathClock(reference, is_spline=True).motion_back(1.0, 0.6, 12)
    assert way == pytest.approx(0.0006 + 0.0001 * (np.sin(4.0) - np.sin(1.6)), rel=1e-3)
    law = 0.001 + 0.0004 * np.cos(4.0 * np.linspace(1.0, 0.4, 13))
    assert speeds == pytest.approx(law, rel=0.02)
    assert not turns
