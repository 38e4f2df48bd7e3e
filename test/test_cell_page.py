# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The page on cells: its files, commands and snippets work, and print what it shows."""

import re
from typing import Any

from checkout import CHECKOUT, needs_checkout
from pages import assert_shows, console_examples, save_files, saved_files
import pytest
import yaml

from ur_cartesian_driver.cli import main
from ur_cartesian_driver.driver import Driver, DriverConfig
from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.kinematics.robot_models import robot_model
from ur_cartesian_driver.motion.cell.cell_file import cell_from_text
from ur_cartesian_driver.motion.goal.known_frames import ArmSnapshot
from ur_cartesian_driver.path import AirTravel, Frames, Pose, StaticFrame
from ur_cartesian_driver.planning import plan, PlanningOptions
from ur_cartesian_driver.planning.stop_prediction import state_at_rest
from ur_cartesian_driver.sim import HOME

pytestmark = needs_checkout

PAGE = CHECKOUT / 'doc' / 'cell.md'
CELLS = CHECKOUT / 'config' / 'cells'
ARM = Arm(robot_model('ur5e'))
STATE = state_at_rest(ARM, HOME)
#: The commands of the page; an installed package has no page.
EXAMPLES = list(console_examples(PAGE)) if PAGE.exists() else []
FRAMES = Frames(static_frames=[StaticFrame('fingers', 'tool0', Pose((0.0, 0.0, 0.12)))])


def blocks(language):
    text = PAGE.read_text(encoding='utf-8')
    return re.findall(rf'^```{language}\n(.*?)^```$', text, re.DOTALL | re.MULTILINE)


def test_the_reader_saves_what_the_commands_name():
    assert set(saved_files(PAGE)) == {
        'cell.yaml',
        'station.yaml',
        'station.urdf',
        'urdf_cell.yaml',
    }


@pytest.mark.parametrize(
    ('words', 'shown'),
    [pytest.param(words, shown, id=' '.join(words[:3])) for ((_, *words),), shown in EXAMPLES],
)
def test_a_command_says_what_the_page_shows(words, shown, tmp_path, monkeypatch, capsys):
    save_files(PAGE, tmp_path)
    monkeypatch.chdir(tmp_path)
    main(words)
    printed = capsys.readouterr()
    assert_shows(shown, printed.out + printed.err)


def test_the_mesh_of_the_page_is_one_of_a_body():
    (line,) = [text for text in blocks('yaml') if 'channel.stl' in text]
    bodies = f'cell: 1\nbodies:\n  {line}'
    assert cell_from_text(bodies, 'the page', CELLS).body('fixture').has_mesh


def test_the_call_of_the_service_adds_a_body():
    (command,) = [text for text in blocks('bash') if 'change_cell' in text]
    request = yaml.safe_load(re.search(r'"(.*)"', command)[1])
    assert cell_from_text(request['bodies'], 'the page', CELLS).body('crate')


class CellDriver(Driver):
    """A driver whose robot is not connected, and stands at home."""

    def air_travel(self, **settings):
        return AirTravel(arm=ARM, state=STATE, options=self.options, frames=FRAMES, **settings)


def test_the_snippets_of_the_page_run():
    driver = CellDriver(DriverConfig())
    names: dict[str, Any] = {'driver': driver}
    for snippet in blocks('python'):
        exec(snippet, names)
    assert not driver.cell
    options = PlanningOptions(cell_file=str(CELLS / 'plank.yaml'))
    carried = names['carried'].goal(FRAMES, ArmSnapshot.of(STATE))
    assert any('plank and post' in line for line in plan(carried, STATE, ARM, options).report)
    seams = names['seams'].goal(FRAMES, ArmSnapshot.of(STATE))
    assert plan(seams, STATE, ARM, PlanningOptions()).duration > 0.0
