# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The points of a program, with the outputs and waits at them."""

from __future__ import annotations

from collections.abc import Generator
from dataclasses import dataclass, replace

from ur_cartesian_driver.importing.imported_path import (
    BrokenFile,
    JOINTS_HAVE_NO_FRAME,
    PathCollector,
)
from ur_cartesian_driver.importing.script.arm_place import ArmPlace
from ur_cartesian_driver.importing.script.running_script import MAIN, RunningScript
from ur_cartesian_driver.kinematics.robot_models import JOINT_NAMES
from ur_cartesian_driver.motion.geometry.pose import Pose
from ur_cartesian_driver.motion.geometry.vectors import Vector6
from ur_cartesian_driver.motion.goal.goal import (
    ArcMode,
    InputWait,
    IOCommand,
    MAX_OUTPUT_OFFSET,
    MAX_STOP_TIME,
    Posture,
    SegmentType,
)
from ur_cartesian_driver.urscript import RuntimeException

#: The generator of a URScript function that takes a controller cycle.
Steps = Generator[None, None, None]

#: Offset [s] of the outputs after a wait: without an offset they would switch before the wait.
AFTER_WAIT = 0.01


@dataclass(slots=True, kw_only=True)
class CollectedPoint:
    """A point, which later calls can still turn into a stop."""

    kind: SegmentType
    #: The pose of the active TCP; None = the joints give the pose.
    pose: Pose | None
    joints: Vector6 | None = None
    acceleration: float
    speed: float
    blend: float
    via: Pose | None = None
    arc_mode: ArcMode = ArcMode.UNCONSTRAINED
    line: int = 0
    dwell: float = 0.0
    waits: bool = False
    #: Whether an output is switched some time after the arm's arrival.
    delays: bool = False


class CollectedEvents:
    """Points, outputs and waits in the program's order; one thread moves the arm at a time."""

    def __init__(self, run: RunningScript, place: ArmPlace) -> None:
        """Begin without points."""
        self.run, self.place = run, place
        #: The newest point.
        self.last: CollectedPoint | None = None
        self._events: list[CollectedPoint | IOCommand | InputWait] = []
        #: The TCP of the points without joint positions; None = there is no such point yet.
        self._tcp: Pose | None = None
        #: The thread that moved the arm last.
        self._mover = MAIN
        #: The thread that is in a motion call; None = no thread is.
        self._moving: int | None = None

    def __len__(self) -> int:
        """Return the number of points, outputs and waits."""
        return len(self._events)

    @property
    def acts(self) -> bool:
        """Whether the running thread moved the arm last, or is main and the last mover ended."""
        thread = self.run.thread
        return thread == self._mover or (thread == MAIN and not self.run.lives(self._mover))

    @property
    def is_mover(self) -> bool:
        """Whether the running thread moved the arm last."""
        return self.last is not None and self.run.thread == self._mover

    def take(self) -> None:
        """
        Begin a motion call of the running thread.

        :raises RuntimeException: another thread is in a motion call.
        """
        if self._moving not in (None, self.run.thread):
            raise RuntimeException('another thread is already controlling the robot')
        self._moving = self._mover = self.run.thread

    def moved(self) -> Steps:
        """Spend one cycle on a motion call, then end the call."""
        try:
            yield
        finally:
            self._moving = None

    def add(self, point: CollectedPoint) -> None:
        """
        Add a point.

        :raises RuntimeException: the point has no joint positions, and earlier points without
            joint positions have another TCP.
        """
        if point.joints is None:
            if self._tcp not in (None, self.place.tcp):
                raise RuntimeException(
                    'the move is of another TCP than the lines before it, and a goal moves one; '
                    'split the program at its set_tcp'
                )
            self._tcp = self.place.tcp
        self.last, point.line = point, self.run.line
        self._events.append(point)

    def stop(self) -> None:
        """Make the arm stop at the last point."""
        if self.last is not None and self.last.blend > 0.0:
            self.run.say('a blend', f'the arm stops at the point of line {self.last.line}')
            self.last.blend = 0.0

    def rest(self, time: float) -> None:
        """
        Make the arm rest at the last point for a time [s].

        :raises RuntimeException: the arm would rest for longer than a goal allows.
        """
        if self.last is None:
            self.run.say('sleep()', 'a goal begins with a move')
        elif time > 0.0:
            self.stop()
            self.last.dwell += time
            if self.last.dwell > MAX_STOP_TIME:
                raise RuntimeException(
                    f'the arm rests for {self.last.dwell:g} s, and a goal rests at most '
                    f'{MAX_STOP_TIME:g} s at a point; split the program here'
                )

    def wait(self, wait: InputWait) -> None:
        """
        Wait for an input at the last point.

        :raises RuntimeException: the same point already has a wait or a delayed output.
        """
        point = self.last
        if point is None:
            self.run.say('a wait for an input', 'a goal begins with a move')
            return
        if point.waits or point.delays:
            what = 'a second wait' if point.waits else 'a wait behind sleep() and an output'
            raise RuntimeException(f'a goal has no place for {what} at one point; split it here')
        if point.dwell > 0.0:
            self.run.say('sleep() before a wait', 'a goal rests after it')
        self.run.say('a wait for an input', f'without it the goal ends after {wait.timeout:g} s')
        self.stop()
        point.waits = True
        self._events.append(wait)

    def switch(self, output: IOCommand) -> None:
        """
        Switch an output at the last point, after the rest and the waits there.

        :raises RuntimeException: the rest is longer than the largest delay of an output.
        """
        if not self.acts:
            self.run.say(
                'an output', 'when a thread switches it beside the moves is not in the file'
            )
            return
        offset = 0.0
        if self.last is None:
            self.run.say('an output before the first move', 'it is switched at the first point')
        else:
            offset = self.last.dwell or (AFTER_WAIT if self.last.waits else 0.0)
            if offset > MAX_OUTPUT_OFFSET:
                raise RuntimeException(
                    f'an output is switched {offset:g} s after the arm has come to a point, in a '
                    f'goal at most {MAX_OUTPUT_OFFSET:g} s; split the program here'
                )
            self.last.delays |= offset > 0.0
        self._events.append(replace(output, offset=offset))

    def hand_over(self, into: PathCollector) -> None:
        """
        Add all events to a path; joint positions become poses of the other points' TCP.

        :raises BrokenFile: options move the path, and a point has joint positions of the file.
        """
        tcp = self.place.tcp if self._tcp is None else self._tcp
        if (found := self.place.set_tcps.get(tcp)) is not None:
            line, pose = found
            why = 'the goal is of this TCP; the robot has to have it too'
            into.remarks.add(line, f'set_tcp({pose})', why)
        for event in self._events:
            if isinstance(event, IOCommand):
                into.switch(event)
            elif isinstance(event, InputWait):
                into.wait(event)
            else:
                self._add_point(event, tcp, into)

    def _add_point(self, point: CollectedPoint, tcp: Pose, into: PathCollector) -> None:
        pose = point.pose
        if point.joints is not None:
            pose = self.place.forward(point.joints, tcp)
            if point.joints not in self.place.solutions:
                if self.place.moves_path:
                    raise BrokenFile(point.line, JOINTS_HAVE_NO_FRAME)
                into.remarks.add(point.line, 'joint positions', self.place.of_arm(tcp))
        assert pose is not None
        into.add(
            point.line,
            pose.position,
            point.kind,
            quaternion=pose.quaternion,
            via=None if point.via is None else point.via.position,
            arc_mode=point.arc_mode,
            posture=point.joints and Posture(names=JOINT_NAMES, values=point.joints),
            speed=point.speed,
            acceleration=point.acceleration,
            blend=point.blend,
            dwell=point.dwell or None,
        )
