# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Print the build requirements, one a line, because pip and uv cannot install only these."""

from pathlib import Path
import sys
import tomllib

PROJECT = Path(__file__).resolve().parents[1] / 'pyproject.toml'

if __name__ == '__main__':
    requires = tomllib.loads(PROJECT.read_text(encoding='utf-8'))['build-system']['requires']
    sys.stdout.writelines(f'{requirement}\n' for requirement in requires)
