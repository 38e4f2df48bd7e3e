# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The arguments of all commands, and which function each command runs."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from pathlib import Path

from ur_cartesian_driver.cli import (
    argument_types,
    check_robot,
    commands,
    export_command,
    import_command,
    plan_commands,
    recording_plot,
    sweep_command,
    teach_command,
)
from ur_cartesian_driver.importing.import_options import LENGTH_UNITS, ToolOrientation
from ur_cartesian_driver.kinematics.robot_models import MODELS
from ur_cartesian_driver.sim.command_line.simulate import simulate
from ur_cartesian_driver.sim.command_line.simulator_options import (
    add_calibration,
    add_model,
    add_ports,
    add_simulator_options,
    joints,
    port_number,
    take_negative_numbers,
)


def parser() -> argparse.ArgumentParser:
    """Return the parser of all commands."""
    top = argparse.ArgumentParser(
        prog='ur-cartesian', description='Cartesian trajectories for Universal Robots arms.'
    )
    sub = top.add_subparsers(dest='command', required=True, metavar='COMMAND')
    _add_demo(sub)
    _add_sim(sub)
    _add_send(sub)
    _add_append(sub)
    _add_recover(sub)
    _add_validate(sub)
    _add_show(sub)
    _add_sweep(sub)
    _add_import(sub)
    _add_teach(sub)
    _add_where(sub)
    _add_check_robot(sub)
    _add_plot(sub)
    _add_export(sub)
    return top


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
    take_negative_numbers(command)
    return command


def _add_tcp(command: argparse.ArgumentParser, text: str) -> None:
    command.add_argument(
        '--tcp',
        type=argument_types.tcp,
        metavar='X,Y,Z,RX,RY,RZ',
        help=f'active TCP in the flange frame{text}',
    )


def _add_demo(sub: Commands[argparse.ArgumentParser]) -> None:
    demo = _add(
        sub,
        'demo',
        commands.demo,
        'run simulator, driver and client, a process each, with one goal',
    )
    demo.add_argument(
        'goal',
        nargs='?',
        default='seam',
        help='goal file, or the name of an example in config/examples',
    )
    demo.add_argument(
        '--picture', default='demo.png', help='picture of the planned and executed path'
    )
    demo.add_argument(
        '--arms',
        type=int,
        choices=(1, 2),
        default=1,
        help='2 = a second robot, driver and client beside the first',
    )
    demo.add_argument(
        '--second-goal', default='square', metavar='GOAL', help='goal of the second arm'
    )
    add_model(demo, '--model')


def _add_sim(sub: Commands[argparse.ArgumentParser]) -> None:
    sim = _add(sub, 'sim', simulate, 'run a simulated controller on the ports of a real one')
    add_simulator_options(sim)


def _add_goal(command: argparse.ArgumentParser, optional: bool = False) -> None:
    command.add_argument(
        'file',
        nargs='?' if optional else None,
        help='goal in the YAML of `ros2 action send_goal`, or the name of an example; '
        '- = standard input',
    )
    command.add_argument(
        '--tf-prefix', default='', help='prefix for the names of frames and joints in the file'
    )


def _add_driver(command: argparse.ArgumentParser) -> None:
    command.add_argument(
        '--driver',
        default='ur_cartesian_driver',
        help='name of the driver node, with its namespace if it has one',
    )


def _add_append(sub: Commands[argparse.ArgumentParser]) -> None:
    append = _add(
        sub,
        'append',
        commands.append,
        'append points to the running goal, which was sent with keep_open, or replace its tail',
    )
    _add_goal(append, optional=True)
    _add_driver(append)
    append.add_argument(
        '--last',
        action='store_true',
        help='nothing follows: the goal ends with these points, or without a file with those '
        'that it has',
    )
    place = append.add_mutually_exclusive_group()
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
        help='time from the start of the goal from which on its points are replaced',
    )


def _add_recover(sub: Commands[argparse.ArgumentParser]) -> None:
    recover = _add(
        sub, 'recover', commands.recover, 'bring a stopped robot back to where it takes goals'
    )
    _add_driver(recover)
    recover.add_argument(
        '--unlock',
        action='store_true',
        help='unlock a protective stop, whose cause you have found and removed',
    )


def _add_send(sub: Commands[argparse.ArgumentParser]) -> None:
    send = _add(
        sub, 'send', commands.send, 'send a goal to a running driver and wait for its result'
    )
    _add_goal(send)
    _add_driver(send)
    send.add_argument(
        '--wait',
        type=argument_types.seconds,
        default=10.0,
        metavar='SECONDS',
        help='time until the driver must be ready; 0 = do not check',
    )
    send.add_argument('--validate-only', action='store_true', help='plan, but do not move')
    send.add_argument(
        '--resume',
        action='store_true',
        help='go on where the goal of this file was stopped (noted in FILE.stopped)',
    )
    send.add_argument(
        '--overlap',
        type=float,
        default=5.0,
        metavar='MM',
        help='how far before that place the path is taken up again (5 mm)',
    )
    send.add_argument(
        '--approach',
        type=float,
        default=30.0,
        metavar='MM',
        help='from how far behind the path, along the z axis of the tool (30 mm)',
    )
    send.add_argument(
        '--report', action='store_true', help='print the report: what was done, and why'
    )
    send.add_argument('--record', metavar='FILE', help='write the feedback as JSON lines')
    send.add_argument(
        '--no-cancel',
        action='store_true',
        help='let the goal go on if a signal, a closed output or a full disk ends this command',
    )


def _add_planning(command: argparse.ArgumentParser, optional: bool = False) -> None:
    """Add the goal, which may be optional, and what the driver reads from the robot."""
    _add_goal(command, optional)
    command.add_argument(
        '--ur-type',
        choices=sorted(MODELS),
        help='model of the robot; by default the parameter ur_type',
    )
    command.add_argument(
        '--joints',
        type=joints,
        metavar='Q1,...,Q6',
        help='initial joint positions [rad]; by default home',
    )
    _add_tcp(command, ', as the pendant shows it [m, rad]; by default the flange')
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


def _add_validate(sub: Commands[argparse.ArgumentParser]) -> None:
    validate = _add(
        sub,
        'validate',
        plan_commands.validate,
        'check and plan a goal without a robot, and print the plan',
    )
    _add_planning(validate)
    validate.add_argument(
        '--postures',
        action='store_true',
        help='print the joint positions at each point',
    )


def _add_show(sub: Commands[argparse.ArgumentParser]) -> None:
    show = _add(
        sub,
        'show',
        plan_commands.show,
        'plan a goal without a robot, and show the arm on its path in the browser',
    )
    _add_planning(show, optional=True)
    show.add_argument(
        '-o', '--output', metavar='PAGE', help='HTML file to write instead of opening a browser'
    )
    show.add_argument(
        '--live',
        metavar='ROBOT_IP',
        help='follow this robot: plan the goal, if one is given, from where the arm stands, and '
        'serve a page with where it is',
    )
    show.add_argument(
        '--rtde-port', type=port_number, default=30004, help='RTDE port of that robot'
    )
    show.add_argument(
        '--host',
        default=plan_commands.LOOPBACK,
        help='address on which the page of --live is served; others than the default let others '
        'of the network look',
    )
    show.add_argument(
        '--port',
        type=port_number,
        default=8080,
        help='port of that page, or the next free one',
    )


def _add_sweep(sub: Commands[argparse.ArgumentParser]) -> None:
    command = _add(
        sub,
        'sweep',
        sweep_command.sweep_goal,
        'plan a goal at other places, on other robots and calibrations, and print the margins',
    )
    _add_planning(command)
    for name, unit in (('x', 'm'), ('y', 'm'), ('z', 'm'), ('rz', 'rad')):
        command.add_argument(
            f'--{name}',
            type=argument_types.offsets,
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
    command.add_argument('-o', '--output', metavar='TABLE', help='file of comma-separated values')
    command.add_argument('--picture', help='heat maps of all margins')


def _add_import(sub: Commands[argparse.ArgumentParser]) -> None:
    bring = _add(
        sub,
        'import',
        import_command.import_goal,
        'make a goal of a file of others: CSV, G-code, DXF, ROS messages, recordings, URScript',
    )
    bring.add_argument('file', help='what is read; doc/importing.md says what of each format')
    bring.add_argument('-o', '--output', help='goal file; by default standard output')
    bring.add_argument(
        '--format',
        default='',
        choices=import_command.FORMATS,
        help='by default as the suffix of the name says',
    )
    bring.add_argument(
        '--frame', default='', help='frame of the points; by default that of the file, else base'
    )
    bring.add_argument(
        '--origin',
        type=argument_types.tcp,
        metavar='X,Y,Z,RX,RY,RZ',
        help='where the origin of the file is in that frame [m, rad]',
    )
    bring.add_argument(
        '--unit', default='', choices=sorted(LENGTH_UNITS), help='of lengths without a unit'
    )
    bring.add_argument(
        '--scale', type=argument_types.factor, default=1.0, help='factor on all lengths'
    )
    bring.add_argument(
        '--orientation',
        default='file',
        choices=[each.value for each in ToolOrientation],
        help='of the tool: as the file has it, against its normals, or straight down',
    )
    bring.add_argument(
        '--speed',
        type=argument_types.factor,
        help='[m/s]; by default that of the file, else of the driver',
    )
    bring.add_argument(
        '--travel-speed', type=argument_types.factor, help='of G0, and between contours [m/s]'
    )
    bring.add_argument(
        '--acceleration', type=argument_types.factor, help='[m/s^2]; by default as the speed'
    )
    for name, default, text in (
        ('blend', 0.0, 'at inner points, like 1mm'),
        (
            'simplify',
            0.0,
            'merge points and find arcs, nowhere farther from the path than this, like 0.1mm',
        ),
        ('tolerance', 5e-5, 'of the lines that take the place of splines, ellipses and helices'),
        ('lift', 0.0, 'go back between contours'),
    ):
        bring.add_argument(
            f'--{name}',
            type=argument_types.length,
            default=default,
            metavar='LENGTH',
            help=text,
        )
    bring.add_argument(
        '--output-of',
        type=argument_types.code_output,
        action='append',
        default=[],
        metavar='CODE=KIND:PIN:VALUE',
        help='output of an M-code, like M3=standard:2:1, or of S with the number that means 1, '
        'like S=analog:0:10000; may be given several times',
    )
    add_model(bring)  # for joint positions
    _add_tcp(bring, ', for joint positions [m, rad]')
    add_calibration(bring)


def _add_teach(sub: Commands[argparse.ArgumentParser]) -> None:
    command = _add(
        sub,
        'teach',
        teach_command.teach_path,
        'guide the arm by hand, take points with Enter, and write them as a goal to edit',
    )
    command.add_argument('-o', '--output', default='path.yaml', help='goal file')
    command.add_argument('--robot-ip', default='127.0.0.1', help='address of the robot')
    add_model(command)
    add_ports(command, 'its port', rtde=30004, primary=30001, dashboard=29999)
    command.add_argument(
        '--speed', type=argument_types.factor, help="of lines and arcs [m/s]; else the driver's"
    )
    command.add_argument(
        '--blend', type=argument_types.length, metavar='LENGTH', help='at inner points, like 1mm'
    )
    command.add_argument(
        '--wait',
        type=argument_types.seconds,
        default=10.0,
        help='until the robot must be ready [s]',
    )


def _add_where(sub: Commands[argparse.ArgumentParser]) -> None:
    where = _add(
        sub,
        'where',
        commands.where,
        'print the pose of the robot, as a point to paste into a goal',
    )
    where.add_argument('--robot-ip', default='127.0.0.1', help='address of the robot')
    add_ports(where, 'its RTDE port', rtde=30004)


def _add_check_robot(sub: Commands[argparse.ArgumentParser]) -> None:
    check = _add(
        sub,
        'check-robot',
        check_robot.check_robot,
        'tell what works with a robot and how it differs from what is assumed; moves nothing '
        'without being asked',
    )
    check.add_argument('--robot-ip', required=True, metavar='ADDRESS', help='address of the robot')
    add_ports(check, 'its port', rtde=30004, primary=30001, dashboard=29999, robot_api=80)
    check.add_argument(
        '--seconds',
        type=argument_types.seconds,
        default=5.0,
        help='how long the RTDE stream is recorded [s]',
    )
    check.add_argument(
        '--with-motion',
        action='store_true',
        help='also move the arm a little, after asking on the terminal before each motion',
    )
    check.add_argument(
        '--report', default='robot_report.json', metavar='FILE', help='report to send in'
    )


def _add_plot(sub: Commands[argparse.ArgumentParser]) -> None:
    draw = _add(
        sub,
        'plot',
        recording_plot.plot,
        'draw a recorded motion: path, deviation, speed, lag, outputs and events',
    )
    draw.add_argument(
        'file', help='recording, or a directory, of which the newest recording is drawn'
    )
    draw.add_argument(
        '-o',
        '--output',
        metavar='PICTURE',
        help='picture file, its suffix is the format; by default beside the recording, as .png',
    )


def _add_export(sub: Commands[argparse.ArgumentParser]) -> None:
    export = _add(
        sub,
        'export',
        export_command.export,
        'write a recorded motion for other programs: MCAP with messages of ROS 2, or CSV',
    )
    export.add_argument(
        'file', help='recording, or a directory, of which the newest recording is taken'
    )
    export.add_argument(
        '-o',
        '--output',
        metavar='FILE',
        help='its suffix is the format, .mcap or .csv; by default beside the recording, as .mcap',
    )
    export.add_argument(
        '--tf-prefix', default='', help='prefix for the names of frames and joints in MCAP'
    )
