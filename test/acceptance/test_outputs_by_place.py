# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Outputs at places beside points and with leads: the cycle of each edge, against the tool's own way.

The judge (``test/support/output_judge.py``) knows nothing of the plan.
"""

from dataclasses import replace

from output_judge import judge_commands, JudgedRun, PathTime, SLIDERS, SLOW
import pytest
from random_cases import cases, random_of
from robot_in_memory import RobotInMemory
from traced_run import ARM, HOME, OPTIONS, TOOL, ZIGZAG

from ur_cartesian_driver.motion.errors import InvalidGoal, NotAvailable
from ur_cartesian_driver.motion.geometry.pose import Pose
from ur_cartesian_driver.motion.goal.execution_modes import ExecutionMode
from ur_cartesian_driver.motion.goal.goal import Goal, IOCommand, OutputKind, Segment, Waypoint
from ur_cartesian_driver.motion.goal.leads import Lead
from ur_cartesian_driver.planning import plan

pytestmark = [pytest.mark.acceptance, pytest.mark.slow]

#: How late or early an output may be [cycles].
BOUND = 1.0


def command(waypoint, pin, value=1.0, **place):
    return IOCommand(
        **{
            'waypoint': waypoint,
            'pin': pin,
            'offset': 0.0 if isinstance(place.get('lead'), str) else -place.pop('lead', 0.0),
            'output': OutputKind.STANDARD_DIGITAL,
            'value': value,
        }
        | place
    )


def zigzag(home, commands, points=ZIGZAG, speed=0.1, blend=0.0, **changes):
    x, y, z = home.position
    last = len(points) - 1
    segments = tuple(
        Segment(velocity=speed, acceleration=1.2, blend_radius=blend if k < last else 0.0)
        for k in range(len(points))
    )
    return Goal(
        **{
            'waypoints': tuple(
                Waypoint(pose=Pose((x + dx, y + dy, z), home.quaternion)) for dx, dy in points
            ),
            'segments': segments,
            'io_commands': tuple(commands),
        }
        | changes
    )


def spline(home, commands, period=0.5, **changes):
    """Return the goal through the points as a spline with times."""
    x, y, z = home.position
    return Goal(
        waypoints=tuple(
            Waypoint(pose=Pose((x + dx, y + dy, z), home.quaternion), time=period * (k + 1))
            for k, (dx, dy) in enumerate(ZIGZAG)
        ),
        execution=ExecutionMode.SPLINE,
        io_commands=tuple(commands),
        **changes,
    )


def misses(run, path_time, bound=BOUND):
    return judge_commands(run, path_time, bound).misses


def assert_in_time(goal_of, slider):
    robot = RobotInMemory('ur5e')
    run = JudgedRun(robot, goal_of, slider)
    assert misses(run, path_time_of(robot, goal_of)) == {}
    return run


def path_time_of(robot, goal_of):
    return PathTime(JudgedRun(robot, goal_of, lambda cycle: SLOW))


PLACES = (
    command(0, 0, distance=0.012),
    command(1, 1, distance=-0.02),
    command(1, 2, fraction=0.3),
    command(3, 3, fraction=-0.25),
    command(2, 4, lead=0.06),
    command(2, 5, distance=0.02, lead=0.11),
    command(2, 6, distance=0.021, lead=0.04),
    command(4, 7, lead=0.03),
)


def by_kind(kind, commands=PLACES, speed=0.1):
    if kind == 'spline':
        return lambda home: spline(home, commands, period=0.06 / speed)
    changes = {
        'stops': {},
        'blends': {'blend': 0.008},
        'rounded': {'corner_deviation': 0.001},
    }[kind]
    return lambda home: zigzag(home, commands, speed=speed, **changes)


@pytest.mark.parametrize('slider', SLIDERS)
@pytest.mark.parametrize('kind', ['stops', 'blends', 'rounded', 'spline'])
def test_each_output_switches_in_the_cycle_in_which_it_is_due(kind, slider):
    assert_in_time(by_kind(kind), SLIDERS[slider])


@pytest.mark.parametrize('speed', [0.001, 0.01, 0.25])
def test_slow_and_fast_tools(speed):
    points = tuple((min(1.0, 20.0 * speed) * x, min(1.0, 20.0 * speed) * y) for x, y in ZIGZAG)
    size = min(1.0, 20.0 * speed)
    commands = (
        command(1, 0, distance=-0.01 * size),
        command(2, 1, distance=0.02 * size, lead=0.05),
        command(2, 2, fraction=0.8, lead=0.02),
    )
    assert_in_time(lambda home: zigzag(home, commands, points, speed), SLIDERS['full'])


def test_leads_overtake_one_another():
    commands = (
        command(1, 0, distance=0.020),
        command(1, 1, distance=0.0215, lead=0.1),
        command(1, 2, distance=0.022, lead=0.01),
        command(1, 3, distance=0.023, lead=0.15),
    )
    orders = {}
    for name in ('full', 'low'):
        run = assert_in_time(by_kind('stops', commands), SLIDERS[name])
        orders[name] = [pin for pin, *_ in run.edges]
    assert orders == {'full': [3, 1, 0, 2], 'low': [0, 1, 3, 2]}


def test_a_dwell_and_a_pause_shift_no_output():
    def dwelling(home):
        goal = zigzag(home, PLACES)
        segments = list(goal.segments)
        segments[1] = Segment(velocity=0.1, acceleration=1.2, dwell=0.3)
        return Goal(
            waypoints=goal.waypoints, segments=tuple(segments), io_commands=goal.io_commands
        )

    def act(controller, cycle):
        if cycle in (285, 650):  # on a line, and in the dwell
            controller.programs.pause()
        elif cycle in (385, 750):
            controller.programs.play()

    robot = RobotInMemory('ur5e')
    path_time = path_time_of(robot, dwelling)
    full = JudgedRun(robot, dwelling)
    assert misses(full, path_time) == {}
    paused = JudgedRun(robot, dwelling, act=act)
    assert len(paused.ways) > len(full.ways) + 150
    assert misses(paused, path_time) == {}


def test_the_longest_lead_is_in_the_refusal():
    def seam(lead):
        return by_kind('stops', [command(1, 0, distance=-0.045, lead=lead)])

    text = r'io_commands.0..offset is -0.9 s.* the longest lead here is'
    with pytest.raises(InvalidGoal, match=text) as refusal:
        JudgedRun(RobotInMemory('ur5e'), seam(0.9))
    longest = float(str(refusal.value).partition('longest lead here is ')[2].split()[0])
    assert 0.1 < longest < 0.2
    assert_in_time(seam(longest - 0.001), SLIDERS['full'])


@pytest.mark.parametrize('place', [{'distance': -0.01}, {'fraction': 0.1}, {'lead': 0.1}])
def test_goals_to_which_points_can_be_appended_have_neither(place):
    def goal(home):
        return zigzag(home, [command(1, 0, **place)], keep_open=True)

    with pytest.raises(NotAvailable, match='a goal with keep_open switches outputs at its points'):
        JudgedRun(RobotInMemory('ur5e'), goal)


@pytest.mark.parametrize(
    ('place', 'field', 'text'),
    [
        ({'distance': 0.5}, 'distance', 'but the path after point 2 is'),
        ({'distance': -0.5}, 'distance', 'but the path before point 2 is'),
        ({'distance': -0.12}, 'distance', 'only when its first motion has returned'),
        ({'distance': 0.01, 'fraction': 0.2}, 'fraction', 'gives the place already'),
        ({'fraction': 1.5}, 'fraction', 'outside -1 to 1'),
        ({'lead': 1.5}, 'offset', 'outside -1 to 60 s'),
    ],
)
def test_places_that_do_not_exist_are_refused(place, field, text):
    with pytest.raises(InvalidGoal, match=f'io_commands.0..{field} .*{text}'):
        JudgedRun(RobotInMemory('ur5e'), by_kind('stops', [command(2, 0, **place)]))


def test_a_lead_that_would_close_a_valve_before_it_opens_is_refused():
    bead = [command(2, 0, distance=0.01), command(2, 0, 0.0, distance=0.012, lead=0.1)]
    with pytest.raises(
        InvalidGoal, match=r'io_commands.1..offset makes a lead of 0.1 s, with which that'
    ):
        JudgedRun(RobotInMemory('ur5e'), by_kind('stops', bead))


def test_a_named_lead_is_refused_by_its_name():
    valve = Lead(name='gun', output=OutputKind.STANDARD_DIGITAL, pin=0, open=0.9, close=0.0)
    state = RobotInMemory('ur5e').place(HOME, TOOL)
    seam = by_kind('stops', [command(3, 1), command(1, 0, distance=-0.045, lead='gun')])
    options = replace(OPTIONS, leads=(valve,))
    with pytest.raises(InvalidGoal, match=r'io_commands.1..lead is 0.9 s.* the longest lead'):
        plan(seam(state.actual_tcp_pose), state, ARM, options)


def test_more_leads_than_the_program_follows_are_refused():
    many = [command(2, pin, distance=0.02, lead=0.1) for pin in range(8)]
    many.append(command(2, 0, distance=0.02, lead=0.1, output=OutputKind.TOOL_DIGITAL))
    with pytest.raises(InvalidGoal, match=r'io_commands.8..offset is one of more than 8 leads'):
        JudgedRun(RobotInMemory('ur5e'), by_kind('stops', many))


def drawn(number):
    """Return the goal of a random case, a function of its first pose; its kind, its slider."""
    random = random_of('places', number)
    kind = random.choice(['stops', 'blends', 'rounded', 'spline'])
    speed = random.uniform(0.05, 0.25)
    slider = SLIDERS[random.choice(list(SLIDERS))]
    commands = []
    for pin in range(8):
        place = random.choice(
            [
                {'distance': random.uniform(-0.03, 0.03)},
                {'fraction': random.uniform(-0.9, 0.9)},
                {},
            ]
        )
        lead = random.choice([0.0, random.uniform(0.002, 0.2)])
        commands.append(command(random.randint(1, 3), pin, lead=lead, **place))
    return by_kind(kind, commands, speed), kind, slider


def is_accepted(robot, goal_of):
    state = robot.place(HOME, TOOL)
    try:
        plan(goal_of(state.actual_tcp_pose), state, ARM, OPTIONS)
    except InvalidGoal:
        return False
    return True


@pytest.mark.random
@pytest.mark.parametrize('number', range(cases(200)))
def test_random_places_and_leads(number):
    goal_of, kind, slider = drawn(number)
    robot = RobotInMemory('ur5e')
    if is_accepted(robot, goal_of):
        # How long the controller takes in a blend is known less well.
        bound = 2.5 if kind == 'blends' else BOUND
        assert misses(JudgedRun(robot, goal_of, slider), path_time_of(robot, goal_of), bound) == {}


@pytest.mark.random
def test_many_random_places_and_leads_are_possible():
    robot, count = RobotInMemory('ur5e'), cases(200)
    assert sum(is_accepted(robot, drawn(i)[0]) for i in range(count)) > 0.3 * count
