# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Paths on a part that the arm holds before a fixed tool, judged by pinocchio on our URDF."""

from collections import Counter
from dataclasses import replace
from functools import lru_cache
from math import radians
from random import Random

from curve_distance import distances
from held_part_goals import (
    held_case,
    measure,
    measure_trace,
    MODELS,
    off_path,
    rounded_goal,
    spline_goal,
    spline_poses,
    STEP,
    turned_by,
)
import numpy as np
import pytest
from random_cases import cases, random_of
from robot_in_memory import RobotInMemory

from ur_cartesian_driver.kinematics.robot_models import robot_model
from ur_cartesian_driver.motion.errors import (
    GoalRefused,
    JointLimitExceeded,
    NearSingularity,
    TooFast,
    Unreachable,
)
from ur_cartesian_driver.motion.geometry.pose import IDENTITY
from ur_cartesian_driver.planning import plan, PlanningOptions
from ur_cartesian_driver.planning.append.append_planner import plan_append, plan_first_part
from ur_cartesian_driver.planning.append.appendable_goal import AppendedPoints
from ur_cartesian_driver.planning.stop_prediction import state_at_rest
from ur_cartesian_driver.sim.calibration import random_calibration

pytest.importorskip('pinocchio')

OPTIONS = PlanningOptions(self_collision='off', max_approach_distance=2.0)
PARTS = 5
#: What refuses a random goal rightly: the arm cannot be there.
EXPLAINED = (Unreachable, NearSingularity, JointLimitExceeded)
#: The tool is on its path within this [m], [rad].
POSITION, TURN = 1e-4, radians(0.05)
#: Speeds and limits are kept within this part.
PART = 0.02
#: The feed may be lower where something is this near its limit, so long before or after [s].
BINDS, AROUND = 0.8, 0.1
#: Pieces may leave the path by micrometres, which changes the speed by so much [m/s]; below the
#: second speed this is more than that part.
PIECES, SLOW = 6e-4, 0.02
#: The widest corner: a time at the greatest speed [s], but no less than [m].
WIDEST, SLOW_WIDTH = 0.3, 0.002


def planned(case, options=OPTIONS):
    return plan(case.goal, state_at_rest(case.arm, case.state.actual_q), case.arm, options)


@pytest.mark.random
@pytest.mark.parametrize('part', range(PARTS))
def test_rounded_paths_on_parts_keep_path_feed_and_limits(part):
    random, refused, count = random_of('held rounded', part), Counter(), cases(350 // PARTS)
    judged = 0
    for _ in range(count):
        case = held_case(random, rounded_goal)
        try:
            made = planned(case)
        except EXPLAINED as error:
            refused[type(error)] += 1
            continue
        seen = measure(case, made, OPTIONS)
        assert off_path(case, seen).max() <= case.goal.corner_deviation + 1e-6, case
        for limited in (seen.joint_speed, seen.joint_acceleration, seen.carrier):
            assert limited.max() <= 1.0 + PART, case
        inner = slice(2, -2)
        assert seen.acceleration[inner].max(initial=0.0) <= 1.0 + PART, case
        assert seen.turn_acceleration[inner].max(initial=0.0) <= 1.0 + PART, case
        assert seen.jerk[inner].max(initial=0.0) <= 1.0 + PART, case
        judged += check_feed(case, made, seen)
        end = case.goal.waypoints[-1].pose.matrix()
        assert np.linalg.norm(seen.tool[-1, :3, 3] - end[:3, 3]) < POSITION
        assert turned_by(seen.tool[-1, :3, :3], end[:3, :3]) < TURN
    assert sum(refused.values()) <= 0.6 * count + 2, refused
    # Of a tenth of the cases, none may have a stretch at its feed.
    assert judged > 0 or count < 50


def check_feed(case, made, seen, step=STEP):
    """
    Compare the feed on the part with what was asked, and return how many samples were compared.

    :param step: distance of the samples [s].

    It is never higher. It is not lower either in the middle of a segment, away from the ramps and
    the widest corners at its ends, unless something is near its limit.
    """
    t = step * np.arange(len(seen.speed))
    row = np.clip(np.searchsorted(made.reference.time, t), 0, len(made.reference.time) - 1)
    segment = made.reference.point[row]
    lengths = np.array(
        [a.distance_to(b.pose) for a, b in zip(case.starts, case.goal.waypoints, strict=True)]
    )
    asked = np.array([min(each.velocity, OPTIONS.max_tool_speed) for each in case.goal.segments])
    highest = np.where(lengths > 1e-6, asked, OPTIONS.linear_velocity).max()
    assert seen.speed.max() <= (1.0 + PART) * highest + PIECES, case
    accelerations = np.array([each.acceleration or 1.0 for each in case.goal.segments])
    ends = SLOW_WIDTH + WIDEST * asked.max() + asked**2 / np.minimum(accelerations, 1.0)
    from_ends = np.minimum(
        *(
            np.linalg.norm(
                seen.tool[:, :3, 3] - np.array([each.position for each in poses])[segment], axis=1
            )
            for poses in (case.starts, [point.pose for point in case.goal.waypoints])
        )
    )
    reach = int(AROUND / step)
    around = np.convolve(seen.near_limits > BINDS, np.ones(2 * reach + 1))[reach:-reach] > 0.0
    judged = (from_ends > ends[segment]) & ~around
    lowest = (1.0 - PART) * asked[segment] - PIECES
    assert np.all(seen.speed[judged] >= lowest[judged]), case
    return int(judged.sum())


@pytest.mark.random
@pytest.mark.parametrize('part', range(PARTS))
def test_splines_on_parts_are_where_their_times_say(part):
    random, refused, count = random_of('held splines', part), Counter(), cases(150 // PARTS)
    # Pieces of joint cubics are that close to the path; their speeds follow from it.
    options = replace(OPTIONS, max_tool_speed=2.0, spline_tolerance=1e-5)
    for _ in range(count):
        case = held_case(random, spline_goal)
        try:
            made = planned(case, options)
        except (*EXPLAINED, TooFast) as error:
            refused[type(error)] += 1
            continue
        seen = measure(case, made, options)
        t = STEP * np.arange(len(seen.speed))
        off = np.linalg.norm(seen.tool[:, :3, 3] - spline_poses(case, t), axis=1)
        assert off.max() <= POSITION, case
        asked = np.linalg.norm(np.gradient(spline_poses(case, t), STEP, axis=0), axis=1)
        fast = asked > SLOW
        assert np.all(np.abs(seen.speed - asked)[fast] <= PART * asked[fast]), case
        for waypoint in case.goal.waypoints:
            q = made.joint_spline.rows(np.array([waypoint.time]))[0]
            at, wanted = case.relative(q)[0], waypoint.pose.matrix()
            assert np.linalg.norm(at[:3, 3] - wanted[:3, 3]) <= POSITION, case
            assert turned_by(at[:3, :3], wanted[:3, :3]) <= TURN, case
        assert seen.joint_speed.max() <= 1.0 + PART
        assert seen.joint_acceleration.max() <= 1.0 + PART
        assert seen.carrier.max() <= 1.0 + PART
    assert sum(refused.values()) <= 0.6 * count + 2, refused


@lru_cache
def robot_of(name, is_calibrated):
    """Return a robot in memory, with the cycle of CB3, because the tests pay each."""
    geometry = random_calibration(robot_model(name), 7) if is_calibrated else None
    return RobotInMemory(name, frequency=125.0, geometry=geometry)


@pytest.mark.random
@pytest.mark.timeout(3600)
@pytest.mark.parametrize('is_calibrated', [False, True])
@pytest.mark.parametrize('name', MODELS)
def test_the_target_joints_of_the_robot_lead_the_part_along_its_path(name, is_calibrated):
    """By pinocchio on the joints of all cycles of the simulated controller."""
    robot = robot_of(name, is_calibrated)
    cycle, random = robot.controller.cycle, random_of('held trace', name, is_calibrated)
    options = replace(OPTIONS, max_tool_speed=2.0, spline_tolerance=1e-5)
    ran, judged, count = 0, 0, cases(504 // (2 * len(MODELS)))
    for number in range(count):
        is_spline = number % 3 == 2
        case = held_case(random, spline_goal if is_spline else rounded_goal, robot.controller.arm)
        robot.place(case.state.actual_q, IDENTITY)
        try:
            made = planned(case, options if is_spline else OPTIONS)
        except (*EXPLAINED, TooFast):
            continue
        run = robot.run(list(made.instructions))
        assert run.failure == '', case
        # The program reads the first piece some cycles after the start.
        rests = np.abs(np.diff(run.joints, axis=0)).max(axis=1) < 1e-12
        first = int(np.argmin(rests))
        q = run.joints[first:]
        seen = measure_trace(case, q, cycle, options if is_spline else OPTIONS)
        assert seen.joint_speed.max() <= 1.0 + PART, case
        ran += 1
        if is_spline:
            wanted = spline_poses(case, np.linspace(0.0, case.goal.waypoints[-1].time, 4000))
            off = distances(seen.tool[:, :3, 3], [wanted])
        else:
            off = off_path(case, seen) - case.goal.corner_deviation
            judged += check_feed(case, made, seen, cycle)
        assert off.max() <= POSITION, case
        at, wanted = seen.tool[-1], case.goal.waypoints[-1].pose.matrix()
        assert np.linalg.norm(at[:3, 3] - wanted[:3, 3]) <= POSITION, case
        assert turned_by(at[:3, :3], wanted[:3, :3]) <= TURN, case
    assert ran >= max(1, 0.4 * count - 2)
    # Of a tenth of the cases, none may have a stretch at its feed.
    assert judged > 0 or ran < 10


def test_the_same_path_from_both_sides_is_the_same_relative_path():
    """Once the tool moves on a part that stands, once the part moves before a tool that stands."""
    # One case for all seeds: in others a joint's limit binds on one side, and the times differ.
    random = Random('both sides')
    case = held_case(random, rounded_goal)
    while len(case.goal.waypoints) < 4:
        case = held_case(random, rounded_goal)
    start = state_at_rest(case.arm, case.state.actual_q)
    flange = case.arm.forward(case.state.actual_q)
    # Nothing but the goal's own speeds and accelerations binds: the motions take the same time.
    slow = replace(
        case.goal,
        segments=tuple(
            replace(each, velocity=0.1 * each.velocity, acceleration=0.2)
            for each in case.goal.segments
        ),
    )
    options = replace(OPTIONS, max_tool_speed=0.0)
    moves = plan(slow, start, case.arm, options)
    # The part stands where the tool would be, and the flange carries the tool: P is the same.
    T_flange_tool = case.frame.T_flange_frame
    T_base_part = flange @ T_flange_tool @ case.state.actual_tcp_pose.inverse()
    stands = plan(
        replace(
            slow,
            moving_frame=None,
            T_base_frame=T_base_part,
            T_flange_controlled=T_flange_tool,
            controlled_frame='tool',
        ),
        start,
        case.arm,
        options,
    )
    assert moves.duration == pytest.approx(stands.duration, rel=0.02)
    # Both keep the same rounded path; the law differs by the rounding of its pieces.
    t = np.linspace(0.0, min(moves.duration, stands.duration), 400)
    one = case.relative(moves.joint_spline.rows(t)[0])
    q = stands.joint_spline.rows(t)[0]
    T_part_base = np.linalg.inv(T_base_part.matrix())
    tool = case.urdf.relative('part', 'base', q)  # the frame that the flange carries
    other = T_part_base @ tool
    at_ends = [0, -1]
    np.testing.assert_allclose(one[at_ends], other[at_ends], atol=1e-3)
    apart = distances(one[:, :3, 3], [other[:, :3, 3]])
    assert apart.max() < 2.0 * POSITION


def test_exchanged_frames_are_pointed_out():
    """A path that begins where the arm is, with part and tool exchanged, begins elsewhere."""
    case = held_case(random_of('exchanged'), rounded_goal)
    start = state_at_rest(case.arm, case.state.actual_q)
    assert not [line for line in planned(case).remarks if line.startswith('check the frames')]
    exchanged = replace(
        case.goal,
        moving_frame=None,
        T_base_frame=case.frame.T_base_tool,
        T_flange_controlled=case.frame.T_flange_frame,
        controlled_frame='part',
    )
    with pytest.raises(
        GoalRefused, match=r'\(with header.frame_id and controlled_frame exchanged'
    ):
        plan(exchanged, start, case.arm, replace(OPTIONS, max_approach_distance=0.02))


def test_points_appended_on_a_part_continue_the_path_on_it():
    random, options = random_of('held appended'), replace(OPTIONS, max_tool_speed=2.0)
    case = held_case(random, spline_goal)
    while len(case.goal.waypoints) < 4:
        case = held_case(random, spline_goal)
    start, points = state_at_rest(case.arm, case.state.actual_q), case.goal.waypoints
    opened = plan(
        replace(case.goal, waypoints=points[:2], keep_open=True), start, case.arm, options
    )
    first = plan_first_part(opened, case.arm, options)
    rest = AppendedPoints(waypoints=points[2:], last=True)
    made = plan_append(first.next_goal, rest, case.arm, options, from_rest=False)
    end = case.relative(np.array([made.plan.segments[-1].joints]))[0]
    np.testing.assert_allclose(end, points[-1].pose.matrix(), atol=1e-6)
    whole = planned(case, options).segments[-1].joints
    assert made.plan.segments[-1].joints == pytest.approx(whole, abs=1e-6)
