# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The thread of the robot program that reads commands."""

import re

from robot_in_memory import RobotInMemory

from ur_cartesian_driver.program import wrap_in_program
from ur_cartesian_driver.protocol.program.script_command import SetPayloadCommand

HOME = (0.3, -1.4, 1.5, -1.6, -1.5, 0.2)


def with_reads_that_fail(text):
    """Return the program with commands that have to come within 0.1 s, else the read fails."""
    text, count = re.subn(r'(binary_integer\(\w+, \w+SOCKET_COMMAND), 0\)', r'\1, 0.1)', text)
    assert count == 1
    return wrap_in_program(text)


def test_commands_are_read_after_reads_that_failed():
    robot = RobotInMemory('ur5e', edit=with_reads_that_fail)
    robot.place(HOME, robot.controller.motion.T_flange_tcp)
    controller = robot.controller
    for mass in (1.5, 2.5):
        for _ in range(300):
            controller.step()
        robot.send_command(SetPayloadCommand(mass=mass))
        for _ in range(3):
            controller.step()
        assert controller.payload.mass == mass
    failures = [line for line in controller.messages.log if 'could not be read' in line]
    assert len(failures) == 2  # not with each of the ten reads
