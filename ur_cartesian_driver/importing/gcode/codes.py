# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The table of codes and words: the treatment of each, and the words that belong to a code.

Sources: RS274/NGC (NIST IR 6556) and the G-code pages of LinuxCNC 2.9; the lists of commands of
GRBL 1.1, Marlin, RepRapFirmware, Klipper, Prusa, Bambu, MakerBot and Ultimaker; Fanuc's codes for
mills and lathes.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from enum import IntEnum
from functools import lru_cache, partial
from typing import Any

from ur_cartesian_driver.importing.import_format import Term, term_table, Treatment


class Stage(IntEnum):
    """The stages in which the codes of a line act, in the order of RS274/NGC."""

    MODE = 0
    OUTPUT = 1
    OFFSET = 2
    MOTION = 3
    END = 4


@dataclass(frozen=True, slots=True, kw_only=True)
class Code(Term):
    """A row of the table: a code, a word that is no code, or another form of a line."""

    #: The letters of the words that belong to the code.
    words: str = ''
    stage: Stage = Stage.MODE
    #: The group of the code: codes of one group exclude each other on a line; empty = none.
    group: str = ''
    #: The letters that may stand without a number on the line of the code, as in ``G28 X``.
    bare: str = ''
    #: Whether the code owns its line, so that everything after it is an argument, word or not.
    alone: bool = False
    #: Whether a text follows, such as a message or the name of a file, which has no words.
    text: bool = False
    #: Whether the tool position is unknown after the code, such as after a move to a machine
    #: position.
    moves_away: bool = False


def _rows(
    treatment: Treatment, topic: str, reason: str, *names: str, **fields: Any
) -> tuple[Code, ...]:
    return tuple(
        Code(name=name, topic=topic, treatment=treatment, reason=reason, **fields)
        for name in names
    )


_honoured = partial(_rows, Treatment.HONOURED)
_left_out = partial(_rows, Treatment.LEFT_OUT)
_refused = partial(_rows, Treatment.REFUSED)


def _numbers(letter: str, *ranges: int | tuple[int, int]) -> tuple[str, ...]:
    """Return the names of codes with a letter; a pair means all numbers from first to last."""
    return tuple(
        f'{letter}{number}'
        for each in ranges
        for number in (range(each[0], each[1] + 1) if isinstance(each, tuple) else (each,))
    )


_AXES = 'XYZABCUVW'
_NO_AXIS = 'there is no such axis; the option orientation turns the tool'
_HOME = 'the place of the machine to which it goes is not known'
_NO_TOOLS = 'tools are not changed'
_NO_EXTRUDER = 'there is no extruder'
_IN_TCP = 'the length of the tool is in the active TCP'
#: The group of the codes that say whether corners may be rounded.
PATH_CONTROL = 'path control'
NO_OUTPUT = 'no output is given for it'
_PRINTER = 'a command of a printer'
_CYCLE = 'a cycle; let the CAM write single moves'
_THREAD = 'a thread needs a spindle that is measured'
_NO_WAIT = 'the path does not wait'
_FLOW = 'let the CAM write the program out'
_TEXT = 'a message, or the name of a file'
OTHER_FILE = 'other files are not read'
#: First parts of the names of Klipper's commands that do not move the tool.
_HARMLESS = (
    *('SET_', 'EXCLUDE_', 'TIMELAPSE_', 'TURN_OFF_', 'SAVE_GCODE_STATE', 'BED_MESH_PROFILE'),
    *('BED_MESH_CLEAR', 'TEMPERATURE_WAIT', 'UPDATE_DELAYED_GCODE'),
)

#: Names of the rows for printers with several heads, by first letter: T takes a head, P parks it.
TOOLS_OF_PRINTER = {'T': 'T S L', 'P': 'P S'}

_MOTION = (
    _honoured('motion', '', 'G0', 'G1', 'G2', 'G3', group='motion', stage=Stage.MOTION),
    _honoured('motion', '', 'G80', 'X', 'Y', 'Z', 'I', 'J', 'K', 'R', 'P', 'F'),
    _left_out(
        'motion', 'its P is seconds on some controls, milliseconds on others', 'G4', words='PSXUF'
    ),
    _honoured('motion', '', 'G61', 'G61.1', group=PATH_CONTROL),
    _honoured('motion', '', 'G64 P', words='PQ', group=PATH_CONTROL),
    _left_out(
        'motion',
        'without P it bounds nothing; the option corner does',
        'G64',
        words='PQ',
        group=PATH_CONTROL,
    ),
    _left_out(
        'motion', 'the option simplify merges points', 'G64 Q', words='PQ', group=PATH_CONTROL
    ),
    _left_out('motion', 'the options blend and corner say where the tool stops', 'G9', words='PQ'),
    _left_out(
        'motion',
        'the robot looks ahead by itself',
        *('G5 P', 'G5.1 Q', 'G8 P', 'G103', 'G187'),
        words='EPQR',
    ),
    _left_out('motion', _NO_AXIS, 'A', 'B', 'C', 'U', 'V'),
    _left_out('motion', _NO_EXTRUDER, 'E'),
    _refused('motion', 'on a lathe it is a step along X or Z; write these', 'W'),
    _refused(
        'motion',
        'splines; let the CAM write lines or arcs',
        *('G5', 'G5.1', 'G5.2', 'G5.3', 'G6', 'G6.2'),
    ),
    _refused('motion', _CYCLE, 'G12', 'G13', *_numbers('G', (72, 76), (81, 89))),
    _refused('motion', f'{_CYCLE}; or inches: write G20', 'G70'),
    _refused('motion', f'{_CYCLE}; or millimetres: write G21', 'G71'),
    _refused('motion', _THREAD, 'G33', 'G33.1', 'G35', 'G36'),
    _refused('motion', 'it rounds or chamfers a corner; let the CAM write arcs', ',R', ',C'),
    _refused('motion', _THREAD, 'G32 X', 'G32 Z', 'G34 X', 'G34 Z'),
    _refused(
        'motion',
        'where a probing move ends is not known',
        *('G31', 'G38.2', 'G38.3', 'G38.4', 'G38.5'),
    ),
)
_MODES = (
    _honoured('modes', '', 'G17', 'G18', 'G19', group='plane'),
    _honoured('modes', '', 'G20', 'G21', group='unit'),
    _honoured('modes', '', 'G90', 'G91', group='distance'),
    _honoured('modes', '', 'G90.1', 'G91.1', group='distance of centres'),
    _honoured('modes', '', 'G7', 'G8', group='diameter'),
    _honoured('modes', '', 'G94', group='feed'),
    _honoured('modes', '', 'G98', 'G99', group='return'),
    _honoured('modes', '', 'G13.1', 'G15', 'G23', 'G40', 'G40.1', 'G49', 'G50', 'G50.1'),
    _honoured('modes', '', 'G67', 'G69', 'G97'),
    _refused('modes', 'give feeds in lengths per minute (G94)', 'G93', 'G95'),
    _refused('modes', 'polar coordinates', 'G12.1', 'G16'),
    _refused('modes', 'a cylinder as the plane', 'G7.1', 'G107'),
    _refused(
        'modes', 'cutter compensation; let the CAM compensate', 'G41', 'G41.1', 'G42', 'G42.1'
    ),
    _refused(
        'modes',
        'a turned, scaled or mirrored frame; use the options frame, origin and scale',
        *('G51', 'G51.1', 'G68', 'G68.2'),
    ),
)
_OFFSETS = (
    _honoured('offsets', '', 'G52', 'G92', words=_AXES + 'E', stage=Stage.OFFSET, group='offset'),
    _honoured('offsets', '', 'G92.1', 'G92.2', 'G92.3', stage=Stage.OFFSET, group='offset'),
    _honoured('offsets', '', *_numbers('G', (54, 59)), words='P', group='frame'),
    _honoured('offsets', '', 'G54.1', 'G59.1', 'G59.2', 'G59.3', 'G154', words='P', group='frame'),
    _honoured('offsets', '', 'G10 L20', words=_AXES + 'LP', stage=Stage.OFFSET, group='offset'),
    _left_out(
        'offsets',
        'the frame of the goal takes its place',
        'G10 L2',
        words=_AXES + 'LPR',
        stage=Stage.OFFSET,
        group='offset',
    ),
    _left_out(
        'offsets',
        _HOME,
        *('G28', 'G30'),
        words=_AXES + 'EIJKLOPRSH',
        bare=_AXES + 'EIJKLOPRSH',
        stage=Stage.OFFSET,
        moves_away=True,
    ),
    _left_out('offsets', _HOME, 'G53', words=_AXES, stage=Stage.OFFSET, moves_away=True),
    _left_out('offsets', 'the path does not go there', 'G28.1', 'G30.1', words=_AXES),
    _left_out('offsets', _IN_TCP, 'G43', 'G44', words='H'),
    _left_out('offsets', _IN_TCP, 'G43.1', 'G43.2', words=_AXES + 'HIK'),
    _refused('offsets', 'rotary axes would turn the tool', 'G43.4', 'G43.5'),
    _refused('offsets', 'on a lathe it sets coordinates; write G92', 'G50 X', 'G50 Z'),
    _refused(
        'offsets', 'on an Okuma it is the work offset; leave it out, with one in the file', 'G15 H'
    ),
)
_OUTPUTS = (
    _honoured(
        'outputs',
        '',
        *('M3', 'M4', 'M5'),
        words='O',
        bare='I',
        stage=Stage.OUTPUT,
        group='spindle',
    ),
    _honoured('outputs', '', 'S'),
    _honoured('outputs', '', 'M7', 'M8', 'M9', stage=Stage.OUTPUT),
    _left_out('outputs', NO_OUTPUT, *_numbers('M', (62, 65)), words='P', stage=Stage.OUTPUT),
    _left_out('outputs', NO_OUTPUT, 'M67', 'M68', words='EQ', stage=Stage.OUTPUT),
    _left_out('outputs', NO_OUTPUT, 'other M-codes', words='PQ', stage=Stage.OUTPUT),
    _left_out('outputs', 'a surface speed needs a spindle', 'G96', words='SD'),
    _left_out('outputs', 'no spindle is to be limited', 'G50 S', 'G92 S', words='SPQ'),
    _left_out('outputs', 'no spindle is to be turned', 'M19', words='RPQS'),
)
_TOOLS = (
    _left_out('tools', _NO_TOOLS, 'T'),
    _left_out('tools', _NO_TOOLS, 'TX', 'TC', 'T?'),
    _left_out('tools', _NO_TOOLS, 'M6', words='HDPQ', stage=Stage.OUTPUT),
    _left_out('tools', _NO_TOOLS, 'M61', words='Q'),
    _left_out('tools', 'there is no table of tools', 'D', 'H'),
    _left_out(
        'tools',
        'there is no table of tools',
        *('G10 L0', 'G10 L1', 'G10 L10', 'G10 L11'),
        words=_AXES + 'LPRIJQ',
    ),
    _left_out('tools', _NO_EXTRUDER, 'G10', 'G11', words=_AXES + 'PRS'),
)
_PROGRAM = (
    _honoured('program', '', 'M2', 'M30', words='P', stage=Stage.END, group='end'),
    _honoured('program', '', 'M98', words='PLHQ', stage=Stage.END),
    _honoured('program', '', 'M99', words='PLQ', stage=Stage.END),
    _honoured('program', '', 'O', words='O'),
    _honoured('program', '', '%', 'N', '( )', ';', '*'),
    _left_out('program', 'the name of a program', '< >'),
    _left_out('program', 'a line that is skipped on request', '/'),
    _left_out('program', _NO_WAIT, 'M0', 'M1', words='PS', alone=True),
    _left_out('program', _NO_WAIT, 'M60', words='PS'),
    _left_out('program', _NO_WAIT, 'M66', words='PELQ'),
    _left_out(
        'program', 'the robot has overrides of its own', *_numbers('M', (48, 53)), words='P'
    ),
    _left_out('program', 'a message', '(MSG,', '(DEBUG,', '(PRINT,', '(LOG,'),
    _left_out('program', 'a setting of GRBL', '$'),
    _left_out('program', _HOME, '$H', moves_away=True),
    _refused('program', 'a command of GRBL that moves', '$J'),
    _refused('program', _FLOW, '#', '[', '=', 'o-word', 'G65', 'G66', 'M96', 'M97'),
    _refused('program', _FLOW, 'IF', 'WHILE', 'GOTO'),
    _refused('program', 'it restores modes', *_numbers('M', (70, 73))),
    _refused('program', OTHER_FILE, 'M198'),
)
_PRINTERS = (
    _left_out(
        'printers',
        _HOME,
        *('G27', 'G29', 'G32', 'G34', 'G39', 'G80 H', 'G80 W', 'G150', 'G161', 'G162', 'G280'),
        *('G380', 'G382', 'G383', 'G425', 'M125'),
        words='XYZABCDEFHIJKLNOPQRSTUVW',
        bare='XYZABCDEFHIJKLNOPQRSTUVW',
        stage=Stage.OFFSET,
        moves_away=True,
    ),
    _left_out('printers', _PRINTER, 'G29.1', 'G29.2', 'G29.4', 'G392', words='XYZFPS'),
    _left_out(
        'printers',
        'where its tools are parked is not known',
        *TOOLS_OF_PRINTER.values(),
        stage=Stage.OFFSET,
        moves_away=True,
    ),
    _left_out('printers', OTHER_FILE, 'M98 P"', stage=Stage.OFFSET, moves_away=True),
    _left_out(
        'printers', 'whether its condition holds is not known', 'M622', alone=True, moves_away=True
    ),
    _left_out(
        'printers', _PRINTER, 'M73 L', 'M73 P', 'M73 Q', 'M73 R', 'M73.2', 'M622.1', alone=True
    ),
    _left_out(
        'printers',
        _PRINTER,
        *_numbers('M', (16, 18), (20, 22), (24, 27), 29, 31, 34, (42, 47), (74, 87), 92, 93),
        *_numbers('M', (100, 116), (119, 123), (126, 146), (149, 155), 160, (163, 170)),
        *_numbers('M', (190, 193), (200, 211), (217, 222), (226, 233), 240, 245, 246, 250),
        *_numbers('M', (255, 263), (280, 282), 290, (300, 310), 350, 351, 355, (360, 381)),
        *_numbers('M', (400, 430), (450, 453), (493, 495), (500, 505), (510, 512), 524),
        *_numbers('M', (530, 540), (554, 586), (588, 599), (600, 621), (623, 641), (650, 675)),
        *_numbers('M', (701, 710), (750, 758), 808, 809, 820, 851, 852, (860, 876)),
        *_numbers('M', (900, 921), 951, (960, 999), (1003, 1012), 7219, 9833),
        alone=True,
        stage=Stage.OUTPUT,
    ),
    _left_out(
        'printers',
        _TEXT,
        *_numbers('M', 23, 28, 32, 33, 36, 117, 118, 291, 292, 472, 486, (550, 553), 587),
        *_numbers('M', (810, 819), 928, 929, 1002),
        'M30.1',
        alone=True,
        text=True,
    ),
    _left_out('printers', _PRINTER, *_HARMLESS, 'BEEP', 'RESPOND', 'RESTART', 'STATUS'),
    _left_out(
        'printers',
        'a command or a macro whose moves are not in the file',
        *('other names with _', 'SET_KINEMATIC_POSITION', 'SET_GCODE_OFFSET'),
        *('CANCEL', 'PARK', 'PAUSE', 'PURGE', 'RESUME'),
        moves_away=True,
    ),
    _refused('printers', 'it restores modes', 'RESTORE_GCODE_STATE'),
)

#: Codes by name. If a word changes the meaning of a code, the name contains both: ``G10 L20``.
CODES: Mapping[str, Code] = term_table(
    *_MOTION, *_MODES, *_OFFSETS, *_OUTPUTS, *_TOOLS, *_PROGRAM, *_PRINTERS
)
_CHANGED_BY_WORDS = frozenset(name.split()[0] for name in CODES if name[0] in 'GM' and ' ' in name)


@lru_cache(maxsize=1024)
def code_named(name: str) -> Code | None:
    """Return the row of a code or name; None = not known. A printer's G29.5 has the row of G29."""
    row = CODES.get(name)
    if row is None and '.' in name:
        family = CODES.get(name.partition('.')[0])
        return family if family and family.topic == 'printers' else None
    # A name must have at least three letters, because X_5 is a broken word.
    is_name = '_' in name and sum(map(str.isalpha, name)) > 2
    if row is None and is_name:
        start = next(filter(name.startswith, _HARMLESS), 'other names with _')
        return CODES[start]
    return row


def code_on_line(name: str, words: Mapping[str, float], *, is_alone: bool) -> Code | None:
    """
    Return the row of a code, which can depend on the words of its line; None = not known.

    :param is_alone: whether the line has no other code.
    """
    if name in _CHANGED_BY_WORDS:
        if name == 'G10' and 'L' in words:
            return CODES.get(f'G10 L{words["L"]:g}')
        if (
            # With more words than P, G5 is a spline, and not the look-ahead of the row G5 P. In
            # G80 G43 H1, the H belongs to G43, and the row G80 H does not apply. With a
            # coordinate, G92 sets an offset, and not the speed limit of the row G92 S.
            (name == 'G5' and words.keys() != {'P'})
            or (name == 'G80' and not is_alone)
            or (name == 'G92' and not words.keys().isdisjoint('XYZ'))
        ):
            return CODES[name]
        # X and Z first: G50 X S900 is refused as G50 X, and not left out as G50 S.
        for letter in sorted(words, key=lambda letter: letter not in 'XZ'):
            if row := CODES.get(f'{name} {letter}'):
                return row
    row = code_named(name)
    return CODES['other M-codes'] if row is None and name[0] == 'M' else row
