# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Check the layout of a commit message; the commit-msg hook runs this on the file with the message.

The imperative and the reason in the body are left to the author::

    python scripts/check_commit_message.py .git/COMMIT_EDITMSG
"""

from __future__ import annotations

from pathlib import Path
import sys

MAX_SUBJECT_LENGTH = 72  # what `git log --oneline` shows on a line of 80 columns

#: Subjects that git writes.
GENERATED = ('fixup! ', 'squash! ', 'amend! ', 'Merge ', 'Revert "')
SCISSORS = '# ------------------------ >8 ------------------------'


def message_lines(text: str) -> list[str]:
    """Return the lines that git keeps: no comments, nothing below the scissors."""
    kept, _, _ = text.partition(SCISSORS)
    lines = [line.rstrip() for line in kept.splitlines() if not line.startswith('#')]
    while lines and not lines[0]:
        del lines[0]
    return lines


def problems(text: str) -> list[str]:
    """Return the errors of a commit message, one sentence each."""
    lines = message_lines(text)
    if not lines:
        return []  # git refuses an empty message itself
    subject, *body = lines
    if subject.startswith(GENERATED):
        return []
    found = []
    if len(subject) > MAX_SUBJECT_LENGTH:
        found.append(
            f'The subject has {len(subject)} columns; shorten it to {MAX_SUBJECT_LENGTH}, '
            'and move the rest into the body.'
        )
    if subject.endswith('.'):
        found.append('The subject ends with a full stop; remove it.')
    if body and body[0]:
        found.append('The second line is not blank; leave a blank line between subject and body.')
    return found


def main() -> None:
    """Check the file that is named on the command line; exit with 1 if something is wrong."""
    (path,) = sys.argv[1:]
    if found := problems(Path(path).read_text(encoding='utf-8')):
        sys.exit('\n'.join(['Commit message:', *(f'  {problem}' for problem in found)]))


if __name__ == '__main__':
    main()
