# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
from math import inf

from ur_cartesian_driver.motion.pose import IDENTITY
from ur_cartesian_driver.motion.state import RobotMode, RobotState, RuntimeState, SafetyMode
from ur_cartesian_driver.robot.driver_status import timestamped
from ur_cartesian_driver.robot.event_log import (
    describe_present,
    EventLog,
    LinkTiming,
    MAX_AGE,
    MAX_ENTRIES,
    mode_changes,
)

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


def test_notes_stand_in_order_with_their_distance_in_time():
    chronicle = EventLog()
    chronicle.add('first', 10.0)
    chronicle.add('second', 10.25)
    assert chronicle.lines(10.5) == ('0.500 s before: first', '0.250 s before: second')


def test_what_is_old_is_left_out():
    chronicle = EventLog()
    chronicle.add('old', 0.0, is_robot_error=True)
    chronicle.add('new', MAX_AGE)
    assert chronicle.lines(MAX_AGE + 0.1) == ('0.100 s before: new',)
    assert chronicle.robot_error(MAX_AGE + 0.1) == ''


def test_the_newest_error_of_the_robot_counts_whatever_came_since():
    chronicle = EventLog()
    for text in ('C1A0', 'C2A0'):
        chronicle.add(text, 1.0, is_robot_error=True)
    chronicle.add('reverse_port: the other side closed the connection', 1.1)
    assert chronicle.robot_error(1.2) == 'C2A0'


def test_a_flood_of_notes_is_bounded():
    chronicle = EventLog()
    for i in range(1000):
        chronicle.add(f'{i}', 1.0)
    assert [line.rpartition(' ')[2] for line in chronicle.lines(1.0)] == [
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
    timing = LinkTiming(report=0.002, keepalive=0.013, max_gap=0.031, timeout=0.2)
    modes, beat = describe_present(state(), timing)
    assert modes.endswith('as the robot reported 0.002 s before')
    assert beat == (
        'the last sign of life for the robot program was sent 0.013 s before (it '
        'waits 0.2 s for one, the longest pause between two was 0.031 s)'
    )
    assert describe_present(
        None, LinkTiming(report=inf, keepalive=inf, max_gap=0.0, timeout=0.2)
    ) == ('the robot has reported nothing',)


def test_the_same_error_keeps_its_time():
    first = '2026-01-02 03:04:05 UTC: nobody answers'
    assert timestamped('nobody answers', first) == first
    assert timestamped('somebody answers', first).endswith(' UTC: somebody answers')
