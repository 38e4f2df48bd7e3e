# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The installation works: all that building and packing can break is checked, nothing else.

Together with the other tests marked ``installation`` this is what colcon and each wheel run.
"""

import importlib
from importlib import resources
import os
from pathlib import Path
import pkgutil
import signal
import subprocess
import sys
from time import monotonic

import pytest
from tracked_files import tracked_files

import ur_cartesian_driver
from ur_cartesian_driver.motion.errors import ErrorCode
from ur_cartesian_driver.motion.goal.execution_modes import ExecutionMode
from ur_cartesian_driver.program import ProgramSettings, render
from ur_cartesian_driver.resources import share_path
from ur_cartesian_driver.ros.client import GoalClient, load_goal

pytestmark = pytest.mark.installation

NAME = 'ur_cartesian_driver'
GENERATED = ('msg', 'srv', 'action')
#: How long a node may need until its robot is ready, on a computer that has much else to do [s].
READY_TIMEOUT = 120.0

CELL_TEST = """
def test_the_arm_is_ready_for_a_goal(ur_sim, cartesian_driver):
    assert cartesian_driver.driver.arm.model.name == 'ur5e'
    assert ur_sim.state().robot_mode.name == 'RUNNING'
"""


def executable(name):
    """Return the command that `ros2 run` starts, as it is installed."""
    generated = Path(importlib.import_module(f'{NAME}.msg').__file__)
    folder = next(p / 'lib' / NAME for p in generated.parents if (p / 'lib' / NAME).is_dir())
    return [sys.executable, str(folder / name)]


def run(command, **options):
    return subprocess.run(
        command, capture_output=True, text=True, timeout=60.0, check=False, **options
    )


# ---- modules and files --------------------------------------------------------------------------


def test_every_module_can_be_imported():
    """A ``__main__`` would run; the one that there is runs with the node below."""
    names = [
        module.name
        for module in pkgutil.walk_packages(ur_cartesian_driver.__path__, f'{NAME}.')
        if not module.name.endswith('.__main__')
    ]
    assert f'{NAME}.ros.node' in names
    assert f'{NAME}.msg' in names
    for name in names:
        importlib.import_module(name)


@pytest.mark.parametrize('kind', GENERATED)
def test_every_interface_file_has_its_generated_class(kind):
    files = {path.stem for path in tracked_files(share_path() / kind, f'*.{kind}')}
    module = importlib.import_module(f'{NAME}.{kind}')
    classes = {
        name.split('_')[0]  # without _Goal, _Request and their like
        for name, value in vars(module).items()
        if isinstance(value, type)
    }
    assert files
    assert classes == files


@pytest.mark.parametrize('path', tracked_files(share_path() / 'config' / 'examples', '*.yaml'))
def test_every_example_is_a_goal_of_the_installed_action(path):
    goal = load_goal(path)
    assert goal.trajectory.points or goal.packed.poses


@pytest.mark.parametrize('version', [(3, 15, 0), (5, 12, 0), (10, 8, 0)])
def test_the_robot_program_is_rendered_from_the_installed_text(version):
    text = render(
        ProgramSettings(
            host='192.168.56.1',
            reverse_port=50001,
            trajectory_port=50003,
            script_command_port=50004,
            version=version,
        )
    )
    assert '"192.168.56.1"' in text
    assert '{{' not in text


def test_the_typing_marker_is_installed():
    assert resources.files(NAME).joinpath('py.typed').is_file()


# ---- commands -----------------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize('name', ['demo', 'send', 'show', 'sim', 'validate', 'where'])
def test_an_executable_prints_its_help(name):
    done = run([*executable(name), '--help'])
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith('usage:')


@pytest.mark.slow
def test_the_executable_of_the_node_ends_with_a_sentence_for_a_wrong_parameter():
    done = run([*executable('driver'), '--ros-args', '-p', 'ur_type:=ur4'])
    assert done.returncode == 1
    assert "Parameter ur_type is 'ur4', but must be one of ur3," in done.stderr


@pytest.mark.slow
def test_the_command_line_of_pip_plans_an_example():
    script = Path(sys.executable).with_name('ur-cartesian')
    if not script.is_file():
        pytest.skip('console scripts come with pip; this is an installation by colcon')
    done = run([str(script), 'validate', 'square'])
    assert done.returncode == 0, done.stderr
    assert 'MOVE' in done.stdout


# ---- one goal of each kind ----------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.acceptance
def test_the_installed_node_carries_out_a_goal_in_each_execution_mode(
    ur_sim, private_ros_graph, tmp_path
):
    """Executable, robot loop in its own process, action, simulator."""
    parameters = {
        'robot_ip': ur_sim.config.host,
        'headless_mode': 'true',
        'rtde_port': ur_sim.ports.rtde,
        'primary_port': ur_sim.ports.primary,
        'dashboard_port': ur_sim.ports.dashboard,
        'reverse_port': 0,
        'script_sender_port': 0,
        'trajectory_port': 0,
        'script_command_port': 0,
        'robot_receive_timeout': 10.0,  # a busy computer may stand still for seconds
        'max_state_age': 0.0,
    }
    arguments = [word for item in parameters.items() for word in ('-p', '{}:={}'.format(*item))]
    output = tmp_path / 'output'
    with (
        output.open('w') as stream,
        subprocess.Popen(
            [*executable('driver'), '--ros-args', *arguments], stdout=stream, stderr=stream
        ) as node,
        GoalClient() as client,
    ):
        try:
            for mode in ExecutionMode:
                result = send_when_ready(node, client, goal_in(mode))
                said = (mode, result.error_string, output.read_text())
                assert result.error_code == ErrorCode.SUCCESSFUL, said
            node.send_signal(signal.SIGINT)
            assert node.wait(15.0) == 0
        except TimeoutError:
            raise AssertionError(f'the node said: {output.read_text()}') from None
        finally:
            node.kill()
    assert 'Traceback' not in output.read_text()


def goal_in(mode):
    """Return a goal that moves the tool by 2 cm and back, in an execution mode."""
    goal = load_goal(share_path() / 'config' / 'examples' / 'relative.yaml')
    goal.execution = int(mode)
    goal.goal_time_tolerance.sec = -1  # none: the computer may do something else for a moment
    for number, point in enumerate(goal.trajectory.points, 1):
        point.time_from_start.sec = number
    return goal


def send_when_ready(node, client, goal):
    """Send a goal again and again until the driver has connected to its robot."""
    deadline = monotonic() + READY_TIMEOUT
    while True:
        try:
            _, result = client.send(goal, lambda _: None, timeout=5.0)
        except TimeoutError:
            if monotonic() > deadline or node.poll() is not None:
                raise
            continue
        if result.error_code != ErrorCode.ROBOT_NOT_READY or monotonic() > deadline:
            return result


# ---- the fixtures for users ---------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.acceptance
def test_the_fixtures_serve_a_test_in_a_folder_that_knows_nothing_of_us(tmp_path):
    (tmp_path / 'test_cell.py').write_text(CELL_TEST)
    (tmp_path / 'pytest.ini').write_text('[pytest]\n')
    # What this run was told does not hold for that one.
    environment = {
        name: value for name, value in os.environ.items() if not name.startswith('PYTEST_')
    }
    done = run(
        [sys.executable, '-m', 'pytest', '-q', 'test_cell.py'], cwd=tmp_path, env=environment
    )
    assert done.returncode == 0, done.stdout + done.stderr
    assert '1 passed' in done.stdout
