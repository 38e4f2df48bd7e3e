# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Parameters without a node, from the same files and arguments that the node accepts.

With these parameters, ``ur-cartesian validate`` plans as the driver does.
"""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import yaml

from ur_cartesian_driver.ros.parameters.node_parameters import Settings, settings_from
from ur_cartesian_driver.ros.parameters.parameter_table import ParameterError, ParameterValue

_NODE = 'ur_cartesian_driver'


def read_settings(files: Iterable[Path] = (), words: Iterable[str] = ()) -> Settings:
    """
    Return all parameters; files override the defaults, and single parameters override both.

    :param files: as for ``--params-file`` of ROS 2.
    :param words: each ``NAME:=VALUE``, as for ``-p`` of ROS 2.
    :raises ParameterError: a name is unknown or a value invalid.
    :raises OSError: a file cannot be read.
    """
    given: dict[str, ParameterValue] = {}
    for file in files:
        given |= _of_file(file)
    for word in words:
        name, sign, value = word.partition(':=')
        if not sign:
            raise ParameterError(f'"{word}" sets no parameter; write NAME:=VALUE.')
        given[name] = _yaml(value, word)
    return settings_from(given)


def _of_file(file: Path) -> dict[str, ParameterValue]:
    """Return the parameters that a file gives for the driver's node, in any namespace."""
    content: object = _yaml(file.read_text(encoding='utf-8'), str(file))
    found: dict[str, ParameterValue] = {}
    for node, values in content.items() if isinstance(content, dict) else ():
        if str(node).split('/')[-1] in ('**', '*', _NODE) and isinstance(values, dict):
            found |= values.get('ros__parameters') or {}
    if not found:
        raise ParameterError(
            f'{file} has no parameters for a node {_NODE}; put them below "/**:" and '
            '"ros__parameters:", as in config/driver.yaml.'
        )
    return found


def _yaml(text: str, name: str) -> ParameterValue:
    try:
        value: ParameterValue = yaml.safe_load(text)
    except yaml.YAMLError as error:
        raise ParameterError(f'{name} is not YAML: {" ".join(str(error).split())}.') from None
    return value
