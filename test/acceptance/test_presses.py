# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Force mode along a path: its effect on the tool, its end, and the effect of contact.

RTDE reports forces and places; contact follows the simulator's own law: the tests prove the
wiring, not the robot. All in virtual time.
"""

from dataclasses import replace
from math import nan
import re
from runpy import run_path

from checkout import CHECKOUT, needs_checkout
import numpy as np
import pytest
from robot_cell import run_cell

from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.kinematics.robot_models import JOINT_NAMES, robot_model
from ur_cartesian_driver.motion.errors import ErrorCode
from ur_cartesian_driver.motion.geometry.pose import (
    multiply,
    Pose,
    quaternion_from_rotation_vector,
)
from ur_cartesian_driver.motion.goal.goal import (
    ContactEnd,
    Goal,
    Posture,
    Press,
    PressFrame,
    Segment,
    SegmentType,
    Tolerance,
    Waypoint,
)
from ur_cartesian_driver.motion.goal.joint_goal import JointGoal, JointPoint
from ur_cartesian_driver.planning import plan, plan_joint_goal, PlanningOptions
from ur_cartesian_driver.sim import rtde_output_values
from ur_cartesian_driver.sim.motion.contact.contact_bodies import ContactBody

pytestmark = [pytest.mark.acceptance, pytest.mark.slow]

COMPUTED = rtde_output_values.COMPUTED
ARM, OPTIONS = Arm(robot_model('ur5e')), PlanningOptions()
#: Down with 20 N on a table, which is 3 mm below the path.
DOWN = Press(
    first_waypoint=0, last_waypoint=1, frame=PressFrame.BASE, axes=('z',), forces=(-20.0,)
)
TABLE = -0.003
TIGHT = Tolerance(position=(0.0005,) * 3, orientation=(0.01,) * 3)
EXAMPLE = CHECKOUT / 'examples' / 'grind.py'


def put(cell, shape, offset, extent, **properties):
    """Put a body beside the path; its place counts from where the tool is."""
    x, y, z = cell.memory.read().actual_tcp_pose.position
    dx, dy, dz = offset
    body = ContactBody(shape, (x + dx, y + dy, z + dz), extent, **properties)
    contact = cell.robot.controller.contact
    contact.bodies = (*contact.bodies, body)


def start(
    cell, press=DOWN, ways=((0.0, 0.02), (0.0, 0.08), (0.0, 0.1)), *, velocity=0.05, **fields
):
    """Start a goal along y that presses from its first point to its second one."""
    state = cell.memory.read()
    (x, y, z), turned = state.actual_tcp_pose.position, state.actual_tcp_pose.quaternion
    goal = Goal(
        waypoints=tuple(Waypoint(pose=Pose((x + dx, y + dy, z), turned)) for dx, dy in ways),
        segments=(Segment(velocity=velocity, acceleration=0.5),) * len(ways),
        presses=(press,),
        **{'path_tolerance': TIGHT, 'goal_tolerance': TIGHT} | fields,
    )
    return cell.owner.start(plan(goal, state, ARM, OPTIONS)), goal


async def recorded(cell, motion):
    """Let it run; return positions from the start (n, 3) and forces (n, 3) by RTDE."""
    rows, controller = [], cell.robot.controller
    begin = COMPUTED['actual_TCP_pose'](controller)[:3]

    def ended():
        rows.append(
            (*COMPUTED['actual_TCP_pose'](controller), *COMPUTED['actual_TCP_force'](controller))
        )
        return motion.outcome

    await cell.until(ended, 20.0)
    table = np.array(rows)
    return table[:, :3] - begin, table[:, 6:9]


def test_the_tool_presses_with_its_force_and_follows_its_path_otherwise():
    async def scenario(cell):
        put(cell, 'plane', (0.0, 0.0, TABLE), (0.0, 0.0, 1.0))
        motion, _ = start(cell)
        places, forces = await recorded(cell, motion)
        assert motion.outcome.succeeded, motion.outcome.text
        pressed = (places[:, 1] > 0.04) & (places[:, 1] < 0.075)
        assert forces[pressed, 2] == pytest.approx(20.0, abs=0.5)
        assert places[pressed, 2] == pytest.approx(-0.004, abs=0.0002)  # 1 mm deep
        assert np.abs(places[:, 0]).max() < 5e-4
        assert not forces[places[:, 1] < 0.019].any()
        assert places[-1] == pytest.approx((0.0, 0.1, 0.0), abs=5e-4)
        assert cell.robot.controller.contact.force_mode is None

    run_cell(scenario)


def test_a_controller_that_reports_the_target_of_the_program_is_followed_too(monkeypatch):
    """Nobody publishes which target pose a robot reports in force mode."""
    table = dict(COMPUTED, target_TCP_pose=lambda c: c.motion.T_base_tcp.rotation_vector())
    monkeypatch.setattr(rtde_output_values, 'COMPUTED', table)

    async def scenario(cell):
        put(cell, 'plane', (0.0, 0.0, TABLE), (0.0, 0.0, 1.0))
        motion, _ = start(cell)
        await recorded(cell, motion)
        assert motion.outcome.succeeded, motion.outcome.text

    run_cell(scenario)


def test_a_path_may_lead_along_a_compliant_axis():
    async def scenario(cell):
        put(cell, 'plane', (0.0, 0.0, -0.02), (0.0, 0.0, 1.0), friction=0.0)
        state = cell.memory.read()
        (x, y, z), turned = state.actual_tcp_pose.position, state.actual_tcp_pose.quaternion
        goal = Goal(
            waypoints=tuple(
                Waypoint(pose=Pose((x, y + dy, z + dz), turned))
                for dy, dz in ((0.01, 0.0), (0.01, -0.03), (0.05, -0.03), (0.05, 0.0))
            ),
            segments=(Segment(velocity=0.05, acceleration=0.5),) * 4,
            presses=(replace(DOWN, last_waypoint=2, forces=(-10.0,), max_yield=0.012),),
            path_tolerance=TIGHT,
            goal_tolerance=TIGHT,
        )
        motion = cell.owner.start(plan(goal, state, ARM, OPTIONS))
        places, forces = await recorded(cell, motion)
        assert motion.outcome.succeeded, motion.outcome.text
        assert places[:, 2].min() == pytest.approx(-0.02, abs=0.005)
        assert forces[(places[:, 1] > 0.02) & (places[:, 1] < 0.045), 2] == pytest.approx(
            10.0, abs=1.0
        )

    run_cell(scenario)


def test_a_press_to_the_end_of_the_goal_leaves_the_tool_where_it_is():
    async def scenario(cell):
        put(cell, 'plane', (0.0, 0.0, TABLE), (0.0, 0.0, 1.0))
        motion, _ = start(cell, ways=((0.0, 0.02), (0.0, 0.08)))
        places, forces = await recorded(cell, motion)
        assert motion.outcome.succeeded, motion.outcome.text
        assert places[-1] == pytest.approx((0.0, 0.08, -0.004), abs=6e-4)
        assert forces[-1, 2] > 5.0
        assert cell.robot.controller.contact.force_mode is None

    run_cell(scenario)


@pytest.mark.parametrize('axes', [(), ('z',)], ids=['stiff', 'compliant'])
def test_the_goal_ends_where_the_tool_touches(axes):
    async def scenario(cell):
        put(cell, 'box', (0.0, 0.075, 0.0), (0.1, 0.05, 0.1))  # its face is at 50 mm
        press = replace(DOWN, contact=ContactEnd.REQUIRED, axes=axes, forces=(0.0,) * len(axes))
        # The box pushes the tool off its path.
        motion, _ = start(cell, press, path_tolerance=Tolerance(position=(0.002,) * 3))
        places, forces = await recorded(cell, motion)
        assert motion.outcome.succeeded, motion.outcome.text
        said = re.fullmatch(
            r'The tool touched at x (.*), y (.*), z (.*) m in base, on the way to point 1, '
            r'at 5\d\.\d% of its segment\.',
            motion.outcome.text,
        )
        assert said is not None, motion.outcome.text
        here = cell.memory.read().actual_tcp_pose.position
        assert list(map(float, said.groups())) == pytest.approx(here, abs=2e-4)
        # Some cycles before: the arm moves back to where it did not touch yet.
        assert places[-1] == pytest.approx((0.0, 0.05, 0.0), abs=1e-3)
        assert np.abs(forces[-1]).max() < 3.0
        assert cell.robot.controller.contact.force_mode is None

    run_cell(scenario)


def test_a_joint_motion_to_joint_positions_ends_where_the_tool_touches():
    async def scenario(cell):
        put(cell, 'box', (0.0, 0.075, 0.0), (0.1, 0.05, 0.1))  # its face is at 50 mm
        state = cell.memory.read()
        pan, *rest = state.actual_q
        goal = Goal(
            waypoints=tuple(
                Waypoint(
                    pose=Pose((nan,) * 3, (nan,) * 4),
                    posture=Posture(names=JOINT_NAMES, values=(pan + turn, *rest)),
                )
                for turn in (-0.01, -0.2)
            ),
            segments=(Segment(type=SegmentType.JOINT, velocity=0.1, acceleration=0.5),) * 2,
            presses=(replace(DOWN, contact=ContactEnd.REQUIRED, axes=(), forces=()),),
        )
        motion = cell.owner.start(plan(goal, state, ARM, OPTIONS))
        places, _ = await recorded(cell, motion)
        assert motion.outcome.succeeded, motion.outcome.text
        assert places[-1, 1] == pytest.approx(0.05, abs=1e-3)

    run_cell(scenario)


def swing(state, *points, **fields):
    """Return a joint goal (time, turn of the base) that ends where the tool touches."""
    pan, *rest = state.actual_q
    return JointGoal(
        joint_names=JOINT_NAMES,
        points=tuple(
            JointPoint(time=time, positions=(pan + turn, *rest)) for time, turn in points
        ),
        until_contact=True,
        **fields,
    )


@pytest.mark.parametrize(
    ('points', 'accuracy'),
    [
        (((4.0, -0.3),), 1e-3),
        (((0.0, 0.0), (2.0, -0.05), (4.0, -0.3)), 1e-3),
        (((1.2, -0.3),), 2e-3),  # at 0.2 m/s, 0.4 mm in a cycle
    ],
    ids=['one point', 'from here', 'fast'],
)
def test_a_joint_trajectory_ends_where_the_tool_touches(points, accuracy):
    async def scenario(cell):
        put(cell, 'box', (0.0, 0.075, 0.0), (0.1, 0.05, 0.1))  # its face is at 50 mm
        state = cell.memory.read()
        motion = cell.owner.start(plan_joint_goal(swing(state, *points), state, ARM, OPTIONS))
        places, forces = await recorded(cell, motion)
        assert motion.outcome.succeeded, motion.outcome.text
        assert motion.outcome.touched
        assert f'on the way to point {len(points) - 1}, ' in motion.outcome.text
        assert places[-1, 1] == pytest.approx(0.05, abs=accuracy)
        assert np.abs(forces[-1]).max() < 3.0
        # The arm takes the next goal, and the watch is over.
        state = cell.memory.read()
        back = replace(swing(state, (2.0, 0.1)), until_contact=False)
        motion = cell.owner.start(plan_joint_goal(back, state, ARM, OPTIONS))
        await cell.until(lambda: motion.outcome, 10.0)
        assert motion.outcome.succeeded, motion.outcome.text
        assert not motion.outcome.touched

    run_cell(scenario)


def test_a_joint_trajectory_that_touches_nothing_goes_to_its_end():
    async def scenario(cell):
        state = cell.memory.read()
        motion = cell.owner.start(
            plan_joint_goal(swing(state, (2.0, -0.1), (3.0, -0.2)), state, ARM, OPTIONS)
        )
        await cell.until(lambda: motion.outcome, 10.0)
        assert motion.outcome.succeeded, motion.outcome.text
        assert not motion.outcome.touched
        q = cell.memory.read().target_q
        assert q[0] - state.target_q[0] == pytest.approx(-0.2, abs=1e-5)

    run_cell(scenario)


def test_a_tool_that_touches_fast_may_go_back_farther_than_max_plan_deviation():
    async def scenario(cell):
        put(cell, 'box', (0.0, 0.085, 0.0), (0.1, 0.05, 0.1))  # its face is at 60 mm
        press = replace(DOWN, contact=ContactEnd.REQUIRED, axes=(), forces=())
        tolerance = Tolerance(position=(0.001, 0.004, 0.001))
        motion, _ = start(cell, press, velocity=0.12, path_tolerance=tolerance)
        places, _ = await recorded(cell, motion)
        assert motion.outcome.succeeded, motion.outcome.text
        assert places[:, 1].max() - places[-1, 1] > 0.002
        assert places[-1] == pytest.approx((0.0, 0.06, 0.0), abs=2e-3)

    run_cell(scenario)


def test_a_tool_with_nothing_to_press_on_is_stopped():
    async def scenario(cell):
        motion, _ = start(cell, replace(DOWN, max_yield=0.005))
        places, _ = await recorded(cell, motion)
        assert motion.outcome.code is ErrorCode.PATH_TOLERANCE_VIOLATED
        assert 'along z of its press, max_yield is 0.0050 m' in motion.outcome.text
        assert places[:, 2].min() > -0.006
        assert cell.robot.controller.contact.force_mode is None
        again, _ = start(cell, replace(DOWN, forces=(0.0,)))
        await cell.until(lambda: again.outcome, 5.0)
        assert again.outcome.succeeded, again.outcome.text

    run_cell(scenario)


def test_contact_that_is_required_and_does_not_come_fails_the_goal():
    async def scenario(cell):
        motion, _ = start(cell, replace(DOWN, contact=ContactEnd.REQUIRED, axes=(), forces=()))
        places, _ = await recorded(cell, motion)
        assert motion.outcome.code is ErrorCode.EXECUTION_FAILED
        assert motion.outcome.text.startswith('The tool touched nothing')
        assert places[-1] == pytest.approx((0.0, 0.08, 0.0), abs=1e-4)

    run_cell(scenario)


@pytest.mark.parametrize(
    ('tolerance', 'code'),
    [
        (Tolerance(position=(-1.0,) * 3), ErrorCode.PROTECTIVE_STOP),
        (TIGHT, ErrorCode.PATH_TOLERANCE_VIOLATED),
    ],
    ids=['by the controller', 'by the driver'],
)
def test_a_wall_in_the_way_ends_the_goal_in_the_code_that_says_so(tolerance, code):
    async def scenario(cell):
        put(cell, 'plane', (0.0, 0.0, TABLE), (0.0, 0.0, 1.0), friction=0.0)
        put(cell, 'box', (0.0, 0.075, 0.0), (0.1, 0.05, 0.1))
        motion, _ = start(cell, path_tolerance=tolerance)
        places, forces = await recorded(cell, motion)
        assert motion.outcome.code is code, motion.outcome.text
        assert places[:, 1].max() < 0.06
        assert forces[:, 2].max() > 15.0
        await cell.until(lambda: cell.robot.controller.contact.force_mode is None, 0.5)

    run_cell(scenario)


@pytest.mark.parametrize('end', ['cancel', 'stop', 'drop sockets', 'drop rtde', 'pause'])
def test_force_mode_ends_with_the_goal(end):
    async def scenario(cell):
        put(cell, 'plane', (0.0, 0.0, TABLE), (0.0, 0.0, 1.0))
        motion, _ = start(cell)
        controller = cell.robot.controller
        await cell.until(lambda: controller.tcp_wrench[2] > 15.0, 5.0)
        if end == 'pause':
            cell.robot.inject('pause')
            await cell.sleep(1.0)
            assert controller.tcp_wrench[2] == pytest.approx(20.0, abs=5.0)
            cell.owner.cancel()
        elif end == 'cancel':
            cell.owner.cancel()
        else:
            cell.robot.inject(end)
        await cell.until(lambda: motion.outcome, 5.0)
        assert not motion.outcome.succeeded
        await cell.until(lambda: controller.contact.force_mode is None, 0.5)

    run_cell(scenario)


def test_the_frame_of_the_tool_turns_with_it():
    """A tool that leans presses with its force along its own axis, so with more on the table."""

    async def scenario(cell):
        put(cell, 'plane', (0.0, 0.0, TABLE), (0.0, 0.0, 1.0), friction=0.0)
        state = cell.memory.read()
        (x, y, z), turned = state.actual_tcp_pose.position, state.actual_tcp_pose.quaternion
        lean = 0.5
        leant = multiply(quaternion_from_rotation_vector((lean, 0.0, 0.0)), turned)
        goal = Goal(
            waypoints=tuple(
                Waypoint(pose=Pose((x, y + dy, z), q))
                for dy, q in ((0.02, turned), (0.05, leant), (0.09, leant))
            ),
            segments=(Segment(velocity=0.05, acceleration=0.5),) * 3,
            presses=(replace(DOWN, last_waypoint=2, frame=PressFrame.TOOL, forces=(20.0,)),),
        )
        motion = cell.owner.start(plan(goal, state, ARM, OPTIONS))
        places, forces = await recorded(cell, motion)
        assert motion.outcome.succeeded, motion.outcome.text
        leaning = (places[:, 1] > 0.06) & (places[:, 1] < 0.085)
        # Along the others the arm is stiff, and takes the table's push.
        assert forces[leaning, 2] == pytest.approx(20.0 / np.cos(lean), abs=1.0)

    run_cell(scenario)


@needs_checkout
def test_the_example_grinds_two_sides():
    async def scenario(cell):
        put(cell, 'plane', (0.0, 0.0, -0.032), (0.0, 0.0, 1.0))  # as its comment says
        state = cell.memory.read()
        goal = run_path(str(EXAMPLE))['grind'](state.actual_tcp_pose).goal()
        motion = cell.owner.start(plan(goal, state, ARM, OPTIONS))
        places, forces = await recorded(cell, motion)
        assert motion.outcome.succeeded, motion.outcome.text
        x, y, z = places.T
        first, second = (y > 0.02) & (y < 0.05), (x > 0.02) & (x < 0.06)
        for side in first, second:
            assert forces[side, 2] == pytest.approx(20.0, abs=1.0)
            assert z[side] == pytest.approx(-0.033, abs=0.0003)
        assert np.abs(x[first]).max() < 1e-3
        assert y[second] == pytest.approx(0.07, abs=1e-3)
        assert places[-1] == pytest.approx((0.07, 0.07, 0.0), abs=5e-4)

    run_cell(scenario)
