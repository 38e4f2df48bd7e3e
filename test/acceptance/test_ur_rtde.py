# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The simulated controller with an independent client: the ``ur-rtde`` package of PyPI.

It uploads its own control program, moves the arm through RTDE registers, and knows only the ports
of a real robot; so each simulator has a loopback address of its own. The client runs as a process:
this file, executed, plays one of the `scenes` against an address and prints the client's readings.
"""

from __future__ import annotations

from collections.abc import Iterator
import contextlib
import json
from math import pi, sin
from pathlib import Path
import re
import subprocess
import sys
import threading
import time
from typing import Any

from checkout import CHECKOUT, needs_checkout
import numpy as np
from numpy.typing import ArrayLike
import pytest

for module in ('rtde_control', 'rtde_receive', 'rtde_io', 'dashboard_client'):
    pytest.importorskip(module)

#: The longest scene takes 8 s on a quiet machine [s].
TIMEOUT = 50.0
#: A tool in the flange, as a pose with a rotation vector.
TOOL = [0.01, 0.0, 0.1, 0.0, 0.0, pi / 2]
#: Not a scene: no interface of the package is connected before.
SERVE = 'serve'
PENDANT_TARGET = [0.3, -1.6, 1.7, -1.4, -1.5, 0.2]
HOME = (0.0, -pi / 2, pi / 2, -pi / 2, -pi / 2, 0.0)


# The client's side


class Client:
    """The interfaces of the package at one robot, and what they have read so far."""

    def __init__(self, host: str) -> None:
        from dashboard_client import DashboardClient
        from rtde_control import RTDEControlInterface
        from rtde_io import RTDEIOInterface
        from rtde_receive import RTDEReceiveInterface

        self.control = RTDEControlInterface(host, 500.0)
        self.receive = RTDEReceiveInterface(host, 500.0)
        self.io = RTDEIOInterface(host)
        self.dashboard = DashboardClient(host)
        self.dashboard.connect()
        self.readings: dict[str, Any] = {}

    def note(self, name: str, **values: Any) -> None:
        self.readings[name] = values | {
            'q': self.receive.getActualQ(),
            'pose': self.receive.getActualTCPPose(),
            'qd': self.receive.getActualQd(),
            'twist': self.receive.getActualTCPSpeed(),
        }

    def note_at_rest(self, name: str, **values: Any) -> None:
        """Note the readings once the arm rests.

        The package's two connections read packets of their own, so the answer to a move may be
        ahead of the newest state.
        """
        self.until(lambda: max(map(abs, self.receive.getActualQd())) < 1e-9)
        self.note(name, **values)

    @contextlib.contextmanager
    def sampled(self, name: str) -> Iterator[None]:
        """Read poses all the time while something moves the arm."""
        end, poses, joints = threading.Event(), [], []

        def read() -> None:
            while not end.wait(0.004):
                poses.append(self.receive.getActualTCPPose())
                joints.append(self.receive.getActualQ())

        reader = threading.Thread(target=read)
        reader.start()
        try:
            yield
        finally:
            end.set()
            reader.join()
        self.note_at_rest(name, poses=poses, joints=joints)

    def until(self, happened: Any) -> bool:
        """Wait until a condition holds."""
        give_up = time.monotonic() + 5.0
        while not happened() and time.monotonic() < give_up:
            time.sleep(0.01)
        return bool(happened())

    def upload(self) -> bool:
        """Start the control program again, and wait until it runs."""
        return self.control.reuploadScript() and self.until(self.control.isProgramRunning)


def offset(pose: list[float], x: float = 0.0, y: float = 0.0, z: float = 0.0) -> list[float]:
    return [pose[0] + x, pose[1] + y, pose[2] + z, *pose[3:]]


def moves(client: Client) -> None:
    control, receive = client.control, client.receive
    client.note_at_rest('start')
    target = [0.3, -1.6, 1.7, -1.4, -1.5, 0.2]
    client.note_at_rest('moveJ', done=control.moveJ(target, 1.05, 3.0), target=target)
    line = offset(receive.getActualTCPPose(), y=0.04, z=0.06)
    with client.sampled('moveL'):
        control.moveL(line, 0.25, 1.2)
    client.readings['moveL']['target'] = line
    near = offset(line, x=-0.05)
    client.note_at_rest('moveJ_IK', done=control.moveJ_IK(near, 1.05, 3.0), target=near)
    corners = [offset(near, z=0.08), offset(near, x=0.08, z=0.08), offset(near, x=0.08)]
    with client.sampled('blended'):
        control.moveL(
            [
                [*corner, 0.2, 1.2, radius]
                for corner, radius in zip(corners, (0.02, 0.03, 0.0), strict=True)
            ]
        )
    client.readings['blended']['corners'] = [near, *corners]
    start = receive.getActualTCPPose()
    via, end = offset(start, x=0.04, y=0.04), offset(start, x=0.08)
    with client.sampled('movec'):
        control.sendCustomScriptFunction('arc', f'\tmovec(p{via}, p{end}, a=1.2, v=0.2)\n')
    client.readings['movec'] |= {'start': start, 'via': via, 'end': end}
    client.note_at_rest('again', done=client.upload() and control.moveJ(HOME, 1.5, 3.0))
    asked = control.getInverseKinematics(near, target)
    client.note_at_rest(
        'kinematics',
        forward=control.getForwardKinematics(target, TOOL),
        joints=target,
        inverse=asked,
        of=near,
    )
    control.setTcp(TOOL)
    client.until(lambda: receive.getActualTCPPose()[:3] != client.readings['again']['pose'][:3])
    client.note_at_rest('tcp', offset=control.getTCPOffset())


def streams(client: Client) -> None:
    control, receive = client.control, client.receive
    home = receive.getActualQ()
    targets, actual, began = [], [], time.monotonic()
    for i in range(600):
        period = control.initPeriod()
        # Out and back within 1 s, then 0.2 s in which the arm may catch up.
        q = [home[0] + 0.1 * sin(pi * min(i, 500) / 500) ** 2, *home[1:]]
        control.servoJ(q, 0.0, 0.0, 0.002, 0.03, 1000)
        targets.append(q[0])
        actual.append(receive.getActualQ()[0])
        control.waitPeriod(period)
    client.note('servoJ', targets=targets, actual=actual, took=time.monotonic() - began)
    control.servoStop()
    before = receive.getActualTCPPose()
    control.speedL([0.0, 0.0, 0.05, 0.0, 0.0, 0.0], 0.5, 0.0)
    time.sleep(0.8)
    client.note('speedL', before=before)
    control.speedStop()
    client.note_at_rest('speedStop')
    control.moveJ([home[0] + 1.0, *home[1:]], 0.5, 1.0, True)
    client.until(lambda: receive.getActualQd()[0] > 0.4)
    client.note('running')
    control.stopJ(4.0)
    client.until(control.isSteady)
    client.note('stopJ')
    far = offset(receive.getActualTCPPose(), z=-0.2)
    control.moveL(far, 0.1, 1.0, True)
    client.until(lambda: receive.getActualTCPSpeed()[2] < -0.09)
    control.stopL(2.0)
    client.until(control.isSteady)
    client.note('stopL', far=far)


def signals(client: Client) -> None:
    control, receive, io = client.control, client.receive, client.io
    names = [
        name
        for name in dir(receive)
        if name.startswith(('getA', 'getF', 'getJ', 'getP', 'getR', 'getS', 'getT', 'is'))
    ]
    client.note('getters', values={name: getattr(receive, name)() for name in names})
    later = receive.getTimestamp()
    client.note('clock', ticks=client.until(lambda: receive.getTimestamp() > later + 0.1))
    for done in (
        io.setStandardDigitalOut(3, True),
        io.setConfigurableDigitalOut(2, True),
        io.setToolDigitalOut(1, True),
        io.setAnalogOutputVoltage(1, 0.25),
    ):
        assert done
    client.until(lambda: receive.getDigitalOutState(17))
    client.note(
        'outputs',
        bits=receive.getActualDigitalOutputBits(),
        volts=receive.getStandardAnalogOutput1(),
    )
    io.setStandardDigitalOut(3, False)
    client.note('cleared', cleared=client.until(lambda: not receive.getDigitalOutState(3)))
    io.setSpeedSlider(0.5)
    client.until(lambda: receive.getTargetSpeedFraction() == 0.5)
    q = receive.getActualQ()
    began = receive.getTimestamp()
    control.moveJ([q[0] + 0.5, *q[1:]], 0.5, 2.0)
    took = receive.getTimestamp() - began
    # The answer to moveJ may overtake the state of the cycle in which the arm came to rest.
    client.until(lambda: receive.getSpeedScaling() == 0.0)
    client.note(
        'slow',
        took=took,
        fraction=receive.getTargetSpeedFraction(),
        scaling=receive.getSpeedScaling(),
    )


def power(client: Client) -> None:
    control, receive, dashboard = client.control, client.receive, client.dashboard
    modes = [
        dashboard.robotmode(),
        dashboard.safetymode(),
        dashboard.isInRemoteControl(),
        dashboard.running(),
    ]
    control.triggerProtectiveStop()
    client.until(receive.isProtectiveStopped)
    client.note(
        'stopped',
        before=modes,
        safety=dashboard.safetymode(),
        running=control.isProgramRunning(),
        moved=control.moveJ(HOME, 1.0, 1.0),
    )
    refusals = []

    def unlocks() -> bool:
        try:
            dashboard.unlockProtectiveStop()
        except RuntimeError as error:
            refusals.append(str(error))
            return False
        return True

    client.until(unlocks)
    dashboard.closeSafetyPopup()
    client.until(lambda: not receive.isProtectiveStopped())
    q = [HOME[0] + 0.1, *HOME[1:]]
    client.note_at_rest(
        'unlocked',
        refused=refusals[0] if refusals else '',
        safety=dashboard.safetymode(),
        moved=client.upload() and control.moveJ(q, 1.0, 2.0),
    )
    control.stopScript()
    dashboard.powerOff()
    off = client.until(lambda: receive.getRobotMode() == 3)
    dashboard.powerOn()
    idle = client.until(lambda: receive.getRobotMode() == 5)
    dashboard.brakeRelease()
    running = client.until(lambda: receive.getRobotMode() == 7)
    client.note_at_rest(
        'cycled',
        modes=[off, idle, running],
        moved=client.upload() and control.moveJ(HOME, 1.0, 2.0),
    )
    dashboard.stop()
    client.note('ended', ended=client.until(lambda: not control.isProgramRunning()))


def serve_external_control(host: str, port: str) -> None:
    """Serve the package's own program to a node that fetches it, and move by it."""
    from rtde_control import RTDEControlInterface

    flags = RTDEControlInterface.FLAG_USE_EXT_UR_CAP
    control = RTDEControlInterface(host, 500.0, flags, int(port))
    assert control.moveJ(PENDANT_TARGET, 1.05, 3.0)
    control.stopScript()


SCENES = {scene.__name__: scene for scene in (moves, streams, signals, power)}


# Our side


def play(scene: str) -> dict[str, Any]:
    """Let the client play a scene against a simulator of its own; return its readings."""
    with simulator() as robot:
        done = subprocess.run(
            [sys.executable, str(Path(__file__)), scene, robot.config.host],
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
        words = sys.executable, str(Path(__file__)), SERVE, robot.config.host, str(free_port)
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


if __name__ == '__main__':
    if sys.argv[1] == SERVE:
        serve_external_control(*sys.argv[2:])
    else:
        it = Client(sys.argv[2])
        SCENES[sys.argv[1]](it)
        print(json.dumps(it.readings))
