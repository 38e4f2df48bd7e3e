# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""What to do next: pure state machines, fed with events and the time, answering with commands."""

from ur_cartesian_driver.execution.commands import (
    Command,
    Finish,
    LendTcp,
    Report,
    ReturnTcp,
    SendControl,
    SendPoints,
    StopProgram,
)
from ur_cartesian_driver.execution.tcp_loan import same_tcp, TcpLoan
from ur_cartesian_driver.execution.trajectory import Order, TrajectoryMachine

__all__ = [
    'Command',
    'Finish',
    'LendTcp',
    'Order',
    'Report',
    'ReturnTcp',
    'SendControl',
    'SendPoints',
    'StopProgram',
    'TcpLoan',
    'TrajectoryMachine',
    'same_tcp',
]
