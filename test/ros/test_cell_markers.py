# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The bodies of a cell as markers, and those that a refused goal would touch."""

from action_msgs.msg import GoalStatus
from builtin_interfaces.msg import Time
from meshes import need_meshes
import numpy as np
import pytest
from visualization_msgs.msg import Marker, MarkerArray

from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.kinematics.collision_bodies import Link
from ur_cartesian_driver.kinematics.link_shapes import link_meshes, LinkFrames
from ur_cartesian_driver.kinematics.robot_description import robot_description
from ur_cartesian_driver.kinematics.robot_models import MODELS
from ur_cartesian_driver.motion.cell.cell import Cell, CellBody, PlacedShape
from ur_cartesian_driver.motion.cell.shapes import Box, Cylinder, HalfSpace, Mesh, Sphere
from ur_cartesian_driver.motion.errors import CollisionPredicted
from ur_cartesian_driver.motion.geometry.pose import IDENTITY, Pose, pose_from_row
from ur_cartesian_driver.ros.message_fields import pose_from_message
from ur_cartesian_driver.ros.messages.cell_markers import cell_markers, refusal_markers
from ur_cartesian_driver.ros.node_endpoints import LATCHED_QOS

ARM = Arm(MODELS['ur5e'])
Q = (0.4, -1.1, 1.3, -0.7, 0.9, 0.5)
PLACE = Pose.from_rotation_vector((0.1, -0.2, 0.3, 0.4, 0.5, -0.6))
ON_BODY = Pose.from_rotation_vector((0.02, 0.03, -0.04, 0.7, -0.2, 0.1))
CORNER = Mesh(np.eye(4, 3), np.array([(0, 1, 2), (0, 1, 3)]))
STAMP = Time(sec=7)


def body(name, *shapes, frame='base'):
    placed = tuple(PlacedShape(shape, ON_BODY) for shape in shapes)
    return CellBody(name=name, shapes=placed, frame=frame, T_frame_body=PLACE)


def by_name(message):
    """Return the markers by namespace and number."""
    found = {(each.ns, each.id): each for each in message.markers if each.ns}
    assert len(found) == sum(bool(each.ns) for each in message.markers)
    return found


def matrix(marker):
    return pose_from_message(marker.pose).matrix()


def size(marker):
    return marker.scale.x, marker.scale.y, marker.scale.z


def test_each_shape_is_a_marker_in_the_frame_that_carries_it():
    cell = Cell(
        bodies=(
            body('fixture', Box((0.1, 0.2, 0.3)), Cylinder(0.05, 0.4), Sphere(0.07)),
            body('part', CORNER, frame='tool0'),
        )
    )
    message = cell_markers(cell, 'left_', STAMP)
    assert message.markers[0].action == Marker.DELETEALL
    found = by_name(message)
    assert list(found) == [('fixture', 0), ('fixture', 1), ('fixture', 2), ('part', 0)]
    box, can, ball, corner = found.values()
    assert [(each.type, size(each)) for each in (box, can, ball)] == [
        (Marker.CUBE, (0.1, 0.2, 0.3)),
        (Marker.CYLINDER, (0.1, 0.1, 0.4)),
        (Marker.SPHERE, (0.14, 0.14, 0.14)),
    ]
    assert corner.type == Marker.TRIANGLE_LIST
    corners = np.array([(p.x, p.y, p.z) for p in corner.points])
    np.testing.assert_array_equal(corners, CORNER.vertices[CORNER.triangles.reshape(-1)])
    frames = [(each.header.frame_id, each.header.stamp.sec) for each in found.values()]
    assert frames == [('left_base', 7)] * 3 + [('left_tool0', 7)]
    for marker in found.values():
        np.testing.assert_allclose(matrix(marker), PLACE.matrix() @ ON_BODY.matrix(), atol=1e-12)
        assert marker.frame_locked
        assert marker.color.a == 1.0
    assert corner.color != box.color


def test_a_body_in_base_link_is_drawn_in_base_which_every_driver_publishes():
    (marker,) = by_name(
        cell_markers(Cell(bodies=(body('box', Sphere(0.1), frame='base_link'),)), '', STAMP)
    ).values()
    assert marker.header.frame_id == 'base'
    turn = np.diag((-1.0, -1.0, 1.0, 1.0))
    np.testing.assert_allclose(
        matrix(marker), turn @ PLACE.matrix() @ ON_BODY.matrix(), atol=1e-12
    )


def test_a_plane_is_a_square_just_below_it():
    (marker,) = by_name(
        cell_markers(Cell(bodies=(body('table', HalfSpace()),)), '', STAMP)
    ).values()
    assert marker.type == Marker.CUBE
    x, y, z = size(marker)
    assert min(x, y) > 1.0
    T = (PLACE @ ON_BODY).matrix()
    top = matrix(marker) @ (0.0, 0.0, 0.5 * z, 1.0)
    np.testing.assert_allclose(top, T[:, 3], atol=1e-12)
    np.testing.assert_allclose(matrix(marker)[:3, 2], T[:3, 2], atol=1e-12)
    assert marker.color.a < 1.0


def test_what_would_touch_is_red_and_at_the_place():
    pinocchio = pytest.importorskip('pinocchio')
    cell = Cell(
        bodies=(body('table', Box((1.0, 1.0, 0.1))), body('part', Sphere(0.1), frame='flange'))
    )
    refusal = CollisionPredicted('points[0]: too close.')
    assert refusal_markers(refusal, cell, ARM, IDENTITY, 'base', STAMP).markers == []
    refusal.q, refusal.bodies = Q, ('part', 'table')
    found = by_name(refusal_markers(refusal, cell, ARM, IDENTITY, 'left_base', STAMP))
    assert set(found) == {('refused table', 0), ('refused part', 0)}
    assert {each.header.frame_id for each in found.values()} == {'left_base'}
    assert all(each.color.r > 0.7 > 0.3 > each.color.g for each in found.values())
    model = pinocchio.buildModelFromXML(robot_description(ARM))
    data = model.createData()
    pinocchio.framesForwardKinematics(
        model, data, pinocchio.integrate(model, pinocchio.neutral(model), np.array(Q))
    )
    T_base_flange = (
        data.oMf[model.getFrameId('base')].inverse() * data.oMf[model.getFrameId('flange')]
    ).homogeneous
    for name, T in (('table', np.eye(4)), ('part', T_base_flange)):
        np.testing.assert_allclose(
            matrix(found[f'refused {name}', 0]),
            T @ PLACE.matrix() @ ON_BODY.matrix(),
            atol=1e-9,
        )


def test_a_link_that_would_touch_is_the_cylinders_that_contain_it():
    need_meshes('ur5e')
    trimesh = pytest.importorskip('trimesh')
    refusal = CollisionPredicted('points[0]: too close.')
    refusal.q, refusal.bodies = Q, ('forearm_link', 'table')
    cell = Cell(bodies=(body('table', Box((1.0, 1.0, 0.1))),))
    found = by_name(refusal_markers(refusal, cell, ARM, IDENTITY, 'base', STAMP))
    links = [marker for (name, _), marker in found.items() if name == 'refused forearm_link']
    (shape,) = (each for each in link_meshes('ur5e', 'visual') if each.link is Link.FOREARM)
    T_base_mesh = pose_from_row(LinkFrames(ARM).poses(np.array([Q]))[0, 3]) @ shape.T_link_shape
    vertices = trimesh.load(shape.mesh, force='mesh').vertices
    R, t = T_base_mesh.matrix()[:3, :3], T_base_mesh.position
    points = np.column_stack((vertices @ R.T + t, np.ones(len(vertices))))
    inside = np.zeros(len(points), dtype=bool)
    for marker in links:
        assert marker.type == Marker.CYLINDER
        diameter, _, length = size(marker)
        x, y, z, _ = np.linalg.inv(matrix(marker)) @ points.T
        inside |= (np.hypot(x, y) < 0.5 * diameter + 1e-3) & (abs(z) < 0.5 * length + 1e-3)
    assert inside.all()


@pytest.mark.slow
def test_the_cell_is_published_and_what_a_refused_goal_would_touch(sim, make_cell, tmp_path):
    """The goal that passes afterwards takes the red bodies away."""
    x, y, z = sim.state().T_base_tcp.position
    file = tmp_path / 'cell.yaml'
    file.write_text(
        f'cell: 1\nbodies:\n  ball: {{sphere: 0.05, position: [{x}, {y}, {z - 0.3}]}}\n'
        '  probe: {frame: tool0, sphere: 0.01, position: [0, 0, 0.05]}\n'
        'may_touch:\n- [probe, wrist_3_link]\n'
    )
    cell = make_cell(sim, cell_file=str(file))
    cell.wait_ready()
    newest = []
    cell.client_node.create_subscription(
        MarkerArray, '/ur_cartesian_driver/cell_markers', newest.append, LATCHED_QOS
    )
    cell.spin_until(lambda: newest)
    assert set(by_name(newest.pop())) == {('ball', 0), ('probe', 0)}
    status, result = cell.run(cell.goal((3.0, 0.0, 0.0, -0.25), validate_only=True))
    assert (status, result.error_code) == (GoalStatus.STATUS_ABORTED, -10)
    cell.spin_until(lambda: newest)
    red = by_name(newest.pop())
    assert set(red) == {('refused ball', 0), ('refused probe', 0)}
    ball, probe = (matrix(red[f'refused {name}', 0])[:3, 3] for name in ('ball', 'probe'))
    assert np.linalg.norm(ball - probe) < 0.06 + 0.0051
    status, _ = cell.run(cell.goal((2.0, 0.0, 0.0, 0.05), validate_only=True))
    assert status == GoalStatus.STATUS_SUCCEEDED
    cell.spin_until(lambda: newest)
    assert set(by_name(newest.pop())) == {('ball', 0), ('probe', 0)}
