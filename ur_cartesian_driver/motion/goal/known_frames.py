# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The frames that a goal may name: the frame of its poses, and the frame that follows these poses.

The second is called the controlled frame.

The robot receives poses in ``base``, the frame of its own controller. ``base_link`` of the robot
description has the same origin, rotated by pi about z.

``tool0`` is the controller's flange. ``flange`` of the robot description has the same origin and
the axes of REP-103 (x forward): it is tool0 rotated by the inverse of rpy (pi/2, 0, pi/2).
``tool0_controller`` is the robot's active TCP. A goal in one of these three frames is relative to
the pose of the arm at the time of planning.

If the frame of the poses moves with the arm, and the controlled frame is fixed in the cell, the
arm holds a part and leads it along a fixed tool (:mod:`~.moving_frame`).

The parameter ``static_frames`` adds frames fixed to any of these. All other frames are looked up
in tf2, if it is installed.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
import copy
from dataclasses import dataclass, replace
from math import isfinite, sqrt
from typing import Protocol, TypeVar

from ur_cartesian_driver.motion.errors import InvalidGoal, RobotNotReady, shortened
from ur_cartesian_driver.motion.geometry.pose import IDENTITY, normalize, Pose
from ur_cartesian_driver.motion.goal.goal import Goal
from ur_cartesian_driver.motion.goal.moving_frame import MovingFrame
from ur_cartesian_driver.motion.state.rtde_state import RobotState

G = TypeVar('G', bound=Goal)

#: The pose of ``base_link`` in ``base``.
T_BASE_BASE_LINK = Pose((0.0, 0.0, 0.0), (0.0, 0.0, 1.0, 0.0))
#: The pose of ``flange`` in ``tool0``: the inverse of rpy (pi/2, 0, pi/2), which is the quaternion
#: (1, 1, 1, 1)/2.
T_TOOL0_FLANGE = Pose((0.0, 0.0, 0.0), (-0.5, -0.5, -0.5, 0.5))

BASE, BASE_LINK = 'base', 'base_link'
TOOL0, FLANGE, TCP = FRAMES_OF_TOOL = 'tool0', 'flange', 'tool0_controller'

_UNIT_TOLERANCE = 1e-3
_FRAME_ID, _CONTROLLED = 'trajectory.header.frame_id', 'trajectory.controlled_frame'


@dataclass(frozen=True, slots=True)
class StaticFrame:
    """A frame that is fixed to its parent."""

    name: str
    parent: str
    T_parent_frame: Pose

    @classmethod
    def parse(cls, text: str) -> StaticFrame:
        """
        Read ``name parent x y z qx qy qz qw`` [m, unit quaternion].

        :raises ValueError: the text does not have this form, or a number in it is not allowed.
        """
        words = text.split()
        if len(words) != 9:
            raise ValueError(
                f'static_frames: "{text}" has {len(words)} words instead of 9; write '
                '"name parent x y z qx qy qz qw" [m, unit quaternion].'
            )
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
                f'"{name}" has length {length:.4g} instead of 1; the order is x y z w.'
            )
        return cls(name, parent, Pose((x, y, z), normalize((qx, qy, qz, qw))))


@dataclass(frozen=True, slots=True)
class ArmSnapshot:
    """Flange pose and active TCP at one moment."""

    T_base_flange: Pose
    T_flange_tcp: Pose

    @classmethod
    def of(cls, state: RobotState) -> ArmSnapshot:
        """Return the snapshot of a robot's reported poses, which include its calibration."""
        return cls(state.actual_tcp_pose @ state.T_flange_tcp.inverse(), state.T_flange_tcp)

    def tool(self, goal: Goal) -> Pose:
        """Return the pose of a goal's controlled frame in the frame of the goal's poses."""
        if goal.moving_frame is not None:
            return goal.moving_frame.tool(self.T_base_flange)
        T_flange_tool = goal.T_flange_controlled or self.T_flange_tcp
        return goal.T_base_frame.inverse() @ self.T_base_flange @ T_flange_tool


class FrameLookup(Protocol):
    """
    Looks up the frames of other nodes; ``ros.tf.tf_lookup`` does so in tf2.

    ``field`` is the field of the goal that names the source frame, for error messages.
    """

    def T_target_source(self, field: str, target: str, source: str, at: int = 0) -> Pose:
        """Return the pose of the source frame in the target frame at a time [ns]; 0 = newest."""

    def T_static(self, field: str, target: str, source: str) -> Pose:
        """Return the pose in the target frame of a source frame that is fixed to it."""


class Frames:
    """The frames that this driver knows; the robot's own frames have names with ``tf_prefix``."""

    def __init__(self, tf_prefix: str = '', static_frames: Iterable[StaticFrame] = ()) -> None:
        """
        Resolve each static frame to a pose in the base, the flange or the TCP.

        :raises ValueError: a static frame has an unknown parent, a name that is taken, or is its
            own ancestor.
        """
        self.base = tf_prefix + BASE
        self.tcp = tf_prefix + TCP
        self.tool0 = tf_prefix + TOOL0
        self._transforms: FrameLookup | None = None
        own = {
            self.base: (self.base, IDENTITY),
            tf_prefix + BASE_LINK: (self.base, T_BASE_BASE_LINK),
            self.tool0: (self.tool0, IDENTITY),
            tf_prefix + FLANGE: (self.tool0, T_TOOL0_FLANGE),
            self.tcp: (self.tcp, IDENTITY),
        }
        resolved = _resolve_static_frames(own, static_frames)
        #: The names of the robot's own frames, which exist without ``static_frames``.
        self._own_names = frozenset(own)
        self._T_base, self._T_flange, self._T_tcp = (
            {name: T for name, (root, T) in resolved.items() if root == of}
            for of in (self.base, self.tool0, self.tcp)
        )

    def with_transforms(self, transforms: FrameLookup | None) -> Frames:
        """Return a copy that looks up unknown frames in ``transforms``."""
        frames = copy.copy(self)
        frames._transforms = transforms
        return frames

    def resolve(
        self,
        goal: G,
        frame_id: str,
        controlled_frame: str,
        snapshot: ArmSnapshot | None = None,
        at: int = 0,
    ) -> G:
        """
        Return a goal with the present poses of its frame and of its controlled frame.

        :param snapshot: the arm, for frames that move with it; None if its pose is not known.
        :param at: time of tf2 transforms [ns]; 0 = the newest.
        :raises InvalidGoal: a frame is unknown.
        :raises RobotNotReady: a frame moves with the arm, whose pose is not known.
        """
        if (moving := self.moving_frame(frame_id, controlled_frame, snapshot)) is not None:
            return replace(
                goal,
                moving_frame=moving,
                T_base_frame=IDENTITY,
                T_flange_controlled=None,
                controlled_frame=controlled_frame,
            )
        T_flange_controlled = self.T_flange_frame(controlled_frame, snapshot)
        return replace(
            goal,
            moving_frame=None,
            T_base_frame=self.T_base_frame(frame_id, snapshot, at=at),
            T_flange_controlled=T_flange_controlled,
            # Empty for the active TCP, even if the client named it.
            controlled_frame='' if T_flange_controlled is None else controlled_frame,
        )

    def moving_frame(
        self, frame_id: str, controlled_frame: str, snapshot: ArmSnapshot | None = None
    ) -> MovingFrame | None:
        """
        Return the goal's moving frame if the arm holds the part at a fixed tool, else None.

        The tool is fixed if the controlled frame is known to be fixed in the base and is none of
        the robot's own frames (``base`` or ``base_link``), where no tool can be.

        :raises InvalidGoal: the controlled frame is fixed in the base, but the frame of the goal
            is fixed there too, or is unknown.
        :raises RobotNotReady: the frame of the goal is fixed to the TCP, which is not known.
        """
        if controlled_frame not in self._T_base or controlled_frame in self._own_names:
            return None
        if frame_id in self._T_flange:
            T_flange_frame = self._T_flange[frame_id]
        elif frame_id in self._T_tcp:
            known = _require_snapshot(snapshot, _FRAME_ID, frame_id)
            T_flange_frame = known.T_flange_tcp @ self._T_tcp[frame_id]
        elif self._transforms is not None and frame_id not in ('', *self._T_base):
            T_flange_frame = self._transforms.T_static(_FRAME_ID, self.tool0, frame_id)
        else:
            held = [name for name in self._T_flange if name not in self._own_names]
            raise InvalidGoal(
                _CONTROLLED,
                f'is "{shortened(controlled_frame)}", which does not move with the arm, and '
                f'neither does {_FRAME_ID} "{shortened(frame_id or self.base)}"',
                f'for a part in the hand, name its frame in {_FRAME_ID} '
                f'({", ".join(held) or "static_frames adds one, with tool0 as its parent"}); '
                'for a tool in the hand, leave controlled_frame empty for the active TCP of the '
                f'robot, or name one of {", ".join(self._T_flange)}',
            )
        return MovingFrame(
            T_flange_frame=T_flange_frame, T_base_tool=self._T_base[controlled_frame]
        )

    def T_base_frame(self, name: str, snapshot: ArmSnapshot | None = None, at: int = 0) -> Pose:
        """
        Return the pose of a frame in the robot's base; the empty name is the base itself.

        :param snapshot: the arm, for frames that move with it; None if its pose is not known.
        :param at: time of a tf2 transform [ns]; 0 = the newest.
        :raises InvalidGoal: the frame is unknown, or tf2 has no transform, or only an old one.
        :raises RobotNotReady: the frame moves with the arm, whose pose is not known.
        """
        name = name or self.base
        if name in self._T_base:
            return self._T_base[name]
        if name in self._T_flange:
            return (
                _require_snapshot(snapshot, _FRAME_ID, name).T_base_flange @ self._T_flange[name]
            )
        if name in self._T_tcp:
            known = _require_snapshot(snapshot, _FRAME_ID, name)
            return known.T_base_flange @ known.T_flange_tcp @ self._T_tcp[name]
        if self._transforms is not None:
            return self._transforms.T_target_source(_FRAME_ID, self.base, name, at)
        raise InvalidGoal(
            _FRAME_ID,
            f'is "{shortened(name)}", which is not a known frame',
            f'name one of {", ".join([*self._T_base, *self._T_flange, *self._T_tcp])}; others '
            'can be added to static_frames',
        )

    def T_flange_frame(self, name: str, snapshot: ArmSnapshot | None = None) -> Pose | None:
        """
        Return the pose of a controlled frame in the flange; None if it is the robot's active TCP.

        :param snapshot: the arm, for frames fixed to its active TCP; None if the TCP is not known.
        :raises InvalidGoal: the frame is unknown, or not fixed to the flange.
        :raises RobotNotReady: the frame is fixed to the TCP, which is not known.
        """
        if name in ('', self.tcp):
            return None
        if name in self._T_flange:
            return self._T_flange[name]
        if name in self._T_tcp:
            return _require_snapshot(snapshot, _CONTROLLED, name).T_flange_tcp @ self._T_tcp[name]
        known = ', '.join([self.tcp, *self._T_flange, *list(self._T_tcp)[1:]])
        if name in self._T_base:
            raise InvalidGoal(
                _CONTROLLED,
                f'is "{shortened(name)}", which does not move with the arm',
                f'leave it empty for the active TCP of the robot, or name one of {known}',
            )
        if self._transforms is not None:
            return self._transforms.T_static(_CONTROLLED, self.tool0, name)
        raise InvalidGoal(
            _CONTROLLED,
            f'is "{shortened(name)}", which is not a known frame',
            f'leave it empty for the active TCP of the robot, or name one of {known}; others can '
            f'be added to static_frames, with {self.tool0} as their parent',
        )


def _require_snapshot(snapshot: ArmSnapshot | None, field: str, name: str) -> ArmSnapshot:
    if snapshot is None:
        raise RobotNotReady(
            f'{field} is "{name}", which moves with the arm, and the robot has not reported its '
            'pose yet; wait for the connection to the robot.'
        )
    return snapshot


def _resolve_static_frames(
    known: Mapping[str, tuple[str, Pose]], static_frames: Iterable[StaticFrame]
) -> dict[str, tuple[str, Pose]]:
    """
    Return, by name, the root of each frame (base, flange or TCP) and its pose in the root.

    Static frames can have any order.
    """
    frames = dict(known)
    waiting: dict[str, StaticFrame] = {}
    for frame in static_frames:
        if frame.name in frames or frame.name in waiting:
            raise ValueError(f'static_frames: the name "{frame.name}" is taken.')
        waiting[frame.name] = frame
    while waiting:
        ready = [frame for frame in waiting.values() if frame.parent in frames]
        if not ready:
            frame = next(iter(waiting.values()))
            raise ValueError(
                f'static_frames: the parent "{frame.parent}" of "{frame.name}" does not lead '
                f'to {", ".join(dict.fromkeys(root for root, _ in known.values()))}.'
            )
        for frame in ready:
            root, T_root_parent = frames[frame.parent]
            frames[frame.name] = root, T_root_parent @ frame.T_parent_frame
            del waiting[frame.name]
    return frames
