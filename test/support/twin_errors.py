# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Plan goals with and without the twin of a simulated arm, and measure both errors.

    python test/support/twin_errors.py [-n ARMS]

prints the table of doc/twin.md. The laws of each arm are drawn at random; its twin has the values
with small errors, as an identification would find them. The controller is the judge: the time
between the first and the last cycle in which the target joints of RTDE move, and the distance of
the tool's target from the planned path.
"""

from __future__ import annotations

import argparse
from dataclasses import replace
from random import Random

import numpy as np
from robot_in_memory import RobotInMemory

from ur_cartesian_driver.motion.geometry.pose import Pose
from ur_cartesian_driver.motion.goal.goal import Goal, Segment, SegmentType, Waypoint
from ur_cartesian_driver.motion.twin.twin import ArmIdentity, Estimate, Twin
from ur_cartesian_driver.planning import plan, PlanningOptions

TYPE = SegmentType
HOME = (0.3, -1.4, 1.5, -1.2, -1.3, 0.4)
TOOL = Pose((0.01, 0.02, 0.1))
#: Law -> range of its values in arms; relative error of a twin.
DRAWN = {
    'start_time': (0.05, 0.4),
    'turn_ratio': (1.0, 4.0),
    'idle_between_moves': (0.004, 0.06),
    'blend_begin': (0.4, 1.0),
    'blend_speed_ratio': (0.6, 1.6),
}
ERROR = 0.01
OPTIONS = PlanningOptions()


def true_twin(seed, model='ur5', **fixed):
    """Return the laws of an arm, all drawn at random except for the fixed ones."""
    random = Random(seed)
    values = {name: random.uniform(*bounds) for name, bounds in DRAWN.items()} | fixed
    return Twin(
        arm=ArmIdentity(model=model),
        date='2026-11-27',
        estimates={
            **{
                name: Estimate(value=value, interval=(value, value))
                for name, value in values.items()
            },
            'blend_shape': Estimate(value='parabola'),
        },
    )


def measured_twin(true, seed, error=ERROR):
    """Return the twin that an identification with a relative error would find."""
    random = Random(seed)
    found = {}
    for name, estimate in true.estimates.items():
        if isinstance(estimate.value, str):
            found[name] = estimate
            continue
        low, high = DRAWN[name]
        value = min(max(estimate.value * (1.0 + random.gauss(0.0, 0.5 * error)), low), high)
        half = error * value
        found[name] = Estimate(value=value, interval=(value - half, value + half))
    return replace(true, estimates=found)


def goals(home, seed):
    """Return goals of each kind from a pose, by name."""
    rng = np.random.default_rng(seed)

    def goal(types, radius, *, turn=0.0, time=0.0, velocity=0.15):
        places, d = [np.array(home.position)], np.array((0.0, 1.0, 0.0))
        for _ in types:
            side = np.cross(d, rng.normal(size=3))
            d = side / np.linalg.norm(side)
            places.append(places[-1] + rng.uniform(0.05, 0.08) * d)
        points, segments = [], []
        for i, kind in enumerate(types, 1):
            turned = Pose.from_rotation_vector((0.0, 0.0, 0.0, 0.0, 0.0, turn * (i % 2)))
            pose = Pose(tuple(places[i].tolist()), home.quaternion) @ turned
            points.append(Waypoint(pose=pose, time=time * i))
            middle = 0.5 * (places[i] + places[i - 1]) + 0.01 * rng.normal(size=3)
            segments.append(
                Segment(
                    type=kind,
                    blend_radius=radius,
                    velocity=velocity if kind != TYPE.JOINT and not turn and not time else 0.0,
                    via=Pose(tuple(middle.tolist()), home.quaternion)
                    if kind == TYPE.CIRCULAR
                    else None,
                )
            )
        return Goal(waypoints=tuple(points), segments=tuple(segments))

    line, joint, arc, process = TYPE.LINEAR, TYPE.JOINT, TYPE.CIRCULAR, TYPE.PROCESS
    stops = goal([line] * 6, 0.0)
    dwells = tuple(
        replace(each, dwell=0.2 * (i in (1, 3))) for i, each in enumerate(stops.segments)
    )
    return {
        'lines with stops': stops,
        'lines with stops, some dwells': replace(stops, segments=dwells),
        'lines with blends': goal([line] * 6, 0.02),
        'lines with blends and times': goal([line] * 6, 0.02, time=1.5),
        'lines with stops and times': goal([line] * 6, 0.0, time=1.5),
        'joint moves with blends': goal([joint] * 6, 0.02),
        'arcs with blends': goal([arc] * 4, 0.01),
        'lines that turn the tool, with blends': goal([line] * 4, 0.01, turn=0.6),
        'PROCESS with blends': goal([process] * 6, 0.02),
        'all kinds with blends': goal([line, joint, line, arc, process, line], 0.01),
    }


def moving_time(robot, made):
    """Return the time of the arm's motion [s], and the cycles of the run."""
    ran = robot.run([segment.primitive for segment in made.segments])
    assert ran.failure == '', ran.failure
    moves = np.flatnonzero((np.diff(ran.joints, axis=0) != 0.0).any(axis=1))
    return (moves[-1] - moves[0] + 1) * robot.controller.cycle, ran


def warm_robot(twin, frequency=None):
    """Return a robot that has moved already, because the first motion of a program is slow."""
    robot = RobotInMemory('ur5', frequency, twin=twin)
    state = robot.place(HOME, TOOL)
    x, y, z = state.actual_tcp_pose.position
    there = replace(state.actual_tcp_pose, position=(x, y, z - 0.05))
    moving_time(robot, plan_of(robot, Goal(waypoints=(Waypoint(pose=there),))))
    return robot


def plan_of(robot, goal, twin=None, options=OPTIONS):
    """Return the plan of a goal from HOME, by the laws of a twin."""
    options = replace(options, twin=twin, robot=ArmIdentity(model='ur5'))
    return plan(goal, robot.place(HOME, TOOL), robot.controller.arm, options)


def off_path(made, ran):
    """Return the largest distance of the tool from the planned path [m]."""
    path = made.reference.poses[:, :3]
    begin, step = path[:-1], np.diff(path, axis=0)
    square = np.maximum((step**2).sum(axis=1), 1e-18)
    worst = 0.0
    for pose in ran.poses[::3]:
        way = np.array(pose.position) - begin
        u = np.clip((way * step).sum(axis=1) / square, 0.0, 1.0)
        worst = max(worst, float(np.linalg.norm(way - u[:, None] * step, axis=1).min()))
    return worst


def errors(seed):
    """
    Return the errors of plans for each kind of goal (2, 2), without and with the twin.

    Each row has the error of the planned time [s] and of the path [m].
    """
    true = true_twin(seed)
    robot, twin = warm_robot(true, 500.0), measured_twin(true, seed)
    found = {}
    for name, goal in goals(robot.place(HOME, TOOL).actual_tcp_pose, seed).items():
        pair = []
        for used in (None, twin):
            made = plan_of(robot, goal, used)
            took, ran = moving_time(robot, made)
            pair.append((took - made.duration, off_path(made, ran)))
        found[name] = np.array(pair)
    return found


def main():
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.split('.', maxsplit=1)[0])
    parser.add_argument('-n', type=int, default=20, metavar='ARMS')
    arms = parser.parse_args().n
    found = [errors(seed) for seed in range(arms)]
    print('| goal | time without: rms, worst [ms] | with | path without: worst [mm] | with |')
    print('| --- | --- | --- | --- | --- |')
    for name in found[0]:
        pairs = 1e3 * np.array([each[name] for each in found])
        rms, worst = np.sqrt((pairs**2).mean(axis=0)), np.abs(pairs).max(axis=0)
        print(
            f'| {name} | {rms[0, 0]:.0f}, {worst[0, 0]:.0f} | {rms[1, 0]:.1f}, {worst[1, 0]:.1f} '
            f'| {worst[0, 1]:.2f} | {worst[1, 1]:.2f} |'
        )


if __name__ == '__main__':
    main()
