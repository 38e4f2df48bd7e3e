# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""An output that is on along a stretch of a path, and safe when the goal is stopped."""

from ur_cartesian_driver.motion.goal.goal import IOCommand, OutputKind, SafeOutput

PIN = 2
SAFE_OUTPUTS = (SafeOutput(output=OutputKind.STANDARD_DIGITAL, pin=PIN, value=0.0, restore=True),)


def switch(waypoint: int, value: float) -> IOCommand:
    """Return the command that switches the output at a point."""
    return IOCommand(
        waypoint=waypoint,
        offset=0.0,
        output=OutputKind.STANDARD_DIGITAL,
        pin=PIN,
        value=value,
    )


def is_on(digital_outputs: int) -> bool:
    """Return whether the output is on, by the bits of RTDE."""
    return bool(digital_outputs & (1 << PIN))
