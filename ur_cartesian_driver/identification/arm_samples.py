# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""A recording of an arm, as the estimators read it, and how it is read from files."""

from __future__ import annotations

from dataclasses import dataclass
import gzip
from pathlib import Path
import re
from typing import IO
import warnings
import zlib

import numpy as np

from ur_cartesian_driver.driver.recordings.recording import Recording
from ur_cartesian_driver.motion.geometry.arrays import Floats
from ur_cartesian_driver.motion.geometry.rotation_rows import exp_rows

#: Recordings with fewer packets are refused.
MIN_ROWS = 50


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ArmSamples:
    """
    Packets of a robot in the order of their time; a column that was not recorded is None.

    :param name: of the file.
    :param time: (n,) the controller's clock [s], strictly growing.
    :param target_q: (n, 6) target joint positions [rad].
    :param actual_q: (n, 6) measured joint positions [rad].
    :param target_pose: (n, 7) target TCP in the base: x y z [m], unit quaternion x y z w.
    :param runtime_state: (n,) see :class:`~...motion.state.rtde_state.RuntimeState`.
    :param safety_mode: (n,) see :class:`~...motion.state.rtde_state.SafetyMode`.
    :param slider: (n,) speed slider, 0 to 1.
    """

    name: str
    time: Floats
    target_q: Floats
    actual_q: Floats | None = None
    target_pose: Floats | None = None
    runtime_state: Floats | None = None
    safety_mode: Floats | None = None
    slider: Floats | None = None

    @property
    def cycle(self) -> float:
        """Time from one packet to the next where none is missing [s]."""
        return float(np.median(np.diff(self.time)))


def read_samples(path: Path) -> ArmSamples:
    """
    Read a recording: ours (``.npz``, ``.part``), or rows of text with a title for each column.

    Titles are names of RTDE with the index of the element, such as ``target_q_0`` (the
    manufacturer's recorder), or those of ``ur-cartesian export``.

    :raises ValueError: what is wrong with the file, in a sentence.
    :raises OSError: the file does not exist, or cannot be read.
    """
    if path.is_dir() or path.suffix == '.npz':
        return _checked(_from_recording(path), path)
    try:
        with (
            gzip.open(path, 'rt', encoding='utf-8-sig')
            if path.suffix == '.gz'
            else path.open(encoding='utf-8-sig') as file
        ):
            return _checked(_from_text(file, path), path)
    except (gzip.BadGzipFile, EOFError, zlib.error):
        raise ValueError(f'{path} is damaged: unpacking it fails; copy it again') from None
    except UnicodeDecodeError:
        raise ValueError(f'{path} is no recording: it is neither ours nor text') from None


def _from_recording(path: Path) -> ArmSamples:
    recording = Recording.load(path)
    return ArmSamples(
        name=path.name,
        time=recording.time,
        target_q=recording.target_q,
        actual_q=recording.actual_q,
        target_pose=recording.target_pose,
        runtime_state=recording.runtime_state.astype(np.float64),
        safety_mode=recording.safety_mode.astype(np.float64),
        slider=recording.slider,
    )


def _from_text(file: IO[str], path: Path) -> ArmSamples:
    line = file.readline(100_000)
    if not line.strip():
        raise ValueError(f'{path} is empty')
    delimiter = next((sign for sign in ',;\t' if sign in line), None)
    names = [_plain_name(title) for title in line.strip().split(delimiter)]
    places = {name: i for i, name in enumerate(names)}
    groups = _wanted_columns(places, path)
    wanted = [name for group in groups.values() for name in group]
    try:
        # numpy warns if there are no rows; _checked refuses them.
        with warnings.catch_warnings(action='ignore', category=UserWarning):
            rows = np.loadtxt(
                file, delimiter=delimiter, usecols=[places[name] for name in wanted], ndmin=2
            )
    except ValueError as error:
        text = str(error).partition(';')[0].rstrip('.')
        raise ValueError(f'{path} is damaged below its titles: {text}') from None
    columns, first = {}, 0
    for group, members in groups.items():
        columns[group] = rows[:, first : first + len(members)]
        first += len(members)
    pose = columns.get('target_pose')
    if pose is not None and pose.shape[1] == 6:
        pose = np.concatenate([pose[:, :3], exp_rows(pose[:, 3:])], axis=1)
    single = {name: columns[name][:, 0] for name in _SINGLE if name in columns}
    return ArmSamples(
        name=path.name,
        time=columns['time'][:, 0],
        target_q=columns['target_q'],
        actual_q=columns.get('actual_q'),
        target_pose=pose,
        **single,
    )


_SINGLE = ('runtime_state', 'safety_mode', 'slider')
#: Titles of the columns of each field, the preferred ones first; a file has all of one form.
_FORMS: dict[str, tuple[tuple[str, ...], ...]] = {
    'time': (('timestamp',), ('time',)),
    'target_q': (tuple(f'target_q_{i}' for i in range(6)),),
    'actual_q': (tuple(f'actual_q_{i}' for i in range(6)),),
    'target_pose': (
        tuple(f'target_TCP_pose_{i}' for i in range(6)),
        tuple(f'target_pose_{part}' for part in ('x', 'y', 'z', 'qx', 'qy', 'qz', 'qw')),
    ),
    'runtime_state': (('runtime_state',),),
    'safety_mode': (('safety_mode',),),
    'slider': (('target_speed_fraction',), ('slider',)),
}


def _plain_name(title: str) -> str:
    """Return a title without its unit."""
    return re.sub(r'\s*\[[^]]*\]$', '', title.strip().strip('"'))


def _wanted_columns(places: dict[str, int], path: Path) -> dict[str, tuple[str, ...]]:
    found = {
        group: form
        for group, forms in _FORMS.items()
        for form in reversed(forms)
        if all(name in places for name in form)
    }
    for group in ('time', 'target_q'):
        if group not in found:
            form = _FORMS[group][0]
            missing = next(name for name in form if name not in places)
            raise ValueError(
                f'{path} has no column {missing}: record the RTDE outputs timestamp, target_q, '
                'actual_q, target_TCP_pose, runtime_state and safety_mode'
            )
    return found


def _checked(samples: ArmSamples, path: Path) -> ArmSamples:
    """Refuse damaged recordings; leave out packets that were written twice."""
    time = samples.time
    if len(time) < MIN_ROWS:
        raise ValueError(f'{path} is too short: it has {len(time)} packets, {MIN_ROWS} are needed')
    columns: dict[str, Floats | None] = {name: getattr(samples, name) for name in _FORMS}
    for name, values in columns.items():
        columns[name] = _checked_column(name, values, path)
    back = np.flatnonzero(np.diff(time) < 0.0)
    if len(back):
        row = int(back[0])
        raise ValueError(
            f'{path} is mixed up: time goes back from {time[row]:.3f} s to {time[row + 1]:.3f} s '
            f'at packet {row + 2}; give each recording a file of its own'
        )
    new = np.concatenate([[True], np.diff(time) > 0.0])
    if new.sum() < MIN_ROWS:
        raise ValueError(f'{path} is damaged: its time stands still')
    kept = {name: values[new] for name, values in columns.items() if values is not None}
    return ArmSamples(name=samples.name, **kept)


def _checked_column(name: str, values: Floats | None, path: Path) -> Floats | None:
    """Return a column; None if the robot did not report it. A column with holes is damaged."""
    if values is None or np.isfinite(values).all():
        return values
    if name not in ('time', 'target_q') and np.isnan(values).all():
        return None
    packet = int(np.flatnonzero(~np.isfinite(values.reshape(len(values), -1)).all(axis=1))[0])
    raise ValueError(
        f'{path} is damaged: packet {packet + 1} has no number in {name}; remove that packet, or '
        'record again'
    )
