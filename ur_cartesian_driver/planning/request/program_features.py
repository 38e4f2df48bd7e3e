# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Features that older robot programs lack: refuse goals that demand them, or adapt the motions.

A robot program silently skips motions of a type that it does not know, and moves to the next point
from where the arm is. So a plan has only motions that the robot program knows. No other planning
module looks at the wire dialect.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TypeVar

from ur_cartesian_driver.motion.errors import NotAvailable
from ur_cartesian_driver.motion.geometry.arrays import Floats
from ur_cartesian_driver.motion.geometry.pose import Pose
from ur_cartesian_driver.motion.geometry.vectors import Joints
from ur_cartesian_driver.motion.goal.execution_modes import ModeTraits
from ur_cartesian_driver.motion.goal.goal_columns import GoalTable, rows_where
from ur_cartesian_driver.motion.plan.primitive import (
    MoveC,
    MoveJ,
    OptimoveJ,
    OptimoveL,
    Primitive,
    Spline,
    Stop,
)
from ur_cartesian_driver.planning.options import PlanningOptions
from ur_cartesian_driver.planning.request.goal_fields import (
    is_spline,
    is_timed,
    point_field,
    resolve_execution_mode,
    segment_field,
)
from ur_cartesian_driver.planning.request.point_events.registry import STOP_EVENTS
from ur_cartesian_driver.protocol.program.point_fields import motion_type, MotionType
from ur_cartesian_driver.protocol.program.wire_dialects import Dialect

_Lengths = TypeVar('_Lengths', float, Floats)


def _is_own(program: Dialect) -> bool:
    return program.is_own


def _sends_points(mode: ModeTraits) -> bool:
    return not mode.streams_setpoints


def _safe_outputs(goal: GoalTable, options: PlanningOptions) -> str:
    return 'safe_outputs' if goal.safe_outputs or options.safe_outputs else ''


def _first_stop(goal: GoalTable, _: PlanningOptions) -> str:
    return next((field for kind in STOP_EVENTS for field, _ in kind.places(goal)), '')


@dataclass(frozen=True, slots=True)
class Feature:
    """A demand of a goal that not every robot program can meet."""

    #: The field that makes the demand, or a function that finds the field ('' = none).
    field: str | Callable[[GoalTable, PlanningOptions], str]
    #: Why older programs cannot meet the demand: a clause with ``{mode}`` and ``{dialect}``.
    problem: str
    remedy: str
    #: Whether a program can meet the demand.
    is_known: Callable[[Dialect], bool] = _is_own
    #: Whether the robot program has to meet the demand in an execution mode.
    applies: Callable[[ModeTraits], bool] = _sends_points

    def demanded_by(self, goal: GoalTable, options: PlanningOptions) -> str:
        """Return the field of a goal that makes the demand; '' = none does."""
        if callable(self.field):
            return self.field(goal, options)
        return self.field if getattr(goal, self.field) else ''


#: All features, in the order in which they are checked.
FEATURES = (
    Feature(
        'keep_open',
        'is set, but a robot program of {dialect} needs the number of points at the start',
        'send all points at once, or use a robot program of wire dialect 2.14',
        is_known=lambda program: program.supports_append,
    ),
    Feature(
        'io_commands',
        'is not empty, but robot programs of {dialect} cannot switch outputs during a motion',
        'leave it empty, or let the driver send its own robot program',
    ),
    Feature(
        'proportional_outputs',
        'is not empty, but robot programs of {dialect} have none',
        'leave it empty, or let the driver send its own robot program',
    ),
    Feature(
        'pulses',
        'is not empty, but robot programs of {dialect} give none',
        'leave it empty, or let the driver send its own robot program',
    ),
    Feature(
        _safe_outputs,
        'is not empty, but robot programs of {dialect} do not know it',
        'leave it empty (the parameter too), or let the driver send its own robot program',
        applies=lambda _: True,
    ),
    Feature(
        lambda *_: 'execution',
        'is {mode}, which robot programs of {dialect} do not support',
        'set execution to PRIMITIVES',
        applies=lambda mode: mode.streams_setpoints,
    ),
    Feature(
        lambda *_: 'execution',
        'is {mode}, but robot programs of {dialect} count in milliseconds, too coarse for splines',
        'set execution to PRIMITIVES',
        is_known=lambda program: not program.is_coarse,
        applies=lambda mode: mode.is_spline,
    ),
    Feature(
        _first_stop,
        'is set, but robot programs of {dialect} do nothing at points of {mode}',
        'split the goal there, or let the driver send its own robot program',
    ),
    Feature(
        'path_offset',
        'is set, but robot programs of {dialect} add no offsets to their motions',
        'let the driver send its own robot program',
    ),
    Feature(
        'feed_override',
        'is set, but robot programs of {dialect} take no feed while they move the arm',
        'let the driver send its own robot program',
    ),
)


def check_program(goal: GoalTable, options: PlanningOptions) -> None:
    """
    Refuse a goal with a demand that the robot program cannot meet.

    :raises NotAvailable: a demand cannot be met; the text names the field and the wire dialect.
    """
    mode = resolve_execution_mode(goal)
    for feature in FEATURES:
        if feature.is_known(options.dialect) or not feature.applies(mode.traits):
            continue
        if field := feature.demanded_by(goal, options):
            problem = feature.problem.format(mode=mode.name, dialect=_name(options))
            raise NotAvailable(field, problem, feature.remedy)


def check_joint_spline(options: PlanningOptions) -> None:
    """
    Refuse a joint goal if the time unit of the robot program is too coarse.

    :raises NotAvailable: the program counts in milliseconds; the text names the wire dialect.
    """
    if options.dialect.is_coarse:
        raise NotAvailable(
            'trajectory',
            f'is a spline of joint positions, but robot programs of {_name(options)} count in '
            'milliseconds, too coarse for splines',
            'use a robot program of a newer dialect',
        )


# -- times and radii ---------------------------------------------------------------------------


def takes_times(options: PlanningOptions) -> bool:
    """
    Return whether the times of moves are sent to the robot.

    Times in milliseconds are not sent: a program that expects microseconds would run a segment a
    thousand times too fast, and programs do not report which unit they expect.
    """
    return not options.dialect.is_coarse


def time_remarks(goal: GoalTable, options: PlanningOptions) -> list[str]:
    """Return a remark if speeds are sent instead of the times of a goal."""
    if takes_times(options) or not is_timed(goal) or is_spline(goal):
        return []
    return [
        'all points: sent with speeds instead of times, because robot programs of '
        f'{_name(options)} count in milliseconds'
    ]


def check_wait(time: float, options: PlanningOptions) -> None:
    """
    Refuse to wait at the first point, where the robot already is, if no times are sent.

    :param time: of the first point [s].
    :raises NotAvailable: times are not sent in the wire dialect.
    """
    if not takes_times(options):
        raise NotAvailable(
            point_field(0, 'time_from_start'),
            f'is {time:g} s, but the robot is already there and cannot wait, because '
            f'no times are sent in {_name(options)}',
            'set it to 0, and the later times accordingly',
        )


def round_radii(
    radii: Floats, begin: int, options: PlanningOptions
) -> tuple[Floats, list[tuple[int, str]]]:
    """
    Return blend radii (n,) [m] rounded down as on the wire, and a remark for each that shrinks.

    :param begin: the number of the first point.
    :returns: the radii, and rows with remarks.
    """
    rounded = round_down(radii, options)
    return rounded, [
        (
            row,
            f'point {begin + row}: blend of {1e3 * rounded[row]:g} mm instead of '
            f'{1e3 * radii[row]:g} mm, because {_name(options)} counts in steps of '
            f'{1e3 / options.dialect.time_scale:g} mm',
        )
        for row in rows_where(rounded < radii - 1e-6)
    ]


def round_down(radius: _Lengths, options: PlanningOptions) -> _Lengths:
    """Return the largest blend radius [m] on the wire that does not exceed ``radius``."""
    return options.dialect.round_down_radius(radius)


# -- moves -------------------------------------------------------------------------------------


def takes_q_near(options: PlanningOptions) -> bool:
    """Return whether the robot program solves a pose near given joints (q_near)."""
    return options.dialect.supports_q_near


def adapt_primitive(
    primitive: Primitive, point: int, joints: Joints, options: PlanningOptions
) -> tuple[Primitive, str]:
    """
    Return a primitive as the robot program accepts it, and the reason for a change ('' = none).

    :param point: the number of the point at the end of the primitive, for refusals.
    :param joints: the joint solution there [rad].
    :raises NotAvailable: the program has no such motion, or only with joint positions, which an
        unknown calibration rules out.
    """
    reason = ''
    if takes_q_near(options) or isinstance(primitive, MoveC | Spline | Stop):
        pass
    elif isinstance(primitive, MoveJ | OptimoveJ) and isinstance(primitive.target, Pose):
        if not options.calibration_known:
            raise NotAvailable(
                segment_field(point, 'type'),
                f'is a joint motion ({type(primitive).__name__}), which {_name(options)} takes as '
                'joint positions only, but the calibration of this robot is unknown',
                'use LINEAR',
            )
        primitive = replace(primitive, target=joints, q_near=None)
        reason = f'{_name(options)} has no q_near and takes the joint solution'
    else:
        primitive = replace(primitive, q_near=None)  # the robot ignores q_near
    if motion_type(primitive) not in options.dialect.motion_types:
        raise NotAvailable(
            segment_field(point, 'type'),
            f'needs {motion_type(primitive).name}, which robot '
            f'programs of {_name(options)} do not support',
            'use LINEAR or JOINT'
            if isinstance(primitive, OptimoveJ | OptimoveL)
            else 'use a newer program and wire_dialect',
        )
    return primitive, reason


def explain_poses_only(options: PlanningOptions) -> str:
    """Return the reason to send arcs as poses only, to follow ``because``; '' = none."""
    if not options.calibration_known:
        return 'the calibration of this robot is unknown'
    if MotionType.MOVEC_JOINT not in options.dialect.motion_types:
        return f'{_name(options)} has no arcs with joint positions'
    return ''


def _name(options: PlanningOptions) -> str:
    return f'wire dialect {options.dialect.name}'
