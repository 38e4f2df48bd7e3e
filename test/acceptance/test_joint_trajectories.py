# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Joint goals, from the goal to the simulated arm: every point in time, and the curve between.

The tests compare the joint targets that the controller reports, packet by packet, in virtual
time, with Hermite polynomials that are solved here. ``JOINT_TRAJECTORIES=N`` runs N of them.
"""

from __future__ import annotations

from functools import partial
from itertools import pairwise
import os

from fault_cell import run_scenario
from fault_goals import half_circle, SETTLING, SplineGoal
from fault_modes import SPLINE
import numpy as np
import pytest
from robot_cell import run_cell

from ur_cartesian_driver.driver.ipc.channel import CancelMotion
from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.kinematics.robot_models import JOINT_NAMES, robot_model
from ur_cartesian_driver.motion.errors import ErrorCode
from ur_cartesian_driver.motion.goal.execution_modes import ExecutionMode
from ur_cartesian_driver.motion.goal.joint_goal import JointGoal, JointPoint, JointTolerance
from ur_cartesian_driver.planning import plan_joint_goal, PlanningOptions

pytestmark = [pytest.mark.acceptance, pytest.mark.slow]

ARM = Arm(robot_model('ur5e'))
OPTIONS = PlanningOptions(max_tool_speed=0.0)
TRAJECTORIES = int(os.environ.get('JOINT_TRAJECTORIES', '3'))
#: The highest derivative that the points of a goal contain.
KINDS = ('positions', 'velocities', 'accelerations')
#: How far the controller's targets may be from the curve [rad], and how late it may begin [s].
EXACT, LATEST = 1e-3, 0.03
#: Pan, lift and elbow in front of wrists in line [rad].
UPRIGHT = (0.0, -1.8, 1.5)


def random_goal(home, q, seed):
    """Return a joint goal around home from where the arm is, its points in rows, and its kind."""
    random = np.random.default_rng(seed)
    kind = KINDS[seed % 3]
    n = int(random.integers(1, 7))
    times = np.cumsum(random.uniform(0.3, 0.8, n))
    rows = [home + random.uniform(-0.12, 0.12, (n, 6))]
    if kind != 'positions':
        rows.append(random.uniform(-0.2, 0.2, (n, 6)))
        rows[1][-1] = 0.0
    if kind == 'accelerations':
        rows.append(random.uniform(-0.4, 0.4, (n, 6)))
    if random.random() < 0.5:  # as MoveIt sends it
        times = np.append(0.0, times)
        rows = from_rest(q, rows)
    order = random.permutation(6)
    points = tuple(
        JointPoint(
            time=time,
            positions=rows[0][i][order],
            velocities=rows[1][i][order] if len(rows) > 1 else (),
            accelerations=rows[2][i][order] if len(rows) > 2 else (),
        )
        for i, time in enumerate(times)
    )
    names = tuple(JOINT_NAMES[k] for k in order)
    goal = JointGoal(
        joint_names=names,
        points=points,
        path_tolerance=tuple(
            JointTolerance(name=name, position=random.uniform(0.01, 0.2), velocity=-1.0)
            for name in names[: int(random.integers(7))]
        ),
        goal_tolerance=tuple(
            JointTolerance(name=name, position=random.uniform(0.001, 0.01), velocity=0.01)
            for name in names[: int(random.integers(7))]
        ),
        goal_time_tolerance=float(random.choice([0.0, 0.5, -1.0])),
    )
    return goal, times, rows, kind


def from_rest(q, rows):
    """Return rows of points behind a point at which the arm rests."""
    return [np.vstack([first, each]) for first, each in zip((q, 0 * q, 0 * q), rows, strict=False)]


def hermite(times, rows, t):
    """Return the joints at times t (m,), of the polynomials through rows with k derivatives."""
    k = len(rows)
    powers = np.arange(2 * k)

    def row(h, derivative):
        scale = np.prod([np.maximum(powers - i, 0) for i in range(derivative)], axis=0)
        return scale * h ** np.maximum(powers - derivative, 0)

    found = np.empty((len(t), 6))
    for i, (a, b) in enumerate(pairwise(times)):
        ends = np.array([row(h, d) for h in (0.0, b - a) for d in range(k)])
        given = np.array([rows[d][j] for j in (i, i + 1) for d in range(k)])
        inside = (t >= a) & (t <= b)
        found[inside] = ((t[inside] - a)[:, None] ** powers) @ np.linalg.solve(ends, given)
    found[t < times[0]], found[t > times[-1]] = rows[0][0], rows[0][-1]
    return found


async def executed(cell, goal, options=OPTIONS):
    """Run a joint goal; return its outcome, and times and joint targets of all packets."""
    made = plan_joint_goal(goal, cell.memory.read(), ARM, options)
    packets = []
    outcome = await cell.record(cell.owner.start(made), packets)
    begin = next(
        (before.timestamp for before, after in pairwise(packets) if any(after.target_qd)),
        packets[0].timestamp,
    )
    return (
        outcome,
        np.array([state.timestamp - begin for state in packets]),
        np.array([state.target_q for state in packets]),
        packets,
    )


def distance(times, q, wanted):
    """Return how far targets are from a curve, at the delay with which they follow it best."""
    return min(
        np.abs(q - wanted(times - delay)).max() for delay in np.arange(-LATEST, LATEST, 1e-3)
    )


def distance_at_points(times, points, t, q):
    """Return how far targets (t, q) are from the points at their times."""
    return distance(times, points, lambda at: np.stack([np.interp(at, t, x) for x in q.T], 1))


def overshoot(times, points, t, q):
    """Return how far joints turn beyond the two points between which they are."""
    farthest = 0.0
    for i, (a, b) in enumerate(pairwise(times)):
        inside = q[(t > a + LATEST) & (t < b - LATEST)]
        low, high = np.sort(points[i : i + 2], axis=0)
        beyond = np.maximum(low - inside, inside - high)
        farthest = max(farthest, beyond.max(initial=0.0))
    return farthest


def test_random_joint_trajectories_are_executed_as_they_were_sent():
    async def scenario(cell):
        worst, home = 0.0, np.array(cell.memory.read().target_q)
        for seed in range(TRAJECTORIES):
            start = np.array(cell.memory.read().target_q)
            goal, times, rows, kind = random_goal(home, start, seed)
            outcome, t, q, packets = await executed(cell, goal)
            assert outcome.succeeded, (seed, outcome)
            end = np.abs(np.array(packets[-1].actual_q) - rows[0][-1]).max()
            assert end < 1e-4, (seed, end)
            if times[0] > 0.0:
                times, rows = np.append(0.0, times), from_rest(start, rows)
            if kind == 'positions':
                off = distance_at_points(times, rows[0], t, q)
                assert overshoot(times, rows[0], t, q) < EXACT, seed
            else:
                off = distance(t, q, partial(hermite, times, rows))
            assert off < EXACT, (seed, kind, off)
            worst = max(worst, off)
        print(f'{TRAJECTORIES} joint trajectories: targets within {worst:.6f} rad of the curve')

    run_cell(scenario)


class JointFaultGoal(SplineGoal):
    """The half circle of SPLINE goals as a joint goal of its pieces."""

    def plan_from(self, start):
        spline = half_circle(start, ExecutionMode.SPLINE)
        times = np.cumsum(spline.rows.durations)
        return plan_joint_goal(
            JointGoal(
                joint_names=JOINT_NAMES,
                points=tuple(
                    JointPoint(
                        time=time,
                        positions=piece.target,
                        velocities=piece.velocities,
                        accelerations=piece.accelerations,
                    )
                    for time, piece in zip(times, spline.rows.primitives, strict=True)
                ),
                path_tolerance=tuple(
                    JointTolerance(name=name, position=0.005) for name in JOINT_NAMES
                ),
                goal_time_tolerance=SETTLING,
            ),
            start.state,
            ARM,
            PlanningOptions(max_tool_speed=1.0, safe_outputs=('standard_digital 5 0 restore',)),
        )


#: Of each way to stop an arm one; the others take longer together than they tell.
IN_EACH_RUN = (
    'protective stop',
    'an operator stops the program',
    'RTDE is cut',
    'the pose is measured 6 mm off',
)


@pytest.mark.parametrize(
    'row',
    [
        pytest.param(
            row,
            id=row.fault,
            marks=() if row.fault in IN_EACH_RUN else pytest.mark.exhaustive,
        )
        for row in SPLINE.headless
    ],
)
def test_a_fault_ends_a_joint_goal_as_it_ends_a_spline(row):
    async def scenario(cell):
        phase = 'between points'
        await run_scenario(cell, row.at(phase), phase, JointFaultGoal)

    run_cell(scenario)


@pytest.mark.parametrize(
    ('preempted_by', 'code'), [('', ErrorCode.CANCELLED), ('goal 7', ErrorCode.PREEMPTED)]
)
def test_a_joint_goal_is_cancelled_and_preempted_as_all_goals(preempted_by, code):
    async def scenario(cell):
        goal = JointFaultGoal(cell)
        await goal.bring_to('between points')
        cell.owner.send(CancelMotion(motion=1, preempted_by=preempted_by))
        await cell.until(lambda: goal.motion.outcome, 0.5)
        assert goal.motion.outcome.code is code, goal.motion.outcome
        assert cell.at_rest()
        following = JointFaultGoal(cell)
        following.send()
        await cell.until(lambda: following.motion.outcome, 3.0)
        assert following.motion.outcome.succeeded, following.motion.outcome

    run_cell(scenario)


def test_a_joint_outside_its_tolerance_ends_the_goal_and_is_named():
    async def scenario(cell):
        q = np.array(cell.memory.read().target_q)
        for limits, fault, code, text in (
            ({'position': 0.01}, 'offset pose z 0.02', 'PATH', 'position of'),
            ({'velocity': 0.05}, 'offset twist z 0.2 for 0.05 s', 'PATH', 'velocity of'),
            ({'position': 0.01}, 'offset pose z 0.02', 'GOAL', 'position of'),
        ):
            bounds = tuple(JointTolerance(name=name, **limits) for name in JOINT_NAMES)
            goal = JointGoal(
                joint_names=JOINT_NAMES,
                points=(JointPoint(time=0.5, positions=tuple(q + 0.02)),),
                path_tolerance=bounds if code == 'PATH' else (),
                goal_tolerance=bounds if code == 'GOAL' else (),
                goal_time_tolerance=0.1,
            )
            motion = cell.owner.start(plan_joint_goal(goal, cell.memory.read(), ARM, OPTIONS))
            await cell.sleep(0.2)
            cell.robot.inject(fault)
            await cell.until(lambda motion=motion: motion.outcome, 3.0)
            outcome = motion.outcome
            assert outcome.code is ErrorCode[f'{code}_TOLERANCE_VIOLATED'], outcome
            assert text in outcome.text.lower(), outcome
            assert 'the tolerance is' in outcome.text, outcome
            cell.robot.clear_faults()
            await cell.until(cell.at_rest)
            await cell.sleep(0.1)

    run_cell(scenario)


def test_joints_may_move_while_the_tool_stands_still():
    """With wrist 2 at 0 its neighbours turn about one axis: the tool shows no progress."""

    async def scenario(cell):
        outcome, *_, _packets = await executed(
            cell,
            JointGoal(
                joint_names=JOINT_NAMES,
                points=(
                    JointPoint(time=1.0, positions=(*UPRIGHT, 0.0, 0.0, 0.0)),
                    JointPoint(time=2.0, positions=(*UPRIGHT, 0.3, 0.0, -0.3)),
                    JointPoint(time=2.5, positions=(*UPRIGHT, 0.3, 0.0, -0.3)),
                ),
            ),
        )
        assert outcome.succeeded, outcome

    run_cell(scenario, robot={'q': (*UPRIGHT, -0.1, 0.1, 0.0)})
