# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Absurd programs, files and faults end with an error, and the simulated robot goes on."""

import pytest
from robot_ports import FREE
from waiting import wait_for

from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.kinematics.inverse import nearest
from ur_cartesian_driver.kinematics.robot_models import robot_model
from ur_cartesian_driver.motion.geometry.pose import Pose
from ur_cartesian_driver.motion.state.rtde_state import RuntimeState
from ur_cartesian_driver.sim import SimulatedRobot
from ur_cartesian_driver.sim.faults.fault_parser import parse_fault
from ur_cartesian_driver.sim.interfaces.primary_commands import execute_command
from ur_cartesian_driver.sim.motion.imperfect_arm import Imperfections
from ur_cartesian_driver.sim.programs.script_upload import UploadedLine
from ur_cartesian_driver.sim.simulator_config import SimulatorConfig
from ur_cartesian_driver.sim.state.power_and_safety import SafetyEvent

LONG_MOVE = 'movej([1.5, -1.57, 1.57, -1.57, -1.57, 0], a=2, v=1)'


@pytest.mark.parametrize(
    'event',
    [SafetyEvent.PROTECTIVE_STOP, SafetyEvent.EMERGENCY_STOP, SafetyEvent.SAFEGUARD_STOP],
)
def test_a_program_that_waits_for_the_arm_does_not_start_in_a_safety_stop(bench, event):
    bench.start(LONG_MOVE, name='first')
    bench.wait(0.5)
    bench.start(LONG_MOVE, name='second')
    bench.step()
    assert bench.programs.state is RuntimeState.STOPPING
    bench.controller.safety_event(event)
    bench.wait(1.0)
    assert bench.programs.name == 'first'
    assert bench.programs.state is RuntimeState.STOPPED
    assert any('Program second was not started' in line for line in bench.log)


@pytest.mark.parametrize('number', ['1e999', '1.5', '1e3'])
def test_a_label_needs_a_whole_number_and_others_compile_afterwards(robot, number):
    robot.run_script(f'def bad():\n  $ {number} "x"\nend\n')
    robot.run_script('def good():\n  textmsg("here")\nend\n')
    wait_for(lambda: 'here' in robot.state().messages)
    assert any('syntax_error_on_line:2:' in line for line in robot.state().messages)


@pytest.mark.parametrize(
    ('address', 'port'),
    [('127.0.0.1', '1e20'), ('127.0.0.1', '70000'), ('127.0.0.1', '-1'), ('a..b', '80')],
)
def test_a_socket_without_a_possible_address_is_not_opened(robot, address, port):
    robot.run_script(f'def f():\n  textmsg("open: ", socket_open("{address}", {port}))\nend\n')
    wait_for(lambda: robot.state().messages)
    assert robot.state().messages[-1].endswith(('open: False', 'is no whole number.')) or (
        'port' in robot.state().messages[-1]
    )
    robot.run_script('def good():\n  textmsg("here")\nend\n')
    wait_for(lambda: 'here' in robot.state().messages)


@pytest.mark.parametrize('x', [float('nan'), float('inf'), 1e200])
def test_an_absurd_pose_has_no_solution(x):
    q = (0.0, -1.57, 1.57, -1.57, -1.57, 0.0)
    assert nearest(Arm(robot_model('ur5e')), Pose((x, 0.0, 0.0)), q) is None


@pytest.mark.parametrize('value', ['nan', 'inf', '-inf'])
def test_a_fault_takes_finite_numbers(value):
    for fault in (f'offset pose x {value}', f'delay rtde {value} s', f'drop rtde at {value} s'):
        with pytest.raises(ValueError, match='finite'):
            parse_fault(fault)


def test_a_text_that_has_no_bytes_is_sent_with_a_sign_in_its_place(bench):
    bench.controller.messages.text('\ud800')
    for message in bench.controller.messages.pending:
        assert message.encode()


def test_set_pos_is_bounded(make_bench):
    bench = make_bench(imperfections=Imperfections())
    assert 'q has positions beyond' in bench.run('set_pos([1e308, 0, 0, 0, 0, 0])')[-1]
    bench.wait(0.1)


def test_a_robot_that_was_ended_by_an_error_says_so(monkeypatch):
    failures: list[object] = []
    monkeypatch.setattr('threading.excepthook', lambda hook: failures.append(hook.exc_value))

    def fail(*_):
        raise ArithmeticError('a defect')

    robot = SimulatedRobot(SimulatorConfig(**FREE)).start()
    try:
        robot.call(lambda controller: monkeypatch.setattr(controller, 'step', fail))
        wait_for(lambda: failures)
        with pytest.raises(RuntimeError, match='was ended by an error'):
            robot.state()
    finally:
        robot.close()


@pytest.mark.parametrize('host', ['a..b', '203.0.113.7'])
def test_a_host_that_is_none_of_this_computer_is_refused_when_the_robot_starts(host):
    with pytest.raises(OSError, match='Give an address of this computer as host'):
        SimulatedRobot(SimulatorConfig(**{**FREE, 'host': host})).start()


def test_a_line_resumes_a_paused_program_and_starts_none(bench):
    bench.programs.load('loaded', 'def loaded():\n  sleep(10)\nend\n')
    execute_command(bench.controller, UploadedLine('resume program'), may_send=True)
    bench.step(2)
    assert bench.programs.state is RuntimeState.STOPPED
    bench.programs.play()
    bench.step(2)
    bench.programs.pause()
    bench.step(2)
    assert bench.programs.state is RuntimeState.PAUSED
    execute_command(bench.controller, UploadedLine('resume program'), may_send=True)
    bench.step(3)
    assert bench.programs.state is RuntimeState.PLAYING


def test_a_list_is_no_item_of_a_matrix(bench):
    log = bench.run('m = [[1, 2], [3, 4]]\nm[0, 0] = [5, 6]\ntextmsg("shared")')
    assert 'a list holds lists only as the rows of a matrix' in log[-1]


def test_a_secondary_program_shows_a_window_and_reports_its_exception(bench):
    bench.programs.submit('sec a():\n  popup("hello", blocking=True)\nend\n')
    bench.step(2)
    assert [popup.text for popup in bench.controller.popups] == ['hello']
    bench.programs.submit('sec b():\n  x = sqrt(-1)\nend\n')
    bench.step(2)
    assert any('Secondary program: Runtime error (2:7)' in line for line in bench.log)
