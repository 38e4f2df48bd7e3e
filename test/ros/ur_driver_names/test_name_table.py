# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The table of names: complete, and what the node offers."""

import importlib.util
import re

from checkout import CHECKOUT, needs_checkout
import pytest

from ur_cartesian_driver.ros.ur_driver_names.name_table import NAMES
from ur_cartesian_driver.ros.ur_driver_names.offered_name import Absent

pytestmark = pytest.mark.slow

SCRIPT = CHECKOUT / 'scripts' / 'make_ur_driver_names.py'
#: What launch files, scripts and integration tests of the UR driver name, by its nodes.
EXPECTED = {
    'dashboard_client': """
        power_on power_off brake_release unlock_protective_stop restart_safety play pause stop
        close_popup close_safety_popup connect quit shutdown clear_operational_mode load_program
        load_installation get_loaded_program program_state program_running program_saved
        get_robot_mode get_safety_mode get_safety_status is_in_remote_control get_programs
        upload_program update_program download_program generate_flight_report
        generate_support_file get_operational_mode set_operational_mode get_polyscope_version
        get_robot_model get_serial_number get_user_role set_user_role add_to_log popup
        raw_request""",
    'io_and_status_controller': """
        io_states tool_data robot_mode safety_mode robot_program_running set_io set_analog_output
        set_payload set_speed_slider set_speed_slider_fraction resend_robot_program
        hand_back_control zero_ftsensor set_gravity""",
    'speed_scaling_state_broadcaster': 'speed_scaling',
    'force_torque_sensor_broadcaster': 'wrench ft_data',
    'tcp_pose_broadcaster': 'pose',
    'urscript_interface': 'script_command',
    'ur_configuration_controller': 'get_robot_software_version',
    'freedrive_mode_controller': 'enable_freedrive_mode',
    'force_mode_controller': 'start_force_mode stop_force_mode',
    'scaled_joint_trajectory_controller': 'follow_joint_trajectory',
    'passthrough_trajectory_controller': 'follow_joint_trajectory',
    'joint_trajectory_controller': 'follow_joint_trajectory',
    'motion_primitive_forward_controller': 'motion_sequence',
    'tool_contact_controller': 'detect_tool_contact',
    'trajectory_until_node': 'execute',
    'ur_robot_state_helper': 'set_mode',
}
OF_RCLPY = re.compile(
    r'/rosout|/parameter_events|.*/(describe|get|list|set)_param.*|.*/get_type_description'
)


def test_the_table_has_each_name_once():
    names = [row.name for row in NAMES]
    assert len(names) == len(set(names))
    expected = {f'{node}/{name}' for node, text in EXPECTED.items() for name in text.split()}
    assert expected | {'joint_states'} <= set(names)


@needs_checkout
def test_the_page_has_the_tables():
    spec = importlib.util.spec_from_file_location('make_ur_driver_names', SCRIPT)
    script = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(script)
    text = script.PAGE.read_text('utf-8')
    assert text == script.page(text), 'run python scripts/make_ur_driver_names.py'


def test_a_name_is_served_or_absent_with_a_reason():
    for row in NAMES:
        assert bool(row.served_by) != isinstance(row, Absent)
        if isinstance(row, Absent):
            assert row.reason


@pytest.mark.parametrize('release', ['jazzy', 'lyrical'])
def test_the_node_offers_the_table(make_ur, release):
    client = make_ur({'release': release})
    names = client.cell.names
    offered = {}
    for kind, listed in {
        'topic': names.get_publisher_names_and_types_by_node,
        'subscribed topic': names.get_subscriber_names_and_types_by_node,
        'service': names.get_service_names_and_types_by_node,
    }.items():
        for name, types in listed(names.get_name(), names.get_namespace()):
            if not OF_RCLPY.fullmatch(name) and '/ur_cartesian_driver/' not in name:
                offered[name] = kind, types[0]
    for name in [name for name in offered if name.endswith('/_action/send_goal')]:
        kind = offered[name][1].removesuffix('_SendGoal')
        offered[name.removesuffix('/_action/send_goal')] = 'action', kind
    offered = {name: row for name, row in offered.items() if '/_action/' not in name}
    assert offered == {
        f'/{row.name}': (row.kind, row.type)
        for row in NAMES
        if not isinstance(row, Absent) and row.is_in(release) and row.name != 'joint_states'
    }


def test_a_missing_package_is_named_once(single_cell, monkeypatch, capfd):
    from ur_cartesian_driver.ros.ur_driver_names.names_node import UrDriverNames

    node = UrDriverNames(context=single_cell.context)
    try:
        output = capfd.readouterr().err
    finally:
        node.destroy_node()
    for package, name in (
        ('ur_msgs', 'io_and_status_controller/io_states'),
        ('ur_dashboard_msgs', 'ur_robot_state_helper/set_mode'),
        ('control_msgs', 'joint_trajectory_controller/follow_joint_trajectory'),
    ):
        (line,) = [line for line in output.splitlines() if f'package {package} is' in line]
        assert name in line
