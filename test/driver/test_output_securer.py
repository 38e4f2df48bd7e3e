# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Outputs that a pause changes are known and restored, however late their writes succeed."""

import asyncio
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import pytest

from ur_cartesian_driver.driver.loop import output_securer
from ur_cartesian_driver.driver.loop.output_securer import OutputSecurer
from ur_cartesian_driver.motion.events import OutputsSecured
from ur_cartesian_driver.motion.goal.goal import OutputKind, SafeOutput

GLUE = SafeOutput(output=OutputKind.STANDARD_DIGITAL, pin=2, value=0.0, restore=True)
GAS = replace(GLUE, pin=3)
FAILED = 'The inputs are in use.'


class Robot:
    """Outputs that are written as the test says; a write waits until it is let go."""

    def __init__(self) -> None:
        """Begin with both outputs on."""
        self.values = {2: 1.0, 3: 1.0}
        self.writes: list[tuple[int, ...]] = []
        self.failures: list[str] = []
        self.free = asyncio.Event()
        self.free.set()

    async def write(self, host, port, outputs, before) -> OutputsSecured:
        """Write the outputs, unless a failure is planned."""
        await self.free.wait()
        self.writes.append(tuple(output.value for output in outputs))
        if self.failures and (failure := self.failures.pop(0)):
            return OutputsSecured(failure=failure)
        changed = []
        for output in outputs:
            if self.values[output.pin] != output.value:
                changed.append(replace(output, value=self.values[output.pin]))
                self.values[output.pin] = output.value
        return OutputsSecured(changed=tuple(changed))


class Scene:
    """A securer with its robot, and what it has reported."""

    def __init__(self, monkeypatch) -> None:
        """Make the securer."""
        self.robot, self.reported = Robot(), list[OutputsSecured]()
        self.errors: list[str] = []
        self.tasks: list[asyncio.Task[None]] = []
        monkeypatch.setattr(output_securer, 'write_outputs', self.robot.write)
        monkeypatch.setattr(output_securer, 'RETRY_PERIOD', 0.001)
        config: Any = SimpleNamespace(robot_ip='', rtde_port=0)
        link: Any = SimpleNamespace(report_error=self.errors.append)
        self.securer = OutputSecurer(config, link, self.spawn, self.reported.append)

    def spawn(self, work) -> None:
        """Run a coroutine concurrently."""
        self.tasks.append(asyncio.create_task(work))

    async def settled(self) -> None:
        """Wait for all orders."""
        await asyncio.gather(*self.tasks)

    @property
    def last(self) -> OutputsSecured:
        """The last report."""
        return self.reported[-1]


@pytest.fixture
def run(monkeypatch):
    """Run a scene in a loop of its own."""

    def made(scenario) -> None:
        async def whole() -> None:
            await asyncio.wait_for(scenario(Scene(monkeypatch)), 20.0)

        asyncio.run(whole())

    return made


def test_a_retry_reports_what_it_has_changed(run):
    async def scenario(scene):
        scene.robot.failures = [FAILED]
        scene.securer.secure((GLUE, GAS))
        await scene.settled()
        assert scene.errors == [FAILED]
        assert [each.failure for each in scene.reported] == [FAILED, '']
        assert scene.last.changed == (replace(GLUE, value=1.0), replace(GAS, value=1.0))
        assert scene.securer.failure == ''

    run(scenario)


def test_a_second_pause_knows_what_the_first_one_has_changed(run):
    async def scenario(scene):
        scene.robot.free.clear()
        scene.securer.secure((GLUE,))
        await asyncio.sleep(0.0)  # its write waits
        scene.securer.secure((GLUE,))
        scene.robot.free.set()
        await scene.settled()
        assert scene.last.changed == (replace(GLUE, value=1.0),)

    run(scenario)


def test_outputs_that_were_given_back_are_not_written_again(run):
    async def scenario(scene):
        scene.robot.failures = [FAILED, FAILED]
        scene.securer.secure((GLUE,))
        await asyncio.sleep(0.0)
        scene.securer.give_back()
        await scene.settled()
        assert scene.robot.writes == [(0.0,)]
        scene.robot.values[2] = 0.0  # the program has switched it off
        scene.securer.secure((GLUE,))
        await scene.settled()
        assert scene.last.changed == ()

    run(scenario)


@pytest.mark.parametrize(('other', 'outputs'), [('give_back', ()), ('secure', ((GAS,),))])
def test_the_end_of_a_motion_waits_for_the_first_attempt_and_no_longer(run, other, outputs):
    async def scenario(scene):
        done = []
        scene.robot.free.clear()
        scene.securer.secure((GLUE,))
        await asyncio.sleep(0.0)  # its write waits
        getattr(scene.securer, other)(*outputs)
        scene.securer.when_done(lambda: done.append(True))
        await asyncio.sleep(0.0)
        assert not done
        scene.robot.free.set()
        await scene.settled()
        assert done == [True]

    run(scenario)


def test_a_write_that_raises_ends_the_attempt(run):
    async def scenario(scene):
        async def fail(*arguments):
            raise RuntimeError('a defect')

        done = []
        scene.securer._write = fail
        scene.securer.secure((GLUE,))
        scene.securer.when_done(lambda: done.append(True))
        with pytest.raises(RuntimeError):
            await scene.settled()
        assert done == [True]

    run(scenario)


def test_another_motion_gets_no_report_of_the_one_before(run):
    async def scenario(scene):
        scene.robot.free.clear()
        scene.securer.secure((GLUE,))
        await asyncio.sleep(0.0)
        scene.securer.forget()
        scene.robot.free.set()
        await scene.settled()
        assert scene.reported == []
        done = []
        scene.securer.when_done(lambda: done.append(True))
        assert done == [True]
        scene.securer.secure((GLUE,))
        await scene.settled()
        assert scene.last.changed == ()

    run(scenario)
