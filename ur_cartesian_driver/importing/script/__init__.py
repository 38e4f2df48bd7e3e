# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""URScript programs: their layout, the treatment of each function, and the collected moves."""
