# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Paths and joint trajectories of ROS, and streams of poses.

The messages come as text that ``ros2 topic echo`` printed, or as ROS objects. One reader reads
both forms, because the parsed text has the fields of a message as attributes.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
import itertools
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ur_cartesian_driver.importing.import_format import ImportFormat, Treatment
from ur_cartesian_driver.importing.import_options import ImportOptions
from ur_cartesian_driver.importing.imported_path import (
    BrokenFile,
    ImportNotes,
    JOINTS_HAVE_NO_FRAME,
    PathCollector,
)
from ur_cartesian_driver.importing.messages.echoed_message import (
    echoed_messages,
    EchoedMessage,
    MessagePart,
)
from ur_cartesian_driver.importing.messages.message_terms import (
    CONTROLLER_GOALS,
    DISPLAY_TRAJECTORY,
    JOINT_TRAJECTORY,
    message_type,
    MULTI_DOF,
    OWN_GOAL,
    PATH,
    POSES,
    ROBOT_TRAJECTORY,
    TERMS,
)
from ur_cartesian_driver.importing.text_file import file_text, quoted
from ur_cartesian_driver.kinematics.robot_models import JOINT_NAMES
from ur_cartesian_driver.motion.geometry.pose import MAX_ANGLE
from ur_cartesian_driver.motion.geometry.pose_rows import compose_rows
from ur_cartesian_driver.motion.goal.goal import Posture, SegmentType

_WITHOUT_TURN = ((0.0, 0.0, 0.0, 1.0), (0.0, 0.0, 0.0, 0.0))
#: The fields that are read from the parts of a pose.
_PARTS_OF_POSE = {'position': 'xyz', 'orientation': 'xyzw'}
#: The fields that are read from the header of a pose.
_STAMPED = ('frame_id', 'stamp')


def collect_yaml(file: Path, options: ImportOptions, into: PathCollector) -> None:
    """
    Read the first message of a file, or all messages if they are single poses.

    :raises BrokenFile: the first message has neither a path nor a pose, or a message is broken.
    """
    messages = echoed_messages(file_text(file), into.remarks)
    if not messages:
        raise BrokenFile(0, 'the file is empty; ros2 topic echo prints messages into it')
    first = messages[0].read()
    if message_type(first.fields) in POSES:
        _collect_poses(_stream(messages, into.remarks), '', into)
        return
    for message in messages[1:]:
        into.remarks.add(message.line, 'another message', 'only the first one of a file is read')
    collect_message(first, options, into)


def collect_message(message: Any, options: ImportOptions, into: PathCollector) -> None:
    """
    Read a message, or an object with its fields.

    :raises BrokenFile: the message has no path, or a value does not suit its field.
    """
    name = _type(message)
    if name == PATH:
        header = message.header if 'header' in _fields(message) else None
        if header is not None:
            _say_others(header, ('frame_id',), into.remarks)
        _say_others(message, ('header', 'poses'), into.remarks)
        frame = _frame(header, 0)
        _collect_poses(_sequence(message.poses, 'poses', 0), frame, into)
    elif name == JOINT_TRAJECTORY:
        _collect_joints(message, options, into)
    elif name == ROBOT_TRAJECTORY:
        _say_others(message, ('joint_trajectory',), into.remarks)
        _collect_joints(message.joint_trajectory, options, into)
    elif name in CONTROLLER_GOALS:
        _say_others(message, ('trajectory',), into.remarks)
        collect_message(message.trajectory, options, into)
    elif name == DISPLAY_TRAJECTORY:
        _say_others(message, ('trajectory',), into.remarks)
        trajectories = _sequence(message.trajectory, 'trajectory', 0)
        for i, other in enumerate(trajectories[1:], 1):
            into.remarks.add(_line(other, i), 'another trajectory', 'only the first one is read')
        for trajectory in trajectories[:1]:
            collect_message(trajectory, options, into)
    else:
        _collect_poses([message], '', into)


def _type(message: Any) -> str:
    """
    Return the type of a message that has a path or a pose.

    :raises BrokenFile: the message has neither.
    """
    line, fields = getattr(message, 'line', 0), _fields(message)
    name = message_type(fields)
    if not name:
        raise BrokenFile(
            line,
            'this is neither a Path, a PoseArray, a JointTrajectory nor a pose; its fields are '
            f'{quoted(", ".join(fields), 80)}',
        )
    if name == OWN_GOAL:
        inner = message_type(_fields(message.trajectory))
        if inner in (JOINT_TRAJECTORY, ROBOT_TRAJECTORY):
            name = CONTROLLER_GOALS[inner == ROBOT_TRAJECTORY]
    if TERMS[name].treatment is Treatment.REFUSED:
        raise BrokenFile(line, f'this is a {name}: {TERMS[name].reason}')
    return name


def _stream(messages: Sequence[EchoedMessage], remarks: ImportNotes) -> Iterator[Any]:
    """
    Yield the single poses of a stream, whose last message can be cut off.

    :raises BrokenFile: a message that is not cut off is broken.
    """
    for i, message in enumerate(messages):
        can_be_cut = i > 0 and not message.is_whole
        try:
            part = message.read()
            is_cut = can_be_cut and not (message.text.endswith('\n') and [*_poses([part])])
        except BrokenFile:
            if not can_be_cut:
                raise
            is_cut = True
        if is_cut:
            remarks.add(message.line, 'the last message', 'it is cut off')
        elif message_type(part.fields) not in POSES:
            remarks.add(message.line, 'another message', 'it is no pose as the first one is')
        else:
            yield part


def _fields(part: Any) -> Mapping[str, Any]:
    """Return the fields of a message, or of a part of one."""
    if isinstance(part, MessagePart):
        return part.fields
    if hasattr(part, 'get_fields_and_field_types'):
        return {name: getattr(part, name) for name in part.get_fields_and_field_types()}
    return getattr(part, '__dict__', {})


def _say_others(part: Any, read: Collection[str], remarks: ImportNotes, line: int = 0) -> None:
    """Add remarks on the left-out fields of a part, except fields that are empty or zero."""
    for name, value in _fields(part).items():
        if name not in read and not _is_default(value):
            term = TERMS.get(name) or TERMS.get(f'header.{name}')
            reason = term.reason if term else 'a path has no such field'
            remarks.add(getattr(value, 'line', line), name, reason)


def _is_default(value: Any) -> bool:
    """Return whether a field has its default value, so that it was probably not set."""
    if isinstance(value, str | float | int):
        return not value
    if hasattr(value, '__len__'):
        return all(map(_is_default, value))
    return all(map(_is_default, _fields(value).values()))


def _line(thing: Any, index: int) -> int:
    """Return the line of a value from a text; for a value of a message, its number from 1."""
    return int(getattr(thing, 'line', index + 1))


def _number(value: Any, name: str, line: int) -> float:
    line = getattr(value, 'line', line)
    if isinstance(value, float | int) and not isinstance(value, bool) and np.isfinite(value):
        return float(value)
    what = repr(str(value)) if isinstance(value, str | float) else 'none'
    raise BrokenFile(line, f'{name} is {what:.40}, but must be a finite number')


def _part(value: Any, names: str, line: int) -> Any:
    """
    Return a part of a message.

    :raises BrokenFile: the part is a number, a text or a list.
    """
    if isinstance(value, str | float | list):
        raise BrokenFile(getattr(value, 'line', line), f'a mapping of {names} is missing')
    return value


def _numbers(part: Any, names: str, line: int) -> tuple[float, ...]:
    part = _part(part, ', '.join(names), line)
    return tuple(_number(getattr(part, name), name, line) for name in names)


def _sequence(value: Any, name: str, line: int) -> Sequence[Any]:
    """
    Return a value that has to be a list.

    :raises BrokenFile: the value is no list, or echo has shortened it.
    """
    line = getattr(value, 'line', line)
    if isinstance(value, str) and value.startswith('<') and 'type:' in value:
        raise BrokenFile(line, f'{name} was not printed; echo it without --no-arr')
    if isinstance(value, str) or not hasattr(value, '__len__'):
        raise BrokenFile(line, f'{name} is no list')
    if len(value) and isinstance(value[-1], str) and value[-1] == '...':
        raise BrokenFile(
            getattr(value[-1], 'line', line),
            f'{name} goes on, but ros2 topic echo has cut it; echo it with --full-length',
        )
    found: Sequence[Any] = value
    return found


def _seconds(part: Any, line: int) -> float:
    """Return the time [s] of a stamp or a duration; ROS 1 names the fields differently."""
    part = _part(part, 'sec, nanosec', line)
    names = ('secs', 'nsecs') if 'secs' in _fields(part) else ('sec', 'nanosec')
    sec, nanosec = (_number(getattr(part, name), name, line) for name in names)
    return sec + 1e-9 * nanosec


def _frame(header: Any, line: int) -> str:
    """Return the frame of a header; empty = none."""
    if header is None:
        return ''
    frame = _part(header, 'stamp, frame_id', line).frame_id
    if not isinstance(frame, str):
        raise BrokenFile(getattr(frame, 'line', line), 'frame_id is no text; put it into quotes')
    return str(frame)


class _Pose(NamedTuple):
    line: int
    position: tuple[float, ...]
    quaternion: tuple[float, ...]
    #: The time in the header [s]; None = the message has no header.
    stamp: float | None
    frame: str


def _collect_poses(items: Sequence[Any] | Iterator[Any], frame: str, into: PathCollector) -> None:
    """
    Read poses.

    :param frame: the frame in the header of the whole path; empty = none.
    :raises BrokenFile: the poses are in several frames, or a value does not suit its field.
    """
    items = list(items)
    poses = list(_poses(items))
    for item in items:
        _say_others_of_pose(item, into.remarks)
    for pose in poses:
        frame = frame or pose.frame
        if pose.frame not in ('', frame):
            raise BrokenFile(
                pose.line, f'its frame is {pose.frame!r}, but the path is in {frame!r}'
            )
    into.frame = frame
    unset = all(pose.quaternion in _WITHOUT_TURN for pose in poses)
    if unset and poses:
        into.remarks.add(
            0, 'orientations', 'none of them is set: all are zero, or the one of the frame'
        )
    stamps = [pose.stamp or 0.0 for pose in poses]
    timed = len(stamps) > 1 and all(a < b for a, b in itertools.pairwise(stamps))
    if not timed and len(set(stamps)) > 1:
        into.remarks.add(0, 'stamps', 'they do not rise from pose to pose')
    for pose, stamp in zip(poses, stamps, strict=True):
        into.add(
            pose.line,
            pose.position,
            quaternion=None if unset else _unit(pose.quaternion, pose.line),
            time=stamp - stamps[0] if timed else None,
        )


def _poses(items: Sequence[Any]) -> Iterator[_Pose]:
    """
    Yield poses with or without a header, a covariance or a twist.

    :raises BrokenFile: an item is no pose.
    """
    for i, item in enumerate(items):
        line = _line(item, i)
        pose = _part(item, 'position, orientation', line)
        header = pose.header if 'header' in _fields(pose) else None
        while 'pose' in _fields(pose):
            pose = _part(pose.pose, 'position, orientation', line)
        yield _Pose(
            line,
            _numbers(pose.position, 'xyz', line),
            _numbers(pose.orientation, 'xyzw', line),
            None if header is None else _seconds(_part(header, 'stamp', line).stamp, line),
            _frame(header, line),
        )


def _say_others_of_pose(item: Any, remarks: ImportNotes) -> None:
    """Add remarks on the left-out fields of a pose."""
    _say_others(item, ('header', 'pose', 'position', 'orientation'), remarks)
    if 'header' in _fields(item):
        _say_others(item.header, _STAMPED, remarks)
    for part, names in _PARTS_OF_POSE.items():
        if part in _fields(item):
            _say_others(getattr(item, part), names, remarks)
    if 'pose' in _fields(item):
        _say_others_of_pose(item.pose, remarks)


def _unit(quaternion: tuple[float, ...], line: int) -> tuple[float, ...]:
    length = sum(v * v for v in quaternion) ** 0.5
    if not abs(length - 1.0) < 0.01:
        raise BrokenFile(line, f'the orientation has the length {length:.4g}, but must have 1')
    return tuple(v / length for v in quaternion)


def _collect_joints(message: Any, options: ImportOptions, into: PathCollector) -> None:
    """
    Read a JointTrajectory.

    :raises BrokenFile: an option moves the path, the joints are not the arm's, or a value
        does not suit its field.
    """
    line = getattr(message, 'line', 0)
    if options.moves_path:
        raise BrokenFile(line, JOINTS_HAVE_NO_FRAME)
    _say_others(message, ('joint_names', 'points'), into.remarks)
    names = [str(name) for name in _sequence(message.joint_names, 'joint_names', line)]
    order = _joint_order(names, getattr(message.joint_names, 'line', line), into.remarks)
    rows: list[list[float]] = []
    times: list[float] = []
    lines: list[int] = []
    for i, item in enumerate(_sequence(message.points, 'points', line)):
        line = _line(item, i)
        point = _part(item, 'positions, time_from_start', line)
        if 'transforms' in _fields(point):
            raise BrokenFile(line, f'this is a {MULTI_DOF}: {TERMS[MULTI_DOF].reason}')
        _say_others(point, ('positions', 'time_from_start'), into.remarks, line)
        positions = _sequence(point.positions, 'positions', line)
        if len(positions) != len(names):
            raise BrokenFile(line, f'it has {len(positions)} positions for {len(names)} joints')
        rows.append([_angle(positions[k], line) for k in order])
        times.append(_seconds(point.time_from_start, line))
        lines.append(line)
    if not rows:
        return
    poses = compose_rows(options.arm.forward_rows(np.array(rows)), options.T_flange_tcp)
    timed = times[0] >= 0.0 and all(a < b for a, b in itertools.pairwise(times))
    if not timed and any(times):
        into.remarks.add(0, 'time_from_start', 'it does not rise from point to point')
    for line, q, pose, time in zip(lines, rows, poses.tolist(), times, strict=True):
        as_line = options.lines and len(into) > 0
        into.add(
            line,
            pose[:3],
            SegmentType.LINEAR if as_line else SegmentType.JOINT,
            quaternion=pose[3:],
            posture=None if as_line else Posture(names=JOINT_NAMES, values=tuple(q)),
            time=time if timed else None,
        )


def _angle(value: Any, line: int) -> float:
    """
    Return a joint position [rad].

    :raises BrokenFile: the value is no number, or must be in degrees.
    """
    angle = _number(value, 'positions', line)
    if abs(angle) > MAX_ANGLE:
        raise BrokenFile(
            getattr(value, 'line', line), f'a joint position is {angle:g} rad; give it in radians'
        )
    return angle


def _joint_order(names: Sequence[str], line: int, remarks: ImportNotes) -> list[int]:
    """
    Return the indices of the arm's joints among names, from base to wrist 3.

    :raises BrokenFile: a joint is missing, or occurs twice.
    """
    order = []
    for joint in JOINT_NAMES:
        # Names can have a prefix that distinguishes the arms of a cell.
        found = [i for i, name in enumerate(names) if name.endswith(joint)]
        if len(found) != 1:
            raise BrokenFile(line, f'joint_names has {len(found)} of {joint}, but must have one')
        order.append(found[0])
    for i in sorted(set(range(len(names))) - set(order)):
        remarks.add(line, f'the joint {names[i]}', 'it is none of the arm')
    return order


FORMAT = ImportFormat(
    terms=TERMS,
    others='Every other field is left out, and said; every other message is refused.',
    collect=collect_yaml,
)
