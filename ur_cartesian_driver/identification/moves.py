# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The moves in recordings, each with its kind, its profile, and the call that made it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from ur_cartesian_driver.identification.arm_samples import ArmSamples
from ur_cartesian_driver.identification.geometry import Kind, Travel, travel_of
from ur_cartesian_driver.identification.profile import find_profile, Misfit, Profile
from ur_cartesian_driver.identification.recorded_calls import MotionCommand, SetPoints
from ur_cartesian_driver.identification.segmentation import follows, Piece, pieces
from ur_cartesian_driver.motion.geometry.arrays import Flags, Floats

#: Kinds that a call can make.
_KINDS = {
    'movej': (Kind.JOINT, Kind.EITHER),
    'movel': (Kind.LINE, Kind.EITHER),
    'servoj': (Kind.SERVO,),
}
#: Time after the last call of servoj within which what moves still belongs to it [s].
_AFTER_SERVO = 0.1


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FoundMove:
    """
    One move in a recording.

    :param profile: of the joints, of the tool's travel or else of its turn; None = not looked
        for, or too little data.
    :param command: the call that made it; None = not known, or several.
    :param chain: the calls that made it: several where moves are joined by blends.
    """

    samples: ArmSamples
    piece: Piece
    travel: Travel
    profile: Profile | Misfit | None
    command: MotionCommand | None = None
    chain: tuple[MotionCommand, ...] = ()

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

    @property
    def set_points(self) -> SetPoints | None:
        """The calls of servoj that made it; None = others, or not known."""
        return self.command.set_points if self.command is not None else None

    def with_calls(self, chain: tuple[MotionCommand, ...]) -> FoundMove:
        """Return the move with the calls that made it."""
        command = chain[0] if len(chain) == 1 else None
        if command is not None and command.set_points is not None:
            return replace(self, command=command, travel=Travel(kind=Kind.SERVO), profile=None)
        return replace(self, command=command, chain=chain)

    def continued(self, by: FoundMove) -> FoundMove:
        """Return the move with another one behind it, which the same calls made."""
        moving = self.piece.moving[0], by.piece.moving[1]
        piece = replace(
            self.piece,
            end=by.piece.end,
            moving=moving,
            ending=self.piece.ending or by.piece.ending,
            slowed=self.piece.slowed or by.piece.slowed,
        )
        return replace(self, piece=piece)


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


def without_chance_fits(moves: Sequence[FoundMove]) -> list[FoundMove]:
    """
    Return the moves, without any profile if most of them fit none.

    A slow or short move may look like a trapezoid on an arm that moves by another law; the figures
    of such a profile would be wrong.
    """
    fits, misfits = (
        sum(isinstance(move.profile, kind) for move in moves) for kind in (Profile, Misfit)
    )
    if fits >= misfits:
        return list(moves)
    return [
        replace(move, profile=None) if isinstance(move.profile, Profile) else move
        for move in moves
    ]


def join_commands(
    moves: Sequence[FoundMove], commands: Sequence[MotionCommand], name: str
) -> list[FoundMove]:
    """
    Give each move the call that made it.

    What calls of servoj in a row made is one move, and so are moves that blends join.

    :param name: of the file with the calls, for error texts.
    :raises ValueError: their numbers or kinds differ.
    """
    found, is_matched = _joined(moves, commands, True)
    if not is_matched:  # A radius without a blend, as at the end of a program.
        found, is_matched = _joined(moves, commands, False)
    if not is_matched:
        number = sum(not move.piece.resumed for move in found)
        motions = 1 + sum(not command.r for command in commands[:-1])
        raise ValueError(
            f'motions in {name}: {motions}, moves in the recordings: {number}; write one call for '
            'each move (of servoj and of blends, all calls of a motion), in the order of the '
            'recordings'
        )
    for i, move in enumerate(found, 1):
        kind, call = move.travel.kind, move.command or next(iter(move.chain), None)
        if call is not None and kind is not Kind.OTHER and kind not in _KINDS[call.name]:
            raise ValueError(
                f'{name} says {call.name} for move {i}, but the recording '
                f'{move.samples.name} shows a {kind.value} at '
                f'{move.samples.time[move.piece.moving[0]]:.2f} s'
            )
    return found


def _joined(
    moves: Sequence[FoundMove], commands: Sequence[MotionCommand], straight: bool
) -> tuple[list[FoundMove], bool]:
    """
    Return moves with their calls, and whether each has some and none are left.

    :param straight: whether moves that show no corner may have several calls with radii, too.
    """
    found: list[FoundMove] = []
    taken = 0
    for move in moves:
        if found and _goes_on(found[-1], move):
            found[-1] = found[-1].continued(move)
            continue
        if not move.piece.resumed:
            end = taken + 1
            while (straight or move.travel.kind is Kind.OTHER) and end < len(commands):
                if commands[end - 1].r is None:
                    break
                end += 1
            chain, taken = tuple(commands[taken:end]), end
            move = move.with_calls(chain) if chain else move
        found.append(move)
    return found, taken == len(commands)


def _goes_on(before: FoundMove, move: FoundMove) -> bool:
    """Return whether a move belongs to the motion of servoj before it."""
    points = before.set_points
    if points is None or move.samples is not before.samples:
        return False
    time, begin = move.samples.time, before.piece.moving[0]
    since = time[move.piece.moving[0]] - time[begin]
    rest = points.rest(move.samples.target_q[begin].tolist())
    return bool(since + rest < sum(points.times) + _AFTER_SERVO)
