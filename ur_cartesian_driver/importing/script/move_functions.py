# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The moves of programs: each method is a URScript function whose target becomes a point.

Here each move reaches its target at once, and takes one controller cycle. A move that cannot
become part of a goal raises :exc:`RuntimeException`.
"""

from __future__ import annotations

from math import sqrt

from ur_cartesian_driver.importing.imported_path import JOINTS_HAVE_NO_FRAME, SAME_POINT, SAME_TURN
from ur_cartesian_driver.importing.script.collected_events import (
    CollectedEvents,
    CollectedPoint,
    Steps,
)
from ur_cartesian_driver.motion.geometry.pose import MAX_ANGLE, Pose
from ur_cartesian_driver.motion.geometry.vectors import Vector6
from ur_cartesian_driver.motion.goal.goal import ArcMode, SegmentType
from ur_cartesian_driver.motion.twin.laws import ASSUMED_LAWS
from ur_cartesian_driver.sim.builtins.arguments import (
    is_pose,
    not_negative,
    number,
    one_of,
    positive,
    six,
)
from ur_cartesian_driver.sim.builtins.arguments import (
    pose as pose_argument,
)
from ur_cartesian_driver.urscript import RuntimeException
from ur_cartesian_driver.urscript.script_values import Value

#: The manual's defaults: acceleration [m/s^2] and speed [m/s] of the tool; fraction of the arm's
#: limits, for optimovej and optimovel.
TOOL_A, TOOL_V, FRACTION = 1.2, 0.25, 0.3
#: The manual's defaults for joints [rad/s^2, rad/s].
JOINT_A, JOINT_V = ASSUMED_LAWS.timed_joint_acceleration, ASSUMED_LAWS.timed_joint_speed
#: A shorter line [m] only turns the tool: its rates apply to the turn, as in a goal.
PURE_TURN = 1e-6
#: The assumed turn ratio of movel: the angle that it turns in the time of 1 m [rad/m].
TURN_RATIO = ASSUMED_LAWS.turn_ratio
#: Larger lengths [m] are taken for millimetres.
FAR = 3.0
#: Joints that turn by less than this angle [rad] do not move.
SAME_ANGLE = 1e-6

#: Acceleration and speed, as a program gives them.
Rates = tuple[Value, Value]


class MoveFunctions:
    """Moves and stops."""

    def __init__(self, events: CollectedEvents) -> None:
        """Collect points into ``events``."""
        self._events, self._place, self._run = events, events.place, events.run

    def movej(
        self, q: Value, a: Value = JOINT_A, v: Value = JOINT_V, t: Value = 0, r: Value = 0
    ) -> Steps:
        """Collect a joint motion."""
        yield from self._joints('movej', SegmentType.JOINT, q, (a, v), t, r)

    def optimovej(
        self, goal: Value, a: Value = FRACTION, v: Value = FRACTION, r: Value = 0
    ) -> Steps:
        """Collect a joint motion with limited jerk."""
        yield from self._joints('optimovej', SegmentType.OPTIMIZED_JOINT, goal, (a, v), 0, r)

    def movel(
        self, pose: Value, a: Value = TOOL_A, v: Value = TOOL_V, t: Value = 0, r: Value = 0
    ) -> Steps:
        """Collect a line."""
        yield from self._line('movel', SegmentType.LINEAR, pose, (a, v), t, r)

    def movep(self, pose: Value, a: Value = TOOL_A, v: Value = TOOL_V, r: Value = 0) -> Steps:
        """Collect a line of a process."""
        yield from self._line('movep', SegmentType.PROCESS, pose, (a, v), 0, r)

    def optimovel(
        self, goal: Value, a: Value = FRACTION, v: Value = FRACTION, r: Value = 0
    ) -> Steps:
        """Collect a line with limited jerk."""
        yield from self._line('optimovel', SegmentType.OPTIMIZED_LINEAR, goal, (a, v), 0, r)

    def movec(
        self,
        pose_via: Value,
        pose_to: Value,
        a: Value = TOOL_A,
        v: Value = TOOL_V,
        r: Value = 0,
        mode: Value = 0,
    ) -> Steps:
        """Collect an arc."""
        self._events.take()
        if not self._place.is_known:
            raise RuntimeException(
                'movec is the first move, and where its arc begins is not in the file; put a move '
                'to its beginning before it'
            )
        target = self._pose('movec', pose_to)
        self._events.add(
            CollectedPoint(
                kind=SegmentType.CIRCULAR,
                pose=target,
                via=self._pose('movec', pose_via),
                arc_mode=ArcMode(one_of(mode, 'mode', (0, 1))),
                acceleration=positive(a, 'a'),
                speed=positive(v, 'v'),
                blend=not_negative(r, 'r'),
            )
        )
        self._place.go_to(target)
        yield from self._events.moved()

    def stopj(self, a: Value) -> Steps:
        """Make the last point a stop."""
        yield from self._stop(a)

    def stopl(self, a: Value, aRot: Value = 'a') -> Steps:
        """Make the last point a stop."""
        yield from self._stop(a)

    def set_pos(self, q: Value) -> None:
        """Put the arm at joint positions, which only a simulated robot can do."""
        self._place.turn_to(six(q, 'q'))

    def _stop(self, a: Value) -> Steps:
        positive(a, 'a')
        self._events.take()
        self._events.stop()
        yield from self._events.moved()

    def _joints(
        self, name: str, kind: SegmentType, q: Value, rates: Rates, t: Value, r: Value
    ) -> Steps:
        self._events.take()
        place, blend, time = self._place, not_negative(r, 'r'), not_negative(t, 't')
        joints: Vector6 | None
        if is_pose(q):
            pose: Pose | None = self._pose(name, q)
            assert pose is not None
            joints = place.solution(pose, place.joints()) if place.knows_joints else None
            if joints is not None:
                place.solutions.add(joints)
        else:
            pose, joints = None, self._angles(name, six(q, 'q'))
        length = None
        # place.joints() solves all poses since the last solution, so it is called only if needed.
        if (
            joints is not None
            and place.knows_joints
            and (time > 0.0 or place.is_settled or self._is_here(place.forward(joints, place.tcp)))
        ):
            length = max(abs(a - b) for a, b in zip(joints, place.joints(), strict=True))
        if length is not None and length < SAME_ANGLE and self._events.last is not None:
            self._run.say('a point', 'it is where the one before is')
        else:
            a, v = self._rates(name, rates, length, time, blend, (JOINT_A, JOINT_V))
            self._events.add(
                CollectedPoint(
                    kind=kind,
                    pose=pose if joints is None else None,
                    joints=joints,
                    acceleration=a,
                    speed=v,
                    blend=blend,
                )
            )
        if joints is not None:
            place.turn_to(joints)
        elif pose is not None:
            place.go_to(pose)
        yield from self._events.moved()

    def _line(
        self, name: str, kind: SegmentType, pose: Value, rates: Rates, t: Value, r: Value
    ) -> Steps:
        self._events.take()
        target, blend, time = self._pose(name, pose), not_negative(r, 'r'), not_negative(t, 't')
        if self._is_here(target) and self._events.last is not None:
            self._run.say('a point', 'it is where the one before is')
        else:
            length, unit = None, 1.0
            if self._place.is_known:
                here = self._place.pose
                length = max(here.distance_to(target), here.angle_to(target) / TURN_RATIO)
                if kind is SegmentType.LINEAR and here.distance_to(target) < PURE_TURN:
                    # The rates of a pure turn are in rad; movel turns 4 rad in the time of 1 m.
                    unit = TURN_RATIO
            a, v = self._rates(name, rates, length, time, blend, (TOOL_A, TOOL_V))
            self._events.add(
                CollectedPoint(
                    kind=kind, pose=target, acceleration=unit * a, speed=unit * v, blend=blend
                )
            )
        self._place.go_to(target)
        yield from self._events.moved()

    def _is_here(self, pose: Pose) -> bool:
        """Return whether the tool is known to be at a pose already."""
        here = self._place.pose
        return (
            self._place.is_known
            and here.distance_to(pose) < SAME_POINT
            and here.angle_to(pose) < SAME_TURN
        )

    def _rates(
        self,
        name: str,
        rates: Rates,
        length: float | None,
        time: float,
        blend: float,
        defaults: tuple[float, float],
    ) -> tuple[float, float]:
        """
        Return acceleration and speed; if a time is given, they make the move take that time.

        The robot stretches the trapezoid of `a` and `v` to the time, as recordings of a UR3 show.
        """
        if time == 0.0:
            return positive(rates[0], 'a'), positive(rates[1], 'v')
        given = number(rates[0], 'a'), number(rates[1], 'v')
        a, v = (
            value if value > 0.0 else default
            for value, default in zip(given, defaults, strict=True)
        )
        if length is None:
            self._run.say(
                f't of {name}()', 'where the move begins is not in the file; a and v count'
            )
            return a, v
        last = self._events.last
        if blend > 0.0 or (last is not None and last.blend > 0.0):
            self._run.say(f't of {name}()', 'with a blend the time is kept only roughly')
        shortest = length / v + v / a if length * a > v * v else 2.0 * sqrt(length / a)
        stretch = shortest / time
        return a * stretch * stretch, v * stretch

    def _pose(self, name: str, value: Value) -> Pose:
        """Return the pose of a target that is given as a pose or as joint positions."""
        if not is_pose(value):
            tcp, q = self._place.tcp, self._angles(name, six(value, 'pose'))
            if q not in self._place.solutions:
                if self._place.moves_path:
                    raise RuntimeException(JOINTS_HAVE_NO_FRAME)
                self._run.say('joint positions', self._place.of_arm(tcp))
            return self._place.forward(q, tcp)
        target = pose_argument(value, 'pose')
        farthest = max(target.position, key=abs)
        if abs(farthest) > FAR:
            raise RuntimeException(
                f'{name} leads {farthest:g} m away; lengths are in metres, 0.4 is 400 mm'
            )
        return target

    @staticmethod
    def _angles(name: str, q: Vector6) -> Vector6:
        farthest = max(q, key=abs)
        if abs(farthest) > MAX_ANGLE:
            raise RuntimeException(
                f'{name} leads a joint to {farthest:g} rad; angles are in radians, d2r() converts'
            )
        return q
