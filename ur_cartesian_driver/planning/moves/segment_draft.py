# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Segment drafts: the segments as the goal alone defines them, before the kinematics is known.

Lines and arcs follow from the points; joint moves do not, because they begin in the configuration
in which the path before them arrives.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import degrees, pi

from ur_cartesian_driver.motion.errors import InvalidGoal
from ur_cartesian_driver.motion.goal import ArcMode, Segment, SegmentType
from ur_cartesian_driver.motion.goal_table import GoalTable
from ur_cartesian_driver.motion.pose import Pose
from ur_cartesian_driver.motion.primitive import Joints
from ur_cartesian_driver.planning.geometry.blend import Blend
from ur_cartesian_driver.planning.geometry.curves import (
    HALF_TURN,
    is_same_pose,
    LineCurve,
    SegmentCurve,
)
from ur_cartesian_driver.planning.options import PlanningOptions
from ur_cartesian_driver.planning.request.blend_limits import check_blends_fit, round_blend_radius
from ur_cartesian_driver.planning.request.goal_fields import point_field
from ur_cartesian_driver.planning.request.validate import arc_through_via

_LINEAR, _JOINT = SegmentType.LINEAR, SegmentType.JOINT
_OPTIMIZED = (SegmentType.OPTIMIZED_LINEAR, SegmentType.OPTIMIZED_JOINT)
#: Motions on straight lines in joint space.
JOINT_SPACE_TYPES = (SegmentType.JOINT, SegmentType.OPTIMIZED_JOINT)
#: What is left of a segment between blends that touch, or that reach its end [m]: more than the
#: rounding of two poses and two radii to micrometres.
_MIN_BLEND_GAP = 5e-6
#: Motions that only some others can be blended into; all others stop before them.
_BLENDS_FROM = {
    SegmentType.JOINT: (_LINEAR, _JOINT),
    SegmentType.OPTIMIZED_LINEAR: (_LINEAR, _JOINT, *_OPTIMIZED),
    SegmentType.OPTIMIZED_JOINT: (_LINEAR, _JOINT, *_OPTIMIZED),
}


@dataclass(slots=True)
class SegmentDraft:
    """A segment while its curve and joints are being found."""

    index: int
    kind: SegmentType
    segment: Segment
    radius: float
    #: None = a joint move whose start is not known yet.
    curve: SegmentCurve | None = None
    joints: Joints | None = None
    blend_before: Blend | None = None
    blend_after: Blend | None = None
    #: The ``u`` up to which its curve is solved.
    checked_until: float = 1.0

    @property
    def u_join(self) -> float:
        """The ``u`` where its curve is joined."""
        return self.blend_before.join if self.blend_before else 0.0

    @property
    def u_leave(self) -> float:
        """The ``u`` where its curve is left, once its blend is made."""
        return self.blend_after.leave if self.blend_after else 1.0

    @property
    def known_curve(self) -> SegmentCurve:
        """Its curve, where it is known."""
        assert self.curve is not None
        return self.curve

    @property
    def known_joints(self) -> Joints:
        """Its configuration at the end, where it is known."""
        assert self.joints is not None
        return self.joints


class SegmentDraftBuilder:
    """
    Makes the drafts of one goal.

    :param targets: the poses of all waypoints in base.
    :param remarks: on what is ignored or changed; added to.
    """

    def __init__(
        self,
        goal: GoalTable,
        targets: Sequence[Pose],
        options: PlanningOptions,
        remarks: list[str],
    ) -> None:
        """Keep the goal."""
        self._goal, self._targets, self._options = goal, targets, options
        self._remarks = remarks

    def build_all(self, begin: int, start: Pose) -> list[SegmentDraft]:
        """
        Return the drafts from a waypoint on.

        :param start: pose of the tool in base.
        """
        drafts: list[SegmentDraft] = []
        before, last = start, len(self._goal.waypoints) - 1
        for i, segment in enumerate(self._goal.motions[begin:], begin):
            kind = _LINEAR if segment.type == SegmentType.AUTO else SegmentType(segment.type)
            radius = (
                0.0
                if i == last
                else round_blend_radius(
                    segment.blend_radius, i, self._options.dialect, self._remarks
                )
            )
            draft = SegmentDraft(i, kind, segment, radius)
            if kind not in JOINT_SPACE_TYPES:
                draft.curve = self.line_or_arc(draft, before)
            drafts.append(draft)
            before = draft.curve.end if draft.curve else self._targets[i]
        self._check_first_blend(drafts[0], start)
        if any(draft.radius > 0.0 for draft in drafts):
            self._part_touching_blends(drafts, start)
        return drafts

    def line_or_arc(self, draft: SegmentDraft, start: Pose) -> SegmentCurve:
        """Return the line or the arc of a segment from a pose."""
        i, segment = draft.index, draft.segment
        turn = start.angle_to(self._targets[i])
        follows_arc = draft.kind == SegmentType.CIRCULAR and segment.arc_mode == ArcMode.FIXED
        if turn > pi - HALF_TURN and not follows_arc:
            raise InvalidGoal(
                point_field(i, 'pose.orientation'),
                f'turns the tool by {degrees(turn):.2f} degrees, so that the direction of the '
                'rotation is ambiguous',
                'add a point in between, or use a JOINT segment',
            )
        if draft.kind != SegmentType.CIRCULAR:
            return LineCurve.between(start, self._targets[i])
        assert segment.via is not None
        arc = arc_through_via(
            i, start, self._goal.T_base_frame @ segment.via, self._targets[i], segment.arc_mode
        )
        off = arc.end.angle_to(self._targets[i])
        if off > self._options.start_tolerance_angle:
            self._remarks.append(
                f'point {i}: the orientation is ignored, because arc_mode FIXED turns the tool '
                f'with the arc; it arrives {degrees(off):.1f} degrees off'
            )
        return arc

    def _check_first_blend(self, first: SegmentDraft, start: Pose) -> None:
        if first.radius <= 0.0:
            return
        target = self._targets[first.index]
        if is_same_pose(start, target) and first.index not in self._goal.waypoints.postures:
            first.radius = 0.0  # the robot is already there, as the report says
            return
        check_blends_fit(first.index, start.distance_to(target), 0.0, first.radius)

    def _part_touching_blends(self, drafts: Sequence[SegmentDraft], start: Pose) -> None:
        """
        Shorten blends that touch each other or the end of a segment.

        Rounded to micrometres they would overlap on the wire, and the robot would skip a point.
        """
        before, last = start, 0.0
        for n, draft in enumerate(drafts):
            target = self._targets[draft.index]
            if draft.radius > 0.0 or last > 0.0:
                excess = last + draft.radius - (before.distance_to(target) - _MIN_BLEND_GAP)
                if excess > 0.0:
                    shortened = draft if draft.radius >= last else drafts[n - 1]
                    shortened.radius = self._options.dialect.round_down_radius(
                        max(shortened.radius - excess, 0.0)
                    )
            before, last = target, draft.radius


def can_blend(first: SegmentDraft, second: SegmentDraft) -> bool:
    """Tell whether the robot can blend from the motion of one segment into that of the next."""
    allowed = _BLENDS_FROM.get(second.kind)
    return allowed is None or first.kind in allowed
