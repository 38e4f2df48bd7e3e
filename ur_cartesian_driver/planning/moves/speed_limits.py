# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The leading quantities of segments and their speed limits.

A move of the robot has a single number as its speed, which limits both the translation [m/s] and
the turn [rad/s] of the tool. So the larger of length and turn *leads* a segment; in a joint move,
the joint that turns farthest leads. All limits are expressed as limits of the leading quantity.
"""

from __future__ import annotations

from math import inf

import numpy as np

from ur_cartesian_driver.kinematics.robot_models import JOINT_NAMES, RobotModel
from ur_cartesian_driver.motion.geometry.arrays import Flags, Floats, Indices
from ur_cartesian_driver.motion.goal.goal import ArcMode
from ur_cartesian_driver.motion.goal.goal_columns import rows_where
from ur_cartesian_driver.motion.plan.slow_stretch import SlowCause, SpeedLimit
from ur_cartesian_driver.planning.geometry.blended_path import CurveRows
from ur_cartesian_driver.planning.geometry.curves import SAME_POSITION
from ur_cartesian_driver.planning.moves.segment_geometries import SegmentGeometries
from ur_cartesian_driver.planning.options import PlanningOptions
from ur_cartesian_driver.planning.request.goal_fields import IS_ARC, IS_ARC_OR_PROCESS, IS_JOINT

#: Lower bound of lengths, for a first segment that ends where the robot already is.
_MIN_LENGTH = 1e-9


class SpeedLimits:
    """The leading quantity of each segment, and its limits; columns (n,)."""

    def __init__(
        self, geometries: SegmentGeometries, options: PlanningOptions, model: RobotModel
    ) -> None:
        """Find the leading quantities, and their smallest limits."""
        self._bounds, self._options, self._model = geometries.speed_bounds, options, model
        curves, kinds = geometries.path.curves, geometries.kinds
        #: Whether the tool's position changes; if not, the segment only turns the tool.
        self.translates: Flags = curves.length > SAME_POSITION
        self.is_optimized = geometries.is_optimized
        turns_with_arc = IS_ARC[kinds] & (geometries.segments.arc_modes == int(ArcMode.FIXED))
        #: Whether the turn of the tool, or of a joint, leads.
        self.is_turn: Flags = ~self.is_optimized & (
            curves.is_joint_line | ((curves.length < curves.angle) & ~turns_with_arc)
        )
        travel = np.where(curves.is_joint_line, curves.joint_travel, curves.angle)
        length = np.where(self.is_turn, travel, curves.length)
        # An OPTIMIZED move is led by the time that it takes with some joint always at its limit.
        length = np.where(self.is_optimized, self._bounds.times_at_limits, length)
        #: Length of the leading quantity: [m], [rad], or for an OPTIMIZED move [s].
        self.length: Floats = np.maximum(length, _MIN_LENGTH)
        times = np.where(self.is_optimized, 0.0, self._bounds.times)
        joint_speed = np.where(times > 0.0, self.length / np.maximum(times, 1e-300), inf)
        self._joint = self._bounds.joints.copy()
        self._is_joint_move = IS_JOINT[kinds] & curves.is_joint_line
        if len(rows := np.flatnonzero(self._is_joint_move)):
            joint_speed[rows], self._joint[rows] = self._joint_moves(rows, curves)
        tool_speed, self._arcs = self._tool_speed(curves), curves.arcs
        arc_speed = self._arc_speed(curves)
        self._is_arc_limit = arc_speed < np.minimum(joint_speed, tool_speed)
        self._is_joint_limit = ~self._is_arc_limit & (joint_speed < tool_speed)
        #: Maximum speed of the leading quantity.
        self.speed: Floats = np.minimum.reduce([joint_speed, tool_speed, arc_speed])
        #: Maximum acceleration of the leading quantity.
        self.acceleration = self._acceleration(curves)
        # For a speed of 1 m/s a robot may turn the tool at up to ``ratio`` rad/s: lower the limits
        # so that they hold even then.
        turn = np.minimum(curves.angle, self.length)  # a FIXED arc turns the tool by the arc angle
        ratio = max(options.turn_ratio, options.laws.turn_ratio)
        counted = np.maximum(curves.length, turn / ratio) / self.length
        by_ratio = IS_ARC_OR_PROCESS[kinds]
        reduction = np.where(by_ratio, np.minimum(1.0, counted), 1.0)
        self.speed *= reduction
        self.acceleration *= reduction

    def length_unit(self, row: int) -> str:
        """Return the unit of the length of a segment."""
        return 's' if self.is_optimized[row] else 'rad' if self.is_turn[row] else 'm'

    def unit(self, row: int) -> str:
        """Return the unit of the speed of a segment."""
        return 'of the limits' if self.is_optimized[row] else f'{self.length_unit(row)}/s'

    def limit(self, row: int) -> SpeedLimit:
        """Return the limit on the speed of a segment."""
        if self._is_arc_limit[row]:
            return arc_limit(self._options, 'on', float(self._arcs.radius[row]))
        if not self._is_joint_limit[row]:
            text = f'max_tool_speed = {self._options.max_tool_speed:g} m/s'
            return SpeedLimit(SlowCause.TOOL_LIMIT, text)
        joint, fraction = int(self._joint[row]), self._bounds.fractions[row]
        name, source = JOINT_NAMES[joint], self._model.speed_source(joint)
        if self._is_joint_move[row]:
            limit = self._model.max_joint_speed[joint]
            text = f'the speed limit of {name}, {limit:.3f} rad/s{source}'
        else:
            place = f'{name} at {100.0 * fraction:.0f} % of the segment'
            text = f'the joint speed limits ({place}{source})'
        return SpeedLimit(SlowCause.JOINT_LIMIT, text)

    def acceleration_limit(self, row: int) -> SpeedLimit:
        """Return the limit on the acceleration of a segment."""
        options = self._options
        if self._is_joint_move[row]:
            text = f'max_joint_acceleration = {options.max_joint_acceleration:g} rad/s^2'
        elif self._is_turn_limit[row]:
            text = f'max_angular_acceleration = {options.max_angular_acceleration:g} rad/s^2'
        else:
            text = f'max_linear_acceleration = {options.max_linear_acceleration:g} m/s^2'
        return SpeedLimit(SlowCause.ACCELERATION_LIMIT, text)

    def _joint_moves(self, rows: Indices, curves: CurveRows) -> tuple[Floats, Indices]:
        """Return the greatest speeds (m,) of joint moves, and the joints (m,) that limit them."""
        travel = np.array([curves.joint_lines[row].travel for row in rows.tolist()])
        speeds = np.array(self._model.max_joint_speed) * self.length[rows, None]
        speeds = np.where(travel > 0.0, speeds / np.maximum(travel, 1e-300), inf)
        return speeds.min(axis=1), speeds.argmin(axis=1)

    def _tool_speed(self, curves: CurveRows) -> Floats:
        """Return the greatest speeds of the leading quantities that max_tool_speed allows."""
        if self._options.max_tool_speed <= 0.0:
            return np.full(len(self.length), inf)
        # In an OPTIMIZED move, some joint is always at its limit. So the tool is fastest where the
        # joints turn least.
        shortest = np.maximum(self._bounds.shortest_times, _MIN_LENGTH)
        travel = curves.length * 1.0
        for row in rows_where(curves.is_joint_line):
            travel[row] *= curves.joint_lines[row].unevenness
        per_unit = travel / np.where(self.is_optimized, shortest, self.length)
        speed = self._options.max_tool_speed / np.maximum(per_unit, 1e-300)
        return np.where(self.translates, speed, inf)

    def _arc_speed(self, curves: CurveRows) -> Floats:
        """
        Return the greatest speeds (n,) of the leading quantities on arcs; inf on other curves.

        A tool with the speed v on a circle of radius r has the acceleration v^2 / r.
        """
        speed, at = np.full(len(self.length), inf), np.flatnonzero(curves.is_arc)
        fastest = np.sqrt(self._options.max_linear_acceleration * curves.arcs.radius[at])
        speed[at] = fastest * self.length[at] / np.maximum(curves.length[at], 1e-300)
        return speed

    def _acceleration(self, curves: CurveRows) -> Floats:
        options, length = self._options, self.length
        # Translation and turn of the tool per unit of the leading quantity.
        linear = np.where(self.translates, curves.length, 0.0) / length
        angular = curves.angle / length
        by_line = options.max_linear_acceleration / np.maximum(linear, 1e-300)
        by_turn = options.max_angular_acceleration / np.maximum(angular, 1e-300)
        self._is_turn_limit = by_turn < by_line
        bound = np.minimum(by_line, by_turn)
        return np.where(self._is_joint_move, options.max_joint_acceleration, bound)


def arc_limit(options: PlanningOptions, where: str, radius: float) -> SpeedLimit:
    """Return the speed limit on an arc; ``where`` precedes 'an arc' in the text, such as 'on'."""
    return SpeedLimit(
        SlowCause.ACCELERATION_LIMIT,
        f'max_linear_acceleration = {options.max_linear_acceleration:g} m/s^2 ({where} an arc '
        f'with a radius of {1e3 * radius:.3g} mm)',
    )
