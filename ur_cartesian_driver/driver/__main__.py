# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""``python -m ur_cartesian_driver.driver``: run the robot loop for a driver in another process."""

from ur_cartesian_driver.driver.loop.loop_host import main

main()
