# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The simulated controller with an independent client: the ``ur-rtde`` package of PyPI.

It uploads its own control program, moves the arm through RTDE registers, and knows only the ports
of a real robot; so each simulator has a loopback address of its own. The client runs as a process,
``test/support/ur_rtde_client.py``.
"""

from __future__ import annotations

from collections.abc import Iterator
import contextlib
import json
from math import pi
import re
import subprocess
import sys
import time
from typing import Any

from checkout import CHECKOUT, needs_checkout
import numpy as np
from numpy.typing import ArrayLike
import pytest
import ur_rtde_client
from ur_rtde_client import HOME, PENDANT_TARGET, SERVE, TOOL

for module in ('rtde_control', 'rtde_receive', 'rtde_io', 'dashboard_client'):
    pytest.importorskip(module)

CLIENT = ur_rtde_client.__file__
#: The longest scene takes 8 s on a quiet machine [s].
TIMEOUT = 50.0


def play(scene: str) -> dict[str, Any]:
    """Let the client play a scene against a simulator of its own; return its readings."""
    with simulator() as robot:
        done = subprocess.run(
            [sys.executable, CLIENT, scene, robot.config.host],
            text=True,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            timeout=TIMEOUT,
            check=False,
        )
        log = '\n'.join(robot.state().messages[-20:])
    assert done.returncode == 0, f'{done.stdout}\n{log}'
    return json.loads(done.stdout.splitlines()[-1])


@contextlib.contextmanager
def simulator(**settings: Any) -> Iterator[Any]:
    """Yield a simulated robot with the ports of a real one, on an address that is free."""
    from ur_cartesian_driver.sim import SimulatedRobot, SimulatorConfig

    for last in range(1, 255):
        robot = SimulatedRobot(
            SimulatorConfig(host=f'127.0.17.{last}', unlock_delay=1.0, **settings)
        )
        try:
            robot.start()
        except OSError:  # another run has it
            continue
        try:
            yield robot
        finally:
            robot.close()
        return
    raise OSError('No address of 127.0.17.0/24 is free.')


def forward(q: list[float]) -> np.ndarray:
    """Return the flange of a UR5e in its base, from the published table, link by link."""
    a = (0.0, -0.425, -0.3922, 0.0, 0.0, 0.0)
    d = (0.1625, 0.0, 0.0, 0.1333, 0.0997, 0.0996)
    alpha = (pi / 2, 0.0, 0.0, pi / 2, -pi / 2, 0.0)
    T = np.eye(4)
    for theta, a_i, d_i, alpha_i in zip(q, a, d, alpha, strict=True):
        c, s, ca, sa = np.cos(theta), np.sin(theta), np.cos(alpha_i), np.sin(alpha_i)
        T = T @ np.array(
            [
                [c, -s * ca, s * sa, a_i * c],
                [s, c * ca, -c * sa, a_i * s],
                [0.0, sa, ca, d_i],
                [0.0, 0.0, 0.0, 1.0],
            ]
        )
    return T


def matrix(pose: list[float]) -> np.ndarray:
    """Return a pose with a rotation vector as a matrix, by Rodrigues' formula."""
    T, v = np.eye(4), np.array(pose[3:])
    angle = np.linalg.norm(v)
    x, y, z = v / angle if angle else v
    K = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    T[:3, :3] += np.sin(angle) * K + (1.0 - np.cos(angle)) * K @ K
    T[:3, 3] = pose[:3]
    return T


def positions(reading: dict[str, Any]) -> np.ndarray:
    return np.array(reading['poses'])[:, :3]


def from_line(points: np.ndarray, start: ArrayLike, end: ArrayLike) -> np.ndarray:
    """Return the distances of points from a straight line [m]."""
    origin, along = np.array(start)[:3], np.subtract(end, start)[:3]
    along = along / np.linalg.norm(along)
    return np.linalg.norm(np.cross(points - origin, along), axis=1)


@pytest.mark.acceptance
@pytest.mark.slow
@pytest.mark.exhaustive
def test_its_moves_end_where_they_should_on_the_paths_that_were_asked_for():
    seen = play('moves')
    for name, reading in seen.items():
        if name != 'tcp':
            assert matrix(reading['pose']) == pytest.approx(forward(reading['q']), abs=1e-6), name
    assert seen['moveJ']['done']
    assert seen['moveJ']['q'] == pytest.approx(seen['moveJ']['target'], abs=1e-6)

    line = seen['moveL']
    assert line['pose'] == pytest.approx(line['target'], abs=1e-6)
    assert from_line(positions(line), seen['moveJ']['pose'], line['target']).max() < 1e-5
    for q, pose in zip(line['joints'], line['poses'], strict=True):
        # Read one after the other, so up to a cycle apart.
        assert matrix(pose) == pytest.approx(forward(q), abs=2e-3)

    assert seen['moveJ_IK']['done']
    assert matrix(seen['moveJ_IK']['pose']) == pytest.approx(
        matrix(seen['moveJ_IK']['target']), abs=1e-6
    )

    near, up, over, end = (np.array(c) for c in seen['blended']['corners'])
    path = positions(seen['blended'])
    for corner, radius in ((up, 0.02), (over, 0.03)):
        distance = np.linalg.norm(path - corner[:3], axis=1)
        assert 0.001 < distance.min() < radius  # cut, but not more than by the radius
        outside = path[distance > radius + 1e-4]
        assert len(outside) < len(path)
    away = (np.linalg.norm(path - up[:3], axis=1) > 0.0201) & (
        np.linalg.norm(path - over[:3], axis=1) > 0.0301
    )
    nearest = np.min(
        [from_line(path[away], a, b) for a, b in ((near, up), (up, over), (over, end))], axis=0
    )
    assert nearest.max() < 1e-4
    assert seen['blended']['pose'] == pytest.approx(list(end), abs=1e-4)

    arc = seen['movec']
    centre = np.add(arc['start'], arc['end'])[:3] / 2  # the via pose lies at a right angle
    moved = np.array([p for p in positions(arc) if np.linalg.norm(p - arc['start'][:3]) > 1e-4])
    assert np.linalg.norm(moved - centre, axis=1) == pytest.approx(0.04, abs=1e-4)
    assert np.linalg.norm(moved - np.array(arc['via'][:3]), axis=1).min() < 0.002
    assert arc['pose'] == pytest.approx(arc['end'], abs=1e-5)

    assert seen['again']['done']
    assert seen['again']['q'] == pytest.approx(HOME, abs=1e-6)
    kinematics = seen['kinematics']
    assert matrix(kinematics['forward']) == pytest.approx(
        forward(kinematics['joints']) @ matrix(TOOL), abs=1e-6
    )
    assert forward(kinematics['inverse']) == pytest.approx(matrix(kinematics['of']), abs=1e-6)
    assert seen['tcp']['offset'] == pytest.approx(TOOL, abs=1e-9)
    assert matrix(seen['tcp']['pose']) == pytest.approx(
        forward(seen['tcp']['q']) @ matrix(TOOL), abs=1e-6
    )


@pytest.mark.acceptance
@pytest.mark.slow
@pytest.mark.exhaustive
def test_its_streams_are_followed_and_its_stops_stop():
    seen = play('streams')
    servo = seen['servoJ']
    targets, actual = np.array(servo['targets']), np.array(servo['actual'])
    # The arm lags by servoj's lookahead of 0.1 s, at up to 0.32 rad/s, and by each pause of a
    # busy computer.
    assert np.median(np.abs(actual - targets)) < 0.03
    assert actual.max() == pytest.approx(0.1, abs=0.01)
    assert actual[-1] == pytest.approx(targets[-1], abs=1e-3)
    assert servo['took'] > 1.1  # 600 cycles, and what a busy machine adds

    speed = seen['speedL']
    assert speed['twist'] == pytest.approx([0.0, 0.0, 0.05, 0.0, 0.0, 0.0], abs=1e-4)
    moved = np.subtract(speed['pose'], speed['before'])
    assert abs(moved[:2]).max() < 1e-5
    assert 0.02 < moved[2] < 0.1  # 0.8 s at 0.05 m/s, less the ramp
    assert seen['speedStop']['twist'] == pytest.approx([0.0] * 6, abs=1e-9)

    assert seen['running']['qd'][0] == pytest.approx(0.5, abs=0.1)
    assert seen['stopJ']['qd'] == [0.0] * 6
    assert 0.0 < seen['stopJ']['q'][0] - seen['running']['q'][0] < 0.45
    assert seen['stopL']['twist'] == [0.0] * 6
    below = seen['stopJ']['pose'][2] - seen['stopL']['pose'][2]
    assert 0.005 < below < 0.18


@pytest.mark.acceptance
@pytest.mark.slow
@pytest.mark.exhaustive
def test_its_readings_and_its_outputs_are_those_of_the_robot():
    seen = play('signals')
    values = seen['getters']['values']
    assert values['getRobotMode'] == 7
    assert values['getSafetyMode'] == 1
    assert values['getSafetyStatusBits'] == 1
    assert values['getRuntimeState'] == 2
    assert values['getRobotStatus'] & 3 == 3  # powered, program running
    assert values['getActualQ'] == pytest.approx(HOME, abs=1e-6)
    assert values['getTargetQ'] == pytest.approx(HOME, abs=1e-6)
    assert values['getJointMode'] == [253] * 6
    assert values['getTimestamp'] > 40.0
    assert not values['isProtectiveStopped']
    assert not values['isEmergencyStopped']
    assert seen['clock']['ticks']
    assert seen['outputs']['bits'] == 1 << 3 | 1 << 10 | 1 << 17
    assert seen['outputs']['volts'] == pytest.approx(2.5)
    assert seen['cleared']['cleared']
    assert seen['slow']['fraction'] == 0.5
    assert seen['slow']['scaling'] == 0.0  # the arm rests; the slider is in the fraction alone
    # 0.5 rad at 0.5 rad/s and 2 rad/s^2 are 1.25 s, and twice that at half the speed.
    assert seen['slow']['took'] == pytest.approx(2.5, abs=0.5)


@pytest.mark.acceptance
@pytest.mark.slow
@pytest.mark.exhaustive
def test_its_dashboard_unlocks_a_protective_stop_and_cycles_the_power():
    seen = play('power')
    stopped = seen['stopped']
    assert stopped['before'] == ['Robotmode: RUNNING', 'Safetymode: NORMAL', True, True]
    assert stopped['safety'] == 'Safetymode: PROTECTIVE_STOP'
    assert not stopped['running']
    assert not stopped['moved']
    assert 'Cannot unlock' in seen['unlocked']['refused']
    assert seen['unlocked']['safety'] == 'Safetymode: NORMAL'
    assert seen['unlocked']['moved']
    assert seen['unlocked']['q'] == pytest.approx([0.1, *HOME[1:]], abs=1e-6)
    assert seen['cycled']['modes'] == [True, True, True]
    assert seen['cycled']['moved']
    assert seen['cycled']['q'] == pytest.approx(HOME, abs=1e-6)
    assert seen['ended']['ended']


PAGE = CHECKOUT / 'doc' / 'coming_from' / 'ur_rtde.md'


def way_of(snippet: str) -> np.ndarray:
    """Run a snippet of the page on a robot of its own; return where the tool has been [m]."""
    with simulator() as robot:
        snippet = snippet.replace('127.0.0.1', robot.config.host).replace(
            'headless_mode=True',
            'headless_mode=True, reverse_port=0, script_sender_port=0, trajectory_port=0, '
            'script_command_port=0, robot_receive_timeout=2.0, max_state_age=0.0',
        )
        places = [robot.state().T_base_tcp.position]
        with subprocess.Popen(
            [sys.executable, '-c', snippet],
            text=True,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
        ) as client:
            began = time.monotonic()
            while client.poll() is None and time.monotonic() - began < TIMEOUT:
                places.append(robot.state().T_base_tcp.position)
                time.sleep(0.005)
            client.kill()
            said = client.communicate()[0]
        assert client.returncode == 0, said
        return np.array([*places, robot.state().T_base_tcp.position])


@pytest.mark.acceptance
@pytest.mark.slow
@pytest.mark.exhaustive
@needs_checkout
def test_the_page_for_those_who_come_from_it_does_one_job_on_both_sides():
    snippets = re.findall(r'^```python\n(.*?)^```', PAGE.read_text('utf-8'), re.DOTALL | re.M)
    theirs, ours = map(way_of, snippets)
    start = theirs[0]
    end = np.add(start, (0.0, 0.1, 0.0))
    for way in theirs, ours:
        assert way[-1] == pytest.approx(end, abs=1e-4)
        assert np.min(way[:, 2]) == pytest.approx(start[2] - 0.05, abs=1e-4)
    # Each place of one way is near the other way, whose places are some millimetres apart.
    apart = np.linalg.norm(theirs[:, None] - ours[None], axis=2)
    assert max(apart.min(axis=0).max(), apart.min(axis=1).max()) < 0.004


@pytest.mark.acceptance
@pytest.mark.slow
@pytest.mark.parametrize(('model', 'polyscope'), [('ur5e', '5.21'), ('ur5', '3.15')])
def test_its_program_is_fetched_by_external_control(model, polyscope, free_port):
    """Somebody plays, and plays again as long as the package is not listening yet."""
    settings = {'program': 'external_control.urp', 'external_control_port': free_port}
    with simulator(model=model, polyscope=polyscope, **settings) as robot:
        words = sys.executable, CLIENT, SERVE, robot.config.host, str(free_port)
        with subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.STDOUT) as client:
            give_up = time.monotonic() + TIMEOUT
            while client.poll() is None and time.monotonic() < give_up:
                state = robot.state()
                if state.popups:
                    robot.close_popups()
                    robot.stop_program()
                elif state.runtime_state.name == 'STOPPED' and state.q[0] != PENDANT_TARGET[0]:
                    robot.play_program()
                time.sleep(0.05)
            client.kill()
            assert client.stdout is not None
            said = client.stdout.read().decode()
        assert client.returncode == 0, f'{said}\n{robot.state().messages[-20:]}'
        assert robot.state().q == pytest.approx(PENDANT_TARGET, abs=1e-9)
