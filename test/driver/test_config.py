# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Settings that cannot work are refused with the name, the value and the bound."""

import pytest

from ur_cartesian_driver.driver import DriverConfig


@pytest.mark.parametrize(('field', 'value'), [
    ('robot_loop', 'fiber'), ('robot_receive_timeout', 0.0), ('keepalive_period', -1.0),
    ('feedback_rate', 0.0), ('node_timeout', float('nan')), ('stop_deceleration', 0.0)])
def test_a_value_out_of_range_is_named(field, value):
    with pytest.raises(ValueError, match=field) as error:
        DriverConfig(**{field: value})
    assert str(value) in str(error.value)


def test_keepalives_have_to_come_within_the_timeout():
    with pytest.raises(ValueError, match=r'0\.1 s.*0\.09 s'):
        DriverConfig(robot_receive_timeout=0.1, keepalive_period=0.09)
