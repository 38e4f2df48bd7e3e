# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Write doc/faults.md from the table of the fault matrix tests.

The table is the source, so that the page states exactly what the tests check. A test compares page
and table; after a change of the table, run::

    python scripts/make_faults.py
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
import sys
from typing import TYPE_CHECKING

CHECKOUT = Path(__file__).resolve().parents[1]
PAGE = CHECKOUT / 'doc' / 'faults.md'

if TYPE_CHECKING:
    from fault_modes import Mode
    from fault_table import Row

HEAD = """# Faults, and how goals end

Made by `scripts/make_faults.py` from the table that `test/faults` runs against the simulated
controller: every fault in every phase of a goal. Do not edit.

Whatever happens, the goal ends with its [code and sentence](errors.md), the arm comes to rest, and
an interrupted motion never resumes by itself, even if an operator unlocks the robot or plays the
program. Then `~/status` says which steps are needed; after the steps in the last column the robot
takes the next goal. Each goal has a `safe_outputs` entry with `restore`: its output is off at the
end unless the goal succeeds, and off in a pause. The result of a goal that the arm had begun says
where on its path it was stopped, and the goal can be
[resumed](execution.md#resume-it) there. What is decided before the motion (a free
axis, a demanded speed) changes nothing of this.

Times count from the fault, or from the goal if it is sent later. "As without fault": the fault
does not affect the goal. The times hold for the default parameters, except `node_timeout` (0.4 s
instead of 5 s), and for goals with a `goal_time_tolerance` of 1.4 s and a `path_tolerance` of
4 mm. The sockets of the robot program are named after the parameters of their ports. "Half-open":
the connection looks open, but carries no data.

"""

HEADLESS_HEAD = """## Headless operation

The driver sends the robot program, and stops the program when the robot stops. So no joint moves
between the fault and the next goal, even if another client unlocks the arm and plays the program.

"""

LOCAL_HEAD = """## Local control

The program is on the pendant, and the robot takes no commands from the network. A paused program
that is played resumes for a few cycles, until it reads the message that ends it. In these cycles
no joint moves more than {travel:g} rad (simulated joints do not move at all, real ones start
slowly). Then the program has to be played again.

"""

CONTINUED_HEAD = """## With `on_robot_stop: continue`

A protective or safeguard stop then pauses the goal. All other faults end as above.

"""

MODES_HEAD = """## The other execution modes

The tables above are for goals with execution PRIMITIVES. The tables below are for the other
execution modes, with faults while a goal moves, waits or ends. Faults before the motion, and
faults of interfaces that no goal uses, do not depend on the execution mode; see above. Where
phases stand in brackets after a fault, only these are tested.

"""

TITLES = (
    'fault',
    'the goal ends',
    'result within',
    'arm at rest within',
    'driver state',
    'recovery',
)


def page() -> str:
    """Return the text of doc/faults.md."""
    from fault_modes import MODES
    from fault_table import CONTINUED, HEADLESS, LOCAL, PHASES

    travel = max(row.at(phase).travel for row in LOCAL for phase in PHASES)
    return ''.join(
        (
            HEAD,
            '## Phases\n\n',
            _table(('phase', 'when'), PHASES.items()),
            '\n',
            HEADLESS_HEAD,
            _faults(HEADLESS, PHASES),
            '\n',
            LOCAL_HEAD.format(travel=travel),
            _faults(LOCAL, PHASES),
            '\n',
            CONTINUED_HEAD,
            _faults(CONTINUED, PHASES),
            '\n',
            MODES_HEAD,
            '\n'.join(map(_mode, MODES)),
        )
    )


def _mode(mode: Mode) -> str:
    """Return the section of an execution mode."""
    return ''.join(
        (
            f'### {mode.name}\n\n{mode.about}\n\n',
            _table(('phase', 'when'), mode.phases.items()),
            '\n',
            _faults(mode.headless, mode.phases),
            '\nIn local control:\n\n',
            _faults(mode.local, mode.phases),
            *(
                ('\nWith `on_robot_stop: continue`:\n\n', _faults(mode.continued, mode.phases))
                if mode.continued
                else ()
            ),
        )
    )


def _faults(rows: Iterable[Row], phases: Iterable[str]) -> str:
    return _table(TITLES, (_cells(row, row.phases or tuple(phases)) for row in rows))


def _cells(row: Row, phases: Sequence[str]) -> Sequence[str]:
    def tell(what: Callable[[Row], str]) -> str:
        return _by_phase(row, phases, what)

    where = f' ({", ".join(row.phases)})' if row.phases else ''
    return (
        row.fault + where,
        tell(lambda at: ('pauses, then ' if at.waits else '') + at.code.name),
        tell(lambda at: f'{at.result_within:g} s' if _disturbs(at) else 'as without fault'),
        tell(
            lambda at: f'{at.rest_within:g} s' if _disturbs(at) or at.waits else 'as without fault'
        ),
        tell(lambda at: at.state_after.name),
        tell(lambda at: ', '.join(_needed(at.steps)) or 'nothing'),
    )


def _disturbs(row: Row) -> bool:
    return row.code.name != 'SUCCESSFUL'


def _needed(steps: Sequence[str]) -> list[str]:
    """Return the steps, without a play that has no effect because a resend follows."""
    return [step for i, step in enumerate(steps) if tuple(steps[i : i + 2]) != ('play', 'resend')]


def _by_phase(row: Row, phases: Sequence[str], tell: Callable[[Row], str]) -> str:
    """Return the usual text of a row, and the phases whose text differs."""
    usual = tell(row)
    phases_of: dict[str, list[str]] = {}
    for phase in phases:
        phases_of.setdefault(tell(row.at(phase)), []).append(phase)
    if usual not in phases_of:  # no listed phase has the usual text
        usual = next(iter(phases_of))
    phases_of.pop(usual)
    return '<br>'.join(
        [usual, *(f'{", ".join(phases)}: {text}' for text, phases in phases_of.items())]
    )


def _table(titles: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    lines = (titles, ['---'] * len(titles), *rows)
    return ''.join('| ' + ' | '.join(cells) + ' |\n' for cells in lines)


if __name__ == '__main__':
    sys.path[:0] = [str(CHECKOUT), str(CHECKOUT / 'test' / 'support')]
    PAGE.write_text(page(), encoding='utf-8')
