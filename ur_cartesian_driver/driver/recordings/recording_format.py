# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The format of a recording on disk: columns and files.

While a motion runs there is a folder ``NAME.part``, whose files are valid at every moment: growing
``.npy`` files with the rows, and JSON lines with the events. So the files can be read even if the
process was killed. When the motion has ended, the folder becomes one file ``NAME.npz``, with an
array for each column. Memory does not grow with the length of the motion.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
import json
from os import replace as replace_file
from pathlib import Path
import shutil
import struct
from typing import Any, TypeAlias
import zipfile

import numpy as np
from numpy.typing import NDArray

from ur_cartesian_driver.motion.state.rtde_state import RobotMode, RuntimeState, SafetyMode

#: Version of the format; increased when a member of the file changes its meaning.
FORMAT = 1

#: One packet of the robot: names, shapes and order of the columns. Units and frames:
#: doc/recordings.md.
EXECUTED_DTYPE = np.dtype(
    [
        ('time', '<f8'),
        ('actual_pose', '<f8', 7),
        ('target_pose', '<f8', 7),
        ('actual_twist', '<f8', 6),
        ('target_twist', '<f8', 6),
        ('actual_q', '<f8', 6),
        ('target_q', '<f8', 6),
        ('actual_qd', '<f8', 6),
        ('target_qd', '<f8', 6),
        ('wrench', '<f8', 6),
        ('lag', '<f8'),
        ('buffered', '<f8'),
        ('speed_scaling', '<f8'),
        ('slider', '<f8'),
        ('analog_output', '<f8', 2),
        ('digital_output', '<i4'),
        ('pulse_counts', '<i4'),
        ('points_begun', '<i4'),
        ('waypoint', '<i4'),
        ('robot_mode', '<i4'),
        ('safety_mode', '<i4'),
        ('runtime_state', '<i4'),
    ]
)
#: The same columns for :mod:`struct`, which fills a row faster than numpy does.
EXECUTED_STRUCT = struct.Struct(
    '<'
    + ''.join(
        EXECUTED_DTYPE[name].base.char * (EXECUTED_DTYPE[name].shape or (1,))[0]
        for name in EXECUTED_DTYPE.names or ()
    )
)
#: Columns that older recordings lack, with the values read in their place.
ADDED_COLUMNS = {'wrench': np.nan, 'pulse_counts': 0}
#: One sample of the planned path.
PLANNED_DTYPE = np.dtype([('time', '<f8'), ('pose', '<f8', 7), ('point', '<i4')])

#: Suffix of the folder of an unfinished recording.
PART_SUFFIX = '.part'
#: Names of the files in a folder.
METADATA_FILE, EVENTS_FILE = 'metadata.json', 'events.jsonl'
EXECUTED_FILE, PLANNED_FILE = 'executed.npy', 'planned.npy'
#: Rows processed together, which holds the interpreter for 0.1 ms.
CHUNK = 512
#: Largest number of detected events kept. A path of a million points has a million events, but
#: the column ``waypoint`` shows them too.
MAX_EVENTS = 10_000
#: Largest number of characters in the text of an event; the metadata has the whole outcome.
MAX_EVENT_TEXT = 120

#: Time since the start [s], kind of event, and a few words.
Event: TypeAlias = tuple[float, str, str]

#: The names of the digital outputs, by bit.
OUTPUT_NAMES = (
    *(f'standard digital output {i}' for i in range(8)),
    *(f'configurable digital output {i}' for i in range(8)),
    *(f'tool digital output {i}' for i in range(2)),
)


class GrowingArray:
    """A ``.npy`` file to which rows are appended; it can be loaded at every moment."""

    def __init__(self, path: Path, dtype: np.dtype[Any]) -> None:
        """
        Make the file, with no rows.

        :raises OSError: the file cannot be written, or exists.
        """
        self._dtype = dtype
        self.count = 0
        # Unbuffered: closing the file must not retry a write that has failed.
        self.file = open(path, 'xb', buffering=0)  # noqa: SIM115  # open until close()
        self._write(_npy_header(dtype, (0,)))

    def append(self, rows: bytes | memoryview, count: int) -> None:
        """
        Append rows.

        The rows become part of the array only when all of them are written: a failed write changes
        nothing.

        :raises OSError: the file cannot be written, for example because the disk is full.
        """
        start = len(_npy_header(self._dtype, (self.count,)))
        self.file.seek(start + self.count * self._dtype.itemsize)
        self._write(rows)
        self.file.seek(0)
        self._write(_npy_header(self._dtype, (self.count + count,)))
        self.count += count

    def close(self) -> None:
        """Close the file."""
        self.file.close()

    def _write(self, data: bytes | memoryview) -> None:
        view = memoryview(data).cast('B')
        while len(view):
            view = view[self.file.write(view) :]


def _npy_header(dtype: np.dtype[Any], shape: tuple[int, ...]) -> bytes:
    """Return the head of a ``.npy`` file (version 1.0), of equal length for any number of rows."""
    sizes = ''.join(f'{size:>12},' for size in shape)
    descr = dtype.descr if dtype.names else dtype.str
    text = f"{{'descr': {descr!r}, 'fortran_order': False, 'shape': ({sizes}), }}"
    fill = -(10 + len(text) + 1) % 64
    body = text.encode('latin1') + b' ' * fill + b'\n'
    return b'\x93NUMPY\x01\x00' + struct.pack('<H', len(body)) + body


# ---- events ---------------------------------------------------------------------------------


def detect_events(
    rows: NDArray[np.void], yield_cpu: Callable[[], None] = lambda: None
) -> list[Event]:
    """
    Return the changes from packet to packet as events: points, outputs, slider, program, modes.

    :param rows: rows of the type :data:`EXECUTED_DTYPE`, which may be a memory-mapped file.
    :param yield_cpu: called often, so that other threads can run.
    """
    found: list[Event] = []
    for first in range(0, len(rows), CHUNK):
        part = rows[max(0, first - 1) : first + CHUNK]
        found += sorted(_changes(part), key=lambda event: event[0])
        yield_cpu()
        if len(found) > MAX_EVENTS:
            last = found[MAX_EVENTS - 1][0]
            return [
                *found[: MAX_EVENTS - 1],
                (last, 'more', 'more events follow, which the columns show'),
            ]
    return found


def _changes(part: NDArray[np.void]) -> Iterator[Event]:
    for name, describe in _EVENT_TEXTS.items():
        values = part[name]
        for i in np.flatnonzero(values[1:] != values[:-1]) + 1:
            for kind, text in describe(values[i - 1].item(), values[i].item()):
                yield float(part['time'][i]), kind, text
    analog = part['analog_output']
    for i, channel in np.argwhere(analog[1:] != analog[:-1]):
        if not np.isnan(analog[i, channel]):
            yield (
                float(part['time'][i + 1]),
                'output',
                f'standard analog output {channel}: {analog[i + 1, channel]:.4g}',
            )


def _outputs(before: int, now: int) -> Iterator[tuple[str, str]]:
    if before < 0 or now < 0:  # not known
        return
    for bit, name in enumerate(OUTPUT_NAMES):
        if (before ^ now) >> bit & 1:
            yield 'output', f'{name}: {"on" if now >> bit & 1 else "off"}'


def _waypoint(_: int, now: int) -> Iterator[tuple[str, str]]:
    if now >= 0:
        yield 'point', f'on the way to point {now}'


_EVENT_TEXTS: Mapping[str, Any] = {
    'waypoint': _waypoint,
    'digital_output': _outputs,
    'slider': lambda _, now: [('slider', f'speed slider at {100.0 * now:.0f} %')],
    'runtime_state': lambda _, now: [('program', f'robot program {RuntimeState(now).name}')],
    'robot_mode': lambda _, now: [('robot', f'robot mode {RobotMode(now).name}')],
    'safety_mode': lambda _, now: [('safety', f'safety mode {SafetyMode(now).name}')],
}


# ---- from the folder to the file ------------------------------------------------------------


def read_events(folder: Path) -> list[Event]:
    """Return the events of a folder, without an unfinished last line."""
    events = []
    for line in (folder / EVENTS_FILE).read_text(encoding='utf-8').split('\n')[:-1]:
        time, kind, text = json.loads(line)
        events.append((float(time), str(kind), str(text)))
    return events


def merge_events(
    events: Iterable[Event], rows: NDArray[np.void], yield_cpu: Callable[[], None] = lambda: None
) -> list[Event]:
    """Return events and detected changes in the order of time."""
    return sorted([*events, *detect_events(rows, yield_cpu)], key=lambda event: event[0])


def event_arrays(events: list[Event]) -> dict[str, NDArray[Any]]:
    """Return events as the arrays of a file ``NAME.npz``."""
    return {
        'event_time': np.array([time for time, _, _ in events], dtype='<f8'),
        'event_kind': np.array([kind for _, kind, _ in events], dtype='<U16'),
        'event_text': np.array([text for _, _, text in events], dtype=f'<U{MAX_EVENT_TEXT}'),
    }


def finish(folder: Path, yield_cpu: Callable[[], None] = lambda: None) -> Path:
    """
    Make one file out of a folder, and remove the folder.

    :param yield_cpu: called often, so that other threads can run.
    :returns: the file.
    :raises OSError: the file cannot be written; the folder stays as it was.
    """
    file = folder.with_suffix('.npz')
    unfinished = folder / file.name
    # Plain arrays: slices of a memmap are memmaps again, which are slow to make.
    rows, plan = (
        np.asarray(np.load(folder / name, mmap_mode='r')) for name in (EXECUTED_FILE, PLANNED_FILE)
    )
    try:
        with zipfile.ZipFile(unfinished, 'w', zipfile.ZIP_STORED) as archive:
            metadata = (folder / METADATA_FILE).read_text(encoding='utf-8')
            members = {
                'metadata': np.array(metadata),
                **event_arrays(merge_events(read_events(folder), rows, yield_cpu)),
            }
            for name, values in members.items():
                _write_member(archive, name, values.dtype, values.shape, [values])
            for prefix, table in (('', rows), ('planned_', plan)):
                for name in table.dtype.names or ():
                    _write_column(archive, prefix + name, table[name], yield_cpu)
    except OSError:
        unfinished.unlink(missing_ok=True)
        raise
    replace_file(unfinished, file)
    shutil.rmtree(folder, ignore_errors=True)
    return file


def _write_column(
    archive: zipfile.ZipFile, name: str, column: NDArray[Any], yield_cpu: Callable[[], None]
) -> None:
    """Write a column of a table, part by part."""

    def parts() -> Iterator[NDArray[Any]]:
        for first in range(0, len(column), CHUNK):
            yield column[first : first + CHUNK]
            yield_cpu()

    _write_member(archive, name, column.dtype, column.shape, parts())


def _write_member(
    archive: zipfile.ZipFile,
    name: str,
    dtype: np.dtype[Any],
    shape: tuple[int, ...],
    parts: Iterable[NDArray[Any]],
) -> None:
    with archive.open(f'{name}.npy', 'w', force_zip64=True) as raw:
        raw.write(_npy_header(dtype, shape))
        for part in parts:
            raw.write(part.tobytes())
