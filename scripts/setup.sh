#!/usr/bin/env bash
# Make, or bring up to date, a virtual environment with ROS 2 Jazzy from PyPI, the tools for
# developers, and this package as an editable install. Changed Python modules count at once; run
# this again after a change of an interface (msg/, srv/, action/) or of the build (make does).
#
#   scripts/setup.sh
#   PYTHON=python3.12 VENV=.venv312 scripts/setup.sh
#   NEWEST=1 scripts/setup.sh     the newest versions, not those of requirements.lock
set -euo pipefail
cd "$(dirname "$0")/.."
venv=${VENV:-.venv}

fail() { printf 'setup: %s\n' "$*" >&2; exit 1; }

# What an activated or running other environment may have left behind; a Python of the ROS wheels
# passes on that it has set the library path, and another one would then do without.
unset _ROS_WHEELS_BOOTSTRAP_COMPLETE LD_LIBRARY_PATH PYTHONPATH PYTHONHOME
unset AMENT_PREFIX_PATH CMAKE_PREFIX_PATH

version() { "$1" -c 'import sys; print("%d.%d" % sys.version_info[:2])' 2>/dev/null || true; }
is_supported() { case $(version "$1") in 3.11 | 3.12) ;; *) return 1 ;; esac; }

find_python() {
  local candidate
  if [ -n "${PYTHON:-}" ]; then
    is_supported "$PYTHON" || fail "PYTHON=$PYTHON does not run, or is not 3.11 or 3.12."
    echo "$PYTHON"
    return
  fi
  for candidate in python3.11 python3.12 python3; do
    if is_supported "$candidate"; then echo "$candidate"; return; fi
  done
  fail "no Python 3.11 or 3.12 found (looked for python3.11, python3.12, python3). Install one," \
    "or name it: PYTHON=/path/to/python3.12 make setup."
}

if ! is_supported "$venv/bin/python" ||
    [ "$(version "${PYTHON:-$venv/bin/python}")" != "$(version "$venv/bin/python")" ]; then
  python=$(find_python)
  rm -rf "$venv"
  "$python" -m venv "$venv" ||
    fail "$python could not make $venv. On Debian and Ubuntu its package python3-venv is needed."
fi
venv=$(cd "$venv" && pwd)
python=$venv/bin/python
for tool in cc c++ make; do
  command -v "$tool" >/dev/null ||
    fail "no $tool: a C and C++ compiler and make are needed (apt install build-essential)."
done
"$python" -c 'import pathlib, sysconfig as s, sys
sys.exit(not pathlib.Path(s.get_path("include"), "Python.h").exists())' ||
  fail "Python.h is missing: install the development files of $("$python" -V) (python3-dev)."

lock=(--constraint requirements.lock)
[ -z "${NEWEST:-}" ] || lock=(--upgrade)
"$python" -m uv --version >/dev/null 2>&1 ||
  "$python" -m pip install --quiet --disable-pip-version-check "${lock[@]}" 'uv>=0.5,<1'
install() { "$venv/bin/uv" pip install --quiet --python "$python" "${lock[@]}" "$@"; }

# One description of what the build needs: the same list serves `pip install .`.
"$python" scripts/build_requirements.py |
  install --requirement requirements-dev.txt --requirement -
PATH=$venv/bin:$PATH install --no-build-isolation --editable '.[collision,export,plot,show,test]'
