# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The vocabulary: poses, goals, primitives, plans, robot states, events and errors."""
