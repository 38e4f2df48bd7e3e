# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
A part is led along a fixed tool, in virtual time, whatever happens on the way.

``INTERRUPTIONS`` is the number of places at which it is interrupted.
"""

from dataclasses import replace
import os
import runpy

from checkout import CHECKOUT, needs_checkout
from curve_distance import distances
from held_part_bench import (
    ARM,
    Bench,
    BESIDE,
    check,
    DEVIATION,
    edges,
    FRAME,
    is_covered,
    OFF,
    ON,
    OPTIONS,
    PRIMITIVES,
    programmed,
    Q,
    SERVO,
    SPLINE,
    START,
    URDF,
)
from held_part_goals import frame_and_urdf
import numpy as np
import pytest
from random_cases import random_of
from robot_cell import CYCLE, run_cell
import yaml

from ur_cartesian_driver.driver.ipc.channel import SetPathOffset
from ur_cartesian_driver.motion.errors import ErrorCode, JointLimitExceeded
from ur_cartesian_driver.motion.geometry.pose import Pose
from ur_cartesian_driver.motion.goal.goal import (
    FreeAxis,
    PathOffset,
    Press,
    PressFrame,
    Tolerance,
    Waypoint,
)
from ur_cartesian_driver.motion.state.rtde_state import RuntimeState
from ur_cartesian_driver.path import Frames, Path, resume, StaticFrame
from ur_cartesian_driver.planning import plan
from ur_cartesian_driver.planning.stop_prediction import state_at_rest
from ur_cartesian_driver.resources import share_path
from ur_cartesian_driver.sim import rtde_output_values
from ur_cartesian_driver.sim.motion.contact.contact_bodies import ContactBody

pytest.importorskip('pinocchio')
pytestmark = [pytest.mark.acceptance, pytest.mark.slow]

COMPUTED = rtde_output_values.COMPUTED
PLACES = int(os.environ.get('INTERRUPTIONS', '2'))


@pytest.mark.parametrize('execution', [SPLINE, SERVO, PRIMITIVES])
def test_the_path_on_the_part_is_kept_while_the_slider_moves(execution):
    async def body(cell):
        random, bench = random_of('held slider', execution.name), await Bench(cell).connect()
        motion = await bench.begin(edges(execution))
        while motion.outcome is None:
            cell.robot.set_speed_slider(random.choice([0.2, 0.5, 1.0]))
            for _ in range(random.randint(20, 80)):
                await cell.sleep(CYCLE)
        assert (await bench.end(motion)).code is ErrorCode.SUCCESSFUL
        check(bench, execution)
        # Feedback is relative to the part: the tool is on the path, not where the flange is.
        last = motion.progress[-1]
        assert last.actual_pose.distance_to(bench.made.goal.waypoints[-1].pose) < 1e-3
        assert last.desired_pose.distance_to(bench.made.goal.waypoints[-1].pose) < 1e-3

    run_cell(body)


def test_a_pause_at_a_corner_leaves_the_path_on_the_part_as_it_is():
    async def body(cell):
        bench = await Bench(cell).connect()
        motion = await bench.begin(edges())
        await cell.until(lambda: motion.progress and motion.progress[-1].waypoint >= 2, 60.0)
        cell.robot.inject('pause')
        await cell.until(lambda: cell.memory.read().runtime_state is RuntimeState.PAUSED)
        cell.robot.inject('play')
        assert (await bench.end(motion)).code is ErrorCode.SUCCESSFUL
        places, _ = bench.readings()
        assert distances(places, [programmed()]).max() < DEVIATION + BESIDE[SPLINE]

    run_cell(body)


@pytest.mark.parametrize('execution', [SPLINE, SERVO])
@pytest.mark.timeout(1200)
def test_an_interrupted_path_on_the_part_is_whole(execution):
    async def body(cell):
        random, bench = random_of('held stops', execution.name), await Bench(cell).connect()
        goal = edges(execution)
        for k in range(PLACES):
            motion = await bench.begin(goal)
            stop_at = bench.made.duration * random.uniform(0.15, 0.9)
            await cell.until(
                lambda at=stop_at, of=motion: of.progress and of.progress[-1].time >= at, 60.0
            )
            cell.owner.cancel()
            stopped = (await bench.end(motion)).stopped
            first, on = bench.readings()
            left = resume(goal, stopped, overlap=0.005, approach=0.01)
            outcome = await bench.end(bench.start(left.goal))
            assert outcome.code is ErrorCode.SUCCESSFUL, (k, stop_at, stopped, outcome)
            second, on2 = bench.readings()
            glued = np.vstack([first[on], second[on2]])
            stretch, beside = programmed()[ON + 1 : OFF + 2], DEVIATION + BESIDE[execution]
            assert is_covered(stretch, glued, beside), (k, stop_at, stopped)
            # The output is on nowhere else.
            assert distances(glued, [programmed()]).max() < DEVIATION + BESIDE[execution]
            assert not on2[-1]

    run_cell(body)


def test_an_offset_moves_the_tool_in_the_frame_of_the_part():
    side = 0.003

    async def body(cell):
        bench = await Bench(cell).connect()
        goal = replace(
            edges(SERVO, path_offset=PathOffset(limits=(0.0, 0.005, 0.0), timeout=60.0)),
            waypoints=edges().waypoints[:1],
            segments=(replace(edges().segments[0], velocity=0.01),),
            io_commands=(),
        )
        motion = await bench.begin(goal)
        await cell.until(lambda: motion.progress and motion.progress[-1].time > 0.1, 20.0)
        cell.owner.send(
            SetPathOffset(motion=len(cell.owner.motions), offset=(0.0, side, 0.0), age=0.0)
        )
        assert (await bench.end(motion)).code is ErrorCode.SUCCESSFUL
        places, _ = bench.readings()
        off = distances(places, [programmed()[:2]])
        assert off.max() == pytest.approx(side, abs=2e-4)
        assert off[-1] < 3e-4

    run_cell(body)


@pytest.mark.parametrize('name', ['polish_rim', 'glue_contour', 'deburr_ring'])
@needs_checkout
def test_the_examples_lead_their_parts(name):
    """In a file and in Python: the same goal, carried out as it says."""
    module = runpy.run_path(str(CHECKOUT / 'examples' / f'{name}.py'))
    frames = Frames(static_frames=module['FRAMES'])
    goal = module[name](None).goal(frames)
    file = share_path() / 'config' / 'examples' / 'held_part' / f'{name}.yaml'
    parameters = yaml.safe_load((share_path() / 'config' / 'held_part.yaml').read_text())
    listed = parameters['/**']['ros__parameters']['static_frames']
    from_file = Path.load(file).goal(Frames(static_frames=map(StaticFrame.parse, listed)))
    assert from_file.frame_id == goal.frame_id
    for point, other in zip(from_file.waypoints, goal.waypoints, strict=True):
        assert point.pose.distance_to(other.pose) < 1e-9
    for a, b in (
        (from_file.moving_frame.T_base_tool, goal.moving_frame.T_base_tool),
        (from_file.moving_frame.T_flange_frame, goal.moving_frame.T_flange_frame),
    ):
        assert a.distance_to(b) < 1e-6
        assert a.angle_to(b) < 1e-6

    async def body(cell):
        bench = await Bench(cell).connect()
        motion = await bench.begin(from_file)
        outcome = await bench.end(motion)
        assert outcome.code is ErrorCode.SUCCESSFUL, outcome
        seen, end = motion.progress[-1].actual_pose, goal.waypoints[-1].pose
        assert seen.distance_to(end) < 1e-4
        if name == 'deburr_ring':  # only the axis of the brush is given
            axes = [pose.matrix()[:3, 2] for pose in (seen, end)]
            assert np.linalg.norm(np.cross(*axes)) < 1e-3
            return
        assert seen.angle_to(end) < 1e-3

    run_cell(body)


@needs_checkout
def test_a_free_rotation_leads_around_a_ring_that_a_given_one_does_not():
    """The brush touches the whole edge, its axis against it; pinocchio sees it from the ring."""
    module = runpy.run_path(str(CHECKOUT / 'examples' / 'deburr_ring.py'))
    frames = Frames(static_frames=module['FRAMES'])
    goal = module['deburr_ring'](None).goal(frames)
    _, urdf = frame_and_urdf(ARM, goal.moving_frame.T_flange_frame, goal.moving_frame.T_base_tool)
    given = tuple(replace(each, free_axis=FreeAxis.NONE) for each in goal.segments)
    start = state_at_rest(ARM, Q)
    with pytest.raises(JointLimitExceeded, match=r'wrist_3_joint .* \(free_axis\)'):
        plan(replace(goal, segments=given), start, ARM, OPTIONS)

    async def body(cell):
        bench = await Bench(cell).connect()
        assert (await bench.end(await bench.begin(goal))).code is ErrorCode.SUCCESSFUL
        q = np.array([row.target_q for row in bench.recorder.rows])
        tool = urdf.relative('tool', 'part', q)
        x, y, z = tool[:, :3, 3].T
        radius, lean = np.hypot(x, y), np.pi / 3
        edge = (np.abs(z - 0.01) < 5e-5) & (np.abs(radius - 0.04) < 2e-4)
        turn = np.unwrap(np.arctan2(y[edge], x[edge]))
        assert turn[-1] - turn[0] == pytest.approx(np.radians(380.0), abs=0.01)
        out = np.stack([x, y], axis=1) / radius[:, None] * np.cos(lean)
        normal = np.column_stack([out, np.full(len(x), np.sin(lean))])[edge]
        assert np.degrees(np.arccos(-np.sum(normal * tool[edge, :3, 2], axis=1))).max() < 2.0
        along = np.stack([-np.sin(turn), np.cos(turn), 0.0 * turn], axis=1)
        turned = np.degrees(np.arccos(np.clip(np.sum(along * tool[edge, :3, 0], axis=1), -1, 1)))
        assert np.ptp(turned) > 90.0  # as given it would be 0 all the way

    run_cell(body)


@pytest.mark.parametrize('frame', list(PressFrame))
def test_a_part_is_pressed_against_the_fixed_tool(frame):
    """The tool goes into the part along its z until it pushes with its force, and nowhere else."""
    force, gap, deep = 20.0, 0.003, 0.001  # the body of the simulator gives way by 1 mm
    R_tool = FRAME.T_base_tool.matrix()[:3, :3]
    # The axis of the press that is nearest to z of the tool, and the way of the force along it.
    axes = {
        PressFrame.TOOL: np.eye(3),
        PressFrame.GOAL: R_tool.T @ FRAME.frame_under(START).matrix()[:3, :3],
        PressFrame.BASE: R_tool.T,
    }[frame]
    k = int(np.abs(axes[2]).argmax())
    normal = axes[:, k] * np.sign(axes[2, k])  # of the push, in the axes of the tool

    async def body(cell):
        # A plane in the way of the TCP, which stands across the push of the tool.
        bench = await Bench(cell).connect()
        towards = -R_tool @ normal  # the way of the part
        at = np.array(ARM.forward(Q).position) + gap * towards
        contact = cell.robot.controller.contact
        contact.bodies = (ContactBody('plane', tuple(at), tuple(-towards), friction=0.0),)
        side = np.cross(normal, (0.0, 1.0, 0.0) if abs(normal[1]) < 0.9 else (1.0, 0.0, 0.0))
        side /= np.linalg.norm(side)
        ways = (0.02, 0.08, 0.1)
        goal = replace(
            edges(PRIMITIVES),
            waypoints=tuple(
                Waypoint(pose=START @ Pose(tuple((way * side).tolist()))) for way in ways
            ),
            segments=(edges(PRIMITIVES).segments[0],) * len(ways),
            io_commands=(),
            presses=(
                Press(
                    first_waypoint=0,
                    last_waypoint=1,
                    frame=frame,
                    axes=('xyz'[k],),
                    forces=(force * float(np.sign(axes[2, k])),),
                ),
            ),
            path_tolerance=Tolerance(position=(0.0005,) * 3, orientation=(0.01,) * 3),
        )
        motion, rows = await bench.begin(goal), []

        def ended():
            controller = cell.robot.controller
            rows.append(
                (*COMPUTED['actual_q'](controller), *COMPUTED['actual_TCP_force'](controller))
            )
            return motion.outcome

        await cell.until(ended, 60.0)
        assert motion.outcome.succeeded, motion.outcome
        table = np.array(rows)
        # The place of the tool on the part, in the axes of the tool.
        places = URDF.relative('tool', 'part', table[:, :6])[:, :3, 3] - START.position
        places = places @ START.matrix()[:3, :3]
        along = places @ side
        pressed = (along > 0.04) & (along < 0.075)
        assert places[pressed] @ normal == pytest.approx(gap + deep, abs=2e-4)
        assert np.linalg.norm(table[pressed, 6:9], axis=1) == pytest.approx(force, abs=0.5)
        assert np.abs(places @ np.cross(normal, side)).max() < 5e-4
        assert places[-1] == pytest.approx(0.1 * side, abs=5e-4)

    run_cell(body)
