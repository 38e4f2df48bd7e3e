# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The files that belong to the project, for tests that walk a folder.

Users write goals, pictures, recordings and programs of their own anywhere in a checkout. These
files do not belong to the project, so they are not tested.
"""

from functools import cache
from pathlib import Path
import subprocess


@cache
def tracked_files(folder: Path, pattern: str) -> tuple[Path, ...]:
    """
    Return the files in a folder that match a glob and that git tracks, sorted.

    If git tracks none, as in an installation or a source distribution, all matches are returned.
    """
    command = ['git', 'ls-files', '-z', '--', f':(glob){pattern}']
    try:
        listed = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
        names = listed.stdout.split('\0')[:-1]
    except FileNotFoundError:  # no git
        names = []
    tracked = (folder / name for name in names)
    return tuple(sorted(filter(Path.is_file, tracked)) or sorted(folder.glob(pattern)))
