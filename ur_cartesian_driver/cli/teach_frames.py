# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""``ur-cartesian teach --fixed-tool`` and ``--held-part``: frames from touches, with residuals."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import ClassVar

import numpy as np

from ur_cartesian_driver.motion.errors import InvalidGoal
from ur_cartesian_driver.motion.geometry.arrays import Floats
from ur_cartesian_driver.motion.geometry.frame_fit import fit_frame
from ur_cartesian_driver.motion.geometry.pose import Pose
from ur_cartesian_driver.motion.geometry.vectors import Vector3, vector3
from ur_cartesian_driver.motion.goal.known_frames import BASE, TOOL0
from ur_cartesian_driver.motion.state.rtde_state import RobotState

#: Smallest number of touches of a fixed tool's tip, and of points of a held part. Each is one more
#: than the frame needs, so that residuals show errors.
MIN_TIPS, MIN_POINTS = 2, 4
#: Points nearer than this give no direction [m].
_MIN_DISTANCE = 0.005


class _FrameLesson(ABC):
    """A lesson whose touches determine a frame."""

    @abstractmethod
    def report(self) -> list[str]:
        """
        Return the frame as a row of ``static_frames``, and the residuals.

        :raises InvalidGoal: there are too few touches, or they determine no frame.
        """

    def missing(self) -> str:
        """Return why the touches determine no frame yet, as a sentence; '' = they do."""
        try:
            self.report()
        except InvalidGoal as error:
            return str(error)
        return ''


class FixedToolLesson(_FrameLesson):
    """
    The lesson on a tool that stands in the cell, and is touched with the TCP.

    Its tip is touched in several postures, so that a wrong TCP shows; its axis z leads from a
    point of the tool behind the tip to the tip, and its axis x towards a third point.
    """

    HELP: ClassVar[str] = (
        'Enter: the TCP touches the tip, at least twice, turned differently; z: it touches the '
        'tool behind its tip; x: it touches a place in the direction of the x axis; u: undo, '
        'q: print, end'
    )

    def __init__(self, name: str) -> None:
        """Begin without touches."""
        self._name = name
        self._touches: list[tuple[str, Vector3]] = []

    def press(self, key: str, state: RobotState) -> str:
        """Carry out a key, which can note the TCP's position as a touch; return a message."""
        if key == 'u':
            return _undone(self._touches)
        if key not in ('', 'z', 'x'):
            return f'{key!r} means nothing. {self.HELP}'
        self._touches.append((key, state.actual_tcp_pose.position))
        what = {'': 'tip', 'z': 'behind the tip', 'x': 'towards x'}[key]
        return f'touch {len(self._touches)}: {what}'

    def report(self) -> list[str]:
        """Return the row and the residuals of the tip."""
        tips, behind, beside = (
            np.array([place for kind, place in self._touches if kind == wanted]).reshape(-1, 3)
            for wanted in ('', 'z', 'x')
        )
        if len(tips) < MIN_TIPS or not len(behind) or not len(beside):
            raise InvalidGoal(
                f'--fixed-tool {self._name}',
                f'has {len(tips)} touches of the tip, {len(behind)} behind it and {len(beside)} '
                'towards x',
                f'touch the tip at least {MIN_TIPS} times, and each of the others once',
            )
        tip = tips.mean(axis=0)
        z, towards = tip - behind.mean(axis=0), beside.mean(axis=0) - tip
        size = float(np.linalg.norm(z))
        across = towards - (towards @ z) / max(size * size, 1e-12) * z
        if min(size, float(np.linalg.norm(across))) < _MIN_DISTANCE:
            raise InvalidGoal(
                f'--fixed-tool {self._name}',
                f'has points within {1e3 * _MIN_DISTANCE:g} mm of each other, or all on a line',
                'touch places farther apart',
            )
        z, x = z / size, across / np.linalg.norm(across)
        axes = np.stack([np.zeros(3), x, np.cross(z, x), z])
        pose, _ = fit_frame(np.concatenate([np.zeros((1, 3)), np.eye(3)]), axes)
        off = np.linalg.norm(tips - tip, axis=1)
        return [
            _row(self._name, BASE, Pose(vector3(tip.tolist()), pose.quaternion)),
            _residuals('touches of the tip', off),
        ]


class HeldPartLesson(_FrameLesson):
    """
    The lesson on a held part, whose known points touch a fixed tool's tip one after the other.

    :param points: points on the part, in its frame [m].
    :param tip: the position of the fixed tool's tip, in base [m].
    """

    HELP: ClassVar[str] = (
        'Enter: the next point of the part touches the tip of the fixed tool; u: undo, '
        'q: print, end'
    )

    def __init__(self, name: str, points: Sequence[Vector3], tip: Vector3) -> None:
        """
        Begin without touches.

        :raises InvalidGoal: there are too few points to see an error.
        """
        if len(points) < MIN_POINTS:
            raise InvalidGoal(
                '--point',
                f'is given {len(points)} times, but three points make a frame, and one more '
                'shows how good it is',
                f'give at least {MIN_POINTS}',
            )
        self._name, self._points, self._tip = name, points, tip
        self._touches: list[Vector3] = []

    def press(self, key: str, state: RobotState) -> str:
        """Carry out a key, which can note a touch at the flange's pose; return a message."""
        if key == 'u':
            return _undone(self._touches)
        if key:
            return f'{key!r} means nothing. {self.HELP}'
        k, count = len(self._touches), len(self._points)
        if k == count:
            return f'all {count} points have touched; q prints the frame'
        T_base_flange = state.actual_tcp_pose @ state.T_flange_tcp.inverse()
        self._touches.append(T_base_flange.inverse().apply(self._tip))
        place = ' '.join(f'{1e3 * value:g}' for value in self._points[k])
        return f'point {k + 1} of {count}, at {place} mm on the part'

    def report(self) -> list[str]:
        """Return the row and the residuals of the points."""
        count = len(self._touches)
        if count < MIN_POINTS:
            raise InvalidGoal(
                f'--held-part {self._name}',
                f'has {count} touches, of {len(self._points)} points',
                f'touch with at least {MIN_POINTS}',
            )
        try:
            pose, off = fit_frame(np.array(self._points[:count]), np.array(self._touches))
        except ValueError as error:
            raise InvalidGoal('--point', f'{error}', 'give a point beside it') from None
        return [_row(self._name, TOOL0, pose), _residuals('points', off)]


def _undone(touches: list[Vector3] | list[tuple[str, Vector3]]) -> str:
    if not touches:
        return 'there is no touch to undo'
    touches.pop()
    return f'undone; {len(touches)} left'


def _row(name: str, parent: str, pose: Pose) -> str:
    numbers = ' '.join(f'{round(value, 7) + 0.0:.7g}' for value in pose.row())
    return f"static_frames: ['{name} {parent} {numbers}']"


def _residuals(what: str, off: Floats) -> str:
    each = ', '.join(f'{1e3 * value:.2f}' for value in off.tolist())
    return (
        f'residuals of the {len(off)} {what}: {each} mm; the largest is {1e3 * off.max():.2f} mm'
    )
