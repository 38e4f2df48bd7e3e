# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""``python -m ur_cartesian_driver.cli``: the command ``ur-cartesian``."""

import sys

from ur_cartesian_driver.cli import main

sys.exit(main())
