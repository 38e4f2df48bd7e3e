# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Package the driver for pip; colcon does not read this file.

CMakeLists.txt is the one description of the build. This script runs it into a staging directory
and packs what was installed there: generated Python modules into the package, and libraries,
interfaces, config and launch files into the environment's lib/ and share/, where the wheels of
ROS 2 keep theirs.
"""

import importlib.util
import os
from pathlib import Path
import shutil
import subprocess
import sys
import sysconfig
from xml.etree import ElementTree

from setuptools import Extension, find_packages, setup
from setuptools.command.build_ext import build_ext

ROOT = Path(__file__).resolve().parent
PACKAGE = ElementTree.parse(ROOT / 'package.xml').getroot()

# The ranges hold the versions that were tried; the next major version of a thing was not.
REQUIRES = [
    'numpy>=2.0,<3',
    'pyyaml>=6.0,<7',
    'ros-jazzy-action-msgs>=2.0,<3',
    'ros-jazzy-ament-index-python>=1.8,<2',
    'ros-jazzy-builtin-interfaces>=2.0,<3',
    'ros-jazzy-diagnostic-msgs>=5.3,<6',
    'ros-jazzy-geometry-msgs>=5.3,<6',
    'ros-jazzy-rclpy[fastrtps]>=7.1,<8',
    'ros-jazzy-rosidl-default-runtime>=1.6,<2',
    'ros-jazzy-sensor-msgs>=5.3,<6',
    'ros-jazzy-std-msgs>=5.3,<6',
    'ros-jazzy-std-srvs>=5.3,<6',
    'ros-jazzy-unique-identifier-msgs>=2.5,<3',
    'ros-jazzy-visualization-msgs>=5.3,<6',
    'tqdm>=4.66,<5',
    'urllib3>=2.0,<3',
]
EXTRAS = {
    # The meshes of the robots, and self-collision with them.
    'collision': ['airo-models>=0.0.12,<0.1', 'example-robot-data>=4,<7', 'pin>=3,<5'],
    # Recordings as MCAP.
    'export': ['mcap>=1.6,<2', 'mcap-ros2-support>=0.6,<1'],
    # The picture of the path that the demo draws.
    'plot': ['matplotlib>=3.8,<4'],
    # The page of a motion.
    'show': ['trimesh>=4,<6', 'viser>=1.1,<1.2'],
    'test': [
        # The judge of the importer of DXF.
        'ezdxf>=1.3,<2',
        'hypothesis>=6.100,<7',
        'pytest>=8.2,<10',
        'pytest-rerunfailures>=14,<17',
        'pytest-timeout>=2.3,<3',
        'pytest-xdist>=3.6,<4',
        'scipy>=1.13,<2',
        # A client by others, where it has wheels; its test is skipped elsewhere.
        'ur-rtde>=1.6.5,<1.7; platform_machine == "x86_64" and sys_platform == "linux"',
    ],
}


def text(tag: str) -> str:
    """Return what package.xml says in a tag, on one line."""
    content = PACKAGE.findtext(tag)
    assert content is not None, f'package.xml has no <{tag}>'
    return ' '.join(content.split())


NAME = text('name')


def ros_prefixes() -> str:
    """Return the ROS installations to build with: those that are sourced, or the wheels'."""
    if sourced := os.environ.get('AMENT_PREFIX_PATH'):
        return sourced
    spec = importlib.util.find_spec('ament_package')
    if spec is None or spec.origin is None:
        sys.exit(
            'No ROS 2 to build with: AMENT_PREFIX_PATH is not set, and the wheel '
            'ros-jazzy-ament-package is not installed (scripts/setup.sh does that).'
        )
    return str(Path(spec.origin).parents[4])  # PREFIX/lib/pythonX.Y/site-packages/NAME/FILE


def cmake_install() -> Path:
    """Run the CMake build and return the directory that it was installed into."""
    prefixes = ros_prefixes()
    base = ROOT / 'build' / f'pip-{sysconfig.get_platform()}-{sys.implementation.cache_tag}'
    stamp, build, stage = base / 'prefixes', base / 'cmake', base / 'stage'
    if not stamp.exists() or stamp.read_text() != prefixes:
        shutil.rmtree(base, ignore_errors=True)  # CMake's cache holds paths into the prefixes
        base.mkdir(parents=True)
        stamp.write_text(prefixes)
    shutil.rmtree(stage, ignore_errors=True)

    environment = {**os.environ, 'AMENT_PREFIX_PATH': prefixes, 'CMAKE_PREFIX_PATH': prefixes}
    jobs = os.environ.get('CMAKE_BUILD_PARALLEL_LEVEL') or str(os.cpu_count())
    configure = [
        'cmake',
        '-S',
        str(ROOT),
        '-B',
        str(build),
        f'-DCMAKE_INSTALL_PREFIX={stage}',
        f'-DCMAKE_PROJECT_INCLUDE={ROOT / "cmake" / "ros_wheels.cmake"}',
        f'-DPython3_EXECUTABLE={sys.executable}',
        f'-DCMAKE_BUILD_TYPE={os.environ.get("CMAKE_BUILD_TYPE", "Release")}',
        '-DBUILD_TESTING=OFF',
    ]
    for command in (
        configure,
        ['cmake', '--build', str(build), '--parallel', jobs],
        ['cmake', '--install', str(build)],
    ):
        subprocess.run(command, check=True, env=environment)
    return stage


def belongs_to_the_stage(path: Path) -> bool:
    """Tell whether an installed file only makes sense where CMake put it."""
    return path.name.startswith('local_setup.') or 'parent_prefix_path' in path.parts


class BuildInterfaces(build_ext):
    """Take the place of a compiler: pack what CMake built."""

    def run(self) -> None:
        """Put generated modules beside our own, and all the rest into lib/ and share/."""
        stage = cmake_install()
        generated = next(stage.glob(f'**/{NAME}/msg/__init__.py')).parents[1]
        data: dict[str, list[str]] = {}
        for path in sorted(p for p in stage.rglob('*') if p.is_file()):
            if path.is_relative_to(generated):
                self.copy_generated(path, path.relative_to(generated))
            elif not path.is_relative_to(generated.parent) and not belongs_to_the_stage(path):
                folder = str(path.parent.relative_to(stage))
                data.setdefault(folder, []).append(str(path.relative_to(ROOT)))
        self.distribution.data_files = list(data.items())
        if self.editable_mode:
            self.run_command('install_data')  # setuptools leaves it out of editable installs

    def copy_generated(self, path: Path, inside: Path) -> None:
        """
        Copy one module or extension that CMake generated.

        In an editable install the generated files are installed and our modules stay in the
        checkout. The package's __init__.py does not go along, so that Python finds the one in
        the checkout, whose extend_path() then joins the two directories.
        """
        if path.suffix not in ('.py', '.so') or (ROOT / NAME / inside).exists():
            return
        library = (
            self.get_finalized_command('install').install_lib
            if self.editable_mode
            else self.build_lib
        )
        target = Path(library, NAME, inside)
        target.parent.mkdir(parents=True, exist_ok=True)
        shutil.copy2(path, target)

    def get_outputs(self) -> list[str]:
        """Return nothing: there is no compiled module in the usual sense."""
        return []

    def get_output_mapping(self) -> dict[str, str]:
        """Return nothing, as get_outputs()."""
        return {}


setup(
    name=NAME,
    version=text('version'),
    description=text('description'),
    long_description=(ROOT / 'README.md').read_text() if (ROOT / 'README.md').exists() else '',
    long_description_content_type='text/markdown',
    license=text('license'),
    license_files=['LICENSE'],
    maintainer=text('maintainer'),
    maintainer_email=PACKAGE.findall('maintainer')[0].get('email'),
    project_urls={'Repository': text('url')},
    classifiers=[
        'Operating System :: POSIX :: Linux',
        'Programming Language :: Python :: 3.11',
        'Programming Language :: Python :: 3.12',
        'Topic :: Scientific/Engineering',
    ],
    python_requires='>=3.11,<3.13',
    packages=find_packages(include=[NAME, f'{NAME}.*']),
    package_dir={'': '.'},  # makes an editable install a plain .pth file
    package_data={'': ['*']},  # as CMake, which installs the whole directory
    exclude_package_data={'': ['*.pyc']},
    ext_modules=[Extension(f'{NAME}.interfaces', sources=[])],
    cmdclass={'build_ext': BuildInterfaces},
    install_requires=REQUIRES,
    extras_require=EXTRAS,
    entry_points={
        'console_scripts': [
            f'ur-cartesian-driver = {NAME}.entry_points:driver',
            f'ur-cartesian = {NAME}.entry_points:command_line',
        ],
        'pytest11': [f'ur_cartesian = {NAME}.pytest_plugin'],
    },
)
