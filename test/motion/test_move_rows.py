# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The primitives of a plan in columns: the same primitives, and the same bytes."""

from dataclasses import replace

import numpy as np
import pytest

from ur_cartesian_driver.motion.errors import LocalProtocolError
from ur_cartesian_driver.motion.geometry.pose import Pose
from ur_cartesian_driver.motion.goal.goal import ArcMode, OutputKind
from ur_cartesian_driver.motion.plan.move_rows import (
    blend_radii,
    has_optimized,
    MoveRows,
    MOVES,
    SplineRows,
)
from ur_cartesian_driver.motion.plan.plan import LateLines, PlannedRows
from ur_cartesian_driver.motion.plan.primitive import (
    MoveC,
    MoveJ,
    MoveL,
    OptimoveL,
    Spline,
    SwitchOutput,
)
from ur_cartesian_driver.protocol.program.trajectory_points import encode_points, encode_rows
from ur_cartesian_driver.protocol.program.wire_dialects import DIALECTS

ARC = MoveC(target=Pose((0.1, 0.2, 0.3)), via=(0.1,) * 6, blend_radius=0.02)
WAIT = Spline(target=(0.5,) * 6, velocities=(0.0,) * 6, duration=2.0)
GLUE = SwitchOutput(output=OutputKind.STANDARD_DIGITAL, pin=2, value=1.0)
OUTPUTS = {3: (GLUE, replace(GLUE, value=0.0)), 7: (GLUE,)}


def rows(n=12, seed=0, **columns):
    rng = np.random.default_rng(seed)
    kinds = rng.integers(0, len(MOVES), n)
    quaternions = rng.normal(size=(n, 4))
    quaternions /= np.linalg.norm(quaternions, axis=1)[:, None]
    moves = MoveRows(
        **{
            'kinds': kinds,
            'targets': np.concatenate([rng.normal(size=(n, 3)), quaternions], axis=1),
            'q_near': rng.uniform(-6.0, 6.0, (n, 6)),
            'has_q_near': rng.random(n) < 0.5,
            'vias': np.concatenate([rng.normal(size=(n, 3)), quaternions[::-1]], axis=1),
            'arc_modes': rng.integers(0, len(ArcMode), n),
            'velocities': rng.uniform(0.01, 1.0, n),
            'accelerations': rng.uniform(0.01, 1.0, n),
            'durations': np.where(kinds <= MOVES.index(MoveL), rng.uniform(0.0, 9.0, n), 0.0),
            'blend_radii': rng.uniform(0.0, 0.1, n),
            'others': {2: ARC, 5: WAIT},
        }
        | columns
    )
    return PlannedRows(
        waypoints=np.arange(n, dtype=np.int32),
        lengths=np.ones(n),
        angles=np.zeros(n),
        durations=np.ones(n),
        blend_entries=np.zeros((n, 5)),
        joints=np.zeros((n, 6)),
        primitives=moves,
        report_lines=('',) * n,
        outputs=OUTPUTS,
    )


def instructions(plan):
    for segment in plan:
        yield segment.primitive
        yield from segment.outputs


@pytest.mark.parametrize('seed', range(20))
def test_the_bytes_are_those_of_the_primitives(seed):
    plan = rows(seed=seed)
    again = PlannedRows.of(list(plan))
    assert encode_rows(plan) == encode_rows(again) == encode_points(instructions(plan))
    assert len(encode_rows(plan)) == 84 * plan.records.sum() == 84 * 15
    assert [type(primitive) for primitive in plan.primitives][2] is MoveC
    assert plan.primitives[5] == WAIT
    assert plan[3].outputs == OUTPUTS[3]


def test_many_rows_are_encoded_in_chunks():
    plan = replace(rows(10_000), outputs={9_999: (GLUE,)})
    assert encode_rows(plan) == encode_points(instructions(plan))


@pytest.mark.parametrize(
    ('columns', 'sentence'),
    [
        ({'velocities': np.full(12, -0.1)}, r'Point 0: velocity is -0\.1'),
        ({'blend_radii': np.where(np.arange(12) == 4, -1.0, 0.0)}, r'Point 6: blend_radius is -1'),
        ({'durations': np.where(np.arange(12) == 8, 1e9, 0.0)}, r'Point 11: duration is 10+\.0 s'),
        ({'kinds': np.full(12, 4), 'velocities': np.full(12, 1.5)}, r'Point 0: velocity is 1\.5'),
        ({'targets': np.full((12, 7), 1e9)}, r'Point 0: target\[0\]'),
        ({'accelerations': np.full(12, np.nan)}, r'Point 0: acceleration'),
    ],
)
def test_what_cannot_be_sent_is_refused_by_record_and_field(columns, sentence):
    kinds = {'kinds': np.ones(12, dtype=np.int64), 'others': {}} | columns
    plan = rows(**kinds)
    with pytest.raises(LocalProtocolError, match=sentence) as one:
        encode_rows(plan)
    with pytest.raises(LocalProtocolError, match=sentence) as other:
        encode_points(instructions(plan))
    assert str(one.value) == str(other.value)


def test_a_dialect_without_outputs_or_q_near_says_so():
    with pytest.raises(LocalProtocolError, match='Point 4: SWITCH_OUTPUT'):
        encode_rows(rows(others={}), DIALECTS['2.12'])
    with pytest.raises(LocalProtocolError, match=r'does not exist in wire dialect 2\.0'):
        encode_rows(rows(), DIALECTS['2.0'])


def test_radii_and_optimized_moves_are_found_among_all():
    plan = rows(blend_radii=np.full(12, 0.02))
    objects = tuple(plan.primitives)
    assert blend_radii(plan.primitives)[2] == blend_radii(objects)[2] == ARC.blend_radius
    assert has_optimized(plan.primitives) == has_optimized(objects) is True
    lines = rows(kinds=np.ones(12, dtype=np.int64))
    assert not has_optimized(lines.primitives)
    assert {type(primitive) for primitive in lines.primitives} == {MoveL, MoveC, Spline}
    one = {4: OptimoveL(target=Pose())}
    assert has_optimized(rows(kinds=np.ones(12, dtype=np.int64), others=one).primitives)
    assert isinstance(rows(kinds=np.zeros(12, dtype=np.int64)).primitives[0], MoveJ)


@pytest.mark.parametrize('quintic', [True, False])
def test_pieces_of_a_spline_are_encoded_from_columns(quintic):
    rng = np.random.default_rng(3)
    pieces = SplineRows(
        targets=rng.uniform(-3.0, 3.0, (8, 6)),
        velocities=rng.uniform(-1.0, 1.0, (8, 6)),
        accelerations=rng.uniform(-1.0, 1.0, (8, 6)),
        durations=rng.uniform(0.1, 2.0, 8),
        quintic=np.full(8, quintic),
    )
    plan = replace(rows(8), primitives=pieces)
    assert encode_rows(plan) == encode_points(instructions(plan))
    assert (plan.primitives[0].accelerations is not None) == quintic
    assert not has_optimized(pieces)
    assert not blend_radii(pieces).any()
    short = replace(plan, primitives=replace(pieces, durations=np.full(8, 1e-9)))
    with pytest.raises(LocalProtocolError, match='Point 0: duration is 1e-09 s'):
        encode_rows(short)


def test_only_lines_that_are_read_are_made():
    made = []

    def make(rows):
        made.append(rows)
        return [str(row) for row in rows]

    lines = LateLines(range(5000), make)
    part = lines[100:2500]
    assert (len(lines), len(part), part[0], part[-1]) == (5000, 2400, '100', '2499')
    assert made == [range(100, 101), range(2499, 2500)]
    made.clear()
    assert list(part) == [str(row) for row in range(100, 2500)]
    assert made == [range(100, 1100), range(1100, 2100), range(2100, 2500)]
    with pytest.raises(IndexError):
        part[2400]


def test_lines_are_made_when_one_is_read():
    made = []

    def make():
        made.append(1)
        return ['a', 'b', 'c']

    lines = LateLines.at_once(3, make)
    part = lines[1:]
    assert (len(lines), len(part), made) == (3, 2, [])
    assert (part[0], part[-1], lines[0], list(lines)) == ('b', 'c', 'a', ['a', 'b', 'c'])
    assert made == [1]
    with pytest.raises(IndexError):
        part[2]
