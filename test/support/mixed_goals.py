# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Random goals of all kinds, mixed, for random robots: goals that users send, or should not send.

A robot depends only on seed and number, and so does each of its goals.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from math import nan, pi
from typing import Any

import numpy as np
from random_goals import ANY, Case, GoalDraw, random_case, STRAIGHT

from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.kinematics.robot_models import MODELS
from ur_cartesian_driver.motion.geometry.pose import Pose, rotate
from ur_cartesian_driver.motion.geometry.vectors import Vector6
from ur_cartesian_driver.motion.goal.execution_modes import ExecutionMode
from ur_cartesian_driver.motion.goal.goal import (
    ArcMode,
    Goal,
    IOCommand,
    OutputKind,
    Segment,
    SegmentType,
    Waypoint,
)
from ur_cartesian_driver.sim.calibration import random_calibration

TYPE = SegmentType
KINDS = (
    *(TYPE.AUTO, TYPE.LINEAR, TYPE.LINEAR, TYPE.JOINT, TYPE.PROCESS, TYPE.PROCESS),
    *(TYPE.CIRCULAR, TYPE.CIRCULAR, TYPE.OPTIMIZED_LINEAR, TYPE.OPTIMIZED_JOINT),
)
_OPTIMIZED = (TYPE.OPTIMIZED_LINEAR, TYPE.OPTIMIZED_JOINT)
_ON_CB3 = {TYPE.OPTIMIZED_LINEAR: TYPE.LINEAR, TYPE.OPTIMIZED_JOINT: TYPE.JOINT}


@dataclass(frozen=True, kw_only=True)
class RandomRobot:
    """An arm, and the options of its driver that are not the defaults."""

    arm: Arm
    #: Seed of its calibration; None = it is nominal.
    calibration_seed: int | None
    #: Seed of its imperfections; empty = it is ideal.
    imperfect: str
    #: Cycles per second; an e-Series costs four times as much computing time as a CB3.
    frequency: float
    options: dict[str, Any]

    def __str__(self) -> str:
        calibrated = self.calibration_seed is not None
        chosen = ', '.join(f'{name} {value}' for name, value in self.options.items())
        return (
            f'{self.arm.model.name}{", calibrated" if calibrated else ""}'
            f'{", imperfect" if self.imperfect else ""}, '
            f'{self.frequency:g} Hz, {chosen}'
        )


def random_robot(seed: int, number: int) -> RandomRobot:
    """Return the robot of a seed and a number; the models take turns."""
    rng = np.random.default_rng([seed, number])
    model = tuple(MODELS.values())[(seed + number) % len(MODELS)]
    calibration = seed + number if rng.random() < 0.5 else None
    geometry = None if calibration is None else random_calibration(model, calibration)
    return RandomRobot(
        calibration_seed=calibration,
        arm=Arm(model, geometry),
        imperfect=str(int(rng.integers(1, 1000))) if rng.random() < 0.3 else '',
        frequency=500.0 if model.series != 'CB3' and rng.random() < 0.4 else 125.0,
        options={
            'max_tool_speed': float(rng.choice((0.25, 0.25, 0.25, 0.08, 0.6, 1.5))),
            'on_too_fast': str(rng.choice(('refuse', 'slow'))),
            'max_approach_distance': float(rng.choice((0.0, 0.5))),
            # Clearance has tests of its own.
            'self_collision': 'off',
        },
    )


def mixed_case(
    robot: RandomRobot,
    seed: int,
    robot_number: int,
    number: int,
    start: tuple[Vector6, Pose] | None = None,
) -> Case:
    """
    Return a goal of a robot.

    :param start: joints and TCP, if the arm cannot be placed freely.
    """
    rng = np.random.default_rng([seed, robot_number, number])
    if start is None and rng.random() < 0.2:
        return random_case(robot.arm, int(rng.integers(1 << 30)))
    family = FAMILIES[rng.integers(len(FAMILIES))]
    draw = MixedDraw(robot.arm, rng)
    if start is not None:
        draw.place_arm(start[0])
        draw.tool = draw.T_flange_tcp = start[1]
    draw.max_speed = robot.options['max_tool_speed']
    if start is not None and draw.chance(0.2):  # another frame than the TCP
        draw.tool = Pose(tuple(rng.uniform(-0.1, 0.1, 3).tolist()), draw.turn(1.0))
    family(draw)
    return draw.case(family.__name__.strip('_'))


class MixedDraw(GoalDraw):
    """A goal under construction, with everything that a goal can have."""

    #: The TCP of the robot; None = any.
    T_flange_tcp: Pose | None = None
    max_speed = 0.25
    execution = ExecutionMode.AUTO
    #: Whether the goal has times; None = by chance.
    timed: bool | None = None
    #: Fractions of blended points, and of goals with radii that may be too large.
    blended, oversized = 0.5, 0.05

    def chance(self, share: float) -> bool:
        return bool(self.rng.random() < share)

    def between(self, low: float, high: float) -> float:
        """Return a number between two bounds, uniform in its logarithm."""
        return float(np.exp(self.rng.uniform(np.log(low), np.log(high))))

    def add(self, pose: Pose, kind=None, posture=ANY, via=None) -> None:
        kind = STRAIGHT[self.rng.integers(len(STRAIGHT))] if kind is None else kind
        if self.arm.model.series == 'CB3':
            kind = _ON_CB3.get(kind, kind)
        if kind == TYPE.CIRCULAR and via is None:
            via = self.via_to(pose)
        low, high = (0.1, 1.0) if kind in _OPTIMIZED else (0.03, 0.8)
        velocity = self.between(low, high) if self.chance(0.6) else 0.0
        acceleration = self.between(10.0 * low, high * 10.0) if self.chance(0.5) else 0.0
        self.segments.append(
            Segment(
                type=kind,
                via=via,
                velocity=velocity,
                acceleration=min(acceleration, 1.0) if kind in _OPTIMIZED else acceleration,
                arc_mode=ArcMode(int(self.rng.integers(2))) if via else ArcMode.UNCONSTRAINED,
            )
        )
        self.waypoints.append(Waypoint(pose=pose, posture=posture))

    def via_to(self, pose: Pose) -> Pose:
        """Return a point beside the line to a pose."""
        a, b = np.array(self.pose.position), np.array(pose.position)
        length = float(np.linalg.norm(b - a))
        aside = self.rng.uniform(0.05, 0.6) * max(length, 1e-3) * self.direction()
        middle = a + self.rng.uniform(0.3, 0.7) * (b - a) + aside
        return Pose(tuple(middle.tolist()), pose.quaternion)

    def kind(self) -> SegmentType:
        return KINDS[self.rng.integers(len(KINDS))]

    # -- the goal

    def case(self, family: str) -> Case:
        """Return the goal with blends, times, frames and outputs."""
        is_spline = self.execution in (ExecutionMode.SPLINE, ExecutionMode.SERVO)
        if is_spline:
            self.segments = []
        else:
            self._blend()
        timed = self.chance(0.5) if self.timed is None else self.timed
        if timed or is_spline:
            self._time()
        goal = Goal(
            waypoints=tuple(self.waypoints),
            segments=tuple(self.segments),
            execution=self.execution,
        )
        if self.chance(0.15):
            goal = replace(goal, io_commands=self._outputs())
        T_flange_tcp = self.tool
        if self.T_flange_tcp not in (None, self.tool) or self.chance(0.2):
            other = Pose(tuple(self.rng.uniform(-0.1, 0.1, 3).tolist()), self.turn(1.0))
            T_flange_tcp = self.T_flange_tcp or other
            goal = replace(goal, T_flange_controlled=self.tool, controlled_frame='nozzle')
        if self.chance(0.3):
            goal = self._in_frame(goal)
        return Case(family=family, q=self.q, T_flange_tcp=T_flange_tcp, goal=goal)

    def _blend(self) -> None:
        poses = [self.at(self.q), *(point.pose for point in self.waypoints)]
        largest = 1.2 if self.chance(self.oversized) else 0.45
        for i in range(len(self.segments) - 1):
            gap = min(poses[i].distance_to(poses[i + 1]), poses[i + 1].distance_to(poses[i + 2]))
            if self.chance(self.blended):
                radius = float(self.rng.uniform(0.02, largest)) * gap
                self.segments[i] = replace(self.segments[i], blend_radius=radius)

    def _time(self) -> None:
        """Give each point a time around the shortest that the limits allow."""
        time, before = 0.0, self.at(self.q)
        haste = self.between(0.8, 4.0)
        speed = min(self.max_speed, 0.5)
        for i, point in enumerate(self.waypoints):
            if self.segments:
                kind = self.segments[i].type
                if kind in _OPTIMIZED:
                    kind = TYPE.LINEAR if kind == TYPE.OPTIMIZED_LINEAR else TYPE.JOINT
                # Any time is refused if the turn leads in one of these motions.
                may_lead = kind not in (TYPE.PROCESS, TYPE.CIRCULAR) or self.chance(0.1)
                if before.angle_to(point.pose) > before.distance_to(point.pose) and not may_lead:
                    kind = TYPE.LINEAR
                if kind != TYPE.CIRCULAR:
                    self.segments[i] = replace(
                        self.segments[i], via=None, arc_mode=ArcMode.UNCONSTRAINED
                    )
                self.segments[i] = replace(
                    self.segments[i],
                    type=kind,
                    velocity=0.0,
                    acceleration=self.between(0.3, 8.0) if self.chance(0.2) else 0.0,
                )
            length, angle = before.distance_to(point.pose), before.angle_to(point.pose)
            step = max(length / speed, angle, 0.03) * 1.6 * haste * self.rng.uniform(0.9, 1.5)
            time += float(step)
            self.waypoints[i] = replace(point, time=time)
            before = point.pose
        if self.execution in (ExecutionMode.SPLINE, ExecutionMode.SERVO):
            self._rates()

    def _rates(self) -> None:
        """Give the inner points of a spline twists, and sometimes accelerations."""
        poses = [self.at(self.q), *(point.pose for point in self.waypoints)]
        times = [0.0, *(point.time for point in self.waypoints)]
        chosen, quintic = self.chance(0.3), self.chance(0.4)
        for i in range(len(self.waypoints) - 1):
            a, b = np.array(poses[i].position), np.array(poses[i + 2].position)
            v = (b - a) / (times[i + 2] - times[i]) * self.rng.uniform(0.3, 1.2)
            w = self.rng.normal(size=3) * (0.1 if self.chance(0.5) else 0.0)
            twist = tuple([*v.tolist(), *w.tolist()])
            if chosen:
                twist = (nan,) * 6
            elif self.chance(0.2):
                twist = (0.0,) * 6
            acceleration = (0.0,) * 6
            if quintic:
                value = self.rng.normal(size=6) * 0.1
                acceleration = (nan,) * 6 if self.chance(0.5) else tuple(value.tolist())
            self.waypoints[i] = replace(self.waypoints[i], twist=twist, acceleration=acceleration)

    def _outputs(self) -> tuple[IOCommand, ...]:
        return tuple(
            IOCommand(
                waypoint=i,
                offset=0.0,
                output=OutputKind.STANDARD_DIGITAL,
                pin=int(self.rng.integers(8)),
                value=float(self.rng.integers(2)),
            )
            for i in range(len(self.waypoints))
            if self.chance(0.5)
        )

    def _in_frame(self, goal: Goal) -> Goal:
        """Express a goal in another frame: the tool's, or the frame of a part somewhere."""
        frame = (
            self.at(self.q)
            if self.chance(0.5)
            else Pose(tuple(self.rng.uniform(-1.0, 1.0, 3).tolist()), self.turn(pi))
        )
        back = frame.inverse()

        def turned(rates):
            return (*rotate(back.quaternion, rates[:3]), *rotate(back.quaternion, rates[3:]))

        return replace(
            goal,
            T_base_frame=frame,
            waypoints=tuple(
                replace(
                    point,
                    pose=back @ point.pose,
                    twist=turned(point.twist),
                    acceleration=turned(point.acceleration),
                )
                for point in goal.waypoints
            ),
            segments=tuple(
                segment if segment.via is None else replace(segment, via=back @ segment.via)
                for segment in goal.segments
            ),
        )


# -- the families ---------------------------------------------------------------------------------


def _paths(draw: MixedDraw) -> None:
    """Moves of all kinds of some centimetres."""
    size = draw.between(0.03, 0.3)
    for _ in range(draw.rng.integers(1, 6)):
        q, posture = draw.moved(size), ANY
        if draw.chance(0.2):
            posture = draw.posture(q, draw.rng.integers(1, 7))
        draw.add_at(q, draw.kind(), posture)


def _process(draw: MixedDraw) -> None:
    """PROCESS, arcs and lines with a steady orientation, nearly all blended."""
    draw.blended = 0.9
    size = draw.between(0.02, 0.15)
    for _ in range(draw.rng.integers(2, 6)):
        kind = (TYPE.PROCESS, TYPE.PROCESS, TYPE.CIRCULAR, TYPE.LINEAR)[draw.rng.integers(4)]
        draw.add(draw.shifted(size, 0.0 if draw.chance(0.7) else 0.3), kind)


def _tiny(draw: MixedDraw) -> None:
    """Less than a millimetre, less than a degree."""
    for _ in range(draw.rng.integers(1, 5)):
        pose = draw.shifted(draw.between(5e-5, 2e-3), draw.between(1e-4, 1e-2))
        draw.add(pose, draw.kind())


def _turns(draw: MixedDraw) -> None:
    """The tool turns by more than it moves."""
    for _ in range(draw.rng.integers(1, 4)):
        draw.add(draw.shifted(draw.between(1e-4, 0.03), 2.5), draw.kind())


def _huge(draw: MixedDraw) -> None:
    """Through the workspace."""
    for _ in range(draw.rng.integers(1, 3)):
        draw.add_at(draw.moved(draw.rng.uniform(0.3, 1.2)), draw.kind())


def _patient(draw: MixedDraw) -> None:
    """A small motion in a long time."""
    draw.timed = True
    draw.add(
        draw.shifted(draw.between(3e-4, 4e-3), 0.01),
        (TYPE.LINEAR, TYPE.JOINT)[draw.rng.integers(2)],
    )
    draw.max_speed = 0.002


def _waits(draw: MixedDraw) -> None:
    """The arm stands at the first point already."""
    draw.timed = draw.chance(0.8)
    draw.add(draw.pose, (TYPE.LINEAR, TYPE.JOINT)[draw.rng.integers(2)])
    if draw.chance(0.8):
        _paths(draw)


def _splines(draw: MixedDraw) -> None:
    """Points of a spline, or of a stream of set-points."""
    draw.execution = (ExecutionMode.SPLINE, ExecutionMode.SPLINE, ExecutionMode.SERVO)[
        draw.rng.integers(3)
    ]
    if draw.chance(0.1):
        draw.add(draw.pose)
    size = draw.between(1e-3, 0.15)
    for _ in range(draw.rng.integers(1, 7)):
        draw.add(draw.shifted(size, draw.rng.uniform(0.0, 3.0 * size)))


FAMILIES: tuple[Callable[[MixedDraw], None], ...] = (
    _paths,
    _paths,
    _process,
    _process,
    _tiny,
    _turns,
    _huge,
    _patient,
    _waits,
    _splines,
    _splines,
    _splines,
)
