# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Our own recordings (doc/recordings.md): the measured path of the tool, freedriven perhaps."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ur_cartesian_driver.driver.recordings.recording import Recording
from ur_cartesian_driver.importing.import_format import ImportFormat, term_table
from ur_cartesian_driver.importing.import_options import ImportOptions
from ur_cartesian_driver.importing.imported_path import BrokenFile, PathCollector
from ur_cartesian_driver.kinematics.robot_models import JOINT_NAMES
from ur_cartesian_driver.motion.goal import IOCommand, OutputKind, Posture, SegmentType

#: Of the bits of a recording.
_OUTPUTS = (
    *((OutputKind.STANDARD_DIGITAL, pin) for pin in range(8)),
    *((OutputKind.CONFIGURABLE_DIGITAL, pin) for pin in range(8)),
    *((OutputKind.TOOL_DIGITAL, pin) for pin in range(2)),
)


def collect_recording(file: Path, options: ImportOptions, into: PathCollector) -> None:
    """
    Read a recording; its lines are packets, counted from 1.

    The arm first goes to the beginning by a joint motion, in the posture of the recording.

    :raises BrokenFile: it is no recording, or a damaged one.
    """
    try:
        recording = Recording.load(str(file))
    except ValueError as error:
        raise BrokenFile(0, str(error).removeprefix(f'{file} ').rstrip('.')) from None
    _check_packets(recording)
    bits = recording.digital_output
    changes = {
        int(i) + 1: int(bits[i] ^ bits[i + 1])
        for i in np.flatnonzero(bits[1:] != bits[:-1])
        if bits[i] >= 0 and bits[i + 1] >= 0
    }
    # A packet in which nothing moves is no point.
    first = (
        Posture(names=JOINT_NAMES, values=tuple(recording.actual_q[0].tolist()))
        if len(recording.time)
        else None
    )
    for row, (time, pose) in enumerate(
        zip(recording.time.tolist(), recording.actual_pose.tolist(), strict=True)
    ):
        into.add(
            row + 1,
            pose[:3],
            SegmentType.LINEAR if row else SegmentType.JOINT,
            quaternion=pose[3:],
            posture=None if row else first,
            time=time,
        )
        for bit, (kind, pin) in enumerate(_OUTPUTS):
            if changes.get(row, 0) >> bit & 1:
                value = float(int(bits[row]) >> bit & 1)
                into.switch(IOCommand(waypoint=0, offset=0.0, output=kind, pin=pin, value=value))


def _check_packets(recording: Recording) -> None:
    """Refuse the first packet that no robot has sent."""
    poses, times = recording.actual_pose, recording.time
    if poses.shape != (len(times), 7):
        raise BrokenFile(0, f'the poses are an array of {poses.shape}, not of seven columns')
    for wrong, why in (
        (~np.isfinite(np.column_stack((poses, times))).all(axis=1), 'a number is missing'),
        (
            np.abs(np.linalg.norm(poses[:, 3:], axis=1) - 1.0) > 1e-3,
            'its quaternion is none',
        ),
        (np.diff(times, prepend=-np.inf) < 0.0, 'it is earlier than the packet before'),
    ):
        if wrong.any():
            raise BrokenFile(int(np.argmax(wrong)) + 1, why, 'packet')


FORMAT = ImportFormat(
    name='recording',
    suffixes=('.npz', '.part'),
    terms=term_table(),
    others='Every other stream of a recording is left out.',
    collect=collect_recording,
)
