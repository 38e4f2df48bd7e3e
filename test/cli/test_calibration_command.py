# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The calibration of a robot becomes a file, or one sentence says why not."""

import asyncio

import pytest
from virtual_network import HOST, VirtualLoop
import yaml

from ur_cartesian_driver.cli import main
from ur_cartesian_driver.cli.calibration_command import reported_geometry
from ur_cartesian_driver.kinematics.calibration_file import calibration_hash, calibration_text
from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.kinematics.robot_models import robot_model
from ur_cartesian_driver.protocol.client_interfaces import primary_messages as primary
from ur_cartesian_driver.protocol.client_interfaces.primary_state import ConfigurationData
from ur_cartesian_driver.robot.check.finding import RobotAddress
from ur_cartesian_driver.sim import assemble, SimulatorConfig
from ur_cartesian_driver.sim.calibration import random_calibration, read_calibration
from ur_cartesian_driver.sim.interfaces.primary_stream import PrimaryStream

UR5E = robot_model('ur5e')
GEOMETRY = random_calibration(UR5E, 3)
pytestmark = [pytest.mark.slow, pytest.mark.ur_sim(geometry=GEOMETRY)]


@pytest.fixture
def run(ur_sim, capsys):
    """Run the command; return its status, its output and its errors."""

    def run(*options, port=ur_sim.ports.primary):
        status = main(['calibration', '--primary-port', str(port), *options])
        return status, *capsys.readouterr()

    return run


def test_the_calibration_of_the_robot_is_printed(run):
    status, printed, errors = run()
    assert (status, errors) == (0, '')
    assert printed == calibration_text(GEOMETRY)
    assert yaml.safe_load(printed)['kinematics']['hash'] == calibration_hash(GEOMETRY)


def test_a_file_is_written_that_a_simulator_can_have(run, tmp_path):
    path = tmp_path / 'arm.yaml'
    status, printed, errors = run('--output', str(path))
    assert (status, printed) == (0, '')
    assert errors == f'{calibration_hash(GEOMETRY)}: {path}\n'
    assert path.read_text() == calibration_text(GEOMETRY)
    arm = Arm(UR5E, read_calibration(path, UR5E))
    assert arm.max_flange_distance(Arm(UR5E, GEOMETRY)) < 1e-9


def test_a_file_that_cannot_be_written_is_named(run, tmp_path, capsys):
    path = tmp_path / 'missing' / 'arm.yaml'
    with pytest.raises(SystemExit, match='2'):
        run('--output', str(path))
    assert capsys.readouterr().err.endswith(
        f'argument -o/--output: {path} cannot be written: there is no folder {path.parent}\n'
    )


def test_a_port_of_another_interface_is_named(ur_sim, run):
    status, printed, errors = run(port=ur_sim.ports.rtde)
    assert (status, printed) == (1, '')
    assert errors == (
        f'ur-cartesian calibration: primary interface: 127.0.0.1 port {ur_sim.ports.rtde}: no '
        'configuration is reported (the usual port is 30001)\n'
    )


def test_nobody_at_the_address_is_one_sentence(run, closed_port):
    status, printed, errors = run(port=closed_port)
    assert (status, printed) == (1, '')
    assert errors == (
        'ur-cartesian calibration: primary interface: '
        f'127.0.0.1 port {closed_port}: connection refused\n'
    )


def test_a_robot_that_reports_no_kinematics_is_named():
    stream = PrimaryStream(assemble(SimulatorConfig()).controller)
    (state,) = primary.PrimaryDecoder().feed(stream.state())
    frame = primary.encode_state(
        [package for package in state.packages if isinstance(package, ConfigurationData)]
    )

    async def scene():
        hung_up = asyncio.Event()

        async def serve(reader, writer):
            while not reader.at_eof():
                writer.write(frame)
                await asyncio.sleep(0.1)
            writer.close()
            hung_up.set()

        await asyncio.start_server(serve, HOST, 30001)
        try:
            await reported_geometry(RobotAddress(host=HOST))
        finally:
            await hung_up.wait()

    with (
        asyncio.Runner(loop_factory=VirtualLoop) as runner,
        pytest.raises(OSError, match=f'{HOST} port 30001 has reported no kinematics in 2 s'),
    ):
        runner.run(scene())
