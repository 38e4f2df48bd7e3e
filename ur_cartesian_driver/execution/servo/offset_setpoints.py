# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Set-points with path offsets: the client displaces the tool from its path while the arm moves.

The tool moves towards the requested offset (:mod:`~ur_cartesian_driver.execution.offsets`) with
bounded speed and acceleration along each of three axes: along, across and normal to the path. It
never leaves the limits of the goal, and is back on its path for the end of the motion. All of this
runs in the time of the motion: when the motion is held, so is the offset.

The joint positions of the path are changed so that the tool is displaced but turns as planned.
"""

from __future__ import annotations

from math import copysign

import numpy as np

from ur_cartesian_driver.execution.goal.feeder import Displaced
from ur_cartesian_driver.execution.offsets.offset_requests import OffsetRequests
from ur_cartesian_driver.execution.servo.servo_stream import MIN_STEP
from ur_cartesian_driver.execution.servo.setpoint_source import RestingSource
from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.kinematics.inverse_incremental import track_pose
from ur_cartesian_driver.motion.geometry.arrays import Floats
from ur_cartesian_driver.motion.geometry.pose import Pose
from ur_cartesian_driver.motion.geometry.vectors import (
    add,
    add6,
    Joints,
    scale,
    subtract,
    subtract6,
    Vector3,
    vector3,
    Vector6,
    ZERO3,
    ZERO6,
)
from ur_cartesian_driver.motion.goal.moving_frame import MovingFrame
from ur_cartesian_driver.motion.plan.approach import approach_speed, ARRIVAL_TOLERANCE
from ur_cartesian_driver.motion.plan.offset_band import AppliedOffset, NO_OFFSET, OffsetBand
from ur_cartesian_driver.motion.state.rtde_state import RobotState

#: Length of the steps, in the time of the motion, in which the offset moves [s].
STEP = MIN_STEP
#: Number of set-points remembered, to find the one that the arm has reached; more than are on
#: their way to the arm.
HISTORY = 192
_ROUNDING = 1e-9


class BoundedOffset:
    """
    The offset, which moves towards a target within the bounds of an :class:`OffsetBand`.

    Speed and acceleration are bounded on each axis by itself, so the offset can stop in time at
    the limit of each axis.
    """

    def __init__(self, band: OffsetBand) -> None:
        """Begin on the path, at rest."""
        self._band = band
        #: The offset along, across and normal to the path [m]; its speed on these axes [m/s].
        self.value: Vector3 = ZERO3
        self.speed: Vector3 = ZERO3

    def step(self, target: Vector3, dt: float = STEP) -> None:
        """Move towards a target within the limits, for a time ``dt`` [s]."""
        if target == self.value and self.speed == ZERO3:
            return
        a, b, c = (
            self._step_axis(*axis, dt)
            for axis in zip(self._band.limits, target, self.value, self.speed, strict=True)
        )
        self.value, self.speed = (a[0], b[0], c[0]), (a[1], b[1], c[1])

    def _step_axis(
        self, limit: float, aim: float, value: float, speed: float, dt: float
    ) -> tuple[float, float]:
        band, distance = self._band, aim - value
        desired = copysign(
            approach_speed(abs(distance), band.speed, band.acceleration, dt), distance
        )
        change = band.acceleration * dt
        speed = min(max(desired, speed - change), speed + change)
        value += speed * dt
        if abs(aim - value) < ARRIVAL_TOLERANCE:
            value = aim
        return min(max(value, -limit), limit), speed


class OffsetSetpoints(Displaced):
    """The set-points of another source, displaced by path offsets."""

    def __init__(
        self,
        setpoints: RestingSource,
        band: OffsetBand,
        arm: Arm,
        moving_frame: MovingFrame | None = None,
    ) -> None:
        """
        Begin on the path, with no offset to move to.

        :param setpoints: source of the set-points on the path, in the time of the motion.
        :param band: the offset band of the path.
        :param moving_frame: motion of the path's frame; None = the frame is fixed in the base.
        """
        self._setpoints, self._band, self._arm = setpoints, band, arm
        self._moving_frame = moving_frame
        self.requests = OffsetRequests(band)
        self._offset = BoundedOffset(band)
        #: Time of the motion [s]; time up to which the offset has moved, in whole steps [s].
        self._time = self._used = 0.0
        self._joints = setpoints.next(0.0)
        self._before = ZERO3
        #: Displacement of the newest set-point from the joints on the path [rad].
        self._change: Vector6 = ZERO6
        # The newest set-points: joints [rad], shift and offset of :class:`AppliedOffset` [m].
        self._history: Floats = np.zeros((HISTORY, 12))
        self._count = self._seen = 0

    # ---- set-points ---------------------------------------------------------------------------

    @property
    def done(self) -> bool:
        """Whether the end of the path is reached."""
        return self._setpoints.done

    def next(self, dt: float) -> Joints:
        """Return the joint positions [rad] after a further time ``dt`` of the motion [s]."""
        on_path = self._setpoints.next(dt)
        if dt <= 0.0:
            return self._joints if self._count else on_path
        self._time += dt
        while self._used < self._time - _ROUNDING:
            self._used += STEP
            self._before = self._offset.value
            self._offset.step(self.requests.target(self._time))
        value = self._offset.value
        if self._used > self._time + _ROUNDING:  # the motion's time is between two whole steps
            back = (self._used - self._time) / STEP
            value = add(value, scale(subtract(self._before, value), back))
        self._joints = self._displaced(on_path, value)
        return self._joints

    def skip(self, rest: float) -> None:
        """Leave out the next ``rest`` seconds, in which path and offset rest."""
        self._setpoints.skip(rest)
        self._time += rest
        self._used += rest

    def _displaced(self, on_path: Joints, offset: Vector3) -> Joints:
        """Return the joints of a set-point whose tool is displaced, and remember it."""
        q, shift, self._change = on_path, ZERO3, ZERO6 if offset == ZERO3 else self._change
        if offset != ZERO3:
            shift = self._band.shift(self._time, offset)
            flange = self._arm.forward(on_path)
            near = add6(on_path, self._change)
            # Planning has checked the whole band, so inverse kinematics fails by rounding only;
            # then the last change is kept.
            moved = shift
            if self._moving_frame is not None:
                moved = self._moving_frame.flange_shift(flange, shift)
            T_base_flange = Pose(add(flange.position, moved), flange.quaternion)
            q = track_pose(self._arm, T_base_flange, near) or near
            self._change = subtract6(q, on_path)
            self.requests.note_applied(offset)
        self._history[self._count % HISTORY] = (*q, *shift, *offset)
        self._count += 1
        return q

    def applied_offset(self, packet: RobotState) -> AppliedOffset:
        """
        Return the offset of the joints that the controller commands now (its target).

        This is the offset of the set-point nearest to the target; set-points that were passed
        before are not considered.
        """
        if not self._count:
            return NO_OFFSET
        first = max(self._seen, self._count - HISTORY)
        rows = self._history[np.arange(first, self._count) % HISTORY]
        away = rows[:, :6] - np.array(packet.target_q)
        self._seen = first + int(np.argmin(np.einsum('ij,ij->i', away, away)))
        found = self._history[self._seen % HISTORY].tolist()
        return AppliedOffset(vector3(found[6:9]), vector3(found[9:]))
