# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""A way is refused at the first place where the arm is too near, and never for leaving it."""

from dataclasses import replace
from math import pi
import re

from meshes import need_meshes
import numpy as np
import pytest

from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.kinematics.collision_bodies import CollisionBodies, Link
from ur_cartesian_driver.kinematics.collision_meshes import CollisionMeshes, missing_meshes
from ur_cartesian_driver.kinematics.robot_models import JOINT_NAMES, MODELS
from ur_cartesian_driver.motion.errors import CollisionPredicted, ErrorCode
from ur_cartesian_driver.motion.geometry.pose import IDENTITY, Pose
from ur_cartesian_driver.motion.goal.goal import Goal, Posture, Segment, SegmentType, Waypoint
from ur_cartesian_driver.planning.options import PlanningOptions
from ur_cartesian_driver.planning.planner import plan
from ur_cartesian_driver.planning.preflight.clearance import (
    Clearance,
    clearance_remarks,
    self_collision_remark,
)

H = pi / 2
HOME = (0.0, -H, H, -H, -H, 0.0)
#: The elbow closed so far that wrist 1 is in the upper arm.
FOLDED = (0.0, -H, 2.95, -1.8, -H, 0.0)
TOOL = Pose((0.0, 0.0, 0.1), (0.0, 0.0, 0.0, 1.0))


def way(start, end, n=60):
    """Joint rows from the first after the start to the end."""
    return np.array(start) + np.linspace(0, 1, n + 1)[1:, None] * np.subtract(end, start)


def check(q, start=HOME, model='ur5e', tcp=IDENTITY, **options):
    return Clearance(Arm(MODELS[model]), tcp, PlanningOptions(**options)).check(q, start)


@pytest.fixture
def no_meshes(monkeypatch):
    """Neither meshes nor pinocchio are installed."""
    monkeypatch.setattr('ur_cartesian_driver.kinematics.link_shapes.find_spec', lambda name: None)
    monkeypatch.setenv('AMENT_PREFIX_PATH', '')
    missing_meshes.cache_clear()
    yield
    missing_meshes.cache_clear()


# -- self-collision -------------------------------------------------------------------------------


CHOICES = ('warn', 'auto', 'refuse', 'off')


@pytest.mark.parametrize('choice', CHOICES)
@pytest.mark.parametrize('model', ['ur10e', 'ur5', 'ur5e'])
@pytest.mark.parametrize('installed', [True, False])
def test_parameter_and_model_decide_whether_to_refuse(model, choice, installed, request):
    """Installed meshes never do; they only decide which shapes are measured."""
    if not installed:
        request.getfixturevalue('no_meshes')
    elif model != 'ur10e':
        need_meshes(model)
    clear = check(way(HOME, FOLDED), model=model, self_collision=choice)
    refuses = choice == 'refuse' or (choice == 'auto' and model != 'ur10e')
    assert (clear.violation is not None) == refuses
    assert (clear.warning is not None) == (not refuses and choice != 'off')
    if choice == 'off':
        assert (clear.margin, clear.description) == (np.inf, '')
        return
    found = clear.violation or clear.warning
    assert 'less than min_clearance = 0.0050 m' in found.text
    if installed and model != 'ur10e':
        assert found.text.endswith(f'(measured between meshes of the {model})')
        assert clear.description.endswith(f'(meshes of the {model})')
    else:
        assert found.text.endswith('(measured between cylinders that contain the arm)')
        assert found.remedy.endswith('; self_collision decides whether cylinders refuse')
        assert clear.description.endswith('(cylinders)')


def test_what_is_missing_for_the_verdict_is_said(no_meshes):
    def remark(model, choice):
        return self_collision_remark(model, PlanningOptions(self_collision=choice))

    assert remark('ur7e', 'auto') == (
        'The package airo-models with the meshes of the arm is not installed, the extra '
        '`collision` brings it: cylinders that contain the arm refuse self-collisions '
        '(self_collision is auto).'
    )
    assert 'warn of self-collisions (self_collision is warn)' in remark('ur5', 'warn')
    assert remark('ur10e', 'refuse').startswith('There are no meshes of the ur10e: cylinders')
    assert remark('ur10e', 'auto') == remark('ur10e', 'warn') == remark('ur5', 'off') == ''


def test_cylinders_stand_for_a_pinocchio_that_cannot_be_imported(monkeypatch):
    need_meshes('ur5e')

    def broken(*_):
        raise ImportError('numpy.core.multiarray failed to import')

    monkeypatch.setattr('ur_cartesian_driver.kinematics.collision_meshes.pinocchio_model', broken)
    clear = check(way(HOME, FOLDED))
    assert clear.violation.text.endswith('cylinders that contain the arm)')


def test_nothing_is_said_where_nothing_is_missing():
    need_meshes('ur5e')
    assert self_collision_remark('ur5e', PlanningOptions()) == ''


def test_the_first_row_too_near_is_named_and_the_smallest_distance():
    q = way(HOME, FOLDED, 5000)  # more than is judged at once
    clear = check(q, model='ur10e')
    bodies = CollisionBodies(Arm(MODELS['ur10e']))
    distances = bodies.distances(q)
    assert clear.warning.row == np.flatnonzero(distances.min(axis=1) < 0.005)[0] > 4096
    assert clear.margin == distances.min()
    a, b = bodies.pairs[distances.min(axis=0).argmin()]
    assert clear.description == f'{a} and {b} (cylinders)'


def test_meshes_let_pass_what_only_cylinders_refuse():
    """Of the configurations that cylinders refuse, meshes refuse those that are too near."""
    need_meshes('ur5')
    arm = Arm(MODELS['ur5'])
    bodies, meshes = CollisionBodies(arm), CollisionMeshes(arm)
    q = np.random.default_rng(7).uniform(-pi, pi, (60, 6))
    lower = bodies.distances(q)
    q, lower = q[lower.min(axis=1) < 0.005], lower[lower.min(axis=1) < 0.005]
    passed = 0
    for row, least in zip(q, lower, strict=True):
        exact = min(
            meshes.distances(pair, row[None])[0]
            for pair, d in zip(bodies.pairs, least, strict=True)
            if d < 0.005
        )
        clear = check(row[None], model='ur5')
        assert (clear.violation is None) == (exact >= 0.005)
        passed += clear.violation is None
    assert 0 < passed < len(q)


def test_a_warning_and_the_report_have_the_distance_of_the_meshes():
    need_meshes('ur5e')
    q = way(HOME, (0.0, -H, 2.6, -1.8, -H, 0.0))
    clear = check(q, self_collision='warn', min_clearance=0.2)
    meshes = CollisionMeshes(Arm(MODELS['ur5e']))
    pairs = CollisionBodies(Arm(MODELS['ur5e'])).pairs
    least = min(meshes.distances(pair, q).min() for pair in pairs)
    assert least > 0.0
    assert clear.warning is not None
    assert clear.margin == pytest.approx(least, abs=1e-9)


def test_min_clearance_is_how_near_it_may_come():
    q = way(HOME, FOLDED)
    rows = [
        check(q, model='ur10e', min_clearance=bound).warning.row for bound in (0.0, 0.005, 0.03)
    ]
    assert rows == sorted(rows, reverse=True)
    assert len(set(rows)) == 3
    assert check(way(HOME, HOME), min_clearance=0.0).warning is None


@pytest.mark.parametrize('model', MODELS)
def test_an_everyday_way_is_clear(model):
    for end in (
        (0.5, -2.0, 2.2, -1.8, -H, 0.3),
        (0, -0.8, 1.2, -2.0, -H, 0),
        (0, -H, 0, -H, 0, 0),
    ):
        clear = check(way(HOME, end), model=model, tcp=TOOL, tool_radius=0.04)
        assert clear.violation is None
        assert clear.warning is None
        assert clear.margin > 0.005
        assert clear.description


def test_a_tool_is_checked_against_the_arm():
    back = (0.0, -2.2, 2.4, -0.2, -H, 0.0)
    long = Pose((0.0, 0.0, 0.6), (0.0, 0.0, 0.0, 1.0))
    for model in ('ur5', 'ur10e'):
        clear = check(way(HOME, back), model=model, tcp=long)
        assert clear.violation is clear.warning is None
        clear = check(way(HOME, back), model=model, tcp=long, tool_radius=0.03)
        found = clear.violation if model == 'ur5' else clear.warning
        assert found.text.startswith('upper arm and tool ')


# -- planes ---------------------------------------------------------------------------------------


def test_a_plane_refuses_the_side_that_its_normal_does_not_point_into():
    """HOME has the flange at x < 0 and z > 0 in ``base``."""
    x, _, z = Arm(MODELS['ur5e']).forward(HOME).position
    for text, inside in (
        (f'p 0 0 {-0.05} 0 0 1', True),
        (f'p 0 0 {z - 0.05} 0 0 -1', False),
        (f'p {x - 0.2} 0 0 1 0 0', True),
        (f'p {x + 0.01} 0 0 1 0 0', False),
        (f'p {x - 0.2} 0 0 -1 0 0', False),
    ):
        margin = check(way(HOME, HOME), self_collision='off', workspace_planes=(text,)).margin
        assert (margin > 0.0) == inside, text


def test_planes_are_given_in_base_not_in_base_link():
    pose = Arm(MODELS['ur5e']).forward((0,) * 6)
    assert pose.position[0] < -0.8  # base_link would have it at +0.8
    beyond = check(np.zeros((1, 6)), workspace_planes=('front -0.8 0 0 1 0 0',))
    assert beyond.violation is not None
    assert check(np.zeros((1, 6)), workspace_planes=('behind 0.8 0 0 -1 0 0',)).violation is None


def test_the_margin_of_a_plane_is_kept():
    arm, q = Arm(MODELS['ur5e']), np.array([HOME])
    z = (arm.forward(HOME) @ TOOL).position[2]
    near = (f'table 0 0 {z - 0.03} 0 0 1',)
    assert check(q, start=(0, -H, 0, -H, 0, 0), tcp=TOOL, workspace_planes=near).violation is None
    wider = (f'table 0 0 {z - 0.03} 0 0 1 0.04',)
    found = check(q, start=(0, -H, 0, -H, 0, 0), tcp=TOOL, workspace_planes=wider).violation
    assert found.text == (
        'the TCP comes within 0.0300 m of the workspace plane "table", whose margin is 0.0400 m'
    )
    assert 'workspace_planes' in found.remedy


def test_a_tool_may_work_on_a_plane_and_go_no_deeper():
    """The TCP on the table, its cylinder flat at the end."""
    arm = Arm(MODELS['ur5e'])
    z = (arm.forward(HOME) @ TOOL).position[2]
    for depth, passes in ((0.0, True), (0.001, False)):
        clear = check(
            way(HOME, HOME)[:1],
            start=(0, -H, 0, -H, 0, 0),
            tcp=TOOL,
            tool_radius=0.03,
            workspace_planes=(f'table 0 0 {z + depth} 0 0 1',),
        )
        assert (clear.violation is None) == passes


def test_the_base_may_stand_in_a_plane_and_the_elbow_may_not():
    table = ('table 0 0 0 0 0 1',)
    assert check(way(HOME, HOME), workspace_planes=table).violation is None
    low = (0.0, 0.6, 0.9, -3.0, -H, 0.0)
    found = check(way(HOME, low), workspace_planes=table).violation
    assert 'beyond the workspace plane "table"' in found.text


def test_of_two_watches_the_earlier_row_counts():
    q = way(HOME, FOLDED)
    alone = check(q, self_collision='refuse').violation
    x = Arm(MODELS['ur5e']).forward(q[10]).position[0]
    both = check(q, self_collision='refuse', workspace_planes=(f'p {x - 0.05} 0 0 -1 0 0',))
    assert both.violation.row < alone.row
    assert '"p"' in both.violation.text


# -- starting inside ------------------------------------------------------------------------------

MODES = [('ur5e', {'self_collision': 'refuse'}), ('ur5', {})]


@pytest.mark.parametrize(('model', 'options'), MODES, ids=['cylinders', 'meshes'])
def test_what_starts_too_near_may_leave(model, options):
    if model == 'ur5':
        need_meshes('ur5')
    assert check(way(FOLDED, HOME), start=FOLDED, model=model, **options).violation is None


@pytest.mark.parametrize(('model', 'options'), MODES, ids=['cylinders', 'meshes'])
def test_what_starts_too_near_may_not_go_nearer(model, options):
    if model == 'ur5':
        need_meshes('ur5')
    deeper = (0.0, -H, 3.1, -1.8, -H, 0.0)
    found = check(way(FOLDED, deeper), start=FOLDED, model=model, **options).violation
    assert found.row < 5


@pytest.mark.slow
@pytest.mark.parametrize(('model', 'options'), MODES, ids=['cylinders', 'meshes'])
def test_what_has_left_may_not_come_back(model, options):
    if model == 'ur5':
        need_meshes('ur5')
    out = way(FOLDED, HOME, 400)
    clear = check(np.concatenate([out, out[::-1]]), start=FOLDED, model=model, **options)
    first = check(out[::-1], start=HOME, model=model, **options).violation
    assert clear.violation.row == 400 + first.row
    assert clear.violation.text == first.text


def test_turning_back_before_it_is_free_is_refused():
    out = way(FOLDED, HOME, 3000)[:200]
    clear = check(np.concatenate([out, out[::-1]]), start=FOLDED, self_collision='refuse')
    assert 200 <= clear.violation.row < 230


def test_leaving_one_thing_is_no_leave_to_run_into_another():
    x = Arm(MODELS['ur5e']).forward(HOME).position[0]
    plane = (f'wall {x + 0.02} 0 0 1 0 0',)  # the flange begins 2 cm beyond it
    level = way(HOME, (0.0, -H, 2.95, -2.95, -H, 0.0))
    found = check(level, self_collision='refuse', workspace_planes=plane).violation
    assert found is not None
    assert found == check(level, self_collision='refuse').violation


def test_a_start_beyond_a_plane_may_return_and_not_go_on():
    arm = Arm(MODELS['ur5e'])
    x = arm.forward(HOME).position[0]
    plane = (f'wall {x + 0.02} 0 0 1 0 0',)  # the flange is 2 cm beyond it
    back, on = (0.0, -H, 1.9, -1.9, -H, 0.0), (0.0, -1.2, H, -1.2 - H / 2, -H, 0.0)
    assert check(way(HOME, back), workspace_planes=plane).violation is None
    found = check(way(HOME, on), workspace_planes=plane).violation
    assert found.row < 3
    assert 'beyond the workspace plane "wall"' in found.text


def test_links_have_names_that_read_well():
    assert f'{Link.UPPER_ARM} and {Link.WRIST_2}' == 'upper arm and wrist 2'


# -- sentences ------------------------------------------------------------------------------------

SEGMENT = np.repeat([2, 3], 30).astype(np.int32)
FRACTION = np.tile(np.arange(1, 31) / 30, 2)


def test_a_refusal_names_segment_and_fraction():
    clear = check(way(HOME, FOLDED), self_collision='refuse')
    with pytest.raises(CollisionPredicted) as refusal:
        clearance_remarks(clear, SEGMENT, FRACTION)
    percent = 100 * FRACTION[clear.violation.row]
    assert clear.violation.row >= 30
    assert str(refusal.value) == (
        f'trajectory.points[3].pose, at {percent:.1f} % of its segment: {clear.violation.text}; '
        f'{clear.violation.remedy}.'
    )


def test_a_warning_goes_into_the_report_with_the_smallest_distance():
    warned = clearance_remarks(check(way(HOME, FOLDED), model='ur10e'), SEGMENT, FRACTION)
    assert warned[0].startswith('point 3: ')
    assert 'shoulder and forearm come within' in warned[0]
    assert warned[1] == 'clearance: none between shoulder and forearm (cylinders)'
    assert clearance_remarks(check(way(HOME, HOME)), SEGMENT, FRACTION) == [
        'clearance: at least 0.050 m between forearm and wrist 3 (cylinders)'
    ]
    assert clearance_remarks(check(way(HOME, HOME), self_collision='off'), SEGMENT, FRACTION) == []


# -- whole goals ----------------------------------------------------------------------------------


def posture(q):
    return Posture(names=JOINT_NAMES, values=tuple(q))


def folding(cell):
    """A goal that moves a little and then closes the elbow, from where the cell's arm stands."""
    start = cell.state.actual_q
    near = tuple(np.add(start, (0.1, 0, 0, 0, 0, 0)))
    points = tuple(Waypoint(pose=cell.tool(q), posture=posture(q)) for q in (near, FOLDED))
    return Goal(waypoints=points, segments=(Segment(type=SegmentType.JOINT),) * 2)


FREE = PlanningOptions(max_approach_distance=0.0, max_tool_speed=0.0)


def test_a_goal_that_folds_the_arm_into_itself_is_a_collision(make_cell):
    need_meshes('ur5')
    cell = make_cell(model='ur5')
    with pytest.raises(CollisionPredicted) as refusal:
        plan(folding(cell), cell.state, cell.arm, FREE)
    assert refusal.value.code == ErrorCode.COLLISION == -10
    assert re.match(
        r'trajectory\.points\[1\]\.pose, at 9\d\.\d % of its segment: upper arm and '
        r'wrist 1 come within 0\.00\d\d m of each other, less than min_clearance = 0\.0050 m '
        r'\(measured between meshes of the ur5\); ',
        str(refusal.value),
    )


def test_where_only_cylinders_tell_the_report_warns(make_cell):
    cell = make_cell(model='ur10e')
    made = plan(folding(cell), cell.state, cell.arm, FREE)
    assert [
        remark
        for remark in made.remarks
        if re.match(
            r'point 1: at \d\d\.\d % of its segment shoulder and forearm come within', remark
        )
    ]
    assert 'clearance: none between shoulder and forearm (cylinders)' in made.remarks
    refusing = replace(FREE, self_collision='refuse')
    with pytest.raises(CollisionPredicted, match=r'trajectory\.points\[1\]'):
        plan(folding(cell), cell.state, cell.arm, refusing)


def test_a_goal_that_crosses_a_plane_is_a_collision(cell):
    z = cell.home.position[2]
    goal = Goal(waypoints=(cell.point(0.05), cell.point(0.05, z=-0.1)))
    for depth in (0.025, 0.05):
        options = PlanningOptions(workspace_planes=(f'table 0 0 {z - depth} 0 0 1',))
        with pytest.raises(CollisionPredicted) as refusal:
            plan(goal, cell.state, cell.arm, options)
        said = re.match(
            r'trajectory\.points\[1\]\.pose, at (.*) % of its segment: the TCP is '
            r'0\.00.. m beyond the workspace plane "table"; ',
            str(refusal.value),
        )
        assert 0.0 < float(said[1]) / 100 - depth / 0.1 < 0.021  # a sample each 2 mm
    options = PlanningOptions(workspace_planes=(f'table 0 0 {z - 0.11} 0 0 1',))
    assert plan(goal, cell.state, cell.arm, options).segments


def test_a_goal_may_lead_out_of_a_collision(make_cell):
    need_meshes('ur5')
    cell = make_cell(FOLDED, model='ur5')
    goal = Goal(
        waypoints=(Waypoint(pose=cell.tool(HOME), posture=posture(HOME)),),
        segments=(Segment(type=SegmentType.JOINT),),
    )
    assert plan(goal, cell.state, cell.arm, FREE).segments
