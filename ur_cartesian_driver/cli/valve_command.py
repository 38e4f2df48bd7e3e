# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""``ur-cartesian valve``: lay two beads, ask for two distances, write the dead times."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from datetime import date
from math import isfinite
from pathlib import Path
import shlex
import sys

from ur_cartesian_driver.cli.check_robot import ask
from ur_cartesian_driver.cli.own_driver import ready_driver
from ur_cartesian_driver.cli.valve_beads import BEAD_POINTS, Beads, dead_times, DeadTimes
from ur_cartesian_driver.driver import Driver
from ur_cartesian_driver.goal_files.lead_file import read_leads, write_lead
from ur_cartesian_driver.kinematics.robot_models import robot_model
from ur_cartesian_driver.motion.errors import InvalidGoal, RobotNotReady
from ur_cartesian_driver.motion.events import Progress
from ur_cartesian_driver.motion.goal.goal import OutputKind
from ur_cartesian_driver.motion.goal.leads import Lead
from ur_cartesian_driver.motion.goal.output_names import output_name, parse_output
from ur_cartesian_driver.path import Output
from ur_cartesian_driver.sim.command_line.simulator_options import fields_from

QUESTIONS = ('start', 'end')
WARNING = (
    'The arm will move, and the valve will open. Keep a hand on the emergency stop and everybody '
    'out of reach. The nozzle has to be as high above a test piece as it will be above the work.'
)
HOW_TO_READ = (
    'Read where the beads have their full width: the slow one is thicker, and its round ends '
    'reach farther.'
)
LATER = 'To measure later, press Ctrl-C now, and then run:'
#: Fraction of its planned speed below which the arm counts as slowed down by the slider.
_FULL_SPEED = 0.99


def measure_valve(arguments: argparse.Namespace) -> int:
    """Lay the beads, unless they have been measured, and write the dead times."""
    kind, pin = parse_output(' '.join(arguments.output))
    if kind is OutputKind.STANDARD_ANALOG:
        raise ValueError('output is analog, but valve switches the output; name a digital one.')
    # A wrong name or output is refused before beads are laid; the times follow from the beads.
    lead = Lead(name=arguments.name, output=kind, pin=pin, open=0.0, close=0.0)
    file = Path(arguments.lead_file)
    if file.exists():
        read_leads(file)  # so that a wrong file is refused before beads are laid
    beads = Beads(**fields_from(arguments, Beads))
    if arguments.measured:
        shifts = arguments.measured
    elif sys.stdin.isatty():
        with ready_driver(arguments) as driver:
            if not lay_beads(driver, beads, Output(kind, pin), ask):
                print('No bead was laid.')
                return 1
        print(f'{HOW_TO_READ}\n{LATER}\n{later_command(arguments)}')
        shifts = [ask_distance(question, input) for question in QUESTIONS]
    else:
        raise ValueError(
            'valve asks before it moves the arm, so it needs a terminal; --measured takes the '
            'figures of beads that have been laid.'
        )
    times = dead_times(
        *(1e-3 * shift for shift in shifts),
        slow=beads.slow,
        fast=beads.fast,
        reading=arguments.ruler,
        cycle=robot_model(arguments.ur_type).control_cycle,
    )
    today = date.today().isoformat()
    lead = replace(lead, open=times.open, close=times.close, date=today)
    # Printed first, because it may be impossible to write the file.
    print(report(arguments.name, times, beads.fast))
    write_lead(file, lead)
    print(
        f'written to {file}: a driver with lead_file:={file.resolve()} uses it for outputs with '
        f'"lead: {lead.name}"'
    )
    return 0


def lay_beads(driver: Driver, beads: Beads, valve: Output, agrees: Callable[[str], bool]) -> bool:
    """
    Lay the beads from the tool's present pose, if the person agrees; return whether they were.

    :raises DriverError: the path was refused or not completed, or a bead cannot have its speed.
    :raises RobotNotReady: the robot reports no state, or its slider is below 100 % before or
        while the beads are laid.
    """
    state = driver.rest_state
    if state is None:
        raise RobotNotReady('The robot does not report its state.')
    if state.target_speed_fraction < _FULL_SPEED:
        raise RobotNotReady(
            f'The speed slider is at {state.target_speed_fraction:.0%}: set it to 100 %.'
        )
    plan = driver.plan(beads.path(state.actual_tcp_pose, valve))
    for stretch in plan.find_slow_stretches():
        if any(stretch.first <= point <= stretch.last for point in BEAD_POINTS):
            raise InvalidGoal(
                'A bead',
                f'would be laid at {stretch.lowest:.3g} of {stretch.asked:.3g} m/s, because '
                f'{stretch.reason}',
                'ask for less speed',
            )
    question = (
        f'{WARNING}\nTwo beads of {1e3 * beads.length:g} mm along the {beads.along} axis of the '
        f'tool, {1e3 * beads.beside:g} mm apart, from where it is: at {1e3 * beads.slow:g} mm/s, '
        f'then at {1e3 * beads.fast:g} mm/s. The arm needs {1e3 * beads.span:.0f} mm in that '
        f'direction. The valve is {output_name(valve.kind, valve.pin)}.'
    )
    if not agrees(question):
        return False
    speeds: dict[int, list[float]] = {point: [] for point in BEAD_POINTS}

    def watch(progress: Progress) -> None:
        if progress.waypoint in speeds:
            speeds[progress.waypoint].append(progress.speed_scaling)

    driver.start(plan, watch).result().raise_for_error()
    _check_speeds(speeds.values())
    return True


def _check_speeds(beads: Iterable[Sequence[float]]) -> None:
    """Refuse the beads if one was laid below full speed, or without a report of the speed."""
    for speeds in beads:
        if not speeds:
            raise RobotNotReady(
                'The robot did not report its speed during a bead: lay longer beads (--length).'
            )
        if min(speeds) < _FULL_SPEED:
            raise RobotNotReady(
                f'The arm moved at {100.0 * min(speeds):.0f} % of its speed: set the slider to '
                '100 %, and lay the beads again.'
            )


def later_command(arguments: argparse.Namespace) -> str:
    """Return the command that takes the distances later, for beads laid with these arguments."""
    speeds = [f'--slow={arguments.slow:g}', f'--fast={arguments.fast:g}']
    beads = [f'--length={1e3 * arguments.length:g}mm', f'--ruler={1e3 * arguments.ruler:g}mm']
    words = [arguments.name, '--output', *arguments.output, *speeds, *beads]
    files = [f'--ur-type={arguments.ur_type}', f'--lead-file={arguments.lead_file}']
    command = shlex.join([*words, *files])
    return f'ur-cartesian valve {command} --measured BEGINS ENDS'


def ask_distance(which: str, read: Callable[[str], str]) -> float:
    """Ask a person how far past the slow bead the fast one starts or ends [mm]."""
    while True:
        answer = read(
            f'How far behind the {which} of the slow bead does the fast one {which} [mm]? '
        )
        try:
            distance = float(answer.replace(',', '.').removesuffix('mm'))
        except ValueError:
            distance = float('nan')
        if isfinite(distance):
            return distance
        print(f'{answer!r} is no number; give millimetres, like 10.8')


def report(name: str, times: DeadTimes, speed: float) -> str:
    """Return the dead times, and their uncertainty in a bead at a speed [m/s]."""
    return (
        f'{name} opens {1e3 * times.open:.1f} ms after its output and closes '
        f'{1e3 * times.close:.1f} ms after it, each +/- {1e3 * times.uncertainty:.1f} ms: '
        f'+/- {1e3 * speed * times.uncertainty:.2f} mm at {1e3 * speed:g} mm/s'
    )
