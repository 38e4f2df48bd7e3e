# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Pictures of motions, from the feedback to a client and from recordings."""
