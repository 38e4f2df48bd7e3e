# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Goals of any kind, sound and absurd: each is refused in words, or planned and can be sent."""

from __future__ import annotations

from dataclasses import replace
from math import inf, isfinite, nan, pi

from hypothesis import event, given, HealthCheck, settings
from hypothesis import strategies as st
import numpy as np
import pytest

from ur_cartesian_driver.motion.errors import GoalRefused
from ur_cartesian_driver.motion.geometry.pose import Pose, quaternion_from_rotation_vector
from ur_cartesian_driver.motion.goal.goal import (
    ArcMode,
    FreeAxis,
    Goal,
    Posture,
    Segment,
    SegmentType,
    Tolerance,
    Waypoint,
)
from ur_cartesian_driver.planning import plan, PlanningOptions
from ur_cartesian_driver.protocol.program.trajectory_points import encode_points
from ur_cartesian_driver.protocol.program.wire_dialects import DIALECTS

JOINTS = (
    'shoulder_pan_joint',
    'shoulder_lift_joint',
    'elbow_joint',
    'wrist_1_joint',
    'wrist_2_joint',
    'wrist_3_joint',
)
#: The places where something changes: none, the resolution of the wire, sound, too far.
STEPS = (0.0, 1e-7, 9e-7, 1.1e-6, 1e-5, 1e-3, 0.02, 0.05, 0.1, 0.2, -0.02, -0.1)
TURNS = (0.0, 0.0, 0.0, 1e-7, 2e-6, 0.01, 0.5, -1.0, pi / 2, pi - 1e-9, pi)
ODD = (nan, inf, -1.0, 1e300, 1e-300)


def offsets(steps):
    return st.tuples(*[st.sampled_from(steps)] * 3)


def sometimes(usual, odd=ODD):
    """Return a strategy of usual values with one of the odd ones now and then."""
    return st.integers(0, 400).flatmap(lambda n: st.sampled_from(odd if n == 77 else usual))


poses = st.tuples(offsets(STEPS), offsets(TURNS))
#: Of the joints from some of them on.
values = st.tuples(*[sometimes((-pi / 2, 0.0, pi / 2, 1.4, -1.5, 2 * pi))] * 6)
postures = st.integers(0, 40).flatmap(
    lambda n: (
        st.just(Posture())
        if n < 30
        else (
            values.map(lambda x: Posture(names=JOINTS[n - 34 :], values=x[n - 34 :]))
            if n > 34
            else st.just(Posture(names=JOINTS[n - 30 :], values=(1.0,)))
        )
    )
)
segments = st.fixed_dictionaries(
    {
        'type': sometimes(tuple(SegmentType) + (SegmentType.LINEAR,) * 3, (9, -1)),
        'arc_mode': st.sampled_from(ArcMode),
        'blend_radius': sometimes((0.0, 0.0, 1e-7, 2e-6, 0.001, 0.01, 0.03)),
        'velocity': sometimes((0.0, 0.0, 1e-5, 0.05, 1.0, 100.0)),
        'acceleration': sometimes((0.0, 0.0, 1e-5, 0.5, 1.0, 100.0)),
        'via': poses,
        'via_posture': postures,
    }
)
points = st.tuples(
    poses,
    sometimes((1e-6, 0.1, 1.0, 3.0, 2000.0)),
    postures,
    st.tuples(*[sometimes((0.0, 0.0, 0.0, 0.0, 0.1))] * 6),
    segments,
)
tolerances = st.builds(
    lambda x: Tolerance(position=x), st.tuples(*[sometimes((0.0, -1.0, 0.001))] * 3)
)
choices = st.fixed_dictionaries(
    {
        'on_too_fast': st.sampled_from(('refuse', 'slow')),
        'on_posture_change': st.sampled_from(('refuse', 'movej')),
        'dialect': st.sampled_from((*DIALECTS.values(), *[DIALECTS['2.14']] * 8)),
        'singularity_margin_wrist': st.sampled_from((0.0, 0.05)),
        'max_tool_speed': st.sampled_from((0.0, 0.25)),
        'allow_tcp_change': st.booleans(),
        'calibration_known': st.booleans(),
    }
)
#: Sound ones, with straight wrist, stretched elbow, at the end of a range and beyond it.
STARTS = (
    (0.0, -pi / 2, pi / 2, -pi / 2, -pi / 2, 0.0),
    (0.3, -1.2, 1.6, -1.0, 0.0, 0.4),
    (0.3, -1.2, 0.0, -1.0, 1.2, 0.4),
    (2 * pi, -1.6, 1.6, -1.6, -1.57, -2 * pi),
    (2 * pi + 0.05, -1.6, 1.6, -1.6, -1.57, 0.0),
)


def pose_of(cell, drawn):
    offset, turn = drawn
    return cell.pose(*offset, turn=turn)


def segment_of(cell, drawn):
    kind = drawn['type']
    via = pose_of(cell, drawn['via']) if kind == SegmentType.CIRCULAR else None
    odd = {} if via else {'via_posture': Posture(), 'arc_mode': ArcMode.UNCONSTRAINED}
    return Segment(**{**drawn, 'via': via, **odd})


def goal_of(cell, drawn, timed, plain, tolerance, frame):
    time, waypoints, ways = 0.0, [], []
    for pose, taken, posture, twist, segment in drawn:
        time += taken if timed else 0.0
        waypoints.append(
            Waypoint(pose=pose_of(cell, pose), time=time, posture=posture, twist=twist)
        )
        if timed:
            segment = {**segment, 'velocity': 0.0}
        ways.append(segment_of(cell, segment))
    return Goal(
        waypoints=tuple(waypoints),
        segments=() if plain else tuple(ways),
        path_tolerance=tolerance,
        T_flange_controlled=frame,
    )


frames = st.sampled_from(
    (None, None, None, Pose((0.0, 0.0, 0.1), quaternion_from_rotation_vector((0.0, 0.3, 0.0))))
)


@pytest.mark.slow
@settings(max_examples=150, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(
    q=st.sampled_from(STARTS),
    drawn=st.lists(points, max_size=4),
    timed=st.booleans(),
    plain=st.booleans(),
    tolerance=tolerances,
    frame=frames,
    free=st.sampled_from((None, None, (0.0, 0.0), (-0.5, 0.5), (0.1, 0.1))),
    options=choices,
)
def test_any_goal_is_refused_in_words_or_planned_and_can_be_sent(
    make_cell, q, drawn, timed, plain, tolerance, frame, free, options
):
    cell = make_cell(q)
    goal = goal_of(cell, drawn, timed, plain, tolerance, frame)
    if free is not None and goal.segments:
        low, high = free
        axis = {'free_axis': FreeAxis.Z, 'free_min': low, 'free_max': high}
        goal = replace(
            goal,
            segments=tuple(
                segment if i % 3 == 1 else replace(segment, **axis)
                for i, segment in enumerate(goal.segments)
            ),
        )
    chosen = PlanningOptions(self_collision='off', max_segment_time=1000.0, **options)
    try:
        made = plan(goal, cell.state, cell.arm, chosen)
    except GoalRefused as refused:
        event(type(refused).__name__)
        return
    event('planned')
    encode_points([segment.primitive for segment in made.segments], chosen.dialect)
    assert np.isfinite(made.reference.poses).all()
    assert np.isfinite(made.reference.time).all()
    assert isfinite(made.duration)
    assert made.duration >= 0.0
    assert made.reference.time[-1] == pytest.approx(made.duration, rel=1e-6, abs=1e-6)
