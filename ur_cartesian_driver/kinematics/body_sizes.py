# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Places and sizes of the collision bodies, for each model.

Sources. UR3, UR5 and UR10: the meshes in the package example-robot-data. UR3e and UR5e (also for
the UR7e): the collision meshes in airo-models, convex hulls that are thicker than the arm.
UR10e to UR16e, UR20 and UR30: the shapes in the packages ir-support and ir-support-extra-robots,
which are made for teaching; the base of their UR16e, which is larger than in the data sheet, and
the place of its wrist 3 are not used. No package has shapes of UR15, UR18 and UR8 Long, so their
bodies are assumed: the bodies of a UR20, scaled by the footprints in the data sheets (204 and
245 mm), with 10 mm more on each side; the places where links meet are from the ROS 2 description
package of Universal Robots. Tests check that the bodies contain the meshes of the first two
packages.

The connector of the robot cable is at +y of ``base`` in all of these shapes. The meshes of UR3 and
UR5 contain the connector (ir-support draws a longer one on the UR5); on the UR10 it ends inside
the base. On UR3e and UR5e the connector is assumed to fill a cylinder as wide as the ball that
represents it in airo-models; this cylinder contains the drawn cable above the mounting surface. On
the UR10e the connector consists of the drawn socket and cable, and 15 mm for a plug; from this,
the connectors of the larger models are derived. The cable beyond the connector, which can be laid
anywhere, is not part of the arm.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import TypeAlias

#: Beginning and end of a body along the joint's axis, from the origin of the nominal DH frame, and
#: its radius [mm]. A tube whose beginning and end differ is a cylinder about the joint's axis that
#: is swept along the tube: the hull of two housings.
BodyRow: TypeAlias = tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class BodySizes:
    """
    The bodies of one size of arm.

    :param connector: x and z [mm] of the middle of the connector, in ``base``.
    :param rows: in the order of ``_BODIES`` in :mod:`~.collision_bodies`; None = the arm has no
        such body.
    """

    connector: tuple[float, float]
    rows: tuple[BodyRow | None, ...]


_UR3 = BodySizes(
    (-6.0, 5.5),
    (
        (-1.0, 66.5, 64.5),
        (0.0, 100.0, 13.0),
        (63.5, 86.5, 48.5),
        (85.0, 209.5, 46.5),
        (9.0, 54.5, 46.5),
        (53.5, 177.5, 46.5),
        (118.0, 118.0, 48.0),
        (69.0, 178.0, 39.5),
        (9.5, 78.5, 44.0),
        (27.0, 27.0, 34.5),
        (-19.5, 70.0, 33.0),
        (65.0, 99.0, 33.0),
        (-47.0, 43.0, 34.5),
        (38.0, 72.0, 34.5),
        (-48.5, 41.5, 34.5),
        (40.0, 81.9, 36.5),
    ),
)
_UR5 = BodySizes(
    (-6.5, 6.5),
    (
        (-3.5, 21.5, 74.0),
        (0.0, 114.5, 14.5),
        None,
        (23.5, 158.0, 60.5),
        (15.0, 71.0, 60.0),
        (70.0, 205.0, 61.5),
        (136.0, 136.0, 59.5),
        (70.0, 205.0, 61.0),
        (-13.5, 71.5, 63.5),
        (18.5, 18.5, 43.0),
        (-41.5, 64.0, 40.0),
        (63.0, 149.5, 38.5),
        (-58.0, 48.0, 39.5),
        (48.5, 84.0, 38.5),
        (-58.0, 48.0, 39.5),
        (47.0, 82.3, 43.5),
    ),
)
_UR10 = BodySizes(
    (0.0, 19.0),
    (
        (-0.5, 38.5, 95.5),
        (0.0, 95.0, 15.0),
        None,
        (37.5, 216.0, 76.5),
        (12.0, 86.5, 79.5),
        (85.0, 264.0, 77.0),
        (176.0, 176.0, 78.5),
        (115.5, 242.0, 63.0),
        (-20.5, 117.0, 63.0),
        (48.5, 48.5, 62.0),
        (-8.5, 110.5, 48.0),
        (109.5, 154.0, 46.5),
        (-57.5, 62.5, 46.5),
        (61.5, 103.5, 46.5),
        (-58.0, 62.5, 47.0),
        (61.0, 92.2, 46.5),
    ),
)
_UR3E = BodySizes(
    (0.0, 20.0),
    (
        (-0.5, 74.5, 65.5),
        (0.0, 110.0, 30.0),
        (71.5, 95.5, 50.5),
        (94.0, 210.5, 56.5),
        (31.5, 63.5, 57.0),
        None,
        (62.5, 178.5, 48.0),
        None,
        None,
        (-20.0, 78.0, 39.0),
        None,
        (77.0, 162.5, 51.0),
        (-46.5, 50.5, 36.5),
        (49.5, 67.0, 44.5),
        (-47.0, 51.0, 37.5),
        (50.0, 92.3, 38.0),
    ),
)
_UR5E = BodySizes(
    (0.0, 20.0),
    (
        (-0.5, 74.5, 78.5),
        (0.0, 115.0, 30.0),
        (72.0, 99.5, 64.0),
        (98.0, 232.5, 63.0),
        (18.0, 75.0, 78.0),
        None,
        (59.5, 210.5, 61.5),
        None,
        (31.0, 61.0, 59.5),
        (-50.0, 61.0, 56.5),
        None,
        (59.0, 170.0, 57.0),
        (-57.0, 54.0, 45.0),
        (53.0, 84.0, 54.0),
        (-57.5, 53.5, 42.5),
        (53.5, 99.8, 44.0),
    ),
)
_UR10E = BodySizes(
    (0.0, 39.0),
    (
        (-1.0, 70.0, 98.5),
        (0.0, 130.0, 40.0),
        (67.0, 100.0, 77.5),
        (94.0, 276.0, 84.5),
        (-86.0, 95.0, 80.5),
        (84.5, 261.0, 79.5),
        (167.5, 167.5, 80.0),
        (102.5, 237.5, 63.0),
        (1.5, 112.0, 65.5),
        (34.5, 34.5, 66.5),
        (-24.0, 95.5, 53.0),
        (94.0, 158.5, 46.0),
        (-57.5, 57.5, 48.5),
        (56.0, 88.5, 46.5),
        (-58.5, 57.5, 55.5),
        (56.0, 116.55, 51.5),
    ),
)
_UR20 = BodySizes(
    (0.0, 50.0),
    (
        (-0.5, 82.5, 123.0),
        (0.0, 168.0, 51.5),
        (80.0, 109.0, 99.5),
        (101.5, 173.0, 124.5),
        (-95.5, 134.5, 111.0),
        None,
        (127.0, 367.5, 93.5),
        None,
        (-29.5, 171.0, 91.0),
        (64.5, 64.5, 93.0),
        (-1.0, 145.0, 56.0),
        (122.5, 259.5, 57.0),
        (26.0, 85.0, 75.5),
        (82.5, 210.5, 61.5),
        (34.0, 99.0, 76.5),
        (87.0, 154.3, 57.0),
    ),
)

#: UR15, UR18 and UR8 Long: no shapes of these arms are public.
_UR15 = BodySizes(
    (0.0, 42.0),
    (
        (-0.5, 79.0, 112.5),
        (0.0, 150.0, 43.0),
        (56.5, 101.0, 93.0),
        (96.0, 176.0, 114.0),
        (-104.5, 108.0, 102.5),
        None,
        (81.0, 302.0, 88.0),
        None,
        (-9.5, 178.0, 86.0),
        (78.5, 78.5, 87.5),
        (14.0, 156.0, 57.0),
        (107.0, 241.5, 57.5),
        (11.5, 81.0, 73.0),
        (62.0, 189.0, 61.5),
        (18.0, 92.5, 74.0),
        (77.0, 143.4, 57.5),
    ),
)
BODY_SIZES: Mapping[str, BodySizes] = MappingProxyType(
    {
        'ur3': _UR3,
        'ur5': _UR5,
        'ur10': _UR10,
        'ur3e': _UR3E,
        'ur5e': _UR5E,
        'ur7e': _UR5E,
        'ur10e': _UR10E,
        'ur12e': _UR10E,
        'ur16e': _UR10E,
        'ur15': _UR15,
        'ur18': _UR15,
        'ur8long': _UR15,
        'ur20': _UR20,
        'ur30': _UR20,
    }
)
