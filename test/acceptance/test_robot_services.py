# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Service calls of a robot: done, refused with a sentence, or explained."""

import json
import os
import signal
import socket

import pytest
from robot_ports import fetch_program
from waiting import wait_for

from ur_cartesian_driver.driver import ConnectionState
from ur_cartesian_driver.motion.geometry.pose import Pose
from ur_cartesian_driver.motion.goal.goal import Goal, OutputKind, Waypoint
from ur_cartesian_driver.motion.state.io_signals import AnalogDomain
from ur_cartesian_driver.motion.state.rtde_state import RobotMode, SafetyMode
from ur_cartesian_driver.program.render import wrap_in_program
from ur_cartesian_driver.protocol.rtde.rtde_client import RtdeClientCodec
from ur_cartesian_driver.robot.services import service_dispatcher
from ur_cartesian_driver.robot.services.service_calls import (
    DashboardCall,
    RecoverCall,
    SendProgramCall,
    SetPayloadCall,
    SetTcpCall,
)
from ur_cartesian_driver.sim.state.power_and_safety import SafetyEvent

# A slow controller does the same for less.
pytestmark = [pytest.mark.slow, pytest.mark.acceptance, pytest.mark.ur_sim(frequency=125.0)]

READY = 10.0
NOZZLE = Pose((0.01, -0.02, 0.15), (0.0, 0.6, 0.0, 0.8))
QUICK = pytest.mark.ur_sim(
    frequency=125.0, unlock_delay=0.3, power_on_time=0.05, brake_release_time=0.05
)
ACTIONS = (
    'power on',
    'power off',
    'brake release',
    'stop',
    'pause',
    'unlock protective stop',
    'restart safety',
    'close popup',
)


def test_settings_are_done_when_the_robot_reports_them(driver, ur_sim):
    assert driver.set_tcp(NOZZLE).ok
    assert ur_sim.state().T_flange_tcp.distance_to(NOZZLE) < 1e-5
    assert ur_sim.state().T_flange_tcp.angle_to(NOZZLE) < 1e-5
    assert driver.set_payload(1.5, (0.0, 0.0, 0.05)).ok
    assert ur_sim.call(lambda c: c.payload.mass) == 1.5
    inertia = (0.01, 0.02, 0.03, -0.001, 0.002, 0.003)
    assert driver.set_payload(2.5, (0.01, 0.0, 0.05), inertia=inertia, transition_time=0.2).ok
    payload = ur_sim.call(lambda c: c.payload)
    assert (payload.mass, *payload.cog) == (2.5, 0.01, 0.0, 0.05)
    assert payload.inertia == pytest.approx(inertia)
    wait_for(lambda: driver.signals.payload_inertia == pytest.approx(inertia))
    assert driver.set_gravity((6.94, 0.0, 6.94)).ok
    assert ur_sim.call(lambda c: c.gravity) == pytest.approx((6.94, 0.0, 6.94))
    assert driver.set_speed_slider(0.37).ok
    assert ur_sim.state().speed_slider == pytest.approx(0.37)
    assert driver.zero_ftsensor().ok


def test_a_digital_output_is_set_and_no_other(driver, ur_sim):
    for kind, pin, bit in (
        (OutputKind.STANDARD_DIGITAL, 2, 2),
        (OutputKind.CONFIGURABLE_DIGITAL, 7, 15),
        (OutputKind.TOOL_DIGITAL, 1, 17),
    ):
        assert driver.set_digital_output(kind, pin, True).ok
        assert ur_sim.state().digital_outputs == 1 << bit
        assert driver.set_digital_output(kind, pin, False).ok
        assert ur_sim.state().digital_outputs == 0
    driver.set_digital_output(OutputKind.TOOL_DIGITAL, 1, True)
    wait_for(lambda: driver.signals.outputs.tool == (False, True))


def test_an_analog_output_is_set_in_its_domain(driver, ur_sim):
    assert driver.set_analog_output(1, 0.25, AnalogDomain.VOLTAGE).ok
    assert ur_sim.call(lambda c: list(c.io.analog_out)) == [0.004, 2.5]
    assert driver.set_analog_output(0, 0.5, AnalogDomain.CURRENT).ok
    assert ur_sim.call(lambda c: c.io.analog_out[0]) == pytest.approx(0.012)
    wait_for(lambda: driver.signals.analog_outputs[0].domain is AnalogDomain.CURRENT)


def test_inputs_that_another_client_holds_are_named(driver, ur_sim):
    with socket.create_connection(('127.0.0.1', ur_sim.ports.rtde)) as other:
        client = RtdeClientCodec(
            ['timestamp'], inputs=['speed_slider_mask', 'speed_slider_fraction']
        )
        other.sendall(client.start())
        while client.state.name != 'READY':
            client.feed(other.recv(65536))
            other.sendall(client.data_to_send())
        answer = driver.set_speed_slider(0.5)
    assert not answer.ok
    assert 'in use by another client' in answer.text
    assert driver.status.state is ConnectionState.READY


def test_settings_wait_for_the_end_of_a_goal(driver, home):
    motion = driver.start(driver.plan(Goal(waypoints=(Waypoint(time=3.0, pose=home(z=0.05)),))))
    wait_for(lambda: driver.status.state is ConnectionState.EXECUTING)
    for answer in (
        driver.set_tcp(NOZZLE),
        driver.set_payload(1.0),
        driver.set_gravity((0.0, 0.0, 9.82)),
        driver.dashboard('load installation', 'default.installation'),
        driver.dashboard('set operational mode', 'MANUAL'),
    ):
        assert not answer.ok
        assert answer.text.startswith('A goal is running')
    assert driver.set_speed_slider(0.9).ok  # it only slows the goal
    motion.cancel()
    motion.result(5.0)
    assert driver.set_tcp(NOZZLE).ok


def test_a_setting_needs_the_robot_program(driver, ur_sim):
    ur_sim.pause_program()
    wait_for(lambda: driver.status.state is ConnectionState.CONNECTED)
    answer = driver.set_tcp(NOZZLE)
    assert not answer.ok
    assert 'PAUS' in answer.text
    ur_sim.stop_program()
    wait_for(lambda: not driver.status.program_running)
    answer = driver.set_payload(1.0)
    assert not answer.ok
    assert 'resend_robot_program' in answer.text
    assert driver.set_speed_slider(0.5).ok


def test_a_goal_and_a_new_tcp_at_the_same_time_exclude_each_other(driver, home):
    plan = driver.plan(Goal(waypoints=(Waypoint(time=0.5, pose=home(z=0.02)),)))
    pending = driver.call(SetTcpCall(T_flange_tcp=NOZZLE))
    outcome, answer = driver.start(plan).result(5.0), pending.result(5.0)
    if answer.ok:
        assert outcome.code.name == 'ROBOT_NOT_READY'
        assert 'being set' in outcome.text or 'changed after' in outcome.text
    else:
        assert outcome.succeeded
        assert answer.text.startswith('A goal is running')


@QUICK
def test_dashboard_commands_are_done_when_the_robot_reports_them(driver, ur_sim):
    wait_for(lambda: driver.status.serial_number == '20000000000')
    assert driver.dashboard('robotmode').text == 'RUNNING'
    assert driver.dashboard('pause').ok
    assert driver.dashboard('play').ok
    assert driver.dashboard('stop').ok
    refused = driver.dashboard('play')
    assert not refused.ok
    assert 'load_program' in refused.text
    assert driver.dashboard('power off').ok
    assert ur_sim.state().robot_mode is RobotMode.POWER_OFF
    assert driver.dashboard('power on').ok
    assert ur_sim.state().robot_mode is RobotMode.IDLE
    assert driver.dashboard('brake release').ok
    assert ur_sim.state().robot_mode is RobotMode.RUNNING
    assert driver.dashboard('popup', 'Hello').ok
    assert ur_sim.state().popups == ('Hello',)
    assert driver.dashboard('close popup').ok
    assert not ur_sim.state().popups
    assert 'folder of programs' in driver.dashboard('load', 'nothing.urp').text
    assert driver.dashboard_line('get robot model').text == 'UR5'


@QUICK
@pytest.mark.parametrize('stop', ['protective stop', 'power off', 'program stopped', 'fault'])
def test_recover_brings_the_robot_back(driver, ur_sim, stop):
    {
        'protective stop': ur_sim.protective_stop,
        'power off': lambda: ur_sim.call(lambda c: c.power_off()),
        'program stopped': ur_sim.stop_program,
        'fault': lambda: ur_sim.call(lambda c: c.safety_event(SafetyEvent.FAULT)),
    }[stop]()
    wait_for(lambda: driver.status.state is not ConnectionState.READY)
    answer = driver.recover(unlock_protective_stop=True)
    assert answer.ok, answer.text
    assert 'Done: ' in answer.text
    assert driver.status.state is ConnectionState.READY


@QUICK
def test_recover_goes_no_further_than_it_may(driver, ur_sim):
    q = ur_sim.state().q
    ur_sim.emergency_stop()
    wait_for(lambda: driver.status.state is ConnectionState.STOPPED)
    answer = driver.recover(unlock_protective_stop=True)
    assert not answer.ok
    assert 'release the button' in answer.text
    assert ur_sim.state().robot_mode is RobotMode.POWER_OFF
    ur_sim.call(lambda c: setattr(c, 'remote_control', False))
    ur_sim.release_emergency_stop()
    wait_for(lambda: driver.status.state is ConnectionState.CONNECTED)
    answer = driver.recover(unlock_protective_stop=True)
    assert not answer.ok
    assert 'local control' in answer.text
    assert ur_sim.state().robot_mode is RobotMode.POWER_OFF
    ur_sim.call(lambda c: setattr(c, 'remote_control', True))
    assert driver.recover(unlock_protective_stop=True).ok
    assert ur_sim.state().q == q
    assert 'ready for goals' in driver.recover(unlock_protective_stop=True).text


@QUICK
@pytest.mark.parametrize('unlock', [False, True], ids=['asked each time', 'by parameter'])
def test_a_protective_stop_is_unlocked_only_where_somebody_answers_for_it(
    make_driver, ur_sim, unlock
):
    driver = make_driver(unlock_protective_stops=unlock)
    driver.wait_ready(READY)
    ur_sim.protective_stop()
    wait_for(lambda: driver.status.state is ConnectionState.STOPPED)
    answer = driver.recover()
    assert answer.ok == unlock
    if not unlock:
        assert 'look for the cause' in answer.text
        assert ur_sim.state().safety_mode is SafetyMode.PROTECTIVE_STOP
        assert driver.recover(unlock_protective_stop=True).ok
    assert ur_sim.state().safety_mode is SafetyMode.NORMAL


@pytest.mark.ur_sim(frequency=125.0, remote_control=False)
def test_a_program_that_is_sent_in_local_control_is_refused_with_the_reason(
    make_driver, ur_sim, monkeypatch
):
    driver = make_driver()
    wait_for(lambda: 'read-only' in driver.status.last_error)
    with monkeypatch.context() as patch:
        patch.setattr(service_dispatcher, 'EFFECT_TIMEOUT', 0.3)
        answer = driver.call(SendProgramCall()).result(READY)
    assert not answer.ok
    assert answer.text.endswith(
        'The robot is in local control: switch it to remote control, then try again.'
    )
    ur_sim.call(lambda c: setattr(c, 'remote_control', True))
    assert driver.call(SendProgramCall()).result(READY).ok


@QUICK
def test_a_recovery_does_not_resume_the_goal(driver, ur_sim, home):
    motion = driver.start(driver.plan(Goal(waypoints=(Waypoint(time=4.0, pose=home(z=0.1)),))))
    wait_for(lambda: max(map(abs, ur_sim.state().qd)) > 0.01)
    ur_sim.protective_stop()
    assert motion.result(5.0).code.name == 'PROTECTIVE_STOP'
    wait_for(lambda: max(map(abs, ur_sim.state().qd)) < 1e-6)
    q = ur_sim.state().q
    assert driver.recover(unlock_protective_stop=True).ok
    assert ur_sim.state().q == q


@QUICK
def test_recover_plays_the_program_of_the_pendant_without_headless_mode(make_driver, ur_sim):
    driver = make_driver(headless_mode=False)
    wait_for(lambda: driver.status.state is ConnectionState.CONNECTED)
    answer = driver.recover(unlock_protective_stop=True)
    assert not answer.ok
    assert 'load_program' in answer.text
    program = wrap_in_program(fetch_program(driver))
    assert ur_sim.call(lambda c: c.programs.load('pendant.urp', program)) == ''
    assert driver.recover(unlock_protective_stop=True).ok
    assert driver.status.state is ConnectionState.READY
    ur_sim.protective_stop()
    wait_for(lambda: driver.status.state is ConnectionState.STOPPED)
    answer = driver.recover(unlock_protective_stop=True)
    assert answer.ok, answer.text
    assert 'play the loaded program' in answer.text


@QUICK
def test_recover_leaves_another_program_alone(driver, ur_sim):
    ur_sim.run_script('def foreign():\n  while True:\n    sync()\n  end\nend\n')
    wait_for(lambda: driver.status.state is ConnectionState.CONNECTED)
    answer = driver.recover(unlock_protective_stop=True)
    assert not answer.ok
    assert 'Another program' in answer.text
    assert ur_sim.state().program == 'foreign'


@pytest.mark.ur_sim(model='ur3')
def test_a_robot_without_force_sensor_refuses_to_zero_it(make_driver):
    driver = make_driver()
    driver.wait_ready(READY)
    answer = driver.zero_ftsensor()
    assert not answer.ok
    assert 'CB3' in answer.text


@pytest.mark.ur_sim(frequency=125.0, polyscope='10.12.0', unlock_delay=0.0)
def test_the_robot_api_loads_plays_pauses_and_stops(make_driver, ur_sim):
    driver = make_driver(headless_mode=False)
    wait_for(lambda: driver.status.state is ConnectionState.CONNECTED)
    answer = driver.dashboard('load', 'nothing')
    assert not answer.ok
    assert "'load' and says: HTTP 500" in answer.text
    program = wrap_in_program(fetch_program(driver))
    assert ur_sim.call(lambda c: c.programs.load('pendant.urpx', program)) == ''
    assert driver.dashboard('get loaded program').text == 'pendant'
    answer = driver.recover(unlock_protective_stop=True)
    assert answer.ok, answer.text
    assert 'play the loaded program' in answer.text
    for command, state in ('pause', 'PAUSED'), ('play', 'PLAYING'), ('stop', 'STOPPED'):
        answer = driver.dashboard(command)
        assert answer.ok, answer.text
        assert driver.dashboard('programState').text == state
    assert driver.dashboard('running').text == 'false'


@pytest.mark.ur_sim(
    frequency=125.0, polyscope='10.12.0', programs={'one.urpx': 'def one():\n  sleep(9)\nend\n'}
)
def test_a_program_of_polyscope_x_is_downloaded_changed_uploaded_and_played(make_driver, ur_sim):
    driver = make_driver(headless_mode=False)
    wait_for(lambda: driver.status.state is ConnectionState.CONNECTED)
    program = json.loads(driver.download_program('one').text)
    program['program']['programInformation']['name'] = 'two'
    assert driver.upload_program(json.dumps(program)).text == 'two'
    assert driver.list_programs().text.splitlines() == ['external_control', 'one', 'two']
    refused = driver.upload_program(json.dumps(program))
    assert 'HTTP 400' in refused.text
    assert driver.upload_program(json.dumps(program), replaces=True).ok
    assert driver.dashboard('load', 'two').ok
    assert driver.dashboard('play').ok
    assert ur_sim.state().program == 'two.urpx'
    assert driver.dashboard('get operational mode').text == 'AUTOMATIC'


@pytest.mark.ur_sim(frequency=125.0, polyscope='10.8.0', unlock_delay=0.0)
def test_polyscope_x_before_its_robot_api_refuses_and_the_rest_works(make_driver, ur_sim):
    driver = make_driver()
    driver.wait_ready(READY)
    for command in ACTIONS:
        answer = driver.dashboard(command)
        assert not answer.ok
        assert 'PolyScope X has no dashboard' in answer.text
    assert not driver.dashboard_line('running').ok
    assert driver.set_speed_slider(0.5).ok
    assert driver.set_tcp(NOZZLE).ok
    ur_sim.protective_stop()
    wait_for(lambda: driver.status.state is ConnectionState.STOPPED)
    answer = driver.recover(unlock_protective_stop=True)
    assert answer.ok, answer.text


def test_a_robot_whose_dashboard_is_closed_works_and_says_so(make_driver, closed_port):
    driver = make_driver(dashboard_port=closed_port)
    driver.wait_ready(READY)
    answer = driver.dashboard('power on')
    assert not answer.ok
    assert f'127.0.0.1 port {closed_port}' in answer.text
    assert driver.set_tcp(NOZZLE).ok
    assert driver.status.serial_number == ''


def test_every_call_to_a_robot_that_is_not_there_is_answered(make_driver, closed_port):
    driver = make_driver(
        rtde_port=closed_port, primary_port=closed_port, dashboard_port=closed_port
    )
    for answer in (
        driver.dashboard('power on'),
        driver.dashboard_line('running'),
        driver.list_programs(),
        driver.set_tcp(NOZZLE),
        driver.set_payload(1.0),
        driver.zero_ftsensor(),
        driver.set_speed_slider(0.5),
        driver.recover(unlock_protective_stop=True),
        driver.set_digital_output(OutputKind.TOOL_DIGITAL, 0, True),
    ):
        assert not answer.ok
        assert answer.text.endswith('.')


def test_a_wrong_robot_is_not_touched(make_driver, ur_sim):
    driver = make_driver(ur_type='ur10e')
    wait_for(lambda: driver.status.state is ConnectionState.REFUSED)
    for answer in (
        driver.dashboard('power off'),
        driver.set_speed_slider(0.5),
        driver.recover(unlock_protective_stop=True),
    ):
        assert not answer.ok
        assert 'ur10e' in answer.text
    assert driver.dashboard('robotmode').text == 'RUNNING'
    assert ur_sim.state().speed_slider == 1.0


@pytest.mark.ur_sim(frequency=125.0, power='off', power_on_time=100.0)
def test_calls_are_answered_when_the_robot_loop_dies_or_the_driver_closes(make_driver):
    driver = make_driver(robot_loop='process')
    wait_for(lambda: driver.status.state is ConnectionState.CONNECTED)
    pending = driver.call(DashboardCall(command='power on'))
    os.kill(driver._loop.host.pid, signal.SIGKILL)
    assert 'robot loop ended unexpectedly' in pending.result(5.0).text
    wait_for(lambda: driver.status.state is ConnectionState.CONNECTED)
    pending = driver.call(RecoverCall())
    driver.close()
    assert not pending.result(5.0).ok
    assert driver.call(SetTcpCall(T_flange_tcp=NOZZLE)).result(0.0).text == (
        'The driver is closed; open it.'
    )


def test_an_internal_error_is_answered_too(driver):
    broken = SetPayloadCall(mass=1.0)
    object.__setattr__(broken, 'mass', 'heavy')
    answer = driver.call(broken).result(5.0)
    assert not answer.ok
    assert answer.text.startswith('The driver has a defect')
    assert driver.set_payload(1.0).ok


@pytest.mark.ur_sim(frequency=125.0, power='off', power_on_time=0.05, brake_release_time=0.05)
def test_auto_power_is_for_the_first_connection_only(make_driver, ur_sim):
    driver = make_driver(auto_power=True)
    driver.wait_ready(READY)
    ur_sim.call(lambda c: c.power_off())
    wait_for(lambda: driver.status.state is ConnectionState.CONNECTED)
    ur_sim.inject('drop rtde')
    wait_for(lambda: driver.status.state is ConnectionState.DISCONNECTED)
    wait_for(lambda: driver.status.state is ConnectionState.CONNECTED)
    assert driver.dashboard('robotmode').text == 'POWER_OFF'


@pytest.mark.ur_sim(frequency=125.0, power='off')
def test_nothing_is_switched_on_unasked(make_driver):
    driver = make_driver()
    wait_for(lambda: driver.status.state is ConnectionState.CONNECTED)
    wait_for(lambda: driver.status.serial_number)
    assert driver.dashboard('robotmode').text == 'POWER_OFF'
