# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Wait for what happens in other threads by polling, not by a sleep of a fixed time."""

from time import monotonic, sleep


def wait_for(condition, timeout=30.0, describe=lambda: ''):
    """Return when the condition holds, fail when it does not within the timeout [s]."""
    end = monotonic() + timeout
    while not condition():
        assert monotonic() < end, f'waited {timeout:g} s in vain; {describe()}'
        sleep(0.005)
