# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Parameters without a node, from the same files and arguments that the node accepts.

With these parameters, ``ur-cartesian validate`` plans as the driver does.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from pathlib import Path
import re

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
        given[name] = yaml_value(value, word)
    return settings_from(given)


def yaml_value(text: str, name: str) -> ParameterValue:
    """
    Return the value of a YAML text, with the types that ROS 2 gives to its scalars.

    :param name: the name of the text, for the message.
    :raises ParameterError: the text is not YAML.
    """
    try:
        value: ParameterValue = yaml.load(text, _Loader)
    except yaml.YAMLError as error:
        raise ParameterError(f'{name} is not YAML: {" ".join(str(error).split())}.') from None
    return value


def _of_file(file: Path) -> dict[str, ParameterValue]:
    """Return the parameters that a file gives for the driver's node, in any namespace."""
    found: dict[str, ParameterValue] = {}
    namespaces: set[str] = set()
    for name, values in _sections(yaml_value(file.read_text(encoding='utf-8'), str(file))):
        namespace, _, node = name.rpartition('/')
        if node not in ('**', '*', _NODE):
            continue
        if not isinstance(values, dict):
            raise ParameterError(
                f'{file}: ros__parameters of {name} must be a mapping; write "NAME: VALUE" '
                'below it.'
            )
        found |= values
        if '*' not in namespace and (namespace or node == _NODE):
            namespaces.add(namespace or '/')
    if len(namespaces) > 1:
        raise ParameterError(
            f'{file} has parameters for drivers in several namespaces, '
            f'{", ".join(sorted(namespaces))}; give a file for one of them.'
        )
    if not found:
        raise ParameterError(
            f'{file} has no parameters for a node {_NODE}; put them below "/**:" and '
            '"ros__parameters:", as in config/driver.yaml.'
        )
    return found


def _sections(content: object, path: str = '') -> Iterator[tuple[str, object]]:
    """Yield the full names of nodes and their parameters; namespaces can be nested."""
    for key, value in content.items() if isinstance(content, dict) else ():
        if key == 'ros__parameters':
            if value is not None:
                yield path, value
        else:
            yield from _sections(value, f'{path}/{str(key).strip("/")}')


class _Loader(yaml.SafeLoader):
    """Reads scalars as rcl does (rcl_yaml_param_parser, parse.c); PyYAML takes 1e-1 for text."""


def _truth(loader: yaml.SafeLoader, node: yaml.ScalarNode) -> bool:
    return str(node.value).lower() in ('y', 'yes', 'true', 'on')


_Loader.yaml_implicit_resolvers = {}
_Loader.add_constructor('tag:yaml.org,2002:bool', _truth)
for _type, _pattern, _first in (
    ('bool', r'(?i:y|yes|true|on|n|no|false|off)', 'yYtToOnNfF'),
    ('int', r'[-+]?(0[xX][0-9a-fA-F]+|[0-9]+)', '-+0123456789'),
    (
        'float',
        r'[-+]?(([0-9]+\.?[0-9]*|\.[0-9]+)([eE][-+]?[0-9]+)?|\.(?i:inf|nan))',
        '-+.0123456789',
    ),
    ('null', r'~|null|', ['~', 'n', '']),
):
    _Loader.add_implicit_resolver(
        f'tag:yaml.org,2002:{_type}', re.compile(f'(?:{_pattern})$'), list(_first)
    )
