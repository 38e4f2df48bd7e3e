# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The service that changes the bodies of the cell.

A separate thread reads the bodies, one request after the other, because a mesh takes time.
"""

from __future__ import annotations

from pathlib import Path
import traceback
from typing import Any

from rclpy.node import Node

from ur_cartesian_driver.driver import Driver
from ur_cartesian_driver.motion.cell.cell import Cell, EMPTY_CELL
from ur_cartesian_driver.motion.cell.cell_file import cell_from_text
from ur_cartesian_driver.motion.errors import DriverError
from ur_cartesian_driver.robot.services.service_calls import failed, ServiceAnswer
from ur_cartesian_driver.ros.services.deferred_service import DeferredService, RequestQueue
from ur_cartesian_driver.srv import ChangeCell

#: Name that refusals give to the text with the bodies.
TEXT = 'bodies'


class CellService:
    """Serves ``~/change_cell``."""

    def __init__(self, node: Node, driver: Driver) -> None:
        """Start to serve."""
        self._logger, self._driver = node.get_logger(), driver
        self._queue = RequestQueue('change the cell', self._change, failed)
        self._service = DeferredService(node, ChangeCell, '~/change_cell', self._queue.submit)

    def close(self) -> None:
        """Refuse new requests; the one that is being carried out is completed."""
        self._queue.close()

    def _change(self, request: Any) -> ServiceAnswer:
        try:
            bodies = EMPTY_CELL
            if request.bodies.strip():
                bodies = cell_from_text(request.bodies, TEXT, Path())
            cell = self._driver.change_cell(
                bodies, remove=request.remove, attach=request.attach, release=request.release
            )
        except (DriverError, ValueError, OSError) as error:
            return failed(str(error))
        except Exception as error:
            self._logger.error(traceback.format_exc())
            return failed(
                f'The driver has a defect, {type(error).__name__}: {error}; its log says more.'
            )
        return ServiceAnswer(ok=True, text=sentence_of(cell))


def sentence_of(cell: Cell) -> str:
    """Return a sentence that names the bodies of a cell."""
    if not cell:
        return 'The cell has no bodies.'
    names = [
        f'{body.name} ({body.frame})' if body.is_carried else body.name for body in cell.bodies
    ]
    return f'The cell has {", ".join(names)}.'
