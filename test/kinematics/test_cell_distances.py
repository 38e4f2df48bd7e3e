# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Distances in a cell agree with brute force over triangles, and are never larger."""

from math import inf, pi

from forward_model import dh_forward, pose_matrix
import numpy as np
import pytest
from random_cases import cases, random_of
from random_cells import (
    CellJudge,
    MODEL_NAMES,
    part_distances,
    part_of,
    random_arm,
    random_cell,
    random_pose,
    random_shape,
)
from triangle_distance import (
    box_surface,
    cylinder_surfaces,
    encloses,
    moved,
    triangle_distance,
)

from ur_cartesian_driver.kinematics import cell_distances as engine
from ur_cartesian_driver.kinematics import solids
from ur_cartesian_driver.kinematics.cell_distances import CellDistances
from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.kinematics.link_shapes import mesh_tolerance
from ur_cartesian_driver.kinematics.robot_models import MODELS
from ur_cartesian_driver.kinematics.solids import CarrierFrames, Solid
from ur_cartesian_driver.motion.cell.cell import Cell, CellBody, LINK_NAMES, PlacedShape
from ur_cartesian_driver.motion.cell.shapes import Box, Cylinder, HalfSpace, Mesh, Sphere
from ur_cartesian_driver.motion.errors import NotAvailable
from ur_cartesian_driver.motion.geometry.pose import IDENTITY, Pose
from ur_cartesian_driver.planning.options import PlanningOptions
from ur_cartesian_driver.planning.preflight.clearance import Clearance

#: Distances agree within this [m].
AGREE = 1e-4
#: coal is exact to this [m].
ROUNDING = 2e-6


@pytest.fixture(scope='module')
def coal():
    pytest.importorskip('pinocchio')
    return solids.coal()


@pytest.fixture
def no_coal(monkeypatch):
    """As on a computer without pinocchio."""
    for module in (solids, engine):
        monkeypatch.setattr(module, 'has_coal', lambda: False)


# -- the judge itself -----------------------------------------------------------------------------


def test_brute_force_finds_distances_that_are_known():
    box = box_surface((0.2, 0.4, 0.6))
    T = np.eye(4)
    for by, expected in (
        ((0.5, 0.0, 0.0), 0.3),
        ((0.5, 0.5, 0.0), np.hypot(0.3, 0.1)),
        ((0.5, 0.5, 1.0), np.sqrt(0.3**2 + 0.1**2 + 0.4**2)),
        ((0.2, 0.1, 0.1), 0.0),
        ((0.1, 0.1, 0.1), 0.0),
    ):
        T[:3, 3] = by
        assert triangle_distance(box, moved(box, T)) == pytest.approx(expected, abs=1e-12), by
    inner, outer = cylinder_surfaces(0.1, 0.3)
    assert encloses(box, np.array((0.09, 0.19, -0.29)))
    assert not encloses(box, np.array((0.11, 0.0, 0.0)))
    for surface, reach in ((inner, 0.1), (outer, 0.1 / np.cos(pi / 128))):
        assert np.hypot(*surface[..., :2].T).max() == pytest.approx(reach, abs=1e-12)
        assert encloses(surface, np.zeros(3))
        edge = np.tile((0.5, 0.0, 0.0), (3, 1))[None]
        assert triangle_distance(surface, edge) == pytest.approx(0.5 - reach, abs=1e-12)
    # Two edges cross at a distance, far from all corners.
    one = np.array([[(-1.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0, 0.0, -1.0)]])
    other = np.array([[(0.0, -1.0, 0.2), (0.0, 1.0, 0.2), (0.0, 0.0, 1.2)]])
    assert triangle_distance(one, other) == pytest.approx(0.2, abs=1e-12)


# -- random scenes --------------------------------------------------------------------------------


class Scene:
    """An arm, its TCP, a cell around it, and some configurations."""

    def __init__(self, random, name=None, *, meshes=True):
        rng = self.rng = np.random.default_rng(random.getrandbits(32))
        self.arm, self.tcp = random_arm(rng, name), random_pose(rng, (0.0, 0.0, 0.1), 0.05)
        self.q = rng.uniform(-pi, pi, (3, 6))
        empty = CellJudge(self.arm, self.tcp, Cell())
        places = np.concatenate([empty.frames(q)[2:, :3, 3] for q in self.q])
        self.cell = random_cell(rng, places, meshes=meshes)
        self.judge = CellJudge(self.arm, self.tcp, self.cell)
        self.bodies = CellDistances(self.arm, self.tcp, self.cell)
        self.poses = self.bodies.poses(self.q)

    def columns(self):
        """Return a pair of the arm and one of two bodies, the nearest ones in half the scenes."""
        of_arm = np.array([bool({pair.a, pair.b} & {*LINK_NAMES}) for pair in self.bodies.pairs])
        least = self.bodies.lower_bounds(self.poses).min(axis=0)
        score = least if self.rng.random() < 0.5 else self.rng.random(len(least))
        kinds = [np.flatnonzero(which) for which in (of_arm, ~of_arm)]
        return [int(columns[np.argmin(score[columns])]) for columns in kinds if len(columns)]

    def bounds(self, column):
        """
        Return by how much a distance may be smaller than that of the judge, for a pair [m].

        Links with meshes are measured with a tolerance, those without as polygons with 16 corners
        around rims of which the judge has 24 corners.
        """
        pair = self.bodies.pairs[column]
        if pair.a not in LINK_NAMES and pair.b not in LINK_NAMES:
            return AGREE
        if self.judge.has_meshes:
            return AGREE + mesh_tolerance(self.arm.model.name)
        return 0.006


@pytest.mark.random
@pytest.mark.timeout(1200)
@pytest.mark.parametrize('name', MODEL_NAMES)
def test_distances_are_those_of_brute_force(name, coal):
    """Never larger; smaller by the tolerance of the arm's meshes at most."""
    for number in range(cases(250)):
        scene = Scene(random_of('distances in a cell of', name, number), name)
        frames = [scene.judge.frames(q) for q in scene.q]
        least = scene.bodies.lower_bounds(scene.poses)
        for column in scene.columns():
            pair = scene.bodies.pairs[column]
            found = scene.bodies.distances(column, scene.poses, inf)
            row = int(np.argmin(found))
            low, high = scene.judge.distances(pair.a, pair.b, frames[row])
            where = f'{number}: {pair.a} and {pair.b}'
            assert max(found[row], 0.0) <= max(high, 0.0) + ROUNDING, where
            assert max(found[row], 0.0) >= low - scene.bounds(column), where
            # How deep bodies overlap is another matter.
            assert (least[:, column] <= np.maximum(found, 0.0) + ROUNDING).all(), where


@pytest.mark.random
@pytest.mark.timeout(1200)
def test_without_coal_plain_bodies_are_never_farther(no_coal):
    smaller = []
    for number in range(cases(400)):
        scene = Scene(random_of('without coal', number), meshes=False)
        frames = [scene.judge.frames(q) for q in scene.q]
        for column in scene.columns():
            pair = scene.bodies.pairs[column]
            found = scene.bodies.distances(column, scene.poses, inf)
            row = int(np.argmin(found))
            low, high = scene.judge.distances(pair.a, pair.b, frames[row])
            assert max(found[row], 0.0) <= max(high, 0.0) + ROUNDING, (number, pair)
            if pair.a not in LINK_NAMES and pair.b not in LINK_NAMES:
                smaller.append(max(low, 0.0) - max(found[row], 0.0))
    print(f'smaller by p50, p99, max [m]: {np.percentile(smaller, (50, 99, 100))}')
    assert np.percentile(smaller, 95) < AGREE


# -- special places -------------------------------------------------------------------------------


def solids_apart(a, T_a, b, T_b):
    """Return the distance of two shapes by the package [m]."""
    stands = CarrierFrames(np.eye(3)[None], np.zeros((1, 3)))
    return float(solids.distances(Solid(a, T_a), stands, Solid(b, T_b), stands)[0])


def at(x=0.0, y=0.0, z=0.0):
    return Pose((x, y, z))


THIN = Box((1.0, 1.0, 0.001))


@pytest.mark.parametrize(
    ('a', 'b', 'place', 'expected'),
    [
        (Box((0.2, 0.2, 0.2)), Box((0.2, 0.2, 0.2)), at(0.2), 0.0),
        (Box((0.2, 0.2, 0.2)), Box((0.2, 0.2, 0.2)), at(0.15), -0.05),
        (Box((0.2, 0.2, 0.2)), Box((0.2, 0.2, 0.2)), at(0.21, 0.21), 0.01 * np.sqrt(2.0)),
        (THIN, THIN, at(z=0.002), 0.001),
        (THIN, Sphere(0.05), at(z=0.0505), 0.0),
        (THIN, Sphere(0.05), at(0.1, 0.1, 0.0515), 0.001),
        (Cylinder(0.1, 0.4), Cylinder(0.05, 0.2), at(0.16), 0.01),
        (Cylinder(0.1, 0.4), Sphere(0.02), at(z=0.23), 0.01),
        (HalfSpace(), Sphere(0.05), at(z=0.04), -0.01),
        (HalfSpace(), Box((0.1, 0.1, 0.1)), at(z=0.06), 0.01),
        (Sphere(0.05), Sphere(0.02), at(0.01), -0.06),
    ],
    ids=str,
)
@pytest.mark.parametrize('with_coal', [True, False])
def test_shapes_that_touch_or_overlap_have_no_distance(a, b, place, expected, with_coal, request):
    request.getfixturevalue('coal' if with_coal else 'no_coal')
    for found in (
        solids_apart(a, IDENTITY, b, place),
        solids_apart(b, IDENTITY, a, place.inverse()),
    ):
        assert found <= expected + ROUNDING
        if with_coal:
            assert found == pytest.approx(expected, abs=2e-5)
        elif expected > 0.0:
            assert found == pytest.approx(expected, abs=1e-3)


def mesh_box(size):
    """Return a box as a closed mesh."""
    return Mesh(box_surface(size).reshape(-1, 3), np.arange(36).reshape(-1, 3))


def test_meshes_that_pass_through_each_other_overlap(coal):
    one, other = mesh_box((0.2, 0.2, 0.2)), mesh_box((0.1, 0.1, 0.3))
    assert solids_apart(one, IDENTITY, other, at(0.02, 0.03)) < 0.0
    assert solids_apart(one, IDENTITY, other, at(0.16)) == pytest.approx(0.01, abs=ROUNDING)


def cell_distance(cell, q):
    """Return the smallest distance of wrist 3 of a UR5e in a cell [m]."""
    bodies = CellDistances(Arm(MODELS['ur5e']), IDENTITY, cell)
    column = [pair.a for pair in bodies.pairs].index('wrist_3_link')
    return float(bodies.distances(column, bodies.poses(np.array([q])), inf)[0])


def test_what_is_inside_a_closed_mesh_is_measured_to_its_surface(coal):
    """A hall around the arm is a closed mesh, too."""
    q = (0.3, -1.4, 1.5, -1.6, -1.5, 0.2)
    flange = dh_forward(MODELS['ur5e'].geometry, q)
    around = mesh_box((4.0, 4.0, 4.0))
    assert around.is_closed
    body = CellBody(name='hall', shapes=(PlacedShape(around),))
    found = cell_distance(Cell(bodies=(body,)), q)
    wall = 2.0 - np.abs(flange[:3, 3]).max()
    assert wall - 0.15 < found < wall


def test_a_wrist_in_the_surface_of_a_mesh_touches_it(coal):
    q = (0.3, -1.4, 1.5, -1.6, -1.5, 0.2)
    flange = dh_forward(MODELS['ur5e'].geometry, q)[:3, 3]
    body = CellBody(
        name='block',
        shapes=(PlacedShape(mesh_box((0.2, 0.2, 0.2))),),
        T_frame_body=at(float(flange[0]) + 0.1, *flange[1:].tolist()),
    )
    assert cell_distance(Cell(bodies=(body,)), q) < 0.0


def test_meshes_are_refused_without_coal(no_coal):
    body = CellBody(name='part', shapes=(PlacedShape(mesh_box((0.2, 0.2, 0.2))),))
    options = PlanningOptions(cell=Cell(bodies=(body,)))
    with pytest.raises(NotAvailable) as caught:
        Clearance(Arm(MODELS['ur5e']), IDENTITY, options)
    assert str(caught.value) == (
        'cell_file has the mesh "part", but pinocchio, which measures meshes, is not installed; '
        'the extra `collision` brings it (boxes, cylinders, spheres and planes do not need it).'
    )


def test_distances_that_are_enough_are_no_larger_and_not_below(coal):
    """They may be coarser from there on."""
    for number in range(10):
        scene = Scene(random_of('enough', number))
        for column in range(len(scene.bodies.pairs)):
            exact = scene.bodies.distances(column, scene.poses, inf)
            for enough in (0.01, 0.1):
                found = scene.bodies.distances(column, scene.poses, enough)
                assert (found <= exact + ROUNDING).all()
                assert ((found >= enough) == (exact >= enough)).all()


def test_the_closest_pair_is_the_closest_of_all(coal):
    for number in range(10):
        scene = Scene(random_of('closest', number))
        every = np.stack(
            [scene.bodies.distances(k, scene.poses, inf) for k in range(len(scene.bodies.pairs))]
        )
        found, columns = scene.bodies.closest(scene.q)
        np.testing.assert_allclose(found, every.min(axis=0), atol=ROUNDING)
        np.testing.assert_allclose(every[columns, range(len(found))], found, atol=ROUNDING)


def test_tessellated_shapes_are_those_of_the_package(coal):
    """Between random shapes at random places, within what tessellation leaves open."""
    rng = np.random.default_rng(3)
    for _ in range(100):
        a, b = random_shape(rng), random_shape(rng)
        T_a, T_b = random_pose(rng, spread=0.3), random_pose(rng, spread=0.3)
        low, high = part_distances(
            part_of(a, pose_matrix(T_a)), np.eye(4), part_of(b, pose_matrix(T_b)), np.eye(4)
        )
        found = max(solids_apart(a, T_a, b, T_b), 0.0)
        assert max(low, 0.0) - ROUNDING <= found <= max(high, 0.0) + ROUNDING
