# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The demo's picture of the planned and the executed path; needs matplotlib."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np

from ur_cartesian_driver.motion.geometry.arrays import Floats
from ur_cartesian_driver.preview.pictures import pyplot


def draw(record: Path, drawing: Path, title: str) -> None:
    """
    Draw recorded feedback.

    :param record: JSON lines with ``stamp`` [s], the positions ``desired`` and ``actual`` [m], and
        ``speed`` [m/s].
    :param drawing: the picture; its suffix decides the format.
    :raises OSError: matplotlib is not installed, or the file cannot be written.
    """
    plt = pyplot()
    rows = [json.loads(line) for line in record.read_text(encoding='utf-8').splitlines()]
    time = np.array([row['stamp'] for row in rows])
    time -= time[0]
    planned, actual = (np.array([row[key] for row in rows]) for key in ('desired', 'actual'))
    figure = plt.figure(figsize=(11.0, 5.0), layout='constrained')
    figure.suptitle(title)
    _path(figure.add_subplot(1, 2, 1, projection='3d'), planned, actual)
    deviation = 1000.0 * np.linalg.norm(planned - actual, axis=1)
    _over_time(figure, time, np.array([row['speed'] for row in rows]), deviation)
    figure.savefig(drawing, dpi=110)
    plt.close(figure)


def _path(axes: Any, planned: Floats, actual: Floats) -> None:
    axes.plot(*planned.T, color='tab:gray', linewidth=4.0, alpha=0.5, label='planned')
    axes.plot(*actual.T, color='tab:red', linewidth=1.2, label='executed')
    axes.scatter(*actual[0], color='tab:green', label='start')
    axes.set(xlabel='x [m]', ylabel='y [m]', zlabel='z [m]')
    axes.yaxis.labelpad = 14.0
    axes.set_aspect('equal')
    axes.legend(loc='upper left')


def _over_time(figure: Any, time: Floats, speed: Floats, deviation: Floats) -> None:
    upper, lower = figure.add_subplot(2, 2, 2), figure.add_subplot(2, 2, 4)
    upper.plot(time, speed, color='tab:blue')
    upper.set(ylabel='tool speed [m/s]')
    lower.plot(time, deviation, color='tab:red')
    lower.set(xlabel='time [s]', ylabel='distance from the plan [mm]')
    for axes in (upper, lower):
        axes.grid(alpha=0.3)
