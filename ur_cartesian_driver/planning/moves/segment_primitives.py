# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Choose the primitive of each segment.

Nearly all primitives are rows of numbers. Moves to a posture, and moves that older robot programs
expect in another form, are separate objects.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from ur_cartesian_driver.motion.errors import InvalidPosture
from ur_cartesian_driver.motion.geometry.pose import Pose, pose_from_row
from ur_cartesian_driver.motion.geometry.pose_rows import transform_rows
from ur_cartesian_driver.motion.geometry.vectors import Joints, vector6, ZERO6
from ur_cartesian_driver.motion.goal.goal import SegmentType
from ur_cartesian_driver.motion.goal.goal_columns import rows_where
from ur_cartesian_driver.motion.plan.move_rows import MoveRows, MOVES
from ur_cartesian_driver.motion.plan.primitive import (
    MoveC,
    MoveJ,
    MoveL,
    MoveP,
    OptimoveJ,
    OptimoveL,
    Primitive,
    Spline,
    Stop,
)
from ur_cartesian_driver.planning.moves.joint_path_planner import JointPathPlanner, SAME_SOLUTION
from ur_cartesian_driver.planning.moves.segment_geometries import SegmentGeometries
from ur_cartesian_driver.planning.moves.segment_timing import SegmentTimings
from ur_cartesian_driver.planning.preflight.tcp_kinematics import max_joint_change
from ur_cartesian_driver.planning.request.goal_fields import (
    IS_ARC,
    IS_JOINT_MOVE,
    point_field,
    segment_field,
)
from ur_cartesian_driver.planning.request.joint_points import (
    full_posture,
    JointPositions,
    named_joints,
)
from ur_cartesian_driver.planning.request.program_features import (
    adapt_primitive,
    explain_poses_only,
    takes_q_near,
)

_CLASSES = {
    SegmentType.CIRCULAR: MoveC,
    SegmentType.JOINT: MoveJ,
    SegmentType.PROCESS: MoveP,
    SegmentType.OPTIMIZED_JOINT: OptimoveJ,
    SegmentType.OPTIMIZED_LINEAR: OptimoveL,
}
#: For each type of segment, the index of its primitive in MOVES.
_MOVE_OF = np.array([MOVES.index(_CLASSES.get(kind, MoveL)) for kind in SegmentType])


def segment_primitives(
    paths: JointPathPlanner, geometries: SegmentGeometries, timings: SegmentTimings
) -> MoveRows:
    """
    Return the primitive of each segment.

    :param paths: planner that found the segments' joints; remarks and reasons are added to it.
    :raises NotAvailable: the robot program does not support a primitive.
    :raises InvalidPosture: the arm would not pass a via in the configuration of the via's posture.
    """
    kinds, vias = geometries.kinds, geometries.segments.vias
    targets, kinematics = paths.targets[geometries.begin :], paths.kinematics
    arcs = np.flatnonzero(IS_ARC[kinds])
    if len(arcs):
        vias = vias.copy()
        vias[arcs] = transform_rows(paths.goal.T_base_frame, vias[arcs])
        if kinematics.frame_moves:  # a held part passes its vias without turning, too
            vias[arcs, 3:] = targets[arcs, 3:]
        vias[arcs] = kinematics.tcp_poses(vias[arcs])
    moves = MoveRows(
        kinds=_MOVE_OF[kinds],
        targets=kinematics.tcp_poses(targets),
        q_near=geometries.joints,
        has_q_near=IS_JOINT_MOVE[kinds],
        vias=vias,
        arc_modes=geometries.segments.arc_modes,
        velocities=timings.velocities,
        accelerations=timings.accelerations,
        durations=timings.wire_times,
        blend_radii=geometries.path.radius,
        others={},
    )
    return replace(moves, others=_SpecialPrimitives(paths, geometries, moves).by_row())


class _SpecialPrimitives:
    """Makes the primitives that a row of numbers cannot express."""

    def __init__(
        self, paths: JointPathPlanner, geometries: SegmentGeometries, moves: MoveRows
    ) -> None:
        self._paths, self._geometries, self._moves = paths, geometries, moves
        self._options, self._kinematics = paths.options, paths.kinematics.of_tcp
        self._postures = geometries.waypoints.postures

    def by_row(self) -> Mapping[int, Primitive]:
        """Return the special primitives by row."""
        geometries = self._geometries
        special = np.full(len(geometries), not takes_q_near(self._options))
        special[[*self._postures, *geometries.segments.via_postures]] = True
        special[0] |= geometries.waits
        return {row: self._primitive(row) for row in rows_where(special)}

    def _primitive(self, row: int) -> Primitive:
        geometries = self._geometries
        point, kind = geometries.begin + row, geometries.kinds[row]
        joints = vector6(geometries.joints[row].tolist())
        primitive: Primitive
        if geometries.waits and row == 0:  # moves cannot wait, so a spline at rest does
            primitive = Spline(
                target=self._paths.q_start,
                velocities=ZERO6,
                duration=float(self._moves.durations[row]),
            )
        else:
            move = self._moves[row]
            assert not isinstance(move, Spline | Stop)
            primitive = move
            if isinstance(move, MoveC):
                primitive = self._arc(row, move, joints)
            elif IS_JOINT_MOVE[kind] and isinstance(self._postures.get(row), JointPositions):
                primitive = replace(move, target=joints, q_near=None)
            elif IS_JOINT_MOVE[kind] or row in self._postures:
                primitive = replace(move, q_near=self._q_near(row, joints))
        primitive, reason = adapt_primitive(primitive, point, joints, self._options)
        if reason:
            self._paths.reasons.setdefault(point, []).append(reason)
        return primitive

    def _q_near(self, row: int, joints: Joints) -> Joints:
        """Return the point's full posture if it selects the chosen solution, else the solution."""
        posture = self._postures.get(row)
        wanted = posture and full_posture(named_joints(posture, self._options.tf_prefix))
        if wanted:
            where = point_field(self._geometries.begin + row, 'pose')
            target = pose_from_row(self._moves.targets[row])
            found = self._kinematics.nearest(target, wanted, where)
            if max_joint_change(found, joints) <= SAME_SOLUTION:
                return wanted
        return joints

    def _arc(self, row: int, arc: MoveC, joints: Joints) -> MoveC:
        """Return the arc move; a target or via that has a posture becomes joint positions."""
        point, segments = self._geometries.begin + row, self._geometries.segments
        via = arc.via
        assert isinstance(via, Pose)
        at_point, at_via = row in self._postures, row in segments.via_postures
        wanted = [name for name, has in (('the point', at_point), ('the via', at_via)) if has]
        if wanted and (reason := explain_poses_only(self._options)):
            self._paths.remarks.append(
                f'point {point}: sent as poses despite the posture of '
                f'{" and ".join(wanted)}, because {reason}'
            )
        elif wanted:
            self._paths.reasons.setdefault(point, []).append(
                f'{" and ".join(wanted)} {"has" if len(wanted) == 1 else "have"} a posture'
            )
            if at_point:
                arc = replace(arc, target=joints)
            if at_via:
                arc = replace(arc, via=self._via_joints(row, via))
        return arc

    def _via_joints(self, row: int, via: Pose) -> Joints:
        """
        Return the solution of the via's pose that its posture selects.

        :raises InvalidPosture: the arm follows the arc in another configuration.
        """
        geometries, samples = self._geometries, self._paths.samples
        point, u_via = geometries.begin + row, geometries.path.curves.arcs.u_via[row]
        location = segment_field(point, 'via')
        first, last = np.searchsorted(samples.segment, (point, point + 1))
        nearest = int(first + np.argmin(np.abs(samples.fraction[first:last] - u_via)))
        # The arm need not pass the via in the via's orientation, so the arc's joints are only the
        # seed from which the via's pose is solved.
        q = self._kinematics.nearest(via, vector6(samples.q[nearest].tolist()), location)
        chosen, clause = self._kinematics.compare_posture(
            via, geometries.segments.via_postures[row], q, location, self._options.tf_prefix
        )
        if clause:
            raise InvalidPosture(
                f'{segment_field(point, "via_posture")} is not the configuration of the '
                f'arm on the arc: {clause}; leave it empty, or start the arc in that '
                'configuration.'
            )
        return chosen
