# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Runs a command-line tool: signals end it like Ctrl-C, and an error is printed as one line."""

from __future__ import annotations

import argparse
from collections.abc import Callable
import contextlib
import logging
import os
import signal
import sys
from types import FrameType

from ur_cartesian_driver.motion.errors import DriverError

#: The exit status of a command ended by a signal is this plus the signal's number, as in a shell.
SIGNAL_STATUS = 128


def run_command(
    name: str, run: Callable[[argparse.Namespace], int], arguments: argparse.Namespace
) -> int:
    """Run a command and return its exit status; 0 means that it succeeded."""
    logging.basicConfig(level=logging.WARNING, format='%(levelname)s: %(message)s')
    # Shells start background processes with SIGINT ignored; undo that. SIGHUP and SIGTERM stay
    # ignored if they are, as under nohup.
    signal.signal(signal.SIGINT, signal.default_int_handler)
    ended_by = signal.SIGINT

    def end(number: int, frame: FrameType | None) -> None:
        """Act like Ctrl-C: within asyncio.run(), cancel the main task."""
        nonlocal ended_by
        ended_by = signal.Signals(number)
        interrupt = signal.getsignal(signal.SIGINT)
        assert callable(interrupt)
        interrupt(number, frame)

    for number in (signal.SIGTERM, signal.SIGHUP):
        if signal.getsignal(number) != signal.SIG_IGN:
            signal.signal(number, end)
    try:
        status = run(arguments)
        sys.stdout.flush()
        return status
    except KeyboardInterrupt as interrupt:
        return SIGNAL_STATUS + (interrupt.args[0] if interrupt.args else ended_by)
    except EOFError:
        print(f'{name}: the input ended before the answer', file=sys.stderr)
        return 1
    except (DriverError, OSError, ValueError) as error:
        _discard_unwritten_output()
        notes = getattr(error, '__notes__', ())
        is_output_closed = isinstance(error, BrokenPipeError)
        if notes or not is_output_closed:  # `| head` closes it on purpose
            with contextlib.suppress(OSError):
                print(f'{name}: {"; ".join([_sentence(error), *notes])}', file=sys.stderr)
        return SIGNAL_STATUS + signal.SIGPIPE if is_output_closed else 1


def _sentence(error: Exception) -> str:
    """Return the text of an error; for a system error, its file and its text without a number."""
    if isinstance(error, OSError) and error.filename and error.strerror:
        return f'{error.filename}: {error.strerror}'
    return str(error)


def _discard_unwritten_output() -> None:
    """Discard output that cannot be written; otherwise Python would try again when it exits."""
    try:
        sys.stdout.flush()
    except OSError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
