# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
A recorded motion, for analysis.

``numpy.load`` opens the same files without this package; here the arrays have names and types, a
recording that was cut off by the end of its process can be read too, and the executed path is
compared with the planned one in the same way as in the driver.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from errno import EINVAL
import json
from pathlib import Path
from typing import Any
import zipfile

import numpy as np
from numpy.typing import NDArray

from ur_cartesian_driver.driver.recordings import recording_format as disk
from ur_cartesian_driver.driver.recordings.recording_format import Event
from ur_cartesian_driver.execution.monitoring.path_tracker import PathTracker, tracker_speed
from ur_cartesian_driver.motion.geometry.arrays import Floats, Int32s
from ur_cartesian_driver.motion.geometry.pose import pose_from_row
from ur_cartesian_driver.motion.geometry.pose_rows import (
    compose_rows,
    cross_rows,
    inverse_rows,
    rotate_rows,
)
from ur_cartesian_driver.motion.plan.plan import ReferencePath
from ur_cartesian_driver.motion.state.effective_speed import EffectiveSpeed
from ur_cartesian_driver.protocol.program.registers import PULSE_COUNTS


class _NoRecording(ValueError):
    """The file is not a recording."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class RecordedDeviation:
    """Distance of the tool from the planned path, one row for each of the n packets."""

    #: (n,) distance [m] and angle [rad] of the measured pose from the path.
    position: Floats
    angle: Floats
    #: (n,) distance [m] and angle [rad] of the controller's own target from the path.
    target_position: Floats
    target_angle: Floats
    #: (n,) planned time of the target's place on the path, at full speed [s].
    planned_time: Floats
    #: (n,) the goal's next point from that place; -1 = no plan.
    waypoint: Int32s


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Recording:
    """
    One motion: n packets of the robot, m samples of the plan.

    Poses describe the TCP in the robot's base: x y z [m], unit quaternion x y z w. Twists are
    linear [m/s] and angular [rad/s] in base axes. Planned poses of a path on a held part describe
    the fixed tool in the frame on the part, see :meth:`on_the_part`.
    """

    #: Goal, parameters and outcome; see doc/recordings.md.
    metadata: Mapping[str, Any]
    events: list[Event] = field(repr=False)
    #: (n,) controller's clock from the start of the motion [s].
    time: Floats = field(repr=False)
    #: (n, 7) measured pose; pose of the controller's target.
    actual_pose: Floats = field(repr=False)
    target_pose: Floats = field(repr=False)
    #: (n, 6) measured twist; twist of the controller's target.
    actual_twist: Floats = field(repr=False)
    target_twist: Floats = field(repr=False)
    #: (n, 6) measured and target joint positions [rad]; measured and target velocities [rad/s].
    actual_q: Floats = field(repr=False)
    target_q: Floats = field(repr=False)
    actual_qd: Floats = field(repr=False)
    target_qd: Floats = field(repr=False)
    #: (n, 6) force [N] and torque [Nm] at the TCP in base axes; NaN = unknown.
    wrench: Floats = field(repr=False)
    #: (n,) time by which the arm lags the newest set-point [s]; motion time that the robot has
    #: received and not yet run [s]; NaN = unknown.
    lag: Floats = field(repr=False)
    buffered: Floats = field(repr=False)
    #: (n,) speed scaling by causes other than the slider, 0 to 1; the slider, 0 to 1.
    speed_scaling: Floats = field(repr=False)
    slider: Floats = field(repr=False)
    #: (n, 2) standard analog outputs [A] or [V]; NaN = unknown.
    analog_output: Floats = field(repr=False)
    #: (n,) digital outputs as bits: 0-7 standard, 8-15 configurable, 16-17 tool; -1 = unknown.
    digital_output: Int32s = field(repr=False)
    #: (n,) counts of pulses of all outputs in one number, which :attr:`pulses` takes apart.
    pulse_counts: Int32s = field(repr=False)
    #: (n,) number of motions that the robot program has begun; the goal's point to which the arm
    #: moves, -1 = unknown.
    points_begun: Int32s = field(repr=False)
    waypoint: Int32s = field(repr=False)
    #: (n,) numbers of the controller's robot mode, safety mode and runtime state.
    robot_mode: Int32s = field(repr=False)
    safety_mode: Int32s = field(repr=False)
    runtime_state: Int32s = field(repr=False)
    #: The plan's samples: (m,) times [s]; (m, 7) poses; (m,) the goal's point to which each leads.
    planned_time: Floats = field(repr=False)
    planned_pose: Floats = field(repr=False)
    planned_point: Int32s = field(repr=False)

    @classmethod
    def load(cls, path: str | Path, max_rows: int = 0) -> Recording:
        """
        Read a recording.

        :param path: a file ``.npz``, or the folder ``.part`` of a motion that is running or whose
            process was killed.
        :param max_rows: largest number of packets to read: of a longer recording only every
            second, third, ... packet is read; 0 = all packets.
        :raises OSError: the file does not exist, or cannot be read.
        :raises ValueError: the file is not a recording, or is damaged.
        """
        path = Path(path)
        try:
            found = _from_folder(path, max_rows) if path.is_dir() else _from_file(path, max_rows)
        except _NoRecording:
            raise
        except Exception as error:  # NumPy, zipfile, zlib and json each raise their own errors
            # EINVAL means damage, too: the file refers to an offset before its start.
            if isinstance(error, OSError) and error.errno != EINVAL:
                raise
            raise ValueError(f'{path} is damaged: {error}') from error
        found._check_columns(path)
        return found

    def _check_columns(self, path: Path) -> None:
        """Refuse columns of different lengths or wrong types, as in a corrupt file."""
        for names, rows in (
            (_EXECUTED_COLUMNS, len(self.time)),
            (_PLANNED_COLUMNS, len(self.planned_time)),
        ):
            for name in names:
                if len(getattr(self, name)) != rows:
                    raise ValueError(
                        f'{path} is damaged: {name} has {len(getattr(self, name))} rows, not '
                        f'{rows}'
                    )
        for name in (*_EXECUTED_COLUMNS, *_PLANNED_COLUMNS):
            planned = name.removeprefix('planned_')
            fields = disk.EXECUTED_DTYPE if planned == name else disk.PLANNED_DTYPE
            values, expected = getattr(self, name), fields[planned]
            if values.dtype != expected.base or values.shape[1:] != expected.shape:
                raise ValueError(
                    f'{path} is damaged: {name} has rows of {values.dtype} {values.shape[1:]}, '
                    f'not of {expected.base} {expected.shape}'
                )

    @property
    def tool_speed(self) -> Floats:
        """(n,) measured speed of the TCP [m/s]."""
        return np.asarray(np.linalg.norm(self.actual_twist[:, :3], axis=1))

    @property
    def pulses(self) -> dict[str, NDArray[np.int_]]:
        """
        Indices (k,) of the packets that show a pulse, by output, such as 'standard_digital 2'.

        A packet that shows several pulses, because packets were lost, is listed once for each.
        """
        found = {}
        for slot, output in enumerate(self.metadata.get('pulse_outputs', ())):
            given = self.pulse_counts // PULSE_COUNTS**slot
            new = np.diff(given, prepend=given[:1]) % PULSE_COUNTS
            found[str(output)] = np.repeat(np.arange(len(new)), new)
        return found

    @property
    def effective_speed(self) -> Floats:
        """(n,) speed of the program's motion, as a fraction 0 to 1."""
        speed = EffectiveSpeed()
        rows = (self.time, self.speed_scaling, self.slider, self.runtime_state)
        return np.array([speed.update(*row) for row in zip(*rows, strict=True)], dtype=np.float64)

    @property
    def reference(self) -> ReferencePath:
        """The planned path."""
        return ReferencePath(
            poses=self.planned_pose, point=self.planned_point, time=self.planned_time
        )

    @property
    def points(self) -> Floats:
        """(k, 7) the planned poses at the goal's points, or in the middle of their blends."""
        last = np.flatnonzero(np.diff(self.planned_point, append=-1))
        return np.asarray(self.planned_pose[last])

    def on_the_part(self) -> Recording:
        """
        Return the recording in the frame of the plan, if this frame is on a held part.

        All poses and twists then describe the fixed tool in that frame, as the planned poses do.
        """
        known = self.metadata.get('moving_frame')
        if known is None:
            return self
        T_base_tool = pose_from_row(known['T_base_tool'])
        T_tcp_flange = pose_from_row(self.metadata['T_flange_tcp']).inverse()
        T_tcp_frame = T_tcp_flange @ pose_from_row(known['T_flange_frame'])

        def seen(poses: Floats, twists: Floats) -> tuple[Floats, Floats]:
            T_frame_base = inverse_rows(compose_rows(poses, T_tcp_frame))
            turned, w = T_frame_base[:, 3:], twists[:, 3:]
            v = twists[:, :3] + cross_rows(w, np.array(T_base_tool.position) - poses[:, :3])
            rates = np.concatenate([rotate_rows(turned, v), rotate_rows(turned, w)], axis=1)
            return compose_rows(T_frame_base, T_base_tool), -rates

        actual_pose, actual_twist = seen(self.actual_pose, self.actual_twist)
        target_pose, target_twist = seen(self.target_pose, self.target_twist)
        return replace(
            self,
            metadata={**self.metadata, 'moving_frame': None},
            actual_pose=actual_pose,
            actual_twist=actual_twist,
            target_pose=target_pose,
            target_twist=target_twist,
        )

    def deviation(self) -> RecordedDeviation:
        """
        Return the deviation from the plan, packet by packet.

        The target is followed along the path, only forwards; the measured pose is compared with
        the nearest place on the path around the target. So a path that crosses itself is followed
        in the right order, and a slowed robot is not off its path. For a recording
        without a plan (of live targets), the numbers are NaN, and the waypoints -1.
        """
        rows = np.full((len(self.time), 6), np.nan)
        if len(self.planned_time) > 1:
            self.on_the_part()._compare(PathTracker(self.reference), rows)
        position, angle, target_position, target_angle, time, waypoint = rows.T
        return RecordedDeviation(
            position=position,
            angle=angle,
            target_position=target_position,
            target_angle=target_angle,
            planned_time=time,
            waypoint=np.where(np.isnan(waypoint), -1.0, waypoint).astype(np.int32),
        )

    def _compare(self, tracker: PathTracker, rows: Floats) -> None:
        """Fill in the rows of a deviation, one for each packet."""
        elapsed, max_speed_before = 0.0, 0.0
        for i in range(len(rows)):
            twist = tuple(self.target_twist[i].tolist())
            max_speed = tracker_speed(twist)
            if i:
                elapsed = float(self.time[i] - self.time[i - 1])
            target, actual = (
                pose_from_row(poses[i]) for poses in (self.target_pose, self.actual_pose)
            )
            tracker.update(target, 2.0 * elapsed * max(max_speed, max_speed_before))
            max_speed_before = max_speed
            desired, reached = tracker.desired(actual, twist), tracker.pose()
            rows[i] = (
                desired.distance_to(actual),
                desired.angle_to(actual),
                reached.distance_to(target),
                reached.angle_to(target),
                tracker.time(),
                tracker.waypoint(),
            )


def _from_file(path: Path, max_rows: int) -> Recording:
    if path.is_file() and not zipfile.is_zipfile(path):
        raise _NoRecording(f'{path} is no recording: it is no file of NumPy arrays (.npz)')
    try:
        with path.open('rb') as opened, np.load(opened) as file:
            metadata, times, kinds, texts = (
                file[name] for name in ('metadata', 'event_time', 'event_kind', 'event_text')
            )
            step = _step(len(file['time']), max_rows)
            columns = {
                name: file[name] if name.startswith('planned_') else file[name][::step]
                for name in _COLUMNS
                if name in file or name not in disk.ADDED_COLUMNS
            }
    except KeyError as error:
        missing = str(error.args[0]).split()[0]
        raise _NoRecording(
            f'{path} is no recording of the driver: it has no array {missing!r}'
        ) from None
    events = [
        (float(time), str(kind), str(text))
        for time, kind, text in zip(times, kinds, texts, strict=True)
    ]
    return Recording(metadata=json.loads(metadata.item()), events=events, **_complete(columns))


def _from_folder(path: Path, max_rows: int) -> Recording:
    if not (path / disk.EXECUTED_FILE).exists():
        raise _NoRecording(f'{path} is a folder, but no recording; name one in it')
    rows, plan = (
        np.load(path / name, mmap_mode='r') for name in (disk.EXECUTED_FILE, disk.PLANNED_FILE)
    )
    metadata = json.loads((path / disk.METADATA_FILE).read_text(encoding='utf-8'))
    step = _step(len(rows), max_rows)
    columns = {name: np.array(rows[name][::step]) for name in rows.dtype.names or ()}
    columns |= {f'planned_{name}': np.array(plan[name]) for name in disk.PLANNED_DTYPE.names or ()}
    return Recording(
        metadata=metadata,
        events=disk.merge_events(disk.read_events(path), rows),
        **_complete(columns),
    )


def _complete(columns: dict[str, NDArray[Any]]) -> dict[str, NDArray[Any]]:
    """Return all columns, filling in the ones that an older recording lacks."""
    unknown = {
        name: np.full((len(columns['time']), *kind.shape), disk.ADDED_COLUMNS[name], kind.base)
        for name in disk.ADDED_COLUMNS
        for kind in (disk.EXECUTED_DTYPE[name],)
    }
    return unknown | columns


def _step(rows: int, max_rows: int) -> int:
    return max(1, -(-rows // max_rows)) if max_rows else 1


_COLUMNS = tuple(f.name for f in fields(Recording) if f.name not in ('metadata', 'events'))
_PLANNED_COLUMNS = tuple(name for name in _COLUMNS if name.startswith('planned_'))
_EXECUTED_COLUMNS = tuple(name for name in _COLUMNS if not name.startswith('planned_'))
