# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The geometry of paths: curves, blends, splines and samples."""
