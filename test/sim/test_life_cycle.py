# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Programs start, pause, end and replace each other as on the robot."""

from math import dist

import pytest

from ur_cartesian_driver.motion.state.rtde_state import RobotMode, RuntimeState, SafetyMode
from ur_cartesian_driver.sim.state.power_and_safety import SafetyEvent

#: Delay of a program's first motion by its slow start [s].
START = 0.08
LONG_MOVE = 'movej([1.5, -1.57, 1.57, -1.57, -1.57, 0], a=2, v=1)'
LONG_LINE = 'movel(pose_trans(get_actual_tcp_pose(), p[0, 0, 0.1, 0, 0, 0]), a=0.5, v=0.1)'


def keys(bench):
    return [(m.title, m.text) for m in bench.controller.messages.pending if hasattr(m, 'title')]


def test_a_program_announces_its_start_and_its_end_by_name(bench):
    bench.programs.submit('def hello():\n  sync()\nend\n')
    assert bench.programs.state is RuntimeState.PLAYING
    bench.wait(0.02)
    assert bench.programs.state is RuntimeState.STOPPED
    assert keys(bench) == [('PROGRAM_XXX_STARTED', 'hello'), ('PROGRAM_XXX_STOPPED', 'hello')]


def test_an_unknown_function_is_refused_with_line_and_column_before_anything_runs(bench):
    bench.programs.submit('def bad():\n  textmsg("ran")\n  calldoesntexist()\nend\n')
    bench.wait(0.02)
    assert bench.log == ['3:3: compile_error_name_not_found:calldoesntexist:']
    assert bench.programs.state is RuntimeState.STOPPED


def test_a_refused_program_leaves_the_running_one_alone(bench):
    bench.start('while True:\n  sync()\nend', name='first')
    bench.programs.submit('def bad():\n  x = = 1\nend\n')
    bench.wait(0.02)
    assert bench.programs.state is RuntimeState.PLAYING
    assert bench.programs.name == 'first'


def test_a_runtime_exception_ends_the_program_and_says_where(bench):
    assert bench.run('x = 1\ny = sqrt(-x)\ntextmsg("not reached")') == [
        entry for entry in bench.log if entry.startswith('3:7: Runtime error (3:7): ')
    ]
    assert len(bench.log) == 1


def test_a_new_program_replaces_the_running_one_once_the_arm_stands(bench):
    bench.start(LONG_MOVE, name='first')
    bench.wait(0.5)
    bench.start('textmsg(norm(get_target_joint_speeds()))\nsleep(10)', name='second')
    assert bench.programs.state is RuntimeState.STOPPING
    taken = bench.until(lambda: bench.programs.name == 'second', within=0.2)
    assert taken > 0.02
    bench.step(2)
    assert bench.log == ['0']
    assert keys(bench)[1:] == [('PROGRAM_XXX_STOPPED', 'first'), ('PROGRAM_XXX_STARTED', 'second')]


@pytest.mark.parametrize(
    ('line', 'speed'),
    [
        ('speedj([0.2, 0, 0, 0, 0, 0], 1, 0.1)', 0.2),
        ('speedl([0.05, 0, 0, 0, 0, 0], 0.25, 0.1)', 0.05),
    ],
)
def test_set_points_may_be_streamed_a_program_each(bench, line, speed):
    # As clients do it, such as ur_modern_driver 125 times a second.
    motion, speeds = bench.controller.motion, []
    for _ in range(30):
        bench.start(line)
        bench.step(10)
        speeds.append(motion.tcp_twist[0] if 'speedl' in line else motion.qd[0])
    reached = [min(speed, 0.1 * speed * n) for n in range(1, 31)]
    assert speeds == pytest.approx(reached, abs=0.06 * speed)


def test_a_move_that_replaces_a_stream_begins_once_the_arm_stands(bench):
    motion, goal = bench.controller.motion, (0.5, -1.57, 1.57, -1.57, -1.57, 0)
    bench.start('speedj([0.5, 0, 0, 0, 0, 0], 2, 10)')
    bench.wait(0.5)
    bench.start(f'movej({list(goal)})')
    bench.until(lambda: bench.programs.state is RuntimeState.STOPPED)
    assert motion.q == pytest.approx(goal)
    assert bench.log == []


def test_a_program_that_ends_while_the_arm_moves_makes_it_brake(bench):
    q = bench.controller.config.q
    bench.start('movej([1.5, -1.57, 1.57, -1.57, -1.57, 0], a=2, v=1, r=0.05)\nhalt')
    bench.until(lambda: bench.programs.state is RuntimeState.STOPPING)
    speed = max(abs(v) for v in bench.controller.motion.qd)
    assert speed > 0.1
    bench.until(lambda: bench.programs.state is RuntimeState.STOPPED, within=0.5)
    assert bench.controller.motion.qd == (0.0,) * 6
    assert dist(bench.controller.motion.q, q) > 0.5


def test_threads_end_with_their_program(bench):
    log = bench.run("""
thread ticker():
  while True:
    textmsg("tick")
    sync()
  end
end
run ticker()
sync()
sync()""")
    bench.wait(0.1)
    assert bench.log == log
    assert 1 <= len(log) <= 3


def test_pause_brakes_on_the_path_and_play_goes_on(bench):
    bench.start(LONG_LINE)
    bench.wait(0.5)
    start = bench.controller.motion.T_base_tcp
    assert bench.programs.pause() == ''
    assert bench.programs.state is RuntimeState.PAUSING
    taken = bench.until(lambda: bench.programs.state is RuntimeState.PAUSED)
    assert 0.1 < taken < 0.4
    paused = bench.controller.motion.T_base_tcp
    assert 0.001 < start.distance_to(paused) < 0.03
    bench.wait(1.0)
    assert bench.controller.motion.T_base_tcp == paused
    assert bench.programs.play() == ''
    bench.until(lambda: bench.programs.state is RuntimeState.STOPPED)
    line = bench.controller.motion.T_base_tcp
    assert start.inverse().apply(paused.position)[:2] == pytest.approx((0, 0), abs=1e-9)
    assert start.inverse().apply(line.position)[:2] == pytest.approx((0, 0), abs=1e-9)


def test_clients_see_a_program_resuming_before_its_speed_rises_from_zero(bench):
    bench.start(LONG_LINE)
    bench.wait(0.5)
    bench.programs.pause()
    bench.until(lambda: bench.programs.state is RuntimeState.PAUSED)
    bench.programs.play()
    seen = []
    for _ in range(3):
        bench.step()
        seen.append((bench.programs.state, bench.controller.speed_scaling))
    assert seen[0] == (RuntimeState.RESUMING, 0.0)
    assert [state for state, _ in seen[1:]] == [RuntimeState.PLAYING] * 2
    assert 0.0 < seen[1][1] < seen[2][1] < 0.1


def test_the_statement_pause_pauses(bench):
    bench.start('textmsg("a")\npause\ntextmsg("b")')
    bench.until(lambda: bench.programs.state is RuntimeState.PAUSED)
    assert bench.log == ['a']
    assert bench.programs.play() == ''
    bench.until(lambda: bench.programs.state is RuntimeState.STOPPED)
    assert bench.log == ['a', 'b']


def test_a_protective_stop_pauses_and_cannot_be_unlocked_at_once(bench):
    bench.start(LONG_LINE + '\ntextmsg("arrived")')
    bench.wait(0.5)
    assert bench.controller.safety_event(SafetyEvent.PROTECTIVE_STOP) == ''
    bench.until(lambda: bench.programs.state is RuntimeState.PAUSED, within=0.12)
    assert bench.controller.power.mode is RobotMode.RUNNING
    assert 'C209A0' in bench.log[0]
    assert 'wait another' in bench.controller.safety_event(SafetyEvent.UNLOCK)
    bench.wait(5.0)
    assert bench.programs.play() == 'the safety mode is PROTECTIVE_STOP'
    assert bench.controller.safety_event(SafetyEvent.UNLOCK) == ''
    bench.wait(0.5)
    assert bench.programs.state is RuntimeState.PAUSED
    assert bench.programs.play() == ''
    bench.until(lambda: bench.programs.state is RuntimeState.STOPPED)
    assert bench.log[-1] == 'arrived'


def test_a_program_can_stop_protectively_itself(bench):
    bench.start('protective_stop()\ntextmsg("went on")')
    bench.wait(0.1)
    assert bench.controller.safety.mode is SafetyMode.PROTECTIVE_STOP
    assert bench.programs.state is RuntimeState.PAUSED
    assert 'went on' not in bench.log


def test_an_emergency_stop_brakes_pauses_and_cuts_the_power(bench):
    bench.start(LONG_LINE + '\ntextmsg("arrived")')
    bench.wait(0.5)
    bench.controller.safety_event(SafetyEvent.EMERGENCY_STOP)
    bench.wait(0.2)
    assert bench.controller.power.mode is RobotMode.POWER_OFF
    assert bench.programs.state is RuntimeState.PAUSED
    assert bench.controller.power_on() == 'the safety mode is ROBOT_EMERGENCY_STOP'
    assert bench.controller.safety_event(SafetyEvent.RELEASE) == ''
    assert bench.controller.release_brakes() == ''
    bench.until(lambda: bench.controller.power.mode is RobotMode.RUNNING)
    assert bench.programs.play() == ''
    bench.until(lambda: bench.programs.state is RuntimeState.STOPPED)
    assert bench.log[-1] == 'arrived'


def test_an_emergency_stop_that_is_released_at_once_cuts_the_power_all_the_same(bench):
    bench.start(LONG_LINE)
    bench.wait(0.5)
    bench.controller.safety_event(SafetyEvent.EMERGENCY_STOP)
    bench.step(2)
    assert not bench.controller.at_rest
    assert bench.controller.safety_event(SafetyEvent.RELEASE) == ''
    bench.until(lambda: bench.controller.at_rest)
    bench.step(2)
    assert bench.controller.power.mode is RobotMode.POWER_OFF


@pytest.mark.parametrize('event', [SafetyEvent.VIOLATION, SafetyEvent.FAULT])
def test_a_violation_or_fault_cuts_the_power_and_ends_the_program(bench, event):
    bench.start(LONG_LINE)
    bench.wait(0.5)
    bench.controller.safety_event(event)
    bench.step(2)
    assert bench.controller.power.mode is RobotMode.POWER_OFF
    assert bench.programs.state is RuntimeState.STOPPED
    assert bench.controller.safety_event(SafetyEvent.RESTART) == ''
    assert bench.controller.safety.mode is SafetyMode.NORMAL


def test_power_comes_up_in_a_chain(make_bench):
    bench = make_bench(power='off')
    seen = [bench.controller.power.mode]
    bench.start('sync()')
    assert 'not started' in bench.log[0]
    bench.controller.release_brakes()
    while seen[-1] is not RobotMode.RUNNING:
        bench.step()
        if bench.controller.power.mode is not seen[-1]:
            seen.append(bench.controller.power.mode)
    assert seen == [RobotMode.POWER_OFF, RobotMode.POWER_ON, RobotMode.IDLE, RobotMode.RUNNING]


def test_power_on_ends_in_idle_and_does_not_lower_a_running_arm(make_bench):
    bench = make_bench(power='off')
    bench.controller.power_on()
    bench.wait(5.0)
    assert bench.controller.power.mode is RobotMode.IDLE
    bench.controller.release_brakes()
    bench.wait(5.0)
    bench.controller.power_on()
    bench.wait(1.0)
    assert bench.controller.power.mode is RobotMode.RUNNING


def test_a_secondary_program_runs_beside_the_primary_one(bench):
    bench.start('while not get_standard_digital_out(3):\n  sync()\nend\ntextmsg("seen")')
    bench.step(3)
    bench.programs.submit('sec setup():\n  set_standard_digital_out(3, True)\nend\n')
    bench.until(lambda: bench.programs.state is RuntimeState.STOPPED, within=0.1)
    assert bench.log == ['seen']


def test_a_secondary_program_cannot_take_time(bench):
    bench.start('while True:\n  sync()\nend')
    bench.programs.submit('sec slow():\n  sleep(1)\nend\n')
    bench.step(2)
    assert keys(bench)[-1][0] == 'SECONDARY_PROGRAM_EXCEPTION_XXX'
    assert 'sleep takes time' in keys(bench)[-1][1]
    assert bench.programs.state is RuntimeState.PLAYING


def test_a_thread_that_does_not_yield_ends_the_program(bench):
    log = bench.run('while True:\n  x = 1\nend')
    assert 'too much time' in log[0]


def test_a_second_thread_may_not_move_the_arm(bench):
    log = bench.run("""
thread mover():
  movej([1.5, -1.57, 1.57, -1.57, -1.57, 0])
end
run mover()
sync()
stopj(2)""")
    assert 'Another thread is already controlling the robot.' in log[0]


def test_after_kill_the_motion_is_free(bench):
    log = bench.run("""
thread mover():
  movej([1.5, -1.57, 1.57, -1.57, -1.57, 0])
end
t = run mover()
sleep(0.5)
kill t
stopj(4)
textmsg(norm(get_target_joint_speeds()))""")
    assert float(log[0]) < 0.001


def test_a_killed_thread_leaves_no_moving_arm(bench):
    bench.start("""
thread mover():
  movej([1.5, -1.57, 1.57, -1.57, -1.57, 0])
end
t = run mover()
sleep(0.5)
kill t
sleep(10)""")
    bench.wait(0.48)
    assert max(bench.controller.motion.qd) > 0.5
    bench.wait(0.2)
    assert bench.controller.motion.qd == (0.0,) * 6


def test_an_unreachable_movej_raises_and_an_unreachable_movel_stops_protectively(bench):
    log = bench.run('movej(p[10, 0, 0, 0, 0, 0])')
    assert 'unable to find an inverse kinematics solution' in log[0]
    bench.start('movel(p[10, 0, 0.4, 0, 3.14, 0], v=1, a=5)')
    bench.until(lambda: bench.controller.safety.mode is SafetyMode.PROTECTIVE_STOP)
    bench.until(lambda: bench.programs.state is RuntimeState.PAUSED, within=0.5)


def test_the_slider_stretches_time_and_keeps_the_path(bench):
    whole = _time_of(bench, LONG_LINE)
    bench.controller.set_slider(0.5)
    # The slow start of a program is not stretched.
    assert _time_of(bench, LONG_LINE) == pytest.approx(2 * whole - START, rel=0.002)


def _time_of(bench, body):
    bench.start(body)
    return bench.until(lambda: bench.programs.state is RuntimeState.STOPPED)


def test_a_blocking_popup_holds_its_thread_until_it_is_closed(bench):
    bench.start('popup("careful", blocking=True)\ntextmsg("confirmed")')
    bench.wait(1.0)
    assert [popup.text for popup in bench.controller.popups] == ['careful']
    assert 'confirmed' not in bench.log
    bench.controller.close_popups()
    bench.step(2)
    assert bench.log[-1] == 'confirmed'


def test_play_starts_a_loaded_program_but_no_script_that_was_sent(bench):
    bench.run('textmsg("sent")')
    assert bench.programs.play() == 'no program is loaded'
    assert bench.programs.load('a.urp', 'def a():\n  textmsg("loaded")\nend\n') == ''
    assert bench.programs.play() == ''
    bench.wait(0.1)
    assert bench.log == ['sent', 'loaded']


def test_an_input_that_is_not_written_pauses_by_its_watchdog(bench):
    bench.start('rtde_set_watchdog("input_int_register_24", 10)\nwhile True:\n  sync()\nend')
    for _ in range(10):
        bench.wait(0.08)
        bench.controller.watchdogs.written(('input_int_register_24',), bench.controller.time)
    assert bench.programs.state is RuntimeState.PLAYING
    bench.wait(0.12)
    assert bench.programs.state is RuntimeState.PAUSED


def test_the_servo_stream_follows_and_stops_when_it_dries_up(bench):
    bench.start("""
q = get_target_joint_positions()
i = 0
while i < 250:
  q[0] = q[0] + 0.001
  servoj(q, t=0.002, lookahead_time=0.03, gain=2000)
  i = i + 1
end
sleep(1)""")
    bench.wait(0.45)
    assert max(bench.controller.motion.qd) == pytest.approx(0.5, rel=0.05)
    bench.wait(0.5)
    assert bench.controller.motion.qd == (0.0,) * 6


def test_the_same_inputs_give_the_same_states(make_bench):
    def trace():
        bench = make_bench()
        bench.start(LONG_LINE)
        states = []
        for _ in range(300):
            bench.step()
            states.append(bench.controller.motion.q)
        return states

    assert trace() == trace()


def test_a_cb3_arm_moves_in_steps_of_8_ms(make_bench):
    bench = make_bench(model='ur5')
    taken = _time_of(bench, LONG_LINE.replace('a=0.5, v=0.1', 't=1') + '\ntextmsg(get_steptime())')
    assert bench.log == ['0.008']
    assert taken == pytest.approx(1.0 + START, abs=0.033)


def test_windows_that_nobody_waits_for_do_not_pile_up(bench):
    bench.run('i = 0\nwhile i < 150:\n  popup("again")\n  i = i + 1\nend')
    assert len(bench.controller.popups) == 100
