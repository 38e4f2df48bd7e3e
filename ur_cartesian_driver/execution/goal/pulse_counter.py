# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The pulses of the robot program, found by its counters in a register."""

from __future__ import annotations

from collections.abc import Sequence

from ur_cartesian_driver.motion.events import Pulse
from ur_cartesian_driver.motion.goal.goal import OutputKind
from ur_cartesian_driver.motion.state.rtde_state import RobotState
from ur_cartesian_driver.protocol.program.registers import PULSE_COUNTS


class PulseCounter:
    """Finds the new pulses in each packet."""

    def __init__(self, outputs: Sequence[tuple[OutputKind, int]], packet: RobotState) -> None:
        """
        Begin to count.

        :param outputs: the outputs of the goal that give pulses, in the program's order.
        :param packet: the newest packet of the robot.
        """
        self._outputs = outputs
        self._register = packet.pulse_counts
        self._given = [0] * len(outputs)

    def observe(self, packet: RobotState) -> tuple[Pulse, ...]:
        """
        Return the new pulses in a packet, by output and in the order of their numbers.

        The newest pulse of each output has the time and pose of the packet. If packets were lost,
        earlier pulses of that output get the same time, and no pose.
        """
        before, self._register = self._register, packet.pulse_counts
        if before == packet.pulse_counts or not self._outputs:
            return ()
        pulses: list[Pulse] = []
        for slot, (output, pin) in enumerate(self._outputs):
            old, now = (register // PULSE_COUNTS**slot for register in (before, self._register))
            new = (now - old) % PULSE_COUNTS
            for left in reversed(range(new)):
                pulses.append(
                    Pulse(
                        output=output,
                        pin=pin,
                        number=self._given[slot],
                        timestamp=packet.timestamp,
                        pose=None if left else packet.actual_tcp_pose,
                    )
                )
                self._given[slot] += 1
        return tuple(pulses)
