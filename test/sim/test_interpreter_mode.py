# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Interpreter mode: statements of clients in a running program, their answers and their order."""

import socket

import pytest

from ur_cartesian_driver.motion.state.rtde_state import RuntimeState
from ur_cartesian_driver.sim.interfaces.interpreter_session import InterpreterSession
from ur_cartesian_driver.sim.programs.interpreter_mode import MAX_QUEUED_STATEMENTS
from ur_cartesian_driver.sim.simulated_robot import SimulatedRobot
from ur_cartesian_driver.sim.simulator_config import SimulatorConfig

MAIN = """
global n = 1
def double(x):
  return 2 * x
end
interpreter_mode({arguments})
textmsg("out ", n)
"""


class Client:
    """A client of a bench, which lets a cycle pass after each statement."""

    def __init__(self, bench):
        self.bench = bench
        self.session = InterpreterSession(bench.controller)

    def say(self, *statements):
        """Send statements; return the answers that have come by the end of the cycle."""
        data = ''.join(f'{statement}\n' for statement in statements).encode()
        answers = self.session.feed(data)
        self.bench.step()
        return (answers + self.session.answers()).decode().splitlines()


@pytest.fixture
def client(bench):
    bench.start(MAIN.format(arguments=''))
    bench.step()
    return Client(bench)


def test_a_character_is_a_byte_as_on_the_other_script_ports(bench, client):
    """The manual of URScript: (extended) ASCII."""
    statement = 'textmsg("Düse 1 µm")\n'.encode('latin-1')
    answers = client.session.feed(statement)
    bench.step()
    assert answers + client.session.answers() == b'ack: 1: ' + statement
    assert bench.log == ['Düse 1 µm']


def test_statements_are_acknowledged_with_numbers_from_one_and_executed_in_order(bench, client):
    assert client.say('textmsg(n)', 'n = double(21)', 'textmsg(n)') == [
        'ack: 1: textmsg(n)',
        'ack: 2: n = double(21)',
        'ack: 3: textmsg(n)',
    ]
    assert bench.log == ['1', '42']


@pytest.mark.parametrize(
    ('statement', 'reason'),
    [
        ('unknown()', 'compile_error_name_not_found:unknown'),
        ('x = y', 'compile_error_name_not_found:y'),
        ('x = ', 'syntax_error_on_line:1:x = '),
        ('textmsg()', 'compile_error_wrong_arguments:textmsg'),
        ('end', 'syntax_error_on_line:1:end'),
    ],
)
def test_what_does_not_compile_is_discarded_with_the_reason(bench, client, statement, reason):
    assert client.say(statement) == [f'discard: {reason}: {statement}']
    assert client.say('n = 2') == ['ack: 1: n = 2']
    assert bench.programs.running


@pytest.mark.parametrize(
    'statement',
    [
        'x = ' + '(' * 3000,
        'x = ' + '1 + ' * 3000 + '1',
        'if 1: ' * 500,
        'x = ' + 'not ' * 3000 + '1',
    ],
)
def test_a_statement_nested_too_deeply_is_discarded_and_the_next_one_is_not(client, statement):
    (answer,) = client.say(statement)
    assert answer.startswith('discard: syntax_error_on_line:1:')
    assert client.say('n = 2') == ['ack: 1: n = 2']


def test_a_statement_can_halt_the_program(bench, client):
    client.say('halt', 'textmsg("never")')
    bench.step(3)
    assert bench.log == []
    assert not bench.programs.running


def test_return_ends_its_statement_only(bench, client):
    client.say('textmsg("a") return 1 textmsg("b")', 'textmsg("c")')
    assert bench.log == ['a', 'c']


def test_interpreter_mode_has_no_interpreter_mode_inside(bench, client):
    client.say('interpreter_mode()')
    bench.step(2)
    assert not bench.programs.running
    assert 'only possible in the main thread, and not from within itself' in bench.log[0]


def test_a_function_on_one_line_can_be_called_by_the_next(bench, client):
    client.say('def greet(x): local s = str_cat("hello ", x) textmsg(s) end', 'greet("you")')
    assert bench.log == ['hello you']


def test_a_function_of_a_statement_can_take_time(bench, client):
    client.say('def slow(): sleep(0.01) textmsg("slow") end', 'slow()', 'textmsg("next")')
    assert bench.log == []
    bench.wait(0.02)
    assert bench.log == ['slow', 'next']


def test_several_statements_may_share_a_line(bench, client):
    assert len(client.say('a = 1 b = a + 1 textmsg(b)')) == 1
    assert bench.log == ['2']


def test_a_variable_of_a_statement_is_no_global_of_the_program(bench, client):
    client.say('mine = 5', 'n = mine', 'end_interpreter()')
    bench.until(lambda: bench.programs.state is RuntimeState.STOPPED)
    assert bench.log == ['out 5']


def test_the_mode_ends_after_end_interpreter_and_the_program_goes_on(bench, client):
    assert client.say('end_interpreter()') == ['ack: 1: end_interpreter()']
    bench.until(lambda: bench.programs.state is RuntimeState.STOPPED)
    assert bench.log == ['out 1']
    assert client.say('n = 1') == ['discard: no program is running: n = 1']


def test_statements_behind_the_end_wait_for_the_next_mode(bench):
    bench.start('interpreter_mode()\nsleep(0.01)\ninterpreter_mode(clearQueueOnEnter=False)')
    bench.step()
    client = Client(bench)
    assert client.say('end_interpreter()', 'textmsg("late")') == ['ack: 1: end_interpreter()']
    bench.wait(0.03)
    assert client.say() == ['ack: 2: textmsg("late")']
    assert bench.log == ['late']


def test_entering_discards_what_has_been_waiting_by_default(bench):
    bench.start('sleep(0.01)\ninterpreter_mode()')
    bench.step()
    client = Client(bench)
    assert client.say('textmsg("early")') == []
    bench.wait(0.02)
    assert client.say() == ['discard: the queue was cleared: textmsg("early")']
    assert bench.log == []


def test_clearing_forgets_functions_variables_and_threads_of_statements(bench, client):
    client.say('x = 1', 'def g(): return 2 end')
    client.say('thread t(): while True: textmsg("tick") sync() end end', 'h = run t()')
    assert 'ack: 5: clear_interpreter()' in client.say('clear_interpreter()')
    bench.step(3)
    ticks = len(bench.log)
    bench.step(10)
    assert len(bench.log) == ticks > 0
    assert client.say('g()', 'textmsg(x)', 'h = 0', 'n = double(2)') == [
        'discard: compile_error_name_not_found:g: g()',
        'discard: compile_error_name_not_found:x: textmsg(x)',
        'ack: 6: h = 0',
        'ack: 7: n = double(2)',
    ]


def test_statements_behind_a_clear_are_answered_when_it_has_been_executed(bench, client):
    client.say('x = 1')
    answers = client.say('sleep(0.01)', 'clear_interpreter()', 'textmsg(x)')
    assert answers == ['ack: 2: sleep(0.01)', 'ack: 3: clear_interpreter()']
    bench.wait(0.02)
    assert client.say() == ['discard: compile_error_name_not_found:x: textmsg(x)']


def test_without_clear_on_end_functions_are_there_in_the_next_mode(bench):
    bench.start('interpreter_mode(True, False)\nsync()\ninterpreter_mode(False, True)')
    bench.step()
    client = Client(bench)
    client.say('def g(): textmsg("kept") end', 'end_interpreter()')
    bench.step(5)
    assert client.say('g()') == ['ack: 3: g()']
    assert bench.log == ['kept']


def test_states_count_statements(bench, client):
    states = ('statelastexecuted', 'statelastinterpreted', 'statelastcleared', 'stateunexecuted')
    assert client.say(*states) == [f'state: 0: {state}' for state in states]
    client.say('n = 2', 'sleep(1)', 'n = 3', 'n = 4')
    assert [answer.split(':')[1] for answer in client.say(*states)] == [' 2', ' 4', ' 0', ' 2']
    bench.wait(1.1)
    client.say('clear_interpreter()')
    assert [answer.split(':')[1] for answer in client.say(*states)] == [' 5', ' 5', ' 5', ' 0']


def test_skipbuffer_drops_what_has_not_begun(bench, client):
    client.say('sleep(0.1)', 'textmsg("skipped")')
    assert client.say('skipbuffer', 'textmsg("new")') == [
        'ack: 2: skipbuffer',
        'ack: 3: textmsg("new")',
    ]
    bench.wait(0.2)
    assert bench.log == ['new']


def test_skipbuffer_lets_statements_behind_a_skipped_clear_go_on(client):
    client.say('sleep(0.1)', 'clear_interpreter()', 'n = 5')
    assert client.say('skipbuffer') == ['ack: 3: n = 5', 'ack: 3: skipbuffer']


def test_skipbuffer_waits_for_a_clear_that_runs_already(bench, client):
    """What follows it was not compiled before, and must not be cleared by it."""
    client.say('sleep(0.1) clear_interpreter()', 'textmsg("cleared")')
    bench.step(2)
    client.say('skipbuffer', 'textmsg("kept")')
    bench.wait(0.2)
    assert bench.log[-1] == 'kept'


@pytest.mark.parametrize(
    'move',
    [
        'movej([1, -1.5, 1.5, -1.5, -1.5, 0])',
        'movel(pose_trans(get_target_tcp_pose(), p[0,0,-0.2,0,0,0]))',
    ],
)
def test_abort_brakes_a_move_and_the_next_statement_follows(bench, client, move):
    client.say(move, 'textmsg(get_target_joint_speeds())')
    bench.wait(0.4)
    assert bench.controller.motion.moving
    assert client.say('abort') == ['ack: 2: abort']
    took = bench.until(lambda: bool(bench.log))
    assert took < 0.2
    bench.step()
    assert not bench.controller.motion.moving


@pytest.mark.parametrize('statement', ['sleep(0.5)', 'speedj([0.1, 0, 0, 0, 0, 0], 1, 0.5)'])
def test_abort_leaves_everything_but_moves_alone(bench, client, statement):
    client.say(statement, 'textmsg("after")')
    bench.wait(0.1)
    client.say('abort')
    bench.wait(0.2)
    assert bench.log == []
    bench.until(lambda: bool(bench.log))


def test_a_runtime_exception_of_a_statement_ends_the_program(bench, client):
    client.say('a = 1 / 0')
    bench.step(2)
    assert bench.log == ['1:7: Runtime error (1:7): Division by zero']
    assert not bench.programs.running


def test_numbers_begin_again_with_the_next_program(bench, client):
    client.say('n = 5', 'end_interpreter()')
    bench.until(lambda: bench.programs.state is RuntimeState.STOPPED)
    bench.start(MAIN.format(arguments=''))
    bench.step(2)
    assert client.say('n = 6') == ['ack: 1: n = 6']


def test_too_many_statements_are_discarded(client):
    answers = client.say('sleep(10)', *['n = 1'] * MAX_QUEUED_STATEMENTS)
    assert answers[-2].startswith(f'ack: {MAX_QUEUED_STATEMENTS}:')
    assert answers[-1].startswith(
        f'discard: more than {MAX_QUEUED_STATEMENTS} statements are waiting'
    )


def test_empty_lines_are_no_statements(client):
    assert client.say('', '  ', 'n = 2') == ['ack: 1: n = 2']


def test_a_thread_of_the_program_can_end_the_mode(bench):
    bench.start(
        'thread t():\nsleep(0.01)\nend_interpreter()\nend\nrun t()\ninterpreter_mode()\n'
        'textmsg("on")'
    )
    bench.until(lambda: bool(bench.log))
    assert bench.log == ['on']


def test_the_program_can_be_stopped_in_the_middle_of_a_statement(bench, client):
    client.say('movej([1, -1.5, 1.5, -1.5, -1.5, 0])', 'textmsg("never")')
    bench.wait(0.3)
    bench.programs.stop()
    bench.until(lambda: bench.programs.state is RuntimeState.STOPPED)
    assert bench.log == []
    assert client.say('stateunexecuted') == ['state: 0: stateunexecuted']


def test_the_port_takes_statements():
    config = SimulatorConfig(rtde_port=0, primary_port=0, dashboard_port=0)
    with SimulatedRobot(config) as robot:
        robot.run_script('def f():\n  interpreter_mode(False)\nend\n')
        with socket.create_connection((config.host, robot.ports.interpreter), 5) as wire:
            stream = wire.makefile('rw')
            stream.write('set_standard_digital_out(3, True)\nend_interpreter()\n')
            stream.flush()
            assert stream.readline() == 'ack: 1: set_standard_digital_out(3, True)\n'
            assert stream.readline() == 'ack: 2: end_interpreter()\n'
        assert robot.state().program == 'f'


def test_the_port_stands_beside_a_standard_primary_port():
    assert SimulatorConfig().listening_interpreter_port == 30020
    assert SimulatorConfig(primary_port=0).listening_interpreter_port == 0
    assert SimulatorConfig(interpreter_port=5).listening_interpreter_port == 5


def test_statements_with_poses_leave_nothing_behind(bench, client):
    names = bench.programs._interpreter._names
    client.say('a = p[0.1, 0, 0, 0, 0, 0]')
    before = len(names)
    for _ in range(20):
        client.say('a = p[0.1, 0, 0, 0, 0, 0]')
    assert len(names) == before
