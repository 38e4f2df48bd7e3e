# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Goals whose points go to the robot program: at once, appended, or with a displaced path."""
