# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The one-line commands that clients can send to a script port in addition to programs.

Any other single line is a statement: it is compiled as a separate program, which replaces the
running program, as on the robot. All input of a client that connected in local control is refused.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

from ur_cartesian_driver.sim.controller import Controller
from ur_cartesian_driver.sim.programs.script_upload import (
    UploadedItem,
    UploadedProgram,
    UploadTooLong,
)

#: Error code of a script port that is read-only.
READ_ONLY = 210

#: The number follows; in published programs, without a blank before it.
_SET_SPEED = 'set speed'
_CONTROL: Mapping[str, Callable[[Controller], object]] = {
    'power on': Controller.power_on,
    'power off': Controller.power_off,
    # A real robot asks for this after it is switched on; the simulator does not.
    'confirm user safety parameters': lambda _: None,
    'set robotmode run': Controller.release_brakes,
    'set unlock protective stop': Controller.unlock_soon,
    'stop program': lambda controller: controller.programs.stop(),
    'pause program': lambda controller: controller.programs.pause(),
    'resume program': lambda controller: controller.programs.unpause(),
    # On a robot, motions then go to the arm or only to the screen; here, always to the arm.
    'set real': lambda _: None,
    'set sim': lambda _: None,
}


def execute_command(controller: Controller, item: UploadedItem, *, may_send: bool) -> None:
    """
    Execute a program, line or command that a client has sent; answers go to all clients.

    :param may_send: False = the connection of the client is read-only.
    """
    if not may_send:
        controller.messages.error(
            READ_ONLY, 0, 'Socket is read-only when the robot is in local (Teach pendant) control'
        )
    elif isinstance(item, UploadTooLong):
        controller.messages.text(item.text)
    elif isinstance(item, UploadedProgram):
        controller.programs.submit(item.text)
    elif item.text in _CONTROL:
        refusal = _CONTROL[item.text](controller)
        if refusal:
            controller.messages.text(f'{item.text}: refused, {refusal}.')
    elif item.text.startswith(_SET_SPEED):
        _set_speed(controller, item.text.removeprefix(_SET_SPEED).strip())
    else:
        controller.programs.submit(item.text, is_line=True)


def _set_speed(controller: Controller, argument: str) -> None:
    try:
        controller.set_slider(float(argument))
    except ValueError:
        controller.messages.text(f'set speed: {argument!r} is not a number.')
