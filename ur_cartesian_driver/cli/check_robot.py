# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The command ``check-robot``: observe a robot, and run the experiments that a person allows."""

from __future__ import annotations

import argparse
import asyncio
from collections.abc import Callable, Iterator, Mapping, Sequence
import contextlib
from datetime import date
import json
from pathlib import Path
import re
import socket
import sys
from typing import Any
from xml.etree import ElementTree

from ur_cartesian_driver.motion.errors import DriverError
from ur_cartesian_driver.program.render import has_feature
from ur_cartesian_driver.protocol.rtde.rtde_packages import ControllerVersion
from ur_cartesian_driver.resources import share_path
from ur_cartesian_driver.robot.check.experiment_runner import run_experiment
from ur_cartesian_driver.robot.check.experiments import Experiment, EXPERIMENTS
from ur_cartesian_driver.robot.check.finding import (
    Finding,
    problem,
    RobotAddress,
    skipped,
    Verdict,
)
from ur_cartesian_driver.robot.check.motion_samples import MotionSamples
from ur_cartesian_driver.robot.check.observations import observe
from ur_cartesian_driver.robot.check.program_run import motion_refusal, Surprise
from ur_cartesian_driver.sim.command_line.simulator_options import fields_from

#: Exit status: nothing answers at the address; something keeps the driver from working.
UNREACHABLE, HAS_PROBLEMS = 3, 1
WARNING = (
    'The arm will move. A hand on the emergency stop, nobody in reach, 10 cm of free space around '
    'the tool.'
)


def check_robot(arguments: argparse.Namespace) -> int:
    """Check a robot, write the report, and return the exit status."""
    if arguments.with_motion and not sys.stdin.isatty():
        raise ValueError('--with-motion asks before each motion, so it needs a terminal.')
    address = address_of(arguments)
    findings = asyncio.run(observe_and_show(address, arguments.seconds))
    recordings: dict[str, MotionSamples] = {}
    try:
        if arguments.with_motion:
            observed = tuple(findings)
            for finding in experiment_findings(address, observed, ask, recordings):
                findings.append(finding)
    finally:  # Ctrl-C keeps the findings so far
        path, found = Path(arguments.report), report(findings, recordings, address.host)
        path.write_text(json.dumps(_without_nan(found)), encoding='utf-8')
        print(f'\nreport: {path}')
    return exit_status(findings)


async def observe_and_show(address: RobotAddress, seconds: float) -> list[Finding]:
    """
    Return the findings about a robot; print each as it comes.

    :param seconds: duration of the recording of the RTDE stream [s].
    """
    findings = []
    async for finding in observe(address, seconds):
        show(finding)
        findings.append(finding)
    return findings


def experiment_findings(
    address: RobotAddress,
    observed: Sequence[Finding],
    agrees: Callable[[str], bool],
    recordings: dict[str, MotionSamples],
) -> Iterator[Finding]:
    """
    Carry out the experiments that a person allows; yield the findings of each.

    :param agrees: asks the person about a motion, and returns whether the person agrees.
    :param recordings: receives the samples of each experiment.
    """
    if problems := [f.check for f in observed if f.verdict is Verdict.PROBLEM]:
        reason = f'No motion, because of {", ".join(problems)}'
        yield from (skipped(experiment.check, reason) for experiment in EXPERIMENTS)
        return
    print(f'\n{WARNING}')
    for experiment in EXPERIMENTS:
        if _is_known_by(experiment, observed):
            found = _experiment(address, experiment, agrees, recordings)
        else:
            found = [skipped(experiment.check, 'The software is not known to have it')]
        for finding in found:
            show(finding)
        yield from found


def _is_known_by(experiment: Experiment, observed: Sequence[Finding]) -> bool:
    """Return whether the robot's software supports an experiment, or its version is unknown."""
    if not experiment.feature:
        return True
    versions = [finding.data['version'] for finding in observed if finding.check == 'software']
    return not versions or has_feature(
        experiment.feature, ControllerVersion.parse(str(versions[0])).release
    )


def _experiment(
    address: RobotAddress,
    experiment: Experiment,
    agrees: Callable[[str], bool],
    recordings: dict[str, MotionSamples],
) -> list[Finding]:
    try:
        if refusal := asyncio.run(motion_refusal(address)):
            return [skipped(experiment.check, f'No motion: {refusal}')]
        if not agrees(experiment.motion):
            return [skipped(experiment.check, 'Not wanted')]
        if refusal := asyncio.run(motion_refusal(address)):  # again, after the person's answer
            return [skipped(experiment.check, f'No motion: {refusal}')]
        samples = asyncio.run(run_experiment(address, experiment))
    except (OSError, DriverError, Surprise) as error:
        return [problem(experiment.check, f'Not finished: {error}')]
    recordings[experiment.check] = samples
    return [analyse(samples) for analyse in experiment.analyses]


def address_of(arguments: argparse.Namespace) -> RobotAddress:
    """Return the address of the robot in the options."""
    return RobotAddress(host=arguments.robot_ip, **fields_from(arguments, RobotAddress))


def ask(motion: str) -> bool:
    """Ask on the terminal; any answer other than yes means no, as does the end of the input."""
    try:
        return input(f'\n{motion} Move? [y/N] ').strip().lower() in ('y', 'yes')
    except EOFError:
        print()
        return False


def show(finding: Finding) -> None:
    """Print a finding as one line."""
    print(f'{finding.verdict.value:<8} {finding.check:<15} {finding.text}', flush=True)


def exit_status(findings: list[Finding]) -> int:
    """Return 0 if the driver can work, 1 if something prevents that, 3 if nothing answers."""
    problems = {finding.check for finding in findings if finding.verdict is Verdict.PROBLEM}
    if {'rtde', 'primary'} <= problems:
        return UNREACHABLE
    return HAS_PROBLEMS if problems else 0


def report(
    findings: Sequence[Finding], recordings: Mapping[str, MotionSamples], host: str
) -> dict[str, Any]:
    """
    Return the report for the maintainers, without addresses, serial number and program names.

    :param host: name or address of the robot.
    """
    names = _names_of_addresses(host)
    return {
        'format': 1,
        'driver': ElementTree.parse(share_path() / 'package.xml').findtext('version'),
        'date': date.today().isoformat(),
        'findings': [
            {
                'check': finding.check,
                'verdict': finding.verdict.value,
                'text': _renamed(finding.text, names),
                'data': dict(finding.data),
            }
            for finding in findings
        ],
        'recordings': {check: samples.as_lists() for check, samples in recordings.items()},
    }


def _names_of_addresses(host: str) -> dict[str, str]:
    """Return the report's names for the addresses of the robot and of this computer."""
    names = {}
    with contextlib.suppress(OSError), socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.connect((host, 9))  # finds the route to the robot, and sends nothing
        names[probe.getsockname()[0]] = 'COMPUTER'
        names[probe.getpeername()[0]] = 'ROBOT'
    return names | {host: 'ROBOT'}


def _renamed(text: str, names: Mapping[str, str]) -> str:
    for old, new in names.items():
        text = re.sub(rf'(?<![\w.-]){re.escape(old)}(?![\w-])', new, text)
    return text


def _without_nan(value: Any) -> Any:
    """Return a value with None in place of NaN (not reported), because JSON has no NaN."""
    if isinstance(value, dict):
        return {name: _without_nan(part) for name, part in value.items()}
    if isinstance(value, list | tuple):
        return [_without_nan(part) for part in value]
    return None if value != value else value
