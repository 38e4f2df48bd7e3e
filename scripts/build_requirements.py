# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Print the requirements of the build, a line for each: pip and uv read no list of them alone."""

from pathlib import Path
import sys
import tomllib

PROJECT = Path(__file__).resolve().parents[1] / 'pyproject.toml'

if __name__ == '__main__':
    requires = tomllib.loads(PROJECT.read_text(encoding='utf-8'))['build-system']['requires']
    sys.stdout.writelines(f'{requirement}\n' for requirement in requires)
