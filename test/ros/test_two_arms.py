# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Two robots and two drivers: what each of them is called, and that each does its own goal."""

from contextlib import ExitStack
from time import monotonic
from typing import Any

from action_msgs.msg import GoalStatus
import pytest
import rclpy
from rclpy.action.client import ActionClient
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from sensor_msgs.msg import JointState
from std_srvs.srv import Trigger

from ur_cartesian_driver.action import FollowCartesianTrajectory
from ur_cartesian_driver.driver import ConnectionState
from ur_cartesian_driver.motion.geometry.pose import Pose
from ur_cartesian_driver.msg import CartesianTrajectoryPoint
from ur_cartesian_driver.ros import CartesianDriverNode
from ur_cartesian_driver.ros.client import add_tf_prefix, load_goal
from ur_cartesian_driver.ros.message_fields import duration_message, pose_message
from ur_cartesian_driver.ros.topics import STATE_QOS
from ur_cartesian_driver.sim import SimulatedRobot, SimulatorConfig

#: The arms, and how far each goes along y [m].
WAYS = {'left': 0.02, 'right': -0.04}
#: What all nodes of a system have in common.
SHARED = {'/diagnostics', '/parameter_events', '/rosout', '/tf', '/tf_static'}


class Cell:
    """Two robots of two models, their drivers and one client, driven by the thread of the test."""

    def __init__(self, stack, parameters_for, names=tuple(WAYS), models=('ur5e', 'ur10e')):
        self.context = Context()
        rclpy.init(args=[], context=self.context)
        stack.callback(rclpy.shutdown, context=self.context)
        self.executor = SingleThreadedExecutor(context=self.context)
        self.sims = {
            name: stack.enter_context(
                SimulatedRobot(
                    SimulatorConfig(
                        model=model,
                        frequency=125.0,
                        rtde_port=0,
                        primary_port=0,
                        dashboard_port=0,
                        when_late='wait',
                    )
                )
            )
            for name, model in zip(names, models, strict=True)
        }
        self.nodes = {
            name: CartesianDriverNode(
                namespace=name,
                context=self.context,
                parameter_overrides=parameters_for(
                    sim,
                    ur_type=sim.config.model,
                    tf_prefix=f'{name}_',
                    robot_receive_timeout=1.0,
                    max_state_age=0.0,
                ),
            )
            for name, sim in self.sims.items()
        }
        self.client = rclpy.create_node('client', context=self.context)
        for node in (*self.nodes.values(), self.client):
            stack.callback(node.destroy_node)
            self.executor.add_node(node)
        stack.callback(self.executor.shutdown)

    def spin_until(self, condition, timeout=60.0):
        deadline = monotonic() + timeout
        while not condition():
            assert monotonic() < deadline, 'it did not happen in time'
            self.executor.spin_once(timeout_sec=0.02)

    def wait_ready(self):
        for node in self.nodes.values():
            self.spin_until(lambda node=node: node.driver.status.state is ConnectionState.READY)


@pytest.fixture
def cell(no_thread_left, parameters_for):
    with ExitStack() as stack:
        made = Cell(stack, parameters_for)
        made.wait_ready()
        yield made


def goal_along_y(sim, name, distance):
    state = sim.state()
    x, y, z = state.T_base_tcp.position
    goal = FollowCartesianTrajectory.Goal()
    goal.trajectory.header.frame_id = f'{name}_base'
    goal.trajectory.points.append(
        CartesianTrajectoryPoint(
            time_from_start=duration_message(1.0),
            pose=pose_message(Pose((x, y + distance, z), state.T_base_tcp.quaternion)),
        )
    )
    return goal


@pytest.mark.slow
def test_two_arms_follow_their_own_goals_at_the_same_time(cell):
    clients = {
        name: ActionClient(
            cell.client,
            FollowCartesianTrajectory,
            f'/{name}/ur_cartesian_driver/follow_cartesian_trajectory',
        )
        for name in WAYS
    }
    before = {name: sim.state().T_base_tcp.position for name, sim in cell.sims.items()}
    for client in clients.values():
        cell.spin_until(client.server_is_ready)
    requests = {
        name: clients[name].send_goal_async(goal_along_y(cell.sims[name], name, way))
        for name, way in WAYS.items()
    }
    cell.spin_until(lambda: all(request.done() for request in requests.values()))
    results = {name: request.result().get_result_async() for name, request in requests.items()}
    cell.spin_until(
        lambda: all(max(map(abs, sim.state().qd)) > 0.01 for sim in cell.sims.values())
    )
    cell.spin_until(lambda: all(result.done() for result in results.values()))
    for name, way in WAYS.items():
        response = results[name].result()
        assert response.status == GoalStatus.STATUS_SUCCEEDED, response.result.error_string
        x, y, z = before[name]
        assert cell.sims[name].state().T_base_tcp.position == pytest.approx(
            (x, y + way, z), abs=1e-4
        )
    for client in clients.values():
        client.destroy()
    check_names(cell)


def check_names(cell):
    """No name of one driver is a name of the other, and a service reaches one robot only."""
    topics = {
        name: {
            topic
            for topic, _ in cell.client.get_publisher_names_and_types_by_node(
                'ur_cartesian_driver', f'/{name}'
            )
        }
        for name in WAYS
    }
    services = {
        name: {
            service
            for service, _ in cell.client.get_service_names_and_types_by_node(
                'ur_cartesian_driver', f'/{name}'
            )
        }
        for name in WAYS
    }
    assert topics['left'] & topics['right'] <= SHARED
    assert not services['left'] & services['right']
    for name in WAYS:
        assert {t for t in topics[name] - SHARED if not t.startswith(f'/{name}/')} == set()
    joints = {}
    for name in WAYS:
        cell.client.create_subscription(
            JointState,
            f'/{name}/joint_states',
            lambda message, name=name: joints.update({name: message.name}),
            STATE_QOS,
        )
    cell.spin_until(lambda: len(joints) == 2)
    assert not set(joints['left']) & set(joints['right'])
    frames = [
        {node.action_server.frames.base, node.action_server.frames.tcp}
        for node in cell.nodes.values()
    ]
    assert not frames[0] & frames[1]
    ports = [set(node.driver.status.ports.values()) for node in cell.nodes.values()]
    assert not ports[0] & ports[1]
    stop = cell.client.create_client(Trigger, '/right/ur_cartesian_driver/dashboard/stop')
    cell.spin_until(stop.service_is_ready)
    answer = stop.call_async(Trigger.Request())
    cell.spin_until(answer.done)
    assert answer.result().success
    states = {name: sim.state().runtime_state.name for name, sim in cell.sims.items()}
    assert states == {'left': 'PLAYING', 'right': 'STOPPED'}


@pytest.mark.slow
def test_a_second_driver_of_the_same_name_is_told(no_thread_left, capfd):
    nowhere: dict[str, Any] = {'rtde_port': 1, 'robot_loop': 'thread'}
    context = Context()
    rclpy.init(args=[], context=context)
    executor = SingleThreadedExecutor(context=context)
    nodes = [CartesianDriverNode(context=context, parameter_overrides=nowhere) for _ in range(2)]
    try:
        executor.add_node(nodes[1])
        deadline = monotonic() + 10.0
        said = ''
        while 'Another node has the name /ur_cartesian_driver: ' not in said:
            assert monotonic() < deadline
            executor.spin_once(timeout_sec=0.1)
            said += capfd.readouterr().err
    finally:
        for node in nodes:
            node.destroy_node()
        executor.shutdown()
        rclpy.shutdown(context=context)


@pytest.mark.slow
def test_another_publisher_of_the_same_joints_is_told(no_thread_left, parameters_for, capfd):
    """A gripper's joints are nobody else's business: the first message does not end the check."""
    with ExitStack() as stack:
        cell = Cell(stack, parameters_for, ('left',), ('ur5e',))
        states = cell.client.create_publisher(JointState, '/left/joint_states', 10)
        cell.wait_ready()
        said = ''

        def warned():
            nonlocal said
            for joint in ('finger_joint', 'left_elbow_joint'):
                states.publish(JointState(name=[joint], position=[0.0]))
            said += capfd.readouterr().err
            return 'publishes joint_states' in said

        cell.spin_until(warned)
    assert '/client publishes joint_states with left_elbow_joint, too' in said


def test_a_goal_file_is_used_for_an_arm_with_a_prefix():
    text = (
        '{trajectory: {header: {frame_id: base}, controlled_frame: tool0, points: [{posture: '
        '{posture_joint_names: [elbow_joint]}}]}, segments: [{via_posture: '
        '{posture_joint_names: [elbow_joint]}}]}'
    )
    goal = add_tf_prefix(load_goal(text), 'left_')
    assert goal.trajectory.header.frame_id == 'left_base'
    assert goal.trajectory.controlled_frame == 'left_tool0'
    assert goal.trajectory.points[0].posture.posture_joint_names == ['left_elbow_joint']
    assert goal.segments[0].via_posture.posture_joint_names == ['left_elbow_joint']
    assert add_tf_prefix(load_goal('{}'), 'left_').trajectory.header.frame_id == ''
