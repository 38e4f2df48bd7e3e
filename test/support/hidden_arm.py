# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Recordings of arms with random laws, which estimators have to find from the packets alone.

Nothing here is shared with the estimators or with the simulator: laws are piecewise linear rates
and speeds that are integrated, the arm is stepped in time, and the joints are an invented smooth
function of the tool's pose.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from math import cos, exp, pi, sin, sqrt
from random import Random

import numpy as np

from ur_cartesian_driver.identification.arm_samples import ArmSamples
from ur_cartesian_driver.identification.recorded_calls import MotionCommand

STOPPING, STOPPED, PLAYING, PAUSING, PAUSED = range(5)
NORMAL, PROTECTIVE_STOP = 1, 3
RESOLUTION = 2.0 * pi / 2**17
#: Number of substeps of the arm in a cycle.
SUBSTEPS = 4


@dataclass(frozen=True, kw_only=True)
class Laws:
    """The laws of one arm, by the names of the table of laws."""

    start_time: float
    stop_time: float
    pause_time: float
    protective_stop_time: float
    turn_ratio: float
    timed_joint_acceleration: float
    timed_joint_speed: float
    timed_linear_acceleration: float
    timed_linear_speed: float
    idle_between_moves: float
    lag: float
    friction: float
    static_error: float
    acceleration_error: float
    ringing_frequency: float
    ringing_decay: float
    position_noise: float
    single_gaps: float
    long_gaps: float

    @classmethod
    def drawn(cls, random: Random) -> Laws:
        return cls(
            start_time=random.uniform(0.06, 0.3),
            stop_time=random.uniform(0.06, 0.4),
            pause_time=random.uniform(0.08, 0.5),
            protective_stop_time=random.uniform(0.06, 0.3),
            turn_ratio=random.uniform(1.0, 6.0),
            timed_joint_acceleration=random.uniform(0.8, 2.5),
            timed_joint_speed=random.uniform(0.4, 1.2),
            timed_linear_acceleration=random.uniform(0.5, 2.0),
            timed_linear_speed=random.uniform(0.1, 0.4),
            idle_between_moves=random.choice([0.0, random.uniform(0.0, 0.02)]),
            lag=random.uniform(3e-4, 1.3e-3),
            friction=random.uniform(1e-4, 3e-4),
            static_error=random.uniform(5e-5, 4e-4),
            acceleration_error=random.uniform(4e-5, 1.5e-4),
            ringing_frequency=random.uniform(6.0, 15.0),
            ringing_decay=random.uniform(4.0, 10.0),
            position_noise=random.uniform(6e-5, 1.5e-4),
            single_gaps=random.uniform(0.0, 0.08),
            long_gaps=random.uniform(0.0, 0.004),
        )


class Steps:
    """A piecewise linear function of time, and its integral."""

    def __init__(self, *knots: tuple[float, float]):
        self.t, self.y = (np.array(column) for column in zip(*knots, strict=True))
        areas = 0.5 * (self.y[1:] + self.y[:-1]) * np.diff(self.t)
        self.area = np.concatenate([[0.0], np.cumsum(areas)])

    def value(self, t):
        return np.interp(t, self.t, self.y)

    def integral(self, t):
        i = np.clip(np.searchsorted(self.t, t, side='right') - 1, 0, len(self.t) - 1)
        since = np.maximum(t - self.t[i], 0.0)
        after = np.minimum(i + 1, len(self.t) - 1)
        span = np.maximum(self.t[after] - self.t[i], 1e-300)
        slope = np.where(after > i, (self.y[after] - self.y[i]) / span, 0.0)
        return self.area[i] + self.y[i] * since + 0.5 * slope * since**2


def speed_steps(length: float, a: float, v: float) -> Steps:
    peak = min(v, sqrt(length * a))
    up, whole = peak / a, length / peak + peak / a
    return Steps((0.0, 0.0), (up, peak), (whole - up + 1e-12, peak), (whole + 1e-12, 0.0))


def smooth_steps(length: float, a: float, v: float) -> Steps:
    """Return sine ramps, a law that the estimators do not know."""
    ramp = 1.5 * v / a
    whole = length / v + ramp
    shares = np.linspace(0.0, 1.0, 41)
    rise = [(ramp * x, v * 0.5 * (1.0 - cos(pi * x))) for x in shares]
    fall = [(whole - t, y) for t, y in reversed(rise)]
    return Steps(*rise, *fall)


@dataclass
class Program:
    """Consecutive moves in the time of their path, and their recording by an arm."""

    laws: Laws
    random: Random
    cycle: float = 0.002
    shape: Callable[..., Steps] = speed_steps
    y: np.ndarray = field(default_factory=lambda: np.zeros(6))
    parts: list = field(default_factory=list)
    commands: list = field(default_factory=list)
    path_time: float = 0.0

    def movej(self, q, a=None, v=None, t=None):
        start, end = joints(self.y[None])[0], np.array(q)
        laws, lead = self.laws, np.abs(end - start).max()
        steps = self.shape(lead, a or laws.timed_joint_acceleration, v or laws.timed_joint_speed)
        self._add(steps, lead, t, lambda u: places(start + u[:, None] * (end - start)))
        self.commands.append(MotionCommand(name='movej', a=a, v=v, t=t))

    def movel(self, way, turn, a=None, v=None, t=None):
        """Move by a vector (3,) and turn to a rotation vector along the present axis."""
        start, end = self.y.copy(), np.concatenate([self.y[:3] + way, turn])
        laws = self.laws
        asked = a or laws.timed_linear_acceleration, v or laws.timed_linear_speed
        lengths = np.linalg.norm(end[:3] - start[:3]), np.linalg.norm(end[3:] - start[3:])
        each = []
        for length, ratio in zip(lengths, (1.0, laws.turn_ratio), strict=True):
            if length > 1e-9:
                each.append((self.shape(length, ratio * asked[0], ratio * asked[1]), length))
        steps, length = max(each, key=lambda one: one[0].t[-1])
        self._add(steps, length, t, lambda u: start + u[:, None] * (end - start))
        self.commands.append(MotionCommand(name='movel', a=a, v=v, t=t))

    def _add(self, steps, length, t, place):
        if self.parts:
            self.path_time += self.laws.idle_between_moves
        stretch = t / steps.t[-1] if t else 1.0
        begin, end = self.path_time, self.path_time + stretch * steps.t[-1]
        self.parts.append(
            (begin, end, lambda p: place(steps.integral((p - begin) / stretch) / length))
        )
        self.path_time, self.y = end, place(np.ones(1))[0]

    def wait(self, time):
        """Rest within the program, longer than between moves in a row."""
        self.path_time += time

    def record(self, name, ending=None, at=0.0):
        """
        Return the packets of the program, from before its start until the arm has rested.

        :param ending: 'stop', 'pause' or 'protective'; ``at``: its time since the start [s].
        """
        laws, before = self.laws, 0.4 + self.random.uniform(0.0, 0.002)
        knots = [(0.0, 0.0), (laws.start_time, 1.0)]
        end = before + self.duration
        ramp = {
            'stop': laws.stop_time,
            'pause': laws.pause_time,
            'protective': laws.protective_stop_time,
        }.get(ending, 0.0)
        if ending:
            knots += [(at, 1.0), (at + ramp, 0.0)]
            end = before + at + ramp
        rate = Steps(*knots)
        count = round((end + 1.0) / self.cycle)
        t = self.cycle * np.arange(count)

        fine = (self.cycle / SUBSTEPS) * np.arange(count * SUBSTEPS)
        y, q = (self._along(rate.integral(x - before)) for x in (t, fine))
        q = joints(q)
        states, safety = np.full(count, STOPPED), np.full(count, NORMAL)
        states[(t > before - 0.05) & (t < end)] = PLAYING
        if ending:
            passed = t >= before + at
            states[passed] = {'stop': STOPPING, 'pause': PAUSING, 'protective': PAUSED}[ending]
            states[t > end] = {'stop': STOPPED, 'pause': PAUSED, 'protective': PAUSED}[ending]
            if ending == 'protective':
                safety[passed] = PROTECTIVE_STOP
        return self._packets(name, t, y, q, states, safety)

    @property
    def duration(self):
        """Time from the start of the program to the end of its last move [s]."""
        return self.path_time + 0.5 * self.laws.start_time

    def places_at(self, times):
        """Return the places of the tool (n, 6) at times since the start of the program [s]."""
        rate = Steps((0.0, 0.0), (self.laws.start_time, 1.0))
        return self._along(rate.integral(times))

    def _along(self, path_times):
        y = np.repeat(self.parts[0][2](np.zeros(1)), len(path_times), axis=0)
        for begin, _, place in self.parts:
            y = np.where((path_times >= begin)[:, None], place(np.maximum(path_times, begin)), y)
        return y

    def _packets(self, name, t, y, q, states, safety):
        generator = np.random.default_rng(self.random.randrange(2**32))
        measured = step_arm(self.laws, q, self.cycle / SUBSTEPS, generator)[::SUBSTEPS]
        measured = measured + self.laws.position_noise * generator.uniform(-0.5, 0.5, (len(t), 6))
        targets, poses = q[::SUBSTEPS], np.concatenate([y[:, :3], quaternions(y[:, 3:])], axis=1)
        correlation = generator.uniform(0.0, 0.5)
        targets = targets + rounding_noise(generator, targets.shape, correlation)
        poses = poses + rounding_noise(generator, poses.shape, correlation)
        kept = self._kept(len(t), generator)
        columns = {
            'time': 1000.0 + t,
            'target_q': targets,
            'actual_q': RESOLUTION * np.round(measured / RESOLUTION),
            'target_pose': poses,
            'runtime_state': states.astype(float),
            'safety_mode': safety.astype(float),
        }
        return ArmSamples(name=name, **{key: values[kept] for key, values in columns.items()})

    def _kept(self, count, generator):
        kept, i = [], 0
        while i < count:
            kept.append(i)
            draw = generator.uniform()
            if draw < self.laws.long_gaps:
                i += int(generator.integers(2, 6))
            elif draw < self.laws.long_gaps + self.laws.single_gaps:
                i += 1
            i += 1
        return np.array(kept)


def joints(y):
    """Return invented joints (n, 6) of tool places (n, 6)."""
    q = 1.3 * y
    q[:, 1:] += 0.4 * np.sin(2.0 * y[:, :-1])
    return q


def places(q):
    """Return the tool places of joints: the inverse of :func:`joints`."""
    y = q / 1.3
    for i in range(1, 6):
        y[:, i] -= 0.4 / 1.3 * np.sin(2.0 * y[:, i - 1])
    return y


def quaternions(r):
    angle = np.linalg.norm(r, axis=1)
    scale = np.where(angle > 1e-12, np.sin(0.5 * angle) / np.maximum(angle, 1e-12), 0.5)
    return np.concatenate([scale[:, None] * r, np.cos(0.5 * angle)[:, None]], axis=1)


def rounding_noise(generator, shape, correlation):
    """Return noise as small as on recorded targets; consecutive packets are correlated."""
    white = 5e-8 * generator.standard_normal(shape)
    noise = white.copy()
    for i in range(1, len(noise)):
        noise[i] = correlation * noise[i - 1] + sqrt(1.0 - correlation**2) * white[i]
    return noise


def step_arm(laws, q, step, generator):
    """Return the positions (n, 6) of joints that follow targets (n, 6), both in substeps."""
    first = generator.uniform(-1.0, 1.0, 6) * laws.static_error
    lagging, drag, direction = q[0].copy(), first, np.zeros(6)
    bend, bend_speed, before = np.zeros(6), np.zeros(6), np.zeros(6)
    follow, settle = exp(-step / laws.lag), exp(-step / 0.02)
    w, d = 2.0 * pi * laws.ringing_frequency, laws.ringing_decay
    left, c, s = exp(-d * step), cos(w * step), sin(w * step) / w
    speeds = np.diff(q, axis=0, prepend=q[:1]) / step
    found = np.empty_like(q)
    for i, (target, qd) in enumerate(zip(q, speeds, strict=True)):
        # This is exact for a target with a constant speed within the step.
        behind = qd * laws.lag
        lagging = target - behind + (lagging - (target - qd * step) + behind) * follow
        fast = np.abs(qd) > 1e-3
        direction = np.where(fast, np.sign(qd), direction)
        pull = np.where(fast, laws.friction, laws.static_error) * direction
        drag = np.where(direction == 0.0, drag, -pull + (drag + pull) * settle)
        bent = -laws.acceleration_error * (qd - before) / step
        off, rate, before = bend - bent, bend_speed, qd
        bend = bent + left * ((c + d * s) * off + s * rate)
        bend_speed = left * (-(w * w + d * d) * s * off + (c - d * s) * rate)
        found[i] = lagging + drag + bend
    return found


def standard_experiments(laws, random, shape=speed_steps):
    """Return the recordings of one arm, and the calls behind their moves."""
    cycle = random.choice([0.002, 0.002, 0.008])
    axis = np.array([0.6, -0.3, 0.74]) / np.linalg.norm([0.6, -0.3, 0.74])

    def near(x):
        return x * random.uniform(0.8, 1.2)

    def program():
        return Program(laws=laws, random=random, cycle=cycle, shape=shape)

    chain = program()
    chain.movej([near(1.4), near(0.5), 0.2, 0, 0, near(-0.9)])
    chain.movej([near(0.3), near(0.9), 0.1, 0, 0, 0.1], a=near(2.0), v=near(0.6))
    chain.movej([near(1.0), 0.1, near(0.5), 0, 0, near(0.6)], a=near(1.2), v=near(0.9))
    lines = program()
    lines.movel([0, 0, 0], near(0.8) * axis, a=near(0.5), v=near(0.1))
    lines.movel([near(0.3), near(-0.2), 0.1], lines.y[3:])
    lines.movel([-0.2, 0.1, near(0.2)], 0.0 * axis, a=near(0.8), v=near(0.15))
    recordings = [chain.record('chain'), lines.record('lines')]
    commands = [*chain.commands, *lines.commands]
    for ending in ('stop', 'pause', 'protective'):
        stopped = program()
        stopped.movej([near(1.6), 0.3, 0.2, 0, 0, 0], a=3.0, v=near(0.5))
        recordings.append(stopped.record(ending, ending, near(1.2)))
        commands += stopped.commands
    return recordings, commands


def unseen_moves(laws, random):
    """Return a program of five moves that the standard experiments do not have."""
    program = Program(laws=laws, random=random)

    def draw(low, high):
        return random.uniform(low, high)

    for _ in range(5):
        a, v = random.choice([(None, None), (draw(0.4, 3.0), draw(0.05, 0.8))])
        if random.random() < 0.5:
            program.movej([draw(-1.5, 1.5) for _ in range(6)], a, v)
        else:
            turn = program.y[3:] + draw(-0.8, 0.8) * np.array([0.6, 0.0, 0.8])
            program.movel(np.array([draw(-0.4, 0.4) for _ in range(3)]), turn, a, v)
    return program
