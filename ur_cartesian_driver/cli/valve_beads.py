# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Two beads side by side, at two speeds, and the dead times of the valve that laid them.

The output switches at the same two places of both beads. At the speed v, a valve with the dead
times ``open`` and ``close`` begins a bead ``v * open`` past the first place, and ends it
``v * close`` past the second. So the fast bead begins ``(fast - slow) * open`` past the beginning
of the slow one, and ends ``(fast - slow) * close`` past its end. Only these two distances have to
be measured: the places and the offset of the nozzle cancel out. The lengths of the beads do not
suffice, because they show only the difference of the dead times: they differ by
``(fast - slow) * (close - open)``.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import hypot, isfinite, sqrt

from ur_cartesian_driver.motion.geometry.pose import Pose
from ur_cartesian_driver.motion.goal.goal import MAX_OUTPUT_LEAD
from ur_cartesian_driver.path import mm, Output, Path

#: Acceleration of the beads, and speed between them [m/s^2], [m/s].
ACCELERATION, TRAVEL_SPEED = 1.0, 0.05
#: Distance at constant speed before and after a bead; height above it on the way to the next [m].
RUN, LIFT = mm(10), mm(20)
#: Corner deviation at the ends of a bead, with which the arm passes them at full speed [m]. On a
#: straight line it causes no deviation. A blend would slow the arm down.
PASSING = mm(0.1)
#: Direction of a bead and of the second one beside it, by name: axes of the tool.
DIRECTIONS = {
    'x': ((1, 0), (0, 1)),
    '-x': ((-1, 0), (0, 1)),
    'y': ((0, 1), (1, 0)),
    '-y': ((0, -1), (1, 0)),
}
#: The points of the path to which the beads lead.
BEAD_POINTS = (1, 8)
#: Shortest time of a bead [s], so that the speed of the arm, reported each 40 ms, is known in it.
SHORTEST = 0.08
#: A dead time this many standard uncertainties below 0 is a mistake of the measurement.
_MAX_NEGATIVE = 3.0
#: A ruler shows no distance below its uncertainty divided by this; a smaller distance was given
#: in a wrong unit.
_FINEST = 4.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Beads:
    """
    The two beads.

    :raises ValueError: the speeds are too close to each other, or a bead is too short, in its
        length or its time.
    """

    #: Speeds [m/s].
    slow: float
    fast: float
    #: Distance between the places at which the output switches, and between the beads [m].
    length: float
    beside: float
    #: A key of :data:`DIRECTIONS`.
    along: str

    def __post_init__(self) -> None:
        """Check speeds and length."""
        if self.fast < 2.0 * self.slow:
            raise ValueError(
                f'--fast is {self.fast:g} m/s and --slow {self.slow:g} m/s; lay one bead at least '
                'twice as fast as the other'
            )
        if self.length < 2.0 * RUN:
            raise ValueError(f'--length is {1e3 * self.length:g} mm; lay beads of 20 mm or more')
        if self.length < SHORTEST * self.fast:
            raise ValueError(
                f'--length is {1e3 * self.length:g} mm, which --fast passes in '
                f'{1e3 * self.length / self.fast:.0f} ms; lay beads that take '
                f'{1e3 * SHORTEST:g} ms or more'
            )

    @property
    def run(self) -> float:
        """The distance to gain speed before a bead, and to lose it after the bead [m]."""
        return self.fast**2 / (2.0 * ACCELERATION) + RUN

    @property
    def span(self) -> float:
        """The length of the whole motion [m]."""
        return self.length + 2.0 * self.run

    def path(self, start: Pose, valve: Output) -> Path:
        """
        Return the path of both beads, which begins with the run-up to the slow one.

        :param start: the pose of the tool, with its nozzle as high above the work as for a bead.
        """
        path = Path(start).safe(valve, False)
        path = self._bead(path, self.slow, valve).at(speed=TRAVEL_SPEED)
        across = [self.beside * part for part in DIRECTIONS[self.along][1]]
        path = path.by(dz=-LIFT, of_tool=True).by(*self._ahead(-self.span), of_tool=True)
        path = path.by(*across, of_tool=True).by(dz=LIFT, of_tool=True)
        return self._bead(path, self.fast, valve).by(dz=-LIFT, of_tool=True, speed=TRAVEL_SPEED)

    def _bead(self, path: Path, speed: float, valve: Output) -> Path:
        return (
            path.at(speed=speed, acceleration=ACCELERATION)
            .by(*self._ahead(self.run), of_tool=True, corner_deviation=PASSING)
            .set(valve, True)
            .by(*self._ahead(self.length), of_tool=True, corner_deviation=PASSING)
            .set(valve, False)
            .by(*self._ahead(self.run), of_tool=True)
        )

    def _ahead(self, distance: float) -> list[float]:
        return [distance * part for part in DIRECTIONS[self.along][0]]


@dataclass(frozen=True, slots=True, kw_only=True)
class DeadTimes:
    """The dead times of a valve [s]; the standard uncertainty belongs to each of them."""

    open: float
    close: float
    uncertainty: float


def dead_times(
    begins: float, ends: float, *, slow: float, fast: float, reading: float, cycle: float
) -> DeadTimes:
    """
    Return the dead times that two beads show.

    Each distance is the difference of two readings. In addition, each output switches up to half a
    cycle before or after its place. This deviation has a uniform distribution, whose standard
    deviation is ``cycle / sqrt(12)``.

    :param begins: distance by which the fast bead begins past the beginning of the slow one [m];
        ``ends``: distance by which it ends past the end of the slow one [m].
    :param slow: speed of the slow bead [m/s]; ``fast``: of the fast one.
    :param reading: standard uncertainty of one reading of the ruler [m].
    :param cycle: the cycle time of the controller [s].
    :raises ValueError: the fast bead begins or ends before the slow one, or too far past it, or a
        distance is not finite, or smaller than the ruler shows.
    """
    difference = fast - slow
    switching = cycle / sqrt(12.0) * hypot(slow, fast)
    uncertainty = hypot(sqrt(2.0) * reading, switching) / difference
    times = []
    for verb, shift in (('begins', begins), ('ends', ends)):
        if not isfinite(shift):
            raise ValueError(f'how far the fast bead {verb} behind is {shift}; give a number')
        if 0.0 < abs(shift) < reading / _FINEST:
            raise ValueError(
                f'the fast bead {verb} {1e3 * shift:.3g} mm behind the slow one, which a ruler '
                f'with the uncertainty of {1e3 * reading:g} mm does not show; give --measured in '
                'millimetres, or the --ruler that was used'
            )
        time = shift / difference
        if time < -_MAX_NEGATIVE * uncertainty:
            raise ValueError(
                f'the fast bead {verb} {1e3 * abs(shift):.3g} mm before the slow one, although a '
                'valve can only be late; measure from the slow bead to the fast one, positive in '
                'the direction of the motion'
            )
        if time > MAX_OUTPUT_LEAD:
            raise ValueError(
                f'the fast bead {verb} {1e3 * shift:.3g} mm behind the slow one, which is a dead '
                f'time of {time:.3g} s, above {MAX_OUTPUT_LEAD:g} s; give --measured in '
                'millimetres, and --slow and --fast as the beads had them'
            )
        times.append(max(time, 0.0))
    return DeadTimes(open=times[0], close=times[1], uncertainty=uncertainty)
