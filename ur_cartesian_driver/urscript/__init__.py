# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
URScript, the language of the robot's programs, without a robot.

`parsing` turns text into tokens and a syntax tree, `compiling` resolves the names and turns the
tree into Python code, and `running` runs this code in threads, one controller cycle at a time, on
the values of `script_values`. Builtins give a program access to a robot; the code that makes a
:class:`ScriptInterpreter` provides them. `core_builtins` contains the builtins that need no robot.
"""

from ur_cartesian_driver.urscript.compiling.scopes import Builtin
from ur_cartesian_driver.urscript.core_builtins import core_builtins
from ur_cartesian_driver.urscript.parsing.parser import parse, parse_line
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
    'parse_line',
    'to_text',
]
