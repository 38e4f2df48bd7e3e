# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The experiments tell the laws apart by which a controller may move."""

from dataclasses import replace
import re

from checkout import CHECKOUT, needs_checkout
import numpy as np
import pytest

from ur_cartesian_driver.motion.plan.joint_spline import JointSpline
from ur_cartesian_driver.robot.check import experiments
from ur_cartesian_driver.robot.check.corner_experiment import corner_pieces, PIECE, PIECES, TURN
from ur_cartesian_driver.robot.check.experiments import (
    EXPERIMENTS,
    JOINT_ACCELERATION,
    JOINT_SPEED,
    program,
    return_program,
    TIMED_DISTANCE,
    TIMED_TIME,
    TOOL_ACCELERATION,
    TOOL_SPEED,
    TOOL_TURN,
    trapezoid_time,
    WRIST_TURN,
)
from ur_cartesian_driver.robot.check.finding import Verdict
from ur_cartesian_driver.robot.check.motion_samples import MotionSamples

CYCLE = 0.002
ANALYSES = {experiment.check: experiment.analyses[0] for experiment in EXPERIMENTS}
ANALYSES['steps_100'] = next(e for e in EXPERIMENTS if e.check == 'corner_100').analyses[1]


#: Columns that few analyses read.
UNUSED = ('target_distance', 'actual_distance', 'spline_time', 'pieces_begun', 'runtime_state')


def trapezoid(distance, speed, acceleration, stretched=1.0):
    """Return the positions of a motion from 0 to a distance, one a cycle."""
    time = trapezoid_time(distance, speed, acceleration)
    peak = min(speed, np.sqrt(distance * acceleration))
    ramp = peak / acceleration
    t = np.arange(0.0, stretched * time + CYCLE, CYCLE) / stretched
    t = np.minimum(t, time)
    rising = 0.5 * acceleration * np.minimum(t, ramp) ** 2
    cruising = peak * np.clip(t - ramp, 0.0, time - 2.0 * ramp)
    falling = np.maximum(t - (time - ramp), 0.0)
    return rising + cruising + peak * falling - 0.5 * acceleration * falling**2


def there_and_back(path):
    return np.concatenate([path, path[-2::-1]])


def samples(path, scaling=1.0, fraction=1.0, speed=None, stop_sent=float('nan')):
    """Return the samples of a motion of wrist 3, between two rests."""
    rest = int(0.3 / CYCLE)
    path = np.concatenate([np.full(rest, path[0]), path, np.full(rest, path[-1])])
    q = np.zeros((len(path), 6))
    q[:, 5] = path
    if speed is None:
        speed = np.abs(np.gradient(path, CYCLE))
    else:
        speed = np.concatenate([np.zeros(rest), speed, np.zeros(rest)])
    return MotionSamples(
        time=60.0 + CYCLE * np.arange(len(path), dtype=np.float64),
        target_q=q,
        actual_q=q,
        tool_speed=speed,
        scaling=np.full(len(path), scaling),
        fraction=np.full(len(path), fraction),
        stop_sent=stop_sent,
        **dict.fromkeys(UNUSED, np.full(len(path), np.nan)),
    )


@pytest.mark.parametrize(
    ('late', 'verdict'), [(0.0, Verdict.OK), (0.08, Verdict.OK), (0.3, Verdict.NOTE)]
)
def test_a_joint_move_shows_what_the_start_of_a_program_costs(late, verdict):
    path = there_and_back(trapezoid(WRIST_TURN, JOINT_SPEED, JOINT_ACCELERATION))
    creep = np.linspace(-1e-6, 0.0, max(1, round(late / CYCLE)))
    finding = ANALYSES['joint_move'](samples(np.concatenate([creep, path])))
    assert finding.verdict is verdict
    assert finding.data['duration'] - finding.data['trapezoids'] == pytest.approx(late, abs=0.01)


@pytest.mark.parametrize(
    ('factor', 'law'),
    [(4.0, 'turning runs with 4 v and 4 a'), (1.0, 'turning runs with v and a'), (2.0, '')],
)
def test_a_turn_shows_which_speed_counts_for_it(factor, law):
    path = trapezoid(TOOL_TURN, factor * TOOL_SPEED, factor * TOOL_ACCELERATION)
    finding = ANALYSES['turn'](samples(there_and_back(path)))
    assert finding.data['law'] == law
    assert (finding.verdict is Verdict.OK) == bool(law)


def test_a_timed_line_shows_a_stretched_trapezoid():
    stretch = TIMED_TIME / trapezoid_time(TIMED_DISTANCE, 0.25, 1.2)
    finding = ANALYSES['timed_line'](
        samples(trapezoid(TIMED_DISTANCE, 0.25, 1.2, stretched=stretch))
    )
    assert finding.data['law'] == 't stretches the trapezoid'
    assert finding.data['duration'] == pytest.approx(TIMED_TIME, abs=0.01)


def test_a_timed_line_shows_thirds():
    speed = 1.5 * TIMED_DISTANCE / TIMED_TIME
    finding = ANALYSES['timed_line'](
        samples(trapezoid(TIMED_DISTANCE, speed, 3.0 * speed / TIMED_TIME))
    )
    assert finding.data['law'] == 't makes thirds'


@pytest.mark.parametrize(
    ('scaling', 'law'),
    [(1.0, 'it does not contain the slider'), (0.5, 'it contains the slider'), (0.75, '')],
)
def test_the_slider_shows_what_speed_scaling_contains(scaling, law):
    path = trapezoid(WRIST_TURN, JOINT_SPEED, JOINT_ACCELERATION)
    finding = ANALYSES['slider'](samples(path, scaling=scaling, fraction=0.5))
    assert finding.data['law'] == law


def test_a_slider_that_the_robot_does_not_tell_is_no_law():
    path = trapezoid(WRIST_TURN, JOINT_SPEED, JOINT_ACCELERATION)
    finding = ANALYSES['slider'](samples(path, scaling=np.nan))
    assert finding.verdict is Verdict.NOTE


@pytest.mark.parametrize('ramp', [0.16, 0.05])
def test_a_stopped_program_shows_its_ramp(ramp):
    cruise, reaction = 0.5, 0.02
    speed = np.concatenate(
        [
            np.full(round((cruise + reaction) / CYCLE), TOOL_SPEED),
            np.linspace(TOOL_SPEED, 0.0, round(ramp / CYCLE) + 1),
        ]
    )
    path = np.cumsum(speed) * CYCLE
    finding = ANALYSES['program_stop'](samples(path, speed=speed, stop_sent=60.3 + cruise))
    assert finding.data['ramp'] == pytest.approx(ramp, abs=0.01)
    assert finding.data['reaction'] == pytest.approx(reaction, abs=0.015)
    assert finding.data['distance'] == pytest.approx(TOOL_SPEED * ramp / 2.0, abs=0.0005)


def test_a_program_that_has_ended_before_shows_nothing():
    finding = ANALYSES['program_stop'](samples(np.linspace(0.0, 0.1, 50), stop_sent=70.0))
    assert finding.verdict is Verdict.NOTE


@pytest.mark.parametrize('check', ['joint_move', 'turn', 'timed_line', 'slider'])
def test_an_arm_that_stands_shows_no_law(check):
    assert ANALYSES[check](samples(np.zeros(10))).verdict is Verdict.NOTE


def test_samples_are_lists_of_numbers():
    lists = samples(np.linspace(0.0, 0.1, 5)).as_lists()
    assert len(lists['time']) == len(lists['target_q']) == len(lists['scaling'])
    assert lists['target_q'][-1] == [0.0, 0.0, 0.0, 0.0, 0.0, 0.1]


def test_programs_are_indented_and_move_slowly():
    for text in (
        *(program(experiment.check, experiment.script).decode() for experiment in EXPERIMENTS),
        return_program((0.1, 0.2, 0.3, 0.0, 3.1, 0.0)).decode(),
    ):
        first, *body, last = text.splitlines()
        assert first.startswith('def ur_check_')
        assert last == 'end'
        assert all(line.startswith('  ') for line in body)
    assert experiments.JOINT_SPEED <= 0.2
    assert experiments.TOOL_SPEED <= 0.05


@needs_checkout
def test_programs_use_no_name_of_a_function_for_a_variable():
    page = CHECKOUT / 'doc' / 'script_functions.md'
    functions = set(re.findall(r'^\| `(\w+)\(', page.read_text('utf-8'), re.MULTILINE))
    assert {'size', 'norm', 'movej'} <= functions
    for experiment in EXPERIMENTS:
        assigned = set(re.findall(r'^\s*(\w+) = ', experiment.script, re.MULTILINE))
        assert not assigned & functions, experiment.check


def rests(*heights, off=0.0):
    """Return the samples of a tool that rests at some distances one after the other [mm]."""
    parts = []
    for before, height in zip((0.0, *heights), (*heights, heights[-1]), strict=True):
        parts += [np.full(int(0.4 / CYCLE), before), np.linspace(before, height, 50)]
    distance = 1e-3 * np.concatenate(parts)
    made = samples(distance)
    padded = 1e-3 * made.target_q[:, 5] * 1e3
    return replace(made, target_distance=padded, actual_distance=padded + off)


@pytest.mark.parametrize(
    ('made', 'missing'),
    [
        (rests(4.0, 8.0), []),
        (rests(8.0), ['it is applied at rest']),
        (rests(4.0, 8.0, 4.0), ['the arm stays there after path_offset_disable']),
        (rests(4.0, 8.0, off=0.004), ['the reported target contains it']),
        (
            rests(4.0),
            ['and in motion', 'the arm stays there after path_offset_disable'],
        ),
    ],
)
def test_a_path_offset_shows_where_and_how_long_it_is_applied(made, missing):
    finding = ANALYSES['path_offset'](made)
    assert finding.data['missing'] == missing
    assert finding.verdict is (Verdict.NOTE if missing else Verdict.OK)


def cornered(time, spline_time):
    """Return the samples of a program that reports its time in pieces of 20 ms."""
    n = len(time)
    return replace(
        samples(np.zeros(n - 2 * int(0.3 / CYCLE))),
        time=np.asarray(time),
        spline_time=np.asarray(spline_time),
        pieces_begun=np.floor(np.linspace(0.0, PIECES, n)),
    )


def test_cycles_without_a_step_are_counted_behind_the_first_piece_and_without_gaps_of_rtde():
    time = CYCLE * np.arange(900.0)
    made = 1.0 + CYCLE * np.arange(900.0)
    made[3:6] = made[3]  # the program learns the slider
    finding = ANALYSES['steps_100'](cornered(time, made))
    assert finding.data['confirmed']
    gap = np.delete(time, 500), np.delete(made, 500)
    assert ANALYSES['steps_100'](cornered(*gap)).data['missed'] == 0
    made[600:603] = made[600]
    finding = ANALYSES['steps_100'](cornered(time, made))
    assert finding.data['missed'] == 2
    assert finding.verdict is Verdict.NOTE


@pytest.mark.parametrize('check', ['corner_100', 'steps_100', 'corner_pause'])
def test_a_robot_without_the_registers_confirms_nothing(check):
    nothing = np.full(900, np.nan)
    made = replace(
        cornered(CYCLE * np.arange(900.0), nothing), runtime_state=nothing, pieces_begun=nothing
    )
    finding = ANALYSES[check](made)
    assert finding.verdict is Verdict.NOTE
    assert 'confirmed' not in finding.data


def test_the_corner_is_smooth_and_turns_two_wrists():
    start = (0.0, 0.1, 0.2, 0.3, 0.4, 0.5)
    pieces = corner_pieces(start)
    path = JointSpline.of(start, pieces)
    q, qd, qdd = path.rows(np.arange(0.0, PIECE * PIECES, 1e-3))
    assert len(pieces) == PIECES
    assert q[-1] - q[0] == pytest.approx([0.0] * 4 + [TURN] * 2, abs=1e-5)
    assert np.abs(np.diff(qdd, axis=0)).max() < 0.3
    assert np.linalg.norm(qd, axis=1).max() < 1.001 * JOINT_SPEED
