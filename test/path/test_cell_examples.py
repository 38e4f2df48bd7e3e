# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The examples with a cell pass because of what they do about it: without it they are refused."""

from dataclasses import replace
from importlib import util

from checkout import CHECKOUT, needs_checkout
import numpy as np
import pytest
from tracked_files import tracked_files

from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.kinematics.robot_models import robot_model
from ur_cartesian_driver.motion.cell.cell_file import read_cell
from ur_cartesian_driver.motion.errors import CollisionPredicted, InvalidGoal
from ur_cartesian_driver.motion.goal.goal import FreeAxis, SegmentType
from ur_cartesian_driver.motion.goal.known_frames import ArmSnapshot
from ur_cartesian_driver.path import AirTravel, Frames, join, Path
from ur_cartesian_driver.planning import plan, PlanningOptions
from ur_cartesian_driver.planning.stop_prediction import state_at_rest
from ur_cartesian_driver.sim import HOME

pytestmark = needs_checkout

ARM = Arm(robot_model('ur5e'))
STATE = state_at_rest(ARM, HOME)
CELLS = CHECKOUT / 'config' / 'cells'


class Example:
    """An example of examples/, with the cell of its own."""

    def __init__(self, name):
        file = CHECKOUT / 'examples' / f'{name}.py'
        spec = util.spec_from_file_location(f'example_{name}', file)
        self.module = util.module_from_spec(spec)
        spec.loader.exec_module(self.module)
        self._name = name
        self.options = PlanningOptions(cell_file=self.module.CELL)
        self.frames = Frames(static_frames=self.module.FRAMES)

    @property
    def goal(self):
        air = []
        if hasattr(self.module, 'AIR'):
            air = [
                AirTravel(
                    arm=ARM,
                    state=STATE,
                    options=self.options,
                    frames=self.frames,
                    **self.module.AIR,
                )
            ]
        path = getattr(self.module, self._name)(STATE.actual_tcp_pose, *air)
        return path.goal(self.frames, ArmSnapshot.of(STATE))

    def plan(self, goal, cell=None):
        cell = self.options.cell if cell is None else cell
        return plan(goal, STATE, ARM, replace(self.options, cell=cell))


def at_height(goal, numbers, z):
    """Return a goal with some points at another height."""
    points = list(goal.waypoints)
    for k in numbers:
        x, y, _ = points[k].pose.position
        points[k] = replace(points[k], pose=replace(points[k].pose, position=(x, y, z)))
    return replace(goal, waypoints=tuple(points))


@pytest.mark.parametrize('file', tracked_files(CELLS, '*.yaml'), ids=lambda file: file.stem)
def test_every_cell_is_one_that_an_example_uses(file):
    assert read_cell(file)
    uses = [p.stem for p in tracked_files(CHECKOUT, 'examples/*.py') if file.name in p.read_text()]
    assert uses


@pytest.mark.parametrize(
    ('name', 'closest'),
    [
        pytest.param('channel', 'cell: nozzle and channel come closest', marks=pytest.mark.slow),
        ('torch_cable', 'cell: forearm_link and cable_loop come closest'),
        ('held_plank', 'cell: plank and post come closest'),
    ],
)
def test_the_report_names_the_closest_pair(name, closest):
    example = Example(name)
    assert any(line.startswith(closest) for line in example.plan(example.goal).report)


@pytest.mark.slow
def test_the_nozzle_fits_into_the_channel_only_where_its_mesh_is_open():
    example = Example('channel')
    cell = example.options.cell
    x, y, z = cell.body('channel').T_frame_body.position
    moved = replace(cell.body('channel').T_frame_body, position=(x + 0.0179, y, z))
    example.plan(example.goal, cell.moved('channel', 'base', moved))
    moved = replace(moved, position=(x + 0.0181, y, z))
    with pytest.raises(CollisionPredicted) as refusal:
        example.plan(example.goal, cell.moved('channel', 'base', moved))
    assert refusal.value.bodies == ('nozzle', 'channel')


def test_without_a_free_axis_the_cable_of_the_torch_touches():
    example = Example('torch_cable')
    bound = replace(
        example.goal,
        segments=tuple(
            replace(segment, free_axis=FreeAxis.NONE) for segment in example.goal.segments
        ),
    )
    with pytest.raises(CollisionPredicted) as refusal:
        example.plan(bound)
    assert 'cable_loop' in refusal.value.bodies


def test_only_the_plank_has_to_be_carried_over_the_post():
    example = Example('held_plank')
    low = at_height(example.goal, (2, 3), 0.12)
    with pytest.raises(CollisionPredicted) as refusal:
        example.plan(low)
    assert refusal.value.bodies == ('plank', 'post')
    example.plan(replace(low, part_changes=()), example.options.cell.without('plank'))


@pytest.mark.slow
def test_the_best_order_of_the_seams_has_less_travel_than_the_one_given(monkeypatch):
    example = Example('three_seams')

    def turns():
        rows = example.plan(example.goal).rows
        return np.abs(np.diff(rows.joints, axis=0)).sum()

    best = turns()
    monkeypatch.setattr(example.module, 'join', lambda seams, air, order: join(seams, air))
    assert best < 0.9 * turns()


@pytest.mark.slow
def test_a_start_far_away_needs_a_travel_and_the_partition_is_in_the_way():
    example = Example('far_start')
    report = example.plan(example.goal).report
    assert any(line.startswith('travel: ') and 'partition' in line for line in report)
    direct = replace(example.goal, allow_travel=False)
    with pytest.raises(InvalidGoal, match='max_approach_distance'):
        example.plan(direct)
    joint = replace(direct.segments[0], type=SegmentType.JOINT)
    direct = replace(direct, segments=(joint, *direct.segments[1:]))
    example.options = replace(example.options, max_approach_distance=0.0)
    with pytest.raises(CollisionPredicted) as refusal:
        example.plan(direct)
    assert 'partition' in refusal.value.bodies


def test_the_nozzle_that_hits_the_channel_is_refused_with_both_bodies():
    file = CHECKOUT / 'config' / 'examples' / 'errors' / 'collision_cell.yaml'
    goal = Path.load(file).goal(Frames(), ArmSnapshot.of(STATE))
    plan(goal, STATE, ARM, PlanningOptions())
    options = PlanningOptions(cell_file=str(CELLS / 'channel.yaml'))
    with pytest.raises(CollisionPredicted) as refusal:
        plan(goal, STATE, ARM, options)
    assert refusal.value.bodies == ('nozzle', 'channel')
    # Nozzle and inner wall are 13.9 mm apart at first, and the clearance is 4 mm.
    x = ARM.forward(refusal.value.q).position[0]
    assert x == pytest.approx(-0.47 - 0.008 - 0.004, abs=1e-3)
