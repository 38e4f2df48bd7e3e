# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The functions of a program, by example: each file in `programs` states its own results.

`# expect: text` for each text that it writes, in order; `# expect error: text` for the runtime
exception that ends it, raised on that line. The world around it is always the same: see `World`.
"""

import inspect
import json
from pathlib import Path
import re
from types import SimpleNamespace
from typing import Any

import pytest
from tracked_files import tracked_files

from ur_cartesian_driver.motion.geometry.pose import Pose, quaternion_from_rotation_vector
from ur_cartesian_driver.motion.state.rtde_state import RuntimeState
from ur_cartesian_driver.protocol.client_interfaces.primary_messages import RawMessage
from ur_cartesian_driver.sim.builtins import controller_builtins
from ur_cartesian_driver.sim.builtins.socket_builtins import READS_PER_CYCLE, SocketBuiltins
from ur_cartesian_driver.sim.programs.timed_function_guard import refuse_timed_functions
from ur_cartesian_driver.sim.state.power_and_safety import SafetyEvent
from ur_cartesian_driver.urscript.script_values import ScriptPose

HERE = Path(__file__).parent
PROGRAMS = tracked_files(HERE / 'programs', '**/*.script')
CASES = tracked_files(HERE.parent / 'urscript' / 'cases', '**/*.script')
EXPECT = re.compile(r'# expect(?P<error> error)?: (?P<text>.*)')
GOLDEN = json.loads((HERE / 'golden' / 'pose_math.json').read_text())

#: Called by the manufacturer's external_control.urscript and the guide to buffered servoj.
USED_BY_OTHERS = """
    get_steptime textmsg str_cat to_str norm pow get_list_length popup sleep sync
    get_joint_positions get_target_joint_positions get_target_joint_speeds get_actual_tcp_speed
    get_actual_joint_positions_history get_inverse_kin movej movel movep movec optimovej optimovel
    servoj speedj speedl stopj stopl direct_torque force_mode force_mode_set_damping
    force_mode_set_gain_scaling end_force_mode freedrive_mode end_freedrive_mode tool_contact
    zero_ftsensor set_payload set_target_payload set_gravity set_tool_voltage set_tcp
    ft_rtde_input_enable enable_external_ft_sensor socket_open socket_close
    socket_read_binary_integer socket_send_int set_tool_communication
    end_teach_mode get_actual_joint_positions interpreter_mode is_steady
    read_input_float_register read_input_integer_register size teach_mode transpose
    write_output_float_register write_output_integer_register""".split()


class World:
    """
    The surroundings of the robot of a program.

    Inputs and input registers have the values below; a peer on port 1 answers everything with
    itself; ten times a second a person closes the windows, unlocks a protective stop if that is
    possible, and plays the program if it is paused. Asked for values, the person has answers.
    """

    def __init__(self, bench):
        self.bench = bench
        self.peers = bench.controller.sockets.listen(1)
        bench.controller.sockets.poll = self.echo
        signals = bench.controller.io
        signals.digital_in.standard[3] = True
        signals.digital_in.configurable[2] = True
        signals.digital_in.tool[1] = True
        signals.analog_in[:] = 2.5, 0.01
        signals.tool_analog_in[1] = 7.5
        signals.inputs.bits[64] = True
        signals.inputs.integers[24] = -7
        signals.inputs.floats[47] = 0.125
        bench.controller.pendant.answers.extend(('yes', '3', '2.5', 'part 7', 'False'))

    def echo(self):
        for peer in self.peers:
            peer.feed(peer.take())

    def ended(self):
        """Let the person act, and tell whether the program has ended."""
        controller, programs = self.bench.controller, self.bench.programs
        if controller.cycles % 50 == 0:
            controller.close_popups()
            controller.safety_event(SafetyEvent.UNLOCK)
            if programs.state is RuntimeState.PAUSED:
                programs.play()
        return programs.state is RuntimeState.STOPPED


@pytest.mark.parametrize('path', PROGRAMS, ids=lambda path: f'{path.parent.name}/{path.stem}')
def test_the_program_does_what_it_says(bench, path):
    world = World(bench)
    text = path.read_text()
    expected = []
    for number, line in enumerate(text.splitlines(), 1):
        if match := EXPECT.search(line):
            expected.append((number, match['text']) if match['error'] else match['text'])
    bench.programs.submit(text)
    bench.until(world.ended)
    assert expected
    assert [as_expected(line) for line in bench.log] == expected


def as_expected(line):
    error = re.fullmatch(r'(\d+):\d+: Runtime error \(\1:\d+\): (.*)', line)
    return (int(error[1]), error[2]) if error else line


def test_a_request_waits_until_a_person_answers(bench):
    controller = bench.controller
    bench.start('textmsg(request_boolean_from_primary_client("Go on?"))')
    bench.wait(10.0)
    controller.close_popups()
    bench.wait(1.0)
    assert bench.log == []
    (request,) = (m for m in controller.messages.take() if isinstance(m, RawMessage))
    assert (request.message_type, request.content) == (9, bytes(8) + b'Go on?')
    controller.pendant.answers.append('no')
    bench.until(lambda: bench.programs.state is RuntimeState.STOPPED)
    assert bench.log == ['False']


def test_a_request_ends_when_the_person_stops_the_program(bench):
    bench.start('request_string_from_primary_client("Which part?")\ntextmsg("after")')
    bench.wait(0.1)
    bench.programs.stop()
    bench.until(lambda: bench.programs.state is RuntimeState.STOPPED)
    assert bench.log == []


def test_answers_can_be_configured(make_bench):
    bench = make_bench(answers=(12, 'no'))
    body = """textmsg(request_integer_from_primary_client("How many?"))
              textmsg(request_boolean_from_primary_client("More?"))"""
    assert bench.run(body) == ['12', 'False']


def test_a_loop_of_moves_to_one_blended_waypoint_takes_time(bench):
    bench.start(
        """goal = pose_add(get_target_tcp_pose(), p[0, 0.1, 0, 0, 0, 0])
           while True:
             movel(goal, r=0.05)
           end"""
    )
    bench.wait(3.0)
    assert bench.programs.state is RuntimeState.PLAYING
    assert not bench.controller.motion.on_path


def test_a_loop_of_speeds_without_a_time_is_still_an_error(bench):
    log = bench.run('while True:\n  speedj([0.1, 0, 0, 0, 0, 0], 1, 0)\nend')
    assert 'used too much time' in log[-1]


def test_every_function_is_called_by_a_program_that_says_what_it_does(bench):
    text = ''.join(re.sub(r'#.*', '', path.read_text()) for path in PROGRAMS + CASES)
    called = set(re.findall(r'\b([a-z]\w*)\s*\(', text))
    assert set(controller_builtins(bench.controller)) - called == set()


def test_there_are_many_programs():
    assert len(PROGRAMS) + len(CASES) >= 300


def test_every_function_that_well_known_programs_call_exists(bench):
    assert set(USED_BY_OTHERS) - set(controller_builtins(bench.controller)) == set()


def test_in_a_secondary_program_no_function_takes_time_and_all_keep_their_parameters(bench):
    primary = controller_builtins(bench.controller)
    secondary = refuse_timed_functions(primary)
    assert set(primary) == set(secondary)
    for name, function in secondary.items():
        assert not inspect.isgeneratorfunction(function)
        assert str(inspect.signature(function)) == str(inspect.signature(primary[name]))


def value(function, position, item):
    """Return a golden argument as a program would pass it."""
    is_vector = isinstance(item, list) and len(item) == 6
    return ScriptPose(*item) if is_vector else item


def rotation(builtins, function, numbers):
    """Return what a result turns by, however it is written."""
    if function == 'rotvec2rpy':
        numbers = builtins['rpy2rotvec'](list(numbers))
    return Pose((0.0, 0.0, 0.0), quaternion_from_rotation_vector(tuple(numbers[-3:])))


@pytest.mark.parametrize(
    'case', GOLDEN['random_cases'] + GOLDEN['manual_cases'], ids=lambda case: case['function']
)
def test_pose_arithmetic_agrees_with_independent_values(bench, case):
    function, expected = case['function'], case['expected']
    arguments = [value(function, i, item) for i, item in enumerate(case['args'])]
    builtins = controller_builtins(bench.controller)
    result = builtins[function](*arguments)
    tolerance = case.get('tolerance', 1e-6 if case.get('near_pi') else 1e-8)
    if case.get('near_pi') or case.get('near_gimbal_lock'):
        assert list(result)[:-3] == pytest.approx(expected[:-3], abs=tolerance)
        assert (
            rotation(builtins, function, result).angle_to(rotation(builtins, function, expected))
            < 1e-6
        )
    elif isinstance(expected, list):
        assert list(result) == pytest.approx(expected, abs=tolerance)
    else:
        assert result == pytest.approx(expected, abs=tolerance)


def test_the_threads_of_a_program_share_the_reads_of_a_cycle():
    """A peer that never stops is read 32 times a cycle, however many threads read."""
    controller: Any = SimpleNamespace(cycles=0)
    group, waiting = SocketBuiltins(controller), 0
    for controller.cycles in range(10):
        reads, ready, waiting = waiting, 2, 0
        while ready:
            if group._count_read('socket_0'):
                ready, waiting = ready - 1, waiting + 1
            else:
                reads += 1
        assert reads == READS_PER_CYCLE
