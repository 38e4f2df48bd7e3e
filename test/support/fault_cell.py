# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Run one cell of the fault matrix: bring a goal to a phase, inject the fault, recover."""

from fault_goals import BlendGoal, planned
from fault_table import BEFORE, Row
import robot_cell
from robot_cell import CYCLE, RobotCell
from virtual_network import HOST

from ur_cartesian_driver.driver.ipc.channel import CallRobot
from ur_cartesian_driver.motion.errors import ErrorCode
from ur_cartesian_driver.motion.state.rtde_state import RuntimeState
from ur_cartesian_driver.protocol.program.registers import SERVO_INPUTS
from ur_cartesian_driver.protocol.rtde.rtde_client import RtdeClientCodec
from ur_cartesian_driver.robot.lifecycle import ConnectionState
from ur_cartesian_driver.robot.rtde.rtde_connection import RtdeConnection
from ur_cartesian_driver.robot.services.service_calls import HandBackCall, RunScriptCall
from ur_cartesian_driver.sim.controller import Controller
from ur_cartesian_driver.sim.state.power_and_safety import OPERATIONAL, SafetyEvent

#: Time for which the arm is watched after an unlock or a play, and while a goal waits [s].
WATCH_TIME = 0.2
#: Time for which an arm inside all tolerances may still creep [s].
CREEP_TIME = 0.05
#: Name of a fault, and of the program that it starts.
FOREIGN_MOTION = 'foreign_motion'
#: Joint travel that is only the rounding of a motion's last cycles, or servoj's creeping [rad].
ROUNDING = 5e-6
#: Time that the next goal may take [s].
NEXT_GOAL_TIMEOUT = 2.0

#: States in which a program can be played.
PLAYABLE_STATES = (RuntimeState.PAUSED, RuntimeState.STOPPED)

PORTS = {
    'reverse': robot_cell.REVERSE,
    'trajectory': robot_cell.TRAJECTORY,
    'script command': robot_cell.COMMANDS,
}


async def inject_cause(cell: RobotCell, cause: str):
    """Inject a fault of the simulator, or of its network, clients or owner."""
    kind, _, what = cause.partition(' ')
    if cause == 'crash':
        await cell.crash_robot()
    elif cause == 'silent owner':
        cell.owner.silent = True
    elif cause == 'body in the way':
        cell.owner.cancel(collision='the rest of the path would touch')
    elif cause == 'freeze all':
        cell.other_clients += [end.peer for end in setpoint_connections(cell)]
        for port in set(cell.loop.servers) - {robot_cell.OWNER_PORT}:
            cell.loop.freeze(port)
    elif what == 'set-points':
        (end,) = setpoint_connections(cell)
        if kind == 'cut':
            end.peer.abort()
        else:
            end.frozen = end.peer.frozen = True
            cell.other_clients.append(end.peer)
    elif cause == 'take the inputs':
        cell.other_clients.append(await take_inputs())
    elif cause == 'hand back':
        cell.owner.send(CallRobot(number=1, call=HandBackCall()))
        await cell.sleep(2.0 * CYCLE)
    elif kind == 'motion_version':
        cell.robot.controller.programs.submit(f'sec f():\n  motion_version_set({what})\nend\n')
    elif kind == 'script':
        cell.owner.send(CallRobot(number=1, call=RunScriptCall(script=what)))
    elif kind == 'freeze':
        cell.loop.freeze(PORTS[what])
    elif kind == 'cut':
        cell.loop.cut(PORTS[what])
    else:
        cell.robot.inject(cause)


def setpoint_connections(cell: RobotCell):
    """Return the client ends of the connections that carry set-points."""
    return [
        end
        for end in cell.loop.open_ends(robot_cell.RTDE)
        if SERVO_INPUTS[0].encode() in end.peer.received
    ]


async def take_inputs():
    """Connect another client that writes the inputs which set-points need."""
    guest = RtdeConnection(
        RtdeClientCodec(outputs=('timestamp',), inputs=SERVO_INPUTS), lambda *_: None
    )
    await guest.open(HOST, robot_cell.RTDE)
    return guest


async def end_faults(cell: RobotCell):
    """End the lasting faults, and close dead connections that still block the robot."""
    cell.robot.clear_faults()
    while cell.other_clients:
        cell.other_clients.pop().close()
    cell.owner.silent = False
    await cell.sleep(2.0 * CYCLE)


def _restart_safety(controller: Controller):
    controller.safety_event(SafetyEvent.RESTART)
    controller.power_off()


#: Actions on the pendant, in place of dashboard commands that local control refuses.
PENDANT = {
    'unlock protective stop': lambda controller: controller.safety_event(SafetyEvent.UNLOCK),
    'restart safety': _restart_safety,
    'power on': Controller.power_on,
    'brake release': Controller.release_brakes,
    'play': lambda controller: controller.programs.play(),
}


async def command(cell: RobotCell, name: str):
    """Give a command by the dashboard or, in local control, at the pendant."""
    if cell.robot.controller.takes_scripts:
        await cell.dashboard(name)
    else:
        cell.robot.call(PENDANT[name])


async def perform(cell: RobotCell, step: str):
    """Do one recovery step, as another client or at the pendant, and wait for its effect."""
    controller = cell.robot.controller
    match step:
        case 'unlock':
            await cell.sleep(cell.robot.config.unlock_delay + CYCLE)
            await command(cell, 'unlock protective stop')
            await cell.until(lambda: controller.safety.mode in OPERATIONAL)
        case 'reset the safeguard':
            cell.robot.inject('reset_safeguard')
            await cell.until(lambda: controller.safety.mode in OPERATIONAL)
        case 'release the button':
            cell.robot.release_emergency_stop()
        case 'restart safety':
            await command(cell, 'restart safety')
        case 'power on':
            await command(cell, 'power on')
            await cell.until(lambda: controller.power.mode.name == 'IDLE')
        case 'release the brakes':
            await command(cell, 'brake release')
            await cell.until(lambda: controller.power.mode.name == 'RUNNING')
        case 'play':
            await cell.until(lambda: controller.programs.state in PLAYABLE_STATES)
            await command(cell, 'play')
        case 'resend':
            # The newest packet tells which program runs on the robot.
            await cell.sleep(cell.max_packet_gap)
            connected = cell.count_connected_programs()
            cell.resend()
            if cell.is_ready():
                # It may replace the connected program within a cycle.
                await cell.until(
                    lambda: not cell.is_ready() or cell.count_connected_programs() > connected
                )
        case 'move the slider up':
            cell.robot.set_speed_slider(1.0)
        case 'start the controller':
            await cell.reboot_robot()
            await cell.until(lambda: cell.status.state is ConnectionState.CONNECTED, 5.0)
        case 'wait for the robot':
            # With old states the driver stays CONNECTED until it gives up their connection.
            await cell.until(
                lambda: (
                    cell.status.state is ConnectionState.CONNECTED
                    and controller.time - cell.memory.read().timestamp < 2.0 * cell.max_packet_gap
                ),
                5.0,
            )
        case 'wait until the fault ends':
            await end_faults(cell)
            await cell.until(lambda: cell.loop.open_ends(robot_cell.PRIMARY))
        case _:
            raise AssertionError(f'unknown step: {step}')


async def recover(cell: RobotCell, steps):
    """Do all steps; return the largest joint travel meanwhile [rad]."""
    q, max_travel = cell.q, 0.0
    for step in steps:
        await perform(cell, step)
        watched_until = cell.loop.time() + (WATCH_TIME if step in ('unlock', 'play') else 0.0)
        while True:
            max_travel = max(max_travel, *(abs(a - b) for a, b in zip(cell.q, q, strict=True)))
            if cell.loop.time() >= watched_until:
                break
            await cell.sleep(CYCLE)
    return max_travel


def has_other_program_ended(cell: RobotCell, row: Row) -> bool:
    """Return whether the motion of another client, if it is the fault, has begun and ended."""
    programs = cell.robot.controller.programs
    return not row.cause[0].startswith(FOREIGN_MOTION) or (
        programs.name == FOREIGN_MOTION and not programs.running
    )


async def run_scenario(cell: RobotCell, row: Row, phase: str, kind=BlendGoal):
    """
    Run one cell of the matrix; the robot cell is ready before and afterwards.

    :param kind: class of the goal that the fault hits.
    """
    context = f'{row.fault}, {phase}'
    home = cell.robot.controller.motion.T_base_tcp.position
    goal = kind(cell)
    await goal.bring_to(phase)
    for cause in row.cause:
        await inject_cause(cell, cause)
    begin = cell.loop.time()
    if phase in BEFORE:
        await cell.sleep(0.1 if phase == 'idle' else cell.max_packet_gap)
        goal.send()
    if not cell.owner.silent:
        goal.send_remaining_points(phase)
    if row.waits:
        await check_waiting_goal(cell, goal, row, phase, context)
    elif phase == 'settling' and row.code is ErrorCode.SUCCESSFUL:
        await end_faults(cell)  # they kept it from settling
    await cell.until(
        lambda: goal.motion.outcome, row.result_within if not row.waits else 2.0, context
    )
    outcome = goal.motion.outcome
    assert outcome.code is row.code, f'{context}: {outcome}'
    assert outcome.text, context
    await cell.until(
        lambda: cell.at_rest() and goal.is_over() and has_other_program_ended(cell, row),
        max(CREEP_TIME, begin + row.rest_within - cell.loop.time()),
        context,
    )
    goal.record_end()
    # If the arm sets out after the last packet, nobody has seen its motion.
    is_unseen = phase == 'arming' and outcome.code is ErrorCode.CONNECTION_LOST
    if not (phase in BEFORE or is_unseen or row.cause[0].startswith(FOREIGN_MOTION)):
        goal.check_place(context)
    has_crashed = row.state_after is ConnectionState.DISCONNECTED and 'crash' in row.cause
    # A program may make outputs safe and end in the very moment in which its goal succeeds.
    ends_with_success = outcome.succeeded and row.state_after is ConnectionState.CONNECTED
    if not has_crashed and not ends_with_success:
        await goal.check_process(context)
    if not row.waits:
        await cell.until(lambda: cell.status.state is row.state_after, row.state_within, context)
        assert cell.is_ready() or cell.status.message, context
        if phase == 'settling':
            await end_faults(cell)
        travel = await recover(cell, row.steps)
        assert travel <= row.travel + ROUNDING, f'{context}: a joint has moved by {travel} rad'
        if not ends_with_success:
            await goal.check_process(context)
    await cell.until(cell.is_ready, row.ready_within, context)
    await return_home(cell, home, context)
    goal.check_result(row, phase)
    return goal.motion.ended_at - begin


async def check_waiting_goal(cell, goal, row, phase, context):
    """Check that a goal waits for an operator, then do the steps after which it goes on."""
    await cell.until(cell.at_rest, row.rest_within, context)
    await cell.sleep(WATCH_TIME)
    assert goal.motion.outcome is None, context
    # servoj may swing around its last set-point once more while the slider goes down.
    await cell.until(cell.at_rest, CREEP_TIME, context)
    if cell.robot.controller.programs.state is RuntimeState.PAUSED:
        assert not goal.is_process_on(), context
        goal.may_end_in_pause = phase == 'settling'
    cell.robot.clear_faults()
    for step in row.steps:
        await perform(cell, step)


async def return_home(cell, home, context):
    """Run the next goal, back to the former place of the arm."""
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
    await cell.until(lambda: following.outcome, NEXT_GOAL_TIMEOUT, context)
    assert following.outcome.code is ErrorCode.SUCCESSFUL, f'after {context}: {following.outcome}'
