# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The page on rounded corners: its examples are one goal, and its speeds are those of the planner.

``PYTHONPATH=test/support python test/planning/rounded/test_rounded_page.py`` prints the table of
speeds.
"""

from math import cbrt, cos, radians, sin, sqrt, tan
import re

from checkout import CHECKOUT, needs_checkout
from curve_distance import distances
import numpy as np
import pytest
from random_cases import cases, random_of
import rounded_goals

from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.kinematics.robot_models import robot_model
from ur_cartesian_driver.motion.errors import (
    JointLimitExceeded,
    NearSingularity,
    TooFast,
    Unreachable,
)
from ur_cartesian_driver.path import mm, Path
from ur_cartesian_driver.planning import plan, PlanningOptions
from ur_cartesian_driver.planning.stop_prediction import state_at_rest
from ur_cartesian_driver.sim import HOME

PAGE = CHECKOUT / 'doc' / 'rounded_corners.md'

ARM = Arm(robot_model('ur5e'))
STATE = state_at_rest(ARM, HOME)
#: The rows and columns of the table: deviations [mm], and accelerations with jerks.
DEVIATIONS = (0.05, 0.2, 1.0)
COLUMNS = ((0.5, 50.0), (2.0, 50.0), (2.0, 500.0))
LENGTH, SPEED, STEP = 0.1, 0.1, 0.001


def slowest(deviation, acceleration, jerk, angle=90.0, speed=SPEED):
    """Return the least speed near a corner between two lines [m/s]."""
    along, across = LENGTH * cos(radians(angle)), LENGTH * sin(radians(angle))
    path = Path(STATE.actual_tcp_pose).at(speed=speed, acceleration=acceleration)
    path = path.rounded(deviation).by(dy=LENGTH).by(dx=across, dy=along)
    goal = path.goal()
    found = plan(goal, STATE, ARM, PlanningOptions(max_linear_jerk=jerk))
    t = np.arange(0.0, found.duration, STEP)
    places = ARM.forward_rows(found.joint_spline.rows(t)[0])[:, :3]
    speeds = np.linalg.norm(np.gradient(places, STEP, axis=0), axis=1)
    near = np.linalg.norm(places - goal.waypoints[0].pose.position, axis=1) < 0.3 * LENGTH
    return speeds[near].min()


def table():
    """Return deviations [mm] and speeds [mm/s], a row of the table each."""
    return [
        [deviation, *(1e3 * slowest(mm(deviation), *column) for column in COLUMNS)]
        for deviation in DEVIATIONS
    ]


@needs_checkout
@pytest.mark.slow
def test_the_table_has_the_speeds_of_the_planner():
    _, _, after = PAGE.read_text(encoding='utf-8').partition('<!-- speeds: ')
    shown = re.findall(r'^\| [\d.]+ mm \|.*$', after, re.MULTILINE)
    assert len(shown) == len(DEVIATIONS)
    for row, found in zip(shown, table(), strict=True):
        numbers = [float(number) for number in re.findall(r'[\d.]+', row)]
        assert numbers == pytest.approx(found, rel=0.1)


@pytest.mark.parametrize('angle', [30.0, 60.0, 90.0])
@pytest.mark.parametrize(
    ('deviation', 'acceleration', 'jerk'),
    [(2e-4, 0.5, 50.0), (1e-3, 1.0, 50.0), (5e-5, 2.0, 50.0), (2e-4, 2.0, 500.0)],
)
def test_the_formula_is_near_the_planned_speed(angle, deviation, acceleration, jerk):
    speed = min(1.2 * sqrt(acceleration * deviation), 1.3 * cbrt(jerk * deviation**2))
    shown = speed / tan(radians(angle) / 2.0)
    assert slowest(deviation, acceleration, jerk, angle, 0.25) == pytest.approx(shown, rel=0.15)


@needs_checkout
def test_the_examples_are_the_same_goal():
    from ur_cartesian_driver.motion.goal.known_frames import Frames
    from ur_cartesian_driver.ros.client import load_goal
    from ur_cartesian_driver.ros.messages.goal_conversion import goal_from_message

    text = PAGE.read_text(encoding='utf-8')
    (program,) = re.findall(r'^```python\n(.*?)^```$', text, re.DOTALL | re.MULTILINE)
    (goal_file,) = re.findall(r'^```yaml\n(.*?)^```$', text, re.DOTALL | re.MULTILINE)
    names = {}
    exec(program, names)
    composed = names['corner'].goal()
    loaded = goal_from_message(load_goal(goal_file), Frames(), now=0)
    assert loaded.corner_deviation == composed.corner_deviation == mm(0.2)
    for a, b in zip(loaded.waypoints, composed.waypoints, strict=True):
        assert a.pose.distance_to(b.pose) < 1e-9
        assert a.pose.angle_to(b.pose) < 1e-6
    rates = [
        [(segment.velocity, segment.acceleration) for segment in goal.segments]
        for goal in (loaded, composed)
    ]
    assert rates[0] == rates[1]
    found = plan(loaded, STATE, ARM, PlanningOptions())
    assert 'passes 0.181 mm beside it' in found.report[0]


@pytest.mark.random
def test_no_place_of_the_programmed_path_is_farther_from_the_rounded_one():
    random = random_of('programmed places', 0)
    passed = 0
    for _ in range(cases(200)):
        case = rounded_goals.random_case(random)
        try:
            found = plan(case.goal, case.state, case.arm, rounded_goals.OPTIONS)
        except (Unreachable, NearSingularity, JointLimitExceeded, TooFast):
            continue
        t = np.append(np.arange(0.0, found.duration, STEP), found.duration)
        tool = case.arm.forward_rows(found.joint_spline.rows(t)[0])[:, :3]
        path = rounded_goals.programmed(case)
        middles = 0.5 * (path[1:] + path[:-1])
        off = distances(np.concatenate([path, middles]), [tool])
        assert off.max() <= case.goal.corner_deviation, case
        passed += 1
    assert passed


if __name__ == '__main__':
    for deviation, *speeds in table():
        print(f'| {deviation:g} mm |', *(f'{speed:.2g} mm/s |' for speed in speeds))
