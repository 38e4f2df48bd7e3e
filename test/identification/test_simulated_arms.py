# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Simulated controllers with the laws of a twin are identified from what RTDE reports of them.

Their targets have no noise, so intervals are narrower than what the simulator makes of its laws:
its ramps change once a cycle. So margins are added.
"""

from dataclasses import replace

import numpy as np
import pytest
from random_cases import cases, random_of

from ur_cartesian_driver.identification.arm_samples import ArmSamples
from ur_cartesian_driver.identification.estimators import Unknown
from ur_cartesian_driver.identification.identify import identify
from ur_cartesian_driver.identification.recorded_calls import read_commands
from ur_cartesian_driver.motion.twin.laws import LAWS
from ur_cartesian_driver.motion.twin.twin import ArmIdentity, Estimate, Twin
from ur_cartesian_driver.sim import SimulatorConfig
from ur_cartesian_driver.sim.controller_assembly import assemble
from ur_cartesian_driver.sim.motion.paths.second_motion_version import SecondMotionVersion
from ur_cartesian_driver.sim.state.power_and_safety import SafetyEvent

MODELS = ('ur3', 'ur5e', 'ur10e')
HOME = (0.0, -1.2, 1.4, -1.6, -1.5, 0.2)
#: Margin of times [s]; of the other laws of the controller, and of the figures of the arm.
TIME, EXACT, CLOSE = 2e-4, 1e-4, 0.05


class Recorder:
    """Runs programs on a simulated controller, and notes what RTDE would report."""

    def __init__(self, model, twin, **settings):
        config = SimulatorConfig(model=model, polyscope=twin.arm.software, twin=twin, **settings)
        self.controller = assemble(config).controller
        self.controller.motion.teleport(HOME)
        self.rows = []

    def run(self, name, body, event=lambda controller: None, after=0.4):
        """Return the samples of a program, with rest before and behind it."""
        self.rows = []
        self._steps(0.4)
        lines = ''.join(f'  {line}\n' for line in body.splitlines())
        self.controller.programs.submit(f'def program():\n{lines}end\n')
        self._steps(after)
        event(self.controller)
        while self._moves():
            self._steps(0.1)
        self._steps(0.8)
        *columns, poses = zip(*self.rows, strict=True)
        time, target, actual, state, safety = (np.array(column) for column in columns)
        return ArmSamples(
            name=name,
            time=time,
            target_q=target,
            actual_q=actual,
            target_pose=np.array([(*pose.position, *pose.quaternion) for pose in poses]),
            runtime_state=state.astype(float),
            safety_mode=safety.astype(float),
        )

    def _moves(self):
        last = self.rows[-50:]
        return len(last) < 50 or last[0][1] != last[-1][1]

    def _steps(self, seconds):
        controller = self.controller
        for _ in range(round(seconds / controller.cycle)):
            controller.step()
            self.rows.append(
                (
                    controller.time,
                    controller.motion.q,
                    controller.actual.q,
                    controller.programs.state,
                    controller.safety.mode,
                    controller.motion.T_base_tcp,
                )
            )


def drawn_twin(model, random):
    """Return a twin with laws drawn at random; ramps of the simulator take whole cycles."""
    laws = {
        'start_time': 0.008 * random.randint(8, 38),
        'stop_time': 0.008 * random.randint(8, 50),
        'pause_time': 0.008 * random.randint(10, 62),
        'protective_stop_time': 0.008 * random.randint(8, 38),
        'turn_ratio': random.uniform(1.0, 6.0),
        'timed_joint_acceleration': random.uniform(0.8, 2.5),
        'timed_joint_speed': random.uniform(0.4, 1.0),
        'timed_linear_acceleration': random.uniform(0.5, 2.0),
        'timed_linear_speed': random.uniform(0.1, 0.3),
        'idle_between_moves': random.uniform(0.0, 0.02),
        'blend_begin': random.uniform(0.4, 1.0),
        'blend_speed_ratio': random.uniform(0.5, 2.0),
        'lag': random.uniform(3e-4, 1.3e-3),
        'friction': random.uniform(1e-4, 3e-4),
        'static_error': random.uniform(5e-5, 4e-4),
        'ringing_frequency': random.uniform(6.0, 15.0),
        'ringing_decay': random.uniform(4.0, 10.0),
        'position_noise': random.uniform(6e-5, 1.5e-4),
        'servo_gain_factor': random.uniform(0.6, 1.7),
        'servo_lookahead_factor': random.uniform(0.7, 1.5),
        'set_point_deceleration': random.uniform(5.0, 18.0),
    }
    estimates = {name: Estimate(value=x, interval=(x, x)) for name, x in laws.items()}
    arm = ArmIdentity(model=model, software='3.15.8' if model == 'ur3' else '5.21.0')
    return Twin(arm=arm, date='2026-11-27', estimates=estimates)


CHAIN = """movej([0.9, -1.2, 1.2, -1.6, -1.5, 0.2])
movej([0.1, -1.0, 1.3, -1.4, -1.5, -0.5], a=1.7, v=0.6)
movej([0.6, -1.2, 1.4, -1.6, -1.5, 0.2], a=1.2, v=0.8)"""
#: Where the chain ends, wrist 3 turns there and back, with rest before, between and behind.
TURNED = [0.0] * 10 + [0.004 * i for i in range(41)] + [0.16] * 15
CALL = 'servoj([0.6, -1.2, 1.4, -1.6, -1.5, {!r}], t=0.04)'
SERVO = '\n'.join(
    CALL.format(0.2 + turned) for turned in [*TURNED, *(0.16 - turned for turned in TURNED[10:])]
)
SERVO += '\nstopj(2)'
#: Then it turns until no further set-point comes, and back.
BACK = 'movej([0.6, -1.2, 1.4, -1.6, -1.5, 0.2], a=2, v=1)'
LEFT = '\n'.join(CALL.format(0.2 + turned) for turned in [0.02 * i for i in range(61)])
LEFT += '\nsleep(1)'
LINES = """movel(pose_trans(get_target_tcp_pose(), p[0, 0, 0, 0.3, 0.2, 0.5]), a=0.5, v=0.1)
movel(pose_add(get_target_tcp_pose(), p[0.02, -0.05, 0.12, 0, 0, 0]))"""
BLENDED_LINES = """
movel(pose_add(get_target_tcp_pose(), p[0, 0.12, 0, 0, 0, 0]), a=1, v=0.1, r=0.02)
movel(pose_add(get_target_tcp_pose(), p[0.04, 0.04, -0.12, 0, 0, 0]), a=1, v=0.08, r=0.03)
movel(pose_add(get_target_tcp_pose(), p[0.1, -0.1, 0, 0, 0, 0.2]), a=1, v=0.12)"""
BLENDED_JOINTS = """movej([0.9, -1.1, 1.2, -1.6, -1.5, 0.2], a=1, v=0.2, r=0.02)
movej([0.5, -1.3, 1.0, -1.4, -1.5, 0.4], a=1, v=0.25, r=0.02)
movej([0.6, -1.0, 1.4, -1.6, -1.5, 0.2], a=1, v=0.2)"""
LONG = 'movej([{}, -1.2, 1.4, -1.6, -1.5, 0.2], a=3, v=0.5)'


def recordings(recorder):
    """Return the recordings of the standard experiments, and their calls."""
    found = [recorder.run('chain', CHAIN), recorder.run('servo', SERVO, after=1.0)]
    found += [recorder.run('left', LEFT), recorder.run('back', BACK)]
    found.append(recorder.run('lines', LINES))
    events = {
        'stop': lambda controller: controller.programs.stop(),
        'pause': lambda controller: controller.programs.pause(),
        'protective': lambda controller: controller.safety_event(SafetyEvent.PROTECTIVE_STOP),
    }
    blended = {'blends': BLENDED_LINES, 'joint blends': BLENDED_JOINTS}
    calls = [CHAIN, SERVO, LEFT, BACK, LINES, *blended.values()]
    found += [recorder.run(name, body) for name, body in blended.items()]
    for i, (name, event) in enumerate(events.items()):
        body = LONG.format(-1.4 if i % 2 == 0 else 1.6)
        found.append(recorder.run(name, body, event, after=1.0))
        recorder.controller.programs.stop()
        calls.append(body)
    return found, read_commands('\n'.join(calls), 'calls')


@pytest.mark.random
@pytest.mark.parametrize('case', range(cases(20)))
def test_the_laws_of_a_simulated_arm_are_found(case):
    random = random_of('simulated arm', case)
    model = MODELS[case % len(MODELS)]
    twin = drawn_twin(model, random)
    results = identify(*recordings(Recorder(model, twin))).results
    wrong = []
    for name, estimate in twin.estimates.items():
        found, true = results[name], estimate.value
        if model == 'ur3' and name.startswith('ringing'):
            assert 'packets every 8 ms are too rare' in str(found)
            continue
        if isinstance(found, Unknown):
            wrong.append(f'{name}: {found}')
            continue
        low, high = found.interval
        margin = (CLOSE if name in twin.arm_figures else EXACT) * true
        if name not in twin.arm_figures and LAWS[name].unit == 's':
            margin = TIME
        if not low - margin <= true <= high + margin:
            wrong.append(f'{name} is {true}, found {found.value} in {found.interval}')
    assert not wrong


@pytest.mark.parametrize('rise', [0.02, 0.1])
def test_the_ramps_of_motion_version_2_are_said_to_be_another_law(rise):
    twin = replace(
        drawn_twin('ur5e', random_of('version 2', rise)),
        arm=ArmIdentity(model='ur5e', software='5.22.0', motion_version=2),
    )
    laws = SecondMotionVersion(ramp_rise=rise)
    recorder = Recorder('ur5e', twin, motion_version=2, second_motion_version=laws)
    results = identify(*recordings(recorder)).results
    for name in ('start_time', 'timed_joint_speed', 'timed_linear_speed', 'idle_between_moves'):
        assert isinstance(results[name], Unknown), name
    assert 'followed no trapezoid' in results['start_time'].reason
    for name in ('stop_time', 'pause_time', 'protective_stop_time', 'lag', 'friction'):
        assert results[name].value == pytest.approx(twin.estimates[name].value, rel=CLOSE), name


def test_a_blend_without_its_calls_is_named_and_not_used():
    twin = Twin(arm=ArmIdentity(model='ur5e', software='5.21.0'), date='2026-11-27')
    blended = 'movel(pose_add(get_target_tcp_pose(), p[{}, 0.1, 0, 0, 0, 0]), a=1, v=0.1{})'
    body = blended.format(0.0, ', r=0.03') + '\n' + blended.format(0.1, '')
    found = identify([Recorder('ur5e', twin).run('blend', body)])
    assert found.summary() == '1 move: 1 of another shape (not used).'
    assert isinstance(found.results['start_time'], Unknown)
    assert 'calls that are known' in found.results['blend_begin'].reason
