# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The simulated controller: programs, motion, power, safety and I/O, one cycle per step.

:func:`~.controller_assembly.assemble` makes a controller. Its user calls :meth:`Controller.step`
once per cycle, and any other method between two steps. A controller never waits and uses neither
real time nor the network, so it also runs on a virtual clock.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Hashable
from functools import partial
from math import inf
from pathlib import PurePosixPath
from typing import Protocol

from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.motion.geometry.pose import Pose
from ur_cartesian_driver.motion.geometry.vectors import add, dot, Vector3, Vector6
from ur_cartesian_driver.motion.state.rtde_state import (
    RobotMode,
    RobotStatus,
    RuntimeState,
    SafetyMode,
    SafetyStatus,
)
from ur_cartesian_driver.protocol.rtde.rtde_fields import fields_of, INPUT_TYPES
from ur_cartesian_driver.sim.motion import MotionGenerator
from ur_cartesian_driver.sim.motion.actual_motion import ActualMotion
from ur_cartesian_driver.sim.motion.contact.contact_motion import ArmState, ContactMotion
from ur_cartesian_driver.sim.motion.kinematics.point_motion import point_motion
from ur_cartesian_driver.sim.motion.motion_ownership import FreedriveState, MotionOwnership
from ur_cartesian_driver.sim.pendant_programs.external_control import (
    ExternalControl,
    UrCap,
    UrCapX,
)
from ur_cartesian_driver.sim.pendant_programs.program_tree import (
    FetchedScript,
    ProgramTree,
    SavedProgram,
    UnloadableProgram,
    UnreadableProgram,
)
from ur_cartesian_driver.sim.programs.interpreter_mode import InterpreterMode
from ur_cartesian_driver.sim.programs.program_runner import HELD, ProgramRunner
from ur_cartesian_driver.sim.programs.rtde_watchdog import Watchdogs
from ur_cartesian_driver.sim.programs.stored_programs import StoredPrograms, URPX_SUFFIX
from ur_cartesian_driver.sim.programs.timed_function_guard import Builtins
from ur_cartesian_driver.sim.simulator_config import SimulatorConfig
from ur_cartesian_driver.sim.sockets.script_sockets import MemorySockets, ScriptSockets
from ur_cartesian_driver.sim.state.controller_io import ControllerIo
from ur_cartesian_driver.sim.state.controller_messages import ControllerMessages
from ur_cartesian_driver.sim.state.controller_state import (
    Payload,
    Pendant,
    Popup,
    ProcessState,
    StoredSettings,
)
from ur_cartesian_driver.sim.state.power_and_safety import (
    ArmPower,
    OPERATIONAL,
    POWERLESS,
    SafetyEvent,
    SafetySystem,
    STATUS_BITS,
)
from ur_cartesian_driver.urscript.script_errors import RuntimeException

#: The controller's clock at the start [s]; not 0, because RTDE clients believe that a controller
#: that has been up for less than 40 s is still booting.
START_TIME = 60.0
#: Number of past cycles whose joint positions programs can read.
MAX_HISTORY = 100
#: While this many windows are open on the pendant, only blocking ones are added.
_MAX_POPUPS = 100
#: The first major version of PolyScope X.
POLYSCOPE_X = 10
#: Error code of a protective stop (C209).
_PROTECTIVE_STOP_CODE = 209
#: Time [s] from a client's `set unlock protective stop` until the stop is unlocked. Assumed: it is
#: only known that a real robot does not unlock immediately.
UNLOCK_TIME = 0.02


class CycleFaults(Protocol):
    """The fault injector, as the controller's cycle uses it."""

    #: Whether `step` has to be called in each cycle.
    active: bool

    def step(self) -> None:
        """Apply all faults that are due in this cycle."""


class Controller:
    """A robot without its network; `sim.controller_assembly` puts it together."""

    def __init__(
        self,
        config: SimulatorConfig,
        make_builtins: Callable[[Controller], Builtins],
        sockets: ScriptSockets | None = None,
    ) -> None:
        """
        Begin as configured, with the arm at rest.

        :param make_builtins: returns the functions that programs can call.
        :param sockets: the sockets of programs; None = in memory, for tests.
        :raises UnloadableProgram: the program that the configuration names cannot be loaded.
        """
        self.config = config
        #: Duration of a cycle [s].
        self.cycle = config.cycle
        #: Number of cycles so far.
        self.cycles = 0
        #: Time that the simulator's clock has skipped because this computer was too busy [s].
        self.skipped_time = 0.0
        self.arm = Arm(config.robot_model, config.geometry)
        self.motion = MotionGenerator(self.arm, self.cycle, config.q, config.laws)
        self.motion.motion_version = config.motion_version
        self.motion.second_version = config.second_version_laws
        #: The bodies that the tool can touch, and the compliance of the arm.
        self.contact = ContactMotion(self.motion, config.contact_bodies)
        #: The measured motion, which equals the targets unless something disturbs the arm.
        self.actual = ActualMotion(self.motion, config.arm_imperfections, self.contact)
        self.sockets = MemorySockets() if sockets is None else sockets
        self.io = ControllerIo()
        for channel in config.inputs:
            self.io.digital_in.switch_on(channel)
        self.safety = SafetySystem(config.unlock_delay)
        self.power = ArmPower(
            RobotMode.RUNNING if config.power == 'running' else RobotMode.POWER_OFF,
            config.power_on_time,
            config.brake_release_time,
        )
        self.messages = ControllerMessages(lambda: self.timestamp)
        self.ownership = MotionOwnership(self.motion)
        self.watchdogs = Watchdogs()
        self.popups: list[Popup] = []
        self.payload = Payload()
        #: Acceleration opposite to gravity, in base axes [m/s^2].
        self.gravity: Vector3 = (0.0, 0.0, 9.82)
        self.freedrive = FreedriveState.OFF
        self.process = ProcessState()
        #: Target pose of the last move; None after a stream of set-points.
        self.waypoint: Pose | None = None
        #: Whether a program supplies the wrench, in place of the robot's own sensor.
        self.external_ft = False
        #: Time at which the protective stop is unlocked [s]; inf = no unlock is due.
        self._unlock_at = inf
        self.pendant = Pendant(answers=deque(map(str, config.answers)))
        self.stored = StoredSettings()
        self.remote_control = config.remote_control and config.has_remote_control
        #: The speed slider, 0..1.
        self.speed_slider = 1.0
        #: The fraction of the programmed speed at which motions run now, 0..1; the slider, pauses
        #: and stops change it.
        self.scale = 1.0
        #: Whether the arm slows down on its path because the program ended during the motion.
        self._stopping_on_path = False
        #: Whether the power will be cut as soon as the arm stands still.
        self._cuts_power = False
        self._joint_history: deque[Vector6] = deque([config.q] * MAX_HISTORY, maxlen=MAX_HISTORY)
        self.programs: ProgramRunner = ProgramRunner(
            make_builtins(self),
            self.messages,
            self,
            thread_delay=config.thread_delay,
            interleaving_seed=config.interleaving_seed,
        )
        self.stored_programs = StoredPrograms(config.saved_programs)
        self.interpreter_mode = InterpreterMode(self.programs, self.ownership)
        self.programs.on_end = self.sockets.close_all
        urcap = (UrCap if config.version[0] < POLYSCOPE_X else UrCapX)(
            config.external_control_host, config.external_control_port
        )
        self.external_control = ExternalControl(urcap, self.messages.note)
        if config.program and (refusal := self.load_program(config.program)):
            raise UnloadableProgram(
                f'program is {config.program}, which cannot be loaded: {refusal}'
            )
        self.messages.on_error = self._pause_if_wanted
        #: The faults, set by the assembly; None = no faults.
        self.faults: CycleFaults | None = None

    # ---- state --------------------------------------------------------------------------------

    @property
    def time(self) -> float:
        """The controller's clock [s], which counts cycles and does not include skipped time."""
        return START_TIME + self.cycles * self.cycle

    @property
    def timestamp(self) -> float:
        """
        The controller's clock as clients read it [s].

        It includes the skipped time: otherwise clients that compare timestamps with their own
        clock would consider the states too old.
        """
        return self.time + self.skipped_time

    @property
    def at_rest(self) -> bool:
        """Whether the arm stands still, because no motion runs or because the scale is 0."""
        return self.scale == 0.0 or not self.motion.moving

    @property
    def on_path(self) -> bool:
        """Whether a path move is running or slowing down, rather than a stream of set-points."""
        return self.motion.on_path

    @property
    def speed_scaling(self) -> float:
        """The speed scaling 0..1, not including the speed slider; 0 at rest and in pauses."""
        if self.at_rest or not self.speed_slider:
            return 0.0
        return min(1.0, self.motion.scaling / self.speed_slider)

    @property
    def robot_status(self) -> RobotStatus:
        """The status bits for power and program."""
        powered = self.power.mode >= RobotMode.POWER_ON
        bits = RobotStatus.POWER_ON if powered else RobotStatus(0)
        return bits | RobotStatus.PROGRAM_RUNNING if self.programs.running else bits

    @property
    def safety_status(self) -> SafetyStatus:
        """The status bits of the safety system."""
        return STATUS_BITS[self.safety.mode]

    @property
    def _is_moving_freely(self) -> bool:
        """Whether the arm has power and a program runs, and no pause or stop holds the arm."""
        return (
            self.safety.mode in OPERATIONAL
            and self.power.mode is RobotMode.RUNNING
            and self.programs.state is RuntimeState.PLAYING
        )

    @property
    def target(self) -> MotionGenerator | ArmState:
        """The commanded motion of the arm: the program's target, displaced by force mode."""
        return self.contact.target or self.motion

    @property
    def tcp_wrench(self) -> Vector6:
        """The wrench on the TCP as the robot reports it, in base axes [N, Nm]."""
        return self.io.external_force if self.external_ft else self.contact.measured

    @property
    def tool_accelerometer(self) -> Vector3:
        """The reading of the flange's accelerometer [m/s^2], including gravity, in flange axes."""
        motion = self.motion
        frames = self.arm.frames(motion.q)
        acceleration = point_motion(frames, motion.qd, motion.qdd, frames.position).acceleration
        error = self.actual.acceleration_error[:3]
        specific_force = add(add(acceleration, error), self.gravity)
        return (
            dot(specific_force, frames.x),
            dot(specific_force, frames.y),
            dot(specific_force, frames.z),
        )

    @property
    def takes_scripts(self) -> bool:
        """Whether clients can send programs; always true if the remote control feature is off."""
        return self.remote_control or not self.config.has_remote_control

    def joint_history(self, steps: int) -> Vector6:
        """
        Return the actual joint positions of an earlier cycle [rad].

        :param steps: number of cycles before the last one.
        :raises RuntimeException: ``steps`` is not from 0 to ``MAX_HISTORY`` - 1.
        """
        if not 0 <= steps < MAX_HISTORY:
            raise RuntimeException(f'steps is {steps}; the history holds 0..{MAX_HISTORY - 1}')
        return self._joint_history[-1 - steps]

    # ---- one cycle ----------------------------------------------------------------------------

    def step(self) -> None:
        """Compute one cycle."""
        self.cycles += 1
        if self.faults is not None and self.faults.active:
            self.faults.step()
        now = self.time
        self.power.step(now)
        if now >= self._unlock_at:
            self._unlock_at = inf
            self.safety_event(SafetyEvent.UNLOCK_BY_LINE)
        self.sockets.poll()
        self._watch_inputs(now)
        if self._stopping_on_path and self.at_rest:
            self._stopping_on_path = False
            self.motion.stop_at_once()
        was_at_rest = not self.motion.moving
        self.programs.step()
        self._change_scale(was_at_rest)
        self.motion.step(self.scale)
        self.contact.step(may_move=self._is_moving_freely)
        self.actual.step()
        self._joint_history.append(self.actual.q)
        self._report_motion_events()
        # The power is cut even if the emergency stop is released while the arm still moves.
        self._cuts_power |= self.safety.mode in POWERLESS
        if self._cuts_power and self.at_rest:
            self._cuts_power = False
            self.power.off()

    def _change_scale(self, was_at_rest: bool) -> None:
        """
        Ramp the scale towards its target, in the time that a real arm takes.

        :param was_at_rest: whether the arm stood still before this cycle; then no ramp is needed.
        """
        held = self.programs.state in HELD or self._stopping_on_path
        target = 0.0 if held else self.speed_slider
        if was_at_rest or self.scale == target:
            self.scale = target
            return
        laws = self.motion.laws
        if self.safety.mode not in OPERATIONAL:
            time = laws.protective_stop_time
        else:
            time = laws.stop_time if self._stopping_on_path else laws.pause_time
        step = self.cycle / time
        self.scale = min(max(target, self.scale - step), self.scale + step)

    def _report_motion_events(self) -> None:
        """Send the warnings of the motion; cause a protective stop if the motion has a fault."""
        for warning in self.motion.warnings:
            self.messages.error(warning.code, warning.argument, warning.text)
        self.motion.warnings.clear()
        fault = self.motion.fault or self.contact.fault
        if fault is not None and self.safety.mode in OPERATIONAL:
            self.messages.error(fault.code, fault.argument, fault.text)
            self.safety_event(SafetyEvent.PROTECTIVE_STOP, reported=True)

    def _pause_if_wanted(self, code: int, argument: int) -> None:
        """Pause the program if it has called `pause_on_error_code` for this error."""
        if self.process.has_pause_on(code, argument):
            self.programs.pause()

    def _watch_inputs(self, now: float) -> None:
        """Stop or pause the program if an RTDE input was not written in time."""
        for variable, action in self.watchdogs.expired(now):
            self.messages.text(f'RTDE watchdog: {variable} was not written in time.')
            if action == 'stop':
                self.programs.stop()
            elif action == 'pause':
                self.programs.pause()

    # ---- called by the program runner ---------------------------------------------------------

    def brake(self) -> None:
        """
        Stop the arm because the program has ended.

        On a path, the arm slows down along the path; otherwise its joints brake with the
        deceleration ``HARD_STOP`` of :mod:`~ur_cartesian_driver.sim.motion.motion_ownership`.

        If the arm is paused on its path or stopped by a fault, the path is discarded.
        """
        if self.scale == 0.0 or self.motion.fault is not None:
            self.motion.stop_at_once()
        self._stopping_on_path = self.motion.on_path
        if self._stopping_on_path:
            self.ownership.let_go()
        else:
            self.ownership.brake()

    def run_preamble(self) -> None:
        """Apply the installation's settings, which precede a program started on the pendant."""
        self.motion.motion_version = self.config.motion_version

    def begin_program(self) -> None:
        """Make the first path move of a program start slowly."""
        self.motion.begin_program()

    def end_modes(self) -> None:
        """End the modes and settings that do not outlive a program."""
        self.freedrive = FreedriveState.OFF
        self.contact.force_mode = None
        self.motion.path_offset.end_of_program()
        self.process = ProcessState()
        self.interpreter_mode.end_of_program()
        self.watchdogs.clear()

    def end_of_frame(self) -> None:
        """Brake if a thread was killed in a motion that no other thread continues."""
        self.ownership.end_of_frame()

    def release(self, thread: Hashable) -> None:
        """Release the motion that a thread commands, because the thread has ended."""
        self.ownership.release(thread)

    def start_refusal(self) -> str:
        """Return the reason why no program can run now; empty = a program can run."""
        if self.safety.mode not in OPERATIONAL:
            return f'the safety mode is {self.safety.mode.name}'
        if self.power.mode is not RobotMode.RUNNING:
            return f'the robot mode is {self.power.mode.name}, not RUNNING'
        return ''

    # ---- commands of clients and programs -----------------------------------------------------

    def set_operational_mode(self, mode: str) -> None:
        """
        Set the operational mode: ``MANUAL``, ``AUTOMATIC``, or ``NONE`` if no client controls it.

        Manual mode ends remote control, and only a person at the pendant can switch it on again.
        """
        self.pendant.operational_mode = mode
        if mode == 'MANUAL':
            self.remote_control = False

    def set_slider(self, fraction: float) -> None:
        """Set the speed slider; a fraction outside 0..1 becomes the nearer bound."""
        self.speed_slider = min(1.0, max(0.0, fraction))

    def load_program(self, name: str) -> str:
        """
        Load a program by its file name; return the reason for a refusal, else an empty string.

        Directories in the name are ignored.
        """
        program = self._stored_program(file := PurePosixPath(name).name)
        if program is None:
            return f'File not found: {name}'
        if isinstance(program, UnreadableProgram):
            return program.reason
        if file.endswith(URPX_SUFFIX) and self.config.version[0] < POLYSCOPE_X:
            software = '.'.join(map(str, self.config.version[:2]))
            return f'{file} is a program of PolyScope X, and the robot has PolyScope {software}'
        if isinstance(program, ProgramTree):
            return self.programs.load_generated(
                file, partial(self.external_control.generate, program, file)
            )
        return self.programs.load(file, program)

    def load_program_aside(self, name: str, then: Callable[[str], None]) -> None:
        """
        Load a program like :meth:`load_program`, but compile it in parallel with the cycles first.

        :param then: called with the reason for a refusal, else an empty string, at once or later.
        """
        program = self._stored_program(PurePosixPath(name).name)
        if isinstance(program, str):
            self.programs.compile_first(
                program, lambda mistake: then(mistake or self.load_program(name))
            )
        else:
            then(self.load_program(name))

    def _stored_program(self, file: str) -> SavedProgram | None:
        """
        Return a stored program; None = no such file.

        A program tree without an External Control node is returned as its URScript.
        """
        program = self.stored_programs.program(file)
        if isinstance(program, ProgramTree) and not program.has_external_control:
            return program.script(file, FetchedScript())
        return program

    def power_on(self) -> str:
        """Power up to IDLE; return the reason for a refusal, else an empty string."""
        if self.safety.mode in POWERLESS:
            return f'the safety mode is {self.safety.mode.name}'
        self.power.on(self.time)
        return ''

    def release_brakes(self) -> str:
        """Power up to RUNNING; return the reason for a refusal, else an empty string."""
        if self.safety.mode in POWERLESS:
            return f'the safety mode is {self.safety.mode.name}'
        self.power.release_brakes(self.time)
        return ''

    def power_off(self) -> None:
        """Cut the power; the arm stops where it is, and the program ends."""
        self.motion.stop_at_once()
        self.programs.stop()
        self.power.off()

    def safety_event(self, event: SafetyEvent, reported: bool = False) -> str:
        """
        Pass an event to the safety system; return the reason for a refusal, else an empty string.

        :param reported: whether the error code of the protective stop has been sent already.
        """
        before = self.safety.mode
        refusal = self.safety.step(event, self.time)
        if refusal or self.safety.mode is before:
            return refusal
        if event is SafetyEvent.PROTECTIVE_STOP and not reported:
            self.messages.error(_PROTECTIVE_STOP_CODE, 0, 'A protective stop was triggered')
        self.messages.safety_mode(self.safety.mode)
        if self.safety.mode in OPERATIONAL:
            self.motion.clear_fault()
        if self.safety.mode in (SafetyMode.VIOLATION, SafetyMode.FAULT):
            self.power_off()
        elif self.safety.mode not in OPERATIONAL:
            self.programs.pause()
        return ''

    def unlock_soon(self) -> None:
        """Unlock a protective stop after ``UNLOCK_TIME``, without the dashboard's unlock delay."""
        if self.safety.mode is SafetyMode.PROTECTIVE_STOP:
            self._unlock_at = self.time + UNLOCK_TIME

    def watch_input(self, variable: str, frequency: float, action: str) -> None:
        """
        Check from now on that an RTDE input is written often enough.

        :param frequency: lowest rate of writing [Hz]; 0 ends the check.
        :param action: 'pause' or 'stop' the program if the input is late; 'ignore' = do nothing.
        :raises RuntimeException: the robot has no such input, reads inputs at a lower rate, or the
            action has another value. (Assumed: the manual names the values, but no error.)
        """
        if variable not in fields_of(INPUT_TYPES, self.config.version):
            raise RuntimeException(f'variable_name is {variable!r}, which is no RTDE input')
        if frequency * self.cycle > 1.0:
            rate = 1.0 / self.cycle
            raise RuntimeException(
                f'min_frequency is {frequency:g}; inputs are read {rate:g} times a second'
            )
        if action not in ('pause', 'stop', 'ignore'):
            raise RuntimeException(f"action is {action!r}; it must be 'pause', 'stop' or 'ignore'")
        self.watchdogs.watch(variable, frequency, action, self.time)

    def show_popup(self, popup: Popup) -> None:
        """Show a window; beyond ``_MAX_POPUPS`` open windows, keep only blocking ones."""
        if popup.blocking or len(self.popups) < _MAX_POPUPS:
            self.popups.append(popup)
        self.messages.popup(popup)

    def close_popups(self) -> None:
        """Close all windows; threads that wait for a window continue."""
        for popup in self.popups:
            popup.open = False
        self.popups.clear()
