# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""One cell of the fault matrix: a goal is brought to its phase, it goes wrong, people act."""

from fault_goals import BlendGoal, planned
from fault_table import BEFORE, Row
import robot_cell
from robot_cell import CYCLE, RobotCell
from virtual_network import HOST

from ur_cartesian_driver.motion.errors import ErrorCode
from ur_cartesian_driver.motion.state import RuntimeState
from ur_cartesian_driver.protocol.program.registers import SERVO_INPUTS
from ur_cartesian_driver.protocol.rtde.rtde_client import RtdeClientCodec
from ur_cartesian_driver.robot.lifecycle import ConnectionState
from ur_cartesian_driver.robot.rtde.rtde_connection import RtdeConnection
from ur_cartesian_driver.sim.state.power_and_safety import OPERATIONAL

#: How long the arm is watched after somebody has unlocked or played, and a goal that waits [s].
WATCHED = 0.2
#: How long an arm that is inside all tolerances may still creep [s].
STANDING = 0.05
#: How long the next goal may take [s].
NEXT_BOUND = 2.0

#: Of a program that can be played.
STANDSTILL = (RuntimeState.PAUSED, RuntimeState.STOPPED)

PORTS = {
    'reverse': robot_cell.REVERSE,
    'trajectory': robot_cell.TRAJECTORY,
    'script command': robot_cell.COMMANDS,
}


async def let_happen(cell: RobotCell, cause: str):
    """Let a fault happen: one of the simulator's, or one of what is around it."""
    kind, _, what = cause.partition(' ')
    if cause == 'crash':
        await cell.crash_robot()
    elif cause == 'silent owner':
        cell.owner.silent = True
    elif cause == 'freeze all':
        cell.guests += [end.peer for end in setpoint_connections(cell)]
        for port in set(cell.loop.servers) - {robot_cell.OWNER_PORT}:
            cell.loop.freeze(port)
    elif what == 'set-points':
        (end,) = setpoint_connections(cell)
        if kind == 'cut':
            end.peer.abort()
        else:
            end.frozen = end.peer.frozen = True
            cell.guests.append(end.peer)
    elif cause == 'take the inputs':
        cell.guests.append(await take_inputs())
    elif kind == 'freeze':
        cell.loop.freeze(PORTS[what])
    elif kind == 'cut':
        cell.loop.cut(PORTS[what])
    else:
        cell.robot.inject(cause)


def setpoint_connections(cell: RobotCell):
    """Return the connections on which set-points are written, the ends that dialled."""
    return [
        end
        for end in cell.loop.open_ends(robot_cell.RTDE)
        if SERVO_INPUTS[0].encode() in end.peer.received
    ]


async def take_inputs():
    """Be another client that wants to write the inputs which set-points need."""
    guest = RtdeConnection(
        RtdeClientCodec(outputs=('timestamp',), inputs=SERVO_INPUTS), lambda *_: None
    )
    await guest.open(HOST, robot_cell.RTDE)
    return guest


async def let_pass(cell: RobotCell):
    """End the faults that last; also the robot finds out about dead connections that bind it."""
    cell.robot.clear_faults()
    while cell.guests:
        cell.guests.pop().close()
    cell.owner.silent = False
    await cell.sleep(2.0 * CYCLE)


async def do(cell: RobotCell, step: str):
    """Do what somebody has to do, as another client or at the pendant, until it has happened."""
    controller = cell.robot.controller
    match step:
        case 'unlock':
            await cell.sleep(cell.robot.config.unlock_delay + CYCLE)
            await cell.dashboard('unlock protective stop')
            await cell.until(lambda: controller.safety.mode in OPERATIONAL)
        case 'reset the safeguard':
            cell.robot.inject('reset_safeguard')
            await cell.until(lambda: controller.safety.mode in OPERATIONAL)
        case 'release the button':
            cell.robot.release_emergency_stop()
        case 'restart safety':
            await cell.dashboard('restart safety')
        case 'power on':
            await cell.dashboard('power on')
            await cell.until(lambda: controller.power.mode.name == 'IDLE')
        case 'release the brakes':
            await cell.dashboard('brake release')
            await cell.until(lambda: controller.power.mode.name == 'RUNNING')
        case 'play':
            await cell.until(lambda: controller.programs.state in STANDSTILL)
            await cell.dashboard('play')
        case 'resend':
            cell.resend()
            if cell.is_ready():
                await cell.until(lambda: not cell.is_ready())
        case 'move the slider up':
            cell.robot.set_speed_slider(1.0)
        case 'start the controller':
            await cell.reboot_robot()
            await cell.until(lambda: cell.status.state is ConnectionState.CONNECTED, 5.0)
        case 'wait for the robot':
            await cell.until(lambda: cell.status.state is ConnectionState.CONNECTED, 5.0)
        case 'wait until it is over':
            await let_pass(cell)
            await cell.until(lambda: cell.loop.open_ends(robot_cell.PRIMARY))
        case _:
            raise AssertionError(f'nobody knows how to {step}')


async def recover(cell: RobotCell, steps):
    """Do all steps; return how far a joint was from its place at the beginning [rad]."""
    q, farthest = cell.q, 0.0
    for step in steps:
        await do(cell, step)
        watched_until = cell.loop.time() + (WATCHED if step in ('unlock', 'play') else 0.0)
        while True:
            farthest = max(farthest, *(abs(a - b) for a, b in zip(cell.q, q, strict=True)))
            if cell.loop.time() >= watched_until:
                break
            await cell.sleep(CYCLE)
    return farthest


async def scenario(cell: RobotCell, row: Row, phase: str, kind=BlendGoal):
    """
    Run one cell of the matrix; the robot cell is ready before and afterwards.

    :param kind: the goal that gets into trouble.
    """
    here = f'{row.fault}, {phase}'
    home = cell.robot.controller.motion.T_base_tcp.position
    goal = kind(cell)
    await goal.reach(phase)
    for cause in row.cause:
        await let_happen(cell, cause)
    begin = cell.loop.time()
    if phase in BEFORE:
        await cell.sleep(0.1 if phase == 'idle' else CYCLE)
        goal.send()
    if not cell.owner.silent:
        goal.follow_up(phase)
    if row.waits:
        await wait_on(cell, goal, row, here)
    elif phase == 'settling' and row.code is ErrorCode.SUCCESSFUL:
        await let_pass(cell)  # what kept it from settling
    await cell.until(lambda: goal.motion.outcome, row.bound if not row.waits else 2.0, here)
    outcome = goal.motion.outcome
    assert outcome.code is row.code, f'{here}: {outcome}'
    assert outcome.text, here
    await cell.until(
        lambda: cell.at_rest() and goal.is_over(),
        max(STANDING, begin + row.rest - cell.loop.time()),
        here,
    )
    goal.note_end()
    if not row.waits:
        await cell.until(lambda: cell.status.state is row.then, row.then_within, here)
        assert cell.is_ready() or cell.status.message, here
        if phase == 'settling':
            await let_pass(cell)
        travel = await recover(cell, row.steps)
        assert travel <= row.travel, f'{here}: a joint has moved by {travel} rad'
    await cell.until(cell.is_ready, row.back, here)
    await go_home(cell, home, here)
    goal.judge(row, phase)
    return goal.motion.ended_at - begin


async def wait_on(cell, goal, row, here):
    """See that a goal waits for somebody, and goes on when they have done their part."""
    await cell.until(cell.at_rest, row.rest, here)
    await cell.sleep(WATCHED)
    assert goal.motion.outcome is None, here
    assert cell.at_rest(), here
    cell.robot.clear_faults()
    for step in row.steps:
        await do(cell, step)


async def go_home(cell, home, here):
    """Run the next goal, back to where the arm was."""
    x, y, z = (
        a - b for a, b in zip(home, cell.memory.read().actual_tcp_pose.position, strict=True)
    )
    following = cell.owner.start(
        planned(
            cell.memory.read(),
            ((x, y, z) if max(map(abs, (x, y, z))) > 1e-3 else (0.0, 0.01, 0.0),),
            0.8,
            8.0,
        )
    )
    await cell.until(lambda: following.outcome, NEXT_BOUND, here)
    assert following.outcome.code is ErrorCode.SUCCESSFUL, f'after {here}: {following.outcome}'
