# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""What it means for a goal that the time in its present state is up."""

from __future__ import annotations

from ur_cartesian_driver.execution.goal.feeder import Feeder
from ur_cartesian_driver.execution.goal.goal_transitions import GoalState, is_at_rest
from ur_cartesian_driver.execution.goal.outcome_codes import GoalSignal, Meaning
from ur_cartesian_driver.execution.goal.output_guard import OutputGuard
from ur_cartesian_driver.execution.goal.temporary_tcp import TemporaryTcp
from ur_cartesian_driver.execution.goal.timeouts import ARMING_TIMEOUT, STOP_TIMEOUT


def missed_deadline(
    state: GoalState, feeder: Feeder, tcp: TemporaryTcp | None, guard: OutputGuard | None
) -> Meaning:
    """
    Return the signal, with a clause for the outcome's text.

    :param state: any that has a deadline, but those in which the robot program runs points.
    """
    match state:
        case GoalState.ARMING:
            return GoalSignal.NOT_READY, _why_not_armed(feeder, tcp, guard)
        case GoalState.AWAITING_POINTS:
            return GoalSignal.ABANDONED, (
                'no more points, and no word that there are none, came within '
                f'keep_open_timeout = {feeder.append_timeout:g} s'
            )
        case GoalState.SETTLING:
            return _why_not_settled(feeder)
        case GoalState.RESTORING | GoalState.PROGRAM_LOST:
            return GoalSignal.TIMEOUT, ''
    packet = feeder.monitor.latest
    if state is GoalState.CANCELLING and packet is not None and is_at_rest(packet):
        return GoalSignal.UNANSWERED, ''
    return GoalSignal.UNCONFIRMED, (
        f'the robot did not confirm the stop within {STOP_TIMEOUT:g} s, its program was ended'
    )


def _why_not_armed(feeder: Feeder, tcp: TemporaryTcp | None, guard: OutputGuard | None) -> str:
    packet = feeder.monitor.latest
    if clause := feeder.explain_not_ready(packet):
        return clause
    if guard is not None and not guard.is_confirmed(packet):
        return (
            f'the robot program did not confirm the safe_outputs of the goal within '
            f'{ARMING_TIMEOUT:g} s: it is paused, its command socket is dead, or RTDE carries too '
            'little; nothing was moved'
        )
    if packet is not None and tcp is not None and tcp.is_active(packet):
        return feeder.monitor.start_offset(packet) or ''
    return (
        f'the robot did not take the TCP of the goal within {ARMING_TIMEOUT:g} s: its program '
        'is paused, or does not know that command; nothing was moved'
    )


def _why_not_settled(feeder: Feeder) -> Meaning:
    packet, no_rest = feeder.monitor.latest, 'the arm did not come to rest'
    if packet is None or not is_at_rest(packet):
        return GoalSignal.NOT_SETTLED, no_rest
    if missed := feeder.monitor.missed_end(packet):
        return GoalSignal.DEVIATION, missed
    return GoalSignal.NOT_SETTLED, feeder.monitor.goal_violation(packet) or no_rest
