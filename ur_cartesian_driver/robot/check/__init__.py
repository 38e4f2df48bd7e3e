# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Observations of a robot, and experiments on questions that the documents leave open."""
