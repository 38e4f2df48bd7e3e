# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The cell: the bodies around the arm, on its links and in its hand."""
