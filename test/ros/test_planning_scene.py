# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Objects of MoveIt's planning scene become bodies of the cell, or are refused in a sentence."""

import re
from types import SimpleNamespace as Message

import numpy as np
from planning_scenes import (
    APPEND,
    BOX,
    box,
    CONE,
    CYLINDER,
    held,
    MOVE,
    pose,
    primitive,
    REMOVE,
    scene,
    SPHERE,
    thing,
)
import pytest

from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.kinematics.robot_models import robot_model
from ur_cartesian_driver.motion.cell.cell import Cell, CellBody, PlacedShape
from ur_cartesian_driver.motion.cell.shapes import Box, Cylinder, HalfSpace, Mesh, Sphere
from ur_cartesian_driver.motion.geometry.pose import Pose
from ur_cartesian_driver.motion.goal.known_frames import Frames
from ur_cartesian_driver.motion.state.rtde_state import RobotState
from ur_cartesian_driver.ros.messages.planning_scene import SceneArm, SceneBodies, updated_scene

Q = (0.3, -1.2, 1.1, -1.5, -1.4, 0.2)
TCP = Pose((0.0, 0.0, 0.1))
ARM = Arm(robot_model('ur5e'))
STATE = RobotState(
    timestamp=0.0, actual_q=Q, T_flange_tcp=TCP, actual_tcp_pose=ARM.forward(Q) @ TCP
)
OWN = CellBody(name='own', shapes=(PlacedShape(Sphere(0.1)),))
EMPTY = SceneBodies(cell=Cell(bodies=(OWN,)))


def after(*messages, before=EMPTY, state=STATE, prefix=''):
    for message in messages:
        place = SceneArm(arm=ARM, state=state, frames=Frames(prefix), prefix=prefix)
        before = updated_scene(before, message, place)
    return before


def in_base(body):
    """Return the matrix of a body, by the kinematics of the flange."""
    matrix = body.T_frame_body.matrix()
    return ARM.forward(Q).matrix() @ matrix if body.frame == 'tool0' else matrix


def test_shapes_have_the_sizes_and_places_of_the_message():
    tetrahedron = Message(
        vertices=[Message(x=x, y=y, z=z) for x, y, z in ((0, 0, 0), (1, 0, 0), (0, 1, 0))],
        triangles=[Message(vertex_indices=[0, 1, 2])],
    )
    item = thing(
        'all',
        at=pose(x=1.0, turn=(0.0, 0.0, np.pi / 2)),
        primitives=[
            primitive(BOX, 0.1, 0.2, 0.3),
            primitive(SPHERE, 0.4),
            primitive(CYLINDER, 0.5, 0.06),
        ],
        primitive_poses=[pose(), pose(x=0.2), pose(z=0.3)],
        meshes=[tetrahedron],
    )
    body = after(scene(item)).cell.body('all')
    shapes = [each.shape for each in body.shapes]
    assert shapes[:3] == [Box((0.1, 0.2, 0.3)), Sphere(0.4), Cylinder(radius=0.06, length=0.5)]
    assert isinstance(shapes[3], Mesh)
    assert shapes[3].triangles.tolist() == [[0, 1, 2]]
    sphere = body.T_frame_body @ body.shapes[1].T_body_shape
    assert sphere.position == pytest.approx((1.0, 0.2, 0.0))


@pytest.mark.parametrize('coef', [(0, 0, 2, -1), (0, 0, -1, 0.3), (1, 2, -3, 0.7), (-1, 0, 0, 0)])
def test_a_plane_is_solid_behind_its_normal(coef):
    item = thing('wall', planes=[Message(coef=list(coef))], at=pose(0.1, 0.2, 0.3))
    body = after(scene(item)).cell.body('wall')
    (placed,) = body.shapes
    assert placed.shape == HalfSpace()
    points = np.random.default_rng(0).uniform(-1.0, 1.0, (50, 3))
    T = np.linalg.inv((body.T_frame_body @ placed.T_body_shape).matrix())
    heights = points @ T[2, :3] + T[2, 3]
    expected = (points - (0.1, 0.2, 0.3)) @ np.array(coef[:3]) + coef[3]
    np.testing.assert_allclose(heights, expected / np.linalg.norm(coef[:3]), atol=1e-9)


def test_frames_are_resolved_where_the_arm_is_now():
    found = after(
        scene(
            box('a', frame='base_link', at=pose(x=0.5)),
            box('b', frame='tool0', at=pose(z=0.2)),
            box('c', frame='', at=pose(x=0.5)),
        )
    ).cell
    assert {body.frame for body in found.bodies} == {'base'}
    assert found.body('a').T_frame_body.position == pytest.approx((-0.5, 0.0, 0.0))
    expected = (ARM.forward(Q) @ Pose((0.0, 0.0, 0.2))).position
    assert found.body('b').T_frame_body.position == pytest.approx(expected)
    prefixed = after(scene(box('a', frame='left_base')), prefix='left_')
    assert prefixed.cell.names == {'own', 'a'}


def test_objects_come_change_and_go():
    first = after(scene(box('a', at=pose(x=1.0)), box('b')))
    assert first.names == {'a', 'b'}
    moved = after(scene(thing('a', MOVE, at=pose(x=2.0))), before=first)
    assert moved.cell.body('a').T_frame_body.position[0] == 2.0
    more = after(scene(box('a', operation=APPEND, at=pose(x=2.5))), before=moved)
    places = [each.T_body_shape.position[0] for each in more.cell.body('a').shapes]
    assert places == pytest.approx([0.0, 0.5])
    assert after(scene(thing('a', REMOVE)), before=more).cell.names == {'own', 'b'}
    assert after(scene(thing('', REMOVE)), before=more).cell.names == {'own'}
    assert after(scene(thing('never seen', REMOVE)), before=more).cell == more.cell
    whole = after(scene(box('c'), is_diff=False), before=more)
    assert whole.cell.names == {'own', 'c'}


def test_an_object_of_the_scene_is_taken_and_put_down_where_it_is():
    world = after(scene(box('part', at=pose(0.4, -0.2, 0.1))))
    place = in_base(world.cell.body('part'))
    # MoveIt also removes the object from the world.
    message = scene(
        thing('part', REMOVE), attached=[held(thing('part'), touch=['tool0', 'finger'])]
    )
    taken = after(message, before=world)
    body = taken.cell.body('part')
    assert body.frame == 'tool0'
    np.testing.assert_allclose(in_base(body), place, atol=1e-9)
    assert taken.cell.may_touch == {frozenset({'part', 'tool'})}
    put = after(scene(attached=[held(thing('part', REMOVE))]), before=taken).cell.body('part')
    assert put.frame == 'base'
    np.testing.assert_allclose(in_base(put), place, atol=1e-9)


def test_an_attached_object_has_its_place_on_the_link():
    in_link = held(box('a', frame='tool0', at=pose(z=0.1)))
    elsewhere = held(box('b', at=pose(0.4, -0.2, 0.1)), touch=['a', 'wrist_3_link'])
    cell = after(scene(attached=[in_link, elsewhere])).cell
    assert cell.body('a').T_frame_body.position == pytest.approx((0.0, 0.0, 0.1))
    assert in_base(cell.body('b'))[:3, 3] == pytest.approx((0.4, -0.2, 0.1))
    assert frozenset({'a', 'b'}) in cell.may_touch
    assert frozenset({'b', 'wrist_3_link'}) in cell.may_touch
    # A state that is no difference says what is attached in all.
    other = scene()
    other.robot_state.is_diff = False
    assert after(other, before=SceneBodies(cell=cell, names=frozenset('ab'))).cell.names == {'own'}


WRONG = [
    (scene(box('own')), 'object "own": the cell has another body of this name'),
    (scene(box('a', frame='nowhere')), 'object "a": header.frame_id is "nowhere", which is not a'),
    (scene(thing('a', primitives=[primitive(CONE, 1, 1)])), 'a primitive is no box, sphere or cy'),
    (scene(thing('a', primitives=[primitive(BOX, 1)])), 'a primitive has 1 dimensions'),
    (scene(box('a', size=-1.0)), 'object "a": the side of a box along x is -1; it must be'),
    (scene(box('a', size=np.nan)), 'the side of a box along x is nan'),
    (scene(thing('a')), 'object "a": it has no shape'),
    (scene(box('')), 'cannot be the name of a body'),
    (scene(box('a', at=pose(x=np.inf))), 'a pose has a number that is not finite'),
    (scene(thing('a', planes=[Message(coef=[0, 0, 0, 1])])), 'a plane has no normal'),
    (scene(thing('a', meshes=[Message(vertices=[], triangles=[])])), 'the mesh has no triangle'),
    (scene(box('a', primitive_poses=[pose()] * 2)), 'primitive_poses has 2 entries for 1 shapes'),
    (scene(thing('a', MOVE)), 'the cell has no body "a"'),
    (
        scene(box('a', operation=bytes([9]))),
        'object "a": its operation is 9, which is none of 0 to 3',
    ),
    (scene(attached=[held(box('a'), link='gripper')]), '"gripper" is no link of this arm'),
    (scene(attached=[held(thing('a', planes=[Message(coef=[0, 0, 1, 0])]))]), 'a plane has no en'),
    (scene(octomap=b'\x01'), 'it has an octomap, of which nothing is checked'),
]


@pytest.mark.parametrize(('message', 'text'), WRONG)
def test_what_cannot_be_honoured_is_said_in_a_clause(message, text):
    with pytest.raises(ValueError, match=re.escape(text)) as error:
        after(message)
    assert '\n' not in str(error.value)


def test_an_arm_whose_place_is_not_known_takes_fixed_objects_only():
    assert after(scene(box('a')), state=None).cell.names == {'own', 'a'}
    for message in (
        scene(box('a', frame='tool0')),
        scene(box('a'), attached=[held(box('b'))]),
    ):
        with pytest.raises(ValueError, match='report'):
            after(message, state=None)
