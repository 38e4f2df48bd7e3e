# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Our program inside another one, as the External Control node puts it there."""

import re

import pytest
from robot_in_memory import REVERSE, RobotInMemory

from ur_cartesian_driver.motion.geometry.pose import Pose
from ur_cartesian_driver.motion.plan.primitive import MoveL
from ur_cartesian_driver.program.render import PREFIX
from ur_cartesian_driver.protocol.program.reverse import stop

HOME = (0.1, -1.4, 1.6, -1.8, -1.5, 0.2)

#: What a program of the pendant may do with a name: first, before our node, behind it.
VARIABLE = ('global {} = 7.5', '', 'textmsg("{} = ", {})')
FUNCTION = ('def {}():\n return 7.5\nend', '', 'textmsg("{} = ", {}())')
ASSIGNED_LATE = ('', '{} = 7.5', 'textmsg("{} = ", {})')


def split(text):
    """Divide the program as the node does: a header for the beginning, and a control loop."""
    header, control = text.split('# HEADER_END\n')
    return header, control


def first_level_names(text):
    """Names that the program defines, as its source has them."""
    defined = re.findall(rf'^\s*(?:def |thread )?{PREFIX}(\w+)(?: = |\()', text, re.MULTILINE)
    return sorted(set(defined))


def pendant_program(text, use, names):
    """Return a program around ours that uses the names of our source for its own."""
    header, control = split(text)
    first, before, after = ('\n'.join(part.replace('{}', n) for n in names) for part in use)
    lines = (
        'set_gravity([0.0, 0.0, 9.82])',
        *first.splitlines(),
        *header.splitlines(),
        'while (True):',
        '$ 1 "Robot Program"',
        *before.splitlines(),
        '$ 2 "Control by 192.168.56.1"',
        *control.splitlines(),
        '$ 3 "Script"',
        *after.splitlines(),
        'textmsg("the next node")',
        'end',
    )
    return 'def pendant():\n' + '\n'.join(f' {line}' for line in lines) + '\nend\n'


@pytest.mark.parametrize('use', [VARIABLE, FUNCTION, ASSIGNED_LATE])
def test_a_pendant_program_keeps_its_names(use):
    names = []

    def edit(text):
        names.extend(first_level_names(text))
        return pendant_program(text, use, names)

    robot = RobotInMemory('ur5e', edit=edit)
    assert {'control_mode', 'points_left', 'outputs', 'cancel', 'run_trajectory'} <= set(names)
    robot.place(HOME, Pose())
    controller = robot.controller
    for y in (0.01, -0.01):  # the second time, the control loop runs once more
        begin = controller.motion.T_base_tcp
        x, y0, z = begin.position
        target = Pose((x, y0 + y, z), begin.quaternion)
        assert not robot.run([MoveL(target=target, velocity=0.1, acceleration=1.0)]).failure
        connections = len(robot._accepted[REVERSE])
        robot._command(stop())
        for _ in range(500):
            controller.step()
        assert len(robot._accepted[REVERSE]) == connections + 1
        log = controller.messages.log
        assert 'the next node' in log
        assert [line for line in log if ' = ' in line] == [f'{name} = 7.5' for name in names]


def test_every_name_on_the_first_level_is_ours():
    robot = RobotInMemory('ur5e')
    robot.place(HOME, Pose())
    variables = robot.controller.programs._interpreter.variables
    assert len(variables) > 100
    assert [name for name in variables if not name.startswith(PREFIX)] == []
