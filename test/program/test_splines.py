# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Splines on the robot, cycle by cycle: the arm follows them in time, or the program refuses them.

The uploaded program runs on the simulated controller without sockets and clocks; the wanted motion
is a polynomial that is computed here.
"""

from itertools import cycle

import numpy as np
import pytest
from robot_in_memory import RobotInMemory

from ur_cartesian_driver.motion.events import TrajectoryResult
from ur_cartesian_driver.motion.geometry.pose import IDENTITY
from ur_cartesian_driver.motion.geometry.vectors import vector6
from ur_cartesian_driver.motion.plan.primitive import MoveJ, Spline
from ur_cartesian_driver.program import wrap_in_program
from ur_cartesian_driver.program.render import PREFIX
from ur_cartesian_driver.protocol.program.trajectory_points import encode_points

START = np.array([0.3, -1.4, 1.5, -1.6, -1.5, 0.2])
SIZE = np.array([0.5, 0.3, 0.4, 0.5, 0.4, 0.8])
PULSE = np.array([0.7, 0.9, 1.1, 1.3, 1.7, 2.1])
HOME = tuple(START.tolist())
STILL = (0.0,) * 6
STEP = 0.002


@pytest.fixture(scope='module')
def robot():
    return RobotInMemory('ur5e')


def state(time, end):
    """Position, velocity, acceleration of a swing from rest at 0 to rest at ``end`` [s]."""
    x = time / end
    u = end * x**3 * (10 - 15 * x + 6 * x**2)
    v, a = 30 * x**2 * (1 - x) ** 2, 60 * x * (1 - x) * (1 - 2 * x) / end
    s, c = np.sin(PULSE * u), np.cos(PULSE * u)
    return (
        START + SIZE * (1 - c),
        SIZE * PULSE * s * v,
        SIZE * PULSE * (PULSE * c * v**2 + s * a),
    )


def pieces(durations, quintic=True):
    """Return the splines that lead along the swing."""
    times = np.cumsum(durations)
    result = []
    for time, duration in zip(times, durations, strict=True):
        q, qd, qdd = (vector6(map(float, row)) for row in state(time, times[-1]))
        result.append(
            Spline(
                target=q, velocities=qd, accelerations=qdd if quintic else None, duration=duration
            )
        )
    return result


def polynomial(splines, times):
    """Solve each piece for its coefficients and return the positions (n, 6) at times [s]."""
    rows, begin = np.empty((len(times), 6)), 0.0
    boundary = [START, np.zeros(6), np.zeros(6)]
    for piece in splines:
        n, t = (4 if piece.accelerations is None else 6), piece.duration
        end = [piece.target, piece.velocities, piece.accelerations or STILL]
        half = n // 2
        lines = [
            [
                np.prod(np.arange(k, k - d, -1)) * x ** max(k - d, 0) if k >= d else 0.0
                for k in range(n)
            ]
            for x in (0.0, t)
            for d in range(half)
        ]
        c = np.linalg.solve(np.array(lines), np.array(boundary[:half] + end[:half]))
        here = times >= begin
        rows[here] = np.vander(times[here] - begin, n, increasing=True) @ c
        boundary, begin = [np.array(row) for row in end], begin + t
    rows[times >= begin] = splines[-1].target
    return rows


#: Three tenths of a step, so that no piece ends where a step does.
ODD = 0.0606


@pytest.mark.slow
@pytest.mark.parametrize(
    'splines',
    [
        pieces([ODD] * 50),
        pieces([ODD] * 50, quintic=False),
        pieces([0.5, 0.7, 1.1, 0.301]),
        pieces([0.0011] * 7 + [0.8] + [0.0031] * 40 + [1.2]),
    ],
    ids=['quintic', 'cubic', 'long', 'some shorter than a step'],
)
def test_the_arm_is_on_the_polynomial_in_every_cycle(robot, splines):
    robot.place(HOME, IDENTITY)
    run = robot.run(splines)
    assert not run.failure
    times = STEP * (np.arange(len(run.joints)) + 1)
    assert np.abs(run.joints - polynomial(splines, times)).max() < 4e-5
    assert run.q == pytest.approx(splines[-1].target, abs=1e-6)
    end = sum(piece.duration for piece in splines)
    assert end < run.duration < end + 6 * STEP


SLIDERS = {
    'half': [0.5],
    'slow': [0.11],
    'nearly full': [0.99],
    'odd': [0.7],
    'changing': [1.0] * 90 + [0.3] * 200 + [0.75] * 100,
    'paused': [1.0] * 150 + [0.0] * 100,
}


@pytest.mark.slow
@pytest.mark.parametrize('slider', SLIDERS.values(), ids=SLIDERS)
def test_in_scaled_time_path_and_time_are_the_same(robot, slider):
    robot.place(HOME, IDENTITY)
    splines = pieces([ODD] * 15)
    law, scaled = cycle(slider), []

    def slide(controller):
        scaled.append((scaled[-1] if scaled else 0.0) + STEP * controller.motion.scaling)
        controller.set_slider(next(law))

    run = robot.run(splines, on_cycle=slide)
    assert not run.failure
    fine = np.arange(0.0, sum(piece.duration for piece in splines), 5e-5)
    path = polynomial(splines, fine)
    for now, q in list(zip(scaled, run.joints, strict=True))[:: len(scaled) // 60]:
        distance = np.abs(path - q).max(axis=1)
        at = int(distance.argmin())
        assert distance[at] < 2e-4
        if 0.1 < fine[at] < fine[-1] - 0.1:
            assert abs(now - fine[at]) < 4 * STEP
    robot.controller.set_slider(1.0)


@pytest.mark.slow
@pytest.mark.parametrize('slider', [1.0, 0.5, 0.25])
def test_the_acceleration_is_that_of_the_polynomial_at_any_slider(robot, slider):
    """No train of pulses: a step of the spline that lasts several cycles changes speed in all."""
    robot.place(HOME, IDENTITY)
    robot.controller.set_slider(slider)
    splines = pieces([ODD] * 25)
    fine = np.arange(0.0, sum(piece.duration for piece in splines), 1e-4)
    greatest = np.abs(np.diff(polynomial(splines, fine), 2, axis=0)).max() / 1e-8
    for _ in range(200):  # the slider takes its time
        robot.controller.step()
    run = robot.run(splines)
    robot.controller.set_slider(1.0)
    assert not run.failure
    accelerations = np.abs(np.diff(run.joints, 2, axis=0)) / STEP**2
    assert accelerations.max() < 1.2 * greatest * slider**2


@pytest.mark.slow
@pytest.mark.parametrize(('steps', 'bound'), [(1, 1.4e-4), (3, 3.5e-4)])
def test_a_call_that_comes_late_keeps_the_arm_near_its_path(steps, bound):
    """Bounds as tight as for a program that always allows 40 rad/s^2."""

    def edit(text):
        late = '  calls = calls + 1\n  if calls % 100 == 0:\n' + '    sync()\n' * steps + '  end\n'
        return wrap_in_program(f'calls = 0\n{text}'.replace('  speedj(', f'{late}  speedj('))

    robot = RobotInMemory('ur5e', edit=edit)
    robot.place(HOME, IDENTITY)
    splines = pieces([ODD] * 50)
    run = robot.run(splines)
    assert not run.failure
    path = polynomial(splines, np.arange(0.0, sum(piece.duration for piece in splines), 1e-4))
    assert max(np.abs(path - q).max(axis=1).min() for q in run.joints[::3]) < bound
    assert (np.abs(np.diff(run.joints, 2, axis=0)) / STEP**2).max() < 40.5


@pytest.mark.slow
@pytest.mark.exhaustive
@pytest.mark.parametrize('moment', [0.8, 1.5, 1.7])
def test_a_pause_keeps_the_arm_near_its_path(robot, moment):
    """Bound as tight as for a program that always allows 40 rad/s^2."""
    robot.place(HOME, IDENTITY)
    splines = pieces([ODD] * 50)
    cycles = []

    def pause(controller):
        cycles.append(controller.time)
        if len(cycles) == round(moment / STEP):
            assert controller.programs.pause() == ''
        elif len(cycles) == round((moment + 0.8) / STEP):
            assert controller.programs.play() == ''

    run = robot.run(splines, on_cycle=pause)
    assert not run.failure
    path = polynomial(splines, np.arange(0.0, sum(piece.duration for piece in splines), 1e-4))
    assert max(np.abs(path - q).max(axis=1).min() for q in run.joints[::3]) < 1.4e-3
    assert (np.abs(np.diff(run.joints, 2, axis=0)) / STEP**2).max() < 40.5


@pytest.mark.exhaustive
def test_splines_do_not_drift_within_minutes(robot):
    """A place that is passed every second is passed at the second, to the end."""
    there, back = tuple(START + 0.05), tuple(START - 0.05)
    fast = (0.15,) * 6
    splines = [
        Spline(
            target=there if k % 2 else back,
            velocities=STILL,
            accelerations=STILL,
            duration=0.50031,
        )
        for k in range(239)
    ]
    splines.append(Spline(target=tuple(START), velocities=STILL, duration=0.50031))
    slow = robot.slow
    slow.place(HOME, IDENTITY)
    run = slow.run(splines)
    assert not run.failure
    step = slow.controller.cycle
    times = step * (np.arange(len(run.joints)) + 1)
    late = np.abs(run.joints - polynomial(splines, times)).max(axis=1)
    assert late[-int(10.0 / step) :].max() < 2 * step * max(fast)


@pytest.mark.parametrize('quintic', [True, False], ids=['quintic', 'cubic'])
@pytest.mark.parametrize('model', ['ur5', 'ur5e'])
def test_a_spline_that_brakes_hard_ends_at_its_end(model, quintic):
    """From a speed to rest at about the greatest acceleration, or at more than an arm may have."""
    robot = RobotInMemory(model)
    direction = SIZE / SIZE.max()
    for speed, seconds in ((0.7, 0.029), (1.2, 0.049), (1.6, 0.047), (1.9, 0.052), (2.5, 0.069)):
        begin = 0.25 * speed
        splines = [
            Spline(
                target=tuple((START + direction * far).tolist()),
                velocities=tuple((direction * v).tolist()),
                accelerations=STILL if quintic else None,
                duration=duration,
            )
            for far, v, duration in (
                (begin, speed, 0.5),
                (begin + 0.45 * speed * seconds, 0.0, seconds),
            )
        ]
        robot.place(HOME, IDENTITY)
        run = robot.run(splines)
        assert not run.failure
        assert np.abs(np.subtract(run.q, splines[-1].target)).max() < 1.1e-5
        accelerations = np.diff(run.joints, 2, axis=0) / robot.controller.cycle**2
        assert np.abs(accelerations).max() < 40.5


# ---- the rules of the contract -----------------------------------------------------------------


def spline(offset, duration, qd=0.0, **changes):
    return Spline(target=tuple(START + offset), velocities=(qd,) * 6, duration=duration, **changes)


@pytest.mark.parametrize(
    ('offset', 'result'), [(0.003, TrajectoryResult.SUCCESS), (0.006, TrajectoryResult.CANCELED)]
)
def test_a_first_point_without_time_is_where_the_arm_is(robot, offset, result):
    robot.place(HOME, IDENTITY)
    assert robot.run([spline(offset, 0.0), spline(0.1, 0.5)]).result is result


def test_a_later_point_without_time_is_canceled(robot):
    robot.place(HOME, IDENTITY)
    run = robot.run([spline(0.1, 0.5), spline(0.1, 0.0), spline(0.2, 0.5)])
    assert run.result is TrajectoryResult.CANCELED
    assert run.q == pytest.approx(START + 0.1, abs=1e-5)


@pytest.mark.parametrize(
    ('duration', 'result'), [(0.049, TrajectoryResult.CANCELED), (0.051, TrajectoryResult.SUCCESS)]
)
def test_more_than_20_rad_per_second_is_canceled(robot, duration, result):
    """A slower piece runs, in the time that the joints need."""
    robot.place(HOME, IDENTITY)
    run = robot.run([spline(1.0 * np.eye(6)[5], duration)])
    assert run.result is result


def test_an_unknown_spline_kind_is_a_failure(robot):
    robot.place(HOME, IDENTITY)
    data = bytearray(encode_points([spline(0.1, 0.5)]))
    data[19 * 4 : 20 * 4] = (3).to_bytes(4, 'big')
    run = robot.run([], data=bytes(data), announced_count=1)
    assert run.result is TrajectoryResult.FAILURE
    assert run.q == pytest.approx(START)


def test_another_motion_discards_speed_and_acceleration(robot):
    """The spline after it begins at rest: it does not swing back first."""
    robot.place(HOME, IDENTITY)
    moves = [spline(0.1, 0.5, qd=0.4), MoveJ(target=tuple(START + 0.3)), spline(0.4, 1.0)]
    run = robot.run(moves)
    assert not run.failure
    last = run.joints[-500:]
    assert (np.diff(last[:, 0]) > -1e-6).all()
    assert last[250, 0] == pytest.approx(START[0] + 0.35, abs=0.005)


def test_a_cubic_piece_discards_the_acceleration(robot):
    robot.place(HOME, IDENTITY)
    moves = [
        Spline(
            target=tuple(START + 0.1),
            velocities=(0.3,) * 6,
            accelerations=(0.8,) * 6,
            duration=0.5,
        ),
        spline(0.2, 0.5, 0.1),
        Spline(target=tuple(START + 0.25), velocities=STILL, accelerations=STILL, duration=0.6),
    ]
    run = robot.run(moves)
    times = STEP * (np.arange(len(run.joints)) + 1)
    assert np.abs(run.joints - polynomial(moves, times)).max() < 4e-5


def test_a_blend_into_a_spline_becomes_a_stop(robot):
    robot.place(HOME, IDENTITY)
    run = robot.run([MoveJ(target=tuple(START + 0.3), blend_radius=0.05), spline(0.4, 1.0)])
    assert not run.failure
    assert run.q == pytest.approx(START + 0.4, abs=1e-6)
    changes = np.diff(np.diff(run.joints, axis=0), axis=0) / STEP**2
    assert np.abs(changes).max() < 30.0


@pytest.mark.parametrize('announced_count', [2, 9], ids=['at its end', 'in the middle'])
def test_the_last_point_ends_at_rest_whatever_it_says(robot, announced_count):
    """Braked on the way where it is the last, by stopj where the points run dry."""
    robot.place(HOME, IDENTITY)
    points = [spline(0.2, 0.5, qd=0.6), spline(0.5, 0.5, qd=0.6)]
    run = robot.run(points, announced_count=announced_count)
    changes = np.diff(np.diff(run.joints, axis=0), axis=0) / STEP**2
    assert np.abs(run.joints[-1] - run.joints[-2]).max() < 1e-9
    assert np.abs(changes).max() < 45.0
    if announced_count == 2:
        assert run.result is TrajectoryResult.SUCCESS
        assert run.q == pytest.approx(points[-1].target, abs=1e-4)
        assert run.duration < 1.1
    else:
        assert run.result is TrajectoryResult.FAILURE
        assert 0.0 < run.q[0] - points[-1].target[0] < 0.6**2 / 2 / 4.0 + 2 * STEP * 0.6


def test_a_spline_waits_during_a_pause_as_moves_do(robot):
    """An arm that stands needs no point within one step: there are 0.5 s."""
    robot.place(HOME, IDENTITY)
    first, second = spline(0.1, 0.5), spline(0.2, 0.5)
    late = []

    def send_later(controller):
        if len(late) == 400:
            robot.feed([second])
        late.append(controller.time)

    run = robot.run([first], announced_count=2, on_cycle=send_later)
    assert run.result is TrajectoryResult.SUCCESS
    assert run.q == pytest.approx(second.target, abs=1e-6)


# ---- the text is what runs ---------------------------------------------------------------------


def test_no_variable_begins_as_an_int_and_is_given_a_fraction(widened):
    robot = RobotInMemory('ur5e')
    for quintic in (True, False):
        robot.place(HOME, IDENTITY)
        assert not robot.run(pieces([0.0011, 0.3, 0.4031], quintic)).failure
    assert widened == set()


@pytest.mark.slow
@pytest.mark.exhaustive
@pytest.mark.parametrize(
    ('line', 'replacement', 'size'),
    [
        ('SPLINE_CORRECTION', '0.0 * SPLINE_CORRECTION', 1e-5),
        ('10 * x - 4 * y', '9 * x - 4 * y', 1e-3),
        ('spline_time = spline_time - duration', 'spline_time = 0', 1e-3),
        ('spline_qdd = qdd', 'spline_qdd = 0 * qdd', 1e-4),
    ],
)
def test_a_changed_program_changes_the_motion(line, replacement, size):
    """So the tests above would find it."""

    def edit(text):
        rows = text.replace(PREFIX, '').splitlines()
        assert any(line in row for row in rows)
        return wrap_in_program(
            '\n'.join(
                row if row.startswith('SPLINE_') else row.replace(line, replacement)
                for row in rows
            )
        )

    splines = pieces([0.0603] * 20)
    robot = RobotInMemory('ur5e', edit=edit)
    robot.place(HOME, IDENTITY)
    run = robot.run(splines)
    times = STEP * (np.arange(len(run.joints)) + 1)
    assert np.abs(run.joints - polynomial(splines, times)).max() > size
