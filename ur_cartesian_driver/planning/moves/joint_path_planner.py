# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Plan the joint path of a whole goal: the curve of each segment and its joint configurations.

Lines and arcs that follow each other, with the blends between them, are a *run*: its poses are
known beforehand, so the joints are solved at once. A joint move ends a run, because it begins in
the configuration in which the run arrives. So does a line that has to become a joint move
(``on_posture_change: movej``): the joint move replaces it, and the rest is solved again.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from ur_cartesian_driver.kinematics.inverse_rows import nearest_rows
from ur_cartesian_driver.motion.errors import (
    GoalRefused,
    InvalidPosture,
    JointLimitExceeded,
    NearSingularity,
    NotAvailable,
    Unreachable,
)
from ur_cartesian_driver.motion.goal import Segment, SegmentType
from ur_cartesian_driver.motion.goal_table import GoalTable, NO_POSTURE
from ur_cartesian_driver.motion.pose import Pose, pose_rows
from ur_cartesian_driver.motion.pose_rows import compose_rows, Floats
from ur_cartesian_driver.motion.primitive import Joints
from ur_cartesian_driver.motion.vectors import vector6
from ur_cartesian_driver.planning.geometry.blend import BlendInput, blends
from ur_cartesian_driver.planning.geometry.curves import (
    is_same_pose,
    JointLineCurve,
    SAME_POSITION,
    trim_end,
)
from ur_cartesian_driver.planning.geometry.samples import CurvePiece
from ur_cartesian_driver.planning.moves.path_margins import PathMargins, SolvedPieces
from ur_cartesian_driver.planning.moves.segment_data import SegmentGeometry
from ur_cartesian_driver.planning.moves.segment_draft import (
    can_blend,
    JOINT_SPACE_TYPES,
    SegmentDraft,
    SegmentDraftBuilder,
)
from ur_cartesian_driver.planning.options import PlanningOptions
from ur_cartesian_driver.planning.preflight.joint_path_solver import (
    JointPath,
    max_path_length,
    sample_joint_moves,
    solve_joint_path,
)
from ur_cartesian_driver.planning.preflight.tcp_kinematics import (
    max_joint_change,
    named_joints,
    TcpKinematics,
)
from ur_cartesian_driver.planning.preflight.tightest_margins import (
    first_refusal,
    near_singularity_refusal,
    singularity_distance_rows,
)
from ur_cartesian_driver.planning.request.blend_limits import check_blend_parameters
from ur_cartesian_driver.planning.request.goal_fields import (
    point_field,
    segment_field,
)
from ur_cartesian_driver.planning.request.validate import duplicate_point_error

#: Solutions that differ by less are the same [rad].
SAME_SOLUTION = 1e-6
#: How far from a joint line the arm may leave a blend into it [rad].
_MAX_LINE_OFFSET = 0.05
#: Segments of the first run where lines may become joint moves; each later one doubles.
_FIRST_RUN = 8

_JOINT = SegmentType.JOINT
#: The refusals of a line or an arc for which a joint move may replace it.
_NO_STRAIGHT_PATH = (InvalidPosture, NearSingularity, JointLimitExceeded, Unreachable)


class JointPathPlanner:
    """
    Plans the segments of one goal, one after the other, from the pose of the robot.

    :param targets: the poses of all waypoints in base.
    :param remarks: on what is changed or ignored; added to.
    :param reasons: by waypoint, for a primitive other than the plain one; added to.
    """

    def __init__(
        self,
        goal: GoalTable,
        targets: Sequence[Pose],
        kinematics: TcpKinematics,
        options: PlanningOptions,
        remarks: list[str],
        reasons: dict[int, list[str]],
    ) -> None:
        """Begin with no segment."""
        self.goal, self.targets, self.kinematics, self.options = goal, targets, kinematics, options
        self.remarks, self.reasons = remarks, reasons
        self.path_margins = PathMargins(kinematics.arm)
        self._draft_builder = SegmentDraftBuilder(goal, targets, options, remarks)
        self._max_path_length = max_path_length(kinematics)
        self._replaces = options.on_posture_change == 'movej'

    def geometries(
        self, begin: int, T_base_tcp: Pose, q: Joints, times: Sequence[float | None]
    ) -> list[SegmentGeometry]:
        """
        Return every segment with its curve, its blends and the configuration at its end.

        :param begin: index of the first waypoint with a motion.
        :param T_base_tcp: pose of the tool at the start, ``q`` the joint positions [rad].
        :param times: of each segment [s]; None = by speed.
        :raises GoalRefused: the arm cannot go there.
        """
        self._q_start = self._q = q
        self._drafts = self._draft_builder.build_all(begin, T_base_tcp)
        k, limit = 0, _FIRST_RUN if self._replaces else len(self._drafts)
        while k < len(self._drafts):
            if self._drafts[k].kind in JOINT_SPACE_TYPES:
                self._joint_move(k)
                k += 1
                continue
            stop = self._end_of_run(k, limit)
            resume_at = self._run(k, stop)
            limit = 2 * limit if resume_at == stop else _FIRST_RUN
            k = resume_at
        self._remark_stops()
        return list(self._geometries(times))

    # -- runs ------------------------------------------------------------------------------------

    def _end_of_run(self, k: int, limit: int) -> int:
        stop = min(k + limit, len(self._drafts))
        joint_moves = (n for n in range(k, stop) if self._drafts[n].kind in JOINT_SPACE_TYPES)
        return next(joint_moves, stop)

    def _run(self, k: int, stop: int) -> int:
        """
        Solve the segments from k to stop; return the index to continue with.

        That is k again if one of them has become a joint move.
        """
        self._make_blends(k, stop)
        joint_path = solve_joint_path(self.kinematics, self._pieces(k, stop), self._q)
        measures = singularity_distance_rows(self.kinematics.arm, joint_path.q)
        refusal, index = first_refusal(joint_path, measures, self.options)
        drafts = self._drafts[k:stop]
        arrivals = self._arrivals(drafts, joint_path)
        for draft, joints in zip(drafts, arrivals, strict=True):
            if refusal is not None and draft.index >= index:
                break
            if (wrong := self._posture_refusal(draft, joints)) is not None:
                refusal, index = wrong, draft.index
                break
        if refusal is not None:
            self._replace(max(k, index - self._drafts[0].index), refusal)
            return k
        for draft, joints in zip(drafts, arrivals, strict=True):
            draft.joints = joints
        drafts[-1].checked_until = self._end(stop - 1)
        self._add(joint_path, measures)
        return stop

    def _add(self, joint_path: JointPath, measures: Floats) -> None:
        """Add what is solved from where the arm is, and move the arm to its end."""
        self.path_margins.add(SolvedPieces(joint_path, measures, self._q))
        if len(joint_path.q):
            self._q = vector6(joint_path.q[-1].tolist())

    def _make_blends(self, k: int, stop: int) -> None:
        """Make the blends of a run, including the one into it."""
        drafts = self._drafts
        inputs: list[BlendInput] = []
        indices: list[int] = []
        for n in range(k, stop):
            drafts[n].blend_before = None
            if n > 0:
                drafts[n - 1].blend_after = None
                if self._is_blended(n - 1):
                    first, second = drafts[n - 1], drafts[n]
                    fillet = first.kind == second.kind == SegmentType.PROCESS
                    inputs.append(
                        BlendInput(first.known_curve, second.known_curve, first.radius, fillet)
                    )
                    indices.append(n)
        for n, blend in zip(indices, blends(inputs), strict=True):
            drafts[n - 1].blend_after = drafts[n].blend_before = blend
        for n in range(max(k - 1, 0), stop):
            self._check_overlap(n)

    def _pieces(self, k: int, stop: int) -> list[CurvePiece]:
        """Return the pieces from where the path is solved to where the last segment is left."""
        pieces: list[CurvePiece] = []
        for n in range(k, stop):
            draft = self._drafts[n]
            pieces += self._entry(n)
            begin, end = draft.u_join, self._end(n)
            max_step = self._max_path_length / max(draft.known_curve.length, 1e-300)
            if end > begin or not (draft.blend_before or draft.blend_after):
                pieces.append(
                    CurvePiece.part(
                        draft.index, draft.known_curve, begin, min(end, begin + max_step)
                    )
                )
        return pieces

    def _entry(self, n: int) -> list[CurvePiece]:
        """Return the piece into a segment: the blend, or the rest of the segment before."""
        if n == 0:
            return []
        before = self._drafts[n - 1]
        if before.blend_after is not None:
            return [CurvePiece.blend(before.index, before.blend_after)]
        if before.checked_until < 1.0:
            return [CurvePiece.part(before.index, before.known_curve, before.checked_until, 1.0)]
        return []

    def _end(self, n: int) -> float:
        """Return the ``u`` where a segment is left, also where its blend is not made yet."""
        draft = self._drafts[n]
        if draft.blend_after is not None:
            return draft.blend_after.leave
        return trim_end(draft.known_curve, draft.radius) if self._is_blended(n) else 1.0

    def _arrivals(self, drafts: list[SegmentDraft], joint_path: JointPath) -> list[Joints]:
        """Return the configuration at the waypoint of each segment, as far as solved."""
        indices = [draft.index for draft in drafts]
        last = np.searchsorted(joint_path.segments, indices, side='right') - 1
        if not len(joint_path.q):
            return [self._q for _ in drafts]
        q = joint_path.q[np.maximum(last, 0)]
        rounded = [
            n
            for n, draft in enumerate(drafts)
            if self._end(draft.index - self._drafts[0].index) < 1.0
        ]
        if rounded:
            # The arm does not reach it, but the report and joint moves from there need it.
            ends = pose_rows(drafts[n].known_curve.end for n in rounded)
            there = nearest_rows(
                self.kinematics.arm, compose_rows(ends, self.kinematics.T_tcp_flange), q[rounded]
            )
            q[rounded] = np.where(np.isnan(there), q[rounded], there)
        return [(a, b, c, d, e, f) for a, b, c, d, e, f in q.tolist()]

    def _posture_refusal(self, draft: SegmentDraft, q: Joints) -> InvalidPosture | None:
        """Return the refusal of a line or an arc that misses its posture."""
        clause = self.kinematics.explain_missed_posture(
            draft.known_curve.end,
            self.goal.waypoints.postures.get(draft.index, NO_POSTURE),
            q,
            draft.index,
            self.options.tf_prefix,
        )
        if not clause:
            return None
        return InvalidPosture(
            f'{point_field(draft.index, "posture")} cannot be reached by a straight or circular '
            f'move: {clause}; use a JOINT segment, or set on_posture_change to movej.'
        )

    def _replace(self, n: int, refusal: GoalRefused) -> None:
        """Make a segment a joint move, or refuse the goal."""
        draft = self._drafts[n]
        if not self._replaces or not isinstance(refusal, _NO_STRAIGHT_PATH):
            raise refusal
        self.remarks.append(
            f'point {draft.index}: JOINT instead of {draft.kind.name} '
            f'(on_posture_change = movej), which would be refused: {refusal}'
        )
        self.reasons.setdefault(draft.index, []).append(
            'the posture needs a joint move'
            if isinstance(refusal, InvalidPosture)
            else 'there is no straight path'
        )
        draft.kind, draft.curve, draft.blend_before = _JOINT, None, None
        if n + 1 < len(self._drafts) and self._drafts[n + 1].curve is not None:
            after = self._drafts[n + 1]
            after.curve = self._draft_builder.line_or_arc(after, self.targets[draft.index])

    # -- joint moves -----------------------------------------------------------------------------

    def _joint_move(self, k: int) -> None:
        draft, i = self._drafts[k], self._drafts[k].index
        q = self._start_joints(k)
        target, posture = self.targets[i], self.goal.waypoints.postures.get(i)
        where = point_field(i, 'pose')
        if posture:
            named = named_joints(posture, self.options.tf_prefix)
            chosen = self.kinematics.solve_posture(target, named, q, where)
        else:
            chosen = self.kinematics.nearest(target, q, where)
        line = JointLineCurve.between(self.kinematics.arm, self.kinematics.T_flange_tcp, q, chosen)
        if i == 0 and max(line.travel) <= SAME_SOLUTION:
            draft.radius = 0.0
        draft.curve, draft.joints = line, chosen
        self._make_blends(k, k + 1)
        self._solve_entry(k)
        self._add_joint_move([CurvePiece.part(i, line, draft.u_join, self._end(k))])
        draft.checked_until = self._end(k)

    def _start_joints(self, k: int) -> Joints:
        """Return the configuration in which a joint move begins: that at the waypoint before."""
        if k == 0:
            return self._q_start
        before = self._drafts[k - 1]
        if before.checked_until == 1.0 or isinstance(before.known_curve, JointLineCurve):
            return before.known_joints
        # A blended waypoint may be out of reach, but not one at which a joint line begins: the
        # robot needs the joints in which the rest of the segment would arrive.
        rest = solve_joint_path(
            self.kinematics,
            [CurvePiece.part(before.index, before.known_curve, before.checked_until, 1.0)],
            self._q,
        )
        if rest.refusal is not None:
            raise rest.refusal
        return vector6(rest.q[-1].tolist())

    def _solve_entry(self, k: int) -> None:
        """Solve what leads into a joint move."""
        pieces = self._entry(k)
        if not pieces:
            return
        if pieces[0].is_in_joint_space:
            self._add_joint_move(pieces)
            return
        joint_path = solve_joint_path(self.kinematics, pieces, self._q)
        if joint_path.refusal is not None:
            raise joint_path.refusal
        measures = singularity_distance_rows(self.kinematics.arm, joint_path.q)
        measures[joint_path.segments == self._drafts[k].index] = np.inf
        near = near_singularity_refusal(joint_path, measures, self.options)
        if near is not None:
            raise near[0]
        self._add(joint_path, measures)
        line = self._drafts[k].known_curve
        assert isinstance(line, JointLineCurve)
        joins = line.joints(self._drafts[k].u_join)
        if max_joint_change(self._q, joins) > _MAX_LINE_OFFSET:
            raise self.kinematics.discontinuity_error(
                line.pose(self._drafts[k].u_join),
                self._q,
                joins,
                f'{segment_field(self._drafts[k - 1].index, "blend_radius")}',
            )

    def _add_joint_move(self, pieces: list[CurvePiece]) -> None:
        joint_path = sample_joint_moves(self.kinematics, pieces)
        # Singularities do not matter here.
        self._add(joint_path, np.full((len(joint_path.t), 3), np.inf))

    # -- blends ----------------------------------------------------------------------------------

    def _is_blended(self, n: int) -> bool:
        """Tell whether a segment is blended into the next one."""
        if n + 1 >= len(self._drafts) or self._drafts[n].radius <= SAME_POSITION:
            return False  # the wire rounds such a radius to 0
        return can_blend(self._drafts[n], self._drafts[n + 1])

    def _check_overlap(self, n: int) -> None:
        draft = self._drafts[n]
        if draft.curve is not None:
            check_blend_parameters(draft.index, draft.u_join, self._end(n))

    def _remark_stops(self) -> None:
        for n, draft in enumerate(self._drafts[:-1]):
            after = self._drafts[n + 1]
            if draft.radius > SAME_POSITION and not can_blend(draft, after):
                self.remarks.append(
                    f'point {draft.index}: stops instead of blending, because the robot cannot '
                    f'blend from {draft.kind.name} into {after.kind.name}'
                )

    # -- segments --------------------------------------------------------------------------------

    def _geometries(self, times: Sequence[float | None]) -> Iterator[SegmentGeometry]:
        speed_bounds = self.path_margins.joint_speed_bounds()
        margins = self.path_margins.tightest_margin()
        points = self.goal.waypoints[self._drafts[0].index :]
        for draft, point, time in zip(self._drafts, points, times, strict=True):
            i = draft.index
            geometry = SegmentGeometry(
                index=i,
                kind=draft.kind,
                waypoint=point,
                segment=draft.segment,
                curve=draft.known_curve,
                joints=draft.known_joints,
                time=time,
                speed_bound=speed_bounds[i],
                tightest_margin=margins[i],
                blend_before=draft.blend_before,
                blend_after=draft.blend_after,
                u_join=draft.u_join,
                u_leave=draft.u_leave,
                unblended_fraction=max(draft.u_leave - draft.u_join, 1e-9),
            )
            yield self._at_first_point(geometry) if self._has_no_motion(geometry) else geometry

    def _has_no_motion(self, geometry: SegmentGeometry) -> bool:
        if geometry.curve.length > SAME_POSITION:
            return False
        if isinstance(geometry.curve, JointLineCurve):
            return max(geometry.curve.travel) <= SAME_SOLUTION
        return is_same_pose(geometry.curve.start, geometry.curve.end)

    def _at_first_point(self, geometry: SegmentGeometry) -> SegmentGeometry:
        """Return the segment to a first point where the robot already is; refuse others."""
        i = geometry.index
        if i > 0:
            raise duplicate_point_error(self.goal, i)
        waits = bool(geometry.time)
        wait_clause = f', and waits {geometry.time:g} s' if waits else ''
        if waits and self.options.dialect.is_coarse:
            raise NotAvailable(
                point_field(i, 'time_from_start'),
                f'is {geometry.time:g} s, but the robot is already there and cannot wait, because '
                f'no times are sent in wire dialect {self.options.dialect.name}',
                'set it to 0, and the later times accordingly',
            )
        self.remarks.append(f'point 0: the robot is already there{wait_clause}')
        self.reasons[0] = [f'the robot is already there{wait_clause}']
        kind = geometry.kind if geometry.kind == _JOINT else SegmentType.LINEAR
        return replace(
            geometry,
            kind=kind,
            segment=Segment(type=geometry.segment.type),
            waypoint=replace(geometry.waypoint, twist=(0.0,) * 6),
            waits=waits,
        )
