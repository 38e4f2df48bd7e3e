# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
A recording as comma-separated values: a row for each packet, with its deviation from the plan.

The titles are the names of the columns with their units, in the form that the driver's own import
of CSV files reads.
"""

from __future__ import annotations

import csv
from io import TextIOWrapper
from typing import Any, BinaryIO

from numpy.typing import NDArray

from ur_cartesian_driver.driver.recordings.export_options import ExportOptions
from ur_cartesian_driver.driver.recordings.recording import Recording
from ur_cartesian_driver.driver.recordings.recording_format import EXECUTED_DTYPE

_POSE = ('x [m]', 'y [m]', 'z [m]', 'qx', 'qy', 'qz', 'qw')
_TWIST = ('x [m/s]', 'y [m/s]', 'z [m/s]', 'rx [rad/s]', 'ry [rad/s]', 'rz [rad/s]')
_WRENCH = ('fx [N]', 'fy [N]', 'fz [N]', 'tx [Nm]', 'ty [Nm]', 'tz [Nm]')
#: The suffixes of the titles of a column with several numbers, by the last word of its name.
_PARTS = {
    'pose': _POSE,
    'twist': _TWIST,
    'wrench': _WRENCH,
    'q': tuple(f'{i} [rad]' for i in range(6)),
    'qd': tuple(f'{i} [rad/s]' for i in range(6)),
    'output': ('0', '1'),  # [A] or [V]
}
_SECONDS = ('time', 'lag', 'buffered')
#: Packets converted to Python numbers at a time; an hour of packets at once would take gigabytes.
_BLOCK = 4096


def write_csv(recording: Recording, file: BinaryIO, options: ExportOptions) -> None:
    """Write a title row and a row for each packet."""
    columns: dict[str, NDArray[Any]] = {}
    for name in EXECUTED_DTYPE.names or ():
        values = getattr(recording, name)
        if values.ndim > 1:
            parts = _PARTS[name.rpartition('_')[2]]
            columns |= {f'{name}_{part}': values[:, i] for i, part in enumerate(parts)}
        else:
            columns[f'{name} [s]' if name in _SECONDS else name] = values
    deviation = recording.deviation()
    columns |= {
        'deviation_position [m]': deviation.position,
        'deviation_angle [rad]': deviation.angle,
        'planned_time [s]': deviation.planned_time,
    }
    text = TextIOWrapper(file, encoding='utf-8', newline='')
    writer = csv.writer(text, lineterminator='\n')
    writer.writerow(columns)
    for begin in range(0, len(recording.time), _BLOCK):
        block = (column[begin : begin + _BLOCK].tolist() for column in columns.values())
        for row in zip(*block, strict=True):
            writer.writerow(row)
            options.progress()
    text.detach()  # else the file would be closed with the wrapper
