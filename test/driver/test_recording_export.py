# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Recordings for other programs: MCAP as the `mcap` library reads it, and CSV."""

import csv
from dataclasses import replace
from datetime import datetime
import importlib
import json
from math import isnan, nan
import re
import sys
from types import ModuleType

import numpy as np
import pytest
from synthetic_recording import only_file, outputs, packet, record, START

from ur_cartesian_driver.cli import main
from ur_cartesian_driver.driver.recordings import message_definitions
from ur_cartesian_driver.driver.recordings.recording import Recording
from ur_cartesian_driver.importing import import_file
from ur_cartesian_driver.motion.geometry.pose import Pose, rotate
from ur_cartesian_driver.motion.state.rtde_state import RuntimeState

NODE = '/ur_cartesian_driver'


def turning(i):
    """A packet of an arm that turns, with a force on its tool."""
    q = np.array([0.1, 0.2, 0.3, 1.0 + 0.01 * i])
    q /= np.linalg.norm(q)
    state = packet(
        i,
        1 + i // 20,
        runtime_state=RuntimeState.PLAYING,
        target_speed_fraction=0.5 if i >= 30 else 1.0,
        actual_tcp_wrench=(1.0 * i, 2.0, -3.0, 0.1, 0.2, 0.3 * i),
    )
    return replace(
        state,
        actual_tcp_pose=Pose(state.actual_tcp_pose.position, tuple(q.tolist())),
        actual_qd=(0.5, 0, 0, 0, 0, 0.001 * i),
    )


def switch(recorder, i):
    if i == 25:
        recorder.add_signals(outputs(0b100))
    if i == 40:
        recorder.add_event('cancel', 'preempted by a newer motion')


@pytest.fixture
def recording(tmp_path):
    record(
        tmp_path / 'made',
        map(turning, range(50)),
        between=switch,
        where=lambda i: (i // 20, 0.5 if i % 2 else nan),
    )
    return only_file(tmp_path / 'made')


@pytest.fixture
def exported(recording, tmp_path):
    pytest.importorskip('mcap_ros2')
    from mcap_topics import read_topics

    assert main(['export', str(recording), '-o', str(tmp_path / 'a.mcap')]) == 0
    return read_topics(tmp_path / 'a.mcap')


def test_the_messages_have_the_values_of_the_packets(exported, recording):
    from mcap_topics import pose_row, twist_row

    topics, metadata = exported
    created = datetime.fromisoformat(Recording.load(recording).metadata['created'])
    states = [turning(i) for i in range(50)]
    joints = topics['/joint_states']
    since = [(time - joints.times[0]) * 1e-9 for time in joints.times]
    assert since == pytest.approx([state.timestamp - START for state in states], abs=1e-9)
    assert joints.times[0] * 1e-9 == pytest.approx(created.timestamp())
    stamps = [message.header.stamp for message in joints.messages]
    assert [1_000_000_000 * stamp.sec + stamp.nanosec for stamp in stamps] == joints.times
    assert joints.messages[0].name[0] == 'shoulder_pan_joint'
    assert [tuple(m.position) for m in joints.messages] == [s.actual_q for s in states]
    assert [tuple(m.velocity) for m in joints.messages] == [s.actual_qd for s in states]
    targets = topics[f'{NODE}/target_joint_states'].messages
    assert [tuple(m.position) for m in targets] == [s.target_q for s in states]
    for prefix in ('actual', 'target'):
        name = f'{NODE}/{"target_" * (prefix == "target")}tcp'
        found = topics[f'{name}_pose'].messages
        wanted = [getattr(s, f'{prefix}_tcp_pose').row() for s in states]
        assert [pose_row(m.pose) for m in found] == wanted
        assert {m.header.frame_id for m in found} == {'base'}
        twists = [twist_row(m.twist) for m in topics[f'{name}_twist'].messages]
        assert twists == [getattr(s, f'{prefix}_tcp_twist') for s in states]
    for message, state in zip(topics['/tf'].messages, states, strict=True):
        measured, target = message.transforms
        assert measured.child_frame_id == 'tool0_controller'
        moved = measured.transform.translation
        assert (moved.x, moved.y, moved.z) == state.actual_tcp_pose.position
        assert target.child_frame_id == 'tool0_controller_target'
    assert json.loads(metadata['robot']) == {'model': 'ur5e'}
    assert json.loads(metadata['outcome'])['text'] == 'Done.'


def test_the_wrench_is_in_the_axes_of_the_tcp(exported):
    topics, _ = exported
    for i, message in enumerate(topics[f'{NODE}/wrench'].messages):
        assert message.header.frame_id == 'tool0_controller'
        turn = turning(i).actual_tcp_pose.quaternion
        for vector, wanted in (
            (message.wrench.force, turning(i).actual_tcp_wrench[:3]),
            (message.wrench.torque, turning(i).actual_tcp_wrench[3:]),
        ):
            in_base = rotate(turn, (vector.x, vector.y, vector.z))
            assert in_base == pytest.approx(wanted, abs=1e-12)


def test_numbers_are_written_where_they_change_and_unknown_ones_never(exported):
    topics, _ = exported

    def values(name):
        topic = topics[f'{NODE}/{name}']
        first = topics['/joint_states'].times[0]
        rows = [round((time - first) / 2e6) for time in topic.times]
        return list(zip(rows, [m.data for m in topic.messages], strict=True))

    assert values('recording/slider') == [(0, 1.0), (29, 1.0), (30, 0.5), (49, 0.5)]
    assert values('speed_scaling')[-1] == (49, 0.5)
    assert values('recording/digital_output') == [(0, -1), (25, -1), (26, 4), (49, 4)]
    assert [row for row, _ in values('recording/buffered')] == list(range(1, 50, 2))
    assert f'{NODE}/recording/analog_output_0' in topics
    assert values('recording/analog_output_0')[0][0] > 25
    deviation = dict(values('recording/deviation_position'))
    assert deviation[49] == pytest.approx(0.001)


def test_the_plan_is_a_path_and_the_events_are_a_log(exported, recording):
    from mcap_topics import pose_row

    topics, _ = exported
    (plan,) = topics[f'{NODE}/plan'].messages
    found = Recording.load(recording)
    assert [list(pose_row(p.pose)) for p in plan.poses] == found.planned_pose.tolist()
    log = topics['/rosout'].messages
    assert [m.msg for m in log] == [text for _, _, text in found.events]
    levels = {m.name.rpartition('.')[2]: m.level for m in log}
    assert (levels['start'], levels['cancel'], levels['end']) == (20, 30, 20)


@pytest.mark.slow
def test_ros_reads_the_messages(exported):
    """The code of the interface packages decodes the bytes, where they are installed."""
    from rclpy.serialization import deserialize_message

    topics, _ = exported
    read = set()
    for topic in topics.values():
        package, _, kind = topic.type.split('/')
        try:
            message_type = getattr(importlib.import_module(f'{package}.msg'), kind)
        except ModuleNotFoundError:
            continue
        read.add(topic.type)
        names = message_type.get_fields_and_field_types()
        message = deserialize_message(topic.data[-1], message_type)
        for name in names:
            assert same(getattr(message, name), getattr(topic.messages[-1], name))
    assert {'sensor_msgs/msg/JointState', 'geometry_msgs/msg/WrenchStamped'} <= read


def same(ours, theirs):
    """Tell whether two messages of different libraries have the same values."""
    if hasattr(ours, 'get_fields_and_field_types'):
        return all(
            same(getattr(ours, name), getattr(theirs, name))
            for name in ours.get_fields_and_field_types()
        )
    return ours == theirs if isinstance(ours, str | int | float) else list(ours) == list(theirs)


def test_a_prefix_is_that_of_frames_and_joints(recording, tmp_path):
    pytest.importorskip('mcap_ros2')
    from mcap_topics import read_topics

    target = tmp_path / 'a.mcap'
    assert main(['export', str(recording), '-o', str(target), '--tf-prefix', 'left_']) == 0
    topics, _ = read_topics(target)
    assert topics['/joint_states'].messages[0].name[2] == 'left_elbow_joint'
    (transform, _) = topics['/tf'].messages[0].transforms
    assert transform.header.frame_id == 'left_base'
    assert transform.child_frame_id == 'left_tool0_controller'


def test_a_recording_without_wrench_is_read_and_exported(recording, tmp_path):
    """Recordings made before the column was added have none."""
    pytest.importorskip('mcap_ros2')
    from mcap_topics import read_topics

    changed(recording, wrench=None)
    assert np.isnan(Recording.load(recording).wrench).all()
    assert main(['export', str(recording.parent), '-o', str(tmp_path / 'a.mcap')]) == 0
    topics, _ = read_topics(tmp_path / 'a.mcap')
    assert f'{NODE}/wrench' not in topics
    assert len(topics['/joint_states'].messages) == 50


def changed(recording, **members):
    """Change members of a recording; None = leave it out."""
    with np.load(recording) as file:
        arrays = {name: file[name] for name in file} | members
    np.savez(recording, **{name: a for name, a in arrays.items() if a is not None})


# ---- CSV ------------------------------------------------------------------------------------


def test_the_table_has_a_line_for_each_packet(recording, tmp_path, capsys):
    assert main(['export', str(recording), '-o', str(tmp_path / 'a.csv')]) == 0
    assert capsys.readouterr().out == f'50 packets: {tmp_path / "a.csv"}\n'
    with open(tmp_path / 'a.csv', encoding='utf-8') as table:
        rows = list(csv.DictReader(table))
    found = Recording.load(recording)
    for title, values in (
        ('time [s]', found.time),
        ('actual_q_0 [rad]', found.actual_q[:, 0]),
        ('target_pose_x [m]', found.target_pose[:, 0]),
        ('actual_pose_qw', found.actual_pose[:, 6]),
        ('wrench_tz [Nm]', found.wrench[:, 5]),
        ('waypoint', found.waypoint),
    ):
        assert [float(row[title]) for row in rows] == values.tolist()
    assert isnan(float(rows[0]['lag [s]']))
    assert float(rows[-1]['deviation_position [m]']) == pytest.approx(0.001)


def test_the_table_is_imported_as_the_recording_is(recording, tmp_path):
    assert main(['export', str(recording), '-o', str(tmp_path / 'a.csv')]) == 0
    of_table, of_recording = (import_file(file) for file in (tmp_path / 'a.csv', recording))
    poses, times = (
        [np.array(getattr(found.goal.waypoints, name)) for found in (of_table, of_recording)]
        for name in ('poses', 'times')
    )
    assert poses[0] == pytest.approx(poses[1], abs=1e-12)
    assert times[0].tolist() == times[1].tolist()
    assert len(poses[0]) == 50


# ---- what goes wrong --------------------------------------------------------------------------


def refused(capsys, *arguments):
    """Return the sentence of a refused export."""
    assert main(['export', *map(str, arguments)]) == 1
    out, err = capsys.readouterr()
    assert out == ''
    assert err.count('\n') == 1
    return err


def test_another_suffix_is_refused(recording, tmp_path, capsys):
    target = tmp_path / 'a.bag'
    assert refused(capsys, recording, '-o', target) == (
        f"ur-cartesian export: {target} has the suffix '.bag', but a recording is written as "
        '.mcap or .csv\n'
    )


def test_without_the_library_one_sentence_says_what_to_install(
    recording, tmp_path, monkeypatch, capsys
):
    monkeypatch.setitem(sys.modules, 'mcap_ros2', None)
    monkeypatch.setitem(sys.modules, 'mcap_ros2.writer', None)
    text = refused(capsys, recording, '-o', tmp_path / 'a.mcap')
    assert 'pip install mcap-ros2-support' in text
    assert "'export'" in text
    assert [path.name for path in tmp_path.iterdir()] == ['made']


def test_a_library_that_is_installed_but_broken_is_not_called_missing(
    recording, tmp_path, monkeypatch, capsys
):
    pytest.importorskip('mcap_ros2')
    monkeypatch.delitem(sys.modules, 'mcap_ros2.writer', raising=False)
    monkeypatch.setitem(sys.modules, 'mcap_ros2._dynamic', broken := ModuleType('broken'))
    monkeypatch.setattr(broken, '__getattr__', _needs_another, raising=False)
    text = refused(capsys, recording, '-o', tmp_path / 'a.mcap')
    assert "No module named 'lz4'" in text
    assert 'not installed' not in text


def _needs_another(name):
    raise ModuleNotFoundError("No module named 'lz4'", name='lz4')


def test_a_message_that_is_not_installed_is_named(recording, tmp_path, monkeypatch, capsys):
    pytest.importorskip('mcap_ros2')
    monkeypatch.setattr(message_definitions, 'installed_share', lambda package: None)
    assert 'install the ROS 2 package' in refused(capsys, recording, '-o', tmp_path / 'a.mcap')
    assert [path.name for path in tmp_path.iterdir()] == ['made']


@pytest.mark.parametrize(
    ('members', 'part'),
    [
        ({'metadata': np.array('{}')}, "'created'"),
        ({'time': np.full(50, nan)}, 'a time is not finite'),
        ({'actual_q': np.zeros((50, 3))}, 'actual_q has rows of'),
        ({'slider': np.full(50, 'a')}, 'slider has rows of'),
        ({'planned_pose': np.zeros((3, 7))}, 'planned_time has|planned_pose has'),
        ({'actual_q': None}, "no array 'actual_q'"),
    ],
    ids=lambda value: '' if isinstance(value, str) else next(iter(value)),
)
def test_a_damaged_recording_is_refused_and_an_older_export_stays(
    recording, tmp_path, capsys, members, part
):
    pytest.importorskip('mcap_ros2')
    target = tmp_path / 'a.mcap'
    target.write_text('of yesterday')
    changed(recording, **members)
    assert re.search(part, refused(capsys, recording, '-o', target))
    assert target.read_text() == 'of yesterday'
    assert sorted(path.name for path in tmp_path.iterdir()) == ['a.mcap', 'made']


def test_a_file_of_another_kind_and_no_place_to_write_are_named(recording, tmp_path, capsys):
    other = tmp_path / 'x.npz'
    other.write_text('no archive')
    assert 'is no recording' in refused(capsys, other)
    with pytest.raises(SystemExit, match='2'):
        main(['export', str(recording), '-o', str(tmp_path / 'nowhere' / 'a.csv')])
    assert f'a.csv cannot be written: there is no folder {tmp_path}' in capsys.readouterr().err
    assert 'there is no recording' in refused(capsys, tmp_path)


def test_a_recording_without_packets_is_not_drawn(tmp_path, capsys):
    record(tmp_path, [packet(0)])
    file = only_file(tmp_path)
    with np.load(file) as found:
        columns = {name: found[name] for name in found.files}
    empty = {
        name: rows if name == 'metadata' or name.startswith(('planned_', 'event')) else rows[:0]
        for name, rows in columns.items()
    }
    np.savez(file, **empty)
    assert main(['plot', str(file)]) == 1
    assert 'has no packets, so there is nothing to draw' in capsys.readouterr().err
