# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Conveyors and their encoders; the simulated belts stand still.

No pulses arrive, so only programs change the tick count of an encoder. While a belt is tracked,
the moves of a program are ordinary moves, because the belt does not move. Changing the tick count
of the tracked belt ends the program, because the arm would have to follow the belt.
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
    text,
)
from ur_cartesian_driver.sim.builtins.builtin_group import BuiltinGroup, without_effect
from ur_cartesian_driver.sim.controller import Controller
from ur_cartesian_driver.urscript.script_errors import RuntimeException
from ur_cartesian_driver.urscript.script_values import ScriptPose, Value

ENCODERS = 2
DECODERS = 5
#: Ticks after which an encoder wraps around, indexed by `range_id`.
RANGES = (2**32, 2**8, 2**16, 2**24, 2**32)


@dataclass(slots=True)
class _Encoder:
    count: float = 0
    range: int = RANGES[0]


@dataclass(slots=True)
class _Conveyors:
    encoders: list[_Encoder] = field(default_factory=lambda: [_Encoder() for _ in range(ENCODERS)])
    #: Index of the encoder whose belt is tracked, or None.
    tracked: int | None = None


class ConveyorBuiltins(BuiltinGroup):
    """Functions for encoders and tracked belts, whose state outlives the program."""

    def __init__(self, controller: Controller) -> None:
        """Begin with tick counts of zero, and with no tracked belt."""
        super().__init__(controller)
        self._belts = _Conveyors()

    def _encoder(self, encoder_index: Value) -> _Encoder:
        return self._belts.encoders[index(encoder_index, 'encoder_index', ENCODERS)]

    @without_effect
    def encoder_enable_pulse_decode(
        self, encoder_index: Value, decoder_type: Value, A: Value, B: Value = 0
    ) -> None:
        """Check the arguments; no pulses arrive that the encoder could count."""
        self._encoder(encoder_index)
        index(decoder_type, 'decoder_type', DECODERS)
        for value, name in ((A, 'A'), (B, 'B')):
            index(value, name, 12)

    def encoder_enable_set_tick_count(self, encoder_index: Value, range_id: Value) -> None:
        """Set the counting range of an encoder whose tick count is set by programs."""
        self._encoder(encoder_index).range = RANGES[index(range_id, 'range_id', len(RANGES))]

    def encoder_get_tick_count(self, encoder_index: Value, opt: Value = '') -> float:
        """Return the tick count of an encoder; with `opt` = `raw`, as a whole number."""
        count = self._encoder(encoder_index).count
        if text(opt, 'opt') not in ('', 'raw'):
            raise RuntimeException(f'opt is {opt!r}; it must be "" or "raw"')
        return int(count) if opt else count

    def encoder_set_tick_count(self, encoder_index: Value, count: Value) -> None:
        """Set the tick count of an encoder."""
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
        """Return a difference of two tick counts, corrected for a wrap-around between them."""
        turn = self._encoder(encoder_index).range
        delta = number(delta_tick_count, 'delta_tick_count')
        return delta - turn * round(delta / turn)

    @without_effect
    def conveyor_pulse_decode(self, type: Value, A: Value, B: Value = 0) -> None:
        """Check the arguments for the first encoder, like `encoder_enable_pulse_decode`."""
        self.encoder_enable_pulse_decode(0, type, A, B)

    def get_conveyor_tick_count(self) -> float:
        """Return the tick count of the first encoder (older function)."""
        return self.encoder_get_tick_count(0)

    def set_conveyor_tick_count(
        self, tick_count: Value, absolute_encoder_resolution: Value = 0
    ) -> None:
        """Set the range and the tick count of the first encoder (older function)."""
        self.encoder_enable_set_tick_count(0, absolute_encoder_resolution)
        self.encoder_set_tick_count(0, int32(tick_count, 'tick_count'))

    def track_conveyor_linear(
        self, direction: Value, ticks_per_meter: Value, encoder_index: Value = 0
    ) -> None:
        """Track a belt that moves straight, in a direction given in base axes."""
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
        """Track a turntable."""
        pose(center, 'center')
        number(ticks_per_revolution, 'ticks_per_revolution')
        self._belts.tracked = index(encoder_index, 'encoder_index', ENCODERS)

    def stop_conveyor_tracking(self, a: Value = 20, aRot: Value = 'a') -> None:
        """Stop tracking; moves are relative to the base again."""
        positive(a, 'a')
        if aRot != 'a':
            positive(aRot, 'aRot')
        self._belts.tracked = None

    def get_target_tcp_pose_along_path(self) -> ScriptPose:
        """Return the target pose of the TCP relative to the belt, which stands still."""
        return script_pose(self._controller.target.T_base_tcp)

    def get_target_tcp_speed_along_path(self) -> list[float]:
        """Return the target speed of the TCP relative to the belt, which stands still."""
        return list(self._controller.target.tcp_twist)
