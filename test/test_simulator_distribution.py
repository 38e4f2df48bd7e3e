# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The package ``ur_controller_sim`` is made of the driver's modules, and of few of them.

What its wheel does where it is installed is tested in ``simulator_alone``.
"""

import configparser
import re
import shutil
import subprocess
import sys
import tomllib
import zipfile

from checkout import CHECKOUT, needs_checkout
import pytest
from tracked_files import tracked_files

pytestmark = needs_checkout
NAME, DRIVER = 'ur_controller_sim', 'ur_cartesian_driver'
#: Beside the files that only this package has.
ROOMS = {
    'kinematics',
    'lazy_names.py',
    'motion',
    'protocol',
    'sim',
    'simulator_fixture.py',
    'urscript',
}
#: What a controller does not know of the driver's goals, plans and robot program.
OF_THE_DRIVER = {
    'motion/goal/goal.py',
    'motion/plan/plan.py',
    'protocol/program',
    'protocol/robot_api.py',
}
OWN = {'__init__.py', '__main__.py', 'py.typed', 'pytest_plugin.py'}


@pytest.fixture(scope='module')
def wheel(tmp_path_factory):
    """Return the texts of the wheel by their places; it is built from a copy of the checkout."""
    copy = tmp_path_factory.mktemp('checkout')
    for folder in ('simulator', DRIVER):
        ignored = shutil.ignore_patterns('__pycache__', 'build', 'src')
        shutil.copytree(CHECKOUT / folder, copy / folder, ignore=ignored)
    for file in ('LICENSE', 'package.xml'):
        shutil.copy2(CHECKOUT / file, copy)
    subprocess.run(
        [sys.executable, 'setup.py', '--quiet', 'bdist_wheel'], cwd=copy / 'simulator', check=True
    )
    (built,) = (copy / 'simulator' / 'dist').glob('*.whl')
    with zipfile.ZipFile(built) as archive:
        return {name: archive.read(name).decode() for name in archive.namelist()}


def modules(wheel):
    return {
        place.removeprefix(f'{NAME}/'): text
        for place, text in wheel.items()
        if place.startswith(f'{NAME}/')
    }


def metadata(wheel, file):
    (text,) = (text for place, text in wheel.items() if place.endswith(f'.dist-info/{file}'))
    return text


def test_the_wheel_has_these_rooms_and_nothing_of_the_driver(wheel):
    assert {place.partition('/')[0] for place in modules(wheel)} == ROOMS | OWN
    assert not [
        place
        for place in modules(wheel)
        if any(place == name or place.startswith(f'{name}/') for name in OF_THE_DRIVER)
    ]


def test_the_whole_simulator_is_in_the_wheel(wheel):
    sim = CHECKOUT / DRIVER / 'sim'
    assert {place for place in modules(wheel) if place.startswith('sim/')} == {
        f'sim/{path.relative_to(sim).as_posix()}' for path in tracked_files(sim, '**/*.py')
    }


def test_a_module_is_that_of_the_driver_but_for_the_name_of_the_package(wheel):
    for place, text in modules(wheel).items():
        if place not in OWN:
            source = (CHECKOUT / DRIVER / place).read_text()
            assert text.replace(NAME, DRIVER) == source, place


def test_the_name_of_the_driver_remains_only_where_its_authors_are_named(wheel):
    for place, text in modules(wheel).items():
        left = re.findall(rf'.*{DRIVER}.*', text)
        assert left in ([], ['# Copyright 2026 the ur_cartesian_driver contributors']), place


def test_commands_and_fixtures_have_names_that_the_driver_does_not_use(wheel):
    entries = configparser.ConfigParser()
    entries.read_string(metadata(wheel, 'entry_points.txt'))
    assert dict(entries['console_scripts']) == {
        'ur-controller-sim': f'{NAME}.sim.command_line:main'
    }
    assert dict(entries['pytest11']) == {NAME: f'{NAME}.pytest_plugin'}
    fixtures = re.compile(r'@pytest\.fixture.*\ndef (\w+)')
    of_the_driver = fixtures.findall((CHECKOUT / DRIVER / 'pytest_plugin.py').read_text())
    assert fixtures.findall(modules(wheel)['pytest_plugin.py']) == ['ur_controller']
    assert 'ur_controller' not in of_the_driver


def test_version_and_bounds_are_those_of_the_driver(wheel):
    about = metadata(wheel, 'METADATA')
    version = re.search(r'<version>(.*)</version>', (CHECKOUT / 'package.xml').read_text())[1]
    assert f'\nVersion: {version}\n' in about
    setup = (CHECKOUT / 'setup.py').read_text()
    required = re.findall(r'^Requires-Dist: (\w+)(.*)$', about, re.MULTILINE)
    assert [name for name, _ in required] == ['numpy', 'pyyaml']
    for name, bounds in required:
        lowest, highest = sorted(bounds.split(','), reverse=True)
        assert f"'{name}{lowest},{highest}'" in setup
    builds = [
        tomllib.loads((CHECKOUT / folder / 'pyproject.toml').read_text())['build-system']
        for folder in ('', 'simulator')
    ]
    assert set(builds[1]['requires']) < set(builds[0]['requires'])


def test_colcon_passes_over_the_folder():
    assert (CHECKOUT / 'simulator' / 'COLCON_IGNORE').is_file()
