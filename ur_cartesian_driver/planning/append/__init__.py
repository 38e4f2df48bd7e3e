# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Goals that stay open for more points (keep_open): what can be appended, and its plan."""
