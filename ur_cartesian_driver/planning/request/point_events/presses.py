# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Presses: the controller's force mode from one point to another; the arm stops at both points.

The path is planned as if the tool did not give way. During execution, the monitor allows the tool
to give way (``execution.monitoring.press_window``).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

from ur_cartesian_driver.kinematics.robot_models import RobotModel
from ur_cartesian_driver.motion.errors import InvalidGoal, NotAvailable
from ur_cartesian_driver.motion.geometry.pose import IDENTITY, Pose
from ur_cartesian_driver.motion.geometry.vectors import vector6
from ur_cartesian_driver.motion.goal.goal import (
    ContactEnd,
    Press,
    PRESS_AXES,
    PressFrame,
    SegmentType,
    START_OF_MOTION,
)
from ur_cartesian_driver.motion.goal.goal_columns import GoalTable
from ur_cartesian_driver.motion.plan.primitive import BeginPress, EndPress, PressLaw
from ur_cartesian_driver.planning.options import PlanningOptions
from ur_cartesian_driver.planning.request.goal_fields import segment_field
from ur_cartesian_driver.planning.request.mode_rules import ModeRule
from ur_cartesian_driver.planning.request.point_events.goal_rest import GoalRest
from ur_cartesian_driver.planning.request.point_events.point_event import PlacedStop, PointEvent

#: Largest force [N] and torque [Nm], and largest speeds along [m/s] and about [rad/s] compliant
#: axes. Larger values must be mistakes.
MAX_FORCES, MAX_SPEEDS = (200.0, 30.0), (0.25, 1.0)
#: Default speeds along [m/s] and about [rad/s] compliant axes; default deviations along [m] and
#: about [rad] the other axes.
DEFAULT_SPEEDS, DEFAULT_DEVIATIONS = (0.05, 0.2), (0.005, 0.05)
_UNITS = (('N', 'm/s'), ('Nm', 'rad/s'))


def is_turn(axis: str) -> bool:
    """Return whether an axis of a press is one of rotation (rx, ry, rz)."""
    return axis.startswith('r')


class Presses(PointEvent[Press]):
    """Parts of the path on which the tool gives way."""

    field = 'presses'
    mode_rule = ModeRule(
        'presses',
        lambda traits: not traits.is_spline,
        'is not empty, but {mode} follows joint positions, which do not give way',
    )

    def check(self, goal: GoalTable, options: PlanningOptions) -> None:
        """Refuse presses that overlap, and arcs whose start a press may have displaced."""
        super().check(goal, options)
        for i, press in enumerate(goal.presses):
            field = f'presses[{i}]'
            if any(
                press.first_waypoint < other.last_waypoint
                and other.first_waypoint < press.last_waypoint
                for other in goal.presses[:i]
            ):
                raise InvalidGoal(
                    f'{field}.first_point',
                    f'is {press.first_waypoint}, where another press has begun and not ended',
                    'let one end where the other begins',
                )
            after = press.last_waypoint + 1
            if after < len(goal.waypoints) and goal.motions.types[after] == SegmentType.CIRCULAR:
                raise InvalidGoal(
                    segment_field(after, 'type'),
                    f'is CIRCULAR, but {field} may have displaced the tool at its start, and the '
                    'robot would draw another arc from there',
                    'lead the tool back by a LINEAR segment first',
                )

    def check_event(self, where: str, press: Press) -> None:
        """Refuse a press that force mode cannot carry out."""
        if not press.first_waypoint < press.last_waypoint:
            raise InvalidGoal(
                f'{where}.last_point',
                f'is {press.last_waypoint}, not behind first_point = {press.first_waypoint}',
            )
        axes = press.axes
        for k, axis in enumerate(axes):
            if axis not in PRESS_AXES or axis in axes[:k]:
                raise InvalidGoal(
                    f'{where}.axes[{k}]',
                    f"is '{axis}'; the axes are {', '.join(PRESS_AXES)}, each at most once",
                )
        if not axes and press.contact is ContactEnd.NONE:
            raise InvalidGoal(
                f'{where}.axes',
                'is empty, and contact is NONE, so that it does nothing',
                'name axes',
            )
        if len(press.forces) != len(axes):
            raise InvalidGoal(
                f'{where}.forces', f'has {len(press.forces)} entries for {len(axes)} axes'
            )
        if len(press.speed_limits) not in (0, len(axes)):
            raise InvalidGoal(
                f'{where}.speed_limits',
                f'has {len(press.speed_limits)} entries for {len(axes)} axes',
                'give one for each, or none for the defaults',
            )
        for k, axis in enumerate(axes):
            force_unit, speed_unit = _UNITS[is_turn(axis)]
            bound = MAX_FORCES[is_turn(axis)]
            if not abs(press.forces[k]) <= bound:  # or NaN
                raise InvalidGoal(
                    f'{where}.forces[{k}]',
                    f'is {press.forces[k]:g} {force_unit}, outside -{bound:g} to {bound:g}',
                )
            speed, bound = _speed_limit(press, k), MAX_SPEEDS[is_turn(axis)]
            if not 0.0 < speed <= bound:
                raise InvalidGoal(
                    f'{where}.speed_limits[{k}]',
                    f'is {speed:g} {speed_unit}; it must be more than 0, and at most {bound:g}',
                )

    def check_robot(self, goal: GoalTable, model: RobotModel, T_tcp_controlled: Pose) -> None:
        """Refuse options that a CB3 lacks, and TOOL if the controlled frame is not the TCP."""
        for i, press in enumerate(goal.presses):
            for name, is_set in (
                ('zero_sensor', press.zero_sensor),
                ('gain_scaling', press.gain_scaling != 1.0),
            ):
                if is_set and model.series == 'CB3':
                    raise NotAvailable(
                        f'presses[{i}].{name}',
                        f'is set, but a {model.name} has no force sensor and no gain of force '
                        'mode',
                        'leave it out',
                    )
            if press.frame is PressFrame.TOOL and T_tcp_controlled != IDENTITY:
                raise NotAvailable(
                    f'presses[{i}].frame',
                    "is TOOL, but the controlled frame is not the robot's TCP, to which force "
                    'mode belongs',
                    'name another frame, or set allow_tcp_change to true',
                )

    def stops(self, goal: GoalTable, options: PlanningOptions) -> Iterator[PlacedStop]:
        """Yield the ends and beginnings of presses; at the same point, the end comes first."""
        for press in goal.presses:
            what = 'pressing' if press.axes else 'watching for contact'
            yield PlacedStop(press.last_waypoint, EndPress(), f'stops {what} there', order=-1)
            for record, note in press_records(press, *_task_frames(goal, press)):
                yield PlacedStop(press.first_waypoint, record, note, order=2)

    def left(self, events: Sequence[Press], rest: GoalRest) -> Sequence[Press]:
        """Return the presses ahead, and one already begun, without zeroing the sensor again."""
        return rest.stretches(
            events,
            begun=lambda press: replace(press, zero_sensor=False) if press.zero_sensor else press,
        )


def _task_frames(goal: GoalTable, press: Press) -> tuple[Pose, Pose | None]:
    """Return ``T_base_frame`` and ``T_base_tool`` for :func:`press_records`."""
    held = goal.moving_frame
    if held is None:
        return goal.T_base_frame, None
    part = held.frame_under(goal.waypoints.pose(press.last_waypoint))
    return Pose(held.T_base_tool.position, part.quaternion), held.T_base_tool


def press_records(
    press: Press, T_base_frame: Pose, T_base_tool: Pose | None = None
) -> Iterator[tuple[PressLaw | BeginPress, str]]:
    """
    Yield the records with which a press begins, each with its note for the report.

    :param T_base_frame: the frame of the goal; for a held part, its axes at the fixed tool.
    :param T_base_tool: the fixed tool, if the arm holds the part and so presses with the opposite
        forces; None = the arm holds the tool.
    """
    # TOOL has no fixed frame while the arm holds the tool: the robot program follows it.
    task = {PressFrame.TOOL: T_base_tool or IDENTITY, PressFrame.GOAL: T_base_frame}
    sign = 1.0 if T_base_tool is None else -1.0
    wrench, limits = [0.0] * 6, []
    for k, axis in enumerate(PRESS_AXES):
        if axis in press.axes:
            at = press.axes.index(axis)
            wrench[k] = sign * press.forces[at]
            limits.append(_speed_limit(press, at))
        else:
            given = press.max_deviation_angle if is_turn(axis) else press.max_deviation
            limits.append(given or DEFAULT_DEVIATIONS[is_turn(axis)])
    law = PressLaw(
        wrench=vector6(wrench),
        limits=vector6(limits),
        damping=press.damping,
        gain_scaling=press.gain_scaling,
        zero_sensor=press.zero_sensor,
        contact=press.contact,
    )
    begin = BeginPress(
        T_base_task=task.get(press.frame, IDENTITY),
        compliant=vector6(float(axis in press.axes) for axis in PRESS_AXES),
        follows_tool=press.frame is PressFrame.TOOL and T_base_tool is None,
    )
    yield law, ''
    yield begin, _note(press)


def _note(press: Press) -> str:
    what = ' and '.join(
        f'{force:g} {_UNITS[is_turn(axis)][0]} {"about" if is_turn(axis) else "along"} {axis[-1]}'
        for axis, force in zip(press.axes, press.forces, strict=True)
    )
    pressing = f'presses with {what} of the {press.frame.name.lower()} frame' if what else 'goes'
    end = {
        ContactEnd.NONE: '',
        ContactEnd.ENDS: ', or until the tool touches',
        ContactEnd.REQUIRED: ', where the tool must have touched before',
    }[press.contact]
    begin = 'the start' if press.first_waypoint == START_OF_MOTION else 'there'
    return f'{pressing} from {begin} to point {press.last_waypoint}{end}'


def _speed_limit(press: Press, k: int) -> float:
    if press.speed_limits:
        return press.speed_limits[k]
    return DEFAULT_SPEEDS[is_turn(press.axes[k])]
