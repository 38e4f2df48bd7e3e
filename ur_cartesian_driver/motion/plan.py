# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
A plan: primitives, the reference path of the tool, and a report of the choices.

``planning`` makes it after all checks have passed; it is immutable.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from ur_cartesian_driver.motion.execution_modes import ExecutionMode
from ur_cartesian_driver.motion.goal import Goal
from ur_cartesian_driver.motion.pose import IDENTITY, Pose
from ur_cartesian_driver.motion.primitive import Instruction, Joints, Primitive, SwitchOutput


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ReferencePath:
    """
    The planned path of the TCP in the robot's base, as samples that are joined by straight lines.

    A straight segment needs only its ends; arcs, joint moves and blends are sampled finely
    enough that the chords stay within a few micrometres of the curve. Row 0 is the start.
    """

    #: (m, 7) x y z [m], unit quaternion x y z w.
    poses: NDArray[np.float64]
    #: (m,) the index of the goal's point to which the sample belongs (the one it leads to).
    point: NDArray[np.int32]
    #: (m,) expected time from the start of the motion [s] at full speed, not decreasing.
    time: NDArray[np.float64]
    #: (m, 2) [m], [rad] how far the robot's own blend may lie beside the sample: 0 outside blends,
    #: of which UR publishes the size and not the shape. Empty = 0 everywhere.
    blend_tolerance: NDArray[np.float64] = field(default_factory=lambda: np.empty((0, 2)))

    def __post_init__(self) -> None:
        """Check the shapes and make the arrays read-only."""
        m = len(self.poses)
        if not len(self.blend_tolerance):
            object.__setattr__(self, 'blend_tolerance', np.zeros((m, 2)))
        arrays = (self.poses, self.point, self.time, self.blend_tolerance)
        if [array.shape for array in arrays] != [(m, 7), (m,), (m,), (m, 2)]:
            raise ValueError(
                'reference path shapes differ: ' + ', '.join(str(array.shape) for array in arrays)
            )
        for array in arrays:
            array.setflags(write=False)


@dataclass(frozen=True, slots=True, kw_only=True)
class PlannedSegment:
    """One primitive and what is expected of it."""

    primitive: Primitive
    #: Index of the waypoint at its end.
    waypoint: int
    #: Path length of the tool [m] and its turn [rad], from waypoint to waypoint.
    length: float
    angle: float
    #: Expected time at full speed [s].
    duration: float
    #: Joint positions predicted at its end [rad].
    joints: Joints
    #: Its line in the report; empty where another piece of the same segment has it (a SPLINE takes
    #: several pieces from point to point).
    report_line: str
    #: The outputs that follow it on the wire, in this order.
    outputs: tuple[SwitchOutput, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Plan:
    """A goal that passed all checks, ready to be executed from the state it was planned for."""

    goal: Goal
    segments: tuple[PlannedSegment, ...]
    reference: ReferencePath
    #: Joint positions of the start [rad].
    start: Joints
    #: The TCP that the robot had when it was planned.
    T_flange_active: Pose = IDENTITY
    #: The TCP that the robot has to have during the motion, and loses at its end; None = the one
    #: it has.
    T_flange_tcp: Pose | None = None
    #: Where the controlled frame is behind that TCP: elsewhere only if the TCP must not change.
    T_tcp_controlled: Pose = IDENTITY
    #: PRIMITIVES, SPLINE or SERVO: how it is carried out.
    execution: ExecutionMode = ExecutionMode.PRIMITIVES
    #: What is ignored, slowed or changed, and remarks on the whole goal.
    remarks: tuple[str, ...] = field(default=())

    @property
    def duration(self) -> float:
        """Expected time of the whole motion at full speed [s]."""
        return sum(segment.duration for segment in self.segments)

    @property
    def report(self) -> tuple[str, ...]:
        """One line for each segment, then the remarks."""
        return (
            tuple(segment.report_line for segment in self.segments if segment.report_line)
            + self.remarks
        )

    @property
    def instructions(self) -> Iterator[Instruction]:
        """The primitives and outputs, in the order of the wire."""
        for segment in self.segments:
            yield segment.primitive
            yield from segment.outputs
