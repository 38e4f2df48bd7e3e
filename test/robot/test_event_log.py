# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
from math import inf

from ur_cartesian_driver.motion.geometry.pose import IDENTITY
from ur_cartesian_driver.motion.state.rtde_state import (
    RobotMode,
    RobotState,
    RuntimeState,
    SafetyMode,
)
from ur_cartesian_driver.robot.connection_status import timestamped
from ur_cartesian_driver.robot.event_log import EventLog, MAX_AGE, MAX_ENTRIES, mode_changes

ZERO = (0.0,) * 6


def state(**fields):
    return RobotState(
        timestamp=0.0,
        actual_q=ZERO,
        target_q=ZERO,
        actual_tcp_pose=IDENTITY,
        target_tcp_pose=IDENTITY,
        **fields,
    )


class Keepalives:
    """Times of keepalives that a test sets."""

    last_keepalive, max_keepalive_gap = -inf, 0.0


class Scene:
    """An event log with a clock that a test sets."""

    def __init__(self):
        self.now, self.keepalives = 0.0, Keepalives()
        self.log = EventLog(lambda: self.now, self.keepalives, 0.2)

    def add(self, text, now, **kind):
        self.now = now
        self.log.note(text, **kind)

    def lines(self, now):
        self.now = now
        *lines, modes = self.log.event_chain()
        assert modes == 'the robot has reported nothing'
        return tuple(lines)

    def robot_error(self, now):
        self.now = now
        return self.log.robot_error()


def test_notes_stand_in_order_with_their_distance_in_time():
    scene = Scene()
    scene.add('first', 10.0)
    scene.add('second', 10.25)
    assert scene.lines(10.5) == ('0.500 s before: first', '0.250 s before: second')


def test_what_is_old_is_left_out():
    scene = Scene()
    scene.add('old', 0.0, is_robot_error=True)
    scene.add('new', MAX_AGE)
    assert scene.lines(MAX_AGE + 0.1) == ('0.100 s before: new',)
    assert scene.robot_error(MAX_AGE + 0.1) == ''


def test_the_newest_error_of_the_robot_counts_whatever_came_since():
    scene = Scene()
    for text in ('C1A0', 'C2A0'):
        scene.add(text, 1.0, is_robot_error=True)
    scene.add('reverse_port: the other side closed the connection', 1.1)
    assert scene.robot_error(1.2) == 'C2A0'


def test_a_flood_of_notes_is_bounded():
    scene = Scene()
    for i in range(1000):
        scene.add(f'{i}', 1.0)
    assert [line.rpartition(' ')[2] for line in scene.lines(1.0)] == [
        f'{i}' for i in range(1000 - MAX_ENTRIES, 1000)
    ]


def test_changes_are_named_by_their_modes():
    before = state(runtime_state=RuntimeState.PLAYING)
    after = state(
        runtime_state=RuntimeState.STOPPED,
        safety_mode=SafetyMode.FAULT,
        robot_mode=RobotMode.POWER_OFF,
    )
    assert mode_changes(before, after) == (
        f'safety mode {before.safety_mode.name} -> FAULT',
        f'robot mode {before.robot_mode.name} -> POWER_OFF',
        'program PLAYING -> STOPPED',
    )
    assert mode_changes(after, after) == ()


def test_what_holds_at_the_end():
    scene = Scene()
    assert scene.log.event_chain() == ('the robot has reported nothing',)
    scene.keepalives.last_keepalive, scene.keepalives.max_keepalive_gap = 9.989, 0.031
    scene.now = 10.0
    scene.log.note_report(state())
    scene.now = 10.002
    modes, keepalives = scene.log.event_chain()
    assert modes.endswith('as the robot reported 0.002 s before')
    assert keepalives == (
        'the last keepalive was sent to the robot program 0.013 s before (its timeout is 0.2 s; '
        'the longest pause between two was 0.031 s)'
    )


def test_the_same_error_keeps_its_time():
    first = '2026-01-02 03:04:05 UTC: nobody answers'
    assert timestamped('nobody answers', first) == first
    assert timestamped('somebody answers', first).endswith(' UTC: somebody answers')
