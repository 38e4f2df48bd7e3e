# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Goals that a signal slows, judged by what RTDE reports of the controller's target.

The path is a straight line from rest to rest, whose cubic has a simple inverse: so each reported
place has a time of the plan, and the feed is how fast that time passes.
"""

from dataclasses import dataclass, field, replace
from math import nan
from random import Random
from runpy import run_path

from checkout import CHECKOUT, needs_checkout
import numpy as np
import pytest
from random_cases import cases, random_of, SEED
from recorded_goal import ARM, RecordedGoal
from robot_cell import CYCLE, run_cell

from ur_cartesian_driver.driver.appender import encode_part
from ur_cartesian_driver.driver.ipc.channel import SetFeedOverride
from ur_cartesian_driver.execution.goal.motion_job import AppendJob
from ur_cartesian_driver.motion.errors import ErrorCode
from ur_cartesian_driver.motion.geometry.pose import Pose
from ur_cartesian_driver.motion.goal.execution_modes import ExecutionMode
from ur_cartesian_driver.motion.goal.goal import (
    FeedOverride,
    Goal,
    IOCommand,
    OutputKind,
    Tolerance,
    Waypoint,
)
from ur_cartesian_driver.planning import plan, PlanningOptions
from ur_cartesian_driver.planning.append.append_planner import plan_append, plan_first_part
from ur_cartesian_driver.planning.append.appendable_goal import AppendedPoints

pytestmark = [pytest.mark.acceptance]

EXAMPLE = CHECKOUT / 'examples' / 'fed_bead.py'
#: Of the planned line [m], [s].
LENGTH, TIME = 0.12, 3.0
#: Time between two values of a signal [s].
PERIOD = 0.02
#: The robot's clock is read in cycles, and joint splines are within 0.05 mm of the line: what the
#: measured feed may be beside the true one.
NOISE = 0.01
#: For so long after a person has moved the slider, or a pause, the feed is not measured [s]: the
#: set-points of a SERVO goal are on their way by the old setting.
SETTLING = 0.8
MODES = (ExecutionMode.SPLINE, ExecutionMode.SERVO)
both_modes = pytest.mark.parametrize('mode', MODES, ids=lambda mode: mode.name)


class FedLine(RecordedGoal):
    """A line along y whose feed a signal overrides."""

    @classmethod
    def begin(cls, cell, mode, bounds, **fields):
        return cls.along_y(
            cell,
            LENGTH,
            TIME,
            execution=mode,
            path_tolerance=Tolerance(position=(0.001,) * 3),
            goal_time_tolerance=0.3,
            feed_override=bounds,
            **fields,
        )

    def send(self, fraction, age=0.0):
        number = len(self.cell.owner.motions)
        self.cell.owner.send(SetFeedOverride(motion=number, fraction=fraction, age=age))

    async def end(self, signal=lambda time: None):
        """Run to the end; return the outcome."""
        await self.until(lambda: self.motion.outcome, signal)
        return self.motion.outcome

    async def until(self, condition, signal):
        """Wait; a signal is asked every PERIOD, with the time since the start [s]."""
        begin = due = self.cell.memory.read().timestamp

        def looked():
            nonlocal due
            state = self.cell.collect(self.states)
            if state.timestamp >= due:
                due = state.timestamp + PERIOD
                signal(state.timestamp - begin)
            return condition()

        await self.cell.until(looked, 120.0)

    def planned_times(self):
        """Return the time of the plan at each reported place (n,) [s], by the inverse cubic."""
        way = np.clip(self.target[:, 1] / LENGTH, 0.0, 1.0)
        return TIME * (0.5 - np.sin(np.arcsin(1.0 - 2.0 * way) / 3.0))

    def feeds(self, window=0.04):
        """
        Return times, places in the plan [s] and feeds in the middle of the line, (n,) each.

        The feed is the mean over a window [s], relative to the slider.
        """
        times, planned = self.times, self.planned_times()
        slider = np.array([state.target_speed_fraction for state in self.states])
        ends = np.searchsorted(times, times + window)
        begins = np.flatnonzero((ends < len(times)) & (planned > 0.1 * TIME))
        begins = begins[planned[ends[begins]] < 0.9 * TIME]
        ends = ends[begins]
        passed = times[ends] - times[begins]
        rates = (planned[ends] - planned[begins]) / passed / slider[begins]
        return 0.5 * (times[begins] + times[ends]), planned[begins], rates


@both_modes
def test_a_signal_scales_the_speed_and_no_time_is_missed(mode):
    bounds = FeedOverride(minimum=0.2, rate=2.0)

    async def scenario(cell):
        line = FedLine.begin(cell, mode, bounds)
        return line, await line.end(lambda time: line.send(0.5))

    line, outcome = run_cell(scenario)
    assert outcome.code is ErrorCode.SUCCESSFUL, outcome
    times, _, feeds = line.feeds()
    late = times > times[0] + 0.5
    assert feeds[late] == pytest.approx(0.5, abs=NOISE)
    assert line.target[-1] == pytest.approx((0.0, LENGTH, 0.0), abs=5e-5)
    assert any('the feed went down to 20%' in each for each in outcome.report), outcome.report
    # The goal says itself how fast it goes.
    assert line.motion.progress[-5].feed_override == pytest.approx(0.5)


@both_modes
def test_without_a_signal_the_goal_takes_the_longest_time_that_its_report_says(mode):
    async def scenario(cell):
        line = FedLine.begin(cell, mode, FeedOverride(minimum=0.4))
        return line, await line.end()

    line, outcome = run_cell(scenario)
    assert outcome.code is ErrorCode.SUCCESSFUL, outcome
    _, _, feeds = line.feeds()
    assert feeds == pytest.approx(0.4, abs=NOISE)
    assert np.ptp(line.times) == pytest.approx(TIME / 0.4, abs=0.5)


@both_modes
def test_an_analog_input_gives_the_feed_and_a_broken_wire_the_lower_bound(mode):
    async def scenario(cell):
        cell.robot.controller.io.analog_in[1] = 0.012  # the middle of 4 to 20 mA
        line = FedLine.begin(cell, mode, FeedOverride(minimum=0.2, rate=2.0))

        def signal(time):
            line.send(1.0)  # no client can set the feed
            if time > 3.0:
                cell.robot.controller.io.analog_in[1] = 0.0

        return line, await line.end(signal)

    line, outcome = run_cell(scenario, feed_override_input='standard_analog 1 0.004 0.02')
    assert outcome.code is ErrorCode.SUCCESSFUL, outcome
    times, _, feeds = line.feeds()
    times -= line.times[0]
    assert feeds[(times > 1.0) & (times < 2.8)] == pytest.approx(0.5, abs=NOISE)
    assert feeds[times > 3.5] == pytest.approx(0.2, abs=NOISE)


@both_modes
def test_a_signal_that_ends_slows_the_goal_at_the_rate(mode):
    bounds = FeedOverride(minimum=0.2, maximum=0.8, rate=0.5, timeout=0.1)

    async def scenario(cell):
        line = FedLine.begin(cell, mode, bounds)

        def signal(time):
            if time < 2.5:
                line.send(1.0)

        return line, await line.end(signal)

    line, outcome = run_cell(scenario)
    assert outcome.code is ErrorCode.SUCCESSFUL, outcome
    times, _, feeds = line.feeds()
    assert feeds.max() == pytest.approx(0.8, abs=NOISE)
    assert feeds[times > line.times[0] + 4.5] == pytest.approx(0.2, abs=NOISE)
    falls = (feeds < 0.7) & (feeds > 0.3) & (times > line.times[0] + 2.5)
    slope = np.polyfit(times[falls], feeds[falls], 1)[0]
    assert slope == pytest.approx(-0.5, abs=0.02)
    assert any('the signal was lost once' in each for each in outcome.report), outcome.report


@both_modes
@pytest.mark.parametrize('feed', [1.0, 0.1])
def test_an_output_switches_at_the_same_place_at_any_feed(mode, feed):
    async def scenario(cell):
        pose = cell.memory.read().actual_tcp_pose
        x, y, z = pose.position
        line = FedLine.begin(
            cell,
            mode,
            FeedOverride(minimum=0.1),
            waypoints=tuple(
                Waypoint(
                    pose=replace(pose, position=(x, y + way, z)),
                    time=time,
                    twist=(0.0, speed, 0.0, 0.0, 0.0, 0.0),
                )
                for way, time, speed in ((0.5 * LENGTH, 0.5 * TIME, 0.06), (LENGTH, TIME, 0.0))
            ),
            io_commands=(
                IOCommand(
                    waypoint=0,
                    offset=0.0,
                    output=OutputKind.STANDARD_DIGITAL,
                    pin=3,
                    value=1.0,
                ),
            ),
        )
        digital, places = cell.robot.controller.io.digital_out, []

        def signal(time):
            line.send(feed)
            if digital.standard[3]:
                places.append(line.states[-1].actual_tcp_pose.position[1] - y)

        return await line.end(signal), places[0]

    outcome, place = run_cell(scenario)
    assert outcome.code is ErrorCode.SUCCESSFUL, outcome
    seen_late = 0.06 * feed * (PERIOD + 2.0 * CYCLE)
    assert -0.0005 < place - 0.5 * LENGTH < seen_late + 0.0005


@both_modes
def test_points_are_appended_to_a_goal_that_a_signal_slows(mode):
    bounds, options = FeedOverride(minimum=0.2, rate=2.0), PlanningOptions()

    async def scenario(cell):
        state = cell.memory.read()
        (x, y, z), turned = state.actual_tcp_pose.position, state.actual_tcp_pose.quaternion
        points = tuple(
            Waypoint(time=time, pose=Pose((x, y + way, z), turned))
            for time, way in ((1.0, 0.04), (2.0, 0.08))
        )
        goal = Goal(
            waypoints=points[:1],
            execution=mode,
            keep_open=True,
            goal_time_tolerance=0.3,
            feed_override=bounds,
        )
        first = plan_first_part(plan(goal, state, ARM, options), ARM, options)
        motion = cell.owner.run(*encode_part(first))
        added = AppendedPoints(waypoints=points[1:], last=True)
        rest = plan_append(first.next_goal, added, ARM, options, from_rest=False)
        records, job = encode_part(rest)
        before = rest.records_before
        cell.owner.append(records, AppendJob(number=1, records_before=before, job=job))
        begin = cell.loop.time()
        while motion.outcome is None:
            cell.owner.send(SetFeedOverride(motion=1, fraction=0.4, age=0.0))
            await cell.sleep(PERIOD)
        end = cell.memory.read().target_tcp_pose.position
        return motion.outcome, cell.loop.time() - begin, end[1] - y

    outcome, took, way = run_cell(scenario)
    assert outcome.code is ErrorCode.SUCCESSFUL, outcome
    assert took == pytest.approx(2.0 / 0.4, abs=0.6)
    assert way == pytest.approx(0.08, abs=5e-5)


@needs_checkout
def test_the_example_is_slowed_to_80_percent():
    async def scenario(cell):
        path = run_path(str(EXAMPLE))['fed_bead'](cell.memory.read().actual_tcp_pose)
        line = FedLine(cell, path.goal())
        return line, await line.end(lambda time: line.send(0.8))

    line, outcome = run_cell(scenario)
    assert outcome.succeeded, outcome
    speeds = [np.linalg.norm(state.target_tcp_twist[:3]) for state in line.states]
    assert max(speeds) == pytest.approx(0.8 * 0.05, rel=0.01)


# ---- random signals ---------------------------------------------------------------------------


@dataclass
class RandomSignal:
    """Values that come from one or two sources, jump, stop, are nonsense or old."""

    draw: Random
    line: FedLine
    sources: int
    values: list = field(default_factory=list)
    silent_until: float = 0.0

    def __post_init__(self):
        self.values = [self.draw.uniform(0.0, 1.0) for _ in range(self.sources)]

    def __call__(self, time):
        if time < self.silent_until:
            return
        for source, value in enumerate(self.values):
            match self.draw.random():
                case roll if roll < 0.02:
                    self.values[source] = self.draw.uniform(0.0, 1.0)
                case roll if roll < 0.03:
                    self.line.send(self.draw.choice((nan, 1.5, -0.1, float('inf'), 1e300)))
                case roll if roll < 0.04:
                    self.silent_until = time + self.draw.uniform(0.0, 1.0)
                case roll if roll < 0.05:
                    self.line.send(value, self.draw.choice((9.0, nan, 0.05)))
                case _:
                    self.line.send(value)


#: Where a person puts the slider. A call of servoj ends with a cycle: only at these settings, also
#: without a feed override, do set-points pass as fast as the slider says.
SLIDERS = {
    ExecutionMode.SPLINE: (1.0, 0.83, 0.7, 0.5, 0.37),
    ExecutionMode.SERVO: (1.0, 0.5, 1.0 / 3.0, 0.25),
}


class Person:
    """Moves the slider, and pauses the program; knows where the slider was left."""

    def __init__(self, draw, cell, sliders):
        self._draw, self._cell, self._sliders = draw, cell, sliders
        self.slider = draw.choice(sliders)
        cell.robot.set_speed_slider(self.slider)
        #: When it did something [s]; until when the program is paused.
        self.acts, self._play_at = [], None

    def __call__(self, time, now):
        if self._play_at is not None:
            if time >= self._play_at:
                self._play_at = None
                self._cell.robot.inject('play')
                self.acts.append(now)
        elif self._draw.random() < 0.004:
            self.slider = self._draw.choice(self._sliders)
            self._cell.robot.set_speed_slider(self.slider)
            self.acts.append(now)
        elif self._draw.random() < 0.002:
            self._cell.robot.inject('pause')
            self._play_at = time + self._draw.uniform(0.1, 0.6)
            self.acts.append(now)


@pytest.mark.random
@pytest.mark.parametrize('case', range(cases(200)))
def test_any_signal_keeps_bounds_and_rate_and_leaves_the_slider_to_the_person(case):
    draw = random_of('feed override', case)
    minimum = draw.uniform(0.15, 0.5)
    bounds = FeedOverride(
        minimum=minimum,
        maximum=draw.uniform(minimum, 1.0),
        rate=draw.choice((0.2, 0.5, 2.0)),
        timeout=draw.choice((0.05, 0.3)),
    )
    mode, end = MODES[case % 2], draw.choice(('reached', 'reached', 'cancelled', 'killed'))
    end_time = draw.uniform(0.5, 2.5)
    print(f'RANDOM_SEED={SEED}:', mode.name, end, f'{end_time:.2f} s', bounds)

    async def scenario(cell):
        person = Person(draw, cell, SLIDERS[mode])
        await cell.sleep(0.1)
        line = FedLine.begin(cell, mode, bounds)
        signal = RandomSignal(draw, line, draw.choice((1, 2)))
        stopped = 0.0

        def look(time):
            nonlocal stopped
            if end != 'reached' and time > end_time and not stopped:
                stopped = line.states[-1].timestamp
                if end == 'cancelled':
                    cell.owner.cancel()
                else:
                    cell.owner.hang_up()
            if not stopped:
                signal(time)
                person(time, line.states[-1].timestamp)

        if end == 'killed':
            await line.until(lambda: stopped, look)
            await cell.until(cell.at_rest, 5.0)
        else:
            await line.end(look)
        await cell.sleep(0.3)
        return line, person, stopped, cell.robot.controller.speed_slider, cell.at_rest()

    line, person, stopped, slider, rests = run_cell(scenario)
    if end != 'killed':
        cancelled = end == 'cancelled' and line.motion.outcome.code is ErrorCode.CANCELLED
        assert cancelled or line.motion.outcome.code is ErrorCode.SUCCESSFUL, line.motion.outcome
    assert rests
    assert slider == pytest.approx(person.slider, abs=1e-6)
    judge(line, bounds, person.acts, stopped)


def judge(line, bounds, acts, stopped):
    """See that the feed keeps within its bounds and its rate wherever it can be measured."""
    times, _, feeds = line.feeds()
    assert len(times) or stopped, 'a goal that ran to its end has feeds to measure'
    quiet = np.ones(len(times), dtype=bool)
    for act in acts:
        quiet &= (times < act - 0.05) | (times > act + SETTLING)
    if stopped:
        quiet &= times < stopped - 0.05  # then the arm brakes
    times, feeds = times[quiet], feeds[quiet]
    if not len(times):  # acts follow one another too closely
        assert acts or stopped
        return
    assert feeds.min() > bounds.minimum - NOISE
    assert feeds.max() < bounds.maximum + NOISE
    step = 0.1
    later = np.searchsorted(times, times + step)
    pairs = np.flatnonzero(later < len(times))
    passed = times[later[pairs]] - times[pairs]
    near = passed < 2.0 * step
    changes = np.abs(feeds[later[pairs]] - feeds[pairs])[near]
    assert (changes < bounds.rate * passed[near] + 2.0 * NOISE).all()
