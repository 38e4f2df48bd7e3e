# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The newest robot state in shared memory."""

from dataclasses import replace
import os
import threading

from hypothesis import given
from hypothesis import strategies as st
import pytest

from ur_cartesian_driver.driver.ipc import state_memory
from ur_cartesian_driver.motion.geometry.pose import Pose, quaternion_from_rotation_vector
from ur_cartesian_driver.motion.state.rtde_state import (
    RobotMode,
    RobotState,
    RobotStatus,
    RuntimeState,
    SafetyMode,
    SafetyStatus,
)


@pytest.fixture
def memories():
    """The views of a writer and of a reader."""
    descriptor = state_memory.create()
    writer, reader = state_memory.StateMemory(descriptor), state_memory.StateMemory(descriptor)
    os.close(descriptor)
    yield writer, reader
    writer.close()
    reader.close()


numbers = st.floats(-1e6, 1e6)
vectors = st.tuples(*[numbers] * 6)
poses = st.builds(
    lambda p, r: Pose(p, quaternion_from_rotation_vector(r)),
    st.tuples(*[numbers] * 3),
    st.tuples(*[st.floats(-3.0, 3.0)] * 3),
)
states = st.builds(
    RobotState,
    timestamp=numbers,
    actual_q=vectors,
    actual_qd=vectors,
    target_q=vectors,
    target_qd=vectors,
    actual_tcp_pose=poses,
    actual_tcp_twist=vectors,
    target_tcp_pose=poses,
    target_tcp_twist=vectors,
    actual_tcp_wrench=vectors,
    T_flange_tcp=poses,
    speed_scaling=numbers,
    target_speed_fraction=numbers,
    effective_speed=numbers,
    state_age=numbers,
    robot_mode=st.sampled_from(RobotMode),
    safety_mode=st.sampled_from(SafetyMode),
    runtime_state=st.sampled_from(RuntimeState),
    robot_status=st.integers(0, 15).map(RobotStatus),
    safety_status=st.integers(0, 0xFFF).map(SafetyStatus),
    points_begun=st.integers(0, 2**31 - 1),
    actual_tcp_acceleration=st.none() | vectors,
    target_tcp_acceleration=st.none() | vectors,
    joint_torque=st.none() | vectors,
)


@given(states)
def test_every_field_arrives_as_it_was_written(state):
    descriptor = state_memory.create()
    memory = state_memory.StateMemory(descriptor)
    os.close(descriptor)
    memory.write(state)
    assert memory.read() == state
    memory.close()


def test_no_state_is_none_before_the_first_and_after_a_loss(memories):
    writer, reader = memories
    assert reader.read() is None
    writer.write(RobotState(timestamp=1.0, actual_q=(0.0,) * 6))
    assert reader.read().timestamp == 1.0
    writer.clear()
    assert reader.read() is None


def test_a_reader_never_sees_half_of_a_state(memories):
    writer, reader = memories
    end = threading.Event()
    template = RobotState(timestamp=0.0, actual_q=(0.0,) * 6)

    def write():
        i = 0
        while not end.is_set():
            i += 1
            writer.write(
                replace(template, timestamp=float(i), actual_q=(float(i),) * 6, points_begun=i)
            )

    thread = threading.Thread(target=write)
    thread.start()
    try:
        for _ in range(2000):
            state = reader.read()
            if state is not None:
                assert set(state.actual_q) == {state.timestamp} == {float(state.points_begun)}
    finally:
        end.set()
        thread.join()
