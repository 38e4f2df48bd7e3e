# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""A new tail begins with the state that the joints have where it leaves the old one."""

from dataclasses import replace
from math import inf, nan, pi

import numpy as np
import pytest

from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.kinematics.robot_models import robot_model
from ur_cartesian_driver.motion.errors import AlreadySent, InvalidGoal, NotAvailable
from ur_cartesian_driver.motion.geometry.pose import Pose
from ur_cartesian_driver.motion.geometry.vectors import vector6
from ur_cartesian_driver.motion.goal.execution_modes import ExecutionMode
from ur_cartesian_driver.motion.goal.goal import Goal, IOCommand, OutputKind, Segment, Waypoint
from ur_cartesian_driver.motion.plan.primitive import SwitchOutput
from ur_cartesian_driver.motion.state.rtde_state import RobotState
from ur_cartesian_driver.planning import plan, PlanningOptions
from ur_cartesian_driver.planning.append.append_planner import plan_append, plan_first_part
from ur_cartesian_driver.planning.append.appendable_goal import AppendedPoints
from ur_cartesian_driver.planning.append.replaced_tail import (
    cut_tail,
    cut_time,
    first_replaceable,
    without_passed,
)

ARM = Arm(robot_model('ur5e'))
Q = (0.3, -pi / 2, pi / 2, -pi / 2, -pi / 2, 0.0)
HOME = ARM.forward(Q)
STATE = RobotState(
    timestamp=0.0, actual_q=Q, target_q=Q, actual_tcp_pose=HOME, target_tcp_pose=HOME
)
OPTIONS = PlanningOptions(max_tool_speed=1.0, self_collision='off')
STEP = 0.2
NAN6 = vector6([nan] * 6)


def points(first, count, height=0.0, twist=NAN6):
    """Points on a wave, from a number on, 0.2 s apart."""
    x, y, z = HOME.position
    return tuple(
        Waypoint(
            time=round(STEP * k, 6),
            pose=Pose((x + 0.02 * k, y + 0.01 * (k % 3), z + height), HOME.quaternion),
            twist=twist,
        )
        for k in range(first, first + count)
    )


def opened(execution=ExecutionMode.SPLINE, **fields):
    """The first six points of a goal; the sixth is due at 1.2 s."""
    goal = Goal(
        waypoints=points(1, 6),
        **{'keep_open': True, 'replace_horizon': 0.15, 'execution': execution} | fields,
    )
    return plan_first_part(plan(goal, STATE, ARM, OPTIONS), ARM, OPTIONS)


def replaced(part, *, from_rest=False, **appended):
    return plan_append(
        part.next_goal, AppendedPoints(**appended), ARM, OPTIONS, from_rest=from_rest
    )


@pytest.mark.parametrize('execution', [ExecutionMode.SPLINE, ExecutionMode.SERVO])
@pytest.mark.parametrize('cut', [0.01, 0.3, 0.41, 0.6, 0.793, 1.19])
def test_position_velocity_and_acceleration_go_on_at_the_cut(execution, cut):
    before = opened(execution)
    after = replaced(before, waypoints=points(8, 4, height=0.01), replace_from_time=cut)
    at = after.cut_time
    assert cut - 1e-9 <= at <= cut + 0.008, 'no piece is shorter than a cycle'
    for old, new in zip(before.spline.at(at), after.spline.at(at), strict=True):
        assert new == pytest.approx(old, abs=1e-9)
    first = after.start_time
    for time in np.linspace(first, at, 7)[:-1].tolist():
        assert after.spline.at(time)[0] == pytest.approx(before.spline.at(time)[0], abs=1e-9)
    along = np.linspace(first, float(after.spline.times[-1]), 4001)
    _, _, accelerations = after.spline.rows(along)
    assert np.abs(np.diff(accelerations[1:-1], axis=0)).max() < 0.5, 'no point is a jump'
    assert after.plan.reference.time[0] == pytest.approx(first, abs=1e-6)


def test_points_are_numbered_from_the_first_that_is_replaced():
    before = opened()
    by_time = replaced(before, waypoints=points(5, 3), replace_from_time=0.5)
    by_point = replaced(before, waypoints=points(5, 3), replace_from_point=2)
    assert by_time.next_goal.points == by_point.next_goal.points == 5
    assert (by_time.cut_time, by_point.cut_time) == (pytest.approx(0.5), pytest.approx(0.4))
    assert by_point.text.startswith('3 points appended, the goal has 5.')
    assert by_point.plan.segments[0].waypoint == 2
    again = replaced(by_time, waypoints=points(6, 2), replace_from_time=0.6)
    assert again.next_goal.points == 4, 'the new tail can be replaced in its turn'
    behind = replaced(before, waypoints=points(7, 1), replace_from_point=6)
    later = replaced(before, waypoints=points(9, 1), replace_from_time=1.5)
    assert behind.cut_time is later.cut_time is None, 'nothing is there to replace'
    assert behind.next_goal.points == later.next_goal.points == 7


def test_records_go_on_behind_those_that_stay():
    before = opened()
    ends = np.cumsum([segment.duration for segment in before.plan.segments])
    for cut in 0.1, 0.5, 0.9:
        after = replaced(before, waypoints=points(8, 2), replace_from_time=cut)
        kept = int(np.searchsorted(ends, cut + 1e-9))
        assert after.records_before == kept
        assert after.start_time == pytest.approx(ends[kept - 1] if kept else 0.0)


@pytest.mark.parametrize(
    ('appended', 'error', 'text'),
    [
        ({'replace_from_point': 7}, InvalidGoal, 'replace_from_point is 7, but the goal has 6 p'),
        ({'replace_from_point': -1}, InvalidGoal, 'replace_from_point is -1, but'),
        ({'replace_from_time': nan}, InvalidGoal, 'replace_from_time contains nan'),
        ({'replace_from_point': 2, 'replace_from_time': 0.5}, InvalidGoal, 'and replace_from_ti'),
        (
            {'replace_from_time': -0.5},
            AlreadySent,
            'replace from point 1 or from 0.000 s on, or later',
        ),
        ({'replace_from_time': 1.1}, InvalidGoal, r'is 1 s, not later than the 1.1 s where the'),
    ],
)
def test_what_cannot_be_replaced_is_refused(appended, error, text):
    with pytest.raises(error, match=text):
        replaced(opened(), waypoints=points(5, 1), **appended)


def test_motions_of_the_robot_cannot_be_replaced():
    goal = Goal(
        waypoints=tuple(replace(point, twist=(0.0,) * 6, time=0.0) for point in points(1, 3)),
        segments=(Segment(velocity=0.1),) * 3,
        keep_open=True,
    )
    part = plan_first_part(plan(goal, STATE, ARM, OPTIONS), ARM, OPTIONS)
    with pytest.raises(NotAvailable, match='which PRIMITIVES sends, cannot be planned from the'):
        replaced(part, waypoints=goal.waypoints[:1], replace_from_point=2)


def test_outputs_of_replaced_points_go_and_the_others_stay():
    def switch(point, pin, offset=0.0):
        return IOCommand(
            waypoint=point,
            offset=offset,
            output=OutputKind.STANDARD_DIGITAL,
            pin=pin,
            value=1.0,
        )

    commands = switch(0, 0), switch(1, 1, 0.15), switch(3, 2)
    before = opened(io_commands=commands)
    # Point 1 is due at 0.4 s, its output at 0.55 s: behind the cut.
    after = replaced(
        before,
        waypoints=points(6, 3),
        io_commands=(switch(3, 3),),
        replace_from_time=0.5,
    )
    records = [each for segment in before.plan.segments for each in (segment, *segment.outputs)]
    stay = [
        record.pin
        for record in records[: after.records_before]
        if isinstance(record, SwitchOutput)
    ]
    new = [output.pin for segment in after.plan.segments for output in segment.outputs]
    assert (stay, new) == ([0], [1, 3])


def test_what_is_passed_is_forgotten_and_what_is_possible_is_known():
    part = opened()
    assert first_replaceable(part.next_goal, 0.25) == (2, 0.25)
    assert first_replaceable(part.next_goal, 0.4) == (2, 0.4)
    assert first_replaceable(part.next_goal, 3.0) == (6, 3.0)
    for k in range(40):
        time = 0.3 + 0.05 * k
        appended = AppendedPoints(waypoints=points(9 + k // 4, 3), replace_from_time=time)
        goal = without_passed(part.next_goal, time - 0.2)
        part = plan_append(goal, appended, ARM, OPTIONS, from_rest=False)
        assert len(part.next_goal.parts) < 20
    with pytest.raises(AlreadySent):
        cut_tail(part.next_goal, 0.3, ARM)
    assert cut_tail(part.next_goal, inf, ARM) is part.next_goal
    assert cut_time(part.next_goal, AppendedPoints()) == inf
