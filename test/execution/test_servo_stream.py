# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Streamed set-points before a robot that is a buffer, a clock and registers, and no more.

Slider, pauses and the wire do what they want; what must not happen are set-points that are lost,
out of order or too many, and a buffer that runs empty although little was late.
"""

from math import inf

from hypothesis import given, settings
from hypothesis import strategies as st
import numpy as np
import pytest
from servo_cell import OpenLoopStream

from ur_cartesian_driver.execution.servo.servo_clock import ServoClock
from ur_cartesian_driver.execution.servo.servo_stream import (
    ServoEvent,
    ServoPhase,
    ServoSettings,
    ServoStream,
    TRANSITIONS,
)
from ur_cartesian_driver.execution.servo.setpoint_source import SplineSetpoints
from ur_cartesian_driver.motion.plan.joint_spline import JointSpline
from ur_cartesian_driver.motion.plan.primitive import Spline
from ur_cartesian_driver.motion.state.servo_report import ServoActivity, ServoFeedback
from ur_cartesian_driver.protocol.program.registers import SERVO_INPUTS, ServoMode

STEP = 0.002
DEPTH = 250
#: How fast a controller changes its speed scaling [1/s].
SLIDER_SLEW = 4.0
SETTINGS = ServoSettings(buffer_depth=DEPTH)
HOME, OUT = (0.0,) * 6, (0.3,) * 6
REST = (0.0,) * 6


class Ramp:
    """Set-points whose every joint is the time that was asked for [s]."""

    def __init__(self, end=np.inf):
        self.time, self.end = 0.0, end

    def next(self, dt):
        self.time = min(self.time + dt, self.end)
        return (self.time,) * 6

    @property
    def done(self):
        return self.time >= self.end - 1e-9


class Robot:
    """The robot program of the buffered servo, as little of it as the registers show."""

    def __init__(self, step=STEP):
        self.step, self.cycles, self.scale, self.playing = step, 0, 1.0, True
        self.inputs, self.mode, self.sequence = None, 0, 7
        self.state_time, self.newest, self.rows = 0.0, np.array(REST), []
        self.done, self.most, self.empty, self.credit, self.skipped = [], 0, 0, 0.0, 0

    def cycle(self, slider=1.0):
        """Let a cycle pass; return the packet."""
        self.cycles += 1
        change = SLIDER_SLEW * self.step
        self.scale = min(max(slider, self.scale - change), self.scale + change)
        if self.playing:
            self._read()
            self.credit = min(self.credit + self.scale, 1.0 + self.scale)
            if self.credit >= 1.0 and self.mode == ServoMode.SERVO:
                self.credit -= 1.0
                if self.rows:
                    self.done.append(self.rows.pop(0))
                else:
                    self.empty += 1
        return ServoFeedback(
            timestamp=60.0 + self.cycles * self.step,
            effective_speed=self.scale,
            playing=self.playing,
            mode=self.mode,
            last_sequence=self.sequence,
            lag=len(self.rows) * self.step,
            setpoints_done=len(self.done),
            buffer_size=len(self.rows),
            skipped=self.skipped,
        )

    def _read(self):
        if self.inputs is None or self.inputs['input_int_register_25'] <= self.sequence:
            return
        row, sequence = self.inputs, self.inputs['input_int_register_25']
        self.skipped += sequence - self.sequence - 1 if self.mode else 0
        self.sequence = sequence
        if row['input_int_register_24'] != self.mode:
            self.mode, self.rows = row['input_int_register_24'], []
            self.state_time = row['input_double_register_46'] - self.step
        steps = round((row['input_double_register_46'] - self.state_time) / self.step)
        if self.mode == ServoMode.SERVO and steps > 0:
            q = np.array([row[f'input_double_register_{i}'] for i in range(24, 30)])
            for part in range(1, steps + 1):
                self.rows.append(self.newest + part / steps * (q - self.newest))
            self.newest, self.state_time = q, row['input_double_register_46']
            self.most = max(self.most, len(self.rows))


def run(stream, robot, *, seconds, slider=lambda t: 1.0, stalls=(), begin=True, watch=None):
    """
    Let robot and stream talk.

    :param stalls: (first cycle, cycles): nothing comes through to the driver, then all at once.
    """
    waiting = []
    for cycle in range(round(seconds / robot.step)):
        waiting.append(robot.cycle(slider(cycle * robot.step)))
        if any(first <= cycle < first + long for first, long in stalls):
            continue
        for feedback in waiting:
            row = stream.on_feedback(feedback, cycle * robot.step)
            if row is not None:
                robot.inputs = dict(zip(SERVO_INPUTS, row, strict=True))
        waiting = []
        if begin and stream.phase is ServoPhase.READY:
            stream.begin()
        if watch is not None:
            watch()
        if stream.phase is ServoPhase.ARRIVED:
            return cycle
    return None


def spaced(pauses):
    """Return stalls as (first, cycles) from (cycles between, cycles)."""
    stalls, cycle = [], 100
    for between, long in pauses:
        cycle += between
        stalls.append((cycle, long))
        cycle += long
    return stalls


SLIDERS = st.lists(st.floats(0.0, 1.0), min_size=1, max_size=5).map(
    lambda levels: lambda t: levels[min(int(t / 0.3), len(levels) - 1)]
)


@pytest.mark.slow
@given(
    slider=SLIDERS, pauses=st.lists(st.tuples(st.integers(30, 200), st.integers(0, 8)), max_size=6)
)
@settings(max_examples=15, deadline=None)
def test_the_buffer_neither_runs_empty_nor_over_where_little_is_late(slider, pauses):
    stream, robot = ServoStream(Ramp(), SETTINGS), Robot()
    empties = []

    def watch():
        if stream.phase is ServoPhase.SERVOING:
            empties.append(robot.empty)
        assert stream.in_flight <= SETTINGS.max_lag

    run(stream, robot, seconds=1.6, slider=slider, stalls=spaced(pauses), watch=watch)
    assert empties[0] == empties[-1], 'it never ran empty once the motion had begun'
    assert robot.most <= DEPTH
    times = np.array([q[0] for q in robot.done])
    assert np.diff(times).min() >= 0.0
    moving = np.diff(times)[np.diff(times) > 0.0]
    assert moving == pytest.approx(STEP, abs=1e-9), 'each step of the motion, and none twice'


@pytest.mark.slow
@given(
    slider=SLIDERS, pauses=st.lists(st.tuples(st.integers(1, 60), st.integers(0, 150)), max_size=6)
)
@settings(max_examples=15, deadline=None)
def test_whatever_is_late_nothing_is_lost_and_the_motion_arrives(slider, pauses):
    source = Ramp(end=0.4)
    stream, robot = ServoStream(source, SETTINGS), Robot()

    def raised(t):
        return slider(t) if t < 1.5 else 1.0

    assert run(stream, robot, seconds=8.0, slider=raised, stalls=spaced(pauses)) is not None
    assert robot.most <= DEPTH
    times = np.array([q[0] for q in robot.done])
    assert times[-1] == pytest.approx(0.4)
    assert np.diff(times).min() >= 0.0
    assert np.diff(times).max() <= STEP + 1e-9, 'no step of the arm is longer than one of time'


def test_a_driver_that_was_silent_for_long_goes_on_from_rest_and_says_so():
    stream, robot = ServoStream(Ramp(), SETTINGS), Robot()
    run(stream, robot, seconds=1.5, stalls=[(200, 60)])
    report = stream.report()
    assert report.underruns == 1
    assert report.activity is ServoActivity.SERVOING
    steps = np.diff([q[0] for q in robot.done])
    stood = int(np.flatnonzero(steps[150:] < 0.1 * STEP)[-1]) + 150
    assert np.abs(np.diff(steps[stood:])).max() < 0.02 * STEP, 'faster and faster, no jump'


def test_a_paused_program_is_sent_no_more_than_is_under_way():
    stream, robot = ServoStream(Ramp(), SETTINGS), Robot()
    run(stream, robot, seconds=0.5)
    robot.playing = False
    before = stream.report().setpoints_sent
    run(stream, robot, seconds=2.0)
    assert stream.report().setpoints_sent - before <= SETTINGS.max_lag / STEP
    robot.playing = True
    run(stream, robot, seconds=0.5)
    steps = np.diff([q[0] for q in robot.done])
    assert steps[steps > 0.0] == pytest.approx(STEP, abs=1e-9)


def test_with_the_loop_open_the_lag_grows_by_what_the_slider_takes():
    stream, robot = OpenLoopStream(Ramp(), ServoSettings(max_lag=0.5)), Robot()
    run(stream, robot, seconds=0.2)
    lags = []
    run(
        stream,
        robot,
        seconds=0.8,
        slider=lambda t: 0.5,
        watch=lambda: lags.append(stream.in_flight),
    )
    assert lags[-1] - lags[150] == pytest.approx(0.5 * (len(lags) - 151) * STEP, abs=0.01)


@pytest.mark.parametrize('step', [0.002, 0.008])
def test_the_control_step_is_learnt_from_the_packets(step):
    stream, robot = ServoStream(Ramp(end=0.4), SETTINGS), Robot(step)
    assert run(stream, robot, seconds=2.0) is not None
    assert np.diff([q[0] for q in robot.done]).max() == pytest.approx(step)


def test_thresholds_are_written_before_the_mode_is():
    stream, robot = ServoStream(Ramp(), SETTINGS), Robot()
    rows = []
    for cycle in range(40):
        row = stream.on_feedback(robot.cycle(), cycle * STEP)
        if row is not None:
            robot.inputs = dict(zip(SERVO_INPUTS, row, strict=True))
            rows.append(robot.inputs)
        if cycle == 20:
            assert stream.phase is ServoPhase.READY
            stream.begin()
    modes = [row['input_int_register_24'] for row in rows]
    assert modes == sorted(modes)
    assert {*modes} == {ServoMode.IDLE, ServoMode.SERVO}
    assert all(row['input_double_register_35'] == SETTINGS.max_divergence for row in rows)
    numbers = [row['input_int_register_25'] for row in rows]
    assert numbers == list(range(8, 8 + len(rows))), 'they begin behind what the robot has read'


def test_stop_is_written_at_once_and_with_a_new_number():
    stream, robot = ServoStream(Ramp(), SETTINGS), Robot()
    run(stream, robot, seconds=0.5)
    row = dict(zip(SERVO_INPUTS, stream.stop(), strict=True))
    assert row['input_int_register_24'] == ServoMode.IDLE
    assert row['input_int_register_25'] > robot.inputs['input_int_register_25']
    assert stream.stop() is None
    robot.inputs = row
    run(stream, robot, seconds=0.02)
    assert stream.phase is ServoPhase.LEFT


def test_setpoints_are_held_at_a_stop_and_leave_its_rest_out():
    """Joints move to 0.1 rad, rest there for 0.3 s of the path, and move on to 0.2 rad."""
    there, end = (0.1,) * 6, (0.2,) * 6
    spline = JointSpline.of(
        REST,
        [
            Spline(target=target, velocities=REST, accelerations=REST, duration=duration)
            for target, duration in ((there, 0.4), (there, 0.3), (end, 0.4))
        ],
    )
    stream, robot = ServoStream(SplineSetpoints(spline), SETTINGS), Robot()
    stream.next_hold = 0.4
    assert run(stream, robot, seconds=2.0) is None
    assert robot.done[-1] == pytest.approx(np.array(there), abs=1e-12)
    assert stream.source_time == pytest.approx(0.4)
    held = stream.held_time
    assert held > 1.0
    stream.go_on(0.3, inf)
    assert stream.held_time == pytest.approx(held - 0.3)
    times = []
    assert run(
        stream,
        robot,
        seconds=4.0,  # its clock begins at 0 again
        watch=lambda: times.append(robot.inputs['input_double_register_47']),
    )
    assert robot.done[-1] == pytest.approx(np.array(end), abs=1e-12)
    # The time for the robot program counts motion only.
    assert times[0] == pytest.approx(0.4, abs=2.0 * STEP)
    assert times[-1] == pytest.approx(0.8)
    assert np.diff(times).min() >= 0.0


def test_packets_in_one_go_are_answered_once():
    stream, robot = ServoStream(Ramp(), SETTINGS), Robot()
    run(stream, robot, seconds=0.5)
    rows = [stream.on_feedback(robot.cycle(), 10.0) for _ in range(5)]
    assert [row is None for row in rows] == [False, True, True, True, True]


def test_setpoints_lie_on_the_spline():
    spline = JointSpline.of(
        HOME,
        [
            Spline(target=OUT, velocities=REST, accelerations=REST, duration=0.7),
            Spline(target=HOME, velocities=REST, accelerations=REST, duration=0.31),
        ],
    )
    source, time = SplineSetpoints(spline), 0.0
    for dt in (0.0, *[0.002] * 200, 0.004, 0.0, 0.001, *[0.002] * 200, 0.5):
        time += dt
        assert source.next(dt) == pytest.approx(spline.at(time)[0])
    assert source.done


@pytest.mark.slow
@given(
    passed=st.lists(
        st.tuples(st.floats(0.0, 0.1), st.floats(0.0, 1.0), st.floats(0.0, 0.3)), max_size=40
    )
)
def test_the_clock_is_never_negative_nor_fast_and_leaves_the_rest_of_the_buffer(passed):
    clock = ServoClock(step=STEP, target=0.04, max_lag=0.2)
    for time, scaling, in_flight in passed:
        clock.advance(time, scaling, in_flight)
        assert 0.0 <= clock.rate <= 1.5
        assert in_flight + clock.take_steps(in_flight) * STEP <= max(0.2 + 1e-6, in_flight)


@pytest.mark.parametrize('phase', [phase for phase in ServoPhase if phase is not ServoPhase.LEFT])
def test_every_phase_is_left_by_a_stop(phase):
    seen, ahead = set(), {phase}
    while ahead:
        seen |= ahead
        ahead = {
            TRANSITIONS[p][c]
            for p in ahead
            for c in (ServoEvent.STOP, ServoEvent.PROGRAM_LEFT)
            if c in TRANSITIONS[p]
        } - seen
    assert ServoPhase.LEFT in seen


@pytest.mark.parametrize(
    ('changes', 'text'),
    [
        ({'target_lag': 0.3}, 'servo_target_lag'),
        ({'target_lag': 0.001}, 'servo_target_lag'),
        ({'target_lag': 0.1, 'buffer_depth': 20}, 'needs room for 50'),
    ],
)
def test_settings_that_cannot_work_are_refused(changes, text):
    with pytest.raises(ValueError, match=text):
        ServoSettings(**changes)


def test_the_first_write_that_the_arm_follows_has_what_the_source_says_then():
    """A robot program takes the joint positions of that write, even if no set-point is due."""
    source, robot = Ramp(), Robot()
    stream = ServoStream(source, SETTINGS)
    run(stream, robot, seconds=0.1, begin=False)
    assert stream.phase is ServoPhase.READY
    source.time = 0.25  # the arm stands elsewhere by now
    stream.begin()
    row = stream.on_feedback(robot.cycle(), 1.0)
    assert row[0] == ServoMode.SERVO
    assert row[4:10] == (0.25,) * 6
