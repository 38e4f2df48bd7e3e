# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The robot program: its sockets, its first start, and the temporary TCP it sets."""
