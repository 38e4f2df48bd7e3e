# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The location of the data files of the package: config/, launch/, msg/ and others."""

import os
from pathlib import Path
import sys

NAME = 'ur_cartesian_driver'


def share_path() -> Path:
    """
    Return the directory that holds config/, launch/, msg/, srv/, action/ and package.xml.

    If the modules are used from a checkout (an editable install, colcon's --symlink-install), this
    is the checkout, so that an edited file takes effect at once. Otherwise it is share/NAME of the
    ROS installation or of the pip environment.

    :raises FileNotFoundError: the data files are not installed.
    """
    checkout = Path(__file__).resolve().parents[1]
    if (checkout / 'package.xml').is_file():
        return checkout
    if share := installed_share(NAME):
        return share
    raise FileNotFoundError(
        f'The data files of {NAME} are not installed: there is no share/{NAME}/package.xml in '
        f'AMENT_PREFIX_PATH or {sys.prefix}. Build the package with colcon or install it by pip.'
    )


def installed_share(package: str) -> Path | None:
    """Return share/PACKAGE of the ROS installation or pip environment; None if there is none."""
    # The wheels of ROS 2 do not set AMENT_PREFIX_PATH, so there may be no ament index.
    for prefix in [
        *filter(None, os.environ.get('AMENT_PREFIX_PATH', '').split(os.pathsep)),
        sys.prefix,
    ]:
        share = Path(prefix, 'share', package)
        if (share / 'package.xml').is_file():
            return share
    return None
