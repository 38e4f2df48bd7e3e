# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""A client that knows only the names and types of the UR ROS 2 driver."""

from importlib import import_module
from time import monotonic
from typing import Any

from rclpy.action.client import ActionClient
from rclpy.qos import DurabilityPolicy, qos_profile_system_default, QoSProfile

LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)


def kind(name: str) -> Any:
    """Return the class of a type, ``ur_msgs/srv/SetIO``."""
    package, group, name = name.split('/')
    return getattr(import_module(f'{package}.{group}'), name)


class UrDriverClient:
    """Calls services and actions, and listens to topics, while the cell's executor runs."""

    def __init__(self, cell):
        self.cell, self.node = cell, cell.client_node
        self._clients: dict[str, Any] = {}
        self._action_clients: list[Any] = []

    def destroy(self):
        """
        Destroy the clients of actions, which rclpy does not destroy with their node.

        They would keep the node's participant. If 32 participants are alive, nodes do not find
        each other.
        """
        for client in self._action_clients:
            client.destroy()

    def call(self, name, type_name='std_srvs/srv/Trigger', /, **fields):
        """Call a service and return its response."""
        service = kind(type_name)
        if name not in self._clients:
            self._clients[name] = self.node.create_client(service, name)
        client = self._clients[name]
        self.cell.spin_until(client.service_is_ready)
        return self.cell.await_(client.call_async(service.Request(**fields)), 90.0)

    def dashboard(self, name, type_name='std_srvs/srv/Trigger', /, **fields):
        """Call a service of the dashboard client."""
        if '/' not in type_name:
            type_name = f'ur_dashboard_msgs/srv/{type_name}'
        return self.call(f'/dashboard_client/{name}', type_name, **fields)

    def io(self, name, type_name='std_srvs/srv/Trigger', /, **fields):
        """Call a service of the controller of inputs and outputs."""
        if '/' not in type_name:
            type_name = f'ur_msgs/srv/{type_name}'
        return self.call(f'/io_and_status_controller/{name}', type_name, **fields)

    def listen(self, name, type_name, qos=qos_profile_system_default):
        """Return the list to which the messages of a topic are appended."""
        received: list[Any] = []
        self.node.create_subscription(kind(type_name), name, received.append, qos)
        return received

    def action(self, name, type_name):
        """Return the client of an action, once its server is there."""
        client = ActionClient(self.node, kind(type_name), name)
        self._action_clients.append(client)
        self.cell.spin_until(client.server_is_ready)
        return client

    def send(self, client, goal, feedback=None):
        """Send a goal and return its handle."""
        return self.cell.await_(
            client.send_goal_async(
                goal,
                feedback_callback=None
                if feedback is None
                else lambda message: feedback.append(message.feedback),
            )
        )

    def result(self, handle, timeout=60.0):
        """Return status and result of a goal."""
        response = self.cell.await_(handle.get_result_async(), timeout)
        return response.status, response.result

    def start_robot(self):
        """Start the arm as in the UR driver's integration tests; all calls have to succeed."""
        for name in (
            'close_popup',
            'close_safety_popup',
            'stop',
            'power_off',
            'power_on',
            'brake_release',
            'unlock_protective_stop',
        ):
            response = self.dashboard(name)
            assert response.success, f'{name}: {response.message}'
        running = kind('ur_dashboard_msgs/msg/RobotMode').RUNNING
        deadline = monotonic() + 20.0
        while (mode := self.dashboard('get_robot_mode', 'GetRobotMode')).success:
            if mode.robot_mode.mode == running:
                break
            assert monotonic() < deadline, mode.answer
        assert mode.success, mode.answer
        assert self.dashboard('stop').success
