# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The records of a goal on the wire, and the points that they belong to.

A goal numbers points, the wire numbers records, and the robot program counts the motions that it
has begun. The numbers differ: a spline has several motions between two points, an output that is
switched during a motion is a record but no motion, and a first point at time 0 has no record.
"""

from __future__ import annotations

from array import array
from bisect import bisect_left

from ur_cartesian_driver.execution.goal.motion_job import MotionJob


class WireRecords:
    """Waypoint and times of each record, numbered from the start of the goal."""

    def __init__(self, job: MotionJob) -> None:
        """Begin with the records of a job."""
        self._waypoints = array('i', job.waypoint.tobytes())
        self._end_times = array('d', job.end_times.tobytes())
        self._request_times = array('d', job.request_times.tobytes())
        #: The numbers of the records that are motions.
        self._motions = _motions(job, 0)
        #: Number of forgotten records; number of motions among them.
        self._first = self._first_motion = 0

    @property
    def total(self) -> int:
        """Number of records of the goal so far, including the forgotten ones."""
        return self._first + len(self._waypoints)

    @property
    def kept(self) -> int:
        """Number of records in memory."""
        return len(self._waypoints)

    @property
    def points(self) -> int:
        """Number of points of the goal."""
        return self._waypoints[-1] + 1

    def begun_records(self, motions: int) -> int:
        """Return the number of begun records once ``motions`` motions have begun."""
        if motions <= self._first_motion:
            return self._first
        return self._motions[self._index(motions)] + 1

    def running_waypoints(self, motions: int, lag_motions: int = 0) -> tuple[int, int] | None:
        """
        Return the points to which the newest begun motion and an earlier motion lead.

        :param motions: number of begun motions; for 0 the result is None.
        :param lag_motions: largest lag of the controller's target, in motions: the earlier motion
            comes ``1 + lag_motions`` before the newest. If there is none, its point is -1.
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
        """Return the number of records before the first record of a point."""
        return self._first + bisect_left(self._waypoints, waypoint)

    def motions_before(self, record: int) -> int:
        """Return the number of motions before a record."""
        return self._first_motion + bisect_left(self._motions, record) if record else 0

    def end_time(self, records: int) -> float:
        """Return the planned end of the first ``records`` records [s]."""
        return self._end_times[records - 1 - self._first] if records > 0 else 0.0

    def request_time(self, records: int) -> float:
        """Return the time of the request for the record after the first ``records`` [s]."""
        return self._request_times[records - 1 - self._first] if records > 0 else 0.0

    def count_until(self, time: float) -> int:
        """Return the number of records up to and including the one that runs at a time [s]."""
        return min(self.total, self._first + bisect_left(self._end_times, time) + 1)

    # ---- open goals ---------------------------------------------------------------------------

    def append(self, job: MotionJob, records_before: int) -> None:
        """Put a job's records after the first ``records_before``, in place of any later ones."""
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
        """Forget the first ``records`` records, which are no longer needed."""
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
    """Return the record numbers of a job's motions; its first record has the number ``first``."""
    return array('q', (job.is_motion.nonzero()[0] + first).astype('int64').tobytes())
