# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
URScript: the program runs in our interpreter, on an arm that reaches each target at once.

So variables, loops, functions and relative poses work as on the controller; the targets of moves
are collected as points. Nothing waits for the arm or for a person, and inputs have the values of a
robot to which nothing is connected.
"""

from __future__ import annotations

from pathlib import Path

from ur_cartesian_driver.importing.import_format import ImportFormat
from ur_cartesian_driver.importing.import_options import ImportOptions
from ur_cartesian_driver.importing.imported_path import BrokenFile, PathCollector
from ur_cartesian_driver.importing.script.arm_place import ArmPlace
from ur_cartesian_driver.importing.script.collected_events import CollectedEvents
from ur_cartesian_driver.importing.script.program_functions import NoPeer, ProgramFunctions
from ur_cartesian_driver.importing.script.running_script import RunningScript
from ur_cartesian_driver.importing.script.script_layout import parsed
from ur_cartesian_driver.importing.script.script_terms import TERMS
from ur_cartesian_driver.importing.text_file import file_lines, file_text
from ur_cartesian_driver.sim import SimulatorConfig
from ur_cartesian_driver.sim.builtins import controller_builtins
from ur_cartesian_driver.sim.controller import Controller
from ur_cartesian_driver.urscript import CompileError, ScriptInterpreter
from ur_cartesian_driver.urscript.running.script_interpreter import BUDGET_EXCEEDED

#: A program probably does not end if it has more cycles, more points (with outputs and waits), or
#: more evaluated nodes of the syntax tree than this.
MAX_CYCLES, MAX_POINTS, MAX_NODES = 100_000, 100_000, 10_000_000
#: Largest number of nodes that a thread evaluates between two moves. It is large because entering
#: a block counts all of its statements, and slicers write long blocks.
MAX_NODES_AT_ONCE = 5_000_000


def collect_urscript(file: Path, options: ImportOptions, into: PathCollector) -> None:
    """
    Run a program and collect its moves.

    :raises BrokenFile: the file has no program, or the program fails or does not end.
    """
    # The parser counts only LF as the end of a line; other line ends would shift its line numbers.
    program = parsed('\n'.join(file_lines(file_text(file))))
    arm = options.arm
    controller = Controller(
        SimulatorConfig(model=arm.model.name, geometry=arm.geometry), controller_builtins, NoPeer()
    )
    run = RunningScript()
    events = CollectedEvents(run, ArmPlace(controller, options))
    try:
        run.interpreter = interpreter = ScriptInterpreter(
            program,
            ProgramFunctions(events, controller).by_name(),
            instruction_budget=MAX_NODES_AT_ONCE,
            total_budget=MAX_NODES,
        )
    except CompileError as error:
        reason = error.reason
        if 'name_not_found' in error.text:
            reason += '; what the installation or another file defines has to be in this one'
        raise BrokenFile(max(1, error.line), reason) from None
    line = 0
    for _ in range(MAX_CYCLES):
        interpreter.step()
        # Advance the clock, for programs that wait; nothing moves.
        controller.cycles += 1
        line = interpreter.main_location[0]
        if interpreter.error is not None:
            line, text = interpreter.error.line, interpreter.error.text.rstrip('.')
            if interpreter.error.text == BUDGET_EXCEEDED:
                break
            suspicion = run.suspicion('; ') if 'nan' in text or 'none' in text else ''
            raise BrokenFile(line, text + suspicion)
        if not interpreter.running:
            run.tell(into.remarks)
            events.hand_over(into)
            return
        if len(events) > MAX_POINTS:
            raise BrokenFile(
                line,
                f'there are more than {MAX_POINTS:,} points and outputs up to here, and a goal '
                'has fewer; split the program, or take out a loop that does not end'
                f'{run.suspicion(": ")}',
            )
    raise BrokenFile(
        line,
        f'the loop around this line does not end{run.suspicion(": ")}; take it out',
    )


FORMAT = ImportFormat(
    terms=TERMS,
    others='Every other function refuses the file, unless the file defines it.',
    collect=collect_urscript,
)
