# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The laws of motion that recordings of real arms show, seen by a client of the real-time interface.

The client knows nothing of this package: it sends programs and compares the targets in the packets
with closed formulas. Their sources: doc/simulation.md.
"""

from __future__ import annotations

from itertools import pairwise
from math import radians, sqrt

from plain_clients import PlainPrimary, PlainRealtime
import pytest
from robot_ports import FREE

from ur_cartesian_driver.sim import SimulatedRobot, SimulatorConfig

CYCLE = 0.002
#: The first motion of a program sets out within this time, and arrives later by half of it [s]:
#: the rate of the path's time grows once a cycle, as recorded moves show within 1e-12 rad.
START = 0.16
LATE = 0.5 * (START - CYCLE)


@pytest.fixture(scope='module')
def robot():
    """Run a robot twice as fast as time."""
    with SimulatedRobot(SimulatorConfig(**FREE, rate=2.0)) as robot:
        yield robot


@pytest.fixture
def realtime(robot):
    with PlainRealtime(robot.config.host, robot.ports.realtime) as client:
        client.socket.sendall(b'def home():\n  set_pos([0, -1.57, 1.57, -1.57, -1.57, 0])\nend\n')
        while client.next().q != (0.0, -1.57, 1.57, -1.57, -1.57, 0.0):
            pass
        yield client


def script(*lines):
    """Return a program that moves when the client has read what came before."""
    return 'def motion():\n  sleep(0.2)\n' + ''.join(f'  {line}\n' for line in lines) + 'end\n'


def trapezoid(length, a, v):
    """Return the time of a trapezoid from rest to rest, and the way at a time."""
    if length * a < v * v:
        v = sqrt(length * a)
    whole = length / v + v / a

    def way(t):
        t = min(max(t, 0.0), whole)
        if t < v / a:
            return 0.5 * a * t * t
        if t > whole - v / a:
            return length - 0.5 * a * (whole - t) ** 2
        return v * (t - 0.5 * v / a)

    return whole, way


def started(t):
    """Return the time of a path since its program's first motion set out."""
    return 0.5 * t * (t + CYCLE) / START if t < START else t - LATE


def joint_ways(samples, joint=0):
    return [(s.time - samples[0].time, abs(s.q[joint] - samples[0].q[joint])) for s in samples]


def tool_ways(samples):
    first = samples[0]
    return [
        (
            s.time - first.time,
            sqrt(sum((a - b) ** 2 for a, b in zip(s.pose[:3], first.pose[:3], strict=True))),
        )
        for s in samples
    ]


def test_the_first_motion_of_a_program_sets_out_slowly_and_arrives_later(realtime):
    whole, way = trapezoid(1.0, radians(80.0), radians(60.0))
    samples = realtime.motion(script('movej([1, -1.57, 1.57, -1.57, -1.57, 0])'))
    for t, moved in joint_ways(samples):
        assert moved == pytest.approx(way(started(t)), abs=1e-8)
    assert samples[-2].time - samples[0].time == pytest.approx(whole + LATE, abs=CYCLE)


@pytest.mark.parametrize(
    ('asked', 'a', 'v'),
    [
        ('t=4', radians(80.0), radians(60.0)),
        ('a=3, v=0.5, t=4', 3.0, 0.5),
        ('a=1, v=3, t=4', 1.0, 3.0),
    ],
)
def test_a_time_stretches_the_trapezoid_of_speed_and_acceleration(realtime, asked, a, v):
    whole, way = trapezoid(1.0, a, v)
    samples = realtime.motion(script(f'movej([1, -1.57, 1.57, -1.57, -1.57, 0], {asked})'))
    for t, moved in joint_ways(samples):
        # Those left out are not the rounded ones of the manual, 1.4 rad/s^2 and 1.05 rad/s.
        assert moved == pytest.approx(way(started(t) * whole / 4.0), abs=1e-8)
    assert samples[-2].time - samples[0].time == pytest.approx(4.0 + LATE, abs=CYCLE)


def test_chained_moves_are_not_rounded_to_cycles(realtime):
    lengths = [0.1 + 0.0137 * i for i in range(9)]
    ways = [trapezoid(length, 1.3, 0.7)[0] for length in lengths]
    angle, lines = 0.0, []
    for i, length in enumerate(lengths):
        angle += length if i % 2 else -length
        lines.append(f'movej([{angle}, -1.57, 1.57, -1.57, -1.57, 0], a=1.3, v=0.7)')
    samples = realtime.motion(script(*lines))
    # Rounded each for itself they would take up to nine cycles longer.
    assert sum(-(-way // CYCLE) * CYCLE for way in ways) > sum(ways) + 3 * CYCLE
    assert samples[-2].time - samples[0].time == pytest.approx(sum(ways) + LATE, abs=1.5 * CYCLE)


def test_servoj_follows_a_set_point_that_runs_evenly_to_the_new_one(realtime):
    gain, lookahead, t = 300.0, 0.1, 0.1
    lines = [
        'i = 0',
        'while i < 10:',
        '  i = i + 1',
        '  servoj([0.02 * i, -1.57, 1.57, -1.57, -1.57, 0],',
    ]
    lines[-1] += f' t={t}, lookahead_time={lookahead}, gain={gain})'
    samples = realtime.motion(script(*lines, 'end'))
    law, qd = [0.0], 0.0
    for k in range(round(10 * t / CYCLE)):
        qd += CYCLE * gain * (0.02 * (k + 1) * CYCLE / t - law[-1] - lookahead * qd)
        law.append(law[-1] + CYCLE * qd)
    for time, moved in joint_ways(samples):
        if (k := round(time / CYCLE)) < len(law):
            assert moved == pytest.approx(law[k], abs=1e-9)


def test_a_line_turns_the_tool_at_four_times_its_speed_and_acceleration(realtime):
    turn = 'movel(pose_trans(get_target_tcp_pose(), p[0, 0, 0, 0, 0, 1.5708]), a=1, v=1)'
    samples = realtime.motion(script(turn))
    whole, way = trapezoid(1.5708, 4.0, 4.0)
    # Only wrist 3 turns the tool about its own axis.
    for t, moved in joint_ways(samples, joint=5):
        assert moved == pytest.approx(way(started(t)), abs=1e-8)
    assert samples[-2].time - samples[0].time == pytest.approx(whole + LATE, abs=CYCLE)


@pytest.mark.parametrize('v', [0.1, 0.25])
def test_a_stopped_program_slows_down_on_its_path_within_160_ms(robot, realtime, v):
    line = 'movel(pose_add(get_target_tcp_pose(), p[0, 0.6, 0, 0, 0, 0]), a=2, v='
    with PlainPrimary(robot.config.host, robot.ports.primary) as primary:
        realtime.socket.sendall(script(f'{line}{v})').encode())
        first = realtime.next()
        while (
            first.time == (now := realtime.next()).time or abs(now.pose[1] - first.pose[1]) < 0.05
        ):
            pass
        primary.send('stop program\n')
        samples = [now]
        while any(samples[-1].qd):
            samples.append(realtime.next())
    ways = tool_ways(samples)
    # The first sample after which it never again moves at full speed.
    slows = max(
        i for i, (a, b) in enumerate(pairwise(ways), 1) if b[1] - a[1] > 0.9999 * v * (b[0] - a[0])
    )
    braked = [b - a for a, b in zip(ways[slows], ways[-2], strict=True)]
    assert braked == pytest.approx([0.16, 0.08 * v], abs=1.5 * CYCLE)
    # Straight on: only y has changed.
    assert samples[-1].pose[0] == pytest.approx(first.pose[0], abs=1e-9)
    assert samples[-1].pose[2] == pytest.approx(first.pose[2], abs=1e-9)
