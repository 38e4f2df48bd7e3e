# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The distance of the closest pair of bodies over time, as a picture in a page.

A body that the arm carries, such as a tool, is always near a link. So its distances from links and
other carried bodies have a curve of their own, which does not hide the distance of the arm from
its surroundings.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from html import escape
from itertools import product

import numpy as np

from ur_cartesian_driver.motion.cell.cell import Cell, LINK_NAMES
from ur_cartesian_driver.motion.geometry.arrays import Floats

#: Width and height of the curve in the picture, and width of the numbers beside it.
_WIDTH, _HEIGHT, _INDENT = 400, 110, 46
_COLOURS = ('#1e6edc', '#e68214', '#14965a', '#963cbe', '#c83c8c', '#00a0be', '#8a6d3b', '#555')
#: Largest number of pairs in the list below the curve.
_MAX_LISTED = len(_COLOURS)


def groups_of_pairs(cell: Cell) -> dict[str, Cell]:
    """
    Return the cells to measure for each curve, by the title of the curve.

    One cell leaves out the pairs of carried bodies with links and with each other; the other has
    only the carried bodies.
    """
    carried = [body.name for body in cell.bodies if body.is_carried]
    own = [(a, b) for a, b in product(carried, (*LINK_NAMES, *carried)) if a != b]
    groups = {
        'closest fixed body': replace(
            cell, may_touch=cell.may_touch | {frozenset(pair) for pair in own}
        )
    }
    if carried:
        for body in cell.bodies:
            cell = cell if body.is_carried else cell.without(body.name)
        groups['closest on the arm'] = cell
    return groups


def distance_curve(title: str, time: Floats, distances: Floats, pairs: Sequence[str]) -> str:
    """
    Return HTML with the smallest distance over time, and the pairs that have it, nearest first.

    The HTML is empty if no distance is known.

    :param time: (n,) [s]
    :param distances: (n,) [m], infinite where nothing is measured.
    :param pairs: the names of the pair in each row.
    """
    known = np.flatnonzero(np.isfinite(distances))
    if not len(known):
        return ''
    nearest: dict[str, int] = {}
    for row in known[np.argsort(distances[known], kind='stable')].tolist():
        nearest.setdefault(pairs[row], row)
    colours = {pair: _COLOURS[min(k, _MAX_LISTED - 1)] for k, pair in enumerate(nearest)}
    lines = [
        f'<br><i style="background: {colours[pair]}"></i>{escape(pair)}: '
        f'{distances[row]:.3f} m at {time[row]:.2f} s'
        for pair, row in list(nearest.items())[:_MAX_LISTED]
    ]
    picture = _picture(
        time[known], distances[known], [pairs[row] for row in known.tolist()], colours
    )
    return f'<p class="distance"><b>{escape(title)}</b><br>{picture}{"".join(lines)}</p>'


def _picture(time: Floats, distances: Floats, pairs: list[str], colours: dict[str, str]) -> str:
    end = float(time[-1]) or 1.0
    low, high = min(0.0, float(distances.min())), max(0.0, float(distances.max()))
    high = high if high > low else low + 1.0
    x = _INDENT + _WIDTH * time / end
    y = 8 + _HEIGHT * (high - distances) / (high - low)
    ends = [k for k in range(1, len(pairs)) if pairs[k] != pairs[k - 1]]
    curves = []
    for begin, stop in zip([0, *ends], [*ends, len(pairs)], strict=True):
        rows = range(begin, min(stop + 1, len(pairs)))  # up to the start of the next pair
        places = ' '.join(f'{x[k]:.1f},{y[k]:.1f}' for k in rows)
        name = pairs[begin]
        curves.append(
            f'<polyline points="{places}" fill="none" stroke="{colours[name]}" stroke-width="2">'
            f'<title>{escape(name)}</title></polyline>'
        )
    zero = 8 + _HEIGHT * high / (high - low)
    bottom = _HEIGHT + 24
    return (
        f'<svg viewBox="0 0 {_INDENT + _WIDTH + 8} {bottom}" font-size="11">'
        f'<path d="M{_INDENT},{zero:.1f} h{_WIDTH} M{_INDENT},8 v{_HEIGHT}" stroke="#999"/>'
        f'<text x="0" y="14">{high:.3f} m</text><text x="0" y="{zero + 4:.1f}">0</text>'
        f'<text x="{_INDENT}" y="{bottom - 2}">0 s</text>'
        f'<text x="{_INDENT + _WIDTH}" y="{bottom - 2}" text-anchor="end">{time[-1]:.2f} s</text>'
        f'{"".join(curves)}</svg>'
    )
