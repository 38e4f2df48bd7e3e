# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Read the triangles of an STL or OBJ file.

The files are read here, not by a library. The available readers (assimp in ``coal``, and trimesh)
belong to optional packages, but a cell must be read, shown and sent without them. Both also accept
a truncated file as a smaller part, and the arm would run into the rest.

A polygon of an OBJ file becomes a fan of triangles, which covers the polygon; if the polygon is
not convex, the fan reaches beyond it.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from math import isfinite
from pathlib import Path
import re
from typing import NoReturn, TypeAlias

import numpy as np

from ur_cartesian_driver.motion.cell.shapes import Mesh
from ur_cartesian_driver.motion.errors import shortened
from ur_cartesian_driver.motion.geometry.arrays import Flags, Floats, Indices, Singles
from ur_cartesian_driver.motion.geometry.vectors import Vector3
from ur_cartesian_driver.motion.yaml_nodes import printable

#: A line of a file: its number, and its words.
_Line: TypeAlias = tuple[int, list[bytes]]

#: Longest file [bytes] and most triangles of a mesh: more would take too long.
_MAX_LENGTH = 100_000_000
_MAX_TRIANGLES = 1_000_000
#: A triangle of a smaller height is dropped: it is a line, which its neighbours contain [m].
_MIN_HEIGHT = 1e-9

_HEADER = 84
_FACET = np.dtype([('normal', '<f4', 3), ('corners', '<f4', (3, 3)), ('attribute', '<u2')])
#: The words of a facet; None = a coordinate, '' = a component of the normal, which is not needed.
_FACET_WORDS = (
    *(b'facet', b'normal', b'', b'', b''),
    *(b'outer', b'loop', *3 * (b'vertex', None, None, None)),
    *(b'endloop', b'endfacet'),
)
#: The first words of the lines of a facet.
_FACET_LINES = (b'facet', b'outer', b'vertex', b'vertex', b'vertex', b'endloop', b'endfacet')
_SOLID_LINE = re.compile(rb'^[ \t]*(?:end)?solid\b.*$', re.MULTILINE)
#: Statements of OBJ to skip, because they do not change the surface. Free-form surfaces are not
#: skipped: without them the part would be incomplete.
_OTHER_OBJ_WORDS = frozenset(
    b'vn vt vp p l g o s mg usemtl mtllib usemap maplib shadow_obj trace_obj bevel c_interp '
    b'd_interp'.split()
)
_OTHER_FORMATS = {
    **dict.fromkeys(('.step', '.stp'), 'STEP'),
    **dict.fromkeys(('.iges', '.igs'), 'IGES'),
    **dict.fromkeys(('.gltf', '.glb'), 'glTF'),
    **dict.fromkeys(('.wrl', '.vrml'), 'VRML'),
    **dict.fromkeys(('.sldprt', '.sldasm'), 'SolidWorks'),
    '.dae': 'COLLADA',
    '.ply': 'PLY',
    '.off': 'OFF',
    '.3mf': '3MF',
    '.amf': 'AMF',
    '.3ds': '3ds Max',
    '.fbx': 'FBX',
    '.dxf': 'DXF',
    '.dwg': 'DWG',
    '.blend': 'Blender',
}


class MeshFileError(ValueError):
    """A file is not a usable mesh; the text is a sentence without its full stop."""


def read_mesh(path: str | Path, scale: Vector3 = (1.0, 1.0, 1.0)) -> Mesh:
    """
    Return the mesh in a file.

    :param scale: factors that convert its coordinates along x, y and z to metres.
    :raises OSError: the file cannot be read.
    :raises MeshFileError: the file is not a mesh or is damaged, or the mesh is too large.
    """
    path = Path(path)
    for factor in scale:
        if not (isfinite(factor) and 1e-9 <= abs(factor) <= 1e9):
            raise MeshFileError(f'the scale is {factor:g}; for a file in millimetres it is 0.001')
    reader = _MeshReader(path.name)
    vertices, triangles = reader.mesh(path)
    with np.errstate(over='ignore'):
        vertices = vertices * np.array(scale)
    triangles = triangles[_are_proper(vertices, triangles)]
    if not len(triangles):
        reader.refuse('has no triangle with an area')
    used = np.zeros(len(vertices), dtype=bool)
    used[triangles] = True
    try:
        return Mesh(
            vertices=vertices[used],
            triangles=(np.cumsum(used) - 1)[triangles],
            source=str(path.absolute()),
            scale=scale,
        )
    except ValueError as error:
        raise MeshFileError(printable(f'the mesh {path.name} cannot be used: {error}')) from None


def _are_proper(vertices: Floats, triangles: Indices) -> Flags:
    """Return a mask of triangles that are not lines; Mesh refuses the ones that are not finite."""
    a, b, c = (vertices[triangles[:, k]] for k in range(3))
    with np.errstate(over='ignore', invalid='ignore'):
        double_area = np.linalg.norm(np.cross(b - a, c - a), axis=1)
        sides = [np.linalg.norm(side, axis=1) for side in (b - a, c - b, a - c)]
        is_line: Flags = double_area <= _MIN_HEIGHT * np.max(sides, axis=0)
    return ~is_line


class _MeshReader:
    """Reads one file; ``name`` is its name in error texts."""

    def __init__(self, name: str) -> None:
        self._name = name

    def mesh(self, path: Path) -> tuple[Floats, Indices]:
        """Return vertices (n, 3) in the unit of the file, and triangles (m, 3)."""
        suffix = path.suffix.lower()
        if suffix not in ('.stl', '.obj'):
            what = f'is {_OTHER_FORMATS[suffix]}' if suffix in _OTHER_FORMATS else 'is neither'
            self.refuse(f'{what}; STL and OBJ are read, so export the part as one of them')
        if path.exists() and not (path.is_file() or path.is_dir()):
            self.refuse('is no regular file')
        with path.open('rb') as file:
            data = file.read(_MAX_LENGTH + 1)
        if len(data) > _MAX_LENGTH:
            self.refuse(f'is longer than {_MAX_LENGTH // 1_000_000} MB; export it more coarsely')
        if not data.strip():
            self.refuse('is empty')
        return self._stl(data) if suffix == '.stl' else self._obj(data)

    def _check_count(self, count: int) -> None:
        if count > _MAX_TRIANGLES:
            self.refuse(f'has more than {_MAX_TRIANGLES} triangles; export it more coarsely')

    # -- STL -----------------------------------------------------------------------------------

    def _stl(self, data: bytes) -> tuple[Floats, Indices]:
        # A binary file may begin with `solid` too, so its length decides.
        announced = int.from_bytes(data[_HEADER - 4 : _HEADER], 'little')
        length = _HEADER + _FACET.itemsize * announced
        is_text = data.lstrip()[:5].lower() == b'solid' and b'\0' not in data
        if len(data) >= _HEADER and len(data) == length:
            corners = np.frombuffer(data, _FACET, offset=_HEADER)['corners'].reshape(-1, 3)
            self._check_finite(corners)
        elif is_text:
            corners = self._text_facets(data)
        elif len(data) < _HEADER:
            self.refuse('is no STL: it neither begins with solid nor has the 84 bytes of a header')
        else:
            self.refuse(
                f'has {len(data)} bytes, but {length} are needed for the {announced} triangles '
                'that it announces; it is ' + ('cut off' if len(data) < length else 'damaged')
            )
        if not len(corners):
            self.refuse('has no triangle')
        self._check_count(len(corners) // 3)
        return _merged(corners)

    def _check_finite(self, corners: Singles) -> None:
        finite = np.isfinite(corners).all(axis=1)
        if not finite.all():
            self.refuse(
                f'is damaged: a corner of triangle {int(finite.argmin()) // 3 + 1} is not finite'
            )

    def _text_facets(self, data: bytes) -> Floats:
        """Return the corners (3 n, 3) in a text file."""
        data = data.lower().replace(b'\r\n', b'\n').replace(b'\r', b'\n').rstrip()
        words = _SOLID_LINE.sub(b'', data).split()  # splitting each line takes three times as long
        width = len(_FACET_WORDS)
        n, rest = divmod(len(words), width)
        if rest or not data[data.rfind(b'\n') + 1 :].lstrip().startswith(b'endsolid'):
            self._refuse_facet(data)
        columns = []
        try:
            for k, word in enumerate(_FACET_WORDS):
                column = words[k::width]
                if word is None:
                    columns.append(np.fromiter(map(float, column), np.float64, n))
                elif word and column != [word] * n:
                    self._refuse_facet(data)
        except ValueError:
            self._refuse_facet(data)
        corners = np.stack(columns, axis=1).reshape(-1, 3)
        if not np.isfinite(corners).all():
            self._refuse_facet(data)
        return corners

    def _refuse_facet(self, data: bytes) -> NoReturn:
        """Refuse a text file at its first line that does not fit a facet."""
        lines = [line for line in _lines(data) if line[1][0] not in (b'solid', b'endsolid')]
        for k, (number, words) in enumerate(lines):
            if words[0] != (expected := _FACET_LINES[k % len(_FACET_LINES)]):
                if k == len(lines) - 1:
                    break
                self.refuse(f'begins with {_quoted(words[:1])}, not {expected.decode()}', number)
        self._coordinates([line for line in lines if line[1][0] == b'vertex'])
        self.refuse('is cut off: it does not end with a whole facet and endsolid')

    # -- OBJ -----------------------------------------------------------------------------------

    def _obj(self, data: bytes) -> tuple[Floats, Indices]:
        vertices: list[_Line] = []
        triangles: list[tuple[int, int, int]] = []
        lines: list[int] = []
        for number, words in _lines(data):
            if words[0] == b'v':
                vertices.append((number, words))
            elif words[0] == b'f':
                first, *others = self._face(words[1:], len(vertices), number)
                triangles += ((first, *pair) for pair in pairwise(others))
                lines += [number] * (len(triangles) - len(lines))
                self._check_count(len(triangles))
            elif words[0] not in _OTHER_OBJ_WORDS and not words[0].startswith(b'#'):
                self.refuse(
                    f'begins with {_quoted(words[:1])}, which is not read; export the part as '
                    'triangles',
                    number,
                )
        if not triangles:
            self.refuse('has no face')
        for triangle, number in zip(triangles, lines, strict=True):
            if max(triangle) >= len(vertices):
                self._refuse_vertex(max(triangle) + 1, len(vertices), number)
        return self._coordinates(vertices), np.array(triangles, dtype=np.intp)

    def _face(self, words: Sequence[bytes], count: int, line: int) -> list[int]:
        """Return the vertices of a face, from 0; ``count`` vertices precede the face."""
        try:
            indices = [int(word.split(b'/', 1)[0]) for word in words]
        except ValueError:
            self.refuse(f'has the face {_quoted(words)}, which is no list of numbers', line)
        if len(indices) < 3:
            self.refuse(f'has a face of {len(indices)} vertices; it needs three', line)
        found = [index - 1 if index > 0 else count + index for index in indices]
        for index, vertex in zip(indices, found, strict=True):
            if index == 0 or vertex < 0:
                self._refuse_vertex(index, count, line)
        return found

    def _refuse_vertex(self, index: int, count: int, line: int) -> NoReturn:
        self.refuse(f'names vertex {shortened(str(index))}, but the file has {count}', line)

    # -- both ----------------------------------------------------------------------------------

    def _coordinates(self, lines: list[_Line]) -> Floats:
        """Return the three numbers after the first word of each line, (n, 3)."""
        try:
            flat = [float(text) for _, words in lines for text in words[1:4]]
        except ValueError:
            flat = []
        rows = np.array(flat, dtype=np.float64)
        if len(rows) != 3 * len(lines) or not np.isfinite(rows).all():
            for number, words in lines:
                if not _are_coordinates(words[1:4]):
                    self.refuse(
                        f'has {_quoted(words)}, but a vertex is three finite numbers', number
                    )
        return rows.reshape(-1, 3)

    def refuse(self, fault: str, line: int = 0) -> NoReturn:
        """Raise the error on the file, or on one of its lines, from 1."""
        where = f'line {line} of ' if line else ''
        raise MeshFileError(printable(f'{where}the mesh {self._name} {fault}'))


def _lines(data: bytes) -> list[_Line]:
    """Return the lines that are not empty."""
    return [
        (number, words)
        for number, line in enumerate(data.splitlines(), 1)
        if (words := line.split())
    ]


def _are_coordinates(words: Sequence[bytes]) -> bool:
    try:
        return len(words) == 3 and all(isfinite(float(text)) for text in words)
    except ValueError:
        return False


def _merged(corners: Floats | Singles) -> tuple[Floats, Indices]:
    """Return the distinct corners (n, 3), and the triangles (m, 3) as indices of corners."""
    order = np.lexsort(corners.T)
    sorted_corners = corners[order]
    is_new = np.ones(len(corners), dtype=bool)
    is_new[1:] = (sorted_corners[1:] != sorted_corners[:-1]).any(axis=1)
    numbers = np.empty(len(corners), dtype=np.intp)
    numbers[order] = np.cumsum(is_new) - 1
    return sorted_corners[is_new].astype(np.float64), numbers.reshape(-1, 3)


def _quoted(words: Sequence[bytes]) -> str:
    return f'"{shortened(b" ".join(words).decode(errors="replace"))}"'
