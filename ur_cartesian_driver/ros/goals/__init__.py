# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Goals: the action server, the run of each goal, and the arbiter of the arm."""
