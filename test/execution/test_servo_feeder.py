# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Whatever happens to a goal that is streamed, it ends once, and the inputs are given back."""

from goal_machines import servo_machine
from hypothesis import given, settings
from hypothesis import strategies as st
import numpy as np
import pytest

from ur_cartesian_driver.execution.goal.goal_commands import (
    EnterServo,
    Finish,
    LeaveServo,
    OpenServo,
    SetTemporaryTcp,
    WriteInputs,
)
from ur_cartesian_driver.execution.goal.goal_transitions import GoalState
from ur_cartesian_driver.execution.goal.motion_job import MotionJob
from ur_cartesian_driver.motion.errors import ErrorCode
from ur_cartesian_driver.motion.events import (
    CancelRequested,
    INPUTS_LINK,
    LinkLost,
    PreemptRequested,
    ServoReceived,
    StateReceived,
    Tick,
    TrajectoryEnded,
    TrajectoryResult,
)
from ur_cartesian_driver.motion.geometry.pose import IDENTITY, Pose
from ur_cartesian_driver.motion.goal.execution_modes import ExecutionMode
from ur_cartesian_driver.motion.goal.goal import Tolerance
from ur_cartesian_driver.motion.plan.joint_spline import JointSpline
from ur_cartesian_driver.motion.plan.plan import ReferencePath
from ur_cartesian_driver.motion.plan.primitive import Spline
from ur_cartesian_driver.motion.state.rtde_state import (
    RobotMode,
    RobotState,
    RuntimeState,
    SafetyStatus,
)
from ur_cartesian_driver.motion.state.servo_report import ServoFeedback
from ur_cartesian_driver.protocol.program.registers import (
    InputDouble,
    register_name,
    SERVO_INPUTS,
)

STEP, REST = 0.002, (0.0,) * 6
STATE_TIME = SERVO_INPUTS.index(register_name(InputDouble.STATE_TIME))
LENGTH, DURATION = 0.1, 0.2
NOZZLE = Pose((0.0, 0.0, 0.1), (0.0, 0.0, 0.0, 1.0))
#: What any goal may take to its end once its robot is gone for good [s].
BOUND = 10.0


def machine(T_flange_tcp=None, **fields):
    poses = np.array([[LENGTH * part, 0.0, 0.2, 0.0, 0.0, 0.0, 1.0] for part in (0.0, 0.5, 1.0)])
    spline = JointSpline.of(
        REST,
        [Spline(target=(LENGTH,) * 6, velocities=REST, accelerations=REST, duration=DURATION)],
    )
    return servo_machine(
        MotionJob(
            points=1,
            duration=DURATION,
            due=DURATION,
            T_flange_tcp=T_flange_tcp,
            spline=spline,
            execution=ExecutionMode.SERVO,
            waypoint=np.array([0], dtype=np.int32),
            reference=ReferencePath(
                poses=poses, point=np.zeros(3, dtype=np.int32), time=np.linspace(0.0, DURATION, 3)
            ),
            goal_tolerance=Tolerance(position=(0.001,) * 3),
            **fields,
        ),
    )


def robot(joint=0.0, speed=0.0, T_flange_tcp=IDENTITY, **changes):
    """Return a packet of a robot whose tool is as many metres as its joints are radians."""
    pose = Pose((joint, 0.0, 0.2), (0.0, 0.0, 0.0, 1.0))
    return RobotState(
        actual_q=(joint,) * 6,
        target_q=(joint,) * 6,
        actual_qd=(speed,) * 6,
        target_tcp_pose=pose,
        actual_tcp_pose=pose,
        T_flange_tcp=T_flange_tcp,
        target_tcp_twist=(speed, 0.0, 0.0, 0.0, 0.0, 0.0),
        **{'timestamp': 0.0, 'runtime_state': RuntimeState.PLAYING} | changes,
    )


def registers(mode=0, sequence=0, lag=0.0, timestamp=0.0, playing=True):
    return ServoFeedback(
        timestamp=timestamp,
        effective_speed=1.0,
        playing=playing,
        mode=mode,
        last_sequence=sequence,
        lag=lag,
    )


class Cell:
    """A robot that does what a machine's commands say at once, and only counts its buffer."""

    def __init__(self, goal, **start):
        self.goal, self.now, self.joint = goal, 0.0, 0.0
        self.row, self.commands, self.read, self.lag = None, [], 0.0, 0.0
        self.answers = True
        self._take(goal.start(robot(**start)))

    def _take(self, commands):
        self.commands += commands
        for command in commands:
            if isinstance(command, WriteInputs):
                self.row = command.values

    def event(self, event):
        self._take(self.goal.step(event, self.now))

    def cycle(self, until=None, **changes):
        self.now += STEP
        mode, sequence = (self.row[0], self.row[1]) if self.row and self.answers else (0, 0)
        before = self.joint
        if mode == 2:
            self.joint = self.row[4]
            self.lag = max(0.0, self.lag + self.row[STATE_TIME] - self.read - STEP)
            self.read = self.row[STATE_TIME]
        tcp = NOZZLE if any(isinstance(c, SetTemporaryTcp) for c in self.commands) else IDENTITY
        self.event(ServoReceived(feedback=registers(mode, sequence, self.lag, timestamp=self.now)))
        if self.goal.state is until:
            return
        self.event(
            StateReceived(
                state=robot(
                    **{
                        'joint': self.joint,
                        'speed': (self.joint - before) / STEP,
                        'T_flange_tcp': tcp,
                        'timestamp': self.now,
                    }
                    | changes
                )
            )
        )

    def until(self, state, bound=3.0):
        while self.goal.state is not state:
            assert self.now < bound, self.goal.state
            self.cycle(until=state)
        return self

    @property
    def outcome(self):
        (end,) = [command for command in self.commands if isinstance(command, Finish)]
        return end.outcome


def test_a_goal_arrives_and_gives_the_inputs_back():
    cell = Cell(machine()).until(GoalState.ENDED)
    assert cell.outcome.code is ErrorCode.SUCCESSFUL, cell.outcome
    kinds = [type(command) for command in cell.commands]
    assert kinds[0] is OpenServo
    assert kinds.index(WriteInputs) < kinds.index(EnterServo)
    assert kinds.count(LeaveServo) == 1
    assert kinds.index(LeaveServo) < kinds.index(Finish)
    modes = [c.values[0] for c in cell.commands if isinstance(c, WriteInputs)]
    assert (modes[0], modes[-1]) == (0, 0)
    assert cell.joint == pytest.approx(LENGTH)


def test_inputs_of_another_client_end_the_goal_before_anything_moves():
    cell = Cell(machine())
    cell.event(LinkLost(link=INPUTS_LINK, reason='the inputs are in use by another client.'))
    assert cell.outcome.code is ErrorCode.ROBOT_NOT_READY
    assert cell.outcome.text == (
        'The robot does not take set-points: the inputs are in use by '
        'another client (before anything moved).'
    )


def test_a_program_that_does_not_answer_ends_the_goal_before_anything_moves():
    cell = Cell(machine())
    cell.answers = False
    cell.until(GoalState.ENDED)
    assert cell.outcome.code is ErrorCode.ROBOT_NOT_READY
    assert 'did not answer through its registers' in cell.outcome.text
    assert {c.values[0] for c in cell.commands if isinstance(c, WriteInputs)} == {0}


@pytest.mark.parametrize('T_flange_tcp', [None, NOZZLE])
def test_an_arm_that_was_moved_since_the_plan_is_not_pulled_to_its_start(T_flange_tcp):
    cell = Cell(machine(T_flange_tcp))
    cell.joint = 0.05
    cell.until(GoalState.ENDED)
    assert cell.outcome.code is ErrorCode.ROBOT_NOT_READY
    assert 'A joint is 0.0500 rad away' in cell.outcome.text
    assert 'the arm was moved meanwhile' in cell.outcome.text
    assert {c.values[0] for c in cell.commands if isinstance(c, WriteInputs)} == {0}


@pytest.mark.parametrize(
    ('event', 'code'),
    [(CancelRequested(), ErrorCode.CANCELLED), (PreemptRequested(), ErrorCode.PREEMPTED)],
)
def test_a_cancel_is_written_at_once_and_answered_by_leaving(event, code):
    cell = Cell(machine()).until(GoalState.MOVING)
    for _ in range(60):
        cell.cycle()
    cell.event(event)
    assert isinstance(cell.commands[-1], WriteInputs)
    assert cell.commands[-1].values[0] == 0
    assert cell.goal.state is GoalState.CANCELLING
    cell.cycle(speed=1.0)
    assert cell.goal.state is GoalState.COMING_TO_REST
    cell.until(GoalState.ENDED)
    assert cell.outcome.code is code


@pytest.mark.parametrize('answered', [True, False])
def test_a_goal_with_points_is_cancelled_when_the_program_has_answered(answered):
    """Else the next goal would enter a servo that the program is still to leave."""
    cell = Cell(machine(has_stops=True)).until(GoalState.MOVING)
    for _ in range(20):
        cell.cycle()
    cell.event(CancelRequested())
    written = sum(isinstance(command, WriteInputs) for command in cell.commands)
    for _ in range(50):
        cell.cycle(speed=1.0)
    assert cell.goal.state is GoalState.CANCELLING
    # The program waits for sequence numbers until it is told to leave.
    assert sum(isinstance(command, WriteInputs) for command in cell.commands) >= written + 49
    if answered:
        cell.event(TrajectoryEnded(result=TrajectoryResult.CANCELED))
        assert cell.goal.state is GoalState.COMING_TO_REST
    else:
        cell.until(GoalState.COMING_TO_REST, bound=cell.now + 1.1)
    assert cell.until(GoalState.ENDED).outcome.code is ErrorCode.CANCELLED


def test_a_program_that_leaves_by_itself_ends_the_goal():
    cell = Cell(machine()).until(GoalState.MOVING)
    for _ in range(60):
        cell.cycle()
    cell.row = (0, *cell.row[1:])
    cell.event(ServoReceived(feedback=registers(0, cell.row[1], timestamp=cell.now)))
    assert cell.goal.state is GoalState.PROGRAM_LOST
    cell.until(GoalState.ENDED)
    assert cell.outcome.code is ErrorCode.PROGRAM_STOPPED
    assert 'left the servo by itself' in cell.outcome.text


def test_a_program_that_takes_the_place_of_a_lost_one_finds_no_setpoints_in_the_inputs():
    cell = Cell(machine()).until(GoalState.MOVING)
    for _ in range(60):
        cell.cycle()
    assert cell.row[0] == 2
    cell.event(LinkLost(link='program', reason='it has ended'))
    assert cell.goal.state is GoalState.PROGRAM_LOST
    for _ in range(20):
        assert cell.row[0] == 0
        cell.cycle()


def test_lost_inputs_end_a_moving_goal_and_the_program_is_told_to_brake():
    cell = Cell(machine()).until(GoalState.MOVING)
    cell.event(LinkLost(link=INPUTS_LINK, reason='it closed'))
    assert cell.outcome.code is ErrorCode.CONNECTION_LOST
    assert [type(c) for c in cell.commands if not isinstance(c, WriteInputs)].count(
        LeaveServo
    ) == 1


@pytest.mark.slow
def test_a_dwell_is_no_stall_while_the_program_reads():
    goal = machine()
    source = type('Dwell', (), {'done': False, 'next': lambda self, dt: (0.0,) * 6})
    goal.feeder.stream._source = source()
    cell = Cell(goal).until(GoalState.MOVING)
    for _ in range(1050):  # 2.1 s, longer than an arm may stand for no reason
        cell.cycle()
    assert goal.state is GoalState.MOVING
    cell.answers = False
    for _ in range(510):
        cell.cycle()
    assert goal.state is GoalState.ENDED


def test_due_counts_from_when_the_arm_can_follow():
    goal = machine()
    Cell(goal).until(GoalState.SETTLING)
    assert goal.job.due + goal.feeder.monitor.allowed_delay == pytest.approx(
        DURATION + 0.1, abs=0.1
    )
    assert goal.job.due + goal.feeder.monitor.allowed_delay > DURATION


SAFETY = [
    SafetyStatus.NORMAL_MODE,
    SafetyStatus.NORMAL_MODE,
    SafetyStatus.PROTECTIVE_STOPPED,
    SafetyStatus.EMERGENCY_STOPPED,
    SafetyStatus.FAULT,
]
PACKETS = st.builds(
    robot,
    joint=st.floats(0.0, LENGTH),
    speed=st.sampled_from([0.0, 0.1]),
    T_flange_tcp=st.sampled_from([IDENTITY, NOZZLE]),
    safety_status=st.sampled_from(SAFETY),
    runtime_state=st.sampled_from([RuntimeState.PLAYING] * 4 + list(RuntimeState)),
    robot_mode=st.sampled_from([RobotMode.RUNNING] * 4 + [RobotMode.POWER_OFF]),
    effective_speed=st.sampled_from([1.0, 0.0]),
)
FEEDBACK = st.builds(
    registers,
    mode=st.integers(0, 3),
    sequence=st.integers(-2, 40),
    lag=st.sampled_from([0.0, 0.01, 1.0]),
    timestamp=st.floats(0.0, 100.0),
    playing=st.booleans(),
)
EVENTS = st.one_of(
    PACKETS.map(lambda state: StateReceived(state=state)),
    st.just(Tick()),
    FEEDBACK.map(lambda feedback: ServoReceived(feedback=feedback)),
    st.sampled_from([TrajectoryEnded(result=result) for result in TrajectoryResult]),
    st.sampled_from([CancelRequested(), PreemptRequested()]),
    st.sampled_from(
        [LinkLost(link=link, reason='it closed') for link in ('program', 'RTDE', INPUTS_LINK)]
    ),
)


@pytest.mark.slow
@given(
    good=st.integers(0, 250),
    lends=st.booleans(),
    events=st.lists(st.tuples(EVENTS, st.floats(0.001, 2.0)), max_size=15),
)
@settings(max_examples=25, deadline=None)
def test_a_goal_ends_once_whatever_happens(good, events, lends):
    cell = Cell(machine(NOZZLE if lends else None))
    for _ in range(good):
        cell.cycle()
    for event, later in events:
        cell.now += later
        cell.event(event)
    cell.event(LinkLost(link='RTDE', reason='the end of the test'))
    for _ in range(round(BOUND / 0.02)):
        cell.now += 0.02
        cell.event(Tick())
    assert isinstance(cell.outcome.code, ErrorCode)
    assert cell.outcome.text.endswith('.')
    assert cell.goal.state is GoalState.ENDED
    kinds = [type(command) for command in cell.commands]
    assert kinds.count(LeaveServo) == 1


#: How a goal comes into each state.
WAYS = {
    GoalState.ARMING: lambda cell: None,
    GoalState.MOVING: lambda cell: cell.until(GoalState.MOVING),
    GoalState.SETTLING: lambda cell: cell.until(GoalState.SETTLING),
    GoalState.CANCELLING: lambda cell: (
        cell.until(GoalState.MOVING),
        cell.cycle(),
        cell.event(CancelRequested()),
    ),
    GoalState.COMING_TO_REST: lambda cell: (
        cell.until(GoalState.MOVING),
        [cell.cycle() for _ in range(60)],
        cell.event(CancelRequested()),
        cell.cycle(speed=1.0),
    ),
    GoalState.RESTORING: lambda cell: cell.until(GoalState.RESTORING),
    GoalState.PROGRAM_LOST: lambda cell: cell.event(LinkLost(link='program', reason='it closed')),
    GoalState.ENDED: lambda cell: cell.until(GoalState.ENDED),
}
EACH = [
    StateReceived(state=robot()),
    ServoReceived(feedback=registers()),
    Tick(),
    StateReceived(state=robot(safety_status=SafetyStatus.PROTECTIVE_STOPPED)),
    CancelRequested(),
    PreemptRequested(),
    *(TrajectoryEnded(result=result) for result in TrajectoryResult),
    *(LinkLost(link=link, reason='it closed') for link in ('program', 'RTDE', INPUTS_LINK)),
]


@pytest.mark.slow
@pytest.mark.parametrize('state', WAYS)
def test_every_event_in_every_state_leads_to_one_end(state):
    for event in EACH:
        cell = Cell(machine(NOZZLE if state is GoalState.RESTORING else None))
        WAYS[state](cell)
        assert cell.goal.state is state
        cell.event(event)
        for _ in range(round(BOUND / 0.02)):
            cell.now += 0.02
            cell.event(Tick())
        cell.event(LinkLost(link='RTDE', reason='the end of the test'))
        assert cell.outcome.text.endswith('.'), (state, event)


def test_a_target_that_trails_by_many_dense_points_is_on_the_path():
    points, lag_motions = 100, 20  # 2 ms each; 40 ms of servoj at 0.5 m/s are 20 mm
    at = np.linspace(0.0, 1.0, points + 1)
    speed = (LENGTH / DURATION,) * 6
    goal = servo_machine(
        MotionJob(
            points=points,
            duration=DURATION,
            execution=ExecutionMode.SERVO,
            waypoint=np.arange(points, dtype=np.int32),
            spline=JointSpline.of(
                REST,
                [
                    Spline(
                        target=(LENGTH * part,) * 6,
                        velocities=REST if part == 1.0 else speed,
                        duration=DURATION / points,
                    )
                    for part in at[1:]
                ],
            ),
            reference=ReferencePath(
                poses=np.array([[LENGTH * part, 0.0, 0.2, 0.0, 0.0, 0.0, 1.0] for part in at]),
                point=np.array([0, *range(points)], dtype=np.int32),
                time=DURATION * at,
            ),
        ),
    )

    class Trailing(Cell):
        def __init__(self, goal):
            self.led = [0.0]
            super().__init__(goal)

        def event(self, event):
            if isinstance(event, StateReceived):
                self.led.append(event.state.target_q[0])
                before, now = ([0.0] * lag_motions + self.led)[-lag_motions - 2 : -lag_motions]
                event = StateReceived(
                    state=robot(now, (now - before) / STEP, timestamp=event.state.timestamp)
                )
            super().event(event)

    cell = Trailing(goal)
    cell.until(GoalState.ENDED)
    assert cell.outcome.code is ErrorCode.SUCCESSFUL, cell.outcome
