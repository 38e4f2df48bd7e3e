# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Read the arguments of commands: one function for each kind, for ``type=`` of argparse.

Most refuse an argument by :exc:`argparse.ArgumentTypeError`, whose text argparse prints.
"""

from __future__ import annotations

import argparse
from contextlib import suppress
import os
from os.path import samefile
from pathlib import Path
import re
from typing import TYPE_CHECKING

import numpy as np

from ur_cartesian_driver.kinematics.robot_models import MAX_JOINT_VALUE
from ur_cartesian_driver.motion.geometry.pose import Pose
from ur_cartesian_driver.motion.geometry.vectors import Vector3
from ur_cartesian_driver.motion.twin.twin import checked_day, checked_software
from ur_cartesian_driver.robot.services.service_calls import MAX_TOOL_OFFSET
from ur_cartesian_driver.sim.command_line.simulator_options import (
    check_magnitude,
    parsed,
    six_numbers,
)

if TYPE_CHECKING:
    from ur_cartesian_driver.importing import CodeOutput

#: Largest value of options that are times [s].
MAX_SECONDS = 86400.0
#: Largest offset of a goal [m], [rad].
MAX_OFFSET = 50.0
#: Largest factor or speed; more must be a mistake.
MAX_FACTOR = 1e6
#: Name of a node, with its namespace if it has one.
_NODE_NAME = re.compile(r'/?[A-Za-z_]\w*(/[A-Za-z_]\w*)*/?', re.ASCII)
#: Largest number of variants in a grid; more must be a mistake.
MAX_VARIANTS = 100_000


def length(text: str) -> float:
    """Return the length [m] that a text gives with a unit, for example ``1mm``."""
    from ur_cartesian_driver.importing import parse_length

    return parsed(parse_length, text)


def resume_length(text: str) -> float:
    """Return the overlap or the approach length of a resumed goal [m]."""
    from ur_cartesian_driver.path.resumption import MAX_RESUME_LENGTH

    number = length(text)
    if number > MAX_RESUME_LENGTH:
        raise argparse.ArgumentTypeError(f'{text} is not within 0 and {MAX_RESUME_LENGTH:g} m')
    return number


def code_output(text: str) -> tuple[str, CodeOutput]:
    """Return a code of a G-code file, and the output that it sets."""
    from ur_cartesian_driver.importing import parse_code_output

    return parsed(parse_code_output, text)


class OutputFile(str):
    """The name of a file that a command writes."""


def output_file(text: str) -> OutputFile:
    """Return the name of a file; before the work begins, refuse one that cannot be written."""
    try:
        check_writable(text)
    except OSError as error:
        raise argparse.ArgumentTypeError(str(error)) from None
    return OutputFile(text)


def check_outputs(arguments: argparse.Namespace) -> None:
    """
    Refuse to write over the file that a command reads.

    :raises ValueError: an output is this file, perhaps by another name.
    """
    read = getattr(arguments, 'file', None)
    for written in vars(arguments).values():
        if isinstance(written, OutputFile) and _is_same_file(written, read):
            raise ValueError(
                f'{written} would be written over the file that is read; name another one'
            )


def check_writable(name: str) -> None:
    """
    Refuse the name of a file that cannot be written, and change nothing on the disk.

    :raises OSError: it is a folder, its folder does not exist, or the permission is missing.
    """
    file = Path(name)
    try:
        written = file if file.exists() else file.parent
    except OSError as error:  # such as a name that is too long
        raise OSError(f'{name} cannot be written: {error.strerror}') from None
    if file.is_dir():
        raise OSError(f'{name!r} is a folder; name a file')
    if not file.parent.is_dir():
        raise OSError(f'{name} cannot be written: there is no folder {file.parent}')
    if not os.access(written, os.W_OK):
        raise OSError(f'{name} cannot be written: no permission to write {written}')


def picture_file(text: str) -> OutputFile:
    """Return the name of a picture; before the work begins, refuse one that cannot be written."""
    from ur_cartesian_driver.preview.pictures import check_suffix

    try:
        check_suffix(Path(text))
    except (OSError, ValueError) as error:
        raise argparse.ArgumentTypeError(str(error)) from None
    return output_file(text)


def node_name(text: str) -> str:
    """Return the name of a node, with its namespace if it has one."""
    if not _NODE_NAME.fullmatch(text):
        raise argparse.ArgumentTypeError(
            f'{text!r} is no name of a node; write NODE or NAMESPACE/NODE, each of letters, '
            'digits and _, without a digit in front'
        )
    return text


def day(text: str) -> str:
    """Return a date, YYYY-MM-DD."""
    return parsed(checked_day, text)


def software(text: str) -> str:
    """Return a version of the controller's software."""
    return parsed(checked_software, text)


def pose(text: str) -> Pose:
    """Return the pose of six numbers [m], [rad]."""
    return Pose.from_rotation_vector(
        six_numbers(text, (MAX_TOOL_OFFSET, 'm'), (MAX_JOINT_VALUE, 'rad'))
    )


def box(text: str) -> tuple[float, ...]:
    """Return the least and greatest coordinates of a box [m]."""
    return six_numbers(text, (MAX_OFFSET, 'm'), (MAX_OFFSET, 'm'))


def place(text: str) -> Vector3:
    """Return the position that three numbers give [m]."""
    try:
        x, y, z = map(float, text.split(','))
    except ValueError:
        raise argparse.ArgumentTypeError(f'{text!r} is not X,Y,Z') from None
    for value in (x, y, z):
        check_magnitude(value, MAX_OFFSET, 'm')
    return x, y, z


def experiments(text: str) -> tuple[str, ...]:
    """Return the names of experiments, separated by commas."""
    from ur_cartesian_driver.identification.law_experiments import LAW_EXPERIMENTS

    known = [each.name for each in LAW_EXPERIMENTS]
    for name in text.split(','):
        if name not in known:
            raise argparse.ArgumentTypeError(f'{name!r} is none of {", ".join(known)}')
    return tuple(text.split(','))


def lengths(text: str) -> tuple[float, ...]:
    """Return equally spaced offsets [m]."""
    return _offsets(text, 'm')


def angles(text: str) -> tuple[float, ...]:
    """Return equally spaced offsets [rad]."""
    return _offsets(text, 'rad')


def _offsets(text: str, unit: str) -> tuple[float, ...]:
    """Return the equally spaced numbers of a text like ``-0.1,0.1,5`` (FROM,TO,COUNT)."""
    try:
        first, last, number = text.split(',')
        ends = float(first), float(last)
    except ValueError:
        raise argparse.ArgumentTypeError(f'{text!r} is not FROM,TO,COUNT') from None
    for end in ends:
        check_magnitude(end, MAX_OFFSET, unit)
    numbers = np.linspace(*ends, count(number)).round(9).tolist()
    if not numbers:
        raise argparse.ArgumentTypeError(f'{text!r} has the count 0; give 1 or more')
    return tuple(numbers)


def count(text: str) -> int:
    """Return a count, such as the number of variants of a sweep."""
    number = _whole(text)
    if not 0 <= number <= MAX_VARIANTS:
        raise argparse.ArgumentTypeError(f'{text} is not within 0 and {MAX_VARIANTS}')
    return number


def point_index(text: str) -> int:
    """Return the index of a point, 0 to 2**32 - 1."""
    number = _whole(text)
    if not 0 <= number < 2**32:
        raise argparse.ArgumentTypeError(f'{text} is not an index from 0')
    return number


def _whole(text: str) -> int:
    try:
        return int(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f'{text!r} is no whole number') from None


def factor(text: str) -> float:
    """Return a number above 0, such as a speed."""
    try:
        number = float(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f'{text!r} is no number') from None
    if not number > 0.0:  # or NaN
        raise argparse.ArgumentTypeError(f'{text} is not above 0')
    if number > MAX_FACTOR:
        raise argparse.ArgumentTypeError(f'{text} is above {MAX_FACTOR:.0f}')
    return number


def seconds(text: str) -> float:
    """Return a time [s]."""
    try:
        number = float(text)
    except ValueError as error:
        raise argparse.ArgumentTypeError(f'{error}; give seconds') from None
    if not 0.0 <= number <= MAX_SECONDS:  # or NaN
        raise argparse.ArgumentTypeError(f'{number:g} s is not within 0 and {MAX_SECONDS:g} s')
    return number


def _is_same_file(written: str, read: str | None) -> bool:
    """Return whether two arguments name one file that exists."""
    with suppress(OSError):
        return bool(written and read) and samefile(written, str(read))
    return False
