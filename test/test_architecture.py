# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Rules that the linters cannot check.

import-linter enforces the order of the layers; it does not see generated modules, which are not in
the source tree.
"""

import ast
from importlib import import_module
from pathlib import Path
import subprocess
import sys

import pytest
from tracked_files import tracked_files

import ur_cartesian_driver

NAME = 'ur_cartesian_driver'
PACKAGE = Path(ur_cartesian_driver.__file__).parent
GENERATED = {f'{NAME}.{kind}' for kind in ('action', 'msg', 'srv')}
#: The last one only where a path becomes a message.
MAY_IMPORT_GENERATED = ('ros/', 'pytest_plugin.py', 'path/path_builder.py')
HEADER = (
    '# Copyright 2026 the ur_cartesian_driver contributors\n'
    '# SPDX-License-Identifier: Apache-2.0\n'
)
NAMES_WITHOUT_A_CONCEPT = ('common', 'helper', 'manager', 'misc', 'util')


def modules():
    """Return our own modules, by path in the package; an installed package also has others."""
    paths = (path.relative_to(PACKAGE) for path in tracked_files(PACKAGE, '**/*.py'))
    return {
        path.as_posix(): PACKAGE / path
        for path in sorted(paths)
        if path.parts[0] not in ('action', 'msg', 'srv')
    }


def imported(tree: ast.AST) -> set[str]:
    """Return the full names that a module imports; a relative import counts as it is written."""
    names = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            module = node.module or ''
            names |= {module, *(f'{module}.{alias.name}' for alias in node.names)}
    return names


def generated_imports(tree: ast.AST) -> set[str]:
    return {name for name in imported(tree) if '.'.join(name.split('.')[:2]) in GENERATED}


@pytest.mark.parametrize(
    'source',
    [
        'import ur_cartesian_driver.msg',
        'from ur_cartesian_driver import action',
        'from ur_cartesian_driver.srv import AppendPoints',
        'import ur_cartesian_driver.msg as m',
    ],
)
def test_an_import_of_generated_modules_is_seen(source):
    assert generated_imports(ast.parse(source))


def test_an_import_of_our_own_modules_is_not_taken_for_a_generated_one():
    assert not generated_imports(ast.parse('from ur_cartesian_driver.motion import pose'))


@pytest.mark.parametrize(
    'name', [name for name in modules() if not name.startswith(MAY_IMPORT_GENERATED)]
)
def test_only_the_ros_border_imports_generated_modules(name):
    assert generated_imports(ast.parse(modules()[name].read_text())) == set()


@pytest.mark.parametrize('name', modules())
def test_a_module_says_its_licence_and_what_it_is_for(name):
    source = modules()[name].read_text()
    assert source.startswith(HEADER)
    assert ast.get_docstring(ast.parse(source))


@pytest.mark.parametrize(
    'path',
    tracked_files(Path(__file__).parent, '**/*.py'),
    ids=lambda p: p.relative_to(Path(__file__).parent).as_posix(),
)
def test_a_test_says_its_licence(path):
    assert path.read_text().startswith(HEADER)


def test_no_module_is_named_for_having_no_concept():
    parts = {part.removesuffix('.py') for name in modules() for part in name.split('/')}
    assert [part for part in parts if part.rstrip('s') in NAMES_WITHOUT_A_CONCEPT] == []


def test_the_package_has_no_relative_imports():
    relative = [
        name
        for name, path in modules().items()
        for node in ast.walk(ast.parse(path.read_text()))
        if isinstance(node, ast.ImportFrom) and node.level
    ]
    assert relative == []


@pytest.mark.parametrize('package', ['driver', 'planning', 'sim'])
def test_a_package_has_each_name_that_it_offers(package):
    module = import_module(f'{NAME}.{package}')
    assert all(hasattr(module, name) for name in module.__all__)
    with pytest.raises(AttributeError, match=f"'{NAME}.{package}' has no attribute 'nothing'"):
        _ = module.nothing


@pytest.mark.parametrize(
    ('start', 'without'),
    [
        ('driver.loop.loop_host', ('planning', 'path', 'ros', 'sim')),
        ('cli', ('planning', 'path', 'ros', 'driver', 'sim.controller', 'sim.simulated_robot')),
        ('path', ('planning.planner', 'driver', 'robot', 'sim')),
        ('importing', ('importing.tables', 'importing.script', 'driver', 'planning', 'sim')),
    ],
)
def test_what_has_to_start_fast_imports_no_more_than_it_needs(start, without):
    program = f'import sys, {NAME}.{start}; print(*sys.modules)'
    loaded = subprocess.run(
        [sys.executable, '-c', program], capture_output=True, text=True, check=True
    ).stdout.split()
    assert f'{NAME}.{start}' in loaded
    assert not [name for name in without if f'{NAME}.{name}' in loaded]
