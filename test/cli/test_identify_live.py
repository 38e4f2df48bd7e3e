# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""``ur-cartesian identify --robot-ip``: from a simulated arm with hidden laws to its twin."""

import asyncio
from dataclasses import replace
from io import StringIO
from math import pi
from random import Random
import sys
from threading import Thread

import numpy as np
import pytest
from waiting import wait_for

from ur_cartesian_driver.cli import main
from ur_cartesian_driver.cli.identify_live import arm_of, PROGRESS
from ur_cartesian_driver.identification.law_experiments import (
    Interruption,
    LAW_EXPERIMENTS,
    MotionBounds,
)
from ur_cartesian_driver.identification.live_run import (
    LONGEST_PROGRAM,
    ready_state,
    record_experiment,
)
from ur_cartesian_driver.identification.recorded_calls import read_commands
from ur_cartesian_driver.motion.geometry.pose import Pose
from ur_cartesian_driver.motion.state.rtde_state import (
    RobotMode,
    RobotState,
    RuntimeState,
    SafetyMode,
)
from ur_cartesian_driver.motion.twin.twin import ArmIdentity, Estimate, Twin
from ur_cartesian_driver.motion.twin.twin_file import read_twin
from ur_cartesian_driver.robot.check.finding import Finding, RobotAddress, Verdict
from ur_cartesian_driver.robot.check.program_run import Surprise

HOME = (0.0, -1.2, 1.4, -1.6, -1.5, 0.2)
NAMES = [each.name for each in LAW_EXPERIMENTS]
BOX = '-1,-1,0,1,1,1'


def hidden_laws(seed):
    """Return a twin with laws drawn at random; ramps of the simulator take whole cycles."""
    random = Random(seed)
    laws = {
        'start_time': 0.008 * random.randint(8, 30),
        'stop_time': 0.008 * random.randint(8, 40),
        'pause_time': 0.008 * random.randint(10, 50),
        'protective_stop_time': 0.008 * random.randint(8, 30),
        'turn_ratio': random.uniform(1.0, 5.0),
        'timed_joint_acceleration': random.uniform(1.0, 2.5),
        'timed_joint_speed': random.uniform(0.4, 0.9),
        'timed_linear_acceleration': random.uniform(0.8, 2.0),
        'timed_linear_speed': random.uniform(0.1, 0.25),
        'idle_between_moves': random.uniform(0.002, 0.02),
        'lag': random.uniform(3e-4, 1.3e-3),
        'friction': random.uniform(1e-4, 3e-4),
        'static_error': random.uniform(5e-5, 4e-4),
        'single_gaps': 0.01,
        'servo_gain_factor': random.uniform(0.7, 1.5),
        'servo_lookahead_factor': random.uniform(0.8, 1.3),
        'set_point_deceleration': random.uniform(6.0, 18.0),
        'blend_begin': random.uniform(0.5, 1.0),
        'blend_speed_ratio': random.uniform(0.6, 1.6),
    }
    return Twin(
        arm=ArmIdentity(model='ur5e', software='5.21.0'),
        date='2026-11-27',
        estimates={name: Estimate(value=x, interval=(x, x)) for name, x in laws.items()},
    )


HIDDEN = hidden_laws(5)
hidden_arm = pytest.mark.ur_sim(twin=HIDDEN, polyscope='5.21.0', rate=4.0, q=HOME)


class Terminal(StringIO):
    """A person who answers yes or no."""

    def isatty(self):
        return True


@pytest.fixture
def identify(ur_sim, tmp_path, monkeypatch, capsys):
    """Run the command; return its status, its output, and the outcome of each experiment."""

    def run(*words, answer='y', answers='', terminal=True, box=BOX, speed='0.3'):
        typed = (Terminal if terminal else StringIO)(answers or f'{answer}\n' * 20)
        monkeypatch.setattr(sys, 'stdin', typed)
        ports = ur_sim.ports
        arguments = ['--robot-ip', '127.0.0.1', '--folder', str(tmp_path / 'found')]
        for name in ('rtde', 'primary', 'dashboard', 'robot_api'):
            arguments += [f'--{name.replace("_", "-")}-port', str(getattr(ports, name))]
        arguments += [f'--box={box}', '--max-speed', speed, '-o', str(tmp_path / 'twin.yaml')]
        status = main(['identify', *arguments, *words])
        lines = (tmp_path / 'found' / PROGRESS).read_text().splitlines()
        outcomes = dict(line.split(': ', 1) for line in lines)
        printed = capsys.readouterr()
        return status, printed.out + printed.err, outcomes

    return run


def rests(ur_sim):
    """Wait until the arm stands still and no program runs."""
    places = []

    def still():
        state = ur_sim.state()
        places.append(state.q)
        stopped = state.runtime_state is RuntimeState.STOPPED
        return stopped and len(places) > 20 and len(set(places[-20:])) == 1

    wait_for(still, 20.0)


@pytest.mark.slow
@pytest.mark.ur_sim(twin=HIDDEN, polyscope='5.21.0', rate=4.0, q=HOME, power='off')
@pytest.mark.parametrize('answer', ['y', 'n'])
def test_an_arm_that_is_switched_off_is_powered_up_if_the_person_agrees(
    identify, ur_sim, tmp_path, answer
):
    status, printed, outcomes = identify('--only', 'wrist_slow', answer=answer)
    assert 'The arm is in mode POWER_OFF. Switch its power on and release the brakes' in printed
    mode = ur_sim.state().robot_mode
    if answer == 'n':
        assert (status, mode) == (1, RobotMode.POWER_OFF)
        assert outcomes['wrist_slow'].startswith('ended: the arm is in mode POWER_OFF; switch it')
        return
    assert (status, mode, outcomes) == (0, RobotMode.RUNNING, {'wrist_slow': 'done'}), printed
    found = read_twin(tmp_path / 'twin.yaml').estimates['start_time']
    assert found.value == pytest.approx(HIDDEN.estimates['start_time'].value, abs=1e-3)


@pytest.mark.slow
@hidden_arm
def test_the_command_alone_finds_the_laws_of_a_hidden_arm(identify, ur_sim, tmp_path, capsys):
    begin = ur_sim.state().T_base_tcp
    status, printed, outcomes = identify()
    assert status == 0, printed
    assert outcomes == dict.fromkeys(NAMES, 'done')
    found = read_twin(tmp_path / 'twin.yaml')
    assert (found.arm.model, found.arm.software, found.arm.motion_version) == ('ur5e', '5.21.0', 1)
    for name, estimate in HIDDEN.estimates.items():
        if name == 'protective_stop_time':
            assert 'a protective stop is not provoked' in found.not_identified[name]
            continue
        low, high = found.estimates[name].interval
        # As in test_simulated_arms: the simulator's ramps change once a cycle.
        is_arm = name in HIDDEN.arm_figures
        margin = (0.05 if is_arm else 1e-4) * estimate.value
        margin = max(margin, 2e-4) if name.endswith(('_time', '_moves')) else margin
        assert low - margin <= estimate.value <= high + margin, name
    assert begin.distance_to(ur_sim.state().T_base_tcp) < 1e-4
    assert found.estimates['blend_shape'].value == 'parabola'
    # The same files, later and without the robot.
    files = [str(tmp_path / 'found' / name) for name in found.files]
    calls = str(tmp_path / 'found' / 'calls.script')
    again = ['--commands', calls, '-o', str(tmp_path / 'again.yaml'), '--model', 'ur5e']
    assert main(['identify', *files, *again]) == 0
    assert read_twin(tmp_path / 'again.yaml').estimates == found.estimates


#: Experiments in which the tool travels, and where the fault happens [m].
TRAVELS = ('line', 'movel_without_speed', 'blend', 'pause', 'stop')


@pytest.mark.slow
@hidden_arm
@pytest.mark.parametrize('name', TRAVELS)
def test_a_protective_stop_ends_the_experiments_and_stays(identify, ur_sim, name, tmp_path):
    # Where the arm cruises, so that the ramp is seen.
    ur_sim.inject(f'protective_stop at {0.05 if name == "movel_without_speed" else 0.02} m')
    rest = [each for each in NAMES if each in (name, 'wrist_fast', 'stop')]
    status, printed, outcomes = identify('--only', ','.join(rest))
    assert status == 1
    before = rest[: rest.index(name)]
    behind = rest[rest.index(name) + 1 :]
    expected = 'ended: the robot stopped, with safety mode PROTECTIVE_STOP'
    assert outcomes == dict.fromkeys(before, 'done') | {name: expected} | dict.fromkeys(
        behind, 'not begun'
    )
    assert 'The experiments ended early: the robot stopped' in printed
    rests(ur_sim)
    assert ur_sim.call(lambda controller: controller.safety.mode) is SafetyMode.PROTECTIVE_STOP
    # What was recorded until then shows this very stop.
    low, high = read_twin(tmp_path / 'twin.yaml').estimates['protective_stop_time'].interval
    assert low - 3e-4 <= HIDDEN.estimates['protective_stop_time'].value <= high + 3e-4


@pytest.mark.slow
@hidden_arm
@pytest.mark.parametrize(
    ('fault', 'words', 'said'),
    [
        ('protective_stop', 'the robot stopped, with safety mode PROTECTIVE', 'was interrupted'),
        ('pause', 'the program was paused', 'was interrupted'),
        ('stop', 'the program ended', 'was interrupted'),
        # It is interrupted, too, where the arm is still moving when the program is stopped.
        ('slider 0.5', 'the speed slider was moved', 'a motion of servoj '),
        ('drop rtde', '127.0.0.1 port', ''),
    ],
)
@pytest.mark.parametrize('name', ['servoj', 'servoj_left'])
def test_what_disturbs_servoj_ends_it(identify, ur_sim, name, fault, words, said, tmp_path):
    """The arm rests, and no law is found that the arm does not have."""

    def disturb():
        wait_for(lambda: abs(ur_sim.state().q[5] - HOME[5]) > 0.05, 30.0)
        ur_sim.inject(fault)

    disturbing = Thread(target=disturb)
    disturbing.start()
    status, printed, outcomes = identify('--only', f'{name},stop')
    disturbing.join()
    assert status == 1, printed
    assert outcomes[name].startswith(f'ended: {words}')
    assert outcomes['stop'] == 'not begun'
    rests(ur_sim)
    found = read_twin(tmp_path / 'twin.yaml')
    assert 'set_point_deceleration' in found.not_identified
    for law in ('servo_gain_factor', 'servo_lookahead_factor'):
        if said:
            assert said in found.not_identified[law]
        elif law in found.estimates:
            true = HIDDEN.estimates[law].value
            assert found.estimates[law].value == pytest.approx(true, rel=1e-3)


@pytest.mark.slow
@hidden_arm
@pytest.mark.parametrize('fault', ['emergency_stop', 'safeguard_stop'])
def test_another_safety_stop_is_no_law_of_the_twin(identify, ur_sim, fault, tmp_path):
    ur_sim.inject(f'{fault} at 0.02 m')
    status, printed, outcomes = identify('--only', 'line')
    assert status == 1
    assert outcomes['line'].startswith('ended: the robot stopped, with safety mode '), printed
    found = read_twin(tmp_path / 'twin.yaml')
    for name in ('pause_time', 'stop_time', 'protective_stop_time'):
        assert name in found.not_identified


@pytest.mark.slow
@hidden_arm
@pytest.mark.parametrize('name', TRAVELS)
@pytest.mark.parametrize('cut', [('rtde',), ('rtde', 'primary')], ids=['rtde', 'both'])
def test_a_cut_connection_leaves_a_resting_arm(identify, ur_sim, name, cut):
    ur_sim.inject(*(f'drop {interface} at 0.02 m' for interface in cut))
    status, printed, outcomes = identify('--only', f'{name},wrist_slow')
    assert status == 1
    assert outcomes['wrist_slow'] == 'done'
    assert outcomes[name].startswith('ended: 127.0.0.1 port')
    assert 'RTDE' in outcomes[name]
    assert 'start_time' in printed  # the first experiment is evaluated
    rests(ur_sim)


@pytest.mark.slow
@hidden_arm
def test_a_lost_primary_connection_ends_the_experiments(identify, ur_sim):
    ur_sim.inject('drop primary at 0.01 m')
    status, printed, outcomes = identify('--only', 'line,stop')
    assert status == 1, printed
    assert outcomes['line'].startswith('ended: primary interface: ')
    assert 'may move' not in outcomes['line']  # the client connects again, and stops the program
    assert outcomes['stop'] == 'not begun'
    rests(ur_sim)


@pytest.mark.slow
@hidden_arm
def test_an_arm_that_nobody_can_stop_is_said_to_move(identify, ur_sim):
    ur_sim.inject(*(f'drop {each} at 0.01 m for 1000 s' for each in ('rtde', 'primary')))
    status, printed, outcomes = identify('--only', 'movel_without_speed')
    assert status == 1
    said = '; nobody can stop the program, so the arm may move for up to 10 s more'
    assert outcomes['movel_without_speed'].endswith(said)
    assert said in printed
    rests(ur_sim)


@pytest.mark.slow
@hidden_arm
def test_the_way_back_of_a_stop_keeps_its_speed(identify, ur_sim):
    begin = ur_sim.state().T_base_tcp
    status, printed, outcomes = identify('--only', 'stop', speed='0.041')
    assert (status, outcomes) == (0, {'stop': 'done'}), printed
    assert begin.distance_to(ur_sim.state().T_base_tcp) < 1e-4


@pytest.mark.slow
@hidden_arm
def test_a_recording_that_cannot_be_written_hides_no_surprise(ur_sim, tmp_path):
    address = RobotAddress(
        host='127.0.0.1', rtde_port=ur_sim.ports.rtde, primary_port=ur_sim.ports.primary
    )
    bounds = MotionBounds(low=(-1.0, -1.0, 0.0), high=(1.0, 1.0, 1.0), max_speed=0.3)
    line = next(each for each in LAW_EXPERIMENTS if each.name == 'line')

    async def carry_out():
        state = await ready_state(address, None)
        with pytest.raises(Surprise) as caught:
            await record_experiment(address, line, state, bounds, tmp_path / 'gone' / 'line.csv')
        assert asyncio.all_tasks() == {asyncio.current_task()}  # both connections are closed
        return caught.value

    ur_sim.inject('slider 0.5 at 0.01 m')
    surprise = asyncio.run(carry_out())
    assert str(surprise) == 'the speed slider was moved'
    (note,) = surprise.__notes__
    assert note.endswith('line.csv cannot be written: No such file or directory')


@pytest.mark.slow
@hidden_arm
@pytest.mark.parametrize(
    ('fault', 'words'),
    [
        ('stop at 0.02 m', 'the program ended 2'),
        ('pause at 0.02 m', 'the program was paused'),
        ('slider 0.5 at 0.02 m', 'the speed slider was moved'),
        ('foreign_motion y 0.03 at 0.02 m', 'the program ended'),
    ],
)
def test_what_others_do_ends_the_experiments(identify, ur_sim, fault, words):
    ur_sim.inject(fault)
    status, _, outcomes = identify('--only', 'line,stop')
    assert status == 1
    assert outcomes['line'].startswith(f'ended: {words}')
    assert outcomes['stop'] == 'not begun'
    rests(ur_sim)


@pytest.mark.slow
@pytest.mark.ur_sim(
    polyscope='5.21.0',
    rate=4.0,
    q=HOME,
    twin=replace(
        HIDDEN, estimates={'timed_linear_speed': Estimate(value=0.6, interval=(0.6, 0.6))}
    ),
)
def test_an_arm_that_is_faster_than_allowed_is_stopped(identify, ur_sim):
    status, _, outcomes = identify('--only', 'movel_without_speed', speed='0.26')
    assert status == 1
    assert outcomes['movel_without_speed'].startswith('ended: the tool was too fast: 0.')
    rests(ur_sim)


@pytest.mark.slow
@pytest.mark.ur_sim(
    polyscope='5.21.0',
    rate=4.0,
    q=HOME,
    twin=replace(
        HIDDEN, estimates={'blend_speed_ratio': Estimate(value=5.0, interval=(5.0, 5.0))}
    ),
)
def test_an_arm_that_is_faster_than_allowed_in_a_blend_is_stopped(identify, ur_sim):
    status, _, outcomes = identify('--only', 'blend', speed='0.06')
    assert status == 1
    assert outcomes['blend'].startswith('ended: the tool was too fast: 0.')
    rests(ur_sim)


@pytest.mark.slow
@hidden_arm
def test_yes_answers_for_moves_only(identify, ur_sim):
    status, printed, outcomes = identify(
        '--yes', '--only', 'wrist_slow,blend,pause,stop', terminal=False
    )
    assert status == 0, printed
    assert outcomes == {
        'wrist_slow': 'done',
        'blend': 'skipped: not wanted',
        'pause': 'skipped: not wanted',
        'stop': 'skipped: not wanted',
    }


@pytest.mark.slow
@hidden_arm
def test_nothing_moves_without_a_yes_or_outside_the_bounds(identify, ur_sim):
    begin = ur_sim.state().q
    x, y, z = ur_sim.state().T_base_tcp.position
    box = f'{x - 0.01},{y - 0.01},{z - 0.01},{x + 0.01},{y + 0.01},{z + 0.01}'
    status, printed, outcomes = identify(answer='n', box=box, speed='0.03')
    assert status == 0
    for name in NAMES:
        words = 'it would leave the box: ' if name in TRAVELS else 'not wanted'
        assert outcomes[name].startswith(f'skipped: {words}'), name
    assert ur_sim.state().q == begin
    assert 'start_time' not in printed


@pytest.mark.slow
@hidden_arm
def test_a_robot_that_is_not_ready_is_not_moved(identify, ur_sim):
    ur_sim.set_speed_slider(0.5)
    status, _, outcomes = identify()
    assert status == 1
    assert outcomes['wrist_slow'] == 'ended: the speed slider is at 50%; set it to 100 %'
    assert outcomes['turn'] == 'not begun'


@pytest.mark.parametrize(
    ('words', 'said'),
    [
        ([], 'give either recordings, or the robot that shall move: --robot-ip'),
        (['x.csv', '--robot-ip', '127.0.0.1'], 'give either recordings, or the robot'),
        (['--robot-ip', '127.0.0.1'], 'add --box and --max-speed'),
        (
            ['--robot-ip', '127.0.0.1', f'--box={BOX}', '--max-speed', '0.1'],
            'needs a terminal; --yes answers for moves',
        ),
        (
            ['--robot-ip', '127.0.0.1', '--box=1,0,0,0,1,1', '--max-speed', '0.1', '--yes'],
            'the box reaches from (1.0, 0.0, 0.0) to (0.0, 1.0, 1.0)',
        ),
    ],
)
def test_what_is_missing_is_said(monkeypatch, capsys, tmp_path, words, said):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, 'stdin', StringIO())
    assert main(['identify', *words]) == 1
    assert said in capsys.readouterr().err
    assert not list(tmp_path.iterdir())


def test_a_folder_with_recordings_is_not_written_over(monkeypatch, capsys, tmp_path):
    monkeypatch.setattr(sys, 'stdin', Terminal())
    (tmp_path / PROGRESS).write_text('line: done\n')
    words = ['--robot-ip', '127.0.0.1', f'--box={BOX}', '--max-speed', '0.1']
    assert main(['identify', *words, '--folder', str(tmp_path)]) == 1
    assert 'has the recordings of another run; name another --folder' in capsys.readouterr().err


def test_a_robot_with_a_problem_is_not_moved():
    problem = Finding(check='rtde', verdict=Verdict.PROBLEM, text='Nothing answers.')
    with pytest.raises(ValueError, match=r'no motion, because of rtde: Nothing answers\.'):
        arm_of([problem], ArmIdentity())


def observed(*models):
    """Return the findings about a robot whose type has some models."""
    return [
        Finding(check=check, verdict=Verdict.OK, text='', data=data)
        for check, data in (
            ('software', {'version': '5.21.0.0'}),
            ('model', {'models': list(models)}),
            ('motion_version', {'motion_version': 1}),
        )
    ]


@pytest.mark.parametrize(('asked', 'model'), [('', 'ur5e'), ('ur5e', 'ur5e'), ('ur7e', 'ur7e')])
def test_the_option_chooses_among_models_of_one_type(asked, model):
    arm = arm_of(observed('ur5e', 'ur7e'), ArmIdentity(model=asked))
    assert arm == ArmIdentity(model=model, software='5.21.0', motion_version=1)


@pytest.mark.slow
@hidden_arm
def test_another_arm_than_the_option_names_is_not_moved(identify, ur_sim, tmp_path, capsys):
    begin = ur_sim.state().q
    with pytest.raises(FileNotFoundError):  # nothing was begun
        identify('--model', 'ur10e')
    said = 'the robot is another arm: model ur5e, not ur10e; correct the options'
    assert said in capsys.readouterr().err
    assert ur_sim.state().q == begin


@pytest.mark.slow
@hidden_arm
def test_the_end_of_the_input_means_no(identify, tmp_path):
    status, printed, outcomes = identify('--only', 'wrist_slow,turn', answers='y\n')
    assert status == 0, printed
    assert outcomes == {'wrist_slow': 'done', 'turn': 'skipped: not wanted'}
    assert 'start_time' in printed


def test_experiments_are_slow_first_and_interrupted_last():
    kinds = [each.interruption is not Interruption.NONE for each in LAW_EXPERIMENTS]
    assert kinds == sorted(kinds)
    assert LAW_EXPERIMENTS[0].speed == min(each.speed for each in LAW_EXPERIMENTS if each.wrist)


def test_the_triangle_of_blends_has_room_for_any_curve_within_the_radius():
    pose = Pose((0.5, 0.1, 0.3), Pose.from_rotation_vector((0, 0, 0, pi, 0, 0)).quaternion)
    state = RobotState(
        timestamp=0.0,
        actual_q=(0.0,) * 6,
        actual_tcp_pose=pose,
        target_tcp_pose=pose,
        T_flange_tcp=Pose((0.0, 0.0, 0.2)),
    )
    blend = next(each for each in LAW_EXPERIMENTS if each.name == 'blend')
    assert blend.question.startswith(
        'The tool moves 40 mm against its z axis, 40 mm along its x axis and straight back, at up '
        'to 40 mm/s, with blends of 10 mm, in which its speed is up to the robot.'
    )
    assert [call.count('movel') for call in blend.calls(state)] == [3]
    bounds = MotionBounds(low=(0.48, 0.09, 0.29), high=(0.56, 0.11, 0.36), max_speed=0.05)
    assert blend.refusal(state, bounds) == ''
    tight = replace(bounds, high=(0.54, 0.11, 0.36))
    assert blend.refusal(state, tight).startswith('it would leave the box: x = 0.550 m')
    tight = replace(bounds, high=(0.56, 0.11, 0.345))
    assert blend.refusal(state, tight).startswith('it would leave the box: z = 0.350 m')
    # It turns back between both corners.
    assert blend.places(state)[-1] == pytest.approx((0.52, 0.1, 0.34))


def test_a_tool_beside_the_axis_of_the_wrist_moves_on_a_circle():
    state = RobotState(
        timestamp=0.0,
        actual_q=(0.0,) * 5 + (1.0,),
        actual_tcp_pose=Pose((0.5, 0.1, 0.3)),
        target_tcp_pose=Pose((0.5, 0.1, 0.3)),
        T_flange_tcp=Pose((0.1, 0.0, 0.2)),
    )
    fast = next(each for each in LAW_EXPERIMENTS if each.name == 'wrist_fast')
    assert fast.tool_speed(state) == pytest.approx(0.06)
    # 40 degrees, back towards the middle of the range.
    assert fast.places(state)[-1] == pytest.approx((0.4766, 0.0357, 0.3), abs=1e-4)
    tight = MotionBounds(low=(0.4, 0.05, 0.2), high=(0.6, 0.15, 0.4), max_speed=0.05)
    assert fast.refusal(state, tight).startswith('it would leave the box: y = ')
    wide = replace(tight, low=(0.4, 0.0, 0.2))
    assert fast.refusal(state, wide) == '0.06 m/s is faster than 0.05 m/s'
    assert fast.refusal(state, replace(wide, max_speed=0.07)) == ''


def test_the_set_points_of_servoj_move_in_small_steps_and_return():
    """A set-point that jumps to the target of a call is still near the arm."""
    q = (0.1, -1.2, 1.4, -1.6, -1.5, 1.0)
    state = RobotState(
        timestamp=0.0, actual_q=q, target_q=q, actual_tcp_pose=Pose(), target_tcp_pose=Pose()
    )
    experiment = next(each for each in LAW_EXPERIMENTS if each.name == 'servoj')
    (calls,) = experiment.calls(state)
    (command,) = read_commands(calls, 'calls')
    points = command.set_points
    targets = np.array([q, *points.targets])
    assert np.abs(np.diff(targets, axis=0)).max() <= 0.1 * 0.0405
    assert points.is_stopped
    assert sum(points.times) < LONGEST_PROGRAM
    assert points.rest(q) == pytest.approx(0.4)
    assert targets[-1] == pytest.approx(q)
    # 10 degrees, towards the middle of the range.
    assert targets[:, 5].min() == pytest.approx(1.0 - np.radians(10.0))
    assert targets[:, 5].max() == 1.0
