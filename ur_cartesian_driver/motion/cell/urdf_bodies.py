# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The collision bodies of a URDF, by the names of their links.

The file may contain the arm itself, with any prefix. The arm's own links are left out, because the
driver knows them. Links that the arm carries are carried by the same link in the cell; all other
links keep their place relative to the arm. In a file without an arm, the root is placed in
``base``.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass
from math import isfinite
from pathlib import Path
from typing import Any, NoReturn
from urllib.parse import unquote, urlsplit
from xml.etree.ElementTree import Element, TreeBuilder
from xml.parsers import expat

from ur_cartesian_driver.motion.cell.cell import CellBody, FRAMES, PlacedShape
from ur_cartesian_driver.motion.cell.mesh_file import read_mesh
from ur_cartesian_driver.motion.cell.shapes import Box, Cylinder, Shape, Sphere
from ur_cartesian_driver.motion.errors import shortened, suggestion
from ur_cartesian_driver.motion.geometry.pose import (
    IDENTITY,
    Pose,
    quaternion_from_roll_pitch_yaw,
)
from ur_cartesian_driver.motion.geometry.vectors import Vector3, vector3
from ur_cartesian_driver.motion.goal.known_frames import T_BASE_BASE_LINK
from ur_cartesian_driver.motion.yaml_nodes import printable
from ur_cartesian_driver.resources import installed_share

#: Longest file [bytes], and most links in it.
_MAX_LENGTH, _MAX_LINKS = 10_000_000, 5000
#: The links that identify an arm, with any prefix.
_MOVED_LINKS = tuple(name for name, number in FRAMES.items() if name.endswith('_link') and number)
#: The frame in the cell for each link of an arm.
_ARM_FRAMES = {**{name: name for name in FRAMES}, 'base_link_inertia': 'base'}
_MOVING = ('revolute', 'continuous', 'prismatic', 'planar', 'floating')
#: The attribute in which the reader stores the line number of an element.
_LINE = ' line'


class UrdfError(ValueError):
    """A file is not a usable URDF; the text is a sentence without its full stop."""


@dataclass(frozen=True, slots=True)
class UrdfBodies:
    """The bodies of a URDF, and remarks on the file, one sentence each."""

    bodies: tuple[CellBody, ...]
    remarks: tuple[str, ...] = ()


def read_urdf(
    path: str | Path,
    T_base_root: Pose | None = None,
    clearance: float | None = None,
    leave_out: Collection[str] = (),
) -> UrdfBodies:
    """
    Return the bodies of a file, see :func:`urdf_bodies`.

    :raises OSError: the file cannot be read.
    :raises UrdfError: the file cannot be used.
    """
    path = Path(path)
    if path.exists() and not (path.is_file() or path.is_dir()):
        raise UrdfError(f'{path.name} is no regular file')
    with path.open('rb') as file:
        data = file.read(_MAX_LENGTH + 1)
    return urdf_bodies(data, path.name, path.parent, T_base_root, clearance, leave_out)


def urdf_bodies(
    data: bytes,
    name: str,
    folder: Path,
    T_base_root: Pose | None = None,
    clearance: float | None = None,
    leave_out: Collection[str] = (),
) -> UrdfBodies:
    """
    Return the bodies of a URDF, one for each link with collision elements.

    :param name: the name of the file, for error texts.
    :param folder: the folder to which the names of meshes are relative.
    :param T_base_root: pose of the root link, for a file without the arm; None = the identity.
    :param clearance: the clearance of all bodies [m]; None = the clearance of the cell.
    :param leave_out: the links that do not become bodies.
    :raises UrdfError: the file cannot be used.
    """
    return _UrdfReader(name, folder).bodies(data, T_base_root, clearance, leave_out)


@dataclass(frozen=True, slots=True)
class _UrdfJoint:
    """A joint of the file, at its position 0."""

    name: str
    parent: str
    T_parent_child: Pose
    is_moving: bool
    element: Element


class _UrdfReader:
    """Reads one file; ``name`` is its name in error texts."""

    def __init__(self, name: str, folder: Path) -> None:
        self._name, self._folder = name, folder

    def bodies(
        self,
        data: bytes,
        T_base_root: Pose | None,
        clearance: float | None,
        leave_out: Collection[str],
    ) -> UrdfBodies:
        """Return the bodies, see :func:`urdf_bodies`."""
        robot = self._robot(data)
        links = self._links(robot)
        for link in leave_out:
            if link not in links:
                self._refuse(
                    f'has no link {shortened(link)}, which leave_out names; '
                    + suggestion(link, links, 'see its <link> elements')
                )
        joints = self._joints(robot, links)
        places = self._places(links, joints)
        arm = self._arm(links, leave_out)
        T_base_root = self._root(places, arm, T_base_root)
        bodies: list[CellBody] = []
        moving: dict[str, None] = {}
        for link, element in links.items():
            if link in arm or link in leave_out or element.find('collision') is None:
                continue
            carrier = ''
            for joint in _joints_above(link, joints):
                if joint.is_moving:
                    moving[joint.name] = None
                if FRAMES[arm.get(joint.parent, 'base')]:
                    carrier = joint.parent
                    break
            if carrier in arm:
                frame, T_frame_link = arm[carrier], places[carrier].inverse() @ places[link]
            else:
                frame, T_frame_link = 'base', T_base_root @ places[link]
            bodies.append(self._body(link, element, frame, T_frame_link, clearance))
        for base in (link for link, frame in arm.items() if not FRAMES[frame]):
            below = (each.name for each in _joints_above(base, joints) if each.is_moving)
            moving.update(dict.fromkeys(below))
        return UrdfBodies(
            tuple(bodies),
            tuple(f'The joint {each} of {self._name} moves; it is taken at 0.' for each in moving),
        )

    # -- the file ------------------------------------------------------------------------------

    def _robot(self, data: bytes) -> Element:
        if len(data) > _MAX_LENGTH:
            self._refuse(f'is longer than {_MAX_LENGTH // 1_000_000} MB')
        builder, parser = TreeBuilder(), expat.ParserCreate()

        def begin(tag: str, attributes: dict[str, str]) -> None:
            if tag.startswith('xacro:'):
                self._refuse(
                    f'is no URDF yet: it has <{shortened(tag)}>; make one of it by `xacro`',
                    parser.CurrentLineNumber,
                )
            builder.start(tag, {**attributes, _LINE: str(parser.CurrentLineNumber)})

        def entity(*_: Any) -> None:
            self._refuse('defines an entity, which is not allowed', parser.CurrentLineNumber)

        parser.StartElementHandler, parser.EndElementHandler = begin, builder.end
        parser.EntityDeclHandler = entity
        try:
            parser.Parse(data, True)
        except expat.ExpatError as error:
            self._refuse(f'is no XML: {expat.ErrorString(error.code)}', error.lineno)
        except (LookupError, ValueError) as error:
            if isinstance(error, UrdfError):
                raise
            self._refuse('is no XML: its encoding is unknown', 1)
        robot = builder.close()
        if robot.tag != 'robot':
            self._refuse(
                f'is no URDF: it begins with <{shortened(robot.tag)}>, not <robot>', robot
            )
        return robot

    def _links(self, robot: Element) -> dict[str, Element]:
        links: dict[str, Element] = {}
        for link in robot.findall('link'):
            name = self._attribute(link, 'name')
            if name in links:
                self._refuse(f'uses the name {shortened(name)} for two links', link)
            links[name] = link
        if not links:
            self._refuse('has no link', robot)
        if len(links) > _MAX_LINKS:
            self._refuse(f'has more than {_MAX_LINKS} links')
        return links

    def _joints(self, robot: Element, links: Collection[str]) -> dict[str, _UrdfJoint]:
        """Return the joint above each link."""
        joints: dict[str, _UrdfJoint] = {}
        for element in robot.findall('joint'):
            name, kind = self._attribute(element, 'name'), self._attribute(element, 'type')
            if kind != 'fixed' and kind not in _MOVING:
                self._refuse(
                    f'has the joint {shortened(name)} of the type {shortened(kind)}, which is '
                    'unknown',
                    element,
                )
            ends = []
            for tag in ('parent', 'child'):
                if (end := element.find(tag)) is None:
                    self._refuse(f'has the joint {shortened(name)} without <{tag}>', element)
                ends.append(link := self._attribute(end, 'link'))
                if link not in links:
                    self._refuse(f'has no link {shortened(link)}, which a joint names', end)
            parent, child = ends
            if child in joints:
                self._refuse(
                    f'has the link {shortened(child)} at two joints, {shortened(name)} and '
                    f'{shortened(joints[child].name)}',
                    element,
                )
            joints[child] = _UrdfJoint(
                name, parent, self._origin(element), kind != 'fixed', element
            )
        return joints

    def _places(
        self, links: Mapping[str, Element], joints: Mapping[str, _UrdfJoint]
    ) -> dict[str, Pose]:
        """Return ``T_root_link`` of each link, with all joints at 0."""
        roots = [link for link in links if link not in joints]
        if len(roots) > 1:
            self._refuse(
                f'has two roots, {shortened(roots[0])} and {shortened(roots[1])}; connect them by '
                'a joint',
                links[roots[1]],
            )
        places = dict.fromkeys(roots, IDENTITY)
        for link in links:
            chain: dict[str, None] = {}
            while link not in places:
                if link in chain:
                    self._refuse(
                        f'has joints that lead from the link {shortened(link)} back to it',
                        joints[link].element,
                    )
                chain[link] = None
                link = joints[link].parent
            for each in reversed(chain):
                places[each] = places[joints[each].parent] @ joints[each].T_parent_child
        return places

    def _arm(self, links: Collection[str], leave_out: Collection[str]) -> dict[str, str]:
        """Return the frame in the cell for each link of the arm; empty if there is no arm."""
        first, *others = _MOVED_LINKS
        prefixes = [
            prefix
            for prefix in (link[: -len(first)] for link in links if link.endswith(first))
            if all(prefix + other in links for other in others)
            and not all(prefix + other in leave_out for other in _MOVED_LINKS)
        ]
        if len(prefixes) > 1:
            self._refuse(
                f'has two arms, with the prefixes "{shortened(prefixes[0])}" and '
                f'"{shortened(prefixes[1])}"; put the links of the one that does not belong to '
                'this driver into leave_out'
            )
        return {
            prefix + link: frame
            for prefix in prefixes
            for link, frame in _ARM_FRAMES.items()
            if prefix + link in links
        }

    def _root(
        self, places: Mapping[str, Pose], arm: Mapping[str, str], T_base_root: Pose | None
    ) -> Pose:
        """Return ``T_base_root``, from the place of the arm if the file contains one."""
        if not arm:
            return T_base_root or IDENTITY
        bases = {frame: link for link, frame in arm.items() if not FRAMES[frame]}
        if not bases:
            self._refuse('has an arm without base_link')
        if T_base_root is not None:
            self._refuse(
                f'has the arm itself (its link {shortened(min(bases.values()))}), so the arm '
                'decides where all else is; give no position and no orientation'
            )
        if 'base' in bases:
            return places[bases['base']].inverse()
        return T_BASE_BASE_LINK @ places[bases['base_link']].inverse()

    # -- a link --------------------------------------------------------------------------------

    def _body(
        self,
        link: str,
        element: Element,
        frame: str,
        T_frame_link: Pose,
        clearance: float | None,
    ) -> CellBody:
        shapes = []
        for collision in element.findall('collision'):
            geometry = collision.find('geometry')
            kinds = [] if geometry is None else [each for each in geometry if each.tag is not None]
            if len(kinds) != 1:
                self._refuse(f'has a collision of {shortened(link)} without a shape', collision)
            try:
                shape = self._shape(kinds[0])
                shapes.append(PlacedShape(shape, self._origin(collision)))
            except UrdfError:
                raise
            except OSError as error:
                fault = f'the mesh of {shortened(link)} cannot be read: {error.strerror}'
                self._refuse(f'needs a file: {fault}', kinds[0])
            except ValueError as error:
                self._refuse(f'has a collision of {shortened(link)}: {error}', kinds[0])
        try:
            return CellBody(
                name=link,
                shapes=tuple(shapes),
                frame=frame,
                T_frame_body=T_frame_link,
                clearance=clearance,
            )
        except ValueError as error:
            self._refuse(f'has the link {shortened(link)}: {error}', element)

    def _shape(self, element: Element) -> Shape:
        match element.tag:
            case 'box':
                return Box(self._vector(element, 'size'))
            case 'cylinder':
                return Cylinder(self._number(element, 'radius'), self._number(element, 'length'))
            case 'sphere':
                return Sphere(self._number(element, 'radius'))
            case 'mesh':
                scale = self._vector(element, 'scale', (1.0, 1.0, 1.0))
                return read_mesh(self._mesh_path(element), scale)
        raise ValueError(
            f'a {shortened(element.tag)} is not known; known are box, cylinder, sphere and mesh'
        )

    def _mesh_path(self, element: Element) -> Path:
        name = self._attribute(element, 'filename')
        if '://' not in name:
            return self._folder / name
        parts = urlsplit(name)
        if parts.scheme == 'file':
            return Path(unquote(parts.path))
        if parts.scheme != 'package':
            raise ValueError(
                f'the mesh {shortened(name)} is neither package:// nor file:// nor the name of a '
                'file'
            )
        package, _, rest = name.removeprefix('package://').partition('/')
        if (share := installed_share(package)) is None:
            raise ValueError(
                f'the package {shortened(package)} of a mesh is not installed; source the '
                'workspace that has it'
            )
        return share / rest

    # -- values --------------------------------------------------------------------------------

    def _origin(self, element: Element) -> Pose:
        origin = element.find('origin')
        if origin is None:
            return IDENTITY
        xyz, rpy = (self._vector(origin, key, (0.0, 0.0, 0.0)) for key in ('xyz', 'rpy'))
        return Pose(xyz, quaternion_from_roll_pitch_yaw(*rpy))

    def _attribute(self, element: Element, key: str) -> str:
        if not (value := element.get(key)):
            self._refuse(f'has a <{shortened(element.tag)}> without {key}', element)
        return value

    def _number(self, element: Element, key: str) -> float:
        return self._numbers(element, key, self._attribute(element, key), 1)[0]

    def _vector(self, element: Element, key: str, default: Vector3 | None = None) -> Vector3:
        if default is not None and element.get(key) is None:
            return default
        return vector3(self._numbers(element, key, self._attribute(element, key), 3))

    def _numbers(self, element: Element, key: str, text: str, count: int) -> list[float]:
        try:
            values = [float(word) for word in text.split()]
        except ValueError:
            values = []
        if len(values) != count or not all(map(isfinite, values)):
            wanted = 'a finite number' if count == 1 else 'three finite numbers'
            self._refuse(
                f'has {key}="{shortened(text)}" in <{element.tag}>; it must be {wanted}', element
            )
        return values

    def _refuse(self, fault: str, where: Element | int = 0) -> NoReturn:
        line = int(where.get(_LINE, 0)) if isinstance(where, Element) else where
        raise UrdfError(printable(f'{f"line {line} of " if line else ""}{self._name} {fault}'))


def _joints_above(link: str, joints: Mapping[str, _UrdfJoint]) -> Iterator[_UrdfJoint]:
    """Yield the joints from a link up to the root."""
    while link in joints:
        yield joints[link]
        link = joints[link].parent
