# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
A cell in virtual time: simulated controller, robot loop, and its owner, in one event loop.

The driver's robot loop with all its sockets runs against the controller of ``ur-cartesian sim``;
only time and network come from :mod:`virtual_network`. Cycles take 8 ms, as on a CB3 robot,
because each costs computing time, unless a test chooses its robot.

With the environment variable ``THREADS='delay N'``, new threads of the robot program begin N
cycles later; with ``THREADS='seed N'``, its threads take turns at random. With ``IMPERFECT=N`` the
arm is imperfect, with noise from the seed N.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Coroutine
import contextlib
from dataclasses import replace
import os
from typing import Any, TypeVar

from virtual_network import HOST, LoopClock, ProgramNetwork, VirtualLoop
from wire_decoding import decode_reverse

from ur_cartesian_driver.driver.ipc import state_memory
from ur_cartesian_driver.driver.ipc.channel import (
    AppendAnswered,
    AppendToMotion,
    CallAnswered,
    CallRobot,
    CancelMotion,
    Configure,
    LENGTH,
    LogMessage,
    MotionEnded,
    MotionProgress,
    OwnerHeartbeat,
    pack,
    PulsesGiven,
    ResendProgram,
    StartMotion,
    StatusChanged,
    unpack,
)
from ur_cartesian_driver.driver.ipc.driver_config import DriverConfig
from ur_cartesian_driver.driver.loop.robot_loop import RobotLoop
from ur_cartesian_driver.execution.goal.motion_job import job_from_plan
from ur_cartesian_driver.kinematics.robot_models import robot_model
from ur_cartesian_driver.protocol.program.reverse import MESSAGE_SIZE
from ur_cartesian_driver.protocol.program.script_sender import REQUEST
from ur_cartesian_driver.protocol.program.trajectory_points import encode_points
from ur_cartesian_driver.robot.connection_status import ConnectionStatus
from ur_cartesian_driver.robot.lifecycle import ConnectionState
from ur_cartesian_driver.sim import SimulatedRobot, SimulatorConfig
from ur_cartesian_driver.sim.motion.imperfect_arm import typical_imperfections

T = TypeVar('T')

CYCLE = 0.008
UR5E = robot_model('ur5e')
#: Longest silence of the owner [s]; the driver allows 5 s.
NODE_TIMEOUT = 0.4
OWNER_PORT = 1
#: An arm is at rest below this speed [rad/s]; the bound of the robot program.
REST_SPEED = 1e-4
REVERSE, SENDER, TRAJECTORY, COMMANDS = 50001, 50002, 50003, 50004
RTDE, PRIMARY, DASHBOARD = 30004, 30001, 29999
#: Longest program that the External Control node takes here [B].
MAX_PROGRAM = 1 << 20
#: The ports of the cable between robot and driver.
CABLE = (REVERSE, SENDER, TRAJECTORY, COMMANDS, RTDE, PRIMARY, DASHBOARD)
#: Program on the pendant that contains the External Control node.
PENDANT_PROGRAM = 'external_control.urp'


class CellMotion:
    """A started goal, as seen by its owner."""

    def __init__(self):
        self.outcome: Any = None
        self.ended_at = None
        self.progress = []


class Owner:
    """The other end of the robot loop's pipe, in the role of the node."""

    def __init__(self):
        self.status = ConnectionStatus()
        self.statuses = []
        self.motions = {}
        #: Answers to appended points.
        self.answers = []
        #: Answers to service calls, by their numbers.
        self.call_answers = {}
        #: The pulses of all goals.
        self.pulses = []
        self._calls = 0
        self.log = []
        self.silent = False
        self._writer = None

    async def serve(self, reader, writer):
        self._writer = writer
        heartbeat = asyncio.ensure_future(self._send_heartbeats())
        try:
            while True:
                (size,) = LENGTH.unpack(await reader.readexactly(LENGTH.size))
                self._handle(unpack(await reader.readexactly(size)))
        except asyncio.IncompleteReadError:
            pass  # the loop has ended
        finally:
            heartbeat.cancel()

    async def _send_heartbeats(self):
        while True:
            if not self.silent:
                self.send(OwnerHeartbeat())
            await asyncio.sleep(NODE_TIMEOUT / 3.0)

    def send(self, request):
        self._writer.write(pack(request))

    def start(self, plan, **more):
        return self.run(encode_points(plan.instructions), job_from_plan(plan), **more)

    def run(self, points, job, **more):
        number = len(self.motions) + 1
        motion = self.motions[number] = CellMotion()
        self.send(StartMotion(motion=number, job=job, points=points, **more))
        return motion

    def append(self, points, append_job):
        self.send(AppendToMotion(motion=len(self.motions), points=points, append_job=append_job))

    def call(self, call):
        """Make a service call; return the number of its answer."""
        self._calls += 1
        self.send(CallRobot(number=self._calls, call=call))
        return self._calls

    def cancel(self, *, collision=''):
        self.send(CancelMotion(motion=len(self.motions), collision=collision))

    def hang_up(self):
        self._writer.close()

    def _handle(self, notification):
        match notification:
            case StatusChanged(status=status):
                self.status = status
                self.statuses.append(status)
            case MotionProgress(motion=number, progress=progress):
                self.motions[number].progress.append(progress)
            case AppendAnswered(answer=answer):
                self.answers.append(answer)
            case PulsesGiven(pulses=pulses):
                self.pulses += pulses
            case CallAnswered(number=number, answer=answer):
                self.call_answers[number] = answer
            case MotionEnded(motion=number, outcome=outcome):
                motion = self.motions[number]
                assert motion.outcome is None, 'a goal ends once'
                motion.outcome, motion.ended_at = outcome, asyncio.get_running_loop().time()
            case LogMessage(text=text):
                self.log.append(text)


class RobotCell:
    """Simulated controller, robot loop and owner; used inside :func:`run_cell`."""

    def __init__(self, loop, *, headless, settings, threads='', imperfect='', robot=None):
        self.loop, self.headless = loop, headless
        self._settings = settings
        self._simulator = {'frequency': 1.0 / CYCLE} | thread_schedule(threads) | (robot or {})
        #: Longest time between two RTDE packets of a robot without faults [s].
        self.max_packet_gap = CYCLE
        if imperfect:
            model = robot_model(self._simulator.get('model', UR5E.name))
            imperfections = typical_imperfections(model, int(imperfect))
            self._simulator['imperfections'] = imperfections
            self.max_packet_gap *= 1 + imperfections.max_skipped
        self.owner = Owner()
        self.robot = self.robot_task = self.loop_task = self.memory = self._pipe = None
        self.config = None
        #: Connections of other clients.
        self.other_clients = []

    # ---- life ---------------------------------------------------------------------------------

    async def start(self):
        """Start the robot, then the robot loop; return when a goal can run."""
        await self.start_robot(
            SimulatorConfig(
                remote_control=self.headless,
                unlock_delay=0.05,
                power_on_time=0.05,
                brake_release_time=0.05,
                secondary_port=30002,
                realtime_port=30003,
                interpreter_port=30020,
                **self._simulator,
            )
        )
        self.config = DriverConfig(
            **{
                'headless_mode': self.headless,
                'ur_type': self.robot.config.model,
                'node_timeout': NODE_TIMEOUT,
                'io_publish_rate': 5.0,
            }
            | self._settings
        )
        await self.start_driver()
        if not self.headless:
            await self.until(lambda: self.status.state is ConnectionState.CONNECTED)
            await self.load_pendant_program()
            self.robot.play_program()
        await self.until(self.is_ready, 3.0)
        await self.until(self.control_messages)
        await self.sleep(2.0 * CYCLE)  # the program has read its message, and waits for the next

    async def start_driver(self, number=1):
        """
        Start the robot loop, with a new owner.

        :param number: the number by which the driver recognises its program. It is not drawn, so
            that the robots of all cells get the same program, which is parsed once.
        """
        self.owner = Owner()
        server = await asyncio.start_server(self.owner.serve, HOST, OWNER_PORT)
        reader, self._pipe = await asyncio.open_connection(HOST, OWNER_PORT)
        server.close()
        descriptor = state_memory.create()
        self.memory = state_memory.StateMemory(descriptor)
        os.close(descriptor)
        robot_loop = RobotLoop(Configure(config=self.config), self.memory, self._pipe)
        robot_loop._link.program.program_number = number
        self.loop_task = asyncio.create_task(robot_loop.run(reader))

    async def end_driver(self):
        """End the robot loop, as its owner does."""
        self.owner.hang_up()
        await asyncio.wait({self.loop_task}, timeout=5.0)
        self.loop_task.cancel()
        await asyncio.gather(self.loop_task, return_exceptions=True)
        self._pipe.close()
        self.memory.close()

    async def start_robot(self, config):
        """Start the controller, or a new one in place of a crashed one."""
        self.robot = SimulatedRobot(
            config, sockets=ProgramNetwork(self.loop), clock=LoopClock(self.loop, config.cycle)
        )
        self.robot_task = asyncio.create_task(self.robot.run())
        await asyncio.sleep(0)

    async def crash_robot(self):
        """Crash the controller with all its sockets; the arm stays where it is."""
        self.robot.controller.power_off()  # without a controller, brakes hold the arm
        self.robot_task.cancel()
        with contextlib.suppress(asyncio.CancelledError):
            await self.robot_task

    async def reboot_robot(self):
        """Start the controller again: no power, no program, the arm at its former place."""
        await self.start_robot(
            replace(self.robot.config, q=self.robot.controller.motion.q, power='off')
        )

    async def fetch_program(self):
        """Fetch the driver's program as the External Control node does; return it as played."""
        reader, writer = await asyncio.open_connection(HOST, SENDER, limit=MAX_PROGRAM)
        writer.write(REQUEST)
        text = await reader.readuntil(b'# NODE_CONTROL_LOOP_ENDS\n')
        writer.close()
        return f'def external_control():\n{text.decode()}\nend\n'

    async def load_pendant_program(self):
        """Load a program whose External Control node fetches the driver's program."""
        assert not self.robot.controller.load_program(PENDANT_PROGRAM)

    async def close(self):
        await self.end_driver()
        await self.crash_robot()

    # ---- observations -------------------------------------------------------------------------

    @property
    def status(self):
        return self.owner.status

    @property
    def q(self):
        return self.robot.controller.target.q

    def is_ready(self):
        return self.status.state is ConnectionState.READY

    def at_rest(self):
        """Return whether the arm is slow enough: servoj creeps to its last set-point for ever."""
        return max(map(abs, self.robot.controller.motion.qd)) < REST_SPEED

    async def until(self, condition, bound=2.0, purpose=''):
        """
        Wait for a condition, checked twice in each cycle; return the time it took [s].

        :raises AssertionError: the condition does not hold within the bound [s].
        """
        begin = self.loop.time()
        while not condition():
            assert self.loop.time() - begin < bound, (
                f'{purpose}: waited {bound} s in vain; {self.status}; {self.owner.log}; '
                f'{list(self.robot.controller.messages.log)}'
            )
            await asyncio.sleep(0.5 * CYCLE)
        return self.loop.time() - begin

    def collect(self, states):
        """Append RTDE's last report to a list, unless it is there already; return the report."""
        state = self.memory.read()
        if not states or state.timestamp > states[-1].timestamp:
            states.append(state)
        return state

    async def record(self, motion, states, bound=60.0):
        """Collect all states until a goal ends; return its outcome."""
        await self.until(lambda: self.collect(states) and motion.outcome, bound)
        return motion.outcome

    def control_messages(self, first=0):
        """Return the messages that the driver sent on the reverse socket, from an index on."""
        (end,) = self.loop.open_ends(REVERSE)
        data = end.received
        return [
            decode_reverse(bytes(data[i : i + MESSAGE_SIZE]))
            for i in range(first * MESSAGE_SIZE, len(data), MESSAGE_SIZE)
        ]

    async def sleep(self, seconds):
        """Wait for a time on the loop's clock [s]."""
        await asyncio.sleep(seconds)

    # ---- people and other clients -------------------------------------------------------------

    async def dashboard(self, *commands):
        """Send commands as another client of the dashboard; return the answers."""
        reader, writer = await asyncio.open_connection(HOST, DASHBOARD)
        await reader.readline()
        answers = []
        for command in commands:
            writer.write(command.encode() + b'\n')
            answers.append((await reader.readline()).decode().strip())
        writer.close()
        return answers

    def count_connected_programs(self):
        """Return the number of robot programs that have reported their connection."""
        return self.robot.controller.messages.log.count('ur_cartesian_driver: connected')

    def resend(self):
        self.owner.send(ResendProgram())


def thread_schedule(text: str) -> dict[str, Any]:
    """Return settings of the simulator for 'delay N', 'seed N' or nothing."""
    match text.split():
        case []:
            return {}
        case ['delay', count]:
            return {'thread_delay': int(count)}
        case ['seed', number]:
            return {'interleaving_seed': int(number)}
    raise ValueError(f"THREADS is {text!r}; use 'delay N' or 'seed N'.")


def run_cell(
    scenario: Callable[[RobotCell], Coroutine[Any, Any, T]],
    *,
    headless: bool = True,
    threads: str = os.environ.get('THREADS', ''),
    imperfect: str | None = None,
    robot: dict[str, Any] | None = None,
    cell: type[RobotCell] = RobotCell,
    **settings: Any,
) -> T:
    """
    Run ``scenario(cell)`` in a cell that is ready for goals; return its result.

    :param threads: how the controller schedules threads, see :func:`thread_schedule`.
    :param imperfect: seed of the imperfections of the arm, empty = it has none; by default from
        the environment.
    :param robot: fields of the simulator's configuration: model, frequency, geometry, ...
    :param cell: the class of the cell.
    """
    if imperfect is None:
        imperfect = os.environ.get('IMPERFECT', '')
    loop = VirtualLoop()
    with asyncio.Runner(loop_factory=lambda: loop) as runner:
        return runner.run(
            _run(
                cell,
                loop,
                scenario,
                headless,
                settings,
                threads=threads,
                imperfect=imperfect,
                robot=robot,
            )
        )


async def _run(kind, loop, scenario, headless, settings, **simulator):
    cell = kind(loop, headless=headless, settings=settings, **simulator)
    try:
        await cell.start()
        return await scenario(cell)
    finally:
        await cell.close()
