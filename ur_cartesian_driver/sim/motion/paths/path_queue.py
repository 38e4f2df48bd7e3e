# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Path moves, which begin from rest, in the blend of the previous move, or after the arm has braked.

A move is blended with the previous one if the program calls it when the blend is about to begin or
has begun. A move that cannot begin yet waits until the arm stands still.
"""

from __future__ import annotations

from typing import NamedTuple

from ur_cartesian_driver.motion.geometry.pose import Pose
from ur_cartesian_driver.motion.twin.laws import MotionLaws
from ur_cartesian_driver.sim.motion.arm_target import ArmTarget
from ur_cartesian_driver.sim.motion.cycle_stepper import ROUNDING
from ur_cartesian_driver.sim.motion.kinematics.joint_kinematics import (
    MAX_JOINT_ACCELERATION,
    max_joint_difference,
    STILL,
)
from ur_cartesian_driver.sim.motion.motion_reports import MotionReports
from ur_cartesian_driver.sim.motion.motion_values import MotionError, MotionFault
from ur_cartesian_driver.sim.motion.paths.motion_calls import (
    BLENDS_BY_LAWS,
    MotionCall,
    PathStart,
)
from ur_cartesian_driver.sim.motion.paths.move_paths import FilletBlendPath, MovePath
from ur_cartesian_driver.sim.motion.paths.path_motion import (
    append_move_path,
    PathMotion,
    start_from_rest,
    with_blend_radius,
)
from ur_cartesian_driver.sim.motion.running_motion import RunningMotion, UNATTENDED_DECELERATION

# Tolerance [m], because blends that only touch do not overlap.
_TOUCHING = 1e-9


class _Overlap(NamedTuple):
    """The state to restore if a waypoint is skipped because another move follows at once."""

    before: PathMotion | None
    last_name: str
    name: str


class PathQueue:
    """The path moves of one arm: the running move, and the move that waits for standstill."""

    def __init__(
        self, target: ArmTarget, active: RunningMotion, reports: MotionReports, laws: MotionLaws
    ) -> None:
        """Begin without moves."""
        self._target, self._active, self._reports = target, active, reports
        self._laws = laws
        #: The call that waits until the arm stands still.
        self._waiting: MotionCall | None = None
        #: Name of the last path move; '' before the first.
        self._last_name = ''
        self._overlap: _Overlap | None = None
        #: Part of a cycle that the last move did not use, less ``MotionLaws.idle_between_moves``
        #: [s]. A move that follows at once begins earlier by this time (later if it is negative),
        #: so that the times of moves are not rounded to cycles.
        self._spare = 0.0

    def clear(self) -> None:
        """Discard the waiting move; an overlapping waypoint is no longer skipped."""
        self._waiting = self._overlap = None

    def end_of_frame(self) -> None:
        """Keep an overlapping waypoint and drop the spare time: no move followed in this cycle."""
        self._overlap, self._spare = None, 0.0

    def begin(self, call: MotionCall) -> None:
        """
        Begin a move, or keep it waiting until the arm stands still.

        :raises MotionError: the path is not possible from the start of the move.
        """
        self._skip_overlapping()
        active = self._active
        motion = active.motion
        if isinstance(motion, PathMotion) and motion.last_move.call.returned:
            if self._target.tcp_is_active:
                self._begin_in_blend(motion, call)
            else:
                # A blend can only join moves with the same TCP: first finish the running move.
                self._wait(call)
        elif motion is None:
            self._begin_from_rest(call)
        else:
            # A path can only begin at rest or in a blend: brake first.
            stop = active.joint_stop(UNATTENDED_DECELERATION)
            active.replace(stop)
            self._wait(call)
            if stop.is_over:
                self.finish_at_rest()

    def finish_at_rest(self) -> None:
        """
        End the motion that has come to rest, and begin the move that waited for it.

        A waiting move that cannot begin is reported as a fault.
        """
        self._active.motion = None
        if self._waiting is None:
            if self._active.move is not None:
                self._active.move.returned = True
            return
        call, self._waiting = self._waiting, None
        try:
            self.begin(call)
        except MotionError as error:
            self._reports.fault = MotionFault(code=171, argument=0, text=str(error))

    def after_step(self, motion: PathMotion) -> None:
        """Make the call return as soon as it can; warn of a movep that is too fast."""
        if self._last_name == 'movep':
            self._check_movep_speed(motion)
        if motion.may_return(self._target.cycle):
            motion.last_move.call.returned = True
        if motion.finished:
            self._spare = motion.spare - self._laws.idle_between_moves
            self.finish_at_rest()

    def _wait(self, call: MotionCall) -> None:
        self._active.move, self._waiting = call.move, call

    def _begin_from_rest(self, call: MotionCall) -> None:
        target = self._target
        target.activate_tcp()
        start = PathStart(target.q, target.T_base_tcp)
        move_path = call.move_path(start)
        parameters = call.parameters_of(move_path, start)
        if call.version is not None:
            travel = _distance_to_waypoint(start.pose, move_path)
            call = call._replace(radius=call.version.reduced_radii(0.0, call.radius, travel)[1])
        path_motion = start_from_rest(move_path, parameters, call.radius, call.move, self._spare)
        margin = _distance_to_waypoint(start.pose, move_path) - call.radius
        self._follow(None, path_motion, call, margin)

    def _begin_in_blend(self, path_motion: PathMotion, call: MotionCall) -> None:
        """Blend a move with the running one, whose blend is about to begin or has begun."""
        last = path_motion.last_move
        pose = last.move_path.pose(last.move_path.length)
        q = self._target.ik_branch().joints_at_end_of(last.move_path)
        if q is None and call.name.endswith('j'):
            # The arm cannot reach the start of the joint line; the running move fails before that.
            self._wait(call)
            return
        start = PathStart(q or self._target.q, pose)
        move_path = call.move_path(start)
        travel = _distance_to_waypoint(pose, move_path)
        if call.version is not None:
            before, after = call.version.reduced_radii(last.radius, call.radius, travel)
            path_motion, call = with_blend_radius(path_motion, before), call._replace(radius=after)
            last = path_motion.last_move
        blended, is_blended = append_move_path(
            path_motion,
            move_path,
            call.parameters_of(move_path, start),
            call.radius,
            call.move,
            circular=call.name == self._last_name == 'movep',
            speed_ratio=self._laws.blend_speed_ratio if self._last_name in BLENDS_BY_LAWS else 1.0,
        )
        if not is_blended and call.radius <= 0.0 and travel <= last.radius:
            self._reports.waypoint_within_blend(call.name)
        margin = travel - call.radius - (last.radius if call.radius > 0.0 else 0.0)
        self._follow(path_motion, blended, call, margin)

    def _follow(
        self, before: PathMotion | None, path_motion: PathMotion, call: MotionCall, margin: float
    ) -> None:
        """
        Follow a path.

        A waypoint whose blend reaches into the previous blend (``margin`` [m] is negative) is
        skipped if another move follows at once; otherwise the arm goes to the waypoint.
        """
        overlaps = call.radius > 0.0 and margin < -_TOUCHING
        self._overlap = _Overlap(before, self._last_name, call.name) if overlaps else None
        self._last_name = call.name
        self._active.motion, self._active.move = path_motion, call.move
        call.move.returned = overlaps or path_motion.may_return(self._target.cycle)
        if before is None and path_motion.sections[0].profile.duration <= 0.0:
            self._active.motion, call.move.returned = None, True

    def _skip_overlapping(self) -> None:
        """Discard an overlapping waypoint, now that another move follows at once."""
        if self._overlap is not None:
            self._active.motion, self._last_name, name = self._overlap
            self._overlap = None
            self._reports.blend_skipped(name)

    def _check_movep_speed(self, motion: PathMotion) -> None:
        """Warn of a movep that is too fast for the arm, or for a joint in a blend."""
        call = motion.last_move.call
        if self._active.rate < self._active.scale / ROUNDING:
            self._reports.movep_too_fast(call, 'the arm cannot keep it here.')
        elif isinstance(motion.sections[motion.index].path, FilletBlendPath) and (
            max_joint_difference(self._target.qdd, STILL) > MAX_JOINT_ACCELERATION
        ):
            self._reports.movep_too_fast(
                call,
                'a joint would need too much acceleration in a blend; enlarge its radius.',
            )


def _distance_to_waypoint(start: Pose, move_path: MovePath) -> float:
    """Return the distance from the start to the waypoint [m]."""
    return start.distance_to(move_path.pose(move_path.length))
