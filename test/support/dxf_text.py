# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Drawings in a short form: group codes and values, `LINE 8 0 10 0 20 0 11 10 21 0`."""

from collections.abc import Iterable, Mapping

import numpy as np

from ur_cartesian_driver.importing import import_file, ImportOptions


def drawing(
    *entities: str,
    units: int | None = 4,
    header: str = '',
    layers: Iterable[str] = (),
    blocks: Mapping[str, str] | None = None,
    objects: str = '',
    version: str = '',
) -> str:
    """
    Return the text of a drawing.

    :param blocks: entities by the heads of their blocks, such as `B 10 0 20 0` of the block B.
    """
    parts = ['0 SECTION 2 HEADER']
    if version:
        parts.append(f'9 $ACADVER 1 {version}')
    if units is not None:
        parts.append(f'9 $INSUNITS 70 {units}')
    parts += [header, '0 ENDSEC 0 SECTION 2 TABLES 0 TABLE 2 LAYER']
    parts += [f'0 LAYER 2 {layer}' for layer in layers]
    parts.append('0 ENDTAB 0 ENDSEC 0 SECTION 2 BLOCKS')
    for head, inside in (blocks or {}).items():
        parts += [f'0 BLOCK 2 {head}', inside, '0 ENDBLK']
    parts.append('0 ENDSEC 0 SECTION 2 ENTITIES')
    parts += [f'0 {entity}' for entity in entities]
    parts += [f'0 ENDSEC 0 SECTION 2 OBJECTS {objects} 0 ENDSEC 0 EOF']
    return '\n'.join(' '.join(parts).split()) + '\n'


def imported(folder, text: str | bytes, **options):
    """Import a drawing; without options the goal has only the points of the drawing."""
    file = folder / 'part.dxf'
    file.write_bytes(text if isinstance(text, bytes) else text.encode())
    return import_file(file, ImportOptions(**options))


def millimetres(found) -> np.ndarray:
    """Return the points (n, 3) of a goal [mm]."""
    return 1e3 * np.array(found.goal.waypoints.poses)[:, :3]


def vias(found) -> np.ndarray:
    """Return the points on arcs (n, 3) [mm]."""
    has = np.array(found.goal.segments.has_via)
    return 1e3 * np.array(found.goal.segments.vias)[has, :3]


def remarks(found) -> str:
    """Return all remarks, a line each."""
    return '\n'.join(remark.text() for remark in found.remarks)


def line_of(text: str, entity: str, count: int = 1) -> int:
    """Return the line of the code 0 that begins the ``count``-th entity of a kind."""
    lines = text.splitlines()
    found = [i for i in range(1, len(lines), 2) if lines[i] == entity and lines[i - 1] == '0']
    return found[count - 1]
