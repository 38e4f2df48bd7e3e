# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Draw the state machines of the driver from the tables that run them, into doc/diagrams/.

A diagram that is drawn by hand is wrong after the next change. A test compares the files with the
tables; this script brings them up to date::

    python scripts/make_diagrams.py
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from enum import Enum
from pathlib import Path
from typing import TypeAlias

import ur_cartesian_driver.execution.goal.goal_transitions as states
from ur_cartesian_driver.execution.goal.outcome_codes import GoalSignal
import ur_cartesian_driver.execution.servo.servo_stream as servo_stream
from ur_cartesian_driver.robot import lifecycle

DIAGRAMS = Path(__file__).resolve().parents[1] / 'doc' / 'diagrams'

#: Transitions by state and event: the next state, and a remark.
Table: TypeAlias = Mapping[str, Mapping[str, tuple[str, str]]]


def pages() -> dict[str, str]:
    """Return the text of each file of doc/diagrams/ by its name."""
    return {
        'connection.md': page(
            'The connection to the robot',
            'ur_cartesian_driver/robot/lifecycle.py',
            connection(),
            [change.name for change in lifecycle.ConnectionEvent],
        ),
        'trajectory.md': page(
            'A goal on its way through the robot program',
            'ur_cartesian_driver/execution/goal/goal_transitions.py',
            goal(),
            [signal.name for signal in GoalSignal],
        ),
        'servo.md': page(
            'Streaming of set-points',
            'ur_cartesian_driver/execution/servo/servo_stream.py',
            servo(),
            [change.name for change in servo_stream.ServoEvent],
        ),
    }


def connection() -> Table:
    """Return the table of the connection."""
    return {
        state.name: {change.name: (then.name, '') for change, then in row.items()}
        for state, row in lifecycle.TRANSITIONS.items()
    }


def goal() -> Table:
    """Return the table of a goal; the remark is the error code that the transition sets."""
    return {
        state.name: {
            signal.name: (step.state.name, _name(step.code)) for signal, step in row.items()
        }
        for state, row in states.TRANSITIONS.items()
    }


def servo() -> Table:
    """Return the table of the streaming of set-points."""
    return {
        phase.name: {change.name: (then.name, '') for change, then in row.items()}
        for phase, row in servo_stream.TRANSITIONS.items()
    }


def page(title: str, source: str, table: Table, events: Sequence[str]) -> str:
    """Return a page with the diagram, and with the table, which also has events without change."""
    return (
        f'# {title}\n\n'
        f'Made by `scripts/make_diagrams.py` from `TRANSITIONS` of\n'
        f'[{source}](../../{source}), where the states are described. Do not edit.\n\n'
        f'```mermaid\n{diagram(table)}```\n\n{rows(table, events)}'
    )


def diagram(table: Table) -> str:
    """Return the changes of state as a Mermaid diagram, one arrow for each pair of states."""
    lines = ['stateDiagram-v2', f'    [*] --> {next(iter(table))}']
    for state, row in table.items():
        arrows: dict[str, list[str]] = {}
        for event, (then, _) in row.items():
            if then != state:
                arrows.setdefault(then, []).append(event)
        lines += [f'    {state} --> {then}: {", ".join(names)}' for then, names in arrows.items()]
        if not row:
            lines.append(f'    {state} --> [*]')
    return '\n'.join(lines) + '\n'


def rows(table: Table, events: Sequence[str]) -> str:
    """Return the table in Markdown: a row for each event, a column for each state."""
    lines = [_row('', *table), _row(*['---'] * (1 + len(table)))]
    lines += [
        _row(event, *(_cell(state, row.get(event)) for state, row in table.items()))
        for event in events
    ]
    return '\n'.join(lines) + '\n'


def _cell(state: str, step: tuple[str, str] | None) -> str:
    if step is None:
        return ''
    then, remark = step
    return ('stays' if then == state else then) + (f' ({remark})' if remark else '')


def _row(*cells: str) -> str:
    return '| ' + ' | '.join(cells) + ' |'


def _name(member: Enum | None) -> str:
    return '' if member is None else member.name


def main(directory: Path = DIAGRAMS) -> None:
    """Write all pages."""
    directory.mkdir(parents=True, exist_ok=True)
    for name, text in pages().items():
        (directory / name).write_text(text, encoding='utf-8')


if __name__ == '__main__':
    main()
