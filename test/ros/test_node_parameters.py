# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
from dataclasses import fields
from math import inf, nextafter
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
from ur_cartesian_driver.motion.goal.parameter_fields import parameter_fields
from ur_cartesian_driver.planning import PlanningOptions
from ur_cartesian_driver.protocol.program.wire_dialects import DIALECTS
from ur_cartesian_driver.resources import share_path
from ur_cartesian_driver.ros.parameters.node_parameters import (
    as_overrides,
    declare_parameters,
    defaults,
)
from ur_cartesian_driver.ros.parameters.node_settings import NodeSettings
from ur_cartesian_driver.ros.parameters.parameter_table import DECLARATIONS, ParameterError
from ur_cartesian_driver.ros.ur_driver_names.names_settings import NamesSettings

FILE = share_path() / 'config' / 'driver.yaml'
OWNERS = (DriverConfig, PlanningOptions, NodeSettings)
NAMES_PARAMETERS = {field.name for field in fields(NamesSettings)}


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
            # As the driver's node does.
            return declare_parameters(node, NAMES_PARAMETERS), {
                name: node.describe_parameter(name) for name in defaults()
            }
        finally:
            node.destroy_node()

    yield declared
    rclpy.shutdown(context=context)


def test_no_parameter_is_both_the_drivers_and_that_of_the_node_with_the_ur_drivers_names():
    """Files give all parameters to both nodes."""
    assert not NAMES_PARAMETERS & set(defaults())


def in_the_file():
    document = yaml.safe_load(FILE.read_text())
    assert list(document) == ['/**']
    return document['/**']['ros__parameters']


def test_the_file_holds_all_parameters_with_their_defaults():
    assert in_the_file() == defaults()


def test_choices_are_those_of_the_tables_and_types_that_use_them():
    choices = {declaration.name: declaration.field.choices for declaration in DECLARATIONS}
    assert choices['ur_type'] == tuple(MODELS)
    assert choices['wire_dialect'] == tuple(DIALECTS)
    for name, kind in get_type_hints(PlanningOptions).items():
        if get_origin(kind) is Literal:
            assert set(choices[name]) == set(get_args(kind)), name


def test_the_file_has_every_parameter_once():
    names = re.findall(r'^    (\w+):', FILE.read_text(), re.MULTILINE)
    assert sorted(names) == sorted(declaration.name for declaration in DECLARATIONS)


def test_the_file_tells_the_values_of_a_parameter():
    text = ' '.join(FILE.read_text().replace('    #', ' ').split())
    assert 'at 500 Hz. Range: 20 to 1000. servo_buffer_depth: 250' in text
    assert 'CB3: 125). Range: 0 or 10 to 500. rtde_frequency: 0.0' in text
    assert 'or slow it down. One of: refuse, slow. on_too_fast: refuse' in text


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
        'target_payload_known',
        'robot_motion_version',
        'acceleration_known',
        'cell',
        'dialect',
        'prelude',
        'leads',
        'read_files',
        'robot',
        'twin',
    }


def test_every_default_is_in_its_range():
    for declaration in DECLARATIONS:
        declaration.check(defaults()[declaration.name])


def ranges(kind):
    """Return the least and the largest value of each number of a dataclass, by its name."""
    return {
        each.name: [type(each.default)(bound) for bound in (each.range.low, each.range.high)]
        for each in parameter_fields(kind)
        if each.range is not None
    }


def beside(bound, direction):
    return bound + direction if type(bound) is int else nextafter(bound, direction * inf)


@pytest.mark.slow
@pytest.mark.parametrize('kind', OWNERS)
def test_a_number_is_refused_just_outside_its_range_in_ros_and_in_python(declared, kind):
    refused = 0
    for name, (low, high) in ranges(kind).items():
        for value in (beside(low, -1), beside(high, 1)):
            fault = f'{name} is {value}, but must .*lie between {low:.10g} and {high:.10g}\\.$'
            with pytest.raises(ValueError, match=f'^{fault}'):
                kind(**{name: value})
            with pytest.raises(ParameterError, match=f'^Parameter {fault}'):
                declared({name: value})
            refused += 1
    assert refused >= {DriverConfig: 46, PlanningOptions: 90, NodeSettings: 10}[kind]


@pytest.mark.parametrize('end', [0, 1])
def test_the_ends_of_all_ranges_are_taken_in_ros_and_in_python(declared, end):
    """All at once, because some parameters bound each other."""
    ends = {kind: {name: both[end] for name, both in ranges(kind).items()} for kind in OWNERS}
    driver, planning, node = (kind(**values) for kind, values in ends.items())
    settings, _ = declared({name: value for each in ends.values() for name, value in each.items()})
    assert (settings.driver, settings.planning, settings.node) == (driver, planning, node)
    assert driver.servoj_gain == (100.0, 2000.0)[end]
    assert planning.max_points == (1, 1_000_000)[end]
    assert node.tf_max_age == (0.001, 3600.0)[end]


def test_descriptors_show_ranges_and_choices(declared):
    _, descriptors = declared()
    shown = 0
    for name, bounds in {n: b for kind in OWNERS for n, b in ranges(kind).items()}.items():
        descriptor = descriptors[name]
        (found,) = descriptor.integer_range or descriptor.floating_point_range
        if name == 'rtde_frequency':
            bounds = [0.0, 500.0]
            assert descriptor.additional_constraints == 'range: 0 or 10 to 500'
        assert [found.from_value, found.to_value] == bounds, name
        shown += 1
    assert shown >= 70
    assert descriptors['on_too_fast'].additional_constraints == 'one of: refuse, slow'


def test_0_is_a_rate_beside_its_range(declared):
    assert DriverConfig(rtde_frequency=0.0) == declared({'rtde_frequency': 0.0})[0].driver
    with pytest.raises(ValueError, match=r'^rtde_frequency is 9\.9, but must be 0 \(as often as'):
        DriverConfig(rtde_frequency=9.9)


@pytest.mark.parametrize('kind', OWNERS)
def test_other_texts_than_the_choices_are_refused_in_python_too(kind):
    names = [each.name for each in parameter_fields(kind) if each.choices]
    assert len(names) >= 1
    for name in names:
        with pytest.raises(ValueError, match=f"^{name} is 'other', but must be one of "):
            kind(**{name: 'other'})


def test_a_description_is_the_comment_of_the_field(declared):
    _, descriptors = declared()
    assert descriptors['tf_prefix'].description == (
        'Prefix of joint and frame names, for two robots in one description, for example left_.'
    )
    *_, example = descriptors['safe_outputs'].description.split('\n')
    assert example == "Example: ['standard_digital 3 0', 'standard_analog 0 0.0 current']"


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
