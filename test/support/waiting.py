# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Wait for events in other threads by polling, not by a sleep of a fixed time."""

from time import monotonic, sleep


def wait_for(condition, timeout=30.0, describe=lambda: ''):
    """Return when a condition holds; fail if it does not hold within the timeout [s]."""
    end = monotonic() + timeout
    while not condition():
        assert monotonic() < end, f'waited {timeout:g} s in vain; {describe()}'
        sleep(0.005)
