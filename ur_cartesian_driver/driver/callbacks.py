# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Call user code from a thread of the driver."""

from __future__ import annotations

from collections.abc import Callable
import logging
from typing import TypeVar

LOG = logging.getLogger('ur_cartesian_driver')

T = TypeVar('T')


def run_callback(callback: Callable[[T], None], argument: T, log: logging.Logger) -> None:
    """Call user code; log its exceptions, so that they do not end the thread."""
    try:
        callback(argument)
    except Exception as error:
        log.exception(
            'a callback of the driver failed with %s: %s; the driver goes on',
            type(error).__name__,
            error,
        )
