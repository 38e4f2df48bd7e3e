# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The names that programs give to columns, and the meaning of these names.

A term is a group of columns that belong together, such as ``qx, qy, qz, qw``. Case, blanks, ``_``,
``.``, ``/`` and ``-`` make no difference: ``Pos X`` and ``pos_x`` are the same name. A path of
names, as in ROS, is also recognised by its last two names.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
import re

from ur_cartesian_driver.importing.import_format import (
    honoured,
    left_out,
    refused,
    term_table,
    Treatment,
)
from ur_cartesian_driver.importing.tables.column_units import is_unit, plain_unit, Quantity, UNITS

POSITION = 'position'
POSE = 'pose of a robot, in m and rad'
ROS_POSE = 'pose of `rostopic echo -p`, in m'
OWN_POSE = 'pose of our [exports](recordings.md#for-other-programs)'
QUATERNION = 'orientation: quaternion'
ROTATION_VECTOR = 'orientation: rotation vector'
ANGLES = 'orientation: turns about the fixed axes x, then y, then z'
OTHER_ORIENTATION = 'orientation: others'
NORMAL = 'normal of the surface'
TIME = 'time'
SECONDS = 'time in two columns'
SPEED = 'speed'
BLEND = 'radius of the blend'
OTHER = 'others'

_XYZ, _RXYZ, _QXYZW = ('x', 'y', 'z'), ('rx', 'ry', 'rz'), ('qx', 'qy', 'qz', 'qw')
#: The roles of the columns in a group, by the topic of the group.
ROLES: Mapping[str, tuple[str, ...]] = {
    POSITION: _XYZ,
    POSE: (*_XYZ, *_RXYZ),
    ROS_POSE: (*_XYZ, *_QXYZW),
    OWN_POSE: (*_XYZ, *_QXYZW),
    QUATERNION: _QXYZW,
    ROTATION_VECTOR: _RXYZ,
    ANGLES: ('roll', 'pitch', 'yaw'),
    NORMAL: ('nx', 'ny', 'nz'),
    TIME: ('t',),
    SECONDS: ('sec', 'nanosec'),
    SPEED: ('speed',),
    BLEND: ('blend',),
}
#: Kinds of values, by the first role of their group; only one group of a kind is used.
KINDS = {
    'x': 'position',
    'qx': 'orientation',
    'rx': 'orientation',
    'roll': 'orientation',
    'nx': 'normal',
    't': 'time',
    'sec': 'time',
    'speed': 'speed',
    'blend': 'blend',
}
QUANTITIES: Mapping[str, Quantity] = {
    **dict.fromkeys((*_XYZ, 'blend'), Quantity.LENGTH),
    **dict.fromkeys((*_RXYZ, *ROLES[ANGLES]), Quantity.ANGLE),
    **dict.fromkeys((*_QXYZW, *ROLES[NORMAL]), Quantity.PURE),
    **dict.fromkeys(('t', 'sec', 'nanosec'), Quantity.TIME),
    'speed': Quantity.SPEED,
}
#: Units of the programs that write these columns; they apply if the header has none.
FIXED_UNITS: Mapping[str, Mapping[str, str]] = {
    POSE: {**dict.fromkeys(_XYZ, 'm'), **dict.fromkeys(_RXYZ, 'rad')},
    ROS_POSE: dict.fromkeys(_XYZ, 'm'),
    OWN_POSE: dict.fromkeys(_XYZ, 'm'),
    SECONDS: {'sec': 's', 'nanosec': 'ns'},
}


NO_QUANTITY = 'a path has no such quantity'
#: Braces stand for each of their letters in turn. Of several groups with the same kind of values,
#: the first one in TERMS is used.
TERMS = term_table(
    honoured(
        POSITION,
        *('{xyz}', 'pos_{xyz}', 'position_{xyz}', 'p{xyz}', 'pose_{xyz}', 'point_{xyz}'),
        *('translation_{xyz}', 'tcp_{xyz}', 'tcp_pose_{xyz}', 'tcp_pos_{xyz}', 'ee_pos_{xyz}'),
        *('t{xyz}', 'p_RS_R_{xyz}'),  # trajectories of TUM, poses of EuRoC
    ),
    honoured(
        POSE,
        *('actual_TCP_pose_{012345}', 'target_TCP_pose_{012345}'),
        *('TCP_pose_{012345}', 'TCP_{012345}'),
    ),
    honoured(
        ROS_POSE,
        'field.pose.position.{xyz}, field.pose.orientation.{xyzw}',
        'field.pose.pose.position.{xyz}, field.pose.pose.orientation.{xyzw}',
    ),
    honoured(OWN_POSE, 'actual_pose_{xyz}, actual_pose_q{xyzw}'),
    honoured(
        QUATERNION,
        *('q{xyzw}', 'quat_{xyzw}', 'quaternion_{xyzw}', 'orientation_{xyzw}', 'ori_{xyzw}'),
        *('o{xyzw}', 'rot_{xyzw}', 'rotation_{xyzw}', 'tcp_q{xyzw}', 'ee_quat_{xyzw}'),
        *('q_RS_{xyzw}', 'pose_q{xyzw}'),
    ),
    honoured(
        ROTATION_VECTOR,
        *('r{xyz}', 'rotvec_{xyz}', 'rvec_{xyz}', 'rv_{xyz}', 'tcp_r{xyz}', 'tcp_pose_r{xyz}'),
        'pose_r{xyz}',
    ),
    honoured(ANGLES, 'roll, pitch, yaw'),
    refused(
        OTHER_ORIENTATION,
        'the file does not say about which axes, in which order',
        *('a, b, c', 'w, p, r', 'phi, theta, psi', 'alpha, beta, gamma', 'roll, pitch, heading'),
        *('rot_{xyz}', 'rotation_{xyz}', 'euler_{xyz}', 'angle_{xyz}'),
    ),
    refused(
        OTHER_ORIENTATION,
        'the file does not say which of them is w, or whether they are joints',
        *('q{0123}', 'q{1234}'),
    ),
    refused(OTHER_ORIENTATION, 'the file does not say whether they are a normal', 'i, j, k'),
    refused(
        OTHER_ORIENTATION,
        'a rotation matrix is not read',
        *('r1{123}, r2{123}, r3{123}', 'r0{012}, r1{012}, r2{012}'),
    ),
    honoured(NORMAL, 'n{xyz}', 'normal_{xyz}', 'normals_{xyz}'),
    honoured(
        TIME,
        *('t', 'time_from_start', 'header.stamp', 'stamp', 'timestamp', 'time', 'elapsed_time'),
        *('datetime', 'unix_time'),
    ),
    honoured(SECONDS, 'stamp.sec, stamp.nanosec', 'secs, nsecs', 'sec, nanosec'),
    honoured(SPEED, 'speed', 'velocity', 'v', 'feed', 'feed_rate'),
    left_out(SPEED, 'name one speed along the path', *('v{xyz}', 'vel_{xyz}', 'velocity_{xyz}')),
    left_out(SPEED, 'give the option acceleration', 'acceleration'),
    honoured(BLEND, 'blend', 'blend_radius'),
    left_out(BLEND, 'name it blend if the arm is to pass the point', 'radius'),
    left_out(OTHER, 'joints follow from the pose', 'actual_q_{012345}'),
    left_out(OTHER, NO_QUANTITY, '{rgb}', 'intensity', 'index', 'frame', 'seq', 'speed_scaling'),
)
#: The reason why columns with unknown names are left out.
OTHERS_REASON = f'{NO_QUANTITY}, or its name is not known'

#: Words in a name that suggest an orientation.
_ORIENTATION_WORDS = frozenset(
    'quat quaternion orientation orient ori orn rot rotation euler rpy roll pitch yaw heading '
    'angle axis aa'.split()
)
#: Matches the end of a name such as tool_rx, which suggests an orientation.
_TURN_END = re.compile(r'[\s_./-][rq][wxyz]', re.IGNORECASE)
_JOINT = re.compile(r'joint|\bj\d', re.IGNORECASE)
_BRACKETS = re.compile(r'(.*?)\s*[\[({<]([^\[\](){}<>]*)[\])}>]')
_UNIT_BEHIND = re.compile(r'[\s_/,:]+(?:in\s+)?')


def letters(name: str) -> str:
    """Return the significant characters of a name, in lower case."""
    name = name.strip().lower().lstrip('%#/_ ')
    return re.sub(r'[\s_./]+|(?<=\w)-(?=\w)', '', name)


def _columns(term: str) -> Iterator[str]:
    """Yield the significant characters of each column of a term."""
    for name in term.split(', '):
        before, _, rest = name.partition('{')
        axes, _, behind = rest.partition('}')
        yield from (letters(before + axis + behind) for axis in axes or [''])


#: The significant characters of the columns of each term.
COLUMNS: Mapping[str, tuple[str, ...]] = {name: tuple(_columns(name)) for name in TERMS}
_KNOWN = frozenset(column for columns in COLUMNS.values() for column in columns)
_TURNS = frozenset(
    role for topic in (QUATERNION, ROTATION_VECTOR, ANGLES, NORMAL) for role in ROLES[topic]
)
_ORIENTATIONS = frozenset(
    column
    for name, term in TERMS.items()
    if term.treatment is Treatment.HONOURED
    for column, role in zip(COLUMNS[name], ROLES[term.topic], strict=True)
    if role in _TURNS
)


@dataclass(frozen=True, slots=True)
class Title:
    """A title of a column, split into name and unit."""

    #: The significant characters of a name in the table of terms; empty = an unknown name.
    name: str
    unit: str
    #: The title as the file has it.
    text: str


def read_title(text: str) -> Title:
    """Return name and unit of ``x [mm]``, ``x (mm)``, ``x_mm``, ``x/mm`` or ``x in mm``."""
    text = text.strip()
    if (match := _BRACKETS.fullmatch(text)) is not None:
        return Title(_known(match[1]), match[2].strip(), text)
    if name := _known(text):
        return Title(name, '', text)
    for gap in reversed(list(_UNIT_BEHIND.finditer(text))):
        if is_unit(text[gap.end() :]) and (name := _known(text[: gap.start()])):
            return Title(name, text[gap.end() :], text)
    return Title('', '', text)


def _split(text: str) -> tuple[str, str]:
    """Return the name and the unit, which can be empty, in a title."""
    if (match := _BRACKETS.fullmatch(text)) is not None:
        return match[1], match[2].strip()
    for gap in reversed(list(_UNIT_BEHIND.finditer(text))):
        if is_unit(text[gap.end() :]):
            return text[: gap.start()], text[gap.end() :]
    return text, ''


def _known(name: str) -> str:
    """Return the significant characters of a name or its path's end; empty = both are unknown."""
    ends = (name, '.'.join(re.split(r'[./]', name)[-2:]))
    return next((found for end in ends if (found := letters(end)) in _KNOWN), '')


def body_of(title: Title) -> str:
    """Return the beginning of a path of names, such as ``/ee`` of ``/ee/pose/position/x``."""
    names = re.split(r'[./]', _split(title.text)[0].strip('/'))
    if title.name == letters('.'.join(names)):
        return ''
    return '/'.join(name for name in names[:-2] if name != 'pose')


def is_orientation(title: Title) -> bool:
    """Return whether a title's name, words or unit suggest an orientation or a normal."""
    if title.name in _ORIENTATIONS:
        return True
    name, unit = _split(title.text)
    words = {word.lower() for word in re.findall(r'[A-Z]?[a-z]+|[A-Z]+(?![a-z])', name)}
    is_angle = plain_unit(unit) in UNITS[Quantity.ANGLE] and _JOINT.search(name) is None
    return is_angle or not _ORIENTATION_WORDS.isdisjoint(words) or bool(_TURN_END.match(name[-3:]))
