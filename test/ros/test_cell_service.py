# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The cell of a running node, changed by its service."""

from concurrent.futures import Future
from types import SimpleNamespace
from typing import Any

from planning_scenes import box, held, pose, scene
import pytest
from rclpy.impl.rcutils_logger import RcutilsLogger
from visualization_msgs.msg import MarkerArray

from ur_cartesian_driver.motion.cell.cell import CellBody, PlacedShape
from ur_cartesian_driver.motion.cell.shapes import Sphere
from ur_cartesian_driver.ros.goals import planning_scene_subscriber
from ur_cartesian_driver.ros.goals.planning_scene_subscriber import PlanningSceneSubscriber
from ur_cartesian_driver.ros.node_endpoints import LATCHED_QOS
from ur_cartesian_driver.srv import ChangeCell

pytestmark = pytest.mark.slow

BODIES = """\
cell: 1
clearance: 0.01
bodies:
  post:
    cylinder: {radius: 0.02, length: 0.3}
    position: [0, -1.2, 0.15]
  part:
    box: [0.02, 0.02, 0.02]
    position: [0, -1.3, 0.1]
may_touch:
- [part, tool]
"""


@pytest.fixture
def change(single_cell):
    client = single_cell.client_node.create_client(ChangeCell, '/ur_cartesian_driver/change_cell')
    single_cell.spin_until(client.service_is_ready)

    def call(**fields):
        request = ChangeCell.Request(**fields)
        return single_cell.await_(client.call_async(request), timeout=8.0)

    yield call
    call(remove=sorted(body.name for body in single_cell.node.driver.cell.bodies))


def test_a_changed_cell_is_shown(single_cell, change):
    shown: list[Any] = []
    single_cell.client_node.create_subscription(
        MarkerArray, '/ur_cartesian_driver/cell_markers', shown.append, LATCHED_QOS
    )
    change(bodies=BODIES)
    single_cell.spin_until(lambda: shown and 'post' in {each.ns for each in shown[-1].markers})
    change(remove=['post'])
    single_cell.spin_until(lambda: {each.ns for each in shown[-1].markers} == {'part', ''})


def test_objects_of_the_planning_scene_become_bodies_beside_the_others(single_cell, monkeypatch):
    """moveit_msgs need not be installed for the conversion; the topic needs it."""
    node, driver = single_cell.node, single_cell.node.driver
    said: list[str] = []
    monkeypatch.setattr(RcutilsLogger, 'error', lambda self, text: said.append(text))
    scenes = PlanningSceneSubscriber(node, driver, node.action_server.frames, '/scene')
    driver.change_cell([CellBody(name='own', shapes=(PlacedShape(Sphere(0.01)),))])
    try:
        scenes.take(
            scene(box('part', at=pose(y=-1.2)), attached=[held(box('held'), link='tool0')])
        )
        cell = driver.cell
        assert cell.names == {'own', 'part', 'held'}
        assert frozenset({'held', 'tool'}) in cell.may_touch
        scenes.take(scene(box('new'), box('own')))
        assert driver.cell is cell
        scenes.take(scene(box('held', at=pose(y=1.2))))
        assert driver.cell.body('held').frame == 'base'
        assert driver.cell.may_touch == frozenset()
        scenes.take(scene(is_diff=False))
        assert driver.cell.names == {'own'}
    finally:
        scenes.close()
        driver.change_cell(remove=driver.cell.names)
    assert [text.partition(':')[0] for text in said] == [
        'planning_scene_topic is /scene, but moveit_msgs is not installed',
        'The planning scene is not taken over',
    ]
    assert 'object "own": the cell has another body of this name' in said[1]


class FakeNode:
    """A node with MoveIt beside it, whose service comes and goes."""

    def __init__(self, logger):
        self.get_logger = lambda: logger
        self.clients, self.has_service, self.requests = [], False, []

    def create_subscription(self, kind, topic, callback, qos, callback_group):
        return None

    def create_client(self, kind, name, callback_group):
        self.clients.append(name)
        return SimpleNamespace(service_is_ready=lambda: self.has_service, call_async=self._call)

    def create_timer(self, period, callback, callback_group, clock):
        self.tick = callback

    def _call(self, request):
        self.requests.append(request.components.components)
        answer = Future()
        answer.set_result(
            SimpleNamespace(scene=scene(box('first', at=pose(y=1.2)), is_diff=False))
        )
        return answer


class SceneRequest:
    """The request of moveit_msgs/GetPlanningScene, which need not be installed."""

    def __init__(self):
        self.components = SimpleNamespace(
            ROBOT_STATE_ATTACHED_OBJECTS=4, WORLD_OBJECT_GEOMETRY=16, components=0
        )


@pytest.mark.parametrize(
    ('topic', 'service'),
    [
        ('/monitored_planning_scene', '/get_planning_scene'),
        ('/left/scene', '/left/get_planning_scene'),
        ('scene', 'get_planning_scene'),
    ],
)
def test_the_scene_that_moveit_has_already_comes_by_its_service(
    single_cell, monkeypatch, topic, service
):
    """The topic has only what changes after the subscription."""
    monkeypatch.setattr(
        planning_scene_subscriber, 'class_of', lambda kind: SimpleNamespace(Request=SceneRequest)
    )
    driver = single_cell.node.driver
    node: Any = FakeNode(single_cell.node.get_logger())
    scenes = PlanningSceneSubscriber(node, driver, single_cell.node.action_server.frames, topic)
    try:
        assert node.clients == [service]
        node.tick()
        assert node.requests == []
        node.has_service = True
        node.tick()
        node.tick()
        assert node.requests == [4 | 16]
        single_cell.spin_until(lambda: driver.cell.names == {'first'})
        scenes.take(scene(is_diff=False))
        node.has_service = False
        node.tick()
        node.has_service = True  # MoveIt was started again
        node.tick()
        single_cell.spin_until(lambda: driver.cell.names == {'first'})
        assert len(node.requests) == 2
    finally:
        scenes.close()
        driver.change_cell(remove=driver.cell.names)


def test_bodies_come_as_the_text_of_a_file_and_all_or_nothing_changes(single_cell, change):
    answer = change(bodies=BODIES, attach=['part'])
    assert (answer.success, answer.message) == (True, 'The cell has post, part (tool0).')
    cell = single_cell.node.driver.cell
    assert cell.clearance_of(cell.body('post')) == 0.01
    assert cell.may_touch == {frozenset({'part', 'tool'})}
    for request, text in (
        (
            {'bodies': BODIES, 'remove': ['pots']},
            'the cell has no body "pots"; did you mean post?',
        ),
        ({'bodies': 'cell: 1\nbodies:\n  x: {box: [1, 2]}\n'}, 'bodies'),
        ({'bodies': '{'}, 'bodies'),
        ({'attach': ['part']}, '"part" is on the tool already'),
        ({'remove': ['post'], 'release': ['post']}, 'the cell has no body "post"'),
    ):
        refused = change(**request)
        assert not refused.success
        assert text in refused.message
        assert '\n' not in refused.message
        assert single_cell.node.driver.cell is cell
    answer = change(release=['part'], remove=['post'])
    assert (answer.success, answer.message) == (True, 'The cell has part.')
    assert change(remove=['part']).message == 'The cell has no bodies.'
