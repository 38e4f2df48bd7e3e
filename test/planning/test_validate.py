# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Every reason to refuse a goal without a robot: its class, and the place that its text names."""

from __future__ import annotations

from dataclasses import replace
from math import inf, nan

from hypothesis import given, settings
from hypothesis import strategies as st
import pytest

from ur_cartesian_driver.motion.errors import (
    InvalidGoal,
    InvalidJoints,
    NotAvailable,
    OldHeaderTimestamp,
)
from ur_cartesian_driver.motion.geometry.pose import Pose
from ur_cartesian_driver.motion.goal.execution_modes import ExecutionMode
from ur_cartesian_driver.motion.goal.goal import (
    ArcMode,
    FeedOverride,
    FreeAxis,
    Goal,
    InputKind,
    InputWait,
    IOCommand,
    OnPathTolerance,
    OutputKind,
    PathOffset,
    PayloadChange,
    Posture,
    Press,
    ProportionalOutput,
    SafeOutput,
    ScriptCall,
    Segment,
    SegmentType,
    Tolerance,
    Waypoint,
)
from ur_cartesian_driver.motion.goal.goal_columns import goal_table
from ur_cartesian_driver.motion.goal.leads import Lead
from ur_cartesian_driver.motion.goal.moving_frame import MovingFrame
from ur_cartesian_driver.planning import check, PlanningOptions
from ur_cartesian_driver.planning.request.goal_fields import resolve_execution_mode
from ur_cartesian_driver.planning.request.validate import FIELD_RULES, RULES
from ur_cartesian_driver.program.prelude import NO_PRELUDE, Prelude, PreludeFunction
from ur_cartesian_driver.protocol.program.wire_dialects import DIALECTS

PRELUDE = Prelude(
    file='gripper.script',
    functions=(
        PreludeFunction(name='open'),
        PreludeFunction(name='close', required=1, allowed=2),
    ),
)
OPTIONS = PlanningOptions(max_points=10, prelude=PRELUDE)
TYPE = SegmentType


def at(x, y=0.0, z=0.0, time=0.0, **fields):
    return Waypoint(pose=Pose((x, y, z)), time=time, **fields)


GLUE = SafeOutput(output=OutputKind.STANDARD_DIGITAL, pin=3, value=0.0)
VALVE = IOCommand(waypoint=0, offset=0.0, output=OutputKind.STANDARD_DIGITAL, pin=3, value=1.0)
BEAD = ProportionalOutput(first_waypoint=0, last_waypoint=2, pin=1, gain=2.0)
BURNING = InputWait(waypoint=1, input=InputKind.STANDARD_DIGITAL, pin=3, value=1.0, timeout=2.0)
HELD = MovingFrame(T_flange_frame=Pose((0.0, 0.0, 0.1)), T_base_tool=Pose((0.5, 0.0, 0.3)))
GRIND = Press(first_waypoint=0, last_waypoint=1, axes=('z',), forces=(20.0,))
PLAIN = Goal(waypoints=(at(0.1), at(0.2), at(0.3)))
TIMED = Goal(waypoints=(at(0.1, time=1.0), at(0.2, time=2.0), at(0.3, time=3.0)))
SPLINE = replace(TIMED, execution=ExecutionMode.SPLINE)
SIDEWAYS = (0.0, 0.005, 0.0)
PATIENT = replace(
    TIMED,
    execution=ExecutionMode.SERVO,
    path_tolerance=Tolerance(position=(0.001, 0.0, 0.0)),
    on_path_tolerance=OnPathTolerance.STALL,
)


def with_fields(goal, **fields):
    return replace(goal, **fields)


def pressing(**fields):
    return replace(PLAIN, presses=(replace(GRIND, **fields),))


def with_point(goal, index, **fields):
    points = list(goal.waypoints)
    points[index] = replace(points[index], **fields)
    return replace(goal, waypoints=tuple(points))


def with_segment(goal, index, **fields):
    segments = [Segment()] * len(goal.waypoints)
    segments[index] = Segment(**fields)
    return replace(goal, segments=tuple(segments))


def turned(*quaternion):
    return Pose((0.1, 0.0, 0.0), quaternion)


SIX_NAN = (0.0, 0.0, nan, 0.0, 0.0, 0.0)
ONE = (0.1, 0.0, 0.0, 0.0, 0.0, 0.0)
VIA = Pose((0.15, 0.05, 0.0))
FREE = {'free_axis': FreeAxis.Z}
ARC = {'type': TYPE.CIRCULAR, 'via': VIA}

REFUSALS = [
    # joint positions in place of a pose
    (
        with_point(PLAIN, 1, pose=Pose((nan,) * 3, (nan,) * 4)),
        InvalidGoal,
        'the posture names 0 of the 6 joints; name all joints, or give the pose',
    ),
    # rounded corners
    (
        replace(
            PLAIN,
            corner_deviation=1e-3,
            segments=(Segment(), Segment(blend_radius=0.01), Segment()),
        ),
        InvalidGoal,
        'segments[1].blend_radius is 0.01 m, but corner_deviation rounds the corners of this goal',
    ),
    (
        with_segment(PLAIN, 1, corner_angle=0.1),
        InvalidGoal,
        'segments[1].corner_angle is 0.1 rad, but without corner_deviation the arm rounds no',
    ),
    (
        replace(PLAIN, corner_angle=0.2),
        InvalidGoal,
        'corner_angle is 0.2 rad, but without corner_deviation the arm rounds no corner there',
    ),
    # number of things
    (Goal(waypoints=()), InvalidGoal, 'trajectory.points is empty'),
    (
        Goal(waypoints=tuple(at(0.01 * i) for i in range(11))),
        InvalidGoal,
        'trajectory.points has 11 points, more than max_points = 10',
    ),
    (
        replace(PLAIN, T_base_frame=Pose((nan, 0.0, 0.0))),
        InvalidGoal,
        'the pose of trajectory.header.frame_id contains nan',
    ),
    (
        replace(PLAIN, T_flange_controlled=turned(0.0, 0.0, 0.0, 2.0)),
        InvalidGoal,
        'the orientation of trajectory.controlled_frame has length 2',
    ),
    (
        replace(PLAIN, segments=(Segment(), Segment())),
        InvalidGoal,
        'segments has 2 entries for 3 points',
    ),
    # unknown numbers
    (with_fields(PLAIN, execution=7), InvalidGoal, 'execution is 7; allowed are AUTO = 0'),
    (with_segment(PLAIN, 1, type=9), InvalidGoal, 'segments[1].type is 9'),
    (with_segment(PLAIN, 1, **ARC, arc_mode=2), InvalidGoal, 'segments[1].arc_mode is 2'),
    (with_segment(PLAIN, 1, free_axis=4), InvalidGoal, 'segments[1].free_axis is 4; allowed are'),
    (with_fields(PLAIN, on_path_tolerance=3), InvalidGoal, 'on_path_tolerance is 3; allowed are'),
    (
        with_fields(PLAIN, path_offset=with_fields(PathOffset(), on_stale=7)),
        InvalidGoal,
        'path_offset.on_stale is 7; allowed are',
    ),
    (pressing(frame=7), InvalidGoal, 'presses[0].frame is 7; allowed are'),
    (pressing(contact=7), InvalidGoal, 'presses[0].contact is 7; allowed are'),
    *(
        (
            with_fields(PLAIN, **{name: (with_fields(entry, **{field: 7}),)}),
            InvalidGoal,
            f'{name}[0].{field.replace("domain", "analog_domain")} is 7; allowed are',
        )
        for name, entry, field in (
            ('input_waits', BURNING, 'input'),
            ('io_commands', VALVE, 'output'),
            ('io_commands', VALVE, 'domain'),
            ('safe_outputs', GLUE, 'output'),
            ('safe_outputs', GLUE, 'domain'),
            ('proportional_outputs', BEAD, 'domain'),
        )
    ),
    # free axes
    (
        with_segment(PLAIN, 1, free_max=1.0),
        InvalidGoal,
        'segments[1].free_max is set, but free_axis is NONE',
    ),
    (
        with_segment(PLAIN, 1, **FREE, free_min=0.5, free_max=0.4),
        InvalidGoal,
        'segments[1].free_min is 0.5 rad, more than free_max = 0.4 rad',
    ),
    (
        with_segment(PLAIN, 1, **FREE, free_min=-90.0, free_max=90.0),
        InvalidGoal,
        'segments[1].free_min is -90 rad, more than a full turn; give radians, not degrees',
    ),
    (
        with_segment(PLAIN, 1, **FREE, free_min=-4.0, free_max=4.0),
        InvalidGoal,
        'segments[1].free_max is 8 rad above free_min, more than a full turn',
    ),
    (
        with_segment(PLAIN, 1, **FREE, free_max=inf),
        InvalidGoal,
        'segments[1].free_max contains inf',
    ),
    (
        with_segment(PLAIN, 1, **ARC, **FREE, arc_mode=ArcMode.FIXED),
        InvalidGoal,
        'segments[1].arc_mode is FIXED, which ties the tool to the arc',
    ),
    (
        replace(
            PLAIN,
            segments=(
                Segment(free_axis=FreeAxis.Z),
                Segment(type=TYPE.CIRCULAR, via=VIA, arc_mode=ArcMode.FIXED),
                Segment(),
            ),
        ),
        InvalidGoal,
        'segments[1].arc_mode is FIXED, which takes its orientation from points[0]',
    ),
    (
        replace(
            PLAIN,
            segments=(Segment(free_axis=FreeAxis.Z), Segment(), Segment(free_axis=FreeAxis.X)),
        ),
        InvalidGoal,
        'segments[2].free_axis is X, but that of another segment is Z',
    ),
    (
        replace(with_segment(PLAIN, 1, **FREE), keep_open=True),
        NotAvailable,
        'segments[1].free_axis is set in a goal with keep_open',
    ),
    # not finite
    (with_point(PLAIN, 2, time=nan), InvalidGoal, 'trajectory.points[2].time_from_start contains'),
    (
        with_point(PLAIN, 1, pose=Pose((0.0, nan, 0.0))),
        InvalidGoal,
        'trajectory.points[1].pose.position contains nan',
    ),
    (
        with_point(PLAIN, 2, pose=turned(0.0, inf, 0.0, 1.0)),
        InvalidGoal,
        'trajectory.points[2].pose.orientation contains inf',
    ),
    (with_point(PLAIN, 0, twist=SIX_NAN), InvalidGoal, 'trajectory.points[0].twist contains nan'),
    (
        with_point(PLAIN, 0, acceleration=SIX_NAN),
        InvalidGoal,
        'trajectory.points[0].acceleration contains nan',
    ),
    (with_point(PLAIN, 0, jerk=SIX_NAN), InvalidGoal, 'trajectory.points[0].jerk contains nan'),
    (with_segment(PLAIN, 1, velocity=inf), InvalidGoal, 'segments[1].velocity contains inf'),
    (with_segment(PLAIN, 1, acceleration=nan), InvalidGoal, 'segments[1].acceleration contains'),
    (with_segment(PLAIN, 1, blend_radius=nan), InvalidGoal, 'segments[1].blend_radius contains'),
    (
        with_segment(PLAIN, 1, type=TYPE.CIRCULAR, via=Pose((nan, 0.0, 0.0))),
        InvalidGoal,
        'segments[1].via.position contains nan',
    ),
    (
        replace(PLAIN, path_tolerance=Tolerance(position=(0.0, nan, 0.0))),
        InvalidGoal,
        'path_tolerance.position_error contains nan',
    ),
    (
        replace(PLAIN, goal_tolerance=Tolerance(orientation=(inf, 0.0, 0.0))),
        InvalidGoal,
        'goal_tolerance.orientation_error contains inf',
    ),
    (
        replace(PLAIN, goal_tolerance=Tolerance(twist=SIX_NAN)),
        InvalidGoal,
        'goal_tolerance.twist_error contains nan',
    ),
    (
        replace(PLAIN, path_tolerance=Tolerance(acceleration=SIX_NAN)),
        InvalidGoal,
        'path_tolerance.acceleration_error contains nan',
    ),
    (replace(PLAIN, goal_time_tolerance=nan), InvalidGoal, 'goal_time_tolerance contains nan'),
    (replace(PLAIN, min_speed_fraction=nan), InvalidGoal, 'min_speed_fraction contains nan'),
    (replace(PLAIN, min_speed_fraction=1.5), InvalidGoal, 'min_speed_fraction is 1.5, but must'),
    (replace(PLAIN, min_speed_fraction=-0.1), InvalidGoal, 'min_speed_fraction is -0.1, but must'),
    (
        replace(PLAIN, min_speed_fraction=0.9, keep_open=True),
        InvalidGoal,
        'the points of a goal with keep_open are not all known',
    ),
    (replace(PLAIN, replace_horizon=nan), InvalidGoal, 'replace_horizon contains nan'),
    (
        replace(PLAIN, replace_horizon=0.01),
        InvalidGoal,
        'replace_horizon is 0.01 s, but must be 0',
    ),
    (
        replace(PLAIN, replace_horizon=0.15),
        InvalidGoal,
        'only points of a goal with keep_open can',
    ),
    # a travel at the beginning
    (
        replace(PLAIN, allow_travel=True, keep_open=True),
        NotAvailable,
        'allow_travel is set, but points of a goal with keep_open are planned one by one',
    ),
    (replace(PLAIN, age=nan), InvalidGoal, 'trajectory.header.stamp contains nan'),
    # quaternions
    (
        with_point(PLAIN, 2, pose=turned(0.0, 0.0, 0.0, 0.0)),
        InvalidGoal,
        'trajectory.points[2].pose.orientation is zero',
    ),
    (
        with_point(PLAIN, 2, pose=turned(0.0, 0.0, 0.0, 1.002)),
        InvalidGoal,
        'trajectory.points[2].pose.orientation has length 1.002',
    ),
    (
        with_segment(
            PLAIN, 1, type=TYPE.CIRCULAR, via=Pose((0.1, 0.1, 0.0), (0.0, 0.0, 0.0, 0.0))
        ),
        InvalidGoal,
        'segments[1].via.orientation is zero',
    ),
    # negative
    (with_segment(PLAIN, 1, velocity=-0.1), InvalidGoal, 'segments[1].velocity is -0.1'),
    (with_segment(PLAIN, 1, acceleration=-1.0), InvalidGoal, 'segments[1].acceleration is -1'),
    (with_segment(PLAIN, 1, blend_radius=-0.01), InvalidGoal, 'segments[1].blend_radius is -0.01'),
    # stamps
    (replace(PLAIN, age=1.5), OldHeaderTimestamp, 'header.stamp is 1.500 s old'),
    (replace(PLAIN, age=-61.0), InvalidGoal, 'trajectory.header.stamp is 61.0 s in the future'),
    # a part in the hand
    (
        with_segment(replace(PLAIN, moving_frame=HELD), 1, type=SegmentType.JOINT),
        NotAvailable,
        'segments[1].type is JOINT, which turns the part that the arm holds, and the moves of the '
        'controller, which PRIMITIVES sends, lead a part only without turning it; use LINEAR, '
        'PROCESS or an UNCONSTRAINED arc, or set execution to SPLINE or SERVO, with times or a '
        'corner_deviation.',
    ),
    (
        with_segment(
            replace(PLAIN, moving_frame=HELD),
            2,
            type=SegmentType.CIRCULAR,
            via=Pose((0.25, 0.1, 0.0)),
            arc_mode=ArcMode.FIXED,
        ),
        NotAvailable,
        'segments[2].arc_mode is FIXED, which turns the part that the arm holds, and the moves',
    ),
    (
        replace(PLAIN, moving_frame=HELD, allow_travel=True),
        NotAvailable,
        'allow_travel is set, but the path is on a part that the arm holds, and a travel turns '
        'it; lead there by a goal of its own.',
    ),
    (
        replace(PLAIN, moving_frame=HELD, path_offset=PathOffset(limits=SIDEWAYS, timeout=1.0)),
        NotAvailable,
        'path_offset is set, but the path is on a part that the arm holds, and the controller, '
        'which offsets PRIMITIVES, knows nothing of the frame on the part; set execution to SERVO',
    ),
    (
        replace(SPLINE, moving_frame=HELD, presses=(GRIND,)),
        NotAvailable,
        'presses is not empty, but SPLINE follows joint positions, which do not give way',
    ),
    (
        replace(PLAIN, moving_frame=replace(HELD, T_base_tool=Pose((nan, 0.0, 0.0)))),
        InvalidGoal,
        'the pose of trajectory.controlled_frame contains nan',
    ),
    # not there yet
    (
        replace(TIMED, keep_open=True, replace_horizon=0.15, execution=ExecutionMode.PRIMITIVES),
        NotAvailable,
        'replace_horizon is 0.15 s, but motions of the robot, which PRIMITIVES sends, cannot be',
    ),
    (
        replace(
            TIMED,
            execution=ExecutionMode.SERVO,
            keep_open=True,
            io_commands=(
                IOCommand(
                    waypoint=0, offset=0.0, output=OutputKind.TOOL_DIGITAL, pin=0, value=1.0
                ),
            ),
        ),
        NotAvailable,
        'io_commands is not empty, but a SERVO goal with keep_open switches no outputs; set',
    ),
    (
        replace(PLAIN, safe_outputs=(replace(GLUE, pin=8),)),
        InvalidGoal,
        'safe_outputs[0].pin is 8, but there are standard digital outputs 0 to 7; name one of',
    ),
    (
        replace(PLAIN, safe_outputs=(replace(GLUE, value=0.5),)),
        InvalidGoal,
        'safe_outputs[0].value is 0.5; a standard digital output takes 0 (off) or 1 (on)',
    ),
    (
        replace(PLAIN, safe_outputs=(GLUE, replace(GLUE, value=1.0))),
        InvalidGoal,
        'safe_outputs[1] names standard digital output 3 again; name it once',
    ),
    (
        replace(PLAIN, controlled_frame='nozzle'),
        InvalidGoal,
        "trajectory.controlled_frame is 'nozzle'",
    ),
    # splines
    (
        replace(PLAIN, execution=ExecutionMode.SPLINE),
        InvalidGoal,
        'execution is SPLINE, which needs times',
    ),
    (
        replace(PLAIN, execution=ExecutionMode.SERVO),
        InvalidGoal,
        'execution is SERVO, which needs times',
    ),
    (
        with_point(with_point(TIMED, 0, twist=ONE), 2, twist=ONE),
        InvalidGoal,
        'trajectory.points[2].twist is not zero, but the motion ends at rest there',
    ),
    (
        with_point(SPLINE, 2, acceleration=ONE),
        InvalidGoal,
        'trajectory.points[2].acceleration is not zero, but the motion ends at rest there',
    ),
    (
        with_point(SPLINE, 0, time=0.0, twist=ONE),
        InvalidGoal,
        'trajectory.points[0].twist is not zero, but the motion starts at rest there',
    ),
    (
        with_segment(SPLINE, 1, type=TYPE.JOINT),
        InvalidGoal,
        'segments[1].type is JOINT, but with execution SPLINE',
    ),
    (with_segment(SPLINE, 1, **ARC), InvalidGoal, 'segments[1].type is CIRCULAR, but'),
    (
        with_segment(SPLINE, 1, blend_radius=0.01),
        InvalidGoal,
        'segments[1].blend_radius is 0.01, but with execution SPLINE',
    ),
    (
        with_segment(SPLINE, 1, velocity=0.1),
        InvalidGoal,
        'segments[1].velocity is 0.1, but the times',
    ),
    (
        with_point(SPLINE, 1, time=1.0005),
        InvalidGoal,
        'points[1].time_from_start gives the segment 0.0005 s',
    ),
    (
        with_point(SPLINE, 1, twist=(inf, *ONE[1:])),
        InvalidGoal,
        'trajectory.points[1].twist contains inf',
    ),
    (with_point(SPLINE, 1, jerk=SIX_NAN), InvalidGoal, 'trajectory.points[1].jerk contains nan'),
    (with_point(TIMED, 2, twist=SIX_NAN), InvalidGoal, 'trajectory.points[2].twist contains nan'),
    (
        with_point(replace(TIMED, execution=ExecutionMode.PRIMITIVES), 1, acceleration=SIX_NAN),
        InvalidGoal,
        'trajectory.points[1].acceleration contains nan',
    ),
    # times
    (with_point(TIMED, 2, time=2.0), InvalidGoal, 'trajectory.points[2].time_from_start is 2 s'),
    (
        replace(with_point(TIMED, 2, time=2.0), execution=ExecutionMode.SPLINE),
        InvalidGoal,
        'not later than the 2 s of points[1]; increase it.',
    ),
    (with_point(TIMED, 1, time=0.5), InvalidGoal, 'trajectory.points[1].time_from_start is 0.5 s'),
    (with_point(TIMED, 2, time=0.0), InvalidGoal, 'trajectory.points[2].time_from_start is 0 s'),
    (with_point(PLAIN, 2, time=1.0), InvalidGoal, 'trajectory.points[1].time_from_start is 0 s'),
    (with_point(TIMED, 0, time=-1.0), InvalidGoal, 'trajectory.points[0].time_from_start is -1 s'),
    (
        with_point(TIMED, 2, time=2150.0),
        InvalidGoal,
        'trajectory.points[2].time_from_start gives the segment 2148 s',
    ),
    # speeds
    (
        with_segment(TIMED, 1, velocity=0.1),
        InvalidGoal,
        'segments[1].velocity is 0.1, but the times of the goal',
    ),
    (
        with_segment(TIMED, 1, type=TYPE.OPTIMIZED_LINEAR),
        InvalidGoal,
        'segments[1].type is OPTIMIZED_LINEAR, which cannot meet the time',
    ),
    (
        with_segment(TIMED, 1, type=TYPE.OPTIMIZED_JOINT),
        InvalidGoal,
        'segments[1].type is OPTIMIZED_JOINT, which cannot meet the time',
    ),
    (
        with_segment(PLAIN, 1, type=TYPE.OPTIMIZED_JOINT, velocity=1.1),
        InvalidGoal,
        'segments[1].velocity is 1.1',
    ),
    (
        with_segment(PLAIN, 1, type=TYPE.OPTIMIZED_LINEAR, acceleration=2.0),
        InvalidGoal,
        'segments[1].acceleration is 2',
    ),
    # arcs
    (with_segment(PLAIN, 1, type=TYPE.CIRCULAR), InvalidGoal, 'segments[1].via is missing'),
    (with_segment(PLAIN, 1, via=VIA), InvalidGoal, 'segments[1].via is set, but the type is AUTO'),
    (
        with_segment(PLAIN, 1, via_posture=Posture(names=('elbow_joint',), values=(0.0,))),
        InvalidGoal,
        'segments[1].via_posture is set, but',
    ),
    (
        with_segment(PLAIN, 1, type=TYPE.JOINT, arc_mode=ArcMode.FIXED),
        InvalidGoal,
        'segments[1].arc_mode is set, but',
    ),
    (
        with_segment(PLAIN, 1, type=TYPE.CIRCULAR, via=Pose((0.15, 0.0, 0.0))),
        InvalidGoal,
        'segments[1].via defines no arc to point 1: the start, the via and the end of the arc lie '
        'on',
    ),
    (
        with_segment(PLAIN, 1, type=TYPE.CIRCULAR, via=Pose((0.1, 0.0, 0.0))),
        InvalidGoal,
        'the start and the via of the arc coincide',
    ),
    (
        with_segment(PLAIN, 1, type=TYPE.CIRCULAR, via=Pose((0.2, 0.0, 0.0))),
        InvalidGoal,
        'the via and the end of the arc coincide',
    ),
    (
        with_segment(with_point(PLAIN, 1, pose=Pose((0.1, 0.0, 0.0))), 1, **ARC),
        InvalidGoal,
        'the start and the end of the arc coincide',
    ),
    # postures
    (
        with_point(PLAIN, 1, posture=Posture(names=('elbow',), values=(0.0,))),
        InvalidJoints,
        "trajectory.points[1].posture.posture_joint_names[0] is 'elbow', not a joint of this "
        'robot',
    ),
    (
        with_point(PLAIN, 1, posture=Posture(names=('elbow_joint',) * 2, values=(0.0, 0.0))),
        InvalidJoints,
        "posture_joint_names[1] repeats 'elbow_joint'",
    ),
    (
        with_point(PLAIN, 1, posture=Posture(names=('elbow_joint',), values=())),
        InvalidJoints,
        'trajectory.points[1].posture has 1 joint names but 0 values',
    ),
    (
        with_point(PLAIN, 1, posture=Posture(values=(0.0,))),
        InvalidJoints,
        'trajectory.points[1].posture has 0 joint names but 1 values',
    ),
    (
        with_point(PLAIN, 1, posture=Posture(names=('elbow_joint',), values=(inf,))),
        InvalidJoints,
        "posture_joint_values[0] ('elbow_joint') is inf",
    ),
    (
        with_segment(PLAIN, 1, **ARC, via_posture=Posture(names=('knee',), values=(0.0,))),
        InvalidJoints,
        "segments[1].via_posture.posture_joint_names[0] is 'knee'",
    ),
    # ways
    (
        with_segment(PLAIN, 1, blend_radius=0.11),
        InvalidGoal,
        'segments[1].blend_radius is too large: the blends at points[0] and points[1] '
        'take 0 mm and 110',
    ),
    (
        replace(
            PLAIN, segments=(Segment(blend_radius=0.06), Segment(blend_radius=0.05), Segment())
        ),
        InvalidGoal,
        'take 60 mm and 50 mm of a segment of 100.000 mm',
    ),
    (
        with_point(TIMED, 1, pose=Pose((0.1, 0.0, 0.0))),
        InvalidGoal,
        'trajectory.points[1] duplicates points[0]: a UR move needs a distance to go; remove one '
        'of the two; a dwell of 1 s at points[0] rests there.',
    ),
    (
        with_segment(PLAIN, 1, dwell=601.0),
        InvalidGoal,
        'segments[1].dwell is 601 s, more than 600 s; split the goal.',
    ),
    (with_segment(PLAIN, 1, dwell=-1.0), InvalidGoal, 'segments[1].dwell is -1; it must not'),
    (
        with_segment(PLAIN, 1, dwell=0.5, blend_radius=0.01),
        InvalidGoal,
        'segments[1].dwell needs a stop at points[1], but with a blend of 10 mm the arm passes it',
    ),
    (
        with_segment(TIMED, 1, dwell=1.0),
        InvalidGoal,
        'segments[1].dwell is 1 s, but points[2] follows 1 s after trajectory.points[1]; the arm',
    ),
    (
        with_segment(TIMED, 1, dwell=0.9995),
        InvalidGoal,
        'segments[1].dwell is 0.9995 s, but points[2] follows 1 s after trajectory.points[1]; the',
    ),
    (
        with_segment(with_point(TIMED, 0, time=0.0), 0, dwell=0.5),
        InvalidGoal,
        'segments[0].dwell needs a motion to points[0], but the robot is there at time 0; give',
    ),
    (
        with_segment(with_point(SPLINE, 1, twist=(0.1, 0, 0, 0, 0, 0)), 1, dwell=0.5),
        InvalidGoal,
        'segments[1].dwell needs a stop at points[1], which the arm passes with a twist',
    ),
    (
        with_fields(PLAIN, input_waits=(replace(BURNING, waypoint=3),)),
        InvalidGoal,
        'input_waits[0].point_index is 3, but the points are 0 to 2; name one of these.',
    ),
    (
        with_segment(with_fields(PLAIN, input_waits=(BURNING,)), 1, blend_radius=0.01),
        InvalidGoal,
        'input_waits[0].point_index needs a stop at points[1], but with a blend of 10 mm',
    ),
    (
        with_fields(PLAIN, input_waits=(BURNING, BURNING)),
        InvalidGoal,
        'input_waits[1].point_index is 1, where the goal waits for another input already; add',
    ),
    (
        with_fields(PLAIN, input_waits=(replace(BURNING, pin=8),)),
        InvalidGoal,
        'input_waits[0].pin is 8, but there are standard digital inputs 0 to 7; name one of',
    ),
    (
        with_fields(PLAIN, input_waits=(replace(BURNING, value=0.5),)),
        InvalidGoal,
        'input_waits[0].value is 0.5; a standard digital input takes 0 or 1',
    ),
    (
        with_fields(
            PLAIN, input_waits=(replace(BURNING, input=InputKind.TOOL_ANALOG, pin=1, value=nan),)
        ),
        InvalidGoal,
        'input_waits[0].value is nan; a tool analog input takes a level of 0 to 10 A or V',
    ),
    (
        with_fields(PLAIN, input_waits=(replace(BURNING, below=True),)),
        InvalidGoal,
        'input_waits[0].below is set, but a standard digital input has no level; set value',
    ),
    (
        with_fields(PLAIN, input_waits=(replace(BURNING, timeout=0.0),)),
        InvalidGoal,
        'input_waits[0].timeout is 0 s; it must be more than 0, and at most 600 s',
    ),
    (
        with_fields(PLAIN, input_waits=(BURNING,), keep_open=True),
        NotAvailable,
        'input_waits[0].point_index is set, but a goal with keep_open does nothing at points but',
    ),
    (
        with_fields(PLAIN, proportional_outputs=(replace(BEAD, last_waypoint=3),)),
        InvalidGoal,
        'proportional_outputs[0].last_point is 3 and first_point 0, but they must follow each',
    ),
    (
        with_fields(PLAIN, proportional_outputs=(replace(BEAD, gain=nan),)),
        InvalidGoal,
        'proportional_outputs[0].gain is nan, outside -1000 to 1000',
    ),
    (
        with_fields(PLAIN, proportional_outputs=(replace(BEAD, minimum=1.0),)),
        InvalidGoal,
        'proportional_outputs[0].maximum is 1, not more than minimum = 1; set it to 1 for',
    ),
    (
        with_fields(PLAIN, proportional_outputs=(BEAD, replace(BEAD, first_waypoint=1))),
        InvalidGoal,
        'proportional_outputs[1].pin is 1, which another entry uses on the same points; let one',
    ),
    (
        with_fields(PLAIN, proportional_outputs=(BEAD,), keep_open=True),
        NotAvailable,
        'proportional_outputs is not empty, but the goal has keep_open; send all points at once',
    ),
    (
        with_fields(SPLINE, presses=(GRIND,)),
        NotAvailable,
        'presses is not empty, but SPLINE follows joint positions, which do not give way; set',
    ),
    (
        pressing(last_waypoint=0),
        InvalidGoal,
        'presses[0].last_point is 0, not behind first_point = 0',
    ),
    (
        pressing(last_waypoint=3),
        InvalidGoal,
        'presses[0].last_point is 3, but the points are 0 to 2; name one of these',
    ),
    (
        pressing(axes=('z', 'down'), forces=(1.0, 1.0)),
        InvalidGoal,
        "presses[0].axes[1] is 'down'; the axes are x, y, z, rx, ry, rz, each at most once",
    ),
    (
        pressing(axes=(), forces=()),
        InvalidGoal,
        'presses[0].axes is empty, and contact is NONE, so that it does nothing; name axes',
    ),
    (
        pressing(forces=(1.0, 2.0)),
        InvalidGoal,
        'presses[0].forces has 2 entries for 1 axes',
    ),
    (
        pressing(forces=(201.0,)),
        InvalidGoal,
        'presses[0].forces[0] is 201 N, outside -200 to 200',
    ),
    (
        pressing(axes=('rz',), forces=(nan,)),
        InvalidGoal,
        'presses[0].forces[0] is nan Nm, outside -30 to 30',
    ),
    (
        pressing(speed_limits=(0.1, 0.1)),
        InvalidGoal,
        'presses[0].speed_limits has 2 entries for 1 axes; give one for each, or none',
    ),
    (
        pressing(speed_limits=(0.3,)),
        InvalidGoal,
        'presses[0].speed_limits[0] is 0.3 m/s; it must be more than 0, and at most 0.25',
    ),
    (
        pressing(max_deviation=0.2),
        InvalidGoal,
        'presses[0].max_deviation is 0.2, outside 0 to 0.1',
    ),
    (
        with_fields(PLAIN, presses=(replace(GRIND, last_waypoint=2), replace(GRIND))),
        InvalidGoal,
        'presses[1].first_point is 0, where another press has begun and not ended; let one end',
    ),
    (
        with_fields(with_segment(PLAIN, 0, blend_radius=0.02), presses=(GRIND,)),
        InvalidGoal,
        'presses[0].first_point needs a stop at points[0], but with a blend of 20 mm the arm',
    ),
    (
        with_fields(
            with_segment(PLAIN, 2, type=TYPE.CIRCULAR, via=Pose((0.25, 0.05, 0.0))),
            presses=(GRIND,),
        ),
        InvalidGoal,
        'segments[2].type is CIRCULAR, but presses[0] may have displaced the tool at its start',
    ),
    (
        with_fields(PLAIN, presses=(GRIND,), keep_open=True),
        NotAvailable,
        'presses[0].first_point is set, but a goal with keep_open does nothing at points but',
    ),
    (
        with_fields(PLAIN, script_calls=(ScriptCall(waypoint=1, function='fly'),)),
        InvalidGoal,
        "script_calls[0].function is 'fly', but gripper.script has open, close; call one of",
    ),
    (
        with_fields(
            PLAIN, script_calls=(ScriptCall(waypoint=1, function='close', arguments=(1, 2, 3)),)
        ),
        InvalidGoal,
        'script_calls[0].arguments has 3 entries, but close takes 1 to 2 arguments.',
    ),
    (
        with_fields(
            PLAIN, script_calls=(ScriptCall(waypoint=1, function='open', arguments=(nan,)),)
        ),
        InvalidGoal,
        'script_calls[0].arguments[0] is nan, outside -2147 to 2147.',
    ),
    (
        with_fields(
            PLAIN, script_calls=(ScriptCall(waypoint=1, function='open', arguments=(0.0,) * 7),)
        ),
        InvalidGoal,
        'script_calls[0].arguments has 7 entries, more than 6.',
    ),
    (
        with_fields(PLAIN, script_calls=(ScriptCall(waypoint=1, function='open', timeout=601.0),)),
        InvalidGoal,
        'script_calls[0].timeout is 601 s; it must be more than 0, and at most 600 s.',
    ),
    (
        with_fields(PLAIN, script_calls=(ScriptCall(waypoint=9, function='open'),)),
        InvalidGoal,
        'script_calls[0].point_index is 9, but the points are 0 to 2; name one of these.',
    ),
    (
        with_fields(PLAIN, payload_changes=(PayloadChange(waypoint=1, mass=101.0),)),
        InvalidGoal,
        'payload_changes[0].mass is 101 kg, outside 0 to 100 kg',
    ),
    (
        with_fields(
            PLAIN,
            payload_changes=(
                PayloadChange(waypoint=1, mass=1.0, center_of_gravity=(0.0, 0.0, 50.0)),
            ),
        ),
        InvalidGoal,
        'payload_changes[0].center_of_gravity contains a number beyond 5 m; give it in metres',
    ),
    *(
        (
            with_fields(
                PLAIN, payload_changes=(PayloadChange(waypoint=1, mass=1.0, inertia=inertia),)
            ),
            InvalidGoal,
            f'payload_changes[0].inertia has {problem}; give it about the centre of gravity',
        )
        for inertia, problem in (
            ((0.1, 0.1, 0.1), '3 numbers, not 6 (xx, yy, zz, xy, xz, yz)'),
            ((0.1, -0.1, 0.1, 0.0, 0.0, 0.0), 'yy = -0.1 kg m^2, outside 0 to 133'),
            ((0.1, 0.1, 0.1, 0.0, -134.0, 0.0), 'xz = -134 kg m^2, outside -133 to 133'),
            ((0.1, 0.1, 0.1, 0.0, 0.0, float('nan')), 'yz = nan kg m^2, outside -133 to 133'),
        )
    ),
    (
        replace(with_segment(PLAIN, 1, dwell=0.5), keep_open=True),
        NotAvailable,
        'segments[1].dwell is 0.5 s, but a goal with keep_open does not rest at points; append',
    ),
    (
        with_point(PLAIN, 1, pose=Pose((0.1, 0.0, 0.0))),
        InvalidGoal,
        'trajectory.points[1] duplicates points[0]: a UR move needs a distance to go; remove',
    ),
    # path offsets
    *(
        (replace(PATIENT, path_offset=PathOffset(**fields)), InvalidGoal, text)
        for fields, text in (
            ({'limits': (0.0, -0.1, 0.0)}, 'path_offset.limits.y is -0.1 m, outside 0 to 0.1 m'),
            ({'limits': (0.0, 0.0, 0.2)}, 'path_offset.limits.z is 0.2 m, outside 0 to 0.1 m'),
            ({'limits': (nan, 0.0, 0.0)}, 'path_offset.limits.x is nan m'),
            ({'limits': SIDEWAYS, 'speed': 0.2}, 'path_offset.speed is 0.2 m/s, outside 0 to 0.1'),
            ({'limits': SIDEWAYS, 'acceleration': inf}, 'path_offset.acceleration is inf m/s^2'),
            (
                {'limits': SIDEWAYS, 'timeout': nan},
                'path_offset.timeout is nan s, outside 0 to 60',
            ),
            ({'speed': 0.01}, 'path_offset.limits are all 0'),
        )
    ),
    (
        replace(
            TIMED,
            execution=ExecutionMode.SERVO,
            keep_open=True,
            path_offset=PathOffset(limits=SIDEWAYS),
        ),
        NotAvailable,
        'path_offset is set, but the end of a goal with keep_open, where an offset has to be gone',
    ),
    (
        replace(SPLINE, path_offset=PathOffset(limits=SIDEWAYS)),
        NotAvailable,
        'path_offset is set, but in a SPLINE goal the robot program leads the joints',
    ),
    (
        replace(pressing(), path_offset=PathOffset(limits=SIDEWAYS)),
        NotAvailable,
        'path_offset is set, but the goal presses too, and the controller must not offset',
    ),
    (
        replace(
            PLAIN,
            segments=(Segment(), Segment(type=SegmentType.OPTIMIZED_LINEAR), Segment()),
            path_offset=PathOffset(limits=SIDEWAYS),
        ),
        NotAvailable,
        'path_offset is set, but segments[1].type is OPTIMIZED: the robot chooses the speed',
    ),
    # feed override
    *(
        (replace(SPLINE, feed_override=FeedOverride(**fields)), InvalidGoal, text)
        for fields, text in (
            (
                {'minimum': 1.1},
                'feed_override.minimum is 1.1, but must be 0 (no override) or from 0.01 to 1',
            ),
            ({'minimum': nan}, 'feed_override.minimum contains nan; every number must be finite'),
            (
                {'minimum': 0.5, 'maximum': 1.2},
                'feed_override.maximum is 1.2, but must be 0 (as planned) or from 0.01 to 1',
            ),
            (
                {'minimum': 0.5, 'maximum': 0.4},
                'feed_override.maximum is 0.4, less than feed_override.minimum = 0.5; raise it',
            ),
            (
                {'minimum': 0.5, 'rate': 20.0},
                'feed_override.rate is 20 1/s, but must be 0 (0.5 1/s) or from 0.01 to 10 1/s',
            ),
            (
                {'minimum': 0.5, 'timeout': 0.01},
                'feed_override.timeout is 0.01 s, but must be 0 (0.5 s) or from 0.02 to 60 s',
            ),
            (
                {'maximum': 0.5},
                'feed_override.minimum is 0, so that no signal may slow the goal; set it',
            ),
        )
    ),
    (
        replace(PLAIN, feed_override=FeedOverride(minimum=0.3)),
        NotAvailable,
        'feed_override is set, but the speed of a PRIMITIVES goal is changed by the speed slider '
        'alone, which belongs to people and would stay lowered if the driver died; set execution '
        'to SPLINE or SERVO, with times or a corner_deviation',
    ),
]


def test_functions_are_called_only_where_the_driver_has_some():
    goal = with_fields(PLAIN, script_calls=(ScriptCall(waypoint=1, function='open'),))
    check(goal, OPTIONS)
    with pytest.raises(NotAvailable, match='set its parameters script_prelude and allow_scripts'):
        check(goal, replace(OPTIONS, prelude=NO_PRELUDE))


@pytest.mark.parametrize(('goal', 'error', 'text'), REFUSALS, ids=[r[2][:60] for r in REFUSALS])
def test_a_wrong_goal_is_refused_by_its_class_with_the_place_in_the_text(goal, error, text):
    with pytest.raises(error) as caught:
        check(goal, OPTIONS)
    assert type(caught.value) is error
    assert text in str(caught.value)
    assert str(caught.value).endswith('.')


ACCEPTED = {
    'plain': PLAIN,
    'timed': TIMED,
    'first point at time 0': with_point(TIMED, 0, time=0.0),
    'single point at time 0': Goal(waypoints=(at(0.1),)),
    'quaternion off by less than the bound': with_point(
        PLAIN, 1, pose=Pose((0.2, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0009))
    ),
    'negative quaternion': with_point(PLAIN, 1, pose=Pose((0.2, 0, 0), (0.0, 0.0, 0.0, -1.0))),
    'young stamp': replace(PLAIN, age=0.9),
    'stamp ahead': replace(PLAIN, age=-59.0),
    'primitives ignore a twist': replace(
        with_point(TIMED, 1, twist=ONE), execution=ExecutionMode.PRIMITIVES
    ),
    'twist at the last point': with_point(TIMED, 2, twist=ONE),
    'a twist at an inner point means a spline': with_point(TIMED, 1, twist=ONE),
    'a spline with NaN': with_point(
        with_point(with_point(TIMED, 0, twist=SIX_NAN), 1, acceleration=SIX_NAN), 2, twist=SIX_NAN
    ),
    'a spline that waits': with_point(SPLINE, 1, pose=SPLINE.waypoints[0].pose),
    'a spline with lines': with_segment(SPLINE, 1, type=TYPE.LINEAR, acceleration=1.0),
    'servo': replace(TIMED, execution=ExecutionMode.SERVO),
    'twist as a speed': with_point(PLAIN, 1, twist=ONE),
    'arc': with_segment(PLAIN, 1, **ARC),
    'unset via': with_segment(PLAIN, 1, via=Pose()),
    'blends that touch': replace(
        PLAIN, segments=(Segment(blend_radius=0.05), Segment(blend_radius=0.05), Segment())
    ),
    'blend at a first point where the arm is': replace(
        with_point(TIMED, 0, time=0.0),
        segments=(Segment(blend_radius=0.15), Segment(blend_radius=0.09), Segment()),
    ),
    'blend on the last point is dropped': with_segment(PLAIN, 2, blend_radius=5.0),
    'tolerances': replace(
        PLAIN,
        path_tolerance=Tolerance(
            position=(0.01, -1.0, 0.0), orientation=(0.1, 0.0, 0.0), twist=(-1.0,) * 6
        ),
    ),
    'tolerances of twist and acceleration': replace(
        PLAIN, path_tolerance=Tolerance(twist=ONE, acceleration=ONE)
    ),
    'joint move in place': with_segment(
        with_point(PLAIN, 1, pose=Pose((0.1, 0.0, 0.0))), 1, type=TYPE.JOINT
    ),
}


def test_a_dwell_is_no_part_of_the_time_of_the_segment_after_it():
    goal = Goal(
        waypoints=(at(0.1, time=1.0), at(0.2, time=5.0)),
        segments=(Segment(dwell=3.0), Segment()),
    )
    check(goal, replace(OPTIONS, max_segment_time=1.2))
    with pytest.raises(InvalidGoal, match=r'gives the segment 1\.5 s, more than max_segment_time'):
        check(with_point(goal, 1, time=5.5), replace(OPTIONS, max_segment_time=1.2))


@pytest.mark.parametrize(
    ('fields', 'text'),
    [
        ({'offset': -1.5}, r'io_commands\[0\]\.offset is -1\.5 s, outside -1 to'),
        ({'offset': nan}, r'io_commands\[0\]\.offset contains nan|offset is nan'),
        ({'output': 9}, r'io_commands\[0\]\.output is 9; allowed are STANDARD_DIGITAL'),
        (
            {'offset': -0.9},
            r"io_commands\[0\]\.lead is 'valve', whose dead time of 0\.3 s and the offset of "
            r'-0\.9 s are together more than 1 s; set the offset to 0',
        ),
    ],
)
def test_a_command_with_a_lead_is_refused_by_what_the_user_wrote(fields, text):
    valve = Lead(name='valve', output=OutputKind.STANDARD_DIGITAL, pin=3, open=0.3, close=0.0)
    options = replace(OPTIONS, leads=(valve,))
    command = replace(VALVE, lead='valve')
    checked = check(replace(PLAIN, io_commands=(replace(command, offset=-0.5),)), options)
    assert checked.io_commands[0].offset == pytest.approx(-0.8)
    with pytest.raises(InvalidGoal, match=text):
        check(replace(PLAIN, io_commands=(replace(command, **fields),)), options)


@pytest.mark.parametrize('goal', ACCEPTED.values(), ids=ACCEPTED)
def test_a_right_goal_passes(goal):
    check(goal, OPTIONS)


@pytest.mark.parametrize(
    ('mode', 'options', 'text'),
    [
        (ExecutionMode.SPLINE, PlanningOptions(calibration_known=False), 'SPLINE.*calibration'),
        (ExecutionMode.SPLINE, PlanningOptions(dialect=DIALECTS['2.0']), 'SPLINE.*milliseconds'),
        (ExecutionMode.SERVO, PlanningOptions(dialect=DIALECTS['2.12']), 'SERVO.*dialect 2.12'),
    ],
)
def test_a_spline_needs_a_robot_that_takes_joints_exactly(mode, options, text):
    goal = replace(TIMED, execution=mode)
    check(goal, PlanningOptions())
    with pytest.raises(NotAvailable, match=f'^execution is {text}'):
        check(goal, options)


def test_auto_is_a_spline_only_with_times_and_a_twist_or_acceleration_at_an_inner_point():
    for goal in (TIMED, with_point(TIMED, 2, twist=ONE), with_point(PLAIN, 1, twist=ONE)):
        assert resolve_execution_mode(goal_table(goal)) is ExecutionMode.PRIMITIVES
    for field in ('twist', 'acceleration'):
        goal = with_point(TIMED, 1, **{field: ONE})
        assert resolve_execution_mode(goal_table(goal)) is ExecutionMode.SPLINE


@pytest.mark.parametrize('kind', [SegmentType.OPTIMIZED_LINEAR, SegmentType.OPTIMIZED_JOINT])
def test_optimized_moves_need_a_software_that_knows_them(kind):
    goal = Goal(waypoints=(Waypoint(pose=Pose((0.4, 0.1, 0.4))),), segments=(Segment(type=kind),))
    check(goal, PlanningOptions())
    with pytest.raises(NotAvailable, match=r'segments\[0\]\.type is OPTIMIZED.*5\.21'):
        check(goal, PlanningOptions(optimove_known=False))


@pytest.mark.parametrize(
    ('options', 'text'),
    [
        ({'path_offset_known': False}, r"the robot's software is not known to have .* 5\.6"),
        ({'dialect': DIALECTS['2.12']}, r'2\.12 add no offsets .*; let the driver send its own'),
    ],
)
def test_path_offsets_of_the_controller_need_a_software_and_a_program_that_have_them(
    options, text
):
    goal = replace(PLAIN, path_offset=PathOffset(limits=SIDEWAYS))
    check(goal, OPTIONS)
    with pytest.raises(NotAvailable, match=text):
        check(goal, replace(OPTIONS, **options))
    check(replace(TIMED, execution=ExecutionMode.SERVO), replace(OPTIONS, path_offset_known=False))


@pytest.mark.parametrize(
    ('goal', 'options'),
    [
        (replace(PLAIN, path_tolerance=Tolerance(acceleration=ONE)), {}),
        (replace(PLAIN, goal_tolerance=Tolerance(acceleration=ONE)), {}),
        (PLAIN, {'path_tolerance_linear_acceleration': 1.0}),
        (PLAIN, {'goal_tolerance_angular_acceleration': 1.0}),
    ],
)
def test_a_robot_that_reports_no_acceleration_cannot_be_held_to_it(goal, options):
    check(goal, PlanningOptions(**options))
    with pytest.raises(InvalidGoal, match=r'acceleration_error is positive.*does not report'):
        check(goal, PlanningOptions(**options, acceleration_known=False))


def test_a_robot_that_reports_no_acceleration_runs_goals_that_do_not_ask_for_it():
    options = PlanningOptions(path_tolerance_linear_acceleration=1.0, acceleration_known=False)
    check(replace(PLAIN, path_tolerance=Tolerance(acceleration=(-1.0,) * 6)), options)
    check(replace(PLAIN, path_tolerance=Tolerance(acceleration=(-1.0,) * 3 + (0.0,) * 3)), options)


def test_joint_names_carry_the_prefix():
    options = PlanningOptions(tf_prefix='left_')
    right = Posture(names=('left_elbow_joint',), values=(1.0,))
    check(with_point(PLAIN, 1, posture=right), options)
    with pytest.raises(InvalidJoints, match='left_shoulder_pan_joint'):
        check(with_point(PLAIN, 1, posture=replace(right, names=('elbow_joint',))), options)


def test_every_rule_refuses_some_goal_of_the_table():
    all_rules = (*FIELD_RULES, *RULES)

    def refusing(goal, options=OPTIONS):
        for rule in all_rules:
            try:
                rule(goal_table(goal), options)
            except Exception:
                return rule
        return None

    without = refusing(
        replace(PLAIN, path_tolerance=Tolerance(acceleration=ONE)),
        PlanningOptions(acceleration_known=False),
    )
    older = refusing(replace(PLAIN, keep_open=True), PlanningOptions(dialect=DIALECTS['2.12']))
    assert {refusing(goal) for goal, _, _ in REFUSALS} | {without, older} == set(all_rules)


numbers = st.floats(allow_nan=True, allow_infinity=True, width=64)
waypoints = st.builds(
    Waypoint,
    time=numbers,
    pose=st.builds(
        Pose,
        st.tuples(numbers, numbers, numbers),
        st.tuples(numbers, numbers, numbers, numbers) | st.just((0.0, 0.0, 0.0, 1.0)),
    ),
    twist=st.tuples(*[numbers] * 6),
    posture=st.builds(
        Posture,
        names=st.lists(st.sampled_from(['elbow_joint', 'wrist_1_joint', 'x']), max_size=3).map(
            tuple
        ),
        values=st.lists(numbers, max_size=3).map(tuple),
    ),
)
segments = st.builds(
    Segment,
    type=st.sampled_from(SegmentType),
    blend_radius=numbers,
    velocity=numbers,
    via=st.none() | st.builds(Pose, st.tuples(numbers, numbers, numbers)),
)


@settings(max_examples=150, deadline=None)
@given(points=st.lists(waypoints, max_size=3), ways=st.lists(segments, max_size=3))
def test_nonsense_of_any_kind_ends_in_a_refusal_or_passes_but_never_in_another_error(points, ways):
    try:
        check(Goal(waypoints=tuple(points), segments=tuple(ways)), OPTIONS)
    except (InvalidGoal, InvalidJoints):
        return
    assert len(points) >= 1


@pytest.mark.parametrize(
    ('field', 'value'),
    [
        ('linear_velocity', 0.0),
        ('optimized_velocity', 1.5),
        ('max_tool_speed', -1.0),
        ('max_segment_time', 2148.0),
        ('on_too_fast', 'ignore'),
        ('on_posture_change', 'maybe'),
        ('max_points', 0),
        ('stamp_tolerance', nan),
        ('spline_tolerance', 0.0),
        ('keep_open_deceleration', 0.0),
        ('live_target_linear_velocity', 0.0),
    ],
)
def test_options_out_of_their_range_are_named(field, value):
    with pytest.raises(ValueError, match=field):
        PlanningOptions(**{field: value})


def test_a_servo_goal_may_wait_for_its_arm():
    check(PATIENT, OPTIONS)
    by_parameter = PlanningOptions(path_tolerance_position=0.001)
    check(replace(PATIENT, path_tolerance=Tolerance()), by_parameter)


@pytest.mark.parametrize(
    ('changes', 'error', 'text'),
    [
        ({'execution': ExecutionMode.SPLINE}, NotAvailable, 'on_path_tolerance is STALL.* SPLINE'),
        ({'execution': ExecutionMode.PRIMITIVES}, NotAvailable, 'STALL.* PRIMITIVES'),
        ({'path_tolerance': Tolerance()}, InvalidGoal, 'path_tolerance limits nothing'),
        ({'stall_timeout': -1.0}, InvalidGoal, 'stall_timeout is -1 s; it must not be negative'),
        ({'stall_timeout': nan}, InvalidGoal, 'stall_timeout'),
    ],
)
def test_a_wait_that_cannot_be_is_refused(changes, error, text):
    with pytest.raises(error, match=text):
        check(replace(PATIENT, **changes), OPTIONS)
