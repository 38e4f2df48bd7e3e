# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The parameters of the node with the UR driver's names."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Literal

from ur_cartesian_driver.motion.goal.field_annotations import Range
from ur_cartesian_driver.motion.goal.parameter_fields import check_parameters


@dataclass(frozen=True, slots=True, kw_only=True)
class NamesSettings:
    """The parameters of the node with the UR driver's names."""

    #: The driver's node; without a leading / it is relative to the namespace of this node.
    driver: str = 'ur_cartesian_driver'
    #: The UR driver release to follow where releases differ. jazzy: the wrench
    #: is in tool0. lyrical, and what came after it: in tool0_controller, and there is no
    #: scaled_joint_trajectory_controller.
    release: Literal['jazzy', 'lyrical'] = 'jazzy'
    #: Rate of io_states and tool_data [Hz], which also come with each change.
    io_states_rate: Annotated[float, Range(0.1, 100.0)] = 10.0
    #: true: set_mode unlocks a protective stop. Whoever sets this sees to it that somebody has
    #: looked for the cause of each stop: the manufacturer forbids resetting them automatically.
    unlock_protective_stop: bool = False
    #: Folder of this computer whose files upload_program and update_program may read, and
    #: download_program may write; empty: none.
    program_directory: str = ''
    #: How long freedrive goes on after the last message that asks for it [s].
    freedrive_timeout: Annotated[float, Range(0.1, 60.0)] = 10.0

    def __post_init__(self) -> None:
        """Check types and ranges."""
        check_parameters(self)
