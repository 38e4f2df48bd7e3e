#!/usr/bin/env bash
# colcon on this repository, with the virtual environment as its ROS installation. Where a real
# one is sourced this is not needed, nor right: there it is plain `colcon build`.
#
#   scripts/colcon.sh build
#   scripts/colcon.sh test && scripts/colcon.sh test-result --verbose
set -euo pipefail
cd "$(dirname "$0")/.."
venv=${VENV:-.venv}
if [ ! -x "$venv/bin/colcon" ]; then
  printf 'colcon: no %s/bin/colcon; run scripts/setup.sh first.\n' "$venv" >&2
  exit 1
fi
venv=$(cd "$venv" && pwd)
unset _ROS_WHEELS_BOOTSTRAP_COMPLETE LD_LIBRARY_PATH PYTHONPATH PYTHONHOME
export AMENT_PREFIX_PATH=$venv CMAKE_PREFIX_PATH=$venv PATH=$venv/bin:$PATH
if [ "${1:-}" = build ]; then
  set -- "$@" --symlink-install --cmake-args "-DCMAKE_PROJECT_INCLUDE=$PWD/cmake/ros_wheels.cmake"
fi
exec colcon "$@"
