# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The interface of the formats to which recordings are exported."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import BinaryIO, TypeAlias

from ur_cartesian_driver.driver.recordings.recording import Recording


@dataclass(frozen=True, slots=True, kw_only=True)
class ExportOptions:
    """The options of an export, the same for all formats."""

    #: Prefix of the names of frames and joints.
    tf_prefix: str = ''
    #: Called by the exporter after each packet.
    progress: Callable[[], object] = lambda: None


#: Writes a recording to a file. Raises ValueError if the recording is damaged, ImportError if a
#: package is missing, and OSError if a file cannot be written or read.
Exporter: TypeAlias = Callable[[Recording, BinaryIO, ExportOptions], None]
