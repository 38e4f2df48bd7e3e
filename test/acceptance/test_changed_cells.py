# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The cell of a running driver: changed by its owner, by its goals, and while the arm moves."""

import re
from time import sleep
from typing import Any

import numpy as np
import pytest
from waiting import wait_for

from ur_cartesian_driver.motion.cell.cell import Cell, CellBody, PlacedShape
from ur_cartesian_driver.motion.cell.shapes import Box, HalfSpace
from ur_cartesian_driver.motion.errors import CollisionPredicted, ErrorCode, InvalidGoal
from ur_cartesian_driver.motion.geometry.pose import Pose
from ur_cartesian_driver.motion.goal.execution_modes import ExecutionMode
from ur_cartesian_driver.motion.goal.goal import (
    Goal,
    OutputKind,
    PartAction,
    PartChange,
    PathOffset,
    SafeOutput,
    Waypoint,
)

pytestmark = [pytest.mark.acceptance, pytest.mark.slow]

SMALL = (PlacedShape(Box((0.02, 0.02, 0.02))),)
FAR = CellBody(name='far', shapes=SMALL, T_frame_body=Pose((0.0, -1.5, 0.5)))


def wall(home, y):
    """A board across the way of the tool along y, whose near side is ``y`` [m] from home."""
    x, own_y, z = home().position
    shape = PlacedShape(Box((0.4, 0.02, 0.4)))
    return CellBody(name='wall', shapes=(shape,), T_frame_body=Pose((x, own_y + y + 0.01, z)))


def part(home):
    x, y, z = home().position
    return CellBody(name='part', shapes=SMALL, T_frame_body=Pose((x, y, z - 0.2)))


def test_bodies_are_added_replaced_and_removed(driver):
    cell = driver.change_cell([FAR])
    assert driver.cell is cell
    assert cell.names == {'far'}
    moved = CellBody(name='far', shapes=SMALL, T_frame_body=Pose((0.0, -1.6, 0.5)))
    added = Cell(bodies=(moved, CellBody(name='other', shapes=SMALL)), clearance=0.02)
    driver.change_cell(added)
    assert driver.cell.body('far').T_frame_body.position[1] == -1.6
    assert driver.cell.clearance_of(driver.cell.body('other')) == 0.02
    driver.change_cell(remove=['other', 'far'])
    assert not driver.cell


def test_a_part_that_is_taken_by_a_call_moves_with_the_flange(driver, home):
    driver.change_cell([part(home)], attach=['part'])
    body = driver.cell.body('part')
    assert body.frame == 'tool0'
    there = (driver.arm.forward(driver.state.actual_q) @ body.T_frame_body).position
    assert there == pytest.approx(part(home).T_frame_body.position, abs=1e-4)
    driver.change_cell(release=['part'])
    assert driver.cell.body('part').frame == 'base'


WRONG: list[tuple[dict[str, Any], str]] = [
    ({'remove': ['fra']}, 'remove is not possible: the cell has no body "fra"; did you mean far?'),
    ({'attach': ['plane']}, 'attach is not possible: a plane has no end'),
    ({'release': ['far']}, 'release is not possible: "far" is not on the tool'),
    ({'attach': ['far', 'far']}, 'attach is not possible: "far" is on the tool already'),
    ({'bodies': ['far']}, "bodies contains 'far', which is no CellBody"),
    ({'remove': [3]}, 'remove contains 3, which is no name of a body'),
]


@pytest.mark.parametrize(('change', 'text'), WRONG)
def test_a_change_that_is_not_possible_changes_nothing(driver, change, text):
    before = driver.change_cell([FAR, CellBody(name='plane', shapes=(PlacedShape(HalfSpace()),))])
    with pytest.raises(InvalidGoal, match=re.escape(text)):
        driver.change_cell(**{'bodies': [CellBody(name='new', shapes=SMALL)]} | change)
    assert driver.cell is before


def test_the_cell_follows_the_parts_of_a_goal(driver, home):
    driver.change_cell([part(home)])
    goal = Goal(
        waypoints=tuple(Waypoint(pose=home(y=y, z=z)) for y, z in ((0, 0.02), (0.04, 0.02))),
        part_changes=(PartChange(waypoint=0, body='part'),),
    )
    assert driver.execute(goal, timeout=20.0).succeeded
    body = driver.cell.body('part')
    assert body.frame == 'tool0'
    there = (driver.arm.forward(driver.state.actual_q) @ body.T_frame_body).position
    x, y, z = part(home).T_frame_body.position
    assert there == pytest.approx((x, y + 0.04, z), abs=5e-4)  # taken at (0, 0.02), carried along
    back = Goal(
        waypoints=(Waypoint(pose=home()),),
        part_changes=(PartChange(waypoint=0, body='part', action=PartAction.RELEASE),),
    )
    assert driver.execute(back, timeout=20.0).succeeded
    put = driver.cell.body('part')
    assert put.frame == 'base'
    assert put.T_frame_body.position == pytest.approx((x, y, z - 0.02), abs=5e-4)


def test_a_goal_that_is_stopped_keeps_the_changes_at_points_it_has_left(driver, home):
    driver.change_cell([part(home), FAR])
    goal = Goal(
        waypoints=tuple(Waypoint(pose=home(z=z)) for z in (0.01, 0.2, 0.21)),
        part_changes=(PartChange(waypoint=0, body='part'), PartChange(waypoint=1, body='far')),
    )
    motion = driver.start(driver.plan(goal))
    wait_for(lambda: driver.progress is not None and driver.progress.waypoint == 1, 10.0)
    assert driver.cell.body('part').frame == 'tool0'  # at once
    motion.cancel()
    assert motion.result(10.0).code is ErrorCode.CANCELLED
    assert driver.cell.body('part').frame == 'tool0'
    assert driver.cell.body('far').frame == 'base'
    driver.execute(Goal(waypoints=(Waypoint(pose=home()),)), timeout=20.0).raise_for_error()


def test_a_plan_is_checked_again_if_the_cell_has_changed_since(driver, home):
    planned = driver.plan(Goal(waypoints=(Waypoint(pose=home(y=0.08)),)))
    driver.change_cell([wall(home, 0.12)])
    with pytest.raises(CollisionPredicted, match=r'The cell is not that of the plan: .*wall'):
        driver.start(planned)
    assert driver.progress is None
    driver.change_cell([FAR], remove=['wall'])
    assert driver.start(planned).result(20.0).succeeded
    driver.execute(Goal(waypoints=(Waypoint(pose=home()),)), timeout=20.0).raise_for_error()


def test_a_plan_with_a_part_that_is_gone_is_refused(driver, home):
    driver.change_cell([part(home), FAR])
    goal = Goal(
        waypoints=(Waypoint(pose=home(z=0.02)),),
        part_changes=(PartChange(waypoint=0, body='part'),),
    )
    planned = driver.plan(goal)
    driver.change_cell(remove=['part'])
    with pytest.raises(InvalidGoal, match=r'part_changes\[0\].body names what is not there'):
        driver.start(planned)


@pytest.mark.parametrize('execution', ExecutionMode.__members__)
def test_a_body_in_the_way_stops_the_running_goal(driver, home, execution):
    """The near side of the board is judged by the pose of the TCP, not by our distances."""
    driver, mode = driver, ExecutionMode[execution]
    safe = SafeOutput(output=OutputKind.STANDARD_DIGITAL, pin=2, value=1.0)
    points = [Waypoint(pose=home(y=0.05 * k), time=1.5 * k) for k in (1, 2, 3, 4)]
    motion = driver.start(
        driver.plan(Goal(waypoints=points, execution=mode, safe_outputs=(safe,)))
    )
    wait_for(lambda: driver.progress is not None and driver.progress.fraction > 0.1, 10.0)
    driver.change_cell([FAR])  # harmless
    driver.change_cell([wall(home, 0.2)])
    outcome = motion.result(10.0)
    assert outcome.code is ErrorCode.COLLISION
    assert outcome.text.startswith('The cell has changed, and the rest of the path would to')
    assert 'wall' in outcome.text
    travelled = driver.state.actual_tcp_pose.position[1] - home().position[1]
    assert 0.0 < travelled < 0.15
    wait_for(lambda: driver.signals.outputs.standard[2], 5.0)
    driver.set_digital_output(OutputKind.STANDARD_DIGITAL, 2, high=False)
    driver.change_cell(remove=['wall'])
    driver.execute(Goal(waypoints=(Waypoint(pose=home()),)), timeout=20.0).raise_for_error()


def test_a_harmless_change_disturbs_no_goal(driver, home):
    motion = driver.start(driver.plan(Goal(waypoints=(Waypoint(pose=home(y=0.1), time=1.0),))))
    wait_for(lambda: driver.progress is not None, 10.0)
    for k in range(20):
        driver.change_cell(
            [CellBody(name='far', shapes=SMALL, T_frame_body=Pose((0.0, -1.5 - 0.01 * k, 0.5)))]
        )
    assert motion.result(10.0).succeeded
    driver.execute(Goal(waypoints=(Waypoint(pose=home()),)), timeout=20.0).raise_for_error()


def test_points_that_were_appended_are_checked_too(driver, home):
    goal = Goal(waypoints=(Waypoint(pose=home(y=0.02)), Waypoint(pose=home())), keep_open=True)
    motion = driver.start(driver.plan(goal))
    wait_for(lambda: driver.progress is not None, 10.0)
    motion.append([Waypoint(pose=home(z=0.02)), Waypoint(pose=home(y=0.2, z=0.02))])
    driver.change_cell([wall(home, 0.2)])
    outcome = motion.result(20.0)
    assert outcome.code is ErrorCode.COLLISION
    assert (
        np.linalg.norm(np.subtract(driver.state.actual_tcp_pose.position, home().position)) < 0.1
    )
    driver.change_cell(remove=['wall'])
    driver.execute(Goal(waypoints=(Waypoint(pose=home()),)), timeout=20.0).raise_for_error()


@pytest.mark.parametrize('execution', ['PRIMITIVES', 'SERVO'])
def test_a_body_beside_the_path_stops_a_goal_that_offsets_may_lead_there(driver, home, execution):
    """The body is far enough from the path itself, and too near to the band of the offsets."""
    x, y, z = home().position
    shape = PlacedShape(Box((0.02, 0.3, 0.02)))
    place = Pose((x + 0.0315 + 0.05, y + 0.15, z + 0.005))  # 40 mm beside the flange
    body = CellBody(name='rail', shapes=(shape,), T_frame_body=place)
    outcomes = []
    wide = PathOffset(limits=(0.0, 0.045, 0.0), speed=0.05, acceleration=1.0)
    for band in (PathOffset(), wide):
        points = [Waypoint(pose=home(y=0.06 * k), time=1.5 * k) for k in (1, 2)]
        goal = Goal(
            waypoints=points,
            execution=ExecutionMode[execution],
            path_offset=band,
            goal_time_tolerance=-1.0,  # a busy computer may be late with its set-points
        )
        motion = driver.start(driver.plan(goal))
        wait_for(lambda: driver.progress is not None and driver.progress.fraction > 0.1, 10.0)
        driver.change_cell([body])
        outcomes.append(motion.result(20.0))
        driver.change_cell(remove=['rail'])
        driver.execute(Goal(waypoints=(Waypoint(pose=home()),)), timeout=20.0).raise_for_error()
    assert outcomes[0].succeeded, outcomes[0]
    assert outcomes[1].code is ErrorCode.COLLISION
    assert 'With a path offset of' in outcomes[1].text


def test_live_targets_stop_before_a_body_that_has_come(driver, home):
    session = driver.start_live_session(home(y=0.05))
    wait_for(lambda: driver.state.actual_tcp_pose.position[1] > home(y=0.005).position[1], 10.0)
    driver.change_cell([wall(home, 0.25)])
    outcome = session.motion.result(10.0)
    assert outcome.code is ErrorCode.PREEMPTED
    assert 'a session in the changed cell took the place of this one' in outcome.text.lower()
    motion = driver.send_live_target(home(y=0.3))

    def rests():
        assert driver.send_live_target(home(y=0.3)) is motion
        sleep(0.02)
        moved = driver.state.actual_tcp_pose.position[1] - home(y=0.05).position[1]
        return moved > 0.02 and max(map(abs, driver.state.actual_qd)) < 1e-3

    wait_for(rests, 20.0)
    # The flange is 63 mm wide, the clearance 5 mm.
    assert driver.state.actual_tcp_pose.position[1] < home(y=0.25 - 0.0315).position[1]
    motion.cancel()
    motion.result(10.0)
