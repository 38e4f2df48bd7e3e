# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Collect and check all parameters, from a ROS node or from plain values.

All parameters are read-only: robot and limits must not change while a goal runs.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
import contextlib
from dataclasses import dataclass
from typing import Any

from rclpy.exceptions import InvalidParameterException, InvalidParameterTypeException
from rclpy.node import Node
from rclpy.parameter import Parameter

from ur_cartesian_driver.driver import DriverConfig
from ur_cartesian_driver.kinematics.robot_models import JOINT_NAMES
from ur_cartesian_driver.motion.errors import suggestion
from ur_cartesian_driver.motion.goal.known_frames import Frames, StaticFrame
from ur_cartesian_driver.motion.goal.parameter_fields import parameter_fields
from ur_cartesian_driver.planning.options import PlanningOptions
from ur_cartesian_driver.ros.parameters.node_settings import NodeSettings
from ur_cartesian_driver.ros.parameters.parameter_table import (
    DECLARATIONS,
    ParameterDeclaration,
    ParameterError,
    ParameterValue,
    plain_value,
)

#: Parameters that rclpy declares itself.
_RCLPY_PARAMETERS = ('use_sim_time', 'start_type_description_service', 'qos_overrides.')


@dataclass(frozen=True, slots=True, kw_only=True)
class Settings:
    """All parameters, grouped by the component that uses them."""

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
    return {declaration.name: declaration.default for declaration in DECLARATIONS}


@contextlib.contextmanager
def explained_overrides() -> Iterator[None]:
    """
    Replace rclpy's error about a parameter without a value by a sentence for the user.

    :raises ParameterError: a parameter has no value.
    """
    try:
        yield
    except ValueError as error:
        if 'PARAMETER_NOT_SET' not in str(error):
            raise
        raise ParameterError(
            "A parameter has no value; write '' for an empty text and [''] for an empty list."
        ) from None


def declare_parameters(node: Node, others: Iterable[str] = ()) -> Settings:
    """
    Declare all parameters of a node and return their values.

    :param node: created with ``automatically_declare_parameters_from_overrides``, which makes
        unknown names visible, for example mistyped ones.
    :param others: the parameters of the node ur_driver_names, which get a refusal of their own.
    :raises ParameterError: a name is unknown or a value invalid.
    """
    names = node.list_parameters([], 0).names
    for name in names:
        if name in others:
            raise ParameterError(
                f'{name} is a parameter of the node ur_driver_names; write -p '
                f'ur_driver_names:{name}:=VALUE.'
            )
    refuse_unknown(names, defaults(), 'config/driver.yaml')
    return settings(declared_values(node, DECLARATIONS))


def declared_values(
    node: Node, declarations: Iterable[ParameterDeclaration]
) -> dict[str, ParameterValue]:
    """
    Declare parameters of a node and return their values.

    :raises ParameterError: a value is invalid.
    """
    values = {}
    for declaration in declarations:
        if node.has_parameter(declaration.name):
            declaration.check(plain_value(node.get_parameter(declaration.name).value))
            node.undeclare_parameter(declaration.name)
        try:
            parameter = node.declare_parameter(
                declaration.name, declaration.default, declaration.descriptor()
            )
        # Raised, for example, for (), which check() accepts as an empty list, but which rclpy
        # takes for bytes.
        except (InvalidParameterException, InvalidParameterTypeException) as error:
            raise ParameterError(f'Parameter {declaration.name}: {error}.') from None
        values[declaration.name] = plain_value(parameter.value)
    return values


def settings_from(given: Mapping[str, ParameterValue]) -> Settings:
    """
    Return settings without a node: the given values, and defaults for all other parameters.

    :raises ParameterError: a name is unknown or a value invalid.
    """
    values = defaults()
    refuse_unknown(given, values, 'config/driver.yaml')
    for declaration in DECLARATIONS:
        if declaration.name in given:
            declaration.check(given[declaration.name])
            values[declaration.name] = given[declaration.name]
    return settings(values)


def settings(values: Mapping[str, ParameterValue]) -> Settings:
    """
    Return parameter values, grouped by the component that uses them.

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
            Parameter(name, value=[''] if value == [] else value)  # rclpy reads [] as bytes
            for name, value in values.items()
        ]
    return list(values or ())


def refuse_unknown(names: Iterable[str], known: Iterable[str], page: str) -> None:
    """
    Refuse names that no parameter has.

    :param page: the file that lists all parameters.
    :raises ParameterError: a name is unknown.
    """
    for name in names:
        if name in known or name.startswith(_RCLPY_PARAMETERS):
            continue
        hint = suggestion(name, known, f'{page} lists all.')
        raise ParameterError(f'There is no parameter {name}; {hint}')


def _fields_of(options: type, values: Mapping[str, ParameterValue]) -> dict[str, Any]:
    return {each.name: _without_blanks(values[each.name]) for each in parameter_fields(options)}


def _without_blanks(value: ParameterValue) -> object:
    """Return a list as a tuple without its blank texts, and any other value unchanged."""
    return tuple(text for text in value if text.strip()) if isinstance(value, list) else value
