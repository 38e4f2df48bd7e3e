# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The robot program in URScript, and the code that renders it."""

from ur_cartesian_driver.program.render import (
    PROGRAM_NAME,
    ProgramSettings,
    render,
    wrap_in_program,
)

__all__ = ['PROGRAM_NAME', 'ProgramSettings', 'render', 'wrap_in_program']
