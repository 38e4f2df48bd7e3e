# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""MCAP files as the `mcap` library reads them: topics with their messages."""

from collections import defaultdict
from dataclasses import dataclass

from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory


@dataclass
class Topic:
    type: str
    definition: str
    times: list  # [ns]
    messages: list
    data: list


def read_topics(file):
    """Return the topics of a file, and its metadata."""
    topics = defaultdict(lambda: Topic('', '', [], [], []))
    with open(file, 'rb') as opened:
        reader = make_reader(opened, decoder_factories=[DecoderFactory()])
        for schema, channel, record, message in reader.iter_decoded_messages():
            topic = topics[channel.topic]
            topic.type, topic.definition = schema.name, schema.data.decode()
            topic.times.append(record.log_time)
            topic.messages.append(message)
            topic.data.append(record.data)
        (metadata,) = reader.iter_metadata()
    return dict(topics), metadata.metadata


def pose_row(pose):
    """Return seven numbers of a geometry_msgs/Pose."""
    p, q = pose.position, pose.orientation
    return (p.x, p.y, p.z, q.x, q.y, q.z, q.w)


def twist_row(twist):
    """Return six numbers of a geometry_msgs/Twist."""
    return tuple(getattr(v, axis) for v in (twist.linear, twist.angular) for axis in 'xyz')
