# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Write doc/script_functions.md from the functions that the simulated controller registers.

A test compares page and functions; after a change of a function, run::

    python scripts/make_script_functions.py
"""

from __future__ import annotations

from collections.abc import Iterator
import inspect
from pathlib import Path
import sys
from typing import Any

CHECKOUT = Path(__file__).resolve().parents[1]
PAGE = CHECKOUT / 'doc' / 'script_functions.md'

HEAD = """# The script functions, one by one

Made by `scripts/make_script_functions.py` from the functions that the
[simulated controller](simulation.md) registers. Do not edit.

* **done**: a program gets the value, or sees the effect, that the row names.
* **does nothing**: the arguments are checked, and the program goes on. What the function sets is
  not simulated.
* **refused**: a program that contains the function does not start. Its sender gets line, column
  and `compile_error_name_not_found:NAME:`, as for a name that a real controller does not know.

A wrong argument ends the program with one sentence that names it. The simulator has these
functions whichever version it simulates: a program that runs here may need newer software than a
robot has. The manuals of 5.23 and newer, and those of 10.x, were not at hand: functions that only
they have can be missing.

The last three columns say which robots are known to have a function: CB3 (manual 3.15), e-Series
(manual 5.x) and PolyScope X (manual 10.x). A number is the first version; `≤ 5.21`: it is in the
manual of 5.21; `yes`: it is there, the version is unknown; `no`: it is not there. Where a cell is
empty, nothing is known.

Sources: the script manuals of 5.21 and 5.22; the manufacturer's *External Control* program and the
program of ur-rtde, which name the versions that some functions need; for `yes` and `no` of CB3 and
PolyScope X also what others report from the manuals of 3.15.4 and 10.x.

"""

#: The functions of the script manual of 5.21, with its chapter on interpreter mode.
MANUAL_5_21 = """
    clear_interpreter end_interpreter interpreter_mode

    conveyor_pulse_decode encoder_enable_pulse_decode encoder_enable_set_tick_count
    encoder_get_tick_count encoder_set_tick_count encoder_unwind_delta_tick_count end_force_mode
    end_freedrive_mode end_screw_driving end_teach_mode force_mode force_mode_set_damping
    force_mode_set_gain_scaling freedrive_mode freedrive_mode_no_incorrect_payload_check
    get_conveyor_tick_count get_freedrive_status get_target_tcp_pose_along_path
    get_target_tcp_speed_along_path movec movej movel movep optimovej optimovel
    path_offset_disable path_offset_enable path_offset_get path_offset_set
    path_offset_set_alpha_filter path_offset_set_max_offset pause_on_error_code
    position_deviation_warning reset_revolution_counter screw_driving servoj
    set_conveyor_tick_count set_pos set_safety_mode_transition_hardness speedj speedl
    stop_conveyor_tracking stopj stopl teach_mode tool_wrench_limit_disable tool_wrench_limit_set
    track_conveyor_circular track_conveyor_linear

    estimate_payload force get_actual_joint_positions get_actual_joint_positions_history
    get_actual_joint_speeds get_actual_tcp_pose get_actual_tcp_speed get_actual_tool_flange_pose
    get_base_acceleration get_controller_temp get_forward_kin get_gravity get_inverse_kin
    get_inverse_kin_has_solution get_joint_temp get_joint_torques get_steptime
    get_target_joint_positions get_target_joint_speeds get_target_payload get_target_payload_cog
    get_target_payload_inertia get_target_tcp_pose get_target_tcp_speed get_target_waypoint
    get_tcp_force get_tcp_offset get_tool_accelerometer_reading get_tool_current get_tool_temp
    high_holding_torque_disable high_holding_torque_enable is_steady is_within_safety_limits popup
    powerdown protective_stop set_base_acceleration set_baselight_iec set_baselight_off
    set_baselight_solid set_gravity set_payload set_payload_cog set_payload_mass set_target_payload
    set_tcp sleep str_at str_cat str_empty str_find str_len str_sub sync textmsg time to_num to_str
    tool_contact

    acos asin atan atan2 binary_list_to_integer ceil cos d2r floor get_list_length
    integer_to_binary_list interpolate_pose inv length log make_list norm normalize point_dist
    pose_add pose_dist pose_inv pose_sub pose_trans pow r2d random rotvec2rpy rpy2rotvec sin size
    sqrt tan

    enable_external_ft_sensor ft_rtde_input_enable get_analog_in get_analog_out
    get_configurable_digital_in get_configurable_digital_out get_digital_in get_digital_out
    get_flag get_standard_analog_in get_standard_analog_out get_standard_digital_in
    get_standard_digital_out get_tool_analog_in get_tool_digital_in get_tool_digital_out
    modbus_add_rw_signal modbus_add_signal modbus_delete_signal modbus_get_error
    modbus_get_signal_status modbus_get_time_since_signal_invalid
    modbus_request_update_signal_value modbus_reset_connection modbus_send_custom_command
    modbus_set_digital_input_action modbus_set_output_register modbus_set_output_signal
    modbus_set_signal_update_frequency modbus_set_signal_watchdog read_input_boolean_register
    read_input_float_register read_input_integer_register read_output_boolean_register
    read_output_float_register read_output_integer_register read_port_bit read_port_register
    request_boolean_from_primary_client request_float_from_primary_client
    request_integer_from_primary_client request_string_from_primary_client rpc_factory
    rtde_set_watchdog set_analog_inputrange set_analog_out set_configurable_digital_out
    set_digital_out set_flag set_standard_analog_out set_standard_digital_out
    set_tool_communication set_tool_digital_out set_tool_digital_output_mode set_tool_output_mode
    set_tool_voltage socket_close socket_get_var socket_open socket_read_ascii_float
    socket_read_binary_integer socket_read_byte_list socket_read_line socket_read_string
    socket_send_byte socket_send_int socket_send_line socket_send_string socket_set_var
    write_output_boolean_register write_output_float_register write_output_integer_register
    write_port_bit write_port_register zero_ftsensor

    modbus_set_runstate_dependent_choice set_analog_outputdomain
    set_configurable_digital_input_action set_gp_boolean_input_action set_input_actions_to_default
    set_runstate_configurable_digital_output_to_value set_runstate_gp_boolean_output_to_value
    set_runstate_standard_analog_output_to_value set_runstate_standard_digital_output_to_value
    set_runstate_tool_digital_output_to_value set_standard_analog_input_domain
    set_standard_digital_input_action set_tool_analog_input_domain set_tool_digital_input_action
    """.split()

#: Functions that the program of ur-rtde calls in all versions from 3.x on.
CB3 = """
    enable_external_ft_sensor end_teach_mode get_actual_tool_flange_pose get_forward_kin
    get_inverse_kin get_joint_torques is_steady is_within_safety_limits movel movej pose_trans
    rtde_set_watchdog servoc servoj set_gravity set_payload set_payload_cog set_payload_mass
    set_tcp speedj speedl stopj stopl teach_mode textmsg zero_ftsensor
    """.split()

#: Functions that others report from the manual of PolyScope X.
POLYSCOPE_X = """
    end_force_mode force_mode force_mode_set_damping force_mode_set_gain_scaling
    get_freedrive_status movec movej movel servoj speedj speedl stopj stopl
    """.split()

#: First versions that are known: CB3, e-Series, PolyScope X.
FIRST = {
    'direct_torque': ('', '5.23', ''),
    'force_mode_set_damping': ('3.5', '', ''),
    'force_mode_set_gain_scaling': ('no', '5.0', ''),
    'ft_rtde_input_enable': ('', '5.9', ''),
    'get_coriolis_and_centrifugal_torques': ('', '5.23', ''),
    'get_inverse_kin_has_solution': ('3.15', '5.10', ''),
    'get_jacobian': ('', '5.23', ''),
    'get_target_payload_inertia': ('', '5.10', ''),
    'get_target_waypoint': ('', '5.3', ''),
    'get_tcp_offset': ('3.6', '', ''),
    'inv': ('3.14', '5.9', ''),
    'jerk_gain_scaling_get': ('no', '', ''),
    'jerk_gain_scaling_set': ('no', '', ''),
    'motion_version_get': ('no', '5.22', ''),
    'motion_version_set': ('no', '5.22', ''),
    'optimovej': ('', '5.21', '10.8'),
    'optimovel': ('', '5.21', '10.8'),
    'protective_stop': ('3.8', '', ''),
    'set_target_payload': ('no', '5.10', ''),
    'size': ('3.14', '5.9', ''),
    'tool_contact': ('', '5.4', ''),
    'torque_command': ('', '5.22', ''),
    'transpose': ('3.14', '5.9', ''),
}

#: Functions of manuals that are not simulated, with their subjects.
NOT_SIMULATED = {
    'add_frame': 'frames of the world model',
    'attach_frame': 'frames of the world model',
    'convert_pose': 'frames of the world model',
    'delete_all_frames': 'frames of the world model',
    'delete_frame': 'frames of the world model',
    'eip_reader_factory': 'EtherNet/IP devices',
    'eip_writer_factory': 'EtherNet/IP devices',
    'estimate_payload': 'the payload from measured forces',
    'frame_tracking_disable': 'motions that follow a frame',
    'frame_tracking_enable': 'motions that follow a frame',
    'get_children': 'frames of the world model',
    'get_frame_parent': 'frames of the world model',
    'get_pose': 'frames of the world model',
    'get_tool_digital_output_mode': 'the mode of a tool output, read back',
    'get_tool_output_mode': 'the mode of a tool output, read back',
    'is_frame': 'frames of the world model',
    **dict.fromkeys(
        (
            *('mc_add_circular', 'mc_add_linear', 'mc_add_path', 'mc_get_target_rtcp_speed'),
            *('mc_initialize', 'mc_load_path', 'mc_run_motion', 'mc_set_pcs'),
            'mc_set_speed_factor',
        ),
        'toolpaths, whose points are in files of their own',
    ),
    'move_frame': 'frames of the world model',
    'reset_world_model': 'frames of the world model',
    'set_mass_properties': 'frames of the world model',
    'set_payload_from_attached_frames': 'frames of the world model',
    'torque_command': 'the older name of `direct_torque`',
    'varmsg': 'the value of a variable, shown on the pendant',
}


def page() -> str:
    """Return the text of doc/script_functions.md."""
    titles = ('function', 'here', 'CB3', 'e-Series', 'PolyScope X')
    lines = (titles, ('---',) * len(titles), *rows())
    return HEAD + ''.join('| ' + ' | '.join(cells) + ' |\n' for cells in lines)


def rows() -> Iterator[tuple[str, ...]]:
    """Yield the cells of each function, by name."""
    from ur_cartesian_driver.sim import assemble, SimulatorConfig
    from ur_cartesian_driver.sim.builtins import controller_builtins
    from ur_cartesian_driver.sim.builtins.builtin_group import has_effect

    functions = controller_builtins(assemble(SimulatorConfig()).controller)
    for name in sorted({*functions, *NOT_SIMULATED}):
        if name in NOT_SIMULATED:
            yield f'`{name}`', f'**refused**: {NOT_SIMULATED[name]}', *versions(name)
            continue
        function = functions[name]
        state = 'done' if has_effect(function) else '**does nothing**'
        about = (inspect.getdoc(function) or '').split('\n')[0]
        yield (
            f'`{name}({_parameters(function)})`',
            f'{state}: {about}' if about else state,
            *versions(name),
        )


def versions(name: str) -> tuple[str, str, str]:
    """Return the cells of a function for CB3, e-Series and PolyScope X."""
    cb3, e_series, x = FIRST.get(name, ('', '', ''))
    return (
        cb3 or ('yes' if name in CB3 else ''),
        e_series or ('≤ 5.21' if name in MANUAL_5_21 else ''),
        x or ('yes' if name in POLYSCOPE_X else ''),
    )


def _parameters(function: Any) -> str:
    return ', '.join(
        _parameter(parameter) for parameter in inspect.signature(function).parameters.values()
    )


def _parameter(parameter: inspect.Parameter) -> str:
    if parameter.kind is inspect.Parameter.VAR_KEYWORD:
        return f'{parameter.name}...'
    default = parameter.default
    if default is inspect.Parameter.empty:
        return parameter.name
    return (
        f'{parameter.name}={default:.4g}'
        if type(default) is float
        else (f'{parameter.name}={default!r}')
    )


if __name__ == '__main__':
    sys.path[:0] = [str(CHECKOUT)]
    PAGE.write_text(page(), encoding='utf-8')
