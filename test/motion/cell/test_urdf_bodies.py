# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Bodies of URDF files: where pinocchio has them, or refused with a sentence."""

from collections import defaultdict
from pathlib import Path
from random import Random
import re

from broken_files import broken
import numpy as np
import pytest
from random_cases import cases, random_of

from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.kinematics.robot_description import robot_description
from ur_cartesian_driver.kinematics.robot_models import robot_model
from ur_cartesian_driver.motion.cell.cell import Cell, FRAMES
from ur_cartesian_driver.motion.cell.shapes import Box, Cylinder, Mesh, Sphere
from ur_cartesian_driver.motion.cell.urdf_bodies import read_urdf, urdf_bodies, UrdfError
from ur_cartesian_driver.motion.geometry.pose import (
    Pose,
    quaternion_from_roll_pitch_yaw,
    roll_pitch_yaw_from_quaternion,
)

STL = """\
solid
facet normal 0 0 0
outer loop
vertex 0 0 0
vertex 1 0 0
vertex 0 1 0
endloop
endfacet
endsolid
"""


def origin(random):
    xyz, rpy = ([random.uniform(-2.0, 2.0) for _ in range(3)] for _ in '12')
    return f'<origin xyz="{xyz[0]!r} {xyz[1]} {xyz[2]}" rpy="{rpy[0]} {rpy[1]} {rpy[2]}"/>'


def shape(random):
    a, b, c = (random.uniform(0.01, 2.0) for _ in range(3))
    return random.choice(
        [
            f'<box size="{a} {b} {c}"/>',
            f'<cylinder radius="{a}" length="{b}"/>',
            f'<sphere radius="{a}"/>',
            f'<mesh filename="part.stl" scale="{a} {b} -{c}"/>',
            '<mesh filename="part.stl"/>',
        ]
    )


def link(name, random):
    collisions = ''.join(
        f'<collision>{origin(random)}<geometry>{shape(random)}</geometry></collision>\n'
        for _ in range(random.randint(0, 2))
    )
    visual = '<visual><geometry><box size="1 1 1"/></geometry></visual>'
    return f'<link name="{name}">{visual}\n{collisions}</link>\n'


def joint(child, parent, random, kinds=('fixed', 'fixed', 'revolute', 'prismatic', 'continuous')):
    kind = random.choice(kinds)
    limit = '' if kind == 'fixed' else '<limit lower="-1" upper="1" effort="1" velocity="1"/>'
    axis = '' if kind == 'fixed' else '<axis xyz="0 1 0"/>'
    return (
        f'<joint name="to_{child}" type="{kind}">{origin(random)}<parent link="{parent}"/>\n'
        f'<child link="{child}"/>{axis}{limit}</joint>\n'
    )


def elements(random, count, parents):
    """Return links and joints in a random order; each link stands on one before."""
    parts = []
    names = list(parents)
    for k in range(count):
        name = f'link_{k}'
        parts += [link(name, random)]
        if names:
            parts += [joint(name, random.choice(names), random)]
        names.append(name)
    random.shuffle(parts)
    return ''.join(parts)


def judged(text, folder):
    """Return the shapes of each link as pinocchio has them: (4, 4) in the root, and geometry."""
    pinocchio = pytest.importorskip('pinocchio')
    model = pinocchio.buildModelFromXML(text)
    geometry = pinocchio.buildGeomFromUrdfString(
        model, text, pinocchio.GeometryType.COLLISION, package_dirs=[str(folder)]
    )
    data, geometry_data = model.createData(), geometry.createData()
    zero = pinocchio.neutral(model)
    pinocchio.updateGeometryPlacements(model, data, geometry, geometry_data, zero)
    pinocchio.updateFramePlacements(model, data)
    found = defaultdict(list)
    for each, place in zip(geometry.geometryObjects, geometry_data.oMg, strict=True):
        name = model.frames[each.parentFrame].name
        found[name].append((place.homogeneous, each))
    frames = {f.name: data.oMf[k].homogeneous for k, f in enumerate(model.frames)}
    return found, frames


def same_shape(ours, theirs):
    match ours:
        case Box(size):
            np.testing.assert_allclose(2.0 * theirs.geometry.halfSide, size, rtol=1e-9)
        case Cylinder(radius, length):
            sizes = (theirs.geometry.radius, 2.0 * theirs.geometry.halfLength)
            np.testing.assert_allclose(sizes, (radius, length), rtol=1e-9)
        case Sphere(radius):
            assert theirs.geometry.radius == pytest.approx(radius, rel=1e-9)
        case Mesh(scale=scale):
            np.testing.assert_allclose(theirs.meshScale, scale, rtol=1e-9)


def compare(bodies, found, T_root_frame):
    assert {body.name for body in bodies} == set(found)
    for body in bodies:
        assert len(body.shapes) == len(found[body.name])
        for placed, (matrix, theirs) in zip(body.shapes, found[body.name], strict=True):
            T = T_root_frame(body) @ (body.T_frame_body @ placed.T_body_shape).matrix()
            np.testing.assert_allclose(T, matrix, atol=1e-9)
            same_shape(placed.shape, theirs)


@pytest.mark.random
def test_each_body_is_where_pinocchio_has_it(tmp_path):
    (tmp_path / 'part.stl').write_text(STL)
    T_base_root = Pose((1.0, 2.0, 3.0), quaternion_from_roll_pitch_yaw(0.1, 0.2, 0.3))
    for number in range(cases(300)):
        random = random_of('urdf', number)
        parts = elements(random, random.randint(1, 8), []).replace(
            'part.stl', f'package://{tmp_path.name}/part.stl'
        )
        text = f'<robot name="cell">{parts}</robot>'
        found, _ = judged(text, tmp_path.parent)
        text = text.replace(f'package://{tmp_path.name}/', '')
        read = urdf_bodies(text.encode(), 'cell.urdf', tmp_path, T_base_root)
        compare(read.bodies, found, lambda _: np.linalg.inv(T_base_root.matrix()))


@pytest.mark.random
@pytest.mark.parametrize('prefix', ['', 'left_'])
def test_beside_the_arm_each_body_is_where_pinocchio_has_it(tmp_path, prefix):
    (tmp_path / 'part.stl').write_text(STL)
    arm = re.sub(
        '(?s)<(visual|collision)>.*?</(visual|collision)>',
        '',
        robot_description(Arm(robot_model('ur5e')), prefix),
    )
    arms = {prefix + name for name in (*FRAMES, 'base_link_inertia')}
    carried = 0
    for number in range(cases(100)):
        random = random_of('urdf with arm', number)
        parents = [f'{prefix}{name}' for name in ('base_link', 'forearm_link', 'tool0', 'flange')]
        parts = elements(random, random.randint(1, 8), ['world', *parents])
        parts += '<link name="world"/>\n' + joint(f'{prefix}base_link', 'world', random)
        parts = parts.replace('part.stl', f'package://{tmp_path.name}/part.stl')
        text = arm.replace('</robot>', f'{parts}</robot>')
        found, frames = judged(text, tmp_path.parent)
        text = text.replace(f'package://{tmp_path.name}/', '')
        read = urdf_bodies(text.encode(), 'cell.urdf', tmp_path)
        assert not arms & {body.name for body in read.bodies}
        compare(read.bodies, found, lambda body, f=frames: f[prefix + body.frame])
        carried += sum(body.is_carried for body in read.bodies)
        moving = set(re.findall(r'name="(to_\w+)" type="(?!fixed)', text))
        said = {remark.split()[2] for remark in read.remarks}
        assert said <= moving
        Cell(bodies=read.bodies)
    assert carried > 0.3 * cases(100)


def test_angles_become_the_rotation_that_pinocchio_has():
    rpy = pytest.importorskip('pinocchio').rpy
    for seed in range(100):
        random = Random(seed)
        angles = [random.uniform(-7.0, 7.0) for _ in range(3)]
        q = quaternion_from_roll_pitch_yaw(*angles)
        expected = rpy.rpyToMatrix(*angles)
        np.testing.assert_allclose(Pose(quaternion=q).matrix()[:3, :3], expected, atol=1e-12)
        again = roll_pitch_yaw_from_quaternion(q)
        np.testing.assert_allclose(rpy.rpyToMatrix(*again), expected, atol=1e-9)


URDF = """<?xml version="1.0"?>
<robot name="cell">
  <link name="world"/>
  <link name="bench">
    <collision>
      <origin xyz="0 0 0.5"/>
      <geometry><box size="1 2 1"/></geometry>
    </collision>
  </link>
  <link name="lamp">
    <collision><geometry><sphere radius="0.1"/></geometry></collision>
  </link>
  <joint name="stands" type="fixed">
    <parent link="world"/>
    <child link="bench"/>
  </joint>
  <joint name="hangs" type="revolute">
    <origin xyz="0 0 2"/>
    <parent link="bench"/>
    <child link="lamp"/>
  </joint>
</robot>
"""
BOX = '<box size="1 2 1"/>'


def read(text, **options):
    return urdf_bodies(text.encode(errors='surrogatepass'), 'cell.urdf', Path('/'), **options)


def test_joints_that_move_are_said():
    found = read(URDF, clearance=0.02)
    assert found.remarks == ('The joint hangs of cell.urdf moves; it is taken at 0.',)
    assert [body.clearance for body in found.bodies] == [0.02, 0.02]
    assert not read(URDF, leave_out=['lamp']).remarks


def test_a_link_that_is_called_like_one_of_the_arm_is_a_body_where_there_is_no_arm():
    text = URDF.replace('lamp', 'gripper_base_link')
    assert [body.name for body in read(text).bodies] == ['bench', 'gripper_base_link']


def test_meshes_are_found_by_all_three_kinds_of_names(tmp_path, monkeypatch):
    share = tmp_path / 'share' / 'my_cell'
    share.mkdir(parents=True)
    (share / 'package.xml').write_text('')
    (share / 'a part.stl').write_text(STL)
    (share / 'cell.urdf').write_text(
        ''.join(
            [
                '<robot name="cell"><link name="part">',
                *(
                    f'<collision><geometry><mesh filename="{name}"/></geometry></collision>'
                    for name in (
                        'a part.stl',
                        'package://my_cell/a part.stl',
                        (share / 'a part.stl').as_uri(),
                    )
                ),
                '</link></robot>',
            ]
        )
    )
    monkeypatch.setenv('AMENT_PREFIX_PATH', str(tmp_path))
    (body,) = read_urdf(share / 'cell.urdf').bodies
    assert {placed.shape.source for placed in body.shapes} == {str(share / 'a part.stl')}
    assert len(body.shapes) == 3


@pytest.mark.parametrize(
    ('old', 'new', 'words'),
    [
        (URDF, '', 'line 1 of cell.urdf is no XML: no element found'),
        (URDF, URDF[:200], 'line 9 of cell.urdf is no XML: unclosed token'),
        (URDF, '<sdf/>', 'line 1 of cell.urdf is no URDF: it begins with <sdf>, not <robot>'),
        (URDF, '<robot name="a"/>', 'line 1 of cell.urdf has no link'),
        ('<robot', '<!DOCTYPE a [<!ENTITY b "c">]>\n<robot', 'line 2 of cell.urdf defines an ent'),
        ('version="1.0"', 'version="1.0" encoding="klingon"', 'line 1 of cell.urdf is no XML'),
        ('<link name="world"/>', '<xacro:arm/>', 'line 3 of cell.urdf is no URDF yet: it has <xa'),
        ('<link name="world"/>', '', 'line 14 of cell.urdf has no link world, which a joint na'),
        ('<link name="world"/>', '<link/>', 'line 3 of cell.urdf has a <link> without name'),
        ('"lamp"', '"bench"', 'line 10 of cell.urdf uses the name bench for two links'),
        ('name="world"/>', 'name="world"/><link name="a"/>', 'has two roots, world and a; conne'),
        ('<parent link="world"/>', '<parent link="lamp"/>', 'back to it'),
        ('<child link="lamp"/>', '<child link="bench"/>', 'line 17 of cell.urdf has the link ben'),
        ('<child link="lamp"/>', '', 'line 17 of cell.urdf has the joint hangs without <child>'),
        ('revolute', 'screw', 'line 17 of cell.urdf has the joint hangs of the type screw, which'),
        ('0 0 2', '0 0', 'line 18 of cell.urdf has xyz="0 0" in <origin>; it must be three fin'),
        ('0 0 2', '0 0 nan', 'line 18 of cell.urdf has xyz="0 0 nan" in <origin>; it must be'),
        ('0 0 2', '0 0 2000', 'line 10 of cell.urdf has the link lamp: its position has z = 2000'),
        (BOX, '', 'line 5 of cell.urdf has a collision of bench without a shape'),
        (BOX, '<cone/>', 'line 7 of cell.urdf has a collision of bench: a cone is not known'),
        ('1 2 1', '1 0 1', 'line 7 of cell.urdf has a collision of bench: the side of a box alo'),
        ('radius', 'r', 'line 11 of cell.urdf has a <sphere> without radius'),
        (BOX, '<mesh filename="/no.stl"/>', 'line 7 of cell.urdf needs a file: the mesh of bench'),
        (BOX, '<mesh filename="a.dae"/>', 'bench: the mesh a.dae is COLLADA; STL and OBJ are'),
        (BOX, '<mesh filename="package://no/a.stl"/>', 'the package no of a mesh is not install'),
        (BOX, '<mesh filename="http://a/b.stl"/>', 'http://a/b.stl is neither package:// nor'),
        ('"bench"', '"base_link"', '"base_link" cannot be the name of a body; it is a part of'),
    ],
)  # fmt: skip
def test_a_file_that_cannot_be_used_is_refused_with_its_line(old, new, words):
    assert old in URDF
    with pytest.raises(UrdfError) as error:
        read(URDF.replace(old, new))
    assert words in str(error.value)


def arms(*prefixes):
    names = [name for name in FRAMES if name.endswith('_link')]
    parts = [URDF.removesuffix('</robot>\n')]
    for prefix in prefixes:
        parents = ['world', *(prefix + name for name in names)]
        for parent, name in zip(parents, names, strict=False):
            parts += [
                f'<link name="{prefix}{name}"/><joint name="{prefix}j_{name}" type="fixed">'
                f'<parent link="{parent}"/><child link="{prefix}{name}"/></joint>'
            ]
    return ''.join([*parts, '</robot>'])


def test_a_cycle_beside_a_root_is_refused():
    loop = ''.join(
        f'<link name="{a}"/><joint name="{a}" type="fixed"><parent link="{b}"/><child link="{a}"/>'
        '</joint>'
        for a, b in ('xy', 'yz', 'zx')
    )
    with pytest.raises(UrdfError, match='joints that lead from the link x back to it'):
        read(URDF.replace('</robot>', f'{loop}</robot>'))


def test_of_two_arms_one_has_to_be_left_out():
    with pytest.raises(UrdfError, match='has two arms, with the prefixes "a_" and "b_"; put'):
        read(arms('a_', 'b_'))
    other = [f'b_{name}' for name in FRAMES if name.endswith('_link')]
    assert len(read(arms('a_', 'b_'), leave_out=other).bodies) == 2


def test_a_place_beside_the_arm_is_refused():
    with pytest.raises(UrdfError, match=r'has the arm itself .its link ur_base_link.'):
        read(arms('ur_'), T_base_root=Pose())


def test_a_link_to_leave_out_that_is_not_there_is_refused():
    with pytest.raises(UrdfError, match='has no link lam, which leave_out names; did you mean la'):
        read(URDF, leave_out=['lam'])


@pytest.mark.random
def test_a_broken_file_gives_bodies_or_one_sentence():
    found, refusals = 0, []
    for number in range(cases(3000)):
        try:
            Cell(bodies=read(broken([URDF, arms('ur_')], random_of('urdf', number))).bodies)
        except UrdfError as error:
            refusals.append(str(error))
        else:
            found += 1
    assert found > 0.02 * cases(3000)
    assert len(refusals) > 0.5 * cases(3000)
    for refusal in refusals:
        assert re.match(r'(line \d+ of )?cell\.urdf ', refusal)
        assert refusal.isprintable()
