# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Bodies of messages on the primary interface: big-endian values, one after the other.

A layout is a string of items separated by blanks, one for each value: the ``struct`` code of a
number (``d``), the counted code of a vector (``6d``), ``text`` for a text that extends to the end
of the body, or ``B:text`` for a text preceded by its length in bytes, whose code is ``B``.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
import struct
from typing import Any, ClassVar, Self

from ur_cartesian_driver.motion.errors import LocalProtocolError, RemoteProtocolError
from ur_cartesian_driver.protocol.framing import decode_text, hex_text

_TEXT = 'text'


def pack(layout: struct.Struct, *values: Any) -> bytes:
    """
    Return packed values.

    :raises LocalProtocolError: a value does not fit its code.
    """
    try:
        return layout.pack(*values)
    except (struct.error, OverflowError) as error:
        raise LocalProtocolError(f'{values} cannot be sent: {error}.') from None


def unpack(layout: struct.Struct, body: bytes, what: str, offset: int = 0) -> tuple[Any, ...]:
    """
    Return the values at an offset in a body; bytes after the values are ignored.

    :raises RemoteProtocolError: the body is too short.
    """
    if len(body) < offset + layout.size:
        raise RemoteProtocolError(
            f'A {what} has at least {offset + layout.size} bytes, but {len(body)} arrived: '
            f'{hex_text(body)}.'
        )
    return layout.unpack_from(body, offset)


class BodyLayout:
    """The items of a body."""

    def __init__(self, items: str, what: str, padding: int = 0) -> None:
        """
        Compile the layout.

        :param what: the name of the body, for error texts.
        :param padding: number of zero bytes after the values; a received body may lack them.
        """
        self._what = what
        self._padding = bytes(padding)
        pairs = [item.removesuffix(_TEXT).removesuffix(':') for item in items.split()]
        self._items = [
            (struct.Struct(f'>{codes}'), item.endswith(_TEXT))
            for codes, item in zip(pairs, items.split(), strict=True)
        ]
        #: Size of all items without the characters of texts [bytes].
        self.size = sum(layout.size for layout, _ in self._items)

    def pack(self, values: Iterable[Any]) -> bytes:
        """
        Return the body.

        :param values: one for each item; vectors are tuples, possibly nested.
        :raises LocalProtocolError: a value does not fit its code.
        """
        parts = []
        for (layout, is_text), value in zip(self._items, values, strict=True):
            if is_text:
                text = value.encode(errors='replace')  # a lone surrogate cannot be encoded
                parts.append((pack(layout, len(text)) if layout.size else b'') + text)
            else:
                parts.append(pack(layout, *_flat(value)))
        return b''.join(parts) + self._padding

    def unpack(self, body: bytes, start: int = 0) -> list[Any]:
        """
        Return one value for each item; vectors are tuples.

        :raises RemoteProtocolError: the body is too short.
        """
        self._check_size(body, start + self.size)
        values: list[Any] = []
        for layout, is_text in self._items:
            found = unpack(layout, body, self._what, start)
            start += layout.size
            if is_text:
                end = start + found[0] if found else len(body)
                if end < start:
                    raise RemoteProtocolError(
                        f'A {self._what} has a text of {found[0]} bytes: {hex_text(body)}.'
                    )
                self._check_size(body, end)
                values.append(decode_text(body[start:end]))
                start = end
            else:
                values.append(found[0] if len(found) == 1 else found)
        return values

    def _check_size(self, body: bytes, size: int) -> None:
        unpack(struct.Struct(f'{size}x'), body, self._what)


class Body:
    """A message whose body has one value per slot of its own class, without inherited slots."""

    __slots__: tuple[str, ...] = ()
    layout: ClassVar[BodyLayout]

    def encode(self) -> bytes:
        """Return the body."""
        return self.layout.pack(getattr(self, name) for name in self.__slots__)

    @classmethod
    def decode(cls, body: bytes, **head: int) -> Self:
        """
        Return the content of a body.

        :param head: fields of the message outside the body.
        :raises RemoteProtocolError: the body is too short.
        """
        construct: Callable[..., Self] = cls
        return construct(**dict(zip(cls.__slots__, cls.layout.unpack(body), strict=True)), **head)


def _flat(value: Any) -> list[Any]:
    return [x for item in value for x in _flat(item)] if isinstance(value, tuple) else [value]
