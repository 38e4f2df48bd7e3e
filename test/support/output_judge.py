# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The cycle in which each output of a run is due, against the tool's own way.

The judge knows positions and outputs of the simulated controller in each cycle, and nothing of
the plan. The way of the tool is the sum of its steps; a point lies on it at the nearest step. A
slow run gives the time of the path: the time at which the tool would be at each way at full speed.
In any run, an output is due when the time of the path that is left to its place falls to its lead.
A pulse is due if the way from the start of its train is a multiple of the pulse distance.

An output takes effect at the end of a cycle, so the nearest cycle is up to half a cycle beside the
time at which the output is due. The robot gets places in whole micrometres, and leads with speeds
at a few places: for a slow tool, the resulting error is more than a cycle.
"""

from collections import Counter
from dataclasses import dataclass, field
from math import cos, floor

import numpy as np
from traced_run import STEP, TracedRun

#: The slider of the slow runs, which give the time of the path.
SLOW = 0.4
#: Largest time error [cycles], or distance [m], of an output near a rest.
REST_CYCLES, REST_BOUND = 10, 1e-4
#: Distance from its place at which an output may always switch [m]: a cycle at 10 mm/s.
RESOLUTION = 2e-5
#: The same with a lead while the speed of the tool changes [m].
WIDE_BOUND = 1e-4
#: Change of the slider in some cycles that does not count.
SLIDER_RESTS = 0.005
#: Time from the program's decision on an output to its effect [cycles].
DECIDED = 2.0
#: Time for which a resumed program waits until the arm moves [cycles].
GOING_ON = 8

SLIDERS = {
    'full': lambda cycle: 1.0,
    'low': lambda cycle: 0.1,
    'changing': lambda cycle: 0.55 + 0.45 * cos(cycle / 120.0),
    'steps': lambda cycle: (1.0, 0.2, 0.6)[cycle // 130 % 3],
}


class JudgedRun(TracedRun):
    """One run of a goal, and the places of its outputs and pulses on the tool's way."""

    #: Largest rate of the time of the path: no slider makes the tool faster.
    max_rate = 1.0
    #: Largest difference of the tool's way from the planned way [m]: a pulse that is nearer to the
    #: last point may come or not.
    rounding = 1e-5

    def place(self, wanted):
        """Return the way to the place of a command."""
        here = self.way_of(wanted.waypoint)
        if wanted.fraction:
            other = wanted.waypoint + (1 if wanted.fraction > 0.0 else -1)
            return here + abs(wanted.fraction) * (self.way_of(other) - here)
        return here + wanted.distance

    def places(self, train, given=0):
        """
        Return the ways to the pulses of a train (count,).

        :param given: the number of given pulses: pulses next to the last point may not come.
        """
        first = self.way_of(train.first_waypoint) + train.phase
        length = self.way_of(train.last_waypoint) - first
        fewest, most = (
            floor((length + sign * self.rounding) / train.distance) + 1 for sign in (-1, 1)
        )
        count = train.count or min(max(given, fewest), most)
        return np.minimum(first + train.distance * np.arange(count), self.ways[-1])

    def cycles(self, pin, rises):
        """Return the cycles in which an output rises, or falls (n,)."""
        return np.array([k for number, up, k in self.edges if (number, up) == (pin, rises)])


class PathTime:
    """The time of the path at full speed, from a run with a low slider for more resolution."""

    def __init__(self, slow):
        ways, first = np.unique(slow.ways, return_index=True)
        # Rests do not count as time of the path.
        moving = np.append(0.0, np.cumsum(np.diff(slow.ways) > 0.0))
        self._ways, self._times = ways, SLOW * STEP * moving[first]

    def __call__(self, ways):
        return np.interp(ways, self._ways, self._times)

    def is_near_rest(self, way):
        """Return whether the tool is so slow there that its way hardly grows."""
        k, speeds = int(np.searchsorted(self._ways, way)), np.diff(self._ways)
        return speeds[max(k - 3, 0) : k + 2].min() < 0.2 * np.median(speeds)

    def changes_between(self, begin, end):
        """Return whether the speed of the tool changes on a part of its way."""
        first, last = (int(np.searchsorted(self._ways, way)) for way in (begin, end))
        speeds = np.diff(self._ways)[first:last]
        return bool(speeds.min(initial=np.inf) < 0.95 * speeds.max(initial=0.0))


@dataclass
class Verdict:
    """The delays of outputs or pulses, and the ones that were too late or too early."""

    #: Delays [cycles], negative = early; not near a rest, where the way tells little of time.
    late: list = field(default_factory=list)
    #: Distances of the tool behind their places at that time [m].
    off: list = field(default_factory=list)
    #: Delays of the ones that were due while the program was paused [cycles].
    delayed: list = field(default_factory=list)
    misses: dict = field(default_factory=dict)


def judge_commands(run, path_time, bound, pauses=()):
    """
    Judge the edges of the commands of a run.

    The bound is wider near a rest, where the speed tells little of the slider and the tool makes
    little way. For an output with a lead it is also wider while the slider moves, and while the
    speed of the tool changes, which may take less time than the pieces in which the robot gets the
    lead. Outputs that are due in a pause, in which the tool coasts on, come after the pause.

    :param pauses: for each pause, the cycles in which the program is paused, and goes on.
    """
    verdict, wanted_pins = Verdict(), Counter(wanted.pin for wanted in run.goal.io_commands)
    assert Counter(pin for pin, *_ in run.edges if pin in wanted_pins) == wanted_pins
    at = {pin: cycle for pin, _, cycle in run.edges}
    times = path_time(run.ways)
    # If the tool nearly rests, its way tells little of the time.
    rate = np.minimum(np.diff(times, prepend=0.0) / STEP, run.max_rate)
    for wanted in run.goal.io_commands:
        place, edge = run.place(wanted), at[wanted.pin]
        left = path_time(place) - times
        # A decision of the program is carried out a cycle later. In the meantime the slider may
        # begin or cease to move.
        before = np.roll(rate, 2)
        seen = rate, np.roll(rate, 1), before, 3.0 * before - 2.0 * np.roll(rate, 3)
        lead = max(-wanted.offset, 0.0)
        dues = [_due(left, rate, lead * each, edge) for each in seen]
        due = min((each for pair in dues for each in pair), key=lambda each: abs(edge - each))
        late = edge - due
        paused = [end for begin, end in pauses if begin - 1 <= due <= end + GOING_ON]
        if paused:
            # A lead that coasting shortens to nothing may be due again, up to the place itself.
            reached = int(np.searchsorted(run.ways, place))
            verdict.delayed.append(late)
            if not (late > -bound and edge <= max(paused[0] + GOING_ON, reached + bound)):
                verdict.misses[wanted.pin] = round(float(late), 2)
            continue
        off = run.ways[edge] - np.interp(due, np.arange(len(run.ways)), run.ways)
        slow = path_time.is_near_rest(place) or path_time.is_near_rest(run.ways[int(due)])
        if not slow:
            verdict.late.append(late)
            verdict.off.append(off)
        near = slow and (abs(late) < REST_CYCLES or abs(off) < REST_BOUND)
        is_wide = wanted.offset < 0.0 and (
            path_time.changes_between(run.ways[edge], place)
            or np.ptp(rate[max(edge - 6, 0) : edge + 1]) > SLIDER_RESTS
        )
        within = WIDE_BOUND if is_wide else RESOLUTION
        is_far = abs(off) > within or (is_wide and abs(late) > REST_CYCLES)
        if abs(late) > bound + 2.0 * is_wide and not near and is_far and abs(off) > RESOLUTION:
            verdict.misses[wanted.pin] = round(float(late), 2)
    return verdict


def _due(left, rate, lead, edge):
    """
    Return two times at which an output may have been due [cycles].

    The first one is the first time at which it was due. While the slider is lowered, the time that
    is left may fall a little below the lead and then exceed it again. So the second one is before
    the edge by the longest time for which the output was ever overdue, or, if the output was not
    due at the edge, behind the edge by the time that was missing there.

    :param left: time of the path to its place by cycle [s].
    :param rate: the rate at which this time passes.
    :param lead: the lead in time of the path by cycle [s].
    :param edge: the cycle in which the output switched.
    """
    overdue = lead - left
    passes = (rate > 0.0) | (left <= 0.0)
    k = int(np.flatnonzero((overdue >= 0.0) & passes)[0])
    first = k - overdue[k] / max(overdue[k] - overdue[k - 1], 1e-12)
    late = overdue[: edge + 1] / np.where(rate[: edge + 1] > 0.0, rate[: edge + 1], 1.0) / STEP
    most = late[passes[: edge + 1]].max()
    return first, edge - float(most if late[-1] > -DECIDED else late[-1])


def _lost(run, pauses):
    """Return, by cycle (n,), the excess of the ways coasted in pauses over their chords [m]."""
    lost = np.zeros(len(run.ways))
    for begin, end in pauses:
        if end < len(lost):
            chord = np.linalg.norm(run.positions[end] - run.positions[begin - 1])
            lost[begin:] += run.ways[end] - run.ways[begin - 1] - chord
    return lost


def judge_pulses(run, train, bound, pauses=()):
    """
    Judge the pulses of a train: their number, the cycle of each, and the widths.

    Near a rest, where the tool is slow, the distance from the place counts. The pulses of the way
    that the tool coasts in a pause come after the pause, as fast as their width allows; the
    program knows only the chord of this way.
    """
    verdict = Verdict()
    counted = run.ways - _lost(run, pauses)
    rises, width = run.cycles(train.pin, rises=True), max(round(train.width / STEP), 1)
    places = run.places(train, len(rises))
    assert len(rises) == len(places), (len(rises), len(places))
    assert set(run.cycles(train.pin, rises=False) - rises) <= {width} or pauses
    ways, first = np.unique(counted, return_index=True)
    # Near a rest the tool is at a place for many cycles: the nearest of them counts.
    last = np.append(first[1:] - 1, len(counted) - 1)
    due = np.interp(places, ways, first)
    until = np.maximum(due, np.interp(places - 2e-6, ways, last))
    steps = np.diff(run.ways, prepend=0.0)
    waits = -np.inf
    for place, rise, begin, end in zip(places, rises, due, until, strict=True):
        late = rise - np.clip(rise, begin, end)
        paused = [play for stop, play in pauses if stop - 1 <= begin <= play + GOING_ON]
        if paused or begin < waits - 0.5:
            verdict.delayed.append(late)
            latest = max(begin, waits, *(play + GOING_ON for play in paused))
            is_timely = begin - bound < rise < latest + bound
            if not is_timely and abs(counted[rise] - place) > RESOLUTION:
                verdict.misses[round(float(place), 5)] = round(float(late), 2)
            waits = rise + width + 1
            continue
        waits = -np.inf
        off = counted[rise] - place
        near_rest = steps[rise] < 0.2 * np.median(steps[rises])
        if not near_rest:
            verdict.late.append(late)
            verdict.off.append(off)
        if abs(late) > bound and abs(off) > (REST_BOUND if near_rest else RESOLUTION):
            verdict.misses[round(float(place), 5)] = round(float(late), 2)
    return verdict
