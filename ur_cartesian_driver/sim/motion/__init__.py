# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The motion generator of the simulated controller: from motion calls to one target per cycle.

It is deterministic and has no clock and no sockets. :class:`MotionGenerator` takes the calls.
Profiles are functions of time, paths are functions of a parameter, servo laws integrate speeds.
"""

from ur_cartesian_driver.sim.motion.motion_generator import MotionGenerator
from ur_cartesian_driver.sim.motion.motion_values import (
    MotionError,
    MotionFault,
    MotionWarning,
    Move,
)

__all__ = ['MotionError', 'MotionFault', 'MotionGenerator', 'MotionWarning', 'Move']
