# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The simulated controller alone, as it is installed from the wheel of ``ur-controller-sim``.

Run where that is installed: in an environment that has nothing else, and beside the driver.
"""

from importlib import metadata, util
import os
from pathlib import Path
import pkgutil
import subprocess
import sys
from time import monotonic, sleep

import pytest
import ur_controller_sim

pytestmark = pytest.mark.installation

DISTRIBUTION = 'ur-controller-sim'
#: With all that it needs [bytes].
MAX_INSTALLED_SIZE = 150e6
IMPORT_ALL = """
import importlib, sys
for name in sys.argv[1:]:
    importlib.import_module(name)
print(*sorted({name.partition('.')[0] for name in sys.modules} - set(sys.stdlib_module_names)))
"""
TARGET = [0.3, -1.6, 1.7, -1.4, -1.5, 0.2]
CLIENT = """
import json, sys
from rtde_control import RTDEControlInterface
from rtde_receive import RTDEReceiveInterface
control, receive = RTDEControlInterface(sys.argv[1], 500.0), RTDEReceiveInterface(sys.argv[1])
assert control.moveJ(json.loads(sys.argv[2]), 1.05, 3.0)
print(receive.getActualQ())
"""


def test_every_module_is_imported_with_numpy_and_nothing_else():
    """PyYAML is imported with the first calibration; pytest is for the plugin."""
    names = [
        module.name
        for module in pkgutil.walk_packages(ur_controller_sim.__path__, 'ur_controller_sim.')
        if not module.name.endswith(('.__main__', '.pytest_plugin', '.simulator_fixture'))
    ]
    assert 'ur_controller_sim.sim.command_line' in names
    done = subprocess.run(
        [
            *(sys.executable, '-I', '-S', '-c'),  # -S: without what .pth files import
            f'import sys; sys.path += {sys.path}\n{IMPORT_ALL}',
            *names,
        ],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    foreign = {name for name in done.stdout.split() if not name.startswith('_')}
    assert foreign == {'numpy', 'ur_controller_sim'}


def installed_files(distribution):
    """Return the files of a distribution that are there."""
    paths = (Path(file.locate()).resolve() for file in metadata.files(distribution) or [])
    return {path for path in paths if path.is_file()}


def test_it_is_small_with_all_that_it_needs():
    sizes = [
        path.stat().st_size
        for name in (DISTRIBUTION, 'numpy', 'pyyaml')
        for path in installed_files(name)
    ]
    assert len(sizes) > 1000
    assert sum(sizes) < MAX_INSTALLED_SIZE


def test_it_needs_no_more_than_that():
    required = [line for line in metadata.requires(DISTRIBUTION) or [] if 'extra' not in line]
    assert sorted(line.split('<')[0].split('>')[0] for line in required) == ['numpy', 'pyyaml']


def test_the_driver_and_the_simulator_have_no_file_in_common():
    """So each can be removed without harm to the other."""
    if util.find_spec('ur_cartesian_driver') is None:
        return  # it has been removed
    driver, simulator = installed_files('ur_cartesian_driver'), installed_files(DISTRIBUTION)
    assert len(simulator) > 100
    assert driver & simulator == set()


@pytest.mark.slow
def test_the_command_serves_a_client_that_knows_only_a_real_robot():
    pytest.importorskip('rtde_control')
    host = f'127.0.19.{os.getpid() % 254 + 1}'  # another run has another one
    with subprocess.Popen(
        [sys.executable, '-m', 'ur_controller_sim', '--host', host],
        stdout=subprocess.PIPE,
        text=True,
    ) as robot:
        try:
            assert robot.stdout.readline().startswith(f'simulated ur5e on {host}: RTDE 30004,')
            done = subprocess.run(
                [sys.executable, '-c', CLIENT, host, str(TARGET)],
                capture_output=True,
                text=True,
                timeout=60.0,
                check=False,
            )
            assert done.returncode == 0, done.stdout + done.stderr
        finally:
            robot.terminate()
    q = done.stdout.splitlines()[-1].strip('[]').split(',')
    assert [float(value) for value in q] == pytest.approx(TARGET, abs=1e-3)


@pytest.mark.ur_controller(model='ur10e', rate=0.0, faults=['protective_stop at 0.1 m'])
def test_the_fixture_gives_a_robot_with_its_faults(ur_controller):
    assert isinstance(ur_controller, ur_controller_sim.SimulatedRobot)
    ur_controller.run_script('def there():\n  movej([0.9, -1.2, 1.6, -1.9, -1.6, 0])\nend\n')
    give_up = monotonic() + 10.0
    while ur_controller.state().safety_mode.name == 'NORMAL' and monotonic() < give_up:
        sleep(0.01)
    state = ur_controller.state()
    assert ur_controller.config.model == 'ur10e'
    assert state.safety_mode.name == 'PROTECTIVE_STOP'
    assert state.q[0] < 0.9


def test_a_controller_without_clock_and_network_does_the_same_each_time():
    def poses():
        controller, _ = ur_controller_sim.assemble(
            ur_controller_sim.SimulatorConfig(), ur_controller_sim.MemorySockets()
        )
        controller.programs.submit('def p():\n  movej([0, -1.2, 1.6, -1.9, -1.6, 0])\nend\n')
        found = []
        for _ in range(200):
            controller.step()
            found.append(controller.motion.q)
        return found

    first = poses()
    assert first[0] != first[-1]
    assert poses() == first
