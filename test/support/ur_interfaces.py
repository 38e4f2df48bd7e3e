# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The message packages of the UR ROS 2 driver, which are not on PyPI.

Missing packages are built from ``test/interfaces``, which has the same fields, once for each
change of these files. They are kept below ``build/``, outside of the environment.
"""

from collections.abc import Iterator, Mapping
import contextlib
import ctypes
import fcntl
from hashlib import sha256
import importlib
from importlib.util import find_spec
import os
from pathlib import Path
import shutil
import subprocess
import sys
from types import ModuleType

from checkout import CHECKOUT

DEFINITIONS = CHECKOUT / 'test' / 'interfaces'
ROS_WHEELS = CHECKOUT / 'cmake' / 'ros_wheels.cmake'
BUILD = CHECKOUT / 'build' / f'test-interfaces-{sys.implementation.cache_tag}'

_COMMON = ('action_msgs', 'builtin_interfaces', 'geometry_msgs', 'std_msgs')
#: The dependencies of each package; the packages are in the order of building.
DEPENDENCIES: Mapping[str, tuple[str, ...]] = {
    'trajectory_msgs': _COMMON,
    'control_msgs': (*_COMMON, 'trajectory_msgs'),
    'ur_msgs': (*_COMMON, 'trajectory_msgs', 'control_msgs'),
    'ur_dashboard_msgs': _COMMON,
}

_PACKAGE_XML = """<package format="3">
  <name>{package}</name>
  <version>0.0.0</version>
  <description>The fields of {package}, for tests.</description>
  <maintainer email="nobody@example.invalid">nobody</maintainer>
  <license>Apache-2.0</license>
  <buildtool_depend>rosidl_default_generators</buildtool_depend>
  {dependencies}
  <member_of_group>rosidl_interface_packages</member_of_group>
  <export><build_type>ament_cmake</build_type></export>
</package>
"""


class CannotBuild(Exception):
    """The packages cannot be built: there is no CMake or no checkout."""


def built_interfaces() -> Path | None:
    """
    Return the prefix with the missing packages; None = all are installed.

    :raises CannotBuild: some are missing, and there is no CMake or no checkout.
    """
    missing = [package for package in DEPENDENCIES if find_spec(package) is None]
    if not missing:
        return None
    if not ROS_WHEELS.is_file() or shutil.which('cmake', path=_search_path()) is None:
        raise CannotBuild(f'{", ".join(missing)} cannot be built here.')
    BUILD.mkdir(parents=True, exist_ok=True)
    prefix, stamp = BUILD / 'prefix', BUILD / 'stamp'
    digest = _digest(missing)
    with BUILD.joinpath('lock').open('w') as lock:  # for tests that run at the same time
        fcntl.flock(lock, fcntl.LOCK_EX)
        if not stamp.exists() or stamp.read_text() != digest:
            for folder in ('prefix', 'source', 'cmake'):
                shutil.rmtree(BUILD / folder, ignore_errors=True)
            for package in missing:
                _build(package, prefix)
            stamp.write_text(digest)
    return prefix


def environment(prefix: Path) -> dict[str, str]:
    """Return the environment of processes that use the packages."""
    packages = next(prefix.glob('lib/python*/site-packages'))
    paths = {
        'AMENT_PREFIX_PATH': prefix,
        'LD_LIBRARY_PATH': prefix / 'lib',
        'PYTHONPATH': packages,
    }
    return {
        **os.environ,
        **{name: _joined(path, os.environ.get(name)) for name, path in paths.items()},
    }


@contextlib.contextmanager
def importable(prefix: Path | None) -> Iterator[None]:
    """Make the packages importable in this process; afterwards they are missing again."""
    if prefix is None:
        yield
        return
    # ROS loads these libraries by name, and the search path of a running process is fixed.
    for kind in ('fastrtps', 'introspection'):
        for library in prefix.glob(f'lib/*__rosidl_typesupport_{kind}_c.so'):
            ctypes.CDLL(str(library))
    packages = str(next(prefix.glob('lib/python*/site-packages')))
    sys.path.insert(0, packages)
    sys.modules.update(_imported)
    importlib.invalidate_caches()
    try:
        yield
    finally:
        sys.path.remove(packages)
        for name in [name for name in sys.modules if name.split('.')[0] in DEPENDENCIES]:
            # Their extension modules can be loaded only once.
            _imported[name] = sys.modules.pop(name)


#: The modules imported so far.
_imported: dict[str, ModuleType] = {}


def _search_path() -> str:
    return _joined(Path(sys.prefix, 'bin'), os.environ.get('PATH'))


def _joined(path: Path, others: str | None) -> str:
    return str(path) if not others else f'{path}{os.pathsep}{others}'


def _digest(packages: list[str]) -> str:
    digest = sha256(repr((sys.prefix, packages)).encode())
    for path in sorted(path for path in DEFINITIONS.rglob('*') if path.is_file()):
        digest.update(str(path.relative_to(DEFINITIONS)).encode() + path.read_bytes())
    return digest.hexdigest()


def _build(package: str, prefix: Path) -> None:
    source, build = BUILD / 'source' / package, BUILD / 'cmake' / package
    shutil.copytree(DEFINITIONS / package, source)
    shutil.copy(DEFINITIONS / 'CMakeLists.txt', source)
    dependencies = DEPENDENCIES[package]
    source.joinpath('package.xml').write_text(
        _PACKAGE_XML.format(
            package=package,
            dependencies='\n  '.join(f'<depend>{name}</depend>' for name in dependencies),
        )
    )
    prefixes = _joined(prefix, os.environ.get('AMENT_PREFIX_PATH') or sys.prefix)
    run_environment = {
        **os.environ,
        'AMENT_PREFIX_PATH': prefixes,
        'CMAKE_PREFIX_PATH': prefixes,
        'PATH': _search_path(),
    }
    configure = [
        'cmake',
        '-S',
        str(source),
        '-B',
        str(build),
        f'-DPACKAGE={package}',
        f'-DDEPENDENCIES={";".join(dependencies)}',
        f'-DCMAKE_INSTALL_PREFIX={prefix}',
        f'-DCMAKE_PROJECT_INCLUDE={ROS_WHEELS}',
        f'-DPython3_EXECUTABLE={sys.executable}',
        '-DCMAKE_BUILD_TYPE=None',
        '-DBUILD_TESTING=OFF',
    ]
    for command in (
        configure,
        ['cmake', '--build', str(build), '--parallel', str(os.cpu_count())],
        ['cmake', '--install', str(build)],
    ):
        done = subprocess.run(
            command, env=run_environment, check=False, capture_output=True, text=True
        )
        if done.returncode:
            raise RuntimeError(f'{" ".join(command)}\n{done.stdout}\n{done.stderr}')


if __name__ == '__main__':
    built_interfaces()
