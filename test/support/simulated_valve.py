# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""A valve with dead times, on an output of the simulated controller, and its beads."""

from dataclasses import dataclass

import numpy as np
from traced_run import ARM, HOME, TOOL

from ur_cartesian_driver.path import digital, mm, Path
from ur_cartesian_driver.planning import plan

#: The output of the valve, and its dead times [s].
PIN, OPEN, CLOSE = 2, 0.060, 0.035
CYCLE = ARM.model.control_cycle


class SimulatedValve:
    """
    A valve that opens and closes some time after its output; serves as ``on_cycle`` of a run.

    It uses nothing of a plan, but only the controller's output and tool at the end of each cycle.
    """

    def __init__(self, controller, pin, *, open, close):
        self._outputs, self._pin = controller.io.digital_out.standard, pin
        self._outputs[pin] = False
        self._delays = {True: open, False: close}
        self._edges, self._times, self._tool = [], [], []

    def __call__(self, controller):
        is_on = self._outputs[self._pin]
        if is_on != (bool(self._edges) and self._edges[-1][1]):
            self._edges.append((controller.time, is_on))
        self._times.append(controller.time)
        self._tool.append(controller.motion.T_base_tcp.position)

    def switched_at(self):
        """Return the places of the tool when the output switched, by bead (n, 2, 3) [m]."""
        return self._places({True: 0.0, False: 0.0})

    def beads(self):
        """Return the places at which the beads begin and end (n, 2, 3) [m]."""
        return self._places(self._delays)

    def _places(self, delays):
        assert [on for _, on in self._edges] == [True, False] * (len(self._edges) // 2)
        times = [time + delays[on] for time, on in self._edges]
        assert times == sorted(times), 'a bead closes before it opens'
        tool = np.array(self._tool)
        places = np.column_stack([np.interp(times, self._times, axis) for axis in tool.T])
        return places.reshape(-1, 2, 3)


@dataclass(frozen=True)
class Bead:
    """A bead along x of the tool: speed [m/s], length [m], and mode of execution."""

    speed: float
    length: float
    is_rounded: bool = False

    @property
    def run(self):
        """The distance to gain or lose speed, and to cover the lead at full speed [m]."""
        return mm(6) + self.speed**2 + 0.08 * self.speed

    def path(self, start, lead):
        """Return a path whose bead begins and ends at its points, or between them."""
        on, off = (digital(PIN), True), (digital(PIN), False)
        path = Path(start).at(speed=self.speed, acceleration=1.0).by(mm(5), of_tool=True)
        if self.is_rounded:
            return (
                path.by(self.run - mm(5), of_tool=True)
                .set(*on, lead=lead)
                .by(self.length, of_tool=True)
                .set(*off, lead=lead)
                .by(self.run, of_tool=True)
                .rounded(mm(1))
            )
        return (
            path.by(2.0 * self.run + self.length - mm(5), of_tool=True)
            .set(*on, distance=-self.run - self.length, lead=lead)
            .set(*off, distance=-self.run, lead=lead)
        )


def laid(robot, path, options):
    """Lay the beads of a path that begins at the tool; return the places of their ends."""
    state = robot.place(HOME, TOOL)
    goal = path(state.actual_tcp_pose).goal()
    made = plan(goal, state, ARM, options)
    valve = SimulatedValve(robot.controller, PIN, open=OPEN, close=CLOSE)
    run = robot.run(list(made.instructions), on_cycle=valve)
    assert not run.failure
    return valve.beads()


def along(beads, start, axis):
    """Return the ends of beads along an axis of the tool, from its start (n, 2) [m]."""
    direction = start.apply(axis)
    return (beads - start.position) @ (np.array(direction) - start.position)


def errors(robot, bead, lead, options):
    """Return the distances of a bead's begin and end behind the wanted places (2,) [m]."""
    start = robot.place(HOME, TOOL).actual_tcp_pose
    beads = laid(robot, lambda pose: bead.path(pose, lead), options)
    assert len(beads) == 1
    return along(beads, start, (1.0, 0.0, 0.0))[0] - [bead.run, bead.run + bead.length]
