# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Calibrated arms: the file's own chain of poses, and the robot's reports."""

from __future__ import annotations

from math import pi

from forward_model import chain_of_origins
import numpy as np
import pytest
import yaml

from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.kinematics.robot_models import MODELS, robot_model
from ur_cartesian_driver.protocol.client_interfaces.primary_messages import PrimaryDecoder
from ur_cartesian_driver.protocol.client_interfaces.primary_state import KinematicsInfo
from ur_cartesian_driver.sim import assemble, SimulatorConfig
from ur_cartesian_driver.sim.calibration import random_calibration, read_calibration
from ur_cartesian_driver.sim.interfaces.primary_stream import PrimaryStream

UR5E = robot_model('ur5e')
NAMES = ('shoulder', 'upper_arm', 'forearm', 'wrist_1', 'wrist_2', 'wrist_3')
FIELDS = ('x', 'y', 'z', 'roll', 'pitch', 'yaw')
#: As of a UR5e; deviations of the size that real ones have.
MEASURED = (
    (0.0, 0.0, 0.1627, 0.0, 0.0, 6e-8),
    (1.8e-4, 0.0, 0.0, 1.5713, 0.0, 1.1e-6),
    (-0.42517, 0.0, 0.0, 1.4e-3, -4.3e-4, 4.6e-6),
    (-0.39265, -4e-4, 0.13311, 3e-3, -1.2e-3, -2.6e-6),
    (-7e-6, -0.0996, -3e-7, 1.5708, 0.0, 1.3e-6),
    (1.4e-5, 0.09958, 9.5e-5, 1.57175, pi, 3.1415925),
)
NOMINAL = (
    (0.0, 0.0, 0.1625, 0.0, 0.0, 0.0),
    (0.0, 0.0, 0.0, 1.570796327, 0.0, 0.0),
    (-0.425, 0.0, 0.0, 0.0, 0.0, 0.0),
    (-0.3922, 0.0, 0.1333, 0.0, 0.0, 0.0),
    (0.0, -0.0997, -2e-11, 1.570796327, 0.0, 0.0),
    (0.0, 0.0996, -2e-11, 1.570796327, pi, pi),
)
JOINTS = np.random.default_rng(0).uniform(-3.0, 3.0, (50, 6))


def content(rows):
    return {
        'kinematics': {
            name: dict(zip(FIELDS, row, strict=True))
            for name, row in zip(NAMES, rows, strict=True)
        }
        | {'hash': 'calib_1'}
    }


@pytest.fixture
def file(tmp_path):
    def write(rows):
        path = tmp_path / 'calibration.yaml'
        path.write_text(yaml.safe_dump(content(rows)))
        return path

    return write


@pytest.mark.parametrize('rows', [MEASURED, NOMINAL])
def test_the_arm_goes_where_the_file_says(rows, file):
    arm = Arm(UR5E, read_calibration(file(rows), UR5E))
    found = [arm.forward(q).matrix() for q in JOINTS]
    assert np.abs(found - chain_of_origins(rows, JOINTS)).max() < 1e-8


def test_a_nominal_file_has_the_table_of_the_model_but_for_rounding(file):
    assert read_calibration(file(NOMINAL), UR5E).difference(UR5E.geometry) < 1e-8


@pytest.mark.parametrize('name', MODELS)
def test_made_up_arms_miss_the_model_by_millimetres_and_no_more(name):
    model = robot_model(name)
    arms = [Arm(model, random_calibration(model, seed)) for seed in range(5)]
    misses = [arm.forward(q).distance_to(Arm(model).forward(q)) for arm in arms for q in JOINTS]
    assert 5e-4 < np.mean(misses) < 3e-3
    assert max(misses) < 0.02


def test_a_seed_means_the_same_arm_every_time_and_each_seed_another():
    assert random_calibration(UR5E, 1) == random_calibration(UR5E, 1)
    assert random_calibration(UR5E, 1) != random_calibration(UR5E, 2)


def test_the_robot_moves_and_reports_by_its_calibration(make_bench):
    geometry = random_calibration(UR5E, 4)
    bench = make_bench(geometry=geometry)
    log = bench.run("""
        target = pose_add(get_target_tcp_pose(), p[0.1, 0.05, -0.1, 0, 0, 0.2])
        movel(target, a=1, v=0.5)
        textmsg(point_dist(get_forward_kin(get_inverse_kin(target)), target) < 1e-7)
        textmsg(point_dist(get_target_tcp_pose(), target) < 1e-7)""")
    assert [line for line in log if line in ('True', 'False')] == ['True', 'True']
    assert (
        Arm(UR5E, geometry)
        .forward(bench.controller.motion.q)
        .distance_to(bench.controller.motion.T_base_tcp)
        < 1e-9
    )
    assert (
        Arm(UR5E)
        .forward(bench.controller.motion.q)
        .distance_to(bench.controller.motion.T_base_tcp)
        > 1e-4
    )


def test_the_primary_interface_reports_the_table():
    geometry = random_calibration(UR5E, 4)
    stream = PrimaryStream(assemble(SimulatorConfig(geometry=geometry)).controller)
    (state,) = PrimaryDecoder().feed(stream.state())
    (info,) = (package for package in state.packages if isinstance(package, KinematicsInfo))
    assert (info.theta, info.a, info.d, info.alpha) == (
        geometry.theta,
        geometry.a,
        geometry.d,
        geometry.alpha,
    )


@pytest.mark.parametrize(
    ('text', 'words'),
    [
        ('kinematics: [', 'is not YAML'),
        ('shoulder: 1', 'no mapping `kinematics`'),
        ('kinematics: {shoulder: {x: 0}}', 'kinematics.shoulder.y'),
        (
            yaml.safe_dump(content(((0.0, 0.0, 0.1, 0.0, 0.0, 'much'), *MEASURED[1:]))),
            "'much' as kinematics.shoulder.yaw",
        ),
        (yaml.safe_dump(content(((0.01, *MEASURED[0][1:]), *MEASURED[1:]))), 'off the axis'),
        (  # upside down
            yaml.safe_dump(content(((*MEASURED[0][:3], pi, *MEASURED[0][4:]), *MEASURED[1:]))),
            'off the axis',
        ),
    ],
)
def test_what_is_wrong_with_a_file_is_named(tmp_path, text, words):
    path = tmp_path / 'bad.yaml'
    path.write_text(text)
    with pytest.raises(ValueError, match='calibration') as raised:
        read_calibration(path, UR5E)
    assert words in str(raised.value)
    assert '\n' not in str(raised.value)
