# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The simulated controller as a command: its options and its output.

With the driver, the simulator is the subcommand ``ur-cartesian sim``; installed alone, it is the
command ``ur-controller-sim``, which calls :func:`main`.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
import sys

from ur_cartesian_driver.sim.command_line.console import run_command
from ur_cartesian_driver.sim.command_line.simulator_options import add_simulator_options

NAME = 'ur-controller-sim'


def parser() -> argparse.ArgumentParser:
    """Return the parser of the command."""
    command = argparse.ArgumentParser(
        prog=NAME,
        description='Run a simulated UR controller on the ports of a real one.',
        formatter_class=argparse.ArgumentDefaultsHelpFormatter,
    )
    add_simulator_options(command)
    return command


def main(argv: Sequence[str] | None = None) -> int:
    """Run a simulated controller until it is interrupted; return the exit status."""
    from ur_cartesian_driver.sim.command_line.simulate import simulate  # slow, so not at the top

    arguments = parser().parse_args(sys.argv[1:] if argv is None else argv)
    return run_command(NAME, simulate, arguments)
