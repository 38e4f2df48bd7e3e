# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Plans follow the twin of an arm; the judge is a simulated arm that moves by drawn laws."""

from __future__ import annotations

from dataclasses import fields, replace
from random import Random

import numpy as np
import pytest
from twin_errors import (
    errors,
    goals,
    HOME,
    measured_twin,
    moving_time,
    off_path,
    plan_of,
    TOOL,
    true_twin,
    warm_robot,
)

from ur_cartesian_driver.motion.errors import CollisionPredicted, GoalRefused, TooFast
from ur_cartesian_driver.motion.goal.goal import Goal, Segment, SegmentType
from ur_cartesian_driver.motion.twin.laws import LAWS, MotionLaws
from ur_cartesian_driver.motion.twin.twin import ArmIdentity, Estimate, Twin
from ur_cartesian_driver.motion.twin.twin_file import twin_text
from ur_cartesian_driver.planning import plan, planner, PlanningOptions
from ur_cartesian_driver.planning.moves.segment_timing import SegmentTimings
from ur_cartesian_driver.planning.preflight.clearance import clearance_lines


@pytest.mark.slow
@pytest.mark.parametrize('seed', range(3))
def test_the_planned_time_is_that_of_the_arm(seed):
    found = errors(seed)
    for name, ((without, path_without), (time, path)) in found.items():
        assert abs(time) < 0.02, name
        assert abs(time) <= abs(without) + 0.004, name
        assert path < 0.0003, name
        assert path <= path_without + 0.00005, name
    worst = np.abs(list(found.values())).max(axis=0)
    assert (worst[0] > 10.0 * worst[1]).all()


def test_the_planned_blend_is_that_of_the_arm():
    true = true_twin(1, blend_begin=0.5, blend_speed_ratio=1.3)
    robot, twin = warm_robot(true), measured_twin(true, 1, error=0.002)
    goal = goals(robot.place(HOME, TOOL).actual_tcp_pose, 1)['lines with blends']
    distances, tolerances = [], []
    for used in (None, twin):
        made = plan_of(robot, goal, used)
        _, ran = moving_time(robot, made)
        distances.append(off_path(made, ran))
        tolerances.append(made.reference.blend_tolerance[:, 0].max())
    assert distances[0] > 0.001
    assert distances[1] < 0.00005
    # The robot's target may be as far from the blend as the tolerance says, not more.
    assert tolerances[1] < 0.02 * tolerances[0]
    assert distances[1] < tolerances[1] + 0.00005


# -- reports --------------------------------------------------------------------------------------


def twin_of(**values):
    return Twin(
        arm=ArmIdentity(model='ur5e', software='5.21.0', motion_version=1),
        date='2026-11-27',
        estimates={
            name: Estimate(
                value=value,
                interval=None if isinstance(value, str) else (0.99 * value, 1.01 * value),
            )
            for name, value in values.items()
        },
    )


BLENDS = {'blend_begin': 0.8, 'blend_shape': 'parabola', 'blend_speed_ratio': 1.2}


def two_lines(cell, radius=0.02):
    return Goal(
        waypoints=(cell.point(x=0.1), cell.point(x=0.1, y=0.1)),
        segments=(Segment(blend_radius=radius), Segment()),
    )


def report(cell, options, **goal):
    return '\n'.join(plan(two_lines(cell, **goal), cell.state, cell.arm, options).report)


def test_the_report_says_what_was_measured(cell):
    text = report(cell, PlanningOptions(twin=twin_of(**BLENDS)))
    assert (
        'planned as measured on this arm, 2026-11-27: blend_begin 0.8 (0.792 to 0.808), '
        'blend_shape parabola, blend_speed_ratio 1.2 (1.188 to 1.212)'
    ) in text
    assert 's off, by the intervals of the laws measured on this arm, 2026-11-27' in text
    assert 'assumed' not in text


def test_the_report_says_what_is_still_assumed(cell):
    for values in ({}, {'blend_begin': 0.8}, BLENDS | {'blend_shape': 'unknown'}):
        text = report(cell, PlanningOptions(twin=twin_of(**values)))
        assert 'is not published; planned as assumed for motion version 1' in text
    text = report(cell, PlanningOptions(twin=twin_of(idle_between_moves=0.01)), radius=0.0)
    assert 'this arm, 2026-11-27: idle_between_moves 0.01 s (0.0099 to 0.0101)' in text


def test_a_blend_of_unknown_shape_is_planned_as_assumed(cell):
    twin = twin_of(**BLENDS | {'blend_shape': 'unknown', 'turn_ratio': 3.0})
    options = PlanningOptions(twin=twin)
    made, assumed = (
        plan(two_lines(cell), cell.state, cell.arm, each) for each in (options, PlanningOptions())
    )
    assert options.laws == replace(MotionLaws(), turn_ratio=3.0, blend_shape='unknown')
    assert made.duration == assumed.duration
    assert made.report == assumed.report


def test_the_path_of_the_assumed_blends_is_checked_too_and_only_one_path_is_timed(
    cell, monkeypatch
):
    options, timed = PlanningOptions(twin=twin_of(**BLENDS)), []

    def timings(geometries, used, *others):
        timed.append(used.twin)
        return SegmentTimings(geometries, used, *others)

    def lines(arm, tips, used, *others):
        if used.twin is None:
            raise CollisionPredicted('The assumed blend is too close.')
        return clearance_lines(arm, tips, used, *others)

    monkeypatch.setattr(planner, 'SegmentTimings', timings)
    plan(two_lines(cell), cell.state, cell.arm, options)
    assert timed == [options.twin]
    monkeypatch.setattr(planner, 'clearance_lines', lines)
    with pytest.raises(CollisionPredicted, match='assumed'):
        plan(two_lines(cell), cell.state, cell.arm, options)


def test_the_arcs_of_process_follow_no_measured_law(cell):
    goal = two_lines(cell)
    goal = replace(
        goal,
        segments=tuple(replace(each, type=SegmentType.PROCESS) for each in goal.segments),
    )
    made, assumed = (
        plan(goal, cell.state, cell.arm, PlanningOptions(twin=twin))
        for twin in (twin_of(**BLENDS), None)
    )
    assert made.report == assumed.report


def test_a_twin_of_another_arm_is_named_and_not_used_unless_asked(cell):
    other = ArmIdentity(model='ur5e', serial_number='2', software='5.22.1', motion_version=2)
    options = PlanningOptions(twin=twin_of(**BLENDS), robot=other)
    text = report(cell, options)
    assert 'software 5.21.0, not 5.22.1 and motion version 1, not 2; the plan does not' in text
    plain = plan(two_lines(cell), cell.state, cell.arm, PlanningOptions())
    assert plan(two_lines(cell), cell.state, cell.arm, options).duration == plain.duration
    text = report(cell, replace(options, allow_other_twin=True))
    assert 'the plan follows it, because allow_other_twin is true' in text
    assert 'measured on another arm, 2026-11-27: blend_begin' in text


def test_a_twin_of_another_model_is_noticed_without_a_robot(cell):
    twin = replace(twin_of(**BLENDS), arm=ArmIdentity(model='ur10e'))
    text = report(cell, PlanningOptions(twin=twin))
    assert f'model ur10e, not {cell.arm.model.name}; the plan does not follow it' in text


def test_twin_file_is_read_and_refused_with_its_line(tmp_path):
    file = tmp_path / 'twin.yaml'
    twin = twin_of(**BLENDS)
    file.write_text(twin_text(twin))
    options = PlanningOptions(twin_file=str(file))
    assert options.twin == twin
    file.write_text(twin_text(twin).replace('blend_begin', 'blend_start'))
    assert replace(options, max_tool_speed=0.1).twin == twin
    assert replace(options, twin_file='').twin is None
    other = tmp_path / 'other.yaml'
    other.write_text(twin_text(twin_of()))
    assert replace(options, twin_file=str(other)).twin == twin_of()
    assert replace(options, twin=twin_of()).twin == twin_of()
    with pytest.raises(
        ValueError, match=r'^twin_file: .*twin\.yaml, line \d+: blend_start is no law'
    ):
        PlanningOptions(twin_file=str(file))
    file.write_text(twin_text(replace(twin, arm=ArmIdentity(model='ur5ee'))))
    with pytest.raises(ValueError, match=r"twin\.yaml, arm: There is no robot model 'ur5ee'"):
        PlanningOptions(twin_file=str(file))
    with pytest.raises(ValueError, match='which cannot be read: No such file'):
        PlanningOptions(twin_file=str(tmp_path / 'none.yaml'))


# -- bounds ---------------------------------------------------------------------------------------


def drawn_twin(seed):
    """Return a twin whose laws lie anywhere in their ranges."""
    random, values = Random(seed), {}
    for each in fields(MotionLaws):
        law = LAWS[each.name]
        if not law.choices and random.random() < 0.7:
            values[each.name] = random.uniform(law.low, law.high)
    return replace(twin_of(**values), arm=ArmIdentity(model='ur5'))


@pytest.mark.slow
@pytest.mark.parametrize('follows_twin', [True, False])
@pytest.mark.parametrize('seed', range(4))
def test_no_twin_makes_the_arm_faster_than_its_bounds(seed, follows_twin):
    """Neither an arm that moves by the laws of the twin, nor one by the assumed laws."""
    twin = drawn_twin(seed)
    robot = warm_robot(twin if follows_twin else None)
    bounds, ran = PlanningOptions(max_tool_speed=0.12, linear_velocity=5.0), 0
    limits = np.array(robot.controller.arm.model.max_joint_speed)
    for name, goal in goals(robot.place(HOME, TOOL).actual_tcp_pose, seed).items():
        segments = tuple(replace(each, velocity=0.0) for each in goal.segments)
        try:
            made = plan_of(robot, replace(goal, segments=segments), twin, bounds)
        except TooFast:  # by the time that this arm loses between moves
            assert name.endswith('times')
            continue
        _, run = moving_time(robot, made)
        places = np.array([pose.position for pose in run.poses])
        speeds = np.linalg.norm(np.diff(places, axis=0), axis=1) / robot.controller.cycle
        assert speeds.max() <= 0.12 * (1.0 + 1e-3), name
        joints = np.abs(np.diff(run.joints, axis=0)) / robot.controller.cycle
        assert (joints <= limits * (1.0 + 1e-3)).all(), name
        ran += 1
    assert ran >= 8


@pytest.mark.parametrize('begin', [0.05, 0.5, 0.99])
def test_a_plane_that_the_assumed_blend_crosses_still_refuses(cell, begin):
    """The measured blend keeps closer to the corner, and would pass beside the plane."""
    x, y, z = cell.state.actual_tcp_pose.position
    goal = two_lines(cell, radius=0.05)
    # The parabola passes the corner at 0.25 r from both lines; the plane lies between.
    normal = np.array((1.0, -1.0, 0.0)) / np.sqrt(2.0)
    corner = np.array((x + 0.1, y, z))
    place = corner - normal * 0.05 * 0.3
    plane = 'inside {} {} {} {} {} 0'.format(*place, *normal[:2])
    options = PlanningOptions(workspace_planes=(plane,))
    with pytest.raises(GoalRefused) as without:
        plan(goal, cell.state, cell.arm, options)
    with pytest.raises(GoalRefused) as with_twin:
        plan(goal, cell.state, cell.arm, replace(options, twin=twin_of(blend_begin=begin)))
    assert str(without.value) == str(with_twin.value)
