# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""``python -m ur_controller_sim``: the command ``ur-controller-sim``."""

import sys

from ur_cartesian_driver.sim.command_line import main

sys.exit(main())
