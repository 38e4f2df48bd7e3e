# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
from math import inf, nan
from typing import Any

import pytest

from ur_cartesian_driver.motion.errors import RemoteProtocolError
from ur_cartesian_driver.motion.geometry.pose import IDENTITY
from ur_cartesian_driver.motion.state.rtde_state import (
    RobotMode,
    RuntimeState,
    SafetyMode,
    STATE_TABLE,
)
from ur_cartesian_driver.protocol.program import registers
from ur_cartesian_driver.robot.rtde.state_decoding import (
    in_recipe_order,
    REQUIRED_FIELDS,
    robot_state_from_rtde,
)

VECTORS = REQUIRED_FIELDS[1:9]


def values(**mode_changes):
    found: dict[str, Any] = {name: (0.0,) * 6 for name in REQUIRED_FIELDS[1:10]}
    found |= dict.fromkeys(('timestamp', 'speed_scaling', 'target_speed_fraction'), 1.0)
    found |= {name: 7 for name in REQUIRED_FIELDS if name not in found}
    found |= mode_changes
    return in_recipe_order(tuple(found), tuple(found.values()))


def test_unknown_modes_are_the_most_careful_ones():
    state = robot_state_from_rtde(values(robot_mode=99, safety_mode=99, runtime_state=99))
    assert state.robot_mode is RobotMode.NO_CONTROLLER
    assert state.safety_mode is SafetyMode.UNDEFINED_SAFETY_MODE
    assert state.runtime_state is RuntimeState.STOPPED


@pytest.mark.parametrize('number', [nan, inf, -inf])
@pytest.mark.parametrize('name', [*VECTORS, 'timestamp', 'speed_scaling', 'tcp_offset'])
def test_a_number_that_is_not_finite_is_nonsense_and_named(name, number):
    """Compared with it no tolerance would ever be violated."""
    wrong = number if name in ('timestamp', 'speed_scaling') else (0.0, number, *(0.0,) * 4)
    with pytest.raises(RemoteProtocolError, match=f'not finite: {name}.'):
        robot_state_from_rtde(values(**{name: wrong}))


def test_the_count_of_points_is_read_from_the_register_that_the_program_writes():
    """The table of the state stands below the registers, so it has the name as a literal."""
    (name,) = (row.rtde.name for row in STATE_TABLE if row.rtde and row.name == 'points_begun')
    assert name == registers.register_name(registers.OutputInteger.POINTS_BEGUN)


def test_what_the_robot_lacks_has_its_default():
    state = robot_state_from_rtde(values())
    assert state.T_flange_tcp == IDENTITY
    assert state.actual_tcp_acceleration is None
    assert state.points_begun == 0
