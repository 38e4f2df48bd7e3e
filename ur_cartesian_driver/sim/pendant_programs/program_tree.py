# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The tree of a program on the pendant, and the URScript that PolyScope generates from the tree.

PolyScope generates the URScript anew whenever the program is played. The URCap External Control
(CB3, PolyScope 5) puts its header before its first node, even inside the loop of the program; the
URCapX (PolyScope X) puts its header before the program.
"""

from __future__ import annotations

from dataclasses import dataclass
import re
from typing import TypeAlias

from ur_cartesian_driver.urscript.parsing.scanner import KEYWORDS


@dataclass(frozen=True, slots=True)
class ScriptText:
    """A node that is URScript: one or more lines."""

    text: str


@dataclass(frozen=True, slots=True)
class ExternalControlNode:
    """A node that fetches its URScript from another computer."""


TreeNode: TypeAlias = ScriptText | ExternalControlNode


@dataclass(frozen=True, slots=True, kw_only=True)
class FetchedScript:
    """The program that External Control has fetched, in its two parts; each may be empty."""

    #: Functions and variables, which a program contains only once.
    header: str = ''
    #: The text at each node.
    control_loop: str = ''
    #: Whether the header stands before the program, rather than before the first node.
    header_first: bool = False


@dataclass(frozen=True, slots=True)
class ProgramTree:
    """The nodes of a program, in the order in which they run."""

    nodes: tuple[TreeNode, ...]
    #: Whether the program begins again after its last node.
    loops: bool = False

    @property
    def has_external_control(self) -> bool:
        """Whether a node has to be fetched."""
        return any(isinstance(node, ExternalControlNode) for node in self.nodes)

    def script(self, name: str, fetched: FetchedScript) -> str:
        """
        Return the program as URScript.

        :param name: the name of the file.
        :param fetched: the script that External Control has fetched for its nodes.
        """
        lines = [f'def {function_name(name.removesuffix(".urp"))}():']
        header = fetched.header
        if fetched.header_first:
            lines.append(header)
            header = ''
        if self.loops:
            lines.append('while (True):')
        for node in self.nodes:
            if isinstance(node, ScriptText):
                lines.append(node.text)
            else:
                lines += [header, fetched.control_loop]
                header = ''
        if self.loops:
            lines.append('end')
        return '\n'.join([*lines, 'end', ''])


class UnloadableProgram(ValueError):
    """The program that the robot is configured to load cannot be loaded."""


@dataclass(frozen=True, slots=True)
class UnreadableProgram:
    """A program that the robot has on its disk, but refuses to load."""

    #: The reason, as a sentence without its full stop.
    reason: str


#: A program on the disk of a robot: URScript, a tree, or the reason why it cannot be loaded.
SavedProgram: TypeAlias = str | ProgramTree | UnreadableProgram


def function_name(program: str) -> str:
    """Return the name of a program's function: the program's name, made a URScript identifier."""
    name = re.sub(r'\W', '_', program, flags=re.ASCII) or 'program'
    return name if name[0].isalpha() and name not in KEYWORDS else f'_{name}'


#: The programs that every simulated robot has saved: file name -> tree.
BUILT_IN_PROGRAMS = {'external_control.urp': ProgramTree((ExternalControlNode(),))}
