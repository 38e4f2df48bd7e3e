# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Cells as files: read, written and read again, and refused with a sentence."""

from math import pi
from pathlib import Path
import re
from time import process_time

from broken_files import broken
import numpy as np
import pytest
from random_cases import cases, random_of
import yaml

from ur_cartesian_driver.motion.cell.cell import Cell, CellBody, FRAMES, LINK_NAMES, PlacedShape
from ur_cartesian_driver.motion.cell.cell_file import (
    cell_from_text,
    cell_text,
    CellFileError,
    read_cell,
)
from ur_cartesian_driver.motion.cell.cell_remarks import cell_remarks
from ur_cartesian_driver.motion.cell.mesh_file import read_mesh
from ur_cartesian_driver.motion.cell.shapes import Box, Cylinder, HalfSpace, Mesh, Sphere
from ur_cartesian_driver.motion.geometry.pose import normalize, Pose

TEXT = """cell: 1
clearance: 0.006
bodies:
  table: {plane: {}, position: [0, 0, -0.01]}
  wall: {box: [0.02, 2.0, 1.5], position: [0.8, 0, 0.75], clearance: 0.03}
  fixture: {mesh: fixture.stl, scale: 0.001, position: [0.4, 0, 0], rpy: [0, 0, 1.57]}
  torch:
    frame: tool0
    shapes:
    - {cylinder: {radius: 0.02, length: 0.3}, position: [0, 0, 0.15]}
    - {sphere: 0.03}
  part: {frame: fixture, box: [0.1, 0.1, 0.1], position: {x: 0.1, y: 0, z: 1e-1}}
may_touch:
- [torch, fixture]
urdf:
- {file: cell.urdf, position: [1, 0, 0], clearance: 0.01, leave_out: [lamp]}
"""
FIXTURE = (
    'solid fixture\n'
    + ''.join(
        'facet normal 0 0 0\nouter loop\n'
        + ''.join(f'vertex {" ".join(map(str, corner))}\n' for corner in corners)
        + 'endloop\nendfacet\n'
        for corners in (
            ((0, 0, 0), (0, 200, 0), (300, 0, 0)),
            ((0, 0, 0), (300, 0, 0), (0, 0, 100)),
            ((0, 0, 0), (0, 0, 100), (0, 200, 0)),
            ((300, 0, 0), (0, 200, 0), (0, 0, 100)),
        )
    )
    + 'endsolid fixture\n'
)
URDF = """<robot name="cell">
  <link name="bench"><collision><geometry><box size="1 2 1"/></geometry></collision></link>
  <link name="lamp"><collision><geometry><sphere radius="1"/></geometry></collision></link>
  <joint name="hangs" type="revolute">
    <parent link="bench"/><child link="lamp"/><origin xyz="0 0 1"/>
  </joint>
</robot>
"""


@pytest.fixture(scope='module')
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp('cell')
    (folder / 'fixture.stl').write_text(FIXTURE)
    (folder / 'cell.urdf').write_text(URDF)
    (folder / 'cell.yaml').write_text(TEXT)
    return folder


def read(text, folder='/nowhere'):
    return cell_from_text(text, 'cell.yaml', folder)


def plain(cell):
    """Return a cell without the arrays of its meshes, so that two can be compared."""
    return [
        (
            body.name,
            body.frame,
            body.T_frame_body,
            body.clearance,
            [
                (placed.T_body_shape, (mesh.source, mesh.scale, mesh.vertices.tolist()))
                if isinstance(mesh := placed.shape, Mesh)
                else placed
                for placed in body.shapes
            ],
        )
        for body in cell.bodies
    ], (cell.may_touch, cell.clearance)


def test_each_field_becomes_what_it_says(folder):
    cell = read_cell(folder / 'cell.yaml')
    table, wall, fixture, torch, part, bench = cell.bodies
    assert (cell.clearance, cell.may_touch) == (0.006, {frozenset(('torch', 'fixture'))})
    assert table == CellBody(
        name='table',
        shapes=(PlacedShape(HalfSpace()),),
        T_frame_body=Pose((0.0, 0.0, -0.01)),
    )
    assert wall.shapes == (PlacedShape(Box((0.02, 2.0, 1.5))),)
    assert (wall.frame, wall.clearance) == ('base', 0.03)
    mesh = fixture.shapes[0].shape
    np.testing.assert_allclose(mesh.bounds, [[0.0, 0.0, 0.0], [0.3, 0.2, 0.1]])
    assert (mesh.source, mesh.scale) == (str(folder / 'fixture.stl'), (1e-3,) * 3)
    assert torch.frame == 'tool0'
    assert torch.shapes == (
        PlacedShape(Cylinder(0.02, 0.3), Pose((0.0, 0.0, 0.15))),
        PlacedShape(Sphere(0.03)),
    )
    # z of the fixture points up, and its x along y of the base, almost.
    assert part.frame == 'base'
    np.testing.assert_allclose(part.T_frame_body.position, (0.4, 0.1, 0.1), atol=1e-4)
    assert (bench.name, bench.clearance, bench.T_frame_body) == ('bench', 0.01, Pose((1.0, 0, 0)))


@pytest.mark.parametrize(
    'turn',
    [
        'rpy: [0, 0, 0.7853981633974483]',
        'rotation_vector: [0, 0, 0.7853981633974483]',
        'orientation: [0, 0, 0.3826834, 0.9238795]',
        'orientation: {x: 0, y: 0, z: 0.3826834, w: 0.9238795}',
    ],
)
def test_all_forms_of_an_orientation_mean_the_same(turn):
    (body,) = read(f'cell: 1\nbodies: {{a: {{sphere: 1, {turn}}}}}').bodies
    assert body.T_frame_body.rotation_vector() == pytest.approx((0, 0, 0, 0, 0, pi / 4))


def test_a_body_stands_on_a_body_that_stands_on_a_link_of_the_arm():
    text = (
        'cell: 1\nbodies:\n'
        '  c: {frame: b, sphere: 1, position: [0, 0, 1]}\n'
        '  b: {frame: a, sphere: 1, rpy: [0, 1.5707963267948966, 0]}\n'
        '  a: {frame: flange, sphere: 1, position: [0, 1, 0]}\n'
    )
    cell = read(text)
    assert [body.name for body in cell.bodies] == ['c', 'b', 'a']
    assert {body.frame for body in cell.bodies} == {'flange'}
    assert cell.body('c').T_frame_body.position == pytest.approx((1.0, 1.0, 0.0))


def test_a_body_may_stand_on_one_of_a_urdf(folder):
    text = TEXT.replace('frame: fixture', 'frame: bench')
    assert read(text, folder).body('part').T_frame_body.position == pytest.approx((1.1, 0, 0.1))


def test_what_a_urdf_leaves_open_is_remarked_on(folder):
    assert cell_remarks(read(TEXT, folder)) == ()
    cell = read(TEXT.replace('lamp', ''), folder)
    assert cell_remarks(cell) == ('The joint hangs of cell.urdf moves; it is taken at 0.',)


def test_one_mesh_is_read_once(folder):
    shape = '{mesh: fixture.stl, scale: 0.001}'
    cell = read(f'cell: 1\nbodies: {{a: {shape}, b: {{shapes: [{shape}, {shape}]}}}}', folder)
    assert len({id(placed.shape) for body in cell.bodies for placed in body.shapes}) == 1


def test_a_cell_without_bodies_is_read_and_written():
    assert read(cell_text(Cell())) == Cell()


def random_pose(random):
    position = tuple(random.choice([0.0, random.uniform(-1.0, 1.0)]) for _ in range(3))
    turn = normalize(tuple(random.gauss(0.0, 1.0) for _ in range(4)))
    return Pose(position, random.choice([(0.0, 0.0, 0.0, 1.0), turn]))


def random_cell(random, mesh):
    names = ['a', '1', 'true', '~', ' x ', 'a: b', '- c', '"', "'", 'ä€😀', 'a  b', '<<', '#'] + [
        f'body {k}' for k in range(5)
    ]
    bodies = []
    for name in random.sample(names, random.randint(0, len(names))):
        frame = random.choice(['base', *FRAMES])
        shapes = [
            Box(tuple(random.uniform(1e-6, 2.0) for _ in range(3))),
            Cylinder(random.uniform(0.1, 1.0), 10.0 ** random.uniform(-9, 1)),
            Sphere(random.uniform(0.1, 1.0)),
            mesh,
        ] + ([HalfSpace()] if FRAMES[frame] == 0 else [])
        bodies.append(
            CellBody(
                name=name,
                shapes=tuple(
                    PlacedShape(random.choice(shapes), random_pose(random))
                    for _ in range(random.randint(1, 3))
                ),
                frame=frame,
                T_frame_body=random_pose(random),
                clearance=random.choice([None, random.uniform(0.0, 1.0)]),
            )
        )
    known = [*LINK_NAMES, *(body.name for body in bodies)]
    pairs = frozenset(frozenset(random.sample(known, 2)) for _ in range(random.randint(0, 4)))
    return Cell(bodies=tuple(bodies), may_touch=pairs, clearance=random.uniform(0.0, 1.0))


@pytest.mark.random
def test_a_cell_is_written_and_read_again(folder):
    mesh = read_mesh(folder / 'fixture.stl', (0.001, 0.002, -0.003))
    for number in range(cases(300)):
        cell = random_cell(random_of('cell', number), mesh)
        again = read(cell_text(cell))
        assert plain(again) == plain(cell)


def test_a_file_is_written_and_read_again(folder):
    cell = read(TEXT, folder)
    assert plain(read(cell_text(cell))) == plain(cell)


def test_a_mesh_of_no_file_cannot_be_written():
    mesh = Mesh(np.eye(3), np.arange(3))
    with pytest.raises(ValueError, match='the mesh of a is of no file, so it cannot be written'):
        cell_text(Cell(bodies=(CellBody(name='a', shapes=(PlacedShape(mesh),)),)))


LONG = 'x' * 1000


@pytest.mark.parametrize(
    ('old', 'new', 'words'),
    [
        (TEXT, '', 'cell.yaml is empty, so it is no cell'),
        (TEXT, 'a: [', 'line 1: this is not YAML'),
        (TEXT, '"\\UFFFFFFFF"', 'this is not YAML: a number is too large'),
        (TEXT, '[' * 5000, 'cell.yaml is no cell: it is nested too deeply'),
        (TEXT, ' ' * 1_000_001, 'cell.yaml is no cell: it is longer than 1 MB'),
        (TEXT, '- 1', 'line 1: the file must have fields'),
        (TEXT, 'bodies: {}', 'line 1: this is no cell: it has no field cell; it begins with'),
        (TEXT, 'cell: 1', 'line 1: bodies is missing, so the file may be cut off'),
        (TEXT, 'cell: 1\nbodies:', 'line 2: bodies must have fields'),
        ('cell: 1', 'cell: 2', 'line 1: cell is 2, a format that is not known; use 1'),
        ('clearance: 0.006', 'clearence: 0.006', 'line 2: clearence is no field of the file; cl'),
        ('clearance: 0.006', 'clearance: true', 'line 2: the clearance of the file is true, whi'),
        ('clearance: 0.006', 'clearance: -1', 'line 2: the clearance is -1 m; it must be from 0'),
        ('clearance: 0.006', 'clearance: nan', 'line 2: the clearance of the file is nan; it mu'),
        ('clearance: 0.03', 'clearance: 5', 'line 5: wall: the clearance is 5 m; it must be from'),
        ('wall:', 'table:', 'line 5: table is given twice; remove one of them'),
        ('wall:', 'bench:', 'line 16: the name "bench" of a link is used twice; put it into lea'),
        ('wall:', 'tool:', 'line 5: tool: "tool" cannot be the name of a body; it is a part of'),
        ('wall:', 'flange:', 'line 5: flange: "flange" cannot be the name of a body; it is a pa'),
        ('wall:', '"":', "line 5: '' cannot be the name of a body; use 1 to 100 characters"),
        ('wall:', '"a\\nb":', 'cannot be the name of a body; use 1 to 100 characters that can'),
        ('wall:', '? [a]\n  :', 'line 5: a field of bodies has no name'),
        ('wall: {', 'wall: {sphere: 1, ', 'line 5: wall has box and sphere; give one of box, cy'),
        ('box: [0.02, 2.0, 1.5], ', '', 'line 5: wall has no shape; give one of box, cylinder,'),
        ('box: [0.02, 2.0, 1.5]', 'bxo: 1', 'line 5: bxo is no field of wall; box is probably m'),
        ('[0.02, 2.0, 1.5]', '[0.02, 2.0]', 'line 5: the box of wall must be 3 numbers'),
        ('[0.02, 2.0, 1.5]', '0.02', 'line 5: the box of wall must be 3 numbers'),
        ('[0.02, 2.0, 1.5]', '[0.02, 2.0, a]', 'line 5: the box of wall is a, which is no numb'),
        ('[0.02, 2.0, 1.5]', '[0.02, 2.0, yes]', 'line 5: the box of wall is yes, which is no n'),
        ('[0.02, 2.0, 1.5]', '[0.02, 2.0, 1e999]', 'the box of wall is inf; it must be finite'),
        ('[0.02, 2.0, 1.5]', '[0.02, 2.0, -1]', 'line 5: wall: the side of a box along z is -1;'),
        ('[0.02, 2.0, 1.5]', '[20, 2000, 1500]', 'line 5: wall: the side of a box along y is 20'),
        ('[0.8, 0, 0.75]', '[800, 0, 0.75]', 'line 5: wall: its position has x = 800 m; at mos'),
        ('[0.8, 0, 0.75]', '[0.8, 0]', 'line 5: the position of wall must be 3 numbers, x y z'),
        ('[0.8, 0, 0.75]', '{x: 1, y: 1}', 'line 5: the position of wall has no z'),
        ('[0.8, 0, 0.75]', '[[1], 0, 1]', 'line 5: position of wall must be one value'),
        ('plane: {}', 'plane: {z: 1}', 'line 4: the plane of table has no fields; write plane'),
        ('plane: {}', 'plane: {}, scale: 2', 'line 4: table is no mesh, so it can have no scale'),
        ('plane: {}', 'plane: {}, frame: tool0', 'line 4: table: a plane has no end, so it can'),
        ('fixture.stl', 'no.stl', 'line 6: fixture: its file cannot be read: No such file or di'),
        ('fixture.stl', '.', 'line 6: fixture: the mesh '),
        ('fixture.stl', '"a\\0.stl"', 'line 6: "a\ufffd.stl" cannot be the name of a file'),
        ('fixture.stl', '"\\ud800.stl"', 'line 6: "\ufffd.stl" cannot be the name of a file'),
        ('fixture.stl', '', 'line 6: "" cannot be the name of a file'),
        ('fixture.stl', 'a.step', 'line 6: fixture: the mesh a.step is STEP; STL and OBJ are re'),
        (', scale: 0.001', '', 'line 6: fixture: the mesh fixture.stl cannot be used: the mesh i'),
        ('scale: 0.001', 'scale: [1, 2]', 'line 6: the scale of fixture must be 3 numbers'),
        ('scale: 0.001', 'scale: 0', 'line 6: fixture: the scale is 0; for a file in millimetres'),
        ('rpy: [0, 0, 1.57]', 'rpy: [0, 0, 90]', 'line 6: the rpy of fixture has an angle of mo'),
        ('rpy: [0, 0, 1.57]', 'rpy: [0, 0, 1], orientation: [0, 0, 0, 1]', 'line 6: fixture has'),
        ('rpy: [0, 0, 1.57]', 'orientation: [0, 0, 1, 1]', 'line 6: the orientation of fixture h'),
        ('rpy: [0, 0, 1.57]', 'orientation: [0, 0, 0, 0]', 'has the length 0 instead of 1; the o'),
        ('frame: tool0', 'frame: tool1', 'line 8: the frame of torch is tool1, which is neither'),
        ('frame: tool0', 'frame: torch', 'line 8: the frames go round in a circle: torch on tor'),
        ('frame: tool0', f'frame: {LONG}', 'line 8: the frame of torch is xxx'),
        ('frame: tool0', 'mesh: a.stl', 'line 8: torch has shapes, so it can have no mesh'),
        ('    - {cylinder', '    - {mass: 1, cylinder', 'line 10: mass is no field of a shape of'),
        ('{radius: 0.02, length: 0.3}', '0.02', 'line 10: cylinder of torch must have fields'),
        ('{radius: 0.02, length: 0.3}', '{radius: 1}', 'line 10: cylinder of torch has no length'),
        ('{radius: 0.02,', '{radius: 0,', 'line 10: torch: the radius of a cylinder is 0; it mu'),
        ('[torch, fixture]', '[torch, fixtur]', 'line 14: may_touch names "fixtur", which the ce'),
        ('[torch, fixture]', '[torch]', 'line 14: a pair of may_touch must be two names'),
        ('[torch, fixture]', '[torch, torch]', 'line 14: may_touch: "torch" is no pair of two n'),
        ('[torch, fixture]', 'torch', 'line 14: a pair of may_touch must be two names'),
        ('cell.urdf', 'no.urdf', 'line 16: urdf: its file cannot be read: No such file or direct'),
        ('file: cell.urdf', 'leave_out: []', 'is given twice'),
        ('[lamp]', '[lam]', 'line 16: urdf: cell.urdf has no link lam, which leave_out na'),
        ('- {file', '{file', 'not YAML'),
    ],
)  # fmt: skip
def test_a_file_that_is_no_cell_is_refused_with_its_line(folder, old, new, words):
    assert old in TEXT
    with pytest.raises(CellFileError) as error:
        read(TEXT.replace(old, new, 1), folder)
    text = str(error.value)
    assert words in text
    assert text.startswith('cell.yaml')
    assert text.endswith('.')
    assert len(text) < 400
    assert text.isprintable()


def test_a_circle_of_frames_is_named():
    bodies = ''.join(f'  {a}: {{frame: {b}, sphere: 1}}\n' for a, b in ('wa', 'ab', 'bc', 'ca'))
    with pytest.raises(CellFileError, match=r'line 4: .* in a circle: a on b on c on a\.'):
        read(f'cell: 1\nbodies:\n{bodies}')


def test_a_damaged_file_beside_the_cell_is_named_with_its_line(folder, tmp_path):
    for name in ('cell.urdf', 'fixture.stl'):
        (tmp_path / name).write_bytes((folder / name).read_bytes())
    (tmp_path / 'cell.urdf').write_text(URDF.replace('box', 'bxo'))
    with pytest.raises(CellFileError, match=r'line 16: urdf: line 2 of cell.urdf has a collision'):
        read(TEXT, tmp_path)
    (tmp_path / 'fixture.stl').write_text(FIXTURE.replace('300', 'a', 1))
    with pytest.raises(
        CellFileError, match=r'line 6: fixture: line 6 of the mesh fixture.stl has'
    ):
        read(TEXT, tmp_path)


def test_files_that_cannot_be_read(tmp_path):
    with pytest.raises(FileNotFoundError):
        read_cell(tmp_path / 'cell.yaml')
    with pytest.raises(IsADirectoryError):
        read_cell(tmp_path)
    (tmp_path / 'cell.yaml').write_bytes(b'\xff\xfe\x00')
    with pytest.raises(CellFileError, match=r'cell\.yaml is no text in UTF-8, so it is no cell'):
        read_cell(tmp_path / 'cell.yaml')


@pytest.mark.slow
def test_a_short_text_with_very_many_shapes_is_refused_soon():
    shapes = ', '.join(['*s'] * 2000)
    bodies = ', '.join(f'b{k}: *b' for k in range(2000))
    text = (
        f'cell: 1\nbodies: {{a: {{shapes: [&s {{sphere: 1}}]}}, b: &b {{shapes: [{shapes}]}}, '
        f'{bodies}}}'
    )
    start = process_time()
    with pytest.raises(CellFileError, match='line 2: the cell has more than 10000 shapes'):
        read(text)
    assert process_time() - start < 5.0


def test_what_the_docstring_shows_is_a_cell(folder):
    import ur_cartesian_driver.motion.cell.cell_file as module

    shown = module.__doc__.split('::\n')[1].split('\nPositions')[0]
    assert yaml.safe_load(shown)['cell'] == 1
    text = '\n'.join(line[4:] for line in shown.splitlines())
    assert [body.name for body in read(text, folder).bodies][-1] == 'bench'


@pytest.mark.random
def test_a_broken_file_is_a_cell_or_one_sentence(folder):
    other = cell_text(read(TEXT, folder))
    found, refusals, slowest = 0, [], 0.0
    for number in range(cases(3000)):
        text = broken([TEXT, other], random_of('broken cell', number))
        start = process_time()
        try:
            cell = read(text, folder)
        except CellFileError as error:
            refusals.append(str(error))
        else:
            assert plain(read(cell_text(cell))) == plain(cell)
            found += 1
        slowest = max(slowest, process_time() - start)
    assert found > 0.02 * cases(3000)
    assert len(refusals) > 0.5 * cases(3000)
    assert slowest < 2.0
    for refusal in refusals:
        assert re.fullmatch(r'cell\.yaml(, line \d+:| is |: this is not YAML).*\.', refusal)
        assert refusal.isprintable()
        assert 'Node(' not in refusal
        assert 'Error' not in refusal


def test_a_name_of_a_file_may_be_absolute_or_in_another_folder(folder):
    for name in (folder / 'fixture.stl', Path('..', folder.name, 'fixture.stl')):
        cell = read(f'cell: 1\nbodies: {{a: {{mesh: {name}, scale: 0.001}}}}', folder)
        assert len(cell.bodies[0].shapes[0].shape.triangles) == 4
