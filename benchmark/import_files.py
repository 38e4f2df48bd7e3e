# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Time to import files of other programs as goals."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path
import sys
from tempfile import TemporaryDirectory

from figures import Figure, seconds
import numpy as np

from ur_cartesian_driver.goal_files import fields_of_goal, goal_text
from ur_cartesian_driver.importing import FORMATS, import_file, ImportOptions

LINES = 10_000
POSE = """- pose:
    position:
      x: {}
      y: {}
      z: {}
    orientation:
      x: 0.0
      y: 0.0
      z: 0.0
      w: 1.0
"""


def run(quick: bool) -> Iterator[Figure]:
    """Import a spiral from each format."""
    for name in FORMATS.names():
        FORMATS[name]  # a reader is imported when it is used first, and that is not measured
    lines = LINES // 10 if quick else LINES
    with TemporaryDirectory() as folder:
        for name, text in texts(lines).items():
            file = Path(folder) / name
            file.write_text(text)
        record_spiral(Path(folder), lines)
        for file in sorted(Path(folder).iterdir()):
            for tolerance in (0.0, 1e-4):
                options = ImportOptions(blend=1e-3, simplify=tolerance, unit='mm')
                taken = seconds(partial(convert, file, options), repeat=1)
                rows = 'packets' if file.suffix == '.npz' else 'lines'
                yield Figure(
                    benchmark='import_files',
                    name=f'{file.suffix}, {lines:,} {rows}{", simplify" if tolerance else ""}',
                    value=taken,
                    unit='s',
                )


def convert(file: Path, options: ImportOptions) -> str:
    """Return the text of the goal file for an imported file."""
    return goal_text(fields_of_goal(import_file(file, options).goal, packed=True))


def spiral(lines: int) -> list[list[float]]:
    """Return ``lines`` points of a spiral [mm]."""
    t = np.linspace(0.0, 0.006 * np.pi * lines, lines)
    points: list[list[float]] = np.stack(
        (50.0 * np.cos(t), 50.0 * np.sin(t), 0.02 * t), axis=1
    ).tolist()
    return points


def record_spiral(folder: Path, packets: int) -> None:
    """Write a recording of an arm that follows the spiral."""
    sys.path.insert(0, str(Path(__file__).resolve().parents[1] / 'test' / 'support'))
    from synthetic_recording import packet, record

    from ur_cartesian_driver.motion.geometry.pose import Pose

    here = packet(0)  # type: ignore[no-untyped-call]  # tests have no types
    record(  # type: ignore[no-untyped-call]
        folder,
        [
            replace(here, timestamp=0.002 * i, actual_tcp_pose=Pose((x / 1e3, y / 1e3, z / 1e3)))
            for i, (x, y, z) in enumerate(spiral(packets))
        ],
    )


def texts(lines: int) -> dict[str, str]:
    """Return the texts of files with the spiral, of about ``lines`` lines each, by file name."""
    points = spiral(lines)
    found = {
        'spiral.csv': 'x [mm],y [mm],z [mm],nx,ny,nz\n'
        + '\n'.join(f'{x:.4f},{y:.4f},{z:.4f},0,0,1' for x, y, z in points),
        'spiral.nc': 'G21 G90\n'
        + '\n'.join(f'G1 X{x:.4f} Y{y:.4f} Z{z:.4f} F600' for x, y, z in points),
        'spiral.yaml': 'poses:\n'
        + ''.join(POSE.format(*(value / 1e3 for value in p)) for p in points[: lines // 10]),
        'spiral.script': 'movej([0, -1.57, 1.57, -1.57, -1.57, 0])\np = get_actual_tcp_pose()\n'
        + '\n'.join(
            f'movel(pose_add(p, p[{x / 1e3:.6f}, {y / 1e3:.6f}, {z / 1e3:.6f}, 0, 0, 0]))'
            for x, y, z in points
        ),
    }
    vertices = '\n'.join(
        f'0\nVERTEX\n8\n0\n10\n{x:.4f}\n20\n{y:.4f}' for x, y, _ in points[: lines // 8]
    )
    found['spiral.dxf'] = (
        '0\nSECTION\n2\nENTITIES\n0\nPOLYLINE\n8\n0\n66\n1\n' + vertices
    ) + '\n0\nSEQEND\n0\nENDSEC\n0\nEOF\n'
    return found
