# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The beginning of each command: Ctrl-C ends it without a traceback while its modules load.

Loading takes up to two seconds. Afterwards each command handles signals in its own way.
"""

from __future__ import annotations

import signal
import sys
from typing import NoReturn


def command_line() -> NoReturn:
    """Run ``ur-cartesian``."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    from ur_cartesian_driver.cli import main

    sys.exit(main())


def driver() -> NoReturn:
    """Run ``ur-cartesian-driver``."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    from ur_cartesian_driver.ros.node import main

    main()
    sys.exit(0)
