# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The arm along a path: joint solutions, singularity margins and clearance."""
