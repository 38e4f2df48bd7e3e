# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The sentences of an outcome that are the same however a goal is fed."""

from __future__ import annotations

from ur_cartesian_driver.execution.goal.temporary_tcp import same_tcp, TemporaryTcp
from ur_cartesian_driver.motion.state.robot_state import RobotState


def failure_text(clause: str, location: str) -> str:
    """Return the sentence of a goal that did not succeed: what happened, and where."""
    text = clause if location in clause else f'{clause} ({location})'
    return text[:1].upper() + text[1:] + '.'


def tcp_report(temporary_tcp: TemporaryTcp | None, packet: RobotState | None) -> tuple[str, ...]:
    """Return the report's line about a TCP that was set for the goal."""
    if temporary_tcp is None:
        return ()
    if not temporary_tcp.is_restored:
        return (
            'the TCP of the robot was set for the goal, and is not back yet: no goal is taken '
            'until it is',
        )
    if packet is not None and same_tcp(packet.T_flange_tcp, temporary_tcp.T_flange_original):
        return ('the TCP of the robot was set for the goal, and is what it was before',)
    return (
        'the TCP of the robot was set for the goal; somebody else has set another one since, '
        'which is left alone',
    )
