# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The robot's wire protocols: bytes to messages and back, one module for each interface.

Nothing here opens a socket, reads a clock or logs. A decoder's ``feed`` takes received bytes
(``b''`` is the end of the stream) and returns messages; messages to send become bytes. The robot's
own interfaces have both ends here, because the simulated controller is the other end. ``program``
has the driver's end alone; the other one is the robot program.
"""
