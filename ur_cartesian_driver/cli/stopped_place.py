# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Remembers where a goal was stopped, for ``ur-cartesian send --resume``.

The note for ``seam.yaml`` is the file ``seam.yaml.stopped`` in the same folder. It holds the place
on the path and a hash of ``seam.yaml``. If the goal is an example of the package, or its folder is
read-only, the note is in the working directory instead.
"""

from __future__ import annotations

from hashlib import sha256
import os
from pathlib import Path

import yaml

from ur_cartesian_driver.motion.events import PathPlace
from ur_cartesian_driver.resources import share_path

_SUFFIX = '.stopped'


def write_place(goal_file: Path, place: PathPlace | None, digest: str) -> Path | None:
    """
    Note the place where a goal was stopped.

    :param place: the place; None = nothing can be resumed, so an earlier note is removed.
    :param digest: the :func:`digest` of the file when the goal was sent.
    :returns: the written file; None if no file was written.
    :raises OSError: the file cannot be written.
    """
    file = _file(goal_file)
    if place is None:
        file.unlink(missing_ok=True)
        return None
    noted = {'point': place.point, 'fraction': place.fraction, 'goal': digest}
    file.write_text(yaml.safe_dump(noted, sort_keys=False), encoding='utf-8')
    return file


def read_place(goal_file: Path) -> PathPlace:
    """
    Return the place where a goal was stopped.

    :raises ValueError: no place is noted, or the goal file has changed since the stop.
    """
    file = _file(goal_file)
    try:
        noted = yaml.safe_load(file.read_text(encoding='utf-8'))
        place = PathPlace(point=int(noted['point']), fraction=float(noted['fraction']))
        goal = noted['goal']
    except FileNotFoundError:
        raise ValueError(
            f'{goal_file} cannot be resumed: {file} is missing; "send" writes it when a goal '
            'is stopped before its end'
        ) from None
    except (yaml.YAMLError, KeyError, TypeError, ValueError):
        raise ValueError(f'{file} does not say where a goal was stopped; remove it') from None
    if goal != digest(goal_file):
        raise ValueError(
            f'{goal_file} cannot be resumed: the file has changed since the goal was stopped; '
            f'make a goal of the remaining points, or remove {file}'
        )
    return place


def _file(goal_file: Path) -> Path:
    folder = goal_file.parent
    if folder == share_path() / 'config' / 'examples' or not os.access(folder, os.W_OK):
        folder = Path.cwd()
    return folder / (goal_file.name + _SUFFIX)


def digest(goal_file: Path) -> str:
    """Return the hash by which a goal file is recognised."""
    return sha256(goal_file.read_bytes()).hexdigest()
