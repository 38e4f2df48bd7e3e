# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
``ur-cartesian validate`` and ``show``: check and plan a goal without a driver.

The command line gives the values that a driver would read from its robot: model, calibration,
joint positions and TCP. Only ``show --live`` reads joint positions and TCP from a robot. No frames
are looked up in tf2.
"""

from __future__ import annotations

import argparse
import asyncio
from collections.abc import Iterable
from pathlib import Path
import sys
from tempfile import NamedTemporaryFile
from time import time_ns
from typing import NoReturn, TYPE_CHECKING
import webbrowser

from ur_cartesian_driver.cli.commands import code_text, read_goal
from ur_cartesian_driver.cli.progress import timed
from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.kinematics.robot_models import robot_model
from ur_cartesian_driver.motion.errors import GoalRefused
from ur_cartesian_driver.motion.geometry.pose import IDENTITY
from ur_cartesian_driver.motion.geometry.vectors import vector6
from ur_cartesian_driver.motion.goal.goal import Goal
from ur_cartesian_driver.motion.plan.plan import Plan
from ur_cartesian_driver.motion.plan.slow_stretch import speed_advice
from ur_cartesian_driver.motion.state.rtde_state import RobotState
from ur_cartesian_driver.planning.stop_prediction import state_at_rest
from ur_cartesian_driver.robot.rtde.probe import read_state
from ur_cartesian_driver.robot.rtde.state_stream import StateStream
from ur_cartesian_driver.sim import SimulatorConfig
from ur_cartesian_driver.sim.command_line.simulate import calibration

if TYPE_CHECKING:
    from ur_cartesian_driver.preview.live_page import LivePage

#: Default address on which pages are served.
LOOPBACK = '127.0.0.1'
#: Rate at which robot states are read [Hz]; pause before the robot is connected again [s].
LIVE_RATE, RECONNECT_PERIOD = 20.0, 1.0


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
    print(*found.report, *speed_advice(found.find_slow_stretches()), sep='\n')
    return 0


def show(arguments: argparse.Namespace) -> int:
    """Write or open a page that shows a goal, even a refused one; with --live, follow a robot."""
    from ur_cartesian_driver.preview import motion_page, refusal_page

    if arguments.live:
        return _show_live(arguments)
    if not arguments.file:
        raise ValueError('which goal? Name a file or an example, or follow a robot with --live')
    planning = GoalPlanning(arguments)
    status = 0
    try:
        try:
            found = planning.plan()
            with timed('drawing'):
                page = motion_page(found, planning.arm, planning.options)
        except GoalRefused as refusal:
            print(f'refused, {code_text(refusal.code)}: {refusal}', file=sys.stderr)
            if planning.goal is None:
                return 1
            status, state = 1, planning.state
            page = refusal_page(
                planning.goal,
                refusal,
                planning.arm,
                state.actual_q,
                state.T_flange_tcp,
                planning.options,
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


def _show_live(arguments: argparse.Namespace) -> int:
    """Serve a page that follows a robot, until a signal ends the command."""
    from ur_cartesian_driver.preview import live_page

    state = asyncio.run(read_state(arguments.live, arguments.rtde_port))
    planning = GoalPlanning(arguments, state)
    plan = None
    try:
        if planning.message is not None:
            plan = planning.plan()
    except GoalRefused as refusal:
        print(f'refused, {code_text(refusal.code)}: {refusal}', file=sys.stderr)
        return 1
    try:
        with live_page(
            planning.arm,
            state,
            plan=plan,
            options=planning.options,
            host=arguments.host,
            port=arguments.port,
        ) as page:
            print(f'page: {page.url}', flush=True)
            if arguments.host == LOOPBACK:
                webbrowser.open(page.url)
            asyncio.run(_follow(page, arguments.live, arguments.rtde_port))
    except ImportError as error:
        print(f'ur-cartesian show: {error}', file=sys.stderr)
        return 1
    return 0


async def _follow(page: LivePage, host: str, port: int) -> NoReturn:
    """Show the states of a robot, and connect again when the connection is lost."""
    while True:
        stream = StateStream(LIVE_RATE, 0.0, page.update)
        try:
            await stream.open(host, port)
            reason = await stream.ended()
        except OSError as error:
            reason = str(error)
        finally:
            stream.close()
        page.say_lost(reason)
        await asyncio.sleep(RECONNECT_PERIOD)


class GoalPlanning:
    """The goal of a command line, and the arm that it is planned for."""

    def __init__(
        self, arguments: argparse.Namespace, robot: RobotState | None = None, *, model: str = ''
    ) -> None:
        """
        Read the parameters and the goal.

        :param robot: the state of the robot; None = the arm rests as the arguments say.
        :param model: name of the arm's model; empty = the arguments or the parameters name it.
        """
        from ur_cartesian_driver.planning.preflight.clearance import self_collision_remark
        from ur_cartesian_driver.ros.parameters.parameter_files import read_settings

        self._settings = settings = read_settings(arguments.params_file, arguments.param)
        its_model = robot_model(model or arguments.ur_type or settings.driver.ur_type)
        if remark := self_collision_remark(its_model.name, settings.planning):
            print(remark, file=sys.stderr)
        self.arm = Arm(its_model, calibration(arguments, its_model))
        if robot is None:
            q = vector6(arguments.joints or SimulatorConfig().q)
            tcp = arguments.tcp or IDENTITY
        else:
            q, tcp = robot.actual_q, robot.T_flange_tcp
        self.state = state_at_rest(self.arm, q, tcp)
        self.frames = settings.frames
        self.options = settings.planning.for_program(settings.driver)
        #: The goal's message; None if the command line names no goal.
        self.message = read_goal(arguments) if arguments.file else None
        #: The goal; None before :meth:`plan` has resolved its frames.
        self.goal: Goal | None = None

    def plan(self) -> Plan:
        """
        Return the plan of the goal.

        :raises GoalRefused: the goal is refused; the text says why.
        """
        from ur_cartesian_driver.motion.goal.known_frames import ArmSnapshot
        from ur_cartesian_driver.planning import plan
        from ur_cartesian_driver.ros.messages.goal_conversion import goal_from_message

        self.goal = goal_from_message(
            self.message,
            self.frames,
            now=time_ns(),
            snapshot=ArmSnapshot.of(self.state),
            time_tolerance=self._settings.node.goal_time_tolerance,
        )
        with timed('planning'):
            return plan(self.goal, self.state, self.arm, self.options)


def _numbers(values: Iterable[float]) -> str:
    return ' '.join(f'{value:.4g}' for value in values)
