# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The robot description (URDF) of an arm, from its calibrated geometry.

Links, joints and fixed frames have the names of Universal Robots' own description, so programs
made for that description can use this one: ``base_link``; ``base``, which is turned by pi about z;
the six links; ``tool0`` and ``flange``. The links are drawn as meshes if the package of the meshes
is installed, else as cylinders.
"""

from __future__ import annotations

from collections.abc import Iterable
from math import isfinite
from xml.etree import ElementTree
from xml.etree.ElementTree import Element, SubElement

from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.kinematics.link_shapes import (
    ARM_LINKS,
    Detail,
    link_shapes,
    LinkFrames,
    LinkShape,
)
from ur_cartesian_driver.kinematics.robot_models import JOINT_NAMES
from ur_cartesian_driver.motion.geometry.pose import Pose, roll_pitch_yaw_from_quaternion
from ur_cartesian_driver.motion.geometry.vectors import Vector3
from ur_cartesian_driver.motion.goal.known_frames import (
    BASE,
    BASE_LINK,
    FLANGE,
    T_BASE_BASE_LINK,
    T_TOOL0_FLANGE,
    TOOL0,
)

#: The names of the links' frames, in the order of :data:`ARM_LINKS`.
LINK_NAMES: tuple[str, ...] = (BASE, *(f'{link.name.lower()}_link' for link in ARM_LINKS[1:]))

# Colour of the links that have none of their own.
_COLOUR = '0.69 0.72 0.76 1'


def robot_description(arm: Arm, tf_prefix: str = '') -> str:
    """
    Return the URDF of an arm.

    :param arm: nominal or calibrated.
    :param tf_prefix: put in front of the names of joints and links.
    """
    robot = Element('robot', name=arm.model.name)
    frames = LinkFrames(arm)
    _link(robot, tf_prefix + BASE_LINK)
    details: tuple[Detail, ...] = ('visual', 'collision')
    shapes = {detail: link_shapes(arm, detail) for detail in details}
    for number, name in enumerate(LINK_NAMES):
        link = _link(robot, tf_prefix + name)
        for tag in details:
            _add_shapes(link, tag, (shape for shape in shapes[tag] if shape.link == number))
    _fixed(robot, tf_prefix, BASE_LINK, BASE, T_BASE_BASE_LINK.inverse())
    limits = zip(arm.model.position_limits, arm.model.max_joint_speed, strict=True)
    torque = arm.model.max_joint_torque
    for k, ((lower, upper), speed) in enumerate(limits):
        has_limits = isfinite(lower) and isfinite(upper)
        joint = _joint(
            robot,
            tf_prefix + JOINT_NAMES[k],
            'revolute' if has_limits else 'continuous',
            (tf_prefix + LINK_NAMES[k], tf_prefix + LINK_NAMES[k + 1]),
            frames.joints[k],
        )
        SubElement(joint, 'axis', xyz='0 0 1')
        effort = torque[k] if torque else 0.0  # 0: not published
        limit = SubElement(joint, 'limit', velocity=repr(speed), effort=repr(effort))
        if has_limits:
            limit.set('lower', repr(lower))
            limit.set('upper', repr(upper))
    _link(robot, tf_prefix + TOOL0)
    _fixed(robot, tf_prefix, LINK_NAMES[-1], TOOL0, frames.flange)
    _link(robot, tf_prefix + FLANGE)
    _fixed(robot, tf_prefix, TOOL0, FLANGE, T_TOOL0_FLANGE)
    ElementTree.indent(robot)
    return '<?xml version="1.0"?>\n' + ElementTree.tostring(robot, encoding='unicode')


def _link(robot: Element, name: str) -> Element:
    return SubElement(robot, 'link', name=name)


def _add_shapes(link: Element, tag: str, shapes: Iterable[LinkShape]) -> None:
    for shape in shapes:
        body = SubElement(link, tag)
        _origin(body, shape.T_link_shape)
        geometry = SubElement(body, 'geometry')
        if shape.mesh is not None:
            SubElement(geometry, 'mesh', filename=shape.mesh.resolve().as_uri())
        else:
            SubElement(geometry, 'cylinder', radius=repr(shape.radius), length=repr(shape.length))
        if tag == 'visual' and (shape.mesh is None or shape.mesh.suffix == '.obj'):
            material = SubElement(body, 'material', name='links')
            SubElement(material, 'color', rgba=_COLOUR)


def _joint(
    robot: Element, name: str, kind: str, links: tuple[str, str], T_parent_child: Pose
) -> Element:
    joint = SubElement(robot, 'joint', name=name, type=kind)
    SubElement(joint, 'parent', link=links[0])
    SubElement(joint, 'child', link=links[1])
    _origin(joint, T_parent_child)
    return joint


def _fixed(robot: Element, tf_prefix: str, parent: str, child: str, T_parent_child: Pose) -> None:
    links = (tf_prefix + parent, tf_prefix + child)
    _joint(robot, f'{tf_prefix}{parent}-{child}', 'fixed', links, T_parent_child)


def _origin(element: Element, pose: Pose) -> None:
    rpy = roll_pitch_yaw_from_quaternion(pose.quaternion)
    SubElement(element, 'origin', xyz=_text(pose.position), rpy=_text(rpy))


def _text(values: Vector3) -> str:
    return ' '.join(repr(float(value)) for value in values)
