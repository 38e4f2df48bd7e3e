# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Programs of the pendant: their tree, their files (.urp), and the URCap External Control."""
