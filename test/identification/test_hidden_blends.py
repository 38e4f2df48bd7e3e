# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The laws of hidden blends are within the intervals that their recordings lead to."""

from dataclasses import replace
from random import Random

from blended_arm import (
    best_errors,
    BlendLaws,
    Chain,
    drawn_arm,
    Noise,
    recorded,
    UNKNOWN_SHAPES,
)
import numpy as np
import pytest
from random_cases import cases, random_of

from ur_cartesian_driver.identification.estimators import Unknown
from ur_cartesian_driver.identification.identify import identify
from ur_cartesian_driver.identification.recorded_calls import MotionCommand

ARMS = 100
NAMES = ('blend_begin', 'blend_speed_ratio')


@pytest.fixture(scope='module')
def identified():
    """Return true laws, results, and the least errors, of hidden arms."""
    found = []
    for i in range(cases(ARMS)):
        laws, recordings, calls, chains, noise = drawn_arm(random_of('hidden blend', i))
        results = identify(recordings, calls).results
        found.append(((laws.begin, laws.ratio), results, best_errors(chains, laws, noise)))
    return found


@pytest.mark.random
@pytest.mark.timeout(3600)
def test_intervals_contain_the_true_laws_of_blends(identified):
    for i, name in enumerate(NAMES):
        known = [each for each in identified if not isinstance(each[1][name], Unknown)]
        assert len(known) >= 0.95 * len(identified)
        inside, widths = 0, []
        for true, results, errors in known:
            low, high = results[name].interval
            inside += low <= true[i] <= high
            widths.append((high - low) / (2.0 * 1.96 * errors[i]))
        # 92 % inside, less four standard deviations of the count.
        least = 0.92 * len(known) - 4.0 * (0.07 * len(known)) ** 0.5
        assert inside > least, f'{name}: {inside} of {len(known)}'
        assert np.median(widths) < 2.0, name
    assert all(results['blend_shape'].value == 'parabola' for _, results, _ in identified)


@pytest.mark.random
@pytest.mark.timeout(1200)
@pytest.mark.parametrize('shape', UNKNOWN_SHAPES)
def test_an_unknown_curve_is_said_and_not_fitted(shape):
    for i in range(cases(20)):
        _, recordings, calls, _, _ = drawn_arm(random_of('unknown blend', shape, i), shape)
        results = identify(recordings, calls).results
        assert results['blend_shape'].value == 'unknown'
        for name in NAMES:
            assert 'followed no parabola' in results[name].reason


@pytest.mark.random
@pytest.mark.timeout(1200)
def test_a_rate_without_a_known_law_is_said_and_its_curve_is_found():
    for i in range(cases(20)):
        random = random_of('waved blend', i)
        laws, recordings, calls, _, _ = drawn_arm(random, wave=0.3)
        results = identify(recordings, calls).results
        assert results['blend_shape'].value == 'parabola'
        low, high = results['blend_begin'].interval
        assert low - 1e-4 < laws.begin < high + 1e-4
        assert 'rate follows no law that is known' in results['blend_speed_ratio'].reason
        assert results['blend_speed_ratio'].experiment.startswith('their law is not known')


LAWS = BlendLaws(begin=0.8, ratio=1.2, start_time=0.16)
QUIET = Noise(size=1e-8, correlation=0.0, gaps=0.0, cycle=0.002)


def corner(angle, length=0.1, radius=0.02, seconds=0.4):
    """Return two lines that meet at an angle [degrees], and their calls."""
    turn = np.radians(angle)
    points = np.zeros((3, 6))
    points[1, 0] = length
    points[2, :2] = length * (1.0 + np.cos(turn)), length * np.sin(turn)
    chain = Chain(
        of_lines=True,
        points=points,
        radii=np.array([radius]),
        speeds=np.full(2, 2.0 * LAWS.begin * radius / seconds),
        exits=np.array([1.0 / seconds]),
        acceleration=2.0,
    )
    return chain, chain.calls()


def reason(chain, calls, noise=QUIET):
    results = identify([recorded('corner', chain, LAWS, noise, Random(3))], calls).results
    assert {type(results[name]) for name in (*NAMES, 'blend_shape')} == {Unknown}
    assert 'record three movel' in results['blend_begin'].experiment
    return results['blend_begin'].reason


def test_a_flat_corner_does_not_tell_one_curve_from_another():
    assert 'its corner of 4 degrees does not tell' in reason(*corner(4.0))


@pytest.mark.parametrize('radius', [0.002, 0.005, 0.02])
def test_an_arc_is_no_parabola_however_flat_the_corner(radius):
    laws = replace(LAWS, shape='arc')
    shapes = []
    for angle in (11.0, 13.0, 16.0, 20.0, 26.0, 40.0):
        chain, calls = corner(angle, radius=radius)
        found = identify([recorded('corner', chain, laws, QUIET, Random(3))], calls)
        shape = found.results['blend_shape']
        if isinstance(shape, Unknown):
            assert 'does not tell a parabola from an arc' in shape.reason
        shapes.append('' if isinstance(shape, Unknown) else shape.value)
    assert set(shapes) == {'', 'unknown'}
    assert shapes[-1] == 'unknown'


def test_blends_that_fill_a_move_leave_no_straight_stretch():
    points = np.zeros((4, 6))
    points[1:, 0] = 0.1, 0.1, 0.2
    points[2:, 1] = 0.0341
    chain = Chain(
        of_lines=True,
        points=points,
        radii=np.array([0.02, 0.02]),
        speeds=np.full(3, 0.08),
        exits=np.full(2, 2.5),
        acceleration=2.0,
    )
    assert 'it has 3 calls, and straight stretches: 2;' in reason(chain, chain.calls())


def test_a_blend_of_a_few_packets_is_too_short():
    chain, calls = corner(90.0, radius=0.005, seconds=0.08)
    assert 'it was passed in 9 packets, 12 are needed' in reason(
        chain, calls, replace(QUIET, cycle=0.008)
    )


def test_a_slow_blend_before_a_fast_line_is_no_stop():
    """At 125 Hz the arm gets faster in a packet than it was in the blend."""
    chain, calls = corner(140.0, length=0.2, seconds=0.8)
    chain = replace(chain, speeds=np.array([0.02, 0.2]), acceleration=4.0)
    laws, noise = replace(LAWS, shape='arc'), replace(QUIET, cycle=0.008)
    found = identify([recorded('corner', chain, laws, noise, Random(3))], calls)
    assert len(found.moves) == 1
    assert found.results['blend_shape'].value == 'unknown'


def test_a_line_and_a_joint_move_are_not_evaluated():
    chain, calls = corner(90.0)
    calls[1] = replace(calls[1], name='movej')
    assert 'it joins a line to a joint move' in reason(chain, calls)


def test_calls_without_a_radius_show_no_blend():
    chain, _ = corner(90.0)
    call = MotionCommand(name='movel', a=1.0, v=1.0)
    assert reason(chain, [call]) == 'no moves joined by a blend, with calls that are known'


@pytest.mark.parametrize('radii', [(0.02, None), (0.02, 0.02)])
def test_a_radius_at_the_end_of_a_program_joins_nothing(radii):
    """The last call of a recording belongs to its own moves, also if it has a radius."""
    chain, calls = corner(90.0)
    calls = [replace(call, r=r) for call, r in zip(calls, radii, strict=True)]
    results = identify([recorded('corner', chain, LAWS, QUIET, Random(3))], calls).results
    low, high = results['blend_begin'].interval
    assert low < LAWS.begin < high


def test_the_end_of_a_blend_elsewhere_than_its_begin_is_said(monkeypatch):
    chain, calls = corner(90.0)
    reach = Chain._reach
    monkeypatch.setattr(
        Chain,
        '_reach',
        lambda self, point, direction, distance: reach(
            self, point, direction, distance * (0.9 if direction[1] > 0.5 else 1.0)
        ),
    )
    results = identify([recorded('corner', chain, LAWS, QUIET, Random(3))], calls).results
    assert 'it begins 16 mm before its corner, and ends 14.4 mm' in results['blend_begin'].reason
