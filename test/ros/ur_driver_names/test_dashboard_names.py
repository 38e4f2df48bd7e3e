# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The dashboard client's services, called as the UR driver's integration tests call them."""

import pytest
from ur_driver_client import kind, LATCHED

pytestmark = pytest.mark.slow


CB3 = {'model': 'ur5', 'polyscope': '3.15'}


@pytest.mark.parametrize('sim', [{}, CB3], indirect=True)
def test_the_arm_starts_as_in_the_integration_tests(make_ur, sim):
    ur = make_ur(ur_type=sim.config.model)
    ur.cell.wait_ready()
    running = ur.listen(
        '/io_and_status_controller/robot_program_running', 'std_msgs/msg/Bool', LATCHED
    )
    ur.start_robot()
    ur.cell.spin_until(lambda: running and not running[-1].data)
    assert ur.io('resend_robot_program').success
    ur.cell.spin_until(lambda: running[-1].data)


def test_programs_are_loaded_played_and_named(ur):
    assert ur.dashboard('stop').success
    loaded = ur.dashboard('load_program', 'Load', filename='weld.urp')
    assert (loaded.success, loaded.answer) == (True, 'Loading program: weld.urp')
    name = ur.dashboard('get_loaded_program', 'GetLoadedProgram')
    assert name.success
    assert name.answer == f'Loaded program: {name.program_name}'
    assert name.program_name.endswith('weld.urp')
    saved = ur.dashboard('program_saved', 'IsProgramSaved')
    assert (saved.success, saved.program_saved) == (True, True)
    states = kind('ur_dashboard_msgs/msg/ProgramState')
    for command, state, running in (
        ('play', states.PLAYING, True),
        ('pause', states.PAUSED, None),  # the dashboard may answer either
        ('play', states.PLAYING, True),
        ('stop', states.STOPPED, False),
    ):
        assert ur.dashboard(command).success
        reported = ur.dashboard('program_state', 'GetProgramState')
        assert (reported.success, reported.state.state) == (True, state)
        assert reported.program_name == 'weld.urp'
        answer = ur.dashboard('program_running', 'IsProgramRunning')
        assert answer.success
        assert running is None or answer.program_running is running


def test_a_program_that_is_not_there_is_refused_in_words(ur):
    assert ur.dashboard('stop').success
    loaded = ur.dashboard('load_program', 'Load', filename='nowhere.urp')
    assert not loaded.success
    assert 'File not found' in loaded.answer
    assert not ur.dashboard('load_installation', 'Load', filename='nowhere.installation').success
    assert ur.dashboard('load_installation', 'Load', filename='default.installation').success


def test_the_robot_says_what_it_is(ur):
    version = ur.dashboard('get_polyscope_version', 'GetPolyScopeVersion')
    assert version.success
    assert (version.version.major, version.version.minor) == ur.cell.sim.config.version[:2]
    assert version.answer.startswith('URSoftware ')
    assert ur.dashboard('get_robot_model', 'GetRobotModel').robot_model == 'UR5'
    assert ur.dashboard('get_serial_number', 'GetSerialNumber').serial_number == 2 * 10**10
    remote = ur.dashboard('is_in_remote_control', 'IsInRemoteControl')
    assert (remote.success, remote.remote_control) == (True, True)


def test_modes_are_the_numbers_of_their_messages(ur):
    robot, safety = (
        kind('ur_dashboard_msgs/msg/RobotMode'),
        kind('ur_dashboard_msgs/msg/SafetyMode'),
    )
    mode = ur.dashboard('get_robot_mode', 'GetRobotMode')
    assert (mode.success, mode.robot_mode.mode) == (True, robot.RUNNING)
    assert mode.answer == 'Robotmode: RUNNING'
    assert ur.dashboard('get_safety_mode', 'GetSafetyMode').safety_mode.mode == safety.NORMAL
    ur.cell.sim.inject('protective_stop')
    ur.cell.spin_until(
        lambda: (
            ur.dashboard('get_safety_mode', 'GetSafetyMode').safety_mode.mode
            == safety.PROTECTIVE_STOP
        )
    )
    status = ur.dashboard('get_safety_status', 'GetSafetyStatus')
    assert (status.success, status.safety_status.status) == (True, safety.PROTECTIVE_STOP)


def test_lines_go_to_the_dashboard(ur):
    assert ur.dashboard('popup', 'Popup', message='hello').success
    assert ur.dashboard('close_popup').success
    assert ur.dashboard('add_to_log', 'AddToLog', message='hello').success
    raw = ur.dashboard('raw_request', 'RawRequest', query='robotmode')
    assert raw.answer == 'Robotmode: RUNNING'
    assert ur.dashboard('connect').success
    assert ur.dashboard('quit').success
    report = ur.dashboard('generate_flight_report', 'GenerateFlightReport')
    assert (report.success, report.report_id) == (True, '0')


def test_operational_modes_are_set_and_cleared(ur):
    message = kind('ur_dashboard_msgs/msg/OperationalMode')
    mode = message(mode=message.MANUAL)
    assert ur.dashboard(
        'set_operational_mode', 'SetOperationalMode', operational_mode=mode
    ).success
    read = ur.dashboard('get_operational_mode', 'GetOperationalMode')
    assert (read.success, read.operational_mode.mode) == (True, message.MANUAL)
    assert ur.dashboard('clear_operational_mode').success
    mode = message(mode='SOMETHING')
    answer = ur.dashboard('set_operational_mode', 'SetOperationalMode', operational_mode=mode)
    assert not answer.success
    assert 'could not understand' in answer.answer


def test_a_command_that_the_software_lacks_is_no_success(ur):
    # Roles of users are only on CB3.
    answer = ur.dashboard('get_user_role', 'GetUserRole')
    assert not answer.success
    assert answer.answer


@pytest.mark.parametrize('sim', [CB3], indirect=True)
def test_the_role_of_the_user_is_read_and_set_where_robots_have_one(make_ur):
    ur = make_ur(ur_type='ur5')
    ur.cell.wait_ready()
    message = kind('ur_dashboard_msgs/msg/UserRole')
    role = message(role=message.LOCKED)
    assert ur.dashboard('set_user_role', 'SetUserRole', user_role=role).success
    answer = ur.dashboard('get_user_role', 'GetUserRole')
    assert (answer.success, answer.user_role.role) == (True, message.LOCKED)


POLYSCOPE_X = {'polyscope': '10.12', 'programs': {'one.urpx': 'def one():\n  sleep(9)\nend\n'}}


@pytest.fixture
def polyscope_x(make_ur, sim, tmp_path):
    """Return a client of a robot with PolyScope X, which may use the files in a folder."""
    ur = make_ur({'program_directory': str(tmp_path)}, robot_api_port=sim.ports.robot_api)
    ur.cell.wait_ready()
    return ur


@pytest.mark.parametrize('sim', [POLYSCOPE_X], indirect=True)
def test_programs_of_polyscope_x_are_moved_as_files(polyscope_x, tmp_path):
    ur = polyscope_x

    def programs():
        return {each.name for each in ur.dashboard('get_programs', 'GetPrograms').programs}

    before = programs()
    assert 'one' in before
    fields = {'program_name': 'one', 'target_path': 'here.urpx'}
    answer = ur.dashboard('download_program', 'DownloadProgram', **fields)
    assert answer.success, answer.answer
    path = tmp_path / 'here.urpx'
    path.write_text(path.read_text().replace('"one"', '"two"'))
    answer = ur.dashboard('upload_program', 'UploadProgram', file_path=str(path))
    assert (answer.success, answer.program_name) == (True, 'two'), answer.answer
    assert not ur.dashboard('upload_program', 'UploadProgram', file_path='here.urpx').success
    assert ur.dashboard('update_program', 'UploadProgram', file_path='here.urpx').success
    assert programs() == before | {'two'}


@pytest.mark.parametrize('sim', [POLYSCOPE_X], indirect=True)
def test_files_elsewhere_are_neither_read_nor_written(polyscope_x, tmp_path):
    outside = tmp_path.parent / 'outside.urpx'
    for name in ('../outside.urpx', str(outside), '/etc/hostname'):
        answer = polyscope_x.dashboard('upload_program', 'UploadProgram', file_path=name)
        assert (answer.success, 'is not in program_directory' in answer.answer) == (False, True)
        fields = {'program_name': 'one', 'target_path': name}
        assert not polyscope_x.dashboard('download_program', 'DownloadProgram', **fields).success
    assert not outside.exists()


def test_without_a_directory_no_file_is_used(ur):
    answer = ur.dashboard('upload_program', 'UploadProgram', file_path='here.urpx')
    assert (answer.success, 'program_directory' in answer.answer) == (False, True)


@pytest.mark.parametrize('sim', [POLYSCOPE_X], indirect=True)
def test_modes_come_from_the_robot_api(polyscope_x):
    mode = polyscope_x.dashboard('get_operational_mode', 'GetOperationalMode')
    assert mode.success, mode.answer
    robot = polyscope_x.dashboard('get_robot_mode', 'GetRobotMode')
    assert robot.robot_mode.mode == kind('ur_dashboard_msgs/msg/RobotMode').RUNNING
