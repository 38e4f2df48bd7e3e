# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Rounded corners, outputs and path offsets in one goal, by set-points; in virtual time.

Tool, speed and outputs are those that RTDE reports to a client of its own; where an output has to
switch follows from the points of the goal. Nothing is taken from the plan.
"""

from dataclasses import replace
import os

import numpy as np
import pytest
from recorded_goal import ARM, SETUP
from robot_cell import COMMANDS, CYCLE, PRIMARY, REVERSE, RTDE, run_cell, TRAJECTORY
from virtual_network import HOST

from ur_cartesian_driver.driver.ipc.channel import SetPathOffset
from ur_cartesian_driver.motion.errors import ErrorCode
from ur_cartesian_driver.motion.geometry.pose import Pose
from ur_cartesian_driver.motion.goal.execution_modes import ExecutionMode
from ur_cartesian_driver.motion.goal.goal import (
    Goal,
    InputKind,
    InputWait,
    IOCommand,
    OutputKind,
    PathOffset,
    ProportionalOutput,
    SafeOutput,
    Segment,
    Waypoint,
)
from ur_cartesian_driver.motion.state.io_signals import AnalogDomain
from ur_cartesian_driver.motion.state.rtde_state import RuntimeState
from ur_cartesian_driver.planning import plan, PlanningOptions
from ur_cartesian_driver.protocol.rtde.rtde_client import RtdeClientCodec
from ur_cartesian_driver.robot.rtde.rtde_connection import RtdeConnection

pytestmark = [pytest.mark.acceptance, pytest.mark.slow]

SPEED, DEVIATION, ACROSS = 0.1, 0.001, 0.002
#: Around a corner and along a line; the second point lies within that line [m].
PLACES = ((0.0, 0.05), (0.06, 0.05), (0.1, 0.05))
#: The valve, the lamp that goes on 0.1 s behind the middle of the line, the light at the end.
VALVE, LAMP, LIGHT, NOTHING = 1, 2, 3, 4
#: How many random paths are drawn.
SEEDS = int(os.environ.get('SERVO_EVENTS', '2'))
#: Set-points, servoj and a cycle bend times by no more than this [m].
BOUND = 3e-4
FIELDS = (
    'timestamp',
    'actual_TCP_pose',
    'actual_TCP_speed',
    'actual_digital_output_bits',
    'standard_analog_output1',
)
VALVE_CLOSES = SafeOutput(output=OutputKind.STANDARD_DIGITAL, pin=VALVE, value=0.0)
BEAD = ProportionalOutput(
    first_waypoint=0, last_waypoint=1, pin=1, domain=AnalogDomain.VOLTAGE, gain=4.0, offset=0.1
)


def command(waypoint, pin, value=1.0, offset=0.0, **place):
    return IOCommand(
        **place,
        waypoint=waypoint,
        offset=offset,
        output=OutputKind.STANDARD_DIGITAL,
        pin=pin,
        value=value,
    )


def seam(state, **fields):
    """Return a goal around a rounded corner that may be displaced by 2 mm."""
    (x, y, z), turned = state.actual_tcp_pose.position, state.actual_tcp_pose.quaternion
    goal = Goal(
        waypoints=tuple(Waypoint(pose=Pose((x + dx, y + dy, z), turned)) for dx, dy in PLACES),
        segments=(Segment(velocity=SPEED, acceleration=1.0),) * len(PLACES),
        corner_deviation=DEVIATION,
        execution=ExecutionMode.SERVO,
        io_commands=(
            command(0, VALVE),
            command(1, VALVE, 0.0),
            command(1, LAMP, offset=0.1),
            command(2, LIGHT),
        ),
        path_offset=PathOffset(limits=(0.0, ACROSS, 0.0), speed=0.02, acceleration=0.5),
    )
    return replace(goal, **fields)


class Recorded:
    """A goal that runs, and what RTDE reports meanwhile, a row for each packet."""

    def __init__(self, cell, **fields):
        self.cell, self.rows = cell, []
        self._connection = RtdeConnection(RtdeClientCodec(FIELDS), self._take)
        self._fields = fields

    async def start(self):
        await self._connection.open(HOST, RTDE)
        state = self.cell.memory.read()
        self.origin = np.array(state.actual_tcp_pose.position)
        made = plan(seam(state, **self._fields), state, ARM, PlanningOptions())
        self.motion = self.cell.owner.start(made, arm=SETUP)
        return self

    def _take(self, names, values):
        named = dict(zip(names, values, strict=True))
        self.rows.append(
            (
                named['timestamp'],
                *(a - b for a, b in zip(named['actual_TCP_pose'][:3], self.origin, strict=True)),
                float(np.linalg.norm(named['actual_TCP_speed'][:3])),
                named['standard_analog_output1'],
                named['actual_digital_output_bits'],
            )
        )

    async def end(self, bound=60.0):
        await self.cell.until(lambda: self.motion.outcome, bound)
        await self.cell.sleep(5.0 * CYCLE)  # what RTDE has yet to report
        self._connection.close()
        return self.motion.outcome

    def displace(self):
        number = len(self.cell.owner.motions)
        self.cell.owner.send(SetPathOffset(motion=number, offset=(0.0, ACROSS, 0.0), age=0.0))

    def is_on(self, pin):
        return self.cell.robot.controller.io.digital_out.standard[pin]

    @property
    def table(self):
        return np.array(self.rows)

    def row(self, pin, on=True):
        """Return the number of the first packet with an output at its new value."""
        states = self.table[:, 6].astype(int) >> pin & 1
        (changes,) = np.nonzero(np.diff(states) == (1 if on else -1))
        assert len(changes) == 1, (pin, changes)
        return int(changes[0]) + 1

    def switched(self, pin, on=True):
        """Return where the tool is in that packet (3,)."""
        return self.table[self.row(pin, on), 1:4]


@pytest.mark.parametrize('slider', [1.0, 0.5, 0.1])
def test_outputs_switch_where_the_tool_is_beside_its_path(slider):
    async def scenario(cell):
        cell.robot.controller.set_slider(slider)
        run = await Recorded(cell).start()
        await cell.until(lambda: run.is_on(VALVE), 20.0)
        run.displace()
        outcome = await run.end()
        assert outcome.code is ErrorCode.SUCCESSFUL, outcome
        return run

    run = run_cell(scenario)
    bound = SPEED * slider * CYCLE + BOUND
    # In the corner: on its bisector, as near to the point as the rounded path is.
    x, y, _ = run.switched(VALVE)
    assert abs(x - (PLACES[0][1] - y)) < bound * 2**0.5
    assert np.hypot(x, y - PLACES[0][1]) < 2.5 * DEVIATION
    # Beside the line: where the tool passes the point, though it is displaced.
    x, y, _ = run.switched(VALVE, on=False)
    assert abs(x - PLACES[1][0]) < bound
    assert abs(y - PLACES[1][1]) == pytest.approx(ACROSS, abs=2e-4)
    x, *_ = run.switched(LAMP)
    assert x - PLACES[1][0] == pytest.approx(0.1 * SPEED, abs=bound)
    assert run.switched(LIGHT)[:2] == pytest.approx(PLACES[-1], abs=1e-4)
    speeds = run.table[:, 4]
    assert speeds.max() == pytest.approx(SPEED * slider, rel=0.05)


@pytest.mark.parametrize('slider', [1.0, 0.3])
def test_outputs_switch_at_places_beside_points_and_ahead_of_them(slider):
    lead, way = 0.1, 0.02

    async def scenario(cell):
        cell.robot.controller.set_slider(slider)
        run = await Recorded(
            cell,
            io_commands=(
                command(1, LAMP, distance=way),
                command(1, VALVE, distance=way, offset=-lead),
                command(2, LIGHT, fraction=-0.25),
            ),
            path_offset=PathOffset(),
        ).start()
        outcome = await run.end()
        assert outcome.code is ErrorCode.SUCCESSFUL, outcome
        return run

    run = run_cell(scenario)
    bound = SPEED * slider * CYCLE + BOUND
    place = PLACES[1][0] + way
    assert run.switched(LAMP)[0] == pytest.approx(place, abs=bound)
    assert run.switched(VALVE)[0] == pytest.approx(place - lead * slider * SPEED, abs=bound)
    x = PLACES[2][0] - 0.25 * (PLACES[2][0] - PLACES[1][0])
    assert run.switched(LIGHT)[0] == pytest.approx(x, abs=bound)


def wandering(seed, count=9):
    """Return points of a path with corners of 20 to 150 degrees, in a square of 16 cm [m]."""
    rng, points, heading = np.random.default_rng(seed), [np.zeros(2)], 0.0
    while len(points) <= count:
        turn = heading + np.radians(rng.uniform(20.0, 150.0)) * rng.choice((-1.0, 1.0))
        there = points[-1] + rng.uniform(0.025, 0.04) * np.array([np.cos(turn), np.sin(turn)])
        if np.abs(there).max() < 0.08:
            points, heading = [*points, there], turn
    return points[1:]


@pytest.mark.parametrize('seed', range(SEEDS))
def test_outputs_switch_in_the_middle_of_random_corners(seed):
    async def scenario(cell):
        (x, y, z), turned = (
            cell.memory.read().actual_tcp_pose.position,
            cell.memory.read().actual_tcp_pose.quaternion,
        )
        run = await Recorded(
            cell,
            waypoints=tuple(
                Waypoint(pose=Pose((x + dx, y + dy, z), turned)) for dx, dy in wandering(seed)
            ),
            segments=(Segment(velocity=SPEED, acceleration=1.0),) * 9,
            io_commands=tuple(command(pin, pin) for pin in range(8)),
            path_offset=PathOffset(),
        ).start()
        outcome = await run.end()
        assert outcome.code is ErrorCode.SUCCESSFUL, outcome
        return run

    run = run_cell(scenario)
    corners, places = np.array(wandering(seed)), run.table[:, 1:3]
    rows = [run.row(pin) for pin in range(8)]
    assert rows == sorted(rows)
    for corner, row in zip(corners, rows, strict=False):
        near = places[max(row - 40, 0) : row + 40]
        middle = near[np.argmin(np.linalg.norm(near - corner, axis=1))]
        assert np.linalg.norm(places[row] - middle) < SPEED * CYCLE + BOUND


@pytest.mark.parametrize('gap', [0.03, 0.1])
def test_a_gap_in_the_packets_shifts_no_output_also_where_the_buffer_runs_empty(gap):
    async def scenario(cell):
        run = await Recorded(cell, path_offset=PathOffset()).start()
        await cell.until(lambda: run.rows and run.rows[-1][2] > 0.02)
        cell.robot.inject(f'silence rtde for {gap} s')
        outcome = await run.end()
        assert outcome.code is ErrorCode.SUCCESSFUL, outcome
        return run

    run = run_cell(scenario)
    assert abs(run.switched(VALVE, on=False)[0] - PLACES[1][0]) < SPEED * CYCLE + BOUND
    assert run.switched(LIGHT)[:2] == pytest.approx(PLACES[-1], abs=1e-4)


def test_a_pause_shifts_no_output_and_what_it_closed_opens_again():
    async def scenario(cell):
        safe = (replace(VALVE_CLOSES, restore=True),)
        run = await Recorded(cell, safe_outputs=safe).start()
        await cell.until(lambda: run.is_on(VALVE), 3.0)
        cell.robot.inject('pause')
        controller = cell.robot.controller
        await cell.until(lambda: controller.programs.state is RuntimeState.PAUSED)
        await cell.until(lambda: not run.is_on(VALVE), 0.3)
        await cell.sleep(1.0)
        await cell.dashboard('play')
        await cell.until(lambda: run.is_on(VALVE), 0.3)
        outcome = await run.end()
        assert outcome.code is ErrorCode.SUCCESSFUL, outcome
        return run

    run = run_cell(scenario)
    x, *_ = run.switched(LAMP)
    assert x - PLACES[1][0] == pytest.approx(0.1 * SPEED, abs=SPEED * CYCLE + BOUND)


@pytest.mark.parametrize('end', ['cancel', 'protective_stop', 'stop', 'cut'])
def test_after_every_other_end_the_valve_is_closed_and_nothing_goes_on(end):
    async def scenario(cell):
        run = await Recorded(cell, safe_outputs=(VALVE_CLOSES,)).start()
        await cell.until(lambda: run.is_on(VALVE), 3.0)
        if end == 'cancel':
            cell.owner.cancel()
            await cell.until(lambda: not run.is_on(VALVE), 0.1)
            assert not cell.at_rest()
        elif end == 'cut':
            for port in (RTDE, PRIMARY, REVERSE, TRAJECTORY, COMMANDS):
                cell.loop.freeze(port)
        else:
            cell.robot.inject(end)
        outcome = await run.end(10.0)
        assert not outcome.succeeded
        await cell.until(cell.at_rest, 2.0)
        await cell.until(lambda: not run.is_on(VALVE), 0.5)
        await cell.sleep(1.0)
        assert not any(run.is_on(pin) for pin in (VALVE, LAMP, LIGHT))
        return run

    run_cell(scenario)


def test_after_a_cancel_the_next_goal_reads_its_own_points():
    async def scenario(cell):
        run = await Recorded(cell).start()
        await cell.until(lambda: run.is_on(VALVE), 3.0)
        cell.owner.cancel()
        assert (await run.end()).code is ErrorCode.CANCELLED
        again = await Recorded(cell, io_commands=(command(1, NOTHING),)).start()
        outcome = await again.end()
        assert outcome.code is ErrorCode.SUCCESSFUL, outcome
        assert again.is_on(NOTHING)
        assert not again.is_on(LIGHT)

    run_cell(scenario)


def test_the_amount_is_the_law_of_the_speed_also_where_the_corner_slows_it():
    async def scenario(cell):
        controller = cell.robot.controller
        controller.io.analog_out_voltage[:] = [True, True]
        controller.io.set_analog_out(1, 0.0)
        run = await Recorded(cell, io_commands=(), proportional_outputs=(BEAD,)).start()
        outcome = await run.end()
        assert outcome.code is ErrorCode.SUCCESSFUL, outcome
        return run.table

    table = run_cell(scenario)
    speeds, amounts = table[:, 4], table[:, 5] / 10.0
    flows = np.flatnonzero(amounts)
    inside = flows[3:-3]
    # A program reads the speed of the cycle before.
    assert np.abs(amounts[inside] - (0.1 + 4.0 * speeds[inside - 1])).max() < 1e-3
    assert np.ptp(speeds[inside]) > 0.03
    begin, end = table[flows[0], 1:3], table[flows[-1] + 1, 1:3]
    assert np.hypot(*(begin - PLACES[0])) < 2.5 * DEVIATION + SPEED * CYCLE
    assert abs(end[0] - PLACES[1][0]) < SPEED * CYCLE + BOUND


@pytest.mark.parametrize('displaced', [False, True])
def test_the_arm_waits_in_the_middle_of_the_path_and_at_its_end(displaced):
    """The valve opens before the waits; a rest counts from when its input has come."""

    async def scenario(cell):
        waits = tuple(
            InputWait(waypoint=k, input=InputKind.STANDARD_DIGITAL, pin=k, value=1.0, timeout=5.0)
            for k in (1, 2)
        )
        segment = Segment(velocity=SPEED, acceleration=1.0)
        run = await Recorded(
            cell,
            input_waits=waits,
            segments=(segment, replace(segment, dwell=0.3), segment),
            io_commands=(command(1, VALVE), command(1, LAMP, offset=0.2), command(2, LIGHT)),
        ).start()
        await cell.until(lambda: run.rows and run.rows[-1][1] > 0.01, 5.0)
        if displaced:
            run.displace()
        await cell.until(lambda: abs(run.rows[-1][2] - PLACES[1][1]) > 0.9 * ACROSS * displaced)
        await cell.until(lambda: run.is_on(VALVE), 5.0)
        assert run.table[-1, 4] < 5e-3
        await cell.sleep(0.5)
        x, y = run.table[-1, 1:3]
        assert x == pytest.approx(PLACES[1][0], abs=1e-4)
        assert abs(y - PLACES[1][1]) == pytest.approx(ACROSS * displaced, abs=1e-4)
        assert not run.is_on(LAMP)
        cell.robot.controller.io.digital_in.standard[1] = True
        assert await cell.until(lambda: run.is_on(LAMP)) == pytest.approx(0.2, abs=0.02)
        await cell.until(lambda: run.table[-1, 4] > 1e-3)
        assert not run.is_on(LIGHT)
        await cell.until(lambda: run.is_on(LIGHT), 5.0)
        await cell.sleep(0.5)
        assert not run.motion.outcome
        cell.robot.controller.io.digital_in.standard[2] = True
        outcome = await run.end(2.0)
        # The waits are no delay: the tolerance of the time is half a second.
        assert outcome.code is ErrorCode.SUCCESSFUL, outcome
        assert run.table[-1, 1:3] == pytest.approx(PLACES[2], abs=1e-4)

    run_cell(scenario)


@pytest.mark.parametrize(
    'settings',
    [
        {},
        # It passes its last set-point before it rests there.
        {'servoj_gain': 1250.0, 'servoj_lookahead_time': 0.04},
        # It has lost the set-points that the arm passes.
        {'servo_buffer_depth': 60},
    ],
)
def test_an_output_before_a_wait_comes_when_the_arm_rests(settings):
    async def scenario(cell):
        wait = InputWait(
            waypoint=1, input=InputKind.STANDARD_DIGITAL, pin=1, value=1.0, timeout=5.0
        )
        commands = (command(1, VALVE),)
        run = await Recorded(cell, input_waits=(wait,), io_commands=commands).start()
        await cell.until(lambda: run.is_on(VALVE), 5.0)
        cell.robot.controller.io.digital_in.standard[1] = True
        outcome = await run.end()
        assert outcome.code is ErrorCode.SUCCESSFUL, outcome
        return run.table[run.row(VALVE), 4]

    assert run_cell(scenario, robot={'frequency': 500.0}, **settings) < 1e-3


def test_the_node_that_is_silent_leaves_the_valve_closed():
    async def scenario(cell):
        run = await Recorded(cell, safe_outputs=(VALVE_CLOSES,)).start()
        await cell.until(lambda: run.is_on(VALVE), 3.0)
        cell.owner.silent = True
        await cell.until(lambda: not run.is_on(VALVE), 2.0)
        await cell.until(cell.at_rest, 2.0)
        await cell.sleep(1.0)
        assert not any(run.is_on(pin) for pin in (VALVE, LAMP, LIGHT))

    run_cell(scenario)
