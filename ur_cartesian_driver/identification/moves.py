# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The moves in recordings, each with its kind, its profile, and the call that made it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from ur_cartesian_driver.identification.arm_samples import ArmSamples
from ur_cartesian_driver.identification.geometry import Kind, Travel, travel_of
from ur_cartesian_driver.identification.profile import find_profile, Misfit, Profile
from ur_cartesian_driver.identification.recorded_calls import MotionCommand
from ur_cartesian_driver.identification.segmentation import follows, Piece, pieces
from ur_cartesian_driver.motion.geometry.arrays import Flags, Floats

#: Kinds that a call can make.
_KINDS = {'movej': (Kind.JOINT, Kind.EITHER), 'movel': (Kind.LINE, Kind.EITHER)}


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FoundMove:
    """
    One move in a recording.

    :param profile: of the joints, of the tool's travel or else of its turn; None = not looked
        for, or too little data.
    :param command: the call that made it; None = not known.
    """

    samples: ArmSamples
    piece: Piece
    travel: Travel
    profile: Profile | Misfit | None
    command: MotionCommand | None = None

    @property
    def kind(self) -> Kind:
        """The kind of the move, of which the call says more than the shape."""
        if self.command is not None and self.travel.kind is Kind.EITHER:
            return Kind.JOINT if self.command.name == 'movej' else Kind.LINE
        return self.travel.kind

    @property
    def rows(self) -> tuple[Floats, Flags]:
        """Times (n,) [s] of the rows, and the mask of those that follow without a gap."""
        part = slice(self.piece.begin, self.piece.end)
        return self.samples.time[part], follows(self.samples.time, self.samples.cycle)[part]

    @property
    def leading(self) -> Floats | None:
        """Travel (n,) of what is timed: the joints, the tool, or its turn."""
        travel = self.travel
        return next(
            (part for part in (travel.joint, travel.line, travel.turn) if part is not None), None
        )

    def with_command(self, command: MotionCommand) -> FoundMove:
        """Return the move with the call that made it."""
        return replace(self, command=command)


def find_moves(samples: ArmSamples) -> list[FoundMove]:
    """Return the moves of a recording in the order of time."""
    moves = []
    for piece in pieces(samples):
        found = FoundMove(
            samples=samples, piece=piece, travel=travel_of(samples, piece), profile=None
        )
        if found.leading is not None and not (piece.ending or piece.resumed or piece.slowed):
            time, rows = found.rows
            profile = find_profile(time, found.leading, rows, may_start=not piece.chained)
            found = replace(found, profile=profile)
        moves.append(found)
    return moves


def join_commands(
    moves: Sequence[FoundMove], commands: Sequence[MotionCommand], name: str
) -> list[FoundMove]:
    """
    Give each move the call that made it.

    :param name: of the file with the calls, for error texts.
    :raises ValueError: their numbers or kinds differ.
    """
    own = [move for move in moves if not move.piece.resumed]
    if len(own) != len(commands):
        raise ValueError(
            f'calls of movej and movel in {name}: {len(commands)}, moves in the recordings: '
            f'{len(own)}; write one call for each move, in the order of the recordings'
        )
    joined = iter(commands)
    found = []
    for i, move in enumerate(moves, 1):
        if move.piece.resumed:
            found.append(move)
            continue
        command = next(joined)
        if move.travel.kind is not Kind.OTHER and move.travel.kind not in _KINDS[command.name]:
            raise ValueError(
                f'{name} says {command.name} for move {i}, but the recording '
                f'{move.samples.name} shows a {move.travel.kind.value} at '
                f'{move.samples.time[move.piece.moving[0]]:.2f} s'
            )
        found.append(move.with_command(command))
    return found
