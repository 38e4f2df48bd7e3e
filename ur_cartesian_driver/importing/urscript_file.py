# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
URScript: the program runs in our interpreter, on a simulated arm that is at each target at once.

So variables, loops, functions and poses relative to others are done as the controller does them,
and what a move leads to is collected. Nothing waits for the arm or for a person: a program that
waits for an input reads that of an arm without anything connected. The endless loop with which
programs of PolyScope end runs once.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
import functools
import inspect
from math import pi
from pathlib import Path
from typing import Any

from ur_cartesian_driver.importing.import_format import ImportFormat, term_table
from ur_cartesian_driver.importing.import_options import ImportOptions
from ur_cartesian_driver.importing.imported_path import BrokenFile, PathCollector
from ur_cartesian_driver.importing.text_file import file_lines, file_text
from ur_cartesian_driver.kinematics.inverse import nearest
from ur_cartesian_driver.kinematics.robot_models import JOINT_NAMES
from ur_cartesian_driver.motion.goal import ArcMode, IOCommand, OutputKind, Posture, SegmentType
from ur_cartesian_driver.motion.pose import IDENTITY, Pose
from ur_cartesian_driver.motion.vectors import Vector6
from ur_cartesian_driver.sim import SimulatorConfig
from ur_cartesian_driver.sim.builtins import controller_builtins
from ur_cartesian_driver.sim.builtins.arguments import (
    index,
    not_negative,
    number,
    one_of,
    six,
)
from ur_cartesian_driver.sim.builtins.kinematics_builtins import joints_of, pose_of
from ur_cartesian_driver.sim.controller import Controller
from ur_cartesian_driver.sim.motion.motion_generator import (
    DEFAULT_JOINT_ACCELERATION,
    DEFAULT_JOINT_SPEED,
)
from ur_cartesian_driver.urscript import (
    Builtin,
    CompileError,
    core_builtins,
    parse,
    parse_line,
    RuntimeException,
    ScriptInterpreter,
    ScriptProgram,
)
from ur_cartesian_driver.urscript.parsing.syntax_tree import (
    BreakStatement,
    children,
    ConstantExpression,
    ContinueStatement,
    FunctionDefinition,
    HaltStatement,
    ReturnStatement,
    SyntaxNode,
    WhileStatement,
)
from ur_cartesian_driver.urscript.script_values import truth, Value

#: A program that takes longer does not end: cycles, and moves.
MAX_CYCLES, MAX_MOVES = 100_000, 100_000
#: Of a program that never waits: what it may compute between two moves. A row of statements counts
#: as a whole, and that of a sliced part is long.
MAX_NODES = 3_000_000
#: Longer or larger numbers are millimetres or degrees [m], [rad].
FAR, MAX_ANGLE = 10.0, 4.0 * pi
#: What only computes or reads; everything else is said to be left out.
_SILENT = ('get_', 'is_', 'read_', 'pose_', 'interpolate_', 'point_', 'wrench_', 'rpy', 'rotvec')
_SILENT_NAMES = {'inv', 'sync', 'time', 'tool_contact', 'end_freedrive_mode', 'stopj', 'stopl'}
#: What waits for an arm that does not move here, or for a person.
_WAIT = {'interpreter_mode', 'popup', 'servoc', 'speedj', 'speedl', 'stopj', 'stopl'}


def collect_urscript(file: Path, options: ImportOptions, into: PathCollector) -> None:
    """
    Run a program and collect its moves.

    :raises BrokenFile: it is no program, fails, or does not end.
    """
    program = _with_one_round(_parsed(file_text(file)), into)
    config = SimulatorConfig(model=options.arm.model.name)
    controller = Controller(config, controller_builtins)
    controller.motion.T_flange_tcp = options.T_flange_tcp
    moves = _Moves(controller, into)
    builtins = moves.functions()
    try:
        interpreter = ScriptInterpreter(program, builtins, instruction_budget=MAX_NODES)
    except CompileError as error:
        raise _broken(error) from None
    moves.line = lambda: interpreter.location[0]
    for _ in range(MAX_CYCLES):
        interpreter.step()
        # The clock, for programs that wait; nothing moves.
        controller.cycles += 1
        interpreter.resume()
        if interpreter.error is not None:
            failure = interpreter.error
            raise BrokenFile(failure.line, failure.text.rstrip('.'))
        if not interpreter.running:
            return
        if len(into) > MAX_MOVES:
            break
    raise BrokenFile(
        moves.last_line,
        f'the program has not ended after {len(into)} moves; take out its endless loop',
    )


def _parsed(text: str) -> ScriptProgram:
    """Return a program, or statements without one around them, as offline programming writes."""
    lines = file_lines(text)
    begins = next((line.strip() for line in lines if line.strip() and line.strip()[0] != '#'), '')
    try:
        if begins.startswith(('def ', 'sec ')):
            try:
                return parse(text)
            except CompileError as error:
                if 'text after the end' not in error.reason:
                    raise
        return parse_line(text)
    except CompileError as error:
        raise _broken(error) from None


def _with_one_round(program: ScriptProgram, into: PathCollector) -> ScriptProgram:
    """Return a program whose last statement, if it is a loop without an end, runs once."""
    *before, last = program.body or (None,)
    if not isinstance(last, WhileStatement) or not _is_endless(last):
        return program
    into.remarks.add(last.line, 'while', 'only the first round of this endless loop is taken')
    leave = BreakStatement(line=last.line, column=last.column)
    once = replace(last, body=(*last.body, leave))
    return replace(program, body=(*before, once))


def _is_endless(loop: WhileStatement) -> bool:
    """Tell whether a loop has a constant condition, and nothing in it that ends it."""
    condition = loop.condition
    return (
        isinstance(condition, ConstantExpression)
        and truth(condition.value)
        and not any(_may_end(statement) for statement in loop.body)
    )


def _may_end(node: SyntaxNode, in_loop: bool = False) -> bool:
    """Tell whether a statement can leave the loop around it, or begin its next round."""
    if isinstance(node, FunctionDefinition):
        return False
    if isinstance(node, HaltStatement | ReturnStatement):
        return True
    if isinstance(node, BreakStatement | ContinueStatement):
        return not in_loop
    inner = in_loop or isinstance(node, WhileStatement)
    return any(_may_end(child, inner) for child in children(node))


def _broken(error: CompileError) -> BrokenFile:
    reason = error.reason or error.text.rstrip(':').replace('_', ' ')
    return BrokenFile(max(1, error.line), f'this is no URScript: {reason}')


def _at_once(function: Any) -> Any:
    """Return a function with the same parameters that does nothing and takes a cycle."""

    @functools.wraps(function)
    def pass_by(*_: Value, **__: Value) -> Any:
        yield

    return pass_by


class _Moves:
    """The functions that are collected, in place of those that move."""

    def __init__(self, controller: Controller, into: PathCollector) -> None:
        self._controller, self._into = controller, into
        self.line: Callable[[], int] = lambda: 0
        self.last_line = 0

    def functions(self) -> Mapping[str, Builtin]:
        """Return all functions of programs."""
        own: dict[str, Any] = {
            name: getattr(self, name)
            for name in (
                *('movej', 'movel', 'movep', 'movec', 'optimovej', 'optimovel', 'servoj'),
                *('set_digital_out', 'set_standard_digital_out', 'set_configurable_digital_out'),
                *('set_tool_digital_out', 'set_standard_analog_out', 'set_tcp'),
            )
        }
        own['set_analog_out'] = self.set_standard_analog_out
        quiet = core_builtins()
        found: dict[str, Any] = {}
        for name, function in controller_builtins(self._controller).items():
            silent = name in quiet or name in _SILENT_NAMES or name.startswith(_SILENT)
            does = _at_once(function) if name in _WAIT else function
            found[name] = does if silent else self._said(name, does)
        return found | own

    def _said(self, name: str, function: Any) -> Any:
        """Return a function that is also mentioned."""
        if inspect.isgeneratorfunction(function):

            @functools.wraps(function)
            def timed(*values: Value, **named: Value) -> Any:
                self._omit(name)
                return (yield from function(*values, **named))

            return timed

        @functools.wraps(function)
        def plain(*values: Value, **named: Value) -> Any:
            self._omit(name)
            return function(*values, **named)

        return plain

    def _omit(self, name: str, why: str = 'a goal has only moves and outputs') -> None:
        self._into.remarks.add(max(0, self.line()), f'{name}()', why)

    # ---- moves ---------------------------------------------------------------------------------

    def movej(
        self,
        q: Value,
        a: Value = DEFAULT_JOINT_ACCELERATION,
        v: Value = DEFAULT_JOINT_SPEED,
        t: Value = 0,
        r: Value = 0,
    ) -> Any:
        """Collect a joint motion."""
        yield from self._joints('movej', SegmentType.JOINT, q, a, v, t, r)

    def optimovej(self, goal: Value, a: Value = 0.3, v: Value = 0.3, r: Value = 0) -> Any:
        """Collect a joint motion with limited jerk."""
        yield from self._joints('optimovej', SegmentType.OPTIMIZED_JOINT, goal, a, v, 0, r)

    def movel(
        self, pose: Value, a: Value = 1.2, v: Value = 0.25, t: Value = 0, r: Value = 0
    ) -> Any:
        """Collect a line."""
        yield from self._line_to('movel', SegmentType.LINEAR, pose, a, v, t, r)

    def movep(self, pose: Value, a: Value = 1.2, v: Value = 0.25, r: Value = 0) -> Any:
        """Collect a line of a process."""
        yield from self._line_to('movep', SegmentType.PROCESS, pose, a, v, 0, r)

    def optimovel(self, goal: Value, a: Value = 0.3, v: Value = 0.3, r: Value = 0) -> Any:
        """Collect a line with limited jerk."""
        yield from self._line_to('optimovel', SegmentType.OPTIMIZED_LINEAR, goal, a, v, 0, r)

    def movec(
        self,
        pose_via: Value,
        pose_to: Value,
        a: Value = 1.2,
        v: Value = 0.25,
        r: Value = 0,
        mode: Value = 0,
    ) -> Any:
        """Collect an arc."""
        via = pose_of(self._controller, pose_via, 'pose_via')
        target = pose_of(self._controller, pose_to, 'pose_to')
        self._add(
            target,
            SegmentType.CIRCULAR,
            number(v, 'v'),
            number(a, 'a'),
            not_negative(r, 'r'),
            via=via,
            arc_mode=ArcMode(one_of(mode, 'mode', (0, 1))),
        )
        self._stand_at('movec', target)
        yield

    def servoj(
        self,
        q: Value,
        a: Value = 0,
        v: Value = 0,
        t: Value = 0.002,
        lookahead_time: Value = 0.1,
        gain: Value = 300,
    ) -> Any:
        """Go there without a move."""
        self._omit('servoj', 'a set-point is no move; the arm is taken to be there')
        self._controller.motion.teleport(six(q, 'q'))
        yield

    def _joints(
        self, name: str, kind: SegmentType, q: Value, a: Value, v: Value, t: Value, r: Value
    ) -> Any:
        motion = self._controller.motion
        target = joints_of(self._controller, q, name)
        speed = number(v, 'v')
        time = not_negative(t, 't')
        farthest = max(target, key=abs)
        if abs(farthest) > MAX_ANGLE:
            raise RuntimeException(
                f'{name} leads a joint to {farthest:g} rad; angles are in radians, d2r() converts'
            )
        if time > 0.0:
            speed = max(abs(b - c) for b, c in zip(target, motion.q, strict=True)) / time
            self._omit(name, f't = {time:g} s is taken as the mean speed')
        motion.teleport(target)
        self._add(motion.T_base_tcp, kind, speed, number(a, 'a'), not_negative(r, 'r'), q=target)
        yield

    def _line_to(
        self, name: str, kind: SegmentType, pose: Value, a: Value, v: Value, t: Value, r: Value
    ) -> Any:
        target = pose_of(self._controller, pose, 'pose')
        speed = number(v, 'v')
        time = not_negative(t, 't')
        if time > 0.0:
            speed = self._controller.motion.T_base_tcp.distance_to(target) / time
            self._omit(name, f't = {time:g} s is taken as the mean speed')
        self._add(target, kind, speed, number(a, 'a'), not_negative(r, 'r'))
        self._stand_at(name, target)
        yield

    def _add(
        self,
        target: Pose,
        kind: SegmentType,
        speed: float,
        acceleration: float,
        radius: float,
        *,
        q: Vector6 | None = None,
        via: Pose | None = None,
        arc_mode: ArcMode = ArcMode.UNCONSTRAINED,
    ) -> None:
        self.last_line = max(0, self.line())
        self._into.add(
            self.last_line,
            target.position,
            kind,
            quaternion=target.quaternion,
            via=None if via is None else via.position,
            arc_mode=arc_mode,
            posture=None if q is None else Posture(names=JOINT_NAMES, values=q),
            speed=speed,
            acceleration=acceleration,
            blend=radius,
        )

    def _stand_at(self, name: str, target: Pose) -> None:
        """Put the arm to a pose, so that the program reads it and the next one is near it."""
        motion = self._controller.motion
        farthest = max(target.position, key=abs)
        if abs(farthest) > FAR:
            raise RuntimeException(
                f'{name} leads {farthest:g} m away; lengths are in metres, 0.4 is 400 mm'
            )
        q = nearest(self._controller.arm, target @ motion.T_flange_tcp.inverse(), motion.q)
        if q is None:
            raise RuntimeException(f'{name} leads to a pose that the arm cannot reach')
        motion.teleport(q)

    # ---- outputs and tool ----------------------------------------------------------------------

    def set_digital_out(self, n: Value, b: Value) -> None:
        """Collect an output by its old number: 8 and 9 are those of the tool."""
        pin = index(n, 'n', 10)
        if pin < 8:
            self._switch(OutputKind.STANDARD_DIGITAL, pin, truth(b))
        else:
            self._switch(OutputKind.TOOL_DIGITAL, pin - 8, truth(b))

    def set_standard_digital_out(self, n: Value, b: Value) -> None:
        """Collect an output."""
        self._switch(OutputKind.STANDARD_DIGITAL, index(n, 'n', 8), truth(b))

    def set_configurable_digital_out(self, n: Value, b: Value) -> None:
        """Collect an output."""
        self._switch(OutputKind.CONFIGURABLE_DIGITAL, index(n, 'n', 8), truth(b))

    def set_tool_digital_out(self, n: Value, b: Value) -> None:
        """Collect an output."""
        self._switch(OutputKind.TOOL_DIGITAL, index(n, 'n', 2), truth(b))

    def set_standard_analog_out(self, n: Value, f: Value) -> None:
        """Collect an output: a fraction of its range."""
        value = number(f, 'f')
        if not 0.0 <= value <= 1.0:
            raise RuntimeException(f'f is {value:g}; it must be within 0..1')
        self._switch(OutputKind.STANDARD_ANALOG, index(n, 'n', 2), value)

    def _switch(self, kind: OutputKind, pin: int, value: float) -> None:
        self._into.switch(
            IOCommand(waypoint=0, offset=0.0, output=kind, pin=pin, value=float(value))
        )

    def set_tcp(self, pose: Value, tcp_name: Value = '') -> None:
        """Move the arm's tool; the robot has to have it too."""
        offset = Pose.from_rotation_vector(six(pose, 'pose'))
        motion = self._controller.motion
        if offset != motion.T_flange_tcp:
            numbers = ', '.join(f'{value:g}' for value in six(pose, 'pose'))
            self._omit(
                'set_tcp', f'set the active TCP to p[{numbers}], to which the points belong'
            )
        motion.T_flange_tcp = offset if any(six(pose, 'pose')) else IDENTITY


FORMAT = ImportFormat(
    name='urscript',
    suffixes=('.script', '.urscript'),
    terms=term_table(),
    others='Every other function is left out, and said.',
    collect=collect_urscript,
)
