# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The frames that a goal may name: in which it is given, and which one it moves.

Poses go to the robot in ``base``, the frame that its own controller counts in. ``base_link`` of
the robot description is the same point turned by pi about z. Other frames are the fixed ones of
the parameter ``static_frames``; a frame that moves cannot be had without tf2.

``tool0`` is the controller's flange. ``flange`` of the robot description has the same origin and
the axes of REP-103 (x forward), that is tool0 turned back by rpy (pi/2, 0, pi/2).
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from math import isfinite, sqrt

from ur_cartesian_driver.motion.errors import InvalidGoal, NotAvailable
from ur_cartesian_driver.motion.pose import IDENTITY, normalize, Pose

#: ``base_link`` in ``base``.
T_BASE_BASE_LINK = Pose((0.0, 0.0, 0.0), (0.0, 0.0, 1.0, 0.0))
#: ``flange`` in ``tool0``: the inverse of rpy (pi/2, 0, pi/2), whose quaternion is (1, 1, 1, 1)/2.
T_TOOL0_FLANGE = Pose((0.0, 0.0, 0.0), (-0.5, -0.5, -0.5, 0.5))

BASE, BASE_LINK = 'base', 'base_link'
TOOL0, FLANGE, TCP = 'tool0', 'flange', 'tool0_controller'

_UNIT_TOLERANCE = 1e-3
#: How near the active TCP has to be to a frame to be the same one [m], [rad].
_SAME_POSITION, _SAME_ANGLE = 1e-6, 1e-5


@dataclass(frozen=True, slots=True)
class StaticFrame:
    """A frame that does not move with respect to its parent."""

    name: str
    parent: str
    T_parent_frame: Pose

    @classmethod
    def parse(cls, text: str) -> StaticFrame:
        """
        Read ``name parent x y z qx qy qz qw`` [m, unit quaternion].

        :raises ValueError: the text has another form; the sentence says what is wrong.
        """
        words = text.split()
        if len(words) != 9:
            raise ValueError(
                f'static_frames: "{text}" has {len(words)} words instead of 9; write '
                '"name parent x y z qx qy qz qw" [m, unit quaternion].')
        name, parent, *numbers = words
        try:
            x, y, z, qx, qy, qz, qw = (float(number) for number in numbers)
        except ValueError as error:
            raise ValueError(f'static_frames: "{name}": {error}.') from None
        if not all(isfinite(v) for v in (x, y, z, qx, qy, qz, qw)):
            raise ValueError(f'static_frames: "{name}" has a number that is not finite.')
        length = sqrt(qx * qx + qy * qy + qz * qz + qw * qw)
        if abs(length - 1.0) > _UNIT_TOLERANCE:
            raise ValueError(
                f'static_frames: the quaternion {qx:g} {qy:g} {qz:g} {qw:g} of '
                f'"{name}" has length {length:.4g} instead of 1; the order is x y z w.')
        return cls(name, parent, Pose((x, y, z), normalize((qx, qy, qz, qw))))


class Frames:
    """The frames that are known to this driver, with the robot's ``tf_prefix`` in their names."""

    def __init__(self, tf_prefix: str = '', static_frames: Iterable[StaticFrame] = ()) -> None:
        """
        Resolve all static frames down to the base.

        :raises ValueError: a static frame has an unknown parent, a name that is taken, or is its
            own ancestor.
        """
        self.base = tf_prefix + BASE
        self.tcp = tf_prefix + TCP
        self._behind_flange = {
            tf_prefix + TOOL0: IDENTITY,
            tf_prefix + FLANGE: T_TOOL0_FLANGE,
        }
        self._T_base = _resolved(
            {self.base: IDENTITY, tf_prefix + BASE_LINK: T_BASE_BASE_LINK}, static_frames)

    def T_base_frame(self, name: str) -> Pose:
        """
        Return where a frame is in the robot's base; the empty name is the base itself.

        :raises InvalidGoal: the frame is unknown.
        """
        pose = self._T_base.get(name or self.base)
        if pose is None:
            raise InvalidGoal(
                'trajectory.header.frame_id', f'is "{name}", which is not a known frame',
                f'known are {", ".join(self._T_base)}; others can be named in the parameter '
                'static_frames')
        return pose

    def check_controlled(self, name: str, T_flange_tcp: Pose | None) -> None:
        """
        Let a controlled frame pass if it is the robot's active TCP.

        :param T_flange_tcp: the active TCP, None while the robot has not reported it.
        :raises NotAvailable: it is another frame behind the flange.
        :raises InvalidGoal: there is no such frame.
        """
        if name in ('', self.tcp):
            return
        T_flange_frame = self._behind_flange.get(name)
        if T_flange_frame is None:
            raise InvalidGoal(
                'trajectory.controlled_frame', f'is "{name}", which is not a known frame',
                f'leave it empty or name {self.tcp} for the active TCP of the robot; also known '
                f'are {", ".join(self._behind_flange)}')
        if T_flange_tcp is None:
            raise NotAvailable(
                'trajectory.controlled_frame', f'is "{name}", and the robot has not said yet '
                'where its active TCP is', 'wait for the connection to the robot')
        distance = T_flange_tcp.distance_to(T_flange_frame)
        angle = T_flange_tcp.angle_to(T_flange_frame)
        if distance > _SAME_POSITION or angle > _SAME_ANGLE:
            raise NotAvailable(
                'trajectory.controlled_frame', f'is "{name}", but the active TCP of the robot is '
                f'{1000.0 * distance:.1f} mm and {angle:.3f} rad away from it, and this version '
                'moves the active TCP only',
                f'set the TCP on the robot, or give the poses of {self.tcp}')


def _resolved(known: Mapping[str, Pose], static_frames: Iterable[StaticFrame]) -> dict[str, Pose]:
    """Return the known frames and all static ones, each in the base, whatever their order."""
    T_base = dict(known)
    waiting: dict[str, StaticFrame] = {}
    for frame in static_frames:
        if frame.name in T_base or frame.name in waiting:
            raise ValueError(f'static_frames: "{frame.name}" is there twice.')
        waiting[frame.name] = frame
    while waiting:
        ready = [frame for frame in waiting.values() if frame.parent in T_base]
        if not ready:
            frame = next(iter(waiting.values()))
            raise ValueError(
                f'static_frames: the parent "{frame.parent}" of "{frame.name}" does not lead '
                f'to {next(iter(known))}.')
        for frame in ready:
            T_base[frame.name] = T_base[frame.parent] @ frame.T_parent_frame
            del waiting[frame.name]
    return T_base
