# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Judges refusals: a slow planner of the tests' own follows the path and checks the reason.

It samples each line, arc and joint move, follows it with Newton's method, and checks ranges,
singularities and speeds. A refusal by a rule is judged by the same rule, written anew.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from math import inf, sqrt
import re
from typing import Any

from example_goals import stretch_times
from forward_model import pose_matrix, turn_between
from goal_geometry import (
    Arc,
    axis_angle,
    JointLine,
    Kinematics,
    Line,
    rotation,
    straight_curve,
    targets,
)
import numpy as np

from ur_cartesian_driver.kinematics.robot_models import JOINT_NAMES
from ur_cartesian_driver.motion.goal.goal import Goal, Segment, SegmentType

#: Largest distance of samples [m], [rad], and how often it can be halved near a singularity.
STEP, STEP_TURN, HALVINGS = 2e-3, 0.02, 8
#: If a step turns a joint farther than this [rad], it has jumped to another solution.
MAX_JUMP = 0.4
#: Relative distance from a bound within which both verdicts count as right.
NEAR = 0.02
_JOINT = (SegmentType.JOINT, SegmentType.OPTIMIZED_JOINT)
#: Peak speed of a timed move (thirds), and of a line that mostly turns, over its mean speed.
PEAK, PEAK_OF_TURN = 1.5, 2.0


@dataclass(frozen=True, kw_only=True)
class Refused:
    """A refused goal, with the arm and the options for which it was refused."""

    goal: Goal
    q: tuple[float, ...]
    arm: Kinematics
    joint_speeds: tuple[float, ...]
    cycle: float
    #: The parameters of the driver, by name.
    options: Any
    text: str

    @property
    def index(self) -> int:
        """The point that the refusal names."""
        found = re.search(r'(?:points|segments)\[(\d+)\]', self.text)
        return int(found[1]) if found else 0

    def segment(self, i: int) -> Segment:
        return self.goal.segments[i] if self.goal.segments else Segment()

    @property
    def is_spline(self) -> bool:
        return self.goal.execution in (2, 3) or (
            self.goal.execution == 0
            and any(point.time for point in self.goal.waypoints)
            and any(any(p.twist) or any(p.acceleration) for p in self.goal.waypoints[:-1])
        )


@dataclass(frozen=True)
class Piece:
    """A segment as followed by the slow planner: configurations at fractions."""

    curve: Any
    u: np.ndarray
    q: np.ndarray
    #: The reason why the arm cannot follow to the end; empty = it can.
    stopped: str


def follow(refused: Refused, last: int) -> list[Piece]:
    """Follow the path up to the end of a segment, or as far as the arm gets."""
    pieces: list[Piece] = []
    q = np.array(refused.q)
    start = refused.arm.tool(q)[0]
    for i in range(last + 1):
        curve = straight_curve(refused.goal, i, start)
        if curve is None:
            end = _joint_target(refused, i, q)
            if end is None:
                pieces.append(Piece(None, np.zeros(1), q[None], 'nothing is there'))
                return pieces
            curve = JointLine(refused.arm, q, end)
            u = np.linspace(0.0, 1.0, 100)
            piece = Piece(curve, u, curve.joints(u), '')
        else:
            piece = _follow_straight(refused, curve, q)
            blended = i > 0 and refused.segment(i - 1).blend_radius > 0.0
            if blended and _is_singular(refused, q):
                piece = replace(piece, stopped='singular')
        pieces.append(piece)
        if piece.stopped:
            return pieces
        q, start = piece.q[-1], curve.end
    return pieces


def _joint_target(refused: Refused, i: int, q: np.ndarray) -> np.ndarray | None:
    """Return the target of a joint move: the configuration nearest to the arm, or to a posture."""
    posture = refused.goal.waypoints[i].posture
    wanted, weight = q.copy(), np.ones(6)
    for name, value in zip(posture.names, posture.values, strict=True):
        wanted[JOINT_NAMES.index(name)] = value
        weight[JOINT_NAMES.index(name)] = 1e3
    best, best_cost = None, inf
    rng = np.random.default_rng(0)
    for found in refused.arm.all_solutions(targets(refused.goal)[i], rng):
        turned = found + 2.0 * np.pi * np.round((wanted - found) / (2.0 * np.pi))
        for k in range(6):  # turn it into the range
            while turned[k] > refused.arm.high[k] + 1e-6:
                turned[k] -= 2.0 * np.pi
            while turned[k] < refused.arm.low[k] - 1e-6:
                turned[k] += 2.0 * np.pi
        cost = float((weight * np.abs(turned - wanted)).sum())
        if refused.arm.within(turned) and cost < best_cost:
            best, best_cost = turned, cost
    return best


def _follow_straight(refused: Refused, curve: Any, q: np.ndarray) -> Piece:
    arm = refused.arm
    steps = max(8, int(curve.length / STEP) + 1, int(curve.angle / STEP_TURN) + 1)
    done, qs, step = 0.0, [q], 1.0 / steps
    us, halvings = [0.0], 0
    stopped = ''
    while done < 1.0 - 1e-12:
        u = min(1.0, done + step)
        found, arrived = arm.solve(curve.at(u)[0], qs[-1], 25)
        if not arrived[0] or np.abs(found[0] - qs[-1]).max() > MAX_JUMP:
            step, halvings = 0.5 * step, halvings + 1
            if halvings > HALVINGS:
                stopped = 'the arm cannot follow'
                break
            continue
        done, halvings, step = u, max(halvings - 1, 0), min(1.0 / steps, 2.0 * step)
        us.append(u)
        qs.append(found[0])
        if not arm.within(found[0]):
            stopped = 'out of range'
            break
        if _is_singular(refused, found[0]):
            stopped = 'singular'
            break
    return Piece(curve, np.array(us), np.array(qs), stopped)


def _is_singular(refused: Refused, q: np.ndarray) -> bool:
    """
    Return whether a configuration is nearer to a singularity than allowed.

    The axes of calibrated arms do not meet, so some milliradians are a matter of definition.
    """
    options = refused.options
    margins = np.array(
        [
            options.singularity_margin_wrist,
            options.singularity_margin_elbow,
            options.singularity_margin_shoulder,
        ]
    )
    return bool((refused.arm.measures(q[None])[0] < margins * (1.0 + NEAR) + 2e-3).any())


def is_right(refused: Refused) -> tuple[str, str]:
    """Return the kind of a refusal, and the reason why it is wrong; empty = it is about right."""
    for name, pattern, check in RULES:
        if re.search(pattern, refused.text):
            return name, check(refused)
    return 'unknown', 'no rule for this sentence'


def remedied(goal: Goal, index: int, text: str) -> Goal | None:
    """Return a goal that was too fast, with the time that its refusal asks for."""
    if found := re.search(r'give it at least ([\d.]+) s', text):
        before = goal.waypoints[index - 1].time if index else 0.0
        more = float(found[1]) - (goal.waypoints[index].time - before)
        return replace(
            goal,
            waypoints=tuple(
                replace(point, time=point.time + more) if i >= index else point
                for i, point in enumerate(goal.waypoints)
            ),
        )
    if found := re.search(r'multiply all times by ([\d.]+)', text):
        return stretch_times(goal, float(found[1]))
    return None


# -- rules: each returns the reason why the refusal is wrong --------------------------------------


def _distance(refused: Refused) -> str:
    start = refused.arm.tool(np.array(refused.q))[0]
    distance = np.linalg.norm(targets(refused.goal)[0][:3, 3] - start[:3, 3])
    bound = refused.options.max_approach_distance
    return '' if distance > bound * (1.0 - 1e-6) else f'{distance} m is not more than {bound}'


def _curve(refused: Refused, i: int) -> Any:
    """Return the curve of a segment between its corners; a line for joint moves."""
    corners = [refused.arm.tool(np.array(refused.q))[0], *targets(refused.goal)]
    start = corners[i]
    if i > 0:
        before = straight_curve(refused.goal, i - 1, corners[i - 1])
        if isinstance(before, Arc):
            start = before.end
    return straight_curve(refused.goal, i, start) or Line(start, corners[i + 1])


def _blends_overlap(refused: Refused) -> str:
    last = len(refused.goal.waypoints) - 1
    for i in (refused.index, refused.index + 1):
        if i > last:
            continue
        curve = _curve(refused, i)
        before = refused.segment(i - 1).blend_radius if i else 0.0
        after = refused.segment(i).blend_radius if i < last else 0.0
        places = curve.at(np.linspace(0.0, 1.0, 2001))[:, :3, 3]
        inside = [
            np.linalg.norm(places - places[row], axis=1) < radius
            for row, radius in ((0, before), (-1, after))
        ]
        if before + after >= np.linalg.norm(places[-1] - places[0]) * (1.0 - 1e-6):
            return ''
        if (inside[0] | inside[1]).all():
            return ''
    return 'the blends fit'


def _blend_in_a_cycle(refused: Refused) -> str:
    found = re.search(r'at ([\d.e-]+) (m|rad)/s', refused.text)
    assert found is not None
    i, radius = refused.index, refused.segment(refused.index).blend_radius
    speed = float(found[1])
    if refused.segment(i).type not in (SegmentType.PROCESS, SegmentType.CIRCULAR):
        return 'only PROCESS and CIRCULAR leave blends out'
    if radius > speed * refused.cycle * (1.0 + NEAR):
        return f'{radius} m is more than a cycle at {speed}'
    return ''


def _arc(refused: Refused) -> str:
    i = refused.index
    start = refused.arm.tool(np.array(refused.q))[0] if i == 0 else targets(refused.goal)[i - 1]
    if i:
        before = _curve(refused, i - 1)
        start = before.end
    arc = straight_curve(refused.goal, i, start)
    a, b, c = (T[:3, 3] for T in (arc.start, arc.via, arc.target))
    chord = float(np.linalg.norm(c - a))
    height = np.linalg.norm(np.cross(b - a, c - a)) / max(chord, 1e-12)
    if height < 1.1e-5 or chord < 2e-6 or chord > 1000.0:
        return ''
    if not arc.fixed:
        return f'the via is {height} m above its chord'
    # Round the three points to micrometres, and compare the orientations at the end.
    rng, worst = np.random.default_rng(0), 0.0
    for _ in range(300):
        shaken = np.array([arc.start, arc.via, arc.target])
        shaken[:, :3, 3] += rng.choice((-0.5e-6, 0.5e-6), (3, 3))
        other = Arc(shaken[0], shaken[1], shaken[2], True)
        worst = max(worst, float(turn_between(other.end[:3, :3], arc.end[:3, :3])))
    return '' if worst > 0.3 * 0.005 else f'rounding turns the tool by {worst} rad'


def _turn_leads(refused: Refused) -> str:
    curve = _curve(refused, refused.index)
    return '' if curve.angle > curve.length * (1.0 - NEAR) else 'the length leads'


def _ambiguous(refused: Refused) -> str:
    curve = _curve(refused, refused.index)
    return '' if curve.angle > np.pi - 2e-3 else f'it turns by {curve.angle}'


def _duplicate(refused: Refused) -> str:
    curve = _curve(refused, refused.index)
    return '' if curve.length < 2e-6 and curve.angle < 2e-6 else 'the points differ'


def _geometry(refused: Refused) -> str:
    if refused.is_spline:
        return _spline_geometry(refused)
    last = min(refused.index + 1, len(refused.goal.waypoints) - 1)
    pieces = follow(refused, last)
    if pieces[-1].stopped:
        return ''
    if 'posture' in refused.text:
        end = pieces[refused.index].q[-1]
        posture = refused.goal.waypoints[refused.index].posture
        for name, value in zip(posture.names, posture.values, strict=True):
            if abs(end[JOINT_NAMES.index(name)] - value) > 0.009:
                return ''
    return 'the arm can follow'


def _spline_geometry(refused: Refused) -> str:
    """Follow the curve, if all its twists and accelerations are known."""
    found = spline_motion(refused)
    return '' if found is None or found.stopped else 'the arm can follow'


@dataclass(frozen=True)
class SplineMotion:
    """Joints at times along a spline."""

    t: np.ndarray
    q: np.ndarray
    places: np.ndarray
    stopped: str


def spline_motion(refused: Refused) -> SplineMotion | None:
    """Return the motion on a spline; None if the driver chooses twists or accelerations."""
    goal, arm = refused.goal, refused.arm
    base = targets(goal)
    start = arm.tool(np.array(refused.q))[0]
    R = pose_matrix(goal.T_base_frame)[:3, :3]
    twists = np.array([[0.0] * 6, *(p.twist for p in goal.waypoints)])
    accelerations = np.array([[0.0] * 6, *(p.acceleration for p in goal.waypoints)])
    if not (np.isfinite(twists).all() and np.isfinite(accelerations).all()):
        return None
    quintic = bool(np.any(accelerations))
    poses, times = [start, *base], [0.0, *(p.time for p in goal.waypoints)]
    if times[1] == 0.0:
        poses, times, twists, accelerations = poses[1:], times[1:], twists[1:], accelerations[1:]
    q, ts, qs, places = np.array(refused.q), [], [], []
    for k in range(len(times) - 1):
        h = times[k + 1] - times[k]
        a, b = poses[k], poses[k + 1]
        relative = a[:3, :3].T @ b[:3, :3]
        axis, angle = axis_angle(relative)
        phi = axis * angle
        rates = [
            (R @ twists[k + n, :3], R @ accelerations[k + n, :3], R @ twists[k + n, 3:])
            for n in (0, 1)
        ]
        w0 = a[:3, :3].T @ rates[0][2]
        w1 = _inverse_right_jacobian(phi) @ (b[:3, :3].T @ rates[1][2])
        zero = np.zeros(3)
        n = max(40, int(3.0 * np.linalg.norm(b[:3, 3] - a[:3, 3]) / STEP))
        s = np.linspace(0.0, 1.0, n)
        p = _polynomial(
            s * h,
            h,
            a[:3, 3],
            rates[0][0],
            rates[0][1],
            b[:3, 3],
            rates[1][0],
            rates[1][1],
            quintic,
        )
        turn = _polynomial(s * h, h, zero, w0, zero, phi, w1, zero, quintic)
        for i in range(n):
            T = np.eye(4)
            T[:3, 3] = p[i]
            angle = float(np.linalg.norm(turn[i]))
            T[:3, :3] = a[:3, :3] @ _exp(turn[i])
            found, arrived = arm.solve(T, q, 25)
            stopped = ''
            if not arrived[0] or np.abs(found[0] - q).max() > MAX_JUMP:
                stopped = 'the arm cannot follow'
            elif not arm.within(found[0]):
                stopped = 'out of range'
            elif _is_singular(refused, found[0]):
                stopped = 'singular'
            if stopped:
                return SplineMotion(np.array(ts), np.array(qs), np.array(places), stopped)
            q = found[0]
            ts.append(times[k] + s[i] * h)
            qs.append(q)
            places.append(p[i])
    return SplineMotion(np.array(ts), np.array(qs), np.array(places), '')


def _exp(v):
    angle = float(np.linalg.norm(v))
    return rotation(v / angle, angle)[0] if angle > 1e-12 else np.eye(3)


def _inverse_right_jacobian(v):
    angle = float(np.linalg.norm(v))
    x, y, z = v
    K = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    if angle < 1e-6:
        return np.eye(3) + 0.5 * K
    c = 1.0 / angle**2 - (1.0 + np.cos(angle)) / (2.0 * angle * np.sin(angle))
    return np.eye(3) + 0.5 * K + c * K @ K


def _polynomial(t, h, p0, v0, a0, p1, v1, a1, quintic):
    """Return the cubic, or the quintic, with these values at its ends."""
    rows = [[p0, v0, a0], [p1, v1, a1]]
    order = 3 if quintic else 2
    M, y = [], []
    for end, values in ((0.0, rows[0]), (h, rows[1])):
        for d in range(order):
            M.append(
                [
                    0.0 if n < d else float(np.prod(range(n - d + 1, n + 1))) * end ** (n - d)
                    for n in range(2 * order)
                ]
            )
            y.append(values[d])
    c = np.linalg.solve(np.array(M), np.array(y))
    return np.stack([t**n for n in range(2 * order)], axis=1) @ c


def _spline_speed(refused: Refused) -> str:
    """Differentiate the joints along the spline."""
    motion = spline_motion(refused)
    if motion is None or motion.stopped:
        return ''
    options, worst = refused.options, 0.0
    for t, q, p in _runs(motion):
        v, qd = np.gradient(p, t, axis=0), np.gradient(q, t, axis=0)
        a, qdd = np.gradient(v, t, axis=0), np.gradient(qd, t, axis=0)
        if options.max_tool_speed:
            worst = max(worst, np.linalg.norm(v, axis=1).max() / options.max_tool_speed)
        worst = max(
            worst,
            (np.abs(qd) / np.array(refused.joint_speeds)).max(),
            sqrt(np.linalg.norm(a, axis=1).max() / options.max_linear_acceleration),
            sqrt(np.abs(qdd).max() / options.max_joint_acceleration),
        )
    return '' if worst > 0.95 else f'it needs {worst:.3f} of the limits'


def _runs(motion: SplineMotion) -> Iterator[tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """Yield times, joints and places between points, at which accelerations may jump."""
    ends = np.flatnonzero(np.diff(motion.t) <= 0.0) + 1
    for rows in np.split(np.arange(len(motion.t)), ends):
        if len(rows) > 4:
            yield motion.t[rows], motion.q[rows], motion.places[rows]


def shortest_times(refused: Refused, i: int, piece: Piece) -> tuple[float, float]:
    """Return the least time of a segment, with stops, by the driver's profile and by any."""
    options, curve = refused.options, piece.curve
    kind = refused.segment(i).type
    step = np.diff(piece.u)
    keep = step > 1e-9
    rates = np.abs(np.diff(piece.q, axis=0)[keep]) / step[keep, None]
    slowest = float((rates / np.array(refused.joint_speeds)).max())
    if options.max_tool_speed:
        places = refused.arm.tool(piece.q)[:, :3, 3]
        way = np.linalg.norm(np.diff(places, axis=0)[keep], axis=1) / step[keep]
        if curve.length > 1e-6:
            slowest = max(slowest, float(way.max()) / options.max_tool_speed)
    if kind == SegmentType.CIRCULAR and isinstance(curve, Arc):
        fastest = sqrt(options.max_linear_acceleration * curve.radius)
        slowest = max(slowest, curve.length / fastest)
    if kind in _JOINT:
        bound = options.max_joint_acceleration / max(
            float(np.abs(piece.q[-1] - piece.q[0]).max()), 1e-9
        )
    else:
        bound = min(
            options.max_linear_acceleration / max(curve.length, 1e-9),
            options.max_angular_acceleration / max(curve.angle, 1e-9),
        )
        own = refused.segment(i).acceleration
        if own and kind in (SegmentType.PROCESS, SegmentType.CIRCULAR):
            bound = min(bound, own / max(curve.length, curve.angle))
    leads = curve.angle > curve.length and kind in (SegmentType.AUTO, SegmentType.LINEAR)
    peak = PEAK_OF_TURN if leads else PEAK
    by_profile = max(peak * slowest, sqrt(4.5 / bound))
    speed = 1.0 / max(slowest, 1e-9)
    # A short segment never reaches its speed.
    least = 2.0 / sqrt(bound) if speed**2 > bound else slowest + speed / bound
    if kind in (SegmentType.PROCESS, SegmentType.CIRCULAR):
        by_profile = least
    return by_profile, least


def _shortest_time_of_arc(refused: Refused, point: int, i: int, length: float) -> float:
    """
    Return the time of a segment without its blends, at the speed in the blend at a point [s].

    PROCESS passes a blend on an arc that touches both legs where the blend begins and ends, at
    an unchanged speed v. The bound applies to v^2 over the radius of the arc (doc/preflight.md).
    """
    legs = _curve(refused, point), _curve(refused, point + 1)
    arriving, leaving = (
        np.diff(leg.at(np.array(u))[:, :3, 3], axis=0)[0]
        for leg, u in zip(legs, ((0.999, 1.0), (0.0, 0.001)), strict=True)
    )
    cosine = arriving @ leaving / np.linalg.norm(arriving) / np.linalg.norm(leaving)
    arc_radius = refused.segment(point).blend_radius * sqrt((1.0 + cosine) / (1.0 - cosine))
    blends = refused.segment(i).blend_radius + (refused.segment(i - 1).blend_radius if i else 0.0)
    return (length - blends) / sqrt(refused.options.max_linear_acceleration * arc_radius)


def _time(refused: Refused) -> str:
    i = refused.index
    pieces = follow(refused, i)
    if pieces[-1].stopped:
        return ''
    times = [0.0, *(point.time for point in refused.goal.waypoints)]
    time = times[i + 1] - times[i]
    if found := re.search(r'in the blend at point (\d+), an arc', refused.text):
        least = _shortest_time_of_arc(refused, int(found[1]), i, pieces[i].curve.length)
        return '' if time < least * (1.0 + NEAR) else f'the arc needs no more than {least:.3f} s'
    by_profile, least = shortest_times(refused, i, pieces[i])
    # With blends the segment takes no longer.
    if time < by_profile * (1.0 + NEAR):
        return ''
    return f'{time:.3f} s are more than {by_profile:.3f} s ({least:.3f} s at least)'


RULES: tuple[tuple[str, str, Callable[[Refused], str]], ...] = (
    ('approach', 'max_approach_distance', _distance),
    ('blends overlap', 'is too large: the blend', _blends_overlap),
    ('blend within a cycle', 'in one control cycle', _blend_in_a_cycle),
    ('arc', 'defines no arc', _arc),
    ('turn of unknown speed', 'has not been measured', _turn_leads),
    ('half a turn', 'is ambiguous', _ambiguous),
    ('no motion', 'duplicates', _duplicate),
    ('time of a spline', 'gives too little time', _spline_speed),
    ('time', 'gives the segment', _time),
    ('posture', r'\.posture cannot be reached', _geometry),
    ('singularity', 'singularity', _geometry),
    ('joint range', 'outside its range', _geometry),
    ('reach', 'cannot be reached', _geometry),
)
