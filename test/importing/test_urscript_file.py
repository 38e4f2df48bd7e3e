# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""URScript as PolyScope saves it and offline programming writes it."""

from dataclasses import replace
from math import pi, sqrt

import numpy as np
import pytest

from ur_cartesian_driver.importing import BrokenFile, import_file, ImportOptions
from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.kinematics.robot_models import robot_model
from ur_cartesian_driver.motion.geometry.pose import Pose
from ur_cartesian_driver.motion.geometry.vectors import vector6
from ur_cartesian_driver.motion.goal.goal import InputKind, InputWait, OutputKind, SegmentType
from ur_cartesian_driver.motion.state.io_signals import AnalogDomain

#: As an offline programming tool writes it: one function, speeds as variables, a loop.
PROGRAM = """def weld():
  global speed_ms = 0.05
  set_tcp(p[0, 0, 0.1, 0, 0, 0])
  popup("Ready?")
  movej([0, -1.5708, 1.5708, -1.5708, -1.5708, 0], a=1.4, v=1.05, r=0)
  start = get_actual_tcp_pose()
  i = 0
  while i < 3:
    movel(pose_trans(start, p[0.02 * i, 0, 0.05, 0, 0, 0]), accel_mss(), speed_ms, 0, 0.005)
    i = i + 1
  end
  set_digital_out(2, True)
  movec(pose_add(start, p[0, .01, -.05, 0, 0, 0]), pose_add(start, p[0, 0.1, 0, 0, 0, 0]), v=0.02)
  set_tool_digital_out(1, False)
end
"""
PROGRAM = PROGRAM.replace('accel_mss()', '1.2')


Q = '[0, -1.5, 1.5, -1.5, -1.5, 0]'
#: Points 100 mm apart, with the tool down.
A, B, C = (f'p[{x}, -0.4, 0.3, 0, 3.14159, 0]' for x in (0.1, 0.2, 0.3))


def imported(tmp_path, text, **options):
    file = tmp_path / 'weld.script'
    file.write_text(text)
    return import_file(file, ImportOptions(**options))


def refusal(tmp_path, text, **options):
    """Return line and sentence of a refusal."""
    with pytest.raises(BrokenFile) as caught:
        imported(tmp_path, text, **options)
    assert '\n' not in str(caught.value)
    return caught.value.line, str(caught.value)


def places(found):
    return np.array(found.goal.waypoints.poses)[:, :3]


def said(found):
    return [remark.text() for remark in found.remarks]


def test_moves_outputs_and_what_is_left_out(tmp_path):
    found = imported(tmp_path, PROGRAM)
    kinds = found.goal.segments.types.tolist()
    assert kinds == [SegmentType.JOINT, *[SegmentType.LINEAR] * 3, SegmentType.CIRCULAR]
    assert found.lines.tolist() == [5, 9, 9, 9, 13]
    x = places(found)
    assert np.linalg.norm(np.diff(x[1:4], axis=0), axis=1) == pytest.approx([0.02, 0.02])
    assert np.linalg.norm(x[1] - x[0]) == pytest.approx(0.05)
    assert found.goal.segments.velocities.tolist() == [1.05, 0.05, 0.05, 0.05, 0.02]
    assert found.goal.segments.blend_radii.tolist()[1:3] == [0.005, 0.005]
    assert found.goal.waypoints.postures[0].values == pytest.approx(
        (0.0, -1.5708, 1.5708, -1.5708, -1.5708, 0.0)
    )
    assert [(c.waypoint, c.output, c.pin, c.value) for c in found.goal.io_commands] == [
        (3, OutputKind.STANDARD_DIGITAL, 2, 1.0),
        (4, OutputKind.TOOL_DIGITAL, 1, 0.0),
    ]
    assert said(found) == [
        'line 4: popup(): a goal tells nothing to persons',
        'line 3: set_tcp(p[0, 0, 0.1, 0, 0, 0]): the goal is of this TCP; the robot has to have '
        'it too',
        'line 5: joint positions: their places are those of a ur5e with the TCP '
        'p[0, 0, 0.1, 0, 0, 0]',
    ]


# ---- programs and libraries ---------------------------------------------------------------------


def test_statements_without_a_function_around(tmp_path):
    found = imported(tmp_path, f'movel({A})\nmovel({B})\n')
    assert found.lines.tolist() == [1, 2]


@pytest.mark.parametrize(
    'text',
    [
        '# by hand\n\nglobal a = 0.1\ndef go(x):\n  movel(p[x, -0.4, 0.3, 0, 3.14159, 0])\nend\n'
        'go(a)\ngo(0.2)\n',
        'def go(x):\n  movel(p[x, -0.4, 0.3, 0, 3.14159, 0])\nend\n'
        'def main():\n  go(0.1)\n  go(0.2)\nend\nmain()\n',
        'def go(x):\n  movel(p[x, -0.4, 0.3, 0, 3.14159, 0])\nend\n'
        'def main():\n  go(0.1)\n  go(0.2)\nend\n',
        'def main():\n  go(0.1)\n  go(0.2)\nend\n'
        'def go(x):\n  movel(p[x, -0.4, 0.3, 0, 3.14159, 0])\nend\n',
        f'def main():\n  x = 0.1\n  thread go():\n    x = 0.2\n  end\n  movel({A})\n'
        '  join run go()\n  movel(p[x, -0.4, 0.3, 0, 3.14159, 0])\nend\n\nmain()\n',
        f'\tdef main():\r\n\t\tmovel({A})\r\n\t\tmovel({B})\r\n\tend\r\n',
        f'def main(): movel({A}) movel({B}) end',
        f'\ufeff# begin: URCap Program Node\ndef main():\n  $ 1 "Robot Program"\n  movel({A})\n'
        f'  # end: URCap Program Node\n  $ 2 "x≔1" "noBreak"\n  movel({B})\nend\n',
    ],
    ids=[
        'statements first, function in between',
        'functions, and a call at the end',
        'functions, of which no other calls the last',
        'functions, of which no other calls the first',
        'a program and its call',
        'Windows, tabs',
        'one line',
        'PolyScope, with a byte order mark',
    ],
)
def test_a_file_is_read_however_its_program_stands_in_it(tmp_path, text):
    (tmp_path / 'weld.script').write_bytes(text.encode())
    found = import_file(tmp_path / 'weld.script')
    assert places(found)[:, 0].tolist() == pytest.approx([0.1, 0.2], abs=1e-12)


@pytest.mark.parametrize(
    ('text', 'line', 'sentence'),
    [
        (
            'def move_to(x, y):\n  movel(p[x, y, 0, 0, 0, 0])\nend\n',
            1,
            'the file only defines functions, move_to(x, y), and calls none; add a call of '
            'move_to at its end, with values',
        ),
        (
            '# a library\ndef open():\nend\ndef close(force):\nend\n',
            2,
            'the file only defines functions, open(), close(force), and calls none; add a call of '
            'open at its end',
        ),
        (
            '# c\n\n  sec a():\n  textmsg("x")\nend\n',
            3,
            'sec: a secondary program cannot move the arm',
        ),
        ('stop program\n', 1, 'this is no URScript: a statement is an assignment or a call'),
        (
            'import socket\n',
            1,
            "this is no URScript: there is no 'import'; this may be a file of Python",
        ),
        ('for i in a:\n', 1, "this is no URScript: there is no 'for'; count in a 'while' loop"),
        (
            'i = 0\ni += 1\n',
            2,
            "this is no URScript: there is no assignment such as '+='; write 'a = a + b'",
        ),
        ("textmsg('a')\n", 1, 'this is no URScript: a string stands in double quotes'),
        (
            'x = 1\nwhile x:\n  x = 2\n',
            3,
            "this is no URScript: the 'while' of line 2 has no 'end'",
        ),
        (
            'def a():\n  if 1:\n    x = 2\nend\n',
            4,
            "this is no URScript: the 'if' of line 2 has no 'end'",
        ),
        ('def a(:\n', 1, "this is no URScript: a name is missing before ':'"),
        ('movej([0, 1.2.3])\n', 1, 'this is no URScript: a number has two decimal points'),
        (
            'feature_1_p = my_feature_plane\n',
            1,
            "there is no variable 'my_feature_plane'; what the installation or another file "
            'defines has to be in this one',
        ),
        (
            'def a():\n  rq_close_and_wait()\nend\n',
            2,
            "there is no function 'rq_close_and_wait'; what the installation or another file "
            'defines has to be in this one',
        ),
        (
            'run step_counter()\n',
            1,
            "there is no thread 'step_counter'; what the installation or another file defines has "
            'to be in this one',
        ),
        ('def a(x):\nend\na()\n', 3, "a(): the argument 'x' is missing"),
        ('movej()\n', 1, "movej(): missing a required argument: 'q'"),
        ('movej([1, 2])\n', 1, 'Type error: q must be a list of 6 numbers'),
        (
            'movel(p[4, 0, 0, 0, 0, 0])\n',
            1,
            'movel leads 4 m away; lengths are in metres, 0.4 is 400 mm',
        ),
        (
            'movej([0, -90, 90, 0, 0, 0])\n',
            1,
            'movej leads a joint to -90 rad; angles are in radians, d2r() converts',
        ),
        (f'movel({A}, v=0)\n', 1, 'v is 0; it must be greater than 0'),
        (f'movel({A}, a=-1)\n', 1, 'a is -1; it must be greater than 0'),
        (f'movel({A}, r=-1)\n', 1, 'r is -1; it must not be negative'),
    ],
)
def test_a_refusal_is_one_sentence_with_its_line(tmp_path, text, line, sentence):
    assert refusal(tmp_path, text) == (line, f'line {line}: {sentence}.')


def test_a_file_without_a_move_tells_what_was_left_out(tmp_path):
    line, sentence = refusal(tmp_path, 'def a():\n  popup("x")\nend\n')
    assert line == 0
    assert sentence == (
        'there is no point of a path in the file; left out: line 2: popup(): a goal tells nothing '
        'to persons.'
    )


# ---- loops and threads --------------------------------------------------------------------------


def test_the_loop_around_a_saved_program_runs_once(tmp_path):
    """PolyScope writes it around the program, and threads with loops of their own before it."""
    found = imported(
        tmp_path,
        """def saved():
  set_input_actions_to_default()
  thread Counter():
    while (True):
      sync()
    end
  end
  run Counter()
  while (True):
    $ 1 "Robot Program"
    movej([0, -1.5, 1.5, -1.5, -1.5, 0])
    n = 0
    while n < 9:
      n = n + 1
      if n == 2:
        break
      end
    end
    movel(pose_add(get_actual_tcp_pose(), p[0, 0, 0.01 * n, 0, 0, 0]))
  end
end
""",
    )
    assert found.lines.tolist() == [11, 19]
    assert 'line 9: while: only the first round of this endless loop is taken' in said(found)


@pytest.mark.parametrize(
    'text',
    [
        'def go():\n  while True:\n    {a}\n    {b}\n  end\nend\ngo()\n{a}\n',
        '{a}\nwhile 1 == 1:\n  {b}\n  halt\nend\n',
        '{a}\nwhile True:\n  while True:\n    {b}\n  end\n  {a}\nend\n',
        'thread go():\n  {a}\n  while True:\n    {b}\n    {b}\n  end\nend\nrun go()\n'
        'while True:\n  sync()\nend\n',
    ],
    ids=['in a function', 'with a halt', 'in another', 'in a thread that moves'],
)
def test_what_stands_behind_a_loop_without_an_end_is_never_reached(tmp_path, text):
    found = imported(tmp_path, text.format(a=f'movel({A})', b=f'movel({B})'))
    assert places(found)[:, 0].tolist() == pytest.approx([0.1, 0.2])


def test_a_loop_that_a_program_leaves_runs_to_its_end(tmp_path):
    q = '[0.1 * n, -1.5, 1.5, -1.5, -1.5, 0]'
    text = 'def a():\n  n = 0\n  while True:\n    movej({})\n    n = n + 1\n    {}\n  end\nend\n'
    for leave in ('if n == 3: break end', 'if n == 3: halt end', 'if n == 3: return None end'):
        found = imported(tmp_path, text.format(q, leave))
        assert found.lines.tolist() == [4, 4, 4]


@pytest.mark.parametrize(
    ('text', 'line', 'why'),
    [
        ('x = 1\nwhile x:\n  movel({a})\n  movel({b})\nend\n', 4, ''),
        ('movel({a})\nwhile force() < 5:\n  sync()\nend\n', 3, 'force() of line 2'),
        (
            'r = [0]\nwhile r[0] < 3:\n  r = socket_read_ascii_float(3)\nend\n',
            3,
            'socket_read_ascii_float() of line 3',
        ),
        ('x = 1\nwhile x > 0:\n  x = x + 0.001\nend\n', 3, ''),
    ],
)
def test_any_other_loop_without_an_end_is_refused(tmp_path, monkeypatch, text, line, why):
    module = 'ur_cartesian_driver.importing.script.urscript_file'
    monkeypatch.setattr(f'{module}.MAX_CYCLES', 50)
    monkeypatch.setattr(f'{module}.MAX_NODES', 20_000)
    reason = (
        f': the value of {why} is assumed, because no robot answers during an import'
        if why
        else ''
    )
    assert refusal(tmp_path, text.format(a=A, b=B)) == (
        line,
        f'line {line}: the loop around this line does not end{reason}; take it out.',
    )


def test_a_failure_names_what_had_nothing_to_read(tmp_path):
    text = f'r = socket_read_ascii_float(3)\nmovel({A})\nmovel(p[r[1], 0, 0.2, 0, 0, 0])\n'
    assert refusal(tmp_path, text) == (
        3,
        'line 3: pose[0] is nan; it must be a finite number; the value of '
        'socket_read_ascii_float() of line 1 is assumed, because no robot answers during an '
        'import.',
    )


def test_a_thread_moves_while_the_main_one_waits(tmp_path):
    text = f'thread go():\n  movel({A})\n  movel({B})\nend\njoin run go()\nmovel({C})\n'
    assert imported(tmp_path, text).lines.tolist() == [2, 3, 6]


def test_two_threads_that_move_at_once_are_refused(tmp_path):
    text = f'thread go():\n  movel({A})\nend\nrun go()\nmovel({B})\n'
    assert refusal(tmp_path, text) == (
        2,
        'line 2: another thread is already controlling the robot.',
    )


def test_an_output_of_a_thread_beside_the_moves_is_left_out(tmp_path):
    blink = 'thread blink():\n  set_digital_out(1, True)\n  sleep(0.5)\nend\nrun blink()\n'
    found = imported(tmp_path, f'{blink}movel({A})\nmovel({B})\n')
    assert found.goal.io_commands == ()
    assert not found.goal.segments.dwells.any()
    assert said(found) == [
        'line 2: an output: when a thread switches it beside the moves is not in the file'
    ]


def test_the_main_thread_rests_and_switches_behind_one_that_moves(tmp_path):
    text = (
        f'thread go():\n  movel({A})\n  sleep(0.5)\n  movel({B})\nend\nh = run go()\n'
        'sync() sleep(3)\nset_digital_out(1, True)\njoin h\n'
        'sleep(0.25)\nset_digital_out(2, True)\n'
    )
    found = imported(tmp_path, text)
    assert found.goal.segments.dwells.tolist() == [0.5, 0.25]
    assert [(c.waypoint, c.pin, c.offset) for c in found.goal.io_commands] == [(1, 2, 0.25)]
    assert said(found) == [
        'line 8: an output: when a thread switches it beside the moves is not in the file'
    ]


def test_more_points_than_a_goal_has_are_refused(tmp_path, monkeypatch):
    monkeypatch.setattr('ur_cartesian_driver.importing.script.urscript_file.MAX_POINTS', 3)
    text = (
        'n = 0\nwhile n < 9:\n  movel(p[0.1 + 0.01 * n, -0.4, 0.3, 0, 3, 0])\n  n = n + 1\nend\n'
    )
    assert refusal(tmp_path, text) == (
        3,
        'line 3: there are more than 3 points and outputs up to here, and a goal has fewer; split '
        'the program, or take out a loop that does not end.',
    )


# ---- where the arm is ---------------------------------------------------------------------------


@pytest.mark.parametrize(
    'name', ['get_actual_tcp_pose', 'get_target_tcp_pose', 'get_actual_tool_flange_pose']
)
def test_a_pose_before_the_first_move_is_said_to_be_unknown(tmp_path, name):
    text = f'here = {name}()\nmovel({A})\nmovel(pose_add({name}(), p[0.1, 0, 0, 0, 0, 0]))\n'
    found = imported(tmp_path, text)
    assert places(found)[:, 0].tolist() == pytest.approx([0.1, 0.2], abs=1e-12)
    (text,) = said(found)
    assert text.startswith(
        f'line 1: {name}(): where the arm stands before its first move is not in the file; p['
    )


def test_joints_are_said_to_be_unknown_before_a_move_to_joints(tmp_path):
    text = 'movel({})\nq = get_actual_joint_positions()\nmovej({})\nq = get_joint_positions()\n'
    remarks = said(imported(tmp_path, text.format(A, Q)))
    assert remarks[0] == (
        'line 2: get_actual_joint_positions(): the joints before a move to joint positions are '
        'not in the file; those of a ur5e that are nearest to its home are taken'
    )
    assert [remark for remark in remarks if 'line 4' in remark] == []


def test_a_joint_move_to_a_pose_has_a_posture_where_the_file_knows_it(tmp_path):
    found = imported(tmp_path, f'movej({A})\nmovej({Q})\nmovej({B})\n')
    assert found.goal.segments.types.tolist() == [SegmentType.JOINT] * 3
    assert sorted(found.goal.waypoints.postures) == [1, 2]
    q = found.goal.waypoints.postures[2].values
    reached = Arm(robot_model('ur5e')).forward(q).position
    assert reached == pytest.approx((0.2, -0.4, 0.3), abs=1e-9)


def test_joint_positions_reach_the_places_of_a_calibrated_arm(tmp_path):
    model = robot_model('ur10e')
    d1, *others = model.geometry.d
    arm = Arm(model, replace(model.geometry, d=vector6([d1 + 0.01, *others])))
    tool = Pose((0.0, 0.0, 0.2))
    q = (0.2, -1.4, 1.6, -1.5, -1.5, 0.3)
    found = imported(tmp_path, f'movej({list(q)})\n', arm=arm, T_flange_tcp=tool)
    nominal = imported(tmp_path, f'movej({list(q)})\n', arm=Arm(model), T_flange_tcp=tool)
    assert places(found)[0] - places(nominal)[0] == pytest.approx([0, 0, 0.01], abs=1e-12)
    assert said(found) == [
        'line 1: joint positions: their places are those of a ur10e with the TCP '
        'p[0, 0, 0.2, 0, 0, 0]'
    ]


def test_joints_of_a_pose_of_the_file_depend_on_no_arm(tmp_path):
    """PolyScope writes moves so."""
    found = imported(tmp_path, f'movej(get_inverse_kin({A}, qnear={Q}))\n')
    assert places(found)[0] == pytest.approx([0.1, -0.4, 0.3], abs=1e-9)
    assert said(found) == []


def test_a_pose_that_needs_another_arm_names_the_arm(tmp_path):
    text = f'movej({Q})\nmovel(p[1.2, 0, 0.3, 0, 3.14159, 0])\nq = get_joint_positions()\n'
    line, sentence = refusal(tmp_path, text)
    assert (line, sentence) == (
        3,
        'line 3: a ur5e cannot reach p[1.2, 0, 0.3, 0, 3.14159, 0] with the TCP '
        'p[0, 0, 0, 0, 0, 0]; name your arm and its TCP in the options.',
    )
    ur20 = Arm(robot_model('ur20'))
    assert len(imported(tmp_path, text, arm=ur20).lines) == 2


def test_the_first_move_is_no_arc(tmp_path):
    line, sentence = refusal(tmp_path, f'movec({A}, {B})\n')
    assert (line, 'where its arc begins is not in the file' in sentence) == (1, True)


def test_moves_of_two_tools_are_refused(tmp_path):
    text = f'set_tcp(p[0, 0, 0.1, 0, 0, 0])\nmovel({A})\nset_tcp(p[0, 0, 0.2, 0, 0, 0])\n{{}}\n'
    line, sentence = refusal(tmp_path, text.format(f'movel({B})'))
    assert (line, 'split the program at its set_tcp' in sentence) == (4, True)


@pytest.mark.parametrize('order', ['before', 'after'])
def test_joint_moves_have_the_tool_of_the_lines(tmp_path, order):
    """A tool is taken, and put down, between joint moves."""
    line = f'set_tcp(p[0, 0, 0.1, 0, 0, 0])\nmovel({A})\n'
    joints = f'set_tcp(p[0, 0, 0, 0, 0, 0])\nmovej({Q})\n'
    found = imported(tmp_path, joints + line if order == 'before' else line + joints)
    row = 0 if order == 'before' else 1
    q = (0.0, -1.5, 1.5, -1.5, -1.5, 0.0)
    expected = (Arm(robot_model('ur5e')).forward(q) @ Pose((0.0, 0.0, 0.1))).position
    assert places(found)[row] == pytest.approx(expected, abs=1e-12)


def test_a_tool_that_is_set_moves_the_pose_that_is_read(tmp_path):
    text = (
        f'set_tcp(p[0, 0, 0.1, 0, 0, 0])\nmovej({Q})\na = get_actual_tcp_pose()\n'
        'set_tcp(p[0, 0, 0, 0, 0, 0])\nb = get_actual_tcp_pose()\n'
        'movel(pose_add(b, p[point_dist(a, b), 0, 0, 0, 0, 0]))\n'
    )
    x = places(imported(tmp_path, text))
    assert np.linalg.norm(x[1] - x[0]) == pytest.approx(0.1, abs=1e-9)


# ---- speeds, times, rests -----------------------------------------------------------------------


def time_of(length, speed, acceleration):
    """Return how long a trapezoid takes from rest to rest."""
    if length * acceleration <= speed**2:
        return 2.0 * sqrt(length / acceleration)
    return length / speed + speed / acceleration


@pytest.mark.parametrize('time', [0.3, 2.0, 20.0])
@pytest.mark.parametrize('rates', ['', ', a=0.5, v=0.1', ', a=0, v=0'])
def test_a_time_is_kept_from_rest_to_rest(tmp_path, time, rates):
    found = imported(tmp_path, f'movel({A})\nmovel({B}{rates}, t={time})\n')
    v, a = found.goal.segments.velocities[1], found.goal.segments.accelerations[1]
    assert time_of(0.1, v, a) == pytest.approx(time, rel=1e-9)
    assert said(found) == []


def test_a_time_of_joints_counts_the_one_that_turns_farthest(tmp_path):
    found = imported(tmp_path, f'movej({Q})\nmovej([0.3, -1.5, 0.5, -1.5, -1.5, 0], t=4)\n')
    v, a = found.goal.segments.velocities[1], found.goal.segments.accelerations[1]
    assert time_of(1.0, v, a) == pytest.approx(4.0, rel=1e-9)
    assert v / a == pytest.approx(
        (pi / 3) / (80.0 * pi / 180.0) * 4.0 / time_of(1.0, pi / 3, 80 * pi / 180)
    )


def test_a_time_is_said_to_be_rough_with_a_blend_and_unknown_at_first(tmp_path):
    text = f'movel({A}, t=2)\nmovel({B}, t=2, r=0.01)\nmovel({C}, t=2)\n'
    found = imported(tmp_path, text)
    assert said(found) == [
        'line 1: t of movel(): where the move begins is not in the file; a and v count',
        'lines 2-3: t of movel(): with a blend the time is kept only roughly',
    ]
    assert found.goal.segments.velocities[0] == 0.25


def test_a_turn_on_the_spot_has_four_radians_for_a_metre(tmp_path):
    """The controller counts so, as a recording of URSim shows; a goal counts radians."""
    turned = A.replace('0, 3.14159, 0]', '3.14159, 0, 0]')
    found = imported(tmp_path, f'movel({A}, a=1, v=0.2)\nmovel({turned}, a=1, v=0.2)\n')
    assert found.goal.segments.velocities.tolist() == pytest.approx([0.2, 0.8])
    assert found.goal.segments.accelerations.tolist() == pytest.approx([1.0, 4.0])


def test_a_rest_is_a_dwell_and_makes_a_stop(tmp_path):
    text = (
        f'sleep(1)\nmovel({A}, r=0.01)\nsleep(0.5)\nsleep(0.25)\nmovel({B}, r=0.01)\nmovel({C})\n'
    )
    found = imported(tmp_path, text)
    assert found.goal.segments.dwells.tolist() == [0.75, 0.0, 0.0]
    assert found.goal.segments.blend_radii.tolist() == [0.0, 0.01, 0.0]
    assert said(found) == [
        'line 1: sleep(): a goal begins with a move',
        'line 3: a blend: the arm stops at the point of line 2',
    ]


@pytest.mark.parametrize('stop', ['stopl(1.5)', 'stopj(2)'])
def test_a_stop_takes_the_blend_away(tmp_path, stop):
    found = imported(tmp_path, f'movel({A}, r=0.01)\n{stop}\nmovel({B})\n')
    assert found.goal.segments.blend_radii.tolist() == [0.0, 0.0]
    assert said(found) == ['line 2: a blend: the arm stops at the point of line 1']


def test_a_rest_longer_than_a_goal_can_have_is_refused(tmp_path):
    line, sentence = refusal(tmp_path, f'movel({A})\nsleep(601)\n')
    assert (line, '601 s, and a goal rests at most 600 s' in sentence) == (2, True)


def test_a_move_to_where_the_arm_is_adds_no_point(tmp_path):
    text = (
        f'movel({A})\nmovel({A})\nsleep(0.5)\nmovej({Q})\nmovej({Q})\nset_digital_out(1, True)\n'
    )
    found = imported(tmp_path, text)
    assert found.lines.tolist() == [1, 4]
    assert found.goal.segments.dwells.tolist() == [0.5, 0.0]
    assert found.goal.io_commands[0].waypoint == 1
    assert 'lines 2, 5: a point: it is where the one before is' in said(found)


def test_joints_that_are_there_after_lines_add_no_point(tmp_path):
    text = f'movej({Q})\nmovel({A})\nmovej(get_inverse_kin({A}, qnear={Q}))\nmovel({B})\n'
    assert imported(tmp_path, text).lines.tolist() == [1, 2, 4]


def test_joints_that_turn_at_a_place_are_a_move(tmp_path):
    found = imported(tmp_path, f'movej({Q})\nmovej({Q[:-2]}{2.0 * pi}])\n')
    assert found.lines.tolist() == [1, 2]
    assert found.goal.waypoints.postures[1].values[5] == pytest.approx(2.0 * pi)


# ---- outputs and inputs -------------------------------------------------------------------------


def test_outputs_keep_their_order_among_rests(tmp_path):
    text = (
        f'set_digital_out(0, False)\nmovel({A})\nset_digital_out(1, True)\nsleep(0.5)\n'
        f'set_digital_out(2, True)\nsleep(1)\nset_digital_out(1, False)\nmovel({B})\n'
    )
    found = imported(tmp_path, text)
    assert [(c.waypoint, c.pin, c.value, c.offset) for c in found.goal.io_commands] == [
        (0, 0, 0.0, 0.0),
        (0, 1, 1.0, 0.0),
        (0, 2, 1.0, 0.5),
        (0, 1, 0.0, 1.5),
    ]
    assert found.goal.segments.dwells.tolist() == [1.5, 0.0]
    assert said(found) == [
        'line 1: an output before the first move: it is switched at the first point'
    ]


def test_a_program_reads_its_outputs_back(tmp_path):
    text = (
        'set_digital_out(3, True)\nset_standard_analog_out(0, 0.5)\nx = 0.1\n'
        'if get_digital_out(3): x = 0.2 end\nif get_tool_digital_out(0): x = 0.3 end\n'
        'movel(p[x, -0.4, 0.3, 0, 3.14159, 0])\n'
    )
    assert places(imported(tmp_path, text))[0, 0] == pytest.approx(0.2)


def test_an_analog_output_has_the_domain_of_the_program(tmp_path):
    outputs = 'set_analog_out(1, 0.5)\nset_analog_outputdomain(0, 1)\nset_analog_out(0, 0.25)\n'
    found = imported(tmp_path, f'movel({A})\n{outputs}')
    assert [(c.pin, c.value, c.domain) for c in found.goal.io_commands] == [
        (1, 0.5, AnalogDomain.CURRENT),
        (0, 0.25, AnalogDomain.VOLTAGE),
    ]
    assert said(found) == [
        'line 2: an analog output: no set_analog_outputdomain before it; it is set as a current'
    ]


@pytest.mark.parametrize(
    ('condition', 'kind', 'pin', 'value'),
    [
        ('get_standard_digital_in(3) == False', InputKind.STANDARD_DIGITAL, 3, 1.0),
        ('(get_standard_digital_in(3) != True)', InputKind.STANDARD_DIGITAL, 3, 1.0),
        ('not get_configurable_digital_in(1 + 1)', InputKind.CONFIGURABLE_DIGITAL, 2, 1.0),
        ('True == get_tool_digital_in(1)', InputKind.TOOL_DIGITAL, 1, 0.0),
        ('get_digital_in(8)', InputKind.TOOL_DIGITAL, 0, 0.0),
        ('not (get_digital_in(7) == True)', InputKind.STANDARD_DIGITAL, 7, 1.0),
    ],
)
@pytest.mark.parametrize('body', ['sync()', 'sleep(0.01)', '$ 5 "Wait"\nsync()', ''])
def test_a_loop_that_waits_for_an_input_is_a_wait(tmp_path, condition, kind, pin, value, body):
    after = f'set_digital_out(1, True)\nmovel({B})\n'
    text = f'movel({A}, r=0.01)\nwhile {condition}:\n{body}\nend\n{after}'
    found = imported(tmp_path, text)
    assert found.goal.input_waits == (
        InputWait(waypoint=0, input=kind, pin=pin, value=value, timeout=600.0),
    )
    assert found.goal.segments.blend_radii.tolist() == [0.0, 0.0]
    (output,) = found.goal.io_commands
    assert output.waypoint == 0
    # Outputs without an offset come before the input of their point.
    assert output.offset > 0.0
    assert 'line 2: a wait for an input: without it the goal ends after 600 s' in said(found)


def test_waits_that_a_goal_has_no_place_for_are_refused_or_said(tmp_path):
    wait = 'while not get_digital_in(1): sync() end\n'
    assert said(imported(tmp_path, f'{wait}movel({A})\n')) == [
        'line 1: a wait for an input: a goal begins with a move'
    ]
    line, sentence = refusal(tmp_path, f'movel({A})\n{wait}{wait}')
    assert (line, 'a second wait at one point' in sentence) == (3, True)
    blink = 'set_digital_out(1, True)\nsleep(0.1)\nset_digital_out(1, False)\n'
    line, sentence = refusal(tmp_path, f'movel({A})\n{blink}{wait}')
    assert (line, 'a wait behind sleep() and an output' in sentence) == (5, True)


def test_an_input_that_has_come_is_read_so(tmp_path):
    text = (
        f'movel({A})\nwhile get_digital_in(2) == False:\n  sync()\nend\n'
        f'if get_digital_in(2):\n  movel({B})\nend\n'
    )
    assert len(imported(tmp_path, text).lines) == 2


@pytest.mark.parametrize(
    'waits', ['popup("Ready?", blocking=True)', 'pause', 'interpreter_mode()']
)
def test_nothing_waits_for_a_person(tmp_path, waits):
    assert len(imported(tmp_path, f'movel({A})\n{waits}\nmovel({B})\n').lines) == 2


# ---- bounds -------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    'text',
    [
        'a = make_list(100000, 0)\nwhile True:\n  a = a + a\n  if a[0] == 1: break end\nend\n',
        'a = make_list(100000, 0)\n' + 'a = a + 1\n' * 2000,
        's = struct(a=1)\nn = 0\nwhile n < 40:\n  s = struct(a=s, b=s)\n  n = n + 1\nend\n',
        's = struct(a=1)\nwhile True:\n  s = struct(a=s)\n  if s.a == 1: break end\nend\n',
        'a = make_list(300, 1.0)\nm = [' + ', '.join(['a'] * 300) + ']\n' + 'm = m * m\n' * 300,
        'm = [' + ', '.join(['make_list(101, 1.0)'] * 101) + ']\nm = inv(m)\n',
        'a = [0]\nwhile True:\n  a.insert(0, 1)\n  if a[0] == 2: break end\nend\n',
        's = "x"\nwhile True:\n  s = s + s\nif s == "": break end\nend\n',
        'i = 1\nwhile True:\n  i = i * 2\nif i == 0: break end\nend\n',
        'def f():\n  f()\nend\nf()\n',
        'thread t():\n  while True:\n    x = 1\n  end\nend\n'
        'while True:\n  run t()\n  if False: break end\nend\n',
        'x = ' + '9' * 5000 + '\nmovej([x, 0, 0, 0, 0, 0])\n',
        'x = ' + '(' * 2000 + '1' + ')' * 2000 + '\n',
        'x = 1' + ' + 1' * 2000 + '\n',
        'x = ' + '-' * 3000 + '1\n',
        'while True:\n' * 300,
        'sleep(1e300)\nwhile True:\n  sleep(1e300)\n  if time().sec < 0: break end\nend\n',
    ],
    ids=range(17),
)
@pytest.mark.slow
def test_a_program_cannot_take_all_time_or_memory(tmp_path, monkeypatch, text):
    """A hang would be one of the test; the bounds are smaller than the real ones."""
    module = 'ur_cartesian_driver.importing.script.urscript_file'
    monkeypatch.setattr(f'{module}.MAX_CYCLES', 2_000)
    monkeypatch.setattr(f'{module}.MAX_NODES', 1_000_000)
    line, sentence = refusal(tmp_path, text)
    assert line > 0
    assert len(sentence) < 300


@pytest.mark.parametrize(
    'option', [{'scale': 2.0}, {'frame': 'part'}, {'origin': Pose((1, 0, 0))}]
)
def test_joint_positions_of_a_program_cannot_be_moved(tmp_path, option):
    line, sentence = refusal(tmp_path, f'movel({A})\nmovej({Q})\n', **option)
    assert line == 2
    assert 'joint positions have no frame; give no frame, tool, origin or scale' in sentence
    assert len(places(imported(tmp_path, f'movel({A})\nmovel({B})\n', **option))) == 2
    line, sentence = refusal(tmp_path, f'movel({A})\nmovel({Q})\n', **option)
    assert line == 2
    assert 'joint positions have no frame; give no frame, tool, origin or scale' in sentence
    solved = f'movej(get_inverse_kin({A}, qnear={Q}))\n'
    assert len(places(imported(tmp_path, solved, **option))) == 1
    # What was solved for a pose of the file is that pose.
    followed = f'{solved}movej({B})\nmovel(get_inverse_kin({A}, qnear={Q}))\n'
    assert len(places(imported(tmp_path, followed, **option))) == 3


@pytest.mark.parametrize(
    'body',
    [
        'if get_standard_digital_in(3): break end\n  sync()',
        'sleep(0.1)\n  if get_standard_digital_in(3) == True:\n    break\n  end',
        'if not (get_standard_digital_in(3) == False): break end\n  sync()',
    ],
)
def test_a_loop_that_an_input_breaks_is_a_wait(tmp_path, body):
    found = imported(tmp_path, f'movel({A})\nwhile True:\n  {body}\nend\nmovel({B})\n')
    (wait,) = found.goal.input_waits
    assert (wait.waypoint, wait.input, wait.pin, wait.value) == (
        (0, InputKind.STANDARD_DIGITAL, 3, True)
    )
    assert len(places(found)) == 2
