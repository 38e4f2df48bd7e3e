# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""A controller whose cycles pass only when a test asks for them; a robot on real ports."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest
from robot_ports import FREE

from ur_cartesian_driver.motion.state.rtde_state import RuntimeState
from ur_cartesian_driver.sim import SimulatedRobot
from ur_cartesian_driver.sim.controller_assembly import assemble
from ur_cartesian_driver.sim.simulator_config import SimulatorConfig


class Bench:
    """A controller and the ways in which tests let its time pass."""

    def __init__(self, **settings: Any) -> None:
        self.controller, self.faults = assemble(SimulatorConfig(**settings))
        self.programs = self.controller.programs

    @property
    def log(self) -> list[str]:
        return list(self.controller.messages.log)

    def step(self, cycles: int = 1) -> None:
        for _ in range(cycles):
            self.controller.step()

    def wait(self, seconds: float) -> None:
        self.step(round(seconds / self.controller.cycle))

    def until(self, happened: Callable[[], bool], within: float = 20.0) -> float:
        """Step until something has happened; return how long it took [s]."""
        start = self.controller.time
        while not happened():
            assert self.controller.time - start < within, f'not within {within} s: {self.log}'
            self.controller.step()
        return self.controller.time - start

    def start(self, body: str, name: str = 'test') -> None:
        lines = ''.join(f'  {line}\n' for line in body.strip().splitlines())
        self.programs.submit(f'def {name}():\n{lines}end\n')

    def run(self, body: str, within: float = 20.0) -> list[str]:
        """Run a program to its end; return what was logged meanwhile."""
        before = len(self.log)
        self.start(body)
        self.until(lambda: self.programs.state is RuntimeState.STOPPED, within)
        return self.log[before:]


@pytest.fixture
def bench() -> Bench:
    return Bench()


@pytest.fixture
def make_bench() -> type[Bench]:
    return Bench


@pytest.fixture
def robot():
    """Run a robot on free ports, 20 times as fast as time."""
    with SimulatedRobot(SimulatorConfig(**FREE, rate=20.0)) as robot:
        yield robot
