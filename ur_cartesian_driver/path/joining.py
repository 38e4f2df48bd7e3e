# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Join paths by travels through the air, in the given order or in the best one."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Literal

import numpy as np

from ur_cartesian_driver.motion.errors import GoalRefused, InvalidGoal
from ur_cartesian_driver.motion.geometry.vectors import Joints
from ur_cartesian_driver.path.path_builder import Path
from ur_cartesian_driver.path.path_points import is_same
from ur_cartesian_driver.path.travels.travel_order import best_order, Runs
from ur_cartesian_driver.path.travels.traveller import AirTravel, Traveller

Order = Literal['given', 'best']


def join(seams: Sequence[Path], by: AirTravel, *, order: Order = 'given') -> Path:
    """
    Return paths one after the other, with a travel through the air to each of them.

    The joined path begins at the pose of the arm. A travel has the speeds at the end of the path
    before it; the travel to the first path has the speeds at the end of that path.

    :param by: the arm, its state when the joined path begins, and the settings of the travels.
    :param order: ``given``, or ``best``: the order, and the directions of open paths, for which
        the joints turn least on the travels. A path with events (outputs, say) keeps its
        direction, and a closed path keeps its start.
    :raises GoalRefused: a path cannot be executed, or no travel was found.
    :raises InvalidGoal: there is no path, a path has no start, frames or tools differ, or the
        order is unknown.
    """
    if not seams:
        raise InvalidGoal('join()', 'has no path', 'give one or more')
    if order not in ('given', 'best'):
        raise InvalidGoal('join()', f'has the order {order!r:.60}', 'use given or best')
    for seam in seams[1:]:
        if (seam.frame, seam.tool) != (seams[0].frame, seams[0].tool):
            raise InvalidGoal(
                'join()', 'has paths in different frames, or of different tools', 'use one'
            )
    chosen = list(enumerate(seams)) if order == 'given' else _in_best_order(seams, by)
    path, place = _beginning(chosen[0][1], by), by.begin
    for number, seam in chosen:
        path, place = path._travelled(seam, by, place, _where(number))
    return path


def _where(number: int) -> str:
    return f'The travel to path {number}'


def _beginning(first: Path, by: AirTravel) -> Path:
    """Return a path without points that begins at the arm's pose, with the first path's speeds."""
    goal = first._begin(by, _where(0)).goal
    start = Path(by.snapshot.tool(goal), frame=first.frame, tool=first.tool)
    return start._with_feed_of(first)


def _in_best_order(seams: Sequence[Path], by: AirTravel) -> list[tuple[int, Path]]:
    """Return the paths with their numbers in the best order, some of them reversed."""
    weights = None
    runs: list[Runs] = []
    paths: list[list[Path]] = []
    for number, seam in enumerate(seams):
        if seam.goal(by.frames, by.snapshot).part_changes:
            raise InvalidGoal(
                'join()',
                f'is to find the order of path {number}, which takes or puts down a body of the '
                'cell',
                "use order='given'",
            )
        found: list[tuple[Path, Joints, Joints]] = []
        refusal: GoalRefused | None = None
        for one in _directions(seam):
            traveller = Traveller(by, by.begin, one._begin(by, _where(number)), _where(number))
            weights = traveller.space.weights
            try:
                pairs = traveller.runs().items()
            except GoalRefused as error:
                refusal = refusal or error
            else:
                found += [(one, entry, end.q) for entry, end in pairs]
        if refusal is not None and not found:
            raise refusal.reworded(f'Path {number}: {refusal}')
        paths.append([one for one, _, _ in found])
        runs.append(
            Runs(
                np.array([entry for _, entry, _ in found]), np.array([end for _, _, end in found])
            )
        )
    assert weights is not None
    return [(k, paths[k][run]) for k, run in best_order(np.array(by.begin.q), runs, weights)]


def _directions(seam: Path) -> Iterator[Path]:
    """Yield a path, and if it is open and can be reversed, the reversed path."""
    yield seam
    if seam.start is None or seam.end is None or is_same(seam.start, seam.end):
        return
    try:
        yield seam.reversed()
    except InvalidGoal:  # it has events
        return
