# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""What the owner of a driver and its robot loop exchange: configuration, messages, robot state."""
