# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Execution of goals: pure state machines that turn events and the time into commands."""
