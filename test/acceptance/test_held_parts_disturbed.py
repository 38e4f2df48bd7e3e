# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Slider, pause, and cancel with resume come together at random while a part is led along a tool.

Put together, the path on the part is whole, and the output was on along its stretch alone.
"""

from curve_distance import distances
from held_part_bench import (
    Bench,
    BESIDE,
    CLOSE,
    DEVIATION,
    edges,
    is_covered,
    OFF,
    ON,
    PRIMITIVES,
    programmed,
    SERVO,
    SPLINE,
)
import numpy as np
import pytest
from random_cases import cases, random_of
from robot_cell import CYCLE, run_cell

from ur_cartesian_driver.motion.errors import ErrorCode
from ur_cartesian_driver.motion.state.rtde_state import RuntimeState
from ur_cartesian_driver.path import resume

pytest.importorskip('pinocchio')
pytestmark = [pytest.mark.acceptance, pytest.mark.slow, pytest.mark.random]

COUNT = 20
OVERLAP = 0.005
#: The longest and shortest time between two disturbances [cycles].
BETWEEN = (10, 90)
#: How soon the output is off in a pause, and on again after it [cycles].
SECURED, RESTORED = 8, 4
SLIDER, PAUSE, CANCEL = 'slider', 'pause', 'cancel'


class Disturbed:
    """One goal that is disturbed until it is done, and all readings of it."""

    def __init__(self, cell, bench, random, goal):
        self.cell, self.bench, self.random, self.goal = cell, bench, random, goal
        self.done: list[str] = []
        #: For each run the places (n, 3), whether the output was on (n,), without the moments
        #: until the driver has made it safe in a pause, and whether it was on but for pauses (n,).
        self.readings: list[tuple[np.ndarray, np.ndarray, np.ndarray]] = []
        #: Rows of the present run in which a pause holds an output off that was on before.
        self._paused: list[slice] = []

    async def run(self):
        """Carry the goal out; a cancelled one is resumed, at most three times."""
        motion, cancels = await self.bench.begin(self.goal), 0
        while True:
            cancelled = await self._disturb(motion, may_cancel=cancels < 3)
            outcome = await self.bench.end(motion)
            places, on = self.bench.readings()
            meant = on.copy()
            for rows in self._paused:
                meant[rows] = True
                on[rows.start : rows.start + SECURED] = False
            self._paused = []
            self.readings.append((places, on, meant))
            if not cancelled:
                assert outcome.code is ErrorCode.SUCCESSFUL, (self.done, outcome)
                return
            if outcome.code is ErrorCode.SUCCESSFUL:  # it was at its end already
                return
            assert outcome.stopped is not None, (self.done, outcome)
            cancels += 1
            left = resume(self.goal, outcome.stopped, overlap=OVERLAP, approach=0.01)
            self.goal = left.goal
            motion = self.bench.start(self.goal)

    async def _disturb(self, motion, may_cancel):
        """Disturb a motion until it has ended; return whether it was cancelled."""
        kinds = [SLIDER, SLIDER, PAUSE] + [CANCEL] * may_cancel
        while motion.outcome is None:
            for _ in range(self.random.randint(*BETWEEN)):
                await self.cell.sleep(CYCLE)
            if motion.outcome is not None:
                return False
            kind = self.random.choice(kinds)
            self.done.append(kind)
            if kind == SLIDER:
                self.cell.robot.set_speed_slider(self.random.choice([0.2, 0.5, 1.0]))
            elif kind == PAUSE:
                await self._pause(motion)
            elif motion.progress:
                self.cell.owner.cancel()
                return True
        return False

    async def _pause(self, motion):
        before, was_on = len(self.bench.recorder.rows), self.bench.is_on
        self.cell.robot.inject('pause')
        await self.cell.until(lambda: self.cell.memory.read().runtime_state is RuntimeState.PAUSED)
        for _ in range(self.random.randint(1, 60)):
            await self.cell.sleep(CYCLE)
        self.cell.robot.inject('play')
        await self.cell.until(
            lambda: self.cell.memory.read().runtime_state is RuntimeState.PLAYING
        )
        if was_on:
            self._paused.append(slice(before, len(self.bench.recorder.rows) + RESTORED))


@pytest.mark.parametrize('execution', [SPLINE, SERVO, PRIMITIVES])
@pytest.mark.timeout(1200)
def test_whatever_comes_together_the_path_on_the_part_is_whole(execution):
    async def body(cell):
        bench = await Bench(cell).connect()
        for k in range(cases(COUNT)):
            case = Disturbed(
                cell, bench, random_of('held disturbed', execution.name, k), edges(execution)
            )
            cell.robot.set_speed_slider(1.0)
            await case.run()
            check(case, execution)

    run_cell(body)


def check(case, execution):
    """See that the tool was on all of the path, and that the output was on along its stretch."""
    corners, beside = programmed(), DEVIATION + BESIDE[execution]
    places, on, meant = map(np.concatenate, zip(*case.readings, strict=True))
    assert is_covered(corners, places, beside), case.done
    stretch = corners[ON + 1 : OFF + 2]
    assert is_covered(stretch, places[meant], beside), case.done
    # On nowhere else, and off at the end.
    assert distances(places[on], [stretch]).max() < CLOSE + beside, case.done
    assert not on[-1], case.done
    # The first run begins on the path; a resumed one comes back to it along an approach.
    first = case.readings[0][0]
    assert distances(first, [corners]).max() < beside, case.done
