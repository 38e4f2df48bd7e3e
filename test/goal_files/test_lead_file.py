# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The file of leads is written and read back, or refused with a sentence."""

from dataclasses import replace

import pytest

from ur_cartesian_driver.goal_files.lead_file import LeadFileError, read_leads, write_lead
from ur_cartesian_driver.motion.goal.goal import OutputKind
from ur_cartesian_driver.motion.goal.leads import Lead
from ur_cartesian_driver.planning import PlanningOptions

ONE = 'name: valve_1, output: standard_digital 2, open: 0.06'
VALVE = Lead(
    name='valve_1',
    output=OutputKind.STANDARD_DIGITAL,
    pin=2,
    open=0.0604,
    close=0.0352,
    date='2026-03-02',
)
GUN = Lead(name='gun', output=OutputKind.TOOL_DIGITAL, pin=0, open=0.01, close=0.0)


@pytest.fixture
def file(tmp_path):
    return tmp_path / 'leads.yaml'


def test_leads_are_added_and_replaced(file):
    write_lead(file, VALVE)
    write_lead(file, GUN)
    assert read_leads(file) == (VALVE, GUN)
    newer = Lead(
        name='valve_1',
        output=OutputKind.STANDARD_DIGITAL,
        pin=3,
        open=0.05,
        close=0.04,
        date='2026-03-09',
    )
    write_lead(file, newer)
    assert read_leads(file) == (GUN, newer)
    assert [path.name for path in file.parent.iterdir()] == ['leads.yaml']


def test_a_date_without_quotes_and_no_date_are_fine(file):
    file.write_text(f'- {{{ONE}, close: 0, date: 2026-03-02}}\n', 'utf-8')
    assert read_leads(file)[0].date == '2026-03-02'
    file.write_text(f'- {{{ONE}, close: 0}}\n', 'utf-8')
    assert read_leads(file)[0].date == ''


def test_options_have_the_leads_of_the_file_that_they_name(file, tmp_path):
    other = tmp_path / 'other.yaml'
    write_lead(file, VALVE)
    write_lead(other, GUN)
    options = PlanningOptions(lead_file=str(file))
    assert options.leads == (VALVE,)
    assert replace(options, lead_file=str(other)).leads == (GUN,)
    assert replace(options, lead_file='').leads == ()
    file.unlink()
    assert replace(options, max_tool_speed=0.1).leads == (VALVE,)
    assert replace(options, leads=(GUN,)).leads == (GUN,)
    assert PlanningOptions(lead_file=str(file), leads=(GUN,)).leads == (GUN,)


@pytest.mark.parametrize(
    ('text', 'words'),
    [
        ('', 'has no leads; write a list'),
        ('valve_1: {open: 0.06}', 'has no leads; write a list'),
        ('- [', 'is not YAML: '),
        ('- {date: 2026-02-31}', 'is not YAML: '),
        ('- valve_1', "lead 1: 'valve_1' is no lead; give name, output, open, close"),
        (f'- {{{ONE}}}', 'lead 1: close is missing'),
        ('- {name: no, output: tool_digital 0, open: 0, close: 0}', 'name is False, which is no'),
        (
            '- {name: , output: tool_digital 0, open: 0, close: 0}',
            'name is None, which is no text',
        ),
        (f'- {{{ONE}, close: 0.03,\n   close: 0.04}}', 'line 2: close occurs twice; remove one'),
        (f'- {{{ONE}, close: 1:30}}', 'line 1: 1:30 is octal or sexagesimal in YAML; write it'),
        (f'- {{{ONE}, close: 0.03, shut: 0.03}}', 'lead 1: shut is not a field'),
        (f'- {{{ONE}, close: 35 ms}}', "lead 1: close is '35 ms', but must be a number of sec"),
        (
            f'- {{{ONE}, close: 1{"0" * 400}}}',
            'lead 1: close is 10000000000000000000..., which is too large for a time.',
        ),
        (f'- {{{ONE}, close: true}}', 'lead 1: close is True, but must be a number of seconds'),
        (f'- {{{ONE}, close: 35}}', "lead 1: close of 'valve_1' is 35 s, but a dead time is"),
        (f'- {{{ONE}, close: -0.03}}', "lead 1: close of 'valve_1' is -0.03 s"),
        (f'- {{{ONE}, close: .nan}}', "lead 1: close of 'valve_1' is nan s"),
        ('- {name: a, output: digital 2, open: 0, close: 0}', "lead 1: output is 'digital 2'"),
        ('- {name: a, output: tool_digital 2, open: 0, close: 0}', 'its pin is 2, but there are'),
        ('- {name: "", output: tool_digital 1, open: 0, close: 0}', 'lead 1: the name is empty'),
        (
            f'- {{{ONE}, close: 0}}\n- {{{ONE}, close: 0}}',
            "lead 2: 'valve_1' is named twice; name each valve once.",
        ),
    ],
)
def test_what_is_wrong_is_said_in_one_sentence_and_kept(file, text, words):
    file.write_text(text, 'utf-8')
    with pytest.raises(LeadFileError) as refusal:
        read_leads(file)
    message = str(refusal.value)
    assert message.startswith(str(file))
    assert words in message
    assert message.endswith('.')
    assert '\n' not in message
    with pytest.raises(LeadFileError):
        write_lead(file, VALVE)
    assert file.read_text('utf-8') == text


def test_a_missing_file_is_refused(file):
    with pytest.raises(LeadFileError, match='cannot be read: No such file') as refusal:
        read_leads(file)
    assert '"ur-cartesian valve" writes one.' in str(refusal.value)


def test_a_file_of_leads_in_another_encoding_is_refused(file):
    file.write_bytes('- {name: Düse}'.encode('latin-1'))
    with pytest.raises(LeadFileError, match=r'leads.yaml is not UTF-8; save it as UTF-8\.$'):
        read_leads(file)
