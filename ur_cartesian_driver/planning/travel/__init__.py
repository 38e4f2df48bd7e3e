# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Travels: paths of the arm through the air, found between two configurations."""
