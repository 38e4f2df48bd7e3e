# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Goals about another frame than the active TCP: plans and refusals."""

from dataclasses import replace
from math import radians

import numpy as np
import pytest

from ur_cartesian_driver.motion.errors import CollisionPredicted, InvalidGoal
from ur_cartesian_driver.motion.geometry.pose import (
    IDENTITY,
    Pose,
    pose_from_row,
    quaternion_from_rotation_vector,
)
from ur_cartesian_driver.motion.goal.goal import ArcMode, Goal, Segment, SegmentType, Waypoint
from ur_cartesian_driver.planning import plan, PlanningOptions

T_FLANGE_NOZZLE = Pose((0.03, -0.02, 0.15), quaternion_from_rotation_vector((0.4, -0.3, 0.2)))
CHANGE = PlanningOptions(max_tool_speed=1.0)
KEEP = PlanningOptions(max_tool_speed=1.0, allow_tcp_change=False)
BASE_LINK = Pose((0.1, 0.0, 0.0), (0.0, 0.0, 1.0, 0.0))


def nozzle(cell):
    return cell.arm.forward(cell.state.actual_q) @ T_FLANGE_NOZZLE


def moved(pose, x=0.0, y=0.0, z=0.0, turn=(0.0, 0.0, 0.0)):
    a, b, c = pose.position
    turned = pose @ Pose((0.0, 0.0, 0.0), quaternion_from_rotation_vector(turn))
    return Pose((a + x, b + y, c + z), turned.quaternion)


def goal_of(*poses, segments=(), frame=IDENTITY, **fields):
    """Return a goal whose poses in base are these, given in a frame."""
    return Goal(
        waypoints=tuple(Waypoint(pose=frame.inverse() @ pose) for pose in poses),
        segments=segments,
        T_base_frame=frame,
        controlled_frame='nozzle',
        T_flange_controlled=T_FLANGE_NOZZLE,
        **fields,
    )


def off_line(points, a, b):
    a, b = np.array(a), np.array(b)
    along = (points - a) @ (b - a) / ((b - a) @ (b - a))
    return np.linalg.norm(points - a - along[:, None] * (b - a), axis=1).max()


def nozzle_of(made):
    """Return where the nozzle goes by the plan's reference path, (n, 3)."""
    poses = [pose_from_row(row) @ made.T_tcp_controlled for row in made.reference.poses]
    return np.array([pose.position for pose in poses])


def test_the_tcp_is_set_where_it_may_and_the_goal_stays_as_it_is(cell):
    start = nozzle(cell)
    goal = goal_of(moved(start, y=0.1, turn=(0.0, 0.3, 0.0)))
    made = plan(goal, cell.state, cell.arm, CHANGE)
    assert made.T_flange_tcp == T_FLANGE_NOZZLE
    assert made.T_tcp_controlled == IDENTITY
    assert made.T_flange_active == cell.state.T_flange_tcp
    first = pose_from_row(made.reference.poses[0])
    assert first.distance_to(start) < 1e-9
    assert first.angle_to(start) < 1e-9
    reached = cell.arm.forward(made.segments[-1].joints) @ T_FLANGE_NOZZLE
    assert reached.distance_to(goal.waypoints[0].pose) < 1e-6
    assert any('temporary TCP: nozzle' in line and 'restored' in line for line in made.report)


@pytest.mark.parametrize('change', [{}, {'T_flange_controlled': None, 'controlled_frame': ''}])
def test_the_active_tcp_by_another_name_changes_nothing(cell, change):
    near = cell.state.T_flange_tcp @ Pose((5e-7, 0.0, 0.0))
    goal = replace(goal_of(cell.pose(0.05)), **{'T_flange_controlled': near} | change)
    made = plan(goal, cell.state, cell.arm, CHANGE)
    assert made.T_flange_tcp is None
    assert made.T_tcp_controlled == IDENTITY
    assert not any('TCP' in line for line in made.report)


def test_a_goal_that_does_not_turn_is_carried_over_to_the_tcp(cell):
    start = nozzle(cell)
    via, end = moved(start, y=0.05, z=0.03), moved(start, y=0.1)
    goal = goal_of(
        end,
        moved(start, y=0.02),
        segments=(Segment(type=SegmentType.CIRCULAR, via=BASE_LINK.inverse() @ via), Segment()),
        frame=BASE_LINK,
    )
    made = plan(goal, cell.state, cell.arm, KEEP)
    assert made.T_flange_tcp is None
    assert any('converted from nozzle to the active TCP' in line for line in made.report)
    path = nozzle_of(made)
    assert np.linalg.norm(path - np.array(via.position), axis=1).min() < 2e-3
    arc = path[made.reference.point == 0]
    center = np.array(circle(start.position, via.position, end.position))
    radii = np.linalg.norm(arc - center, axis=1)
    assert np.ptp(radii) < 1e-6
    assert np.linalg.norm(arc[-1] - np.array(end.position)) < 1e-6
    line = path[made.reference.point == 1]
    assert off_line(line, end.position, moved(start, y=0.02).position) < 1e-6


def circle(a, b, c):
    """Return the centre of the circle through three points."""
    a, b, c = map(np.array, (a, b, c))
    u, v = b - a, c - a
    w = np.cross(u, v)
    return a + (np.cross(w, u) * (v @ v) + np.cross(v, w) * (u @ u)) / (2.0 * w @ w)


def test_the_orientation_of_a_via_does_not_move_the_arc(cell):
    start = nozzle(cell)
    via = moved(start, y=0.05, z=0.03, turn=(0.0, 0.0, 1.0))
    made = [
        plan(
            goal_of(moved(start, y=0.1), segments=(Segment(type=SegmentType.CIRCULAR, via=pose),)),
            cell.state,
            cell.arm,
            KEEP,
        )
        for pose in (via, Pose(via.position, start.quaternion))
    ]
    one, other = (m.reference.poses for m in made)
    assert np.allclose(one, other, atol=1e-9)


@pytest.mark.parametrize('kind', [SegmentType.AUTO, SegmentType.PROCESS, SegmentType.CIRCULAR])
def test_a_turn_on_the_way_needs_the_tcp_and_is_refused_with_point_and_angle(cell, kind):
    start = nozzle(cell)
    via = moved(start, y=0.05, z=0.03) if kind == SegmentType.CIRCULAR else None
    goal = goal_of(
        moved(start, y=0.05),
        moved(start, y=0.1, turn=(0.0, radians(2.0), 0.0)),
        segments=(Segment(), Segment(type=kind, via=via)),
    )
    with pytest.raises(
        InvalidGoal,
        match=r'points\[1\]\.pose\.orientation turns nozzle by 2\.00 '
        r'degrees.*JOINT.*allow_tcp_change',
    ):
        plan(goal, cell.state, cell.arm, KEEP)


def test_rounded_corners_are_not_advised_to_use_joint_moves(cell):
    goal = goal_of(
        moved(nozzle(cell), y=0.05, turn=(0.0, 0.0, 0.1)), corner_deviation=1e-3, segments=()
    )
    with pytest.raises(InvalidGoal, match=r'; keep the orientation, or set allow_tcp_change to'):
        plan(goal, cell.state, cell.arm, KEEP)


def test_the_way_to_the_first_point_counts_too(cell):
    goal = goal_of(moved(nozzle(cell), y=0.05, turn=(0.0, 0.0, 0.1)))
    with pytest.raises(InvalidGoal, match=r'points\[0\]'):
        plan(goal, cell.state, cell.arm, KEEP)


def test_an_arc_that_keeps_to_its_tangent_turns(cell):
    start = nozzle(cell)
    goal = goal_of(
        moved(start, y=0.1),
        segments=(
            Segment(
                type=SegmentType.CIRCULAR, via=moved(start, y=0.05, z=0.03), arc_mode=ArcMode.FIXED
            ),
        ),
    )
    with pytest.raises(InvalidGoal, match=r'segments\[0\]\.arc_mode is FIXED'):
        plan(goal, cell.state, cell.arm, KEEP)


def test_joint_segments_may_turn(cell):
    start = nozzle(cell)
    end = moved(start, y=0.05, turn=(0.0, 0.3, 0.0))
    goal = goal_of(end, segments=(Segment(type=SegmentType.JOINT),))
    made = plan(goal, cell.state, cell.arm, KEEP)
    reached = cell.arm.forward(made.segments[-1].joints) @ T_FLANGE_NOZZLE
    assert reached.distance_to(end) < 1e-6
    assert reached.angle_to(end) < 1e-6


def spline_of(cell, angular):
    """A spline of the nozzle, past a point with a velocity along x and an angular one."""
    start = nozzle(cell)
    goal = goal_of(moved(start, x=0.03, y=0.02), moved(start, x=0.06))
    passing, end = goal.waypoints
    return replace(
        goal,
        waypoints=(
            replace(passing, time=1.0, twist=(0.06, 0.0, 0.0, *angular)),
            replace(end, time=2.0),
        ),
    )


@pytest.mark.parametrize('options', [CHANGE, KEEP])
@pytest.mark.parametrize('angular', [(0.0,) * 3, (float('nan'),) * 3], ids=['zero', 'chosen'])
def test_a_spline_that_does_not_turn_has_the_twist_asked_for(cell, angular, options):
    made = plan(spline_of(cell, angular), cell.state, cell.arm, options)
    path, time = nozzle_of(made), made.reference.time
    row = int(np.searchsorted(time, 1.0))
    before, after = (
        (path[row + k] - path[row + k - 1]) / (time[row + k] - time[row + k - 1]) for k in (0, 1)
    )
    assert 0.5 * (before + after) == pytest.approx([0.06, 0.0, 0.0], abs=5e-4)
    assert path[row] == pytest.approx(np.array(moved(nozzle(cell), x=0.03, y=0.02).position))


def test_a_spline_whose_tool_turns_at_a_point_is_not_carried_over(cell):
    with pytest.raises(InvalidGoal, match=r'points\[0\]\.twist\.angular turns nozzle.*allow_tcp'):
        plan(spline_of(cell, (0.0, 0.2, 0.0)), cell.state, cell.arm, KEEP)
    plan(spline_of(cell, (0.0, 0.2, 0.0)), cell.state, cell.arm, CHANGE)


@pytest.mark.parametrize('options', [CHANGE, KEEP])
def test_a_first_point_at_time_zero_is_where_the_controlled_frame_stands(cell, options):
    start = nozzle(cell)
    times = (0.0, 1.0)
    goal = goal_of(start, moved(start, y=0.05))
    goal = replace(
        goal,
        waypoints=tuple(
            replace(point, time=time) for point, time in zip(goal.waypoints, times, strict=True)
        ),
    )
    assert len(plan(goal, cell.state, cell.arm, options).segments) == 1


@pytest.mark.parametrize('options', [CHANGE, KEEP])
@pytest.mark.parametrize(('beyond', 'refused'), [(0.01, None), (-0.01, CollisionPredicted)])
def test_the_tool_that_is_mounted_keeps_clear_also_when_the_flange_is_moved(
    cell, options, beyond, refused
):
    """The TCP points down and goes down by 5 cm, to a table a little below or above."""
    tcp = cell.state.actual_tcp_pose.position[2]
    flange = cell.arm.forward(cell.state.actual_q)
    assert flange.position[2] > tcp + 0.09
    options = replace(
        options,
        self_collision='off',
        workspace_planes=(f'table 0 0 {tcp - 0.05 - beyond} 0 0 1 0',),
    )
    goal = replace(goal_of(moved(flange, y=0.02, z=-0.05)), T_flange_controlled=IDENTITY)
    if refused is None:
        assert plan(goal, cell.state, cell.arm, options).segments
    else:
        with pytest.raises(refused, match='table'):
            plan(goal, cell.state, cell.arm, options)
