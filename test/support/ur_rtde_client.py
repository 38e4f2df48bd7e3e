# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
A program that uses a third-party client, the ``ur-rtde`` package of PyPI.

It plays one of the :data:`SCENES` against an address, and prints its readings as JSON.
"""

from __future__ import annotations

from collections.abc import Iterator
import contextlib
import json
from math import pi, sin
import sys
import threading
import time
from typing import Any

#: A tool in the flange, as a pose with a rotation vector.
TOOL = [0.01, 0.0, 0.1, 0.0, 0.0, pi / 2]
#: This is no scene, because no interface of the package is connected before.
SERVE = 'serve'
PENDANT_TARGET = [0.3, -1.6, 1.7, -1.4, -1.5, 0.2]
HOME = (0.0, -pi / 2, pi / 2, -pi / 2, -pi / 2, 0.0)


class Client:
    """The interfaces of the package at one robot, and their readings so far."""

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

        The package's two connections read separate packets, so the answer to a move may be ahead
        of the newest state.
        """
        self.until(lambda: max(map(abs, self.receive.getActualQd())) < 1e-9)
        self.note(name, **values)

    @contextlib.contextmanager
    def sampled(self, name: str) -> Iterator[None]:
        """Read poses during the block, in which the arm moves."""
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
    """Serve the package's own program to a node that fetches it, and move with this program."""
    from rtde_control import RTDEControlInterface

    flags = RTDEControlInterface.FLAG_USE_EXT_UR_CAP
    control = RTDEControlInterface(host, 500.0, flags, int(port))
    assert control.moveJ(PENDANT_TARGET, 1.05, 3.0)
    control.stopScript()


SCENES = {scene.__name__: scene for scene in (moves, streams, signals, power)}


if __name__ == '__main__':
    if sys.argv[1] == SERVE:
        serve_external_control(*sys.argv[2:])
    else:
        it = Client(sys.argv[2])
        SCENES[sys.argv[1]](it)
        print(json.dumps(it.readings))
