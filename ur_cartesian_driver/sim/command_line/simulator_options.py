# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The options of the simulated controller; some of them belong to other commands, too."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from dataclasses import fields
from functools import partial
from pathlib import Path
import re
from typing import Any, TypeVar

from ur_cartesian_driver.kinematics.robot_models import MAX_JOINT_VALUE, MODELS
from ur_cartesian_driver.sim.faults.fault_parser import parse_fault
from ur_cartesian_driver.sim.faults.fault_values import Fault

T = TypeVar('T')

_NUMBERS = re.compile(r'-[\d.][-+\d.,eE]*')


def add_simulator_options(command: argparse.ArgumentParser) -> None:
    """Add all options of the simulator."""
    take_negative_numbers(command)
    add_model(command, '--model')
    command.set_defaults(model='')  # empty = the twin's model, or ur5e without a twin
    _add_network(command)
    _add_arm(command)
    _add_surroundings(command)
    _add_start(command)


def _add_network(command: argparse.ArgumentParser) -> None:
    command.add_argument('--host', default='127.0.0.1', help='address to listen on')
    command.add_argument(
        '--polyscope',
        default='',
        metavar='VERSION',
        help='software version, such as 5.21; empty = that of the twin, else the newest for the '
        'model',
    )
    add_ports(command, '0 = any free port', rtde=30004, primary=30001, dashboard=29999)
    ports = {'secondary': 30002, 'realtime': 30003, 'interpreter': 30020, 'robot_api': 8000}
    for name, port in ports.items():
        text = f'0 = any free port; by default {port} if the primary port is 30001, else any'
        add_ports(command, text, **{name: None})


def _add_arm(command: argparse.ArgumentParser) -> None:
    command.add_argument(
        '--twin',
        metavar='FILE',
        help='measured laws of motion of an arm (twin.yaml), by which this robot moves; model, '
        'software and motion version are those of that arm unless options give others',
    )
    command.add_argument(
        '--joints', type=joints, metavar='Q1,...,Q6', help='initial joint positions [rad]'
    )
    add_calibration(command)
    command.add_argument(
        '--imperfect',
        nargs='?',
        type=int,
        const=1,
        metavar='SEED',
        help='let the arm lag, ring and be measured with noise, and leave out RTDE packets, as '
        'recorded on real robots',
    )
    command.add_argument(
        '--motion-version',
        type=int,
        choices=(1, 2),
        help='how movej and movel run, as the installation sets it; 2 needs --polyscope 5.22',
    )
    command.add_argument(
        '--rate',
        type=float,
        default=1.0,
        help='speed of time; 2 = twice as fast, 0 = as fast as possible',
    )


def _add_surroundings(command: argparse.ArgumentParser) -> None:
    add = partial(command.add_argument, action='append', default=[], metavar='TEXT')
    add(
        '--fault',
        type=fault,
        dest='faults',
        help="fault, and when it happens: 'protective_stop at 2 s', 'drop rtde at 0.35 m'; may be "
        'given several times, see doc/simulation.md',
    )
    add(
        '--contact',
        dest='contacts',
        help="what the tool can touch, in the base [m]: 'plane x y z nx ny nz' or 'box x y z dx "
        "dy dz'; may be given several times, see doc/simulation.md",
    )
    add(
        '--input',
        dest='inputs',
        help="a digital input that is on: 'standard 3', 'configurable 0' or 'tool 1'; may be "
        'given several times',
    )
    add(
        '--answer',
        dest='answers',
        help='what the person at the pendant types when a program requests a value, such as yes '
        'or 3; may be given several times, in the order of the requests',
    )


def _add_start(command: argparse.ArgumentParser) -> None:
    command.add_argument('--power-off', action='store_true', help='start with the arm powered off')
    command.add_argument(
        '--local', action='store_true', help='local control: refuse scripts from the network'
    )
    command.add_argument(
        '--no-remote-control',
        action='store_true',
        help='the feature is off: take scripts, but report no remote control',
    )
    command.add_argument(
        '--program',
        type=Path,
        metavar='FILE',
        help='program that is loaded from the start: URScript (NAME.script is NAME.urp), a file '
        'of PolyScope 3 or 5 (NAME.urp) or of PolyScope X (NAME.urpx), or external_control.urp, '
        'which every robot has',
    )
    command.add_argument(
        '--programs',
        type=Path,
        metavar='DIR',
        help='directory of such files, which the dashboard and the Robot API can load',
    )
    command.add_argument(
        '--external-control-host',
        default='127.0.0.1',
        metavar='HOST',
        help='from where a node of External Control fetches its program when it is played',
    )
    add_ports(command, 'port of that host', external_control=50002)


def take_negative_numbers(command: argparse.ArgumentParser) -> None:
    """Accept values such as -1.5,2; argparse has no public option for a leading minus."""
    command._negative_number_matcher = _NUMBERS


def add_model(command: argparse.ArgumentParser, name: str = '--ur-type') -> None:
    """Add the option for the model of the robot."""
    command.add_argument(name, default='ur5e', choices=sorted(MODELS), help='model of the robot')


def add_ports(command: argparse.ArgumentParser, text: str, **ports: int | None) -> None:
    """Add the options --NAME-port for ports, given as name = default."""
    for name, port in ports.items():
        command.add_argument(
            f'--{name.replace("_", "-")}-port', type=port_number, default=port, help=text
        )


def add_calibration(command: argparse.ArgumentParser) -> None:
    """Add the options for the calibration of an arm."""
    calibration = command.add_mutually_exclusive_group()
    calibration.add_argument(
        '--calibration',
        metavar='FILE',
        help='kinematics of this arm, in the YAML of ur_calibration of the UR ROS driver',
    )
    calibration.add_argument(
        '--calibration-seed',
        type=int,
        metavar='N',
        help='seed of a random calibration',
    )


def fields_from(arguments: argparse.Namespace, kind: type[Any]) -> dict[str, Any]:
    """Return the arguments that are named like fields of a dataclass, by name."""
    given = vars(arguments)
    return {each.name: given[each.name] for each in fields(kind) if each.name in given}


# The kinds of arguments, for `type=` of argparse


def fault(text: str) -> Fault:
    """Return the fault that a text describes, with its trigger."""
    return parsed(parse_fault, text)


def joints(text: str) -> tuple[float, ...]:
    """Return six joint positions [rad], given with commas between them."""
    return six_numbers(text, (MAX_JOINT_VALUE, 'rad'), (MAX_JOINT_VALUE, 'rad'))


def port_number(text: str) -> int:
    """Return the number of a port; 0 = any free port."""
    if not text.isdecimal() or int(text) > 65535:
        raise argparse.ArgumentTypeError(f'{text} is no port; give 0 to 65535')
    return int(text)


def parsed(parse: Callable[[str], T], text: str) -> T:
    """Return the parsed text; if ``parse`` refuses the text, argparse prints the reason."""
    try:
        return parse(text)
    except ValueError as error:
        raise argparse.ArgumentTypeError(str(error)) from None


def six_numbers(text: str, *bounds: tuple[float, str]) -> tuple[float, ...]:
    """
    Return six numbers separated by commas.

    :param bounds: largest magnitude and unit of the first three numbers, and of the last three.
    """
    try:
        numbers = tuple(float(part) for part in text.split(','))
    except ValueError as error:
        raise argparse.ArgumentTypeError(f'{error}; give six numbers, with commas') from None
    if len(numbers) != 6:
        raise argparse.ArgumentTypeError(f'{len(numbers)} numbers; give six, separated by commas')
    for i, number in enumerate(numbers):
        check_magnitude(number, *bounds[i // 3])
    return numbers


def check_magnitude(number: float, bound: float, unit: str) -> None:
    """
    Refuse a number whose magnitude is larger than ``bound``.

    :param unit: the unit of both, for the error.
    """
    if not abs(number) <= bound:  # refuses NaN, too
        hint = '; give radians, not degrees' if unit == 'rad' else ''
        raise argparse.ArgumentTypeError(
            f'{number:g} is not within {-bound:g} and {bound:g} {unit}{hint}'
        )
