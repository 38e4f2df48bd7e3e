# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Pictures in files, drawn by matplotlib, which the package does not require."""

from __future__ import annotations

from typing import Any


def pyplot() -> Any:
    """
    Return matplotlib's ``pyplot``, set to draw files without a display.

    :raises OSError: matplotlib is not installed.
    """
    try:
        import matplotlib
    except ImportError:
        raise OSError('no picture without matplotlib; install it (extra `plot`)') from None
    matplotlib.use('Agg')
    from matplotlib import pyplot as plt

    return plt
