# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Draw the experiments of the servoj guide, run with the simulated controller and this driver.

``test/acceptance/test_servo_experiments.py`` runs the same experiments. Needs matplotlib::

    python scripts/draw_servo_experiments.py [doc/servo_experiments.png]
"""

from __future__ import annotations

from pathlib import Path
import sys

import matplotlib

matplotlib.use('Agg')
from matplotlib import pyplot as plt

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / 'test' / 'support'))

from servo_experiments import buffered, Result, unbuffered  # noqa: E402  # found by the path

SECONDS = 3.0
#: Joints of the guide's plots.
JOINTS = {1: 'shoulder lift', 2: 'elbow', 3: 'wrist 1'}


def main(path: Path) -> None:
    """Run all experiments and draw them."""
    runs: list[tuple[str, Result]] = []
    for slider in (1.0, 0.5):
        runs.append((f'no buffer, slider {slider:.0%}', unbuffered(slider, SECONDS)))
        runs.append((f'buffer, slider {slider:.0%}', buffered(slider, SECONDS)))
    opened = buffered(0.5, SECONDS, closed_loop=False)
    figure, axes = plt.subplots(len(JOINTS) + 1, len(runs), figsize=(15, 10), sharex=True)
    for column, (title, run) in zip(axes.T, runs, strict=True):
        column[0].set_title(f'{title}\n{run.skipped} of {run.written} set-points skipped')
        for axis, (joint, name) in zip(column, JOINTS.items(), strict=False):
            axis.plot(run.times, run.wanted[:, joint], color='magenta', label='set-points')
            axis.plot(run.times, run.actual[:, joint], color='tab:blue', label='arm')
            axis.set_ylabel(f'{name} [rad]')
        column[-1].plot(run.times, run.lag, color='tab:green', label='loop closed')
        if title == 'buffer, slider 50%':
            column[-1].plot(opened.times, opened.lag, color='tab:red', label='loop opened')
            column[-1].legend()
        column[-1].set_ylabel('motion time under way [s]')
        column[-1].set_xlabel('time [s]')
    axes[0][0].legend()
    figure.tight_layout()
    figure.savefig(path, dpi=70)


if __name__ == '__main__':
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else ROOT / 'doc' / 'servo_experiments.png')
