# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The goals of config/examples, for tests of whole goals."""

from dataclasses import replace

from ur_cartesian_driver.motion.geometry.vectors import vector6
from ur_cartesian_driver.motion.goal.goal import Goal
from ur_cartesian_driver.motion.goal.known_frames import ArmSnapshot, Frames
from ur_cartesian_driver.motion.state.rtde_state import RobotState
from ur_cartesian_driver.planning import PlanningOptions
from ur_cartesian_driver.resources import share_path
from ur_cartesian_driver.robot.prelude_file import read_prelude
from ur_cartesian_driver.ros.client import load_goal
from ur_cartesian_driver.ros.messages.goal_conversion import goal_from_message

#: Parameters of the driver for an example that calls functions.
PRELUDE = share_path() / 'config' / 'examples' / 'gripper.script'
PRELUDE_ARGUMENTS = ('-p', 'allow_scripts:=true', '-p', f'script_prelude:={PRELUDE}')
OPTIONS = PlanningOptions(prelude=read_prelude(str(PRELUDE)))


def example_goal(name: str, state: RobotState) -> Goal:
    """Return an example for an arm in a state."""
    message = load_goal(share_path() / 'config' / 'examples' / f'{name}.yaml')
    return goal_from_message(message, Frames(), now=0, snapshot=ArmSnapshot.of(state))


def stretch_times(goal: Goal, factor: float) -> Goal:
    """Return a goal on the same path in a multiple of the time."""
    return replace(
        goal,
        waypoints=tuple(
            replace(
                point,
                time=factor * point.time,
                twist=vector6(v / factor for v in point.twist),
                acceleration=vector6(a / factor**2 for a in point.acceleration),
            )
            for point in goal.waypoints
        ),
    )
