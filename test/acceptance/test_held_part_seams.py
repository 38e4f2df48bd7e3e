# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Seams on a part in the hand that are woven, or come from the files of other programs.

The simulated robot leads them in virtual time; pinocchio sees the tool from the part.
"""

from curve_distance import arc_points, distances
from dxf_text import drawing
from held_part_bench import Bench, BESIDE, FRAME, PRIMITIVES, SPLINE, START, URDF
import numpy as np
import pytest
from robot_cell import run_cell

from ur_cartesian_driver.cli import main
from ur_cartesian_driver.motion.errors import ErrorCode
from ur_cartesian_driver.motion.geometry.pose import Pose
from ur_cartesian_driver.path import Frames, Path, StaticFrame

pytest.importorskip('pinocchio')
pytestmark = [pytest.mark.acceptance, pytest.mark.slow]

FRAMES = Frames(
    static_frames=(
        StaticFrame('part', 'tool0', FRAME.T_flange_frame),
        StaticFrame('belt', 'base', FRAME.T_base_tool),
    )
)
CORNER = 1e-4
SPEED, AMPLITUDE, WAVES = 0.02, 0.003, 6


def led(goal):
    """Return where the tool was on the part (n, 3) while the robot carried out a goal."""

    async def body(cell):
        bench = await Bench(cell).connect()
        outcome = await bench.end(await bench.begin(goal))
        assert outcome.code is ErrorCode.SUCCESSFUL, outcome
        return bench.made, bench.readings()[0]

    return run_cell(body)


def test_a_weave_swings_across_its_seam_on_the_part():
    length = 0.06
    end = START @ Pose((length, 0.0, 0.0))
    path = Path(START, frame='part', tool='belt').at(speed=SPEED, acceleration=0.2).line(end)
    made, places = led(path.weave(amplitude=AMPLITUDE, wavelength=length / WAVES).goal(FRAMES))
    assert made.execution is SPLINE
    along, across, off = ((places - START.position) @ START.matrix()[:3, :3]).T
    assert np.abs(off).max() < 1e-4
    assert along[-1] == pytest.approx(length, abs=1e-4)
    assert np.diff(along).min() > -1e-5
    # Waves as drawn by the sine of the tests; eight points of a spline are on each.
    drawn = AMPLITUDE * np.sin(2.0 * np.pi * WAVES * along / length)
    inner = (along > length / WAVES) & (along < length - length / WAVES)
    assert np.abs(np.abs(across) - np.abs(drawn))[inner].max() < 0.05 * AMPLITUDE
    assert np.abs(across).max() == pytest.approx(AMPLITUDE, rel=0.02)


#: In the plane of the file [mm]: a line, a quarter of a circle, and a line.
BEFORE, AFTER = np.array([[0.0, 0.0], [30.0, 0.0]]), np.array([[40.0, 10.0], [40.0, 30.0]])
TURN = np.array([[30.0, 0.0], [37.0710678, 2.9289322], [40.0, 10.0]])
FILES = {
    'seam.nc': 'G21 G90 G17\nG1 X0 Y0 Z0 F1800\nG1 X30\nG3 X40 Y10 I0 J10\nG1 Y30\nM2\n',
    'seam.dxf': drawing(
        'LINE 8 0 10 0 20 0 11 30 21 0',
        'ARC 8 0 10 30 20 10 40 10 50 270 51 0',
        'LINE 8 0 10 40 20 10 11 40 21 30',
    ),
    'seam.csv': 'x [mm],y [mm],z [mm]\n0,0,0\n30,0,0\n40,10,0\n40,30,0\n',
}


def drawn(name):
    """Return the places (n, 3) on the part along which a file leads [m]."""
    turn = TURN[[0, 2]] if name.endswith('csv') else arc_points(*map(_in_space, TURN))[:, :2]
    plane = np.vstack([BEFORE, turn, AFTER])
    plane = plane[np.append(True, np.linalg.norm(np.diff(plane, axis=0), axis=1) > 1e-9)]
    # The file's z points out of the part, and the tool down: x of the tool along y of the file.
    x, y = START.matrix()[:3, 1], START.matrix()[:3, 0]
    return START.position + 1e-3 * (plane[:, :1] * x + plane[:, 1:] * y)


def _in_space(place):
    return np.append(place, 0.0)


@pytest.mark.parametrize('name', FILES)
@pytest.mark.parametrize('corner', ['', f'--corner={1e3 * CORNER}mm'])
def test_the_seam_of_a_file_is_led_on_the_part(tmp_path, name, corner):
    (tmp_path / name).write_text(FILES[name])
    s = 0.5**0.5
    origin = (START @ Pose((0.0,) * 3, (s, s, 0.0, 0.0)).inverse()).rotation_vector()
    found = tmp_path / 'seam.yaml'
    assert not main(
        [
            *('import', str(tmp_path / name), '-o', str(found), '--frame=part', '--tool=belt'),
            *(
                f'--origin={",".join(map(repr, origin))}',
                '--speed=0.03',
                *([corner] * bool(corner)),
            ),
        ]
    )
    goal = Path.load(found).goal(FRAMES)
    made, places = led(goal)
    assert made.execution is (SPLINE if corner else PRIMITIVES)
    path = drawn(name)
    off = CORNER if corner else 0.0
    assert distances(places, [path]).max() < off + BESIDE[SPLINE] + 1e-5
    for place in path:
        assert np.linalg.norm(places - place, axis=1).min() < off + 3e-4
    end = URDF.relative('tool', 'part', np.array([made.segments[-1].joints]))[0]
    assert end[:3, 3] == pytest.approx(path[-1], abs=1e-5)
