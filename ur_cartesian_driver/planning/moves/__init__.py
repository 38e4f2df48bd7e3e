# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""PRIMITIVES goals: the geometry, timing, reference path and report of each motion command."""
