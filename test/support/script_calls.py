# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""A call of each script function, with arguments that the simulated controller accepts."""

#: Joints with a pose well within reach, and a pose; the other points use the same numbers.
Q = '[0.2, -1.5, 1.5, -1.5, -1.5, 0.1]'
POSE = 'p[0.3, -0.3, 0.4, 0, 3.14159, 0]'
#: Arguments of the functions that need some.
ARGUMENTS = {
    'servoj': Q,
    'servoc': POSE,
    'speedj': '[0.1, 0, 0, 0, 0, 0], 0.5, 0.1',
    'speedl': '[0.1, 0, 0, 0, 0, 0], 0.5, 0.1',
    'direct_torque': '[0, 0, 0, 0, 0, 0]',
    'motion_version_set': '1',
    'jerk_gain_scaling_set': '0.5',
    'get_rtde_value': '"payload"',
    'set_base_acceleration': '[0, 0, 0]',
    'set_baselight_solid': '0, 0, 255',
    'modbus_reset_connection': '"127.0.0.1"',
    'set_payload': '1.2',
    'set_payload_mass': '1.2',
    'set_payload_cog': '[0, 0, 0.1]',
    'set_target_payload': '1.2, [0, 0, 0.1]',
    'set_gravity': '[0, 0, 9.82]',
    'set_flag': '1, True',
    'get_flag': '1',
    'set_euromap_output': '1, True',
    'get_euromap_output': '1',
    'get_euromap_input': '1',
    'write_port_bit': '3, True',
    'write_port_register': '3, 4',
    'read_port_bit': '3',
    'read_port_register': '3',
    'get_joint_temp': '0',
    'time': '',
    'rtde_set_watchdog': '"input_int_register_0", 1, "stop"',
    'force_mode': f'{POSE}, [0, 0, 1, 0, 0, 0], [0, 0, 5, 0, 0, 0], 2, [1, 1, 1, 1, 1, 1]',
    'screw_driving': '5, 0.1',
    'force_mode_set_damping': '0.1',
    'force_mode_set_gain_scaling': '1',
    'enable_external_ft_sensor': 'True',
    'ft_rtde_input_enable': 'True',
    'tool_wrench_limit_set': POSE,
    'track_conveyor_linear': 'p[1, 0, 0, 0, 0, 0], 500',
    'track_conveyor_circular': f'{POSE}, 500',
    'path_offset_set': '[0, 0, 0.01, 0, 0, 0], 1',
    'path_offset_get': '1',
    'path_offset_set_alpha_filter': '0.1',
    'path_offset_set_max_offset': '0.1, 0.1',
    'conveyor_pulse_decode': '1, 0, 1',
    'encoder_enable_pulse_decode': '0, 1, 8, 9',
    'encoder_enable_set_tick_count': '0, 0',
    'encoder_set_tick_count': '0, 12',
    'encoder_get_tick_count': '0',
    'set_conveyor_tick_count': '12',
    'socket_open': '"127.0.0.1", 50000',
    'socket_get_var': '"x"',
    'socket_set_var': '"x", 1',
    'socket_send_byte': '65',
    'socket_send_int': '65',
    'socket_send_line': '"a"',
    'socket_send_string': '"a"',
    'socket_read_ascii_float': '3',
    'socket_read_binary_integer': '3',
    'socket_read_byte_list': '3',
    'rpc_factory': '"xmlrpc", "http://127.0.0.1/RPC2"',
    'eip_reader_factory': '"101", 8',
    'eip_writer_factory': '"111", 8',
    'modbus_add_signal': '"127.0.0.1", 1, 2, 0, "m"',
    'modbus_add_rw_signal': '"127.0.0.1", 1, 2, 1, 3, 1, "m"',
    'modbus_delete_signal': '"m"',
    'modbus_send_custom_command': '"127.0.0.1", 1, 2, [1]',
    'popup': '"Ready?", blocking=True',
    'request_boolean_from_primary_client': '"Go on?"',
    'request_integer_from_primary_client': '"How many?"',
    'request_float_from_primary_client': '"How long?"',
    'request_string_from_primary_client': '"Which part?"',
    'textmsg': '"a", 1',
    'varmsg': '"a", 1',
    'set_standard_digital_input_action': '0, "default"',
    'set_configurable_digital_input_action': '0, "freedrive"',
    'set_tool_digital_input_action': '0, "default"',
    'set_gp_boolean_input_action': '0, "default"',
    'set_analog_inputrange': '0, 1',
    'set_standard_analog_input_domain': '0, 1',
    'set_tool_analog_input_domain': '0, 1',
    'set_runstate_standard_digital_output_to_value': '0, 1',
    'set_runstate_configurable_digital_output_to_value': '0, 1',
    'set_runstate_tool_digital_output_to_value': '0, 1',
    'set_runstate_gp_boolean_output_to_value': '0, 1',
    'set_runstate_standard_analog_output_to_value': '0, 1',
    'set_runstate_outputs': '[0]',
    'set_runstate_standard_digital_outputs': '[0]',
    'set_tool_output_mode': '0',
    'set_tool_communication': 'False, 115200, 0, 1, 1.5, 3.5',
    'set_tool_voltage': '0',
    'set_euromap_runstate_dependent_choice': '1, 0',
    'set_tool_digital_output_mode': '0, 1',
    'set_safety_mode_transition_hardness': '1',
    'set_speed_slider_fraction': '0.5',
    'position_deviation_warning': 'True',
    'pause_on_error_code': '171',
}
for _name in ('get', 'read'):
    for _kind in ('digital', 'standard_digital', 'configurable_digital', 'tool_digital', 'analog'):
        ARGUMENTS |= {f'get_{_kind}_{side}': '0' for side in ('in', 'out')}
    ARGUMENTS |= {
        f'get_{kind}_analog_{side}': '0' for kind in ('standard', 'tool') for side in ('in', 'out')
    }
    for _kind in ('boolean', 'float', 'integer'):
        ARGUMENTS |= {f'read_{side}_{_kind}_register': '0' for side in ('input', 'output')}
        ARGUMENTS[f'write_output_{_kind}_register'] = 'True' if _kind == 'boolean' else '0, 1'
ARGUMENTS['write_output_boolean_register'] = '0, True'
#: A call before functions of Modbus signals, which need a signal.
SIGNAL = 'modbus_add_signal("127.0.0.1", 1, 2, {}, "s")\n'
MODBUS = {
    'modbus_get_signal_status': (0, '"s"'),
    'modbus_get_error': (0, '"s"'),
    'modbus_get_time_since_signal_invalid': (0, '"s"'),
    'modbus_request_update_signal_value': (0, '"s"'),
    'modbus_set_signal_watchdog': (0, '"s", 5'),
    'modbus_set_output_register': (3, '"s", 7'),
    'modbus_set_output_signal': (1, '"s", True'),
    'modbus_set_digital_input_action': (0, '"s", "default"'),
    'modbus_set_runstate_dependent_choice': (1, '"s", 0'),
    'modbus_set_signal_update_frequency': (0, '"s", 10'),
}


def call(name):
    """Return a call as a program writes it, and the statements that it needs before."""
    if name in MODBUS:
        kind, arguments = MODBUS[name]
        return SIGNAL.format(kind), f'{name}({arguments})'
    return '', name if name == 'pause' else f'{name}({ARGUMENTS.get(name, "")})'
