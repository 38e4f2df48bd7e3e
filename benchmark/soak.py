# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Endless short goals with random cancels, stops of the robot and cut connections.

Every goal has to end with a result, and node and robot process must not grow once they are warm.
They are warm after more than 60 s, because the server keeps a goal for 60 s after its end, for
late clients. The same seed gives the same goals.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, fields
import os
from pathlib import Path
import random
import time
from typing import Any

from builtin_interfaces.msg import Duration
from figures import Figure, percentile
from processes import Child, children_of, node, simulator
from ros_client import _message, TimedClient
from std_srvs.srv import Trigger

from ur_cartesian_driver.action import FollowCartesianTrajectory
from ur_cartesian_driver.motion.errors import ErrorCode
from ur_cartesian_driver.motion.geometry.pose import Pose
from ur_cartesian_driver.msg import CartesianTrajectoryPoint

NAME = 'soak'
#: A little more than the time for which the server keeps an ended goal [s].
WARM = 70.0
#: Longest time to a result [s], even with a slider at 0, a stop or a lost connection.
RESULT_TIMEOUT = 30.0
RECOVERY_TIMEOUT = 60.0
SAMPLE_PERIOD = 2.0
NOT_READY = ErrorCode.ROBOT_NOT_READY.name
#: Events during a goal, with their relative frequency; empty = none. All but cancel and
#: preempted are faults of the simulator.
EVENTS: tuple[tuple[str, int], ...] = (
    ('', 60),
    ('cancel', 15),
    ('preempted', 5),
    ('slider 0.3 at 0.02 s', 4),
    ('slider 0 at 0.02 s', 2),
    ('pause at 0.02 s', 2),
    ('protective_stop at 0.02 s', 2),
    ('stop at 0.02 s', 3),
    ('drop rtde at 0.02 s for 0.1 s', 2),
    ('drop primary at 0.02 s for 0.1 s', 2),
    ('drop sockets at 0.02 s for 0.1 s', 4),
)


@dataclass(frozen=True, slots=True)
class Footprint:
    """Resident memory [MB]; numbers of threads, file descriptors and shared memory files."""

    memory: float
    threads: float
    descriptors: float
    shared: float

    @classmethod
    def of(cls, pid: int) -> Footprint:
        """Read the footprint of a process (proc(5))."""
        root = Path(f'/proc/{pid}')
        pages = int((root / 'statm').read_text().split()[1])
        mapped = (root / 'maps').read_text()
        names = {
            line.split(maxsplit=5)[5]
            for line in mapped.splitlines()
            if '/dev/shm/' in line or '/memfd:' in line
        }
        return cls(
            pages * os.sysconf('SC_PAGESIZE') / 1e6,
            len(list((root / 'task').iterdir())),
            len(list((root / 'fd').iterdir())),
            len(names),
        )


class Soak:
    """A run of goals, with its outcomes and samples."""

    def __init__(
        self,
        robot: Child,
        client: TimedClient,
        pids: Mapping[str, int],
        undisturbed: bool,
        seed: int = 1,
    ) -> None:
        """
        Prepare; :meth:`run` sends the goals.

        :param undisturbed: no faults, and goals as short as possible.
        """
        self._robot, self._client, self._pids = robot, client, pids
        self._undisturbed = undisturbed
        self._random = random.Random(seed)
        self._home: Pose = robot.call('state').T_base_tcp
        self._recover = client._node.create_client(Trigger, '/ur_cartesian_driver/recover')
        self.outcomes: Counter[str] = Counter()
        self.missing = 0
        self.longest = 0.0
        #: For each process: times since the start [s] and footprints.
        self.samples: dict[str, list[tuple[float, Footprint]]] = {name: [] for name in pids}
        self._due = 0.0

    def run(self, seconds: float, goals: int) -> None:
        """Send goals until a time has passed [s], or a number of goals has ended."""
        begin = time.monotonic()
        while time.monotonic() - begin < seconds and self.outcomes.total() < goals:
            self._sample(time.monotonic() - begin)
            self._goal()

    def _sample(self, now: float) -> None:
        if now >= self._due:
            self._due = now + SAMPLE_PERIOD
            for name, pid in self._pids.items():
                self.samples[name].append((now, Footprint.of(pid)))

    def _goal(self) -> None:
        """Run one goal to its end, and recover so that the next one can run."""
        (event,) = (
            ['']
            if self._undisturbed
            else self._random.choices(
                [name for name, _ in EVENTS], [weight for _, weight in EVENTS]
            )
        )
        begin, before = time.monotonic(), self.outcomes[NOT_READY]
        others = []
        try:
            handle, _ = self._client.wait(self._client.send(self._message()), RESULT_TIMEOUT)
            if event == 'cancel':
                self._client.spin(self._random.uniform(0.0, 0.2))
                handle.cancel_goal_async()
            elif event == 'preempted':
                self._client.spin(self._random.uniform(0.0, 0.2))
                other, _ = self._client.wait(self._client.send(self._message()), RESULT_TIMEOUT)
                others.append(other.get_result_async())
            elif event:
                self._robot.call('inject', event)
                if event.startswith(('slider 0 ', 'pause')):
                    self._client.spin(0.3)
                    self._robot.call('inject', 'slider 1' if 'slider' in event else 'play')
            for result in (handle.get_result_async(), *others):
                response, _ = self._client.wait(result, RESULT_TIMEOUT)
                self.outcomes[ErrorCode(response.result.error_code).name] += 1
        except TimeoutError:
            self.missing += 1
        self.longest = max(self.longest, time.monotonic() - begin)
        if event not in ('', 'cancel', 'preempted'):
            self._robot.call('inject', 'slider 1')
            self._bring_back()
        elif self.outcomes[NOT_READY] > before:  # the machine was too busy for a deadline
            self._bring_back()

    def _message(self) -> FollowCartesianTrajectory.Goal:
        """Return a goal of a few points near home."""
        x, y, z = self._home.position
        points = []
        most, spread, step = (1, 0.0005, 0.03) if self._undisturbed else (3, 0.006, 0.15)
        for i in range(self._random.randint(1, most)):
            offset = [self._random.uniform(-spread, spread) for _ in range(3)]
            position = (x + offset[0], y + offset[1], z + offset[2])
            points.append(
                CartesianTrajectoryPoint(
                    pose=_message(Pose(position, self._home.quaternion)),
                    time_from_start=Duration(nanosec=round(1e9 * step) * (i + 1)),
                )
            )
        message = FollowCartesianTrajectory.Goal()
        message.trajectory.points = points
        message.validate_only = self._random.random() < 0.05
        return message

    def _bring_back(self) -> None:
        """
        Call recover until the driver takes goals.

        :raises TimeoutError: it does not within RECOVERY_TIMEOUT.
        """
        deadline = time.monotonic() + RECOVERY_TIMEOUT
        answer: Any = None
        while time.monotonic() < deadline:
            answer, _ = self._client.wait(
                self._recover.call_async(Trigger.Request()), RECOVERY_TIMEOUT
            )
            if answer.success:
                return
            self._client.spin(0.2)
        raise TimeoutError(f'the robot does not recover: {answer.message}')


def run(
    quick: bool, seconds: float = 300.0, goals: int = 10_000, undisturbed: bool = False
) -> Iterator[Figure]:
    """Soak for a time or a number of goals, whichever is reached first."""
    if quick:
        seconds = min(seconds, 20.0)
    with (
        simulator(unlock_delay=0.1) as robot,
        node(robot, max_tool_speed=1.0) as driver,
        TimedClient() as client,
    ):
        (robot_loop,) = children_of(driver)
        soak = Soak(robot, client, {'node': driver, 'robot process': robot_loop}, undisturbed)
        begin = time.monotonic()
        soak.run(seconds, goals)
        duration = time.monotonic() - begin
        same = children_of(driver) == [robot_loop]
    note = f'{duration:.0f} s; ' + ', '.join(
        f'{count} {name}' for name, count in soak.outcomes.most_common()
    )
    yield Figure(
        benchmark=NAME, name='goals that ended', value=soak.outcomes.total(), unit='', note=note
    )
    yield Figure(benchmark=NAME, name='goals without a result', value=soak.missing, unit='')
    yield Figure(
        benchmark=NAME, name='longest time from goal to result', value=soak.longest, unit='s'
    )
    yield Figure(benchmark=NAME, name='robot process replaced', value=float(not same), unit='')
    for name, samples in soak.samples.items():
        yield from _growth(name, samples)


def _growth(name: str, samples: list[tuple[float, Footprint]]) -> Iterator[Figure]:
    """Compare the last fifth of the warm time with the first fifth."""
    end = samples[-1][0]
    warm = min(WARM, end / 2.0)
    fifth = (end - warm) / 5.0
    early = [footprint for at, footprint in samples if warm <= at <= warm + fifth]
    late = [footprint for at, footprint in samples if at >= end - fifth]
    for field, unit in zip(fields(Footprint), ('MB', '', '', ''), strict=True):
        first, last = (
            percentile([getattr(footprint, field.name) for footprint in part], 50.0)
            for part in (early, late)
        )
        yield Figure(
            benchmark=NAME,
            name=f'{name}, {field.name}',
            value=last,
            unit=unit,
            baseline=first,
            than=f'{warm:.0f} s after the start',
            note='median of the last fifth',
        )
