# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Definitions of ROS 2 messages as text, as MCAP files carry them (``ros2msg``).

The definitions are read from the installed interface packages, as in rosbag2: a definition is
followed by the definitions of the messages that it contains.
"""

from __future__ import annotations

import re

from ur_cartesian_driver.resources import installed_share

#: Definitions without comments, for messages of packages that the driver does not need and PyPI
#: does not have.
_SHORT_DEFINITIONS = {
    'nav_msgs/Path': 'std_msgs/Header header\ngeometry_msgs/PoseStamped[] poses\n',
    'tf2_msgs/TFMessage': 'geometry_msgs/TransformStamped[] transforms\n',
}
#: Matches the beginning of a line that declares a field; group 1 is its type, without bounds.
_FIELD = re.compile(r'^[ \t]*([a-zA-Z][\w/]*)(?:<=\d+)?(?:\[.*?\])?[ \t]+\w', re.MULTILINE)
_BUILT_IN = re.compile(r'bool|byte|char|float(32|64)|u?int(8|16|32|64)|w?string')
_SEPARATOR = 80 * '='


def message_definition(name: str) -> str:
    """
    Return the definition of a message and of the messages that it contains.

    :param name: package and type, for example ``sensor_msgs/JointState``.
    :raises OSError: the package of one of these messages is not installed.
    """
    parts = {name: _own_definition(name)}
    waiting = [name]
    while waiting:
        package = waiting[0].partition('/')[0]
        for match in _FIELD.finditer(parts[waiting.pop(0)]):
            inner = match[1] if '/' in match[1] else f'{package}/{match[1]}'
            if not _BUILT_IN.fullmatch(match[1]) and inner not in parts:
                parts[inner] = _own_definition(inner)
                waiting.append(inner)
    first, *others = parts.items()
    return first[1] + ''.join(f'{_SEPARATOR}\nMSG: {key}\n{text}' for key, text in others)


def _own_definition(name: str) -> str:
    package, _, kind = name.partition('/')
    if name in _SHORT_DEFINITIONS:
        return _SHORT_DEFINITIONS[name]
    share = installed_share(package)
    if share is None:
        raise OSError(
            f'the definition of {name} is missing: install the ROS 2 package {package}, or source '
            'the installation that has it'
        )
    return (share / 'msg' / f'{kind}.msg').read_text(encoding='utf-8').rstrip('\n') + '\n'
