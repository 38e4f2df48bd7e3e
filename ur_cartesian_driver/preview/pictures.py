# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Pictures in files, drawn by matplotlib, which the package does not require."""

from __future__ import annotations

from pathlib import Path
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


def check_suffix(picture: Path) -> None:
    """
    Refuse a picture in a format that matplotlib does not write; without a suffix it writes PNG.

    :raises OSError: matplotlib is not installed.
    :raises ValueError: the suffix belongs to another format.
    """
    formats = pyplot().Figure().canvas.get_supported_filetypes()
    if picture.suffix and picture.suffix[1:].lower() not in formats:
        raise ValueError(
            f'{picture} has the suffix {picture.suffix!r}, but a picture is written as '
            f'{", ".join(formats)}'
        )
