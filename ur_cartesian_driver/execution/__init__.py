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
from ur_cartesian_driver.execution.order import Order, order_of
from ur_cartesian_driver.execution.tcp_loan import same_tcp, TcpLoan
from ur_cartesian_driver.execution.trajectory import TrajectoryMachine

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
    'order_of',
    'same_tcp',
]
