# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Recordings of arms that follow servoj by a hidden law, to be found from their packets alone.

Nothing here is shared with the estimators or with the simulator: exact laws are linear systems
that the matrix exponential carries from packet to packet, stepped ones are stepped.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import exp, log
from random import Random

from hidden_arm import PLAYING, rounding_noise, STOPPED
import numpy as np
from scipy.linalg import expm

from ur_cartesian_driver.identification.arm_samples import ArmSamples
from ur_cartesian_driver.identification.recorded_calls import MotionCommand, SetPoints

#: Standard deviation of the noise of targets [rad], as in :func:`hidden_arm.rounding_noise`.
NOISE = 5e-8
BEFORE, AFTER = 0.4, 0.6
#: How joints share the motion.
SHARES = ((0.0, 0.0, 0.0, 0.0, 0.0, 1.0), (0.0, 0.0, 0.0, -0.4, 0.0, 1.0))


@dataclass(frozen=True, kw_only=True)
class ServoLaw:
    """
    The law by which a joint follows its set-point.

    :param step: time between two steps of the law [s]; 0 = it is exact.
    :param kind: 'known'; or a law that the estimator does not know: 'first order', 'third order',
        and 'jump', where the set-point of a call does not run to its target.
    """

    gain_factor: float
    lookahead_factor: float
    step: float = 0.0
    kind: str = 'known'

    @classmethod
    def drawn(cls, random: Random, cycle: float, kind: str = 'known') -> ServoLaw:
        steps = [0.0, 0.002, cycle] if kind == 'known' else [0.0]
        return cls(
            gain_factor=exp(random.uniform(log(0.5), log(2.0))),
            lookahead_factor=exp(random.uniform(log(0.6), log(1.7))),
            step=random.choice(steps),
            kind=kind,
        )

    def system(self, gain: float, lookahead: float) -> tuple[np.ndarray, np.ndarray]:
        """Return the matrix (n, n) and the input (n,) of the states; the first one is q."""
        g, k = self.gain_factor * gain, self.lookahead_factor * lookahead
        if self.kind == 'first order':
            return np.array([[-1.0 / k]]), np.array([1.0 / k])
        if self.kind == 'third order':
            late = 0.4 * k
            chain = [[-1.0 / late, 1.0 / late, 0.0], [0.0, 0.0, 1.0], [0.0, -g, -g * k]]
            return np.array(chain), np.array([0.0, 0.0, g])
        return np.array([[0.0, 1.0], [-g, -g * k]]), np.array([0.0, g])

    def travel(self, points: SetPoints, places: np.ndarray, t: np.ndarray) -> np.ndarray:
        """
        Return how far a joint has come (n,) at evenly spaced times (n,) since the first call.

        :param places: set-points (k + 1,), of the rest before and of the k calls.
        """
        times = np.array(points.times)
        knots = np.concatenate([[0.0], np.cumsum(times)])
        if self.step:
            return self._stepped(points, knots, places, t)
        steps = np.diff(places)
        if self.kind == 'jump':
            events = [(at, jump, 0.0) for at, jump in zip(knots[:-1], steps, strict=True)]
        else:
            speeds = np.append(steps / times, 0.0)
            events = [(at, 0.0, speed) for at, speed in zip(knots, speeds, strict=True)]
        matrix, gain = self.system(points.gain, points.lookahead_time)
        return carried(matrix, gain, events, places[0], t)

    def _stepped(self, points, knots, places, t):
        g = self.gain_factor * points.gain
        k = self.lookahead_factor * points.lookahead_time
        every = round((t[1] - t[0]) / self.step)
        fine = t[0] + self.step * np.arange(every * (len(t) - 1) + 1)
        wanted = np.interp(fine, knots, places)
        q, v, found = places[0], 0.0, [places[0]]
        for u in wanted[1:].tolist():
            v += self.step * g * (u - q - k * v)
            q += self.step * v
            found.append(q)
        return np.array(found)[::every]


def carried(matrix, gain, events, place, t):
    """
    Return the first state (n,) of a linear system at evenly spaced times (n,).

    :param events: (time, jump, speed) of its input; before the first one all rests at ``place``.
    """
    size = len(gain)
    whole = np.zeros((size + 2, size + 2))
    whole[:size, :size], whole[:size, size], whole[size, size + 1] = matrix, gain, 1.0
    cycle = t[1] - t[0]
    over_a_cycle = expm(cycle * whole)
    state = np.linalg.solve(matrix, -gain * place)
    state = np.concatenate([state, [place, 0.0]])
    found, now, waiting = [], t[0], list(events)
    for then in t.tolist():
        is_whole = then - now > 0.999 * cycle
        while waiting and waiting[0][0] <= then:
            at, jump, speed = waiting.pop(0)
            state = expm(max(at - now, 0.0) * whole) @ state
            state[size] += jump
            state[size + 1] = speed
            now, is_whole = max(at, now), False
        state = (over_a_cycle if is_whole else expm((then - now) * whole)) @ state
        now = then
        found.append(state[0])
    return np.array(found)


@dataclass(kw_only=True)
class ServoMotion:
    """
    One recorded motion.

    :param t: (n,) times of all packets since the first call [s]; ``kept``: indices of those that
        arrived.
    :param correlation: of the noise of a packet with that of the one before.
    """

    law: ServoLaw
    points: SetPoints
    start: np.ndarray
    t: np.ndarray
    kept: np.ndarray
    correlation: float
    samples: ArmSamples

    @property
    def command(self) -> MotionCommand:
        return MotionCommand(name='servoj', set_points=self.points)

    def best_errors(self) -> dict[str, float]:
        """
        Return the standard errors of a fit that knows the law's form and the noise.

        By the information that the packets have of place, onset and both factors (Cramer, Rao),
        of all joints that move.
        """
        gain, lookahead = self.law.gain_factor, self.law.lookahead_factor
        information = np.zeros((2, 2))
        for joint in np.flatnonzero(np.ptp(np.array(self.points.targets), axis=0)):
            places = np.array([self.start[joint], *(q[joint] for q in self.points.targets)])

            def model(place=0.0, onset=0.0, g=gain, k=lookahead, places=places):
                law = replace(self.law, gain_factor=g, lookahead_factor=k)
                moved = np.append(places[0] + place, places[1:])
                return law.travel(self.points, moved, self.t - onset)[self.kept]

            columns = [
                (model(**{name: at + h}) - model(**{name: at - h})) / (2.0 * h)
                for name, at, h in (
                    ('g', gain, 1e-5),
                    ('k', lookahead, 1e-5),
                    ('place', 0.0, 1e-6),
                    ('onset', 0.0, 1e-6),
                )
            ]
            white = self._white(np.stack(columns, axis=1)) / NOISE
            information += np.linalg.inv(np.linalg.inv(white.T @ white)[:2, :2])
        errors = np.sqrt(np.diag(np.linalg.inv(information))).tolist()
        return dict(zip(('servo_gain_factor', 'servo_lookahead_factor'), errors, strict=True))

    def _white(self, columns):
        """Return columns (n, k) without the correlation of the noise."""
        like = (self.correlation ** np.diff(self.kept))[:, None]
        return np.concatenate(
            [columns[:1], (columns[1:] - like * columns[:-1]) / np.sqrt(1.0 - like**2)]
        )


def record_servo(law, random, points, start, cycle, deceleration=None):
    """
    Return the recording of a motion, with rest before and behind it.

    :param deceleration: of the fastest joint behind the last call, in a program that goes on
        without a further one [rad/s^2]; None = the arm is at rest by then.
    """
    generator = np.random.default_rng(random.randrange(2**32))
    # A law in steps begins in one of them, an exact one between two packets.
    late = random.randrange(round(cycle / law.step)) * law.step if law.step else 0.0
    late = late if law.step else random.uniform(0.0, cycle)
    duration = sum(points.times)
    count = round((BEFORE + duration + AFTER) / cycle)
    t = cycle * np.arange(count) - round(BEFORE / cycle) * cycle - late
    last = int(np.searchsorted(t, duration)) - 1
    q = np.repeat(start[None], count, axis=0)
    ends = []
    for joint in np.flatnonzero(np.ptp(np.array(points.targets), axis=0)):
        places = np.array([start[joint], *(target[joint] for target in points.targets)])
        q[: last + 1, joint] = law.travel(points, places, t[: last + 1])
        fine = law.step or 1e-3
        end = law.travel(points, places, fine * np.arange(round(duration / fine) + 1))
        ends.append((joint, end[-1], (end[-1] - end[-2]) / fine))
    ramp = max(abs(v) for *_, v in ends) / deceleration if deceleration else 0.0
    since = np.minimum(t[last + 1 :] - duration, ramp)
    braked = since - 0.5 * since**2 / max(ramp, 1e-12)
    for joint, end, v in ends:
        q[last + 1 :, joint] = end + v * braked
    correlation = generator.uniform(0.0, 0.5)
    targets = q + rounding_noise(generator, q.shape, correlation)
    kept = np.flatnonzero(generator.uniform(size=count) > random.uniform(0.0, 0.08))
    states = np.where((t > -0.05) & (t < duration + 0.5), PLAYING, STOPPED)
    samples = ArmSamples(
        name='servo',
        time=(1000.0 + t - t[0])[kept],
        target_q=targets[kept],
        runtime_state=states.astype(float)[kept],
    )
    inside = kept[kept <= last]
    return ServoMotion(
        law=law, points=points, start=start, t=t[: last + 1], kept=inside,
        correlation=correlation, samples=samples,
    )  # fmt: skip


def drawn_calls(random, start, angle=0.17):
    """Return calls there and back by about an angle [rad], with rest before, between, behind."""
    share = np.array(random.choice(SHARES))
    size = angle * random.uniform(0.8, 1.2) * random.choice([-1.0, 1.0])
    run, hold = random.uniform(1.4, 2.0), random.uniform(0.6, 1.0)
    t = random.choice([0.016, 0.04, 0.2])
    ways = [0.0] * round(0.4 / t)
    there = round(run / t)
    ways += [size * (i + 1) / there for i in range(there)] + [size] * round(hold / t)
    ways += [size * (there - i - 1) / there for i in range(there)] + [0.0] * round(hold / t)
    gain, lookahead = random.choice([(300.0, 0.1), (300.0, 0.1), (600.0, 0.08), (1000.0, 0.06)])
    return SetPoints(
        targets=tuple(tuple((start + way * share).tolist()) for way in ways),
        times=(t,) * len(ways),
        gain=gain,
        lookahead_time=lookahead,
        is_stopped=True,
    )


def drawn_run(random, start):
    """Return calls whose set-points are on the move when they end."""
    share, t = np.array(random.choice(SHARES)), random.choice([0.016, 0.04])
    speed = random.uniform(0.5, 0.8) * random.choice([-1.0, 1.0])
    ways = [0.0] * round(0.4 / t) + [speed * t * (i + 1) for i in range(round(2.4 / t))]
    targets = tuple(tuple((start + way * share).tolist()) for way in ways)
    return SetPoints(targets=targets, times=(t,) * len(ways))


def drawn_motion(random, kind='known'):
    """Return a recorded motion of an arm whose law is drawn at random."""
    cycle = random.choice([0.002, 0.002, 0.008])
    start = np.array([random.uniform(-1.5, 1.5) for _ in range(6)])
    law = ServoLaw.drawn(random, cycle, kind)
    return record_servo(law, random, drawn_calls(random, start), start, cycle)
