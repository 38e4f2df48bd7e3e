# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Messages of the type moveit_msgs/PlanningScene, by the names of their fields."""

from types import SimpleNamespace as Message

from ur_cartesian_driver.motion.geometry.pose import quaternion_from_rotation_vector

ADD, REMOVE, APPEND, MOVE = (bytes([k]) for k in range(4))
BOX, SPHERE, CYLINDER, CONE = 1, 2, 3, 4


def pose(x=0.0, y=0.0, z=0.0, turn=(0.0, 0.0, 0.0)):
    qx, qy, qz, qw = quaternion_from_rotation_vector(turn)
    return Message(position=Message(x=x, y=y, z=z), orientation=Message(x=qx, y=qy, z=qz, w=qw))


def primitive(kind, *sizes):
    return Message(type=kind, dimensions=list(sizes))


def thing(name, operation=ADD, frame='base', at=None, **lists):
    names = ('primitives', 'primitive_poses', 'meshes', 'mesh_poses', 'planes', 'plane_poses')
    return Message(
        id=name,
        operation=operation,
        header=Message(frame_id=frame),
        pose=at or pose(),
        **{each: lists.get(each, []) for each in names},
    )


def box(name, size=0.1, **fields):
    return thing(name, primitives=[primitive(BOX, size, size, size)], **fields)


def held(item, link='tool0', touch=()):
    return Message(object=item, link_name=link, touch_links=list(touch))


def scene(*objects, attached=(), is_diff=True, octomap=b''):
    return Message(
        is_diff=is_diff,
        world=Message(
            collision_objects=list(objects), octomap=Message(octomap=Message(data=octomap))
        ),
        robot_state=Message(is_diff=is_diff, attached_collision_objects=list(attached)),
    )
