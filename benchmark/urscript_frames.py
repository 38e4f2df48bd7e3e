# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Time of a frame of a URScript program, and of a cycle of the simulated controller."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import nullcontext
import time
from unittest.mock import patch

from figures import Figure, seconds_each

from ur_cartesian_driver.program import ProgramSettings, render, wrap_in_program
from ur_cartesian_driver.sim.controller_assembly import assemble
from ur_cartesian_driver.sim.motion.cycle_batch import CycleBatch
from ur_cartesian_driver.sim.simulator_config import SimulatorConfig
from ur_cartesian_driver.sim.sockets.tcp_script_sockets import TcpScriptSockets
from ur_cartesian_driver.urscript import core_builtins, parse, ScriptInterpreter

NAME = 'URScript'
#: 100 rounds of arithmetic, a comparison, lists and a call, then the end of the frame.
WORK = """
def work():
  values = [1, 2, 3, 4, 5, 6]
  def twice(x):
    return x * 2
  end
  while True:
    i = 0
    while i < 100:
      values[2] = twice(values[1]) + i
      i = i + 1
    end
    sync()
  end
end
"""
IDLE = 'def idle():\n  while True:\n    sync()\n  end\nend\n'
SQUARES = """
def squares():
  while True:
    movel(p[-0.40, -0.13, 0.45, 0, 3.14159, 0], a=0.5, v=0.1, r={radius})
    movel(p[-0.50, -0.13, 0.45, 0, 3.14159, 0], a=0.5, v=0.1, r={radius})
    movel(p[-0.50, -0.23, 0.45, 0, 3.14159, 0], a=0.5, v=0.1, r={radius})
    movel(p[-0.40, -0.23, 0.45, 0, 3.14159, 0], a=0.5, v=0.1, r={radius})
  end
end
"""
#: Number of measured cycles: some rounds of the squares.
CYCLES = 10_000


def run(quick: bool) -> Iterator[Figure]:
    """Run frames without a controller, then whole cycles of one."""
    budget = 0.1 if quick else 0.5
    text = wrap_in_program(
        render(
            ProgramSettings(
                host='127.0.0.1', reverse_port=1, trajectory_port=2, script_command_port=3
            )
        )
    )
    yield Figure(
        benchmark=NAME,
        name='parse the robot program',
        unit='ms',
        value=1e3 * seconds_each(lambda: parse(text), budget),
        note=f'{len(text.splitlines())} lines',
    )
    machine = ScriptInterpreter(parse(WORK), core_builtins() | {'sync': _sync})
    yield Figure(
        benchmark=NAME,
        name='frame with 100 rounds of a loop',
        unit='us',
        value=1e6 * seconds_each(machine.step, budget),
        baseline=1e6 * seconds_each(_work, budget),
        than='the same in Python',
    )
    nothing = 1e6 * _cycle('', budget)
    for name, program in (('nothing running', ''), ('an empty loop', IDLE)):
        yield Figure(
            benchmark='cycle of the simulated controller',
            name=name,
            unit='us',
            value=1e6 * _cycle(program, budget),
            baseline=nothing,
            than='nothing running',
            note='2,000 us are there',
        )
    for name, radius in (('lines', 0.0), ('lines with blends', 0.02)):
        seconds = _moving(radius)
        yield Figure(
            benchmark='cycle of the simulated controller',
            name=name,
            unit='us',
            value=1e6 * seconds,
            baseline=1e6 * _moving(radius, ahead=False),
            than='solved one by one',
            note=f'{0.002 / seconds:.0f} times as fast as real time',
        )


def _cycle(program: str, budget: float) -> float:
    controller = assemble(SimulatorConfig(), TcpScriptSockets()).controller
    if program:
        controller.programs.submit(program)
    for _ in range(5):
        controller.step()
    assert bool(program) == controller.programs.running, controller.messages.log
    return seconds_each(controller.step, budget)


def _moving(radius: float, ahead: bool = True) -> float:
    """Return the time of a cycle of moves [s]; ``ahead``: solve many cycles at once, as usual."""
    controller = assemble(SimulatorConfig()).controller
    controller.programs.submit(SQUARES.format(radius=radius))
    with nullcontext() if ahead else patch.object(CycleBatch, 'next', return_value=None):
        begin = time.process_time()
        for _ in range(CYCLES):
            controller.step()
        seconds = time.process_time() - begin
    assert controller.programs.running, controller.messages.log
    return seconds / CYCLES


def _sync() -> Iterator[None]:
    yield


def _twice(x: int) -> int:
    return x * 2


def _work() -> None:
    values = [1, 2, 3, 4, 5, 6]
    i = 0
    while i < 100:
        values[2] = _twice(values[1]) + i
        i = i + 1
