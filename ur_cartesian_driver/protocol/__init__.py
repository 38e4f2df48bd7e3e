# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The robot's wire protocols: bytes to messages and back, one module for each interface.

Nothing here opens a socket, reads a clock or logs. A decoder's ``feed`` takes received bytes
(``b''`` is the end of the stream) and returns messages; messages to send become bytes. Both ends
of every connection are covered, because the simulated controller is the other end.
"""
