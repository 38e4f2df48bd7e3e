# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""G-code as goals: its codes, their grammar, and the machine that executes them."""
