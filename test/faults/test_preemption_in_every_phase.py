# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""A motion is preempted in every phase: messages, braking, pose at rest."""

from fault_goals import ARM, BlendGoal, planned
from joint_trace import JointTrace
import pytest
from robot_cell import CYCLE, run_cell

from ur_cartesian_driver.driver.ipc.channel import CancelMotion
from ur_cartesian_driver.motion.errors import ErrorCode
from ur_cartesian_driver.planning.stop_prediction import predict_stop
from ur_cartesian_driver.protocol.program.reverse import ControlMode, TrajectoryAction

pytestmark = pytest.mark.slow
START, CANCEL = TrajectoryAction.START, TrajectoryAction.CANCEL
STOP_DECELERATION = 4.0
#: No joint of these motions is faster [rad/s], or accelerates more, stops included [rad/s^2].
FASTEST, STRONGEST = 0.7, 6.0
#: From the request to the outcome [s]: braking at 0.25 m/s, and some cycles for the messages.
BOUND = 0.3
#: Phase: the messages on the wire until the next goal runs, and how the first one ends.
PHASES = {
    'arming': ([START, CANCEL, START], ErrorCode.PREEMPTED),
    'first point': ([START, CANCEL, START], ErrorCode.PREEMPTED),
    'mid-segment': ([START, CANCEL, START], ErrorCode.PREEMPTED),
    'in a blend': ([START, CANCEL, START], ErrorCode.PREEMPTED),
    'last point': ([START, CANCEL, START], ErrorCode.PREEMPTED),
    'settling': ([START, START], ErrorCode.PREEMPTED),
    'cancelling': ([START, CANCEL, START], ErrorCode.CANCELLED),
}


def was_action_sent(cell, first):
    return [
        TrajectoryAction(message.payload[0])
        for message in cell.control_messages(first)
        if message.mode is ControlMode.FORWARD and message.payload[0] in (START, CANCEL)
    ]


async def preempted(cell, phase):
    first = len(cell.control_messages())
    home = cell.robot.controller.motion.T_base_tcp.position
    goal = BlendGoal(cell)
    await goal.bring_to(phase)
    predicted = predict_stop(cell.memory.read(), ARM, STOP_DECELERATION)
    trace = JointTrace(cell)
    cell.owner.send(CancelMotion(motion=len(cell.owner.motions), preempted_by='goal 7'))
    await trace.until(lambda: goal.motion.outcome, BOUND)
    messages, code = PHASES[phase]
    assert goal.motion.outcome.code is code, f'{phase}: {goal.motion.outcome}'
    if code is ErrorCode.PREEMPTED:
        assert goal.motion.outcome.text.startswith('Goal 7 took the place of this one (')
    assert cell.at_rest(), phase
    rests = cell.memory.read().actual_tcp_pose
    assert rests.distance_to(predicted.actual_tcp_pose) < 1e-4, phase
    if phase == 'settling':  # what kept it from settling moves the measured pose
        cell.robot.clear_faults()
        await cell.sleep(2.0 * CYCLE)
    back = tuple(
        a - b for a, b in zip(home, cell.robot.controller.motion.T_base_tcp.position, strict=True)
    )
    following = cell.owner.start(
        planned(
            cell.memory.read(),
            (back if max(map(abs, back)) > 1e-3 else (0.0, 0.01, 0.0),),
            0.25,
            2.0,
        )
    )
    await trace.until(lambda: following.outcome, 3.0)
    assert following.outcome.succeeded, f'{phase}: {following.outcome}'
    assert was_action_sent(cell, first) == messages, phase
    assert 'ignored' not in ' '.join(map(str, cell.robot.controller.messages.log))
    speed, change = trace.max_speed_and_acceleration()
    assert speed < FASTEST, phase
    assert change < STRONGEST, phase


def test_a_motion_is_preempted_in_every_phase_and_the_next_one_begins_at_rest():
    async def scenario(cell):
        for phase in PHASES:
            await preempted(cell, phase)

    run_cell(scenario)
