# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""RTDE (30004): packages, fields and the handshake, for client and controller."""
