# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The installation is complete, and the files that describe it agree with each other."""

import ast
import importlib
from importlib import metadata, resources
import inspect
import itertools
from pathlib import Path
import re
import runpy
import sys
import tomllib
from unittest.mock import MagicMock
from xml.etree import ElementTree

from checkout import CHECKOUT, needs_checkout
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name
import pytest
from tracked_files import tracked_files
import yaml

from ur_cartesian_driver.resources import share_path

NAME = 'ur_cartesian_driver'
pytestmark = pytest.mark.installation

COMMANDS = ['demo', 'send', 'show', 'sim', 'validate', 'where']
EXECUTABLES = ['driver', 'ur_driver_names', *COMMANDS]
LAUNCH_ARGUMENTS = {
    'driver.launch.py': {
        'ur_type',
        'robot_ip',
        'reverse_ip',
        'headless_mode',
        'tf_prefix',
        'reverse_port',
        'script_sender_port',
        'trajectory_port',
        'script_command_port',
        'namespace',
        'config_file',
        'launch_rviz',
        'ur_driver_names',
    },
    'two_arms.launch.py': {
        'left_robot_ip',
        'right_robot_ip',
        'left_ur_type',
        'right_ur_type',
        'headless_mode',
        'config_file',
    },
    'beside_ur_driver.launch.py': {'ur_type', 'robot_ip', 'launch_rviz', 'config_file'},
    'simulated_robot.launch.py': {
        'ur_type',
        'robot_ip',
        'polyscope',
        'tf_prefix',
        'namespace',
        'launch_rviz',
        'ur_driver_names',
    },
}


def package_xml():
    return ElementTree.parse(share_path() / 'package.xml').getroot()


def cmake_lists():
    return (CHECKOUT / 'CMakeLists.txt').read_text()


def test_the_version_is_that_of_package_xml():
    assert metadata.version(NAME) == package_xml().findtext('version')


@needs_checkout
def test_cmake_has_the_version_of_package_xml():
    version = package_xml().findtext('version')
    assert f'project({NAME} VERSION {version})' in cmake_lists()


@needs_checkout
def test_the_changelog_has_a_place_for_what_comes_next():
    assert '\nForthcoming\n-----------\n' in (CHECKOUT / 'CHANGELOG.rst').read_text()


@needs_checkout
def test_every_interface_file_is_built():
    named = set(re.findall(r'"((?:msg|srv|action)/\w+\.\w+)"', cmake_lists()))
    there = {
        f'{path.parent.name}/{path.name}'
        for kind in ('msg', 'srv', 'action')
        for path in tracked_files(CHECKOUT / kind, '*')
    }
    assert named == there


def prefix_with_executables():
    """Return lib/ur_cartesian_driver of the installation that the package comes from."""
    generated = Path(importlib.import_module(f'{NAME}.msg').__file__)
    for parent in generated.parents:
        if (parent / 'lib' / NAME).is_dir():
            return parent / 'lib' / NAME
    raise AssertionError(f'no lib/{NAME} above {generated}')


def test_the_executables_of_ros2_run_are_installed():
    assert sorted(path.name for path in prefix_with_executables().iterdir()) == sorted(EXECUTABLES)


@pytest.mark.parametrize('name', EXECUTABLES)
def test_an_executable_calls_a_function_that_exists(name):
    tree = ast.parse((prefix_with_executables() / name).read_text())
    (imported,) = [node for node in ast.walk(tree) if isinstance(node, ast.ImportFrom)]
    assert callable(getattr(importlib.import_module(imported.module), imported.names[0].name))


@pytest.mark.parametrize('command', COMMANDS)
def test_the_command_line_has_the_command_of_an_executable(command, capsys):
    main = importlib.import_module(f'{NAME}.cli').main
    with pytest.raises(SystemExit) as exit_:
        main([command, '--help'])
    assert exit_.value.code == 0
    assert command in capsys.readouterr().out


def test_console_scripts_and_executables_call_the_same_functions():
    scripts = {
        script.name: script.value
        for script in metadata.distribution(NAME).entry_points.select(group='console_scripts')
    }
    if not scripts:
        pytest.skip('console scripts come with pip; this is an installation by colcon')
    assert scripts == {
        'ur-cartesian-driver': f'{NAME}.entry_points:driver',
        'ur-cartesian': f'{NAME}.entry_points:command_line',
    }
    entry_points = importlib.import_module(f'{NAME}.entry_points')
    for name, function in (('driver', entry_points.driver), ('sim', entry_points.command_line)):
        executable = (prefix_with_executables() / name).read_text()
        for source in (executable, inspect.getsource(function)):
            (module,) = re.findall(r'from (\S+) import main\b', source)
            assert module == f'{NAME}.{"ros.node" if name == "driver" else "cli"}'


def test_pytest_finds_the_fixtures_for_users():
    (plugin,) = metadata.distribution(NAME).entry_points.select(group='pytest11')
    assert plugin.value == f'{NAME}.pytest_plugin'
    assert f'{NAME}.pytest_plugin' in sys.modules


def test_files_that_are_not_python_are_installed_with_the_package():
    package = resources.files(NAME)
    assert package.joinpath('py.typed').is_file()
    assert any(path.name.endswith('.script') for path in package.joinpath('program').iterdir())


@pytest.mark.parametrize(
    'path',
    [
        'config/driver.rviz',
        'config/driver.yaml',
        'launch/driver.launch.py',
        'msg/CartesianTrajectory.msg',
        'package.xml',
    ],
)
def test_data_files_are_found(path):
    assert (share_path() / path).is_file()


def calls(tree, name):
    return [
        node
        for node in ast.walk(tree)
        if isinstance(node, ast.Call) and ast.unparse(node.func) == name
    ]


@pytest.mark.parametrize('name', LAUNCH_ARGUMENTS)
def test_a_launch_file_compiles_and_has_its_arguments(name):
    path = share_path() / 'launch' / name
    tree = ast.parse(path.read_text(), filename=str(path))
    compile(tree, str(path), 'exec')
    declared = calls(tree, 'DeclareLaunchArgument')
    assert {ast.literal_eval(call.args[0]) for call in declared} == LAUNCH_ARGUMENTS[name]
    for call in declared:
        assert 'description' in {keyword.arg for keyword in call.keywords}, ast.unparse(call)


@pytest.fixture
def driver_launch(monkeypatch):
    """Return the names of driver.launch.py, with stand-ins for launch, which is not on PyPI."""
    for module in (
        *('launch', 'launch.actions', 'launch.conditions', 'launch.substitutions', 'launch_ros'),
        *('launch_ros.actions', 'launch_ros.parameter_descriptions', 'launch_ros.substitutions'),
    ):
        monkeypatch.setitem(sys.modules, module, MagicMock())

    class LaunchConfiguration:
        def __init__(self, name):
            self._name = name

        def perform(self, given):
            return given.get(self._name, '')

    substitutions, actions = sys.modules['launch.substitutions'], sys.modules['launch_ros.actions']
    monkeypatch.setattr(substitutions, 'LaunchConfiguration', LaunchConfiguration)
    monkeypatch.setattr(actions, 'Node', lambda **fields: fields)
    return runpy.run_path(str(share_path() / 'launch' / 'driver.launch.py'))


@pytest.mark.parametrize(
    ('given', 'names'),
    [
        ({'ur_type': 'ur5e', 'launch_rviz': 'false'}, {'ur_type'}),
        (
            {'headless_mode': 'false', 'reverse_port': '0', 'launch_rviz': 'true'},
            {'headless_mode', 'reverse_port', 'publish_link_frames'},
        ),
    ],
)
def test_only_arguments_that_are_given_override_the_file(driver_launch, given, names):
    (node,) = driver_launch['driver'](given)
    _, parameters = node['parameters']
    assert set(parameters) == names


@pytest.mark.parametrize('name', ['simulated_robot.launch.py', 'two_arms.launch.py'])
def test_a_launch_file_knows_the_arguments_of_the_one_that_it_includes(name):
    tree = ast.parse((share_path() / 'launch' / name).read_text())
    known = LAUNCH_ARGUMENTS['driver.launch.py']
    strings = {node.value for node in ast.walk(tree) if isinstance(node, ast.Constant)}
    assert {'ur_type', 'robot_ip', 'headless_mode', 'reverse_port'} <= strings & known
    assert {s for s in strings if str(s).endswith('_port')} <= known


def test_a_launch_file_starts_an_executable_that_is_installed():
    for path in tracked_files(share_path() / 'launch', '*.launch.py'):
        started = [
            keyword.value
            for node in ast.walk(ast.parse(path.read_text()))
            if isinstance(node, ast.Call)
            for keyword in node.keywords
            if keyword.arg == 'executable'
        ]
        assert started or path.name == 'two_arms.launch.py'  # which includes another one
        assert {ast.literal_eval(value) for value in started} <= {*EXECUTABLES, 'rviz2'}


def test_ros_packages_that_pip_installs_are_dependencies_of_the_ros_package():
    required = {
        re.match(r'[\w-]+', line)[0]
        for line in metadata.requires(NAME) or []
        if 'extra ==' not in line
    }
    if not required:
        pytest.skip('requirements come with pip; this is an installation by colcon')
    ros = {
        name.removeprefix('ros-jazzy-').replace('-', '_')
        for name in required
        if name.startswith('ros-jazzy-')
    }
    depends = {
        element.text for kind in ('depend', 'exec_depend') for element in package_xml().iter(kind)
    }
    assert ros - depends == set()
    # Not on PyPI; the driver does without them there.
    assert depends - ros == {
        'control_msgs',
        'launch',
        'launch_ros',
        'tf2_msgs',
        'tf2_ros',
        'pinocchio',
        'python3-matplotlib',
        'python3-numpy',
        'python3-yaml',
        'python3-tqdm',
        'python3-urllib3',
    }


def test_rosdep_knows_the_keys_of_package_xml():
    used = [
        element.text
        for kind in ('buildtool_depend', 'depend', 'exec_depend', 'test_depend')
        for element in package_xml().iter(kind)
    ]
    listed = yaml.safe_load((Path(__file__).parent / 'rosdistro_keys.yaml').read_text())
    known = [key for source in listed.values() for key in source['keys']]
    assert sorted(used) == sorted(known)
    assert all(re.fullmatch('[0-9a-f]{40}', source['commit']) for source in listed.values())


def requirements():
    """Return the requirements of builds, installations, their extras and developers."""
    declared = {
        ast.unparse(node.targets[0]): ast.literal_eval(node.value)
        for node in ast.parse((CHECKOUT / 'setup.py').read_text()).body
        if isinstance(node, ast.Assign) and ast.unparse(node.targets[0]) in ('REQUIRES', 'EXTRAS')
    }
    builds = (
        tomllib.loads(path.read_text())['build-system']['requires']
        for path in (CHECKOUT / 'pyproject.toml', CHECKOUT / 'simulator' / 'pyproject.toml')
    )
    texts = [
        *declared['REQUIRES'],
        *itertools.chain(*declared['EXTRAS'].values(), *builds),
        *(CHECKOUT / 'requirements-dev.txt').read_text().splitlines(),
    ]
    return [Requirement(text) for text in texts if text and not text.startswith('#')]


@needs_checkout
def test_the_lock_has_a_version_in_the_range_of_every_requirement():
    locked = {}
    for line in (CHECKOUT / 'requirements.lock').read_text().splitlines():
        if match := re.match(r'([\w.-]+)==(\S+)', line):
            locked.setdefault(match[1], []).append(match[2])
    outside = [
        str(requirement)
        for requirement in requirements()
        if not (versions := locked.get(canonicalize_name(requirement.name)))
        or not all(map(requirement.specifier.contains, versions))
    ]
    assert outside == [], 'run make lock'
    assert len(requirements()) > 70


@needs_checkout
def test_the_lock_names_no_place_to_install_from():
    text = (CHECKOUT / 'requirements.lock').read_text()
    assert re.findall(r'.*(?:://|^-|\s--|@ ).*', text, re.MULTILINE) == []


@needs_checkout
def test_the_licence_of_everything_foreign_is_named():
    page = (CHECKOUT / 'doc' / 'licences.md').read_text().lower()
    listed = ''.join(
        (CHECKOUT / name).read_text()
        for name in ('setup.py', 'requirements-dev.txt', 'pyproject.toml')
    )
    named = set(re.findall(r'(?<![\w-])([A-Za-z][\w-]+)(?:\[\w+\])?[<>]=?\d', listed))
    named = {re.sub('(ros-jazzy|colcon)-.*', r'\1', name) for name in named}
    folders = {
        str(file.relative_to(CHECKOUT).parent)
        for kind in ('golden', 'files')
        for file in tracked_files(CHECKOUT, f'test/*/{kind}/*')
    }
    assert {'viser', 'airo-models', 'codespell', 'cmake'} < named
    assert 'test/importing/files' in folders
    assert [name for name in sorted(named | folders) if name.lower() not in page] == []
