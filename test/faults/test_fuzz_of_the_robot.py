# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
A robot that sends anything on its five connections, at rest and during a goal.

Whatever comes, nothing crashes, no unrequested motion happens, every goal ends, and the driver
recovers to a state in which the next one runs.
"""

import asyncio

from hypothesis import given, HealthCheck, Phase, settings
from hypothesis import strategies as st
import pytest
from robot_cell import (
    COMMANDS,
    PRIMARY,
    REVERSE,
    RTDE,
    run_cell,
    TRAJECTORY,
)

from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.kinematics.robot_models import robot_model
from ur_cartesian_driver.motion.geometry.pose import Pose
from ur_cartesian_driver.motion.goal.execution_modes import ExecutionMode
from ur_cartesian_driver.motion.goal.goal import Goal, Waypoint
from ur_cartesian_driver.planning import plan, PlanningOptions
from ur_cartesian_driver.robot.lifecycle import ConnectionState

pytestmark = [pytest.mark.acceptance, pytest.mark.slow]

#: Bytes of the size field that begins a frame of a dialled interface.
WIDTHS = {RTDE: 2, PRIMARY: 4}
DISTANCE, TIME = 0.05, 0.5

attacks = st.tuples(
    st.sampled_from([RTDE, PRIMARY, REVERSE, TRAJECTORY, COMMANDS]),
    st.one_of(
        st.binary(min_size=1, max_size=64),
        # Results that nobody has, or that are forged.
        st.integers(-3, 5).map(lambda number: number.to_bytes(4, 'big', signed=True)),
        # Changes to the last frame that the robot has sent: place (part of its length) and byte.
        st.lists(st.tuples(st.floats(0.0, 0.999), st.integers(0, 255)), min_size=1, max_size=6),
    ),
    st.booleans(),
    st.sampled_from([ExecutionMode.PRIMITIVES, ExecutionMode.SPLINE, ExecutionMode.SERVO]),
)


def last_frame(received, width):
    """Return the last whole frame of a stream."""
    at = frame = 0
    while at + width <= len(received):
        size = int.from_bytes(received[at : at + width], 'big')
        if at + size > len(received):
            break
        frame, at = at, at + size
    return bytes(received[frame:at])


def changed(frame, places):
    """Return a frame with other bytes behind its size."""
    data = bytearray(frame)
    for place, byte in places:
        data[2 + int(place * (len(data) - 2))] = byte
    return bytes(data)


def say(cell, port, what):
    """Send data from the robot on all its connections of a kind."""
    for end in cell.loop.open_ends(port):
        dialled = port in WIDTHS  # by the driver, so the robot is at the far end
        robot = end.peer if dialled else end
        data = what
        if isinstance(what, list):
            frame = last_frame(end.received, WIDTHS[port]) if dialled else bytes(4)
            data = changed(frame or bytes(4), what)
        robot.write(data)


def goal(cell, distance, execution=ExecutionMode.PRIMITIVES):
    """Return a plan along y."""
    state = cell.memory.read()
    (x, y, z), turn = state.actual_tcp_pose.position, state.actual_tcp_pose.quaternion
    return plan(
        Goal(
            waypoints=(Waypoint(pose=Pose((x, y + distance, z), turn), time=TIME),),
            execution=execution,
        ),
        state,
        Arm(robot_model('ur5e')),
        PlanningOptions(max_tool_speed=1.0),
    )


async def back(cell):
    """Recover the robot by the action that the status requires."""
    for _ in range(10):
        if cell.status.state is ConnectionState.CONNECTED:
            cell.resend()
        try:
            await cell.until(cell.is_ready, 1.0)
            return
        except AssertionError:
            continue
    raise AssertionError(f'it does not come back: {cell.status}; {cell.owner.log}')


async def under_attack(cell, attack, distance):
    port, what, in_motion, execution = attack
    await back(cell)
    q = cell.q
    if not in_motion:
        say(cell, port, what)
        await asyncio.sleep(0.3)
        assert cell.q == q, 'nobody asked for a motion'
        return
    (x, y, z) = cell.robot.controller.motion.T_base_tcp.position
    motion = cell.owner.start(goal(cell, distance, execution))
    await cell.until(lambda: not cell.at_rest() or motion.outcome is not None)
    say(cell, port, what)
    await cell.until(lambda: motion.outcome is not None, 10.0)
    await cell.until(cell.at_rest, 1.0)
    await asyncio.sleep(0.3)
    u, v, w = cell.robot.controller.motion.T_base_tcp.position
    assert max(abs(u - x), abs(w - z)) < 1e-3, 'off the path'
    assert min(0.0, distance) - 1e-3 < v - y < max(0.0, distance) + 1e-3, 'beyond the path'
    if motion.outcome.succeeded:
        assert abs(v - y - distance) < 1e-3, 'a success at another place'
    assert motion.outcome.text


async def undisturbed(cell, distance):
    """Run a goal. An attack before may still end it: half a result, or a wrong size."""
    await back(cell)
    motion = cell.owner.start(goal(cell, distance))
    await cell.until(lambda: motion.outcome is not None, 5.0)
    await asyncio.sleep(1.5)
    return motion.outcome


@settings(
    max_examples=4,
    deadline=None,
    suppress_health_check=list(HealthCheck),
    derandomize=True,
    phases=[Phase.generate],
)  # an example takes seconds: no shrinking
@given(st.lists(attacks, min_size=8, max_size=8))
def test_a_robot_may_say_anything(attacks):
    tripped = []

    async def scene(cell):
        cell.loop.set_exception_handler(lambda _, context: tripped.append(context))
        for i, attack in enumerate(attacks):
            await under_attack(cell, attack, DISTANCE if i % 2 else -DISTANCE)
            assert not tripped, (attack, tripped)
            assert not cell.loop_task.done()
        outcomes = [await undisturbed(cell, distance) for distance in (DISTANCE, -DISTANCE)]
        assert outcomes[-1].succeeded, outcomes

    run_cell(scene)
