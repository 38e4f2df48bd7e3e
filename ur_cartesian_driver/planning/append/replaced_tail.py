# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Replace the tail of a spline: keep the goal up to a cut, from which a new tail is appended.

The new tail begins with the position, velocity and acceleration that the joints have at the cut.
If the cut is in the middle of a piece, a shorter piece is sent in place of that piece.
"""

from __future__ import annotations

from dataclasses import replace
from functools import reduce
from math import ceil, inf
from operator import add

import numpy as np

from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.motion.errors import AlreadySent, InvalidGoal, NotAvailable
from ur_cartesian_driver.motion.plan.joint_spline import SAME_TIME
from ur_cartesian_driver.motion.plan.plan import ReferencePath
from ur_cartesian_driver.planning.append.appendable_goal import AppendableGoal, AppendedPoints
from ur_cartesian_driver.planning.append.planned_part import PlannedPart
from ur_cartesian_driver.planning.request.field_rules import check_finite
from ur_cartesian_driver.planning.spline.spline_planner import SplineState

#: Shortest piece that a cut leaves [s]: a cycle of the slowest controllers.
MIN_PIECE_TIME = 0.008
#: Time [s] for which passed pieces are kept, because the newest state of the arm can be this old.
HISTORY_TIME = 0.5
# Time between the rows of the path along pieces that are sent again [s].
_ROW_PERIOD = 0.004
_TIME_DIGITS = 6


def cut_time(before: AppendableGoal, new_points: AppendedPoints) -> float:
    """
    Return the motion time [s] at which the new tail begins; infinite = nothing is replaced.

    :raises GoalRefused: the request names both a point and a time, the point does not exist, the
        time is not finite, or the goal is no spline.
    """
    if not new_points.replaces:
        return inf
    point, time = new_points.replace_from_point, new_points.replace_from_time
    mode = before.goal.execution
    field = 'replace_from_time' if point is None else 'replace_from_point'
    if point is not None and time is not None:
        raise InvalidGoal(field, 'is given, and replace_from_time too', 'give one of them')
    if not mode.traits.is_spline:
        raise NotAvailable(
            field,
            f'is given, but motions of the robot, which {mode.name} sends, cannot be planned from '
            'the middle of a motion',
            'append behind the last point, or send the goal with execution SPLINE or SERVO',
        )
    if time is not None:
        check_finite(field, (time,))
        time = round(time + before.time_offset, _TIME_DIGITS)
    else:
        assert point is not None
        if not 0 <= point <= before.points:
            raise InvalidGoal(
                field,
                f'is {point}, but the goal has {before.points} points',
                f'give at most {before.points}, which appends',
            )
        time = inf if point == before.points else _end_time(before, point - 1)
    assert before.state is not None
    return time if time < before.state.time - SAME_TIME else inf


def first_replaceable(before: AppendableGoal, time: float) -> tuple[int, float]:
    """
    Return the first point that can be replaced, and the earliest time at which a tail can begin.

    :param time: motion time until which the motion can no longer change [s].
    :returns: the number of the point, and the client time [s], in whole milliseconds.
    """
    client_time = ceil(1e3 * (time - before.time_offset) - 1e-6) * 1e-3
    part = _part_at(before, time)
    if before.state is None or part is None or time >= before.state.time - SAME_TIME:
        return before.points, round(max(client_time, before.last_client_time), _TIME_DIGITS)
    point = int(part.waypoints[part.row_at(time)])
    passed = _end_time(before, point - 1) < time - SAME_TIME
    return point + passed, round(client_time, _TIME_DIGITS)


def points_before(before: AppendableGoal, time: float) -> int:
    """Return the number of points that a cut at a motion time [s] leaves; infinite = no cut."""
    part = None if time == inf else _part_at(before, time)
    return before.points if part is None else int(part.waypoints[part.row_at(time)])


def cut_tail(before: AppendableGoal, time: float, arm: Arm) -> AppendableGoal:
    """
    Return a goal without its motion after a time [s]; ``before`` itself if nothing is cut off.

    The cut is made a little later where it would leave a piece shorter than ``MIN_PIECE_TIME``.

    :raises AlreadySent: a piece that would have to be sent again is no longer available.
    """
    if time == inf:
        return before
    found = _part_at(before, time)
    if found is not None:
        time = _away_from_ends(found, time)
        if before.state is None or time >= before.state.time - SAME_TIME:
            return before
        found = _part_at(before, time)
    if found is None:
        raise AlreadySent(*first_replaceable(before, before.parts[0].begin(0)))
    part, row = found, found.row_at(time)
    # The records of outputs that are due on the rest of the cut piece follow the piece before it
    # on the wire. To take these records back, the piece before is sent again, too.
    first = row - any(
        time - SAME_TIME <= due < part.begin(row + 1) - SAME_TIME for due, _ in before.commands
    )
    if first < 0:
        raise AlreadySent(*first_replaceable(before, part.begin(1)))
    last = row if part.begin(row) < time - SAME_TIME else row - 1
    pieces = [part.piece(k, min(part.begin(k + 1), time)) for k in range(first, last + 1)]
    point, due_again = int(part.waypoints[row]), part.begin(first + 1) - SAME_TIME
    commands = tuple(one for one in before.commands if one[1].waypoint < point)
    return replace(
        before,
        points=point,
        committed_records=int(part.records_before[first]),
        time=part.begin(first),
        state=part.state(row, time),
        last_client_time=round(time - before.time_offset, _TIME_DIGITS),
        replanned=(reduce(add, pieces), _path(before, part, first, time, arm)) if pieces else None,
        commands=commands,
        outputs=tuple(one for one in commands if one[0] >= due_again),
        parts=tuple(each for each in before.parts if each.begin(0) < time),
    )


def without_passed(before: AppendableGoal, time: float) -> AppendableGoal:
    """Return a goal without the parts that ended over ``HISTORY_TIME`` before a time [s]."""
    first = _part_at(before, time - HISTORY_TIME)
    if first is None or first is before.parts[0]:
        return before
    return replace(
        before,
        parts=before.parts[before.parts.index(first) :],
        commands=tuple(one for one in before.commands if one[0] >= first.begin(0)),
    )


def state_at(before: AppendableGoal, time: float) -> SplineState:
    """Return the state of the joints at a motion time [s]."""
    part = _part_at(before, time)
    assert part is not None
    return part.state(part.row_at(time), time)


def _part_at(before: AppendableGoal, time: float) -> PlannedPart | None:
    """Return the part in effect at a motion time [s]: the last part that has begun by then."""
    for part in reversed(before.parts):
        if part.begin(0) <= time + SAME_TIME:
            return part
    return None


def _end_time(before: AppendableGoal, point: int) -> float:
    """Return the motion time [s] at which a point is reached; -inf = before the kept parts."""
    for part in reversed(before.parts):
        if part.waypoints[0] <= point:
            row = int(np.searchsorted(part.waypoints, point, side='right'))
            return part.begin(row)
    return -inf


def _away_from_ends(part: PlannedPart, time: float) -> float:
    """Return the first time [s], not before ``time``, for a cut that leaves no short piece."""
    row = part.row_at(time)
    begin, end = part.begin(row), part.begin(row + 1)
    if time - begin < SAME_TIME:
        return begin
    later = max(time, begin + MIN_PIECE_TIME)
    return later if end - later >= MIN_PIECE_TIME else end


def _path(
    before: AppendableGoal, part: PlannedPart, first: int, time: float, arm: Arm
) -> ReferencePath:
    """Return the path along the pieces sent again: from piece ``first`` to a motion time [s]."""
    begin = part.begin(first)
    times = np.linspace(begin, time, ceil((time - begin) / _ROW_PERIOD) + 1)
    rows = np.searchsorted(part.spline.times, times - SAME_TIME) - 1
    poses = before.kinematics(arm).pose_rows(part.spline.rows(times)[0])
    return ReferencePath(
        poses=poses,
        time=times,
        point=part.waypoints[np.clip(rows, 0, None)],
        fraction=np.zeros(len(times)),
    )
