# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The services of the node, with each kind of executor."""

from math import nan
import re

from geometry_msgs.msg import Point, Pose, Quaternion, Vector3
import pytest
from std_srvs.srv import Trigger

from ur_cartesian_driver.cli import main
from ur_cartesian_driver.driver import ConnectionState
from ur_cartesian_driver.motion.errors import LocalProtocolError
from ur_cartesian_driver.motion.state.rtde_state import RobotMode
from ur_cartesian_driver.ros.services.command_services import REQUEST_SERVICES
from ur_cartesian_driver.sim import SimulatedRobot, SimulatorConfig
from ur_cartesian_driver.srv import (
    DownloadProgram,
    GenerateFlightReport,
    GenerateSupportFile,
    Load,
    Popup,
    RawRequest,
    Recover,
    RunScript,
    SetGravity,
    SetIO,
    SetOperationalMode,
    SetPayload,
    SetSpeedSliderFraction,
    SetTCP,
    SetUserRole,
    UploadProgram,
)

pytestmark = pytest.mark.slow

UNIT = Quaternion(x=0.0, y=0.0, z=0.0, w=1.0)


@pytest.fixture
def sim():
    config = SimulatorConfig(
        rtde_port=0,
        primary_port=0,
        dashboard_port=0,
        frequency=125.0,
        unlock_delay=0.2,
        power_on_time=0.3,
        brake_release_time=0.1,
    )
    with SimulatedRobot(config) as robot:
        yield robot


class ServiceClient:
    """Calls services of a cell."""

    def __init__(self, cell):
        self.cell = cell
        self._clients = {}

    def send(self, name, request=None):
        request = request or Trigger.Request()
        kind = next(
            kind
            for kind in (
                Trigger,
                DownloadProgram,
                GenerateFlightReport,
                GenerateSupportFile,
                Load,
                Popup,
                RawRequest,
                Recover,
                RunScript,
                SetGravity,
                SetIO,
                SetOperationalMode,
                SetPayload,
                SetSpeedSliderFraction,
                SetTCP,
                SetUserRole,
                UploadProgram,
            )
            if isinstance(request, kind.Request)
        )
        if name not in self._clients:
            client = self.cell.client_node.create_client(kind, f'/ur_cartesian_driver/{name}')
            self.cell.spin_until(client.service_is_ready)
            self._clients[name] = client
        return self._clients[name].call_async(request)

    def __call__(self, name, request=None):
        return self.cell.await_(self.send(name, request))


def test_every_service_does_what_it_says(cell):
    call, sim = ServiceClient(cell), cell.sim
    assert call(
        'set_tcp', SetTCP.Request(tcp=Pose(position=Point(z=0.1), orientation=UNIT))
    ).success
    assert sim.state().T_flange_tcp.position == pytest.approx((0.0, 0.0, 0.1))
    assert call('set_payload', SetPayload.Request(mass=0.7)).success
    assert call('set_gravity', SetGravity.Request(gravity=Vector3(z=9.8))).success
    assert call(
        'set_io', SetIO.Request(output=SetIO.Request.STANDARD_DIGITAL, pin=1, value=1.0)
    ).success
    assert sim.state().digital_outputs == 2
    assert call(
        'set_speed_slider', SetSpeedSliderFraction.Request(speed_slider_fraction=0.5)
    ).success
    assert sim.state().speed_slider == 0.5
    refused = call('set_io', SetIO.Request(output=SetIO.Request.TOOL_DIGITAL, pin=2))
    assert (refused.success, 'pins 0 to 1' in refused.message) == (False, True)
    assert call('zero_ftsensor').success
    assert call('dashboard/popup', Popup.Request(message='Hello')).success
    assert sim.state().popups == ('Hello',)
    assert call('dashboard/raw_request', RawRequest.Request(query='robotmode')).message == (
        'Robotmode: RUNNING'
    )
    assert not call('dashboard/load_program', Load.Request(filename='nothing.urp')).success
    assert call('dashboard/program_state').message.startswith('PLAYING')
    assert call('dashboard/stop').success
    cell.spin_until(lambda: not cell.node.driver.status.program_running)
    assert call('resend_robot_program').success
    assert cell.node.driver.status.state is ConnectionState.READY
    assert call('recover', Recover.Request()).message == 'The robot is ready for goals.'
    assert call('hand_back_control').success
    assert call('resend_robot_program').success


def test_modes_roles_and_reports_of_the_pendant(single_cell):
    call = ServiceClient(single_cell)
    assert call('dashboard/get_safety_status').message == 'NORMAL'
    assert call('dashboard/get_operational_mode').message == 'NONE'
    for mode in SetOperationalMode.Request.AUTOMATIC, SetOperationalMode.Request.MANUAL:
        request = SetOperationalMode.Request(operational_mode=mode)
        assert call('dashboard/set_operational_mode', request).success
        assert call('dashboard/get_operational_mode').message == mode
    assert call('dashboard/is_in_remote_control').message == 'false'
    assert call('dashboard/clear_operational_mode').success
    assert call('dashboard/get_operational_mode').message == 'NONE'
    refused = call(
        'dashboard/set_operational_mode', SetOperationalMode.Request(operational_mode='dancing')
    )
    assert not refused.success
    assert call('dashboard/generate_flight_report', GenerateFlightReport.Request()).success
    report = call('dashboard/generate_support_file', GenerateSupportFile.Request(dir_path='.'))
    assert report.message.endswith('.zip')
    for answer in (
        call('dashboard/get_user_role'),
        call('dashboard/set_user_role', SetUserRole.Request(user_role='OPERATOR')),
    ):
        assert not answer.success
        assert 'no command' in answer.message


def test_programs_of_polyscope_x(no_thread_left, make_cell):
    config = SimulatorConfig(
        rtde_port=0,
        primary_port=0,
        frequency=125.0,
        polyscope='10.12',
        programs={'one.urpx': 'def one():\n  sleep(1)\nend\n'},
    )
    with SimulatedRobot(config) as robot:
        cell = make_cell(robot, robot_api_port=robot.ports.robot_api)
        cell.wait_ready()
        call = ServiceClient(cell)
        assert call('dashboard/get_programs').message == 'external_control\none'
        program = call(
            'dashboard/download_program', DownloadProgram.Request(program_name='one')
        ).message
        two = UploadProgram.Request(program=program.replace('"one"', '"two"'))
        assert not call('dashboard/update_program', two).success
        assert call('dashboard/upload_program', two).message == 'two'
        assert call('dashboard/update_program', two).success
        assert call('dashboard/get_programs').message == 'external_control\none\ntwo'
        assert not call('dashboard/upload_program', two).success


def test_a_service_that_takes_its_time_holds_up_nobody(cell):
    call = ServiceClient(cell)
    assert call('dashboard/power_off').success
    slow = call.send('dashboard/power_on')
    assert call('dashboard/get_robot_mode').message in ('POWER_OFF', 'POWER_ON')
    assert not slow.done()
    assert cell.await_(slow).success
    assert cell.sim.state().robot_mode is RobotMode.IDLE


def test_recover_says_what_it_did_or_what_a_person_must_do(single_cell, capsys):
    cell, call = single_cell, ServiceClient(single_cell)
    cell.sim.protective_stop()
    cell.spin_until(lambda: cell.node.driver.status.state is ConnectionState.STOPPED)
    answer = call('recover', Recover.Request())
    assert not answer.success
    assert 'look for the cause' in answer.message
    answer = call('recover', Recover.Request(unlock_protective_stop=True))
    assert answer.success
    assert 'unlock the protective stop' in answer.message
    assert cell.run(cell.goal((0.4, 0.0, 0.01, 0.0)))[1].error_code == 0
    cell.sim.emergency_stop()
    cell.spin_until(lambda: cell.node.driver.status.state is ConnectionState.STOPPED)
    with cell.spun():
        assert main(['recover']) == 1
    assert 'release the button' in capsys.readouterr().out


@pytest.mark.parametrize(
    ('name', 'request_', 'sentence'),
    [
        ('set_tcp', SetTCP.Request(tcp=Pose(position=Point(z=100.0), orientation=UNIT)), 'metres'),
        ('set_tcp', SetTCP.Request(tcp=Pose(position=Point(z=nan), orientation=UNIT)), 'metres'),
        ('set_tcp', SetTCP.Request(tcp=Pose(orientation=Quaternion(w=0.0))), 'unit quaternion'),
        ('set_payload', SetPayload.Request(mass=-1.0), '0 to 100 kg'),
        ('set_payload', SetPayload.Request(mass=nan), '0 to 100 kg'),
        ('set_payload', SetPayload.Request(mass=1.0, inertia=[0.1]), 'has 1 numbers, not 6'),
        ('set_gravity', SetGravity.Request(), 'more than 0 and at most 20 m/s'),
        (
            'set_speed_slider',
            SetSpeedSliderFraction.Request(speed_slider_fraction=50.0),
            '0 (the arm',
        ),
        (
            'set_speed_slider',
            SetSpeedSliderFraction.Request(speed_slider_fraction=nan),
            '0 (the arm',
        ),
        ('set_io', SetIO.Request(output=9), 'output'),
        ('set_io', SetIO.Request(output=2, pin=2), 'pins 0 to 1'),
        ('set_io', SetIO.Request(value=0.5), '0 or 1'),
        ('set_io', SetIO.Request(output=3, value=nan), 'fraction'),
        ('dashboard/load_program', Load.Request(filename='a\nshutdown'), 'one line'),
        ('dashboard/popup', Popup.Request(), 'takes a text'),
        ('dashboard/raw_request', RawRequest.Request(query='a\nb'), 'one line'),
        ('dashboard/raw_request', RawRequest.Request(query='x' * 100000), 'at most'),
    ],
)
def test_nonsense_is_refused_by_a_sentence(name, request_, sentence):
    _, call_of = REQUEST_SERVICES[name]
    with pytest.raises(LocalProtocolError, match=re.escape(sentence)):
        call_of(request_)


def test_a_goal_that_waits_for_its_time_keeps_its_tcp(single_cell):
    cell, call = single_cell, ServiceClient(single_cell)
    goal = cell.goal((0.4, 0.0, 0.01, 0.0))
    later = cell.client_node.get_clock().now().nanoseconds + 30_000_000_000
    goal.trajectory.header.stamp.sec, goal.trajectory.header.stamp.nanosec = divmod(
        later, 1_000_000_000
    )
    handle = cell.send(goal)
    answer = call('set_tcp', SetTCP.Request(tcp=Pose(orientation=UNIT)))
    assert not answer.success
    assert 'is using the present value' in answer.message
    cell.await_(handle.cancel_goal_async())
    cell.result(handle)
    assert call('set_tcp', SetTCP.Request(tcp=Pose(orientation=UNIT))).success


def test_services_of_a_driver_without_a_robot_answer(no_thread_left, sim, make_cell):
    cell = make_cell(sim, rtde_port=1, primary_port=1, dashboard_port=1)
    call = ServiceClient(cell)
    for name, request in {
        'dashboard/power_on': None,
        'zero_ftsensor': None,
        'resend_robot_program': None,
        'recover': Recover.Request(),
        'run_script': RunScript.Request(script='sec a():\nend'),
    }.items():
        answer = call(name, request)
        assert not answer.success
        assert answer.message.endswith('.')


def test_a_node_that_is_destroyed_answers_nobody_and_does_not_hang(
    no_thread_left, sim, executor, make_cell
):
    cell = make_cell(sim, executor)
    cell.wait_ready()
    call = ServiceClient(cell)
    assert call('dashboard/power_off').success
    call.send('dashboard/power_on')
    for _ in range(5):
        cell.executor.spin_once(timeout_sec=0.01)
    cell.node.destroy_node()
