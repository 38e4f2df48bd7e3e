# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Files for ur_description: multiplied as matrices they are the arm, and they look as others write.

The judges are the textbook product of the DH matrices, the files of ur_description, and a file and
hashes that the UR drivers computed. The tables of real arms were published by their users.
"""

from math import asin, atan2, pi

from forward_model import chain_of_origins, dh_frames, origin_matrix, turn, turn_between
import numpy as np
import pytest
import yaml

from ur_cartesian_driver.kinematics.calibration_file import calibration_hash, calibration_text
from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.kinematics.robot_models import DhTable, MODELS
from ur_cartesian_driver.sim.calibration import random_calibration, read_calibration

NAMES = ('shoulder', 'upper_arm', 'forearm', 'wrist_1', 'wrist_2', 'wrist_3')
FIELDS = ('x', 'y', 'z', 'roll', 'pitch', 'yaw')
Q = np.random.default_rng(0).uniform(-2 * pi, 2 * pi, (1000, 6))
#: Universal_Robots_ROS_Driver, issue 457; its file has the hash calib_11914550710326326731.
UR5 = DhTable(
    theta=(
        -9.62699668632896e-06,
        -1.43707039992005,
        2.02543119975016,
        -0.588254688694989,
        4.13647390228702e-05,
        8.1737464953645e-06,
    ),
    a=(
        0.000279332356195598,
        -0.0566854832098269,
        -0.32646702272051,
        1.49388687216263e-05,
        2.23692592990586e-07,
        0.0,
    ),
    d=(
        0.0888794492754001,
        574.241384579456,
        -507.363402098168,
        -66.7676839353205,
        0.0949734691141216,
        0.0825625014554953,
    ),
    alpha=(
        1.57033858830411,
        -0.000733893428160216,
        0.00325607356326439,
        1.57040005185553,
        -1.57101000328584,
        0.0,
    ),
)
#: The documentation of ur_calibration.
UR10E = DhTable(
    theta=(
        -2.4147806894359e-07,
        1.60233952386695,
        -1.68607190752171,
        0.0837331147700119,
        -1.01260355871158e-07,
        3.91986209186124e-08,
    ),
    a=(
        2.12234865571206e-05,
        0.0193171326277006,
        -0.569251663611088,
        -4.61409023720934e-05,
        -6.39280053471802e-05,
        0.0,
    ),
    d=(
        0.180539811714259,
        439.140974079901,
        -446.027059806332,
        7.0603368964236,
        0.119811341150314,
        0.115670917257426,
    ),
    alpha=(
        1.57014608044242,
        0.0013941666682559,
        0.00693818880325995,
        1.56998468543761,
        -1.57038520649543,
        0.0,
    ),
)
#: Written by ur_calibration for a UR5e, and published.
WRITTEN_BY_UR_CALIBRATION = (
    (0.0, 0.0, 0.1627122445743823, 0.0, 0.0, 5.707382499074709e-08),
    (0.0001820110310317555, 0.0, 0.0, 1.571314866107557, 0.0, 1.12157791523139e-06),
    (
        *(-0.425170344631444, 0.0, 0.0),
        *(0.001444320579376547, -0.0004261037597356073, 4.642343028998144e-06),
    ),
    (
        *(-0.392646598028507, -0.0004030322688786401, 0.1331063119537431),
        *(0.003027888244224887, -0.001185722601572754, -2.569771029137183e-06),
    ),
    (
        *(-7.071306960874342e-06, -0.09960359635829828, -3.198591184007791e-07),
        *(1.570799538115874, 0.0, 1.304820282092834e-06),
    ),
    (
        *(1.369362273278849e-05, 0.09958483828527664, 9.521789789182917e-05),
        *(1.571752475045119, 3.141592653589793, 3.141592510837143),
    ),
)


def default_kinematics(d1, a2, a3, d4, d5, d6):
    """The numbers of ur_description's default_kinematics.yaml, which has them to 1e-10."""
    return (
        (0.0, 0.0, d1, 0.0, 0.0, 0.0),
        (0.0, 0.0, 0.0, 1.570796327, 0.0, 0.0),
        (a2, 0.0, 0.0, 0.0, 0.0, 0.0),
        (a3, 0.0, d4, 0.0, 0.0, 0.0),
        (0.0, -d5, 0.0, 1.570796327, 0.0, 0.0),
        (0.0, d6, 0.0, 1.570796326589793, pi, pi),
    )


def rows(text):
    links = yaml.safe_load(text)['kinematics']
    assert list(links) == [*NAMES, 'hash']
    return [[links[name][field] for field in FIELDS] for name in NAMES]


TABLES = [
    *(pytest.param(name, model.geometry, id=name) for name, model in MODELS.items()),
    *(
        pytest.param(name, random_calibration(model, seed), id=f'{name} {seed}')
        for name, model in MODELS.items()
        for seed in range(3)
    ),
    pytest.param('ur5', UR5, id='a real ur5'),
    pytest.param('ur10e', UR10E, id='a real ur10e'),
]


@pytest.mark.parametrize(('name', 'table'), TABLES)
def test_the_chain_of_the_file_is_the_arm(name, table):
    flange = chain_of_origins(rows(calibration_text(table)), Q)
    arm = Arm(MODELS[name], table)
    for judge in dh_frames(table, Q)[:, -1], np.array([arm.forward(q).matrix() for q in Q]):
        assert np.abs(flange[:, :3, 3] - judge[:, :3, 3]).max() < 1e-9
        assert turn_between(flange[:, :3, :3], judge[:, :3, :3]).max() < 1e-9


@pytest.mark.parametrize(('name', 'table'), TABLES)
def test_our_reader_reads_the_same_arm(name, table, tmp_path):
    path = tmp_path / 'arm.yaml'
    path.write_text(calibration_text(table))
    read = dh_frames(read_calibration(path, MODELS[name]), Q)[:, -1]
    flange = dh_frames(table, Q)[:, -1]
    assert np.abs(read[:, :3, 3] - flange[:, :3, 3]).max() < 1e-9
    assert turn_between(read[:, :3, :3], flange[:, :3, :3]).max() < 1e-9


@pytest.mark.parametrize(('name', 'table'), TABLES)
def test_each_frame_lies_in_the_arm(name, table):
    found = [row[:3] for row in rows(calibration_text(table))]
    nominal = [row[:3] for row in rows(calibration_text(MODELS[name].geometry))]
    np.testing.assert_allclose(found, nominal, atol=0.01)


@pytest.mark.parametrize(
    ('name', 'lengths'),
    [
        ('ur5e', (0.1625, -0.425, -0.3922, 0.1333, 0.0997, 0.0996)),
        ('ur10e', (0.1807, -0.6127, -0.57155, 0.17415, 0.11985, 0.11655)),
        ('ur30', (0.2363, -0.637, -0.5037, 0.201, 0.1593, 0.1543)),
    ],
)
def test_a_nominal_arm_has_the_numbers_of_ur_description(name, lengths):
    found = rows(calibration_text(MODELS[name].geometry))
    for row, expected in zip(found, default_kinematics(*lengths), strict=True):
        np.testing.assert_allclose(origin_matrix(row), origin_matrix(expected), atol=1e-9)


def test_frames_are_where_ur_calibration_puts_them(tmp_path):
    """
    Its angles are those of Rx Ry Rz (`eulerAngles(0, 1, 2)` of Eigen), and not of a URDF.

    Only so are its frames, to the last digit, those of a DH table: each x axis normal to two axes.
    """
    expected = [
        turn('x', roll) @ turn('y', pitch) @ turn('z', yaw)
        for *_, roll, pitch, yaw in WRITTEN_BY_UR_CALIBRATION
    ]
    links = {}
    for name, row, T in zip(NAMES, WRITTEN_BY_UR_CALIBRATION, expected, strict=True):
        T[:3, 3] = row[:3]
        angles = atan2(T[2, 1], T[2, 2]), -asin(T[2, 0]), atan2(T[1, 0], T[0, 0])
        links[name] = dict(zip(FIELDS, map(float, (*row[:3], *angles)), strict=True))
    path = tmp_path / 'as_a_urdf.yaml'
    path.write_text(yaml.safe_dump({'kinematics': links}))
    found = rows(calibration_text(read_calibration(path, MODELS['ur5e'])))
    for row, T in zip(found, expected, strict=True):
        np.testing.assert_allclose(origin_matrix(row), T, atol=1e-9)


def test_a_real_arm_has_the_numbers_of_ur_calibration():
    shoulder, upper_arm, *_ = rows(calibration_text(UR5))
    assert shoulder == pytest.approx(
        [0.0, 0.0, 0.08887944927540013, 0.0, 0.0, -9.626996686328957e-06], abs=1e-11
    )
    assert upper_arm[:3] == pytest.approx([0.0002793323561955981, 0.0, 0.0], abs=1e-11)


@pytest.mark.parametrize(
    ('table', 'number'),
    [
        pytest.param(MODELS['ur5e'].geometry, 12788084448423163542, id='ur5e'),
        pytest.param(MODELS['ur10e'].geometry, 5119701370761913513, id='ur10e'),
        pytest.param(MODELS['ur30'].geometry, 12001109639981648826, id='ur30'),
        pytest.param(UR5, 11914550710326326731, id='a real ur5'),
    ],
)
def test_the_hash_is_that_of_the_ur_drivers(table, number):
    assert calibration_hash(table) == f'calib_{number}'
    assert yaml.safe_load(calibration_text(table))['kinematics']['hash'] == f'calib_{number}'


def test_a_flange_off_the_last_axis_is_refused_with_the_numbers():
    nominal = MODELS['ur5e'].geometry
    table = DhTable(a=(*nominal.a[:5], 0.002), d=nominal.d)
    with pytest.raises(ValueError, match=r'off the last axis \(a = 0.002 m, alpha = 0 rad\)'):
        calibration_text(table)
