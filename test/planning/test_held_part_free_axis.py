# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
A free axis on a part that the arm holds: found where there is a rotation, judged by pinocchio.

Each path is made backwards, from a motion of the joints, and then turned about the axis at random.
"""

from dataclasses import dataclass, replace
from math import nan, pi, radians
from typing import Any

from curve_distance import distances
from free_axis_paths import free_path, OPTIONS, turned
from held_part_goals import frame_and_urdf
import numpy as np
import pytest
from random_cases import cases, random_of

from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.kinematics.robot_models import robot_model
from ur_cartesian_driver.motion.cell.cell import Cell, CellBody, PlacedShape
from ur_cartesian_driver.motion.cell.shapes import Box, Sphere
from ur_cartesian_driver.motion.errors import CollisionPredicted, Unreachable
from ur_cartesian_driver.motion.geometry.pose import Pose, quaternion_from_rotation_vector
from ur_cartesian_driver.motion.goal.execution_modes import ExecutionMode
from ur_cartesian_driver.motion.goal.goal import FreeAxis, Goal, Segment, SegmentType, Waypoint
from ur_cartesian_driver.planning import plan
from ur_cartesian_driver.planning.stop_prediction import state_at_rest

pytest.importorskip('pinocchio')

PARTS, PATHS = 4, 100
SPEED, DEVIATION, CORNER_ANGLE = 0.02, 5e-4, 0.02
#: The tool is at its points within this [m], and its axis within this [rad].
POSITION, TURN = 1e-4, radians(0.05)


@dataclass
class FreeHeld:
    """A path on a held part, and how the axis of the tool lies at its points."""

    path: Any
    goal: Goal
    urdf: Any
    column: int

    def axes(self, tool):
        """Return the free axes (n, 3) of poses (n, 4, 4) on the part."""
        return tool[:, :3, self.column]

    @property
    def given(self):
        """The poses (n, 4, 4) that the goal gives."""
        return np.array([point.pose.matrix() for point in self.goal.waypoints])

    def tool(self, made, times):
        """Return the poses (n, 4, 4) of the tool on the part at times of a plan."""
        return self.urdf.relative('tool', 'part', made.joint_spline.rows(np.asarray(times))[0])


def free_held(random):
    """Return a path that has a solution: by times, or by speeds with rounded corners."""
    number, rounded = random.randrange(10**6), random.random() < 0.5
    path = free_path(number)
    rng = np.random.default_rng(number)
    to_flange = path.state.T_flange_tcp.inverse()
    flanges = [pose @ to_flange for pose in path.solution]
    # The tool stands amid the path of the hand, and the part is somewhere behind the flange.
    T_base_tool = path.solution[len(path.solution) // 2]
    T_flange_part = path.state.T_flange_tcp @ Pose(
        tuple(rng.uniform(-0.03, 0.03, 3).tolist()),
        quaternion_from_rotation_vector(rng.normal(size=3).tolist()),
    )
    frame, urdf = frame_and_urdf(path.arm, T_flange_part, T_base_tool)
    axis = path.goal.segments[0].free_axis
    poses = [
        turned(frame.tool(flange), axis, turn)
        for flange, turn in zip(flanges, path.turns, strict=True)
    ]
    starts = [frame.tool(path.state.actual_tcp_pose @ to_flange), *poses]
    times = np.cumsum(
        [max(0.5, a.distance_to(b) / SPEED) for a, b in zip(starts, poses, strict=False)]
    )
    goal = Goal(
        moving_frame=frame,
        controlled_frame='tool',
        waypoints=tuple(
            Waypoint(pose=pose)
            if rounded
            else Waypoint(
                pose=pose, time=time, twist=(nan,) * 6 if k + 1 < len(poses) else (0.0,) * 6
            )
            for k, (pose, time) in enumerate(zip(poses, times.tolist(), strict=True))
        ),
        segments=(
            Segment(
                type=SegmentType.LINEAR if rounded else SegmentType.AUTO,
                velocity=SPEED if rounded else 0.0,
                free_axis=axis,
            ),
        )
        * len(poses),
        corner_deviation=DEVIATION if rounded else 0.0,
        corner_angle=CORNER_ANGLE if rounded else 0.0,
        execution=ExecutionMode.SPLINE,
    )
    return FreeHeld(path, goal, urdf, axis - 1)


@pytest.mark.random
@pytest.mark.parametrize('part', range(PARTS))
def test_a_rotation_is_found_on_a_held_part_where_there_is_one(part):
    random, count, found = random_of('held free axis', part), cases(PATHS // PARTS), 0
    for _ in range(count):
        case = free_held(random)
        try:
            made = plan(case.goal, case.path.state, case.path.arm, OPTIONS)
        except Unreachable:
            continue  # a corner may lead beside the end of the reach
        remark = next(line for line in made.remarks if line.startswith('free axis'))
        if 'as given' in remark:
            continue
        found += 1
        if case.goal.corner_deviation:
            check_rounded(case, made)
        else:
            check_timed(case, made)
    assert found >= 0.9 * count - 1


def check_timed(case, made):
    """At its time each point is met by position and axis."""
    tool = case.tool(made, [point.time for point in case.goal.waypoints])
    assert np.abs(tool[:, :3, 3] - case.given[:, :3, 3]).max() <= POSITION
    assert angles(case.axes(tool), case.axes(case.given)).max() <= TURN


def check_rounded(case, made):
    """The tool is on the lines of the path, and passes its points with their axes."""
    tool = case.tool(made, np.arange(0.0, made.duration, 0.004))
    path = np.concatenate([tool[:1], case.given])[:, :3, 3]
    assert distances(tool[:, :3, 3], [path]).max() <= DEVIATION + 1e-5
    for given in case.given:
        off = np.linalg.norm(tool[:, :3, 3] - given[:3, 3], axis=1)
        near = tool[off <= off.min() + 2e-3]
        between = angles(case.axes(near), case.axes(given[None])).min()
        assert between <= CORNER_ANGLE + TURN
    end = case.tool(made, [made.duration])
    assert np.abs(end[:, :3, 3] - path[-1]).max() <= POSITION
    assert angles(case.axes(end), case.axes(case.given[-1:])).max() <= TURN


def angles(a, b):
    """Return the angles (n,) between unit vectors (n, 3)."""
    return np.arctan2(np.linalg.norm(np.cross(a, b), axis=1), np.sum(a * b, axis=1))


def test_a_body_in_the_hand_counts_in_the_choice():
    """As given, the part is turned into a post; turned back about the axis, it passes."""
    arm, q = Arm(robot_model('ur5e')), (0.0, -pi / 2, pi / 2, -pi / 2, -pi / 2, 0.0)
    part = Pose((0.0, 0.0, 0.1))
    begin = Pose((0.02, 0.0, 0.0), quaternion_from_rotation_vector((pi, 0.0, 0.0)))
    frame, urdf = frame_and_urdf(arm, part, arm.forward(q) @ part @ begin)
    end = turned(begin @ Pose((0.0, 0.05, 0.0)), FreeAxis.Z, pi / 2)
    stick = CellBody(
        name='stick',
        shapes=(PlacedShape(Box((0.3, 0.02, 0.02)), Pose((0.15, 0.0, 0.1))),),
        frame='tool0',
    )
    tip = frame.flange(end) @ Pose((0.28, 0.0, 0.1))
    post = CellBody(name='post', shapes=(PlacedShape(Sphere(0.02), Pose(tip.position)),))
    options = replace(OPTIONS, cell=Cell(bodies=(stick, post)))
    goal = Goal(
        waypoints=(Waypoint(pose=end),),
        segments=(Segment(velocity=0.05),),
        corner_deviation=DEVIATION,
        moving_frame=frame,
        controlled_frame='tool',
    )
    start = state_at_rest(arm, q)
    with pytest.raises(CollisionPredicted, match='stick and post'):
        plan(goal, start, arm, options)
    free = replace(goal, segments=(Segment(velocity=0.05, free_axis=FreeAxis.Z),))
    made = plan(free, start, arm, options)
    tool = urdf.relative('tool', 'part', np.array([made.segments[-1].joints]))
    assert np.abs(tool[0, :3, 3] - end.position).max() <= POSITION
    assert angles(tool[:, :3, 2], np.array([end.matrix()[:3, 2]])).max() <= TURN
