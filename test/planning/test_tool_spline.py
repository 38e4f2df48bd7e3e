# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The curve of the tool has at its points what was asked for, and sensible choices for NaN."""

from __future__ import annotations

from math import cos, nan, sin

import numpy as np
import pytest

from ur_cartesian_driver.motion.geometry.pose import (
    IDENTITY,
    Pose,
    pose_from_row,
    quaternion_from_rotation_vector,
    rotate,
)
from ur_cartesian_driver.motion.goal.goal import Goal, Waypoint
from ur_cartesian_driver.motion.goal.goal_columns import goal_table
from ur_cartesian_driver.planning.geometry.tool_spline import ToolPoints, ToolSpline
from ur_cartesian_driver.planning.spline.spline_points import tool_points

CHOOSE = (nan,) * 6
H = 1e-5


def at_rest(pose=IDENTITY, time=0.0):
    return ToolPoints(
        times=np.array([time]),
        poses=np.array([pose.row()]),
        quintic=True,
        twists=np.zeros((1, 6)),
        accelerations=np.zeros((1, 6)),
    )


def random_goal(seed, quintic, frame=IDENTITY, n=6):
    """Return a goal that turns by up to half a turn from point to point, ends moving."""
    random = np.random.default_rng(seed)
    times = np.cumsum(random.uniform(0.2, 1.5, n))

    def point(time):
        rates = [tuple(random.normal(size=6)) for _ in range(2)]
        return Waypoint(
            time=float(time),
            twist=rates[0],
            acceleration=rates[1] if quintic else (0.0,) * 6,
            pose=Pose(
                tuple(random.normal(size=3)),
                quaternion_from_rotation_vector(tuple(random.uniform(-1.5, 1.5, 3))),
            ),
        )

    return Goal(waypoints=tuple(point(time) for time in times), T_base_frame=frame, keep_open=True)


def motion_at(spline, times):
    """Return the poses, and by finite differences of them the twists."""
    rows = spline.at(times).poses
    before, after = spline.at(times - H).poses, spline.at(times + H).poses
    turn = [
        2.0 * np.array((pose_from_row(b).inverse() @ pose_from_row(a)).quaternion[:3])
        for b, a in zip(before, after, strict=True)
    ]
    spin = [
        rotate(pose_from_row(row).quaternion, tuple(t / (2.0 * H)))
        for row, t in zip(rows, turn, strict=True)
    ]
    return rows, np.concatenate([(after[:, :3] - before[:, :3]) / (2.0 * H), spin], axis=1)


FRAME = Pose((0.5, -0.2, 0.1), quaternion_from_rotation_vector((0.4, -0.8, 1.1)))


@pytest.mark.parametrize('quintic', [False, True])
@pytest.mark.parametrize('frame', [IDENTITY, FRAME])
def test_pose_twist_and_acceleration_at_each_point_are_those_asked_for(quintic, frame):
    goal = random_goal(3, quintic, frame)
    spline = ToolSpline.through(tool_points(goal_table(goal), at_rest()))
    for point in goal.waypoints:
        # At the end of a piece, and where the next one begins.
        for time in (point.time - 1e-9, point.time)[: 1 if point is goal.waypoints[-1] else 2]:
            rows = spline.at(np.array([time]))
            assert rows.poses[0] == pytest.approx((frame @ point.pose).row(), abs=1e-7)
            for part in (slice(0, 3), slice(3, 6)):
                assert rows.twists[0, part] == pytest.approx(
                    rotate(frame.quaternion, point.twist[part]), abs=1e-5
                )
                if quintic:
                    assert rows.accelerations[0, part] == pytest.approx(
                        rotate(frame.quaternion, point.acceleration[part]), abs=1e-4
                    )


@pytest.mark.parametrize('quintic', [False, True])
def test_rates_of_the_curve_are_its_derivatives(quintic):
    spline = ToolSpline.through(tool_points(goal_table(random_goal(4, quintic)), at_rest()))
    times = np.random.default_rng(0).uniform(0.01, spline.times[-1] - 0.01, 60)
    _, twist = motion_at(spline, times)
    rows = spline.at(times)
    np.testing.assert_allclose(twist, rows.twists, atol=1e-5)
    change = (spline.at(times + H).twists - spline.at(times - H).twists) / (2.0 * H)
    np.testing.assert_allclose(change, rows.accelerations, atol=1e-4)


def test_without_accelerations_the_way_from_rest_to_rest_is_the_straight_line_of_a_cubic():
    goal = Goal(
        waypoints=(
            Waypoint(
                time=2.0,
                pose=Pose((0.3, -0.2, 0.1), quaternion_from_rotation_vector((0.0, 1.0, 0.0))),
            ),
        )
    )
    spline = ToolSpline.through(tool_points(goal_table(goal), at_rest()))
    for u in (0.25, 0.5, 0.8):
        share = u * u * (3.0 - 2.0 * u)
        pose = pose_from_row(spline.at(np.array([2.0 * u])).poses[0])
        asked = IDENTITY.interpolate(goal.waypoints[0].pose, share)
        assert pose.distance_to(asked) < 1e-12
        assert pose.angle_to(asked) < 1e-12


def test_a_stretched_curve_is_the_same_way_with_slower_rates():
    spline = ToolSpline.through(tool_points(goal_table(random_goal(5, True)), at_rest(time=0.5)))
    slow = spline.stretch_times(1.7)
    times = np.linspace(0.5, spline.times[-1] - 1e-9, 40)
    a, b = spline.at(times), slow.at(0.5 + 1.7 * (times - 0.5))
    np.testing.assert_allclose(b.poses, a.poses, atol=1e-10)
    np.testing.assert_allclose(1.7 * b.twists, a.twists, atol=1e-10)
    np.testing.assert_allclose(1.7**2 * b.accelerations, a.accelerations, atol=1e-9)


def turning(time, twist=CHOOSE, acceleration=(0.0,) * 6):
    """A point of a motion with constant acceleration from rest, turning about a fixed axis."""
    way, angle = 0.05 * time * time, 0.2 * time * time
    return Waypoint(
        time=time,
        twist=twist,
        acceleration=acceleration,
        pose=Pose(
            (way, 2.0 * way, 0.0), quaternion_from_rotation_vector((0.0, 0.6 * angle, 0.8 * angle))
        ),
    )


def test_chosen_twists_are_exact_for_an_even_acceleration():
    goal = Goal(waypoints=tuple(turning(time) for time in (0.5, 0.8, 1.5, 1.7)), keep_open=True)
    points = tool_points(goal_table(goal), at_rest())
    for time, twist in zip(points.times[1:-1], points.twists[1:-1], strict=True):
        assert twist == pytest.approx(
            (0.1 * time, 0.2 * time, 0.0, 0.0, 0.24 * time, 0.32 * time), abs=1e-12
        )


def test_chosen_accelerations_are_exact_for_an_even_acceleration():
    goal = Goal(
        waypoints=tuple(
            turning(t, (0.1 * t, 0.2 * t, 0.0, 0.0, 0.24 * t, 0.32 * t), CHOOSE)
            for t in (0.5, 0.8, 1.5, 1.7)
        ),
        keep_open=True,
    )
    points = tool_points(goal_table(goal), at_rest())
    assert points.quintic
    for acceleration in points.accelerations[1:-1]:
        assert acceleration == pytest.approx((0.1, 0.2, 0.0, 0.0, 0.24, 0.32), abs=1e-11)


def test_what_is_chosen_goes_along_the_axes_of_the_goal_frame_and_only_where_it_is_nan():
    goal = Goal(
        T_base_frame=FRAME,
        waypoints=tuple(
            Waypoint(
                time=t, twist=(nan, 0.0, 0.0, 0.0, 0.0, 0.0), pose=Pose((0.1 * t, sin(t), 0.0))
            )
            for t in (1.0, 2.0, 3.0)
        ),
    )
    points = tool_points(goal_table(goal), at_rest(FRAME))
    assert points.twists[1:3, :3] == pytest.approx(
        np.array([rotate(FRAME.quaternion, (0.1, 0.0, 0.0))] * 2)
    )
    assert not points.twists[[0, 3]].any()


def test_a_closed_motion_ends_at_rest_and_an_open_one_with_its_last_speed():
    points = [
        Waypoint(time=t, twist=CHOOSE, acceleration=CHOOSE, pose=Pose((0.1 * t, 0.0, 0.0)))
        for t in (1.0, 2.0)
    ]
    for keep_open, speed in ((False, 0.0), (True, 0.1)):
        chosen = tool_points(
            goal_table(Goal(waypoints=tuple(points), keep_open=keep_open)), at_rest()
        )
        assert chosen.twists[-1] == pytest.approx((speed, 0.0, 0.0, 0.0, 0.0, 0.0))
        assert not chosen.accelerations[-1].any()


def test_a_point_beside_a_wait_is_a_stop():
    poses = [
        Pose((0.1, 0.0, 0.0)),
        Pose((0.1, 0.0, 0.0)),
        Pose((0.2, 0.0, 0.0)),
        Pose((0.3, 0.0, 0.0)),
    ]
    goal = Goal(
        waypoints=tuple(
            Waypoint(time=1.0 + k, pose=pose, twist=CHOOSE) for k, pose in enumerate(poses)
        )
    )
    assert tool_points(goal_table(goal), at_rest()).twists[:, 0] == pytest.approx(
        [0.0, 0.0, 0.0, 0.1, 0.0]
    )


def test_twelve_chosen_points_make_a_circle():
    def point(k):
        a = 2.0 * np.pi * k / 12
        return Waypoint(
            time=1.0 + 0.5 * k,
            twist=CHOOSE,
            acceleration=CHOOSE,
            pose=Pose((0.1 * cos(a), 0.1 * sin(a), 0.0)),
        )

    goal = Goal(waypoints=tuple(point(k) for k in range(13)), keep_open=True)
    spline = ToolSpline.through(tool_points(goal_table(goal), at_rest(Pose((0.1, -0.05, 0.0)))))
    rows = spline.at(np.linspace(2.0, 6.0, 200))
    assert np.linalg.norm(rows.poses[:, :3], axis=1) == pytest.approx(0.1, rel=0.004)
    speed = np.linalg.norm(rows.twists[:, :3], axis=1)
    assert speed == pytest.approx(0.1 * np.pi / 3.0, rel=0.06)
