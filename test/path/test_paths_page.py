# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The snippets of the page on paths run, one after the other, and plan what they compose."""

import re

from checkout import CHECKOUT, needs_checkout
import pytest

from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.kinematics.robot_models import robot_model
from ur_cartesian_driver.motion.errors import ErrorCode
from ur_cartesian_driver.motion.events import Outcome
from ur_cartesian_driver.motion.goal.known_frames import ArmSnapshot
from ur_cartesian_driver.path import AirTravel, Frames, Path, Pose, StaticFrame
from ur_cartesian_driver.planning import plan, PlanningOptions
from ur_cartesian_driver.planning.stop_prediction import state_at_rest
from ur_cartesian_driver.ros import client
from ur_cartesian_driver.sim.simulator_config import HOME

PAGE = CHECKOUT / 'doc' / 'paths.md'
pytestmark = needs_checkout

ARM = Arm(robot_model('ur5e'))
STATE = state_at_rest(ARM, HOME)
FRAMES = Frames(
    static_frames=[
        StaticFrame('part', 'base', Pose((0.02, -0.01, 0.0))),
        StaticFrame('nozzle', 'tool0', Pose((0.0, 0.0, 0.1))),
    ]
)


class PlanningDriver:
    """Plans as the driver does, for an arm at home, and does no more."""

    def plan(self, path):
        return plan(path.goal(FRAMES, ArmSnapshot.of(STATE)), STATE, ARM, PlanningOptions())

    def air_travel(self, **settings):
        return AirTravel(arm=ARM, state=STATE, frames=FRAMES, **settings)

    def execute(self, path):
        return Outcome(code=ErrorCode.SUCCESSFUL, text='', report=self.plan(path).report)

    __enter__ = lambda self: self  # noqa: E731
    __exit__ = lambda self, *_: None  # noqa: E731


def test_the_snippets_of_the_page_run(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(client, 'GoalClient', PlanningDriver)
    names = {'driver': PlanningDriver(), 'start': STATE.actual_tcp_pose}
    snippets = re.findall(r'^```python\n(.*?)^```$', PAGE.read_text(), re.DOTALL | re.MULTILINE)
    for snippet in snippets:
        exec(snippet, names)
    printed = capsys.readouterr().out
    mistake = re.search(r'print\(mistake\)  # (.*)', PAGE.read_text())[1]
    assert mistake in printed
    assert 'point 3: LINEAR -> MOVEL' in printed
    assert Path.load(tmp_path / 'seam.yaml').goal(FRAMES) == names['goal']
    paths = {name: value for name, value in names.items() if isinstance(value, Path)}
    assert set(paths) >= {
        'square',
        'seam',
        'timed',
        'careful',
        'streamed',
        'strokes',
        'bead',
        'seams',
    }
    for name in ('timed', 'careful', 'streamed', 'strokes', 'bead'):
        assert PlanningDriver().plan(paths[name]).duration > 0.0
    # A path that begins elsewhere needs a motion to there.
    assert len(paths['screw']) == 1


@pytest.mark.parametrize('name', ['square', 'seam'])
def test_the_page_shows_the_examples(name):
    def code(text):
        return re.sub(r'\s', '', re.sub(r'#.*', '', text))

    example = code((CHECKOUT / 'examples' / f'{name}.py').read_text())
    (motions,) = re.findall(r'->Path:.*?Path\([^)]*\)(.*?)\)?if__name__', example)
    shown = code(PAGE.read_text())
    for part in motions.split('returnpath'):
        assert part in shown


def test_the_page_names_every_method_of_a_path():
    page = PAGE.read_text()
    methods = [name for name in vars(Path) if not name.startswith('_')]
    known = {'end', 'frame', 'poses', 'starts_with_joint_motion', 'tool', 'from_goal'}
    known |= {'from_message', 'from_yaml', 'to_yaml'}
    missing = [name for name in methods if not re.search(rf'\b{name}\b', page)]
    assert set(missing) <= known


def test_the_goals_of_the_page_on_outputs_are_the_examples(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    page = (CHECKOUT / 'doc' / 'outputs.md').read_text('utf-8')
    for program in re.findall(r'^```python\n(.*?)^```$', page, re.DOTALL | re.MULTILINE):
        exec(program, {})

    def content(file):
        goal = Path.load(file).goal()
        motions = [(row.velocity, row.acceleration, row.blend_radius) for row in goal.segments]
        places = [waypoint.pose.position for waypoint in goal.waypoints]
        return places, motions, goal.io_commands, goal.pulses, goal.safe_outputs

    for file in ('glue.yaml', 'bead_by_place.yaml', 'photo_seam.yaml'):
        assert content(file) == content(CHECKOUT / 'config' / 'examples' / file)
