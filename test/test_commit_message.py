# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The commit-msg hook enforces the layout of CONTRIBUTING."""

import runpy
import sys

from checkout import CHECKOUT, needs_checkout
import pytest

SCRIPT = CHECKOUT / 'scripts' / 'check_commit_message.py'
pytestmark = needs_checkout

SUBJECT = 'Bound the blend radius by the shorter segment'
LONG = 'Bound '.ljust(73, 'x')


def complaint(message, tmp_path, monkeypatch):
    """Run the hook on a message; return its refusal, or None."""
    file = tmp_path / 'COMMIT_EDITMSG'
    file.write_text(message, encoding='utf-8')
    monkeypatch.setattr(sys, 'argv', [str(SCRIPT), str(file)])
    try:
        runpy.run_path(str(SCRIPT), run_name='__main__')
    except SystemExit as refusal:
        return refusal.code
    return None


@pytest.mark.parametrize(
    'message',
    [
        f'{SUBJECT}\n',
        f'{SUBJECT}\n\nA longer one would overlap the next blend.\n',
        f'{SUBJECT}\n\nA longer one would overlap.\n\nSecond paragraph.\n',
        f'\n\n{SUBJECT}\n',
        f'{LONG[:72]}\n',
        f'{"Überschleifen: ".ljust(72, "ß")}\n',
        f'{SUBJECT}\n# Please enter the commit message for your changes.\n',
        f'# A comment above.\n{SUBJECT}\n',
        f'{SUBJECT}\n# ------------------------ >8 ------------------------\ndiff --git a b\n',
        f'fixup! {LONG}\n',
        f'Merge {LONG}\n',
        f'Revert "{LONG}"\n\nThis reverts commit 0123456.\n',
        '# nothing but comments\n',
        '',
    ],
)
def test_a_good_message_passes(message, tmp_path, monkeypatch):
    assert complaint(message, tmp_path, monkeypatch) is None


@pytest.mark.parametrize(
    ('message', 'part'),
    [
        (f'{LONG}\n', 'The subject has 73 columns'),
        (f'{SUBJECT}.\n', 'ends with a full stop'),
        (f'{SUBJECT}\nA longer one would overlap.\n', 'second line is not blank'),
    ],
)
def test_a_message_with_a_wrong_layout_is_refused(message, part, tmp_path, monkeypatch):
    assert part in complaint(message, tmp_path, monkeypatch)


def test_all_that_is_wrong_is_named_at_once(tmp_path, monkeypatch):
    assert complaint(f'{LONG}.\nand more\n', tmp_path, monkeypatch).count('\n') == 3
