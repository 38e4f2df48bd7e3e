# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The robot program's text: complete, loadable, and with each number from one place only."""

import re
from typing import Any

import pytest

from ur_cartesian_driver.motion.errors import LocalProtocolError
from ur_cartesian_driver.motion.events import TrajectoryResult
from ur_cartesian_driver.program import ProgramSettings, render, wrap_in_program
from ur_cartesian_driver.program.prelude import Prelude, PreludeFunction
from ur_cartesian_driver.program.render import FEATURES, has_feature, MARKERS, PREFIX
from ur_cartesian_driver.protocol.program.point_fields import MotionType, SplineKind
from ur_cartesian_driver.protocol.program.registers import (
    ExternalError,
    InputDouble,
    InputInteger,
    OutputDouble,
    OutputInteger,
    ServoMode,
    SyncState,
)
from ur_cartesian_driver.protocol.program.reverse import ControlMode, TrajectoryAction
from ur_cartesian_driver.protocol.program.script_command import ScriptCommand, TcpPersistence
from ur_cartesian_driver.urscript import parse, ScriptInterpreter

SETTINGS: dict[str, Any] = {
    'host': '192.168.56.1',
    'reverse_port': 50001,
    'trajectory_port': 50003,
    'script_command_port': 50004,
}


def text(**changes):
    """Return the program with the names that its source has."""
    return render(ProgramSettings(**SETTINGS | changes)).replace(PREFIX, '')


@pytest.mark.parametrize('version', [(3, 15, 8), (5, 4, 0), (5, 21, 0), (10, 7, 0), (10, 12, 1)])
def test_the_program_can_be_parsed_for_every_software(version):
    assert parse(wrap_in_program(text(version=version))).name == 'ur_cartesian_driver'


def test_addresses_are_those_of_the_settings():
    lines = text(host='10.0.0.7', reverse_port=1, trajectory_port=2, script_command_port=3)
    for line in (
        'DRIVER_HOST = "10.0.0.7"',
        'REVERSE_PORT = 1',
        'TRAJECTORY_PORT = 2',
        'COMMAND_PORT = 3',
    ):
        assert line in lines.splitlines()


@pytest.mark.parametrize(
    ('prefix', 'members'),
    [
        ('MODE', ControlMode),
        ('TRAJECTORY', TrajectoryAction),
        ('MOTION', MotionType),
        ('SPLINE', SplineKind),
        ('RESULT', TrajectoryResult),
        ('COMMAND', ScriptCommand),
        ('TCP', TcpPersistence),
    ],
)
def test_every_wire_constant_comes_from_its_enum(prefix, members):
    lines = text().splitlines()
    for member in members:
        assert f'{prefix}_{member.name} = {member.value}' in lines


def test_the_progress_register_is_the_one_that_the_driver_reads():
    assert f'REGISTER_POINTS_BEGUN = {int(OutputInteger.POINTS_BEGUN)}' in text().splitlines()


def test_statements_contain_no_numbers_of_the_protocol():
    """Small ones index, count or are units; everything else has a name."""
    statements = [line for line in text().splitlines() if not re.match(r'\s*#|[A-Z_]+ = ', line)]
    numbers = {
        number
        for line in statements
        for number in re.findall(r'(?<![\w.])\d+(?:\.\d+)?(?![\w.])', re.sub(r'"[^"]*"', '', line))
    }
    assert numbers <= {*map(str, range(13)), '15', '0.0', '0.2', '1.0', '2.0', '1000.0'}


@pytest.mark.parametrize(
    ('feature', 'version', 'known'),
    [
        ('optimove', (5, 20, 9), False),
        ('optimove', (5, 21, 0), True),
        ('optimove', (10, 7, 9), False),
        ('optimove', (10, 8, 0), True),
        ('motion_version', (3, 15, 8), False),
        ('motion_version', (5, 21, 9), False),
        ('motion_version', (5, 22, 0), True),
        ('motion_version', (10, 12, 0), False),
        ('path_offset', (3, 15, 8), False),
        ('path_offset', (5, 6, 0), True),
        ('path_offset', (10, 12, 0), False),
        ('target_payload', (3, 15, 8), False),
        ('target_payload', (5, 10, 0), True),
    ],
)
def test_functions_are_called_only_if_the_controller_has_them(feature, version, known):
    assert has_feature(feature, version) == known
    name = {
        'optimove': 'optimovej(',
        'motion_version': ' motion_version_get(',
        'path_offset': 'path_offset_',
        'target_payload': 'set_target_payload(',
    }[feature]
    assert (name in text(version=version)) == known
    assert feature in FEATURES


def test_a_prelude_is_in_the_program_as_it_is():
    assert 'call_function' not in text()
    lines = ('outputs = 3', 'def cancel(running):', '  # urcd', '  outputs = running', 'end')
    prelude = Prelude(lines=lines, functions=(PreludeFunction(name='cancel', allowed=1),))
    program = render(ProgramSettings(**SETTINGS, prelude=prelude))
    assert parse(wrap_in_program(program))
    assert '\n'.join(line for line in lines if '#' not in line) in program
    assert '  if number == 0:\n    cancel()\n  elif number == 1:\n    cancel(x[0])\n' in program
    assert program.index(lines[0]) < program.index('# HEADER_END')


@pytest.mark.parametrize('allowed', [False, True])
def test_freedrive_functions_are_called_only_if_freedrive_is_allowed(allowed):
    program = text(allow_freedrive=allowed)
    assert (' teach_mode()' in program) is (' end_teach_mode()' in program) is allowed
    assert parse(wrap_in_program(program))


def test_no_local_has_the_name_of_a_global():
    """Only for assignments does the manual say which of the two a controller means."""
    everywhere, function, inside = set(), '', []
    for line in text(allow_freedrive=True).splitlines():
        if header := re.match(r'(?:def|thread) (\w+)\((.*)\):', line):
            function = header[1]
            inside += [(function, name) for name in re.findall(r'\w+', header[2])]
        elif line == 'end':
            function = ''
        elif name := re.match(r'\s*(local )?(\w+) = ', line):
            if not function:
                everywhere.add(name[2])
            elif name[1]:
                inside.append((function, name[2]))
            else:
                assert name[2] in everywhere | {
                    local for where, local in inside if where == function
                }, (function, name[2])
    assert len(inside) > 50
    assert not [place for place in inside if place[1] in everywhere]


def test_a_fraction_after_an_int_is_found(widened):
    """So the tests that run the program would find it."""
    text = 'x = 0\ny = [0, 0]\nz = 0\nx = 0.5\ny[1] = 1.5\nz = 1\nu = 0.0\nu = 0.5\n'
    ScriptInterpreter(parse(f'def f():\n{text}end\n'), {}).step()
    assert widened == {'x', 'y'}


def test_handles_of_threads_are_killed_and_not_compared():
    """No manual says how a controller compares a handle with a number."""
    handles = re.findall(r'(\w+) = run ', text())
    assert len(handles) == 8
    for handle in handles:
        assert re.search(rf'kill {handle}\b', text())
        assert not re.search(rf'\b{handle} *[!=]=|[!=]= *{handle}\b', text())


def test_one_function_stops_the_motion_of_another_thread_in_one_critical_section():
    lines = [line.strip() for line in text(allow_freedrive=True).splitlines()]
    assert sum('stopj(' in line for line in lines) == 1
    begin = lines.index('def stop_arm(at_contact):')
    section = lines[begin : lines.index('exit_critical', begin)]
    assert section[1] == 'enter_critical'
    assert section[-1] == 'brake()'
    for mover in ('motion_thread', 'servo_control_thread'):
        assert lines.count(f'kill {mover}') == section.count(f'kill {mover}') == 1


@pytest.mark.parametrize('host', ['', '1.2.3.4"', 'a b', 'x\n'])
def test_a_host_cannot_inject_text_into_the_program(host):
    with pytest.raises(LocalProtocolError, match='reverse_ip'):
        ProgramSettings(**SETTINGS | {'host': host})


def test_the_external_control_node_finds_its_markers_and_no_other_comment():
    lines = text().splitlines()
    comments = [line for line in lines if '#' in line]
    assert comments == [
        '# HEADER_BEGIN',
        '# HEADER_END',
        '# NODE_CONTROL_LOOP_BEGINS',
        '# NODE_CONTROL_LOOP_ENDS',
    ]
    assert set(comments) == MARKERS
    assert lines[0] == '# HEADER_BEGIN'  # what stands before it is lost


def test_no_line_is_empty():
    assert all(map(str.strip, text(allow_freedrive=True).splitlines()))


def test_an_uploaded_program_is_one_indented_definition_without_comments():
    lines = wrap_in_program(text()).splitlines()
    assert lines[0] == 'def ur_cartesian_driver():'
    assert lines[-1] == 'end'
    assert all(line.startswith('\t') for line in lines[1:-1])
    assert '#' not in ''.join(lines)


def test_an_include_is_inserted_with_its_settings():
    lines = text(servoj_gain=300.0, servo_buffer_depth=3, allow_freedrive=True).splitlines()
    assert lines.count('thread servo_control():') == 1
    assert not [line for line in lines if line.startswith('#!')]
    for line in (
        'SERVOJ_GAIN = 300.0',
        'SERVO_BUFFER_DEPTH = 3',
        'SERVO_ONES = [1.0, 1.0, 1.0]',
        'SERVO_ALLOW_FREEDRIVE = True',
    ):
        assert line in lines


@pytest.mark.parametrize(
    ('prefix', 'members'),
    [
        ('SERVO_IN', InputInteger),
        ('SERVO_IN', InputDouble),
        ('SERVO_OUT', OutputInteger),
        ('SERVO_OUT', OutputDouble),
        ('SERVO_MODE', ServoMode),
        ('SERVO_SYNC', SyncState),
        ('SERVO_ERROR', ExternalError),
    ],
)
def test_registers_of_the_servo_come_from_their_enums(prefix, members):
    lines = text().splitlines()
    for member in members:
        assert f'{prefix}_{member.name} = {member.value}' in lines
