# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Outputs on the robot: where the tool is in the cycle in which they change, and in which order.

The outputs and the tool of the simulated controller are measured, cycle by cycle; the places come
from the test.
"""

from math import hypot

import pytest
from robot_in_memory import RobotInMemory

from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.kinematics.robot_models import robot_model
from ur_cartesian_driver.motion.events import TrajectoryResult
from ur_cartesian_driver.motion.geometry.pose import IDENTITY, Pose
from ur_cartesian_driver.motion.geometry.vectors import add6, scale6, subtract6
from ur_cartesian_driver.motion.goal.goal import OutputKind
from ur_cartesian_driver.motion.plan.primitive import MoveC, MoveJ, MoveL, Spline, SwitchOutput
from ur_cartesian_driver.motion.state.io_signals import AnalogDomain
from ur_cartesian_driver.program import wrap_in_program
from ur_cartesian_driver.program.render import PREFIX
from ur_cartesian_driver.protocol.program.trajectory_points import MAX_PENDING_OUTPUTS

HOME = (0.3, -1.4, 1.5, -1.6, -1.5, 0.2)
STEP = 0.002
SPEED = 0.25


@pytest.fixture(scope='module')
def robot():
    return RobotInMemory('ur5e')


class Watched:
    """Records each change of the outputs, and the place of the tool."""

    def __init__(self, robot):
        signals = robot.controller.io
        robot.place(HOME, IDENTITY)
        self.start = robot.controller.motion.T_base_tcp
        signals.digital_out.standard[:] = [False] * 8
        signals.digital_out.configurable[:] = [False] * 8
        signals.digital_out.tool[:] = [False] * 2
        self._signals, self.changes, self.cycles = signals, [], 0
        self._before = self._all()

    def _all(self):
        out = self._signals.digital_out
        return (*out.standard, *out.configurable, *out.tool, *self._signals.analog_out)

    def __call__(self, controller):
        self.cycles += 1
        now = self._all()
        for pin, (a, b) in enumerate(zip(self._before, now, strict=True)):
            if a != b:
                self.changes.append((pin, b, controller.motion.T_base_tcp.position, self.cycles))
        self._before = now

    def at(self, x=0.0, y=0.0, z=0.0):
        """Return a pose beside the start, in its orientation."""
        a, b, c = self.start.position
        return Pose((a + x, b + y, c + z), self.start.quaternion)


def switch(pin, value=1.0, output=OutputKind.STANDARD_DIGITAL, **where):
    return SwitchOutput(output=output, pin=pin, value=value, **where)


def line(pose, radius=0.0):
    return MoveL(target=pose, velocity=SPEED, acceleration=2.0, blend_radius=radius)


def heading(pose, x, y, z=0.0):
    """A direction of base in the axes of a pose."""
    turned = Pose((0.0, 0.0, 0.0), pose.quaternion).inverse() @ Pose((x, y, z))
    return (*turned.position, 0.0, 0.0, 0.0)


def apart(a, b):
    return hypot(*(x - y for x, y in zip(a, b, strict=True)))


def test_outputs_without_trigger_pose_switch_at_once_and_in_order(robot):
    watched = Watched(robot)
    run = robot.run(
        [
            line(watched.at(x=0.02)),
            switch(2),
            switch(7),
            switch(2, 0.0),
            switch(3),
            line(watched.at()),
        ],
        on_cycle=watched,
    )
    assert not run.failure
    # Two of them changed the same output in one cycle.
    assert [change[:2] for change in watched.changes] == [(3, True), (7, True)]
    # In the next line's first cycle, the rest of the cycle in which the line before ended.
    begun = 0.5 * 2.0 * (2.0 * robot.controller.cycle) ** 2
    for change in watched.changes:
        assert apart(change[2], watched.at(x=0.02).position) < begun


def test_an_output_switches_at_its_trigger_pose_on_a_line(robot):
    watched = Watched(robot)
    places = [watched.at(x=0.01 + 0.0071 * k) for k in range(9)]
    run = robot.run(
        [
            line(watched.at(y=-0.01)),
            line(watched.at()),
            *(
                switch(
                    k % 8, float(k < 8), trigger_pose=place, trigger_direction=heading(place, 1, 0)
                )
                for k, place in enumerate(places)
            ),
            line(watched.at(x=0.1)),
        ],
        on_cycle=watched,
    )
    assert not run.failure
    assert [change[0] for change in watched.changes] == [0, 1, 2, 3, 4, 5, 6, 7, 0]
    for change, place in zip(watched.changes, places, strict=True):
        assert apart(change[2], place.position) < 0.6 * SPEED * STEP


def test_an_output_switches_in_the_middle_of_a_blend_without_stopping(robot):
    """The plane that halves the corner: whatever the corner's shape, its middle lies there."""
    watched = Watched(robot)
    corner = watched.at(x=0.06)
    run = robot.run(
        [
            line(corner, 0.02),
            switch(1, trigger_pose=corner, trigger_direction=heading(corner, 0.5**0.5, 0.5**0.5)),
            line(watched.at(x=0.06, y=0.06)),
        ],
        on_cycle=watched,
    )
    assert not run.failure
    ((_, _, position, _),) = watched.changes
    middle = min((pose.position for pose in run.poses), key=lambda p: apart(p, corner.position))
    assert 0.001 < apart(middle, corner.position) < 0.02
    assert apart(position, middle) < 0.6 * SPEED * STEP


@pytest.mark.slow
def test_an_output_that_starts_beyond_its_plane_waits_for_the_next_crossing(robot):
    """Three quarters around a circle: the tool begins beyond the plane of a place on it."""
    watched = Watched(robot)
    moves = [line(watched.at(y=0.01)), line(watched.at())]
    arc = MoveC(
        via=watched.at(x=0.08), target=watched.at(x=0.04, y=-0.04), velocity=0.1, acceleration=1.0
    )
    # Counterclockwise seen along +z the tool comes to (0.04, -0.04) from +x.
    place = watched.at(x=0.04 + 0.04 * 0.8, y=-0.04 * 0.6)
    way = heading(place, -0.6, -0.8)
    early = robot.run(
        [*moves, switch(0, trigger_pose=place, trigger_direction=way), arc], on_cycle=watched
    )
    assert not early.failure
    assert apart(watched.changes[0][2], place.position) > 0.03
    watched = Watched(robot)
    run = robot.run(
        [*moves, switch(0, trigger_pose=place, trigger_direction=way, starts_beyond=True), arc],
        on_cycle=watched,
    )
    assert not run.failure
    assert apart(watched.changes[0][2], place.position) < 0.1 * STEP


def test_a_rotation_in_place_has_a_trigger_direction(robot):
    watched = Watched(robot)
    axis = Pose((0.0, 0.0, 0.0), (0.0, 0.0, 2**-0.5, 2**-0.5))
    half = Pose((0.0, 0.0, 0.0), (0.0, 0.0, 0.3826834323650898, 0.9238795325112867))
    place = watched.start @ half
    seen = []

    def look(controller):
        watched(controller)
        seen.append(controller.motion.T_base_tcp.angle_to(place))

    run = robot.run(
        [
            line(watched.at(x=0.01)),
            line(watched.at()),
            switch(4, trigger_pose=place, trigger_direction=(0.0, 0.0, 0.0, 0.0, 0.0, 1.0)),
            MoveL(target=watched.start @ axis, velocity=0.5, acceleration=2.0),
        ],
        on_cycle=look,
    )
    assert not run.failure
    # Half a cycle at 2 rad/s: movel turns four times as fast as its v says.
    assert seen[watched.changes[0][3] - 1] < 0.5 * STEP * 2.0


def test_an_output_switches_between_two_pieces_of_a_spline(robot):
    watched = Watched(robot)
    arm = Arm(robot_model('ur5e'))
    middle = add6(HOME, (0.1, 0.05, 0, 0, 0, 0))
    end = add6(HOME, (0.2, 0.1, 0, 0, 0, 0))
    speed = scale6(subtract6(middle, HOME), 2.0)
    place, beyond = (
        arm.forward(middle),
        arm.forward(tuple(a + 0.001 * v for a, v in zip(middle, speed, strict=True))),
    )
    way = [b - a for a, b in zip(place.position, beyond.position, strict=True)]
    run = robot.run(
        [
            Spline(target=middle, velocities=speed, duration=0.7),
            switch(
                5,
                trigger_pose=place,
                trigger_direction=heading(place, *(x / hypot(*way) for x in way)),
            ),
            Spline(target=end, velocities=(0.0,) * 6, duration=0.7),
        ],
        on_cycle=watched,
    )
    assert not run.failure
    # The first one of a trajectory also wakes the thread that looks for it.
    assert apart(watched.changes[0][2], place.position) < 1.2 * hypot(*way) / 0.001 * STEP
    assert watched.changes[0][3] * STEP == pytest.approx(0.7, abs=3 * STEP)


def test_an_output_is_switched_although_the_tool_never_reaches_its_trigger_pose(robot):
    watched = Watched(robot)
    nowhere = watched.at(x=0.5)
    run = robot.run(
        [
            line(watched.at(x=0.02)),
            switch(1, trigger_pose=nowhere, trigger_direction=heading(nowhere, 1, 0)),
            line(watched.at(x=0.04)),
            line(watched.at(x=0.06)),
        ],
        on_cycle=watched,
    )
    assert not run.failure
    assert apart(watched.changes[0][2], watched.at(x=0.04).position) < 1e-4


def test_delays_count_from_the_end_of_the_motion_and_success_waits_for_them(robot):
    watched = Watched(robot)
    run = robot.run(
        [
            line(watched.at(x=0.02)),
            switch(0, delay=0.1),
            switch(1, delay=0.1),
            switch(2, delay=0.25),
        ],
        on_cycle=watched,
    )
    assert not run.failure
    moving = sum(a != b for a, b in zip(run.poses, run.poses[1:], strict=False))
    assert [change[0] for change in watched.changes] == [0, 1, 2]
    for change, delay in zip(watched.changes, (0.1, 0.1, 0.25), strict=True):
        assert (change[3] - moving) * STEP == pytest.approx(delay, abs=5 * STEP)
    assert run.duration > watched.changes[-1][3] * STEP


@pytest.mark.parametrize(
    ('text', 'changed', 'far'),
    [
        ('OUTPUT_LEAD = 1.5', 'OUTPUT_LEAD = 21.5', 20.0),
        (f'due = {PREFIX}outputs_done < {PREFIX}outputs_due', 'due = True', 25.0),
    ],
)
def test_a_changed_program_changes_where_outputs_switch(text, changed, far):
    """So the tests above would find it: in steps of the tool along the line."""

    def edit(program):
        assert program.count(text) == 1
        return wrap_in_program(program.replace(text, changed))

    robot = RobotInMemory('ur5e', edit=edit)
    watched = Watched(robot)
    place = watched.at(x=0.06)
    robot.run(
        [
            line(watched.at(y=-0.01)),
            line(watched.at()),
            switch(1, trigger_pose=place, trigger_direction=heading(place, 1, 0)),
            line(watched.at(x=0.1)),
        ],
        on_cycle=watched,
    )
    assert apart(watched.changes[0][2], place.position) >= 0.9 * far * SPEED * STEP


def test_no_variable_begins_as_an_int_and_is_given_a_fraction(widened):
    robot = RobotInMemory('ur5e')
    watched = Watched(robot)
    place = watched.at(x=0.005)
    points = [
        line(watched.at(y=0.01)),
        switch(1, delay=0.01),
        line(watched.at()),
        switch(2, trigger_pose=place, trigger_direction=heading(place, 1, 0)),
        line(watched.at(x=0.01)),
        *(switch(3, float(k % 2)) for k in range(MAX_PENDING_OUTPUTS + 1)),
        MoveJ(target=HOME, duration=0.5),
    ]
    assert not robot.run(points, on_cycle=watched).failure
    assert widened == set()


@pytest.mark.parametrize(
    ('output', 'first', 'pins'),
    [
        (OutputKind.STANDARD_DIGITAL, 0, 8),
        (OutputKind.CONFIGURABLE_DIGITAL, 8, 8),
        (OutputKind.TOOL_DIGITAL, 16, 2),
    ],
)
def test_each_output_switches_the_right_pin(robot, output, first, pins):
    watched = Watched(robot)
    run = robot.run(
        [line(watched.at(x=0.01)), *(switch(pin, output=output) for pin in range(pins))],
        on_cycle=watched,
    )
    assert not run.failure
    assert sorted(change[:2] for change in watched.changes) == [
        (first + pin, True) for pin in range(pins)
    ]


@pytest.mark.parametrize(
    ('domain', 'expected'),
    [(AnalogDomain.CURRENT, 0.004 + 0.016 * 0.3), (AnalogDomain.VOLTAGE, 3.0)],
)
def test_analog_outputs_in_both_domains(robot, domain, expected):
    watched = Watched(robot)
    run = robot.run(
        [line(watched.at(x=0.01)), switch(1, 0.3, OutputKind.STANDARD_ANALOG, domain=domain)],
        on_cycle=watched,
    )
    assert not run.failure
    assert robot.controller.io.analog_out[1] == pytest.approx(expected)
    assert robot.controller.io.analog_out_voltage[1] == (domain is AnalogDomain.VOLTAGE)


def test_too_many_pending_outputs_are_a_failure(robot):
    watched = Watched(robot)
    place = watched.at(x=0.05)
    many = [
        switch(0, k % 2, trigger_pose=place, trigger_direction=heading(place, 1, 0))
        for k in range(MAX_PENDING_OUTPUTS + 1)
    ]
    moves = [line(watched.at(x=0.02)), *many, line(watched.at(x=0.1))]
    run = robot.run(moves, on_cycle=watched)
    assert run.result is TrajectoryResult.FAILURE
    assert watched.changes == []
    assert not robot.run([*moves[:-2], moves[-1]]).failure


def test_the_end_of_a_trajectory_discards_pending_outputs(robot):
    watched = Watched(robot)
    place = watched.at(x=0.05)
    late = switch(1, trigger_pose=place, trigger_direction=heading(place, 1, 0))
    bad = Spline(target=HOME, velocities=(0.0,) * 6, duration=0.0)
    run = robot.run([line(watched.at(x=0.02)), late, bad, MoveJ(target=HOME)], on_cycle=watched)
    assert run.result is TrajectoryResult.CANCELED
    assert not robot.run(
        [line(watched.at(x=0.03)), line(watched.at(x=0.1))], on_cycle=watched
    ).failure
    assert watched.changes == []
