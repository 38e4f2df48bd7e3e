# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The buffered servo in our robot program: what registers do to it, and how it ends."""

from itertools import pairwise
from math import pi, sin

import pytest
from robot_in_memory import REVERSE, RobotInMemory, TRAJECTORY

from ur_cartesian_driver.motion.plan.primitive import MoveJ
from ur_cartesian_driver.program import ProgramSettings, render, wrap_in_program
from ur_cartesian_driver.protocol.program.registers import (
    InputDouble,
    InputInteger,
    OutputDouble,
    OutputInteger,
    ServoMode,
    SyncState,
)
from ur_cartesian_driver.protocol.program.reverse import (
    buffered_servo,
    keepalive,
    trajectory,
    TrajectoryAction,
)
from ur_cartesian_driver.protocol.program.trajectory_points import encode_points
from ur_cartesian_driver.sim.motion.motion_ownership import FreedriveState

pytestmark = pytest.mark.slow

CYCLE, TIMEOUT = 0.002, 0.2
FAR = 0.3


class Servo:
    """A robot whose program listens to registers, and who writes them."""

    def __init__(self, **settings):
        self.robot = RobotInMemory('ur5e')
        if settings:
            program = render(
                ProgramSettings(
                    host='driver',
                    reverse_port=1,
                    trajectory_port=2,
                    script_command_port=3,
                    **settings,
                )
            )
            assert not self.robot.controller.programs.load('driver', wrap_in_program(program))
        self.robot._ready()
        self.controller = self.robot.controller
        self.home = self.controller.motion.q
        self.q, self.sequence, self.state_time, self.mode = self.home, 100, 5.0, ServoMode.IDLE
        self.error, self.threshold, self.stays = 0, FAR, True
        self._inputs = self.controller.io.inputs
        self.say(buffered_servo(round(1000.0 * TIMEOUT)))
        self.cycle(3)

    def say(self, message):
        self.robot._socket(REVERSE).feed(message.encode())

    def write(self, sequence=None):
        ints, floats = self._inputs.integers, self._inputs.floats
        ints[InputInteger.DESIRED_MODE] = int(self.mode)
        ints[InputInteger.SEQUENCE_ID] = self.sequence if sequence is None else sequence
        ints[InputInteger.EXTERNAL_ERROR] = self.error
        ints[InputInteger.EXTERNAL_SYNC_STATE] = int(SyncState.EXTERNAL_TO_ROBOT)
        first = InputDouble.DESIRED_JOINT_POSITIONS
        floats[first : first + 6] = self.q
        first = InputDouble.MAX_JOINT_DIVERGENCE_THRESHOLDS
        floats[first : first + 6] = [self.threshold] * 6
        floats[InputDouble.STATE_TIME] = self.state_time

    def cycle(self, count=1, steps=0):
        """Write something new in each cycle, and let it pass; ``steps`` of time with it."""
        for _ in range(count):
            if self.stays and self.controller.cycles % 40 == 0:
                self.say(buffered_servo(round(1000.0 * TIMEOUT)))
            self.sequence += 1
            self.state_time += steps * CYCLE
            self.write()
            self.controller.step()

    def enter(self, mode=ServoMode.SERVO):
        self.mode = mode
        self.cycle(5)
        return self

    def leave(self):
        self.stays = False
        self.say(keepalive(0))

    def __getitem__(self, register):
        out = self.controller.io.outputs
        return (out.floats if isinstance(register, OutputDouble) else out.integers)[register]

    @property
    def running(self):
        return self.controller.programs.running

    @property
    def speed(self):
        return max(map(abs, self.controller.motion.qd))

    @property
    def log(self):
        return ' '.join(self.controller.messages.log)

    def swing(self, cycles, amplitude=0.2):
        """Stream a motion of the first joint, a set-point in each cycle."""
        begin = self.state_time
        for _ in range(cycles):
            way = amplitude * sin(pi * (self.state_time - begin) / 2.0) ** 2
            self.q = (self.home[0] + way, *self.home[1:])
            self.cycle(steps=1)


def test_setpoints_are_carried_out_one_by_one_and_reported():
    servo = Servo().enter()
    servo.swing(200)
    assert servo[OutputInteger.ACTUAL_MODE] == ServoMode.SERVO
    assert servo[OutputInteger.LAST_SEQUENCE_ID] == servo.sequence
    assert servo[OutputInteger.SETPOINTS_DONE] == pytest.approx(200, abs=2)
    assert servo[OutputInteger.SKIPPED] == 0
    assert servo[OutputInteger.OVERFLOWS] == 0
    assert servo[OutputDouble.LAG_TIME] <= 2 * CYCLE
    assert servo.controller.motion.q[0] > servo.home[0] + 0.05


def test_an_older_sequence_number_is_ignored():
    servo = Servo().enter()
    servo.swing(50)
    q, state_time = servo.q, servo.state_time
    for _ in range(20):  # the inputs flicker between the newest write and an old one
        servo.cycle()
        servo.q, servo.state_time = servo.home, 4.0
        servo.write(sequence=servo.sequence - 3)
        servo.controller.step()
        servo.q, servo.state_time = q, state_time
    assert servo.running
    assert servo.controller.motion.q[0] == pytest.approx(q[0], abs=2e-3)


def test_a_setpoint_of_several_steps_is_divided_and_a_lost_write_costs_no_time():
    servo = Servo().enter()
    before = servo[OutputInteger.SETPOINTS_DONE]
    servo.sequence += 3
    servo.q = (servo.home[0] + 0.004, *servo.home[1:])
    servo.cycle(steps=4)
    assert servo[OutputInteger.SKIPPED] == 3
    servo.cycle(10)
    assert servo[OutputInteger.SETPOINTS_DONE] == before + 4


@pytest.mark.exhaustive
def test_a_full_buffer_is_counted_and_the_newest_setpoint_counts():
    servo = Servo(servo_buffer_depth=20).enter()
    servo.controller.set_slider(0.0)
    servo.cycle(200)
    for i in range(30):
        servo.q = (servo.home[0] + 1e-4 * (i + 1), *servo.home[1:])
        servo.cycle(steps=1)
    assert servo[OutputInteger.BUFFER_SIZE] == 20
    assert servo[OutputInteger.OVERFLOWS] == pytest.approx(10, abs=1)
    servo.controller.set_slider(1.0)
    servo.cycle(300)
    assert servo.controller.motion.q[0] == pytest.approx(servo.home[0] + 30e-4, abs=1e-5)


def stale(servo):
    for _ in range(round(TIMEOUT / CYCLE) + 3):
        if servo.controller.cycles % 40 == 0:
            servo.say(buffered_servo(round(1000.0 * TIMEOUT)))
        servo.controller.step()


def too_far(servo):
    servo.q = (servo.home[0] + 2.0 * FAR, *servo.home[1:])
    servo.cycle(steps=1)
    servo.cycle(2)


def error(servo):
    servo.error = 1
    servo.cycle(2)


def unknown_mode(servo):
    servo.mode = 9
    servo.cycle(2)


@pytest.mark.parametrize(
    ('cause', 'text'),
    [
        (stale, 'no new sequence number in time'),
        (too_far, 'divergence thresholds'),
        (error, 'reports the error 1'),
        pytest.param(unknown_mode, 'requests an unknown mode', marks=pytest.mark.exhaustive),
    ],
)
def test_the_arm_brakes_before_the_program_halts(cause, text):
    servo = Servo().enter()
    servo.swing(200)
    speed = servo.speed
    assert speed > 0.2
    cause(servo)
    speeds = [servo.speed]
    while servo.running:
        servo.controller.step()
        speeds.append(servo.speed)
        assert len(speeds) < 500
    assert text in servo.log
    assert speeds[-1] == 0.0, 'at rest when it halts'
    assert max(abs(a - b) for a, b in pairwise([*speeds, 0.0])) <= 4.0 * CYCLE + 1e-6
    assert servo[OutputInteger.ACTUAL_MODE] == ServoMode.IDLE


@pytest.mark.parametrize(
    'leave',
    [
        lambda servo: servo.leave(),
        pytest.param(lambda servo: servo.enter(ServoMode.IDLE), marks=pytest.mark.exhaustive),
    ],
)
def test_leaving_the_servo_brakes_and_the_program_continues(leave):
    servo = Servo().enter()
    servo.swing(200)
    leave(servo)
    servo.cycle(2)
    assert servo[OutputInteger.ACTUAL_MODE] == ServoMode.IDLE
    servo.cycle(150)
    assert servo.speed == 0.0
    assert servo.running
    # And again.
    servo.say(buffered_servo(200))
    servo.stays = True
    servo.home = servo.q = servo.controller.motion.q
    servo.enter().swing(100)
    assert servo[OutputInteger.ACTUAL_MODE] == ServoMode.SERVO
    assert servo.speed > 0.05


def test_a_driver_that_hangs_up_brakes_the_arm_too():
    servo = Servo().enter()
    servo.swing(200)
    servo.robot._socket(REVERSE).hang_up()
    while servo.running:
        servo.controller.step()
    assert servo.speed == 0.0


@pytest.mark.parametrize('allowed', [pytest.param(False, marks=pytest.mark.exhaustive), True])
def test_freedrive_is_possible_if_allowed_and_from_idle(allowed):
    servo = Servo(allow_freedrive=allowed)
    servo.enter(ServoMode.TEACH)
    guided = FreedriveState.TEACH if allowed else FreedriveState.OFF
    assert servo.controller.freedrive is guided
    servo.enter(ServoMode.IDLE)
    assert servo.controller.freedrive is FreedriveState.OFF
    servo.enter(ServoMode.SERVO)
    servo.enter(ServoMode.TEACH)
    assert servo.controller.freedrive is FreedriveState.OFF
    assert servo.running
    servo.enter(ServoMode.IDLE)
    servo.enter(ServoMode.TEACH)
    servo.say(keepalive(200))
    servo.controller.step()
    servo.controller.step()
    assert servo.controller.freedrive is FreedriveState.OFF, 'teaching ends with the mode'


def test_freedrive_ends_before_the_arm_brakes_for_a_halt():
    servo = Servo(allow_freedrive=True).enter(ServoMode.TEACH)
    assert servo.controller.freedrive is FreedriveState.TEACH
    servo.error = 1
    servo.cycle()
    assert servo.controller.freedrive is FreedriveState.OFF
    while servo.running:
        servo.cycle()
    assert 'reports the error 1' in servo.log


def test_a_refusal_of_freedrive_is_logged_once():
    servo = Servo(allow_freedrive=False).enter(ServoMode.TEACH)
    servo.cycle(20)
    assert servo.log.count('freedrive is not allowed') == 1
    assert servo[OutputInteger.ACTUAL_MODE] == ServoMode.IDLE


def test_the_servo_waits_for_an_arm_that_another_thread_brakes():
    """Two threads that move the arm at a time end the program."""
    robot = RobotInMemory('ur5e')
    robot._ready()
    controller, sockets = robot.controller, [robot._socket(port) for port in (REVERSE, TRAJECTORY)]
    timeout = round(1000.0 * TIMEOUT)
    sockets[0].feed(trajectory(TrajectoryAction.START, 1, timeout).encode())
    sockets[1].feed(encode_points([MoveJ(target=(0.5,) * 6, duration=2.0)]))
    for _ in range(500):
        sockets[0].feed(trajectory(TrajectoryAction.NOOP, 0, timeout).encode())
        controller.step()
    assert max(map(abs, controller.motion.qd)) > 0.1
    inputs = controller.io.inputs
    inputs.integers[InputInteger.DESIRED_MODE] = int(ServoMode.SERVO)
    inputs.integers[InputInteger.EXTERNAL_SYNC_STATE] = int(SyncState.EXTERNAL_TO_ROBOT)
    for sequence in range(1, 400):
        inputs.integers[InputInteger.SEQUENCE_ID] = sequence
        first = InputDouble.DESIRED_JOINT_POSITIONS
        inputs.floats[first : first + 6] = controller.motion.q
        first = InputDouble.MAX_JOINT_DIVERGENCE_THRESHOLDS
        inputs.floats[first : first + 6] = [FAR] * 6
        sockets[0].feed(buffered_servo(timeout).encode())
        controller.step()
    out = controller.io.outputs
    assert controller.programs.running, controller.messages.log
    assert max(map(abs, controller.motion.qd)) == 0.0
    assert out.integers[OutputInteger.ACTUAL_MODE] == ServoMode.SERVO


def test_no_variable_begins_as_an_int_and_is_given_a_fraction(widened):
    servo = Servo().enter()
    servo.swing(20)
    servo.sequence += 3
    servo.cycle(5, steps=3)
    servo.leave()
    servo.cycle(5)
    assert servo.running
    assert widened == set()
