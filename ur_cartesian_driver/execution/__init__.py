# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""What to do next: pure state machines, fed with events and the time, answering with commands."""

from ur_cartesian_driver.execution.commands import (
    AnswerExtension,
    Command,
    Finish,
    LendTcp,
    Report,
    ReturnTcp,
    SendControl,
    SendPoints,
    StopProgram,
)
from ur_cartesian_driver.execution.order import Extension, Order, order_of
from ur_cartesian_driver.execution.stream import StreamMachine, StreamSettings
from ur_cartesian_driver.execution.tcp_loan import same_tcp, TcpLoan
from ur_cartesian_driver.execution.trajectory import TrajectoryMachine

__all__ = [
    'AnswerExtension',
    'Command',
    'Extension',
    'Finish',
    'LendTcp',
    'Order',
    'Report',
    'ReturnTcp',
    'SendControl',
    'SendPoints',
    'StopProgram',
    'StreamMachine',
    'StreamSettings',
    'TcpLoan',
    'TrajectoryMachine',
    'order_of',
    'same_tcp',
]
