# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Plan one goal in many variants: at other places, on other models, on arms that deviate at random.

::

    places = at_places(Variant(goal=path), x=(-0.1, 0.0, 0.1), y=(0.0, 0.1))
    results = sweep(calibrated(places, 20, seed=1))
    print(table(results))
    print(heat_map(results))
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import (
    as_completed,
    BrokenExecutor,
    Executor,
    Future,
    ProcessPoolExecutor,
)
from dataclasses import dataclass, field, replace
from itertools import product
from math import inf, isfinite, nan
import multiprocessing
import operator
import os
from pathlib import Path as FilePath
from typing import Any, TypeAlias

import numpy as np

from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.kinematics.robot_models import robot_model
from ur_cartesian_driver.motion.errors import ErrorCode, GoalRefused
from ur_cartesian_driver.motion.geometry.pose import (
    IDENTITY,
    multiply,
    Pose,
    quaternion_from_rotation_vector,
)
from ur_cartesian_driver.motion.geometry.vectors import add, Vector6
from ur_cartesian_driver.motion.goal.goal import Goal
from ur_cartesian_driver.motion.goal.known_frames import ArmSnapshot, Frames
from ur_cartesian_driver.motion.plan.plan import Plan
from ur_cartesian_driver.motion.plan.primitive import MoveJ, OptimoveJ
from ur_cartesian_driver.path import Path
from ur_cartesian_driver.planning import plan, PlanningOptions
from ur_cartesian_driver.planning.preflight.clearance import Clearance
from ur_cartesian_driver.planning.preflight.tightest_margins import (
    joint_limit_distances,
    singularity_distance_rows,
    SINGULARITY_MEASURES,
)
from ur_cartesian_driver.planning.stop_prediction import state_at_rest
from ur_cartesian_driver.preview import sample
from ur_cartesian_driver.preview.pictures import pyplot
from ur_cartesian_driver.sim.calibration import random_calibration
from ur_cartesian_driver.sim.simulator_config import HOME

#: Number of instants at which the margins of a plan are measured; least time between them [s].
SAMPLES, MIN_PERIOD = 400, 0.008

#: The value of a quantity in which variants differ: a number [m] or [rad], or a name.
Coordinate: TypeAlias = float | str


@dataclass(frozen=True, slots=True, kw_only=True)
class Variant:
    """A goal, and the arm that it is planned for."""

    #: A goal, or a path whose frames the sweep resolves with ``frames``.
    goal: Goal | Path
    arm: Arm = field(default_factory=lambda: Arm(robot_model('ur5e')))
    #: Joint positions in which the arm rests at the start [rad].
    start: Vector6 = HOME
    #: The active TCP of the arm.
    T_flange_tcp: Pose = IDENTITY
    options: PlanningOptions = field(default_factory=PlanningOptions)
    frames: Frames = field(default_factory=Frames)
    #: Displacement of the goal's frame: x, y, z along the axes of the base [m], and the turn about
    #: an axis through the frame's origin, parallel to the base's z [rad].
    offset: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 0.0)
    #: The quantities in which the variant differs from the others, by name.
    coordinates: Mapping[str, Coordinate] = field(default_factory=dict)


@dataclass(frozen=True, slots=True, kw_only=True)
class Margins:
    """Distances of a planned motion from the limits at which goals are refused; NaN = unknown."""

    #: Smallest distance of any joint from its limits [rad].
    joint_limit: float = nan
    #: Smallest distance from a singularity [rad]; for the shoulder, 0.3 m correspond to 1 rad.
    #: Joint motions are left out; infinite = there are no other motions.
    singularity: float = nan
    #: Unused fraction of the speed limit, for the joint that comes closest to its limit, 0 to 1.
    speed: float = nan
    #: Smallest distance between parts of the arm and its tool, and between these and workspace
    #: planes [m]; infinite = nothing is checked.
    clearance: float = nan


@dataclass(frozen=True, slots=True, kw_only=True)
class SweepResult:
    """The result of planning a variant."""

    variant: Variant
    #: The sentence that refuses the goal; empty = the goal passes.
    refusal: str = ''
    #: The code of the result; None = planning itself failed, which is no verdict on the goal.
    code: ErrorCode | None = ErrorCode.SUCCESSFUL
    margins: Margins = Margins()
    #: Expected time of the motion [s].
    duration: float = nan

    @property
    def passes(self) -> bool:
        """Whether the arm could carry out the goal."""
        return not self.refusal


def at_places(
    variants: Variant | Iterable[Variant],
    x: Sequence[float] = (0.0,),
    y: Sequence[float] = (0.0,),
    z: Sequence[float] = (0.0,),
    rz: Sequence[float] = (0.0,),
) -> list[Variant]:
    """
    Return each variant at all places of a grid around its present place.

    The coordinates of a variant are its total offsets along the axes that have several values.

    :param x: offsets of the goal's frame along the base's x [m]; ``y`` and ``z`` likewise.
    :param rz: turns about an axis through the frame's origin, parallel to the base's z [rad].
    """
    axes = {'x': x, 'y': y, 'z': z, 'rz': rz}
    named = {name for name, values in axes.items() if len(values) > 1}
    found = []
    for variant in _each(variants):
        shown = [name for name in axes if name in named | set(variant.coordinates)]
        for step in product(*(map(float, values) for values in axes.values())):
            place = dict(zip(axes, map(operator.add, variant.offset, step), strict=True))
            found.append(
                replace(
                    variant,
                    offset=(place['x'], place['y'], place['z'], place['rz']),
                    coordinates={**variant.coordinates} | {name: place[name] for name in shown},
                )
            )
    return found


def on_models(variants: Variant | Iterable[Variant], names: Iterable[str]) -> list[Variant]:
    """Return each variant on arms of other models, in their nominal geometry."""
    arms = {name: Arm(robot_model(name)) for name in names}
    return [
        replace(variant, arm=arm, coordinates={**_without_calibration(variant), 'model': name})
        for variant in _each(variants)
        for name, arm in arms.items()
    ]


def _without_calibration(variant: Variant) -> dict[str, Coordinate]:
    return {name: v for name, v in variant.coordinates.items() if name != 'calibration'}


def calibrated(variants: Variant | Iterable[Variant], count: int, seed: int = 0) -> list[Variant]:
    """
    Return each variant on ``count`` arms whose axes deviate at random, as on real arms.

    The flange of such an arm is 1 to 2 mm off its nominal pose; the same seed makes the same arms.
    """
    return [
        replace(
            variant,
            arm=Arm(variant.arm.model, random_calibration(variant.arm.model, seed + i)),
            coordinates={**variant.coordinates, 'calibration': float(seed + i)},
        )
        for variant in _each(variants)
        for i in range(count)
    ]


def _each(variants: Variant | Iterable[Variant]) -> Iterable[Variant]:
    return (variants,) if isinstance(variants, Variant) else variants


def sweep(
    goals: Iterable[Variant | Goal | Path],
    executor: Executor | None = None,
    on_result: Callable[[], object] = lambda: None,
) -> list[SweepResult]:
    """
    Plan goals in parallel, and return their results in the order of the goals.

    A goal that is refused, or whose planning fails, does not affect the others. Neither does a
    goal that ends its process, unless ``executor`` is given: if the executor breaks, all remaining
    goals fail.

    :param goals: variants, or goals and paths for a UR5e in its home position.
    :param executor: runs the planning, and is not shut down; None = a process for each core.
    :param on_result: called whenever a goal is done.
    """
    variants = [g if isinstance(g, Variant) else Variant(goal=g) for g in goals]
    if executor is not None:
        return [
            _failed(variant, found) if isinstance(found, Exception) else found
            for variant, found in zip(
                variants, _gather(executor, variants, on_result), strict=True
            )
        ]
    with _processes(min(len(variants), os.cpu_count() or 1)) as pool:
        found = _gather(pool, variants, on_result)
    results = []
    for variant, result in zip(variants, found, strict=True):
        if isinstance(result, BrokenExecutor):
            # A process that dies breaks the pool, so each remaining goal gets its own process.
            with _processes(1) as pool:
                (result,) = _gather(pool, [variant], lambda: None)
        results.append(_failed(variant, result) if isinstance(result, Exception) else result)
    return results


def _processes(count: int) -> ProcessPoolExecutor:
    # Not forked from this process, which may have threads.
    return ProcessPoolExecutor(max(1, count), mp_context=multiprocessing.get_context('forkserver'))


def _gather(
    executor: Executor, variants: Sequence[Variant], on_result: Callable[[], object]
) -> list[SweepResult | Exception]:
    """Return results in the order of the variants; for a variant that failed, its exception."""
    futures: list[Future[SweepResult] | Exception] = []
    for variant in variants:
        try:
            futures.append(executor.submit(plan_variant, variant))
        except BrokenExecutor as error:
            futures.append(error)
    for _ in as_completed([each for each in futures if isinstance(each, Future)]):
        on_result()
    results: list[SweepResult | Exception] = []
    for future in futures:
        try:
            results.append(future.result() if isinstance(future, Future) else future)
        except Exception as error:
            results.append(error)
    return results


def _failed(variant: Variant, error: Exception) -> SweepResult:
    text = ' '.join(str(error).split()) or 'no reason is given'
    return SweepResult(
        variant=variant, refusal=f'planning failed: {type(error).__name__}: {text}', code=None
    )


def plan_variant(variant: Variant) -> SweepResult:
    """Plan one variant, in a process of the executor."""
    try:
        state = state_at_rest(variant.arm, variant.start, variant.T_flange_tcp)
        goal = variant.goal
        if isinstance(goal, Path):
            goal = goal.goal(variant.frames, ArmSnapshot.of(state))
        *shift, turn = variant.offset
        T = goal.T_base_frame
        goal = replace(
            goal,
            T_base_frame=Pose(
                add(T.position, (shift[0], shift[1], shift[2])),
                multiply(quaternion_from_rotation_vector((0.0, 0.0, turn)), T.quaternion),
            ),
        )
        made = plan(goal, state, variant.arm, variant.options)
        return SweepResult(
            variant=variant, margins=margins_of(made, variant), duration=made.duration
        )
    except GoalRefused as refusal:
        return SweepResult(variant=variant, refusal=str(refusal), code=refusal.code)
    except Exception as error:
        return _failed(variant, error)


def margins_of(made: Plan, variant: Variant) -> Margins:
    """Return the smallest margins on the whole motion, measured at about SAMPLES instants."""
    arm = variant.arm
    period = max(MIN_PERIOD, made.duration / SAMPLES)
    preview = sample(made, arm, variant.T_flange_tcp, period)
    known = np.isfinite(preview.joints).all(axis=1)
    q, time = preview.joints[known], preview.time[known]
    if len(q) < 2:
        return Margins()
    scales = np.array([measure.scale for measure in SINGULARITY_MEASURES])
    singularity = (singularity_distance_rows(arm, q) / scales).min(axis=1)
    # Joint motions are left out, because they can pass through singularities.
    led = ~np.isin(_points_at(made, time), _joint_moves(made))
    rates = np.abs(np.diff(q, axis=0)) / np.diff(time)[:, None]
    T_flange_tcp = variant.T_flange_tcp if made.T_flange_tcp is None else made.T_flange_tcp
    clearance = Clearance(arm, T_flange_tcp, variant.options).check(q, made.start)
    return Margins(
        joint_limit=float(joint_limit_distances(arm, q).min()),
        singularity=float(singularity[led].min()) if led.any() else inf,
        speed=float(1.0 - (rates / np.array(arm.model.max_joint_speed)).max()),
        clearance=clearance.margin,
    )


def _points_at(made: Plan, time: np.ndarray[Any, np.dtype[np.float64]]) -> Any:
    """Return, for each time, the index of the point to which the tool is moving."""
    row = np.searchsorted(made.reference.time, time, side='left')
    return made.reference.point[np.minimum(row, len(made.reference.point) - 1)]


def _joint_moves(made: Plan) -> list[int]:
    return [
        segment.waypoint
        for segment in made.segments
        if isinstance(segment.primitive, MoveJ | OptimoveJ)
    ]


# ---- tables, maps and pictures -----------------------------------------------------------------

#: The titles, with units, of the columns of numbers in a table.
COLUMNS = {
    'joint_limit': 'joint limit [rad]',
    'singularity': 'singularity [rad]',
    'speed': 'speed left [%]',
    'clearance': 'clearance [m]',
    'duration': 'duration [s]',
}


def _value(result: SweepResult, column: str) -> float:
    if column == 'duration':
        return result.duration
    value = float(getattr(result.margins, column))
    return 100.0 * value if column == 'speed' else value


def columns(results: Sequence[SweepResult]) -> dict[str, list[Coordinate]]:
    """Return the table by column: the coordinates, the result, and the margins."""
    names = list(dict.fromkeys(name for r in results for name in r.variant.coordinates))
    return (
        {name: [r.variant.coordinates.get(name, '') for r in results] for name in names}
        | {'result': [r.refusal or 'passes' for r in results]}
        | {title: [_value(r, name) for r in results] for name, title in COLUMNS.items()}
    )


def table(results: Sequence[SweepResult]) -> str:
    """Return a table with a line for each variant, and the refusal at the end of the line."""
    cells = columns(results)
    cells['result'] = cells.pop('result')  # last, as it is long
    texts = [[name, *map(_text, values)] for name, values in cells.items()]
    widths = [max(map(len, column)) for column in texts]
    return '\n'.join(
        '  '.join(
            text if name == 'result' else text.rjust(width)
            for name, text, width in zip(cells, row, widths, strict=True)
        )
        for row in zip(*texts, strict=True)
    )


def summary(results: Sequence[SweepResult]) -> str:
    """Return one line: the number of variants that pass, and the smallest of their margins."""
    passed = [r for r in results if r.passes]
    text = f'{len(passed)} of {len(results)} variants pass'
    if not passed:
        return f'{text}.'
    margins = []
    for name, title in COLUMNS.items():
        if name != 'duration':
            what, unit = title.rstrip(']').split(' [')
            least = np.fmin.reduce([_value(r, name) for r in passed])  # NaN is not known
            margins.append(f'{what} {_text(float(least))} {unit}')
    return f'{text}; smallest margins: {", ".join(margins)}.'


def _text(value: Coordinate) -> str:
    if isinstance(value, str):
        return value
    return f'{value:.4g}' if isfinite(value) else '-'


def _axes(results: Sequence[SweepResult]) -> list[str]:
    """Return the one or two coordinates that have the most values."""
    values: dict[str, set[Coordinate]] = {}
    for result in results:
        for name, value in result.variant.coordinates.items():
            values.setdefault(name, set()).add(value)
    # The calibration comes last, because nobody can choose it.
    return sorted(values, key=lambda name: (name == 'calibration', -len(values[name])))[:2]


def _grid(
    results: Sequence[SweepResult], column: str
) -> tuple[list[str], list[list[Coordinate]], np.ndarray[Any, np.dtype[np.float64]]]:
    """
    Return the axes of a map, their values, and the smallest number of each cell in a column.

    -inf means that a variant of the cell is refused; NaN, that no number of the cell is known.
    """
    names = _axes(results)
    values: list[list[Coordinate]] = [
        sorted({r.variant.coordinates.get(name, '') for r in results}, key=_order)
        for name in names
    ]
    grid = np.full([len(each) for each in values], nan)
    for result in results:
        cell = tuple(
            each.index(result.variant.coordinates.get(name, ''))
            for name, each in zip(names, values, strict=True)
        )
        grid[cell] = np.fmin(grid[cell], _value(result, column) if result.passes else -inf)
    # Rounded, because values that differ only by rounding errors are the same.
    return names, values, np.atleast_2d(np.round(grid.T, 6))


def _order(value: Coordinate) -> tuple[int, Coordinate]:
    return (int(isinstance(value, str)), value)


def heat_map(results: Sequence[SweepResult], column: str = 'singularity') -> str:
    """
    Return a map as text over the two coordinates with the most values; ``x`` = refused.

    The text is empty if the variants have no coordinates.

    :param column: joint_limit, singularity, speed, clearance or duration; each cell shows the
        least value of its variants.
    """
    names, values, grid = _grid(results, column)
    if not names:
        return ''
    labels: list[list[Coordinate]] = [*values, ['']]
    rows = [[_text(value) for value in each] for each in labels[:2]]
    header = [names[0] + (f' / {names[1]}' if len(names) > 1 else ''), *rows[0]]
    lines = [header]
    for label, row in zip(rows[1], grid, strict=True):
        lines.append([label, *('x' if v == -inf else _text(float(v)) for v in row)])
    widths = [max(map(len, cells)) for cells in zip(*lines, strict=True)]
    text = ('  '.join(c.rjust(w) for c, w in zip(line, widths, strict=True)) for line in lines)
    return '\n'.join((f'{COLUMNS[column]}:', *text))


def draw(results: Sequence[SweepResult], picture: FilePath) -> None:
    """
    Draw a heat map of each margin; refused cells stay grey.

    :raises OSError: matplotlib is not installed, or the file cannot be written.
    """
    plt = pyplot()
    figure, charts = plt.subplots(2, 2, figsize=(11.0, 8.0), layout='constrained')
    for chart, (column, title) in zip(charts.flat, COLUMNS.items(), strict=False):
        names, values, grid = _grid(results, column)
        chart.set_title(title)
        chart.set_facecolor('#9aa5b1')
        if not names:
            continue
        shown = chart.imshow(np.where(np.isfinite(grid), grid, nan), origin='lower', aspect='auto')
        figure.colorbar(shown, ax=chart)
        for axis, name, ticks in zip((chart.xaxis, chart.yaxis), names, values, strict=False):
            axis.set_label_text(name)
            axis.set_ticks(*_ticks(ticks))
        if len(names) < 2:
            chart.set_yticks([])
    figure.suptitle(summary(results).split(';')[0].rstrip('.'))
    figure.savefig(picture, dpi=110)
    plt.close(figure)


def _ticks(values: Sequence[Coordinate]) -> tuple[list[int], list[str]]:
    """Return the positions and labels of at most a dozen ticks."""
    every = range(0, len(values), -(-len(values) // 12))
    return list(every), [_text(values[i]) for i in every]


def csv_rows(results: Sequence[SweepResult]) -> Iterator[list[Coordinate]]:
    """Yield the header and the rows of a table for other programs."""
    cells = columns(results)
    yield list(cells)
    yield from map(list, zip(*cells.values(), strict=True))
