# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""``ur-cartesian identify``: estimate, from recordings of an arm, the laws by which it moves."""

from __future__ import annotations

import argparse
from dataclasses import fields
from datetime import date
from pathlib import Path
import sys

from ur_cartesian_driver.driver.recordings.recording import Recording
from ur_cartesian_driver.identification.arm_samples import read_samples
from ur_cartesian_driver.identification.estimators import Result, Unknown
from ur_cartesian_driver.identification.identify import Identification
from ur_cartesian_driver.identification.identify import identify as identify_laws
from ur_cartesian_driver.identification.recorded_calls import MotionCommand, read_commands
from ur_cartesian_driver.motion.twin.laws import LAWS
from ur_cartesian_driver.motion.twin.twin import ArmIdentity, Estimate, Twin
from ur_cartesian_driver.motion.twin.twin_file import twin_text


def identify(arguments: argparse.Namespace) -> int:
    """
    Print each law with its 95 % interval, or why it was not identified.

    With ``--output``, also write the twin file.
    """
    if bool(arguments.recordings) == bool(arguments.robot_ip):
        raise ValueError('give either recordings, or the robot that shall move: --robot-ip')
    if arguments.robot_ip:
        return _identify_live(arguments)
    paths = [Path(name) for name in arguments.recordings]
    arm = _arm(paths, arguments)
    if arguments.output and not arm.model:
        raise ValueError('the recordings do not name their arm: add --model, such as --model ur5e')
    recordings = [read_samples(path) for path in paths]
    calls: list[MotionCommand] = []
    if arguments.commands:
        text = Path(arguments.commands).read_text(encoding='utf-8', errors='replace')
        calls = read_commands(text, arguments.commands)
    _show_and_write(identify_laws(recordings, calls, arguments.commands), arm, paths, arguments)
    return 0


def _identify_live(arguments: argparse.Namespace) -> int:
    """Run the experiments and identify the laws; return 1 if a surprise ended them early."""
    from ur_cartesian_driver.cli.identify_live import CALLS, record

    asked = _asked(arguments)
    live = record(arguments, asked)
    if live.samples:
        arm = _merged(asked, live.arm, arguments.robot_ip)
        names = [Path(samples.name) for samples in live.samples]
        _show_and_write(identify_laws(live.samples, live.commands, CALLS), arm, names, arguments)
    if live.surprise:
        print(f'The experiments ended early: {live.surprise}.', file=sys.stderr)
    return int(bool(live.surprise))


def _show_and_write(
    found: Identification, arm: ArmIdentity, paths: list[Path], arguments: argparse.Namespace
) -> None:
    print(found.summary())
    for name, result in found.results.items():
        print(f'{name:<26} {_described(name, result)}')
    if arguments.output:
        twin = Twin(
            arm=arm,
            date=arguments.date or date.today().isoformat(),
            files=tuple(path.name for path in paths),
            estimates={k: r for k, r in found.results.items() if isinstance(r, Estimate)},
            not_identified={k: str(r) for k, r in found.results.items() if isinstance(r, Unknown)},
        )
        Path(arguments.output).write_text(twin_text(twin), encoding='utf-8')
        print(f'twin: {arguments.output}')


def _described(name: str, result: Result) -> str:
    if isinstance(result, Unknown):
        return f'not identified: {result}'
    parts = (result.evidence, f'{result.left_over} left' if result.left_over else '')
    return f'{result.text(LAWS[name].unit)}; ' + ', '.join(part for part in parts if part)


def _arm(paths: list[Path], arguments: argparse.Namespace) -> ArmIdentity:
    """
    Return the arm that the options name, completed by the recordings of the driver.

    :raises ValueError: two recordings, or a recording and an option, name different arms.
    """
    arm = _asked(arguments)
    for path in paths:
        if not (path.is_dir() or path.suffix == '.npz'):
            continue
        robot = Recording.load(path, max_rows=1).metadata.get('robot') or {}
        own = ArmIdentity(
            model=str(robot.get('model') or ''),
            serial_number=str(robot.get('serial_number') or ''),
            software=str(robot.get('polyscope_version') or ''),
            motion_version=int(robot.get('motion_version') or 0),
        )
        arm = _merged(arm, own, str(path))
    return arm


def _asked(arguments: argparse.Namespace) -> ArmIdentity:
    return ArmIdentity(
        model=arguments.model,
        serial_number=arguments.serial_number,
        software=arguments.software or '',
        motion_version=arguments.motion_version,
    )


def _merged(arm: ArmIdentity, own: ArmIdentity, source: str) -> ArmIdentity:
    """
    Return ``arm`` with its unknown fields filled from ``own``, the arm that the source names.

    :raises ValueError: the source names another arm.
    """
    if differences := own.differences(arm):
        raise ValueError(f'{source} is of another arm: {differences}; identify one arm at a time')
    names = [each.name for each in fields(ArmIdentity)]
    return ArmIdentity(**{name: getattr(arm, name) or getattr(own, name) for name in names})
