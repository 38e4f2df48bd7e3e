# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The bodies of a cell are on the pages, where they are in the cell."""

from math import pi
import re

import numpy as np
import pytest
from recorded_scene import scenes_of

from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.kinematics.robot_description import robot_description
from ur_cartesian_driver.kinematics.robot_models import MODELS
from ur_cartesian_driver.motion.cell.cell import Cell, CellBody, PlacedShape
from ur_cartesian_driver.motion.cell.shapes import Box, Cylinder, HalfSpace, Mesh, Sphere
from ur_cartesian_driver.motion.errors import CollisionPredicted
from ur_cartesian_driver.motion.geometry.pose import Pose
from ur_cartesian_driver.motion.goal.goal import Goal, PartAction, PartChange, Waypoint
from ur_cartesian_driver.planning import plan, PlanningOptions
from ur_cartesian_driver.planning.stop_prediction import state_at_rest
from ur_cartesian_driver.preview import cell_page, motion_page, refusal_page
from ur_cartesian_driver.preview.drawn_shapes import coarse_mesh, MAX_TRIANGLES, triangles_per_mesh

pytest.importorskip('viser')
trimesh = pytest.importorskip('trimesh')

ARM = Arm(MODELS['ur5e'])
Q = (0.3, -pi / 2, 1.4, -1.3, -pi / 2, 0.2)
TCP = Pose.from_rotation_vector((0.01, 0.02, 0.1, 0.1, 0.2, 0.3))
PLACE = Pose.from_rotation_vector((0.1, -0.2, 0.3, 0.4, 0.5, -0.6))
ON_BODY = Pose.from_rotation_vector((0.02, 0.03, -0.04, 0.7, -0.2, 0.1))
SHAPES = {
    'box': (Box((0.1, 0.2, 0.3)), trimesh.creation.box((0.1, 0.2, 0.3))),
    'can': (Cylinder(0.05, 0.2), trimesh.creation.cylinder(0.05, 0.2, sections=48)),
    'ball': (Sphere(0.07), trimesh.creation.icosphere(3, 0.07)),
}
CORNER = Mesh(np.eye(4, 3), np.array([(0, 1, 2), (0, 1, 3)]))
FRAMES = ('base', 'base_link', 'shoulder_link', 'forearm_link', 'tool0', 'flange')


def body(name, shape, frame='base'):
    return CellBody(
        name=name, shapes=(PlacedShape(shape, ON_BODY),), frame=frame, T_frame_body=PLACE
    )


def node_pose(scene, name):
    """Return the pose in which a node is at last, with that of its parents."""
    parent = name.rpartition('/')[0]
    T = np.eye(4)
    for _, message in scene:
        if message.get('name') == name and 'position' in message:
            T[:3, 3] = message['position']
        if message.get('name') == name and 'wxyz' in message:
            w, x, y, z = message['wxyz']
            T[:3, :3] = Pose((0.0, 0.0, 0.0), (x, y, z, w)).matrix()[:3, :3]
    return node_pose(scene, parent) @ T if parent else T


def meshes(scene):
    """Return the props of the meshes by name."""
    return {
        message['name']: message['props']
        for _, message in scene
        if 'vertices' in message.get('props', {})
    }


def vertices_in_base(scene, name):
    vertices = meshes(scene)[name]['vertices'].reshape(-1, 3)
    T = node_pose(scene, name)
    return vertices @ T[:3, :3].T + T[:3, 3]


@pytest.mark.parametrize('frame', [*FRAMES, 'tool0_controller'])
def test_bodies_are_drawn_where_pinocchio_has_their_frames(frame):
    pinocchio = pytest.importorskip('pinocchio')
    model = pinocchio.buildModelFromXML(robot_description(ARM))
    data = model.createData()
    pinocchio.framesForwardKinematics(
        model, data, pinocchio.integrate(model, pinocchio.neutral(model), np.array(Q))
    )
    seen = data.oMf[model.getFrameId('tool0' if frame == 'tool0_controller' else frame)]
    T = (data.oMf[model.getFrameId('base')].inverse() * seen).homogeneous
    T = T @ (TCP.matrix() if frame == 'tool0_controller' else np.eye(4))
    T = T @ PLACE.matrix() @ ON_BODY.matrix()
    cell = Cell(bodies=tuple(body(name, shape, frame) for name, (shape, _) in SHAPES.items()))
    scene = scenes_of(cell_page(cell, ARM, Q, TCP))['type']
    for k, (_, solid) in enumerate(SHAPES.values()):
        found = vertices_in_base(scene, f'/cell/{k}/0')
        expected = solid.vertices @ T[:3, :3].T + T[:3, 3]
        assert len(found) == len(expected)
        gaps = np.linalg.norm(found[:, None] - expected, axis=2)
        assert max(gaps.min(axis=0).max(), gaps.min(axis=1).max()) < 1e-5


def test_each_body_has_its_name_and_planes_an_end():
    cell = Cell(bodies=(body('table <1>', HalfSpace()), body('fixture/left', CORNER)))
    page = cell_page(cell, ARM, Q, TCP, ('the "table" <1>', 'text'))
    scene = scenes_of(page)['type']
    texts = [m['props']['text'] for _, m in scene if 'text' in m.get('props', {})]
    assert texts == ['table <1>', 'fixture/left']
    assert '<pre>the &quot;table&quot; &lt;1&gt;</pre>' in page
    square = vertices_in_base(scene, '/cell/0/0')
    normal = (PLACE @ ON_BODY).matrix()[:3, 2]
    heights = (square - (PLACE @ ON_BODY).position) @ normal
    assert heights.max() == pytest.approx(0.0, abs=1e-6)
    assert 1.0 < np.ptp(square, axis=0).max() < 3.0
    assert len(vertices_in_base(scene, '/cell/1/0')) == 4


def test_a_refused_goal_shows_the_arm_and_both_bodies_at_the_place():
    cell = Cell(bodies=(body('table', Box((0.1, 0.1, 0.1))), body('can', Cylinder(0.1, 0.1))))
    refusal = CollisionPredicted('points[0].pose: too close.')
    refusal.q, refusal.bodies = (0.5, -1.2, 1.1, -1.0, -1.5, 0.1), ('table', 'forearm_link')
    goal = Goal(waypoints=(Waypoint(pose=ARM.forward(Q) @ TCP),))
    page = refusal_page(goal, refusal, ARM, Q, TCP, PlanningOptions(cell=cell))
    scene = scenes_of(page)['type']
    red = {
        name.rpartition('/')[0]
        for name, props in meshes(scene).items()
        if tuple(props['color']) == (210, 30, 30)
    }
    assert red == {'/cell/0', '/arm/forearm'}
    x, y, z = node_pose(scene, '/arm/wrist_3')[:3, 3]
    assert np.allclose((x, y, z), ARM.forward(refusal.q).position, atol=1e-6)


def test_a_refused_goal_shows_a_held_part_in_the_hand():
    """The part is taken above the table, and would hit a wall on its way."""
    start = ARM.forward(Q) @ TCP
    above, behind = (
        Pose(tuple(np.add(start.position, (0.0, y, 0.0)).tolist()), start.quaternion)
        for y in (0.02, 0.3)
    )
    part, wall = (
        CellBody(
            name=name,
            shapes=(PlacedShape(shape),),
            T_frame_body=Pose(tuple(np.add(start.position, offset).tolist())),
        )
        for name, shape, offset in (
            ('part', Sphere(0.02), (0.0, 0.02, -0.15)),
            ('wall', Box((0.2, 0.02, 0.1)), (0.0, 0.25, -0.15)),
        )
    )
    goal = Goal(
        waypoints=(Waypoint(pose=above), Waypoint(pose=behind)),
        part_changes=(PartChange(waypoint=0, body='part'),),
    )
    options = PlanningOptions(cell=Cell(bodies=(part, wall)))
    with pytest.raises(CollisionPredicted) as caught:
        plan(goal, state_at_rest(ARM, Q, TCP), ARM, options)
    assert set(caught.value.bodies) == {'part', 'wall'}
    scene = scenes_of(refusal_page(goal, caught.value, ARM, Q, TCP, options))['type']
    centre = node_pose(scene, '/cell/0')[:3, 3]
    side = wall.T_frame_body.position[1] - 0.01
    assert side - 0.0051 < centre[1] + 0.02 < side
    assert np.allclose(centre[[0, 2]], np.array(part.T_frame_body.position)[[0, 2]], atol=1e-4)


@pytest.mark.slow
def test_meshes_of_many_triangles_are_drawn_with_fewer_that_look_the_same():
    fine = trimesh.creation.icosphere(6, 0.5)  # 81,920 triangles
    mesh = Mesh(np.array(fine.vertices), np.array(fine.faces))
    cell = Cell(bodies=tuple(body(f'part {k}', mesh) for k in range(4)))
    most = triangles_per_mesh(cell)
    assert 4 * most <= MAX_TRIANGLES
    coarse = trimesh.Trimesh(*coarse_mesh(mesh, most), process=False)
    assert 0.2 * most < len(coarse.faces) <= most
    radii = np.linalg.norm(coarse.vertices, axis=1)
    assert np.allclose(radii, 0.5, atol=0.01)
    assert coarse.volume == pytest.approx(fine.volume, rel=0.02)
    assert len(cell_page(cell, ARM, Q, TCP)) < 2e6


@pytest.mark.slow
def test_a_part_moves_with_the_tool_from_where_it_is_taken_to_where_it_is_put_down():
    """The tool only shifts, so the part is shifted as far as the tool while it is held."""
    start = ARM.forward(Q) @ TCP
    places = [np.add(start.position, shift) for shift in ((0, 0.05, 0), (0, 0.05, 0.1), (0, 0, 0))]
    goal = Goal(
        waypoints=tuple(
            Waypoint(pose=Pose(tuple(place.tolist()), start.quaternion)) for place in places
        ),
        part_changes=(
            PartChange(waypoint=0, body='part'),
            PartChange(waypoint=1, body='part', action=PartAction.RELEASE),
        ),
    )
    at = np.add(start.position, (0.0, 0.3, -0.3))
    part = CellBody(
        name='part',
        shapes=(PlacedShape(Sphere(0.02)),),
        T_frame_body=Pose(tuple(at.tolist())),
    )
    wall = CellBody(
        name='wall',
        shapes=(PlacedShape(Box((0.1, 2.0, 2.0))),),
        T_frame_body=Pose((-1.3, 0.0, 0.0)),
    )
    options = PlanningOptions(cell=Cell(bodies=(wall, part)))
    made = plan(goal, state_at_rest(ARM, Q, TCP), ARM, options)
    page = motion_page(made, ARM, options)
    for scene in scenes_of(page).values():
        of_part, of_wrist = (
            [
                (time, message['position'])
                for time, message in scene
                if message['type'] == 'SetPositionMessage' and message['name'] == name
            ]
            for name in ('/cell/1', '/arm/wrist_3')
        )
        found = np.array([place for _, place in of_part])
        assert np.allclose(found[0], at, atol=1e-5)
        assert np.allclose(found[-1], at + places[1] - places[0], atol=1e-5)
        held = {time: place for time, place in of_part[2:-1]}
        assert len(held) > 20
        wrist = dict(of_wrist)
        offsets = np.array([np.subtract(held[time], wrist[time]) for time in held])
        assert np.ptp(offsets, axis=0).max() < 1e-4
    assert '<b>closest fixed body</b>' in page
    assert '<b>closest on the arm</b>' in page
    assert re.search(r'<title>[^<]*part</title>', page)


@pytest.mark.slow
def test_a_body_on_the_active_tcp_stays_there_if_a_goal_leads_another_place_of_the_tool():
    nozzle = CellBody(name='nozzle', shapes=(PlacedShape(Sphere(0.01)),), frame='tool0_controller')
    start = ARM.forward(Q) @ TCP
    behind = Pose(tuple(np.add(start.position, (0.0, 0.05, 0.0)).tolist()), start.quaternion)
    goal = Goal(
        waypoints=(Waypoint(pose=behind),), T_flange_controlled=TCP @ Pose((0.0, 0.0, -0.04))
    )
    options = PlanningOptions(cell=Cell(bodies=(nozzle,)))
    made = plan(goal, state_at_rest(ARM, Q, TCP), ARM, options)
    assert made.T_flange_tcp != TCP
    for scene in scenes_of(motion_page(made, ARM, options)).values():
        wrist = node_pose(scene, '/arm/wrist_3')
        nozzle_pose = wrist @ TCP.matrix()
        assert np.allclose(node_pose(scene, '/cell/0'), nozzle_pose, atol=1e-5)


@pytest.mark.slow
def test_a_page_without_the_options_of_the_plan_has_no_cell():
    part = CellBody(name='part', shapes=(PlacedShape(Sphere(0.02)),), T_frame_body=PLACE)
    start = ARM.forward(Q) @ TCP
    goal = Goal(
        waypoints=(
            Waypoint(
                pose=Pose(
                    tuple(np.add(start.position, (0.0, 0.05, 0.0)).tolist()), start.quaternion
                )
            ),
        ),
        part_changes=(PartChange(waypoint=0, body='part'),),
    )
    options = PlanningOptions(cell=Cell(bodies=(part,)))
    made = plan(goal, state_at_rest(ARM, Q, TCP), ARM, options)
    (scene, *_) = scenes_of(motion_page(made, ARM)).values()
    assert not any(message.get('name', '').startswith('/cell') for _, message in scene)


def test_of_a_cloud_of_triangles_some_are_drawn():
    """None of them has two corners nearby, and none shares a corner."""
    corners = np.random.default_rng(0).uniform(-1.0, 1.0, (30_000, 3))
    cloud = Mesh(corners, np.arange(30_000).reshape(-1, 3))
    for most in (100, 3000):
        vertices, triangles = coarse_mesh(cloud, most)
        assert 0 < len(triangles) <= most
        assert triangles.max() < len(vertices)
        assert np.ptp(vertices[triangles.reshape(-1)], axis=0).min() > 0.5
    specks = Mesh(
        np.repeat(corners[:1000], 3, axis=0) + 1e-6 * corners[:3000], cloud.triangles[:1000]
    )
    vertices, triangles = coarse_mesh(specks, 100)
    assert 50 < len(triangles) <= 100


def test_meshes_of_few_triangles_are_drawn_as_they_are():
    vertices, triangles = coarse_mesh(CORNER, 2)
    assert vertices is CORNER.vertices
    assert triangles is CORNER.triangles
