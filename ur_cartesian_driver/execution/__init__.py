# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""What to do next: pure state machines, fed with events and the time, answering with commands."""

from ur_cartesian_driver.execution.goal.append_machine import AppendMachine, AppendSettings
from ur_cartesian_driver.execution.goal.goal_commands import (
    AnswerAppend,
    EnterServo,
    Finish,
    GoalCommand,
    LeaveServo,
    LogWarning,
    OpenServo,
    ReportProgress,
    ReportServo,
    RestoreTcp,
    SendControl,
    SendPoints,
    SetTemporaryTcp,
    StopProgram,
    WriteServo,
)
from ur_cartesian_driver.execution.goal.goal_machine import GoalMachine
from ur_cartesian_driver.execution.goal.motion_job import AppendJob, job_from_plan, MotionJob
from ur_cartesian_driver.execution.goal.temporary_tcp import same_tcp, TemporaryTcp
from ur_cartesian_driver.execution.servo.servo_machine import SERVO_LINK, ServoMachine
from ur_cartesian_driver.execution.servo.servo_stream import ServoSettings
from ur_cartesian_driver.execution.servo.setpoint_source import SetpointSource

__all__ = [
    'SERVO_LINK',
    'AnswerAppend',
    'AppendJob',
    'AppendMachine',
    'AppendSettings',
    'EnterServo',
    'Finish',
    'GoalCommand',
    'GoalMachine',
    'LeaveServo',
    'LogWarning',
    'MotionJob',
    'OpenServo',
    'ReportProgress',
    'ReportServo',
    'RestoreTcp',
    'SendControl',
    'SendPoints',
    'ServoMachine',
    'ServoSettings',
    'SetTemporaryTcp',
    'SetpointSource',
    'StopProgram',
    'TemporaryTcp',
    'WriteServo',
    'job_from_plan',
    'same_tcp',
]
