# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Compiled programs and lines, run in threads, one controller cycle at a time."""
