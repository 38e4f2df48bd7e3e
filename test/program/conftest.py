# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Watch the types of the variables of a program.

The manual deduces the type of a variable from its first assignment, and says nothing about a
fraction that an int is given then.
"""

import ast
from itertools import chain

import pytest

from ur_cartesian_driver.sim.programs import program_runner
from ur_cartesian_driver.urscript.compiling import compiler
from ur_cartesian_driver.urscript.compiling.operations import operations
from ur_cartesian_driver.urscript.parsing import syntax_tree as tree
from ur_cartesian_driver.urscript.script_values import Matrix


def kinds(value):
    """Return the types of the numbers in a value."""
    if isinstance(value, Matrix):
        return set(map(type, chain.from_iterable(value.rows)))
    return set(map(type, value)) if isinstance(value, list) else {type(value)}


@pytest.fixture
def widened(monkeypatch):
    """Return the names of variables that have been given a fraction after an int."""
    found = set()
    assign = compiler._FunctionCompiler._assign

    def checked(self, node):
        python, weight = assign(self, node)
        name = node.target
        while not isinstance(name, tree.NameExpression):
            name = name.target
        variable, held_ints = self.variable(name.identifier, node.qualifier), self.temporary()
        text = (
            f'try:\n {held_ints} = holds_ints({variable})\n'
            f'except NameError:\n {held_ints} = False\n'
            f'check_kinds({name.identifier!r}, {held_ints}, {variable})\n'
        )
        before, after = ast.parse(text).body
        return [before, *python, after], weight

    def holds_ints(value):
        return kinds(value) == {int}

    def check_kinds(name, held_ints, value):
        if held_ints and float in kinds(value):
            found.add(name)

    def with_checks(runtime):
        checks = {'holds_ints': holds_ints, 'check_kinds': check_kinds}
        return operations(runtime) | checks

    monkeypatch.setattr(compiler._FunctionCompiler, '_assign', checked)
    interpreter = 'ur_cartesian_driver.urscript.running.script_interpreter'
    monkeypatch.setattr(f'{interpreter}.operations', with_checks)
    # Code without the checks is kept for other interpreters, and this one is not.
    monkeypatch.setattr(program_runner, '_compiled', {})
    monkeypatch.setattr(compiler, '_functions', {})
    return found
