# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The values of the RTDE outputs in the simulated controller.

Actual values equal the targets, unless the arm is compliant or imperfect, or a fault makes them
differ. Only the payload has a mass; the links have none. Outputs of quantities that are not
simulated have the plausible values of :data:`FIXED` (temperatures), or are zero (encoders).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import lru_cache
from math import hypot
from typing import Any

from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.motion.geometry.pose import IDENTITY
from ur_cartesian_driver.motion.geometry.vectors import add, add6, scale, Vector3, Vector6, ZERO6
from ur_cartesian_driver.motion.state.rtde_state import RobotMode
from ur_cartesian_driver.protocol.rtde.rtde_fields import fields_of, OUTPUT_TYPES
from ur_cartesian_driver.sim.controller import Controller
from ur_cartesian_driver.sim.motion.kinematics.point_motion import (
    flange_point,
    moments_for,
    point_motion,
)
from ur_cartesian_driver.sim.state.controller_io import (
    pack_bits,
    Registers,
    single_registers,
)

Getter = Callable[['Controller'], Any]

#: Values of the outputs ``joint_mode`` and ``tool_mode``.
_RUNNING, _IDLE, _POWER_OFF = 253, 255, 239
#: Supply voltage of a powered arm [V]; supply current [A].
_VOLTAGE, _CURRENT = 48.0, 0.5


def _elbow(controller: Controller) -> Vector3:
    """Return the position of the elbow, the third joint [m]."""
    return controller.arm.frames(controller.motion.q).origins[2]


def _elbow_velocity(controller: Controller) -> Vector3:
    """Return the velocity of the elbow [m/s]; only the first two joints move it."""
    motion = controller.motion
    frames = controller.arm.frames(motion.q)
    return point_motion(frames, motion.qd, motion.qdd, frames.origins[2], 2).velocity


def _tcp_acceleration(controller: Controller) -> Vector6:
    """Return the target's linear and angular acceleration of the TCP [m/s^2, rad/s^2]."""
    motion = controller.motion
    if not any(motion.qd) and not any(motion.qdd):
        return ZERO6  # a shortcut, because most arms stand still most of the time
    return _point_acceleration(
        controller.arm, motion.q, motion.qd, motion.qdd, motion.T_flange_tcp.position
    )


@lru_cache(maxsize=1)  # each client needs the value twice per cycle, for target and actual
def _point_acceleration(
    arm: Arm, q: Vector6, qd: Vector6, qdd: Vector6, offset: Vector3
) -> Vector6:
    """Return the acceleration [m/s^2, rad/s^2] of a point given in flange coordinates [m]."""
    frames = arm.frames(q)
    point = point_motion(frames, qd, qdd, flange_point(frames, offset))
    return (*point.acceleration, *point.angular_acceleration)


def _payload_moments(controller: Controller) -> Vector6:
    """Return the joint moments [Nm] that carry and accelerate the payload, a point mass."""
    mass, motion = controller.payload.mass, controller.motion
    if mass == 0.0 or controller.power.mode is not RobotMode.RUNNING:
        return ZERO6
    frames = controller.arm.frames(motion.q)
    centre = flange_point(frames, controller.payload.cog)
    acceleration = point_motion(frames, motion.qd, motion.qdd, centre).acceleration
    return moments_for(frames, centre, scale(add(acceleration, controller.gravity), mass))


def _powered(controller: Controller) -> bool:
    return controller.power.mode >= RobotMode.POWER_ON


def _tool_mode(controller: Controller) -> int:
    return _RUNNING if _powered(controller) else _POWER_OFF


def _joint_mode(controller: Controller) -> int:
    """Return the mode of the joints; a powered arm that is not RUNNING is held by its brakes."""
    if controller.power.mode is RobotMode.RUNNING:
        return _RUNNING
    return _IDLE if _powered(controller) else _POWER_OFF


def _actual_acceleration(controller: Controller) -> Vector6:
    return add6(_tcp_acceleration(controller), controller.actual.acceleration_error)


def _target_currents(controller: Controller) -> Vector6:
    """Return the joint currents [A] without noise; a perfect arm has none."""
    imperfections = controller.config.arm_imperfections
    return imperfections.holding_current if imperfections and _powered(controller) else ZERO6


def _joint_currents(controller: Controller) -> Vector6:
    """Return the measured joint currents [A]; a perfect arm has none."""
    arm = controller.actual.imperfect_arm
    return arm.currents() if arm is not None and _powered(controller) else ZERO6


def _tcp(controller: Controller) -> Vector6:
    return controller.target.T_base_tcp.rotation_vector()


def _scaled_momentum(controller: Controller) -> float:
    return controller.payload.mass * hypot(*controller.motion.tcp_twist[:3])


#: Output -> function that computes it.
COMPUTED: Mapping[str, Getter] = {
    'timestamp': lambda c: c.timestamp,
    'control_step': lambda c: c.cycles,
    'target_q': lambda c: c.target.q,
    'actual_q': lambda c: c.actual.q,
    'target_qd': lambda c: c.target.qd,
    'actual_qd': lambda c: c.actual.qd,
    'target_qdd': lambda c: c.motion.qdd,
    'target_TCP_pose': _tcp,
    'actual_TCP_pose': lambda c: c.actual.T_base_tcp.rotation_vector(),
    'target_TCP_speed': lambda c: c.target.tcp_twist,
    'actual_TCP_speed': lambda c: c.actual.tcp_twist,
    'tcp_offset': lambda c: (
        ZERO6 if c.motion.T_flange_tcp is IDENTITY else c.motion.T_flange_tcp.rotation_vector()
    ),
    'speed_scaling': lambda c: c.speed_scaling,
    'target_speed_fraction': lambda c: c.speed_slider,
    'robot_mode': lambda c: c.power.mode,
    'safety_mode': lambda c: c.safety.mode,
    'safety_status': lambda c: c.safety.mode,
    'runtime_state': lambda c: c.programs.state,
    'robot_status_bits': lambda c: c.robot_status,
    'safety_status_bits': lambda c: c.safety_status,
    'joint_mode': lambda c: (_joint_mode(c),) * 6,
    'tool_mode': _tool_mode,
    'actual_joint_voltage': lambda c: (_VOLTAGE if _powered(c) else 0.0,) * 6,
    'actual_robot_voltage': lambda c: _VOLTAGE if _powered(c) else 0.0,
    'actual_robot_current': lambda c: _CURRENT if _powered(c) else 0.0,
    'target_current': _target_currents,
    'actual_current': _joint_currents,
    'target_moment': _payload_moments,
    'actual_current_as_torque': _payload_moments,
    'target_TCP_acceleration': _tcp_acceleration,
    'actual_TCP_acceleration': _actual_acceleration,
    'actual_tool_accelerometer': lambda c: c.tool_accelerometer,
    'elbow_velocity': _elbow_velocity,
    'actual_momentum': _scaled_momentum,
    'payload': lambda c: c.payload.mass,
    'payload_cog': lambda c: c.payload.cog,
    'payload_inertia': lambda c: c.payload.inertia,
    'target_gravity': lambda c: c.gravity,
    'actual_TCP_force': lambda c: c.tcp_wrench,
    'ft_raw_wrench': lambda c: c.io.external_force if c.external_ft else c.contact.wrench,
    'tcp_force_scalar': lambda c: hypot(*c.tcp_wrench[:3]),
    'actual_digital_input_bits': lambda c: c.io.digital_in.packed(),
    'actual_digital_output_bits': lambda c: c.io.digital_out.packed(),
    'actual_configurable_digital_input_bits': lambda c: pack_bits(c.io.digital_in.configurable),
    'actual_configurable_digital_output_bits': lambda c: pack_bits(c.io.digital_out.configurable),
    'analog_io_types': lambda c: c.io.analog_types(),
    'standard_analog_input0': lambda c: c.io.analog_in[0],
    'standard_analog_input1': lambda c: c.io.analog_in[1],
    'standard_analog_output0': lambda c: c.io.analog_out[0],
    'standard_analog_output1': lambda c: c.io.analog_out[1],
    'tool_analog_input0': lambda c: c.io.tool_analog_in[0],
    'tool_analog_input1': lambda c: c.io.tool_analog_in[1],
    'tool_output_voltage': lambda c: c.io.tool_voltage,
    'elbow_position': _elbow,
}

#: Output -> its constant value, because its cause is not simulated.
FIXED: Mapping[str, Any] = {
    'joint_temperatures': (25.0,) * 6,
    'actual_main_voltage': _VOLTAGE,
    'tool_temperature': 25.0,
    # Both inputs are in volts, as on the primary interface.
    'tool_analog_input_types': 3,
}


def _register_getters(direction: str, of: Callable[[Controller], Registers]) -> dict[str, Getter]:
    """Return output -> function that reads it, for the registers of one direction."""

    def item(values: str, i: int) -> Getter:
        return lambda controller: getattr(of(controller), values)[i]

    return {
        f'{direction}_bit_registers0_to_31': lambda c: pack_bits(of(c).bits[:32]),
        f'{direction}_bit_registers32_to_63': lambda c: pack_bits(of(c).bits[32:64]),
        **{name: item(values, i) for name, values, i in single_registers(direction)},
    }


REGISTERS: Mapping[str, Getter] = {
    **_register_getters('input', lambda c: c.io.inputs),
    **_register_getters('output', lambda c: c.io.outputs),
}


def output_getter(name: str, zero: Any) -> Getter:
    """
    Return the function that computes an output.

    :param zero: the value of an output that is not simulated.
    """
    found = COMPUTED.get(name) or REGISTERS.get(name)
    if found is not None:
        return found
    value = FIXED.get(name, zero)
    return lambda _controller: value


def read_output(controller: Controller, name: str) -> Any:
    """
    Return the present value of an output.

    :raises KeyError: the software of this robot has no such output.
    """
    return _getter_of(controller.config.version, name)(controller)


@lru_cache
def _getter_of(version: tuple[int, ...], name: str) -> Getter:
    return output_getter(name, fields_of(OUTPUT_TYPES, version)[name].zero)
