# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Write ``config/driver.yaml``: each parameter with its description, choices and default.

A test compares the file with the declarations; this script brings it up to date::

    python scripts/make_parameter_file.py
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
import textwrap

import yaml

from ur_cartesian_driver.ros.parameters.node_parameters import defaults
from ur_cartesian_driver.ros.parameters.parameter_table import ParameterDeclaration, SECTIONS

FILE = Path(__file__).resolve().parents[1] / 'config' / 'driver.yaml'

_WRAPPER = textwrap.TextWrapper(93, break_on_hyphens=False)
_HEAD = """\
# All parameters of the node ur_cartesian_driver, with their defaults.
# ros2 run ur_cartesian_driver driver --ros-args --params-file driver.yaml
# `ros2 param describe /ur_cartesian_driver NAME` explains a parameter too.

/**:
  ros__parameters:
"""


def text() -> str:
    """Return the text of the file."""
    return _HEAD + '\n'.join(_lines())


def _lines() -> Iterator[str]:
    values = defaults()
    for title, declarations in SECTIONS.items():
        yield f'    # --- {title} {"-" * (87 - len(title))}\n'
        for declaration in declarations:
            for paragraph in _remark(declaration).splitlines():
                yield from (f'    # {line}' for line in _WRAPPER.wrap(paragraph))
            value, *_ = yaml.safe_dump(
                values[declaration.name], default_flow_style=True
            ).splitlines()
            yield f'    {declaration.name}: {value}'
        yield ''


def _remark(declaration: ParameterDeclaration) -> str:
    if not declaration.choices:
        return declaration.description
    return f'{declaration.description} One of: {", ".join(declaration.choices)}.'


if __name__ == '__main__':
    FILE.write_text(text(), encoding='utf-8')
