# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
A simulated robot that runs our program, without network and without time.

It runs the driver's bytes, the driver's uploaded program, and the controller behind ``ur-cartesian
sim``; only the sockets are lists, and a cycle passes when a test steps it. So a motion costs the
computing time of its cycles, and nothing else.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ur_cartesian_driver.motion.events import TrajectoryResult
from ur_cartesian_driver.motion.geometry.pose import Pose
from ur_cartesian_driver.motion.state.rtde_state import RobotState, RuntimeState
from ur_cartesian_driver.program import ProgramSettings, render, wrap_in_program
from ur_cartesian_driver.protocol.program import script_command
from ur_cartesian_driver.protocol.program.reverse import keepalive, trajectory, TrajectoryAction
from ur_cartesian_driver.protocol.program.trajectory_points import (
    encode_points,
    TrajectoryResultDecoder,
)
from ur_cartesian_driver.sim.controller_assembly import assemble
from ur_cartesian_driver.sim.simulator_config import SimulatorConfig
from ur_cartesian_driver.sim.sockets.script_sockets import MemorySockets
from ur_cartesian_driver.sim.state.power_and_safety import OPERATIONAL, SafetyEvent

REVERSE, TRAJECTORY, COMMAND = 1, 2, 3
#: A message that is no failure: a movep is slower than requested.
IGNORED_MESSAGE = 'C196A0:'
#: Longest motion of a test [s].
MAX_MOTION_TIME = 5000.0


@dataclass(frozen=True, kw_only=True)
class ProgramRun:
    """The end of a trajectory."""

    #: Messages of the controller when it stopped; empty = the trajectory ran to its end.
    failure: str
    #: The result that the robot program reported, if any.
    result: TrajectoryResult | None
    #: Joint positions at the end [rad], and the TCP pose that the controller reports.
    q: tuple
    pose: Pose
    #: Targets of all cycles: joint positions (n, 6) [rad], and TCP poses.
    joints: np.ndarray
    poses: list
    #: Duration [s].
    duration: float


class RobotInMemory:
    """One robot, on which trajectories are run one after the other from anywhere."""

    def __init__(
        self,
        model,
        frequency=None,
        geometry=None,
        edit=wrap_in_program,
        interleaving_seed=None,
        twin=None,
    ):
        """
        Start the robot.

        :param edit: makes a program of the text that the driver sends.
        :param interleaving_seed: the seed of random switches between threads; None = no switches.
        :param twin: the laws of its motion; None = the assumed laws.
        """
        self.model, self.geometry, self.twin = model, geometry, twin
        config = SimulatorConfig(
            model=model,
            frequency=frequency,
            geometry=geometry,
            unlock_delay=0.0,
            interleaving_seed=interleaving_seed,
            twin=twin,
        )
        self._sockets = MemorySockets()
        self._accepted = {
            port: self._sockets.listen(port) for port in (REVERSE, TRAJECTORY, COMMAND)
        }
        self.controller = assemble(config, self._sockets).controller
        program = render(
            ProgramSettings(
                host='driver',
                reverse_port=REVERSE,
                trajectory_port=TRAJECTORY,
                script_command_port=COMMAND,
                version=config.version[:3],
            )
        )
        refusal = self.controller.programs.load('driver', edit(program))
        assert refusal == '', refusal

    @cached_property
    def slow(self):
        """The same robot with a fifth of the cycles, for motions of minutes."""
        return RobotInMemory(
            self.model, 0.2 / self.controller.cycle, self.geometry, twin=self.twin
        )

    def place(self, q, T_flange_tcp):
        """Put the arm with its tool at rest at joint positions; return RTDE's state."""
        self._ready()
        motion = self.controller.motion
        motion.T_flange_tcp = T_flange_tcp
        self.controller.motion.teleport(q)
        return RobotState(
            timestamp=0.0,
            actual_q=q,
            target_q=q,
            T_flange_tcp=T_flange_tcp,
            actual_tcp_pose=motion.T_base_tcp,
            target_tcp_pose=motion.T_base_tcp,
        )

    def run(
        self,
        primitives,
        *,
        data=None,
        announced_count=None,
        on_cycle=lambda controller: None,
        takes_offsets=False,
    ):
        """
        Send the primitives as the driver does, and wait for the end of the motion.

        :param data: bytes that replace the bytes of the primitives.
        :param announced_count: a number that replaces their number.
        :param on_cycle: called after each cycle.
        :param takes_offsets: whether the path gives way to offsets in registers.
        """
        self._socket(TRAJECTORY).feed(encode_points(primitives) if data is None else data)
        self._command(
            trajectory(
                TrajectoryAction.START,
                len(primitives) if announced_count is None else announced_count,
                read_timeout=0,
                takes_offsets=takes_offsets,
            )
        )
        results, motion = TrajectoryResultDecoder(), self.controller.motion
        joints, poses = [], []
        self.controller.messages.log.clear()
        begun = self.controller.time
        while True:
            self.controller.step()
            joints.append(motion.q)
            poses.append(motion.T_base_tcp)
            on_cycle(self.controller)
            said = self._socket(TRAJECTORY).take()
            ended = results.feed(said) if said else []
            if ended or motion.fault is not None or not self.controller.programs.running:
                break
            assert self.controller.time - begun < MAX_MOTION_TIME, f'{primitives} do not end'
        log = [
            line for line in self.controller.messages.log if not line.startswith(IGNORED_MESSAGE)
        ]
        failed = ended != [TrajectoryResult.SUCCESS] or log
        return ProgramRun(
            failure='; '.join(log) or str(ended) if failed else '',
            q=motion.q,
            result=ended[0] if ended else None,
            pose=motion.T_base_tcp,
            joints=np.array(joints),
            poses=poses,
            duration=self.controller.time - begun,
        )

    def feed(self, primitives):
        """Send more points."""
        self._socket(TRAJECTORY).feed(encode_points(primitives))

    def ask_to_idle(self):
        """Send the message that ends the mode in which trajectories run."""
        self.ask(keepalive(0))

    def ask(self, message):
        """Send a message on the reverse socket."""
        self._socket(REVERSE).feed(message.encode())

    def cancel(self):
        """Send CANCEL, without the number of sent points."""
        self._command(trajectory(TrajectoryAction.CANCEL, 0, read_timeout=0))

    def late_results(self, cycles):
        """Return the results that come within some cycles after the end of a trajectory."""
        for _ in range(cycles):
            self.controller.step()
        said = self._socket(TRAJECTORY).take()
        return TrajectoryResultDecoder().feed(said) if said else []

    def send_command(self, command):
        """Send a script command."""
        self._socket(COMMAND).feed(script_command.encode(command))

    def contact_answers(self):
        """Return the answers of the watch for contact since the last call."""
        said = self._socket(COMMAND).take()
        return script_command.ToolContactResultDecoder().feed(said) if said else []

    # -- between trajectories --------------------------------------------------------------------

    def _ready(self):
        """Bring the program to wait for a trajectory, whatever the last one left behind."""
        controller = self.controller
        if controller.safety.mode not in OPERATIONAL:
            controller.programs.stop()
            assert controller.safety_event(SafetyEvent.UNLOCK) == ''
        while controller.programs.state is RuntimeState.STOPPING:
            controller.step()
        if not controller.programs.running:
            assert controller.programs.play() == ''
            for accepted in self._accepted.values():
                accepted.clear()
            while not all(self._accepted.values()):
                controller.step()
            self._command(keepalive(0))

    def _command(self, message):
        self._socket(REVERSE).feed(message.encode())
        while self._socket(REVERSE).incoming:
            self.controller.step()

    def _socket(self, port):
        return self._accepted[port][-1]
