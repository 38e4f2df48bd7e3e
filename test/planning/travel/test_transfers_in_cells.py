# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Random transfers among the bodies of a cell, made backwards from a way that is known to be free.

A random joint motion over other configurations is the known way. Boxes, cylinders and spheres are
put where the straight motion from its start to its end passes, but not near the known way. The
test judges by points on the meshes of the links, which pinocchio's forward kinematics places, and
by textbook formulas for the distance of a point from a body. Where no way exists, the forearm is
in a ring through which the plate in the hand does not fit.
"""

from collections import Counter
from dataclasses import replace
from functools import lru_cache
from itertools import pairwise
from math import pi

from forward_model import dh_frames, pose_matrix
import numpy as np
import pytest
from random_cases import cases, random_of
from random_cells import CellJudge

from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.kinematics.robot_models import MODELS
from ur_cartesian_driver.motion.cell.cell import Cell, CellBody, PlacedShape
from ur_cartesian_driver.motion.cell.shapes import Box, Cylinder, Sphere
from ur_cartesian_driver.motion.errors import CollisionPredicted
from ur_cartesian_driver.motion.geometry.pose import Pose
from ur_cartesian_driver.planning import PlanningOptions
from ur_cartesian_driver.planning.preflight.tcp_kinematics import TcpKinematics
from ur_cartesian_driver.planning.travel.arm_space import ArmSpace
from ur_cartesian_driver.planning.travel.transfer import find_transfer, TransferSettings

pytest.importorskip('pinocchio')

PARTS, WHOLE = 10, 300
#: Samples within which at least 99 % of the transfers are found, and those of impossible ones.
SAMPLES, FEW = 1000, 200
CLEARANCE = 0.01
#: What the known way keeps from the bodies beyond their clearance [m]: 4.5 cm between a place on a
#: link and the nearest of its points, and 3 cm by which the arm moves while joints turn by half a
#: degree.
MARGIN = 0.075
#: Triangles are divided until no side is longer than this [m]; half of it is between points.
SPACING = 0.03
BODIES = 10
TCP = Pose((0.0, 0.0, 0.12))
DEGREE = pi / 180
SETTINGS = TransferSettings(retract=0.0, approach=0.0, max_samples=SAMPLES)


def rows_between(a, b, step):
    count = max(1, int(np.ceil(np.abs(np.subtract(b, a)).max() / step)))
    return np.asarray(a) + np.linspace(0.0, 1.0, count + 1)[:, None] * np.subtract(b, a)


def along(waypoints, step):
    return np.concatenate([rows_between(a, b, step) for a, b in pairwise(waypoints)])


def surface_points(triangles):
    """Points on triangles (n, 3, 3), so many that the gaps between them are small."""
    found, rest = [], triangles
    while len(rest):
        sides = np.linalg.norm(rest - np.roll(rest, 1, axis=1), axis=2).max(axis=1)
        found.append(rest[sides <= SPACING].mean(axis=1))
        a, b, c = (rest[sides > SPACING, k] for k in range(3))
        ab, bc, ca = 0.5 * (a + b), 0.5 * (b + c), 0.5 * (c + a)
        corners = ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))
        rest = np.concatenate([np.stack(one, axis=1) for one in corners])
    points = np.concatenate([*found, triangles.reshape(-1, 3)])
    _, first = np.unique(np.round(points / (0.5 * SPACING)), axis=0, return_index=True)
    return points[first]


@lru_cache
def links_of(name):
    """The arm, the judge that places its links, and the points on each moving link."""
    arm = Arm(MODELS[name])
    judge = CellJudge(arm, TCP, Cell())
    points = []
    for link in list(judge.parts)[1:7]:
        part_points = [
            surface_points(part.outer) @ part.T[:3, :3].T + part.T[:3, 3]
            for part in judge.parts[link]
        ]
        points.append((judge.carriers[link], np.concatenate(part_points)))
    return arm, judge, points


def point_distances(shape, points):
    """The signed distances of points (n, 3) in the frame of a shape."""
    if isinstance(shape, Sphere):
        return np.linalg.norm(points, axis=1) - shape.radius
    if isinstance(shape, Box):
        beyond = np.abs(points) - 0.5 * np.array(shape.size)
    else:
        across = np.hypot(points[:, 0], points[:, 1]) - shape.radius
        beyond = np.stack([across, np.abs(points[:, 2]) - 0.5 * shape.length], axis=1)
    outside = np.linalg.norm(np.maximum(beyond, 0.0), axis=1)
    return outside + np.minimum(beyond.max(axis=1), 0.0)


def frames_of(name, rows):
    return np.array([links_of(name)[1].frames(q) for q in rows])


def keeps(name, frames, body, distance):
    """Whether the points on all links keep a distance [m] from a body, with links at frames."""
    T = np.linalg.inv(pose_matrix(body.T_frame_body))
    [placed] = body.shapes
    for carrier, points in links_of(name)[2]:
        middle = 0.5 * (points.min(axis=0) + points.max(axis=0))
        radius = np.linalg.norm(points - middle, axis=1).max()
        at = T @ frames[:, carrier]
        low = point_distances(placed.shape, at[:, :3, :3] @ middle + at[:, :3, 3]) - radius
        for row in np.argsort(low)[: np.count_nonzero(low < distance)]:
            inside = points @ at[row, :3, :3].T + at[row, :3, 3]
            if point_distances(placed.shape, inside).min() < distance:
                return False
    return True


def random_body(draw, name, centre):
    size = draw.uniform(0.05, 0.3, 3)
    shapes = Box(tuple(size)), Cylinder(0.5 * size[0], size[1]), Sphere(0.4 * size[0])
    q = draw.normal(size=4)
    place = Pose(tuple(centre), tuple(q / np.linalg.norm(q)))
    shape = shapes[draw.integers(3)]
    return CellBody(name=name, shapes=(PlacedShape(shape),), T_frame_body=place)


def space_of(name, cell):
    options = PlanningOptions(cell=cell)
    return ArmSpace(TcpKinematics(links_of(name)[0], TCP), options)


def random_transfer(random):
    """Return a model, the bodies of a cell, and the corners of a way that is free in it."""
    name = random.choice(['ur3e', 'ur5e', 'ur10e'])
    arm = links_of(name)[0]
    limits = np.clip(np.array(arm.model.position_limits), -pi, pi)
    draw = np.random.default_rng(random.getrandbits(32))
    alone = space_of(name, Cell())
    while True:
        way = draw.uniform(limits[:, 0], limits[:, 1])[None]
        for _ in range(3):
            change = draw.uniform(-1.2, 1.2, 6)
            way = np.vstack([way, np.clip(way[-1] + change, *limits.T)])
        if alone.free(along(way, 2 * DEGREE)).all():
            break
    known = frames_of(name, along(way, DEGREE))
    blocked = rows_between(way[0], way[-1], 4 * DEGREE)
    bodies: list[CellBody] = []
    for _ in range(60):
        row = dh_frames(arm.geometry, blocked[draw.integers(len(blocked))])[0, 2:, :3, 3]
        centre = row[draw.integers(len(row))] + draw.normal(0.0, 0.08, 3)
        one = random_body(draw, f'body {len(bodies)}', centre)
        if keeps(name, known, one, CLEARANCE + MARGIN):
            bodies.append(one)
        if len(bodies) == BODIES:
            break
    straight = frames_of(name, blocked)
    if all(keeps(name, straight, body, 0.0) for body in bodies):
        return random_transfer(random)
    return name, bodies, way


@pytest.mark.slow
@pytest.mark.random
@pytest.mark.parametrize('part', range(PARTS))
def test_random_transfers_among_bodies_are_found_and_free(part):
    random = random_of('transfers in cells', part)
    seen = Counter()
    for _ in range(cases(WHOLE // PARTS)):
        name, bodies, way = random_transfer(random)
        space = space_of(name, Cell(bodies=tuple(bodies), clearance=CLEARANCE))
        start, end = (tuple(way[k].tolist()) for k in (0, -1))
        seen['all'] += 1
        try:
            found = find_transfer(space, start, [end], SETTINGS, 'The travel')
        except CollisionPredicted:
            seen['missed'] += 1
            continue
        seen['samples'] += found.samples
        assert np.allclose(found.waypoints[[0, -1]], way[[0, -1]])
        rows = along(found.waypoints, 0.5 * DEGREE)
        low, high = space.limits
        assert ((rows >= low) & (rows <= high)).all()
        frames = frames_of(name, rows)
        # Points on the surface are never nearer than the surface.
        assert all(keeps(name, frames, body, CLEARANCE - 1e-4) for body in bodies)
    print(dict(seen))
    assert seen['missed'] <= 0.01 * seen['all']


def ring_around(T, half, width=0.25):
    """Four bars around the axis z of a frame; the hole has twice this half side [m]."""
    bars = []
    for k, (x, y) in enumerate(((1, 0), (-1, 0), (0, 1), (0, -1))):
        long = 2.0 * (half + width)
        size = (width, long, 0.03) if x else (long, width, 0.03)
        off = half + 0.5 * width
        place = T @ Pose((x * off, y * off, 0.0))
        bars.append(
            CellBody(name=f'bar {k}', shapes=(PlacedShape(Box(size)),), T_frame_body=place)
        )
    return bars


#: In the hand; its sides are longer than the diagonal of a hole of 0.18 m.
PLATE = CellBody(
    name='plate',
    frame='tool0',
    shapes=(PlacedShape(Box((0.3, 0.3, 0.02))),),
    T_frame_body=Pose((0.0, 0.0, 0.03)),
)


def ringed(random):
    """Return a space in which the forearm is in a ring at the goal, but not at the start."""
    arm = links_of('ur5e')[0]
    while True:
        # The forearm is level and in the open, so that the ring touches nothing else.
        q = np.array([0.0, -1.4, 1.4, -1.6, -1.6, 0.0])
        q += [random.uniform(-0.15, 0.15) for _ in range(6)]
        q[0] = random.uniform(-pi, pi)
        elbow, wrist = dh_frames(arm.geometry, q)[0, 2:4]
        axis = wrist[:3, 3] - elbow[:3, 3]
        # The axis x of the frame behind the elbow is along the forearm, towards the elbow.
        R = np.stack([wrist[:3, 1], wrist[:3, 2], wrist[:3, 0]], axis=1)
        T = np.eye(4)
        T[:3, :3], T[:3, 3] = R, elbow[:3, 3] + 0.6 * axis
        bars = ring_around(pose_of(T), 0.09)
        cell = Cell(bodies=(*bars, PLATE), clearance=0.005)
        hand = [
            frozenset(('plate', link)) for link in ('wrist_1_link', 'wrist_2_link', 'wrist_3_link')
        ]
        space = space_of('ur5e', replace(cell, may_touch=cell.may_touch | set(hand)))
        start = q + [random.uniform(-0.3, 0.3) for _ in range(6)]
        start[0] = q[0] + random.uniform(2.0, 4.0)
        if space.free(np.array([start, q])).all():
            return space, tuple(start.tolist()), tuple(q.tolist())


def pose_of(T):
    """The pose of a matrix, by the largest part of its quaternion."""
    from scipy.spatial.transform import Rotation

    return Pose(tuple(T[:3, 3]), tuple(Rotation.from_matrix(T[:3, :3]).as_quat()))


@pytest.mark.slow
@pytest.mark.random
@pytest.mark.parametrize('part', range(4))
def test_a_goal_from_which_no_way_leads_is_refused_when_the_samples_are_spent(part):
    random = random_of('ringed goals', part)
    for _ in range(cases(5)):
        space, start, goal = ringed(random)
        few = replace(SETTINGS, max_samples=FEW)
        with pytest.raises(CollisionPredicted) as refused:
            find_transfer(space, start, [goal], few, 'The travel')
        assert str(refused.value).startswith(f'The travel was not found within {FEW} samples; ')
