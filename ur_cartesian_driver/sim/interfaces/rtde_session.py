# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""One RTDE client: the data packages that it gets and the inputs that it writes."""

from __future__ import annotations

from collections.abc import Iterator
from math import floor
from random import Random

from ur_cartesian_driver.protocol.rtde.rtde_fields import fields_of, INPUT_TYPES, OUTPUT_TYPES
from ur_cartesian_driver.protocol.rtde.rtde_packages import ControllerVersion
from ur_cartesian_driver.protocol.rtde.rtde_recipe import Recipe
from ur_cartesian_driver.protocol.rtde.rtde_server import (
    InputReceived,
    OutputStream,
    RtdeServerCodec,
)
from ur_cartesian_driver.sim.controller import Controller
from ur_cartesian_driver.sim.interfaces.rtde_input_effects import apply_inputs
from ur_cartesian_driver.sim.interfaces.tcp_server import ClientSession
from ur_cartesian_driver.sim.motion.imperfect_arm import Imperfections
from ur_cartesian_driver.sim.rtde_output_values import output_getter


class _OutputSchedule:
    """A recipe, the functions that compute its values, and the cycles that need a package."""

    def __init__(self, output: OutputStream, maximum: float) -> None:
        self.output = output
        self._recipe: Recipe = output.recipe
        self._getters = [
            output_getter(name, zero)
            for name, zero in zip(output.recipe.names, output.recipe.zeros(), strict=True)
        ]
        #: Cycles per package, rounded down as in the manufacturer's guide: a client that asks for
        #: 300 Hz on a robot with 500 Hz gets 500 Hz.
        self._cycles = max(1, floor(maximum / output.frequency + 1e-9))

    def is_due(self, cycle: int) -> bool:
        """Return whether a package is due in this cycle."""
        return cycle % self._cycles == 0

    def package(self, controller: Controller) -> bytes:
        """Return the package of this cycle."""
        return self._recipe.pack([get(controller) for get in self._getters])


class _PacketGaps:
    """Chooses packets to leave out at random, as a busy controller leaves some out."""

    def __init__(self, imperfections: Imperfections) -> None:
        self._imperfections, self._random = imperfections, Random(imperfections.seed)
        self._left_out = 0

    def leaves_out(self) -> bool:
        """Return whether to leave out the packet of this cycle; call this once per cycle."""
        if self._left_out > 0:
            self._left_out -= 1
            return True
        imperfections, draw = self._imperfections, self._random.random()
        if draw < imperfections.long_gaps:
            self._left_out = self._random.randint(1, imperfections.max_skipped)
        elif draw < imperfections.long_gaps + imperfections.single_gaps:
            self._left_out = 1
        return False


class RtdeSession(ClientSession):
    """Answers requests, applies inputs, and packs the data packages that are due."""

    def __init__(self, controller: Controller, taken_inputs: set[str]) -> None:
        """
        Wait for requests.

        :param taken_inputs: the inputs that clients have reserved; all sessions share this set.
        """
        major, minor, bugfix, build = controller.config.version
        self._controller = controller
        self._maximum = 1.0 / controller.cycle
        self._server = RtdeServerCodec(
            ControllerVersion(major=major, minor=minor, bugfix=bugfix, build=build),
            taken_inputs,
            self._maximum,
            fields_of(OUTPUT_TYPES, controller.config.version),
            fields_of(INPUT_TYPES, controller.config.version),
        )
        imperfections = controller.config.arm_imperfections
        self._gaps = None if imperfections is None else _PacketGaps(imperfections)
        self._schedule: _OutputSchedule | None = None

    def feed(self, data: bytes) -> bytes:
        """Apply the inputs in the bytes, and return the answers to the requests."""
        for event in self._server.feed(data):
            if isinstance(event, InputReceived):
                apply_inputs(self._controller, event.recipe.named(event.values))
            else:
                self._controller.messages.note(f'{event.source}: {event.text}')
        output = self._server.output
        if output is None:
            self._schedule = None
        elif self._schedule is None or self._schedule.output is not output:
            self._schedule = _OutputSchedule(output, self._maximum)
        return self._server.data_to_send()

    def close(self) -> None:
        """Release the inputs of this client for other clients."""
        self._server.close()

    def packages(self) -> Iterator[bytes]:
        """Yield the data package that is due in this cycle, if any."""
        if self._schedule is None or not self._server.streaming:
            return
        if self._gaps is not None and self._gaps.leaves_out():
            return
        if self._schedule.is_due(self._controller.cycles):
            yield self._schedule.package(self._controller)
