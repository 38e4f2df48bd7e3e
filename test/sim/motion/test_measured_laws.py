# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The simulated controller moves by the laws of a twin; the judges are closed formulas."""

from __future__ import annotations

from dataclasses import replace
from math import sqrt
from typing import Any

import numpy as np
import pytest

from ur_cartesian_driver.motion.geometry.pose import Pose
from ur_cartesian_driver.motion.twin.laws import ArmFigures, LAWS, MotionLaws
from ur_cartesian_driver.motion.twin.twin import ArmIdentity, Estimate, Twin
from ur_cartesian_driver.sim import assemble, SimulatorConfig
from ur_cartesian_driver.sim.motion.paths.motion_profile import two_ramps
from ur_cartesian_driver.sim.state.power_and_safety import SafetyEvent

CYCLE = 0.002
A, V = 1.2, 0.1


def shifted(pose, x=0.0, y=0.0):
    px, py, pz = pose.position
    return Pose((px + x, py + y, pz), pose.quaternion)


def twin_of(**values):
    """Return a twin of a UR5e with these laws."""
    return Twin(
        arm=ArmIdentity(model='ur5e'),
        date='2026-11-27',
        estimates={
            name: Estimate(
                value=value, interval=None if isinstance(value, str) else (value, value)
            )
            for name, value in values.items()
        },
    )


@pytest.mark.parametrize('start_time', [0.0, 0.1, 0.3])
def test_the_first_path_of_a_program_loses_half_of_the_start_time(recorder, start_time):
    made = recorder(laws=MotionLaws(start_time=start_time))
    made.generator.begin_program()
    first = made.run(made.generator.movel(shifted(made.generator.T_base_tcp, y=0.1), A, V))
    second = made.run(made.generator.movel(shifted(made.generator.T_base_tcp, y=-0.1), A, V))
    nominal = 0.1 / V + V / A
    assert first * CYCLE == pytest.approx(nominal + 0.5 * start_time, abs=1.5 * CYCLE)
    assert second * CYCLE == pytest.approx(nominal, abs=1.5 * CYCLE)


@pytest.mark.parametrize('idle', [0.0, 0.0031, 0.05])
def test_a_chained_move_begins_later_by_the_idle_time(recorder, idle):
    made = recorder(laws=MotionLaws(idle_between_moves=idle))
    g, cycles = made.generator, 0
    for k in range(4):
        cycles += made.run(g.movel(shifted(g.T_base_tcp, y=(-0.05, 0.05)[k % 2]), A, V))
    nominal = 4 * (0.05 / V + V / A) + 3 * idle
    assert cycles * CYCLE == pytest.approx(nominal, abs=1.5 * CYCLE)
    # Not behind a pause of the program.
    made.step(times=3)
    cycles = made.run(g.movel(shifted(g.T_base_tcp, y=0.05), A, V))
    assert cycles * CYCLE == pytest.approx(0.05 / V + V / A, abs=1.5 * CYCLE)


@pytest.mark.parametrize('ratio', [1.0, 2.5, 4.0])
def test_a_turn_takes_the_time_of_its_ratio(recorder, ratio):
    made = recorder(laws=MotionLaws(turn_ratio=ratio))
    g = made.generator
    turned = g.T_base_tcp @ Pose.from_rotation_vector((0.0, 0.0, 0.0, 0.0, 0.0, 0.4))
    cycles = made.run(g.movel(turned, A, V))
    assert cycles * CYCLE == pytest.approx(0.4 / ratio / V + V / A, abs=1.5 * CYCLE)


def corner(made, radius, speed=V):
    """Run two lines with a blend around the corner; return positions relative to the corner."""
    g = made.generator
    at = shifted(g.T_base_tcp, y=0.1)
    made.run(g.movel(at, A, speed, r=radius))
    made.run(g.movel(shifted(at, x=0.1), A, speed))
    return made.positions - np.array(at.position)


@pytest.mark.parametrize('begin', [0.3, 0.7, 1.0])
def test_a_blend_begins_at_its_share_of_the_radius(recorder, begin):
    radius = 0.04
    places = corner(recorder(laws=MotionLaws(blend_begin=begin)), radius)
    # On the parabola between (0, -r) and (r, 0): sqrt(x) + sqrt(-y) = sqrt(r).
    in_blend = places[(places[:, 0] > 1e-5) & (places[:, 1] < -1e-5)]
    r = (np.sqrt(in_blend[:, 0]) + np.sqrt(-in_blend[:, 1])) ** 2
    assert len(in_blend) > 20
    assert r == pytest.approx(begin * radius, rel=1e-4)


@pytest.mark.parametrize('ratio', [0.5, 1.0, 1.8])
def test_a_blend_is_as_fast_half_way_as_its_ratio(recorder, ratio):
    made = recorder(laws=MotionLaws(blend_speed_ratio=ratio))
    places = corner(made, 0.04)
    half_way = np.argmin(np.abs(places[:, 0] + places[:, 1]))
    speed = np.linalg.norm(made.tool_speeds()[half_way - 1 : half_way + 1], axis=1).mean()
    # At equal speeds on both sides the middle of a right-angled parabola has v / sqrt(2).
    assert speed == pytest.approx(ratio * V / sqrt(2.0), rel=0.01)
    outside = np.linalg.norm(made.tool_speeds()[50:300], axis=1)
    assert outside == pytest.approx(V, rel=1e-6)


@pytest.mark.parametrize(('start', 'end'), [(1.0, 1.0), (0.5, 2.0), (3.0, 0.2)])
def test_two_ramps_cover_one_unit(start, end):
    profile = two_ramps(start, end, 1.3)
    assert profile.at(profile.duration * (1 - 1e-12)) == pytest.approx(1.0)
    assert profile.speed(0.0) == pytest.approx(start)
    assert profile.speed(profile.duration) == pytest.approx(end)
    middle = profile.speed(profile.time_at(0.5))
    assert middle == pytest.approx(1.3 * sqrt(0.5 * (start**2 + end**2)))


def test_movep_keeps_its_documented_blend(recorder):
    runs = []
    for laws in (MotionLaws(), MotionLaws(blend_begin=0.5, blend_speed_ratio=1.5)):
        made = recorder(laws=laws)
        g = made.generator
        at = shifted(g.T_base_tcp, y=0.1)
        made.run(g.movep(at, A, V, 0.02))
        made.run(g.movep(shifted(at, x=0.1), A, V))
        runs.append(made.q)
    assert np.array_equal(*runs)


@pytest.mark.parametrize('deceleration', [3.0, 15.0])
def test_an_abandoned_servoj_brakes_by_its_law(recorder, deceleration):
    made = recorder(laws=MotionLaws(set_point_deceleration=deceleration))
    g = made.generator
    q = np.array(g.q)
    for _ in range(400):
        q[0] += 0.5 * CYCLE
        made.run(g.servoj(tuple(q), CYCLE, 0.1, 300.0))
    before = len(made.joints)
    made.rest()
    speeds = made.speeds()[before:, 0]
    braking = -np.diff(speeds)[1:-1] / CYCLE
    assert braking[speeds[1:-2] > 0.05] == pytest.approx(deceleration, rel=0.01)


@pytest.mark.parametrize('factor', [0.5, 1.0, 2.0])
def test_servoj_lags_by_its_lookahead(recorder, factor):
    made = recorder(laws=MotionLaws(servo_lookahead_factor=factor, servo_gain_factor=2.0))
    g = made.generator
    q = np.array(g.q)
    for _ in range(1500):
        q[0] += 0.2 * CYCLE
        made.run(g.servoj(tuple(q), CYCLE, 0.1, 300.0))
    # The set-point is a cycle ahead of the last one that was sent.
    assert q[0] - g.q[0] == pytest.approx(0.2 * (0.1 * factor - CYCLE), rel=1e-3)


# -- the whole controller -------------------------------------------------------------------------


def controller_of(**config):
    """Return a controller that runs a long straight move at full speed."""
    controller = assemble(SimulatorConfig(model='ur5e', **config)).controller
    text = 'def p():\n  movej([1.5, -1.57, 1.57, -1.57, -1.57, 0], a=2, v=1)\nend\n'
    assert controller.programs.load('p', text) == ''
    assert controller.programs.play() == ''
    for _ in range(450):
        controller.step()
    assert controller.motion.qd[0] == pytest.approx(1.0)
    return controller


STOPS = {
    'stop_time': lambda controller: controller.programs.stop(),
    'pause_time': lambda controller: controller.programs.pause(),
    'protective_stop_time': lambda controller: controller.safety_event(
        SafetyEvent.PROTECTIVE_STOP
    ),
}


@pytest.mark.parametrize('time', [0.05, 0.3])
@pytest.mark.parametrize('law', STOPS)
def test_the_arm_comes_to_rest_within_the_time_of_the_law(law, time):
    controller = controller_of(twin=twin_of(**{law: time}))
    begin = controller.motion.q[0]
    STOPS[law](controller)
    cycles = 0
    while controller.motion.qd[0] > 0.0:
        controller.step()
        cycles += 1
    assert cycles * CYCLE == pytest.approx(time, abs=2.5 * CYCLE)
    assert controller.motion.q[0] - begin == pytest.approx(0.5 * time, abs=2.5 * CYCLE)


@pytest.mark.parametrize(
    ('call', 'laws'),
    [
        ('movej(q', {'timed_joint_acceleration': 0.9, 'timed_joint_speed': 0.3}),
        (
            'movel(get_forward_kin(q)',
            {'timed_linear_acceleration': 0.4, 'timed_linear_speed': 0.1},
        ),
    ],
)
def test_moves_without_speeds_take_those_of_the_laws(call, laws):
    def joints(words, **config):
        controller = assemble(SimulatorConfig(model='ur5e', **config)).controller
        q = 'q = [0.3, -1.57, 1.57, -1.57, -1.57, 0]'
        assert controller.programs.load('p', f'def p():\n  {q}\n  {call}{words})\nend\n') == ''
        controller.programs.play()
        rows = []
        while controller.programs.running:
            controller.step()
            rows.append(controller.motion.q)
        return rows

    a, v = laws.values()
    twin = twin_of(**laws)
    assert joints('', twin=twin) == joints(f', a={a}, v={v}')
    assert joints(', t=3', twin=twin) == joints(f', a={a}, v={v}, t=3')
    assert joints(', a=1.2, v=0.25', twin=twin) == joints(', a=1.2, v=0.25')


def test_figures_of_the_arm_make_it_imperfect():
    figures = {name: law.low + 1e-3 for name, law in LAWS.items() if law.assumed is None}
    assert set(figures) == set(ArmFigures.__dataclass_fields__)
    config = SimulatorConfig(twin=twin_of(**figures))
    assert {name: getattr(config.arm_imperfections, name) for name in figures} == figures
    assert SimulatorConfig(twin=twin_of(start_time=0.1)).arm_imperfections is None
    assert replace(config, twin=None) == SimulatorConfig()


def test_a_twin_of_another_robot_is_refused():
    twin = replace(
        twin_of(start_time=0.1),
        arm=ArmIdentity(model='ur5e', software='5.21.0', serial_number='20231', motion_version=1),
    )
    assert SimulatorConfig(twin=twin).serial_number == '20231'
    with pytest.raises(ValueError, match='model ur5e, not ur10e'):
        SimulatorConfig(twin=twin, model='ur10e')
    with pytest.raises(ValueError, match=r'software 5\.21\.0, not 5\.14\.0'):
        SimulatorConfig(twin=twin, polyscope='5.14')


def test_a_twin_without_laws_changes_nothing():
    assert SimulatorConfig(twin=twin_of()).laws == SimulatorConfig().laws == MotionLaws()


def test_a_measured_begin_of_blends_takes_the_place_of_the_assumed_one_of_version_2():
    arm = ArmIdentity(model='ur5e', motion_version=2)
    version: dict[str, Any] = {'polyscope': '5.22', 'motion_version': 2}
    plain = SimulatorConfig(**version, twin=replace(twin_of(start_time=0.1), arm=arm))
    measured = SimulatorConfig(**version, twin=replace(twin_of(blend_begin=0.7), arm=arm))
    assert plain.second_version_laws.blend_fraction == 0.9
    assert measured.second_version_laws.blend_fraction == 1.0
    assert measured.laws.blend_begin == 0.7
