# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The page on valves: its command prints what it shows, and its path plans with the file."""

import re

from checkout import CHECKOUT, needs_checkout
from pages import assert_shows, console_examples

from ur_cartesian_driver.cli import main
from ur_cartesian_driver.goal_files.goal_file import read_goal_file
from ur_cartesian_driver.goal_files.lead_file import read_leads
from ur_cartesian_driver.path import Path

PAGE = CHECKOUT / 'doc' / 'valves.md'
pytestmark = needs_checkout


def block(language):
    (text,) = re.findall(
        rf'^```{language}\n(.*?)^```$', PAGE.read_text(), re.DOTALL | re.MULTILINE
    )
    return text


def test_the_page_from_the_measurement_to_the_plan(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    ((((_, *words),), shown),) = console_examples(PAGE)
    assert main(words) == 0
    assert_shows(shown, capsys.readouterr().out)
    (written,) = read_leads('leads.yaml')
    lines, commands = re.findall(r'^```yaml\n(.*?)^```$', PAGE.read_text(), re.DOTALL | re.M)
    (tmp_path / 'shown.yaml').write_text(lines)
    (shown_lead,) = read_leads('shown.yaml')
    assert (shown_lead.name, shown_lead.output, shown_lead.pin) == (
        written.name,
        written.output,
        written.pin,
    )
    assert (shown_lead.open, shown_lead.close) == (written.open, written.close)
    assert [each.lead for each in read_goal_file(commands).io_commands] == ['valve_1'] * 2
    exec(block('python'), {})
    assert [each.lead for each in Path.load('bead.yaml').goal().io_commands] == ['valve_1'] * 2
    for option in (['--lead-file', 'leads.yaml'], ['-p', 'lead_file:=leads.yaml']):
        assert main(['validate', 'bead.yaml', *option]) == 0
        said = capsys.readouterr().out
        assert '0.060 s ahead' in said
        assert '0.035 s ahead' in said
    assert main(['validate', 'bead.yaml']) == 1
    assert 'the driver knows no leads' in capsys.readouterr().err
