# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""DXF drawings: the visible entities of the model space, as contours."""

from __future__ import annotations

from pathlib import Path

from ur_cartesian_driver.importing.dxf.affine import scaled
from ur_cartesian_driver.importing.dxf.contours import contours
from ur_cartesian_driver.importing.dxf.drawing import Drawing, read_drawing, Seen
from ur_cartesian_driver.importing.dxf.dxf_terms import ENGLISH, LeftOut, TERMS, UNITS
from ur_cartesian_driver.importing.dxf.entity_curves import JOINED, Stretch, stretch_of
from ur_cartesian_driver.importing.import_format import ImportFormat
from ur_cartesian_driver.importing.import_options import ImportOptions, LENGTH_UNITS
from ur_cartesian_driver.importing.imported_path import BrokenFile, PathCollector, SAME_POINT
from ur_cartesian_driver.motion.geometry.vectors import norm, subtract
from ur_cartesian_driver.motion.goal.goal import SegmentType


def collect_dxf(file: Path, options: ImportOptions, into: PathCollector) -> None:
    """
    Read the model space of a drawing.

    :raises BrokenFile: the file is cut off, a value must be a mistake, or the unit is not known.
    :raises OSError: the file cannot be opened.
    """
    left_out = LeftOut()
    drawing = read_drawing(file, left_out)
    unit = _unit(drawing, options, left_out)
    # The scale is applied later, and these tolerances are meant for the scaled path.
    scale = 1.0 / abs(options.scale)
    found = [
        stretch_of(record, place, options.tolerance * scale, left_out)
        for record, place in Seen(drawing, left_out).entities(scaled(unit, unit, unit))
    ]
    stretches = [stretch for stretch in found if stretch is not None]
    for contour in contours(stretches, JOINED * scale, left_out):
        if _is_too_small(contour, SAME_POINT * scale):
            for stretch in contour:
                left_out.add(
                    stretch.record, 'its contour is smaller than 0.005 mm, or than the tolerance'
                )
        else:
            _add(contour, into)
    left_out.tell(into.remarks)


def _unit(drawing: Drawing, options: ImportOptions, left_out: LeftOut) -> float:
    """Return the unit of length [m] of the options, or else of the drawing."""
    variable = drawing.header.get('$INSUNITS')
    number = variable.integer(70) if variable else 0
    name, length = UNITS.get(number, ('', 0.0))
    if options.unit:
        given = LENGTH_UNITS[options.unit]
        if variable and name and length != given:
            left_out.add(variable, f'the option unit says {options.unit}', f'$INSUNITS ({name})')
        is_english, length = options.unit in ('in', 'ft'), given
    elif name:
        is_english = number in ENGLISH
    else:
        said = f'; its $INSUNITS {number} is none' if number else ' ($INSUNITS)'
        raise BrokenFile(
            variable.line if variable else 0,
            f'the drawing does not say its unit{said}; {TERMS["$INSUNITS 0"].reason}',
        )
    system = drawing.header.get('$MEASUREMENT')
    if system and is_english is bool(system.integer(70)):
        left_out.add_term(system, '$MEASUREMENT')
    return length


def _is_too_small(contour: list[Stretch], size: float) -> bool:
    first = contour[0].points[0]
    return all(
        norm(subtract(point, first)) < size
        for stretch in contour
        for point in (*stretch.points, *filter(None, stretch.vias))
    )


def _add(contour: list[Stretch], into: PathCollector) -> None:
    first = contour[0]
    into.add(first.record.line, first.points[0], travel=True, lift=True)
    for stretch in contour:
        for point, via in zip(stretch.points[1:], stretch.vias[1:], strict=True):
            kind = SegmentType.LINEAR if via is None else SegmentType.CIRCULAR
            into.add(stretch.record.line, point, kind, via=via)


FORMAT = ImportFormat(
    terms=TERMS,
    others='Every other entity is left out, and said, and so is every other group code of an '
    'entity that is followed. All else in a drawing is for showing, editing and plotting it.',
    collect=collect_dxf,
)
