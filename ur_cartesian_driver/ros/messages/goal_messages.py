# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""From plain objects with the fields of a message to the message."""

from __future__ import annotations

from collections.abc import Mapping
from importlib import import_module
from typing import Any

from rosidl_parser.definition import AbstractSequence, Array, NamespacedType

from ur_cartesian_driver.action import FollowCartesianTrajectory
from ur_cartesian_driver.goal_files.goal_schema import Message, with_defaults


def goal_message(fields: Mapping[str, Any]) -> FollowCartesianTrajectory.Goal:
    """
    Return the message of a goal with these fields, all others with their defaults.

    :raises FieldError: a key is unknown, or a value is not of its type.
    """
    return message_of(with_defaults(dict(fields)), FollowCartesianTrajectory.Goal)


def message_of(plain: Message, kind: type[Any]) -> Message:
    """Return a message of a type with the fields of an object, which has all of them."""
    return kind(
        **{
            name: _value(getattr(plain, name), slot)
            for name, slot in zip(kind.get_fields_and_field_types(), kind.SLOT_TYPES, strict=True)
        }
    )


def _value(value: Any, slot: Any) -> Any:
    if isinstance(slot, NamespacedType):
        return message_of(value, getattr(import_module('.'.join(slot.namespaces)), slot.name))
    if isinstance(slot, (AbstractSequence, Array)) and isinstance(slot.value_type, NamespacedType):
        return [_value(item, slot.value_type) for item in value]
    return value
