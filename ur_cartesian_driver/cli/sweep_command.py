# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""``ur-cartesian sweep``: plan one goal at many places, on several models and calibrations."""

from __future__ import annotations

import argparse
from concurrent.futures import ProcessPoolExecutor
import csv
from math import prod
from multiprocessing import get_context
from pathlib import Path as FilePath
import sys

from ur_cartesian_driver.cli.argument_types import MAX_VARIANTS
from ur_cartesian_driver.cli.plan_commands import GoalPlanning
from ur_cartesian_driver.cli.progress import counted
from ur_cartesian_driver.path import Path
from ur_cartesian_driver.sweep import (
    at_places,
    calibrated,
    COLUMNS,
    csv_rows,
    draw,
    heat_map,
    on_models,
    summary,
    sweep,
    table,
    Variant,
)

#: Quantities that a map can show.
MARGINS = tuple(COLUMNS)


def sweep_goal(arguments: argparse.Namespace) -> int:
    """Print the results of all variants, or write them; the status is 0 if all of them pass."""
    variants = variants_of(arguments)
    count = arguments.processes
    with counted('variants', len(variants)) as one_done:
        if count:
            with ProcessPoolExecutor(count, mp_context=get_context('forkserver')) as pool:
                results = sweep(variants, pool, one_done)
        else:
            results = sweep(variants, on_result=one_done)
    if arguments.output:
        with open(arguments.output, 'w', encoding='utf-8', newline='') as file:
            csv.writer(file).writerows(csv_rows(results))
        print(f'table: {arguments.output}', file=sys.stderr)
    else:
        print(table(results))
    if shown := heat_map(results, arguments.margin):
        print(shown)
    if arguments.picture:
        draw(results, FilePath(arguments.picture))
        print(f'picture: {arguments.picture}', file=sys.stderr)
    print(summary(results))
    return 0 if all(result.passes for result in results) else 1


def variants_of(arguments: argparse.Namespace) -> list[Variant]:
    """
    Return the variants of a command line.

    :raises ValueError: there are too many variants; or a calibration is given for several models,
        or with --monte-carlo.
    """
    models = arguments.model
    offsets = {name: getattr(arguments, name) for name in ('x', 'y', 'z', 'rz')}
    count = prod(map(len, offsets.values())) * max(1, len(models)) * max(1, arguments.monte_carlo)
    if count > MAX_VARIANTS:
        raise ValueError(f'the sweep has {count} variants; give {MAX_VARIANTS} at most')
    if arguments.calibration or arguments.calibration_seed is not None:
        if len(models) > 1:
            raise ValueError('a calibration belongs to one arm; give one model')
        if arguments.monte_carlo:
            raise ValueError(
                '--monte-carlo draws calibrations of its own; leave --calibration and '
                '--calibration-seed out'
            )
    planning = GoalPlanning(arguments, model=models[0] if models else '')
    variant = Variant(
        goal=Path.from_message(planning.message),
        arm=planning.arm,
        start=planning.state.actual_q,
        T_flange_tcp=planning.state.T_flange_tcp,
        options=planning.options,
        frames=planning.frames,
    )
    variants = at_places(variant, **offsets)
    if len(models) > 1:
        variants = on_models(variants, models)
    if arguments.monte_carlo:
        variants = calibrated(variants, arguments.monte_carlo, arguments.seed)
    return variants
