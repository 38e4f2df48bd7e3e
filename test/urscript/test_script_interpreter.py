# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Properties that programs cannot test: frames, threads, budgets, stopping, positions."""

from __future__ import annotations

from collections.abc import Callable, Generator, Hashable
from random import Random
from typing import Any

from hypothesis import given, settings
from hypothesis import strategies as st
import pytest

from ur_cartesian_driver.urscript import (
    CompileError,
    core_builtins,
    parse,
    RuntimeException,
    ScriptInterpreter,
    ScriptPose,
    Struct,
    to_text,
)
from ur_cartesian_driver.urscript.running.script_interpreter import BUDGET_EXCEEDED


def sync() -> Generator[None, None, None]:
    yield


def machine(body: str, *, kind: str = 'def', **builtins: Callable[..., Any]) -> ScriptInterpreter:
    return ScriptInterpreter(
        parse(f'{kind} f():\n{body}\nend\n'), {**core_builtins(), 'sync': sync, **builtins}
    )


def frames_until_the_end(running: ScriptInterpreter, limit: int = 1000) -> int:
    for frame in range(limit):
        if not running.running:
            return frame
        running.step()
    raise AssertionError('the program does not end')


# Frames


def test_a_program_that_takes_no_time_ends_in_its_first_frame() -> None:
    assert frames_until_the_end(machine('a = 1')) == 1


def test_each_yield_of_a_builtin_takes_one_frame() -> None:
    def wait(n: int) -> Generator[None, None, int]:
        for _ in range(n):
            yield
        return n * 2

    running = machine('a = wait(3)\nb = wait(n=2)', wait=wait)
    assert frames_until_the_end(running) == 6
    assert running.variables == {'a': 6, 'b': 4}


def test_nothing_runs_before_the_first_step() -> None:
    seen: list[int] = []
    running = machine('note(1)', note=seen.append)
    assert running.running
    assert seen == []


def test_an_interpreter_that_has_ended_does_not_change() -> None:
    running = machine('a = 1')
    running.step()
    running.step()
    assert not running.running
    assert running.error is None
    assert running.variables == {'a': 1}


def test_a_secondary_program_that_waits_is_still_running_after_its_frame() -> None:
    running = machine('sync()', kind='sec')
    running.step()
    assert running.running


def test_builtins_take_and_return_script_values() -> None:
    seen: list[Any] = []

    def give() -> Struct:
        return Struct({'sec': 1, 'where': ScriptPose(1, 2, 3, 4, 5, 6)})

    running = machine(
        's = give()\nsee(s.where, [1, 2.5], [[1], [2]], "t", None, s.sec == 1)',
        give=give,
        see=lambda *values: seen.extend(values),
    )
    frames_until_the_end(running)
    assert seen[0] == ScriptPose(1, 2, 3, 4, 5, 6)
    assert seen[1] == [1, 2.5]
    assert seen[2].rows == [[1], [2]]
    assert seen[3:] == ['t', None, True]


def test_a_list_that_a_builtin_keeps_does_not_change_behind_the_program() -> None:
    kept = [1, 2]
    running = machine('a = give()\na[0] = 9\nsync()\nb = give()', give=lambda: kept)
    running.step()
    kept[1] = 7
    running.step()
    assert running.variables == {'a': [9, 2], 'b': [1, 7]}


# Threads

THREAD = 'thread t():\nwhile True:\nnote()\nsync()\nend\nend\n'


def test_builtins_know_the_thread_that_calls_them() -> None:
    seen: list[Hashable] = []
    running = machine(
        THREAD + 'note()\nrun t()\nrun t()\nsync()\nnote()',
        note=lambda: seen.append(running.current_thread),
    )
    frames_until_the_end(running)
    assert running.current_thread is None
    main, first, second, main_again = seen
    assert main == main_again
    assert len({main, first, second}) == 3


def test_a_thread_starts_in_the_frame_in_which_it_is_run() -> None:
    frames: list[int] = []
    frame = 0
    body = 'sync()\nrun t()\nsync()\nsync()'
    running = machine(THREAD + body, note=lambda: frames.append(frame))
    while running.running:
        running.step()
        frame += 1
    assert frames == [1, 2]


@pytest.mark.parametrize(
    ('body', 'ended'),
    [
        ('h = run t()\nsync()\nkill h\nsync()\nsync()', [1, 0]),
        ('run t()\nrun t()\nsync()', [0, 1, 2]),
        ('run t()\nsync()\nhalt', [0, 1]),
        ('run t()\nsync()\na = 1 / 0', [0, 1]),
    ],
    ids=['kill', 'end of the program', 'halt', 'error'],
)
def test_the_end_of_every_thread_is_announced_once(body: str, ended: list[int]) -> None:
    announced: list[Hashable] = []
    running = machine(THREAD + body, note=lambda: None)
    running.on_thread_end = announced.append
    frames_until_the_end(running)
    assert announced == ended


@pytest.mark.parametrize('body', ['kill h\nsync()', 'halt', 'a = 1 / 0', 'return'])
def test_a_builtin_that_waits_cleans_up_as_the_thread_it_belongs_to(body: str) -> None:
    cleaned: list[Hashable] = []

    def move() -> Generator[None, None, None]:
        try:
            while True:
                yield
        finally:
            cleaned.append(running.current_thread)

    running = machine(f'thread t():\nmove()\nend\nh = run t()\nsync()\n{body}', move=move)
    frames_until_the_end(running)
    assert cleaned == [1]


def test_stop_ends_the_program_and_closes_waiting_builtins() -> None:
    closed: list[bool] = []

    def move() -> Generator[None, None, None]:
        try:
            while True:
                yield
        finally:
            closed.append(True)

    running = machine('move()', move=move)
    running.step()
    running.stop()
    assert not running.running
    assert running.error is None
    assert closed == [True]
    running.stop()
    running.step()
    assert closed == [True]


def test_stop_from_a_builtin_ends_the_program_within_the_frame() -> None:
    seen: list[int] = []
    running = machine(
        'thread t():\nnote(1)\nend\nrun t()\nstop()\nsync()\nnote(2)',
        note=seen.append,
        stop=lambda: running.stop(),
    )
    running.step()
    assert not running.running
    assert seen == []


def test_a_killed_thread_leaves_its_critical_section() -> None:
    running = machine(
        'n = 0\nthread t():\nenter_critical\nwhile True:\nsync()\nend\nend\n'
        'h = run t()\nsync()\nkill h\nenter_critical\nn = 1\nexit_critical'
    )
    assert frames_until_the_end(running) == 2
    assert running.variables['n'] == 1


def test_recursion_is_counted_for_each_thread_by_itself() -> None:
    body = 'def deep(n):\nif n > 0:\ndeep(n - 1)\nend\nsync()\nend\n'
    threads = 'thread t():\ndeep(60)\nend\nrun t()\nrun t()\ndeep(60)'
    running = machine(body + threads)
    frames_until_the_end(running)
    assert running.error is None


def test_recursion_through_deep_expressions_is_an_error_and_no_crash() -> None:
    deep = '(' * 40 + '1 + g(n + 1)' + ' + 0)' * 40
    running = machine(f'def g(n):\nreturn {deep}\nend\ng(0)')
    frames_until_the_end(running)
    assert running.error is not None
    assert running.error.text == 'Function calls are nested too deeply.'
    assert running.error.line > 0


def test_a_builtin_that_fails_to_clean_up_leaves_an_error() -> None:
    def move() -> Generator[None, None, None]:
        try:
            yield
        finally:
            raise ValueError('stuck')

    running = machine('move()', move=move)
    running.step()
    running.stop()
    assert not running.running
    assert running.error is not None
    assert running.error.text == 'move: stuck'


# Pause


def test_a_paused_program_stays_until_it_is_resumed() -> None:
    seen: list[int] = []
    running = machine('note(1)\npause\nnote(2)', note=seen.append)
    running.step()
    assert running.paused
    running.step()
    assert seen == [1]
    running.resume()
    running.step()
    assert seen == [1, 2]
    assert not running.running


# Budget


def test_a_thread_that_exceeds_its_budget_ends_the_program_with_a_position() -> None:
    body = parse('def f():\n  i = 0\n  while True:\n    i = i + 1\n  end\nend')
    running = ScriptInterpreter(body, {}, instruction_budget=1000)
    running.step()
    assert not running.running
    assert running.error is not None
    assert (running.error.line, running.error.column) == (4, 5)
    assert running.error.text == BUDGET_EXCEEDED
    assert 100 <= running.variables['i'] <= 250


def test_a_total_budget_bounds_all_frames_and_threads_together() -> None:
    text = (
        'def f(): thread t(): while True: y = 1 sync() end end run t() while True: sync() end end'
    )
    running = ScriptInterpreter(parse(text), {'sync': sync}, total_budget=1000)
    frames = 0
    while running.running:
        running.step()
        frames += 1
    assert running.error is not None
    assert running.error.text == BUDGET_EXCEEDED
    assert 20 < frames < 200


@pytest.mark.parametrize(
    'loop',
    [
        'a = a + 1',
        'b = a',
        'b = -a',
        'x = a == a',
        'x = length(a)',
        'a.insert(0, 1)',
        'm = [a, a]',
        's = struct(a=a)',
    ],
)
def test_long_values_cost_as_many_nodes_as_they_have_items(loop: str) -> None:
    text = f'def f(): a = make_list(50000, 0) n = 0 while True: {loop} n = n + 1 end end'
    running = ScriptInterpreter(parse(text), core_builtins(), instruction_budget=1_000_000)
    running.step()
    assert running.error is not None
    assert running.error.text == BUDGET_EXCEEDED
    rounds = running.variables['n']
    assert rounds < (320 if 'insert' in loop else 21)


def test_structs_in_structs_cannot_double_for_ever() -> None:
    text = 'def f(): s = struct(a=1) while True: s = struct(a=s, b=s) end end'
    running = ScriptInterpreter(parse(text), core_builtins(), instruction_budget=10_000_000)
    running.step()
    assert running.error is not None
    assert 'more than 100000 items' in running.error.text


def test_the_budget_is_fresh_in_every_frame_and_for_every_thread() -> None:
    loop = 'i = 0\nwhile i < 50:\ni = i + 1\nend\nsync()\n'
    text = f'def f():\nthread t():\n{loop * 5}end\nrun t()\n{loop * 5}end'
    running = ScriptInterpreter(parse(text), {'sync': sync}, instruction_budget=600)
    frames_until_the_end(running)
    assert running.error is None


def test_recursion_without_loops_costs_budget_too() -> None:
    text = 'def f():\ndef g(n):\nif n > 0:\ng(n - 1)\ng(n - 1)\nend\nend\ng(60)\nend'
    running = ScriptInterpreter(parse(text), {}, instruction_budget=10_000)
    running.step()
    assert running.error is not None
    assert running.error.text == BUDGET_EXCEEDED


# Errors


def test_location_is_that_of_the_call_being_executed() -> None:
    seen: list[tuple[int, int]] = []

    def slow() -> Generator[None, None, None]:
        yield
        seen.append(running.location)

    running = machine(
        'thread t():\nwhere()\nend\n  run t()\n  slow()',
        where=lambda: seen.append(running.location),
        slow=slow,
    )
    frames_until_the_end(running)
    assert seen == [(3, 1), (6, 3)]


def test_a_runtime_error_has_the_innermost_position() -> None:
    running = machine('def g(x):\n  return 1 / x\nend\nsync()\na = [g(0)]')
    frames_until_the_end(running)
    assert running.error is not None
    assert (running.error.line, running.error.column) == (3, 12)
    assert str(running.error) == 'Runtime error (3:12): Division by zero'


@pytest.mark.parametrize(
    'error',
    [ValueError('v'), TypeError('t'), ZeroDivisionError('z'), OverflowError('o'), OSError()],
)
def test_an_error_of_a_builtin_ends_only_the_program(error: Exception) -> None:
    def now() -> None:
        raise error

    def later() -> Generator[None, None, None]:
        yield
        raise error

    for name in ('now', 'later'):
        running = machine(f'  {name}()', now=now, later=later)
        frames_until_the_end(running)
        assert running.error is not None
        assert (running.error.line, running.error.column) == (2, 3)
        assert running.error.text.startswith(f'{name}: ')


def test_arguments_of_builtins_are_checked_against_their_python_signature() -> None:
    def servoj(q: Any, a: Any = 0, v: Any = 0, t: float = 0.002) -> None:
        pass

    machine('servoj([0], t=0.002)', servoj=servoj)
    with pytest.raises(CompileError) as caught:
        machine('  servoj([0], gain=300)', servoj=servoj)
    assert (caught.value.line, caught.value.column) == (2, 3)
    assert 'gain' in caught.value.reason


@pytest.mark.parametrize(
    ('statement', 'reason'),
    [
        ('x = my_plane_1', "there is no variable 'my_plane_1'"),
        ('rq_open_and_wait()', "there is no function 'rq_open_and_wait'"),
        ('run step_counter()', "there is no thread 'step_counter'"),
        ('sin(1, 2)', 'sin(): too many positional arguments'),
    ],
)
def test_names_are_reported_as_they_are_written(statement: str, reason: str) -> None:
    with pytest.raises(CompileError) as caught:
        ScriptInterpreter(parse(f'def f(): {statement} end'), core_builtins())
    assert caught.value.reason == reason


def test_the_first_unknown_name_in_the_text_is_reported() -> None:
    with pytest.raises(CompileError) as caught:
        machine('def g():\n  one()\nend\ntwo()')
    assert caught.value.text == 'compile_error_name_not_found:one:'
    assert (caught.value.line, caught.value.column) == (3, 3)


# Determinism


def transcript(text: str) -> list[str]:
    output: list[str] = []
    running = ScriptInterpreter(
        parse(text),
        {**core_builtins(), 'sync': sync, 'say': lambda value: output.append(to_text(value))},
    )
    for _ in range(50):
        running.step()
    return output


def test_the_same_program_does_the_same_twice() -> None:
    loop = 'while True:\nn = n * 2 + {1}\nn = n % 1000\nsay(n)\nsync()\nend\n'
    thread = 'thread {0}():\n' + loop + 'end\n'
    threads = ''.join(thread.format(name, number) for number, name in enumerate('abc'))
    text = f'def f():\nn = 1\n{threads}run a() run b() run c()\nsay(random())\njoin run a()\nend'
    first = transcript(text)
    assert len(first) > 100
    assert transcript(text) == first


# Arithmetic against Python's

NUMBERS = st.integers(-40000, 40000) | st.floats(-1e6, 1e6).map(lambda x: round(x, 3))


@settings(max_examples=200)
@given(NUMBERS, NUMBERS, st.sampled_from(['+', '-', '*', '<', '<=', '>', '>=', '==', '!=']))
def test_numbers_compute_as_in_python(a: float, b: float, operator: str) -> None:
    running = machine(f'c = get_a() {operator} get_b()', get_a=lambda: a, get_b=lambda: b)
    running.step()
    expected = eval(f'a {operator} b', {'a': a, 'b': b})
    if type(expected) is int and abs(expected) > 2**31 - 1:
        assert isinstance(running.error, RuntimeException)
    else:
        assert running.variables['c'] == expected
        assert type(running.variables['c']) is type(expected)


@given(st.integers(-1000, 1000), st.integers(-1000, 1000).filter(bool))
def test_quotient_and_remainder_belong_together(a: int, b: int) -> None:
    running = machine('r = a() % b()\nq = (a() - r) / b()', a=lambda: a, b=lambda: b)
    running.step()
    q, r = running.variables['q'], running.variables['r']
    assert q == int(a / b)
    assert q * b + r == a


# How threads are scheduled otherwise


def scheduled(
    body: str, *, delay: int = 0, seed: int | None = None, budget: int = 100_000
) -> ScriptInterpreter:
    return ScriptInterpreter(
        parse(f'def f():\n{body}\nend\n'),
        {'sync': sync},
        thread_delay=delay,
        interleaving=None if seed is None else Random(seed),
        instruction_budget=budget,
    )


@pytest.mark.parametrize('delay', [0, 1, 3])
@pytest.mark.parametrize('seed', [None, 1])
def test_a_new_thread_begins_later(delay: int, seed: int | None) -> None:
    running = scheduled(
        'n = 0\nbegun = -1\nthread t():\nbegun = n\nend\n'
        'run t()\nwhile n < 9:\nsync()\nn = n + 1\nend',
        delay=delay,
        seed=seed,
    )
    frames_until_the_end(running)
    # At random, the main thread may have counted the frame already.
    assert running.variables['begun'] in {delay - 1, delay}


def count_in_two_threads(change: str, seed: int | None) -> int:
    loop = f'local i = 0\nwhile i < 100:\n{change}\ni = i + 1\nend\n'
    running = scheduled(
        f'n = 0\nthread t():\n{loop}end\nh = run t()\nthread u():\n{loop}end\n'
        'k = run u()\njoin h\njoin k',
        seed=seed,
    )
    frames_until_the_end(running)
    assert running.error is None
    count = running.variables['n']
    assert isinstance(count, int)
    return count


def test_threads_that_take_turns_at_random_lose_counts() -> None:
    assert count_in_two_threads('n = n + 1', None) == 200
    assert count_in_two_threads('n = n + 1', seed=1) < 200


@pytest.mark.parametrize('seed', range(5))
def test_a_critical_section_keeps_counts(seed: int) -> None:
    change = 'enter_critical\nn = n + 1\nexit_critical'
    assert count_in_two_threads(change, seed) == 200


@pytest.mark.parametrize('seed', range(5))
def test_a_thread_that_waits_in_a_critical_section_lets_others_run(seed: int) -> None:
    running = scheduled(
        'n = 0\nthread t():\nwhile True:\nenter_critical\nn = n + 1\nexit_critical\nsync()\nend\n'
        'end\nrun t()\nenter_critical\nsync()\nsync()\nsync()\nexit_critical',
        seed=seed,
    )
    assert frames_until_the_end(running) == 4
    assert running.variables['n'] in {3, 4}


def test_a_seed_repeats_the_turns() -> None:
    counts = [count_in_two_threads('n = n + 1', seed) for seed in (1, 2, 3, 1, 2, 3)]
    assert counts[:3] == counts[3:]
    assert len(set(counts)) > 1


def test_an_endless_loop_ends_at_its_budget_however_threads_take_turns() -> None:
    running = scheduled('i = 0\nwhile True:\ni = i + 1\nend', seed=1, budget=1000)
    running.step()
    assert running.error is not None
    assert running.error.text == BUDGET_EXCEEDED


# Code that is used again


def test_interpreters_of_one_code_share_neither_variables_nor_lines() -> None:
    program, builtins = (
        parse('def f():\ncount = 0\ncount = count + 1\nsync()\nend\n'),
        {'sync': sync},
    )
    first = ScriptInterpreter(program, builtins)
    first.step()
    first.lines.compile('added = 2')
    second = ScriptInterpreter(program, builtins, code=first.code)
    assert second.variables == {}
    second.step()
    assert first.variables == second.variables == {'count': 1}
    with pytest.raises(CompileError):
        second.lines.compile('count = added')


def test_a_function_with_a_constant_of_another_type_is_another_one() -> None:
    for number in ('1', '1.0', 'True', '0', '0.0'):
        running = machine(f'def value():\nreturn {number}\nend\nx = value()')
        running.step()
        assert repr(running.variables['x']) == number


def test_loops_nested_deeper_than_python_has_them_are_refused_with_a_place() -> None:
    deep = 'while True:\n' * 25 + 'break\n' + 'end\n' * 25
    with pytest.raises(CompileError, match='nested') as caught:
        machine(f'def f():\n{deep}end\nf()')
    assert caught.value.line > 0
