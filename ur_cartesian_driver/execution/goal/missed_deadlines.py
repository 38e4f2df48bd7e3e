# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The signal for a goal that has missed the deadline of its state, and the reason."""

from __future__ import annotations

from ur_cartesian_driver.execution.goal.feeder import Capabilities
from ur_cartesian_driver.execution.goal.goal_monitor import GoalMonitor
from ur_cartesian_driver.execution.goal.goal_transitions import GoalState, is_at_rest
from ur_cartesian_driver.execution.goal.outcome_codes import GoalSignal, Meaning
from ur_cartesian_driver.execution.goal.output_guard import OutputGuard
from ur_cartesian_driver.execution.goal.temporary_tcp import TemporaryTcp
from ur_cartesian_driver.execution.goal.timeouts import ARMING_TIMEOUT, STOP_TIMEOUT


def missed_deadline(
    state: GoalState,
    monitor: GoalMonitor,
    can: Capabilities,
    tcp: TemporaryTcp | None,
    guard: OutputGuard,
) -> Meaning:
    """
    Return the signal for a missed deadline, with a clause for the outcome's text.

    :param state: a state with a deadline; not MOVING or RUNNING_OUT.
    """
    match state:
        case GoalState.ARMING:
            clause = can.preparation.explain_not_ready(monitor.latest)
            return GoalSignal.NOT_READY, clause or _why_not_armed(monitor, tcp, guard)
        case GoalState.AWAITING_POINTS:
            return GoalSignal.ABANDONED, (
                'no more points, and no word that there are none, came within '
                f'keep_open_timeout = {can.appending.append_timeout:g} s'
            )
        case GoalState.SETTLING:
            return _why_not_settled(monitor)
        case GoalState.RESTORING | GoalState.PROGRAM_LOST:
            return GoalSignal.TIMEOUT, ''
    packet = monitor.latest
    if state is GoalState.CANCELLING and packet is not None and is_at_rest(packet):
        return GoalSignal.UNANSWERED, ''
    return GoalSignal.UNCONFIRMED, (
        f'the robot did not confirm the stop within {STOP_TIMEOUT:g} s, its program was ended'
    )


def _why_not_armed(monitor: GoalMonitor, tcp: TemporaryTcp | None, guard: OutputGuard) -> str:
    packet = monitor.latest
    if not guard.is_confirmed(packet):
        return (
            f'the robot program did not confirm the safe_outputs of the goal within '
            f'{ARMING_TIMEOUT:g} s: it is paused, its command socket is dead, or RTDE carries too '
            'little'
        )
    if tcp is None:
        return f'the robot was not ready within {ARMING_TIMEOUT:g} s'
    if packet is not None and tcp.is_active(packet):
        return monitor.start_offset(packet) or ''
    return (
        f'the robot did not take the TCP of the goal within {ARMING_TIMEOUT:g} s: its program '
        'is paused, or does not know that command'
    )


def _why_not_settled(monitor: GoalMonitor) -> Meaning:
    packet, no_rest = monitor.latest, 'the arm did not come to rest'
    if packet is None or not is_at_rest(packet):
        return GoalSignal.NOT_SETTLED, no_rest
    if missed := monitor.missed_end(packet):
        return GoalSignal.DEVIATION, missed
    return GoalSignal.NOT_SETTLED, monitor.goal_violation(packet) or no_rest
