# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Whatever a program calls, and whenever: the arm never jumps, and it comes to rest."""

from math import pi
from unittest import mock

from hypothesis import assume, example, given, HealthCheck, Phase, settings
from hypothesis import strategies as st
import numpy as np
import pytest

from ur_cartesian_driver.motion.geometry.pose import Pose
from ur_cartesian_driver.sim.motion import MotionError
from ur_cartesian_driver.sim.motion.cycle_batch import CycleBatch

CYCLE = 0.002

small = st.floats(-0.15, 0.15)
six = st.tuples(*[st.floats(-0.4, 0.4)] * 6)
rates = st.floats(0.1, 2.0)
radii = st.sampled_from([0.0, 0.001, 0.01, 0.05, 0.2])
times = st.sampled_from([0.0, 0.0, 0.05, 0.3, 1.0])


def near(g, way, f=1.0):
    """Return a pose off the present one by the way [m, rad]."""
    x, y, z = (a + f * b for a, b in zip(g.T_base_tcp.position, way, strict=False))
    turn = Pose.from_rotation_vector((0.0, 0.0, 0.0, *(f * w for w in way[3:])))
    return Pose((x, y, z), g.T_base_tcp.quaternion) @ turn


def joints(g, way):
    return tuple(a + b for a, b in zip(g.q, way, strict=True))


CALLS = {
    'movej': lambda g, w, a, v, t, r: g.movej(joints(g, w), a, v, t, r),
    'movel': lambda g, w, a, v, t, r: g.movel(near(g, w), a, v, t, r),
    'movep': lambda g, w, a, v, t, r: g.movep(near(g, w), a, v, r),
    'movec': lambda g, w, a, v, t, r: g.movec(
        near(g, (*w[1:3], w[0], *w[3:]), 0.5), near(g, w), a, v, r, int(t > 0.0)
    ),
    'optimovej': lambda g, w, a, v, t, r: g.optimovej(joints(g, w), a / 2.0, v / 2.0, r),
    'optimovel': lambda g, w, a, v, t, r: g.optimovel(near(g, w), a / 2.0, v / 2.0, r),
    'servoj': lambda g, w, a, v, t, r: g.servoj(joints(g, w), t),
    'speedj': lambda g, w, a, v, t, r: g.speedj(w, a, t or None),
    'speedl': lambda g, w, a, v, t, r: g.speedl(w, a, t or None),
    'stopj': lambda g, w, a, v, t, r: g.stopj(a),
    'stopl': lambda g, w, a, v, t, r: g.stopl(a),
    'set_tcp': lambda g, w, a, v, t, r: setattr(g, 'T_flange_tcp', Pose(w[:3])),
}
calls = st.tuples(
    st.sampled_from(sorted(CALLS)),
    six,
    rates,
    rates,
    times,
    radii,
    st.sampled_from([None, None, None, 0, 3, 150]),
    st.sampled_from([1.0, 1.0, 0.4]),
)


def run(r, program, longest=None):
    """
    Run the calls of a program one after the other, and stop.

    :param longest: cycles after which a move is interrupted; None = it has to end.
    """
    for name, way, a, v, t, radius, patience, scale in program:
        # Without patience the program waits for the return, else it is interrupted.
        try:
            move = CALLS[name](r.generator, way, a, v, t, radius)
        except MotionError:
            continue
        count = 0
        while move is not None and not move.returned and count not in (patience, longest):
            r.step(scale)
            count += 1
            if r.generator.fault is not None:
                r.generator.stop_at_once()
                r.generator.clear_fault()
                break
            assert count < 50_000
    if r.generator.moving:
        r.run(r.generator.stopj(2.0))
    r.step(times=2)


#: A stop in real time at a lowered slider, and a set-point that is stopped before its first cycle.
STOPPED_SET_POINT = [
    ('movej', (0.0, 0.0, 0.0, 0.0, 0.25, 0.0), 1.0, 1.0, 0.05, 0.001, None, 1.0),
    ('stopj', (0.0,) * 6, 1.0, 1.0, 0.0, 0.0, 3, 0.4),
    ('servoj', (0.0,) * 6, 1.0, 1.0, 0.0, 0.0, None, 1.0),
]


@pytest.mark.slow
@settings(max_examples=25, deadline=None)
@given(st.lists(calls, min_size=2, max_size=8))
@example(STOPPED_SET_POINT)
def test_arm_never_jumps_and_comes_to_rest(recorder, program):
    r = recorder()
    run(r, program)
    assert not r.generator.moving
    assert np.abs(r.speeds()).max() <= pi * (1.0 + 1e-5)


# The joints of a calibrated arm are found by iteration, to 3e-11 m.
@pytest.mark.slow
@pytest.mark.parametrize(('calibrated', 'bound'), [(False, 1e-9), (True, 1e-7)])
@settings(
    max_examples=12,
    deadline=None,
    suppress_health_check=[HealthCheck.too_slow],
    phases=[Phase.explicit, Phase.reuse, Phase.generate],
)
@given(program=st.lists(calls, min_size=1, max_size=4))
def test_cycles_solved_ahead_are_those_solved_one_by_one(recorder, calibrated, bound, program):
    ahead, single = recorder(calibrated=calibrated), recorder(calibrated=calibrated)
    # A slow move takes up to 50,000 cycles: minutes, one by one. Four seconds show as much: the
    # acceleration, the end of a batch, mostly the end of the move; the next call interrupts it.
    run(ahead, program, longest=2_000)
    with mock.patch.object(CycleBatch, 'next', return_value=None):
        run(single, program, longest=2_000)
    # Where a move takes a whole number of cycles, the iteration decides whether it takes one more.
    assert abs(len(ahead.q) - len(single.q)) <= int(calibrated)
    assume(len(ahead.q) == len(single.q))
    assert np.allclose(ahead.q, single.q, rtol=0.0, atol=bound)
    assert np.allclose(ahead.twists, single.twists, rtol=0.0, atol=1e3 * bound)
    for a, b in zip(ahead.poses, single.poses, strict=True):
        assert a.distance_to(b) < bound
        assert a.angle_to(b) < bound
