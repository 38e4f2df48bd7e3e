# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The exchange between a driver's owner and its robot loop: configuration, messages, state."""
