# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Bodies that the tool can touch, and the tool's motion against them."""
