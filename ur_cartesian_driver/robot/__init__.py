# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The wires: the only sockets of the driver, and what keeps them up."""
