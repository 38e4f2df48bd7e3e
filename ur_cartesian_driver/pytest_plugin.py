# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Fixtures for the tests of our users; pytest loads this wherever the package is installed."""
