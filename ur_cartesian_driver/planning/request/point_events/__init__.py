# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Events at the points of a goal: a module for each kind, and a row in the registry."""
