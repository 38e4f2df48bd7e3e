# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""A path says what a goal has, and a mistake is a sentence at the line that makes it."""

from math import nan, pi
import re
import subprocess
import sys
from typing import Any

import numpy as np
import pytest
from tracked_files import tracked_files

from ur_cartesian_driver.goal_files import GoalFileError
from ur_cartesian_driver.motion.errors import InvalidGoal
from ur_cartesian_driver.motion.geometry.pose import rotate
from ur_cartesian_driver.motion.geometry.vectors import ZERO6
from ur_cartesian_driver.motion.goal.goal import (
    ArcMode,
    ContactEnd,
    Goal,
    OutputKind,
    PartAction,
    PartChange,
    Press,
    PulseTrain,
    SafeOutput,
    ScriptCall,
    Segment,
    SegmentType,
    Waypoint,
)
from ur_cartesian_driver.path import (
    against,
    analog,
    AnalogDomain,
    axis_angle,
    deg,
    digital,
    digital_input,
    DOWN,
    ExecutionMode,
    Frames,
    mm,
    Path,
    Pose,
    roll_pitch_yaw,
    StaticFrame,
    tilted,
    Tolerance,
    tool_digital,
    X,
    Y,
    Z,
)
from ur_cartesian_driver.resources import share_path

HERE = Pose((-0.5, -0.1, 0.5), DOWN)
START = Path(HERE)
TORCH = digital(2)
#: A text where a number is meant, and a pose where a name is.
TEXT: Any = 'abc'
POSE: Any = HERE
TWO: Any = (-550, -280)


def positions(path):
    return [pose.position for pose in path.poses]


def test_a_square_in_five_lines():
    path = START.at(speed=0.1, acceleration=0.5, blend=mm(10))
    path = path.by(dy=0.2).by(dx=0.2).by(dy=-0.2).by(dx=-0.2)
    goal = path._table()
    assert np.array(positions(path)) == pytest.approx(
        np.array([(-0.5, 0.1, 0.5), (-0.3, 0.1, 0.5), (-0.3, -0.1, 0.5), (-0.5, -0.1, 0.5)])
    )
    for segment in goal.segments:
        assert segment.type is SegmentType.LINEAR
        assert (segment.velocity, segment.acceleration) == (0.1, 0.5)
    # The last point is never blended, unless the path goes on.
    assert goal.segments.blend_radii.tolist() == [0.01, 0.01, 0.01, 0.0]
    assert path.then(path)._table().segments.blend_radii.tolist() == [0.01] * 7 + [0.0]
    assert path.keep_open()._table().segments.blend_radii.tolist() == [0.01] * 4
    assert not goal.waypoints.times.any()
    assert {point.pose.quaternion for point in goal.waypoints} == {DOWN}


def test_a_path_never_changes():
    first = START.by(dx=0.1)
    first.at(speed=1.0).by(dx=0.1).set(TORCH, True)
    assert len(first) == 1
    with pytest.raises(AttributeError):
        first.frame = 'part'  # type: ignore[misc]


def test_a_feed_holds_until_it_is_changed_and_one_motion_may_differ():
    path = START.at(speed=0.1, joint_speed=1.0, turn_speed=0.5).by(dx=0.1).by(dx=0.1, speed=0.2)
    path = path.at(speed=0.3).by(dx=0.1).joint((-0.4, 0.1, 0.4)).by(turn=axis_angle(Z, 1.0))
    assert [segment.velocity for segment in path.goal().segments] == [0.1, 0.2, 0.3, 1.0, 0.5]


def test_durations_become_times():
    goal = START.by(dx=0.1, duration=0.1).by(dx=0.1, duration=0.2).goal()
    assert [point.time for point in goal.waypoints] == [0.1, 0.3]


def test_every_kind_of_motion():
    path = (
        START.line((-0.4, 0.0, 0.5), optimized=True, speed=0.5)
        .joint((-0.4, 0.1, 0.5), posture={'elbow_joint': 1.6})
        .process((-0.4, 0.15, 0.5), blend=mm(1))
        .arc((-0.3, 0.25, 0.5), via=(-0.37, 0.22, 0.5), via_posture={'elbow_joint': 1.0})
        .joint((-0.3, 0.1, 0.5), optimized=True)
    )
    goal = path.goal()
    assert [segment.type for segment in goal.segments] == [
        SegmentType.OPTIMIZED_LINEAR,
        SegmentType.JOINT,
        SegmentType.PROCESS,
        SegmentType.CIRCULAR,
        SegmentType.OPTIMIZED_JOINT,
    ]
    assert goal.waypoints[1].posture.values == (1.6,)
    assert goal.segments[3].via_posture.names == ('elbow_joint',)


def test_a_process_goes_on_at_its_points_and_through_an_arc():
    path = START.at(speed=0.5).process((-0.5, 0.1, 0.5)).process((-0.4, 0.1, 0.5))
    path = path.arc((-0.3, 0.2, 0.5), via=(-0.33, 0.13, 0.5)).process((-0.3, 0.21, 0.5))
    path = path.process((-0.3, 0.3, 0.5), blend=0.0).line((-0.3, 0.3, 0.6))
    radii = [segment.blend_radius for segment in path.goal().segments]
    # 10 ms at 0.5 m/s, but not more than 0.3 of 10 mm, and none where that is too little.
    assert radii == [0.005, 0.005, 0.0, 0.0, 0.0, 0.0]
    slow = START.at(speed=0.05).process((-0.5, 0.1, 0.5)).process((-0.4, 0.1, 0.5))
    assert [segment.blend_radius for segment in slow.goal().segments] == [0.002, 0.0]


def test_outputs_belong_to_the_point_before():
    path = START.by(dx=0.1).set(TORCH, True).by(dx=0.1)
    path = path.set(analog(1, AnalogDomain.VOLTAGE), 0.5, after=0.2).set(TORCH, False)
    first, second, third = path.goal().io_commands
    assert (first.waypoint, first.output, first.pin, first.value, first.offset) == (
        0,
        OutputKind.STANDARD_DIGITAL,
        2,
        1.0,
        0.0,
    )
    assert (second.waypoint, second.domain, second.offset) == (1, AnalogDomain.VOLTAGE, 0.2)
    assert (third.waypoint, third.value) == (1, 0.0)


def test_an_output_before_a_point_counts_from_the_one_before():
    path = START.by(dx=0.1, duration=1.0).by(dx=0.1, duration=2.0).set(TORCH, True, before=0.5)
    (command,) = path.goal().io_commands
    assert (command.waypoint, command.offset) == (0, 1.5)


def test_a_spline_has_its_execution_and_free_twists():
    path = START.spline((-0.4, 0.0, 0.5), duration=1.0, twist=(0.1, 0.0, 0.0))
    goal = path.spline((-0.3, 0.0, 0.5), duration=1.0, twist=ZERO6, acceleration=ZERO6)._table()
    assert goal.execution is ExecutionMode.SPLINE
    assert np.isnan(goal.waypoints.twists[0]).tolist() == [False] * 3 + [True] * 3
    assert path.executed_as(ExecutionMode.SERVO).goal().execution is ExecutionMode.SERVO


def test_settings_of_the_whole_path():
    goal = (
        START.tolerances(path=Tolerance(position=(0.001,) * 3), time=2.0)
        .tolerances(goal=Tolerance(orientation=(0.1,) * 3))
        .safe(TORCH, False, restore=True)
        .keep_open()
        .by(dx=0.1)
        .goal()
    )
    assert goal.path_tolerance.position == (0.001,) * 3
    assert goal.goal_tolerance.orientation == (0.1,) * 3
    assert goal.goal_time_tolerance == 2.0
    assert goal.keep_open
    assert goal.safe_outputs == (
        SafeOutput(output=OutputKind.STANDARD_DIGITAL, pin=2, value=0.0, restore=True),
    )


def test_corners_are_those_of_the_path_or_of_a_motion():
    path = START.by(dx=0.1).by(dy=0.1, corner_deviation=mm(0.1), corner_angle=0.01).by(dx=0.1)
    path = path.rounded(mm(0.2), deg(2))
    goal = path.goal()
    assert (goal.corner_deviation, goal.corner_angle) == (0.0002, deg(2))
    assert [segment.corner_deviation for segment in goal.segments] == [0.0, 0.0001, 0.0]
    assert [segment.corner_angle for segment in goal.segments] == [0.0, 0.01, 0.0]
    assert path.rounded(0.0).goal().corner_deviation == 0.0
    feed = START.at(corner_deviation=mm(0.1)).by(dx=0.1).at(corner_deviation=0.0).by(dy=0.1)
    assert [segment.corner_deviation for segment in feed.goal().segments] == [0.0001, 0.0]


def test_a_changed_path_has_its_corners():
    leg = START.by(dx=0.1).by(dy=0.1, corner_deviation=mm(0.1)).by(dx=0.1).rounded(mm(0.2))
    for path, expected in (
        (leg.transformed(Pose((0.0, 0.0, 0.1))), [0.0, 0.0001, 0.0]),
        (leg.offset(dz=0.1, of_tool=True), [0.0, 0.0001, 0.0]),
        # A corner belongs to the point at which it is.
        (leg.reversed(), [0.0001, 0.0, 0.0]),
        (leg.then(Path(leg.end).by(dz=0.1)), [0.0, 0.0001, 0.0, 0.0]),
        (leg.repeated(2, dz=0.01), [0.0, 0.0001, 0.0, 0.0, 0.0, 0.0001, 0.0]),
        (Path.from_yaml(leg.to_yaml()), [0.0, 0.0001, 0.0]),
    ):
        goal = path.goal()
        assert goal.corner_deviation == 0.0002
        assert [segment.corner_deviation for segment in goal.segments] == expected
    with pytest.raises(InvalidGoal, match='joins paths of different corner_deviation'):
        leg.then(Path(leg.end).by(dz=0.1).rounded(mm(0.1)))


def test_a_rounded_process_needs_no_blend():
    path = START.at(speed=0.05).process((-0.5, 0.1, 0.5)).process((-0.4, 0.1, 0.5))
    assert path.goal().segments[0].blend_radius == 0.002
    assert path.rounded(mm(0.1)).goal().segments[0].blend_radius == 0.0
    own = START.process((-0.5, 0.1, 0.5), corner_deviation=mm(0.1)).process((-0.4, 0.1, 0.5))
    assert own.goal().segments[0].blend_radius == 0.0


def test_frames_are_found_by_their_names():
    part = Pose((0.1, 0.2, 0.3), axis_angle(Z, 1.0))
    nozzle = Pose((0.0, 0.0, 0.1))
    frames = Frames(
        '', [StaticFrame('part', 'base', part), StaticFrame('nozzle', 'tool0', nozzle)]
    )
    path = Path((0.0, 0.0, 0.1), DOWN, frame='part', tool='nozzle').by(dx=0.1)
    goal = path.goal(frames)
    assert (goal.T_base_frame, goal.T_flange_controlled) == (part, nozzle)
    with pytest.raises(InvalidGoal, match='is "nozzle", which is not a known frame'):
        path.goal()


# ---- orientations -------------------------------------------------------------------------------


def test_the_tool_points_against_a_normal():
    for normal, x in ((Z, Y), ((0.0, 1.0, 1.0), X), (X, (0.3, 1.0, -1.0)), ((0, 0, -1), X)):
        q = against(normal, x)
        n = np.array(normal) / np.linalg.norm(normal)
        assert np.array(rotate(q, Z)) == pytest.approx(-n)
        along = np.array(x) - n * np.dot(n, x)
        assert np.array(rotate(q, X)) == pytest.approx(along / np.linalg.norm(along))
    assert np.array(against(Z, x=Y)) == pytest.approx(np.array(DOWN))


def test_roll_pitch_and_yaw_turn_about_fixed_axes():
    q = roll_pitch_yaw(deg(90), deg(90), 0.0)
    # y goes to z by the roll, and to x by the pitch.
    assert np.array(rotate(q, Y)) == pytest.approx(np.array(X), abs=1e-12)
    assert np.array(rotate(roll_pitch_yaw(0.0, 0.0, deg(90)), X)) == pytest.approx(
        np.array(Y), abs=1e-12
    )


def test_a_tilted_tool_leans_by_its_angle():
    axis = np.array(rotate(tilted(deg(20)), Z))
    assert np.arccos(-axis[2]) == pytest.approx(deg(20))
    assert axis[1] > 0.3


def test_a_turn_of_the_tool_goes_about_its_own_axis():
    tilt = Path((-0.5, 0.0, 0.5), tilted(0.5))
    there = tilt.by(turn=axis_angle(Z, 1.0), of_tool=True).end
    assert np.array(rotate(there.quaternion, Z)) == pytest.approx(np.array(rotate(tilted(0.5), Z)))
    assert tilt.by(dz=0.1, of_tool=True).end.position[2] < 0.5


def test_an_arc_that_is_followed_turns_the_tool_with_its_tangent():
    path = START.arc(
        (-0.4, 0.0, 0.5), via=(-0.4 - 0.1 / 2**0.5, 0.1 / 2**0.5 - 0.1, 0.5), follow=True
    )
    turn = path.end.angle_to(HERE)
    assert turn == pytest.approx(pi / 2, abs=1e-9)
    assert path.goal().segments[0].arc_mode is ArcMode.FIXED


def test_a_weave_swings_evenly_along_a_line_and_an_arc():
    straight = START.at(speed=0.05, acceleration=0.5).by(dy=0.1)
    path = straight.weave(amplitude=mm(4), wavelength=mm(20))
    points = path._table().waypoints
    assert len(path) == 5 * 8
    aside = points.poses[:, 0] - HERE.position[0]
    along = points.poses[:, 1] - HERE.position[1]
    assert np.abs(aside) == pytest.approx(np.abs(0.004 * np.sin(2 * pi * along / 0.02)), abs=1e-9)
    assert np.abs(aside).max() == pytest.approx(0.004)
    assert path.end.position == pytest.approx(straight.end.position)
    # From rest to rest at its speed; a tenth of a second to reach it, and one to stop.
    assert points.times[-1] == pytest.approx(0.1 / 0.05 + 0.1)
    middle = (along > 0.02) & (along < 0.08)
    assert points.twists[middle, 1] == pytest.approx(0.05, abs=1e-6)
    slope = 2 * pi / 0.02 * np.cos(2 * pi * along[middle] / 0.02)
    assert np.abs(points.twists[middle, 0]) == pytest.approx(
        np.abs(0.05 * 0.004 * slope), abs=1e-5
    )
    assert path.start == HERE

    bow = START.at(speed=0.05).arc((-0.4, 0.0, 0.5), via=(-0.4 - 0.1 * 0.8, -0.1 + 0.1 * 0.6, 0.5))
    radii = [
        np.hypot(pose.position[0] + 0.4, pose.position[1] + 0.1)
        for pose in bow.weave(mm(4), mm(10)).poses
    ]
    assert (min(radii), max(radii)) == pytest.approx((0.096, 0.104), abs=1e-9)


# ---- mistakes -----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ('make', 'sentence'),
    [
        (lambda: START.by(dy=200), 'point 0 (line) has dy = 200 m, more than 3 m; write mm(200)'),
        (lambda: Path((-550, 0, 1), DOWN), 'start has x = -550 m, more than 3 m'),
        (lambda: START.at(speed=50), 'at() after 0 points has the speed 50, outside 0 to 5 m/s'),
        (lambda: START.at(blend=-0.1), 'at() after 0 points has the blend -0.1, outside'),
        (lambda: START.by(dx=0.1, blend=10), 'point 0 (line) has the blend 10, outside 0 to 0.5'),
        (lambda: Path().by(dx=0.1), 'point 0 (line) is relative, but the path has no start'),
        (lambda: Path().line((0, 0, 1)), 'point 0 (line) has no orientation'),
        (lambda: START.line((1, 2)), 'point 0 (line) has the position (1, 2); give x, y and z'),
        (lambda: START.line((nan, 0, 0)), 'point 0 (line) has x = nan; give a finite number'),
        (lambda: START.line(TEXT), "point 0 (line) has the position 'abc'; give x, y and z"),
        (lambda: START.by(), 'point 0 (line) is where the tool is before'),
        (lambda: START.by(dx=0.1, motion='jump'), "point 0 (by) has the motion 'jump'; use line"),
        (lambda: START.line((0, 0, 1), (1, 1, 0, 0)), 'point 0 (line) has the orientation (1, 1,'),
        (lambda: START.by(dx=0.1, speed=TEXT), "point 0 (line) has the speed 'abc'; give a"),
        (
            lambda: START.by(dx=0.1, duration=1).by(dx=0.1),
            'point 1 (line) has no duration, but the motions before have; give one to each ',
        ),
        (
            lambda: START.by(dx=0.1).by(dx=0.1, duration=1),
            'point 1 (line) has a duration, but the motions before have none; give one to each',
        ),
        (
            lambda: START.at(speed=0.1).by(dx=0.1, duration=1),
            'point 0 (line) has a duration and a speed; at(speed=0) before it unsets the speed.',
        ),
        (lambda: START.by(dx=0.1, duration=0), 'point 0 (line) has a duration of 0'),
        (lambda: START.set(TORCH, True), 'set() comes before the first point'),
        (
            lambda: START.by(dx=0.1).set(TORCH, 0.5),
            'the value of standard digital output 2 is 0.5',
        ),
        (lambda: digital(9), 'the pin of standard digital output 9 is 9'),
        (
            lambda: START.by(dx=0.1).set(TORCH, True, before=0.1),
            'set() at point 0 has before=0.1 s, but the motion to this point has no duration',
        ),
        (
            lambda: START.by(dx=0.1, duration=1).set(TORCH, True, before=0.1, after=0.2),
            'set() at point 0 combines before with after; use one of them.',
        ),
        (
            lambda: START.by(dx=0.1, duration=1).set(TORCH, True, before=0.1, fraction=-0.5),
            'set() at point 0 combines before with distance or fraction',
        ),
        (
            lambda: START.by(dx=0.1).set(TORCH, True, distance='8mm'),  # type: ignore[arg-type]
            "set() at point 0 has the distance '8mm'; give a number",
        ),
        (
            lambda: START.by(dx=0.1).set(TORCH, True, lead=None),
            'set() at point 0 has the lead None; give a number',
        ),
        (
            lambda: START.by(dx=0.1, posture={'elbow_joint': 90}),
            'point 0 (line): posture has elbow_joint = 90 rad, more than a joint turns',
        ),
        (lambda: axis_angle(Z, 90), 'angle is 90 rad, more than two turns; write deg(90)'),
        (lambda: axis_angle((0, 0, 0), 1), 'axis is (0, 0, 0); give three numbers'),
        (lambda: against(Z, Z), 'x is parallel to the normal'),
        (
            lambda: START.arc((-0.3, -0.1, 0.5), via=(-0.4, -0.1, 0.5)),
            'point 0 (arc) goes through three points of one line',
        ),
        (
            lambda: START.arc((-0.3, -0.1, 0.5), DOWN, via=(-0.4, 0.1, 0.5), follow=True),
            'point 0 (arc) has an orientation, but the arc turns the tool',
        ),
        (
            lambda: START.by(dx=0.1).spline((0, 0, 1), duration=1),
            'point 1 (spline) mixes spline points with other motions',
        ),
        (
            lambda: START.spline((0, 0, 1), duration=1).by(dx=0.1, duration=1),
            'point 1 (line) mixes spline points with other motions',
        ),
        (lambda: START.spline((0, 0, 1), duration=1, twist=(1, 2)), 'point 0 (spline): twist is'),
        (
            lambda: START.by(dx=0.1).then(Path(HERE)),
            'then() joins a path that ends 100 mm and 0 rad away from where the other begins',
        ),
        (
            lambda: START.then(Path(HERE, frame='part').by(dx=0.1)),
            "then() joins the frames 'base' and 'part'; use one for both.",
        ),
        (lambda: Path().joint(HERE).reversed(), 'reversed() has no start to go back to'),
        (
            lambda: START.by(dx=0.1).set(TORCH, True).reversed(),
            'reversed() has outputs, inputs, payloads or presses, which have no reverse',
        ),
        (
            lambda: START.rounded(0.2),
            'rounded(): deviation is 0.2 m, but must be 0 (corners as they are) or from 2e-05 to '
            '0.1 m; mm() converts.',
        ),
        (
            lambda: START.rounded(mm(0.2), 1.5),
            'rounded(): angle is 1.5 rad, but must be 0 (0.02 rad) or from 0.001 to 0.5 rad; ',
        ),
        (lambda: START.rounded(TEXT), "rounded() has the deviation 'abc'; give a number."),
        (
            lambda: START.by(dx=0.1, corner_deviation=0.2),
            'point 0 (line).corner_deviation is 0.2 m, but must be 0',
        ),
        (lambda: START.repeated(0), 'repeated() is asked for 0 times'),
        (lambda: START.by(dx=0.1).weave(0.01, 0.1), 'weave() needs a speed and a wavelength'),
        (
            lambda: START.at(speed=0.1).by(dx=0.1).by(dy=0.1).weave(0.01, 0.1),
            'weave() at point 0 has a corner; weave each leg and join them.',
        ),
        (
            lambda: START.at(speed=0.1).by(dz=-0.1).weave(0.01, 0.1),
            'weave() has a tool that points along the path; turn it across.',
        ),
        (
            lambda: START.arc((-0.3, -0.1, 0.5), tilted(0.2), via=(-0.4, 0.1, 0.5)).offset(
                dz=0.1, of_tool=True
            ),
            'offset() at point 0 turns the tool on an arc',
        ),
        (lambda: Path(frame=POSE), 'frame is Pose('),
        (lambda: Path((0, 0, 1)), 'start has no orientation; write Path(position, orientation).'),
        (
            lambda: START.at(joint_speed=1).joint((-0.5, 0, 0.5), duration=1),
            'point 0 (joint) has a duration and a speed; at(joint_speed=0) before it unsets the',
        ),
        (
            lambda: START.at(turn_speed=1).by(turn=axis_angle(Z, 1), duration=1),
            'point 0 (line) has a duration and a speed; at(turn_speed=0) before it unsets the',
        ),
        (
            lambda: START.by(dx=0.1, duration=1, speed=0.1),
            'point 0 (line) has a duration and a speed; give one of them.',
        ),
        (
            lambda: START.line((-0.4, 0, 0.5), duration=1, optimized=True),
            'point 0 (line) has a duration, which an optimized motion cannot keep',
        ),
        (lambda: mm(*TWO), 'mm() has the two numbers -550 and -280; give one length, or x,'),
        (lambda: START.steady(95), 'steady().min_speed_fraction is 95, but must be from 0'),
        (lambda: START.keep_open(-1), 'keep_open().replace_horizon is -1 s, but must be 0 ('),
        (
            lambda: START.executed_as('SERVO'),  # type: ignore[arg-type]
            "executed_as().execution is 'SERVO', which is no ExecutionMode.",
        ),
        (lambda: START.tolerances(time=nan), 'tolerances() has the time nan; give a finite'),
        (lambda: START.tolerances(time=TEXT), "tolerances() has the time 'abc'; give a number."),
        (lambda: START.tolerances(path=TEXT), "tolerances().path_tolerance is 'abc', which is no"),
        (
            lambda: START.path_offset(across=6),
            'path_offset().path_offset.limits.y is 6 m, outside',
        ),
        (lambda: START.feed_override(30), 'feed_override().feed_override.minimum is 30, but must'),
        (
            lambda: START.asking(frame_id='part'),
            'asking() names frame_id, which is no setting of a whole path; use one of path_tol',
        ),
        (lambda: START.asking(io_commands=()), 'asking() names io_commands, which is no setting'),
        (lambda: START.asking(sped=1.0), 'asking() names sped, which is no setting'),
        (
            lambda: START.by(dx=0.1).set(TORCH, TEXT),
            "standard digital output 2 has the value 'abc'",
        ),
        (lambda: START.safe(TORCH, TEXT), "standard digital output 2 has the value 'abc'; give a"),
        (
            lambda: START.safe(TORCH, False).safe(TORCH, True),
            'safe() names standard digital output 2 a second time; name it once.',
        ),
        (lambda: digital(TEXT), "the pin of a standard digital output is 'abc'; give its number."),
        (lambda: START.by(dx=10**400), 'point 0 (line) has the position (1000'),
        (lambda: START.by(dx=0.1, speed=10**400), 'point 0 (line) has the speed 1000'),
        (lambda: axis_angle(Z, TEXT), "axis_angle() has the angle 'abc'; give a number."),
        (lambda: axis_angle(TEXT, 1), "axis is 'abc'; give three numbers"),
        (lambda: START.by(dx=0.1).repeated(2.5), 'repeated() is asked for 2.5 times; use 1 or'),  # type: ignore[arg-type]
        (
            lambda: START.by(dx=0.1).dwell(0.5).reversed().goal(),
            'reversed() has a dwell of 0.5 s at its start, where no goal can have one; call',
        ),
        (
            lambda: Path.from_yaml('validate_only: true'),
            'trajectory.header.stamp or validate_only',
        ),
    ],
)
def test_a_mistake_is_a_sentence_where_it_is_made(make, sentence):
    with pytest.raises(InvalidGoal) as error:
        make()
    text = str(error.value)
    assert text.startswith(sentence)
    assert text.endswith('.')
    assert '\n' not in text


# ---- files --------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    'path',
    tracked_files(share_path() / 'config' / 'examples', '*.yaml'),
    ids=lambda path: path.stem,
)
def test_the_examples_are_paths(path, tmp_path):
    loaded = Path.load(path)
    loaded.save(tmp_path / 'again.yaml')
    again = Path.load(tmp_path / 'again.yaml')
    assert again._table() == loaded._table()


def test_a_goal_in_a_frame_without_a_name_comes_into_the_base():
    T = Pose((0.1, 0.0, 0.0))
    goal = START.by(dx=0.1).goal()
    moved = type(goal)(waypoints=goal.waypoints, segments=goal.segments, T_base_frame=T)
    assert Path.from_goal(moved).end.position == pytest.approx((-0.3, -0.1, 0.5))


def test_a_file_that_is_no_goal_is_refused_with_its_name(tmp_path):
    (tmp_path / 'wrong.yaml').write_text('points: []')
    with pytest.raises(GoalFileError, match=r'wrong\.yaml: points is not a field'):
        Path.load(tmp_path / 'wrong.yaml')


def test_a_path_needs_no_ros():
    script = (
        'import sys; from ur_cartesian_driver.path import *; '
        'text = Path(mm(-500, 0, 400), DOWN).by(dx=0.1).to_yaml(); Path.from_yaml(text); '
        'print([name for name in sys.modules if name.startswith(("rclpy", "rosidl"))])'
    )
    ended = subprocess.run([sys.executable, '-c', script], capture_output=True, text=True)
    assert ended.stdout == '[]\n', ended.stderr


def test_a_dwell_stops_the_arm_and_delays_what_follows():
    path = Path(HERE).at(blend=mm(5)).by(dy=0.1, duration=1.0).dwell(0.5).by(dx=0.1, duration=1.0)
    goal = path.goal()
    assert [point.time for point in goal.waypoints] == [1.0, 2.5]
    assert [segment.dwell for segment in goal.segments] == [0.5, 0.0]
    assert [segment.blend_radius for segment in goal.segments] == [0.0, 0.0]
    assert Path.from_goal(goal).goal() == goal
    back = path.then(Path(path.end).by(dz=0.1, duration=1.0)).reversed().goal()
    assert [
        (point.time, s.dwell) for point, s in zip(back.waypoints, back.segments, strict=True)
    ] == [
        (1.0, 0.0),
        (2.0, 0.5),
        (3.5, 0.0),
    ]
    spline = Path(HERE).spline((-0.5, 0.0, 0.45), duration=1.0).dwell(0.2)
    assert spline.goal().waypoints[0].twist == (0.0,) * 6


def test_a_dwell_stays_at_its_place_on_the_way_back():
    """A dwell belongs to a place: there and back, the arm rests once where it turns round."""
    there = Path(HERE).by(dy=0.1).by(dx=0.1).dwell(0.5)

    def dwells(path):
        return [(p.pose.position, s.dwell) for p, s in zip(*rows(path), strict=True) if s.dwell]

    def rows(path):
        goal = path.goal()
        return goal.waypoints, goal.segments or [Segment()] * len(goal.waypoints)

    end = there.end.position
    assert dwells(there.then(there.reversed())) == [(end, 0.5)]
    # Where the path turns back at a point of another one, that point gets the dwell.
    assert dwells(Path(HERE).by(dy=0.1).by(dx=0.1).then(there.reversed())) == [(end, 0.5)]
    assert dwells(there.reversed().reversed()) == [(end, 0.5)]
    passes = there.repeated(3, dz=0.02, alternating=True)
    assert [(round(place[2], 6), dwell) for place, dwell in dwells(passes)] == [
        (0.5, 0.5),
        (0.52, 0.5),
        (0.54, 0.5),
    ]
    assert {round(place[0], 6) for place, _ in dwells(passes)} == {round(end[0], 6)}
    assert dwells(there.dwell(0.0).reversed()) == []


def test_a_moved_spline_keeps_the_rates_that_are_given():
    """Judge: a velocity turns with its frame, and v + w x r holds at a point beside it."""
    path = Path(HERE).spline((-0.4, 0.0, 0.5), duration=1.0, twist=(0.1, nan, 0.3))
    path = path.spline((-0.3, 0.0, 0.5), duration=1.0, twist=ZERO6)
    moved = path.offset(dx=0.1)._table().waypoints
    np.testing.assert_array_equal(moved.twists[0], [0.1, nan, 0.3, nan, nan, nan])
    quarter = path.transformed(Pose((0.0, 0.0, 0.0), axis_angle(Z, deg(90))))
    twist = quarter._table().waypoints.twists[0]
    np.testing.assert_allclose(twist, [nan, 0.1, 0.3, nan, nan, nan], atol=1e-12)
    with pytest.raises(InvalidGoal, match=r'transformed\(\) at point 0 turns a twist of which'):
        path.transformed(Pose((0.0, 0.0, 0.0), axis_angle(Z, 1.0)))
    whole = Path(HERE).spline((-0.4, 0.0, 0.5), duration=1.0, twist=(0.1, 0.0, 0.0))
    turned = whole.transformed(Pose((0.0, 0.0, 0.0), axis_angle(Z, 1.0)))
    twist = turned._table().waypoints.twists[0]
    np.testing.assert_allclose(twist[:3], 0.1 * np.array([np.cos(1.0), np.sin(1.0), 0.0]))
    assert np.isnan(twist[3:]).all()


def test_beside_a_spline_the_tool_has_the_speed_of_its_turn():
    straight = Path(HERE).spline((-0.4, 0.0, 0.5), duration=1.0, twist=(0.1, 0.0, 0.0))
    straight = straight.spline((-0.3, 0.0, 0.5), duration=1.0)
    twist = straight.offset(dz=0.1, of_tool=True)._table().waypoints.twists[0]
    np.testing.assert_array_equal(twist, [0.1, 0.0, 0.0, nan, nan, nan])
    turning = Path(HERE).spline((-0.4, 0.0, 0.5), tilted(0.3), duration=1.0, twist=(0.1, 0.0, 0.0))
    with pytest.raises(InvalidGoal, match=r'offset\(\) at point 0 has a linear twist, but the'):
        turning.offset(dz=0.1, of_tool=True)
    given = Path(HERE).spline(
        (-0.4, 0.0, 0.5), tilted(0.3), duration=1.0, twist=(0.1, 0.0, 0.0, 0.0, 2.0, 0.0)
    )
    beside = given.offset(dz=0.1, of_tool=True)
    arm = np.array(beside.end.position) - given.end.position
    twist = beside._table().waypoints.twists[0]
    np.testing.assert_allclose(twist[:3], np.array([0.1, 0, 0]) + np.cross([0, 2.0, 0], arm))
    free = Path(HERE).spline((-0.4, 0.0, 0.5), tilted(0.3), duration=1.0)
    assert np.isnan(free.offset(dz=0.1, of_tool=True)._table().waypoints.twists).all()


@pytest.mark.parametrize('twist', [(nan,) * 6, (0.1, 0.0, 0.0, 0.0, 2.0, 0.0)])
def test_beside_a_cubic_spline_is_a_cubic_spline(twist):
    point = Waypoint(time=1.0, pose=Pose((-0.4, 0.0, 0.5), tilted(0.3)), twist=twist)
    path = Path.from_goal(Goal(waypoints=(point,), execution=ExecutionMode.SPLINE))
    beside = path.offset(dz=0.1, of_tool=True)._table().waypoints
    assert not beside.accelerations.any()
    np.testing.assert_array_equal(np.isnan(beside.twists), np.isnan([twist]))


@pytest.mark.parametrize(
    ('make', 'text'),
    [
        (lambda: Path(HERE).dwell(1.0), 'dwell() comes before the first point'),
        (lambda: Path(HERE).by(dy=0.1, blend=0.01).dwell(1.0), 'the arm does not stop'),
        (lambda: Path(HERE).by(dy=0.1).dwell(-1.0), 'time -1, outside 0 to 600 s'),
        (lambda: Path(HERE).by(dy=0.1).call('f', 1e4), 'arguments[0] is 10000, outside -2147 to'),
        (lambda: Path(HERE).by(dy=0.1).call('f', timeout=0.0), 'timeout is 0 s; it must be more'),
        (lambda: Path(HERE).by(dy=0.1).call('f', 'a'), "has the argument 'a'; give a number."),  # type: ignore[arg-type]
        (lambda: Path(HERE).by(dy=0.1).call(3), 'function is 3, which is no text'),  # type: ignore[arg-type]
        (
            lambda: Path(HERE).by(dy=0.1).wait_for(digital_input(3), timeout='2s'),  # type: ignore[arg-type]
            "wait_for() at point 0 has the timeout '2s'; give a number.",
        ),
        (
            lambda: Path(HERE).by(dy=0.1).wait_for(digital_input(3), 'on', timeout=2),  # type: ignore[arg-type]
            "wait_for() at point 0 has the value 'on'; give a number.",
        ),
        (
            lambda: Path(HERE).by(dy=0.1).payload('1 kg'),  # type: ignore[arg-type]
            "payload() at point 0 has the mass '1 kg'; give a number.",
        ),
        (
            lambda: Path(HERE).by(dy=0.1).payload(1, inertia=0.1),  # type: ignore[arg-type]
            'payload() at point 0 has the inertia 0.1; give a sequence of numbers.',
        ),
        (
            lambda: Path(HERE).by(dy=0.1).press({'z': '20 N'}),  # type: ignore[dict-item]
            "press() at point 0 has the force z '20 N'; give a number.",
        ),
        (
            lambda: Path(HERE).by(dy=0.1).press(20),  # type: ignore[arg-type]
            "press() at point 0 has the forces 20; name the axes, like {'z': 20.0}.",
        ),
        (
            lambda: Path(HERE).by(dy=0.1).press({'z': 1}, max_yield='a bit'),  # type: ignore[arg-type]
            "press() at point 0 has the max_yield 'a bit'; give a number.",
        ),
        (
            lambda: Path(HERE).by(dy=0.1).press({'z': 1}, frame='tool'),  # type: ignore[arg-type]
            "press() at point 0.frame is 'tool', which is no PressFrame.",
        ),
        (
            lambda: Path(HERE).by(dy=0.1).follow_speed(analog(1), 'double'),  # type: ignore[arg-type]
            "follow_speed() at point 0 has the gain 'double'; give a number.",
        ),
        (
            lambda: (
                Path(HERE)
                .by(dy=0.1)
                .follow_speed(analog(1), 2)
                .by(dy=0.1)
                .end_follow_speed(analog(1), lead='0.1s')  # type: ignore[arg-type]
            ),
            "end_follow_speed() at point 1 has the lead '0.1s'; give a number.",
        ),
        (
            lambda: (
                Path(HERE)
                .by(dy=0.1)
                .follow_speed(analog(1), 2)
                .by(dy=0.1)
                .end_follow_speed(digital(1))
            ),
            'end_follow_speed() at point 1 names standard digital output 1; use analog().',
        ),
        (
            lambda: Path(HERE).by(dy=0.1).pulses(digital(1), 0.1, count=2.5),  # type: ignore[arg-type]
            'pulses() at point 0.count is 2.5, which is no integer.',
        ),
        (
            lambda: Path(HERE).by(dy=0.1).call('f').wait_for(digital_input(3), timeout=2.0),
            'is written after call(), but at one point the robot waits before it calls; let the '
            'function wait',
        ),
    ],
)
def test_a_dwell_that_cannot_be_is_refused(make, text):
    with pytest.raises(InvalidGoal, match=re.escape(text)):
        make()


def test_a_press_begins_and_ends_where_the_arm_stops():
    path = (
        Path(HERE).at(blend=0.01)
        .by(dz=-0.1)
        .press({'z': 20.0, 'rx': 0.0}, speed_limits={'z': 0.02, 'rx': 0.1}, max_yield=0.01)
        .by(dy=0.1).by(dx=0.1).end_press().by(dz=0.1)
    )  # fmt: skip
    goal = path.goal()
    assert goal.presses == (
        Press(
            first_waypoint=0,
            last_waypoint=2,
            axes=('z', 'rx'),
            forces=(20.0, 0.0),
            speed_limits=(0.02, 0.1),
            max_yield=0.01,
        ),
    )
    assert [segment.blend_radius for segment in goal.segments] == [0.0, 0.01, 0.0, 0.0]
    assert Path.from_goal(goal).goal() == goal
    assert Path.from_yaml(path.to_yaml()).goal() == goal
    begun = Path(HERE).by(dz=-0.1).press({}, contact=ContactEnd.ENDS)
    with pytest.raises(InvalidGoal, match=r'press\(\) at point 0 has no end; call end_press'):
        begun.goal()
    with pytest.raises(InvalidGoal, match=r'at point 0 ends press\(\), which has not begun'):
        begun.end_press()
    with pytest.raises(InvalidGoal, match='has speed_limits for y; name the axes of forces'):
        Path(HERE).by(dz=-0.1).press({'z': 1.0}, speed_limits={'y': 0.1})
    with pytest.raises(InvalidGoal, match='axes is empty, and contact is NONE'):
        Path(HERE).by(dz=-0.1).press({})


def test_what_happens_at_points_is_that_of_a_goal():
    pump = analog(1, AnalogDomain.VOLTAGE)
    path = (
        Path(HERE)
        .by(dz=-0.1).wait_for(digital_input(3), timeout=2.0)
        .call('grip', 1).call('hold', timeout=1.0).payload(1.5, (0.0, 0.0, 0.05))
        .follow_speed(pump, 2.0, filter_time=0.02, lead=0.05)
        .by(dy=0.1).by(dx=0.1).end_follow_speed(pump, lead=0.1)
    )  # fmt: skip
    goal = path.goal()
    (wait,), (payload,), (output,) = (
        goal.input_waits,
        goal.payload_changes,
        goal.proportional_outputs,
    )
    assert (wait.waypoint, wait.pin, wait.value, wait.timeout) == (0, 3, 1.0, 2.0)
    assert (payload.waypoint, payload.mass, payload.inertia) == (0, 1.5, ())
    assert goal.script_calls == (
        ScriptCall(waypoint=0, function='grip', arguments=(1.0,)),
        ScriptCall(waypoint=0, function='hold', timeout=1.0),
    )
    assert (output.first_waypoint, output.last_waypoint, output.pin) == (0, 2, 1)
    assert (output.begin_lead, output.end_lead, output.gain) == (0.05, 0.1, 2.0)
    assert Path.from_goal(goal).goal() == goal
    assert Path.from_yaml(path.to_yaml()).goal() == goal
    for open_path in (Path(HERE).by(dy=0.1).follow_speed(pump, 1.0),):
        with pytest.raises(InvalidGoal, match='has no end for analog output 1'):
            open_path.goal()
    with pytest.raises(InvalidGoal, match=r'ends follow_speed\(standard analog output 1\), which'):
        Path(HERE).by(dy=0.1).end_follow_speed(pump)


def test_a_part_is_taken_and_put_down_with_its_payload():
    path = Path(HERE).by(dz=-0.1).attach('part', mass=1.2, center_of_gravity=(0.0, 0.0, 0.1))
    path = path.by(dz=0.1).by(dy=0.1).release('part').by(dz=0.1)
    goal = path.goal()
    assert goal.part_changes == (
        PartChange(waypoint=0, body='part', action=PartAction.ATTACH),
        PartChange(waypoint=2, body='part', action=PartAction.RELEASE),
    )
    (payload,) = goal.payload_changes
    assert (payload.waypoint, payload.mass) == (0, 1.2)
    assert payload.center_of_gravity == (0.0, 0.0, 0.1)
    assert Path.from_goal(goal).goal() == goal
    assert Path.from_yaml(path.to_yaml()).goal() == goal
    with pytest.raises(InvalidGoal, match=r'release\(\) comes before the first point'):
        Path(HERE).release('part')
    with pytest.raises(InvalidGoal, match=r'attach\(\) at point 0 is where the arm does not stop'):
        Path(HERE).by(dz=-0.1, blend=mm(10)).attach('part')


def test_pulses_begin_and_end_at_points():
    camera = tool_digital(1)
    path = Path(HERE).by(dz=-0.1).pulses(camera, mm(2), width=0.004, phase=mm(1), count=9)
    path = path.by(dy=0.1).by(dx=0.1).end_pulses(camera)
    goal = path.goal()
    assert goal.pulses == (
        PulseTrain(
            first_waypoint=0,
            last_waypoint=2,
            output=OutputKind.TOOL_DIGITAL,
            pin=1,
            distance=0.002,
            phase=0.001,
            width=0.004,
            count=9,
        ),
    )
    assert Path.from_goal(goal).goal() == goal
    assert Path.from_yaml(path.to_yaml()).goal() == goal
    begun = Path(HERE).by(dy=0.1).pulses(camera, mm(2))
    with pytest.raises(InvalidGoal, match=r'pulses\(\) at point 0 has no end for pin 1'):
        begun.by(dy=0.1).goal()
    with pytest.raises(InvalidGoal, match=r'ends pulses\(standard digital output 1\), which'):
        begun.by(dy=0.1).end_pulses(digital(1))
    with pytest.raises(InvalidGoal, match='gives no pulses'):
        Path(HERE).by(dy=0.1).pulses(analog(0), mm(2))
    with pytest.raises(InvalidGoal, match='distance is -1 m; it must be more than 0'):
        Path(HERE).by(dy=0.1).pulses(camera, -1.0)
    with pytest.raises(InvalidGoal, match='distance'):
        Path(HERE).by(dy=0.1).pulses(camera, 'wide')  # type: ignore[arg-type]
