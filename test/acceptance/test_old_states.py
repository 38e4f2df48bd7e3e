# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""States that come late, over real sockets and with a robot loop in a process of its own."""

import os
import re
import signal
from time import monotonic, sleep

import pytest
from waiting import wait_for

from ur_cartesian_driver.driver import ConnectionState
from ur_cartesian_driver.motion.errors import ErrorCode, RobotNotReady
from ur_cartesian_driver.motion.goal.goal import Goal, Tolerance, Waypoint

pytestmark = [
    pytest.mark.acceptance,
    pytest.mark.slow,
    # The age of a state is told by the robot's clock.
    pytest.mark.ur_sim(when_late='skip'),
]

#: Longest time from a push to standstill: the bound of the age, and braking [s].
REACTION = 0.6
#: Longer than the bound of the age, and shorter than a connection may be silent [s].
PAUSE = 0.6


@pytest.fixture
def driver(make_driver):
    """
    A driver whose loop shares no interpreter with the robot, with a long bound.

    The robot program waits for longer than any pause of a busy computer.
    """
    made = make_driver(robot_loop='process', max_state_age=0.5, robot_receive_timeout=4.0)
    try:
        made.wait_ready(30.0)
    except RobotNotReady:  # on a busy computer the loop was started again, and its program ended
        made.resend_robot_program()
        made.wait_ready(30.0)
    return made


@pytest.fixture
def motion(ur_sim, driver, home):
    """A slow motion that has begun."""
    tolerance = Tolerance(position=(0.002,) * 3)
    goal = Goal(waypoints=(Waypoint(pose=home(y=0.2), time=8.0),), path_tolerance=tolerance)
    started = driver.start(driver.plan(goal))
    wait_for(lambda: not at_rest(ur_sim))
    return started


def at_rest(ur_sim):
    return max(map(abs, ur_sim.state().qd)) < 1e-3


def is_ready(driver):
    return driver.status.state is ConnectionState.READY


def stated_age(outcome):
    """Return the age for which a motion ended [s]; 0 = it ended for something else."""
    assert outcome.code is ErrorCode.CONNECTION_LOST, outcome.text
    found = re.search(r'was (\S+) s old, max_state_age is 0\.5 s', outcome.text)
    return float(found[1]) if found else 0.0


def check_goes_on(driver, ur_sim):
    """Check that the next motion is taken."""
    ur_sim.clear_faults()
    wait_for(lambda: 'resend' in driver.status.message or is_ready(driver), 30.0)
    if not is_ready(driver):  # the connection was given up first, and the program has ended
        driver.resend_robot_program()
    driver.wait_ready(30.0)
    assert driver.state.state_age < 0.5


def test_a_congested_link_makes_no_reaction_late(ur_sim, driver, motion):
    """
    States take about four times these 100 kB/s: each comes later than the one before.

    A busy computer that sends only half of the states congests the link, too.
    """
    ur_sim.inject('throttle rtde 100000')
    sleep(1.5)
    ur_sim.inject('offset pose x 0.004')
    begin = monotonic()
    wait_for(lambda: at_rest(ur_sim))
    assert monotonic() - begin < REACTION
    assert stated_age(motion.result(5.0)) >= 0.5
    check_goes_on(driver, ur_sim)


@pytest.mark.ur_sim(frequency=125.0, when_late='skip')
def test_a_loop_that_was_given_no_time_stops_the_arm(ur_sim, driver, motion):
    """The robot program waits for longer; the states that the loop then reads are too old."""
    loop, begin = driver._loop.host.pid, monotonic()
    os.kill(loop, signal.SIGSTOP)
    sleep(PAUSE)
    os.kill(loop, signal.SIGCONT)
    wait_for(lambda: at_rest(ur_sim))
    outcome = motion.result(5.0)
    if age := stated_age(outcome):
        assert age > PAUSE - 0.01  # the first state that waited, a cycle after the last one
    else:
        # A busy computer has let it wait until the connection counted as dead.
        assert 'the robot sent nothing for 1 s' in outcome.text
        assert monotonic() - begin > 1.0
    check_goes_on(driver, ur_sim)
