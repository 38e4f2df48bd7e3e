# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Conveyors and their encoders: belts that stand still.

No pulses arrive, so a count is what a program sets. Moves relative to a belt are moves, as long as
its count stays; a count that changes while the belt is tracked ends the program, because the arm
would have to follow.
"""

from __future__ import annotations

from dataclasses import dataclass, field

from ur_cartesian_driver.sim.builtins.arguments import (
    index,
    int32,
    number,
    pose,
    positive,
    script_pose,
    six,
)
from ur_cartesian_driver.sim.builtins.builtin_group import BuiltinGroup
from ur_cartesian_driver.sim.controller import Controller
from ur_cartesian_driver.urscript.script_errors import RuntimeException
from ur_cartesian_driver.urscript.script_values import ScriptPose, Value

ENCODERS = 2
DECODERS = 5
#: Counts before an encoder begins anew, by the number of its range.
RANGES = (2**32, 2**8, 2**16, 2**24, 2**32)


@dataclass(slots=True)
class _Encoder:
    count: float = 0
    range: int = RANGES[0]


@dataclass(slots=True)
class _Conveyors:
    encoders: list[_Encoder] = field(default_factory=lambda: [_Encoder() for _ in range(ENCODERS)])
    #: The encoder whose belt is tracked, or None.
    tracked: int | None = None


class ConveyorBuiltins(BuiltinGroup):
    """Counts live beyond their program; tracking ends with the functions that end it."""

    def __init__(self, controller: Controller) -> None:
        """Begin with counts of zero."""
        super().__init__(controller)
        self._belts = _Conveyors()

    def _encoder(self, encoder_index: Value) -> _Encoder:
        return self._belts.encoders[index(encoder_index, 'encoder_index', ENCODERS)]

    def encoder_enable_pulse_decode(
        self, encoder_index: Value, decoder_type: Value, A: Value, B: Value = 0
    ) -> None:
        """Count the pulses of inputs, where none arrive."""
        self._encoder(encoder_index)
        index(decoder_type, 'decoder_type', DECODERS)
        for value, name in ((A, 'A'), (B, 'B')):
            index(value, name, 12)

    def encoder_enable_set_tick_count(self, encoder_index: Value, range_id: Value) -> None:
        """Let a program count."""
        self._encoder(encoder_index).range = RANGES[index(range_id, 'range_id', len(RANGES))]

    def encoder_get_tick_count(self, encoder_index: Value) -> float:
        """Return a count."""
        return self._encoder(encoder_index).count

    def encoder_set_tick_count(self, encoder_index: Value, count: Value) -> None:
        """Set a count."""
        encoder, new = self._encoder(encoder_index), number(count, 'count')
        tracked = self._belts.tracked
        if tracked is not None and encoder is self._belts.encoders[tracked]:
            if new != encoder.count:
                raise RuntimeException(
                    'A conveyor that moves while it is tracked is not simulated; leave its tick '
                    'count as it is until stop_conveyor_tracking.'
                )
        encoder.count = new

    def encoder_unwind_delta_tick_count(
        self, encoder_index: Value, delta_tick_count: Value
    ) -> float:
        """Return a difference of two counts as if the encoder had not begun anew between them."""
        turn = self._encoder(encoder_index).range
        delta = number(delta_tick_count, 'delta_tick_count')
        return delta - turn * round(delta / turn)

    def conveyor_pulse_decode(self, type: Value, A: Value, B: Value = 0) -> None:
        """Count the pulses of the first encoder: the older name."""
        self.encoder_enable_pulse_decode(0, type, A, B)

    def get_conveyor_tick_count(self) -> float:
        """Return the count of the first encoder: the older name."""
        return self.encoder_get_tick_count(0)

    def set_conveyor_tick_count(
        self, tick_count: Value, absolute_encoder_resolution: Value = 0
    ) -> None:
        """Set the count of the first encoder: the older name."""
        self.encoder_enable_set_tick_count(0, absolute_encoder_resolution)
        self.encoder_set_tick_count(0, int32(tick_count, 'tick_count'))

    def track_conveyor_linear(
        self, direction: Value, ticks_per_meter: Value, encoder_index: Value = 0
    ) -> None:
        """Move relative to a belt, along a direction of the base."""
        six(direction, 'direction')
        number(ticks_per_meter, 'ticks_per_meter')
        self._belts.tracked = index(encoder_index, 'encoder_index', ENCODERS)

    def track_conveyor_circular(
        self,
        center: Value,
        ticks_per_revolution: Value,
        rotate_tool: Value = False,
        encoder_index: Value = 0,
    ) -> None:
        """Move relative to a turntable."""
        pose(center, 'center')
        number(ticks_per_revolution, 'ticks_per_revolution')
        self._belts.tracked = index(encoder_index, 'encoder_index', ENCODERS)

    def stop_conveyor_tracking(self, a: Value = 20, aRot: Value = 'a') -> None:
        """Move relative to the base again."""
        positive(a, 'a')
        self._belts.tracked = None

    def get_target_tcp_pose_along_path(self) -> ScriptPose:
        """Return the target relative to the belt, which stands."""
        return script_pose(self._controller.target.T_base_tcp)

    def get_target_tcp_speed_along_path(self) -> list[float]:
        """Return the target speed relative to the belt, which stands."""
        return list(self._controller.target.tcp_twist)
