# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The parameters of the node: their defaults, declaration and values.

Defaults come from the dataclasses that use the values, :class:`DriverConfig`,
:class:`PlanningOptions` and :class:`NodeSettings`, so a program without ROS has the same. All
parameters are read-only: robot and limits must not change under a running goal.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, fields
from difflib import get_close_matches
from typing import Any

from rclpy.exceptions import InvalidParameterException, InvalidParameterTypeException
from rclpy.node import Node
from rclpy.parameter import Parameter

from ur_cartesian_driver.driver import DriverConfig
from ur_cartesian_driver.kinematics.robot_models import JOINT_NAMES
from ur_cartesian_driver.motion.goal.known_frames import Frames, StaticFrame
from ur_cartesian_driver.planning.options import PlanningOptions
from ur_cartesian_driver.ros.parameters.parameter_table import (
    DECLARATIONS,
    ParameterError,
    ParameterValue,
)

#: Fields that the driver detects; they are no parameters.
_DETECTED_OPTIONS = (
    'calibration_known',
    'optimove_known',
    'path_offset_known',
    'acceleration_known',
    'dialect',
    'prelude',
)
#: Parameters that rclpy declares itself.
_RCLPY_PARAMETERS = ('use_sim_time', 'start_type_description_service', 'qos_overrides.')


@dataclass(frozen=True, slots=True, kw_only=True)
class NodeSettings:
    """The parameters that the node itself uses."""

    on_new_goal: str = 'preempt'
    goal_time_tolerance: float = 1.0
    state_publish_rate: float = 50.0
    diagnostics_rate: float = 1.0
    publish_link_frames: bool = False
    static_frames: tuple[str, ...] = ()
    tf_max_age: float = 1.0
    live_target_enabled: bool = False
    servo_state_rate: float = 25.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Settings:
    """All parameters, grouped by their user."""

    driver: DriverConfig
    planning: PlanningOptions
    node: NodeSettings
    frames: Frames

    @property
    def joint_names(self) -> tuple[str, ...]:
        """The names of the joints, with ``tf_prefix``."""
        return tuple(self.planning.tf_prefix + name for name in JOINT_NAMES)


def defaults() -> dict[str, ParameterValue]:
    """Return the default of every parameter, by name."""
    values: dict[str, ParameterValue] = {}
    for options in (DriverConfig(), PlanningOptions(), NodeSettings()):
        for name in _names(type(options)):
            value = getattr(options, name)
            values[name] = _texts(value) if isinstance(value, tuple) else value
    return values


def declare_parameters(node: Node) -> Settings:
    """
    Declare all parameters of a node and return their values.

    :param node: created with ``automatically_declare_parameters_from_overrides``, which makes
        unknown names visible, for example mistyped ones.
    :raises ParameterError: a name is unknown or a value invalid.
    """
    by_name = defaults()
    _refuse_unknown(node.list_parameters([], 0).names, by_name)
    values: dict[str, ParameterValue] = {}
    for declaration in DECLARATIONS:
        default = by_name[declaration.name]
        if node.has_parameter(declaration.name):
            declaration.check(_plain(node.get_parameter(declaration.name).value), default)
            node.undeclare_parameter(declaration.name)
        try:
            parameter = node.declare_parameter(
                declaration.name, default, declaration.descriptor(default)
            )
        # What check() does not cover.
        except (InvalidParameterException, InvalidParameterTypeException) as error:
            raise ParameterError(f'Parameter {declaration.name}: {error}.') from None
        values[declaration.name] = _plain(parameter.value)
    return settings(values)


def settings_from(given: Mapping[str, ParameterValue]) -> Settings:
    """
    Return given values and the defaults of all others, without a node.

    :raises ParameterError: a name is unknown or a value invalid.
    """
    values = defaults()
    _refuse_unknown(given, values)
    for declaration in DECLARATIONS:
        if declaration.name in given:
            value = given[declaration.name]
            declaration.check(value, values[declaration.name])
            values[declaration.name] = value
    return settings(values)


def settings(values: Mapping[str, ParameterValue]) -> Settings:
    """
    Return parameter values, grouped by their user.

    :raises ParameterError: values contradict each other.
    """
    try:
        planning = PlanningOptions(**_fields_of(PlanningOptions, values))
        node = NodeSettings(**_fields_of(NodeSettings, values))
        return Settings(
            driver=DriverConfig(**_fields_of(DriverConfig, values)),
            planning=planning,
            node=node,
            frames=Frames(planning.tf_prefix, map(StaticFrame.parse, node.static_frames)),
        )
    except ValueError as error:
        raise ParameterError(f'Parameter {str(error).rstrip(".")}.') from None


def as_overrides(
    values: Mapping[str, ParameterValue] | Iterable[Parameter] | None,
) -> list[Parameter]:
    """Return values by name as rclpy parameters."""
    if isinstance(values, Mapping):
        return [
            Parameter(name, value=[''] if value == [] else value)  # rclpy takes [] for bytes
            for name, value in values.items()
        ]
    return list(values or ())


def _refuse_unknown(names: Iterable[str], known: Iterable[str]) -> None:
    for name in names:
        if name in known or name.startswith(_RCLPY_PARAMETERS):
            continue
        near = get_close_matches(name, list(known), n=1)
        hint = f'did you mean {near[0]}?' if near else 'config/driver.yaml lists all.'
        raise ParameterError(f'There is no parameter {name}; {hint}')


def _names(options: type[Any]) -> list[str]:
    return [field.name for field in fields(options) if field.name not in _DETECTED_OPTIONS]


def _fields_of(options: type[Any], values: Mapping[str, ParameterValue]) -> dict[str, Any]:
    return {name: _without_blanks(values[name]) for name in _names(options)}


def _without_blanks(value: ParameterValue) -> object:
    """Return a list as a tuple without empty texts."""
    return tuple(text for text in value if text.strip()) if isinstance(value, list) else value


def _texts(value: object) -> list[str]:
    """Return a list of texts, never empty: YAML and ROS have no type for an empty list."""
    assert isinstance(value, (list, tuple))
    return [str(text) for text in value] or ['']


def _plain(value: Any) -> ParameterValue:
    """Return a parameter's value as plain Python; arrays arrive as other sequences."""
    return value if isinstance(value, (bool, int, float, str)) else _texts(value)
