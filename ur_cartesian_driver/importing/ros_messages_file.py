# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
nav_msgs/Path, geometry_msgs/PoseArray and trajectory_msgs/JointTrajectory.

As YAML, as ``ros2 topic echo`` prints them, or as the messages themselves: what reads one reads
the other, because a part of the YAML has the fields of a message as attributes.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
import itertools
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from ur_cartesian_driver.importing.import_format import ImportFormat, term_table
from ur_cartesian_driver.importing.import_options import ImportOptions
from ur_cartesian_driver.importing.imported_path import BrokenFile, PathCollector
from ur_cartesian_driver.importing.text_file import file_text
from ur_cartesian_driver.kinematics.robot_models import JOINT_NAMES
from ur_cartesian_driver.motion.goal import Posture, SegmentType
from ur_cartesian_driver.motion.pose_rows import compose_rows

_Loader = getattr(yaml, 'CSafeLoader', yaml.SafeLoader)
#: A message nests five deep.
_MAX_DEPTH = 50
_WITHOUT_TURN = ((0.0, 0.0, 0.0, 1.0), (0.0, 0.0, 0.0, 0.0))


class _Part:
    """A mapping of YAML with its keys as attributes, and its line."""

    def __init__(self, node: Any) -> None:
        self.line = node.start_mark.line + 1
        self._values = {key.value: value for key, value in node.value}

    def __contains__(self, name: str) -> bool:
        return name in self._values

    def __getattr__(self, name: str) -> Any:
        if name.startswith('_'):
            raise AttributeError(name)
        try:
            return _value(self._values[name])
        except KeyError:
            raise BrokenFile(self.line, f'the field {name} is missing') from None


class _Parts(list[Any]):
    """A sequence of YAML, with its line."""

    line = 0


def _value(node: Any) -> Any:
    line = node.start_mark.line + 1
    if isinstance(node, yaml.MappingNode):
        return _Part(node)
    if isinstance(node, yaml.SequenceNode):
        parts = _Parts(_value(item) for item in node.value)
        parts.line = line
        return parts
    if node.tag == 'tag:yaml.org,2002:str':
        return _Text(node.value, line)
    try:
        return _Number(float(node.value), line)
    except ValueError:
        return _Text(node.value, line)


class _Number(float):
    """A number with its line."""

    line: int

    def __new__(cls, value: float, line: int) -> _Number:
        made = super().__new__(cls, value)
        made.line = line
        return made


class _Text(str):
    """A text with its line."""

    line: int

    def __new__(cls, value: str, line: int) -> _Text:
        made = super().__new__(cls, value)
        made.line = line
        return made


def collect_yaml(file: Path, options: ImportOptions, into: PathCollector) -> None:
    """
    Read the first message of what ``ros2 topic echo`` has printed.

    :raises BrokenFile: it is not YAML, or none of the messages.
    """
    text = file_text(file)
    try:
        # The composer of libyaml crashes where a text nests very deeply; its parser does not.
        depth = 0
        for event in yaml.parse(text, Loader=_Loader):
            depth += isinstance(event, yaml.CollectionStartEvent)
            depth -= isinstance(event, yaml.CollectionEndEvent)
            if depth > _MAX_DEPTH:
                raise BrokenFile(
                    mark.line + 1 if (mark := event.start_mark) else 0, 'it is nested too deeply'
                )
        documents = [node for node in yaml.compose_all(text, Loader=_Loader) if node is not None]
    except yaml.YAMLError as error:
        mark = getattr(error, 'problem_mark', None)
        problem = getattr(error, 'problem', None) or 'it cannot be read'
        raise BrokenFile(mark.line + 1 if mark else 0, f'this is not YAML: {problem}') from None
    except RecursionError:
        raise BrokenFile(0, 'it is nested too deeply') from None
    messages = [node for node in documents if isinstance(node, yaml.MappingNode)]
    if not messages:
        raise BrokenFile(1, 'this is no message: it has no fields')
    for node in documents[1:]:
        into.remarks.add(
            node.start_mark.line + 1, 'another message', 'only the first one of a file is read'
        )
    collect_message(_Part(messages[0]), options, into)


def collect_message(message: Any, options: ImportOptions, into: PathCollector) -> None:
    """
    Read a message, or what has its fields.

    :raises BrokenFile: it is none of the three, or a value is none of its field.
    """
    if _has(message, 'points') and _has(message, 'joint_names'):
        _collect_joints(message, options, into)
    elif _has(message, 'poses'):
        _collect_poses(message, into)
    else:
        raise BrokenFile(
            getattr(message, 'line', 0),
            'this is neither a Path, a PoseArray nor a JointTrajectory: it has no poses, and no '
            'points with joint_names',
        )


def _has(message: Any, name: str) -> bool:
    return name in message if isinstance(message, _Part) else hasattr(message, name)


def _line(thing: Any, index: int) -> int:
    """Return the line of a part; of a message its number from 1."""
    return int(getattr(thing, 'line', index + 1))


def _number(value: Any, name: str, line: int) -> float:
    line = getattr(value, 'line', line)
    if isinstance(value, float | int) and not isinstance(value, bool) and np.isfinite(value):
        return float(value)
    text = str(value) if isinstance(value, str | float) else type(value).__name__
    raise BrokenFile(line, f'{name} is {text!r:.40}, but must be a finite number')


def _numbers(part: Any, names: str, line: int) -> tuple[float, ...]:
    if isinstance(part, str | float | list):
        raise BrokenFile(
            getattr(part, 'line', line), f'a mapping of {", ".join(names)} is missing'
        )
    return tuple(_number(getattr(part, name), name, line) for name in names)


def _sequence(value: Any, name: str, line: int) -> Sequence[Any]:
    if isinstance(value, str) or not hasattr(value, '__len__'):
        raise BrokenFile(getattr(value, 'line', line), f'{name} is no list')
    found: Sequence[Any] = value
    return found


def _seconds(part: Any, line: int) -> float:
    names = ('sec', 'nanosec')
    sec, nanosec = (_number(getattr(part, name), name, line) for name in names)
    return sec + 1e-9 * nanosec


def _collect_poses(message: Any, into: PathCollector) -> None:
    if _has(message, 'header'):
        into.frame = str(message.header.frame_id)
    poses = _sequence(message.poses, 'poses', 0)
    rows = list(_poses(poses))
    unset = all(quaternion in _WITHOUT_TURN for _, _, quaternion, _ in rows)
    if unset and rows:
        into.remarks.add(
            0, 'orientations', 'none of them is set: all are zero, or the one of the frame'
        )
    stamps = [stamp for _, _, _, stamp in rows]
    rise = all(a is not None and b is not None and b > a for a, b in itertools.pairwise(stamps))
    timed = rise and len(stamps) > 1
    if not timed and any(stamp for stamp in stamps):
        into.remarks.add(0, 'stamps', 'they do not rise from pose to pose')
    frames = set()
    for (line, position, quaternion, stamp), pose in zip(rows, poses, strict=True):
        if _has(pose, 'pose') and _has(pose, 'header') and pose.header.frame_id:
            frames.add(str(pose.header.frame_id))
        into.add(
            line,
            position,
            quaternion=None if unset else _unit(quaternion, line),
            # The first pose is where the arm goes first: that needs a time, which is not given.
            time=stamp - (stamps[0] or 0.0) if timed and stamp is not None else None,
        )
    if not into.frame and len(frames) == 1:
        into.frame = frames.pop()
    if frames - {into.frame}:
        into.remarks.add(
            0, f'frames of single poses ({", ".join(sorted(frames))})', 'a goal has one frame'
        )


def _poses(
    poses: Sequence[Any],
) -> Iterator[tuple[int, tuple[float, ...], tuple[float, ...], float | None]]:
    """Yield line, position, quaternion and stamp."""
    for i, item in enumerate(poses):
        line = _line(item, i)
        if isinstance(item, str | float | list):
            raise BrokenFile(line, 'this is no pose')
        stamped = _has(item, 'pose')
        pose = item.pose if stamped else item
        if isinstance(pose, str | float | list):
            raise BrokenFile(line, 'this is no pose')
        stamp = _seconds(item.header.stamp, line) if stamped and _has(item, 'header') else None
        yield (
            line,
            _numbers(pose.position, 'xyz', line),
            _numbers(pose.orientation, 'xyzw', line),
            stamp,
        )


def _unit(quaternion: tuple[float, ...], line: int) -> tuple[float, ...]:
    length = sum(v * v for v in quaternion) ** 0.5
    if not abs(length - 1.0) < 0.01:
        raise BrokenFile(line, f'the orientation has the length {length:.4g}, but must have 1')
    return tuple(v / length for v in quaternion)


def _collect_joints(message: Any, options: ImportOptions, into: PathCollector) -> None:
    names = [str(name) for name in _sequence(message.joint_names, 'joint_names', 0)]
    order = []
    for joint in JOINT_NAMES:
        # A prefix tells the arms of a cell apart.
        found = [i for i, name in enumerate(names) if name.endswith(joint)]
        if len(found) != 1:
            line = getattr(message.joint_names, 'line', 0)
            raise BrokenFile(line, f'the joint {joint} is {len(found)} times in joint_names')
        order.append(found[0])
    for i in sorted(set(range(len(names))) - set(order)):
        into.remarks.add(0, f'the joint {names[i]}', 'it is none of the arm')
    rows: list[list[float]] = []
    times: list[float] = []
    lines: list[int] = []
    for i, point in enumerate(_sequence(message.points, 'points', 0)):
        line = _line(point, i)
        positions = _sequence(point.positions, 'positions', line)
        if len(positions) != len(names):
            raise BrokenFile(line, f'it has {len(positions)} positions for {len(names)} joints')
        rows.append([_number(positions[k], 'positions', line) for k in order])
        times.append(_seconds(point.time_from_start, line))
        lines.append(line)
        for name in ('velocities', 'accelerations', 'effort'):
            if _has(point, name) and len(getattr(point, name)):
                into.remarks.add(line, name, 'the arm stops, or blends, between joint motions')
    if not rows:
        return
    poses = compose_rows(options.arm.forward_rows(np.array(rows)), options.T_flange_tcp)
    timed = times[0] >= 0.0 and all(a < b for a, b in itertools.pairwise(times))
    if not timed and any(times):
        into.remarks.add(0, 'time_from_start', 'it does not rise from point to point')
    for line, q, pose, time in zip(lines, rows, poses.tolist(), times, strict=True):
        into.add(
            line,
            pose[:3],
            SegmentType.JOINT,
            quaternion=pose[3:],
            posture=Posture(names=JOINT_NAMES, values=tuple(q)),
            time=time if timed else None,
        )


FORMAT = ImportFormat(
    name='ros',
    suffixes=('.yaml', '.yml'),
    terms=term_table(),
    others='Every other field is left out, and said.',
    collect=collect_yaml,
)
