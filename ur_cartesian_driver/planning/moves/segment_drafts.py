# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Segment drafts: the segments as the goal alone defines them, without the arm's kinematics.

Lines and arcs follow from the points; joint moves do not, because they begin in the configuration
in which the path before them arrives.
"""

from __future__ import annotations

from math import degrees, dist, pi

import numpy as np

from ur_cartesian_driver.motion.errors import InvalidGoal
from ur_cartesian_driver.motion.geometry.arrays import Flags, Floats
from ur_cartesian_driver.motion.geometry.pose import Pose, pose_from_row
from ur_cartesian_driver.motion.geometry.pose_rows import distance_rows
from ur_cartesian_driver.motion.goal.goal import ArcMode, SegmentType
from ur_cartesian_driver.motion.goal.goal_columns import GoalTable, rows_where
from ur_cartesian_driver.planning.geometry.blended_path import BlendedPath, CurveRows, curves_of
from ur_cartesian_driver.planning.geometry.curves import (
    goal_arcs,
    HALF_TURN,
    is_same_pose,
    SAME_POSITION,
)
from ur_cartesian_driver.planning.options import PlanningOptions
from ur_cartesian_driver.planning.request.blend_limits import check_blends_fit
from ur_cartesian_driver.planning.request.goal_fields import IS_JOINT_MOVE, point_field
from ur_cartesian_driver.planning.request.program_features import round_down, round_radii
from ur_cartesian_driver.planning.request.validate import arc_error

_LINEAR, _JOINT = SegmentType.LINEAR, SegmentType.JOINT
_OPTIMIZED = (SegmentType.OPTIMIZED_LINEAR, SegmentType.OPTIMIZED_JOINT)
#: Smallest length [m] between the two blends of a segment: more than the rounding of two poses and
#: two radii to micrometres.
_MIN_BLEND_GAP = 5e-6
#: By type of segment: the only types from which the robot can blend into it (all, if absent).
_BLENDS_FROM = {
    SegmentType.JOINT: (_LINEAR, _JOINT),
    SegmentType.OPTIMIZED_LINEAR: (_LINEAR, _JOINT, *_OPTIMIZED),
    SegmentType.OPTIMIZED_JOINT: (_LINEAR, _JOINT, *_OPTIMIZED),
}
#: Whether the robot can blend from one type of segment (row) into another (column).
_CAN_BLEND = np.array(
    [
        [first in _BLENDS_FROM.get(second, SegmentType) for second in SegmentType]
        for first in SegmentType
    ]
)


class SegmentDrafts:
    """
    The segments from a waypoint on, one per row, while their curves and joints are being found.

    :param targets: poses of all waypoints in the frame of the path (n, 7).
    :param begin: index of the first waypoint with a motion.
    :param start: pose of the tool in the frame of the path at the start.
    :param remarks: list to which remarks on ignored or changed fields are appended.
    :raises InvalidGoal: the points define no line or arc, or the first blend is too large.
    """

    def __init__(
        self,
        goal: GoalTable,
        targets: Floats,
        begin: int,
        start: Pose,
        options: PlanningOptions,
        remarks: list[str],
    ) -> None:
        """Construct the lines and arcs."""
        self._goal, self._options, self._remarks = goal, options, remarks
        self.begin, self.targets = begin, targets[begin:]
        self.segments = goal.motions[begin:]
        types = self.segments.types
        #: (n,) type numbers; AUTO has become LINEAR, and a segment replaced by a joint move JOINT.
        self.kinds = np.where(types == int(SegmentType.AUTO), int(_LINEAR), types)
        #: (n,) whether each segment is a straight line in joint space.
        self.is_joint_move: Flags = IS_JOINT_MOVE[self.kinds]
        # Remarks with their rows, by which they are sorted below.
        found: list[tuple[int, str]] = []
        #: (n,) blend radii [m].
        self.radii = self._radii(found)
        self.path = BlendedPath(self._curves(start, found))
        remarks += [text for _, text in sorted(found, key=lambda remark: remark[0])]
        self._check_first_blend(start)
        self._part_touching_blends(start)
        self._find_blends()
        #: (n, 6) the configuration at each waypoint [rad].
        self.joints = np.zeros((len(self), 6))
        #: (n,) the curve parameter ``u`` up to which each curve is solved.
        self.solved_until = np.ones(len(self))

    def __len__(self) -> int:
        return len(self.kinds)

    def target(self, row: int) -> Pose:
        """Return the pose of a waypoint in the frame of the path."""
        return pose_from_row(self.targets[row])

    def _find_blends(self) -> None:
        can_blend = np.append(_CAN_BLEND[self.kinds[:-1], self.kinds[1:]], True)
        wants_blend = self.radii > SAME_POSITION  # the wire rounds smaller radii to 0
        #: (n,) whether each segment is blended into the next one; (n,) whether it stops instead,
        #: because the robot cannot blend the two types.
        self.is_blended, self.stops_instead = wants_blend & can_blend, wants_blend & ~can_blend

    def stop_at(self, row: int) -> None:
        """Remove the blend from a segment into the next one."""
        self.radii[row] = 0.0
        self._find_blends()

    def make_joint_move(self, row: int) -> None:
        """
        Replace a line or an arc by a joint move.

        The next curve then begins in the waypoint's own orientation, even if the replaced segment
        was a FIXED arc, which arrives in another one.
        """
        self.kinds[row], self.is_joint_move[row] = _JOINT, True
        self._find_blends()
        after = row + 1
        if after < len(self) and not self.is_joint_move[after]:
            start, end = (self.targets[k : k + 1].copy() for k in (row, after))
            arcs_of = self.segments[after : after + 1], self._goal.T_base_frame
            rows, arcs, faults = goal_arcs(*arcs_of, start, end)
            self._check(after, self.target(row), faults.get(0))
            self.path.curves.put_line(after, start[0], end[0])
            self.path.curves.put_arcs(rows + after, arcs)
            if arcs.is_fixed.any():
                self._remarks += self._turn_remarks(after, pose_from_row(end[0]))

    # -- curves ----------------------------------------------------------------------------------

    def _curves(self, start: Pose, remarks: list[tuple[int, str]]) -> CurveRows:
        """Return the curves of lines and arcs; the rows of joint moves have no meaning."""
        starts, ends = np.concatenate([[start.row()], self.targets[:-1]]), self.targets.copy()
        curves, faults = curves_of(self.segments, self._goal.T_base_frame, starts, ends)
        suspect = ~self.is_joint_move & (curves.angle > pi - 2.0 * HALF_TURN)
        suspect[[*faults]] = True
        for row in rows_where(suspect):
            self._check(row, pose_from_row(starts[row]), faults.get(row))
        for row in rows_where(self.segments.arc_modes == int(ArcMode.FIXED)):
            remarks += [(row, text) for text in self._turn_remarks(row, pose_from_row(ends[row]))]
        return curves

    def _check(self, row: int, start: Pose, fault: str | None) -> None:
        """Refuse an ambiguous turn from the pose ``start``, and an arc with a fault."""
        if self.segments.arc_modes[row] != ArcMode.FIXED:
            self._check_turn(row, start)
        if fault:
            raise arc_error(self.begin + row, fault)

    def _turn_remarks(self, row: int, end: Pose) -> list[str]:
        """Return the remark on an arc that arrives in another orientation than the target's."""
        off = end.angle_to(self.target(row))
        if off <= self._options.start_tolerance_angle:
            return []
        return [
            f'point {self.begin + row}: the orientation is ignored, because arc_mode FIXED turns '
            f'the tool with the arc; it arrives {degrees(off):.1f} degrees off'
        ]

    def _check_turn(self, row: int, start: Pose) -> None:
        """Refuse a turn whose direction is ambiguous."""
        turn = start.angle_to(self.target(row))
        if turn > pi - HALF_TURN:
            raise InvalidGoal(
                point_field(self.begin + row, 'pose.orientation'),
                f'turns the tool by {degrees(turn):.2f} degrees, so that the direction of the '
                'rotation is ambiguous',
                'add a point in between, or use a JOINT segment',
            )

    # -- radii -----------------------------------------------------------------------------------

    def _radii(self, remarks: list[tuple[int, str]]) -> Floats:
        """Return the blend radii (n,) [m], rounded as the wire carries them."""
        radii = self.segments.blend_radii.copy()
        radii[-1] = 0.0
        rounded, found = round_radii(radii, self.begin, self._options)
        remarks += found
        return rounded

    def _check_first_blend(self, start: Pose) -> None:
        if self.radii[0] <= 0.0:
            return
        target = self.target(0)
        if is_same_pose(start, target) and self.begin not in self._goal.waypoints.postures:
            self.radii[0] = 0.0  # the robot is already there, as the report says
            return
        check_blends_fit(self.begin, start.distance_to(target), 0.0, float(self.radii[0]))

    def _part_touching_blends(self, start: Pose) -> None:
        """
        Shorten blends that touch each other or the end of a segment.

        Such blends, rounded to micrometres for the wire, could overlap: the robot would skip a
        point.
        """
        radii = self.radii
        positions = np.concatenate([[start.position], self.targets[:, :3]])
        lengths = distance_rows(positions[:-1], positions[1:])
        both = radii + np.append(0.0, radii[:-1])
        for row in rows_where((both > lengths - 2.0 * _MIN_BLEND_GAP) & (both > 0.0)):
            before, after = float(radii[row - 1]) if row else 0.0, float(radii[row])
            # Rounding must not decide which of two equal blends is shortened.
            length = dist(positions[row].tolist(), positions[row + 1].tolist())
            excess = before + after - (length - _MIN_BLEND_GAP)
            if excess > 0.0 and before + after > 0.0:
                shortened, radius = (row, after) if after >= before else (row - 1, before)
                radii[shortened] = round_down(max(radius - excess, 0.0), self._options)
