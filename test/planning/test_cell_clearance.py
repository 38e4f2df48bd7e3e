# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Motions through a cell are refused where they come too close, between two rows as well."""

from math import inf, pi, radians

from forward_model import dh_forward
import numpy as np
import pytest
from random_cases import cases, random_of
from random_cells import CellJudge, plate, random_arm, random_cell, random_pose

from ur_cartesian_driver.kinematics.cell_distances import CellDistances
from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.kinematics.robot_models import MODELS
from ur_cartesian_driver.motion.cell.cell import Cell, CellBody, LINK_NAMES, PlacedShape
from ur_cartesian_driver.motion.cell.shapes import Box, Sphere
from ur_cartesian_driver.motion.geometry.pose import IDENTITY, Pose
from ur_cartesian_driver.planning.preflight.cell_clearance import CellClearance

pytest.importorskip('pinocchio')

#: What is measured between samples and what is proved differ by this at most [m].
AGREE = 1e-4
#: How far the motion may be beside the line between two rows 1 degree apart [m]: such places are
#: refused, too.
BEND = 2e-3
HOME = (0.3, -1.4, 1.5, -1.6, -1.5, 0.2)


# -- rows of joints, judged densely ---------------------------------------------------------------


class Motion:
    """A smooth motion of the joints over 0..1, its rows 1 degree apart, and a cell in its way."""

    def __init__(self, random):
        rng = np.random.default_rng(random.getrandbits(32))
        self.arm, tcp = random_arm(rng), random_pose(rng, (0.0, 0.0, 0.1), 0.02)
        self._start = rng.uniform(-pi, pi, 6)
        self._straight, self._bow = rng.uniform(0.02, 0.4) * rng.normal(size=(2, 6))
        judge = CellJudge(self.arm, tcp, Cell())
        places = np.concatenate([judge.frames(q)[2:, :3, 3] for q in self.at([0.2, 0.5, 0.8])])
        cell = random_cell(rng, places)
        # Plates that only a part of the motion between two rows touches.
        plates = tuple(
            CellBody(
                name=f'plate {k}',
                shapes=(PlacedShape(Box((0.05, 0.05, 0.001))),),
                T_frame_body=random_pose(rng, places[rng.integers(len(places))], 0.1),
                clearance=0.0005,
            )
            for k in range(3)
        )
        needle = CellBody(
            name='needle',
            shapes=(PlacedShape(Sphere(0.002)),),
            frame='tool0',
            T_frame_body=Pose((0.0, 0.0, 0.3)),
            clearance=0.0,
        )
        cell = cell.with_bodies((*plates, needle))
        self.bodies = CellDistances(self.arm, tcp, cell)
        # What is too close at the start would be allowed to separate.
        for pair, _ in self.bodies.pairs_below(self._start):
            if named := sorted({pair.a, pair.b} & cell.names):
                cell = cell.without(named[0])
        self.bodies = CellDistances(self.arm, tcp, cell)
        largest = np.abs(np.diff(self.at(np.linspace(0.0, 1.0, 1001)), axis=0)).max() * 1000.0
        self.t = np.linspace(0.0, 1.0, int(largest / radians(1.0)) + 2)

    def at(self, t):
        t = np.asarray(t)[:, None]
        return self._start + self._straight * t + self._bow * np.sin(2.0 * pi * t) / 3.0

    def dense(self, count=1500):
        """Return times (n,) and the distances (n, pairs) there that are near a clearance."""
        t = np.linspace(0.0, 1.0, count)
        poses = self.bodies.poses(self.at(t))
        found = self.bodies.lower_bounds(poses)
        least = inf
        for column in np.argsort(found.min(axis=0)).tolist():
            clearance = self.bodies.clearances[column]
            bound = clearance if self.bodies.are_neighbours[column] else max(clearance, least)
            rows = np.flatnonzero(found[:, column] < bound + 0.002)
            if len(rows):
                found[rows, column] = self.bodies.distances(column, poses[rows], inf)
            if not self.bodies.are_neighbours[column]:
                least = min(least, found[:, column].min())
        return t, found, least


@pytest.mark.random
@pytest.mark.timeout(1200)
def test_the_first_violation_and_the_closest_pair_are_those_of_a_dense_look():
    counts = {'clear': 0, 'violated': 0, 'between rows only': 0}
    for number in range(cases(200)):
        motion = Motion(random_of('motion in a cell', number))
        rows = motion.at(motion.t)
        bodies, clearances = motion.bodies, motion.bodies.clearances
        result = CellClearance(bodies).check(rows[1:], tuple(rows[0].tolist()))
        t, found, least = motion.dense()
        if (found[0] < clearances + AGREE).any():
            continue  # such pairs may separate
        early = np.flatnonzero((found < clearances - AGREE).any(axis=1))
        first = np.searchsorted(motion.t, t[early[0]]) - 1 if len(early) else inf
        if result.violation is None:
            assert first == inf, number
            assert result.closest is not None
            assert result.at_least <= least + AGREE, number
            distance = result.closest.distance
            assert least - AGREE < distance < least + max(0.001, 0.34 * least) + AGREE, number
            counts['clear'] += 1
            continue
        place = result.violation
        column, distance, row = place.pair, place.distance, place.row
        assert row <= first + 1, number
        there = place.joints(rows[1:], tuple(rows[0].tolist()))
        at_place = bodies.distances(column, bodies.poses(np.array([there])), inf)[0]
        assert at_place < clearances[column] + BEND, number
        # The place is in the row, or between it and the row before.
        begin, end = motion.t[row], motion.t[row + 1]
        near = bodies.poses(motion.at(np.linspace(begin, end, 200)))
        true = bodies.distances(column, near, inf).min()
        assert true < clearances[column] + BEND, number
        assert abs(distance - true) < 0.02, number
        counts['violated'] += 1
        at_rows = bodies.distances(column, bodies.poses(rows[1:]), inf)
        counts['between rows only'] += at_rows.min() > clearances[column]
    print(counts)
    assert counts['clear'] > sum(counts.values()) // 10
    assert counts['violated'] > sum(counts.values()) // 10


# -- rows of joints, one by one -------------------------------------------------------------------


def carried(radius, frame='tool0', place=IDENTITY):
    return CellBody(
        name='ball', shapes=(PlacedShape(Sphere(radius)),), frame=frame, T_frame_body=place
    )


class Swing:
    """A ball at the flange of a UR5e that turns about the base, and a plate in its way."""

    def __init__(self, thickness=0.001, at_degrees=30.5, *, mesh=False, **settings):
        self.arm, ball = Arm(MODELS['ur5e']), Pose((0.0, 0.0, 0.3))
        q = (HOME[0] + radians(at_degrees), *HOME[1:])
        flange = dh_forward(self.arm.geometry, q)
        x, y, z = (flange @ (0.0, 0.0, 0.3, 1.0))[:3].tolist()
        self.radius = float(np.hypot(x, y))
        # The normal of the plate is along the way of the ball.
        turn = 0.5 * float(np.arctan2(y, x))
        across = Pose((x, y, z), (0.0, 0.0, float(np.sin(turn)), float(np.cos(turn))))
        shape = Box((0.05, thickness, 0.05))
        if mesh:
            flat, upright = (
                plate(np.random.default_rng(0), 2, 0.05, 0.0),
                (0.5**0.5, 0, 0, 0.5**0.5),
            )
            placed = PlacedShape(flat, Pose((0.0, 0.0, 0.0), upright))
        else:
            placed = PlacedShape(shape)
        body = CellBody(name='plate', shapes=(placed,), T_frame_body=across)
        cell = Cell(bodies=(body, carried(0.002, place=ball)), **{'clearance': 0.002, **settings})
        self.clearance = CellClearance(CellDistances(self.arm, IDENTITY, cell))
        self.pairs = self.clearance.bodies.pairs

    def check(self, *degrees, step=1.0):
        """Check a motion from angle to angle of the first joint."""
        rows = [degrees[0]]
        for end in degrees[1:]:
            count = max(1, round(abs(end - rows[-1]) / step))
            rows += np.linspace(rows[-1], end, count + 1)[1:].tolist()
        q = np.array([(HOME[0] + radians(angle), *HOME[1:]) for angle in rows])
        return self.clearance.check(q[1:], tuple(q[0].tolist()))

    def pair(self, place):
        return {self.pairs[place.pair].a, self.pairs[place.pair].b}


@pytest.mark.parametrize('mesh', [False, True])
@pytest.mark.parametrize('clearance', [0.0, 0.0005, 0.002])
def test_a_thin_plate_between_two_rows_is_seen(mesh, clearance):
    swing = Swing(mesh=mesh, clearance=clearance)
    # The rows beside the plate are far from it.
    assert swing.check(0.0, 30.0).violation is None
    found = swing.check(0.0, 60.0).violation
    assert found.row == 30  # that of 31 degrees
    assert swing.pair(found) == {'plate', 'ball'}
    assert found.distance < clearance
    assert swing.check(60.0, 0.0).violation.row == 29
    row = swing.check(0.0, 60.0, step=0.1).violation.row
    thickness = 0.0 if mesh else 0.001
    expected = 30.5 - np.degrees((0.002 + 0.5 * thickness + clearance) / swing.radius)
    assert row == int(10.0 * expected)


def test_pairs_that_may_touch_are_not_measured():
    pair = frozenset({'plate', 'ball'})
    assert Swing(may_touch=frozenset({pair})).check(0.0, 60.0).violation is None


def test_what_is_passed_at_its_clearance_is_accepted_and_no_nearer():
    swing = Swing(thickness=0.002, at_degrees=31.0, clearance=0.0)
    # The ball ends in front of the plate: 2 mm of its radius and 1 mm of the plate.
    for gap, refused in ((0.0021, False), (0.0019, True)):
        swing = Swing(thickness=0.002, at_degrees=31.0, clearance=0.002)
        end = 31.0 - np.degrees((0.003 + gap) / swing.radius)
        result = swing.check(0.0, end)
        assert (result.violation is not None) == refused, gap
        if not refused:
            assert gap - AGREE < result.closest.distance < gap + 0.001
            assert result.closest.row == round(end) - 1
            assert swing.pair(result.closest) == {'plate', 'ball'}
            assert gap - 0.001 < result.at_least < gap


def test_a_pair_that_starts_too_close_may_leave_and_not_come_closer():
    swing = Swing(thickness=0.002, at_degrees=31.0, clearance=0.02)
    near = 31.0 - np.degrees(0.01 / swing.radius)
    assert swing.check(near, 20.0).violation is None
    assert swing.check(near, 20.0, 0.0).violation is None
    closer = swing.check(near, near + 0.2)
    assert swing.pair(closer.violation) == {'plate', 'ball'}
    # Once it has left it is like all others.
    back = swing.check(near, 20.0, near)
    assert back.violation is not None
    assert back.violation.distance < 0.02


@pytest.mark.parametrize('mesh', [False, True])
def test_a_pair_that_starts_too_close_does_not_slip_through_between_two_rows(mesh):
    swing = Swing(mesh=mesh, at_degrees=30.4, clearance=0.005)
    begin = 30.4 - np.degrees(0.004 / swing.radius)
    assert swing.check(begin, 29.0).violation is None
    assert swing.check(begin, begin + 2.0, step=2.0).violation is not None


def test_the_closest_place_counts_a_pair_that_starts_too_close():
    swing = Swing(thickness=0.002, at_degrees=31.0, clearance=0.02)
    result = swing.check(31.0 - np.degrees(0.013 / swing.radius), 20.0)
    assert result.violation is None
    assert result.at_least < 0.01
    assert result.closest.distance == pytest.approx(0.01, abs=0.002)


def test_many_rows_are_as_few():
    """Blocks of rows are searched one after the other."""
    swing = Swing()
    found = swing.check(0.0, 60.0, step=0.005).violation
    assert found.row * 0.005 == pytest.approx(30.5 - np.degrees(0.0045 / swing.radius), abs=0.01)
    assert swing.check(0.0, 29.0, 0.0, 29.0, step=0.005).violation is None


def test_links_are_named():
    assert {pair.a for pair in Swing().pairs} <= {*LINK_NAMES, 'ball'}
