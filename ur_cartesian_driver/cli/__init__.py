# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The command ``ur-cartesian``.

Each command is a function from parsed arguments to the exit status. A DriverError, OSError or
ValueError that it raises is printed, and ends it with status 1. Only the commands that need ROS
import it, so ``sim`` and ``where`` run without ROS.
"""

from __future__ import annotations

from argparse import Namespace
from collections.abc import Sequence
import sys

from ur_cartesian_driver.cli.argument_types import check_outputs
from ur_cartesian_driver.cli.command_parser import parser
from ur_cartesian_driver.sim.command_line.console import run_command

__all__ = ['main', 'parser']


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command line and return the exit status; 0 means that the command succeeded."""
    arguments = parser().parse_args(sys.argv[1:] if argv is None else argv)

    def run(arguments: Namespace) -> int:
        check_outputs(arguments)
        return int(arguments.run(arguments))

    return run_command(f'ur-cartesian {arguments.command}', run, arguments)
