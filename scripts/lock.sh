#!/usr/bin/env bash
# Renew requirements.lock: the newest versions that the ranges of setup.py, pyproject.toml and
# requirements-dev.txt admit, for each Python and platform. Without `--upgrade` what the lock has
# stays, and only new requirements are added.
#
#   scripts/lock.sh [--upgrade]
set -euo pipefail
cd "$(dirname "$0")/.."
bin=${VENV:-.venv}/bin
"$bin/python" scripts/build_requirements.py |
  "$bin/uv" pip compile --quiet --universal --python-version 3.11 --all-extras \
    --annotation-style line --custom-compile-command 'make lock' \
    --output-file requirements.lock "$@" setup.py requirements-dev.txt - >/dev/null
