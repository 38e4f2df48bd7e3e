# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""How many records may be on their way to the robot."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(slots=True)
class SendWindow:
    """
    Hands out records so that at most ``size`` are sent and not yet begun.

    Everything that was sent has to be read and thrown away by the robot program when a goal is
    cancelled (10 points in each step of the controller), so what is in flight is bounded: 500
    points cost 0.1 s. It is also far more than the robot can run in its 0.5 s read timeout.
    """

    total: int
    size: int = 500
    sent: int = 0
    #: How many the robot has begun, as far as is known.
    begun: int = 0

    def release(self, begun: int) -> tuple[int, int]:
        """
        Return the range of records that may be sent now, ``(first, end)``, and count it as sent.

        :param begun: how many records the robot has begun.
        """
        first = self.sent
        self.sent = max(first, min(self.total, begun + self.size))
        return first, self.sent
