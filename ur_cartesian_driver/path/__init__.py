# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Compose a path of the tool in a few lines, with or without ROS.

::

    from ur_cartesian_driver.path import DOWN, mm, Path

    square = Path(mm(-492, -133, 488), DOWN).at(speed=0.1, blend=mm(10)).by(dy=0.2).by(dx=0.2)
    driver.execute(square).raise_for_error()
"""

from ur_cartesian_driver.motion.events import PathPlace
from ur_cartesian_driver.motion.geometry.pose import Pose
from ur_cartesian_driver.motion.goal.execution_modes import ExecutionMode
from ur_cartesian_driver.motion.goal.goal import ContactEnd, PressFrame, StaleOffset, Tolerance
from ur_cartesian_driver.motion.goal.known_frames import Frames, StaticFrame
from ur_cartesian_driver.motion.state.io_signals import AnalogDomain
from ur_cartesian_driver.path.joining import join
from ur_cartesian_driver.path.orientations import (
    against,
    axis_angle,
    DOWN,
    roll_pitch_yaw,
    tilted,
    X,
    Y,
    Z,
)
from ur_cartesian_driver.path.outputs import (
    analog,
    analog_input,
    configurable,
    configurable_input,
    digital,
    digital_input,
    Input,
    Output,
    tool_analog_input,
    tool_digital,
    tool_digital_input,
)
from ur_cartesian_driver.path.path_builder import Path
from ur_cartesian_driver.path.path_motions import FREE
from ur_cartesian_driver.path.resumption import resume, ResumedGoal
from ur_cartesian_driver.path.travels.traveller import AirTravel
from ur_cartesian_driver.path.units import deg, mm

__all__ = [
    'DOWN',
    'FREE',
    'AirTravel',
    'AnalogDomain',
    'ContactEnd',
    'ExecutionMode',
    'Frames',
    'Input',
    'Output',
    'Path',
    'PathPlace',
    'Pose',
    'PressFrame',
    'ResumedGoal',
    'StaleOffset',
    'StaticFrame',
    'Tolerance',
    'X',
    'Y',
    'Z',
    'against',
    'analog',
    'analog_input',
    'axis_angle',
    'configurable',
    'configurable_input',
    'deg',
    'digital',
    'digital_input',
    'join',
    'mm',
    'resume',
    'roll_pitch_yaw',
    'tilted',
    'tool_analog_input',
    'tool_digital',
    'tool_digital_input',
]
