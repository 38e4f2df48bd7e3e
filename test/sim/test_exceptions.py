# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Clients of the primary interface learn the place and text of a program's error."""

import pytest

from ur_cartesian_driver.protocol.client_interfaces.primary_messages import (
    KeyMessage,
    RuntimeExceptionMessage,
)

TOO_MUCH = (
    'The program used too much time without instructing the robot what to do. Consider '
    'using a Wait or sync() in the loop.'
)
UNREACHABLE = (
    'The robot cannot reach the requested pose. Script function movej is unable to '
    'find an inverse kinematics solution.'
)
OWNED = 'Another thread is already controlling the robot.'

COMPILE_ERRORS = {
    'an unknown function': (
        'def illegal_fun():\n  calldoesntexist()\nend\n',
        2,
        3,
        'compile_error_name_not_found:calldoesntexist:',
    ),
    'an unknown variable': (
        'def f():\n  a = 1\n  textmsg(a + missing)\nend\n',
        3,
        15,
        'compile_error_name_not_found:missing:',
    ),
    'a syntax error': ('def f():\n  a = = 1\nend\n', 2, 7, 'syntax_error_on_line:2:  a = = 1:'),
    'a missing colon': (
        'def f():\n  while True\n    sync()\n  end\nend\n',
        3,
        5,
        'syntax_error_on_line:3:    sync():',
    ),
    'a secondary program': (
        'sec f():\n  nothing()\nend\n',
        2,
        3,
        'compile_error_name_not_found:nothing:',
    ),
}

RUNTIME_EXCEPTIONS = {
    'an unreachable pose': (
        'def f():\n  movej(p[10, 0, 0, 0, 0, 0])\nend\n',
        2,
        3,
        f'Runtime error (2:3): {UNREACHABLE}',
    ),
    'a second thread that moves': (
        'def f():\n  thread t():\n    stopj(2)\n  end\n  thread m():\n'
        '    movej([1, -1, 1, 0, 0, 0])\n  end\n  run m()\n  sync()\n  run t()\n  sync()\nend\n',
        3,
        5,
        f'Runtime error (3:5): {OWNED}',
    ),
    'a loop that never waits': (
        'def f():\n  while True:\n    a = 1\n  end\nend\n',
        3,
        5,
        f'Runtime error (3:5): {TOO_MUCH}',
    ),
    'a domain error inside an expression': (
        'def f():\n  a = 1 + sqrt(-4)\nend\n',
        2,
        11,
        'Runtime error (2:11): Domain error: sqrt is defined from 0 on, got -4',
    ),
    'an index inside a function': (
        'def f():\n  def g(l):\n    return l[3]\n  end\n  g([1])\nend\n',
        3,
        13,
        'Runtime error (3:13): Index out of range: 3 is not within 0..0',
    ),
}


def messages(bench, program):
    bench.programs.submit(program)
    bench.step(30)
    return bench.controller.messages.take()


@pytest.mark.parametrize('case', COMPILE_ERRORS)
def test_a_program_that_does_not_compile_is_refused_with_place_and_text(bench, case):
    program, line, column, text = COMPILE_ERRORS[case]
    (message,) = messages(bench, program)  # and no key message: nothing has started
    assert isinstance(message, RuntimeExceptionMessage)
    assert (message.line, message.column, message.text) == (line, column, text)


@pytest.mark.parametrize('case', RUNTIME_EXCEPTIONS)
def test_a_runtime_exception_stands_between_start_and_stop(bench, case):
    program, line, column, text = RUNTIME_EXCEPTIONS[case]
    start, message, stop = messages(bench, program)
    assert isinstance(start, KeyMessage)
    # The titles are the controller's own: it really writes XXX.
    assert start.title == 'PROGRAM_XXX_STARTED'
    assert isinstance(message, RuntimeExceptionMessage)
    assert (message.line, message.column, message.text) == (line, column, text)
    assert isinstance(stop, KeyMessage)
    assert (stop.title, stop.text) == ('PROGRAM_XXX_STOPPED', 'f')


def test_an_exception_of_a_secondary_program_leaves_the_primary_one_running(bench):
    bench.start('while True:\nsync()\nend')
    bench.step(2)
    bench.controller.messages.take()
    (message,) = messages(bench, 'sec s():\n  a = 1 / 0\nend\n')
    assert isinstance(message, KeyMessage)
    assert message.title == 'SECONDARY_PROGRAM_EXCEPTION_XXX'
    assert 'Division by zero' in message.text
    assert bench.programs.running
