# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The tracker of the path, and checks: tolerances, speed, standstill, presses."""
