# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The configuration of a simulated robot: a frozen dataclass that checks its values."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from math import isfinite, pi
from typing import Literal

from ur_cartesian_driver.kinematics.robot_models import (
    DhTable,
    JointLimits,
    robot_model,
    RobotModel,
)
from ur_cartesian_driver.motion.geometry.vectors import Vector6
from ur_cartesian_driver.motion.goal.declared_types import declare_types
from ur_cartesian_driver.motion.twin.laws import ASSUMED_LAWS, MotionLaws
from ur_cartesian_driver.motion.twin.twin import ArmIdentity, laws_of, Twin
from ur_cartesian_driver.sim.faults.fault_values import Fault
from ur_cartesian_driver.sim.motion.contact.contact_bodies import ContactBody
from ur_cartesian_driver.sim.motion.imperfect_arm import (
    Imperfections,
    typical_imperfections,
)
from ur_cartesian_driver.sim.motion.paths.second_motion_version import SecondMotionVersion
from ur_cartesian_driver.sim.pendant_programs.program_tree import BUILT_IN_PROGRAMS, SavedProgram
from ur_cartesian_driver.sim.state.controller_io import DigitalPort

#: Joint positions with room to move in all directions, away from every singularity [rad].
HOME: Vector6 = (0.0, -pi / 2, pi / 2, -pi / 2, -pi / 2, 0.0)

#: Bound on ``rate``: more simulated seconds per second than any computer can achieve.
MAX_RATE = 1e4
_PRIMARY_PORT = 30001
#: Not port 80 as on a real robot, because only root can open it.
_ROBOT_API_PORT = 8000
#: The first software with motion version 2.
_SECOND_MOTION_VERSION = (5, 22)
_SERIAL_NUMBER = '20000000000'
_DEFAULT_VERSIONS = {'CB3': '3.15.8', 'e': '5.21.0'}


@dataclass(frozen=True, slots=True, kw_only=True)
class SimulatorConfig:
    """
    The configuration of one simulated robot; the defaults suit tests and first tries.

    :raises ValueError: a value is unknown or impossible; the text names the field.
    """

    #: Model of the robot; one of :data:`ur_cartesian_driver.kinematics.robot_models.MODELS`.
    model: str = 'ur5e'
    #: Address that the servers listen on; by default other machines cannot reach it.
    host: str = '127.0.0.1'
    #: Version of the robot's software; empty = 5.21.0, or 3.15.8 for a CB3 model.
    polyscope: str = ''
    #: Ports of the RTDE, primary and dashboard interfaces; 0 = any free port.
    rtde_port: int = 30004
    primary_port: int = _PRIMARY_PORT
    dashboard_port: int = 29999
    #: Ports of the secondary and real-time interfaces; None = 30002 and 30003 if the primary
    #: interface is on 30001, otherwise any free ports, because a robot on other ports is probably
    #: not the only robot on this computer. The read-only twins of primary, secondary and real-time
    #: interface (30011 to 30013) listen only if all three are on their standard ports.
    secondary_port: int | None = None
    realtime_port: int | None = None
    #: Port of interpreter mode; None = 30020 if the primary interface is on 30001, otherwise any
    #: free port.
    interpreter_port: int | None = None
    #: Port of the Robot API of PolyScope X, 80 on a real robot; None = 8000 if the primary
    #: interface is on 30001, otherwise any free port.
    robot_api_port: int | None = None
    #: Joint positions at start [rad].
    q: Vector6 = HOME
    power: Literal['running', 'off'] = 'running'
    #: False = local control: scripts of clients are refused.
    remote_control: bool = True
    #: False = the feature is off in the robot's settings: scripts are accepted, and the dashboard
    #: reports that the robot is not in remote control.
    has_remote_control: bool = True
    #: Rotation [rad] that takes as long in a movel as a metre; 4 was recorded, the manual has 1.
    #: movec, movep and optimovel use 1.
    turn_ratio: float = ASSUMED_LAWS.turn_ratio
    #: Measured laws of this robot's motion; laws that were not measured are assumed. Measured laws
    #: override ``turn_ratio``, figures of ``imperfections`` and, in motion version 2,
    #: ``blend_fraction``. The twin must be of this model, software and motion version.
    twin: Twin | None = None
    #: Motion version of movej and movel at the start, and of programs that are played: 1 or, from
    #: PolyScope 5.22 on, 2. Programs can set another one.
    motion_version: int = 1
    #: Parameters of motion version 2; their values are assumed.
    second_motion_version: SecondMotionVersion = field(default_factory=SecondMotionVersion)
    #: Denavit-Hartenberg parameters of this arm; None = the nominal parameters of the model.
    geometry: DhTable | None = None
    #: Joint limits of this arm, if they are tighter than the model's; None = the model's. The arm
    #: keeps to these limits, and the primary interface reports them.
    joint_limits: JointLimits | None = None
    #: Imperfections of the arm and its controller; None = a perfect arm and controller.
    #: `sim.motion.imperfect_arm.typical_imperfections` returns typical values for a model.
    imperfections: Imperfections | None = None
    #: Cycles per second; None = 500, or 125 for a CB3 model.
    frequency: float | None = None
    #: Time after a protective stop during which pendant and dashboard refuse to unlock [s]; 5 s on
    #: a real robot.
    unlock_delay: float = 5.0
    #: Time from `power on` to IDLE, and time from IDLE to RUNNING [s]; a real arm takes about
    #: ten times as long.
    power_on_time: float = 0.5
    brake_release_time: float = 0.5
    #: Simulated seconds per second of real time; 0 = as many as possible.
    rate: float = 1.0
    #: Behaviour of the controller's clock if this computer was too busy for cycles in time: 'skip'
    #: adds the lost time, so that the clock keeps real time as on a real robot; 'wait' does not,
    #: so that motions take their nominal time on the controller's clock, as tests expect.
    when_late: Literal['skip', 'wait'] = 'skip'
    #: Faults, as values of `sim.faults.fault_values` or as text; their times are measured from the
    #: first cycle.
    faults: Sequence[Fault | str] = ()
    #: Bodies that the tool can touch, as :class:`ContactBody` or as text: 'plane 0 0 0.1 0 0 1'.
    contacts: Sequence[ContactBody | str] = ()
    #: Digital inputs that are on from the start, such as 'standard 3'.
    inputs: Sequence[str] = ()
    #: Answers of the person at the pendant when programs request values, in this order; a program
    #: that requests more values waits.
    answers: Sequence[object] = ()
    #: The bodies of ``contacts``.
    contact_bodies: tuple[ContactBody, ...] = field(init=False, default=())
    #: ``imperfections`` with the figures of the twin.
    arm_imperfections: Imperfections | None = field(init=False, default=None)
    #: Cycles after which a new thread of a program begins.
    thread_delay: int = 0
    #: Seed of random switches between the threads of a program; None = no random switches, so
    #: threads switch only when the running thread calls a function that takes time.
    interleaving_seed: int | None = None
    #: Programs that can be loaded: file name -> URScript, or the tree of a program on the pendant.
    #: `external_control.urp` has a node of External Control unless a program here has that name.
    programs: Mapping[str, SavedProgram] = field(default_factory=dict)
    #: Name of the program that is loaded from the start; empty = none.
    program: str = ''
    #: Host and port of External Control in the installation. When a program with a node of
    #: External Control is played, the node's script is fetched from there.
    external_control_host: str = '127.0.0.1'
    external_control_port: int = 50002

    def __post_init__(self) -> None:
        """Refuse values that cannot be simulated, and compute the derived fields."""
        if len(self.q) != 6:
            raise ValueError(f'q has {len(self.q)} values; give one for each of the 6 joints.')
        declare_types(self)
        model = self.robot_model  # raises for an unknown name
        for field_name in ('rate', 'unlock_delay', 'power_on_time', 'brake_release_time'):
            if not isfinite(getattr(self, field_name)):
                raise ValueError(f'{field_name} is {getattr(self, field_name)}; use a number.')
        if not all(map(isfinite, self.q)):
            raise ValueError(f'q is {self.q}; give the joint positions in radians.')
        object.__setattr__(self, 'contact_bodies', _contact_bodies(self.contacts))
        for channel in self.inputs:
            DigitalPort().switch_on(channel)
        if isinstance(self.answers, str):
            raise ValueError(f'answers is {self.answers!r}; give a list of answers.')
        if self.power not in ('running', 'off'):
            raise ValueError(f"power is {self.power!r}; use 'running' or 'off'.")
        if self.when_late not in ('skip', 'wait'):
            raise ValueError(f"when_late is {self.when_late!r}; use 'skip' or 'wait'.")
        if self.program and self.program not in self.saved_programs:
            known = ', '.join(self.saved_programs)
            raise ValueError(f'program is {self.program!r}; programs has {known}.')
        if self.frequency is not None and not 1.0 <= self.frequency <= 1000.0:
            raise ValueError(f'frequency is {self.frequency} Hz; use 1 to 1000 Hz.')
        if self.thread_delay < 0:
            raise ValueError(f'thread_delay is {self.thread_delay} cycles; use 0 or more.')
        if not 0.0 <= self.rate <= MAX_RATE:
            raise ValueError(
                f'rate is {self.rate}; use 1 for real time, at most {MAX_RATE:g}, or 0 for no '
                'waiting.'
            )
        for name in (
            'rtde_port',
            'primary_port',
            'dashboard_port',
            'secondary_port',
            'realtime_port',
            'interpreter_port',
            'robot_api_port',
            'external_control_port',
        ):
            port = getattr(self, name)
            if port is not None and not 0 <= port <= 65535:
                raise ValueError(f'{name} is {port}; use 0 (any free one) to 65535.')
        if (self.version[0] >= 5) == (model.series == 'CB3'):
            raise ValueError(
                f'polyscope {self.polyscope} does not run a {self.model}; use 3.x '
                'for CB3 models, and 5.x or 10.x for all others.'
            )
        if self.motion_version not in (1, 2):
            raise ValueError(f'motion_version is {self.motion_version}; use 1 or 2.')
        if self.motion_version == 2 and self.version[:2] < _SECOND_MOTION_VERSION:
            raise ValueError(
                f'motion_version is 2, but polyscope is {".".join(map(str, self.version[:2]))}; '
                'use 5.22 or newer.'
            )
        if self.twin is not None:
            self._check_twin(self.twin)
        object.__setattr__(self, 'arm_imperfections', self._imperfections())

    def _check_twin(self, twin: Twin) -> None:
        software = '.'.join(map(str, self.version[:3]))
        robot = ArmIdentity(
            model=self.model, software=software, motion_version=self.motion_version
        )
        if differences := twin.arm.differences(robot):
            raise ValueError(
                f'twin is of another robot: {differences}; set model, polyscope and '
                'motion_version to those of the twin.'
            )

    def _imperfections(self) -> Imperfections | None:
        if self.twin is None or not (figures := self.twin.arm_figures):
            return self.imperfections
        arm = self.imperfections or typical_imperfections(self.robot_model)
        return replace(arm, **figures)

    @property
    def second_version_laws(self) -> SecondMotionVersion:
        """
        Return ``second_motion_version``, adapted to the twin.

        If the twin has measured blends, its ``blend_begin`` determines them, so the additional
        ``blend_fraction`` is 1.
        """
        if self.twin is None or 'blend_begin' not in self.twin.estimates:
            return self.second_motion_version
        return replace(self.second_motion_version, blend_fraction=1.0)

    @property
    def serial_number(self) -> str:
        """Return the serial number of the robot."""
        return (self.twin.arm.serial_number if self.twin else '') or _SERIAL_NUMBER

    @property
    def laws(self) -> MotionLaws:
        """Return the measured laws of motion, and assumed ones where none were measured."""
        return laws_of(self.twin, self.turn_ratio)

    @property
    def robot_model(self) -> RobotModel:
        """Return the model of the robot, with ``joint_limits`` if they are given."""
        model = robot_model(self.model)
        return model if self.joint_limits is None else model.limited_to(self.joint_limits)

    @property
    def version(self) -> tuple[int, int, int, int]:
        """
        Return the version of the robot's software: major, minor, bugfix, build.

        :raises ValueError: ``polyscope`` is not two to four numbers with dots between them.
        """
        series = 'CB3' if self.robot_model.series == 'CB3' else 'e'
        text = self.polyscope or _DEFAULT_VERSIONS[series]
        parts = text.split('.')
        if not 2 <= len(parts) <= 4 or not all(part.isdigit() for part in parts):
            raise ValueError(f'polyscope is {text!r}; write it like 5.21 or 5.21.0.')
        major, minor, bugfix, build = [int(part) for part in parts] + [0] * (4 - len(parts))
        return major, minor, bugfix, build

    @property
    def saved_programs(self) -> Mapping[str, SavedProgram]:
        """Return the programs on the robot's disk: file name -> program."""
        return {**BUILT_IN_PROGRAMS, **self.programs}

    @property
    def listening_secondary_port(self) -> int:
        """Return the port for the secondary interface; 0 = any free one."""
        return self._port_beside_primary(self.secondary_port, 1)

    @property
    def listening_realtime_port(self) -> int:
        """Return the port for the real-time interface; 0 = any free one."""
        return self._port_beside_primary(self.realtime_port, 2)

    @property
    def listening_interpreter_port(self) -> int:
        """Return the port for interpreter mode; 0 = any free one."""
        return self._port_beside_primary(self.interpreter_port, 19)

    @property
    def listening_robot_api_port(self) -> int:
        """Return the port for the Robot API; 0 = any free one."""
        if self.robot_api_port is not None:
            return self.robot_api_port
        return _ROBOT_API_PORT if self.primary_port == _PRIMARY_PORT else 0

    @property
    def has_standard_ports(self) -> bool:
        """Return whether the script interfaces are on 30001 to 30003, as on a real robot."""
        ports = (self.primary_port, self.listening_secondary_port, self.listening_realtime_port)
        return ports == (_PRIMARY_PORT, _PRIMARY_PORT + 1, _PRIMARY_PORT + 2)

    def _port_beside_primary(self, chosen: int | None, distance: int) -> int:
        if chosen is not None:
            return chosen
        return _PRIMARY_PORT + distance if self.primary_port == _PRIMARY_PORT else 0

    @property
    def cycle(self) -> float:
        """Return the controller's cycle [s]; by default 2 ms, or 8 ms for a CB3 model."""
        if self.frequency is not None:
            return 1.0 / self.frequency
        return self.robot_model.control_cycle


def _contact_bodies(contacts: Sequence[ContactBody | str]) -> tuple[ContactBody, ...]:
    return tuple(
        each if isinstance(each, ContactBody) else ContactBody.parse(each) for each in contacts
    )
