# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Judge an arm's motion for a goal from outside: RTDE's joints against the tests' own geometry.

Every bound is a promise of the documents, or the resolution of wire and cycle.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from math import isfinite
import re
from typing import Any

from forward_model import pose_matrix
from goal_geometry import Arc, ARM, JointLine, Kinematics, poses_apart, straight_curve, targets
import numpy as np
from plain_clients import RtdeRow

from ur_cartesian_driver.kinematics.robot_models import JOINT_NAMES
from ur_cartesian_driver.motion.goal.execution_modes import ExecutionMode
from ur_cartesian_driver.motion.goal.goal import ArcMode, Goal, SegmentType
from ur_cartesian_driver.motion.plan.plan import Plan
from ur_cartesian_driver.motion.plan.primitive import MoveJ

#: Fraction by which bounds of speeds may be exceeded.
OVER = 0.02
#: A point is reached within this [m], and a turn within this at ARM: the wire has micrometres.
REACH = 5e-6
#: Largest distance from a line or an arc [m], [rad].
PATH, PATH_TURN = 2e-5, 3e-4
#: A move may stop at a point and go on between two packets: bounds of its acceleration, plain and
#: optimized [m/s^2], and of its distance from the point [m].
TURNING, OPTIMIZED_TURNING = 5.0, 12.0
NEARBY = 0.002
#: Largest angle to which a joint turns [rad].
FULL_TURN = 6.2832
#: Largest orientation error at the end of an arc with FIXED orientation [rad].
FIXED_TURN = 0.006
#: Spline: the tolerance of its joints [m].
SPLINE = 5e-5
#: SERVO: its lag [s], its largest distance from the path until the goal ends [m], and at its end.
SERVO_LAG, SERVO_PATH, SERVO_END = 0.2, 2.1e-3, 3e-4
#: Times are kept within this number of cycles and this fraction ...
CYCLES, SHARE = 3.0, 0.002
#: ... a spline that brakes hard at its end needs more cycles to come to rest ...
SPLINE_CYCLES = 8.0
#: ... and the first motion of a program loses 80 ms, recorded on real arms [s].
START_RAMP = 0.09
#: A blended point is passed in the middle of its blend, which is not quite the place nearest to
#: it: times may be off by this fraction of the time in the blend.
BLEND_SHARE = 0.25
#: A SERVO goal ends if its acceleration takes servoj more than max_plan_deviation off its path.
#: The deviation is lookahead^2 / 2 - 1 / gain times the acceleration (doc/servo.md). Such ends are
#: counted by this name.
SERVO_DEVIATES = 'known, SERVO ends where it accelerates too much for servoj'
SERVO_DEVIATION = 0.0008
KNOWN = (SERVO_DEVIATES,)
#: Largest distance of the resting arm from its target [rad]: static errors, noise, resolution.
STATIC = 1e-3
#: Outputs switch within this number of cycles of the tool's way, and this distance [m].
OUTPUT_CYCLES, OUTPUT_PLACE = 4, 1e-3
_OPTIMIZED = (SegmentType.OPTIMIZED_LINEAR, SegmentType.OPTIMIZED_JOINT)
_JOINT = (SegmentType.JOINT, SegmentType.OPTIMIZED_JOINT)


@dataclass(frozen=True, kw_only=True)
class Promise:
    """The driver's promises for an accepted goal, in numbers."""

    #: The mode of execution.
    execution: ExecutionMode
    #: Time of the whole motion [s], and the time at which the tool is at each point [s].
    duration: float
    point_times: dict[int, float]
    #: Joint positions at the end [rad].
    joints: tuple[float, ...]
    #: Whether the goal's own times were given up (on_too_fast: slow).
    slowed: bool
    #: The points that are passed before their time, as the report says.
    early: frozenset[int]
    #: By point: lines that became joint motions.
    joint_moves: frozenset[int]
    radii: tuple[float, ...]


def promise_of(made: Plan) -> Promise:
    """Return the promises of a plan."""
    goal, radii = made.goal, [0.0] * len(made.goal.waypoints)
    times: dict[int, float] = {}
    for point, at in zip(made.reference.point.tolist(), made.reference.time.tolist(), strict=True):
        times[point] = at
    for segment in made.segments:
        radii[segment.waypoint] = getattr(segment.primitive, 'blend_radius', 0.0)
    joint_moves = frozenset(
        segment.waypoint
        for segment in made.segments
        if isinstance(segment.primitive, MoveJ)
        and goal.segments
        and goal.segments[segment.waypoint].type != SegmentType.JOINT
    )
    return Promise(
        execution=made.execution,
        duration=made.duration,
        point_times=times,
        joints=made.segments[-1].joints if made.segments else made.start,
        slowed=any('instead of' in line or 'stretched' in line for line in made.remarks),
        early=frozenset(
            int(found[1])
            for line in made.remarks
            if (found := re.match(r'point (\d+): .*before its time', line))
        ),
        joint_moves=joint_moves,
        radii=tuple(radii),
    )


@dataclass(frozen=True, kw_only=True)
class Run:
    """A goal, the driver's promise, and the record of the motion."""

    goal: Goal
    promise: Promise
    arm: Kinematics
    joint_speeds: tuple[float, ...]
    max_tool_speed: float
    cycle: float
    #: Joints of the arm before [rad]; time on the controller's clock when the goal was sent [s].
    q: tuple[float, ...]
    sent: float
    rows: list[RtdeRow]
    #: Whether the path is the first one of its program, which sets out slowly.
    is_first: bool
    #: Extra time for all events, if time is real and the computer busy [s].
    late: float = 0.0
    succeeded: bool
    outcome: str


@dataclass
class _Passage:
    """The passage of the tool at a point: rows of arrival and departure."""

    arrive: int
    depart: int
    q: np.ndarray
    #: Whether one of these rows is at the point; if not, the passage was between two packets.
    seen: bool


@dataclass
class Judge:
    """The rows of a run as arrays, and their faults."""

    run: Run
    wrong: list[tuple[str, str]] = field(default_factory=list)

    def __post_init__(self) -> None:
        rows = self.run.rows
        self.t = np.array([row.time for row in rows])
        self.q = np.array([row.target_q for row in rows])
        self.actual = np.array([row.q for row in rows])
        self.tool = self.run.arm.tool(self.q)
        self.p = self.tool[:, :3, 3]
        moved = np.abs(np.diff(self.q, axis=0)).max(axis=1) > 1e-10
        self.begin = int(np.argmax(moved)) if moved.any() else 0
        self.end = len(moved) - int(np.argmax(moved[::-1])) if moved.any() else 0
        self.moves = bool(moved.any())
        goal = self.run.goal
        self.targets = targets(goal)
        self.is_timed = any(point.time for point in goal.waypoints)
        # If the first point is at the arm's place, it does not show the start.
        start = self.run.arm.tool(np.array(self.run.q))[0]
        distance, turn = poses_apart(start, self.targets[0])
        self.start = start
        # An imperfect arm stands beside its target, so its way to the first point differs.
        aside, _ = poses_apart(self.run.arm.tool(self.actual[0])[0], start)
        first = self.run.promise.point_times.get(0, 0.0)
        self.more = float(aside / max(distance, aside, 1e-9)) * first
        self.waits = bool(distance + ARM * turn < 2e-5)
        self.zero = self.run.sent if self.waits else self.t[self.begin]

    def _servo_deviation(self) -> float:
        """Return the deviation of servoj by the acceleration over 50 ms, at most [m]."""
        n = max(1, round(0.05 / self.run.cycle))
        if len(self.p) <= 2 * n:
            return 0.0
        bend = self.p[2 * n :] - 2.0 * self.p[n:-n] + self.p[: -2 * n]
        peak = float(np.linalg.norm(bend, axis=1).max()) / (n * self.run.cycle) ** 2
        return 2.0 * SERVO_DEVIATION * peak  # jumps of the acceleration are smoothed here

    def _servo_deviates(self) -> bool:
        """Return whether an acceleration explains the end of a SERVO goal."""
        found = re.search(r'left the plan by ([\d.]+) m', self.run.outcome)
        is_servo = self.run.promise.execution == ExecutionMode.SERVO
        return bool(is_servo and found and self._servo_deviation() > float(found[1]))

    def say(self, kind: str, text: str) -> None:
        self.wrong.append((kind, text))

    def judge(self) -> list[tuple[str, str]]:
        """Return the faults: a kind and a sentence for each."""
        run = self.run
        self._speeds()
        if not run.succeeded:
            kind = 'not successful'
            if self._servo_deviates():
                kind = SERVO_DEVIATES
            self.say(kind, run.outcome)
            return self.wrong
        if not self.moves:
            distance, turn = poses_apart(self.tool[-1], self.targets[-1])
            if distance + ARM * turn > 2 * REACH:
                self.say('end', f'nothing moves, and the end is {1e3 * distance:.4f} mm away')
            return self.wrong
        self._end()
        if run.promise.execution in (ExecutionMode.SPLINE, ExecutionMode.SERVO):
            self._spline()
            self._outputs(len(run.goal.waypoints))
            if run.promise.execution == ExecutionMode.SPLINE:
                self._duration()
        else:
            passages = self._passages()
            self._paths(passages)
            self._times(passages)
            self._outputs(len(passages))
        return self.wrong

    # -- limits ----------------------------------------------------------------------------------

    def _speeds(self) -> None:
        run, dt = self.run, np.diff(self.t)
        speed = np.linalg.norm(np.diff(self.p, axis=0), axis=1) / dt
        self.speed = np.concatenate([speed, [0.0]])
        bound = run.max_tool_speed
        if bound > 0.0 and speed.max() > bound * (1.0 + OVER):
            at = int(np.argmax(speed))
            self.say(
                'tool speed',
                f'{speed[at]:.4f} m/s at {self.t[at] - self.zero:.3f} s, {bound:g} allowed',
            )
        # The measured speed, over 0.1 s, so that noise counts little.
        n = max(1, round(0.1 / run.cycle))
        if bound > 0.0 and len(self.t) > n:
            p = run.arm.tool(self.actual)[:, :3, 3]
            measured = np.linalg.norm(p[n:] - p[:-n], axis=1) / (self.t[n:] - self.t[:-n])
            if measured.max() > bound * (1.0 + OVER) + 0.005:
                self.say('measured speed', f'{measured.max():.4f} m/s, {bound:g} allowed')
        joints = np.abs(np.diff(self.q, axis=0)) / dt[:, None]
        share = joints / np.array(run.joint_speeds)
        if share.max() > 1.0 + OVER:
            row, k = np.unravel_index(np.argmax(share), share.shape)
            self.say(
                'joint speed',
                f'{JOINT_NAMES[k]} {joints[row, k]:.3f} rad/s at '
                f'{self.t[row] - self.zero:.3f} s, {run.joint_speeds[k]:.3f} allowed',
            )
        outside = ~run.arm.within(self.q, 1e-5)
        if outside.any():
            self.say('joint range', f'{self.q[int(np.argmax(outside))].round(4).tolist()}')

    def _end(self) -> None:
        goal, last = self.run.goal, len(self.targets) - 1
        servo = self.run.promise.execution == ExecutionMode.SERVO
        spline = self.run.promise.execution == ExecutionMode.SPLINE
        bound = SERVO_END if servo else SPLINE if spline else 2.0 * REACH
        distance, turn = poses_apart(self.tool[-1], self.targets[-1])
        turn_bound = bound / ARM
        if goal.segments and goal.segments[last].arc_mode == ArcMode.FIXED:
            turn, turn_bound = 0.0, FIXED_TURN  # judged with its path
        if distance > bound or turn > turn_bound:
            self.say('end', f'{1e3 * distance:.4f} mm and {turn:.5f} rad off')
        off = float(np.abs(self.actual[-1] - self.q[-1]).max())
        if off > STATIC:
            self.say('rest', f'a joint rests {off:.5f} rad beside its target')
        off = float(np.abs(self.q[-1] - np.array(self.run.promise.joints)).max())
        if off > 1e-3 + (SERVO_END if servo else 0.0):
            self.say('promised joints', f'{off:.5f} rad off')
        posture = goal.waypoints[last].posture
        if goal.segments and goal.segments[last].arc_mode == ArcMode.FIXED:
            return  # such an arc does not end at the pose of the point, unless by chance
        if max(map(abs, posture.values), default=0.0) > FULL_TURN:
            return  # no such solution: another one is the nearest
        for name, value in zip(posture.names, posture.values, strict=True):
            if abs(self.q[-1][JOINT_NAMES.index(name)] - value) > 0.01:
                self.say('posture', f'{name} {self.q[-1][JOINT_NAMES.index(name)]:.3f}')

    # -- times -----------------------------------------------------------------------------------

    def _slack(self, time: float) -> float:
        run = self.run
        is_spline = run.promise.execution == ExecutionMode.SPLINE
        cycles = SPLINE_CYCLES if is_spline else CYCLES
        slack = cycles * run.cycle + SHARE * time + (START_RAMP if run.is_first else 0.0)
        slack += run.late + self.more
        if self.waits:  # an arm may stand beside its target
            slack += 3.0 * run.cycle + 0.05
        return slack

    def _has_optimized(self, before: int | None = None) -> bool:
        return any(segment.type in _OPTIMIZED for segment in self.run.goal.segments[:before])

    def _duration(self) -> None:
        run = self.run
        took = float(self.t[self.end] - self.zero)
        if self._has_optimized():
            return
        wanted = {'promised': run.promise.duration}
        if self.is_timed and not run.promise.slowed:
            wanted['asked for'] = run.goal.waypoints[-1].time
        for name, time in wanted.items():
            if abs(took - time) > self._slack(time):
                self.say(
                    f'duration {name}',
                    f'{took:.3f} s, {time:.3f} s {name}',
                )

    def _times_in_blends(self, passages: list[_Passage]) -> list[float]:
        """Return the times that the tool spends within the blend radii of the points [s]."""
        times = []
        for passage, target, radius in zip(
            passages, self.targets, self.run.promise.radii, strict=False
        ):
            far = np.linalg.norm(self.p - target[:3, 3], axis=1) > radius
            before = np.flatnonzero(far[: passage.arrive])
            after = np.flatnonzero(far[passage.arrive :])
            if radius > 0.0 and len(before) and len(after):
                times.append(float(self.t[passage.arrive + after[0]] - self.t[before[-1]]))
            else:
                times.append(0.0)
        return times

    def _passages(self) -> list[_Passage]:
        found: list[_Passage] = []
        row = self.begin if not self.waits else 0
        last = len(self.targets) - 1
        for i, target in enumerate(self.targets):
            radius = self.run.promise.radii[i]
            fixed = bool(
                self.run.goal.segments and self.run.goal.segments[i].arc_mode == ArcMode.FIXED
            )
            distance, turn = poses_apart(self.tool[row:], target)
            d = distance if radius > 0.0 or fixed else distance + ARM * turn
            reach = 2.0 * REACH + radius
            if radius <= 0.0:
                reach += self._between_packets(i, row, d)
            least = np.minimum.accumulate(d)
            passed = np.flatnonzero((least <= reach) & (d > least + 1.5e-6))
            if i == last or not len(passed):
                if least[-1] > reach:
                    self.say(
                        'missed point', f'{i}: {1e3 * least[-1]:.4f} mm, {1e3 * radius:.3f} blend'
                    )
                    return found
                passed = np.array([len(d) - 1])
            best = least[passed[0]]
            near = np.flatnonzero(d[: passed[0] + 1] <= best + 1e-6)
            arrive, depart = row + int(near[0]), row + int(near[-1])
            q, _ = self.run.arm.solve(target, self.q[arrive])
            seen = bool(best <= 2.0 * REACH + radius)
            found.append(_Passage(arrive, depart, self.q[arrive] if fixed else q[0], seen))
            row = arrive if radius > 0.0 else depart
        return found

    def _between_packets(self, i: int, row: int, d: np.ndarray) -> float:
        """Return the largest distance of the nearest packets from a point with a stop [m]."""
        near = d < NEARBY
        gaps = np.diff(self.t[row:])[near[1:] & near[:-1]]
        braking = OPTIMIZED_TURNING if self._has_optimized(i + 2) else TURNING
        return float(0.5 * braking * (0.5 * gaps.max(initial=0.0)) ** 2)

    def _times(self, passages: list[_Passage]) -> None:
        run, in_blends = self.run, self._times_in_blends(passages)
        self._duration()
        for i, passage in enumerate(passages[:-1]):
            blended = run.promise.radii[i] > 0.0
            if self._has_optimized(i + 1 + blended):
                return
            arrive = float(self.t[passage.arrive] - self.zero)
            depart = float(self.t[passage.depart] - self.zero)
            wanted = {'promised': run.promise.point_times.get(i)}
            if self.is_timed and not run.promise.slowed and i not in run.promise.early:
                wanted['asked for'] = run.goal.waypoints[i].time
            for name, time in wanted.items():
                if time is None:
                    continue
                slack = self._slack(time) + BLEND_SHARE * in_blends[i]
                if arrive > time + slack or depart < time - slack:
                    self.say(
                        f'time {name}',
                        f'point {i}: {arrive:.3f} to {depart:.3f} s, {time:.3f} s {name}'
                        f', {in_blends[i]:.3f} s in its blend',
                    )

    # -- paths -----------------------------------------------------------------------------------

    def _paths(self, passages: list[_Passage]) -> None:
        goal, start, q = self.run.goal, self.start, np.array(self.run.q)
        row, radius_before, turn_before = self.begin, 0.0, 0.0
        for i, passage in enumerate(passages):
            kind = goal.segments[i].type if goal.segments else SegmentType.LINEAR
            radius = self.run.promise.radii[i]
            is_joint = kind in _JOINT or i in self.run.promise.joint_moves
            curve: Any = (
                JointLine(self.run.arm, q, passage.q)
                if is_joint
                else straight_curve(goal, i, start)
            )
            poses = self.tool[row : passage.depart + passage.seen]
            outside = np.ones(len(poses), dtype=bool)
            for point, size in ((start, radius_before), (self.targets[i], radius)):
                if size > 0.0:
                    apart = np.linalg.norm(poses[:, :3, 3] - point[:3, 3], axis=1)
                    outside &= apart > size + PATH
            if outside.any():
                self._path(i, curve, row + np.flatnonzero(outside), turn_before)
            start = curve.end if isinstance(curve, Arc) else self.targets[i]
            turn_before = FIXED_TURN if isinstance(curve, Arc) and curve.fixed else 0.0
            row, radius_before, q = passage.arrive + (not passage.seen), radius, passage.q

    def _path(self, i: int, curve: Any, rows: np.ndarray, turn_before: float) -> None:
        """
        Compare rows with the path to a point.

        :param turn_before: largest error of the orientation at the beginning [rad].
        """
        poses = self.tool[rows]
        bound, turn_bound = PATH, PATH_TURN + turn_before
        if isinstance(curve, JointLine):
            way = curve.q_end - curve.q_start
            u = np.clip((self.q[rows] - curve.q_start) @ way / max(way @ way, 1e-18), 0.0, 1.0)
            bound, turn_bound = 2e-4, 1e-3
        else:
            u = curve.fractions(poses)
            if isinstance(curve, Arc):
                near = min(
                    np.linalg.norm(curve.via[:3, 3] - T[:3, 3])
                    for T in (curve.start, curve.target)
                )
                bound += 5e-6 * curve.length / near
                turn_bound = FIXED_TURN if curve.fixed else turn_bound
            turn_bound += curve.angle * 3e-6 / max(curve.length, 3e-6)
        distance, turn = poses_apart(poses, curve.at(u))
        if distance.max() > bound or turn.max() > turn_bound:
            self.say(
                'path',
                f'to point {i} ({type(curve).__name__}, {1e3 * curve.length:.2f} mm, '
                f'{curve.angle:.4f} rad): {1e3 * distance.max():.4f} mm and {turn.max():.5f} rad '
                'off',
            )

    def _spline(self) -> None:
        run, goal = self.run, self.run.goal
        if run.promise.slowed:
            return
        if run.promise.execution == ExecutionMode.SERVO:
            self._servo()
            return
        # Its beginning is known to a cycle: the time that fits all points best counts.
        times = np.array([point.time for point in goal.waypoints])
        shifts = np.arange(-2.0, 2.01, 0.25) * run.cycle
        if self.waits:
            shifts = np.arange(-0.02, 0.04, 0.25 * run.cycle)
        worst = None
        for shift in shifts:
            at = np.minimum(self.zero + shift + times, self.t[-1])
            q = np.stack([_interpolate(at, self.t, self.q[:, k]) for k in range(6)], axis=1)
            distance, turn = poses_apart(run.arm.tool(q), np.array(self.targets))
            size = distance + ARM * turn
            if worst is None or size.max() < worst[0] - 1e-6:
                worst = size.max(), int(np.argmax(size)), distance, turn, shift
        assert worst is not None
        _, i, distance, turn, shift = worst
        speed = max(float(np.linalg.norm(np.nan_to_num(p.twist[:3]))) for p in goal.waypoints)
        rate = max(float(np.linalg.norm(np.nan_to_num(p.twist[3:]))) for p in goal.waypoints)
        bound = SPLINE + 1e-5 + 0.25 * run.cycle * speed
        turn_bound = (SPLINE + 1e-5) / ARM + 0.25 * run.cycle * rate
        if distance[i] > bound or turn[i] > turn_bound:
            self.say(
                'spline point',
                f'{i}: {1e3 * distance[i]:.4f} mm and {turn[i]:.5f} rad off at its time'
                f' (+ {1e3 * shift:.1f} ms)',
            )
        found = self._cubic()
        if found is None:
            return
        # It begins at the measured place of the arm, which may stand beside its target.
        measured = run.arm.tool(self.actual[:1])[0]
        aside, _ = poses_apart(measured, self.start)
        off = self._beside(found)
        if off > SPLINE + 1e-5 + float(aside):
            self.say('spline path', f'{1e3 * off:.4f} mm off')

    def _beside(self, cubic: tuple[np.ndarray, np.ndarray, np.ndarray]) -> float:
        """Return the tool's largest distance from a cubic [m], by chords of its samples."""
        places = _hermite(np.linspace(0.0, cubic[0][-1], 3000), *cubic)
        a, way = places[:-1], np.diff(places, axis=0)
        size = np.maximum((way**2).sum(axis=1), 1e-30)
        off = 0.0
        for p in self.p[self.begin : self.end + 1]:
            u = np.clip(((p - a) * way).sum(axis=1) / size, 0.0, 1.0)
            off = max(off, float(np.linalg.norm(a + u[:, None] * way - p, axis=1).min()))
        return off

    def _cubic(self) -> tuple[np.ndarray, np.ndarray, np.ndarray] | None:
        """Return times, positions and velocities of a spline; None unless it is a known cubic."""
        goal = self.run.goal
        if any(any(point.acceleration) for point in goal.waypoints) or not all(
            isfinite(value) for point in goal.waypoints for value in point.twist
        ):
            return None
        R = pose_matrix(goal.T_base_frame)[:3, :3]
        places = np.array([self.start[:3, 3], *(T[:3, 3] for T in self.targets)])
        twists = np.array([[0.0] * 3, *(R @ np.array(p.twist[:3]) for p in goal.waypoints)])
        knots = np.array([0.0, *(point.time for point in goal.waypoints)])
        first = int(knots[1] == 0.0)
        return knots[first:], places[first:], twists[first:]

    def _servo(self) -> None:
        """Check that the tool follows the spline, and passes each point within the lag."""
        goal = self.run.goal
        for i, (point, target) in enumerate(zip(goal.waypoints, self.targets, strict=True)):
            at = self.t - self.zero - point.time
            rows = np.flatnonzero(
                (at >= -2.0 * self.run.cycle) & (at <= SERVO_LAG + 10.0 * self.run.late)
            )
            if not len(rows):
                continue
            distance, turn = poses_apart(self.tool[rows], target)
            # If the arm turns back at a point, servoj does so before the point.
            bound = max(SERVO_PATH, self._servo_deviation())
            if distance.min() > bound or turn.min() > bound / ARM:
                self.say(
                    'servo point', f'{i}: {1e3 * distance.min():.4f} mm, {turn.min():.5f} rad'
                )
        found = self._cubic()
        if found is not None:
            off = self._beside(found)
            if off > SERVO_PATH:
                self.say('servo path', f'{1e3 * off:.4f} mm off')

    def _outputs(self, reached: int) -> None:
        is_servo = self.run.promise.execution == ExecutionMode.SERVO
        place = max(SERVO_PATH, self._servo_deviation()) if is_servo else OUTPUT_PLACE
        goal, outputs = self.run.goal, np.array([row.digital_outputs for row in self.run.rows])
        for command in goal.io_commands:
            if sum(other.pin == command.pin for other in goal.io_commands) > 1:
                continue
            if command.waypoint >= reached:
                continue
            on = (outputs >> command.pin) & 1
            if on[-1] != command.value:
                self.say('output', f'{command.pin} is not {command.value:g} at the end')
            changed = np.flatnonzero(np.diff(on))
            if not len(changed):
                continue
            row, radius = int(changed[0]), self.run.promise.radii[command.waypoint]
            distance, _ = poses_apart(self.tool[row], self.targets[command.waypoint])
            way = (
                OUTPUT_CYCLES * self.run.cycle * float(self.speed[max(row - 3, 0) : row + 1].max())
            )
            if distance > radius + way + place:
                self.say('output', f'{command.pin} switches {1e3 * distance:.3f} mm off its point')


def _interpolate(at, t, x):
    """Return values at times, by a cubic through the four samples around each time."""
    i = np.clip(np.searchsorted(t, at) - 2, 0, max(len(t) - 4, 0))
    result = np.zeros(len(at))
    for a in range(min(4, len(t))):
        weight = np.ones(len(at))
        for b in range(min(4, len(t))):
            if a != b:
                weight *= (at - t[i + b]) / (t[i + a] - t[i + b])
        result += weight * x[i + a]
    return result


def _hermite(at, knots, places, twists):
    at = np.clip(at, knots[0], knots[-1])
    k = np.clip(np.searchsorted(knots, at, side='right') - 1, 0, len(knots) - 2)
    h = (knots[k + 1] - knots[k])[:, None]
    s = ((at - knots[k])[:, None]) / h
    return (
        (2 * s**3 - 3 * s**2 + 1) * places[k]
        + (s**3 - 2 * s**2 + s) * h * twists[k]
        + (-2 * s**3 + 3 * s**2) * places[k + 1]
        + (s**3 - s**2) * h * twists[k + 1]
    )


def judge(run: Run) -> Iterator[tuple[str, str]]:
    """Yield the faults of a run: a kind and a sentence for each."""
    yield from Judge(run).judge()
