# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Mistakes in a script prelude are sentences with a line; correct functions can be called."""

import errno
import os

import pytest

from ur_cartesian_driver.driver import DriverConfig
from ur_cartesian_driver.program.prelude import NO_PRELUDE, PreludeFunction
from ur_cartesian_driver.robot.prelude_file import compile_prelude, read_prelude

RIGHT = """# HEADER_END
gripper = rpc_factory("xmlrpc", "http://127.0.0.1:41414")
width = 0.04
width = 0.05

def cancel():
  # A name that the driver's program has, too, with a prefix.
  gripper.stop(1)
end
def move_to(w, force=20, speed=0.1):
  global width = w
  watch = run watch_it()
end
thread watch_it():
  sync()
end
"""


def test_functions_variables_and_threads_make_a_prelude(tmp_path):
    (tmp_path / 'a.script').write_bytes(b'\xef\xbb\xbf' + RIGHT.replace('\n', '\r\n').encode())
    prelude = read_prelude(str(tmp_path / 'a.script'))
    assert prelude.functions == (
        PreludeFunction(name='cancel'),
        PreludeFunction(name='move_to', required=1, allowed=3),
    )
    assert prelude.file == 'a.script'
    assert [line for line in prelude.lines if '#' in line or not line.strip()] == []
    assert [prelude.number('move_to', count) for count in (1, 2, 3)] == [1, 2, 3]
    assert list(prelude.dispatch())[-3:] == [
        '  elif number == 3:',
        '    move_to(x[0], x[1], x[2])',
        '  end',
    ]
    assert DriverConfig().prelude == NO_PRELUDE


@pytest.mark.parametrize(
    ('text', 'sentence'),
    [
        ('def f(:\nend', "line 1: a name is missing before ':'."),
        ('def f():\n\n  x = {}\nend', "line 3: '{' has no meaning here."),
        ('\ndef f():\n', "line 3: the 'def' of line 2 has no 'end'."),
        (
            'gap = 1\nmovej(gap)',
            'line 2: only functions (def), threads and assignments are allowed',
        ),
        ('x[0] = 1', 'line 1: only functions (def), threads and assignments are allowed at'),
        ('def f():\nend\ndef f():\nend', 'line 3: f is defined in line 1, too.'),
        ('f = 1\ndef f():\nend', 'line 2: f is defined in line 1, too.'),
        ('def sync():\nend', 'line 1: sync is a function of the controller that the driver uses'),
        ('def ur_cartesian_driver():\nend', 'line 1: ur_cartesian_driver is a function of the'),
        ('point = 1\ndef f():\nend', "line 1: point is a local name of the driver's own program"),
        ('speed = 1\ndef f():\nend', "line 1: speed is a local name of the driver's own program"),
        ('def x():\nend', "line 1: x is a local name of the driver's own program"),
        ('def f():\nend\nthread number():\nend', 'line 3: number is a local name of the'),
        ('\ndef f(): # HEADER_END\nend', 'line 2: the External Control node divides the program'),
        ('def f():\n  textmsg("# HEADER_BEGIN")\nend', "at '# HEADER_BEGIN'; remove it"),
        ('def f():\n  urcd_running = 1\nend', 'line 2: urcd_running begins with urcd_, as the'),
        ('def f():\n  run urcd_watch()\nend', 'line 2: urcd_watch begins with urcd_, as the'),
        ('gap = 1', ' defines no function (def).'),
    ],
)
def test_a_mistake_is_a_sentence_with_file_and_line(text, sentence):
    with pytest.raises(ValueError, match=r'^script_prelude: a\.script') as error:
        compile_prelude(text, 'a.script')
    assert sentence in str(error.value)
    assert str(error.value).endswith('.')


def test_a_file_that_is_none_is_refused(tmp_path):
    (tmp_path / 'latin.script').write_bytes('# gr\u00f6\u00dfe'.encode('latin-1'))
    (tmp_path / 'long.script').write_text('#' * 200_001)
    for name, reason in (
        ('nothing.script', f'{os.strerror(errno.ENOENT)}.'),
        ('latin.script', 'it is not text in UTF-8.'),
        ('long.script', 'has more than 200000 characters.'),
    ):
        with pytest.raises(ValueError, match=r'^script_prelude is ') as error:
            DriverConfig(script_prelude=str(tmp_path / name), allow_scripts=True)
        assert str(error.value).endswith(reason)


def test_a_prelude_needs_permission():
    with pytest.raises(
        ValueError, match=r"'a\.script', but allow_scripts is false; its functions"
    ):
        DriverConfig(script_prelude='a.script')
