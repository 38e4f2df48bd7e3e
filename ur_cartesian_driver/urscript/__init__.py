# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
URScript, the language of the robot's programs, and nothing of the robot.

Text to tokens (`scanner`), to a tree (`syntax`, `parser`), to checked names (`scopes`), to Python
closures (`closures`, `expressions`, `compiler`), to threads that run frame by frame
(`interpreter`) and compute with `values`. What a program can do to
a robot are builtins, given by whoever runs it; `builtins` holds those that need no robot.
"""

from ur_cartesian_driver.urscript.builtins import core_builtins
from ur_cartesian_driver.urscript.errors import CompileError, RuntimeException
from ur_cartesian_driver.urscript.interpreter import Machine
from ur_cartesian_driver.urscript.lines import Line
from ur_cartesian_driver.urscript.parser import parse
from ur_cartesian_driver.urscript.scopes import Builtin
from ur_cartesian_driver.urscript.syntax import Program
from ur_cartesian_driver.urscript.values import (
    Matrix,
    Pose,
    RemoteObject,
    Struct,
    ThreadHandle,
    to_text,
    Value,
)

__all__ = [
    'Builtin',
    'CompileError',
    'Line',
    'Machine',
    'Matrix',
    'Pose',
    'Program',
    'RemoteObject',
    'RuntimeException',
    'Struct',
    'ThreadHandle',
    'Value',
    'core_builtins',
    'parse',
    'to_text',
]
