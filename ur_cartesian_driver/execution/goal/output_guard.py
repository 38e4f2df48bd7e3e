# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The outputs of a goal that have to be safe whenever its motion does not go on as planned.

The robot program gets the safe values before the motion; whichever of its threads stops the arm
also sets the outputs. A program that is paused or gone runs no thread: then the driver writes
the values to the robot. An order is regarded as carried out only once it is confirmed: the robot
program confirms it by a token, the driver by the list of outputs that its write has changed.
"""

from __future__ import annotations

from ur_cartesian_driver.execution.goal.goal_commands import (
    GoalCommand,
    RestoreOutputs,
    SecureOutputs,
    SendSafeOutputs,
)
from ur_cartesian_driver.motion.events import OutputsSecured
from ur_cartesian_driver.motion.goal.goal import OutputKind, SafeOutput
from ur_cartesian_driver.motion.state.rtde_state import (
    MOVABLE_SAFETY_MODES,
    RobotState,
    RuntimeState,
)
from ur_cartesian_driver.protocol.program.script_command import SafeOutputsAction

_PAUSED = frozenset({RuntimeState.PAUSING, RuntimeState.PAUSED})


class OutputGuard:
    """Tracks whether the robot program has the values, and which outputs a pause has changed."""

    def __init__(
        self,
        outputs: tuple[SafeOutput, ...],
        packet: RobotState,
        own: frozenset[tuple[OutputKind, int]] = frozenset(),
    ) -> None:
        """
        Keep the outputs of a goal; without outputs the guard does nothing.

        :param packet: the newest packet of the robot.
        :param own: the outputs that follow the speed or give pulses; they are not restored after
            a pause, because the robot program writes them again.
        """
        self._outputs, self._own = outputs, own
        self._token = packet.safe_outputs_token
        self._is_held = False
        #: Whether the driver's write was ordered, in this pause or at the end of the goal.
        self._is_ordered = False
        #: The outputs that the driver's write has changed, with their previous values.
        self._changed: tuple[SafeOutput, ...] = ()

    def __bool__(self) -> bool:
        """Return whether the goal has safe outputs."""
        return bool(self._outputs)

    # ---- the robot program --------------------------------------------------------------------

    def arm(self) -> list[GoalCommand]:
        """Return the command that gives the safe values to the robot program."""
        return self._order(SafeOutputsAction.ARM)

    def release(self, *, succeeded: bool) -> list[GoalCommand]:
        """
        Return the command for the robot program at the end of the goal.

        After a success the outputs stay as they are, otherwise the robot program makes them safe.
        """
        return self._order(SafeOutputsAction.DISARM if succeeded else SafeOutputsAction.SET)

    def is_confirmed(self, packet: RobotState | None) -> bool:
        """Return whether the robot program has carried out the last order."""
        return not self or (packet is not None and packet.safe_outputs_token == self._token)

    def _order(
        self, action: SafeOutputsAction, outputs: tuple[SafeOutput, ...] | None = None
    ) -> list[GoalCommand]:
        """Return an order to the robot program; ``outputs``: None = all outputs of the goal."""
        if not self:
            return []
        # The token wraps around within an int32; 0 is the token of a new program.
        self._token = self._token % (2**31 - 1) + 1
        given = self._outputs if outputs is None else outputs
        return [SendSafeOutputs(action=action, token=self._token, outputs=given)]

    # ---- the driver ---------------------------------------------------------------------------

    def secure(self) -> list[GoalCommand]:
        """Return the command to write the safe values, once per pause and once at the end."""
        if self._is_ordered or not self:
            return []
        self._is_ordered = True
        return [SecureOutputs(outputs=self._outputs)]

    def observe(self, packet: RobotState, *, goes_on: bool) -> list[GoalCommand]:
        """
        Process a packet of the robot: secure the outputs in a pause, restore them after it.

        :param goes_on: whether the goal goes on after a pause.
        """
        if not self._outputs:
            return []
        is_held = packet.runtime_state in _PAUSED or packet.safety_mode not in MOVABLE_SAFETY_MODES
        was_held, self._is_held = self._is_held, is_held
        if is_held:
            return self.secure()
        if was_held:
            self._is_ordered = False
        return self._restore() if goes_on else []

    def take(self, event: OutputsSecured) -> None:
        """Note which outputs the driver's write has changed."""
        self._changed = event.changed

    def fault(self) -> str:
        """Return the reason why the goal cannot go on after a pause, as a clause, or ''."""
        if self._is_held or not self._changed:
            return ''
        lost = [output for output in self._changed if not output.restore]
        if not lost:
            return ''
        kind = lost[0].output.name.lower().replace('_', ' ')
        return (
            f'a pause has changed the {kind} output {lost[0].pin}, which safe_outputs does not '
            'name as one to be restored'
        )

    def _restore(self) -> list[GoalCommand]:
        """Restore the outputs that a pause has changed, if the goal allows it for all of them."""
        if not self._changed or self.fault():
            return []
        changed, self._changed = self._changed, ()
        restored = tuple(
            output for output in changed if (output.output, output.pin) not in self._own
        )
        if not restored:
            return []
        return [RestoreOutputs(), *self._order(SafeOutputsAction.RESTORE, restored)]
