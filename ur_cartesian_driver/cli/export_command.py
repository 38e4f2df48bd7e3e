# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""``ur-cartesian export``: write a recorded motion for other programs."""

from __future__ import annotations

import argparse
import os
from pathlib import Path

from ur_cartesian_driver.cli.progress import counted
from ur_cartesian_driver.driver.recordings.export_options import Exporter, ExportOptions
from ur_cartesian_driver.driver.recordings.recording import Recording
from ur_cartesian_driver.driver.recordings.recording_folder import newest_recording
from ur_cartesian_driver.file_formats import FileFormats

#: The exporters, by suffix.
EXPORTERS: FileFormats[Exporter] = FileFormats(
    'ur_cartesian_driver.exporters',
    {
        'ur_cartesian_driver.driver.recordings.mcap_export:write_mcap': '.mcap',
        'ur_cartesian_driver.driver.recordings.csv_export:write_csv': '.csv',
    },
    refusals=(ValueError, OSError),
)


def export(arguments: argparse.Namespace) -> int:
    """
    Write a recording in the format of the output's suffix; leave no incomplete file.

    :raises ValueError: no exporter has this suffix, or a package that it needs is missing or
        broken.
    """
    source = newest_recording(Path(arguments.file))
    target = Path(arguments.output or source.with_suffix('.mcap'))
    suffix = target.suffix.lower()
    if suffix not in EXPORTERS:
        raise ValueError(
            f'{target} has the suffix {target.suffix!r}, but a recording is written as '
            f'{" or ".join(EXPORTERS.suffixes())}'
        )
    recording = Recording.load(source)
    count = len(recording.time)
    unfinished = target.with_name(f'{target.name}.unfinished')
    try:
        with (
            EXPORTERS.using(suffix) as write,
            counted('writing the packets', count) as progress,
            unfinished.open('wb') as file,
        ):
            write(recording, file, ExportOptions(tf_prefix=arguments.tf_prefix, progress=progress))
        os.replace(unfinished, target)
    except ImportError as error:
        raise ValueError(f'{target}: {error}') from None
    finally:
        unfinished.unlink(missing_ok=True)
    print(f'{count} packet{"s" * (count != 1)}: {target}')
    return 0
