# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Figures of benchmarks: their layout, percentiles, and timing of functions."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import asdict, dataclass
import gc
import json
from math import floor, isnan, log10
import os
import platform
from time import perf_counter, process_time, strftime
import tracemalloc


@dataclass(frozen=True, slots=True, kw_only=True)
class Figure:
    """One measured value, with a baseline of the same run if there is one."""

    benchmark: str
    name: str
    value: float
    unit: str
    baseline: float | None = None
    #: Name of the baseline.
    than: str = ''
    #: How it was measured, in a few words.
    note: str = ''

    @property
    def ratio(self) -> float | None:
        """Value over baseline."""
        return self.value / self.baseline if self.baseline else None


def table(figures: Iterable[Figure]) -> str:
    """Return lines of text: a heading for each benchmark, a line for each figure."""
    lines: list[str] = []
    heading = ''
    for figure in figures:
        if figure.benchmark != heading:
            heading = figure.benchmark
            lines += ['', heading]
        lines.append(_line(figure))
    return '\n'.join(lines)


def _line(figure: Figure) -> str:
    text = f'  {figure.name:<46} {_short(figure.value):>9} {figure.unit:<5}'
    if figure.baseline is not None:
        times = '' if figure.ratio is None else f'x {_short(figure.ratio)} of '
        text += f' {times}{_short(figure.baseline)} ({figure.than})'
    return f'{text}  {figure.note}'.rstrip()


def _short(value: float) -> str:
    """Return a value with three significant digits and without exponent; - for NaN."""
    if isnan(value):
        return '-'
    if value == 0.0:
        return '0'
    digits = max(0, 2 - floor(log10(abs(value))))
    return f'{value:,.{digits}f}'


def as_json(figures: Sequence[Figure]) -> str:
    """Return figures and machine as JSON."""
    rows = [asdict(f) | {'ratio': f.ratio} for f in figures]
    known = [{key: _or_none(value) for key, value in row.items()} for row in rows]
    return json.dumps({'machine': machine(), 'figures': known}, indent=2, allow_nan=False)


def _or_none(value: object) -> object:
    """Return None for NaN, which JSON does not have."""
    return None if isinstance(value, float) and isnan(value) else value


def machine() -> dict[str, object]:
    """Return the properties of the machine that the figures depend on."""
    return {
        'date': strftime('%Y-%m-%d'),
        'python': platform.python_version(),
        'system': platform.platform(),
        'cores': len(os.sched_getaffinity(0)),
        'load': os.getloadavg()[0],
    }


def percentile(values: Sequence[float], percent: float) -> float:
    """Return the value that follows ``percent`` % of the sorted values; NaN if there are none."""
    ordered = sorted(values)
    if not ordered:
        return float('nan')
    return ordered[min(len(ordered) - 1, int(percent / 100.0 * len(ordered)))]


def median(values: Sequence[float]) -> float:
    """Return the middle value, or the upper one of two; NaN if there are none."""
    return percentile(values, 50.0)


def seconds(
    function: Callable[[], object], repeat: int = 5, clock: Callable[[], float] = perf_counter
) -> float:
    """Return the shortest time of some calls [s], because other processes only lengthen it."""
    times = []
    for _ in range(repeat):
        start = clock()
        function()
        times.append(clock() - start)
    return min(times)


def processor_seconds(function: Callable[[], object], repeat: int = 5) -> float:
    """Return the least processor time of some calls [s], which other processes hardly change."""
    return seconds(function, repeat, process_time)


def memory_of(function: Callable[[], object]) -> tuple[int, int]:
    """Return the peak memory of a call, and the memory of its result [bytes], by tracemalloc."""
    function()  # what is imported or cached once is not counted
    gc.collect()
    tracemalloc.start()
    before, _ = tracemalloc.get_traced_memory()
    kept = function()
    gc.collect()
    after, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    del kept
    return peak - before, after - before


def seconds_each(function: Callable[[], object], budget: float = 0.2) -> float:
    """
    Return the time of a short call [s], from the fastest of five loops.

    The loops take about ``budget`` [s] together. The garbage collector is off, so that it does not
    spend time on the objects of other benchmarks.
    """
    once = max(seconds(function, 3), 1e-9)
    number = max(1, int(budget / 5 / once))

    def loop() -> None:
        for _ in range(number):
            function()

    enabled = gc.isenabled()
    gc.disable()
    try:
        return seconds(loop) / number
    finally:
        if enabled:
            gc.enable()
