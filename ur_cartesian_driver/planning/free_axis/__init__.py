# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Goals whose tool may turn about an axis of its own: choose the rotation along the path."""
