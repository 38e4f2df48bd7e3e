# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The examples in the documents: commands with their output, and files for readers to save."""

from itertools import takewhile
from pathlib import Path
import re
import shlex

#: A block that a paragraph like "Save it as `first.py`:" introduces.
_SAVED = re.compile(
    r'[Ss]ave (?:it|this)\s(?:there\s)?as `([\w.]+)`(?:(?!\n\n).)*?:\n\n```\w+\n(.*?)^```$',
    re.DOTALL | re.MULTILINE,
)


def saved_files(page: Path) -> dict[str, str]:
    """Return the files that a reader of a page saves: names and texts."""
    return dict(_SAVED.findall(page.read_text(encoding='utf-8')))


def save_files(page: Path, folder: Path) -> None:
    """Save the files of a page in a folder."""
    for name, text in saved_files(page).items():
        (folder / name).write_text(text, encoding='utf-8')


def console_examples(page: Path) -> list[tuple[list[list[str]], str]]:
    """Return the console blocks of a page: the words of their commands, and the output shown."""
    found = []
    for body in re.findall(
        r'^```console\n(.*?)^```$', page.read_text(encoding='utf-8'), re.DOTALL | re.MULTILINE
    ):
        lines = body.splitlines()
        commands = [
            shlex.split(line, comments=True)[1:]
            for line in takewhile(lambda line: line.startswith('$ '), lines)
        ]
        found.append((commands, '\n'.join(lines[len(commands) :])))
    return found


def assert_shows(shown: str, came: str) -> None:
    """Compare words; ``...`` in the document stands for any words."""
    parts = (re.escape(part.strip()) for part in ' '.join(shown.split()).split('...'))
    assert re.fullmatch(' ?.*? ?'.join(parts), ' '.join(came.split())), came
