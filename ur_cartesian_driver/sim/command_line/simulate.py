# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Runs the simulated controller that the options describe, and shows its state."""

from __future__ import annotations

import argparse
import asyncio
from collections.abc import Callable, Mapping
from pathlib import Path
import sys
from typing import Any

from ur_cartesian_driver.kinematics.robot_models import DhTable, robot_model, RobotModel
from ur_cartesian_driver.motion.twin.twin import UNKNOWN_ARM
from ur_cartesian_driver.motion.twin.twin_file import read_twin
from ur_cartesian_driver.sim.calibration import random_calibration, read_calibration
from ur_cartesian_driver.sim.command_line.simulator_options import fields_from
from ur_cartesian_driver.sim.motion.imperfect_arm import Imperfections, typical_imperfections
from ur_cartesian_driver.sim.pendant_programs.program_tree import (
    BUILT_IN_PROGRAMS,
    SavedProgram,
    UnloadableProgram,
    UnreadableProgram,
)
from ur_cartesian_driver.sim.pendant_programs.urp_file import read_urp
from ur_cartesian_driver.sim.programs.stored_programs import (
    read_urpx,
    urpx_script,
    URPX_SUFFIX,
)
from ur_cartesian_driver.sim.simulated_robot import SimulatedRobot
from ur_cartesian_driver.sim.simulator_config import SimulatorConfig

#: The model of the robot if neither an option nor a twin names one.
_MODEL = 'ur5e'


def simulate(arguments: argparse.Namespace) -> int:
    """Run the simulated controller that the options describe, until it is interrupted."""
    config = simulator_config(arguments)
    try:
        robot = SimulatedRobot(config)
    except UnloadableProgram as error:
        error.add_note(f'{config.program} is {arguments.program}')
        raise
    asyncio.run(_simulate(robot))
    return 0


def simulator_config(arguments: argparse.Namespace) -> SimulatorConfig:
    """
    Return the configuration of the simulated robot.

    :raises ValueError: an option has an impossible value, or the calibration, the twin or the
        program to load has a mistake.
    :raises OSError: the calibration, the twin, the program to load or the directory of programs
        cannot be read.
    """
    twin = read_twin(arguments.twin) if arguments.twin else None
    arm = UNKNOWN_ARM if twin is None else twin.arm
    model = robot_model(arguments.model or arm.model or _MODEL)
    programs, loaded = {}, ''
    if arguments.programs:
        found = [file for file in arguments.programs.iterdir() if file.suffix in _READERS]
        # PolyScope writes a .script beside each .urp. Both get the name of the .urp, which comes
        # later in the order of suffixes and so replaces the .script.
        programs = dict(map(_read_if_possible, sorted(found, key=lambda file: file.suffix)))
    if arguments.program and _is_built_in(arguments.program):
        loaded = str(arguments.program)
    elif arguments.program:
        loaded, programs[loaded] = _read_program(arguments.program)
    fields: dict[str, Any] = {
        **fields_from(arguments, SimulatorConfig),
        'model': model.name,
        'polyscope': arguments.polyscope or arm.software,
        'power': 'off' if arguments.power_off else 'running',
        'remote_control': not arguments.local,
        'has_remote_control': not arguments.no_remote_control,
        'motion_version': arguments.motion_version or arm.motion_version or 1,
        'twin': twin,
        'imperfections': imperfections(arguments, model),
        'geometry': calibration(arguments, model),
        'programs': programs,
        'program': loaded,
    }
    if arguments.joints:
        fields['q'] = arguments.joints
    return SimulatorConfig(**fields)


def _is_built_in(file: Path) -> bool:
    """Return whether a name is a built-in program's; an existing file takes precedence."""
    return str(file) in BUILT_IN_PROGRAMS and not file.exists()


def _read_if_possible(file: Path) -> tuple[str, SavedProgram]:
    """Read a program file; an unreadable file is listed, too, but the robot refuses to load it."""
    try:
        return _read_program(file)
    except (OSError, ValueError) as error:
        suffix = URPX_SUFFIX if file.suffix == URPX_SUFFIX else '.urp'
        return file.stem + suffix, UnreadableProgram(str(error).removesuffix('.'))


def _read_program(file: Path) -> tuple[str, SavedProgram]:
    """
    Return the name by which a program file is loaded, and the program.

    :raises ValueError: the file is not a program, or has a node that the simulator does not run.
    :raises OSError: the file cannot be read.
    """
    return _READERS.get(file.suffix, _read_script)(file)


def _read_script(file: Path) -> tuple[str, str]:
    try:
        return f'{file.stem}.urp', file.read_text('utf-8')
    except UnicodeDecodeError:
        raise ValueError(f'{file} is no text in UTF-8.') from None


def _read_urp(file: Path) -> tuple[str, SavedProgram]:
    return file.name, read_urp(file.read_bytes(), str(file))


def _read_urpx(file: Path) -> tuple[str, str]:
    """Return the program's name (with the suffix) and URScript from a file of PolyScope X."""
    try:
        name, content = read_urpx(file.read_bytes())
    except (ValueError, RecursionError) as error:
        raise ValueError(f'{file} is no program file of PolyScope X: {error}.') from None
    return name + URPX_SUFFIX, urpx_script(name, content)


#: Suffix of a program file -> its reader.
_READERS: Mapping[str, Callable[[Path], tuple[str, SavedProgram]]] = {
    '.script': _read_script,
    '.urp': _read_urp,
    URPX_SUFFIX: _read_urpx,
}


def imperfections(arguments: argparse.Namespace, model: RobotModel) -> Imperfections | None:
    """Return the imperfections that the arguments demand; None = a perfect robot."""
    if arguments.imperfect is None:
        return None
    return typical_imperfections(model, arguments.imperfect)


def calibration(arguments: argparse.Namespace, model: RobotModel) -> DhTable | None:
    """Return the DH table of the calibration that the arguments name; None = the nominal one."""
    if arguments.calibration is not None:
        return read_calibration(Path(arguments.calibration), model)
    if arguments.calibration_seed is not None:
        return random_calibration(model, arguments.calibration_seed)
    return None


async def _simulate(robot: SimulatedRobot) -> None:
    """Run the robot; print its ports and, if the output is a terminal, its state."""
    showing = asyncio.create_task(_show_status(robot))
    try:
        await robot.run(on_listening=lambda: _show_ports(robot))
    finally:
        showing.cancel()


def _show_ports(robot: SimulatedRobot) -> None:
    ports = robot.ports
    print(
        f'simulated {robot.config.model} on {robot.config.host}: RTDE {ports.rtde}, '
        f'primary {ports.primary}, dashboard {ports.dashboard}, '
        f'secondary {ports.secondary}, real-time {ports.realtime}, '
        f'interpreter {ports.interpreter}'
        + (f', Robot API {ports.robot_api}' if ports.robot_api else ''),
        flush=True,
    )


async def _show_status(robot: SimulatedRobot) -> None:
    while sys.stdout.isatty():
        await asyncio.sleep(0.5)
        print(f'\r{robot.status_line()}\033[K', end='', flush=True)
