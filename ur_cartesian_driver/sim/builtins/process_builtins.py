# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Functions for processes: path offset, screws, force limits, reaction to error codes.

Arguments are checked as on the robot. The functions for screws, forces and torques have no effect,
because the arm has no dynamics. The path offset displaces the target
(:mod:`~ur_cartesian_driver.sim.motion.controller_offset`); it ends with the program.
"""

from __future__ import annotations

from ur_cartesian_driver.sim.builtins.arguments import (
    not_negative,
    number,
    one_of,
    pose,
    positive,
    six,
    whole,
    within,
)
from ur_cartesian_driver.sim.builtins.builtin_group import BuiltinGroup, without_effect
from ur_cartesian_driver.sim.motion.controller_offset import ControllerPathOffset, FRAMES
from ur_cartesian_driver.sim.motion.motion_ownership import Steps
from ur_cartesian_driver.urscript.script_errors import RuntimeException
from ur_cartesian_driver.urscript.script_values import ScriptPose, Value


class PathOffsetBuiltins(BuiltinGroup):
    """A Cartesian offset that is added to the moves."""

    @property
    def _offset(self) -> ControllerPathOffset:
        return self._controller.motion.path_offset

    def path_offset_enable(self) -> None:
        """Enable the path offset with the present limits and filter."""
        self._offset.enabled = True

    def path_offset_disable(self, a: Value = 20) -> Steps:
        """Disable the path offset and brake in joint space; return when the arm is at rest."""
        acceleration, controller = positive(a, 'a'), self._controller
        controller.ownership.take(controller.programs.current_thread)
        yield from controller.ownership.run(
            lambda: controller.motion.end_path_offset(acceleration)
        )

    def path_offset_set(self, offset: Value, type: Value) -> None:
        """Set the offset in the frame `type`, clamped to the limits along and about each axis."""
        frame, wanted = _frame(type), six(offset, 'offset')
        if not self._offset.enabled:
            raise RuntimeException('path_offset_set needs path_offset_enable before it.')
        self._offset.set(frame, wanted)

    def path_offset_get(self, type: Value) -> ScriptPose:
        """Return the currently applied offset, expressed in the frame `type`."""
        return ScriptPose(*self._offset.applied(_frame(type)))

    def path_offset_set_alpha_filter(self, alpha: Value) -> None:
        """Set the coefficient of the offset's filter, 0..1; 1 = no filter."""
        self._offset.alpha = within(alpha, 'alpha', 0, 1)

    def path_offset_set_max_offset(self, transLimit: Value, rotLimit: Value) -> None:
        """Set the limits of the offset: along each axis [m], and about each axis [rad]."""
        self._offset.max_translation = not_negative(transLimit, 'transLimit')
        self._offset.max_rotation = not_negative(rotLimit, 'rotLimit')


def _frame(type: Value) -> int:
    return one_of(type, 'type', FRAMES)


class ProcessBuiltins(BuiltinGroup):
    """Arguments for screws and torques are only checked; `pause_on_error_code` takes effect."""

    @without_effect
    def screw_driving(self, f: Value, v_limit: Value) -> None:
        """Check the force along the tool's z axis [N] and the speed limit [m/s]."""
        number(f, 'f')
        not_negative(v_limit, 'v_limit')

    @without_effect
    def end_screw_driving(self) -> None:
        """Ignore a call to end screw driving."""

    @without_effect
    def tool_wrench_limit_set(
        self,
        frame_offset: Value,
        Fx: Value = None,
        Fy: Value = None,
        Fz: Value = None,
        Mx: Value = None,
        My: Value = None,
        Mz: Value = None,
    ) -> None:
        """
        Check the limits of the forces [N] and torques [Nm] due to acceleration.

        :param frame_offset: pose of the frame of the limits, relative to the flange.
        """
        pose(frame_offset, 'frame_offset')
        names = ('Fx', 'Fy', 'Fz', 'Mx', 'My', 'Mz')
        given = zip(names, (Fx, Fy, Fz, Mx, My, Mz), strict=True)
        for name, value in given:
            if value is not None:
                not_negative(value, name)

    @without_effect
    def tool_wrench_limit_disable(self) -> None:
        """Ignore a call to remove the limits of `tool_wrench_limit_set`."""

    @without_effect
    def high_holding_torque_enable(self) -> None:
        """Ignore a call to hold an arm at rest with high torque, which is the default."""

    @without_effect
    def high_holding_torque_disable(self) -> None:
        """Ignore a call to hold an arm at rest with normal torque until the program ends."""

    @without_effect
    def position_deviation_warning(self, enabled: Value, threshold: Value = 0.8) -> None:
        """Accept a threshold within 0..1; deviations never cause a warning here."""
        within(threshold, 'threshold', 0, 1)

    def pause_on_error_code(self, code: Value, argument: Value = None) -> None:
        """Pause the program when an error with this code and argument (None = any) occurs."""
        self._controller.process.pause_on.add(
            (whole(code, 'code'), None if argument is None else whole(argument, 'argument'))
        )
