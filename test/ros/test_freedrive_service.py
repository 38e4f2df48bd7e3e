# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""What ``~/freedrive_mode`` answers while freedrive starts and ends."""

from types import SimpleNamespace
from typing import Any

import pytest
from std_srvs.srv import SetBool

from ur_cartesian_driver.motion.errors import ErrorCode
from ur_cartesian_driver.motion.events import Outcome
from ur_cartesian_driver.ros.goals.arm_arbiter import ArmArbiter
from ur_cartesian_driver.ros.live.freedrive_service import FreedriveService


class SlowArm:
    """A driver and the motion of its freedrive, which starts and ends when the test says so."""

    def __init__(self):
        self.is_cancelled = False
        self._callbacks = []

    def start_freedrive(self, on_start):
        self.begin = on_start
        return self

    def add_done_callback(self, callback):
        self._callbacks.append(callback)

    def cancel(self):
        self.is_cancelled = True

    def end(self):
        callbacks, self._callbacks = self._callbacks, []
        for callback in callbacks:
            callback(Outcome(code=ErrorCode.CANCELLED, text='over'))


@pytest.fixture
def arm():
    return SlowArm()


@pytest.fixture
def ask(arm):
    """Return a function that calls the service and returns the future of its answer."""
    handlers: list[Any] = []

    def create_service(_kind, _name, handler, **_):
        handlers.append(handler)
        return SimpleNamespace(send_response=None)

    node: Any = SimpleNamespace(create_service=create_service)
    service = FreedriveService(node, arm, ArmArbiter())
    yield lambda on: handlers[0](SetBool.Request(data=on), None)
    assert service


def test_a_second_call_waits_for_the_start_too(arm, ask):
    first, second = ask(True), ask(True)
    assert not first.done()
    assert not second.done(), 'the arm cannot be guided yet'
    arm.begin()
    third = ask(True)
    for answer in (first, second, third):
        assert (answer.result().ok, answer.result().text) == (
            True,
            'The arm can be guided by hand.',
        )


def test_freedrive_that_is_ending_is_not_on(arm, ask):
    started = ask(True)
    arm.begin()
    ended, too_early = ask(False), ask(True)
    assert started.result().ok
    assert arm.is_cancelled
    assert not too_early.result().ok
    assert too_early.result().text == 'Freedrive is ending; try again when it has ended.'
    arm.end()
    assert ended.result().ok
    again = ask(True)
    arm.begin()
    assert again.result().ok
