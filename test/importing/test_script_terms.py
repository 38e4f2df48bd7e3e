# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Each term of URScript's table, in a program: it is treated as the table says."""

from math import acos, asin, atan, atan2, cos, degrees, log, radians, sin, sqrt, tan

import numpy as np
import pytest
from script_calls import call, POSE, Q

from ur_cartesian_driver.importing import BrokenFile, FORMATS, import_file, Treatment
from ur_cartesian_driver.importing.script.script_terms import FUNCTIONS, STATEMENTS
from ur_cartesian_driver.motion.goal.goal import OutputKind, SegmentType
from ur_cartesian_driver.motion.state.io_signals import AnalogDomain
from ur_cartesian_driver.sim import SimulatorConfig
from ur_cartesian_driver.sim.builtins import controller_builtins
from ur_cartesian_driver.sim.controller import Controller

TERMS = FORMATS['urscript'].terms
#: Expressions of one number, and the number by another source. They become the x of a point.
NUMBERS = {
    'acos': ('0.1 * acos(0.2)', 0.1 * acos(0.2)),
    'asin': ('asin(0.2)', asin(0.2)),
    'atan': ('atan(0.2)', atan(0.2)),
    'atan2': ('0.1 * atan2(1, -2)', 0.1 * atan2(1, -2)),
    'cos': ('0.3 * cos(1.0)', 0.3 * cos(1.0)),
    'sin': ('0.3 * sin(1.0)', 0.3 * sin(1.0)),
    'tan': ('0.1 * tan(1.0)', 0.1 * tan(1.0)),
    'd2r': ('d2r(20)', radians(20.0)),
    'r2d': ('0.01 * r2d(0.5)', 0.01 * degrees(0.5)),
    'sqrt': ('sqrt(0.09)', sqrt(0.09)),
    'pow': ('pow(0.5, 2)', 0.25),
    'log': ('0.1 * log(10, 4)', 0.1 * log(4, 10)),
    'ceil': ('0.1 * ceil(2.2)', 0.3),
    'floor': ('0.1 * floor(2.8)', 0.2),
    'norm': ('0.1 * norm([1.0, 2.0, 2.0])', 0.3),
    'normalize': ('normalize([1.0, 2.0, 2.0])[0]', 1.0 / 3.0),
    'inv': ('inv([[2.0, 0.0], [0.0, 4.0]])[1, 1]', 0.25),
    'transpose': ('transpose([[0.1, 0.2], [0.3, 0.4]])[0, 1]', 0.3),
    'length': ('0.1 * length([1, 2, 3])', 0.3),
    'size': ('0.1 * size("four")', 0.4),
    'make_list': ('make_list(3, 0.2)[2]', 0.2),
    'get_list_length': ('0.1 * get_list_length([1, 2])', 0.2),
    'struct': ('struct(x=0.2).x', 0.2),
    'integer_to_binary_list': ('0.1 * length(integer_to_binary_list(5)) / 8', 0.4),
    'binary_list_to_integer': ('0.1 * binary_list_to_integer([True, True])', 0.3),
    'str_at': ('0.1 * to_num(str_at("123", 1))', 0.2),
    'str_cat': ('0.01 * to_num(str_cat("1", "2"))', 0.12),
    'str_empty': ('0.1 * str_len(to_str(str_empty("")))', 0.4),
    'str_find': ('0.1 * str_find("abc", "c")', 0.2),
    'str_len': ('0.1 * str_len("abc")', 0.3),
    'str_sub': ('0.01 * to_num(str_sub("1234", 1, 2))', 0.23),
    'to_num': ('to_num("0.25")', 0.25),
    'to_str': ('to_num(to_str(0.25))', 0.25),
    'pose_add': ('pose_add(p[.2,0,0,0,0,0], p[.1,0,0,0,0,0])[0]', 0.3),
    'pose_sub': ('pose_sub(p[.5,0,0,0,0,0], p[.1,0,0,0,0,0])[0]', 0.4),
    'pose_dist': ('pose_dist(p[.2,0,0,0,0,0], p[.5,0,0,0,0,0])', 0.3),
    'point_dist': ('point_dist(p[.2,0,0,1,0,0], p[.5,0,0,0,0,0])', 0.3),
    'interpolate_pose': ('interpolate_pose(p[.2,0,0,0,0,0], p[.4,0,0,0,0,0], 0.5)[0]', 0.3),
    'wrench_trans': (
        '0.1 * wrench_trans(p[0, 1, 0, 0, 0, 0], [2.0, 0, 0, 0, 0, 0])[5]',
        0.2,
    ),
    # At joints of zero the links lie along -x: a2 + a3 of the table by Denavit and Hartenberg.
    'get_forward_kin': ('-0.3 * get_forward_kin([0, 0, 0, 0, 0, 0])[0]', 0.3 * (0.425 + 0.3922)),
    'get_inverse_kin': (f'get_inverse_kin(get_forward_kin({Q}), qnear={Q})[0]', 0.2),
    'get_inverse_kin_has_solution': (
        f'0.1 * str_len(to_str(get_inverse_kin_has_solution(p[9, 0, 0, 0, 0, 0], qnear={Q})))',
        0.5,
    ),
    'is_within_safety_limits': (f'0.1 * str_len(to_str(is_within_safety_limits({Q})))', 0.4),
    'get_jacobian': (f'get_jacobian({Q})[5, 0] * 0.3', 0.3),
    'get_jacobian_time_derivative': (
        f'get_jacobian_time_derivative({Q}, [0, 0, 0, 0, 0, 0])[0, 0] + 0.3',
        0.3,
    ),
    'encoder_unwind_delta_tick_count': ('0.1 * encoder_unwind_delta_tick_count(0, 3)', 0.3),
    'get_steptime': ('100 * get_steptime()', 0.2),
    'get_tcp_offset': ('get_tcp_offset()[2] + 0.3', 0.3),
    'get_actual_tcp_pose': ('get_actual_tcp_pose()[0]', 0.3),
    'get_target_tcp_pose': ('get_target_tcp_pose()[0]', 0.3),
    'get_target_tcp_pose_along_path': ('get_target_tcp_pose_along_path()[0]', 0.3),
    'get_actual_tool_flange_pose': ('get_actual_tool_flange_pose()[0]', 0.3),
    'get_target_waypoint': ('get_target_waypoint()[0]', 0.3),
    'tool_pose': ('tool_pose()[0]', 0.3),
    'get_joint_positions': ('get_forward_kin(get_joint_positions())[0]', 0.3),
    'get_actual_joint_positions': ('get_forward_kin(get_actual_joint_positions())[0]', 0.3),
    'get_target_joint_positions': ('get_forward_kin(get_target_joint_positions())[0]', 0.3),
    'is_steady': ('0.1 * str_len(to_str(is_steady()))', 0.4),
    'get_actual_joint_speeds': ('get_actual_joint_speeds()[0] + 0.3', 0.3),
    'get_target_joint_speeds': ('get_target_joint_speeds()[0] + 0.3', 0.3),
    'get_target_joint_accelerations': ('get_target_joint_accelerations()[0] + 0.3', 0.3),
    'get_actual_tcp_speed': ('get_actual_tcp_speed()[0] + 0.3', 0.3),
    'get_target_tcp_speed': ('get_target_tcp_speed()[0] + 0.3', 0.3),
    'get_target_tcp_speed_along_path': ('get_target_tcp_speed_along_path()[0] + 0.3', 0.3),
}
#: Examples of the script manual, whose numbers are rounded.
MANUAL = {
    'pose_trans': ('pose_trans(p[.2,.5,.1,1.57,0,0], p[.2,.5,.6,1.57,0,0])[0]', 0.4),
    'pose_inv': ('pose_inv(p[.2,.5,.1,1.57,0,3.14])[0]', 0.19324),
    'rotvec2rpy': ('0.1 * rotvec2rpy([3.14, 1.57, 0])[2]', 0.09),
    'rpy2rotvec': ('0.1 * rpy2rotvec([3.14, 1.57, 0])[0]', 0.222153),
}
POINT = 'movel(p[{}, -0.3, 0.4, 0, 3.14159, 0])'
#: Programs of statements, and the x of their points.
STATEMENT_PROGRAMS = {
    'def': ('def f(x=0.1):\n{m}\nend\nf()\nf(0.2)\n', [0.1, 0.2]),
    'return': ('def f():\nreturn 0.3\nend\nx = f()\n{m}\n', [0.3]),
    'global': ('def f():\nglobal x = 0.2\nend\nf()\n{m}\n', [0.2]),
    'local': ('x = 0.1\ndef f():\nlocal x = 0.2\nend\nf()\n{m}\n', [0.1]),
    'if': ('x = 0.1\nif x > 1:\nx = 2\nelif x > 0:\nx = 0.3\nelse:\nx = 3\nend\n{m}\n', [0.3]),
    'switch': ('x = 2\nswitch x:\ncase 1:\nx = 0.1\ncase 2:\nx = 0.2\nend\n{m}\n', [0.2]),
    'while': ('x = 0.1\nwhile x < 0.25:\n{m}\nx = x + 0.1\nend\n', [0.1, 0.2]),
    'break': (
        'x = 0.1\nwhile True:\n{m}\nx = x + 0.1\nif x > 0.25:\nbreak\nend\nend\n',
        [0.1, 0.2],
    ),
    'continue': (
        'x = 0\nwhile x < 0.25:\nx = x + 0.1\nif x < 0.15:\ncontinue\nend\n{m}\nend\n',
        [0.2, 0.3],
    ),
    'halt': ('x = 0.1\n{m}\nhalt\nx = 0.2\n{m}\n', [0.1]),
    'thread': ('x = 0.1\nthread t():\n{m}\nend\nh = run t()\njoin h\nx = 0.2\n{m}\n', [0.1, 0.2]),
    'run': ('x = 0.1\nthread t():\nx = 0.2\nend\njoin run t()\n{m}\n', [0.2]),
    'join': ('x = 0.1\nthread t():\nsync()\nx = 0.2\nend\njoin run t()\n{m}\n', [0.2]),
    'kill': (
        'x = 0.1\nthread t():\nsync()\nx = 0.2\nend\nh = run t()\nkill h\nsync()\n{m}\n',
        [0.1],
    ),
    'enter_critical': ('enter_critical\nx = 0.1\nexit_critical\n{m}\n', [0.1]),
    'exit_critical': ('enter_critical\nx = 0.1\nexit_critical\n{m}\n', [0.1]),
    '$': ('x = 0.1\n$ 1 "Robot Program" "noBreak"\n{m}\n', [0.1]),
}
MOVES = {
    'movej': (f'movej({Q})', SegmentType.JOINT),
    'movel': (f'movel({POSE})', SegmentType.LINEAR),
    'movep': (f'movep({POSE})', SegmentType.PROCESS),
    'movec': (
        'movec(p[0.4, -0.4, 0.4, 0, 3.14159, 0], p[0.4, -0.3, 0.4, 0, 3.14159, 0])',
        SegmentType.CIRCULAR,
    ),
    'optimovej': (f'optimovej({Q})', SegmentType.OPTIMIZED_JOINT),
    'optimovel': (f'optimovel({POSE})', SegmentType.OPTIMIZED_LINEAR),
}
OUTPUTS = {
    'set_digital_out': ('set_digital_out(9, True)', (OutputKind.TOOL_DIGITAL, 1, 1.0)),
    'set_standard_digital_out': (
        'set_standard_digital_out(3, True)',
        (OutputKind.STANDARD_DIGITAL, 3, 1.0),
    ),
    'set_configurable_digital_out': (
        'set_configurable_digital_out(3, False)',
        (OutputKind.CONFIGURABLE_DIGITAL, 3, 0.0),
    ),
    'set_tool_digital_out': ('set_tool_digital_out(0, True)', (OutputKind.TOOL_DIGITAL, 0, 1.0)),
    'set_analog_out': ('set_analog_out(1, 0.25)', (OutputKind.STANDARD_ANALOG, 1, 0.25)),
    'set_standard_analog_out': (
        'set_standard_analog_out(0, 0.5)',
        (OutputKind.STANDARD_ANALOG, 0, 0.5),
    ),
}
#: Programs of parameters and other functions, and what shows in the goal that they were honoured.
A, B = 'p[0.2, -0.3, 0.4, 0, 3.14159, 0]', POSE
VIA = 'p[0.25, -0.35, 0.4, 0, 3.14159, 0]'
EFFECTS = {
    'a': (f'movel({A}, a=0.7)', lambda goal: goal.segments.accelerations[0], 0.7),
    'v': (f'movel({A}, v=0.07)', lambda goal: goal.segments.velocities[0], 0.07),
    # By v = d / t and a trapezoid whose ramps have the share of the one of a and v.
    't': (
        f'movel({A})\nmovel({B}, a=1, v=0.1, t=4)',
        lambda goal: (
            0.1 / goal.segments.velocities[1]
            + goal.segments.velocities[1] / goal.segments.accelerations[1]
        ),
        4.0,
    ),
    'r': (f'movel({A}, r=0.01)\nmovel({B})', lambda goal: goal.segments.blend_radii[0], 0.01),
    'mode': (
        f'movel({A})\nmovec({VIA}, {B}, mode=1)',
        lambda goal: goal.segments.arc_modes[1],
        1,
    ),
    'sleep': (f'movel({A})\nsleep(0.5)', lambda goal: goal.segments.dwells[0], 0.5),
    'sync': (
        't = 0\nwhile t < 0.3: t = t + get_steptime() sync() end\n' + POINT.format('t'),
        lambda goal: goal.waypoints.poses[0][0],
        pytest.approx(0.3, abs=0.003),
    ),
    'stopj': (
        f'movel({A}, r=0.01)\nstopj(2)\nmovel({B})',
        lambda goal: goal.segments.blend_radii[0],
        0.0,
    ),
    'stopl': (
        f'movel({A}, r=0.01)\nstopl(2)\nmovel({B})',
        lambda goal: goal.segments.blend_radii[0],
        0.0,
    ),
    'set_pos': (
        'set_pos([0, 0, 0, 0, 0, 0])\n' + POINT.format('0.3 * -get_actual_tcp_pose()[0]'),
        lambda goal: goal.waypoints.poses[0][0],
        0.3 * (0.425 + 0.3922),
    ),
    'set_tcp': (
        'set_pos([0, 0, 0, 0, 0, 0])\na = get_actual_tcp_pose()\nset_tcp(p[0, 0, 0.2, 0, 0, 0])\n'
        + POINT.format('point_dist(a, get_actual_tcp_pose())'),
        lambda goal: goal.waypoints.poses[0][0],
        0.2,
    ),
    'set_analog_outputdomain': (
        f'movel({A})\nset_analog_outputdomain(1, 1)\nset_analog_out(1, 0.5)',
        lambda goal: goal.io_commands[0].domain,
        AnalogDomain.VOLTAGE,
    ),
}


def imported(tmp_path, text):
    file = tmp_path / 'part.script'
    file.write_text(text)
    return import_file(file)


def x_of(found):
    return np.array(found.goal.waypoints.poses)[:, 0].tolist()


def terms(treatment):
    return [name for name, term in TERMS.items() if term.treatment is treatment]


def test_the_table_has_every_function_of_the_simulated_controller():
    known = controller_builtins(Controller(SimulatorConfig(), controller_builtins))
    assert len(known) > 200
    assert set(known) <= set(FUNCTIONS)


def test_each_honoured_term_has_its_program():
    done = {*NUMBERS, *MANUAL, *STATEMENT_PROGRAMS, *MOVES, *OUTPUTS, *EFFECTS}
    assert done == set(terms(Treatment.HONOURED))


@pytest.mark.parametrize('name', [*NUMBERS, *MANUAL])
def test_a_function_that_computes_or_reads_is_done(tmp_path, name):
    expression, expected = NUMBERS.get(name) or MANUAL[name]
    x_of_point = f'movel(p[{expression}, -0.35, 0.4, 0, 3.14159, 0])'
    found = imported(tmp_path, f'{POINT.format(0.3)}\n{x_of_point}\n')
    assert x_of(found)[1] == pytest.approx(expected, abs=1e-5 if name in MANUAL else 1e-12)


@pytest.mark.parametrize('name', STATEMENT_PROGRAMS)
def test_a_statement_is_done(tmp_path, name):
    text, xs = STATEMENT_PROGRAMS[name]
    found = imported(tmp_path, text.replace('{m}', POINT.format('x')))
    assert x_of(found) == pytest.approx(xs, abs=1e-12)


@pytest.mark.parametrize('name', MOVES)
def test_a_move_is_a_point_of_its_type(tmp_path, name):
    text, kind = MOVES[name]
    found = imported(tmp_path, f'movel(p[0.3, -0.4, 0.4, 0, 3.14159, 0])\n{text}\n')
    assert found.goal.segments.types.tolist() == [SegmentType.LINEAR, kind]
    assert found.lines.tolist() == [1, 2]


@pytest.mark.parametrize('name', EFFECTS)
def test_the_goal_shows_the_effect(tmp_path, name):
    text, shown, expected = EFFECTS[name]
    value = shown(imported(tmp_path, text + '\n').goal)
    assert value == (expected if name == 'sync' else pytest.approx(expected, abs=1e-12))


@pytest.mark.parametrize('name', OUTPUTS)
def test_an_output_is_switched_at_the_point_before(tmp_path, name):
    text, expected = OUTPUTS[name]
    found = imported(tmp_path, f'{POINT.format(0.2)}\n{text}\n{POINT.format(0.3)}\n')
    (command,) = found.goal.io_commands
    assert (command.waypoint, command.offset) == (0, 0.0)
    assert (command.output, command.pin, command.value) == expected


@pytest.mark.parametrize('name', terms(Treatment.LEFT_OUT))
def test_what_is_left_out_is_said_with_its_line(tmp_path, name):
    before, text = call(name)
    moves = [POINT.format(x) for x in (0.2, 0.3)]
    found = imported(tmp_path, f'{before}{moves[0]}\n{text}\n{moves[1]}\n')
    assert x_of(found) == pytest.approx([0.2, 0.3], abs=1e-12)
    line = 2 + before.count('\n')
    said = [r for r in found.remarks if line in r.lines and name in r.what]
    assert [r.why for r in said] == [TERMS[name].reason]


@pytest.mark.parametrize('name', terms(Treatment.REFUSED))
def test_what_is_refused_is_one_sentence_with_its_line(tmp_path, name):
    text = 'sec a():\n  set_digital_out(1, True)\nend\n' if name == 'sec' else call(name)[1]
    before = '' if name == 'sec' else f'movel({POSE})\n'
    with pytest.raises(BrokenFile) as caught:
        imported(tmp_path, before + text)
    assert caught.value.line == 1 + before.count('\n')
    assert str(caught.value).endswith(f': {TERMS[name].reason}.')
    assert name in str(caught.value)


def test_statements_and_functions_are_apart():
    assert {name for name, term in TERMS.items() if term.topic == STATEMENTS} >= {
        'def',
        'sec',
        '$',
    }
    assert not {'def', 'sec', 'a', 'mode'} & set(FUNCTIONS)
