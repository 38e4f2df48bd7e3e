# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""What the tool takes moves with the flange, and stays where the tool puts it down."""

import re

import numpy as np
import pytest
from random_cells import CellJudge

from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.kinematics.robot_models import robot_model
from ur_cartesian_driver.motion.cell.cell import Cell, CellBody, EMPTY_CELL, PlacedShape
from ur_cartesian_driver.motion.cell.shapes import Box, HalfSpace
from ur_cartesian_driver.motion.errors import InvalidGoal, NotAvailable
from ur_cartesian_driver.motion.geometry.pose import Pose, quaternion_from_rotation_vector
from ur_cartesian_driver.motion.goal.execution_modes import ExecutionMode
from ur_cartesian_driver.motion.goal.goal import Goal, PartAction, PartChange, Segment
from ur_cartesian_driver.planning import plan, PlanningOptions
from ur_cartesian_driver.planning.preflight.cell_stretches import (
    attached,
    cell_stretches,
    released,
)

BOX = (PlacedShape(Box((0.04, 0.04, 0.04))),)
PLACE = Pose((0.4, -0.2, 0.1), quaternion_from_rotation_vector((0.2, 0.4, -0.3)))
PART = CellBody(name='part', shapes=BOX, T_frame_body=PLACE)
FLOOR = CellBody(name='floor', shapes=(PlacedShape(HalfSpace()),))
CELL = Cell(bodies=(FLOOR, PART))
ATTACH, RELEASE = PartAction.ATTACH, PartAction.RELEASE


def change(waypoint, action, body='part'):
    return PartChange(waypoint=waypoint, body=body, action=action)


def place_in_base(arm, cell, q):
    """Return where the part is, by matrices of the flange."""
    body = cell.body('part')
    in_frame = body.T_frame_body.matrix()
    return arm.forward(q).matrix() @ in_frame if body.frame == 'tool0' else in_frame


@pytest.mark.parametrize('frame', ['base', 'base_link', 'forearm_link'])
def test_a_part_does_not_move_when_it_is_taken_or_put_down(frame):
    arm = Arm(robot_model('ur5e'))
    q, later = (0.3, -1.2, 1.1, -1.5, -1.4, 0.2), (-0.4, -1.0, 1.3, -1.2, -1.7, 0.9)
    tcp = Pose((0.0, 0.0, 0.1))
    cell = Cell(bodies=(FLOOR, CellBody(name='part', shapes=BOX, frame=frame, T_frame_body=PLACE)))
    held = attached(cell, 'part', arm, q, tcp)
    T_base_frame = {
        'base': np.eye(4),
        'base_link': np.diag([-1.0, -1.0, 1.0, 1.0]),  # turned by half a turn about z
        'forearm_link': CellJudge(arm, tcp, Cell()).frames(q)[3],  # by pinocchio
    }[frame]
    np.testing.assert_allclose(
        place_in_base(arm, held, q), T_base_frame @ PLACE.matrix(), atol=1e-9
    )
    put = released(held, 'part', arm, later, tcp)
    assert put.body('part').frame == 'base'
    np.testing.assert_allclose(
        place_in_base(arm, put, q), place_in_base(arm, held, later), atol=1e-12
    )


def test_a_part_on_the_tcp_is_put_down_where_the_tcp_has_it():
    arm, q = Arm(robot_model('ur5e')), (0.3, -1.2, 1.1, -1.5, -1.4, 0.2)
    tcp = Pose((0.0, 0.03, 0.1), quaternion_from_rotation_vector((0.0, 0.5, 0.0)))
    body = CellBody(name='part', shapes=BOX, frame='tool0_controller', T_frame_body=PLACE)
    put = released(Cell(bodies=(body,)), 'part', arm, q, tcp)
    expected = (arm.forward(q) @ tcp @ PLACE).matrix()
    np.testing.assert_allclose(place_in_base(arm, put, q), expected, atol=1e-12)


def test_the_cell_changes_after_the_rows_that_lead_to_a_point():
    arm = Arm(robot_model('ur5e'))
    q = np.linspace((0.0, -1.2, 1.1, -1.5, -1.4, 0.0), (0.5, -1.0, 1.3, -1.2, -1.7, 0.9), 8)
    segment = np.array([0, 0, 1, 1, 1, 2, 2, 3], dtype=np.int32)
    start = (-0.1, -1.2, 1.1, -1.5, -1.4, 0.0)
    changes = [change(2, RELEASE), change(0, ATTACH), change(3, ATTACH)]
    stretches = list(cell_stretches(changes, segment, q, start, arm, Pose(), CELL))
    assert [(each.rows.start, each.rows.stop) for each in stretches] == [(0, 2), (2, 7), (7, 8)]
    assert [each.cell.body('part').frame for each in stretches] == ['base', 'tool0', 'base']
    assert [each.q_start for each in stretches] == [start, tuple(q[1]), tuple(q[6])]
    taken, put = stretches[1].cell, stretches[2].cell
    np.testing.assert_allclose(place_in_base(arm, taken, q[1]), PLACE.matrix(), atol=1e-12)
    expected = place_in_base(arm, taken, q[6])
    np.testing.assert_allclose(place_in_base(arm, put, q[0]), expected, atol=1e-12)


WRONG = [
    ([change(0, RELEASE)], 'part_changes[0].action is RELEASE, but "part" is not on the tool'),
    (
        [change(1, ATTACH), change(0, ATTACH)],
        'part_changes[0].action is ATTACH, but "part" is on the tool already; release it before.',
    ),
    (
        [change(0, ATTACH, 'parts')],
        'part_changes[0].body names what is not there: the cell has no',
    ),
    ([change(0, ATTACH, 'floor')], 'part_changes[0].body is "floor", but a plane has no end'),
    ([change(7, ATTACH)], 'part_changes[0].point_index is 7, but the points are 0 to 1'),
]


@pytest.mark.parametrize(('changes', 'text'), WRONG)
def test_impossible_changes_are_refused_in_a_sentence(changes, text, cell):
    goal = Goal(waypoints=(cell.point(z=0.05), cell.point(z=0.1)), part_changes=tuple(changes))
    with pytest.raises(InvalidGoal, match=re.escape(text)):
        plan(goal, cell.state, cell.arm, PlanningOptions(cell=CELL))


def test_a_driver_without_bodies_says_where_they_come_from(cell):
    goal = Goal(waypoints=(cell.point(z=0.05),), part_changes=(change(0, ATTACH),))
    with pytest.raises(NotAvailable, match='the driver has no bodies; set its parameter cell_fi'):
        plan(goal, cell.state, cell.arm, PlanningOptions(cell=EMPTY_CELL))


def test_no_part_changes_where_the_arm_passes(cell):
    goal = Goal(
        waypoints=(cell.point(z=0.05), cell.point(z=0.1)),
        segments=(Segment(blend_radius=0.01), Segment()),
        part_changes=(change(0, ATTACH),),
    )
    with pytest.raises(InvalidGoal, match=r'point_index needs a stop at points\[0\]'):
        plan(goal, cell.state, cell.arm, PlanningOptions(cell=CELL))


@pytest.mark.parametrize('execution', [ExecutionMode.SPLINE, ExecutionMode.SERVO])
def test_a_spline_rests_where_a_part_changes_and_sends_nothing_for_it(execution, cell):
    points = [cell.point(z=0.02 * k, time=1.0 * k) for k in range(1, 5)]
    goal = Goal(waypoints=points, execution=execution, part_changes=(change(1, ATTACH),))
    planned = plan(goal, cell.state, cell.arm, PlanningOptions(cell=CELL))
    _, qd, _ = planned.joint_spline.rows(np.array([2.0, 1.5]))
    assert abs(qd[0]).max() < 1e-6 < abs(qd[1]).max()
    assert not any(type(each).__name__ == 'Wait' for each in planned.instructions)


def test_a_rounded_path_stops_where_a_part_changes(cell):
    points = (cell.point(z=0.05), cell.point(z=0.05, y=0.05), cell.point(z=0.1, y=0.05))
    goal = Goal(waypoints=points, corner_deviation=0.001)
    planned = {}
    for changes in ((), (change(0, ATTACH),)):
        made = plan(
            Goal(waypoints=points, corner_deviation=goal.corner_deviation, part_changes=changes),
            cell.state,
            cell.arm,
            PlanningOptions(cell=CELL),
        )
        corner = np.array(points[0].pose.position)
        planned[bool(changes)] = np.linalg.norm(made.reference.poses[:, :3] - corner, axis=1).min()
    assert planned[True] < 1e-6 < planned[False]
