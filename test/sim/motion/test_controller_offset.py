# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The controller's path offset: frames, filter, limits, its start and its end."""

from math import pi, sin

import numpy as np
import pytest

from ur_cartesian_driver.motion.geometry.pose import Pose
from ur_cartesian_driver.sim.motion.controller_offset import BASE, FRAMES, MOTION, TCP, WORLD

CYCLE = 0.002
#: Offsets that begin and end smoothly: along x, y, z [m] and about them [rad].
OFFSET = np.array((0.002, -0.003, 0.004, 0.01, 0.02, -0.01))
RAMP = 200


def there(g, *, dy=0.1, dz=0.0, dx=0.0):
    x, y, z = g.T_base_tcp.position
    return Pose((x + dx, y + dy, z + dz), g.T_base_tcp.quaternion)


MOVES = {
    'movel': lambda g: g.movel(there(g), a=0.5, v=0.1),
    'movep': lambda g: g.movep(there(g), a=0.5, v=0.1),
    'movec': lambda g: g.movec(there(g, dx=0.02, dy=0.05), there(g), a=0.5, v=0.1),
    'movej': lambda g: g.movej((0.2, *g.q[1:]), a=0.5, v=0.3),
}


def smooth(k):
    """Return the part of an offset in a cycle: up, and down again."""
    return sin(0.5 * pi * min(k / RAMP, 1.0)) ** 2


def expected(frame, pose, velocity, offset):
    """Return the displaced pose, worked out anew from the script manual for each frame."""
    given = Pose.from_rotation_vector(tuple(offset))
    if frame == TCP:
        return pose @ given
    if frame == WORLD:
        return given.inverse() @ pose
    axes = np.eye(3)
    if frame == MOTION:
        x = velocity / np.linalg.norm(velocity)
        y = np.cross(x, Pose((0, 0, 0), pose.quaternion).apply((0.0, 0.0, 1.0)))
        y /= np.linalg.norm(y)
        axes = np.stack([x, y, np.cross(x, y)])
    turn = Pose.from_rotation_vector((0.0, 0.0, 0.0, *(offset[3:] @ axes)))
    shift = np.array(pose.position) + offset[:3] @ axes
    return Pose(tuple(shift), (turn @ Pose((0, 0, 0), pose.quaternion)).quaternion)


@pytest.fixture
def make(recorder):
    return lambda: recorder().generator


@pytest.mark.parametrize('frame', FRAMES)
@pytest.mark.parametrize('name', sorted(MOVES))
def test_a_move_is_displaced_in_the_frame_and_takes_as_long_as_without(make, name, frame):
    plain, displaced = make(), make()
    moves = [MOVES[name](each) for each in (plain, displaced)]
    offset, k = displaced.path_offset, 0
    offset.enabled = True
    while not moves[0].returned:
        offset.set(frame, tuple(smooth(k) * OFFSET))
        plain.step(1.0)
        displaced.step(1.0)
        k += 1
        velocity = np.array(plain.tcp_twist[:3])
        if frame == MOTION and not velocity.any():
            continue
        wanted = expected(frame, plain.T_base_tcp, velocity, smooth(k - 1) * OFFSET)
        assert displaced.T_base_tcp.distance_to(wanted) < 1e-8
        assert displaced.T_base_tcp.angle_to(wanted) < 1e-7
        assert displaced.arm.forward(displaced.q).distance_to(wanted) < 1e-6
    assert moves[1].returned
    assert displaced.fault is None
    assert offset.applied(frame) == pytest.approx(tuple(OFFSET), abs=1e-6)


def test_the_filter_is_that_of_the_manual(make):
    g = make()
    g.path_offset.enabled, g.path_offset.alpha = True, 0.1
    g.path_offset.set(BASE, (0.0, 0.0, 0.0005, 0.0, 0.0, 0.0))
    z, filtered = g.T_base_tcp.position[2], 0.0
    for _ in range(60):
        g.step(1.0)
        filtered = 0.1 * 0.0005 + 0.9 * filtered
        assert g.T_base_tcp.position[2] - z == pytest.approx(filtered, abs=1e-9)
        assert g.path_offset.applied(BASE)[2] == pytest.approx(filtered, abs=1e-9)


def test_limits_cut_each_axis(make):
    g = make()
    g.path_offset.enabled, g.path_offset.alpha = True, 0.01
    g.path_offset.max_translation, g.path_offset.max_rotation = 0.002, 0.01
    g.path_offset.set(BASE, (0.5, -0.5, 0.001, 1.0, 0.0, -0.005))
    for _ in range(2000):
        g.step(1.0)
    assert g.path_offset.applied(BASE) == pytest.approx(
        (0.002, -0.002, 0.001, 0.01, 0.0, -0.005), abs=1e-6
    )


def test_the_sine_of_the_manufacturers_article_is_followed_with_its_filter(make):
    """6 mm at 3 Hz beside a line at 8 mm/s: it begins at full speed, so it needs the filter."""

    def fault(alpha):
        g = make()
        g.movep(there(g, dy=0.008), a=1.2, v=0.008)
        g.path_offset.enabled, g.path_offset.alpha = True, alpha
        for k in range(400):
            g.path_offset.set(MOTION, (0.0, 0.006 * sin(6.0 * pi * k * CYCLE), 0.0, 0.0, 0.0, 0.0))
            g.step(1.0)
        return g.fault

    assert fault(0.1) is None
    assert (fault(1.0).code, fault(1.0).argument) == (204, 1)


def test_a_jump_stops_the_arm_where_it_was(make):
    g = make()
    g.movel(there(g), v=0.1)
    for _ in range(100):
        g.step(1.0)
    g.path_offset.enabled = True
    before = g.q
    g.path_offset.set(BASE, (0.0, 0.0, 0.005, 0.0, 0.0, 0.0))
    g.step(1.0)
    assert (g.fault.code, g.fault.argument) == (204, 1)
    assert np.abs(np.subtract(g.q, before)).max() < 1e-3


def displaced_by_5_mm(make):
    g = make()
    g.movel(there(g), v=0.05)
    g.path_offset.enabled, g.path_offset.alpha = True, 0.01
    g.path_offset.set(BASE, (0.005, 0.0, 0.0, 0.0, 0.0, 0.0))
    for _ in range(700):
        g.step(1.0)
    return g


def test_disabling_brakes_in_joint_space_and_the_arm_stays_beside_the_path(make):
    g = displaced_by_5_mm(make)
    start, speed = g.q, max(map(abs, g.qd))
    move = g.end_path_offset(4.0)
    cycles = 0
    while not move.returned:
        g.step(1.0)
        cycles += 1
    assert cycles == pytest.approx(speed / 4.0 / CYCLE, abs=2)
    assert np.abs(np.subtract(g.q, start)).max() == pytest.approx(speed**2 / 8.0, rel=0.1)
    g.step(1.0)
    assert not g.moving
    stands = g.T_base_tcp.position[0]
    assert stands - make().T_base_tcp.position[0] == pytest.approx(0.005, abs=1e-4)
    g.path_offset.enabled = True
    for _ in range(50):
        g.step(1.0)
    assert g.T_base_tcp.position[0] == stands  # what was wanted before does not count


def test_setpoints_begin_where_the_arm_is_and_are_not_displaced(make):
    g = displaced_by_5_mm(make)
    q = g.q
    for _ in range(300):
        g.servoj(q, 0.002, 0.05, 500.0)
        g.step(1.0)
    assert g.fault is None
    assert g.q == pytest.approx(q, abs=1e-4)


def test_a_program_that_ends_leaves_the_arm_where_it_comes_to_rest(make):
    g = displaced_by_5_mm(make)
    g.path_offset.end_of_program()
    for k in range(100):
        g.step(max(0.0, 1.0 - 0.02 * k))
    stands = g.q
    g.stop_at_once()
    for _ in range(5):
        g.step(1.0)
    assert g.q == stands
    assert not g.path_offset.is_active


def test_motion_that_stands_keeps_its_offset(make):
    g = displaced_by_5_mm(make)
    for k in range(100):
        g.step(max(0.0, 1.0 - 0.02 * k))  # a pause
    stands = g.q
    for _ in range(50):
        g.step(0.0)
    assert g.q == pytest.approx(stands, abs=1e-5)  # the filter ends
    assert g.path_offset.applied(BASE)[0] == pytest.approx(0.005, abs=1e-5)
