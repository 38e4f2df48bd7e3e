# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Watch the types of the variables of a program.

The manual deduces the type of a variable from its first assignment, and says nothing about a
fraction that an int is given then.
"""

from itertools import chain

import pytest

from ur_cartesian_driver.urscript.compiling import compiler
from ur_cartesian_driver.urscript.compiling.closures import CompiledNode
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
    assign = compiler._Compiler._assign

    def checked(self, node):
        code = assign(self, node)
        name = node.target
        while not isinstance(name, tree.NameExpression):
            name = name.target
        slot, is_local = self._slot(name.identifier, node.qualifier)

        def holds_ints(frame):
            return kinds((frame if is_local else self._runtime.globals)[slot]) == {int}

        def check(frame, before):
            if before and float in kinds((frame if is_local else self._runtime.globals)[slot]):
                found.add(name.identifier)

        def plain(frame):
            before = holds_ints(frame)
            code.run(frame)
            check(frame, before)

        def steps(frame):
            before = holds_ints(frame)
            yield from code.run(frame)
            check(frame, before)

        return CompiledNode(steps if code.suspends else plain, code.suspends, code.weight)

    monkeypatch.setattr(compiler._Compiler, '_assign', checked)
    return found
