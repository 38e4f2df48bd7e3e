# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The codes and words of a line of a program.

The grammar follows RS274/NGC: blanks and case have no meaning, numbers have no exponents, and each
letter except G and M occurs at most once in a line. Some commands of 3D printers have other forms;
they are recognised by the beginning of the line.
"""

from __future__ import annotations

from functools import lru_cache
import re
from typing import NamedTuple

from ur_cartesian_driver.importing.gcode.codes import (
    code_named,
    CODES,
    OTHER_FILE,
    TOOLS_OF_PRINTER,
)
from ur_cartesian_driver.importing.imported_path import BrokenFile
from ur_cartesian_driver.importing.text_file import quoted

#: Matches a comment.
COMMENT = re.compile(r'\([^()]*\)|;.*')
_MESSAGE = re.compile(r'\(\s*(MSG|DEBUG|PRINT|LOG)\s*,', re.I)
# Stands for each comment until it is checked that no comment divides a word. No text file has this
# character.
_MARK = '\0'
_DIVIDED_WORD = re.compile(rf'[A-Z]{_MARK}+[-+.0-9]|[-+.0-9]{_MARK}+[.0-9]')
# A float keeps fifteen digits, which is more than any length needs.
_NUMBER = r'[-+]?(?:[0-9]{1,15}(?:\.[0-9]*)?|\.[0-9]+)'
_WORD = re.compile(rf'([A-Z])({_NUMBER})')
_BLOCK = re.compile(rf'(?:[A-Z]{_NUMBER})+')
_WORDS_BEFORE = re.compile(rf'(?:[A-Z]{_NUMBER})*')
_BARE_LETTER = re.compile(r'[A-Z](?![-+.0-9])')
_LINE_NUMBER = re.compile(r'N-?[0-9]+(?:\.[0-9]+)?')
_CHECKSUM = re.compile(r'\*[0-9]+$')
# Matches a number with an exponent; not after G or M, because in G92E0 the E begins a word.
_EXPONENT = re.compile(r'[A-FH-LN-Z][ \t]*[-+]?[0-9.]+E[-+]?[0-9]+(?![0-9.])', re.I)
_M_CODE = re.compile(r'(?:N-?[0-9]+)?M([0-9]+(?:\.[0-9]+)?)')
_QUOTED = re.compile(r'"[^"]*"')
_NAME = re.compile(r'\s*([A-Za-z_]{2}\w*)')
_PROGRAM_NUMBER = re.compile(r'[O:]([0-9]{1,8})')
# Matches Fanuc's name of a program, which follows the program's number or replaces it.
_PROGRAM_NAME = re.compile(r'<[^<>]+>$')
# Matches the commands of TOOLS_OF_PRINTER. A T must have an L, because a CNC writes T1 S500, too.
_TOOL_OF_PRINTER = re.compile(r'(?:T[0-9]+S[01]L[0-2]|P[0-9]+S[01](?:L[0-2])?)(?:D[01])?')


class Block(NamedTuple):
    """The codes of a line in their order, and its other words by letter."""

    codes: list[str]
    words: dict[str, float]
    #: Letters without a number, such as the axes of G28 X Y.
    bare: str = ''


def read_line(number: int, line: str) -> Block | None:
    """
    Return the codes and words of a line; None = the line is empty or only a comment.

    For a line in another form, such as ``%``, the block has one code: the name under which the
    table of codes lists such lines.

    :param number: the number of the line, for error messages.
    :raises BrokenFile: the line is no G-code.
    """
    text = line
    if ';' in line or '(' in line:
        text = COMMENT.sub(_MARK, line)
    text = text.replace(' ', '').replace('\t', '')
    # Only ASCII: upper() would turn some other letters, such as the long s, into ASCII capitals.
    text = text.upper() if text.isascii() else text
    if not text:
        return None
    if _MARK in text:
        plain = text.replace(_MARK, '')
        if _DIVIDED_WORD.search(text) and not _is_one_command(line, plain):
            raise BrokenFile(number, 'a comment divides a word')
        text = plain
        if message := _MESSAGE.search(line):
            block = _block(number, line, text) if text else Block([], {})
            return block._replace(codes=[*block.codes, f'({message[1].upper()},'])
        if not text:
            return None
    return _block(number, line, text)


def _block(number: int, line: str, text: str) -> Block:
    if text[:1] in ('M', 'N'):
        if (name := _printer_code(text)) is not None:
            return Block([name], {})
        text = _LINE_NUMBER.sub('', text, count=1) if text[0] == 'N' else text
    if text[:1] in ('T', 'P') and _TOOL_OF_PRINTER.fullmatch(text):
        return Block([TOOLS_OF_PRINTER[text[0]]], {})
    if _BLOCK.fullmatch(text) is None or text[0] == 'O':
        return _odd_block(number, line, text)
    # Without a blank before it, the E of an extruder could also be an exponent.
    if 'E' in text and _EXPONENT.search(line) and _EXPONENT.search(COMMENT.sub('', line)):
        raise BrokenFile(
            number,
            f'{_shown(line)} has an exponent, which G-code has not; the word of an extruder '
            'needs a blank before',
        )
    codes: list[str] = []
    words: dict[str, float] = {}
    for letter, value in _WORD.findall(text):
        if letter in 'GM':
            codes.append(_code_name(letter, value))
        elif letter in words:
            raise BrokenFile(number, f'{letter} is there twice')
        else:
            words[letter] = float(value)
    return Block(codes, words)


@lru_cache(maxsize=1024)
def _code_name(letter: str, value: str) -> str:
    """Return the name of a code, for example G1 for ``G01`` and for ``G1.``."""
    return f'{letter}{float(value):.15g}'


def _printer_code(text: str) -> str | None:
    """Return the M-code of a line whose other text is not to be read as words, else None."""
    match = _M_CODE.match(text)
    entry = code_named(name := _code_name('M', match[1])) if match else None
    if match is None or entry is None:
        return None
    rest = text[match.end() :]
    plain = _BLOCK.fullmatch(rest) or re.search(r'G[0-9]', _QUOTED.sub('', rest))
    return name if entry.text or (entry.alone and not plain) else None


def _is_one_command(line: str, text: str) -> bool:
    """Return whether a command owns its whole line, such as ``M486 Alid(1).stl``."""
    named = _NAME.match(line)
    return _printer_code(text) is not None or (
        named is not None and code_named(named[1].upper()) is not None
    )


def _odd_block(number: int, line: str, text: str) -> Block:
    """Return the block of a line that begins with O, or is not made of words with numbers."""
    first = text[:1]
    if first in ('%', '/', ''):
        return Block([first] if first else [], {})
    if text in ('TX', 'TC', 'T?'):  # Prusa: the filament is chosen at the printer
        return Block([text], {})
    if first == '$':
        return Block([text[:2] if text[:2] in CODES else '$'], {})
    if first in 'O:<':
        text = _PROGRAM_NAME.sub('', text)
        if not text:
            return Block(['< >'], {})
        found = _PROGRAM_NUMBER.fullmatch(text)
        return Block(['O'], {'O': float(found[1])}) if found else Block(['o-word'], {})
    named = _NAME.match(line)
    if named and (name := named[1].upper()) and code_named(name):
        return Block([name], {})
    if (without := _CHECKSUM.sub('', text)) != text:
        return _block(number, line, without)
    bare = ''.join(_BARE_LETTER.findall(text))
    without = _BARE_LETTER.sub('', text)
    if bare and not named and text[:3] != 'M98' and _BLOCK.fullmatch(without):
        return _block(number, line, without)._replace(bare=bare)
    for sign in ('#', '[', '=', ',R', ',C'):
        if sign in text:
            raise BrokenFile(
                number, f'{_shown(line)} has {sign}, which is not read: {CODES[sign].reason}'
            )
    if text.startswith('M98P"'):
        return Block(['M98 P"'], {})
    if text.startswith('M98'):
        raise BrokenFile(number, f'{_shown(line)} is not read: {OTHER_FILE}')
    rest = text[_WORDS_BEFORE.match(text).end() :]  # type: ignore[union-attr]  # matches ''
    if rest[0] == '.':
        raise BrokenFile(number, f'{_shown(line)} has a number with two points')
    if '(' in rest or ')' in rest:
        raise BrokenFile(number, f'{_shown(line)} has a parenthesis without the other one')
    if rest[0].isdigit() and rest == text:
        raise BrokenFile(
            number,
            f'{_shown(line)} begins with a number without a letter; let the CAM write G-code',
        )
    if rest[0].isdigit():
        raise BrokenFile(number, f'{_shown(line)} has a number of more than 15 digits')
    if re.match(r'[A-Z]([^A-Z_]|$)', rest) or (not named and 'A' <= rest[0] <= 'Z'):
        raise BrokenFile(number, f'{rest[0]} has no number')
    raise BrokenFile(number, f'{_shown(line)} is no G-code')


def _shown(line: str) -> str:
    """Return the beginning of a line in quotes."""
    return quoted(line.strip(), 59)
