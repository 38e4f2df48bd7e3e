# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
from dataclasses import fields
import re
from typing import get_args, get_origin, get_type_hints, Literal

import pytest
import rclpy
from rclpy.context import Context
from rclpy.node import Node
from rclpy.parameter import Parameter
import yaml

from ur_cartesian_driver.driver import DriverConfig
from ur_cartesian_driver.kinematics.robot_models import MODELS
from ur_cartesian_driver.planning import PlanningOptions
from ur_cartesian_driver.protocol.program.wire_dialects import DIALECTS
from ur_cartesian_driver.resources import share_path
from ur_cartesian_driver.ros.parameters.node_parameters import (
    as_overrides,
    declare_parameters,
    defaults,
    NodeSettings,
)
from ur_cartesian_driver.ros.parameters.parameter_table import DECLARATIONS, ParameterError

FILE = share_path() / 'config' / 'driver.yaml'


@pytest.fixture(scope='module')
def declared():
    """Return a function that declares the parameters with some values, on a node for a moment."""
    context = Context()
    rclpy.init(args=[], context=context)

    def declared(values=None, arguments=()):
        node = Node(
            'parameters',
            context=context,
            cli_args=list(arguments),
            parameter_overrides=as_overrides(values),
            automatically_declare_parameters_from_overrides=True,
        )
        try:
            return declare_parameters(node), {
                name: node.describe_parameter(name) for name in defaults()
            }
        finally:
            node.destroy_node()

    yield declared
    rclpy.shutdown(context=context)


def in_the_file():
    document = yaml.safe_load(FILE.read_text())
    assert list(document) == ['/**']
    return document['/**']['ros__parameters']


def test_the_file_holds_all_parameters_with_their_defaults():
    assert in_the_file() == defaults()


def test_choices_are_those_of_the_tables_and_types_that_use_them():
    choices = {declaration.name: declaration.choices for declaration in DECLARATIONS}
    assert choices['ur_type'] == list(MODELS)
    assert choices['wire_dialect'] == list(DIALECTS)
    for name, kind in get_type_hints(PlanningOptions).items():
        if get_origin(kind) is Literal:
            assert set(choices[name]) == set(get_args(kind)), name


def test_the_file_has_the_order_of_the_declarations():
    assert list(in_the_file()) == [declaration.name for declaration in DECLARATIONS]


def test_every_parameter_is_declared_once():
    names = [declaration.name for declaration in DECLARATIONS]
    assert len(names) == len(set(names))
    assert set(names) == set(defaults())


def test_every_option_is_a_parameter_but_for_what_is_found_out():
    options = {
        f.name for kind in (DriverConfig, PlanningOptions, NodeSettings) for f in fields(kind)
    }
    assert options - set(defaults()) == {
        'calibration_known',
        'optimove_known',
        'path_offset_known',
        'acceleration_known',
        'dialect',
        'prelude',
    }


def test_every_default_is_in_its_range():
    for declaration in DECLARATIONS:
        declaration.check(defaults()[declaration.name], defaults()[declaration.name])


def test_nothing_given_means_the_defaults(declared):
    settings, _ = declared()
    assert settings.driver == DriverConfig()
    assert settings.planning == PlanningOptions()
    assert settings.node == NodeSettings()


def test_the_file_means_the_defaults(declared):
    settings, _ = declared(arguments=['--ros-args', '--params-file', str(FILE)])
    assert settings.driver == DriverConfig()
    assert settings.planning == PlanningOptions()
    assert settings.node == NodeSettings()


def test_values_arrive_where_they_are_used(declared):
    settings, _ = declared(
        {
            'robot_ip': '10.0.0.1',
            'reverse_port': 0,
            'headless_mode': True,
            'max_points': 5,
            'tf_prefix': 'left_',
            'state_publish_rate': 125.0,
            'allowed_peers': ['10.0.0.1', ''],
            'static_frames': ['table left_base 1 0 0 0 0 0 1'],
        }
    )
    assert settings.driver.robot_ip == '10.0.0.1'
    assert settings.driver.reverse_port == 0
    assert settings.driver.headless_mode
    assert settings.driver.allowed_peers == ('10.0.0.1',)
    assert settings.planning.max_points == 5
    assert settings.planning.tf_prefix == 'left_'
    assert settings.node.state_publish_rate == 125.0
    assert settings.frames.T_base_frame('table').position == (1.0, 0.0, 0.0)


def test_an_empty_list_is_a_list_of_texts(declared):
    assert declared({'static_frames': []})[0].node.static_frames == ()


def test_parameters_can_be_given_as_rclpy_does(declared):
    settings, _ = declared([Parameter('ur_type', value='ur10e')])
    assert settings.driver.ur_type == 'ur10e'


def test_every_parameter_has_a_description_and_is_read_only(declared):
    _, descriptors = declared()
    for name, descriptor in descriptors.items():
        assert len(descriptor.description) > 10, name
        assert descriptor.read_only, name


def test_every_number_has_a_range(declared):
    _, descriptors = declared()
    for name, value in defaults().items():
        if type(value) is int:
            assert descriptors[name].integer_range, name
        elif type(value) is float:
            assert descriptors[name].floating_point_range, name


@pytest.mark.parametrize(
    ('values', 'sentence'),
    [
        ({'ur_typo': 'ur5e'}, 'There is no parameter ur_typo; did you mean ur_type?'),
        ({'zzz': 1}, 'There is no parameter zzz; config/driver.yaml lists all.'),
        ({'ur_type': 'ur4'}, "Parameter ur_type is 'ur4', but must be one of ur3, ur5,"),
        ({'ur_type': 5}, 'Parameter ur_type is 5, but must be a text; put it in quotes'),
        ({'max_tool_speed': 1}, 'Parameter max_tool_speed is 1, but must be a number; write 1.0.'),
        (
            {'max_tool_speed': -0.1},
            'Parameter max_tool_speed is -0.1, but must lie between 0 and 10.',
        ),
        (
            {'max_tool_speed': float('nan')},
            'Parameter max_tool_speed is nan, but must lie between',
        ),
        ({'max_points': 2.0}, 'Parameter max_points is 2.0, but must be a whole number.'),
        ({'headless_mode': 1}, 'Parameter headless_mode is 1, but must be true or false.'),
        (
            {'reverse_port': 65536},
            'Parameter reverse_port is 65536, but must lie between 0 and 65535.',
        ),
        (
            {'robot_loop': 'fork'},
            "Parameter robot_loop is 'fork', but must be one of process, thread.",
        ),
        (
            {'on_new_goal': 'queue'},
            "Parameter on_new_goal is 'queue', but must be one of preempt, reject",
        ),
        (
            {'static_frames': ['table']},
            'Parameter static_frames: "table" has 1 words instead of 9',
        ),
        (
            {'keepalive_period': 0.15},
            'Parameter robot_receive_timeout is 0.2 s, it has to be at least '
            'twice the keepalive_period',
        ),
    ],
)
def test_bad_values_give_one_sentence(declared, values, sentence):
    with pytest.raises(ParameterError, match='^' + re.escape(sentence)) as error:
        declared(values)
    assert '\n' not in str(error.value)


def test_a_bare_off_is_no_text_to_the_readers_of_parameters(declared):
    with pytest.raises(ParameterError, match=r'self_collision is False, .* put it in quotes'):
        declared(arguments=['--ros-args', '-p', 'self_collision:=off'])
    settings, _ = declared(arguments=['--ros-args', '-p', "self_collision:='off'"])
    assert settings.planning.self_collision == 'off'
