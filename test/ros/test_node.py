# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
import signal
import subprocess
import sys
import threading
from time import monotonic
from typing import Any

from action_msgs.msg import GoalStatus
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PoseStamped, WrenchStamped
import pytest
import rclpy
from rclpy.action.server import RCLError
from rclpy.context import Context
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool, Float64, String
from std_srvs.srv import Trigger
from waiting import wait_for

from ur_cartesian_driver.driver.callbacks import LOG
from ur_cartesian_driver.kinematics.robot_description import robot_description
from ur_cartesian_driver.kinematics.robot_models import JOINT_NAMES
from ur_cartesian_driver.motion.errors import ErrorCode
from ur_cartesian_driver.msg import (
    DriverStatus,
    IOStates,
    RobotMode,
    SafetyMode,
    ToolData,
)
from ur_cartesian_driver.resources import share_path
from ur_cartesian_driver.ros import CartesianDriverNode
from ur_cartesian_driver.ros import node as node_module
from ur_cartesian_driver.ros.client import GoalClient, load_goal
from ur_cartesian_driver.ros.node_endpoints import LATCHED_QOS, STATE_QOS
from ur_cartesian_driver.ros.parameters.parameter_table import ParameterError

pytestmark = pytest.mark.slow

ABORTED = GoalStatus.STATUS_ABORTED
TOPICS = {
    'joint_states': (JointState, STATE_QOS),
    'ur_cartesian_driver/tcp_pose': (PoseStamped, STATE_QOS),
    'ur_cartesian_driver/wrench': (WrenchStamped, STATE_QOS),
    'ur_cartesian_driver/io_states': (IOStates, LATCHED_QOS),
    'ur_cartesian_driver/tool_data': (ToolData, LATCHED_QOS),
    'ur_cartesian_driver/robot_description': (String, LATCHED_QOS),
    'diagnostics': (DiagnosticArray, STATE_QOS),
    'ur_cartesian_driver/speed_scaling': (Float64, STATE_QOS),
    'ur_cartesian_driver/robot_mode': (RobotMode, LATCHED_QOS),
    'ur_cartesian_driver/safety_mode': (SafetyMode, LATCHED_QOS),
    'ur_cartesian_driver/robot_program_running': (Bool, LATCHED_QOS),
    'ur_cartesian_driver/status': (DriverStatus, LATCHED_QOS),
}


def subscribe(cell, names):
    """Return a mapping that fills with the newest message of each topic."""
    newest = {}
    for name in names:
        kind, qos = TOPICS[name]
        cell.client_node.create_subscription(
            kind, f'/{name}', lambda message, name=name: newest.update({name: message}), qos
        )
    return newest


def test_the_state_of_the_robot_is_published(single_cell):
    cell = single_cell
    newest = subscribe(cell, TOPICS)
    cell.spin_until(lambda: len(newest) == len(TOPICS))
    # The first message of a latched topic may be one from before the connection.
    cell.spin_until(lambda: newest['ur_cartesian_driver/robot_program_running'].data)
    cell.spin_until(lambda: newest['ur_cartesian_driver/status'].state == DriverStatus.READY)
    assert newest['joint_states'].name == list(JOINT_NAMES)
    assert list(newest['joint_states'].position) == pytest.approx(cell.sim.state().q)
    pose = newest['ur_cartesian_driver/tcp_pose']
    assert pose.header.frame_id == 'base'
    assert pose.pose.position.x == pytest.approx(cell.T_base_tcp.position[0])
    assert newest['ur_cartesian_driver/speed_scaling'].data == 0.0  # at rest
    assert newest['ur_cartesian_driver/robot_mode'].name == 'RUNNING'
    assert newest['ur_cartesian_driver/safety_mode'].name == 'NORMAL'
    status = newest['ur_cartesian_driver/status']
    assert status.robot_model == 'ur5e'
    cell.spin_until(lambda: newest['ur_cartesian_driver/status'].serial_number == '20000000000')
    assert newest['ur_cartesian_driver/wrench'].header.frame_id == 'tool0_controller'
    cell.spin_until(
        lambda: (
            newest['ur_cartesian_driver/robot_description'].data
            == robot_description(cell.node.driver.arm)
        )
    )


def test_a_value_that_cannot_be_published_does_not_silence_the_topics(single_cell, capfd):
    cell = single_cell
    newest = subscribe(cell, ['joint_states'])
    cell.spin_until(lambda: newest)
    cell.node.driver._robot.signals = 'nonsense'
    cell.spin_until(lambda: cell.node._publisher._io_topics._last == 'nonsense')
    newest.clear()
    cell.spin_until(lambda: newest)
    assert 'Traceback' in capfd.readouterr().err


def test_a_topic_that_fails_while_ros_is_up_does_not_silence_the_others(single_cell, capfd):
    cell = single_cell
    newest = subscribe(cell, ['joint_states'])
    cell.spin_until(lambda: newest)

    def fail(*_):
        raise RCLError('no memory')

    topic = cell.node._publisher._diagnostics_topic
    publish, topic.publish = topic.publish, fail
    cell.spin_until(lambda: 'no memory' in capfd.readouterr().err)
    topic.publish = publish
    newest.clear()
    cell.spin_until(lambda: newest)


def test_a_protective_stop_is_published(single_cell):
    cell = single_cell
    newest = subscribe(cell, ['ur_cartesian_driver/safety_mode', 'ur_cartesian_driver/status'])
    cell.spin_until(lambda: len(newest) == 2)
    cell.sim.protective_stop()
    cell.spin_until(lambda: newest['ur_cartesian_driver/safety_mode'].mode == 3)
    cell.spin_until(lambda: newest['ur_cartesian_driver/status'].state == DriverStatus.STOPPED)
    assert newest['ur_cartesian_driver/status'].message


def test_a_stopped_robot_program_comes_back_when_it_is_asked_for(single_cell):
    cell = single_cell
    resend = cell.client_node.create_client(Trigger, '/ur_cartesian_driver/resend_robot_program')
    cell.sim.stop_program()
    cell.spin_until(lambda: not cell.node.driver.status.program_running)
    status, result = cell.run(cell.goal((0.4, 0.0, 0.01, 0.0)))
    assert (status, result.error_code) == (ABORTED, ErrorCode.ROBOT_NOT_READY)
    assert cell.await_(resend.call_async(Trigger.Request())).success
    cell.wait_ready()
    assert cell.run(cell.goal((0.4, 0.0, 0.01, 0.0)))[1].error_code == 0


def test_destroying_the_node_stops_a_running_goal(no_thread_left, sim, executor, make_cell):
    cell = make_cell(sim, executor)
    cell.wait_ready()
    cell.send(cell.goal((5.0, 0.2, 0.2, 0.0)))
    cell.spin_until(lambda: any(abs(qd) > 0.02 for qd in sim.state().qd))
    cell.node.destroy_node()
    assert max(map(abs, sim.state().qd)) < 1e-3
    assert not any(
        thread.name.startswith(('goal', 'driver', 'state publisher', 'robot loop'))
        for thread in threading.enumerate()
    )


class RosLogger:
    """Keeps what it is told."""

    def __init__(self, name):
        self.name, self.records = name, []

    def __getattr__(self, severity):
        return lambda text: self.records.append((severity, text))


def test_each_node_logs_the_records_of_its_own_driver_with_their_tracebacks():
    loggers: Any = RosLogger('left'), RosLogger('right')
    left, right = map(node_module._LogBridge, loggers)
    left.source.info('of the left arm')
    right.source.info('of the right arm')
    LOG.warning('of no arm')
    left.close()
    right.source.info('alone')
    try:
        raise OSError('no memory')
    except OSError:
        LOG.exception('of no arm')
    right.close()
    assert loggers[0].records == [('info', 'of the left arm'), ('warning', 'of no arm')]
    right_arm, alone, (severity, text) = loggers[1].records
    assert (right_arm, alone) == (('info', 'of the right arm'), ('info', 'alone'))
    assert severity == 'error'
    assert text.startswith('of no arm\nTraceback ')
    assert text.endswith('OSError: no memory')


def test_the_arm_stops_before_anything_else_ends(single_cell):
    cell, node = single_cell, single_cell.node
    cell.send(cell.goal((5.0, 0.2, 0.2, 0.0)))
    cell.spin_until(lambda: node.action_server.running_motion)
    close, stopped = node.contact_action.close, []

    def close_late():
        wait_for(lambda: node.action_server.running_motion is None, 3.0)
        stopped.append(True)
        close()

    node.contact_action.close = close_late
    node.destroy_node()
    assert stopped


def test_the_command_ends_the_node_before_the_names(sim, parameters_for, monkeypatch):
    events = []

    class RecordedNode(CartesianDriverNode):
        def destroy_node(self):
            super().destroy_node()
            events.append('node')

    class RecordedNames:
        def __init__(self, *_):
            signal.raise_signal(signal.SIGINT)

        def close(self):
            events.append('names')

    monkeypatch.setattr(node_module, 'CartesianDriverNode', RecordedNode)
    monkeypatch.setattr(node_module, 'NamesProcess', RecordedNames)
    handlers = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        node_module.main(['driver', '--ur-driver-names', *arguments_of(parameters_for(sim))])
    finally:
        for number, handler in handlers.items():
            signal.signal(number, handler)
    assert events == ['node', 'names']


def arguments_of(parameters):
    """Return parameters as ROS arguments."""
    words = [f'{name}:={str(value).lower()}' for name, value in parameters.items()]
    return ['--ros-args', *(each for word in words for each in ('-p', word))]


def test_a_node_can_be_made_and_destroyed_again(no_thread_left, sim, make_cell):
    for _ in range(2):
        cell = make_cell(sim)
        cell.wait_ready()
        assert cell.run(cell.goal((0.4, 0.0, 0.01, 0.0)))[1].error_code == 0
        cell.close()


def test_a_node_with_bad_parameters_is_not_made_and_leaves_nothing(no_thread_left):
    context = Context()
    rclpy.init(args=[], context=context)
    with pytest.raises(ParameterError, match="ur_type is 'ur4'"):
        CartesianDriverNode(parameter_overrides={'ur_type': 'ur4'}, context=context)
    rclpy.shutdown(context=context)


def test_prefix_and_namespace_are_in_all_names(no_thread_left, sim, make_cell):
    cell = make_cell(sim, tf_prefix='left_')
    names = []
    cell.client_node.create_subscription(
        JointState, '/joint_states', lambda message: names.append(list(message.name)), STATE_QOS
    )
    cell.spin_until(lambda: names)
    assert names[0] == [f'left_{name}' for name in JOINT_NAMES]


def test_ctrl_c_at_the_client_cancels_the_goal(single_cell):
    cell = single_cell
    with cell.spun(), GoalClient() as client:
        sent = []

        def interrupt(feedback):
            if not sent and feedback.progress > 0.02:
                sent.append(feedback)
                signal.raise_signal(signal.SIGINT)

        _, result = client.send(cell.goal((5.0, 0.2, 0.2, 0.0)), interrupt)
    assert result.error_code == ErrorCode.CANCELLED


def test_a_client_without_a_driver_says_so(no_thread_left):
    with (
        GoalClient('nobody') as client,
        pytest.raises(TimeoutError, match='No driver serves /nobody/follow_cartesian_trajectory'),
    ):
        client.send(None, timeout=0.1)


def command(*arguments):
    return [sys.executable, '-m', 'ur_cartesian_driver.ros.node', '--ros-args', *arguments]


def test_a_signal_ends_the_goal_with_a_result_and_the_command_with_0(
    sim, parameters_for, tmp_path
):
    arguments = arguments_of(parameters_for(sim, robot_loop='process'))
    errors = tmp_path / 'stderr'
    with (
        errors.open('w') as stderr,
        subprocess.Popen(command(*arguments[1:]), stderr=stderr) as node,
    ):
        try:
            with GoalClient() as client:
                goal = load_goal(share_path() / 'config' / 'examples' / 'square.yaml')
                signals = [signal.SIGINT]  # a second one would not wait for the result

                def interrupt(_feedback):
                    if signals:
                        node.send_signal(signals.pop())

                result = run_when_ready(client, goal, interrupt)
            assert result.error_code == ErrorCode.CANCELLED, result.error_string
            assert result.error_string.startswith('The driver node is shutting down')
            assert node.wait(10.0) == 0
        finally:
            node.kill()
    assert max(map(abs, sim.state().qd)) < 1e-3
    assert 'Traceback' not in errors.read_text()


def run_when_ready(client, goal, on_feedback):
    """Send a goal again and again until the driver has connected to its robot."""
    deadline = monotonic() + 30.0
    while True:
        _, result = client.send(goal, on_feedback, timeout=30.0)
        if result.error_code != ErrorCode.ROBOT_NOT_READY or monotonic() > deadline:
            return result


@pytest.mark.parametrize(
    ('arguments', 'sentence'),
    [
        (['-p', 'ur_type:=ur4'], "Parameter ur_type is 'ur4', but must be one of ur3,"),
        (
            ['-p', 'max_tool_speed:=fast'],
            "Parameter max_tool_speed is 'fast', but must be a number.",
        ),
        (['-p', 'max_tool_sped:=0.5'], 'There is no parameter max_tool_sped; did you mean'),
        (
            ['-p', 'unlock_protective_stop:=true'],
            'unlock_protective_stop is a parameter of the node ur_driver_names; write -p '
            'ur_driver_names:unlock_protective_stop:=VALUE.',
        ),
        (['-p', 'ur_type'], "failed to initialize rcl: Couldn't parse parameter override rule"),
        (['--params-file', '/nowhere'], "failed to initialize rcl: Couldn't parse params file"),
        (['robot_ip:=10.0.0.5'], "'robot_ip:=10.0.0.5' is not understood. Usage: "),
        (['--', '-p', 'robot_ip:=10.0.0.5'], '-p robot_ip:=10.0.0.5 is not understood. Usage: '),
        (['--', '--ur-driver-name'], '--ur-driver-name is not understood. Usage: '),
    ],
)
def test_the_command_ends_with_a_sentence_for_bad_arguments(arguments, sentence):
    done = subprocess.run(
        command(*arguments), capture_output=True, text=True, timeout=30.0, check=False
    )
    assert done.returncode == 1
    assert done.stderr.splitlines()[-1].startswith(f'ur_cartesian_driver: {sentence}')
    assert 'Traceback' not in done.stderr


def test_help_starts_no_driver():
    done = subprocess.run(
        command('--', '--help'), capture_output=True, text=True, timeout=30.0, check=True
    )
    assert done.stdout.startswith('Usage: ur-cartesian-driver ')


def test_an_empty_list_in_a_file_is_explained(no_thread_left, tmp_path):
    path = tmp_path / 'parameters.yaml'
    path.write_text('/**: {ros__parameters: {static_frames: []}}')
    context = Context()
    rclpy.init(args=[], context=context)
    with pytest.raises(ParameterError, match='for an empty list'):
        CartesianDriverNode(context=context, cli_args=['--ros-args', '--params-file', str(path)])
    rclpy.shutdown(context=context)
