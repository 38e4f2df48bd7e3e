# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Lines are straight, arcs are round, corners are tangent to both legs and stay inside."""

from math import cos, hypot, inf, pi, sin

from hypothesis import assume, given
from hypothesis import strategies as st
import numpy as np
import pytest

from ur_cartesian_driver.motion.geometry.pose import Pose, quaternion_from_rotation_vector, rotate
from ur_cartesian_driver.sim.motion import MotionError
from ur_cartesian_driver.sim.motion.paths.move_paths import (
    CircularMovePath,
    end_within_radius,
    FilletBlendPath,
    JointMovePath,
    LinearMovePath,
    make_blend,
    start_within_radius,
)

numbers = st.floats(-1.0, 1.0)
points = st.tuples(numbers, numbers, numbers)
poses = st.builds(lambda p, r: Pose(p, quaternion_from_rotation_vector(r)), points, points)
fractions = st.floats(0.0, 1.0)


def array(pose):
    return np.array(pose.position)


@given(poses, poses, fractions)
def test_line_is_straight_even_and_turns_the_shortest_way(a, b, f):
    line = LinearMovePath(a, b)
    assume(line.length > 1e-3)
    place = line.at(f * line.length)
    assert array(place) == pytest.approx((1.0 - f) * array(a) + f * array(b), abs=1e-12)
    assert place.angle_to(a) == pytest.approx(f * b.angle_to(a), abs=1e-7)
    assert line.at(inf) == b


def test_length_of_a_line_is_the_larger_of_distance_and_angle():
    start = Pose()
    assert LinearMovePath(
        start, Pose.from_rotation_vector((0.3, 0.0, 0.0, 0.1, 0.0, 0.0))
    ).length == (pytest.approx(0.3))
    assert LinearMovePath(
        start, Pose.from_rotation_vector((0.3, 0.0, 0.0, 0.7, 0.0, 0.0))
    ).length == (pytest.approx(0.7))


@given(
    poses, st.floats(0.01, 2.0), points, st.floats(0.1, 6.1), fractions, fractions, st.booleans()
)
def test_arc_runs_on_the_circle_through_its_points(start, radius, axis, angle, at, f, fixed):
    assume(hypot(*axis) > 0.1)
    frame = Pose(start.position, quaternion_from_rotation_vector(axis))

    def on_circle(phi):
        return frame.apply((radius * cos(phi), radius * sin(phi), 0.0))

    first = Pose(on_circle(0.0), start.quaternion)
    last = Pose(on_circle(angle), frame.quaternion)
    via = on_circle(angle * (0.2 + 0.6 * at))
    arc = CircularMovePath(first, via, last, fixed)
    assert arc.radius == pytest.approx(radius, rel=1e-7)
    assert arc.angle == pytest.approx(angle, rel=1e-7)
    place = arc.at(f * arc.length)
    assert array(place) == pytest.approx(np.array(on_circle(f * angle)), abs=1e-7)
    assert np.linalg.norm(array(place) - np.array(arc.centre)) == pytest.approx(
        arc.radius, abs=1e-9
    )


@given(fractions)
def test_fixed_arc_keeps_the_orientation_to_the_tangent(f):
    start = Pose((1.0, 0.0, 0.0), quaternion_from_rotation_vector((0.3, -0.2, 0.9)))
    arc = CircularMovePath(start, (0.0, 1.0, 0.0), Pose((-1.0, 0.0, 0.0)), True)
    place = arc.at(f * arc.length)
    turn = quaternion_from_rotation_vector((0.0, 0.0, pi * f))
    for axis in ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0)):
        assert rotate(place.quaternion, axis) == pytest.approx(
            rotate(turn, rotate(start.quaternion, axis)), abs=1e-12
        )


def test_unconstrained_arc_turns_from_start_to_end_whatever_is_at_the_via():
    end = Pose((-1.0, 0.0, 0.0), quaternion_from_rotation_vector((0.0, 0.0, 1.0)))
    arc = CircularMovePath(Pose((1.0, 0.0, 0.0)), (0.0, 1.0, 0.0), end, False)
    middle = arc.at(0.5 * arc.length)
    assert middle.quaternion == pytest.approx(quaternion_from_rotation_vector((0.0, 0.0, 0.5)))
    assert arc.at(inf) == end


@pytest.mark.parametrize(
    ('via', 'end', 'text'),
    [
        ((0.5, 0.0, 0.0), (1.0, 0.0, 0.0), 'straight line'),
        ((2.0, 0.0, 0.0), (1.0, 0.0, 0.0), 'straight line'),
        ((0.0, 0.0, 0.0), (1.0, 0.0, 0.0), 'different points'),
        ((1.0, 0.0, 0.0), (1.0, 0.0, 0.0), 'different points'),
        ((1.0, 0.0, 0.0), (0.0, 0.0, 0.0), 'full circle'),
    ],
)
def test_points_that_make_no_circle_are_refused(via, end, text):
    with pytest.raises(MotionError, match=text):
        CircularMovePath(Pose(), via, Pose(end), False)


def two_lines(direction, turn, lengths, rotations=((0.0, 0.0, 0.0), (0.0, 0.0, 0.0))):
    """Return two lines that meet in the origin, the second turned about z."""
    (a, b), (ra, rb) = lengths, rotations
    start = Pose(
        (-a * cos(direction), -a * sin(direction), 0.0), quaternion_from_rotation_vector(ra)
    )
    end = Pose(
        (b * cos(direction + turn), b * sin(direction + turn), 0.0),
        quaternion_from_rotation_vector(rb),
    )
    return LinearMovePath(start, Pose()), LinearMovePath(Pose(), end)


angles = st.floats(0.05, 3.0)
corners = st.builds(
    lambda d, turn, a, b, ra, rb: two_lines(d, turn, (a, b), (ra, rb)),
    st.floats(-3.0, 3.0),
    angles,
    st.floats(0.1, 2.0),
    st.floats(0.1, 2.0),
    points,
    points,
)


@given(corners, st.floats(0.01, 0.09), st.booleans(), fractions)
def test_corner_is_tangent_to_both_legs_and_stays_inside(legs, radius, circular, f):
    before, after = legs
    tail, head = end_within_radius(before, radius), start_within_radius(after, radius)
    turn = make_blend(before, tail, after, head, circular)
    assert isinstance(turn, FilletBlendPath) == circular
    into = array(before.end) - array(before.start)
    onwards = array(after.end) - array(after.start)
    into, onwards = into / np.linalg.norm(into), onwards / np.linalg.norm(onwards)
    # Begins and ends on the legs, at the radius.
    assert array(turn.at(0.0)) == pytest.approx(-radius * into, abs=1e-12)
    assert array(turn.at(1.0)) == pytest.approx(radius * onwards, abs=1e-12)
    assert turn.at(0.0).angle_to(before.at(before.length - tail)) < 1e-7
    assert turn.at(1.0 - 1e-12).angle_to(after.at(head)) < 1e-6
    # Inside the corner: within the radius, and a mix of both directions with positive parts.
    place = array(turn.at(f))
    assert np.linalg.norm(place) <= radius + 1e-12
    (x, y), *_ = np.linalg.lstsq(np.stack([-into, onwards], axis=1), place, rcond=None)
    assert x >= -1e-9
    assert y >= -1e-9
    # Tangent, and as fast as the rates say.
    h = 1e-6
    assert (array(turn.at(h)) - array(turn.at(0.0))) / h == pytest.approx(
        turn.entry_rate * into * before.distance / before.length, abs=1e-3 * radius
    )
    assert (array(turn.at(1.0)) - array(turn.at(1.0 - h))) / h == pytest.approx(
        turn.exit_rate * onwards * after.distance / after.length, abs=1e-3 * radius
    )


@given(angles, st.floats(0.01, 0.09), fractions)
def test_fillet_is_a_circle_and_evenly_passed(turn, radius, f):
    before, after = two_lines(0.3, turn, (1.0, 1.0))
    fillet = make_blend(before, radius, after, radius, True)
    assert np.linalg.norm(array(fillet.at(f)) - np.array(fillet.centre)) == pytest.approx(
        fillet.radius, abs=1e-12
    )
    assert fillet.entry_rate == pytest.approx(fillet.exit_rate)
    assert fillet.entry_rate == pytest.approx(fillet.radius * turn)


def test_fillet_of_a_right_angle_has_the_blend_radius():
    before, after = two_lines(0.0, pi / 2, (1.0, 1.0))
    assert make_blend(before, 0.05, after, 0.05, True).radius == pytest.approx(0.05)


def test_legs_that_go_straight_on_have_no_fillet():
    before, after = two_lines(0.3, 0.0, (1.0, 1.0))
    assert not isinstance(make_blend(before, 0.05, after, 0.05, True), FilletBlendPath)


joints = st.tuples(*[numbers] * 6)


@given(joints, joints, st.floats(0.01, 0.1))
def test_blend_of_a_joint_line_begins_at_the_radius_of_the_tool(arm, a, b, radius):
    line = JointMovePath(a, b, arm.forward)
    tail, head = end_within_radius(line, radius), start_within_radius(line, radius)
    assume(tail is not None and head is not None)
    assert line.pose(line.length - tail).distance_to(arm.forward(b)) == pytest.approx(
        radius, abs=1e-9
    )
    assert line.pose(head).distance_to(arm.forward(a)) == pytest.approx(radius, abs=1e-9)


@given(joints, joints, joints, fractions)
def test_corner_of_two_joint_lines_stays_in_their_plane_and_between_them(arm, a, b, c, f):
    before, after = JointMovePath(a, b, arm.forward), JointMovePath(b, c, arm.forward)
    assume(min(before.length, after.length) > 0.1)
    turn = make_blend(before, 0.05, after, 0.04, False)
    w, p = np.array(b), np.array(turn.at(f))
    into, onwards = w - before.at(before.length - 0.05), np.array(after.at(0.04)) - w
    assert p - w == pytest.approx(-((1.0 - f) ** 2) * into + f * f * onwards, abs=1e-12)
    assert turn.at(1.0) == after.at(0.04)


def test_leg_that_does_not_leave_the_radius_has_no_border():
    line = LinearMovePath(Pose(), Pose((0.05, 0.0, 0.0)))
    assert start_within_radius(line, 0.05) is None
    assert end_within_radius(line, 0.06) is None
