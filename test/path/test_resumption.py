# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The resumed goal: its points, outputs and times, and goals that cannot be resumed.

``test/acceptance/test_resumed_goals.py`` shows that both parts together are the whole goal.
"""

from dataclasses import replace
from math import nan

import numpy as np
import pytest

from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.kinematics.robot_models import robot_model
from ur_cartesian_driver.motion.errors import InvalidGoal
from ur_cartesian_driver.motion.geometry.pose import Pose
from ur_cartesian_driver.motion.goal.execution_modes import ExecutionMode
from ur_cartesian_driver.motion.goal.goal import (
    ArcMode,
    FreeAxis,
    Goal,
    InputKind,
    InputWait,
    IOCommand,
    OutputKind,
    PartChange,
    PayloadChange,
    Posture,
    Press,
    ProportionalOutput,
    PulseTrain,
    ScriptCall,
    Segment,
    SegmentType,
    Waypoint,
)
from ur_cartesian_driver.path import Path, PathPlace, resume
from ur_cartesian_driver.planning import plan, PlanningOptions
from ur_cartesian_driver.planning.stop_prediction import state_at_rest
from ur_cartesian_driver.sim.simulator_config import HOME

LINEAR, JOINT, PROCESS = SegmentType.LINEAR, SegmentType.JOINT, SegmentType.PROCESS
FLAT = (0.0, 0.0, 0.0, 1.0)
#: Ten centimetres from point to point.
CORNERS = (0.0, 0.0, 0.0), (0.1, 0.0, 0.0), (0.1, 0.1, 0.0), (0.1, 0.1, 0.1)
PINNED = Posture(names=('elbow_joint',), values=(1.0,))
ARM = Arm(robot_model('ur5e'))
STATE = state_at_rest(ARM, HOME)
HERE = STATE.actual_tcp_pose


def goal(*segments, times=(), **fields):
    return Goal(
        waypoints=tuple(
            Waypoint(pose=Pose(place, FLAT), time=time)
            for place, time in zip(CORNERS, times or (0.0,) * 4, strict=True)
        ),
        segments=segments or (Segment(velocity=0.1),) * 4,
        **fields,
    )


def switch(waypoint, value, offset=0.0, pin=1, **place):
    return IOCommand(
        **place,
        waypoint=waypoint,
        offset=offset,
        output=OutputKind.STANDARD_DIGITAL,
        pin=pin,
        value=value,
    )


def places(left):
    return [tuple(np.round(point.pose.position, 9)) for point in left.goal.waypoints]


def at(point, fraction):
    return PathPlace(point=point, fraction=fraction)


def test_a_line_resumes_before_its_place_and_from_behind_the_path():
    left = resume(goal(), at(1, 0.5), overlap=0.01, approach=0.02)
    assert places(left) == [(0.04, 0.0, -0.02), (0.04, 0.0, 0.0), *CORNERS[1:]]
    assert [segment.type for segment in left.goal.segments[:2]] == [JOINT, LINEAR]
    assert left.begin == at(1, pytest.approx(0.4))
    straight = resume(goal(), at(1, 0.5), overlap=0.01, approach=0.0)
    assert places(straight) == [(0.04, 0.0, 0.0), *CORNERS[1:]]


def test_the_overlap_goes_round_corners_and_ends_at_joint_motions():
    assert resume(goal(), at(2, 0.05), overlap=0.01).begin == at(1, pytest.approx(0.95))
    joint = goal(Segment(), Segment(type=JOINT), Segment(), Segment())
    assert resume(joint, at(2, 0.05), overlap=0.01).begin == at(2, 0.0)
    assert resume(goal(), at(1, 0.05), overlap=0.01).begin == at(1, 0.0)
    # A joint motion is done again, and so is the way to the first point.
    assert places(resume(joint, at(1, 0.7))) == list(CORNERS[1:])
    assert places(resume(goal(), at(0, 0.7))) == list(CORNERS)


@pytest.mark.parametrize('stopped', [at(1, 0.9), at(2, 0.03), at(2, 0.21)])
def test_nothing_resumes_within_a_blend(stopped):
    blended = goal(*(Segment(type=PROCESS, blend_radius=0.02),) * 4)
    begin = resume(blended, stopped, overlap=0.005).begin
    assert begin.point == 1
    assert begin.fraction <= 0.8


def test_on_the_way_to_a_point_from_anywhere_it_is_reached_without_a_blend():
    corner, turn = Segment(velocity=0.1, blend_radius=0.02), Segment(type=JOINT, blend_radius=0.02)
    of = goal(corner, turn, corner, Segment())
    for place, radii in ((at(0, 0.9), [0.0, 0.02]), (at(1, 0.9), [0.0, 0.02])):
        assert [each.blend_radius for each in resume(of, place).goal.segments[:2]] == radii
    steady = replace(of, min_speed_fraction=0.5)
    assert resume(steady, at(0, 0.9)).goal.segments[0].blend_radius == 0.02


@pytest.mark.parametrize('mode', ArcMode)
def test_what_is_left_of_an_arc_is_of_the_same_circle(mode):
    via = Pose((0.1 - 0.1 * np.sqrt(0.5), 0.1 - 0.1 * np.sqrt(0.5), 0.0), FLAT)
    arc = goal(
        Segment(),
        Segment(),
        Segment(type=SegmentType.CIRCULAR, via=via, arc_mode=mode, via_posture=PINNED),
        Segment(),
    )
    arc = replace(
        arc,
        waypoints=(
            Waypoint(pose=Pose((0.0, 0.0, 0.0), FLAT)),
            Waypoint(pose=Pose((0.0, 0.1, 0.0), FLAT)),
            Waypoint(pose=Pose((0.1, 0.0, 0.0), FLAT)),
            Waypoint(pose=Pose((0.2, 0.0, 0.0), FLAT)),
        ),
    )
    left = resume(arc, at(2, 0.5), overlap=0.01).goal
    center = np.array([0.1, 0.1, 0.0])
    _, begin, end, _ = (np.array(point.pose.position) for point in left.waypoints)
    via_left = np.array(left.segments[2].via.position)
    for place in (begin, via_left, end):
        assert np.linalg.norm(place - center) == pytest.approx(0.1)
    # Half of a quarter less 1 cm lies behind it.
    assert np.linalg.norm(begin - end) == pytest.approx(
        0.2 * np.sin(0.5 * (np.pi / 4 + 0.1)), abs=1e-9
    )
    assert not left.segments[2].via_posture


def test_outputs_get_the_state_of_the_place_and_the_rest_of_the_commands():
    commands = (
        switch(0, 1.0),
        switch(1, 0.0),
        switch(0, 1.0, offset=0.3, pin=2),
        switch(0, 1.0, offset=0.7, pin=3),
        switch(2, 1.0),
        switch(3, 0.0, offset=0.2),
    )
    left = resume(goal(io_commands=commands), at(1, 0.5), overlap=0.0).goal
    assert sorted(left.io_commands, key=repr) == sorted(
        (
            switch(1, 1.0),
            switch(1, 1.0, pin=2),
            switch(2, 0.0),
            # 5 cm at 0.1 m/s were 0.5 s of the 0.7 s.
            switch(1, 1.0, offset=0.2, pin=3),
            switch(3, 1.0),
            switch(4, 0.0, offset=0.2),
        ),
        key=repr,
    )


@pytest.mark.parametrize('reverse', [False, True])
def test_an_output_gets_the_value_that_was_due_last(reverse):
    """The first command was due 0.3 s after the second one, which is 1 cm ahead."""
    commands = (switch(0, 0.0, offset=0.4), switch(0, 1.0, distance=0.01))
    left = resume(
        goal(io_commands=commands[::-1] if reverse else commands), at(1, 0.5), overlap=0.0
    ).goal
    assert left.io_commands == (switch(1, 0.0),)


def test_without_speeds_outputs_get_the_value_of_the_last_place():
    plain = goal(io_commands=(switch(1, 0.0), switch(0, 1.0, lead='valve_1')))
    plain = replace(plain, segments=tuple(replace(s, velocity=0.0) for s in plain.segments))
    assert resume(plain, at(2, 0.5), overlap=0.0).goal.io_commands == (switch(1, 0.0),)


def test_places_beside_points_stay_where_they_are_on_the_path():
    commands = (
        switch(0, 1.0, distance=0.03),
        switch(0, 1.0, distance=0.07, pin=2),
        switch(0, 1.0, fraction=0.8, pin=3),
        switch(1, 1.0, fraction=-0.1, pin=4, offset=-0.05),
        switch(1, 1.0, distance=-0.06, pin=5, offset=-0.05),
        switch(1, 1.0, distance=-0.02, pin=6),
        switch(2, 1.0, fraction=-0.5, pin=7),
    )
    left = resume(goal(io_commands=commands), at(1, 0.5), overlap=0.0).goal
    assert sorted(left.io_commands, key=repr) == sorted(
        (
            switch(1, 1.0),
            switch(1, 1.0, distance=0.02, pin=2),
            switch(1, 1.0, distance=0.03, pin=3),
            switch(2, 1.0, distance=-0.01, pin=4, offset=-0.05),
            switch(1, 1.0, pin=5),
            switch(2, 1.0, distance=-0.02, pin=6),
            switch(3, 1.0, fraction=-0.5, pin=7),
        ),
        key=repr,
    )


@pytest.mark.parametrize(
    ('waypoint', 'distance'),
    [(0, 0.03), (1, -0.07)],
)
def test_an_offset_counts_from_the_place_beside_a_point(waypoint, distance):
    """The arm was 2 cm behind the place, 0.2 s at 0.1 m/s."""
    commands = (switch(waypoint, 1.0, distance=distance, offset=0.3),)
    left = resume(goal(io_commands=commands), at(1, 0.5), overlap=0.0).goal
    assert left.io_commands == (switch(1, 1.0, offset=0.1),)


def test_a_named_lead_is_kept_ahead_and_dropped_where_the_arm_rests():
    commands = (switch(0, 1.0, lead='valve_1'), switch(2, 0.0, lead='valve_1'))
    left = resume(goal(io_commands=commands), at(1, 0.5), overlap=0.0).goal
    assert left.io_commands == (switch(1, 1.0), switch(3, 0.0, lead='valve_1'))


def test_a_place_before_the_first_point_is_ahead_of_a_goal_that_begins_anew():
    command = switch(0, 1.0, distance=-0.01)
    assert resume(goal(io_commands=(command,)), at(0, 0.5)).goal.io_commands == (command,)


def test_what_happens_at_points_happens_there_and_the_last_of_before_again():
    waits = tuple(
        InputWait(waypoint=k, input=InputKind.STANDARD_DIGITAL, pin=k, value=1.0, timeout=2.0)
        for k in (0, 1, 3)
    )
    changes = (PayloadChange(waypoint=0, mass=1.0), PayloadChange(waypoint=2, mass=2.0))
    calls = tuple(ScriptCall(waypoint=k, function=f'f{k}') for k in (1, 3))
    of = goal(input_waits=waits, payload_changes=changes, script_calls=calls)
    left = resume(of, at(2, 0.5)).goal
    assert [(each.waypoint, each.pin) for each in left.input_waits] == [(1, 1), (3, 3)]
    assert [(each.waypoint, each.mass) for each in left.payload_changes] == [(1, 1.0), (2, 2.0)]
    assert [(each.waypoint, each.function) for each in left.script_calls] == [(3, 'f3')]


@pytest.mark.parametrize('overlap', [0.0, 0.005])
@pytest.mark.parametrize(
    ('place', 'called_again'),
    [((0, 1.0), [0, 2]), ((1, 0.01), [2]), ((2, 0.999), [2]), ((2, 1.0), [2]), ((3, 0.01), [])],
)
@pytest.mark.parametrize('following', [LINEAR, JOINT])
def test_a_function_is_called_again_where_the_goal_was_stopped_at_its_point_and_nowhere_else(
    overlap, place, called_again, following
):
    calls = tuple(ScriptCall(waypoint=k, function=f'f{k}') for k in (0, 2))
    line = Segment(velocity=0.1)
    parts = tuple(PartChange(waypoint=k, body=f'f{k}') for k in (0, 2))
    of = goal(line, line, line, Segment(type=following), script_calls=calls, part_changes=parts)
    left = resume(of, at(*place), overlap=overlap).goal
    assert [call.function for call in left.script_calls] == [f'f{k}' for k in called_again]
    # The driver's cell has the changes at points that the arm has left.
    assert [part.body for part in left.part_changes] == [f'f{k}' for k in called_again]
    for call in left.script_calls:
        point = int(call.function[1:])
        assert left.waypoints[call.waypoint].pose == of.waypoints[point].pose


def test_an_amount_follows_the_speed_from_the_place_on():
    stretches = ((0, 1), (1, 3), (2, 3))
    amounts = tuple(
        ProportionalOutput(
            first_waypoint=first, last_waypoint=last, pin=k % 2, gain=1.0, begin_lead=0.1
        )
        for k, (first, last) in enumerate(stretches)
    )
    left = resume(goal(proportional_outputs=amounts), at(2, 0.5)).goal
    assert [
        (each.first_waypoint, each.last_waypoint, each.begin_lead)
        for each in left.proportional_outputs
    ] == [(1, 3, 0.0), (2, 3, 0.1)]


def test_the_pulses_behind_the_stop_are_left():
    def left(*trains, place=(2, 0.52), **changes):
        return [
            (each.first_waypoint, each.last_waypoint, round(each.phase, 9), each.count)
            for each in resume(
                goal(
                    pulses=tuple(
                        PulseTrain(
                            first_waypoint=first,
                            last_waypoint=last,
                            output=OutputKind.STANDARD_DIGITAL,
                            pin=1,
                            distance=0.01,
                            **changes,
                        )
                        for first, last in trains
                    )
                ),
                at(*place),
                overlap=0.03,
            ).goal.pulses
        ]

    # The path begins 22 mm behind point 1, the place of new point 1; the stop is 52 mm behind it.
    assert left((0, 1), (1, 3), (2, 3)) == [(1, 3, 0.038, 0), (2, 3, 0.0, 0)]
    assert left((0, 3), phase=0.004) == [(1, 3, 0.032, 0)]
    assert left((1, 3), count=8) == [(1, 3, 0.038, 2)]
    assert left((1, 3), count=6) == []
    assert left((1, 2), phase=0.055) == [(1, 2, 0.033, 0)]
    assert left((1, 2), phase=0.042, place=(2, 0.995)) == []


def test_the_tool_presses_from_the_place_on():
    presses = tuple(
        Press(
            first_waypoint=first, last_waypoint=last, axes=('z',), forces=(20.0,), zero_sensor=True
        )
        for first, last in ((0, 1), (1, 3))
    )
    left = resume(goal(presses=presses), at(2, 0.5)).goal
    # Where the tool may touch, the sensor is not zeroed.
    begun = replace(presses[1], first_waypoint=1, last_waypoint=3, zero_sensor=False)
    assert left.presses == (begun,)


def test_a_free_axis_is_free_at_the_place_too():
    free = Segment(free_axis=FreeAxis.Z, free_min=-0.5, free_max=0.5)
    left = resume(goal(*(free,) * 4), at(2, 0.5)).goal
    assert {segment.free_axis for segment in left.segments} == {FreeAxis.Z}


def test_times_of_the_rest_stay_and_the_approach_has_some():
    times = (1.0, 3.0, 5.0, 7.0)
    left = resume(goal(*(Segment(),) * 4, times=times), at(2, 0.75), overlap=0.0).goal
    steps = np.diff([point.time for point in left.waypoints], prepend=0.0)
    # A quarter of the way from rest to rest takes half of the time with the same acceleration.
    assert steps[2:] == pytest.approx([1.0, 2.0])
    assert (steps[:2] > 0.0).all()


def test_a_spline_has_its_curve_and_gathers_speed_on_it():
    spline = replace(
        goal(*(Segment(),) * 4, times=(1.0, 2.0, 3.0, 4.0)), execution=ExecutionMode.SPLINE
    )
    twists = (0.1, 0.0, 0.0), (0.05, 0.05, 0.0), (0.0, 0.05, 0.05), (0.0, 0.0, 0.0)
    spline = replace(
        spline,
        segments=(),
        waypoints=tuple(
            replace(point, twist=(*twist, 0.0, 0.0, 0.0))
            for point, twist in zip(spline.waypoints, twists, strict=True)
        ),
    )
    left = resume(spline, at(2, 0.5), overlap=0.01)
    points = left.goal.waypoints
    assert points[1].twist == (0.0,) * 6
    speeds = [np.linalg.norm(point.twist[:3]) for point in points[1:10]]
    assert speeds == sorted(speeds)
    for mine, its in zip(points[-2:], spline.waypoints[-2:], strict=True):
        assert mine.pose.position == pytest.approx(its.pose.position)
    assert points[-2].twist == pytest.approx(spline.waypoints[-2].twist)
    assert points[-1].time - points[-2].time == pytest.approx(1.0)
    with pytest.raises(InvalidGoal, match=r'segments\[2\]\.dwell is in a spline'):
        resume(
            replace(spline, segments=(*(Segment(),) * 2, Segment(dwell=0.1), Segment())),
            at(2, 0.5),
        )


def test_a_place_on_the_rest_is_a_place_on_the_whole():
    left = resume(goal(), at(1, 0.5), overlap=0.01)
    assert left.original(at(0, 0.3)) == left.begin
    assert left.original(at(1, 0.3)) == left.begin
    assert left.original(at(2, 0.5)) == at(1, pytest.approx(0.7))
    assert left.original(at(3, 0.25)) == at(2, pytest.approx(0.25))
    assert left.original(at(4, 1.0)) == at(3, 1.0)


@pytest.mark.parametrize(
    ('of', 'place', 'numbers', 'text'),
    [
        (goal(keep_open=True), at(1, 0.5), {}, 'keep_open is true, so the goal does not hold'),
        (
            goal(frame_id='left_tool0'),
            at(1, 0.5),
            {},
            'is left_tool0, which has moved with the arm',
        ),
        (goal(), at(4, 0.5), {}, 'stopped_point, stopped_fraction are 4 and 0.5'),
        (goal(), at(1, nan), {}, 'are 1 and nan'),
        (goal(), at(1, 0.5), {'overlap': -0.1}, 'overlap is -0.1 m, but must be from 0 to 1 m'),
        (goal(), at(1, 0.5), {'approach': 5.0}, 'approach is 5 m, but must be from 0 to 1 m'),
        (
            goal(*(Segment(),) * 4, io_commands=(switch(0, 1.0, offset=2.0),)),
            at(1, 0.5),
            {},
            'offset is 2 s after .*, but when the arm was there is not known',
        ),
    ],
)
def test_what_cannot_be_resumed_is_refused_with_a_sentence(of, place, numbers, text):
    with pytest.raises(InvalidGoal, match=text):
        resume(of, place, **numbers)


@pytest.mark.parametrize('approach', [0.02, 0.0])
@pytest.mark.parametrize('own', [False, True], ids=['of the goal', 'of a point'])
def test_a_rounded_path_resumes_by_lines(own, approach):
    path = Path(HERE).at(speed=0.1, acceleration=0.5).by(dy=0.05)
    path = path.by(dx=0.05, corner_deviation=2e-4 if own else 0.0).by(dy=-0.05)
    path = path if own else path.rounded(2e-4)
    for place in (at(1, 0.5), at(2, 0.5)):
        goal = path.resumed(place, overlap=0.01, approach=approach).goal()
        assert {segment.type for segment in goal.segments} == {LINEAR}
        assert plan(goal, STATE, ARM, PlanningOptions()).report[0].startswith('point 0: rounded')


def test_a_path_resumes_as_a_path():
    path = Path((0.0, 0.0, 0.5), FLAT).at(speed=0.1).by(dx=0.1).by(dy=0.1)
    left = path.resumed(at(1, 0.5), overlap=0.01, approach=0.02)
    assert [pose.position for pose in left.poses][1] == pytest.approx((0.1, 0.04, 0.5))
