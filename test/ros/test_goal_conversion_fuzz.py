# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Goals, services and parameters with anything in any field: a plan, or a sentence that says where.

The fields are found by walking the messages, so one that is added later is tried as well.
"""

from contextlib import contextmanager
from math import inf, nan

from hypothesis import given, HealthCheck, settings
from hypothesis import strategies as st
import pytest
from rosidl_parser.definition import (
    AbstractSequence,
    AbstractString,
    Array,
    NamespacedType,
)

from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.kinematics.robot_models import robot_model
from ur_cartesian_driver.motion.errors import DriverError, ErrorCode
from ur_cartesian_driver.motion.goal.known_frames import ArmSnapshot, Frames
from ur_cartesian_driver.motion.state.rtde_state import RobotState
from ur_cartesian_driver.planning import plan, PlanningOptions
from ur_cartesian_driver.protocol.program.trajectory_points import encode_points
from ur_cartesian_driver.ros.client import load_goal
from ur_cartesian_driver.ros.messages.goal_conversion import goal_from_message
from ur_cartesian_driver.ros.parameters.node_parameters import defaults, settings_from
from ur_cartesian_driver.ros.parameters.parameter_table import DECLARATIONS, ParameterError
from ur_cartesian_driver.ros.services.command_services import REQUEST_SERVICES
from ur_cartesian_driver.sim.simulator_config import HOME

ARM = Arm(robot_model('ur5e'))
HERE = ARM.forward(HOME)
STATE = RobotState(
    timestamp=0.0, actual_q=HOME, target_q=HOME, actual_tcp_pose=HERE, target_tcp_pose=HERE
)
NOW = 1_800_000_000_000_000_000
#: Two points, a segment each, an arc and an output: something of everything.
GOAL = """
trajectory:
  points:
    - pose:
        position: {x: -0.4919, y: -0.10, z: 0.4879}
        orientation: {x: 0.7071068, y: 0.7071068, w: 0.0}
      posture: {posture_joint_names: [elbow_joint], posture_joint_values: [1.5]}
    - pose:
        position: {x: -0.4919, y: -0.05, z: 0.4879}
        orientation: {x: 0.7071068, y: 0.7071068, w: 0.0}
segments:
  - {type: 1, blend_radius: 0.005, velocity: 0.1, acceleration: 0.5}
  - {type: 3, via: {position: {x: -0.47, y: -0.08, z: 0.4879},
     orientation: {x: 0.7071068, y: 0.7071068, w: 0.0}}}
"""
FLOATS = st.sampled_from([nan, inf, -inf, 0.0, -0.0, -1.0, 1.0, 1e-320, 1e-9, 1e3, 1e300, -1e300])
TEXTS = st.sampled_from(
    ['', 'base', 'tool0', 'no such frame', 'elbow_joint', 'x' * 5000, 'ä\n\x1b']
)


def leaves(message, path=''):
    """Yield each field that holds no message: its owner, name, place among others and type."""
    for name, kind in zip(message.get_fields_and_field_types(), message.SLOT_TYPES, strict=True):
        value = getattr(message, name)
        where = f'{path}.{name}'
        if isinstance(kind, NamespacedType):
            yield from leaves(value, where)
        elif isinstance(kind, AbstractSequence | Array) and isinstance(
            kind.value_type, NamespacedType
        ):
            for i, item in enumerate(value):
                yield from leaves(item, f'{where}[{i}]')
        else:
            yield message, name, where, kind


def anything(kind):
    """Return what a field of a type may hold."""
    if isinstance(kind, AbstractSequence):
        return st.lists(anything(kind.value_type), max_size=3)
    if isinstance(kind, Array):
        return st.lists(anything(kind.value_type), min_size=kind.size, max_size=kind.size)
    if isinstance(kind, AbstractString):
        return TEXTS
    if kind.typename in ('float', 'double'):
        return FLOATS
    if kind.typename == 'boolean':
        return st.booleans()
    bits = int(kind.typename.lstrip('uint'))
    low = 0 if kind.typename[0] == 'u' else -(2 ** (bits - 1))
    high = low + 2**bits - 1
    return st.sampled_from([low, high, 0, 1, 2, 3, 5])


def spoil(message, data, most=3):
    """Put anything into some fields; return which."""
    fields = list(leaves(message))
    changed = {}
    for i in data.draw(st.lists(st.integers(0, len(fields) - 1), min_size=1, max_size=most)):
        owner, name, where, kind = fields[i]
        value = data.draw(anything(kind), label=where)
        setattr(owner, name, value)
        changed[where] = value
    return changed


@contextmanager
def refusal():
    """Return a list with what was refused in the block; it has to be a sentence."""
    refused = []
    try:
        yield refused
    except (DriverError, ParameterError) as error:
        refused.append(error)
    assert all(str(error).endswith('.') for error in refused), refused


def test_the_goal_that_is_spoiled_is_sound():
    goal = goal_from_message(load_goal(GOAL), Frames(), now=NOW, snapshot=ArmSnapshot.of(STATE))
    assert len(plan(goal, STATE, ARM, PlanningOptions()).segments) == 2


@settings(
    max_examples=80, deadline=None, derandomize=True, suppress_health_check=[HealthCheck.too_slow]
)
@given(st.data())
def test_any_goal_is_planned_and_can_be_sent_or_is_refused_with_a_sentence(data):
    message = load_goal(GOAL)
    spoil(message, data)
    with refusal() as refused:
        goal = goal_from_message(message, Frames(), now=NOW, snapshot=ArmSnapshot.of(STATE))
        made = plan(goal, STATE, ARM, PlanningOptions())
        encode_points(segment.primitive for segment in made.segments)
    if refused:
        assert refused[0].code not in (ErrorCode.SUCCESSFUL, ErrorCode.EXECUTION_FAILED)
    else:
        end = ARM.forward(made.segments[-1].joints)
        wanted = goal.T_base_frame @ goal.waypoints[-1].pose
        if goal.T_flange_controlled is None:
            assert end.distance_to(wanted) < 1e-5, 'not where it was sent to'


@pytest.mark.parametrize('name', REQUEST_SERVICES)
@settings(max_examples=15, deadline=None, derandomize=True)
@given(data=st.data())
def test_any_request_becomes_a_call_or_is_refused_with_a_sentence(name, data):
    kind, call_of = REQUEST_SERVICES[name]
    request = kind.Request()
    spoil(request, data)
    with refusal():
        call_of(request)


@settings(max_examples=100, deadline=None, derandomize=True)
@given(st.data())
def test_any_parameter_is_taken_or_refused_with_its_name(data):
    standard = defaults()
    declaration = data.draw(st.sampled_from(DECLARATIONS))
    kind = type(standard[declaration.name])
    right = {
        bool: st.booleans(),
        int: st.integers(-2, 70_000),
        float: FLOATS,
        str: TEXTS,
        list: st.lists(TEXTS, max_size=2),
    }
    value = data.draw(right[kind] | st.one_of(*right.values()))
    with refusal() as refused:
        settings_from({declaration.name: value})
    assert not refused or declaration.name in str(refused[0]), (value, refused)
