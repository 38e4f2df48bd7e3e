# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The driver's recordings (doc/recordings.md): the measured path of a motion or a freedrive."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from ur_cartesian_driver.driver.recordings.recording import Recording
from ur_cartesian_driver.importing.import_format import (
    honoured,
    ImportFormat,
    left_out,
    term_table,
    Treatment,
)
from ur_cartesian_driver.importing.import_options import ImportOptions
from ur_cartesian_driver.importing.imported_path import BrokenFile, ImportNotes, PathCollector
from ur_cartesian_driver.kinematics.robot_models import JOINT_NAMES
from ur_cartesian_driver.motion.goal.goal import IOCommand, OutputKind, Posture, SegmentType

#: The output of each bit in a recording's digital outputs, from bit 0.
_OUTPUTS = (
    *((OutputKind.STANDARD_DIGITAL, pin) for pin in range(8)),
    *((OutputKind.CONFIGURABLE_DIGITAL, pin) for pin in range(8)),
    *((OutputKind.TOOL_DIGITAL, pin) for pin in range(2)),
)
#: Larger numbers cannot be a pose, an angle or a time of a recording.
_MAX_NUMBER = 1e9

TERMS = term_table(
    honoured('path', 'time', 'actual_pose'),
    left_out('path', 'the measured path is taken', 'target_pose', 'planned_pose'),
    left_out(
        'path',
        'a path has poses and times',
        *('actual_twist', 'target_twist', 'planned_time', 'planned_point', 'waypoint'),
        'points_begun',
    ),
    honoured('joints: the posture at the beginning', 'actual_q'),
    left_out(
        'joints: the posture at the beginning',
        'they follow from the path',
        *('target_q', 'actual_qd', 'target_qd'),
    ),
    honoured('outputs', 'digital_output'),
    left_out('outputs', 'they are not switched', 'analog_output', 'pulse_counts'),
    left_out(
        'state of the robot',
        'a goal has no such quantity',
        *('wrench', 'lag', 'buffered', 'speed_scaling', 'slider', 'robot_mode', 'safety_mode'),
        *('runtime_state', 'metadata', 'event_time', 'event_kind', 'event_text'),
    ),
)


def collect_recording(file: Path, options: ImportOptions, into: PathCollector) -> None:
    """
    Read a recording; the numbers of its packets (from 1) take the place of lines.

    The goal begins with a joint motion to the first point, in the posture of the recording.

    :raises BrokenFile: the file is no recording, or is damaged.
    """
    try:
        recording = Recording.load(str(file))
    except ValueError as error:
        # The messages of the libraries differ between versions.
        why = str(error).removeprefix(str(file)).strip(' .')
        why = why if error.__cause__ is None else 'is damaged: its arrays cannot be read'
        raise BrokenFile(0, f'the file {why}') from None
    _check_packets(recording)
    _say_others(into.remarks)
    bits = recording.digital_output
    changes = {
        int(i) + 1: int(bits[i] ^ bits[i + 1])
        for i in np.flatnonzero(bits[1:] != bits[:-1])
        if bits[i] >= 0 and bits[i + 1] >= 0
    }
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
            time=time - recording.time[0],
        )
        for bit, (kind, pin) in enumerate(_OUTPUTS):
            if changes.get(row, 0) >> bit & 1:
                value = float(int(bits[row]) >> bit & 1)
                into.switch(IOCommand(waypoint=0, offset=0.0, output=kind, pin=pin, value=value))


def _say_others(remarks: ImportNotes) -> None:
    """Add remarks on the arrays that are left out."""
    by_reason: dict[str, list[str]] = {}
    for term in TERMS.values():
        if term.treatment is Treatment.LEFT_OUT:
            by_reason.setdefault(term.reason, []).append(term.name)
    for reason, names in by_reason.items():
        remarks.add(0, ', '.join(names), reason)


def _check_packets(recording: Recording) -> None:
    """Refuse a recording with a packet that no robot can have sent."""
    poses, times = recording.actual_pose, recording.time
    if poses.shape != (len(times), 7):
        raise BrokenFile(0, f'the poses are an array of {poses.shape}, not of seven columns')
    numbers = np.column_stack((poses, times, recording.actual_q))
    _refuse_first(
        ~(np.abs(numbers) < _MAX_NUMBER).all(axis=1), 'a number is missing, or far too large'
    )
    lengths = np.linalg.norm(poses[:, 3:], axis=1)
    _refuse_first(np.abs(lengths - 1.0) > 1e-3, 'its quaternion is none')
    _refuse_first(np.diff(times, prepend=-np.inf) < 0.0, 'it is earlier than the packet before')


def _refuse_first(wrong: ArrayLike, why: str) -> None:
    """Refuse the recording if packets are wrong, and name the first of them."""
    for row in np.flatnonzero(wrong)[:1]:
        raise BrokenFile(int(row) + 1, why, 'packet')


FORMAT = ImportFormat(
    terms=TERMS,
    others='A file of other arrays is no recording, and refused.',
    collect=collect_recording,
)
