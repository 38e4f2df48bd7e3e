# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The two experiments of the servoj guide: set-points without and with a buffer.

The tool goes up and down along the vertical axis repeatedly, on the simulated controller at two
positions of the speed slider. The set-points come at the rate of the packets, or from the driver's
servo loop. ``scripts/draw_servo_experiments.py`` draws ``doc/servo_experiments.png`` from the same
numbers.
"""

from dataclasses import dataclass
from functools import lru_cache
from math import pi, sin
from typing import Any

import numpy as np
from servo_cell import CYCLE, GUIDE, GuideCell, OpenLoopStream

from ur_cartesian_driver.execution.servo.servo_stream import ServoPhase, ServoSettings, ServoStream
from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.kinematics.inverse import nearest
from ur_cartesian_driver.kinematics.robot_models import robot_model
from ur_cartesian_driver.motion.geometry.pose import Pose
from ur_cartesian_driver.protocol.program.registers import ServoMode, SyncState

UNBUFFERED = GUIDE.with_name('servoj_unbuffered.script')
#: Height of the motion [m], and time for the way up and down [s].
HEIGHT, PERIOD = 0.1, 2.0
#: Number of other set-points that servoj may get before the driver's next one.
AHEAD = 200
#: Set-points of one period are computed once.
ROWS = round(PERIOD / CYCLE)


@lru_cache
def up_and_down(home):
    """Return the joints of one period, a row for each control step (n, 6) [rad]."""
    arm, q, rows = Arm(robot_model('ur5e')), home, []
    T = arm.forward(home)
    x, y, z = T.position
    for i in range(ROWS):
        height = HEIGHT * sin(pi * i / ROWS) ** 2
        q = nearest(arm, Pose((x, y, z + height), T.quaternion), q)
        rows.append(q)
    return np.array(rows)


class UpAndDown:
    """Set-points of a number of periods, or endless ones."""

    def __init__(self, rows, periods=np.inf):
        self._rows, self._end, self._step = rows, periods * len(rows), 0.0
        self.given, self.now = [], rows[0]

    @property
    def done(self):
        return self._step >= self._end - 0.5

    def next(self, dt):
        self._step += dt / CYCLE
        self.now = self._rows[round(self._step) % len(self._rows)]
        if dt > 0.0:
            self.given.append(self.now)
        return tuple(self.now)


@dataclass
class Result:
    """Measurements of each cycle: time [s], wanted and actual joints (n, 6) [rad], lag [s]."""

    times: np.ndarray
    wanted: np.ndarray
    actual: np.ndarray
    lag: np.ndarray
    #: Numbers of set-points written, and of set-points that servoj never got.
    written: int
    skipped: int

    @property
    def jerkiness(self):
        """The largest change of a joint's acceleration from one cycle to the next [rad/s^2]."""
        settled = self.actual[round(0.5 / CYCLE) :]
        return float(np.abs(np.diff(settled, n=3, axis=0)).max() / CYCLE**2)


class Experiment:
    """A robot with one of the programs, and the set-points that its servoj gets."""

    def __init__(self, program):
        self.cell = GuideCell(program)
        self.rows = up_and_down(self.cell.q)
        self.now, self.in_flight = self.cell.q, lambda: 0.0
        self.wanted, self.lag, self.written, self._received = [], [], [], []
        motion = self.cell.controller.motion
        original = motion.servoj

        def servoj(q, *settings):
            if not self._received or self._received[-1] != q:
                self._received.append(q)
            return original(q, *settings)

        patched: Any = motion
        patched.servoj = servoj  # records the set-points of the program, changes nothing

    def run(self, take, seconds, late):
        """
        Run the experiment for some seconds.

        :param late: period [cycles] in which a packet comes late, with the next one; 0 = never.
        """
        for i in range(round(seconds / CYCLE)):
            self.cell.cycle(take, delay=int(late > 0 and i % late == 0))
            self.wanted.append(self.now)
            self.lag.append(self.in_flight())

    def result(self):
        actual = np.array(self.cell.joints)
        skipped, at = 0, 0
        for row in map(tuple, self.written):  # servoj got them in the same order
            found = row in self._received[at : at + AHEAD]
            at += self._received[at : at + AHEAD].index(row) + 1 if found else 0
            skipped += not found
        return Result(
            CYCLE * np.arange(len(actual)),
            np.array(self.wanted),
            actual,
            np.array(self.lag),
            len(self.written),
            skipped,
        )


def unbuffered(slider: float, seconds: float, late: int = 0) -> Result:
    """Write a set-point for each packet without feedback from the robot."""
    experiment = Experiment(UNBUFFERED)
    experiment.cell.controller.set_slider(slider)

    def take(_):
        number = len(experiment.written) + 1
        q = experiment.rows[number % ROWS]
        experiment.written.append(q)
        experiment.now = q
        return (
            ServoMode.SERVO,
            number,
            0,
            SyncState.EXTERNAL_TO_ROBOT,
            *q,
            *(0.3,) * 6,
            number * CYCLE,
            0.0,  # the time of the motion, which the guide's program does not read
        )

    experiment.run(take, seconds, late)
    return experiment.result()


def buffered(slider: float, seconds: float, late: int = 0, *, closed_loop: bool = True) -> Result:
    """Stream set-points to the guide's sample program with our servo."""
    experiment = Experiment(GUIDE)
    source = UpAndDown(experiment.rows)
    stream = (
        ServoStream(source, ServoSettings(lookahead_time=0.06))
        if closed_loop
        else OpenLoopStream(
            source, ServoSettings(lookahead_time=0.06, max_lag=10.0, buffer_depth=5000)
        )
    )
    experiment.cell.controller.set_slider(slider)

    def take(feedback):
        row = stream.on_feedback(feedback, experiment.cell.time)
        if stream.phase is ServoPhase.READY:
            stream.begin()
        experiment.now = source.now
        return row

    experiment.in_flight = lambda: stream.in_flight
    experiment.run(take, seconds, late)
    # Set-points still in flight are not skipped.
    left = round(stream.in_flight / CYCLE) + 2
    experiment.written = source.given[:-left]
    return experiment.result()
