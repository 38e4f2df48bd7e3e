# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Pulses along the path: the cycle of each rising edge, against the tool's own way.

The judge (``test/support/output_judge.py``) knows nothing of the plan.
"""

from dataclasses import replace

from append_goals import AppendMotion, circle
import numpy as np
from output_judge import judge_pulses, JudgedRun, SLIDERS
import pytest
from random_cases import cases, random_of
from robot_cell import run_cell
from robot_in_memory import RobotInMemory
from traced_run import ARM, HOME, OPTIONS, STEP, TOOL, ZIGZAG

from ur_cartesian_driver.driver.recordings.recording import Recording
from ur_cartesian_driver.motion.errors import GoalRefused, InvalidGoal
from ur_cartesian_driver.motion.geometry.pose import Pose
from ur_cartesian_driver.motion.goal.execution_modes import ExecutionMode
from ur_cartesian_driver.motion.goal.goal import (
    Goal,
    IOCommand,
    OutputKind,
    PulseTrain,
    Segment,
    Waypoint,
)
from ur_cartesian_driver.motion.state.rtde_state import RuntimeState
from ur_cartesian_driver.planning import plan, PlanningOptions

pytestmark = [pytest.mark.acceptance, pytest.mark.slow]

TRAIN = PulseTrain(
    first_waypoint=0,
    last_waypoint=3,
    output=OutputKind.STANDARD_DIGITAL,
    pin=2,
    distance=0.002,
    width=0.004,
)
#: How late or early a pulse may be [cycles].
BOUND = 1.0


def zigzag(home, trains, kind='stops', speed=0.1, points=ZIGZAG, **changes):
    """Return the goal through the points, by one of the ways to pass them."""
    x, y, z = home.position
    last = len(points) - 1
    blend = 0.008 if kind == 'blends' else 0.0
    if kind == 'spline':
        changes['execution'] = ExecutionMode.SPLINE
    if kind == 'rounded':
        changes['corner_deviation'] = 0.001
    return Goal(
        waypoints=tuple(
            Waypoint(
                pose=Pose((x + dx, y + dy, z), home.quaternion),
                time=0.06 / speed * (k + 1) if kind == 'spline' else 0.0,
            )
            for k, (dx, dy) in enumerate(points)
        ),
        segments=()
        if kind == 'spline'
        else tuple(
            Segment(
                velocity=speed,
                acceleration=1.2,
                blend_radius=blend if k < last else 0.0,
                dwell=0.1 if kind == 'dwells' and k < last else 0.0,
            )
            for k in range(len(points))
        ),
        pulses=tuple(trains),
        **changes,
    )


class Run(JudgedRun):
    """One run of a goal with pulses: cycles of the edges by pin, and the count that is told."""

    def __init__(self, robot, goal, slider=lambda cycle: 1.0, act=lambda controller, cycle: None):
        self.counts = []

        def count_and_act(controller, cycle):
            self.counts.append(controller.io.outputs.integers[37])
            act(controller, cycle)

        super().__init__(robot, goal, slider, count_and_act)
        self.rises = [self.cycles(pin, rises=True).tolist() for pin in range(8)]


def assert_in_place(run, *trains, bound=BOUND):
    for train in trains:
        assert judge_pulses(run, train, bound).misses == {}
    return run


@pytest.mark.parametrize('slider', SLIDERS)
@pytest.mark.parametrize('kind', ['stops', 'dwells', 'blends', 'rounded', 'spline'])
def test_each_pulse_comes_in_the_cycle_in_which_it_is_due(kind, slider):
    # How long the way through blends is depends on the slider: the plan says how many fit.
    train = replace(TRAIN, count=70) if kind == 'blends' else TRAIN
    run = Run(RobotInMemory('ur5e'), lambda home: zigzag(home, [train], kind), SLIDERS[slider])
    assert_in_place(run, train)


@pytest.mark.parametrize('speed', [0.001, 0.01, 0.25])
def test_slow_and_fast_tools(speed):
    size = min(1.0, 20.0 * speed)
    points = tuple((size * x, size * y) for x, y in ZIGZAG)
    train = replace(TRAIN, distance=0.003 * size, phase=0.0017 * size, width=0.0)
    run = Run(
        RobotInMemory('ur5e'), lambda home: zigzag(home, [train], speed=speed, points=points)
    )
    assert_in_place(run, train)


def test_trains_of_several_outputs_and_one_after_the_other():
    trains: tuple[PulseTrain, ...] = (
        replace(TRAIN, pin=0, last_waypoint=2, distance=0.0007, width=0.002),
        replace(TRAIN, pin=1, first_waypoint=1, last_waypoint=4, phase=0.004, width=0.016),
        replace(TRAIN, pin=3, first_waypoint=2, last_waypoint=4, distance=0.0041, count=12),
    )
    trains = (*trains, replace(trains[0], first_waypoint=2, last_waypoint=4, distance=0.0009))
    run = Run(RobotInMemory('ur5e'), lambda home: zigzag(home, trains, speed=0.1))
    assert_in_place(run, *trains[1:3])
    both = np.concatenate([run.places(trains[0]), run.places(trains[3])])
    assert np.abs(run.ways[run.rises[0]] - both).max() < 1.6 * 0.1 * STEP


def test_the_program_counts_each_pulse_in_the_cycle_in_which_it_comes():
    trains = [replace(TRAIN, pin=pin, phase=0.0001 * pin, distance=0.001) for pin in (5, 4)]
    run = Run(RobotInMemory('ur5e'), lambda home: zigzag(home, trains))
    counts = np.array(run.counts)
    for slot, pin in enumerate((5, 4)):
        mine = counts // 128**slot % 128
        steps = np.flatnonzero(np.diff(mine, prepend=0) % 128)
        assert (steps + 1).tolist() == run.rises[pin]
        assert len(steps) > 128


def test_a_pause_loses_no_pulse_and_gives_none_twice():
    def act(controller, cycle):
        if cycle in (400, 800):
            controller.programs.pause()
        elif cycle in (500, 900):
            controller.programs.play()

    run = Run(RobotInMemory('ur5e'), lambda home: zigzag(home, [TRAIN]), act=act)
    places = run.places(TRAIN)
    off = run.ways[run.rises[2]] - places
    # The program does not run while the tool coasts into a pause: those pulses come after it.
    late = np.abs(off) > 1.6 * 0.1 * STEP
    assert 0 < late.sum() <= 16  # of 12 mm each
    assert off[late].max() < 0.02
    assert (np.diff(run.rises[2]) > 2).all()


def test_distances_that_a_cycle_cannot_resolve_are_refused_with_what_works():
    def run(distance=0.0005, speed=0.25, width=0.004):
        train = replace(TRAIN, distance=distance, width=width)
        return assert_in_place(
            Run(RobotInMemory('ur5e'), lambda home: zigzag(home, [train], speed=speed)), train
        )

    text = (
        r'pulses.0..distance is 0.5 mm, but from pulse to pulse 6 ms must pass .* at up to '
        r'250 mm/s: the smallest distance at this speed is 1.5 mm, the highest speed for this '
        r'distance 83.33 mm/s; increase the distance, or reduce speed or width'
    )
    with pytest.raises(InvalidGoal, match=text):
        run()
    run(distance=0.0015)
    run(speed=0.0833)
    run(distance=0.001, width=0.002)


@pytest.mark.parametrize(
    ('change', 'field', 'text'),
    [
        ({'output': OutputKind.STANDARD_ANALOG}, '.output', 'gives no pulses'),
        ({'pin': 8}, '.pin', 'there are standard digital outputs 0 to 7'),
        ({'distance': 0.0}, '.distance', 'must be more than 0'),
        ({'width': 2.0}, '.width', 'outside 0 to 1 s'),
        ({'last_waypoint': 5}, '.last_point', 'within the points 0 to 4'),
        ({'last_waypoint': 0}, '.last_point', 'must follow each other'),
        ({'phase': 0.3}, '.phase', 'from point 0 to point 3 is 1.* mm long'),
        ({'count': 100}, '.count', 'with room for 8'),
    ],
)
def test_pulses_that_cannot_be_given_are_refused(change, field, text):
    with pytest.raises(InvalidGoal, match=f'pulses.0.{field} .*{text}'):
        Run(RobotInMemory('ur5e'), lambda home: zigzag(home, [replace(TRAIN, **change)]))


@pytest.mark.parametrize(
    ('trains', 'changes', 'text'),
    [
        ([TRAIN, replace(TRAIN, first_waypoint=2, last_waypoint=4)], {}, 'pulses.1..pin is 2'),
        ([replace(TRAIN, pin=pin) for pin in range(5)], {}, 'pulses names 5 outputs'),
        (
            [TRAIN],
            {
                'io_commands': (
                    IOCommand(
                        waypoint=1,
                        offset=0.0,
                        output=OutputKind.STANDARD_DIGITAL,
                        pin=2,
                        value=1.0,
                    ),
                )
            },
            'io_commands.0..pin is 2, but at its place standard digital output 2 gives pulses',
        ),
        (
            [TRAIN],
            {'keep_open': True, 'execution': ExecutionMode.SERVO},
            'pulses is not empty, but a SERVO goal with keep_open gives no pulses',
        ),
    ],
)
def test_what_drives_an_output_twice_is_refused(trains, changes, text):
    with pytest.raises(GoalRefused, match=text):
        Run(RobotInMemory('ur5e'), lambda home: zigzag(home, trains, **changes))


#: A cell has cycles of 8 ms, in each of which the tool moves by 0.8 mm.
CELL_TRAIN = replace(TRAIN, distance=0.004, width=0.008)


def started(cell, **changes):
    """Start a goal with pulses; return its motion, its train, and its plan."""
    state, train = cell.memory.read(), replace(CELL_TRAIN, **changes)
    planned = plan(zigzag(state.actual_tcp_pose, [train]), state, ARM, PlanningOptions())
    return cell.owner.start(planned), planned


def test_each_pulse_is_reported_and_recorded_with_its_time_and_pose(tmp_path):
    async def scenario(cell):
        motion, planned = started(cell)
        await cell.until(lambda: motion.outcome, 10.0)
        assert motion.outcome.succeeded, motion.outcome.text
        return planned, list(cell.owner.pulses)

    planned, pulses = run_cell(scenario, record_directory=str(tmp_path))
    assert [pulse.number for pulse in pulses] == list(range(41))
    assert {(pulse.output, pulse.pin) for pulse in pulses} == {(TRAIN.output, TRAIN.pin)}
    corners = np.array([waypoint.pose.position for waypoint in planned.goal.waypoints])
    ways = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(corners, axis=0), axis=1)))
    places = np.column_stack(
        [np.interp(0.004 * np.arange(41), ways, corners[:, axis]) for axis in range(3)]
    )
    poses = np.array([pulse.pose.position for pulse in pulses])
    assert np.linalg.norm(poses - places, axis=1).max() < 2.6 * 0.1 * 0.008
    (file,) = tmp_path.glob('*.npz')
    recording = Recording.load(file)
    rows = recording.pulses['standard_digital 2']
    assert np.array_equal(recording.actual_pose[rows, :3], poses)
    times = np.diff([pulse.timestamp for pulse in pulses])
    assert np.allclose(np.diff(recording.time[rows]), times)


def test_pulses_go_on_along_appended_points():
    async def scenario(cell):
        home = cell.memory.read().actual_tcp_pose
        goal = Goal(
            waypoints=tuple(circle(home, 1, 10)),
            keep_open=True,
            execution=ExecutionMode.SPLINE,
            pulses=(replace(CELL_TRAIN, last_waypoint=9),),
        )
        motion = AppendMotion(cell, goal)
        *points, end = circle(home, 11, 10)
        rest = replace(end, time=end.time + 0.1, twist=(0.0,) * 6)
        await motion.append([*points, rest], last=True)
        outcome = await motion.ended()
        assert outcome.succeeded, outcome
        return [pulse.pose.position for pulse in cell.owner.pulses], points

    places, points = run_cell(scenario)
    # The circle has a radius of 50 mm; a chord between two pulses is shorter by 1 um.
    steps = np.linalg.norm(np.diff(places, axis=0), axis=1)
    assert np.abs(steps - 0.004).max() < 2.6 * 0.08 * 0.008
    assert steps.mean() == pytest.approx(0.004, abs=3e-5)
    begin, end = (np.array(points[k].pose.position) for k in (0, -1))
    for place in (begin, end):
        assert np.linalg.norm(places - place, axis=1).min() < 0.004


@pytest.mark.parametrize('end', ['cancel', 'stop', 'protective_stop'])
def test_no_pulse_comes_after_the_end_of_a_goal_and_none_stays_on(end):
    async def scenario(cell):
        motion, _ = started(cell, width=0.02)
        await cell.until(lambda: len(cell.owner.pulses) == 20, 10.0)
        if end == 'cancel':
            cell.owner.cancel()
        else:
            cell.robot.inject(end)
        await cell.until(lambda: motion.outcome, 3.0)
        assert not motion.outcome.succeeded
        outputs = cell.robot.controller.io.digital_out.standard
        await cell.until(lambda: not any(outputs), 0.5)
        given = len(cell.owner.pulses)
        await cell.sleep(0.5)
        assert not any(outputs)
        assert len(cell.owner.pulses) == given < 25

    run_cell(scenario)


def test_a_pause_ends_a_pulse_and_the_goal_gives_all_others():
    async def scenario(cell):
        motion, _ = started(cell, width=0.02)
        controller = cell.robot.controller
        outputs = controller.io.digital_out.standard
        await cell.until(lambda: len(cell.owner.pulses) == 20 and outputs[2], 10.0)
        cell.robot.inject('pause')
        await cell.until(lambda: controller.programs.state is RuntimeState.PAUSED)
        await cell.until(lambda: not outputs[2], 0.3)
        await cell.dashboard('play')
        await cell.until(lambda: motion.outcome, 10.0)
        assert motion.outcome.succeeded, motion.outcome.text
        assert [pulse.number for pulse in cell.owner.pulses] == list(range(41))

    run_cell(scenario)


def drawn(number):
    """Return the goal of a random case, a function of its first pose; its train, its slider."""
    random = random_of('pulses', number)
    kind = random.choice(['stops', 'dwells', 'rounded', 'spline'])
    speed = random.uniform(0.02, 0.25)
    first = random.randint(0, 2)
    train = replace(
        TRAIN,
        first_waypoint=first,
        last_waypoint=random.randint(first + 1, 4),
        distance=random.uniform(0.0005, 0.006),
        phase=random.uniform(0.0, 0.01),
        width=random.choice([0.0, 0.004, 0.01]),
    )
    slider = SLIDERS[random.choice(list(SLIDERS))]
    return (lambda home: zigzag(home, [train], kind, speed)), train, slider


def is_accepted(robot, goal_of):
    state = robot.place(HOME, TOOL)
    try:
        plan(goal_of(state.actual_tcp_pose), state, ARM, OPTIONS)
    except InvalidGoal:
        return False
    return True


@pytest.mark.random
@pytest.mark.parametrize('number', range(cases(200)))
def test_random_trains(number):
    goal_of, train, slider = drawn(number)
    robot = RobotInMemory('ur5e')
    if is_accepted(robot, goal_of):
        assert_in_place(Run(robot, goal_of, slider), train)


@pytest.mark.random
def test_many_random_trains_are_possible():
    robot, count = RobotInMemory('ur5e'), cases(200)
    assert sum(is_accepted(robot, drawn(i)[0]) for i in range(count)) > 0.4 * count
