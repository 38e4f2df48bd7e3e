# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The rest of a running motion's path, and the changes of the cell along it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from math import inf
import threading
from typing import TypeAlias

from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.motion.events import Outcome, Progress
from ur_cartesian_driver.motion.geometry.pose import Pose
from ur_cartesian_driver.motion.geometry.vectors import Joints
from ur_cartesian_driver.motion.goal.goal import PartChange
from ur_cartesian_driver.motion.plan.joint_spline import JointSpline
from ur_cartesian_driver.motion.plan.plan import Plan
from ur_cartesian_driver.planning import PlanningOptions
from ur_cartesian_driver.planning.preflight.path_left import joints_at, PathLeft, spline_of
from ur_cartesian_driver.planning.request.point_events.goal_rest import NO_FRACTION

#: Takes a change of the cell, with the joints at its point [rad] and the active TCP.
TakePartChange: TypeAlias = Callable[[PartChange, Joints, Pose], None]


class RunningPath:
    """The planned path of a motion, part after part; thread-safe."""

    def __init__(
        self, plan: Plan, spline: JointSpline | None, take_part_change: TakePartChange
    ) -> None:
        """
        Begin at the start of a plan.

        :param spline: the joints over time of a goal in SERVO; None = the goal has another mode.
        :param take_part_change: called at each point at which the cell changes.
        """
        self._start, self._take_part_change = plan.start, take_part_change
        self._T_flange_active = plan.T_flange_active
        #: Guards the attributes below. Reentrant, because the cell is changed while the lock is
        #: held, and a listener of the cell may append points in its callback.
        self._lock = threading.RLock()
        self._paths = [PathLeft.of(plan, spline or spline_of(plan))]
        #: The pending changes, each with the joints at its point [rad].
        self._part_changes = [
            (change, joints_at(plan, change.waypoint))
            for change in sorted(plan.goal.part_changes, key=lambda each: each.waypoint)
        ]
        #: The newest progress; None before the first report.
        self._progress: Progress | None = None

    def report(self, progress: Progress) -> None:
        """Keep a progress report, and change the cell at the points that the arm has left."""
        with self._lock:
            self._progress = progress
            self._pass_points(float(progress.waypoint))

    def end(self, outcome: Outcome) -> None:
        """Change the cell at the points that the arm had left when the motion ended."""
        if outcome.succeeded:
            self._pass_points(inf)
        elif outcome.stopped is not None:
            self._pass_points(outcome.stopped.point + outcome.stopped.fraction - NO_FRACTION)
        with self._lock:
            self._paths = []  # frees their rows, even if the user keeps the handle

    def _pass_points(self, place: float) -> None:
        """
        Change the cell at the points that the arm has left.

        :param place: where the arm is: ``k + u`` is the fraction u of the segment to point k.
        """
        if not self._part_changes:
            return
        with self._lock:
            passed = [each for each in self._part_changes if each[0].waypoint + 1.0 <= place]
            del self._part_changes[: len(passed)]
            for change, q in passed:
                self._take_part_change(change, q, self._T_flange_active)

    def append(self, plan: Plan, start_time: float, spline: JointSpline | None) -> None:
        """
        Add the plan of appended points.

        :param start_time: time from which it replaces the earlier plan [s].
        """
        now = 0.0 if self._progress is None else self._progress.time
        with self._lock:
            paths = [replace(path, until=min(path.until, start_time)) for path in self._paths]
            self._paths = [path for path in paths if path.end > now]
            self._paths.append(PathLeft.of(plan, spline))

    def check(self, arm: Arm, options_now: Callable[[], PlanningOptions]) -> None:
        """
        Check the rest of the path in the present cell.

        :param options_now: returns the options, whose cell does not have the pending changes.
        :raises GoalRefused: the path would touch a body, or its joints are unknown.
        """
        with self._lock:
            progress, time, q = self._progress, 0.0, self._start
            if progress is not None:
                time, q = progress.time, progress.desired_q
            paths, changes = list(self._paths), [change for change, _ in self._part_changes]
            options = options_now()
        for path in paths:  # a path that changes the cell is the only one
            q = path.check(arm, options, q, changes, time)
            time = max(time, path.end)
