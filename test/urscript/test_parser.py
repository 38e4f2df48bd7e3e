# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The parser beyond the programs in `cases`: positions, bounds, and no surprises."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st
import pytest

from ur_cartesian_driver.urscript import CompileError, parse
from ur_cartesian_driver.urscript.parsing import syntax_tree as tree
from ur_cartesian_driver.urscript.parsing.scanner import KEYWORDS, SYMBOLS
from ur_cartesian_driver.urscript.parsing.token_reader import MAX_CHAIN, MAX_NESTING


def program(body: str) -> str:
    return f'def f():\n{body}\nend\n'


def first_value(expression: str) -> tree.Expression:
    statement = parse(program(f'x = {expression}')).body[0]
    assert isinstance(statement, tree.AssignStatement)
    return statement.value


def walk(node: tree.SyntaxNode) -> list[tree.SyntaxNode]:
    return [node, *(below for child in tree.children(node) for below in walk(child))]


@pytest.mark.parametrize(('text', 'kind'), [('def a(): end', 'def'), ('sec a(): end', 'sec')])
def test_a_program_has_its_kind_and_name(text: str, kind: str) -> None:
    parsed = parse(text)
    assert (parsed.name, parsed.kind, parsed.body) == ('a', kind, ())


def test_blank_lines_and_comments_surround_a_program() -> None:
    text = '\n\n# first\n' + program('a = 1') + '\n# last\n\n'
    assert parse(text).name == 'f'
    assert parse(text).line == 4


def test_line_ends_of_windows_count_once() -> None:
    body = parse('def f():\r\n  a = 1\r\n  b = 2\r\nend\r\n').body
    assert [(node.line, node.column) for node in body] == [(2, 3), (3, 3)]


def test_nodes_have_the_position_of_their_main_token() -> None:
    text = program('  total = first + second(3, k=4)[5].six')
    places = {(type(node).__name__, node.line, node.column) for node in walk(parse(text).body[0])}
    assert {
        ('AssignStatement', 2, 3),
        ('NameExpression', 2, 3),
        ('BinaryExpression', 2, 17),
        ('NameExpression', 2, 11),
        ('CallExpression', 2, 19),
        ('CallArgument', 2, 29),
        ('IndexExpression', 2, 33),
        ('FieldExpression', 2, 37),
    } <= places


def test_precedence_orders_the_operators() -> None:
    value = first_value('not a or b and c == d + e * -f')
    assert isinstance(value, tree.LogicalExpression)
    assert value.operator == 'or'
    assert isinstance(value.left, tree.UnaryExpression)
    assert isinstance(value.right, tree.LogicalExpression)
    comparison = value.right.right
    assert isinstance(comparison, tree.BinaryExpression)
    assert comparison.operator == '=='
    assert isinstance(comparison.right, tree.BinaryExpression)
    assert comparison.right.operator == '+'


@pytest.mark.parametrize(
    ('text', 'value'),
    [('7', 7), ('2147483647', 2**31 - 1), ('2147483648', 2.0**31), ('1.', 1.0), ('1e3', 1e3)],
)
def test_literals_that_fit_into_32_bits_are_ints(text: str, value: float) -> None:
    constant = first_value(text)
    assert isinstance(constant, tree.ConstantExpression)
    assert (constant.value, type(constant.value)) == (value, type(value))


@pytest.mark.slow
def test_a_thousand_items_and_ten_thousand_statements_are_fine() -> None:
    items = first_value('[' + ', '.join(['1.0'] * 1000) + ']')
    assert isinstance(items, tree.ListLiteral)
    assert len(items.items) == 1000
    assert len(parse(program('a = 1\n' * 10_000)).body) == 10_000


@pytest.mark.parametrize(
    'body',
    [
        'a = ' + '(' * (MAX_NESTING + 1) + '1' + ')' * (MAX_NESTING + 1),
        'a = ' + '[' * 5000 + '1' + ']' * 5000,
        'a = ' + '-' * 5000 + '1',
        'a = ' + 'not ' * 5000 + '1',
        'while True:\n' * 5000 + 'end\n' * 5000,
        'a = ' + 'g(' * 5000 + ')' * 5000,
        'a = 1' + ' + 1' * (MAX_CHAIN + 1),
        'a = b' + '[0]' * (MAX_CHAIN + 1),
    ],
    ids=['brackets', 'lists', 'signs', 'nots', 'loops', 'calls', 'sum', 'indices'],
)
def test_too_deep_a_program_is_a_syntax_error(body: str) -> None:
    with pytest.raises(CompileError, match='syntax_error_on_line'):
        parse(program(body))


@pytest.mark.parametrize('link', ['[0]', ' + 1'])
def test_a_chain_up_to_the_bound_is_fine(link: str) -> None:
    parse(program('a = b' + link * MAX_CHAIN))


def test_nesting_up_to_the_bound_is_fine() -> None:
    depth = MAX_NESTING - 1
    assert isinstance(first_value('(' * depth + '1' + ')' * depth), tree.ConstantExpression)


def test_a_syntax_error_quotes_the_line_and_says_what_is_missing() -> None:
    with pytest.raises(CompileError) as caught:
        parse('def f():\n  movej(q, a=1.4\n  sync()\nend\n')
    error = caught.value
    assert (error.line, error.column) == (3, 3)
    assert error.text == 'syntax_error_on_line:3:  sync():'
    assert error.reason == "')' is missing before 'sync'"
    assert str(error) == f'3:3: {error.text} ({error.reason})'


@pytest.mark.parametrize(
    ('statement', 'reason'),
    [
        ('for i in range(3):', "there is no 'for'; count in a 'while' loop"),
        ('import socket', "there is no 'import'; this may be a file of Python"),
        ('i += 1', "there is no assignment such as '+='; write 'a = a + b'"),
        ("textmsg('a')", 'a string stands in double quotes'),
    ],
)
def test_statements_of_other_languages_are_named(statement: str, reason: str) -> None:
    with pytest.raises(CompileError) as caught:
        parse(program(f'  {statement}'))
    assert (caught.value.line, caught.value.reason) == (2, reason)


def refusal(text: str) -> CompileError | None:
    try:
        parse(text)
    except CompileError as error:
        return error
    return None


def parses_or_is_refused_with_a_position(text: str) -> bool:
    error = refusal(text)
    if error is None:
        return True
    line = text.split('\n')[error.line - 1]
    return 1 <= error.column <= len(line) + 1 and error.text == (
        f'syntax_error_on_line:{error.line}:{line.rstrip(chr(13))}:'
    )


@pytest.mark.slow
@given(st.text())
def test_any_text_parses_or_is_refused_with_a_position(text: str) -> None:
    assert parses_or_is_refused_with_a_position(text)
    assert parses_or_is_refused_with_a_position(program(text))


PIECES = ['a', 'p', '1', '2.5', '"s"', '\n', '# c\n', ':', '()', 'f(', '[0]']
WORDS = st.sampled_from([*sorted(KEYWORDS), *SYMBOLS, *PIECES])


@given(st.lists(WORDS, max_size=60))
def test_any_tokens_parse_or_are_refused_with_a_position(words: list[str]) -> None:
    assert parses_or_is_refused_with_a_position(program(' '.join(words)))
