# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""One goal: its job, its table of states, its machine, and the monitor that compares robot and plan."""
