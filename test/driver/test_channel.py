# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Messages between the owner and the robot loop."""

from collections import deque
import socket
import threading

import numpy as np
import pytest

from ur_cartesian_driver.driver import ConnectionStatus, DriverConfig
from ur_cartesian_driver.driver.ipc import channel
from ur_cartesian_driver.execution.goal.goal_commands import AnswerAppend
from ur_cartesian_driver.execution.goal.motion_job import MotionJob
from ur_cartesian_driver.motion.errors import ErrorCode
from ur_cartesian_driver.motion.events import Outcome
from ur_cartesian_driver.motion.geometry.pose import Pose
from ur_cartesian_driver.motion.plan.plan import ReferencePath
from ur_cartesian_driver.robot.connection_status import LinkGaps
from ur_cartesian_driver.robot.lifecycle import ConnectionState
from ur_cartesian_driver.robot.services import service_calls

MESSAGES = [
    channel.Configure(config=DriverConfig(robot_ip='10.0.0.1', headless_mode=True)),
    channel.CancelMotion(motion=3),
    channel.OwnerHeartbeat(),
    channel.Shutdown(),
    channel.ResendProgram(),
    channel.AppendAnswered(motion=3, answer=AnswerAppend(number=1, refusal='The goal ended.')),
    channel.MotionEnded(motion=3, outcome=Outcome(code=ErrorCode.SUCCESSFUL, text='Done.')),
    channel.StatusChanged(
        status=ConnectionStatus(state=ConnectionState.READY, ports={'reverse_port': 50001})
    ),
    channel.CallRobot(number=2, call=service_calls.SetTcpCall(T_flange_tcp=Pose((0.0, 0.0, 0.1)))),
    channel.CallAnswered(
        number=2, answer=service_calls.ServiceAnswer(ok=True, text='The TCP is set.')
    ),
    channel.LoopHeartbeat(gaps=LinkGaps(reports=0.002, keepalives=0.021, state_age=0.003)),
    channel.LogMessage(level=30, text='a line'),
]


@pytest.mark.parametrize('message', MESSAGES, ids=lambda m: type(m).__name__)
def test_a_message_arrives_as_it_was_sent(message):
    ours, theirs = socket.socketpair()
    with ours, theirs:
        ours.sendall(channel.pack(message))
        assert channel.receive(theirs) == message


def test_a_large_order_arrives_whole():
    n = 20_000
    reference = ReferencePath(
        poses=np.ones((n, 7)), point=np.zeros(n, np.int32), time=np.arange(n, dtype=float)
    )
    sent = channel.StartMotion(
        motion=1, job=MotionJob(points=n, reference=reference, duration=1.0), points=bytes(84 * n)
    )
    ours, theirs = socket.socketpair()
    with ours, theirs:
        parts = channel.pack_parts(sent)
        thread = threading.Thread(target=lambda: deque(map(ours.sendall, parts)))
        thread.start()
        arrived = channel.receive(theirs)
        thread.join()
    assert arrived.points == sent.points
    assert np.array_equal(arrived.job.reference.time, reference.time)
    assert np.array_equal(arrived.job.reference.poses, reference.poses)
    # Arrays are not copied; what arrives is part of the message, and numpy likes it in place.
    assert any(np.shares_memory(np.frombuffer(part, 'u1'), reference.poses) for part in parts)
    assert arrived.job.reference.poses.base is not None
    assert arrived.job.reference.poses.flags.aligned
    # The channel has one form, whoever sends.
    assert b''.join(parts) == channel.pack(sent)


def test_the_end_of_the_pipe_is_none_also_inside_a_message():
    ours, theirs = socket.socketpair()
    with theirs:
        ours.sendall(channel.pack(channel.OwnerHeartbeat())[:-1])
        ours.close()
        assert channel.receive(theirs) is None
