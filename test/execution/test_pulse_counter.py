# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Which pulses are new in a packet."""

from ur_cartesian_driver.execution.goal.pulse_counter import PulseCounter
from ur_cartesian_driver.motion.geometry.pose import Pose
from ur_cartesian_driver.motion.goal.goal import OutputKind
from ur_cartesian_driver.motion.state.rtde_state import RobotState

HOME = (0.0, -1.5, 1.5, -1.5, -1.5, 0.0)
CAMERA, PROBE = (OutputKind.STANDARD_DIGITAL, 2), (OutputKind.TOOL_DIGITAL, 0)


def packet(counts, time=0.0):
    return RobotState(
        timestamp=time,
        actual_q=HOME,
        actual_tcp_pose=Pose((time, 0.0, 0.0)),
        pulse_counts=counts[0] + 128 * counts[1],
    )


def test_the_counts_of_earlier_goals_do_not_count():
    counter = PulseCounter([CAMERA, PROBE], packet((5, 9)))
    assert counter.observe(packet((5, 9))) == ()
    (pulse,) = counter.observe(packet((5, 10), 0.1))
    assert (pulse.output, pulse.pin, pulse.number, pulse.timestamp) == (*PROBE, 0, 0.1)
    assert pulse.pose.position == (0.1, 0.0, 0.0)


def test_counts_wrap_around_and_outputs_do_not_mix():
    counter = PulseCounter([CAMERA, PROBE], packet((127, 127)))
    found = counter.observe(packet((0, 0)))
    assert [(each.output, each.pin, each.number) for each in found] == [(*CAMERA, 0), (*PROBE, 0)]
    assert [each.number for each in counter.observe(packet((1, 0)))] == [1]


def test_a_pulse_whose_packet_was_lost_has_a_number_but_no_pose():
    counter = PulseCounter([CAMERA], packet((0, 0)))
    found = counter.observe(packet((3, 0), 0.2))
    assert [(each.number, each.pose is None) for each in found] == [
        (0, True),
        (1, True),
        (2, False),
    ]


def test_a_goal_without_pulses_counts_none():
    assert PulseCounter([], packet((0, 0))).observe(packet((1, 0))) == ()
