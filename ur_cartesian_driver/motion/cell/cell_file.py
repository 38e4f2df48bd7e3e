# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Read and write ``cell.yaml``: the bodies around the arm, on its links and in its hand.

::

    cell: 1
    clearance: 0.005                                # [m], of bodies that give none
    bodies:
      table: {plane: {}, position: [0, 0, -0.01]}   # solid below z = 0 of its own frame
      wall: {box: [0.02, 2.0, 1.5], position: [0.8, 0, 0.75], clearance: 0.03}
      fixture: {mesh: fixture.stl, scale: 0.001, position: [0.4, 0, 0], rpy: [0, 0, 1.57]}
      torch:
        frame: tool0
        shapes:
        - {cylinder: {radius: 0.02, length: 0.3}, position: [0, 0, 0.15]}
        - {sphere: 0.03}
    may_touch:
    - [torch, fixture]
    urdf:
    - {file: cell.urdf, clearance: 0.01, leave_out: [lamp]}

Positions are in metres; orientations are ``rpy`` [rad], ``rotation_vector`` [rad] or
``orientation``, a quaternion x y z w. A frame may also be another body of the file; the body is
then placed relative to it. File names are relative to the folder of the cell. Every error names
the line.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from functools import partial
from math import hypot, isfinite
from pathlib import Path
from typing import Any, TYPE_CHECKING, TypeVar

from ur_cartesian_driver.motion.cell.cell import (
    Cell,
    CellBody,
    check_clearance,
    check_place,
    DEFAULT_CLEARANCE,
    FRAMES,
    PlacedShape,
)
from ur_cartesian_driver.motion.cell.mesh_file import read_mesh
from ur_cartesian_driver.motion.cell.shapes import Box, Cylinder, HalfSpace, Mesh, Shape, Sphere
from ur_cartesian_driver.motion.cell.urdf_bodies import read_urdf
from ur_cartesian_driver.motion.errors import shortened, suggestion
from ur_cartesian_driver.motion.geometry.pose import (
    IDENTITY,
    MAX_ANGLE,
    normalize,
    Pose,
    Quaternion,
    quaternion_from_roll_pitch_yaw,
    quaternion_from_rotation_vector,
)
from ur_cartesian_driver.motion.geometry.vectors import Vector3, vector3
from ur_cartesian_driver.motion.yaml_nodes import kind_of, NodeReader, text_of_file

if TYPE_CHECKING:
    import yaml  # at run time, imported with the first file

T = TypeVar('T')

#: The version of the format, with which a file begins.
FORMAT = 1
#: Most shapes of a file; with YAML aliases, a short text can contain very many.
_MAX_SHAPES = 10_000
#: Largest accepted error in the length of a quaternion, and the largest that is not corrected.
_UNIT_TOLERANCE, _EXACT_UNIT = 1e-3, 1e-12

_HEAD = ('cell', 'clearance', 'bodies', 'may_touch', 'urdf')
_TURNS = ('rpy', 'orientation', 'rotation_vector')
_PLACE = ('position', *_TURNS)
_SHAPES = ('box', 'cylinder', 'sphere', 'plane', 'mesh')
_SHAPE = (*_SHAPES, 'scale', *_PLACE)
_BODY = ('frame', 'shapes', 'clearance', *_SHAPE)
_URDF = ('file', 'clearance', 'leave_out', *_PLACE)


class CellFileError(ValueError):
    """A file is not a valid cell; the text names the file, the line and the fault."""


def read_cell(path: str | Path) -> Cell:
    """
    Return the cell in a file.

    :raises OSError: the file cannot be read.
    :raises CellFileError: the file is not a valid cell, or a file that it names cannot be used.
    """
    path = Path(path)
    text = text_of_file(path, 'cell', CellFileError)
    return cell_from_text(text, str(path), path.parent)


def cell_from_text(text: str, name: str, folder: str | Path) -> Cell:
    """
    Return the cell in the text of a file.

    :param name: the name of the file, for error texts.
    :param folder: the folder to which the names of other files are relative.
    :raises CellFileError: the text is not a valid cell, or a file that it names cannot be used.
    """
    return _CellReader(name, Path(folder)).cell(text)


def cell_text(cell: Cell) -> str:
    """
    Return the text of a file, from which :func:`cell_from_text` makes the same cell.

    Bodies of a URDF are written as bodies of the cell.

    :raises ValueError: a mesh does not come from a file.
    """
    import yaml

    content: dict[str, Any] = {
        'cell': FORMAT,
        'clearance': float(cell.clearance),
        'bodies': {body.name: _body_fields(body) for body in cell.bodies},
    }
    if cell.may_touch:
        content['may_touch'] = sorted(sorted(pair) for pair in cell.may_touch)
    text: str = yaml.safe_dump(
        content, sort_keys=False, default_flow_style=None, allow_unicode=True, width=95
    )
    return text


def _body_fields(body: CellBody) -> dict[str, Any]:
    fields: dict[str, Any] = {} if body.frame == 'base' else {'frame': body.frame}
    first = body.shapes[0]
    if len(body.shapes) == 1 and first.T_body_shape == IDENTITY:
        fields |= _shape_fields(body.name, first)
    else:
        fields['shapes'] = [_shape_fields(body.name, each) for each in body.shapes]
    fields |= _place_fields(body.T_frame_body)
    if body.clearance is not None:
        fields['clearance'] = float(body.clearance)
    return fields


def _shape_fields(name: str, placed: PlacedShape) -> dict[str, Any]:
    fields: dict[str, Any]
    match placed.shape:
        case Box(size):
            fields = {'box': _floats(size)}
        case Cylinder(radius, length):
            fields = {'cylinder': {'radius': float(radius), 'length': float(length)}}
        case Sphere(radius):
            fields = {'sphere': float(radius)}
        case HalfSpace():
            fields = {'plane': {}}
        case Mesh(source=source, scale=scale):
            if not source:
                raise ValueError(f'the mesh of {name} is of no file, so it cannot be written')
            fields = {'mesh': source, 'scale': _floats(scale)}
    return fields | _place_fields(placed.T_body_shape)


def _place_fields(pose: Pose) -> dict[str, Any]:
    fields = {}
    if pose.position != IDENTITY.position:
        fields['position'] = _floats(pose.position)
    if pose.quaternion != IDENTITY.quaternion:
        fields['orientation'] = _floats(pose.quaternion)
    return fields


def _floats(values: Iterable[float]) -> list[float]:
    return [float(value) for value in values]


@dataclass(frozen=True, slots=True)
class _Draft:
    """A body as written in the file: its frame may be another body."""

    name: str
    node: yaml.Node
    frame: str
    frame_node: yaml.Node
    T_frame_body: Pose
    shapes: tuple[PlacedShape, ...]
    clearance: float | None


class _CellReader(NodeReader):
    """Reads one file; ``name`` is its name in error texts."""

    def __init__(self, name: str, folder: Path) -> None:
        super().__init__(name, 'cell', CellFileError)
        self._folder = folder
        self._meshes: dict[tuple[str, Vector3], Mesh] = {}
        self._shape_count = 0

    def cell(self, text: str) -> Cell:
        """Return the cell, see :func:`cell_from_text`."""
        root = self.root(text)
        entries = self.entries(root, 'the file', _HEAD)
        if (version := entries.get('cell')) is None:
            self.refuse(
                root, f'this is no cell: it has no field cell; it begins with cell: {FORMAT}'
            )
        if (number := self.text(version, 'cell')) != str(FORMAT):
            self.refuse(
                version, f'cell is {shortened(number)}, a format that is not known; use {FORMAT}'
            )
        if not {'bodies', 'urdf'} & set(entries):
            self.refuse(root, 'bodies is missing, so the file may be cut off')
        clearance = self._clearance(entries.get('clearance'), 'the file')
        drafts = self._drafts(entries['bodies']) if 'bodies' in entries else {}
        found: dict[str, CellBody] = {}
        remarks: list[str] = []
        for node in self._list(entries.get('urdf'), 'urdf must be a list of {file: NAME}'):
            self._add_urdf(node, drafts, found, remarks)
        for draft in drafts.values():
            self._add(draft, drafts, found)
        cell = Cell(
            bodies=tuple(found[name] for name in dict.fromkeys((*drafts, *found))),
            clearance=DEFAULT_CLEARANCE if clearance is None else clearance,
            remarks=tuple(remarks),
        )
        return replace(cell, may_touch=self._may_touch(entries.get('may_touch'), cell))

    def _list(self, node: yaml.Node | None, fault: str) -> list[yaml.Node]:
        return [] if node is None else self.items(node, fault)

    # -- bodies --------------------------------------------------------------------------------

    def _drafts(self, node: yaml.Node) -> dict[str, _Draft]:
        return {
            name: self._draft(name, value) for name, value in self.entries(node, 'bodies').items()
        }

    def _draft(self, name: str, node: yaml.Node) -> _Draft:
        where = shortened(name)
        entries = self.entries(node, where, _BODY)
        frame_node = entries.get('frame', node)
        frame = self._name_of(frame_node) if 'frame' in entries else 'base'
        if 'shapes' in entries:
            for key in (*_SHAPES, 'scale'):
                if key in entries:
                    self.refuse(entries[key], f'{where} has shapes, so it can have no {key}')
            nodes = self.items(entries['shapes'], f'the shapes of {where} must be a list')
            shapes = tuple(self._placed_shape(where, each) for each in nodes)
        else:
            shapes = (PlacedShape(self._shape(where, node, entries)),)
        return _Draft(
            name,
            node,
            frame,
            frame_node,
            self._place(entries, where, node) or IDENTITY,
            shapes,
            self._clearance(entries.get('clearance'), where),
        )

    def _placed_shape(self, where: str, node: yaml.Node) -> PlacedShape:
        entries = self.entries(node, f'a shape of {where}', _SHAPE)
        shape = self._shape(where, node, entries)
        return PlacedShape(shape, self._place(entries, where, node) or IDENTITY)

    def _shape(self, where: str, node: yaml.Node, entries: Mapping[str, yaml.Node]) -> Shape:
        self._shape_count += 1
        if self._shape_count > _MAX_SHAPES:
            self.refuse(node, f'the cell has more than {_MAX_SHAPES} shapes')
        kinds = [key for key in _SHAPES if key in entries]
        if len(kinds) != 1:
            has = f'has {" and ".join(kinds)}' if kinds else 'has no shape'
            self.refuse(node, f'{where} {has}; give one of {", ".join(_SHAPES)}, or shapes')
        kind, value = kinds[0], entries[kinds[0]]
        if 'scale' in entries and kind != 'mesh':
            self.refuse(entries['scale'], f'{where} is no mesh, so it can have no scale')
        what = f'{kind} of {where}'
        match kind:
            case 'box':
                size = self._vector(value, what)
                return self._made(value, where, lambda: Box(size))
            case 'cylinder':
                fields = self._all_entries(value, what, ('radius', 'length'))
                radius, length = (self._finite(fields[key], what) for key in fields)
                return self._made(value, where, lambda: Cylinder(radius, length))
            case 'sphere':
                radius = self._finite(value, what)
                return self._made(value, where, lambda: Sphere(radius))
            case 'mesh':
                return self._mesh(where, value, entries.get('scale'))
        if value.value:
            self.refuse(value, f'the {what} has no fields; write plane: {{}}')
        return HalfSpace()

    def _mesh(self, where: str, node: yaml.Node, scale_node: yaml.Node | None) -> Mesh:
        file, scale = self._file(node), (1.0, 1.0, 1.0)
        if scale_node is not None and kind_of(scale_node) == 'scalar':
            scale = 3 * (self._finite(scale_node, f'scale of {where}'),)
        elif scale_node is not None:
            scale = self._vector(scale_node, f'scale of {where}')
        if (file, scale) not in self._meshes:
            self._meshes[file, scale] = self._made(
                node, where, lambda: read_mesh(self._folder / file, scale)
            )
        return self._meshes[file, scale]

    def _add(
        self, draft: _Draft, drafts: Mapping[str, _Draft], found: dict[str, CellBody]
    ) -> None:
        """Add a body and, before it, the bodies to which its place is relative."""
        chain: dict[str, _Draft] = {}
        while draft.name not in found:
            if draft.name in chain:
                names = [*list(chain)[list(chain).index(draft.name) :], draft.name]
                self.refuse(
                    draft.frame_node,
                    f'the frames go round in a circle: {" on ".join(map(shortened, names))}',
                )
            chain[draft.name] = draft
            if draft.frame not in drafts:
                break
            draft = drafts[draft.frame]
        for each in reversed(chain.values()):
            found[each.name] = self._body(each, found)

    def _body(self, draft: _Draft, found: Mapping[str, CellBody]) -> CellBody:
        frame, T_frame_body = draft.frame, draft.T_frame_body
        if frame in found:
            T_frame_body = found[frame].T_frame_body @ T_frame_body
            frame = found[frame].frame
        elif frame not in FRAMES:
            self.refuse(
                draft.frame_node,
                f'the frame of {shortened(draft.name)} is {shortened(frame)}, which is neither '
                'a frame of the arm nor a body; '
                + suggestion(frame, (*FRAMES, *found), f'known are {", ".join(FRAMES)}'),
            )
        return self._made(
            draft.node,
            shortened(draft.name),
            lambda: CellBody(
                name=draft.name,
                shapes=draft.shapes,
                frame=frame,
                T_frame_body=T_frame_body,
                clearance=draft.clearance,
            ),
        )

    def _add_urdf(
        self,
        node: yaml.Node,
        drafts: Mapping[str, _Draft],
        found: dict[str, CellBody],
        remarks: list[str],
    ) -> None:
        entries = self.entries(node, 'urdf', _URDF)
        if 'file' not in entries:
            self.refuse(node, 'file of urdf is missing')
        file = self._file(entries['file'])
        fault = 'leave_out of urdf must be a list of links'
        links = self._list(entries.get('leave_out'), fault)
        place = self._place(entries, 'urdf', node)
        clearance = self._clearance(entries.get('clearance'), 'urdf')
        leave_out = [self._name_of(each) for each in links]
        read = self._made(
            entries['file'],
            'urdf',
            lambda: read_urdf(self._folder / file, place, clearance, leave_out),
        )
        for body in read.bodies:
            if body.name in found or body.name in drafts:
                self.refuse(
                    entries['file'],
                    f'the name "{body.name}" of a link is used twice; put it into leave_out, or '
                    'give the other body another name',
                )
            found[body.name] = body
        remarks += read.remarks

    def _may_touch(self, node: yaml.Node | None, cell: Cell) -> frozenset[frozenset[str]]:
        pairs = {}
        for each in self._list(node, 'may_touch must be a list of pairs of names'):
            names = self.items(each, 'a pair of may_touch must be two names, [ONE, OTHER]', 2)
            pairs[frozenset(map(self._name_of, names))] = each
        for pair, each in pairs.items():
            self._made(each, '', partial(replace, cell, may_touch=frozenset((pair,))))
        return frozenset(pairs)

    # -- values --------------------------------------------------------------------------------

    def _made(self, node: yaml.Node, where: str, make: Callable[[], T]) -> T:
        """Return the result of ``make``, or refuse the node with the text of its error."""
        where = f'{where}: ' if where else ''
        try:
            return make()
        except OSError as error:
            self.refuse(node, f'{where}its file cannot be read: {error.strerror}')
        except ValueError as error:
            self.refuse(node, f'{where}{error}')

    def _name_of(self, node: yaml.Node) -> str:
        if kind_of(node) != 'scalar':
            self.refuse(node, 'a name must be one value')
        return str(node.value)

    def _file(self, node: yaml.Node) -> str:
        name = self._name_of(node)
        if not (name and name.isprintable()):
            self.refuse(node, f'"{shortened(name)}" cannot be the name of a file')
        return name

    def _clearance(self, node: yaml.Node | None, where: str) -> float | None:
        if node is None:
            return None
        value = self._finite(node, f'clearance of {where}')
        self._made(node, '' if where == 'the file' else where, lambda: check_clearance(value))
        return value

    def _place(self, entries: Mapping[str, yaml.Node], where: str, node: yaml.Node) -> Pose | None:
        """Return the pose that the fields give; None if they give none."""
        turns = [key for key in _TURNS if key in entries]
        if len(turns) > 1:
            self.refuse(entries[turns[1]], f'{where} has {" and ".join(turns)}; give one of them')
        if not turns and 'position' not in entries:
            return None
        position, quaternion = IDENTITY.position, IDENTITY.quaternion
        if 'position' in entries:
            node = entries['position']
            position = self._vector(node, f'position of {where}', 'xyz')
        if turns:
            quaternion = self._quaternion(turns[0], entries[turns[0]], f'{turns[0]} of {where}')
        pose = Pose(position, quaternion)
        self._made(node, where, lambda: check_place(pose))
        return pose

    def _quaternion(self, key: str, node: yaml.Node, what: str) -> Quaternion:
        if key == 'orientation':
            x, y, z, w = self._numbers(node, what, 4, 'xyzw')
            length = hypot(x, y, z, w)
            if not abs(length - 1.0) <= _UNIT_TOLERANCE:
                self.refuse(
                    node,
                    f'the {what} has the length {length:.4g} instead of 1; the order is x y z w',
                )
            # An exact quaternion stays as it is, so that writing and reading do not change a cell.
            exact = abs(length - 1.0) <= _EXACT_UNIT
            return (x, y, z, w) if exact else normalize((x, y, z, w))
        angles = self._vector(node, what)
        if max(map(abs, angles)) > MAX_ANGLE:
            self.refuse(
                node, f'the {what} has an angle of more than two turns; give it in radians'
            )
        if key == 'rpy':
            return quaternion_from_roll_pitch_yaw(*angles)
        return quaternion_from_rotation_vector(angles)

    def _vector(self, node: yaml.Node, what: str, axes: str = '') -> Vector3:
        return vector3(self._numbers(node, what, 3, axes))

    def _numbers(self, node: yaml.Node, what: str, count: int, axes: str = '') -> list[float]:
        """Return the numbers of a list; if axes are given, also by name as in goal files."""
        if axes and kind_of(node) == 'mapping':
            nodes = list(self._all_entries(node, f'the {what}', tuple(axes)).values())
        else:
            wanted = f'must be {count} numbers' + (f', {" ".join(axes)}' if axes else '')
            nodes = self.items(node, f'the {what} {wanted}', count)
        return [self._finite(each, what) for each in nodes]

    def _all_entries(
        self, node: yaml.Node, where: str, keys: tuple[str, ...]
    ) -> dict[str, yaml.Node]:
        """Return the fields of a mapping in the order of the keys; none may be missing."""
        entries = self.entries(node, where, keys)
        for key in keys:
            if key not in entries:
                self.refuse(node, f'{where} has no {key}')
        return {key: entries[key] for key in keys}

    def _finite(self, node: yaml.Node, what: str) -> float:
        value = self.number(node, what)
        if not isfinite(value):
            self.refuse(node, f'the {what} is {value:g}; it must be finite')
        return value
