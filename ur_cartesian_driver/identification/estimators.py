# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The estimators: each finds one law, or a few, in the moves and packets of recordings.

A law is found only from moves that show it, and only if the moves follow the shape that the law
has; a move that does not is named in place of a number.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from math import sqrt

import numpy as np

from ur_cartesian_driver.identification.arm_errors import (
    ArmErrors,
    find_arm_errors,
    find_noise,
)
from ur_cartesian_driver.identification.arm_samples import ArmSamples
from ur_cartesian_driver.identification.geometry import Kind
from ur_cartesian_driver.identification.least_squares import (
    combined,
    correlated_mean,
    Measured,
    student,
)
from ur_cartesian_driver.identification.moves import FoundMove
from ur_cartesian_driver.identification.profile import find_profile, Misfit, Profile
from ur_cartesian_driver.identification.segmentation import Ending
from ur_cartesian_driver.identification.stop_ramp import find_ramp, StopRamp
from ur_cartesian_driver.motion.twin.laws import LAWS
from ur_cartesian_driver.motion.twin.twin import Estimate

#: Relative tolerance within which a profile matches its call, so that its axis leads.
_LEADS = 1e-3


@dataclass(frozen=True, slots=True, kw_only=True)
class Unknown:
    """A law that was not identified: the reason, and the experiment that would do it."""

    reason: str
    experiment: str

    def __str__(self) -> str:
        return f'{self.reason}; {self.experiment}'


#: What one estimator found of a law.
Result = Estimate | Unknown


def start_time(moves: Sequence[FoundMove]) -> Result:
    """Find the time within which the first motion of a program sets out."""
    profiles = [
        move.profile
        for move in moves
        if isinstance(move.profile, Profile) and move.profile.start and not move.piece.chained
    ]
    starts = [profile.start for profile in profiles if profile.start]
    steps = sum(profile.step > 0.0 for profile in profiles)
    return result_of(
        'start_time',
        starts,
        f'{plural(len(starts), "start")} of programs'
        + (f', {steps} with a rate that changes once a cycle' if steps else ''),
        _misfits(moves) or 'no move sets out as the first one of a program does',
        'record a program from its start, with a move of a second or more',
        left_over=_rms(profiles),
    )


def turn_ratio(moves: Sequence[FoundMove]) -> Result:
    """
    Find the angular speed of a line for each m/s of its v, where the turn leads.

    The turn leads where its speed and acceleration are those of the call by the same factor.
    """
    found: list[Measured] = []
    profiles, odd = [], 0
    for move in moves:
        command = move.command
        if move.kind is not Kind.LINE or command is None:
            continue
        a, v = command.a, command.v
        if a is None or v is None or command.t is not None:
            continue
        if move.travel.turn is None or _translation_leads(move, a):
            continue
        time, rows = move.rows
        turn = find_profile(time, move.travel.turn, rows, may_start=not move.piece.chained)
        if not isinstance(turn, Profile):
            odd += isinstance(turn, Misfit)
            continue
        ratios = [_times(turn.acceleration, 1.0 / a)]
        if turn.speed is not None:
            ratios.append(_times(turn.speed, 1.0 / v))
            if abs(ratios[0].value / ratios[1].value - 1.0) > 0.01:
                odd += 1
                continue
        found.append(min(ratios, key=lambda ratio: ratio.error))
        profiles.append(turn)
    return result_of(
        'turn_ratio',
        found,
        f'{plural(len(found), "line")} in which the turn leads',
        f'{plural(odd, "turn")} of lines followed no law that is known'
        if odd
        else 'no line whose turn leads, with a and v that are known',
        'record a movel that turns the tool by 45 degrees on the spot, and name its a and v',
        left_over=_rms(profiles),
    )


def _translation_leads(move: FoundMove, asked: float) -> bool:
    """Return whether the travel of the tool has the acceleration of its call [m/s^2]."""
    profile = move.profile
    if move.travel.line is None or not isinstance(profile, Profile):
        return False
    tolerance = _LEADS + 3.0 * profile.acceleration.error / asked
    return abs(profile.acceleration.value / asked - 1.0) < tolerance


def left_out(moves: Sequence[FoundMove], kind: Kind) -> tuple[Result, Result]:
    """
    Find acceleration and speed of moves of a kind whose call left both out.

    A line whose turn leads has neither of them; whether it leads depends on the turn ratio.
    """
    call = 'movej' if kind is Kind.JOINT else 'movel'
    names = _LEFT_OUT[kind]
    accelerations, speeds, profiles, quotients = [], [], [], []
    odd = turning = 0
    for move in moves:
        command = move.command
        if command is None or command.name != call or move.kind is not kind:
            continue
        if command.a is not None or command.v is not None:
            continue
        if not isinstance(move.profile, Profile):
            odd += isinstance(move.profile, Misfit)
        elif kind is Kind.LINE and _turn_may_lead(move):
            turning += 1
        elif command.t is not None:
            quotient = move.profile.speed_squared_by_acceleration
            quotients += [] if quotient is None else [quotient]
        else:
            accelerations.append(move.profile.acceleration)
            speeds += [move.profile.speed] if move.profile.speed else []
            profiles.append(move.profile)
    reason = f'no {call} without a, v and t among the calls'
    if odd:
        reason = f'{plural(odd, call)} without a and v followed no law that is known'
    elif turning:
        reason = f'{plural(turning, call)} turned the tool so far that the turn may lead'
    elif quotients:
        whole = combined(quotients)
        reason = (
            f'{plural(len(quotients), call)} with t show only v^2/a, {whole.value:.5g} +- '
            f'{whole.half_width:.1g} {"rad" if kind is Kind.JOINT else "m"}'
        )
    experiment = f'record a {call} without a, v and t that cruises, and name the call'
    evidence = f'{plural(len(profiles), call)} without a and v'
    return (
        result_of(names[0], accelerations, evidence, reason, experiment, left_over=_rms(profiles)),
        result_of(names[1], speeds, evidence, reason, experiment, left_over=_rms(profiles)),
    )


def _turn_may_lead(move: FoundMove) -> bool:
    """Return whether the turn of a line leads by the least turn ratio that there is."""
    line, turn = move.travel.line, move.travel.turn
    if line is None:
        return True
    return turn is not None and float(np.ptp(turn)) > LAWS['turn_ratio'].low * float(np.ptp(line))


_LEFT_OUT = {
    Kind.JOINT: ('timed_joint_acceleration', 'timed_joint_speed'),
    Kind.LINE: ('timed_linear_acceleration', 'timed_linear_speed'),
}


def idle_between_moves(moves: Sequence[FoundMove]) -> Result:
    """
    Find the time between the end of a move and the beginning of the next one in a chain.

    The move between two gaps bounds both: where it seems to begin late it seems to end early, so
    their errors are correlated.
    """
    chains: list[list[Profile]] = []
    last: FoundMove | None = None
    for before, after in pairwise(moves):
        if before.samples is not after.samples:
            continue
        if not after.piece.directly_follows(before.piece):
            continue
        if not (isinstance(before.profile, Profile) and isinstance(after.profile, Profile)):
            continue
        if before is last:
            chains[-1].append(after.profile)
        else:
            chains.append([before.profile, after.profile])
        last = after
    gaps = [
        correlated_mean(
            [_gap(*pair) for pair in pairwise(chain)],
            np.array([-each.begin_and_end for each in chain[1:-1]]),
        )
        for chain in chains
    ]
    number = sum(len(chain) - 1 for chain in chains)
    return result_of(
        'idle_between_moves',
        gaps,
        f'{plural(number, "pair")} of moves in a row',
        'no two moves in a row whose profiles are known',
        'record a program of three joint moves without blends',
        left_over=_rms([profile for chain in chains for profile in chain]),
    )


def _gap(before: Profile, after: Profile) -> Measured:
    end, begin = before.end, after.begin
    return Measured(
        value=begin.value - end.value,
        error=sqrt(begin.error**2 + end.error**2),
        freedom=min(begin.freedom, end.freedom),
    )


#: The endings whose ramps have a law -> the event, and the experiment that shows it.
STOPS = {
    Ending.PROGRAM_STOP: (
        'program was stopped',
        'stop a program while a long move cruises, and record runtime_state',
    ),
    Ending.PAUSE: (
        'program was paused',
        'pause a program while a long move cruises, and record runtime_state',
    ),
    Ending.PROTECTIVE_STOP: (
        'protective stop happened',
        'a protective stop is not provoked; if one happens on a cruising move, keep its recording',
    ),
}


def stop_ramp(moves: Sequence[FoundMove], ending: Ending) -> Result:
    """Find the time from full speed to rest of one kind of stop."""
    ramps, odd, unsteady, slowed = [], 0, 0, 0
    for move in moves:
        if move.piece.ending is not ending or move.leading is None:
            continue
        if move.piece.slowed:
            slowed += 1
            continue
        time, rows = move.rows
        ramp = find_ramp(time, move.leading, rows)
        odd += isinstance(ramp, Misfit)
        unsteady += ramp is None
        if isinstance(ramp, StopRamp):
            ramps.append(ramp.time)
    event, experiment = STOPS[ending]
    reason = f'no {event} in motion'
    if odd:
        reason = f'{plural(odd, "stop")} followed no even ramp'
    elif unsteady:
        reason = f'{plural(unsteady, "stop")} came while the arm did not move at constant speed'
    elif slowed:
        reason = f'{plural(slowed, "stop")} came while the speed slider was below 100 %'
    return result_of(
        ending.value, ramps, plural(len(ramps), 'stop') + ' at constant speed', reason, experiment
    )


def arm_figures(recordings: Sequence[ArmSamples]) -> dict[str, Result]:
    """Find lag, friction, static error, ringing and noise of the measured joints."""
    every = [errors for samples in recordings if (errors := find_arm_errors(samples)) is not None]
    found = [errors for errors in every if errors.fits_model]
    reason = _why_no_errors(recordings, found, [each for each in every if not each.fits_model])
    noises = [noise for samples in recordings if (noise := find_noise(samples)) is not None]
    experiment = (
        'record actual_q beside target_q while single joints turn fast and slowly, with a second '
        'of rest after each'
    )
    results: dict[str, Result] = {}
    for name, most in _MAX_WIDTH.items():
        used = [errors for errors in found if name not in _RINGING or errors.cycle < MAX_CYCLE]
        parts: list[Measured] = [getattr(errors, name) for errors in used]
        evidence = plural(sum(errors.joints for errors in used), 'moving joint')
        left = f'{1e6 * max((errors.rms for errors in used), default=0.0):.3g} urad rms'
        result = result_of(name, parts, evidence, reason, experiment, left_over=left)
        results[name] = unless_wide(name, result, parts, most, experiment)
    results['position_noise'] = result_of(
        'position_noise',
        noises,
        plural(len(noises), 'recording'),
        'no measured joint that moves',
        experiment,
    )
    return results


def unless_wide(
    name: str,
    result: Result,
    parts: Sequence[Measured],
    most: Callable[[float], float],
    experiment: str,
) -> Result:
    """
    Return a result, unless its interval is too wide to be of use.

    :param most: returns the widest useful half of the interval by the value.
    """
    if isinstance(result, Unknown):
        return result
    whole = combined(parts)
    if whole.half_width <= most(whole.value):
        return result
    unit = f' {LAWS[name].unit}' if LAWS[name].unit else ''
    return Unknown(
        reason=f'the recordings leave it at {whole.value:.2g} +- {whole.half_width:.1g}{unit}',
        experiment=experiment,
    )


def _why_no_errors(
    recordings: Sequence[ArmSamples], found: Sequence[ArmErrors], odd: Sequence[ArmErrors]
) -> str:
    """
    Return why recordings do not show a figure of the arm.

    :param found: the errors of joints that follow the known law; ``odd``: those of others.
    """
    if found:  # the figure needs packets closer to each other
        return f'packets every {1e3 * found[0].cycle:.3g} ms are too rare'
    if all(samples.actual_q is None for samples in recordings):
        return 'no recording has actual_q'
    if not odd:
        return 'no recording with measured joints that move and rest again'
    worst = max(odd, key=lambda errors: errors.rms)
    return (
        f'the joints follow their targets by another law in {plural(len(odd), "recording")}: '
        f'{1e6 * worst.rms:.3g} urad are left, of which {1e6 * worst.noise:.3g} are noise'
    )


#: Packets that are further apart [s] do not show when the acceleration changes, nor how the arm
#: rings then.
MAX_CYCLE = 0.005
_RINGING = ('acceleration_error', 'ringing_frequency', 'ringing_decay')
#: Widest useful half of an interval, by value.
_MAX_WIDTH: dict[str, Callable[[float], float]] = {
    'lag': lambda value: max(3e-4, 0.3 * value),
    'friction': lambda value: max(3e-5, 0.3 * value),
    'static_error': lambda value: max(3e-5, 0.3 * value),
    'acceleration_error': lambda value: max(2e-5, 0.3 * value),
    'ringing_frequency': lambda value: 0.3 * value,
    'ringing_decay': lambda value: 0.5 * value,
}


def packet_gaps(recordings: Sequence[ArmSamples]) -> dict[str, Result]:
    """Find the shares of packets after which one is missing, and after which more are."""
    single = several = packets = 0
    for samples in recordings:
        missing = np.round(np.diff(samples.time) / samples.cycle) - 1.0
        packets += len(missing)
        single += int((missing == 1.0).sum())
        several += int((missing > 1.0).sum())
    evidence = plural(packets, 'packet')
    experiment = 'record a minute of RTDE at its full rate'
    results: dict[str, Result] = {}
    for name, count in (('single_gaps', single), ('long_gaps', several)):
        low, high = _wilson(count, packets)
        if high - low > max(0.02, 0.5 * high) and packets < 20_000:
            results[name] = Unknown(
                reason=f'{packets} packets are too few to count gaps', experiment=experiment
            )
        else:
            share = count / packets
            results[name] = Estimate(
                value=share, interval=(min(low, share), max(high, share)), evidence=evidence
            )
    return results


def _wilson(count: int, total: int) -> tuple[float, float]:
    """Return the 95 % interval of a share (Wilson, 1927)."""
    z = student(float(max(total, 4)))
    middle = (count + 0.5 * z * z) / (total + z * z)
    half = z / (total + z * z) * sqrt(count * (total - count) / total + 0.25 * z * z)
    return max(middle - half, 0.0), min(middle + half, 1.0)


# ---- results -----------------------------------------------------------------------------------


def result_of(
    name: str,
    parts: Sequence[Measured],
    evidence: str,
    reason: str,
    experiment: str,
    *,
    left_over: str = '',
) -> Result:
    """Return the estimate of a law from its measurements, or why there is none."""
    if not parts:
        return Unknown(reason=reason, experiment=experiment)
    whole, law = combined(parts), LAWS[name]
    low, high = whole.value - whole.half_width, whole.value + whole.half_width
    value = min(max(whole.value, law.low), law.high)
    if abs(value - whole.value) > 2.0 * whole.half_width:
        return Unknown(
            reason=f'it came out as {f"{whole.value:.3g} {law.unit}".rstrip()}; it '
            f'{law.problem(whole.value)}',
            experiment=experiment,
        )
    # At a bound of the law the estimate itself may lie beyond it.
    low, high = min(low, value), max(high, value)
    if low < law.low:
        low, high = law.low, max(high, law.low + whole.half_width)
    high = min(high, law.high)
    return Estimate(value=value, interval=(low, high), evidence=evidence, left_over=left_over)


def _times(measured: Measured, factor: float) -> Measured:
    return Measured(
        value=factor * measured.value,
        error=abs(factor) * measured.error,
        freedom=measured.freedom,
    )


def _misfits(moves: Iterable[FoundMove]) -> str:
    odd = [move.profile.rms for move in moves if isinstance(move.profile, Misfit)]
    if not odd:
        return ''
    return (
        f'{plural(len(odd), "move")} followed no trapezoid: {1e6 * max(odd):.3g} um or urad are '
        'left'
    )


def _rms(profiles: Sequence[Profile]) -> str:
    if not profiles:
        return ''
    return f'{1e6 * max(profile.fit.rms for profile in profiles):.2g} um or urad rms'


def plural(count: int, noun: str) -> str:
    """Return a number with its noun."""
    return f'{count} {noun}{"s" * (count != 1)}'
