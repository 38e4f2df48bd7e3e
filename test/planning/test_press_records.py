# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The records of a press for the robot program, and presses that a robot cannot do."""

from dataclasses import replace
from math import pi

import pytest

from ur_cartesian_driver.kinematics.robot_models import robot_model
from ur_cartesian_driver.motion.errors import NotAvailable
from ur_cartesian_driver.motion.geometry.pose import (
    IDENTITY,
    Pose,
    quaternion_from_rotation_vector,
)
from ur_cartesian_driver.motion.goal.goal import ContactEnd, Goal, Press, PressFrame, Waypoint
from ur_cartesian_driver.motion.goal.goal_columns import goal_table
from ur_cartesian_driver.motion.goal.moving_frame import MovingFrame
from ur_cartesian_driver.planning import PlanningOptions
from ur_cartesian_driver.planning.request.point_events.presses import press_records, Presses

PRESS = Press(first_waypoint=0, last_waypoint=1, axes=('rx', 'z'), forces=(0.5, 20.0))
POINTS = (Waypoint(pose=Pose((0.1, 0.0, 0.0))), Waypoint(pose=Pose((0.2, 0.0, 0.0))))


def test_forces_and_limits_come_to_their_axes():
    (law, _), (begin, note) = press_records(
        replace(PRESS, frame=PressFrame.GOAL, speed_limits=(0.3, 0.02), max_deviation=0.001),
        Pose((0.0, 0.0, 0.5)),
    )
    assert law.wrench == (0.0, 0.0, 20.0, 0.5, 0.0, 0.0)
    assert law.limits == (0.001, 0.001, 0.02, 0.3, 0.05, 0.05)
    assert begin.compliant == (0.0, 0.0, 1.0, 1.0, 0.0, 0.0)
    assert begin.T_base_task == Pose((0.0, 0.0, 0.5))
    assert not begin.follows_tool
    assert note == (
        'presses with 0.5 Nm about x and 20 N along z of the goal frame from there to point 1'
    )


def test_a_fixed_tool_presses_with_the_opposite_force_of_the_part():
    """Both act at the tool; the tool stands in base, so nothing has to follow it."""
    held = MovingFrame(
        T_flange_frame=Pose((0.0, 0.0, 0.1)),
        T_base_tool=Pose((0.5, 0.0, 0.3), quaternion_from_rotation_vector((0.0, pi / 2, 0.0))),
    )
    # The axes of the part are turned against those of the tool by a quarter about z.
    quarter = quaternion_from_rotation_vector((0.0, 0.0, pi / 2))
    points = tuple(Waypoint(pose=Pose((x, 0.0, 0.0), quarter)) for x in (0.1, 0.2))
    records = {}
    for frame in PressFrame:
        goal = goal_table(
            Goal(
                waypoints=points,
                presses=(replace(PRESS, axes=('z',), forces=(20.0,), frame=frame),),
                moving_frame=held,
            )
        )
        *_, law, begin = (stop.stop for stop in Presses().stops(goal, PlanningOptions()))
        assert law.wrench == (0.0, 0.0, -20.0, 0.0, 0.0, 0.0)
        assert not begin.follows_tool
        records[frame] = begin.T_base_task
    assert records[PressFrame.TOOL] == held.T_base_tool
    assert records[PressFrame.GOAL].position == held.T_base_tool.position
    part = held.T_base_tool @ Pose((0.0,) * 3, quarter).inverse()
    assert records[PressFrame.GOAL].angle_to(part) < 1e-9
    assert records[PressFrame.BASE] == IDENTITY


def test_contact_is_named_in_the_report():
    press = replace(PRESS, axes=(), forces=(), contact=ContactEnd.ENDS)
    *_, (begin, note) = press_records(press, IDENTITY)
    assert not any(begin.compliant)
    assert note == 'goes from there to point 1, or until the tool touches'


@pytest.mark.parametrize(
    ('press', 'model', 'T_tcp_controlled', 'sentence'),
    [
        (
            replace(PRESS, zero_sensor=True),
            'ur5',
            IDENTITY,
            'presses[0].zero_sensor is set, but a ur5 has no force sensor and no gain of force',
        ),
        (
            replace(PRESS, gain_scaling=0.5),
            'ur10',
            IDENTITY,
            'presses[0].gain_scaling is set, but',
        ),
        (
            PRESS,
            'ur5e',
            Pose((0.0, 0.0, 0.1)),
            "presses[0].frame is TOOL, but the controlled frame is not the robot's TCP",
        ),
    ],
)
def test_what_a_robot_cannot_do_is_refused(press, model, T_tcp_controlled, sentence):
    goal = goal_table(Goal(waypoints=POINTS, presses=(press,)))
    with pytest.raises(NotAvailable) as refusal:
        Presses().check_robot(goal, robot_model(model), T_tcp_controlled)
    assert str(refusal.value).startswith(sentence)
    Presses().check_robot(replace(goal, presses=(PRESS,)), robot_model(model), IDENTITY)
