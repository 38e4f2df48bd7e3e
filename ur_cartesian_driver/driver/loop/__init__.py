# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The robot loop, in a process or thread of its own: sockets, and the running goal."""
