# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The motion of the experiments ``corner_*``, and the comparison of a recording with it.

Wrist 3 turns, then wrist 2, with a rounded corner between them. This computer sends the motion
over a socket as splines of 20 ms, the pieces; the functions of the robot program follow them, as
in a goal with rounded corners.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache

import numpy as np

from ur_cartesian_driver.motion.geometry.arrays import Floats
from ur_cartesian_driver.motion.geometry.vectors import Vector6, vector6, ZERO6
from ur_cartesian_driver.motion.plan.joint_spline import JointSpline
from ur_cartesian_driver.motion.plan.primitive import Spline
from ur_cartesian_driver.program.render import MARKERS, ProgramSettings, render
from ur_cartesian_driver.protocol.program.registers import OutputInteger
from ur_cartesian_driver.protocol.program.trajectory_points import encode_points

#: Speed of the wrist that turns [rad/s].
SPEED = 0.2
#: Durations of a ramp, of a turn at constant speed, of the corner, and of a piece [s].
RAMP, CRUISE, CORNER, PIECE = 0.2, 0.2, 0.1, 0.02
#: Number of pieces; piece in which the pause is requested; number of pieces sent before the pause.
PIECES, PAUSE_IN, SENT_BEFORE_PAUSE = 45, 21, 32
#: Angle by which each wrist turns [rad].
TURN = SPEED * (0.5 * RAMP + CRUISE + 0.5 * CORNER)
#: RTDE output register with the time since the program began its current piece [s].
SPLINE_TIME = 47
#: Placeholders in the script for the address and the port to which the program connects.
HOST, PORT = '@HOST@', '@PORT@'


def corner_pieces(start: Sequence[float]) -> list[Spline]:
    """
    Return the pieces of the whole motion.

    :param start: joint positions at which the arm rests [rad].
    """
    ends = [(RAMP, 0.0, 1.0), (CRUISE, 0.0, 1.0), (CORNER, 1.0, 0.0), (CRUISE, 1.0, 0.0)]
    parts, q, speed = [], np.array(start), np.zeros(6)
    for time, second, third in [*ends, (RAMP, 0.0, 0.0)]:
        after = SPEED * np.array([0.0, 0.0, 0.0, 0.0, second, third])
        q, speed = q + 0.5 * time * (speed + after), after
        parts.append(_piece(q, speed, np.zeros(6), time))
    whole = JointSpline.of(vector6(start), parts)
    times: Floats = PIECE * np.arange(1.0, PIECES + 1.0)
    q_rows, qd_rows, qdd_rows = whole.rows(times)
    return [_piece(*row, PIECE) for row in zip(q_rows, qd_rows, qdd_rows, strict=True)]


def _piece(q: Floats, qd: Floats, qdd: Floats, duration: float) -> Spline:
    return Spline(
        target=vector6(q.tolist()),
        velocities=vector6(qd.tolist()),
        accelerations=vector6(qdd.tolist()),
        duration=duration,
    )


def corner_messages(start: Vector6) -> tuple[bytes, bytes]:
    """Return two messages: the pieces to send before the pause, and all others."""
    pieces = corner_pieces(start)
    pieces[-1] = Spline(
        target=pieces[-1].target, velocities=ZERO6, accelerations=ZERO6, duration=PIECE
    )
    return (
        encode_points(pieces[:SENT_BEFORE_PAUSE]),
        encode_points(pieces[SENT_BEFORE_PAUSE:]),
    )


@cache
def corner_script() -> str:
    """Return the body of the program, with the placeholders HOST and PORT."""
    settings = ProgramSettings(
        # A program for the oldest supported software calls only functions that every robot has.
        host='none', reverse_port=1, trajectory_port=1, script_command_port=1, version=(3, 14, 3)
    )  # fmt: skip
    text = render(settings)
    header = text[: text.index('# HEADER_END')].splitlines()
    functions = '\n'.join(line for line in header if line not in MARKERS)
    return f"""{functions}
thread ur_check_watch():
  while True:
    write_output_float_register({SPLINE_TIME}, urcd_spline_time)
    sync()
  end
end
start = get_target_joint_positions()
write_output_integer_register({int(OutputInteger.POINTS_BEGUN)}, 0)
write_output_float_register({SPLINE_TIME}, 0.0)
if socket_open("{HOST}", {PORT}, "ur_check"):
  run ur_check_watch()
  result = urcd_RESULT_SUCCESS
  left = {PIECES}
  while left > 0 and result == urcd_RESULT_SUCCESS:
    point = socket_read_binary_integer(urcd_POINT_FIELDS, "ur_check", urcd_point_timeout())
    if point[0] == urcd_POINT_FIELDS:
      left = left - 1
      urcd_begin_motion()
      result = urcd_run_spline(point, left == 0)
    else:
      result = urcd_RESULT_FAILURE
      stopj(4)
    end
  end
  urcd_end_spline()
  socket_close("ur_check")
  sleep(0.2)
  movej(start, a=0.5, v={SPEED:g})
else:
  textmsg("ur_cartesian_driver: this computer does not answer the robot at {HOST} port ", {PORT})
end"""


def distances_from_corner(q: Floats) -> Floats:
    """
    Return the distances (n,) of joint positions from the path of the motion [rad].

    :param q: joint positions (n, 6) [rad]; the first row is the start of the motion.
    """
    path = JointSpline.of(vector6(q[0].tolist()), corner_pieces(q[0].tolist()))
    places = path.rows(np.arange(0.0, PIECES * PIECE + 5e-4, 1e-3))[0]
    begins, sides = places[:-1], np.diff(places, axis=0)
    square = np.maximum(np.einsum('ij,ij->i', sides, sides), 1e-30)
    found = np.empty(len(q))
    for row, here in enumerate(q):
        share = np.clip(np.einsum('ij,ij->i', here - begins, sides) / square, 0.0, 1.0)
        found[row] = np.linalg.norm(begins + share[:, None] * sides - here, axis=1).min()
    return found
