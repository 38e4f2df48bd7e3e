# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Processes that die or hang during a goal, in real time: bounds of standstill and result.

Simulator and node are processes; client and witness (an RTDE connection of its own) are in this
one. ``doc/architecture.md`` has the bounds; the tests print the measured times.
"""

from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack
import itertools
from math import nan
import os
from pathlib import Path
import re
import signal
import socket
import subprocess
import threading
from time import monotonic

from action_msgs.msg import GoalStatus
import pytest
from waiting import wait_for

from ur_cartesian_driver.cli.demo import process
from ur_cartesian_driver.motion.errors import ErrorCode
from ur_cartesian_driver.protocol.rtde.rtde_client import DataReceived, RtdeClientCodec
from ur_cartesian_driver.ros.client import GoalClient, load_goal

pytestmark = [pytest.mark.acceptance, pytest.mark.slow]

NODE_TIMEOUT = 1.0
#: A straight line of some decimetres in 3 s, to either side: it moves as long as is needed here.
GOAL = """
trajectory:
  points:
    - time_from_start: {sec: 3}
      pose:
        position: {x: -0.4919, y: %f, z: 0.4879}
        orientation: {x: 0.70710678, y: 0.70710678, z: 0.0, w: 0.0}
"""
SIDES = (0.0667, -0.3333)
#: What braking takes from the speed of that goal, and what a busy machine may add [s].
BRAKING, SLACK = 0.2, 0.8
AT_REST, MOVING = 1e-4, 0.08


class Witness:
    """Watches through RTDE whether the arm moves, and since when it has been at rest."""

    def __init__(self, port):
        self._connection = socket.create_connection(('127.0.0.1', port))
        self._connection.settimeout(0.5)
        self._client = RtdeClientCodec(['actual_qd'], frequency=125.0)
        self._connection.sendall(self._client.start())
        self._closing = threading.Event()
        self.speed = 0.0
        self.rest_since = 0.0
        self._thread = threading.Thread(target=self._listen)
        self._thread.start()

    def _listen(self):
        while not self._closing.is_set():
            try:
                data = self._connection.recv(65536)
            except TimeoutError:
                continue
            except OSError:
                return
            if not data:
                return
            for event in self._client.feed(data):
                if isinstance(event, DataReceived):
                    (speeds,) = event.values
                    assert isinstance(speeds, tuple)
                    self._take(max(map(abs, speeds)))
            self._connection.sendall(self._client.data_to_send())

    def _take(self, speed):
        if speed < AT_REST <= self.speed:
            self.rest_since = monotonic()
        self.speed = speed

    def until(self, condition, bound):
        wait_for(condition, bound, lambda: f'speed {self.speed} rad/s')

    def close(self):
        self._closing.set()
        self._thread.join()
        self._connection.close()


class Cell:
    """A simulator process; nodes that come and go; one client."""

    def __init__(self, stack):
        self._stack = stack
        self._environment = {**os.environ, 'PYTHONUNBUFFERED': '1'}
        self.simulator = stack.enter_context(
            process(
                'sim',
                '--model',
                'ur5',
                '--rtde-port',
                '0',
                '--primary-port',
                '0',
                '--dashboard-port',
                '0',
                environment=self._environment,
                stdout=subprocess.PIPE,
            )
        )
        line = self.simulator.stdout.readline()
        self.ports = dict(re.findall(r'(RTDE|primary|dashboard) (\d+)', line))
        self.witness = Witness(int(self.ports['RTDE']))
        stack.callback(self.witness.close)
        self.pool = stack.enter_context(ThreadPoolExecutor(1))
        self.node = None
        self._goals = itertools.cycle(SIDES)

    def start_node(self):
        parameters = {
            'ur_type': 'ur5',
            'headless_mode': 'true',
            'node_timeout': NODE_TIMEOUT,
            # Processes that start keep a small computer busy, which must not be what ends a goal.
            'max_state_age': 0.0,
            'rtde_port': self.ports['RTDE'],
            'primary_port': self.ports['primary'],
            'dashboard_port': self.ports['dashboard'],
            'reverse_port': 0,
            'script_sender_port': 0,
            'trajectory_port': 0,
            'script_command_port': 0,
        }
        settings = [w for name, value in parameters.items() for w in ('-p', f'{name}:={value}')]
        self.node = self._stack.enter_context(
            process(
                '--ros-args',
                '--log-level',
                'fatal',
                *settings,
                environment=self._environment,
                module='ur_cartesian_driver.ros.node',
            )
        )

    @property
    def robot_process(self):
        """The id of the robot process: the only child of the node."""
        (child,) = (
            word
            for task in Path(f'/proc/{self.node.pid}/task').iterdir()
            for word in (task / 'children').read_text().split()
        )
        return int(child)

    def moving(self, client):
        """Send the goal; return its future result when the arm moves."""
        deadline = monotonic() + 15.0
        while True:
            client.wait_ready(30.0)
            ended = self.pool.submit(self._send, client)
            self.witness.until(
                lambda ended=ended: self.witness.speed > MOVING or ended.done(), 5.0
            )
            if not ended.done():
                return ended
            # Result and status take different paths: READY may come from the process before.
            _, outcome, now = ended.result()
            assert outcome.error_code == ErrorCode.ROBOT_NOT_READY, outcome.error_string
            assert now < deadline, outcome.error_string

    def _send(self, client):
        """Return status, result and when it came."""
        status, result = client.send(load_goal(GOAL % next(self._goals)))
        return status, result, monotonic()

    def strike(self, pid, number):
        begin = monotonic()
        os.kill(pid, number)
        return begin

    def rest(self, begin, bound):
        """Wait until the arm is at rest, braked before the bound; return the time [s]."""
        bound += BRAKING + SLACK
        self.witness.until(lambda: self.witness.speed < AT_REST, bound)
        return self.witness.rest_since - begin

    def check(self, what, begin, ended, *, rest, result):
        """Wait for standstill and result of a goal whose connection was lost."""
        standstill = nan if rest is None else self.rest(begin, rest)
        status, outcome, when = ended.result(result + SLACK + 1.0)
        assert when - begin < result + SLACK
        assert (status, outcome.error_code) == (
            GoalStatus.STATUS_ABORTED,
            ErrorCode.CONNECTION_LOST,
        ), outcome.error_string
        self.note(what, standstill, when - begin)

    @staticmethod
    def note(what, standstill, result=nan):
        print(f'{what}: at rest after {standstill:.3f} s, result after {result:.3f} s')


@pytest.fixture
def cell(private_ros_graph):
    with ExitStack() as stack:
        yield Cell(stack)


def test_whichever_process_dies_or_hangs_the_arm_stops_and_the_client_gets_a_result(cell):
    cell.start_node()
    with GoalClient() as client:
        ended = cell.moving(client)
        begin = cell.strike(cell.robot_process, signal.SIGSTOP)
        cell.check('robot process stopped', begin, ended, rest=0.2, result=5.0)
        ended = cell.moving(client)  # with the process that has taken its place
        begin = cell.strike(cell.robot_process, signal.SIGKILL)
        cell.check('robot process killed', begin, ended, rest=0.0, result=0.2)
        ended = cell.moving(client)
        begin = cell.strike(cell.node.pid, signal.SIGSTOP)
        standstill = cell.rest(begin, NODE_TIMEOUT)
        resumed = cell.strike(cell.node.pid, signal.SIGCONT)
        _, outcome, when = ended.result(5.0)
        assert 'node_timeout' in outcome.error_string
        cell.note('node stopped; result after it went on', standstill, when - resumed)
        cell.moving(client)
        # DDS tells of a server that was killed when its lease is over, after 20 s: not waited for.
        begin = cell.strike(cell.node.pid, signal.SIGKILL)
        cell.note('node killed', cell.rest(begin, 0.0))
    cell.start_node()
    with GoalClient() as client, ThreadPoolExecutor(1) as cell.pool:
        ended = cell.moving(client)
        begin = cell.strike(cell.simulator.pid, signal.SIGKILL)
        cell.check('robot killed', begin, ended, rest=None, result=0.2)
