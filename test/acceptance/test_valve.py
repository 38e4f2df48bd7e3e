# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The dead times that ``valve`` finds, and the beads that goals lay with them.

A simulated valve acts late on the outputs of the controller, and lays its beads where the tool of
the controller is then. Nothing is taken from a plan. The ends of the beads are read to 0.1 mm.
"""

import numpy as np
import pytest
from random_cases import cases, random_of
from robot_in_memory import RobotInMemory
from simulated_valve import SimulatedValve
from waiting import wait_for

from ur_cartesian_driver.cli.valve_beads import Beads, dead_times
from ur_cartesian_driver.cli.valve_command import lay_beads
from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.kinematics.robot_models import robot_model
from ur_cartesian_driver.motion.errors import RobotNotReady
from ur_cartesian_driver.motion.geometry.pose import Pose
from ur_cartesian_driver.motion.goal.goal import OutputKind
from ur_cartesian_driver.motion.goal.leads import Lead
from ur_cartesian_driver.path import digital, mm, Path
from ur_cartesian_driver.planning import plan, PlanningOptions

pytestmark = [pytest.mark.acceptance, pytest.mark.slow]

HOME = (0.3, -1.4, 1.5, -1.6, -1.5, 0.2)
TOOL = Pose((0.0, 0.02, 0.12))
ARM = Arm(robot_model('ur5e'))
PIN, OPEN, CLOSE = 2, 0.060, 0.035
CYCLE = ARM.model.control_cycle
BEADS = Beads(slow=0.02, fast=0.2, length=mm(40), beside=mm(10), along='x')
#: Resolution of the ruler [m].
RULER = mm(0.1)


def laid(robot, path, options):
    """Lay the beads of a path, which begins at the tool; return where they begin and end."""
    state = robot.place(HOME, TOOL)
    goal = path(state.actual_tcp_pose).goal()
    made = plan(goal, state, ARM, options)
    valve = SimulatedValve(robot.controller, PIN, open=OPEN, close=CLOSE)
    run = robot.run(list(made.instructions), on_cycle=valve)
    assert not run.failure
    return valve.beads()


def along(beads, start, axis):
    """Return the ends of beads along an axis of the tool, from its start on (n, 2) [m]."""
    direction = start.apply(axis)
    return (beads - start.position) @ (np.array(direction) - start.position)


@pytest.fixture(scope='module')
def robot():
    return RobotInMemory('ur5e')


@pytest.fixture(scope='module')
def lead(robot):
    """The lead that the two beads of ``valve`` show to a person with the ruler."""
    start = robot.place(HOME, TOOL).actual_tcp_pose
    beads = laid(robot, lambda pose: BEADS.path(pose, digital(PIN)), PlanningOptions())
    ends = np.round(along(beads, start, (1.0, 0.0, 0.0)) / RULER) * RULER
    begins, closes = ends[1] - ends[0]
    times = dead_times(
        begins, closes, slow=BEADS.slow, fast=BEADS.fast, reading=RULER / np.sqrt(12), cycle=CYCLE
    )
    return times, Lead(
        name='valve_1',
        output=OutputKind.STANDARD_DIGITAL,
        pin=PIN,
        open=times.open,
        close=times.close,
    )


def test_two_beads_show_both_dead_times(lead):
    times, _ = lead
    assert abs(times.open - OPEN) < 3.0 * times.uncertainty
    assert abs(times.close - CLOSE) < 3.0 * times.uncertainty
    assert times.uncertainty < 0.001


class Bead:
    """A random bead: its speed and length, and how its path is executed."""

    def __init__(self, random):
        self.speed = 10.0 ** random.uniform(-2.0, np.log10(0.25))
        self.length = mm(random.uniform(20.0, 60.0))
        self.is_rounded = random.random() < 0.5
        #: The way to gain speed and to lose it, with the way of the lead at full speed [m].
        self.run = mm(6) + self.speed**2 + 0.08 * self.speed

    def path(self, start, lead):
        """Return a path with the bead at points that it passes, or between its points."""
        on, off = (digital(PIN), True), (digital(PIN), False)
        path = Path(start).at(speed=self.speed, acceleration=1.0).by(mm(5), of_tool=True)
        if self.is_rounded:
            return (
                path.by(self.run - mm(5), of_tool=True)
                .set(*on, lead=lead)
                .by(self.length, of_tool=True)
                .set(*off, lead=lead)
                .by(self.run, of_tool=True)
                .rounded(mm(1))
            )
        return (
            path.by(2.0 * self.run + self.length - mm(5), of_tool=True)
            .set(*on, distance=-self.run - self.length, lead=lead)
            .set(*off, distance=-self.run, lead=lead)
        )


def errors(robot, bead, lead, options):
    """Return how far behind the wanted places a bead begins and ends (2,) [m]."""
    start = robot.place(HOME, TOOL).actual_tcp_pose
    beads = laid(robot, lambda pose: bead.path(pose, lead), options)
    assert len(beads) == 1
    return along(beads, start, (1.0, 0.0, 0.0))[0] - [bead.run, bead.run + bead.length]


@pytest.mark.random
def test_beads_are_where_they_shall_be_at_all_speeds(robot, lead):
    _, found = lead
    options = PlanningOptions(leads=(found,))
    for i in range(cases(100)):
        bead = Bead(random_of('bead', i))
        begin, end = errors(robot, bead, found.name, options)
        # An output switches with a cycle, in which a fast tool goes farther than that.
        bound = max(mm(0.2), CYCLE * bead.speed)
        assert max(abs(begin), abs(end), abs(end - begin)) < bound, (i, bead.speed, begin, end)


@pytest.mark.random
def test_without_leads_they_are_late_by_speed_times_dead_time(robot):
    for i in range(cases(20)):
        bead = Bead(random_of('bead', i))
        late = errors(robot, bead, '', PlanningOptions())
        expected = bead.speed * np.array([OPEN, CLOSE])
        assert np.abs(late - expected).max() < mm(0.05) + CYCLE * bead.speed


# ---- the command --------------------------------------------------------------------------------


@pytest.fixture
def small():
    """Return beads that take little time."""
    return Beads(slow=0.1, fast=0.2, length=mm(20), beside=mm(10), along='-y')


@pytest.mark.ur_sim(frequency=125.0)
def test_the_beads_are_laid_if_the_person_agrees(driver, small):
    start, asked = driver.state.actual_tcp_pose, []

    def declines(text):
        asked.append(text)
        return False

    assert not lay_beads(driver, small, digital(PIN), declines)
    assert driver.state.actual_tcp_pose == start
    assert 'Two beads of 20 mm along the -y axis of the tool, 10 mm apart' in asked[0]
    assert 'The arm needs 80 mm in that direction' in asked[0]
    assert 'The valve is standard digital output 2.' in asked[0]
    assert lay_beads(driver, small, digital(PIN), lambda _: True)
    wait_for(lambda: max(map(abs, driver.state.actual_qd)) < 1e-4, 5.0)
    end = start @ Pose((0.010, -0.080, -0.020))
    assert driver.state.actual_tcp_pose.distance_to(end) < 1e-4


@pytest.mark.ur_sim(frequency=125.0)
def test_beads_at_another_speed_than_asked_tell_nothing(driver, small, ur_sim):
    def agrees(question):
        ur_sim.call(lambda controller: controller.set_slider(0.5))
        return True

    with pytest.raises(RobotNotReady, match='The arm moved at 50 % of its speed: set the slider'):
        lay_beads(driver, small, digital(PIN), agrees)


@pytest.mark.ur_sim(frequency=125.0)
def test_a_low_slider_is_refused_before_the_question(driver, small, ur_sim):
    ur_sim.call(lambda controller: controller.set_slider(0.5))
    wait_for(lambda: driver.state.target_speed_fraction == 0.5)
    with pytest.raises(RobotNotReady, match=r'^The speed slider is at 50%: set it to 100 %'):
        lay_beads(driver, small, digital(PIN), lambda _: pytest.fail('nothing may be asked'))
