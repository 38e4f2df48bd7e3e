# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The bodies of a cell: their poses, the frames that carry them, and the contacts that are allowed.

A body is fixed in the robot's base, or carried by a link of the arm or by the tool. Frames are
named as in the robot description for ROS, without a prefix.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from math import hypot, isfinite
from types import MappingProxyType

from ur_cartesian_driver.motion.cell.shapes import HalfSpace, Mesh, Shape
from ur_cartesian_driver.motion.errors import shortened, suggestion
from ur_cartesian_driver.motion.geometry.pose import IDENTITY, Pose

#: Distance that the arm keeps from a body, unless the cell gives another [m].
DEFAULT_CLEARANCE = 0.005
#: The largest clearance [m].
MAX_CLEARANCE = 1.0
#: Largest coordinate of a position [m]; a larger one is probably given in millimetres.
MAX_COORDINATE = 100.0
#: Longest name of a body.
_MAX_NAME = 100
_UNIT_TOLERANCE = 1e-6

#: The frames that carry bodies, named as in the robot description, each with the number of its
#: link, 0 = the base; ``tool0_controller`` is the active TCP.
FRAMES: Mapping[str, int] = MappingProxyType(
    {
        'base': 0,
        'base_link': 0,
        'shoulder_link': 1,
        'upper_arm_link': 2,
        'forearm_link': 3,
        'wrist_1_link': 4,
        'wrist_2_link': 5,
        'wrist_3_link': 6,
        'flange': 6,
        'tool0': 6,
        'tool0_controller': 6,
    }
)
#: Parts of the arm that may be allowed to touch a body: its links, and ``tool``, the cylinder
#: around the tool whose radius is the parameter ``tool_radius``.
LINK_NAMES: tuple[str, ...] = (
    'base_link',
    'shoulder_link',
    'upper_arm_link',
    'forearm_link',
    'wrist_1_link',
    'wrist_2_link',
    'wrist_3_link',
    'tool',
)


@dataclass(frozen=True, slots=True)
class PlacedShape:
    """
    A shape of a body, and its pose on the body.

    :raises ValueError: the pose is out of bounds.
    """

    shape: Shape
    T_body_shape: Pose = IDENTITY

    def __post_init__(self) -> None:
        """Check the pose."""
        check_place(self.T_body_shape)


@dataclass(frozen=True, slots=True, kw_only=True)
class CellBody:
    """
    A body of the cell.

    :raises ValueError: the name is invalid, the frame is unknown, there is no shape, the clearance
        or the pose is out of bounds, or the arm carries a half-space.
    """

    name: str
    shapes: tuple[PlacedShape, ...]
    #: The frame that carries the body, one of :data:`FRAMES`.
    frame: str = 'base'
    T_frame_body: Pose = IDENTITY
    #: Distance to keep from the body [m]; None = the clearance of the cell.
    clearance: float | None = None

    def __post_init__(self) -> None:
        """Check the fields."""
        if not (0 < len(self.name) <= _MAX_NAME and self.name.isprintable()):
            raise ValueError(
                f'{shortened(self.name)!r} cannot be the name of a body; use 1 to {_MAX_NAME} '
                'characters that can be printed'
            )
        if self.name in LINK_NAMES or self.name in FRAMES:
            raise ValueError(
                f'"{self.name}" cannot be the name of a body; it is a part of the arm'
            )
        if self.frame not in FRAMES:
            raise ValueError(
                f'its frame "{shortened(self.frame)}" is unknown; '
                + suggestion(self.frame, FRAMES, f'known are {", ".join(FRAMES)}')
            )
        if not self.shapes:
            raise ValueError('it has no shape')
        check_place(self.T_frame_body)
        if self.clearance is not None:
            check_clearance(self.clearance)
        if self.is_carried and any(isinstance(each.shape, HalfSpace) for each in self.shapes):
            raise ValueError(f'a plane has no end, so it cannot move with {self.frame}')

    @property
    def is_carried(self) -> bool:
        """Whether the arm carries the body."""
        return FRAMES[self.frame] > 0

    @property
    def is_on_tool(self) -> bool:
        """Whether the body moves with the flange."""
        return FRAMES[self.frame] == FRAMES['flange']

    @property
    def has_mesh(self) -> bool:
        """Whether a shape of the body is a mesh."""
        return any(isinstance(each.shape, Mesh) for each in self.shapes)


def check_clearance(value: float) -> None:
    """
    Check a clearance.

    :raises ValueError: it is out of bounds; the message is a clause, for use inside a sentence.
    """
    if not (isfinite(value) and 0.0 <= value <= MAX_CLEARANCE):
        raise ValueError(f'the clearance is {value:g} m; it must be from 0 to {MAX_CLEARANCE:g} m')


def check_place(pose: Pose) -> None:
    """
    Check the pose of a body or shape.

    :raises ValueError: a coordinate is out of bounds, or the quaternion is not of length 1; the
        message is a clause, for use inside a sentence.
    """
    for axis, value in zip('xyz', pose.position, strict=True):
        if not abs(value) <= MAX_COORDINATE:
            raise ValueError(
                f'its position has {axis} = {value:g} m; at most {MAX_COORDINATE:g} m are possible'
            )
    if not abs(hypot(*pose.quaternion) - 1.0) <= _UNIT_TOLERANCE:
        raise ValueError(
            f'the length of its quaternion is {hypot(*pose.quaternion):.4g} instead of 1'
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class Cell:
    """
    All bodies of a cell. Immutable.

    :raises ValueError: two bodies share a name, a pair contains an unknown name, or the clearance
        is out of bounds.
    """

    bodies: tuple[CellBody, ...] = ()
    #: Pairs that may touch: names of bodies, or of links (:data:`LINK_NAMES`).
    may_touch: frozenset[frozenset[str]] = frozenset()
    #: Clearance of the bodies that give none [m].
    clearance: float = DEFAULT_CLEARANCE
    #: Remarks on the files from which the cell was read, one sentence each.
    remarks: tuple[str, ...] = field(default=(), compare=False)
    #: The names of the bodies.
    names: frozenset[str] = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        """Check names, pairs and clearance."""
        check_clearance(self.clearance)
        seen: set[str] = set()
        for body in self.bodies:
            if body.name in seen:
                raise ValueError(
                    f'the name "{body.name}" is used twice; give each body a name of its own'
                )
            seen.add(body.name)
        object.__setattr__(self, 'names', frozenset(seen))
        for pair in self.may_touch:
            if len(pair) != 2:
                raise ValueError(f'may_touch: "{", ".join(pair)}" is no pair of two names')
            for name in sorted(pair):
                if name not in seen and name not in LINK_NAMES:
                    raise ValueError(
                        f'may_touch names "{shortened(name)}", which the cell does not have; '
                        + suggestion(name, (*seen, *LINK_NAMES), 'name a body or a link')
                    )

    def __bool__(self) -> bool:
        """Return whether there is any body."""
        return bool(self.bodies)

    def body(self, name: str) -> CellBody:
        """
        Return a body.

        :raises ValueError: the cell has no body of this name; the message is a clause, for use
            inside a sentence.
        """
        for body in self.bodies:
            if body.name == name:
                return body
        raise ValueError(
            f'the cell has no body "{shortened(name)}"; '
            + suggestion(name, self.names, f'it has {", ".join(sorted(self.names)) or "none"}')
        )

    def clearance_of(self, body: CellBody) -> float:
        """Return the distance to keep from a body [m]."""
        return self.clearance if body.clearance is None else body.clearance

    def with_bodies(self, bodies: Iterable[CellBody]) -> Cell:
        """Return the cell with these bodies, which replace bodies of the same name."""
        added = {body.name: body for body in bodies}
        kept = tuple(added.pop(body.name, body) for body in self.bodies)
        return replace(self, bodies=(*kept, *added.values()))

    def without(self, name: str) -> Cell:
        """
        Return the cell without a body.

        :raises ValueError: the cell has no body of this name.
        """
        removed = self.body(name)
        return replace(
            self,
            bodies=tuple(body for body in self.bodies if body is not removed),
            may_touch=frozenset(pair for pair in self.may_touch if name not in pair),
        )

    def moved(self, name: str, frame: str, T_frame_body: Pose) -> Cell:
        """
        Return the cell with a body at another pose, or carried by another frame.

        :raises ValueError: the cell has no body of this name, or the frame is unknown.
        """
        body = replace(self.body(name), frame=frame, T_frame_body=T_frame_body)
        return self.with_bodies([body])


#: A cell without bodies.
EMPTY_CELL = Cell()
