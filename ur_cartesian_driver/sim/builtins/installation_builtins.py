# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Functions that change settings of the installation; programs saved by PolyScope begin with them.

The arguments are checked, but the settings have no effect, because the buttons, wires and machines
around the arm are not simulated.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from ur_cartesian_driver.sim.builtins.arguments import index, one_of, text, three, within
from ur_cartesian_driver.sim.builtins.builtin_group import BuiltinGroup, without_effect
from ur_cartesian_driver.sim.controller import Controller
from ur_cartesian_driver.urscript.script_errors import RuntimeException
from ur_cartesian_driver.urscript.script_values import truth, type_name, Value

#: Actions that a program can assign to an input; 'default' = no action.
INPUT_ACTIONS = ('default', 'freedrive')
EUROMAP_PINS = 33


#: Number of states to which an output can be tied: 0 to 5 follow the program, 6 and 7 the power
#: of the arm.
RUN_STATES = 8
EUROMAP_RUN_STATES = 4


def _input_action(count: int) -> Callable[[Any, Value, Value], None]:
    """Return a script function that checks the number of an input and an action for it."""

    @without_effect
    def choose(_: Any, port: Value, action: Value) -> None:
        index(port, 'port', count)
        if text(action, 'action') not in INPUT_ACTIONS:
            raise RuntimeException(f'action is {action!r}; it must be "default" or "freedrive"')

    return choose


def _runstate(count: int, states: int = RUN_STATES) -> Callable[[Any, Value, Value], None]:
    """Return a script function that checks the numbers of an output and of a program state."""

    @without_effect
    def choose(_: Any, outputId: Value, state: Value) -> None:
        index(outputId, 'outputId', count)
        index(state, 'state', states)

    return choose


def _runstate_list(count: int) -> Callable[[Any, Value], None]:
    """Return an older script function that checks a list of the numbers of outputs."""

    @without_effect
    def choose(_: Any, outputs: Value) -> None:
        if type(outputs) is not list:
            raise RuntimeException(
                f'Type error: outputs must be a list, not a {type_name(outputs)}'
            )
        for i, output in enumerate(outputs):
            index(output, f'outputs[{i}]', count)

    return choose


class InstallationBuiltins(BuiltinGroup):
    """Input actions, outputs that follow the program state, and modes of the tool."""

    set_standard_digital_input_action = _input_action(8)
    set_configurable_digital_input_action = _input_action(8)
    set_tool_digital_input_action = _input_action(2)
    set_gp_boolean_input_action = _input_action(128)

    set_runstate_standard_digital_output_to_value = _runstate(8)
    set_runstate_configurable_digital_output_to_value = _runstate(8)
    set_runstate_tool_digital_output_to_value = _runstate(2, states=6)
    set_runstate_gp_boolean_output_to_value = _runstate(128)
    set_runstate_standard_analog_output_to_value = _runstate(2)
    set_runstate_outputs = _runstate_list(10)
    set_runstate_standard_digital_outputs = _runstate_list(8)

    @without_effect
    def set_input_actions_to_default(self) -> None:
        """Ignore a call to remove the actions of all inputs."""

    @without_effect
    def set_tool_analog_input_domain(self, port: Value, domain: Value) -> None:
        """Check the number of a tool input, and its domain: 0 = current, 1 = voltage."""
        index(port, 'port', 2)
        index(domain, 'domain', 2)

    @without_effect
    def set_analog_inputrange(self, port: Value, range: Value) -> None:
        """Check the range of an input, and its old number: standard 0-1, tool 2-3."""
        index(port, 'port', 4)
        index(range, 'range', 5)

    @without_effect
    def set_tool_output_mode(self, mode: Value) -> None:
        """Check the use of the tool's output pins: 0 = digital outputs, 1 = power from both."""
        index(mode, 'mode', 2)

    @without_effect
    def set_tool_digital_output_mode(self, n: Value, mode: Value) -> None:
        """Check the number of a tool output, and its mode: 1 = sinking, 2 = sourcing, 3 = both."""
        index(n, 'n', 2)
        one_of(mode, 'mode', (1, 2, 3))

    @without_effect
    def set_safety_mode_transition_hardness(self, type: Value) -> None:
        """Check the kind of transition between safety modes: 0 = hard, 1 = soft."""
        index(type, 'type', 2)

    @without_effect
    def set_baselight_off(self) -> None:
        """Ignore a call to switch the light at the base off."""

    @without_effect
    def set_baselight_iec(self) -> None:
        """Ignore a call to show stops, freedrive and operational mode by the light at the base."""

    @without_effect
    def set_baselight_solid(self, r: Value, g: Value, b: Value) -> None:
        """Check the colour of the light at the base, each part 0..255."""
        for value, name in ((r, 'r'), (g, 'g'), (b, 'b')):
            index(value, name, 256)


class StoredSettingsBuiltins(BuiltinGroup):
    """
    Settings that programs can read back, and that outlive the program.

    Of these settings, only the motion version changes the simulated motions.
    """

    def motion_version_set(self, version: Value) -> None:
        """Choose the motion version by which `movej` and `movel` run from now on: 1 or 2."""
        self._controller.motion.motion_version = one_of(version, 'version', (1, 2))

    def motion_version_get(self) -> int:
        """Return the motion version of `movej` and `movel`."""
        return self._controller.motion.motion_version

    def jerk_gain_scaling_set(self, scaling: Value) -> None:
        """Store the factor (0.01..1) on the jerk of smooth moves; simulated moves ignore it."""
        self._controller.stored.jerk_gain_scaling = within(scaling, 'scaling', 0.01, 1)

    def jerk_gain_scaling_get(self) -> float:
        """Return the factor on the jerk of smooth moves."""
        return self._controller.stored.jerk_gain_scaling

    def set_base_acceleration(self, a: Value) -> None:
        """Store the acceleration of the robot's base [m/s^2]; simulated motions ignore it."""
        self._controller.stored.base_acceleration = three(a, 'a')

    def get_base_acceleration(self) -> list[float]:
        """Return the stored acceleration of the robot's base [m/s^2]."""
        return list(self._controller.stored.base_acceleration)


class EuromapBuiltins(BuiltinGroup):
    """The interface to an injection moulding machine, without the machine."""

    def __init__(self, controller: Controller) -> None:
        """Begin with all outputs low."""
        super().__init__(controller)
        self._outputs = [False] * EUROMAP_PINS

    def get_euromap_input(self, port_number: Value) -> bool:
        """Return False (low), because no machine is simulated that could set the input."""
        index(port_number, 'port_number', EUROMAP_PINS)
        return False

    def get_euromap_output(self, port_number: Value) -> bool:
        """Return the value to which an output was set."""
        return self._outputs[index(port_number, 'port_number', EUROMAP_PINS)]

    def set_euromap_output(self, port_number: Value, signal_value: Value) -> None:
        """Set an output."""
        self._outputs[index(port_number, 'port_number', EUROMAP_PINS)] = truth(signal_value)

    @without_effect
    def set_euromap_runstate_dependent_choice(
        self, port_number: Value, runstate_choice: Value
    ) -> None:
        """Check the number of an output and the number of a program state."""
        index(port_number, 'port_number', EUROMAP_PINS)
        index(runstate_choice, 'runstate_choice', EUROMAP_RUN_STATES)
