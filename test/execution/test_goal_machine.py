# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""One goal through its machine: the table of states, and the commands."""

from dataclasses import replace
from typing import Any

from goal_machines import append_machine, point_machine
import numpy as np
import pytest

from ur_cartesian_driver.execution.goal.goal_commands import (
    Finish,
    ReportProgress,
    RestoreTcp,
    SendControl,
    SendPoints,
    SetTemporaryTcp,
    StopProgram,
)
from ur_cartesian_driver.execution.goal.goal_transitions import (
    detect_stop,
    GoalState,
    MONITORED_STATES,
    RESUMABLE_STOPS,
    TRANSITIONS,
)
from ur_cartesian_driver.execution.goal.motion_job import MotionJob
from ur_cartesian_driver.execution.goal.outcome_codes import GoalSignal
from ur_cartesian_driver.execution.goal.temporary_tcp import SET_TIMEOUT
from ur_cartesian_driver.execution.goal.timeouts import ARMING_TIMEOUT, CAUSE_TIMEOUT, STOP_TIMEOUT
from ur_cartesian_driver.execution.monitoring.standstill import STANDSTILL_TIMEOUT
from ur_cartesian_driver.execution.points.append_feeder import FIRST_POINTS_TIMEOUT
from ur_cartesian_driver.motion.errors import ErrorCode
from ur_cartesian_driver.motion.events import (
    CancelRequested,
    LinkLost,
    PreemptRequested,
    StateReceived,
    Tick,
    TrajectoryEnded,
    TrajectoryResult,
)
from ur_cartesian_driver.motion.geometry.pose import Pose, quaternion_from_rotation_vector
from ur_cartesian_driver.motion.goal.goal import Tolerance
from ur_cartesian_driver.motion.plan.plan import ReferencePath
from ur_cartesian_driver.motion.state.rtde_state import (
    RobotMode,
    RobotState,
    RuntimeState,
    SafetyMode,
    SafetyStatus,
)
from ur_cartesian_driver.protocol.program.reverse import TrajectoryAction

START, END = (0.4, 0.0, 0.2), (0.6, 0.0, 0.2)
MOVING = (0.1, 0.0, 0.0, 0.0, 0.0, 0.0)
REST = (0.0,) * 6
#: The TCP of the robot, and the TCP of a goal about another frame.
OWN, NOZZLE = Pose((0.0, 0.0, 0.1)), Pose((0.02, 0.0, 0.15))


def job(points=1, **changes):
    positions = np.linspace(START, END, points + 1)
    poses = np.hstack([positions, np.tile([0.0, 0.0, 0.0, 1.0], (points + 1, 1))])
    reference = ReferencePath(
        poses=poses,
        point=np.maximum(np.arange(points + 1) - 1, 0).astype(np.int32),
        time=np.linspace(0.0, 2.0, points + 1),
    )
    return MotionJob(points=points, reference=reference, duration=2.0, **changes)


def robot(part=0.0, timestamp=0.0, qd=MOVING, **changes):
    position = tuple(a + part * (b - a) for a, b in zip(START, END, strict=True))
    fields: dict[str, Any] = {
        'actual_tcp_pose': Pose(position),
        'target_tcp_pose': Pose(position),
        'actual_tcp_twist': MOVING,
        'target_tcp_twist': MOVING,
        'runtime_state': RuntimeState.PLAYING,
    }
    return StateReceived(
        state=RobotState(timestamp=timestamp, actual_q=REST, actual_qd=qd, **fields | changes)
    )


def started(**changes):
    # These robots leap from place to place: where that does not matter it is no deviation.
    machine = point_machine(job(**changes), max_plan_deviation=(0.0, 0.0))
    machine.start(robot().state)
    machine.step(robot(), 0.0)
    return machine


def with_tcp(T_flange_tcp, part=0.0, qd=REST, **changes):
    """Return a packet of a robot that has a TCP, with poses of the goal's TCP."""
    return robot(part, qd=qd, T_flange_tcp=T_flange_tcp, **changes)


def lent(**changes):
    """Return a machine whose goal needs another TCP, in ARMING, and its first commands."""
    machine = point_machine(
        job(T_flange_active=OWN, T_flange_tcp=NOZZLE, **changes), max_plan_deviation=(0.0, 0.0)
    )
    return machine, machine.start(with_tcp(OWN).state)


def armed(**changes):
    machine, _ = lent(**changes)
    machine.step(with_tcp(NOZZLE), 0.0)
    assert machine.state is GoalState.MOVING
    return machine


def brought_to(state):
    if state is GoalState.ARMING:
        return lent()[0]
    if state is GoalState.RESTORING:
        machine = armed()
        machine.step(TrajectoryEnded(result=TrajectoryResult.FAILURE), 1.0)
        assert machine.state is state
        return machine
    if state in (GoalState.RUNNING_OUT, GoalState.AWAITING_POINTS):
        machine = append_machine(
            job(keep_open=True, ending_records=1), max_plan_deviation=(0.0, 0.0)
        )
        machine.start(robot().state)
        machine.step(robot(timestamp=FIRST_POINTS_TIMEOUT), FIRST_POINTS_TIMEOUT)
        if state is GoalState.AWAITING_POINTS:
            machine.step(TrajectoryEnded(result=TrajectoryResult.SUCCESS), 1.0)
        assert machine.state is state
        return machine
    machine = started()
    if state is GoalState.SETTLING:
        machine.step(TrajectoryEnded(result=TrajectoryResult.SUCCESS), 1.0)
    if state in (GoalState.CANCELLING, GoalState.COMING_TO_REST):
        machine.step(CancelRequested(), 1.0)
    if state is GoalState.COMING_TO_REST:
        machine.step(TrajectoryEnded(result=TrajectoryResult.CANCELED), 1.1)
    if state is GoalState.PROGRAM_LOST:
        machine.step(LinkLost(link='program', reason='it hung up'), 1.0)
    if state is GoalState.ENDED:
        machine.step(TrajectoryEnded(result=TrajectoryResult.FAILURE), 1.0)
    assert machine.state is state
    return machine


def outcome(commands):
    (finish,) = [c for c in commands if isinstance(c, Finish)]
    return finish.outcome


def test_a_motion_starts_with_start_and_its_points():
    commands = point_machine(job(points=3)).start(robot().state)
    assert commands == [
        SendControl(action=TrajectoryAction.START, count=3),
        SendPoints(first=0, end=3),
    ]


def test_a_motion_that_arrives_succeeds():
    machine = started()
    machine.step(robot(1.0, timestamp=2.0), 2.0)
    assert not [
        c
        for c in machine.step(TrajectoryEnded(result=TrajectoryResult.SUCCESS), 2.0)
        if isinstance(c, Finish)
    ]
    end = outcome(machine.step(robot(1.0, timestamp=2.01, qd=REST), 2.01))
    assert end.code is ErrorCode.SUCCESSFUL
    assert '2.000 s' in end.text


def test_points_beyond_the_window_wait_for_the_robot():
    machine = point_machine(job(points=2000))
    assert machine.start(robot().state)[1] == SendPoints(first=0, end=500)
    machine.step(robot(0.0), 0.05)
    commands = machine.step(robot(0.0, points_begun=10), 0.1)
    assert SendPoints(first=500, end=510) in commands
    machine.step(CancelRequested(), 0.2)
    assert not [
        c for c in machine.step(robot(0.0, points_begun=50), 0.3) if isinstance(c, SendPoints)
    ]


def test_the_count_of_the_last_trajectory_is_not_taken_for_this_one_s():
    machine = point_machine(job(points=4))
    machine.start(robot(points_begun=4).state)

    def place(count, part):
        (report,) = (
            c
            for c in machine.step(robot(part, points_begun=count), next(times))
            if isinstance(c, ReportProgress)
        )
        return report.progress.waypoint

    times = iter(range(1, 9))
    assert place(4, 0.0) == 0
    assert place(4, 0.0) == 0
    assert place(0, 0.0) == 0
    machine.step(robot(0.8, points_begun=4), next(times))  # a leap: CANCEL goes before the report
    assert place(4, 0.8) >= 2


def test_cancel_brakes_waits_for_the_answer_and_for_rest():
    machine = started()
    cancel = SendControl(action=TrajectoryAction.CANCEL, count=1)
    assert cancel in machine.step(CancelRequested(), 1.0)
    assert machine.step(CancelRequested(), 1.01) == []
    machine.step(TrajectoryEnded(result=TrajectoryResult.CANCELED), 1.1)
    assert not any(isinstance(c, Finish) for c in machine.step(robot(0.3, qd=MOVING), 1.2))
    assert outcome(machine.step(robot(0.3, qd=REST), 1.3)).code is ErrorCode.CANCELLED


@pytest.mark.parametrize(
    ('first', 'second', 'code'),
    [
        (PreemptRequested(by='goal 7'), CancelRequested(), ErrorCode.PREEMPTED),
        (CancelRequested(), PreemptRequested(), ErrorCode.CANCELLED),
    ],
)
def test_of_a_cancel_and_a_preemption_the_first_counts(first, second, code):
    machine = started()
    cancel = SendControl(action=TrajectoryAction.CANCEL, count=1)
    assert cancel in machine.step(first, 1.0)
    assert machine.step(second, 1.01) == []
    machine.step(TrajectoryEnded(result=TrajectoryResult.CANCELED), 1.1)
    assert machine.step(second, 1.15) == []
    end = outcome(machine.step(robot(0.3, qd=REST), 1.3))
    assert end.code is code
    if code is ErrorCode.PREEMPTED:
        assert end.text == 'Goal 7 took the place of this one (on the way to point 0).'


@pytest.mark.parametrize('state', [GoalState.ARMING, GoalState.SETTLING])
def test_a_motion_that_is_preempted_where_nothing_is_to_be_stopped_ends_at_once(state):
    machine = brought_to(state)
    commands = machine.step(PreemptRequested(by='goal 7'), 1.1)
    assert not any(isinstance(c, SendControl) for c in commands)
    commands += machine.step(with_tcp(OWN), 3.0)
    assert outcome(commands).code is ErrorCode.PREEMPTED


def test_a_success_that_overtakes_the_cancel_is_not_its_answer():
    machine = started()
    machine.step(CancelRequested(), 1.0)
    machine.step(TrajectoryEnded(result=TrajectoryResult.SUCCESS), 1.01)
    assert machine.state is GoalState.CANCELLING
    machine.step(TrajectoryEnded(result=TrajectoryResult.CANCELED), 1.02)
    assert outcome(machine.step(robot(1.0, qd=REST), 1.3)).code is ErrorCode.CANCELLED


def test_a_cancel_without_an_answer_ends_the_program_within_the_bound():
    machine = started()
    machine.step(CancelRequested(), 1.0)
    assert machine.step(Tick(), 1.0 + STOP_TIMEOUT - 0.01) == []
    commands = machine.step(Tick(), 1.0 + STOP_TIMEOUT)
    assert any(isinstance(c, StopProgram) for c in commands)
    assert outcome(commands).code is ErrorCode.EXECUTION_FAILED


def test_a_cancel_that_a_paused_program_cannot_read_ends_the_goal_and_the_program():
    machine = started()
    machine.step(CancelRequested(), 1.0)
    machine.step(robot(0.5, qd=REST), 1.5)
    commands = machine.step(Tick(), 1.0 + STOP_TIMEOUT)
    assert any(isinstance(c, StopProgram) for c in commands)
    assert outcome(commands).code is ErrorCode.CANCELLED


def test_an_answer_to_a_lost_goal_is_not_taken_for_this_one_s():
    machine = started()
    machine.step(TrajectoryEnded(result=TrajectoryResult.CANCELED), 0.1)
    machine.step(robot(0.1, points_begun=1), 0.2)
    assert machine.step(Tick(), 2.0) == []
    assert machine.state is GoalState.MOVING


def test_a_program_that_cancels_and_begins_nothing_ends_the_goal():
    machine = started()
    machine.step(TrajectoryEnded(result=TrajectoryResult.CANCELED), 0.1)
    assert outcome(machine.step(Tick(), 1.2)).code is ErrorCode.EXECUTION_FAILED


def test_leaving_the_path_stops_the_arm_and_names_point_axis_value_and_limit():
    machine = started(path_tolerance=Tolerance(position=(0.0, 0.001, 0.0)))
    off = robot(0.5)
    pose = off.state.actual_tcp_pose
    off = StateReceived(
        state=replace(
            off.state, actual_tcp_pose=Pose((pose.position[0], -0.0015, pose.position[2]))
        )
    )
    assert any(isinstance(c, SendControl) for c in machine.step(off, 1.0))
    machine.step(TrajectoryEnded(result=TrajectoryResult.CANCELED), 1.1)
    end = outcome(machine.step(robot(0.5, qd=REST), 1.2))
    assert end.code is ErrorCode.PATH_TOLERANCE_VIOLATED
    assert end.text == (
        'On the way to point 0 position y is off by 0.001500 m, the tolerance is 0.001000 m.'
    )


@pytest.mark.parametrize(
    ('pose', 'text'),
    [
        (Pose((0.41, 0.0021, 0.2)), '0.002100 m, max_plan_deviation is 0.002000 m'),
        (
            Pose((0.41, 0.0, 0.2), quaternion_from_rotation_vector((0.0, 0.021, 0.0))),
            '0.021000 rad, max_plan_deviation_angle is 0.020000 rad',
        ),
    ],
)
def test_a_controller_that_makes_another_motion_is_stopped_in_the_same_step(pose, text):
    machine = point_machine(job())
    machine.start(robot().state)
    machine.step(robot(), 0.0)
    commands = machine.step(robot(0.05, timestamp=0.1, target_tcp_pose=pose), 0.1)
    assert SendControl(action=TrajectoryAction.CANCEL, count=1) in commands
    machine.step(TrajectoryEnded(result=TrajectoryResult.CANCELED), 0.2)
    end = outcome(machine.step(robot(0.1, qd=REST), 0.3))
    assert end.code is ErrorCode.EXECUTION_FAILED
    assert f'The controller itself left the plan by {text}' in end.text
    assert 'on the way to point 0' in end.text


@pytest.mark.parametrize('limits', [(0.01, 0.02), (0.0, 0.0)])
def test_a_controller_within_the_bounds_or_without_any_goes_on(limits):
    machine = point_machine(job(), max_plan_deviation=limits)
    machine.start(robot().state)
    machine.step(robot(), 0.0)
    machine.step(robot(0.05, timestamp=0.1, target_tcp_pose=Pose((0.41, 0.005, 0.2))), 0.1)
    assert machine.state is GoalState.MOVING


def test_nothing_is_checked_before_the_program_has_begun():
    """The TCP may still be another one; it is changed before the first point."""
    machine = point_machine(job(path_tolerance=Tolerance(position=(0.001,) * 3)))
    elsewhere = {
        'actual_tcp_pose': Pose((0.4, 0, 0)),
        'target_tcp_pose': Pose((0.4, 0, 0)),
        'target_tcp_twist': REST,
    }
    machine.start(robot(**elsewhere, points_begun=7).state)
    machine.step(robot(**elsewhere, points_begun=7), 0.0)
    machine.step(robot(**elsewhere, points_begun=0), 0.1)
    assert machine.state is GoalState.MOVING
    machine.step(robot(**elsewhere, points_begun=1), 0.2)
    assert machine.state is GoalState.CANCELLING


def test_an_arm_that_does_not_settle_violates_the_goal_tolerance():
    machine = started(
        goal_tolerance=Tolerance(position=(0.001, 0.0, 0.0)), goal_time_tolerance=0.5
    )
    machine.step(TrajectoryEnded(result=TrajectoryResult.SUCCESS), 2.0)
    assert machine.step(robot(0.95, timestamp=2.4, qd=REST), 2.4)[-1:] != []
    end = outcome(machine.step(robot(0.95, timestamp=2.5, qd=REST), 2.5))
    assert end.code is ErrorCode.GOAL_TOLERANCE_VIOLATED
    assert 'Position x' in end.text
    assert 'last point' in end.text


def test_a_late_arrival_violates_the_goal_and_names_the_times():
    machine = started(due=2.0, goal_time_tolerance=0.5)
    machine.step(robot(1.0, timestamp=2.6), 2.6)
    end = outcome(machine.step(TrajectoryEnded(result=TrajectoryResult.SUCCESS), 2.6))
    assert end.code is ErrorCode.GOAL_TOLERANCE_VIOLATED
    assert '0.600 s' in end.text
    assert '0.500 s' in end.text


def test_a_slowed_robot_is_not_late():
    machine = started(due=2.0, goal_time_tolerance=0.1)
    for i in range(1, 41):
        machine.step(robot(i / 40, timestamp=0.1 * i, effective_speed=0.5), 0.1 * i)
    machine.step(TrajectoryEnded(result=TrajectoryResult.SUCCESS), 4.0)
    assert outcome(machine.step(robot(1.0, timestamp=4.1, qd=REST), 4.1)).succeeded


def test_a_paused_robot_is_not_late():
    machine = started(due=2.0, goal_time_tolerance=0.1)
    for i in range(1, 41):
        paused = 10 < i <= 30
        machine.step(
            robot(
                0.5 if paused else i / 40,
                timestamp=0.1 * i,
                runtime_state=(RuntimeState.PAUSED if paused else RuntimeState.PLAYING),
                effective_speed=0.0 if paused else 1.0,
            ),
            0.1 * i,
        )
    machine.step(TrajectoryEnded(result=TrajectoryResult.SUCCESS), 4.0)
    assert outcome(machine.step(robot(1.0, timestamp=4.1, qd=REST), 4.1)).succeeded


def test_an_arm_that_settles_in_time_succeeds():
    machine = started(
        goal_tolerance=Tolerance(position=(0.001, 0.0, 0.0)), goal_time_tolerance=0.5
    )
    machine.step(TrajectoryEnded(result=TrajectoryResult.SUCCESS), 2.0)
    machine.step(robot(0.95, timestamp=2.3, qd=REST), 2.3)
    machine.step(robot(0.999, timestamp=2.4), 2.4)
    assert machine.state is GoalState.SETTLING
    assert outcome(machine.step(robot(0.999, timestamp=2.49, qd=REST), 2.49)).succeeded


def test_an_arm_may_settle_without_end():
    machine = started(
        goal_tolerance=Tolerance(position=(0.001, 0.0, 0.0)), goal_time_tolerance=-1.0
    )
    machine.step(TrajectoryEnded(result=TrajectoryResult.SUCCESS), 2.0)
    machine.step(robot(0.95, timestamp=900.0, qd=REST), 900.0)
    assert machine.state is GoalState.SETTLING


def test_progress_is_reported_at_its_rate():
    machine = point_machine(job(), feedback_period=0.1)
    machine.start(robot().state)
    reports = [
        c
        for i in range(100)
        for c in machine.step(robot(i / 200, timestamp=0.01 * i), 0.01 * i)
        if isinstance(c, ReportProgress)
    ]
    assert len(reports) == 10
    fractions = [r.progress.fraction for r in reports]
    assert fractions == sorted(fractions)


@pytest.mark.parametrize('state', list(GoalState))
@pytest.mark.parametrize('signal', list(GoalSignal))
def test_every_signal_has_a_defined_meaning_in_every_state(state, signal):
    own = {
        GoalState.SETTLING: {GoalSignal.SETTLED, GoalSignal.NOT_SETTLED, GoalSignal.DEVIATION},
        GoalState.CANCELLING: {GoalSignal.UNCONFIRMED, GoalSignal.UNANSWERED},
        GoalState.COMING_TO_REST: {GoalSignal.AT_REST, GoalSignal.UNCONFIRMED},
        GoalState.ARMING: {GoalSignal.ARMED, GoalSignal.NOT_READY},
        GoalState.RESTORING: {GoalSignal.RESTORED, GoalSignal.TIMEOUT},
        GoalState.MOVING: {
            GoalSignal.VIOLATION,
            GoalSignal.DEVIATION,
            GoalSignal.STANDSTILL,
            GoalSignal.STARVING,
        },
        GoalState.RUNNING_OUT: {GoalSignal.VIOLATION, GoalSignal.DEVIATION, GoalSignal.STANDSTILL},
        GoalState.AWAITING_POINTS: {
            GoalSignal.APPENDED,
            GoalSignal.NO_MORE_POINTS,
            GoalSignal.DEVIATION,
            GoalSignal.ABANDONED,
        },
        GoalState.PROGRAM_LOST: {GoalSignal.TIMEOUT},
    }
    judged = {
        GoalSignal.ARMED,
        GoalSignal.RESTORED,
        GoalSignal.SETTLED,
        GoalSignal.AT_REST,
        GoalSignal.NOT_READY,
        GoalSignal.NOT_SETTLED,
        GoalSignal.ABANDONED,
        GoalSignal.TIMEOUT,
        GoalSignal.UNANSWERED,
        GoalSignal.UNCONFIRMED,
        GoalSignal.VIOLATION,
        GoalSignal.DEVIATION,
        GoalSignal.STANDSTILL,
        GoalSignal.STARVING,
        GoalSignal.STALE,
        GoalSignal.APPENDED,
        GoalSignal.NO_MORE_POINTS,
    }
    if signal is GoalSignal.STALE:
        possible = state in MONITORED_STATES
    else:
        possible = state is not GoalState.ENDED and (
            signal not in judged or signal in own.get(state, set())
        )
    assert (signal in TRANSITIONS[state]) == possible


@pytest.mark.parametrize(
    'late',
    [
        pytest.param((0.15, robot(0.1, timestamp=0.1, state_age=0.25)), id='an old packet'),
        pytest.param((0.21, Tick()), id='no packet'),
    ],
)
def test_a_motion_whose_newest_state_is_too_old_is_cancelled(late):
    machine = point_machine(job(), max_plan_deviation=(0.0, 0.0), max_state_age=0.2)
    machine.start(robot().state)
    machine.step(robot(0.0, state_age=0.001), 0.0)
    assert not [c for c in machine.step(Tick(), 0.19) if isinstance(c, SendControl)]
    now, event = late
    (cancel,) = [c for c in machine.step(event, now + 0.02) if isinstance(c, SendControl)]
    assert cancel.action is TrajectoryAction.CANCEL
    machine.step(TrajectoryEnded(result=TrajectoryResult.CANCELED), 0.3)
    at_rest = robot(0.1, timestamp=0.4, qd=REST, state_age=0.4)
    (end,) = [c for c in machine.step(at_rest, 0.8) if isinstance(c, Finish)]
    assert end.outcome.code is ErrorCode.CONNECTION_LOST
    assert 'max_state_age is 0.2 s' in end.outcome.text


def test_a_stop_that_a_lost_robot_does_not_confirm_is_a_lost_connection():
    machine = point_machine(job(), max_plan_deviation=(0.0, 0.0), max_state_age=0.2)
    machine.start(robot().state)
    machine.step(robot(0.0, state_age=0.001), 0.0)
    machine.step(Tick(), 0.3)
    assert machine.state is GoalState.CANCELLING
    commands = machine.step(Tick(), 0.3 + STOP_TIMEOUT)
    assert any(isinstance(c, StopProgram) for c in commands)
    ended = outcome(commands)
    assert ended.code is ErrorCode.CONNECTION_LOST
    assert 'max_state_age is 0.2 s' in ended.text
    assert 'did not confirm the stop' in ended.text


def test_a_stop_that_is_not_confirmed_says_why_the_arm_had_to_stop():
    machine = started(path_tolerance=Tolerance(position=(0.0, 0.001, 0.0)))
    off = robot(0.5)
    x, _, z = off.state.actual_tcp_pose.position
    left = replace(off.state, actual_tcp_pose=Pose((x, -0.0015, z)))
    machine.step(StateReceived(state=left), 1.0)
    ended = outcome(machine.step(Tick(), 1.0 + STOP_TIMEOUT))
    assert ended.code is ErrorCode.EXECUTION_FAILED
    cause, confirmed, _ = ended.text.partition('did not confirm the stop')
    assert confirmed
    assert 'the tolerance is' in cause


#: Where the outcome is not decided yet.
RUNNING = [s for s in GoalState if s not in (GoalState.RESTORING, GoalState.ENDED)]

STOPPED_STATES = [
    pytest.param(
        {'safety_status': SafetyStatus.PROTECTIVE_STOPPED},
        ErrorCode.PROTECTIVE_STOP,
        id='protective stop',
    ),
    pytest.param(
        {'safety_status': SafetyStatus.SAFEGUARD_STOPPED},
        ErrorCode.PROTECTIVE_STOP,
        id='safeguard stop',
    ),
    pytest.param(
        {'safety_status': SafetyStatus.EMERGENCY_STOPPED},
        ErrorCode.EMERGENCY_STOP,
        id='emergency stop',
    ),
    pytest.param(
        {'safety_mode': SafetyMode.AUTOMATIC_MODE_SAFEGUARD_STOP},
        ErrorCode.PROTECTIVE_STOP,
        id='safeguard stop without its bit',
    ),
    pytest.param(
        {'safety_mode': SafetyMode.PROFISAFE_EMERGENCY_STOP},
        ErrorCode.EMERGENCY_STOP,
        id='emergency stop without its bit',
    ),
    pytest.param({'robot_mode': RobotMode.POWER_OFF}, ErrorCode.PROGRAM_STOPPED, id='power off'),
]


@pytest.mark.parametrize(('changes', 'code'), STOPPED_STATES)
@pytest.mark.parametrize('state', RUNNING)
def test_a_robot_that_stops_by_itself_ends_the_goal_in_every_state(state, changes, code):
    machine = brought_to(state)
    commands = machine.step(robot(0.5, **changes), 1.05)
    assert outcome(commands + machine.step(Tick(), 1.05 + CAUSE_TIMEOUT)).code is code
    assert machine.state is GoalState.ENDED


@pytest.mark.parametrize(
    ('link', 'code'), [('program', ErrorCode.PROGRAM_STOPPED), ('RTDE', ErrorCode.CONNECTION_LOST)]
)
@pytest.mark.parametrize('state', RUNNING)
def test_a_lost_link_ends_the_goal_in_every_state_and_says_who_hung_up(state, link, code):
    machine = brought_to(state)
    commands = machine.step(LinkLost(link=link, reason='it closed'), 1.05)
    end = outcome(commands + machine.step(Tick(), 1.05 + CAUSE_TIMEOUT))
    assert end.code is code
    assert 'it closed' in end.text or state is GoalState.PROGRAM_LOST


@pytest.mark.parametrize(
    'deeper',
    [
        LinkLost(link='RTDE', reason='it closed'),
        robot(0.5, safety_status=SafetyStatus.FAULT),
        robot(0.5, safety_status=SafetyStatus.EMERGENCY_STOPPED),
    ],
)
def test_the_deeper_reason_of_a_lost_program_counts_whichever_comes_first(deeper):
    gone = LinkLost(link='program', reason='it hung up')
    first, then = started(), started()
    expected = outcome(first.step(deeper, 1.0)).code
    assert then.step(gone, 1.0) == []
    assert then.step(robot(0.5, runtime_state=RuntimeState.STOPPED), 1.01)[1:] == []
    end = outcome(then.step(deeper, 1.02))
    assert end.code is expected is not ErrorCode.PROGRAM_STOPPED
    assert 'it hung up' in end.text, 'what was heard of first is not forgotten'


def standing(machine, seconds, **changes):
    """Let the arm stand in the middle of the path; return the commands."""
    times = [0.1 * i for i in range(1, round(10.0 * seconds) + 1)]
    return [
        command
        for t in times
        for command in machine.step(robot(0.5, timestamp=t, qd=REST, **changes), t)
    ]


def test_an_arm_that_stands_for_no_reason_does_not_stand_for_ever():
    commands = standing(started(), STANDSTILL_TIMEOUT + 0.3)
    assert outcome(commands).code is ErrorCode.EXECUTION_FAILED
    assert any(isinstance(c, StopProgram) for c in commands)


@pytest.mark.parametrize(
    'reason',
    [
        {'runtime_state': RuntimeState.PAUSED},
        {'target_speed_fraction': 0.0},
    ],
)
def test_an_arm_that_is_held_may_stand_as_long_as_it_likes(reason):
    machine = started()
    assert not [c for c in standing(machine, 20.0, **reason) if isinstance(c, Finish)]
    assert machine.state is GoalState.MOVING


@pytest.mark.parametrize('mode', list(SafetyMode))
def test_each_mode_in_which_the_arm_cannot_move_ends_a_goal_or_is_resumable(mode):
    """With the bits that the controller is known to set, and without any for newer modes."""
    known = {
        SafetyMode.PROTECTIVE_STOP: SafetyStatus.PROTECTIVE_STOPPED,
        SafetyMode.SAFEGUARD_STOP: SafetyStatus.SAFEGUARD_STOPPED,
        SafetyMode.SYSTEM_EMERGENCY_STOP: SafetyStatus.SYSTEM_EMERGENCY_STOPPED,
        SafetyMode.ROBOT_EMERGENCY_STOP: SafetyStatus.ROBOT_EMERGENCY_STOPPED,
        SafetyMode.VIOLATION: SafetyStatus.VIOLATION,
        SafetyMode.FAULT: SafetyStatus.FAULT,
    }
    state = robot(safety_mode=mode, safety_status=known.get(mode, SafetyStatus(0))).state
    without_power = (  # the mode of the arm says so
        SafetyMode.RECOVERY,
        SafetyMode.VALIDATE_JOINT_ID,
        SafetyMode.UNDEFINED_SAFETY_MODE,
        SafetyMode.PROFISAFE_WAITING_FOR_PARAMETERS,
    )
    movable = (SafetyMode.NORMAL, SafetyMode.REDUCED, *without_power)
    assert (detect_stop(state) is None) == (mode in movable)
    resumable = detect_stop(state, RESUMABLE_STOPS) is None
    assert resumable == (
        mode in movable
        or 'SAFEGUARD' in mode.name
        or 'ENABLING' in mode.name
        or mode is SafetyMode.PROTECTIVE_STOP
    )


def test_the_last_feedback_compares_the_tool_with_the_end():
    machine = started()
    machine.step(robot(0.999), 1.0)
    machine.step(TrajectoryEnded(result=TrajectoryResult.SUCCESS), 1.01)
    short = {'actual_tcp_pose': Pose((END[0] - 4e-4, *END[1:]))}
    commands = machine.step(robot(1.0, qd=REST, target_tcp_twist=REST, **short), 1.1)
    *_, progress, finish = commands
    assert finish.outcome.succeeded, finish.outcome.text
    assert progress.progress.desired_pose.position == pytest.approx(END, abs=1e-9)


def test_a_protective_stop_ends_the_program_so_that_the_motion_cannot_resume():
    commands = started().step(robot(0.5, safety_status=SafetyStatus.PROTECTIVE_STOPPED), 1.0)
    assert any(isinstance(c, StopProgram) for c in commands)


@pytest.mark.parametrize(
    'event',
    [
        CancelRequested(),
        PreemptRequested(),
        Tick(),
        robot(0.5),
        LinkLost(link='RTDE', reason=''),
        *(TrajectoryEnded(result=result) for result in TrajectoryResult),
    ],
)
def test_nothing_happens_after_the_end(event):
    assert brought_to(GoalState.ENDED).step(event, 9.0) == []


@pytest.mark.parametrize(('changes', 'signal'), STOPPED_STATES)
def test_a_decided_outcome_survives_a_stop_before_the_tcp_is_restored(changes, signal):
    machine = brought_to(GoalState.RESTORING)
    commands = machine.step(with_tcp(NOZZLE, **changes), 1.2)
    assert outcome(commands).code is ErrorCode.EXECUTION_FAILED
    assert not any(isinstance(c, StopProgram) for c in commands)
    assert not machine.temporary_tcp.is_restored


def test_the_tcp_is_set_first_and_nothing_is_sent_before_the_robot_has_it():
    machine, commands = lent(points=3)
    assert commands == [SetTemporaryTcp(T_flange_tcp=NOZZLE)]
    assert machine.step(with_tcp(OWN), 0.01) == []
    assert machine.step(Tick(), 0.02) == []
    # The same packet may still show the pose of the old TCP.
    elsewhere = Pose((0.4, 0.05, 0.2))
    assert SendPoints(first=0, end=3) not in machine.step(
        with_tcp(NOZZLE, actual_tcp_pose=elsewhere), 0.03
    )
    assert machine.step(with_tcp(NOZZLE), 0.04)[:2] == [
        SendControl(action=TrajectoryAction.START, count=3),
        SendPoints(first=0, end=3),
    ]


def test_a_tcp_within_the_resolution_of_the_wire_has_arrived():
    machine, _ = lent()
    machine.step(with_tcp(Pose((0.02 + 5e-7, -5e-7, 0.15 + 5e-7))), 0.01)
    assert machine.state is GoalState.MOVING


def test_the_outcome_waits_until_the_tcp_is_back():
    machine = armed()
    machine.step(TrajectoryEnded(result=TrajectoryResult.SUCCESS), 2.0)
    commands = machine.step(with_tcp(NOZZLE, 1.0), 2.01)
    assert RestoreTcp(T_flange_tcp=OWN) in commands
    assert not any(isinstance(c, Finish) for c in commands)
    assert machine.step(with_tcp(NOZZLE, 1.0), 2.02) == []
    end = outcome(machine.step(with_tcp(OWN, 1.0), 2.03))
    assert end.succeeded
    assert end.report == ('the TCP of the robot was set for the goal, and is what it was before',)


def test_the_goal_tolerance_is_judged_with_the_tcp_of_the_goal():
    machine = armed(goal_tolerance=Tolerance(position=(0.001,) * 3))
    machine.step(TrajectoryEnded(result=TrajectoryResult.SUCCESS), 2.0)
    machine.step(with_tcp(NOZZLE, 1.0), 2.01)
    assert machine.state is GoalState.RESTORING
    elsewhere = Pose((0.6, 0.05, 0.2))
    assert outcome(machine.step(with_tcp(OWN, 1.0, actual_tcp_pose=elsewhere), 2.02)).succeeded


def test_nothing_is_reported_about_another_tcp():
    machine, _ = lent()
    commands = [*machine.step(with_tcp(OWN), 0.1), *machine.step(with_tcp(NOZZLE), 0.2)]
    machine.step(TrajectoryEnded(result=TrajectoryResult.SUCCESS), 2.0)
    at_end = machine.step(with_tcp(NOZZLE, 1.0), 2.01)
    after = machine.step(with_tcp(OWN, actual_tcp_pose=Pose((9.0, 9.0, 9.0))), 2.1)
    assert sum(isinstance(c, ReportProgress) for c in commands) == 1
    assert any(isinstance(c, ReportProgress) for c in at_end)
    assert not any(isinstance(c, ReportProgress) for c in after)


def test_a_robot_that_does_not_take_the_tcp_is_not_moved():
    machine, _ = lent()
    machine.step(with_tcp(OWN), 0.0)
    assert machine.step(with_tcp(OWN), ARMING_TIMEOUT - 0.01) == []
    commands = machine.step(Tick(), ARMING_TIMEOUT)
    assert commands == [RestoreTcp(T_flange_tcp=OWN)]
    end = outcome(machine.step(with_tcp(OWN), ARMING_TIMEOUT + 0.01))
    assert end.code is ErrorCode.ROBOT_NOT_READY
    assert 'did not take the TCP of the goal within 1.2 s' in end.text
    assert end.text.endswith('(before anything moved).')


def test_an_arm_that_went_away_before_it_was_armed_is_not_moved():
    machine, _ = lent()
    elsewhere = Pose((0.4, 0.05, 0.2))
    machine.step(with_tcp(NOZZLE, actual_tcp_pose=elsewhere), 0.0)
    commands = machine.step(with_tcp(NOZZLE, actual_tcp_pose=elsewhere), ARMING_TIMEOUT)
    assert RestoreTcp(T_flange_tcp=OWN) in commands
    end = outcome(machine.step(with_tcp(OWN), ARMING_TIMEOUT + 0.01))
    assert end.code is ErrorCode.ROBOT_NOT_READY
    assert 'the arm is 0.0500 m' in end.text.lower()


def test_a_cancel_before_the_motion_waits_until_no_tcp_is_on_its_way():
    """The TCP of the goal may be read and put back between two packets, or never."""
    machine, _ = lent()
    machine.step(with_tcp(OWN), 0.0)
    assert machine.step(CancelRequested(), 0.01) == [RestoreTcp(T_flange_tcp=OWN)]
    assert machine.step(with_tcp(OWN), 0.02) == []
    assert machine.step(with_tcp(OWN), SET_TIMEOUT - 0.01) == []
    end = outcome(machine.step(with_tcp(OWN), SET_TIMEOUT))
    assert end.code is ErrorCode.CANCELLED
    assert 'before anything moved' in end.text


@pytest.mark.parametrize(
    'result', [each for each in TrajectoryResult if each is not TrajectoryResult.TOUCHED]
)
def test_a_late_result_of_the_goal_before_does_not_arm(result):
    machine, _ = lent()
    assert machine.step(TrajectoryEnded(result=result), 0.1) == []
    assert machine.state is GoalState.ARMING


def test_a_contact_ends_a_goal_that_has_not_moved_yet():
    machine, _ = lent()
    machine.step(with_tcp(OWN), 0.0)
    touched = TrajectoryEnded(result=TrajectoryResult.TOUCHED)
    assert machine.step(touched, 0.01) == [RestoreTcp(T_flange_tcp=OWN)]
    assert machine.step(with_tcp(OWN), 0.02) == []
    end = outcome(machine.step(with_tcp(OWN), SET_TIMEOUT))
    assert end.code is ErrorCode.EXECUTION_FAILED
    assert end.text.startswith('The tool touched something ')
    assert end.text.endswith('(before anything moved).')


def test_a_tcp_that_does_not_come_back_is_said_and_left_to_the_owner():
    machine = armed()
    machine.step(TrajectoryEnded(result=TrajectoryResult.SUCCESS), 2.0)
    machine.step(with_tcp(NOZZLE, 1.0), 2.01)
    commands = machine.step(Tick(), 2.01 + ARMING_TIMEOUT)
    assert not any(isinstance(c, StopProgram) for c in commands)
    end = outcome(commands)
    assert end.succeeded
    assert 'is not back yet' in end.report[0]
    assert not machine.temporary_tcp.is_restored


def test_tolerances_and_reports_are_about_the_controlled_frame():
    """The TCP is where it should be, but turned: the frame at the end of the lever is off."""
    machine = started(
        T_tcp_controlled=Pose((0.0, 0.0, 0.1)),
        path_tolerance=Tolerance(position=(0.001, 0.0, 0.0)),
    )
    turned = Pose((0.5, 0.0, 0.2), quaternion_from_rotation_vector((0.0, 0.02, 0.0)))
    packet = robot(
        0.5,
        timestamp=1.0,
        actual_tcp_pose=turned,
        actual_tcp_twist=(0.1, 0.0, 0.0, 0.0, 0.5, 0.0),
        actual_tcp_acceleration=(0.0,) * 6,
        target_tcp_acceleration=(0.0, 0.0, 0.0, 0.0, 2.0, 0.0),
    )
    assert machine.step(packet, 1.0) == [SendControl(action=TrajectoryAction.CANCEL, count=1)]
    (report,) = (c.progress for c in machine.step(packet, 1.002) if isinstance(c, ReportProgress))
    assert report.desired_pose.position == pytest.approx((0.5, 0.0, 0.3), abs=1e-3)
    assert report.actual_pose.position == pytest.approx((0.502, 0.0, 0.3), abs=1e-4)
    assert report.actual_twist[0] == pytest.approx(0.15, abs=1e-4)
    assert report.desired_acceleration[0] == pytest.approx(0.2, abs=1e-6)
    assert report.actual_acceleration == pytest.approx((-0.0005, 0, -0.025, 0, 0, 0), abs=1e-4)
