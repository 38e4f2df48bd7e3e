# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Appendable goals for a cell in virtual time, and producers of their points."""

from collections.abc import Callable, Iterable
from math import cos, pi, sin
from typing import Any

from robot_cell import RobotCell

from ur_cartesian_driver.driver.appender import Appender, encode_part
from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.kinematics.robot_models import robot_model
from ur_cartesian_driver.motion.events import Outcome, Progress
from ur_cartesian_driver.motion.geometry.pose import Pose
from ur_cartesian_driver.motion.geometry.vectors import add, vector3
from ur_cartesian_driver.motion.goal.goal import Goal, IOCommand, Segment, Waypoint
from ur_cartesian_driver.planning import plan, PlanningOptions
from ur_cartesian_driver.planning.append.append_planner import plan_first_part
from ur_cartesian_driver.planning.append.appendable_goal import AppendedPoints

BLEND = Segment(blend_radius=0.01, velocity=0.2, acceleration=1.0)


def moved(pose: Pose, *offset: float) -> Pose:
    """A pose moved along base axes [m]."""
    return Pose(add(pose.position, vector3(offset)), pose.quaternion)


def corners(home: Pose, first: int, count: int) -> list[Waypoint]:
    """Points on the corners of a square of 40 mm beside the tool, in endless rounds."""
    return [
        Waypoint(pose=moved(home, 0.04 * (k // 2 % 2), 0.04 * ((k + 1) // 2 % 2), 0.0))
        for k in range(first, first + count)
    ]


def circle(
    home: Pose,
    first: int,
    count: int,
    *,
    step: float = 0.1,
    radius: float = 0.05,
    round_in: float = 4.0,
) -> list[Waypoint]:
    """Points with times and twists on a circle that begins at the tool, from rest and faster."""
    rate = 2.0 * pi / round_in
    points = []
    for k in range(first, first + count):
        # The first round begins with a ramp of a second, along which the angle grows as t^2.
        t = step * k
        angle, speed = (0.5 * rate * t * t, rate * t) if t < 1.0 else (rate * (t - 0.5), rate)
        points.append(
            Waypoint(
                time=t,
                pose=moved(home, radius * sin(angle), radius * (1.0 - cos(angle)), 0.0),
                twist=(
                    radius * speed * cos(angle),
                    radius * speed * sin(angle),
                    0.0,
                    0.0,
                    0.0,
                    0.0,
                ),
            )
        )
    return points


class AppendMotion:
    """A running appendable goal, and the client that appends to it."""

    def __init__(self, cell: RobotCell, goal: Goal, **options: Any) -> None:
        self._cell, self._owner = cell, cell.owner
        self._arm = Arm(robot_model(cell.robot.config.model))
        self._options = PlanningOptions(**{'max_tool_speed': 1.0, 'max_points': 5000} | options)
        part = plan_first_part(
            plan(goal, cell.memory.read(), self._arm, self._options), self._arm, self._options
        )
        self.home = cell.memory.read().actual_tcp_pose
        self.appender = Appender(
            len(self._owner.motions) + 1,
            part,
            send=self._owner.send,
            progress=self._newest,
            planning_inputs=lambda: (self._arm, self._options),
        )
        points, job = encode_part(part)
        self.motion = self._owner.run(points, job)

    def _newest(self) -> Progress | None:
        return self.motion.progress[-1] if self.motion.progress else None

    @property
    def points(self) -> int:
        return self.appender.points

    @property
    def outcome(self) -> Outcome | None:
        return self.motion.outcome

    @property
    def progress(self) -> Progress:
        return self.motion.progress[-1]

    @property
    def ahead(self) -> int:
        """The number of points that the arm has not reached."""
        return self.points - (self.progress.waypoint if self.motion.progress else 0)

    async def append(
        self,
        waypoints: Iterable[Waypoint] = (),
        segments: Iterable[Segment] = (),
        io_commands: Iterable[IOCommand] = (),
        **more: Any,
    ) -> Any:
        """Append as the Python API does, but wait as a coroutine."""
        offers = self.appender.offers(
            AppendedPoints(
                waypoints=tuple(waypoints),
                segments=tuple(segments),
                io_commands=tuple(io_commands),
                **more,
            )
        )
        try:
            offer = next(offers)
            while True:
                self._owner.send(offer)
                await self._cell.until(lambda: self._owner.answers)
                offer = offers.send(self._owner.answers.pop())
        except StopIteration as end:
            return end.value

    async def until(self, condition: Callable[[], object], bound: float = 30.0) -> bool:
        """Wait for a condition or the end of the goal; return whether the condition holds."""
        await self._cell.until(lambda: condition() or self.outcome, bound)
        return self.outcome is None

    async def ended(self, bound: float = 60.0) -> Outcome:
        await self._cell.until(lambda: self.outcome is not None, bound)
        return self.outcome


def clear_network_log(cell: RobotCell) -> None:
    """Clear the records that the network in memory keeps for tests."""
    for end in cell.loop.ends:
        end.received.clear()
        end.peer.received.clear()


def retained_sizes(cell: RobotCell) -> dict[str, int]:
    """Return the sizes of the objects that the robot loop keeps for the running goal."""
    loop = cell.loop_task.get_coro().cr_frame.f_locals['self']
    motion = loop._motion
    monitor = motion._machine.feeder.monitor
    return {
        'records': monitor.records.kept,
        'rows': len(monitor._tracker.path.time),
        'unsent': len(motion._points),
    }
