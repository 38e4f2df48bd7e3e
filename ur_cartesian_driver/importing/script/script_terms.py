# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The treatment of each statement and function of URScript.

The functions come from the script manuals 3.15 (CB3), 5.11 to 5.25 (e-Series) and 10 (PolyScope
X), and from the programs that PolyScope saves.
"""

from __future__ import annotations

from ur_cartesian_driver.importing.import_format import (
    honoured,
    left_out,
    refused,
    term_table,
)

#: The topics whose terms are not functions.
STATEMENTS, PARAMETERS = 'statements', 'parameters of moves'

_IDLE = 'its value is not in the file; an idle robot is read, and the path may depend on that'
_UNANSWERED = 'nothing answers here, and the path may depend on the answer'
_SETTING = 'a goal does not change settings of the installation'
_PAYLOAD = 'give it as payload_changes of the goal, or with the service set_payload'
_FORCE = 'a goal gives way to forces only with `press`'
_OTHERS = 'a goal writes nothing for other programs'
_SET_POINTS = (
    'set-points in time are no path of moves; write the points with times into a CSV file, or let '
    'the robot run the program'
)
_BY_FORCE = 'where the arm goes is not in the file; `press` of a goal gives way to forces'
_BY_HAND = 'where a person moves the arm is not in the file'
_TRACKING = 'where the belt or frame moves the arm is not in the file'
_OFFSET = 'where the offset moves the arm is not in the file; a goal has `path_offset`'
_WORLD = 'frames of the world model are not known here; write the poses with pose_trans'
_TOOLPATH = 'its path is in another file; import that file'
_ASKED = 'the answer of a person is not in the file; write it into the program'

TERMS = term_table(
    honoured(
        STATEMENTS,
        *(
            'def',
            'return',
            'global',
            'local',
            'if',
            'switch',
            'while',
            'break',
            'continue',
            'halt',
        ),
        *('thread', 'run', 'join', 'kill', 'enter_critical', 'exit_critical', '$'),
    ),
    left_out(STATEMENTS, 'a goal does not wait for a person', 'pause'),
    refused(STATEMENTS, 'a secondary program cannot move the arm', 'sec'),
    honoured('moves', 'movej', 'movel', 'movep', 'movec', 'optimovej', 'optimovel'),
    honoured('moves', 'stopj', 'stopl', 'set_pos'),
    refused('moves', _SET_POINTS, 'servoj', 'servoc', 'speedj', 'speedl', 'direct_torque'),
    refused(
        'moves',
        _TOOLPATH,
        *('mc_add_circular', 'mc_add_linear', 'mc_add_path', 'mc_get_target_rtcp_speed'),
        *('mc_initialize', 'mc_load_path', 'mc_run_motion', 'mc_set_pcs', 'mc_set_speed_factor'),
    ),
    left_out(
        'moves',
        'the robot keeps its own',
        *('motion_version_set', 'motion_version_get', 'reset_revolution_counter'),
        *('jerk_gain_scaling_set', 'jerk_gain_scaling_get'),
    ),
    honoured(PARAMETERS, 'a', 'v', 't', 'r', 'mode'),
    honoured('TCP and payload', 'set_tcp', 'get_tcp_offset'),
    left_out(
        'TCP and payload',
        _PAYLOAD,
        *('set_payload', 'set_payload_mass', 'set_payload_cog', 'set_target_payload'),
        *('set_mass_properties', 'set_payload_from_attached_frames'),
    ),
    left_out(
        'TCP and payload',
        _IDLE,
        *('get_target_payload', 'get_target_payload_cog', 'get_target_payload_inertia'),
    ),
    honoured(
        'outputs',
        *('set_digital_out', 'set_standard_digital_out', 'set_configurable_digital_out'),
        *('set_tool_digital_out', 'set_analog_out', 'set_standard_analog_out'),
        'set_analog_outputdomain',
    ),
    left_out(
        'outputs',
        _OTHERS,
        *('set_flag', 'set_euromap_output', 'write_port_bit', 'write_port_register'),
        *('write_output_boolean_register', 'write_output_float_register'),
        'write_output_integer_register',
    ),
    left_out(
        'outputs',
        _IDLE,
        *('get_digital_out', 'get_standard_digital_out', 'get_configurable_digital_out'),
        *('get_tool_digital_out', 'get_analog_out', 'get_standard_analog_out', 'get_flag'),
        *('get_euromap_output', 'read_output_boolean_register', 'read_output_float_register'),
        *('read_output_integer_register', 'get_tool_digital_output_mode', 'get_tool_output_mode'),
    ),
    left_out(
        'inputs',
        _IDLE,
        *('get_digital_in', 'get_standard_digital_in', 'get_configurable_digital_in'),
        *('get_tool_digital_in', 'get_analog_in', 'get_standard_analog_in', 'get_tool_analog_in'),
        *('get_euromap_input', 'read_input_boolean_register', 'read_input_float_register'),
        *('read_input_integer_register', 'read_port_bit', 'read_port_register'),
    ),
    honoured('time', 'sleep', 'sync', 'get_steptime'),
    left_out('time', _IDLE, 'time'),
    left_out('time', 'nobody has to write inputs here', 'rtde_set_watchdog'),
    honoured(
        'numbers, lists and text',
        *(
            'acos',
            'asin',
            'atan',
            'atan2',
            'cos',
            'sin',
            'tan',
            'd2r',
            'r2d',
            'sqrt',
            'pow',
            'log',
        ),
        *('ceil', 'floor', 'norm', 'normalize', 'inv', 'transpose', 'length', 'size', 'make_list'),
        *('get_list_length', 'struct', 'integer_to_binary_list', 'binary_list_to_integer'),
        *('str_at', 'str_cat', 'str_empty', 'str_find', 'str_len', 'str_sub', 'to_num', 'to_str'),
    ),
    left_out(
        'numbers, lists and text',
        'its numbers differ from run to run, and the path may depend on them',
        'random',
    ),
    honoured(
        'poses and kinematics',
        *('pose_add', 'pose_sub', 'pose_trans', 'pose_inv', 'pose_dist', 'point_dist'),
        *('interpolate_pose', 'rotvec2rpy', 'rpy2rotvec', 'wrench_trans', 'get_forward_kin'),
        *('get_inverse_kin', 'get_inverse_kin_has_solution', 'is_within_safety_limits'),
        *('get_jacobian', 'get_jacobian_time_derivative'),
    ),
    refused(
        'poses and kinematics',
        _WORLD,
        *('add_frame', 'attach_frame', 'delete_frame', 'delete_all_frames', 'move_frame'),
        *('get_pose', 'convert_pose', 'reset_world_model', 'is_frame', 'get_frame_parent'),
        'get_children',
    ),
    honoured(
        'the arm',
        *('get_actual_tcp_pose', 'get_target_tcp_pose', 'get_target_tcp_pose_along_path'),
        'tool_pose',
        *('get_actual_tool_flange_pose', 'get_target_waypoint', 'get_joint_positions'),
        *('get_actual_joint_positions', 'get_target_joint_positions', 'is_steady'),
        *('get_actual_joint_speeds', 'get_target_joint_speeds', 'get_actual_tcp_speed'),
        *('get_target_tcp_speed', 'get_target_tcp_speed_along_path'),
        'get_target_joint_accelerations',
    ),
    left_out(
        'the arm',
        _IDLE,
        *('force', 'get_tcp_force', 'get_joint_torques', 'get_joint_temp', 'get_controller_temp'),
        *('get_tool_current', 'get_tool_accelerometer_reading', 'get_freedrive_status'),
        *('get_actual_joint_positions_history', 'tool_contact', 'get_mass_matrix'),
        *('get_coriolis_and_centrifugal_torques', 'get_actual_joint_accelerations'),
        *('get_tool_temp', 'get_gravity', 'get_base_acceleration', 'get_rtde_value'),
        'force_mode_get_damping',
    ),
    refused('forces and hands', _BY_FORCE, 'force_mode', 'screw_driving'),
    refused(
        'forces and hands',
        _BY_HAND,
        *('freedrive_mode', 'freedrive_mode_no_incorrect_payload_check', 'teach_mode'),
    ),
    left_out(
        'forces and hands',
        _FORCE,
        *('end_force_mode', 'force_mode_set_damping', 'force_mode_set_gain_scaling'),
        *('end_screw_driving', 'end_freedrive_mode', 'end_teach_mode', 'zero_ftsensor'),
        *('enable_external_ft_sensor', 'ft_rtde_input_enable'),
        *('tool_wrench_limit_set', 'tool_wrench_limit_disable'),
    ),
    refused(
        'belts and offsets',
        _TRACKING,
        *('track_conveyor_linear', 'track_conveyor_circular', 'frame_tracking_enable'),
    ),
    refused('belts and offsets', _OFFSET, 'path_offset_enable', 'path_offset_set'),
    left_out(
        'belts and offsets',
        'a goal follows no belt, and gives way only to its own `path_offset`',
        *('stop_conveyor_tracking', 'frame_tracking_disable', 'path_offset_disable'),
        *('path_offset_set_alpha_filter', 'path_offset_set_max_offset', 'conveyor_pulse_decode'),
        *('encoder_enable_pulse_decode', 'encoder_enable_set_tick_count'),
        *('encoder_set_tick_count', 'set_conveyor_tick_count'),
    ),
    left_out(
        'belts and offsets',
        _IDLE,
        *('get_conveyor_tick_count', 'encoder_get_tick_count', 'path_offset_get'),
    ),
    honoured('belts and offsets', 'encoder_unwind_delta_tick_count'),
    left_out(
        'other machines',
        _UNANSWERED,
        *('socket_open', 'socket_close', 'socket_get_var', 'socket_set_var', 'socket_send_byte'),
        *('socket_send_int', 'socket_send_line', 'socket_send_string', 'socket_read_line'),
        *('socket_read_ascii_float', 'socket_read_binary_integer', 'socket_read_byte_list'),
        *('socket_read_string', 'rpc_factory', 'interpreter_mode', 'end_interpreter'),
        *('clear_interpreter', 'modbus_add_signal', 'modbus_add_rw_signal'),
        *('modbus_delete_signal', 'modbus_get_signal_status', 'modbus_get_error'),
        *('modbus_set_output_register', 'modbus_set_output_signal', 'modbus_send_custom_command'),
        *('modbus_set_digital_input_action', 'modbus_set_runstate_dependent_choice'),
        *('modbus_set_signal_update_frequency', 'eip_reader_factory', 'eip_writer_factory'),
        *('modbus_set_signal_watchdog', 'modbus_get_time_since_signal_invalid'),
        *('modbus_request_update_signal_value', 'modbus_reset_connection'),
    ),
    left_out('persons', 'a goal tells nothing to persons', 'popup', 'textmsg', 'varmsg'),
    refused(
        'persons',
        _ASKED,
        *('request_boolean_from_primary_client', 'request_float_from_primary_client'),
        *('request_integer_from_primary_client', 'request_string_from_primary_client'),
    ),
    left_out(
        'installation and safety',
        _SETTING,
        *('set_standard_digital_input_action', 'set_configurable_digital_input_action'),
        *('set_tool_digital_input_action', 'set_gp_boolean_input_action'),
        *('set_input_actions_to_default', 'set_analog_inputrange'),
        *('set_standard_analog_input_domain', 'set_tool_analog_input_domain'),
        *('set_runstate_standard_digital_output_to_value', 'set_runstate_outputs'),
        *('set_runstate_configurable_digital_output_to_value', 'set_tool_output_mode'),
        *('set_runstate_tool_digital_output_to_value', 'set_runstate_standard_digital_outputs'),
        *('set_runstate_gp_boolean_output_to_value', 'set_tool_communication'),
        *('set_runstate_standard_analog_output_to_value', 'set_tool_voltage'),
        *('set_euromap_runstate_dependent_choice', 'set_tool_digital_output_mode'),
        *('set_safety_mode_transition_hardness', 'set_speed_slider_fraction'),
        *('high_holding_torque_enable', 'high_holding_torque_disable'),
        *('position_deviation_warning', 'pause_on_error_code', 'set_gravity'),
        *('set_base_acceleration', 'set_baselight_off', 'set_baselight_iec'),
        'set_baselight_solid',
    ),
    left_out(
        'installation and safety',
        'a goal ends at its last point, with the power on',
        *('powerdown', 'protective_stop'),
    ),
)

#: The reasons to leave out functions whose values can differ on a robot.
ASSUMED = frozenset({_IDLE, _UNANSWERED, TERMS['random'].reason})
#: The functions, by name.
FUNCTIONS = {
    name: term for name, term in TERMS.items() if term.topic not in (STATEMENTS, PARAMETERS)
}
