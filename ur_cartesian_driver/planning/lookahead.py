# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The joints along the way of the tool: which configurations the arm goes through, or why it cannot.

All places of a goal are solved together. Between two of them the arm may do more than they show:
beside a singularity joints swing round within a millimetre, and the solution that is nearest after
a long step is then that of another branch. So where a joint turns far from one place to the next,
where a branch changes, or where there is no solution, places are put in between, down to 2 um:
what then still jumps, jumps.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from math import hypot, pi

import numpy as np
from numpy.typing import NDArray

from ur_cartesian_driver.kinematics.rows import follow, postures
from ur_cartesian_driver.motion.errors import GoalRefused
from ur_cartesian_driver.motion.pose import Pose
from ur_cartesian_driver.motion.primitive import Joints
from ur_cartesian_driver.planning.corner import Corner
from ur_cartesian_driver.planning.path import tcp_rows
from ur_cartesian_driver.planning.pose_rows import compose_rows, Floats
from ur_cartesian_driver.planning.postures import Reach
from ur_cartesian_driver.planning.samples import along, Piece, Places, places_on
from ur_cartesian_driver.planning.validate import point_field

#: Places are put in between until no joint turns more than this from one to the next [rad] ...
_STEP = 0.1
#: ... or they are this near [m], [rad]: a joint that still turns more than _JUMP jumps.
_LEAST_LENGTH = 2e-6
_LEAST_ANGLE = 2e-5
_JUMP = 0.5
#: The same configuration, found in another way [rad].
_SAME = 1e-6
#: Places solved at a time after one at which more had to be put in between; then ever more.
_FIRST_BLOCK = 64
#: Places at which is looked how far a joint would go beyond its range.
_ONWARD = 16
_GROWTH = 8


@dataclass(frozen=True, slots=True)
class Followed:
    """The places that the arm comes to."""

    #: (n,) not decreasing; (n,); (n, 7); (n, 6).
    piece: NDArray[np.intp]
    t: Floats
    poses: Floats
    q: Floats
    #: Why it does not come to all of them, and the segment where; None = it does.
    refusal: GoalRefused | None = None
    refused_segment: int = -1


@dataclass(slots=True)
class _Rows:
    """What has been found so far, in blocks."""

    piece: list[NDArray[np.intp]] = field(default_factory=list)
    t: list[Floats] = field(default_factory=list)
    poses: list[Floats] = field(default_factory=list)
    q: list[Floats] = field(default_factory=list)

    def append(self, places: Places, rows: slice, q: Floats) -> None:
        self.piece.append(places.piece[rows])
        self.t.append(places.t[rows])
        self.poses.append(places.poses[rows])
        self.q.append(q)

    def joined(self, refusal: GoalRefused | None = None, segment: int = -1) -> Followed:
        return Followed(
            np.concatenate([np.empty(0, dtype=np.intp), *self.piece]),
            np.concatenate([np.empty(0), *self.t]),
            np.concatenate([np.empty((0, 7)), *self.poses]),
            np.concatenate([np.empty((0, 6)), *self.q]),
            refusal,
            segment,
        )


@dataclass(frozen=True, slots=True)
class _Between:
    """Places put in between on one piece: the last is where it goes on, or where it ends."""

    t: list[float]
    poses: list[Pose]
    q: list[Joints]
    #: Where no configuration follows, and the one that would jump there (None: there is none).
    stop: float | None = None
    jump: Joints | None = None


def in_joints(reach: Reach, pieces: Sequence[Piece]) -> Followed:
    """Return the places on pieces in joint space."""
    piece, t = along(pieces)
    q = np.concatenate(
        [
            p.curve.joint_rows(t[piece == k])  # type: ignore[union-attr]  # no other comes here
            for k, p in enumerate(pieces)
        ]
    )
    return Followed(piece, t, tcp_rows(reach.arm, reach.T_flange_tcp, q), q)


def followed(
    reach: Reach, pieces: Sequence[Piece], q_start: Joints, places: Places | None = None
) -> Followed:
    """
    Return the places on pieces in the tool's space, one piece after the other, with the joints.

    :param q_start: the configuration at the beginning of the first piece [rad].
    :param places: those on the pieces; None = evenly along each of them.
    """
    places = places_on(pieces) if places is None else places
    found, q = _Rows(), q_start
    row, block = 0, len(places.t)
    while row < len(places.t):
        solved, bad = _ahead(reach, places.poses[row : row + block], q)
        begin = row
        for index in (*bad, len(solved)):
            stop = begin + index
            if stop > row:
                found.append(places, slice(row, stop), solved[row - begin : index])
                q, row = _joints(solved[index - 1]), stop
            if index == len(solved):
                block *= _GROWTH
                break
            between = _between(reach, pieces, places, row, q)
            k = int(places.piece[row])
            if between.q:
                found.append(_as_places(k, between), slice(None), np.array(between.q))
                q = between.q[-1]
            if between.stop is not None:
                return found.joined(*_refusal(reach, pieces[k], between, q))
            row += 1
            if not np.abs(solved[index] - q).max() < _SAME:  # NaN if there was none
                block = _FIRST_BLOCK
                break
    return found.joined()


def _ahead(reach: Reach, poses: Floats, q: Joints) -> tuple[Floats, list[int]]:
    """Return the joints (n, 6) of places, and the rows to which the way has to be looked at."""
    path = follow(reach.arm, compose_rows(poses, reach.T_tcp_flange), q, over_gaps=False)
    rows = np.concatenate([np.array([q]), path.q])
    measures = postures(reach.arm, rows)
    branch = measures.branch
    bad = (np.abs(np.diff(rows, axis=0)).max(axis=1) > _STEP) | (np.diff(branch) != 0)
    bad |= ~path.found
    lost = np.flatnonzero(~path.found)
    if len(lost):  # what follows is the business of the next block
        stop = int(lost[0]) + 1
        return path.q[:stop], np.flatnonzero(bad[:stop]).tolist()
    return path.q, np.flatnonzero(bad).tolist()


def _between(
    reach: Reach, pieces: Sequence[Piece], places: Places, row: int, q: Joints
) -> _Between:
    """Return the places from the one before a row to it, as near as the joints need them."""
    piece = pieces[int(places.piece[row])]
    is_first = row == 0 or places.piece[row - 1] != places.piece[row]
    t = piece.begin if is_first else float(places.t[row - 1])
    length, angle = piece.size
    least = min(1.0, _LEAST_LENGTH / max(length, 1e-300), _LEAST_ANGLE / max(angle, 1e-300))
    found = _Between([], [], [])
    ends = [float(places.t[row])]
    while ends:
        end = ends[-1]
        pose = piece.pose(end)
        q_next = reach.solution(pose, q)
        if end - t > least and (q_next is None or _apart(reach, q, q_next)):
            ends.append(0.5 * (t + end))
            continue
        if q_next is None or _turn(q, q_next) > _JUMP:
            return _Between(found.t, found.poses, found.q, end, q_next)
        t, q = end, q_next
        found.t.append(t)
        found.poses.append(pose)
        found.q.append(q)
        ends.pop()
    return found


def _as_places(piece: int, between: _Between) -> Places:
    return Places(
        np.full(len(between.t), piece),
        np.array(between.t),
        np.array([pose.row() for pose in between.poses]),
    )


def _refusal(reach: Reach, piece: Piece, between: _Between, q: Joints) -> tuple[GoalRefused, int]:
    """Return why the arm does not go on from a configuration, and on which segment."""
    assert between.stop is not None
    index, fraction = piece.on_segment(between.stop)
    pose = piece.pose(between.stop)
    where = place(index, fraction)
    if between.jump is not None:
        onward = (piece.pose(t) for t in np.linspace(between.stop, piece.end, _ONWARD).tolist())
        return reach.jump(pose, q, between.jump, where, onward), index
    refusal = reach.no_solution(pose, where)
    if not isinstance(piece.curve, Corner) and fraction < 1.0:
        # There the value is just beyond its bound; at the point it says how far beyond.
        at_end = reach.no_solution(piece.curve.end, where, 'at the point ')
        if type(at_end) is type(refusal) and reach.solution(piece.curve.end, q) is None:
            refusal = at_end
    return refusal, index


def place(index: int, fraction: float) -> str:
    """Return the words for a place on the way to a point."""
    field_name = point_field(index, 'pose')
    return (
        field_name
        if fraction >= 1.0
        else (f'{field_name}, {100.0 * fraction:.1f} % of the way to it,')
    )


def _apart(reach: Reach, q: Joints, q_next: Joints) -> bool:
    """
    Tell whether the arm may do more than go straight from one configuration to the other.

    Beside a singularity the other branch is the nearer one after a long step, while the arm that
    goes there in small steps swings round and stays on its own.
    """
    if _turn(q, q_next) > _STEP:
        return True
    before, after = postures(reach.arm, np.array([q, q_next])).branch
    return bool(before != after)


def _turn(a: Joints, b: Joints) -> float:
    return max(abs(y - x) for x, y in zip(a, b, strict=True))


def _joints(row: Floats) -> Joints:
    a, b, c, d, e, f = row.tolist()
    return (a, b, c, d, e, f)


def farthest_way(reach: Reach) -> float:
    """Return the length of a line or an arc [m] that no arm can follow to its end."""
    # In a ball of radius r a circle is no longer than 2 pi r.
    return 2.0 * pi * (reach.arm.model.reach + hypot(*reach.T_flange_tcp.position) + 0.1)
