# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""URScript as PolyScope saves it and offline programming writes it."""

from math import pi

import numpy as np
import pytest

from ur_cartesian_driver.importing import BrokenFile, import_file
from ur_cartesian_driver.motion.goal import OutputKind, SegmentType

#: As an offline programming tool writes it: one function, speeds as variables, a loop.
PROGRAM = """def weld():
  global speed_ms = 0.05
  set_tcp(p[0, 0, 0.1, 0, 0, 0])
  popup("Ready?")
  movej([0, -1.5708, 1.5708, -1.5708, -1.5708, 0], a=1.4, v=1.05, r=0)
  start = get_actual_tcp_pose()
  i = 0
  while i < 3:
    movel(pose_trans(start, p[0.02 * i, 0, 0.05, 0, 0, 0]), accel_mss(), speed_ms, 0, 0.005)
    i = i + 1
  end
  set_digital_out(2, True)
  movec(pose_add(start, p[0, .01, -.05, 0, 0, 0]), pose_add(start, p[0, 0.1, 0, 0, 0, 0]), v=0.02)
  set_tool_digital_out(1, False)
end
"""
PROGRAM = PROGRAM.replace('accel_mss()', '1.2')


def imported(tmp_path, text):
    file = tmp_path / 'weld.script'
    file.write_text(text)
    return import_file(file)


def test_moves_outputs_and_what_is_left_out(tmp_path):
    found = imported(tmp_path, PROGRAM)
    kinds = found.goal.segments.types.tolist()
    assert kinds == [SegmentType.JOINT, *[SegmentType.LINEAR] * 3, SegmentType.CIRCULAR]
    assert found.lines.tolist() == [5, 9, 9, 9, 13]
    x = np.array(found.goal.waypoints.poses)[:, :3]
    assert np.linalg.norm(np.diff(x[1:4], axis=0), axis=1) == pytest.approx([0.02, 0.02])
    assert np.linalg.norm(x[1] - x[0]) == pytest.approx(0.05)
    assert found.goal.segments.velocities.tolist() == [1.05, 0.05, 0.05, 0.05, 0.02]
    assert found.goal.segments.blend_radii.tolist()[1:3] == [0.005, 0.005]
    assert found.goal.waypoints.postures[0].values == pytest.approx(
        (0.0, -1.5708, 1.5708, -1.5708, -1.5708, 0.0)
    )
    assert [(c.waypoint, c.output, c.pin, c.value) for c in found.goal.io_commands] == [
        (3, OutputKind.STANDARD_DIGITAL, 2, 1.0),
        (4, OutputKind.TOOL_DIGITAL, 1, 0.0),
    ]
    said = [remark.text() for remark in found.remarks]
    assert 'line 4: popup(): a goal has only moves and outputs' in said
    assert any(
        text.startswith('line 3: set_tcp(): set the active TCP to p[0, 0, 0.1') for text in said
    )


def test_statements_without_a_function_around(tmp_path):
    q = f'[0, {-pi / 2}, {pi / 2}, {-pi / 2}, {-pi / 2}, 0]'
    found = imported(tmp_path, f'movej({q})\nmovej({q[:-2]}1], t=2)\n')
    assert found.lines.tolist() == [1, 2]
    assert found.goal.segments.velocities.tolist() == pytest.approx([pi / 3, 0.5])
    assert any('t = 2 s is taken as the mean speed' in r.why for r in found.remarks)


@pytest.mark.parametrize(
    ('text', 'line', 'part'),
    [
        ('def a(:\n', 1, 'no URScript'),
        ('movej([1, 2])\n', 1, '6 numbers'),
        ('def a():\n  x = 1\n  fly(x)\nend\n', 3, 'fly'),
        ('def a():\n  movel(p[9, 0, 0, 0, 0, 0])\nend\n', 2, 'cannot reach'),
        ('def a():\n  x = 1\nend\n', 0, 'no point'),
        ('movej([0, 1.2.3, 1, 0, 0, 0])\n', 1, 'two decimal points'),
        ('x = 1\nmovel(p[400, 0, 200, 0, 0, 0])\n', 2, '0.4 is 400 mm'),
        ('movej([0, -90, 90, 0, 0, 0])\n', 1, 'radians'),
        ('x = 1\nwhile x:\n  x = 2\n', 4, "'while' of line 2 has no 'end'"),
        ('def a():\n  if True:\n    x = 2\nend\n', 5, "'if' of line 2 has no 'end'"),
    ],
)
def test_a_broken_file_is_one_sentence_with_its_line(tmp_path, text, line, part):
    with pytest.raises(BrokenFile, match=part) as caught:
        imported(tmp_path, text)
    assert caught.value.line == line
    assert '\n' not in str(caught.value)


def test_an_endless_program_is_refused(tmp_path, monkeypatch):
    monkeypatch.setattr('ur_cartesian_driver.importing.urscript_file.MAX_CYCLES', 50)
    q = '[0, -1.5, 1.5, -1.5, -1.5, 0]'
    with pytest.raises(BrokenFile, match='endless loop') as caught:
        imported(tmp_path, f'def a():\n  x = 1\n  while x:\n    movej({q})\n  end\nend\n')
    assert caught.value.line == 4


def test_the_loop_around_a_saved_program_runs_once(tmp_path):
    """PolyScope writes it around the program, and threads with loops of their own before it."""
    found = imported(
        tmp_path,
        """def saved():
  set_input_actions_to_default()
  thread Counter():
    while (True):
      sync()
    end
  end
  run Counter()
  while (True):
    $ 1 "Robot Program"
    movej([0, -1.5, 1.5, -1.5, -1.5, 0])
    n = 0
    while n < 9:
      n = n + 1
      if n == 2:
        break
      end
    end
    movel(pose_add(get_actual_tcp_pose(), p[0, 0, 0.01 * n, 0, 0, 0]))
  end
end
""",
    )
    assert found.lines.tolist() == [11, 19]
    said = [remark.text() for remark in found.remarks]
    assert 'line 9: while: only the first round of this endless loop is taken' in said


def test_a_loop_that_a_program_leaves_runs_to_its_end(tmp_path):
    q = '[0.1 * n, -1.5, 1.5, -1.5, -1.5, 0]'
    text = 'def a():\n  n = 0\n  while True:\n    movej({})\n    n = n + 1\n    {}\n  end\nend\n'
    for leave in ('if n == 3: break end', 'if n == 3: halt end', 'if n == 3: return None end'):
        found = imported(tmp_path, text.format(q, leave))
        assert found.lines.tolist() == [4, 4, 4]


@pytest.mark.parametrize(
    'waits',
    [
        'stopj(2)',
        'stopl(5.0)',
        'speedl([0.1, 0, 0, 0, 0, 0], 0.5, t=0.2)',
        'popup("Ready?", blocking=True)',
        'pause',
    ],
)
def test_nothing_waits_for_the_arm_or_for_a_person(tmp_path, waits):
    q = '[0, -1.5, 1.5, -1.5, -1.5, 0]'
    assert len(imported(tmp_path, f'movej({q})\n{waits}\nmovej({q[:-2]}1])\n').lines) == 2
