# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Kinematic calibrations: read from a file, or random.

Both kinds describe the joint axes in space; the common normals of the axes give the DH table. If
two axes are nearly parallel (shoulder lift, elbow, wrist 1), their common normal can lie far away.
Real robots therefore report lengths of many metres, which cancel out.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import atan2, isfinite
from pathlib import Path
from typing import Any

import numpy as np

from ur_cartesian_driver.kinematics.calibration_file import CALIBRATION_FIELDS, CALIBRATION_LINKS
from ur_cartesian_driver.kinematics.robot_models import DhTable, RobotModel
from ur_cartesian_driver.motion.geometry.arrays import Floats

#: Standard deviations of the turn [rad] and of the shift [m] of each axis in a random calibration;
#: all axes together displace the flange by 1 to 2 mm, as on real arms.
AXIS_TURN, AXIS_SHIFT = 1e-3, 3e-4

# Axes at a smaller angle [rad] are treated as parallel, because files are rounded to ten digits.
_PARALLEL = 1e-8
# Tolerated deviation of the first joint axis from the z axis of the base [m, rad].
_OFF_AXIS = 1e-9


@dataclass(slots=True)
class _Axes:
    """The joint axes and the flange of an arm with all joints at 0, in base axes."""

    #: A point on each joint axis [m] (6, 3).
    points: Floats
    #: The direction of each joint axis (6, 3).
    directions: Floats
    #: The pose of the flange (4, 4); its origin and its z axis lie on the last joint axis.
    flange: Floats


def read_calibration(path: Path, model: RobotModel) -> DhTable:
    """
    Return the DH table of a calibration file.

    Such files are written by ``ur-cartesian calibration`` and by ``ur_calibration`` of the UR ROS
    driver.

    In the file, ``kinematics`` has the entries shoulder, upper_arm, forearm, wrist_1, wrist_2 and
    wrist_3. Each is the pose of a joint in the preceding link: x y z [m], roll pitch yaw [rad].

    :raises OSError: the file cannot be read.
    :raises ValueError: the file is not such a calibration; the text names the file and the fault.
    """
    import yaml

    try:
        content = yaml.safe_load(path.read_text(encoding='utf-8'))
    except (yaml.YAMLError, UnicodeDecodeError) as error:
        raise ValueError(
            f'The calibration {path} is not YAML: {" ".join(str(error).split())}'
        ) from None
    links = content.get('kinematics') if isinstance(content, Mapping) else None
    if not isinstance(links, Mapping):
        raise ValueError(f'The calibration {path} has no mapping `kinematics`.')
    poses = [_link(path, links, name) for name in CALIBRATION_LINKS]
    return _table(_axes_of_links(poses, path), model)


def random_calibration(model: RobotModel, seed: int) -> DhTable:
    """
    Return the DH table of an arm whose axes deviate at random, by as much as on real arms.

    :raises ValueError: the seed is negative.
    """
    if seed < 0:
        raise ValueError(f'The seed of the calibration is {seed}; use 0 or more.')
    random = np.random.default_rng(seed)
    axes = _nominal_axes(model.geometry)
    for i in range(1, 6):
        axes.directions[i] = _turned(axes.directions[i], random.normal(0.0, AXIS_TURN, 3))
        axes.points[i] += random.normal(0.0, AXIS_SHIFT, 3)
    # A DH table ends on the last axis, so the flange has to lie on that axis.
    axes.flange = _flange_on(axes)
    return _table(axes, model)


def _link(path: Path, links: Mapping[Any, Any], name: str) -> Floats:
    """Return the pose of a joint in the preceding link (4, 4)."""
    link = links.get(name)
    values = []
    for field in CALIBRATION_FIELDS:
        value = link.get(field) if isinstance(link, Mapping) else None
        if isinstance(value, bool) or not isinstance(value, int | float) or not isfinite(value):
            raise ValueError(
                f'The calibration {path} gives {value!r} as kinematics.{name}.{field}; '
                'it must be a number.'
            )
        values.append(float(value))
    x, y, z, roll, pitch, yaw = values
    T = _turn('z', yaw) @ _turn('y', pitch) @ _turn('x', roll)
    T[:3, 3] = x, y, z
    return T


def _axes_of_links(links: list[Floats], path: Path) -> _Axes:
    T = np.eye(4)
    points, directions = [], []
    for link in links:
        T = T @ link
        points.append(T[:3, 3])
        directions.append(T[:3, 2])
    off_axis = np.abs([*points[0][:2], *directions[0][:2]]).max() > _OFF_AXIS
    if off_axis or directions[0][2] < 0.0:
        raise ValueError(
            f'The calibration {path} moves the shoulder off the axis of the base: '
            'its x, y, roll and pitch must be 0.'
        )
    return _Axes(np.array(points), np.array(directions), T)


def _nominal_axes(geometry: DhTable) -> _Axes:
    T = np.eye(4)
    points, directions = [], []
    for theta, d, a, alpha in zip(
        geometry.theta, geometry.d, geometry.a, geometry.alpha, strict=True
    ):
        points.append(T[:3, 3])
        directions.append(T[:3, 2])
        T = T @ _turn('z', theta) @ _shift(a, 0.0, d) @ _turn('x', alpha)
    return _Axes(np.array(points), np.array(directions), T)


def _table(axes: _Axes, model: RobotModel) -> DhTable:
    """Return the DH table, whose x axes are the common normals of consecutive joint axes."""
    rows = []
    origin, x, z = np.zeros(3), np.array([1.0, 0.0, 0.0]), axes.directions[0]
    for i in range(1, 6):
        following = axes.directions[i]
        normal, d, a = _common_normal(origin, z, axes.points[i], following)
        alpha = _angle(normal, z, following)
        # Of the two directions of the normal, choose the one with the signs of the model's table.
        nominal_a, nominal_alpha = model.geometry.a[i - 1], model.geometry.alpha[i - 1]
        if (a * nominal_a if nominal_a else alpha * nominal_alpha) < 0.0:
            normal, a, alpha = -normal, -a, -alpha
        rows.append((_angle(z, x, normal), d, a, alpha))
        origin, x, z = origin + d * z + a * normal, normal, following
    flange_x, flange = axes.flange[:3, 0], axes.flange[:3, 3]
    rows.append((_angle(z, x, flange_x), float(z @ (flange - origin)), 0.0, 0.0))
    thetas, ds, lengths, alphas = (
        (c[0], c[1], c[2], c[3], c[4], c[5]) for c in zip(*rows, strict=True)
    )
    return DhTable(theta=thetas, d=ds, a=lengths, alpha=alphas)


def _common_normal(
    origin: Floats, z: Floats, point: Floats, following: Floats
) -> tuple[Floats, float, float]:
    """
    Return the common normal of two joint axes.

    :param origin: a point on the first axis, whose direction is ``z`` [m].
    :param point: a point on the second axis, whose direction is ``following`` [m].
    :returns: the direction of the normal; the coordinate of its foot along ``z`` from ``origin``
        [m]; its length, positive along the direction [m].
    """
    normal = np.cross(z, following)
    size = float(np.linalg.norm(normal))
    if size > _PARALLEL:
        normal /= size
        d, a, _ = np.linalg.solve(np.column_stack([z, normal, -following]), point - origin)
        return normal, float(d), float(a)
    # Parallel axes have many common normals; choose the one that begins at ``origin``.
    across = point - origin
    across = across - z * (z @ across)
    a = float(np.linalg.norm(across))
    return across / a, 0.0, a


def _flange_on(axes: _Axes) -> Floats:
    """Return the flange, moved so that its origin is on the last axis and its z along the axis."""
    z, point, flange = axes.directions[5], axes.points[5], axes.flange
    x = flange[:3, 0] - z * (z @ flange[:3, 0])
    x /= np.linalg.norm(x)
    T = np.eye(4)
    T[:3, :3] = np.column_stack([x, np.cross(z, x), z])
    T[:3, 3] = point + z * (z @ (flange[:3, 3] - point))
    return T


def _angle(axis: Floats, start: Floats, end: Floats) -> float:
    return atan2(float(axis @ np.cross(start, end)), float(start @ end))


def _turned(direction: Floats, by: Floats) -> Floats:
    """Return a direction turned by a small rotation vector [rad]."""
    turned = direction + np.cross(by, direction)
    return turned / np.linalg.norm(turned)


def _turn(axis: str, angle: float) -> Floats:
    T = np.eye(4)
    i, j = {'x': (1, 2), 'y': (2, 0), 'z': (0, 1)}[axis]
    T[i, i] = T[j, j] = np.cos(angle)
    T[j, i] = np.sin(angle)
    T[i, j] = -T[j, i]
    return T


def _shift(x: float, y: float, z: float) -> Floats:
    T = np.eye(4)
    T[:3, 3] = x, y, z
    return T
