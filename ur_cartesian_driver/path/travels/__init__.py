# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Travels through the air between paths, and the order of paths with the least travel."""
