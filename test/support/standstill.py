# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Repeats failed tests with deadlines after a standstill of the computer.

A virtual machine may get no processor for seconds. With two processors, robot, driver and several
tests may leave one of the processes without any. Even generous timeouts then pass, and a test
fails without a defect. A test runs once more only if its own process stood still, or if a driver
in it reports that its robot loop was silent for 5 s or ended. The summary counts it as rerun.
"""

import logging
from threading import Thread
from time import monotonic, sleep

from overlap import rank
import pytest

STEP = 0.02  # [s]
#: As long as the shortest deadlines of the driver [s].
LIMIT = 0.2
#: Words of a driver, in a result or its log, after its robot loop sent nothing for 5 s (ten
#: heartbeats).
SILENT_LOOP = 'robot loop ended unexpectedly'


class Standstill(logging.Handler):
    """A pytest plugin that marks the tests that wait for a clock, and measures standstills."""

    def __init__(self) -> None:
        super().__init__()
        self.longest, self.loop_was_silent = 0.0, False
        logging.getLogger('ur_cartesian_driver').addHandler(self)
        Thread(target=self._watch, name='standstill', daemon=True).start()

    def __call__(self, error: BaseException) -> bool:
        """Return whether a failed test runs again; called by pytest-rerunfailures."""
        return bool(self) or SILENT_LOOP in str(error).lower()

    def __bool__(self) -> bool:
        """Return the same for any error; called by older versions of the plugin."""
        return self.longest > LIMIT or self.loop_was_silent

    def emit(self, record: logging.LogRecord) -> None:
        """Check a log record of a driver."""
        self.loop_was_silent |= SILENT_LOOP in record.getMessage().lower()

    def pytest_collection_modifyitems(self, items: list[pytest.Item]) -> None:
        again = pytest.mark.flaky(reruns=1, condition=self)
        for item in items:
            if rank(item.nodeid) < 0:
                item.add_marker(again)

    def pytest_runtest_logstart(self) -> None:
        self.longest, self.loop_was_silent = 0.0, False

    def _watch(self) -> None:
        while True:
            asleep = monotonic()
            sleep(STEP)
            self.longest = max(self.longest, monotonic() - asleep - STEP)
