# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
``ur-cartesian validate`` and ``show``: check and plan a goal without driver and robot.

The command line gives what the driver reads from the robot: model, calibration, joint positions
and TCP. tf2 frames are not available.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
import sys
from tempfile import NamedTemporaryFile
from time import time_ns
import webbrowser

from ur_cartesian_driver.cli.commands import calibration, code_text, read_goal
from ur_cartesian_driver.cli.progress import timed
from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.kinematics.robot_models import robot_model
from ur_cartesian_driver.motion.errors import GoalRefused
from ur_cartesian_driver.motion.goal import Goal
from ur_cartesian_driver.motion.plan import Plan
from ur_cartesian_driver.motion.pose import IDENTITY, Pose
from ur_cartesian_driver.motion.vectors import vector6
from ur_cartesian_driver.motion.workspace import parse_planes, Plane
from ur_cartesian_driver.planning.stop_prediction import state_at_rest
from ur_cartesian_driver.sim import SimulatorConfig


def validate(arguments: argparse.Namespace) -> int:
    """Plan a goal from the given joint positions, and print the plan or the refusal."""
    from ur_cartesian_driver.preview import postures, table

    planning = GoalPlanning(arguments)
    try:
        found = planning.plan()
    except GoalRefused as refusal:
        print(f'refused, {code_text(refusal.code)}: {refusal}', file=sys.stderr)
        return 1
    arm, state = planning.arm, planning.state
    print(
        f'{arm.model.name}{" with its calibration" if arm.calibrated else ""}, joints '
        f'{_numbers(state.actual_q)} rad, TCP {_numbers(state.T_flange_tcp.rotation_vector())}'
    )
    print(table(found))
    if arguments.postures:
        print(postures(found))
    print(*found.report, sep='\n')
    return 0


def show(arguments: argparse.Namespace) -> int:
    """Write the page of a goal, or open it in the browser; that of a refused goal, too."""
    from ur_cartesian_driver.preview import motion_page, refusal_page

    planning = GoalPlanning(arguments)
    status = 0
    try:
        try:
            page = motion_page(planning.plan(), planning.arm, planning.planes)
        except GoalRefused as refusal:
            print(f'refused, {code_text(refusal.code)}: {refusal}', file=sys.stderr)
            if planning.goal is None:
                return 1
            status, state = 1, planning.state
            page = refusal_page(
                planning.goal, refusal, planning.arm, state.actual_q, state.T_flange_tcp
            )
    except ImportError as error:
        print(f'ur-cartesian show: {error}', file=sys.stderr)
        return 1
    if arguments.output:
        Path(arguments.output).write_text(page, encoding='utf-8')
        print(f'page: {arguments.output}')
        return status
    with NamedTemporaryFile(
        'w', prefix='motion_', suffix='.html', encoding='utf-8', delete=False
    ) as file:
        file.write(page)
    print(f'page: {file.name}')
    webbrowser.open(Path(file.name).as_uri())
    return status


class GoalPlanning:
    """The goal of a command line, and the arm that it is planned for."""

    def __init__(self, arguments: argparse.Namespace) -> None:
        """Read the parameters and the goal."""
        from ur_cartesian_driver.planning.preflight.clearance import self_collision_remark
        from ur_cartesian_driver.ros.parameters.parameter_files import read_settings

        self._settings = settings = read_settings(arguments.params_file, arguments.param)
        model = robot_model(arguments.ur_type or settings.driver.ur_type)
        if remark := self_collision_remark(model.name, settings.planning):
            print(remark, file=sys.stderr)
        self.arm = Arm(model, calibration(arguments, model))
        T_flange_tcp = Pose.from_rotation_vector(arguments.tcp) if arguments.tcp else IDENTITY
        self.state = state_at_rest(
            self.arm, vector6(arguments.joints or SimulatorConfig().q), T_flange_tcp
        )
        self._message = read_goal(arguments)
        #: None until its frames are known.
        self.goal: Goal | None = None

    @property
    def planes(self) -> tuple[Plane, ...]:
        """The planes that the arm must not cross."""
        return parse_planes(self._settings.planning.workspace_planes)

    def plan(self) -> Plan:
        """
        Return the plan of the goal.

        :raises GoalRefused: the text says why.
        """
        from ur_cartesian_driver.motion.known_frames import ArmSnapshot
        from ur_cartesian_driver.planning import plan
        from ur_cartesian_driver.ros.messages.goal_conversion import goal_from_message

        settings, dialect = self._settings, self._settings.driver.dialect
        options = replace(
            settings.planning,
            dialect=dialect,
            allow_tcp_change=settings.planning.allow_tcp_change and dialect.supports_tcp_change,
        )
        self.goal = goal_from_message(
            self._message,
            settings.frames,
            now=time_ns(),
            snapshot=ArmSnapshot.of(self.state),
            time_tolerance=settings.node.goal_time_tolerance,
        )
        with timed('planning'):
            return plan(self.goal, self.state, self.arm, options)


def _numbers(values: Iterable[float]) -> str:
    return ' '.join(f'{value:.4g}' for value in values)
