# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The RTDE registers between the driver and the robot program.

The controller reserves the numbers from 24 for external clients and the lower ones for fieldbuses.
With the parameter ``lower_registers``, 24 is subtracted from all numbers below.
The servo numbers follow the manufacturer's guide to buffered ``servoj``, so a program that follows
this guide works, too.

=================  ==========  =========  ====================================================
direction          kind        number     meaning
=================  ==========  =========  ====================================================
to the program     int         24         desired mode (:class:`ServoMode`)
to the program     int         25         sequence number, changes with every message
to the program     int         26         external error (:class:`ExternalError`)
to the program     int         27         synchronization (:class:`SyncState`)
to the program     double      24 - 29    joint positions [rad]
to the program     double      30 - 35    max deviation of the joints from these [rad]
to the program     double      46         time of these joint positions [s]
to the program     double      47         time of the motion at these joint positions [s]
to the program     double      24 - 41    path offset of a trajectory (:class:`OffsetInput`)
from the program   int         24         actual mode
from the program   int         25         last sequence number that the program read
from the program   int         26         points of the running trajectory that have begun
from the program   double      24         lag: motion time in the buffer [s]
from the program   double      25 - 30    present path offset (:class:`OffsetOutput`)
from the program   double      31         feed override of splines, 0 to 1
from the program   double      32         total delay of splines by the feed override [s]
from the program   int         27         set-points carried out
from the program   int         28         set-points repeated because the arm was not near them
from the program   int         29         sequence numbers skipped
from the program   int         30         set-points in the buffer
from the program   int         31         set-points lost to a full buffer
from the program   int         32         version of the program (:data:`PROGRAM_VERSION`)
from the program   int         33         random number, drawn when the program was rendered
from the program   int         34         count of connections, changes with each connection
from the program   int         35         token of the last SET_SAFE_OUTPUTS carried out
from the program   int         36         motion version of movej and movel; 0 = unknown
from the program   int         37         pulses given, see :data:`PULSE_COUNTS`
=================  ==========  =========  ====================================================

The program's ints from 26 up are ours; a program that follows the guide lacks them. The counts in
27 to 31 start at 0 when the program enters the control mode ``BUFFERED_SERVO``. The doubles of
path offsets are ours, too. They share numbers with the servo's, which are unused in a trajectory.

The ints 32 to 34 prove to the driver that the program is its own. When the program has read the
first message on the reverse socket, it writes version, number and motion version, and then the
count. Register values outlive programs, so the driver trusts the other three only after the count
has changed on this connection.
"""

from __future__ import annotations

from enum import IntEnum
from typing import TypeAlias


class InputInteger(IntEnum):
    """Integer registers that the driver writes."""

    DESIRED_MODE = 24
    SEQUENCE_ID = 25
    EXTERNAL_ERROR = 26
    EXTERNAL_SYNC_STATE = 27


class InputDouble(IntEnum):
    """Double registers that the driver writes; the first two begin groups of six."""

    DESIRED_JOINT_POSITIONS = 24
    MAX_JOINT_DIVERGENCE_THRESHOLDS = 30
    STATE_TIME = 46
    #: Time of the motion, which stands still while the arm rests or waits; ours, not the guide's.
    MOTION_TIME = 47


class OutputInteger(IntEnum):
    """Integer registers that the robot program writes."""

    ACTUAL_MODE = 24
    LAST_SEQUENCE_ID = 25
    #: Number of points of the running trajectory that have begun; 0 = none.
    POINTS_BEGUN = 26
    SETPOINTS_DONE = 27
    REPEATS = 28
    SKIPPED = 29
    BUFFER_SIZE = 30
    OVERFLOWS = 31
    PROGRAM_VERSION = 32
    PROGRAM_NUMBER = 33
    PROGRAM_RUN = 34
    SAFE_OUTPUTS_TOKEN = 35
    MOTION_VERSION = 36
    PULSES = 37


class OutputDouble(IntEnum):
    """Double registers that the robot program writes."""

    LAG_TIME = 24


class FeedOutput(IntEnum):
    """Double registers that the robot program writes when a feed override slows a spline."""

    #: Present fraction of the planned speed, 0 to 1.
    FRACTION = 31
    #: Delay by all feed overrides since the program connected [s].
    DELAY = 32


class OffsetInput(IntEnum):
    """Double registers that the driver writes during a trajectory with path offsets."""

    #: Wanted offset along, across, normal [m].
    TARGET = 24
    #: Rate at which the time of the motion runs, 0 to 1.
    RATE = 27
    #: Axes of the path's frame: along; across; normal; each a vector in base axes.
    ALONG = 28
    ACROSS = 31
    NORMAL = 34
    #: Largest offset along, across, normal that the goal allows [m].
    LIMITS = 37
    #: Largest speed of the offset that the goal allows [m/s].
    SPEED = 40
    #: Largest acceleration of the offset that the goal allows [m/s^2].
    ACCELERATION = 41


class OffsetOutput(IntEnum):
    """Double registers that the robot program writes during a trajectory with path offsets."""

    #: Present offset along, across, normal [m].
    VALUE = 25
    #: Offset that the controller applies, in base axes [m].
    SHIFT = 28


class ServoMode(IntEnum):
    """Desired and actual mode of the buffered servo."""

    IDLE = 0
    TEACH = 1
    SERVO = 2


class SyncState(IntEnum):
    """Whether the robot follows the driver's set-points."""

    WAITING_TO_CONNECT = 0
    NONE = 1
    EXTERNAL_TO_ROBOT = 2
    ROBOT_TO_EXTERNAL = 3


class ExternalError(IntEnum):
    """Error that the driver reports to the robot program."""

    NONE = 0
    HALT = 1


#: Incremented when the robot program gains a feature that the driver relies on.
PROGRAM_VERSION = 5
#: The register of pulses has four counts, each less than this: the count of slot i is multiplied
#: by the i-th power of this. Counts wrap around, and go on from one goal to the next.
PULSE_COUNTS = 128

Register: TypeAlias = (
    InputInteger
    | InputDouble
    | OutputInteger
    | OutputDouble
    | OffsetInput
    | OffsetOutput
    | FeedOutput
)


def register_name(register: Register, offset: int = 0) -> str:
    """
    Return the name of a register in an RTDE recipe.

    :param offset: index within a group of registers, 0 for the first.
    """
    inputs = InputInteger | InputDouble | OffsetInput
    direction = 'input' if isinstance(register, inputs) else 'output'
    kind = 'int' if isinstance(register, InputInteger | OutputInteger) else 'double'
    return f'{direction}_{kind}_register_{register + offset}'


def six_register_names(register: InputDouble) -> tuple[str, ...]:
    """Return the names of a group of six registers, joint by joint."""
    return tuple(register_name(register, joint) for joint in range(6))


#: The input recipe of the buffered servo, in this order.
SERVO_INPUTS = (
    register_name(InputInteger.DESIRED_MODE),
    register_name(InputInteger.SEQUENCE_ID),
    register_name(InputInteger.EXTERNAL_ERROR),
    register_name(InputInteger.EXTERNAL_SYNC_STATE),
    *six_register_names(InputDouble.DESIRED_JOINT_POSITIONS),
    *six_register_names(InputDouble.MAX_JOINT_DIVERGENCE_THRESHOLDS),
    register_name(InputDouble.STATE_TIME),
    register_name(InputDouble.MOTION_TIME),
)
#: Reports of the buffered servo, in this order; the guide's program has the first three, too.
SERVO_OUTPUTS = (
    register_name(OutputInteger.ACTUAL_MODE),
    register_name(OutputInteger.LAST_SEQUENCE_ID),
    register_name(OutputDouble.LAG_TIME),
    *(
        register_name(register)
        for register in (
            OutputInteger.SETPOINTS_DONE,
            OutputInteger.REPEATS,
            OutputInteger.SKIPPED,
            OutputInteger.BUFFER_SIZE,
            OutputInteger.OVERFLOWS,
        )
    ),
)
#: The input recipe of path offsets, in this order: sequence number, then the doubles of
#: :class:`OffsetInput`.
OFFSET_INPUTS = (
    register_name(InputInteger.SEQUENCE_ID),
    *(
        register_name(OffsetInput.TARGET, i)
        for i in range(OffsetInput.ACCELERATION - OffsetInput.TARGET + 1)
    ),
)
#: The program's reports about path offsets, in this order.
OFFSET_OUTPUTS = (
    register_name(OutputInteger.LAST_SEQUENCE_ID),
    *(register_name(OffsetOutput.VALUE, i) for i in range(6)),
)
