# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Script functions for time and the robot's state."""

from __future__ import annotations

from collections.abc import Callable
from math import hypot, isinf, pi
from typing import Any

from ur_cartesian_driver.sim.builtins.arguments import (
    index,
    not_negative,
    number,
    one_of,
    six,
    text,
    three,
    whole,
)
from ur_cartesian_driver.sim.builtins.builtin_group import BuiltinGroup
from ur_cartesian_driver.sim.controller import Controller
from ur_cartesian_driver.sim.motion.motion_ownership import Steps
from ur_cartesian_driver.sim.rtde_output_values import read_output
from ur_cartesian_driver.sim.state.controller_state import Payload
from ur_cartesian_driver.sim.state.power_and_safety import SafetyEvent
from ur_cartesian_driver.urscript.script_errors import RuntimeException
from ur_cartesian_driver.urscript.script_values import (
    INT_MAX,
    INT_MIN,
    make_list,
    Struct,
    truth,
    Value,
)

#: System time (`time(2)`) at time 0 of the controller's clock: 2026-01-01 00:00 GMT [s].
SYSTEM_TIME = 1_767_225_600
#: Largest joint position that set_pos accepts [rad]; the bound of a real robot is not known.
MAX_TURN = 1000.0


class TimeBuiltins(BuiltinGroup):
    """Time, interpreter mode and RTDE watchdog; the speed slider does not scale times."""

    def get_steptime(self) -> float:
        """Return the duration of a cycle [s]."""
        return self._controller.cycle

    def sync(self) -> Steps:
        """Wait for the next cycle."""
        yield

    def sleep(self, t: Value) -> Steps:
        """Wait for `t` seconds, rounded up to whole cycles; at least one cycle."""
        end = self._controller.time + not_negative(t, 't')
        yield
        while self._controller.time < end - 1e-9:
            yield

    def time(self, mode: Value = 0) -> Struct:
        """
        Return a time in seconds and nanoseconds.

        :param mode: 0 = the controller's clock; 2 = the system time, here the controller's clock
            plus the time at the start of 2026, so that a run can be repeated.
        """
        start = SYSTEM_TIME if one_of(mode, 'mode', (0, 2)) == 2 else 0
        nanoseconds = round(self._controller.time * 1e9) + start * 10**9
        return Struct({'sec': nanoseconds // 10**9, 'nanosec': nanoseconds % 10**9})

    def interpreter_mode(self, clearQueueOnEnter: Value = True, clearOnEnd: Value = True) -> Steps:
        """Execute statements that clients send to the interpreter port until `end_interpreter`."""
        yield from self._controller.interpreter_mode.run(
            clear_queue=truth(clearQueueOnEnter), clear_on_end=truth(clearOnEnd)
        )

    def end_interpreter(self) -> None:
        """End interpreter mode when the current statement has ended."""
        self._controller.interpreter_mode.end()

    def clear_interpreter(self) -> None:
        """Delete the variables and functions of all statements, when the current one has ended."""
        self._controller.interpreter_mode.clear()

    def rtde_set_watchdog(
        self, variable_name: Value, min_frequency: Value, action: Value = 'pause'
    ) -> None:
        """From now until the program ends, check that an RTDE input is written often enough."""
        self._controller.watch_input(
            text(variable_name, 'variable_name'),
            not_negative(min_frequency, 'min_frequency'),
            text(action, 'action'),
        )


def _list_of(
    values: Callable[[Controller], tuple[float, ...]],
) -> Callable[[BuiltinGroup], list[float]]:
    """Return the script function that returns numbers of the controller as a list."""

    def get(group: BuiltinGroup) -> list[float]:
        return list(values(group._controller))

    return get


class RobotBuiltins(BuiltinGroup):
    """The robot's motion, sensors, payload and power; motion in [rad], [m] and [s]."""

    get_target_joint_positions = _list_of(lambda c: c.target.q)
    get_joint_positions = get_target_joint_positions  # the old name
    get_actual_joint_positions = _list_of(lambda c: c.actual.q)
    get_target_joint_speeds = _list_of(lambda c: c.target.qd)
    get_actual_joint_speeds = _list_of(lambda c: c.actual.qd)
    get_target_joint_accelerations = _list_of(lambda c: c.motion.qdd)
    get_target_tcp_speed = _list_of(lambda c: c.target.tcp_twist)
    get_actual_tcp_speed = _list_of(lambda c: c.actual.tcp_twist)
    get_tcp_force = _list_of(lambda c: c.tcp_wrench)
    # Zero, because the simulated arm has no dynamics.
    get_joint_torques = _list_of(lambda _: (0.0,) * 6)

    def get_actual_joint_accelerations(self) -> list[float]:
        """Return the measured joint accelerations [rad/s^2]."""
        return list(self._controller.actual.qdd)

    def get_actual_joint_positions_history(self, steps: Value = 0) -> list[float]:
        """Return the actual joint positions [rad] of the cycle that is `steps` cycles ago."""
        return list(self._controller.joint_history(whole(steps, 'steps')))

    def force(self) -> float:
        """Return the magnitude of the force on the tool [N]."""
        return hypot(*self._controller.tcp_wrench[:3])

    def get_joint_temp(self, j: Value) -> float:
        """Return room temperature [°C]."""
        index(j, 'j', 6)
        return 25.0

    def get_tool_temp(self) -> float:
        """Return room temperature [°C]."""
        return 25.0

    def get_controller_temp(self) -> float:
        """Return room temperature [°C]."""
        return 25.0

    def get_tool_current(self) -> float:
        """Return 0 [A], because the current of the tool is not simulated."""
        return 0.0

    def get_tool_accelerometer_reading(self) -> list[float]:
        """Return the acceleration at the flange including gravity, in flange axes [m/s^2]."""
        return list(self._controller.tool_accelerometer)

    def zero_ftsensor(self) -> None:
        """Zero the force sensor at its present reading."""
        self._controller.contact.zero()

    def ft_rtde_input_enable(
        self,
        enable: Value,
        sensor_mass: Value = 0,
        sensor_measuring_offset: Value = None,
        sensor_cog: Value = None,
    ) -> None:
        """Enable or disable the use of forces that RTDE clients write for an external sensor."""
        self._controller.external_ft = truth(enable)

    enable_external_ft_sensor = ft_rtde_input_enable  # the old name

    def set_payload(self, m: Value, cog: Value = None) -> None:
        """Set mass [kg] and centre of gravity [m] (default: the TCP); the inertia becomes zero."""
        tcp = self._controller.motion.T_flange_tcp.position
        centre = tcp if cog is None else three(cog, 'cog')
        self._change_payload(Payload(mass=not_negative(m, 'm'), cog=centre))

    def set_payload_mass(self, m: Value) -> None:
        """Set the mass [kg] alone; the inertia becomes zero."""
        payload = self._controller.payload
        self._change_payload(Payload(mass=not_negative(m, 'm'), cog=payload.cog))

    def set_payload_cog(self, CoG: Value) -> None:
        """Set the centre of gravity [m] alone; the inertia becomes zero."""
        payload = self._controller.payload
        self._change_payload(Payload(mass=payload.mass, cog=three(CoG, 'CoG')))

    def set_target_payload(
        self, m: Value, cog: Value, inertia: Value = None, transition_time: Value = 0
    ) -> None:
        """Set mass [kg], centre of gravity [m] and inertia [kg m^2], without a transition time."""
        not_negative(transition_time, 'transition_time')
        matrix = (0.0,) * 6 if inertia is None else six(inertia, 'inertia')
        if min(matrix[:3]) < 0.0 or max(abs(item) for item in matrix) > 133.0:
            raise RuntimeException(
                'inertia must lie within -133..133, and its first three items not below 0'
            )
        self._change_payload(
            Payload(mass=not_negative(m, 'm'), cog=three(cog, 'cog'), inertia=matrix)
        )

    def _change_payload(self, payload: Payload) -> None:
        """Set the payload and zero the force sensor; CB3 arms have no sensor to zero."""
        self._controller.payload = payload
        if self._controller.config.robot_model.series != 'CB3':
            self._controller.contact.zero()

    def get_target_payload(self) -> float:
        """Return the mass of the payload [kg]."""
        return self._controller.payload.mass

    get_target_payload_cog = _list_of(lambda c: c.payload.cog)
    get_target_payload_inertia = _list_of(lambda c: c.payload.inertia)

    def set_gravity(self, d: Value) -> None:
        """Set the acceleration [m/s^2] opposite to gravity, in base axes."""
        self._controller.gravity = three(d, 'd')

    def get_gravity(self) -> list[float]:
        """Return the acceleration [m/s^2] opposite to gravity, in base axes."""
        return list(self._controller.gravity)

    def get_rtde_value(self, name: Value) -> Value:
        """
        Return the present value of the RTDE output `name`; a vector becomes a list.

        An integer that does not fit into 32 bits becomes a float.
        """
        wanted = text(name, 'name')
        try:
            value = read_output(self._controller, wanted)
        except KeyError:
            raise RuntimeException(f'There is no RTDE output {wanted!r}.') from None
        if isinstance(value, tuple):
            return make_list([_script_number(item) for item in value])
        return _script_number(value)

    def set_pos(self, q: Value) -> None:
        """Put the arm at joint positions at once, as only a simulated arm can."""
        q_ = six(q, 'q')
        if not max(map(abs, q_)) <= MAX_TURN:
            raise RuntimeException(f'q has positions beyond {MAX_TURN:g} rad.')
        self._controller.motion.teleport(q_)

    def reset_revolution_counter(self, qNear: Value = None) -> None:
        """
        Change the positions of unlimited joints by full turns.

        :param qNear: positions [rad] to which the new ones are the nearest; None = no change.
        """
        if qNear is None:
            return
        near, limits = six(qNear, 'qNear'), self._controller.arm.model.position_limits
        turn = 2.0 * pi
        counted = [
            q + turn * round((close - q) / turn) if isinf(high - low) else q
            for q, close, (low, high) in zip(self._controller.motion.q, near, limits, strict=True)
        ]
        if counted != list(self._controller.motion.q):
            self._controller.motion.teleport(six(counted, 'q'))

    def set_speed_slider_fraction(self, fraction: Value) -> None:
        """Set the speed slider, 0..1."""
        self._controller.set_slider(number(fraction, 'fraction'))

    def protective_stop(self) -> Steps:
        """Trigger a protective stop; the program continues after unlock and play."""
        self._controller.safety_event(SafetyEvent.PROTECTIVE_STOP)
        yield

    def powerdown(self) -> None:
        """Switch the arm off."""
        self._controller.power_off()


def _script_number(value: Any) -> Value:
    """Return a number of RTDE as a value of a program; a large integer becomes a float."""
    if isinstance(value, bool | float):
        return value
    return int(value) if INT_MIN <= value <= INT_MAX else float(value)
