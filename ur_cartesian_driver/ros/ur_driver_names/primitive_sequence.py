# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
A sequence of motion primitives as a goal: primitive i becomes point i and segment i.

The fields have the same meaning as in motion_primitives_controllers and in the UR driver's
hardware interface: an arc has its goal first and its via second, joint positions are in the order
of the arm, and a move_time of more than 0 replaces velocity and acceleration; an arc that has both
is executed at its velocity.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import accumulate
from math import nan

from ur_cartesian_driver.kinematics.robot_models import JOINT_NAMES
from ur_cartesian_driver.motion.errors import InvalidGoal
from ur_cartesian_driver.motion.geometry.pose import Pose
from ur_cartesian_driver.motion.goal.goal import Goal, Posture, Segment, SegmentType, Waypoint
from ur_cartesian_driver.motion.goal.known_frames import BASE
from ur_cartesian_driver.ros.message_fields import Message, pose_from_message

#: ``MotionPrimitive.type``.
LINEAR_JOINT, LINEAR_CARTESIAN, CIRCULAR_CARTESIAN = 0, 50, 51
#: The additional arguments.
VELOCITY, ACCELERATION, MOVE_TIME = 'velocity', 'acceleration', 'move_time'
_ARGUMENTS = (VELOCITY, ACCELERATION, MOVE_TIME)
#: Greater speeds, accelerations and times must be mistakes.
_MAX_ARGUMENT = 1e5
_TYPES = {
    LINEAR_JOINT: 'LINEAR_JOINT',
    LINEAR_CARTESIAN: 'LINEAR_CARTESIAN',
    CIRCULAR_CARTESIAN: 'CIRCULAR_CARTESIAN',
}
_NO_POSE = Pose((nan, nan, nan), (nan, nan, nan, nan))


def goal_of_sequence(motions: Sequence[Message], tf_prefix: str) -> Goal:
    """
    Return the goal for the ``motions`` of a ``MotionPrimitiveSequence``.

    :param tf_prefix: the prefix of the driver's joint and frame names.
    :raises InvalidGoal: the sequence is empty, or a primitive cannot be executed; the text names
        the primitive and its field.
    """
    check_targets(motions)
    primitives = [_Primitive.of(i, motion) for i, motion in enumerate(motions)]
    _check_times(primitives)
    times = accumulate(primitive.time for primitive in primitives)
    return Goal(
        frame_id=_frame(primitives, tf_prefix + BASE),
        waypoints=tuple(
            primitive.waypoint(time, tf_prefix)
            for primitive, time in zip(primitives, times, strict=True)
        ),
        segments=tuple(primitive.segment() for primitive in primitives),
    )


def check_targets(motions: Sequence[Message]) -> None:
    """
    Refuse an empty sequence, unknown types, and targets that do not suit their type.

    The controller rejects these, too.

    :raises InvalidGoal: the text names the primitive and its field.
    """
    if not motions:
        raise InvalidGoal('trajectory.motions', 'is empty', 'give at least one primitive')
    for i, motion in enumerate(motions):
        _check_targets(i, motion)


@dataclass(frozen=True, slots=True, kw_only=True)
class _Primitive:
    """A primitive whose own fields have been checked, but not yet against other primitives."""

    index: int
    message: Message
    #: Time of the motion [s]; 0 = velocity and acceleration apply.
    time: float
    velocity: float
    acceleration: float

    @classmethod
    def of(cls, index: int, message: Message) -> _Primitive:
        """
        Read a primitive.

        :raises InvalidGoal: a field is wrong.
        """
        arguments = _arguments(index, message)
        has_speed = arguments[VELOCITY] > 0.0 and arguments[ACCELERATION] > 0.0
        is_arc = message.type == CIRCULAR_CARTESIAN
        time = arguments[MOVE_TIME]
        if time > 0.0 and not (is_arc and has_speed):
            return cls(index=index, message=message, time=time, velocity=0.0, acceleration=0.0)
        if not has_speed:
            raise InvalidGoal(
                _field(index, 'additional_arguments'),
                'gives neither a velocity and an acceleration nor a move_time',
                'add one or the other, greater than 0',
            )
        return cls(
            index=index,
            message=message,
            time=0.0,
            velocity=arguments[VELOCITY],
            acceleration=arguments[ACCELERATION],
        )

    def waypoint(self, time: float, tf_prefix: str) -> Waypoint:
        """Return the point to which the primitive leads."""
        if self.message.poses:
            return Waypoint(pose=pose_from_message(self.message.poses[0].pose), time=time)
        names = tuple(tf_prefix + name for name in JOINT_NAMES)
        posture = Posture(names=names, values=tuple(self.message.joint_positions))
        return Waypoint(pose=_NO_POSE, time=time, posture=posture)

    def segment(self) -> Segment:
        """Return the motion of the primitive."""
        is_arc = self.message.type == CIRCULAR_CARTESIAN
        kind = SegmentType.JOINT if self.message.type == LINEAR_JOINT else SegmentType.LINEAR
        return Segment(
            type=SegmentType.CIRCULAR if is_arc else kind,
            velocity=self.velocity,
            acceleration=self.acceleration,
            blend_radius=self.message.blend_radius,
            via=pose_from_message(self.message.poses[1].pose) if is_arc else None,
        )


def _field(index: int, name: str) -> str:
    return f'trajectory.motions[{index}].{name}'


def _check_targets(index: int, message: Message) -> None:
    """Refuse an unknown type, and targets that do not suit the type."""
    name = _TYPES.get(message.type)
    if name is None:
        known = ', '.join(f'{text} ({number})' for number, text in _TYPES.items())
        raise InvalidGoal(_field(index, 'type'), f'is {message.type}', f'use one of {known}')
    joints, poses = len(message.joint_positions), len(message.poses)
    is_arc = message.type == CIRCULAR_CARTESIAN
    if joints and poses:
        raise InvalidGoal(
            _field(index, 'joint_positions'),
            'is given, and poses as well: the target is ambiguous',
            'leave one of them empty',
        )
    if joints and not is_arc:
        if joints != len(JOINT_NAMES):
            raise InvalidGoal(
                _field(index, 'joint_positions'),
                f'has {joints} values, but the arm has {len(JOINT_NAMES)} joints',
                f'give them in the order {", ".join(JOINT_NAMES)}',
            )
    elif poses != 1 + is_arc:
        wanted = 'two, the goal and then the via' if is_arc else 'one'
        raise InvalidGoal(
            _field(index, 'poses'),
            f'has {poses} entries, but a {name} primitive takes {wanted}',
            'give just these' if is_arc else 'give just one, or joint_positions',
        )


def _arguments(index: int, message: Message) -> Mapping[str, float]:
    """Return the additional arguments by name; 0 = not given."""
    found, given = dict.fromkeys(_ARGUMENTS, 0.0), set[str]()
    for argument in message.additional_arguments:
        field = f"{_field(index, 'additional_arguments')} '{argument.name}'"
        if argument.name not in found:
            raise InvalidGoal(field, 'is unknown', f'use {", ".join(_ARGUMENTS)}')
        if not 0.0 <= argument.value <= _MAX_ARGUMENT:  # NaN fails, too
            raise InvalidGoal(
                field,
                f'is {argument.value:g}, but must be from 0 to {_MAX_ARGUMENT:g}',
                'correct it',
            )
        if argument.name in given:
            raise InvalidGoal(field, 'is given twice', 'give it once')
        given.add(argument.name)
        found[argument.name] = argument.value
    return found


def _check_times(primitives: Iterable[_Primitive]) -> None:
    """Refuse a sequence in which only some primitives have times."""
    first, *others = primitives
    for other in others:
        if bool(other.time) != bool(first.time):
            with_time, without = (other, first) if other.time else (first, other)
            raise InvalidGoal(
                _field(other.index, 'additional_arguments'),
                f'cannot be combined: primitive {with_time.index} has a move_time and primitive '
                f'{without.index} a speed, but a goal has times at all its points or at none',
                'give each primitive a move_time, or none; an arc that has a velocity and an '
                'acceleration as well is executed at those',
            )


def _frame(primitives: Iterable[_Primitive], base: str) -> str:
    """Return the frame of all poses; '' = the controller's base, whether named or not."""
    first: str | None = None
    for primitive in primitives:
        for k, pose in enumerate(primitive.message.poses):
            frame = '' if pose.header.frame_id == base else pose.header.frame_id
            if first not in (None, frame):
                raise InvalidGoal(
                    _field(primitive.index, f'poses[{k}].header.frame_id'),
                    f"is '{frame or base}', but the poses before are in '{first or base}'",
                    'give all poses in one frame',
                )
            first = frame
    return first or ''
