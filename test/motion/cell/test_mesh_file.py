# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Meshes of STL and OBJ files: as other readers have them, or refused with a sentence."""

from random import Random
import re
from time import process_time

from broken_files import broken
import numpy as np
import pytest
from random_cases import cases, random_of

from ur_cartesian_driver.motion.cell.cell import Cell, CellBody, PlacedShape
from ur_cartesian_driver.motion.cell.cell_remarks import cell_remarks
from ur_cartesian_driver.motion.cell.mesh_file import MeshFileError, read_mesh

#: A tetrahedron.
CORNERS = np.array([[0.0, 0.0, 0.0], [0.3, 0.0, 0.0], [0.0, 0.2, 0.0], [0.0, 0.0, 0.1]])
FACES = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])


def text_stl(corners=CORNERS, faces=FACES):
    lines = [f'  vertex {" ".join(map(repr, corner))}\n' for corner in corners.tolist()]
    facets = (
        'facet normal 0 0 0\n outer loop\n'
        + ''.join(lines[k] for k in face)
        + ' endloop\nendfacet\n'
        for face in faces.tolist()
    )
    return f'solid part of steel\n{"".join(facets)}endsolid part\n'


def binary_stl(corners=CORNERS, faces=FACES, header=b'solid, as many programs write', count=None):
    facet = np.dtype([('normal', '<f4', 3), ('corners', '<f4', (3, 3)), ('attribute', '<u2')])
    rows = np.zeros(len(faces), facet)
    rows['corners'] = corners[faces]
    count = len(faces) if count is None else count
    return header.ljust(80, b'\0') + count.to_bytes(4, 'little') + rows.tobytes()


def obj(corners=CORNERS, faces=FACES):
    vertices = ''.join(f'v {" ".join(map(repr, each.tolist()))}\n' for each in corners)
    lines = ''.join(f'f {" ".join(str(k + 1) for k in face)}\n' for face in faces.tolist())
    return f'# part\no part\n{vertices}vn 0 0 1\ns off\n{lines}'


def saved(folder, name, content):
    path = folder / name
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return path


def triangle_set(vertices, triangles):
    """Return triangles as a sorted array, so that no order counts."""
    found = np.array(vertices)[np.array(triangles)].astype(np.float32)
    first = [int(np.lexsort(t.T[::-1])[0]) for t in found]
    turned = [np.roll(t, -k, axis=0).ravel() for t, k in zip(found, first, strict=True)]
    return np.array(sorted(map(tuple, turned)))


def random_mesh(random):
    rng = np.random.default_rng(random.randrange(2**32))
    corners = rng.uniform(-1.0, 1.0, (random.randint(4, 40), 3)).astype(np.float32).astype(float)
    faces = np.array([rng.permutation(len(corners))[:3] for _ in range(random.randint(1, 60))])
    return corners, faces


@pytest.mark.parametrize('seed', range(5))
@pytest.mark.parametrize(
    ('name', 'write'), [('a.stl', text_stl), ('b.STL', binary_stl), ('c.obj', obj)]
)
def test_two_other_readers_find_the_same_triangles(tmp_path, name, write, seed):
    coal, trimesh = pytest.importorskip('coal'), pytest.importorskip('trimesh')
    corners, faces = random_mesh(Random(seed))
    path = saved(tmp_path, name, write(corners, faces))
    mesh = read_mesh(path, (2.0, 1.0, 0.5))
    found = triangle_set(mesh.vertices, mesh.triangles)
    np.testing.assert_array_equal(found, triangle_set(corners * (2.0, 1.0, 0.5), faces))
    judge = trimesh.load_mesh(path, process=False)
    np.testing.assert_array_equal(
        found, triangle_set(judge.vertices * (2.0, 1.0, 0.5), judge.faces)
    )
    model = coal.MeshLoader().load(str(path), np.array([2.0, 1.0, 0.5]))
    indices = (model.tri_indices(k) for k in range(model.num_tris))
    triangles = [[each[k] for k in range(3)] for each in indices]
    np.testing.assert_allclose(
        found, triangle_set(model.vertices(), triangles), rtol=0.0, atol=1e-6
    )


def test_each_corner_is_kept_once(tmp_path):
    for name, content in (('a.stl', text_stl()), ('b.stl', binary_stl()), ('c.obj', obj())):
        mesh = read_mesh(saved(tmp_path, name, content))
        assert (len(mesh.vertices), len(mesh.triangles)) == (4, 4)
        assert mesh.is_closed
        assert mesh.source == str(tmp_path / name)


def test_several_solids_windows_lines_and_capitals_are_read(tmp_path):
    text = (text_stl(faces=FACES[:2]) + text_stl(faces=FACES[2:])).replace('\n', '\r\n').upper()
    mesh = read_mesh(saved(tmp_path, 'a.stl', text))
    np.testing.assert_allclose(
        triangle_set(mesh.vertices, mesh.triangles), triangle_set(CORNERS, FACES)
    )


def test_polygons_and_other_forms_of_faces_are_read(tmp_path):
    text = (
        'v 0 0 0\nv 1 0 0 0.5 0.5 0.5\nv 1 1 0\nv 0 1 0\nvt 0 0\nvn 0 0 1\n'
        'f 1/1/1 2/1/1 3/1/1 4/1/1\nv 0 0 1\nf -5//1 -4//1 -1//1\n'
    )
    mesh = read_mesh(saved(tmp_path, 'a.obj', text))
    corners = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1]], dtype=float)
    expected = triangle_set(corners, [[0, 1, 2], [0, 2, 3], [0, 1, 4]])
    np.testing.assert_array_equal(triangle_set(mesh.vertices, mesh.triangles), expected)


def test_triangles_without_an_area_are_dropped(tmp_path):
    corners = np.vstack([CORNERS, [0.15, 0.0, 0.0], [9.0, 9.0, 9.0]])
    faces = np.vstack([FACES, [0, 0, 1], [0, 4, 1], [5, 5, 5]])
    for name, content in (
        ('a.stl', text_stl(corners, faces)),
        ('b.stl', binary_stl(corners, faces)),
        ('c.obj', obj(corners, faces)),
    ):
        mesh = read_mesh(saved(tmp_path, name, content))
        assert len(mesh.triangles) == 4
        assert mesh.bounds.max() < 0.31


@pytest.mark.parametrize(
    ('name', 'content', 'words'),
    [
        ('a.stl', '', 'the mesh a.stl is empty'),
        ('a.stl', ' \n', 'the mesh a.stl is empty'),
        ('a.stl', 'hello', 'a.stl is no STL: it neither begins with solid nor has the 84 bytes'),
        ('a.stl', 'solid\nendsolid\n', 'a.stl has no triangle'),
        ('a.stl', text_stl()[:-20], 'a.stl is cut off: it does not end with a whole facet'),
        ('a.stl', text_stl()[:308], 'line 19 of the mesh a.stl has "vertex 0.0", but a vertex is'),
        ('a.stl', text_stl().replace('0.3', 'nan', 1), 'line 6 of the mesh a.stl has "vertex nan'),
        ('a.stl', text_stl().replace('0.3', '1e999', 1), 'line 6 of the mesh a.stl has "vertex 1'),
        ('a.stl', text_stl().replace('0.3', '0,3', 1), 'line 6 of the mesh a.stl has "vertex 0,3'),
        ('a.stl', text_stl().replace('endloop', 'end', 1), 'line 7 of the mesh a.stl begins with'),
        ('a.stl', binary_stl()[:-1], 'has 283 bytes, but 284 are needed for the 4 triangles that'),
        ('a.stl', binary_stl()[:84], 'has 84 bytes, but 284 are needed for the 4 triangles'),
        ('a.stl', binary_stl() + b'x', 'it is damaged'),
        ('a.stl', binary_stl(count=5), 'has 284 bytes, but 334 are needed for the 5 triangles'),
        ('a.stl', binary_stl(faces=FACES[:0]), 'a.stl has no triangle'),
        ('a.stl', binary_stl(CORNERS * np.nan), 'a corner of triangle 1 is not finite'),
        ('a.stl', binary_stl(CORNERS * (1, 1, 0) * (1, 0, 1)), 'has no triangle with an area'),
        ('a.stl', binary_stl(CORNERS * 1e3), 'is 300 m long; it must be longer than 0 and at mo'),
        ('a.stl', binary_stl(CORNERS * 1e38), 'm long; it must be longer than 0 and at most 50 m'),
        ('a.obj', 'v 0 0 0\n', 'the mesh a.obj has no face'),
        ('a.obj', obj().replace('f 1 2', 'f 1 9'), 'line 10 of the mesh a.obj names vertex 9,'),
        ('a.obj', obj().replace('f 1 2', 'f 1 0'), 'line 10 of the mesh a.obj names vertex 0,'),
        ('a.obj', obj().replace('f 1 2', 'f 1 -5'), 'names vertex -5, but the file has 4'),
        ('a.obj', obj().replace('f 1 2 4', 'f 1 2'), 'has a face of 2 vertices; it needs three'),
        ('a.obj', obj().replace('f 1 2', 'f 1 b'), 'has the face "1 b 4", which is no list of'),
        ('a.obj', obj().replace('v 0.3', 'v inf'), 'line 4 of the mesh a.obj has "v inf 0.0 0.0"'),
        ('a.obj', obj().replace('v 0.3 0.0', 'v 0.3'), 'line 4 of the mesh a.obj has "v 0.3 0.0"'),
        ('a.obj', obj().replace('s off', 'surf 0'), 'line 8 of the mesh a.obj begins with "surf"'),
        ('a.obj', binary_stl(), 'the mesh a.obj begins with'),
        ('a.step', 'ISO-10303-21;', 'the mesh a.step is STEP; STL and OBJ are read'),
        ('a.dae', '<COLLADA>', 'the mesh a.dae is COLLADA; STL and OBJ are read, so export'),
        ('a', text_stl(), 'the mesh a is neither; STL and OBJ are read'),
    ],
)  # fmt: skip
def test_a_file_that_is_no_mesh_is_refused(tmp_path, name, content, words):
    with pytest.raises(MeshFileError) as error:
        read_mesh(saved(tmp_path, name, content))
    assert words in str(error.value)


def test_a_file_that_is_too_long_is_refused(tmp_path, monkeypatch):
    monkeypatch.setattr('ur_cartesian_driver.motion.cell.mesh_file._MAX_LENGTH', 200)
    with pytest.raises(MeshFileError, match=r'is longer than \d+ MB; export it more coarsely'):
        read_mesh(saved(tmp_path, 'a.stl', binary_stl()))
    monkeypatch.setattr('ur_cartesian_driver.motion.cell.mesh_file._MAX_TRIANGLES', 3)
    with pytest.raises(MeshFileError, match='has more than 3 triangles'):
        read_mesh(saved(tmp_path, 'a.obj', obj()))


@pytest.mark.parametrize('factor', [0.0, np.nan, np.inf, 1e300])
def test_a_scale_that_is_none_is_refused(tmp_path, factor):
    with pytest.raises(MeshFileError, match=r'the scale is .*; for a file in millimetres'):
        read_mesh(saved(tmp_path, 'a.stl', binary_stl()), (1.0, factor, 1.0))


def test_a_file_that_is_missing_is_an_error_of_the_system(tmp_path):
    with pytest.raises(FileNotFoundError):
        read_mesh(tmp_path / 'a.stl')
    (tmp_path / 'b.stl').mkdir()
    with pytest.raises(IsADirectoryError):
        read_mesh(tmp_path / 'b.stl')


def remarks_on(mesh):
    return cell_remarks(Cell(bodies=(CellBody(name='part', shapes=(PlacedShape(mesh),)),)))


@pytest.mark.parametrize(
    ('content', 'words'),
    [
        (binary_stl(), []),
        (binary_stl(CORNERS * 30.0), ['The mesh of part is 9 m long; if its file is in millim']),
        (binary_stl(CORNERS * 3e-3), ['The mesh of part is only 0.9 mm long; if its file is in']),
        (binary_stl(faces=FACES[1:]), ['The mesh of part is not closed; its file may be damaged']),
    ],
)
def test_what_is_odd_is_remarked_on(tmp_path, content, words):
    found = remarks_on(read_mesh(saved(tmp_path, 'a.stl', content)))
    assert len(found) == len(words)
    assert all(map(str.startswith, found, words))


@pytest.mark.parametrize('seed', range(10))
def test_another_library_agrees_on_what_is_closed(tmp_path, seed):
    trimesh = pytest.importorskip('trimesh')
    solid = trimesh.creation.icosphere(subdivisions=1)
    kept = np.arange(len(solid.faces)) != (seed if seed < 5 else -1)
    other = trimesh.Trimesh(solid.vertices, solid.faces[kept], process=False)
    mesh = read_mesh(saved(tmp_path, 'a.stl', binary_stl(other.vertices, other.faces)))
    assert mesh.is_closed == other.is_watertight == (seed >= 5)


@pytest.mark.slow
def test_a_hundred_thousand_triangles_are_read_within_seconds(tmp_path):
    n = 224
    x, y = np.meshgrid(np.linspace(0.0, 1.0, n), np.linspace(0.0, 1.0, n))
    corners = np.stack([x, y, np.sin(9.0 * x) * 0.1], axis=2).reshape(-1, 3)
    k = np.arange(n * n).reshape(n, n)
    a, b, c, d = (each.ravel() for each in (k[:-1, :-1], k[:-1, 1:], k[1:, 1:], k[1:, :-1]))
    faces = np.vstack([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])
    for name, write, bound in (
        ('a.stl', binary_stl, 1.0),
        ('b.stl', text_stl, 3.0),
        ('c.obj', obj, 3.0),
    ):
        path = saved(tmp_path, name, write(corners, faces))
        start = process_time()
        mesh = read_mesh(path)
        assert process_time() - start < bound
        assert len(mesh.triangles) == 2 * (n - 1) ** 2 > 99_000


@pytest.mark.random
def test_a_broken_file_is_a_mesh_or_one_sentence(tmp_path):
    texts = {'.stl': [text_stl()], '.obj': [obj()]}
    read, refusals = 0, []
    for number in range(cases(3000)):
        random = random_of('broken mesh', number)
        suffix = random.choice(['.stl', '.obj', 'binary'])
        if suffix == 'binary':
            data, suffix = bytearray(binary_stl()), '.stl'
            for _ in range(random.randint(1, 3)):
                data[random.randrange(len(data))] = random.randrange(256)
            content = bytes(data[: random.choice([len(data), random.randrange(len(data))])])
        else:
            content = broken(texts[suffix], random).encode(errors='surrogatepass')
        try:
            mesh = read_mesh(saved(tmp_path, f'part{suffix}', content))
        except MeshFileError as error:
            refusals.append(str(error))
        else:
            read += 1
            assert np.isfinite(mesh.vertices).all()
    assert read > 0.05 * cases(3000)
    assert len(refusals) > 0.4 * cases(3000)
    for refusal in refusals:
        assert re.match(r'(line \d+ of )?the mesh part\.(stl|obj) ', refusal)
        assert refusal.isprintable()
