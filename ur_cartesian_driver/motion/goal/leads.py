# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Leads: the times by which outputs have to switch early, because their valves act late."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import isfinite

from ur_cartesian_driver.motion.errors import InvalidGoal
from ur_cartesian_driver.motion.goal.goal import IOCommand, MAX_OUTPUT_LEAD, OutputKind
from ur_cartesian_driver.motion.goal.output_names import output_fault, output_name


@dataclass(frozen=True, slots=True, kw_only=True)
class Lead:
    """
    The dead times of a valve, or of another tool that acts late.

    :raises ValueError: the name is empty, a time is out of its range, or there is no such output.
    """

    name: str
    output: OutputKind
    pin: int
    #: Time from switching the output on until the valve is open [s].
    open: float
    #: Time from switching the output off until the valve is closed [s].
    close: float
    #: The day of the measurement, as text.
    date: str = ''

    def __post_init__(self) -> None:
        """Check name, output and times."""
        if not self.name:
            raise ValueError('the name is empty; give one, such as valve_1')
        for field, time in (('open', self.open), ('close', self.close)):
            if not isfinite(time) or not 0.0 <= time <= MAX_OUTPUT_LEAD:
                raise ValueError(
                    f'{field} of {self.name!r} is {time:g} s, but a dead time is from 0 to '
                    f'{MAX_OUTPUT_LEAD:g} s; give the measured one in seconds'
                )
        if (fault := output_fault(self.output, self.pin, 0.0)) is not None:
            raise ValueError(f'the {fault[0]} of {self.name!r} {fault[1]}; {fault[2]}')

    def dead_time(self, value: float) -> float:
        """Return the dead time after a command with a value: 0 closes, all others open [s]."""
        return self.open if value else self.close


def with_lead_times(
    commands: Sequence[IOCommand], leads: Sequence[Lead], file: str
) -> tuple[IOCommand, ...]:
    """
    Return output commands without names of leads, each earlier by the dead time of its lead.

    :param file: the parameter ``lead_file``, for refusals.
    :raises InvalidGoal: a name is unknown, its lead belongs to another output, the command also
        has a positive offset, or offset and dead time together are too long.
    """
    by_name = {lead.name: lead for lead in leads}
    return tuple(
        _earlier(command, by_name, f'io_commands[{i}].lead', file) if command.lead else command
        for i, command in enumerate(commands)
    )


def _earlier(command: IOCommand, leads: dict[str, Lead], field: str, file: str) -> IOCommand:
    lead = leads.get(command.lead)
    if lead is None and not leads:
        raise InvalidGoal(
            field,
            f'is {command.lead!r}, but the driver knows no leads',
            'set its parameter lead_file to the file that "ur-cartesian valve" writes',
        )
    if lead is None:
        raise InvalidGoal(
            field,
            f'is {command.lead!r}, but {file or "the driver"} has only {", ".join(leads)}',
            'use one of these, or measure it with "ur-cartesian valve"',
        )
    if (lead.output, lead.pin) != (command.output, command.pin):
        raise InvalidGoal(
            field,
            f'is {command.lead!r}, measured on {output_name(lead.output, lead.pin)}, but the '
            f'command switches {output_name(command.output, command.pin)}',
            'name the lead of this output',
        )
    if command.offset > 0.0:  # in scaled time, but a lead is in real time
        raise InvalidGoal(
            field,
            f'is {command.lead!r}, but the offset is {command.offset:g} s: an output switches '
            'ahead of its place or after it',
            'set the offset to 0, and move the place by a distance',
        )
    offset = command.offset - lead.dead_time(command.value)
    if offset < -MAX_OUTPUT_LEAD:
        raise InvalidGoal(
            field,
            f'is {command.lead!r}, whose dead time of {lead.dead_time(command.value):g} s and the '
            f'offset of {command.offset:g} s are together more than {MAX_OUTPUT_LEAD:g} s',
            'set the offset to 0',
        )
    return replace(
        command,
        offset=offset,
        lead='',
        lead_name=lead.name,
    )
