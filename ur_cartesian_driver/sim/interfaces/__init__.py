# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The ports of the simulated controller: one session or stream for each interface."""
