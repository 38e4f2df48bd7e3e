# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""What a goal may say of offsets that come while the arm moves (``path_offset``)."""

from __future__ import annotations

from ur_cartesian_driver.motion.errors import InvalidGoal, NotAvailable
from ur_cartesian_driver.motion.goal import DEFAULT_OFFSET_MOTION, PathOffset
from ur_cartesian_driver.motion.goal_table import GoalTable
from ur_cartesian_driver.planning.options import PlanningOptions
from ur_cartesian_driver.planning.request.goal_fields import resolve_execution_mode

#: Largest limit [m], as that of the controller's own offsets by default; speed [m/s], acceleration
#: [m/s^2], timeout [s].
MAX_LIMIT = 0.1
MAX_SPEED, MAX_ACCELERATION, MAX_TIMEOUT = 0.1, 2.0, 60.0


def check_path_offset(goal: GoalTable, options: PlanningOptions) -> None:
    """
    Refuse offsets that are out of bounds, or not possible.

    :raises InvalidGoal: names the field, the value and the bound.
    :raises NotAvailable: the execution mode has no set-points that could be displaced.
    """
    wanted = goal.path_offset
    if wanted == PathOffset():
        return
    for axis, limit in zip('xyz', wanted.limits, strict=True):
        if not 0.0 <= limit <= MAX_LIMIT:  # NaN neither
            raise InvalidGoal(
                f'path_offset.limits.{axis}', f'is {limit:g} m, outside 0 to {MAX_LIMIT:g} m'
            )
    for name, unit, bound in (
        ('speed', 'm/s', MAX_SPEED),
        ('acceleration', 'm/s^2', MAX_ACCELERATION),
        ('timeout', 's', MAX_TIMEOUT),
    ):
        value = getattr(wanted, name)
        if not 0.0 <= value <= bound:
            raise InvalidGoal(
                f'path_offset.{name}', f'is {value:g} {unit}, outside 0 to {bound:g} {unit}'
            )
    if not wanted:
        raise InvalidGoal(
            'path_offset.limits',
            'are all 0, so that the path does not give way',
            'set one, or leave path_offset empty',
        )
    mode = resolve_execution_mode(goal)
    if not mode.traits.streams_setpoints:
        raise NotAvailable(
            'path_offset',
            f'is set, but the robot has the path of a {mode.name} goal before it moves, and '
            'takes no offset on its way',
            'set execution to SERVO',
        )
    if goal.keep_open:
        raise NotAvailable(
            'path_offset',
            'is set, but the end of a goal with keep_open, where an offset has to be gone, is not '
            'known',
            'send all points at once',
        )


def offset_motion(wanted: PathOffset) -> tuple[float, float, float]:
    """Return speed [m/s], acceleration [m/s^2] and timeout [s], defaults filled in."""
    given = (wanted.speed, wanted.acceleration, wanted.timeout)
    speed, acceleration, timeout = (
        value or default for value, default in zip(given, DEFAULT_OFFSET_MOTION, strict=True)
    )
    return speed, acceleration, timeout
