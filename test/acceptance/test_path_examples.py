# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The examples, carried out by the Python API and over ROS on one simulated robot.

Its time runs faster than real time. The record of a client of its own is judged by the geometry of
the tests.
"""

import contextlib
from dataclasses import replace
from functools import partial
from importlib import import_module, util
import threading
from typing import Any

from checkout import CHECKOUT, needs_checkout
from goal_geometry import Kinematics
from goal_judge import judge, promise_of, Run
from plain_clients import PlainRtde
import pytest
import rclpy
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from tracked_files import tracked_files
from waiting import wait_for

from ur_cartesian_driver.driver import ConnectionState, DriverConfig
from ur_cartesian_driver.execution.monitoring import standstill
from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.kinematics.robot_models import robot_model
from ur_cartesian_driver.motion.cell.cell import EMPTY_CELL
from ur_cartesian_driver.motion.cell.cell_file import read_cell
from ur_cartesian_driver.motion.errors import ErrorCode, RobotNotReady
from ur_cartesian_driver.motion.goal.known_frames import ArmSnapshot
from ur_cartesian_driver.path import DOWN, Frames, mm, Path
from ur_cartesian_driver.program.render import ProgramSettings
from ur_cartesian_driver.robot.program import program_sockets
from ur_cartesian_driver.ros import CartesianDriverNode
from ur_cartesian_driver.ros.client import GoalClient
from ur_cartesian_driver.sim import SimulatedRobot, SimulatorConfig

FOLDER = CHECKOUT / 'examples'
#: By set-points, which keep to the clock, or against a part. In virtual time they are carried out
#: by test_path_offsets.py, test_presses.py, test_replaced_tails.py, test_stall.py and
#: test_feed_override.py; those with a part in the hand, by test_held_parts_on_the_robot.py.
HELD = {'polish_rim', 'glue_contour', 'deburr_ring'}
IN_VIRTUAL_TIME = {'tracked_seam', 'grind', 'replanned', 'stall', 'fed_bead', *HELD}
EXAMPLES = sorted({path.stem for path in tracked_files(FOLDER, '*.py')} - {'on_robot'})
NAMES = [name for name in EXAMPLES if name not in IN_VIRTUAL_TIME]

pytestmark = [
    pytest.mark.acceptance,
    pytest.mark.slow,
    pytest.mark.exhaustive,
    needs_checkout,
]

#: Simulated seconds per second, and cycles per simulated second: one that small computers can do.
RATE, FREQUENCY = 15.0, 125.0
MODEL = robot_model('ur5e')
ROBOT_PORTS = ('rtde_port', 'primary_port', 'dashboard_port')
OUR_PORTS = ('reverse_port', 'script_sender_port', 'trajectory_port', 'script_command_port')


def example(name):
    """Return the module of an example."""
    spec = util.spec_from_file_location(f'example_{name}', FOLDER / f'{name}.py')
    module = util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


class Cell:
    """One robot, the node with its driver, a client, and a record of the robot's motion."""

    def __init__(self, robot, node, client, rtde):
        self.robot, self.node, self.client, self.rtde = robot, node, client, rtde
        self.driver = node.driver
        self.is_first = True

    def go_home(self):
        home = self.robot.config.q
        self.robot.call(lambda controller: controller.motion.teleport(home))
        wait_for(lambda: self.driver.state.target_q == home, 10.0)
        return self.driver.state

    def judged(self, path, execute, frames):
        """Carry out a path; return its outcome and the faults of the motion."""
        state = self.go_home()
        goal = path.goal(frames, ArmSnapshot.of(state))
        made = self.driver.plan(goal)
        if any(segment.free_axis for segment in goal.segments):  # judged as it was chosen
            goal = replace(goal, waypoints=made.goal.waypoints, segments=made.goal.segments)
        first_row = max(len(self.rtde.rows) - 1, 0)
        # The driver's clock cannot be kept on a busy computer: see below.
        outcome = execute(path.tolerances(time=-1.0))
        self.rtde.wait(0.05)
        # A controller that has to wait for the computer leaves cycles out, in which nothing moves:
        # so the rows are counted.
        rows = [
            replace(row, time=i / FREQUENCY) for i, row in enumerate(self.rtde.rows[first_row:])
        ]
        is_first, self.is_first = self.is_first, False
        run = Run(
            goal=goal,
            promise=promise_of(made),
            arm=Kinematics(
                Arm(MODEL).geometry,
                MODEL.position_limits,
                goal.T_flange_controlled or state.T_flange_tcp,
            ),
            joint_speeds=MODEL.max_joint_speed,
            max_tool_speed=0.25,
            cycle=1.0 / FREQUENCY,
            q=state.actual_q,
            sent=0.0,
            rows=rows,
            is_first=is_first,
            late=0.1 + 0.4 * len(goal.script_calls),  # a function takes its own time
            succeeded=outcome.succeeded,
            outcome=f'{outcome.code.name}: {outcome.text}',
        )
        return outcome, list(judge(run))


@pytest.fixture(scope='module')
def cell(private_ros_graph):
    every_frame = [frame for name in NAMES for frame in getattr(example(name), 'FRAMES', ())]
    monkeypatch = pytest.MonkeyPatch()
    # Timeouts that count in simulated time, which passes quickly.
    monkeypatch.setattr(standstill, 'STANDSTILL_TIMEOUT', RATE * standstill.STANDSTILL_TIMEOUT)
    patient = partial(ProgramSettings, point_timeout=60.0)
    monkeypatch.setattr(program_sockets, 'ProgramSettings', patient)
    config = SimulatorConfig(
        rtde_port=0,
        primary_port=0,
        dashboard_port=0,
        rate=RATE,
        frequency=FREQUENCY,
        when_late='wait',
    )
    parameters: dict[str, Any] = {
        'headless_mode': True,
        'robot_loop': 'thread',
        'max_state_age': 0.0,
        'robot_receive_timeout': 10.0,
        'allow_scripts': True,
        'script_prelude': example('pick').PRELUDE,
        'static_frames': [as_parameter(frame) for frame in every_frame],
    }
    context = Context()
    rclpy.init(args=[], context=context)
    with SimulatedRobot(config) as robot:
        node = CartesianDriverNode(
            context=context,
            parameter_overrides={
                'rtde_port': robot.ports.rtde,
                'primary_port': robot.ports.primary,
                'dashboard_port': robot.ports.dashboard,
                **dict.fromkeys(OUR_PORTS, 0),
                **parameters,
            },
        )
        executor = SingleThreadedExecutor(context=context)
        executor.add_node(node)
        spinning = threading.Thread(target=executor.spin)
        spinning.start()
        try:
            node.driver.frames = Frames(static_frames=every_frame)
            get_ready(node.driver)
            assert node.driver.status.state is ConnectionState.READY
            with (
                GoalClient() as client,
                PlainRtde('127.0.0.1', robot.ports.rtde, FREQUENCY) as rtde,
            ):
                yield Cell(robot, node, client, rtde)
        finally:
            executor.shutdown()
            spinning.join()
            node.destroy_node()
            rclpy.shutdown(context=context)
            monkeypatch.undo()


def get_ready(driver):
    """Wait for the robot program; on a busy computer it may be lost, and is sent again."""
    for _ in range(3):
        with contextlib.suppress(RobotNotReady):
            return driver.wait_ready(15.0)
        driver.resend_robot_program()
    return driver.wait_ready(15.0)


def as_parameter(frame):
    return f'{frame.name} {frame.parent} ' + ' '.join(map(repr, frame.T_parent_frame.row()))


def test_there_are_examples_of_at_most_thirty_lines():
    assert len(NAMES) >= 14
    assert set(EXAMPLES) > IN_VIRTUAL_TIME
    for name in EXAMPLES:
        assert len((FOLDER / f'{name}.py').read_text().splitlines()) <= 30


def established(controller):
    """Set all digital inputs, as if what an example waits for had come."""
    controller.io.digital_in.standard[:] = [True] * len(controller.io.digital_in.standard)


@pytest.mark.parametrize('over_ros', [False, True], ids=['api', 'ros'])
@pytest.mark.parametrize('name', NAMES)
def test_an_example_is_carried_out_as_it_says(cell, name, over_ros):
    module = example(name)
    bodies = read_cell(module.CELL) if hasattr(module, 'CELL') else EMPTY_CELL
    cell.driver.options = replace(cell.driver.options, cell=bodies)
    start = cell.go_home().actual_tcp_pose
    air = [cell.driver.air_travel(**module.AIR)] if hasattr(module, 'AIR') else []
    path = getattr(module, name)(start, *air)
    frames = Frames(static_frames=getattr(module, 'FRAMES', ()))
    execute = cell.client.execute if over_ros else cell.driver.execute
    cell.robot.call(established)  # a welding source has its arc
    outcome, wrong = cell.judged(path, execute, frames)
    outcome.raise_for_error()
    if name == 'far_start':
        # Its travel to point 0 is judged by test_travelled_goals.py.
        wrong = [(kind, text) for kind, text in wrong if 'to point 0 ' not in text]
    assert wrong == []


@pytest.mark.parametrize('is_spun', [True, False])
def test_a_node_that_is_there_can_be_the_client(cell, is_spun):
    node = rclpy.create_node('user', context=cell.node.context)
    if is_spun:
        cell.node.executor.add_node(node)
    path = Path(cell.go_home().actual_tcp_pose).at(speed=0.2).by(dy=0.02)
    try:
        with GoalClient(node=node) as client:
            client.wait_ready(30.0)
            assert client.execute(path).raise_for_error().text.startswith('The point was executed')
        assert (node.executor is not None) == is_spun
    finally:
        node.destroy_node()


def test_clients_come_and_go_on_a_node_whose_executor_waits(cell):
    node = rclpy.create_node('user', context=cell.node.context)
    cell.node.executor.add_node(node)
    try:
        for _ in range(100):  # a wait that begins meanwhile must not meet a destroyed client
            GoalClient(node=node).close()
        with GoalClient(node=node) as client:
            client.wait_ready(30.0)
    finally:
        node.destroy_node()


def test_a_path_that_begins_elsewhere_is_refused_unless_its_first_motion_leads_there(cell):
    x, y, z = cell.go_home().actual_tcp_pose.position
    elsewhere = Path((x, y + 0.02, z), DOWN)
    outcome = cell.driver.execute(elsewhere.by(dx=0.05))
    assert outcome.code is ErrorCode.INVALID_GOAL
    assert outcome.text.startswith('the start of the path is 20.0 mm and 0.000 rad away from the')
    assert cell.driver.plan(elsewhere.joint((x, y + 0.05, z)))


def test_a_frame_that_the_driver_does_not_know_is_refused(cell):
    start = cell.go_home().actual_tcp_pose
    outcome = cell.driver.execute(Path(start, frame='table').by(dx=0.05))
    assert outcome.code is ErrorCode.INVALID_GOAL
    assert 'is "table", which is not a known frame' in outcome.text
    over_ros = cell.client.execute(Path(start, frame='table').by(dx=0.05))
    assert (over_ros.code, over_ros.text) == (outcome.code, outcome.text)


def test_points_are_appended_to_a_path_that_is_open(cell):
    start = cell.go_home().actual_tcp_pose
    first = Path(start).at(speed=0.1, blend=mm(2)).by(dy=0.04).by(dx=0.02)
    more = Path(first.end).at(speed=0.1).by(dy=-0.02).goal()
    motion = cell.driver.start(cell.driver.plan(first.keep_open()))
    motion.append(more.waypoints, more.segments, last=True)
    motion.result(30.0).raise_for_error()
    end = cell.driver.state.target_tcp_pose
    assert end.distance_to(more.waypoints[-1].pose) < 1e-5


def test_an_example_is_a_program(ur_sim, monkeypatch, capsys):
    monkeypatch.syspath_prepend(FOLDER)
    on_robot = import_module('on_robot')
    ports: dict[str, Any] = {
        name: getattr(ur_sim.ports, name.removesuffix('_port')) for name in ROBOT_PORTS
    } | dict.fromkeys(OUR_PORTS, 0)
    # Robot and driver share this interpreter, which can be busy for longer than 0.2 s.
    busy: dict[str, Any] = {
        'robot_loop': 'thread',
        'max_state_age': 0.0,
        'robot_receive_timeout': 1.0,
    }
    config = partial(DriverConfig, **ports, **busy)
    monkeypatch.setattr(on_robot, 'DriverConfig', config)
    monkeypatch.setattr('sys.argv', ['square.py', '--plan'])
    on_robot.run(example('square').square)
    assert 'point 3: LINEAR -> MOVEL, 0.200 m in 2.100 s' in capsys.readouterr().out
    assert ur_sim.state().q == ur_sim.config.q
