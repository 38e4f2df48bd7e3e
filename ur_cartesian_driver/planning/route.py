# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Which way each segment goes, and in which configurations: the look ahead along a whole goal.

Straight lines and arcs that follow each other, with the corners between them, are a *run*: its
poses are known beforehand, so all of it is solved at once. A joint move ends a run, because it
begins in the configuration in which the run arrives. So does a line that has to become a joint
move (``on_posture_change: movej``): it is put in its place, and the rest is looked at again.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from ur_cartesian_driver.kinematics.rows import nearest_rows
from ur_cartesian_driver.motion.errors import (
    GoalRefused,
    InvalidGoal,
    InvalidPosture,
    JointLimitExceeded,
    NearSingularity,
    Unreachable,
)
from ur_cartesian_driver.motion.goal import Goal, SegmentType
from ur_cartesian_driver.motion.pose import Pose, pose_rows
from ur_cartesian_driver.motion.primitive import Joints
from ur_cartesian_driver.planning.corner import Corner, corners, Meeting
from ur_cartesian_driver.planning.drafts import can_blend, Draft, Drafts, IN_JOINTS
from ur_cartesian_driver.planning.leg import Leg
from ur_cartesian_driver.planning.lookahead import farthest_way, Followed, followed, in_joints
from ur_cartesian_driver.planning.margins import too_near
from ur_cartesian_driver.planning.options import PlanningOptions
from ur_cartesian_driver.planning.path import (
    JointLine,
    same,
    SAME_POSITION,
    trim_end,
)
from ur_cartesian_driver.planning.pose_rows import compose_rows
from ur_cartesian_driver.planning.postures import missed, named_joints, Reach
from ur_cartesian_driver.planning.samples import Piece, segments_of
from ur_cartesian_driver.planning.survey import Survey, Surveyed
from ur_cartesian_driver.planning.validate import (
    no_way,
    PLAIN,
    point_field,
    segment_field,
)

#: Solutions that differ by less are one [rad].
SAME_SOLUTION = 1e-6
#: Where a blend leads into a joint line, the arm comes out of it this near to the line [rad].
_SAME_LINE = 0.05
#: Legs of the first run where lines may turn into joint moves; of later ones ever more.
_FIRST_RUN = 8

_JOINT = SegmentType.JOINT
#: Why a line or an arc may become a joint move.
_NO_STRAIGHT_WAY = (InvalidPosture, NearSingularity, JointLimitExceeded, Unreachable)


class Route:
    """
    The legs of one goal, one after the other, from where the robot stands.

    :param targets: the poses of all waypoints in base.
    :param begin: the first waypoint to go to.
    :param remarks: what is changed or ignored is added to these,
    :param why: and to these, by waypoint, why a primitive is not the plain one.
    """

    def __init__(
        self,
        goal: Goal,
        targets: Sequence[Pose],
        reach: Reach,
        options: PlanningOptions,
        remarks: list[str],
        why: dict[int, list[str]],
    ) -> None:
        """Take what the legs are made of."""
        self.goal, self.targets, self.reach, self.options = goal, targets, reach, options
        self.remarks, self.why = remarks, why
        self.survey = Survey(reach.arm)
        self._drafting = Drafts(goal, targets, options, remarks)
        self._farthest = farthest_way(reach)
        self._replaces = options.on_posture_change == 'movej'

    def legs(
        self, begin: int, T_base_tcp: Pose, q: Joints, times: Sequence[float | None]
    ) -> list[Leg]:
        """
        Return the way of every segment, its corners and the configuration it arrives in.

        :param T_base_tcp: where the tool is, and ``q`` where the joints are [rad].
        :param times: of each leg [s]; None = speeds decide.
        :raises GoalRefused: the arm cannot go there.
        """
        self._q_start = self._q = q
        self._drafts = self._drafting.all(begin, T_base_tcp)
        k, limit = 0, _FIRST_RUN if self._replaces else len(self._drafts)
        while k < len(self._drafts):
            if self._drafts[k].kind in IN_JOINTS:
                self._joint_move(k)
                k += 1
                continue
            stop = self._end_of_run(k, limit)
            came = self._run(k, stop)
            limit = 2 * limit if came == stop else _FIRST_RUN
            k = came
        self._say_what_stops()
        return list(self._made(times))

    # -- runs ------------------------------------------------------------------------------------

    def _end_of_run(self, k: int, limit: int) -> int:
        stop = k + 1
        while (
            stop < len(self._drafts)
            and stop - k < limit
            and self._drafts[stop].kind not in IN_JOINTS
        ):
            stop += 1
        return stop

    def _run(self, k: int, stop: int) -> int:
        """
        Look along the legs from k to stop; return where to go on.

        That is k again where one of them has become a joint move.
        """
        self._join(k, stop)
        pieces, q_start = self._pieces(k, stop), self._q
        found = followed(self.reach, pieces, q_start)
        segments, fractions = segments_of(pieces, found.piece, found.t)
        measures = self.survey.measured(found.q)
        near = too_near(pieces, found, measures, segments, fractions, self.options)
        refusal, index = found.refusal, found.refused_segment
        # The end of a range behind a singularity is where the joints swing to beside it.
        if near is not None and (
            refusal is None
            or near[1] < index
            or (near[1] == index and isinstance(refusal, JointLimitExceeded))
        ):
            refusal, index = near
        drafts = self._drafts[k:stop]
        arrived = self._arrivals(drafts, found, segments)
        for draft, joints in zip(drafts, arrived, strict=True):
            if refusal is not None and draft.index >= index:
                break
            if (wrong := self._misses(draft, joints)) is not None:
                refusal, index = wrong, draft.index
                break
        if refusal is not None:
            self._replace(max(k, index - self._drafts[0].index), refusal)
            return k
        for draft, joints in zip(drafts, arrived, strict=True):
            draft.joints = joints
        self._leave(drafts[-1], found)
        self.survey.add(Surveyed(pieces, found, segments, fractions, measures, q_start))
        return stop

    def _join(self, k: int, stop: int) -> None:
        """Round the corners of a run, the one into it included."""
        drafts = self._drafts
        meetings: list[Meeting] = []
        places: list[int] = []
        for n in range(k, stop):
            drafts[n].before = None
            if n > 0:
                drafts[n - 1].after = None
                if self._blends(n - 1):
                    first, second = drafts[n - 1], drafts[n]
                    fillet = first.kind == second.kind == SegmentType.PROCESS
                    meetings.append(Meeting(first.way, second.way, first.radius, fillet))
                    places.append(n)
        for n, corner in zip(places, corners(meetings), strict=True):
            drafts[n - 1].after = drafts[n].before = corner
        for n in range(max(k - 1, 0), stop):
            self._check_overlap(n)

    def _pieces(self, k: int, stop: int) -> list[Piece]:
        """Return the pieces from what has been seen to where the last leg is left."""
        pieces: list[Piece] = []
        for n in range(k, stop):
            draft = self._drafts[n]
            pieces += self._entry(n)
            begin, end = draft.begin, self._end(n)
            most = self._farthest / max(draft.way.length, 1e-300)
            if end > begin or not (draft.before or draft.after):
                pieces.append(Piece.part(draft.index, draft.way, begin, min(end, begin + most)))
        return pieces

    def _entry(self, n: int) -> list[Piece]:
        """Return the piece into a leg: the corner, or the rest of the leg before."""
        if n == 0:
            return []
        before = self._drafts[n - 1]
        if before.after is not None:
            return [Piece.corner(before.index, before.after)]
        if before.seen < 1.0:
            return [Piece.part(before.index, before.way, before.seen, 1.0)]
        return []

    def _end(self, n: int) -> float:
        """Return the ``u`` where a leg is left, also where its corner is not known yet."""
        draft = self._drafts[n]
        if draft.after is not None:
            return draft.after.leave
        return trim_end(draft.way, draft.radius) if self._blends(n) else 1.0

    def _arrivals(
        self, drafts: list[Draft], found: Followed, segments: np.ndarray
    ) -> list[Joints]:
        """Return the configuration of the waypoint at the end of each leg, as far as found."""
        last = np.searchsorted(segments, [draft.index for draft in drafts], side='right') - 1
        if not len(found.q):
            return [self._q for _ in drafts]
        q = found.q[np.maximum(last, 0)]
        rounded = [
            n
            for n, draft in enumerate(drafts)
            if self._end(draft.index - self._drafts[0].index) < 1.0
        ]
        if rounded:
            # The arm does not come there; the report and joint moves from there want to know.
            ends = pose_rows(drafts[n].way.end for n in rounded)
            there = nearest_rows(
                self.reach.arm, compose_rows(ends, self.reach.T_tcp_flange), q[rounded]
            )
            q[rounded] = np.where(np.isnan(there), q[rounded], there)
        return [(a, b, c, d, e, f) for a, b, c, d, e, f in q.tolist()]

    def _leave(self, draft: Draft, found: Followed) -> None:
        draft.seen = self._end(draft.index - self._drafts[0].index)
        if len(found.q):
            a, b, c, d, e, f = found.q[-1].tolist()
            self._q = (a, b, c, d, e, f)

    def _misses(self, draft: Draft, q: Joints) -> InvalidPosture | None:
        """Return the refusal of a straight or circular leg that misses its posture."""
        posture = self.goal.waypoints[draft.index].posture
        if not posture:
            return None
        named = named_joints(posture, self.options.tf_prefix)
        chosen = self.reach.chosen(draft.way.end, named, q, point_field(draft.index, 'pose'))
        clause = missed(q, chosen, named)
        if not clause:
            return None
        flips = self.reach.flips(q, chosen)
        return InvalidPosture(
            f'{point_field(draft.index, "posture")} cannot be reached by a straight or circular '
            f'move: {clause}{f", which takes {flips}" if flips else ""}; use a JOINT segment, or '
            'set on_posture_change to movej.'
        )

    def _replace(self, n: int, refusal: GoalRefused) -> None:
        """Make a leg a joint move, or refuse the goal."""
        draft = self._drafts[n]
        if not self._replaces or not isinstance(refusal, _NO_STRAIGHT_WAY):
            raise refusal
        self.remarks.append(
            f'point {draft.index}: JOINT instead of {draft.kind.name} '
            f'(on_posture_change = movej), because otherwise: {refusal}'
        )
        self.why.setdefault(draft.index, []).append(
            'the posture needs a joint move'
            if isinstance(refusal, InvalidPosture)
            else 'there is no straight way'
        )
        draft.kind, draft.path, draft.before = _JOINT, None, None
        if n + 1 < len(self._drafts) and self._drafts[n + 1].path is not None:
            after = self._drafts[n + 1]
            after.path = self._drafting.straight(after, self.targets[draft.index])

    # -- joint moves -----------------------------------------------------------------------------

    def _joint_move(self, k: int) -> None:
        draft, i = self._drafts[k], self._drafts[k].index
        q = self._from(k)
        target, posture = self.targets[i], self.goal.waypoints[i].posture
        where = point_field(i, 'pose')
        if posture:
            named = named_joints(posture, self.options.tf_prefix)
            chosen = self.reach.chosen(target, named, q, where)
        else:
            chosen = self.reach.nearest(target, q, where)
        line = JointLine.between(self.reach.arm, self.reach.T_flange_tcp, q, chosen)
        if i == 0 and max(line.travel) <= SAME_SOLUTION:
            draft.radius = 0.0
        draft.path, draft.joints = line, chosen
        self._join(k, k + 1)
        self._enter(k)
        self._look_in_joints([Piece.part(i, line, draft.begin, self._end(k))])
        draft.seen = self._end(k)

    def _from(self, k: int) -> Joints:
        """Return the configuration in which a joint move begins: that of the waypoint before."""
        if k == 0:
            return self._q_start
        before = self._drafts[k - 1]
        if before.seen == 1.0:
            return before.arrives
        if isinstance(before.way, JointLine):
            return before.arrives
        # A blended waypoint may lie out of reach, but not one at which a joint line begins: there
        # the robot has to know the joints to which the rest of the leg would bring it.
        rest = followed(
            self.reach, [Piece.part(before.index, before.way, before.seen, 1.0)], self._q
        )
        if rest.refusal is not None:
            raise rest.refusal
        a, b, c, d, e, f = rest.q[-1].tolist()
        return (a, b, c, d, e, f)

    def _enter(self, k: int) -> None:
        """Look along what leads into a joint move."""
        pieces = self._entry(k)
        if not pieces:
            return
        curve = pieces[0].curve
        if isinstance(curve, JointLine) or (isinstance(curve, Corner) and curve.in_joints):
            self._look_in_joints(pieces)
            return
        q_start = self._q
        found = followed(self.reach, pieces, q_start)
        if found.refusal is not None:
            raise found.refusal
        segments, fractions = segments_of(pieces, found.piece, found.t)
        measures = np.where(
            (segments == self._drafts[k].index)[:, None], np.inf, self.survey.measured(found.q)
        )
        near = too_near(pieces, found, measures, segments, fractions, self.options)
        if near is not None:
            raise near[0]
        a, b, c, d, e, f = found.q[-1].tolist()
        self._q = (a, b, c, d, e, f)
        line = self._drafts[k].way
        assert isinstance(line, JointLine)
        joins = line.joints(self._drafts[k].begin)
        if max(abs(x - y) for x, y in zip(self._q, joins, strict=True)) > _SAME_LINE:
            raise self.reach.jump(
                line.pose(self._drafts[k].begin),
                self._q,
                joins,
                f'{segment_field(self._drafts[k - 1].index, "blend_radius")}',
            )
        self.survey.add(Surveyed(pieces, found, segments, fractions, measures, q_start))

    def _look_in_joints(self, pieces: list[Piece]) -> None:
        found = in_joints(self.reach, pieces)
        segments, fractions = segments_of(pieces, found.piece, found.t)
        nothing = np.full((len(found.t), 3), np.inf)  # singularities do not matter here
        self.survey.add(Surveyed(pieces, found, segments, fractions, nothing, self._q))
        a, b, c, d, e, f = found.q[-1].tolist()
        self._q = (a, b, c, d, e, f)

    # -- blends ----------------------------------------------------------------------------------

    def _blends(self, n: int) -> bool:
        """Tell whether a leg is blended into the next one."""
        if n + 1 >= len(self._drafts) or self._drafts[n].radius <= SAME_POSITION:
            return False  # the wire rounds so small a radius to none
        return can_blend(self._drafts[n], self._drafts[n + 1])

    def _check_overlap(self, n: int) -> None:
        draft = self._drafts[n]
        if draft.path is not None and draft.begin > self._end(n) + 1e-9:
            raise InvalidGoal(
                segment_field(draft.index, 'blend_radius'),
                f'is too large: the blends at both ends of the segment to '
                f'point {draft.index} overlap',
                'make them smaller',
            )

    def _say_what_stops(self) -> None:
        for n, draft in enumerate(self._drafts[:-1]):
            after = self._drafts[n + 1]
            if draft.radius > SAME_POSITION and not can_blend(draft, after):
                self.remarks.append(
                    f'point {draft.index}: stops instead of blending, because the robot cannot '
                    f'blend from {draft.kind.name} into {after.kind.name}'
                )

    # -- legs ------------------------------------------------------------------------------------

    def _made(self, times: Sequence[float | None]) -> Iterator[Leg]:
        paces, nearest = self.survey.paces(), self.survey.nearest()
        for draft, time in zip(self._drafts, times, strict=True):
            i = draft.index
            leg = Leg(
                index=i,
                kind=draft.kind,
                waypoint=self.goal.waypoints[i],
                segment=draft.segment,
                path=draft.way,
                joints=draft.arrives,
                time=time,
                pace=paces[i],
                nearest=nearest[i],
                before=draft.before,
                after=draft.after,
                u_before=draft.begin,
                u_after=draft.leaves,
                share=max(draft.leaves - draft.begin, 1e-9),
            )
            yield self._already_there(leg) if self._goes_nowhere(leg) else leg

    def _goes_nowhere(self, leg: Leg) -> bool:
        if leg.path.length > SAME_POSITION:
            return False
        if isinstance(leg.path, JointLine):
            return max(leg.path.travel) <= SAME_SOLUTION
        return same(leg.path.start, leg.path.end)

    def _already_there(self, leg: Leg) -> Leg:
        """Return the leg to a first point at which the robot stands; others are refused."""
        i = leg.index
        if i > 0:
            raise no_way(self.goal, i)
        waits = f'; its {leg.time:g} s are not waited' if leg.time else ''
        self.remarks.append(f'point 0: the robot stands there already{waits}')
        self.why[0] = ['the robot stands there already']
        kind = leg.kind if leg.kind == _JOINT else SegmentType.LINEAR
        return replace(
            leg,
            kind=kind,
            time=None,
            segment=replace(PLAIN, type=leg.segment.type),
            waypoint=replace(leg.waypoint, twist=(0.0,) * 6),
        )
