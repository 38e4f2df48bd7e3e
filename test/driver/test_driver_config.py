# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Settings that cannot work are refused with the name, the value and the bound."""

from typing import Any

import numpy as np
import pytest

from ur_cartesian_driver.driver import DriverConfig


@pytest.mark.parametrize(
    ('field', 'value'),
    [
        ('robot_loop', 'fiber'),
        ('on_robot_stop', 'wait'),
        ('robot_receive_timeout', 0.0),
        ('keepalive_period', -1.0),
        ('feedback_rate', 0.0),
        ('node_timeout', float('nan')),
        ('stop_deceleration', 0.0),
        ('keep_open_margin', 0.0),
        ('keep_open_horizon', 0.3),
        ('keep_open_timeout', -1.0),
        ('rtde_frequency', 1),
        ('rtde_frequency', float('nan')),
        ('rtde_port', -1),
        ('primary_port', 65536),
        ('dashboard_port', 70000),
        ('reverse_port', -50001),
        ('rtde_port', '30004'),
        ('rtde_port', 30004.0),
        ('robot_ip', 17),
        ('headless_mode', 'yes'),
        ('stop_deceleration', 'hard'),
        ('stop_deceleration', float('inf')),
        ('max_plan_deviation', float('inf')),
        ('keep_open_timeout', float('nan')),
        ('io_publish_rate', -1.0),
        ('servo_buffer_depth', True),
    ],
)
def test_a_value_out_of_range_is_named(field, value):
    with pytest.raises(ValueError, match=field) as error:
        DriverConfig(**{field: value})
    assert str(value) in str(error.value)


def test_numbers_of_numpy_become_plain_numbers():
    given: dict[str, Any] = {'node_timeout': np.float32(5.0), 'rtde_port': np.int32(30004)}
    config = DriverConfig(**given)
    assert (type(config.node_timeout), type(config.rtde_port)) == (float, int)
    assert config == DriverConfig()


def test_keepalives_have_to_come_within_the_timeout():
    with pytest.raises(ValueError, match=r'0\.1 s.*0\.09 s'):
        DriverConfig(robot_receive_timeout=0.1, keepalive_period=0.09)


def test_an_unknown_dialect_is_answered_with_those_that_there_are():
    with pytest.raises(ValueError, match=r"wire_dialect is '2\.1', .* 2\.0, 2\.10, 2\.12, 2\.14"):
        DriverConfig(wire_dialect='2.1')


@pytest.mark.parametrize('dialect', ['2.0', '2.10', '2.12'])
def test_our_own_program_is_not_sent_to_a_robot_with_an_older_one(dialect):
    DriverConfig(wire_dialect=dialect)
    with pytest.raises(ValueError, match='headless_mode') as error:
        DriverConfig(wire_dialect=dialect, headless_mode=True)
    assert f"wire_dialect is '{dialect}'" in str(error.value)


def test_programs_of_others_have_the_upper_registers():
    with pytest.raises(ValueError, match='set lower_registers to false'):
        DriverConfig(wire_dialect='2.12', lower_registers=True)


def test_programs_of_others_set_no_motion_version():
    with pytest.raises(ValueError, match='set motion_version to 0'):
        DriverConfig(wire_dialect='2.12', motion_version=1)
