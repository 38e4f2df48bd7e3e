# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""``ur-cartesian teach``: guide the arm by hand, take points, and write them as a path."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path as FilePath
import sys
import threading
from typing import ClassVar, Protocol

from ur_cartesian_driver.cli.argument_types import check_writable
from ur_cartesian_driver.cli.own_driver import ready_driver
from ur_cartesian_driver.cli.teach_frames import FixedToolLesson, HeldPartLesson
from ur_cartesian_driver.driver import Driver
from ur_cartesian_driver.kinematics.robot_models import JOINT_NAMES
from ur_cartesian_driver.motion.errors import InvalidGoal, RobotNotReady
from ur_cartesian_driver.motion.geometry.pose import Pose
from ur_cartesian_driver.motion.state.rtde_state import RobotState
from ur_cartesian_driver.path import Path

HELP = (
    'Enter takes a point like the one before; l: a line to it, j: a joint motion, p: a line of a '
    'process, a: here is the middle of an arc, and the next Enter its end; u: undo, q: write, end'
)
#: The file of a lesson if none is named; an existing file is not replaced.
DEFAULT_OUTPUT = 'path.yaml'
#: Longest time until the arm can be guided, and until the robot holds it again [s].
FREEDRIVE_TIME = 10.0
_KINDS = {'l': 'line', 'j': 'joint', 'p': 'process'}


def teach_path(arguments: argparse.Namespace) -> int:
    """
    Connect, let a person guide the arm, and write the taken points, even after Ctrl-C.

    :raises OSError: the file cannot be written any more; the goal is printed instead.
    """
    _check_options(arguments)
    if arguments.fixed_tool or arguments.held_part:
        return teach_frame(arguments)
    lesson = Lesson(Path().at(speed=arguments.speed, blend=arguments.blend))
    output = arguments.output or DEFAULT_OUTPUT
    if not arguments.output:
        if FilePath(output).exists():
            raise OSError(f'{output} exists already; name the file by -o')
        check_writable(output)
    try:
        with ready_driver(arguments, allow_freedrive=True) as driver:
            guide(driver, lesson, _keys(), _say)
    finally:
        if lesson.path.poses:
            save(lesson.path, output)
            _say(f'{_points(len(lesson.path))} in {output}')
        else:
            _say('no point was taken, so nothing is written')
    return 0


def teach_frame(arguments: argparse.Namespace) -> int:
    """
    Connect, let a person touch with the arm, and print the frame of a fixed tool or held part.

    :raises InvalidGoal: options are missing or contradict each other, or the touches determine no
        frame.
    """
    lesson: FixedToolLesson | HeldPartLesson
    if arguments.fixed_tool:
        lesson = FixedToolLesson(arguments.fixed_tool)
    elif arguments.tip is None:
        raise InvalidGoal(
            '--tip', 'is missing: where the points touch', 'teach --fixed-tool first'
        )
    else:
        lesson = HeldPartLesson(arguments.held_part, arguments.point, arguments.tip)
    with ready_driver(arguments, allow_freedrive=True) as driver:
        guide(driver, lesson, _keys(), _say)
    for line in lesson.report():
        _say(line)
    return 0


def _check_options(arguments: argparse.Namespace) -> None:
    """
    Refuse options that do not belong to the lesson.

    :raises InvalidGoal: such an option is given.
    """
    others: tuple[str, ...] = ()
    if arguments.fixed_tool or arguments.held_part:
        others = 'output', 'speed', 'blend'
    if not arguments.held_part:
        others = *others, 'point', 'tip'
    for name in others:
        if getattr(arguments, name) not in (None, []):
            raise InvalidGoal(
                f'--{name}',
                'is given, but is for a held part'
                if name in ('point', 'tip')
                else 'is given, but is for a path, and what is taught is a frame',
                'leave it out',
            )


def save(path: Path, file: str) -> None:
    """
    Write a path to a file, or print it if that fails, since nobody can take its points again.

    :raises OSError: the file cannot be written.
    """
    try:
        path.save(file)
    except OSError as error:
        _say(path.to_yaml())
        raise OSError(
            f'{file} cannot be written: {error.strerror}; the goal is printed above'
        ) from None


def guide(
    driver: Driver, lesson: Taught, keys: Iterable[str], say: Callable[[str], object]
) -> None:
    """
    Keep freedrive on while keys are read, and end it afterwards, even after an error.

    The key q ends an incomplete lesson only if it comes twice.

    :raises RobotNotReady: freedrive does not begin, or ends by itself.
    """
    active = threading.Event()
    freedrive = driver.start_freedrive(active.set)
    freedrive.add_done_callback(lambda _: active.set())
    try:
        if not active.wait(FREEDRIVE_TIME):
            raise RobotNotReady('The robot has not begun freedrive.')
        say(lesson.HELP)
        missing = ''
        for key in keys:
            if freedrive.done():
                raise RobotNotReady(f'Freedrive has ended: {freedrive.result().text}')
            if key == 'q':
                if missing or not (missing := lesson.missing()):
                    return
                say(f'{missing} Go on, or end without a frame by another q.')
                continue
            missing = ''
            state = driver.state
            try:
                say('no state of the robot' if state is None else lesson.press(key, state))
            except InvalidGoal as mistake:
                say(f'not taken: {mistake}')
    finally:
        freedrive.cancel()
        freedrive.result(FREEDRIVE_TIME)


class Taught(Protocol):
    """A lesson that keys build up while the arm is guided."""

    #: The meanings of the keys.
    HELP: ClassVar[str]

    def press(self, key: str, state: RobotState) -> str:
        """
        Carry out a key, and return a message.

        :raises InvalidGoal: the key's point cannot be taken.
        """

    def missing(self) -> str:
        """Return a sentence on the parts that the lesson lacks; '' = it may end."""


class Lesson:
    """The lesson of a path: the points taken so far."""

    HELP: ClassVar[str] = HELP

    def __init__(self, beginning: Path) -> None:
        """Begin with a path that has no points, but may set speeds."""
        self._paths = [beginning]
        self._kind, self._via = 'l', None  # type: str, Pose | None

    @property
    def path(self) -> Path:
        """The path so far."""
        return self._paths[-1]

    def press(self, key: str, state: RobotState) -> str:
        """
        Carry out a key, which can take a point at the TCP's present pose; return a message.

        :raises InvalidGoal: the point cannot be added to the path.
        """
        pose = state.actual_tcp_pose
        if key == 'u':
            return self._undo()
        if key == 'a' and not self.path.poses:
            return 'an arc needs a point before it; press Enter first'
        if key == 'a':
            self._via = pose
            return f'middle of an arc at {_place(pose)}; Enter takes its end'
        if key not in ('', *_KINDS):
            return f'{key!r} means nothing. {HELP}'
        self._kind = key or self._kind
        posture = dict(zip(JOINT_NAMES, state.actual_q, strict=True))
        if not self.path.poses:  # a joint motion, from wherever the arm will start
            name, path = 'joint', self.path.joint(pose, posture=posture)
        elif self._via is not None:
            name, path = 'arc', self.path.arc(pose, via=self._via.position)
        else:
            name = _KINDS[self._kind]
            named = {'posture': posture} if name == 'joint' else {}
            path = getattr(self.path, name)(pose, **named)
        self._paths.append(path)
        self._via = None
        return f'point {len(path) - 1}: {name} to {_place(pose)}'

    def missing(self) -> str:
        """Return '': a path may have any number of points."""
        return ''

    def _undo(self) -> str:
        if self._via is not None:
            self._via = None
            return 'the middle of the arc is forgotten'
        if len(self._paths) == 1:
            return 'there is no point to undo'
        self._paths.pop()
        return f'undone; {_points(len(self.path))} left'


def _keys() -> Iterator[str]:
    """Yield the typed lines until the end of the input, which means the same as q."""
    for line in sys.stdin:
        yield line.strip().lower()


def _say(text: str) -> None:
    print(text, flush=True)


def _place(pose: Pose) -> str:
    return ' '.join(f'{value:.4f}' for value in pose.position) + ' m'


def _points(count: int) -> str:
    return f'{count} point{"s" * (count != 1)}'
