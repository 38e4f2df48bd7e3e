# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Progress of work that takes longer than a second, on standard error and only on terminals."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
import threading

from tqdm import tqdm

#: Time after which progress is shown [s].
DELAY = 1.0
_PERIOD = 0.2


@contextmanager
def counted(what: str, total: int) -> Iterator[Callable[[], object]]:
    """Show a progress bar; the caller calls the yielded function after each part."""
    with tqdm(
        desc=what, total=total, delay=DELAY, disable=None, leave=False, mininterval=0.1
    ) as bar:
        yield bar.update


@contextmanager
def timed(what: str) -> Iterator[None]:
    """Show the elapsed time of work that cannot be counted in parts."""
    with tqdm(
        desc=what, delay=DELAY, disable=None, leave=False, bar_format='{desc} {elapsed}'
    ) as bar:
        done = threading.Event()

        def show() -> None:
            wait = DELAY
            while not done.wait(wait):
                bar.refresh()
                wait = _PERIOD

        showing = threading.Thread(target=show, name='progress', daemon=True)
        if not bar.disable:
            showing.start()
        try:
            yield
        finally:
            done.set()
            if not bar.disable:
                showing.join()
