# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""What to do next: pure state machines, fed with events and the time, answering with commands."""
