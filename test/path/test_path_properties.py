# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Random paths: nothing is lost on the way through messages and files, and modifiers are mathematics.

``PATHS`` sets how many are planned (500 in CI), of the others a fifth of that is drawn.
"""

from dataclasses import replace
from math import isfinite, pi
import os

from hypothesis import assume, event, given, HealthCheck, settings
from hypothesis import strategies as st
import numpy as np
import pytest

from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.kinematics.robot_models import JOINT_NAMES, robot_model
from ur_cartesian_driver.motion.errors import GoalRefused, InvalidGoal
from ur_cartesian_driver.motion.geometry.pose import quaternion_from_rotation_vector
from ur_cartesian_driver.path import (
    analog,
    AnalogDomain,
    configurable,
    digital,
    ExecutionMode,
    FREE,
    Path,
    Pose,
    tool_digital,
)
from ur_cartesian_driver.planning import plan, PlanningOptions
from ur_cartesian_driver.planning.stop_prediction import state_at_rest
from ur_cartesian_driver.sim.simulator_config import HOME

PATHS = int(os.environ.get('PATHS', '500'))
few = settings(max_examples=PATHS // 5, deadline=None, suppress_health_check=list(HealthCheck))

ARM = Arm(robot_model('ur5e'))
STATE = state_at_rest(ARM, HOME)
HERE = STATE.actual_tcp_pose
OUTPUTS = (
    digital(2),
    configurable(1),
    tool_digital(0),
    analog(1),
    analog(0, AnalogDomain.VOLTAGE),
)

small = st.floats(-0.15, 0.15)
steps = st.tuples(small, small, small)
angles = st.floats(-1.5, 1.5)
turns = st.one_of(
    st.just((0.0, 0.0, 0.0, 1.0)),
    st.tuples(angles, angles, angles).map(quaternion_from_rotation_vector),
)
poses = st.builds(Pose, steps, turns)
postures = st.one_of(
    st.none(), st.dictionaries(st.sampled_from(JOINT_NAMES), st.floats(-pi, pi), max_size=6)
)
rates = st.one_of(
    st.just(FREE),
    st.just((0.0,) * 6),
    st.tuples(*[st.floats(-0.2, 0.2)] * 6),
    st.tuples(*[st.floats(-0.2, 0.2)] * 3),
)
durations = st.floats(0.01, 10.0)
feeds = st.fixed_dictionaries(
    {},
    optional={
        'speed': st.floats(0.001, 0.5),
        'acceleration': st.floats(0.01, 5.0),
        'blend': st.floats(0.0, 0.05),
        'joint_speed': st.floats(0.01, 2.0),
        'joint_acceleration': st.floats(0.1, 10.0),
        'turn_speed': st.floats(0.01, 2.0),
    },
)
own = st.fixed_dictionaries(
    {},
    optional={
        'blend': st.floats(0.0, 0.03),
        'acceleration': st.floats(0.05, 1.0),
        'posture': postures,
    },
)


@st.composite
def paths(draw, start=True, outputs=True, reversible=False):
    """Draw a path of any kind that the builder accepts."""
    tool = draw(st.sampled_from(('', 'tool0'))) if not reversible else ''
    path = Path(HERE, frame=draw(st.sampled_from(('base', ''))), tool=tool)
    timed = draw(st.booleans())
    spline = timed and draw(st.booleans())
    for _ in range(draw(st.integers(1, 6))):
        there = Pose(
            tuple(a + b for a, b in zip(path.end.position, draw(steps), strict=True)),
            (HERE @ Pose(quaternion=draw(turns))).quaternion,
        )
        more = {'duration': draw(durations)} if timed else {}
        try:
            if spline:
                path = path.spline(there, twist=draw(rates), acceleration=draw(rates), **more)
                continue
            if not timed:
                path = path.at(**draw(feeds))
            more |= draw(own)
            match draw(st.sampled_from(('line', 'joint', 'process', 'arc', 'by'))):
                case 'arc':
                    follow = draw(st.booleans()) and not reversible
                    via = tuple(a + b for a, b in zip(path.end.position, draw(steps), strict=True))
                    place = there.position if follow else there
                    path = path.arc(place, via=via, follow=follow, **more)
                case 'by':
                    path = path.by(
                        *draw(steps), turn=draw(turns), of_tool=draw(st.booleans()), **more
                    )
                case name:
                    path = getattr(path, name)(there, **more)
        except InvalidGoal as refused:
            event(f'refused: {str(refused)[10:40]}')
            continue
        if outputs and draw(st.integers(0, 3)) == 0:
            path = path.set(draw(st.sampled_from(OUTPUTS)), 1.0, after=draw(st.floats(0.0, 1.0)))
    assume(len(path))
    return path


@given(paths(), st.booleans(), st.floats(-1.0, 5.0), st.floats(2e-5, 0.1), st.floats(1e-3, 0.5))
@few
def test_a_path_survives_goal_message_and_file(path, keep_open, time, corner, angle):
    path = path.tolerances(time=time).safe(digital(7), False, restore=True).rounded(corner, angle)
    path = path.keep_open() if keep_open else path
    goal = path.goal()
    assert Path.from_goal(path._table()).goal() == goal
    assert Path.from_message(path.to_message()).goal() == goal
    again = Path.from_yaml(Path.from_message(path.to_message()).to_yaml())
    assert again.goal() == goal
    assert again.to_yaml() == path.to_yaml()


def assert_same(one, other, tolerance=1e-9):
    a, b = one._table(), other._table()
    assert len(a.waypoints) == len(b.waypoints)
    sign = np.sign(np.einsum('ij,ij->i', a.waypoints.poses[:, 3:], b.waypoints.poses[:, 3:]))
    for name in ('times', 'twists', 'accelerations'):
        assert getattr(a.waypoints, name) == pytest.approx(
            getattr(b.waypoints, name), abs=tolerance, nan_ok=True
        )
    assert a.waypoints.poses[:, :3] == pytest.approx(b.waypoints.poses[:, :3], abs=tolerance)
    assert a.waypoints.poses[:, 3:] * sign[:, None] == pytest.approx(
        b.waypoints.poses[:, 3:], abs=tolerance
    )
    assert a.waypoints.postures == b.waypoints.postures
    for name in ('types', 'blend_radii', 'velocities', 'accelerations', 'arc_modes', 'has_via'):
        assert getattr(a.segments, name) == pytest.approx(getattr(b.segments, name), abs=tolerance)
    assert a.segments.vias[:, :3] == pytest.approx(b.segments.vias[:, :3], abs=tolerance)
    assert a.io_commands == b.io_commands


@given(paths(outputs=False))
@few
def test_there_and_back_is_the_same(path):
    there = path.reversed()
    assert there.start == path.end
    assert there.end == path.start
    back = there.reversed()
    assert back.goal() == path.goal()
    assert back.start == path.start


@given(paths(), poses, poses)
@few
def test_transformations_compose(path, first, second):
    one = path.transformed(first).transformed(second)
    assert_same(one, path.transformed(second @ first))
    assert_same(path.transformed(first).transformed(first.inverse()), path)


@given(paths(reversible=True), steps, steps)
@few
def test_offsets_add_up_and_go_back(path, first, second):
    total = [a + b for a, b in zip(first, second, strict=True)]
    assert_same(path.offset(*first).offset(*second), path.offset(*total))
    try:
        beside = path.offset(*first, of_tool=True)
    except InvalidGoal as refused:
        lost = ('turns the tool on an arc', 'the driver chooses how the tool turns')
        assert any(words in str(refused) for words in lost)  # noqa: PT017
        return
    for pose, old in zip(beside.poses, path.poses, strict=True):
        assert pose.position == pytest.approx(old.apply(first), abs=1e-12)
        assert pose.quaternion == pytest.approx(old.quaternion, abs=1e-12)
    given = path._table().waypoints
    if not np.isnan((given.twists, given.accelerations)).any():  # free values stay free
        assert_same(beside.offset(*[-x for x in first], of_tool=True), path, 1e-8)


@given(paths(), st.integers(1, 3), st.integers(1, 3))
@few
def test_repetitions_multiply(path, first, second):
    closed = closing(path)
    assume(closed is not None)
    many = closed.repeated(first).repeated(second)
    assert_same(many, closed.repeated(first * second))
    assert len(many) == first * second * len(closed)
    assert many.end.distance_to(HERE) < 1e-6
    assert_same(closed.then(closed), closed.repeated(2))


def closing(path):
    """Return a path that comes back to its start, None if it cannot."""
    timed = bool(path._points[-1].duration)
    try:
        if path._points[-1].in_spline:
            return path.spline(HERE, duration=1.0)
        return path.joint(
            HERE, posture={'elbow_joint': 1.5}, **({'duration': 1.0} if timed else {})
        )
    except InvalidGoal:
        return None


@given(paths(), steps)
@few
def test_passes_lie_beside_each_other(path, step):
    try:
        passes = path.repeated(3, *step)
    except InvalidGoal:
        assume(False)
    rows = np.array([pose.position for pose in passes.poses])
    n = len(path)
    k = (len(rows) - 3 * n) // 2  # lines in between
    assert k in (0, 1)
    for i in range(3):
        assert rows[i * (n + k) : i * (n + k) + n] - rows[:n] == pytest.approx(
            np.tile(i * np.array(step), (n, 1)), abs=1e-9
        )


@pytest.mark.slow
@pytest.mark.exhaustive
@given(paths(), st.sampled_from((None, ExecutionMode.SERVO)))
@settings(max_examples=PATHS, deadline=None, suppress_health_check=list(HealthCheck))
def test_what_the_builder_accepts_is_planned_or_refused_in_words(path, mode):
    if mode is not None and path._points[0].in_spline:
        path = path.executed_as(mode)
    goal = path.goal()
    if goal.io_commands and mode:
        goal = replace(goal, io_commands=())
    try:
        made = plan(goal, STATE, ARM, PlanningOptions(self_collision='off', on_too_fast='slow'))
    except GoalRefused as refused:
        event(type(refused).__name__)
        text = str(refused)
        assert text.endswith('.')
        assert '\n' not in text
        assert len(text) > 20
        return
    event('planned')
    assert isfinite(made.duration)
    assert np.isfinite(made.reference.poses).all()
