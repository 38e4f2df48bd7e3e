# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Goals about another frame than the robot's TCP: the named frame stays on its line or arc.

Its pose follows from the joints that an RTDE connection of the test reports, by the product of the
link matrices of a textbook; nothing of the package computes it.
"""

import contextlib
from math import pi
import os
import signal

from forward_model import dh_forward
from matrices import pose_from_matrix
import numpy as np
import pytest
from robot_ports import fetch_program
from waiting import wait_for

from ur_cartesian_driver.driver import ConnectionState
from ur_cartesian_driver.kinematics.robot_models import MODELS
from ur_cartesian_driver.motion.errors import ErrorCode
from ur_cartesian_driver.motion.geometry.pose import (
    IDENTITY,
    Pose,
    quaternion_from_rotation_vector,
)
from ur_cartesian_driver.motion.goal.goal import ArcMode, Goal, Segment, SegmentType, Waypoint
from ur_cartesian_driver.program import wrap_in_program
from ur_cartesian_driver.program.render import PREFIX
from ur_cartesian_driver.sim.calibration import random_calibration

pytestmark = [pytest.mark.acceptance, pytest.mark.slow, pytest.mark.exhaustive]

#: Digits that the wire cannot carry, so that only who remembers can put it back.
TCP = Pose((0.0123456789, -0.02, 0.1), quaternion_from_rotation_vector((0.1, 0.2123456789, -0.3)))
NOZZLE = Pose((0.05, -0.03, 0.16), quaternion_from_rotation_vector((0.5, -0.4, 0.3)))
FLANGE = Pose((0.0, 0.0, 0.0), (-0.5, -0.5, -0.5, 0.5))
QUARTER = pi / 2.0


def places(geometry, joints, T_flange_frame):
    """Return the poses of a frame that is fixed to the flange, as matrices (n, 4, 4)."""
    return np.array([dh_forward(geometry, q) @ T_flange_frame.matrix() for q in joints])


def tcp_of(ur_sim):
    return ur_sim.call(lambda controller: controller.motion.T_flange_tcp)


def set_tcp(ur_sim, pose):
    """Set the TCP as another client does."""
    numbers = ', '.join(f'{v!r}' for v in pose.rotation_vector())
    ur_sim.run_script(f'sec theirs():\n  set_tcp(p[{numbers}])\nend\n')
    wait_for(lambda: tcp_of(ur_sim).distance_to(pose) < 1e-12)


def has_own_tcp(ur_sim, within=1e-12):
    tcp = tcp_of(ur_sim)
    return tcp.distance_to(TCP) < within and tcp.angle_to(TCP) < max(within, 1e-9)


@pytest.fixture
def tooled(driver, ur_sim):
    """A driver whose robot has a TCP, which is there at the end too."""
    set_tcp(ur_sim, TCP)
    wait_for(lambda: driver.state.T_flange_tcp.distance_to(TCP) < 1e-9)
    yield driver
    assert has_own_tcp(ur_sim, 1e-11)


def stand(driver, T_flange_frame):
    """Return the pose of a frame fixed to the flange, by the robot's own report."""
    state = driver.state
    return state.actual_tcp_pose @ state.T_flange_tcp.inverse() @ T_flange_frame


def moved(pose, x=0.0, y=0.0, z=0.0, turn=0.0):
    """Return a pose moved [m] along the axes of base, and turned [rad] about a skew one."""
    a, b, c = pose.position
    axis = np.array([0.1, -0.2, 1.0])
    turned = (
        Pose(
            (0.0, 0.0, 0.0),
            quaternion_from_rotation_vector(tuple(turn * axis / np.linalg.norm(axis))),
        )
        @ pose
    )
    return Pose((a + x, b + y, c + z), turned.quaternion)


def goal_of(points, frame, T_flange_frame=None, segments=()):
    """Return a goal of (time, pose in base), given in another frame."""
    return Goal(
        waypoints=tuple(Waypoint(pose=frame.inverse() @ pose, time=time) for time, pose in points),
        segments=segments,
        T_base_frame=frame,
        T_flange_controlled=T_flange_frame,
        controlled_frame='' if T_flange_frame is None else 'nozzle',
    )


def off_line(points, a, b):
    along = np.clip((points - a) @ (b - a) / ((b - a) @ (b - a)), 0.0, 1.0)
    return np.linalg.norm(points - a - along[:, None] * (b - a), axis=1)


def off_circle(points, a, via, b):
    """Return the distances to the circle through three points."""
    u, v = via - a, b - a
    w = np.cross(u, v)
    center = a + (np.cross(w, u) * (v @ v) + np.cross(v, w) * (u @ u)) / (2.0 * w @ w)
    axis, radius = w / np.linalg.norm(w), np.linalg.norm(center - a)
    away = points - center
    height = away @ axis
    flat = np.linalg.norm(away - height[:, None] * axis, axis=1)
    return np.hypot(height, flat - radius)


BASE_LINK = Pose((0.0, 0.0, 0.0), (0.0, 0.0, 1.0, 0.0))
TABLE = Pose((0.2, -0.3, 0.1), quaternion_from_rotation_vector((0.2, 0.4, 1.0)))


@pytest.mark.parametrize(
    ('T_flange_frame', 'frame'),
    [
        pytest.param(
            NOZZLE, BASE_LINK, id='nozzle in base_link', marks=pytest.mark.ur_sim(frequency=125.0)
        ),
        *(
            pytest.param(
                T,
                TABLE,
                id=f'{name} in a static frame, calibrated',
                marks=pytest.mark.ur_sim(
                    frequency=125.0, geometry=random_calibration(MODELS['ur5e'], 3)
                ),
            )
            for name, T in (('tool0', IDENTITY), ('flange', FLANGE))
        ),
    ],
)
def test_the_named_frame_keeps_to_line_and_arcs_while_it_turns(
    tooled, ur_sim, record, T_flange_frame, frame
):
    start = stand(tooled, T_flange_frame)
    corners = [
        start,
        moved(start, y=0.1, turn=QUARTER),
        # An arc with a time turns the tool by less rad than it moves m.
        moved(start, y=0.1, z=0.1, turn=QUARTER - 0.1),
        moved(start, z=0.1),
    ]
    vias = [None, moved(start, y=0.12, z=0.05), moved(start, x=0.02, y=0.05, z=0.1)]
    goal = goal_of(
        [(1.2 * (k + 1), pose) for k, pose in enumerate(corners[1:])],
        frame,
        T_flange_frame,
        segments=(
            Segment(),
            *(
                Segment(type=SegmentType.CIRCULAR, via=frame.inverse() @ via, arc_mode=mode)
                for via, mode in zip(vias[1:], (ArcMode.UNCONSTRAINED, ArcMode.FIXED), strict=True)
            ),
        ),
    )
    seen = []
    with record() as recording:
        outcome = tooled.execute(goal, on_progress=seen.append, timeout=20.0)
    assert outcome.succeeded, outcome.text
    assert outcome.report[-1] == (
        'the TCP of the robot was set for the goal, and is what it was before'
    )
    assert has_own_tcp(ur_sim)

    geometry = ur_sim.config.geometry or MODELS['ur5e'].geometry
    where = places(geometry, recording.joints, T_flange_frame)
    points = where[:, :3, 3]
    a, b, c, d = (np.array(pose.position) for pose in corners)
    via_1, via_2 = (np.array(via.position) for via in vias[1:])
    off = np.min(
        [off_line(points, a, b), off_circle(points, b, via_1, c), off_circle(points, c, via_2, d)],
        axis=0,
    )
    assert off.max() < 1e-4
    for place in (a, b, c, d, via_1, via_2):
        assert np.linalg.norm(points - place, axis=1).min() < 0.003
    turned = np.array([pose_from_matrix(T).angle_to(start) for T in where])
    assert turned.max() > QUARTER - 1e-3
    # Feedback reports the named frame, not the TCP.
    reported = np.array([progress.actual_pose.position for progress in seen])
    assert max(np.linalg.norm(points - place, axis=1).min() for place in reported) < 0.003


@pytest.mark.ur_sim(frequency=125.0)
def test_a_frame_at_the_active_tcp_sets_no_tcp(tooled, ur_sim):
    start = tooled.state.actual_tcp_pose
    near = TCP @ Pose((1e-6, 0.0, 0.0))
    outcome = tooled.execute(goal_of([(0.3, moved(start, y=0.01))], BASE_LINK, near), timeout=9.0)
    assert outcome.succeeded, outcome.text
    assert not any('TCP' in line for line in outcome.report)


@pytest.mark.ur_sim(frequency=125.0)
def test_the_next_goal_finds_the_original_tcp(tooled, ur_sim):
    for k in range(4):
        nozzle = k % 2 == 0
        start = stand(tooled, NOZZLE if nozzle else TCP)
        target = moved(start, y=0.01)
        outcome = tooled.execute(
            goal_of([(0.2, target)], IDENTITY, NOZZLE if nozzle else None), timeout=9.0
        )
        assert outcome.succeeded, outcome.text
        assert tooled.state.T_flange_tcp.distance_to(TCP) < 1e-9
        assert stand(tooled, NOZZLE if nozzle else TCP).distance_to(target) < 1e-4


@pytest.mark.ur_sim(frequency=125.0)
def test_a_tcp_that_is_changed_between_goals_is_the_one_that_moves(tooled, ur_sim):
    set_tcp(ur_sim, NOZZLE)
    wait_for(lambda: tooled.state.T_flange_tcp.distance_to(NOZZLE) < 1e-9)
    target = moved(tooled.state.actual_tcp_pose, y=0.01)
    plan = tooled.plan(goal_of([(0.2, target)], IDENTITY))
    assert tooled.start(plan).result(9.0).succeeded
    assert stand(tooled, NOZZLE).distance_to(target) < 1e-4
    set_tcp(ur_sim, TCP)
    wait_for(lambda: tooled.state.T_flange_tcp.distance_to(TCP) < 1e-9)
    # A plan for a TCP that is gone would go somewhere else.
    outcome = tooled.start(plan).result(9.0)
    assert outcome.code is ErrorCode.ROBOT_NOT_READY
    assert 'TCP of the robot changed' in outcome.text


def moving(driver, turn=QUARTER):
    """Start a long goal of the nozzle and return its motion when the arm moves."""
    start = stand(driver, NOZZLE)
    motion = driver.start(
        driver.plan(goal_of([(5.0, moved(start, y=0.2, turn=turn))], IDENTITY, NOZZLE))
    )
    wait_for(lambda: max(map(abs, driver.state.actual_qd)) > 0.02)
    assert driver.state.T_flange_tcp.distance_to(NOZZLE) < 1e-6
    return motion


@pytest.mark.ur_sim(frequency=125.0)
def test_a_cancel_restores_the_tcp_before_its_result(tooled, ur_sim):
    motion = moving(tooled)
    motion.cancel()
    assert motion.result(4.0).code is ErrorCode.CANCELLED
    assert has_own_tcp(ur_sim)
    tooled.wait_ready(0.0)


@pytest.mark.ur_sim(frequency=125.0, unlock_delay=0.1)
@pytest.mark.parametrize('stop', ['protective_stop', 'emergency_stop', 'stop_program'])
def test_a_stop_of_the_robot_restores_the_tcp(tooled, ur_sim, stop):
    motion = moving(tooled)
    getattr(ur_sim, stop)()
    outcome = motion.result(4.0)
    assert outcome.code in (
        ErrorCode.PROTECTIVE_STOP,
        ErrorCode.EMERGENCY_STOP,
        ErrorCode.PROGRAM_STOPPED,
    )
    wait_for(lambda: has_own_tcp(ur_sim, 1e-11))
    if stop == 'protective_stop':
        wait_for(lambda: unlocked(ur_sim))
        tooled.resend_robot_program()
        tooled.wait_ready(30.0)


def unlocked(ur_sim):
    """Unlock; a robot refuses that for some time."""
    with contextlib.suppress(RuntimeError):
        ur_sim.unlock_protective_stop()
        return True


@pytest.mark.ur_sim(frequency=125.0, unlock_delay=0.1)
def test_without_headless_mode_the_next_program_restores_the_tcp_before_a_goal(
    make_driver, ur_sim
):
    set_tcp(ur_sim, TCP)
    driver = make_driver(headless_mode=False)
    wait_for(lambda: driver.status.state is ConnectionState.CONNECTED)
    text = wrap_in_program(fetch_program(driver))
    ur_sim.run_script(text)
    driver.wait_ready(30.0)
    motion = moving(driver)
    ur_sim.stop_program()
    assert motion.result(4.0).code is ErrorCode.PROGRAM_STOPPED
    assert tcp_of(ur_sim).distance_to(NOZZLE) < 1e-6
    ur_sim.run_script(text)
    driver.wait_ready(30.0)
    assert has_own_tcp(ur_sim, 1e-6)
    assert driver.state.T_flange_tcp.distance_to(TCP) < 1e-6


@pytest.mark.ur_sim(frequency=125.0)
def test_a_tcp_set_by_another_client_after_a_stop_is_kept(driver, ur_sim):
    set_tcp(ur_sim, TCP)
    wait_for(lambda: driver.state.T_flange_tcp.distance_to(TCP) < 1e-9)
    theirs = Pose((0.0, 0.0, 0.3))
    motion = moving(driver)

    def stop_and_set_tcp(controller):  # in one cycle, so that nobody comes in between
        controller.programs.stop()
        controller.motion.T_flange_tcp = theirs

    ur_sim.call(stop_and_set_tcp)
    assert motion.result(4.0).code is ErrorCode.PROGRAM_STOPPED
    driver.resend_robot_program()
    driver.wait_ready(30.0)
    assert tcp_of(ur_sim) == theirs


@pytest.mark.ur_sim(frequency=125.0)
def test_the_robot_program_restores_the_tcp_when_the_driver_dies(make_driver, ur_sim):
    set_tcp(ur_sim, TCP)
    driver = make_driver(robot_loop='process')
    driver.wait_ready(30.0)
    motion = moving(driver)
    os.kill(driver._loop.host.pid, signal.SIGKILL)
    assert motion.result(5.0).code is ErrorCode.CONNECTION_LOST
    wait_for(lambda: has_own_tcp(ur_sim))


@pytest.mark.ur_sim(frequency=125.0)
@pytest.mark.parametrize(
    ('interface', 'code'),
    [('rtde', ErrorCode.CONNECTION_LOST), ('reverse', ErrorCode.PROGRAM_STOPPED)],
)
def test_a_broken_connection_restores_the_tcp(tooled, ur_sim, interface, code):
    motion = moving(tooled)
    if interface == 'rtde':
        ur_sim.inject('drop rtde')
    else:
        ur_sim.call(lambda controller: controller.sockets.close_all())
    assert motion.result(5.0).code is code
    wait_for(lambda: has_own_tcp(ur_sim))


@pytest.mark.ur_sim(frequency=125.0)
@pytest.mark.parametrize(
    ('stop', 'code', 'text'),
    [
        (None, ErrorCode.ROBOT_NOT_READY, 'did not take the TCP of the goal'),
        ('cancel', ErrorCode.CANCELLED, 'before anything moved'),
        ('protective_stop', ErrorCode.PROTECTIVE_STOP, 'before anything moved'),
    ],
)
def test_nothing_moves_when_the_robot_does_not_set_the_tcp(make_driver, ur_sim, stop, code, text):
    set_tcp(ur_sim, TCP)
    driver = make_driver(headless_mode=False)
    wait_for(lambda: driver.status.state is ConnectionState.CONNECTED)
    program = wrap_in_program(fetch_program(driver))
    line = f'{PREFIX}apply_tcp({PREFIX}pose_at(command, 2), command[8])'
    assert line in program
    ur_sim.run_script(program.replace(line, 'textmsg("no TCP")'))
    driver.wait_ready(30.0)
    q = ur_sim.state().q
    start = stand(driver, NOZZLE)
    motion = driver.start(
        driver.plan(goal_of([(2.0, moved(start, y=0.1, turn=QUARTER))], IDENTITY, NOZZLE))
    )
    wait_for(lambda: 'no TCP' in ur_sim.state().messages)
    if stop == 'cancel':
        motion.cancel()
    elif stop is not None:
        getattr(ur_sim, stop)()
    outcome = motion.result(5.0)
    assert outcome.code is code, outcome.text
    assert text in outcome.text
    assert ur_sim.state().q == q
    assert has_own_tcp(ur_sim)


@pytest.mark.ur_sim(frequency=125.0)
def test_a_robot_loop_restores_the_tcp_that_a_dead_one_left(make_driver, ur_sim):
    """Program and robot loop die at once, so neither can restore it."""
    set_tcp(ur_sim, TCP)
    driver = make_driver(robot_loop='process')
    driver.wait_ready(30.0)
    motion = moving(driver)
    os.kill(driver._loop.host.pid, signal.SIGSTOP)
    ur_sim.stop_program()
    os.kill(driver._loop.host.pid, signal.SIGKILL)
    assert motion.result(5.0).code is ErrorCode.CONNECTION_LOST
    assert not has_own_tcp(ur_sim, 1e-3)
    wait_for(lambda: has_own_tcp(ur_sim, 1e-11))


@pytest.mark.ur_sim(frequency=125.0)
def test_closing_the_driver_during_a_goal_restores_the_tcp(make_driver, ur_sim):
    set_tcp(ur_sim, TCP)
    driver = make_driver()
    driver.wait_ready(30.0)
    moving(driver)
    driver.close()
    wait_for(lambda: has_own_tcp(ur_sim))


@pytest.mark.ur_sim(frequency=125.0)
def test_a_goal_that_must_not_change_the_tcp_is_retargeted(make_driver, ur_sim, record):
    set_tcp(ur_sim, TCP)
    driver = make_driver(options={'allow_tcp_change': False})
    driver.wait_ready(30.0)
    start = stand(driver, NOZZLE)
    end = moved(start, y=0.06)
    goal = goal_of([(0.6, end)], BASE_LINK, NOZZLE)
    seen = []
    with record() as recording:
        outcome = driver.execute(goal, on_progress=seen.append, timeout=9.0)
    assert outcome.succeeded, outcome.text
    points = places(MODELS['ur5e'].geometry, recording.joints, NOZZLE)[:, :3, 3]
    a, b = np.array(start.position), np.array(end.position)
    assert off_line(points, a, b).max() < 1e-4
    assert np.linalg.norm(points - b, axis=1).min() < 1e-4
    assert off_line(np.array([p.actual_pose.position for p in seen]), a, b).max() < 1e-4
    assert has_own_tcp(ur_sim)
    turned = goal_of([(0.6, moved(start, turn=QUARTER))], BASE_LINK, NOZZLE)
    outcome = driver.execute(turned)
    assert outcome.code is ErrorCode.INVALID_GOAL
    assert 'turns nozzle by 90.00 degrees' in outcome.text
