# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The command ``ur-cartesian``.

Each command is a function of the parsed arguments that returns the exit status. What needs ROS is
imported inside the commands that need it, so ``sim`` and ``where`` run without.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Sequence
import logging
from pathlib import Path
import re
import signal
import sys

from ur_cartesian_driver.cli import commands, recording_plot, validate_command
from ur_cartesian_driver.kinematics.robot_models import MODELS
from ur_cartesian_driver.motion.errors import DriverError
from ur_cartesian_driver.sim.faults.fault_parser import parse_fault
from ur_cartesian_driver.sim.faults.fault_values import Fault


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command line and return the exit status: 0 only if what was asked for happened."""
    arguments = parser().parse_args(sys.argv[1:] if argv is None else argv)
    logging.basicConfig(level=logging.WARNING, format='%(levelname)s: %(message)s')
    # A command that is told to end has to tidy up as after Ctrl-C; a shell that starts it in the
    # background has SIGINT ignored.
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, signal.default_int_handler)
    run: Callable[[argparse.Namespace], int] = arguments.run
    try:
        return run(arguments)
    except KeyboardInterrupt:
        return 130
    except (DriverError, OSError, ValueError) as error:
        print(f'ur-cartesian {arguments.command}: {error}', file=sys.stderr)
        return 1


def parser() -> argparse.ArgumentParser:
    """Return the parser of all commands."""
    top = argparse.ArgumentParser(
        prog='ur-cartesian', description='Cartesian trajectories for Universal Robots arms.'
    )
    sub = top.add_subparsers(dest='command', required=True, metavar='COMMAND')
    _add_demo(sub)
    _add_sim(sub)
    _add_send(sub)
    _add_validate(sub)
    _add_where(sub)
    _add_plot(sub)
    return top


_NUMBERS = re.compile(r'-[\d.][-+\d.,eE]*')

Commands = argparse._SubParsersAction  # argparse has no public name for it


def _add(
    sub: Commands[argparse.ArgumentParser],
    name: str,
    run: Callable[[argparse.Namespace], int],
    text: str,
) -> argparse.ArgumentParser:
    command = sub.add_parser(
        name,
        help=text,
        description=text[0].upper() + text[1:] + '.',
        formatter_class=argparse.ArgumentDefaultsHelpFormatter,
    )
    command.set_defaults(run=run)
    # What begins with a minus is a value also where it is six numbers; argparse has no public way.
    command._negative_number_matcher = _NUMBERS
    return command


def _add_demo(sub: Commands[argparse.ArgumentParser]) -> None:
    demo = _add(
        sub,
        'demo',
        commands.demo,
        'simulator, driver and a client, each a process, and one goal through them all',
    )
    demo.add_argument(
        'goal',
        nargs='?',
        default='seam',
        help='a goal file, or the name of one of config/examples',
    )
    demo.add_argument(
        '--picture', default='demo.png', help='where to draw planned and executed path'
    )
    demo.add_argument(
        '--arms',
        type=int,
        choices=(1, 2),
        default=1,
        help='2 = another robot, driver and client beside them',
    )
    demo.add_argument(
        '--second-goal', default='square', metavar='GOAL', help='what the second arm does'
    )
    demo.add_argument('--model', default='ur5e', choices=sorted(MODELS), help='model of the robot')


def _add_sim(sub: Commands[argparse.ArgumentParser]) -> None:
    sim = _add(sub, 'sim', commands.sim, 'a simulated controller on the ports of a real one')
    sim.add_argument('--model', default='ur5e', choices=sorted(MODELS), help='model of the robot')
    sim.add_argument('--host', default='127.0.0.1', help='address to listen on')
    sim.add_argument(
        '--polyscope',
        default='',
        metavar='VERSION',
        help='software version, such as 5.21; empty = the newest for the model',
    )
    for name, port in (('rtde', 30004), ('primary', 30001), ('dashboard', 29999)):
        sim.add_argument(f'--{name}-port', type=int, default=port, help='0 = any free port')
    for name, port in (('secondary', 30002), ('realtime', 30003), ('interpreter', 30020)):
        sim.add_argument(
            f'--{name}-port',
            type=int,
            default=None,
            help=f'0 = any free port; left out: {port} if the primary port is 30001, else any',
        )
    sim.add_argument(
        '--joints',
        type=_six_numbers,
        metavar='Q1,...,Q6',
        help='joint positions at the start [rad]',
    )
    _add_calibration(sim)
    sim.add_argument(
        '--rate',
        type=float,
        default=1.0,
        help='how fast time passes; 2 = twice as fast, 0 = as fast as it can',
    )
    sim.add_argument(
        '--fault',
        type=_fault,
        action='append',
        default=[],
        metavar='TEXT',
        dest='faults',
        help="what goes wrong, and when: 'protective_stop at 2 s', 'drop rtde at 0.35 m'; may be "
        'given several times, see doc/simulation.md',
    )
    sim.add_argument('--power-off', action='store_true', help='start with the arm switched off')
    sim.add_argument(
        '--local', action='store_true', help='local control: no scripts over the network'
    )


def _add_goal(command: argparse.ArgumentParser) -> None:
    command.add_argument(
        'file',
        help='goal in the YAML of `ros2 action send_goal`, or the name '
        'of an example; - = standard input',
    )
    command.add_argument(
        '--tf-prefix', default='', help='put before the names of frames and joints in the file'
    )


def _add_calibration(command: argparse.ArgumentParser) -> None:
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
        help='a made-up calibration, for each number another',
    )


def _add_send(sub: Commands[argparse.ArgumentParser]) -> None:
    send = _add(sub, 'send', commands.send, 'send a goal to a running driver and wait for its end')
    _add_goal(send)
    send.add_argument(
        '--driver',
        default='ur_cartesian_driver',
        help='name of the driver node, with its namespace if it has one',
    )
    send.add_argument(
        '--wait',
        type=float,
        default=10.0,
        metavar='SECONDS',
        help='how long the driver may need until it is ready; 0 = do not look',
    )
    send.add_argument('--validate-only', action='store_true', help='plan, but do not move')
    send.add_argument(
        '--report', action='store_true', help='print what is done and why, as --validate-only does'
    )
    send.add_argument('--record', metavar='FILE', help='write the feedback as JSON lines')


def _add_validate(sub: Commands[argparse.ArgumentParser]) -> None:
    validate = _add(
        sub,
        'validate',
        validate_command.validate,
        'check and plan a goal with neither motion nor robot, and print the plan',
    )
    _add_goal(validate)
    validate.add_argument(
        '--ur-type', choices=sorted(MODELS), help='model; left out: the parameter ur_type'
    )
    validate.add_argument(
        '--joints',
        type=_six_numbers,
        metavar='Q1,...,Q6',
        help='where the arm stands [rad]; home when left out',
    )
    validate.add_argument(
        '--tcp',
        type=_six_numbers,
        metavar='X,Y,Z,RX,RY,RZ',
        help='active TCP in the flange, as the pendant shows it [m, rad]; '
        'the flange when left out',
    )
    validate.add_argument(
        '--params-file',
        type=Path,
        action='append',
        default=[],
        metavar='FILE',
        help='parameters of the driver, as driver.yaml',
    )
    validate.add_argument(
        '-p',
        '--param',
        action='append',
        default=[],
        metavar='NAME:=VALUE',
        help='one parameter of the driver; may be given several times',
    )
    validate.add_argument(
        '--postures',
        action='store_true',
        help='print the joint positions in which the arm arrives',
    )
    _add_calibration(validate)


def _add_where(sub: Commands[argparse.ArgumentParser]) -> None:
    where = _add(
        sub,
        'where',
        commands.where,
        'print where the robot stands, as a point to paste into a goal',
    )
    where.add_argument('--robot-ip', default='127.0.0.1', help='address of the robot')
    where.add_argument('--rtde-port', type=int, default=30004, help='its RTDE port')


def _add_plot(sub: Commands[argparse.ArgumentParser]) -> None:
    draw = _add(
        sub,
        'plot',
        recording_plot.plot,
        'draw a recorded motion: path, deviation, speed, lag, outputs and events',
    )
    draw.add_argument('file', help='a recording, or a directory of recordings: its newest one')
    draw.add_argument(
        '-o',
        '--output',
        metavar='PICTURE',
        help='left out: beside the recording, as .png; the suffix is the format',
    )
    draw.add_argument(
        '--csv',
        metavar='TABLE',
        help='write all packets as comma-separated values; without -o no picture',
    )


def _fault(text: str) -> Fault:
    try:
        return parse_fault(text)
    except ValueError as error:
        raise argparse.ArgumentTypeError(str(error)) from None


def _six_numbers(text: str) -> tuple[float, ...]:
    """Return six numbers that stand with commas between them."""
    numbers = tuple(float(part) for part in text.split(','))
    if len(numbers) != 6:
        raise argparse.ArgumentTypeError(f'{len(numbers)} numbers; give six, with commas')
    return numbers
