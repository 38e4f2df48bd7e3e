# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Path offsets in our robot program: the tool beside its line, cycle by cycle, whatever is written.

The target of the simulated controller is measured, and the program's reports are compared with it.
"""

from math import inf
import os
import random

import numpy as np
import pytest
from robot_in_memory import REVERSE, RobotInMemory

from ur_cartesian_driver.execution.servo.offset_setpoints import BoundedOffset
from ur_cartesian_driver.motion.events import TrajectoryResult
from ur_cartesian_driver.motion.geometry.pose import IDENTITY, Pose
from ur_cartesian_driver.motion.geometry.vectors import vector3
from ur_cartesian_driver.motion.goal.goal import StaleOffset
from ur_cartesian_driver.motion.plan.offset_band import OffsetBand
from ur_cartesian_driver.motion.plan.primitive import MoveL
from ur_cartesian_driver.program.render import OFFSET_CONSTANTS
from ur_cartesian_driver.protocol.program.registers import (
    InputInteger,
    OffsetInput,
    OffsetOutput,
    OutputInteger,
)
from ur_cartesian_driver.protocol.program.reverse import trajectory, TrajectoryAction

#: How many random streams of offsets; 1000 take half an hour.
STREAMS = int(os.environ.get('PROGRAM_OFFSET_STREAMS', '2'))
HOME = (0.3, -1.4, 1.5, -1.6, -1.5, 0.2)
CYCLE = 0.002
LIMITS, SPEED, ACCELERATION = (0.001, 0.004, 0.0), 0.02, 0.2
RATE_CHANGE = OFFSET_CONSTANTS['RATE_CHANGE']
#: Along y, across -x, normal z.
AXES = np.array(((0.0, 1.0, 0.0), (-1.0, 0.0, 0.0), (0.0, 0.0, 1.0)))


@pytest.fixture(scope='module')
def robot():
    return RobotInMemory('ur5e')


class Line:
    """A line along y that gives way, the written offsets, and the places of the target."""

    def __init__(self, robot, length=0.06, velocity=0.1):
        self.robot = robot
        self.signals, self.motion = robot.controller.io, robot.controller.motion
        robot.place(HOME, IDENTITY)
        start = self.motion.T_base_tcp
        self.start = np.array(start.position)
        end = tuple(self.start + np.array((0.0, length, 0.0)))
        self.moves = [
            MoveL(target=Pose(end, start.quaternion), velocity=velocity, acceleration=1.0)
        ]
        self.sequence, self.target, self.rate = 5000, (0.0, 0.0, 0.0), 1.0
        self.places, self.values = [], []
        self.write()

    def write(self):
        self.sequence += 1
        self.signals.inputs.integers[InputInteger.SEQUENCE_ID] = self.sequence
        floats = self.signals.inputs.floats
        row = (*self.target, self.rate, *AXES.ravel(), *LIMITS, SPEED, ACCELERATION)
        floats[OffsetInput.TARGET : OffsetInput.TARGET + len(row)] = map(float, row)

    def keep(self):
        self.places.append(np.array(self.motion.T_base_tcp.position) - self.start)
        outputs = self.signals.outputs.floats
        self.values.append(outputs[OffsetOutput.VALUE : OffsetOutput.VALUE + 6])

    def run(self, write=lambda cycle: None, **fields):
        def on_cycle(controller):
            self.keep()
            write(len(self.places))

        return self.robot.run(self.moves, on_cycle=on_cycle, takes_offsets=True, **fields)

    def follow(self, target, cycle):
        self.target = target
        self.write()

    @property
    def beside(self):
        """Distances of the tool from the line, across and normal [m]."""
        return np.array(self.places) @ AXES[1:].T


def test_the_tool_moves_to_the_offset_and_is_on_its_line_at_the_end(robot):
    line = Line(robot)
    run = line.run(lambda cycle: line.follow((0.0, 0.003, 0.0), cycle))
    assert run.result is TrajectoryResult.SUCCESS
    assert line.beside[:, 0].max() == pytest.approx(0.003, abs=1e-6)
    assert np.abs(line.beside[:, 1]).max() < 1e-6
    assert line.places[-1] == pytest.approx((0.0, 0.06, 0.0), abs=2e-6)
    values = np.array(line.values)
    assert values[:, 3:] == pytest.approx(np.array(line.places) * (1.0, 0.0, 1.0), abs=4e-5)
    assert line.signals.outputs.integers[OutputInteger.LAST_SEQUENCE_ID] > 5000
    assert not line.motion.path_offset.is_active


@pytest.mark.parametrize('seed', range(STREAMS))
def test_whatever_is_written_the_offset_keeps_the_law_of_the_driver(robot, seed):
    rng, line = random.Random(seed), Line(robot)
    band = OffsetBand(
        limits=LIMITS,
        speed=SPEED,
        acceleration=ACCELERATION,
        timeout=1.0,
        on_stale=StaleOffset.HOLD,
        step=1.0,
        axes=np.zeros((2, 3, 3)),
        is_open=np.ones(2, dtype=np.bool_),
    )
    twin, expected, rows, time_rate = BoundedOffset(band), [], {}, 0.0

    def write(cycle):
        nonlocal time_rate
        read = line.signals.outputs.integers[OutputInteger.LAST_SEQUENCE_ID]
        target, rate = rows.pop(read, ((0.0, 0.0, 0.0), 0.0))
        change = RATE_CHANGE * CYCLE
        time_rate += max(-change, min(change, max(-1.0, min(1.0, rate)) - time_rate))
        if time_rate * CYCLE > 1e-6:
            cut = tuple(max(-a, min(a, b)) for a, b in zip(LIMITS, target, strict=True))
            twin.step(cut, time_rate * CYCLE)
        expected.append(twin.value)
        if rng.random() < 0.05:
            line.target = vector3(
                rng.choice((0.0, 1e9, -inf, rng.uniform(-0.006, 0.006))) for _ in 'xyz'
            )
            line.rate = rng.choice((1.0, 1.0, 0.5, 0.0, -1.0, 7.0))
        line.write()
        rows[line.sequence] = line.target, line.rate

    run = line.run(write)
    assert run.result is TrajectoryResult.SUCCESS
    places, values = line.beside, np.array(line.values)[:, :3]
    assert np.abs(places[:, 0]).max() < LIMITS[1] + 1e-6
    assert np.abs(places[:, 1]).max() < 1e-6
    speeds = np.diff(values, axis=0) / CYCLE
    assert (np.abs(values) <= np.array(LIMITS)).all()
    assert values[:300] == pytest.approx(np.array(expected[:300]), abs=1e-12)
    assert values.any()
    assert np.abs(speeds).max() <= SPEED + 1e-6
    # Its time changes its rate, too.
    strongest = ACCELERATION + RATE_CHANGE * SPEED
    assert np.abs(np.diff(speeds, axis=0)).max() / CYCLE <= strongest
    assert np.abs(np.diff(places, 2, axis=0)).max() / CYCLE**2 < strongest
    assert line.places[-1] == pytest.approx((0.0, 0.06, 0.0), abs=2e-6)


def test_a_driver_that_falls_silent_leaves_the_offset_as_it_was(robot):
    line = Line(robot)

    def write(cycle):
        if cycle < 100:
            line.follow((0.0, 0.004, 0.0), cycle)

    run = line.run(write)
    assert run.result is TrajectoryResult.SUCCESS
    y = np.array(line.places)[:, 1]
    late = line.beside[(y > 0.04) & (y < 0.055), 0]
    assert late == pytest.approx(0.004, abs=1e-6)
    assert line.places[-1] == pytest.approx((0.0, 0.06, 0.0), abs=2e-6)


def test_without_a_driver_that_writes_nothing_moves(robot):
    line = Line(robot)
    run = line.run()
    assert run.result is TrajectoryResult.FAILURE
    assert not np.any(line.places)
    assert any('no path offset arrived' in text for text in robot.controller.messages.log)


def test_a_cancel_brakes_beside_the_line_and_the_next_motion_is_not_displaced(robot):
    line = Line(robot)

    def write(cycle):
        line.follow((0.0, 0.004, 0.0), cycle)
        if cycle == 220:
            cancel = trajectory(TrajectoryAction.CANCEL, 1, read_timeout=0)
            robot._socket(REVERSE).feed(cancel.encode())

    run = line.run(write)
    assert run.result is TrajectoryResult.CANCELED
    assert line.beside[-1, 0] == pytest.approx(0.004, abs=2e-4)
    assert np.abs(np.diff(run.joints, 2, axis=0)).max() / CYCLE**2 < 1.3 * 4.0
    line.places.clear()
    run = robot.run(line.moves, on_cycle=lambda controller: line.keep())
    assert run.result is TrajectoryResult.SUCCESS
    assert line.beside[-1, 0] == pytest.approx(0.0, abs=2e-6)
    assert not line.motion.path_offset.is_active
