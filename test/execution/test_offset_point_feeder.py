# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""A path of the robot's own motions that may give way: offsets, and the inputs that carry them."""

from dataclasses import replace

import numpy as np
import pytest

from ur_cartesian_driver.execution.goal.goal_commands import (
    CloseOffsets,
    Finish,
    OpenOffsets,
    SendControl,
    WriteInputs,
)
from ur_cartesian_driver.execution.goal.goal_machine import GoalMachine
from ur_cartesian_driver.execution.goal.goal_monitor import GoalMonitor
from ur_cartesian_driver.execution.goal.goal_transitions import GoalState
from ur_cartesian_driver.execution.goal.motion_job import MotionJob
from ur_cartesian_driver.execution.goal.timeouts import ARMING_TIMEOUT
from ur_cartesian_driver.execution.points.offset_point_feeder import (
    MAX_SEQUENCE,
    OffsetPointFeeder,
    SEQUENCE_GAP,
)
from ur_cartesian_driver.motion.errors import ErrorCode
from ur_cartesian_driver.motion.events import (
    CancelRequested,
    INPUTS_LINK,
    LinkLost,
    OffsetReceived,
    StateReceived,
    Tick,
    TrajectoryEnded,
    TrajectoryResult,
)
from ur_cartesian_driver.motion.geometry.pose import Pose
from ur_cartesian_driver.motion.goal.execution_modes import ExecutionMode
from ur_cartesian_driver.motion.goal.goal import StaleOffset
from ur_cartesian_driver.motion.plan.offset_band import NO_OFFSET, OffsetBand, OffsetFeedback
from ur_cartesian_driver.motion.plan.plan import ReferencePath
from ur_cartesian_driver.motion.state.rtde_state import RobotState, RuntimeState
from ur_cartesian_driver.protocol.program.registers import OFFSET_INPUTS
from ur_cartesian_driver.protocol.program.reverse import TrajectoryAction

LENGTH, TIME, CYCLE = 0.1, 1.0, 0.002
SHIFTED = (-0.002, 0.0, 0.0)
BAND = OffsetBand(
    limits=(0.0, 0.005, 0.0),
    speed=0.02,
    acceleration=0.2,
    timeout=0.1,
    on_stale=StaleOffset.FADE,
    step=0.5,
    axes=np.tile(((0.0, 1.0, 0.0), (-1.0, 0.0, 0.0), (0.0, 0.0, 1.0)), (4, 1, 1)),
    is_open=np.array((True, True, False, False)),
)


class Cell:
    """A line along y, run by a robot whose reports the test chooses."""

    def __init__(self):
        poses = np.array([[0.0, LENGTH * k, 0.2, 0.0, 0.0, 0.0, 1.0] for k in (0, 1)])
        path = ReferencePath(
            poses=poses, point=np.zeros(2, dtype=np.int32), time=np.array((0.0, TIME))
        )
        self.feeder = OffsetPointFeeder(
            GoalMonitor(MotionJob(points=1, reference=path, duration=TIME)), BAND
        )
        self.machine = GoalMachine(self.feeder)
        self.now, self.last = 0.0, 70
        self.commands = self.machine.start(self.state(0.0))

    def state(self, part, shift=(0.0, 0.0, 0.0), begun=0):
        pose = Pose((shift[0], LENGTH * part, 0.2), (0.0, 0.0, 0.0, 1.0))
        moving = 0.0 < part < 1.0
        return RobotState(
            timestamp=self.now,
            target_tcp_pose=pose,
            actual_tcp_pose=pose,
            target_tcp_twist=(0.0, 0.1 * moving, 0.0, 0.0, 0.0, 0.0),
            actual_q=(0.0,) * 6,
            actual_qd=(0.1 * moving,) * 6,
            effective_speed=1.0 * moving,
            runtime_state=RuntimeState.PLAYING,
            points_begun=begun,
        )

    def event(self, event):
        self.now += CYCLE
        found = self.machine.step(event, self.now)
        self.commands += found
        return found

    def report(self, offset=0.0, shift=(0.0, 0.0, 0.0)):
        """Let the program report; return the values written in answer, if any."""
        feedback = OffsetFeedback(last_sequence=self.last, offset=(0.0, offset, 0.0), shift=shift)
        found = self.event(OffsetReceived(feedback=feedback))
        rows = [command.values for command in found if isinstance(command, WriteInputs)]
        return rows[0] if rows else None

    def move(self, part, shift=(0.0, 0.0, 0.0)):
        self.event(StateReceived(state=self.state(part, shift, begun=1)))

    @property
    def outcome(self):
        return next((c.outcome for c in self.commands if isinstance(c, Finish)), None)

    @property
    def controls(self):
        return [c for c in self.commands if isinstance(c, SendControl)]

    def start(self):
        """Bring it to its motion."""
        self.report()
        self.move(0.0)
        assert self.machine.state is GoalState.MOVING
        return self


def test_nothing_moves_before_the_inputs_are_there():
    cell = Cell()
    assert [type(command) for command in cell.commands] == [OpenOffsets]
    cell.move(0.0)
    assert not cell.controls
    row = cell.report()
    assert len(row) == len(OFFSET_INPUTS)
    assert row[0] == 70 + SEQUENCE_GAP + 1
    assert row[1:5] == (0.0, 0.0, 0.0, 0.0)
    cell.move(0.0)
    (control,) = cell.controls
    assert (control.action, control.count, control.takes_offsets) == (
        TrajectoryAction.START,
        1,
        True,
    )


def test_only_our_own_program_takes_offsets():
    job = replace(Cell().machine.job, offset_band=BAND)
    assert job.own_program_needs == 'offsets of its path (path_offset)'
    assert not replace(job, execution=ExecutionMode.SERVO).own_program_needs


@pytest.mark.parametrize('last', [-5, MAX_SEQUENCE, 2**31 - 1])
def test_a_strange_sequence_number_does_no_harm(last):
    cell = Cell()
    cell.last = last
    assert cell.report()[0] == 1


def test_an_offset_is_written_with_the_frame_and_the_bounds_and_fades_when_stale():
    cell = Cell().start()
    cell.machine.can.displacing.set_offset((0.0, 0.003, 0.0), 0.0, cell.now)
    cell.move(0.2)
    row = cell.report()
    assert row[1:5] == (0.0, 0.003, 0.0, 1.0)
    assert row[5:14] == (0.0, 1.0, 0.0, -1.0, 0.0, 0.0, 0.0, 0.0, 1.0)
    assert row[14:] == (0.0, 0.005, 0.0, 0.02, 0.2)
    for _ in range(60):
        row = cell.report()
    assert row[1:4] == (0.0, 0.0, 0.0)
    cell.machine.can.displacing.set_offset((0.0, 0.003, 0.0), 0.0, cell.now)
    for k in range(50):
        cell.move(0.2 + 0.016 * k)
        cell.machine.can.displacing.set_offset((0.0, 0.003, 0.0), 0.0, cell.now)
        row = cell.report()
        assert row[2] == (0.003 if cell.feeder.monitor.time() < 1.0 else 0.0)


def test_the_path_is_where_the_controller_says():
    cell = Cell().start()
    cell.last = 70 + SEQUENCE_GAP + 1
    for k in range(1, 40):
        cell.report(0.002, SHIFTED)
        cell.move(0.02 * k, SHIFTED)
    assert cell.outcome is None
    assert cell.feeder.applied_offset(cell.state(0.5)).shift == SHIFTED
    for k in range(40, 44):  # it says that there is none any more
        cell.report()
        cell.move(0.02 * k, (-0.004, 0.0, 0.0))
    assert cell.machine.state is GoalState.CANCELLING
    assert cell.controls[-1].action is TrajectoryAction.CANCEL


def test_registers_of_an_earlier_goal_hold_no_offset():
    cell = Cell().start()
    cell.report(0.002, SHIFTED)
    assert cell.feeder.applied_offset(cell.state(0.5)) == NO_OFFSET


def test_inputs_of_another_client_end_the_goal_before_anything_moves():
    cell = Cell()
    cell.event(LinkLost(link=INPUTS_LINK, reason='the inputs are in use by another client.'))
    assert cell.outcome.code is ErrorCode.ROBOT_NOT_READY
    assert cell.outcome.text == (
        'The robot does not take path offsets: the inputs are in use by another client '
        '(before anything moved).'
    )


def test_inputs_that_do_not_come_end_the_goal_before_anything_moves():
    cell = Cell()
    while cell.outcome is None:
        cell.event(Tick())
        assert cell.now < 2.0 * ARMING_TIMEOUT
    assert cell.outcome.code is ErrorCode.ROBOT_NOT_READY
    assert cell.outcome.text.startswith('The robot did not give its RTDE inputs within')


def test_lost_inputs_end_a_moving_goal():
    cell = Cell().start()
    cell.move(0.3)
    cell.event(LinkLost(link=INPUTS_LINK, reason='it closed'))
    assert cell.outcome.code is ErrorCode.CONNECTION_LOST
    assert sum(isinstance(command, CloseOffsets) for command in cell.commands) == 1


def test_the_inputs_are_released_once_and_nothing_is_written_after_that():
    cell = Cell().start()
    cell.move(0.5)
    assert cell.report() is not None
    cell.event(CancelRequested())
    assert cell.report() is None, 'the program reads nothing any more'
    cell.event(TrajectoryEnded(result=TrajectoryResult.CANCELED))
    cell.event(StateReceived(state=replace(cell.state(0.5), actual_qd=(0.0,) * 6)))
    assert cell.outcome.code is ErrorCode.CANCELLED
    assert sum(isinstance(command, CloseOffsets) for command in cell.commands) == 1
    assert cell.report() is None
