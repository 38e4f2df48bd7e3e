# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Faults that a test injects: their values, their text form and their injector."""
