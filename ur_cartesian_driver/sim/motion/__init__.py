# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The motion generator of the simulated controller turns motion calls into one target per cycle.

It is deterministic and has no clock and no sockets. :class:`MotionGenerator` accepts the calls.
Profiles are functions of time, paths are functions of a path parameter, and servo-like motions
integrate speeds.
"""

from ur_cartesian_driver.sim.motion.motion_generator import MotionGenerator
from ur_cartesian_driver.sim.motion.motion_values import (
    MotionError,
    MotionFault,
    MotionWarning,
    Move,
)

__all__ = ['MotionError', 'MotionFault', 'MotionGenerator', 'MotionWarning', 'Move']
