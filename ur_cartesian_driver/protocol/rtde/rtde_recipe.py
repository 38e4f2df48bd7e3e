# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
RTDE recipes: the fields that client and controller agreed on, and the bytes of their values.

:mod:`~ur_cartesian_driver.motion.state.rtde_state` has the outputs for which the driver asks.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from operator import itemgetter
import struct
from typing import Any, cast, TypeAlias

from ur_cartesian_driver.motion.errors import LocalProtocolError, RemoteProtocolError
from ur_cartesian_driver.protocol.framing import hex_text
from ur_cartesian_driver.protocol.rtde.rtde_fields import DataType
from ur_cartesian_driver.protocol.rtde.rtde_packages import HEADER, PackageType

#: A number, a flag, or a vector of numbers.
RtdeValue: TypeAlias = int | float | tuple[float, ...]
#: Values in the order of a recipe.
RtdeValues: TypeAlias = tuple[RtdeValue, ...]


class Recipe:
    """
    An agreed list of fields; packs and unpacks their values.

    ``pack`` and ``unpack`` use a precompiled struct, because they run 500 times a second.
    """

    __slots__ = (
        '_frame',
        '_head',
        '_lengths',
        '_pick',
        '_size',
        '_struct',
        'names',
        'recipe_id',
        'types',
    )

    def __init__(
        self, names: Sequence[str], types: Sequence[DataType], recipe_id: int | None = 1
    ) -> None:
        """
        Compile the recipe.

        :param recipe_id: the byte before the values; None = no such byte (outputs of version 1).
        :raises ValueError: the numbers of names and types differ, or there are no names.
        """
        if len(names) != len(types) or not names:
            raise ValueError(
                f'An RTDE recipe cannot have {len(names)} names and {len(types)} types.'
            )
        self.names = tuple(names)
        self.types = tuple(types)
        self.recipe_id = recipe_id
        codes = ''.join(data_type.codes for data_type in types)
        head = '' if recipe_id is None else 'x'
        self._struct = struct.Struct(f'>{head}{codes}')
        self._frame = struct.Struct(f'>HB{"" if recipe_id is None else "B"}{codes}')
        self._size = self._struct.size
        self._head = HEADER.pack(self._frame.size, PackageType.DATA_PACKAGE)
        self._lengths = tuple(data_type.length for data_type in types)
        keys: list[int | slice] = []
        start = 0
        for length in self._lengths:
            keys.append(start if length == 1 else slice(start, start + length))
            start += length
        # With a single key, itemgetter returns the bare item; unpack() handles that case.
        self._pick = itemgetter(*keys) if len(keys) > 1 else None

    def unpack(self, payload: bytes) -> RtdeValues:
        """
        Return the values in a data package; vectors are tuples.

        :param payload: the package without its first three bytes (size and type).
        :raises RemoteProtocolError: the package and the recipe differ in size.
        """
        if len(payload) != self._size:
            raise RemoteProtocolError(
                f'An RTDE data package of this recipe has {self._size} bytes, but {len(payload)} '
                f'arrived: {hex_text(payload)}.'
            )
        # The recipe id is not checked: some controllers send a different one than agreed.
        flat = self._struct.unpack(payload)
        if self._pick is None:
            return flat if len(flat) == 1 else (flat,)
        return cast(RtdeValues, self._pick(flat))

    def unpack_frame(self, data: bytes) -> RtdeValues | None:
        """Return the values in one whole frame; None for other bytes, or a one-field recipe."""
        if len(data) != self._frame.size or self._pick is None or data[:3] != self._head:
            return None
        return cast(RtdeValues, self._pick(self._struct.unpack_from(data, HEADER.size)))

    def pack(self, values: Sequence[RtdeValue]) -> bytes:
        """
        Return the whole frame of a data package.

        :param values: in the order of the recipe; vectors as tuples.
        :raises LocalProtocolError: there are too few or too many values, or a value does not fit
            the type of its field.
        """
        flat: list[Any] = [] if self.recipe_id is None else [self.recipe_id]
        value: Any  # len() of a number in place of a vector raises TypeError, caught below
        try:
            for value, length in zip(values, self._lengths, strict=True):
                if length == 1:
                    flat.append(value)
                elif len(value) == length:
                    flat.extend(value)
                else:
                    raise self._packing_error(values)
            return self._frame.pack(self._frame.size, PackageType.DATA_PACKAGE, *flat)
        except (struct.error, OverflowError, TypeError, ValueError):
            raise self._packing_error(values) from None

    def pack_named(self, values: Mapping[str, RtdeValue]) -> bytes:
        """
        Return the whole frame of a data package with values by name.

        :raises LocalProtocolError: a value is missing, surplus, or does not fit its type.
        """
        if len(values) != len(self.names) or not all(name in values for name in self.names):
            missing = ', '.join(set(self.names) - set(values)) or 'none'
            surplus = ', '.join(set(values) - set(self.names)) or 'none'
            raise LocalProtocolError(
                f'An RTDE package needs all values of its recipe; missing: {missing}, '
                f'surplus: {surplus}.'
            )
        return self.pack([values[name] for name in self.names])

    def named(self, values: RtdeValues) -> dict[str, RtdeValue]:
        """Return values by name."""
        return dict(zip(self.names, values, strict=True))

    def zeros(self) -> RtdeValues:
        """Return zero for each field."""
        return tuple(t.zero for t in self.types)

    def __eq__(self, other: object) -> bool:
        """Compare names, types and id."""
        return isinstance(other, Recipe) and self._key() == other._key()

    def __hash__(self) -> int:
        """Hash names, types and id."""
        return hash(self._key())

    def __repr__(self) -> str:
        """Return the recipe as text."""
        fields = ', '.join(f'{n}: {t.name}' for n, t in zip(self.names, self.types, strict=True))
        return f'Recipe({self.recipe_id}: {fields})'

    def _key(self) -> tuple[object, ...]:
        return self.names, self.types, self.recipe_id

    def _packing_error(self, values: Sequence[RtdeValue]) -> LocalProtocolError:
        """Return the error that names the values that cannot be packed."""
        if len(values) != len(self.names):
            return LocalProtocolError(
                f'An RTDE recipe of {len(self.names)} fields cannot take {len(values)} values.'
            )
        problems = [
            f'{name} is {value!r}, which is not a {data_type.name}'
            for name, data_type, value in zip(self.names, self.types, values, strict=True)
            if not _fits_type(data_type, value)
        ]
        return LocalProtocolError('; '.join(problems) + '.')


def _fits_type(data_type: DataType, value: Any) -> bool:
    try:
        struct.pack(f'>{data_type.codes}', *(value if data_type.length > 1 else (value,)))
    except (struct.error, OverflowError, TypeError):
        return False
    return True
