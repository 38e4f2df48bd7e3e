# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Run one of the examples: plan it for a robot, then move along it."""

import argparse
from collections.abc import Callable, Sequence
from typing import Any

from ur_cartesian_driver.driver import Driver, DriverConfig, MotionHandle
from ur_cartesian_driver.path import Frames, Path, Pose, StaticFrame
from ur_cartesian_driver.planning import PlanningOptions


def robot_options() -> argparse.ArgumentParser:
    """Return a parser of the options that name the robot; the default is the simulated one."""
    parser = argparse.ArgumentParser()
    parser.add_argument('--robot-ip', default='127.0.0.1')
    parser.add_argument('--ur-type', default='ur5e')
    return parser


def run(
    make: Callable[..., Path],
    frames: Sequence[StaticFrame] = (),
    meanwhile: Callable[[MotionHandle, Pose], None] = lambda motion, start: None,
    *,
    cell_file: str = '',
    air: dict[str, float] | None = None,
    **settings: Any,
) -> None:
    """
    Make a path from the present pose of the tool, print its plan, and run it.

    With --plan on the command line, the path is not run.

    :param meanwhile: called with the motion and its start pose while the arm moves.
    :param air: settings for air travel; if they are given, ``make`` also gets the AirTravel.
    :param settings: fields of the DriverConfig.
    """
    parser = robot_options()
    parser.add_argument('--plan', action='store_true', help='do not move')
    given = parser.parse_args()
    config = DriverConfig(
        robot_ip=given.robot_ip, ur_type=given.ur_type, headless_mode=True, **settings
    )
    options = PlanningOptions(cell_file=cell_file)
    with Driver(config, options, frames=Frames(static_frames=frames)) as driver:
        driver.wait_ready(timeout=10.0)
        state = driver.state
        assert state is not None
        start = state.actual_tcp_pose
        path = make(start) if air is None else make(start, driver.air_travel(**air))
        plan = driver.plan(path)
        print(*plan.report, sep='\n')
        if not given.plan:
            motion = driver.start(plan)
            meanwhile(motion, start)
            print(motion.result().raise_for_error().text)
