# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The motion generator of the simulated controller: from motion calls to one target per cycle.

Deterministic, without clock and sockets. :class:`MotionGenerator` takes the calls; profiles are
functions of time, geometry is a function of a path parameter, and servo laws integrate speeds.
"""

from ur_cartesian_driver.sim.motion.motion_generator import MotionGenerator
from ur_cartesian_driver.sim.motion.motion_values import (
    MotionError,
    MotionFault,
    MotionWarning,
    Move,
)

__all__ = ['MotionError', 'MotionFault', 'MotionGenerator', 'MotionWarning', 'Move']
