# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Moves that do not show a law leave it unidentified."""

from dataclasses import fields, replace
from random import Random

from hidden_arm import Laws, Program, speed_steps
import numpy as np
import pytest

from ur_cartesian_driver.identification.arm_samples import ArmSamples
from ur_cartesian_driver.identification.estimators import Unknown
from ur_cartesian_driver.identification.identify import identify
from ur_cartesian_driver.identification.profile import find_profile
from ur_cartesian_driver.motion.geometry.arrays import Floats
from ur_cartesian_driver.motion.state.rtde_state import RuntimeState, SafetyMode


@pytest.fixture
def laws():
    return replace(Laws.drawn(Random(3)), idle_between_moves=0.01, long_gaps=0.0)


def without(samples, gone):
    """Return a recording that lacks some packets, a mask (n,)."""
    columns = {each.name: getattr(samples, each.name) for each in fields(ArmSamples)}
    return ArmSamples(
        **{k: v[~gone] if isinstance(v, np.ndarray) else v for k, v in columns.items()}
    )


def test_a_move_that_is_left_out_is_no_idle_time(laws):
    """Packets of the middle one of three moves are missing: nothing follows its end."""
    program = Program(laws=laws, random=Random(3))
    for q in (0.9, 0.7, 0.1):
        program.movej([q, 0.0, 0.0, 0.0, 0.0, 0.0], a=3.0, v=1.0)
    samples = program.record('chain')
    found = identify([samples]).results['idle_between_moves']
    assert found.evidence == '2 pairs of moves in a row'
    after_first, middle = program.parts[1][0], 0.5 * (program.parts[1][0] + program.parts[1][1])
    begin = samples.time[0] + 0.4 + 0.5 * laws.start_time
    gone = np.abs(samples.time - begin - middle) < 0.06
    left = identify([without(samples, gone)])
    assert len(left.moves) == 2
    assert after_first < middle
    assert isinstance(left.results['idle_between_moves'], Unknown)


@pytest.mark.parametrize('turn', [0.3, 0.8])
def test_a_line_whose_turn_may_lead_shows_no_speed_of_lines(laws, turn):
    """Its way takes as long as its turn, so its speed is not that of the call."""
    laws = replace(laws, turn_ratio=1.2)
    axis = np.array([0.6, -0.3, 0.74])
    program = Program(laws=laws, random=Random(3))
    program.movel([0.2, 0.1, 0.0], turn * axis)
    results = identify([program.record('line')], program.commands).results
    for name in ('timed_linear_acceleration', 'timed_linear_speed'):
        assert isinstance(results[name], Unknown)
        assert '1 movel turned the tool' in results[name].reason
    program = Program(laws=laws, random=Random(3))
    program.movel([0.2, 0.1, 0.0], 0.2 * axis)
    results = identify([program.record('line')], program.commands).results
    low, high = results['timed_linear_speed'].interval
    assert low < laws.timed_linear_speed < high


def noise(generator: np.random.Generator, t: Floats) -> Floats:
    """Return the noise of a joint position [rad]."""
    return np.asarray(5e-8 * generator.standard_normal(len(t)), np.float64)


def test_begin_and_end_of_a_move_are_known_to_be_correlated():
    """A move that seems to begin late seems to end early, so gaps beside it err together."""
    generator = np.random.default_rng(1)
    t: Floats = np.arange(450) / 250.0
    travel: Floats = speed_steps(0.6, 2.0, 0.6).integral(t - 0.2013)
    follows = np.arange(len(t)) > 0
    found = [
        find_profile(t, travel + noise(generator, t), follows, may_start=False) for _ in range(100)
    ]
    sample = np.cov([(each.begin.value, each.end.value) for each in found], rowvar=False)
    assert sample[0, 1] < 0.0
    for expected, measured in (
        (sample[0, 0], [each.begin.error**2 for each in found]),
        (sample[1, 1], [each.end.error**2 for each in found]),
        (sample[0, 1], [each.begin_and_end for each in found]),
    ):
        assert np.mean(measured) == pytest.approx(expected, rel=0.4)


def test_an_estimate_at_the_bound_of_its_law_keeps_an_interval(laws):
    """No idle time, measured as a little less than none, is not known exactly."""
    laws = replace(laws, idle_between_moves=0.0)
    for seed in range(6):
        program = Program(laws=laws, random=Random(seed))
        for q in (0.9, 0.1):
            program.movej([q, 0.0, 0.0, 0.0, 0.0, 0.0], a=3.0, v=1.0)
        low, high = identify([program.record('chain')]).results['idle_between_moves'].interval
        assert low == 0.0 < high


def interrupted(laws, ending, **columns):
    """Return a recording of a joint move that something ends; columns replace its own."""
    program = Program(laws=laws, random=Random(3))
    program.movej([1.6, 0.3, 0.2, 0.0, 0.0, 0.0], a=3.0, v=0.5)
    samples = program.record('move', ending, 1.2)
    return replace(samples, **{name: make(samples) for name, make in columns.items()})


@pytest.mark.parametrize('mode', [SafetyMode.ROBOT_EMERGENCY_STOP, SafetyMode.SAFEGUARD_STOP, 21])
@pytest.mark.parametrize('ending', ['pause', 'stop', 'protective'])
def test_another_safety_stop_shows_no_law(laws, mode, ending):
    """Its ramp is neither that of a pause, nor of a stopped program, nor of a protective stop."""

    def safety(samples):
        playing = np.isin(samples.runtime_state, (RuntimeState.STOPPED, RuntimeState.PLAYING))
        stopped = ~playing if ending != 'stop' else samples.runtime_state == RuntimeState.STOPPING
        return np.where(stopped, float(mode), float(SafetyMode.NORMAL))

    results = identify([interrupted(laws, ending, safety_mode=safety)]).results
    for name in ('pause_time', 'stop_time', 'protective_stop_time'):
        assert isinstance(results[name], Unknown), name
        assert 'in motion' in results[name].reason


@pytest.mark.parametrize(
    ('ending', 'name'),
    [('pause', 'pause_time'), ('stop', 'stop_time'), ('protective', 'protective_stop_time')],
)
def test_a_stop_below_full_speed_is_left_out(laws, ending, name):
    found = identify([interrupted(laws, ending)]).results[name]
    assert found.interval[0] <= getattr(laws, name) <= found.interval[1]
    slowed = interrupted(laws, ending, slider=lambda samples: np.full(len(samples.time), 0.5))
    found = identify([slowed]).results[name]
    assert found.reason == '1 stop came while the speed slider was below 100 %'


def test_a_program_that_is_paused_between_two_moves_makes_two(laws):
    """The second one is no rest of the first, which came to its end."""
    program = Program(laws=laws, random=Random(3))
    program.movej([0.9, 0.0, 0.0, 0.0, 0.0, 0.0], a=3.0, v=1.0)
    program.wait(0.5)
    program.movej([0.1, 0.0, 0.0, 0.0, 0.0, 0.0], a=3.0, v=1.0)
    samples = program.record('moves')
    begin = samples.time[0] + 0.401 + 0.5 * laws.start_time
    (_, end, _), (start, _, _) = program.parts
    paused = (samples.time > begin + end + 0.1) & (samples.time < begin + start + 0.004)
    states = np.where(paused, float(RuntimeState.PAUSED), samples.runtime_state)
    found = identify([replace(samples, runtime_state=states)], program.commands)
    assert [move.piece.resumed for move in found.moves] == [False, False]


@pytest.mark.parametrize('name', ['speed_noise'])
def test_no_experiment_is_recommended_that_does_not_show_the_law(laws, name):
    found = identify([interrupted(laws, None)]).results[name]
    assert found.experiment == 'no experiment shows it yet'
