# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Output commands that name a lead come earlier by its dead time."""

from dataclasses import replace
import re

import pytest

from ur_cartesian_driver.motion.errors import InvalidGoal
from ur_cartesian_driver.motion.goal.goal import IOCommand, OutputKind
from ur_cartesian_driver.motion.goal.leads import Lead, with_lead_times
from ur_cartesian_driver.planning import PlanningOptions

VALVE = Lead(name='valve_1', output=OutputKind.STANDARD_DIGITAL, pin=2, open=0.06, close=0.035)
ON = IOCommand(
    waypoint=1, offset=0.0, output=OutputKind.STANDARD_DIGITAL, pin=2, value=1.0, lead='valve_1'
)
OFF = replace(ON, waypoint=2, value=0.0)


def test_it_is_the_time_to_open_where_the_output_goes_on_and_to_close_where_it_goes_off():
    on, off = with_lead_times((ON, OFF), (VALVE,), 'leads.yaml')
    assert on == replace(ON, offset=-0.06, lead='')
    assert off == replace(OFF, offset=-0.035, lead='')


def test_a_lead_of_the_command_itself_is_added():
    (on,) = with_lead_times((replace(ON, offset=-0.01),), (VALVE,), '')
    assert on.offset == pytest.approx(-0.07)


def test_a_command_without_a_lead_stays_as_it_is():
    plain = replace(ON, lead='')
    assert with_lead_times((plain,), (VALVE,), '') == (plain,)
    assert with_lead_times((plain,), (), '') == (plain,)


def test_any_analog_value_but_zero_opens():
    gun = replace(VALVE, output=OutputKind.STANDARD_ANALOG, pin=0)
    command = replace(ON, output=OutputKind.STANDARD_ANALOG, pin=0, value=0.3)
    half, zero = with_lead_times((command, replace(command, value=0.0)), (gun,), '')
    assert (half.offset, zero.offset) == (-0.06, -0.035)


@pytest.mark.parametrize(
    ('changes', 'leads', 'words'),
    [
        (
            {'lead': 'valve_2'},
            (VALVE, replace(VALVE, name='gun')),
            "io_commands[1].lead is 'valve_2', but leads.yaml has only valve_1, gun; use one of "
            'these, or measure it with "ur-cartesian valve".',
        ),
        (
            {},
            (),
            "io_commands[0].lead is 'valve_1', but the driver knows no leads; set its parameter "
            'lead_file to the file that "ur-cartesian valve" writes.',
        ),
        (
            {'pin': 3},
            (VALVE,),
            "io_commands[1].lead is 'valve_1', measured on standard digital output 2, but the "
            'command switches standard digital output 3; name the lead of this output.',
        ),
        (
            {'offset': 0.1},
            (VALVE,),
            "io_commands[1].lead is 'valve_1', but the offset is 0.1 s: an output switches ahead "
            'of its place or after it; set the offset to 0, and move the place by a distance.',
        ),
    ],
)
def test_a_name_that_cannot_be_meant_is_refused(changes, leads, words):
    with pytest.raises(InvalidGoal) as refusal:
        with_lead_times((ON, replace(OFF, **changes)), leads, 'leads.yaml')
    assert str(refusal.value) == words


@pytest.mark.parametrize(
    ('changes', 'words'),
    [
        ({'name': ''}, 'the name is empty'),
        ({'open': -0.01}, "open of 'valve_1' is -0.01 s, but a dead time is from 0 to 1 s"),
        ({'close': 35.0}, "close of 'valve_1' is 35 s"),
        ({'close': float('nan')}, "close of 'valve_1' is nan s"),
        ({'pin': 8}, "the pin of 'valve_1' is 8"),
    ],
)
def test_no_lead_is_absurd(changes, words):
    with pytest.raises(ValueError, match=re.escape(words)):
        replace(VALVE, **changes)


def test_the_file_is_read_once(tmp_path):
    file = tmp_path / 'leads.yaml'
    file.write_text(
        '- {name: valve_1, output: standard_digital 2, open: 0.06, close: 0.035}\n', 'utf-8'
    )
    options = PlanningOptions(lead_file=str(file))
    assert options.leads == (VALVE,)
    file.unlink()
    assert replace(options, max_points=10).leads == (VALVE,)
