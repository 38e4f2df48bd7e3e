# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""``ur-cartesian identify --robot-ip``: run the experiments that a person allows, one by one."""

from __future__ import annotations

import argparse
import asyncio
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
import sys

from ur_cartesian_driver.cli.check_robot import address_of, ask, observe_and_show
from ur_cartesian_driver.identification.arm_samples import ArmSamples, read_samples
from ur_cartesian_driver.identification.law_experiments import (
    LAW_EXPERIMENTS,
    LawExperiment,
    MotionBounds,
)
from ur_cartesian_driver.identification.live_run import (
    power_up,
    ready_state,
    record_experiment,
)
from ur_cartesian_driver.identification.moves import find_moves, join_commands
from ur_cartesian_driver.identification.recorded_calls import MotionCommand, read_commands
from ur_cartesian_driver.motion.errors import DriverError
from ur_cartesian_driver.motion.state.rtde_state import RobotMode, RobotState
from ur_cartesian_driver.motion.twin.twin import ArmIdentity
from ur_cartesian_driver.robot.check.finding import Finding, RobotAddress, Verdict
from ur_cartesian_driver.robot.check.program_run import Surprise
from ur_cartesian_driver.robot.rtde.probe import read_state

#: The file that says how far the experiments came, and the one with the calls behind the moves.
PROGRESS, CALLS = 'experiments.txt', 'calls.script'
WARNING = (
    'The arm will move. A hand on the emergency stop, nobody in reach. Any surprise ends the '
    'experiments; a protective stop is not unlocked.'
)
#: Modes from which the arm can be switched on.
_SWITCHED_OFF = (RobotMode.POWER_OFF, RobotMode.POWER_ON, RobotMode.IDLE)
#: Time for which the robot is observed before it moves [s].
_OBSERVED = 1.0


@dataclass(frozen=True, slots=True, kw_only=True)
class LiveRecordings:
    """
    What the experiments recorded.

    :param surprise: what ended them early, as a clause; '' = nothing did.
    """

    arm: ArmIdentity
    samples: list[ArmSamples]
    commands: list[MotionCommand]
    surprise: str


def record(arguments: argparse.Namespace, asked: ArmIdentity) -> LiveRecordings:
    """
    Run the experiments that are wanted, and return their recordings.

    :param asked: the arm that the options name.
    :raises ValueError: an option is missing, or the robot cannot be used or is another arm.
    """
    if arguments.box is None or arguments.max_speed is None:
        raise ValueError('the arm moves: add --box and --max-speed, within which it has to stay')
    if not (arguments.yes or sys.stdin.isatty()):
        raise ValueError(
            'identify asks before each motion, so it needs a terminal; --yes answers for moves'
        )
    bounds = MotionBounds(
        low=arguments.box[:3], high=arguments.box[3:], max_speed=arguments.max_speed
    )
    folder = Path(arguments.folder)
    folder.mkdir(parents=True, exist_ok=True)
    if (folder / PROGRESS).exists():
        raise ValueError(f'{folder} has the recordings of another run; name another --folder')
    address = address_of(arguments)
    arm = arm_of(asyncio.run(observe_and_show(address, _OBSERVED)), asked)
    print(f'\n{WARNING}')
    wanted = [
        each for each in LAW_EXPERIMENTS if not arguments.only or each.name in arguments.only
    ]
    series = _Series(address, bounds, folder, _answers(arguments.yes), wanted)
    series.run()
    samples, commands = series.usable()
    return LiveRecordings(arm=arm, samples=samples, commands=commands, surprise=series.surprise)


def arm_of(findings: list[Finding], asked: ArmIdentity) -> ArmIdentity:
    """
    Return the arm that was observed.

    :param asked: the arm that the options name; it chooses among models that report one type.
    :raises ValueError: the robot cannot be used, or is another arm.
    """
    if problems := [each for each in findings if each.verdict is Verdict.PROBLEM]:
        raise ValueError(f'no motion, because of {problems[0].check}: {problems[0].text}')
    data = {each.check: each.data for each in findings}
    models = data['model']['models']
    arm = ArmIdentity(
        model=asked.model if asked.model in models else models[0],
        software='.'.join(str(data['software']['version']).split('.')[:3]),
        motion_version=data.get('motion_version', {}).get('motion_version', 0),
    )
    if differences := arm.differences(asked):
        raise ValueError(f'the robot is another arm: {differences}; correct the options')
    return arm


def _answers(yes: bool) -> Callable[[str, bool], bool]:
    """Return the function that answers a question; --yes answers the plain ones."""

    def agrees(question: str, is_plain: bool) -> bool:
        if yes and is_plain:
            print(f'\n{question}')
            return True
        return sys.stdin.isatty() and ask(question)

    return agrees


@dataclass(slots=True)
class _Series:
    """The experiments of one run, and how far they came."""

    address: RobotAddress
    bounds: MotionBounds
    folder: Path
    #: Asks a question, and whether it is plain, so that ``--yes`` answers it.
    agrees: Callable[[str, bool], bool]
    experiments: Sequence[LawExperiment]
    surprise: str = ''
    outcomes: dict[str, str] = field(default_factory=dict)
    #: In which each experiment that was recorded began.
    states: dict[str, RobotState] = field(default_factory=dict)

    def run(self) -> None:
        """Run all that are wanted and possible, up to the first surprise."""
        start: RobotState | None = None
        self._write()
        for experiment in self.experiments:
            try:
                outcome, start = self._one(experiment, start)
            except (OSError, DriverError, Surprise) as error:
                clauses = [str(error).rstrip('.'), *getattr(error, '__notes__', ())]
                self.surprise = '; '.join(clauses)
            except KeyboardInterrupt:
                self.surprise = 'interrupted from the keyboard'
            if self.surprise:
                outcome = f'ended: {self.surprise}'
            self.outcomes[experiment.name] = outcome
            print(f'{experiment.name:<20} {outcome}', flush=True)
            self._write()
            if self.surprise:
                return

    def _power_up(self) -> None:
        """Switch the arm on, if it is off and the person agrees."""
        mode = asyncio.run(read_state(self.address.host, self.address.rtde_port)).robot_mode
        if mode in _SWITCHED_OFF and self.agrees(
            f'The arm is in mode {mode.name}. Switch its power on and release the brakes; it may '
            'sag a little.',
            True,
        ):
            asyncio.run(power_up(self.address))

    def _one(self, experiment: LawExperiment, start: RobotState | None) -> tuple[str, RobotState]:
        if start is None:
            self._power_up()
        state = asyncio.run(ready_state(self.address, start))
        first = start or state
        if refusal := experiment.refusal(state, self.bounds):
            return f'skipped: {refusal}', first
        if not self.agrees(experiment.question, experiment.is_plain):
            return 'skipped: not wanted', first
        state = asyncio.run(ready_state(self.address, first))  # again, after the answer
        self.states[experiment.name] = state
        asyncio.run(
            record_experiment(self.address, experiment, state, self.bounds, self._path(experiment))
        )
        return 'done', first

    def _path(self, experiment: LawExperiment) -> Path:
        return self.folder / f'{experiment.name}.csv.gz'

    def _write(self) -> None:
        """Write how far the experiments came."""
        lines = [
            f'{each.name}: {self.outcomes.get(each.name, "not begun")}\n'
            for each in self.experiments
        ]
        (self.folder / PROGRESS).write_text(''.join(lines), encoding='utf-8')

    def usable(self) -> tuple[list[ArmSamples], list[MotionCommand]]:
        """Return the recordings whose moves are those of their calls, and write the calls."""
        samples: list[ArmSamples] = []
        calls: list[str] = []
        for experiment in self.experiments:
            path = self._path(experiment)
            if not path.exists():
                continue
            try:
                found = read_samples(path)
                moves = find_moves(found)
                number = sum(not move.piece.resumed for move in moves)
                # An experiment that was ended made fewer.
                own = experiment.calls(self.states[experiment.name])[:number]
                if own:
                    join_commands(moves, read_commands('\n'.join(own), CALLS), CALLS)
            except ValueError as error:
                print(f'{path.name} is not used: {error}')
                continue
            samples.append(found)
            calls += own
        text = ''.join(f'{call}\n' for call in calls)
        (self.folder / CALLS).write_text(text, encoding='utf-8')
        return samples, read_commands(text, CALLS) if calls else []
