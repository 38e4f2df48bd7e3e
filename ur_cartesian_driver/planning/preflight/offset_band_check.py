# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The band in which path offsets may move the tool (``path_offset``): its frames, gaps and checks.

Offsets are given in the frame of the path, which turns with the path. No offset is possible where
this turn alone would move a displaced tool faster, or accelerate it more, than offsets may: in
corners where the arm stops, and in arcs that are too tight. The offset fades out before these
places and before the end of the path.

The corners of the band are all combinations of the largest offsets. The path is checked with each
of them, after it has been checked without an offset.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import product
from math import ceil, hypot

import numpy as np

from ur_cartesian_driver.kinematics.inverse_rows import nearest_rows
from ur_cartesian_driver.kinematics.robot_models import JOINT_NAMES
from ur_cartesian_driver.motion.errors import (
    GoalRefused,
    InvalidGoal,
    NearSingularity,
    TooFast,
)
from ur_cartesian_driver.motion.geometry.arrays import Flags, Floats
from ur_cartesian_driver.motion.geometry.pose import Pose, pose_from_row
from ur_cartesian_driver.motion.geometry.pose_rows import compose_rows, interpolate_rows
from ur_cartesian_driver.motion.geometry.vectors import norm, Vector3, vector3, vector6
from ur_cartesian_driver.motion.goal.goal import PartChange, PathOffset
from ur_cartesian_driver.motion.plan.offset_band import OFFSET_AXES, OffsetBand
from ur_cartesian_driver.motion.plan.plan import ReferencePath
from ur_cartesian_driver.planning.options import PlanningOptions
from ur_cartesian_driver.planning.preflight.clearance import clearances, JointSamples
from ur_cartesian_driver.planning.preflight.joint_path_solver import describe_location
from ur_cartesian_driver.planning.preflight.tcp_kinematics import TcpKinematics
from ur_cartesian_driver.planning.preflight.tightest_margins import (
    singularity_distance_rows,
    SINGULARITY_MEASURES,
)
from ur_cartesian_driver.planning.request.path_offset import offset_motion

#: Time between two frames of the path [s].
STEP = 0.01
#: Each frame is a mean over twice this time [s], so that no frame turns abruptly.
SMOOTHING = 0.08
#: An edge (the line from one sample of the path to the next) has no frame of its own if it is
#: shorter than this across the z axis of the tool [m]. Its frames are interpolated instead.
_MIN_EDGE = 1e-7
#: Nor has an edge whose angle to the z axis of the tool has a sine below this.
_MIN_ANGLE_SINE = 0.05
#: The time for fading out is this many times as long as the motion of the offset needs.
_FADE_MARGIN = 1.1
#: Additional time until an offset is gone if the robot program moves it and the controller filters
#: it [s]: five time constants of the filter, a packet to the robot and back, and the lag of the
#: program after a change of the speed scaling.
FILTER_SETTLING = 0.2
#: Longest time between two samples for the checks [s]; :func:`dense_path` adds samples, because
#: the paths of the robot's own motions have fewer.
_CHECK_STEP = 0.02
#: The joints at a corner of the band are found from the joints on the path in steps of at most
#: _STRIDE [m]. If a joint turns farther than _MAX_CHANGE [rad] in a step, the path is refused,
#: because the arm has changed its branch.
_STRIDE, _MAX_CHANGE = 0.02, 0.5


def offset_band(
    wanted: PathOffset,
    reference: ReferencePath,
    T_tcp_controlled: Pose,
    settling_time: float = 0.0,
) -> OffsetBand:
    """
    Return the band in which the offsets of a goal may move the tool.

    :param reference: the path of the TCP.
    :param T_tcp_controlled: the controlled frame, whose path is offset.
    :param settling_time: time from the end of an offset's motion until the offset is gone [s].
    :raises InvalidGoal: no offset is possible anywhere on the path, or no edge of it has a frame.
    """
    speed, acceleration, timeout = offset_motion(wanted)
    frames = _frames(reference, T_tcp_controlled)
    turns = _turns_too_fast(frames, hypot(*wanted.limits), speed, acceleration)
    fading = fade_time(max(wanted.limits), speed, acceleration) + settling_time
    times = STEP * np.arange(len(frames))
    closed = turns | (times >= reference.time[-1] - fading)
    fade = int(np.ceil(fading / STEP))
    for begin in np.flatnonzero(turns & ~np.roll(turns, 1)).tolist():
        closed[max(begin - fade, 0) : begin] = True
    if closed.all():
        raise InvalidGoal(
            'path_offset',
            f'is not possible anywhere on this path of {reference.time[-1]:.2f} s: it takes '
            f'{fading:.2f} s to fade out before the end and before places where the path '
            'turns too fast',
            'allow less or faster offsets, or give the motion more time',
        )
    return OffsetBand(
        limits=wanted.limits,
        speed=speed,
        acceleration=acceleration,
        timeout=timeout,
        on_stale=wanted.on_stale,
        step=STEP,
        axes=frames,
        is_open=~closed,
    )


def dense_path(path: ReferencePath) -> ReferencePath:
    """Return the path with samples added, so that they are at most _CHECK_STEP apart."""
    first, last = path.time[0], path.time[-1]
    times = np.union1d(path.time, np.arange(first, last, _CHECK_STEP))
    row = np.clip(np.searchsorted(path.time, times, side='right') - 1, 0, len(path.time) - 2)
    steps = np.maximum(path.time[row + 1] - path.time[row], 1e-300)
    part = np.minimum((times - path.time[row]) / steps, 1.0)
    return ReferencePath(
        poses=interpolate_rows(path.poses[row], path.poses[row + 1], part),
        point=path.point[np.where(part > 0.0, row + 1, row)],
        time=times,
        fraction=np.where(
            path.point[row] == path.point[row + 1],
            path.fraction[row] + part * (path.fraction[row + 1] - path.fraction[row]),
            part * path.fraction[row + 1],
        ),
    )


def speeds_beside(q: Floats, time: Floats) -> Floats:
    """
    Return each joint's speed before or after each row, whichever is larger (n, 6) [rad/s].

    :param q: (n, 6) [rad].
    :param time: (n,) [s].
    """
    rates = np.abs(np.diff(q, axis=0)) / np.maximum(np.diff(time), 1e-6)[:, None]
    rates = np.pad(rates, ((1, 1), (0, 0)))
    return np.maximum(rates[1:], rates[:-1])


def fade_time(limit: float, speed: float, acceleration: float) -> float:
    """Return the longest time that an offset at its limit takes to fade out [s]."""
    # At worst the offset still moves outwards: it brakes, comes back from where it has stopped,
    # and brakes again. Braking uses less than the allowed acceleration.
    return _FADE_MARGIN * (2.2 * speed / acceleration + limit / speed) + 2.0 * STEP


def _frames(reference: ReferencePath, T_tcp_controlled: Pose) -> Floats:
    """Return the frames of a path (n, 3 axes, 3), a time STEP apart."""
    poses = compose_rows(reference.poses, T_tcp_controlled)
    edges = np.diff(poses[:, :3], axis=0)
    lengths = np.linalg.norm(edges, axis=1)
    x, y, z, w = (0.5 * (poses[1:, 3:] + poses[:-1, 3:])).T
    tool_z = np.stack(
        [2.0 * (x * z + y * w), 2.0 * (y * z - x * w), w * w + z * z - x * x - y * y], axis=1
    )
    across = np.cross(edges, tool_z)
    has_frame = np.linalg.norm(across, axis=1) > np.maximum(
        _MIN_ANGLE_SINE * lengths * np.linalg.norm(tool_z, axis=1), _MIN_EDGE
    )
    if not has_frame.any():
        raise InvalidGoal(
            'path_offset',
            'is set, but the path has no direction across the z axis of the tool, and so no frame',
            'lead the tool across its z axis',
        )
    along, across = _units(edges[has_frame]), _units(across[has_frame])
    times = (0.5 * (reference.time[1:] + reference.time[:-1]))[has_frame]
    every = STEP * np.arange(int(np.ceil(reference.time[-1] / STEP)) + 2)
    vectors = np.concatenate([along, across], axis=1)
    vectors = np.stack([np.interp(every, times, column) for column in vectors.T], axis=1)
    vectors = _smoothed(_smoothed(vectors))
    along = _units(vectors[:, :3])
    across = vectors[:, 3:]
    across = _units(across - np.sum(across * along, axis=1)[:, None] * along)
    return np.stack([along, across, np.cross(along, across)], axis=1)


def _units(vectors: Floats) -> Floats:
    lengths = np.linalg.norm(vectors, axis=1)
    units: Floats = vectors / np.maximum(lengths, 1e-9)[:, None]
    return units


def _smoothed(vectors: Floats) -> Floats:
    """Return moving averages of columns over :data:`SMOOTHING`."""
    half = round(0.5 * SMOOTHING / STEP)
    sums = np.cumsum(np.pad(vectors, ((half + 1, half), (0, 0)), mode='edge'), axis=0)
    width = 2 * half + 1
    means: Floats = (sums[width:] - sums[:-width]) / width
    return means


def _turns_too_fast(frames: Floats, reach: float, speed: float, acceleration: float) -> Flags:
    """
    Return whether each frame (n,) turns too fast for offsets.

    :param reach: largest distance of the tool from the path [m].
    :param speed: largest speed [m/s] that the turn may give the tool at this distance;
        ``acceleration`` [m/s^2] likewise.
    """
    change = np.diff(frames, axis=0)
    rates = _sizes(change) / STEP
    bends = _sizes(np.diff(change, axis=0)) / STEP**2
    too_fast = np.zeros(len(frames), dtype=np.bool_)
    for excess in (
        np.pad(rates * reach > speed, (0, 1)),
        np.pad(rates * reach > speed, (1, 0)),
        np.pad(bends * reach > acceleration, 1),
    ):
        too_fast |= excess
    return too_fast


def _sizes(changes: Floats) -> Floats:
    """Return the sizes (n,) of changes of frames; for a small turn, this is its angle [rad]."""
    sizes: Floats = np.linalg.norm(changes, axis=(1, 2)) / np.sqrt(2.0)
    return sizes


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class OffsetBandCheck:
    """
    The checks of a band along a path.

    :param reference: the path; the band is checked at each of its samples.
    :param q: (n, 6) the joint positions at the samples [rad]; ``qd``: the joint speeds [rad/s].
    """

    kinematics: TcpKinematics
    options: PlanningOptions
    band: OffsetBand
    reference: ReferencePath
    q: Floats
    qd: Floats
    tool_tips: Sequence[Pose]
    #: The bodies that the tool takes or puts down along the path.
    part_changes: Sequence[PartChange]

    def check(self) -> list[str]:
        """
        Check all corners of the band, and return the warnings about them.

        :raises GoalRefused: a check fails; the text names the point and the bound, and also the
            corner, unless the bound is max_tool_speed.
        """
        self._check_tool_speeds()
        q, axes = self.q, self._axes()
        joint_speeds = np.abs(self.qd) + self._joint_speeds_of_offsets(q, axes)
        return self._at_corners(lambda corner: self._check_corner(corner, axes, q, joint_speeds))

    def check_clearance(self) -> list[str]:
        """
        Check the clearance alone at all corners, and return the warnings about it.

        :raises GoalRefused: a corner fails the check, or cannot be reached.
        """
        axes = self._axes()
        return self._at_corners(
            lambda corner: self._clearance(self._joints_at(corner, axes, self.q))
        )

    def _axes(self) -> Floats:
        return np.array([self.band.axes_at(time) for time in self.reference.time.tolist()])

    def _at_corners(self, check: Callable[[Vector3], list[str]]) -> list[str]:
        """Make a check at all corners; the text of a refusal or a warning names the corner."""
        sides = ((-limit, limit) if limit else (0.0,) for limit in self.band.limits)
        warnings: list[str] = []
        for corner in map(vector3, product(*sides)):
            where = ', '.join(
                f'{name} {1e3 * value:+g} mm'
                for name, value in zip(OFFSET_AXES, corner, strict=True)
                if value
            )
            try:
                found = check(corner)
            except GoalRefused as refusal:
                raise refusal.reworded(f'With a path offset of {where}: {refusal}') from None
            warnings += (f'with a path offset of {where}: {warning}' for warning in found)
        return warnings

    def _check_tool_speeds(self) -> None:
        """Refuse a path on which offsets at their full speed would make the tool too fast."""
        path, band, bound = self.reference, self.band, self.options.max_tool_speed
        if bound <= 0.0:
            return
        steps = np.linalg.norm(np.diff(path.poses[:, :3], axis=0), axis=1)
        on_path = steps / np.maximum(np.diff(path.time), 1e-6)
        along, *across = (band.speed if limit else 0.0 for limit in band.limits)
        # The turning of the frame adds at most the speed of an offset: where it would add more,
        # the band is closed.
        speeds = np.hypot(on_path + along, np.linalg.norm(across)) + band.speed
        row = int(np.argmax(speeds))
        if speeds[row] > bound:
            raise TooFast(
                self._where(row + 1),
                f'moves the tool at {on_path[row]:.3f} m/s, with offsets at up to '
                f'{speeds[row]:.3f} m/s, more than max_tool_speed = {bound:.3f} m/s',
                'lower path_offset.speed, or give the motion more time',
            )

    def _joint_speeds_of_offsets(self, q: Floats, axes: Floats) -> Floats:
        """Return the joint speeds (n, 6) [rad/s] that offsets at their full speed need."""
        speeds = np.zeros_like(q)
        for k in np.flatnonzero(self.band.limits).tolist():
            # Twice, because the turning of the frame adds at most the same speed.
            twist = np.zeros_like(q)
            twist[:, :3] = 2.0 * self.band.speed * axes[:, k]
            speeds += np.abs(self.kinematics.joint_rates(q, twist, np.zeros_like(q))[0])
        return speeds

    def _check_corner(
        self, corner: Vector3, axes: Floats, q: Floats, joint_speeds: Floats
    ) -> list[str]:
        """Check one corner, and return the warnings about its clearance."""
        there = self._joints_at(corner, axes, q)
        self._check_singularities(q, there)
        self._check_joint_speeds(q, there, joint_speeds)
        return self._clearance(there)

    def _clearance(self, there: Floats) -> list[str]:
        """Check the clearance at joint positions along a corner, and return the warnings."""
        path = JointSamples(self.reference.point, self.reference.fraction, self.q)
        found = clearances(
            self.kinematics.arm,
            self.tool_tips,
            self.options,
            path,
            vector6(self.q[0].tolist()),
            self.part_changes,
            there,
            closest=False,
        )
        warnings = [lines[0] for clear, lines in found if clear.warning is not None]
        return list(dict.fromkeys(warnings))

    def _joints_at(self, corner: Vector3, axes: Floats, q: Floats) -> Floats:
        """Return the joint positions along a corner (n, 6) [rad], found in steps from the path."""
        kinematics, path = self.kinematics, self.reference
        steps = max(1, ceil(norm(corner) / _STRIDE))
        shift, before = np.einsum('k,nkx->nx', np.array(corner), axes), q
        for step in range(1, steps + 1):
            poses = path.poses.copy()
            poses[:, :3] += step / steps * shift
            there = nearest_rows(kinematics.arm, kinematics.flange_rows(poses), before)
            lost = ~(np.abs(there - before).max(axis=1) < _MAX_CHANGE)  # NaN counts as lost
            if lost.any():
                row = int(np.argmax(lost))
                pose, where = pose_from_row(poses[row].tolist()), self._where(row)
                if np.isnan(there[row]).any():
                    raise kinematics.no_solution_error(pose, where)
                here, other = (vector6(rows[row].tolist()) for rows in (before, there))
                raise kinematics.discontinuity_error(pose, here, other, where)
            before = there
        return before

    def _check_singularities(self, q: Floats, there: Floats) -> None:
        arm = self.kinematics.arm
        on_path, displaced = (singularity_distance_rows(arm, rows) for rows in (q, there))
        for k, measure in enumerate(SINGULARITY_MEASURES):
            bound = float(getattr(self.options, measure.option))
            # Where the path itself is within the bound, it was accepted (near its start only).
            near = (displaced[:, k] < bound) & (on_path[:, k] >= bound)
            if near.any():
                row = int(np.argmax(near))
                raise NearSingularity(
                    f'{self._where(row)} comes within {displaced[row, k]:.3g} {measure.unit} of '
                    f'the {measure.name} singularity ({measure.meaning}), less than '
                    f'{measure.option} = {bound:g} {measure.unit}; allow smaller offsets, or keep '
                    'the path away from it.'
                )

    def _check_joint_speeds(self, q: Floats, there: Floats, joint_speeds: Floats) -> None:
        times = self.reference.time
        steps = np.maximum(np.diff(times), 1e-6)[:, None]
        # A displaced arm may have to turn faster. Where the band is closed, no arm is displaced.
        is_open = np.array([self.band.opens(time) for time in times[1:].tolist()])
        extra = np.abs(np.diff(there - q, axis=0) / steps) * is_open[:, None]
        speeds = joint_speeds.copy()
        speeds[1:] += extra
        limits = np.array(self.kinematics.arm.model.max_joint_speed)
        parts = speeds / limits
        row, joint = divmod(int(np.argmax(parts)), 6)
        if parts[row, joint] > 1.0:
            raise TooFast(
                self._where(row),
                f'would need {speeds[row, joint]:.3f} rad/s of {JOINT_NAMES[joint]}, more than '
                f'its {limits[joint]:.3f} rad/s',
                'allow smaller or slower offsets, or give the motion more time',
            )

    def _where(self, row: int) -> str:
        return describe_location(
            int(self.reference.point[row]), float(self.reference.fraction[row])
        )


def offset_remarks(band: OffsetBand, duration: float) -> list[str]:
    """Return the report line about the band of a motion that takes ``duration`` [s]."""
    limits = ', '.join(
        f'{1e3 * limit:g} mm {name}'
        for name, limit in zip(OFFSET_AXES, band.limits, strict=True)
        if limit
    )
    edges = np.flatnonzero(np.diff(np.pad(~band.is_open, 1)))
    gaps = [
        f'{band.step * begin:.2f} to {min(band.step * end, duration):.2f} s'
        for begin, end in zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True)
    ]
    return [
        f'path_offset: the path gives way by up to {limits}, at {band.speed:g} m/s and '
        f'{band.acceleration:g} m/s^2 along each, but not from {", ".join(gaps)}, where it fades '
        'out or the path turns too fast'
    ]
