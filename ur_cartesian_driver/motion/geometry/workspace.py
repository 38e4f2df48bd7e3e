# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Planes that the arm must not cross, read from the parameter ``workspace_planes``."""

from __future__ import annotations

from dataclasses import dataclass
from math import hypot, inf, isfinite


@dataclass(frozen=True, slots=True)
class Plane:
    """A plane with the arm on one side of it: a table, a wall, the border of a cell."""

    name: str
    #: A point on the plane, in ``base`` (the frame of the controller, not ``base_link``) [m].
    point: tuple[float, float, float]
    #: Unit normal in ``base``, pointing to the allowed side.
    normal: tuple[float, float, float]
    #: Distance that the arm keeps from the plane [m].
    margin: float = 0.0

    @classmethod
    def parse(cls, text: str) -> Plane:
        """
        Read ``name x y z nx ny nz [margin]`` [m] in ``base``; the normal is scaled to length 1.

        :raises ValueError: the text does not have this form, or a number in it is not allowed.
        """
        words = text.split()
        if len(words) not in (7, 8):
            raise ValueError(
                f'workspace_planes: "{text}" has {len(words)} words instead of 7 or 8; write '
                '"name x y z nx ny nz [margin]" [m], a point on the plane and the normal into '
                'the allowed side, both in base.'
            )
        name, *texts = words
        try:
            x, y, z, nx, ny, nz, *rest = (float(number) for number in texts)
        except ValueError as error:
            raise ValueError(f'workspace_planes: "{name}": {error}.') from None
        margin = rest[0] if rest else 0.0
        if not all(isfinite(v) for v in (x, y, z, nx, ny, nz, margin)):
            raise ValueError(f'workspace_planes: "{name}" has a number that is not finite.')
        if margin < 0.0:
            raise ValueError(
                f'workspace_planes: the margin {margin:g} of "{name}" is negative; move the '
                'point instead.'
            )
        length = hypot(nx, ny, nz)
        length = 0.0 if length < 1e-6 else length
        if not 0.0 < length < inf:
            raise ValueError(
                f'workspace_planes: the normal of "{name}" is {"too long" if length else "zero"}; '
                'it points into the allowed side.'
            )
        return cls(name, (x, y, z), (nx / length, ny / length, nz / length), margin)


def parse_planes(texts: tuple[str, ...]) -> tuple[Plane, ...]:
    """
    Read all planes.

    :raises ValueError: a plane cannot be read, or two have the same name.
    """
    planes = tuple(Plane.parse(text) for text in texts)
    names = [plane.name for plane in planes]
    for name in names:
        if names.count(name) > 1:
            raise ValueError(
                f'workspace_planes: "{name}" appears twice; give each plane a name of its own.'
            )
    return planes
