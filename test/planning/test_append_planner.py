# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""A goal that is planned part by part becomes the motion that it is when all is known at once."""

from contextlib import nullcontext
from dataclasses import replace
from math import pi

import numpy as np
import pytest

from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.kinematics.robot_models import robot_model
from ur_cartesian_driver.motion.errors import (
    GoalRefused,
    InvalidGoal,
    NotAvailable,
    Unreachable,
)
from ur_cartesian_driver.motion.geometry.pose import Pose
from ur_cartesian_driver.motion.geometry.vectors import ZERO6
from ur_cartesian_driver.motion.goal.execution_modes import ExecutionMode
from ur_cartesian_driver.motion.goal.goal import (
    Goal,
    IOCommand,
    OutputKind,
    PulseTrain,
    Segment,
    SegmentType,
    Waypoint,
)
from ur_cartesian_driver.motion.goal.leads import Lead
from ur_cartesian_driver.motion.plan.primitive import LeadLaw, PulseLaw, SwitchOutput
from ur_cartesian_driver.motion.state.rtde_state import RobotState
from ur_cartesian_driver.planning import plan, PlanningOptions
from ur_cartesian_driver.planning.append import append_planner
from ur_cartesian_driver.planning.append.append_planner import plan_append, plan_first_part
from ur_cartesian_driver.planning.append.appendable_goal import AppendedPoints
from ur_cartesian_driver.planning.options import MAX_POINTS
from ur_cartesian_driver.planning.spline.spline_planner import plan_spline
from ur_cartesian_driver.protocol.program.wire_dialects import DIALECTS

ARM = Arm(robot_model('ur5e'))
Q = (0.3, -pi / 2, pi / 2, -pi / 2, -pi / 2, 0.0)
HOME = ARM.forward(Q)
STATE = RobotState(
    timestamp=0.0, actual_q=Q, target_q=Q, actual_tcp_pose=HOME, target_tcp_pose=HOME
)
OPTIONS = PlanningOptions(max_tool_speed=1.0, self_collision='off')
CORNERS = ((0.04, 0.0), (0.04, 0.04), (0.0, 0.04), (0.0, 0.0))
COUNT = 9


def pose(k):
    x, y, z = HOME.position
    dx, dy = CORNERS[k % 4]
    return Pose((x + dx, y + dy, z), HOME.quaternion)


def via(k):
    """A place beside the middle of the way to a corner."""
    a, b = pose(k - 1).position, pose(k).position
    return Pose(((a[0] + b[0]) / 2 + 0.01, (a[1] + b[1]) / 2 + 0.01, a[2]), HOME.quaternion)


def moves(*types, timed=0.0, radius=0.008, offsets=()):
    """A goal of motions of these types in turn, blended, with outputs so late at its points."""
    kinds = [SegmentType(types[k % len(types)]) for k in range(COUNT)]
    return Goal(
        waypoints=tuple(Waypoint(pose=pose(k), time=timed * (k + 1)) for k in range(COUNT)),
        segments=tuple(
            Segment(
                type=kind,
                blend_radius=radius if k + 1 < COUNT else 0.0,
                velocity=0.0 if timed or kind is SegmentType.JOINT else 0.1,
                via=via(k) if kind is SegmentType.CIRCULAR else None,
            )
            for k, kind in enumerate(kinds)
        ),
        execution=ExecutionMode.PRIMITIVES,
        io_commands=outputs(offsets),
    )


def outputs(offsets):
    return tuple(
        IOCommand(
            waypoint=k, offset=offset, output=OutputKind.STANDARD_DIGITAL, pin=k % 8, value=1.0
        )
        for k in range(COUNT)
        for offset in offsets
    )


def spline(offsets=()):
    """A wavy line along x, that rests at its end; the speed of the tool is told at each point."""
    points = []
    for k in range(1, COUNT + 1):
        t = 0.2 * k
        s = 0.1 * t * t if t < 1.0 else 0.2 * t - 0.1
        v = min(0.2 * t, 0.2)
        last = k == COUNT
        points.append(
            Waypoint(
                time=t + 0.2 * last,
                pose=Pose(
                    (
                        HOME.position[0] + 0.3 * s,
                        HOME.position[1] + 0.02 * np.sin(6.0 * s),
                        HOME.position[2],
                    ),
                    HOME.quaternion,
                ),
                twist=ZERO6 if last else (0.3 * v, 0.12 * v * float(np.cos(6.0 * s)), 0, 0, 0, 0),
            )
        )
    return Goal(
        waypoints=tuple(points), execution=ExecutionMode.SPLINE, io_commands=outputs(offsets)
    )


def of(goal, begin, end, **changes):
    """A part of a goal as an addition."""
    return {
        'waypoints': goal.waypoints[begin:end],
        'segments': goal.segments[begin:end],
        'io_commands': tuple(c for c in goal.io_commands if begin <= c.waypoint < end),
    } | changes


def in_parts(goal, sizes):
    """Plan a goal in parts of these sizes; return the instructions and rows that are final."""
    end = sizes[0]
    part = plan_first_part(
        plan(replace(goal, **of(goal, 0, end), keep_open=True), STATE, ARM, OPTIONS), ARM, OPTIONS
    )
    wire, rows = [], None
    for size in (*sizes[1:], 0):
        made = list(part.plan.instructions)
        del wire[part.records_before :]
        assert part.records_before == len(wire), 'no record is left out'
        wire += made
        rows = part.plan.reference if rows is None else joined(rows, part)
        assert part.next_goal.records == len(wire)
        if size:
            assert part.next_goal.committed_records == len(wire) - part.ending_records
            part = plan_append(
                part.next_goal,
                AppendedPoints(**of(goal, end, end + size), last=end + size == COUNT),
                ARM,
                OPTIONS,
                from_rest=False,
            )
            end += size
    return wire, rows, part


def joined(rows, part):
    """Join the reference paths of a plan and its continuation, as the driver does."""
    kept, new = (
        rows.time <= part.start_time + 5e-7,
        part.plan.reference.time > part.start_time + 5e-7,
    )
    return replace(
        rows,
        **{
            name: np.concatenate(
                [getattr(rows, name)[kept], getattr(part.plan.reference, name)[new]]
            )
            for name in ('poses', 'point', 'time', 'blend_tolerance', 'fraction')
        },
    )


GOALS = {
    'lines': moves(1),
    'stops': moves(1, radius=0.0),
    'process': moves(4),
    'lines in time': moves(1, timed=1.2),
    'joints': moves(2),
    'lines and joints': moves(1, 1, 2),
    'lines and arcs': moves(1, 3),
    'lines with outputs': moves(1, offsets=(0.0, 0.05, 0.95)),
    'spline': spline(),
    'spline with outputs': spline(offsets=(0.0, 0.05, 0.5)),
}


@pytest.mark.parametrize('sizes', [(1, 1, 7), (4, 1, 1, 1, 2)], ids=str)
@pytest.mark.parametrize('goal', GOALS.values(), ids=GOALS)
def test_parts_become_what_the_whole_goal_is(goal, sizes):
    whole = plan(goal, STATE, ARM, OPTIONS)
    wire, rows, part = in_parts(goal, sizes)
    known = list(whole.instructions)
    assert [type(one) for one in wire] == [type(one) for one in known]
    # A time on the wire counts to rest; how soon before its point is passed, the next one tells.
    is_timed = goal is GOALS['lines in time']
    for one, other in zip(wire, known, strict=True):
        assert_same(one, other, 0.02 if is_timed else 1e-6)
    assert rows.point.tolist() == whole.reference.point.tolist()
    assert rows.time == pytest.approx(whole.reference.time, abs=0.02 if is_timed else 2e-6)
    # Its rows are where its acceleration changes.
    within = 2e-5 if is_timed else 1e-7
    assert unsigned(rows) == pytest.approx(unsigned(whole.reference), abs=within)
    passed = [np.flatnonzero(rows.point <= k)[-1] for k in range(COUNT)]
    assert rows.time[passed] == pytest.approx(whole.reference.time[passed], abs=1e-4)
    assert part.next_goal.points == COUNT
    assert part.ending_records == 0


def test_a_lead_of_an_appended_command_is_refused_by_its_time_or_its_name():
    lead = Lead(name='valve', output=OutputKind.STANDARD_DIGITAL, pin=6, open=0.02, close=0.0)
    options = replace(OPTIONS, leads=(lead,))
    goal = moves(1)
    first = plan(replace(goal, **of(goal, 0, 4), keep_open=True), STATE, ARM, options)
    part = plan_first_part(first, ARM, options)
    for name, sentence in (
        (
            'valve',
            r'io_commands\[0\]\.lead is -0\.02, but a goal with keep_open switches outputs at ',
        ),
        ('other', r"io_commands\[0\]\.lead is 'other', but the driver has only valve"),
        ('no output', r'io_commands\[0\]\.output is 9; allowed are STANDARD_DIGITAL'),
    ):
        command = replace(outputs((0.0,))[6], lead=name.removeprefix('no output') or 'valve')
        if name == 'no output':
            command = replace(command, output=9)
        points = AppendedPoints(**of(goal, 4, COUNT, io_commands=(command,)), last=True)
        with pytest.raises(InvalidGoal, match=sentence):
            plan_append(part.next_goal, points, ARM, options, from_rest=False)


#: Places and leads in the middle of parts, and a command that waits for the points after its own.
PLACED = (
    {'waypoint': 1, 'distance': 0.004, 'pin': 0},
    {'waypoint': 2, 'offset': -0.05, 'pin': 1},
    {'waypoint': 2, 'offset': 0.15, 'fraction': -0.2, 'pin': 2},
    {'waypoint': 4, 'fraction': 0.7, 'offset': -0.03, 'pin': 3},
    {'waypoint': 5, 'pin': 4},
    {'waypoint': 5, 'distance': -0.001, 'pin': 5},
    {'waypoint': 7, 'distance': 0.002, 'offset': -0.04, 'pin': 6},
    {'waypoint': 8, 'distance': -0.003, 'pin': 7},
)


def placed(*fields):
    return tuple(
        IOCommand(
            output=OutputKind.STANDARD_DIGITAL, value=1.0, **{'offset': 0.0, 'pin': 0} | each
        )
        for each in fields
    )


@pytest.mark.parametrize('sizes', [(3, 3, 3), (6, 3)], ids=str)
def test_places_and_leads_of_open_splines_are_where_they_are_in_the_whole_goal(sizes):
    goal = replace(spline(), io_commands=placed(*PLACED))
    wire, _, _ = in_parts(goal, sizes)
    known = list(plan(goal, STATE, ARM, OPTIONS).instructions)
    assert [type(one) for one in wire] == [type(one) for one in known]
    for one, other in zip(wire, known, strict=True):
        # Where a part begins, the speeds of a lead are known from one side only.
        assert_same(one, other, 2e-4 if isinstance(one, LeadLaw) else 1e-6)


@pytest.mark.parametrize(
    ('fields', 'text'),
    [
        (
            {'waypoint': 5, 'distance': 0.001},
            r'io_commands.1..distance is 0.001, but the path behind point 5 is not known yet; '
            'send the command with a later point',
        ),
        ({'waypoint': 5, 'fraction': 0.5}, 'io_commands.1..fraction is 0.5, but the path behind'),
        (
            {'waypoint': 3, 'distance': -0.02},
            r'io_commands.1..distance is -0.02 m, but the path before point 3 is',
        ),
        ({'waypoint': 4, 'offset': -0.9}, 'io_commands.1..offset is -0.9 s, but .* longest lead'),
    ],
)
def test_places_that_an_open_spline_cannot_reach_are_refused(fields, text):
    goal = replace(spline(), io_commands=placed({'waypoint': 2}))
    first = plan(replace(goal, **of(goal, 0, 3), keep_open=True), STATE, ARM, OPTIONS)
    part = plan_first_part(first, ARM, OPTIONS)
    points = AppendedPoints(**of(goal, 3, 6, io_commands=placed({'waypoint': 4}, fields)))
    with pytest.raises(InvalidGoal, match=text):
        plan_append(part.next_goal, points, ARM, OPTIONS, from_rest=False)


#: Pulses that go on: the goal that is open ends with their last point.
PHOTOS = PulseTrain(
    first_waypoint=1,
    last_waypoint=2,
    output=OutputKind.STANDARD_DIGITAL,
    pin=3,
    distance=0.002,
    width=0.004,
)


@pytest.mark.parametrize(
    'goal', [moves(1), moves(1, radius=0.0), spline()], ids=['blends', 'stops', 'spline']
)
def test_pulses_of_open_goals_are_one_record_whatever_is_appended(goal):
    whole = replace(goal, pulses=(replace(PHOTOS, last_waypoint=COUNT - 1),))
    known = list(plan(whole, STATE, ARM, OPTIONS).instructions)
    wire, _, _ = in_parts(replace(goal, pulses=(PHOTOS,)), (3, 3, 3))
    assert [type(one) for one in wire] == [type(one) for one in known]
    for one, other in zip(wire, known, strict=True):
        if isinstance(one, PulseLaw) and isinstance(other, PulseLaw):
            assert one == replace(other, count=1_000_000, goes_on=True)
        else:
            assert_same(one, other)


def test_pulses_that_end_before_the_last_point_of_an_open_goal_are_bounded():
    train = replace(PHOTOS, first_waypoint=0, last_waypoint=1)
    goal = replace(moves(1, radius=0.0), pulses=(train,))
    wire, _, _ = in_parts(goal, (3, 6))
    (law,) = [one for one in wire if isinstance(one, PulseLaw)]
    assert (law.count, law.goes_on) == (21, False)


def test_the_way_to_the_first_pulse_may_be_fast():
    goal = replace(moves(1), pulses=(replace(PHOTOS, distance=0.001),))
    fast = replace(goal.segments[0], velocity=0.5, acceleration=4.0)
    goal = replace(goal, segments=(fast, *goal.segments[1:]))
    first = plan(replace(goal, **of(goal, 0, 3), keep_open=True), STATE, ARM, OPTIONS)
    assert plan_first_part(first, ARM, OPTIONS).next_goal.pulses


def test_what_pulses_that_go_on_exclude_is_refused():
    goal = replace(moves(1), pulses=(replace(PHOTOS, distance=0.001),))
    first = plan(replace(goal, **of(goal, 0, 3), keep_open=True), STATE, ARM, OPTIONS)
    part = plan_first_part(first, ARM, OPTIONS)
    command = placed({'waypoint': 4, 'pin': 3})
    fast = tuple(
        replace(segment, velocity=0.5, acceleration=4.0) for segment in goal.segments[3:6]
    )
    for changes, text in (
        ({'io_commands': command}, r'io_commands.0..pin is 3, but .* to the end of the goal'),
        ({'segments': fast}, r'pulses.0..distance is 1 mm, but from pulse to pulse 6 ms'),
    ):
        points = AppendedPoints(**of(goal, 3, 6, **changes))
        with pytest.raises(InvalidGoal, match=text):
            plan_append(part.next_goal, points, ARM, OPTIONS, from_rest=False)


@pytest.mark.parametrize(
    ('changes', 'text'),
    [
        ({'execution': ExecutionMode.SERVO}, 'but a SERVO goal with keep_open gives no pulses'),
        ({'replace_horizon': 0.2}, 'but the goal has a replace_horizon'),
    ],
)
def test_open_goals_without_pulses(changes, text):
    goal = replace(spline(), pulses=(PHOTOS,))
    goal = replace(goal, **of(goal, 0, 3), keep_open=True, **changes)
    with pytest.raises(NotAvailable, match=f'pulses is not empty, {text}'):
        plan(goal, STATE, ARM, OPTIONS)


def test_points_are_appended_where_the_limit_of_points_is_the_largest():
    """The points that are planned again with them come on top."""
    options = replace(OPTIONS, max_points=MAX_POINTS)
    goal = moves(1)
    first = plan(replace(goal, **of(goal, 0, 4), keep_open=True), STATE, ARM, options)
    part = plan_append(
        plan_first_part(first, ARM, options).next_goal,
        AppendedPoints(**of(goal, 4, COUNT), last=True),
        ARM,
        options,
        from_rest=False,
    )
    assert part.next_goal.points == COUNT


def unsigned(path):
    """The poses of a path, with the one of q and -q whose largest number is positive."""
    poses = path.poses.copy()
    largest = np.abs(poses[:, 3:]).argmax(axis=1)
    poses[:, 3:] *= np.sign(poses[np.arange(len(poses)), 3 + largest])[:, None]
    return poses


def assert_same(one, other, within=1e-6):
    for name in one.__slots__:
        a, b = getattr(one, name), getattr(other, name)
        if isinstance(one, SwitchOutput) and name == 'heading':
            continue
        if isinstance(a, Pose) and isinstance(b, Pose):
            assert a.distance_to(b) + a.angle_to(b) < 1e-6, (one, other)
        elif isinstance(a, float | tuple):
            assert a == pytest.approx(b, abs=within), (name, one, other)
        else:
            assert a == b, (name, one, other)


@pytest.mark.parametrize('sizes', [(4, 1, 1, 1, 1, 1), (3, 3, 2, 1), (1, 4, 2, 1, 1)], ids=str)
@pytest.mark.parametrize('offset', [0.34, 0.36, 0.7, 0.74])
@pytest.mark.parametrize('types', [(4,), (1, 1, 2)], ids=str)
def test_outputs_due_beside_the_end_of_a_part_are_switched_once(types, offset, sizes):
    goal = moves(*types, offsets=(offset,))
    wire, _, _ = in_parts(goal, sizes)
    pins = [record.pin for record in wire if isinstance(record, SwitchOutput)]
    assert sorted(pins) == sorted(command.pin for command in goal.io_commands)


@pytest.mark.parametrize('known', [1, 2, 3])
def test_a_goal_may_begin_with_the_point_at_which_the_arm_stands(known):
    goal = Goal(
        waypoints=tuple(
            Waypoint(pose=HOME if k == 0 else pose(k), time=0.9 * k) for k in range(5)
        ),
        execution=ExecutionMode.PRIMITIVES,
    )
    whole = list(plan(goal, STATE, ARM, OPTIONS).instructions)
    part = plan_first_part(
        plan(replace(goal, **of(goal, 0, known), keep_open=True), STATE, ARM, OPTIONS),
        ARM,
        OPTIONS,
    )
    wire = list(part.plan.instructions)
    part = plan_append(
        part.next_goal,
        AppendedPoints(**of(goal, known, 5), last=True),
        ARM,
        OPTIONS,
        from_rest=False,
    )
    wire[part.records_before :] = part.plan.instructions
    assert len(wire) == len(whole)
    for one, other in zip(wire, whole, strict=True):
        assert_same(one, other)


def test_points_of_a_refusal_are_numbered_from_the_start_of_the_goal():
    goal = moves(1)
    part = plan_first_part(
        plan(replace(goal, **of(goal, 0, 6), keep_open=True), STATE, ARM, OPTIONS), ARM, OPTIONS
    )
    far = Waypoint(pose=Pose((3.0, 0.0, 0.0), HOME.quaternion))
    for from_rest in (False, True):
        with pytest.raises(GoalRefused, match=r'points\[7\]'):
            plan_append(
                part.next_goal,
                AppendedPoints(waypoints=(goal.waypoints[6], far)),
                ARM,
                OPTIONS,
                from_rest=from_rest,
            )
    with pytest.raises(GoalRefused, match=r'is 3, but the points of this request are 6 to 6'):
        plan_append(
            part.next_goal,
            AppendedPoints(waypoints=goal.waypoints[6:7], io_commands=outputs((0.0,))[3:4]),
            ARM,
            OPTIONS,
            from_rest=False,
        )


@pytest.mark.parametrize('from_rest', [False, True])
@pytest.mark.parametrize('known', [1, 3])
def test_a_goal_of_speeds_takes_no_times(known, from_rest):
    goal = moves(1)
    part = plan_first_part(
        plan(replace(goal, **of(goal, 0, known), keep_open=True), STATE, ARM, OPTIONS),
        ARM,
        OPTIONS,
    )
    text = rf'points\[{known}\].time_from_start is 9 s, .* no times'
    with pytest.raises(InvalidGoal, match=text):
        plan_append(
            part.next_goal,
            AppendedPoints(waypoints=(replace(goal.waypoints[known], time=9.0),)),
            ARM,
            OPTIONS,
            from_rest=from_rest,
        )


@pytest.mark.parametrize('from_rest', [False, True])
@pytest.mark.parametrize('goal', [spline(), moves(1, timed=0.6)], ids=['spline', 'lines'])
@pytest.mark.parametrize('times', [(-0.2, 0.4), (0.0, 0.4), (0.4, 0.4), (0.4, 0.2)], ids=str)
def test_appended_times_go_on_increasing(times, goal, from_rest):
    part = plan_first_part(
        plan(replace(goal, **of(goal, 0, 3), keep_open=True), STATE, ARM, OPTIONS), ARM, OPTIONS
    )
    told = goal.waypoints[2].time
    waypoints = tuple(
        replace(point, time=told + time)
        for point, time in zip(goal.waypoints[3:5], times, strict=True)
    )
    wrong = 3 if times[0] <= 0.0 else 4
    with pytest.raises(InvalidGoal, match=rf'points\[{wrong}\].time_from_start .*not later than'):
        plan_append(
            part.next_goal, AppendedPoints(waypoints=waypoints), ARM, OPTIONS, from_rest=from_rest
        )


@pytest.mark.parametrize('from_rest', [False, True])
@pytest.mark.parametrize('goal', [spline(), moves(1, timed=0.6)], ids=['spline', 'lines'])
def test_an_appended_time_beyond_all_measure_is_refused_as_it_was_given(goal, from_rest):
    part = plan_first_part(
        plan(replace(goal, **of(goal, 0, 3), keep_open=True), STATE, ARM, OPTIONS), ARM, OPTIONS
    )
    points = AppendedPoints(waypoints=(replace(goal.waypoints[3], time=1e300),))
    with pytest.raises(InvalidGoal, match=r'points\[3\].* gives the segment 1e\+300 s, more than'):
        plan_append(part.next_goal, points, ARM, OPTIONS, from_rest=from_rest)


def test_only_a_spline_that_is_too_fast_from_rest_is_tried_again_with_more_time(monkeypatch):
    goal = spline()
    part = plan_first_part(
        plan(replace(goal, **of(goal, 0, 3), keep_open=True), STATE, ARM, OPTIONS), ARM, OPTIONS
    )
    tried = []

    def counted(*args, **fields):
        tried.append(args[0].time)
        return plan_spline(*args, **fields)

    monkeypatch.setattr(append_planner, 'plan_spline', counted)
    far = replace(goal.waypoints[3], pose=Pose((3.0, 0.0, 0.0), HOME.quaternion))
    soon = replace(goal.waypoints[3], time=goal.waypoints[2].time + 0.05)
    for point, again, refusal in (
        (far, False, pytest.raises(Unreachable)),
        (soon, True, nullcontext()),
    ):
        tried.clear()
        addition = AppendedPoints(waypoints=(replace(point, twist=ZERO6),), last=True)
        with refusal:
            plan_append(part.next_goal, addition, ARM, OPTIONS, from_rest=True)
        assert (len(tried) > 1) is again


@pytest.mark.parametrize('from_rest', [False, True])
@pytest.mark.parametrize(
    'goal', [spline(), moves(1, timed=0.6, radius=0.0)], ids=['spline', 'lines']
)
def test_a_goal_that_has_gone_on_for_hours_goes_on(goal, from_rest):
    part = plan_first_part(
        plan(replace(goal, **of(goal, 0, 3), keep_open=True), STATE, ARM, OPTIONS), ARM, OPTIONS
    )
    on, late = part.next_goal, 20_000.0
    on = replace(
        on,
        last_client_time=on.last_client_time + late,
        time_offset=on.time_offset - late,
        replannable=tuple(
            replace(
                known,
                time_before=known.time_before + late,
                waypoint=replace(known.waypoint, time=known.waypoint.time + late),
            )
            for known in on.replannable
        ),
    )
    points = goal.waypoints[3:5]
    made = [
        plan_append(state, AppendedPoints(waypoints=waypoints), ARM, OPTIONS, from_rest=from_rest)
        for state, waypoints in (
            (part.next_goal, points),
            (on, tuple(replace(point, time=point.time + late) for point in points)),
        )
    ]
    early, later = ([segment.duration for segment in one.plan.segments] for one in made)
    assert later == pytest.approx(early, abs=2e-6)
    with pytest.raises(
        InvalidGoal, match=r'gives the segment 2200 s, more than max_segment_time = 2147 s'
    ):
        plan_append(
            on,
            AppendedPoints(waypoints=(replace(points[0], time=on.last_client_time + 2200.0),)),
            ARM,
            OPTIONS,
            from_rest=from_rest,
        )


def test_what_appended_points_ask_for_in_vain_is_told():
    goal = moves(1, timed=0.6, radius=0.0)
    part = plan_first_part(
        plan(replace(goal, **of(goal, 0, 3), keep_open=True), STATE, ARM, OPTIONS), ARM, OPTIONS
    )
    waypoints = tuple(replace(point, twist=(0.1, 0, 0, 0, 0, 0)) for point in goal.waypoints[3:5])
    for points, told in (
        (
            waypoints,
            ' Points 3, 4: twist is ignored: UR motion commands stop or blend at a point.',
        ),
        (goal.waypoints[3:5], ''),
    ):
        text = plan_append(
            part.next_goal, AppendedPoints(waypoints=points), ARM, OPTIONS, from_rest=False
        ).text
        assert text == f'2 points appended, the goal has 5.{told}'


@pytest.mark.parametrize(
    'goal', [moves(1, offsets=(0.0, 0.3)), spline(offsets=(0.0, 0.3))], ids=['lines', 'spline']
)
def test_outputs_of_a_refusal_are_numbered_as_in_the_request(goal):
    part = plan_first_part(
        plan(replace(goal, **of(goal, 0, 4), keep_open=True), STATE, ARM, OPTIONS), ARM, OPTIONS
    )
    assert part.next_goal.outputs, 'some of before may still be due'
    wrong = replace(goal.io_commands[8], pin=9)
    with pytest.raises(InvalidGoal, match=r'^io_commands\[0\]\.pin is 9'):
        plan_append(
            part.next_goal,
            AppendedPoints(**of(goal, 4, 6, io_commands=(wrong,))),
            ARM,
            OPTIONS,
            from_rest=False,
        )


@pytest.mark.parametrize('name', ['2.0', '2.10', '2.12'])
def test_older_robot_programs_have_to_know_the_number_of_points(name):
    goal = replace(moves(1), keep_open=True)
    with pytest.raises(
        NotAvailable, match=f'wire dialect {name} needs the number of points at the start'
    ):
        plan(goal, STATE, ARM, replace(OPTIONS, dialect=DIALECTS[name]))


def test_what_is_remembered_of_a_goal_does_not_grow():
    goal, held = moves(1, offsets=(0.1,)), []
    part = plan_first_part(
        plan(replace(goal, **of(goal, 0, 4), keep_open=True), STATE, ARM, OPTIONS), ARM, OPTIONS
    )
    for _ in range(6):
        commands = tuple(
            replace(c, waypoint=c.waypoint % 4 + part.next_goal.points)
            for c in goal.io_commands[:4]
        )
        part = plan_append(
            part.next_goal,
            AppendedPoints(
                waypoints=goal.waypoints[:4],
                segments=(goal.segments[0],) * 4,
                io_commands=commands,
            ),
            ARM,
            OPTIONS,
            from_rest=False,
        )
        held.append((len(part.next_goal.replannable), len(part.next_goal.outputs)))
    assert set(held) == {(2, 1)}, 'two points, and what stands behind the last of them'


def test_points_that_are_appended_to_set_points_bring_no_outputs():
    goal = replace(spline(offsets=(0.0, 0.3)), execution=ExecutionMode.SERVO)
    opened = replace(goal, **of(goal, 0, 4, io_commands=()), keep_open=True)
    part = plan_first_part(plan(opened, STATE, ARM, OPTIONS), ARM, OPTIONS)
    with pytest.raises(NotAvailable, match=r'^io_commands is not empty, but a SERVO goal with'):
        plan_append(
            part.next_goal, AppendedPoints(**of(goal, 4, 6)), ARM, OPTIONS, from_rest=False
        )
