# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The planner times a chain of moves as the simulated controller does.

Random chains of moves run through both: rows of the planner, and the path motion of the simulator,
which share no code. No arm is needed: the joint lines of these tests have a tool of their own.
"""

from __future__ import annotations

from itertools import pairwise
from math import inf
from typing import Any

import numpy as np
import pytest

from ur_cartesian_driver.motion.geometry.pose import Pose
from ur_cartesian_driver.motion.geometry.vectors import vector6
from ur_cartesian_driver.planning.moves.move_chain import MoveChain, Moves
from ur_cartesian_driver.sim.motion.motion_values import Move
from ur_cartesian_driver.sim.motion.paths.motion_calls import constant_speed_parameters
from ur_cartesian_driver.sim.motion.paths.move_paths import (
    CircularMovePath,
    end_within_radius,
    FilletBlendPath,
    JointMovePath,
    LinearMovePath,
    start_within_radius,
)
from ur_cartesian_driver.sim.motion.paths.path_motion import (
    append_move_path,
    ProfileParameters,
    start_from_rest,
)

KINDS = ('movel', 'movel, turn leads', 'movec', 'movep', 'movej')


def forward(q):
    """Return the tool of an arm of no kind: it moves half a metre for each radian."""
    return Pose(tuple(0.5 * x for x in q[:3]))


def random_chain(rng):
    """Return the paths, parameters and radii of a chain, and which of them are movep."""
    n = int(rng.integers(2, 7))
    kinds = rng.choice(KINDS, n)
    # Blends of all sizes, up to such as touch.
    lengths = rng.uniform(0.02, 0.3, n)
    parts = rng.choice([0.0, 0.05, 0.3, 0.499], n, p=[0.2, 0.2, 0.3, 0.3])
    timed = rng.random() < 0.5
    chain, pose, direction = [], Pose(), rng.normal(size=3)
    path: Any
    for k in range(n):
        direction = np.cross(direction, rng.normal(size=3)) + rng.uniform(-1, 1) * direction
        direction /= np.linalg.norm(direction)
        start = pose
        turn = Pose.from_rotation_vector((0.0, 0.0, 0.0, *rng.normal(size=3) * 1e-3))
        if kinds[k] == 'movel, turn leads':
            turn = Pose.from_rotation_vector((0.0, 0.0, 0.0, *rng.uniform(0.4, 0.9, size=3)))
        end = np.array(start.position) + lengths[k] * direction
        pose = Pose(tuple(end.tolist()), (start @ turn).quaternion)
        v, a = rng.uniform(0.02, 0.4), rng.uniform(0.2, 2.0)
        time = lengths[k] * 1.3 / v + 0.2 if timed or rng.random() < 0.3 else 0.0
        radius = 0.0
        if k < n - 1:
            radius = float(parts[k] * min(lengths[k], lengths[k + 1]))
        parameters = ProfileParameters(acceleration=a, speed=v)
        match kinds[k]:
            case 'movel' | 'movel, turn leads':
                path = LinearMovePath(start, pose, 4.0)
                if time:
                    v, a = 1.5 * path.length / time, 4.5 * path.length / time**2
                parameters = ProfileParameters(acceleration=a, speed=v, time=time)
            case 'movec':
                middle = 0.5 * (np.array(start.position) + end)
                aside = np.cross(direction, rng.normal(size=3))
                via = tuple((middle + 0.3 * lengths[k] * aside).tolist())
                path = CircularMovePath(start, via, pose, bool(rng.integers(2)))
                pose = path.end
            case 'movep':
                path = LinearMovePath(start, pose)
                parameters = constant_speed_parameters(a, v, radius)
            case _:
                a6, b6 = (
                    vector6([2.0 * x for x in p.position] + 3 * [0.0]) for p in (start, pose)
                )
                path = JointMovePath(a6, b6, forward)
                parameters = ProfileParameters(acceleration=a, speed=3.0 * v, time=time)
                pose = forward(b6)
        chain.append((kinds[k], path, parameters, radius))
    return chain


def simulate(chain):
    """Return when the simulator passes each point, and the rates of its blends."""
    passed, rates, now = [], [], 0.0
    motion = None
    for k, (kind, path, parameters, radius) in enumerate(chain):
        if motion is None:
            motion = start_from_rest(path, parameters, radius, Move())
            rates.append((0.0, 0.0))
            blended = False
        else:
            circular = kind == chain[k - 1][0] == 'movep'
            motion, blended = append_move_path(motion, path, parameters, radius, Move(), circular)
        if not blended and k:
            passed.append(now)
            rates.append((0.0, 0.0))
            motion.index, motion.time = len(motion.sections) - 1, 0.0
        elif k:
            # The blend is the section before the last.
            profile = motion.sections[-2].profile
            rates.append((profile.speed(0.0), profile.speed(profile.duration)))
            passed.append(now + profile.time_at(0.5))
            now += profile.duration
            motion.index, motion.time = len(motion.sections) - 1, 0.0
        # The call of the next move comes where the blend begins, or at the end.
        section = motion.sections[-1]
        until = motion.last_move.entry if radius > 0.0 else section.profile.duration
        motion.time = until
        now += until
    return [*passed, now], rates


def moves_of(chain):
    """Return the columns of a chain, and where it is blended."""
    rows = []
    blends = [
        bool(
            radius > 0.0
            and end_within_radius(a[1], radius) is not None
            and start_within_radius(b[1], radius) is not None
        )
        for a, b in pairwise(chain)
        for radius in [a[3]]
    ]
    for k, (kind, path, parameters, radius) in enumerate(chain):
        before, after = k > 0 and blends[k - 1], k < len(blends) and blends[k]
        head = start_within_radius(path, chain[k - 1][3]) if before else 0.0
        tail = end_within_radius(path, radius) if after else 0.0
        entry, leave = 2.0 * tail, 2.0 * head
        for blend, part in ((before, 0), (after, 1)):
            i = k - 1 + part
            if blend and chain[i][0] == chain[i + 1][0] == 'movep':
                first, second = chain[i][1], chain[i + 1][1]
                fillet = FilletBlendPath(
                    first,
                    end_within_radius(first, chain[i][3]),
                    second,
                    start_within_radius(second, chain[i][3]),
                )
                entry, leave = (fillet.entry_rate, leave) if part else (entry, fillet.exit_rate)
        rows.append(
            (
                path.length,
                parameters.speed,
                parameters.acceleration,
                parameters.time,
                parameters.ramp_part(path.length),
                radius if kind == 'movep' and after else inf,
                head,
                tail,
                leave,
                entry,
                0.0,
                1.0,
            )
        )
    return Moves.of(rows), blends


@pytest.mark.parametrize('seed', range(4))
def test_points_are_passed_when_and_as_fast_as_the_controller_does(seed):
    rng, blended = np.random.default_rng(seed), 0
    for _ in range(40):
        chain = random_chain(rng)
        moves, blends = moves_of(chain)
        times = MoveChain(moves).times
        passed, rates = simulate(chain)
        kinds = [one[0] for one in chain]
        assert np.cumsum(times.durations) == pytest.approx(passed, abs=1e-3), kinds
        ours = np.stack((times.begin_rate, times.end_rate), axis=1)
        assert ours == pytest.approx(np.array(rates), rel=1e-3, abs=1e-6), kinds
        blended += sum(blends)
    assert blended > 60
