# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Recordings on disk: of a whole motion, of half a motion, and on a full disk."""

from collections.abc import Callable
import contextlib
from dataclasses import replace
import json
import os
import pathlib
import pickle
import resource
import signal
import subprocess
import sys
import threading
import tracemalloc
from typing import cast

from checkout import CHECKOUT, needs_checkout
import numpy as np
import pytest
from synthetic_recording import (
    DONE,
    JOB,
    METADATA,
    only_file,
    outputs,
    packet,
    path,
    PERIOD,
    record,
    SPEED,
    START,
    wait_for_writer,
    Warnings,
)

from ur_cartesian_driver.driver import DriverConfig
from ur_cartesian_driver.driver.recordings import recording_format
from ur_cartesian_driver.driver.recordings.recorder import (
    BUFFER_COUNT,
    BUFFER_ROWS,
    MAX_PENDING_JOBS,
    motion_metadata,
    plan_metadata,
    Recorder,
)
from ur_cartesian_driver.driver.recordings.recording import Recording
from ur_cartesian_driver.driver.recordings.recording_folder import enforce_quota, recording_name
from ur_cartesian_driver.execution.goal.motion_job import job_from_plan
from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.kinematics.robot_models import robot_model
from ur_cartesian_driver.motion.geometry.pose import Pose
from ur_cartesian_driver.motion.goal.goal import Goal, Waypoint
from ur_cartesian_driver.motion.goal.moving_frame import MovingFrame
from ur_cartesian_driver.motion.state.rtde_state import RobotState, RuntimeState, SafetyMode
from ur_cartesian_driver.planning import plan, PlanningOptions

# ---- contents of a file -------------------------------------------------------------------------


def test_a_recording_of_a_held_part_compares_on_the_part(tmp_path):
    """The TCP in base is kept; the deviation is that of the tool from the path on the part."""
    turned = Pose((0.1, 0.2, 0.3), (0.5, 0.5, 0.5, 0.5))
    held = MovingFrame(T_flange_frame=Pose((0.0, 0.0, 0.1)), T_base_tool=turned)
    T_flange_tcp = Pose((0.0, 0.05, 0.0))

    def seen(i):
        """The packet whose tool on the part is where the plain one has its TCP."""
        plain = packet(i, T_flange_tcp=T_flange_tcp)
        return replace(
            plain,
            actual_tcp_pose=held.flange(plain.actual_tcp_pose) @ T_flange_tcp,
            target_tcp_pose=held.flange(plain.target_tcp_pose) @ T_flange_tcp,
        )

    job = replace(JOB, moving_frame=held, T_flange_active=T_flange_tcp)
    metadata = motion_metadata(job, robot={}, parameters=DriverConfig())
    recorder = Recorder(str(tmp_path), 10.0, Warnings())
    recorder.start(job, metadata, seen(0))
    for i in range(1, 200):
        recorder.add_state(seen(i))
    recorder.end(DONE)
    recorder.close(30.0)
    found = Recording.load(only_file(tmp_path))
    assert found.actual_pose[10] == pytest.approx(seen(10).actual_tcp_pose.row())
    on_part = found.on_the_part()
    assert on_part.target_pose[10, :3] == pytest.approx(packet(10).target_tcp_pose.position)
    assert on_part.on_the_part() is on_part
    deviation = found.deviation()
    assert deviation.position == pytest.approx(0.001, abs=1e-9)
    assert deviation.target_position == pytest.approx(0.0, abs=1e-9)


def test_a_recording_holds_every_packet_as_it_came(tmp_path):
    packets = [packet(i) for i in range(1000)]
    assert record(tmp_path, packets) == []
    found = Recording.load(only_file(tmp_path))
    np.testing.assert_array_equal(found.time, [p.timestamp - START for p in packets])
    for name, values in {
        'actual_q': [p.actual_q for p in packets],
        'target_q': [p.target_q for p in packets],
        'actual_pose': [p.actual_tcp_pose.row() for p in packets],
        'target_pose': [p.target_tcp_pose.row() for p in packets],
        'actual_twist': [p.actual_tcp_twist for p in packets],
        'speed_scaling': [1.0] * 1000,
        'safety_mode': [SafetyMode.NORMAL] * 1000,
    }.items():
        np.testing.assert_array_equal(getattr(found, name), values, err_msg=name)
    assert np.isnan(found.lag).all()


def test_numpy_alone_opens_a_recording_without_pickle(tmp_path):
    record(tmp_path, [packet(i) for i in range(10)])
    with np.load(only_file(tmp_path), allow_pickle=False) as file:
        shapes = {name: file[name].shape for name in file.files}
        metadata = json.loads(file['metadata'].item())
    assert shapes['actual_pose'] == (10, 7)
    assert shapes['planned_pose'] == (4, 7)
    assert metadata['outcome'] == {
        'code': 0,
        'name': 'SUCCESSFUL',
        'text': 'Done.',
        'report': ['a line'],
    }
    assert metadata['report'] == ['point 0: there']
    assert metadata['parameters']['x'] == 1
    assert metadata['parameters']['ur_type'] == 'ur5e'


def test_the_deviation_is_what_the_arm_was_beside_its_plan(tmp_path):
    record(tmp_path, [packet(i) for i in range(0, 2000, 20)])
    off = Recording.load(only_file(tmp_path)).deviation()
    np.testing.assert_allclose(off.position, 0.001, atol=1e-12)
    np.testing.assert_allclose(off.target_position, 0.0, atol=1e-12)
    np.testing.assert_allclose(off.planned_time, np.arange(0, 2000, 20) * PERIOD, atol=1e-9)
    assert set(off.waypoint) == {0, 1}


def test_events_are_what_changed_and_what_was_noted_in_the_order_of_time(tmp_path):
    def between(recorder, i):
        if i == 10:
            recorder.add_signals(outputs(1 << 0))
        elif i == 30:
            recorder.add_signals(outputs(1 << 0 | 1 << 9 | 1 << 17))
        elif i == 300:
            recorder.add_event('cancel', '')

    def state(i):
        begun = 7 if i < 5 else 1 if i < 100 else 2  # 7: of the goal before
        return packet(
            i,
            begun,
            target_speed_fraction=0.5 if i >= 200 else 1.0,
            runtime_state=(RuntimeState.PAUSED if 250 <= i < 280 else RuntimeState.PLAYING),
        )

    record(
        tmp_path,
        map(state, range(400)),
        between=between,
        where=lambda i: (int(i >= 100), 1.0 - 0.001 * i),
    )
    found = Recording.load(only_file(tmp_path))
    assert [(round(time / PERIOD), kind, text) for time, kind, text in found.events] == [
        (0, 'start', 'PRIMITIVES, 2 points'),
        (1, 'point', 'on the way to point 0'),
        (31, 'output', 'configurable digital output 1: on'),
        (31, 'output', 'tool digital output 1: on'),
        (100, 'point', 'on the way to point 1'),
        (200, 'slider', 'speed slider at 50 %'),
        (250, 'program', 'robot program PAUSED'),
        (280, 'program', 'robot program PLAYING'),
        (300, 'cancel', ''),
        (399, 'end', 'SUCCESSFUL: Done.'),
    ]
    assert list(found.points_begun[[4, 5, 399]]) == [0, 1, 2]
    np.testing.assert_allclose(found.buffered[1:], 1.0 - 0.001 * np.arange(1, 400))


def test_what_a_path_is_continued_by_takes_the_place_of_its_ending(tmp_path):
    def between(recorder, i):
        if i == 50:  # from 0.3 m on, the arm does not stop at 0.4 m
            recorder.add_plan(path(0.3, 0.6, 1), 0.4 / SPEED)
        elif i == 60:
            recorder.add_plan(path(0.5, 0.7, 2), 0.5 / SPEED)

    record(tmp_path, [packet(i) for i in range(160)], between=between)
    found = Recording.load(only_file(tmp_path))
    np.testing.assert_allclose(found.planned_pose[:, 0], [0.0, 0.2, 0.2, 0.4, 0.7])
    assert list(found.planned_point) == [0, 0, 1, 1, 2]
    assert found.points.shape == (3, 7)


def test_files_are_named_after_time_and_motion_and_never_overwritten(tmp_path):
    for _ in range(2):
        record(tmp_path, [packet(0)])
    name = recording_name(METADATA)
    assert name.endswith('_primitives_2_points')
    assert {file.name for file in tmp_path.iterdir()} == {f'{name}.npz', f'{name}_2.npz'}


def test_nothing_is_recorded_without_a_directory(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert record('', [packet(0), packet(1)]) == []
    assert list(tmp_path.iterdir()) == []


# ---- where there is no room, or no end ----------------------------------------------------------


@pytest.mark.slow
def test_an_endless_motion_takes_no_memory(tmp_path):
    count, packets = 8_000, [packet(i) for i in range(100)]
    recorder = Recorder(str(tmp_path), 100.0, Warnings())
    recorder.start(JOB, dict(METADATA), packet(0))
    tracemalloc.start()
    try:
        for i in range(1, count):
            wait_for_writer(recorder)
            recorder.add_state(packets[i % len(packets)])
        recorder.end(DONE)
        recorder.close(30.0)
        _, peak = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    file = only_file(tmp_path)
    size = count * recording_format.EXECUTED_STRUCT.size
    assert file.stat().st_size > size
    assert peak < 0.1 * size


def test_a_disk_that_is_too_slow_costs_rows_and_not_memory(tmp_path):
    """Nobody writes while the packets come: what there is no memory for is counted."""
    recorder = Recorder(str(tmp_path), 100.0, Warnings())
    recorder.start(JOB, dict(METADATA), packet(0))
    held = [recorder._free_buffers.get() for _ in range(BUFFER_COUNT - 1)]
    count = 3 * BUFFER_ROWS
    for i in range(1, count):
        recorder.add_state(packet(i))
    for piece in held:
        recorder._free_buffers.put(piece)
    recorder.end(DONE)
    recorder.close(10.0)
    found = Recording.load(only_file(tmp_path))
    assert len(found.time) + found.metadata['rows_left_out'] == count
    assert found.metadata['rows_left_out'] > BUFFER_ROWS


@contextlib.contextmanager
def a_disk_of(size):
    """Let no file of this process become larger [bytes]."""
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, limits[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)


def test_a_stalled_disk_costs_pieces_of_the_plan_with_a_warning_and_nothing_else(tmp_path):
    warnings = Warnings()
    recorder = Recorder(str(tmp_path), 100.0, warnings)
    recorder._start_workers()
    stalled = threading.Event()
    recorder._writer.submit(cast('Callable[[], None]', stalled.wait))
    for _ in range(MAX_PENDING_JOBS):
        recorder._writer.submit(lambda: None)
    recorder.start(JOB, dict(METADATA), packet(0))
    for i in range(1, 10):
        recorder.add_state(packet(i))
    recorder.end(DONE)
    stalled.set()
    recorder.close(10.0)
    found = Recording.load(only_file(tmp_path))
    assert len(found.time) == 10
    assert found.metadata['outcome']['name'] == 'SUCCESSFUL'
    assert warnings == [found.metadata['trouble']]
    assert 'Pieces of the plan are missing' in warnings[0]


def test_the_metadata_of_a_recording_are_whole_at_every_moment(tmp_path, monkeypatch):
    """A full disk at the second writing spoils nothing of the first."""
    written = []

    def write_text(self, text, encoding):
        written.append(self)
        if len(written) == 2:
            self.touch()
            raise OSError(28, 'No space left on device')
        self.write_bytes(text.encode(encoding))

    monkeypatch.setattr(pathlib.Path, 'write_text', write_text)
    record(tmp_path, [packet(i) for i in range(10)])
    (folder,) = tmp_path.iterdir()
    assert Recording.load(folder).metadata['points'] == METADATA['points']


def test_a_full_disk_ends_the_recording_with_one_sentence_and_keeps_what_was_written(tmp_path):
    with a_disk_of(200_000):
        warnings = record(tmp_path, [packet(i) for i in range(1000)])
    (sentence,) = warnings
    assert 'File too large' in sentence
    assert 'record_directory' in sentence
    found = Recording.load(only_file(tmp_path))
    assert 200 < len(found.time) < 420
    np.testing.assert_array_equal(
        found.time, [i * PERIOD + START - START for i in range(len(found.time))]
    )
    assert found.metadata['outcome'] is None


def test_a_directory_that_cannot_be_written_is_said_once_not_with_each_motion(tmp_path):
    blocked = tmp_path / 'file'
    blocked.write_text('no directory')
    warnings = Warnings()
    recorder = Recorder(str(blocked / 'below'), 100.0, warnings)
    for _ in range(3):
        recorder.start(JOB, dict(METADATA), packet(0))
        for i in range(3 * BUFFER_ROWS * BUFFER_COUNT):
            recorder.add_state(packet(i))
        recorder.end(DONE)
    recorder.close(10.0)
    assert len(warnings) == 1
    assert 'Not a directory' in warnings[0]


def test_a_motion_that_takes_more_than_half_of_the_room_is_recorded_as_far_as_that(tmp_path):
    warnings = record(tmp_path, [packet(i) for i in range(1500)], max_size=0.5)
    assert ['half of record_max_size (0.5 MB)' in text for text in warnings] == [True]
    found = Recording.load(only_file(tmp_path))
    assert found.metadata['trouble'] == warnings[0]
    assert found.metadata['outcome']['name'] == 'SUCCESSFUL'
    assert 400 < len(found.time) < 800


def test_the_oldest_recordings_make_room_and_other_files_stay(tmp_path):
    names = [f'2026010{day}-120000-000_spline_5_points' for day in (1, 2, 3)]
    for name in [*names, 'kept for the report']:
        (tmp_path / f'{name}.npz').write_bytes(bytes(1000))
    enforce_quota(tmp_path, 2500.0)
    assert {file.stem for file in tmp_path.iterdir()} == {*names[1:], 'kept for the report'}


def test_a_folder_that_cannot_be_finished_makes_room_too(tmp_path):
    damaged = tmp_path / '20260101-120000-000_spline_5_points.part'
    damaged.mkdir()
    (damaged / 'executed.npy').write_bytes(bytes(1000))
    (tmp_path / '20260102-120000-000_spline_5_points.npz').write_bytes(bytes(1000))
    enforce_quota(tmp_path, 2000.0)
    assert damaged.exists()
    enforce_quota(tmp_path, 1500.0)
    assert only_file(tmp_path).suffix == '.npz'


# ---- killed in the middle -----------------------------------------------------------------------

KILLED = """
import os, pickle, signal, sys, time
from ur_cartesian_driver.driver.recordings.recorder import BUFFER_COUNT, Recorder
directory, scene = sys.argv[1:]
with open(scene, 'rb') as file:
    order, head, packets = pickle.load(file)
recorder = Recorder(directory, 100.0, print)
recorder.start(order, head, packets[0])
recorder.add_event('cancel', '')
for packet in packets[1:]:
    recorder.add_state(packet)
while recorder._free_buffers.qsize() < BUFFER_COUNT - 1:
    time.sleep(0.001)
os.kill(os.getpid(), signal.SIGKILL)
"""


@pytest.mark.slow
def test_what_a_killed_process_has_written_can_be_read_and_becomes_a_file_later(tmp_path):
    scene, tmp_path = tmp_path / 'scene', tmp_path / 'recordings'
    scene.write_bytes(
        pickle.dumps(
            (JOB, METADATA, [packet(i, runtime_state=RuntimeState.PLAYING) for i in range(1000)])
        )
    )
    ended = subprocess.run([sys.executable, '-c', KILLED, str(tmp_path), str(scene)], check=False)
    assert ended.returncode == -signal.SIGKILL
    folder = only_file(tmp_path)
    assert folder.suffix == '.part'
    cut = Recording.load(folder)
    assert 700 < len(cut.time) < 1000
    np.testing.assert_array_equal(cut.actual_q[:, 0], 0.1 * np.arange(len(cut.time)))
    assert [kind for _, kind, _ in cut.events] == ['start', 'cancel']
    assert cut.metadata['outcome'] is None
    # With the half of a row that the end has left.
    with open(folder / 'executed.npy', 'ab') as rows:
        rows.write(b'half a row')
    assert len(np.load(folder / 'executed.npy')) == len(cut.time)
    record(tmp_path, [packet(0)])
    mended = Recording.load(folder.with_suffix('.npz'))
    np.testing.assert_array_equal(mended.actual_pose, cut.actual_pose)
    assert mended.events == cut.events


def test_a_motion_that_runs_can_be_looked_at_and_is_not_taken_for_a_dead_one(tmp_path):
    recorder = Recorder(str(tmp_path), 100.0, Warnings())
    recorder.start(JOB, dict(METADATA), packet(0))
    for i in range(1, BUFFER_ROWS):
        recorder.add_state(packet(i))
    while recorder._free_buffers.qsize() < BUFFER_COUNT - 1:
        os.sched_yield()
    assert 200 < len(Recording.load(only_file(tmp_path)).time) <= BUFFER_ROWS
    enforce_quota(tmp_path, 1e6)
    assert only_file(tmp_path).suffix == '.part'
    recorder.end(DONE)
    recorder.close(10.0)
    assert len(Recording.load(only_file(tmp_path)).time) == BUFFER_ROWS


@pytest.mark.parametrize('data', [b'', b'no zip', b'PK\x03\x04 no zip either'])
def test_what_is_no_recording_is_refused(tmp_path, data):
    file = tmp_path / 'other.npz'
    file.write_bytes(data)
    with pytest.raises(ValueError, match='no recording'):
        Recording.load(file)
    np.savez(file, other=np.zeros(3))
    with pytest.raises(ValueError, match='metadata'):
        Recording.load(file)


def test_a_damaged_recording_is_refused_in_a_sentence_or_read(tmp_path):
    record(tmp_path, [packet(i) for i in range(20)])
    file = only_file(tmp_path)
    whole = file.read_bytes()
    cuts = [whole[:size] for size in range(0, len(whole), len(whole) // 20)]
    turned = [
        whole[:i] + bytes([whole[i] ^ 0xFF]) + whole[i + 1 :]
        for i in range(0, len(whole), len(whole) // 80)
    ]
    sentences = []
    for data in cuts + turned:
        file.write_bytes(data)
        try:
            Recording.load(file)
        except ValueError as error:
            sentences.append(str(error))
    assert len(sentences) > 40
    assert all(sentence.startswith(f'{file} is ') for sentence in sentences)


def test_a_recording_whose_plan_has_another_type_is_refused(tmp_path):
    record(tmp_path, [packet(i) for i in range(10)])
    with np.load(only_file(tmp_path)) as file:
        columns = {name: file[name] for name in file.files}
    columns['planned_point'] = columns['planned_point'].astype(np.int64)
    np.savez(tmp_path / 'other.npz', **columns)
    with pytest.raises(ValueError, match='planned_point has rows of int64'):
        Recording.load(tmp_path / 'other.npz')


def test_a_recording_with_a_column_too_short_is_refused(tmp_path):
    record(tmp_path, [packet(i) for i in range(20)])
    file = only_file(tmp_path)
    with np.load(file) as recorded:
        columns = dict(recorded)
    np.savez(file, **columns | {'actual_q': columns['actual_q'][:-1]})
    with pytest.raises(ValueError, match=r'is damaged: actual_q has \d+ rows, not \d+'):
        Recording.load(file)


def test_a_session_that_nothing_was_planned_for_has_no_plan(tmp_path):
    metadata = motion_metadata(JOB, robot={}, parameters=DriverConfig(), mode='LIVE_TARGETS')
    record(tmp_path, [packet(i) for i in range(10)], metadata=metadata)
    file = only_file(tmp_path)
    assert file.stem.endswith('_live_targets_0_points')
    found = Recording.load(file)
    assert len(found.planned_time) == 0
    assert np.isnan(found.deviation().position).all()
    enforce_quota(tmp_path, 0.0)
    assert list(tmp_path.iterdir()) == []


def test_the_metadata_have_what_only_the_planner_knew():
    arm, home = Arm(robot_model('ur5e')), (0.0, -1.57, 1.57, -1.57, -1.57, 0.0)
    pose = arm.forward(home)
    x, y, z = pose.position
    made = plan(
        Goal(waypoints=(Waypoint(pose=Pose((x, y + 0.05, z), pose.quaternion)),), frame_id='base'),
        RobotState(
            timestamp=0.0, actual_q=home, target_q=home, actual_tcp_pose=pose, target_tcp_pose=pose
        ),
        arm,
        PlanningOptions(linear_velocity=0.07),
    )
    metadata = motion_metadata(
        job_from_plan(made),
        robot={},
        parameters=DriverConfig(keepalive_period=0.01),
        plan_metadata_json=plan_metadata(made, PlanningOptions(linear_velocity=0.07)),
    )
    assert metadata['report'] == list(made.report)
    assert metadata['frame_id'] == 'base'
    assert metadata['parameters']['linear_velocity'] == 0.07
    assert metadata['parameters']['keepalive_period'] == 0.01
    json.dumps(metadata)


@needs_checkout
def test_the_documented_size_is_that_of_the_packets():
    """At 500 Hz, as the reader of a parameter sees it."""
    size = f'{recording_format.EXECUTED_DTYPE.itemsize * 500 / 1e6:.2f} MB a second'
    for page in ('doc/recordings.md', 'config/driver.yaml'):
        assert size in (CHECKOUT / page).read_text(encoding='utf-8'), page
