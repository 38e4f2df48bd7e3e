# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Random drawings: their content as group codes, written in the ways of different programs.

ezdxf needs the form of R2000, with handles and subclass markers. Other writers leave these out,
mix the order of codes, and put blanks, comments and other line ends into the file; the content is
the same.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from math import cos, pi, sin
from random import Random

#: A group code and its value.
Tag = tuple[int, object]
LAYERS = {
    '0': (0, 7),
    'Cut': (0, 3),
    'Off': (0, -2),
    'Frozen': (1, 5),
    'Locked': (4, 1),
}
#: Half the width of drawings [m], and the lengths of their units by $INSUNITS [m].
SIZE = 0.06
UNITS = {1: 0.0254, 4: 1e-3, 5: 1e-2, 9: 2.54e-5, 14: 0.1, 21: 1200 / 3937}


@dataclass
class Entity:
    """An entity with its group codes, under the markers of their subclasses."""

    kind: str
    parts: list[tuple[str, list[Tag]]]
    common: list[Tag] = field(default_factory=list)
    #: The vertices of a POLYLINE, which follow it as entities.
    vertices: list['Entity'] = field(default_factory=list)


@dataclass
class Content:
    """The contents of a drawing, the same for all writers."""

    entities: list[Entity] = field(default_factory=list)
    blocks: dict[str, tuple[list[Tag], list[Entity]]] = field(default_factory=dict)
    units: int = 4


class Draftsman:
    """Draws random entities; half of their ends are at ends of others."""

    def __init__(self, random: Random, units: int = 0) -> None:
        self.random = random
        self.units = units or random.choice(list(UNITS))
        self.size = SIZE / UNITS[self.units]
        self.ends: list[tuple[float, ...]] = []
        self.has_nested = False

    def number(self):
        return float(f'{self.random.uniform(-self.size, self.size):.6g}')

    def place(self):
        """Return a place, often an earlier one or a place near an earlier one."""
        if self.ends and self.random.random() < 0.5:
            x, y, z = self.random.choice(self.ends)
            return (
                (x, y, z)
                if self.random.random() < 0.7
                else (x + 7e-5 * self.size, y - 5e-5 * self.size, z)
            )
        self.ends.append((self.number(), self.number(), self.random.choice((0.0, self.number()))))
        return self.ends[-1]

    def extrusion(self) -> list[Tag]:
        chosen = self.random.choice(
            (None, None, (0, 0, -1), (0, 0, 1), (0.3, -0.2, 0.9), (1, 0, 0))
        )
        return [] if chosen is None else point(210, chosen)

    def common(self, layers=tuple(LAYERS)) -> list[Tag]:
        tags: list[Tag] = [(8, self.random.choice(layers))]
        tags += self.random.choice(([], [], [], [(62, 3)], [(6, 'BYLAYER')], [(60, 1)]))
        return tags

    def content(self) -> Content:
        found = Content(units=self.units)
        names = ['Part', 'Hole'][: self.random.randint(0, 2)]
        for name in names:
            inside = [self.entity() for _ in range(self.random.randint(1, 3))]
            if name == 'Hole' and self.random.random() < 0.5:
                self.has_nested = True
                inside.append(self.insert('Part', is_nested=True))
            for entity in inside:
                # If a scale breaks an invisible polyline into parts, ezdxf shows the parts.
                entity.common = [tag for tag in entity.common if tag[0] != 60]
            found.blocks[name] = (point(10, (self.number(), self.number(), 0.0)), inside)
        for _ in range(self.random.randint(1, 8)):
            found.entities.append(self.entity())
        for _ in range(self.random.randint(0, 2) if names else 0):
            found.entities.append(self.insert(self.random.choice(names)))
        self.random.shuffle(found.entities)
        return found

    def entity(self) -> Entity:
        draw = self.random.choice(
            [
                *(self.line, self.line, self.arc, self.circle, self.ellipse, self.lwpolyline),
                *(self.polyline, self.space_polyline, self.spline, self.other),
            ]
        )
        found = draw()
        found.common = self.common()
        return found

    def line(self):
        tags = point(10, self.place()) + point(11, self.place())
        return Entity('LINE', [('AcDbLine', tags)])

    def circle(self):
        tags = [
            *point(10, self.place()),
            (40, abs(self.number()) + 0.01 * self.size),
            *self.extrusion(),
        ]
        return Entity('CIRCLE', [('AcDbCircle', tags)])

    def arc(self):
        begin = self.random.choice((0, 30, 271.5, round(self.random.uniform(0, 360), 3)))
        end = self.random.choice((360, 90, -45, round(self.random.uniform(0, 360), 3)))
        found = self.circle()
        return Entity('ARC', [*found.parts, ('AcDbArc', [(50, begin), (51, end)])])

    def ellipse(self):
        turn, normal = self.random.uniform(0, 2 * pi), self.random.choice(((0, 0, 1), (0, 0, -1)))
        length = abs(self.number()) + 0.02 * self.size
        tags = [
            *point(10, self.place()),
            *point(11, (length * cos(turn), length * sin(turn), 0.0)),
            *point(210, normal),
            (40, round(self.random.uniform(0.05, 1.0), 3)),
            (41, 0.0),
            (42, self.random.choice((2 * pi, 1.0, 4.5))),
        ]
        return Entity('ELLIPSE', [('AcDbEllipse', tags)])

    def bulge(self) -> list[Tag]:
        arc: list[Tag] = [(42, round(self.random.uniform(-3, 3), 3))]
        return arc if self.random.random() < 0.4 else []

    def lwpolyline(self):
        count, flag = self.random.randint(2, 5), self.random.choice((0, 1, 128, 129))
        tags: list[Tag] = [(90, count), (70, flag), (38, self.number()), *self.extrusion()]
        for _ in range(count):
            tags += [*point(10, self.place()[:2]), *self.bulge()]
        return Entity('LWPOLYLINE', [('AcDbPolyline', tags)])

    def polyline(self):
        flag, height = self.random.choice((0, 1)), self.number()
        tags = [(66, 1), *point(10, (0, 0, height)), (70, flag), *self.extrusion()]
        vertices = [
            Entity(
                'VERTEX',
                [
                    ('AcDbVertex', []),
                    ('AcDb2dVertex', [*point(10, (*self.place()[:2], height)), *self.bulge()]),
                ],
                common=[(8, '0')],
            )
            for _ in range(self.random.randint(2, 4))
        ]
        return Entity('POLYLINE', [('AcDb2dPolyline', tags)], vertices=vertices)

    def space_polyline(self):
        flag = self.random.choice((8, 9))
        tags = [(66, 1), *point(10, (0, 0, 0)), (70, flag)]
        vertices = [
            Entity(
                'VERTEX',
                [
                    ('AcDbVertex', []),
                    ('AcDb3dPolylineVertex', [*point(10, self.place()), (70, 32)]),
                ],
                common=[(8, '0')],
            )
            for _ in range(self.random.randint(2, 4))
        ]
        return Entity('POLYLINE', [('AcDb3dPolyline', tags)], vertices=vertices)

    def spline(self):
        degree = self.random.randint(1, 5)
        count = degree + self.random.randint(1, 4)
        inner = sorted(self.random.sample(range(1, 20), count - degree - 1))
        knots = [0] * (degree + 1) + inner + [20] * (degree + 1)
        is_rational = self.random.random() < 0.4
        tags: list[Tag] = [(70, 12 if is_rational else 8), (71, degree)]
        tags += [(72, len(knots)), (73, count), (74, 0), *((40, knot) for knot in knots)]
        if is_rational:
            tags += [(41, round(self.random.uniform(0.3, 3.0), 2)) for _ in range(count)]
        for _ in range(count):
            tags += point(10, self.place())
        return Entity('SPLINE', [('AcDbSpline', tags)])

    def other(self):
        """Draw an entity without a path."""
        return self.random.choice(
            (
                Entity('POINT', [('AcDbPoint', point(10, self.place()))]),
                Entity('XLINE', [('AcDbXline', point(10, self.place()) + point(11, (1, 0, 0)))]),
                Entity(
                    'TEXT',
                    [
                        (
                            'AcDbText',
                            [*point(10, self.place()), (40, 0.1 * self.size), (1, 'abc')],
                        ),
                        ('AcDbText', []),
                    ],
                ),
                Entity(
                    'SOLID',
                    [('AcDbTrace', [t for c in (10, 11, 12, 13) for t in point(c, self.place())])],
                ),
            )
        )

    def insert(self, name, is_nested=False):
        tags: list[Tag] = [(2, name), *point(10, self.place())]
        # ezdxf distorts a shear, which comes from scaled blocks in scaled blocks.
        uneven = ((1.5, 0.5, 1), (1, 1, -2)) if not self.has_nested else ()
        scale = self.random.choice(((1, 1, 1), (2, 2, 2), (-1, 1, 1), *uneven))
        tags += [(code, value) for code, value in zip((41, 42, 43), scale, strict=True)]
        tags += [(50, self.random.choice((0, 90, 33.3)))]
        if not is_nested and self.random.random() < 0.3:  # ezdxf does not scale the steps
            tags += [(70, 2), (71, 2), (44, 0.3 * self.size), (45, -0.2 * self.size)]
        tags += self.extrusion()
        # An INSERT on a frozen layer shows nothing in AutoCAD; ezdxf shows entities on others.
        layers = tuple(name for name in LAYERS if name != 'Frozen')
        return Entity('INSERT', [('AcDbBlockReference', tags)], common=self.common(layers))


def point(code: int, place: Sequence[float]) -> list[Tag]:
    """Return the tags of a point of two or three coordinates."""
    return [(code + 10 * i, value) for i, value in enumerate(place)]


@dataclass
class Writer:
    """Writes a content in the way of a program."""

    version: str = 'AC1015'
    has_handles: bool = True
    has_markers: bool = True
    #: The generator that shuffles codes, of entities that have each code once; None = no shuffle.
    mixes: Random | None = None
    comment: str = ''
    indent: int = 3
    end: str = '\n'

    def text(self, content: Content) -> str:
        """Return the text of the file."""
        self._handle = 0x100
        tags = list(self._tags(content))
        lines = (f'{code:>{self.indent}}{self.end}{value}{self.end}' for code, value in tags)
        return ''.join(lines)

    def _tags(self, content: Content) -> Iterator[Tag]:
        if self.comment:
            yield 999, self.comment
        yield from ((0, 'SECTION'), (2, 'HEADER'))
        if self.version:
            yield from ((9, '$ACADVER'), (1, self.version))
        yield from ((9, '$INSUNITS'), (70, content.units), (0, 'ENDSEC'))
        yield from ((0, 'SECTION'), (2, 'TABLES'), (0, 'TABLE'), (2, 'LAYER'))
        yield from [*self._named('2'), *self._marked('AcDbSymbolTable'), (70, len(LAYERS))]
        for name, (flags, colour) in LAYERS.items():
            yield from ((0, 'LAYER'), *self._named(name), *self._marked('AcDbSymbolTableRecord'))
            yield from (*self._marked('AcDbLayerTableRecord'), (2, name))
            yield from ((70, flags), (62, colour), (6, 'CONTINUOUS'))
        yield from ((0, 'ENDTAB'), (0, 'ENDSEC'), (0, 'SECTION'), (2, 'BLOCKS'))
        for name, (base, entities) in content.blocks.items():
            yield from ((0, 'BLOCK'), *self._named(name), *self._marked('AcDbEntity'), (8, '0'))
            yield from (
                *self._marked('AcDbBlockBegin'),
                (2, name),
                (70, 0),
                *base,
                (3, name),
                (1, ''),
            )
            for entity in entities:
                yield from self._entity(entity)
            yield from ((0, 'ENDBLK'), *self._named(name), *self._marked('AcDbEntity'), (8, '0'))
            yield from self._marked('AcDbBlockEnd')
        yield from ((0, 'ENDSEC'), (0, 'SECTION'), (2, 'ENTITIES'))
        for entity in content.entities:
            yield from self._entity(entity)
        yield from ((0, 'ENDSEC'), (0, 'EOF'))

    def _named(self, name: str) -> list[Tag]:
        self._handle += 1
        return [(5, f'{self._handle:X}')] if self.has_handles else []

    def _marked(self, name: str) -> list[Tag]:
        return [(100, name)] if self.has_markers else []

    def _entity(self, entity: Entity) -> Iterator[Tag]:
        tags = [*self._named(entity.kind), *self._marked('AcDbEntity'), *entity.common]
        for marker, part in entity.parts:
            tags += [*self._marked(marker), *part]
        if self.mixes and len({code for code, _ in tags}) == len(tags):
            self.mixes.shuffle(tags)
        yield 0, entity.kind
        if self.comment and tags:
            yield 999, 'of the entity'
        yield from tags
        for vertex in entity.vertices:
            yield from self._entity(vertex)
        if entity.vertices:
            yield from ((0, 'SEQEND'), *self._named(''), *self._marked('AcDbEntity'), (8, '0'))


CANONICAL = Writer()


def other_writers(random: Random) -> list[Writer]:
    """Return writers of other programs."""
    return [
        Writer('AC1009', False, False, random, 'by a hand', 1, '\r\n'),
        Writer('', False, False, None, '', 6, '\n'),
        Writer('AC1006', True, False, random, '', 0, '\r'),
        Writer('AC1032', True, True, random, 'of later', 3, '\r\n'),
    ]
