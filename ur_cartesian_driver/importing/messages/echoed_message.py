# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Messages as ``ros2 topic echo`` and ``rostopic echo`` print them.

Such a text is YAML with a document for each message, and consists of mappings, lists, numbers and
texts only. Every parsed value carries its line number. Only PyYAML's event parser is used, because
in its later stages, the error texts and the limits on nesting differ between versions.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
import re
from typing import Any

import yaml

from ur_cartesian_driver.importing.imported_path import BrokenFile, ImportNotes
from ur_cartesian_driver.importing.text_file import quoted

_Loader = getattr(yaml, 'CSafeLoader', yaml.SafeLoader)
#: Deepest nesting of values; messages have about five levels.
_MAX_DEPTH = 50
_END_OF_MESSAGE = re.compile(r'^---[ \t]*$', re.MULTILINE)
_BLANK_LINES = re.compile(r'(?:[ \t]*\n)*')
#: Matches the notice of a lost message, whose final hyphens are not on a line of their own.
_LOST = re.compile(r'^A message was lost!!!\n\ttotal count change:.*\n\ttotal count:.*---$', re.M)
#: Matches the directives that YAML allows before the first document.
_DIRECTIVES = re.compile(r'\A(?:%(?:YAML|TAG)[ \t][^\n]*\n)+(?=---)')
#: Only YAML 1.1 treats these as ends of lines, which would shift the line numbers.
_NO_LINE_ENDS = str.maketrans('\x85\u2028\u2029', '   ')
_FORBIDDEN = re.compile(
    '[^\t\n\x20-\x7e\xa0-\ud7ff\ue000-\ufefe\uff00-\ufffd\U00010000-\U0010ffff]'
)


class MessagePart:
    """A mapping whose fields are attributes; ``line`` is its line number."""

    def __init__(self, line: int) -> None:
        """Begin without fields."""
        self.line = line
        self.fields: dict[str, Any] = {}

    def __getattr__(self, name: str) -> Any:
        """
        Return a field.

        :raises BrokenFile: the field is missing.
        """
        if name.startswith('_'):
            raise AttributeError(name)
        try:
            return self.fields[name]
        except KeyError:
            raise BrokenFile(self.line, f'the field {name} is missing') from None


class MessageList(list[Any]):
    """A list with its line number."""

    def __init__(self, line: int) -> None:
        """Begin empty."""
        super().__init__()
        self.line = line


class MessageNumber(float):
    """A number with its line number."""

    line: int


class MessageText(str):
    """A text with its line number."""

    line: int


@dataclass(frozen=True, slots=True)
class EchoedMessage:
    """The text of a message."""

    #: The number of the message's first line, from 1.
    line: int
    text: str
    #: Whether a line ``---`` follows; if not, the message may be cut off.
    is_whole: bool

    def read(self) -> MessagePart:
        """
        Return the fields of the message.

        :raises BrokenFile: the text is no message, is several messages, or is cut off.
        """
        if strange := _FORBIDDEN.search(self.text):
            line = self.line + self.text.count('\n', 0, strange.start())
            raise BrokenFile(line, f'the character {strange[0]!r} is not allowed in a message')
        try:
            events = iter(yaml.parse(self.text, Loader=_Loader))
            values = [
                _value(next(events), events, self.line, 0)
                for event in events
                if isinstance(event, yaml.DocumentStartEvent)
            ]
        except yaml.YAMLError as error:
            mark = getattr(error, 'problem_mark', None)
            raise self._no_message(mark.line if mark else 0) from None
        if len(values) > 1:
            raise BrokenFile(
                self.line, 'two messages follow each other without a line "---" between them'
            )
        if not values or not isinstance(values[0], MessagePart):
            raise BrokenFile(self.line, 'the text is not a message: it has no fields')
        return values[0]

    def _no_message(self, row: int) -> BrokenFile:
        """Return the error for invalid YAML; ``row`` is the line (from 0) where PyYAML failed."""
        lines = self.text.split('\n')
        row = min(row, len(lines) - 1)
        if '\t' in lines[row][: len(lines[row]) - len(lines[row].lstrip())]:
            return BrokenFile(self.line + row, 'the line is indented with a tab; use blanks')
        is_last_line = not any(map(str.strip, lines[row + 1 :]))
        end = ', or is cut off' if is_last_line and not self.is_whole else ''
        return BrokenFile(self.line + row, f'the text is not output of ros2 topic echo{end}')


def echoed_messages(text: str, remarks: ImportNotes) -> list[EchoedMessage]:
    """Split a text into its messages without parsing them; note lost messages in ``remarks``."""
    text = text.replace('\r\n', '\n').replace('\r', '\n').translate(_NO_LINE_ENDS)
    text = _DIRECTIVES.sub(lambda found: '\n' * found[0].count('\n'), text)
    for lost in _LOST.finditer(text):
        line = text.count('\n', 0, lost.start()) + 1
        remarks.add(line, 'a message', 'ros2 topic echo has lost it')
    text = _LOST.sub('\n\n---', text)
    messages, begin, line = [], 0, 1
    ends = [(end.start(), end.end()) for end in _END_OF_MESSAGE.finditer(text)]
    for stop, following in [*ends, (len(text), len(text))]:
        message = text[begin:stop]
        if message.strip():
            content = _BLANK_LINES.sub('', message, count=1)
            blank = message.count('\n') - content.count('\n')
            messages.append(EchoedMessage(line + blank, content, following > stop))
        line += text.count('\n', begin, following)
        begin = following
    return messages


def _value(event: Any, events: Iterator[Any], first: int, depth: int) -> Any:
    """
    Return the value that begins with an event of PyYAML.

    :param first: the line of the file in which the parsed text begins.
    :raises BrokenFile: the value is a reference or is nested too deeply, or a field in it has no
        name or occurs twice.
    """
    line = first + event.start_mark.line
    if isinstance(event, yaml.ScalarEvent):
        return _scalar(event, line)
    if depth > _MAX_DEPTH:
        raise BrokenFile(line, 'it is nested too deeply')
    if isinstance(event, yaml.SequenceStartEvent):
        items = MessageList(line)
        for item in events:
            if isinstance(item, yaml.SequenceEndEvent):
                break
            items.append(_value(item, events, first, depth + 1))
        return items
    if not isinstance(event, yaml.MappingStartEvent):
        raise BrokenFile(line, 'a message has no references (*)')
    part = MessagePart(line)
    for key in events:
        if isinstance(key, yaml.MappingEndEvent):
            break
        name = getattr(key, 'value', '')
        if not name or name in part.fields:
            what = f'the field {quoted(name)} occurs twice' if name else 'a field has no name'
            raise BrokenFile(first + key.start_mark.line, what)
        part.fields[name] = _value(next(events), events, first, depth + 1)
    return part


def _scalar(event: Any, line: int) -> MessageNumber | MessageText:
    """Return a number or a text; ROS 1's 1e-05 is a number, although YAML 1.1 reads it as text."""
    scalar: MessageNumber | MessageText
    try:
        scalar = MessageText(event.value) if event.style else MessageNumber(event.value)
    except ValueError:
        scalar = MessageText(event.value)
    scalar.line = line
    return scalar
