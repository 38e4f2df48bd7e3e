# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Programs that nobody would write: each gets an answer, and the controller lives on.

From a small grammar with every function of the controller in it, and real programs with words
exchanged, dropped and doubled. Seeds make them the same in each run.
"""

from __future__ import annotations

from collections.abc import Mapping
import inspect
from pathlib import Path
from random import Random
import re
import time
from typing import Any

import pytest
from tracked_files import tracked_files

from ur_cartesian_driver.motion.state.rtde_state import RuntimeState
from ur_cartesian_driver.sim.builtins import controller_builtins

HERE = Path(__file__).parent
REAL = sorted(
    [
        *tracked_files(HERE / 'programs', '*.script'),
        *tracked_files(HERE.parent / 'urscript', '**/*.script'),
    ]
)
WORDS = re.compile(r'"[^"\n]*"|[A-Za-z_]\w*|\d+\.?\d*|\s+|.')
DIGITS_AND_QUOTE = tuple('0123456789"')
COMMENT = re.compile('#.*')
SEEDS = range(40)
#: A step that computes for longer than this has hung [s]; a cycle has 2 ms.
HUNG = 2.0

NAMES = ('a', 'b', 'c', 'q', 'f', 'g')
CONSTANTS = (
    '0',
    '1',
    '-1',
    '2147483647',
    '-2147483648',
    '1e308',
    '1e-300',
    '0.1',
    '3.14',
    'True',
    'False',
    '""',
    '"text"',
    '"%f"',
    '[]',
    '[1,2,3]',
    '[0,-1.5,1.5,-1.5,-1.5,0]',
    '[[1,2],[3,4]]',
    'p[0.4,0.1,0.4,0,3.1,0]',
    'p[0,0,0,0,0,0]',
    'p[9,9,9,1,2,3]',
    'struct(x=1,y=[1,2])',
)
OPERATORS = ('+', '-', '*', '/', '%', '==', '!=', '<', '<=', '>', '>=', ' and ', ' or ', ' xor ')
#: They would end the whole case, or do nothing but wait for somebody.
NOT_CALLED = {'interpreter_mode', 'halt', 'powerdown', 'sleep'}


class Grammar:
    """Sentences of URScript, most of which parse."""

    def __init__(self, random: Random, functions: Mapping[str, Any]) -> None:
        self.random = random
        self.functions = functions
        self.names = sorted(set(functions) - NOT_CALLED)
        self.loops = 0

    def expression(self, depth: int = 3) -> str:
        choice = self.random.random()
        if depth == 0 or choice < 0.35:
            return self.random.choice(CONSTANTS + NAMES)
        if choice < 0.6:
            return (
                f'({self.expression(depth - 1)}{self.random.choice(OPERATORS)}'
                f'{self.expression(depth - 1)})'
            )
        if choice < 0.7:
            return f'{self.random.choice(NAMES)}[{self.expression(depth - 1)}]'
        if choice < 0.75:
            return f'not {self.expression(depth - 1)}'
        return self.call(depth - 1)

    def call(self, depth: int) -> str:
        name = self.random.choice(self.names)
        count = self.random.randint(*number_of_arguments(self.functions[name]))
        return f'{name}({", ".join(self.expression(depth) for _ in range(count))})'

    def statement(self, indent: str, depth: int = 3) -> list[str]:
        inner = indent + '  '
        match self.random.randrange(9 if depth else 5):
            case 0 | 1:
                return [f'{indent}{self.random.choice(NAMES)} = {self.expression()}']
            case 2 | 3:
                return [indent + self.call(2)]
            case 4:
                endings = ('break', 'continue') if self.loops else ()
                return [indent + self.random.choice(('sync()', 'stopj(2)', 'return 1', *endings))]
            case 5:
                return [
                    f'{indent}if {self.expression(2)}:',
                    *self.block(inner, depth - 1),
                    f'{indent}else:',
                    *self.block(inner, depth - 1),
                    f'{indent}end',
                ]
            case 6:
                self.loops += 1
                block = self.block(inner, depth - 1)
                self.loops -= 1
                return [f'{indent}while {self.expression(1)}:', *block, f'{indent}end']
            case 7:
                return [
                    f'{indent}thread t():',
                    *self.function(inner, depth),
                    f'{indent}end',
                    f'{indent}h = run t()',
                ]
            case _:
                return [
                    f'{indent}def f(a=1):',
                    *self.function(inner, depth),
                    f'{indent}end',
                    f'{indent}a = f({self.expression(1)})',
                ]

    def block(self, indent: str, depth: int) -> list[str]:
        return [
            line
            for _ in range(self.random.randint(1, 4))
            for line in self.statement(indent, depth)
        ]

    def function(self, indent: str, depth: int) -> list[str]:
        loops, self.loops = self.loops, 0
        block = self.block(indent, depth - 1)
        self.loops = loops
        return block

    def program(self) -> str:
        start = [f'  {name} = {self.random.choice(CONSTANTS)}' for name in NAMES]
        kind = self.random.choice(('def', 'def', 'def', 'sec'))
        return '\n'.join([f'{kind} fuzz():', *start, *self.block('  ', 3), 'end', ''])


def number_of_arguments(function: Any) -> tuple[int, int]:
    """Return how many arguments a function needs, and how many it takes."""
    parameters = inspect.signature(getattr(function, 'function', function)).parameters.values()
    return sum(p.default is p.empty for p in parameters), len(parameters)


def mutated(random: Random, text: str) -> str:
    """Exchange, drop and double some words inside of what stays one program."""
    body = WORDS.findall(COMMENT.sub('', text))
    for _ in range(random.choice((1, 1, 2, 5, 20))):
        i, j = random.randrange(len(body)), random.randrange(len(body))
        match random.randrange(8):
            case 0:
                body[i], body[j] = body[j], body[i]
            case 1:
                body[i] = ''
            case 2:
                body[i] *= random.choice((2, 2, 50))
            case 3:
                body[i] = random.choice(CONSTANTS + OPERATORS + NAMES + ('end', ':', '(', ']'))
            case _:  # what still parses, more often
                numbers = [k for k, word in enumerate(body) if word[:1] in DIGITS_AND_QUOTE]
                if numbers:
                    body[random.choice(numbers)] = random.choice(CONSTANTS)
    lines = ''.join(f'  {line}\n' for line in ''.join(body).splitlines())
    return f'def fuzz():\n{lines}end\n'


def answers(bench, text):
    """Run a program for a while; return the controller's messages about it."""
    bench.controller.messages.take()
    said = len(bench.log)
    begin = time.process_time()
    bench.programs.submit(text)
    assert time.process_time() - begin < HUNG, f'compiling hung:\n{text}'
    for _ in range(30):
        begin = time.process_time()
        bench.step()
        assert time.process_time() - begin < HUNG, f'a cycle hung:\n{text}'
    bench.programs.stop()
    frames = list(bench.controller.messages.take())
    bench.until(lambda: bench.programs.state is RuntimeState.STOPPED)
    return bench.log[said:], frames


def check(bench, text):
    log, announced = answers(bench, text)
    assert not [line for line in log if 'nternal error' in line], f'{log}\n{text}'
    if text.startswith('def'):
        assert announced, f'nothing was said about\n{text}'


@pytest.mark.slow
@pytest.mark.parametrize('seed', SEEDS)
def test_a_random_program_gets_an_answer(make_bench, seed):
    random, bench = Random(seed), make_bench()
    grammar = Grammar(random, controller_builtins(bench.controller))
    for _ in range(10):
        check(bench, grammar.program())


BODIES = {
    'threads that start threads': """
thread t():
  run t()
  run t()
  sync()
end
run t()
while True:
  sync()
end""",
    'endless recursion': 'def g():\n  g()\nend\ng()',
    'a list of all integers': 'a = make_list(2147483647, 0)',
    'a number of many digits': 'a = ' + '9' * 10_000 + '\nmovej([a, a, a, a, a, a])',
    'a string that doubles': 's = "x"\nwhile True:\n  s = str_cat(s, s)\nend',
    'deep brackets': 'a = ' + '(' * 10_000 + '1' + ')' * 10_000,
    'a fast linear speed': 'speedl([1e300, 0, 0, 0, 0, 0], a=1e300)',
    'a fast angular speed': 'speedl([0, 0, 0, 0, 1e300, 0], a=1e300)',
    'a fast joint speed': 'speedj([1e300, 0, 0, 0, 0, 0], a=1e300)',
    'a path to the stars': 'movel(p[1e300, 1e300, 0, 0, 0, 0])',
    'a tool as long as that': 'set_tcp(p[1e300, 0, 0, 0, 0, 0])\nmovel(p[0.4, 0, 0.4, 0, 3, 0])',
    'no time at all': 'movej([0, 0, 0, 0, 0, 0], t=1e-300)',
    'a flood of texts': 'while True:\n  textmsg("a")\nend',
}


@pytest.mark.parametrize('body', BODIES.values(), ids=BODIES)
def test_a_program_that_wants_too_much_gets_an_answer(bench, body):
    check(bench, 'def fuzz():\n' + ''.join(f'  {line}\n' for line in body.splitlines()) + 'end\n')


@pytest.mark.slow
@pytest.mark.parametrize('seed', SEEDS)
def test_a_function_with_odd_arguments_gets_an_answer(make_bench, seed):
    random, bench = Random(seed), make_bench()
    grammar = Grammar(random, controller_builtins(bench.controller))
    for name in random.sample(grammar.names, 40):
        count = random.randint(*number_of_arguments(grammar.functions[name]))
        arguments = ', '.join(random.choice(CONSTANTS) for _ in range(count))
        check(bench, f'def fuzz():\n  a = {name}({arguments})\n  textmsg(a)\nend\n')


@pytest.mark.slow
@pytest.mark.parametrize('seed', SEEDS)
def test_a_mutated_real_program_gets_an_answer(make_bench, seed):
    random, bench = Random(seed), make_bench()
    for _ in range(5):
        check(bench, mutated(random, random.choice(REAL).read_text()))
