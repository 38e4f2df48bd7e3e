# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Tables drawn at random, in the dialects of many programs, and numpy's reading of them."""

from dataclasses import dataclass
from io import StringIO
from math import cos, pi, sin
from random import Random

import numpy as np

#: Groups of column names; units with their factors to SI.
POSITIONS = (
    ('x', 'y', 'z'),
    ('X', 'Y', 'Z'),
    ('pos_x', 'pos_y', 'pos_z'),
    ('Position.X', 'Position.Y', 'Position.Z'),
    ('tcp_x', 'tcp_y', 'tcp_z'),
    ('tx', 'ty', 'tz'),
)
ORIENTATIONS = {
    'quaternion': (
        ('qx', 'qy', 'qz', 'qw'),
        ('q_x', 'q_y', 'q_z', 'q_w'),
        ('quat_x', 'quat_y', 'quat_z', 'quat_w'),
        ('orientation.x', 'orientation.y', 'orientation.z', 'orientation.w'),
        ('rot_x', 'rot_y', 'rot_z', 'rot_w'),
    ),
    'rotation vector': (('rx', 'ry', 'rz'), ('RX', 'RY', 'RZ'), ('tcp_rx', 'tcp_ry', 'tcp_rz')),
    'angles': (('roll', 'pitch', 'yaw'), ('Roll', 'Pitch', 'Yaw')),
    'normal': (('nx', 'ny', 'nz'), ('normal_x', 'normal_y', 'normal_z')),
    'none': ((),),
}
TIMES = ('t', 'time', 'timestamp', 'Time', 'header.stamp')
LENGTHS = {
    'mm': 1e-3,
    'm': 1.0,
    'cm': 1e-2,
    'um': 1e-6,
    '\u00b5m': 1e-6,
    '\u03bcm': 1e-6,
    'in': 0.0254,
}
ANGLES = {'deg': pi / 180.0, '\u00b0': pi / 180.0, 'rad': 1.0}
SECONDS = {'s': 1.0, 'ms': 1e-3, 'us': 1e-6}
OTHERS = ('intensity', 'note', 'index', 'force_x', 'I/O', 'temp\u00e9rature')


@dataclass(frozen=True)
class RandomTable:
    """A table of text, and the values that numpy needs to read its numbers."""

    text: str
    encoding: str
    #: The delimiter for numpy; None = blanks.
    delimiter: str | None
    has_decimal_commas: bool
    #: Lines before the first row.
    head: int
    #: The names of the columns; the kind of orientation.
    titles: tuple[str, ...]
    orientation: str
    #: By title: index, factor to SI.
    columns: dict[str, tuple[int, float]]
    names: dict[str, tuple[str, ...]]

    def data(self) -> bytes:
        """Return the bytes of the file."""
        return self.text.encode(self.encoding)

    def read(self, titles: tuple[str, ...]) -> np.ndarray:
        """Return columns in SI units (n, k), as numpy reads the same text."""

        def number(text: str) -> float:
            return float(text.replace(',', '.') if self.has_decimal_commas else text)

        indices, factors = zip(*(self.columns[title] for title in titles), strict=True)
        values = np.loadtxt(
            StringIO(self.text, newline=None),
            delimiter=self.delimiter,
            skiprows=self.head,
            usecols=indices,
            converters=number,
            quotechar='"',
            comments='#',
            ndmin=2,
        )
        return values * np.array(factors)


def random_table(random: Random) -> RandomTable:
    """Return a table of 2 to 12 points at least 1 mm apart, with times that rise."""
    names, groups = _groups(random)
    columns = [(title, unit) for _, titles in groups for title, unit in titles]
    random.shuffle(columns)
    rows = random.randint(2, 12)
    delimiter = random.choice((',', ';', '\t', ' ', '  '))
    decimal_comma = delimiter != ',' and random.random() < 0.3
    values = _values(random, names, dict(columns), rows)
    lines, head = _lines(random, columns, values, delimiter, decimal_comma)
    text = random.choice(('\n', '\r\n', '\r')).join(lines) + random.choice(('', '\n'))
    encoding = random.choice(('utf-8', 'utf-8-sig', 'utf-16'))
    if text.isascii() or ('\u03bc' not in text and random.random() < 0.3):
        encoding = random.choice((encoding, 'cp1252'))
    factors = {**LENGTHS, **ANGLES, **SECONDS, '': 1.0, 'none': 1.0}
    return RandomTable(
        text=text,
        encoding=encoding,
        delimiter=delimiter if delimiter.strip() or delimiter == '\t' else None,
        has_decimal_commas=decimal_comma,
        head=head,
        titles=tuple(title for title, _ in columns),
        orientation=names['kind'][0],
        columns={title: (i, factors[unit]) for i, (title, unit) in enumerate(columns)},
        names=names,
    )


def _groups(random: Random):
    kind = random.choice(tuple(ORIENTATIONS))
    length, angle = random.choice(tuple(LENGTHS)), random.choice(tuple(ANGLES))
    unit = {'rotation vector': 'rad', 'angles': angle}.get(kind, '')
    position, orientation = random.choice(POSITIONS), random.choice(ORIENTATIONS[kind])
    names = {'position': position, 'orientation': orientation, 'kind': (kind,), 'time': ()}
    groups = [
        (position, [(title, length) for title in position]),
        (orientation, [(title, unit) for title in orientation]),
    ]
    if random.random() < 0.5:
        names['time'] = (random.choice(TIMES),)
        groups.append((names['time'], [(names['time'][0], random.choice(tuple(SECONDS)))]))
    others = random.sample(OTHERS, random.randint(0, 3))
    groups.append(((), [(title, 'none') for title in others]))
    return names, groups


def _values(random: Random, names, units, rows):
    """Return the cells by columns, as text with decimal points."""
    position = [[random.uniform(-0.9, 0.9) for _ in range(3)] for _ in range(rows)]
    cells = {}
    for i, title in enumerate(names['position']):
        cells[title] = [_text(random, p[i] / LENGTHS[units[title]], 6) for p in position]
    kind = names['kind'][0]
    cells |= {title: [] for title in names['orientation']}
    numbers: tuple[float, ...]
    for _ in range(rows if names['orientation'] else 0):
        if kind == 'quaternion':
            a, b, c = (random.uniform(-pi, pi) for _ in range(3))
            numbers = (sin(a) * sin(b), sin(a) * cos(b), cos(a) * sin(c), cos(a) * cos(c))
        elif kind == 'normal':
            numbers = (random.uniform(-1, 1), random.uniform(-1, 1), random.choice((-1, 1)))
        else:
            factor = ANGLES[units[names['orientation'][0]]]
            numbers = tuple(random.uniform(-2, 2) / factor for _ in range(3))
        for title, number in zip(names['orientation'], numbers, strict=True):
            cells[title].append(_text(random, number, 9))
    if names['time']:
        origin = random.choice((0.0, 62.56, 1.7e9))
        steps = np.cumsum([random.uniform(0.5, 2.0) for _ in range(rows)])
        factor = SECONDS[units[names['time'][0]]]
        cells[names['time'][0]] = [f'{(origin + step) / factor:.4f}' for step in steps]
    for title in units.keys() - cells.keys():
        cells[title] = [random.choice(('1', '0.5', 'abc', '-3')) for _ in range(rows)]
    return [cells[title] for title in units]


def _text(random: Random, number: float, digits: int) -> str:
    return random.choice((f'{number:.{digits}f}', f'{number:+.{digits + 2}e}', repr(number)))


def _lines(random: Random, columns, values, delimiter: str, decimal_comma: bool):
    """Return the lines of the file, and the number of lines before the first row."""
    style = random.choice(('{} [{}]', '{}({})', '{}_{}', '{} ({})', '{}/{}'))
    if delimiter.isspace() and delimiter != '\t':
        style = random.choice(('{}[{}]', '{}_{}', '{}/{}'))
    quoted = random.random() < 0.2
    titles = [
        title if unit in ('', 'none') else style.format(title, unit) for title, unit in columns
    ]
    in_second_line = random.random() < 0.2
    if in_second_line:
        titles = [title for title, _ in columns]
    if quoted:
        titles = [f'"{title}"' for title in titles]
    lines = [delimiter.join(titles)]
    if in_second_line:
        units = ['-' if unit in ('', 'none') else unit for _, unit in columns]
        lines.append(delimiter.join(units))
    elif random.random() < 0.3:
        lines[0] = random.choice(('# ', '#', '% ', '//')) + lines[0]
    before = random.choice(([], [], ['# made by hand'], ['', '# a,b', '%']))
    if delimiter == ';' and random.random() < 0.2:
        before = ['sep=;']
    lines = before + lines
    head = len(lines)
    end = delimiter if delimiter.strip() and random.random() < 0.2 else ''
    for row in zip(*values, strict=True):
        cells = [cell.replace('.', ',') if decimal_comma else cell for cell in row]
        if quoted and random.random() < 0.5:
            cells = [f'"{cell}"' for cell in cells]
        pad = '  ' if delimiter == '  ' and not quoted else ''
        lines.append(pad + delimiter.join(cells) + end)
        if random.random() < 0.1:
            lines.append(random.choice(('', '# a comment')))
    return lines, head
