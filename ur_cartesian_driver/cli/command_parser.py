# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The arguments of all commands, and the function that each command runs."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from ur_cartesian_driver.cli import argument_types
from ur_cartesian_driver.kinematics.robot_models import MODELS
from ur_cartesian_driver.sim.command_line.simulator_options import (
    add_calibration,
    add_model,
    add_ports,
    add_simulator_options,
    joints,
    port_number,
    take_negative_numbers,
)


class CommandParser(argparse.ArgumentParser):
    """
    The parser of one command.

    Its arguments are added when the command is used, because adding them imports the module of the
    command. So `where` starts without a planner, `sim` without ROS, and every command quickly.
    """

    def __init__(
        self, *args: Any, add_arguments: Callable[[CommandParser], None], **fields: Any
    ) -> None:
        """Take the function that adds the arguments and sets the function to run."""
        super().__init__(*args, **fields)
        self._add_arguments: Callable[[CommandParser], None] | None = add_arguments

    def _complete(self) -> None:
        add_arguments, self._add_arguments = self._add_arguments, None
        if add_arguments is not None:
            take_negative_numbers(self)
            add_arguments(self)

    def parse_known_args(  # type: ignore[override]  # as argparse calls it
        self, args: Sequence[str] | None = None, namespace: argparse.Namespace | None = None
    ) -> tuple[argparse.Namespace, list[str]]:
        """Add the arguments, then parse."""
        self._complete()
        return super().parse_known_args(args, namespace)

    def format_help(self) -> str:
        """Add the arguments, then format the help."""
        self._complete()
        return super().format_help()


def parser() -> argparse.ArgumentParser:
    """Return the parser of all commands."""
    top = argparse.ArgumentParser(
        prog='ur-cartesian', description='Cartesian trajectories for Universal Robots arms.'
    )
    sub = top.add_subparsers(
        dest='command', required=True, metavar='COMMAND', parser_class=CommandParser
    )
    for name, (text, add_arguments) in COMMANDS.items():
        sub.add_parser(
            name,
            help=text,
            description=text[0].upper() + text[1:] + '.',
            formatter_class=argparse.ArgumentDefaultsHelpFormatter,
            add_arguments=add_arguments,
        )
    return top


def _add_tcp(command: CommandParser, text: str) -> None:
    command.add_argument(
        '--tcp',
        type=argument_types.pose,
        metavar='X,Y,Z,RX,RY,RZ',
        help=f'active TCP in the flange frame{text}',
    )


def _add_robot(command: CommandParser, text: str, **ports: int) -> None:
    """Add the address of a robot, and the ports that a command uses."""
    command.add_argument('--robot-ip', default='127.0.0.1', help='address of the robot')
    add_ports(command, text, **ports)


def _add_own_driver(command: CommandParser) -> None:
    """Add the options of :func:`~ur_cartesian_driver.cli.own_driver.ready_driver`."""
    _add_robot(command, 'its port', rtde=30004, primary=30001, dashboard=29999)
    add_model(command)
    command.add_argument(
        '--wait',
        type=argument_types.seconds,
        default=10.0,
        help='how long to wait until the robot is ready [s]',
    )


def _add_length(command: CommandParser, name: str, default: float | str | None, text: str) -> None:
    command.add_argument(
        f'--{name}',
        type=argument_types.length,
        default=default,
        metavar='LENGTH',
        help=text,
    )


def _add_demo(command: CommandParser) -> None:
    from ur_cartesian_driver.cli import commands

    command.set_defaults(run=commands.demo)
    command.add_argument(
        'goal',
        nargs='?',
        default='seam',
        help='goal file, or the name of an example in config/examples',
    )
    command.add_argument(
        '--picture',
        type=argument_types.picture_file,
        default=Path('demo.png'),  # argparse would check a text, which needs matplotlib
        help='picture of the planned and executed path',
    )
    command.add_argument(
        '--arms',
        type=int,
        choices=(1, 2),
        default=1,
        help='2 = a second robot, driver and client beside the first',
    )
    command.add_argument(
        '--second-goal', default='square', metavar='GOAL', help='goal of the second arm'
    )
    add_model(command, '--model')


def _add_sim(command: CommandParser) -> None:
    from ur_cartesian_driver.sim.command_line.simulate import simulate

    command.set_defaults(run=simulate)
    add_simulator_options(command)


def _add_goal(command: CommandParser, optional: bool = False) -> None:
    command.add_argument(
        'file',
        nargs='?' if optional else None,
        help='goal in the YAML of `ros2 action send_goal`, or the name of an example; '
        '- = standard input',
    )
    command.add_argument(
        '--tf-prefix', default='', help='prefix for the names of frames and joints in the file'
    )
    command.add_argument(
        '--lead-file',
        metavar='FILE',
        help='dead times of valves that the goal names, from `ur-cartesian valve`; by default the '
        'driver knows them',
    )


def _add_driver(command: CommandParser) -> None:
    command.add_argument(
        '--driver',
        type=argument_types.node_name,
        default='ur_cartesian_driver',
        help='name of the driver node, with its namespace if it has one',
    )


def _add_append(command: CommandParser) -> None:
    from ur_cartesian_driver.cli import commands

    command.set_defaults(run=commands.append)
    _add_goal(command, optional=True)
    _add_driver(command)
    command.add_argument(
        '--last',
        action='store_true',
        help='no points follow: the goal ends with these, or, without a file, with the ones that '
        'it has',
    )
    place = command.add_mutually_exclusive_group()
    place.add_argument(
        '--replace-from-point',
        type=argument_types.point_index,
        metavar='N',
        help='first point, counted from 0, that is replaced, with all behind it',
    )
    place.add_argument(
        '--replace-from-time',
        type=argument_types.seconds,
        metavar='SECONDS',
        help='replace all points after this time, counted from the start of the goal',
    )


def _add_recover(command: CommandParser) -> None:
    from ur_cartesian_driver.cli import commands

    command.set_defaults(run=commands.recover)
    _add_driver(command)
    command.add_argument(
        '--unlock',
        action='store_true',
        help='unlock a protective stop, whose cause you have found and removed',
    )


def _add_send(command: CommandParser) -> None:
    from ur_cartesian_driver.cli import commands

    command.set_defaults(run=commands.send)
    _add_goal(command)
    _add_driver(command)
    command.add_argument(
        '--wait',
        type=argument_types.seconds,
        default=10.0,
        metavar='SECONDS',
        help='time until the driver must be ready; 0 = do not check',
    )
    command.add_argument('--validate-only', action='store_true', help='plan, but do not move')
    command.add_argument(
        '--resume',
        action='store_true',
        help='go on where the goal of this file was stopped (noted in FILE.stopped)',
    )
    for name, default, text in (
        ('overlap', '5mm', 'how far before that place the path is resumed'),
        ('approach', '30mm', 'from how far behind the path, along the z axis of the tool'),
    ):
        command.add_argument(
            f'--{name}',
            type=argument_types.resume_length,
            default=default,
            metavar='LENGTH',
            help=text,
        )
    command.add_argument(
        '--report', action='store_true', help='print the report: what was done, and why'
    )
    command.add_argument(
        '--record',
        type=argument_types.output_file,
        metavar='FILE',
        help='write the feedback as JSON lines',
    )
    command.add_argument(
        '--no-cancel',
        action='store_true',
        help='let the goal go on if a signal, a closed output or a full disk ends this command',
    )


def _add_pose(command: CommandParser) -> None:
    """Add the joint positions of the arm, and its TCP."""
    command.add_argument(
        '--joints',
        type=joints,
        metavar='Q1,...,Q6',
        help='initial joint positions [rad]; by default home',
    )
    _add_tcp(command, ', as the pendant shows it [m, rad]; by default the flange')


def _add_planning(command: CommandParser, optional: bool = False) -> None:
    """Add the goal, and options for the values that a driver would read from its robot."""
    _add_goal(command, optional)
    command.add_argument(
        '--ur-type',
        choices=sorted(MODELS),
        help='model of the robot; by default the parameter ur_type',
    )
    _add_pose(command)
    command.add_argument(
        '--params-file',
        type=Path,
        action='append',
        default=[],
        metavar='FILE',
        help='parameter file of the driver, like driver.yaml',
    )
    command.add_argument(
        '-p',
        '--param',
        action='append',
        default=[],
        metavar='NAME:=VALUE',
        help='one parameter of the driver; may be given several times',
    )
    add_calibration(command)


def _add_validate(command: CommandParser) -> None:
    from ur_cartesian_driver.cli import plan_commands

    command.set_defaults(run=plan_commands.validate)
    _add_planning(command)
    command.add_argument(
        '--postures',
        action='store_true',
        help='print the joint positions at each point',
    )


def _add_show(command: CommandParser) -> None:
    from ur_cartesian_driver.cli import plan_commands

    command.set_defaults(run=plan_commands.show)
    _add_planning(command, optional=True)
    command.add_argument(
        '-o',
        '--output',
        type=argument_types.output_file,
        metavar='PAGE',
        help='HTML file to write instead of opening a browser',
    )
    command.add_argument(
        '--live',
        metavar='ROBOT_IP',
        help='follow this robot: plan the goal, if one is given, from where the arm stands, and '
        'serve a page with where it is',
    )
    command.add_argument(
        '--rtde-port', type=port_number, default=30004, help='RTDE port of that robot'
    )
    command.add_argument(
        '--host',
        default=plan_commands.LOOPBACK,
        help='address on which the page of --live is served; with an address other than the '
        'default, anybody on the network can open it',
    )
    command.add_argument(
        '--port',
        type=port_number,
        default=8080,
        help='port of that page, or the next free one',
    )


def _add_cell(command: CommandParser) -> None:
    from ur_cartesian_driver.cli import cell_command

    command.set_defaults(run=cell_command.show_or_check)
    command.add_argument(
        'what',
        choices=('show', 'check'),
        help='show = list the bodies; check = find those that the arm, where it stands, or what '
        'it carries is too close to; the exit status is then 1',
    )
    command.add_argument('file', help='the cell, like cell.yaml')
    command.add_argument(
        '--html',
        type=argument_types.output_file,
        metavar='PAGE',
        help='HTML file that shows the cell and the arm; bodies that touch are red',
    )
    add_model(command, '--model')
    _add_pose(command)
    _add_length(
        command,
        'tool-radius',
        0.0,
        'of the cylinder from flange to TCP, the parameter tool_radius',
    )
    add_calibration(command)
    command.add_argument(
        '--robot-ip', metavar='ADDRESS', help='take joint positions and TCP of this robot instead'
    )
    add_ports(command, 'its RTDE port', rtde=30004)


def _add_sweep(command: CommandParser) -> None:
    from ur_cartesian_driver.cli import sweep_command

    command.set_defaults(run=sweep_command.sweep_goal)
    _add_planning(command)
    lengths, angles = argument_types.lengths, argument_types.angles
    for name, unit, kind in (
        ('x', 'm', lengths),
        ('y', 'm', lengths),
        ('z', 'm', lengths),
        ('rz', 'rad', angles),
    ):
        command.add_argument(
            f'--{name}',
            type=kind,
            default=(0.0,),
            metavar='FROM,TO,COUNT',
            help=f"offsets of the goal's frame [{unit}], like -0.1,0.1,5",
        )
    command.add_argument(
        '--model',
        action='append',
        default=[],
        choices=sorted(MODELS),
        help='model of the robot, instead of --ur-type; may be given several times',
    )
    command.add_argument(
        '--monte-carlo',
        type=argument_types.count,
        default=0,
        metavar='N',
        help='plan each variant for N arms with random calibrations',
    )
    command.add_argument(
        '--seed', type=argument_types.count, default=0, help='of the first of these'
    )
    command.add_argument(
        '--margin',
        default='singularity',
        choices=sorted(sweep_command.MARGINS),
        help='what the printed map shows',
    )
    command.add_argument(
        '--processes',
        type=argument_types.count,
        default=0,
        metavar='N',
        help='0 = one for each core',
    )
    command.add_argument(
        '-o',
        '--output',
        type=argument_types.output_file,
        metavar='TABLE',
        help='file of comma-separated values',
    )
    command.add_argument(
        '--picture', type=argument_types.picture_file, help='heat maps of all margins'
    )


def _add_import(command: CommandParser) -> None:
    from ur_cartesian_driver.cli import import_command
    from ur_cartesian_driver.importing.import_options import LENGTH_UNITS, ToolOrientation

    command.set_defaults(run=import_command.import_goal)
    command.add_argument('file', help='what is read; doc/importing.md says what of each format')
    command.add_argument(
        '-o',
        '--output',
        type=argument_types.output_file,
        help='goal file; by default standard output',
    )
    command.add_argument(
        '--format',
        default='',
        choices=import_command.FORMATS.names(),
        help='by default as the suffix of the name says',
    )
    command.add_argument(
        '--frame', default='', help='frame of the points; by default that of the file, else base'
    )
    command.add_argument(
        '--tool', default='', help='controlled frame, such as a fixed tool; by default the TCP'
    )
    command.add_argument(
        '--origin',
        type=argument_types.pose,
        metavar='X,Y,Z,RX,RY,RZ',
        help='where the origin of the file is in that frame [m, rad]',
    )
    command.add_argument(
        '--unit', default='', choices=sorted(LENGTH_UNITS), help='of lengths without a unit'
    )
    command.add_argument(
        '--scale', type=argument_types.factor, default=1.0, help='factor on all lengths'
    )
    command.add_argument(
        '--orientation',
        default='file',
        choices=[each.value for each in ToolOrientation],
        help='of the tool: as the file has it, against its normals, or straight down',
    )
    _add_speeds(command)
    _add_shape(command)
    command.add_argument(
        '--output-of',
        type=argument_types.code_output,
        action='append',
        default=[],
        metavar='CODE=KIND:PIN:VALUE',
        help='output of an M-code, like M3=standard:2:1, of one with its values, like '
        '"M280 S40=standard:0:1", or of S with the number that means 1, like S=analog:0:10000; '
        'may be given several times',
    )
    add_model(command)  # for joint positions
    _add_tcp(command, ', for joint positions [m, rad]')
    add_calibration(command)


def _add_speeds(command: CommandParser) -> None:
    """Add the speeds and times of an import."""
    command.add_argument(
        '--speed',
        type=argument_types.factor,
        help='[m/s]; by default that of the file, else of the driver',
    )
    command.add_argument(
        '--travel-speed', type=argument_types.factor, help='of G0, and between contours [m/s]'
    )
    command.add_argument(
        '--acceleration', type=argument_types.factor, help='[m/s^2]; by default as the speed'
    )
    command.add_argument(
        '--approach-time',
        type=argument_types.seconds,
        metavar='SECONDS',
        help='for the way to the first point, where the file has times',
    )


def _add_shape(command: CommandParser) -> None:
    """Add the lengths by which an import changes the shape of a path."""
    for name, default, text in (
        ('blend', 0.0, 'at inner points, like 1mm'),
        ('corner', 0.0, 'round corners, nowhere farther from the path than this, like 0.05mm'),
        (
            'simplify',
            0.0,
            'merge points and find arcs, nowhere farther from the path than this, like 0.1mm',
        ),
        ('tolerance', 5e-5, 'of the lines that take the place of splines, ellipses and helices'),
        ('lift', 0.0, 'go back between contours'),
    ):
        _add_length(command, name, default, text)
    command.add_argument(
        '--lines',
        action='store_true',
        help='straight lines of the tool between the points of a joint trajectory',
    )


def _add_teach(command: CommandParser) -> None:
    from ur_cartesian_driver.cli import teach_command

    command.set_defaults(run=teach_command.teach_path)
    command.add_argument(
        '-o',
        '--output',
        type=argument_types.output_file,
        help='goal file; path.yaml by default, which must not exist yet',
    )
    _add_own_driver(command)
    command.add_argument(
        '--speed', type=argument_types.factor, help="of lines and arcs [m/s]; else the driver's"
    )
    _add_length(command, 'blend', None, 'at inner points, like 1mm')
    what = command.add_mutually_exclusive_group()
    what.add_argument(
        '--fixed-tool',
        metavar='NAME',
        help='teach the frame of a tool that stands in the cell, by touching it with the TCP',
    )
    what.add_argument(
        '--held-part',
        metavar='NAME',
        help='teach the frame of a part in the hand, by touching a fixed tool with its points',
    )
    command.add_argument(
        '--point',
        type=argument_types.place,
        action='append',
        default=[],
        metavar='X,Y,Z',
        help='point on the held part that touches, in the frame of the part [m], like '
        '0,0.08,0.005; four or more times',
    )
    command.add_argument(
        '--tip',
        type=argument_types.place,
        metavar='X,Y,Z',
        help='where the points of the held part touch, in base, like -0.56,-0.15,0.41 [m]',
    )


def _add_valve(command: CommandParser) -> None:
    from ur_cartesian_driver.cli import valve_beads, valve_command

    command.set_defaults(run=valve_command.measure_valve)
    command.add_argument('name', help='name of the valve in goals, like valve_1')
    command.add_argument(
        '--output',
        nargs=2,
        required=True,
        metavar=('KIND', 'PIN'),
        help='digital output that opens the valve, like standard_digital 2',
    )
    command.add_argument(
        '--lead-file',
        type=argument_types.output_file,
        default='leads.yaml',
        metavar='FILE',
        help='file to write',
    )
    command.add_argument(
        '--measured',
        type=float,
        nargs=2,
        metavar=('BEGINS', 'ENDS'),
        help='how far behind the slow bead the fast one begins and ends [mm]: lay no beads; '
        '--slow and --fast are those of the beads',
    )
    _add_length(command, 'ruler', '0.5mm', 'uncertainty of one reading')
    for name, speed in (('slow', 0.02), ('fast', 0.2)):
        command.add_argument(
            f'--{name}',
            type=argument_types.factor,
            default=speed,
            help=f'speed of the {name} bead [m/s]',
        )
    _add_length(command, 'length', '100mm', 'of a bead')
    _add_length(command, 'beside', '10mm', 'between them')
    command.add_argument(
        '--along',
        default='x',
        choices=valve_beads.DIRECTIONS,
        help='axis of the tool along which the beads are laid',
    )
    _add_own_driver(command)


def _add_where(command: CommandParser) -> None:
    from ur_cartesian_driver.cli import commands

    command.set_defaults(run=commands.where)
    _add_robot(command, 'its RTDE port', rtde=30004)


def _add_calibration(command: CommandParser) -> None:
    from ur_cartesian_driver.cli import calibration_command

    command.set_defaults(run=calibration_command.write_calibration)
    _add_robot(command, 'its primary port', primary=30001)
    command.add_argument(
        '-o',
        '--output',
        type=argument_types.output_file,
        metavar='FILE',
        help='YAML file; by default standard output',
    )


def _add_check_robot(command: CommandParser) -> None:
    from ur_cartesian_driver.cli import check_robot

    command.set_defaults(run=check_robot.check_robot)
    command.add_argument(
        '--robot-ip', required=True, metavar='ADDRESS', help='address of the robot'
    )
    add_ports(command, 'its port', rtde=30004, primary=30001, dashboard=29999, robot_api=80)
    command.add_argument(
        '--seconds',
        type=argument_types.seconds,
        default=5.0,
        help='how long the RTDE stream is recorded [s]',
    )
    command.add_argument(
        '--with-motion',
        action='store_true',
        help='also move the arm a little, after asking on the terminal before each motion',
    )
    command.add_argument(
        '--report',
        type=argument_types.output_file,
        default='robot_report.json',
        metavar='FILE',
        help='report to send in',
    )


def _add_plot(command: CommandParser) -> None:
    from ur_cartesian_driver.cli.plots import recording_plot

    command.set_defaults(run=recording_plot.plot)
    command.add_argument(
        'file', help='recording, or a directory, of which the newest recording is drawn'
    )
    command.add_argument(
        '-o',
        '--output',
        type=argument_types.picture_file,
        metavar='PICTURE',
        help='picture file, its suffix is the format; by default beside the recording, as .png',
    )


def _add_export(command: CommandParser) -> None:
    from ur_cartesian_driver.cli import export_command

    command.set_defaults(run=export_command.export)
    command.add_argument(
        'file', help='recording, or a directory, of which the newest recording is taken'
    )
    command.add_argument(
        '-o',
        '--output',
        type=argument_types.output_file,
        metavar='FILE',
        help=f'its suffix is the format, {" or ".join(export_command.EXPORTERS.suffixes())}; by '
        'default beside the recording, as .mcap',
    )
    command.add_argument(
        '--tf-prefix', default='', help='prefix for the names of frames and joints in MCAP'
    )


def _add_identify(command: CommandParser) -> None:
    from ur_cartesian_driver.cli import identify_command

    command.set_defaults(run=identify_command.identify)
    command.add_argument(
        'recordings',
        nargs='*',
        metavar='RECORDING',
        help='recordings of one arm: .npz or .part of the driver, or text with titles of RTDE',
    )
    live = command.add_argument_group('or a robot that shall move', 'each motion is asked for')
    live.add_argument('--robot-ip', default='', metavar='ADDRESS', help='address of the robot')
    add_ports(command, 'its port', rtde=30004, primary=30001, dashboard=29999, robot_api=80)
    live.add_argument(
        '--box',
        type=argument_types.box,
        metavar='X,Y,Z,X,Y,Z',
        help='least and greatest coordinates of the TCP in the base of the robot [m]',
    )
    live.add_argument(
        '--max-speed', type=argument_types.factor, metavar='SPEED', help='of the TCP [m/s]'
    )
    live.add_argument(
        '--only',
        type=argument_types.experiments,
        metavar='NAMES',
        help='of these experiments, separated by commas; without it all of them',
    )
    live.add_argument(
        '--folder', default='identification', help='new folder for recordings and progress'
    )
    live.add_argument(
        '--yes',
        action='store_true',
        help='do not ask before moves; stops and pauses are asked for all the same',
    )
    command.add_argument(
        '--commands',
        default='',
        metavar='FILE',
        help='the calls of movej and movel behind the moves of all recordings, one a line',
    )
    command.add_argument(
        '-o',
        '--output',
        type=argument_types.output_file,
        metavar='FILE',
        help='twin to write, such as twin.yaml',
    )
    arm = command.add_argument_group('the arm', 'where the recordings do not name it')
    arm.add_argument('--model', default='', choices=sorted(MODELS), help='model of the robot')
    arm.add_argument('--serial-number', default='', metavar='NUMBER', help='of the arm')
    arm.add_argument(
        '--software',
        type=argument_types.software,
        metavar='VERSION',
        help='such as 5.21.0',
    )
    arm.add_argument(
        '--motion-version', type=int, choices=(0, 1, 2), default=0, help='0 = not known'
    )
    arm.add_argument(
        '--date',
        type=argument_types.day,
        metavar='YYYY-MM-DD',
        help='day of the recordings; today if left out',
    )


#: Description and arguments of each command, by name.
COMMANDS: dict[str, tuple[str, Callable[[CommandParser], None]]] = {
    'demo': ('run simulator, driver and client, a process each, with one goal', _add_demo),
    'sim': ('run a simulated controller on the ports of a real one', _add_sim),
    'send': ('send a goal to a running driver and wait for its result', _add_send),
    'append': (
        'append points to the running goal, which was sent with keep_open, or replace its tail',
        _add_append,
    ),
    'recover': ('bring a stopped robot back to where it takes goals', _add_recover),
    'validate': ('check and plan a goal without a robot, and print the plan', _add_validate),
    'show': (
        'plan a goal without a robot, and show the arm on its path in the browser',
        _add_show,
    ),
    'cell': (
        'list the bodies of a cell, draw them, and find those that the resting arm touches',
        _add_cell,
    ),
    'sweep': (
        'plan a goal at other places, on other robots and calibrations, and print the margins',
        _add_sweep,
    ),
    'import': (
        'make a goal from a file: CSV, G-code, DXF, ROS messages, recordings, URScript',
        _add_import,
    ),
    'teach': (
        'guide the arm by hand, take points with Enter, and write them as a goal to edit',
        _add_teach,
    ),
    'valve': (
        'lay two beads, ask for two distances, and write the dead times of the valve',
        _add_valve,
    ),
    'where': ('print the pose of the robot, as a point to paste into a goal', _add_where),
    'calibration': (
        'write the kinematics of the robot as the YAML that ur_description takes',
        _add_calibration,
    ),
    'check-robot': (
        'report what works with a robot, and where it differs from our assumptions; moves the '
        'arm only after asking',
        _add_check_robot,
    ),
    'identify': (
        'estimate the laws of motion of an arm, from recordings or by short motions that it makes',
        _add_identify,
    ),
    'plot': ('draw a recorded motion: path, deviation, speed, lag, outputs and events', _add_plot),
    'export': (
        'write a recorded motion for other programs: MCAP with messages of ROS 2, or CSV',
        _add_export,
    ),
}
