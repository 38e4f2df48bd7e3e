# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Goals with an open end: records sent in time, held back, and forgotten."""

from dataclasses import replace

from goal_machines import append_machine
import numpy as np

from ur_cartesian_driver.execution.goal.appended_records import CLOSED_BY_CLIENT
from ur_cartesian_driver.execution.goal.goal_commands import (
    AnswerAppend,
    Finish,
    SendControl,
    SendPoints,
    SetTemporaryTcp,
)
from ur_cartesian_driver.execution.goal.goal_transitions import GoalState
from ur_cartesian_driver.execution.goal.motion_job import AppendJob, MotionJob
from ur_cartesian_driver.execution.goal.wire_records import WireRecords
from ur_cartesian_driver.execution.points.append_feeder import (
    FIRST_POINTS_TIMEOUT,
)
from ur_cartesian_driver.motion.events import StateReceived, TrajectoryEnded, TrajectoryResult
from ur_cartesian_driver.motion.geometry.pose import IDENTITY, Pose
from ur_cartesian_driver.motion.plan.plan import ReferencePath
from ur_cartesian_driver.motion.state.rtde_state import RobotState, RuntimeState
from ur_cartesian_driver.protocol.program.reverse import TrajectoryAction

SPEED, STEP = 0.1, 0.1
NOZZLE = Pose((0.0, 0.0, 0.1))


def job(first, count, **fields):
    """Points on a line, 0.1 s apart, the first one at the place with the number ``first``."""
    k = np.arange(first - 1, first + count)
    poses = np.zeros((count + 1, 7))
    poses[:, 0], poses[:, 6] = SPEED * STEP * k, 1.0
    return MotionJob(
        **{
            'points': count,
            'duration': STEP * (first + count - 1),
            'keep_open': True,
            'ending_records': 1,
            'reference': ReferencePath(
                poses=poses, point=np.maximum(k - 1, first - 1).astype(np.int32), time=STEP * k
            ),
            'waypoint': np.arange(first - 1, first - 1 + count, dtype=np.int32),
        }
        | fields
    )


def packet(time, begun=0, moves=True, T_flange_tcp=IDENTITY):
    """Return a packet of a robot that is where the plan has it at a time."""
    pose, v = Pose((SPEED * time, 0.0, 0.0)), SPEED if moves else 0.0
    return StateReceived(
        state=RobotState(
            timestamp=time,
            actual_q=(time,) * 6,
            target_q=(time,) * 6,
            actual_qd=(v,) * 6,
            actual_tcp_pose=pose,
            target_tcp_pose=pose,
            target_tcp_twist=(v, 0, 0, 0, 0, 0),
            points_begun=begun,
            runtime_state=RuntimeState.PLAYING,
            T_flange_tcp=T_flange_tcp,
        )
    )


def run(machine, begin, end):
    """Move the arm from time to time [s]; return the commands."""
    times = np.arange(round(begin / 0.02), round(end / 0.02) + 1) * 0.02
    return [
        c for t in times.tolist() for c in machine.step(packet(t, int(t / STEP + 1e-9) + 1), t)
    ]


def sent(commands):
    return [(c.first, c.end) for c in commands if isinstance(c, SendPoints)]


def actions(commands):
    return [(c.action, c.count) for c in commands if isinstance(c, SendControl)]


def started(count=30, **settings):
    machine = append_machine(job(1, count), **settings)
    return machine, machine.start(packet(0.0, moves=False).state)


def test_no_more_is_sent_than_the_horizon_says():
    machine, commands = started(horizon=0.5)
    assert actions(commands) == [(TrajectoryAction.STREAM_START, 0)]
    assert sent(commands) == [(0, 5)]
    end_times = [end for _, end in sent(run(machine, 0.0, 1.0))]
    assert end_times[-1] in (15, 16), (
        'half a second ahead of the arm, and the point in which that ends'
    )


def test_the_ending_is_sent_at_the_margin_and_counted():
    machine, before = started(count=10, margin=0.2)
    before += run(machine, 0.0, 0.68)
    assert sent(before) == [(0, 9)]
    assert actions(before) == [(TrajectoryAction.STREAM_START, 0)]
    closing = run(machine, 0.7, 0.72)
    assert sent(closing) == [(9, 10)]
    assert actions(closing) == [(TrajectoryAction.STREAM_END, 10)]
    assert machine.state is GoalState.RUNNING_OUT


def test_points_that_come_in_time_take_the_place_of_the_ending():
    machine, _ = started(count=10)
    run(machine, 0.0, 0.68)
    commands = machine.step(AppendJob(number=7, records_before=9, job=job(10, 11)), 0.69)
    assert commands[0] == AnswerAppend(number=7)
    assert sent(commands) == [(9, 17)], 'the new one of this number, a second ahead'
    assert actions(run(machine, 0.7, 1.2)) == []
    assert machine.state is GoalState.MOVING


def test_points_for_a_motion_that_was_closed_have_to_begin_at_rest():
    machine, _ = started(count=10)
    run(machine, 0.0, 0.72)
    (answer,) = machine.step(AppendJob(number=1, records_before=9, job=job(10, 5)), 0.73)
    assert answer.replan_from_rest
    assert answer.refusal == 'The motion was closed before these points came.'
    later = replace(job(11, 5), reference=job(11, 5).reference)
    assert machine.step(AppendJob(number=2, records_before=10, job=later), 0.74) == [
        AnswerAppend(number=2)
    ], 'they wait until the arm is at rest'
    run(machine, 0.76, 0.98)
    machine.step(packet(1.0, 10, moves=False), 1.0)
    commands = machine.step(TrajectoryEnded(result=TrajectoryResult.SUCCESS), 1.01)
    commands += machine.step(packet(1.0, 10, moves=False), 1.02)
    assert actions(commands) == [(TrajectoryAction.STREAM_START, 0)]
    assert sent(commands) == [(10, 14)]
    assert machine.state is GoalState.MOVING


def test_a_motion_goes_on_when_a_packet_shows_the_arm_at_rest_and_counts_its_own_records():
    machine, _ = started(count=10)
    run(machine, 0.0, 0.72)
    machine.step(AppendJob(number=1, records_before=10, job=job(11, 5)), 0.74)
    run(machine, 0.76, 0.98)
    success = TrajectoryEnded(result=TrajectoryResult.SUCCESS)
    assert actions(machine.step(success, 1.0)) == [], 'packets may be late'
    commands = machine.step(packet(1.0, 10, moves=False), 1.02)
    assert actions(commands) == [(TrajectoryAction.STREAM_START, 0)]
    commands = machine.step(AppendJob(number=2, records_before=0, job=None), 1.04)
    assert actions(commands) == [(TrajectoryAction.STREAM_END, 5)]


def test_the_time_at_rest_makes_nothing_late():
    machine, _ = started(count=10)
    machine.feeder.monitor.job = replace(machine.job, goal_time_tolerance=0.2)
    run(machine, 0.0, 0.98)
    for k in range(100):
        machine.step(rest_at(1.0 + 0.01 * k, 1.0, 10), 1.0 + 0.01 * k)
    machine.step(TrajectoryEnded(result=TrajectoryResult.SUCCESS), 2.0)
    machine.step(
        AppendJob(
            number=1,
            records_before=10,
            job=job(11, 5, keep_open=False, ending_records=0, due=1.5, goal_time_tolerance=0.2),
        ),
        2.0,
    )
    machine.step(rest_at(2.02, 1.0, 10), 2.02)
    for k in range(1, 26):
        machine.step(rest_at(2.02 + 0.02 * k, 1.0 + 0.02 * k, 1 + k // 5), 2.02 + 0.02 * k)
    commands = machine.step(TrajectoryEnded(result=TrajectoryResult.SUCCESS), 2.6)
    commands += machine.step(rest_at(2.6, 1.5, 5), 2.6)
    (outcome,) = [c.outcome for c in commands if isinstance(c, Finish)]
    assert outcome.succeeded, outcome.text


def rest_at(time, place, begun):
    """Return a packet of a robot at rest where the plan has it at another time."""
    return StateReceived(state=replace(packet(place, begun, moves=False).state, timestamp=time))


def test_points_said_to_be_the_last_are_sent_with_their_ending():
    machine, _ = started(count=10)
    commands = machine.step(AppendJob(number=1, records_before=0, job=None), 0.01)
    assert sent(commands) == [(9, 10)]
    assert actions(commands) == [(TrajectoryAction.STREAM_END, 10)]
    (answer,) = machine.step(AppendJob(number=2, records_before=10, job=job(11, 5)), 0.02)
    assert answer.refusal == CLOSED_BY_CLIENT


def test_a_goal_that_is_only_an_ending_waits_a_moment_for_more():
    machine, commands = started(count=1)
    assert sent(commands) == []
    assert sent(machine.step(packet(0.0, moves=False), 0.0)) == []
    still = replace(packet(0.0, moves=False).state, timestamp=FIRST_POINTS_TIMEOUT)
    assert sent(machine.step(StateReceived(state=still), FIRST_POINTS_TIMEOUT)) == [(0, 1)]


def test_points_may_come_before_the_tcp_of_the_goal_is_set():
    machine = append_machine(job(1, 5, T_flange_tcp=NOZZLE))
    (lend,) = machine.start(packet(0.0, moves=False).state)
    assert isinstance(lend, SetTemporaryTcp)
    assert machine.step(
        AppendJob(number=1, records_before=4, job=job(5, 10, T_flange_tcp=NOZZLE)), 0.01
    ) == [AnswerAppend(number=1)]
    commands = machine.step(packet(0.0, moves=False, T_flange_tcp=NOZZLE), 0.02)
    assert machine.state is GoalState.MOVING
    assert sent(commands)[0][0] == 0


def test_records_behind_the_arm_are_forgotten():
    machine, _ = started(count=20)
    records_before, held = 19, []
    for k in range(8):
        run(machine, 1.5 * k, 1.5 * (k + 1) - 0.02)
        machine.step(
            AppendJob(
                number=k, records_before=records_before, job=job(records_before + 1, 15 + 1)
            ),
            0.0,
        )
        records_before += 15
        monitor = machine.feeder.monitor
        held.append((monitor.records.kept, len(monitor._tracker.path.time)))
    assert max(records for records, _ in held) < 40
    assert max(rows for _, rows in held) < 60
    assert machine.state is GoalState.MOVING


def test_records_keep_their_numbers_when_earlier_ones_are_forgotten():
    whole, forgetful = WireRecords(job(1, 30)), WireRecords(job(1, 30))
    forgetful.forget(12)
    assert forgetful.kept == 18
    for k in range(13, 31):
        assert forgetful.begun_records(k) == whole.begun_records(k)
        assert forgetful.end_time(k) == whole.end_time(k)
        assert forgetful.count_before_waypoint(k - 1) == whole.count_before_waypoint(k - 1)
    assert [forgetful.running_waypoints(k) for k in range(14, 31)] == [
        whole.running_waypoints(k) for k in range(14, 31)
    ]
    assert forgetful.total == whole.total
