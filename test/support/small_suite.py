# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Run a few tests in a process and a folder of their own, with the settings of all tests."""

from collections.abc import Mapping
import os
from pathlib import Path
import subprocess
import sys

SUPPORT = Path(__file__).resolve().parent


def run_small_suite(
    folder: Path, modules: Mapping[str, str], *options: str
) -> subprocess.CompletedProcess[str]:
    """
    Run the tests, and return the ended process.

    :param modules: text of each test module, by its path in ``test/``.
    """
    for path, text in modules.items():
        module = folder / 'test' / path
        module.parent.mkdir(parents=True, exist_ok=True)
        module.write_text(text)
    (folder / 'test' / 'conftest.py').write_text((SUPPORT.parent / 'conftest.py').read_text())
    (folder / 'pytest.ini').write_text(f'[pytest]\npythonpath = {SUPPORT}\n')
    environment = {
        name: value for name, value in os.environ.items() if not name.startswith('PYTEST_')
    }
    return subprocess.run(
        [sys.executable, '-m', 'pytest', '-q', *options, 'test'],
        cwd=folder,
        env=environment,
        capture_output=True,
        text=True,
        timeout=60.0,
        check=False,
    )
