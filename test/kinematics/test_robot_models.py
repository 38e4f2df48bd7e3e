# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The table of robots says what its sources say."""

from dataclasses import replace
from math import inf, nan, pi, radians

import pytest

from ur_cartesian_driver.kinematics.robot_models import (
    DhTable,
    JointLimits,
    MODELS,
    robot_model,
)

UR20_SPEED_DEG_S = [120, 120, 150, 210, 210, 210]


def test_all_models_of_the_reference_are_there_and_no_others(golden_robots):
    assert list(MODELS) == list(golden_robots)


@pytest.mark.parametrize('name', MODELS)
def test_the_table_equals_the_reference(name, golden_robots):
    model, reference = MODELS[name], golden_robots[name]
    for column, values in model.geometry.columns().items():
        assert values == tuple(reference[column]), column
    speeds = reference['max_joint_speed_deg_s'] or UR20_SPEED_DEG_S
    assert model.max_joint_speed == tuple(radians(v) for v in speeds)
    torques = reference['max_joint_torque_nm']
    assert model.max_joint_torque == (tuple(torques) if torques else None)
    assert model.payload == reference['payload_kg']
    assert model.max_reach == reference['reach_mm'] / 1000
    assert model.wire_type == reference['wire_robot_type']
    assert model.series == reference['series']


@pytest.mark.parametrize('name', MODELS)
def test_joints_turn_once_in_either_direction_but_wrist_3_of_the_smallest(name, golden_robots):
    endless = golden_robots[name]['wrist_3_unlimited']
    limits = MODELS[name].position_limits
    assert limits[:5] == ((-2 * pi, 2 * pi),) * 5
    assert limits[5] == ((-inf, inf) if endless else (-2 * pi, 2 * pi))


def test_an_unknown_model_is_refused_with_the_names_there_are():
    with pytest.raises(ValueError, match=r"no robot model 'ur6'; use one of ur3, ur5, .*ur30"):
        robot_model('ur6')


@pytest.mark.parametrize('column', [(0.0,) * 5, (0.0,) * 5 + (nan,), (0.0,) * 5 + (inf,)])
def test_a_table_must_be_six_finite_numbers_wide(column):
    with pytest.raises(ValueError, match='column d of a DH table must hold six finite'):
        DhTable(a=(0.0,) * 6, d=column)


def test_the_difference_of_two_tables_is_that_of_their_worst_number():
    geometry = robot_model('ur5e').geometry
    other = replace(geometry, theta=(0.0, 0.0, -2e-4, 0.0, 0.0, 0.0), a=(1e-4, *geometry.a[1:]))
    assert geometry.difference(other) == 2e-4
    assert geometry.difference(geometry) == 0.0


def test_limits_of_a_controller_count_where_they_are_tighter_and_possible():
    model = robot_model('ur3e')
    limits = JointLimits(
        position=((-1.0, 1.0), (-9.0, 9.0), (2.0, 1.0), (nan, nan), (-inf, 0.5), (-3.0, 3.0)),
        speed=(1.0, 99.0, 0.0, -1.0, nan, inf),
    )
    limited = model.limited_to(limits)
    low = model.position_limits[4][0]
    assert limited.position_limits == (
        (-1.0, 1.0),
        *model.position_limits[1:4],
        (low, 0.5),
        (-3.0, 3.0),
    )
    assert limited.max_joint_speed == (1.0, *model.max_joint_speed[1:])
    assert limited.reported_ranges == {0, 4, 5}
    assert limited.reported_speeds == {0}
    own = JointLimits(position=model.position_limits, speed=model.max_joint_speed)
    assert model.limited_to(own) == model
