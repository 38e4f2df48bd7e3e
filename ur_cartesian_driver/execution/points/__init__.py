# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Execution by streamed points: the first ones, appended ones, and how far ahead they are sent."""
