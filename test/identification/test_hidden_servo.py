# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The filters of servoj of hidden arms are within the intervals that their recordings lead to."""

from collections import Counter
from dataclasses import replace
from math import sqrt
from random import Random

from hidden_arm import Laws, Program
from hidden_servo import drawn_calls, drawn_motion, drawn_run, record_servo, ServoLaw
import numpy as np
import pytest
from random_cases import cases, random_of

from ur_cartesian_driver.identification.estimators import Unknown
from ur_cartesian_driver.identification.identify import identify
from ur_cartesian_driver.identification.least_squares import student

ARMS = 100
NAMES = ('servo_gain_factor', 'servo_lookahead_factor')
PLAYING, PAUSED = 2, 4


def results_of(motion, **columns):
    """Return what a motion shows of its filter; columns replace its own."""
    found = identify([replace(motion.samples, **columns)], [motion.command]).results
    return {name: found[name] for name in NAMES}


@pytest.mark.random
@pytest.mark.timeout(3600)
def test_intervals_contain_the_true_factors_and_are_hardly_wider_than_need_be():
    inside, widths, unknown = Counter(), [], 0
    arms = cases(ARMS)
    for i in range(arms):
        motion = drawn_motion(random_of('hidden servo', i))
        best = motion.best_errors()
        for name, found in results_of(motion).items():
            if isinstance(found, Unknown):
                unknown += 1
                continue
            low, high = found.interval
            inside[name] += low <= getattr(motion.law, name.removeprefix('servo_')) <= high
            widths.append((high - low) / (2.0 * student(1e3) * best[name]))
    assert unknown <= 0.05 * 2 * arms
    for name in NAMES:
        # 92 % inside, less four standard deviations of the count.
        assert inside[name] > 0.92 * arms - 4.0 * sqrt(0.07 * arms) - unknown, name
    assert np.median(widths) < 2.0


@pytest.mark.random
@pytest.mark.timeout(1200)
@pytest.mark.parametrize('kind', ['first order', 'third order', 'jump'])
def test_an_unknown_filter_is_said_and_not_fitted(kind):
    for i in range(cases(30)):
        for found in results_of(drawn_motion(random_of(kind, i), kind)).values():
            assert isinstance(found, Unknown)
            assert 'followed servoj by another law' in found.reason


def left_in_motion(random, deceleration):
    """Return a motion of servoj after which no further set-point comes."""
    start, cycle = np.zeros(6), random.choice([0.002, 0.002, 0.008])
    law = ServoLaw.drawn(random, cycle)
    return record_servo(law, random, drawn_run(random, start), start, cycle, deceleration)


@pytest.mark.random
@pytest.mark.timeout(1200)
def test_intervals_contain_the_deceleration_behind_the_last_set_point():
    inside = number = 0
    arms = cases(ARMS)
    for i in range(arms):
        random = random_of('left motion', i)
        true = random.uniform(4.0, 18.0)
        motion = left_in_motion(random, true)
        found = identify([motion.samples], [motion.command]).results['set_point_deceleration']
        if not isinstance(found, Unknown):
            number += 1
            inside += found.interval[0] <= true <= found.interval[1]
    assert number >= 0.9 * arms
    assert inside > 0.92 * number - 4.0 * sqrt(0.07 * number)


@pytest.fixture
def motion():
    """Return a motion of which the recording is as it should be."""
    random, start = Random(2), np.array([0.1, -1.2, 1.4, -1.6, -1.5, 0.2])
    law = ServoLaw(gain_factor=1.2, lookahead_factor=0.9, step=0.002)
    return record_servo(law, random, drawn_calls(random, start), start, 0.002)


def test_the_evidence_names_the_step_of_the_law(motion):
    found = results_of(motion)['servo_gain_factor']
    assert found.interval[0] < 1.2 < found.interval[1]
    assert found.evidence.endswith(' in 1 motion of servoj, by a law in steps of 2 ms')
    assert found.left_over.endswith(' urad rms')


def test_a_motion_that_does_not_show_the_filter_says_why(motion):
    samples = motion.samples
    half_way = samples.time[0] + 1.6
    states = np.where(np.abs(samples.time - half_way) < 0.02, PAUSED, PLAYING).astype(float)
    for columns, said in (
        ({'runtime_state': states}, 'a motion of servoj was interrupted'),
        ({'slider': np.full(len(samples.time), 0.5)}, 'speed slider was below 100 %'),
    ):
        for found in results_of(motion, **columns).values():
            assert said in found.reason
            assert found.experiment.startswith('record a joint that calls of servoj turn')
    gone = np.abs(samples.time - half_way) < 0.06
    columns = {
        name: getattr(samples, name)[~gone] for name in ('time', 'target_q', 'runtime_state')
    }
    for found in results_of(motion, **columns).values():
        assert found.reason == 'a motion of servoj lacks packets for more than 0.1 s'


def test_a_motion_without_its_calls_shows_no_filter(motion):
    found = identify([motion.samples]).results['servo_gain_factor']
    assert found.reason == 'no motion of servoj whose calls are known'


def test_a_motion_that_is_too_short_shows_no_filter():
    random, start = Random(3), np.zeros(6)
    law = ServoLaw(gain_factor=1.0, lookahead_factor=1.0)
    motion = record_servo(law, random, drawn_calls(random, start, angle=0.005), start, 0.002)
    found = results_of(motion)['servo_gain_factor']
    assert found.reason == '1 motion of servoj turned no joint by a degree'


def test_motions_of_servoj_do_not_make_the_moves_beside_them_doubtful(motion):
    laws = Laws.drawn(Random(4))
    program = Program(laws=laws, random=Random(4))
    program.movej([0.9, 0.2, 0.0, 0.0, 0.0, 0.1], a=1.0, v=0.5)
    recordings = [motion.samples, program.record('move')]
    found = identify(recordings, [motion.command, *program.commands])
    assert found.summary() == '2 moves: 1 joint move, 1 motion of servoj.'
    low, high = found.results['start_time'].interval
    assert low <= laws.start_time <= high


def test_calls_that_were_others_are_noticed(motion):
    """The gain that is named is right, but the way is not."""
    targets = np.array(motion.points.targets)
    targets[:, 5] += 1e-3 * np.sin(np.arange(len(targets)))
    points = replace(motion.points, targets=tuple(map(tuple, targets.tolist())))
    found = identify([motion.samples], [replace(motion.command, set_points=points)]).results
    assert 'another law' in found['servo_gain_factor'].reason
