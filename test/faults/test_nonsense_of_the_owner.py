# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Nothing that the owner of a robot loop sends ends the loop; what can be answered is answered."""

from dataclasses import replace
import pickle
from typing import Any

from fault_goals import BlendGoal
import numpy as np
import pytest
from robot_cell import CellMotion, run_cell

from ur_cartesian_driver.driver.ipc import channel
from ur_cartesian_driver.execution.goal.motion_job import AppendJob, job_from_plan, MotionJob
from ur_cartesian_driver.motion.errors import ErrorCode
from ur_cartesian_driver.motion.goal.goal import Tolerance
from ur_cartesian_driver.protocol.program.trajectory_points import encode_points

pytestmark = pytest.mark.slow


def write_body(cell, body):
    cell.owner._writer.write(channel.LENGTH.pack(len(body)) + body)


def empty_job():
    """Return a job with fields that no planner makes."""
    job = MotionJob.__new__(MotionJob)
    for name in MotionJob.__slots__:
        object.__setattr__(job, name, None)
    return job


async def check_goal(cell):
    """Run a goal to its end."""
    assert not cell.loop_task.done()
    goal = BlendGoal(cell)
    goal.send()
    await cell.until(lambda: goal.motion.outcome is not None, 10.0)
    assert goal.motion.outcome.succeeded, goal.motion.outcome


def of_owner(value: Any) -> Any:
    """Return a value whose type no checker knows."""
    return value


NONSENSE: dict[str, Any] = {
    'a goal without anything': channel.StartMotion(motion=1, job=None, points=b''),
    'an empty job': channel.StartMotion(motion=1, job=empty_job(), points=b''),
    'points that are none': channel.StartMotion(motion=1, job=None, points=of_owner(17)),
    'appended points of no motion': channel.AppendToMotion(
        motion=1,
        append_job=AppendJob(number=1, records_before=0, job=of_owner('none')),
        points=b'',
    ),
    'an append without a job': channel.AppendToMotion(motion=1, append_job=None, points=b''),
    'a target of texts': channel.SetLiveTarget(
        **of_owner({'motion': '1', 'T_base_tcp': 'there', 'age': 'old'})
    ),
    'a cancel of nothing': channel.CancelMotion(motion=None, preempted_by=of_owner(3)),
    'a call that is none': channel.CallRobot(number=1, call=of_owner(17)),
    'another configuration': channel.Configure(config=None),
    'a notification': channel.LogMessage(level=of_owner('x'), text=None),
    'no message': 17,
}


@pytest.mark.parametrize('name', NONSENSE)
def test_nonsense_leaves_the_loop_ready_for_goals(name):
    async def scenario(cell):
        cell.owner.motions[1] = motion = CellMotion()
        request = NONSENSE[name]
        write_body(cell, pickle.dumps(None) + pickle.dumps([]) + pickle.dumps(request))
        await cell.sleep(0.1)
        if isinstance(request, channel.StartMotion):
            assert motion.outcome.code is ErrorCode.EXECUTION_FAILED
            assert 'cannot be carried out' in motion.outcome.text
        await check_goal(cell)

    run_cell(scenario)


@pytest.mark.parametrize(
    'body', [b'', b'x' * 100, pickle.dumps(None), pickle.dumps(None) + b'cnowhere\nnothing\n.']
)
def test_bytes_that_are_no_message_leave_the_loop_ready_for_goals(body):
    async def scenario(cell):
        write_body(cell, body)
        await cell.sleep(0.1)
        assert any('cannot be read' in line for line in cell.owner.log)
        await check_goal(cell)

    run_cell(scenario)


def test_a_goal_of_a_class_that_the_loop_does_not_have_is_answered():
    async def scenario(cell):
        motion = cell.owner.motions[1] = CellMotion()
        refusal = channel.refusal_of(NONSENSE['an empty job'], channel.UNREADABLE)
        write_body(cell, pickle.dumps(refusal) + b'cnowhere\nnothing\n.')
        await cell.until(lambda: motion.outcome is not None)
        assert 'classes that only your program has' in motion.outcome.text

    run_cell(scenario)


@pytest.mark.parametrize(
    ('field', 'value'),
    [
        ('request_times', np.zeros(3, dtype=np.float32)),
        ('goal_time_tolerance', 'late'),
        ('path_tolerance', Tolerance(position=of_owner('abc'))),
    ],
)
def test_a_motion_that_fails_at_its_values_ends_with_the_reason_and_the_arm_at_rest(field, value):
    async def scenario(cell):
        plan = BlendGoal(cell).plan
        job = replace(job_from_plan(plan), **{field: value})
        motion = cell.owner.run(encode_points(plan.instructions), job)
        await cell.until(lambda: motion.outcome is not None, 5.0)
        assert motion.outcome.code is ErrorCode.EXECUTION_FAILED, motion.outcome
        await cell.until(cell.at_rest)
        await cell.sleep(0.5)
        if not cell.is_ready():  # the program was stopped, because the arm moved
            cell.resend()
            await cell.until(cell.is_ready, 5.0)
        await check_goal(cell)

    run_cell(scenario)
