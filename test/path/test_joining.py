# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Paths joined by ways through the air: what is planned, judged by the test's own kinematics."""

from dataclasses import replace
from itertools import pairwise

from forward_model import dh_forward
import numpy as np
import pytest

from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.kinematics.robot_models import robot_model
from ur_cartesian_driver.motion.cell.cell import Cell, CellBody, PlacedShape
from ur_cartesian_driver.motion.cell.shapes import Box
from ur_cartesian_driver.motion.errors import GoalRefused, InvalidGoal
from ur_cartesian_driver.motion.goal.goal import SegmentType
from ur_cartesian_driver.motion.goal.goal_columns import goal_table
from ur_cartesian_driver.path import (
    AirTravel,
    digital,
    DOWN,
    Frames,
    join,
    mm,
    Path,
    Pose,
    StaticFrame,
)
from ur_cartesian_driver.planning import plan, PlanningOptions
from ur_cartesian_driver.planning.stop_prediction import state_at_rest
from ur_cartesian_driver.sim.simulator_config import HOME

ARM = Arm(robot_model('ur5e'))
STATE = state_at_rest(ARM, HOME)
TABLE = PlanningOptions(workspace_planes=('table 0 0 0 0 0 1',))
BY = AirTravel(arm=ARM, state=STATE, options=TABLE, retract=mm(30), approach=mm(40))
SPEEDS = {'speed': 0.1, 'joint_speed': 0.6, 'blend': mm(5)}


def seam(x, y, z=0.12, dy=0.1):
    return Path((x, y, z), DOWN).at(**SPEEDS).by(dy=dy)


LEFT, RIGHT = seam(-0.4, 0.2), seam(-0.4, -0.3)


def planned(path, by=BY):
    return plan(path.goal(), by.state, by.arm, by.options)


def places(path):
    return [tuple(np.round(pose.position, 6)) for pose in path.poses]


def test_a_travel_leads_along_the_tool_out_of_one_path_and_into_the_next():
    here = Path(STATE.actual_tcp_pose).at(**SPEEDS).travel_to(LEFT, BY)
    path = here.travel_to(RIGHT, BY)
    found = planned(path)
    assert places(path)[len(here) - 1 : len(here) + 1] == [(-0.4, 0.3, 0.12), (-0.4, 0.3, 0.15)]
    assert places(path)[-3:] == [(-0.4, -0.3, 0.16), (-0.4, -0.3, 0.12), (-0.4, -0.2, 0.12)]
    kinds = [point.segment.type for point in path._points[len(here) :]]
    assert kinds[0] == kinds[-2] == kinds[-1] == SegmentType.LINEAR
    assert set(kinds[1:-2]) == {SegmentType.JOINT}
    # Seams begin and end at rest; in the air the arm goes round the corners.
    radii = goal_table(path.goal()).segments.blend_radii
    assert radii[len(here) - 1] == radii[-2] == radii[-1] == 0.0
    assert radii.max() > 0.0
    heights = [pose[2] for pose in found.reference.poses]
    assert min(heights) > 0.11


def test_the_plan_ends_in_the_postures_that_the_travel_found():
    path, place = Path(STATE.actual_tcp_pose).at(**SPEEDS), BY.begin
    for k, one in enumerate((LEFT, RIGHT)):
        path, place = path._travelled(one, BY, place, f'The travel to path {k}')
        found = planned(path)
        assert np.allclose(found.rows.joints[-1], place.q, atol=1e-6)
    T = dh_forward(ARM.model.geometry, np.array(place.q))
    assert np.allclose(T[:3, 3], RIGHT.end.position, atol=1e-6)


def test_a_joined_path_is_its_seams_in_the_order_given():
    path = join([RIGHT, LEFT, RIGHT], BY)
    at = [places(path).index(tuple(np.round(each.end.position, 6))) for each in (RIGHT, LEFT)]
    assert at[0] < at[1] < len(path) - 1
    assert path.end == RIGHT.end
    assert path.start == STATE.actual_tcp_pose
    assert planned(path).duration > 0.0


def test_a_joined_path_is_the_same_with_the_same_seed():
    assert join([RIGHT, LEFT], BY).goal() == join([RIGHT, LEFT], BY).goal()


def test_the_best_order_and_direction_save_travel():
    row = [seam(-0.4, y) for y in (0.0, 0.3, -0.3)]
    given, best = join(row, BY), join(row, BY, order='best')
    for path in (given, best):
        planned(path)
    assert planned(best).duration < planned(given).duration - 1.0
    ends = {
        tuple(np.round(end, 6)) for one in row for end in (one.start.position, one.end.position)
    }
    assert ends <= set(places(best))


def test_a_path_with_events_keeps_its_direction():
    torch = seam(-0.4, 0.3).set(digital(1), True).by(dx=0.02)
    best = join([torch, RIGHT], BY, order='best')
    first, last = (tuple(np.round(each.position, 6)) for each in (torch.start, torch.end))
    assert places(best).index(first) < places(best).index(last)
    [command] = best.goal().io_commands
    assert places(best)[command.waypoint] == (-0.4, 0.4, 0.12)


def test_a_travel_from_where_the_path_begins_already_adds_nothing():
    here = Path(STATE.actual_tcp_pose).at(**SPEEDS)
    there = here.by(dz=0.05)
    assert here.travel_to(there, BY).goal() == there.goal()
    assert join([there], BY).goal() == there.goal()


def test_no_retract_and_no_approach_leave_joint_motions_only():
    by = replace(BY, retract=0.0, approach=0.0, options=replace(TABLE, max_approach_distance=0.0))
    path = join([LEFT], by)
    kinds = [point.segment.type for point in path._points]
    assert set(kinds[:-1]) == {SegmentType.JOINT}
    assert np.allclose(
        planned(path, by).rows.joints[len(kinds) - 2], planned(path, by).rows.joints[-2]
    )


@pytest.mark.parametrize(
    ('make', 'problem'),
    [
        (lambda: join([], BY), r'^join\(\) has no path'),
        (
            # A caller without a type checker gets the sentence.
            lambda: join([LEFT], BY, order='short'),  # type: ignore[arg-type]
            "has the order 'short'; use given or best",
        ),
        (lambda: LEFT.travel_to(Path().joint((-0.4, 0.1, 0.2), DOWN), BY), 'write Path.start.'),
        (lambda: join([LEFT, Path((0, 0, 0), DOWN, frame='part')], BY), 'in different frames'),
        (
            lambda: join([LEFT.rounded(mm(1))], BY),
            '0 leads to or from a path with rounded',
        ),
        (lambda: join([LEFT, Path(LEFT.end).by(dz=2.0)], BY), r'points.* cannot be reached'),
        (lambda: join([seam(-0.4, 0.0, z=-0.1)], BY), 'table'),
        (lambda: join([LEFT], replace(BY, retract=0.9)), 'path 0: the retract of 0.9 m along'),
    ],
)
def test_what_cannot_be_joined_is_said(make, problem):
    with pytest.raises(GoalRefused, match=problem) as refused:
        make()
    assert str(refused.value).endswith('.')


def test_a_blend_that_is_no_number_is_refused():
    with pytest.raises(ValueError, match='blend is nan m'):
        AirTravel(arm=ARM, state=STATE, blend=float('nan'))


def test_the_other_path_is_not_changed():
    before = RIGHT.goal()
    with pytest.raises(InvalidGoal):
        RIGHT.travel_to(Path(), BY)
    assert RIGHT.goal() == before


def box(name, size, x, y, z):
    return CellBody(name=name, shapes=(PlacedShape(Box(size)),), T_frame_body=Pose((x, y, z)))


def segment_to_box(a, b, centre, size):
    """The least distance of points along segments (n, 3) from a box [m]."""
    t = np.linspace(0.0, 1.0, 30)[:, None, None]
    points = a + t * (b - a)
    outside = np.maximum(np.abs(points - centre) - 0.5 * np.array(size), 0.0)
    return np.linalg.norm(outside, axis=2).min()


def test_a_fixture_between_two_seams_is_passed_at_a_distance():
    size, place = (0.25, 0.04, 0.4), (-0.425, 0.0, 0.2)
    fixture = Cell(bodies=(box('fixture', size, *place),))
    by = replace(BY, options=replace(TABLE, cell=fixture))
    path = Path(STATE.actual_tcp_pose).at(**SPEEDS)
    path = path.travel_to(RIGHT, by).travel_to(seam(-0.4, 0.3), by)
    rows = [by.begin.q, *planned(path, by).rows.joints]
    q = np.concatenate([np.linspace(a, b, 100) for a, b in pairwise(rows)])
    wrist = np.array([dh_forward(ARM.model.geometry, row)[:3, 3] for row in q])
    assert segment_to_box(wrist, wrist, np.array(place), size) > 0.03
    assert wrist[:, 2].max() > 0.45


def test_a_held_part_is_kept_clear_of_the_table_on_the_next_travel():
    part = box('part', (0.04, 0.04, 0.2), -0.4, 0.3, -0.05)
    touch = frozenset({frozenset({'part', name}) for name in ('wrist_3_link', 'wrist_2_link')})
    by = replace(BY, options=PlanningOptions(cell=Cell(bodies=(part,), may_touch=touch)))
    path, place = Path(STATE.actual_tcp_pose).at(**SPEEDS), by.begin
    path, place = path._travelled(LEFT.attach('part'), by, place, 'The travel')
    assert place.cell.body('part').is_on_tool
    path, place = path._travelled(RIGHT.release('part'), by, place, 'The travel')
    assert not place.cell.body('part').is_on_tool
    assert planned(path, by).duration > 0.0


def test_a_path_on_a_part_in_the_hand_is_not_joined():
    frames = Frames(
        static_frames=[
            StaticFrame('part', 'tool0', Pose((0.0, 0.0, 0.1))),
            StaticFrame('belt', 'base', Pose((-0.5, 0.0, 0.3))),
        ]
    )
    path = Path((0.0, 0.0, 0.0), DOWN, frame='part', tool='belt').at(speed=0.05).by(dx=0.02)
    with pytest.raises(InvalidGoal, match='a path on part, which the arm holds, and travels are'):
        join([path], replace(BY, frames=frames))
