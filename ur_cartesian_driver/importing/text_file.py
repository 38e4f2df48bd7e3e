# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The text of a file, whatever program wrote it, and its lines."""

from __future__ import annotations

import codecs
from pathlib import Path
import re

from ur_cartesian_driver.importing.imported_path import BrokenFile

# Used in place of str.splitlines(), which also splits at form feeds, 0x85 and U+2028. No format
# ends a line at these, and splitting there would shift all later line numbers.
_LINE_END = re.compile(r'\r\n|\n|\r')
# The UTF-32 marks come first, because one of them begins with a UTF-16 mark.
_MARKS = (
    (codecs.BOM_UTF32_LE, 'utf-32'),
    (codecs.BOM_UTF32_BE, 'utf-32'),
    (codecs.BOM_UTF8, 'utf-8-sig'),
    (codecs.BOM_UTF16_LE, 'utf-16'),
    (codecs.BOM_UTF16_BE, 'utf-16'),
)

#: Ctrl-Z, with which programs of DOS and of machine controls end a text.
_END_OF_FILE = '\x1a'


def file_text(path: Path) -> str:
    """
    Return the text of a file in the encoding of its byte order mark.

    Without a mark, the encoding is UTF-8 or, if the text is not UTF-8, Windows-1252.

    :raises BrokenFile: the file is binary.
    :raises OSError: the file cannot be opened.
    """
    return decoded(path.read_bytes())


def decoded(data: bytes, code_page: str = 'cp1252') -> str:
    """
    Return the text of a file as :func:`file_text` does.

    :param code_page: the codec if the text is not UTF-8; Windows-1252 replaces an unknown codec.
    :raises BrokenFile: the file is binary.
    """
    encoding = next((name for mark, name in _MARKS if data.startswith(mark)), 'utf-8')
    try:
        text = data.decode(encoding)
    except UnicodeDecodeError:
        if encoding != 'utf-8':
            raise BrokenFile(0, f'the file begins as {encoding}, and is not') from None
        text = _by_code_page(data, code_page)
    if '\0' in text:
        raise BrokenFile(0, 'this is a binary file, and no text')
    return text.rstrip(_END_OF_FILE)


def _by_code_page(data: bytes, code_page: str) -> str:
    try:
        return data.decode(code_page)
    except (LookupError, UnicodeDecodeError):
        # The code page (named by an old program) is unknown or wrong. Use Windows-1252 or,
        # if there is a 0x81, which Windows-1252 lacks, Latin-1.
        return data.decode('latin-1' if b'\x81' in data else 'cp1252', errors='replace')


def file_lines(text: str) -> list[str]:
    """Return the lines of a text without their ends: CR, LF, or both."""
    lines = _LINE_END.split(text)
    if not lines[-1]:
        del lines[-1]
    return lines


def quoted(text: str, width: int = 40) -> str:
    """Return a text in quotes, shortened with dots to a width."""
    return repr(text if len(text) <= width else f'{text[: width - 3]}...')
