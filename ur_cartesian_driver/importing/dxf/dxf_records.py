# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Records of a DXF file: its entities and the entries of its tables, with their lines.

A record is everything from one group code 0 to the next. The DXF reference warns readers not to
rely on the order of group codes within a record ("Common Group Codes for Entities"), so values are
looked up by their code.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import cached_property
from pathlib import Path
import re

from ur_cartesian_driver.importing.imported_path import BrokenFile
from ur_cartesian_driver.importing.text_file import decoded, file_lines, quoted
from ur_cartesian_driver.motion.geometry.vectors import Vector3, ZERO3

#: The group code under which all extended data (codes from 1000) are stored.
EXTENDED_DATA = 1001
MARKER, _EMBEDDED, _APPLICATION_GROUP, _ELEVATION = 100, 101, 102, 38
_EXTRUSION, Z_AXIS = 210, (0.0, 0.0, 1.0)
#: The marker of every entity, and the markers of the subclasses of each kind with a path.
ENTITY_MARKER = 'AcDbEntity'
MARKERS = {
    'LINE': ('AcDbLine',),
    'ARC': ('AcDbCircle', 'AcDbArc'),
    'CIRCLE': ('AcDbCircle',),
    'ELLIPSE': ('AcDbEllipse',),
    'LWPOLYLINE': ('AcDbPolyline',),
    'POLYLINE': ('AcDb2dPolyline', 'AcDb3dPolyline', 'AcDbPolygonMesh', 'AcDbPolyFaceMesh'),
    'VERTEX': (
        *('AcDbVertex', 'AcDb2dVertex', 'AcDb3dPolylineVertex'),
        *('AcDbPolygonMeshVertex', 'AcDbPolyFaceMeshVertex', 'AcDbFaceRecord'),
    ),
    'SPLINE': ('AcDbSpline',),
    'HELIX': ('AcDbSpline', 'AcDbHelix'),
    'INSERT': ('AcDbBlockReference', 'AcDbMInsertBlock'),
}
_INTEGER = re.compile(r'[-+]?[0-9]{1,15}')
_NUMBER = re.compile(r'[-+]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][-+]?[0-9]+)?')
_HANDLE = re.compile(r'[0-9A-Fa-f]{1,16}')
#: Products of a few numbers within this bound do not overflow.
_MAX_NUMBER = 1e12


class Record:
    """An entity, or an entry of a table, block or header."""

    def __init__(self, kind: str, line: int, tags: list[tuple[int, str]]) -> None:
        """
        Take the group codes and values that follow a code 0.

        :param line: the 1-based line of the code 0; each tag has two lines.
        """
        self.kind = kind
        self.line = line
        self.tags = tags
        #: The vertices of a POLYLINE.
        self.vertices: list[Record] = []

    @cached_property
    def values(self) -> dict[int, list[tuple[str, int]]]:
        """Values and their lines by group code, without the groups that applications define."""
        found: dict[int, list[tuple[str, int]]] = {}
        for code, value, line in self._in_order():
            found.setdefault(code if code < 1000 else EXTENDED_DATA, []).append((value, line))
        return found

    def _in_order(self) -> Iterator[tuple[int, str, int]]:
        own = MARKERS.get(self.kind)
        group = ''
        seen: set[str] = set()
        for index, (code, value) in enumerate(self.tags):
            line = self.line + 2 * index + 3
            if code == _APPLICATION_GROUP:
                group = value if value.startswith('{') else ''
            elif not group:
                if code == _EMBEDDED and own is None:
                    return  # the rest reuses codes
                if code == MARKER and own is not None:
                    if value in seen or value not in (ENTITY_MARKER, *own):
                        # The file was cut: this is the rest of another entity.
                        raise BrokenFile(line, f'{self.kind}: its marker {quoted(value)} is wrong')
                    seen.add(value)
                    if value == 'AcDbHelix':
                        return  # the rest reuses codes; before it, a HELIX is a SPLINE
                yield code, value, line
        if group and own is not None:
            raise BrokenFile(
                self.line, f'{self.kind}: its group {quoted(group)} does not end (group code 102)'
            )

    @property
    def handle(self) -> str:
        """The record's identifier, which CAD programs display; empty = none."""
        found = self.values.get(5)
        return found[0][0] if found and _HANDLE.fullmatch(found[0][0]) else ''

    def fault(self, text: str, line: int = 0) -> BrokenFile:
        """Return the error for this record, at the given line or else at its first line."""
        name = f'{self.kind} {self.handle}' if self.handle else self.kind
        return BrokenFile(line or self.line, f'{name}: {text}')

    def text(self, code: int, default: str = '') -> str:
        """
        Return the text of a group code.

        :raises BrokenFile: the code has two different texts.
        """
        found = self.values.get(code)
        if found is None:
            return default
        for value, line in found[1:]:
            if value != found[0][0]:
                raise self.fault(f'group code {code} occurs twice', line)
        return found[0][0]

    def number(self, code: int, default: float | None = None) -> float:
        """
        Return the number of a group code.

        :param default: the number if the code is missing; None = the code is required.
        :raises BrokenFile: the code is missing, has no number, or has two different numbers.
        """
        found = self.values.get(code)
        if found is None:
            if default is None:
                raise self.fault(f'group code {code} is missing')
            return default
        value = self._number(code, *found[0])
        for text, line in found[1:]:
            if self._number(code, text, line) != value:
                raise self.fault(f'group code {code} occurs twice', line)
        return value

    def numbers(self, code: int) -> list[float]:
        """
        Return all numbers of a group code.

        :raises BrokenFile: a value is no number, or far too large.
        """
        return [self._number(code, text, line) for text, line in self.values.get(code, ())]

    def numbered(self, *codes: int) -> Iterator[tuple[int, float, int]]:
        """
        Yield codes with their numbers and lines, in the order of the file.

        :raises BrokenFile: a value is no number, or far too large.
        """
        for code, text, line in self._in_order():
            if code in codes:
                yield code, self._number(code, text, line), line

    def _number(self, code: int, text: str, line: int) -> float:
        if not _NUMBER.fullmatch(text):
            raise self.fault(f'{quoted(text)} is no number (group code {code})', line)
        value = float(text)
        if abs(value) > _MAX_NUMBER:
            raise self.fault(f'{quoted(text)} is too large (group code {code})', line)
        return value

    def integer(self, code: int, default: int = 0) -> int:
        """
        Return the integer of a group code; some programs write it with a decimal point.

        :raises BrokenFile: the value is no integer.
        """
        if code not in self.values:
            return default
        value = self.number(code)
        if value != int(value):
            raise self.fault(f'{value:g} is no integer (group code {code})')
        return int(value)

    def point(self, code: int, default: Vector3 | None = None) -> Vector3:
        """
        Return the point that begins with a group code.

        A point without z is at the elevation of the entity, as before AutoCAD R11.

        :raises BrokenFile: a coordinate is missing, or no number.
        """
        if default is not None and code not in self.values:
            return default
        has_z = code + 20 in self.values or code == _EXTRUSION
        z = self.number(code + 20 if has_z else _ELEVATION, 0.0)
        return self.number(code), self.number(code + 10), z

    def extrusion(self) -> Vector3:
        """
        Return the direction of the entity's axis z.

        :raises BrokenFile: the direction is a zero vector.
        """
        found = self.point(_EXTRUSION, Z_AXIS)
        if found == ZERO3:
            raise self.fault(f'its extrusion has no direction (group code {_EXTRUSION})')
        return found

    def points(self, code: int) -> list[Vector3]:
        """
        Return all points that begin with a group code.

        :raises BrokenFile: a point lacks a coordinate.
        """
        x, y, z = (self.numbers(code + step) for step in (0, 10, 20))
        if len(x) != len(y) or (z and len(z) != len(x)):
            raise self.fault(
                f'{len(x)} points have {len(y)} coordinates y and {len(z)} z '
                f'(group codes {code}, {code + 10}, {code + 20})'
            )
        return list(zip(x, y, z or [0.0] * len(x), strict=True))


def read_records(file: Path) -> Iterator[Record]:
    """
    Yield the records of a drawing; the record of the section HEADER has all header variables.

    :raises BrokenFile: the file is binary or empty, a group code is no integer, or EOF is missing.
    :raises OSError: the file cannot be opened.
    """
    data = file.read_bytes()
    if data.startswith(b'AutoCAD Binary DXF'):
        raise BrokenFile(0, 'this is a binary DXF; save it as a text (ASCII) DXF')
    lines = file_lines(decoded(data, _code_page(data)))
    if lines and not _INTEGER.fullmatch(first := lines[0].strip()):
        raise BrokenFile(1, f'this is no DXF: {quoted(first)} is no group code')
    codes: dict[str, int] = {}
    record = Record('the beginning of the file', -1, [])
    for i in range(0, len(lines) - 1, 2):
        code = codes.get(lines[i])
        if code is None:
            text = lines[i].strip()
            if not _INTEGER.fullmatch(text):
                raise BrokenFile(i + 1, f'{quoted(text)} is no group code of a DXF file')
            code = codes[lines[i]] = int(text)
        value = lines[i + 1].strip()
        if code == 0:
            yield record
            if value == 'EOF':
                return
            record = Record(value, i + 1, [])
        else:
            record.tags.append((code, value))
    if not lines:
        raise BrokenFile(0, 'the file is empty')
    raise BrokenFile(len(lines), 'the drawing ends here, before its EOF')


def _code_page(data: bytes) -> str:
    """Return the codec for the code page of an old drawing, such as ANSI_1252 or dos850."""
    found = re.search(rb'\$DWGCODEPAGE\s+3\s+(?:ansi_|dos)(\d+)', data, re.IGNORECASE)
    return f'cp{found[1].decode() if found else 1252}'
