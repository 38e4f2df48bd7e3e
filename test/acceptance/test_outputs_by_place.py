# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Outputs at places beside points and with leads: the cycle of each edge, against the tool's own way.

The judge knows positions and outputs of the simulated controller in each cycle, and nothing of
the plan. The way of the tool is the sum of its steps; a point is on it where a step is nearest. A
slow run tells when the tool would be at each way at full speed: the time of the path. In any run,
an output is due when no more of this time is left to its place than passes within its lead.
"""

from collections import Counter
from dataclasses import replace
from math import cos

import numpy as np
import pytest
from random_cases import cases, random_of
from robot_in_memory import RobotInMemory
from traced_run import ARM, HOME, OPTIONS, STEP, TracedRun, ZIGZAG

from ur_cartesian_driver.motion.errors import InvalidGoal, NotAvailable
from ur_cartesian_driver.motion.geometry.pose import Pose
from ur_cartesian_driver.motion.goal.execution_modes import ExecutionMode
from ur_cartesian_driver.motion.goal.goal import Goal, IOCommand, OutputKind, Segment, Waypoint
from ur_cartesian_driver.motion.goal.leads import Lead
from ur_cartesian_driver.planning import plan

pytestmark = [pytest.mark.acceptance, pytest.mark.slow]

#: The slider of the runs that tell the time of the path.
SLOW = 0.2
#: How late or early, or how far from there [m] an output may switch near a rest.
REST_CYCLES, REST_BOUND = 10, 1e-4


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


class Run(TracedRun):
    """One run of a goal with commands."""

    def place(self, wanted):
        """Return the way to the place of a command."""
        here = self.way_of(wanted.waypoint)
        if wanted.fraction:
            other = wanted.waypoint + (1 if wanted.fraction > 0.0 else -1)
            return here + abs(wanted.fraction) * (self.way_of(other) - here)
        return here + wanted.distance


class PathTime:
    """The time of the path at full speed, from a run that the slider slows down for resolution."""

    def __init__(self, slow):
        ways, first = np.unique(slow.ways, return_index=True)
        # Rests are no time of the path.
        moving = np.append(0.0, np.cumsum(np.diff(slow.ways) > 0.0))
        self._ways, self._times = ways, SLOW * STEP * moving[first]

    def __call__(self, ways):
        return np.interp(ways, self._ways, self._times)

    def is_near_rest(self, way):
        """Return whether the tool is so slow there that it makes no way that counts."""
        k, speeds = int(np.searchsorted(self._ways, way)), np.diff(self._ways)
        return speeds[max(k - 3, 0) : k + 2].min() < 0.2 * speeds.max()


def misses(run, path_time, bound=1.6):
    """
    Return by how many cycles each output was late or early, if by more than ``bound``.

    An edge beside the cycle in which the output is due is at most one and a half away; the time of
    the path is known to a tenth of a cycle.

    Near a rest the speed tells little of the slider, and the tool makes little way: there the
    bound is wider.
    """
    assert Counter(pin for pin, *_ in run.edges) == Counter(
        wanted.pin for wanted in run.goal.io_commands
    )
    at = {pin: cycle for pin, _, cycle in run.edges}
    times, found = path_time(run.ways), {}
    # Where the tool nearly rests, its way tells little of the time; no slider makes it faster.
    rate = np.minimum(np.diff(times, prepend=0.0) / STEP, 1.0)
    for wanted in run.goal.io_commands:
        place = run.place(wanted)
        left = path_time(place) - times
        ahead = left - max(-wanted.offset, 0.0) * rate
        k = int(np.flatnonzero((ahead <= 0.0) & ((rate > 0.0) | (left <= 0.0)))[0])
        due = k - ahead[k] / min(ahead[k] - ahead[k - 1], -1e-12)
        late = at[wanted.pin] - due
        off = run.ways[at[wanted.pin]] - np.interp(due, np.arange(len(run.ways)), run.ways)
        slow = path_time.is_near_rest(place) or path_time.is_near_rest(run.ways[int(due)])
        if abs(late) > bound and not (slow and (abs(late) < REST_CYCLES or abs(off) < REST_BOUND)):
            found[wanted.pin] = round(float(late), 2)
    return found


def assert_in_time(goal_of, slider):
    robot = RobotInMemory('ur5e')
    run = Run(robot, goal_of, slider)
    assert misses(run, path_time_of(robot, goal_of)) == {}
    return run


def path_time_of(robot, goal_of):
    return PathTime(Run(robot, goal_of, lambda cycle: SLOW))


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

SLIDERS = {
    'full': lambda cycle: 1.0,
    'low': lambda cycle: 0.1,
    'changing': lambda cycle: 0.55 + 0.45 * cos(cycle / 120.0),
    'steps': lambda cycle: (1.0, 0.2, 0.6)[cycle // 130 % 3],
}


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
    full = Run(robot, dwelling)
    assert misses(full, path_time) == {}
    paused = Run(robot, dwelling, act=act)
    assert len(paused.ways) > len(full.ways) + 150
    assert misses(paused, path_time) == {}


def test_the_longest_lead_is_in_the_refusal():
    def seam(lead):
        return by_kind('stops', [command(1, 0, distance=-0.045, lead=lead)])

    text = r'io_commands.0..offset is -0.9 s.* the longest lead here is'
    with pytest.raises(InvalidGoal, match=text) as refusal:
        Run(RobotInMemory('ur5e'), seam(0.9))
    longest = float(str(refusal.value).partition('longest lead here is ')[2].split()[0])
    assert 0.1 < longest < 0.2
    assert_in_time(seam(longest - 0.001), SLIDERS['full'])


@pytest.mark.parametrize('place', [{'distance': -0.01}, {'fraction': 0.1}, {'lead': 0.1}])
def test_goals_to_which_points_can_be_appended_have_neither(place):
    def goal(home):
        return zigzag(home, [command(1, 0, **place)], keep_open=True)

    with pytest.raises(NotAvailable, match='a goal with keep_open switches outputs at its points'):
        Run(RobotInMemory('ur5e'), goal)


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
        Run(RobotInMemory('ur5e'), by_kind('stops', [command(2, 0, **place)]))


def test_a_lead_that_would_close_a_valve_before_it_opens_is_refused():
    bead = [command(2, 0, distance=0.01), command(2, 0, 0.0, distance=0.012, lead=0.1)]
    with pytest.raises(
        InvalidGoal, match=r'io_commands.1..offset makes a lead of 0.1 s, with which that'
    ):
        Run(RobotInMemory('ur5e'), by_kind('stops', bead))


def test_a_named_lead_is_refused_by_its_name():
    valve = Lead(name='gun', output=OutputKind.STANDARD_DIGITAL, pin=0, open=0.9, close=0.0)
    state = RobotInMemory('ur5e').place(HOME, Pose((0.0, 0.02, 0.12)))
    seam = by_kind('stops', [command(3, 1), command(1, 0, distance=-0.045, lead='gun')])
    options = replace(OPTIONS, leads=(valve,))
    with pytest.raises(InvalidGoal, match=r'io_commands.1..lead is 0.9 s.* the longest lead'):
        plan(seam(state.actual_tcp_pose), state, ARM, options)


def test_more_leads_than_the_program_follows_are_refused():
    many = [command(2, pin, distance=0.02, lead=0.1) for pin in range(8)]
    many.append(command(2, 0, distance=0.02, lead=0.1, output=OutputKind.TOOL_DIGITAL))
    with pytest.raises(InvalidGoal, match=r'io_commands.8..offset is one of more than 8 leads'):
        Run(RobotInMemory('ur5e'), by_kind('stops', many))


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
    state = robot.place(HOME, Pose((0.0, 0.02, 0.12)))
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
        bound = 2.5 if kind == 'blends' else 1.6
        assert misses(Run(robot, goal_of, slider), path_time_of(robot, goal_of), bound) == {}


@pytest.mark.random
def test_many_random_places_and_leads_are_possible():
    robot, count = RobotInMemory('ur5e'), cases(200)
    assert sum(is_accepted(robot, drawn(i)[0]) for i in range(count)) > 0.3 * count
