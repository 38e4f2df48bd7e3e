# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Identify the laws of an arm from recordings: each with an interval, or the reason why not."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

from ur_cartesian_driver.identification import estimators
from ur_cartesian_driver.identification.arm_samples import ArmSamples
from ur_cartesian_driver.identification.blends.blend_laws import blend_laws
from ur_cartesian_driver.identification.estimators import Result, Unknown
from ur_cartesian_driver.identification.geometry import Kind
from ur_cartesian_driver.identification.moves import (
    find_moves,
    FoundMove,
    join_commands,
    without_chance_fits,
)
from ur_cartesian_driver.identification.profile import Misfit
from ur_cartesian_driver.identification.recorded_calls import MotionCommand
from ur_cartesian_driver.identification.servo.servo_laws import servo_laws
from ur_cartesian_driver.motion.twin.laws import LAWS

#: Laws that no recording identifies so far.
_LATER = {
    'speed_noise': 'measured speeds are not evaluated',
}
_NO_EXPERIMENT = 'no experiment shows it yet'


@dataclass(frozen=True, slots=True, kw_only=True)
class Identification:
    """
    What recordings say of their arm.

    :param moves: in the order of the recordings.
    :param results: by the name of the law, in the order of the table of laws.
    """

    moves: Sequence[FoundMove]
    results: dict[str, Result]

    def summary(self) -> str:
        """Return a line that counts the moves, and one for each move that fits no trapezoid."""
        kinds = Counter(move.kind for move in self.moves if len(move.chain) < 2)
        parts = [
            f'{kinds[kind]} {name}{"s" * (kinds[kind] != 1)}{what}'
            for kind, name, what in (
                (Kind.LINE, 'line', ''),
                (Kind.JOINT, 'joint move', ''),
                (Kind.EITHER, 'turn', ' of one joint'),
                (Kind.SERVO, 'motion', ' of servoj'),
            )
            if kinds[kind]
        ]
        chains = sum(len(move.chain) > 1 for move in self.moves)
        if chains:
            parts.append(f'{chains} chain{"s" * (chains != 1)} with blends')
        if others := kinds[Kind.OTHER]:
            parts.append(f'{others} of another shape (not used)')
        count = len(self.moves)
        text = f'{count} move{"s" * (count != 1)}: {", ".join(parts)}.' if parts else 'No moves.'
        for move in self.moves:
            if isinstance(move.profile, Misfit):
                text += (
                    f'\nThe move at {move.samples.time[move.piece.moving[0]]:.2f} s of '
                    f'{move.samples.name} fits no trapezoid: residual '
                    f'{1e6 * move.profile.rms:.3g} um or urad rms.'
                )
        return text


def identify(
    recordings: Sequence[ArmSamples],
    commands: Sequence[MotionCommand] = (),
    commands_name: str = 'the calls',
) -> Identification:
    """
    Estimate the laws of motion of the arm that made recordings.

    :param commands: the calls behind the moves of all recordings, in order; empty = unknown.
    :param commands_name: the file of the calls, for error texts.
    :raises ValueError: the calls do not match the moves.
    """
    moves = [move for samples in recordings for move in find_moves(samples)]
    if commands:
        moves = join_commands(moves, commands, commands_name)
    # After the calls are known: a motion of servoj is no trapezoid, on any arm.
    moves = without_chance_fits(moves)
    joint, linear = (estimators.left_out(moves, kind) for kind in (Kind.JOINT, Kind.LINE))
    found: dict[str, Result] = {
        'start_time': estimators.start_time(moves),
        **{ending.value: estimators.stop_ramp(moves, ending) for ending in estimators.STOPS},
        'turn_ratio': estimators.turn_ratio(moves),
        'timed_joint_acceleration': joint[0],
        'timed_joint_speed': joint[1],
        'timed_linear_acceleration': linear[0],
        'timed_linear_speed': linear[1],
        'idle_between_moves': estimators.idle_between_moves(moves),
        **blend_laws(moves),
        **servo_laws(moves),
        **estimators.arm_figures(recordings),
        **estimators.packet_gaps(recordings),
    }
    for name, reason in _LATER.items():
        found[name] = Unknown(reason=reason, experiment=_NO_EXPERIMENT)
    return Identification(moves=moves, results={name: found[name] for name in LAWS})
