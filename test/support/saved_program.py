# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Robot programs of all wire dialects, made from one text in test/program/dialects/."""

from pathlib import Path

TEXT = Path(__file__).parents[1] / 'program' / 'dialects' / 'saved_program.script'
DIALECTS = ('2.0', '2.10', '2.12', '2.14')


def saved_program(dialect, host):
    """Return the program of a dialect, as a definition to load and play."""
    lines, keep = [], True
    for line in TEXT.read_text('ascii').replace('@HOST@', host).splitlines():
        match line.split():
            case ['#!', ('since' | 'before') as word, other]:
                keep = (DIALECTS.index(dialect) >= DIALECTS.index(other)) == (word == 'since')
            case ['#!', 'end']:
                keep = True
            case _ if keep:
                lines.append(f'  {line}')
    return '\n'.join(['def saved_program():', *lines, 'end', ''])
