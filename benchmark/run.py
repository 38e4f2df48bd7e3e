# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Run the benchmarks and print a table; README.md explains the figures.

::

    make bench
    .venv/bin/python benchmark/run.py --only keepalive --json figures.json
    .venv/bin/python benchmark/run.py --only rtde_rate --seconds 600
"""

from __future__ import annotations

import argparse
from importlib import import_module
import os
from pathlib import Path
import signal
import sys
import time

from figures import as_json, Figure, machine, table

#: Benchmarks whose size is an option; soak and append only run if --only names them.
RTDE_RATE, SOAK, APPEND = 'rtde_rate', 'soak', 'append'
#: In the order of the table: benchmarks with many processes come first.
MODULES = (
    'goal_on_wire',
    'violation_to_cancel',
    'keepalive',
    'points',
    'load',
    'servo',
    'replaced_tails',
    RTDE_RATE,
    'planning',
    'cell',
    'travels',
    'rounded_corners',
    'sliced',
    'outputs',
    'free_axis',
    'import_files',
    'motion_page',
    'kinematics',
    'kinematics_rows',
    'codecs_rtde',
    'urscript_frames',
)


def main() -> int:
    """Run the benchmarks; return 1 if one of them failed to run."""
    arguments = _parser().parse_args()
    _keep_to_ourselves()
    # SIGTERM has to end the child processes too, like Ctrl-C.
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    begin = time.monotonic()
    print(', '.join(f'{name} {value}' for name, value in machine().items()), flush=True)
    figures: list[Figure] = []
    failed = False
    for name in arguments.only or MODULES:
        try:
            options = {'seconds': arguments.seconds} if name in (RTDE_RATE, SOAK) else {}
            if name == SOAK:
                options |= {'goals': arguments.goals, 'undisturbed': arguments.undisturbed}
            if name == APPEND:
                options = {'points': arguments.points}
            measured = list(import_module(name).run(arguments.quick, **options))
        except Exception as error:
            # The others can still be measured.
            print(f'\n{name}: not measured: {error!r}', file=sys.stderr, flush=True)
            failed = True
            continue
        print(table(measured), flush=True)
        figures += measured
    print(f'\n{len(figures)} figures in {time.monotonic() - begin:.0f} s')
    if arguments.json == '-':
        print(as_json(figures))
    elif arguments.json:
        Path(arguments.json).write_text(as_json(figures) + '\n', encoding='utf-8')
    return int(failed)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(description='Measure the driver and the simulated robot.')
    parser.add_argument(
        '--only',
        action='append',
        choices=(*MODULES, SOAK, APPEND),
        metavar='NAME',
        help=f'only this one (may be repeated): {", ".join((*MODULES, SOAK, APPEND))}',
    )
    parser.add_argument(
        '--quick', action='store_true', help='smaller goals, shorter times: to see that it runs'
    )
    parser.add_argument(
        '--seconds',
        type=float,
        default=30.0,
        help=f'how long {RTDE_RATE} measures (600 for the record), and {SOAK} lasts (1800)',
    )
    parser.add_argument(
        '--goals', type=int, default=10_000, help=f'after so many goals {SOAK} ends sooner'
    )
    parser.add_argument(
        '--points',
        type=int,
        default=50_000,
        help=f'how many points {APPEND} has (1000000 for the record)',
    )
    parser.add_argument(
        '--undisturbed',
        action='store_true',
        help=f'nothing happens during the goals of {SOAK}: as many as can be',
    )
    parser.add_argument('--json', metavar='FILE', help='write the figures as JSON, - = print them')
    return parser


def _keep_to_ourselves() -> None:
    """Isolate the run from other ROS programs on this computer and network."""
    os.environ.setdefault('ROS_AUTOMATIC_DISCOVERY_RANGE', 'LOCALHOST')
    os.environ.setdefault('ROS_DOMAIN_ID', str(1 + os.getpid() % 100))


if __name__ == '__main__':
    sys.exit(main())
