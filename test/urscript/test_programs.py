# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Programs from elsewhere run as they are."""

from __future__ import annotations

from collections.abc import Generator
from pathlib import Path
from typing import Any

import pytest

from ur_cartesian_driver.urscript import core_builtins, parse, ScriptInterpreter, to_text

PROGRAMS = Path(__file__).parent / 'programs'
STEP = 0.002  # [s]

# Registers and modes of the servoj guide's sample.
DESIRED_MODE, SEQUENCE_ID, EXTERNAL_ERROR, SYNC_STATE = 24, 25, 26, 27
JOINTS, THRESHOLDS, STATE_TIME = 24, 30, 46
LAG_TIME = 24
MODE_SERVO, EXTERNAL_TO_ROBOT, ERROR_HALT = 2, 2, 1


class Robot:
    """Registers, and joints that are where the last servoj sent them."""

    def __init__(self) -> None:
        self.integers = [0] * 48
        self.floats = [0.0] * 48
        self.output_floats = [0.0] * 48
        self.joints = [0.0] * 6
        self.commands: list[tuple[list[float], float]] = []
        self.messages: list[str] = []

    def builtins(self) -> dict[str, Any]:
        def interpreter_mode(
            clearQueueOnEnter: bool = True, clearOnEnd: bool = True
        ) -> Generator[None, None, None]:
            while True:
                yield

        def servoj(
            q: list[float], a: float = 0, v: float = 0, t: float = STEP,
            lookahead_time: float = 0.1, gain: float = 300,
        ) -> Generator[None, None, None]:  # fmt: skip
            self.commands.append((q, t))
            self.joints = q
            for _ in range(round(t / STEP)):
                yield

        def stopj(a: float) -> Generator[None, None, None]:
            yield

        def sync() -> Generator[None, None, None]:
            yield

        return {
            **core_builtins(),
            'interpreter_mode': interpreter_mode,
            'servoj': servoj,
            'stopj': stopj,
            'sync': sync,
            'textmsg': lambda s1, s2='': self.messages.append(to_text(s1) + to_text(s2)),
            'popup': lambda s: self.messages.append(f'popup {s}'),
            'get_steptime': lambda: STEP,
            'get_actual_joint_positions': lambda: list(self.joints),
            'is_steady': lambda: True,
            'teach_mode': lambda: None,
            'end_teach_mode': lambda: None,
            'read_input_integer_register': lambda address: self.integers[address],
            'read_input_float_register': lambda address: self.floats[address],
            'write_output_integer_register': lambda address, value: None,
            'write_output_float_register': self.output_floats.__setitem__,
        }


@pytest.fixture
def robot() -> Robot:
    robot = Robot()
    robot.floats[THRESHOLDS : THRESHOLDS + 6] = [0.5] * 6
    return robot


@pytest.fixture
def sample(robot: Robot) -> ScriptInterpreter:
    text = (PROGRAMS / 'servoj_guide.script').read_text()
    return ScriptInterpreter(parse(text), robot.builtins())


def stream(sample: ScriptInterpreter, robot: Robot, frames: int) -> list[float]:
    """Send one way-point per frame, as the planner of the guide does."""
    sent = []
    for frame in range(1, frames + 1):
        robot.integers[SEQUENCE_ID] = frame
        robot.floats[STATE_TIME] = frame * STEP
        robot.floats[JOINTS] = 0.001 * frame
        sent.append(robot.floats[JOINTS])
        sample.step()
    return sent


@pytest.mark.slow
def test_the_servoj_sample_moves_through_every_waypoint(
    sample: ScriptInterpreter, robot: Robot
) -> None:
    robot.integers[DESIRED_MODE] = MODE_SERVO
    robot.integers[SYNC_STATE] = EXTERNAL_TO_ROBOT
    sent = stream(sample, robot, 500)
    assert sample.running
    assert sample.error is None
    reached = [q[0] for q, _ in robot.commands]
    assert len(reached) > 490
    assert reached == sent[: len(reached)]
    assert 'popup Buffer underflow' not in robot.messages
    assert abs(robot.output_floats[LAG_TIME]) < 3 * STEP


def test_the_servoj_sample_halts_on_request(sample: ScriptInterpreter, robot: Robot) -> None:
    stream(sample, robot, 3)
    assert sample.running
    robot.integers[EXTERNAL_ERROR] = ERROR_HALT
    sample.step()
    assert not sample.running
    assert sample.error is None
    assert robot.messages[-1] == 'stopping external control'


def test_the_servoj_sample_halts_when_its_planner_falls_silent(
    sample: ScriptInterpreter, robot: Robot
) -> None:
    for _ in range(2002):
        sample.step()
    assert not sample.running
    assert 'stale sequence ID counter exceeded limit' in robot.messages
