# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""A drawing: its header, layers, blocks and entities, and the choice of visible entities."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from math import radians
from pathlib import Path

from ur_cartesian_driver.importing.dxf.affine import (
    Affine,
    object_axes,
    scaled,
    shifted,
    turned,
)
from ur_cartesian_driver.importing.dxf.dxf_records import (
    ENTITY_MARKER,
    MARKER,
    MARKERS,
    read_records,
    Record,
)
from ur_cartesian_driver.importing.dxf.dxf_terms import LeftOut, TERMS
from ur_cartesian_driver.importing.text_file import quoted
from ur_cartesian_driver.motion.geometry.vectors import add, scale, ZERO3

_COMMENT, _NAME, _VARIABLE, _LAYER, _POINT = 999, 2, 9, 8, 10
_FROZEN, _EXTERNAL = 1, (4, 8)
_MODEL, _SHEETS = 'MODEL', ('*PAPER_SPACE', '$PAPER_SPACE')
_MODEL_SPACES = ('*MODEL_SPACE', '$MODEL_SPACE')
_SECTIONS = (
    *('HEADER', 'CLASSES', 'TABLES', 'BLOCKS', 'ENTITIES', 'OBJECTS', 'THUMBNAILIMAGE'),
    'ACDSDATA',
)
_WITH_ENTITIES = ('BLOCKS', 'ENTITIES')
#: The sections in which the records of a drawing belong; elsewhere they show that the file is cut.
_SECTIONS_OF = {
    **dict.fromkeys(('TABLE', 'ENDTAB', 'LAYER', 'BLOCK_RECORD'), ('TABLES',)),
    **dict.fromkeys(('BLOCK', 'ENDBLK'), ('BLOCKS',)),
    **dict.fromkeys((*MARKERS, 'SEQEND'), _WITH_ENTITIES),
    'DICTIONARY': ('OBJECTS',),
}
#: Markers of entities with a path, and records that have no position.
_OF_PATHS = {marker for markers in MARKERS.values() for marker in markers}
_NOWHERE = ('SECTION', 'ENDSEC', 'TABLE', 'ENDTAB', 'LAYER', 'ENDBLK', 'SEQEND')
#: Largest number of placed entities of blocks, and deepest nesting of blocks.
_MAX_PLACED, _MAX_DEPTH = 100_000, 64
#: Maps whose axes and origin are shorter than this do not make coordinates overflow.
_MAX_SCALE = 1e60


@dataclass(slots=True)
class DrawingBlock:
    """A block, and its entities."""

    record: Record
    entities: list[Record] = field(default_factory=list)


@dataclass(slots=True)
class Drawing:
    """Records by name; the names are in upper case, because CAD programs ignore the case."""

    header: dict[str, Record] = field(default_factory=dict)
    layers: dict[str, Record] = field(default_factory=dict)
    blocks: dict[str, DrawingBlock] = field(default_factory=dict)
    entities: list[Record] = field(default_factory=list)
    #: Handles of entities that are clipped.
    clipped: set[str] = field(default_factory=set)


def read_drawing(file: Path, left_out: LeftOut) -> Drawing:
    """
    Read a drawing.

    :raises BrokenFile: the file is cut off, or is no DXF.
    :raises OSError: the file cannot be opened.
    """
    found = Drawing()
    section = ''
    into: list[Record] | None = None
    sections: set[str] = set()
    objects: dict[str, Record] = {}
    for record in read_records(file):
        kind = record.kind
        if kind == 'SECTION':
            if section:
                raise record.fault(f'the section {section} has not ended yet')
            section = _section(record, sections, left_out)
            into = found.entities if section == 'ENTITIES' else None
            if section == 'HEADER':
                found.header = _header(record)
            continue
        if section in _SECTIONS and section not in _SECTIONS_OF.get(kind, (section,)):
            raise record.fault(f'it cannot be in the section {section}; the file is broken')
        if section == 'BLOCKS' and into is not None and kind in ('BLOCK', 'ENDSEC'):
            raise record.fault('the block before it has not ended; the file is broken')
        if section in _WITH_ENTITIES or kind in _NOWHERE:
            _refuse_two_in_one(record)
        if kind == 'ENDSEC':
            section = ''
        elif section in _WITH_ENTITIES:
            if kind == 'BLOCK':
                into = _new_block(record, found.blocks).entities
            elif kind == 'ENDBLK':
                into = None
            else:
                _add_entity(record, into)
        elif kind == 'LAYER' and section == 'TABLES':
            _add_layer(record, found.layers, left_out)
        elif section == 'OBJECTS':
            objects[record.handle] = record
        elif not section and any(code != _COMMENT for code, _ in record.tags):
            left_out.add(record, 'it is in no section')
    found.clipped = _clipped(objects)
    return found


def _section(record: Record, before: set[str], left_out: LeftOut) -> str:
    """Return the name of the section that a record begins."""
    # The first code 2, because header variables in the same record can have this code, too.
    name = next((value for code, value in record.tags if code == _NAME), '').upper()
    if name in before:
        raise record.fault(f'there is a section {name} before')
    if name not in _SECTIONS:
        left_out.add(record, 'it is no section that is known here', f'section {name}')
    before.add(name)
    if name != 'HEADER':
        _refuse_two_in_one(record)
    return name


def _header(record: Record) -> dict[str, Record]:
    """Return the variables of a header; two different units are refused."""
    found: dict[str, Record] = {}
    for name, variable in list(_variables(record)):  # the list completes each variable's tags
        first = found.setdefault(name, variable)
        if name == '$INSUNITS' and variable.integer(70) != first.integer(70):
            raise variable.fault('it occurs twice')
    return found


def _variables(header: Record) -> Iterator[tuple[str, Record]]:
    """Yield the variables of a header: each is a code 9 with its name, then codes with values."""
    variable = header
    for index, (code, value) in enumerate(header.tags):
        if code == _VARIABLE:
            variable = Record(value.upper(), header.line + 2 * index + 2, [])
            yield variable.kind, variable
        elif variable is not header:
            variable.tags.append((code, value))


def _refuse_two_in_one(record: Record) -> None:
    """Refuse a record that goes on as an entity whose beginning is missing."""
    kind, values = record.kind, record.values  # .values refuses other markers in such entities
    markers = values.get(MARKER, [])
    # Old files have no markers, but each entity has one layer.
    second = [line for text, line in markers if text == ENTITY_MARKER][1:]
    second += [line for _, line in values.get(_LAYER, ())[1:] if not markers]
    if kind not in MARKERS and (kind in TERMS or kind in (*_NOWHERE, 'BLOCK')):
        # A table is a kind of INSERT.
        foreign = _OF_PATHS - {*MARKERS['INSERT']} if kind == 'ACAD_TABLE' else _OF_PATHS
        second += [line for text, line in markers if text in foreign]
    if kind in _NOWHERE:
        second += [line for _, line in values.get(_POINT, ())]
    if second:
        raise record.fault(
            'it goes on as another entity, whose beginning is missing; the file is broken',
            min(second),
        )


def _add_entity(record: Record, into: list[Record] | None) -> None:
    """Add an entity, or a vertex to its polyline."""
    if into is None:
        raise record.fault('it stands between blocks, in none; the file is broken')
    if record.kind == 'VERTEX' and into and into[-1].kind == 'POLYLINE':
        into[-1].vertices.append(record)
    elif record.kind != 'SEQEND':
        into.append(record)


def _add_layer(record: Record, layers: dict[str, Record], left_out: LeftOut) -> None:
    """Add a layer; a second one of the same name must have the same visibility."""
    name = record.text(_NAME)
    first = layers.setdefault(name.upper(), record)
    if first is record:
        return
    if _hides(first) != _hides(record):
        raise record.fault(
            f'a layer {quoted(name)} came before, and one of the two is off or frozen'
        )
    left_out.add(record, 'the first layer of this name counts')


def _hides(layer: Record) -> tuple[bool, bool]:
    """Return whether a layer is frozen, and whether it is off."""
    return bool(layer.integer(70) & _FROZEN), layer.integer(62, 7) < 0


def _new_block(record: Record, blocks: dict[str, DrawingBlock]) -> DrawingBlock:
    block = DrawingBlock(record)
    name = record.text(2)
    if blocks.setdefault(name.upper(), block) is not block and name:
        raise record.fault(f'a block {quoted(name)} came before')
    return block


def _clipped(objects: dict[str, Record]) -> set[str]:
    """Return the handles of the entities that own an active clip, through other objects."""
    found = set()
    for record in objects.values():
        if record.kind == 'SPATIAL_FILTER' and record.integer(71, 1):
            owner = record.handle
            for _ in objects:
                if owner not in objects:
                    break
                owner = next((text for text, _ in objects[owner].values.get(330, ())), '')
            found.add(owner)
    return found


class Seen:
    """Walks through the model space, and adds remarks on invisible entities."""

    def __init__(self, drawing: Drawing, left_out: LeftOut) -> None:
        """Begin before the first entity."""
        self._drawing = drawing
        self._left_out = left_out
        self._placed = 0
        self._shown: set[str] = set()

    def entities(self, place: Affine) -> Iterator[tuple[Record, Affine]]:
        """
        Yield the visible entities in the order of the file, each with the map of its coordinates.

        :param place: the map from the drawing's coordinates to [m].
        :raises BrokenFile: a block cannot be placed.
        """
        sheets = [b for name, b in self._drawing.blocks.items() if name.startswith(_SHEETS)]
        for record in (record for sheet in sheets for record in sheet.entities):
            self._leave_on_sheet(record)
        for record in self._model_space():
            layout = record.text(410, _MODEL)
            if record.integer(67) or layout.upper() != _MODEL:
                self._leave_on_sheet(record)
            else:
                yield from self._seen(record, place, '', ())

    def _model_space(self) -> Iterator[Record]:
        for name in _MODEL_SPACES:  # most programs leave these blocks empty
            if name in self._drawing.blocks:
                yield from self._drawing.blocks[name].entities
        yield from self._drawing.entities

    def _leave_on_sheet(self, record: Record) -> None:
        if record.kind != 'VIEWPORT':  # a window, which belongs to the sheet
            self._left_out.add_term(record, '67')

    def _seen(
        self, record: Record, place: Affine, layer: str, inside: tuple[str, ...]
    ) -> Iterator[tuple[Record, Affine]]:
        """
        Yield an entity; for an INSERT, the entities of its block.

        :param layer: the layer of the enclosing INSERT, which entities on layer 0 inherit.
        :param inside: names of the blocks that the entity is in.
        """
        own = record.text(8, '0').upper()
        if not inside or own != '0':
            layer = own
        if hidden := self._hidden(record, layer):
            entry = self._drawing.layers.get(layer)
            name = entry.text(2) if entry else layer
            self._left_out.add_term(record, hidden, f'{record.kind} on layer {name}')
        elif record.kind == 'INSERT':
            yield from self._of_block(record, place, layer, inside)
        else:
            self._show(layer)
            yield record, place

    def _hidden(self, record: Record, layer: str) -> str:
        """Return the term that hides an entity; only a frozen layer hides an INSERT."""
        if record.integer(60):
            return '60'
        entry = self._drawing.layers.get(layer)
        is_frozen, is_off = _hides(entry) if entry else (False, False)
        if is_frozen:
            return 'LAYER 70=1'
        if record.kind == 'INSERT':
            return ''
        if layer == 'DEFPOINTS':
            return 'LAYER Defpoints'
        return 'LAYER 62<0' if is_off else ''

    def _show(self, layer: str) -> None:
        """Add a remark, once for each layer, on the layer's properties that the tool ignores."""
        entry = self._drawing.layers.get(layer)
        if entry is None or layer in self._shown:
            return
        self._shown.add(layer)
        self._left_out.add_look(entry)
        if not entry.integer(290, 1):
            self._left_out.add_term(entry, 'LAYER 290=0', f'layer {entry.text(2)}')

    def _of_block(
        self, record: Record, place: Affine, layer: str, inside: tuple[str, ...]
    ) -> Iterator[tuple[Record, Affine]]:
        name = record.text(2).upper()
        block = self._drawing.blocks.get(name)
        if why := self._unplaced(record, block):
            self._left_out.add_term(record, why)
            return
        assert block is not None
        if name in inside:
            raise record.fault(TERMS['INSERT in its own BLOCK'].reason)
        if len(inside) >= _MAX_DEPTH:
            raise record.fault(f'it is in more than {_MAX_DEPTH} blocks')
        self._left_out.add_codes(record)
        for at in _places(record, block, place):
            for entity in block.entities:
                self._placed += 1
                if self._placed > _MAX_PLACED:
                    raise record.fault(f'the blocks have more than {_MAX_PLACED:,} entities')
                yield from self._seen(entity, at, layer, (*inside, name))

    def _unplaced(self, record: Record, block: DrawingBlock | None) -> str:
        """Return the term because of which an INSERT is left out; empty = it is placed."""
        if block is None:
            return 'INSERT without BLOCK'
        for bit in _EXTERNAL:
            if block.record.integer(70) & bit and not block.entities:
                return f'BLOCK 70={bit}'
        return 'SPATIAL_FILTER' if record.handle in self._drawing.clipped else ''


def _places(record: Record, block: DrawingBlock, place: Affine) -> Iterator[Affine]:
    """Yield the map of a block's coordinates for each copy in an INSERT's array."""
    axes = place.after(object_axes(record.extrusion()))
    x, y, z = (record.number(code, 1.0) for code in (41, 42, 43))
    if x == 0.0 or y == 0.0:
        raise record.fault('a scale is 0 (group codes 41 and 42)')
    turn = turned(radians(record.number(50, 0.0)))
    z = z or 1.0  # 2D programs write a scale of 0 for z
    shape = turn.after(scaled(x, y, z)).after(shifted(scale(block.record.point(10, ZERO3), -1.0)))
    across, up = record.number(44, 0.0), record.number(45, 0.0)
    columns = record.integer(70, 1) if across else 1
    rows = record.integer(71, 1) if up else 1
    if max(1, columns) * max(1, rows) > _MAX_PLACED:
        raise record.fault(f'it has {columns} x {rows} places, more than {_MAX_PLACED:,}')
    for row in range(max(1, rows)):
        for column in range(max(1, columns)):
            step = turn.direction((column * across, row * up, 0.0))
            found = axes.after(shifted(add(record.point(10), step))).after(shape)
            if not found.is_within(_MAX_SCALE):
                raise record.fault('its scale is too large')
            yield found
