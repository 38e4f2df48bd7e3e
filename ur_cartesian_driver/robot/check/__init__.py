# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""What a robot tells about itself, and experiments that settle what documents leave open."""
