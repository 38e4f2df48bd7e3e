# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""check-robot with robots of each generation, and with some that are closed or busy."""

import asyncio
from dataclasses import replace
from io import StringIO
import json
import socket
import sys

import pytest
from waiting import wait_for

from ur_cartesian_driver.cli import check_robot, main
from ur_cartesian_driver.motion.state.rtde_state import RuntimeState
from ur_cartesian_driver.protocol.rtde.rtde_client import RtdeClientCodec, RtdeState
from ur_cartesian_driver.robot.check.corner_experiment import PAUSE_IN, PIECES
from ur_cartesian_driver.robot.check.experiment_runner import run_experiment
from ur_cartesian_driver.robot.check.experiments import EXPERIMENTS
from ur_cartesian_driver.robot.check.finding import Finding, RobotAddress, skipped, Verdict
from ur_cartesian_driver.robot.check.rtde_observations import INPUT_GROUPS
from ur_cartesian_driver.sim.motion.imperfect_arm import Imperfections

pytestmark = pytest.mark.slow

FOREIGN = 'def foreign():\n  while True:\n    sync()\n  end\nend\n'


@pytest.fixture
def check(ur_sim, tmp_path, capsys):
    """Run the command; return its status, its output, and the report's findings by name."""

    def run(**ports):
        path = tmp_path / 'report.json'
        numbers = {
            'rtde': ur_sim.ports.rtde,
            'primary': ur_sim.ports.primary,
            'dashboard': ur_sim.ports.dashboard,
            'robot-api': ur_sim.ports.robot_api,
        }
        words = [
            word
            for name, port in (numbers | ports).items()
            for word in (f'--{name}-port', str(port))
        ]
        options = ['--robot-ip', '127.0.0.1', '--seconds', '0.3', '--report', str(path)]
        status = main(['check-robot', *options, *words])
        found = json.loads(path.read_text())
        return status, capsys.readouterr().out, {f['check']: f for f in found['findings']}

    return run


@pytest.mark.parametrize(
    ('software', 'models', 'remote'),
    [
        pytest.param(
            '5.21.0.0', ['ur10e', 'ur12e'], 'true', marks=pytest.mark.ur_sim(model='ur10e')
        ),
        pytest.param('3.15.8.0', ['ur3'], None, marks=pytest.mark.ur_sim(model='ur3')),
        pytest.param(
            '10.14.0.0',
            ['ur20'],
            'true',
            marks=pytest.mark.ur_sim(model='ur20', polyscope='10.14'),
        ),
    ],
)
def test_a_robot_of_each_generation_is_described(check, ur_sim, software, models, remote):
    status, printed, findings = check()
    assert status == 0
    assert findings['software']['data']['version'] == software
    assert findings['model']['data']['models'] == models
    assert findings['remote_control']['data'].get('remote_control') == remote
    assert findings['scripts']['data']['accepted'] is True
    assert findings['rtde_outputs']['verdict'] == 'ok'
    assert findings['rtde_inputs']['verdict'] == 'ok'
    assert findings['calibration']['data']['pose_error_mm'] < 0.01
    assert findings['rtde_stream']['data']['packets'] > 10
    assert findings['rest']['data']['noise_mrad'] >= 0.0
    for check_name in findings:
        assert check_name in printed
    assert not ur_sim.state().program  # the line in the log came from beside any program


def test_the_report_does_not_say_who_or_where_the_robot_is(check, tmp_path):
    check()
    text = (tmp_path / 'report.json').read_text()
    for secret in '127.0.0.1', '20000000000', str(tmp_path):
        assert secret not in text
    assert json.loads(text)['driver']


def test_the_report_of_a_robot_that_does_not_answer_says_no_address(check, closed_port, tmp_path):
    check(rtde=closed_port, primary=closed_port)
    text = (tmp_path / 'report.json').read_text()
    assert '127.0.0.1' not in text
    assert f'ROBOT port {closed_port}' in text


@pytest.mark.parametrize('host', ['localhost', '127.0.0.1', 'ur10e'])
def test_no_address_is_in_the_texts_of_a_report(host):
    text = f'{host}: refused; {host} port 1 of 5.21.0.0, beside {host}-2.'
    findings = [Finding(check='rtde', verdict=Verdict.PROBLEM, text=text)]
    (found,) = check_robot.report(findings, {}, host)['findings']
    assert found['text'] == f'ROBOT: refused; ROBOT port 1 of 5.21.0.0, beside {host}-2.'


def test_a_resolved_address_is_in_no_report():
    findings = [Finding(check='rtde', verdict=Verdict.PROBLEM, text='127.0.0.1 port 1: lost.')]
    (found,) = check_robot.report(findings, {}, 'localhost')['findings']
    assert found['text'] == 'ROBOT port 1: lost.'


@pytest.mark.ur_sim(remote_control=False)
def test_local_control_is_noted(check):
    status, _, findings = check()
    assert status == 0
    assert findings['scripts']['verdict'] == 'note'
    assert 'local control (C210)' in findings['scripts']['text']
    assert findings['remote_control']['data']['remote_control'] == 'false'


@pytest.mark.parametrize(
    ('number', 'verdict', 'text'),
    [
        pytest.param(1, 'ok', 'The software has motion version 1 only.'),
        pytest.param(
            1,
            'ok',
            'The robot moves by motion version 1.',
            marks=pytest.mark.ur_sim(polyscope='5.22'),
        ),
        pytest.param(
            2,
            'note',
            'The robot moves by motion version 2, but plans are made for version 1',
            marks=pytest.mark.ur_sim(polyscope='5.22', motion_version=2),
        ),
        pytest.param(
            0,
            'note',
            'The motion version of the robot is unknown',
            marks=pytest.mark.ur_sim(polyscope='5.22', motion_version=2, remote_control=False),
        ),
        pytest.param(
            0,
            'note',
            'The motion version of the robot is unknown',
            marks=pytest.mark.ur_sim(model='ur20', polyscope='10.14'),
        ),
    ],
)
def test_the_motion_version_is_read_where_the_robot_tells_it(check, number, verdict, text):
    _, _, findings = check()
    found = findings['motion_version']
    assert found['verdict'] == verdict
    assert found['text'].startswith(text)
    assert found['data']['motion_version'] == number


@pytest.mark.ur_sim(polyscope='5.9.1')
def test_software_that_is_too_old_is_a_problem(check):
    status, _, findings = check()
    assert status == 1
    assert findings['software']['verdict'] == 'problem'
    assert 'needs 5.9.4' in findings['software']['text']


@pytest.mark.parametrize(
    ('interface', 'finding', 'status', 'words'),
    [
        ('rtde', 'rtde', 1, 'connection refused; switch RTDE on'),
        ('primary', 'primary', 1, 'connection refused; switch the primary client interface on'),
        ('dashboard', 'remote_control', 0, 'services below ~/dashboard/ will not work'),
    ],
)
def test_a_closed_port_is_one_sentence(check, closed_port, interface, finding, status, words):
    code, printed, findings = check(**{interface: closed_port})
    assert code == status
    assert words in findings[finding]['text']
    assert findings[finding]['text'].count('.') <= 5  # the address has dots, too
    assert 'Traceback' not in printed


@pytest.mark.ur_sim(polyscope='10.14')
def test_a_closed_robot_api_is_one_sentence(check, closed_port):
    code, _, findings = check(**{'robot-api': closed_port})
    assert code == 0
    assert '(Robot API): connection refused' in findings['remote_control']['text']


def test_nobody_at_the_address_has_a_status_of_its_own(check, closed_port):
    code, _, findings = check(rtde=closed_port, primary=closed_port)
    assert code == 3
    assert set(findings) == {'rtde', 'primary', 'other_ports'}


def test_something_else_at_the_ports_is_said(check):
    with socket.create_server(('127.0.0.1', 0)) as silent:
        port = silent.getsockname()[1]
        code, _, findings = check(rtde=port)
    assert code == 1
    assert 'does not answer as an RTDE server' in findings['rtde']['text']


@pytest.mark.parametrize(
    ('purpose', 'lower', 'text'),
    [
        ('speed slider', False, '0 to 23 are free'),
        ('SERVO registers', False, 'lower_registers: true) if no fieldbus has them. '),
        ('SERVO registers', True, '0 to 23 are taken, too'),
    ],
)
def test_inputs_of_another_client_are_named(check, ur_sim, purpose, lower, text):
    further = ['input_int_register_0'] if lower else []
    codec = RtdeClientCodec(['timestamp'], inputs=[*INPUT_GROUPS[purpose], *further])
    with socket.create_connection(('127.0.0.1', ur_sim.ports.rtde)) as other:
        other.sendall(codec.start())
        while codec.state is not RtdeState.READY:
            codec.feed(other.recv(65536))
            other.sendall(codec.data_to_send())
        code, _, findings = check()
    assert code == 0
    assert purpose in findings['rtde_inputs']['data']['refused']
    assert findings['rtde_inputs']['data']['lower_registers_free'] is not lower
    assert 'in use by another client' in findings['rtde_inputs']['text']
    assert text in findings['rtde_inputs']['text']


# ---- with motion ------------------------------------------------------------------------------


def address(ur_sim):
    return RobotAddress(
        host='127.0.0.1',
        rtde_port=ur_sim.ports.rtde,
        primary_port=ur_sim.ports.primary,
        dashboard_port=ur_sim.ports.dashboard,
        robot_api_port=ur_sim.ports.robot_api,
    )


class Terminal(StringIO):
    def isatty(self):
        return True


def run_experiments(ur_sim, agrees):
    recordings = {}
    findings = check_robot.experiment_findings(address(ur_sim), [], agrees, recordings)
    return {finding.check: finding for finding in findings}, recordings


@pytest.mark.ur_sim(rate=4.0, frequency=125.0)
def test_each_experiment_is_asked_for_moves_and_returns(ur_sim):
    begin, asked = ur_sim.state(), []

    def agree(motion):
        asked.append(motion)
        return True

    findings, recordings = run_experiments(ur_sim, agree)
    assert asked == [experiment.motion for experiment in EXPERIMENTS]
    for finding in findings.values():
        assert finding.verdict is Verdict.OK, finding.text
    for experiment in EXPERIMENTS:
        assert recordings[experiment.check].duration > 0.1
    for name in 'turn', 'timed_line', 'slider':
        assert findings[name].data['law']
    end = ur_sim.state()
    assert end.q == pytest.approx(begin.q, abs=1e-4)
    assert end.speed_slider == begin.speed_slider
    assert end.runtime_state is RuntimeState.STOPPED


@pytest.mark.parametrize(
    'generation',
    [
        pytest.param('3', marks=pytest.mark.ur_sim(rate=4.0, model='ur5')),
        pytest.param('10', marks=pytest.mark.ur_sim(rate=4.0, frequency=125.0, polyscope='10.12')),
    ],
)
def test_the_other_generations_move_too(ur_sim, generation):
    findings, _ = run_experiments(ur_sim, lambda motion: motion == EXPERIMENTS[0].motion)
    assert findings['joint_move'].verdict is Verdict.OK


@pytest.mark.parametrize(('version', 'asked'), [('5.21.0.0', 10), ('10.12.0.0', 9)])
def test_what_the_software_is_not_known_to_have_is_not_tried(version, asked, monkeypatch):
    def experiment(address, experiment, agrees, recordings):
        tried.append(experiment.check)
        return [skipped(experiment.check, 'Not wanted')]

    tried = []
    monkeypatch.setattr(check_robot, '_experiment', experiment)
    observed = [Finding(check='software', verdict=Verdict.OK, text='', data={'version': version})]
    address = RobotAddress(host='127.0.0.1')
    findings = check_robot.experiment_findings(address, observed, lambda _: True, {})
    assert len(list(findings)) == 10
    assert len(tried) == asked
    assert ('path_offset' in tried) == (asked == 10)


def test_nothing_moves_without_a_yes(ur_sim):
    begin = ur_sim.state()
    findings, recordings = run_experiments(ur_sim, lambda _: False)
    assert {finding.verdict for finding in findings.values()} == {Verdict.SKIPPED}
    assert not recordings
    assert ur_sim.state().q == begin.q
    assert not ur_sim.state().program


@pytest.mark.parametrize(
    ('answer', 'agrees'),
    [('y', True), (' Yes ', True), ('', False), ('n', False), ('yellow', False)],
)
def test_only_yes_is_yes(monkeypatch, answer, agrees):
    monkeypatch.setattr(sys, 'stdin', StringIO(answer + '\n'))
    assert check_robot.ask('The arm moves.') is agrees


def test_the_end_of_the_input_is_no(monkeypatch):
    monkeypatch.setattr(sys, 'stdin', StringIO(''))
    assert check_robot.ask('The arm moves.') is False


@pytest.mark.ur_sim(rate=4.0, frequency=125.0)
def test_who_ends_the_questions_keeps_what_was_found(ur_sim, tmp_path, monkeypatch):
    answers = iter(['y'])

    def answer(question):
        for each in answers:
            return each
        raise KeyboardInterrupt

    monkeypatch.setattr(sys, 'stdin', Terminal())
    monkeypatch.setattr('builtins.input', answer)
    path, where = tmp_path / 'report.json', address(ur_sim)
    options = ['--robot-ip', where.host, '--seconds', '0.3', '--report', str(path)]
    for name in ('rtde', 'primary', 'dashboard', 'robot_api'):
        options += [f'--{name.replace("_", "-")}-port', str(getattr(where, f'{name}_port'))]
    assert main(['check-robot', '--with-motion', *options]) == 130
    found = json.loads(path.read_text())
    assert {'software', 'joint_move'} <= {finding['check'] for finding in found['findings']}
    assert list(found['recordings']) == ['joint_move']


def test_without_a_terminal_no_motion_is_asked_for(capsys):
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sys, 'stdin', StringIO('y\n' * 9))
        assert main(['check-robot', '--robot-ip', '127.0.0.1', '--with-motion']) == 1
    assert 'needs a terminal' in capsys.readouterr().err


@pytest.mark.parametrize(
    ('prepare', 'words'),
    [
        (lambda sim: sim.protective_stop(), 'the safety mode is PROTECTIVE_STOP'),
        (lambda sim: sim.call(lambda c: c.power_off()), 'switch it on'),
        (lambda sim: sim.run_script(FOREIGN), 'a program is PLAYING; stop it'),
    ],
)
def test_a_robot_that_is_not_ready_is_not_moved(ur_sim, prepare, words):
    prepare(ur_sim)
    ur_sim.call(lambda controller: [controller.step() for _ in range(5)])
    findings, _ = run_experiments(ur_sim, lambda _: pytest.fail('nothing may be asked for'))
    assert all(words in finding.text for finding in findings.values())


def test_no_motion_where_something_is_wrong(ur_sim):
    problem = Finding(check='software', verdict=Verdict.PROBLEM, text='Too old.')
    findings = check_robot.experiment_findings(
        address(ur_sim), [problem], lambda _: pytest.fail('nothing may be asked for'), {}
    )
    assert all('because of software' in finding.text for finding in findings)


@pytest.mark.ur_sim(rate=4.0, frequency=125.0)
def test_a_stop_of_the_robot_ends_an_experiment_and_the_slider_is_restored(ur_sim):
    def agree(motion):
        if 'slider' not in motion:
            return False
        ur_sim.inject('protective_stop at 2 s')
        return True

    findings, recordings = run_experiments(ur_sim, agree)
    assert findings['slider'].verdict is Verdict.PROBLEM
    assert 'PROTECTIVE_STOP' in findings['slider'].text
    assert not recordings
    assert ur_sim.state().speed_slider == 1.0


@pytest.mark.ur_sim(remote_control=False)
def test_a_robot_in_local_control_is_said_not_to_move(ur_sim):
    findings, _ = run_experiments(ur_sim, lambda motion: motion == EXPERIMENTS[0].motion)
    text = findings['joint_move'].text
    assert text.startswith('Not finished: the arm does not move: ')
    assert 'C210' in text


@pytest.mark.ur_sim(frequency=125.0)
def test_who_interrupts_an_experiment_stops_the_arm_and_gets_the_slider_back(ur_sim):
    slider = next(experiment for experiment in EXPERIMENTS if experiment.check == 'slider')

    async def interrupted():
        running = asyncio.create_task(run_experiment(address(ur_sim), slider))
        await asyncio.to_thread(wait_for, lambda: max(map(abs, ur_sim.state().qd)) > 0.01)
        assert ur_sim.state().speed_slider == 0.5
        running.cancel()
        with pytest.raises(asyncio.CancelledError):
            await running

    asyncio.run(asyncio.wait_for(interrupted(), 10.0))
    wait_for(lambda: ur_sim.state().runtime_state is RuntimeState.STOPPED)
    wait_for(lambda: max(map(abs, ur_sim.state().qd)) == 0.0)
    assert ur_sim.state().speed_slider == 1.0


@pytest.mark.ur_sim(frequency=125.0)
def test_who_interrupts_before_the_slider_is_confirmed_gets_it_back(ur_sim):
    slider = next(experiment for experiment in EXPERIMENTS if experiment.check == 'slider')

    async def interrupted():
        running = asyncio.create_task(run_experiment(address(ur_sim), slider))
        ur_sim.inject('delay rtde 0.06 s')
        await asyncio.to_thread(wait_for, lambda: ur_sim.state().speed_slider == 0.5)
        running.cancel()
        ur_sim.clear_faults()
        with pytest.raises(asyncio.CancelledError):
            await running

    asyncio.run(asyncio.wait_for(interrupted(), 20.0))
    assert ur_sim.state().speed_slider == 1.0


# ---- what rounded corners assume of the robot -------------------------------------------------

CORNER = {experiment.check: experiment for experiment in EXPERIMENTS}


def corner(ur_sim, experiment):
    """Carry out an experiment; return its findings by name."""
    samples = asyncio.run(run_experiment(address(ur_sim), experiment))
    analyses = experiment.analyses
    return {finding.check: finding for finding in (each(samples) for each in analyses)}


@pytest.mark.ur_sim(frequency=125.0, imperfections=Imperfections(lag=0.02))
def test_an_arm_that_lags_does_not_follow_speedj_within_a_step(ur_sim):
    found = corner(ur_sim, CORNER['corner_100'])
    assert found['corner_100'].verdict is Verdict.NOTE
    assert found['corner_100'].data['lag'] == pytest.approx(0.02, abs=0.004)
    assert 'followed within a step: not confirmed' in found['corner_100'].text
    assert found['steps_100'].data['confirmed']


@pytest.mark.ur_sim(frequency=125.0)
def test_a_program_that_takes_too_long_misses_cycles(ur_sim):
    late = CORNER['corner_100'].script.replace('  speedj(', '  sync()\n  speedj(')
    found = corner(ur_sim, replace(CORNER['corner_100'], script=late))
    assert found['steps_100'].verdict is Verdict.NOTE
    assert found['steps_100'].data['missed'] > 40
    assert 'ends within its cycle: not confirmed' in found['steps_100'].text


@pytest.mark.ur_sim(frequency=125.0)
def test_a_socket_that_dies_in_a_pause_is_found(ur_sim):
    experiment = CORNER['corner_pause']

    async def dying():
        running = asyncio.create_task(run_experiment(address(ur_sim), experiment))
        paused = asyncio.to_thread(
            wait_for, lambda: ur_sim.state().runtime_state is RuntimeState.PAUSED, 30.0
        )
        await paused
        ur_sim.inject('half_open sockets')
        return await running

    finding = experiment.analyses[0](asyncio.run(dying()))
    assert finding.verdict is Verdict.NOTE
    assert PAUSE_IN <= finding.data['pieces'] < PIECES
    assert 'goes on after a pause: not confirmed' in finding.text
    wait_for(lambda: max(map(abs, ur_sim.state().qd)) == 0.0)


@pytest.mark.ur_sim(frequency=125.0)
def test_a_robot_that_cannot_be_paused_answers_nothing(ur_sim):
    finding = CORNER['corner_pause'].analyses[0](
        asyncio.run(run_experiment(address(ur_sim), CORNER['corner_10']))
    )
    assert finding.verdict is Verdict.NOTE
    assert finding.text == 'The program was not paused in the corner.'
