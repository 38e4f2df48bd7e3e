# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Read the arguments of commands: one function for each kind, for ``type=`` of argparse."""

from __future__ import annotations

import argparse
from contextlib import suppress
from os.path import samefile
from typing import TYPE_CHECKING

import numpy as np

from ur_cartesian_driver.kinematics.robot_models import MAX_JOINT_VALUE
from ur_cartesian_driver.motion.geometry.pose import Pose
from ur_cartesian_driver.motion.twin.twin import checked_day, checked_software
from ur_cartesian_driver.robot.services.service_calls import MAX_TOOL_OFFSET
from ur_cartesian_driver.sim.command_line.simulator_options import parsed, six_numbers

if TYPE_CHECKING:
    from ur_cartesian_driver.importing import CodeOutput

#: Largest value of options that are times [s].
MAX_SECONDS = 86400.0
#: Largest offset of a goal [m], [rad].
MAX_OFFSET = 50.0
#: Largest number of variants in a grid; more must be a mistake.
MAX_VARIANTS = 100_000


def length(text: str) -> float:
    """Return the length [m] that a text gives with a unit, for example ``1mm``."""
    from ur_cartesian_driver.importing import parse_length

    return parsed(parse_length, text)


def resume_length(text: str) -> float:
    """Return a length [m] by which a goal is resumed before its stop, or approached."""
    from ur_cartesian_driver.path.resumption import MAX_RESUME_LENGTH

    number = length(text)
    if number > MAX_RESUME_LENGTH:
        raise argparse.ArgumentTypeError(f'{text} is not within 0 and {MAX_RESUME_LENGTH:g} m')
    return number


def code_output(text: str) -> tuple[str, CodeOutput]:
    """Return a code of a G-code file, and the output that it sets."""
    from ur_cartesian_driver.importing import parse_code_output

    return parsed(parse_code_output, text)


def day(text: str) -> str:
    """Return a date, YYYY-MM-DD."""
    return parsed(checked_day, text)


def software(text: str) -> str:
    """Return a version of the controller's software."""
    return parsed(checked_software, text)


def pose(text: str) -> Pose:
    """Return the pose of six numbers [m], [rad]."""
    return Pose.from_rotation_vector(six_numbers(text, (MAX_TOOL_OFFSET, MAX_JOINT_VALUE)))


def box(text: str) -> tuple[float, ...]:
    """Return the least and greatest coordinates of a box [m]."""
    return six_numbers(text, (MAX_OFFSET, MAX_OFFSET))


def experiments(text: str) -> tuple[str, ...]:
    """Return the names of experiments, separated by commas."""
    from ur_cartesian_driver.identification.law_experiments import LAW_EXPERIMENTS

    known = [each.name for each in LAW_EXPERIMENTS]
    for name in text.split(','):
        if name not in known:
            raise argparse.ArgumentTypeError(f'{name!r} is none of {", ".join(known)}')
    return tuple(text.split(','))


def offsets(text: str) -> tuple[float, ...]:
    """Return the equally spaced numbers of a text like ``-0.1,0.1,5`` (FROM,TO,COUNT)."""
    try:
        first, last, number = text.split(',')
        numbers = np.linspace(float(first), float(last), count(number)).round(9).tolist()
    except ValueError:
        raise argparse.ArgumentTypeError(f'{text!r} is not FROM,TO,COUNT') from None
    if not numbers or not all(abs(offset) <= MAX_OFFSET for offset in numbers):  # or NaN
        raise argparse.ArgumentTypeError(f'{text!r} is not within {MAX_OFFSET:g}, or has no count')
    return tuple(numbers)


def count(text: str) -> int:
    """Return a number of things, such as variants of a sweep."""
    number = int(text)
    if not 0 <= number <= MAX_VARIANTS:
        raise argparse.ArgumentTypeError(f'{text} is not within 0 and {MAX_VARIANTS}')
    return number


def point_index(text: str) -> int:
    """Return the index of a point, any number that fits into uint32."""
    number = int(text)
    if not 0 <= number < 2**32:
        raise argparse.ArgumentTypeError(f'{text} is not an index from 0')
    return number


def factor(text: str) -> float:
    """Return a number above 0."""
    number = float(text)
    if not 0.0 < number <= 1e6:  # or NaN
        raise argparse.ArgumentTypeError(f'{text} is not above 0')
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


def is_same_file(one: str | None, other: str | None) -> bool:
    """Return whether two options name one file that exists."""
    with suppress(OSError):
        return bool(one and other) and samefile(str(one), str(other))
    return False
