# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""A page that follows a robot: the arm, the planned path, the deviation from it, the state."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from math import hypot

import numpy as np

from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.motion.cell.cell import Cell
from ur_cartesian_driver.motion.geometry.arrays import Floats
from ur_cartesian_driver.motion.geometry.workspace import parse_planes
from ur_cartesian_driver.motion.plan.plan import Plan
from ur_cartesian_driver.motion.state.rtde_state import RobotState
from ur_cartesian_driver.planning.options import PlanningOptions
from ur_cartesian_driver.preview.motion_page import NO_BODIES, scene_of_plan
from ur_cartesian_driver.preview.scene import serve, Server

#: The least length of an edge in the trail of the TCP [m], and the largest number of edges.
TRAIL_STEP, TRAIL_EDGES = 0.002, 1000


class LivePage:
    """A page that follows a robot; made by :func:`live_page`."""

    def __init__(
        self, server: Server, arm: Arm, state: RobotState, plan: Plan | None, cell: Cell
    ) -> None:
        """Draw the arm, its cell, and the plan if there is one."""
        self._arm, self._plan = arm, plan
        self._scene = scene_of_plan(server, arm, state.T_flange_tcp, plan, cell)
        self._tcp = state.T_flange_tcp
        place = np.array(_seen(state, plan).actual_tcp_pose.position)
        self._trail = np.array([place, place])
        if plan is None:
            self._scene.look_at(self._trail)
        self._text = server.gui.add_markdown('')
        #: The address of the page.
        self.url = f'http://{server.get_host()}:{server.get_port()}'
        self.update(state)

    def update(self, state: RobotState) -> None:
        """Show a state of the robot."""
        if state.T_flange_tcp != self._tcp:
            self._tcp = state.T_flange_tcp
            self._scene.set_tool(self._tcp)
        self._scene.pose_arm(state.actual_q)
        place = np.array(_seen(state, self._plan).actual_tcp_pose.position)
        if np.linalg.norm(place - self._trail[-1]) >= TRAIL_STEP:
            self._trail = np.vstack((self._trail[-TRAIL_EDGES:], place))
            self._scene.set_trail(self._trail)
        self._text.content = _text(state, self._plan)

    def say_lost(self, reason: str) -> None:
        """Report that the connection is lost; the arm is still drawn at its last known joints."""
        self._text.content = f'**Not connected**: {reason}. The arm is drawn where it last was.'


@contextmanager
def live_page(
    arm: Arm,
    state: RobotState,
    *,
    plan: Plan | None = None,
    options: PlanningOptions = NO_BODIES,
    host: str = '127.0.0.1',
    port: int = 8080,
) -> Iterator[LivePage]:
    """
    Serve a page that follows a robot, until the end of the context.

    :param state: the robot's present state.
    :param plan: the motion that the robot is expected to make.
    :param options: the options whose planes and bodies of the cell are drawn.
    :param host: the address to listen on: anyone who can reach it sees the robot.
    :param port: the first port to try; if it is in use, the next free one is taken.
    :raises ImportError: viser is not installed; the text says how to get it.
    """
    with serve(parse_planes(options.workspace_planes), host, port) as server:
        yield LivePage(server, arm, state, plan, options.cell)


def path_deviation(path: Floats, place: Floats) -> float:
    """
    Return the distance [m] of a place (3,) [m] from the nearest point of a path.

    :param path: (m, 3) the corners of the path [m].
    """
    start, vector = path[:-1], np.diff(path, axis=0)
    square = np.einsum('ni,ni->n', vector, vector)
    along = np.einsum('ni,ni->n', place - start, vector) / np.where(square > 0.0, square, 1.0)
    nearest = start + np.clip(along, 0.0, 1.0)[:, None] * vector
    return float(np.linalg.norm(nearest - place, axis=1).min())


def _seen(state: RobotState, plan: Plan | None) -> RobotState:
    """Return the state as seen from the frame of the planned path, if this frame moves."""
    frame = None if plan is None else plan.goal.moving_frame
    return state if frame is None else frame.seen(state)


def _text(state: RobotState, plan: Plan | None) -> str:
    x, y, z = (1e3 * value for value in state.actual_tcp_pose.position)
    lag = state.actual_tcp_pose.distance_to(state.target_tcp_pose)
    rows = [
        ('robot', _words(state.robot_mode.name)),
        ('safety', _words(state.safety_mode.name)),
        ('program', _words(state.runtime_state.name)),
        ('TCP', f'{x:.1f} {y:.1f} {z:.1f} mm'),
        ('speed', f'{1e3 * hypot(*state.actual_tcp_twist[:3]):.1f} mm/s'),
        ('speed slider', f'{100.0 * state.target_speed_fraction:.0f} %'),
        ('off its set-point', f'{1e3 * lag:.2f} mm'),
    ]
    if plan is not None:
        seen = _seen(state, plan)
        place = np.array(seen.actual_tcp_pose.position)
        if plan.goal.moving_frame is not None:
            speed = 1e3 * hypot(*seen.actual_tcp_twist[:3])
            rows.append(('speed on the part', f'{speed:.1f} mm/s'))
        deviation = path_deviation(plan.reference.poses[:, :3], place)
        rows.append(('from the planned path', f'{1e3 * deviation:.2f} mm'))
    if state.points_begun:
        rows.append(('points begun', str(state.points_begun)))
    return '\n'.join(['| | |', '|---|---|', *(f'| {name} | {value} |' for name, value in rows)])


def _words(name: str) -> str:
    return name.lower().replace('_', ' ')
