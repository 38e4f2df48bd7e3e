# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Draw the pictures of doc/identify.md. Needs matplotlib.

::

    python scripts/make_identification_pictures.py move RECORDING  # of a single move
    python scripts/make_identification_pictures.py arms [NUMBER]   # of hidden arms; 100 take long
"""

from __future__ import annotations

from collections import Counter
from dataclasses import asdict
from importlib import import_module
from pathlib import Path
import sys

from make_execution_pictures import save_vectors
from matplotlib.figure import Figure
import numpy as np

from ur_cartesian_driver.identification.arm_samples import read_samples
from ur_cartesian_driver.identification.estimators import Result, Unknown
from ur_cartesian_driver.identification.identify import identify
from ur_cartesian_driver.identification.moves import find_moves
from ur_cartesian_driver.identification.profile import Profile

CHECKOUT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(CHECKOUT / 'test' / 'support'))
GREY, RED, BLUE = '#bbbbbb', '#c83c32', '#1e6edc'


def draw_move(recording: Path) -> Figure:
    """Draw the speeds of a recorded line and of its fitted profile, and the residual travel."""
    (move,) = find_moves(read_samples(recording))
    profile, travel = move.profile, move.leading
    if not isinstance(profile, Profile) or travel is None or move.travel.line is None:
        raise SystemExit(f'{recording} has no line of known profile')
    time = move.rows[0] - move.rows[0][0]
    left = profile.fit.residuals
    figure = Figure(figsize=(8.0, 4.4))
    top, bottom = figure.subplots(2, 1, sharex=True, height_ratios=(2, 1))
    middle = 0.5 * (time[1:] + time[:-1])
    for way, colour, width, label in (
        (travel, GREY, 4.0, 'recorded'),
        (travel - left, RED, 1.0, 'fitted'),
    ):
        speed = 1e3 * np.diff(way) / np.diff(time)
        top.plot(middle, speed, color=colour, linewidth=width, label=label)
    top.set(ylabel='speed [mm/s]')
    top.legend(loc='upper right')
    bottom.plot(time, 1e6 * left, color=BLUE, linewidth=1.0)
    bottom.set(ylabel='left over [µm]', xlabel='time [s]')
    return figure


def draw_arms(number: int) -> Figure:
    """Draw the share of intervals that contain the true law, for a number of hidden arms."""
    hidden_arm, hidden_servo, random_cases = map(
        import_module, ('hidden_arm', 'hidden_servo', 'random_cases')
    )
    inside: Counter[str] = Counter()
    found: Counter[str] = Counter()

    def count(name: str, true: float, result: Result) -> None:
        if not isinstance(result, Unknown):
            assert result.interval is not None
            found[name] += 1
            inside[name] += result.interval[0] <= true <= result.interval[1]

    for i in range(number):
        random = random_cases.random_of('hidden arm', i)
        laws = hidden_arm.Laws.drawn(random)
        results = identify(*hidden_arm.standard_experiments(laws, random)).results
        for name, true in asdict(laws).items():
            count(name, true, results[name])
        motion = hidden_servo.drawn_motion(random_cases.random_of('hidden servo', i))
        results = identify([motion.samples], [motion.command]).results
        count('servo_gain_factor', motion.law.gain_factor, results['servo_gain_factor'])
        count(
            'servo_lookahead_factor',
            motion.law.lookahead_factor,
            results['servo_lookahead_factor'],
        )
    names = list(found)[::-1]
    shares = np.array([100.0 * inside[name] / found[name] for name in names])
    figure = Figure(figsize=(8.0, 5.4))
    axis = figure.subplots()
    axis.axvspan(92.0, 98.0, color=GREY, alpha=0.4, label='92 to 98 %')
    axis.axvline(95.0, color='black', linewidth=0.8)
    # The deviation of a share from 95 % that chance alone exceeds in 5 % of the cases.
    chance = [196.0 * np.sqrt(0.95 * 0.05 / found[name]) for name in names]
    axis.errorbar(shares, names, xerr=chance, fmt='o', color=BLUE, elinewidth=0.8, markersize=4)
    axis.set(
        xlim=(84.0, 100.5), xlabel=f'intervals that contain the true law, of {number} arms [%]'
    )
    axis.legend(loc='lower left')
    return figure


def main(kind: str, argument: str = '100') -> None:
    """Draw and save the picture of a move or of hidden arms."""
    figure = draw_move(Path(argument)) if kind == 'move' else draw_arms(int(argument))
    save_vectors(figure, CHECKOUT / 'doc' / f'identify_{kind}.svg')


if __name__ == '__main__':
    main(*sys.argv[1:])
