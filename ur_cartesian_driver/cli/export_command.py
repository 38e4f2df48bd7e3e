# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""``ur-cartesian export``: write a recorded motion for other programs."""

from __future__ import annotations

import argparse
import os
from pathlib import Path

from ur_cartesian_driver.cli.progress import counted, timed
from ur_cartesian_driver.cli.recording_plot import newest_recording
from ur_cartesian_driver.driver.recordings.csv_export import write_csv
from ur_cartesian_driver.driver.recordings.mcap_export import write_mcap
from ur_cartesian_driver.driver.recordings.recording import Recording

_MCAP, _CSV = '.mcap', '.csv'


def export(arguments: argparse.Namespace) -> int:
    """Write a recording in the format of the suffix; a file that is not whole is never there."""
    source = newest_recording(Path(arguments.file))
    target = Path(arguments.output or source.with_suffix(_MCAP))
    suffix = target.suffix.lower()
    if suffix not in (_MCAP, _CSV):
        raise ValueError(
            f'{target} has the suffix {target.suffix!r}, but a recording is written as {_MCAP} or '
            f'{_CSV}'
        )
    recording = Recording.load(source)
    unfinished = target.with_name(f'{target.name}.unfinished')
    try:
        if suffix == _CSV:
            with timed('writing the table'), unfinished.open('w', encoding='utf-8') as table:
                write_csv(recording, table)
        else:
            with (
                counted('writing the packets', len(recording.time)) as progress,
                unfinished.open('wb') as file,
            ):
                write_mcap(recording, file, arguments.tf_prefix, progress)
        os.replace(unfinished, target)
    except ImportError as error:
        raise ValueError(f'{target}: {error}') from None
    finally:
        unfinished.unlink(missing_ok=True)
    count = len(recording.time)
    print(f'{count} packet{"s" * (count != 1)}: {target}')
    return 0
