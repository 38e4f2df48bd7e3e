# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Motion version 2: what the script manual says of it, by geometry and formulas written here.

Speeds and accelerations are clamped, radii are reduced instead of waypoints skipped, ramps and
blends may differ a little, and the path of a single move does not.
"""

from itertools import pairwise
from math import pi, sqrt

import numpy as np
import pytest

from ur_cartesian_driver.motion.geometry.pose import Pose
from ur_cartesian_driver.sim.controller_assembly import assemble
from ur_cartesian_driver.sim.motion.paths.second_motion_version import SecondMotionVersion
from ur_cartesian_driver.sim.simulator_config import SimulatorConfig

CYCLE = 0.002
#: Largest joint speed of a UR5e, from its data sheet [rad/s].
JOINT_SPEED = pi


@pytest.fixture
def second(recorder):
    """Return a recorder of moves by motion version 2, with its figures."""

    def make(**figures):
        r = recorder()
        r.generator.motion_version = 2
        r.generator.second_version = SecondMotionVersion(**figures)
        return r

    return make


def zigzag(start, legs):
    """Return the corners (n, 3) of a path in x and z whose legs turn by a right angle each."""
    corners = [np.array(start.position)]
    for i, leg in enumerate(legs):
        corners.append(corners[-1] + leg * np.array((0.0, 0.0, 1.0) if i % 2 else (1.0, 0.0, 0.0)))
    return np.array(corners)


def run_zigzag(r, legs, radius, v=0.1):
    """Run a zigzag; return its corners, and how far each of the recorded points is from it."""
    start = r.generator.T_base_tcp
    corners = zigzag(start, legs)
    for i, corner in enumerate(corners[1:]):
        last = i + 1 == len(legs)
        pose = Pose(tuple(corner), start.quaternion)
        r.run(r.generator.movel(pose, v=v, r=0.0 if last else radius))
    r.rest()
    points, off = r.positions, np.full(len(r.positions), np.inf)
    for a, b in pairwise(corners):
        share = np.clip((points - a) @ (b - a) / ((b - a) @ (b - a)), 0.0, 1.0)
        off = np.minimum(off, np.linalg.norm(points - a - np.outer(share, b - a), axis=1))
    return corners, off


@pytest.mark.parametrize('legs', [(0.03, 0.03, 0.03, 0.03), (0.05, 0.01, 0.04), (0.04, 0.004)])
def test_blends_that_would_overlap_are_reduced_and_no_waypoint_is_skipped(second, legs):
    r = second()
    corners, off = run_zigzag(r, legs, 0.02)
    assert r.generator.warnings == []
    np.testing.assert_allclose(r.positions[-1], corners[-1], atol=1e-9)
    for before, corner, after in zip(corners, corners[1:], corners[2:], strict=False):
        # A parabola within r of a right corner passes it at r / sqrt(8); r is below either leg.
        nearest = np.linalg.norm(r.positions - corner, axis=1).min()
        leg = min(np.linalg.norm(corner - before), np.linalg.norm(after - corner))
        assert nearest <= leg / sqrt(8.0) + 1e-4
    # Both legs' shares of a blend, each within a, and a change of the rate by half of that.
    accelerations = np.linalg.norm(np.diff(r.tool_speeds(), axis=0), axis=1) / CYCLE
    assert accelerations.max() <= 3.0 * 1.2
    # What is left of the middle of the legs belongs to no blend: the radii fit.
    assert off.max() <= 0.02 / sqrt(8.0) + 1e-9


def test_the_same_radii_skip_a_waypoint_in_version_1(recorder):
    r = recorder()
    run_zigzag(r, (0.03, 0.03, 0.03, 0.03), 0.02)
    assert {warning.code for warning in r.generator.warnings} == {171}


def test_radii_that_fit_are_as_asked(second):
    r = second(blend_fraction=1.0)
    run_zigzag(r, (0.05, 0.05, 0.05), 0.02)
    corner = zigzag(Pose(r.poses[0].position, r.poses[0].quaternion), (0.05,))[1]
    nearest = np.linalg.norm(r.positions - corner, axis=1).min()
    assert nearest == pytest.approx(0.02 / sqrt(8.0), abs=1e-4)


@pytest.mark.parametrize('rise', [0.0, 0.02, 0.1])
def test_a_single_line_takes_a_little_longer_and_stays_straight(second, shifted, rise):
    r = second(ramp_rise=rise)
    start, d, a, v = r.generator.T_base_tcp, 0.1, 0.5, 0.1
    cycles = r.run(r.generator.movel(shifted(start, d, 0.0, 0.0), a=a, v=v))
    # A ramp whose acceleration rises and falls for a time each takes so much longer.
    assert cycles * CYCLE == pytest.approx(d / v + v / a + rise, abs=CYCLE)
    aside = r.positions[:, 1:] - np.array(start.position)[1:]
    assert np.abs(aside).max() < 1e-9
    assert np.diff(r.positions[:, 0], 2).max() <= a * CYCLE**2 * (1.0 + 1e-6)


def test_a_time_is_kept(second, shifted):
    r = second()
    cycles = r.run(r.generator.movel(shifted(r.generator.T_base_tcp, 0.1, 0.0, 0.0), t=1.5))
    assert cycles * CYCLE == pytest.approx(1.5, abs=CYCLE)


def test_a_speed_that_the_joints_do_not_have_is_clamped_before_the_motion(second, recorder):
    rates = {}
    for version, r in ((1, recorder()), (2, second(ramp_rise=0.0))):
        q, d, a = r.generator.q, 2.0, 20.0
        move = r.generator.movej((q[0] + d, *q[1:]), a=a, v=10.0)
        scaling = []
        while not move.returned:
            r.step()
            scaling.append(r.generator.scaling)
        rates[version] = min(scaling)
        assert np.abs(r.speeds()).max() <= JOINT_SPEED * (1.0 + 1e-6)
        if version == 2:
            expected = d / JOINT_SPEED + JOINT_SPEED / a
            assert len(scaling) * CYCLE == pytest.approx(expected, abs=0.1 + CYCLE)
    # Version 1 slows the time of the motion, and says so; version 2 has planned it.
    assert rates[1] < 0.5
    assert rates[2] == pytest.approx(1.0)


def test_a_time_that_the_joints_cannot_keep_becomes_longer(second):
    r = second()
    q = r.generator.q
    cycles = r.run(r.generator.movej((q[0] + 2.0, *q[1:]), t=0.1))
    assert cycles * CYCLE > 2.0 / JOINT_SPEED
    assert np.abs(r.speeds()).max() <= JOINT_SPEED * (1.0 + 1e-6)


def test_other_moves_do_not_depend_on_the_version(second, recorder, shifted):
    paths = []
    for r in (recorder(), second()):
        start = r.generator.T_base_tcp
        r.run(r.generator.movep(shifted(start, 0.05, 0.0, 0.0), r=0.02))
        r.run(r.generator.movep(shifted(start, 0.05, 0.05, 0.0)))
        r.run(r.generator.optimovel(start))
        paths.append(r.positions)
    np.testing.assert_array_equal(*paths)


@pytest.mark.parametrize('field', ['ramp_rise', 'blend_fraction', 'blend_share'])
@pytest.mark.parametrize('value', [-0.1, 1.1])
def test_figures_out_of_range_are_refused(field, value):
    with pytest.raises(ValueError, match=f'{field} is {value}; use '):
        SecondMotionVersion(**{field: value})


@pytest.mark.parametrize('start', [1, 2])
def test_the_version_outlives_programs_until_one_is_started_from_the_pendant(start):
    read = 'def read():\n  textmsg("version ", motion_version_get())\nend\n'
    config = SimulatorConfig(polyscope='5.22', motion_version=start, programs={'read': read})
    controller, _ = assemble(config)

    def run():
        for _ in range(5):
            controller.step()

    controller.programs.submit(read)
    run()
    controller.programs.submit(f'def change():\n  motion_version_set({3 - start})\nend\n')
    run()
    controller.power.off()
    controller.power.release_brakes(controller.time)
    for _ in range(1000):
        controller.step()
    controller.programs.submit(read)
    run()
    assert not controller.load_program('read')
    assert not controller.programs.play()
    run()
    texts = [line for line in controller.messages.log if line.startswith('version')]
    assert texts == [f'version {start}', f'version {3 - start}', f'version {start}']


def test_software_before_5_22_has_no_version_2():
    with pytest.raises(
        ValueError, match=r'motion_version is 2, but polyscope is 5\.21; use 5\.22'
    ):
        SimulatorConfig(motion_version=2)
