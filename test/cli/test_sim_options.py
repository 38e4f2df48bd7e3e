# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Options of the simulator: wrong ones are refused, the others reach the robot."""

from __future__ import annotations

import contextlib
import json

import pytest
from urp_text import script_line, urp_text, urpx

from ur_cartesian_driver.cli import main, parser
from ur_cartesian_driver.kinematics.robot_models import robot_model
from ur_cartesian_driver.motion.twin.twin import ArmIdentity, Estimate, Twin
from ur_cartesian_driver.motion.twin.twin_file import twin_text
from ur_cartesian_driver.sim.calibration import random_calibration
from ur_cartesian_driver.sim.command_line.simulate import simulator_config
from ur_cartesian_driver.sim.controller_assembly import assemble
from ur_cartesian_driver.sim.faults.fault_values import (
    AfterTime,
    DropFault,
    EventFault,
    FaultEvent,
)
from ur_cartesian_driver.sim.interfaces.dashboard_session import DashboardHandlers
from ur_cartesian_driver.sim.interfaces.robot_api_session import BASE_PATH, RobotApiSession
from ur_cartesian_driver.sim.pendant_programs.program_tree import ScriptText


def test_a_fault_that_is_not_understood_is_one_sentence_with_the_word(capsys):
    with pytest.raises(SystemExit):
        main(['sim', '--fault', 'drop rtde in 5 s'])
    last = capsys.readouterr().err.splitlines()[-1]
    assert last.endswith(
        "The fault 'drop rtde in 5 s' is not understood at 'in'; expected 'at', 'for' or the end."
    )


def test_an_interface_that_there_is_not_is_one_sentence(capsys):
    assert main(['sim', '--fault', 'drop rdte']) == 1
    error = capsys.readouterr().err
    assert "no interface 'rdte'" in error
    assert error.count('\n') == 1


def test_a_calibration_that_there_is_not_is_one_sentence(capsys):
    assert main(['sim', '--calibration', '/nowhere.yaml']) == 1
    error = capsys.readouterr().err
    assert '/nowhere.yaml' in error
    assert error.count('\n') == 1


@pytest.mark.parametrize(
    ('options', 'sentence'),
    [
        (['sim', '--joints', '0,0,0,0,0,nan'], 'nan is not within -25.1327 and 25.1327'),
        (['sim', '--joints', '0,0,0,0,0,inf'], 'inf is not within'),
        (['sim', '--joints', '0,0,0,0,0,1e300'], '1e+300 is not within'),
        (['sim', '--joints', '0,0,0,0,0,x'], "could not convert string to float: 'x'"),
        (['validate', 'square', '--tcp', '0,0,10,0,0,0'], '10 is not within -5 and 5'),
        (['sim', '--rtde-port', '65536'], '65536 is no port; give 0 to 65535'),
        (['where', '--rtde-port', '-1'], '-1 is no port'),
        (
            ['check-robot', '--robot-ip', 'localhost', '--primary-port', '1e9'],
            '1e9 is no port; give',
        ),
        (['check-robot', '--robot-ip', 'localhost', '--seconds', 'nan'], 'nan s is not within 0'),
        (['check-robot', '--robot-ip', 'localhost', '--seconds', '-1'], '-1 s is not within 0'),
        (['check-robot', '--robot-ip', 'localhost', '--seconds', 'x'], "to float: 'x'; give"),
        (['send', 'square', '--wait', 'inf'], 'inf s is not within 0 and 86400 s'),
        (['send', 'square', '--wait', '-1'], '-1 s is not within 0'),
        (['sim', '--rate', 'nan'], 'rate is nan; use'),
        (['sim', '--rate', 'inf'], 'rate is inf; use'),
        (['sim', '--rate', '1e300'], 'rate is 1e+300; use 1 for real time'),
        (['sim', '--rate', '-1'], 'rate is -1.0; use'),
        (['sim', '--input', 'standard 8'], '"standard 8" is no digital channel; use standard 0'),
        (['sim', '--input', 'analog 0'], '"analog 0" is no digital channel'),
    ],
)
def test_a_number_that_means_nothing_is_one_sentence(options, sentence, capsys):
    with contextlib.suppress(SystemExit):
        assert main(options) == 1
    last = capsys.readouterr().err.splitlines()[-1]
    assert sentence in last


def test_options_reach_the_robot():
    options = [
        '--rate',
        '0',
        '--calibration-seed',
        '3',
        '--fault',
        'stop at 2 s',
        '--fault',
        'drop rtde',
        '--input',
        'standard 3',
        '--input',
        'tool 1',
        '--answer',
        'yes',
        '--answer',
        '3',
    ]
    arguments = parser().parse_args(['sim', '--model', 'ur10e', *options])
    config = simulator_config(arguments)
    assert config.rate == 0.0
    assert config.geometry == random_calibration(robot_model('ur10e'), 3)
    assert config.faults == [
        EventFault(action=FaultEvent.STOP, trigger=AfterTime(2.0)),
        DropFault(interface='rtde'),
    ]
    controller = assemble(config).controller
    assert controller.io.digital_in.packed() == 1 << 3 | 1 << 17
    assert list(controller.pendant.answers) == ['yes', '3']


def test_programs_of_a_directory_and_the_loaded_one_have_the_names_of_the_dashboard(tmp_path):
    (tmp_path / 'wait.script').write_text('def wait():\n  sleep(1)\nend\n')
    (tmp_path / 'notes.txt').write_text('no program')
    loaded = tmp_path / 'elsewhere' / 'glue.script'
    loaded.parent.mkdir()
    loaded.write_text('def glue():\n  sync()\nend\n')
    arguments = parser().parse_args(
        ['sim', '--programs', str(tmp_path), '--program', str(loaded), '--no-remote-control']
    )
    config = simulator_config(arguments)
    assert config.programs == {
        'wait.urp': 'def wait():\n  sleep(1)\nend\n',
        'glue.urp': loaded.read_text(),
    }
    assert config.program == 'glue.urp'
    assert not config.has_remote_control


def test_programs_of_polyscope_are_loaded_with_the_host_of_external_control(tmp_path):
    """A file wins over the script and the built-in program of its name."""
    for name in 'external_control', 'seam':
        (tmp_path / f'{name}.urp').write_text(urp_text(script_line(f'textmsg("{name}")')))
        (tmp_path / f'{name}.script').write_text('def p():\nend\n')
    words = ['--external-control-host', '10.0.0.1', '--external-control-port', '50012']
    arguments = parser().parse_args(['sim', '--programs', str(tmp_path), *words])
    config = simulator_config(arguments)
    assert (config.external_control_host, config.external_control_port) == ('10.0.0.1', 50012)
    assert {name: tree.nodes for name, tree in config.saved_programs.items()} == {
        f'{name}.urp': (ScriptText(f'textmsg("{name}")'),) for name in ('external_control', 'seam')
    }


def test_every_simulated_robot_has_external_control():
    arguments = parser().parse_args(['sim', '--program', 'external_control.urp'])
    config = simulator_config(arguments)
    assert config.program == 'external_control.urp'
    assert config.saved_programs[config.program].has_external_control


def config_of(*words):
    return simulator_config(parser().parse_args(['sim', *map(str, words)]))


def test_a_twin_is_the_arm_that_is_simulated(tmp_path):
    twin = Twin(
        arm=ArmIdentity(model='ur10e', serial_number='20231', software='5.22.1', motion_version=2),
        date='2026-11-27',
        estimates={'start_time': Estimate(value=0.2, interval=(0.19, 0.21))},
    )
    file = tmp_path / 'twin.yaml'
    file.write_text(twin_text(twin))
    config = config_of('--twin', file)
    assert config.twin == twin
    assert (config.model, config.polyscope, config.motion_version) == ('ur10e', '5.22.1', 2)
    assert (config.serial_number, config.laws.start_time) == ('20231', 0.2)
    with pytest.raises(ValueError, match=r'^twin is of another robot: model ur10e, not ur5e;'):
        config_of('--twin', file, '--model', 'ur5e')
    file.write_text('start_time: 0.2')
    with pytest.raises(ValueError, match=r'twin\.yaml, line 1: this is no twin'):
        config_of('--twin', file)


def test_a_program_of_polyscope_x_has_the_name_in_its_file(tmp_path):
    file = tmp_path / '17.urpx'
    file.write_text(json.dumps(urpx('weld it', 'textmsg("arc")')))
    config = config_of('--polyscope', '10.14', '--program', file)
    assert config.program == 'weld it.urpx'
    controller = assemble(config).controller
    assert controller.programs.play() == ''
    controller.step()
    assert list(controller.messages.log) == ['arc']
    assert config_of('--programs', tmp_path).programs == config.programs


def test_a_program_of_polyscope_x_is_refused_by_older_software(tmp_path, capsys):
    file = tmp_path / 'weld.urpx'
    file.write_text(json.dumps(urpx('weld', 'textmsg("arc")')))
    assert main(['sim', '--polyscope', '5.21', '--program', str(file)]) == 1
    sentence = 'weld.urpx is a program of PolyScope X, and the robot has PolyScope 5.21'
    assert sentence in capsys.readouterr().err


@pytest.mark.parametrize(
    ('name', 'data', 'reason'),
    [
        ('a.urp', urp_text('<MoveJ/>').encode(), 'has a node <MoveJ>, which'),
        ('a.urpx', b'def a():\nend\n', 'is no program file of PolyScope X: '),
        ('a.urpx', b'[' * 100_000, 'is no program file of PolyScope X: '),
        ('a.script', b'textmsg("\xe4")', 'is no text in UTF-8'),
        ('a.urp', None, 'No such file'),
    ],
)
def test_a_directory_lists_the_programs_that_cannot_be_loaded(
    tmp_path, caplog, name, data, reason
):
    """The other programs are loaded, as on a robot, and the reason is given when one asks."""
    file = tmp_path / name
    if data is None:
        file.symlink_to(tmp_path / 'nowhere')
    else:
        file.write_bytes(data)
    (tmp_path / 'good.urp').write_text(urp_text(script_line('sync()')))
    config = config_of('--polyscope', '10.14', '--programs', tmp_path)
    controller = assemble(config).controller
    session = RobotApiSession(controller)
    assert {'a', 'good'} <= set(controller.stored_programs.names())
    body = b'{"name": "a"}'
    head = f'PUT {BASE_PATH}/program/v1/loaded HTTP/1.1\r\nContent-Length: {len(body)}\r\n\r\n'
    answers = [session.feed(head.encode() + body).decode()]
    answers.append(
        session.feed(f'GET {BASE_PATH}/programs/v1/a HTTP/1.1\r\n\r\n'.encode()).decode()
    )
    for answer in answers:
        assert '500' in answer.splitlines()[0]
        assert str(file) in answer
        assert reason in answer
    [key] = set(config.programs) - {'good.urp'}
    with pytest.raises(StopIteration) as answered:  # at once: nothing compiles aside here
        next(DashboardHandlers(controller).load(key))
    assert answered.value.value == f'Error while loading program: {key}'
    assert reason in controller.messages.log[-1]
    assert reason in caplog.text
    assert controller.load_program('good.urp') == ''


def test_a_program_of_polyscope_with_other_nodes_is_refused_in_one_sentence(tmp_path, capsys):
    file = tmp_path / 'seam.urp'
    file.write_text(urp_text('<MoveJ/>'))
    assert main(['sim', '--program', str(file)]) == 1
    assert f'{file} has a node <MoveJ>, which' in capsys.readouterr().err


@pytest.mark.parametrize('option', ['--program', '--programs'])
def test_a_program_that_there_is_not_is_one_sentence(capsys, option):
    assert main(['sim', option, '/nowhere']) == 1
    error = capsys.readouterr().err
    assert '/nowhere' in error
    assert error.count('\n') == 1


def test_a_loaded_program_that_is_no_urscript_is_one_sentence(capsys, tmp_path):
    (tmp_path / 'bad.script').write_text('def bad():\n  nothing(1)\nend\n')
    assert main(['sim', '--program', str(tmp_path / 'bad.script')]) == 1
    error = capsys.readouterr().err
    assert 'bad.urp' in error
    assert error.endswith(f'; bad.urp is {tmp_path}/bad.script\n')
    assert 'nothing' in error
    assert error.count('\n') == 1
