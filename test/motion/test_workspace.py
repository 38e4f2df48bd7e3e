# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Planes are read from texts, or refused with a sentence."""

import pytest

from ur_cartesian_driver.motion.geometry.workspace import parse_planes, Plane
from ur_cartesian_driver.planning.options import PlanningOptions


def test_a_plane_is_a_name_a_point_a_normal_and_a_margin():
    assert Plane.parse('wall 0.1 0.6 0 0 -2 0 0.05') == Plane(
        'wall', (0.1, 0.6, 0.0), (0.0, -1.0, 0.0), 0.05
    )
    assert Plane.parse('  table 0 0 -1e-2 0 0 1 ').margin == 0.0


@pytest.mark.parametrize(
    ('text', 'words'),
    [
        ('table 0 0 0 0 0', 'has 6 words instead of 7 or 8'),
        ('table 0 0 0 0 0 1 0 0', 'has 9 words'),
        ('0 0 0 0 0 1', 'has 6 words'),
        ('table 0 0 up 0 0 1', '"table": could not convert'),
        ('table 0 0 nan 0 0 1', '"table" has a number that is not finite'),
        ('table 0 0 0 0 0 0', 'the normal of "table" is zero'),
        ('table 0 0 0 1.7e308 1.7e308 0', 'the normal of "table" is too long'),
        ('table 0 0 0 0 0 1 -0.1', 'the margin -0.1 of "table" is negative'),
    ],
)
def test_what_is_no_plane_is_refused_in_one_sentence(text, words):
    with pytest.raises(ValueError, match=r'^workspace_planes: ') as refusal:
        parse_planes((text,))
    assert words in str(refusal.value)
    assert str(refusal.value).endswith('.')
    # The same before anything runs.
    with pytest.raises(ValueError, match=r'^workspace_planes: '):
        PlanningOptions(workspace_planes=(text,))


def test_a_name_is_taken_once():
    with pytest.raises(ValueError, match='"a" appears twice'):
        parse_planes(('a 0 0 0 0 0 1', 'b 0 0 0 0 0 1', 'a 1 0 0 0 0 1'))
