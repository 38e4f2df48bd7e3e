# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Plan the joint path of a whole goal: the curve of each segment and its joint configurations.

Consecutive lines and arcs, with the blends between them, form a *run*. The poses of a run are
known beforehand, so its joints are solved in one pass. A joint move ends a run, because the move
begins in the configuration in which the run arrives. A line or an arc that has to become a joint
move (``on_posture_change: movej``) also ends its run, which is then solved again up to that move.
"""

from __future__ import annotations

from dataclasses import replace
from math import nan

import numpy as np

from ur_cartesian_driver.kinematics.inverse_rows import nearest_rows
from ur_cartesian_driver.motion.errors import (
    GoalRefused,
    InvalidPosture,
    JointLimitExceeded,
    NearSingularity,
    Unreachable,
)
from ur_cartesian_driver.motion.geometry.arrays import Flags, Floats
from ur_cartesian_driver.motion.geometry.pose import Pose, pose_from_row
from ur_cartesian_driver.motion.geometry.vectors import Joints, vector6, ZERO6
from ur_cartesian_driver.motion.goal.goal import Posture, Segment, SegmentType
from ur_cartesian_driver.motion.goal.goal_columns import (
    GoalTable,
    rows_where,
    SegmentRows,
    WaypointRows,
)
from ur_cartesian_driver.planning.geometry.curves import JointLineCurve, SAME_ANGLE, SAME_POSITION
from ur_cartesian_driver.planning.geometry.samples import (
    check_sample_count,
    CurvePieces,
    joined_columns,
)
from ur_cartesian_driver.planning.moves.path_samples import BlendSamples, PathSamples, speed_bounds
from ur_cartesian_driver.planning.moves.segment_drafts import SegmentDrafts
from ur_cartesian_driver.planning.moves.segment_geometries import SegmentGeometries
from ur_cartesian_driver.planning.options import PlanningOptions
from ur_cartesian_driver.planning.preflight.clearance import JointSamples
from ur_cartesian_driver.planning.preflight.joint_path_solver import (
    JointPath,
    max_path_length,
    sample_joint_move,
    solve_joint_path,
)
from ur_cartesian_driver.planning.preflight.tcp_kinematics import max_joint_change, TcpKinematics
from ur_cartesian_driver.planning.preflight.tightest_margins import (
    first_refusal,
    near_singularity_refusal,
    singularity_distance_rows,
    tightest_margins,
)
from ur_cartesian_driver.planning.request.blend_limits import (
    blend_uncertainty,
    check_blend_parameters,
)
from ur_cartesian_driver.planning.request.goal_fields import (
    FOLLOWS_BLEND_LAWS,
    IS_LINEAR,
    IS_PROCESS,
    point_field,
    segment_field,
)
from ur_cartesian_driver.planning.request.joint_points import JointPositions, named_joints
from ur_cartesian_driver.planning.request.program_features import check_wait
from ur_cartesian_driver.planning.request.validate import duplicate_point_error

#: Joint solutions that differ by at most this [rad] count as the same.
SAME_SOLUTION = 1e-6
#: Largest difference [rad] between the arm's joints and a joint line at the end of the blend into
#: that line.
_MAX_LINE_OFFSET = 0.05
#: Maximum number of segments in the first run, if lines may become joint moves; the maximum
#: doubles after each solved run, and is reset after a replacement.
_FIRST_RUN = 8
#: Maximum number of samples of a goal: a million short segments with blends need three million.
_MAX_SAMPLES = 4_000_000

_JOINT = SegmentType.JOINT
#: Refusals after which a line or an arc can be replaced by a joint move.
_NO_STRAIGHT_PATH = (InvalidPosture, NearSingularity, JointLimitExceeded, Unreachable)


class JointPathPlanner:
    """
    Plans the joint paths of the segments of one goal in order, beginning at the robot's pose.

    :param targets: the poses of all waypoints in the frame of the path (n, 7).
    :param remarks: list to which remarks on changed or ignored fields are appended.
    :param reasons: for each waypoint, the list to which reasons for a special primitive are added.
    """

    def __init__(
        self,
        goal: GoalTable,
        targets: Floats,
        kinematics: TcpKinematics,
        options: PlanningOptions,
        remarks: list[str],
        reasons: dict[int, list[str]],
    ) -> None:
        """Store the goal; no segment is solved yet."""
        #: The joints at all samples of the goal; set by :meth:`geometries`.
        self.samples: JointSamples
        #: The samples in the goal's blends; set by :meth:`geometries`.
        self.blend_samples: BlendSamples
        self.goal, self.targets, self.kinematics, self.options = goal, targets, kinematics, options
        self.remarks, self.reasons = remarks, reasons
        self._max_path_length = max_path_length(kinematics)
        # A joint move would turn a held part.
        self._replaces = options.on_posture_change == 'movej' and not kinematics.frame_moves
        self._laws = options.laws
        self._blend_uncertainty = blend_uncertainty(options)

    def geometries(self, begin: int, T_frame_tool: Pose, q: Joints) -> SegmentGeometries:
        """
        Return every segment with its curve, its blends and the configuration at its end.

        :param begin: index of the first waypoint with a motion.
        :param T_frame_tool: pose of the tool in the frame of the path at the start.
        :param q: joint positions at the start [rad].
        :raises GoalRefused: the arm cannot follow the path.
        """
        self.q_start = self._q = q
        self._parts: list[PathSamples] = []
        self._sample_count = 0
        self._drafts = SegmentDrafts(
            self.goal, self.targets, begin, T_frame_tool, self.options, self.remarks
        )
        self._path = self._drafts.path
        n = len(self._drafts)
        k, limit = 0, _FIRST_RUN if self._replaces else n
        while k < n:
            if self._drafts.is_joint_move[k]:
                self._joint_move(k)
                k += 1
                continue
            stop = self._end_of_run(k, limit)
            resume_at = self._run(k, stop)
            limit = 2 * limit if resume_at == stop else _FIRST_RUN
            k = resume_at
        self._remark_stops()
        return self._geometries()

    # -- runs ------------------------------------------------------------------------------------

    def _end_of_run(self, k: int, limit: int) -> int:
        is_joint_move = self._drafts.is_joint_move[k : k + limit]
        end = int(is_joint_move.argmax())
        return k + (end or len(is_joint_move))

    def _run(self, k: int, stop: int) -> int:
        """
        Solve the segments of rows k to ``stop - 1``; return the row with which to continue.

        That row is ``stop``, or k again if a segment of the run has become a joint move.
        """
        drafts = self._drafts
        self._make_blends(k, stop)
        joint_path = solve_joint_path(self.kinematics, self._pieces(k, stop), self._q)
        measures = singularity_distance_rows(self.kinematics.arm, joint_path.q)
        refusal, index = first_refusal(joint_path, measures, self.options)
        joints = self._arrivals(k, stop, joint_path)
        postures = self.goal.waypoints.postures
        for row in range(k, stop) if postures else ():
            point = drafts.begin + row
            if refusal is not None and point >= index:
                break
            q = vector6(joints[row - k].tolist())
            if point in postures and (wrong := self._posture_refusal(row, postures[point], q)):
                refusal, index = wrong, point
        if refusal is not None:
            self._replace(max(k, index - drafts.begin), refusal)
            return k
        drafts.joints[k:stop] = joints
        drafts.solved_until[stop - 1] = self._path.u_leave[stop - 1]
        self._add(joint_path, measures)
        return stop

    def _add(self, joint_path: JointPath, measures: Floats) -> None:
        """Add the samples of a joint path; the next run begins in its last configuration."""
        self._parts.append(PathSamples.of(joint_path, measures))
        self._sample_count += len(joint_path.q)
        if len(joint_path.q):
            self._q = vector6(joint_path.q[-1].tolist())

    def _make_blends(self, k: int, stop: int) -> None:
        """Make the blends of a run and the blend into it; leave room for the blend after it."""
        drafts, path, first = self._drafts, self._path, max(k - 1, 0)
        path.remove_blends(first, stop)
        if not drafts.is_blended[first:stop].any():
            return
        rows = first + np.flatnonzero(drafts.is_blended[first:stop])
        by_laws = FOLLOWS_BLEND_LAWS[drafts.kinds]
        reach = drafts.radii * np.where(by_laws, self._laws.blend_begin, 1.0)
        path.leave(rows, reach[rows])
        made = rows[rows < stop - 1]
        fillet = IS_PROCESS[drafts.kinds[made]] & IS_PROCESS[drafts.kinds[made + 1]]
        path.make_blends(made, drafts.radii[made], reach[made], fillet)
        is_line = IS_LINEAR[drafts.kinds]
        measured = made[is_line[made] & is_line[made + 1]]
        path.blend_tolerance[measured] *= self._blend_uncertainty
        for row in rows_where(path.u_join[first:stop] > path.u_leave[first:stop]):
            u_join, u_leave = path.u_join[first + row], path.u_leave[first + row]
            check_blend_parameters(drafts.begin + first + row, float(u_join), float(u_leave))

    def _pieces(self, k: int, stop: int) -> CurvePieces:
        """Return the pieces from the end of the solved path to the end of the run."""
        path, rows = self._path, np.arange(k, stop)
        begin, end = path.u_join[rows], path.u_leave[rows]
        after_blend, before_blend = path.has_blend_before[rows], path.has_blend_after[rows]
        is_used = np.stack([after_blend, (end > begin) | ~(after_blend | before_blend)], axis=1)
        is_used[0, 0] = False  # added by _entry()
        end = np.minimum(
            end, begin + self._max_path_length / np.maximum(path.curves.length[rows], 1e-300)
        )
        blends = np.stack([2.0 * rows - 1.0, np.zeros(len(rows)), np.ones(len(rows))], axis=1)
        curves = np.stack([2.0 * rows, begin, end], axis=1)
        return self._curve_pieces(
            np.concatenate([self._entry(k), np.stack([blends, curves], axis=1)[is_used]])
        )

    def _entry(self, k: int) -> Floats:
        """Return the unsolved piece before segment k as a row for _curve_pieces(), or no row."""
        if k > 0 and self._path.radius[k - 1] > 0.0:
            return np.array([(2.0 * k - 1.0, 0.0, 1.0)])
        if k > 0 and self._drafts.solved_until[k - 1] < 1.0:
            return np.array([(2.0 * k - 2.0, self._drafts.solved_until[k - 1], 1.0)])
        return np.empty((0, 3))

    def _curve_pieces(self, pieces: Floats) -> CurvePieces:
        """Return the curve pieces of rows (n, 3): curve number, first and last parameter."""
        number, begin, end = pieces.T
        found = CurvePieces.of(self._path, self._drafts.begin, number.astype(np.intp), begin, end)
        check_sample_count(
            found.sample_count,
            found.index,
            'check the positions',
            before=self._sample_count,
            most=_MAX_SAMPLES,
        )
        return found

    def _arrivals(self, k: int, stop: int, joint_path: JointPath) -> Floats:
        """Return the configurations (n, 6) at the waypoints of solved segments."""
        if not len(joint_path.q):
            return np.tile(self._q, (stop - k, 1))
        indices = self._drafts.begin + np.arange(k, stop)
        last = np.searchsorted(joint_path.segments, indices, side='right') - 1
        q = joint_path.q[np.maximum(last, 0)]
        rounded = np.flatnonzero(self._path.u_leave[k:stop] < 1.0)
        if len(rounded):
            # The arm does not reach a blended waypoint, but the report and joint moves that begin
            # at the waypoint need a configuration there.
            ends = self._path.curves.end[k + rounded]
            there = nearest_rows(
                self.kinematics.arm, self.kinematics.flange_rows(ends), q[rounded]
            )
            q[rounded] = np.where(np.isnan(there), q[rounded], there)
        return q

    def _posture_refusal(self, row: int, posture: Posture, q: Joints) -> InvalidPosture | None:
        """Return the refusal if a line or an arc misses its posture, else None."""
        point = self._drafts.begin + row
        clause = self.kinematics.explain_missed_posture(
            pose_from_row(self._path.curves.end[row]),
            posture,
            q,
            point,
            self.options.tf_prefix,
        )
        if not clause:
            return None
        return InvalidPosture(
            f'{point_field(point, "posture")} cannot be reached by a straight or circular '
            f'move: {clause}; use a JOINT segment, or set on_posture_change to movej.'
        )

    def _replace(self, row: int, refusal: GoalRefused) -> None:
        """Replace a refused segment by a joint move; raise its refusal if that is not possible."""
        point = self._drafts.begin + row
        if not self._replaces or not isinstance(refusal, _NO_STRAIGHT_PATH):
            raise refusal
        self.remarks.append(
            f'point {point}: JOINT instead of {_name(self._drafts.kinds[row])} '
            f'(on_posture_change = movej), which would be refused: {refusal}'
        )
        self.reasons.setdefault(point, []).append(
            'the posture needs a joint move'
            if isinstance(refusal, InvalidPosture)
            else 'there is no straight path'
        )
        self._drafts.make_joint_move(row)

    # -- joint moves -----------------------------------------------------------------------------

    def _joint_move(self, k: int) -> None:
        drafts, i = self._drafts, self._drafts.begin + k
        q = self._start_joints(k)
        target, posture = drafts.target(k), self.goal.waypoints.postures.get(i)
        where = point_field(i, 'pose')
        if isinstance(posture, JointPositions):
            chosen = posture.joints(self.options.tf_prefix)
        elif posture:
            named = named_joints(posture, self.options.tf_prefix)
            chosen = self.kinematics.solve_posture(target, named, q, where)
        else:
            chosen = self.kinematics.nearest(target, q, where)
        line = JointLineCurve.between(self.kinematics.arm, self.kinematics.T_flange_tcp, q, chosen)
        if i == 0 and line.joint_travel <= SAME_SOLUTION:
            drafts.stop_at(k)
        self._path.curves.put_joint_line(k, line)
        drafts.joints[k] = chosen
        self._make_blends(k, k + 1)
        self._solve_entry(k, line)
        begin, end = float(self._path.u_join[k]), float(self._path.u_leave[k])
        self._add_joint_move(np.array([(2.0 * k, begin, end)]))
        drafts.solved_until[k] = end

    def _start_joints(self, k: int) -> Joints:
        """Return the configuration at the previous waypoint, where a joint move begins."""
        if k == 0:
            return self.q_start
        solved_until = self._drafts.solved_until[k - 1]
        if solved_until == 1.0 or self._path.curves.is_joint_line[k - 1]:
            return vector6(self._drafts.joints[k - 1].tolist())
        # Although the arm does not reach a blended waypoint, a joint line begins there: in the
        # configuration in which the rest of the previous segment would arrive.
        rest = self._curve_pieces(np.array([(2.0 * k - 2.0, solved_until, 1.0)]))
        joint_path = solve_joint_path(self.kinematics, rest, self._q)
        if joint_path.refusal is not None:
            raise joint_path.refusal
        return vector6(joint_path.q[-1].tolist())

    def _solve_entry(self, k: int, line: JointLineCurve) -> None:
        """Solve the piece that leads into a joint move."""
        entry = self._entry(k)
        if not len(entry):
            return
        if self._path.is_in_joint_space(int(entry[0, 0])):
            self._add_joint_move(entry)
            return
        joint_path = solve_joint_path(self.kinematics, self._curve_pieces(entry), self._q)
        if joint_path.refusal is not None:
            raise joint_path.refusal
        measures = singularity_distance_rows(self.kinematics.arm, joint_path.q)
        measures[joint_path.segments == self._drafts.begin + k] = np.inf
        near = near_singularity_refusal(joint_path, measures, self.options)
        if near is not None:
            raise near[0]
        self._add(joint_path, measures)
        u_join = float(self._path.u_join[k])
        joins = line.joints(u_join)
        if max_joint_change(self._q, joins) > _MAX_LINE_OFFSET:
            raise self.kinematics.discontinuity_error(
                line.pose(u_join),
                self._q,
                joins,
                f'{segment_field(self._drafts.begin + k - 1, "blend_radius")}',
            )

    def _add_joint_move(self, piece: Floats) -> None:
        joint_path = sample_joint_move(self.kinematics, self._curve_pieces(piece), self._path)
        # Singularities do not matter to joint moves.
        self._add(joint_path, np.full((len(joint_path.t), 3), np.inf))

    def _remark_stops(self) -> None:
        kinds = self._drafts.kinds
        for row in rows_where(self._drafts.stops_instead):
            self.remarks.append(
                f'point {self._drafts.begin + row}: stops instead of blending, because the robot '
                f'cannot blend from {_name(kinds[row])} into {_name(kinds[row + 1])}'
            )

    # -- segments --------------------------------------------------------------------------------

    def _geometries(self) -> SegmentGeometries:
        drafts, arm, times = self._drafts, self.kinematics.arm, self.goal.waypoints.times
        of = PathSamples(*joined_columns(self._parts))
        self.samples = JointSamples(of.segment, of.fraction, of.q)
        bounds, self.blend_samples = speed_bounds(arm, of, self.q_start)
        geometries = SegmentGeometries(
            begin=drafts.begin,
            kinds=drafts.kinds,
            waypoints=self.goal.waypoints[drafts.begin :],
            segments=drafts.segments,
            path=self._path,
            joints=drafts.joints,
            times=np.diff(times, prepend=0.0)[drafts.begin :]
            if times.any()
            else np.full(len(drafts), nan),
            speed_bounds=bounds,
            tightest_margins=tightest_margins(arm, of.q, of.measures, of.segment, of.fraction),
        )
        for row in rows_where(self._has_no_motion()):
            if drafts.begin + row > 0:
                raise duplicate_point_error(self.goal, drafts.begin + row)
            geometries = self._at_first_point(geometries)
        return geometries

    def _has_no_motion(self) -> Flags:
        """Return whether each segment (n,) moves neither the tool nor the joints."""
        curves = self._path.curves
        turn = np.where(curves.is_joint_line, curves.joint_travel, curves.angle)
        return (curves.length <= SAME_POSITION) & (turn <= SAME_ANGLE)

    def _at_first_point(self, geometries: SegmentGeometries) -> SegmentGeometries:
        """Return the geometries, adapted to a first segment that ends where the robot is."""
        time = float(geometries.times[0])
        waits = time > 0.0
        wait_clause = f', and waits {time:g} s' if waits else ''
        if waits:
            check_wait(time, self.options)
        self.remarks.append(f'point 0: the robot is already there{wait_clause}')
        self.reasons[0] = [f'the robot is already there{wait_clause}']
        geometries.kinds[0] = _JOINT if geometries.kinds[0] == _JOINT else SegmentType.LINEAR
        waypoint = WaypointRows.of([replace(geometries.waypoints[0], twist=ZERO6)])
        segment = SegmentRows.of([Segment(type=geometries.segments[0].type)])
        return replace(
            geometries,
            waypoints=waypoint + geometries.waypoints[1:],
            segments=segment + geometries.segments[1:],
            waits=waits,
        )


def _name(kind: int) -> str:
    """Return the name of a segment type."""
    return SegmentType(kind).name
