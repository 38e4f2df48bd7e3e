# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""A valve that acts late, on an output of the simulated controller, and the beads that it lays."""

import numpy as np


class SimulatedValve:
    """
    Opens and closes some time after its output; ``on_cycle`` of a run.

    Nothing is taken from a plan: it sees the output and the tool as the controller has them at the
    end of each cycle.
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
        """Return where the tool was when the output switched, an array (n, 2, 3) of beads [m]."""
        return self._places({True: 0.0, False: 0.0})

    def beads(self):
        """Return where the beads begin and end, an array (n, 2, 3) [m]."""
        return self._places(self._delays)

    def _places(self, delays):
        assert [on for _, on in self._edges] == [True, False] * (len(self._edges) // 2)
        times = [time + delays[on] for time, on in self._edges]
        assert times == sorted(times), 'a bead closes before it opens'
        tool = np.array(self._tool)
        places = np.column_stack([np.interp(times, self._times, axis) for axis in tool.T])
        return places.reshape(-1, 2, 3)
