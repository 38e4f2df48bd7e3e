# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Plans that the simulated motion runs, packet by packet, before a trajectory machine."""

from __future__ import annotations

from math import pi

from goal_machines import point_machine
import pytest

from ur_cartesian_driver.execution.goal.motion_job import job_from_plan
from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.kinematics.inverse import nearest
from ur_cartesian_driver.kinematics.robot_models import robot_model
from ur_cartesian_driver.motion.events import StateReceived, TrajectoryEnded, TrajectoryResult
from ur_cartesian_driver.motion.geometry.pose import Pose, quaternion_from_rotation_vector
from ur_cartesian_driver.motion.geometry.vectors import scale6, subtract6, ZERO6
from ur_cartesian_driver.motion.goal.goal import Goal, Waypoint
from ur_cartesian_driver.motion.plan.primitive import MoveC, MoveJ, MoveL, MoveP
from ur_cartesian_driver.motion.state.rtde_state import RobotState, RuntimeState
from ur_cartesian_driver.motion.twin.laws import MotionLaws
from ur_cartesian_driver.planning import plan, PlanningOptions
from ur_cartesian_driver.sim.motion import MotionGenerator

CYCLE = 0.002
HOME = (0.3, -pi / 2, pi / 2, -pi / 2, -pi / 2, 0.0)


class Cell:
    """A UR5e with a tool that stands somewhere, and a controller that runs plans on it."""

    def __init__(self):
        self.arm = Arm(robot_model('ur5e'))
        self.T_flange_tcp = Pose((0.0, 0.02, 0.1), quaternion_from_rotation_vector((0.1, 0, 0.2)))
        self.home = self.arm.forward(HOME) @ self.T_flange_tcp

    def pose(self, x=0.0, y=0.0, z=0.0, turn=(0.0, 0.0, 0.0)):
        """Return a pose moved from home along base axes [m], turned about tool axes [rad]."""
        a, b, c = self.home.position
        turned = Pose((0, 0, 0), self.home.quaternion) @ Pose(
            (0, 0, 0), quaternion_from_rotation_vector(turn)
        )
        return Pose((a + x, b + y, c + z), turned.quaternion)

    def plan(self, points, segments=(), **fields):
        """Return the plan of a goal through poses, from home."""
        goal = Goal(
            waypoints=tuple(Waypoint(pose=pose) for pose in points),
            segments=tuple(segments),
            **fields,
        )
        state = RobotState(
            timestamp=0.0, actual_q=HOME, actual_tcp_pose=self.home, T_flange_tcp=self.T_flange_tcp
        )
        return plan(goal, state, self.arm, PlanningOptions(max_tool_speed=1.0))

    def run(
        self,
        made,
        *,
        scale=lambda t: 1.0,
        disturb=lambda t, state: state,
        instead=None,
        **settings,
    ):
        """
        Run a plan, and hand every packet to a machine, in the cycle in which it was made.

        :param scale: speed scaling by time [s]; 0 = a pause.
        :param disturb: changes a packet before the machine gets it, by time [s].
        :param instead: a plan that the robot runs while the machine believes in the other.
        :returns: the machine, and the commands of each packet.
        """
        job = job_from_plan(made)
        machine = point_machine(job, **settings)
        robot = MotionGenerator(self.arm, CYCLE, made.start, MotionLaws(turn_ratio=1.0))
        robot.T_flange_tcp = self.T_flange_tcp
        time, begun, twists, answers = 0.0, 0, ZERO6, []

        def state():
            nonlocal twists
            before, twists = twists, robot.tcp_twist
            rate = scale6(subtract6(twists, before), 1.0 / CYCLE)
            return disturb(
                time,
                RobotState(
                    timestamp=time,
                    actual_q=robot.q,
                    actual_qd=robot.qd,
                    target_q=robot.q,
                    target_qd=robot.qd,
                    actual_tcp_pose=robot.T_base_tcp,
                    target_tcp_pose=robot.T_base_tcp,
                    actual_tcp_twist=twists,
                    target_tcp_twist=twists,
                    actual_tcp_acceleration=rate,
                    target_tcp_acceleration=rate,
                    T_flange_tcp=self.T_flange_tcp,
                    effective_speed=scale(time),
                    runtime_state=RuntimeState.PLAYING,
                    points_begun=begun,
                ),
            )

        def cycle():
            nonlocal time
            robot.step(scale(time))
            assert robot.fault is None
            time += CYCLE
            answers.append(machine.step(StateReceived(state=state()), time))

        machine.start(state())
        for k, segment in enumerate((instead or made).segments):
            begun = k + 1
            move = self._begin(robot, segment.primitive)
            while not move.returned:
                cycle()
        while robot.moving:
            cycle()
        answers.append(machine.step(TrajectoryEnded(result=TrajectoryResult.SUCCESS), time))
        cycle()
        return machine, answers

    def _begin(self, robot, move):
        a, v, r = move.acceleration, move.velocity, move.blend_radius
        match move:
            case MoveJ():
                assert isinstance(move.target, Pose)
                q = nearest(self.arm, move.target @ self.T_flange_tcp.inverse(), move.q_near)
                return robot.movej(q, a, v, move.duration, r)
            case MoveL():
                return robot.movel(move.target, a, v, move.duration, r)
            case MoveP():
                return robot.movep(move.target, a, v, r)
            case MoveC():
                return robot.movec(move.via, move.target, a, v, r, int(move.mode))
        raise AssertionError(f'no plan of these tests has a {type(move).__name__}')


@pytest.fixture(scope='session')
def cell():
    return Cell()
