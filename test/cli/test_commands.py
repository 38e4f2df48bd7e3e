# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The command line: its output and its exit status."""

from argparse import Namespace
import asyncio
from contextlib import nullcontext
import errno
from io import StringIO
import json
import os
from pathlib import Path
import signal
import subprocess
import sys
from typing import Any
from unittest.mock import Mock

import pytest
import yaml

from ur_cartesian_driver.cli import demo, main, parser
from ur_cartesian_driver.cli.commands import goal_file
from ur_cartesian_driver.cli.plan_commands import GoalPlanning
from ur_cartesian_driver.cli.plots import feedback_plot
from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.kinematics.robot_models import JOINT_NAMES, robot_model
from ur_cartesian_driver.planning.stop_prediction import state_at_rest
from ur_cartesian_driver.resources import share_path
from ur_cartesian_driver.ros.client import load_goal
from ur_cartesian_driver.sim.command_line.console import run_command

EXAMPLES = ['postures', 'seam', 'square']
HOME = (
    0.0,
    -1.5707963267948966,
    1.5707963267948966,
    -1.5707963267948966,
    -1.5707963267948966,
    0.0,
)


@pytest.mark.parametrize('example', EXAMPLES)
def test_validate_prints_the_plan_of_an_example(example, capsys):
    assert main(['validate', example]) == 0
    lines = capsys.readouterr().out
    points = len(load_goal(goal_file(example)).trajectory.points)
    for i in range(points):
        assert f'{i}' in lines
    assert 'MOVE' in lines


@pytest.mark.parametrize('given', ['2000', '2000mm', '-1mm', 'near'])
def test_send_refuses_a_length_that_must_be_a_mistake(given, capsys):
    """With such a length nothing could be resumed, and the note of a stop would be removed."""
    for option in ('--overlap', '--approach'):
        with pytest.raises(SystemExit):
            parser().parse_args(['send', 'seam', '--resume', option, given])
        assert option in capsys.readouterr().err
    arguments = parser().parse_args(['send', 'seam', '--resume', '--overlap', '8mm'])
    assert (arguments.overlap, arguments.approach) == (0.008, 0.03)


def test_validate_refuses_with_a_sentence_and_a_status(tmp_path, capsys):
    goal = yaml.safe_load(goal_file('square').read_text())
    goal['trajectory']['points'][2]['pose']['position']['x'] = 5.0
    file = tmp_path / 'far.yaml'
    file.write_text(yaml.safe_dump(goal))
    assert main(['validate', str(file)]) == 1
    assert 'trajectory.points[2]' in capsys.readouterr().err


def test_validate_names_the_code_of_a_refusal(capsys):
    assert main(['validate', 'square', '-p', 'max_tool_speed:=0.05']) == 1
    error = capsys.readouterr().err
    assert error.startswith('refused, INVALID_GOAL (-1): trajectory.points[0].time_from_start')
    assert 'max_tool_speed = 0.05 m/s' in error


def test_validate_takes_the_parameters_of_a_file_and_single_ones_before_those(tmp_path, capsys):
    file = tmp_path / 'cell.yaml'
    file.write_text(
        '/**/ur_cartesian_driver:\n  ros__parameters:\n    ur_type: ur10e\n'
        '    max_approach_distance: 0.1\n    on_too_fast: slow\n'
    )
    options = ['validate', 'square', '--params-file', str(file)]
    assert main(options) == 1
    assert 'max_approach_distance = 0.1 m' in capsys.readouterr().err
    assert main([*options, '-p', 'max_approach_distance:=0.0', '-p', 'max_tool_speed:=0.1']) == 0
    plan = capsys.readouterr().out
    assert plan.startswith('ur10e')
    assert 'because of max_tool_speed = 0.1 m/s' in plan


@pytest.mark.parametrize(
    ('words', 'says'),
    [
        (['-p', 'max_tool_sped:=1.0'], 'did you mean max_tool_speed?'),
        (['-p', 'max_tool_speed'], 'NAME:=VALUE'),
        (['-p', 'max_tool_speed:=1'], 'write 1.0'),
        (['-p', 'static_frames:=[a b'], 'not YAML'),
        (['--params-file', 'package.xml'], 'no parameters for a node'),
    ],
)
def test_validate_refuses_parameters_as_the_node_does(words, says, capsys, tmp_path):
    if words[0] == '--params-file':
        (tmp_path / words[1]).write_text('other:\n  ros__parameters: {}\n')
        words = [words[0], str(tmp_path / words[1])]
    assert main(['validate', 'square', *words]) == 1
    assert says in capsys.readouterr().err


def test_the_first_of_six_numbers_may_be_negative(capsys):
    assert main(['validate', 'relative', '--joints', '-0.1,-1.5,1.5,-1.5,-1.5,0']) == 0
    assert 'joints -0.1 -1.5 ' in capsys.readouterr().out


def test_validate_takes_tcp_and_calibration(capsys):
    assert main(['validate', 'square', '--tcp', '0,0,0.1,0,0,0', '--calibration-seed', '3']) == 0
    first, *_ = capsys.readouterr().out.splitlines()
    assert first == (
        'ur5e with its calibration, joints 0 -1.571 1.571 -1.571 -1.571 0 rad, TCP 0 0 0.1 0 0 0'
    )


def test_validate_reads_standard_input_and_puts_a_prefix_before_names(capsys, monkeypatch):
    monkeypatch.setattr('sys.stdin', StringIO(goal_file('postures').read_text()))
    assert main(['validate', '-', '--tf-prefix', 'left_', '-p', 'tf_prefix:=left_']) == 0
    assert main(['validate', 'postures', '-p', 'tf_prefix:=left_']) == 1
    assert 'left_base' in capsys.readouterr().err


@pytest.mark.parametrize('name', ['', 'left'])
def test_the_page_of_an_arm_of_the_demo_shows_its_plan(name, monkeypatch, tmp_path):
    started = []

    def process(*words, environment):
        started.append(words)
        return nullcontext(Mock())

    monkeypatch.setattr(demo, 'process', process)
    drawing = tmp_path / 'demo.png'
    arm = demo.DemoArm(name=name, goal=goal_file('square'), model='ur5e', drawing=drawing)
    demo._show(arm, {})
    (words,) = started
    assert GoalPlanning(parser().parse_args(words)).plan().goal.frame_id == f'{arm.tf_prefix}base'


def test_validate_reads_pipes_as_of_a_process_substitution(capsys):
    read, write = os.pipe()
    os.write(write, goal_file('square').read_bytes())
    os.close(write)
    assert main(['validate', f'/dev/fd/{read}']) == 0
    os.close(read)
    assert 'MOVE' in capsys.readouterr().out


def test_a_goal_that_is_nowhere_is_named_with_the_examples(capsys):
    assert main(['validate', 'no_such_goal']) == 1
    error = capsys.readouterr().err
    assert 'no_such_goal' in error
    assert all(example in error for example in EXAMPLES)


def test_where_prints_a_point_that_can_be_pasted_into_a_goal(ur_sim, capsys):
    assert main(['where', '--rtde-port', str(ur_sim.ports.rtde)]) == 0
    text = capsys.readouterr().out
    (point,) = yaml.safe_load(text)
    assert point['posture']['posture_joint_names'] == list(JOINT_NAMES)
    assert point['posture']['posture_joint_values'] == pytest.approx(HOME, abs=1e-6)
    goal = load_goal(yaml.safe_dump({'trajectory': {'points': [point]}}))
    position = goal.trajectory.points[0].pose.position
    expected = Arm(robot_model('ur5e')).forward(HOME).position
    assert (position.x, position.y, position.z) == pytest.approx(expected, abs=1e-6)


@pytest.mark.parametrize(
    ('text', 'sentence'),
    [
        ('trajectory: {points: [{time_from_strat: {sec: 1}}]}', 'did you mean time_from_start?'),
        (
            f'trajectory: {{points: [{{pose: {{position: {{x: {[0] * 1000}}}}}}}]}}',
            'trajectory.points[0].pose.position.x is [0, 0, ',
        ),
        (
            f'trajectory: {{header: {{frame_id: {"w" * 6000}}}, points: [{{}}]}}',
            f'trajectory.header.frame_id is "{"w" * 77}...", which',
        ),
        (
            'trajectory: {points: [{time_from_start: {sec: 9}, pose: {position: {x: 1.0e+308}}}]}',
            'is 1e+308 m away from the tool',
        ),
    ],
)
def test_a_mistake_in_a_goal_is_one_short_sentence(text, sentence, tmp_path, capsys):
    file = tmp_path / 'goal.yaml'
    file.write_text(text)
    assert main(['validate', str(file)]) == 1
    error = capsys.readouterr().err
    assert sentence in error
    assert len(error) < len(str(file)) + 400


def test_a_misspelt_example_is_suggested(capsys):
    assert main(['validate', 'squaare']) == 1
    assert capsys.readouterr().err == (
        'ur-cartesian validate: squaare is neither a file nor an example; did you mean square?\n'
    )


@pytest.mark.parametrize(
    ('words', 'sentence'),
    [
        (['validate', 'DIR'], 'DIR is a folder; name a goal file'),
        (['import', 'DIR'], 'DIR: this is a folder; name a file.'),
        (['identify', 'DIR'], 'DIR is a folder, but no recording; name one in it'),
        (
            ['validate', 'square', '--params-file', 'DIR/none'],
            'DIR/none: No such file or directory',
        ),
        (['validate', 'square', '--calibration', 'DIR'], 'DIR: Is a directory'),
        (['sim', '--programs', '/dev/null'], '/dev/null: Not a directory'),
    ],
)
def test_a_file_that_cannot_be_read_is_named(words, sentence, tmp_path, capsys):
    folder = str(tmp_path)
    assert main([word.replace('DIR', folder) for word in words]) == 1
    assert capsys.readouterr().err == (
        f'ur-cartesian {words[0]}: {sentence.replace("DIR", folder)}\n'
    )


def test_the_port_of_another_interface_is_named(ur_sim, capsys):
    port = ur_sim.ports.primary
    assert main(['where', '--rtde-port', str(port)]) == 1
    error = capsys.readouterr().err
    assert error.startswith(f'ur-cartesian where: 127.0.0.1 port {port} (RTDE): ')
    assert error.endswith('; is this the RTDE port (30004)?\n')


def test_where_nobody_is_says_so(capsys, closed_port):
    assert main(['where', '--rtde-port', str(closed_port)]) == 1
    assert f'port {closed_port}' in capsys.readouterr().err


def test_an_arm_that_is_said_to_stand_somewhere_stands_there():
    arm = Arm(robot_model('ur10e'))
    state = state_at_rest(arm, HOME)
    assert state.actual_q == HOME
    assert state.actual_tcp_pose == arm.forward(HOME)


@pytest.mark.slow
def test_the_simulator_says_where_it_listens_and_ends_on_a_signal():
    process = subprocess.Popen(
        [
            sys.executable,
            '-m',
            'ur_cartesian_driver.cli',
            'sim',
            '--rtde-port',
            '0',
            '--primary-port',
            '0',
            '--dashboard-port',
            '0',
            '--model',
            'ur10e',
        ],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env=os.environ | {'PYTHONUNBUFFERED': '1'},
    )
    try:
        line = process.stdout.readline()
        assert line.startswith('simulated ur10e on 127.0.0.1: RTDE ')
        process.send_signal(signal.SIGTERM)
        _, errors = process.communicate(timeout=10.0)
        assert process.returncode == 128 + signal.SIGTERM
        assert not errors
    finally:
        process.kill()
        process.wait()


def test_a_taken_port_is_one_sentence(ur_sim, capsys):
    assert (
        main(
            [
                'sim',
                '--rtde-port',
                str(ur_sim.ports.rtde),
                '--primary-port',
                '0',
                '--dashboard-port',
                '0',
            ]
        )
        == 1
    )
    error = capsys.readouterr().err
    assert str(ur_sim.ports.rtde) in error
    assert error.count('\n') == 1


def test_the_demo_begins_without_matplotlib(monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, 'matplotlib', None)
    assert parser().parse_args(['demo']).picture == Path('demo.png')
    with pytest.raises(SystemExit):
        parser().parse_args(['demo', '--picture', 'seam.png'])
    assert 'no picture without matplotlib' in capsys.readouterr().err


@pytest.mark.slow
def test_the_picture_shows_what_was_recorded(tmp_path):
    pytest.importorskip('matplotlib')
    record = tmp_path / 'feedback.jsonl'
    record.write_text(
        ''.join(
            json.dumps(
                {
                    'stamp': 0.1 * i,
                    'desired': [0.01 * i, 0.0, 0.2],
                    'actual': [0.01 * i, 1e-5, 0.2],
                    'speed': 0.1,
                }
            )
            + '\n'
            for i in range(20)
        )
    )
    drawing = tmp_path / 'picture.png'
    feedback_plot.draw(record, drawing, 'a line')
    assert drawing.read_bytes().startswith(b'\x89PNG')


@pytest.fixture
def own_signals():
    """Restore the handlers that a command has set."""
    before = {number: signal.getsignal(number) for number in SIGNALS}
    yield
    for number, handler in before.items():
        signal.signal(number, handler)


SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)


@pytest.mark.parametrize(
    ('notes', 'error'),
    [((), ''), (('the goal goes on',), 'send: [Errno 32] Broken pipe; the goal goes on\n')],
)
def test_a_closed_output_is_no_error_unless_there_is_something_to_say(
    own_signals, notes, error, capsys
):
    def run(_):
        broken = BrokenPipeError(errno.EPIPE, 'Broken pipe')
        for note in notes:
            broken.add_note(note)
        raise broken

    assert run_command('send', run, Namespace()) == 128 + signal.SIGPIPE
    assert capsys.readouterr().err == error


@pytest.mark.parametrize('number', SIGNALS)
def test_a_signal_ends_a_loop_but_none_of_its_callbacks(own_signals, number):
    """A callback that an exception ends may be the one that wakes a task."""
    gone_on = []

    def callback():
        signal.raise_signal(number)
        gone_on.append(number)

    async def serve():
        asyncio.get_running_loop().call_soon(callback)
        await asyncio.sleep(10.0)

    def run(_):
        asyncio.run(serve())

    signal.signal(signal.SIGHUP, signal.SIG_DFL)
    assert run_command('serve', run, Namespace()) == 128 + number
    assert gone_on == [number]


@pytest.mark.parametrize('number', SIGNALS)
def test_a_signal_interrupts_a_command_without_a_loop(own_signals, number):
    signal.signal(signal.SIGHUP, signal.SIG_DFL)
    assert run_command('serve', lambda _: signal.raise_signal(number), Namespace()) == 128 + number


def test_no_command_writes_over_the_file_that_it_reads(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    goal, table = tmp_path / 'goal.yaml', tmp_path / 'a.csv'
    goal.write_text((share_path() / 'config' / 'examples' / 'square.yaml').read_text())
    table.write_text('x [mm],y [mm],z [mm]\n1,2,3\n4,5,6\n')
    texts = goal.read_text(), table.read_text()
    for words in (
        ['send', 'goal.yaml', '--record', str(goal), '--wait', '0'],
        ['import', 'a.csv', '--orientation', 'down', '-o', str(table)],
        ['show', 'goal.yaml', '-o', str(goal)],
        ['sweep', str(goal), '-o', 'goal.yaml'],
    ):
        assert main(words) == 1
        assert ' would be written over the file that is read; name' in capsys.readouterr().err
    assert (goal.read_text(), table.read_text()) == texts


def test_the_demo_can_move_no_arm_of_others(monkeypatch):
    """Its drivers have names that no other driver has, in a domain that nobody has chosen."""
    monkeypatch.setenv('ROS_DOMAIN_ID', '77')
    monkeypatch.setenv('ROS_AUTOMATIC_DISCOVERY_RANGE', 'SUBNET')
    environment = demo._environment()
    assert environment['ROS_AUTOMATIC_DISCOVERY_RANGE'] == 'LOCALHOST'
    assert environment['ROS_DOMAIN_ID'] != '77'
    fields: dict[str, Any] = {'goal': Path('a'), 'model': 'ur5e', 'drawing': Path('b')}
    spaces = [demo.DemoArm(name=name, **fields).namespace for name in ('', 'left', 'right')]
    assert len(set(spaces)) == 3
    assert all(str(os.getpid()) in space for space in spaces)


@pytest.mark.parametrize(
    ('command', 'module'), [('command_line', 'cli.command_parser'), ('driver', 'ros.node')]
)
def test_ctrl_c_is_silent_while_modules_load(command, module):
    program = f"""
import os, signal, sys
from ur_cartesian_driver import entry_points

class Person:
    def find_spec(self, name, path, target=None):
        if name == 'ur_cartesian_driver.{module}':
            os.kill(os.getpid(), signal.SIGINT)

sys.meta_path.insert(0, Person())
entry_points.{command}()
"""
    ended = subprocess.run(
        [sys.executable, '-c', program, 'where'],
        capture_output=True,
        text=True,
        timeout=60.0,
        check=False,
    )
    assert (ended.returncode, ended.stdout, ended.stderr) == (-signal.SIGINT, '', '')
