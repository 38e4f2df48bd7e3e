# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Plan random goals with the planner of an older checkout and with this one, and compare.

    git worktree add /tmp/before COMMIT
    python test/support/compare_planners.py /tmp/before [-n GOALS] [-s SEED] [--case FAMILY:NUMBER]

The older package is copied under another name, and goals are pickled by the one and read by the
other, so both run in one process. For refusals, class, code and text are compared; for plans,
report, joints, primitives, outputs and reference path (1e-9), times and values that depend on them
(points are fitted to their times within 1e-7 s). If there are differences, each gets a line, and
the exit status is 1.

Families: the strategies of ``test_random_goals`` (``fuzz``), ``random_goals``, ``mixed_goals``;
``long``: many points of all kinds close together, with blends that just fit; ``spline``.

Intended differences do not count (:data:`REPAIRS`, :data:`INTENDED`, :func:`distinct`).
"""

import argparse
from collections import Counter
from dataclasses import fields, is_dataclass, replace
from importlib import import_module
from io import BytesIO
from pathlib import Path
import pickle
import re
import shutil
import sys
import tempfile

from hypothesis import given, HealthCheck, Phase, seed, settings
from hypothesis import strategies as st
from mixed_goals import mixed_case, MixedDraw, random_robot
import numpy as np
from random_goals import random_case

from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.kinematics.robot_models import robot_model
from ur_cartesian_driver.motion.goal.execution_modes import ExecutionMode
from ur_cartesian_driver.motion.goal.goal import Posture, SegmentType
from ur_cartesian_driver.motion.state.rtde_state import RobotState
import ur_cartesian_driver.planning as after
from ur_cartesian_driver.protocol.program.wire_dialects import DIALECTS

PACKAGE, OLD = 'ur_cartesian_driver', 'planner_before'
#: Mistakes that are repaired in the copy of an older planner: the blend behind a line that became
#: a joint move was kept from the run that failed.
REPAIRS = (
    (
        'drafts[n].blend_before = None\n',
        'drafts[n].blend_before = drafts[n].blend_after = None\n',
    ),
)
#: Lines that only one of both reports may have: a speed that rounding alone lowers has no remark
#: any more; inner points at which the arm stops are listed.
INTENDED = re.compile(r'slowed from (\S+) to \1 |: the arm stops there, because there is no blend')
#: If a margin is equally tight at several places, rounding decides which of them is named.
PLACE = re.compile(r' at \d+ %')
#: Older reports do not name the shapes between which a clearance was measured.
SHAPES = re.compile(r' \((cylinders|meshes of the \w+)\)')
#: Tolerances by the last name of a field; for others 1e-9 (relative to values above 1).
TOLERANCES = {
    **dict.fromkeys(('durations', 'duration'), 1e-7),
    # Moves of some milliseconds in a blend; the times of others hardly depend on these.
    **dict.fromkeys(('velocities', 'velocity'), 1e-5),
    **dict.fromkeys(('accelerations', 'acceleration', 'blend_entries'), 1e-5),
}
SHARES = {'fuzz': 0.35, 'mixed': 0.3, 'random': 0.15, 'long': 0.15, 'spline': 0.05}


def copy_before(checkout, folder):
    """Copy the package of a checkout under another name, :data:`OLD`."""
    package = folder / OLD
    shutil.copytree(Path(checkout) / PACKAGE, package, ignore=shutil.ignore_patterns('*.pyc'))
    for module in package.rglob('*.py'):
        text = module.read_text().replace(PACKAGE, OLD)
        for wrong, right in REPAIRS:
            text = text.replace(wrong, right)
        module.write_text(text)
    (package / '__init__.py').write_text('')


class _ByName(pickle.Pickler):
    def reducer_override(self, thing):
        """Reduce a dataclass to its fields by name: the older class may have fewer."""
        if not is_dataclass(thing) or isinstance(thing, type):
            return NotImplemented
        return made, (
            type(thing),
            {each.name: getattr(thing, each.name) for each in fields(thing)},
        )


class _Renaming(pickle.Unpickler):
    def find_class(self, module, name):
        """Return the class of the older package, or `unknown` if it has none."""
        try:
            return super().find_class(re.sub(rf'^{PACKAGE}\b', OLD, module), name)
        except (AttributeError, ModuleNotFoundError):
            return unknown


def unknown(*values):
    """Stand for a class that the older package lacks."""


def made(kind, values):
    """Return an object with the values that its class has fields for."""
    if kind is unknown:
        return None
    if kind.__name__ == 'Dialect':  # the row of the older table, whatever its fields
        return import_module(kind.__module__).DIALECTS[values['name']]
    thing = object.__new__(kind)
    for each in fields(kind):
        object.__setattr__(thing, each.name, values[each.name])
    return thing


def as_before(thing):
    """Return an object as one of the older package, without values that package lacks."""
    pickled = BytesIO()
    _ByName(pickled).dump(thing)
    return _Renaming(BytesIO(pickled.getvalue())).load()


# -- goals: (goal, state, arm, options) -----------------------------------------------------------


def state_of(arm, q, tool):
    """Return the state of an arm at rest."""
    pose = arm.forward(q) @ tool
    return RobotState(timestamp=0.0, actual_q=q, T_flange_tcp=tool, actual_tcp_pose=pose)


def drawn_options(rng, chosen):
    """Return options, some of them drawn at random."""
    chosen = {'self_collision': 'off', **chosen}
    if rng.random() < 0.3:
        chosen['on_posture_change'] = 'movej'
    if rng.random() < 0.2:
        chosen['singularity_margin_wrist'] = 0.0
    if rng.random() < 0.15:
        chosen['dialect'] = list(DIALECTS.values())[rng.integers(len(DIALECTS))]
    if rng.random() < 0.1:
        chosen['self_collision'] = 'auto'
    return after.PlanningOptions(**chosen)


def fuzz_goals(n, first):
    """Return sound and absurd goals, by the strategies of the tests."""
    sys.path.insert(0, str(Path(__file__).parents[1] / 'planning'))
    fuzz, cells = import_module('test_random_goals'), import_module('conftest')
    found = []

    @seed(first)
    @settings(
        max_examples=n,
        deadline=None,
        database=None,
        phases=[Phase.generate],
        suppress_health_check=list(HealthCheck),
    )
    @given(
        q=st.sampled_from(fuzz.STARTS),
        drawn=st.lists(fuzz.points, max_size=4),
        timed=st.booleans(),
        plain=st.booleans(),
        tolerance=fuzz.tolerances,
        frame=fuzz.frames,
        options=fuzz.choices,
    )
    def collect(q, drawn, timed, plain, tolerance, frame, options):
        cell = cells.Cell(q)
        goal = fuzz.goal_of(cell, drawn, timed, plain, tolerance, frame)
        chosen = after.PlanningOptions(self_collision='off', max_segment_time=1000.0, **options)
        found.append((goal, cell.state, cell.arm, chosen))

    collect()
    return found


def random_goals(n, first):
    """Yield goals on both sides of the limits of an arm."""
    for k in range(n):
        rng = np.random.default_rng([7, first, k])
        arm = Arm(robot_model(('ur5e', 'ur3', 'ur10e', 'ur16e')[k % 4]))
        case = random_case(arm, first * 100_000 + k)
        chosen = drawn_options(rng, {'max_approach_distance': 0.0})
        yield case.goal, state_of(arm, case.q, case.T_flange_tcp), arm, chosen


def mixed_goals(n, first):
    """Yield sound goals of all kinds, 25 for each of some robots."""
    for k in range(n):
        if k % 25 == 0:
            robot = random_robot(first, k // 25)
        rng = np.random.default_rng([8, first, k])
        case = mixed_case(robot, first, k // 25, k)
        state = state_of(robot.arm, case.q, case.T_flange_tcp)
        yield case.goal, state, robot.arm, drawn_options(rng, robot.options)


def long_goals(n, first):
    """Yield goals of many points close together."""
    T = SegmentType
    choices = (
        (T.LINEAR,),
        (T.AUTO, T.LINEAR, T.PROCESS),
        (T.PROCESS, T.CIRCULAR),
        (T.LINEAR, T.JOINT),
        (T.LINEAR, T.LINEAR, T.LINEAR, T.CIRCULAR, T.JOINT, T.PROCESS, T.OPTIMIZED_LINEAR),
        (T.JOINT,),
    )
    for k in range(n):
        if k % 10 == 0:
            robot = random_robot(first + 50, k // 10)
        rng = np.random.default_rng([9, first, k])
        draw = MixedDraw(robot.arm, rng)
        draw.max_speed = robot.options['max_tool_speed']
        kinds = choices[rng.integers(len(choices))]
        size, turn = draw.between(1e-3, 0.02), draw.between(1e-3, 0.3)
        turn = 0.0 if rng.random() < 0.3 else turn
        for i in range(rng.integers(20, 40 if T.JOINT in kinds else 150)):
            pose = draw.pose if i and rng.random() < 0.002 else draw.shifted(size, turn)
            posture = draw.posture(draw.last, 3) if rng.random() < 0.002 else Posture()
            draw.add(pose, kinds[rng.integers(len(kinds))], posture)
        draw.blended, draw.oversized = rng.choice((0.0, 0.9)), 0.02
        case = draw.case('long')
        goal = with_touching_blends(case.goal, rng) if rng.random() < 0.4 else case.goal
        state = state_of(robot.arm, case.q, case.T_flange_tcp)
        yield goal, state, robot.arm, drawn_options(rng, robot.options)


def with_touching_blends(goal, rng):
    """Return a goal with blends that just touch each other."""
    gaps = np.linalg.norm(
        np.diff([point.pose.position for point in goal.waypoints], axis=0), axis=1
    )
    radii = 0.5 * np.minimum(gaps[:-1], gaps[1:]) * (1.0 + 1e-10)
    radii = [0.4 * gaps[0], *radii, 0.0]
    return replace(
        goal,
        segments=tuple(
            replace(segment, blend_radius=float(radius)) if rng.random() < 0.9 else segment
            for segment, radius in zip(goal.segments, radii, strict=False)
        ),
    )


def spline_goals(n, first):
    """Yield goals of SPLINE and SERVO in turn."""
    robot = random_robot(first + 90, 0)
    for k in range(n):
        rng = np.random.default_rng([10, first, k])
        draw = MixedDraw(robot.arm, rng)
        draw.max_speed = robot.options['max_tool_speed']
        draw.execution = (ExecutionMode.SPLINE, ExecutionMode.SERVO)[k % 2]
        for _ in range(rng.integers(2, 40)):
            draw.add(draw.shifted(draw.between(1e-3, 0.05), 0.1))
        case = draw.case('spline')
        state = state_of(robot.arm, case.q, case.T_flange_tcp)
        yield case.goal, state, robot.arm, drawn_options(rng, robot.options)


# -- comparison -----------------------------------------------------------------------------------


def outcome(package, goal, state, arm, options):
    """Return the plan, or the error."""
    try:
        return package.plan(goal, state, arm, options)
    except Exception as error:
        return error


def described(error):
    """Return class, code and text of an error."""
    code = getattr(error, 'code', None)
    return f'{type(error).__name__} {getattr(code, "value", code)}: {error}'


def field_of(thing, name):
    """Return a field; of ``vias``, only rows with a via, because others have any number."""
    value = getattr(thing, name)
    return value[thing.has_via] if name == 'vias' else value


def difference(a, b, path):
    """Return the first difference of two values, with its place; '' = they are equal."""
    if is_dataclass(a):
        if type(a).__name__ != type(b).__name__:
            return f'{path}: {type(a).__name__}, {type(b).__name__}'
        names = sorted({f.name for f in fields(a)} & {f.name for f in fields(b)})
        pairs = [(f'{path}.{name}', field_of(a, name), field_of(b, name)) for name in names]
    elif isinstance(a, dict):
        if set(a) != set(b):
            return f'{path}: keys {set(a) ^ set(b)}'
        pairs = [(f'{path}[{key}]', a[key], b[key]) for key in a]
    elif isinstance(a, float | np.ndarray):
        bound = TOLERANCES.get(path.rpartition('.')[2], 1e-9)
        if np.shape(a) == np.shape(b) and np.allclose(
            a, b, rtol=bound, atol=bound, equal_nan=True
        ):
            return ''
        if np.shape(a) == np.shape(b) != ():
            return f'{path}: by {np.nanmax(np.abs(a - b))}'
        return f'{path}: {a}, {b}'
    elif hasattr(a, '__len__') and not isinstance(a, str):
        if len(a) != len(b):
            return f'{path}: {len(a)}, {len(b)} of them'
        pairs = [(f'{path}[{k}]', x, y) for k, (x, y) in enumerate(zip(a, b, strict=True))]
    else:  # enumerations of both packages have other classes, but the same values
        a, b = getattr(a, 'value', a), getattr(b, 'value', b)
        return '' if a == b else f'{path}: {a!r}, {b!r}'
    return next((found for name, x, y in pairs if (found := difference(x, y, name))), '')


def distinct(reference):
    """Return the rows (n, 9) of a reference path that do not repeat the one before."""
    columns = (reference.poses, reference.blend_tolerance)
    rows, time = np.concatenate(columns, axis=1), reference.time
    near = (np.abs(np.diff(rows[:, :7], axis=0)) < 1e-9).all(axis=1) & (np.diff(time) < 1e-7)
    groups = np.flatnonzero(np.append(True, ~near))
    found = rows[np.append(~near, True)]
    found[:, 7:] = np.maximum.reduceat(rows[:, 7:], groups, axis=0)
    return found


def compare(old, new):
    """Return the first difference of two outcomes; '' = they are equal."""
    if isinstance(old, Exception) or isinstance(new, Exception):
        a, b = (described(one) if isinstance(one, Exception) else 'planned' for one in (old, new))
        return '' if a == b else f'\n    {a}\n    {b}'
    reports = [
        [SHAPES.sub('', PLACE.sub('', line)) for line in one.report if not INTENDED.search(line)]
        for one in (old, new)
    ]
    for a, b in zip(*reports, strict=False):
        if a != b:
            return f'report:\n    {a}\n    {b}'
    if len(reports[0]) != len(reports[1]):
        return f'report: {len(reports[0])}, {len(reports[1])} lines'
    if found := difference(distinct(old.reference), distinct(new.reference), 'reference'):
        return found
    names = ('rows', 'start', 'duration', 'T_flange_active', 'T_flange_tcp', 'T_tcp_controlled')
    for name in (*names, 'execution', 'goal'):
        a, b = getattr(old, name), getattr(new, name)
        if name == 'rows':  # reports are compared above; primitives may be columns or objects
            a, b = (
                replace(rows, report_lines=(), notes={}, primitives=tuple(rows.primitives))
                for rows in (a, b)
            )
        if found := difference(a, b, name):
            return found
    return ''


def main():
    """Compare, and print counts and differences."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument('before', help='an older checkout')
    parser.add_argument('-n', type=int, default=2000, help='number of goals')
    parser.add_argument('-s', type=int, default=1, help='seed')
    parser.add_argument('--case', default=':', help='compare one goal only')
    args = parser.parse_args()
    only, _, number = args.case.partition(':')
    counts, wrong = Counter(), 0
    with tempfile.TemporaryDirectory() as folder:
        copy_before(args.before, Path(folder))
        sys.path.insert(0, folder)
        before = import_module(f'{OLD}.planning')
        for family, share in SHARES.items():
            n = round(share * args.n)
            goals = globals()[f'{family}_goals'](n, args.s) if only in ('', family) else ()
            for k, case in enumerate(goals):
                if number and k != int(number):
                    continue
                old, new = outcome(before, *map(as_before, case)), outcome(after, *case)
                counts[f'{family}: {type(old).__name__}'] += 1
                if found := compare(old, new):
                    wrong += 1
                    print(f'{family}:{k}: {found}', flush=True)
    for name, count in sorted(counts.items()):
        print(f'{count:6d}  {name}')
    print(f'{counts.total()} goals, {wrong} different')
    return 1 if wrong else 0


if __name__ == '__main__':
    sys.exit(main())
