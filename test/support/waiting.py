# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""How tests wait for what happens in other threads: they look, they do not sleep and hope."""

from time import monotonic, sleep


def wait_for(condition, timeout=5.0, how_it_stands=lambda: ''):
    """Return when the condition holds, fail when it does not within the timeout [s]."""
    end = monotonic() + timeout
    while not condition():
        assert monotonic() < end, f'waited {timeout:g} s in vain; {how_it_stands()}'
        sleep(0.005)
