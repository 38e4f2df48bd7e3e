# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Tolerance checks packet by packet: robot loop and robot over sockets, in virtual time.

Decisions of the machine are tested without sockets; here the bytes on the wire and their times.
"""

import asyncio
from random import Random
from typing import Any

import pytest
from robot_cell import REVERSE, RTDE, run_cell
from virtual_network import deliver
from wire_decoding import decode_reverse

from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.kinematics.robot_models import robot_model
from ur_cartesian_driver.motion.errors import ErrorCode
from ur_cartesian_driver.motion.geometry.pose import Pose, quaternion_from_rotation_vector
from ur_cartesian_driver.motion.geometry.vectors import vector3, vector6
from ur_cartesian_driver.motion.goal.goal import Goal, Segment, SegmentType, Tolerance, Waypoint
from ur_cartesian_driver.motion.state.rtde_state import RuntimeState
from ur_cartesian_driver.planning import plan, PlanningOptions
from ur_cartesian_driver.protocol.framing import RecordDecoder
from ur_cartesian_driver.protocol.program.reverse import MESSAGE_SIZE, TrajectoryAction
from ur_cartesian_driver.protocol.rtde.rtde_fields import OUTPUT_TYPES
from ur_cartesian_driver.protocol.rtde.rtde_packages import RtdeFrameBuffer
from ur_cartesian_driver.protocol.rtde.rtde_recipe import Recipe
from ur_cartesian_driver.robot.rtde.state_decoding import OPTIONAL_FIELDS, REQUIRED_FIELDS
from ur_cartesian_driver.sim.faults.fault_values import (
    AfterDistance,
    AfterTime,
    DEVIATION_AXES,
    DeviationFault,
    DeviationQuantity,
    EventFault,
    Fault,
    FaultEvent,
    SpeedSliderFault,
)

pytestmark = [pytest.mark.acceptance, pytest.mark.slow, pytest.mark.exhaustive]

#: Quantity of a fault: what texts call its two halves, how far each is pushed, and its limit.
PUSHES: dict[DeviationQuantity, Any] = {
    'pose': (('position', 'orientation'), (0.02, 0.2), (0.005, 0.05)),
    'twist': (('linear velocity', 'angular velocity'), (0.5, 0.5), (0.1, 0.1)),
    'acceleration': (('linear acceleration', 'angular acceleration'), (3.0, 3.0), (1.0, 1.0)),
}
#: A push about an axis of base turns the tool about this axis of its own: the tool points down.
TOOL_AXES = {'x': 'y', 'y': 'x', 'z': 'z'}
NAMES = (*REQUIRED_FIELDS, *OPTIONAL_FIELDS)
RECIPE = Recipe(NAMES, [OUTPUT_TYPES[name] for name in NAMES])


def moved(pose, offset, turn=(0.0, 0.0, 0.0)):
    """A pose moved along base axes [m] and turned about tool axes [rad]."""
    turned = Pose((0, 0, 0), pose.quaternion) @ Pose(
        (0, 0, 0), quaternion_from_rotation_vector(turn)
    )
    return Pose(
        tuple(a + b for a, b in zip(pose.position, offset, strict=True)), turned.quaternion
    )


def planned(cell, goal):
    arm = Arm(robot_model(cell.robot.config.model))
    return plan(goal, cell.memory.read(), arm, PlanningOptions(max_tool_speed=1.0))


async def executed(cell, goal, *faults):
    """Run a goal while something goes wrong; return how it ended, and the plan."""
    made = planned(cell, goal)
    motion = cell.owner.start(made)
    cell.robot.inject(*faults)
    await cell.until(lambda: motion.outcome is not None, 120.0)
    return motion, made


# ---- the truth table --------------------------------------------------------------------------


class Tapped(asyncio.Protocol):
    """Sits between a connection and its reader, and records all data with their times."""

    def __init__(self, cell, port):
        end = cell.loop.open_ends(port)[0]  # the first RTDE connection receives the robot's state
        self._loop, self._reader = cell.loop, end.protocol
        self.notes = []
        end.set_protocol(self)

    def data_received(self, data):
        self.notes.append((self._loop.time(), data))
        deliver(self._reader, data)

    def eof_received(self):
        return self._reader.eof_received()

    def connection_lost(self, exc):
        self._reader.connection_lost(exc)


def times_of_pushed(notes, quantity, axis, limit):
    """Yield the times of packets whose actual value is off its target on an axis."""
    field = {'pose': 'TCP_pose', 'twist': 'TCP_speed', 'acceleration': 'TCP_acceleration'}
    actual, target = (NAMES.index(f'{kind}_{field[quantity]}') for kind in ('actual', 'target'))
    frames = RtdeFrameBuffer()
    for time, data in notes:
        for frame in frames.feed(data):
            values: Any = RECIPE.unpack(frame[3:])
            if quantity == 'pose' and axis >= 3:
                a, b = (Pose.from_rotation_vector(values[k]) for k in (actual, target))
                error = a.angle_to(b)
            else:
                error = abs(values[actual][axis] - values[target][axis])
            if error > limit:
                yield time


def times_of_cancel(notes):
    messages = RecordDecoder(MESSAGE_SIZE, 'reverse message', decode_reverse)
    for time, data in notes:
        for message in messages.feed(data):
            if message.payload[0] == TrajectoryAction.CANCEL:
                yield time


def tolerance_of_one(quantity, axis, limit, others=-1.0):
    limits = {name: [others] * 6 for name in PUSHES}
    limits[quantity][axis] = limit
    return Tolerance(
        position=vector3(limits['pose'][:3]),
        orientation=vector3(limits['pose'][3:]),
        twist=vector6(limits['twist']),
        acceleration=vector6(limits['acceleration']),
    )


@pytest.mark.parametrize('quantity', PUSHES)
def test_each_axis_stops_the_arm_in_the_cycle_of_the_packet_that_violates(quantity):
    """CANCEL is on the wire before time goes on; the axis is named; all others are unchecked."""

    async def scenario(cell):
        home = cell.memory.read().actual_tcp_pose
        rtde, reverse = Tapped(cell, RTDE), Tapped(cell, REVERSE)
        for there, (axis, sign) in enumerate(
            (axis, sign) for axis in range(6) for sign in (1.0, -1.0)
        ):
            names, sizes, limits = (values[axis // 3] for values in PUSHES[quantity])
            watched = TOOL_AXES['xyz'[axis % 3]] if names == 'orientation' else 'xyz'[axis % 3]
            at = 'xyz'.index(watched) + 3 * (axis // 3)
            motion, _ = await executed(
                cell,
                Goal(
                    waypoints=(
                        Waypoint(pose=moved(home, ((0.03, 0.05, 0.0), (0.0,) * 3)[there % 2])),
                    ),
                    path_tolerance=tolerance_of_one(quantity, at, limits),
                ),
                DeviationFault(
                    quantity=quantity,
                    axis=DEVIATION_AXES[axis],
                    shape='offset',
                    amount=sign * sizes,
                    trigger=AfterDistance(0.005),
                    duration=0.05,
                ),
            )
            assert motion.outcome.code is ErrorCode.PATH_TOLERANCE_VIOLATED, (axis, sign)
            assert f'point 0 {names} {watched} is off by' in motion.outcome.text
            violated = next(times_of_pushed(rtde.notes, quantity, axis, limits))
            assert list(times_of_cancel(reverse.notes)) == [violated]
            await asyncio.sleep(0.1)  # the push is over
            rtde.notes.clear()
            reverse.notes.clear()

    run_cell(scenario)


@pytest.mark.parametrize('limit', [0.0, -1.0], ids=['zero', 'negative'])
@pytest.mark.parametrize('quantity', PUSHES)
def test_a_push_on_an_axis_without_a_limit_stops_nothing(quantity, limit):
    """The limit of every other quantity, and of the push's two other axes, is narrow."""

    async def scenario(cell):
        home = cell.memory.read().actual_tcp_pose
        for axis in range(6):
            size = PUSHES[quantity][1][axis // 3]
            goal = Goal(
                waypoints=(Waypoint(pose=moved(home, (0.02, 0.0, 0.0))), Waypoint(pose=home)),
                path_tolerance=tolerance_without(quantity, axis, limit),
            )
            motion, _ = await executed(
                cell,
                goal,
                DeviationFault(
                    quantity=quantity,
                    axis=DEVIATION_AXES[axis],
                    shape='offset',
                    amount=size,
                    trigger=AfterDistance(0.005),
                    duration=0.05,
                ),
            )
            assert motion.outcome.succeeded, (DEVIATION_AXES[axis], motion.outcome.text)
            await asyncio.sleep(0.1)

    run_cell(scenario)


def tolerance_without(quantity, axis, limit):
    """A narrow tolerance of everything that such a push does not touch."""
    narrow = {'pose': [1e-3] * 3 + [1e-2] * 3, 'twist': [0.01] * 6, 'acceleration': [0.1] * 6}
    touched = (
        'xyz'.index(TOOL_AXES['xyz'[axis - 3]]) + 3 if (quantity == 'pose' and axis >= 3) else axis
    )
    narrow[quantity][touched] = limit
    if quantity == 'acceleration':  # what accelerates becomes fast
        narrow['twist'][axis] = limit
    return Tolerance(
        position=vector3(narrow['pose'][:3]),
        orientation=vector3(narrow['pose'][3:]),
        twist=vector6(narrow['twist']),
        acceleration=vector6(narrow['acceleration']),
    )


# ---- what never trips -------------------------------------------------------------------------

RUNS, BATCHES = 100, 10
#: As a user of a process with a tool would set them.
TIGHT = Tolerance(position=(5e-4,) * 3, orientation=(5e-3,) * 3, twist=(0.02,) * 3 + (0.1,) * 3)
#: What sensors add [m, rad], [m/s, rad/s]: standard deviations.
NOISE: tuple[tuple[DeviationQuantity, float], ...] = (('pose', 2e-5), ('twist', 1e-4))
#: What no other time may be missed by: the slider and pauses stop the clock of the goal too [s].
ON_TIME = 0.1
KINDS = (SegmentType.LINEAR, SegmentType.JOINT, SegmentType.LINEAR)


def random_goal(cell, random, share):
    """Two or three motions; the slower the slider, the shorter, to save computing time."""
    here = cell.memory.read().target_tcp_pose
    time, waypoints, segments = 0.0, [], []
    for _ in range(random.randint(2, 3)):
        duration = max(0.06, 0.5 * share) * random.uniform(0.8, 1.2)
        time += duration
        length = 0.1 * duration**2  # which takes half a metre per second squared
        step = [random.uniform(-1.0, 1.0) * length for _ in range(3)]
        turn = [random.uniform(-1.0, 1.0) * length for _ in range(3)]
        here = moved(here, step, turn)
        waypoints.append(Waypoint(pose=here, time=time))
        segments.append(Segment(type=random.choice(KINDS)))
    return Goal(
        waypoints=tuple(waypoints),
        segments=tuple(segments),
        path_tolerance=TIGHT,
        goal_tolerance=TIGHT,
        goal_time_tolerance=ON_TIME,
    )


def random_faults(random, slider, duration):
    """Return faults by operators: slider moves, up to two, and a pause in half the runs."""
    instants = sorted(random.uniform(0.0, duration) for _ in range(3))
    faults: list[Fault] = [
        SpeedSliderFault(fraction=slider),
        *(
            SpeedSliderFault(
                fraction=min(1.0, max(0.01, slider * random.uniform(0.3, 3.0))),
                trigger=AfterTime(instant),
            )
            for instant in instants[: random.randint(0, 2)]
        ),
    ]
    pause = random.uniform(0.1, 0.3) if random.random() < 0.5 else 0.0
    if pause:
        faults += [
            EventFault(action=FaultEvent.PAUSE, trigger=AfterTime(instants[2])),
            EventFault(action=FaultEvent.PLAY, trigger=AfterTime(instants[2] + pause)),
        ]
    return faults, pause


@pytest.mark.exhaustive
@pytest.mark.parametrize('batch', range(BATCHES))
def test_no_slider_and_no_pause_ever_fails_a_goal(batch):
    async def scenario(cell):
        controller = cell.robot.controller
        if batch % 2:
            cell.robot.inject(
                *(
                    DeviationFault(
                        quantity=quantity, axis=axis, shape='noise', amount=amount, seed=batch
                    )
                    for quantity, amount in NOISE
                    for axis in DEVIATION_AXES
                )
            )
        for number in range(RUNS // BATCHES):
            random = Random(f'{batch} {number}')
            slider = 0.01 * (1 + (BATCHES * number + batch) % 100)  # each of 1 to 100 %, once
            goal = random_goal(cell, random, slider)
            faults, pause = random_faults(random, slider, goal.waypoints[-1].time)
            begin = controller.time
            motion, made = await executed(cell, goal, *faults)
            assert motion.outcome.succeeded, (number, slider, faults[1:], motion.outcome.text)
            # The pause was in the middle of the motion; it begins and ends with a ramp.
            assert controller.time - begin > made.duration + 0.5 * pause
            await cell.until(lambda: controller.programs.state is RuntimeState.PLAYING)
            await cell.until(cell.is_ready)

    run_cell(scenario)
