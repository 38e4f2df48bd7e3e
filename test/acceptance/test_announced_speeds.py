# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Wherever the tool is slower than asked, the plan has said so, at its place.

Random paths of lines, PROCESS motions and splines run in virtual time through the robot loop and
its robot program; RTDE records the joints. Speeds and places come from a kinematics of the tests'
own, what was asked for from the goal. ``ANNOUNCED_SPEEDS`` is the number of paths.
"""

from collections import Counter
import os

from goal_geometry import Kinematics
import numpy as np
from plain_clients import RtdeRecorder
import pytest
from robot_cell import RTDE, run_cell
from virtual_network import HOST

from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.kinematics.robot_models import robot_model
from ur_cartesian_driver.motion.errors import GoalRefused
from ur_cartesian_driver.motion.geometry.pose import IDENTITY, multiply, Pose
from ur_cartesian_driver.motion.geometry.pose import quaternion_from_rotation_vector as rotated
from ur_cartesian_driver.motion.goal.execution_modes import ExecutionMode
from ur_cartesian_driver.motion.goal.goal import Goal, Segment, SegmentType, Waypoint
from ur_cartesian_driver.motion.plan.slow_stretch import SlowCause
from ur_cartesian_driver.planning import plan, PlanningOptions

pytestmark = [pytest.mark.acceptance, pytest.mark.slow]

#: Of an e-Series: the robot program follows splines from cycle to cycle [s].
CYCLE = 0.002
PATHS = int(os.environ.get('ANNOUNCED_SPEEDS', '6'))
SEED = int(os.environ.get('ANNOUNCED_SPEEDS_SEED', '1'))
ARM = Arm(robot_model('ur5e'))
OPTIONS = PlanningOptions(max_tool_speed=1.0, on_too_fast='slow', self_collision='off')
TOOL = Kinematics(ARM.geometry, ARM.model.position_limits, IDENTITY)
BENT, STRETCHED = (0.2, -1.4, 1.6, -1.7, -1.5, 0.3), (0.2, -1.1, 0.45, -0.9, -1.5, 0.3)
#: A motion below this fraction of the requested speed is slow; plans announce it from 2 % on.
SLOWER = 0.98
#: Places are compared to so many cycles, and to this length [m].
CYCLES, LENGTH = 2.0, 0.0005
#: So well the robot program keeps the speed of a spline from cycle to cycle [m/s].
SPEED = 2e-4
LINES, PROCESS, SPLINE = 'lines', 'PROCESS', 'splines'


def random_goal(rng, family):
    """Return where the arm stands, and a path that does something to its speed."""
    q = STRETCHED if rng.random() < 0.3 else BENT
    start = ARM.forward(q)
    speed = float(rng.uniform(0.03, 0.3))
    size = float(rng.choice((0.01, 0.03, 0.08)))
    turn = 0.0 if family == PROCESS else float(rng.choice((0.0, 0.0, 0.2, 1.5)))
    place, turned = np.array(start.position), start.quaternion
    ways, poses = [], []
    for _ in range(rng.integers(2, 7)):
        way = rng.normal(size=3)
        way *= size * rng.uniform(0.5, 1.5) / np.linalg.norm(way)
        if ways and family != SPLINE and rng.random() < 0.15:
            way = -ways[-1] * rng.uniform(0.3, 0.9)
        ways.append(way)
        place = place + way
        turned = multiply(rotated(tuple((turn * rng.normal(size=3) / 3).tolist())), turned)
        poses.append(Pose(tuple(place.tolist()), turned))
    lengths = [float(np.linalg.norm(way)) for way in ways]
    times = np.cumsum([max(d / speed, 0.3) * rng.uniform(0.8, 2.0) for d in lengths])
    if family == SPLINE:
        return q, spline_goal(rng, poses, ways, times)
    kind = SegmentType.PROCESS if family == PROCESS else SegmentType.LINEAR
    timed = rng.random() < 0.3 and turn == 0.0
    segments = []
    for i in range(len(lengths)):
        gap = min(lengths[i : i + 2])
        # The robot goes round no turn of 180 degrees.
        reverses = (
            i + 1 < len(ways) and ways[i] @ ways[i + 1] < -0.95 * lengths[i] * lengths[i + 1]
        )
        # PROCESS turns no corner that is smaller than a cycle; a time may need more speed.
        least = 4.0 * CYCLE * speed
        radius = rng.uniform(0.05, 0.45) * gap if rng.random() < 0.7 else 0.0
        segments.append(
            Segment(
                type=kind,
                blend_radius=float(radius) if radius > least and not reverses else 0.0,
                velocity=0.0 if timed else speed * float(rng.uniform(0.5, 1.0)),
                acceleration=0.0 if timed or rng.random() < 0.5 else float(rng.uniform(0.3, 3.0)),
            )
        )
        times[i:] += 2.0 * speed / 1.2 if timed else 0.0
    return q, Goal(
        waypoints=tuple(
            Waypoint(pose=pose, time=float(time) if timed else 0.0)
            for pose, time in zip(poses, times, strict=True)
        ),
        segments=tuple(segments),
    )


def spline_goal(rng, poses, ways, times):
    """Return a spline with twists of its own, or chosen ones."""
    durations, points = np.diff(times, prepend=0.0), []
    chosen = rng.random() < 0.4
    for i, pose in enumerate(poses):
        twist = (0.0,) * 6
        if i + 1 < len(poses):
            v = (ways[i] + ways[i + 1]) / (durations[i] + durations[i + 1])
            v *= 0.0 if rng.random() < 0.15 else rng.uniform(0.5, 1.2)
            twist = (np.nan,) * 6 if chosen else (*v.tolist(), 0.0, 0.0, 0.0)
        points.append(Waypoint(pose=pose, time=round(float(times[i]), 3), twist=twist))
    return Goal(waypoints=tuple(points), execution=ExecutionMode.SPLINE)


class Readings:
    """Place and speed of the tool in each packet, and the speed that was planned."""

    def __init__(self, rows, goal, start):
        q, qd = np.array([row.target_q for row in rows]), np.array([row.target_qd for row in rows])
        poses, jacobians = TOOL.jacobian(q)
        self.goal, self.times = goal, np.array([row.time for row in rows])
        self.x = poses[:, :3, 3]
        self.v = np.einsum('nij,nj->ni', jacobians, qd)[:, :3]
        self.speeds = np.linalg.norm(self.v, axis=1)
        self.corners = np.array([start, *(point.pose.position for point in goal.waypoints)])
        self.ways = np.diff(self.corners, axis=0)
        self.lengths = np.linalg.norm(self.ways, axis=1)
        if goal.execution is ExecutionMode.SPLINE:
            self._by_time()
        else:
            self._by_place()
        moves = np.flatnonzero(np.abs(qd).max(axis=1) > 1e-6)
        self.moving = np.zeros(len(rows), dtype=bool)
        self.moving[moves[0] : moves[-1] + 1] = True

    def _by_time(self):
        """Between its points a spline has the time as its place; all may be later than asked."""
        moves = np.flatnonzero(self.speeds > 1e-7)
        begin, end = self.times[moves[0]] - CYCLE, self.times[moves[-1]]
        asked = np.array([0.0, *(point.time for point in self.goal.waypoints)])
        ends = begin + asked * (end - begin) / asked[-1]
        for k in range(1, len(ends) - 1):  # some cycles later, or earlier
            near = np.flatnonzero(np.abs(self.times - ends[k]) < 0.03)
            away = np.linalg.norm(self.x[near] - self.corners[k], axis=1)
            ends[k] = self.times[near[np.argmin(away)]]
        t = np.clip(self.times, begin, end - 1e-9)
        segment = np.clip(np.searchsorted(ends, t, side='right') - 1, 0, len(ends) - 2)
        self.at = segment + (t - ends[segment]) / np.diff(ends)[segment]
        self.margin = CYCLES * CYCLE / np.diff(ends)[segment]
        way = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(self.x, axis=0), axis=1))])
        mean = np.diff(np.interp(ends, self.times, way)) / np.diff(asked)
        mean *= 1.0 - CYCLE / np.diff(asked)  # so well are the times of points known
        twists = np.linalg.norm([point.twist[:3] for point in self.goal.waypoints], axis=1)
        twists = np.where(twists > 0.0, twists, np.nan)  # 0 and NaN ask for nothing
        begin_speeds = np.fmin(mean, np.append(np.nan, twists[:-1]))[segment]
        u = self.at - segment
        self.asked = begin_speeds + u * (np.fmin(mean, twists)[segment] - begin_speeds)

    def _by_place(self):
        """Assign packets to segments, in their order, so that places and directions fit."""
        n, directions = len(self.lengths), self.ways / self.lengths[:, None]
        away = self.x[:, None] - self.corners[None, :-1]
        along = np.einsum('nki,ki->nk', away, directions)
        u = np.clip(along / self.lengths, 0.0, 1.0)
        off = np.linalg.norm(away - (u * self.lengths)[:, :, None] * directions, axis=2)
        back = np.maximum(-np.einsum('ni,ki->nk', self.v, directions), 0.0)
        cost = np.cumsum(off + back, axis=0)
        best = cost[:, 0]
        chosen = np.zeros((n, len(best)), dtype=int)
        for k in range(1, n):
            # Segment k begins where it is cheapest to have left those before it.
            left = np.concatenate([[0.0], best[:-1] - cost[:-1, k]])
            least = np.minimum.accumulate(left)
            chosen[k] = np.maximum.accumulate(np.where(left == least, np.arange(len(left)), 0))
            best = cost[:, k] + least
        segment, row = np.zeros(len(best), dtype=int), len(best)
        for k in range(n - 1, -1, -1):
            first = chosen[k][row - 1] if k and row else 0
            segment[first:row] = k
            row = first
        rows = np.arange(len(segment))
        self.at = segment + u[rows, segment]
        asked = self._asked_speeds()
        self.asked = asked[segment]
        # In a blend the slower one of its segments is asked for.
        for k, blend in enumerate(self.goal.segments[:-1]):
            near = np.linalg.norm(self.x - self.corners[k + 1], axis=1) < blend.blend_radius
            near &= (segment == k) | (segment == k + 1)
            self.asked[near] = min(asked[k], asked[k + 1])
        self.margin = (CYCLES * CYCLE * self.speeds + LENGTH) / self.lengths[segment]

    def _asked_speeds(self):
        times = [0.0, *(point.time for point in self.goal.waypoints)]
        if times[-1]:
            return self.lengths / np.diff(times)
        return np.array([segment.velocity for segment in self.goal.segments])


def wrong_speeds(read, stretches):
    """Yield what was not announced, and what was announced and did not happen."""
    announced = np.zeros(len(read.at), dtype=bool)
    for each in stretches:
        begin, end = each.first + each.first_fraction, each.last + each.last_fraction
        inside = (read.at > begin - read.margin) & (read.at < end + read.margin) & read.moving
        announced |= inside
        well_inside = (read.at > begin + read.margin) & (read.at < end - read.margin)
        if well_inside.sum() > 2 and (read.speeds > 0.99 * read.asked)[inside].all():
            yield f'announced in vain: {each.line}'
        if each.cause is not SlowCause.IN_BLEND and inside.any():
            part = (read.speeds / read.asked)[well_inside].min(initial=np.inf)
            if part < each.lowest / each.asked - 2.0 * (1.0 - SLOWER):
                yield f'slower than announced ({part:.3f}): {each.line}'
    slow = read.moving & (read.speeds + SPEED < SLOWER * read.asked) & ~announced
    if slow.any():
        row = np.flatnonzero(slow)[np.argmin(read.speeds[slow] / read.asked[slow])]
        yield (
            f'not announced: {read.speeds[row]:.4f} of {read.asked[row]:.4f} m/s at '
            f'{read.at[row]:.3f} ({slow.sum()} packets)'
        )


async def run_paths(cell, numbers, counts, wrong):
    recorder = RtdeRecorder()
    connection, _ = await cell.loop.create_connection(lambda: recorder, HOST, RTDE)
    connection.write(recorder.codec.requests(1.0 / CYCLE))
    done = 0
    while done < len(numbers):
        number = numbers[done]
        family = (LINES, PROCESS, SPLINE)[number % 3]
        rng = np.random.default_rng([SEED, number])
        made = None
        while made is None:  # drawn until one is possible
            q, goal = random_goal(rng, family)
            cell.robot.controller.motion.teleport(q)
            await cell.sleep(0.1)
            try:
                made = plan(goal, cell.memory.read(), ARM, OPTIONS)
            except GoalRefused as refusal:
                counts[f'refused {type(refusal).__name__}'] += 1
                if os.environ.get('ANNOUNCED_SPEEDS_SHOW'):
                    print(refusal)
        recorder.rows.clear()
        motion = cell.owner.start(made)
        await cell.until(lambda motion=motion: motion.outcome is not None, 60.0)
        if not motion.outcome.succeeded:
            wrong.append(f'{number} {family}: {motion.outcome.text}')
            return
        stretches = made.find_slow_stretches()
        read = Readings(list(recorder.rows), goal, ARM.forward(q).position)
        for each in stretches:
            counts[each.cause.name] += 1
        counts[family] += 1
        wrong += [f'{number} {family}: {text}' for text in wrong_speeds(read, stretches)]
        done += 1


@pytest.mark.timeout(3600)
def test_each_slow_stretch_was_announced_at_its_place(record_property):
    counts, wrong = Counter(), []
    run_cell(
        lambda cell: run_paths(cell, range(PATHS), counts, wrong),
        imperfect='',
        robot={'frequency': 1.0 / CYCLE},
    )
    line = ', '.join(f'{count} {kind}' for kind, count in sorted(counts.items()))
    print(line)
    record_property('announced_speeds', line)
    assert not wrong, '\n'.join([line, *wrong])
