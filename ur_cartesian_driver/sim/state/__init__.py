# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""What the controller holds besides programs and motion: I/O, power, safety, payload, messages."""
