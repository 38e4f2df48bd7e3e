# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
A recording as MCAP with messages of ROS 2, for Foxglove, PlotJuggler, rosbag2 and others.

Topics have the names and types that the ROS node uses, so that one layout of a viewer fits both.
The log time of a message is the start of the recording plus the time of its packet or event.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from datetime import datetime
import heapq
import json
from typing import Any, BinaryIO, TypeAlias

import numpy as np
from numpy.typing import NDArray

from ur_cartesian_driver.driver.recordings.export_options import ExportOptions
from ur_cartesian_driver.driver.recordings.message_definitions import message_definition
from ur_cartesian_driver.driver.recordings.recording import Recording
from ur_cartesian_driver.kinematics.robot_models import JOINT_NAMES
from ur_cartesian_driver.motion.geometry.arrays import Floats
from ur_cartesian_driver.motion.geometry.pose import conjugate, rotate
from ur_cartesian_driver.motion.goal.known_frames import BASE, TCP

#: Name of the node, and prefix of its topics.
NODE = '/ur_cartesian_driver'
#: Prefix of single-number topics, which exist only in recordings.
NUMBERS = f'{NODE}/recording'
_NUMBER_COLUMNS = (
    'speed_scaling',
    'slider',
    'lag',
    'buffered',
    'digital_output',
    'pulse_counts',
    'points_begun',
    'waypoint',
    'robot_mode',
    'safety_mode',
    'runtime_state',
)
_INFO, _WARN, _ERROR = 20, 30, 40  # levels of rcl_interfaces/Log
_WARNINGS = ('cancel', 'safety', 'robot')

_Message: TypeAlias = dict[str, Any]
#: Log time [ns], topic, type, message.
_Record: TypeAlias = tuple[int, str, str, _Message]


def write_mcap(recording: Recording, file: BinaryIO, options: ExportOptions) -> None:
    """
    Write all packets, the plan and the events.

    :raises ImportError: the packages for MCAP are not installed.
    :raises OSError: the definition of a message is not installed, or the file cannot be written.
    :raises ValueError: the recording is damaged: it has no date, or a time that is not finite.
    """
    try:
        from mcap_ros2.writer import Writer
    except ModuleNotFoundError as error:
        if (error.name or '').partition('.')[0] not in ('mcap', 'mcap_ros2'):
            raise  # mcap is installed, but a package that it needs is not
        raise ImportError(
            'MCAP needs mcap and mcap-ros2-support, which are not installed; run "pip install '
            "mcap-ros2-support\", or install this package with its extra 'export'"
        ) from None
    messages = _Messages(recording, options.tf_prefix)
    schemas: dict[str, Any] = {}
    with Writer(file) as writer:
        writer.add_metadata(
            'recording',
            {
                name: value if isinstance(value, str) else json.dumps(value)
                for name, value in recording.metadata.items()
            },
        )
        for time, topic, kind, message in heapq.merge(
            messages.single(),
            messages.numbers(),
            messages.packets(options.progress),
            key=_log_time,
        ):
            if kind not in schemas:
                schemas[kind] = writer.register_msgdef(
                    kind.replace('/', '/msg/'), message_definition(kind)
                )
            writer.write_message(topic, schemas[kind], message, log_time=time)


def _log_time(record: _Record) -> int:
    return record[0]


class _Messages:
    """The messages of a recording; each method yields its messages in the order of time."""

    def __init__(self, recording: Recording, tf_prefix: str) -> None:
        self._recording = recording
        self._base, self._tcp = tf_prefix + BASE, tf_prefix + TCP
        self._joints = [tf_prefix + name for name in JOINT_NAMES]
        try:
            created = datetime.fromisoformat(recording.metadata['created'])
        except (KeyError, TypeError, ValueError):
            raise ValueError(
                "the recording is damaged: its metadata has no date and time 'created'"
            ) from None
        self._start = round(1e3 * created.timestamp()) * 1_000_000

    def _nanoseconds(self, seconds: Floats) -> list[int]:
        if not np.isfinite(seconds).all():
            raise ValueError('the recording is damaged: a time is not finite')
        found: list[int] = (self._start + np.rint(1e9 * seconds).astype(np.int64)).tolist()
        return found

    def single(self) -> Iterator[_Record]:
        """Yield the plan, and the events as the messages of a log."""
        if len(self._recording.planned_pose):
            metadata = self._recording.metadata
            on_part = metadata.get('moving_frame') is not None
            header = _header(self._start, metadata['frame_id'] if on_part else self._base)
            poses = [
                {'header': header, 'pose': _pose(row)}
                for row in self._recording.planned_pose.tolist()
            ]
            path = {'header': header, 'poses': poses}
            yield self._start, f'{NODE}/plan', 'nav_msgs/Path', path
        outcome = self._recording.metadata.get('outcome') or {}
        failed = outcome.get('code', 0) != 0
        times = self._nanoseconds(np.array([time for time, _, _ in self._recording.events]))
        for time, (_, kind, text) in zip(times, self._recording.events, strict=True):
            level = _WARN if kind in _WARNINGS else _INFO
            yield (
                time,
                '/rosout',
                'rcl_interfaces/Log',
                {
                    'stamp': _stamp(time),
                    'level': _ERROR if kind == 'end' and failed else level,
                    'name': f'{NODE[1:]}.{kind}',
                    'msg': text,
                },
            )

    def numbers(self) -> Iterator[_Record]:
        """Yield the columns of single numbers, without runs of the same number."""
        found = self._recording
        deviation = found.deviation()
        columns: dict[str, NDArray[Any]] = {
            f'{NODE}/speed_scaling': found.effective_speed,
            **{f'{NUMBERS}/{name}': getattr(found, name) for name in _NUMBER_COLUMNS},
            **{f'{NUMBERS}/analog_output_{i}': found.analog_output[:, i] for i in range(2)},
            f'{NUMBERS}/deviation_position': deviation.position,
            f'{NUMBERS}/deviation_angle': deviation.angle,
            f'{NUMBERS}/planned_time': deviation.planned_time,
        }
        times = self._nanoseconds(found.time)
        return heapq.merge(
            *(_number_records(topic, values, times) for topic, values in columns.items()),
            key=_log_time,
        )

    def packets(self, progress: Callable[[], object]) -> Iterator[_Record]:
        """Yield the messages about joints and TCP for each packet."""
        found = self._recording
        columns = (
            found.actual_q,
            found.actual_qd,
            found.target_q,
            found.target_qd,
            found.actual_pose,
            found.actual_twist,
            found.target_pose,
            found.target_twist,
            found.wrench,
        )
        times = self._nanoseconds(found.time)
        for time, *rows in zip(times, *columns, strict=True):
            q, qd, target_q, target_qd, pose, twist, target_pose, target_twist, wrench = (
                row.tolist() for row in rows
            )
            header = _header(time, self._base)
            yield time, '/joint_states', 'sensor_msgs/JointState', self._joint_state(time, q, qd)
            yield (
                time,
                f'{NODE}/target_joint_states',
                'sensor_msgs/JointState',
                self._joint_state(time, target_q, target_qd),
            )
            for prefix, row, rates in (('', pose, twist), ('target_', target_pose, target_twist)):
                yield (
                    time,
                    f'{NODE}/{prefix}tcp_pose',
                    'geometry_msgs/PoseStamped',
                    {'header': header, 'pose': _pose(row)},
                )
                yield (
                    time,
                    f'{NODE}/{prefix}tcp_twist',
                    'geometry_msgs/TwistStamped',
                    {
                        'header': header,
                        'twist': {'linear': _vector(rates[:3]), 'angular': _vector(rates[3:])},
                    },
                )
            transforms = [
                _transform(header, self._tcp, pose),
                _transform(header, f'{self._tcp}_target', target_pose),
            ]
            yield time, '/tf', 'tf2_msgs/TFMessage', {'transforms': transforms}
            if wrench[0] == wrench[0]:  # not NaN, so the wrench is known
                yield (
                    time,
                    f'{NODE}/wrench',
                    'geometry_msgs/WrenchStamped',
                    self._wrench(time, pose, wrench),
                )
            progress()

    def _joint_state(self, time: int, q: list[float], qd: list[float]) -> _Message:
        return {
            'header': _header(time, ''),
            'name': self._joints,
            'position': q,
            'velocity': qd,
            'effort': [],
        }

    def _wrench(self, time: int, pose: list[float], wrench: list[float]) -> _Message:
        """Return the wrench in the axes of the TCP, as the node publishes it."""
        x, y, z, w = pose[3:]
        to_tcp = conjugate((x, y, z, w))
        force, torque = (
            rotate(to_tcp, (part[0], part[1], part[2])) for part in (wrench, wrench[3:])
        )
        return {
            'header': _header(time, self._tcp),
            'wrench': {'force': _vector(force), 'torque': _vector(torque)},
        }


def _number_records(topic: str, values: NDArray[Any], times: list[int]) -> Iterator[_Record]:
    """
    Yield the numbers of a column at their changes, without NaN; an unknown integer is -1.

    The last number before each change is yielded too, so that a plot with straight lines shows
    steps.
    """
    if not len(values):
        return
    kind = 'std_msgs/Int32' if values.dtype.kind == 'i' else 'std_msgs/Float64'
    changes = values[1:] != values[:-1]
    kept = np.append(changes, True) | np.insert(changes, 0, True)
    if kind == 'std_msgs/Float64':
        kept &= ~np.isnan(values)
    rows = np.flatnonzero(kept)
    for i, value in zip(rows.tolist(), values[rows].tolist(), strict=True):
        yield times[i], topic, kind, {'data': value}


def _stamp(time: int) -> _Message:
    sec, nanosec = divmod(time, 1_000_000_000)
    return {'sec': sec, 'nanosec': nanosec}


def _header(time: int, frame: str) -> _Message:
    return {'stamp': _stamp(time), 'frame_id': frame}


def _vector(numbers: Sequence[float]) -> _Message:
    return dict(zip('xyz', numbers, strict=True))


def _pose(row: list[float]) -> _Message:
    return {
        'position': _vector(row[:3]),
        'orientation': dict(zip('xyzw', row[3:], strict=True)),
    }


def _transform(header: _Message, child: str, row: list[float]) -> _Message:
    pose = _pose(row)
    return {
        'header': header,
        'child_frame_id': child,
        'transform': {'translation': pose['position'], 'rotation': pose['orientation']},
    }
