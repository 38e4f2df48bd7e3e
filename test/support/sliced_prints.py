# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Imitations of the programs of slicers and a dispenser's CAM: G-code of thousands of short moves.

Each print keeps the places, speeds and switches that it writes, so that a test needs no importer
to know them. The prints are made from a fixed seed, and are the same in every run.
"""

from dataclasses import dataclass, field
from math import atan2, cos, hypot, pi, sin

import numpy as np

SEED = 7
#: Chords of arcs [mm], at most 0.4 um beside an arc of 5 mm.
CHORD = 0.12


@dataclass
class Print:
    """A program, and its contents."""

    lines: list = field(default_factory=list)
    #: Places on the curve [mm], and the speed [mm/s] at which each is approached.
    places: list = field(default_factory=list)
    speeds: list = field(default_factory=list)
    #: The index of the place at which an output switches, and its value.
    switches: list = field(default_factory=list)
    _speed: float = 0.0

    @property
    def text(self):
        return '\n'.join(self.lines) + '\n'

    @property
    def moves(self):
        return sum(line.startswith(('G1 ', 'G2 ', 'G3 ')) for line in self.lines)

    @property
    def curve(self):
        """The places (n, 3) [mm]."""
        return np.array(self.places)

    def say(self, *lines):
        self.lines += lines

    def line(self, x, y, z=None, speed=None, extruded=''):
        """Go straight to a place [mm], rounded to the three digits of the program."""
        old = self.places[-1] if self.places else (0.0, 0.0, 0.0)
        place = (round(x, 3), round(y, 3), old[2] if z is None else round(z, 3))
        rise = '' if place[2] == old[2] else f' Z{place[2]:.3f}'
        self.say(f'G1 X{place[0]:.3f} Y{place[1]:.3f}{rise}{extruded}{self._feed(speed)}')
        self._add(place)

    def arc(self, x, y, i, j, sense, extruded=''):
        """Go to a place on an arc about the centre beside the present one; sense 1 = G3."""
        old = self.places[-1]
        centre = old[0] + i, old[1] + j
        self.say(f'G{3 if sense > 0 else 2} X{x:.3f} Y{y:.3f} I{i:.3f} J{j:.3f}{extruded}')
        first = atan2(-j, -i)
        sweep = sense * (atan2(y - centre[1], x - centre[0]) - first) % (2.0 * pi)
        # Rounded to 1 um, the radii at both ends differ a little.
        begin, end = hypot(i, j), hypot(x - centre[0], y - centre[1])
        count = 2 + int(sweep * begin / CHORD)
        for u in np.linspace(0.0, 1.0, count)[1:]:
            angle, radius = first + sense * sweep * u, begin + u * (end - begin)
            turned = centre[0] + radius * cos(angle), centre[1] + radius * sin(angle), old[2]
            self._add(turned)

    def switch(self, code, value):
        self.say(code)
        self.switches.append((len(self.places) - 1, value))

    def _feed(self, speed):
        if speed is None or speed == self._speed:
            return ''
        self._speed = speed
        return f' F{60.0 * speed:g}'

    def _add(self, place):
        self.places.append(place)
        self.speeds.append(self._speed)


def _begun(*header):
    """Return the random generator of a print, and the print with its first lines."""
    made = Print()
    made.say(*header)
    return np.random.default_rng(SEED), made


def vase():
    """Return a vase in one rising spiral of lines of 0.1 to 0.5 mm; the fan is output 0."""
    rng, made = _begun(
        '; an imitation of a vase in spiral mode, as PrusaSlicer 2.7 writes it',
        *('G21', 'G90', 'M83', ';LAYER_CHANGE', ';TYPE:External perimeter'),
    )
    angle = 0.0
    made.line(26.0, 0.0, 0.3, speed=40.0)
    for k in range(1400):
        length = rng.uniform(0.1, 0.5)
        angle += length / 26.0
        radius = 26.0 + 0.4 * sin(3.0 * angle)
        z = 0.3 + 0.3 * angle / (2.0 * pi)
        extruded = f' E{0.033 * length:.5f}'
        made.line(radius * cos(angle), radius * sin(angle), z, extruded=extruded)
        if k == 500:
            made.switch('M106 S255', True)
    made.switch('M107', False)
    made.line(40.0, 0.0, made.places[-1][2])
    made.say('M84')
    return made


def part():
    """Return layers of two perimeters with arcs, and infill in lines; a valve is output 0."""
    rng, made = _begun(
        '; an imitation of a part with arcs, as OrcaSlicer 2.1 writes it with a paste extruder',
        *('G21', 'G90', 'M83'),
    )
    made.line(-12.0, -9.0, 0.4, speed=60.0)
    for layer in range(18):
        z = 0.4 + 0.3 * layer
        made.say(';LAYER_CHANGE', f';Z:{z:.2f}', ';TYPE:Outer wall')
        for gap in (0.0, 0.45):
            _wall(made, 8.0 - gap, 3.5 - gap, 1.2, z)
        made.say(';TYPE:Sparse infill')
        _infill(made, 7.0, 2.5, 0.7 + 0.1 * rng.random())
    made.line(-12.0, -9.0, speed=60.0)
    made.say('M84')
    return made


def _wall(made, width, height, radius, z):
    """Add a rectangle with round corners, by half its width and half its height [mm]."""
    across, along = width - radius, height - radius
    made.line(-across, -height, z, speed=60.0)
    made.switch('M3', True)
    for x, y in ((1, -1), (1, 1), (-1, 1), (-1, -1)):
        # The side that ends at this corner, then the corner.
        level = (x * across, y * height), (0.0, -y * radius)
        upright = (x * width, y * along), (-x * radius, 0.0)
        (begin, centre), (end, _) = (level, upright) if x * y < 0 else (upright, level)
        made.line(*begin, speed=30.0, extruded=' E0.1')
        made.arc(*(round(value, 3) for value in (*end, *centre)), 1, extruded=' E0.05')
    made.switch('M5', False)


def _infill(made, width, height, spacing):
    """Add parallel lines from side to side of a rectangle."""
    x, side = -width, -1
    while x <= width:
        begun = x > -width
        made.line(x, side * height, speed=30.0 if begun else 60.0, extruded=' E0.02' * begun)
        if not begun:
            made.switch('M3', True)
        made.line(x, -side * height, speed=30.0, extruded=' E0.2')
        x, side = x + spacing, -side
    made.switch('M5', False)


def bead():
    """Return beads of sealant around rows of holes, with G64 P in the file; glue is output 0."""
    rng, made = _begun(
        '( an imitation of a gluing job, as FreeCAD writes it for LinuxCNC )',
        *('G17 G21 G90', 'G64 P0.2'),
    )
    made.line(-5.0, -5.0, 2.0, speed=80.0)
    for row in range(9):
        y = 8.0 * row
        made.line(0.0, y, 2.0, speed=80.0)
        made.line(0.0, y, 0.5)
        made.switch('M3', True)
        x, side = 0.0, 1
        for _ in range(38):
            # A short line, then half a turn around a hole, on alternating sides.
            step, radius = round(rng.uniform(0.6, 1.8), 3), round(rng.uniform(0.8, 1.2), 3)
            made.line(x + step, y, speed=20.0)
            made.arc(round(x + step + 2.0 * radius, 3), y, radius, 0.0, side)
            x, side = x + step + 2.0 * radius, -side
            made.line(x + 0.6, y)
            x += 0.6
        made.switch('M5', False)
        made.line(x + 5.0, y, 2.0, speed=80.0)
    made.say('M2')
    return made
