# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Recordings of real arms: what was fitted on one move predicts the others.

The recordings are not part of the project; without them these tests are skipped.
"""

from math import radians, sqrt
from pathlib import Path

import numpy as np
import pytest

from ur_cartesian_driver.identification.arm_samples import read_samples
from ur_cartesian_driver.identification.identify import identify
from ur_cartesian_driver.identification.moves import find_moves
from ur_cartesian_driver.identification.recorded_calls import MotionCommand
from ur_cartesian_driver.motion.twin.twin import Estimate

RECORDINGS = next(
    (
        path
        for parent in Path(__file__).resolve().parents
        if (path := parent / 'shared/data/recordings').is_dir()
    ),
    None,
)
pytestmark = pytest.mark.skipif(RECORDINGS is None, reason='the recordings are not here')

#: Time from packet to packet [s].
CYCLE = 0.008
#: Turning 90 degrees on the way of a movel, in the manufacturer's simulator.
TURN = 'robot_movej_90_45_135'


def recorded(name):
    return read_samples(RECORDINGS / f'{name}.csv.gz')


def move(name):
    (found,) = find_moves(recorded(name))
    return found


def predicted(times, length, a, v, start):
    """
    Return the way of a trapezoid that sets out within ``start`` [s], by its definition.

    In the n-th cycle of the start, the path runs at n times CYCLE / start of its speed.
    """
    v = min(v, sqrt(length * a))
    whole = length / v + v / a
    t = np.maximum(times, 0.0)
    n = np.minimum(t, start) / CYCLE
    p = np.where(t < start, 0.0, t - start) + n * (n + 1.0) / 2.0 * CYCLE**2 / start
    up, down = np.minimum(p, v / a), np.clip(p - (whole - v / a), 0.0, v / a)
    even = np.clip(p - v / a, 0.0, whole - 2.0 * v / a)
    return 0.5 * a * up**2 + v * even + v * down - 0.5 * a * down**2


def largest_error(name, a, v, start):
    """Return the largest error of a prediction [rad or m], with the onset of the recording."""
    found = move(name)
    way, (times, _) = found.leading - found.leading[0], found.rows
    length = float(way[-1])
    rows = times - found.profile.begin.value
    return float(np.abs(predicted(rows, length, a, v, start) - way).max())


@pytest.fixture(scope='module')
def start():
    """Return the start that the UR3's base shows in one move [s]."""
    found = identify([recorded('robot_movej_Trapez')]).results['start_time']
    assert isinstance(found, Estimate)
    return found.value


@pytest.mark.parametrize(
    'name',
    [
        'robot_movej_Trapez',
        'robot_movej_Trapez_Zeit',
        'robot_movej_Synchron',
        'robot_movel_x400',
        'robot_movel_x400_Zeit',
        'robot_movel_x400_Singular',
        'ursim_movel_x400',
        TURN,
    ],
)
def test_every_recorded_move_sets_out_within_160_ms(name):
    found = move(name).profile
    # Joint moves follow the law to the last digit.
    assert found.fit.rms < (1e-12 if 'movej_' in name and name != TURN else 6e-7)
    assert found.step == pytest.approx(CYCLE)
    assert abs(found.start.value - 0.16) < found.start.half_width < 2e-4


def test_the_start_of_a_joint_move_predicts_lines(start):
    assert largest_error('robot_movel_x400', 1.0, 0.2, start) < 1e-5
    assert largest_error('robot_movel_x400_Singular', 1.0, 0.2, start) < 1e-5
    assert largest_error('ursim_movel_x400', 1.0, 1.0, start) < 1e-5


def test_one_timed_move_predicts_another(start):
    """Of three joints, by v^2/a of one joint's move: 45 degrees, as of 60 and 80 degrees."""
    quotient = move('robot_movej_Trapez_Zeit').profile.speed_squared_by_acceleration
    assert quotient.value == pytest.approx(radians(45.0), abs=1e-9)
    length = float(np.ptp(move('robot_movej_Synchron').leading))
    # v from T = L/v + v/a and the quotient.
    v = (length + quotient.value) / 6.0
    a = v**2 / quotient.value
    assert largest_error('robot_movej_Synchron', a, v, start) < 1e-9


def test_the_turn_leads_by_the_ratio_of_the_simulator():
    command = MotionCommand(name='movel', a=1.0, v=0.8)
    found = identify([recorded(TURN)], [command]).results['turn_ratio']
    assert isinstance(found, Estimate)
    assert found.value == pytest.approx(4.0, abs=1e-3)


def test_a_timed_move_shows_no_speed_of_its_own():
    command = MotionCommand(name='movej', t=6.0)
    found = identify([recorded('robot_movej_Trapez_Zeit')], [command]).results
    assert '1 movej with t show only v^2/a, 0.7854 +-' in str(found['timed_joint_speed'])


def test_a_recording_without_targets_is_refused():
    with pytest.raises(ValueError, match='has no column timestamp'):
        recorded('ur5e_by_hand_line')
