# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The records of a goal on the wire, and what they are to the goal.

A goal counts points, the wire counts records, and the robot program counts the motions that it
has begun. These are three things: a spline takes several motions from point to point, an output
that is switched on the way is a record and no motion, and a first point at time 0 has no record.
"""

from __future__ import annotations

from array import array
from bisect import bisect_left

from ur_cartesian_driver.execution.goal.motion_job import MotionJob


class WireRecords:
    """What is known of each record; they are numbered from the start of the goal."""

    def __init__(self, job: MotionJob) -> None:
        """Take the records of an order."""
        self._waypoints = array('i', job.waypoint.tobytes())
        self._end_times = array('d', job.end_times.tobytes())
        self._request_times = array('d', job.request_times.tobytes())
        #: The numbers of those that are motions.
        self._motions = _motions(job, 0)
        #: How many records, and motions, are forgotten.
        self._first = self._first_motion = 0

    @property
    def total(self) -> int:
        """How many there are, and were."""
        return self._first + len(self._waypoints)

    @property
    def kept(self) -> int:
        """How many are in memory."""
        return len(self._waypoints)

    @property
    def points(self) -> int:
        """How many points the goal has."""
        return self._waypoints[-1] + 1

    def begun_records(self, motions: int) -> int:
        """Return how many records are begun when so many motions are."""
        if motions <= self._first_motion:
            return self._first
        return self._motions[self._index(motions)] + 1

    def running_waypoints(self, motions: int, lag_motions: int = 0) -> tuple[int, int] | None:
        """
        Return to which points the motion that was begun last and the one before it lead.

        :param motions: how many are begun; None is returned for 0.
        :param lag_motions: so many motions earlier is the one before it, because the arm may be
        there.
        """
        if motions <= self._first_motion:
            return None
        last = self._index(motions)
        before = last - 1 - lag_motions
        return (
            self._waypoints[self._motions[last] - self._first],
            self._waypoints[self._motions[before] - self._first] if before >= 0 else -1,
        )

    def count_before_waypoint(self, waypoint: int) -> int:
        """Return how many records stand before those of a point."""
        return self._first + bisect_left(self._waypoints, waypoint)

    def motions_before(self, record: int) -> int:
        """Return how many motions stand before a record."""
        return self._first_motion + bisect_left(self._motions, record)

    def end_time(self, records: int) -> float:
        """Return when the last one of so many is planned to end [s]."""
        return self._end_times[records - 1 - self._first] if records > 0 else 0.0

    def request_time(self, records: int) -> float:
        """Return when the robot program asks for the one behind so many [s]."""
        return self._request_times[records - 1 - self._first] if records > 0 else 0.0

    def count_until(self, time: float) -> int:
        """Return how many it takes for the last one to end at a time [s] or later."""
        return min(self.total, self._first + bisect_left(self._end_times, time) + 1)

    # ---- goals that go on ---------------------------------------------------------------------

    def append(self, job: MotionJob, records_before: int) -> None:
        """Put those of an order behind the first so many, in the place of what is there."""
        kept = records_before - self._first
        for values, new in (
            (self._waypoints, job.waypoint),
            (self._end_times, job.end_times),
            (self._request_times, job.request_times),
        ):
            del values[kept:]
            values.frombytes(new.tobytes())
        del self._motions[bisect_left(self._motions, records_before) :]
        self._motions.extend(_motions(job, records_before))

    def forget(self, records: int) -> None:
        """Forget the first so many; nobody asks for them any more."""
        gone = records - self._first
        if gone <= 0:
            return
        motions = bisect_left(self._motions, records)
        for values in (self._waypoints, self._end_times, self._request_times):
            del values[:gone]
        del self._motions[:motions]
        self._first += gone
        self._first_motion += motions

    def _index(self, motions: int) -> int:
        return min(motions - self._first_motion, len(self._motions)) - 1


def _motions(job: MotionJob, first: int) -> array[int]:
    """Return the numbers of an order's motions, its records numbered from ``first``."""
    return array('q', (job.is_motion.nonzero()[0] + first).astype('int64').tobytes())
