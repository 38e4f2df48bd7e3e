# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The commands ``demo``, ``send``, ``append``, ``recover`` and ``where``."""

from __future__ import annotations

import argparse
import asyncio
import contextlib
import json
from math import hypot
from pathlib import Path
import sys
from time import monotonic
from typing import Any, BinaryIO

from ur_cartesian_driver.cli.stopped_place import digest, read_place, write_place
from ur_cartesian_driver.kinematics.robot_models import JOINT_NAMES
from ur_cartesian_driver.motion.errors import ErrorCode, InvalidGoal, suggestion
from ur_cartesian_driver.motion.events import PathPlace
from ur_cartesian_driver.motion.geometry.pose import Pose
from ur_cartesian_driver.motion.state.rtde_state import RobotState
from ur_cartesian_driver.resources import share_path
from ur_cartesian_driver.robot.rtde.probe import read_state
from ur_cartesian_driver.sim.command_line.console import SIGNAL_STATUS


def demo(arguments: argparse.Namespace) -> int:
    """Run the processes of each arm with its goal, and draw the pictures."""
    from ur_cartesian_driver.cli.demo import DemoArm, run

    picture = Path(arguments.picture)
    goal = goal_file(arguments.goal)
    if arguments.arms == 1:
        return run([DemoArm(goal=goal, model=arguments.model, drawing=picture)])
    return run(
        [
            DemoArm(
                name=name,
                goal=its_goal,
                model=arguments.model,
                drawing=picture.with_stem(f'{picture.stem}_{name}'),
            )
            for name, its_goal in (('left', goal), ('right', goal_file(arguments.second_goal)))
        ]
    )


def send(arguments: argparse.Namespace) -> int:
    """Send a goal, show its progress, and wait for its result."""
    from ur_cartesian_driver.ros import client

    # The digest is taken before the motion, because the file may be edited while the arm moves. A
    # pipe has no digest, because it can be read only once.
    is_noted = arguments.file != '-' and goal_file(arguments.file).is_file()
    sent_file = digest(goal_file(arguments.file)) if is_noted else ''
    goal = whole = read_goal(arguments)
    validate_only = goal.validate_only or arguments.validate_only
    left = None
    if arguments.resume:
        place = read_place(_named_file(arguments))
        try:
            goal, left = _resumed(goal, place, arguments)
        except InvalidGoal as refusal:
            print(f'refused, {code_text(refusal.code)}: {refusal}', file=sys.stderr)
            return 1
    goal.validate_only = validate_only
    with (
        # Without a buffer, so that a full disk is noticed while the arm moves.
        open(arguments.record, 'wb', buffering=0)
        if arguments.record
        else contextlib.nullcontext() as file,
        client.GoalClient(arguments.driver) as sender,
    ):
        if arguments.wait > 0.0:
            sender.wait_ready(arguments.wait)
        code, result = sender.send(goal, FeedbackLog(file).take, cancel=not arguments.no_cancel)
    status = client.STATUS_NAMES[code]
    clear_line()
    if (goal.validate_only or arguments.report) and result.report:
        print(*result.report, sep='\n')
    if result.error_code:
        status += f', {code_text(result.error_code)}'
    if sent_file and not validate_only:
        _note_place(arguments, result, whole, left, sent_file)
    print(f'{status}: {result.error_string}')
    if status == 'SUCCEEDED':
        return 0
    return SIGNAL_STATUS + sender.signal_number if sender.signal_number else 1


def append(arguments: argparse.Namespace) -> int:
    """Append points to the goal that runs, or replace its tail; print the driver's answer."""
    from ur_cartesian_driver.ros import client

    if not arguments.file and not arguments.last:
        raise ValueError('which points? Name a file, or end the goal with --last')
    with client.GoalClient(arguments.driver) as caller:
        response = caller.append_to_running(
            read_goal(arguments) if arguments.file else None,
            last=arguments.last,
            replace_from_point=arguments.replace_from_point,
            replace_from_time=arguments.replace_from_time,
        )
    print(response.message, file=sys.stdout if response.accepted else sys.stderr)
    return 0 if response.accepted else 1


def recover(arguments: argparse.Namespace) -> int:
    """Make a stopped robot accept goals again, and print what a person still has to do."""
    from ur_cartesian_driver.ros import client

    with client.GoalClient(arguments.driver) as caller:
        response = caller.recover(unlock_protective_stop=arguments.unlock)
    print(response.message)
    return 0 if response.success else 1


def _named_file(arguments: argparse.Namespace) -> Path:
    if arguments.file == '-':
        raise ValueError('a goal from standard input cannot be resumed: name its file')
    return goal_file(arguments.file)


def _resumed(goal: Any, place: PathPlace, arguments: argparse.Namespace) -> tuple[Any, Any]:
    """
    Return the rest of a goal, as a message and as a resumed goal.

    :raises InvalidGoal: the goal cannot be resumed.
    """
    from ur_cartesian_driver.ros import client

    return client.resumed_goal(goal, place, overlap=arguments.overlap, approach=arguments.approach)


def _note_place(
    arguments: argparse.Namespace, result: Any, whole: Any, left: Any, sent_file: str
) -> None:
    """
    Note where a goal was stopped, and print how to resume it.

    :param whole: the goal of the file.
    :param left: the resumed goal that was sent; None = the whole goal was.
    :param sent_file: the digest of the file.
    """
    from ur_cartesian_driver.ros.messages.action_messages import outcome_of

    outcome = outcome_of(result)
    place = outcome.stopped
    if place is None and not outcome.succeeded:
        return  # nothing has moved, or the place is not known: an earlier note stays
    if place is not None and left is not None:
        place = left.original(place)
    if place is not None:
        try:
            _resumed(whole, place, arguments)
        except InvalidGoal as refusal:
            print(f'it cannot be resumed: {refusal}')
            place = None
    try:
        written = write_place(_named_file(arguments), place, sent_file)
    except OSError as error:
        print(f'where it was stopped cannot be noted: {error}', file=sys.stderr)
        return
    if written is not None and place is not None:
        print(
            f'stopped on the way to point {place.point}, at {100.0 * place.fraction:.1f} % of its '
            f'segment; "ur-cartesian send --resume {arguments.file}" goes on from there'
        )


def read_goal(arguments: argparse.Namespace) -> Any:
    """Return the goal message of a file, an example or standard input, changed as options say."""
    from ur_cartesian_driver.ros import client

    source = sys.stdin.read() if arguments.file == '-' else goal_file(arguments.file)
    goal = client.add_tf_prefix(client.load_goal(source), arguments.tf_prefix)
    if arguments.lead_file:
        from ur_cartesian_driver.goal_files.lead_file import read_leads

        goal = client.apply_leads(goal, read_leads(arguments.lead_file), arguments.lead_file)
    return goal


def code_text(number: int) -> str:
    """Return name and number of an error code, for example ``INVALID_GOAL (-1)``."""
    code = ErrorCode(number)
    return f'{code.name} ({code.value})'


def clear_line() -> None:
    """Clear the line that shows the progress on a terminal."""
    if sys.stdout.isatty():
        print('\r\033[K', end='')


class FeedbackLog:
    """Shows feedback on the terminal and writes it to a file, one JSON object a line."""

    def __init__(self, file: BinaryIO | None) -> None:
        """Take the file to write to; None = write no file."""
        self._file = file
        self._next_line = 0.0

    def take(self, feedback: Any) -> None:
        """
        Show and write one feedback message.

        :raises OSError: output or file cannot be written.
        """
        position = feedback.actual.pose.position
        self._show(
            f'{100.0 * feedback.progress:5.1f} %  to point {feedback.point_index}  '
            f'x {position.x:7.3f}  y {position.y:7.3f}  z {position.z:7.3f} m  '
            f'speed {100.0 * feedback.speed_scaling:3.0f} %'
        )
        if self._file is not None:
            self._write(
                {
                    'stamp': feedback.header.stamp.sec + 1e-9 * feedback.header.stamp.nanosec,
                    'point': feedback.point_index,
                    'progress': feedback.progress,
                    'desired': _position(feedback.desired),
                    'actual': _position(feedback.actual),
                    'speed': _speed(feedback.actual),
                }
            )

    def _write(self, row: dict[str, Any]) -> None:
        assert self._file is not None
        try:
            self._file.write(f'{json.dumps(row)}\n'.encode())
        except OSError as error:
            raise OSError(
                f'the recording {self._file.name} cannot be written: {error.strerror}'
            ) from None

    def _show(self, line: str) -> None:
        """Rewrite one line on a terminal; elsewhere print one line per second."""
        if sys.stdout.isatty():
            print(f'\r{line}\033[K', end='', flush=True)
        elif monotonic() >= self._next_line:
            self._next_line = monotonic() + 1.0
            print(line, flush=True)


def where(arguments: argparse.Namespace) -> int:
    """Print pose, joints and TCP of a robot."""
    state = asyncio.run(read_state(arguments.robot_ip, arguments.rtde_port))
    print(point_as_yaml(state))
    return 0


def point_as_yaml(state: RobotState) -> str:
    """Return the pose of the robot as a point of a goal, in YAML flow style."""
    x, y, z, qx, qy, qz, qw = state.actual_tcp_pose.row()
    joints = ', '.join(f'{v:.6f}' for v in state.actual_q)
    return (
        '# pose of the active TCP in the frame `base`\n'
        f'# TCP in the flange: {_pose_text(state.T_flange_tcp)}\n'
        f'- pose: {{position: {{x: {x:.6f}, y: {y:.6f}, z: {z:.6f}}}, '
        f'orientation: {{x: {qx:.9f}, y: {qy:.9f}, z: {qz:.9f}, w: {qw:.9f}}}}}\n'
        f'  posture: {{posture_joint_names: [{", ".join(JOINT_NAMES)}],\n'
        f'            posture_joint_values: [{joints}]}}'
    )


def goal_file(name: str) -> Path:
    """
    Return the path of a goal file or of an example.

    :raises OSError: neither exists.
    """
    for path in (Path(name), share_path() / 'config' / 'examples' / f'{name}.yaml'):
        if path.exists() and not path.is_dir():  # also a pipe
            return path
    if Path(name).is_dir():
        raise OSError(f'{name} is a folder; name a goal file')
    examples = sorted(p.stem for p in (share_path() / 'config' / 'examples').glob('*.yaml'))
    hint = suggestion(name, examples, f'the examples are {", ".join(examples)}')
    raise OSError(f'{name} is neither a file nor an example; {hint}')


def _position(point: Any) -> list[float]:
    position = point.pose.position
    return [position.x, position.y, position.z]


def _speed(point: Any) -> float:
    linear = point.twist.linear
    return hypot(linear.x, linear.y, linear.z)


def _pose_text(pose: Pose) -> str:
    return ' '.join(f'{v:.6f}' for v in pose.rotation_vector())
