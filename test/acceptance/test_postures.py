# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Configurations: the arm arrives in the one asked for, and the pose always wins."""

from math import cos, pi, sin

import pytest
from wire_decoding import decode_point

from ur_cartesian_driver.kinematics.inverse import nearest
from ur_cartesian_driver.kinematics.robot_models import JOINT_NAMES
from ur_cartesian_driver.motion.errors import ErrorCode
from ur_cartesian_driver.motion.geometry.pose import Pose
from ur_cartesian_driver.motion.goal.goal import Goal, Posture, Segment, SegmentType, Waypoint
from ur_cartesian_driver.motion.plan.primitive import MoveC, MoveJ, MoveL
from ur_cartesian_driver.protocol.program.point_fields import motion_type, MotionType

pytestmark = [pytest.mark.acceptance, pytest.mark.slow, pytest.mark.exhaustive]


def full(q, off=0.0):
    return Posture(names=JOINT_NAMES, values=tuple(v + off for v in q))


def test_a_joint_approach_with_lines_and_arcs_arrives_in_its_postures(
    driver, home, record, trajectory_bytes
):
    """The acceptance of everything that carries a posture, with postures 0.1 rad off."""
    arm, q0 = driver.arm, driver.state.actual_q
    start = home(x=0.05, y=-0.1)
    q_start = nearest(arm, start, q0)

    def on_circle(angle):
        """A circle of 8 cm around a centre beside the start of the arcs."""
        return home(x=0.13 - 0.08 * cos(angle), y=0.08 * sin(angle))

    # approach, two lines with blends, four arcs of 60 degrees
    points = [start, home(x=0.05, y=-0.02), home(x=0.05, y=0.0, z=0.02), on_circle(0.0)]
    segments = [
        Segment(type=SegmentType.JOINT),
        Segment(blend_radius=0.01),
        Segment(blend_radius=0.005),
        Segment(),
    ]
    postures = [full(q_start, 0.1), Posture(), Posture(), Posture()]
    for i, (target, via) in enumerate(
        [(False, False), (True, True), (True, False), (False, True)]
    ):
        begin = i * pi / 3
        end_pose, via_pose = on_circle(begin + pi / 3), on_circle(begin + pi / 6)
        q_end, q_via = (nearest(arm, pose, q_start) for pose in (end_pose, via_pose))
        points.append(end_pose)
        postures.append(full(q_end, 0.1) if target else Posture())
        segments.append(
            Segment(
                type=SegmentType.CIRCULAR,
                via=via_pose,
                velocity=0.1,
                via_posture=full(q_via, 0.1) if via else Posture(),
            )
        )
    goal = Goal(
        segments=tuple(segments),
        waypoints=tuple(
            Waypoint(pose=pose, posture=posture)
            for pose, posture in zip(points, postures, strict=True)
        ),
    )

    with record() as recording:
        outcome = driver.execute(goal, timeout=60.0)
    assert outcome.code is ErrorCode.SUCCESSFUL, outcome.text

    sent = [decode_point(point) for point in trajectory_bytes()]
    assert [motion_type(p) for p in sent] == [
        MotionType.MOVEJ_POSE,
        MotionType.MOVEL,
        MotionType.MOVEL,
        MotionType.MOVEL,
        MotionType.MOVEC,
        MotionType.MOVEC_JOINT,
        MotionType.MOVEC_JOINT_POSE,
        MotionType.MOVEC_POSE_JOINT,
    ]
    assert isinstance(sent[0], MoveJ)
    assert sent[0].q_near == pytest.approx([v + 0.1 for v in q_start], abs=1e-6)
    assert [p.blend_radius for p in sent[1:4]] == [0.01, 0.005, 0.0]
    assert all(isinstance(p, MoveC) for p in sent[4:])

    reached = [nearest_row(recording, pose) for pose in (start, *points[3:])]
    for pose, (distance, joints) in zip((start, *points[3:]), reached, strict=True):
        assert distance < 0.0001
        assert joints == pytest.approx(nearest(arm, pose, q_start), abs=1e-3)


def nearest_row(recording, pose):
    """Return the smallest distance of the tool to a pose [m] and the joints there."""
    d = ((recording.positions - pose.position) ** 2).sum(axis=1)
    return float(d.min() ** 0.5), recording.joints[int(d.argmin())]


def test_a_partial_posture_chooses_the_elbow(driver, home, trajectory_bytes):
    arm, q0 = driver.arm, driver.state.actual_q
    elbow_down = Posture(names=('elbow_joint',), values=(-1.5,))
    goal = Goal(
        waypoints=(Waypoint(pose=home(x=0.02), posture=elbow_down),),
        segments=(Segment(type=SegmentType.JOINT, velocity=1.5, acceleration=3.0),),
    )
    outcome = driver.execute(goal, timeout=30.0)
    assert outcome.code is ErrorCode.SUCCESSFUL, outcome.text
    q = driver.state.actual_q
    assert q0[2] > 0.0 > q[2]
    assert arm.forward(q).distance_to(home(x=0.02)) < 0.0001
    (point,) = (decode_point(p) for p in trajectory_bytes())
    assert motion_type(point) is MotionType.MOVEJ_POSE
    assert point.q_near == pytest.approx(q, abs=1e-4)


def test_a_line_carries_its_posture_on_the_wire(driver, home, trajectory_bytes):
    q = nearest(driver.arm, home(y=0.05), driver.state.actual_q)
    goal = Goal(
        waypoints=(
            Waypoint(pose=home(y=0.05), time=1.0, posture=full(q)),
            Waypoint(pose=home(), time=2.0),
        )
    )
    assert driver.execute(goal, timeout=30.0).succeeded
    with_posture, without = (decode_point(p) for p in trajectory_bytes())
    assert isinstance(with_posture, MoveL)
    assert with_posture.q_near == pytest.approx(q, abs=1e-6)
    assert without.q_near is None


def test_a_line_that_cannot_change_the_configuration_is_refused(driver, home, trajectory_bytes):
    flipped = Posture(names=('elbow_joint',), values=(-1.5,))
    goal = Goal(waypoints=(Waypoint(pose=home(y=0.05), time=1.0, posture=flipped),))
    outcome = driver.execute(goal)
    assert outcome.code is ErrorCode.INVALID_POSTURE
    assert 'elbow_joint' in outcome.text
    assert trajectory_bytes() == []


def test_poses_are_those_of_the_active_tcp(driver, ur_sim, home, record):
    """A nozzle of 20 cm: the nozzle, and not the flange, goes along the line."""
    del home
    nozzle = Pose((0.0, 0.0, 0.2))
    ur_sim.call(lambda controller: setattr(controller.motion, 'T_flange_tcp', nozzle))
    while driver.state.T_flange_tcp.distance_to(nozzle) > 1e-9:
        pass
    pose = driver.state.actual_tcp_pose
    target = Pose((pose.position[0], pose.position[1] + 0.1, pose.position[2]), pose.quaternion)
    with record() as recording:
        assert driver.execute(
            Goal(waypoints=(Waypoint(pose=target, time=1.0),)), timeout=30.0
        ).succeeded
    assert recording.positions[-1] == pytest.approx(target.position, abs=1e-4)
