# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Requests of an RTDE client, written by hand so that the codec does not test itself."""

import struct

VERSION_2 = struct.pack('>HBH', 5, ord('V'), 2)
START = struct.pack('>HB', 3, ord('S'))


def setup_outputs(*names, frequency=500.0):
    """Return the request for outputs, in the form of version 2."""
    payload = struct.pack('>d', frequency) + ','.join(names).encode()
    return struct.pack('>HB', 3 + len(payload), ord('O')) + payload
