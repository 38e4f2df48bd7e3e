# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The node that serves the names of the UR ROS 2 driver, and the command that runs it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
import re
import sys
import threading
from typing import Any

import rclpy
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.node import Node
from rclpy.utilities import try_shutdown

from ur_cartesian_driver.ros.message_fields import class_of
from ur_cartesian_driver.ros.parameters.node_parameters import (
    as_overrides,
    declared_values,
    defaults,
    explained_overrides,
    refuse_unknown,
)
from ur_cartesian_driver.ros.parameters.parameter_table import (
    declarations_of,
    ParameterError,
    ParameterValue,
)
from ur_cartesian_driver.ros.ur_driver_names.driver_node import DriverNode
from ur_cartesian_driver.ros.ur_driver_names.name_table import NAMES
from ur_cartesian_driver.ros.ur_driver_names.names_settings import NamesSettings
from ur_cartesian_driver.ros.ur_driver_names.offered_name import Absent

NODE_NAME = 'ur_driver_names'
#: With this argument :func:`main` ends when its standard input is closed, because the driver that
#: started it has then ended.
WITH_PARENT = '--with-parent'


class UrDriverNames(Node):
    """
    Serves the topics, services and actions of the UR ROS 2 driver, in its own namespace.

    It calls the driver's node over ROS and may be in another process. Without a driver, every call
    fails and says so.
    """

    def __init__(
        self,
        *,
        parameter_overrides: Mapping[str, ParameterValue] | None = None,
        **node_kwargs: Any,
    ) -> None:
        """
        Start to serve.

        :param node_kwargs: for ``rclpy.node.Node``.
        :raises ParameterError: a parameter is unknown or invalid; the text says why.
        """
        with explained_overrides():
            super().__init__(
                NODE_NAME,
                parameter_overrides=as_overrides(parameter_overrides),
                automatically_declare_parameters_from_overrides=True,
                **node_kwargs,
            )
        self._offered: list[Any] = []
        try:
            settings = _settings(self)
            self.driver = DriverNode(self, settings.driver)
            self._offer_all(settings)
        except BaseException:
            self.destroy_node()
            raise

    def _offer_all(self, settings: NamesSettings) -> None:
        missing: dict[str, list[str]] = {}
        for row in NAMES:
            if isinstance(row, Absent) or not row.is_in(settings.release):
                continue
            kind = class_of(row.type)
            if kind is None:
                missing.setdefault(row.type.split('/')[0], []).append(row.name)
            else:
                self._offered.append(row.offer(self.driver, settings, kind))
        for package, names in missing.items():
            self.get_logger().warning(  # type: ignore[no-untyped-call]  # rclpy's
                f'The package {package} is not installed, or older than these names, which are '
                f'not served: {", ".join(names)}.'
            )

    def destroy_node(self) -> None:
        """Stop serving, and destroy the node."""
        if hasattr(self, 'driver'):
            self.driver.close()
        offered, self._offered = self._offered, []
        for each in reversed(offered):
            if hasattr(each, 'close'):
                each.close()
        super().destroy_node()  # type: ignore[no-untyped-call]  # rclpy's


def _settings(node: Node) -> NamesSettings:
    """
    Declare the parameters of a node, and return their values.

    :raises ParameterError: a name is unknown or a value invalid.
    """
    declarations = tuple(declarations_of(NamesSettings))
    # Parameters of the driver come here, too, if they are given to all nodes.
    for name in defaults():
        if node.has_parameter(name):
            node.undeclare_parameter(name)
    known = [declaration.name for declaration in declarations]
    refuse_unknown(node.list_parameters([], 0).names, known, 'doc/coming_from/ur_driver.md')
    values = declared_values(node, declarations)
    try:
        return NamesSettings(**values)  # type: ignore[arg-type]  # the next line catches these
    except ValueError as error:
        raise ParameterError(f'Parameter {str(error).rstrip(".")}.') from None


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the node until SIGINT or SIGTERM."""
    given = list(sys.argv if arguments is None else arguments)
    with_parent = WITH_PARENT in given
    try:
        rclpy.init(args=[argument for argument in given if argument != WITH_PARENT])
    except RuntimeError as error:
        # rcl appends the source line to its sentence.
        sys.exit(f'{NODE_NAME}: {re.split(r", at /", str(error))[0]}')
    if with_parent:
        threading.Thread(target=_shut_down_with_parent, daemon=True).start()
    try:
        node = UrDriverNames()
    except ParameterError as error:
        try_shutdown()
        sys.exit(f'{NODE_NAME}: {error}')
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    try:
        executor.spin()
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    finally:
        node.destroy_node()
        try_shutdown()


def _shut_down_with_parent() -> None:
    """Wait until the other end of standard input is closed, then end the node."""
    sys.stdin.read()
    try_shutdown()


if __name__ == '__main__':
    main()
