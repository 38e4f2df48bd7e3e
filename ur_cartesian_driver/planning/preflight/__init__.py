# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""What the arm does along a path: joint solutions, singularity margins and clearance."""
