# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Moves along paths: their geometry, their profiles, and the sequence in which they run."""
