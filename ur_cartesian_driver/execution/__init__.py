# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""What to do next: pure state machines, fed with events and the time, answering with commands."""

from ur_cartesian_driver.execution.goal.append_feeder import AppendFeeder, AppendSettings
from ur_cartesian_driver.execution.goal.feeder import Feeder
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
from ur_cartesian_driver.execution.goal.monitor import GoalMonitor
from ur_cartesian_driver.execution.goal.motion_job import AppendJob, job_from_plan, MotionJob
from ur_cartesian_driver.execution.goal.point_feeder import PointFeeder
from ur_cartesian_driver.execution.goal.temporary_tcp import same_tcp, TemporaryTcp
from ur_cartesian_driver.execution.servo.servo_feeder import SERVO_LINK, ServoFeeder
from ur_cartesian_driver.execution.servo.servo_stream import ServoSettings, ServoStream
from ur_cartesian_driver.execution.servo.setpoint_source import SetpointSource, SplineSetpoints

__all__ = [
    'SERVO_LINK',
    'AnswerAppend',
    'AppendFeeder',
    'AppendJob',
    'AppendSettings',
    'EnterServo',
    'Feeder',
    'Finish',
    'GoalCommand',
    'GoalMachine',
    'GoalMonitor',
    'LeaveServo',
    'LogWarning',
    'MotionJob',
    'OpenServo',
    'PointFeeder',
    'ReportProgress',
    'ReportServo',
    'RestoreTcp',
    'SendControl',
    'SendPoints',
    'ServoFeeder',
    'ServoSettings',
    'ServoStream',
    'SetTemporaryTcp',
    'SetpointSource',
    'SplineSetpoints',
    'StopProgram',
    'TemporaryTcp',
    'WriteServo',
    'job_from_plan',
    'same_tcp',
]
