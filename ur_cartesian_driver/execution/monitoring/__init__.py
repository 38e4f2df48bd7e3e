# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""What the monitor of a goal measures with: path tracker, tolerance check, speed check."""
