# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Programs as slicers, CAM systems and controllers write them; the files are imitations."""

from pathlib import Path

from gcode_programs import positions, remarks, switched
import pytest

from ur_cartesian_driver.importing import (
    BrokenFile,
    import_file,
    ImportOptions,
    parse_code_output,
)

FILES = Path(__file__).parent / 'files' / 'gcode'
NONE: tuple[str, ...] = ()
SPINDLE = ('M3=standard:0:1', 'M4=standard:0:1', 'M5=standard:1:1', 'S=analog:1:30000')
LASER = ('S=analog:1:1000',)
TORCH = ('M3=standard:0:1', 'M5=standard:1:1')
WATER = ('M7=standard:0:1', 'M9=standard:1:1')
PEN_OF_GRBL = ('M3 S30=standard:1:1', 'M3 S90=standard:0:1', 'M5=standard:1:1')
PEN_OF_MARLIN = ('M280 S40=standard:1:1', 'M280 S90=standard:0:1')

#: Outputs; number of points, least and largest coordinates [mm]; waypoint and value of each
#: output, which is on, off, or the power of S.
READ = {
    'carbide_create.nc': (
        SPINDLE,
        7,
        (20.0, -55.0, -1.0),
        (50.0, -20.0, 12.7),
        [(0, 'off'), (0, 0.6), (0, 'on'), (6, 0.0), (6, 'off')],
    ),
    'cura_ender3.gcode': (NONE, 15, (0.0, 20.0, 0.2), (125.0, 220.0, 10.4), []),
    'edm_wire.nc': (NONE, 6, (0.0, 0.0, 0.0), (10.0, 15.0, 0.0), []),
    'estlcam.nc': (
        SPINDLE,
        10,
        (-1.5, 0.0, -1.0),
        (31.5, 21.5, 5.0),
        [(0, 0.8), (0, 'on'), (9, 0.0), (9, 'off')],
    ),
    'freecad_grbl.gcode': (
        SPINDLE,
        7,
        (5.0, 5.0, -0.5),
        (15.0, 15.0, 5.0),
        [(0, 0.3333), (0, 'on'), (6, 0.0), (6, 'off')],
    ),
    'freecad_linuxcnc.ngc': (
        SPINDLE,
        7,
        (-2.5, 0.0, -1.0),
        (20.0, 22.5, 5.0),
        [(0, 'off'), (0, 0.4), (0, 'on'), (6, 0.0), (6, 'off')],
    ),
    'fusion_fanuc.nc': (
        SPINDLE,
        8,
        (7.5, -2.5, -3.0),
        (40.0, 7.5, 10.0),
        [(0, 0.2667), (0, 'on'), (7, 0.0), (7, 'off')],
    ),
    'fusion_grbl.nc': (
        SPINDLE,
        13,
        (-3.0, 0.0, -2.0),
        (30.0, 35.0, 15.0),
        [(0, 0.6), (0, 'on'), (12, 0.0), (12, 'off')],
    ),
    'fusion_haas.nc': (
        SPINDLE,
        10,
        (-34.0, -2.0, -1.0),
        (35.0, 6.0, 15.0),
        [(0, 0.1167), (0, 'on'), (9, 0.0), (9, 'off')],
    ),
    'fusion_linuxcnc.ngc': (
        SPINDLE,
        54,
        (10.0, 5.0, -2.0),
        (20.0, 15.0, 15.0),
        [(0, 0.1667), (0, 'on'), (53, 0.0), (53, 'off')],
    ),
    'fusion_mach3.tap': (
        SPINDLE,
        7,
        (12.7, -25.4, -1.27),
        (50.8, 6.35, 15.24),
        [(0, 'off'), (0, 0.3333), (0, 'on'), (6, 0.0), (6, 'off')],
    ),
    'gcodetools.ngc': (TORCH, 7, (0.0, 0.0, -0.125), (40.0, 30.0, 5.0), [(0, 'on'), (5, 'off')]),
    'hsmxpress.nc': (
        SPINDLE,
        8,
        (-12.0, -12.0, -2.0),
        (12.0, 12.0, 15.0),
        [(0, 0.0833), (0, 'on'), (7, 0.0), (7, 'off')],
    ),
    'jscut.gcode': (NONE, 8, (12.7, -25.4, -3.175), (38.1, -12.7, 25.4), []),
    'kisslicer.gcode': (NONE, 5, (20.0, 20.0, 0.25), (60.0, 45.0, 0.25), []),
    'lasergrbl.nc': (
        LASER,
        8,
        (0.0, 0.0, 0.0),
        (25.0, 5.1, 0.0),
        [(0, 0.0), (0, 0.128), (1, 0.255), (2, 0.064), (3, 0.0), (4, 0.255), (5, 0.0)],
    ),
    'lathe_fanuc.nc': (
        SPINDLE,
        9,
        (40.0, 0.0, -20.0),
        (80.0, 0.0, 20.0),
        [(0, 'on'), (8, 0.0167), (8, 0.0), (8, 'off')],
    ),
    'lathe_linuxcnc.ngc': (
        SPINDLE,
        11,
        (15.0, 0.0, -22.0),
        (30.0, 0.0, 20.0),
        [(0, 0.0267), (0, 'on'), (10, 0.0), (10, 'off')],
    ),
    'lightburn.gc': (LASER, 6, (0.0, 0.0, 0.0), (40.0, 30.0, 0.0), [(0, 0.4), (4, 0.0)]),
    'mastercam_contour.nc': (
        SPINDLE,
        7,
        (-5.0, 0.0, -2.0),
        (50.0, 40.0, 25.0),
        [(0, 0.1333), (0, 'on'), (6, 0.0), (6, 'off')],
    ),
    'orcaslicer_p1s.gcode': (NONE, 7, (118.0, 118.0, 0.2), (148.0, 138.0, 0.6), []),
    'plasma.tap': (
        TORCH,
        8,
        (20.0, 30.0, 1.5),
        (90.0, 50.0, 10.0),
        [(0, 'off'), (1, 'on'), (6, 'off')],
    ),
    'plotter_grbl.gcode': (
        PEN_OF_GRBL,
        4,
        (0.0, 0.0, 0.0),
        (40.0, 30.0, 0.0),
        [(0, 'off'), (0, 'on'), (2, 'off'), (3, 'off')],
    ),
    'plotter_m280.gcode': (
        PEN_OF_MARLIN,
        7,
        (0.0, 0.0, 0.0),
        (80.0, 40.0, 0.0),
        [(0, 'off'), (0, 'on'), (3, 'off'), (4, 'on'), (5, 'off')],
    ),
    'prusaslicer_mk3s.gcode': (NONE, 10, (60.0, -3.0, 0.2), (135.0, 115.0, 0.4), []),
    'pycam.ngc': (
        SPINDLE,
        7,
        (0.0, 0.0, -1.0),
        (30.0, 4.0, 25.0),
        [(0, 0.0333), (0, 'on'), (6, 0.0), (6, 'off')],
    ),
    'simplify3d.gcode': (NONE, 5, (92.0, 92.0, 0.18), (108.0, 108.0, 0.18), []),
    'sinumerik_iso.mpf': (
        SPINDLE,
        6,
        (0.0, 0.0, -2.0),
        (60.0, 34.142, 10.0),
        [(0, 0.1), (0, 'on'), (5, 0.0), (5, 'off')],
    ),
    'slic3r_klipper.gcode': (NONE, 5, (90.0, 90.0, 0.25), (110.0, 110.0, 0.25), []),
    'solidcam_subs.nc': (
        SPINDLE,
        32,
        (0.0, 0.0, -1.0),
        (10.0, 10.0, 20.0),
        [(0, 0.2), (0, 'on'), (31, 0.0), (31, 'off')],
    ),
    'vcarve_mm.tap': (
        SPINDLE,
        10,
        (0.0, 0.0, -1.5),
        (70.0, 50.0, 20.32),
        [(0, 0.4), (0, 'on'), (9, 0.0), (9, 'off')],
    ),
    'waterjet.nc': (WATER, 8, (0.0, 0.0, 0.0), (76.2, 50.8, 0.0), [(1, 'on'), (6, 'off')]),
}
#: What users have to know of them.
SAID = {
    'prusaslicer_mk3s.gcode': (
        'line 12: M862.3: a command of a printer',
        'line 14: M115: a command of a printer',
        'lines 9-10: M205: a command of a printer',
        'line 24: a move: the position in X is not known since line 21',
        'line 59: M84: a command of a printer',
    ),
    'cura_ender3.gcode': ('line 16: a move: the position in X and Y is not known since line 15',),
    'orcaslicer_p1s.gcode': (
        'lines 15-16, 40: M1002: a message, or the name of a file',
        'line 34: M970.3: a command of a printer',
        'lines 42-43, 46: a line under a condition: whether its condition holds is not known',
        'lines 55-56: M486: a message, or the name of a file',
        'line 26: a move: the position in X and Y is not known since line 24',
    ),
    'slic3r_klipper.gcode': (
        'line 2: EXCLUDE_OBJECT_DEFINE: a command of a printer',
        'line 23: PAUSE: a command or a macro whose moves are not in the file',
    ),
    'simplify3d.gcode': ('line 14: word T: tools are not changed',),
    'fusion_fanuc.nc': (
        'lines 13, 20: G5.1: the robot looks ahead by itself',
        'lines 5, 23-24: G28: the place of the machine to which it goes is not known',
        'line 14: a move: the position in Z is not known since line 5',
    ),
    'fusion_linuxcnc.ngc': ('lines 17-18: G3 with a rise: a helix, made of 23 lines',),
    'lathe_fanuc.nc': (
        'line 6: G50: no spindle is to be limited',
        'X of a lathe: a radius, because there is no G7',
        'lines 9, 14: word F: after G99 a lathe gives it per turn, so it is no speed',
        'no Y in the file: Y is 0',
    ),
    'edm_wire.nc': (
        'lines 8-12: word U: there is no such axis; the option orientation turns the tool',
        'line 5: G92 before a motion in XY: the program begins there',
    ),
    'mastercam_contour.nc': (
        'line 8: word A: there is no such axis; the option orientation turns the tool',
    ),
    'plasma.tap': ('line 10: G4: its P is seconds on some controls, milliseconds on others',),
    'plotter_m280.gcode': (
        'lines 8, 13, 16: G4: its P is seconds on some controls, milliseconds on others',
    ),
    'waterjet.nc': ('line 5: M0: the path does not wait',),
}
REFUSED = {
    'heidenhain_iso.nc': "line 3: 'N10 G30 G17 X+0 Y+0 Z-20 *' is no G-code.",
    'linuxcnc_words.ngc': (
        "line 3: '#100 = 5' has #, which is not read: let the CAM write the program out."
    ),
    'mastercam_drill.nc': 'line 8: G83 is not read: a cycle; let the CAM write single moves.',
    'sinumerik_840d.mpf': (
        'line 4: \'N20 T="MILL_10" D1\' has =, which is not read: '
        'let the CAM write the program out.'
    ),
}


def found_in(name):
    outputs = READ[name][0] if name in READ else SPINDLE
    codes = dict(map(parse_code_output, outputs))
    return import_file(FILES / name, ImportOptions(outputs=codes))


def test_each_file_is_judged_and_says_that_it_is_an_imitation():
    names = sorted(file.name for file in FILES.iterdir())
    assert names == sorted({**READ, **REFUSED})
    assert len(names) >= 30
    for name in names:
        assert 'imitation' in (FILES / name).read_text().lower(), name


@pytest.mark.parametrize('name', READ)
def test_a_program_has_its_points_and_outputs(name):
    _, count, least, most, outputs = READ[name]
    found = found_in(name)
    points = positions(found)
    assert len(points) == count
    assert points.min(axis=0) == pytest.approx(least, abs=1e-3)
    assert points.max(axis=0) == pytest.approx(most, abs=1e-3)
    commands = found.goal.io_commands
    assert [
        (row, value if 'ANALOG' in command.output.name else ('on', 'off')[pin])
        for command, (row, pin, value) in zip(commands, switched(found), strict=True)
    ] == outputs


@pytest.mark.parametrize('name', SAID)
def test_a_program_has_its_remarks(name):
    said = remarks(found_in(name))
    assert [text for text in SAID[name] if text not in said] == []


@pytest.mark.parametrize('name', REFUSED)
def test_a_program_is_refused_in_a_sentence(name):
    with pytest.raises(BrokenFile) as caught:
        found_in(name)
    assert str(caught.value) == REFUSED[name]
