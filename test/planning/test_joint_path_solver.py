# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Obstacles between the points: singularities, ranges, places out of reach, and corners."""

from __future__ import annotations

from dataclasses import replace
from math import hypot, pi
import re
from time import process_time
from typing import NamedTuple

from hypothesis import assume, example, given, settings
from hypothesis import strategies as st
import numpy as np
import pytest

from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.kinematics.closed_form import closed_form, wrist_centre
from ur_cartesian_driver.kinematics.ideal_arm import ideal_arm_of
from ur_cartesian_driver.kinematics.inverse import nearest
from ur_cartesian_driver.kinematics.robot_models import JOINT_NAMES
from ur_cartesian_driver.motion.errors import (
    GoalRefused,
    InvalidPosture,
    JointLimitExceeded,
    NearSingularity,
    TooFast,
    Unreachable,
)
from ur_cartesian_driver.motion.geometry.pose import Pose, pose_rows
from ur_cartesian_driver.motion.goal.goal import (
    Goal,
    Posture,
    Segment,
    SegmentType,
    Waypoint,
)
from ur_cartesian_driver.motion.plan.primitive import MoveJ, MoveL
from ur_cartesian_driver.planning import plan, PlanningOptions
from ur_cartesian_driver.planning.geometry.blended_path import BlendedPath, CurveRows
from ur_cartesian_driver.planning.geometry.curves import arc_faults, ArcRows, JointLineCurve
from ur_cartesian_driver.planning.geometry.samples import (
    CurvePieces,
    sample_parameters,
    STEP_ANGLE,
    STEP_LENGTH,
)
from ur_cartesian_driver.planning.preflight.joint_path_solver import solve_joint_path
from ur_cartesian_driver.planning.preflight.tcp_kinematics import TcpKinematics

TYPE = SegmentType
#: Where only the way of the arm counts.
FREE = PlanningOptions(max_approach_distance=0.0, self_collision='off')
NO_MARGINS = replace(
    FREE,
    singularity_margin_wrist=0.0,
    singularity_margin_elbow=0.0,
    singularity_margin_shoulder=0.0,
)


def refusal(error, cell, goal, options=FREE):
    with pytest.raises(error) as caught:
        plan(goal, cell.state, cell.arm, options)
    assert type(caught.value) is error
    return str(caught.value)


def fraction_in(text):
    """Return the place that a refusal names, as a fraction."""
    return float(re.search(r'pose, at ([\d.]+) % of its segment', text)[1]) / 100.0


class Line(NamedTuple):
    """A line between two poses."""

    start: Pose
    end: Pose

    @property
    def length(self):
        return self.start.distance_to(self.end)

    def pose(self, u):
        return self.start.interpolate(self.end, u)


def to(pose, **fields):
    return Goal(waypoints=(Waypoint(pose=pose, **fields),))


def across(make_cell, q_middle, aside, half=0.05):
    """
    Return a robot and the end of a line that passes the middle configuration's tool.

    :param aside: direction of the line in base axes (unit).
    """
    middle = make_cell(q_middle)
    start = middle.pose(*(-half * x for x in aside)) @ middle.T_flange_tcp.inverse()
    cell = make_cell(nearest(middle.arm, start, q_middle))
    return cell, middle.pose(*(half * x for x in aside))


def least_on_line(cell, end, measure, low=0.0, high=1.0):
    """Return where on the line to a pose a measure of the flange is least, by golden section."""
    line, back = Line(cell.home, end), cell.T_flange_tcp.inverse()

    def at(u):
        return measure(line.pose(u) @ back)

    for _ in range(60):
        a, b = low + 0.382 * (high - low), low + 0.618 * (high - low)
        low, high = (low, b) if at(a) < at(b) else (a, high)
    return 0.5 * (low + high), at(0.5 * (low + high))


# -- the three singularities ----------------------------------------------------------------------

WRIST = (0.0, -1.2, 1.6, -0.4 - pi / 2, 1e-4, 0.4)


def straightness(cell):
    """Return the least angle of wrist 2 among all solutions of a pose."""
    ideal = ideal_arm_of(cell.arm)
    return lambda flange: min(abs(np.arcsin(np.sin(q[4]))) for q in closed_form(ideal, flange))


def test_a_line_past_a_straight_wrist_is_refused_by_name_where_it_is_nearest(make_cell):
    cell, end = across(make_cell, WRIST, (0.0, 1.0, 0.0))
    u, angle = least_on_line(cell, end, straightness(cell), 0.3, 0.7)
    text = refusal(NearSingularity, cell, to(end))
    assert 'of the wrist singularity' in text
    assert 'less than singularity_margin_wrist = 0.05 rad' in text
    assert fraction_in(text) == pytest.approx(u, abs=0.001)
    assert float(re.search(r'within ([\d.e-]+) rad', text)[1]) == pytest.approx(angle, abs=2e-4)


def elbow(cell):
    """Return the angle of the elbow of a pose without a turn of the base, -1 where none is."""
    ideal, pan = ideal_arm_of(cell.arm), cell.state.actual_q[0]
    return lambda flange: min(
        (abs(q[2]) for q in closed_form(ideal, flange) if abs(q[0] - pan) < 0.5), default=-1.0
    )


def stretching(make_cell, angle):
    """Return a robot and the pose straight away from its shoulder at which the elbow has it."""
    q = (0.4, -0.9, 0.4, -1.2, -1.3, 0.2)
    cell = make_cell(q)
    away = np.array(wrist_centre(ideal_arm_of(cell.arm), cell.arm.forward(q)))
    away /= np.linalg.norm(away)
    back, low, high = cell.T_flange_tcp.inverse(), 0.0, 0.05
    for _ in range(50):
        way = 0.5 * (low + high)
        bent = elbow(cell)(cell.pose(*(way * away)) @ back) > angle
        low, high = (way, high) if bent else (low, way)
    return cell, cell.pose(*(high * away))


def test_a_line_to_a_stretched_arm_is_refused_as_elbow_where_it_is_nearest(make_cell):
    cell, end = stretching(make_cell, 0.02)
    text = refusal(NearSingularity, cell, to(end))
    assert text.startswith('trajectory.points[0].pose comes within 0.02 rad of the elbow')
    plan(to(end), cell.state, cell.arm, replace(FREE, singularity_margin_elbow=0.019))
    plan(to(end), cell.state, cell.arm, NO_MARGINS)


def test_a_line_beyond_the_stretched_arm_ends_where_it_is_stretched(make_cell):
    cell, stretched = stretching(make_cell, 0.0)
    whole = Line(cell.home, stretched)
    text = refusal(NearSingularity, cell, to(whole.pose(2.0)), NO_MARGINS)
    assert 'lies behind the elbow singularity' in text
    assert fraction_in(text) == pytest.approx(0.5, abs=0.001)


def column_line(make_cell, beside):
    """Return a robot and a line whose wrist centre passes the axis of the base at a distance."""
    q = (0.3, -1.4, 1.1, -1.0, -1.4, 0.3)
    cell = make_cell(q)
    ideal = ideal_arm_of(cell.arm)
    x, y, _ = wrist_centre(ideal, cell.arm.forward(q))
    # The tangent from there to the circle about the axis.
    far, radius = hypot(x, y), abs(ideal.d4) + beside
    inwards = np.array((-x, -y)) / far
    angle = np.arcsin(radius / far)
    turned = np.array(
        (
            inwards[0] * np.cos(angle) - inwards[1] * np.sin(angle),
            inwards[0] * np.sin(angle) + inwards[1] * np.cos(angle),
        )
    )
    way = 2.0 * np.sqrt(far * far - radius * radius) * turned
    return cell, cell.pose(way[0], way[1])


def test_a_line_past_the_shoulder_is_refused_by_name_where_it_is_nearest(make_cell):
    cell, end = column_line(make_cell, 5e-4)
    ideal = ideal_arm_of(cell.arm)
    u, nearest_way = least_on_line(
        cell, end, lambda flange: hypot(*wrist_centre(ideal, flange)[:2])
    )
    assert nearest_way == pytest.approx(abs(ideal.d4) + 5e-4, abs=1e-6)
    text = refusal(NearSingularity, cell, to(end))
    assert 'of the shoulder singularity' in text
    assert fraction_in(text) == pytest.approx(u, abs=0.005)


def test_a_line_through_the_column_over_the_base_is_out_of_reach_where_it_enters(make_cell):
    cell, end = column_line(make_cell, -0.02)
    ideal, line = ideal_arm_of(cell.arm), Line(cell.home, end)
    back = cell.T_flange_tcp.inverse()
    low, high = 0.0, 0.5
    for _ in range(40):
        u = 0.5 * (low + high)
        low, high = (u, high) if closed_form(ideal, line.pose(u) @ back) else (low, u)
    text = refusal(Unreachable, cell, to(end), NO_MARGINS)
    assert fraction_in(text) == pytest.approx(low, abs=0.001)
    assert 'from the axis of the base' in text


@pytest.mark.parametrize('name', ['wrist', 'shoulder'])
def test_joint_moves_pass_singularities_and_may_replace_the_line(make_cell, name):
    cell, end = (
        across(make_cell, WRIST, (0.0, 1.0, 0.0))
        if name == 'wrist'
        else column_line(make_cell, 5e-4)
    )
    joint = replace(to(end), segments=(Segment(type=TYPE.JOINT),))
    assert isinstance(plan(joint, cell.state, cell.arm, FREE).segments[0].primitive, MoveJ)
    made = plan(to(end), cell.state, cell.arm, replace(FREE, on_posture_change='movej'))
    assert isinstance(made.segments[0].primitive, MoveJ)
    assert cell.tool(made.segments[0].joints).distance_to(end) < 1e-7
    assert made.remarks[0].startswith('point 0: JOINT instead of LINEAR (on_posture_change')
    assert f'of the {name} singularity' in made.remarks[0]
    assert 'there is no straight path' in made.segments[0].report_line


def test_a_line_in_a_run_that_becomes_a_joint_move_leaves_the_others_as_they_were(make_cell):
    cell, end = across(make_cell, WRIST, (0.0, 1.0, 0.0), half=0.1)
    line = Line(cell.home, end)
    poses = [line.pose(u) for u in (0.1, 0.2, 0.9, 1.0)]
    goal = Goal(
        waypoints=tuple(Waypoint(pose=pose) for pose in poses),
        segments=(Segment(), Segment(), Segment(blend_radius=0.002), Segment()),
    )
    made = plan(goal, cell.state, cell.arm, replace(FREE, on_posture_change='movej'))
    kinds = [type(segment.primitive) for segment in made.segments]
    assert kinds == [MoveL, MoveL, MoveJ, MoveL]
    for segment, pose in zip(made.segments, poses, strict=True):
        assert cell.tool(segment.joints).distance_to(pose) < 1e-7


def test_a_posture_behind_a_flip_says_which(make_cell):
    cell = make_cell((0.3, -1.2, 1.6, -2.0, -1.2, 0.4))
    names = {'elbow': (2, -1.6), 'wrist': (4, 1.2)}
    for name, (joint, value) in names.items():
        wanted = Posture(names=(JOINT_NAMES[joint],), values=(value,))
        text = refusal(InvalidPosture, cell, to(cell.pose(0.0, 0.05), posture=wanted))
        assert f'a flip of the {name}' in text


# -- starts ---------------------------------------------------------------------------------------


def test_a_robot_that_stands_near_a_singularity_may_leave_it_and_not_come_back(make_cell):
    cell, end = across(make_cell, WRIST, (0.0, 1.0, 0.0))
    line = Line(cell.home, end)
    near = line.pose(0.55) @ cell.T_flange_tcp.inverse()
    cell = make_cell(nearest(cell.arm, near, (0.0, -1.0, 1.0, -6.0, -0.01, 5.0)))
    assert 0.002 < abs(cell.state.actual_q[4]) < 0.02
    plan(to(end), cell.state, cell.arm, FREE)
    back = Goal(waypoints=(Waypoint(pose=end), Waypoint(pose=line.pose(0.6))))
    text = refusal(NearSingularity, cell, back)
    assert text.startswith('trajectory.points[1].pose comes within')


def test_the_first_millimetre_from_a_rest_does_not_count(make_cell):
    cell, end = across(make_cell, WRIST, (0.0, 1.0, 0.0))
    line = Line(cell.home, end)
    near = line.pose(0.56) @ cell.T_flange_tcp.inverse()
    cell = make_cell(nearest(cell.arm, near, (0.0, -1.0, 1.0, -6.0, -0.01, 5.0)))
    towards = Line(cell.home, line.pose(0.5))
    plan(to(towards.pose(0.0009 / towards.length)), cell.state, cell.arm, FREE)
    refusal(NearSingularity, cell, to(towards.pose(0.002 / towards.length)))


def test_a_corner_that_leads_out_of_a_joint_move_is_no_start_at_rest(make_cell):
    """Wrist 2 is straight where the corner begins: joints would turn by half a turn in it."""
    cell = make_cell((0.0, -pi / 2, pi / 2, -pi / 2, -pi / 2, 0.0))
    behind = make_cell((0.0, -pi / 2, pi / 2, -pi / 2, 0.3, 0.0))
    straight = make_cell((0.0, -pi / 2, pi / 2, -pi / 2, -1e-4, 0.0))
    radius = straight.home.distance_to(behind.home)
    goal = Goal(
        waypoints=(Waypoint(pose=behind.home), Waypoint(pose=behind.pose(0.0, -0.1, 0.0))),
        segments=(Segment(type=TYPE.JOINT, blend_radius=radius), Segment()),
    )
    text = refusal(NearSingularity, cell, goal)
    assert text.startswith('trajectory.points[0].pose, ')
    assert 'wrist' in text
    stopping = replace(goal, segments=(Segment(type=TYPE.JOINT), Segment()))
    plan(stopping, cell.state, cell.arm, FREE)


def test_a_margin_of_0_is_none(make_cell):
    cell, end = across(make_cell, (0.0, -1.2, 1.6, -0.4 - pi / 2, 0.03, 0.4), (0.0, 1.0, 0.0))
    assert 'wrist' in refusal(NearSingularity, cell, to(end))
    plan(to(end), cell.state, cell.arm, NO_MARGINS)


# -- ranges, reach, corners -----------------------------------------------------------------------


def test_a_joint_that_comes_to_the_end_of_its_range_is_named_with_the_place(make_cell):
    cell = make_cell((2 * pi - 0.1, -1.6, 1.6, -1.6, -1.57, 0.0))
    # A chord of the circle about the base, the tool turning with it.
    end = cell.tool((2 * pi + 0.2, -1.6, 1.6, -1.6, -1.57, 0.0))
    text = refusal(JointLimitExceeded, cell, to(end), NO_MARGINS)
    assert 'shoulder_pan_joint' in text
    assert fraction_in(text) == pytest.approx(1.0 / 3.0, abs=0.05)
    made = plan(to(end), cell.state, cell.arm, replace(NO_MARGINS, on_posture_change='movej'))
    assert cell.tool(made.segments[0].joints).distance_to(end) < 1e-7


def test_a_blended_corner_is_looked_at_and_not_the_point_that_it_leaves_out(make_cell):
    """The point lies in the column over the base; the corner stays clear of it, or does not."""
    cell, end = column_line(make_cell, 0.03)
    line = Line(cell.home, end)
    ideal = ideal_arm_of(cell.arm)
    middle = line.pose(0.5)
    centre = np.array(wrist_centre(ideal, middle @ cell.T_flange_tcp.inverse()))
    inwards = -centre[:2] / hypot(*centre[:2])
    blend = Pose(
        tuple(np.array(middle.position) + np.append(0.035 * inwards, 0.0)), middle.quaternion
    )

    def goal(radius):
        return Goal(
            waypoints=(Waypoint(pose=blend), Waypoint(pose=end)),
            segments=(Segment(blend_radius=radius), Segment()),
        )

    assert 'points[0].pose' in refusal(Unreachable, cell, goal(0.0), NO_MARGINS)
    wide = 0.9 * min(line.length, cell.home.distance_to(blend), blend.distance_to(end))
    assert len(plan(goal(wide), cell.state, cell.arm, NO_MARGINS).segments) == 2


def test_two_thousand_points_in_a_wrong_frame_are_refused_at_once(cell):
    geometry = cell.arm.geometry
    measured = Arm(cell.arm.model, replace(geometry, a=tuple(a - 2e-4 for a in geometry.a)))
    assert measured.calibrated
    state = replace(
        cell.state, actual_tcp_pose=measured.forward(cell.state.actual_q) @ cell.T_flange_tcp
    )
    goal = Goal(waypoints=tuple(cell.point(0.005 * i) for i in range(1, 2001)))
    begin = process_time()
    with pytest.raises(GoalRefused):
        plan(goal, state, measured, NO_MARGINS)
    assert process_time() - begin < 5.0


# -- speed ----------------------------------------------------------------------------------------


def test_a_peak_of_the_joints_between_coarse_places_counts(make_cell):
    cell, end = across(make_cell, (0.0, -1.2, 1.6, 1.5 * pi - 0.4, 0.004, 0.4), (0.0, 1.0, 0.0))
    text = refusal(TooFast, cell, to(end, time=3.0), NO_MARGINS)
    assert re.search(r'joint speed limits \(wrist_\d_joint at \d+ % of the segment\)', text)
    slow = plan(to(end, time=3.0), cell.state, cell.arm, replace(NO_MARGINS, on_too_fast='slow'))
    assert slow.duration > 3.0


# -- places ---------------------------------------------------------------------------------------


def path_of(curves, radius=0.0, fillet=False):
    """Return the path of two curves, with a blend between them if there is a radius."""
    start, end = (pose_rows([getattr(curve, at) for curve in curves]) for at in ('start', 'end'))
    path = BlendedPath(CurveRows(start, end))
    for k, curve in enumerate(curves):
        if not isinstance(curve, Line):
            path.curves.put_joint_line(k, curve)
    if radius > 0.0:
        path.make_blends(np.array([0]), np.array([radius]), np.array([radius]), np.array([fillet]))
    return path


def pieces_of(path, number, begin, end):
    return CurvePieces.of(path, 0, np.array(number), np.array(begin), np.array(end))


spots = st.tuples(*[st.floats(-0.1, 0.1)] * 3, *[st.floats(-0.3, 0.3)] * 3)


@settings(max_examples=20, deadline=None)
@example(a=(0.0, 0.0, 0.0625, 0.0, 0.0, 0.0), b=(0.0,) * 6, radius=0.0156, fillet=True)  # back
@example(a=(0.05, *(0.0,) * 5), b=(0.1, *(0.0,) * 5), radius=0.0156, fillet=True)  # straight on
@given(a=spots, b=spots, radius=st.floats(0.001, 0.02), fillet=st.booleans())
def test_places_are_dense_and_on_their_curves(cell, a, b, radius, fillet):
    first = Line(cell.home, cell.pose(*a[:3], turn=a[3:]))
    second = Line(first.end, cell.pose(*b[:3], turn=b[3:]))
    assume(min(first.length, second.length) > 2.5 * radius)
    path = path_of([first, second], radius, fillet)
    leave, join = path.u_leave[0], path.u_join[1]
    pieces = pieces_of(path, [0, 1, 2], [0.0, 0.0, join], [leave, 1.0, 1.0])
    piece, at = sample_parameters(pieces)
    poses = pieces.rows(piece, at)
    rows = np.concatenate([[cell.home.row()], poses])
    assert np.linalg.norm(np.diff(rows[:, :3], axis=0), axis=1).max() <= 2.0 * STEP_LENGTH + 1e-9
    dots = np.abs(np.einsum('ij,ij->i', rows[1:, 3:], rows[:-1, 3:]))
    assert 2.0 * np.arccos(np.minimum(1.0, dots)).max() <= 2.5 * STEP_ANGLE
    for k, t, pose in zip(piece, at, poses, strict=True):
        if k == 1:
            assert np.linalg.norm(pose[:3] - first.end.position) <= radius + 1e-9
            continue
        on_line = (first, second)[k // 2].pose(float(t)).row()
        assert np.allclose(on_line[:3], pose[:3], atol=1e-9)
        assert abs(np.dot(on_line[3:], pose[3:])) == pytest.approx(1.0)


@settings(max_examples=15, deadline=None)
@given(a=spots, b=spots)
def test_the_joints_of_many_places_are_those_of_each_after_the_other(cell, a, b):
    middle, end = (cell.pose(*spot[:3], turn=spot[3:]) for spot in (a, b))
    path = path_of([Line(cell.home, middle), Line(middle, end)])
    poses = middle, cell.pose(0.05, 0.02, 0.11), end
    start, via, last = (np.array([pose.row()]) for pose in poses)
    if not arc_faults(start, via, last, np.array([False])):
        arcs = ArcRows.through(start, via, last, np.array([False]))
        path.curves.put_arcs(np.array([1]), arcs)
    pieces = pieces_of(path, [0, 2], [0.0, 0.0], [1.0, 1.0])
    found = solve_joint_path(
        TcpKinematics(cell.arm, cell.T_flange_tcp), pieces, cell.state.actual_q
    )
    if found.refusal is not None:
        return
    q, back = cell.state.actual_q, cell.T_flange_tcp.inverse()
    for k, t, row in zip(found.piece, found.t, found.q, strict=True):
        q = nearest(cell.arm, pieces.pose(k, float(t)) @ back, q)
        assert np.abs(np.array(q) - row).max() < 1e-6


def test_a_corner_between_joint_moves_stays_in_joint_space(cell):
    q = np.array(cell.state.actual_q)
    way = JointLineCurve.between(cell.arm, cell.T_flange_tcp, tuple(q), tuple(q + 0.3))
    back = JointLineCurve.between(
        cell.arm,
        cell.T_flange_tcp,
        tuple(q + 0.3),
        tuple(q + np.array((0.5, 0.3, 0.2, 0.3, 0.3, 0.1))),
    )
    path = path_of([way, back], 0.02)
    rows = path.joint_rows(1, np.array((0.0, 1.0)))
    assert rows[0] == pytest.approx(way.joints(path.u_leave[0]))
    assert rows[1] == pytest.approx(back.joints(path.u_join[1]))
    assert 0.0 < path.blend_length[0] < 0.05


# -- the report -----------------------------------------------------------------------------------


def test_every_line_says_what_came_nearest_and_the_last_remark_the_least_of_all(cell):
    points = (cell.point(0.05), cell.point(0.05, 0.1), cell.point(0.0, 0.1))
    goal = Goal(
        waypoints=points,
        segments=(Segment(blend_radius=0.01), Segment(type=TYPE.JOINT), Segment()),
    )
    made = plan(goal, cell.state, cell.arm, FREE)
    for segment in made.segments:
        assert re.search(r'; margin [\d.]+ (rad|m) to the .* at \d+ %$', segment.report_line)
    assert 'to the limit of' in made.segments[1].report_line
    assert 'blend 10 mm' in made.segments[0].report_line
    assert made.remarks[-1].startswith('tightest margin: ')


def test_whatever_is_refused_is_a_sentence_about_a_place(make_cell):
    rng = np.random.default_rng(7)
    texts = []
    for _ in range(60):
        q = tuple(rng.uniform(-2.5, 2.5, 6))
        cell = make_cell(q)
        goal = to(cell.tool(tuple(np.array(q) + rng.uniform(-1.0, 1.0, 6))))
        try:
            plan(goal, cell.state, cell.arm, replace(FREE, on_too_fast='slow'))
        except GoalRefused as error:
            texts.append(str(error))
    place = re.compile(r'trajectory\.points\[0\]\.pose(, at [\d.]+ % of its segment,)? ')
    assert len(texts) > 10
    assert [text for text in texts if not place.match(text)] == []
