# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The band in which a path may give way, its frame, and the reasons to refuse it."""

from dataclasses import replace

import numpy as np
import pytest

from ur_cartesian_driver.motion.errors import (
    CollisionPredicted,
    InvalidGoal,
    NearSingularity,
    TooFast,
    Unreachable,
)
from ur_cartesian_driver.motion.geometry.pose import rotate
from ur_cartesian_driver.motion.goal.execution_modes import ExecutionMode
from ur_cartesian_driver.motion.goal.goal import Goal, PathOffset, Segment
from ur_cartesian_driver.planning import plan, PlanningOptions

OPTIONS = PlanningOptions(self_collision='off')
SIDEWAYS = PathOffset(limits=(0.0, 0.005, 0.004), speed=0.05, acceleration=0.5)


#: Who offsets the path: the driver its set-points, or the controller its motions.
both_modes = pytest.mark.parametrize(
    'mode', [ExecutionMode.SERVO, ExecutionMode.PRIMITIVES], ids=lambda mode: mode.name
)


def goal(*points, path_offset=SIDEWAYS, mode=ExecutionMode.SERVO, **fields):
    return Goal(waypoints=points, execution=mode, path_offset=path_offset, **fields)


def band_of(cell, *points, **fields):
    return plan(goal(*points, **fields), cell.state, cell.arm, OPTIONS).offset_band


@both_modes
def test_the_frame_is_that_of_the_controllers_own_offsets(cell, mode):
    band = band_of(cell, cell.point(y=0.1, time=2.0), mode=mode)
    tool_z = np.array(rotate(cell.home.quaternion, (0.0, 0.0, 1.0)))
    for row in (0, 100, -1):
        along, across, normal = band.axes[row]
        assert along == pytest.approx([0.0, 1.0, 0.0], abs=1e-9)
        expected = np.cross(along, tool_z)
        assert across == pytest.approx(expected / np.linalg.norm(expected), abs=1e-9)
        assert normal == pytest.approx(np.cross(along, across), abs=1e-9)
    assert normal @ tool_z < -0.9, 'out of the work'
    assert band.shift(1.0, (0.001, 0.002, 0.003)) == pytest.approx(
        0.001 * along + 0.002 * across + 0.003 * normal
    )


@both_modes
def test_the_offset_fades_out_before_the_end_and_before_a_corner(cell, mode):
    corner = cell.point(y=0.1, time=2.0), cell.point(x=0.1, y=0.1, time=4.0)
    band = band_of(cell, *corner, mode=mode)
    open_times = np.flatnonzero(band.is_open) * band.step
    assert open_times[0] == 0.0
    gaps = np.flatnonzero(np.diff(open_times) > 2 * band.step)
    ((last, first),) = [(open_times[k], open_times[k + 1]) for k in gaps]
    fading = 0.005 / 0.05 + 2 * 0.05 / 0.5
    assert 2.0 - 3 * fading < last < 2.0 - fading, 'in time'
    assert 2.0 < first < 2.5
    assert 4.0 - 3 * fading < open_times[-1] < 4.0 - fading
    # Straight on, nothing closes: not even where the arm rests.
    straight = cell.point(y=0.1, time=2.0), cell.point(y=0.2, time=4.5)
    rests = (Segment(dwell=0.5), Segment())
    band = band_of(cell, *straight, segments=rests, mode=mode)
    assert (np.diff(np.flatnonzero(band.is_open)) == 1).all()


@pytest.mark.parametrize('velocity', [0.0325, 0.0451])
def test_samples_close_together_near_a_corner_need_no_faster_joints(cell, velocity):
    there = cell.point(x=0.019, y=0.022, z=-0.026), cell.point(x=-0.013, y=-0.012, z=-0.029)
    segments = (Segment(velocity=velocity), Segment(velocity=2.0 * velocity))
    assert band_of(cell, *there, segments=segments, mode=ExecutionMode.PRIMITIVES)


def test_the_report_names_bounds_and_gaps(cell):
    made = plan(goal(cell.point(y=0.1, time=2.0)), cell.state, cell.arm, OPTIONS)
    (line,) = [line for line in made.report if line.startswith('path_offset')]
    assert 'up to 5 mm across, 4 mm normal, at 0.05 m/s and 0.5 m/s^2 along each' in line
    assert 'to 2.00 s' in line


@pytest.mark.parametrize(
    ('options', 'offset', 'error', 'text'),
    [
        (
            {'workspace_planes': ('table 0 0 {low} 0 0 1',)},
            {},
            CollisionPredicted,
            r'With a path offset of across -5 mm, normal -4 mm: trajectory\.points\[0\]\.pose, '
            r'at .* % of its segment: .* "table"',
        ),
        (
            {'singularity_margin_elbow': 1.0},
            {'limits': (0.0, 0.1, 0.1)},
            NearSingularity,
            r'With a path offset of across .* mm: .* the elbow singularity .*, less than',
        ),
        (
            {},
            {'limits': (0.0, 0.1, 0.1), 'speed': 0.1, 'acceleration': 2.0},
            TooFast,
            'With a path offset of .* would need .* rad/s of .*, more than its 0.150 rad/s',
        ),
    ],
    ids=['plane', 'singularity', 'joint speed'],
)
@both_modes
def test_a_band_in_which_the_arm_cannot_be_is_refused(cell, options, offset, error, text, mode):
    arm = cell.arm
    if error is TooFast:
        limits = (0.15,) * 6
        arm = type(arm)(replace(arm.model, max_joint_speed=limits), arm.geometry)
    low = cell.home.position[2] - 0.002
    options = {
        name: tuple(each.format(low=low) for each in value) if isinstance(value, tuple) else value
        for name, value in options.items()
    }
    # Closer to the stretched arm, but not too close without the offset.
    x = -0.15 if error is NearSingularity else 0.0
    end = cell.point(x=x, y=0.1, time=8.0)
    asked = goal(end, path_offset=replace(SIDEWAYS, **offset), mode=mode)
    with pytest.raises(error, match=text):
        plan(asked, cell.state, arm, replace(OPTIONS, **options))
    plan(replace(asked, path_offset=PathOffset()), cell.state, arm, replace(OPTIONS, **options))


@both_modes
def test_offsets_count_against_the_speed_of_the_tool(cell, mode):
    asked = goal(cell.point(y=0.1, time=2.0), mode=mode)  # up to 0.075 m/s
    with pytest.raises(
        TooFast, match=r'with offsets at up to 0\.1\d\d m/s, more than max_tool_speed'
    ):
        plan(asked, cell.state, cell.arm, replace(OPTIONS, max_tool_speed=0.12))
    for fine, bound in ((asked, 0.16), (replace(asked, path_offset=PathOffset()), 0.12)):
        plan(fine, cell.state, cell.arm, replace(OPTIONS, max_tool_speed=bound))


@both_modes
def test_a_self_collision_in_the_band_warns_once_where_it_does_not_refuse(cell, mode):
    options = replace(OPTIONS, self_collision='warn', min_clearance=0.08)
    made = plan(goal(cell.point(y=0.1, time=2.0), mode=mode), cell.state, cell.arm, options)
    (line,) = [line for line in made.report if line.startswith('with a path offset of')]
    assert 'come within' in line
    assert 'less than min_clearance = 0.0800 m' in line


@both_modes
def test_a_band_out_of_reach_is_refused(cell, mode):
    # Towards the stretched arm, as far as it may go.
    far = next(
        point
        for x in np.arange(-0.5, 0.0, 0.01)
        if (point := _reached(cell, cell.point(x=float(x), time=20.0)))
    )
    asked = goal(far, path_offset=PathOffset(limits=(0.1, 0.1, 0.1)), mode=mode)
    with pytest.raises((Unreachable, NearSingularity), match='With a path offset of along'):
        plan(asked, cell.state, cell.arm, OPTIONS)


def _reached(cell, point):
    try:
        plan(goal(point, path_offset=PathOffset()), cell.state, cell.arm, OPTIONS)
    except (Unreachable, NearSingularity):
        return None
    return point


@pytest.mark.parametrize(
    ('changes', 'time', 'text'),
    [
        ({}, 0.3, r'path_offset is not possible anywhere on this path of 0\.30 s'),
        ({'pure': True}, 2.0, 'path_offset is set, but the path has no direction across'),
    ],
)
def test_a_path_that_can_give_way_nowhere_is_refused(cell, changes, time, text):
    there = (
        cell.point(turn=(0.0, 0.0, 0.2), time=time) if changes else cell.point(y=0.01, time=time)
    )
    with pytest.raises(InvalidGoal, match=text):
        plan(goal(there), cell.state, cell.arm, OPTIONS)


def test_in_a_blend_the_path_gives_way_only_if_it_turns_slowly(cell):
    def gaps(radius, speed):
        segments = (
            Segment(velocity=speed, blend_radius=radius),
            Segment(velocity=speed),
        )
        points = cell.point(y=0.15), cell.point(x=0.15, y=0.15)
        band = band_of(cell, *points, segments=segments, mode=ExecutionMode.PRIMITIVES)
        return np.count_nonzero(np.diff(band.is_open.astype(int)) == -1)

    assert gaps(0.07, 0.02) == 1, 'the end'
    assert gaps(0.005, 0.1) == 2, 'the blend and the end'
