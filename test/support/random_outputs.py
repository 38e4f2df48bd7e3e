# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Random goals with outputs by place, overtaking leads and pulses, in one run."""

from dataclasses import replace
from math import log10

import numpy as np
from output_judge import judge_commands, judge_pulses, JudgedRun, PathTime, SLIDERS, SLOW
from random_cases import random_of
from recorded_goal import SETUP
from robot_cell import RTDE, run_cell
from traced_run import ARM, HOME, instructions_of, OPTIONS, STEP, TOOL, ZIGZAG
from virtual_network import HOST

from ur_cartesian_driver.motion.errors import GoalRefused
from ur_cartesian_driver.motion.geometry.pose import Pose
from ur_cartesian_driver.motion.goal.execution_modes import ExecutionMode
from ur_cartesian_driver.motion.goal.goal import (
    Goal,
    IOCommand,
    OutputKind,
    PulseTrain,
    Segment,
    Waypoint,
)
from ur_cartesian_driver.path import PathPlace, resume
from ur_cartesian_driver.planning import plan
from ur_cartesian_driver.protocol.rtde.rtde_client import RtdeClientCodec
from ur_cartesian_driver.robot.rtde.rtde_connection import RtdeConnection

KINDS = ('stops', 'dwells', 'rounded', 'spline', 'appended', 'resumed', 'servo')
#: As many points on a line [m], for servoj: it cuts corners, at which no place is exact.
LINE = tuple((0.05 * (k + 1), 0.0) for k in range(len(ZIGZAG)))
LAST = len(ZIGZAG) - 1
#: Largest time error of an output or a pulse [cycles]: one, and the error of the judge. If points
#: are appended, the speed at the begin of a lead is known less well; with set-points, the speed is
#: not steady.
BOUND, APPENDED_BOUND, SERVO_BOUND = 1.1, 2.0, 3.0


class Case:
    """A random goal, and the way in which it is run."""

    def __init__(self, number, attempt):
        self.random = draw = random_of('outputs', number, attempt)
        self.kind = KINDS[number % len(KINDS)]
        self.shape = self.kind
        if self.kind in ('resumed', 'servo'):
            self.shape = draw.choice(KINDS[:4])
        #: From 1 to 250 mm/s; a slow tool makes a smaller zigzag.
        self.speed = 10.0 ** draw.uniform(-3.0, log10(0.25))
        self.size = min(1.0, 8.0 * self.speed)
        self.sizes = draw.choice([(2, 3), (3, 2), (2, 1, 2)]) if self.kind == 'appended' else ()
        self.stopped = PathPlace(point=draw.randint(1, 3), fraction=draw.uniform(0.2, 0.8))
        self.slider = self._slider()
        self.pauses = self._pauses()
        self.commands, self.pulses = self._commands(), self._pulses()

    def goal(self, home):
        """Return the goal, from a start pose."""
        x, y, z = home.position
        timed = self.shape in ('spline', 'appended')
        period = 0.06 * self.size / self.speed
        points = LINE if self.kind == 'servo' else ZIGZAG
        places = [(self.size * dx, self.size * dy) for dx, dy in ((0.0, 0.0), *points)]
        goal = Goal(
            waypoints=tuple(
                Waypoint(
                    pose=Pose((x + dx, y + dy, z), home.quaternion),
                    time=period * (k + 1) if timed else 0.0,
                    twist=self._twist(places, k, period) if timed else (0.0,) * 6,
                )
                for k, (dx, dy) in enumerate(places[1:])
            ),
            segments=()
            if timed
            else tuple(
                Segment(
                    velocity=self.speed,
                    acceleration=1.2,
                    dwell=0.1 if self.shape == 'dwells' and k < LAST else 0.0,
                )
                for k in range(LAST + 1)
            ),
            execution=ExecutionMode.SPLINE if timed else ExecutionMode.AUTO,
            corner_deviation=0.001 * self.size if self.shape == 'rounded' else 0.0,
            io_commands=self.commands,
            pulses=self.pulses,
        )
        if self.kind == 'servo':
            # Pauses and the slider take their time.
            return replace(goal, execution=ExecutionMode.SERVO, goal_time_tolerance=600.0)
        if self.kind != 'resumed':
            return goal
        return resume(goal, self.stopped, overlap=0.01 * self.size, approach=0.01).goal

    def act(self, controller, cycle):
        """Pause and resume the program in its cycles."""
        for begin, end in self.pauses:
            if cycle == begin:
                controller.programs.pause()
            elif cycle == end:
                controller.programs.play()

    def _twist(self, places, k, period):
        """Return the velocity at a point: the mean velocity between its neighbours."""
        if k == LAST:
            return (0.0,) * 6
        (ax, ay), (bx, by) = places[k], places[k + 2]
        return ((bx - ax) / (2.0 * period), (by - ay) / (2.0 * period), 0.0, 0.0, 0.0, 0.0)

    def _slider(self):
        """Return the speed slider by cycle."""
        name = self.random.choice([*SLIDERS, 'a person'])
        if name != 'a person':
            return SLIDERS[name]
        settings = [self.random.uniform(0.1, 1.0) for _ in range(8)]
        period = self.random.randint(20, 400)
        return lambda cycle: settings[cycle // period % 8]

    def _pauses(self):
        """Return the cycles in which the program is paused, and goes on."""
        cycles = int(0.28 * self.size / self.speed / 0.002)
        begins = sorted(self.random.randint(50, cycles) for _ in range(self.random.randint(0, 2)))
        pauses = [(begin, begin + self.random.randint(60, 200)) for begin in begins]
        return [each for k, each in enumerate(pauses) if not k or each[0] > pauses[k - 1][1] + 200]

    def _commands(self):
        """Return commands beside points; leads of near commands can overtake one another."""
        draw, commands = self.random, []
        beside = draw.randint(1, 3), draw.uniform(-0.02, 0.02)
        for pin in range(4):
            waypoint, distance = beside
            place = {'distance': (distance + 0.001 * pin) * self.size}
            if draw.random() < 0.5:
                waypoint = draw.randint(1, 3)
                place = draw.choice(
                    [
                        {'distance': draw.uniform(-0.03, 0.03) * self.size},
                        {'fraction': draw.uniform(-0.9, 0.9)},
                        {},
                    ]
                )
            lead = draw.choice([0.0, draw.uniform(0.002, 0.2)])
            commands.append(
                IOCommand(
                    waypoint=waypoint,
                    offset=-lead,
                    output=OutputKind.STANDARD_DIGITAL,
                    pin=pin,
                    value=1.0,
                    **place,
                )
            )
        return tuple(commands)

    def _pulses(self):
        draw, trains = self.random, []
        # Otherwise the number of pulses before the last point is not certain.
        least = 3.0 * (SetPointRun if self.kind == 'servo' else JudgedRun).rounding
        for pin in (4, 5):
            first = draw.randint(0, 2 if not self.sizes else self.sizes[0] - 2)
            width = draw.choice([0.0, 0.004, 0.01])
            room = 1.2 * self.speed * (width + 0.004)
            trains.append(
                PulseTrain(
                    first_waypoint=first,
                    last_waypoint=LAST if self.sizes else draw.randint(first + 1, LAST),
                    output=OutputKind.STANDARD_DIGITAL,
                    pin=pin,
                    distance=max(draw.uniform(0.0005, 0.006) * self.size, room, least),
                    phase=draw.uniform(0.0, 0.01) * self.size,
                    width=width,
                )
            )
        return tuple(trains)


def accepted(number, robot):
    """Return the first accepted case of a number, and the number of cases refused before."""
    for attempt in range(100):
        case, state = Case(number, attempt), robot.place(HOME, TOOL)
        try:
            instructions_of(case.goal(state.actual_tcp_pose), state, case.sizes)
        except GoalRefused:
            continue
        return case, attempt
    raise AssertionError('no case of this number is accepted')


class SetPointRun(JudgedRun):
    """A run by set-points: driver and robot in virtual time, seen by another client of RTDE."""

    #: After a pause, servoj catches up with its set-points.
    max_rate = 2.0
    #: servoj creeps up to the last set-point, and the goal ends before it arrives.
    rounding = 1e-4

    def _trace(self, robot, goal, slider, act, sizes):
        positions, outputs = [], []

        async def scenario(cell):
            controller = cell.robot.controller

            def take(names, values):
                position, bits = dict(zip(names, values, strict=True)).values()
                positions.append(position[:3])
                outputs.append([bits >> pin & 1 for pin in range(8)])
                controller.set_slider(slider(len(positions)))
                act(controller, len(positions))

            nonlocal goal
            state = cell.memory.read()
            goal = goal(state.actual_tcp_pose)
            fields = ('target_TCP_pose', 'actual_digital_output_bits')
            connection = RtdeConnection(RtdeClientCodec(fields), take)
            await connection.open(HOST, RTDE)
            motion = cell.owner.start(plan(goal, state, ARM, OPTIONS), arm=SETUP)
            await cell.until(lambda: motion.outcome, 600.0)
            await cell.sleep(5.0 * STEP)  # RTDE has yet to report the end
            connection.close()
            assert motion.outcome.succeeded, motion.outcome

        run_cell(scenario, robot={'frequency': 1.0 / STEP, 'q': HOME})
        return goal, np.array(positions), outputs


def verdicts(case, robot):
    """Run a case; return the verdicts on its commands and on each pulse train."""
    run_of = SetPointRun if case.kind == 'servo' else JudgedRun
    slow = run_of(robot, case.goal, lambda cycle: SLOW, sizes=case.sizes)
    run = run_of(robot, case.goal, case.slider, case.act, sizes=case.sizes)
    pulse_bound = SERVO_BOUND if case.kind == 'servo' else BOUND
    bound = APPENDED_BOUND if case.kind == 'appended' else pulse_bound
    return (
        judge_commands(run, PathTime(slow), bound, case.pauses),
        *(judge_pulses(run, train, pulse_bound, case.pauses) for train in run.goal.pulses),
    )
