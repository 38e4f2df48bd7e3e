# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""What to do next: pure state machines, fed with events and the time, answering with commands."""

from ur_cartesian_driver.execution.commands import (
    AnswerExtension,
    Command,
    EnterServo,
    Finish,
    LeaveServo,
    LendTcp,
    OpenServo,
    Remark,
    Report,
    ReportServo,
    ReturnTcp,
    SendControl,
    SendPoints,
    StopProgram,
    WriteServo,
)
from ur_cartesian_driver.execution.order import Extension, Order, order_of
from ur_cartesian_driver.execution.servo import SERVO_LINK, ServoMachine
from ur_cartesian_driver.execution.servo_source import Setpoints
from ur_cartesian_driver.execution.servo_stream import ServoSettings
from ur_cartesian_driver.execution.stream import StreamMachine, StreamSettings
from ur_cartesian_driver.execution.tcp_loan import same_tcp, TcpLoan
from ur_cartesian_driver.execution.trajectory import TrajectoryMachine

__all__ = [
    'SERVO_LINK',
    'AnswerExtension',
    'Command',
    'EnterServo',
    'Extension',
    'Finish',
    'LeaveServo',
    'LendTcp',
    'OpenServo',
    'Order',
    'Remark',
    'Report',
    'ReportServo',
    'ReturnTcp',
    'SendControl',
    'SendPoints',
    'ServoMachine',
    'ServoSettings',
    'Setpoints',
    'StopProgram',
    'StreamMachine',
    'StreamSettings',
    'TcpLoan',
    'TrajectoryMachine',
    'WriteServo',
    'order_of',
    'same_tcp',
]
