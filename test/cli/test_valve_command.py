# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The command ``valve``: dead times by hand calculation, its questions, its file, its refusals."""

from contextlib import nullcontext
from io import StringIO
from math import hypot, sqrt
import shlex
from typing import cast, TYPE_CHECKING
from unittest.mock import Mock

import pytest

from ur_cartesian_driver.cli import main, valve_command
from ur_cartesian_driver.cli.valve_beads import Beads, dead_times
from ur_cartesian_driver.cli.valve_command import ask_distance, lay_beads
from ur_cartesian_driver.goal_files.lead_file import read_leads
from ur_cartesian_driver.motion.errors import RobotNotReady
from ur_cartesian_driver.motion.events import Progress
from ur_cartesian_driver.motion.geometry.pose import Pose
from ur_cartesian_driver.motion.goal.goal import OutputKind
from ur_cartesian_driver.motion.state.rtde_state import RobotState
from ur_cartesian_driver.path import digital

if TYPE_CHECKING:
    from ur_cartesian_driver.driver import Driver

SPEEDS = {'slow': 0.02, 'fast': 0.2}


def test_the_times_are_the_distances_by_the_difference_of_the_speeds():
    # 180 mm/s apart: 10.8 mm are 60 ms, 6.3 mm are 35 ms.
    times = dead_times(0.0108, 0.0063, **SPEEDS, reading=0.0, cycle=0.0)
    assert times.open == pytest.approx(0.060)
    assert times.close == pytest.approx(0.035)
    assert times.uncertainty == 0.0


def test_the_uncertainty_is_that_of_two_readings_and_of_the_cycle():
    # Two readings of 0.5 mm: 0.707 mm at 180 mm/s are 3.93 ms.
    ruler = dead_times(0.0108, 0.0063, **SPEEDS, reading=0.0005, cycle=0.0).uncertainty
    assert ruler == pytest.approx(0.003928, abs=1e-6)
    # Half a cycle of 2 ms to both sides has the deviation 0.577 ms: 0.1155 and 0.01155 mm.
    cycle = dead_times(0.0108, 0.0063, **SPEEDS, reading=0.0, cycle=0.002).uncertainty
    assert cycle == pytest.approx(hypot(0.1155, 0.01155) / 180.0, rel=1e-3)
    both = dead_times(0.0108, 0.0063, **SPEEDS, reading=0.0005, cycle=0.002).uncertainty
    assert both == pytest.approx(hypot(ruler, cycle))


def test_a_time_a_little_below_zero_is_zero_and_one_far_below_a_mistake():
    assert dead_times(-0.001, 0.0, **SPEEDS, reading=0.0005, cycle=0.0).open == 0.0
    limit = 3.0 * sqrt(2.0) * 0.0005  # 2.12 mm
    with pytest.raises(ValueError, match=r'the fast bead ends 2\.2 mm before the slow one'):
        dead_times(0.0, -limit - 0.00008, **SPEEDS, reading=0.0005, cycle=0.0)
    with pytest.raises(ValueError, match='the fast bead begins behind is nan; give a number'):
        dead_times(float('nan'), 0.0, **SPEEDS, reading=0.0005, cycle=0.0)


@pytest.mark.parametrize(('begins', 'ends'), [(0.0108e-3, 0.0063e-3), (0.0, 0.00002)])
def test_metres_in_place_of_millimetres_are_refused(begins, ends):
    with pytest.raises(ValueError, match=r'a ruler .* of 0\.5 mm does not show; give --measured'):
        dead_times(begins, ends, **SPEEDS, reading=0.0005, cycle=0.0)
    assert dead_times(0.0, 0.0, **SPEEDS, reading=0.0005, cycle=0.0).open == 0.0


@pytest.mark.parametrize(
    ('changes', 'words'),
    [
        ({'fast': 0.03}, 'at least twice as fast'),
        ({'length': 0.01}, '--length is 10 mm'),
        (
            {'length': 0.03, 'fast': 1.0},
            '--length is 30 mm, which --fast passes in 30 ms; lay beads that take 80 ms or more',
        ),
    ],
)
def test_beads_that_tell_nothing_are_refused(changes, words):
    fields = {'slow': 0.02, 'fast': 0.2, 'length': 0.1, 'beside': 0.01, 'along': 'x'} | changes
    with pytest.raises(ValueError, match=words):
        Beads(**fields)


def test_a_distance_is_asked_for_until_it_is_a_number(capsys):
    answers = iter(['', 'far', 'inf', '10,8 mm'])
    asked = []

    def read(question):
        asked.append(question)
        return next(answers)

    assert ask_distance('start', read) == 10.8
    assert asked[0] == 'How far behind the start of the slow bead does the fast one start [mm]? '
    assert "'far' is no number; give millimetres, like 10.8" in capsys.readouterr().out


@pytest.fixture
def valve(tmp_path, capsys):
    """Run the command on a file; return its status, its output and the file."""
    file = tmp_path / 'leads.yaml'

    def run(*words):
        output = ['--output', 'standard_digital', '2']
        status = main(['valve', 'valve_1', *output, '--lead-file', str(file), *words])
        shown = capsys.readouterr()
        return status, shown.out + shown.err, file

    return run


def test_measured_beads_are_written(valve):
    status, said, file = valve('--measured', '10.8', '6.3')
    assert status == 0
    assert said == (
        'valve_1 opens 60.0 ms after its output and closes 35.0 ms after it, each +/- 4.0 ms: '
        '+/- 0.80 mm at 200 mm/s\n'
        f'written to {file}: a driver with lead_file:={file} uses it for outputs with "lead: '
        'valve_1"\n'
    )
    (lead,) = read_leads(file)
    assert (lead.name, lead.output, lead.pin) == ('valve_1', OutputKind.STANDARD_DIGITAL, 2)
    assert (lead.open, lead.close) == (0.06, 0.035)
    assert len(lead.date) == len('2026-03-02')


def test_a_better_ruler_makes_them_better(valve):
    _, said, _ = valve('--measured', '10.8', '6.3', '--ruler', '0.05mm')
    assert 'each +/- 0.8 ms: +/- 0.15 mm at 200 mm/s' in said


@pytest.mark.parametrize(
    ('words', 'said'),
    [
        (['--measured', '-10.8', '6.3'], 'the fast bead begins 10.8 mm before the slow one'),
        (
            ['--measured', '270', '6.3'],
            'the fast bead begins 270 mm behind the slow one, which is a dead time of 1.5 s, '
            'above 1 s; give --measured in millimetres',
        ),
        ([], 'valve asks before it moves the arm, so it needs a terminal'),
        (['--fast', '0.03', '--measured', '1', '1'], 'lay one bead at least twice as fast'),
        (['--output', 'tool_digital', '2', '--measured', '1', '1'], 'its pin is 2'),
    ],
)
def test_what_cannot_be_is_refused_and_nothing_is_written(valve, words, said):
    status, text, file = valve(*words)
    assert status == 1
    assert text.startswith('ur-cartesian valve: ')
    assert said in text
    assert not file.exists()


def test_a_wrong_file_is_refused_first_and_kept(valve, tmp_path):
    (tmp_path / 'leads.yaml').write_text('points: []\n', 'utf-8')
    status, text, file = valve()
    assert status == 1
    assert 'has no leads' in text
    assert file.read_text('utf-8') == 'points: []\n'


class TerseDriver:
    """A driver whose arm is so fast that the speed is reported at the slow bead only."""

    rest_state = RobotState(timestamp=0.0, actual_q=(0.0,) * 6, actual_tcp_pose=Pose())

    def plan(self, _):
        return Mock(find_slow_stretches=list)

    def start(self, _, watch):
        for waypoint in (0, 1, 2, 7):
            watch(
                Progress(waypoint=waypoint, fraction=0.5, desired_pose=Pose(), actual_pose=Pose())
            )
        return Mock()


def test_a_bead_whose_speed_was_not_reported_tells_nothing():
    beads = Beads(slow=0.02, fast=0.2, length=0.1, beside=0.01, along='x')
    with pytest.raises(RobotNotReady, match='did not report its speed during a bead'):
        lay_beads(cast('Driver', TerseDriver()), beads, digital(2), lambda _: True)


def test_an_empty_name_is_refused_before_beads_are_laid(monkeypatch, capsys, tmp_path):
    monkeypatch.setattr(valve_command, 'ready_driver', lambda _: pytest.fail('nothing may move'))
    monkeypatch.setattr('sys.stdin', Terminal())
    monkeypatch.chdir(tmp_path)
    assert main(['valve', '', '--output', 'standard_digital', '2']) == 1
    assert 'the name is empty; give one' in capsys.readouterr().err


class Terminal(StringIO):
    def isatty(self):
        return True


def test_the_printed_command_finds_the_same_times_later(monkeypatch, capsys, tmp_path):
    """Beads of another speed and length than the default ones, measured at once, and later."""
    monkeypatch.setattr(valve_command, 'ready_driver', lambda _: nullcontext())
    monkeypatch.setattr(valve_command, 'lay_beads', lambda *_: True)
    monkeypatch.chdir(tmp_path)
    laid = [
        'valve',
        'glue 1',
        '--output',
        'tool_digital',
        '1',
        '--fast',
        '1.5',
        '--length',
        '200mm',
        '--ruler',
        '0.1mm',
    ]
    laid += ['--lead-file', 'my leads.yaml', '--ur-type', 'ur3']
    monkeypatch.setattr('sys.stdin', Terminal('88.8\n51.8\n'))
    assert main(laid) == 0
    printed = capsys.readouterr().out
    (at_once,) = read_leads(tmp_path / 'my leads.yaml')
    assert at_once.open == pytest.approx(0.06)
    monkeypatch.setattr('sys.stdin', Terminal('88.8'))  # then Ctrl-D
    assert main(laid) == 1
    shown = capsys.readouterr()
    assert 'the input ended before the answer' in shown.err
    (tmp_path / 'my leads.yaml').unlink()
    (command,) = [line for line in shown.out.splitlines() if line.startswith('ur-cartesian ')]
    words = shlex.split(command.replace('BEGINS ENDS', '88.8 51.8'))
    assert main(words[1:]) == 0
    assert read_leads(tmp_path / 'my leads.yaml') == (at_once,)
    report = printed.splitlines()[-2].partition('[mm]? ')[2].rpartition('[mm]? ')[2]
    assert report in capsys.readouterr().out
