# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The page of script functions has what the controller registers, and nothing else."""

import inspect

from checkout import CHECKOUT, needs_checkout
import pytest
from script_calls import call

from ur_cartesian_driver.importing.script.script_terms import FUNCTIONS
from ur_cartesian_driver.protocol.rtde.rtde_fields import fields_of, OUTPUT_TYPES
from ur_cartesian_driver.sim import SimulatorConfig
from ur_cartesian_driver.sim.builtins import controller_builtins
from ur_cartesian_driver.sim.builtins.builtin_group import has_effect
from ur_cartesian_driver.sim.controller import Controller
from ur_cartesian_driver.sim.rtde_output_values import read_output

#: Functions with optional arguments (?), and some others, as the script manual of 5.21 has them.
SIGNATURES = """
    encoder_get_tick_count encoder_index opt?
    force_mode task_frame selection_vector wrench type limits
    force_mode_set_damping damping
    force_mode_set_gain_scaling scaling
    freedrive_mode freeAxes? feature?
    movec pose_via pose_to a? v? r? mode?
    movej q a? v? t? r?
    optimovej goal a? v? r?
    movel pose a? v? t? r?
    optimovel goal a? v? r?
    movep pose a? v? r?
    path_offset_disable a?
    path_offset_set offset type
    path_offset_set_max_offset transLimit rotLimit
    pause_on_error_code code argument?
    position_deviation_warning enabled threshold?
    reset_revolution_counter qNear?
    screw_driving f v_limit
    servoj q a? v? t? lookahead_time? gain?
    set_conveyor_tick_count tick_count absolute_encoder_resolution?
    speedj qd a t?
    speedl xd a t? aRot?
    stop_conveyor_tracking a?
    stopj a
    stopl a aRot?
    tool_wrench_limit_set frame_offset Fx? Fy? Fz? Mx? My? Mz?
    track_conveyor_circular center ticks_per_revolution rotate_tool? encoder_index?
    track_conveyor_linear direction ticks_per_meter encoder_index?

    get_actual_joint_positions_history steps?
    get_forward_kin q? tcp?
    get_inverse_kin x qnear? maxPositionError? maxOrientationError? tcp?
    get_inverse_kin_has_solution pose qnear? maxPositionError? maxOrientationError? tcp?
    get_joint_temp j
    is_within_safety_limits position qNear?
    popup s title? warning? error? blocking?
    set_base_acceleration a
    set_baselight_solid r g b
    set_gravity d
    set_payload m cog?
    set_payload_cog CoG
    set_target_payload m cog inertia? transition_time?
    set_tcp pose tcp_name?
    sleep t
    str_find src target start_from?
    str_sub src index len?
    textmsg s1 s2?
    time mode?
    tool_contact direction?

    d2r d
    interpolate_pose p_from p_to alpha
    log b f
    make_list length initial_value capacity?
    pose_dist p_from p_to
    pose_trans p_from p_from_to
    r2d r
    rpy2rotvec rpy_vector

    enable_external_ft_sensor enable sensor_mass? sensor_measuring_offset? sensor_cog?
    ft_rtde_input_enable enable sensor_mass? sensor_measuring_offset? sensor_cog?
    modbus_add_rw_signal IP slave_number read_address read_register_count write_address \
        write_register_count signal_name sequential_mode?
    modbus_add_signal IP slave_number signal_address signal_type signal_name sequential_mode? \
        register_count?
    modbus_get_error signal_name error_source?
    modbus_get_signal_status signal_name is_secondary_program?
    modbus_reset_connection connection_id is_blocking?
    modbus_send_custom_command IP slave_number function_code data
    modbus_set_output_register signal_name register_value is_secondary_program?
    modbus_set_output_signal signal_name digital_value is_secondary_program?
    modbus_set_signal_update_frequency signal_name update_frequency
    modbus_set_signal_watchdog signal_name new_timeout_in_sec
    request_boolean_from_primary_client message
    rpc_factory type url
    rtde_set_watchdog variable_name min_frequency action?
    socket_open address port socket_name?
    socket_read_binary_integer number socket_name? timeout?
    socket_read_string socket_name? prefix? suffix? interpret_escape? timeout?
    socket_set_var name value socket_name?
    """.strip().splitlines()


SCRIPT = CHECKOUT / 'scripts' / 'make_script_functions.py'
WITHOUT_EFFECT = sorted(
    name
    for name, function in controller_builtins(
        Controller(SimulatorConfig(), controller_builtins)
    ).items()
    if not has_effect(function)
)
#: Outputs that pass with the time.
CLOCKS = ('timestamp', 'control_step', 'actual_execution_time')


@pytest.fixture
def script(monkeypatch):
    monkeypatch.syspath_prepend(SCRIPT.parent)
    import make_script_functions

    return make_script_functions


@needs_checkout
def test_the_page_is_that_of_the_registered_functions(script):
    page = script.PAGE.read_text(encoding='utf-8')
    assert page == script.page(), 'run python scripts/make_script_functions.py'


@needs_checkout
def test_each_function_of_the_manual_is_simulated_or_refused(script):
    names = {row[0].strip('`').split('(')[0] for row in script.rows()}
    assert set(script.MANUAL_5_21) - names == set()
    for known in (script.CB3, script.POLYSCOPE_X, script.FIRST, FUNCTIONS):
        assert set(known) - names == set()


@pytest.mark.parametrize('line', [line for line in SIGNATURES if line.strip()], ids=str.strip)
def test_arguments_are_those_of_the_manual(bench, line):
    name, *wanted = line.split()
    parameters = inspect.signature(controller_builtins(bench.controller)[name]).parameters
    found = [
        each.name + ('' if each.default is inspect.Parameter.empty else '?')
        for each in parameters.values()
    ]
    assert found[: len(wanted)] == wanted
    assert all(other.endswith('?') for other in found[len(wanted) :])


@needs_checkout
def test_what_the_page_calls_refused_is_refused(script, bench):
    for name in script.NOT_SIMULATED:
        bench.programs.submit(f'def f():\n  {name}()\nend\n')
        assert bench.log[-1] == f'2:3: compile_error_name_not_found:{name}:'


def state_of(controller):
    """Return all that programs and RTDE clients can see, without clocks."""
    outputs = {
        name: read_output(controller, name)
        for name in fields_of(OUTPUT_TYPES, controller.config.version)
        if not name.startswith(CLOCKS)
    }
    return outputs, controller.stored


@pytest.mark.parametrize('name', WITHOUT_EFFECT)
def test_functions_without_effect_change_nothing(bench, name):
    before, line = call(name)
    assert bench.run(before or 'sync()') == []
    state = state_of(bench.controller)
    assert bench.run(before + line) == []
    assert state_of(bench.controller) == state


def test_a_function_with_an_effect_changes_what_is_compared(bench):
    assert bench.run('sync()') == []
    state = state_of(bench.controller)
    assert bench.run('set_standard_digital_out(0, True)') == []
    assert state_of(bench.controller) != state
