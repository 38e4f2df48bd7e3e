# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Findings of a check of a robot."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import Enum
from typing import Any


class Verdict(Enum):
    """The meaning of a finding for this driver."""

    OK = 'ok'
    #: Worth knowing: some functions do not work, or the robot differs from expectations.
    NOTE = 'note'
    #: The driver cannot work with the robot in this condition.
    PROBLEM = 'problem'
    SKIPPED = 'skipped'


@dataclass(frozen=True, slots=True, kw_only=True)
class Finding:
    """
    The outcome of one check.

    :param check: name of the check, as in the table of doc/robot_program.md.
    :param text: one sentence.
    :param data: the numbers in the text, for the report; never the robot's identity or address.
    """

    check: str
    verdict: Verdict
    text: str
    data: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True, slots=True, kw_only=True)
class RobotAddress:
    """Address and ports of a robot."""

    host: str
    rtde_port: int = 30004
    primary_port: int = 30001
    dashboard_port: int = 29999
    robot_api_port: int = 80


def ok(check: str, text: str, **data: Any) -> Finding:
    """Return a finding that matches the expectation."""
    return Finding(check=check, verdict=Verdict.OK, text=text, data=data)


def note(check: str, text: str, **data: Any) -> Finding:
    """Return a finding worth knowing."""
    return Finding(check=check, verdict=Verdict.NOTE, text=text, data=data)


def problem(check: str, clause: str, **data: Any) -> Finding:
    """Return a finding that keeps the driver from working; a full stop is added to the clause."""
    text = f'{clause.rstrip(".")}.'
    return Finding(check=check, verdict=Verdict.PROBLEM, text=text, data=data)


def skipped(check: str, reason: str) -> Finding:
    """Return the finding for a check that was not possible; the reason is a clause."""
    return Finding(check=check, verdict=Verdict.SKIPPED, text=f'{reason}.')
