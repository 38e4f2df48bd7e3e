# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Bring ``config/driver.yaml`` up to date: each parameter's description, values and default.

Only the file has the sections and the order of the parameters. So write a new parameter into its
section as ``NAME:``, and this script adds the rest::

    python scripts/make_parameter_file.py

A test compares the file with the declarations.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
import re
import textwrap

import yaml

from ur_cartesian_driver.ros.parameters.parameter_table import DECLARATIONS, ParameterDeclaration

FILE = Path(__file__).resolve().parents[1] / 'config' / 'driver.yaml'

_WRAPPER = textwrap.TextWrapper(93, break_on_hyphens=False)
_KEPT, _NAME = re.compile(r'#|/|  ros__|    # ---|$'), re.compile(r'    (\w+):')


def text() -> str:
    """Return the text of the file."""
    lines = FILE.read_text(encoding='utf-8').splitlines()
    return ''.join(f'{line}\n' for each in lines for line in _renewed(each))


def _renewed(line: str) -> Iterator[str]:
    """Yield a line as it is, or a parameter with new comments; drop old comments."""
    if _KEPT.match(line):
        yield line
    elif found := _NAME.match(line):
        for each in DECLARATIONS:
            if each.name == found[1]:  # nothing if the parameter no longer exists
                yield from _lines(each)


def _lines(declaration: ParameterDeclaration) -> Iterator[str]:
    remark = declaration.description
    if values := declaration.values:
        remark += f' {values[0].upper()}{values[1:]}.'
    for paragraph in remark.splitlines():
        yield from (f'    # {line}' for line in _WRAPPER.wrap(paragraph))
    value, *_ = yaml.safe_dump(declaration.default, default_flow_style=True).splitlines()
    yield f'    {declaration.name}: {value}'


if __name__ == '__main__':
    FILE.write_text(text(), encoding='utf-8')
