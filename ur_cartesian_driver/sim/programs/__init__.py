# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Programs of the simulated controller: upload, start, pause, stop, interpreter mode, watchdog."""
