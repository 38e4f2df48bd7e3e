# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Begin the plan of a goal with a travel from the present position of the arm (``allow_travel``).

The travel is planned as a goal of its own that ends, at rest, where the approach to the first
point begins. Then the client's goal is planned as if the arm stood there, so that its first motion
is the approach. All texts name points as the client numbers them, and in the joined plan the
travel is a part of the segment to point 0.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from itertools import pairwise
from math import nan
from typing import Any, NamedTuple, TypeAlias

import numpy as np

from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.kinematics.robot_models import JOINT_NAMES
from ur_cartesian_driver.motion.errors import GoalRefused
from ur_cartesian_driver.motion.geometry.pose import Pose
from ur_cartesian_driver.motion.geometry.vectors import Joints, vector6
from ur_cartesian_driver.motion.goal.execution_modes import ExecutionMode
from ur_cartesian_driver.motion.goal.goal import Goal, Posture, Segment, SegmentType, Waypoint
from ur_cartesian_driver.motion.goal.goal_columns import GoalTable
from ur_cartesian_driver.motion.plan.plan import LateLines, Plan, PlannedRows
from ur_cartesian_driver.motion.state.rtde_state import RobotState
from ur_cartesian_driver.planning.options import PlanningOptions
from ur_cartesian_driver.planning.preflight.tcp_kinematics import TcpKinematics
from ur_cartesian_driver.planning.request.goal_fields import point_field
from ur_cartesian_driver.planning.request.joint_points import check_for_arm
from ur_cartesian_driver.planning.stop_prediction import at_set_point, state_at_rest
from ur_cartesian_driver.planning.travel.arm_space import ArmSpace
from ur_cartesian_driver.planning.travel.transfer import (
    find_transfer,
    Transfer,
    TransferSettings,
)

#: A function that plans a goal without a travel.
PlanGoal: TypeAlias = Callable[[Goal, RobotState, Arm, PlanningOptions], Plan]

#: The largest blend radius of the motions through the air [m].
MAX_BLEND = 0.05
#: Fractions of the radii that are tried, until the blended way passes all checks.
BLEND_FACTORS = (1.0, 0.5, 0.25, 0.1, 0.0)
# The largest fraction of a motion that a blend takes at each end, and the least radius [m].
_BLEND_SHARE, _MIN_BLEND = 0.4, 1e-3
#: Configurations that differ by less than this [rad] are the same.
SAME_JOINTS = 1e-6
_WHERE = 'The travel to point 0'
_SETTINGS = TransferSettings(shorten=True)
_NO_POSE = Pose((nan, nan, nan), (nan, nan, nan, nan))


def plan_with_travel(
    goal: Goal, state: RobotState, arm: Arm, options: PlanningOptions, plan: PlanGoal
) -> Plan:
    """
    Return the plan of a goal; it begins with a travel if the arm cannot go directly to point 0.

    :param plan: plans the goal from a state, and ignores ``allow_travel``.
    :raises GoalRefused: the goal is refused, or no travel to it was found.
    """
    try:
        return plan(goal, state, arm, options)
    except GoalRefused as error:
        refusal = error
    table = check_for_arm(goal, state.T_flange_tcp, arm, options)
    try:
        plan(_goal_like(table, table.waypoints[:1], table.segments[:1]), state, arm, options)
    except GoalRefused as error:
        reason = str(error)
    else:
        raise refusal  # the arm gets to the first point; a travel is no remedy
    # A travel may begin farther from the first point than a direct approach may.
    options = replace(options, max_approach_distance=0.0)
    planned = _Travel(goal, table, state, arm, options, plan).plan(reason)
    return replace(planned, travelled_goal=goal)


def blend_radii(poses: Sequence[Pose], largest: float) -> list[float]:
    """
    Return the blend radius [m] at the end of each motion from pose to pose; 0 at the last.

    :param poses: the beginning of the first motion, then the end of each motion.
    """
    lengths = [a.distance_to(b) for a, b in pairwise(poses)]
    radii = [
        min(largest, _BLEND_SHARE * min(before, after))
        for before, after in zip(lengths, [*lengths[1:], 0.0], strict=True)
    ]
    return [radius if radius >= _MIN_BLEND else 0.0 for radius in radii]


class _Stop(NamedTuple):
    """A motion of a travel: the configuration [rad] in which it ends, and its type."""

    q: Joints
    type: SegmentType


class _Travel:
    """Plans a checked goal with a travel to it."""

    def __init__(
        self,
        goal: Goal,
        table: GoalTable,
        state: RobotState,
        arm: Arm,
        options: PlanningOptions,
        plan: PlanGoal,
    ) -> None:
        self._goal, self._table = goal, table
        self._state, self._arm, self._options = state, arm, options
        self._plan = plan
        self._kinematics = TcpKinematics(arm, table.T_flange_controlled or state.T_flange_tcp)
        self._space = ArmSpace(self._kinematics, options)
        self._start = at_set_point(state, arm).actual_q

    def plan(self, reason: str) -> Plan:
        """
        Return the plan of the goal with a travel.

        :param reason: why the direct way is refused.
        """
        entries = self._entries()
        refusal: GoalRefused | None = None
        while entries:
            try:
                found = find_transfer(self._space, self._start, entries, _SETTINGS, _WHERE)
            except GoalRefused as error:
                raise refusal or error from None
            entries.remove(found.goal)
            try:
                travel, begin = self._travel(found), self._state
                if travel is not None:
                    q = vector6(travel.rows.joints[-1].tolist())
                    begin = state_at_rest(self._arm, q, self._state.T_flange_tcp)
                rest = self._plan(self._goal, begin, self._arm, self._options)
            except GoalRefused as error:
                if refusal is None:
                    refusal = error
                    # Planning the goal from each remaining entry takes less time than a search
                    # for a way to an entry from which the goal is refused.
                    entries = [q for q in entries if self._can_begin(q)]
            else:
                if travel is None:
                    return rest
                return _joined(travel, rest, _remark(travel, found, reason))
        assert refusal is not None
        raise refusal

    def _entries(self) -> list[Joints]:
        """
        Return the configurations of the arm at the first point, the nearest first.

        If the point has a posture, only the solutions that it selects are returned.

        :raises Unreachable: there is none.
        """
        points, prefix = self._table.waypoints, self._options.tf_prefix
        target, where = self._table.T_base_frame @ points.pose(0), point_field(0, 'pose')
        found = self._space.configurations(target, self._start)
        if (posture := points.postures.get(0)) is not None:
            chosen = [
                self._kinematics.compare_posture(target, posture, q, where, prefix)[0]
                for q in found
            ]
            found = list(dict.fromkeys(chosen))
        if not found:
            raise self._kinematics.no_solution_error(target, where)
        return found

    def _can_begin(self, q: Joints) -> bool:
        """Return whether the goal can be executed from a configuration at its first point."""
        begin = state_at_rest(self._arm, q, self._state.T_flange_tcp)
        try:
            self._plan(self._goal, begin, self._arm, self._options)
        except GoalRefused:
            return False
        return True

    def _travel(self, found: Transfer) -> Plan | None:
        """
        Return the plan of the path through the air, with the largest blends that pass.

        :returns: None if the arm is at the end of the travel already.
        """
        stops = list(self._stops(found))
        if not stops:
            return None
        poses = [self._space.tcp(q) for q in (self._start, *(stop.q for stop in stops))]
        radii = blend_radii(poses, MAX_BLEND)
        refusal: GoalRefused | None = None
        for factor in BLEND_FACTORS:
            goal = self._goal_of(stops, [factor * radius for radius in radii])
            try:
                return self._plan(goal, self._state, self._arm, self._options)
            except GoalRefused as error:
                refusal = error
        assert refusal is not None
        raise refusal.reworded(f'{_WHERE}: {refusal}')

    def _stops(self, found: Transfer) -> Iterator[_Stop]:
        """Yield the ends of the motions: of the retract, then of each joint motion."""
        rows = [vector6(row) for row in found.waypoints.tolist()]
        if found.retracts:
            yield _Stop(rows[0], SegmentType.LINEAR)
        for before, q in pairwise(rows):
            if np.abs(np.subtract(q, before)).max() >= SAME_JOINTS:
                yield _Stop(q, SegmentType.JOINT)

    def _goal_of(self, stops: Sequence[_Stop], radii: Sequence[float]) -> Goal:
        T_frame_base = self._table.T_base_frame.inverse()
        names = tuple(self._options.tf_prefix + name for name in JOINT_NAMES)
        return _goal_like(
            self._table,
            [
                Waypoint(pose=T_frame_base @ self._space.tcp(q))
                if type_ is SegmentType.LINEAR
                else Waypoint(pose=_NO_POSE, posture=Posture(names=names, values=q))
                for q, type_ in stops
            ],
            [
                Segment(type=stop.type, blend_radius=radius)
                for stop, radius in zip(stops, radii, strict=True)
            ],
        )


def _goal_like(goal: Goal, waypoints: Sequence[Waypoint], segments: Sequence[Segment]) -> Goal:
    """Return a PRIMITIVES goal with other points in the frames of ``goal``."""
    return Goal(
        frame_id=goal.frame_id,
        controlled_frame=goal.controlled_frame,
        T_flange_controlled=goal.T_flange_controlled,
        T_base_frame=goal.T_base_frame,
        waypoints=waypoints,
        segments=segments,
        execution=ExecutionMode.PRIMITIVES,
    )


def _remark(travel: Plan, found: Transfer, reason: str) -> str:
    why = reason.partition(';')[0].rstrip('.')
    return (
        f'travel: through the air to the approach of point 0 by {len(travel.rows)} motions, '
        f'{float(travel.rows.lengths.sum()):.3f} m of the tool in {travel.duration:.3f} s, found '
        f'with {found.samples} samples, because the direct way is refused: {why}'
    )


def _joined(travel: Plan, rest: Plan, remark: str) -> Plan:
    """Return the plan of a travel joined with the plan of the goal after it."""
    before, after = travel.rows, rest.rows
    path = replace(travel.reference, point=np.zeros_like(travel.reference.point))
    path = replace(path, fraction=np.zeros_like(travel.reference.fraction))
    goes_on = replace(rest.reference, time=rest.reference.time + path.time[-1])
    of_travel = {f'travel: {line}': None for line in travel.remarks if line not in rest.remarks}
    return replace(
        rest,
        segments=_labelled(before) + replace(after, primitives=tuple(after.primitives)),
        reference=path + goes_on,
        start=travel.start,
        remarks=(remark, *of_travel, *rest.remarks),
    )


def _labelled(rows: PlannedRows) -> PlannedRows:
    """Return the rows of a travel, which are all on the way to point 0."""
    lines = rows.report_lines
    fields: dict[str, Any] = {
        'waypoints': np.zeros_like(rows.waypoints),
        'primitives': tuple(rows.primitives),
        'report_lines': LateLines.at_once(
            len(rows), lambda: [f'travel, {line}' for line in lines]
        ),
    }
    return replace(rows, **fields)
