# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Refuse an environment with a package or a version that requirements.lock does not name.

Run it with the Python of that environment: ``.venv/bin/python scripts/check_lock.py``.
"""

from importlib.metadata import distributions
from pathlib import Path
import re
import sys

LOCK = Path(__file__).resolve().parents[1] / 'requirements.lock'
#: Our own packages.
OWN = {'ur-cartesian-driver', 'ur-controller-sim'}


def normalized(name: str) -> str:
    """Return a name as the lock has it: https://packaging.python.org/specifications/name-normalization."""
    return re.sub(r'[-_.]+', '-', name).lower()


def locked() -> set[tuple[str, str]]:
    """Return names and versions; a package can have several, for different versions of Python."""
    return set(re.findall(r'^([\w.-]+)==(\S+)', LOCK.read_text(encoding='utf-8'), re.MULTILINE))


def main() -> None:
    """Compare, and exit with the packages that are not in the lock."""
    installed = {
        (normalized(found.name), found.version)
        for found in distributions()
        if found.read_text('RECORD')  # some distributions in the wheels of ROS have none
    }
    others = sorted(
        f'{name} {version}' for name, version in installed - locked() if name not in OWN
    )
    if others:
        sys.exit(f'{sys.prefix} has what requirements.lock does not name: {", ".join(others)}.')
    sys.stdout.write(f'{sys.prefix}: {len(installed)} packages, each as in requirements.lock.\n')


if __name__ == '__main__':
    main()
