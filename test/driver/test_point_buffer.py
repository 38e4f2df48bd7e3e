# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Records of a motion that goes on: each is sent once, and then forgotten."""

from ur_cartesian_driver.driver.loop.point_buffer import PointBuffer
from ur_cartesian_driver.protocol.program.trajectory_points import POINT_SIZE


def records(*names):
    return b''.join(name.encode() * POINT_SIZE for name in names)


def test_what_is_taken_is_forgotten_and_numbers_go_on():
    store = PointBuffer(records('a', 'b', 'c', 'd'))
    assert store.take(0, 2) == records('a', 'b')
    assert len(store) == 2
    assert store.take(2, 3) == records('c')
    assert store.take(3, 4) == records('d')
    assert len(store) == 0


def test_what_comes_behind_takes_the_place_of_what_was_there():
    store = PointBuffer(records('a', 'b', 'z'))
    assert store.take(0, 1) == records('a')
    store.put(2, records('c', 'd', 'y'))
    assert store.take(1, 4) == records('b', 'c', 'd')
    store.put(4, records('e'))
    assert store.take(4, 5) == records('e')
