# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""How parameters become bounds of live targets, and the way to the robot loop."""

from dataclasses import replace

import pytest

from ur_cartesian_driver.driver import Driver
from ur_cartesian_driver.driver.ipc.channel import (
    ArmSetup,
    LENGTH,
    pack,
    SetLiveTarget,
    StartMotion,
    unpack,
)
from ur_cartesian_driver.driver.ipc.driver_config import DriverConfig
from ur_cartesian_driver.driver.live_session import live_setup, stationary_job, stationary_plan
from ur_cartesian_driver.driver.loop.goal_machine_factory import is_slow_to_make, make_machine
from ur_cartesian_driver.execution.live.freedrive import FreedriveFeeder
from ur_cartesian_driver.execution.live.live_feeder import LiveFeeder
from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.kinematics.robot_models import robot_model
from ur_cartesian_driver.motion.errors import RobotNotReady
from ur_cartesian_driver.motion.geometry.pose import IDENTITY
from ur_cartesian_driver.motion.state.rtde_state import RobotState
from ur_cartesian_driver.planning import PlanningOptions
from ur_cartesian_driver.sim.simulator_config import HOME

UR5E = robot_model('ur5e')
ARM = Arm(UR5E)
HERE = ARM.forward(HOME)
STATE = RobotState(
    timestamp=0.0, actual_q=HOME, target_q=HOME, actual_tcp_pose=HERE, target_tcp_pose=HERE
)


def limits(**options):
    return live_setup(ARM, HOME, PlanningOptions(**options)).settings.limits


@pytest.mark.parametrize(('most', 'expected'), [(0.1, 0.1), (0.0, 0.25), (1.0, 0.25)])
def test_the_tool_is_never_faster_than_max_tool_speed(most, expected):
    assert limits(max_tool_speed=most).linear_velocity == expected


def test_joints_are_as_fast_as_both_bounds_allow():
    assert limits(live_target_joint_velocity=1.0).joint_velocity == (1.0,) * 6
    assert limits(live_target_joint_velocity=9.0).joint_velocity == UR5E.max_joint_speed


def test_margins_and_planes_are_those_of_goals():
    found = limits(
        singularity_margin_elbow=0.2,
        tool_radius=0.03,
        workspace_planes=('table 0 0 0.1 0 0 2 0.02',),
    )
    assert found.singularity_margins == (0.05, 0.2, 0.02)
    assert found.workspace.tool_radius == 0.03
    (table,) = found.workspace.planes
    assert (table.name, table.normal, table.margin) == ('table', (0.0, 0.0, 1.0), 0.02)


@pytest.mark.parametrize(('choice', 'expected'), [('auto', None), ('refuse', 0.02)])
def test_the_arm_keeps_away_from_itself_where_cylinders_refuse_goals(choice, expected):
    found = limits(self_collision=choice, min_clearance=0.02).workspace
    assert found.min_clearance == expected
    assert bool(found) is (expected is not None)


def sent(message):
    """Return a message as the robot loop gets it."""
    return unpack(pack(message)[LENGTH.size :])


def start(arm=ARM, **fields):
    return sent(
        StartMotion(
            motion=7,
            points=b'',
            job=stationary_job(stationary_plan(STATE)),
            arm=ArmSetup.of(arm),
            live=live_setup(arm, HOME, PlanningOptions()),
            **fields,
        )
    )


def test_a_session_and_its_targets_come_through_the_pipe():
    machine = make_machine(start(), DriverConfig())
    assert isinstance(machine.feeder, LiveFeeder)
    set_target = sent(SetLiveTarget(motion=7, T_base_tcp=HERE, age=0.05))
    machine.can.steering.set_target(set_target.T_base_tcp, set_target.age, 10.0)
    assert machine.feeder.targets.freshness.accepted == 1
    assert isinstance(
        make_machine(replace(start(), live=None, freedrive=True), DriverConfig()).feeder,
        FreedriveFeeder,
    )


def test_only_a_calibrated_arm_takes_long():
    other = Arm(UR5E, replace(UR5E.geometry, a=(0.0, -0.4252, -0.3925, 0.0, 0.0, 0.0)))
    assert is_slow_to_make(start(other))
    assert not is_slow_to_make(start())
    assert not is_slow_to_make(replace(start(), live=None, arm=None))


def test_another_robot_program_does_not_follow_targets():
    driver = Driver(DriverConfig(wire_dialect='2.12'))
    with pytest.raises(RobotNotReady, match=r'follow live targets; wire_dialect .* 2\.12'):
        driver.send_live_target(HERE)
    with pytest.raises(RobotNotReady, match='does not report its state'):
        Driver(DriverConfig()).send_live_target(HERE)


def test_a_plan_for_another_robot_program_is_not_sent():
    for_ours = stationary_plan(STATE)
    for_older = replace(for_ours, older_program='2.12')
    for version, fits, other in (('2.12', for_older, for_ours), ('2.14', for_ours, for_older)):
        driver = Driver(DriverConfig(wire_dialect=version))
        with pytest.raises(RobotNotReady, match='for another robot program'):
            driver.start(other)
        with pytest.raises(RobotNotReady, match='is DISCONNECTED'):
            driver.start(fits)


def test_a_plan_that_stands_has_nothing_on_the_wire():
    plan = stationary_plan(STATE)
    assert (plan.segments, plan.report, plan.T_flange_active) == ((), (), IDENTITY)
