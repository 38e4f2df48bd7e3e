# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""A driver on a simulated robot, and independent records: RTDE packets and socket bytes."""

from contextlib import contextmanager
import os
import socket
import threading

import numpy as np
import pytest

from ur_cartesian_driver.driver import Driver, DriverConfig
from ur_cartesian_driver.kinematics.robot_models import robot_model
from ur_cartesian_driver.motion.geometry.pose import Pose
from ur_cartesian_driver.planning import PlanningOptions
from ur_cartesian_driver.protocol.program.trajectory_points import POINT_SIZE
from ur_cartesian_driver.protocol.rtde.rtde_client import DataReceived, RtdeClientCodec
from ur_cartesian_driver.sim import SimulatorConfig
from ur_cartesian_driver.sim.motion.imperfect_arm import typical_imperfections

#: A driver may have to start a process, which imports for seconds on a busy computer [s].
READY = 30.0

#: A gap [s] between time stamps that no network makes: the computer was too busy.
LEFT_OUT = 0.1


class Recording:
    """Recorded by RTDE: time stamps [s], TCP positions [m], joints [rad] and speeds [rad/s]."""

    def __init__(self):
        self.rows = []

    @property
    def time(self):
        return np.array([row[0] for row in self.rows])

    @property
    def poses(self):
        """The actual TCP poses as rotation vectors, (n, 6)."""
        return np.array([row[1] for row in self.rows])

    @property
    def positions(self):
        return self.poses[:, :3]

    @property
    def joints(self):
        return np.array([row[2] for row in self.rows])

    @property
    def moving(self):
        """A mask: some joint turns."""
        return np.abs(np.array([row[3] for row in self.rows])).max(axis=1) > 1e-6

    @property
    def duration(self):
        """
        Time from the first to the last packet in motion [s].

        A simulator that a busy computer keeps waiting for 0.1 s or more leaves these cycles out,
        and the arm does not move in them.
        """
        first, *_, last = np.flatnonzero(self.moving)
        gaps = np.diff(self.time[first : last + 1])
        return float(gaps[gaps < LEFT_OUT].sum())


@pytest.fixture
def record(ur_sim):
    """Return a context manager that records RTDE through a connection of its own."""

    @contextmanager
    def recorder():
        recording = Recording()
        end = threading.Event()
        with socket.create_connection(('127.0.0.1', ur_sim.ports.rtde)) as connection:
            connection.settimeout(5.0)
            client = RtdeClientCodec(['timestamp', 'actual_TCP_pose', 'actual_q', 'actual_qd'])
            connection.sendall(client.start())
            running = threading.Event()

            def listen():
                while not end.is_set():
                    for event in client.feed(connection.recv(65536)):
                        if isinstance(event, DataReceived):
                            recording.rows.append(event.values)
                            running.set()
                    connection.sendall(client.data_to_send())

            thread = threading.Thread(target=listen)
            thread.start()
            try:
                assert running.wait(5.0)
                yield recording
            finally:
                end.set()
                thread.join()

    return recorder


@pytest.fixture
def trajectory_bytes(ur_sim, make_driver):
    """Collect the bytes that the robot program received on the trajectory socket."""
    received = bytearray()

    def take(port, data):
        if port == make_driver.ports().get('trajectory_port'):
            received.extend(data)

    ur_sim.on_socket_data = take

    def points():
        assert len(received) % POINT_SIZE == 0
        return [bytes(received[i : i + POINT_SIZE]) for i in range(0, len(received), POINT_SIZE)]

    return points


class DriverFactory:
    """Makes drivers for one simulated robot, and closes them."""

    def __init__(self, robot):
        self._robot = robot
        self._drivers = []

    def __call__(self, options=None, **settings):
        config = {
            'robot_ip': '127.0.0.1',
            'ur_type': self._robot.config.model,
            'headless_mode': True,
            'rtde_port': self._robot.ports.rtde,
            'primary_port': self._robot.ports.primary,
            'dashboard_port': self._robot.ports.dashboard,
            'robot_api_port': self._robot.ports.robot_api,
            'reverse_port': 0,
            'script_sender_port': 0,
            'trajectory_port': 0,
            'script_command_port': 0,
            'robot_loop': 'thread',
            # Robot, driver and test share one interpreter, and two cores with other tests.
            'robot_receive_timeout': 1.0,
            # On a busy interpreter the simulated controller loses time, and its states seem old.
            'max_state_age': 0.0,
        }
        driver = Driver(
            DriverConfig(**config | settings),
            PlanningOptions(**{'max_tool_speed': 1.0} | (options or {})),
        )
        self._drivers.append(driver)
        driver.open()
        return driver

    def ports(self):
        return self._drivers[-1].status.ports if self._drivers else {}

    def close(self):
        for driver in self._drivers:
            driver.close()


@pytest.fixture
def make_driver(ur_sim):
    factory = DriverFactory(ur_sim)
    yield factory
    factory.close()


@pytest.fixture
def driver(make_driver):
    made = make_driver()
    made.wait_ready(READY)
    return made


@pytest.fixture
def home(driver):
    """The pose of the tool at the start."""
    pose = driver.state.actual_tcp_pose

    def offset(x=0.0, y=0.0, z=0.0, turned=None):
        px, py, pz = pose.position
        q = pose.quaternion if turned is None else turned
        return Pose((px + x, py + y, pz + z), q)

    return offset


@pytest.fixture(autouse=True)
def simulated_arm(request, monkeypatch):
    """The seed of the imperfections of the simulated arm; empty = it is ideal."""
    seed = getattr(request, 'param', '')
    if seed:
        monkeypatch.setenv('IMPERFECT', seed)
    return seed


def pytest_generate_tests(metafunc):
    """
    Run tests marked ``both_arms`` with an ideal arm and with one as recordings show it.

    With ``IMPERFECT=N``, all tests run once, with the imperfections of that seed.
    """
    definition = metafunc.definition
    fixed = os.environ.get('IMPERFECT', '')
    if fixed or definition.get_closest_marker('both_arms'):
        model = {
            name: value
            for mark in reversed(list(definition.iter_markers('ur_sim')))
            for name, value in mark.kwargs.items()
        }.get('model', SimulatorConfig().model)
        seed = fixed or '1'
        imperfections = typical_imperfections(robot_model(model), int(seed))
        imperfect = pytest.param(
            seed,
            id='imperfect',
            marks=[pytest.mark.ur_sim(imperfections=imperfections), pytest.mark.exhaustive],
        )
        metafunc.parametrize(
            'simulated_arm',
            [imperfect] if fixed else [pytest.param('', id='ideal'), imperfect],
            indirect=True,
        )
