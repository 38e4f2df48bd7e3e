# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The robot program calls functions of the script prelude at points; in virtual time.

Places are read from RTDE, outputs from the controller.
"""

from functools import partial

import pytest
from robot_cell import run_cell

from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.kinematics.robot_models import robot_model
from ur_cartesian_driver.motion.errors import ErrorCode
from ur_cartesian_driver.motion.geometry.pose import Pose
from ur_cartesian_driver.motion.goal.execution_modes import ExecutionMode
from ur_cartesian_driver.motion.goal.goal import Goal, OutputKind, SafeOutput, ScriptCall, Waypoint
from ur_cartesian_driver.motion.state.rtde_state import RuntimeState
from ur_cartesian_driver.planning import plan, PlanningOptions
from ur_cartesian_driver.robot.prelude_file import read_prelude

pytestmark = [pytest.mark.acceptance, pytest.mark.slow]

ARM = Arm(robot_model('ur5e'))
FILE = """
# The name of a variable of the driver's program, which it does not disturb.
running = 3

def grip(pin, on=1.0):
  set_standard_digital_out(floor(pin), on > 0)
  running = 0
  while not get_standard_digital_in(running + 1):
    sync()
  end
  set_standard_analog_out(0, pin / 10)
end

def halts():
  halt
end

def fails():
  local x = [1, 2][3]
end

def moves():
  movej(get_actual_joint_positions() + [0.1, 0, 0, 0, 0, 0], a=5, v=2)
end
"""


@pytest.fixture
def path(tmp_path):
    """Return the path of a prelude."""
    file = tmp_path / 'gripper.script'
    file.write_text(FILE)
    return str(file)


@pytest.fixture
def run(path):
    """Return what runs a scenario in a cell with the prelude."""
    return partial(run_cell, allow_scripts=True, script_prelude=path)


@pytest.fixture
def start(path):
    """Return what starts a goal of two points with a call at the first one."""
    options = PlanningOptions(max_tool_speed=1.0, prelude=read_prelude(path))

    def start_in(cell, function, *arguments, timeout=1.0, **fields):
        state = cell.memory.read()
        (x, y, z), turned = state.actual_tcp_pose.position, state.actual_tcp_pose.quaternion
        places = [Pose((x, y + 0.02, z), turned), Pose((x + 0.02, y + 0.02, z), turned)]
        call = ScriptCall(waypoint=0, function=function, arguments=arguments, timeout=timeout)
        goal = Goal(
            waypoints=tuple(
                Waypoint(pose=pose, time=time)
                for pose, time in zip(places, (0.4, 0.8), strict=True)
            ),
            script_calls=(call,),
            goal_time_tolerance=0.15,
            **fields,
        )
        motion = cell.owner.start(plan(goal, state, ARM, options))
        return motion, lambda k: cell.memory.read().target_tcp_pose.distance_to(places[k]) < 1e-4

    return start_in


def is_on(cell, pin=2):
    return cell.robot.controller.io.digital_out.standard[pin]


@pytest.mark.parametrize(
    ('headless', 'execution'),
    [(True, 'PRIMITIVES'), (False, 'PRIMITIVES'), (True, 'SPLINE'), (True, 'SERVO')],
)
def test_the_arm_stands_until_the_function_returns(run, start, headless, execution):
    async def scenario(cell):
        motion, is_at = start(cell, 'grip', 2.0, timeout=2.0, execution=ExecutionMode[execution])
        await cell.until(lambda: is_on(cell))
        assert is_at(0)
        await cell.sleep(0.8)
        assert is_at(0)
        cell.robot.controller.io.digital_in.standard[1] = True
        await cell.until(lambda: not is_at(0), 0.2)
        assert cell.robot.controller.io.analog_out[0] == pytest.approx(
            0.0072
        )  # [A], of 4 to 20 mA
        await cell.until(lambda: motion.outcome, 3.0)
        # The call is no delay of the motion: the tolerance of its time is less.
        assert motion.outcome.succeeded, motion.outcome.text
        assert is_at(1)

    run(scenario, headless=headless)


@pytest.mark.parametrize('execution', [ExecutionMode.PRIMITIVES, ExecutionMode.SERVO])
def test_a_function_that_does_not_return_ends_the_goal_by_its_name(run, start, execution):
    async def scenario(cell):
        safe = (SafeOutput(output=OutputKind.STANDARD_DIGITAL, pin=2, value=0.0),)
        motion, is_at = start(cell, 'grip', 2.0, 1.0, safe_outputs=safe, execution=execution)
        await cell.until(lambda: is_on(cell))
        assert await cell.until(lambda: motion.outcome, 3.0) == pytest.approx(1.0, abs=0.1)
        assert motion.outcome.code is ErrorCode.EXECUTION_FAILED
        assert motion.outcome.text == (
            'The robot program has been in grip(2, 1) at point 0 for more than its timeout of 1 s.'
        )
        assert is_at(0)
        assert not is_on(cell)
        cell.robot.controller.io.digital_in.standard[1] = True
        again, _ = start(cell, 'grip', 3.0, 0.0)
        await cell.until(lambda: again.outcome, 3.0)
        assert again.outcome.succeeded, again.outcome.text
        assert not is_on(cell, 3)

    run(scenario)


@pytest.mark.parametrize(
    ('function', 'execution', 'code', 'text'),
    [
        ('halts', 'PRIMITIVES', ErrorCode.PROGRAM_STOPPED, '(in halts() at point 0)'),
        ('halts', 'SERVO', ErrorCode.PROGRAM_STOPPED, '(in halts() at point 0)'),
        ('fails', 'PRIMITIVES', ErrorCode.PROGRAM_STOPPED, '(in fails() at point 0)'),
        ('moves', 'PRIMITIVES', ErrorCode.EXECUTION_FAILED, 'The controller itself left the plan'),
        # servoj holds the arm, and only one thread may move it.
        ('moves', 'SERVO', ErrorCode.PROGRAM_STOPPED, '(in moves() at point 0)'),
    ],
)
def test_what_a_function_does_to_the_goal_is_its_reason(
    run, start, function, execution, code, text
):
    async def scenario(cell):
        motion, _ = start(cell, function, execution=ExecutionMode[execution])
        await cell.until(lambda: motion.outcome, 3.0)
        assert motion.outcome.code is code, motion.outcome.text
        assert text in motion.outcome.text

    run(scenario)


def test_a_pause_does_not_count_as_time_of_the_function(run, start):
    async def scenario(cell):
        motion, _ = start(cell, 'grip', 2.0)
        await cell.until(lambda: is_on(cell))
        cell.robot.inject('pause')
        controller = cell.robot.controller
        await cell.until(lambda: controller.programs.state is RuntimeState.PAUSED)
        await cell.sleep(2.0)
        assert not motion.outcome
        await cell.dashboard('play')
        await cell.sleep(0.3)
        controller.io.digital_in.standard[1] = True
        await cell.until(lambda: motion.outcome, 3.0)
        assert motion.outcome.succeeded, motion.outcome.text

    run(scenario)


def test_a_function_that_the_controller_does_not_know_is_named(path):
    with open(path, 'a') as file:
        file.write('def grip_all():\n  rq_close_and_wait()\nend\n')

    async def scenario(cell):
        raise AssertionError('it is ready')

    with pytest.raises(AssertionError, match='compile_error_name_not_found:rq_close_and_wait'):
        run_cell(scenario, allow_scripts=True, script_prelude=path)
