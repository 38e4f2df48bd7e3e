# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
An arm that does not follow its targets exactly, and a controller that leaves out packets.

Each joint lags behind its target, is held back by friction, bends under acceleration and rings
when the acceleration changes. Measured positions have noise and a finite resolution; the measured
speed is exactly 0 soon after a joint has stopped. The targets are not changed.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import copysign, cos, exp, pi, sin
from random import Random
from typing import Protocol

from ur_cartesian_driver.kinematics.robot_models import RobotModel
from ur_cartesian_driver.motion.geometry.pose import Pose
from ur_cartesian_driver.motion.geometry.vectors import (
    add_scaled6,
    scale6,
    subtract6,
    Vector6,
    vector6,
    ZERO6,
)
from ur_cartesian_driver.sim.motion import MotionGenerator

#: A joint with a smaller lag [rad] and smaller speeds [rad/s] is considered settled.
_RESIDUE = 1e-8
#: Number of cycles after which the noise repeats; shift of the noise of one quantity against that
#: of the previous one [cycles].
_NOISE_CYCLES, _NOISE_SHIFT = 1009, 337


@dataclass(frozen=True, slots=True, kw_only=True)
class Imperfections:
    """
    The imperfections of an arm and its controller; the defaults fit an e-Series arm.

    "Recorded" marks figures from recordings of real arms; the other figures are assumed.
    """

    #: Time by which a joint lags behind its target [s]. Recorded: 0.0003 to 0.0013 s; errors of at
    #: most 0.0005 rad at 0.5 rad/s (UR5e), 0.001 rad at 0.8 and 0.0036 rad at 2.7 rad/s (UR3).
    lag: float = 0.0005
    #: Error of a moving joint opposite to its motion [rad]. Recorded: 0.0001 to 0.0003.
    friction: float = 0.00015
    #: Error of a resting joint opposite to the direction of its last motion [rad]. Recorded:
    #: 0.0001 or less on e-Series and UR3, 0.0002 to 0.0004 on a CB3 UR10.
    static_error: float = 0.0001
    #: Time constant of the change between ``friction`` and ``static_error`` [s]. Assumed.
    friction_time: float = 0.02
    #: Error of a joint per acceleration [rad per rad/s^2]. Assumed; with this value, the arm rings
    #: after stops at 2 to 4 rad/s^2 for as long as recorded.
    acceleration_error: float = 8e-5
    #: Frequency of the ringing after a change of acceleration [Hz]. Assumed.
    ringing_frequency: float = 10.0
    #: Decay rate of the ringing [1/s]. Recorded: the speed stays above 0.005 rad/s for at most
    #: 0.31 s, and above 0.001 rad/s for at most 0.58 s.
    ringing_decay: float = 6.0
    #: Noise of measured joint positions, peak to peak [rad]. Recorded, including the resolution:
    #: 0.00005 to 0.00017.
    position_noise: float = 1e-4
    #: Resolution of measured joint positions [rad]. Assumed: 17 bits, equal to the lowest noise
    #: recorded.
    position_resolution: float = 2.0 * pi / 2**17
    #: Noise of measured joint speeds, peak to peak [rad/s]. Assumed.
    speed_noise: float = 0.002
    #: Smaller speeds are measured as exactly 0 while the target stands still [rad/s]. Recorded.
    speed_deadband: float = 0.001
    #: Fraction of RTDE packets after which a single packet is left out. Recorded: 0.07 at 500 Hz.
    single_gaps: float = 0.07
    #: Fraction of RTDE packets after which up to ``max_skipped`` are left out. Recorded: a few.
    long_gaps: float = 0.002
    #: Largest number of consecutive RTDE packets that are left out. Recorded: gaps of 12 ms at
    #: 500 Hz, of 40 ms at 125 Hz.
    max_skipped: int = 5
    #: Joint currents of an arm that is switched on [A]. Assumed, independent of the payload.
    holding_current: Vector6 = (0.1, -1.6, -1.1, -0.3, 0.1, 0.05)
    #: Noise of measured currents, peak to peak [A]. Assumed.
    current_noise: float = 0.06
    #: Seed of the noise and of the gaps.
    seed: int = 1


def typical_imperfections(model: RobotModel, seed: int = 1) -> Imperfections:
    """Return the imperfections recorded on arms like this model; where none were, assumed ones."""
    found = Imperfections(seed=seed)
    if model.series != 'CB3':
        return found
    found = replace(found, single_gaps=0.0, max_skipped=4)
    if model.name == 'ur3':
        return replace(found, lag=0.0011, friction=0.0001)
    return replace(found, lag=0.001, static_error=0.0004)


class Motion(Protocol):
    """Position and motion of an arm, in base axes."""

    @property
    def q(self) -> Vector6:
        """Joint positions [rad]."""

    @property
    def qd(self) -> Vector6:
        """Joint speeds [rad/s]."""

    @property
    def T_base_tcp(self) -> Pose:
        """Pose of the TCP."""

    @property
    def tcp_twist(self) -> Vector6:
        """Twist of the TCP [m/s, rad/s]."""


class ImperfectArm:
    """The measured motion of an arm with imperfections; call `step` once per cycle."""

    def __init__(self, motion: MotionGenerator, imperfections: Imperfections) -> None:
        """Begin at the target, apart from random static errors."""
        self._motion, self._imperfections = motion, imperfections
        random = Random(imperfections.seed)
        self._joints = [
            _Joint(imperfections, motion.cycle, position, random.uniform(-1.0, 1.0))
            for position in motion.q
        ]
        # The noise is drawn in advance, because drawing it would take too long in a cycle.
        self._noise = [
            vector6(random.uniform(-0.5, 0.5) for _ in range(6)) for _ in range(_NOISE_CYCLES)
        ]
        self._cycle = 0
        self._qd: Vector6 | None = None
        #: The joint speeds of the previous cycle.
        self._qd_before = ZERO6
        self._pose: tuple[Vector6, Pose, Pose] | None = None
        self.q = ZERO6
        self.step()

    def step(self) -> None:
        """Follow the target for a cycle, and measure."""
        self._qd_before = self.qd
        motion, imperfections = self._motion, self._imperfections
        for joint, q, qd, qdd in zip(self._joints, motion.q, motion.qd, motion.qdd, strict=True):
            if q != joint.target or not joint.is_settled:
                joint.follow(q, qd, qdd)
        self._cycle += 1
        step, noise = imperfections.position_resolution, imperfections.position_noise
        self.q = vector6(
            [
                step * round((joint.position + noise * share) / step)
                for joint, share in zip(self._joints, self._noise_of(0), strict=True)
            ]
        )
        self._qd = None

    def _noise_of(self, quantity: int) -> Vector6:
        """Return the noise of this cycle, as fractions of the noise's peak-to-peak value."""
        return self._noise[(self._cycle + quantity * _NOISE_SHIFT) % _NOISE_CYCLES]

    @property
    def qd(self) -> Vector6:
        """Joint speeds [rad/s]."""
        if self._qd is None:
            noise = self._imperfections.speed_noise
            self._qd = vector6(
                [
                    joint.speed + noise * share if joint.reads_speed else 0.0
                    for joint, share in zip(self._joints, self._noise_of(1), strict=True)
                ]
            )
        return self._qd

    @property
    def qdd(self) -> Vector6:
        """Joint accelerations [rad/s^2]: the change of the measured speeds in the last cycle."""
        return scale6(subtract6(self.qd, self._qd_before), 1.0 / self._motion.cycle)

    def currents(self) -> Vector6:
        """Return the measured joint currents [A] of an arm that is switched on."""
        current, noise = self._imperfections.holding_current, self._imperfections.current_noise
        return add_scaled6(current, self._noise_of(2), noise)

    @property
    def T_base_tcp(self) -> Pose:
        """Pose of the TCP at the measured joints."""
        T_flange_tcp = self._motion.T_flange_tcp
        if self._pose is None or self._pose[0] is not self.q or self._pose[1] is not T_flange_tcp:
            pose = self._motion.arm.forward(self.q) @ T_flange_tcp
            self._pose = self.q, T_flange_tcp, pose
        return self._pose[2]

    @property
    def tcp_twist(self) -> Vector6:
        """Twist of the TCP at the measured joint speeds."""
        if not any(self.qd):
            return ZERO6
        jacobian = self._motion.arm.jacobian(self.q, self._motion.T_flange_tcp)
        return vector6((jacobian @ self.qd).tolist())


class _Joint:
    """
    One joint: a first-order lag, friction, and a damped oscillator excited by the acceleration.

    Friction and oscillator are solved exactly for inputs that are constant over a cycle, so the
    result is also correct for long cycles.
    """

    __slots__ = (
        '_bend',
        '_bend_speed',
        '_by_bend',
        '_by_speed',
        '_cycle',
        '_direction',
        '_drag',
        '_drag_share',
        '_follow_share',
        '_followed',
        '_imperfections',
        'is_settled',
        'position',
        'reads_speed',
        'speed',
        'target',
    )

    def __init__(
        self, imperfections: Imperfections, cycle: float, q: float, direction: float
    ) -> None:
        """
        Begin at rest at ``q`` [rad].

        :param direction: -1 to 1, direction of the previous motion; scales the static error.
        """
        self._imperfections, self._cycle = imperfections, cycle
        # With this fraction, the joint follows a ramp with exactly the lag, whatever the cycle.
        self._follow_share = cycle / (cycle + imperfections.lag)
        self._drag_share = 1.0 - exp(-cycle / imperfections.friction_time)
        decay, omega = imperfections.ringing_decay, 2.0 * pi * imperfections.ringing_frequency
        left, c, s = exp(-decay * cycle), cos(omega * cycle), sin(omega * cycle) / omega
        self._by_bend = left * (c + decay * s), -left * (omega**2 + decay**2) * s
        self._by_speed = left * s, left * (c - decay * s)
        self.target = self._followed = q
        self._direction, self._drag = direction, -imperfections.static_error * direction
        self._bend = self._bend_speed = 0.0
        #: Position of the joint [rad]; its speed [rad/s].
        self.position, self.speed = q + self._drag, 0.0
        #: Whether the joint stays at rest until its target moves.
        self.is_settled = True
        #: False = the measured speed is exactly 0.
        self.reads_speed = False

    def follow(self, q: float, qd: float, qdd: float) -> None:
        """Follow the target ``q`` [rad], ``qd`` [rad/s], ``qdd`` [rad/s^2] for a cycle."""
        imperfections = self._imperfections
        self.target = q
        self._followed += self._follow_share * (q - self._followed)
        bent = -imperfections.acceleration_error * qdd
        bend, speed = self._bend - bent, self._bend_speed
        self._bend = bent + self._by_bend[0] * bend + self._by_speed[0] * speed
        self._bend_speed = self._by_bend[1] * bend + self._by_speed[1] * speed
        deadband, friction = imperfections.speed_deadband, imperfections.static_error
        # A smaller speed can be a rounding error of inverse kinematics, with a meaningless sign.
        if abs(qd) > deadband:
            self._direction, friction = copysign(1.0, qd), imperfections.friction
        self._drag -= self._drag_share * (self._drag + friction * self._direction)
        before, self.position = self.position, self._followed + self._bend + self._drag
        self.speed = (self.position - before) / self._cycle
        self.reads_speed = qd != 0.0 or abs(self.speed) > deadband
        self.is_settled = (
            qd == 0.0
            and abs(self.speed) < _RESIDUE
            and abs(self._bend_speed) < _RESIDUE
            and abs(self._followed - q) < _RESIDUE
        )
