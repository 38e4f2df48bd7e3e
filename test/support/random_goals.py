# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Random goals on both sides of the limits of an arm.

Uniformly drawn points are nearly all easy or absurd. So each family of goals is drawn around one
limit (reach, joint range, a singularity, the column over the base ...), and about half of its
goals cross this limit. A goal depends only on model and number.
"""

from dataclasses import dataclass
from math import pi

import numpy as np

from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.kinematics.inverse import nearest, solutions
from ur_cartesian_driver.kinematics.robot_models import JOINT_NAMES
from ur_cartesian_driver.motion.geometry.pose import (
    IDENTITY,
    multiply,
    Pose,
    quaternion_from_rotation_vector,
)
from ur_cartesian_driver.motion.geometry.vectors import vector6
from ur_cartesian_driver.motion.goal.goal import (
    ArcMode,
    Goal,
    Posture,
    Segment,
    SegmentType,
    Waypoint,
)

LINEAR, JOINT, CIRCULAR, PROCESS = (
    SegmentType.LINEAR,
    SegmentType.JOINT,
    SegmentType.CIRCULAR,
    SegmentType.PROCESS,
)
ANY = Posture()
#: The types from which straight moves are drawn.
STRAIGHT = (LINEAR, LINEAR, LINEAR, PROCESS, SegmentType.OPTIMIZED_LINEAR)


@dataclass(frozen=True, kw_only=True)
class Case:
    """A goal, and the state of the arm at its start."""

    family: str
    q: tuple
    T_flange_tcp: Pose
    goal: Goal


def random_case(arm: Arm, number: int) -> Case:
    """Return the goal of a number; the families take turns."""
    family = FAMILIES[number % len(FAMILIES)]
    draw = GoalDraw(arm, np.random.default_rng([number, *arm.model.name.encode()]))
    family(draw)
    return Case(
        family=family.__name__.strip('_'), q=draw.q, T_flange_tcp=draw.tool, goal=draw.goal()
    )


class GoalDraw:
    """A goal under construction: points are added to the end."""

    def __init__(self, arm: Arm, rng: np.random.Generator) -> None:
        self.arm, self.rng = arm, rng
        self.size = arm.model.max_reach
        self.tool = (
            IDENTITY
            if rng.random() < 0.3
            else Pose(
                tuple(rng.uniform((-0.05, -0.05, 0.0), (0.05, 0.05, 0.2)).tolist()), self.turn(1.0)
            )
        )
        self.place_arm(self.anywhere())
        self.waypoints: list[Waypoint] = []
        self.segments: list[Segment] = []

    # -- configurations

    def anywhere(self) -> np.ndarray:
        """Return a bent configuration, within one turn around zero."""
        q = self.rng.uniform(-pi, pi, 6)
        q[2] = self.sign() * self.rng.uniform(0.5, 2.6)
        q[4] = self.sign() * self.rng.uniform(0.5, 2.6)
        return q

    def place_arm(self, q) -> None:
        """Place the arm at the start."""
        self.q = self.last = tuple(float(x) for x in q)

    def place_arm_at(self, T_base_tcp: Pose, q) -> None:
        """Start with the tool at a pose, near a configuration; anywhere if this is impossible."""
        near = vector6(float(x) for x in q)
        found = nearest(self.arm, T_base_tcp @ self.tool.inverse(), near)
        self.place_arm(self.anywhere() if found is None else found)

    def moved(self, size: float) -> np.ndarray:
        """Return the last configuration with all joints moved a little [rad]."""
        return np.array(self.last) + self.rng.uniform(-size, size, 6)

    # -- points

    @property
    def pose(self) -> Pose:
        """The last point, or the start."""
        return self.waypoints[-1].pose if self.waypoints else self.at(self.q)

    def at(self, q) -> Pose:
        return self.arm.forward(tuple(float(x) for x in q)) @ self.tool

    def add(self, pose: Pose, kind=None, posture=ANY, via=None) -> None:
        kind = STRAIGHT[self.rng.integers(len(STRAIGHT))] if kind is None else kind
        if self.arm.model.series == 'CB3':  # its software knows no optimove
            kind = {SegmentType.OPTIMIZED_LINEAR: LINEAR, SegmentType.OPTIMIZED_JOINT: JOINT}.get(
                kind, kind
            )
        optimized = kind in (SegmentType.OPTIMIZED_LINEAR, SegmentType.OPTIMIZED_JOINT)
        self.segments.append(
            Segment(
                type=kind,
                via=via,
                velocity=self.rng.uniform(0.2, 1.0) if optimized else self.rng.uniform(0.4, 1.5),
                acceleration=self.rng.uniform(0.2, 1.0)
                if optimized
                else self.rng.uniform(3.0, 8.0),
                arc_mode=ArcMode(int(self.rng.integers(2))) if via else ArcMode.UNCONSTRAINED,
            )
        )
        self.waypoints.append(Waypoint(pose=pose, posture=posture))

    def add_at(self, q, kind=None, posture=ANY) -> None:
        """Add the point of a configuration."""
        self.add(self.at(q), kind, posture)
        self.last = tuple(float(x) for x in q)

    def shifted(self, size: float, turn: float = 0.3) -> Pose:
        """Return the last point, moved by a distance [m] and turned by at most an angle [rad]."""
        return Pose(
            tuple((np.array(self.pose.position) + size * self.direction()).tolist()),
            self.turn(turn, self.pose.quaternion),
        )

    def direction(self) -> np.ndarray:
        v = self.rng.normal(size=3)
        return v / np.linalg.norm(v)

    def turn(self, max_angle: float, before=IDENTITY.quaternion):
        vector = self.direction() * self.rng.uniform(0.0, max_angle)
        return (
            Pose((0.0,) * 3, before)
            @ Pose((0.0,) * 3, quaternion_from_rotation_vector(tuple(vector.tolist())))
        ).quaternion

    def sign(self) -> float:
        return float(self.rng.choice((-1.0, 1.0)))

    def posture(self, q, count=6) -> Posture:
        """Return the posture of some joints of a configuration."""
        chosen = sorted(self.rng.permutation(6)[:count])
        return Posture(
            names=tuple(JOINT_NAMES[i] for i in chosen), values=tuple(float(q[i]) for i in chosen)
        )

    # -- the goal

    def goal(self) -> Goal:
        """Return the goal with blends, and with times in a third of the possible cases."""
        self._blend()
        if self.rng.random() < 0.3 and all(map(self._can_have_time, range(len(self.segments)))):
            time, before = 0.0, self.at(self.q)
            for i, point in enumerate(self.waypoints):
                extent = before.distance_to(point.pose) + 0.3 * before.angle_to(point.pose)
                time += 0.1 + 2.0 * extent
                before = point.pose
                self.waypoints[i] = Waypoint(pose=point.pose, posture=point.posture, time=time)
                self.segments[i] = Segment(
                    type=self.segments[i].type,
                    via=self.segments[i].via,
                    arc_mode=self.segments[i].arc_mode,
                    blend_radius=self.segments[i].blend_radius,
                )
        return Goal(waypoints=tuple(self.waypoints), segments=tuple(self.segments))

    def _can_have_time(self, i: int) -> bool:
        """Return whether a segment may have a time: not if it is OPTIMIZED or mostly turns."""
        kind = self.segments[i].type
        if kind in (SegmentType.OPTIMIZED_LINEAR, SegmentType.OPTIMIZED_JOINT):
            return False
        before = self.waypoints[i - 1].pose if i else self.at(self.q)
        target = self.waypoints[i].pose
        return kind not in (CIRCULAR, PROCESS) or (
            before.angle_to(target) < before.distance_to(target)
        )

    def _blend(self) -> None:
        poses = [self.at(self.q), *(point.pose for point in self.waypoints)]
        for i in range(len(self.segments) - 1):
            gap = min(poses[i].distance_to(poses[i + 1]), poses[i + 1].distance_to(poses[i + 2]))
            radius = self.rng.uniform(0.1, 0.45) * gap
            if self.rng.random() < 0.6 and radius > 0.015:
                fields = {
                    name: getattr(self.segments[i], name)
                    for name in ('type', 'velocity', 'acceleration', 'via', 'arc_mode')
                }
                self.segments[i] = Segment(**fields, blend_radius=radius)


# -- the families ---------------------------------------------------------------------------------


def _free(draw: GoalDraw) -> None:
    """Some moves of all kinds in the middle of the workspace."""
    kinds = (*STRAIGHT, JOINT, SegmentType.OPTIMIZED_JOINT)
    for _ in range(draw.rng.integers(1, 5)):
        kind = kinds[draw.rng.integers(len(kinds))]
        q = draw.moved(0.35)
        some = draw.posture(q, draw.rng.integers(1, 7))
        draw.add_at(q, kind, some if draw.rng.random() < 0.3 else ANY)


def _arcs(draw: GoalDraw) -> None:
    """Arcs, some of them large."""
    for _ in range(draw.rng.integers(1, 3)):
        size = draw.rng.uniform(0.03, 0.3) * draw.size
        via = draw.shifted(size)
        draw.add(draw.shifted(size), CIRCULAR, via=via)


def _reach(draw: GoalDraw) -> None:
    """From a nearly stretched arm outwards, beyond the reach or not."""
    q = draw.anywhere()
    q[2] = draw.sign() * draw.rng.uniform(0.1, 0.8)
    draw.place_arm(q)
    if draw.rng.random() < 0.4:
        draw.add(draw.shifted(0.05 * draw.size), LINEAR)
    x, y, z = draw.pose.position
    out = np.array((x, y, z - draw.arm.geometry.d[0]))
    step = draw.rng.uniform(-0.02, 0.12) * draw.size * out / np.linalg.norm(out)
    side = 0.1 * draw.size * draw.direction()
    draw.add(
        Pose(tuple(np.array((x, y, z)) + step + side), draw.turn(0.2, draw.pose.quaternion)),
        (*STRAIGHT, JOINT)[draw.rng.integers(6)],
    )
    if draw.rng.random() < 0.3:
        draw.add(draw.shifted(0.1 * draw.size), LINEAR)


def _range(draw: GoalDraw) -> None:
    """Towards the end of a joint's range, beyond it or not, on a straight line or an arc."""
    limited = [i for i, (_, high) in enumerate(draw.arm.model.position_limits) if high < 100.0]
    joint = draw.rng.choice(limited)
    side = draw.sign()
    q = draw.anywhere()
    end = draw.arm.model.position_limits[joint][1 if side > 0.0 else 0]
    q[joint] = end - side * draw.rng.uniform(0.02, 0.3)
    if joint == 2:  # a stretched arm next to the end of the elbow's range
        q[joint] = end - side * draw.rng.uniform(0.2, 0.5)
    draw.place_arm(q)
    target = draw.moved(0.1)
    target[joint] = end + side * draw.rng.uniform(-0.15, 0.2)
    draw.add_at(target, None, draw.posture(target) if draw.rng.random() < 0.2 else ANY)
    if draw.rng.random() < 0.3:
        draw.add(draw.shifted(0.05 * draw.size))


def _wrist(draw: GoalDraw) -> None:
    """Past a straight wrist, with and without a posture on the other side."""
    q = draw.anywhere()
    side = draw.sign()
    straight = draw.rng.choice((0.0, pi * draw.sign()))
    q[4] = straight + side * draw.rng.uniform(0.05, 0.4)
    draw.place_arm(q)
    target = draw.moved(0.2)
    target[4] = straight - side * draw.rng.uniform(-0.1, 0.3)
    some = draw.posture(target, draw.rng.integers(3, 7))
    draw.add_at(target, None, some if draw.rng.random() < 0.4 else ANY)


def _through_the_wrist(draw: GoalDraw) -> None:
    """
    So near to a straight wrist that the forearm swings round: 10 urad to 0.1 rad beside it.

    Axis 6 is tilted: with a level one, which no translation changes, the wrist goes straight
    through.
    """
    q = draw.anywhere()
    q[4] = 0.0
    middle = draw.at(q)
    tilt = quaternion_from_rotation_vector(
        tuple(draw.direction() * 10.0 ** draw.rng.uniform(-5.0, -1.0))
    )
    tilted = multiply(tilt, middle.quaternion)
    step = draw.rng.uniform(0.04, 0.15) * draw.size * draw.direction()
    draw.place_arm_at(Pose(tuple(np.array(middle.position) - step), tilted), q)
    draw.add(Pose(tuple(np.array(middle.position) + step), tilted))


def _column(draw: GoalDraw) -> None:
    """Past the column over the base, into which the centre of the wrist cannot go."""
    q = draw.anywhere()
    arm = draw.arm
    radius = abs(arm.geometry.d[3])
    draw.tool = IDENTITY
    T_base_flange = arm.forward(tuple(q))
    angle = draw.rng.uniform(-pi, pi)
    along, normal = (
        np.array((np.cos(angle), np.sin(angle))),
        np.array((-np.sin(angle), np.cos(angle))),
    )
    height = draw.rng.uniform(0.4, 0.9) * draw.size + arm.geometry.d[0]
    aside = radius * draw.rng.uniform(0.7, 1.5)
    half = draw.rng.uniform(0.05, 0.2) * draw.size
    ends = []
    for sign in (-1.0, 1.0):
        x, y = aside * normal + sign * half * along
        centre = Pose((x, y, height), T_base_flange.quaternion)
        ends.append(centre @ Pose((0.0, 0.0, arm.geometry.d[5])))
    draw.place_arm_at(ends[0], q)
    draw.add(ends[1])


def _column_arc(draw: GoalDraw) -> None:
    """Past the column over the base on an arc."""
    _column(draw)
    end = draw.waypoints.pop().pose
    draw.segments.pop()
    via = Pose(
        tuple(
            0.5 * (np.array(draw.at(draw.q).position) + end.position)
            + draw.rng.uniform(0.02, 0.08) * draw.size * draw.direction()
        ),
        end.quaternion,
    )
    draw.add(end, CIRCULAR, via=via)


def _joint(draw: GoalDraw) -> None:
    """Joint moves with all postures, including whole turns and unreachable targets."""
    for _ in range(draw.rng.integers(1, 4)):
        q = draw.moved(1.2)
        far = draw.rng.random() < 0.25
        if far:
            q = q + 2.0 * pi * draw.rng.integers(-1, 2, 6)
        q = np.where(np.abs(q) > 6.2, np.remainder(q, 2.0 * pi), q)
        some = draw.posture(q, draw.rng.integers(1, 7))
        draw.add_at(q, JOINT, some if draw.rng.random() < 0.7 else ANY)
    if draw.rng.random() < 0.4:
        position = np.array(draw.pose.position)
        out = position * (1.0 + draw.rng.uniform(0.0, 0.8) * draw.size / np.linalg.norm(position))
        draw.add(Pose(tuple(out), draw.pose.quaternion), JOINT)


def _other_branch(draw: GoalDraw) -> None:
    """A straight move with the posture of another solution of the same pose."""
    q = draw.moved(0.3)
    found = solutions(draw.arm, draw.arm.forward(tuple(q)))
    other = found[draw.rng.integers(len(found))]
    draw.add_at(
        q, (LINEAR, PROCESS)[draw.rng.integers(2)], draw.posture(other, draw.rng.integers(2, 7))
    )


def _mixed(draw: GoalDraw) -> None:
    """Joint moves and straight ones in turn, with blends between them."""
    for i in range(draw.rng.integers(2, 5)):
        draw.add_at(draw.moved(0.5), (LINEAR, JOINT)[i % 2])


def _corners(draw: GoalDraw) -> None:
    """Blends at corners near a limit: a stretched arm, a straight wrist."""
    q = draw.anywhere()
    q[draw.rng.choice((2, 4))] = draw.sign() * draw.rng.uniform(0.05, 0.5)
    draw.place_arm(q)
    for _ in range(draw.rng.integers(2, 4)):
        draw.add_at(draw.moved(0.4), (LINEAR, JOINT, PROCESS)[draw.rng.integers(3)])


def _long(draw: GoalDraw) -> None:
    """Straight through the workspace from one random place to another."""
    draw.add_at(draw.anywhere(), (LINEAR, LINEAR, JOINT)[draw.rng.integers(3)])


FAMILIES = (
    _free,
    _arcs,
    _reach,
    _range,
    _wrist,
    _through_the_wrist,
    _column,
    _column_arc,
    _joint,
    _other_branch,
    _mixed,
    _corners,
    _long,
)
