# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The folder into which a running motion is recorded, and the quota of all recordings.

All functions here may wait for the disk, so the robot loop itself calls none of them.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from datetime import datetime
import fcntl
import json
from pathlib import Path
import re
import shutil
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ur_cartesian_driver.driver.recordings import recording_format as disk
from ur_cartesian_driver.motion.geometry.arrays import Floats
from ur_cartesian_driver.motion.plan.joint_spline import SAME_TIME

#: Matches the names of recordings; other files in the directory are left alone.
_RECORDING_NAME = re.compile(r'\d{8}-\d{6}-\d{3}_[a-z_]+_\d+_points(_\d+)?\.(npz|part)')


def recording_name(metadata: dict[str, Any]) -> str:
    """Return the name of a recording, made of time, mode and points; names sort by time."""
    begun = datetime.fromisoformat(metadata['created'])
    return (
        f'{begun:%Y%m%d-%H%M%S}-{begun.microsecond // 1000:03d}_'
        f'{metadata["execution"].lower()}_{metadata["points"]}_points'
    )


class RecordingFolder:
    """Writes the recording of one motion; after a failure, :meth:`run_guarded` does nothing."""

    def __init__(
        self,
        directory: Path,
        metadata: dict[str, Any],
        max_size: float,
        warn: Callable[[str], None],
    ) -> None:
        """
        Keep the settings; nothing is written before :meth:`open`.

        :param max_size: largest size of all recordings together [bytes]; a motion may use half
            of it.
        :param warn: called with a sentence when something is wrong.
        """
        self._directory, self._metadata = directory, metadata
        self._max_size, self._warn = max_size, warn
        self._is_broken = False
        #: Times of the samples that the last :meth:`write_plan` has written [s].
        self._last_times: Floats = np.empty(0)
        #: Number of rows lost because the disk was too slow.
        self.lost_rows = 0
        #: False once a piece of the plan was lost because the disk was too slow.
        self.is_plan_whole = True

    def open(self) -> None:
        """Make the folder and its files."""
        self._directory.mkdir(parents=True, exist_ok=True)
        self._path = _new(self._directory / f'{recording_name(self._metadata)}{disk.PART_SUFFIX}')
        self._rows = disk.GrowingArray(self._path / disk.EXECUTED_FILE, disk.EXECUTED_DTYPE)
        # The lock shows that this process writes the folder; the system releases the lock when
        # the process ends. The driver of another arm may hold the lock, but only for the moment
        # in which it checks whether the folder is in use.
        fcntl.flock(self._rows.file, fcntl.LOCK_EX)
        self._plan = disk.GrowingArray(self._path / disk.PLANNED_FILE, disk.PLANNED_DTYPE)
        self._events = open(self._path / disk.EVENTS_FILE, 'xb', buffering=0)  # noqa: SIM115  # open until close()
        self._write_metadata()

    def write_rows(self, rows: memoryview) -> None:
        """Append packets, up to half of the quota."""
        if self._metadata['trouble']:
            return
        if (self._rows.count + 1) * disk.EXECUTED_STRUCT.size > self._max_size / 2.0:
            self._metadata['trouble'] = (
                f'The recording of this motion stops after {self._rows.count} packets: it has '
                f'used half of record_max_size ({self._max_size / 1e6:g} MB).'
            )
            self._warn(self._metadata['trouble'])
            return
        self._rows.append(rows, len(rows) // disk.EXECUTED_STRUCT.size)

    def write_plan(self, rows: NDArray[np.void], since: float) -> None:
        """
        Append samples of the planned path, in place of all samples after ``since`` [s].

        Only samples of the previous call can be replaced, such as the ending of an open goal.
        """
        kept_samples = int(np.searchsorted(self._last_times, since + SAME_TIME, side='right'))
        rows = rows[np.searchsorted(rows['time'], since + SAME_TIME, side='right') :]
        self._plan.count -= len(self._last_times) - kept_samples
        self._plan.append(rows.tobytes(), len(rows))
        self._last_times = rows['time']

    def write_event(self, event: disk.Event) -> None:
        """Append an event."""
        time, kind, text = event
        self._events.write(json.dumps([time, kind, text[: disk.MAX_EVENT_TEXT]]).encode() + b'\n')

    def close(self, outcome: dict[str, Any]) -> None:
        """Write the outcome into the metadata; :meth:`finish` closes the files."""
        self._metadata.update(outcome=outcome, rows_left_out=self.lost_rows)
        if not (self.is_plan_whole or self._metadata['trouble']):
            self._metadata['trouble'] = (
                'Pieces of the plan are missing, because the disk was too slow.'
            )
            self._warn(self._metadata['trouble'])
        self._write_metadata()

    def finish(self, yield_cpu: Callable[[], None]) -> None:
        """
        Turn the folder into one file, then remove the oldest recordings beyond the quota.

        :param yield_cpu: called often, so that other threads can run.
        """
        disk.finish(self._path, yield_cpu)
        self._close_files()  # last: the lock marks the folder as ours
        enforce_quota(self._directory, self._max_size, yield_cpu)

    def abandon(self) -> None:
        """Close the files, and leave the folder as it is."""
        self._close_files()

    def run_guarded(self, work: Callable[[], None]) -> None:
        """Run one of the methods above, and warn if it fails."""
        if self._is_broken:
            return
        try:
            work()
        except (OSError, ValueError) as error:
            self._is_broken = True
            self._close_files()
            reason = getattr(error, 'strerror', None) or error
            self._warn(
                f'The recording of a motion failed: {reason} ({self._directory}); check '
                'record_directory.'
            )

    def _write_metadata(self) -> None:
        # The old file stays valid until the new one replaces it.
        written = self._path / f'{disk.METADATA_FILE}.new'
        written.write_text(json.dumps(self._metadata), encoding='utf-8')
        written.replace(self._path / disk.METADATA_FILE)

    def _close_files(self) -> None:
        for name in ('_rows', '_plan', '_events'):
            if hasattr(self, name):
                getattr(self, name).close()


def _new(path: Path) -> Path:
    """Make a folder; if its name is taken, for example by another arm, add a number."""
    for number in range(1, 100):
        found = path if number == 1 else path.with_stem(f'{path.stem}_{number}')
        if found.with_suffix('.npz').exists():
            continue
        with suppress(FileExistsError):
            found.mkdir()
            return found
    raise FileExistsError(f'there are too many recordings named {path.stem} already')


# ---- existing recordings ------------------------------------------------------------------


def enforce_quota(
    directory: Path, max_size: float, yield_cpu: Callable[[], None] = lambda: None
) -> None:
    """
    Finish the folders of killed processes, then remove the oldest recordings.

    Folders that cannot be finished count as recordings, too.

    :param max_size: largest size of all recordings together [bytes].
    :param yield_cpu: called often, so that other threads can run.
    """
    for path in _unused_recordings(directory):
        if path.suffix == disk.PART_SUFFIX:
            with suppress(OSError, ValueError):
                disk.finish(path, yield_cpu)
    sizes = {path: _size(path) for path in _unused_recordings(directory)}
    excess = sum(sizes.values()) - max_size
    for path, size in sizes.items():
        if excess <= 0.0:
            break
        excess -= size
        if path.is_dir():
            shutil.rmtree(path, ignore_errors=True)
        else:
            path.unlink(missing_ok=True)


def newest_recording(path: Path) -> Path:
    """
    Return the path of a recording; for a directory, the newest one in it.

    Files and folders that do not have the name of a recording, such as renamed ones, are left out;
    folders of unfinished recordings count only if there is no file.

    :raises OSError: the directory contains no recording.
    """
    if not path.is_dir() or path.suffix == disk.PART_SUFFIX:
        return path
    found = _recordings(path)
    files = [each for each in found if each.suffix != disk.PART_SUFFIX]
    if not found:
        raise OSError(
            f'there is no recording in {path}; see the parameter record_directory, and name a '
            'file that was renamed'
        )
    return (files or found)[-1]


def _recordings(directory: Path) -> list[Path]:
    """Return all recordings of a directory, the oldest first."""
    return sorted(p for p in directory.iterdir() if _RECORDING_NAME.fullmatch(p.name))


def _unused_recordings(directory: Path) -> list[Path]:
    """Return the recordings that no process writes, the oldest first."""
    return [
        path
        for path in _recordings(directory)
        if path.suffix != disk.PART_SUFFIX or not _is_written(path)
    ]


def _size(recording: Path) -> int:
    try:
        files = recording.iterdir() if recording.is_dir() else [recording]
        return sum(file.stat().st_size for file in files)
    except FileNotFoundError:  # another arm's process has finished or removed it
        return 0


def _is_written(folder: Path) -> bool:
    """Return whether a process writes the folder; True if the lock cannot be checked."""
    try:
        with open(folder / disk.EXECUTED_FILE, 'rb') as rows:
            fcntl.flock(rows, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except OSError:
        return True
    return False
