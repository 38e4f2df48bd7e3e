# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Programs beside the one that runs."""

import re

import pytest

from ur_cartesian_driver.program.secondary_program import tcp_program
from ur_cartesian_driver.urscript import parse


def test_the_tcp_is_set_without_a_thread_or_a_motion():
    text = tcp_program((0.1, -1e-7, 3.0, 1 / 3, 0.0, -2.5))
    assert parse(text).kind == 'sec'
    (numbers,) = re.findall(r'set_tcp\(p\[(.*)\]\)', text)
    assert [float(n) for n in numbers.split(', ')] == pytest.approx(
        [0.1, -1e-7, 3.0, 1 / 3, 0.0, -2.5], abs=1e-12
    )
    assert 'e' not in numbers
