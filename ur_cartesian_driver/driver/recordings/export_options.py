# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The interface of the formats that a recording is exported to."""

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
    #: To be called after each packet.
    progress: Callable[[], object] = lambda: None


#: Writes a recording; raises ValueError if it is damaged, ImportError if a package is missing, or
#: OSError.
Exporter: TypeAlias = Callable[[Recording, BinaryIO, ExportOptions], None]
