# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Bodies in reach of a simulated arm's tool: planes and boxes that push back as springs."""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import hypot, isfinite

from ur_cartesian_driver.motion.geometry.vectors import (
    add,
    dot,
    norm,
    scale,
    subtract,
    Vector3,
    vector3,
    ZERO3,
)

#: Below this speed [m/s] along a surface, friction is proportional to the speed.
STICKING_SPEED = 1e-3
#: Higher stiffness [N/m] or damping [N s/m] would be unstable at the cycle of the controller.
MAX_STIFFNESS, MAX_DAMPING = 1e5, 500.0
_SHAPES = {'plane': 'x y z nx ny nz', 'box': 'x y z dx dy dz'}
_PROPERTIES = ('stiffness', 'damping', 'friction')


@dataclass(frozen=True, slots=True)
class ContactBody:
    """
    A body that is fixed in the robot's base; all coordinates are in the base frame.

    :param shape: 'plane' = the half-space on the side of a plane away from its normal; 'box' = a
        box along the axes of the base.
    :param place: a point on the plane, or the centre of the box [m].
    :param extent: the normal of the plane, which points out of the body; or the edge lengths of
        the box [m].
    :param stiffness: force per depth [N/m].
    :param damping: force per speed along the normal [N s/m].
    :param friction: force along the surface per force along the normal.
    """

    shape: str
    place: Vector3
    extent: Vector3
    stiffness: float = 20e3
    damping: float = 100.0
    friction: float = 0.2

    @classmethod
    def parse(cls, text: str) -> ContactBody:
        """
        Read ``plane x y z nx ny nz`` or ``box x y z dx dy dz`` with properties like ``damping=9``.

        :raises ValueError: the text has another form, or a number is out of range.
        """
        shape, *words = text.split() or ['']
        try:
            numbers = [float(word) for word in words if '=' not in word]
            given = {
                name: float(value)
                for name, _, value in (word.partition('=') for word in words if '=' in word)
            }
        except ValueError:
            given, numbers = {}, []
        if shape not in _SHAPES or len(numbers) != 6 or set(given) - set(_PROPERTIES):
            forms = ' or '.join(f'"{name} {form}"' for name, form in _SHAPES.items())
            raise ValueError(
                f'contact: "{text}" is not {forms} with numbers in the base [m], followed by '
                f'{", ".join(f"{name}=..." for name in _PROPERTIES)} where these differ.'
            )
        return cls(shape, vector3(numbers[:3]), vector3(numbers[3:]), **given)._checked(text)

    def _checked(self, text: str) -> ContactBody:
        every = (*self.place, *self.extent, *(getattr(self, name) for name in _PROPERTIES))
        if not all(map(isfinite, every)) or self.friction < 0.0:
            raise ValueError(f'contact: "{text}" has a number that is not possible.')
        for name, bound in (('stiffness', MAX_STIFFNESS), ('damping', MAX_DAMPING)):
            if not 0.0 <= getattr(self, name) <= bound:
                raise ValueError(f'contact: {name} of "{text}" is not within 0..{bound:g}.')
        if self.shape == 'box':
            if min(self.extent) <= 0.0:
                raise ValueError(f'contact: the edges of "{text}" must be longer than 0.')
            return self
        length = hypot(*self.extent)
        if length < 1e-6:
            raise ValueError(f'contact: the normal of "{text}" is zero.')
        return replace(self, extent=scale(self.extent, 1.0 / length))

    def force(self, point: Vector3, velocity: Vector3) -> Vector3:
        """Return the force [N] of the body on a tool at a point [m] with a velocity [m/s]."""
        depth, normal = self._depth(point)
        if depth <= 0.0:
            return ZERO3
        speed = dot(velocity, normal)
        pressure = max(0.0, self.stiffness * depth - self.damping * speed)
        sliding = subtract(velocity, scale(normal, speed))
        drag = self.friction * pressure / max(norm(sliding), STICKING_SPEED)
        return add(scale(normal, pressure), scale(sliding, -drag))

    def _depth(self, point: Vector3) -> tuple[float, Vector3]:
        """Return a point's depth [m] (outside: negative) and the normal of the nearest face."""
        if self.shape == 'plane':
            return dot(subtract(self.place, point), self.extent), self.extent
        found: tuple[float, Vector3] = (float('inf'), ZERO3)
        for axis in range(3):
            for side in (-1.0, 1.0):
                face = self.place[axis] + side * 0.5 * self.extent[axis]
                depth = side * (face - point[axis])
                if depth < found[0]:
                    normal = [0.0, 0.0, 0.0]
                    normal[axis] = side
                    found = depth, vector3(normal)
        return found
