# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Small motions that reveal how the controller moves the arm, and the analyses of their recordings.

Each motion is slow and short and begins at the present pose, to which the tool then returns. The
analyses are pure: samples in, a sentence and numbers out.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import degrees, radians

import numpy as np

from ur_cartesian_driver.robot.check.corner_experiment import corner_script, SPEED, TURN
from ur_cartesian_driver.robot.check.corner_findings import corner_pause, followed, steps
from ur_cartesian_driver.robot.check.finding import Finding, note, ok
from ur_cartesian_driver.robot.check.motion_samples import MotionSamples

#: Speed and acceleration: of joint motions [rad/s, rad/s^2]; of tool motions [m/s, m/s^2].
JOINT_SPEED, JOINT_ACCELERATION = 0.2, 0.5
TOOL_SPEED, TOOL_ACCELERATION = 0.05, 0.5
WRIST_TURN, TOOL_TURN = radians(5.0), radians(10.0)
TIMED_DISTANCE, TIMED_TIME = 0.02, 2.0
STOP_DISTANCE = 0.06
#: Largest time by which the start of a program may prolong its first motion [s].
MAX_START_COST = 0.1
#: Fraction of the speed slider during the experiment ``slider``.
SLIDER = 0.5
#: Experiment ``path_offset``: length of the offset, and of the line that follows [m]; speed of
#: both motions [m/s]; pause after each motion [s].
OFFSET, OFFSET_SPEED, OFFSET_REST = 0.004, 0.01, 0.4
#: Difference below which two distances of the resting tool from its start count as equal [m];
#: speed below which the tool counts as at rest [m/s], because the filter of the path offset may
#: still move it a little.
SAME_HEIGHT, RESTING_SPEED = 3e-4, 1e-4
#: Fractions of the speed slider at which a corner is followed.
CORNER_SLIDERS = (1.0, 0.5, 0.1)


@dataclass(frozen=True, slots=True, kw_only=True)
class Experiment:
    """
    A motion that settles a question about the controller.

    :param check: name in the report and in doc/robot_program.md.
    :param motion: sentence shown before a person agrees: what moves, how far and how fast.
    :param script: URScript body of the program that moves the arm.
    :param analyses: derive the findings from the samples of the motion.
    :param slider: fraction of the speed slider during the motion; None = unchanged.
    :param stop_after: time from the start of the motion to the stop command, by the controller's
        clock [s]; None = no stop command.
    :param is_corner: whether pieces of a corner are sent to the program, see
        :mod:`~ur_cartesian_driver.robot.check.corner_experiment`.
    :param pauses: whether the program is paused in the corner.
    :param feature: key in ``program.render.FEATURES`` of a feature that the controller's software
        must have; empty = none.
    """

    check: str
    motion: str
    script: str
    analyses: tuple[Callable[[MotionSamples], Finding], ...]
    slider: float | None = None
    stop_after: float | None = None
    is_corner: bool = False
    pauses: bool = False
    feature: str = ''


def trapezoid_time(distance: float, speed: float, acceleration: float) -> float:
    """Return the duration [s] of a motion that accelerates, cruises if it can, and brakes."""
    if distance * acceleration < speed**2:
        return float(2.0 * np.sqrt(distance / acceleration))
    return distance / speed + speed / acceleration


def _joint_move(samples: MotionSamples) -> Finding:
    ideal = 2.0 * trapezoid_time(WRIST_TURN, JOINT_SPEED, JOINT_ACCELERATION)
    extra = samples.duration - ideal
    text = (
        f'Wrist 3 took {samples.duration:.3f} s there and back, two trapezoids {ideal:.3f} s; '
        f'so the program start costs {1e3 * extra:+.0f} ms (recorded on other robots: 80).'
    )
    expected = -0.01 < extra < MAX_START_COST
    return (ok if expected else note)(
        'joint_move', text, duration=samples.duration, trapezoids=ideal
    )


def _turn(samples: MotionSamples) -> Finding:
    laws = {
        law: trapezoid_time(TOOL_TURN, n * TOOL_SPEED, n * TOOL_ACCELERATION)
        for law, n in (('turning runs with 4 v and 4 a', 4), ('turning runs with v and a', 1))
    }
    one_turn = samples.duration / 2.0
    law = _nearest(one_turn, laws)
    text = (
        f'A movel that turns by {degrees(TOOL_TURN):.0f} degrees on the spot, with v = '
        f'{TOOL_SPEED:g} and a = {TOOL_ACCELERATION:g}, takes {one_turn:.2f} s: '
        f'{law or "no known law"}.'
    )
    return (ok if law else note)('turn', text, duration=one_turn, law=law)


def _timed_line(samples: MotionSamples) -> Finding:
    """
    Find the law by which the controller meets the time T for a line of length d.

    A stretched trapezoid, here one without cruising, has the peak speed 2 d/T. Thirds, which
    accelerate, cruise and brake for equally long, have the peak speed 1.5 d/T.
    """
    peak = float(samples.tool_speed.max()) * TIMED_TIME / TIMED_DISTANCE
    law = _nearest(peak, {'t stretches the trapezoid': 2.0, 't makes thirds': 1.5})
    text = (
        f'A line of {1e3 * TIMED_DISTANCE:g} mm in t = {TIMED_TIME:g} s took '
        f'{samples.duration:.3f} s with {peak:.2f} times its mean speed at most: '
        f'{law or "no known law"}.'
    )
    return (ok if law else note)(
        'timed_line', text, duration=samples.duration, peak_over_mean=peak, law=law
    )


def _slider(samples: MotionSamples) -> Finding:
    moving = samples.moving
    if not moving.any():
        return note('slider', 'The arm did not move.')
    scaling, fraction = (float(np.median(x[moving])) for x in (samples.scaling, samples.fraction))
    law = _nearest(
        scaling, {'it does not contain the slider': 1.0, 'it contains the slider': SLIDER}
    )
    text = (
        f'With the slider at {SLIDER:.0%} speed_scaling is {scaling:.2f} and '
        f'target_speed_fraction {fraction:.2f} while the arm moves: {law or "no known law"}.'
    )
    return (ok if law else note)(
        'slider', text, speed_scaling=scaling, target_speed_fraction=fraction, law=law
    )


def _program_stop(samples: MotionSamples) -> Finding:
    """Measure the ramp with which the arm stops when its program is stopped."""
    moving = np.flatnonzero(samples.moving & (samples.time >= samples.stop_sent))
    if not len(moving):
        return note('program_stop', 'The program was stopped too late: the arm stood already.')
    before = np.median(samples.tool_speed[max(0, moving[0] - 20) : moving[0] + 1])
    slow = moving[samples.tool_speed[moving] < 0.97 * before]
    end = samples.time[moving[-1]]
    ramp = float(end - samples.time[slow[0]]) if len(slow) else 0.0
    reaction = float(end - ramp - samples.stop_sent)
    distance = float(np.sum(samples.tool_speed[slow]) * np.median(np.diff(samples.time)))
    return ok(
        'program_stop',
        f'A stopped program brakes from {before:.3f} m/s within {1e3 * ramp:.0f} ms and '
        f'{1e3 * distance:.1f} mm, {1e3 * reaction:.0f} ms after the command (recorded once: '
        '160 ms).',
        speed=float(before),
        ramp=ramp,
        reaction=reaction,
        distance=distance,
    )


def _path_offset(samples: MotionSamples) -> Finding:
    """Check where the tool rests: after the offset, the line, and the end of the offset."""
    heights = _resting_heights(samples)
    both = 2.0 * OFFSET
    off = np.abs(samples.target_distance - samples.actual_distance)
    laws = {
        'it is applied at rest': any(abs(height - OFFSET) < SAME_HEIGHT for height in heights),
        'and in motion': any(abs(height - both) < SAME_HEIGHT for height in heights),
        'the reported target contains it': bool(off.max(initial=0.0) < 2.0 * SAME_HEIGHT),
        'the arm stays there after path_offset_disable': abs([0.0, *heights][-1] - both)
        < SAME_HEIGHT,
    }
    shown = ', '.join(f'{1e3 * height:.1f}' for height in heights)
    missing = [law for law, holds in laws.items() if not holds]
    text = (
        f'A path offset of {1e3 * OFFSET:g} mm, then a line of as much, rested at {shown} mm: '
        + (f'not as assumed: {"; ".join(missing)}.' if missing else f'{", ".join(laws)}.')
    )
    return (note if missing else ok)('path_offset', text, heights=heights, missing=missing)


def _resting_heights(samples: MotionSamples) -> list[float]:
    """Return the distances [m] of the target TCP from its start wherever it rests, in order."""
    speeds = np.abs(np.gradient(samples.target_distance, samples.time))
    moving = np.flatnonzero(speeds > RESTING_SPEED)
    ends = np.append(moving, len(samples.time))
    begins = np.append(0, moving + 1)
    heights: list[float] = []
    for begin, end in zip(begins.tolist(), ends.tolist(), strict=True):
        if end > begin and samples.time[end - 1] - samples.time[begin] > 0.5 * OFFSET_REST:
            height = float(samples.target_distance[end - 1])
            if not heights or abs(height - heights[-1]) > SAME_HEIGHT:
                heights.append(height)
    return heights


def _nearest(value: float, laws: dict[str, float]) -> str:
    """Return the name of the law that predicts a value within 15 %; empty = none does."""
    name = min(laws, key=lambda law: abs(value / laws[law] - 1.0))
    return name if abs(value / laws[name] - 1.0) < 0.15 else ''


def _tool_line(x: float, options: str) -> str:
    return (
        'start = get_target_tcp_pose()\n'
        f'movel(pose_trans(start, p[0, 0, {x:g}, 0, 0, 0]), {options})'
    )


_THERE_AND_BACK = f"""start = get_target_joint_positions()
goal = [start[0], start[1], start[2], start[3], start[4], start[5] + {WRIST_TURN:.6f}]
movej(goal, a={JOINT_ACCELERATION:g}, v={JOINT_SPEED:g})
movej(start, a={JOINT_ACCELERATION:g}, v={JOINT_SPEED:g})"""
_BESIDE = f"""start = get_target_tcp_pose()
away = pose_trans(start, p[0, 0, -1, 0, 0, 0])
offset = 0.0
thread follow():
  while True:
    if offset < {OFFSET:g}:
      offset = offset + {OFFSET_SPEED:g} * get_steptime()
    end
    x = offset * (away[0] - start[0])
    y = offset * (away[1] - start[1])
    z = offset * (away[2] - start[2])
    path_offset_set([x, y, z, 0, 0, 0], 1)
    sync()
  end
end
path_offset_set_max_offset({2.0 * OFFSET:g}, 0.52)
path_offset_set_alpha_filter(get_steptime() / (get_steptime() + 0.018))
path_offset_enable()
run follow()
sleep({OFFSET / OFFSET_SPEED + OFFSET_REST:g})
goal = pose_trans(start, p[0, 0, {-OFFSET:g}, 0, 0, 0])
movel(goal, a={TOOL_ACCELERATION:g}, v={OFFSET_SPEED:g})
sleep({OFFSET_REST:g})
path_offset_disable(2)
sleep({OFFSET_REST:g})"""
_SLOW = f'a={TOOL_ACCELERATION:g}, v={TOOL_SPEED:g}'
_WRIST = f'Wrist 3 turns by {degrees(WRIST_TURN):.0f} degrees and back, at up to'
_RETRACT = 'mm against its z axis, away from the work'


def _corner(slider: float) -> str:
    return (
        f'The speed slider goes to {slider:.0%} and back to where it is. Wrist 3 turns by '
        f'{degrees(TURN):.0f} degrees, then wrist 2, with a rounded corner between them, at up to '
        f'{degrees(SPEED * slider):.1f} degrees/s; then both turn back.'
    )


EXPERIMENTS = (
    Experiment(
        check='joint_move',
        motion=f'{_WRIST} {degrees(JOINT_SPEED):.0f} degrees/s.',
        script=_THERE_AND_BACK,
        analyses=(_joint_move,),
    ),
    Experiment(
        check='turn',
        motion=(
            f'The tool turns by {degrees(TOOL_TURN):.0f} degrees about its z axis and back, at up '
            f'to {degrees(4.0 * TOOL_SPEED):.0f} degrees/s; the TCP stays where it is.'
        ),
        script=(
            'start = get_target_tcp_pose()\n'
            f'movel(pose_trans(start, p[0, 0, 0, 0, 0, {TOOL_TURN:.6f}]), {_SLOW})\n'
            f'movel(start, {_SLOW})'
        ),
        analyses=(_turn,),
    ),
    Experiment(
        check='timed_line',
        motion=(
            f'The tool moves {1e3 * TIMED_DISTANCE:g} {_RETRACT}, in {TIMED_TIME:g} s, and back '
            f'at {1e3 * TOOL_SPEED:g} mm/s.'
        ),
        script=_tool_line(-TIMED_DISTANCE, f't={TIMED_TIME:g}'),
        analyses=(_timed_line,),
    ),
    Experiment(
        check='slider',
        motion=(
            f'The speed slider goes to {SLIDER:.0%} and back to where it is. {_WRIST} '
            f'{degrees(JOINT_SPEED * SLIDER):.0f} degrees/s.'
        ),
        script=_THERE_AND_BACK,
        analyses=(_slider,),
        slider=SLIDER,
    ),
    Experiment(
        check='program_stop',
        motion=(
            f'The tool moves less than {1e3 * STOP_DISTANCE:g} {_RETRACT}, at '
            f'{1e3 * TOOL_SPEED:g} mm/s; the program is stopped on the way, and the tool moves '
            'back at the same speed.'
        ),
        script=_tool_line(-STOP_DISTANCE, _SLOW),
        analyses=(_program_stop,),
        stop_after=0.6,
    ),
    Experiment(
        check='path_offset',
        motion=(
            f'The tool moves {2e3 * OFFSET:g} {_RETRACT}, half of that by a path offset, at '
            f'{1e3 * OFFSET_SPEED:g} mm/s, and back at {1e3 * TOOL_SPEED:g} mm/s.'
        ),
        script=_BESIDE,
        analyses=(_path_offset,),
        feature='path_offset',
    ),
    *(
        Experiment(
            check=f'corner_{100.0 * slider:.0f}',
            motion=_corner(slider),
            script=corner_script(),
            analyses=(
                followed(f'corner_{100.0 * slider:.0f}', slider),
                steps(f'steps_{100.0 * slider:.0f}'),
            ),
            slider=slider,
            is_corner=True,
        )
        for slider in CORNER_SLIDERS
    ),
    Experiment(
        check='corner_pause',
        motion=f'{_corner(0.1)} The program is paused in the corner, and goes on.',
        script=corner_script(),
        analyses=(corner_pause,),
        slider=0.1,
        is_corner=True,
        pauses=True,
    ),
)


def program(name: str, body: str) -> bytes:
    """Return the program ``ur_check_<name>`` with this body, for the primary interface."""
    lines = '\n'.join(f'  {line}' for line in body.splitlines())
    return f'def ur_check_{name}():\n{lines}\nend\n'.encode()


def return_program(pose: Sequence[float], speed: str = _SLOW) -> bytes:
    """
    Return a program that moves straight to a pose.

    :param pose: ``x y z rx ry rz`` of the TCP in the base [m, rad].
    :param speed: arguments of ``movel``, such as ``a=0.5, v=0.05``.
    """
    numbers = ', '.join(f'{value:.6f}' for value in pose)
    return program('return', f'movel(p[{numbers}], {speed})')
