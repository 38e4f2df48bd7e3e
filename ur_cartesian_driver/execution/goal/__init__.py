# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""One goal: its job, its states, its machine, its feeder, and the monitor of its motion."""
