# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Client interfaces of the controller: primary and secondary (30001, 30002), real-time (30003)."""
