# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Our own recordings: streams that count, streams that are said, and damaged files."""

from dataclasses import replace
import io

from broken_files import goal_or_sentence
import numpy as np
import pytest
from random_cases import cases, random_of
from synthetic_recording import only_file, packet, record

from ur_cartesian_driver.importing import BrokenFile, import_file, ImportOptions, Treatment
from ur_cartesian_driver.importing.recording_file import TERMS
from ur_cartesian_driver.motion.geometry.pose import Pose


def moving(i, period=0.002):
    """The i-th packet of a tool that moves 1 mm in a packet; the clock begins at 1000 s."""
    return replace(
        packet(i),
        timestamp=1000.0 + i * period,
        actual_tcp_pose=Pose((0.001 * i, 0.2, 0.3), (0.0, 0.6, 0.0, 0.8)),
        actual_q=(0.1, 0.2, 0.3, 0.4, 0.5, 0.6),
    )


@pytest.fixture(scope='module')
def recording(tmp_path_factory):
    """A recording of 40 packets."""
    folder = tmp_path_factory.mktemp('recording')
    record(folder, [moving(i) for i in range(40)])
    return only_file(folder)


def arrays_of(file):
    with np.load(file) as arrays:
        return dict(arrays)


@pytest.mark.parametrize('term', TERMS.values(), ids=TERMS)
def test_each_stream_is_treated_as_the_table_says(recording, term):
    found = import_file(recording)
    if term.treatment is Treatment.LEFT_OUT:
        remark = next(r for r in found.remarks if term.name in r.what.split(', '))
        assert remark.why == term.reason
        return
    expected = arrays_of(recording)[term.name]
    points = found.goal.waypoints
    holds = {
        'time': lambda: points.times == pytest.approx(expected - expected[0]),
        'actual_pose': lambda: np.array(points.poses) == pytest.approx(expected),
        'actual_q': lambda: points.postures[0].values == pytest.approx(expected[0]),
        'digital_output': lambda: not found.goal.io_commands,
    }
    assert holds[term.name]()


def test_every_array_of_a_recording_is_a_term(recording):
    assert set(arrays_of(recording)) == set(TERMS)


def test_an_output_that_changes_is_switched(tmp_path, recording):
    arrays = arrays_of(recording)
    arrays['digital_output'][:] = 0
    arrays['digital_output'][5:20] = 1 << 3 | 1 << 16
    np.savez(tmp_path / 'a.npz', **arrays)
    commands = import_file(tmp_path / 'a.npz').goal.io_commands
    assert [(c.waypoint, c.output.name, c.pin, c.value) for c in commands] == [
        (5, 'STANDARD_DIGITAL', 3, 1.0),
        (5, 'TOOL_DIGITAL', 0, 1.0),
        (20, 'STANDARD_DIGITAL', 3, 0.0),
        (20, 'TOOL_DIGITAL', 0, 0.0),
    ]


def test_a_recording_whose_process_was_killed_is_read_from_its_folder(tmp_path, recording):
    from ur_cartesian_driver.driver.recordings import recording_format as disk

    arrays = arrays_of(recording)
    folder = tmp_path / 'a.part'
    folder.mkdir()
    rows = np.zeros(40, dtype=disk.EXECUTED_DTYPE)
    for name in rows.dtype.names:
        rows[name] = arrays[name]
    plan = np.zeros(len(arrays['planned_time']), dtype=disk.PLANNED_DTYPE)
    for name in plan.dtype.names:
        plan[name] = arrays[f'planned_{name}']
    np.save(folder / disk.EXECUTED_FILE, rows)
    np.save(folder / disk.PLANNED_FILE, plan)
    (folder / disk.METADATA_FILE).write_text(arrays['metadata'].item())
    (folder / disk.EVENTS_FILE).write_text('')
    goal = import_file(folder).goal
    assert np.array(goal.waypoints.poses) == pytest.approx(arrays['actual_pose'])


@pytest.mark.parametrize(
    ('arrays', 'sentence'),
    [
        (
            {'positions': np.zeros((3, 3))},
            'the file is no recording of the driver: it has no array',
        ),
        ({}, 'the file is no recording of the driver: it has no array'),
        (
            {'metadata': np.array([1, None], dtype=object)},
            'the file is damaged: its arrays cannot',
        ),
    ],
)
def test_arrays_of_others_are_refused_in_a_sentence(tmp_path, arrays, sentence):
    np.savez(tmp_path / 'a.npz', **arrays)
    with pytest.raises(BrokenFile) as caught:
        import_file(tmp_path / 'a.npz')
    assert str(caught.value).startswith(sentence)


@pytest.mark.parametrize('name', ['actual_pose', 'actual_q', 'time'])
def test_a_column_of_another_shape_is_refused(tmp_path, recording, name):
    arrays = arrays_of(recording)
    for changed in (arrays[name][:-1], arrays[name].astype('<f4'), arrays[name][..., None]):
        np.savez(tmp_path / 'a.npz', **arrays | {name: changed})
        with pytest.raises(BrokenFile, match=r'^the file is damaged: '):
            import_file(tmp_path / 'a.npz')


def test_an_archive_that_leads_before_its_beginning_is_damaged(tmp_path, recording):
    data = bytearray(recording.read_bytes())
    data[-3] = 1  # the highest byte of the place of its directory
    (tmp_path / 'a.npz').write_bytes(data)
    with pytest.raises(BrokenFile) as caught:
        import_file(tmp_path / 'a.npz')
    assert str(caught.value) == 'the file is damaged: its arrays cannot be read.'


@pytest.mark.random
def test_broken_recordings_become_goals_as_numpy_reads_them_or_sentences(tmp_path, recording):
    file = tmp_path / 'a.npz'
    whole, arrays = recording.read_bytes(), arrays_of(recording)
    goals = sentences = 0
    for i in range(cases(10_000)):
        random = random_of('broken recordings', i)
        if random.random() < 0.5:
            data = damaged(whole, random)
        else:
            changed = {name: values.copy() for name, values in arrays.items()}
            for _ in range(random.randint(1, 3)):
                damage(changed, random)
            buffer = io.BytesIO()
            np.savez(buffer, **changed)
            data = buffer.getvalue()
        found = goal_or_sentence(file, data, ImportOptions())
        if isinstance(found, str):
            sentences += 1
            continue
        goals += 1
        with np.load(file) as read:
            expected = read['actual_pose'][found.lines - 1]
        assert np.array(found.goal.waypoints.poses)[:, :3] == pytest.approx(expected[:, :3])
    assert goals > cases(10_000) // 20
    assert sentences > cases(10_000) // 4


def damaged(data, random):
    """Return bytes that are cut, or changed in single places."""
    if random.random() < 0.3:
        return data[: random.randrange(len(data))]
    changed = bytearray(data)
    for _ in range(random.randint(1, 4)):
        changed[random.randrange(len(changed))] = random.randrange(256)
    return bytes(changed)


def damage(arrays, random):
    """Change, shorten or leave out one array."""
    name = random.choice(list(arrays))
    values = arrays[name]
    fault = random.randrange(6)
    if fault == 0:
        del arrays[name]
    elif fault == 1 and values.ndim:
        arrays[name] = values[: random.randrange(len(values) + 1)]
    elif fault == 2:
        arrays[name] = values.astype('U8')
    elif values.dtype.kind == 'f' and values.size:
        values.ravel()[random.randrange(values.size)] = random.choice(
            (np.nan, np.inf, 1e300, 0.0, -1.0, 25.0)
        )
    elif values.dtype.kind == 'i' and values.size:
        values.ravel()[random.randrange(values.size)] = random.choice((-1, 0, 7, 2**31 - 1))
