# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
URScript, the language of the robot's programs, and nothing of the robot.

Text to tokens (`scanner`), to a tree (`syntax`, `parser`), to checked names (`scopes`), to Python
closures (`closures`, `expressions`, `compiler`), to threads that run frame by frame
(`interpreter`) and compute with `values`. What a program can do to
a robot are builtins, given by whoever runs it; `builtins` holds those that need no robot.
"""

from ur_cartesian_driver.urscript.compiling.scopes import Builtin
from ur_cartesian_driver.urscript.core_builtins import core_builtins
from ur_cartesian_driver.urscript.parsing.parser import parse
from ur_cartesian_driver.urscript.parsing.syntax_tree import ScriptProgram
from ur_cartesian_driver.urscript.running.line_compiler import CompiledLine
from ur_cartesian_driver.urscript.running.script_interpreter import ScriptInterpreter
from ur_cartesian_driver.urscript.script_errors import CompileError, RuntimeException
from ur_cartesian_driver.urscript.script_values import (
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
