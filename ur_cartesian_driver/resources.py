# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Where the files are that belong to the package and are not Python: config/, launch/, msg/."""

import os
from pathlib import Path
import sys

NAME = 'ur_cartesian_driver'


def share_path() -> Path:
    """
    Return the directory that holds config/, launch/, msg/, srv/, action/ and package.xml.

    That is the checkout, where the modules are used from one (an editable install, colcon's
    --symlink-install), so that an edited file counts at once; else share/ of the ROS
    installation or of the pip environment.
    """
    checkout = Path(__file__).resolve().parents[1]
    if (checkout / 'package.xml').is_file():
        return checkout
    # The wheels of ROS 2 do not set AMENT_PREFIX_PATH; without it there is no index to ask.
    for prefix in [
        *filter(None, os.environ.get('AMENT_PREFIX_PATH', '').split(os.pathsep)),
        sys.prefix,
    ]:
        share = Path(prefix, 'share', NAME)
        if (share / 'package.xml').is_file():
            return share
    raise FileNotFoundError(
        f'The data files of {NAME} are not installed: there is no share/{NAME}/package.xml in '
        f'AMENT_PREFIX_PATH or {sys.prefix}. Build the package with colcon or install it by pip.'
    )
