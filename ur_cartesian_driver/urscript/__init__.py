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
from ur_cartesian_driver.urscript.interpreter import ScriptInterpreter
from ur_cartesian_driver.urscript.lines import CompiledLine
from ur_cartesian_driver.urscript.parser import parse
from ur_cartesian_driver.urscript.scopes import Builtin
from ur_cartesian_driver.urscript.syntax import ScriptProgram
from ur_cartesian_driver.urscript.values import (
    Matrix,
    RemoteObject,
    ScriptPose,
    Struct,
    ThreadHandle,
    to_text,
    Value,
)

__all__ = [
    'Builtin',
    'CompileError',
    'CompiledLine',
    'Matrix',
    'RemoteObject',
    'RuntimeException',
    'ScriptInterpreter',
    'ScriptPose',
    'ScriptProgram',
    'Struct',
    'ThreadHandle',
    'Value',
    'core_builtins',
    'parse',
    'to_text',
]
