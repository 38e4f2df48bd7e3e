# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Outputs of goals on a held part: the robot program waits for poses of the TCP in base."""

from dataclasses import replace

from held_part_bench import (
    ARM,
    DEVIATION,
    edges,
    OFF,
    ON,
    OPTIONS,
    PART,
    PRIMITIVES,
    programmed,
    Q,
    SERVO,
    SPLINE,
    START,
)
from held_part_goals import origin_pose
import numpy as np
import pytest

from ur_cartesian_driver.motion.errors import NotAvailable
from ur_cartesian_driver.motion.geometry.pose import Pose
from ur_cartesian_driver.motion.goal.goal import OutputKind, ProportionalOutput, PulseTrain
from ur_cartesian_driver.motion.plan.primitive import PulseLaw, SpeedLaw
from ur_cartesian_driver.planning import plan
from ur_cartesian_driver.planning.stop_prediction import state_at_rest

TCP = Pose((0.02, -0.03, 0.12))
STATE = state_at_rest(ARM, Q, TCP)
T_FLANGE_PART = origin_pose(PART).matrix()
#: The fixed tool in base, where the arm stands at the start of the path.
T_BASE_TOOL = ARM.forward(Q).matrix() @ T_FLANGE_PART @ START.matrix()


def on_part(T_base_tcp):
    """Return where the fixed tool is on the part, by matrices."""
    T_base_part = T_base_tcp.matrix() @ np.linalg.inv(TCP.matrix()) @ T_FLANGE_PART
    return (np.linalg.inv(T_base_part) @ T_BASE_TOOL)[:3, 3]


@pytest.mark.parametrize('execution', [SPLINE, SERVO])
def test_outputs_wait_for_the_tcp_in_base_where_the_tool_is_at_their_points(execution):
    made = plan(edges(execution), STATE, ARM, OPTIONS)
    found = [output for outputs in made.rows.outputs.values() for output in outputs]
    assert len(found) == 2
    for output, point in zip(found, (ON, OFF), strict=True):
        corners = programmed()
        place = on_part(output.trigger_pose)
        assert np.linalg.norm(place - corners[point + 1]) < DEVIATION + 1e-5
        # A step of the TCP in the direction leads the tool on, from the corner before to the next.
        x, y, z = output.trigger_direction[:3]
        ahead = on_part(output.trigger_pose @ Pose((1e-3 * x, 1e-3 * y, 1e-3 * z)))
        assert (ahead - place) @ (corners[point + 2] - corners[point]) > 0.0


FOLLOWING = {
    'pulses': (
        PulseTrain(
            first_waypoint=0,
            last_waypoint=2,
            output=OutputKind.STANDARD_DIGITAL,
            pin=3,
            distance=0.005,
        ),
    ),
    'proportional_outputs': (
        ProportionalOutput(first_waypoint=0, last_waypoint=2, pin=0, gain=2.0),
    ),
}


def follows(goal, field):
    """Tell whether the plan of a goal has the record of a law by which an output is driven."""
    kind = {'pulses': PulseLaw, 'proportional_outputs': SpeedLaw}[field]
    outputs = plan(goal, STATE, ARM, OPTIONS).rows.outputs.values()
    return any(isinstance(record, kind) for records in outputs for record in records)


@pytest.mark.parametrize('field', FOLLOWING)
def test_outputs_by_the_speed_of_the_tool_are_for_parts_that_do_not_turn(field):
    """The robot program follows the TCP, whose speed is another one if the part turns."""
    for execution in (SPLINE, SERVO):
        goal = replace(edges(execution), io_commands=(), **{field: FOLLOWING[field]})
        with pytest.raises(NotAvailable, match=f'{field}.0. follows the motion of the TCP'):
            plan(goal, STATE, ARM, OPTIONS)
        still = replace(
            goal,
            waypoints=tuple(
                replace(point, pose=Pose(point.pose.position, START.quaternion))
                for point in goal.waypoints
            ),
        )
        assert follows(still, field)
    assert follows(replace(edges(PRIMITIVES), io_commands=(), **{field: FOLLOWING[field]}), field)
