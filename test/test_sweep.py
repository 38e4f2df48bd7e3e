# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Sweeps: the variants, a verdict for each of them, and the printed output."""

from concurrent.futures import Executor, Future, ThreadPoolExecutor
import csv
from dataclasses import replace
from math import nan, pi
import os

import numpy as np
import pytest

from ur_cartesian_driver.cli import main
from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.kinematics.robot_models import robot_model
from ur_cartesian_driver.motion.errors import ErrorCode
from ur_cartesian_driver.path import DOWN, Path
from ur_cartesian_driver.planning import PlanningOptions
from ur_cartesian_driver.sweep import (
    at_places,
    calibrated,
    draw,
    heat_map,
    on_models,
    plan_variant,
    summary,
    sweep,
    table,
    Variant,
)

LINE = Path((-0.4919, -0.1333, 0.4879), DOWN).at(speed=0.1).by(dy=0.1)
VARIANT = Variant(goal=LINE)


class Inline(Executor):
    """Runs everything at once, in this process."""

    def submit(self, function, /, *values, **named):
        future = Future()
        try:
            future.set_result(function(*values, **named))
        except Exception as error:
            future.set_exception(error)
        return future


class Unpicklable(Path):
    """A path that ends the process which receives it."""

    def __reduce__(self):
        return os._exit, (3,)


def test_each_variant_gets_its_verdict_in_order():
    variants = at_places(VARIANT, x=(0.0, -0.4), y=(0.0, 0.1))
    assert [dict(v.coordinates) for v in variants][1] == {'x': 0.0, 'y': 0.1}
    done = []
    results = sweep(variants, Inline(), lambda: done.append(1))
    assert [r.passes for r in results] == [True, True, False, False]
    assert len(done) == 4
    assert results[2].code is ErrorCode.UNREACHABLE
    assert 'cannot be reached' in results[2].refusal
    assert results[0].duration == pytest.approx(1.2, abs=0.1)


def test_offsets_of_offsets_add_up_and_so_do_their_coordinates():
    """The coordinate of a place is its distance from the place of the first variant."""
    twice = at_places(at_places(VARIANT, x=(0.0, 0.1), rz=(0.2,)), x=(0.01, 0.02), y=(0.3,))
    assert [v.offset for v in twice] == [
        pytest.approx((x, 0.3, 0.0, 0.2)) for x in (0.01, 0.02, 0.11, 0.12)
    ]
    assert [v.coordinates['x'] for v in twice] == [v.offset[0] for v in twice]
    moved = at_places(at_places(VARIANT, x=(0.0, 0.1)), x=(0.05,))
    assert [v.coordinates['x'] for v in moved] == pytest.approx([0.05, 0.15])
    across = at_places(at_places(VARIANT, x=(0.0, 0.1)), y=(0.0, 0.2))
    assert (
        [(v.offset[0], v.offset[1]) for v in across]
        == [(v.coordinates['x'], v.coordinates['y']) for v in across]
        == [(0.0, 0.0), (0.0, 0.2), (0.1, 0.0), (0.1, 0.2)]
    )


def test_a_model_without_calibration_has_no_coordinate_of_one():
    """A new model replaces the calibrated arm, so the seed of the calibration means nothing."""
    (seeded,) = calibrated(at_places(VARIANT, x=(0.0, 0.1))[1], 1, seed=7)
    assert seeded.coordinates == {'x': 0.1, 'calibration': 7.0}
    (other,) = on_models(seeded, ['ur10e'])
    assert not other.arm.calibrated
    assert other.coordinates == {'x': 0.1, 'model': 'ur10e'}
    (again,) = calibrated(other, 1, seed=3)
    assert again.coordinates == {'x': 0.1, 'model': 'ur10e', 'calibration': 3.0}


def test_the_margins_are_those_of_the_configurations_on_the_way():
    (result,) = sweep([LINE], Inline())
    arm, found = Arm(robot_model('ur5e')), result.margins
    ends = [arm.forward(VARIANT.start)]
    assert ends[0].distance_to(LINE.start) < 0.01
    # No joint of the home position is nearer to its limit of a turn than the elbow or the lift.
    assert found.joint_limit == pytest.approx(2.0 * pi - np.abs(VARIANT.start).max(), abs=0.3)
    assert 0.0 < found.singularity < pi / 2.0
    assert 0.5 < found.speed < 1.0
    assert found.clearance > 0.005
    hurried = replace(VARIANT, goal=LINE.then(Path(LINE.end).line((-0.35, 0.0, 0.45), speed=0.25)))
    assert plan_variant(hurried).margins.speed < found.speed


def test_an_offset_moves_the_frame_along_the_base_and_turns_it_there():
    turn = pi / 2.0
    turned = replace(VARIANT, offset=(0.0, 0.0, 0.0, turn))
    first, a, b, c, d, e = VARIANT.start
    turned = replace(turned, start=(first + turn, a, b, c, d, e))
    # About the base, all joints but the first stay.
    assert plan_variant(turned).margins.singularity == pytest.approx(
        plan_variant(VARIANT).margins.singularity, abs=2e-3
    )
    higher = plan_variant(replace(VARIANT, offset=(0.0, 0.0, 0.05, 0.0)))
    same = plan_variant(replace(VARIANT, goal=LINE.offset(dz=0.05)))
    assert higher.margins == same.margins


def test_random_calibrations_are_those_of_their_seed():
    first, again, other = (
        sweep(calibrated(VARIANT, 2, seed=seed), Inline()) for seed in (5, 5, 6)
    )
    assert [r.margins for r in first] == [r.margins for r in again]
    assert first[1].margins == other[0].margins != other[1].margins
    assert first[0].variant.arm.calibrated


@pytest.mark.slow
def test_a_variant_that_fails_or_ends_its_process_loses_no_other():
    bad = replace(VARIANT, options=None)
    deadly = replace(VARIANT, goal=Unpicklable(LINE.start))
    results = sweep([VARIANT, deadly, bad, VARIANT])
    assert [r.passes for r in results] == [True, False, False, True]
    assert 'BrokenProcessPool' in results[1].refusal
    assert 'planning failed: AttributeError' in results[2].refusal
    assert results[2].code is None
    with ThreadPoolExecutor(1) as pool:
        assert [r.passes for r in sweep([bad, VARIANT], pool)] == [False, True]


def test_the_map_shows_the_worst_of_each_cell():
    variants = on_models(at_places(VARIANT, x=(0.0, 0.02, -0.4)), ['ur5e', 'ur10e'])
    results = sweep(variants, Inline())
    lines = heat_map(results).splitlines()
    assert lines[1].split() == ['x', '/', 'model', '-0.4', '0', '0.02']
    of_ur5e = [r.margins.singularity for r in results[0::2]]
    assert lines[3].split() == ['ur5e', 'x', f'{of_ur5e[0]:.4g}', f'{of_ur5e[1]:.4g}']
    assert [line.split()[-1] for line in table(results).splitlines()[1:]].count('passes') == sum(
        r.passes for r in results
    )
    assert summary(results).startswith(f'{sum(r.passes for r in results)} of 6 variants pass; ')
    assert heat_map(results[:1], 'clearance').splitlines()[0] == 'clearance [m]:'
    assert heat_map(sweep([LINE], Inline())) == ''


@pytest.mark.slow
def test_a_picture_of_all_margins(tmp_path):
    pytest.importorskip('matplotlib')
    draw(sweep(at_places(VARIANT, x=(0.0, -0.5), y=(0.0, 0.1)), Inline()), tmp_path / 'a.png')
    assert (tmp_path / 'a.png').read_bytes().startswith(b'\x89PNG')


@pytest.mark.slow
def test_the_command_writes_a_table_and_a_map(tmp_path, capsys):
    file = tmp_path / 'line.yaml'
    LINE.save(file)
    rows = tmp_path / 'a.csv'
    options = ['--x', '-0.5,0,2', '--monte-carlo', '2', '--processes', '1', '-o', str(rows)]
    assert main(['sweep', str(file), *options]) == 1
    shown = capsys.readouterr()
    assert '2 of 4 variants pass' in shown.out
    with open(rows, encoding='utf-8', newline='') as table_file:
        found = list(csv.DictReader(table_file))
    assert [row['x'] for row in found] == ['-0.5', '-0.5', '0.0', '0.0']
    assert [row['result'] == 'passes' for row in found] == [False, False, True, True]
    assert '%|' not in shown.err  # no bar without a terminal


def test_the_command_refuses_what_is_too_much_or_contradicts(capsys):
    with pytest.raises(SystemExit):
        main(['sweep', 'square', '--x', '1,2'])
    assert main(['sweep', 'square', '--x', '0,1,1000', '--y', '0,1,1000']) == 1
    assert '1000000 variants' in capsys.readouterr().err
    assert main(['sweep', 'square', '--monte-carlo', '2', '--calibration-seed', '1']) == 1
    assert 'draws calibrations of its own' in capsys.readouterr().err
    assert PlanningOptions() == VARIANT.options


def test_the_map_is_of_what_a_user_can_choose_and_of_what_all_variants_share():
    """Calibrations are no axis beside places, and variants need not have the same coordinates."""
    places = at_places(VARIANT, x=(0.0, 0.02), y=(0.0, 0.01))
    results = sweep([each for place in places for each in calibrated(place, 3)], Inline())
    assert heat_map(results).splitlines()[1].split() == ['x', '/', 'y', '0', '0.02']
    mixed = sweep([VARIANT, *at_places(VARIANT, x=(0.0, 0.02))], Inline())
    assert heat_map(mixed).splitlines()[1].split() == ['x', '0', '0.02']


def test_the_smallest_margin_is_one_that_is_known():
    first, second = sweep([VARIANT, VARIANT], Inline())
    unknown = replace(first, margins=replace(first.margins, clearance=nan))
    for results in ([unknown, second], [second, unknown]):
        assert summary(results) == summary([second, second])
