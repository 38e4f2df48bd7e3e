# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Recordings of chains of moves with blends, by laws that are drawn at random.

Nothing here is shared with the estimators or with the simulator. A blend is made of the direction
in which it goes: from that of one line to that of the next, by a share that grows with the
parameter. If it grows evenly, the curve is a parabola; if not, one that no estimator knows.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import acos, cos, exp, log, pi, sin, sqrt, tan
from random import Random

from hidden_arm import joints, places, PLAYING, quaternions, rounding_noise, Steps, STOPPED
import numpy as np

from ur_cartesian_driver.identification.arm_samples import ArmSamples
from ur_cartesian_driver.identification.recorded_calls import MotionCommand

#: Integrals of the share of the second direction, up to u; each is 1/2 at 1.
CURVES = {
    'parabola': lambda u: u**2 / 2,
    # The curvature grows evenly from 0 and falls again, as of two clothoids.
    'clothoids': lambda u: np.where(
        u < 0.5, 2 * u**3 / 3, u - 0.5 + 2 * (1 - np.maximum(u, 0.5)) ** 3 / 3
    ),
    'quintic': lambda u: u**6 - 3 * u**5 + 2.5 * u**4,
}
UNKNOWN_SHAPES = ('clothoids', 'quintic', 'arc', 'lopsided')
BEFORE, AFTER = 0.4, 0.5


@dataclass(frozen=True, kw_only=True)
class BlendLaws:
    """
    The laws of the blends of one arm.

    :param wave: by which share the rate rises in a blend beside the law, as no estimator knows it.
    """

    begin: float
    ratio: float
    start_time: float
    shape: str = 'parabola'
    wave: float = 0.0

    @classmethod
    def drawn(cls, random, shape='parabola', wave=0.0):
        return cls(
            begin=random.uniform(0.3, 1.0),
            ratio=random.choice([1.0, exp(random.uniform(log(0.5), log(2.0)))]),
            start_time=random.uniform(0.06, 0.3),
            shape=shape,
            wave=wave,
        )


@dataclass(frozen=True, kw_only=True)
class Chain:
    """
    Moves with blends at all points between them.

    :param points: (n, 6) of the tool [m, rad], or of the joints [rad]; the first is the start.
    :param radii: of the tool at the inner points [m].
    :param speeds: of the moves, along the line [m/s or rad/s]; ``exits``: rates of the parameter
        at the ends of the blends [1/s].
    """

    of_lines: bool
    points: np.ndarray
    radii: np.ndarray
    speeds: np.ndarray
    exits: np.ndarray
    acceleration: float

    def sections(self, laws, room=0.0):
        """
        Return duration and places of each line and blend, as functions of time.

        :param room: length of lines between blends, by that which a blend takes of them.
        """
        steps = np.diff(self.points, axis=0)
        size = 3 if self.of_lines else 6
        directions = steps / np.linalg.norm(steps[:, :size], axis=1, keepdims=True)
        found, at, entry, head = [], self.points[0], 0.0, 0.0
        for i, d in enumerate(directions):
            point, last, tail, before = self.points[i + 1], i + 1 == len(directions), 0.0, head
            if not last:
                e = directions[i + 1]
                tail, head = self._taken(laws, i, d, e)
            left = float((point - at)[:size] @ d[:size]) - tail
            if left < room * max(tail, before):
                raise TooShort
            line = line_steps(left, entry, self.speeds[i], last, self.acceleration)
            found.append((line.t[-1], straight(at, d, line)))
            if last:
                break
            blend = Blend(point, d, e, tail, head, laws.shape, size)
            rates = self.speeds[i] / blend.entry, self.exits[i]
            rate = blend_steps(*rates, laws.ratio, laws.wave)
            found.append((rate.t[-1], blend.over(rate)))
            at, entry = point + head * e, rates[1] * blend.exit
        return found

    def _taken(self, laws, i, d, e):
        """Return how much a blend takes of the line before it, and of the one behind it."""
        distance = laws.begin * self.radii[i]
        tail, head = (self._reach(self.points[i + 1], way, distance) for way in (-d, e))
        return (min(tail, head),) * 2 if laws.shape == 'arc' else (tail, head)

    def _reach(self, corner, direction, distance):
        """Return the length of a line in which the tool gets to a distance from a corner."""
        if self.of_lines:
            return distance
        origin, length = places(corner[None])[0, :3], distance
        for _ in range(12):  # The tool moves about as far as the joints do.
            tool = places((corner + length * direction)[None])[0, :3]
            length *= distance / np.linalg.norm(tool - origin)
        return length

    def places(self, laws, t, late=(0.0, 0.0)):
        """
        Return where tool or joints are (n, 6) at times since the start of the program [s].

        :param late: by how much each blend sets out later than its line has ended [s].
        """
        p = Steps((0.0, 0.0), (laws.start_time, 1.0)).integral(t)
        found, begin = np.repeat(self.points[:1], len(t), axis=0), 0.0
        for i, (duration, place) in enumerate(self.sections(laws)):
            since = p - begin - (late[i // 2] if i % 2 else 0.0)
            found = np.where((p >= begin)[:, None], place(np.maximum(since, 0.0)), found)
            begin += duration
        return found

    def along(self, laws, t):
        """Return the directions (n, 3 or 6) of the lines on which rows are; zeros in blends."""
        p = Steps((0.0, 0.0), (laws.start_time, 1.0)).integral(t)
        begins = np.cumsum([0.0, *(duration for duration, _ in self.sections(laws))])[1:-1]
        section = np.searchsorted(begins, p)
        steps = np.diff(self.points, axis=0)[:, : 3 if self.of_lines else 6]
        directions = steps / np.linalg.norm(steps, axis=1, keepdims=True)
        return np.where(section[:, None] % 2 == 0, directions[section // 2], 0.0)

    def duration(self, laws):
        return sum(duration for duration, _ in self.sections(laws)) + 0.5 * laws.start_time

    def calls(self):
        name = 'movel' if self.of_lines else 'movej'
        return [MotionCommand(name=name, a=1.0, v=1.0, r=float(r) or None) for r in
                (*self.radii, 0.0)]  # fmt: skip


class Blend:
    """The curve from one line to the next."""

    def __init__(self, corner, d, e, tail, head, shape, size):
        self.corner, self.d, self.e, self.shape = corner, d, e, shape
        self.tail, self.head = tail, head
        if shape == 'arc':
            self.angle = acos(float(d[:size] @ e[:size]))
            self.radius = self.tail / tan(0.5 * self.angle)
            self.entry = self.exit = self.radius * self.angle
        elif shape == 'lopsided':
            # A cubic of Bezier whose inner points are not two thirds of the way.
            self.entry, self.exit = 3 * 0.5 * self.tail, 3 * 0.8 * self.head
        else:
            self.entry, self.exit = 2 * self.tail, 2 * self.head

    def taken(self, u):
        """Return how far places are before the corner on one line, and behind it on the next."""
        if self.shape == 'arc':
            turned = u * self.angle
            behind = self.radius * (1 - np.cos(turned)) / sin(self.angle)
            before = self.tail - self.radius * np.sin(turned) + behind * cos(self.angle)
            return before, behind
        if self.shape == 'lopsided':
            return (
                self.tail * ((1 - u) ** 3 + 1.5 * u * (1 - u) ** 2),
                self.head * (u**3 + 0.6 * u**2 * (1 - u)),
            )
        share = CURVES[self.shape](u)
        return self.tail * (1 - 2 * u + 2 * share), self.head * 2 * share

    def over(self, rate):
        def place(t):
            before, behind = self.taken(np.minimum(rate.integral(np.minimum(t, rate.t[-1])), 1.0))
            return self.corner - before[:, None] * self.d + behind[:, None] * self.e

        return place


class TooShort(Exception):
    """A line has no room for its speeds, or none beside its blends."""


def straight(at, direction, steps):
    return lambda t: at + steps.integral(np.minimum(t, steps.t[-1]))[:, None] * direction


def line_steps(length, entry, speed, is_last, a):
    """Return the speed on a line, up to its own speed, or to rest at its end."""
    end = 0.0 if is_last else speed
    ramps = [(entry, speed), (speed, end)]
    times = [abs(y - x) / a for x, y in ramps]
    cruise = length - sum(0.5 * (x + y) * time for (x, y), time in zip(ramps, times, strict=True))
    if cruise <= 0.0:
        raise TooShort
    t = np.cumsum([times[0], cruise / speed, times[1]])
    knots = [(0.0, entry), (t[0], speed), (t[1], speed), (t[2], end)]
    return Steps(*(knot for i, knot in enumerate(knots) if not i or knot[0] > knots[i - 1][0]))


def blend_steps(entry, leave, ratio, wave):
    """Return the rate of the parameter: even to half-way, and even from there."""
    middle = ratio * sqrt(0.5 * (entry**2 + leave**2))
    first, second = 1.0 / (entry + middle), 1.0 / (middle + leave)
    knots = [(0.0, entry), (first, middle), (first + second, leave)]
    if not wave:
        return Steps(*knots)
    t = np.linspace(0.0, first + second, 200)
    at, rates = zip(*knots, strict=True)
    plain = np.interp(t, at, rates)
    waved = plain * (1.0 + wave * np.sin(pi * t / t[-1]) ** 2)
    # Faster in less time: the parameter still ends at 1.
    return Steps(*zip(t / Steps(*zip(t, waved, strict=True)).area[-1], waved, strict=True))


def drawn_chain(laws, random, of_lines):
    """Return a chain of three moves, whose blends take 0.25 to 0.8 s."""
    while True:
        chain = any_chain(laws, random, of_lines)
        try:
            chain.sections(laws, room=1.5)
        except TooShort:
            continue
        return chain


def any_chain(laws, random, of_lines):
    """Return a chain of three moves, which may have no room for their speeds."""
    radii = np.array([random.uniform(0.005, 0.025) for _ in range(2)])
    points = [np.array([random.uniform(-0.3, 0.3) for _ in range(6)])]
    size = 3 if of_lines else 6
    direction = unit([random.gauss(0.0, 1.0) for _ in range(size)])
    speeds, exits = [], []
    # Tool and joints move about alike far.
    for i in range(3):
        nearby = max(radii[max(i - 1, 0)], radii[min(i, 1)])
        length = nearby * random.uniform(5.0, 8.0) + 0.05
        turn = [random.uniform(-0.5, 0.5) for _ in range(3)]
        step = np.concatenate([direction, turn])[:6] if of_lines else direction
        points.append(points[-1] + length * step)
        across = np.array([random.gauss(0.0, 1.0) for _ in range(size)])
        across = unit(across - (across @ direction) * direction)
        angle = random.uniform(0.4, 2.6)
        direction = cos(angle) * direction + sin(angle) * across
        time = random.uniform(0.25, 0.8)
        radius = laws.begin * radii[min(i, 1)]
        speeds.append(2.0 * radius / time)
        exits.append(random.uniform(0.7, 1.4) / time)
    return Chain(
        of_lines=of_lines,
        points=np.array(points),
        radii=radii,
        speeds=np.array(speeds),
        exits=np.array(exits[:2]),
        acceleration=random.uniform(1.0, 2.0),
    )


def unit(vector):
    return np.array(vector) / np.linalg.norm(vector)


@dataclass(frozen=True, kw_only=True)
class Noise:
    """The noise of recorded targets [m, rad], how like each packet is to the one before, gaps."""

    size: float
    correlation: float
    gaps: float
    cycle: float

    @classmethod
    def drawn(cls, random):
        return cls(
            size=exp(random.uniform(log(1e-8), log(5e-8))),
            correlation=random.uniform(0.0, 0.5),
            gaps=random.uniform(0.0, 0.05),
            cycle=random.choice([0.002, 0.002, 0.008]),
        )


def recorded(name, chain, laws, noise, random):
    """Return the packets of a program that runs a chain."""
    generator = np.random.default_rng(random.randrange(2**32))
    whole = BEFORE + chain.duration(laws) + AFTER
    t = noise.cycle * np.arange(round(whole / noise.cycle))
    begin = BEFORE + random.uniform(0.0, noise.cycle)
    found = chain.places(laws, t - begin)
    y, q = (found, joints(found)) if chain.of_lines else (places(found), found)
    pose = np.concatenate([y[:, :3], quaternions(y[:, 3:])], axis=1)
    scale = noise.size / 5e-8
    q, pose = (
        x + scale * rounding_noise(generator, x.shape, noise.correlation) for x in (q, pose)
    )
    kept = generator.uniform(size=len(t)) >= noise.gaps
    states = np.where((t > begin - 0.05) & (t < whole - AFTER), PLAYING, STOPPED).astype(float)
    return ArmSamples(
        name=name, time=1000.0 + t[kept], target_q=q[kept], target_pose=pose[kept],
        runtime_state=states[kept],
    )  # fmt: skip


def blend_experiments(laws, random):
    """Return recordings of a chain of lines and one of joint moves, their calls, and the truth."""
    noise = Noise.drawn(random)
    chains = [drawn_chain(laws, random, of_lines) for of_lines in (True, False)]
    recordings = [
        recorded(f'chain {i}', chain, laws, noise, random) for i, chain in enumerate(chains)
    ]
    calls = [call for chain in chains for call in chain.calls()]
    return recordings, calls, chains, noise


def best_errors(chains, laws, noise):
    """
    Return the least standard errors of begin and ratio: of a fit that knows the law of blends.

    It is that of Cramer and Rao: from the derivatives of what a chain shows, by the laws, the
    points, the speeds and the times, and from the noise. How far the arm is along a line tells
    nothing, as by which profile it moves there is no law of blends. The begin is that of lines:
    of joint moves it depends on the kinematics, which recordings do not contain.
    """
    whole, fields = np.zeros((2, 2)), ('points', 'speeds', 'exits')
    for chain in chains:
        t = noise.cycle * np.arange(round((chain.duration(laws) + 0.2) / noise.cycle)) - 0.1
        parts = [np.ravel(getattr(chain, name)) for name in fields]
        start = np.concatenate([[laws.begin, laws.ratio, 0.0, 0.0], *parts])
        ends = np.cumsum([4, *(len(part) for part in parts)])
        along = chain.along(laws, t)

        def shown(x, chain=chain, ends=ends, t=t, along=along):
            values = {
                name: x[a:b].reshape(getattr(chain, name).shape)
                for name, a, b in zip(fields, ends, ends[1:], strict=False)
            }
            found = replace(chain, **values).places(
                replace(laws, begin=x[0], ratio=x[1]), t, x[2:4]
            )[:, : along.shape[1]]
            found = found - (found * along).sum(axis=1, keepdims=True) * along
            new = found[1:] - noise.correlation * found[:-1]
            # The first and last rows of blends, of which the one before is seen in part only.
            new = new * (along[1:] == along[:-1]).all(axis=1, keepdims=True)
            return (new / sqrt(1.0 - noise.correlation**2)).ravel()

        columns = []
        for i in range(len(start)):
            step = np.zeros(len(start))
            step[i] = 1e-6
            columns.append((shown(start + step) - shown(start - step)) / 2e-6)
        jacobian = np.stack(columns, axis=1)
        sizes = np.maximum(np.linalg.norm(jacobian, axis=0), 1e-6)
        information = (jacobian / sizes).T @ (jacobian / sizes)
        # What shows nowhere, as the place at which a line begins, is left out.
        covariance = np.linalg.pinv(information, rcond=1e-11, hermitian=True)[:2, :2]
        errors = covariance * noise.size**2 / np.outer(sizes[:2], sizes[:2])
        if chain.of_lines:
            whole += np.linalg.inv(errors)
        else:
            whole[1, 1] += 1.0 / errors[1, 1]
    return np.sqrt(np.diag(np.linalg.inv(whole)))


def drawn_arm(random: Random, shape='parabola', wave=0.0):
    """Return the laws of an arm, and what :func:`blend_experiments` makes of them."""
    laws = BlendLaws.drawn(random, shape, wave)
    return laws, *blend_experiments(laws, random)
