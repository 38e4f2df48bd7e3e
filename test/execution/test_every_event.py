# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Whatever happens to a goal, in whatever order, it ends once, with a code and a sentence."""

from dataclasses import replace

from goal_machines import append_machine, point_machine
from hypothesis import given, settings
from hypothesis import strategies as st
import numpy as np
import pytest

from ur_cartesian_driver.execution.goal.goal_commands import (
    AnswerAppend,
    Finish,
    SendControl,
    SendPoints,
)
from ur_cartesian_driver.execution.goal.goal_transitions import GoalState, TRANSITIONS
from ur_cartesian_driver.execution.goal.motion_job import AppendJob, MotionJob
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
from ur_cartesian_driver.motion.geometry.pose import IDENTITY, Pose
from ur_cartesian_driver.motion.goal.goal import Tolerance
from ur_cartesian_driver.motion.plan.plan import ReferencePath
from ur_cartesian_driver.motion.state.rtde_state import (
    RobotMode,
    RobotState,
    RuntimeState,
    SafetyStatus,
)
from ur_cartesian_driver.protocol.program.reverse import TrajectoryAction

POINTS = 3
NOZZLE = Pose((0.0, 0.0, 0.1), (0.0, 0.0, 0.0, 1.0))
#: What any goal may take to its end once its robot is gone for good [s].
BOUND = 10.0


def machine(T_flange_tcp):
    poses = np.array([[0.1 * i, 0.0, 0.2, 0.0, 0.0, 0.0, 1.0] for i in range(POINTS + 1)])
    return point_machine(
        MotionJob(
            points=POINTS,
            duration=3.0,
            T_flange_tcp=T_flange_tcp,
            reference=ReferencePath(
                poses=poses,
                point=np.maximum(np.arange(POINTS + 1) - 1, 0).astype(np.int32),
                time=np.arange(POINTS + 1.0),
            ),
            path_tolerance=Tolerance(position=(0.01,) * 3),
            goal_tolerance=Tolerance(position=(0.001,) * 3),
        )
    )


def stream(T_flange_tcp, deviation):
    job = replace(machine(T_flange_tcp).job, keep_open=True, ending_records=1)
    return append_machine(job, max_plan_deviation=(deviation, deviation))


def robot(part=0.0, off=0.0, speed=0.0, begun=0, T_flange_tcp=IDENTITY, **changes):
    """Return a packet of a robot so far along its path [0..1] and so far beside it [m]."""
    target = Pose((0.3 * part, 0.0, 0.2), (0.0, 0.0, 0.0, 1.0))
    actual = Pose((0.3 * part, off, 0.2), (0.0, 0.0, 0.0, 1.0))
    return RobotState(
        actual_q=(0.0,) * 6,
        actual_qd=(speed, 0.0, 0.0, 0.0, 0.0, 0.0),
        target_tcp_pose=target,
        actual_tcp_pose=actual,
        target_tcp_twist=(speed, 0.0, 0.0, 0.0, 0.0, 0.0),
        points_begun=begun,
        T_flange_tcp=T_flange_tcp,
        **{'timestamp': 0.0, 'runtime_state': RuntimeState.PLAYING} | changes,
    )


SAFETY = [
    SafetyStatus.NORMAL_MODE,
    SafetyStatus.NORMAL_MODE,
    SafetyStatus.PROTECTIVE_STOPPED,
    SafetyStatus.EMERGENCY_STOPPED,
    SafetyStatus.FAULT,
]
PACKETS = st.builds(
    robot,
    part=st.floats(0.0, 1.0),
    off=st.sampled_from([0.0, 0.0, 0.005, 0.02]),
    speed=st.sampled_from([0.0, 0.1]),
    begun=st.integers(0, POINTS),
    T_flange_tcp=st.sampled_from([IDENTITY, NOZZLE]),
    safety_status=st.sampled_from(SAFETY),
    runtime_state=st.sampled_from([RuntimeState.PLAYING] * 4 + list(RuntimeState)),
    robot_mode=st.sampled_from([RobotMode.RUNNING] * 4 + [RobotMode.POWER_OFF]),
    effective_speed=st.sampled_from([1.0, 0.0]),
)
EVENTS = st.one_of(
    PACKETS.map(lambda state: StateReceived(state=state)),
    st.just(Tick()),
    st.sampled_from([TrajectoryEnded(result=result) for result in TrajectoryResult]),
    st.sampled_from([CancelRequested(), PreemptRequested()]),
    st.sampled_from([LinkLost(link=link, reason='it closed') for link in ('program', 'RTDE')]),
)


def timed(event, now):
    """Return the event as it is at a time: packets tell the robot's."""
    if not isinstance(event, StateReceived):
        return event
    changes = {name: getattr(event.state, name) for name in event.state.__slots__}
    return StateReceived(state=RobotState(**changes | {'timestamp': now}))


def commands_of(goal, events):
    """Return all that a goal asks for: at these events, the loss of RTDE, and until its bound."""
    commands, now = goal.start(robot()), 0.0
    for event, later in events:
        now += later
        commands += goal.step(timed(event, now), now)
    commands += goal.step(LinkLost(link='RTDE', reason='the end of the test'), now)
    for _ in range(round(BOUND / 0.02)):
        now += 0.02
        commands += goal.step(Tick(), now)
    return commands


@pytest.mark.slow
@given(events=st.lists(st.tuples(EVENTS, st.floats(0.001, 2.0)), max_size=25), lends=st.booleans())
@settings(max_examples=150, deadline=None)
def test_a_goal_ends_once_whatever_happens(events, lends):
    goal = machine(NOZZLE if lends else None)
    commands = commands_of(goal, events)
    (end,) = [command for command in commands if isinstance(command, Finish)]
    assert isinstance(end.outcome.code, ErrorCode)
    assert end.outcome.text.endswith('.')
    assert goal.state is GoalState.ENDED
    sent = [
        index
        for command in commands
        if isinstance(command, SendPoints)
        for index in range(command.first, command.end)
    ]
    assert sent == list(range(len(sent))), 'each point once, in order'
    assert len(sent) <= POINTS


def append_of(number, records_before, begin, count, last):
    """Points that go on along the line from a place on it; all but the last one are firm."""
    x = 0.1 * (begin + np.arange(count))
    poses = np.stack([x, *np.tile([[0.0], [0.2], [0.0], [0.0], [0.0], [1.0]], count)], axis=1)
    point, time = np.arange(begin, begin + count) - 1, np.arange(begin, begin + count, dtype=float)
    return AppendJob(
        number=number,
        records_before=records_before,
        job=None
        if not count
        else MotionJob(
            points=count,
            duration=float(begin + count),
            keep_open=not last,
            ending_records=0 if last else 1,
            reference=ReferencePath(poses=poses, point=point.astype(np.int32), time=time),
            waypoint=point.astype(np.int32),
        ),
    )


EXTENSIONS = st.builds(
    append_of,
    number=st.integers(1, 9),
    records_before=st.integers(0, 8),
    begin=st.integers(1, 8),
    count=st.integers(0, 4),
    last=st.booleans(),
)


@pytest.mark.slow
@given(
    events=st.lists(
        st.tuples(
            st.one_of(EVENTS, PACKETS.map(lambda state: StateReceived(state=state)), EXTENSIONS),
            st.floats(0.001, 2.0),
        ),
        max_size=25,
    ),
    lends=st.booleans(),
    deviation=st.sampled_from([0.0, 0.002]),
)
@settings(max_examples=60, deadline=None)
def test_an_open_goal_ends_once_whatever_happens(events, lends, deviation):
    goal = stream(NOZZLE if lends else None, deviation)
    commands = commands_of(goal, events)
    (end,) = [command for command in commands if isinstance(command, Finish)]
    assert end.outcome.text.endswith('.')
    assert goal.state is GoalState.ENDED
    asked = [event for event, _ in events if isinstance(event, AppendJob)]
    answers = [command for command in commands if isinstance(command, AnswerAppend)]
    ended = next(i for i, c in enumerate(commands) if isinstance(c, Finish))
    assert len(answers) == len(asked), 'who appends is answered, also behind the end'
    assert all(answer.refusal for answer in answers if commands.index(answer) > ended)
    sent = [
        index
        for command in commands
        if isinstance(command, SendPoints)
        for index in range(command.first, command.end)
    ]
    assert sent == list(range(len(sent))), 'each record once, in order'
    counts_fit(commands)


def counts_fit(commands):
    """Each stream is told how many records it has, and no record comes behind that."""
    sent = None
    for command in commands:
        match command:
            case SendControl(action=TrajectoryAction.STREAM_START):
                sent = 0
            case SendPoints(first=first, end=end):
                assert sent is not None, 'points without a stream'
                sent += end - first
            case SendControl(action=TrajectoryAction.STREAM_END, count=count):
                assert count == sent > 0
                sent = None
            case SendControl(action=TrajectoryAction.CANCEL, count=count):
                assert sent is None or count == sent


@pytest.mark.parametrize('state', [state for state in GoalState if state is not GoalState.ENDED])
def test_every_state_leads_to_the_end(state):
    seen, ahead = set(), {state}
    while ahead:
        seen |= ahead
        ahead = {step.state for s in ahead for step in TRANSITIONS[s].values()} - seen
    assert GoalState.ENDED in seen
