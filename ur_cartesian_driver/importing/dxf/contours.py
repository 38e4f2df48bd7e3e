# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Contours: stretches whose ends meet, whatever their order and direction in the file.

A contour continues where exactly two ends meet, and ends where three or more meet. So the order of
the file does not determine which stretches a contour has. It determines only the direction: a
contour runs along its first stretch in the file, and a closed contour begins with this stretch.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import product
from math import floor

from ur_cartesian_driver.importing.dxf.dxf_terms import LeftOut
from ur_cartesian_driver.importing.dxf.entity_curves import Stretch
from ur_cartesian_driver.motion.geometry.vectors import norm, subtract, Vector3

# Both numbers are fractions of the distance within which ends meet.
#: Stretches whose points are this near each other are one stretch that was drawn twice.
_SAME = 0.1
#: Where a stretch is shorter than that distance, only ends this near each other meet.
_NEARER = 1e-3
#: The index of a stretch, and 0 for its start or 1 for its end.
_End = tuple[int, int]


def contours(
    stretches: Sequence[Stretch], distance: float, left_out: LeftOut
) -> Iterator[list[Stretch]]:
    """
    Yield contours in the order of their first stretches.

    :param distance: ends within this distance [m] of each other meet.
    """
    stretches = _without_copies(stretches, _SAME * distance, left_out)
    partners = _partners(stretches, distance, left_out)
    done: set[int] = set()
    for first in range(len(stretches)):
        if first in done:
            continue
        ahead, is_closed = _follow((first, 1), partners)
        row = [(first, 0), *ahead]
        if not is_closed:
            behind, _ = _follow((first, 0), partners)
            row = [*((i, 1 - side) for i, side in reversed(behind)), *row]
        done.update(i for i, _ in row)
        yield [stretches[i].reversed() if side else stretches[i] for i, side in row]


def _follow(end: _End, partners: dict[_End, _End]) -> tuple[list[_End], bool]:
    """Return the end at which each following stretch is entered; whether the contour closes."""
    first = end[0]
    found: list[_End] = []
    while (entered := partners.get(end)) is not None:
        if entered[0] == first:
            return found, True
        found.append(entered)
        end = (entered[0], 1 - entered[1])
    return found, False


def _without_copies(
    stretches: Sequence[Stretch], distance: float, left_out: LeftOut
) -> list[Stretch]:
    """Return the stretches that do not repeat an earlier one, forwards or backwards."""
    kept: list[Stretch] = []
    places = _places(_ends(stretches), distance)
    like: dict[tuple[int, int, int], list[Stretch]] = {}
    for stretch, begin, end in zip(stretches, places[::2], places[1::2], strict=True):
        same = like.setdefault((min(begin, end), max(begin, end), len(stretch.points)), [])
        if any(_is_copy(stretch, other, distance) for other in same):
            left_out.add(stretch.record, 'the same was drawn before, and is followed once')
        else:
            same.append(stretch)
            kept.append(stretch)
    return kept


def _is_copy(stretch: Stretch, other: Stretch, distance: float) -> bool:
    return any(
        all(
            (a is b is None) or (a is not None and b is not None and _distance(a, b) <= distance)
            for a, b in zip(
                [*stretch.points, *stretch.vias], [*each.points, *each.vias], strict=True
            )
        )
        for each in (other, other.reversed())
    )


def _ends(stretches: Sequence[Stretch]) -> list[Vector3]:
    return [point for s in stretches for point in (s.points[0], s.points[-1])]


def _partners(
    stretches: Sequence[Stretch], distance: float, left_out: LeftOut
) -> dict[_End, _End]:
    """Return the partner of each end; ends that are free or at a junction have none."""
    places = _places(_ends(stretches), distance)
    gaps = [_distance(s.points[0], s.points[-1]) for s in stretches]
    open_ones = [i for i, gap in enumerate(gaps) if gap > _NEARER * distance]
    # Both ends of a short stretch are near each other, so only ends that coincide meet there.
    short = {places[2 * i] for i in open_ones if places[2 * i] == places[2 * i + 1]}
    close = [(i, side) for i in open_ones for side in (0, 1) if places[2 * i + side] in short]
    nearer = _places([stretches[i].points[-side] for i, side in close], _NEARER * distance)
    narrow = dict(zip(close, nearer, strict=True))
    meeting: dict[tuple[bool, int], list[_End]] = {}
    for end in ((i, side) for i in open_ones for side in (0, 1)):
        place = narrow.get(end, places[2 * end[0] + end[1]])
        meeting.setdefault((end in narrow, place), []).append(end)
    partners: dict[_End, _End] = {}
    for ends in meeting.values():
        if len(ends) == 2:
            partners[ends[0]], partners[ends[1]] = ends[1], ends[0]
        for i, _ in ends if len(ends) > 2 else ():
            left_out.add(
                stretches[i].record,
                'more than two ends meet at one of its ends, where its contour ends',
            )
    return partners


def _places(points: Sequence[Vector3], distance: float) -> list[int]:
    """Return a number for each point; points connected by a chain of near points share one."""
    numbers: dict[Vector3, int] = {}
    for point in points:
        numbers.setdefault(point, len(numbers))
    root = list(range(len(numbers)))

    def find(i: int) -> int:
        while root[i] != i:
            root[i] = root[root[i]]
            i = root[i]
        return i

    # Cells are twice the distance wide: a near point is in the same cell or in a nearer neighbour.
    cells: dict[tuple[int, ...], list[Vector3]] = {}
    for point, number in numbers.items():
        scaled = [value / (2.0 * distance) for value in point]
        low = [floor(value) for value in scaled]
        beside = [k + (1 if v - k >= 0.5 else -1) for k, v in zip(low, scaled, strict=True)]
        for cell in product(*zip(low, beside, strict=True)):
            for other in cells.get(cell, ()):
                if _distance(point, other) <= distance:
                    root[find(number)] = find(numbers[other])
        cells.setdefault(tuple(low), []).append(point)
    return [find(numbers[point]) for point in points]


def _distance(a: Vector3, b: Vector3) -> float:
    return norm(subtract(a, b))
