# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Package the simulated controller alone, as ur-controller-sim, from the modules of the driver.

The package consists of the files of ur_controller_sim/ here, and of every module of
ur_cartesian_driver that they import, directly or not. All imports there are absolute, so reading
them finds the modules exactly, and giving the package another name is all that changes. The result
is written to src/, which is not kept in git; a source distribution has it, and is built as it is.
"""

import ast
from collections.abc import Iterable, Iterator
from email.parser import HeaderParser
from pathlib import Path
import re
import shutil
from xml.etree import ElementTree

from setuptools import find_packages, setup

DRIVER, NAME = 'ur_cartesian_driver', 'ur_controller_sim'
HERE = Path(__file__).resolve().parent
CHECKOUT = HERE.parent
PACKAGE = HERE / 'src' / NAME
#: The name of the package where it stands for the package, unlike in `the ... contributors`.
PACKAGE_NAME = re.compile(rf'\b{DRIVER}(?=\.| import\b)')


def file_of(module: str) -> Path | None:
    """Return the file of a module of the driver; None = there is no such module."""
    path = CHECKOUT.joinpath(*module.split('.'))
    return next(filter(Path.is_file, (path / '__init__.py', path.with_suffix('.py'))), None)


def imports_of(file: Path) -> Iterator[str]:
    """Yield all that a file may import from the driver; some names are no modules."""
    for node in ast.walk(ast.parse(file.read_text(encoding='utf-8'))):
        if isinstance(node, ast.ImportFrom) and node.module:
            yield node.module
            yield from (f'{node.module}.{alias.name}' for alias in node.names)
        elif isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)


def needed_files(own: Iterable[Path]) -> set[Path]:
    """Return the modules of the driver that our files need, with the packages they are in."""
    needed: set[Path] = set()
    unread = list(own)
    while unread:
        for module in imports_of(unread.pop()):
            parts = module.split('.')
            if parts[0] != DRIVER:
                continue
            for depth in range(2, len(parts) + 1):
                found = file_of('.'.join(parts[:depth]))
                if found and found not in needed:
                    needed.add(found)
                    unread.append(found)
    return needed


def write_package() -> None:
    """Write the package and what belongs to it."""
    shutil.rmtree(PACKAGE.parent, ignore_errors=True)
    own = list((HERE / NAME).glob('*.py'))
    places = {file: file.name for file in own} | {
        file: file.relative_to(CHECKOUT / DRIVER) for file in needed_files(own)
    }
    for file, place in places.items():
        target = PACKAGE / place
        target.parent.mkdir(parents=True, exist_ok=True)
        text = file.read_text(encoding='utf-8')
        target.write_text(PACKAGE_NAME.sub(NAME, text), encoding='utf-8')
    (PACKAGE / 'py.typed').touch()
    shutil.copy2(CHECKOUT / 'LICENSE', HERE)


def description() -> tuple[str, str]:
    """Return the version and the URL of the repository, which are those of the driver."""
    if is_source_distribution:
        metadata = HeaderParser().parsestr((HERE / 'PKG-INFO').read_text(encoding='utf-8'))
        return metadata['Version'], metadata['Project-URL'].removeprefix('Repository, ')
    driver = ElementTree.parse(CHECKOUT / 'package.xml')
    return driver.findtext('version', ''), driver.findtext('url', '').strip()


is_source_distribution = (HERE / 'PKG-INFO').is_file()
if not is_source_distribution:
    write_package()
version, url = description()

setup(
    name='ur-controller-sim',
    version=version,
    description='A simulated Universal Robots controller for tests, without Docker and ROS.',
    long_description=(HERE / 'README.md').read_text(encoding='utf-8'),
    long_description_content_type='text/markdown',
    license='Apache-2.0',
    license_files=['LICENSE'],
    project_urls={'Repository': url},
    classifiers=[
        'Operating System :: POSIX :: Linux',
        'Programming Language :: Python :: 3.11',
        'Programming Language :: Python :: 3.12',
        'Topic :: Scientific/Engineering',
    ],
    python_requires='>=3.11',
    package_dir={'': 'src'},
    packages=find_packages('src'),
    package_data={NAME: ['py.typed']},
    install_requires=['numpy>=2.0,<3', 'pyyaml>=6.0,<7'],  # as the driver
    entry_points={
        'console_scripts': [f'ur-controller-sim = {NAME}.sim.command_line:main'],
        'pytest11': [f'{NAME} = {NAME}.pytest_plugin'],
    },
)
