# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Frames of tf2, with a stand-in for its buffer: tf2 is not there without a ROS installation."""

from math import sqrt
import sys

from geometry_msgs.msg import Quaternion, TransformStamped, Vector3
import pytest
from rclpy.duration import Duration

from ur_cartesian_driver.motion.errors import InvalidGoal
from ur_cartesian_driver.motion.geometry.pose import Pose
from ur_cartesian_driver.motion.goal.known_frames import ArmSnapshot, Frames
from ur_cartesian_driver.ros.tf import tf_lookup
from ur_cartesian_driver.ros.tf.tf_lookup import TransformLookup

NOW = 1_800_000_000_000_000_000
SNAPSHOT = ArmSnapshot(Pose((0.4, 0.1, 0.5)), Pose((0.0, 0.0, 0.1)))


class LookupFailed(Exception):
    """As tf2_ros.TransformException."""


class StandInBuffer:
    """Knows some transforms, each with one stamp [ns], as tf2_ros.Buffer does."""

    def __init__(self, **known):
        self.known = known
        self.asked = []

    def lookup_transform(self, target_frame, source_frame, time, timeout=None):
        self.asked.append((target_frame, source_frame, time.nanoseconds, timeout))
        if source_frame not in self.known:
            raise LookupFailed(f'"{source_frame}" passed to lookupTransform does not exist.')
        stamp = self.known[source_frame]
        if time.nanoseconds > stamp > 0:
            raise LookupFailed('Lookup would require extrapolation into the future.')
        message = TransformStamped()
        message.header.frame_id, message.child_frame_id = target_frame, source_frame
        stamp = time.nanoseconds or stamp
        message.header.stamp.sec, message.header.stamp.nanosec = divmod(stamp, 10**9)
        message.transform.translation = Vector3(x=0.1, y=0.2, z=0.3)
        message.transform.rotation = Quaternion(z=sqrt(0.5) + 1e-7, w=sqrt(0.5))
        return message


def frames(prefix='', **known):
    buffer = StandInBuffer(**known)
    made = TransformLookup(buffer, LookupFailed, now=lambda: NOW, max_age=1.0)
    return Frames(prefix).with_transforms(made), buffer


@pytest.mark.parametrize(('prefix', 'base'), [('', 'base'), ('left_', 'left_base')])
def test_an_unknown_frame_is_looked_up_from_the_base(prefix, base):
    made, buffer = frames(prefix, camera=NOW)
    T = made.T_base_frame('camera')
    assert T.apply((1.0, 0.0, 0.0)) == pytest.approx((0.1, 1.2, 0.3), abs=1e-6)
    assert sum(x * x for x in T.quaternion) == pytest.approx(1.0, abs=1e-12)
    ((target, source, at, timeout),) = buffer.asked
    assert (target, source, at) == (base, 'camera', 0)
    assert timeout == Duration(seconds=tf_lookup.LOOKUP_TIMEOUT)


def test_a_stamp_is_passed_on():
    made, buffer = frames(camera=NOW)
    made.T_base_frame('camera', at=NOW - 5)
    assert buffer.asked[0][2] == NOW - 5


def test_frames_that_the_driver_knows_are_not_asked_for():
    made, buffer = frames()
    for name in ('', 'base', 'base_link', 'tool0', 'flange', 'tool0_controller'):
        made.T_base_frame(name, SNAPSHOT)
        if not name.startswith('base'):
            made.T_flange_frame(name, SNAPSHOT)
    assert not buffer.asked


def test_a_missing_transform_refuses_with_name_reason_and_remedy():
    made, _ = frames()
    with pytest.raises(
        InvalidGoal,
        match=(
            r'header\.frame_id is "moon", and tf2 has no transform from it to "base" '
            r'\("moon" passed .* does not exist\); .*static_frames'
        ),
    ):
        made.T_base_frame('moon')
    with pytest.raises(InvalidGoal, match=r'controlled_frame is "moon", and tf2 has no transform'):
        made.T_flange_frame('moon', SNAPSHOT)


def test_a_stamp_beyond_what_was_published_refuses():
    made, _ = frames(camera=NOW - 10**9)
    with pytest.raises(InvalidGoal, match=r'for the stamp of the goal .*extrapolation'):
        made.T_base_frame('camera', at=NOW)


@pytest.mark.parametrize(('age', 'stale'), [(0.9, False), (1.1, True), (-5.0, False)])
def test_the_newest_transform_may_not_be_too_old(age, stale):
    made, _ = frames(camera=NOW - round(age * 1e9))
    if stale:
        with pytest.raises(
            InvalidGoal,
            match=(
                r'"camera", and its newest transform to "base" is 1\.100 s old, tf_max_age is '
                r'1 s'
            ),
        ):
            made.T_base_frame('camera')
    else:
        made.T_base_frame('camera')


def test_a_static_transform_is_never_old():
    made, _ = frames(camera=0)
    made.T_base_frame('camera')


def test_a_tool_is_fixed_to_the_flange_by_static_transforms():
    made, buffer = frames(gripper=0)
    T = made.T_flange_frame('gripper', SNAPSHOT)
    assert T.position == (0.1, 0.2, 0.3)
    assert buffer.asked[0][:3] == ('tool0', 'gripper', 0)


def test_a_frame_that_moves_against_the_flange_cannot_be_controlled():
    made, _ = frames(camera=NOW)
    with pytest.raises(
        InvalidGoal, match=(r'controlled_frame is "camera", which is not fixed to "tool0".*static')
    ):
        made.T_flange_frame('camera', SNAPSHOT)


def test_without_tf2_nothing_is_listened_to(monkeypatch):
    monkeypatch.setitem(sys.modules, 'tf2_ros', None)  # as if it were not there
    assert tf_lookup.listen_to_tf(None, 1.0) is None


def test_a_broken_tf2_is_not_taken_for_a_missing_one(monkeypatch, tmp_path):
    (tmp_path / 'tf2_ros.py').write_text('import tf2_py_that_is_not_there')
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.delitem(sys.modules, 'tf2_ros', raising=False)
    with pytest.raises(ModuleNotFoundError, match='tf2_py_that_is_not_there'):
        tf_lookup.listen_to_tf(None, 1.0)


def test_where_tf2_is_installed_it_is_listened_to(monkeypatch):
    class Tf2Ros:
        Buffer = StandInBuffer
        TransformException = LookupFailed

        class TransformListener:
            unregistered = False

            def __init__(self, buffer, node):
                buffer.known['camera'] = 0

            def unregister(self):
                type(self).unregistered = True

    monkeypatch.setitem(sys.modules, 'tf2_ros', Tf2Ros)
    made = tf_lookup.listen_to_tf(None, 1.0)
    made.T_target_source('trajectory.header.frame_id', 'base', 'camera', at=NOW)
    with pytest.raises(InvalidGoal):
        made.T_target_source('trajectory.header.frame_id', 'base', 'moon')
    made.close()
    assert Tf2Ros.TransformListener.unregistered
