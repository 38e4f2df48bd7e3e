# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The inverse of what the driver sends to the robot program: bytes back to messages."""

from __future__ import annotations

import struct

from ur_cartesian_driver.protocol.program.reverse import ControlMode, ReverseMessage


def decode_reverse(data: bytes) -> ReverseMessage:
    """Return the message that 32 bytes of the reverse socket encode."""
    timeout, a, b, c, d, e, f, mode = struct.unpack('>8i', data)
    return ReverseMessage(read_timeout=timeout, mode=ControlMode(mode), payload=(a, b, c, d, e, f))
