# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The curve of the closest pair has its distances, its times and its names."""

from xml.etree import ElementTree

import numpy as np
import pytest

from ur_cartesian_driver.kinematics.cell_distances import CellDistances
from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.kinematics.robot_models import MODELS
from ur_cartesian_driver.motion.cell.cell import Cell, CellBody, PlacedShape
from ur_cartesian_driver.motion.cell.shapes import Sphere
from ur_cartesian_driver.motion.geometry.pose import IDENTITY
from ur_cartesian_driver.preview.distance_curve import distance_curve, groups_of_pairs


def read(html):
    """Return name and places of each piece of the curve, and the list below it."""
    root = ElementTree.fromstring(html.replace('<br>', '<br/>'))
    pieces = [
        (
            line.findtext('title'),
            np.array([place.split(',') for place in line.get('points').split()], dtype=float),
        )
        for line in root.iter('polyline')
    ]
    assert root.findtext('b') == 'near <1>'
    lines = [each.tail for each in root.iter('i')]
    return pieces, lines


def test_each_piece_has_its_pair_and_together_they_are_the_curve():
    time = np.linspace(0.0, 4.0, 9)
    distances = np.array([0.4, 0.3, 0.2, -0.05, 0.2, 0.35, 0.3, 0.1, 0.15])
    pairs = ['table and tool'] * 5 + ['<clamp> and forearm'] * 2 + ['table and tool'] * 2
    pieces, lines = read(distance_curve('near <1>', time, distances, pairs))
    assert [name for name, _ in pieces] == [pairs[0], pairs[5], pairs[0]]
    assert [len(places) for _, places in pieces] == [6, 3, 2]  # each ends where the next begins
    places = np.vstack([pieces[0][1][:-1], pieces[1][1][:-1], pieces[2][1]])
    for along, values in ((places[:, 0], time), (places[:, 1], distances)):
        scale, offset = np.polyfit(values, along, 1)
        assert np.allclose(scale * values + offset, along, atol=0.1)
        assert abs(scale) > 50.0
    assert places[:, 1].min() == places[np.argmax(distances), 1]  # up is far
    assert lines == [
        'table and tool: -0.050 m at 1.50 s',
        '<clamp> and forearm: 0.300 m at 3.00 s',
    ]


def test_where_nothing_is_measured_there_is_no_curve():
    time = np.array([0.0, 1.0, 2.0])
    assert distance_curve('near <1>', time, np.full(3, np.inf), [''] * 3) == ''
    assert distance_curve('near <1>', time[:0], np.zeros(0), []) == ''
    pairs = ['', 'a and b', 'a and b']
    pieces, lines = read(distance_curve('near <1>', time, np.array([np.inf, 0.2, 0.1]), pairs))
    assert [len(places) for _, places in pieces] == [2]
    assert lines == ['a and b: 0.100 m at 2.00 s']


@pytest.mark.parametrize('distance', [0.0, 0.1, -0.1])
def test_an_arm_at_rest_has_a_curve_of_one_place(distance):
    pieces, _ = read(distance_curve('near <1>', np.zeros(1), np.array([distance]), ['a and b']))
    assert [len(places) for _, places in pieces] == [1]
    assert np.isfinite(pieces[0][1]).all()


def test_what_the_arm_carries_does_not_hide_what_stands_around_it():
    """Pairs are measured in one group or the other, none in both, and none that may touch."""
    bodies = tuple(
        CellBody(name=name, shapes=(PlacedShape(Sphere(0.01)),), frame=frame)
        for name, frame in (
            ('table', 'base'),
            ('post', 'base_link'),
            ('torch', 'tool0'),
            ('cable', 'forearm_link'),
        )
    )
    pairs = (('torch', 'wrist_3_link'), ('table', 'torch'), ('post', 'shoulder_link'))
    cell = Cell(bodies=bodies, may_touch=frozenset(map(frozenset, pairs)))
    arm = Arm(MODELS['ur5e'])

    def measured(cell):
        pairs = CellDistances(arm, IDENTITY, cell, 0.0).pairs
        return {frozenset((a, b)) for a, b, _ in pairs}

    around, own = (measured(group) for group in groups_of_pairs(cell).values())
    assert around | own == measured(cell)
    assert not around & own
    fixed = {'table', 'post'}
    assert all(pair & fixed for pair in around)
    assert not any(pair & fixed for pair in own)
    assert frozenset(('torch', 'cable')) in own
    assert frozenset(('cable', 'table')) in around
