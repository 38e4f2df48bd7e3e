# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
``ur-cartesian plot``: draw a recorded motion.

On the left, the picture shows the planned and the executed path. On the right, it shows over time:
deviation from the plan, tool speed, effective speed, and points, outputs and events.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

import numpy as np

from ur_cartesian_driver.cli.progress import timed
from ur_cartesian_driver.driver.recordings.recording import Recording
from ur_cartesian_driver.driver.recordings.recording_folder import newest_recording
from ur_cartesian_driver.driver.recordings.recording_format import OUTPUT_NAMES
from ur_cartesian_driver.motion.geometry.arrays import Floats
from ur_cartesian_driver.motion.state.rtde_state import RuntimeState
from ur_cartesian_driver.preview.pictures import pyplot

#: Largest number of packets in a picture.
MAX_ROWS = 6000
#: Largest number of points that are numbered.
MAX_NUMBERED_POINTS = 12
_AXES = 'xyz'
#: Weights of the path's extents in x, y and z when two of them are chosen for the flat view: the
#: view is from above, unless the path is mainly vertical.
_VIEW_WEIGHTS = np.array([1.0, 1.0, 0.4])
_PLANNED, _TARGET, _ACTUAL, _MARK = '#9aa5b1', '#1f77b4', '#c8372d', '#2a9d5c'
#: Events that are marked in all charts.
_MARKED_EVENTS = {'cancel': '#e08a00', 'safety': '#c8372d', 'robot': '#c8372d', 'end': '#333333'}


def plot(arguments: argparse.Namespace) -> int:
    """
    Draw the named recording, or the newest one in the named directory.

    :raises ValueError: the recording has no packets.
    """
    file = newest_recording(Path(arguments.file))
    picture = Path(arguments.output or file.with_suffix('.png'))
    recording = Recording.load(file, MAX_ROWS)
    if not len(recording.time):
        raise ValueError(f'{file} has no packets, so there is nothing to draw')
    with timed('drawing'):
        draw(recording, picture)
    print(f'picture: {picture}')
    return 0


# ---- the picture ----------------------------------------------------------------------------


def draw(recording: Recording, picture: Path, title: str = '') -> None:
    """
    Draw a recording.

    :param picture: the file to write; its suffix decides the format.
    :raises OSError: matplotlib is not installed, or the picture cannot be written.
    """
    plt = pyplot()
    with plt.rc_context(
        {
            'font.size': 9.0,
            'axes.spines.top': False,
            'axes.spines.right': False,
            'axes.grid': True,
            'grid.alpha': 0.25,
            'legend.frameon': False,
            'legend.fontsize': 8.0,
            'axes.titlesize': 9.0,
            'path.simplify_threshold': 0.5,
        }
    ):
        figure = plt.figure(figsize=(12.0, 7.2), layout='constrained')
        figure.suptitle(title or _title(recording), fontsize=11.0)
        left, right = figure.subfigures(1, 2, squeeze=False, width_ratios=(1.0, 1.35))[0]
        _draw_path(left, recording)
        _draw_time(right, recording)
        figure.savefig(picture, dpi=100)
        plt.close(figure)


def _title(recording: Recording) -> str:
    metadata = recording.metadata
    outcome = metadata['outcome']
    ended = f'{outcome["name"]}: {outcome["text"]}' if outcome else 'the recording was cut off'
    return (
        f'{metadata["robot"].get("model") or "robot"}, {metadata["execution"]}, '
        f'{metadata["points"]} point{"" if metadata["points"] == 1 else "s"}, '
        f'{metadata["created"][:19].replace("T", " ")} UTC\n{ended[:150]}'
    )


def _draw_path(figure: Any, recording: Recording) -> None:
    """Draw the path in space, and flat: from above, or from the side if it is mainly vertical."""
    recording = recording.on_the_part()
    planned, actual = recording.planned_pose[:, :3], recording.actual_pose[:, :3]
    space, flat = figure.add_subplot(2, 1, 1, projection='3d'), figure.add_subplot(2, 1, 2)
    low, high = (side(np.vstack((planned, actual)), axis=0) for side in (np.min, np.max))
    extent = high - low
    a, b = sorted(np.argsort(extent * _VIEW_WEIGHTS)[1:].tolist())
    for axes, columns in ((space, [0, 1, 2]), (flat, [a, b])):
        axes.plot(
            *planned[:, columns].T,
            color=_PLANNED,
            linewidth=4.0,
            alpha=0.6,
            solid_capstyle='round',
            label='planned',
        )
        axes.plot(*actual[:, columns].T, color=_ACTUAL, linewidth=1.0, label='executed')
        axes.scatter(
            *recording.points[:, columns].T, s=12.0, color='#333333', zorder=3, label='points'
        )
    flat.scatter(
        *_switch_places(recording)[:, [a, b]].T,
        s=40.0,
        marker='d',
        color=_MARK,
        zorder=4,
        label='an output switched',
    )
    if len(recording.points) <= MAX_NUMBERED_POINTS:
        for number, point in enumerate(recording.points):
            flat.annotate(str(number), point[[a, b]], xytext=(4, 4), textcoords='offset points')
    space.set(xlabel='x [m]', ylabel='y [m]', zlabel='z [m]')
    space.tick_params(labelsize=7.0, pad=0.0)
    space.yaxis.labelpad = space.zaxis.labelpad = 8.0
    space.locator_params(nbins=4)
    span = np.maximum(extent, 0.25 * max(extent.max(), 1e-3))
    for axis, name in enumerate(_AXES):
        middle = 0.5 * (low[axis] + high[axis])
        getattr(space, f'set_{name}lim')(middle - 0.6 * span[axis], middle + 0.6 * span[axis])
    space.set_box_aspect(span, zoom=0.85)
    flat.set(xlabel=f'{_AXES[a]} [m]', ylabel=f'{_AXES[b]} [m]')
    flat.set_aspect('equal', adjustable='datalim')
    handles, labels = flat.get_legend_handles_labels()
    shown = len(handles) if len(_switch_places(recording)) else -1
    figure.legend(handles[:shown], labels[:shown], loc='upper left', ncols=4)


def _switch_places(recording: Recording) -> Floats:
    """Return the tool poses at which the robot reported a switched digital output."""
    digital = recording.digital_output
    changed = (digital[1:] != digital[:-1]) & (digital[:-1] >= 0)
    return np.asarray(recording.actual_pose[1:][changed])


def _draw_time(figure: Any, recording: Recording) -> None:
    """Draw all quantities over time."""
    rows = _timeline(recording)
    deviation, speed, scaling, line = figure.subplots(
        4, 1, sharex=True, height_ratios=(1.0, 1.0, 0.8, 0.35 + 0.16 * len(rows))
    )
    _draw_deviation(deviation, recording)
    target_speed = np.linalg.norm(recording.target_twist[:, :3], axis=1)
    _plot_target_and_tool(speed, recording.time, target_speed, recording.tool_speed)
    speed.set_ylabel('tool speed\n[m/s]')
    speed.set_ylim(bottom=0.0)
    _draw_scaling(scaling, recording)
    _draw_timeline(line, recording, rows)
    line.set_xlabel('time [s]')
    for axes in (deviation, speed, scaling):
        for at, kind, _ in recording.events:
            if kind in _MARKED_EVENTS:
                axes.axvline(at, color=_MARKED_EVENTS[kind], linewidth=0.8, linestyle=':')


def _plot_target_and_tool(axes: Any, time: Any, target: Any, tool: Any) -> None:
    axes.plot(time, target, color=_TARGET, linewidth=2.4, alpha=0.5, label="controller's target")
    axes.plot(time, tool, color=_ACTUAL, linewidth=0.9, label='tool')


def _draw_deviation(axes: Any, recording: Recording) -> None:
    deviation = recording.deviation()
    _plot_target_and_tool(
        axes, recording.time, 1e3 * deviation.target_position, 1e3 * deviation.position
    )
    axes.set_ylabel('distance from\nthe plan [mm]')
    axes.set_ylim(0.0, 1.15 * max(0.05, 1e3 * np.nan_to_num(deviation.position).max()))
    axes.legend(loc='upper right', ncols=2)


def _draw_scaling(axes: Any, recording: Recording) -> None:
    time = recording.time
    axes.plot(
        time, 100.0 * recording.slider, color=_PLANNED, linewidth=3.0, alpha=0.6, label='slider'
    )
    axes.plot(
        time,
        100.0 * recording.effective_speed,
        color='#333333',
        linewidth=1.0,
        label='effective speed',
    )
    axes.set_ylabel('speed\n[%]')
    axes.set_ylim(0.0, 108.0)
    lags = bool(np.isfinite(recording.lag).any())
    if lags or recording.metadata.get('keep_open'):
        other = axes.twinx()
        if lags:
            other.plot(time, 1e3 * recording.lag, color=_ACTUAL, linewidth=0.9, label='lag')
        other.plot(time, 1e3 * recording.buffered, color=_TARGET, linewidth=0.9, label='buffered')
        other.set_ylabel('[ms]')
        other.set_ylim(bottom=0.0)
        other.grid(visible=False)
        other.spines['right'].set_visible(True)
        other.legend(loc='lower right', ncols=2)
    axes.legend(loc='lower left', ncols=2)


def _timeline(recording: Recording) -> list[tuple[str, Floats]]:
    """Return the rows of the timeline, with values from 0 to 1: outputs, program pauses."""
    digital, rows = recording.digital_output, []
    for bit, name in enumerate(OUTPUT_NAMES):
        is_on = (digital >= 0) & (digital >> bit & 1 > 0)
        if is_on.any():
            rows.append((name.replace(' digital output', ''), is_on.astype(np.float64)))
    for channel, values in enumerate(np.nan_to_num(recording.analog_output).T):
        if np.ptp(values) > 0.0:
            rows.append((f'analog {channel}, to {values.max():.3g} A or V', values / values.max()))
    paused = recording.runtime_state == RuntimeState.PAUSED
    return [*rows, ('paused', paused.astype(np.float64))] if paused.any() else rows


def _draw_timeline(axes: Any, recording: Recording, rows: list[tuple[str, Floats]]) -> None:
    """Draw points, outputs and pauses as rows of one chart."""
    points = [
        (at, text.rsplit(' ', 1)[-1]) for at, kind, text in recording.events if kind == 'point'
    ]
    axes.plot([at for at, _ in points], [0.0] * len(points), '|', color='#333333', markersize=9.0)
    if len(points) <= MAX_NUMBERED_POINTS:
        for at, number in points:
            axes.annotate(
                number, (at, 0.0), xytext=(3, 2), textcoords='offset points', fontsize=7.0
            )
    for height, (name, share) in enumerate(rows, start=1):
        axes.fill_between(
            recording.time,
            height - 0.3,
            height - 0.3 + 0.6 * share,
            step='post',
            color='#e08a00' if name == 'paused' else _MARK,
            linewidth=0.0,
        )
    axes.set_yticks(range(len(rows) + 1), ['to point', *(name for name, _ in rows)])
    axes.set_ylim(-0.6, len(rows) + 0.6)
    for at, kind, text in recording.events:
        if kind in _MARKED_EVENTS:
            axes.axvline(at, color=_MARKED_EVENTS[kind], linewidth=0.8, linestyle=':')
            if kind != 'end':
                axes.annotate(
                    text[:60] or kind,
                    (at, len(rows) + 0.2),
                    xytext=(3, 0),
                    textcoords='offset points',
                    fontsize=7.0,
                    color=_MARKED_EVENTS[kind],
                )
